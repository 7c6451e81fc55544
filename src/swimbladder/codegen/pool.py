"""The pool procedure for a vehicle's board: what fits pool, stroke and actuator; its numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from swimbladder.codegen.pool_twin import Rehearsal, float32_twin, rehearse
from swimbladder.control.cascade import CascadeParameters
from swimbladder.control.protocol import POOL
from swimbladder.control.protocol_records import MARGIN, PoolParameters, procedure_for
from swimbladder.control.records import leaves
from swimbladder.control.registry import bind
from swimbladder.control.sea_cascade import SeaCascadeParameters, sea_cascade_gains
from swimbladder.control.supervisor_records import SupervisorParameters
from swimbladder.errors import InputError
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.vehicle import Vehicle

_BANDWIDTH = (
    0.1  # over the sample time, of a loop made for want of a cascade: docs/explanation/laws.md
)
_LEAST_TRAVEL = 0.3  # m, between the depths of rest, as guide.rules has it for a glide
_OVER = 1.0  # m, deeper than the bottom, that a depth may be and count as one


class PoolOptions(NamedTuple):
    """What a person says of the pool and of the day."""

    depth: float  # m, where the vehicle stands on the bottom
    clearance: float = 0.75  # m, from bottom and surface to the depths of rest
    first: float = 20e-6  # m3, change of volume in the first round: the paper's least
    last: float = 75e-6  # m3, in the last: the paper's largest
    rounds: int = 4  # as many as the paper's


class PoolDay(NamedTuple):
    """A pool day of a vehicle: what was asked for, the numbers, and how it went on the model."""

    options: PoolOptions
    parameters: PoolParameters
    own_loop: bool  # the depth is held with the gains of the vehicle's controller
    neutral: float  # m3, at the surface
    rehearsal: Rehearsal

    def to_json(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI."""
        return {
            "depth_m": self.options.depth,
            "rounds": self.options.rounds,
            "minutes": self.rehearsal.minutes,
            "parameters": {
                name: {"value": float(np.float32(value)), "unit": POOL.units[name]}
                for name, value in leaves(self.parameters).items()
            },
        }


def plan_pool_day(
    vehicle: Vehicle, options: PoolOptions, limits: SupervisorParameters, *, seed: int | None,
    progress: Callable[[int], None] | None = None,
) -> PoolDay:  # fmt: skip
    """Return a pool day that a vehicle comes through, flown by the float32 twin.

    Raises InputError as `board_procedure`, NoAnswerError as `rehearse`.
    """
    parameters = board_procedure(vehicle, options, limits)
    flown = rehearse(
        vehicle, float32_twin(parameters, limits), pool_depth=options.depth, seed=seed,
        progress=progress,
    )  # fmt: skip
    own = vehicle.controller is not None and isinstance(
        bind(vehicle.controller)[1], CascadeParameters | SeaCascadeParameters
    )
    return PoolDay(options, parameters, own, plant(vehicle).V_0, flown)


def pool_summary(day: PoolDay) -> str:
    """Return what the command line says of a pool day, one line."""
    facts = pool_facts(day)
    return (
        f"pool day: {facts['rounds']} rounds of {facts['volumes']} between {facts['deep']} and "
        f"{facts['shallow']} m; on the model it takes {facts['minutes']} min"
    )


def pool_facts(day: PoolDay) -> dict[str, Any]:
    """Return what the templates say of a pool day."""
    p, options = day.parameters, day.options
    words = [
        (f"{f.step.upper()}_{f.does.name}" if f.step else f.does.name, f.words) for f in p.phases
    ]
    first, last = (f"{volume * 1e6:g}" for volume in (options.first, options.last))
    return {
        "rounds": options.rounds, "phase_names": [name for name, _ in words],
        "phase_words": words, "pool_depth": f"{options.depth:g}", "deep": f"{p.deep:.4g}",
        "shallow": f"{p.shallow:.4g}", "bottom": f"{p.bottom:.4g}",
        "volumes": f"{first} cm3" if first == last else f"{first} to {last} cm3",
        "minutes": f"{day.rehearsal.minutes:.0f}", "trim": f"{day.neutral * 1e6:.3g}",
        "end_volume": f"{p.end_volume * 1e6:.3g}", "patience": f"{p.patience:g}",
        "blind": f"{p.blind:g}", "own_loop": day.own_loop,
        "pool_header": "time_s,depth_m,volume_m3,voltage_V,phase",
    }  # fmt: skip


def board_procedure(
    vehicle: Vehicle, options: PoolOptions, limits: SupervisorParameters
) -> PoolParameters:
    """Return the procedure for a vehicle; limits: its supervisor's, whose sensor limits it takes.

    The depth is held by the vehicle's own cascade where its controller has such gains, else by one
    made from the model: a cascade has no filter that a vehicle yet to be identified could mislead.
    Raises InputError for what does not fit pool, stroke or actuator.
    """
    p = plant(vehicle)
    if p.positioner > 0.0:
        raise InputError(
            "the procedure changes the volume by a voltage for a time, and this actuator takes "
            "positions",
            field="--pool", value=vehicle.actuator.kind,
            remedy="Do the steps by hand, with the sketch that holds a depth",
        )  # fmt: skip
    S_p = limits.S_p
    sensors = vehicle.sensors
    margin = max(MARGIN, 6.0 * sensors.depth_noise + 2.0 * sensors.depth_quantum)
    _check_pool(options, p, limits, margin)
    _check_volumes(options, p, limits)
    top = limits.volume.volume_high
    lifts = top > p.V_0 + limits.neutral.neutral_range + p.psi * options.depth
    one = procedure_for(
        _loop(vehicle, p, S_p), rate_per_volt=p.gain, limit=p.supply,
        load_voltage=p.load_drive + p.k_l / p.gain, pool_depth=options.depth,
        clearance=options.clearance, change=options.first,
    )  # fmt: skip
    return one._replace(
        shallow=p.z_surface + options.clearance, surface=p.z_surface + margin,
        bottom=options.depth - margin, rounds=float(options.rounds),
        more=(options.last - options.first) / max(options.rounds - 1, 1),
        depth_least=limits.depth.depth_least, depth_most=options.depth + _OVER,
        volume_least=limits.volume.volume_least, volume_most=limits.volume.volume_most,
        end_volume=top if lifts else p.V_max,
    )  # fmt: skip


def _loop(vehicle: Vehicle, p: Plant, S_p: float) -> CascadeParameters:
    if vehicle.controller is not None:
        _, own = bind(vehicle.controller)
        if isinstance(own, CascadeParameters):
            return own
        if isinstance(own, SeaCascadeParameters):
            return CascadeParameters(*own.gains, S_p)
    made = sea_cascade_gains(p.a_b, p.d_l, p.gain, bandwidth=_BANDWIDTH / S_p, S_p=S_p)
    return CascadeParameters(*made, S_p)


def _check_pool(
    options: PoolOptions, p: Plant, limits: SupervisorParameters, margin: float
) -> None:
    """Raise InputError unless there is room between surface and bottom."""
    if not options.clearance > 2.0 * margin:
        raise InputError(
            f"a vehicle within {margin:.3g} m of surface or bottom counts as arrived there, and "
            "has to rest clear of it",
            field="--pool-clearance", value=options.clearance, unit="m",
            remedy=f"Give more than {2.0 * margin:.3g} m",
        )  # fmt: skip
    travel = options.depth - p.z_surface - 2.0 * options.clearance
    if not travel >= _LEAST_TRAVEL:
        raise InputError(
            f"this leaves {travel:.3g} m between the depths of rest, {options.clearance:.3g} m "
            "from surface and bottom",
            field="--pool", value=options.depth, unit="m",
            remedy="Choose a deeper pool or a smaller --pool-clearance",
        )  # fmt: skip
    if not options.depth < limits.deep.depth_limit:
        raise InputError(
            "the supervisor brings the vehicle up from there",
            field="--pool", value=options.depth, unit="m",
            remedy=f"Stay above {limits.deep.depth_limit:.4g} m, or see supervisor.depth_limit",
        )  # fmt: skip


def _check_volumes(options: PoolOptions, p: Plant, limits: SupervisorParameters) -> None:
    """Raise InputError unless stroke and trim leave room for every change of volume."""
    if options.rounds < 1:
        raise InputError(
            "there has to be one at least", field="--pool-rounds", value=options.rounds,
            remedy="Leave it out for four",
        )  # fmt: skip
    if options.rounds == 1 and options.first != options.last:
        raise InputError(
            "one round has one change of volume", field="--pool-volumes",
            value=f"{options.first * 1e6:g}:{options.last * 1e6:g} cm3",
            remedy="Give a single volume, or more --pool-rounds",
        )  # fmt: skip
    deep = p.V_0 + p.psi * (options.depth - options.clearance)
    shallow = p.V_0 + p.psi * (p.z_surface + options.clearance)
    high, low = max(deep, shallow), min(deep, shallow)
    ends, unsure = limits.volume, limits.neutral.neutral_range
    fits = min(ends.volume_high - high, low - ends.volume_low) - unsure
    if not fits > 0.0:
        raise InputError(
            "the stroke has no room for a change of volume, should the neutral volume be off by "
            f"{unsure * 1e6:.3g} cm3 (supervisor.neutral_range)",
            field="--pool", value=options.depth, unit="m", remedy="Trim the vehicle to mid-stroke",
        )  # fmt: skip
    for change in (options.first, options.last):
        if not 0.0 < change <= fits:
            raise InputError(
                "a change of volume has to be above 0 and to fit the stroke, should the neutral "
                f"volume be off by {unsure * 1e6:.3g} cm3",
                field="--pool-volumes", value=change * 1e6, unit="cm3",
                remedy=f"Give at most {fits * 1e6:.3g} cm3, or a smaller supervisor.neutral_range",
            )  # fmt: skip
