"""Fault missions as they are shown: the outcomes of each kind, and one mission over time."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from swimbladder.show.parts import Drawn, Part, Shown, Table, labelled
from swimbladder.show.picture import Ink, Picture, grid_of, stacked
from swimbladder.sim.faults import FaultResult
from swimbladder.sim.faults.draw import TRACE
from swimbladder.sim.faults.kinds import KINDS
from swimbladder.sim.faults.run import NAMES, Flown, missions_csv, trace_csv

_FLOWN = (  # label, colour, line
    ("supervised", Ink.BLUE, "-"),
    ("without the supervisor", Ink.GREY, "--"),
    ("full buoyancy 60 s after fault onset", Ink.GREEN, ":"),
)
_LONGER = 1.3  # of the supervised flight and that with ideal detection: the rest is cut


def draw_campaign(flown: FaultResult) -> Picture:
    """Return, for each kind of fault, the outcomes of its missions and the detection time."""
    lines = flown.lines()[:-1][::-1]
    how: Any = {"sharey": "all", "widths": (3.0, 2.0), "letters": True, "legend": "below"}
    picture, (fate, soon) = grid_of((10.0, 0.28 * len(lines) + 1.6), 2, 2, across=2, **how)
    rows = np.arange(len(lines))
    names = "missions recoverable recovered recovered_by_supervisor unrecoverable_surfaced"
    counted = [[getattr(line, name) for name in names.split()] for line in lines]
    missions, able, safe, by_supervisor, surfaced = np.transpose(counted)
    left = np.zeros(len(lines))
    for label, counts, color in (
        ("recovered, and not lost without the supervisor", safe - by_supervisor, Ink.SKY),
        ("recovered by the supervisor", by_supervisor, Ink.BLUE),
        ("recoverable, and lost", able - safe, Ink.VERMILION),
        ("not recoverable, surfaced all the same", surfaced, "#A8D8C8"),
        ("not recoverable", missions - able - surfaced, "#BDBDBD"),
    ):
        share = 100.0 * counts / missions
        fate.bars(rows, share, color, label, base=left.copy(), thick=0.75, flat=True)
        left += share
    fate.yticks = {row: line.name for row, line in enumerate(lines)}
    fate.xlim, fate.ylim, fate.x = (0.0, 100.0), (-0.7, len(lines) - 0.3), "missions [%]"
    fate.grid = "x"
    for row, line in enumerate(lines):
        if not math.isnan(line.detection_time_median):
            low, high = max(line.detection_time_median, 0.1), max(line.detection_time_95, 0.1)
            soon.line([low, high], [row, row], Ink.GREY, layer=1.0)
            soon.dots(low, row, "o", Ink.BLACK, size=4.0)
            soon.dots(high, row, "|", Ink.BLACK, size=9.0)
    soon.rule("x", 60.0, Ink.ORANGE, width=1.0, dash="--")
    soon.xlog, soon.x = True, "detection time [s]: median (dot),\n95 % (bar); dashed: 60 s"
    vehicle = flown.course.vehicle
    law = "" if vehicle.controller is None else f", law {vehicle.controller.law}"
    picture.title = f"{vehicle.name}{law}: {len(flown.faulty)} missions with faults"
    return picture


def draw_mission(flown: Flown) -> Picture:
    """Return depth, volume, voltage and battery of a mission, and what the sensors said."""
    how: Any = {"legend": "below", "across": 3}
    picture, panels = stacked((8.0, 9.0), 3.0, 2.0, 1.5, 1.0, **how)
    depth, volume, command, battery = panels
    seen, tick = {name: flown.rows[0][:, column] for name, column in TRACE.items()}, flown.tick
    time = tick * np.arange(len(flown.rows[0]))
    shown = _LONGER * max(tick * len(flown.rows[k]) for k in (0, -1))
    depth.line(time, seen["depth_seen"], Ink.ORANGE, "sensor", width=0.8, layer=3.0)
    for rows, (label, color, line) in [*zip(flown.rows, _FLOWN, strict=False)][::-1]:
        t = tick * np.arange(len(rows))
        label += f", to {t[-1]:.0f} s" if t[-1] > shown else ""
        depth.line(t, rows[:, TRACE["depth"]], color, label, dash=line)
        volume.line(t, 1e6 * rows[:, TRACE["volume"]], color, dash=line)
    # what was, whatever a sensor that drifts says of it
    low, high = volume.limits("y")
    volume.ylim = (low - 1.0, high + 1.0)
    volume.line(time, 1e6 * seen["volume_seen"], Ink.ORANGE, width=0.8, layer=3.0)
    depth.line(time, seen["reference"], Ink.BLACK, "set-point", width=0.8, dash="-.")
    deepest = max(float(np.nanmax(rows[:, TRACE["depth"]])) for rows in flown.rows)
    depth.ylim = (-0.1 * deepest - 1.0, 1.15 * deepest + 1.0)
    unit = {"voltage": "V", "volume": "m³", "volume change": "s"}[flown.course.vehicle.command]
    command.line(time, seen["command"], Ink.SKY, "commanded", width=0.8)
    command.line(time, seen["applied"], Ink.BLACK, "at the actuator", width=0.8)
    battery.line(time, seen["battery"], Ink.BLACK, width=0.8)
    depth.y, volume.y, command.y = "depth [m]", "volume [cm³]", f"command [{unit}]"
    battery.y, battery.x = "battery [V]", "time [s]"
    longest = tick * max(len(rows) for rows in flown.rows)
    battery.xlim = (-0.02 * min(shown, longest), min(shown, longest))
    for panel in panels:
        for fault_row in flown.mission.fault_rows:
            panel.rule("x", fault_row[3] * tick, Ink.VERMILION, width=1.0, dash="--")
        if not math.isnan(flown.latched):
            panel.rule("x", flown.latched, Ink.PURPLE, width=1.2)
    took = "no fault detected"
    if flown.reason:
        took = f"purple: the supervisor took over ({flown.reason})"
    if flown.mission.faults:
        kinds = ", ".join(KINDS[fault].name for fault in flown.mission.faults)
        took = f"dashed red: onset of {kinds}; {took}"
    number = f"{'h' if flown.healthy else ''}{flown.mission.number}"
    depth.title = f"{flown.course.vehicle.name}, mission {number}\n{took}"
    return picture


_NAMED = 20  # lost vehicles that are named; all are in the files


class FaultResultShown(Shown[FaultResult]):
    """What was flown, what it comes to, a row for each kind of fault.

    asked: how the vehicle was named.
    """

    name = "faults"
    asked: str = "VEHICLE"

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        yield from self.found.sentences
        rows = []
        for line in self.found.lines():
            counts = [line.missions, line.recoverable, line.recovered]
            counts += [line.recoverable - line.recovered, line.lost_without_supervisor]
            times = map(_seconds, (line.detection_time_median, line.detection_time_95))
            rows.append((line.name, *map(str, counts), *times, f"{line.deepest:.1f}"))
        headings = ("fault", "missions", "recoverable", "recovered", "lost")
        more = ("lost without\nsupervisor", "detection\ntime [s]", "95 %\n[s]", "deepest\n[m]")
        yield Table((*headings, *more), rows)
        yield Drawn("faults", partial(draw_campaign, self.found))
        column = self.found.course.column
        yield from labelled("cast", () if column is None else column.report)

    def table(self) -> str:
        """Return missions.csv: a row for each."""
        return missions_csv(self.found)

    def files(self) -> dict[str, object]:
        """Return missions.csv."""
        return {"missions.csv": self.table()}

    @property
    def error(self) -> str:
        """What is wrong and what to do, the missions by number."""
        found, parts = self.found, list[str]()
        lost, alarms = found.lost, found.false_alarms
        if len(lost):
            able = int(found.recoverable.sum())
            parts.append(f"{len(lost)} of {able} recoverable missions were lost:")
            parts += [f"  {found.description(int(n))}" for n in lost[:_NAMED]]
            if len(lost) > _NAMED:
                parts.append(f"  and {len(lost) - _NAMED} more: supervised in missions.csv")
        if len(alarms):
            shown = ", ".join(f"h{n}" for n in alarms[:_NAMED])
            parts.append(f"{len(alarms)} healthy missions raised an alarm: {shown}")
        again = f"{lost[0]}" if len(lost) else f"h{alarms[0]}"
        one = f"swimbladder faults {self.asked} --seed {found.seed} --repeat {again}"
        table = "[supervisor] table (time_limit, depth_limit, neutral_range, patience)"
        return "\n".join([*parts, f"Look at one: {one}. Then change the {table}, or the mission"])


def _seconds(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.0f}"


class FlownShown(Shown[Flown]):
    """One mission of a campaign, flown again with its trajectories."""

    def __post_init__(self) -> None:
        self.name = f"mission-{'h' if self.found.healthy else ''}{self.found.mission.number}"

    @property
    def title(self) -> str:
        """The vehicle, and which mission."""
        mission = self.name.replace("-", " ", 1)
        return f"{self.found.course.vehicle.name}: {mission} of the fault campaign"

    def parts(self) -> Iterator[Part]:
        """Give what happened."""
        yield from self.found.lines()
        yield Drawn(self.name, partial(draw_mission, self.found))

    def files(self) -> dict[str, object]:
        """Return the trajectories."""
        traces = zip(NAMES, self.found.rows, strict=False)
        return {f"{self.name}-{name}.csv": trace_csv(x, self.found.tick) for name, x in traces}
