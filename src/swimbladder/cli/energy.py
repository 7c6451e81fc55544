"""``swimbladder energy``: joules per millilitre over depth, against a thruster, from runs.

``--fit`` finds a pump's power law and delivery from logged runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.casts import NO_CAST, CastReading, refuse_doubted_unit
from swimbladder.cli.common import progress
from swimbladder.cli.options import AnyVehicle, Files, Options, grouped, loaded, valued
from swimbladder.cli.texts import Given, Several
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.vehicle import Vehicle


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
