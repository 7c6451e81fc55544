"""The page of an identification: what was found in plain words first, then the evidence."""

from __future__ import annotations

import base64
import math
import struct
from collections.abc import Sequence
from typing import Any

from swimbladder import __version__
from swimbladder.estimation.motion import NAMES, Choice, ExperimentFit, Identification
from swimbladder.estimation.motion.paper_method import PaperFits
from swimbladder.estimation.motion.random_walk import RandomWalkFit
from swimbladder.show.plots.identify import labels
from swimbladder.show.report.html import render
from swimbladder.show.report.text import Row, correlations, findings, headlines, reading, row, rows
from swimbladder.sim.pool import Fit
from swimbladder.units import rounded, shown_unit, unit_factor

_SYMBOL = {"drag_quadratic": "k_dt", "mass": "m"}
_FULL = 1440  # pixels of a picture as wide as the page
_PSI = {"free": "estimated", "prior": "with its prior", "set": "as set", "zero": "left out"}


def page(
    found: Identification, images: Sequence[tuple[str, str, str, bytes]], *,
    files: Sequence[str], command: str, seconds: float, paper: PaperFits | None = None,
) -> str:  # fmt: skip
    """Return the report as HTML that needs nothing but itself.

    images: (name, title, caption, PNG) of each; seconds: how long the fit took; paper: the paper's
    fits, to stand beside ours.
    """
    listed = findings(found)
    figures = {
        name: {
            "name": name,
            "title": title if title.endswith("?") else f"{title}.",
            "caption": caption,
            "data": _data(image),
            "width": _width(image),
        }
        for name, title, caption, image in images
    }
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
            "pairs": [
                {"names": f"{a} and {b}", "value": f"{r:+.2f}", "what": _pair(r)}
                for a, b, r in correlations(found)
            ],
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


def _data(image: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(image).decode("ascii")


def _width(image: bytes) -> str:
    """Return how much of the page's width a PNG takes, so that all letters are of one size."""
    (pixels,) = struct.unpack(">I", image[16:20])
    return f"{min(100.0 * pixels / _FULL, 100.0):.0f}%"


def _pair(r: float) -> str:
    """Return what a correlation means."""
    if r > 0.0:
        return "where one is too large, so is the other"
    return "where one is too large, the other is too small"


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
        "psi": _PSI[c.psi],
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
    listed = [
        {
            "label": name,
            "step": f"{1e6 * fit.step:.3g}" if math.isfinite(fit.step) else "-",
            "speed": _fitted(fit.by_speed, "mm/s"),
            "depth": _fitted(fit.by_depth, "mm"),
            "why": fit.why,
        }
        for name, fit in zip(names, paper.each, strict=True)
    ]
    average = {
        "label": "average",
        "step": "",
        "speed": _fitted(paper.by_speed, "mm/s"),
        "depth": _fitted(paper.by_depth, "mm"),
        "why": "",
    }
    return {"sentence": paper.sentence, "rows": [*listed, average]}


def _fitted(fit: Fit | None, unit: str) -> list[str]:
    if fit is None:
        return ["-", "-", "-"]
    return [rounded(fit.K2), rounded(fit.T2, 3), f"{rounded(1e3 * fit.rms, 2)} {unit}"]
