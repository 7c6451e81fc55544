"""Laws compared, as pictures: what each buys with what it moves, and the steps as they went."""

import math
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from swimbladder.design.law_comparison import LawComparison
from swimbladder.design.law_comparison.contenders import BAND
from swimbladder.design.law_comparison.run import Row, front
from swimbladder.show.plots.style import Ink, band, depth_axis, label_panels, new_figure, styled
from swimbladder.units import rounded

_COLORS = (Ink.BLUE, Ink.VERMILION, Ink.GREEN, Ink.ORANGE, Ink.PURPLE, Ink.SKY, Ink.BLACK)
_MARKERS = {"fast": "^", "quiet": "o"}
_STYLES = {"fast": "-", "quiet": "--"}
_SHOWN = ("step-down", "step-small", "step-large", "step-deep")
_WIDE = 100  # letters of a line above a panel
_LONG = 5.0  # times the least time of a step, that is shown


@styled
def draw_pareto(comparison: LawComparison) -> Figure:
    """Return settling and holding, each against what is moved, with the fronts."""
    figure, (left, right) = new_figure((7.5, 7.6), 2, 1)
    floats = comparison.vehicle.command == "volume change"
    settled = f"within {BAND:g} m" if floats else "to 2 % of the step"
    _pareto(
        left, comparison, ("step-down", "settle_median", 1.0, f"settling {settled} [s]"),
        ("hold", "rate", 3.6e6, "moved while holding [L/h]"),
        bound=comparison.bounds.get("step-down"),
    )  # fmt: skip
    _pareto(
        right, comparison, ("hold-drift", "rms", 1e3, "depth error while the trim drifts [mm rms]"),
        ("hold-drift", "rate", 3.6e6, "moved meanwhile [L/h]"), bound=None,
    )  # fmt: skip
    figure.legend(
        handles=_keys(comparison, lines=False), loc="outside lower center", ncols=4, fontsize=8.5
    )
    figure.suptitle(
        f"{comparison.vehicle.name}: no law beats those on the grey line", fontsize=10.0
    )
    label_panels([left, right])
    return figure


def _pareto(
    axes: Axes, comparison: LawComparison, across: tuple[str, str, float, str],
    up: tuple[str, str, float, str], *, bound: float | None,
) -> None:  # fmt: skip
    """Draw one pair of costs (scenario, field, factor, label), both to be small."""
    x = np.array([across[2] * row.cost(across[0], across[1]) for row in comparison.rows])
    y = np.array([up[2] * row.cost(up[0], up[1]) for row in comparison.rows])
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
    reference = comparison.reference
    for row, a, b, shown in zip(comparison.rows, x, y, there, strict=True):
        if not shown:
            continue
        if row is reference:
            axes.axvline(a, color=Ink.GREY, lw=0.8, ls=":")
            axes.axhline(b, color=Ink.GREY, lw=0.8, ls=":")
        axes.plot(
            a, b, color=_color(comparison, row), marker=_MARKERS.get(row.who.tuning, "s"), ls="",
            ms=_size(comparison, row), mec="white", mew=0.6, zorder=3,
        )  # fmt: skip
    if bound is not None:
        axes.axvline(bound, color=Ink.BLACK, lw=1.0, ls="--")
        axes.annotate(
            f"least of any: {bound:.1f} s", (bound, 0.5), xycoords=("data", "axes fraction"),
            rotation=90, ha="left", va="center", fontsize=8.0,
        )  # fmt: skip
    missing = [r.who.name for r, shown in zip(comparison.rows, there, strict=True) if not shown]
    if missing:
        words = ("not settled: " if bound else "not shown: ") + "; ".join(missing)
        axes.set_title(fill(words, _WIDE), loc="right", fontsize=8.0, color=Ink.GREY)
    for side, label in ((axes.xaxis, across[3]), (axes.yaxis, up[3])):
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


@styled
def draw_steps(comparison: LawComparison) -> Figure:
    """Return the first run of every law on four steps, each with the band to settle in, bound."""
    placed = [p for p in comparison.placed if p.scenario.name in _SHOWN]
    floats = comparison.vehicle.command == "volume change"
    figure = Figure(figsize=(7.5, 2.3 + 2.2 * math.ceil(len(placed) / 2)))
    panels = [
        figure.add_subplot(math.ceil(len(placed) / 2), min(2, len(placed)), n + 1)
        for n in range(len(placed))
    ]
    for axes, p in zip(panels, placed, strict=True):
        name = p.scenario.name
        bound = comparison.bounds.get(name)
        end = p.duration if bound is None else min(_LONG * bound, p.duration)
        for row in comparison.rows:
            trace = row.traces[name]
            kept = trace.time <= end
            axes.plot(
                trace.time[kept], trace.depth[kept], color=_color(comparison, row), lw=1.3,
                ls=_STYLES.get(row.who.tuning, ":"),
            )  # fmt: skip
        band(axes, p.target, BAND if floats else 0.02 * abs(p.target - p.start))
        if bound is not None:
            axes.axvline(bound, color=Ink.BLACK, lw=1.0, ls="--")
        far = 0.25 * (p.target - p.start)
        axes.set_ylim(*sorted((p.start - 0.2 * far, p.target + far)))
        axes.set_xlim(0.0, end)
        depth_axis(axes)
        axes.set_xlabel("time since the set-point changed [s]")
        axes.set_title(f"{rounded(p.start, 3)} to {rounded(p.target, 3)} m", fontsize=9.0)
    figure.legend(
        handles=_keys(comparison, lines=True), loc="outside lower center", ncols=4, fontsize=8.5
    )
    label_panels(panels)
    return figure


def _laws(comparison: LawComparison) -> list[str]:
    return list(dict.fromkeys(row.who.law.name for row in comparison.rows))


def _color(comparison: LawComparison, row: Row) -> str:
    return _COLORS[_laws(comparison).index(row.who.law.name) % len(_COLORS)]


def _size(comparison: LawComparison, row: Row) -> float:
    """Return a marker's size: smaller from law to law, so that none hides another wholly."""
    return 10.0 - 0.8 * _laws(comparison).index(row.who.law.name)


def _keys(comparison: LawComparison, *, lines: bool) -> list[Line2D]:
    """Return a legend entry for each row, and one for the bound of the steps."""
    found = [
        Line2D(
            [], [], color=_color(comparison, row), label=row.who.name,
            marker="" if lines else _MARKERS.get(row.who.tuning, "s"),
            ls=_STYLES.get(row.who.tuning, ":") if lines else "", lw=1.3, mec="white", mew=0.6,
            ms=7.0,
        )
        for row in comparison.rows
    ]  # fmt: skip
    if comparison.bounds:
        found.append(Line2D([], [], color=Ink.BLACK, lw=1.0, ls="--", label="least time of any"))
    return found
