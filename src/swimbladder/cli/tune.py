"""``swimbladder tune``: gains for a vehicle, with margins over its 95 % parameter region."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.casts import CastFile, CastReading, DepthSensor, water_of_cast
from swimbladder.cli.common import compile_notice, json_text, output, progress, typed_command
from swimbladder.cli.options import Files, Options, grouped
from swimbladder.control.records import leaves

if TYPE_CHECKING:
    from swimbladder.design.tuning import Tuning


@dataclass(frozen=True)
class Design(Options):
    """What gains are sought."""

    law: Annotated[
        str | None,
        typer.Option(
            metavar="LAW",
            help="Name of a law (planned; of a pump and valve rate). "
            "docs/reference/vehicle-file.md has all; a wrong one lists them.",
        ),
    ] = None
    goal: Annotated[
        str,
        typer.Option(
            metavar="GOAL",
            help="fast: least settling time; quiet: least motion of the actuator; energy.",
        ),
    ] = "fast"
    depths: Annotated[
        str,
        typer.Option("--depth", metavar="LEAST:MOST", help="Range of depths of the design."),
    ] = "0:10 m"
    step: Annotated[
        str | None,
        typer.Option(metavar="FROM:TO", help="Step of the trials (1.5 m; of a float all depths)."),
    ] = None
    sample_time: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Sample time (the controller's)."),
    ] = None
    delay: Annotated[
        str,
        typer.Option(metavar="SHARE", help="Computation delay, as a share of the sample time."),
    ] = "10 %"
    supply: Annotated[
        str | None,
        typer.Option(metavar="VOLTAGE", help="Least supply (nine tenths of the vehicle's)."),
    ] = None
    hold: Annotated[
        str | None,
        typer.Option(
            metavar="DEPTH",
            help="Allowed holding error, rms (quiet 9.5 mm, energy 5 cm; of a float its band).",
        ),
    ] = None
    runs: Annotated[int, typer.Option(metavar="N", help="Runs of every trial.")] = 200


@grouped(out=Path("swimbladder-tune"))
def tune(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    *,
    design: Design,
    sensor: DepthSensor,
    cast: CastFile = None,
    reading: CastReading,
    to: Files,
) -> None:
    r"""Find gains of a law that meet the stability margins over the 95 % parameter region.

    The region follows from the covariance that `identify` writes, or is 5 % in K2 and T2 without
    one. Trials with sensor noise verify the gains; vehicle.toml holds the controller. Exit code 1:
    no gains meet the margins; the message names what limits them. With
    --cast the trials are in that water.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    v = sensor.on(load_vehicle(vehicle))
    options = design.read()
    reach = max(*options["depths"], *(options["step"] or ()))
    options["column"] = water_of_cast(reading.casts(cast), reach, v.hull.depth_limit)
    check_place(to.out)
    with progress("loading the simulator"):
        from swimbladder.design.tuning import tune as find
        from swimbladder.show.report.tune import write_tuning
    with compile_notice(), progress("searching gains", 1.0) as advance:
        found = find(v, **options, advance=advance)
    answer = found.to_json()
    with progress("writing the report"):
        files = write_tuning(found, to.out, answer=json_text(answer), command=typed_command())
    to.answer(answer, files, lambda: _print(found))


def _print(found: Tuning) -> None:
    from rich.table import Table

    from swimbladder.units import shown_unit, unit_factor

    output.print(
        f"{found.vehicle.name}, law {found.law.name}, goal {found.goal}, sampled every "
        f"{found.sample_time:g} s",
        soft_wrap=True,
    )
    output.print("")
    for sentence in found.sentences:
        output.print(sentence, soft_wrap=True)
    output.print("")
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for heading in ("parameter", "value", "unit"):
        table.add_column(heading, justify="right" if heading == "value" else "left")
    for name, value in leaves(found.parameters).items():
        unit = found.law.units[name]
        shown = shown_unit(unit)
        table.add_row(name, f"{float(value) * unit_factor(unit, shown):.5g}", shown)
    output.print(table)
    output.print("")
    for sentence in found.assumptions:
        output.print(f"assumed: {sentence}", soft_wrap=True)
