"""``swimbladder identify-actuator``: K1, T1, dead zone, asymmetry and rate from logged steps."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import console, output, progress, quantity, typed_command
from swimbladder.cli.logs import LogReading, pair, pairs
from swimbladder.cli.options import Files, Read, grouped

if TYPE_CHECKING:
    from rich.table import Table

    from swimbladder.estimation.actuator import ActuatorIdentification, Estimate


@dataclass(frozen=True)
class Reading(LogReading):
    """How logs of an actuator are read."""

    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=COLUMN", help=r'As in piston_m="Position \[mm]" or piston_m=Position@mm.'
        ),
        Read(pairs),
    ] = None


@grouped(out=Path("swimbladder-identify-actuator"))
def identify_actuator(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="CSV files, or gzipped.")],
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="VEHICLE",
            help="Preset or TOML file: piston area, load of the sea, supply; written anew.",
        ),
    ] = None,
    *,
    reading: Reading,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help='Not fitted, as in dead_zone="0.5 V".'),
    ] = None,
    ask: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Exit with 1 unless identified: K1, T1, dead_zone, load_voltage, asymmetry, "
            "rate (K1 and T1; without a voltage T1 and rate; of a positioner the rate).",
        ),
    ] = None,
    plot: Annotated[bool, typer.Option("--plot", help="Also draw steps.png.")] = False,
    to: Files,
) -> None:
    """Find K1, T1, dead zone, asymmetry and rate of an actuator, with a report.

    From logs of voltage steps, or of moves at full speed where no voltage was logged. Several logs
    are of one actuator. Exit code 1: what was asked for is not identifiable from the logs.
    """
    from swimbladder.estimation.actuator import PARAMETERS
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    v = None if vehicle is None else load_vehicle(vehicle, sampled=True)
    fixed = {}
    for name, text in (pair(text, "--set") for text in set_ or []):
        number = quantity(text, PARAMETERS.get(name, ""), f"--set {name}")
        assert number is not None
        fixed[name] = number
    asked = None if ask is None else [name.strip() for name in ask.split(",") if name.strip()]
    given = [
        reading.log(one, v, quiet=k > 0, required=("time_s",))
        for k, one in enumerate(reading.chosen(logs))
    ]
    with progress("loading the fit"):
        from swimbladder.estimation.actuator import identify_actuator as identify

    check_place(to.out)
    begun = time.perf_counter()
    with progress("identifying the actuator", 1.0) as advance:
        found = identify(given, v, fixed=fixed, asked=asked, advance=advance)
    seconds = time.perf_counter() - begun
    with progress("writing the report", 1.0) as advance:
        from swimbladder.show.report.actuator import write_actuator

        files, why = write_actuator(
            found, to.out, command=typed_command(), seconds=seconds, picture=plot, advance=advance
        )
    if why:
        console.print(f"no vehicle is written: {why}", markup=False, soft_wrap=True)
    to.answer(found.to_json(), files, lambda: _print(found))
    if not found.identified:
        if to.json:
            console.print(found.refusal, markup=False, soft_wrap=True)
        raise typer.Exit(1)


def _row(name: str, e: Estimate) -> tuple[str, ...]:
    from swimbladder.estimation.actuator.estimate import shown

    low, high = e.ci95
    if not e.known:
        known = [
            f"above {shown(low, e.unit)}" if math.isfinite(low) and low > 0.0 else "",
            f"below {shown(high, e.unit)}" if math.isfinite(high) else "",
        ]
        return (name, "-", "", " ".join(filter(None, known)))
    if e.origin == "set":
        return (name, shown(e.value, e.unit), "set", "")
    interval = f"{shown(low, e.unit)} to {shown(high, e.unit)}"
    return (name, shown(e.value, e.unit), shown(e.std, e.unit, 2), interval)


def _print(found: ActuatorIdentification) -> None:
    """Print the parameters, each log, the nine, and what is to be said."""
    _print_parameters(found)
    if len(found.logs) > 1:
        _print_each(found)
    output.print("\nThe nine parameters of the model (section 2.3)")
    table = _table("", "value", "from", "")
    for known in found.nine:
        value = "-" if known.value is None else f"{known.value:.4g} {known.unit}"
        table.add_row(known.symbol, value, known.source, known.origin)
    output.print(table)
    output.print("")
    for finding in found.findings:
        mark = {"no": "not identified", "warning": "warning", "note": "note"}[finding.severity]
        output.print(f"{mark}: {finding.sentence}", soft_wrap=True)
    for sentence in found.assumptions:
        output.print(f"assumed: {sentence}", soft_wrap=True)
    for note in found.notes:
        output.print(f"note: {note}", soft_wrap=True)


def _table(*headings: str) -> Table:
    """Return a table without lines: names to the left, numbers to the right, the last one folds."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for heading in headings[:-1]:
        left = heading in ("", "from", "log")
        table.add_column(heading, justify="left" if left else "right", no_wrap=True)
    last = headings[-1]
    table.add_column(last, overflow="fold", no_wrap=bool(last), justify="right" if last else "left")
    return table


def _print_parameters(found: ActuatorIdentification) -> None:
    """Print what is identified, then why the rest is not."""
    shown = {**found.parameters, **found.derived}
    table = _table("", "value", "1 sigma", "95 % interval")
    for name, e in shown.items():
        table.add_row(*_row(name, e))
    output.print(table)
    asked = {f.sentence for f in found.findings if f.severity == "no"}
    reasons: dict[str, list[str]] = {}
    for name, e in shown.items():
        if not e.known and not any(e.why in sentence for sentence in asked):
            reasons.setdefault(e.why, []).append(name)
    for why, names in reasons.items():
        output.print(f"{', '.join(names)}: {why}", soft_wrap=True)


def _print_each(found: ActuatorIdentification) -> None:
    """Print what each log determines, a row for each of its numbers."""
    output.print("\nEach log by itself")
    for fit in found.logs:
        refusal = "" if fit.refusal is None else f": {fit.refusal}"
        output.print(f"{Path(fit.source).name}{refusal}", soft_wrap=True)
        table = _table("", "value", "1 sigma", "95 % interval")
        for name, e in fit.parameters.items():
            if e.origin == "data":
                table.add_row(*_row(name, e))
        if table.row_count:
            output.print(table)
