"""``swimbladder vehicle``: the presets, what is in a vehicle file, and a file to start from."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from swimbladder.cli.common import console, typed_command
from swimbladder.cli.options import Files, Printed, grouped
from swimbladder.errors import InputError, check_number
from swimbladder.show.parts import Table
from swimbladder.show.text import rich_table
from swimbladder.units import quantity

vehicle = typer.Typer(no_args_is_help=True)


@vehicle.command("list")
@grouped()
def list_presets(*, to: Printed) -> None:
    """List the vehicles that come with swimbladder."""
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.presets import preset_names

    found = [(name, load_vehicle(name)) for name in preset_names()]
    rows = [(name, v.actuator.kind, v.description) for name, v in found]
    keys = ("name", "kind", "description")
    headings = ("name", "actuator", "description")
    listed = Table(headings, rows, left=headings)
    to.show({"vehicles": [dict(zip(keys, row, strict=True)) for row in rows]}, [listed])


@vehicle.command()
@grouped(out=None)
def show(
    name: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    *,
    to: Files,
) -> None:
    """Say what follows from a vehicle's numbers; with --full print its file, to keep and edit."""
    from swimbladder.io.config import load_vehicle, vehicle_text
    from swimbladder.show.vehicle import VehicleShown

    made, text = VehicleShown(load_vehicle(name)), vehicle_text(name)
    files = []
    if to.out is not None:
        from swimbladder.show.answers import write

        files = write(made, to.out, typed_command())
    if to.full and not to.json:
        console.print(rich_table(made.follows), *to.wrote(files), "", sep="\n")
        sys.stdout.write(text)
        return
    lines = f"its file, of {len(text.splitlines())} lines: --full"
    answer = {**made.numbers(), "files": [str(path) for path in files]}
    to.show(answer, [made.head, made.follows], [lines, *to.wrote(files)])


_PISTON = typer.Option(metavar="LENGTH", help='Diameter of the piston: "60 mm".')
_STROKE = typer.Option(metavar="LENGTH", help='Travel of the piston: "100 mm".')
_PATH = typer.Argument(metavar="FILE", help="Where to write; KIND.toml by default.")


@vehicle.command()
@grouped()
def new(
    path: Annotated[Path | None, _PATH] = None,
    kind: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            help="Actuator: electromechanical or electrohydraulic (from datasheets), identified, "
            "unified, positioner, or pump-valve (a deep float's).",
        ),
    ] = "electromechanical",
    piston_diameter: Annotated[str | None, _PISTON] = None,
    piston_stroke: Annotated[str | None, _STROKE] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file.")] = False,
    *,
    to: Printed,
) -> None:
    """Write a short vehicle file to start from; with --full one of every field and default."""
    from swimbladder.io.files import there, write_atomically
    from swimbladder.io.templates import KINDS, vehicle_start, vehicle_template
    from swimbladder.vehicle.schema import did_you_mean

    if kind not in KINDS:
        why, remedy = "there is no such kind of actuator", f"Kinds: {', '.join(KINDS)}"
        remedy = f"{did_you_mean(kind, KINDS)}{remedy}"
        raise InputError(why, field="--kind", value=kind, remedy=remedy)
    target = path if path is not None else Path(f"{kind}.toml")
    if there(target) and not force:
        remedy = "Choose another name, or overwrite it with --force"
        raise InputError("the file exists already", file=target, field="FILE", remedy=remedy)
    size = {"diameter": piston_diameter, "stroke": piston_stroke}
    given = {
        f"piston_{one}": quantity(x, "m", f"--piston-{one}")
        for one, x in size.items()
        if x is not None
    }
    for one, length in given.items():
        check_number(length, one, "m", above=0.0, most=10.0)
    short = vehicle_start(kind, target.stem, **given)
    write_atomically(target, vehicle_template(kind, name=target.stem) if to.full else short)
    then = [f"wrote {target}: put in your numbers, then", f"  swimbladder simulate {target}"]
    to.show({"kind": kind, "files": [target]}, then)


_CHANGES = typer.Argument(metavar="FIELD=VALUE...", help='Fields: motion.K2=6500 "motion.T2=42 s".')
_FILE = typer.Option(metavar="FILE", help="File to write.")


@vehicle.command("set")
@grouped()
def set_fields(
    name: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    changes: Annotated[list[str], _CHANGES],
    file: Annotated[Path | None, _FILE] = None,
    *,
    to: Printed,
) -> None:
    """Write a vehicle with other values of some fields: a number is in SI."""
    from swimbladder.cli.texts import pairs
    from swimbladder.io.config import check_vehicle, load_vehicle
    from swimbladder.io.vehicle_file import save_vehicle, vehicle_file
    from swimbladder.show.vehicle import fields_of

    before = load_vehicle(name)
    found = before.replace(pairs(changes, "vehicle set VEHICLE"))
    check_vehicle(found)
    if to.full and not to.json:
        sys.stdout.write(vehicle_file(found))
    files = [] if file is None else [save_vehicle(found, file)]
    old, new = fields_of(before), fields_of(found)
    was = {field: {"before": old.get(field, {}).get("value")} for field in new}
    changed = {field: was[field] | x for field, x in new.items() if x != old.get(field)}
    said = [f"{f}: {x['before']} to {x['value']} {x['unit']}".rstrip() for f, x in changed.items()]
    end = f"wrote {file}" if file else "nothing is written: --file FILE writes it, --full prints it"
    if to.json or not to.full:
        to.show({"changed": changed, "files": files}, said, [end])
