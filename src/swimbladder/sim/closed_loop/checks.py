"""Whether a vehicle can be asked for depths, and whether its law holds it at its sample time."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from swimbladder.control.law import Law, Measurement, from_leaves, leaves, smooth
from swimbladder.design.linear.margins import spectral_radius
from swimbladder.design.linear.sampled import BoundLaw, LinearLaw, linearise_law, loop_of
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.dynamics import plant
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.sim.closed_loop.water import Medium
from swimbladder.sim.engine.modes import NO_LAYERS
from swimbladder.vehicle import PumpAndValve, Vehicle

_GROWS = 1e-4  # of an error over a sample; of three integrators, which do not, 1e-5 is computed
_HALVINGS = 12  # of the sample time, after which it is not what makes a loop unstable


def check_depths(
    vehicle: Vehicle, medium: Medium, *, setpoints: Sequence[float], start_depth: float | None
) -> None:
    """Raise InputError where a depth [m] is not one that the vehicle can be asked for.

    That is above the surface, below the bottom or the vehicle's rating, or where the stroke does
    not reach the neutral volume. start_depth: None where the vehicle does not start neutral.
    """
    places = [(f"setpoints[{i}].depth", depth) for i, depth in enumerate(setpoints)]
    if start_depth is not None and math.isfinite(start_depth):
        places.insert(0, ("start_depth", start_depth))
    for field, depth in places:
        _check_depth(vehicle, depth, medium.plant.z_bottom, field)
        _check_stroke(vehicle, medium, depth, field)


def turned_round(depth: float, limit: float, field: str) -> InputError:
    """Return the error for a depth [m] beyond that at which the supervisor turns a vehicle round.

    limit [m]: that depth. field: where the depth was asked for.
    """
    what = f"the supervisor turns the vehicle round at {limit:.4g} m"
    remedy = "Ask for less depth, or say more of the vehicle in its [supervisor] table"
    return InputError(what, field=field, value=depth, unit="m", remedy=remedy)


def check_dive(vehicle: Vehicle) -> None:
    """Raise NoAnswerError where a vehicle that floats can let nothing in."""
    top = max(vehicle.hull.emergence_depth, 0.0)
    drive = drive_map(vehicle, top * vehicle.water.specific_weight, power=False)
    if max(float(drive.rate_in[0]), float(drive.bypass_in[0])) > 0.0:
        return
    a = vehicle.engine
    why = "its drive draws nothing in there"
    if isinstance(a, PumpAndValve):
        over = a.internal_pressure - ATMOSPHERIC_PRESSURE
        much = f"{over / 1e5:.2g} bar above" if over > 0.0 else "no less than"
        why = (
            f"the gas in the hull (actuator.internal_pressure) is {much} the atmosphere, and "
            "nothing presses the oil back. Close the hull at a lower pressure"
        )
    raise NoAnswerError(f"the vehicle {vehicle.name!r} floats and does not dive: {why}")


def law_at_rest(
    law: Law, parameters: Any, vehicle: Vehicle, *, depth: float, sample_time: float
) -> LinearLaw:
    """Return the linear form of a law that holds a vehicle at `depth` [m], called every sample."""
    seen = Measurement(0.0, depth, vehicle.neutral_volume(depth))
    return linearise_law(BoundLaw(law, smooth(law, parameters), sample_time), seen)


def check_sample_time(
    vehicle: Vehicle, law: Law, parameters: Any, sample_time: float, *, depths: Sequence[float]
) -> None:
    """Raise InputError where the law holds the vehicle at a shorter sample time, and not at this.

    By the eigenvalues of the sampled loop at the depths [m]. Nothing is said of a law that is not
    linear around rest, or that holds the vehicle at no sample time.
    """
    for depth in (min(depths), max(depths)):
        growth = partial(_growth, vehicle, law, parameters, depth=depth)
        grows = growth(sample_time)
        if grows is None or grows - 1.0 <= _GROWS:
            continue

        def held(h: float, growth: Callable[[float], float | None] = growth) -> bool:
            grows = growth(h)
            # in one time, not one sample: what grows at any sample time is not held by a short one
            return grows is not None and grows - 1.0 <= _GROWS * h / sample_time

        holds = next(filter(held, (0.5**n * sample_time for n in range(1, _HALVINGS + 1))), None)
        if holds is None:
            continue
        fails = 2.0 * holds
        while fails > 1.01 * holds:
            between = 0.5 * (holds + fails)
            holds, fails = (between, fails) if held(between) else (holds, between)
        raise InputError(
            f"the law {law.name!r} does not hold {vehicle.name!r} at {depth:g} m with so long a "
            f"sample time: an error grows {grows:.3g}-fold from sample to sample",
            field="controller.sample_time",
            value=sample_time,
            unit="s",
            remedy=f"Sample every {0.99 * holds:.3g} s or sooner, or tune the law for this time "
            "(`swimbladder tune --sample-time`)",
        )


def _growth(
    vehicle: Vehicle, law: Law, parameters: Any, sample_time: float, depth: float
) -> float | None:
    """Return the spectral radius of the sampled loop [-]; None for a law that is not linear."""
    kind = type(parameters)
    parameters = from_leaves(kind, {**leaves(parameters), "S_p": sample_time})
    linear = law_at_rest(law, parameters, vehicle, depth=depth, sample_time=sample_time)
    if not (linear.smooth and math.isfinite(np.sum(linear.system.A) + np.sum(linear.system.D))):
        return None
    p = plant(vehicle)
    ways = (False,) if p.positioner else (False, True)
    with np.errstate(over="ignore", invalid="ignore"):  # of days between two samples
        closed = [loop_of(p, linear, depth=depth, back_driving=back).closed() for back in ways]
    if not np.isfinite(closed).all():
        return math.inf
    return max(map(spectral_radius, closed))


def _check_depth(vehicle: Vehicle, depth: float, bottom: float, field: str) -> None:
    problem = partial(InputError, field=field, value=depth, unit="m")
    if depth < 0.0:
        raise problem("the depth is above the surface", remedy="Depths are positive downwards")
    if depth > bottom:
        remedy = f"Give a depth of at most {bottom:g} m, or a deeper bottom"
        raise problem(f"the depth is below the bottom at {bottom:g} m", remedy=remedy)
    limit = vehicle.hull.depth_limit
    if limit is not None and depth > limit:
        what = f"the vehicle {vehicle.name!r} is rated for {limit:g} m (hull.depth_limit)"
        raise problem(what, remedy=f"Ask for {limit:g} m at most")


def _within_stroke(vehicle: Vehicle, outwards: bool) -> str:
    """Return what to do where the stroke ends, at its largest volume (outwards) or its least."""
    end = vehicle.stroke.highest if outwards else vehicle.stroke.lowest
    psi, over = vehicle.hull.psi, end - vehicle.trim_error
    if psi == 0.0 or over / psi <= 0.0:  # at no depth, or at none below the surface
        return "Trim the vehicle otherwise (trim_error), or lengthen the stroke"
    depth = over / psi
    if outwards != (psi > 0.0):
        return f"The stroke suffices below {depth:.4g} m: ask for more, or lengthen it"
    less = " by more than a step overshoots, for what passes that depth sinks" if outwards else ""
    return f"The stroke ends at {depth:.4g} m: ask for less{less}, or lengthen the stroke"


def _check_stroke(vehicle: Vehicle, medium: Medium, depth: float, field: str) -> None:
    stroke, neutral = vehicle.stroke, medium.neutral_volume(depth)
    if stroke.lowest < neutral < stroke.highest:
        return
    if medium.layers is NO_LAYERS:
        where, remedy = "there", _within_stroke(vehicle, neutral >= stroke.highest)
    else:
        where = "there, in the water of the cast"
        remedy = "Trim the vehicle for this water (`swimbladder ballast --cast` says how, and "
        remedy += "writes the vehicle), or lengthen the stroke"
    what = (
        f"the stroke is smaller than the neutral volume {where}: {neutral * 1e6:.4g} cm3 is "
        f"outside {stroke.lowest * 1e6:g} to {stroke.highest * 1e6:g} cm3"
    )
    raise InputError(what, field=field, value=depth, unit="m", remedy=remedy)
