"""A log against the model as a picture: depths, their difference, and what drove the model.

What a causal filter predicted, over what was measured.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swimbladder.estimation.comparison import Comparison
from swimbladder.estimation.comparison.ahead import Ahead, Horizon
from swimbladder.show.plots.style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    SKY,
    VERMILION,
    depth_axis,
    save,
    styled,
)

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


_SHADE = "#E8E8E8"


def plot_comparison(comparison: Comparison, path: str | Path) -> Path:
    """Write a picture of measured and predicted depth, the residual and the input.

    The suffix of the path chooses the format. Raises InputError where it cannot be written.
    """
    return save(draw_comparison(comparison), path)


@styled
def draw_comparison(comparison: Comparison) -> Figure:
    """Return the figure that plot_comparison writes."""
    figure = Figure(figsize=(7.5, 6.4))
    depth, residual, driven = figure.subplots(
        3, 1, sharex=True, gridspec_kw={"height_ratios": [3.0, 1.4, 1.6]}
    )
    for axes in (depth, residual):
        _shade(comparison, axes)
    _depth(comparison, depth)
    _residual(comparison, residual)
    _input(comparison, driven)
    time = comparison.record.time
    driven.set_xlabel("time since the first sample [s]")
    driven.set_xlim(float(time[0]), float(time[-1]))
    figure.suptitle(_title(comparison), x=0.01, ha="left", fontsize=10.0)
    figure.align_ylabels([depth, residual, driven])
    return figure


def _title(c: Comparison) -> str:
    return (
        f"{c.vehicle.name} driven by the {_DRIVEN[c.record.drive]}: rms {1e3 * c.rms:.1f} mm, "
        f"bias {1e3 * c.bias:+.1f} mm, {100.0 * c.variance_explained:.2f} % of the variance"
    )


def _depth(c: Comparison, axes: Axes) -> None:
    rec = c.record
    if rec.reference is not None:
        axes.step(rec.time, rec.reference, where="post", color=GREY, ls="--", lw=1.0,
                  label="set-point")  # fmt: skip
    axes.plot(rec.time, rec.depth, color=BLACK, lw=1.0, label="measured")
    axes.plot(rec.time, c.predicted, color=VERMILION, lw=1.3, label="predicted")
    depth_axis(axes)
    axes.margins(y=0.08)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=4)


_DRIVEN = {"volume": "logged volume", "voltage": "logged voltage", "setpoint": "logged set-point"}


def _residual(c: Comparison, axes: Axes) -> None:
    axes.axhline(0.0, color=BLACK, lw=0.8)
    axes.plot(c.record.time, 1e3 * c.residual, color=VERMILION, lw=0.9)
    largest = 1e3 * max(c.largest, 1e-3)
    axes.set_ylim(-1.15 * largest, 1.15 * largest)
    axes.set_ylabel("predicted less\nmeasured [mm]")


def _input(c: Comparison, axes: Axes) -> None:
    rec = c.record
    if rec.drive == "voltage" and rec.voltage is not None:
        axes.step(rec.time, rec.voltage, where="post", color=BLUE, lw=0.9)
        axes.set_ylabel("voltage [V]")
        return
    if rec.volume is not None:
        axes.plot(rec.time, 1e6 * rec.volume, color=BLACK, lw=0.8, label="measured")
    if rec.drive == "setpoint":
        axes.plot(rec.time, 1e6 * c.volume, color=VERMILION, lw=1.0, label="predicted")
    neutral = 1e6 * np.array([c.vehicle.neutral_volume(z) for z in rec.depth.tolist()])
    axes.plot(rec.time, neutral, color=SKY, lw=1.0, label="neutral")
    for stop in (c.vehicle.stroke.minimum * 1e6, c.vehicle.stroke.maximum * 1e6):
        low, high = axes.get_ylim()
        if low < stop < high:
            axes.axhline(stop, color=ORANGE, ls=":", lw=1.0, label="end stop")
    axes.set_ylabel("volume [cm³]")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=4)


def _shade(c: Comparison, axes: Axes) -> None:
    """Shade what is not compared."""
    rec = c.record
    out = np.concatenate(([False], ~rec.compared, [False])).astype(int)
    edges = np.flatnonzero(np.diff(out))
    for k, (first, after) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        axes.axvspan(
            rec.time[first],
            rec.time[min(after, len(rec.time) - 1)],
            color=_SHADE,
            lw=0,
            zorder=0,
            label="not compared" if k == 0 else None,
        )
