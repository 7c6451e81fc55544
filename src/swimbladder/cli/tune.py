"""``swimbladder tune``: gains for a vehicle, with margins over its 95 % parameter region."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import (
    CastFile,
    Columns,
    Inversions,
    Latitude,
    LogFormat,
    Longitude,
    Profile,
    Salinity,
    Where,
    asked_casts,
    water_of_cast,
)
from swimbladder.cli.common import (
    compile_notice,
    emit_json,
    json_text,
    output,
    progress,
    quantity,
    typed_command,
)
from swimbladder.cli.depths import depth_pair, with_sensor
from swimbladder.control.records import leaves

if TYPE_CHECKING:
    from swimbladder.design.tuning import Tuning

__all__ = ["tune"]


def tune(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    law: Annotated[
        str,
        typer.Option(
            metavar="LAW",
            help="Name of a law (docs/reference/vehicle-file.md has all; a wrong one lists them).",
        ),
    ] = "planned",
    goal: Annotated[
        str,
        typer.Option(
            metavar="GOAL",
            help="fast: least settling time; quiet: least motion of the actuator; energy.",
        ),
    ] = "fast",
    depth: Annotated[
        str, typer.Option("--depth", metavar="LEAST:MOST", help="Range of depths of the design.")
    ] = "0:10 m",
    step: Annotated[
        str | None, typer.Option(metavar="FROM:TO", help="Step of the trials (1.5 m).")
    ] = None,
    depth_noise: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help="Depth noise, 1 sigma (the vehicle's sensor)."),
    ] = None,
    depth_quantum: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help="Quantum of the depth sensor (the vehicle's)."),
    ] = None,
    sample_time: Annotated[
        str | None, typer.Option(metavar="TIME", help="Sample time (the controller's).")
    ] = None,
    delay: Annotated[
        str, typer.Option(metavar="SHARE", help="Computation delay, as a share of the sample time.")
    ] = "10 %",
    supply: Annotated[
        str | None,
        typer.Option(metavar="VOLTAGE", help="Least supply (nine tenths of the vehicle's)."),
    ] = None,
    hold: Annotated[
        str | None,
        typer.Option(
            metavar="DEPTH", help="Allowed holding error, rms (quiet 9.5 mm, energy 5 cm)."
        ),
    ] = None,
    runs: Annotated[int, typer.Option(metavar="N", help="Runs of every trial.")] = 200,
    cast: CastFile = None,
    column: Columns = None,
    where: Where = None,
    log_format: LogFormat = None,
    profile: Profile = None,
    latitude: Latitude = None,
    longitude: Longitude = None,
    salinity: Salinity = None,
    inversions: Inversions = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "swimbladder-tune"
    ),
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    r"""Find gains of a law that meet the stability margins over the 95 % parameter region.

    The region follows from the covariance that `identify` writes, or is 5 % in K2 and T2 without
    one. Trials with sensor noise verify the gains; vehicle.toml holds the controller. Exit code 1:
    no gains meet the margins; the message names what limits them. With
    --cast the trials are in that water.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    v = with_sensor(load_vehicle(vehicle, sampled=True), depth_noise, depth_quantum)
    options: dict[str, Any] = {
        "law": law,
        "goal": goal,
        "depths": depth_pair(depth, "--depth"),
        "step": None if step is None else depth_pair(step, "--step"),
        "sample_time": quantity(sample_time, "s", "--sample-time"),
        "delay": quantity(delay, "", "--delay"),
        "supply": quantity(supply, "V", "--supply"),
        "hold": quantity(hold, "m", "--hold"),
        "runs": runs,
    }
    casts = asked_casts(
        [] if cast is None else [cast], column=column, where=where, log_format=log_format,
        profile=profile, latitude=latitude, longitude=longitude, salinity=salinity,
        inversions=inversions,
    )  # fmt: skip
    reach = max(*options["depths"], *(options["step"] or ()))
    options["column"] = water_of_cast(casts, reach, v.hull.depth_limit)
    check_place(out)
    with progress("loading the simulator"):
        from swimbladder.design.tuning import tune as find
        from swimbladder.show.report.tune import write_tuning
    with compile_notice(), progress("searching gains", 1.0) as advance:
        found = find(v, **options, advance=advance)
    answer = found.to_json()
    with progress("writing the report"):
        files = write_tuning(found, out, answer=json_text(answer), command=typed_command())
    if json:
        emit_json({**answer, "files": [str(path) for path in files]})
    else:
        _print(found, files)


def _print(found: Tuning, files: list[Path]) -> None:
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
    for path in files:
        output.print(f"wrote {path}", soft_wrap=True)
