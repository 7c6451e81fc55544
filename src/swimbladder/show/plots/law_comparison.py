"""Laws compared, as pictures: what each buys with what it moves, and the steps as they went."""

import math
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from swimbladder.design.law_comparison import LawComparison
from swimbladder.design.law_comparison.contenders import BAND
from swimbladder.design.law_comparison.run import Row, front
from swimbladder.show.plots import style
from swimbladder.show.plots.style import Ink
from swimbladder.units import rounded

_COLORS = (Ink.BLUE, Ink.VERMILION, Ink.GREEN, Ink.ORANGE, Ink.PURPLE, Ink.SKY, Ink.BLACK)
_MARKERS = {"fast": "^", "quiet": "o"}
_STYLES = {"fast": "-", "quiet": "--"}
_SHOWN = ("step-down", "step-small", "step-large", "step-deep")
_WIDE = 100  # letters of a line above a panel
_LONG = 5.0  # times the least time of a step, that is shown


@style.styled
def draw_pareto(comparison: LawComparison) -> Figure:
    """Return settling and holding, each against what is moved, with the fronts."""
    figure, (left, right) = style.new_figure((7.5, 7.6), 2, 1)
    floats = comparison.vehicle.command == "volume change"
    settled = f"within {BAND:g} m" if floats else "to 2 % of the step"
    across = _Cost("step-down", "settle_median", 1.0, f"settling {settled} [s]")
    up = _Cost("hold", "rate", 3.6e6, "moved while holding [L/h]")
    _pareto(left, comparison, across, up, comparison.bounds.get("step-down"))
    across = _Cost("hold-drift", "rms", 1e3, "depth error while the trim drifts [mm rms]")
    up = _Cost("hold-drift", "rate", 3.6e6, "moved meanwhile [L/h]")
    _pareto(right, comparison, across, up, None)
    _key(figure, comparison, lines=False)
    title = f"{comparison.vehicle.name}: no law beats those on the grey line"
    figure.suptitle(title, fontsize=10.0)
    style.label_panels([left, right])
    return figure


class _Cost(NamedTuple):
    """What is to be small, as it is drawn along an axis."""

    scenario: str
    field: str
    factor: float
    label: str

    def of(self, comparison: LawComparison) -> NDArray[np.float64]:
        costs = [row.cost(self.scenario, self.field) for row in comparison.rows]
        return self.factor * np.array(costs)


def _pareto(
    axes: Axes, comparison: LawComparison, across: _Cost, up: _Cost, bound: float | None
) -> None:
    """Draw one pair of costs."""
    x, y = across.of(comparison), up.of(comparison)
    there = np.isfinite(x) & np.isfinite(y) & (x > 0.0) & (y > 0.0)
    axes.set(xscale="log", yscale="log")
    # Set first: lines find no place on logarithmic axes that nothing stands on.
    along = [*x[there], *([] if bound is None else [bound])]
    if along:
        axes.set_xlim(*_limits(along))
    if there.any():
        axes.set_ylim(*_limits(y[there].tolist()))
    best = np.flatnonzero(there)[front(np.stack([x[there], y[there]], axis=1))]
    if len(best) > 0:
        best = best[np.argsort(x[best])]
        axes.step(x[best], y[best], where="post", color=Ink.GREY, lw=3.0, alpha=0.45, zorder=1)
    missing = []
    for row, a, b, shown in zip(comparison.rows, x, y, there, strict=True):
        if not shown:
            missing.append(row.who.name)
            continue
        if row is comparison.reference:
            axes.axvline(a, color=Ink.GREY, lw=0.8, ls=":")
            axes.axhline(b, color=Ink.GREY, lw=0.8, ls=":")
        marker, size = _MARKERS.get(row.who.tuning, "s"), _size(comparison, row)
        how: Any = {"marker": marker, "ms": size, "mec": "white", "mew": 0.6, "zorder": 3}
        axes.plot(a, b, color=_color(comparison, row), ls="", **how)
    if bound is not None:
        axes.axvline(bound, color=Ink.BLACK, lw=1.0, ls="--")
        text, place = f"least of any: {bound:.1f} s", ("data", "axes fraction")
        how = {"rotation": 90, "ha": "left", "va": "center", "fontsize": 8.0}
        axes.annotate(text, (bound, 0.5), xycoords=place, **how)
    if missing:
        words = ("not settled: " if bound else "not shown: ") + "; ".join(missing)
        axes.set_title(fill(words, _WIDE), loc="right", fontsize=8.0, color=Ink.GREY)
    for side, label in ((axes.xaxis, across.label), (axes.yaxis, up.label)):
        side.set_label_text(label)
        side.set_major_formatter(lambda value, _: f"{value:g}")
        side.set_minor_formatter(lambda value, _: f"{value:g}" if _leading(value) in (2, 5) else "")


def _limits(values: list[float]) -> tuple[float, float]:
    """Return limits of a logarithmic axis, a factor of 10 apart at least."""
    least, most = min(values) / 1.3, max(values) * 1.3
    room = max(math.sqrt(10.0 * least / most), 1.0)
    return least / room, most * room


def _leading(value: float) -> int:
    """Return the first digit of a number above 0."""
    return round(value / 10.0 ** math.floor(math.log10(value) + 1e-9))


@style.styled
def draw_steps(comparison: LawComparison) -> Figure:
    """Return the first run of every law on four steps, each with the band to settle in, bound."""
    placed = [p for p in comparison.placed if p.scenario.name in _SHOWN]
    floats = comparison.vehicle.command == "volume change"
    figure = Figure(figsize=(7.5, 2.3 + 2.2 * math.ceil(len(placed) / 2)))
    panels = style.grid_of(figure, len(placed), min(2, len(placed)))
    for axes, p in zip(panels, placed, strict=True):
        name = p.scenario.name
        bound = comparison.bounds.get(name)
        end = p.duration if bound is None else min(_LONG * bound, p.duration)
        for row in comparison.rows:
            trace, line = row.traces[name], _STYLES.get(row.who.tuning, ":")
            kept, color = trace.time <= end, _color(comparison, row)
            axes.plot(trace.time[kept], trace.depth[kept], line, color=color, lw=1.3)
        style.band(axes, p.target, BAND if floats else 0.02 * abs(p.target - p.start))
        if bound is not None:
            axes.axvline(bound, color=Ink.BLACK, lw=1.0, ls="--")
        far = 0.25 * (p.target - p.start)
        axes.set(ylim=sorted((p.start - 0.2 * far, p.target + far)), xlim=(0.0, end))
        style.depth_axis(axes)
        axes.set_xlabel("time since the set-point changed [s]")
        axes.set_title(f"{rounded(p.start, 3)} to {rounded(p.target, 3)} m", fontsize=9.0)
    _key(figure, comparison, lines=True)
    style.label_panels(panels)
    return figure


def _laws(comparison: LawComparison) -> list[str]:
    return list(dict.fromkeys(row.who.law.name for row in comparison.rows))


def _color(comparison: LawComparison, row: Row) -> str:
    return _COLORS[_laws(comparison).index(row.who.law.name) % len(_COLORS)]


def _size(comparison: LawComparison, row: Row) -> float:
    """Return a marker's size: smaller from law to law, so that none hides another wholly."""
    return 10.0 - 0.8 * _laws(comparison).index(row.who.law.name)


def _key(figure: Figure, comparison: LawComparison, *, lines: bool) -> None:
    """Draw a legend with an entry for each row, and one for the bound of the steps."""
    found = []
    for row in comparison.rows:
        marker, line = _MARKERS.get(row.who.tuning, "s"), _STYLES.get(row.who.tuning, ":")
        how: Any = {"ls": line, "lw": 1.3} if lines else {"marker": marker, "ls": "", "ms": 7.0}
        how |= {"mec": "white", "mew": 0.6, "label": row.who.name}
        found.append(Line2D([], [], color=_color(comparison, row), **how))
    if comparison.bounds:
        found.append(Line2D([], [], color=Ink.BLACK, lw=1.0, ls="--", label="least time of any"))
    figure.legend(handles=found, loc="outside lower center", ncols=4, fontsize=8.5)
