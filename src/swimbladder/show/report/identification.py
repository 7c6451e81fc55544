"""What an identification found, as files: page, numbers, residuals, pictures and the vehicle.

The page has what was found in plain words first, then the evidence.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from swimbladder import __version__
from swimbladder.errors import InputError
from swimbladder.estimation.motion import NAMES, Choice, ExperimentFit, Identification
from swimbladder.estimation.motion.paper_method import PaperFits
from swimbladder.estimation.motion.random_walk import RandomWalkFit
from swimbladder.io.config import file_text
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.files import write_all
from swimbladder.show.plots import identify as plots
from swimbladder.show.plots import identify_confidence as confidence
from swimbladder.show.plots.identify import labels
from swimbladder.show.plots.style import png
from swimbladder.show.report.html import Picture, page_figure, render
from swimbladder.show.report.text import (
    Row,
    correlations,
    findings,
    headlines,
    reading,
    row,
    rows,
    trade_off,
)
from swimbladder.sim.pool import Fit
from swimbladder.units import rounded, shown_unit, unit_factor

_SYMBOL = {"drag_quadratic": "k_dt", "mass": "m"}
PSI = {"free": "estimated", "prior": "with its prior", "set": "as set", "zero": "left out"}


def page(
    found: Identification, images: Iterable[tuple[str, str, str, bytes]], *,
    files: Sequence[str], command: str, seconds: float, paper: PaperFits | None = None,
) -> str:  # fmt: skip
    """Return the report as HTML that needs nothing but itself.

    images: (name, title, caption, PNG) of each; seconds: how long the fit took; paper: the paper's
    fits, to stand beside ours.
    """
    listed = findings(found)
    figures = {image[0]: page_figure(*image) for image in images}
    return render(
        "identification.html.j2",
        {
            "version": __version__,
            "vehicle": found.result_vehicle.name,
            "identified": found.identified,
            "law": found.law,
            "count": len(found.experiments),
            "samples": sum(int((e.weight > 0.0).sum()) for e in found.experiments),
            "noise": rounded(1e3 * found.depth_noise, 2),
            "seconds": rounded(seconds, 2),
            "headlines": headlines(found),
            "warnings": [f for f in listed if f.severity == "warning"],
            "notes": [f for f in listed if f.severity == "note"],
            "rows": rows(found),
            "pairs": [trade_off(a, b, r) for a, b, r in correlations(found)],
            "logs": [
                _log(label, e) for label, e in zip(labels(found), found.experiments, strict=True)
            ],
            "choices": [_choice(found, c) for c in found.choices],
            "random_walk": found.random_walk and _random_walk(found.random_walk, labels(found)),
            "paper": None if paper is None else _paper(paper, labels(found)),
            "figures": figures,
            "fits": [f for name, f in figures.items() if name.startswith("fits")],
            "residuals": [f for name, f in figures.items() if name.startswith("residuals")],
            "assumptions": found.assumptions,
            "reading": reading(found, labels(found)),
            "files": files,
            "command": command,
        },
    )


def _log(label: str, e: ExperimentFit) -> dict[str, Any]:
    neutral, drift = (row("", x) for x in (e.estimates["neutral_error"], e.drift))
    used = int((e.weight > 0.0).sum())
    span = float(e.record.time[-1] - e.record.time[0])
    return {
        "label": label,
        "source": e.source,
        "seconds": f"{span:.0f}",
        "used": f"{used} of {len(e.record.time)}",
        "outliers": e.outliers,
        "rms": rounded(1e3 * e.rms, 2),
        "noise": rounded(1e3 * e.noise, 2),
        "white": "white" if e.whiteness_p > 0.01 else f"coloured (p {_small(e.whiteness_p)})",
        "neutral": _plus_minus(neutral),
        "drift": _plus_minus(drift),
    }


def _plus_minus(r: Row) -> str:
    return f"{r.value} +- {r.std}" if r.std else "-"


def _small(p: float) -> str:
    return f"{p:.1g}" if p > 1e-4 else "below 1e-4"


def _choice(found: Identification, c: Choice) -> dict[str, Any]:
    best = min(other.bic for other in found.choices)
    return {
        "drag": c.drag,
        "psi": PSI[c.psi],
        "reported": c.reported,
        "parameters": c.parameters,
        "rms": rounded(1e3 * c.rms, 3),
        "behind": f"{c.bic - best:.1f}" if math.isfinite(c.bic) else "-",
        "weight": f"{100.0 * c.weight:.3g}" if c.weight > 1e-4 else "below 0.01",
        "bar": round(100.0 * c.weight, 1),
        "values": ", ".join(_value(name, value) for name, value in c.values.items())
        if found.identified
        else "",
    }


def _value(name: str, value: float) -> str:
    unit = NAMES[name].unit
    shown = value * unit_factor(unit, shown_unit(unit))
    if abs(shown) < 1e-9:  # a fit that ended at a bound, to rounding
        shown = 0.0
    return f"{_SYMBOL.get(name, name)} {rounded(shown)} {shown_unit(unit)}"


def _random_walk(fit: RandomWalkFit, names: Sequence[str]) -> dict[str, Any]:
    """Return the intensity, its evidence, and the range of each log's neutral volume."""
    low, high = (1e6 * 60.0**0.5 * end for end in fit.random_walk.ci95)  # m3/s^0.5 to cm3/min^0.5
    return {
        "intensity": rounded(1e6 * 60.0**0.5 * fit.random_walk.value, 2),
        "ci95": f"{rounded(low, 2)} to {rounded(high, 2)}",
        "p": _small(fit.p_value),
        "rows": [
            (name, rounded(1e6 * went, 2)) for name, went in zip(names, fit.travelled, strict=True)
        ],
    }


def _paper(paper: PaperFits, names: Sequence[str]) -> dict[str, Any]:
    """Return the paper's fits as texts: each log, then the averages."""
    fits: list[tuple[str, str, Any, str]] = [
        (name, f"{1e6 * fit.step:.3g}" if math.isfinite(fit.step) else "-", fit, fit.why)
        for name, fit in zip(names, paper.each, strict=True)
    ]
    fits.append(("average", "", paper, ""))
    return {
        "sentence": paper.sentence,
        "rows": [
            {
                "label": label,
                "step": step,
                "speed": _fitted(fit.by_speed, "mm/s"),
                "depth": _fitted(fit.by_depth, "mm"),
                "why": why,
            }
            for label, step, fit, why in fits
        ],
    }


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
    if Path(vehicle).exists() and target.samefile(vehicle):
        what = "the identified vehicle would be written over the one that is read"
    elif not _is_ours(target):
        what = "there is a vehicle that `swimbladder identify` did not write"
    else:
        return
    raise InputError(what, file=target, field="--out", remedy="Choose another folder with --out")


def _is_ours(path: Path) -> bool:
    return path.is_file() and file_text(path).startswith(f"# {MARK} ")


def write_identification(
    found: Identification, out: Path, *, answer: Mapping[str, Any], command: str, seconds: float,
    paper: PaperFits | None = None, advance: Callable[[float], None] = lambda _: None,
) -> list[Path]:  # fmt: skip
    """Write everything into the folder `out` and return the paths.

    answer: identify.json; command: how the page says that it was made; seconds: how
    long the fit took; paper: the paper's fits, to stand beside. advance: called with the share of
    the work done. No vehicle is written where the data do not identify all that was asked, and one
    of an earlier run is taken away. Raises InputError where the folder cannot be written; whatever
    is in it then stays as it is.
    """
    check_folder(out, "")
    drawn = pictures(found, paper)
    images = []
    for picture in drawn:
        images.append((picture.name, picture.title, picture.caption, png(picture.draw())))
        advance(1.0 / (len(drawn) + 1))
    files: dict[str, object] = {"identify.json": answer, "residuals.csv": residuals(found)}
    if found.identified:
        files[VEHICLE] = vehicle_file(found.vehicle, head=_head(found))
    files |= {f"figures/{name}.png": image for name, _, _, image in images}
    if found.posterior is not None:
        names = (f"{name} [{NAMES[name].unit}]" for name in found.posterior.names)
        files[POSTERIOR] = dict(zip(names, found.posterior.draws.T, strict=True))
    html = page(found, images, files=list(files), command=command, seconds=seconds, paper=paper)
    written = write_all(out, {"identify.html": html, **files})
    _sweep(out, [*files])
    advance(1.0 / (len(drawn) + 1))
    return written


def _sweep(out: Path, kept: list[str]) -> None:
    """Take away what an earlier run left and this one did not replace."""
    stale = [path for path in (out / "figures").glob("*.png") if _OURS.fullmatch(path.name)]
    if _is_ours(out / VEHICLE):
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
        r = e.record
        nothing = np.full(len(r.time), np.nan)
        listed.append(
            {
                "log": np.full(len(r.time), float(number)),
                "time_s": r.time,
                "depth_m": r.depth,
                "depth_fitted_m": e.predicted,
                "residual_m": e.residual,
                "weight": e.weight,
                "volume_m3": nothing if r.volume is None else r.volume,
                "voltage_V": nothing if r.voltage is None else r.voltage,
            }
        )
    columns = {name: np.concatenate([one[name] for one in listed]) for name in listed[0]}
    return {
        name: values
        for name, values in columns.items()
        if name not in ("volume_m3", "voltage_V") or np.isfinite(values).any()
    }


def pictures(found: Identification, paper: PaperFits | None = None) -> list[Picture]:
    """Return the figures that this identification has, in the order of the page.

    paper: the paper's fits of single logs, drawn beside ours.
    """
    own = any(e.own_gain is not None for e in found.experiments)
    others = (
        (True, "distribution", "Is it noise?",
         "Left and middle: the residuals of all logs, over each log's own standard deviation, "
         "against a normal distribution; triangles are further out than the axis. Right: how "
         "much a residual resembles the ones before it.",
         plots.draw_distribution),
        (found.identified and len(found.names) > 1, "ellipses",
         "Which pairs of values go together",
         "Regions that hold both values with 68 % and 95 %. A long, thin one is a trade-off: the "
         "data determine one combination better than each value.",
         confidence.draw_ellipses),
        (found.identified and found.profiles, "profiles", "Likelihood profiles",
         "How much worse the fit becomes as one parameter is held and all others follow. Bars: the "
         "95 % interval of the profile and that of the quadratic approximation; where these "
         "differ by much, the profile's is given.",
         confidence.draw_profiles),
        (True, "neutral", "Neutral volumes",
         "Left: how far each log's neutral volume is from the assumed one, against what was "
         "assumed of it. Right: how it would drift if it did, from a step of the fit; an interval "
         "without 0 is a drift that is not in the model.",
         plots.draw_neutral),
        (found.identified and own, "gains", "Does the gain depend on the size of the step?",
         "What each log would say alone, all but psi its own, against the size of its volume "
         "change. A trend is the mark of a psi, or of a drag law, that is not right.",
         partial(plots.draw_gains, singles=_singles(paper))),
    )  # fmt: skip
    return [
        *_pages(
            found, "fits", "Measured and fitted depth",
            "All logs share one set of parameters; each has its own neutral volume and start.",
            plots.draw_fits,
        ),
        *_pages(
            found, "residuals", "What the fit leaves over",
            "Measured less fitted depth. A pattern in time is something that the model does not "
            "know. The band holds 95 % of the noise; outliers count less or not at all.",
            plots.draw_residuals,
        ),
        *(
            Picture(name, title, caption, partial(draw, found))
            for shown, name, title, caption, draw in others
            if shown
        ),
    ]  # fmt: skip


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
    found: Identification, name: str, title: str, caption: str,
    draw: Callable[[Identification, int], Figure],
) -> list[Picture]:  # fmt: skip
    """Return one picture for each so many logs."""
    count = len(found.experiments)
    firsts = range(0, count, plots.PER_PAGE)
    if len(firsts) == 1:
        return [Picture(name, title, caption, partial(draw, found, 0))]
    return [
        Picture(
            f"{name}-{number}",
            f"{title}, logs {first + 1} to {min(first + plots.PER_PAGE, count)}",
            caption,
            partial(draw, found, first),
        )
        for number, first in enumerate(firsts, start=1)
    ]
