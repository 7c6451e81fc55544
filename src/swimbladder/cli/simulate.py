"""``swimbladder simulate``: depth steps or a mission in closed loop, to CSV, netCDF, pictures."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import CastFile, CastReading, warn_of_mass, water_of_cast
from swimbladder.cli.common import (
    aside,
    asked_of,
    compile_notice,
    labelled,
    progress,
    table,
    typed_command,
)
from swimbladder.cli.options import (
    Files,
    Options,
    VehicleName,
    WithoutSupervisor,
    flag,
    grouped,
    valued,
)
from swimbladder.cli.texts import Given

if TYPE_CHECKING:
    from swimbladder.io.mission import Mission
    from swimbladder.physics.seawater import Column
    from swimbladder.sim.closed_loop import Event, Solution
    from swimbladder.sim.closed_loop.water import Medium
    from swimbladder.vehicle import Vehicle

_PLACE = ("time_s", "start_depth_m", "target_depth_m")
_VOLUME = ("peak_volume_m3", "volume_range_m3", "actuator_travel_m3")


def write_files(
    s: Solution,
    task: Mission,
    column: Column | None,
    folder: Path,
    also: Also,
    answer: Mapping[str, Any],
) -> list[Path]:
    """Write the files that were asked for, and the report; return their paths."""
    from swimbladder.io.tables import write_csv

    columns = s.columns()
    with progress("writing trajectory.csv", len(s.time)) as advance:
        files = [write_csv(folder / "trajectory.csv", columns, advance=advance)]
    if also.netcdf:
        with progress("writing trajectory.nc"):
            from swimbladder.io.netcdf import write_netcdf

            title = f"{s.vehicle.name}: {task.name or 'mission'}, simulated in closed loop"
            if column is not None:
                title += f" in the water of {column.source}"
            data = s.dataset(also.read()["begin"]).assign_attrs(title=title)
            files.append(write_netcdf(folder / "trajectory.nc", data))
    beside: dict[str, object] = {path.name: None for path in files}
    with progress("drawing and writing the report"):
        from swimbladder.io.files import write_atomically
        from swimbladder.show.answers import page
        from swimbladder.show.report.html import REPORT

        if also.plot:
            from swimbladder.show.plots.style import save

            beside["trajectory.png"] = figure = s.plot()
            files.append(save(figure, folder / "trajectory.png"))
        files.append(folder / REPORT)
        write_atomically(files[-1], page(s, answer, beside, typed_command()))
    return files


def steps_of(s: Solution, task: Mission) -> list[dict[str, Any]]:
    """Return what each set-point's step did, up to where the simulation came."""
    import numpy as np

    from swimbladder.sim.closed_loop import step_metrics

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
        step["events"] = _events(e for e in s.events if point.time <= e.time < end)
        steps.append(step)
        before = point.depth
    return steps


def _events(events: Iterable[Event]) -> list[dict[str, Any]]:
    return [{"time_s": event.time, "kind": event.kind} for event in events]


def answer_of(
    s: Solution, task: Mission, column: Column | None, notes: Sequence[str]
) -> dict[str, Any]:
    """Return the JSON object: the last step's numbers, and all steps."""
    from swimbladder.sim.closed_loop import StepMetrics

    steps = steps_of(s, task)
    last = steps[-1] if steps else dict.fromkeys((*_PLACE, *StepMetrics._fields, *_VOLUME))
    return {
        **s.to_dict(),
        "mission": task.name,
        **{key: value for key, value in last.items() if key != "events"},
        "steps": steps,
        "water": None if column is None else column.source,
        "notes": list(notes),
    }


def shown(answer: dict[str, Any]) -> Iterator[object]:
    """Give what is printed: the table of steps, the events, the notes."""

    def number(value: float | None, unit: str, digits: int = 1) -> str:
        return "never" if value is None else f"{value:.{digits}f} {unit}"

    headings = ("at", "step", "overshoot", "90 % rise", "2 % settling", "final", "peak", "travel")
    rows = []
    for step in answer["steps"]:
        start, target = step["start_depth_m"], step["target_depth_m"]
        row = [f"{step['time_s']:g} s", f"{start:g} to {target:g} m"]
        row.append(number(step["overshoot_pct"], "%"))
        took = [number(step[name], "s") for name in ("rise90_s", "settle2_s")]
        row += took if target != start else ["no step", "no step"]
        row.append(number(step["final_depth_m"], "m", 3))
        volumes = (step[name] for name in ("peak_volume_m3", "actuator_travel_m3"))
        rows.append([*row, *(number(volume * 1e6, "cm3") for volume in volumes)])
    water = f" in the water of {answer['water']}" if answer["water"] else ""
    flown = f"law {answer['law']} {'and supervisor' if answer['supervised'] else 'alone'}"
    span = f"{answer['duration_s']:g} s in {answer['samples']} samples"
    yield f"{answer['vehicle']}{water}, {flown}, {span}"
    yield table(headings, rows, left=())
    yield answer["stop_reason"]
    kinds = [event["kind"] for event in answer["events"]]
    for kind in dict.fromkeys(kinds):
        at = next(e["time_s"] for e in answer["events"] if e["kind"] == kind)
        times = f"{kinds.count(kind)} times, first " if kinds.count(kind) > 1 else ""
        yield f"{kind} {times}at {at:.6g} s"
    if answer["energy_basis"].startswith("electrical"):
        yield f"energy: {answer['energy_J']:.4g} J, {answer['energy_basis']}"
    yield "peak: largest volume to either side of mid-stroke; travel: volume moved in all"
    yield from labelled("note", answer["notes"])


_START, _TARGET, _DURATION = 1.5, 3.0, 400.0
_DIVE, _WAY = 500.0, 250.0  # m, and m in an hour, of a float with pump and valve
_FIELDS = {"setpoints[0].depth": "target"}


@dataclass(frozen=True)
class Step(Options):
    """A step of depth, in place of a mission's file."""

    start_depth: Given = valued(
        "DEPTH", f"Start, at rest and neutral ({_START} m; a float: the surface)", name="--start"
    )
    target: Given = valued("DEPTH", f"Set-point ({_TARGET} m; a float: {_DIVE:g} m and up again)")
    duration: Given = valued("TIME", f"Duration ({_DURATION:g} s; a float: as needed)")
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (none)", name="--bottom")


@dataclass(frozen=True)
class Also(Options):
    """What else is written."""

    netcdf: bool = flag("--netcdf", "Also write trajectory.nc.")
    begin: Given = valued("DATE", "Start, ISO 8601, for netCDF (none).")
    plot: bool = flag("--plot", "Also write trajectory.png.")


_MISSION = typer.Argument(metavar="MISSION", help="TOML file with set-points, start and duration.")
_SEED = typer.Option(help="Seed of the sensors' noise (sensors without noise)", min=0)


@grouped("start target duration bottom netcdf", out=Path("swimbladder-simulate"))
def simulate(
    vehicle: VehicleName,
    mission: Annotated[Path | None, _MISSION] = None,
    *,
    step: Step,
    seed: Annotated[int | None, _SEED] = None,
    without_supervisor: WithoutSupervisor = False,
    cast: CastFile = None,
    reading: CastReading,
    to: Files,
    also: Also,
) -> None:
    """Simulate depth steps or a mission in closed loop.

    Depths and times are in m and s, or carry a unit: --start "150 cm" --duration "5 min".

    With --cast the neutral volume follows the density and temperature of that water.

    A float with pump and valve floats at a set-point of 0.

    A vehicle whose file has a table [supervisor] is flown by its law under its supervisor, as
    flashed.

    Exit code 1 when the simulation stopped before its end or the supervisor took over; the files
    are written all the same.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import make_folder

    v = load_vehicle(vehicle, sampled=True, pumped=True, weighed=True)
    also.read()
    task = _mission(v, mission, step)
    to.check()
    casts = reading.casts(cast)
    warn_of_mass(v)
    with step.said_as_typed(**_FIELDS) if mission is None else asked_of(mission, task):
        reach, medium = max([task.start_depth, *(depth for _, depth in task.pairs)]), None
        water = water_of_cast(casts, reach, v.hull.depth_limit)
        if water is not None:
            from swimbladder.sim.closed_loop.water import medium_of

            medium = medium_of(v, water, reach=reach)
        s = _run(v, task, seed, water, False if without_supervisor else None)
    notes = [*_notes(s, water, medium), *_seed_unused(v, seed)]
    answer = answer_of(s, task, water, notes)
    files = write_files(s, task, water, make_folder(to.out), also, answer)
    to.answer(answer, shown(answer), files)
    if not s.finished:
        aside(f"stopped at {s.time[-1]:.6g} s: {s.stop.value}")
    if not s.within_depth_limit:
        below = f"below its depth limit of {v.hull.depth_limit:g} m"
        aside(f"the vehicle went down to {s.deepest:.1f} m, {below}: it would be lost")
    if s.alarm is not None:
        aside(f"the supervisor took over at {s.alarm.time:.6g} s: {s.alarm.reason.words}")
    if not (s.finished and s.within_depth_limit and s.alarm is None):
        raise typer.Exit(1)


def _mission(vehicle: Vehicle, path: Path | None, step: Step) -> Mission:
    """Return the mission of a file, or one step from the options.

    Of a float with pump and valve: a dive from the surface, and back where no target is given.
    """
    from swimbladder.io.config import load_mission
    from swimbladder.io.mission import Mission, Setpoint

    if path is not None:
        remedy = f"Leave the option out, or the file {path}"
        step.refuse("the mission file says this already", remedy)
        return load_mission(path)
    given = step.given()
    target = given.pop("target", None)
    if vehicle.command != "volume change":
        asked = {"start_depth": _START, "duration": _DURATION, **given}
        point = Setpoint(time=0.0, depth=_TARGET if target is None else target)
        return Mission(name="step", setpoints=(point,), **asked)
    deepest = min(vehicle.hull.depth_limit or math.inf, given.get("bottom_depth", math.inf))
    depth = min(_DIVE, 0.5 * deepest) if target is None else target
    way = abs(depth - given.setdefault("start_depth", 0.0))
    span = 3600.0 * (2.0 if target is None else 1.0) * math.ceil(way / _WAY + 1.0)
    span = given.setdefault("duration", span)
    points = [Setpoint(time=0.0, depth=depth)]
    if target is None:
        points.append(Setpoint(time=0.5 * span, depth=0.0))
    return Mission(name="dive" if len(points) > 1 else "step", setpoints=tuple(points), **given)


def _notes(s: Solution, column: Column | None, medium: Medium | None) -> list[str]:
    """Return what has to be said of the water."""
    if column is None or medium is None:
        return []
    notes = labelled("cast", column.report)
    if s.vehicle.command != "volume change":
        mean = "the cast's mean down to the deepest set-point"
        differs = f"from which it differs by {100.0 * medium.misses:.2g} % at most there"
        weight = f"{medium.specific_weight:.5g} N/m3"
        notes.append(f"force and load go with {weight}, {mean}, {differs}")
    if s.deepest > column.deepest:
        went = f"the vehicle went down to {s.deepest:.4g} m"
        ends = f"the cast ends at {column.deepest:.4g} m"
        notes.append(f"{went}, and {ends}: below, its last gradient goes on")
    return notes


def _seed_unused(vehicle: Vehicle, seed: int | None) -> list[str]:
    """Return what has to be said of a seed for sensors that have no noise."""
    known = vehicle.sensors
    noises = (known.depth_noise, known.volume_noise, known.depth_quantum, known.volume_quantum)
    if seed is None or any(noises):
        return []
    lacks = "the vehicle's sensors have neither noise nor quantum (its table [sensors])"
    return [f"--seed {seed} changes nothing: {lacks}"]


def _run(
    vehicle: Vehicle,
    task: Mission,
    seed: int | None,
    column: Column | None,
    supervised: bool | None,
) -> Solution:
    """Simulate; say on stderr what is waited for."""
    with progress("loading the simulator"):
        from swimbladder.sim.closed_loop import simulate as simulate_closed_loop

    floats = vehicle.command == "volume change"  # their tables take scipy.interpolate
    blas = contextlib.nullcontext() if floats else _no_search_for_blas()
    with compile_notice(), progress("simulating", 1.0) as advance, blas:
        return simulate_closed_loop(
            vehicle,
            setpoints=task.pairs,
            duration=task.span,
            start_depth=task.start_depth,
            bottom_depth=task.bottom,
            seed=seed,
            column=column,
            supervised=supervised,
            advance=advance,
        )


@contextlib.contextmanager
def _no_search_for_blas() -> Iterator[None]:
    """Keep numba from importing scipy.linalg with its first kernel: 0.1 s of a run's 0.8 s.

    Numba looks there for matrix products, of which our kernels have none.
    """
    absent = "scipy.linalg" not in sys.modules
    if absent:
        sys.modules["scipy.linalg"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        if absent:
            del sys.modules["scipy.linalg"]
