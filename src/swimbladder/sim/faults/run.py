"""A campaign: all missions of a seed in chunks, on all cores, kept on disk until it is done."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.io.files import make_folder, write_through
from swimbladder.sim.engine.modes import SUPPLY, Z_BOTTOM
from swimbladder.sim.faults.draw import Course, course_of, draw
from swimbladder.sim.faults.glue import ALONE, DEAF, SUPERVISED
from swimbladder.sim.faults.host import Board
from swimbladder.sim.faults.squadron import Squadron, sources
from swimbladder.sim.faults.verdict import FACTS, HARMS, WIDTH, Campaign
from swimbladder.vehicle import Vehicle

__all__ = ["board_of", "check_controller", "run_missions"]

Array = NDArray[np.float64]

CHUNK = 200


def check_controller(vehicle: Vehicle) -> None:
    """Raise InputError where a vehicle has no controller."""
    if vehicle.controller is None:
        raise InputError(
            f"the vehicle {vehicle.name!r} has no controller", field="controller",
            remedy="Add a [controller] table to the vehicle: swimbladder tune writes one",
        )  # fmt: skip


def board_of(course: Course) -> Board:
    """Return the vehicle's C, compiled for this machine; raises InputError without a compiler."""
    return Board(sources(course), (ALONE, SUPERVISED, DEAF))


def run_missions(
    vehicle: Vehicle, *, missions: int = 100_000, healthy: int | None = None, seed: int = 1,
    depths: tuple[float, float] | None = None, keep: Path | None = None,
    advance: Callable[[float], None] = lambda _: None,
) -> Campaign:  # fmt: skip
    """Fly missions with faults, and `healthy` ones without (a tenth as many); return what happened.

    depths [m]: least and greatest. keep: a folder for what is done, so that a run that was killed
    goes on there. advance: called with the share of the work that was done.
    Raises InputError for a vehicle without a controller, for depths that it cannot hold, and where
    there is no C compiler.
    """
    check_controller(vehicle)
    if healthy is None:
        healthy = max(missions // 10, 1)
    for field, count in (("--missions", missions), ("--healthy", healthy)):
        if not 1 <= count <= 10_000_000:
            raise InputError(
                "must be a whole number from 1 to 10 million",
                field=field,
                value=count,
                remedy="Give some hundreds to try, 100000 to prove",
            )
    course = course_of(vehicle, depths)
    files = sources(course)
    with Board(files, (ALONE, SUPERVISED, DEAF)) as board:
        kept = None if keep is None else make_folder(keep / _key(course, seed, files))
        squadron = Squadron(course, board)
        total = missions + healthy
        tables = [
            _all(squadron, course, seed, n, well, kept, lambda done: advance(done / total))
            for n, well in ((missions, False), (healthy, True))
        ]
    return Campaign(course=course, seed=seed, faulty=tables[0], healthy=tables[1])


def _key(course: Course, seed: int, files: dict[str, str]) -> str:
    """Return what kept missions go by: they are of this vehicle, seed, C and code."""
    digest = hashlib.sha256(f"{course!r} {seed} {CHUNK} {sorted(files.items())!r}".encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _all(
    squadron: Squadron, course: Course, seed: int, count: int, healthy: bool, kept: Path | None,
    advance: Callable[[float], None],
) -> Array:  # fmt: skip
    """Return a row per mission [count, WIDTH]."""
    table = np.empty((count, WIDTH))
    firsts = iter(range(0, count, CHUNK))
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        waiting: dict[Future[Array], int] = {}
        try:
            while True:
                while len(waiting) < 2 * (os.cpu_count() or 1):
                    first = next(firsts, None)
                    if first is None:
                        break
                    future = pool.submit(
                        _chunk, squadron, course, seed, first, min(first + CHUNK, count), healthy,
                        kept,
                    )  # fmt: skip
                    waiting[future] = first
                if not waiting:
                    return table
                done, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    first = waiting.pop(future)
                    rows = future.result()
                    table[first : first + len(rows)] = rows
                    advance(len(rows))
        except BaseException:
            for future in waiting:
                future.cancel()
            raise


def _chunk(
    squadron: Squadron, course: Course, seed: int, first: int, end: int, healthy: bool,
    kept: Path | None,
) -> Array:  # fmt: skip
    """Return the rows of missions first to end, from disk where they are there."""
    name = f"{'healthy' if healthy else 'faulty'}-{first}-{end}.npy"
    if kept is not None and (kept / name).exists():
        rows: Array = np.load(kept / name)
        return rows
    rows = np.full((end - first, WIDTH), np.nan)
    for row, number in zip(rows, range(first, end), strict=True):
        mission = draw(course, seed=seed, number=number, healthy=healthy)
        c, harms = mission.condition, mission.harms.reshape(-1)
        row[: FACTS] = (
            number, mission.onset, c.start_depth, max(mission.depths), mission.plant[Z_BOTTOM],
            mission.plant[SUPPLY],
        )  # fmt: skip
        row[FACTS : FACTS + harms.size] = harms
        flown = [squadron.supervised(mission)] if healthy else squadron.flights(mission)
        for n, result in enumerate(flown):
            at = FACTS + HARMS + n * len(result)
            row[at : at + len(result)] = result
    if kept is not None:
        write_through(kept / name, lambda path: np.save(path, rows))
    return rows
