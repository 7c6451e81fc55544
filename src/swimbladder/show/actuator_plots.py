"""Steps of an actuator, measured against fitted, with residuals.

And whole logs, measured against fitted, with the speeds that they show.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from swimbladder.estimation.actuator import ActuatorIdentification
from swimbladder.estimation.actuator.model import drive_of, steady_speed
from swimbladder.estimation.actuator.result import Step
from swimbladder.show.style import Ink, legend_above, new_figure, stacked, styled

Array = NDArray[np.float64]

_STEADY = 0.02  # of the largest voltage: the same
_FEWEST = 5  # samples that show a speed


@styled
def draw_log(found: ActuatorIdentification, steps: Sequence[Step]) -> Figure:
    """Return voltage, position and residuals of the steps of one log, against time."""
    driven = any(s.voltage is not None for s in steps)
    heights = [1.0, 2.4, 1.3][0 if driven else 1 :]
    figure, (*above, upper, lower) = stacked((9.6, 5.2 if driven else 4.2), *heights)
    scale, unit, name = _units(found)
    for step in steps:
        t, used = step.time, step.used
        seen = t[used], scale * step.position[used]
        upper.plot(*seen, ".", ms=3, color=Ink.BLACK, label="measured")
        upper.plot(t, scale * step.fitted, color=Ink.VERMILION, lw=1.2, label="fitted")
        lower.plot(t[used], scale * step.residual[used], ".", ms=2.5, color=Ink.BLACK)
        if above and step.voltage is not None:
            above[0].step(t, step.voltage, where="post", color=Ink.BLUE, lw=1.2)
    _outliers(steps, scale, upper)
    left = np.concatenate([s.residual[s.used] for s in steps])
    band = 1.96 * scale * float(left.std())
    lower.axhspan(-band, band, color=Ink.SKY, alpha=0.3, lw=0.0, label="95 % of the noise")
    lower.axhline(0.0, color=Ink.GREY, lw=0.8)
    upper.set_ylabel(f"{name} [{unit}]")
    since = "time since the log's first sample [s]"
    lower.set(ylabel=f"measured less\nfitted [{unit}]", xlabel=since)
    if above:
        above[0].set_ylabel("voltage [V]")
    legend_above(upper, loc="upper right", ncols=3, bbox_to_anchor=(1.0, 1.12))
    lower.legend(loc="upper right", bbox_to_anchor=(1.0, 1.2))
    figure.align_ylabels()
    return figure


def _outliers(steps: Sequence[Step], scale: float, axes: Axes) -> None:
    """Mark the samples left out, those beyond the axis at its edge."""
    out = [(s.time[~s.used], s.position[~s.used]) for s in steps if not s.used.all()]
    if out:
        low, high = axes.get_ylim()
        t, x = (np.concatenate(part) for part in zip(*out, strict=True))
        axes.plot(t, np.clip(scale * x, low, high), "x", ms=4, color=Ink.ORANGE, label="left out")
        axes.set_ylim(low, high)


def shows_speeds(found: ActuatorIdentification) -> bool:
    """Return whether there are steady speeds to draw."""
    return any(s.speed is not None or _steady(s) for s in found.steps)


@styled
def draw_speeds(found: ActuatorIdentification) -> Figure:
    """Return steady speed against voltage, or of each move where no voltage is logged."""
    figure, (axes,) = new_figure((6.4, 3.9))
    scale, unit, _ = _units(found)
    axes.set_ylabel(f"steady speed [{unit}/s]")
    draw = _by_voltage if found.driven == "voltage" else _by_move
    draw(found, scale, axes)
    axes.legend(loc="best")
    return figure


def _by_voltage(found: ActuatorIdentification, scale: float, axes: Axes) -> None:
    points = [point for step in found.steps for point in _steady(step)]
    u, v = np.array(points).T
    axes.plot(u, scale * v, "o", ms=4.5, mfc="none", color=Ink.BLACK, label="second half of a step")
    values = {name: e.value for name, e in found.parameters.items() if e.known}
    if "K1A" in values:
        values["K1"] = values.pop("K1A")
    # in one direction alone, a load counts as dead zone
    one_way = float(u.min()) * float(u.max()) >= 0.0
    values = {**({"asymmetry": 1.0, "load_voltage": 0.0} if one_way else {}), **values}
    if {"K1", "dead_zone", "load_voltage", "asymmetry"} <= values.keys():
        drive = drive_of({"T1": 1.0, **values})
        grid = np.linspace(min(float(u.min()), 0.0), max(float(u.max()), 0.0), 400)
        line = [scale * steady_speed(x, drive) for x in grid.tolist()]
        axes.plot(grid, line, color=Ink.VERMILION, lw=1.2, label="fitted")
    axes.axhline(0.0, color=Ink.GREY, lw=0.8)
    axes.set_xlabel("voltage [V]")


def _steady(step: Step) -> list[tuple[float, float]]:
    """Return (voltage [V], speed) of the stretches of steady voltage in a step."""
    if step.voltage is None:
        return []
    u, t, x = step.voltage, step.time, step.position
    same = _STEADY * float(np.abs(u).max(initial=0.0))
    turns = np.flatnonzero(np.abs(np.diff(u)) > same) + 1
    found = []
    for low, high in itertools.pairwise([0, *turns.tolist(), len(u)]):
        half = (low + high) // 2
        gap = (high - half) // 2
        if high - low >= _FEWEST and gap > 0 and abs(float(u[low])) > same:
            ahead = np.arange(half, high - gap)
            speed = (x[ahead + gap] - x[ahead]) / (t[ahead + gap] - t[ahead])
            found.append((float(u[low]), float(np.median(speed))))
    return found


def _by_move(found: ActuatorIdentification, scale: float, axes: Axes) -> None:
    shown = [(k, s) for k, s in enumerate(found.steps, start=1) if s.speed is not None]
    for way, color, marker in (("out", Ink.BLUE, "o"), ("in", Ink.ORANGE, "s")):
        own = [(k, s) for k, s in shown if s.label == f"{way}ward"]
        speeds = [scale * (s.speed or 0.0) for _, s in own]
        numbers = [k for k, _ in own]
        label = f"{way}ward" if own else None
        axes.plot(numbers, speeds, marker, ms=4.5, mfc="none", color=color, label=label)
        for fit in found.logs:
            rate = fit.parameters.get(f"rate_{way}")
            moved = [k for k, s in own if s.source == fit.source]
            if rate is None or not rate.known or not moved:
                continue
            ends = [moved[0] - 0.5, moved[-1] + 0.5]
            low, high = (scale * x for x in rate.ci95)
            axes.plot(ends, [scale * rate.value] * 2, color=color, lw=1.2)
            axes.fill_between(ends, low, high, color=color, alpha=0.25, lw=0.0)
    axes.set(ylim=(0.0, None), xlabel="number of the move")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _units(found: ActuatorIdentification) -> tuple[float, str, str]:
    """Return the scale, the unit and the name of the position as people read it."""
    return (1e3, "mm", "piston") if found.quantity == "piston" else (1e6, "cm³", "volume")


_MOST = 12  # steps in the figure


@styled
def draw_steps(found: ActuatorIdentification, source: str | None = None) -> Figure:
    """Return measured and fitted positions of the steps and residuals; of many some, evenly chosen.

    source: only the steps of this log, and no title.
    """
    own = [k for k, step in enumerate(found.steps) if source in (None, step.source)]
    count = len(own)
    some = np.unique(np.linspace(0, count - 1, min(count, _MOST)).round().astype(int))
    shown = [own[k] for k in some.tolist()]
    columns = min(4, len(shown))
    rows = math.ceil(len(shown) / columns)
    figure = Figure(figsize=(2.6 * columns + 0.6, 2.9 * rows + 0.5))
    scale, unit, _ = _units(found)
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=[2.2, 1.0] * rows)
    largest = [np.abs(found.steps[k].residual[found.steps[k].used]).max(initial=0.0) for k in shown]
    limit = 1.2 * max(scale * float(max(largest, default=0.0)), 1e-9)
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
    upper.plot(t[part][used], scale * x[used], ".", ms=3.5, color=Ink.BLACK, label="measured")
    if not used.all():
        low, high = upper.get_ylim()
        out = np.clip(scale * x[~used], low, high)
        upper.plot(t[part][~used], out, "x", ms=4, color=Ink.ORANGE, label="left out")
    upper.plot(t[part], scale * fitted, color=Ink.VERMILION, lw=1.2, label="fitted")
    lower.axhline(0.0, color=Ink.GREY, lw=0.8)
    lower.plot(t[step.used], scale * step.residual[step.used], ".", ms=2.5, color=Ink.BLACK)
    what = f"start, {step.label}" if step.start else step.label
    upper.set_title(f"step {number}: {what}", loc="left", fontsize=8.5)
    if not step.start:
        upper.sharex(lower)
        upper.tick_params(labelbottom=False)


def _title(found: ActuatorIdentification) -> str:
    parts, (per, length, _) = [], _units(found)
    units = {"K1": (1e3, "mm/s/V"), "K1A": (1e6, "cm³/s/V"), "T1": (1.0, "s")}
    units |= {"dead_zone": (1.0, "V"), "rate": (per, f"{length}/s")}
    for name, (scale, unit) in units.items():
        e = found.parameters.get(name)
        if e is not None and e.known:
            word = name.replace("_", " ")
            parts.append(f"{word} = {scale * e.value:.4g} ± {1.96 * scale * e.std:.2g} {unit}")
    return ", ".join(parts) or "nothing is identified"
