"""``swimbladder identify-actuator``: K1, T1, dead zone, asymmetry and rate from logged steps."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import (
    aside,
    labelled,
    progress,
    quantity,
    severity,
    table,
    typed_command,
)
from swimbladder.cli.logs import LogReading
from swimbladder.cli.options import Files, LogFiles, Options, grouped, valued
from swimbladder.cli.texts import Given, Several, pair

if TYPE_CHECKING:
    from swimbladder.estimation.actuator import ActuatorIdentification, Estimate


@dataclass(frozen=True)
class Reading(LogReading):
    """How logs of an actuator are read."""

    columns: Several = valued(
        "NAME=COLUMN", r'As in piston_m="Position \[mm]" or piston_m=Position@mm.', name="--column"
    )


@dataclass(frozen=True)
class Sought(Options):
    """What is known of the actuator, and what is to be identified."""

    fixed: Several = valued("NAME=VALUE", 'Fix at a value: dead_zone="0.5 V".', name="--set")
    ask: Given = valued(
        "NAME,...",
        "Exit with 1 unless identified: K1, T1, dead_zone, load_voltage, asymmetry, "
        "rate (K1 and T1; without a voltage T1 and rate; of a positioner the rate).",
    )


@grouped("where column set ask", out=Path("swimbladder-identify-actuator"))
def identify_actuator(
    logs: LogFiles,
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="VEHICLE",
            help="Preset or TOML file: piston area, load of the sea, supply; written anew.",
        ),
    ] = None,
    *,
    reading: Reading,
    sought: Sought,
    plot: Annotated[bool, typer.Option("--plot", help="Also draw steps.png.")] = False,
    to: Files,
) -> None:
    """Identify K1, T1, dead zone, asymmetry and rate of an actuator.

    From logs of voltage steps, or of moves at full speed where no voltage was logged. Several logs
    are of one actuator. Exit code 1: what was asked for is not identifiable from the logs.
    """
    from swimbladder.estimation.actuator import PARAMETERS
    from swimbladder.io.config import load_vehicle

    v = None if vehicle is None else load_vehicle(vehicle, sampled=True)
    set_to = (pair(text, "--set") for text in sought.fixed or [])
    fixed = {n: quantity(text, PARAMETERS.get(n, ""), f"--set {n}") for n, text in set_to}
    asked = sought.read()["ask"]
    needs, chosen = ("time_s",), enumerate(reading.chosen(logs))
    given = [reading.log(one, v, quiet=k > 0, required=needs) for k, one in chosen]
    with progress("loading the fit"):
        from swimbladder.estimation.actuator import identify_actuator as identify

    to.check()
    begun = time.perf_counter()
    with progress("identifying the actuator", 1.0) as advance:
        found = identify(given, v, fixed=fixed, asked=asked, advance=advance)
    seconds = time.perf_counter() - begun
    with progress("writing the report", 1.0) as advance:
        from swimbladder.show.report.actuator import write_actuator
        from swimbladder.show.report.identification import Run

        run = Run(typed_command(), seconds)
        files, why = write_actuator(found, to.out, run, picture=plot, advance=advance)
    if why:
        aside(f"no vehicle is written: {why}")
    refusal = [found.refusal]
    to.answer(found.to_dict(), _shown(found), files, good=found.identified, why=refusal)


def _row(name: str, e: Estimate) -> tuple[str, ...]:
    from swimbladder.estimation.actuator.model import shown

    low, high = e.ci95
    if not e.known:
        known = [f"above {shown(low, e.unit)}"] if math.isfinite(low) and low > 0.0 else []
        known += [f"below {shown(high, e.unit)}"] if math.isfinite(high) else []
        return (name, "-", "", " ".join(known))
    if e.origin == "set":
        return (name, shown(e.value, e.unit), "set", "")
    interval = f"{shown(low, e.unit)} to {shown(high, e.unit)}"
    return (name, shown(e.value, e.unit), shown(e.std, e.unit, 2), interval)


_HEADINGS = ("", "value", "1 sigma", "95 % interval")


def _shown(found: ActuatorIdentification) -> Iterator[object]:
    """Give what is printed: what is wrong, the parameters, each log, the nine, the rest."""
    asked = [f.sentence for f in found.findings if f.severity == "no"]
    yield from (*labelled("not identified", asked), *severity(found.findings, "warning"))
    shown = {**found.parameters, **found.derived}
    yield table(_HEADINGS, (_row(name, e) for name, e in shown.items()))
    reasons: dict[str, list[str]] = {}
    for name, e in shown.items():
        if not e.known and not any(e.why in sentence for sentence in asked):
            reasons.setdefault(e.why, []).append(name)
    yield from (f"{', '.join(without)}: {why}" for why, without in reasons.items())
    if len(found.logs) > 1:
        yield from _each(found)
    yield "The nine parameters of the model (section 2.3)"
    nine = (
        (known.symbol, _value(known.value, known.unit), known.source, known.origin)
        for known in found.nine
    )
    yield table(("", "value", "from", " "), nine, left=("", "from", " "))
    yield from severity(found.findings, "note")
    yield from (*labelled("assumed", found.assumptions), *labelled("note", found.notes))


def _value(value: float | None, unit: str) -> str:
    return "-" if value is None else f"{value:.4g} {unit}"


def _each(found: ActuatorIdentification) -> Iterator[object]:
    """Give what each log determines, a row for each of its numbers."""
    yield "Each log by itself"
    for fit in found.logs:
        refusal = "" if fit.refusal is None else f": {fit.refusal}"
        yield f"{Path(fit.source).name}{refusal}"
        own = {name: e for name, e in fit.parameters.items() if e.origin == "data"}
        rows = [_row(name, e) for name, e in own.items()]
        if rows:
            yield table(_HEADINGS, rows)
