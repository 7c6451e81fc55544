"""Missions as CSV: a row for each, and a row per tick of one that is flown again."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.faults.campaign_result import Campaign, Outcome
from swimbladder.sim.faults.kinds import KINDS, Fault
from swimbladder.sim.faults.mission_records import Trace

MISSION_COLUMNS = (
    "mission", "fault_1", "severity_1", "onset_1_s", "end_1_s", "fault_2", "severity_2",
    "onset_2_s", "end_2_s", "start_depth_m", "deepest_setpoint_m", "bottom_m", "supply_V",
    "recoverable", "supervised", "reason", "latched_s", "release_s", "deepest_m", "resets",
    "unsupervised", "unsupervised_deepest_m",
)  # fmt: skip
TRACE_COLUMNS = (
    "time_s", "depth_m", "speed_m_s", "volume_m3", "command", "applied", "battery_V",
    "reference_depth_m", "depth_seen_m", "depth_age_s", "volume_seen_m3", "leak_seen",
    "lost_ticks", "board", "reason", "water_m3",
)  # fmt: skip
assert len(TRACE_COLUMNS) == 1 + len(Trace._fields)


def missions_csv(flown: Campaign) -> str:
    """Return a row for each mission with faults; times in s from its start."""
    tick = flown.tick
    supervised, unsupervised = flown.outcome(0), flown.outcome(1)
    facts = flown.faulty
    latched, released = flown.result(0, "latched") * tick, flown.result(0, "released") * tick
    deepest, resets = flown.result(0, "deepest"), flown.result(0, "resets")
    without = flown.result(1, "deepest")
    fault_rows = [
        [flown.fault_row(which, field) for field in ("kind", "first", "begin", "end")]
        for which in (0, 1)
    ]
    lines = [",".join(MISSION_COLUMNS)]
    for n in range(len(facts)):
        cells: list[str] = [str(n)]
        for kind, first, begin, end in fault_rows:
            code = int(kind[n])
            if not code:
                cells += ["", "", "", ""]
                continue
            known = KINDS[Fault(code)]
            cells += [
                known.name, "" if known.first is None else f"{first[n]:.6g}",
                f"{begin[n] * tick:.6g}", _number(end[n] * tick),
            ]  # fmt: skip
        cells += [_number(x) for x in facts[n, 2:6]]
        cells += [
            str(int(flown.recoverable[n])), Outcome(int(supervised[n])).words, flown.reason(n),
            _number(latched[n]), _number(released[n]), _number(deepest[n]), str(int(resets[n])),
            Outcome(int(unsupervised[n])).words, _number(without[n]),
        ]  # fmt: skip
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def trace_csv(rows: NDArray[np.float64], tick: float) -> str:
    """Return a row per tick [n, len(Trace)] of one mission."""
    lines = [",".join(TRACE_COLUMNS)]
    for k, row in enumerate(rows):
        lines.append(",".join(_cells((k * tick, *row))))
    return "\n".join(lines) + "\n"


def _cells(values: Iterable[float]) -> list[str]:
    return [repr(float(value)) if math.isfinite(value) else "nan" for value in values]


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "nan"
