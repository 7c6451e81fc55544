"""How many cycles one battery lasts: flown to its end, or computed from the first cycles."""

from collections.abc import Iterable

import numpy as np

from swimbladder.io.mission import Mission
from swimbladder.physics.battery import lasting_cycles
from swimbladder.sim.engine.rodas.records import OF_DRIVE, OF_LOADS, Account, Stop
from swimbladder.sim.mission.prepare import Plan

_DRAWN = [*OF_DRIVE, *OF_LOADS]


def battery_life(
    plan: Plan, mission: Mission, cycles: Iterable[np.void], *, stop: Stop, whole: int
) -> int | None:
    """Return the cycles that a full battery lasts; None: not known.

    cycles: the records of those flown, the first `whole` of which were not broken off. Where the
    flight came to the battery's reserve or end these are the answer. Else further cycles draw the
    mean of those flown, less a first one that begins below the surface or with a warm hull, and
    self-discharge goes with the charge that is left.
    """
    if stop in (Stop.RESERVE, Stop.BATTERY_EMPTY):
        return whole
    g = plan.given
    full, reserve = float(g["charge"]), float(g["reserve"])
    if plan.energy_known or whole == 0 or not np.isfinite(reserve) or full <= reserve:
        return None
    flown = [row for row, _ in zip(cycles, range(whole), strict=False)]
    accounts = np.array([row["accounts"] for row in flown])
    drawn = np.diff(accounts[:, _DRAWN].sum(axis=1), prepend=0.0)
    duration = np.array([row["t_end"] - row["t_begin"] for row in flown])
    elsewhere = mission.start_depth > 0.0 or mission.start_temperature is not None
    alike = slice(int(elsewhere and whole > 1), None)
    further = lasting_cycles(
        full - float(accounts[-1, [*_DRAWN, Account.SELF_DISCHARGED]].sum()),
        reserve=reserve,
        empty=float(g["empty"]),
        energy=float(np.mean(drawn[alike])),
        duration=float(np.mean(duration[alike])),
        self_discharge=float(g["self_discharge"]),
    )
    return None if further is None else whole + further
