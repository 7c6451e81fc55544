"""``swimbladder identify``: the vertical motion's parameters from logs, with intervals."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.casts import LogCasts
from swimbladder.cli.common import (
    compile_notice,
    console,
    json_text,
    progress,
    typed_command,
)
from swimbladder.cli.identify_view import print_found
from swimbladder.cli.logs import LogReading
from swimbladder.cli.options import Files, Options, grouped
from swimbladder.cli.settings import Sought, deviation
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.io.logs import Log
    from swimbladder.vehicle import Vehicle


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
