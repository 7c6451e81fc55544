"""``swimbladder design-experiment``: pool experiments, and the errors that they give."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import (
    compile_notice,
    console,
    json_text,
    output,
    progress,
    quantity,
    typed_command,
)
from swimbladder.cli.options import Files, Options, Read, grouped
from swimbladder.cli.settings import Sought, deviation
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.design.experiments import Design


def _against(text: str, option: str) -> tuple[float, ...] | None:
    """Return volume changes [m3] of a list with one unit; None: the paper's, where they fit."""
    if text.strip() == "paper":
        return None
    if text.strip() == "none":
        return ()
    parts = [part.strip() for part in text.split(",")]
    unit = parts[-1].lstrip("+-.0123456789eE").strip()
    if not unit:
        raise InputError(
            "the unit is missing", field=option, value=text, unit="m3",
            remedy='Write it as "20,-20,30,-30 cm3", or paper, or none',
        )  # fmt: skip
    found = []
    for part in [*(f"{p} {unit}" for p in parts[:-1]), parts[-1]]:
        number = quantity(part, "m3", option)
        assert number is not None
        found.append(number)
    return tuple(found)


@dataclass(frozen=True)
class Setting(Options):
    """The pool and the sensor."""

    pool_depth: Annotated[str, typer.Option(metavar="DEPTH", help="Depth of the bottom.")]
    sensor_std: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help="Noise of the depth, 1 sigma (the vehicle's)."),
    ] = None
    quantum: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help="Quantum of the depth sensor (the vehicle's)."),
    ] = None
    sample_time: Annotated[
        str | None, typer.Option(metavar="TIME", help="Sample time (the controller's).")
    ] = None
    neutral_std: Annotated[
        str | None,
        typer.Option(
            metavar="VOLUME",
            help="Prior of the neutral volume at rest, 1 sigma (0.5 cm3).",
        ),
        deviation("m3"),
    ] = None
    drift_std: Annotated[
        str | None,
        typer.Option(
            "--drift",
            metavar="RATE",
            help="Drift of the neutral volume, 1 sigma (0.1 cm3/min).",
        ),
        Read(lambda text, option: quantity(text, "m3/s", option)),
    ] = None


@dataclass(frozen=True)
class Experiments(Options):
    """The experiments, and what they are compared with."""

    time: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Pool time, settling included (--against's; 60 min)."),
    ] = None
    releases: Annotated[
        int | None,
        typer.Option("--runs", metavar="N", min=1, help="At most so many experiments."),
    ] = None
    clearance: Annotated[
        str, typer.Option(metavar="DEPTH", help="From surface and bottom to where records end.")
    ] = "0.75 m"
    settling: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Settling time before a release (simulated)."),
    ] = None
    longest: Annotated[str, typer.Option(metavar="TIME", help="Longest record.")] = "240 s"
    moves: Annotated[
        int, typer.Option(metavar="N", min=1, help="Most changes of volume in a record.")
    ] = 4
    largest: Annotated[
        str | None, typer.Option(metavar="VOLUME", help="Largest change of volume (the stroke's).")
    ] = None
    criterion: Annotated[
        str,
        typer.Option(
            metavar="WHICH", help="largest error, D, A; or NAME,...: the largest of these."
        ),
    ] = "largest"
    uncertainty: Annotated[
        str | None,
        typer.Option(
            metavar="SHARE", help="Error of the vehicle's file, 1 sigma (as identified; 30%)."
        ),
    ] = None
    against: Annotated[
        str,
        typer.Option(
            metavar="SET", help='Compare with single steps, "20,-20,30,-30 cm3"; paper; none.'
        ),
        Read(_against),
    ] = "paper"


@grouped(out=Path("swimbladder-design-experiment"))
def design_experiment(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    *,
    setting: Setting,
    sought: Sought,
    experiments: Experiments,
    to: Files,
) -> None:
    """Design the most informative pool experiments, and predict the errors of their estimates.

    A plan to follow, a page to print and the errors to expect: of every parameter, after every
    experiment, and against single steps in the same time. Exit code 1: not all parameters are
    identifiable in this time.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    v = load_vehicle(vehicle, sampled=True)
    options = {**setting.given(), **sought.given(), **experiments.given()}
    check_place(to.out)
    with progress("loading the simulator"):
        from swimbladder.design.experiments import design_experiment as find
        from swimbladder.show.report.design import write_design

    with compile_notice(), progress("looking for the best experiments", 1.0) as advance:
        found = find(v, **options, advance=advance)
    answer = found.to_json()
    with progress("writing the plan", 1.0) as advance:
        files = write_design(
            found, to.out, answer=json_text(answer), command=typed_command(), advance=advance
        )
    to.answer(answer, files, lambda: _print(found))
    if not found.identifiable:
        if to.json:
            for sentence in (f.sentence for f in found.findings if f.severity == "no"):
                console.print(sentence, markup=False, soft_wrap=True)
        raise typer.Exit(1)


def _print(found: Design) -> None:
    from swimbladder.show.report.design import comparison, headlines

    output.print(
        f"{found.vehicle}, {found.question.model.law} drag, a pool of "
        f"{found.setting.pool_depth:g} m",
        soft_wrap=True,
    )
    if not found.identifiable:
        output.print(
            "\nNo set of experiments in this time identifies all parameters:", style="bold"
        )
        for f in found.findings:
            if f.severity == "no":
                output.print(f.sentence, style="bold", soft_wrap=True)
    output.print("")
    for sentence in headlines(found):
        output.print(sentence, soft_wrap=True)
    output.print("")
    output.print(_experiments(found))
    output.print("")
    output.print(_parameters(found))
    said = comparison(found)
    if said:
        output.print("")
    for sentence in said:
        output.print(sentence, soft_wrap=True)
    for severity, style in (("warning", "bold yellow"), ("note", None)):
        listed = [f.sentence for f in found.findings if f.severity == severity]
        if listed:
            output.print("")
        for sentence in listed:
            output.print(f"{severity}: {sentence}", style=style, soft_wrap=True)
    output.print("")
    for sentence in found.assumptions:
        output.print(f"assumed: {sentence}", soft_wrap=True)


def _experiments(found: Design) -> object:
    from rich.table import Table

    from swimbladder.design.experiments.result import percent
    from swimbladder.show.report.design import moves

    w = found.chosen
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for heading in ("", "rest at"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("volume against the one at rest", overflow="fold")
    for heading in ("takes", *(f"{name} after" for name in w.prediction.names)):
        table.add_column(heading, justify="right", no_wrap=True)
    for k, (release, flight, after) in enumerate(zip(w.releases, w.flights, w.after, strict=True)):
        table.add_row(
            str(k + 1),
            f"{release.start:g} m",
            moves(release, found.piston_area),
            f"{flight.duration:.0f} s",
            *(percent(after[name]) for name in w.prediction.names),
        )
    return table


def _parameters(found: Design) -> object:
    from rich.table import Table

    from swimbladder.design.experiments.result import percent
    from swimbladder.show.report.text import row

    w = found.chosen
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("", no_wrap=True, min_width=max(map(len, w.prediction.parameters)))
    headings = ["assumed", "1 sigma", "95 % interval", "unit", "with drift", "other vehicles"]
    for heading in headings + ([found.rival] if found.gains else []):
        table.add_column(heading, justify="right", overflow="fold")
    for name, e in w.prediction.parameters.items():
        r = row(name, e)
        low, high = w.spread[name]
        rival = [f"{found.gains[name]:.1f} times"] if found.gains else []
        table.add_row(
            name, r.value, r.std, r.ci95, r.unit, percent(w.prediction.share[name]),
            f"{percent(low)} to {percent(high)}", *rival,
        )  # fmt: skip
    return table
