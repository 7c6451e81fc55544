"""What each log says by itself: its neutral volume, and its own gain beside that of all."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swimbladder.estimation.motion import Estimate, ExperimentFit, Identification
from swimbladder.estimation.motion.estimates import Z95
from swimbladder.show.plots.identify import labels
from swimbladder.show.plots.identify_confidence import WIDTH, axis_label, per_shown
from swimbladder.show.plots.style import BLACK, BLUE, GREEN, ORANGE, SKY, VERMILION, styled


@styled
def draw_neutral(found: Identification) -> Figure:
    """Return each log's neutral-volume error against what was assumed of it, and its drift."""
    names = labels(found)
    count = len(names)
    figure = Figure(figsize=(WIDTH, max(2.4, 0.28 * count + 1.3)))
    left, right = figure.subplots(1, 2, sharey=True)
    errors = [e.estimates["neutral_error"] for e in found.experiments]
    if math.isfinite(found.neutral_std):
        for k, alpha in ((2.0, 0.12), (1.0, 0.18)):
            reach = 1e6 * k * found.neutral_std
            left.axvspan(
                -reach, reach, color=ORANGE, alpha=alpha, lw=0.0,
                label=f"assumed, ±{k:.0f} standard deviation{'s' if k > 1.0 else ''}",
            )  # fmt: skip
    _dots(left, errors, "m3")
    left.set(xlabel="neutral volume, true less assumed [cm³]")
    left.set_yticks(range(count), labels=names)
    left.set_ylim(count - 0.4, -0.6)
    _dots(right, [e.drift for e in found.experiments], "m3/s")
    right.set(xlabel="drift of the neutral volume [cm³/h]")
    for axes in (left, right):
        axes.axvline(0.0, color=BLACK, lw=0.8)
        axes.grid(axis="y", visible=False)
    handles, texts = left.get_legend_handles_labels()
    figure.legend(handles, texts, loc="outside upper center", ncols=len(texts))
    return figure


def _dots(axes: Axes, estimates: Sequence[Estimate], unit: str) -> None:
    """Draw estimates with their 95 % intervals, one above the other."""
    per = per_shown(unit)
    values = per * np.array([e.value for e in estimates])
    half = per * np.array([Z95 * e.std for e in estimates])
    known = np.isfinite(half)
    at = np.arange(len(values))
    axes.errorbar(
        values[known], at[known], xerr=half[known], fmt="o", ms=4.5, color=BLUE, elinewidth=1.3,
        capsize=2.5, label="estimate, 95 %",
    )  # fmt: skip


@styled
def draw_gains(
    found: Identification, singles: Mapping[str, Sequence[tuple[float, float]]] | None = None
) -> Figure:
    """Return each log's own gain against the size of its volume change, and that of all.

    singles: other fits of single logs, by what they are called: (volume change [m3], K2) of each.
    The gain is K2; where a vehicle has none, the ratio to that of all. Raises ValueError where no
    log has a gain of its own.
    """
    own = [e for e in found.experiments if e.own_gain is not None]
    if not own:
        raise ValueError("no log has a gain of its own")
    absolute = "K2" in found.names
    joint = found.parameters["K2"].value if absolute else 1.0
    of_all = found.parameters["K2" if absolute else "drag_quadratic"]
    figure = Figure(figsize=(WIDTH * 0.8, 3.6))
    axes = figure.add_subplot()
    ratios = sorted(
        of_all.value / end if not absolute else end / of_all.value for end in of_all.ci95
    )
    shown: list[Any] = [  # in the order of the key
        axes.axhspan(
            joint * ratios[0], joint * ratios[1], color=SKY, alpha=0.3, lw=0.0,
            label="all logs, 95 %",
        )
    ]  # fmt: skip
    axes.axhline(joint, color=BLUE, lw=1.0)
    widest = max(e.step for e in own)
    for sinks, mark, label in ((False, "^", "rising"), (True, "v", "sinking")):
        chosen = [e for e in own if _sinks(e) == sinks]
        if not chosen:
            continue
        gain, std = np.array([e.own_gain for e in chosen]).T
        at = np.array([e.step for e in chosen]) + (0.006 if sinks else -0.006) * widest
        middle = joint * np.exp(gain)
        ends = np.abs(joint * np.exp(gain + Z95 * np.array([[-1.0], [1.0]]) * std) - middle)
        bars = axes.errorbar(
            1e6 * at, middle, yerr=ends, fmt=mark, ms=6.0, color=BLUE, elinewidth=1.3,
            capsize=2.5, mfc=BLUE if sinks else "white", label=f"each log alone, {label}, 95 %",
        )  # fmt: skip
        shown.append(bars)
    for (label, points), mark, color in zip(
        (singles or {}).items(), ("s", "D"), (VERMILION, GREEN), strict=False
    ):
        x, y = np.array(points).T
        shown += axes.plot(1e6 * x, y, mark, ms=5.0, mfc="none", mew=1.4, color=color, label=label)
        average = float(y.mean())
        shown.append(axes.axhline(average, color=color, lw=1.0, ls="--", label="their average"))
    axes.set(
        xlabel="size of the volume change [cm³]",
        ylabel=axis_label("K2") if absolute else "gain over that of all logs [-]",
    )
    axes.margins(x=0.08, y=0.15)
    axes.set_ylim(bottom=max(axes.get_ylim()[0], 0.0))
    axes.legend(handles=shown, loc="center left", bbox_to_anchor=(1.02, 0.5))
    return figure


def _sinks(e: ExperimentFit) -> bool:
    used = np.flatnonzero(np.isfinite(e.residual))
    return bool(e.predicted[used[-1]] > e.predicted[used[0]])
