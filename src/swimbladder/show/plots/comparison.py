"""A log against the model as a picture: depths, their difference, and what drove the model.

And what a causal filter predicted, over what was measured.
"""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swimbladder.estimation.comparison import Comparison
from swimbladder.estimation.comparison.ahead import Ahead, Horizon
from swimbladder.show.plots import style
from swimbladder.show.plots.style import Ink

_Z95 = 1.959963984540054


@style.styled
def draw_ahead(ahead: Ahead) -> Figure:
    """Return the depths predicted so long before, with their 95 % bands."""
    count = len(ahead.horizons)
    figure, panels = style.new_figure((7.5, 1.0 + 2.6 * count), count, sharex=True, sharey=True)
    for axes, horizon in zip(panels, ahead.horizons, strict=True):
        _panel(ahead, horizon, axes)
    depth = ahead.record.depth
    low, high = float(depth.min()), float(depth.max())
    room = 0.25 * max(high - low, 0.1)
    panels[0].set_ylim(high + room, low - room)
    time = ahead.record.time
    panels[-1].set(xlim=(float(time[0]), float(time[-1])), xlabel="time since the first sample [s]")
    return figure


def _panel(ahead: Ahead, h: Horizon, axes: Axes) -> None:
    time = ahead.record.time[h.target]
    order = np.argsort(h.target)
    apart = np.flatnonzero(np.diff(h.target[order]) > 1) + 1  # no line over what is not predicted
    label = f"predicted {h.seconds:g} s before"
    shown: Any = {"color": Ink.SKY, "alpha": 0.35, "lw": 0, "label": "95 % band"}
    for part in np.split(order, apart):
        middle, half = h.predicted[part], _Z95 * h.std[part]
        axes.fill_between(time[part], middle - half, middle + half, **shown)
        axes.plot(time[part], middle, color=Ink.VERMILION, lw=1.2, label=label)
    axes.plot(ahead.record.time, ahead.record.depth, color=Ink.BLACK, lw=0.9, label="measured")
    skill = h.skill["persistence"]
    said = "" if skill is None else f", skill {skill:.2f} against a depth that stays"
    title = f"{h.seconds:g} s ahead: rms {1e3 * h.rms:.0f} mm{said}"
    axes.set_title(title, loc="left", fontsize=10.0)
    style.depth_axis(axes)
    style.legend_above(axes, loc="upper right", bbox_to_anchor=None, ncols=3)


@style.styled
def draw_comparison(comparison: Comparison) -> Figure:
    """Return measured and predicted depth, the residual and the input."""
    figure, (depth, residual, driven) = style.stacked((7.5, 6.4), 3.0, 1.4, 1.6)
    record = comparison.record
    for axes in (depth, residual):
        style.shade(axes, record.time, ~record.compared, "not compared")
    if record.reference is not None:
        style.setpoint(depth, record.time, record.reference)
    depth.plot(record.time, record.depth, color=Ink.BLACK, lw=1.0, label="measured")
    depth.plot(record.time, comparison.predicted, color=Ink.VERMILION, lw=1.3, label="predicted")
    style.depth_axis(depth)
    depth.margins(y=0.08)
    style.legend_above(depth)
    residual.axhline(0.0, color=Ink.BLACK, lw=0.8)
    residual.plot(record.time, 1e3 * comparison.residual, color=Ink.VERMILION, lw=0.9)
    largest = 1.15e3 * max(comparison.largest, 1e-3)
    residual.set(ylim=(-largest, largest), ylabel="predicted less\nmeasured [mm]")
    _input(comparison, driven)
    ends = (float(record.time[0]), float(record.time[-1]))
    driven.set(xlabel="time since the first sample [s]", xlim=ends)
    figure.suptitle(_title(comparison), x=0.01, ha="left", fontsize=10.0)
    figure.align_ylabels([depth, residual, driven])
    return figure


def _title(c: Comparison) -> str:
    driven = c.record.drive.replace("setpoint", "set-point")
    off = f"rms {1e3 * c.rms:.1f} mm, bias {1e3 * c.bias:+z.1f} mm"
    share = f"{100.0 * c.variance_explained:.2f} % of the variance"
    return f"{c.vehicle.name} driven by the logged {driven}: {off}, {share}"


def _input(c: Comparison, axes: Axes) -> None:
    rec = c.record
    if rec.drive == "voltage" and rec.voltage is not None:
        axes.step(rec.time, rec.voltage, where="post", color=Ink.BLUE, lw=0.9)
        axes.set_ylabel("voltage [V]")
        return
    if rec.volume is not None:
        axes.plot(rec.time, 1e6 * rec.volume, color=Ink.BLACK, lw=0.8, label="measured")
    if rec.drive == "setpoint":
        axes.plot(rec.time, 1e6 * c.volume, color=Ink.VERMILION, lw=1.0, label="predicted")
    neutral = 1e6 * np.array([c.vehicle.neutral_volume(z) for z in rec.depth.tolist()])
    axes.plot(rec.time, neutral, color=Ink.SKY, lw=1.0, label="neutral")
    for stop in (c.vehicle.stroke.minimum * 1e6, c.vehicle.stroke.maximum * 1e6):
        low, high = axes.get_ylim()
        if low < stop < high:
            axes.axhline(stop, color=Ink.ORANGE, ls=":", lw=1.0, label="end stop")
    axes.set_ylabel("volume [cm³]")
    style.legend_above(axes)
