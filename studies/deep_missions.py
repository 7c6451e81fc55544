"""The float's own law in the mission engine, beside what the float did.

::

    python -m studies.deep_missions DATA

Each logged deep dive is flown again by `swimbladder.mission`: the vehicle as identified from all
deep dives (`studies.deep_dives`), in the water of that dive, with the law `rate` and the settings
of that dive (near, far, dead time), told only where to go, how long to stay and to come up. The
volume that the law reckons with is not what pump and valve really give; its coefficient is
therefore that of the float's processor times the pump's share of its datasheet. What came out:
`docs/explanation/deep-dives.md`.
"""

from __future__ import annotations

import argparse
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.deep_data import columns_of, dives_of, logs_of
from studies.deep_dives import float_vehicle
from swimbladder.identify.deep import identified_vehicle
from swimbladder.identify.deep_dive import DeepDive
from swimbladder.identify.deep_fit import DeepFit, fit_deep
from swimbladder.identify.deep_model import DEFAULT, body_of, priors_of
from swimbladder.io.float_log import FloatLog
from swimbladder.io.mission import Mission
from swimbladder.mission.core.names import Drive, Note, Row
from swimbladder.mission.flight import fly_mission
from swimbladder.parameters import Controller, Vehicle
from swimbladder.seawater import Column

__all__ = ["Told", "flown", "logged", "with_law"]

Array = NDArray[np.float64]
MBAR = 100.0  # Pa


@dataclass(frozen=True, kw_only=True)
class Told:
    """What a dive looks like: times [s], numbers of actions, depth while it holds."""

    to_target: float  # s, from 5 m
    sinking: int  # actions before it arrives
    holding: int
    rising: int
    up: float  # s, from leaving the target to 5 m
    inside: float  # share of the hold within the tolerance
    spread: float  # Pa, rms from the target while it holds


def with_law(vehicle: Vehicle, fit: DeepFit, log: FloatLog, weight: float) -> Vehicle:
    """Return the vehicle with the float's law and the settings of a dive.

    weight: rho g [N/m3], that turns mbar into metres.
    """
    metre = MBAR / weight  # m, of a mbar

    def numbers(name: str) -> list[float]:
        return [float(x) for x in re.findall(r"[\d.]+", log.settings[name])]

    (near, near_speed), (far, far_speed) = numbers("near"), numbers("far")
    coefficient = numbers("coeff")[0] / numbers("coeff")[1] * 1e-6 / metre**2
    parameters = {
        "coefficient": coefficient * fit.values["pump_delivery"],
        "tolerance": log.stages[0].tolerance / weight,
        "near": near * metre, "far": far * metre, "slow_speed": numbers("rate")[0] * metre,
        "near_speed": near_speed * metre, "far_speed": far_speed * metre,
        "ascent_speed": numbers("ascent")[0] * metre, "speed_band": numbers("rate")[0] * metre,
        "speed_step": metre, "volume_step": 2e-6 * fit.values["pump_delivery"],
        "dead": numbers("dead")[0], "run": 26.0, "window": 600.0,
    }  # fmt: skip
    return vehicle.model_copy(
        update={"controller": Controller(law="rate", sample_time=1.0, parameters=parameters)}
    )


def logged(log: FloatLog, dive: DeepDive) -> Told:
    """Return what the float did."""
    stage = log.stages[0]
    arrived = float(dive.time[np.argmax(np.abs(dive.pressure - stage.pressure) < stage.tolerance)])
    leave = min(
        (t for t, v in zip(dive.action_time, dive.action_seconds, strict=True)
         if t > arrived and v > 40.0),
        default=float(dive.time[-1]),
    )  # fmt: skip
    held = (dive.time >= arrived) & (dive.time <= leave)
    return _told(dive.time, dive.pressure, dive.action_time, arrived, leave, held, stage)


def flown(
    vehicle: Vehicle, column: Column, log: FloatLog, measured: Told, hold: float
) -> tuple[Told, str]:
    """Return what the mission engine does with the same orders, and how it ended."""
    stage = log.stages[0]
    depth = float(np.interp(stage.pressure, column.pressure, column.depth))
    tolerance = stage.tolerance * depth / stage.pressure
    mission = Mission(
        phases=[
            {"kind": "hold", "depth": depth, "tolerance": tolerance, "duration": hold,
             "timeout": 3.0 * measured.to_target},
            {"kind": "surface", "duration": 600.0, "timeout": 4.0 * measured.up},
        ],
    )  # fmt: skip
    flight = fly_mission(vehicle, mission, column)
    time, z = flight.rows[:, Row.T], flight.rows[:, Row.Z]
    pressure = np.interp(z, column.depth, column.pressure)
    notes = flight.notes
    runs = np.isin(notes[:, Drive.WHAT], (Note.PUMP, Note.VALVE))
    leave = float(notes[(notes[:, Drive.WHAT] == Note.PHASE), Drive.T][-1])
    under = time[np.argmax(pressure > 5e4)]
    arrived = float(notes[notes[:, Drive.WHAT] == Note.ARRIVED, Drive.T][0])
    up = time[(time > leave) & (pressure < 5e4)][0] - leave
    acts = notes[runs & (notes[:, Drive.T] > under), Drive.T]
    acts = acts[acts < leave + up]
    fine = np.arange(arrived, leave, 60.0)
    found = _told(
        fine, np.interp(fine, time, pressure), acts, arrived, leave, np.ones(len(fine), bool), stage
    )
    return Told(**{**vars(found), "to_target": arrived - under, "up": float(up)}), flight.stop.name


def _told(  # type: ignore[no-untyped-def]
    time: Array, pressure: Array, acts: Array, arrived: float, leave: float, held: Array, stage
) -> Told:
    off = pressure[held] - stage.pressure
    return Told(
        to_target=arrived - float(time[0]), sinking=int(np.sum(acts < arrived)),
        holding=int(np.sum((acts >= arrived) & (acts < leave))),
        rising=int(np.sum(acts >= leave)), up=float(time[-1]) - leave,
        inside=float(np.mean(np.abs(off) <= stage.tolerance)),
        spread=float(np.sqrt(np.mean(off**2))),
    )  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of measured data")
    folder = parser.parse_args().data / "mermaid_p0051"
    base = float_vehicle()
    body, dives = body_of(base), dives_of(folder, base)
    logs = {log.source: log for log in logs_of(folder)}
    columns = columns_of(folder)
    fit = fit_deep(body, dives, priors_of(base, {}), free=DEFAULT)
    vehicle = identified_vehicle(base, fit)
    print(
        "| dive | | to the target, h | actions | holding, h | actions | inside, % | rms, dbar "
        "| up, h | actions |\n|---|---|---:|---:|---:|---:|---:|---:|---:|---:|"
    )
    for dive in dives:
        log, column = logs[dive.name], columns[dive.name]
        real = logged(log, dive)
        hold = float(dive.time[-1] - dive.time[0]) - real.to_target - real.up
        own = with_law(vehicle, fit, log, float(column.density.mean()) * column.gravity)
        model, stop = flown(own, column, log, real, hold)
        for what, told in (("logged", real), (f"flown, {stop.lower()}", model)):
            print(
                f"| {dive.name} | {what} | {told.to_target / 3600:.1f} | {told.sinking} "
                f"| {hold / 3600:.1f} | {told.holding} | {100 * told.inside:.0f} "
                f"| {told.spread / 1e4:.1f} | {told.up / 3600:.1f} | {told.rising} |"
            )


if __name__ == "__main__":
    main()
