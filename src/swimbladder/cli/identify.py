"""``swimbladder identify``: the vertical motion's parameters from logs, with intervals.

The result of `swimbladder identify` on the terminal: the answer first, then its basis.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import LogCasts
from swimbladder.cli.common import (
    compile_notice,
    console,
    json_text,
    output,
    progress,
    typed_command,
)
from swimbladder.cli.logs import LogReading
from swimbladder.cli.options import Files, Options, grouped
from swimbladder.cli.settings import Sought, deviation
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.estimation.motion import Identification
    from swimbladder.estimation.motion.paper_method import PaperFits
    from swimbladder.estimation.motion.posterior import Posterior
    from swimbladder.io.logs import Log
    from swimbladder.vehicle import Vehicle


def print_found(found: Identification, paper: PaperFits | None, seconds: float) -> None:
    """Print what was found: the answer first, then its basis."""
    from swimbladder.show.plots.identify import labels
    from swimbladder.show.report.text import correlations, findings, headlines, reading

    samples = sum(int((e.weight > 0.0).sum()) for e in found.experiments)
    count = len(found.experiments)
    output.print(
        f"{found.result_vehicle.name}, {count} log{'s' if count > 1 else ''}, {samples} samples, "
        f"{found.law} drag, {1e3 * found.depth_noise:.2g} mm of noise, {seconds:.2g} s",
        soft_wrap=True,
    )
    if not found.identified:
        output.print("\nNot identifiable from these logs:", style="bold red")
    output.print("")
    for sentence in headlines(found):
        output.print(sentence, style=None if found.identified else "bold", soft_wrap=True)
    said = findings(found)
    for kind, style in (("warning", "bold yellow"), ("note", None)):
        listed = [f.sentence for f in said if f.severity == kind]
        if listed:
            output.print("")
        for sentence in listed:
            output.print(f"{kind}: {sentence}", style=style, soft_wrap=True)
    output.print("")
    output.print(_parameters(found))
    if found.posterior is not None:
        output.print(_posterior(found.posterior))
    for a, b, r in correlations(found):
        output.print(f"correlation of {a} and {b}: {r:+.2f}")
    if found.choices:
        output.print("")
        output.print(_choices(found))
    output.print("")
    output.print(_logs(found))
    output.print("")
    if paper is not None:
        output.print(f"{paper.sentence}\n", soft_wrap=True)
    for sentence in found.assumptions:
        output.print(f"assumed: {sentence}", soft_wrap=True)
    for note in reading(found, labels(found)):
        output.print(f"note: {note}", soft_wrap=True)


def _posterior(drawn: Posterior) -> Any:
    """Return median and interval of the draws as a table."""
    from swimbladder.estimation.motion.model import NAMES
    from swimbladder.units import shown_unit, unit_factor

    table = number_table(("posterior", "median", "95 % of the draws", "unit"))
    for name in drawn.names:
        unit = NAMES[name].unit
        shown = shown_unit(unit)
        low, median, high = (x * unit_factor(unit, shown) for x in drawn.interval(name))
        table.add_row(name, f"{median:.4g}", f"{low:.4g} to {high:.4g}", shown)
    return table


def number_table(headings: Sequence[str]) -> Any:
    """Return a table of names, and numbers to the right of them."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column(headings[0], overflow="fold")
    for heading in headings[1:]:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def _parameters(found: Identification) -> object:
    from swimbladder.show.report.text import rows

    table = number_table(("", "value", "1 sigma", "95 % interval", "unit", "from"))
    words = {"data": "the logs", "prior": "its prior", "set": "set"}
    for r in rows(found):
        table.add_row(r.name, r.value, r.std, r.ci95, r.unit, words[r.origin])
    return table


def _choices(found: Identification) -> object:
    table = number_table(("drag", "psi", "rms", "behind the best", "probability"))
    words = {"free": "estimated", "prior": "with its prior", "set": "as set", "zero": "left out"}
    best = min(c.bic for c in found.choices)
    for c in found.choices:
        table.add_row(
            f"{c.drag}{' (reported)' if c.reported else ''}",
            words[c.psi],
            f"{1e3 * c.rms:.2f} mm",
            f"{c.bic - best:.1f}",
            f"{100.0 * c.weight:.1f} %",
        )
    return table


def _logs(found: Identification) -> object:
    from swimbladder.show.plots.identify import labels
    from swimbladder.show.report.text import row

    table = number_table(("log", "rms", "samples", "outliers", "neutral-volume error"))
    for label, e in zip(labels(found), found.experiments, strict=True):
        r = row("", e.estimates["neutral_error"])
        table.add_row(
            label,
            f"{1e3 * e.rms:.1f} mm",
            str(int((e.weight > 0.0).sum())),
            str(e.outliers),
            f"{r.value} +- {r.std} {r.unit}" if r.std else "-",
        )
    return table


@dataclass(frozen=True)
class Fit(Options):
    """How logs are fitted, as `estimation.motion.identify` has it."""

    neutral_std: Annotated[
        str,
        typer.Option(
            metavar="VOLUME", help="Prior of each log's neutral volume, 1 sigma; or none."
        ),
        deviation("m3"),
    ] = "0.5 cm3"
    speed_std: Annotated[
        str,
        typer.Option(metavar="SPEED", help="Prior of each log's start speed, 1 sigma; or none."),
        deviation("m/s"),
    ] = "none"
    drive: Annotated[
        str | None,
        typer.Option(metavar="INPUT", help="volume or voltage (first that is logged)."),
    ] = None
    bottom_depth: Annotated[
        str | None, typer.Option("--bottom", metavar="DEPTH", help="Depth of the bottom (none).")
    ] = None
    surface_margin: Annotated[
        str, typer.Option(metavar="DEPTH", help="Depths less than this are not used.")
    ] = "0.1 m"
    profiles: Annotated[
        bool, typer.Option("--profiles/--no-profiles", help="Likelihood profiles.")
    ] = True
    random_walk: Annotated[
        bool,
        typer.Option("--random-walk", help="Neutral volumes are random walks: trapped air, leaks."),
    ] = False
    posterior: Annotated[
        bool, typer.Option("--posterior", help="Also draw from the posterior (needs emcee).")
    ] = False
    seed: Annotated[int, typer.Option(min=0, help="Seed of the draws from the posterior.")] = 1
    paper: Annotated[
        bool, typer.Option("--paper", help="Also the paper's fits: eqs (26) and (27), averaged.")
    ] = False


@grouped(out=Path("swimbladder-identify"))
def identify(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="CSV files, or gzipped.")],
    vehicle: Annotated[str, typer.Option(metavar="VEHICLE", help="Preset or TOML file.")],
    *,
    reading: LogReading,
    sought: Sought,
    fit: Fit,
    casts: LogCasts,
    to: Files,
) -> None:
    """Identify a vehicle's vertical motion from logs, with intervals and a report.

    All logs are fitted jointly as experiments with one vehicle; each has its own neutral volume
    and start. With --cast the neutral volume follows the density of the water. For a vehicle with
    a pump and a valve, deep dives in that water identify drag, hull, pump and valve from their
    run times. Exit code 1: a parameter is not identifiable from the logs; no vehicle is written.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    v = load_vehicle(vehicle)
    if v.command == "volume change":
        from swimbladder.cli.identify_deep import identify_deep, refuse_others

        refuse_others({**({} if sought.drag is None else {"--drag": sought.drag}), **fit.changed()})
        if not casts.cast:
            raise InputError(
                "deep dives need the water that they were made in", field="--cast",
                remedy="Give a CTD cast as deep as the dives with --cast FILE",
            )  # fmt: skip
        return identify_deep(reading.chosen(logs), v, vehicle, reading, sought, casts, to)
    if casts.cast and fit.paper:
        raise InputError(
            "the paper's fits do not model layered water", field="--paper",
            remedy="Leave --paper out, or --cast",
        )  # fmt: skip
    options = {**sought.given(), **fit.given()}
    paper, seed = options.pop("paper"), options.pop("seed")
    options["posterior"] = seed if fit.posterior else None
    options["columns"] = casts.water(v.hull.depth_limit)
    given: list[Log] = []
    seen: set[Path] = set()
    for log in reading.chosen(logs):
        quiet = log.path in seen
        if casts.cast and not quiet:
            _refuse_runs(log.path, v, reading.columns())
        given.append(reading.log(log, v, quiet=quiet))
        seen.add(log.path)
    with progress("loading the simulator"):
        from swimbladder.estimation.motion import identify as identify_logs
        from swimbladder.estimation.motion.paper_method import paper_fits
        from swimbladder.show.report.identification import check_folder, write_identification

    check_place(to.out)
    check_folder(to.out, vehicle)
    begun = time.perf_counter()
    doing = progress(_doing(len(given)), 1.0)
    with sought.said_as_typed(), fit.said_as_typed(), compile_notice(), doing as advance:
        found = identify_logs(given, v, **options, advance=advance)
    seconds = time.perf_counter() - begun
    beside = paper_fits(found) if paper and found.identified else None
    answer = {**found.to_json(), "paper": None if beside is None else beside.to_json()}
    with progress("writing the report", 1.0) as advance:
        files = write_identification(
            found, to.out, answer=json_text(answer), command=typed_command(), seconds=seconds,
            paper=beside, advance=advance,
        )  # fmt: skip
    named = [path for path in files if to.json or path.suffix != ".png"]
    to.answer({**answer, "seconds": seconds}, named, lambda: print_found(found, beside, seconds))
    if not found.identified:
        if to.json:
            for sentence in (f.sentence for f in found.findings if f.severity == "no"):
                console.print(sentence, markup=False, soft_wrap=True)
        raise typer.Exit(1)


def _refuse_runs(path: Path, vehicle: Vehicle, mapped: Mapping[str, str]) -> None:
    """Raise InputError where a log has runs of a pump or valve that the vehicle lacks."""
    from swimbladder.io.logs import header_names

    runs = {"pump_s", "valve_s", "bypass_s"} & {*header_names(path), *mapped}
    if runs:
        raise InputError(
            f"{path} has runs of a pump or valve ({', '.join(sorted(runs))}), and the vehicle "
            f"{vehicle.name!r} has no pump and valve", field="--vehicle", value=vehicle.name,
            remedy="Give a vehicle whose actuator is of kind pump-valve, like example-float",
        )  # fmt: skip


def _doing(count: int) -> str:
    return "identifying from one log" if count == 1 else f"identifying from {count} logs"
