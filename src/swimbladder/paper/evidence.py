"""Everything that the report rests on, simulated and fitted once."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from swimbladder.design.analysis import analyse
from swimbladder.design.linear import Analysis
from swimbladder.io.config import load_vehicle
from swimbladder.paper.actuation import (
    CLEARANCE,
    POOL_DEPTH,
    TRAVELS,
    Identified,
    Pulse,
    timed_voltages,
    unheld_rise,
    voltage_steps,
)
from swimbladder.sim.closed_loop import Solution, StepMetrics, simulate, step_metrics
from swimbladder.sim.pool import (
    Experiment,
    Fit,
    PoolRun,
    average,
    fit_depth,
    fit_jointly,
    fit_speed,
    pool_test,
    still_starts,
)
from swimbladder.vehicle import IdentifiedActuator, IdentifiedMotion, Sensors, Vehicle

VOLUME_STEPS = (20e-6, 30e-6, 45e-6, 75e-6)  # m3, section 3.1, dV
SENSORS = Sensors(depth_noise=2e-3, depth_quantum=5e-3, volume_quantum=0.75e-6)  # ours
# Ours, within 0.5 and 4 m: the paper's set-points are only in its figures. (time s, depth m)
SETPOINTS = (
    (0.0, 2.0), (450.0, 3.5), (900.0, 2.5), (1350.0, 0.7), (1800.0, 1.2), (2250.0, 3.7),
    (2700.0, 1.5),
)  # fmt: skip
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
        assert isinstance(self.vehicle.actuator, IdentifiedActuator)
        return self.vehicle.actuator

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


def gather(seed: int, advance: Callable[[float], None] = lambda _: None) -> Evidence:
    """Simulate and fit everything; `advance` is called for each of the STAGES.

    seed: of the pool's sensor noise. Raises NoAnswerError where the pool procedure does not end.
    """
    vehicle = load_vehicle("feup-em")
    a = vehicle.actuator
    assert isinstance(a, IdentifiedActuator)
    found: dict[str, Any] = {"vehicle": vehicle, "seed": seed}

    def stage(**results: Any) -> None:
        found.update(results)
        advance(1.0)

    stage(hydraulic=load_vehicle("example-eh"), screw=load_vehicle("example-em"))
    stage(identified=voltage_steps(vehicle), pulses=timed_voltages(vehicle))
    noisy = vehicle.model_copy(update={"sensors": SENSORS})
    runs = pool_test(
        noisy, dVs=[dx * a.piston_area for dx in TRAVELS], seed=seed, pool_depth=POOL_DEPTH,
        clearance=CLEARANCE, advance=advance,
    )  # fmt: skip
    experiments = tuple(e for run in runs for e in run.experiments)
    psi = vehicle.hull.psi
    stage(
        runs=runs, experiments=experiments,
        depth_fits=tuple(fit_depth(e.record) for e in experiments),
        speed_fits=tuple(fit_speed(e.record) for e in experiments),
        known_fits=tuple(fit_depth(e.record, psi=psi) for e in experiments),
    )  # fmt: skip
    stage(**_still(vehicle))
    curve = [i * 1e-6 for i in range(15, 86, 5)]
    stage(
        still_curve=tuple(
            (dV, fit_depth(r))
            for dV, r in zip(curve, still_starts(vehicle, dVs=curve), strict=True)
        )
    )
    stage(unheld_rise=unheld_rise(vehicle))
    steps = simulate(
        vehicle, setpoints=SETPOINTS, duration=LAST_TIME, start_depth=FIRST_DEPTH,
        bottom_depth=POOL_DEPTH,
    )  # fmt: skip
    stage(steps=steps, step_rows=_step_rows(steps))
    stage(pairs=tuple(_pair(vehicle, *depths) for depths in PAIRS))
    start, target, duration = LONG_STEP
    long_step, long_metrics = _one_step(vehicle, start, target, duration)
    check_step, check_metrics = _one_step(vehicle, 1.5, 3.0, 400.0)
    stage(
        long_step=long_step, long_metrics=long_metrics, check_step=check_step,
        check_metrics=check_metrics,
    )  # fmt: skip
    stage(analysis=analyse(vehicle))
    return Evidence(**found)


def _still(vehicle: Vehicle) -> dict[str, Any]:
    """Return the fits to experiments without noise, with and without compressibility."""
    dVs = [sign * dV for dV in VOLUME_STEPS for sign in (1.0, -1.0)]
    records = still_starts(vehicle, dVs=dVs)
    incompressible = vehicle.model_copy(
        update={"hull": vehicle.hull.model_copy(update={"psi": 0.0})}
    )
    free = still_starts(incompressible, dVs=dVs)
    return {
        "still": tuple((dV, fit_depth(r)) for dV, r in zip(dVs, records, strict=True)),
        "still_speeds": tuple(fit_speed(r) for r in records),
        "still_joint": fit_jointly(records),
        "still_known": fit_jointly(records, psi=vehicle.hull.psi),
        "without_psi": (
            average([fit_depth(r) for r in free]),
            average([fit_speed(r) for r in free]),
        ),
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
    s = simulate(
        vehicle, setpoints=[(0.0, target)], duration=duration, start_depth=start,
        bottom_depth=POOL_DEPTH,
    )  # fmt: skip
    return s, step_metrics(s.time, s.depth, start=start, target=target)


def _pair(vehicle: Vehicle, shallow: float, deep: float) -> MatchedSteps:
    down, up = (
        _one_step(vehicle, first, last, 500.0)[1]
        for first, last in ((shallow, deep), (deep, shallow))
    )
    return MatchedSteps(shallow, deep, down, up)
