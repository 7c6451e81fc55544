"""``swimbladder simulate``: depth steps or a mission in closed loop, to CSV, netCDF, pictures.

``swimbladder mission``: phases in repeated cycles, in the water of a cast.

``swimbladder campaign``: an array of floats on one mission, each a little different.

``swimbladder analyse``: linear models, stability, margins and what depth does.

``swimbladder plan``: the best step of depth that the vehicle allows, computed beforehand.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.common import aside, asked_of, compile_notice, kept, progress, working
from swimbladder.cli.options import (
    Files,
    Given,
    Options,
    VehicleName,
    depth_pair,
    flag,
    grouped,
    loaded,
    supervised,
    valued,
)
from swimbladder.cli.reading import CastReading, Casts, warn_of_mass, water_of_cast
from swimbladder.errors import InputError, SwimbladderError, check_number
from swimbladder.show.parts import Gone, Labelled, labelled

if TYPE_CHECKING:
    from swimbladder.design.analysis import Analysis
    from swimbladder.io.mission import Mission
    from swimbladder.physics.seawater import Column
    from swimbladder.show.solution import SolutionShown
    from swimbladder.sim.campaign.store import Layout
    from swimbladder.sim.closed_loop import Solution
    from swimbladder.sim.closed_loop.water import Medium
    from swimbladder.vehicle import Vehicle
    from swimbladder.vehicle.spread import Spread


class Step(Options):
    """A step of depth, in place of a mission's file."""

    step: Given = valued("FROM:TO", "Step from rest (1.5:3 m; a float: 0:500 m and up again).")
    duration: Given = valued("TIME", "Duration (400 s; a float: as needed).")
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (none).")


class Also(Options):
    """What else is written."""

    netcdf: bool = flag("--netcdf", "Also write netCDF: trajectory.nc.")
    begin: Given = valued("DATE", "Start, ISO 8601, for netCDF (none).")
    plot: bool = flag("--plot", "Also draw trajectory.png.")


_SETPOINTS = typer.Argument(
    metavar="MISSION", help="TOML file with set-points, start and duration."
)


class How(Options):
    """With which noise, and under what."""

    seed: int | None = valued("N", "Seed of the sensors' noise (sensors without noise).", min=0)
    supervised: bool | None = supervised()


@grouped("step duration bottom_depth netcdf", out=Path("swimbladder-simulate"))
def simulate(
    vehicle: VehicleName,
    mission: Annotated[Path | None, _SETPOINTS] = None,
    *,
    step: Step,
    how: How,
    reading: CastReading,
    to: Files,
    also: Also,
) -> None:
    """Simulate depth steps or a mission in closed loop.

    Depths and times are in m and s, or carry a unit: --step "150:300 cm" --duration "5 min".

    With --cast the neutral volume follows the density and temperature of that water.

    A float with pump and valve floats at a set-point of 0.

    A vehicle whose file has a table [supervisor] is flown by its law under its supervisor, as
    flashed.

    Exit code 1 when the simulation stopped before its end or the supervisor took over; the files
    are written all the same.
    """
    v = loaded(vehicle, sampled=True, pumped=True, weighed=True)
    also.read()
    task = _mission(v, mission, step)
    casts = reading.casts()
    warn_of_mass(v)
    given = step.given() if mission is None else {"mission": task}
    with contextlib.nullcontext() if mission is None else asked_of(mission, task):
        reach, medium = max([task.start_depth, *(depth for _, depth in task.pairs)]), None
        water = water_of_cast(casts, reach, v.hull.depth_limit)
        if water is not None:
            from swimbladder.sim.closed_loop.water import medium_of

            medium = medium_of(v, water, reach=reach)
        s = _simulated(v, given, how, water)
    to.answer(
        _shown(s, task, water, [*_water_notes(s, water, medium), *_seed_unused(v, how.seed)], also)
    )


def _shown(
    s: Solution, task: Mission, water: Column | None, notes: Sequence[Labelled], also: Also
) -> SolutionShown:
    """Return the run as it is shown, with the netCDF that was asked for."""
    from swimbladder.show.solution import SolutionShown

    more: dict[str, object] = {}
    if also.netcdf:
        from swimbladder.io.netcdf import write_netcdf

        title = f"{s.vehicle.name}: {task.name or 'mission'}, simulated in closed loop"
        title += "" if water is None else f" in the water of {water.source}"
        data = s.dataset(also.read()["begin"]).assign_attrs(title=title)
        more["trajectory.nc"] = partial(write_netcdf, dataset=data)
    how: Any = {"pictures": also.plot, "more": more}
    return SolutionShown(s, task=task, water=water, notes=notes, **how)


def _mission(vehicle: Vehicle, path: Path | None, step: Step) -> Mission:
    """Return the mission of a file, or one step from the options."""
    from swimbladder.io.config import load_mission
    from swimbladder.io.mission import step_mission

    if path is not None:
        remedy = f"Leave the option out, or the file {path}"
        step.refuse("the mission file says this already", remedy)
        return load_mission(path)
    return step_mission(vehicle, **step.given())


def _water_notes(s: Solution, column: Column | None, medium: Medium | None) -> list[Labelled]:
    """Return what has to be said of the water."""
    if column is None or medium is None:
        return []
    notes = labelled("cast", column.report)
    if s.vehicle.command != "volume change":
        mean = "the cast's mean down to the deepest set-point"
        differs = f"from which it differs by {100.0 * medium.misses:.2g} % at most there"
        weight = f"{medium.specific_weight:.5g} N/m3"
        notes.append(Labelled("note", f"force and load go with {weight}, {mean}, {differs}"))
    if s.deepest > column.deepest:
        went = f"the vehicle went down to {s.deepest:.4g} m"
        ends = f"the cast ends at {column.deepest:.4g} m"
        notes.append(Labelled("note", f"{went}, and {ends}: below, its last gradient goes on"))
    return notes


def _seed_unused(vehicle: Vehicle, seed: int | None) -> list[Labelled]:
    """Return what has to be said of a seed for sensors that have no noise."""
    known = vehicle.sensors
    noises = (known.depth_noise, known.volume_noise, known.depth_quantum, known.volume_quantum)
    if seed is None or any(noises):
        return []
    lacks = "the vehicle's sensors have neither noise nor quantum (its table [sensors])"
    return [Labelled("note", f"--seed {seed} changes nothing: {lacks}")]


def _simulated(vehicle: Vehicle, task: dict[str, Any], how: How, column: Column | None) -> Solution:
    """Simulate a mission or a step; say on stderr what is waited for."""
    with progress("loading the simulator"):
        from swimbladder.sim.closed_loop import simulate as simulate_closed_loop

    floats = vehicle.command == "volume change"  # their tables take scipy.interpolate
    blas = contextlib.nullcontext() if floats else _no_search_for_blas()
    with working("simulating") as advance, blas:
        return simulate_closed_loop(
            vehicle, **task, seed=how.seed, cast=column, supervised=how.supervised, advance=advance
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


class Cycles(Options):
    """How a mission is flown."""

    cycles: int | None = valued("N", "Cycles (as in the mission).", min=1)
    duration: Given = valued("TIME", "Duration: no cycle begins after it.")
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (as in the mission).")
    seed: int | None = valued("N", "Seed of the sensors' noise (no noise).", min=0)
    supervised: bool | None = supervised()
    begin: Given = valued("DATE", "Start, ISO 8601, for netCDF (none).")


class MissionFiles(Options):
    """What else is written."""

    netcdf: bool = flag("--netcdf", "Also write netCDF (OG1): mission.nc.")
    plot: bool = flag("--plot", "Also draw mission.png.")
    config: bool = flag("--config", "Also write Argo's CONFIG_ names: argo-config.json.")


_MISSION = typer.Argument(metavar="MISSION", help="TOML file with phases and cycles.")


@grouped("cycles duration bottom_depth netcdf", out=Path("swimbladder-mission"))
def mission(
    vehicle: VehicleName,
    mission: Annotated[Path, _MISSION],
    *,
    how: Cycles,
    reading: CastReading,
    to: Files,
    also: MissionFiles,
) -> None:
    r"""Simulate a mission of phases and cycles: depth, time, pump, battery.

    Without --cast the water is that of the vehicle's file, of constant density.

    Exit code 1: it cannot be met (no file is written) or was not.

    A run that is killed resumes.
    """
    from swimbladder.io.config import load_mission
    from swimbladder.io.files import unfinished

    v, task = loaded(vehicle, weighed=True), load_mission(mission)
    asked = how.read()
    begin, bottom = asked.pop("begin"), asked.pop("bottom_depth")
    cycles, span = asked.pop("cycles"), asked.pop("duration")
    if also.netcdf and begin is not None:
        from swimbladder.sim.mission.export import og1_time

        og1_time(begin)
    keep = unfinished(to.out)
    read = next(iter(reading.casts(task.latitude)), None)
    warn_of_mass(v)
    more: dict[str, object] = {}
    with asked_of(mission, task, duration=how.duration):
        with progress("loading the simulator"):
            from swimbladder.sim.mission.export import argo_configuration
            from swimbladder.sim.mission.orders import flown_laws
            from swimbladder.sim.mission.prepare import cost_words
            from swimbladder.sim.mission.result import mission as fly

        task = (task if bottom is None else task.over(bottom)).limited(cycles=cycles, duration=span)
        if also.config:
            more["argo-config.json"] = argo_configuration(v, task)
        with contextlib.suppress(
            SwimbladderError
        ):  # the flight raises it, after what is to be checked first
            aside(*cost_words(task, flown_laws(v, task, asked["supervised"])[0]))
        with kept(keep), compile_notice(), progress("flying", 1.0) as advance:
            found = fly(v, task, read, **asked, keep=keep, advance=advance)
    from swimbladder.io.netcdf import write_netcdf
    from swimbladder.show.mission import MissionResultShown

    if also.netcdf:
        place = {} if read is None else {"latitude": read.latitude, "longitude": read.longitude}
        data = found.dataset(begin=begin, **place)
        more["mission.nc"] = partial(write_netcdf, dataset=data)
    names = ["mission.nc", "argo-config.json", *([] if also.plot else ["mission.png"])]
    more = dict.fromkeys(names, Gone()) | more  # what is not asked for goes
    to.answer(
        MissionResultShown(found, begin=begin, cast=read, pictures=also.plot, more=more), keep=keep
    )


class Flights(Options):
    """How many floats are flown, for how long."""

    cycles: int | None = valued("N", "Cycles (as in the mission).", min=1)
    duration: Given = valued("TIME", "Duration: no cycle begins after it.")
    seed: int = valued("N", "Seed of all random draws.", 1, min=0)
    supervised: bool | None = supervised()


class Spreads(Options):
    """How much floats differ, by the inputs of a `Spread`."""

    trim: Given = valued("VOLUME", "1 sigma of the neutral volume (5 cm3).", name="--trim-std")
    psi: Given = valued("PSI", "1 sigma of psi (0.002 cm3/m).", name="--psi-std")
    drag: Given = valued("SHARE", "1 sigma of the drag (10 %).", name="--drag-std")
    pump: Given = valued("SHARE", "1 sigma of the pump's delivery (5 %).", name="--pump-std")

    spread: Path | None = valued("FILE", "TOML file with the spread.")
    identified: bool = flag("--identified", "Spread from the identified covariance.")
    sensitivity: bool = flag("--sensitivity", "Sobol sensitivity indices of the outcome.")

    def of(self, vehicle: Vehicle) -> Spread:
        """Return the spread of a file, or the usual one; as identified; with what is stated."""
        from swimbladder.io.config import file_text, read_model
        from swimbladder.vehicle.spread import Spread

        file = self.spread
        found = Spread() if file is None else read_model(Spread, file_text(file), file)
        if self.identified:
            try:
                found = found.identified(vehicle)
            except InputError as error:
                raise error.but(field="--identified") from None
        inputs = {name: getattr(self, name) for name in ("trim", "psi", "drag", "pump")}
        given = {name: text for name, text in inputs.items() if text is not None}
        return Spread(**{**found.model_dump(), **given})


class Work(Options):
    """Who flies them, as `jobs.Workers` has it."""

    executor: str = valued("WHO", "Workers: threads, processes or dask.", "threads")
    workers: int | None = valued("N", "Number of workers (one per core).")
    scheduler: Given = valued("WHERE", "Dask scheduler: address, or its file.")
    part: str = valued(
        "K/N", "Part K of N of the chunks, into the same folder.", "1/1", show_default=False
    )


@grouped("floats cycles duration sensitivity", out=Path("swimbladder-campaign"))
def campaign(
    vehicle: VehicleName,
    mission: Annotated[Path, _MISSION],
    floats: Annotated[int, typer.Option(metavar="N", help="Number of floats.")] = 4000,
    *,
    how: Flights,
    stated: Spreads,
    work: Work,
    reading: Casts,
    to: Files,
) -> None:
    """Simulate many floats on a mission: success, and battery life.

    Trim, hull, drag and pump differ, and the water where several casts are given. All results go to
    campaign.zarr in the folder, a chunk of floats at a time, by as many workers as there are.

    Exit code 1: a float did not do every phase. A run that is killed goes on where it was.
    """
    from swimbladder.io.config import load_mission

    v, task = loaded(vehicle, weighed=True), load_mission(mission)
    asked, who = how.read(), work.read()
    casts = reading.casts(task.latitude)
    warn_of_mass(v)
    with progress("loading the simulator"):
        from swimbladder.jobs import Workers, run
        from swimbladder.sim.campaign.result import result_of, waters_of
        from swimbladder.sim.campaign.run import Floats
    with asked_of(mission, task), progress("tabulating the water"):
        columns = waters_of(v, task, casts)

    workers = Workers(**who)
    drawn = stated.of(v)
    with asked_of(mission, task, duration=how.duration):
        job = Floats(
            vehicle=v,
            mission=task,
            columns=columns,
            floats=floats,
            spread=drawn,
            sensitivity=stated.sensitivity,
            store=to.out / "campaign.zarr",
            **asked,
        )
    layout = job.layout
    doing = f"flying {layout.floats} floats"
    job.check()
    aside(*job.cost)
    with working(doing, keep=job.store) as advance:
        whole = run(job, workers, advance)
    if not whole:
        _unfinished(layout, work.part, to)
        return
    found = result_of(job)
    to.answer(found, [job.store])


def _unfinished(layout: Layout, part: str, to: Files) -> None:
    """Say how far the campaign is of which this was a part."""
    done = len(layout.done())
    chunks = f"{done} of {layout.count} chunks of the campaign are done"
    sentence = f"part {part} is flown: {chunks}, the others are for other parts"
    state = {"sentence": sentence, "chunks": layout.count, "done": done}
    to.show({**state, "files": [str(layout.folder)]}, [sentence])


class Rest(Options):
    """Where the vehicle rests."""

    depth: str = valued("DEPTH", "Depth of the operating point.", "0 m")


@grouped(out=None)
def analyse(vehicle: VehicleName, *, asked: Rest, to: Files) -> None:
    """Linear models: poles, Routh's table, margins of the sampled loop.

    The depth is in m, or carries a unit: --depth "50 m". Exit code 1 when the vehicle has a
    controller and its closed loop is not stable, or cannot rest at the depth. Files are written
    with --out.
    """
    with progress("analysing"):
        a = _analysis(vehicle, asked.read()["depth"])
    if not a.rests:
        aside(f"no rest: stroke or supply do not hold {a.vehicle.name} at {a.depth:g} m")
    to.answer(a)


def _analysis(vehicle: str, depth: float) -> Analysis:
    from swimbladder.design.analysis import DOWN
    from swimbladder.design.analysis import analyse as analyse_vehicle
    from swimbladder.io.config import locate

    check_number(depth, "--depth", "m", least=0.0, remedy=DOWN)
    v = loaded(vehicle)
    try:
        return analyse_vehicle(v, depth=depth)
    except InputError as error:
        raise (locate(error, vehicle) if Path(vehicle).is_file() else error) from None


class Planned(Options):
    """What is planned, as `design.planning.plan` has it."""

    goal: str = valued("GOAL", "Goal: least time, effort (volume moved) or energy.", "time")
    arrive: Given = valued("HOW", "Arrival: band (for good; goal time) or rest (exactly).")
    duration: Given = valued("TIME", "Duration, for effort and energy (twice the least).")
    supply: Given = valued("VOLTAGE", "Supply voltage (the vehicle's).")
    sample_time: Given = valued("TIME", "Sample time (the controller's).")
    band: str = valued("SHARE", "Band about the target, relative to the step.", "2 %")
    feedback_reserve: str = valued("SHARE", "Reserve of supply and stroke for feedback.", "0 %")
    max_speed: Given = valued("SPEED", "Largest vertical speed.")
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (none).")


@grouped("step goal arrive duration supply bottom_depth", out=Path("swimbladder-plan"))
def plan(
    vehicle: VehicleName,
    step: Annotated[str, typer.Option(metavar="FROM:TO", help="Step from rest to rest.")],
    *,
    asked: Planned,
    to: Files,
) -> None:
    r"""Plan an optimal depth step within voltage, stroke, speed and depth.

    plan.csv is a log of it, mission.toml its depths as set-points for `simulate`. Exit code 1 says
    that there is no plan, what is in the way, and how much more of it would do.
    """
    v = loaded(vehicle, sampled=True)
    way, options = depth_pair(step, "--step"), asked.given()
    with _told_how_to_go_on(), working("solving programs") as advance:
        from swimbladder.design.planning import plan as find

        found = find(v, way, advance=advance, **options)
    to.answer(found)


@contextlib.contextmanager
def _told_how_to_go_on() -> Iterator[None]:
    """Say on an interruption what there is, and what would take less long."""
    try:
        yield
    except KeyboardInterrupt:
        sooner = "It takes less long with a longer sample time (--sample-time)"
        aside(f"stopped: nothing is written, and the same command begins anew. {sooner}")
        raise
