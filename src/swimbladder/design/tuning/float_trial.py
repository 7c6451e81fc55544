"""What a law of volume changes does with floats of the region: there and back, then holding.

Half of the flights go down a step, the other half up it, so that what is said of a range of depths
is of both ways. A flight has arrived for good when it is last outside the tolerance, or 2 % of the
step where that is more. Energy is that of pump and valve from the battery's cells.

Flights of floats under a law of volume changes, many at once, in the closed loop.

Each goes to a depth and keeps it, from any depth, speed and volume, with a drive and a hull that
differ from what the law's processor knows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.control.law import Law
from swimbladder.control.records import leaves
from swimbladder.design.tuning.gains import with_supply
from swimbladder.design.tuning.region import Region
from swimbladder.design.tuning.trial import Step, Traces, Trial, percentile
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.dynamics import body_plant
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop import simulate_ensemble
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

VARIED = ("drag", "psi", "pump", "valve", "V_0")
"""What may differ from flight to flight: factors, but psi [m3/m] and V_0 [m3]."""

_DRAG = ("d_l", "d_b", "d_0", "d_t")
_FINEST = 1e-3  # s, of the times between a law's samples
_LONGEST = 30.0  # s, of a tick: runs of the drive that last longer than a sleep end at one


@dataclass(frozen=True, kw_only=True)
class Asked:
    """Where flights begin, where they are to go, and for how long; numbers or [flights]."""

    targets: ArrayLike  # m; 0: to the surface
    depths: ArrayLike  # m, at the start
    duration: float  # s
    speeds: ArrayLike = 0.0  # m/s, positive down
    volumes: ArrayLike | None = None  # m3, neutral where not given
    tick: float | None = None  # s, of the trajectories; None: what the law's times are made of


@dataclass(frozen=True, kw_only=True)
class Flights:
    """Trajectories on common times [n, flights], and the actions of each flight."""

    time: Array  # s [n]
    depth: Array  # m
    speed: Array  # m/s, positive down
    volume: Array  # m3
    energy: Array  # J of pump and valve [flights]; where it is not known, work on the water
    stopped: NDArray[np.bool_]  # flights that ended early: out of the water, or far too deep
    actions: tuple[Array, ...]  # [actions, 2]: time [s], change asked for [m3]; positive: pumped


def fly_floats(
    vehicle: Vehicle,
    law: Law,
    parameters: Any,
    asked: Asked,
    *,
    vary: Mapping[str, ArrayLike] | None = None,
    column: Column | None = None,
    seed: int | None = None,
) -> Flights:
    """Return the flights that are asked for, under the law with these parameters.

    vary: of `VARIED`. column: the water, the vehicle's own, psi z + trim_error, where not given.
    seed: of the sensors' noise; None: none.
    """
    inputs = (asked.targets, asked.depths, asked.speeds, *(vary or {}).values())
    every = np.broadcast_arrays(*(np.atleast_1d(np.asarray(x, float)) for x in inputs))
    if asked.volumes is not None:
        every = np.broadcast_arrays(*every, np.asarray(asked.volumes, float))
    targets, depths, speeds = every[:3]
    drawn = dict(zip(vary or {}, every[3:], strict=False))
    drag = drawn.pop("drag", None)
    if drag is not None:
        body = body_plant(vehicle)
        drawn |= {name: getattr(body, name) * drag for name in _DRAG}
    if column is None:  # parts of the hull are for the water of a cast
        plain = vehicle.hull.model_copy(update={"parts": (), "trapped_air": 0.0})
        vehicle = vehicle.model_copy(update={"hull": plain})
    data = simulate_ensemble(
        vehicle,
        count=len(targets),
        setpoints=[(0.0, targets)],
        duration=asked.duration,
        start_depth=depths,
        start_speed=speeds,
        start_volume=None if asked.volumes is None else every[-1],
        vary=drawn,
        seed=seed,
        law=law,
        parameters=parameters,
        sample_time=asked.tick or _tick(parameters),
        keep="trajectory",
        column=column,
    )
    time, command = data["time"].to_numpy(), data["command"].to_numpy()
    stopped = data["stop"].to_numpy() != 0
    actions = tuple(np.stack([time[own != 0.0], own[own != 0.0]], axis=1) for own in command.T)
    depth, speed, volume = (data[name].to_numpy() for name in ("depth", "speed", "volume"))
    return Flights(
        time=time,
        depth=depth,
        speed=speed,
        volume=volume,
        energy=data["energy"].to_numpy(),
        stopped=stopped,
        actions=actions,
    )


def _tick(parameters: Any) -> float:
    """Return the longest tick [s] that the times of a law are whole multiples of."""
    times = [round(getattr(parameters, name) / _FINEST) for name in ("dead", "run")]
    whole = math.gcd(*times)
    return _FINEST * whole / math.ceil(whole * _FINEST / _LONGEST)


_SHARE = 0.02  # of the step


class Drawn(NamedTuple):
    """Which floats are flown, and in what."""

    runs: int
    region: Region | None = None  # that they are drawn from; None: the nominal one
    supply: float = math.inf  # V; the vehicle's where infinite
    column: Column | None = None  # the water, the vehicle's own where None
    seed: int = 1


def arrival_band(law: Law, parameters: Any, step: Step) -> float:
    """Return how near to its depth a float counts as there [m]."""
    return max(_SHARE * abs(step.target - step.start), float(leaves(parameters)[law.band]))


def draw_floats(vehicle: Vehicle, drawn: Drawn) -> dict[str, Array]:
    """Return floats drawn evenly from among a region's members, as `fly_floats` varies them."""
    region, runs = drawn.region, drawn.runs
    if region is None:
        return {}
    rng = np.random.default_rng(drawn.seed)
    chosen = rng.integers(0, len(region.plants), runs)
    inside = np.sqrt(rng.uniform(size=runs))  # from the middle towards the boundary
    nominal = region.plants[0]
    drags = np.array([_drag(p) / _drag(nominal) for p in region.plants])
    psi = np.array([p.psi for p in region.plants])
    pump, valve = np.array(region.drives).T
    edges = {"drag": drags, "psi": psi, "pump": pump, "valve": valve}
    found = {n: x[0] + inside * (x[chosen] - x[0]) for n, x in edges.items()}
    off = rng.uniform(-region.neutral, region.neutral, runs)
    return found | {"V_0": vehicle.trim_error + off}


def _drag(p: Any) -> float:
    return float(p.d_t if p.d_t > 0.0 else p.d_l)


def float_trial(vehicle: Vehicle, law: Law, parameters: Any, step: Step, drawn: Drawn) -> Trial:
    """Return what comes of the flights; as `trial.trial`, with settling into the tolerance."""
    flown, targets = _flights(vehicle, law, parameters, step, drawn)
    time, span = flown.time, abs(step.target - step.start)
    error = flown.depth - targets
    band = arrival_band(law, parameters, step)
    outside = ~(np.abs(error) <= band) | flown.stopped
    last = len(time) - np.argmax(outside[::-1], axis=0)
    last[~outside.any(axis=0)] = 0
    settled = last < len(time)
    settle = np.where(settled, time[np.minimum(last, len(time) - 1)], np.inf)
    beyond = np.where(targets == step.target, 1.0, -1.0) * np.sign(step.target - step.start)
    over = np.maximum(np.nanmax(beyond * error, axis=0) / span, 0.0)
    late = time >= time[-1] * 2.0 / 3.0
    seconds = float(time[late][-1] - time[late][0])
    begin = float(time[late][0])
    since = [a[a[:, 0] >= begin, 1] for a in flown.actions]
    spent = [energy_of(vehicle, flown, lane) for lane in range(drawn.runs)]
    pairs = zip(flown.actions, spent, strict=True)
    shares = np.array([e[a[:, 0] >= begin].sum() / max(e.sum(), 1e-12) for a, e in pairs])
    return Trial(
        runs=drawn.runs,
        settled=float(settled.mean()),
        settle_median=percentile(settle, 50.0),
        settle_95=percentile(settle, 95.0),
        overshoot_median=float(np.percentile(over, 50.0)),
        overshoot_95=float(np.percentile(over, 95.0)),
        rms=float(np.sqrt(np.mean(error[late] ** 2))),
        rate=float(np.mean([np.abs(a).sum() for a in since])) / seconds,
        starts=float(np.mean([np.sum(a > 0.0) for a in since])) / seconds,
        turns=float(np.mean([np.sum(a < 0.0) for a in since])) / seconds,
        energy=float(np.mean(flown.energy)),
        power=float(np.mean(flown.energy * shares)) / seconds,
    )


def energy_of(vehicle: Vehicle, flown: Flights, lane: int) -> Array:
    """Return the energy of each action of a flight [J], by the drive at the depth of its begin."""
    times, changes = flown.actions[lane].T
    depth = np.interp(times, flown.time, flown.depth[:, lane])
    d = drive_map(vehicle, vehicle.water.specific_weight * np.maximum(depth, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        pumped = (changes + d.start_volume) / d.rate_out * d.power_out
        let_in = -changes / d.rate_in * d.power_in
    found: Array = np.nan_to_num(np.where(changes > 0.0, pumped, let_in))
    return found


def float_traces(vehicle: Vehicle, law: Law, parameters: Any, step: Step, drawn: Drawn) -> Traces:
    """Return the first flights of a trial as they went; the command: changes asked for [m3]."""
    flown, _ = _flights(vehicle, law, parameters, step, drawn)
    command = np.zeros_like(flown.depth)
    for lane, acts in enumerate(flown.actions):
        at = np.minimum(np.searchsorted(flown.time, acts[:, 0]), len(flown.time) - 1)
        np.add.at(command[:, lane], at, acts[:, 1])
    return Traces(flown.time, flown.depth, flown.volume, command)


def _flights(
    vehicle: Vehicle, law: Law, parameters: Any, step: Step, drawn: Drawn
) -> tuple[Flights, Array]:
    column = drawn.column
    down = np.arange(drawn.runs) % 2 == 0
    targets, depths = np.where([down, ~down], step.target, step.start)
    medium = medium_of(vehicle, column, reach=max(step.start, step.target))
    ballasted = np.where(
        down, medium.neutral_volume(step.start), medium.neutral_volume(step.target)
    )
    asked = Asked(targets=targets, depths=depths, duration=step.duration, volumes=ballasted)
    vary = draw_floats(vehicle, drawn)
    low = with_supply(vehicle, drawn.supply)
    return fly_floats(
        low, law, parameters, asked, vary=vary, column=column, seed=drawn.seed
    ), targets
