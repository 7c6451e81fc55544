"""Dives of known parameters as a float logs them, for `studies.deep_calibration`.

Vehicles are drawn from what is said to be known of them, and dived by the mission engine, its own
law at the controls, in water with internal waves; a log is made of what a float would log, with a
pressure sensor's noise and resolution, and the water is told by a cast of the day before, when the
waves lay elsewhere, by a CTD that is off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import gsw
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from swimbladder.estimation.estimates import Prior
from swimbladder.estimation.motion.deep import identified_vehicle
from swimbladder.estimation.motion.deep_model import DEEP, DEFAULT, priors_of
from swimbladder.io.config import load_vehicle
from swimbladder.io.float_log import Action, Device, FloatLog
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import Cast, Column, cast_column
from swimbladder.physics.seawater.motion import moved
from swimbladder.sim.engine.rodas.prepare import Accuracy
from swimbladder.sim.engine.rodas.records import Note, Stop
from swimbladder.sim.mission.flight import Flight, fly_mission
from swimbladder.vehicle import PhysicalMotion, PowerLawPump, PumpAndValve, Vehicle

__all__ = ["Dived", "again", "drawn", "known", "the_vehicle"]

Array = NDArray[np.float64]

LATITUDE = 43.0
COWL = 3.0  # kg
DAY = 86400.0  # s, by which the cast is older than the dive
NOISE, RESOLUTION = 300.0, 100.0  # Pa, of the pressure sensor
EVERY = 60.0  # s, between two looks that are logged; and one at each run of pump and valve
LAYERS_MOVE = 4.0  # m rms at mid-depth, and some 2 mm/s: Garrett and Munk's sea
WAVES = 16
FASTEST, SLOWEST = 1200.0, 50_000.0  # s: above the buoyancy period, near the inertial one
OFF = {"salinity": 0.01, "temperature": 0.002, "drift": 0.005}  # PSS-78, K, PSS-78 over the cast
# Errors of a cm at most: beside 3 cm of noise.
_EXACT = Accuracy(relative=1e-6, depth=1e-3, speed=1e-5)
_DEVICES: dict[Note, Device] = {Note.PUMP: "pump", Note.VALVE: "valve", Note.BYPASS: "bypass"}
_MISSION = Mission(
    phases=[
        {"kind": "hold", "depth": 800.0, "duration": 10_800.0},
        {"kind": "surface", "duration": 600.0},
    ]
)


@dataclass(frozen=True)
class Dived:
    """A dive of known parameters as a float logs it, and the water as a cast tells it."""

    values: dict[str, float]
    log: FloatLog
    column: Column
    flight: Flight


@cache
def the_vehicle() -> Vehicle:
    """Return example-float with a pump whose delivery is a number of its file.

    And with a cowl of water: an inertia that is drawn less has to have its place in added_mass.
    """
    vehicle = load_vehicle("example-float")
    assert isinstance(vehicle.actuator, PumpAndValve)
    pump = PowerLawPump(delivery=8e-7, slip=5e-15, idle_power=7.0, power_per_pressure=8e-7)
    motion = vehicle.motion
    assert isinstance(motion, PhysicalMotion)
    return vehicle.model_copy(
        update={
            "actuator": vehicle.actuator.model_copy(update={"pump": pump}),
            "motion": motion.model_copy(update={"added_mass": motion.added_mass + COWL}),
        }
    )


@cache
def known() -> dict[str, Prior]:
    """Return what is known of a vehicle before: its file, and what a maker can say."""
    return priors_of(
        the_vehicle(),
        {
            "compressibility": Prior(2.46e-10, 0.2e-10),
            "stiffening": Prior(0.0, 2e-18),
            "thermal_expansion": Prior(7.7e-5, 0.8e-5),
            "drag_up": Prior(1.0, 0.1),
            "pump_delivery": Prior(1.0, 0.1),
            "valve": Prior(1.0, 0.1),
            "valve_laminar": Prior(500.0, 250.0),
            "pump_slip": Prior(0.0, 2e-9),
            "pump_start": Prior(0.0, 1e-6),
            "creep": Prior(5e-11, 2e-11),
        },
    )


def drawn(index: int, *, seed: int = 1) -> Dived:
    """Return dive number `index`, the same for the same seed."""
    rng = np.random.default_rng([seed, index])
    priors = known()
    mean = {name: priors[name].mean for name in DEEP}
    while True:
        values = _about(mean, 1.0, rng)
        waves = _waves(rng)
        flight = _flown(values, waves)
        if flight is not None:
            return Dived(values, _log(flight, waves, rng), _cast(waves, rng), flight)


def again(first: Dived, index: int, dive: int, *, seed: int = 1, differ: float = 0.0) -> Dived:
    """Return another dive of the same vehicle, in other waves and with a cast of its own.

    dive: from 1. differ: by how many deviations of what is known before its parameters are off.
    """
    rng = np.random.default_rng([seed, index, dive])
    while True:
        values = _about(first.values, differ, rng) if differ else first.values
        waves = _waves(rng)
        flight = _flown(values, waves)
        if flight is not None:
            return Dived(values, _log(flight, waves, rng), _cast(waves, rng), flight)


def _about(
    mean: Mapping[str, float], deviations: float, rng: np.random.Generator
) -> dict[str, float]:
    values = dict(mean)
    for name in DEFAULT:
        values[name] += deviations * known()[name].std * rng.normal()
    return values


def _flown(values: dict[str, float], waves: Array) -> Flight | None:
    """Return the dive of a vehicle; None where its file has no place for it, or it stops above."""
    vehicle = identified_vehicle(the_vehicle(), values)
    asked = values["inertia"] * the_vehicle().mass
    lost = vehicle.actuator.pump.slip <= 0.0 or min(values["creep"], values["valve_laminar"]) < 0.0
    if lost or vehicle.mass > asked + 1e-9:
        return None
    flight = fly_mission(vehicle, _MISSION, _sea(), waves=waves, accuracy=_EXACT, checked=False)
    deep = float(np.max(flight.rows["z"])) > 700.0
    return flight if flight.stop is Stop.FINISHED and deep else None


_LEVELS = np.arange(0.0, 1201.0, 5.0)  # dbar
_WARM = 4.5 + 12.0 * np.exp(-_LEVELS / 150.0)  # degC
_SALT = 35.0 + 0.3 * np.exp(-_LEVELS / 300.0)  # PSS-78


@cache
def _sea() -> Column:
    return _column(_SALT, _WARM)


def _column(salt: Array, warm: Array) -> Column:
    SA = gsw.SA_from_SP(salt, _LEVELS, -30.0, LATITUDE)
    CT = gsw.CT_from_t(SA, warm, _LEVELS)
    return cast_column(Cast(pressure=_LEVELS, SA=SA, CT=CT, latitude=LATITUDE))


def _waves(rng: np.random.Generator) -> Array:
    """Return internal waves of speeds that are white between the slowest and the fastest."""
    depth = 2000.0
    rows = []
    for _ in range(WAVES):
        period = float(np.exp(rng.uniform(np.log(FASTEST), np.log(SLOWEST))))
        mode = int(rng.integers(1, 7))
        rows.append(
            (
                np.sqrt(period),
                2.0 * np.pi / period,
                rng.uniform(0.0, 2.0 * np.pi),
                mode * np.pi / depth,
                0.0,
                depth,
            )
        )
    waves = np.array(rows)
    # the mean square of sin(mode z) sin(omega t) is 1/4
    waves[:, 0] *= LAYERS_MOVE / np.sqrt(0.25 * np.sum(waves[:, 0] ** 2))
    return waves


def _cast(waves: Array, rng: np.random.Generator) -> Column:
    """Return the water as it was measured a day before."""
    rest = _LEVELS - np.array([moved(waves, float(z), -DAY)[0] for z in _LEVELS])
    drift = OFF["drift"] * rng.normal() * _LEVELS / _LEVELS[-1]
    return _column(
        np.interp(rest, _LEVELS, _SALT) + OFF["salinity"] * rng.normal() + drift,
        np.interp(rest, _LEVELS, _WARM) + OFF["temperature"] * rng.normal(),
    )


def _log(flight: Flight, waves: Array, rng: np.random.Generator) -> FloatLog:
    rows = flight.rows[np.append(np.diff(flight.rows["t"]) > 0.0, True)]
    t, z = rows["t"], rows["z"]
    u = np.array([moved(waves, *at)[1] for at in zip(z.tolist(), t.tolist(), strict=True)])
    way = CubicHermiteSpline(t, z, rows["w"] + u)
    notes, actions = flight.notes, []
    for k, note in enumerate(notes):
        device = _DEVICES.get(Note(int(note["what"])))
        if device is not None:
            over = next(n for n in notes[k:] if int(n["what"]) == Note.RUN_OVER)
            seconds = float(over["number"])
            actions.append(
                Action(device=device, time=float(note["t"]), asked=seconds, seconds=seconds)
            )
    time = np.union1d(np.arange(0.0, t[-1], EVERY), [a.time for a in actions])
    pressure = np.interp(way(time), flight.column.depth, flight.column.pressure)
    pressure = pressure + NOISE * rng.normal(size=len(time))
    return FloatLog(
        source=f"dive {flight.begin[0]:g}",
        time=time,
        pressure=RESOLUTION * np.round(pressure / RESOLUTION),
        temperature=np.full(len(time), np.nan),
        stage=np.full(len(time), -2, dtype=np.int64),
        actions=tuple(actions),
    )
