"""A campaign: all missions of a seed in chunks, on all cores, kept on disk until it is done."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.registry import own_law
from swimbladder.errors import InputError
from swimbladder.jobs import Store, each
from swimbladder.physics.seawater import Column
from swimbladder.sim.engine.modes import SUPPLY, Z_BOTTOM
from swimbladder.sim.faults.c_interface import IDEAL, SUPERVISED, UNSUPERVISED
from swimbladder.sim.faults.campaign_result import FACTS, FAULT_COLUMNS, WIDTH, Campaign
from swimbladder.sim.faults.draw import Course, course_of, draw
from swimbladder.sim.faults.fault_campaign import FaultCampaign, sources
from swimbladder.sim.faults.host import Board
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

CHUNK = 200


def board_of(course: Course) -> Board:
    """Return the vehicle's C, compiled for this machine; raises InputError without a compiler."""
    return Board(sources(course), (UNSUPERVISED, SUPERVISED, IDEAL))


def run_missions(
    vehicle: Vehicle, *, missions: int = 100_000, healthy: int | None = None, seed: int = 1,
    depths: tuple[float, float] | None = None, column: Column | None = None,
    keep: Path | None = None, advance: Callable[[float], None] = lambda _: None,
) -> Campaign:  # fmt: skip
    """Fly missions with faults, and `healthy` ones without (a tenth as many); return what happened.

    depths [m]: least and greatest. column: the water, the vehicle's own where not given. keep: a
    folder for what is done, so that a run that was killed
    goes on there. advance: called with the share of the work that was done.
    Raises InputError for a vehicle without a controller, for depths that it cannot hold, for water
    that ends above them, and where there is no C compiler.
    """
    own_law(vehicle)
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
    course = course_of(vehicle, depths, column)
    files = sources(course)
    with Board(files, (UNSUPERVISED, SUPERVISED, IDEAL)) as board:
        kept = Store(keep, course, seed, files)
        campaign = FaultCampaign(course, board)
        total = missions + healthy
        tables = [
            _all(campaign, course, seed, n, well, kept, lambda done: advance(done / total))
            for n, well in ((missions, False), (healthy, True))
        ]
    return Campaign(course=course, seed=seed, faulty=tables[0], healthy=tables[1])


def _all(
    campaign: FaultCampaign, course: Course, seed: int, count: int, healthy: bool, kept: Store,
    advance: Callable[[float], None],
) -> Array:  # fmt: skip
    """Return a row per mission [count, WIDTH]."""
    table = np.empty((count, WIDTH))

    def chunk(first: int) -> Array:
        end = min(first + CHUNK, count)
        fly = partial(_rows, campaign, course, seed, first, end, healthy)
        return kept.get(fly, "healthy" if healthy else "faulty", first, end)

    for first, rows in each(chunk, range(0, count, CHUNK)):
        table[first : first + len(rows)] = rows
        advance(len(rows))
    return table


def _rows(
    campaign: FaultCampaign, course: Course, seed: int, first: int, end: int, healthy: bool
) -> Array:
    """Return the rows of missions first to end, flown."""
    rows = np.full((end - first, WIDTH), np.nan)
    for row, number in zip(rows, range(first, end), strict=True):
        mission = draw(course, seed=seed, number=number, healthy=healthy)
        c, fault_rows = mission.condition, mission.fault_rows.reshape(-1)
        row[: FACTS] = (
            number, mission.onset, c.start_depth, max(mission.depths), mission.plant[Z_BOTTOM],
            mission.plant[SUPPLY],
        )  # fmt: skip
        row[FACTS : FACTS + fault_rows.size] = fault_rows
        flown = [campaign.supervised(mission)] if healthy else campaign.flights(mission)
        for n, result in enumerate(flown):
            at = FACTS + FAULT_COLUMNS + n * len(result)
            row[at : at + len(result)] = result
    return rows
