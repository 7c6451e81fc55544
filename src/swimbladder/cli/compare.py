"""``swimbladder compare``: what a log recorded drives the model, and the depths are compared.

The part of ``swimbladder compare`` that looks ahead: options, table, files.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from swimbladder.cli.casts import LogCasts
from swimbladder.cli.common import compile_notice, console, emit_json, output, progress, quantity
from swimbladder.cli.logs import Chosen, LogReading
from swimbladder.cli.options import Files, Options, Read, grouped
from swimbladder.errors import InputError, SwimbladderError
from swimbladder.units import format_quantity, shown_unit

if TYPE_CHECKING:
    from swimbladder.estimation.comparison import Comparison
    from swimbladder.estimation.comparison.ahead import Ahead as Predicted
    from swimbladder.estimation.comparison.ahead import Ahead as Result
    from swimbladder.physics.seawater import Column
    from swimbladder.vehicle import Vehicle

_NOISES = {
    "depth_noise": ("m", "mm"),
    "random_walk": ("m3/s^0.5", "cm3/s^0.5"),
    "acceleration_noise": ("m/s/s^0.5", "mm/s/s^0.5"),
}


def _noise(name: str) -> Read:
    return Read(lambda text, option: quantity(text, _NOISES[name][0], option))


def _times(text: str, option: str) -> list[float]:
    parts = (quantity(part.strip(), "s", option) for part in text.split(",") if part.strip())
    return [part for part in parts if part is not None]


@dataclass(frozen=True)
class Ahead(Options):
    """Predictions over some times, and the noise that they assume."""

    horizons: Annotated[
        str | None,
        typer.Option(
            "--ahead", metavar="TIME,...", help='Also predict these times ahead, as "10 s,60 s".'
        ),
        Read(_times),
    ] = None
    random_walk: Annotated[
        str | None,
        typer.Option(metavar="INTENSITY", help="Random walk of the neutral volume, for --ahead."),
        _noise("random_walk"),
    ] = None
    depth_noise: Annotated[
        str | None, typer.Option(metavar="DEPTH", help="Depth noise, 1 sigma, for --ahead.")
    ] = None
    acceleration_noise: Annotated[
        str | None,
        typer.Option(metavar="INTENSITY", help="Acceleration noise density, for --ahead."),
        _noise("acceleration_noise"),
    ] = None

    def asked(self) -> dict[str, Any] | None:
        """Return what predict_ahead is called with; None where it is not asked for.

        Raises InputError naming the option.
        """
        given = self.read()
        horizons = given.pop("horizons")
        if horizons is None:
            for option, value in self.changed().items():
                raise InputError(
                    "this belongs to --ahead", field=option, value=value,
                    remedy='Add --ahead "10 s,60 s", or leave it out',
                )  # fmt: skip
            return None
        from swimbladder.estimation.comparison.ahead import Tuning

        return {"horizons": horizons, "tuning": Tuning(**given)}


def write_ahead(ahead: Result, folder: Path, name: str, *, plot: bool) -> list[Path]:
    """Write the predictions, and a picture where asked for; return the paths."""
    from swimbladder.io.tables import write_csv

    files = [write_csv(folder / f"{name}-ahead.csv", ahead.columns())]
    if plot:
        from swimbladder.show.plots.comparison import plot_ahead

        files.append(plot_ahead(ahead, folder / f"{name}-ahead.png"))
    return files


def print_ahead(ahead: Result) -> None:
    """Print a row for each span, and the noise that the filter assumed."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("ahead", no_wrap=True)
    for heading in ("rms", "bias", "skill", "without drag", "in 95 % band", "predictions"):
        table.add_column(heading, justify="right", no_wrap=True)
    for h in ahead.horizons:
        skill = [("-" if s is None else f"{s:.2f}") for s in h.skill.values()]
        table.add_row(
            f"{h.seconds:g} s",
            f"{1e3 * h.rms:.1f} mm",
            f"{1e3 * h.bias:+.1f} mm",
            *skill,
            f"{100.0 * h.coverage:.1f} %",
            str(h.n),
        )
    output.print(table)
    output.print(
        "predicted from what was measured before, and the volume; skill: 1 - rms/rms of a depth "
        "that stays; without drag: of the same filter without drag and psi",
        soft_wrap=True,
    )
    for name, value in ahead.noise.items():
        unit, shown = _NOISES[name]
        output.print(
            f"{name.replace('_', ' ')}: {format_quantity(value, unit, shown, digits=3)}, "
            f"{ahead.origins[name]}"
        )


_ROUNDING = 1e-6  # of a difference between a log and the model: less is no number to print


@dataclass(frozen=True)
class Fit(Options):
    """How a log is compared, as `estimation.comparison.compare` has it."""

    drive: Annotated[
        str | None,
        typer.Option(metavar="INPUT", help="volume, voltage or setpoint (first that is logged)."),
    ] = None
    fit: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="What to fit: neutral_volume (default), neutral_drift, mass, drag, "
            "drag_quadratic, psi, start_depth, start_speed; or none.",
        ),
    ] = None
    bottom_depth: Annotated[
        str | None, typer.Option("--bottom", metavar="DEPTH", help="Depth of the bottom (none).")
    ] = None
    surface_margin: Annotated[
        str, typer.Option(metavar="DEPTH", help="Depths less than this are not compared.")
    ] = "0.1 m"
    submerged: Annotated[
        bool,
        typer.Option("--submerged", help="Begin where it is first deeper than that."),
    ] = False


@grouped(out=Path("swimbladder-compare"))
def compare(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="CSV files, or gzipped.")],
    vehicle: Annotated[str, typer.Option(metavar="VEHICLE", help="Preset or TOML file.")],
    *,
    reading: LogReading,
    fit: Fit,
    ahead: Ahead,
    casts: LogCasts,
    plot: Annotated[bool, typer.Option("--plot", help="Also draw compare.png.")] = False,
    to: Files,
) -> None:
    """Drive the model with a measured log and compare depths.

    The model's input is the logged volume or piston, else the voltage, else the set-point, which
    the vehicle's own controller follows. With --cast, and a logged volume, the neutral volume
    follows the density of the water. Each log is compared separately; exit code 1 or 2: at least
    one could not be.
    """
    from swimbladder.io.config import load_vehicle

    v = load_vehicle(vehicle, sampled=True)
    how = _How(v, reading, fit.given(), ahead.asked(), to.out, plot)
    tasks = [_Task(log) for log in reading.chosen(logs)]
    from swimbladder.estimation.comparison.water import water_of_each

    waters = water_of_each(len(tasks), casts.water(v.hull.depth_limit))
    for task, name, water in zip(tasks, _file_names(tasks), waters, strict=True):
        task.name, task.water = name, water
        try:
            with fit.said_as_typed(), ahead.said_as_typed():
                _compare(task, how)
        except SwimbladderError as error:
            if len(tasks) == 1:
                raise
            task.error = error
    answers = [task.answer() for task in tasks]
    if to.json:
        emit_json(answers[0] if len(answers) == 1 else {"comparisons": answers})
    else:
        _print(tasks)
    code = max(0 if task.error is None else task.error.exit_code for task in tasks)
    if code:
        raise typer.Exit(code)


class _How(NamedTuple):
    """How each log is read and compared."""

    vehicle: Vehicle
    reading: LogReading
    options: dict[str, Any]
    horizons: dict[str, Any] | None
    out: Path
    plot: bool


@dataclass
class _Task:
    """A log to compare, and what came of it."""

    log: Chosen
    name: str = "compare"
    water: Column | None = None
    result: Comparison | None = None
    ahead: Predicted | None = None
    error: SwimbladderError | None = None
    files: tuple[Path, ...] = ()

    def answer(self) -> dict[str, Any]:
        if self.result is None:
            return {"log": self.log.label, "error": str(self.error)}
        ahead = None if self.ahead is None else self.ahead.to_json()
        files = [str(path) for path in self.files]
        return {**self.result.to_json(), "ahead": ahead, "files": files}


def _file_names(tasks: list[_Task]) -> list[str]:
    """Return a name for the files of each task, ``compare`` where there is only one."""
    if len(tasks) == 1:
        return ["compare"]
    found: list[str] = []
    for task in tasks:
        parts = [f"{name}-{value}" for name, value in task.log.where.items()]
        if len({other.log.path for other in tasks}) > 1:
            parts.insert(0, task.log.path.name.split(".")[0])
        name = "compare-" + re.sub(r"[^\w.-]+", "_", "-".join(parts))
        taken = sum(other == name or other.startswith(f"{name}~") for other in found)
        found.append(f"{name}~{taken + 1}" if taken else name)
    return found


def _compare(task: _Task, how: _How) -> None:
    """Read the log, compare, and write the files."""
    from swimbladder.io.files import make_folder
    from swimbladder.io.tables import write_csv

    vehicle, options, look, plot = how.vehicle, how.options, how.horizons, how.plot
    log = how.reading.log(task.log, vehicle)
    with progress("loading the simulator"):
        from swimbladder.estimation.comparison import compare as compare_log

    with compile_notice(), progress(f"comparing {task.log.label}", 1.0) as advance:
        task.result = compare_log(log, vehicle, **options, column=task.water, advance=advance)
    if look is not None:
        from swimbladder.estimation.comparison.ahead import predict_ahead

        names = {"bottom_depth", "surface_margin"} & set(options)
        edges = {name: options[name] for name in names}
        with compile_notice(), progress(f"predicting {task.log.label}", 1.0) as advance:
            task.ahead = predict_ahead(
                log, vehicle, **look, **edges, column=task.water, advance=advance
            )
    folder = make_folder(how.out)
    files = [write_csv(folder / f"{task.name}.csv", task.result.columns())]
    if plot:
        with progress(f"drawing {task.name}.png"):
            from swimbladder.show.plots.comparison import plot_comparison

            files.append(plot_comparison(task.result, folder / f"{task.name}.png"))
    if task.ahead is not None:
        files += write_ahead(task.ahead, folder, task.name, plot=plot)
    task.files = tuple(files)


def _cleared(value: float, least: float) -> float:
    """Return a number, 0 where it is smaller than anything that can be measured."""
    return value if abs(value) >= least else 0.0


def _print(tasks: list[_Task]) -> None:
    """Print a row for each log, then what was fitted, noted and written."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("log", overflow="fold")
    for heading in ("driven by", "rms", "bias", "variance", "largest", "samples"):
        table.add_column(heading, justify="right", no_wrap=True)
    for task in tasks:
        r = task.result
        if r is None:
            table.add_row(task.log.label, *["-"] * 6)
            continue
        table.add_row(
            task.log.label,
            r.record.drive,
            f"{1e3 * r.rms:.1f} mm",
            f"{1e3 * r.bias:+.1f} mm",
            f"{100.0 * r.variance_explained:.2f} %" if math.isfinite(r.variance_explained) else "-",
            f"{1e3 * r.largest:.1f} mm",
            str(r.n),
        )
    output.print(table)
    output.print("predicted less measured depth; variance: the share of it that is explained")
    said: set[str] = set()
    for task in tasks:
        if len(tasks) > 1:
            output.print(f"\n{task.log.label}", soft_wrap=True)
        if task.error is not None:
            console.print(f"error: {task.error}", markup=False, highlight=False, soft_wrap=True)
        if task.result is not None:
            _print_one(task, task.result, said)


def _print_one(task: _Task, r: Comparison, said: set[str]) -> None:
    """Print what was fitted, the notes not yet said, and the files."""
    from swimbladder.estimation.comparison.fit import FITTABLE

    for name, fitted in r.fitted.items():
        unit = shown_unit(fitted.unit)
        least = _ROUNDING * FITTABLE[name].scale
        value = format_quantity(_cleared(fitted.value, least), fitted.unit, unit)
        spread = ", which this log does not determine"
        if fitted.std is not None:
            std = _cleared(fitted.std, least)
            spread = f" +- {format_quantity(std, fitted.unit, unit, digits=2)}"
        output.print(f"fitted to this log: {name} = {value}{spread}")
    piston = r.to_json()["piston_rms_m"]
    if piston is not None:
        output.print(f"piston: rms {1e3 * piston:.2f} mm")
    if task.ahead is not None:
        print_ahead(task.ahead)
    for note in (n for n in r.notes if n not in said):
        said.add(note)
        output.print(f"note: {note}", soft_wrap=True)
    for path in task.files:
        output.print(f"wrote {path}", soft_wrap=True)
