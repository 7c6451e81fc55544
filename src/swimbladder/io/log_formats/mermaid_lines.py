"""The lines of a MERMAID float's log: their times, and which of these to believe."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

# the part may be left out before a setting, which is indented then
_LINE = re.compile(
    r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d|\d{9,10}):"
    r"(?:(?:<\w+>)?\[(\w+) *, *\d+\]|(?= {4}\w))(.*)"
)
_LONGEST = 3.0 * 86400.0  # s, between two lines; more is a clock that was wrong
_CORRECTED = 1.0  # s, by which a line may go back


class Line(NamedTuple):
    """A line that begins with a time."""

    number: int  # in the file, from 1
    stamp: float  # s since 1970; NaN where there is no such time
    part: str  # of the float; "" where the line names none
    text: str


def lines_of(text: str) -> list[Line]:
    """Return the lines of a text that begin with a time."""
    return [
        Line(number, _stamp(match[1]), match[2] or "", match[3])
        for number, line in enumerate(text.splitlines(), start=1)
        if (match := _LINE.match(line))
    ]


def in_order(lines: Sequence[Line]) -> tuple[list[Line], list[Line]]:
    """Return the lines to believe, times that never go back, and the others.

    Those are the most that do not go back in time, without long gaps. A line whose time is a
    misprint would else take all after it along, and a clock that began in 1970 all that was logged
    once it was set.
    """
    stamps = [line.stamp for line in lines]
    for k in range(1, len(stamps)):
        if 0.0 < stamps[k - 1] - stamps[k] <= _CORRECTED:
            stamps[k] = stamps[k - 1]  # a clock that is put right loses no line
    ordered = set(_longest_run(stamps))
    kept = [line._replace(stamp=stamps[k]) for k, line in enumerate(lines) if k in ordered]
    return kept, [line for k, line in enumerate(lines) if k not in ordered]


def written(stamp: float | None) -> str:
    """Return a time [s since 1970] in ISO 8601; "" where there is none."""
    if stamp is None:
        return ""
    return datetime.fromtimestamp(stamp, UTC).replace(tzinfo=None).isoformat()


def _stamp(text: str) -> float:
    if text.isdigit():
        return float(text)
    try:
        return datetime.fromisoformat(text + "+00:00").timestamp()
    except ValueError:
        return np.nan


def _longest_run(stamps: Sequence[float]) -> list[int]:
    tails: list[float] = []  # of the best runs of each length, the time they end at
    ends: list[int] = []
    before: dict[int, int | None] = {}
    for k, stamp in enumerate(stamps):
        if np.isnan(stamp):
            continue
        at = bisect_right(tails, stamp)
        before[k] = ends[at - 1] if at else None
        tails[at : at + 1], ends[at : at + 1] = [stamp], [k]
    kept: list[int] = []
    last: int | None = ends[-1] if ends else None
    while last is not None:
        kept.append(last)
        last = before[last]
    kept.reverse()
    runs: list[list[int]] = [[]]
    for k in kept:
        if runs[-1] and stamps[k] - stamps[runs[-1][-1]] > _LONGEST:
            runs.append([])
        runs[-1].append(k)
    return max(runs, key=len)
