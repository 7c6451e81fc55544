"""``swimbladder energy``: joules per millilitre over depth, against a thruster, from runs.

``--fit`` finds a pump's power law and delivery from logged runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.casts import NO_CAST, CastReading, refuse_doubted_unit
from swimbladder.cli.common import labelled, progress, table, typed_command
from swimbladder.cli.options import AnyVehicle, Files, Options, grouped, valued
from swimbladder.cli.texts import Given
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.design.energy import Energy, PumpFit
    from swimbladder.vehicle import Vehicle


def fit_runs(
    paths: Sequence[Path], v: Vehicle | None, reading: CastReading, runs: Runs, to: Files
) -> None:
    """Find a pump in tables of its runs, print what it is and write the files."""
    table_form, asked = reading.read(), runs.read()
    with progress("reading and fitting"):
        from swimbladder.design.energy import fit_pump, fitted_vehicle
        from swimbladder.design.energy.fit import pump_and_valve
        from swimbladder.design.energy.messages import fit_sentences
        from swimbladder.io.pump_runs import joined_runs, read_pump_runs
        from swimbladder.show.report.energy import fit_files

        if v is not None:
            pump_and_valve(v)
        chosen = {name: table_form[name] for name in ("columns", "where")}
        runs_read = joined_runs([read_pump_runs(path, **chosen) for path in paths])
        limit = None if v is None else v.hull.depth_limit
        try:
            found = fit_pump(runs_read, depth_limit=limit, **asked)
        except InputError as error:
            raise (error if error.field in asked else error.at(file=paths[0])) from None
        fitted = None if v is None or found.refusal else fitted_vehicle(v, found)
        said = list(fit_sentences(found, fitted))
        answer = {**found.to_dict(), "sentences": said, "report": runs_read.report}
    files, shown = (
        partial(fit_files, found, vehicle=fitted, command=typed_command()),
        _shown_fit(found, said, runs_read.report),
    )
    to.answer(answer, shown, files, good=not found.refusal, why=[found.refusal])


def _shown_fit(found: PumpFit, said: Sequence[str], report: Sequence[str]) -> Iterator[object]:
    from swimbladder.design.energy import efficiency_bands

    yield from said
    shown = {
        "W/Pa": ("mW/dbar", 1e7),
        "m3/s/Pa": ("mL/s/MPa", 1e12),
        "m3/s": ("mL/s", 1e6),
        "m3": ("mL", 1e6),
    }
    rows = []
    for name, e in found.parameters.items():
        unit, factor = shown.get(e.unit, (e.unit, 1.0))
        rows.append((name, *(f"{x * factor:.4g}" for x in (e.value, *e.ci95)), unit))
    headings = ["parameter", "value", "95 % from", "to", "unit"]
    yield table(headings, rows, left=("parameter", "unit"))
    bands = []
    for b in efficiency_bands(found):
        took = f"{b.pressure / 1e4:.0f}", f"{b.runs}", f"{1e6 * b.volume:.3g}", f"{b.energy:.4g}"
        bands.append((*took, f"{b.efficiency:.3f}", f"{b.fitted:.3f}"))
    if bands:
        headings = ["dbar", "runs", "mL a run", "J a run", "efficiency", "by the law"]
        yield table(headings, bands, left=())
    yield from report


_SHORT = {"battery": "batt", "transmission": "drive", "leakage": "leak", "reservoir": "tank"}
_LINES = 11  # depths in the printed table


@dataclass(frozen=True)
class Compared(Options):
    """How deep, and which tasks the drive does in the place of thrusters."""

    deepest: Given = valued("DEPTH", "Greatest depth (the vehicle's rating).", name="--depth")
    weight_error: str = valued("VOLUME", "Excess weight while hovering, as volume.", "10 cm3")
    speed: str = valued("SPEED", "Vertical speed of dives.", "0.1 m/s")


@dataclass(frozen=True)
class Thrusters(Options):
    """The thruster, as `design.energy.Thruster` has it."""

    diameter: str = valued("LENGTH", "Propeller diameter.", "76 mm", name="--thruster-diameter")
    efficiency: str = valued(
        "SHARE", "Of an ideal disc, with driver.", "35 %", name="--thruster-efficiency"
    )
    number: int = valued("N", "Number of thrusters.", 1, name="--thruster-number")
    idle_power: str = valued("POWER", "Idle power of each.", "0 W", name="--thruster-idle")


@dataclass(frozen=True)
class Runs(Options):
    """How a power and which runs of a table are taken."""

    power_at: str = valued("WHEN", "--fit: pressure is the mean of a run, or its end.", "mean")
    shortest: str = valued("TIME", "--fit: shortest run used.", "0 s")


_CAST = typer.Option(metavar="FILE", help="CTD cast (the vehicle's own water).")
_FIT = typer.Option(
    metavar="RUNS", help="Fit a pump to logged runs: CSV, Seaglider .nc; repeatable."
)


@grouped("depth speed fit", out=Path("swimbladder-energy"))
def energy(
    vehicle: AnyVehicle = None,
    cast: Annotated[Path | None, _CAST] = None,
    *,
    compared: Compared,
    thrusters: Thrusters,
    fit: Annotated[list[Path] | None, _FIT] = None,
    reading: CastReading,
    runs: Runs,
    to: Files,
) -> None:
    r"""Compute the energy per volume at each depth, and that of a thruster.

    With --fit RUNS: fit a pump's power law and delivery to logged runs, with
    intervals; with a VEHICLE of kind pump-valve vehicle.toml has that pump.
    Exit code 1: the electrical power is not known (the fields that state it
    are named), or the runs are not those of one pump.
    """
    from swimbladder.io.config import load_vehicle

    v = None if vehicle is None else load_vehicle(vehicle)
    to.check()
    if fit:
        if cast is not None:
            why = "runs have their own pressures, and a cast does not count"
            raise InputError(why, field="--cast", remedy="Leave out --cast or --fit")
        reading.refuse(*NO_CAST, "columns", "where")
        fit_runs(fit, v, reading, runs, to)
        return
    if v is None:
        why = "there is neither a vehicle nor a table of runs"
        raise InputError(why, field="VEHICLE", remedy="Give a vehicle, or --fit RUNS.csv")
    runs.refuse("there is no file that this is about", "Give --fit RUNS.csv too")
    casts = reading.casts(cast)
    asked, thrust = compared.read(), thrusters.read()
    with progress("computing"):
        from swimbladder.design.energy import Thruster
        from swimbladder.design.energy import energy as find

        refuse_doubted_unit(casts, asked["deepest"], v.hull.depth_limit)
        found = find(v, next(iter(casts), None), thruster=Thruster(**thrust), **asked)
    to.answer(found, _shown(found))


def _shown(answer: Energy) -> Iterator[object]:
    """Give what is printed: what it costs, at some depths, and what is assumed."""
    import numpy as np

    from swimbladder.design.energy.run import spread_indices

    found = answer.drive
    m = found.map
    yield from (f"{found.vehicle.name}, {found.vehicle.actuator.kind}", *answer.sentences)
    columns = {
        "depth\nm": found.column.depth,
        "out\nmL/s": m.rate_out * 1e6,
        "power\nW": m.power_out,
        "energy\nJ/mL": found.per_volume * 1e-6,
        "whole\n%": found.efficiency * 100.0,
        **{f"{_SHORT.get(name, name)}\n%": part * 100.0 for name, part in found.stages.items()},
        "in\nmL/s": m.rate_in * 1e6,
        "hold\nW": m.holding_power,
    }
    rows = np.transpose([*columns.values()])[spread_indices(found.column.depth.size, _LINES)]
    yield table([*columns], (map(_digits, row) for row in rows), left=())
    yield from labelled("assumed", answer.assumptions)


def _digits(x: float) -> str:
    if not math.isfinite(x):
        return "-"
    return f"{x:.3g}" if abs(x) < 999.5 else f"{x:.0f}"
