"""``swimbladder compare``: what a log recorded drives the model, and the depths are compared.

With ``--ahead`` the depth is also predicted some seconds ahead: options, table and files of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from swimbladder.cli.casts import LogCasts
from swimbladder.cli.common import (
    aside,
    compile_notice,
    labelled,
    progress,
    quantity,
    table,
    typed_command,
)
from swimbladder.cli.logs import Chosen, LogReading, LogVehicle, vehicle_of
from swimbladder.cli.options import Files, LogFiles, Options, flag, grouped, valued
from swimbladder.cli.texts import Given
from swimbladder.errors import SwimbladderError
from swimbladder.units import format_quantity, shown_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swimbladder.estimation.comparison import Comparison
    from swimbladder.estimation.comparison.ahead import Ahead as Predicted
    from swimbladder.io.logs import Log
    from swimbladder.physics.seawater import Column
    from swimbladder.vehicle import Vehicle

_NOISES = {
    "depth_noise": ("m", "mm"),
    "random_walk": ("m3/s^0.5", "cm3/s^0.5"),
    "acceleration_noise": ("m/s/s^0.5", "mm/s/s^0.5"),
}


def _noise(name: str) -> Callable[[str, str], float | None]:
    return lambda text, option: quantity(text, _NOISES[name][0], option)


def _times(text: str, option: str) -> list[float]:
    return [quantity(part.strip(), "s", option) for part in text.split(",") if part.strip()]


@dataclass(frozen=True)
class Ahead(Options):
    """Predictions over some times, and the noise that they assume."""

    horizons: Given = valued(
        "TIME,...", 'Also predict these times ahead: "10 s,60 s".', name="--ahead", read=_times
    )
    random_walk: Given = valued(
        "INTENSITY", "Random walk of the neutral volume, for --ahead.", read=_noise("random_walk")
    )
    depth_noise: Given = valued("DEPTH", "Depth noise, 1 sigma, for --ahead.")
    acceleration_noise: Given = valued(
        "INTENSITY", "Acceleration noise density, for --ahead.", read=_noise("acceleration_noise")
    )

    def asked(self) -> dict[str, Any] | None:
        """Return what predict_ahead is called with; None where it is not asked for.

        Raises InputError naming the option.
        """
        given = self.read()
        horizons = given.pop("horizons")
        if horizons is None:
            self.refuse("this belongs to --ahead", 'Add --ahead "10 s,60 s", or leave it out')
            return None
        from swimbladder.estimation.comparison.ahead import Tuning

        return {"horizons": horizons, "tuning": Tuning(**given)}


def _ahead_shown(ahead: Predicted) -> Iterator[object]:
    """Give a row for each span, and the noise that the filter assumed."""
    headings = ("ahead", "rms", "bias", "skill", "without drag", "in 95 % band", "predictions")
    rows = []
    for h in ahead.horizons:
        off = f"{1e3 * h.rms:.1f} mm", f"{1e3 * h.bias:+z.1f} mm"
        skill = ("-" if known is None else f"{known:.2f}" for known in h.skill.values())
        rows.append((f"{h.seconds:g} s", *off, *skill, f"{100.0 * h.coverage:.1f} %", str(h.n)))
    yield table(headings, rows)
    terms = "skill: 1 - rms/rms of a depth that stays"
    terms += "; without drag: of the same filter without drag and psi"
    yield f"predicted from what was measured before, and the volume; {terms}"
    for name, value in ahead.noise.items():
        noise = format_quantity(value, *_NOISES[name], digits=3)
        yield f"{name.replace('_', ' ')}: {noise}, {ahead.origins[name]}"


_ROUNDING = 1e-6  # of a difference between a log and the model: less is no number to print


@dataclass(frozen=True)
class Fit(Options):
    """How a log is compared, as `estimation.comparison.compare` has it."""

    drive: Given = valued("INPUT", "Input: volume, voltage or setpoint (first logged).")
    fit: Given = valued(
        "NAME,...",
        "Fitted: neutral_volume (default), neutral_drift, mass, drag, "
        "drag_quadratic, psi, start_depth, start_speed; or none.",
    )
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (none).", name="--bottom")
    surface_margin: str = valued("DEPTH", "Smallest depth compared.", "0.1 m")
    submerged: bool = flag("--submerged", "Begin at the first depth beyond that.")


@grouped("where column fit ahead", out=Path("swimbladder-compare"))
def compare(
    logs: LogFiles,
    vehicle: LogVehicle = None,
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

    v = load_vehicle(vehicle_of(reading.chosen(logs), vehicle), sampled=True)
    options, horizons = fit.given(), ahead.asked()
    tasks = [_Task(log) for log in reading.chosen(logs)]
    from swimbladder.estimation.comparison.record import water_of_each

    waters = water_of_each(len(tasks), casts.water(v.hull.depth_limit))
    for task, name, water in zip(tasks, _file_names(tasks), waters, strict=True):
        task.name, task.water = name, water
        try:
            _compare(task, v, reading.log(task.log, v), options, horizons)
            task.files = _write(task, to.out, plot=plot)
        except SwimbladderError as error:
            if len(tasks) == 1:
                raise
            task.error = error
    _write_page(tasks, to.out)
    answers = [task.answer() for task in tasks]
    found = answers[0] if len(answers) == 1 else {"comparisons": answers}
    aside(*(f"error: {task.error}" for task in tasks if task.error is not None))
    to.show(found, _shown(tasks), to.wrote([path for task in tasks for path in task.files]))
    code = max(task.exit_code for task in tasks)
    if code:
        raise typer.Exit(code)


_DRAWN = 12  # figures of a report


@dataclass
class _Task:
    """A log to compare, and what came of it."""

    log: Chosen
    name: str = "compare"
    water: Column | None = None
    result: Comparison | None = None
    ahead: Predicted | None = None
    error: SwimbladderError | None = None
    drawn: Figure | None = None
    files: Sequence[Path] = ()

    @property
    def exit_code(self) -> int:
        if self.error is not None:
            return self.error.exit_code
        return 0 if self.result is None or self.result.possible else 1

    def answer(self) -> dict[str, Any]:
        if self.result is None:
            return {"log": self.log.label, "error": str(self.error)}
        ahead = None if self.ahead is None else self.ahead.to_dict()
        files = [str(path) for path in self.files]
        return {**self.result.to_dict(), "ahead": ahead, "files": files}


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


def _compare(
    task: _Task, vehicle: Vehicle, log: Log, options: dict[str, Any], spans: dict[str, Any] | None
) -> None:
    """Compare a log with the model, and predict over the spans that are asked for."""
    with progress("loading the simulator"):
        from swimbladder.estimation.comparison import compare as compare_log

    with compile_notice(), progress(f"comparing {task.log.label}", 1.0) as advance:
        task.result = compare_log(log, vehicle, **options, column=task.water, advance=advance)
    if spans is not None:
        from swimbladder.estimation.comparison.ahead import predict_ahead

        names = {"bottom_depth", "surface_margin"} & set(options)
        edges = {name: options[name] for name in names}
        more = {**spans, **edges, "column": task.water}
        with compile_notice(), progress(f"predicting {task.log.label}", 1.0) as advance:
            task.ahead = predict_ahead(log, vehicle, **more, advance=advance)


def _write(task: _Task, out: Path, *, plot: bool) -> list[Path]:
    """Write the files of a comparison and return their paths."""
    assert task.result is not None
    with progress(f"writing {task.name}"):
        from swimbladder.show.files import write_all

        files: dict[str, object] = {f"{task.name}.csv": task.result.columns()}
        if task.ahead is not None:
            files[f"{task.name}-ahead.csv"] = task.ahead.columns()
        if plot:
            from swimbladder.show.plots.comparison import draw_ahead, draw_comparison

            files[f"{task.name}.png"] = task.drawn = draw_comparison(task.result)
            if task.ahead is not None:
                files[f"{task.name}-ahead.png"] = draw_ahead(task.ahead)
        return write_all(out, files)


def _write_page(tasks: list[_Task], out: Path) -> None:
    """Write one report of all logs that could be compared."""
    done = [(task, task.result) for task in tasks if task.result is not None]
    if not done:
        return
    with progress("writing the report"):
        from swimbladder.io.files import write_atomically
        from swimbladder.show.plots.comparison import draw_comparison
        from swimbladder.show.report.html import REPORT
        from swimbladder.show.report.page import answer_page

        worst = sorted(done, key=lambda one: -one[1].rms)[:_DRAWN]
        said = [line for _, found in done for line in found.sentences]
        if len(done) > len(worst):
            said.append(f"The figures are those of the {_DRAWN} logs with the largest rms.")
        figures = {task.name: task.drawn or draw_comparison(found) for task, found in worst}
        numbers = {task.log.label: task.answer() for task, _ in done}
        about = {
            "command": typed_command(),
            "files": [path.name for task, _ in done for path in task.files],
            "good": all(found.possible for _, found in done),
        }
        title = f"{done[0][1].vehicle.name} compared with {done[0][0].log.label}"
        title += f" and {len(done) - 1} more" if len(done) > 1 else ""
        path = out / REPORT
        write_atomically(path, answer_page(title, said, numbers, figures, about))
    for task, _ in done:
        task.files = [*task.files, path]


def _cleared(value: float, least: float) -> float:
    """Return a number, 0 where it is smaller than anything that can be measured."""
    return value if abs(value) >= least else 0.0


def _shown(tasks: list[_Task]) -> Iterator[object]:
    """Give a row for each log and what was found wrong, then what was fitted and noted."""
    headings = ("log", "driven by", "rms", "bias", "variance", "largest", "samples")
    yield table(headings, ((task.log.label, *_row(task.result)) for task in tasks))
    for task in tasks:
        of = f" ({task.log.label})" if len(tasks) > 1 else ""
        for f in () if task.result is None else task.result.findings:
            yield Text(f"{f.severity}: {f.sentence}{of}", style="bold")
    yield "predicted less measured depth; variance: the share of it that is explained"
    said: set[str] = set()
    for task in tasks:
        if len(tasks) > 1:
            yield f"\n{task.log.label}"
        if task.result is not None:
            yield from _one(task, task.result, said)


def _row(r: Comparison | None) -> tuple[str, ...]:
    if r is None:
        return ("-",) * 6
    share = 100.0 * r.variance_explained
    explained = f"{share:.2f} %" if math.isfinite(share) else "-"
    off = f"{1e3 * r.rms:.1f} mm", f"{1e3 * r.bias:+z.1f} mm"
    return (r.record.drive, *off, explained, f"{1e3 * r.largest:.1f} mm", str(r.n))


def _one(task: _Task, r: Comparison, said: set[str]) -> Iterator[object]:
    """Give what was fitted, and the notes not yet said."""
    from swimbladder.estimation.comparison.run import FITTABLE

    for name, fitted in r.fitted.items():
        unit = shown_unit(fitted.unit)
        least = _ROUNDING * FITTABLE[name].scale
        value = format_quantity(_cleared(fitted.value, least), fitted.unit, unit)
        spread = ", which this log does not determine"
        if fitted.std is not None:
            std = _cleared(fitted.std, least)
            spread = f" +- {format_quantity(std, fitted.unit, unit, digits=2)}"
        yield f"fitted to this log: {name} = {value}{spread}"
    piston = r.to_dict()["piston_rms_m"]
    if piston is not None:
        yield f"piston: rms {1e3 * piston:.2f} mm"
    if task.ahead is not None:
        yield from _ahead_shown(task.ahead)
    yield from labelled("note", (note for note in r.notes if note not in said))
    said.update(r.notes)
