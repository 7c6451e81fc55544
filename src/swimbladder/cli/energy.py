"""``swimbladder energy``: joules per millilitre over depth, against a thruster, from runs.

``swimbladder energy --fit``: a pump's power law and delivery from logged runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import CastReading, refuse_doubted_unit
from swimbladder.cli.common import json_text, output, progress
from swimbladder.cli.options import Files, Options, grouped
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.cli.casts import CastReading
    from swimbladder.cli.options import Files
    from swimbladder.design.energy import DriveEnergy, PumpFit
    from swimbladder.vehicle import Vehicle


def fit_runs(path: Path, v: Vehicle | None, reading: CastReading, runs: Runs, to: Files) -> None:
    """Find a pump in a CSV of its runs, print what it is and write the files."""
    from swimbladder.errors import InputError

    table_form, asked = reading.read(), runs.read()
    with progress("reading and fitting"), runs.said_as_typed():
        from swimbladder.design.energy import PumpRuns, fit_pump, fitted_vehicle
        from swimbladder.design.energy.fitted_pump import pump_and_valve
        from swimbladder.design.energy.messages import fit_sentences
        from swimbladder.io.pump_runs import read_pump_runs
        from swimbladder.show.report.energy import fit_json, write_fit

        if v is not None:
            pump_and_valve(v)
        table = read_pump_runs(
            path, columns=table_form["columns"] or {}, where=table_form["where"] or {}
        )
        limit = None if v is None else v.hull.depth_limit
        try:
            found = fit_pump(PumpRuns(**table._asdict()), depth_limit=limit, **asked)
        except InputError as error:
            raise (error if error.field in asked else error.at(file=path)) from None
        fitted = None if v is None else fitted_vehicle(v, found)
        said = fit_sentences(found, fitted)
        answer = {**fit_json(found), "sentences": said, "report": table.report}
        files = write_fit(found, fitted, to.out, answer=json_text(answer))
    to.answer(answer, files, lambda: _print_fit(found, said, table.report))


def _print_fit(found: PumpFit, said: tuple[str, ...], report: Sequence[str]) -> None:
    from rich.table import Table

    from swimbladder.design.energy import efficiency_bands

    for sentence in said:
        output.print(sentence, soft_wrap=True)
    output.print("")
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for heading in ("parameter", "value", "95 % from", "to", "unit"):
        table.add_column(heading, justify="left" if heading in ("parameter", "unit") else "right")
    shown = {
        "W/Pa": ("mW/dbar", 1e7), "m3/s": ("mL/s", 1e6), "m3/s/Pa": ("mL/s/MPa", 1e12),
        "m3": ("mL", 1e6),
    }  # fmt: skip
    for name, e in found.parameters.items():
        unit, factor = shown.get(e.unit, (e.unit, 1.0))
        numbers = (e.value, *e.ci95)
        table.add_row(name, *(f"{x * factor:.4g}" for x in numbers), unit)
    output.print(table)
    output.print("")
    bands = efficiency_bands(found)
    if bands:
        rows = Table(box=None, pad_edge=False, collapse_padding=True)
        for heading in ("dbar", "runs", "mL a run", "J a run", "efficiency", "by the law"):
            rows.add_column(heading, justify="right")
        for b in bands:
            rows.add_row(
                f"{b.pressure / 1e4:.0f}", f"{b.runs}", f"{1e6 * b.volume:.3g}",
                f"{b.energy:.4g}", f"{b.efficiency:.3f}", f"{b.fitted:.3f}",
            )  # fmt: skip
        output.print(rows)
        output.print("")
    for line in report:
        output.print(line, soft_wrap=True)


_SHORT = {
    "battery": "batt", "driver": "driver", "motor": "motor", "transmission": "drive",
    "leakage": "leak", "reservoir": "tank",
}  # fmt: skip
_LINES = 11  # depths in the printed table


@dataclass(frozen=True)
class Compared(Options):
    """How deep, and which tasks the drive does in the place of thrusters."""

    deepest: Annotated[
        str | None,
        typer.Option("--depth", metavar="DEPTH", help="How deep (the vehicle's rating)."),
    ] = None
    weight_error: Annotated[
        str, typer.Option(metavar="VOLUME", help="Too heavy by this while hovering.")
    ] = "10 cm3"
    speed: Annotated[str, typer.Option(metavar="SPEED", help="Of dives.")] = "0.1 m/s"


@dataclass(frozen=True)
class Thrusters(Options):
    """The thruster, as `design.energy.Thruster` has it."""

    diameter: Annotated[
        str, typer.Option("--thruster-diameter", metavar="LENGTH", help="Of the propeller.")
    ] = "76 mm"
    efficiency: Annotated[
        str,
        typer.Option(
            "--thruster-efficiency",
            metavar="SHARE",
            help="Of an ideal disc's, driver included.",
        ),
    ] = "35 %"
    number: Annotated[
        int,
        typer.Option("--thruster-number", metavar="N", help="How many thrusters share the work."),
    ] = 1
    idle_power: Annotated[
        str,
        typer.Option(
            "--thruster-idle", metavar="POWER", help="Of each while it turns, pushing or not."
        ),
    ] = "0 W"


@dataclass(frozen=True)
class Runs(Options):
    """How a power and which runs of a table are taken."""

    power_at: Annotated[
        str, typer.Option(metavar="WHEN", help="--fit: mean (over the run) or end (of it).")
    ] = "mean"
    shortest: Annotated[
        str, typer.Option(metavar="TIME", help="--fit: leave shorter runs out.")
    ] = "0 s"


@grouped(out=Path("swimbladder-energy"))
def energy(
    vehicle: Annotated[
        str | None, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")
    ] = None,
    cast: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CTD cast (the vehicle's own water).")
    ] = None,
    *,
    compared: Compared,
    thrusters: Thrusters,
    fit: Annotated[
        Path | None, typer.Option(metavar="RUNS", help="CSV of logged runs: find the pump in it.")
    ] = None,
    reading: CastReading,
    runs: Runs,
    to: Files,
) -> None:
    r"""Say what changing the volume costs at each depth, and what a thruster would.

    With --fit RUNS: find a pump's power law and delivery in logged runs, and
    how sure they are; with a VEHICLE of kind pump-valve vehicle.toml has that
    pump. Exit code 1 says that the electrical power is not known, and which
    fields tell it.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    v = None if vehicle is None else load_vehicle(vehicle)
    check_place(to.out)
    if fit is not None:
        if cast is not None:
            raise InputError(
                "runs have their own pressures, and a cast does not count", field="--cast",
                remedy="Leave out --cast or --fit",
            )  # fmt: skip
        reading.refuse("columns", "where")

        fit_runs(fit, v, reading, runs, to)
        return
    if v is None:
        raise InputError(
            "there is neither a vehicle nor a table of runs", field="VEHICLE",
            remedy="Give a vehicle, or --fit RUNS.csv",
        )  # fmt: skip
    for name, option in Runs.named().items():
        if getattr(runs, name) != getattr(Runs(), name):
            raise InputError(
                "there is no file that this is about", field=option,
                remedy="Give --fit RUNS.csv too",
            )  # fmt: skip
    casts = reading.casts(cast)
    asked, thrust = compared.read(), thrusters.read()
    with progress("computing"), compared.said_as_typed(), thrusters.said_as_typed():
        from swimbladder.design.energy import Thruster, drive_energy, hovering, profiling, sea
        from swimbladder.design.energy.messages import (
            assumptions,
            drive_sentences,
            versus_sentences,
        )
        from swimbladder.show.report.energy import energy_json, write_energy

        refuse_doubted_unit(casts, asked["deepest"], v.hull.depth_limit)
        water, warned = sea(v, next(iter(casts), None), asked["deepest"])
        found = drive_energy(v, water)
        thruster = Thruster(**thrust)
        hover = hovering(found, thruster, weight_error=asked["weight_error"])
        dive = profiling(found, thruster, speed=asked["speed"])
        said = [*warned, *drive_sentences(found), *versus_sentences(hover, dive, found)]
        rests = assumptions(found, thruster)
        answer = {
            **energy_json(found, hover, dive),
            "thruster": thruster._asdict(),
            "sentences": said,
            "assumptions": rests,
        }
        files = write_energy(found, hover, dive, to.out, answer=json_text(answer))
    to.answer(answer, files, lambda: _print(found, said, rests))


def _print(found: DriveEnergy, said: list[str], rests: tuple[str, ...]) -> None:
    import numpy as np
    from rich.table import Table

    v, m = found.vehicle, found.map
    output.print(f"{v.name}, {v.actuator.kind}", soft_wrap=True)
    output.print("")
    for sentence in said:
        output.print(sentence, soft_wrap=True)
    output.print("")
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    stages = [_SHORT[name] for name in found.stages]
    names = ["depth", "out", "power", "energy", "whole", *stages, "in", "hold"]
    units = ["m", "mL/s", "W", "J/mL", "%", *["%" for _ in found.stages], "mL/s", "W"]
    for name, unit in zip(names, units, strict=True):
        table.add_column(f"{name}\n{unit}", justify="right")
    last = found.column.depth.size - 1
    for i in np.unique(np.linspace(0, last, min(_LINES, last + 1)).round().astype(int)):
        values: list[Any] = [
            found.column.depth[i], m.rate_out[i] * 1e6, m.power_out[i], found.per_volume[i] * 1e-6,
            found.efficiency[i] * 100.0, *(stage[i] * 100.0 for stage in found.stages.values()),
            m.rate_in[i] * 1e6, m.holding_power[i],
        ]  # fmt: skip
        table.add_row(*(f"{x:.3g}" if np.isfinite(x) and abs(x) < 999.5 else
                        f"{x:.0f}" if np.isfinite(x) else "-" for x in values))  # fmt: skip
    output.print(table)
    output.print("")
    for sentence in rests:
        output.print(f"assumed: {sentence}", soft_wrap=True)
