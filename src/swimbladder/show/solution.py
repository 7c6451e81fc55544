"""A simulation as it is shown: depth, volume, and what the motor gets."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from swimbladder.io.mission import Mission
from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater import Column
from swimbladder.show.parts import Drawn, Labelled, Part, Shown, Table, labelled
from swimbladder.show.picture import Ink, Panel, Picture, grid_of
from swimbladder.sim.closed_loop import Solution, StepMetrics, step_metrics

_SETTLED = 0.02  # of a step, as step_metrics has it


def draw_solution(solution: Solution) -> Picture:
    """Return what is known of depth, volume, voltage or drive, power, current over time."""
    s = solution
    values = {"voltage": s.voltage, "drive": s.drive}
    values |= {"power [W]": s.power, "current [A]": s.current}
    known = {name: x for name, x in values.items() if not np.all(np.isnan(x))}
    ends = [float(max(s.time[-1], s.time[0] + 1e-9)), *_early(s)]
    rows, wide = 2 + len(known), len(ends)
    size = (7.5 + 2.0 * (wide - 1), 1.0 + 1.65 * rows)
    shape: Any = {"sharex": "column", "sharey": "row", "widths": (2.0, 1.0)[:wide]}
    picture, made = grid_of(size, rows * wide, wide, **shape)
    for column, end in enumerate(ends):
        panels = made[column::wide]
        _panels(s, known, panels)
        for panel in panels:
            panel.xlim = (float(s.time[0]), end)
            if column:
                panel.y = panel.legend = ""
        if column:
            panels[0].title = f"the first {end:.3g} s"
    return picture


def _early(s: Solution) -> list[float]:
    """Return the end of a first part to draw by itself [s], where the volume moves early in it.

    That is where four fifths of all that is moved is moved in the first tenth of the time.
    """
    moved = np.cumsum(np.abs(np.diff(s.volume)))
    if not len(moved) or moved[-1] <= 0.0 or len(np.unique(s.reference)) > 1:
        return []
    span = float(s.time[-1] - s.time[0])
    busy = float(s.time[np.searchsorted(moved, 0.8 * moved[-1]) + 1] - s.time[0])
    return [float(s.time[0]) + 3.0 * busy] if 0.0 < busy < 0.1 * span else []


def _panels(s: Solution, known: dict[str, Array], panels: list[Panel]) -> None:
    """Draw depth, volume and what is known of the drive, from above."""
    _depth(s, panels[0])
    _volume(s, panels[1])
    for (name, x), panel in zip(known.items(), panels[2:], strict=True):
        if name == "voltage":
            panel.steps(s.time, x, Ink.GREEN, width=0.9)
            panel.y = "voltage [V]"
        elif name == "drive":
            _drive(panel, s.time, x)
        else:  # points: just after a change of voltage they are peaks, which a line would hold
            panel.dots(s.time, x, ".", Ink.GREEN, size=2.5)
            panel.y = f"{name}\nat samples"
    panels[-1].x = "time [s]"


def _depth(s: Solution, panel: Panel) -> None:
    if not np.all(np.isnan(s.reference)):
        panel.setpoint(s.time, s.reference)
        _settling_band(s, panel)
    panel.line(s.time, s.depth, label="depth")
    for kind, marker in (("reached the bottom", "v"), ("began to emerge", "^")):
        at = [event.time for event in s.events if event.kind == kind]
        if at:
            panel.dots(at, np.interp(at, s.time, s.depth), marker, Ink.BLACK, kind, size=5.0)
    if (alarm := s.alarm) is not None:
        at_depth, label = np.interp(alarm.time, s.time, s.depth), "supervisor took over"
        panel.dots(alarm.time, at_depth, "X", Ink.ORANGE, label, size=7.0, layer=3.0)
    panel.y = "depth [m]"


def _settling_band(s: Solution, panel: Panel) -> None:
    """Shade 2 % of each step to either side of its set-point."""
    changes = np.flatnonzero(np.diff(s.reference) != 0.0) + 1
    before = float(s.depth[0])
    for part in np.split(np.arange(len(s.time)), changes):
        target = float(s.reference[part[0]])
        half = _SETTLED * abs(target - before)
        if half > 0.0:
            ends = s.time[part[0]], s.time[min(part[-1] + 1, len(s.time) - 1)]
            panel.band(ends, target - half, target + half, Ink.GREY, "2 % of the step")
        before = target


def _volume(s: Solution, panel: Panel) -> None:
    asked = not np.all(np.isnan(s.volume_reference))
    if asked:
        panel.steps(s.time, s.volume_reference * 1e6, Ink.ORANGE, "asked for", width=0.8)
    panel.line(s.time, s.volume * 1e6, label="volume")
    low, high = float(s.volume.min()) * 1e6, float(s.volume.max()) * 1e6
    room = 0.1 * max(high - low, 1e-3)
    for stop in (s.vehicle.stroke.minimum * 1e6, s.vehicle.stroke.maximum * 1e6):
        if low - room <= stop <= high + room:
            panel.rule("y", stop, Ink.BLACK, "end stop", dash=":", width=1.0)
    if asked:  # what is asked for may go far beyond what any motor follows
        panel.ylim = (low - 3.0 * room, high + 3.0 * room)
    panel.y = "volume [cm³]"
    panel.legend = "above" if len({mark.label for mark in panel.marks}) > 1 else ""


def _drive(panel: Panel, time: Array, drive: Array) -> None:
    """Draw when pump, valve and bypass run; a run counts for the sample that it begins in."""
    runs = {"pump": (1.0, 4.0), "valve": (2.0,), "bypass": (3.0,)}
    for place, kinds in enumerate(runs.values()):
        on = np.flatnonzero(np.isin(drive, kinds))
        panel.dots(time[on], np.full(len(on), place), "|", Ink.GREEN, size=9.0)
    panel.yticks, panel.ylim = dict(enumerate(runs)), (-0.6, len(runs) - 0.4)
    panel.y = "drive [on]"


_PLACE = ("time_s", "start_depth_m", "target_depth_m")
_VOLUME = ("peak_volume_m3", "volume_range_m3", "actuator_travel_m3")
_STEPS = ("at", "step", "overshoot", "90 % rise", "2 % settling", "final", "peak", "travel")


class SolutionShown(Shown[Solution]):
    """What was flown, its steps where its mission is given, and why it ended.

    task: what was asked for; water: of a cast; notes: what has to be said of them.
    """

    name, kind = "simulate", "simulation"
    task: Mission | None = None
    water: Column | None = None
    notes: Sequence[Labelled] = ()

    @property
    def good(self) -> bool:
        """Whether it came to its end as asked."""
        return super().good and self.found.alarm is None

    def _failures(self) -> Iterator[str]:
        s = self.found
        if not s.finished:
            yield f"stopped at {s.time[-1]:.6g} s: {s.stop.value}"
        if not s.within_depth_limit:
            below = f"below its depth limit of {s.vehicle.hull.depth_limit:g} m"
            yield f"the vehicle went down to {s.deepest:.1f} m, {below}: it would be lost"
        if s.alarm is not None:
            yield f"the supervisor took over at {s.alarm.time:.6g} s: {s.alarm.reason.words}"

    def numbers(self) -> Mapping[str, Any]:
        """Return the numbers of the run; with a mission the last step's numbers, and all steps."""
        if self.task is None:
            return self.found.to_dict()
        steps = steps_of(self.found, self.task)
        last = steps[-1] if steps else dict.fromkeys((*_PLACE, *StepMetrics._fields, *_VOLUME))
        return {
            **self.found.to_dict(),
            "mission": self.task.name,
            **{key: value for key, value in last.items() if key != "events"},
            "steps": steps,
            "water": None if self.water is None else self.water.source,
            "notes": [n.sentence if n.label == "note" else str(n) for n in self.notes],
        }

    def parts(self) -> Iterator[Part]:
        """Give the flight, the table of steps, the events, the notes."""
        s = self.found
        flown, *said = s.sentences
        if self.task is not None:  # its table has the way and what was moved
            flown, said = flown.partition(": from ")[0], [s.stop.value]
        if self.water is not None:
            sea = f"{s.vehicle.name} in the water of {self.water.source}"
            flown = flown.replace(s.vehicle.name, sea, 1)
        yield flown
        yield from labelled("no", self._failures())
        if self.task is not None:
            yield Table(_STEPS, [_row(step) for step in steps_of(s, self.task)], left=())
        yield from said
        kinds = [event.kind for event in s.events]
        for kind in dict.fromkeys(kinds):
            at = next(event.time for event in s.events if event.kind == kind)
            times = f"{kinds.count(kind)} times, first " if kinds.count(kind) > 1 else ""
            yield f"{kind} {times}at {at:.6g} s"
        energy = s.to_dict()
        if energy["energy_basis"].startswith("electrical"):
            yield f"energy: {energy['energy_J']:.4g} J, {energy['energy_basis']}"
        if self.task is not None:
            yield "peak: largest volume to either side of mid-stroke; travel: volume moved in all"
        yield Drawn("trajectory", partial(draw_solution, s), "simulation")
        yield from self.notes

    def files(self) -> dict[str, object]:
        """Return the trajectory."""
        return {"trajectory.csv": self.table()}


def steps_of(s: Solution, task: Mission) -> list[dict[str, Any]]:
    """Return what each set-point's step did, up to where the simulation came."""
    steps = []
    ends = [point.time for point in task.setpoints[1:]] + [task.span]
    before = task.start_depth
    for point, end in zip(task.setpoints, ends, strict=True):
        first, last = np.searchsorted(s.time, [point.time, end], side="left")
        piece = slice(int(first), int(last) + 1)
        if s.time[piece].size < 2:
            break
        m = step_metrics(s.time[piece], s.depth[piece], start=before, target=point.depth)
        volume = s.volume[piece]
        place = (point.time, before, point.depth)
        span, travel = [float(volume.min()), float(volume.max())], np.sum(np.abs(np.diff(volume)))
        moved = (float(np.max(np.abs(volume))), span, float(travel))
        step: dict[str, Any] = dict(zip(_PLACE, place, strict=True)) | m._asdict()
        step |= zip(_VOLUME, moved, strict=True)
        step["events"] = [
            {"time_s": e.time, "kind": e.kind} for e in s.events if point.time <= e.time < end
        ]
        steps.append(step)
        before = point.depth
    return steps


def _row(step: Mapping[str, Any]) -> list[str]:
    def number(name: str, unit: str, digits: int = 1, factor: float = 1.0) -> str:
        value = step[name]
        return "never" if value is None else f"{factor * value:.{digits}f} {unit}"

    start, target = step["start_depth_m"], step["target_depth_m"]
    row = [f"{step['time_s']:g} s", f"{start:g} to {target:g} m", number("overshoot_pct", "%")]
    took = [number(name, "s") for name in ("rise90_s", "settle2_s")]
    row += took if target != start else ["no step", "no step"]
    row.append(number("final_depth_m", "m", 3))
    volumes = ("peak_volume_m3", "actuator_travel_m3")
    return [*row, *(number(name, "cm3", 1, 1e6) for name in volumes)]
