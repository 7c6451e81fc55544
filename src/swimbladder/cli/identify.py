"""``swimbladder identify``: the vertical motion's parameters from logs, with intervals."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import CastColumns, CastFiles, CastProfile, CastWhere, water_of_logs
from swimbladder.cli.common import (
    compile_notice,
    console,
    emit_json,
    json_text,
    progress,
    typed_command,
)
from swimbladder.cli.identify_view import print_found
from swimbladder.cli.logs import LogColumns, LogForm, LogRows, chosen, depth, names, pair, read
from swimbladder.cli.settings import deviation, held, priors
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.io.logs import Log
    from swimbladder.vehicle import Vehicle

__all__ = ["identify"]


def identify(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="CSV files, or gzipped.")],
    vehicle: Annotated[str, typer.Option(metavar="VEHICLE", help="Preset or TOML file.")],
    where: LogRows = None,
    column: LogColumns = None,
    log_format: LogForm = None,
    free: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Parameters to identify: K2, T2, psi; mass, drag_quadratic; K1, T1 (those of the "
            "drag law, and psi).",
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help='Fix at a value: "psi=2e-6 m3/m".'),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help='Prior: "psi=2e-6 +- 1e-6 m3/m".'),
    ] = None,
    drag: Annotated[
        str | None,
        typer.Option(metavar="LAW", help="linear, quadratic or blended (the vehicle's)."),
    ] = None,
    neutral_std: Annotated[
        str,
        typer.Option(
            metavar="VOLUME", help="Prior of each log's neutral volume, 1 sigma; or none."
        ),
    ] = "0.5 cm3",
    speed_std: Annotated[
        str,
        typer.Option(metavar="SPEED", help="Prior of each log's start speed, 1 sigma; or none."),
    ] = "none",
    drive: Annotated[
        str | None,
        typer.Option(metavar="INPUT", help="volume or voltage (first that is logged)."),
    ] = None,
    bottom: Annotated[
        str | None, typer.Option(metavar="DEPTH", help="Depth of the bottom (none).")
    ] = None,
    surface_margin: Annotated[
        str, typer.Option(metavar="DEPTH", help="Depths less than this are not used.")
    ] = "0.1 m",
    profiles: Annotated[
        bool, typer.Option("--profiles/--no-profiles", help="Likelihood profiles.")
    ] = True,
    random_walk: Annotated[
        bool,
        typer.Option("--random-walk", help="Neutral volumes are random walks: trapped air, leaks."),
    ] = False,
    posterior: Annotated[
        bool, typer.Option("--posterior", help="Also draw from the posterior (needs emcee).")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the draws from the posterior.")] = 1,
    paper: Annotated[
        bool, typer.Option("--paper", help="Also the paper's fits: eqs (26) and (27), averaged.")
    ] = False,
    cast: CastFiles = None,
    cast_where: CastWhere = None,
    cast_column: CastColumns = None,
    cast_profile: CastProfile = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "swimbladder-identify"
    ),
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
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

        refuse_others({
            "--drag": drag, "--drive": drive, "--bottom": bottom, "--random-walk": random_walk,
            "--posterior": posterior, "--paper": paper,
            "--neutral-std": neutral_std if neutral_std != "0.5 cm3" else None,
            "--speed-std": speed_std if speed_std != "none" else None,
            "--surface-margin": surface_margin if surface_margin != "0.1 m" else None,
            "--no-profiles": None if profiles else "given", "--seed": seed if seed != 1 else None,
        })  # fmt: skip
        if not cast:
            raise InputError(
                "deep dives need the water that they were made in", field="--cast",
                remedy="Give a CTD cast as deep as the dives with --cast FILE",
            )  # fmt: skip
        return identify_deep(
            chosen(logs, where or []), v, vehicle, cast, cast_where=cast_where or (),
            cast_columns=cast_column or (), cast_profile=cast_profile,
            column=column or (), log_format=log_format, free=names(free), fixed=set_ or (),
            priors=prior or (), out=out, json=json,
        )  # fmt: skip
    if cast and paper:
        raise InputError(
            "the paper's fits do not model layered water", field="--paper",
            remedy="Leave --paper out, or --cast",
        )  # fmt: skip
    options: dict[str, Any] = {
        "free": names(free),
        "fixed": held(set_),
        "priors": priors(prior),
        "drag": drag,
        "neutral_std": deviation(neutral_std, "m3", "--neutral-std"),
        "speed_std": deviation(speed_std, "m/s", "--speed-std"),
        "drive": _drive(drive),
        "bottom_depth": depth(bottom, "--bottom"),
        "surface_margin": depth(surface_margin, "--surface-margin"),
        "profiles": profiles,
        "random_walk": random_walk,
        "posterior": seed if posterior else None,
        "columns": water_of_logs(
            cast or (), cast_where or (), cast_column or (), cast_profile, v.hull.depth_limit
        ),
    }
    mapped = dict(pair(text, "--column") for text in column or [])
    given: list[Log] = []
    seen: set[Path] = set()
    for log in chosen(logs, where or []):
        quiet = log.path in seen
        if cast and not quiet:
            _refuse_runs(log.path, v, mapped)
        given.append(read(log, v, columns=mapped, log_format=log_format, quiet=quiet))
        seen.add(log.path)
    with progress("loading the simulator"):
        from swimbladder.estimation.motion import identify as identify_logs
        from swimbladder.estimation.motion.paper_method import paper_fits
        from swimbladder.show.report.identification import check_folder, write_identification

    check_place(out)
    check_folder(out, vehicle)
    begun = time.perf_counter()
    with compile_notice(), progress(_doing(len(given)), 1.0) as advance:
        found = identify_logs(given, v, **options, advance=advance)
    seconds = time.perf_counter() - begun
    beside = paper_fits(found) if paper and found.identified else None
    answer = {**found.to_json(), "paper": None if beside is None else beside.to_json()}
    with progress("writing the report", 1.0) as advance:
        files = write_identification(
            found, out, answer=json_text(answer), command=typed_command(), seconds=seconds,
            paper=beside, advance=advance,
        )  # fmt: skip
    if json:
        emit_json({**answer, "seconds": seconds, "files": [str(path) for path in files]})
    else:
        print_found(found, beside, seconds, files)
    if not found.identified:
        if json:
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


def _drive(text: str | None) -> str | None:
    if text not in (None, "volume", "voltage"):
        raise InputError(
            "no such input", field="--drive", value=text, remedy="Choose volume or voltage"
        )
    return text
