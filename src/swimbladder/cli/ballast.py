"""``swimbladder ballast``: what to add, and whether the stroke does, in the sea of a cast."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import CastReading, refuse_doubted_unit
from swimbladder.cli.common import json_text, output, progress
from swimbladder.cli.options import Files, Options, grouped

if TYPE_CHECKING:
    from swimbladder.design.ballast import Ballasting
    from swimbladder.vehicle import Vehicle


@dataclass(frozen=True)
class Targets(Options):
    """What the ballast is to bring about, as a `Target` has it."""

    neutral_depth: Annotated[
        str | None, typer.Option(metavar="DEPTH", help="Find the mass to be neutral there.")
    ] = None
    volume: Annotated[
        str | None,
        typer.Option("--at-volume", metavar="VOLUME", help="Of the drive, to be neutral with (0)."),
    ] = None
    freeboard: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Hull out of the water, at full volume.")
    ] = None


@dataclass(frozen=True)
class Task(Options):
    """Where it is to go, how sure that has to be, and with what."""

    deepest: Annotated[
        str | None, typer.Option(metavar="DEPTH", help="To go to (the rating, or the cast's end).")
    ] = None
    speed: Annotated[
        str, typer.Option(metavar="SPEED", help="To sink and rise with, everywhere.")
    ] = "0 m/s"
    probability: Annotated[
        str, typer.Option(metavar="SHARE", help="With which the stroke has to do.")
    ] = "95 %"
    material: Annotated[
        str,
        typer.Option("--ballast", metavar="WHAT", help="lead, steel, ..., a density, or inside."),
    ] = "lead"
    mass: Annotated[
        str | None, typer.Option(metavar="MASS", help="On the scale (that of trim_error).")
    ] = None


@dataclass(frozen=True)
class Stds(Options):
    """What is not known, 1 sigma, as an `Uncertainty` has it."""

    mass: Annotated[
        str | None, typer.Option("--mass-std", metavar="MASS", help="1 sigma of the mass.")
    ] = None
    volume: Annotated[
        str | None,
        typer.Option("--volume-std", metavar="VOLUME", help="1 sigma of the hull's volume."),
    ] = None
    trim: Annotated[
        str | None,
        typer.Option("--trim-std", metavar="VOLUME", help="1 sigma of the neutral volume."),
    ] = None
    psi: Annotated[
        str | None,
        typer.Option("--psi-std", metavar="PSI", help="1 sigma of psi, the hull's compression."),
    ] = None
    heat: Annotated[
        str | None,
        typer.Option("--heat-std", metavar="1/K", help="1 sigma of the thermal expansion."),
    ] = None
    air: Annotated[
        str | None, typer.Option("--air-std", metavar="VOLUME", help="1 sigma of the trapped air.")
    ] = None
    density: Annotated[
        str | None,
        typer.Option("--density-std", metavar="DENSITY", help="1 sigma of the sea's density."),
    ] = None


@grouped(out=Path("swimbladder-ballast"))
def ballast(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    cast: Annotated[
        list[Path] | None,
        typer.Option("--cast", metavar="CTD", help="Cast: CSV, netCDF, Argo; several: all count."),
    ] = None,
    *,
    target: Targets,
    task: Task,
    stds: Stds,
    reading: CastReading,
    to: Files,
) -> None:
    r"""Find the ballast of a vehicle in a real sea, and whether its stroke is enough.

    Without --cast the water is that of the vehicle's file, of constant density. Exit code 1 says
    that the stroke does not cover it with that probability, what is short and by how much.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    v = load_vehicle(vehicle, weighed=True)
    given, sought = stds.read(), target.given()
    asked = task.read()
    check_place(to.out)
    casts = reading.casts(cast)

    from swimbladder.design.ballast import Target, material_of, seas, uncertainty_of, with_mass
    from swimbladder.design.ballast import ballast as find
    from swimbladder.show.report.ballast import write_ballasting

    with task.said_as_typed():
        density, named = material_of(task.material)
        refuse_doubted_unit(casts, asked["deepest"], v.hull.depth_limit)
        sea = seas(v, casts, asked["deepest"])
        v, told, more = with_mass(v, asked["mass"])
    warned = [*sea.warnings, *more]
    with stds.said_as_typed():
        uncertainty = uncertainty_of(v, given)
    with progress("drawing vehicles", 1.0) as advance, task.said_as_typed(), target.said_as_typed():
        found = find(
            v, sea.columns, target=Target(**sought), uncertainty=uncertainty,
            probability=asked["probability"], speed=asked["speed"], density=density, material=named,
            assumptions=(*warned, *sea.assumed, told, *_hull_words(v), *uncertainty.said),
            advance=advance,
        )  # fmt: skip
    answer = found.to_json()
    with progress("drawing the picture"):
        files = write_ballasting(found, to.out, answer=json_text(answer))
    to.answer(answer, files, lambda: _print(found, warned))
    if not found.covered:
        raise typer.Exit(1)


def _hull_words(vehicle: Vehicle) -> list[str]:
    """Return what is reckoned with of the hull."""
    if vehicle.hull.parts:
        return [f"the hull is {', '.join(part.name for part in vehicle.hull.parts)}"]
    return [
        "the hull is one part whose compression is that of psi, and its thermal expansion is not "
        "known and taken as 0; [[hull.parts]] would tell"
    ]


def _print(found: Ballasting, warned: list[str]) -> None:
    seas = ", ".join(column.source for column in found.columns)
    output.print(f"{found.vehicle.name} in {seas}", soft_wrap=True)
    for sentence in warned:
        output.print(f"warning: {sentence}", soft_wrap=True)
    output.print("")
    for sentence in found.sentences:
        output.print(sentence, soft_wrap=True)
    output.print("")
    spread: dict[str, Any] = {k: v for k, v in found.spread.items() if v > 0.0}
    if spread:
        parts = ", ".join(f"{name} {1e6 * value:.2g}" for name, value in spread.items())
        output.print(f"1 sigma of the neutral volume at the deepest, cm3: {parts}", soft_wrap=True)
    for sentence in found.assumptions[len(warned) :]:
        output.print(f"assumed: {sentence}", soft_wrap=True)
