"""``swimbladder mission``: phases in repeated cycles, in the water of a cast."""

from __future__ import annotations

import datetime
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import CastFile, CastReading, refuse_doubted_unit, warn_of_mass
from swimbladder.cli.common import asked_of, compile_notice, json_text, kept, output, progress
from swimbladder.cli.options import Files, Options, Read, grouped
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.io.mission import Mission
    from swimbladder.physics.seawater import Cast, Column
    from swimbladder.sim.mission.result import MissionResult
    from swimbladder.vehicle import Vehicle

_MARGIN = 1.1  # of the deepest phase: how far down the vehicle's own water is tabulated, and
_BELOW = 50.0  # m more
_BEGIN = datetime.datetime(2000, 1, 1, tzinfo=datetime.UTC)  # where the user does not say


def _moment(text: str, option: str) -> datetime.datetime:
    try:
        found = datetime.datetime.fromisoformat(text)
    except ValueError:
        raise InputError(
            "this is no time", field=option, value=text, remedy="Write 2026-03-01T12:00:00Z"
        ) from None
    return found if found.tzinfo else found.replace(tzinfo=datetime.UTC)


@dataclass(frozen=True)
class Flown(Options):
    """How a mission is flown."""

    cycles: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Cycles (as in the mission).")
    ] = None
    duration: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="No cycle begins after this time."),
    ] = None
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the sensors' noise (no noise).")
    ] = None
    begin: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Start, ISO 8601, for netCDF (2000-01-01)."),
        Read(_moment),
    ] = None


@grouped(out=Path("swimbladder-mission"))
def mission(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    mission: Annotated[
        Path, typer.Argument(metavar="MISSION", help="TOML file with phases and cycles.")
    ],
    cast: CastFile = None,
    *,
    how: Flown,
    reading: CastReading,
    to: Files,
    netcdf: Annotated[bool, typer.Option("--netcdf", help="Also write mission.nc (OG1).")] = False,
    plot: Annotated[bool, typer.Option("--plot", help="Also write mission.png.")] = False,
) -> None:
    r"""Simulate a mission of phases and cycles: depth, time, pump, battery.

    Without --cast the water is that of the vehicle's file, of constant density.

    Exit code 1: it cannot be met (reported before flying where physics determines it) or was not.

    A run that is killed resumes.
    """
    from swimbladder.io.config import load_mission, load_vehicle
    from swimbladder.io.files import check_place, unfinished

    v, task = load_vehicle(vehicle, weighed=True), load_mission(mission)
    asked = how.read()
    begin = asked.pop("begin") or _BEGIN
    check_place(to.out)
    keep = unfinished(to.out)
    read = next(iter(reading.casts(cast, task.latitude)), None)
    warn_of_mass(v)
    with asked_of(mission, task, duration=how.duration):
        found = _fly(v, task, water(v, task, read), keep, asked)
    answer = found.to_json()
    with progress("writing the files"):
        files = _write(found, to.out, answer, read, begin, netcdf=netcdf, plot=plot)
    shutil.rmtree(keep, ignore_errors=True)
    to.answer(answer, files, lambda: _print(found, read))
    if not found.completed:
        raise typer.Exit(1)


def water(vehicle: Vehicle, task: Mission, cast: Cast | None) -> Column:
    """Return the water of a cast, or the vehicle's own, as deep as a mission goes."""
    from swimbladder.physics.seawater import cast_column, uniform_column

    deepest = max([task.start_depth, *(p.depth for p in task.phases if p.depth is not None)])
    if cast is None:
        if task.latitude is not None:
            raise InputError(
                "it says where a cast was taken, and there is none", field="latitude",
                value=task.latitude, unit="deg", remedy="Give --cast, or leave it out",
            )  # fmt: skip
        return uniform_column(vehicle.water, _MARGIN * deepest + _BELOW)
    refuse_doubted_unit([cast], deepest, vehicle.hull.depth_limit)
    with progress("tabulating the water"):
        return cast_column(cast)


def _fly(
    vehicle: Vehicle, task: Mission, column: Column, keep: Path, asked: dict[str, Any]
) -> MissionResult:
    with progress("loading the simulator"):
        from swimbladder.sim.mission.flight import fly_mission
        from swimbladder.sim.mission.result import MissionResult

    with kept(keep), compile_notice(), progress("flying", 1.0) as advance:
        flown = fly_mission(
            vehicle, task, column, cycles=asked["cycles"], span=asked["duration"],
            seed=asked["seed"], keep=keep, advance=advance,
        )  # fmt: skip
    return MissionResult(flown, flown.reach)


def _write(
    found: MissionResult, out: Path, answer: dict[str, Any], cast: Cast | None,
    begin: datetime.datetime, *, netcdf: bool, plot: bool,
) -> list[Path]:  # fmt: skip
    """Write the files, take away those of an earlier flight, and return their paths."""
    from swimbladder.io.files import publish, write_atomically
    from swimbladder.io.tables import write_csv
    from swimbladder.sim.mission.export import float_configuration
    from swimbladder.sim.mission.og1 import og1_dataset, write_og1
    from swimbladder.sim.mission.tables import cycle_columns, events_csv, speeds, trajectory_columns

    names = ["mission.json", "trajectory.csv", "events.csv", "cycles.csv", "vertical-speed.csv"]
    names += ["float.json"] + ["mission.nc"] * netcdf + ["mission.png"] * plot

    def write(folder: Path) -> None:
        write_atomically(folder / "mission.json", json_text(answer) + "\n")
        write_csv(folder / "trajectory.csv", trajectory_columns(found))
        write_atomically(folder / "events.csv", events_csv(found.flight))
        write_csv(folder / "cycles.csv", cycle_columns(found))
        write_csv(folder / "vertical-speed.csv", speeds(found.flight))
        write_atomically(
            folder / "float.json", json_text(float_configuration(found, begin=begin)) + "\n"
        )
        if netcdf:
            data = og1_dataset(
                found, begin=begin,
                latitude=None if cast is None else cast.latitude,
                longitude=None if cast is None else cast.longitude,
            )  # fmt: skip
            write_og1(data, folder / "mission.nc")
        if plot:
            from swimbladder.show.plots.mission import draw_mission
            from swimbladder.show.plots.style import save

            save(draw_mission(found), folder / "mission.png")

    publish(out, write)
    for name in sorted({"mission.nc", "mission.png"} - set(names)):
        (out / name).unlink(missing_ok=True)  # those of another flight
    return [out / name for name in names]


def _print(found: MissionResult, cast: Cast | None) -> None:
    from rich.table import Table

    from swimbladder.sim.mission.phase_laws import law_words
    from swimbladder.sim.mission.tables import cycle_words
    from swimbladder.sim.mission.words import span_words

    flight = found.flight
    output.print(
        f"{flight.vehicle.name} in {flight.column.source or 'the given water'}: "
        f"{len(flight.cycles)} cycle{'s' if len(flight.cycles) > 1 else ''}, "
        f"{span_words(flight.duration)}",
        soft_wrap=True,
    )
    for line in law_words(found.laws):
        output.print(line, soft_wrap=True)
    for remark in () if cast is None else flight.column.report:
        output.print(f"cast: {remark}", soft_wrap=True)
    output.print("")
    output.print(found.sentence, soft_wrap=True)
    for line in (*found.holding, *found.reasons, *found.notes):
        output.print(line, soft_wrap=True)
    output.print("")
    heading, *lines = cycle_words(found)
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for name in heading:
        table.add_column(name, justify="right", no_wrap=True)
    for row in lines:
        table.add_row(*row)
    output.print(table)
    if len(lines) < len(flight.cycles):
        output.print(f"({len(flight.cycles) - len(lines)} cycles more in cycles.csv)")
    if found.energy_known:
        output.print("")
        total = found.books.drawn
        for name, energy in sorted(found.books.battery.items(), key=lambda pair: -pair[1]):
            share = 100.0 * energy / total if total > 0.0 else 0.0
            output.print(f"{name}: {energy / 1e3:.4g} kJ, {share:.0f} %", soft_wrap=True)
