"""The page of an identification: what was found in plain words first, then the evidence."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import Any

from swimbladder import __version__
from swimbladder.identify import Choice, ExperimentFit, Identification
from swimbladder.plots.identify import labels
from swimbladder.report.html import render
from swimbladder.report.words import Row, correlations, findings, headlines, row, rows

__all__ = ["page"]

_PSI = {"free": "estimated", "prior": "with its prior", "set": "as set", "zero": "left out"}


def page(
    found: Identification, images: Sequence[tuple[str, str, str, bytes]], *,
    files: Sequence[str], command: str, seconds: float,
) -> str:  # fmt: skip
    """Return the report as HTML that needs nothing but itself.

    images: (name, title, caption, PNG) of each; seconds: how long the fit took.
    """
    listed = findings(found)
    figures = {
        name: {"name": name, "title": title, "caption": caption, "data": _data(image)}
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
            "noise": f"{1e3 * found.depth_noise:.2g}",
            "seconds": f"{seconds:.2g}",
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
            "names": list(found.names) if found.identified else [],
            "choices": [_choice(found, c) for c in found.choices],
            "figures": figures,
            "fits": [f for name, f in figures.items() if name.startswith("fits")],
            "residuals": [f for name, f in figures.items() if name.startswith("residuals")],
            "assumptions": found.assumptions,
            "reading": found.notes,
            "files": files,
            "command": command,
        },
    )


def _data(image: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(image).decode("ascii")


def _pair(r: float) -> str:
    """Return what a correlation means."""
    way = "too large together" if r > 0.0 else "one too large, the other too small"
    return f"if they are off, then {way}"


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
        "rms": f"{1e3 * e.rms:.2g}",
        "noise": f"{1e3 * e.noise:.2g}",
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
        "rms": f"{1e3 * c.rms:.3g}",
        "behind": f"{c.bic - best:.1f}" if math.isfinite(c.bic) else "-",
        "weight": f"{100.0 * c.weight:.3g}" if c.weight > 1e-4 else "below 0.01",
        "bar": round(100.0 * c.weight, 1),
        "values": {name: f"{value:.4g}" for name, value in c.values.items()},
    }
