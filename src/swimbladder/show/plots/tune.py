"""A tuning as pictures: the step of its trials, and the sensitivity, over the region."""

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from swimbladder.design.linear.margins import frequency_response
from swimbladder.design.tuning import Tuning
from swimbladder.design.tuning.margins import WANTED
from swimbladder.show.plots import style
from swimbladder.show.plots.style import Ink

_LEAST = 0.05  # sensitivity that is shown
_QUIET = 0.2  # of the supply's voltage: where less is used the supply is not shown
_LONG = 4.0  # times the median settling, that is shown


@style.styled
def draw_tuning(tuning: Tuning) -> Figure:
    """Return depth, volume and voltage of the trials against time."""
    figure, (depth, volume, voltage) = style.stacked((7.5, 7.5), 1.0, 1.0, 1.0)
    step = tuning.step
    settle = tuning.nominal.settle_median
    volts = tuning.law.command == "voltage"
    end = min(step.duration, _LONG * settle) if settle > 0.0 else step.duration
    over = f"over the region{', supply low' if volts else ''}"
    for traces, color, width, alpha, label in (
        (tuning.shown[1], Ink.ORANGE, 0.8, 0.7, over),
        (tuning.shown[0], Ink.BLUE, 1.8, 1.0, "nominal"),
    ):
        kept = traces.time <= end
        for axes, values in (
            (depth, traces.depth), (volume, 1e6 * traces.volume),
            (voltage, traces.command * (1.0 if volts else 1e6)),
        ):  # fmt: skip
            lines = axes.plot(traces.time[kept], values[kept], color=color, lw=width, alpha=alpha)
            lines[0].set_label(label)
    half = tuning.band or 0.02 * abs(step.target - step.start)
    size = f"{half:.3g} m" if tuning.band else "2 %"
    # Of floats one half goes the other way.
    for goal in (step.start, step.target)[0 if tuning.band else 1 :]:
        style.band(depth, goal, half)
        depth.axhline(goal, color=Ink.BLACK, lw=0.8, ls="--")
    depth.get_lines()[-1].set_label(f"set-point, {size} band")
    limit = tuning.vehicle.supply if volts else None
    used = max(float(np.abs(traces.command).max()) for traces in tuning.shown)
    if limit is not None and used < _QUIET * limit.voltage:
        limit = None  # it would squeeze what is used to a line
    if limit is not None:
        for side in (-1.0, 1.0):
            voltage.axhline(
                side * limit.voltage, color=Ink.VERMILION, lw=0.8, ls=":",
                label="supply" if side > 0.0 else None,
            )  # fmt: skip
    style.depth_axis(depth)
    volume.set_ylabel("volume [cm³]")
    asked = "change asked for [cm³]" if tuning.band else "volume asked for [cm³]"
    voltage.set_ylabel("voltage [V]" if volts else asked)
    voltage.set_xlabel("time since the set-point changed [s]")
    depth.legend(loc="best")
    if limit is not None:
        voltage.legend(handles=voltage.get_legend_handles_labels()[0][-1:], loc="lower right")
    depth.set_title(
        f"{tuning.vehicle.name}, {tuning.law.name} tuned for {tuning.goal}", fontsize=10.0
    )
    style.label_panels([depth, volume, voltage])
    return figure


@style.styled
def draw_sensitivity(tuning: Tuning) -> Figure:
    """Return |S| = |1/(1 + L)| of all vehicles of the region, broken at voltage and depth."""
    figure, panels = style.new_figure((7.5, 3.8), 1, 2, sharey=True)
    loops = sorted(tuning.loops(), key=lambda loop: -loop.number)  # the nominal one on top
    for axes, place in zip(panels, (tuning.law.command, "measured depth"), strict=True):
        first = math.inf
        for loop in loops:
            broken = loop.at_command if place != "measured depth" else loop.at_depth
            w, values = frequency_response(broken)
            seen = w[abs(1.0 + values) < 1.0 / _LEAST]
            first = min(first, float(seen[0]) if len(seen) else math.inf)
            axes.loglog(
                w, 1.0 / abs(1.0 + values), color=Ink.BLUE if loop.number == 0 else Ink.ORANGE,
                lw=1.6 if loop.number == 0 else 0.7, alpha=1.0 if loop.number == 0 else 0.7,
            )  # fmt: skip
        axes.axhline(WANTED.peak_sensitivity, color=Ink.VERMILION, lw=1.0, ls="--")
        axes.set_xlabel("frequency [rad/s]")
        axes.set_title(f"broken at the {place}", fontsize=10.0)
        axes.set_xlim(left=max(0.5 * first, 1e-4) if math.isfinite(first) else 1e-3)
        axes.set_ylim(_LEAST, 3.0)
        style.plain_log_ticks(axes, "y")
    panels[0].set_ylabel("sensitivity |S| [-]")
    lines = [
        Line2D([], [], color=Ink.BLUE, lw=1.6, label="nominal"),
        Line2D([], [], color=Ink.ORANGE, lw=0.8, label="over the region"),
        Line2D([], [], color=Ink.VERMILION, lw=1.0, ls="--", label="most that is allowed"),
    ]
    panels[0].legend(handles=lines, loc="lower right")
    style.label_panels(panels)
    return figure
