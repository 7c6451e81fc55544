"""What a law of volume changes does with floats of the region: there and back, then holding.

Half of the flights go down a step, the other half up it, so that what is said of a range of depths
is of both ways. A flight has arrived for good when it is last outside the tolerance, or 2 % of the
step where that is more. Energy is that of pump and valve from the battery's cells.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Law
from swimbladder.control.records import leaves
from swimbladder.design.tuning.float_flights import Asked, Flights, fly_floats
from swimbladder.design.tuning.knobs import with_supply
from swimbladder.design.tuning.region import Region
from swimbladder.design.tuning.trial import Step, Traces, Trial, percentile
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]
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
