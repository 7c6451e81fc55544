"""``swimbladder simulate``: depth steps or a mission in closed loop, to CSV, netCDF, pictures."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import CastReading, warn_of_mass, water_of_cast
from swimbladder.cli.common import asked_of, progress, working
from swimbladder.cli.options import (
    Files,
    Options,
    VehicleName,
    flag,
    grouped,
    loaded,
    supervised,
    valued,
)
from swimbladder.cli.texts import Given
from swimbladder.show.parts import Labelled, labelled

if TYPE_CHECKING:
    from swimbladder.io.mission import Mission
    from swimbladder.physics.seawater import Column
    from swimbladder.show.solution import SolutionShown
    from swimbladder.sim.closed_loop import Solution
    from swimbladder.sim.closed_loop.water import Medium
    from swimbladder.vehicle import Vehicle


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


_MISSION = typer.Argument(metavar="MISSION", help="TOML file with set-points, start and duration.")


class How(Options):
    """With which noise, and under what."""

    seed: int | None = valued("N", "Seed of the sensors' noise (sensors without noise).", min=0)
    supervised: bool | None = supervised()


@grouped("step duration bottom_depth netcdf", out=Path("swimbladder-simulate"))
def simulate(
    vehicle: VehicleName,
    mission: Annotated[Path | None, _MISSION] = None,
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
        s = _run(v, given, how, water)
    to.answer(_shown(s, task, water, [*_notes(s, water, medium), *_seed_unused(v, how.seed)], also))


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


def _notes(s: Solution, column: Column | None, medium: Medium | None) -> list[Labelled]:
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


def _run(vehicle: Vehicle, task: dict[str, Any], how: How, column: Column | None) -> Solution:
    """Simulate a mission or a step; say on stderr what is waited for."""
    with progress("loading the simulator"):
        from swimbladder.sim.closed_loop import simulate as simulate_closed_loop

    floats = vehicle.command == "volume change"  # their tables take scipy.interpolate
    blas = contextlib.nullcontext() if floats else _no_search_for_blas()
    with working("simulating") as advance, blas:
        return simulate_closed_loop(
            vehicle,
            **task,
            seed=how.seed,
            cast=column,
            supervised=how.supervised,
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
