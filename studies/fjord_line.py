"""What else pulled at the float in the fjord: its gyroscope and accelerometer, and the two halves.

Missions 55 and 57 sink at a steady 7 cm/s down to 6.6 m and from there on at half of that, with the
piston where it was. Water as dense as that would stand in the cast, and would not tilt the float or
make it turn to and fro about its axis: a line does.
"""

from __future__ import annotations

import csv
import gzip
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.comparison import compare
from swimbladder.io.logs import Log
from swimbladder.physics.seawater import Column
from swimbladder.vehicle import Vehicle

__all__ = ["columns", "line_table", "turning"]

Array = NDArray[np.float64]

TAUT = 6.6  # m, from where on the two missions sink slowly
DEEP = (55, 57)
TANK = (31, 35, 39, 45, 47, 51)  # those whose gyroscope did not stand at its limit
SLOW, QUICK = 40.0, 4.0  # s: turning to and fro takes 20 s or so
SETTLED = 60.0  # s, after which a float in the tank no longer turns from being let go
CALM = 20.0  # s, left out after the deepest point


def columns(folder: Path, number: int, names: tuple[str, ...]) -> dict[str, Array]:
    """Return columns of a mission by name, from its first record with a voltage on."""
    with gzip.open(folder / "missions.csv.gz", "rt", newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["log"] == str(number)]
    rows = [row for row in rows if all(row[name] for name in (*names, "t_s"))]
    return {name: np.array([float(row[name]) for row in rows]) for name in ("t_s", *names)}


def turning(time: Array, rate: Array) -> Array:
    """Return the part of a turning rate that goes to and fro within 4 to 40 s."""
    return _smooth(time, rate, QUICK) - _smooth(time, rate, SLOW)


def _smooth(time: Array, values: Array, span: float) -> Array:
    """Return the mean over a span [s] about each instant."""
    total = np.append(0.0, np.cumsum(values))
    a, b = (np.searchsorted(time, time + side * span / 2.0) for side in (-1.0, 1.0))
    return np.asarray((total[b] - total[a]) / (b - a))


def line_table(
    folder: Path, logs: Mapping[int, Log], vehicles: Mapping[int, Vehicle], water: Column | None
) -> str:
    """Return what tells a line, as text: how the float turns and tilts, and what the halves ask."""
    said = [
        "\n| mission | stretch | turns to and fro, counts rms | tilt, degrees |",
        "|---|---|---:|---:|",
    ]
    for n in DEEP:
        for name, inside, found in _stretches(folder, n, logs[n]):
            said.append(
                f"| {n} | {name} | {_rms(found['turns'][inside]):.0f} "
                f"| {np.degrees(np.mean(found['tilt'][inside])):.2f} |"
            )
    for n in TANK:
        found = columns(folder, n, ("gyro_z",))
        held = found["t_s"] > SETTLED
        turns = turning(found["t_s"], found["gyro_z"])[held]
        said.append(f"| {n} | in the tank | {_rms(turns):.0f} | |")
    said += [
        "\n| mission | stretch | whole, m rms | neutral volume, cm3 |",
        "|---|---|---:|---:|",
    ]
    for n in DEEP:
        log, (taut, deepest) = logs[n], _when(logs[n])
        for name, inside in (
            (f"down to {TAUT} m", log.time < taut),
            ("to its deepest", (log.time >= taut) & (log.time < deepest)),
            ("from there on", log.time >= deepest),
        ):
            found = compare(
                log.only(inside),
                vehicles[n],
                drive="volume",
                submerged=True,
                surface_margin=0.3,
                free=("neutral_volume", "start_depth", "start_speed"),
                cast=water,
            )
            neutral = found.fitted["neutral_volume"].value
            said.append(f"| {n} | {name} | {found.rms:.3f} | {1e6 * neutral:.1f} |")
    return "\n".join(said)


def _when(log: Log) -> tuple[float, float]:
    """Return when the float first passes TAUT, and when it then is deepest [s]."""
    first = int(np.argmax(log.depth > TAUT))
    later = int(np.argmax((np.arange(len(log)) > first) & (log.depth < TAUT))) or len(log)
    return float(log.time[first]), float(log.time[first + int(np.argmax(log.depth[first:later]))])


def _stretches(
    folder: Path, number: int, log: Log
) -> list[tuple[str, NDArray[np.bool_], dict[str, Array]]]:
    taut, deepest = _when(log)
    found = columns(folder, number, ("gyro_z", "acc_y", "acc_z"))
    t = found["t_s"]
    found["turns"] = turning(t, found["gyro_z"])
    found["tilt"] = np.arctan2(found["acc_y"], found["acc_z"])
    sinks = (t > taut - 60.0) & (t < taut - SLOW / 2.0)
    rest = (t > deepest + CALM) & (t < deepest + CALM + 60.0)
    return [
        ("sinking freely", sinks, found),
        (f"from {TAUT} m to its deepest", (t > taut) & (t < deepest), found),
        ("held at 8 m", rest, found),
    ]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
