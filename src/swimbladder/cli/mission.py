"""``swimbladder mission``: phases in repeated cycles, in the water of a cast."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.casts import CastFile, CastReading, warn_of_mass
from swimbladder.cli.common import (
    aside,
    asked_of,
    compile_notice,
    kept,
    labelled,
    progress,
    table,
    typed_command,
)
from swimbladder.cli.options import (
    Files,
    Options,
    VehicleName,
    flag,
    grouped,
    valued,
    watched,
)
from swimbladder.cli.texts import Given
from swimbladder.errors import SwimbladderError

if TYPE_CHECKING:
    from swimbladder.physics.seawater import Cast
    from swimbladder.sim.mission.result import MissionResult


@dataclass(frozen=True)
class Flown(Options):
    """How a mission is flown."""

    cycles: int | None = valued("N", "Cycles (as in the mission).", min=1)
    duration: Given = valued("TIME", "No cycle begins after this time.")
    bottom: Given = valued("DEPTH", "Depth of the bottom (as in the mission).")
    seed: int | None = valued(None, "Seed of the sensors' noise (no noise).", min=0)
    supervised: bool = watched()
    begin: Given = valued("DATE", "Start, ISO 8601, for netCDF (none).")


@dataclass(frozen=True)
class Also(Options):
    """What else is written."""

    netcdf: bool = flag("--netcdf", "Also write mission.nc (OG1).")
    plot: bool = flag("--plot", "Also write mission.png.")
    config: bool = flag("--config", "Also write argo-config.json, by Argo's CONFIG_ names.")


_MISSION = typer.Argument(metavar="MISSION", help="TOML file with phases and cycles.")


@grouped("cycles duration bottom netcdf", out=Path("swimbladder-mission"))
def mission(
    vehicle: VehicleName,
    mission: Annotated[Path, _MISSION],
    cast: CastFile = None,
    *,
    how: Flown,
    reading: CastReading,
    to: Files,
    also: Also,
) -> None:
    r"""Simulate a mission of phases and cycles: depth, time, pump, battery.

    Without --cast the water is that of the vehicle's file, of constant density.

    Exit code 1: it cannot be met (no file is written) or was not.

    A run that is killed resumes.
    """
    from swimbladder.io.config import load_mission, load_vehicle
    from swimbladder.io.files import unfinished

    v, task = load_vehicle(vehicle, weighed=True), load_mission(mission)
    asked = how.read()
    begin, bottom = asked.pop("begin"), asked.pop("bottom")
    cycles, span = asked.pop("cycles"), asked.pop("duration")
    to.check()
    if also.netcdf and begin is not None:
        from swimbladder.sim.mission.og1 import og1_time

        og1_time(begin)
    keep = unfinished(to.out)
    read = next(iter(reading.casts(cast, task.latitude)), None)
    warn_of_mass(v)
    more: dict[str, object] = {}
    with asked_of(mission, task, duration=how.duration):
        with progress("loading the simulator"):
            from swimbladder.sim.mission.export import argo_configuration
            from swimbladder.sim.mission.orders import flown_laws
            from swimbladder.sim.mission.prepare import cost_words
            from swimbladder.sim.mission.run import mission as fly

        task = (task if bottom is None else task.over(bottom)).limited(cycles=cycles, duration=span)
        if also.config:
            more["argo-config.json"] = argo_configuration(v, task)
        with suppress(SwimbladderError):  # the flight raises it, after what is to be checked first
            aside(*cost_words(task, flown_laws(v, task, asked["supervised"])[0]))
        with kept(keep), compile_notice(), progress("flying", 1.0) as advance:
            found = fly(v, task, read, **asked, keep=keep, advance=advance)
    answer = found.to_dict()
    with progress("writing the files"):
        from swimbladder.show.answers import with_page
        from swimbladder.show.files import Gone, write_all
        from swimbladder.show.report.mission import mission_files

        made = mission_files(found, answer, begin=begin) | _also(found, read, begin, also)
        made = {**made, "argo-config.json": Gone(), **more}
        files = write_all(to.out, with_page(found, answer, made, typed_command()))
    to.answer(answer, _shown(found, read), files, good=found.completed, keep=keep)


def _also(
    found: MissionResult, cast: Cast | None, begin: datetime.datetime | None, also: Also
) -> dict[str, object]:
    """Return what is written beside the files of the answer; what is not asked for goes."""
    from swimbladder.io.netcdf import write_netcdf
    from swimbladder.show.files import Gone

    files: dict[str, object] = dict.fromkeys(("mission.nc", "mission.png"), Gone())
    if also.netcdf:
        place = {} if cast is None else {"latitude": cast.latitude, "longitude": cast.longitude}
        data = found.dataset(begin=begin, **place)
        files["mission.nc"] = partial(write_netcdf, dataset=data)
    if also.plot:
        files["mission.png"] = found.plot()
    return files


def _shown(found: MissionResult, cast: Cast | None) -> Iterator[object]:
    """Give what is printed: the answer, its reasons, the cycles, the energy."""
    from swimbladder.sim.mission.phase_laws import law_words
    from swimbladder.sim.mission.tables import cycle_words
    from swimbladder.sim.mission.words import span_words

    flight = found.flight
    count = len(flight.cycles)
    cycles = f"{count} cycle{'s' if count > 1 else ''}, {span_words(flight.duration)}"
    yield f"{flight.vehicle.name} in {flight.column.source or 'the given water'}: {cycles}"
    yield from (found.sentence, *found.reasons, *found.notes, *found.holding)
    yield from law_words(found.laws)
    heading, *lines = cycle_words(found)
    yield table(heading, lines, left=())
    if len(lines) < count:
        yield f"({count - len(lines)} cycles more in cycles.csv)"
    if found.energy_known:
        total = found.books.drawn
        for name, energy in sorted(found.books.battery.items(), key=lambda pair: -pair[1]):
            share = 100.0 * energy / total if total > 0.0 else 0.0
            yield f"{name}: {energy / 1e3:.4g} kJ, {share:.0f} %"
    yield from labelled("cast", () if cast is None else flight.column.report)
