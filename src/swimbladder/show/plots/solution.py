"""A simulation as a picture: depth, volume, and what the motor gets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swimbladder.show.plots.style import BLACK, BLUE, GREEN, GREY, ORANGE, depth_axis, save, styled
from swimbladder.sim.closed_loop import Solution


def plot_solution(solution: Solution, path: str | Path) -> Path:
    """Write a picture of a simulation: what is known of depth, volume, voltage, power, current.

    The suffix of the path chooses the format. Raises InputError where it cannot be written.
    """
    return save(draw_solution(solution), path)


@styled
def draw_solution(solution: Solution) -> Figure:
    """Return the figure that plot_solution writes."""
    s = solution
    panels = [_depth, _volume]
    panels += [panel for panel in (_voltage, _drive, _power, _current) if _known(s, panel)]
    figure = Figure(figsize=(7.5, 1.0 + 1.65 * len(panels)))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for draw, place in zip(panels, axes, strict=True):
        draw(s, place)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(float(s.time[0]), float(max(s.time[-1], s.time[0] + 1e-9)))
    figure.align_ylabels(list(axes))
    return figure


def _known(s: Solution, panel: Any) -> bool:
    known = {_voltage: s.voltage, _drive: s.drive, _power: s.power, _current: s.current}
    values = known[panel]
    return not bool(np.all(np.isnan(values)))


def _depth(s: Solution, axes: Axes) -> None:
    if not np.all(np.isnan(s.reference)):
        axes.step(s.time, s.reference, where="post", color=GREY, ls="--", lw=1.1, label="set-point")
    axes.plot(s.time, s.depth, color=BLUE, label="depth")
    for kind, marker in (("reached the bottom", "v"), ("began to emerge", "^")):
        at = [event.time for event in s.events if event.kind == kind]
        if at:
            axes.plot(at, np.interp(at, s.time, s.depth), marker, color=BLACK, ms=5, label=kind)
    depth_axis(axes)
    if len(axes.get_lines()) > 1:
        _legend(axes)


def _volume(s: Solution, axes: Axes) -> None:
    if not np.all(np.isnan(s.volume_reference)):
        axes.step(
            s.time, s.volume_reference * 1e6, where="post", color=ORANGE, lw=0.8, label="asked for"
        )
    axes.plot(s.time, s.volume * 1e6, color=BLUE, label="volume")
    low, high = float(s.volume.min()) * 1e6, float(s.volume.max()) * 1e6
    room = 0.1 * max(high - low, 1e-3)
    for stop in (s.vehicle.stroke.minimum * 1e6, s.vehicle.stroke.maximum * 1e6):
        if low - room <= stop <= high + room:
            axes.axhline(stop, color=BLACK, ls=":", lw=1.0, label="end stop")
    if not np.all(np.isnan(s.volume_reference)):
        # what is asked for may go far beyond what any motor follows
        axes.set_ylim(low - 3.0 * room, high + 3.0 * room)
    axes.set_ylabel("volume [cm³]")
    if len(axes.get_lines()) > 1:
        _legend(axes)


def _voltage(s: Solution, axes: Axes) -> None:
    axes.step(s.time, s.voltage, where="post", color=GREEN, lw=0.9)
    axes.set_ylabel("voltage [V]")


def _drive(s: Solution, axes: Axes) -> None:
    """Draw when pump, valve and bypass run; a run counts for the sample that it begins in."""
    runs = {"pump": (1.0, 4.0), "valve": (2.0,), "bypass": (3.0,)}
    for place, kinds in enumerate(runs.values()):
        on = np.flatnonzero(np.isin(s.drive, kinds))
        axes.plot(s.time[on], np.full(len(on), place), "|", color=GREEN, ms=9, mew=0.9)
    axes.set_yticks(range(len(runs)), list(runs))
    axes.set_ylim(-0.6, len(runs) - 0.4)
    axes.set_ylabel("drive [on]")


def _at_samples(axes: Axes, time: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """Draw points: just after a change of voltage they are peaks, which a line would hold."""
    axes.plot(time, values, ".", color=GREEN, ms=2.5, mew=0.0)


def _power(s: Solution, axes: Axes) -> None:
    _at_samples(axes, s.time, s.power)
    axes.set_ylabel("power [W]\nat samples")


def _current(s: Solution, axes: Axes) -> None:
    _at_samples(axes, s.time, s.current)
    axes.set_ylabel("current [A]\nat samples")


def _legend(axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    axes.legend(
        named.values(),
        named.keys(),
        loc="lower right",
        bbox_to_anchor=(1.0, 0.98),
        ncols=len(named),
    )
