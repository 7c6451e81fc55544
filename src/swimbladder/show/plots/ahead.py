"""What a causal filter predicted, over what was measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swimbladder.estimation.comparison.ahead import Ahead, Horizon
from swimbladder.show.plots.style import BLACK, SKY, VERMILION, depth_axis, save, styled

_Z95 = 1.959963984540054


def plot_ahead(ahead: Ahead, path: str | Path) -> Path:
    """Write a picture of the depths predicted so long before, with their 95 % bands.

    The suffix of the path chooses the format. Raises InputError where it cannot be written.
    """
    return save(draw_ahead(ahead), path)


@styled
def draw_ahead(ahead: Ahead) -> Figure:
    """Return the figure that plot_ahead writes."""
    count = len(ahead.horizons)
    figure = Figure(figsize=(7.5, 1.0 + 2.6 * count))
    panels = figure.subplots(count, 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, horizon in zip(panels, ahead.horizons, strict=True):
        _panel(ahead, horizon, axes)
    depth = ahead.record.depth
    low, high = float(depth.min()), float(depth.max())
    room = 0.25 * max(high - low, 0.1)
    panels[0].set_ylim(high + room, low - room)
    time = ahead.record.time
    panels[-1].set_xlim(float(time[0]), float(time[-1]))
    panels[-1].set_xlabel("time since the first sample [s]")
    return figure


def _panel(ahead: Ahead, h: Horizon, axes: Axes) -> None:
    time = ahead.record.time[h.target]
    order = np.argsort(h.target)
    apart = np.flatnonzero(np.diff(h.target[order]) > 1) + 1  # no line over what is not predicted
    for k, part in enumerate(np.split(order, apart)):
        middle, half = h.predicted[part], _Z95 * h.std[part]
        label = (f"predicted {h.seconds:g} s before", "95 % band") if k == 0 else (None, None)
        axes.fill_between(
            time[part], middle - half, middle + half, color=SKY, alpha=0.35, lw=0, label=label[1]
        )
        axes.plot(time[part], middle, color=VERMILION, lw=1.2, label=label[0])
    axes.plot(ahead.record.time, ahead.record.depth, color=BLACK, lw=0.9, label="measured")
    skill = h.skill["persistence"]
    said = "" if skill is None else f", skill {skill:.2f} against a depth that stays"
    axes.set_title(
        f"{h.seconds:g} s ahead: rms {1e3 * h.rms:.0f} mm{said}", loc="left", fontsize=10.0
    )
    depth_axis(axes)
    axes.legend(loc="upper right", ncols=3)
