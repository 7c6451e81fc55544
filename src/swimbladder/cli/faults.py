"""``swimbladder faults``: missions in which something fails, with the vehicle's own C on board."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import CastFile, CastReading, water_of_cast
from swimbladder.cli.common import compile_notice, kept, labelled, progress, table, typed_command
from swimbladder.cli.options import Files, Options, TimeLimit, VehicleName, grouped, valued
from swimbladder.cli.texts import Given
from swimbladder.errors import InputError, NoAnswerError

if TYPE_CHECKING:
    from swimbladder.sim.faults import FaultResult
    from swimbladder.vehicle import Vehicle

_SHOWN = 20  # lost vehicles that are named; all are in the files


@dataclass(frozen=True)
class Missions(Options):
    """Which missions are flown, as `sim.faults.faults` has it."""

    missions: int = valued("N", "Missions with faults.", 100_000)
    healthy: int | None = valued("N", "Missions without a fault (a tenth as many).")
    depths: Given = valued("LEAST:MOST", "Depth range of the missions.", name="--depth")
    seed: int = valued(None, "Seed of all random draws.", 1, min=0)


_MISSION = typer.Option(metavar="N", help="Repeat this mission with its trajectory; hN: healthy.")


@grouped("missions healthy depth time_limit mission", out=Path("swimbladder-faults"))
def faults(
    vehicle: VehicleName,
    *,
    missions: Missions,
    limit: TimeLimit,
    cast: CastFile = None,
    reading: CastReading,
    mission: Annotated[str | None, _MISSION] = None,
    to: Files,
) -> None:
    """Simulate the vehicle's C in missions with faults of sensors, actuator or battery.

    With --cast they are flown in that water; the C is that of the vehicle's file.

    The controller and its supervisor are compiled on this machine and flown against the plant.
    Exit code 1: a recoverable mission was lost (full buoyancy 60 s after fault onset would have
    surfaced the vehicle), or a healthy mission raised an alarm. A run that is killed resumes.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import unfinished

    v, asked = limit.on(load_vehicle(vehicle)), missions.read()
    reach = None if asked["depths"] is None else asked["depths"][1]
    asked["column"] = water_of_cast(reading.casts(cast), reach, v.hull.depth_limit)
    to.check()
    if mission is not None:
        _one(v, mission, asked, to)
        return
    with progress("loading the simulator"):
        from swimbladder.sim.faults import faults as fly
    keep = unfinished(to.out)
    with kept(keep), compile_notice(), progress("flying missions", 1.0) as advance:
        flown = fly(v, **asked, keep=keep, advance=advance)

    to.answer(flown, _shown(flown), keep=keep)
    if not flown.passed:
        raise NoAnswerError(_verdict(flown, vehicle, missions.seed))


def _one(vehicle: Vehicle, mission: str, asked: dict[str, Any], to: Files) -> None:
    """Fly one mission again and write its trajectories."""
    number = mission.removeprefix("h")
    if not (number.isascii() and number.isdigit() and len(number) < 9):
        why = "a mission is a number of eight digits at most, or one with an h before it"
        remedy = "Write it like 17, or h17 for a healthy one"
        raise InputError(why, field="--mission", value=mission, remedy=remedy)
    with progress("loading the simulator"):
        from swimbladder.show.plots.faults import draw_mission
        from swimbladder.show.report.html import REPORT
        from swimbladder.show.report.page import answer_page
        from swimbladder.sim.faults.single_mission import NAMES, fly_one, trace_csv
    how = {name: asked[name] for name in ("seed", "depths", "column")}
    with compile_notice(), progress("flying the mission"):
        flown = fly_one(vehicle, int(number), healthy=mission.startswith("h"), **how)

    def files(numbers: Mapping[str, Any]) -> dict[str, object]:
        stem = f"mission-{'h' if flown.healthy else ''}{flown.mission.number}"
        traces = zip(NAMES, flown.rows, strict=False)
        listed = {f"{stem}-{name}.csv": trace_csv(rows, flown.tick) for name, rows in traces}
        pictures = {stem: draw_mission(flown)}
        title = f"{vehicle.name}: mission {mission} of the fault campaign"
        about = {"command": typed_command(), "files": [*listed, f"{stem}.png"]}
        report = answer_page(title, flown.lines(), numbers, pictures, about)
        return {REPORT: report, **listed, f"{stem}.png": pictures[stem]}

    to.answer(flown.to_dict(), flown.lines(), files)


def _shown(flown: FaultResult) -> Iterator[object]:
    """Give what is printed: what was flown, what it comes to, a row for each kind of fault."""
    column = flown.course.column
    yield from flown.sentences
    rows = []
    for line in flown.lines():
        counts = [line.missions, line.recoverable, line.recovered]
        counts += [line.recoverable - line.recovered, line.lost_without_supervisor]
        times = map(_seconds, (line.detection_time_median, line.detection_time_95))
        rows.append((line.name, *map(str, counts), *times, f"{line.deepest:.1f}"))
    headings = ("fault", "missions", "recoverable", "recovered", "lost", "lost without\nsupervisor")
    more = ("detection\ntime [s]", "95 %\n[s]", "deepest\n[m]")
    yield table((*headings, *more), rows)
    yield from labelled("cast", () if column is None else column.report)


def _seconds(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.0f}"


def _verdict(flown: FaultResult, vehicle: str, seed: int) -> str:
    """Return what is wrong and what to do, the missions by number."""
    parts, lost, alarms = [], flown.lost, flown.false_alarms
    if len(lost):
        able = int(flown.recoverable.sum())
        parts.append(f"{len(lost)} of {able} recoverable missions were lost:")
        parts += [f"  {flown.description(int(n))}" for n in lost[:_SHOWN]]
        if len(lost) > _SHOWN:
            parts.append(f"  and {len(lost) - _SHOWN} more: supervised in missions.csv")
    if len(alarms):
        shown = ", ".join(f"h{n}" for n in alarms[:_SHOWN])
        parts.append(f"{len(alarms)} healthy missions raised an alarm: {shown}")
    again = f"{lost[0]}" if len(lost) else f"h{alarms[0]}"
    parts.append(
        f"Look at one: swimbladder faults {vehicle} --seed {seed} --mission {again}. "
        "Then change the [supervisor] table (depth_limit, neutral_range, patience), or the mission"
    )
    return "\n".join(parts)
