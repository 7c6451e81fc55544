"""Steps of an actuator, measured against fitted, with residuals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swimbladder.estimation.actuator import ActuatorIdentification
from swimbladder.estimation.actuator.result import Step
from swimbladder.show.plots.style import BLACK, GREY, ORANGE, VERMILION, save, styled

_MOST = 12  # steps in the figure


def plot_steps(found: ActuatorIdentification, path: str | Path) -> Path:
    """Write a picture of measured and fitted positions of the steps, and their residuals.

    The suffix of the path chooses the format. Raises InputError where it cannot be written.
    """
    return save(draw_steps(found), path)


@styled
def draw_steps(found: ActuatorIdentification, source: str | None = None) -> Figure:
    """Return the figure that plot_steps writes; of many steps it shows some, evenly chosen.

    source: only the steps of this log, and no title.
    """
    own = [k for k, step in enumerate(found.steps) if source in (None, step.source)]
    count = len(own)
    some = np.unique(np.linspace(0, count - 1, min(count, _MOST)).round().astype(int))
    shown = [own[k] for k in some.tolist()]
    columns = min(4, len(shown))
    rows = math.ceil(len(shown) / columns)
    figure = Figure(figsize=(2.6 * columns + 0.6, 2.9 * rows + 0.5))
    scale, unit = (1e3, "mm") if found.quantity == "piston" else (1e6, "cm³")
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=[2.2, 1.0] * rows)
    largest = max(
        (
            float(np.abs(found.steps[k].residual[found.steps[k].used]).max(initial=0.0))
            for k in shown
        ),
        default=0.0,
    )
    limit = 1.2 * max(scale * largest, 1e-9)
    for place, k in enumerate(shown):
        row, column = divmod(place, columns)
        upper = figure.add_subplot(grid[2 * row, column])
        lower = figure.add_subplot(grid[2 * row + 1, column])
        _step(found.steps[k], k + 1, scale, upper, lower)
        lower.set_ylim(-limit, limit)
        if column == 0:
            upper.set_ylabel(f"{'travel' if unit == 'mm' else 'volume'} [{unit}]")
            lower.set_ylabel(f"residual\n[{unit}]")
        if place + columns >= len(shown):
            lower.set_xlabel("time in the step [s]")
        if place == 0:
            upper.legend(loc="best", fontsize=8.0)
    if source is None:
        part = "" if count == len(shown) else f", {len(shown)} of {count} steps"
        figure.suptitle(f"{_title(found)}{part}", x=0.01, ha="left", fontsize=10.0)
    figure.align_ylabels()
    return figure


def _step(step: Step, number: int, scale: float, upper: Axes, lower: Axes) -> None:
    """Draw a step above, of a long move its start only, and all residuals below."""
    t, start = step.time - step.time[0], step.position[step.used][:1].sum()
    part = slice(0, step.start or None)
    x, fitted, used = step.position[part] - start, step.fitted[part] - start, step.used[part]
    upper.plot(t[part][used], scale * x[used], ".", ms=3.5, color=BLACK, label="measured")
    if not used.all():
        low, high = upper.get_ylim()
        out = np.clip(scale * x[~used], low, high)
        upper.plot(t[part][~used], out, "x", ms=4, color=ORANGE, label="left out")
    upper.plot(t[part], scale * fitted, color=VERMILION, lw=1.2, label="fitted")
    lower.axhline(0.0, color=GREY, lw=0.8)
    lower.plot(t[step.used], scale * step.residual[step.used], ".", ms=2.5, color=BLACK)
    what = f"start, {step.label}" if step.start else step.label
    upper.set_title(f"step {number}: {what}", loc="left", fontsize=8.5)
    if not step.start:
        upper.sharex(lower)
        upper.tick_params(labelbottom=False)


def _title(found: ActuatorIdentification) -> str:
    parts = []
    for name, scale, unit in (
        ("K1", 1e3, "mm/s/V"), ("K1A", 1e6, "cm³/s/V"), ("T1", 1.0, "s"),
        ("dead_zone", 1.0, "V"), ("rate", 1e3 if found.quantity == "piston" else 1e6,
                                  "mm/s" if found.quantity == "piston" else "cm³/s"),
    ):  # fmt: skip
        e = found.parameters.get(name)
        if e is not None and e.value is not None:
            word = name.replace("_", " ")
            parts.append(
                f"{word} = {scale * e.value:.4g} ± {1.96 * scale * (e.std or 0.0):.2g} {unit}"
            )
    return ", ".join(parts) or "nothing is identified"
