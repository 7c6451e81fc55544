"""A design as pictures: what each record should look like, and what the pool time buys."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swimbladder.design.experiments import Design
from swimbladder.show.plots import style
from swimbladder.show.plots.style import Ink

_COLORS = (Ink.BLUE, Ink.VERMILION, Ink.GREEN, Ink.PURPLE)
_ACROSS = 3


def groups(design: Design) -> list[tuple[int, ...]]:
    """Return the numbers of the experiments that are alike, counted from 1, in order."""
    found: dict[object, list[int]] = {}
    for k, release in enumerate(design.chosen.releases, start=1):
        found.setdefault(release, []).append(k)
    return [tuple(numbers) for numbers in found.values()]


@style.styled
def draw_plan(design: Design) -> Figure:
    """Return the traces to expect, a panel for each kind of experiment."""
    kinds = groups(design)
    across = min(_ACROSS, len(kinds))
    down = math.ceil(len(kinds) / across)
    figure = Figure(figsize=(max(2.9 * across, 5.0), 2.7 * down + 0.5))
    panels = style.grid_of(figure, len(kinds), across, sharey=True)
    for axes, numbers in zip(panels, kinds, strict=True):
        _trace(design, numbers, axes)
    style.depth_axis(panels[0], "")
    for k, axes in enumerate(panels):
        if k % across == 0:
            axes.set_ylabel("depth [m]")
        if k + across >= len(kinds):
            axes.set_xlabel("time since the release [s]")
    style.legend_beside(figure, panels[:1], "outside lower center")
    return figure


def _trace(design: Design, numbers: Sequence[int], axes: Axes) -> None:
    at, s = numbers[0] - 1, design.conditions.setting
    for flights in design.chosen.others:
        f = flights[at]
        time, label = f.time - f.time[f.moved[0]], "parameter region"
        axes.plot(time, f.depth, color=Ink.SKY, lw=0.8, alpha=0.8, label=label)
    f = design.chosen.flights[at]
    time, moved = f.time - f.time[f.moved[0]], list(f.moved)
    axes.plot(time, f.depth, color=Ink.BLACK, label="vehicle as given")
    label = "change of volume"
    axes.plot(time[moved], f.depth[moved], "o", color=Ink.VERMILION, ms=4.5, label=label)
    for depth in (s.shallowest, s.deepest):
        axes.axhline(depth, color=Ink.GREY, ls=":", lw=1.0)
    axes.axhline(s.pool_depth, color=Ink.GREY, lw=2.0)
    axes.set_ylim(s.pool_depth + 0.05 * s.pool_depth, 0.0)
    volumes = ", ".join(f"{1e6 * move.volume:+.3g}" for move in f.release.moves)
    axes.set_title(f"{_title(numbers)}\n{volumes} cm³", fontsize=9.0, loc="left")


def _title(numbers: Sequence[int]) -> str:
    """Return which experiments a panel shows: "Experiments 1, 3 to 6"."""
    parts: list[list[int]] = []
    for number in numbers:
        if not parts or number != parts[-1][-1] + 1:
            parts.append([])
        parts[-1].append(number)
    said = [f"{p[0]} to {p[-1]}" if len(p) > 2 else ", ".join(str(n) for n in p) for p in parts]
    return f"Experiment{'s' if len(numbers) > 1 else ''} {', '.join(said)}"


@style.styled
def draw_design(design: Design) -> Figure:
    """Return what the pool time buys: errors as experiments are done, and sizes of single steps."""
    figure, (after, size) = style.new_figure((8.2, 3.9), 1, 2)
    _after(design, after)
    _sizes(design, size)
    style.label_panels([after, size])
    return figure


def _after(design: Design, axes: Axes) -> None:
    names = design.chosen.prediction.names
    sets = [(design.chosen, "-", "o", "planned")]
    if design.against is not None:
        sets.append((design.against, "--", "s", design.rival))
    for evaluated, line, marker, label in sets:
        settling = design.conditions.setting.settling
        time = np.cumsum([settling + f.duration for f in evaluated.flights]) / 60.0
        for name, color in zip(names, _COLORS, strict=False):
            shares = 100.0 * np.array([a[name] for a in evaluated.after], float)
            how: Any = {"marker": marker, "ms": 3.5, "label": f"{_symbol(name)}, {label}"}
            axes.plot(time, shares, line, color=color, lw=1.2, **how)
    axes.set(yscale="log", xlabel="pool time, settling included [min]")
    axes.set_ylabel("1 sigma [% of the parameter]")
    axes.legend(fontsize=7.5, ncols=len(sets), loc="upper right")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * 4.0)
    style.plain_log_ticks(axes, "y")


def _sizes(design: Design, axes: Axes) -> None:
    c = design.curve
    for errors, mark, color, label in (
        (c.steps, "s-", Ink.ORANGE, "single steps"),
        (c.to_and_fro, "o-", Ink.GREEN, "to and fro"),
    ):
        axes.plot(1e6 * c.sizes, 100.0 * errors, mark, color=color, ms=3.5, label=label)
    axes.axhline(100.0 * design.chosen.largest, color=Ink.BLACK, lw=1.0, label="planned")
    axes.set(xscale="log", yscale="log", xlabel="change of volume [cm³]")
    axes.set_ylabel("largest error after the same time [%]")
    axes.legend(fontsize=8.0)
    style.plain_log_ticks(axes, "x", "y")


def _symbol(name: str) -> str:
    return {"psi": "ψ", "drag_quadratic": "k_dt", "mass": "m"}.get(name, name)
