"""What an identification of an actuator found, as files: page, steps, picture and vehicle."""

from pathlib import Path
from typing import Any

from swimbladder.errors import NoAnswerError
from swimbladder.estimation.actuator import ActuatorIdentification
from swimbladder.estimation.actuator.model import shown_unit
from swimbladder.estimation.actuator.result import Known, Step
from swimbladder.io.progress import Advance, silent
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.files import Gone, write_all
from swimbladder.show.plots.identify_actuator import draw_log, draw_speeds, draw_steps, shows_speeds
from swimbladder.show.report.actuator_text import headlines, labels, pairs, rows, words
from swimbladder.show.report.html import REPORT, PageFigure, page_figure, render
from swimbladder.show.report.identification import Run
from swimbladder.units import rounded, unit_factor

_HEAD = "Identified by swimbladder identify-actuator."
_DRIVEN = {
    "voltage": "Driven by a logged voltage",
    "reference": "Judged by what a positioner was asked for",
    "nothing": "Moves at full speed, the voltage not logged",
}


def write_actuator(
    found: ActuatorIdentification, out: Path, run: Run, *, picture: bool, advance: Advance
) -> tuple[list[Path], str]:
    """Write page and steps into the folder `out`; return the paths, and why there is no vehicle.

    A vehicle is written where one was given and something of it was identified; else the one of an
    earlier run is taken away. run: how the page says that it was made; picture: also steps.png;
    advance: called with the share of the work done. Raises InputError where the folder cannot be
    written; whatever is in it then stays as it is.
    """
    tables: dict[str, object] = {"steps.csv": found.columns()}
    why = ""
    if found.given is not None:
        try:
            tables["vehicle.toml"] = vehicle_file(found.vehicle, head=_HEAD)
        except NoAnswerError as error:
            why = str(error)
    if picture:
        tables["steps.png"] = draw_steps(found)
    html = _page(found, list(tables), run, advance)
    tables.setdefault("vehicle.toml", Gone(_HEAD))
    return write_all(out, {REPORT: html, **tables}), why


def save_actuator(found: ActuatorIdentification, out: Path) -> list[Path]:
    """Write page, steps and picture; return the paths."""
    return write_actuator(found, out, Run("", 0.0), picture=True, advance=silent)[0]


def page(found: ActuatorIdentification) -> str:
    """Return the report of an identification that was made in Python."""
    return _page(found, [], Run("", 0.0), silent)


def _page(found: ActuatorIdentification, files: list[str], run: Run, advance: Advance) -> str:
    """Return the report as HTML that needs nothing but itself."""
    share = 1.0 / (len(found.logs) + 1)
    scale, unit = (1e3, "mm") if found.quantity == "piston" else (1e6, "cm³")
    names = labels(found)
    speeds = []
    if shows_speeds(found):
        speeds = [page_figure("speeds", draw_speeds(found), f"speeds-{_kind(found)}")]
    advance(share)
    logs = []
    for number, (fit, name) in enumerate(zip(found.logs, names, strict=True), start=1):
        own = [s for s in found.steps if s.source == fit.source]
        figures = _figures(found, own, number) if own else []
        alone = {} if len(found.logs) == 1 else fit.parameters
        rows_of = [words(name, e) for name, e in alone.items() if e.origin == "data"]
        logs.append({"name": name, "refusal": fit.refusal, "rows": rows_of, "figures": figures})
        advance(share)
    context = {
        "found": found,
        "name": "Actuator" if found.given is None else f"Actuator of {found.given.name}",
        "driven": _DRIVEN[found.driven],
        "moves": found.driven != "voltage",
        "scale": scale,
        "unit": unit,
        "seconds": run.seconds,
        "headlines": headlines(found),
        "listed": sorted(found.findings, key=lambda f: f.severity == "note"),
        "rows": rows(found),
        "pairs": pairs(found),
        "speeds": speeds,
        "nine": [_known(k) for k in found.nine],
        "logs": logs,
        "called": dict(zip((fit.source for fit in found.logs), names, strict=True)),
        "files": files,
        "command": run.command,
    }
    return render("actuator.html.j2", context)


def _known(k: Known) -> dict[str, Any]:
    """Return one of the nine as texts."""
    if k.value is None:
        return k._asdict() | {"value": "-"}
    unit = shown_unit(k.unit)
    return k._asdict() | {"value": rounded(unit_factor(k.unit, unit) * k.value), "unit": unit}


def _kind(found: ActuatorIdentification) -> str:
    """Return what the figures show, as texts.toml calls it."""
    return "voltage" if found.driven == "voltage" else "moves"


def _figures(found: ActuatorIdentification, steps: list[Step], number: int) -> list[PageFigure]:
    """Return the pictures of one log."""
    log, each = draw_log(found, steps), draw_steps(found, steps[0].source)
    return [
        page_figure(f"log-{number}", log, "log"),
        page_figure(f"steps-{number}", each, f"steps-{_kind(found)}"),
    ]
