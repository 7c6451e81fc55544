"""Everything that the report rests on, simulated and fitted once.

The prototype's actuator alone, simulated: voltage steps, timed voltages, and none at all.
"""

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.control.protocol import timed_voltage
from swimbladder.design.analysis import Analysis, analyse
from swimbladder.io.config import load_vehicle
from swimbladder.io.progress import Advance, silent
from swimbladder.sim import pool
from swimbladder.sim.closed_loop import Solution, StepMetrics, drive, simulate, step_metrics
from swimbladder.sim.pool import (
    Experiment,
    Fit,
    PoolRun,
    average,
    fit_depth,
    fit_speed,
    timed_travel,
)
from swimbladder.vehicle import IdentifiedActuator, IdentifiedMotion, Sensors, Vehicle

POOL_DEPTH = 4.5  # m, section 3.2
CLEARANCE = 0.75  # m, ours
TRAVELS = (2.5e-3, 4e-3, 6e-3, 10e-3)  # m, section 3.1, dx


class Pulse(NamedTuple):
    """A timed voltage at a depth: what it moves the piston by, as a formula and simulated [m]."""

    depth: float  # m
    dx: float  # m, asked for
    voltage: float  # V
    time: float  # s
    formula: tuple[float, float]  # when the voltage ends, once the motor stands
    simulated: tuple[float, float]


class Identified(NamedTuple):
    """What voltage steps say of the actuator (section 3.1)."""

    K1: float  # m/s/V
    T1: float  # s
    depth_voltage: float  # V/m, k_z/k_u


def on_bottom(
    vehicle: Vehicle, time: ArrayLike, voltage: ArrayLike, depth: float, volume: float
) -> Solution:
    """Return what voltages at times [s], or one at all, do from a volume [m3] on the bottom."""
    voltages = np.broadcast_to(voltage, np.shape(time))
    start: Any = {"start_depth": depth, "start_volume": volume}
    return drive(vehicle, time=time, voltage=voltages, bottom_depth=depth, **start)


def voltage_steps(vehicle: Vehicle) -> Identified:
    """Find K1, T1 and k_z/k_u from voltage steps on the bottom, where the depth stays the same.

    Speeds are centred differences of the piston's position every 10 ms, as in section 3.1.
    """
    a = vehicle.engine
    assert isinstance(a, IdentifiedActuator)
    h = 0.01
    time = np.arange(301) * h

    def speed(u: float, depth: float) -> Any:
        s = on_bottom(vehicle, time, u, depth, -150e-6)
        return np.gradient(s.volume / a.piston_area, h)

    voltages = [-12.0, -9.0, -6.0, -3.0, 3.0, 6.0, 9.0, 12.0]
    curves = [speed(u, 0.5) for u in voltages]
    steady = [float(np.mean(curve[200:])) for curve in curves]
    K1 = np.polyfit(voltages, steady, 1)[0]  # the load at 0.5 m is in the intercept
    lags = [
        float(np.interp(1.0 - math.exp(-1.0), curve[:100] / final, time[:100]))
        for curve, final in zip(curves, steady, strict=True)
    ]
    depths = [1.0, 25.0, 50.0, 75.0, 100.0]
    slope = np.polyfit(depths, [float(np.mean(speed(6.0, z)[200:])) for z in depths], 1)[0]
    return Identified(float(K1), float(np.mean(lags)), float(-slope / K1))


def timed_voltages(vehicle: Vehicle) -> tuple[Pulse, ...]:
    """Return the timed voltages of section 3.1 at both depths, with the vehicle held in place."""
    a = vehicle.engine
    assert isinstance(a, IdentifiedActuator)
    assert vehicle.supply is not None
    assert vehicle.controller is not None
    pulses = []
    for depth, sign in ((POOL_DEPTH - CLEARANCE, 1.0), (CLEARANCE, -1.0)):
        for dx in TRAVELS:
            limit, h = vehicle.supply.voltage, vehicle.controller.sample_time
            u, samples = timed_voltage(sign * dx, K1=a.K1, limit=limit, sample_time=h)
            dt, load = samples * h, a.depth_voltage * depth
            volume = vehicle.neutral_volume(depth) - 150e-6
            s = on_bottom(vehicle, [0.0, dt, dt + 3.0], [u, load, load], depth, volume)
            _, *moved = ((s.volume - s.volume[0]) / a.piston_area).tolist()
            formula = timed_travel(u, dt, K1=a.K1, T1=a.T1, opposing=load)
            pulses.append(Pulse(depth, sign * dx, u, dt, formula, (moved[0], moved[1])))
    return tuple(pulses)


def unheld_rise(vehicle: Vehicle) -> float:
    """Return how far [m] the vehicle rises after the smallest change, with 0 V at the motor."""
    a = vehicle.engine
    assert isinstance(a, IdentifiedActuator)
    depth = POOL_DEPTH - CLEARANCE
    time, volume = np.arange(0.0, 120.0, 0.3), vehicle.neutral_volume(depth)
    volume += TRAVELS[0] * a.piston_area
    start: Any = {"start_depth": depth, "start_volume": volume}
    s = drive(vehicle, time=time, voltage=np.zeros(len(time)), bottom_depth=POOL_DEPTH, **start)
    return float(depth - s.depth.min())


VOLUME_STEPS = (20e-6, 30e-6, 45e-6, 75e-6)  # m3, section 3.1, dV
SENSORS = Sensors(depth_noise=2e-3, depth_quantum=5e-3, volume_quantum=0.75e-6)  # ours
# Ours, within 0.5 and 4 m: the paper's set-points are only in its figures. (time s, depth m)
_TARGETS = (2.0, 3.5, 2.5, 0.7, 1.2, 3.7, 1.5)
SETPOINTS = tuple((450.0 * number, depth) for number, depth in enumerate(_TARGETS))
FIRST_DEPTH, LAST_TIME = 1.0, 3150.0
LONG_STEP = (1.0, 3.5, 1200.0)  # m, m, s
PAIRS = tuple(combinations((0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5), 2))  # m, shallow and deep
STAGES = 10 + len(TRAVELS)


class Step(NamedTuple):
    """A depth step of Fig. 16."""

    start: float  # m
    target: float  # m
    metrics: StepMetrics
    lowest_volume: float  # m3
    highest_volume: float  # m3


class MatchedSteps(NamedTuple):
    """The same two depths, going down and coming up."""

    shallow: float  # m
    deep: float  # m
    down: StepMetrics
    up: StepMetrics


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Simulations and fits; see gather."""

    vehicle: Vehicle
    hydraulic: Vehicle  # the electrohydraulic example
    screw: Vehicle  # the electromechanical example
    seed: int
    identified: Identified
    pulses: tuple[Pulse, ...]
    runs: tuple[PoolRun, ...]
    experiments: tuple[Experiment, ...]
    depth_fits: tuple[Fit, ...]  # eq. (27), one each
    speed_fits: tuple[Fit, ...]  # eq. (26)
    known_fits: tuple[Fit, ...]  # eq. (32), psi known
    still: tuple[tuple[float, Fit], ...]  # no noise, exactly neutral: dV [m3] and eq. (27)
    still_speeds: tuple[Fit, ...]  # eq. (26) there
    still_joint: Fit
    still_known: Fit
    still_curve: tuple[tuple[float, Fit], ...]
    without_psi: tuple[Fit, Fit]  # averages of (27) and (26) for a vehicle with psi = 0
    unheld_rise: float  # m, how far the smallest step gets with 0 V at the motor
    steps: Solution
    step_rows: tuple[Step, ...]
    long_step: Solution
    long_metrics: StepMetrics
    pairs: tuple[MatchedSteps, ...]
    check_step: Solution  # 1.5 to 3.0 m, 400 s
    check_metrics: StepMetrics
    analysis: Analysis

    @property
    def actuator(self) -> IdentifiedActuator:
        """The actuator of the paper's vehicle."""
        assert isinstance(self.vehicle.engine, IdentifiedActuator)
        return self.vehicle.engine

    @property
    def motion(self) -> IdentifiedMotion:
        """The motion of the paper's vehicle: the truth of every fit."""
        assert isinstance(self.vehicle.motion, IdentifiedMotion)
        return self.vehicle.motion

    @property
    def still_average(self) -> tuple[Fit, Fit]:
        """The averages of eq. (26) and of eq. (27) without noise."""
        return average(self.still_speeds), average([fit for _, fit in self.still])

    @property
    def table2(self) -> tuple[Fit, Fit]:
        """The averages of eq. (26) and of eq. (27), as Table 2 has them."""
        return average(self.speed_fits), average(self.depth_fits)


def gather(seed: int, advance: Advance = silent) -> Evidence:
    """Simulate and fit everything; `advance` is called for each of the STAGES.

    seed: of the pool's sensor noise. Raises NoAnswerError where the pool procedure does not end.
    """
    vehicle = load_vehicle("feup-em")
    a = vehicle.engine
    assert isinstance(a, IdentifiedActuator)
    found: dict[str, Any] = {"vehicle": vehicle, "seed": seed}

    def stage(**results: Any) -> None:
        found.update(results)
        advance(1.0)

    stage(hydraulic=load_vehicle("example-eh"), screw=load_vehicle("example-em"))
    identified, pulses = voltage_steps(vehicle), timed_voltages(vehicle)
    stage(identified=identified, pulses=pulses)
    noisy = vehicle.model_copy(update={"sensors": SENSORS})
    dVs = [dx * a.piston_area for dx in TRAVELS]
    place = {"bottom_depth": POOL_DEPTH, "clearance": CLEARANCE}
    runs = pool.pool_test(noisy, dVs=dVs, seed=seed, **place, advance=advance)
    experiments = tuple(e for run in runs for e in run.experiments)
    records, psi = [e.record for e in experiments], vehicle.hull.psi
    found |= {"runs": runs, "experiments": experiments}
    found["depth_fits"] = tuple(map(fit_depth, records))
    found["known_fits"] = tuple(fit_depth(record, psi=psi) for record in records)
    stage(speed_fits=tuple(map(fit_speed, records)))
    stage(**_still(vehicle))
    curve = [i * 1e-6 for i in range(15, 86, 5)]
    fits = map(fit_depth, pool.still_starts(vehicle, dVs=curve))
    stage(still_curve=tuple(zip(curve, fits, strict=True)))
    stage(unheld_rise=unheld_rise(vehicle))
    steps = _simulated(vehicle, SETPOINTS, FIRST_DEPTH, LAST_TIME)
    stage(steps=steps, step_rows=_step_rows(steps))
    stage(pairs=tuple(_pair(vehicle, *depths) for depths in PAIRS))
    found["long_step"], found["long_metrics"] = _one_step(vehicle, *LONG_STEP)
    found["check_step"], found["check_metrics"] = _one_step(vehicle, 1.5, 3.0, 400.0)
    stage()
    stage(analysis=analyse(vehicle))
    return Evidence(**found)


def _simulated(vehicle: Vehicle, setpoints: Any, start: float, duration: float) -> Solution:
    """Simulate set-points (time [s], depth [m]) in the pool."""
    where: Any = {"start_depth": start, "bottom_depth": POOL_DEPTH}
    return simulate(vehicle, setpoints=setpoints, duration=duration, **where)


def _still(vehicle: Vehicle) -> dict[str, Any]:
    """Return the fits to experiments without noise, with and without compressibility."""
    dVs = [sign * dV for dV in VOLUME_STEPS for sign in (1.0, -1.0)]
    records = pool.still_starts(vehicle, dVs=dVs)
    free = pool.still_starts(vehicle.but("hull", psi=0.0), dVs=dVs)
    return {
        "still": tuple(zip(dVs, map(fit_depth, records), strict=True)),
        "still_speeds": tuple(map(fit_speed, records)),
        "still_joint": pool.fit_jointly(records),
        "still_known": pool.fit_jointly(records, psi=vehicle.hull.psi),
        "without_psi": tuple(average([*map(fit, free)]) for fit in (fit_depth, fit_speed)),
    }


def _step_rows(s: Solution) -> tuple[Step, ...]:
    rows = []
    before = FIRST_DEPTH
    ends = [time for time, _ in SETPOINTS[1:]] + [LAST_TIME]
    for (time, target), end in zip(SETPOINTS, ends, strict=True):
        part = slice(*np.searchsorted(s.time, [time - 1e-9, end - 1e-9]))
        metrics = step_metrics(s.time[part], s.depth[part], start=before, target=target)
        volume = s.volume[part]
        rows.append(Step(before, target, metrics, float(volume.min()), float(volume.max())))
        before = target
    return tuple(rows)


def _one_step(
    vehicle: Vehicle, start: float, target: float, duration: float
) -> tuple[Solution, StepMetrics]:
    s = _simulated(vehicle, [(0.0, target)], start, duration)
    return s, step_metrics(s.time, s.depth, start=start, target=target)


def _pair(vehicle: Vehicle, shallow: float, deep: float) -> MatchedSteps:
    ways = (shallow, deep), (deep, shallow)
    down, up = (_one_step(vehicle, *way, 500.0)[1] for way in ways)
    return MatchedSteps(shallow, deep, down, up)
