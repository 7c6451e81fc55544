"""The table of a calibration study."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

from studies.scenarios import Scenario

__all__ = ["HEADINGS", "Z95", "binomial_interval", "figures", "render", "summary"]

HEADINGS = (
    "scenario",
    "parameter",
    "covered %",
    "(95 %)",
    "bias %",
    "+-",
    "rms %",
    "rms/bound",
    "width/bound",
    "no %",
    "s",
)
Z95 = 1.959963984540054


def figures(name: str, found: Sequence[dict[str, Any]], *, logarithmic: bool) -> dict[str, float]:
    """Return the figures of one parameter over the campaigns that were identified.

    covered, bias, its standard error, and rms as fractions of the truth; rms_bound: rms of errors
    over the least deviation possible; width_bound: mean of the intervals' widths over the least.
    """
    met = [f["parameters"][name] for f in found if f["identified"]]
    truth, value, low, high, bound = (
        np.array([p[key] for p in met], float) for key in ("truth", "value", "low", "high", "bound")
    )
    off = (value - truth) / np.abs(truth)
    if logarithmic:
        error, width = np.log(value / truth), np.log(high / low)
    else:
        error, width = (value - truth) / np.abs(truth), (high - low) / np.abs(truth)
    count = len(met)
    return {
        "count": count,
        "hits": int(np.sum((low <= truth) & (truth <= high))),
        "bias": float(off.mean()),
        "bias_error": float(off.std() / math.sqrt(count)),
        "rms": float(np.sqrt(np.mean(off**2))),
        "rms_bound": float(np.sqrt(np.mean((error / bound) ** 2))),
        "width_bound": float(np.mean(width / (2.0 * Z95 * bound))),
    }


def summary(scenario: Scenario, found: Sequence[dict[str, Any]]) -> list[list[str]]:
    """Return a row of the table for each parameter, in the order of HEADINGS."""
    identified = sum(f["identified"] for f in found)
    refused = f"{100.0 * (1.0 - identified / len(found)):.1f}"
    if not identified:
        return [[scenario.name, "-", *["-"] * 7, refused, "-"]]
    seconds = np.median([f["seconds"] for f in found if "seconds" in f])
    rows = []
    for name in scenario.names:
        f = figures(name, found, logarithmic=scenario.logarithmic(name))
        low, high = binomial_interval(int(f["hits"]), int(f["count"]))
        rows.append(
            [
                scenario.name,
                name,
                f"{100.0 * f['hits'] / f['count']:.1f}",
                f"{100.0 * low:.1f}-{100.0 * high:.1f}",
                f"{100.0 * f['bias']:+.2f}",
                f"{100.0 * f['bias_error']:.2f}",
                f"{100.0 * f['rms']:.2f}",
                f"{f['rms_bound']:.2f}",
                f"{f['width_bound']:.2f}",
                refused,
                f"{seconds:.2f}",
            ]
        )
    return rows


def binomial_interval(hits: int, count: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a share (Clopper and Pearson 1934)."""
    low = beta.ppf(0.025, hits, count - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, count - hits) if hits < count else 1.0
    return float(low), float(high)


def render(rows: Sequence[Sequence[str]], scenarios: Sequence[Scenario]) -> str:
    """Return the table as text, and below it what its scenarios and columns are."""
    cells = [list(HEADINGS), *map(list, rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(HEADINGS))]
    lines = []
    for k, row in enumerate(cells):
        if k > 1 and row[0] == cells[k - 1][0]:
            row = ["", *row[1:]]  # named once
        text = [
            cell.ljust(width) if i < 2 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(text).rstrip())
    lines.insert(1, "  ".join("-" * width for width in widths))
    lines += [
        "",
        "covered: 95 % intervals that hold the truth, with the share's own 95 % interval;",
        "bias +-: mean error in % of the truth, its standard error; rms: root mean square error;",
        "bound: of Cramer and Rao, with the priors; no: campaigns declared not identifiable;",
        "s: median time of a fit",
        *(f"{s.name}: {s.sentence}" for s in scenarios),
    ]
    return "\n".join(lines)
