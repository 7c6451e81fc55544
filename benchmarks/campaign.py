"""A campaign by threads, processes and local dask workers: floats per second, side by side.

The speed is that between the first and the last chunks, by the times of their markers, with as many
workers as cores: what it takes to start workers is given by itself. Each executor has several
turns, one after the other, since a machine is never quiet for long; the medians are compared.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter, time

from benchmarks.table import number, ratio, render
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.jobs import EXECUTORS, Workers, run
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.campaign.run import Floats

__all__ = ["Speed", "compare", "report"]

GOAL = 0.9  # of the speed of threads, for two local dask workers
WORKERS = 2
DAY = 86400.0


@dataclass(frozen=True)
class Speed:
    """Floats per second, and how long it took until the first chunk was done [s]."""

    executor: str
    floats: float
    start: float


def compare(*, quick: bool) -> list[Speed]:
    """Return the speed of each executor, threads first."""
    vehicle = load_vehicle("example-float")
    task = Mission(
        phases=[
            {"kind": "descend", "depth": 1000.0},
            {"kind": "park", "depth": 1000.0, "tolerance": 30.0, "duration": 9.0 * DAY},
            {"kind": "profile", "depth": 10.0, "tolerance": 5.0},
            {"kind": "surface", "duration": 1800.0},
        ],
        cycles=2 if quick else 36,
    )
    water = uniform_column(vehicle.water, 1500.0)
    turns: dict[str, list[Speed]] = {name: [] for name in EXECUTORS}
    for _ in range(1 if quick else 3):
        for name in EXECUTORS:
            with tempfile.TemporaryDirectory() as folder:
                job = Floats(
                    vehicle=vehicle,
                    mission=task,
                    columns=[water],
                    floats=64 if quick else 240,
                    store=Path(folder) / "campaign.zarr",
                )
                turns[name].append(_timed(job, name))
    return [
        Speed(name, median(one.floats for one in found), median(one.start for one in found))
        for name, found in turns.items()
    ]


def _timed(job: Floats, executor: str) -> Speed:
    begin, before = time(), perf_counter()
    if not run(job, Workers(executor=executor, workers=WORKERS)):
        raise ArithmeticError(f"{executor}: not all floats are flown")
    after = perf_counter() - before
    markers = (job.store / "flown" / "c").iterdir()
    times = sorted(marker.stat().st_mtime - begin for marker in markers)
    # the first of each worker may still have loaded what it needs
    flown = job.layout.chunk * (len(times) - WORKERS)
    return Speed(executor, flown / (times[-1] - times[WORKERS - 1]), min(times[0], after))


def report(speeds: list[Speed]) -> str:
    """Return the comparison as a table."""
    threads = speeds[0].floats
    lines = [
        (one.executor, number(one.floats), ratio(one.floats, threads), number(one.start))
        for one in speeds
    ]
    headings = [f"Campaign, {WORKERS} workers", "floats/s", "to threads", "first chunk after [s]"]
    return render(headings, lines) + f"\ngoal for dask: {GOAL} x"


def main() -> None:
    """Print the comparison."""
    print(report(compare(quick=False)))


if __name__ == "__main__":
    main()
