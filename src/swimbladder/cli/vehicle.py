"""``swimbladder vehicle``: the presets, what is in a vehicle file, and a file to start from."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.common import console, quantity
from swimbladder.cli.options import Printed, grouped
from swimbladder.errors import InputError, check_number
from swimbladder.show.parts import Table
from swimbladder.show.text import rich_table

if TYPE_CHECKING:
    from swimbladder.vehicle import Vehicle

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
@grouped()
def show(
    name: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    *,
    to: Printed,
) -> None:
    """Say what follows from a vehicle's numbers; with --full print its file, to keep and edit."""
    from swimbladder.io.config import load_vehicle, vehicle_text

    v = load_vehicle(name)
    derived, text = _derived(v), vehicle_text(name)
    rows = [
        (meaning, "" if value is None else f"{value:.6g}", unit)
        for value, unit, meaning in derived.values()
    ]
    headings = (f"follows from the numbers of {v.name}", "", " ")
    follows = Table(headings, rows, left=(headings[0], " "))
    if to.full and not to.json:
        console.print(rich_table(follows), "", sep="\n")
        sys.stdout.write(text)
        return
    keys = ("value", "unit", "meaning")
    numbers = {name: dict(zip(keys, row, strict=True)) for name, row in derived.items()}
    said = {"name": v.name, "kind": v.actuator.kind, "description": v.description}
    answer = {**said, "parameters": _parameters(v), "derived": numbers, "provenance": v.provenance}
    file = f"its file, of {len(text.splitlines())} lines: --full"
    to.show(answer, [f"{v.name}, {v.actuator.kind}: {v.description}", follows], [file])


_PISTON = typer.Option(metavar="DIAMETER", help='Diameter of the piston: "60 mm".')
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
    piston: Annotated[str | None, _PISTON] = None,
    stroke: Annotated[str | None, _STROKE] = None,
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
    size = {"piston": piston, "stroke": stroke}
    given = {one: quantity(x, "m", f"--{one}") for one, x in size.items() if x is not None}
    for one, length in given.items():
        check_number(length, one, "m", above=0.0, most=10.0)
    short = vehicle_start(kind, target.stem, **given)
    write_atomically(target, vehicle_template(kind, name=target.stem) if to.full else short)
    then = [f"wrote {target}: put in your numbers, then", f"  swimbladder simulate {target}"]
    to.show({"kind": kind, "files": [target]}, then)


_CHANGES = typer.Argument(metavar="FIELD=VALUE...", help='Fields: motion.K2=6500 "motion.T2=42 s".')
_OUT = typer.Option("--out", metavar="FILE", help="File to write.")


@vehicle.command("set")
@grouped()
def set_fields(
    name: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    changes: Annotated[list[str], _CHANGES],
    out: Annotated[Path | None, _OUT] = None,
    *,
    to: Printed,
) -> None:
    """Write a vehicle with other values of some fields: a number is in SI."""
    from swimbladder.cli.texts import pairs
    from swimbladder.io.config import check_vehicle, load_vehicle
    from swimbladder.io.vehicle_file import save_vehicle, vehicle_file

    before = load_vehicle(name)
    found = before.replace(pairs(changes, "vehicle set VEHICLE"))
    check_vehicle(found)
    if to.full and not to.json:
        sys.stdout.write(vehicle_file(found))
    files = [] if out is None else [save_vehicle(found, out)]
    old, new = _parameters(before), _parameters(found)
    was = {field: {"before": old.get(field, {}).get("value")} for field in new}
    changed = {field: was[field] | x for field, x in new.items() if x != old.get(field)}
    said = [f"{f}: {x['before']} to {x['value']} {x['unit']}".rstrip() for f, x in changed.items()]
    end = f"wrote {out}" if out else "nothing is written: --out FILE writes it, --full prints it"
    if to.json or not to.full:
        to.show({"changed": changed, "files": files}, said, [end])


def _parameters(v: Vehicle) -> dict[str, dict[str, Any]]:
    """Return every number of a vehicle in SI as {dotted field: {value, unit}}."""
    from pydantic import BaseModel

    from swimbladder.control.registry import bind
    from swimbladder.vehicle import field_unit
    from swimbladder.vehicle.schema import dotted

    found: dict[str, dict[str, Any]] = {}

    def walk(model: BaseModel, path: tuple[str | int, ...]) -> None:
        for name in type(model).model_fields:
            value = getattr(model, name)
            if isinstance(value, BaseModel):
                walk(value, (*path, name))
            elif isinstance(value, tuple) and any(isinstance(x, BaseModel) for x in value):
                for number, part in enumerate(value):
                    walk(part, (*path, name, number))
            elif isinstance(value, dict) or value is None or not path:
                continue
            else:
                unit = field_unit(type(model), name)
                found[dotted((*path, name))] = {"value": value, "unit": unit}

    walk(v, ())
    found["trim_error"] = {"value": v.trim_error, "unit": "m3"}
    if v.controller is not None:
        law, numbers = bind(v.controller)
        for name in v.controller.parameters:
            place = dotted(("controller", "parameters", name))
            found[place] = {"value": getattr(numbers, name), "unit": law.units[name]}
    return found


def _derived(v: Vehicle) -> dict[str, tuple[float | None, str, str]]:
    """Return what follows from a vehicle's numbers, as {name: (value, unit, meaning)}."""
    from swimbladder.physics.actuator import reduced
    from swimbladder.vehicle import Positioner, PumpAndValve

    stroke, psi, drag = v.stroke, v.hull.psi, v.drag
    rows: dict[str, tuple[float | None, str, str]]
    rows = {"mass_kg": (v.mass, "kg", "mass that is accelerated")}
    rate_of: tuple[float, str] | None = None
    if isinstance(v.engine, Positioner):
        rate_of = v.engine.speed * v.engine.piston_area, "of the positioner"
    elif isinstance(v.engine, PumpAndValve):
        from swimbladder.physics.buoyancy_engine import drive_map

        rate_of = float(drive_map(v, 0.0).rate_out[0]), "of the pump at the surface"
    else:
        a = reduced(v.engine, v.water)
        rows |= {
            "K1A_m3_s_V": (a.gain, "m3/s/V", "volume rate per volt, K1 A"),
            "T1_s": (a.T1, "s", "time constant of the motor, T1"),
            "load_V_m": (a.load_drive, "V/m", "voltage that holds a metre of water, k_z/k_u"),
            "k_l_m2_s": (a.k_l, "m2/s", "leakage, k_l"),
        }
        if v.supply is not None:
            rate_of = a.gain * v.supply.voltage, "at the surface, full supply"
    if rate_of is not None:
        rows["volume_rate_m3_s"] = rate_of[0], "m3/s", f"volume rate {rate_of[1]}"
    if drag.k_dl > 0.0:
        gain, time = v.water.specific_weight / drag.k_dl, v.mass / drag.k_dl
        rows["K2_1_m2_s"] = gain, "1/m2/s", "speed per volume at low speed, K2"
        rows["T2_s"] = time, "s", "time constant of the motion, T2"
    rows["neutral_volume_surface_m3"] = v.neutral_volume(0.0), "m3", "neutral at the surface"
    limit = v.hull.depth_limit
    if limit is not None:
        meaning = f"neutral at {limit:g} m, its rating"
        rows["neutral_volume_limit_m3"] = v.neutral_volume(limit), "m3", meaning
    end = stroke.maximum if psi > 0.0 else stroke.minimum
    deepest = (end - v.trim_error) / psi if psi != 0.0 else None
    rows["neutral_depth_limit_m"] = deepest, "m", "depth to which the stroke reaches neutral"
    return rows
