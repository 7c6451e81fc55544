"""A real float, predicted: `python -m studies.tank DATA_DIR`.

DATA_DIR, or `ntnu_bv` in it, holds `missions.csv.gz` and `missions_meta.csv` of the vehicle of the
preset `ntnu-bv`, logged in a tank. Parameters, noise and how logs differ come from the training
logs only. Printed is how well each other log is predicted 10 s and 60 s ahead by a causal filter,
and, which asks far more, over its whole length with one constant neutral volume, and with a steady
drift. Each miss has its reason beside it.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from studies.tank_table import Row, parameters, table
from swimbladder.estimation.comparison import Record, compare, record
from swimbladder.estimation.comparison.ahead import Ahead, predict_ahead
from swimbladder.estimation.estimates import Estimate
from swimbladder.estimation.kalman import Noise, Samples, Start, filter_depth
from swimbladder.estimation.motion.problem import Assumed, posed
from swimbladder.estimation.motion.process_noise import (
    Heat,
    ProcessNoiseFit,
    fit_process_noise,
    with_heat,
)
from swimbladder.estimation.motion.result import Values, between_logs, identified_vehicle
from swimbladder.io.config import load_vehicle
from swimbladder.io.files import write_atomically
from swimbladder.io.logs import Log, read_log
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import Vehicle

__all__ = [
    "HORIZONS",
    "expanding",
    "judge",
    "load",
    "logs_folder",
    "main",
    "tank_logs",
    "train",
]

HORIZONS = (10.0, 60.0)  # s
BOTTOM = 1.43  # m, where the float lay in mission 37
# Of each day the two missions that travelled most and did not touch the bottom: what moves tells
# mass and drag, and several days tell how days differ.
TRAIN = (31, 35, 45, 47, 49, 51, 59, 63)
# Missions of a day or so, told apart by sensor settings and temperature.
SESSIONS = ((0, 28), (29, 36), (37, 42), (43, 48), (49, 52), (59, 65))

_DEEPER = 0.03  # m below the bottom that shows that it is not there
_TRAVELLED = 1.0e-6  # m3, a drift that matters
_LYING = 10  # samples


def logs_folder(data: Path, parser: argparse.ArgumentParser) -> Path:
    """Return the folder with the vehicle's missions: data, or `ntnu_bv` in it; ends without."""
    for folder in (data, data / "ntnu_bv"):
        if (folder / "missions_meta.csv").is_file():
            return folder
    parser.error(f"{data}: there is no missions_meta.csv, nor ntnu_bv/missions_meta.csv")


def tank_logs(folder: Path) -> list[int]:
    """Return the missions in the tank that can be used, by the notes of the collection."""
    with (folder / "missions_meta.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [
        int(row["log"])
        for row in rows
        if row["usable"] == "True" and "tank" in row["setting_inferred"]
    ]


def load(folder: Path, logs: Iterable[int]) -> dict[int, Log]:
    """Return the logs by mission: raw depths, since the filtered ones lag by 0.7 s."""
    path = folder / "missions.csv.gz"
    return {n: read_log(path, where={"log": n}, log_format="ntnu-bv") for n in logs}


def expanding(vehicle: Vehicle, gain: float) -> Vehicle:
    """Return the vehicle with a hull that gains so much more per kelvin [m3/K]."""
    gains, at_once = Estimate.given(gain, "m3/K"), Estimate.given(0.0, "s")
    return with_heat(vehicle, Heat(gains, at_once, np.zeros((2, 2))))


def bottom_of(log: Log) -> float:
    """Return the depth of the tank's bottom [m], inf where the log goes deeper than that."""
    deepest = float(np.sort(log.depth)[-9])
    return BOTTOM if deepest <= BOTTOM + _DEEPER else float("inf")


def _record(log: Log, vehicle: Vehicle) -> Record:
    return record(log, vehicle, drive="volume", bottom_depth=bottom_of(log))


def train(logs: Mapping[int, Log], vehicle: Vehicle) -> tuple[Vehicle, ProcessNoiseFit]:
    """Return the vehicle as identified from these logs, and the fit that they have in common."""
    records = [_record(log, vehicle) for log in logs.values()]
    problem = posed(records, vehicle, Assumed(), drag="blended")
    found, model = fit_process_noise(problem, vehicle, without=("correlated",)), problem.model
    logged = tuple(f"mission {n}" for n in logs)
    fitted = identified_vehicle(
        with_heat(vehicle, found.heat),
        model,
        Values(found.names, found.values, found.covariance, logged),
        depth_noise=found.noise.depth,
        neutral_std=0.0,
        random_walk=found.noise.random_walk,
        acceleration_noise=found.noise.acceleration,
    )
    return between_logs([_record(log, fitted) for log in logs.values()], fitted), found


def judge(number: int, log: Log, vehicle: Vehicle, *, open_loop: bool = True) -> Row:
    """Return how well a log is predicted, ahead and, where asked for, open loop."""
    bottom = bottom_of(log)
    ahead = predict_ahead(log, vehicle, horizons=HORIZONS, bottom_depth=bottom)
    rec = ahead.record
    near, far = ahead.horizons
    rms = [np.nan, np.nan]
    if open_loop:  # from under water on: how a float leaves the surface is not the question
        for i, names in enumerate((("neutral_volume",), ("neutral_volume", "neutral_drift"))):
            fit = (*names, "start_depth", "start_speed")
            rms[i] = compare(
                log, vehicle, drive="volume", free=fit, bottom_depth=bottom, submerged=True
            ).rms
    travelled = _travelled(rec, vehicle)
    lay = int((rec.depth > bottom - 0.03).sum()) > _LYING
    surfaced = _surfaced(rec)
    reasons = [
        word
        for word, so in (
            ("lay on the bottom", lay),
            ("came up again", surfaced),
            (f"neutral volume went {1e6 * travelled:.1f} cm3", travelled > _TRAVELLED),
        )
        if so
    ]
    return Row(
        log=number,
        skill10=_skill(ahead, 0, "persistence"),
        integrator10=_skill(ahead, 0, "integrator"),
        coverage10=near.coverage,
        rms10=near.rms,
        n10=near.n,
        skill60=_skill(ahead, 1, "persistence"),
        integrator60=_skill(ahead, 1, "integrator"),
        coverage60=far.coverage,
        rms60=far.rms,
        n60=far.n,
        persistence10=near.persistence_rms,
        persistence60=far.persistence_rms,
        constant=rms[0],
        drifting=rms[1],
        travelled=travelled,
        touches=lay or surfaced,
        reason=", ".join(reasons),
    )


def _skill(ahead: Ahead, horizon: int, against: str) -> float:
    value = ahead.horizons[horizon].skill[against]
    return np.nan if value is None else value


def _surfaced(rec: Record) -> bool:
    """Whether the float came up to the surface after it had been well under water."""
    under = np.flatnonzero(rec.depth > 0.3)
    return bool(len(under)) and bool((rec.depth[under[0] :] < 0.05).sum() > 2)


def _travelled(rec: Record, vehicle: Vehicle) -> float:
    """Return how far the smoothed neutral volume goes in a log [m3]: no score, it explains."""
    known = vehicle.identified
    assert known is not None  # train sees to it
    assert rec.volume is not None
    first = int(np.argmax(rec.compared))
    samples = Samples(
        np.ascontiguousarray(rec.time[first:]),
        np.ascontiguousarray(rec.volume[first:]),
        np.ascontiguousarray(rec.depth[first:]),
        rec.compared[first:].astype(np.int8),
    )
    filtered = filter_depth(
        plant(vehicle, bottom_depth=rec.bottom_depth),
        samples,
        noise=Noise(known.depth_noise, known.random_walk, known.acceleration_noise),
        start=Start(
            depth=float(samples.depth[0]),
            speed=0.0,
            neutral=float(samples.volume[0]),
            depth_std=0.03,
            speed_std=0.1,
            neutral_std=15e-6,
        ),
    )
    return float(np.ptp(filtered.smoothed()[0][:, 2]))


def cross_validate(logs: Mapping[int, Log], vehicle: Vehicle, tell: Callable[[str], None]) -> str:
    """Return the scores of every session, predicted by what all other sessions taught."""
    rows: list[Row] = []
    for first, last in SESSIONS:
        inside = {n: log for n, log in logs.items() if first <= n <= last}
        if not inside:
            continue
        tell(f"without missions {', '.join(map(str, inside))}")
        others, _ = train({n: log for n, log in logs.items() if n not in inside}, vehicle)
        rows += [judge(n, log, others, open_loop=False) for n, log in inside.items()]
    return table(rows)


def main(given: Sequence[str] | None = None) -> int:
    """Run the study, print its tables, and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m studies.tank", description=__doc__)
    parser.add_argument("data", type=Path, metavar="DATA_DIR")
    parser.add_argument("--train", type=_numbers, default=TRAIN, metavar="LOG,LOG,...")
    parser.add_argument("--test", type=_numbers, metavar="LOG,LOG,...", help="all others")
    parser.add_argument(
        "--heat",
        type=float,
        metavar="CM3_PER_K",
        help="also what the training logs tell of a hull that gains so much per kelvin",
    )
    parser.add_argument("--cross-validate", action="store_true", help="leave each session out")
    parser.add_argument("--out", type=Path, metavar="FILE", help="the rows as JSON")
    options = parser.parse_args(given)
    options.data = logs_folder(options.data, parser)
    known = tank_logs(options.data)
    wanted = options.test or tuple(n for n in known if n not in options.train)
    base = load_vehicle("ntnu-bv")
    teachers = load(options.data, options.train)
    vehicle, found = train(teachers, base)
    print(parameters(vehicle, found), flush=True)
    if options.heat is not None:
        other, likely = train(teachers, expanding(base, 1e-6 * options.heat))
        gain = likely.log_likelihood - found.log_likelihood
        print(f"\nwith {options.heat:g} cm3/K, log likelihood {gain:+.1f}:")
        print(parameters(other, likely), flush=True)
    rows = []
    for n, log in load(options.data, wanted).items():
        _tell(f"predicting mission {n}")
        rows.append(judge(n, log, vehicle))
    print(f"\nother logs\n{table(rows)}", flush=True)
    if options.cross_validate:
        every = load(options.data, known)
        print(f"\neach session by the others\n{cross_validate(every, base, _tell)}")
    if options.out is not None:
        write_atomically(options.out, json.dumps([asdict(r) for r in rows], indent=2) + "\n")
    return 0


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(","))


def _tell(words: str) -> None:
    print(words, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
