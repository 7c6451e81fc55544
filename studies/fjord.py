"""A piston float in a fjord, predicted: `python -m studies.fjord DATA_DIR`.

DATA_DIR holds `missions.csv.gz` of the vehicle of the preset `ntnu-bv` and the casts beside it.
Missions 53, 55 and 57 were in sea water, which the logger took for fresh: its depths are scaled.
Each is predicted by what the two others taught, in water of constant density and in that of a cast:
10 s and 60 s ahead by the causal filter of `compare --horizons`, then its whole length in one go
with one neutral volume and at most a steady drift. Then what could explain the rest, by the
likelihood of all three; and what else pulled at the float: `docs/explanation/fjord.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from studies.fjord_line import columns, line_table
from studies.tank import HORIZONS
from swimbladder.estimation.comparison import compare, record
from swimbladder.estimation.comparison.ahead import predict_ahead
from swimbladder.estimation.motion.problem import Assumed, posed
from swimbladder.estimation.motion.process_noise import ProcessNoiseFit, fit_process_noise
from swimbladder.estimation.motion.result import Values, identified_vehicle
from swimbladder.io.casts import read_cast
from swimbladder.io.config import load_vehicle
from swimbladder.io.log_format import log_format
from swimbladder.io.logs import Log, read_log
from swimbladder.physics.seawater import Column, cast_column
from swimbladder.vehicle import Vehicle

__all__ = ["LOGS", "load", "main", "sea_vehicle", "upright", "water"]

LOGS = (53, 55, 57)
FRESH, SEA = 1000.0, 1025.8  # kg/m3: what the logger reckons with, and the cast from 2 m down
APRIL, JUNE = "ctd_borsa14.04.2023.csv", "ctd_borsa15.06.2023.csv"  # Borsa fjord, 2023
SEPTEMBER = "ctd_CTD_probe.csv"  # 30 September 2022, down to 87 m
LATITUDE = 63.3  # degrees, of the Borsa fjord
ROWS = 0.1  # m, of the water; the casts have one in 0.3 m
BETWEEN = 15e-6  # m3, 1 sigma of the neutral volume from mission to mission: two do not tell it
UNDER = 0.3  # m, from where on the whole log is told: above it the lid is out of the water
RIGHTED = -0.05  # m, what an upright float does not read
FIRST = 30.0  # s, in which it rights itself
NEAR = 0.95  # of the set-point, which was meant in the logger's own metres
PER_KELVIN = 2.5e-6  # m3/K, as the missions in the tank ask for (docs/explanation/filter.md)
ALONE = ("neutral_volume", "start_depth", "start_speed")


class Idea(NamedTuple):
    """A way to read the three missions: what is changed, and what is estimated beside K2 and T2."""

    name: str
    logs: Mapping[int, Log]
    vehicle: Vehicle
    water: Column | None
    psi: float | None  # m3/m, held; None: estimated
    drag: str = "linear"


def load(folder: Path) -> dict[int, Log]:
    """Return the missions, depths as of sea water."""
    form = log_format("ntnu-bv")
    form = form.model_copy(update={"logger_density": FRESH, "water_density": SEA})
    path = folder / "missions.csv.gz"
    return {n: read_log(path, where={"log": n}, log_format=form) for n in LOGS}


def upright(log: Log) -> Log:
    """Return a log from where the float has righted itself.

    Before, it lies at the surface with its piston out, and the sensor, at its lower end, in air.
    """
    lies = (log.depth < RIGHTED) & (log.time < log.time[0] + FIRST)
    first = int(np.flatnonzero(lies)[-1]) + 1 if lies.any() else 0
    return log.only(np.arange(len(log)) >= first)


def sea_vehicle(height: float | None = None) -> Vehicle:
    """Return the preset in sea water: in it, piston and mass do more.

    height: of the hull [m], over which it feels the water; the preset's where it is not given.
    """
    vehicle = load_vehicle("ntnu-bv")
    hull = vehicle.hull
    if height is not None:
        hull = hull.model_copy(update={"height": height})
    sea = vehicle.water.model_copy(update={"density": SEA})
    return vehicle.model_copy(update={"water": sea, "hull": hull})


def hull_height(folder: Path) -> float:
    """Return how far below the top of the hull the sensor is [m].

    So much too little it reads in air: its zero is that of a float with its top at the surface.
    """
    return -float(np.median([log.depth[:3].min() for log in load(folder).values()]))


def water(folder: Path, name: str, *, lifted: float = 0.0) -> Column:
    """Return the water of a cast, all its layers lifted by so much [m]."""
    cast = read_cast(folder / name, latitude=LATITUDE, inversions="average")
    pressure = cast.pressure - lifted * SEA * 9.81 / 1e4
    kept = pressure > 0.0
    moved = replace(cast, pressure=pressure[kept], SA=cast.SA[kept], CT=cast.CT[kept])
    return cast_column(moved, step=ROWS)


def teach(idea: Idea, numbers: tuple[int, ...]) -> tuple[Vehicle, ProcessNoiseFit]:
    """Return the vehicle as these missions tell it, its neutral volume walking, and the fit."""
    base = idea.vehicle
    logs = [idea.logs[n] for n in numbers]
    records = [record(log, base, drive="volume", column=idea.water) for log in logs]
    fixed = {} if idea.psi is None else {"psi": idea.psi}
    problem = posed(records, base, Assumed(fixed), drag=idea.drag)
    found, model = fit_process_noise(problem, base, without=("correlated",)), problem.model
    logged = tuple(f"mission {n}" for n in numbers)
    taught = identified_vehicle(
        base,
        model,
        Values(found.names, found.values, found.covariance, logged),
        depth_noise=found.noise.depth,
        neutral_std=BETWEEN,
        random_walk=found.noise.random_walk,
        acceleration_noise=found.noise.acceleration,
    )
    return taught, found


def ready(idea: Idea, number: int) -> Vehicle:
    """Return the vehicle as the two other missions tell it, with their mean neutral volume."""
    others = tuple(n for n in LOGS if n != number)
    vehicle, _ = teach(idea, others)
    neutral = np.mean([whole(idea.logs[n], vehicle, idea.water, ALONE)[1] for n in others])
    return vehicle.model_copy(update={"trim_error": float(neutral)})


def whole(
    log: Log, vehicle: Vehicle, water: Column | None, names: tuple[str, ...]
) -> tuple[float, float]:
    """Return the rms of depth [m] of a whole log in one go, and its neutral volume [m3]."""
    found = compare(
        log, vehicle, drive="volume", free=names, submerged=True, surface_margin=UNDER, cast=water
    )
    return found.rms, found.fitted["neutral_volume"].value


def judge(idea: Idea, number: int, vehicle: Vehicle) -> tuple[str, str]:
    """Return rows of two tables: a mission by the vehicle that the others taught.

    The second has the predictions from before and from after it first came near its set-point.
    """
    log = idea.logs[number]
    cells, parts = [], []
    ahead = predict_ahead(log, vehicle, horizons=HORIZONS, column=idea.water)
    assert log.reference_depth is not None
    arrived = int(np.argmax(log.depth > NEAR * log.reference_depth.max()))
    for horizon in ahead.horizons:
        there = horizon.origin >= arrived
        measured = log.depth[horizon.target]
        for inside in (~there, there):
            parts += [
                f"{np.sqrt(np.mean((guess - measured)[inside] ** 2)):.3f}"
                for guess in (horizon.predicted, log.depth[horizon.origin])
            ]
        skill = horizon.skill["persistence"]
        cells += [
            f"{horizon.rms:.3f}",
            f"{horizon.persistence_rms:.3f}",
            "-" if skill is None else f"{skill:.2f}",
        ]
    for more in ((), ("neutral_drift",), ("drag",)):
        cells.append(f"{whole(log, vehicle, idea.water, (*ALONE, *more))[0]:.3f}")
    first = f"| {number} | {idea.name} |"
    return f"{first} {' | '.join(cells)} |", f"{first} {' | '.join(parts)} |"


def ideas(folder: Path) -> list[Idea]:
    """Return the ways to read the missions: the first two are judged, all are weighed."""
    logs = {n: upright(log) for n, log in load(folder).items()}
    vehicle = sea_vehicle(hull_height(folder))
    april, psi = water(folder, APRIL), sea_vehicle().hull.psi
    first = Idea("cast of April", logs, vehicle, april, psi)
    return [
        Idea("constant density", logs, vehicle, None, None),
        first,
        first._replace(name="psi estimated too", psi=None),
        first._replace(name="blended drag", drag="blended"),
        first._replace(name="cast of September 2022", water=water(folder, SEPTEMBER)),
        first._replace(name="halocline 0.2 m higher", water=water(folder, APRIL, lifted=0.2)),
        first._replace(name="halocline 0.2 m lower", water=water(folder, APRIL, lifted=-0.2)),
        first._replace(name="hull of no height", vehicle=sea_vehicle(1e-3)),
        *(
            first._replace(
                name=f"hull grows {1e6 * per:g} cm3/K", logs=_warm(folder, logs, vehicle, per)
            )
            for per in (PER_KELVIN, -PER_KELVIN)
        ),
    ]


def _warm(
    folder: Path, logs: Mapping[int, Log], vehicle: Vehicle, per_kelvin: float
) -> dict[int, Log]:
    """Return the logs with what a hull displaces more when it is warmer [m3/K] in the volume."""
    area = vehicle.piston_area
    assert area is not None  # the preset has a piston
    found = {}
    for n, log in logs.items():
        assert log.piston is not None
        logged = columns(folder, n, ("temperature_degC",))
        warm = np.interp(log.time, logged["t_s"], logged["temperature_degC"])
        volume = log.piston * area + per_kelvin * (warm - warm[-1])
        found[n] = replace(log, volume=volume, volume_absolute=True)
    return found


def evaluate(ideas: list[Idea], tell: Callable[[str], None]) -> None:
    """Tell how probable each idea makes all three missions, and what it takes for that."""
    tell(
        "\n| idea | log likelihood | K2, 1/(m2 s) | mass, kg | psi, cm3/m | walk, cm3/s^0.5 |\n"
        "|---|---:|---:|---:|---:|---:|"
    )
    best = None
    for idea in ideas:
        vehicle, found = teach(idea, LOGS)
        best = found.log_likelihood if best is None else best
        tell(
            f"| {idea.name} | {found.log_likelihood - best:+.1f} | {found.values['K2']:.0f} "
            f"| {vehicle.mass:.1f} | {1e6 * found.values['psi']:.2f} "
            f"| {1e6 * found.noise.random_walk:.2f} |"
        )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of measured data")
    folder = parser.parse_args().data / "ntnu_bv"
    listed = ideas(folder)

    def tell(text: str) -> None:
        print(text, flush=True)

    tell(f"hull: the sensor is {hull_height(folder):.2f} m below its top\n")
    tell(
        "| mission | water | 10 s ahead, m rms | stays, m rms | skill | 60 s ahead, m rms "
        "| stays, m rms | skill | whole, m rms | with a drift | with its own drag |\n"
        "|---|---|" + "---:|" * 9
    )
    taught: dict[int, Vehicle] = {}
    parts: list[str] = []
    for idea in (listed[0], listed[1]):
        for number in LOGS:
            taught[number] = ready(idea, number)
            row, part = judge(idea, number, taught[number])
            parts.append(part)
            tell(row)
    tell(
        "\n| mission | water | 10 s: on its way, m rms | stays | there | stays | 60 s: on its way "
        "| stays | there | stays |\n|---|---|" + "---:|" * 8
    )
    tell("\n".join(parts))
    tell(line_table(folder, listed[1].logs, taught, listed[1].water))
    evaluate(listed, tell)


if __name__ == "__main__":
    main()
