"""A deep Argo float flown by its own rules: `python -m studies.argo_cycles DATA`.

Its parameters are identified from some cycles, and the others are flown: the law `argo` with the
numbers of its configuration, in the water that the float measured on its way up. Printed is what
the float did and what was flown: actions of each phase, and the times of descent and ascent. An
ascent begins at its first run of the pump; what the depths differ by from which it begins counts
at the float's mean speed. A descent counts from 300 dbar on, or from its first opening below: what
the float lets in at the surface, and how it learns that, is not in its configuration.

Each ascent is also replayed by the runs of the pump that the float logged, from the first on: what
the model makes of them, with no decision of the law in it.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import gsw
import numpy as np

from swimbladder.estimation.motion.deep import identify_deep
from swimbladder.estimation.motion.deep_model import (
    Replay,
    body_of,
    cold_neutral,
    deep_dive,
    gained_volume,
    priors_of,
    replay,
    warmed,
)
from swimbladder.estimation.series import Array
from swimbladder.io.casts import read_cast
from swimbladder.io.config import load_mission, load_vehicle
from swimbladder.io.float_log import FloatLog
from swimbladder.io.float_logs import read_float_log
from swimbladder.physics.seawater import Cast, Column, cast_column
from swimbladder.sim.engine.rodas.records import Note
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.vehicle import Vehicle

__all__ = ["Ascent", "Row", "flown", "identified", "main", "of_ascents", "replayed", "table"]

PLACE = -47.0  # degrees of latitude
UP = 15.0  # dbar, where an ascent is over
OVER = 50.0  # dbar, where one that is replayed is
SUNK = 300.0  # dbar, below which a descent counts
_CYCLES = range(2, 11)


class Row(NamedTuple):
    """A cycle as logged and as flown."""

    cycle: int
    ascent: float  # min, of the log
    ascent_flown: float
    pumps: int
    pumps_flown: int
    descent: float  # min, to the park depth
    descent_flown: float
    valves: int
    valves_flown: int
    on: int  # openings on the way from park to profile
    on_flown: int


def identified(folder: Path, cycles: Sequence[int]) -> Vehicle:
    """Return the float of a folder of packets as its cycles identify it."""
    logs = [_log(folder, c) for c in cycles]
    found = identify_deep(logs, [_column(folder, c) for c in cycles], load_vehicle("deep-arvor"))
    assert found.identified
    return found.result_vehicle


def flown(folder: Path, vehicle: Vehicle, cycle: int) -> Row:
    """Return a cycle as the float did it and as a vehicle flies it."""
    with (folder / "deep_4000_cycles.csv").open(newline="") as file:
        said = next(row for row in csv.DictReader(file) if int(row["cycle"]) == cycle)
    log = _log(folder, cycle)
    pumps = np.array([action.time for action in log.of("pump")])
    at = np.interp(pumps, log.time, log.pressure) / 1e4
    began, bottom = pumps[0], float(at[0])
    up = log.time >= began
    ends = np.interp(-UP, -log.pressure[up] / 1e4, log.time[up])
    opened = [action.time for action in log.of("valve") if action.time < began]
    opened_at = np.interp(opened, log.time, log.pressure) / 1e4
    sunk = max(SUNK, float(opened_at[0]))  # dbar
    down = float(said["descent_end_min_of_day"]) - float(said["first_stabilisation_min_of_day"])
    since = (np.interp(sunk, opened_at, opened) - opened[0]) / 60.0  # min, its first opening

    task = load_mission(folder / "deep_4000_config.json")
    flight = fly_mission(vehicle, task, _column(folder, cycle))
    rows, notes, surface = flight.rows, flight.notes, len(task.phases) - 1
    begins = np.flatnonzero(notes["what"] == Note.PHASE)
    phase = np.searchsorted(begins, np.arange(len(notes)), side="right") - 1
    runs = notes[(notes["what"] == Note.PUMP) & (phase == surface)]
    t0, deepest = float(runs["t"][0]), _dbar(float(runs["z"][0]))
    rising = rows["t"] >= t0
    shallow = float(-gsw.z_from_p(UP, PLACE))
    over = float(np.interp(-shallow, -rows["z"][rising], rows["t"][rising]))
    speed = (bottom - UP) / ((ends - began) / 60.0)  # dbar/min
    counts = float(-gsw.z_from_p(sunk, PLACE))  # m
    begins_at = float(np.interp(counts, rows["z"][~rising], rows["t"][~rising]))
    park = task.phases[0]
    assert park.depth is not None
    assert park.tolerance is not None
    band = park.depth - park.tolerance
    arrives = float(rows["t"][np.argmax(rows["z"] >= band)])
    valves = phase[(notes["what"] == Note.VALVE) & (notes["z"] > counts)]
    band_at = _dbar(band)
    return Row(
        cycle,
        ascent=(ends - began) / 60.0,
        ascent_flown=(over - t0) / 60.0 + (bottom - deepest) / speed,
        pumps=int(np.sum(at > UP)),
        pumps_flown=int(np.sum(runs["z"] > shallow)),
        descent=down % 1440.0 - since,
        descent_flown=(arrives - begins_at) / 60.0,
        valves=int(np.sum((opened_at > sunk) & (opened_at < band_at))),
        valves_flown=int(np.sum(valves == 0)),
        on=int(np.sum(opened_at > band_at)),
        on_flown=int(np.sum(valves == 1)),
    )


class Ascent(NamedTuple):
    """From the first run of the pump to `OVER`, and where it was at its other runs."""

    minutes: float  # min, of the log
    told: float  # min, replayed
    pressure: Array  # dbar, at each further run, of the log
    pressure_told: Array  # dbar, replayed
    since: Array  # min, since the first run
    bottom: float  # dbar, at the first run


def replayed(folder: Path, vehicle: Vehicle, cycle: int) -> Ascent:
    """Return an ascent as logged and as the vehicle makes it, by the logged runs of the pump."""
    dive = deep_dive(_log(folder, cycle), _column(folder, cycle), vehicle)
    body, runs = body_of(vehicle), dive.actions.time[dive.actions.pumps]
    values = {name: prior.mean for name, prior in priors_of(vehicle, {}).items()}
    at_rest = runs[:1]
    p, warmth = (np.interp(at_rest, dive.time, x) for x in (dive.pressure, dive.temperature))
    neutral = np.interp(p, dive.water.pressure, cold_neutral(body, values, dive.water))
    neutral = neutral - warmed(body, values, warmth) - gained_volume(values, dive, at_rest)
    start = float(neutral[0])
    told = replay(body, values, start, dive, begin=float(runs[0]))
    logged = Replay(time=dive.time, pressure=dive.pressure, speed=np.zeros(len(dive.time)))
    minutes = [
        (way.arrival(OVER * 1e4, after=float(runs[0])) - float(runs[0])) / 60.0
        for way in (logged, told)
    ]
    at = runs[1:][logged.at(runs[1:]) > OVER * 1e4]
    pressures = logged.at(at) / 1e4, told.at(at) / 1e4
    bottom = float(logged.at(runs[:1])[0]) / 1e4
    return Ascent(*minutes, *pressures, (at - runs[0]) / 60.0, bottom)


def of_ascents(ascents: Sequence[Ascent], known: Sequence[Ascent]) -> str:
    """Return how far replayed ascents are off, beside a constant speed: the mean of known ones."""
    speed = float(np.mean([(a.bottom - OVER) / a.minutes for a in known]))  # dbar/min
    late = [a.told - a.minutes for a in ascents]
    late_simple = [(a.bottom - OVER) / speed - a.minutes for a in ascents]
    off = np.concatenate([a.pressure_told - a.pressure for a in ascents])
    off_simple = np.concatenate([a.bottom - speed * a.since - a.pressure for a in ascents])
    rms = [np.sqrt(np.mean(np.square(x))) for x in (late, late_simple, off, off_simple)]
    return (
        f"replayed to {OVER:g} dbar: {rms[0]:.1f} min rms, {rms[1]:.1f} at constant speed; "
        f"at the runs {rms[2]:.1f} dbar rms, {rms[3]:.1f} at constant speed"
    )


def table(rows: Sequence[Row]) -> str:
    """Return rows as a table of logged / flown."""
    lines = [
        "| cycle | ascent, min | runs of the pump | descent, min | openings | to the profile |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    lines += [
        f"| {r.cycle} | {r.ascent:.0f} / {r.ascent_flown:.0f} | {r.pumps} / {r.pumps_flown} "
        f"| {r.descent:.0f} / {r.descent_flown:.0f} | {r.valves} / {r.valves_flown} "
        f"| {r.on} / {r.on_flown} |"
        for r in rows
    ]
    off = np.array([r.ascent_flown - r.ascent for r in rows])
    return "\n".join([*lines, "", f"ascents off by {np.sqrt(np.mean(off**2)):.1f} min rms"])


def main(argv: Sequence[str] | None = None) -> None:
    """Identify from each half of the cycles and fly the other."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder that has argo_arvor")
    folder = parser.parse_args(argv).data / "argo_arvor"
    first, second = [*_CYCLES][:5], [*_CYCLES][4:]
    rows, said = [], []
    for known, others in ((second, first[:4]), (first, second[1:])):
        vehicle = identified(folder, known)
        rows += [flown(folder, vehicle, cycle) for cycle in others]
        ascents = {c: replayed(folder, vehicle, c) for c in {*known, *others}}
        said += [of_ascents([ascents[c] for c in others], [ascents[c] for c in known])]
    print(table(rows), *said, sep="\n")


def _log(folder: Path, cycle: int) -> FloatLog:
    return read_float_log(folder / "deep_4000_actions.csv.gz", where={"cycle": str(cycle)})


def _column(folder: Path, cycle: int) -> Column:
    """Return the water of a cycle; below its cast that of the deepest cast."""
    own, deepest = _cast(folder, cycle), _cast(folder, 7)
    below = deepest.pressure > own.pressure[-1]
    pressure, SA, CT = (
        np.append(a, b[below])
        for a, b in (
            (own.pressure, deepest.pressure),
            (own.SA, deepest.SA),
            (own.CT, deepest.CT),
        )
    )
    return cast_column(replace(own, pressure=pressure, SA=SA, CT=CT))


def _cast(folder: Path, cycle: int) -> Cast:
    where = {"cycle": str(cycle), "phase": "ascent"}
    path = folder / "deep_4000_ctd.csv.gz"
    return read_cast(path, where=where, inversions="average", latitude=PLACE)


def _dbar(depth: float) -> float:
    return float(gsw.p_from_z(-depth, PLACE))


if __name__ == "__main__":
    main()
