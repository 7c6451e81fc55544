"""``swimbladder vehicle``: the presets, what is in a vehicle file, and a file to start from.

``swimbladder size``: which pump or screw, motor, stroke and battery do a dive.

``swimbladder ballast``: what to add, and whether the stroke does, in the sea of a cast.

``swimbladder energy``: joules per millilitre over depth, against a thruster, from runs.

``--fit`` finds a pump's power law and delivery from logged runs.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import console, progress, typed_command
from swimbladder.cli.options import (
    AnyVehicle,
    Files,
    Given,
    Options,
    Printed,
    Several,
    VehicleName,
    grouped,
    loaded,
    pairs,
    valued,
)
from swimbladder.cli.reading import NO_CAST, CastReading, Casts, refuse_doubted_unit
from swimbladder.errors import InputError, check_number
from swimbladder.show.parts import Table
from swimbladder.show.text import rich_table
from swimbladder.units import quantity

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
    from swimbladder.io.vehicle_file import KINDS, vehicle_start, vehicle_template
    from swimbladder.vehicle.schema import check_choice

    check_choice(kind, KINDS, "there is no such kind of actuator", field="--kind")
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


class Dives(Options):
    """The dive, as `design.sizing.Dive` has it."""

    max_depth: str = valued("DEPTH", "Greatest depth.", "1000 m")
    speed: str = valued("SPEED", "Vertical speed.", "0.1 m/s")
    turn_time: str = valued("TIME", "Longest time from sinking to rising at the depth.", "10 min")
    trim_std: str = valued("VOLUME", "1 sigma of the neutral volume.", "20 cm3")
    probability: str = valued("SHARE", "Probability that the stroke suffices.", "95 %")
    antenna_volume: str = valued("VOLUME", "Volume that lifts the antenna.", "0 cm3")
    stroke_reserve: str = valued("SHARE", "Reserve of the stroke.", "10 %")
    cycles: int = valued("N", "Cycles on one battery.", 200)
    park_time: str = valued("TIME", "Time at the depth per cycle.", "0 s")
    hotel: str = valued("POWER", "Power of everything but the drive.", "20 mW")
    surface_energy: str = valued("ENERGY", "Energy for fix and telemetry per cycle.", "0 J")
    corrections: str = valued("SHARE", "Added way and energy of corrections.", "20 %")
    surface_time: str = valued("TIME", "Time at the surface per cycle.", "15 min")
    battery_reserve: str = valued("SHARE", "Reserve of the battery.", "10 %")
    battery_temperature: Given = valued("TEMP", "Battery temperature (the cast's, or 4 degC).")


class Driver(Options):
    """The motor's driver, in place of the list's."""

    efficiency: Given = valued(
        "SHARE", "Efficiency of the driver (the list's).", name="--driver-efficiency"
    )
    standby_power: Given = valued(
        "POWER", "Standby power of the driver (the list's).", name="--driver-standby-power"
    )


class Limits(Options):
    """What is to be least, and what the body has room for."""

    goal: str = valued("GOAL", "Goal: least mass (drive, battery) or energy (per cycle).", "mass")
    max_piston_stroke: str = valued("LENGTH", "Longest travel of the piston.", "0.6 m")
    max_mass: Given = valued("MASS", "Largest mass of drive and battery (the body's).")


_BODY = typer.Argument(metavar="BODY", help="Preset or TOML file with hull, mass and drag.")
_PARTS = typer.Option(metavar="FILE", help="List of parts (a typical one).")


@grouped("max_depth speed cycles turn_time park_time parts goal", out=Path("swimbladder-size"))
def size(
    body: Annotated[str, _BODY] = "example-eh",
    *,
    parts: Annotated[Path | None, _PARTS] = None,
    task: Dives,
    driver: Driver,
    limits: Limits,
    reading: CastReading,
    to: Files,
) -> None:
    """Search all combinations of parts for a drive and battery that meet the dive.

    vehicle.toml is the body with that drive, for `energy`, `ballast` and `mission`. Exit code 1
    says that no combination will do, which requirement is in the way, and by how much.
    """
    vehicle = loaded(body)
    asked, room = task.read(), limits.given()
    casts = reading.casts()
    with progress("loading"):
        from swimbladder.design.sizing import Dive, load_parts
        from swimbladder.design.sizing import size as find
    sea = None
    if casts:
        from swimbladder.physics.seawater import cast_column

        sea = cast_column(casts[0])
        refuse_doubted_unit(casts, asked["max_depth"], vehicle.hull.depth_limit)
    listed = load_parts(parts).with_driver(**driver.read())
    doing = progress("weighing drives", total=6.0)
    with doing as advance:
        found = find(vehicle, Dive(**asked), cast=sea, parts=listed, advance=advance, **room)
    to.answer(found)


class Targets(Options):
    """What the ballast is to bring about, as a `Target` has it."""

    neutral_depth: Given = valued("DEPTH", "Find the mass that is neutral at this depth.")
    neutral_volume: Given = valued("VOLUME", "Volume of the drive at that depth (0).")
    freeboard: Given = valued("LENGTH", "Freeboard at full volume.")


class Reach(Options):
    """Where it is to go, how sure that has to be, and with what."""

    max_depth: Given = valued("DEPTH", "Greatest depth (the rating, or the cast's end).")
    speed: str = valued("SPEED", "Vertical speed.", "0 m/s")
    probability: str = valued("SHARE", "Probability that the stroke suffices.", "95 %")
    material: str = valued("WHAT", "Ballast: lead, steel, ..., a density, or inside.", "lead")
    mass: Given = valued("MASS", "Mass on the scale (that of trim_error).")


class Stds(Options):
    """What is not known, 1 sigma, as an `Uncertainty` has it."""

    mass: Given = valued("MASS", "1 sigma of the mass.", name="--mass-std")
    volume: Given = valued("VOLUME", "1 sigma of the hull's volume.", name="--volume-std")
    trim: Given = valued("VOLUME", "1 sigma of the neutral volume.", name="--trim-std")
    psi: Given = valued("PSI", "1 sigma of psi, the hull's compression.", name="--psi-std")
    heat: Given = valued("1/K", "1 sigma of the thermal expansion.", name="--heat-std")
    air: Given = valued("VOLUME", "1 sigma of the trapped air.", name="--air-std")
    density: Given = valued("DENSITY", "1 sigma of the sea's density.", name="--density-std")


@grouped("max_depth neutral_depth freeboard material mass", out=Path("swimbladder-ballast"))
def ballast(
    vehicle: VehicleName, *, target: Targets, task: Reach, stds: Stds, reading: Casts, to: Files
) -> None:
    r"""Find the ballast in a measured cast, and whether the stroke suffices.

    Without --cast the water is that of the vehicle's file, of constant density. Exit code 1 says
    that the stroke does not cover it with that probability, what is short and by how much.
    """
    v = loaded(vehicle, weighed=True)
    given, sought = stds.read(), target.given()
    asked = task.read()
    casts = reading.casts()

    from swimbladder.design.ballast import Target, material_of, uncertainty_of
    from swimbladder.design.ballast import ballast as find

    material_of(task.material)
    refuse_doubted_unit(casts, asked["max_depth"], v.hull.depth_limit)
    with stds.said_as_typed():
        uncertainty = uncertainty_of(v, given)
    wanted = Target(**sought, probability=asked.pop("probability"), speed=asked.pop("speed"))
    with progress("drawing vehicles", 1.0) as advance:
        found = find(v, casts, target=wanted, uncertainty=uncertainty, advance=advance, **asked)
    to.answer(found)


def fit_runs(paths: Sequence[Path], v: Vehicle | None, runs: Runs, to: Files) -> None:
    """Find a pump in tables of its runs, print what it is and write the files."""
    asked = runs.read()
    with progress("reading and fitting"):
        from swimbladder.design.energy import fit_pump, fitted_vehicle
        from swimbladder.design.energy.fit import pump_and_valve
        from swimbladder.io.pump_runs import joined_runs, read_pump_runs
        from swimbladder.show.energy import PumpFitShown

        if v is not None:
            pump_and_valve(v)
        chosen = {name: asked.pop(name) for name in ("columns", "where")}
        runs_read = joined_runs([read_pump_runs(path, **chosen) for path in paths])
        limit = None if v is None else v.hull.depth_limit
        try:
            found = fit_pump(runs_read, depth_limit=limit, **asked)
        except InputError as error:
            raise (error if error.field in asked else error.at(file=paths[0])) from None
        fitted = None if v is None or found.refusal else fitted_vehicle(v, found)
    to.answer(PumpFitShown(found, vehicle=fitted))


class Compared(Options):
    """How deep, and which tasks the drive does in the place of thrusters."""

    max_depth: Given = valued("DEPTH", "Greatest depth (the vehicle's rating).")
    weight_error: str = valued("VOLUME", "Excess weight while hovering, as volume.", "10 cm3")
    speed: str = valued("SPEED", "Vertical speed.", "0.1 m/s")


class Thrusters(Options):
    """The thruster, as `design.energy.Thruster` has it."""

    diameter: str = valued("LENGTH", "Propeller diameter.", "76 mm", name="--thruster-diameter")
    efficiency: str = valued(
        "SHARE",
        "Thruster efficiency of an ideal disc, with driver.",
        "35 %",
        name="--thruster-efficiency",
    )
    number: int = valued("N", "Number of thrusters.", 1, name="--thruster-number")
    idle_power: str = valued(
        "POWER", "Idle power of each thruster.", "0 W", name="--thruster-idle-power"
    )


class Runs(Options):
    """How a power and which runs of a table are taken."""

    power_at: str = valued("WHEN", "Pressure of a run, for --fit: its mean, or its end.", "mean")
    min_run_time: str = valued("TIME", "Shortest run used, for --fit.", "0 s")
    columns: Several = valued("NAME=COLUMN", "Column of the log of runs, for --fit.")
    where: Several = valued("COLUMN=VALUE", "Rows of the log of runs, for --fit.")


_FIT = typer.Option(
    metavar="RUNS", help="Fit a pump to logged runs: CSV, Seaglider .nc; repeatable."
)


@grouped("max_depth speed fit", out=Path("swimbladder-energy"))
def energy(
    vehicle: AnyVehicle = None,
    *,
    compared: Compared,
    thrusters: Thrusters,
    fit: Annotated[list[Path] | None, _FIT] = None,
    runs: Runs,
    reading: CastReading,
    to: Files,
) -> None:
    r"""Compute the energy per volume at each depth, and that of a thruster.

    With --fit RUNS: fit a pump's power law and delivery to logged runs, with
    intervals; with a VEHICLE of kind pump-valve vehicle.toml has that pump.
    Exit code 1: the electrical power is not known (the fields that state it
    are named), or the runs are not those of one pump.
    """
    v = None if vehicle is None else loaded(vehicle)
    if fit:
        if reading.cast is not None:
            why = "runs have their own pressures, and a cast does not count"
            raise InputError(why, field="--cast", remedy="Leave out --cast or --fit")
        reading.refuse(*NO_CAST)
        fit_runs(fit, v, runs, to)
        return
    if v is None:
        why = "there is neither a vehicle nor a table of runs"
        raise InputError(why, field="VEHICLE", remedy="Give a vehicle, or --fit RUNS.csv")
    runs.refuse("there is no file that this is about", "Give --fit RUNS.csv too")
    casts = reading.casts()
    asked, thrust = compared.read(), thrusters.read()
    with progress("computing"):
        from swimbladder.design.energy import Thruster
        from swimbladder.design.energy import energy as find

        refuse_doubted_unit(casts, asked["max_depth"], v.hull.depth_limit)
        found = find(v, next(iter(casts), None), thruster=Thruster(**thrust), **asked)
    to.answer(found)
