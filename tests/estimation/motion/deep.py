"""Deep dives made up for the tests: a float, its water, dives of known parameters."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from swimbladder.estimation.motion.deep_model import Body, DeepDive, deep_dive, replay
from swimbladder.io.config import load_vehicle
from swimbladder.io.float_log import Action, FloatLog
from swimbladder.physics.seawater import Cast, Column, cast_column
from swimbladder.vehicle import Vehicle

FLOAT = """\
schema_version = 1
name = "made-up"
[water]
density = "1029 kg/m3"
[actuator]
kind = "pump-valve"
[actuator.pump]
kind = "power-law"
delivery = "0.8 mL/s"
idle_power = "7 W"
power_per_pressure = "8 mW/dbar"
[actuator.valve]
flow = "2.5 mL/s/bar^0.5"
power = "8 W"
[supply]
voltage = "15 V"
[stroke]
minimum = "-500 cm3"
maximum = "500 cm3"
[hull]
displaced_volume = "33 L"
psi = "-0.08 cm3/m"
waterplane_area = "300 cm2"
height = "1.1 m"
depth_limit = "2100 m"
[[hull.parts]]
name = "hull"
volume = "33 L"
compressibility = "3e-10 1/Pa"
thermal_expansion = "1e-4 1/K"
[motion]
kind = "physical"
dry_mass = "34 kg"
added_mass = "3 kg"
[motion.drag]
law = "quadratic"
k_dt = "160 N s2/m2"
"""
BREAK = 600.0  # s of AR(1) noise
BOTTOM = 1.2e7  # Pa


def made_up_vehicle(folder: Path) -> Vehicle:
    path = folder / "float.toml"
    path.write_text(FLOAT)
    return load_vehicle(path)


def made_up_column() -> Column:
    """A warm layer over cold water: salinity 35 to 35.5 g/kg, 22 to 6 degrees."""
    p = np.linspace(0.0, 4000.0, 801)
    warm = 6.0 + 16.0 / (1.0 + np.exp((p - 120.0) / 40.0))
    return cast_column(Cast(pressure=p, SA=35.0 + p / 3000.0, CT=warm, latitude=40.0))


def made_up_log(runs: list[tuple[str, float, float]], hours: float) -> FloatLog:
    """Return a log of that many hours with these runs (device, time, seconds), not yet dived."""
    time = np.arange(0.0, 3600.0 * hours, 90.0)
    return FloatLog(
        source="made up",
        time=time,
        pressure=np.full(len(time), 2e6),
        temperature=np.full(len(time), np.nan),
        stage=np.full(len(time), -2, dtype=np.int64),
        actions=tuple(
            Action(device=device, time=t, asked=s, seconds=s)  # type: ignore[arg-type]
            for device, t, s in runs
        ),
    )


def dived(
    vehicle: Vehicle,
    body: Body,
    column: Column,
    values: dict[str, float],
    rng,
    *,
    runs: list[tuple[str, float, float]],
    hours: float,
    start: float,
    wave: float = 1.5,
) -> tuple[FloatLog, DeepDive]:
    """Return a dive of known values: the nominal volumes follow from where it was, so in rounds.

    wave: the water's vertical displacement [m, 1 sigma], an AR(1) process, seen in the pressure.
    """
    log = made_up_log(runs, hours)
    for _ in range(6):
        dive = deep_dive(log, column, vehicle)
        told = replay(body, values, start, dive, pressure=2.5e5, begin=0.0)
        log = replace(
            log,
            pressure=told.at(log.time),
            temperature=np.interp(told.at(log.time), column.pressure, column.temperature),
        )
    up = np.flatnonzero((log.pressure < 4e5) & (log.time > 3600.0))
    if len(up):  # near the surface the dive is over
        end = int(up[0])
        log = replace(
            log,
            time=log.time[:end],
            pressure=log.pressure[:end],
            temperature=log.temperature[:end],
            stage=log.stage[:end],
        )
    a = np.exp(-90.0 / BREAK)
    moved = np.zeros(len(log))
    moved[0] = rng.normal()
    for i in range(1, len(moved)):
        moved[i] = a * moved[i - 1] + np.sqrt(1.0 - a * a) * rng.normal()
    log = replace(log, pressure=log.pressure + 1e4 * wave * moved)
    return log, deep_dive(log, column, vehicle)
