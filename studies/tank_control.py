"""The float in the tank under its own controller and ours: `python -m studies.tank_control DATA`.

DATA is the folder that `studies.tank` takes. First each mission's logged PID is replayed in closed
loop: the vehicle as identified from the training missions, the gains of that mission, and the
neutral volume as the mission's first minute under water says; what the loop did stands beside what
the simulated one did. Then the missions are flown again, in simulation, by the PID with the
mission's gains and by the law `position-observer`, on the same vehicles: drawn from the identified
region, with the neutral volume uncertain and walking as the logs say. Nothing in the second table
was measured.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from studies.tank import TRAIN, bottom_of, load, logs_folder, tank_logs, train
from studies.tank_law import FITTING, position_observer_gains
from swimbladder.control.law import Law
from swimbladder.control.position_observer import POSITION_OBSERVER
from swimbladder.control.position_pid import POSITION_PID
from swimbladder.control.registry import law_parameters
from swimbladder.design.tuning.region import member
from swimbladder.errors import SwimbladderError
from swimbladder.estimation.comparison import compare, record
from swimbladder.estimation.comparison.record import Record
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log
from swimbladder.sim.closed_loop import simulate, simulate_ensemble
from swimbladder.vehicle import Sensors, Vehicle

__all__ = ["Behaviour", "behaviour", "main", "pid_of", "replay"]

BAND = 0.05  # m: the depth sensor's step is 5 mm, the measured rms of a hold 9 to 30 mm
HELD = 40.0  # s, at the end of a set-point
STILL = 2e-8  # m3 in a sample, below which the piston rests; a step of the counter is larger
FIRST = 60.0  # s under water, from which the neutral volume is told
_SHOWN = ("settles", "over", "rms", "moved", "starts")
Array = NDArray[np.float64]


class Behaviour(NamedTuple):
    """What a loop did after its last change of the set-point."""

    settled: float  # s, into 5 cm for good; inf: never
    overshoot: float  # m, beyond the set-point
    rms: float  # m, over the last 40 s
    moved: float  # m3/s, over the whole mission
    starts: float  # 1/s, likewise


def behaviour(
    time: Array, depth: Array, volume: Array, setpoints: Sequence[tuple[float, float]]
) -> Behaviour:
    """Return what a mission did: depth [n] in m and volume [n] in m3 at the times [n] in s."""
    begin, target = setpoints[-1]
    after = time >= begin
    t, z = time[after] - begin, depth[after]
    outside = np.flatnonzero(np.abs(z - target) > BAND)
    settled = 0.0
    if outside.size:
        last = outside[-1]
        settled = float("inf") if last == len(z) - 1 else float(t[last])
    way = np.sign(target - z[0])
    held = z[t >= t[-1] - HELD] - target
    moves = np.abs(np.diff(volume))
    moving = moves > STILL
    long = float(time[-1] - time[0])
    return Behaviour(
        settled,
        max(float((way * (z - target)).max()), 0.0),
        float(np.sqrt(np.mean(held**2))),
        float(moves.sum()) / long,
        float((moving[1:] & ~moving[:-1]).sum()) / long,
    )


def pid_of(row: dict[str, str], vehicle: Vehicle) -> Any:
    """Return the parameters of a mission's PID, None where its gains were not logged."""
    if not row["pid_kp"]:
        return None
    assert vehicle.controller is not None
    logged = {
        "K_p": float(row["pid_kp"]),
        "K_i": float(row["pid_ki"]),
        "K_d": float(row["pid_kd"]),
        "threshold": float(row["integralTreshold"]),
        "smoothing": float(row["EMA_alpha"]),
    }
    return law_parameters(
        POSITION_PID,
        {**vehicle.controller.parameters, **logged},
        sample_time=vehicle.controller.sample_time,
    )


class Mission(NamedTuple):
    """A mission as it is flown again."""

    log: int
    record: Record
    vehicle: Vehicle  # neutral as its first minute says
    pid: Any
    neutral_std: float  # m3, how surely


def mission_of(number: int, log: Log, row: dict[str, str], vehicle: Vehicle) -> Mission | None:
    """Return a mission ready to be flown again, None where its gains are not known."""
    pid = pid_of(row, vehicle)
    if pid is None:
        return None
    bottom = bottom_of(log)
    under = np.flatnonzero(log.depth > 0.1)
    early = log.only(log.time <= log.time[under[0]] + FIRST)
    names = ("neutral_volume", "start_depth", "start_speed")
    told = compare(early, vehicle, drive="volume", free=names, bottom_depth=bottom, submerged=True)
    rec = record(log, vehicle, drive="setpoint", bottom_depth=bottom)
    fitted = told.fitted["neutral_volume"]
    return Mission(number, rec, told.vehicle, pid, min(fitted.std, 2e-6))


def _start(m: Mission) -> dict[str, Any]:
    stroke = m.vehicle.stroke
    assert m.record.volume is not None
    return {
        "start_depth": max(float(m.record.depth[0]), 0.02),
        "start_volume": float(np.clip(m.record.volume[0], stroke.minimum, stroke.maximum)),
        "setpoints": list(m.record.setpoints),
        "duration": m.record.duration,
        "bottom_depth": m.record.bottom_depth,
    }


def replay(m: Mission) -> tuple[Behaviour, Behaviour, float]:
    """Return what the logged loop did, what the simulated one did, and their depths' rms [m]."""
    rec = m.record
    assert rec.volume is not None
    run = simulate(
        m.vehicle, law=POSITION_PID, parameters=m.pid, sample_time=m.pid.S_p, seed=1, **_start(m)
    )
    depth = np.interp(rec.time, run.time, run.depth)
    volume = np.interp(rec.time, run.time, run.volume)
    logged = behaviour(rec.time, rec.depth, rec.volume, rec.setpoints)
    simulated = behaviour(rec.time, depth, volume, rec.setpoints)
    apart = float(np.sqrt(np.mean((depth - rec.depth)[rec.compared] ** 2)))
    return logged, simulated, apart


def fly(m: Mission, law: Law, parameters: Any, *, runs: int, seed: int = 1) -> list[Behaviour]:
    """Return what a law does in a mission with vehicles drawn from the region."""
    rng = np.random.default_rng(seed)
    known = m.vehicle.identified
    assert known is not None
    n = len(known.names)
    points = rng.normal(size=(runs, n))
    points *= (rng.uniform(size=runs) ** (1.0 / n) / np.linalg.norm(points, axis=1))[:, None]
    plants = [member(m.vehicle, s).plant for s in points]
    vary: dict[str, Any] = {
        name: np.array([getattr(p, name) for p in plants])
        for name in ("a_b", "a_s", "d_l", "d_b", "d_t", "psi")
    }
    vary["V_0"] = plants[0].V_0 + rng.normal(0.0, m.neutral_std, runs)
    samples = int(np.ceil(m.record.duration / parameters.S_p)) + 1
    walk = np.cumsum(rng.normal(size=(samples, runs)), axis=0)
    data = simulate_ensemble(
        m.vehicle,
        count=runs,
        law=law,
        parameters=parameters,
        sample_time=parameters.S_p,
        vary=vary,
        seed=seed,
        keep="trajectory",
        neutral_change=known.random_walk * np.sqrt(parameters.S_p) * walk,
        **_start(m),
    )
    time, depth, volume = (data[k].to_numpy() for k in ("time", "depth", "volume"))
    return [behaviour(time, depth[:, k], volume[:, k], m.record.setpoints) for k in range(runs)]


def reasons(m: Mission, logged: Behaviour) -> str:
    """Return what of a mission the model does not know."""
    rec = m.record
    words = []
    if int((rec.depth > rec.bottom_depth - 0.03).sum()) > 10:
        words.append("lay on the bottom")
    under = np.flatnonzero(rec.depth > 0.3)
    if len(under) and int((rec.depth[under[0] :] < 0.05).sum()) > 2:
        words.append("came up again")
    if m.pid.K_i == 0.0:
        words.append("no integral: the trim decides")
    if m.pid.K_d <= 0.01 or m.pid.smoothing == 1.0 or m.pid.K_p > 0.029:
        words.append("hardly damped")
    if not np.isfinite(logged.settled) and logged.rms > 0.1:
        words.append("did not settle")
    return ", ".join(words)


def _shown(b: Sequence[float]) -> str:
    settled = f"{b[0]:5.0f}" if np.isfinite(b[0]) else "never"
    return f"{settled} {1e2 * b[1]:5.0f} {1e3 * b[2]:6.0f} {3.6e6 * b[3]:6.2f} {3600 * b[4]:6.0f}"


HEAD = f"{'settles':>5} {'over':>4} {'rms':>6} {'moved':>6} {'starts':>6}"
UNITS = f"{'s':>5} {'cm':>5} {'mm':>6} {'L/h':>6} {'1/h':>6}"


def main(given: Sequence[str] | None = None) -> int:
    """Run the study, print its tables, and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m studies.tank_control", description=__doc__)
    parser.add_argument("data", type=Path, metavar="DATA_DIR")
    parser.add_argument("--runs", type=int, default=100, metavar="N")
    options = parser.parse_args(given)
    options.data = logs_folder(options.data, parser)
    with (options.data / "missions_meta.csv").open(newline="", encoding="utf-8") as file:
        meta = {int(row["log"]): row for row in csv.DictReader(file)}
    with threadpool_limits(limits=1, user_api="blas"):
        vehicle, _ = train(load(options.data, TRAIN), load_vehicle("ntnu-bv"))
        known = vehicle.identified
        assert known is not None
        sensors = Sensors(depth_noise=known.depth_noise, depth_quantum=0.0)
        vehicle = vehicle.model_copy(update={"sensors": sensors})
        missions = []
        for number, log in load(options.data, tank_logs(options.data)).items():
            try:
                found = mission_of(number, log, meta[number], vehicle)
            except SwimbladderError as error:
                print(f"mission {number} left out: {error}", file=sys.stderr)
                continue
            if found is None:
                print(f"mission {number} left out: its gains were not logged", file=sys.stderr)
            else:
                missions.append(found)
        print("closed loop replayed: logged | simulated, depths apart (rms)")
        print(f"log  {HEAD} | {HEAD}  apart\n     {UNITS} | {UNITS}     mm")
        for m in missions:
            logged, simulated, apart = replay(m)
            said = reasons(m, logged)
            print(
                f"{m.log:3d}  {_shown(logged)} | {_shown(simulated)} {1e3 * apart:6.0f}  {said}",
                flush=True,
            )
        ours = position_observer_gains(vehicle, **FITTING)
        print(
            f"\nsimulated, {options.runs} vehicles each, the 95th percentile: "
            "the mission's PID | position-observer"
        )
        print(f"log  {HEAD} | {HEAD}\n     {UNITS} | {UNITS}")
        both: list[list[Array]] = [[], []]
        for m in missions:
            shown = []
            for k, (law, numbers) in enumerate(((POSITION_PID, m.pid), (POSITION_OBSERVER, ours))):
                runs = np.array(fly(m, law, numbers, runs=options.runs))
                both[k].append(runs)
                worst = np.sort(runs, axis=0)[int(np.ceil(0.95 * len(runs))) - 1]
                shown.append(_shown(worst))
            print(f"{m.log:3d}  {' | '.join(shown)}", flush=True)
        middle = [_shown(np.median(np.concatenate(runs), axis=0)) for runs in both]
        print(f"all  {' | '.join(middle)}  (median of all runs)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
