"""``swimbladder identify-actuator``: K1, T1, dead zone, asymmetry and rate from logged steps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import console, emit_json, output, progress, quantity
from swimbladder.cli.logs import chosen, pair
from swimbladder.units import format_quantity

if TYPE_CHECKING:
    from swimbladder.identify_actuator import ActuatorIdentification, Estimate
    from swimbladder.io.logs import Log
    from swimbladder.parameters import Vehicle

__all__ = ["identify_actuator"]


def identify_actuator(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="CSV files, or gzipped.")],
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="VEHICLE",
            help="Preset or TOML file: piston area, load of the sea, supply; written anew.",
        ),
    ] = None,
    where: Annotated[
        list[str] | None,
        typer.Option(metavar="COLUMN=VALUE", help="Only these rows; VALUE,VALUE: one log each."),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=COLUMN", help=r'As in piston_m="Position \[mm]" or piston_m=Position@mm.'
        ),
    ] = None,
    log_format: Annotated[
        str | None, typer.Option(metavar="FORMAT", help=r"TOML file with a \[log] table.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help='Not fitted, as in dead_zone="0.5 V".'),
    ] = None,
    ask: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Exit with 1 unless these are told: K1, T1, dead_zone, load_voltage, asymmetry, "
            "rate (K1 and T1; without a voltage T1 and rate; of a positioner the rate).",
        ),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "swimbladder-identify-actuator"
    ),
    plot: Annotated[bool, typer.Option("--plot", help="Also draw steps.png.")] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    """Find K1, T1, dead zone, asymmetry and rate of an actuator.

    From logs of voltage steps, or of moves at full speed where no voltage was logged. Several logs
    are of one actuator. Exit code 1 says that something asked for is not told by the logs.
    """
    from swimbladder.identify_actuator import PARAMETERS
    from swimbladder.io.config import load_vehicle

    v = None if vehicle is None else load_vehicle(vehicle)
    fixed = {}
    for name, text in (pair(text, "--set") for text in set_ or []):
        number = quantity(text, PARAMETERS.get(name, ""), f"--set {name}")
        assert number is not None
        fixed[name] = number
    asked = None if ask is None else [name.strip() for name in ask.split(",") if name.strip()]
    read = _read(logs, where or [], column or [], log_format, v)
    with progress("loading the fit"):
        from swimbladder.identify_actuator import identify_actuator as identify

    with progress("identifying the actuator", 1.0) as advance:
        found = identify(read, v, fixed=fixed, asked=asked, advance=advance)
    files = _write(found, out, plot=plot)
    if json:
        emit_json({**found.to_json(), "files": files})
    else:
        _print(found, files)
    if not found.identified:
        if json:
            console.print(found.refusal, markup=False, soft_wrap=True)
        raise typer.Exit(1)


def _read(
    paths: list[Path],
    where: list[str],
    columns: list[str],
    log_format: str | None,
    v: Vehicle | None,
) -> list[Log]:
    from swimbladder.io.log_format import log_format as format_of
    from swimbladder.io.log_formats import format_names
    from swimbladder.io.logs import read_log

    if log_format is None and v is not None and v.name in format_names():
        log_format = v.name
        console.print(f"read as the log format {v.name} has it", markup=False)
    form = None if log_format is None else format_of(log_format)
    mapped = dict(pair(text, "--column") for text in columns)
    read = []
    for one in chosen(paths, where):
        with progress(f"reading {one.label}"):
            log = read_log(
                one.path, columns=mapped, where=one.where, log_format=form, required=("time_s",)
            )
        read.append(log)
    return read


def _write(found: ActuatorIdentification, out: Path, *, plot: bool) -> list[Path]:
    """Write the steps, and the vehicle where one was given and something of it was identified."""
    from swimbladder.errors import NoAnswerError
    from swimbladder.io.files import make_folder, write_atomically
    from swimbladder.io.tables import write_csv
    from swimbladder.io.vehicle_file import vehicle_file

    folder = make_folder(out)
    files = [write_csv(folder / "steps.csv", found.columns())]
    if found.given is not None:
        try:
            text = vehicle_file(found.vehicle, head="Identified by swimbladder identify-actuator.")
        except NoAnswerError as error:
            console.print(f"no vehicle is written: {error}", markup=False, soft_wrap=True)
        else:
            files.append(write_atomically(folder / "vehicle.toml", text))
    if plot:
        with progress("drawing steps.png"):
            from swimbladder.plots.identify_actuator import plot_steps

            files.append(plot_steps(found, folder / "steps.png"))
    return files


_SHOWN = {
    "m/s/V": "mm/s/V", "m/s": "mm/s", "m3/s/V": "cm3/s/V", "m3/s": "cm3/s", "s": "s", "V": "V",
    "m": "mm", "m3": "cm3",
}  # fmt: skip


def _shown(value: float, unit: str, digits: int = 4) -> str:
    shown = _SHOWN.get(unit, unit)
    return format_quantity(value, unit, shown, digits) if unit in _SHOWN else f"{value:.{digits}g}"


def _row(name: str, e: Estimate) -> tuple[str, ...]:
    import math

    low, high = e.ci95
    if e.value is None:
        known = [
            f"above {_shown(low, e.unit)}" if math.isfinite(low) and low > 0.0 else "",
            f"below {_shown(high, e.unit)}" if math.isfinite(high) else "",
        ]
        return (name, "-", "", " ".join(filter(None, known)), e.why)
    if e.origin == "set":
        return (name, _shown(e.value, e.unit), "", "", "set")
    assert e.std is not None
    interval = f"{_shown(low, e.unit)} to {_shown(high, e.unit)}"
    return (name, _shown(e.value, e.unit), _shown(e.std, e.unit, 2), interval, "")


def _print(found: ActuatorIdentification, files: list[Path]) -> None:
    """Print the parameters, each log, the nine, and what is to be said."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for heading in ("", "value", "1 sigma", "95 % interval"):
        table.add_column(heading, justify="left" if not heading else "right", no_wrap=True)
    table.add_column("", overflow="fold")
    for name, e in {**found.parameters, **found.derived}.items():
        table.add_row(*_row(name, e))
    output.print(table)
    if len(found.logs) > 1:
        output.print("\nEach log by itself")
        output.print(_each(found))
    output.print("\nThe nine parameters of the model (section 2.3)")
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("from", no_wrap=True)
    table.add_column("", overflow="fold")
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
    for path in files:
        output.print(f"wrote {path}", soft_wrap=True)


def _each(found: ActuatorIdentification) -> object:
    """Return the table of what each log tells."""
    from rich.table import Table

    names = [
        name
        for name in dict.fromkeys(n for fit in found.logs for n in fit.parameters)
        if any(fit.parameters[name].value is not None for fit in found.logs if fit.parameters)
        and name != "load_voltage"
    ]
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("log", overflow="fold")
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)
    for fit in found.logs:
        cells = []
        for name in names:
            e = fit.parameters.get(name)
            if e is None or e.value is None or e.std is None:
                cells.append("-")
            else:
                cells.append(f"{_shown(e.value, e.unit)} +- {_shown(e.std, e.unit, 2)}")
        table.add_row(fit.source, *cells)
    return table
