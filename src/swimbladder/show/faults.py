"""Fault missions as they are shown: the outcomes of each kind, and one mission over time."""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swimbladder.show import style
from swimbladder.show.parts import (
    Drawn,
    Part,
    Shown,
    Table,
    labelled,
)
from swimbladder.show.style import Ink
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


@style.styled
def draw_campaign(flown: FaultResult) -> Figure:
    """Return, for each kind of fault, the outcomes of its missions and the detection time."""
    lines = flown.lines()[:-1][::-1]
    size = (10.0, 0.28 * len(lines) + 1.6)
    figure, (fate, soon) = style.new_figure(size, 1, 2, sharey=True, width_ratios=(3.0, 2.0))
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
        fate.barh(rows, share, left=left, color=color, label=label, height=0.75)
        left += share
    fate.set_yticks(rows, [line.name for line in lines])
    fate.set(xlim=(0.0, 100.0), ylim=(-0.7, len(lines) - 0.3), xlabel="missions [%]")
    fate.grid(visible=False, axis="y")
    figure.legend(loc="outside lower center", ncols=2)
    for row, line in zip(rows, lines, strict=True):
        if not math.isnan(line.detection_time_median):
            low, high = max(line.detection_time_median, 0.1), max(line.detection_time_95, 0.1)
            soon.plot([low, high], [row, row], color=Ink.GREY, lw=1.5, zorder=1)
            soon.plot(low, row, "o", color=Ink.BLACK, ms=4.0)
            soon.plot(high, row, "|", color=Ink.BLACK, ms=9.0)
    soon.set_xscale("log")
    soon.axvline(60.0, color=Ink.ORANGE, lw=1.0, ls="--")
    style.plain_log_ticks(soon, "x")
    soon.set_xlabel("detection time [s]: median (dot),\n95 % (bar); dashed: 60 s")
    style.label_panels([fate, soon])
    vehicle = flown.course.vehicle
    law = "" if vehicle.controller is None else f", law {vehicle.controller.law}"
    title = f"{vehicle.name}{law}: {len(flown.faulty)} missions with faults"
    figure.suptitle(title, fontsize=10.5)
    return figure


@style.styled
def draw_mission(flown: Flown) -> Figure:
    """Return depth, volume, voltage and battery of a mission, and what the sensors said."""
    figure, (depth, volume, command, battery) = style.stacked((8.0, 9.0), 3.0, 2.0, 1.5, 1.0)
    seen, tick = {name: flown.rows[0][:, column] for name, column in TRACE.items()}, flown.tick
    time = tick * np.arange(len(flown.rows[0]))
    shown = _LONGER * max(tick * len(flown.rows[k]) for k in (0, -1))
    depth.plot(time, seen["depth_seen"], color=Ink.ORANGE, lw=0.8, zorder=3, label="sensor")
    for rows, (label, color, line) in [*zip(flown.rows, _FLOWN, strict=False)][::-1]:
        t = tick * np.arange(len(rows))
        label += f", to {t[-1]:.0f} s" if t[-1] > shown else ""
        depth.plot(t, rows[:, TRACE["depth"]], color=color, ls=line, label=label)
        volume.plot(t, 1e6 * rows[:, TRACE["volume"]], color=color, ls=line)
    _frame(volume, [1e6 * rows[:, TRACE["volume"]] for rows in flown.rows])
    volume.plot(time, 1e6 * seen["volume_seen"], color=Ink.ORANGE, lw=0.8, zorder=3)
    depth.plot(time, seen["reference"], color=Ink.BLACK, lw=0.8, ls="-.", label="set-point")
    deepest = max(float(np.nanmax(rows[:, TRACE["depth"]])) for rows in flown.rows)
    depth.set_ylim(1.15 * deepest + 1.0, -0.1 * deepest - 1.0)
    style.depth_axis(depth)
    unit = {"voltage": "V", "volume": "m³", "volume change": "s"}[flown.course.vehicle.command]
    command.plot(time, seen["command"], color=Ink.SKY, lw=0.8, label="commanded")
    command.plot(time, seen["applied"], color=Ink.BLACK, lw=0.8, label="at the actuator")
    battery.plot(time, seen["battery"], color=Ink.BLACK, lw=0.8)
    volume.set_ylabel("volume [cm³]")
    command.set_ylabel(f"command [{unit}]")
    battery.set(ylabel="battery [V]", xlabel="time [s]")
    longest = tick * max(len(rows) for rows in flown.rows)
    battery.set_xlim(-0.02 * min(shown, longest), min(shown, longest))
    for axes in (depth, volume, command, battery):
        for fault_row in flown.mission.fault_rows:
            axes.axvline(fault_row[3] * tick, color=Ink.VERMILION, lw=1.0, ls="--")
        if not math.isnan(flown.latched):
            axes.axvline(flown.latched, color=Ink.PURPLE, lw=1.2)
    style.legend_beside(figure, [depth, command], "outside lower center", ncols=3)
    took = "no fault detected"
    if flown.reason:
        took = f"purple: the supervisor took over ({flown.reason})"
    if flown.mission.faults:
        kinds = ", ".join(KINDS[fault].name for fault in flown.mission.faults)
        took = f"dashed red: onset of {kinds}; {took}"
    number = f"{'h' if flown.healthy else ''}{flown.mission.number}"
    depth.set_title(f"{flown.course.vehicle.name}, mission {number}\n{took}", fontsize=9.0)
    return figure


def _frame(axes: Axes, series: list[NDArray[np.float64]]) -> None:
    """Let an axis show what was, whatever a sensor that drifts says of it."""
    low = min(float(np.nanmin(x)) for x in series)
    high = max(float(np.nanmax(x)) for x in series)
    room = 0.1 * (high - low) + 1.0
    axes.set_ylim(low - room, high + room)


_NAMED = 20  # lost vehicles that are named; all are in the files


class FaultResultShown(Shown[FaultResult]):
    """What was flown, what it comes to, a row for each kind of fault.

    asked: how the vehicle was named.
    """

    name = "faults"

    def __init__(self, found: FaultResult, *, asked: str = "VEHICLE") -> None:
        super().__init__(found)
        self.asked = asked

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
        then = (
            "change the [supervisor] table (depth_limit, neutral_range, patience), or the mission"
        )
        return "\n".join([*parts, f"Look at one: {one}. Then {then}"])


def _seconds(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.0f}"


class FlownShown(Shown[Flown]):
    """One mission of a campaign, flown again with its trajectories."""

    def __init__(self, found: Flown) -> None:
        super().__init__(found)
        self.name = f"mission-{'h' if found.healthy else ''}{found.mission.number}"

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
