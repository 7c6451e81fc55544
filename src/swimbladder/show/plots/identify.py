"""The fit to each log, and its residuals: in time, as a distribution, against itself."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.stats import norm

from swimbladder.estimation.motion import ExperimentFit, Identification
from swimbladder.show.plots.style import BLACK, BLUE, GREY, SKY, VERMILION, depth_axis, styled
from swimbladder.units import rounded

Array = NDArray[np.float64]

PER_PAGE = 24  # logs in one picture
_WIDTH = 9.6  # inches
_SHADE = "#E8E8E8"
_OUTLIER = 0.5  # weight below which a sample counts as one
_ALIKE = 4.0  # how much larger the largest residuals may be on axes of one scale
_FURTHEST = 8.0  # standard deviations that are drawn


def labels(found: Identification) -> list[str]:
    """Return a short name for each log: what distinguishes it from the others."""
    parts = [_parts(e.source) for e in found.experiments]
    one_file = len({path for path, _ in parts}) == 1
    short = []
    for path, chosen in parts:
        name = path.replace("\\", "/").rsplit("/", 1)[-1]
        text = chosen if chosen and one_file else f"{name} {chosen}".rstrip()
        short.append(text if len(text) <= 30 else f"…{text[-29:]}")
    if len(set(short)) < len(short):
        short = [f"{number}: {text}" for number, text in enumerate(short, start=1)]
    return short


def _parts(source: str) -> tuple[str, str]:
    """Return the file and the selection of a log's source, "file (selection)"."""
    if source.endswith(")") and " (" in source:
        path, _, chosen = source[:-1].rpartition(" (")
        return path, chosen
    return source, ""


@styled
def draw_fits(found: Identification, first: int = 0) -> Figure:
    """Return measured and fitted depth of up to PER_PAGE logs from `first` on."""
    names, chosen = labels(found), found.experiments[first : first + PER_PAGE]
    figure, panels = _grid(len(chosen), 1.95)
    for k, (axes, e) in enumerate(zip(panels, chosen, strict=True)):
        time = e.record.time
        away = _outliers(e)
        _shade(axes, e)
        axes.plot(time, e.record.depth, ".", ms=5.0, mew=0.0, color=GREY, label="measured")
        axes.plot(time, e.predicted, color=BLUE, lw=1.1, label="fitted")
        axes.plot(time[away], e.record.depth[away], "x", ms=5.0, color=VERMILION, label="outlier")
        axes.set_title(
            f"{names[first + k]}: {rounded(1e3 * e.rms, 2)} mm rms", fontsize=9.0, loc="left"
        )
        axes.margins(x=0.02)
        depth_axis(axes, "depth [m]" if k % _columns(len(chosen)) == 0 else "")
        _few_ticks(axes)
    return _keyed(figure, panels, len(chosen), markerscale=2.0)


@styled
def draw_residuals(found: Identification, first: int = 0) -> Figure:
    """Return measured less fitted depth of up to PER_PAGE logs from `first` on, outliers marked.

    All on one scale, unless the logs differ by so much that little would be seen of most.
    """
    names, chosen = labels(found), found.experiments[first : first + PER_PAGE]
    figure, panels = _grid(len(chosen), 1.6)
    reaches = [1e3 * _reach(e) for e in chosen]
    if max(reaches) < _ALIKE * min(reaches):
        reaches = [max(reaches)] * len(reaches)
    for k, (axes, e, reach) in enumerate(zip(panels, chosen, reaches, strict=True)):
        used = np.isfinite(e.residual)
        time, off = e.record.time[used], 1e3 * e.residual[used]
        away = _outliers(e)[used]
        band = 1e3 * 1.96 * e.noise
        axes.axhspan(-band, band, color=SKY, alpha=0.25, lw=0.0, label="95 % of the noise")
        axes.axhline(0.0, color=BLACK, lw=0.7)
        axes.plot(time[~away], off[~away], ".", ms=2.8, mew=0.0, color=BLUE, label="residual")
        axes.plot(
            time[away], np.clip(off[away], -reach, reach), "x", ms=5.0, color=VERMILION,
            label="outlier (at the edge: beyond it)",
        )  # fmt: skip
        axes.set_ylim(-1.08 * reach, 1.08 * reach)
        axes.set_title(names[first + k], fontsize=9.0, loc="left")
        axes.margins(x=0.02)
        axes.set_ylabel("residual [mm]" if k % _columns(len(chosen)) == 0 else "")
        _few_ticks(axes)
    return _keyed(figure, panels, len(chosen), markerscale=2.0)


@styled
def draw_distribution(found: Identification) -> Figure:
    """Return the residuals of all logs against a normal distribution, and against themselves."""
    figure = Figure(figsize=(_WIDTH, 3.3))
    left, middle, right = figure.subplots(1, 3)
    u = np.concatenate([e.residual[np.isfinite(e.residual)] / e.noise for e in found.experiments])
    _histogram(left, u)
    _quantiles(middle, u)
    _autocorrelation(right, found.experiments)
    return figure


def _histogram(axes: Axes, u: Array) -> None:
    x = np.linspace(-5.0, 5.0, 201)
    inside = u[np.abs(u) <= 5.0]
    bins = np.linspace(-5.0, 5.0, 41)
    share = np.full(len(inside), 4.0 / max(len(u), 1))  # a density: bins are 0.25 wide
    axes.hist(
        inside, bins=bins.tolist(), weights=share, color=SKY, ec="white", lw=0.4, label="residuals"
    )
    axes.plot(x, norm.pdf(x), color=BLACK, lw=1.2, label="normal")
    axes.set(xlabel="residual [standard deviations]", ylabel="density [-]")
    axes.set_ylim(top=1.28 * max(0.42, axes.get_ylim()[1]))
    beyond = len(u) - len(inside)
    if beyond:
        axes.text(0.98, 0.7, f"{beyond} beyond ±5", transform=axes.transAxes, ha="right",
                  color=VERMILION, fontsize=9.0)  # fmt: skip
    axes.legend(loc="upper right")


def _quantiles(axes: Axes, u: Array) -> None:
    ordered = np.sort(u)
    n = len(ordered)
    expected = norm.ppf((np.arange(n) + 0.5) / n)
    reach = min(max(float(np.abs(ordered).max(initial=0.0)), 3.5), _FURTHEST)
    inside = np.abs(ordered) <= reach
    axes.plot([-reach, reach], [-reach, reach], color=BLACK, lw=0.9, label="normal")
    axes.plot(expected[inside], ordered[inside], ".", ms=4.0, mew=0.0, color=BLUE)
    for side, mark in ((ordered > reach, "^"), (ordered < -reach, "v")):
        if side.any():  # nothing without a clip has no size, which the layout cannot bear
            at = np.sign(ordered[side]) * reach
            axes.plot(expected[side], at, mark, ms=6.0, color=VERMILION, clip_on=False)
    axes.set(
        xlabel="normal quantile [-]", ylabel="residual [standard deviations]",
        xlim=(-4.2, 4.2), ylim=(-1.05 * reach, 1.05 * reach),
    )  # fmt: skip
    axes.legend(loc="upper left")


def _autocorrelation(axes: Axes, experiments: Sequence[ExperimentFit]) -> None:
    total, weight = np.zeros(31), np.zeros(31)
    for number, e in enumerate(experiments):
        r = _own_correlation(e)
        lags = np.arange(len(r))
        label = "each log" if number == 0 else None
        axes.plot(lags[1:], r[1:], color=GREY, lw=0.6, alpha=0.7, label=label)
        n = int((e.weight > 0.0).sum())
        total[: len(r)] += n * r
        weight[: len(r)] += n
    kept = weight > 0.0
    mean = total[kept] / weight[kept]
    band = 1.96 / math.sqrt(weight[0]) if weight[0] else 0.0
    axes.axhspan(-band, band, color=SKY, alpha=0.35, lw=0.0, label="95 % if white")
    axes.axhline(0.0, color=BLACK, lw=0.7)
    axes.vlines(np.arange(1, len(mean)), 0.0, mean[1:], color=BLUE, lw=1.6)
    axes.plot(np.arange(1, len(mean)), mean[1:], "o", ms=3.2, color=BLUE, label="all logs")
    low, high = axes.get_ylim()
    axes.set(
        xlabel="lag [samples]", ylabel="autocorrelation [-]",
        ylim=(min(low, -0.3), max(high * 1.25, 0.5)),
    )  # fmt: skip
    axes.legend(loc="upper right")


def _own_correlation(e: ExperimentFit) -> Array:
    used = np.isfinite(e.residual)
    u = np.sqrt(e.weight[used]) * e.residual[used]
    n, most = len(u), min(31, max(len(u) // 3, 1))
    power = float(u @ u)
    return np.array([float(u[: n - k] @ u[k:]) / power if power else 0.0 for k in range(most)])


def _outliers(e: ExperimentFit) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = np.isfinite(e.residual) & (e.weight < _OUTLIER)
    return found


def _reach(e: ExperimentFit) -> float:
    """Return the largest residual [m] that is worth an axis: no outlier, 3 noises at least."""
    kept = np.isfinite(e.residual) & (e.weight >= _OUTLIER)
    return max(float(np.abs(e.residual[kept]).max(initial=0.0)), 3.0 * e.noise)


def _shade(axes: Axes, e: ExperimentFit) -> None:
    """Shade what the fit does not use."""
    out = np.concatenate(([False], ~np.isfinite(e.residual), [False])).astype(int)
    edges = np.flatnonzero(np.diff(out))
    time = e.record.time
    for first, after in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        last = min(after, len(time) - 1)
        axes.axvspan(time[first], time[last], color=_SHADE, lw=0.0, zorder=0, label="not used")


def _columns(count: int) -> int:
    return min(count, 2 if count in (2, 4) else 3 if count < 7 else 4)


def _grid(count: int, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels, as many as there are logs."""
    columns = _columns(count)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(_WIDTH, height * max(rows, 1.4) + 0.5))
    panels = list(np.ravel(figure.subplots(rows, columns, squeeze=False)))
    for axes in panels[count:]:
        axes.remove()
    return figure, panels[:count]


def _few_ticks(axes: Axes) -> None:
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.tick_params(labelsize=8.5)


def _keyed(figure: Figure, panels: list[Axes], count: int, *, markerscale: float) -> Figure:
    """Label the time axis of the lowest panels, and put one key above all."""
    columns = _columns(count)
    for k, axes in enumerate(panels):
        if k + columns >= count:
            axes.set_xlabel("time [s]")
    shown = {
        label: handle
        for axes in panels
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        list(shown.values()), list(shown), loc="outside upper right", ncols=len(shown),
        markerscale=markerscale,
    )  # fmt: skip
    return figure
