"""What an identification found, as files: page, numbers, residuals, pictures and the vehicle.

The page has what was found in plain words first, then the evidence.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from swimbladder.errors import InputError, Parameter
from swimbladder.estimation.motion import NAMES, Choice, Estimate, Identification
from swimbladder.estimation.motion.paper_method import PaperFits
from swimbladder.io.progress import Advance, silent
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.files import write_all, written_by
from swimbladder.show.plots import identify as plots
from swimbladder.show.plots.identify import labels
from swimbladder.show.report import text
from swimbladder.show.report.html import REPORT, PageFigure, Picture, page_figure, render
from swimbladder.show.report.text import row
from swimbladder.sim.pool import Fit
from swimbladder.units import rounded, shown_unit, unit_factor

_SYMBOL = {"drag_quadratic": "k_dt", "mass": "m"}
PSI = {"free": "estimated", "prior": "with its prior", "set": "as set", "zero": "left out"}


class Run(NamedTuple):
    """What a page says of the run that made it."""

    command: str  # as it was typed
    seconds: float  # how long the fit took
    paper: PaperFits | None = None  # the paper's fits, to stand beside ours


def page(
    found: Identification, figures: Mapping[str, PageFigure], run: Run, *, files: Sequence[str]
) -> str:
    """Return the report as HTML that needs nothing but itself."""
    names = labels(found)
    context = {
        "found": found,
        "labels": names,
        "samples": sum(int((e.weight > 0.0).sum()) for e in found.experiments),
        "seconds": run.seconds,
        "headlines": text.headlines(found),
        "listed": text.findings(found),
        "rows": text.rows(found),
        "pairs": [text.trade_off(a, b, r) for a, b, r in text.correlations(found)],
        "choices": [_choice(found, c) for c in found.choices],
        "paper": None if run.paper is None else _paper(run.paper, names),
        "figures": figures,
        "reading": text.reading(found, names),
        "files": files,
        "command": run.command,
    }
    return render("identification.html.j2", context, plus_minus=_plus_minus, small=_small)


def _plus_minus(e: Estimate) -> str:
    r = row("", e)
    return f"{r.value} +- {r.std}" if r.std else "-"


def _small(p: float) -> str:
    return f"{p:.1g}" if p > 1e-4 else "below 1e-4"


def _choice(found: Identification, c: Choice) -> dict[str, Any]:
    best = min(other.bic for other in found.choices)
    values = (_value(name, value) for name, value in c.values.items() if found.identified)
    return vars(c) | {
        "psi": PSI[c.psi],
        "rms": rounded(1e3 * c.rms, 3),
        "behind": f"{c.bic - best:.1f}" if math.isfinite(c.bic) else "-",
        "weight": f"{100.0 * c.weight:.3g}" if c.weight > 1e-4 else "below 0.01",
        "bar": round(100.0 * c.weight, 1),
        "values": ", ".join(values),
    }


def _value(name: str, value: float) -> str:
    unit = NAMES[name].unit
    shown = value * unit_factor(unit, shown_unit(unit))
    if abs(shown) < 1e-9:  # a fit that ended at a bound, to rounding
        shown = 0.0
    return f"{_SYMBOL.get(name, name)} {rounded(shown)} {shown_unit(unit)}"


def _paper(paper: PaperFits, names: Sequence[str]) -> dict[str, Any]:
    """Return the paper's fits as texts: each log, then the averages."""

    def fitted(label: str, step: str, fit: Any, why: str) -> dict[str, Any]:
        speed, depth = _fitted(fit.by_speed, "mm/s"), _fitted(fit.by_depth, "mm")
        return {"label": label, "step": step, "speed": speed, "depth": depth, "why": why}

    rows = []
    for name, fit in zip(names, paper.each, strict=True):
        step = f"{1e6 * fit.step:.3g}" if math.isfinite(fit.step) else "-"
        rows.append(fitted(name, step, fit, fit.why))
    return {"sentence": paper.sentence, "rows": [*rows, fitted("average", "", paper, "")]}


def _fitted(fit: Fit | None, unit: str) -> list[str]:
    if fit is None:
        return ["-", "-", "-"]
    return [rounded(fit.K2), rounded(fit.T2, 3), f"{rounded(1e3 * fit.rms, 2)} {unit}"]


VEHICLE = "vehicle.toml"
POSTERIOR = "posterior.csv"
MARK = "Identified by swimbladder identify"
_OURS = re.compile(
    r"(fits|residuals)(-\d+)?\.png|(distribution|ellipses|profiles|neutral|gains)\.png"
)


def check_folder(out: Path, vehicle: str | Path) -> None:
    """Raise InputError where writing into `out` would take a vehicle file that is not ours.

    A vehicle.toml of an earlier run is replaced, or taken away where it is not identified; the one
    that is read, or one that something else wrote, is left alone.
    """
    target = out / VEHICLE
    if not target.exists():
        return
    what = "there is a vehicle that `swimbladder identify` did not write"
    if Path(vehicle).exists() and target.samefile(vehicle):
        what = "the identified vehicle would be written over the one that is read"
    elif written_by(target, f"{MARK} "):
        return
    raise InputError(
        what, file=target, field=Parameter("out"), remedy="Choose another folder with `out=`"
    )


def save_identification(found: Identification, out: Path) -> list[Path]:
    """Write page, numbers, pictures and, where identified, the vehicle; return the paths."""
    return write_identification(found, out, Run("", 0.0), found.to_dict())


def report_page(found: Identification) -> str:
    """Return the report of an identification that was made in Python."""
    figures = {p.name: page_figure(p.name, p.draw(), p.about, p.part) for p in pictures(found)}
    return page(found, figures, Run("", 0.0), files=())


def write_identification(
    found: Identification, out: Path, run: Run, answer: Mapping[str, Any], advance: Advance = silent
) -> list[Path]:
    """Write everything into the folder `out` and return the paths.

    run: how the page says that it was made; answer: identify.json; advance: called with the share
    of the work done. No vehicle is written where the data do not identify all that was asked, and
    one of an earlier run is taken away. Raises InputError where the folder cannot be written;
    whatever is in it then stays as it is.
    """
    check_folder(out, "")
    drawn = pictures(found, run.paper)
    images: dict[str, object] = {}
    figures = {}
    for name, draw, about, part in drawn:
        images[f"figures/{name}.png"] = made = draw()
        figures[name] = page_figure(name, made, about, part)
        advance(1.0 / (len(drawn) + 1))
    files: dict[str, object] = {"identify.json": answer, "residuals.csv": residuals(found)}
    if found.identified:
        files[VEHICLE] = vehicle_file(found.vehicle, head=_head(found))
    files |= images
    if found.posterior is not None:
        names = (f"{name} [{NAMES[name].unit}]" for name in found.posterior.names)
        files[POSTERIOR] = dict(zip(names, found.posterior.draws.T, strict=True))
    html = page(found, figures, run, files=list(files))
    written = write_all(out, {REPORT: html, **files})
    _sweep(out, [*files])
    advance(1.0 / (len(drawn) + 1))
    return written


def _sweep(out: Path, kept: list[str]) -> None:
    """Take away what an earlier run left and this one did not replace."""
    stale = [path for path in (out / "figures").glob("*.png") if _OURS.fullmatch(path.name)]
    if written_by(out / VEHICLE, f"{MARK} "):
        stale.append(out / VEHICLE)
    if (out / "identify.json").is_file():
        stale.append(out / POSTERIOR)
    for path in stale:
        if path.is_file() and path.relative_to(out).as_posix() not in kept:
            path.unlink()


def _head(found: Identification) -> str:
    logs = [e.source for e in found.experiments]
    lines = [f"{MARK} from {len(logs)} log{'s' if len(logs) > 1 else ''}, 95 % intervals:"]
    for name in found.names:
        r = row(name, found.parameters[name])
        lines.append(f"  {name} = {r.value} +- {r.std} {r.unit} ({r.ci95})")
    return "\n".join(lines)


def residuals(found: Identification) -> dict[str, np.ndarray]:
    """Return the columns of residuals.csv, log after log, SI."""
    listed = []
    for number, e in enumerate(found.experiments, start=1):
        r, length = e.record, len(e.record.time)
        one = {"log": np.full(length, float(number)), "time_s": r.time, "depth_m": r.depth}
        one |= {"depth_fitted_m": e.predicted, "residual_m": e.residual, "weight": e.weight}
        for name, values in (("volume_m3", r.volume), ("voltage_V", r.voltage)):
            one[name] = np.full(length, np.nan) if values is None else values
        listed.append(one)
    columns = {name: np.concatenate([one[name] for one in listed]) for name in listed[0]}
    for name in ("volume_m3", "voltage_V"):
        if not np.isfinite(columns[name]).any():
            del columns[name]
    return columns


def pictures(found: Identification, paper: PaperFits | None = None) -> list[Picture]:
    """Return the figures that this identification has, in the order of the page.

    paper: the paper's fits of single logs, drawn beside ours.
    """
    own = any(e.own_gain is not None for e in found.experiments)
    others: dict[str, tuple[object, Callable[[Identification], Figure]]] = {
        "distribution": (True, plots.draw_distribution),
        "ellipses": (found.identified and len(found.names) > 1, plots.draw_ellipses),
        "profiles": (found.identified and found.profiles, plots.draw_profiles),
        "neutral": (True, plots.draw_neutral),
        "gains": (found.identified and own, partial(plots.draw_gains, singles=_singles(paper))),
    }
    return [
        *_pages(found, "fits", plots.draw_fits),
        *_pages(found, "residuals", plots.draw_residuals),
        *(Picture(n, partial(draw, found), n) for n, (shown, draw) in others.items() if shown),
    ]


def _singles(paper: PaperFits | None) -> dict[str, list[tuple[float, float]]]:
    """Return the paper's gains of single logs as draw_gains takes them."""
    each = () if paper is None else paper.each
    named = {
        "paper, eq. (26)": [(f.step, f.by_speed) for f in each],
        "paper, eq. (27)": [(f.step, f.by_depth) for f in each],
    }
    points = {
        name: [(step, fit.K2) for step, fit in fits if fit is not None]
        for name, fits in named.items()
    }
    return {name: found for name, found in points.items() if found}


def _pages(
    found: Identification, name: str, draw: Callable[[Identification, int], Figure]
) -> list[Picture]:
    """Return one picture for each so many logs."""
    count = len(found.experiments)
    firsts = range(0, count, plots.PER_PAGE)
    if len(firsts) == 1:
        return [Picture(name, partial(draw, found, 0), name)]
    parts = [f", logs {n + 1} to {min(n + plots.PER_PAGE, count)}" for n in firsts]
    return [
        Picture(f"{name}-{number}", partial(draw, found, first), name, part)
        for number, (first, part) in enumerate(zip(firsts, parts, strict=True), start=1)
    ]
