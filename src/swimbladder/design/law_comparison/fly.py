"""One law on one scenario: many runs, each with noise of its own, and what came of them.

What swell does to the depth that a drifting vehicle reads is by linear wave theory. A body as light
as the water it displaces, and small against the waves, is moved by them as that water is: the
pressure gradient drives its mass and its added mass alike, so that against the water it keeps the
speed it had, and drag sees no waves. The pressure of water that goes its own way does not change
(D'Asaro, *J. Atmos. Oceanic Technol.* 32, 2015, "Surface wave measurements from subsurface
floats"). What a sensor reads of the waves is then only what the hull's length leaves: the hull goes
with the mean of the water along it, the sensor sits at one end::

    reading - depth in the water = sum a cos(w t + f) [exp(-k z) - exp(-k z_c) sinh(k L/2)/(k L/2)]

w^2 = g k (deep water; Dean and Dalrymple, *Water Wave Mechanics for Engineers and Scientists*,
1991, ch. 3 and 4), z the depth of the sensor, z_c that of the hull's middle, L its length. Depths
in swell are depths in the water: below the surface that goes with it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.design.law_comparison.contenders import BAND, Contender, Placed, Swell
from swimbladder.design.tuning.region import Region
from swimbladder.design.tuning.trial import (
    draw,
    motor_starts,
    motor_turns,
    percentile,
    random_walk,
    winding,
)
from swimbladder.errors import NoAnswerError
from swimbladder.physics.buoyancy_engine import check_power_known
from swimbladder.physics.dynamics import plant
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop import simulate_ensemble
from swimbladder.sim.closed_loop.block import schedule
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.vehicle import Positioner, Vehicle

Array = NDArray[np.float64]


def wavenumber(period: float, g: float) -> float:
    """Return the wave number k [1/m] of a wave in deep water: w^2 = g k."""
    return (2.0 * math.pi / period) ** 2 / g


def amplitude(swell: Swell) -> float:
    """Return the amplitude of each of the waves [m]: sixteen times the variance is the height^2."""
    return swell.height * math.sqrt(2.0 / (16.0 * len(swell.periods)))


def depth_error(
    swell: Swell, vehicle: Vehicle, time: Array, *, depth: float, runs: int, seed: int
) -> Array:
    """Return what the sensor reads beyond the depth in the water [samples, runs] in m.

    time [s, samples]; depth [m]: of the sensor, about which the vehicle is held. The phases of the
    waves are each run's own.
    """
    g, hull = vehicle.water.gravity, vehicle.hull
    middle = depth - hull.emergence_depth + 0.5 * hull.height
    phases = np.random.default_rng([seed, 2]).uniform(
        0.0, 2.0 * math.pi, (runs, len(swell.periods))
    )
    found: Array = np.zeros((len(time), runs))
    for n, period in enumerate(swell.periods):
        k = wavenumber(period, g)
        half = 0.5 * k * hull.height
        mean = math.exp(-k * middle) * math.sinh(half) / half
        read = amplitude(swell) * (math.exp(-k * depth) - mean)
        found += read * np.cos((2.0 * math.pi / period) * time[:, None] + phases[None, :, n])
    return found


_SHOWN = 900.0  # s of the first run of a hold that are kept to be drawn; of a step all of it


class Flown(NamedTuple):
    """What was measured in each run [runs]."""

    settle: Array  # s, to 2 % for good, a float within `BAND`; nan: never
    overshoot: Array  # -, of the step
    square: Array  # m2, mean squared depth error while it counts
    farthest: Array  # m, largest depth error while it counts
    volume_rate: Array  # m3/s, moved to and fro while it counts
    starts: Array  # 1/s, of the motor from rest while it counts; of a float all runs of the drive
    turns: Array  # 1/s, of the motor, from one direction into the other
    power: Array  # W, electrical, mean of the whole run; nan where it is not known
    stopped: Array  # 1: the run ended before its time, or left the hull's rated depths


class Result(NamedTuple):
    """A law on a scenario, over all runs; nan where it has no meaning or is not known."""

    runs: int
    settled: float  # share of the runs
    settle_median: float  # s
    settle_95: float  # s
    overshoot_median: float  # -
    overshoot_95: float  # -
    rms: float  # m, of the depth error
    farthest: float  # m
    volume_rate: float  # m3/s
    starts: float  # 1/s
    turns: float  # 1/s
    power: float  # W
    lost: float  # share of the runs

    @property
    def starts_and_turns(self) -> float:
        """How often the motor begins to turn, from rest or from the other direction [1/s]."""
        return self.starts + self.turns


def no_energy(vehicle: Vehicle) -> str | None:
    """Return why the electrical energy is not known; None where it is."""
    if vehicle.command == "volume change":
        try:
            check_power_known(vehicle)
        except NoAnswerError as error:
            return str(error)
        return None
    if winding(vehicle) is not None:
        return None
    if isinstance(vehicle.actuator, Positioner):
        return "nothing is known of the motor behind the positioner"
    return "R and k_T of the motor are not known"


def fly(
    vehicle: Vehicle,
    who: Contender,
    placed: Placed,
    *,
    region: Region,
    runs: int,
    seed: int,
    column: Column | None = None,
) -> tuple[Flown, Array, Array]:
    """Return what was measured, and time [s] and depth [m] of the first run, to be looked at.

    column: the water, the vehicle's own where not given.
    Every law meets the same noise, waves, drift and vehicles: those of the seed.
    """
    data, time = _flown(vehicle, who, placed, region, column, runs=runs, seed=seed)
    flown = measure(
        time=time, depth=data["depth"].to_numpy(), volume=data["volume"].to_numpy(),
        settle=data["settle2"].to_numpy(), overshoot=data["overshoot"].to_numpy() / 100.0,
        target=placed.target, counted=placed.scenario.counted,
        energy=data["energy"].to_numpy() if "energy" in data else np.full(runs, np.nan),
    )  # fmt: skip
    if vehicle.command == "volume change":
        runs_of_drive = data["pump_runs"].to_numpy() + data["valve_runs"].to_numpy()
        outside = np.abs(data["depth"].to_numpy() - placed.target) > BAND
        last = len(time) - 1 - np.argmax(outside[::-1], axis=0)
        settle = np.where(outside.any(axis=0), time[last], 0.0)
        flown = flown._replace(
            settle=np.where(outside[-1], np.nan, settle), starts=runs_of_drive / float(time[-1]),
            turns=np.zeros(runs),
        )  # fmt: skip
    rating = vehicle.hull.depth_limit
    crushed = data["greatest_depth"].to_numpy() > (math.inf if rating is None else rating)
    lost = (data["stop"].to_numpy() != 0) | crushed
    kept = time <= (placed.duration if placed.is_step else _SHOWN)
    first: Array = data["depth"].to_numpy()[kept, 0]
    return flown._replace(stopped=lost.astype(float)), time[kept], first


def _flown(
    vehicle: Vehicle,
    who: Contender,
    placed: Placed,
    region: Region,
    column: Column | None,
    *,
    runs: int,
    seed: int,
) -> tuple[Any, Array]:
    """Return the ensemble and its time [s]."""
    s, h = placed.scenario, who.sample_time
    clock = schedule([0.0], placed.duration, h)
    time: Array = h * np.arange(clock.ticks + 1, dtype=np.float64)
    medium = medium_of(vehicle, column, reach=max(placed.start, placed.target))
    vary: dict[str, ArrayLike] = {}
    if s.drawn:
        vary |= draw(region, runs=runs, seed=seed, medium=medium)
    if vehicle.voltage_driven:
        vary["supply"] = s.supply * plant(vehicle).supply
    error: Array | None = None
    walk: Array | None = None
    if s.swell is not None:
        error = depth_error(
            s.swell, vehicle, time, depth=placed.target, runs=runs, seed=seed
        )  # fmt: skip
    if s.walk > 0.0:
        walk = random_walk(s.walk, placed.duration, sample_time=h, runs=runs, seed=seed)
    pumped = vehicle.command == "volume change"  # neutral is then what its stepper makes of it
    neutral = None if pumped else medium.neutral_volume(placed.start)
    data = simulate_ensemble(
        vehicle, count=runs, setpoints=[(0.0, placed.target)], duration=placed.duration,
        start_depth=placed.start, start_volume=neutral, vary=vary,
        seed=seed, law=who.law, parameters=who.parameters, sample_time=h, depth_error=error,
        neutral_change=walk, column=column, keep="trajectory", books=no_energy(vehicle) is None,
        workers=1,
    )  # fmt: skip
    return data, time


def measure(
    *, time: Array, depth: Array, volume: Array, settle: Array, overshoot: Array, target: float,
    counted: float, energy: Array,
) -> Flown:  # fmt: skip
    """Return what is told of runs: time [samples] in s, depth [samples, runs] in m, volume in m3.

    settle [s], overshoot [-] and energy [J] of each run are those of the simulation. counted [s]:
    from when on errors, volumes and starts count.
    """
    late = time >= counted
    seconds = float(time[-1] - time[late][0])
    error = depth[late] - target
    moved = np.abs(np.diff(volume[late], axis=0)).sum(axis=0)
    return Flown(
        settle=settle, overshoot=overshoot, square=np.mean(error**2, axis=0),
        farthest=np.abs(error).max(axis=0), volume_rate=moved / seconds,
        starts=motor_starts(volume[late]) / seconds, turns=motor_turns(volume[late]) / seconds,
        power=energy / float(time[-1]),
        stopped=np.zeros(depth.shape[1]),
    )  # fmt: skip


def summarise(flown: Flown, *, is_step: bool) -> Result:
    """Return medians, percentiles, means and worst cases over the runs."""
    nan = math.nan
    never = np.where(np.isfinite(flown.settle), flown.settle, math.inf)
    over = np.nan_to_num(flown.overshoot, nan=0.0)
    return Result(
        runs=len(flown.square),
        settled=float(np.isfinite(flown.settle).mean()) if is_step else nan,
        settle_median=percentile(never, 50.0) if is_step else nan,
        settle_95=percentile(never, 95.0) if is_step else nan,
        overshoot_median=float(np.percentile(over, 50.0)) if is_step else nan,
        overshoot_95=float(np.percentile(over, 95.0)) if is_step else nan,
        rms=math.sqrt(float(flown.square.mean())),
        farthest=float(flown.farthest.max()),
        volume_rate=float(flown.volume_rate.mean()),
        starts=float(flown.starts.mean()),
        turns=float(flown.turns.mean()),
        power=float(flown.power.mean()),
        lost=float(flown.stopped.mean()),
    )
