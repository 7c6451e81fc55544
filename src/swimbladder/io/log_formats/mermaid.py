"""The text logs of floats of the MERMAID kind: one line an event, a time before each.

::

    2020-06-25T11:23:12:[PRESS ,0038]P +35463mbar,T+14277mdegC
    2020-06-25T11:23:36:[BUOY  ,0087]from +5mbar/s to +2mbar/s
    2020-06-25T11:23:37:[BUOY  ,0089]need to transfer +34mL (pump during 40924ms)
    2020-06-25T11:23:45:[PUMP  ,0016]pump during 40924ms
    2020-06-25T11:24:25:[PUMP  ,0212]battery 13633mV,  601216uA (steady state), P +35593mbar

Read off logs of firmware V2.12 to V2.20 (2020), older and newer wordings of pump and valve alike,
and of 2018, which count seconds since 1970 and say less::

    1584257299:[PRESS , 81]P +62330mbar,T-10612mdegC
    1584257973:[VALVE ,129]opening for 1008ms

Lines of other parts of the float (positions apart) are left out; what is wrong in those that are
read is reported.

Some of the times are wrong: which to believe is decided over all lines.
"""

import re
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swimbladder.errors import LogError
from swimbladder.io.float_log import Action, Device, FloatLog, Reading, Stage, Target
from swimbladder.io.log_text import counted, read_bytes

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


_DEGREES = r"(\d+)deg([\d.]+)mn"
_POSITION = re.compile(rf"(?:Latitude : *)?([NS]){_DEGREES}, *(?:Longitude : *)?([EW]){_DEGREES}")
_SETTING = re.compile(r" *(\w+) (\d.*?)(?: \(.*)?$")
_HIGHEST = 2.5e7  # Pa; a higher pressure crushes such a float and is a misprint
_COLDEST = -5.0  # degC; no sea is colder, and floats without the sensor log such a number
_FULL = 32.767  # degC, the largest that the number of a temperature holds
_TICK = 0.01  # s; what is left of a run that was broken off is counted in them


def is_mermaid(data: bytes) -> bool:
    """Return whether bytes are such a log: one of its first lines has a time and a known part."""
    known = ("MAIN", "SURF", "PRESS", "STAGE", "BUOY", "PUMP", "DIVING")
    first = data[:4000].decode("latin-1").splitlines()[:20]
    return any(line.part in known for line in lines_of("\n".join(first)))


def read_mermaid(path: str | Path) -> FloatLog:
    """Return the log of one dive; raises LogError where there is none in the file."""
    reader = _Reader()
    lines, others = in_order(lines_of(read_bytes(path).decode("latin-1")))
    for line in others:
        reader.odd("out of order in time left out", line.number)
    for line in lines:
        reader.line(line.number, line.stamp, line.part, line.text)
    if not reader.pressures:
        more = f"; {counted(len(others), 'line')} out of order in time left out" if others else ""
        what = f"no line with a pressure{more}"
        remedy = "Give a log of a dive; for other logs leave out `log_format='mermaid'`"
        raise LogError(what, file=path, field="[PRESS ,0038]", remedy=remedy)
    return reader.log(str(path))


def _pressure(text: str) -> float:
    """Return the pressure that a text ends in [Pa], NaN where it has none."""
    found = re.search(r"P *([+-] *\d+)mbar", text)
    return float(found[1].replace(" ", "")) * 100.0 if found else np.nan


class _Reader:
    """The state of the float by its lines."""

    def __init__(self) -> None:
        self.first: float | None = None
        self.now = 0.0
        self.pressures: list[tuple[float, float, float, int]] = []
        self.actions: list[Action] = []
        self.known: dict[str, Any] = {}
        self.settings: dict[str, str] = {}
        self.stages: dict[int, Stage] = {}
        self.stage = -2
        self.speeds: tuple[float, float] | None = None
        self.target: Target | None = None
        self.before: Reading | None = None
        self.cut = False  # whether the last action is known to have ended before its time
        self.colder = 0  # samples without a temperature that a sea has
        self.oddities: dict[str, list[int]] = {}

    def line(self, number: int, stamp: float, part: str, text: str) -> None:
        """Take a line's news; stamp: its time [s], since 1970, never before that of the last."""
        if self.first is None:
            self.first = stamp
        self.now = stamp - self.first
        reader = _PARTS.get(part)
        if reader is not None and reader(self, text.rstrip()) is False:
            self.odd(f"of {part} with numbers that cannot be", number)

    def odd(self, what: str, number: int) -> None:
        """Remember that a line was not used."""
        self.oddities.setdefault(what, []).append(number)

    def sample(self, text: str) -> bool:
        found = re.match(r"P *([+-] *\d+)mbar(?:,T *([+-] *\d+)mdegC)?", text)
        if not found:
            return True
        pressure, temperature = (float(x.replace(" ", "")) if x else np.nan for x in found.groups())
        if abs(pressure) * 100.0 > _HIGHEST:
            return False
        warmth = temperature / 1000.0
        if not _COLDEST < warmth < _FULL:
            warmth = np.nan
            self.colder += 1
        self.pressures.append((self.now, pressure * 100.0, warmth, self.stage))
        return True

    def decided(self, text: str) -> bool:
        if found := re.match(r"from ([+-]\d+)mbar/s to ([+-]\d+)mbar/s", text):
            a, b = (float(x) * 100.0 for x in found.groups())
            self.speeds = (a, b)
            return max(abs(a), abs(b)) < 1e5
        if found := re.match(r"need to transfer ([+-]\d+)mL \((\w+) during (\d+)ms\)", text):
            a, b = self.speeds or (np.nan, np.nan)
            change, seconds = float(found[1]) * 1e-6, float(found[3]) / 1000.0
            self.target = Target(
                time=self.now, speed_from=a, speed_to=b, change=change, seconds=seconds
            )
            self.speeds = None
        return True

    def begun(self, device: Device, milliseconds: str) -> None:
        target = self.target if self.target and self.now - self.target.time < 30.0 else None
        asked, stage = float(milliseconds) / 1000.0, None if self.stage == -2 else self.stage
        action = Action(device=device, time=self.now, asked=asked, seconds=asked)
        self.actions.append(replace(action, before=self.before, target=target, stage=stage))
        self.target = self.before = None
        self.cut = False

    def changed(self, **facts: Any) -> None:
        self.actions[-1] = replace(self.actions[-1], **facts)

    def ended(self, until: float) -> None:
        last = self.actions[-1]
        self.changed(seconds=min(last.asked, until - last.time))
        self.cut = True

    def worked(self, text: str, *, device: Device) -> bool:
        if found := re.match(r"(?:(?:pump )?during|(?:\w+ )?opening(?: for)?) (\d+)ms", text):
            self.begun(device, found[1])
        elif (found := re.match(r"aborted, (\d+)ticks remain", text)) and self.actions:
            last, left = self.actions[-1], _TICK * float(found[1])
            self.ended(last.time + max(last.asked - left, 0.0))
            return left <= last.asked
        elif found := re.search(r"(\d+)mV[,/] *(\d+)uA", text):
            volts, amps = float(found[1]) / 1e3, float(found[2]) / 1e6
            reading = Reading(time=self.now, voltage=volts, current=amps)
            if "warmup" in text:
                self.before = reading
            elif self.actions and "opening" in text:
                self.changed(before=reading)
            elif self.actions:
                self.changed(after=reading, pressure=_pressure(text))
        return True

    def surfaced(self, text: str) -> None:
        last = self.actions[-1] if self.actions else None
        if "bladder full" in text and last and last.device == "pump" and not self.cut:
            self.ended(self.now)

    def staged(self, text: str) -> None:
        if found := re.match(r"[Ss]tage ?\[(\d+)\] (\d+)mbar \(\+/-(\d+)mbar\) (\d+)s", text):
            n, pressure, tolerance, seconds = (int(x) for x in found.groups())
        elif found := re.match(r"[Ss]tage ?\[(\d+)\] surfacing (\d+)s", text):
            n, pressure, tolerance, seconds = int(found[1]), 0, 0, int(found[2])
        else:
            return
        self.stages[n] = Stage(
            number=n, pressure=pressure * 100.0, tolerance=tolerance * 100.0, duration=seconds
        )

    def went(self, text: str) -> None:
        if found := re.match(r"stage\[(\d+)\]$", text):
            self.stage = int(found[1])
        elif found := re.match(r"(surfacing|surface)\b", text):
            self.stage = -2
        elif found := re.match(r"(?:buoy|board) (\S+)", text):
            self.known["name"] = found[1]
        elif found := re.match(r"soft (?:pilotage )?(\S+)", text):
            self.known["firmware"] = found[1]
        elif found := re.match(r"(?:internal pressure|Pint) (\d+)Pa", text):
            self.known["internal_pressure"] = float(found[1])
        elif found := re.match(r"Vbat (\d+)mV \(min (\d+)mV\)", text):
            self.known["battery_voltage"] = float(found[1]) / 1e3
            self.known["battery_least"] = float(found[2]) / 1e3

    def dived(self, text: str) -> None:
        if text.startswith("diving from"):
            self.stage = -1

    def set(self, text: str) -> None:
        if text.lstrip().startswith("stage["):
            self.staged(text.lstrip())
        elif found := _SETTING.match(text):
            self.settings[found[1]] = found[2]

    def placed(self, text: str) -> None:
        if found := _POSITION.match(text):
            ns, a, b, ew, c, d = found.groups()
            latitude = (float(a) + float(b) / 60.0) * (1.0 if ns == "N" else -1.0)
            longitude = (float(c) + float(d) / 60.0) * (1.0 if ew == "E" else -1.0)
            self.known["position"] = latitude, longitude

    def log(self, source: str) -> FloatLog:
        """Return what the lines hold."""
        time, pressure, temperature, stage = zip(*self.pressures, strict=True)
        said = [
            f"{counted(len(lines), 'line')} {what}, the first in line {lines[0]}"
            for what, lines in self.oddities.items()
        ]
        if self.colder:
            said.append(f"{counted(self.colder, 'sample')} without a temperature that a sea has")
        return FloatLog(
            source=source,
            start=written(self.first),
            time=np.array(time),
            pressure=np.array(pressure),
            temperature=np.array(temperature),
            stage=np.array(stage, dtype=np.int64),
            actions=tuple(self.actions),
            stages=tuple(self.stages[n] for n in sorted(self.stages)),
            settings=self.settings,
            report=tuple(said),
            **self.known,
        )


# What takes the lines of a part; it returns False for one whose numbers cannot be.
_PARTS: dict[str, Callable[[_Reader, str], bool | None]] = {
    "PRESS": _Reader.sample,
    "BUOY": _Reader.decided,
    "PUMP": partial(_Reader.worked, device="pump"),
    "VALVE": partial(_Reader.worked, device="valve"),
    "BYPASS": partial(_Reader.worked, device="bypass"),
    "SURFIN": _Reader.surfaced,
    "STAGE": _Reader.staged,
    "MAIN": _Reader.went,
    "DIVING": _Reader.dived,
    "BYCMD": _Reader.set,
    "": _Reader.set,
    "SURF": _Reader.placed,
}
