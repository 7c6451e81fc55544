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
        command = traces.command * (1.0 if volts or traces.seconds else 1e6)
        values = (traces.depth, 1e6 * traces.volume, command)
        for axes, y in zip((depth, volume, voltage), values, strict=True):
            lines = axes.plot(traces.time[kept], y[kept], color=color, lw=width, alpha=alpha)
            lines[0].set_label(label)
    half = tuning.band or 0.02 * abs(step.target - step.start)
    size = f"{half:.3g} m" if tuning.band else "2 %"
    # Of floats one half goes the other way.
    for goal in (step.start, step.target)[0 if tuning.band else 1 :]:
        style.band(depth, goal, half)
        depth.axhline(goal, color=Ink.BLACK, lw=0.8, ls="--")
    depth.get_lines()[-1].set_label(f"set-point, {size} band")
    limit = (
        tuning.result_vehicle.supply.voltage if volts and tuning.result_vehicle.supply else math.inf
    )
    used = max(float(np.abs(traces.command).max()) for traces in tuning.shown)
    if _QUIET * limit <= used:  # else it would squeeze what is used to a line
        for side in (-limit, limit):
            line = voltage.axhline(side, color=Ink.VERMILION, lw=0.8, ls=":", label="supply")
        voltage.legend(handles=[line], loc="lower right")
    style.depth_axis(depth)
    volume.set_ylabel("volume [cm³]")
    asked = "change asked for [cm³]" if tuning.band else "volume asked for [cm³]"
    if tuning.shown[0].seconds:
        asked = "pump (+) or valve (−)\nin each sample [s]"
    voltage.set_ylabel("voltage [V]" if volts else asked)
    voltage.set_xlabel("time since the set-point changed [s]")
    depth.legend(loc="best")
    title = f"{tuning.result_vehicle.name}, {tuning.law.name} tuned for {tuning.goal}"
    depth.set_title(title, fontsize=10.0)
    style.label_panels([depth, volume, voltage])
    return figure


@style.styled
def draw_sensitivity(tuning: Tuning) -> Figure:
    """Return |S| = |1/(1 + L)| of all vehicles of the region, broken at voltage and depth."""
    figure, panels = style.new_figure((7.5, 3.8), 1, 2, sharey=True)
    count = len(tuning.plants)  # of loops at each depth, the nominal one first
    loops = [(n % count > 0, loop) for n, loop in enumerate(tuning.loops())]
    loops.sort(key=lambda one: not one[0])  # the nominal one on top
    for axes, place in zip(panels, (tuning.law.command, "measured depth"), strict=True):
        first = math.inf
        for varied, loop in loops:
            broken = (
                loop.broken_at_depth() if place == "measured depth" else loop.broken_at_command()
            )
            w, values = frequency_response(broken)
            seen = w[abs(1.0 + values) < 1.0 / _LEAST]
            first = min(first, float(seen[0]) if len(seen) else math.inf)
            color, lw, alpha = (Ink.ORANGE, 0.7, 0.7) if varied else (Ink.BLUE, 1.6, 1.0)
            axes.loglog(w, 1.0 / abs(1.0 + values), color=color, lw=lw, alpha=alpha)
        axes.axhline(WANTED.peak_sensitivity, color=Ink.VERMILION, lw=1.0, ls="--")
        axes.set_title(f"broken at the {place}", fontsize=10.0)
        least = max(0.5 * first, 1e-4) if math.isfinite(first) else 1e-3
        axes.set(xlabel="frequency [rad/s]", xlim=(least, None), ylim=(_LEAST, 3.0))
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
