"""All floats of a campaign on all cores, chunk by chunk, kept on disk until it is done."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.io.mission import Mission
from swimbladder.jobs import Store, each
from swimbladder.physics.seawater import Column
from swimbladder.sim.campaign.draw import Drawn, Spread, draw, varied
from swimbladder.sim.mission.core import kernel
from swimbladder.sim.mission.core.names import Account, At, Cycle, Drive, Now, Row
from swimbladder.sim.mission.prepare import Plan, first_state, make_plan
from swimbladder.sim.mission.reach import check_flight, check_reach
from swimbladder.vehicle import Vehicle

__all__ = ["Fact", "fly_floats"]

Array = NDArray[np.float64]
CHUNK = 50
MOST = 1_000_000


class Fact(IntEnum):
    """Columns of the table of floats; what was drawn stands in the first ones."""

    STOP = int(Drawn.COUNT)
    CYCLES = 6
    MISSED = 7  # phases that ran out of time, or did not hold
    ARRIVAL = 8  # s, mean over the cycles that arrived at the first phase's depth; nan: none did
    DEEPEST = 9  # m
    DURATION = 10  # s
    DRIVE = 11  # J, of pump, valve and holding
    DRAWN = 12  # J from the battery
    PUMP_RUNS = 13
    LEFT = 14  # J in the battery
    COUNT = 15


def fly_floats(
    vehicle: Vehicle, mission: Mission, columns: Sequence[Column], *, floats: int, seed: int = 1,
    spread: Spread | None = None, cycles: int | None = None, span: float | None = None,
    keep: Path | None = None, advance: Callable[[float], None] = lambda _: None,
) -> Array:  # fmt: skip
    """Return a row for each float [floats, Fact.COUNT].

    columns: the waters that floats are drawn into. cycles, span [s]: in the place of the mission's.
    keep: a folder for what is done, so that a campaign that was killed goes on there. advance:
    called with the share that was done. Raises InputError for a number of floats out of range, and
    what `fly_mission` raises in each of the waters.
    """
    if not 1 <= floats <= MOST:
        raise InputError(
            "must be a whole number from 1 to a million", field="--floats", value=floats,
            remedy="Give --floats 4000",
        )  # fmt: skip
    spread = spread or Spread()
    plans = []
    for column in columns:
        check_flight(vehicle, mission, column, cycles=cycles, span=span)
        plans.append(make_plan(vehicle, mission, column, cycles=cycles, span=span))
        check_reach(vehicle, mission, plans[-1])
    kept = Store(keep, seed, spread, [(p.given, p.table, p.waves, p.stages) for p in plans])
    table = np.empty((floats, int(Fact.COUNT)))

    def chunk(first: int) -> Array:
        end = min(first + CHUNK, floats)

        def rows() -> Array:
            return np.stack([_one(plans, mission, spread, seed, n) for n in range(first, end)])

        return kept.get(rows, "floats", first, end)

    for first, rows in each(chunk, range(0, floats, CHUNK)):
        table[first : first + len(rows)] = rows
        advance(len(rows) / floats)
    return table


def _one(plans: Sequence[Plan], mission: Mission, spread: Spread, seed: int, number: int) -> Array:
    """Fly one float and return its row; only sums are kept."""
    drawn = draw(spread, seed=seed, number=number, casts=len(plans))
    plan = varied(plans[int(drawn[Drawn.CAST])], drawn)
    x, at, accounts = first_state(plan, mission, seed=seed * MOST + number)
    nothing = np.zeros((0, int(Row.COUNT))), np.zeros((0, int(Drive.COUNT)))
    cycle = np.zeros((1, int(Cycle.ACCOUNTS) + int(Account.COUNT)))
    counts, work = np.zeros(3, dtype=np.int64), np.zeros((6, 8))
    missed, deepest, arrivals, arrived = 0, 0.0, 0.0, 0
    while at[At.STOP] == 0:
        counts[:] = 0
        kernel.fly_kernel(
            plan.given, plan.table, plan.waves, plan.stages, x, at, accounts, *nothing, cycle,
            counts, work,
        )  # fmt: skip
        if counts[2]:
            late = int(cycle[0, Cycle.MISSED]) | int(cycle[0, Cycle.NOT_HELD])
            missed += late.bit_count()
            deepest = max(deepest, float(cycle[0, Cycle.DEEPEST]))
            if not math.isnan(cycle[0, Cycle.ARRIVAL]):
                arrivals, arrived = arrivals + float(cycle[0, Cycle.ARRIVAL]), arrived + 1
    drive = sum(
        float(accounts[a])
        for a in (Account.PUMP_ENERGY, Account.VALVE_ENERGY, Account.HOLDING_ENERGY)
    )
    rest = sum(
        float(accounts[a])
        for a in (Account.LOAD_ENERGY, Account.SURFACING_ENERGY, Account.SELF_DISCHARGED)
    )
    return np.array(
        [
            *drawn, float(at[At.STOP]), float(at[At.CYCLE]), missed,
            arrivals / arrived if arrived else math.nan, deepest, x[Now.T], drive, drive + rest,
            accounts[Account.PUMP_RUNS], x[Now.CHARGE],
        ]
    )  # fmt: skip
