"""The fit to each log, and its residuals: in time, as a distribution, against itself.

And each log by itself: its neutral volume, and its own gain beside that of all. How sure the
parameters are: ellipses and likelihood profiles.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.stats import chi2, norm

from swimbladder.estimation.estimates import Z95
from swimbladder.estimation.motion import NAMES, Estimate, ExperimentFit, Identification
from swimbladder.show import style
from swimbladder.show.style import Ink, grid_of, legend_beside, new_figure, styled
from swimbladder.units import rounded, shown_unit, unit_factor

Array = NDArray[np.float64]

_PRETTY = {"1/m2/s": "1/(m² s)", "N s2/m2": "N s²/m²"}
_SYMBOL = {
    "K1": "K₁",
    "T1": "T₁",
    "K2": "K₂",
    "T2": "T₂",
    "mass": "mass",
    "psi": "ψ",
    "drag_quadratic": r"k$_\mathrm{dt}$",
}
_WIDTH = 9.6  # inches
_DRAWS = 1500  # of the posterior, that are drawn


def axis_label(name: str) -> str:
    """Return a parameter's symbol and the unit that it is drawn in."""
    unit = shown_unit(NAMES[name].unit)
    return f"{_SYMBOL[name]} [{_PRETTY.get(unit, unit.replace('cm3', 'cm³'))}]"


def per_shown(unit: str) -> float:
    """Return the factor from SI to the unit shown."""
    return unit_factor(unit, shown_unit(unit))


def _logarithmic(found: Identification, name: str) -> bool:
    return NAMES[name].logarithmic or (name == "drag_quadratic" and found.law == "quadratic")


@styled
def draw_ellipses(found: Identification) -> Figure:
    """Return the regions that hold a pair of parameters with 68 and 95 %, for every pair.

    Of quantities fitted as logarithms the region is an ellipse in these. Raises ValueError where
    there is no pair.
    """
    names = found.names
    if len(names) < 2:
        raise ValueError("one parameter makes no pair")
    size = len(names) - 1
    side = 3.6 if size == 1 else 3.0 if size == 2 else 2.4
    figure, grid = new_figure((min(side * size * 1.15, _WIDTH), side * size), size, size)
    for row in range(size):
        for column in range(size):
            axes = grid[row * size + column]
            if column > row:
                axes.remove()
                continue
            _pair(axes, found, names[column], names[row + 1])
            axes.set_xlabel(axis_label(names[column]) if row == size - 1 else "")
            axes.set_ylabel(axis_label(names[row + 1]) if column == 0 else "")
            axes.tick_params(labelbottom=row == size - 1, labelleft=column == 0)
    place, ncols = ("outside upper center", 2) if size == 1 else ("upper right", 1)
    legend_beside(figure, grid[:1], place, ncols=ncols)
    return figure


def _pair(axes: Axes, found: Identification, *pair: str) -> None:
    circle = np.linspace(0.0, 2.0 * math.pi, 181)
    unit = np.array([np.cos(circle), np.sin(circle)])
    r = float(np.clip(found.correlation[*map(found.names.index, pair)], -1.0, 1.0))
    root = np.array([[1.0, 0.0], [r, math.sqrt(max(1.0 - r * r, 0.0))]])

    def at(steps: Array) -> list[Array]:
        return [_moved(found, name, step) for name, step in zip(pair, steps, strict=True)]

    for share, alpha in ((0.95, 0.25), (0.68, 0.45)):
        region = at(math.sqrt(float(chi2.ppf(share, 2))) * (root @ unit))
        axes.fill(*region, color=Ink.SKY, alpha=alpha, lw=0.0, label=f"{100 * share:.0f} % region")
        axes.plot(*region, color=Ink.BLUE, lw=0.8)
    if found.posterior is not None:
        names, draws = found.posterior.names, found.posterior.draws
        some = draws[:: max(1, len(draws) // _DRAWS)]
        drawn = [some[:, names.index(name)] * per_shown(NAMES[name].unit) for name in pair]
        how: Any = {"alpha": 0.5, "color": Ink.VERMILION, "label": "draws from the posterior"}
        axes.plot(*drawn, ".", ms=1.6, mew=0.0, zorder=1.5, **how)
    axes.plot(*at(np.zeros((2, 1))), "+", ms=9.0, mew=1.5, color=Ink.BLACK, label="estimate")
    for name, vertical in zip(pair, (True, False), strict=True):
        label = f"95 % of the prior of {_SYMBOL[name]}"
        _prior_band(axes, found, name, vertical=vertical, label=label)
    axes.set_title(f"correlation {r:+.2f}".replace("-", "−"), fontsize=9.0, loc="left")
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_locator(MaxNLocator(5))


def _moved(found: Identification, name: str, steps: Array) -> Array:
    """Return a parameter, in the unit shown, so many standard deviations from its estimate."""
    e = found.parameters[name]
    if _logarithmic(found, name):
        return np.asarray(e.value * np.exp(steps * e.std / e.value) * per_shown(e.unit))
    return np.asarray((e.value + steps * e.std) * per_shown(e.unit))


def _prior_band(
    axes: Axes, found: Identification, name: str, *, vertical: bool, label: str | None
) -> None:
    prior = found.priors.get(name)
    if prior is None:
        return
    limits = axes.get_xlim() if vertical else axes.get_ylim()
    per = per_shown(NAMES[name].unit)
    low, high = (per * (prior.mean + k * prior.std) for k in (-Z95, Z95))
    span = axes.axvspan if vertical else axes.axhspan
    span(low, high, color=Ink.ORANGE, alpha=0.13, lw=0.0, zorder=0, label=label)
    (axes.set_xlim if vertical else axes.set_ylim)(*limits)


@styled
def draw_profiles(found: Identification) -> Figure:
    """Return each parameter's likelihood profile beside its quadratic approximation.

    Raises ValueError where no profile was computed.
    """
    names = [name for name in found.names if name in found.profiles]
    if not names:
        raise ValueError("no profile was computed")
    columns = min(len(names), 2 if len(names) in (2, 4) else 3)
    rows = math.ceil(len(names) / columns)
    figure = Figure(figsize=(_WIDTH * (0.5 if columns == 1 else 1.0), 2.9 * rows + 0.6))
    panels = grid_of(figure, len(names), columns)
    for k, (axes, name) in enumerate(zip(panels, names, strict=True)):
        _profile(axes, found, name)
        axes.set_ylabel("deviance [-]" if k % columns == 0 else "")
    legend_beside(figure, panels[:1], "outside upper center", ncols=4)
    return figure


def _profile(axes: Axes, found: Identification, name: str) -> None:
    p, e = found.profiles[name], found.parameters[name]
    per, log = per_shown(p.unit), _logarithmic(found, name)
    top = 9.0
    x = np.log(p.values) if log else p.values
    root = np.sign(p.values - e.value) * np.sqrt(p.deviance)
    fine = np.linspace(x[0], x[-1], 301)
    smooth = PchipInterpolator(x, root)(fine) ** 2
    values = np.exp(fine) if log else fine
    shown = smooth <= 1.15 * top
    spread = e.std / e.value if log else e.std
    centre = math.log(e.value) if log else e.value
    quadratic = ((fine - centre) / spread) ** 2
    axes.plot(per * values[shown], smooth[shown], color=Ink.BLUE, lw=1.8, label="profile")
    axes.plot(per * p.values, p.deviance, "o", ms=3.5, color=Ink.BLUE)
    label = "quadratic approximation"
    axes.plot(per * values, quadratic, "--", color=Ink.VERMILION, lw=1.3, label=label)
    axes.axhline(Z95**2, color=Ink.GREY, lw=0.9, ls=":", label="95 %: 3.84")
    plain = Estimate.of(e.value, e.std, e.unit, logarithmic=log)
    for ends, color, height in ((p.ci95, Ink.BLUE, -0.5), (plain.ci95, Ink.VERMILION, -1.15)):
        _interval(axes, per, ends, color, height)
    _prior_band(axes, found, name, vertical=True, label=None)
    axes.set(ylim=(-1.7, top), xlabel=axis_label(name))
    axes.set_yticks([0.0, 2.0, 4.0, 6.0, 8.0])
    axes.xaxis.set_major_locator(MaxNLocator(5))


def _interval(axes: Axes, per: float, ends: tuple[float, float], color: str, height: float) -> None:
    """Draw a 95 % interval as a bar, open where it does not end."""
    low, high = (per * end for end in ends)
    at = np.clip((low, high), *axes.get_xlim()) if np.isinf(ends).any() else (low, high)
    axes.plot(at, [height, height], color=color, lw=2.2, solid_capstyle="butt")
    for place in filter(math.isfinite, (low, high)):
        axes.plot([place, place], [height - 0.22, height + 0.22], color=color, lw=1.6)


PER_PAGE = 24  # logs in one picture
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


@style.styled
def draw_fits(found: Identification, first: int = 0) -> Figure:
    """Return measured and fitted depth of up to PER_PAGE logs from `first` on."""
    names, chosen = labels(found), found.experiments[first : first + PER_PAGE]
    figure, panels = _grid(len(chosen), 1.95)
    for k, (axes, e) in enumerate(zip(panels, chosen, strict=True)):
        time = e.record.time
        away = _outliers(e)
        style.shade(axes, time, ~np.isfinite(e.residual), "not used")
        axes.plot(time, e.record.depth, ".", ms=5.0, mew=0.0, color=Ink.GREY, label="measured")
        axes.plot(time, e.predicted, color=Ink.BLUE, lw=1.1, label="fitted")
        odd = time[away], e.record.depth[away]
        axes.plot(*odd, "x", ms=5.0, color=Ink.VERMILION, label="outlier")
        title = f"{names[first + k]}: {rounded(1e3 * e.rms, 2)} mm rms"
        axes.set_title(title, fontsize=9.0, loc="left")
        style.depth_axis(axes, "depth [m]" if k % _columns(len(chosen)) == 0 else "")
    return _keyed(figure, panels)


@style.styled
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
        axes.axhspan(-band, band, color=Ink.SKY, alpha=0.25, lw=0.0, label="95 % of the noise")
        axes.axhline(0.0, color=Ink.BLACK, lw=0.7)
        axes.plot(time[~away], off[~away], ".", ms=2.8, mew=0.0, color=Ink.BLUE, label="residual")
        odd, label = np.clip(off[away], -reach, reach), "outlier (at the edge: beyond it)"
        axes.plot(time[away], odd, "x", ms=5.0, color=Ink.VERMILION, label=label)
        axes.set_ylim(-1.08 * reach, 1.08 * reach)
        axes.set_title(names[first + k], fontsize=9.0, loc="left")
        axes.set_ylabel("residual [mm]" if k % _columns(len(chosen)) == 0 else "")
    return _keyed(figure, panels)


@style.styled
def draw_distribution(found: Identification) -> Figure:
    """Return the residuals of all logs against a normal distribution, and against themselves."""
    figure, (left, middle, right) = style.new_figure((_WIDTH, 3.3), 1, 3)
    u = np.concatenate([e.residual[np.isfinite(e.residual)] / e.noise for e in found.experiments])
    _histogram(left, u)
    _quantiles(middle, u)
    _autocorrelation(right, found.experiments)
    return figure


def _histogram(axes: Axes, u: Array) -> None:
    x, inside = np.linspace(-5.0, 5.0, 201), u[np.abs(u) <= 5.0]
    share = np.full(len(inside), 4.0 / max(len(u), 1))  # a density: bins are 0.25 wide
    how: Any = {"weights": share, "color": Ink.SKY, "ec": "white", "lw": 0.4}
    axes.hist(inside, bins=40, range=(-5.0, 5.0), **how, label="residuals")
    axes.plot(x, norm.pdf(x), color=Ink.BLACK, lw=1.2, label="normal")
    axes.set(xlabel="residual [standard deviations]", ylabel="density [-]")
    axes.set_ylim(top=1.28 * max(0.42, axes.get_ylim()[1]))
    beyond = len(u) - len(inside)
    if beyond:
        how = {"ha": "right", "color": Ink.VERMILION, "fontsize": 9.0}
        axes.text(0.98, 0.7, f"{beyond} beyond ±5", transform=axes.transAxes, **how)
    axes.legend(loc="upper right")


def _quantiles(axes: Axes, u: Array) -> None:
    ordered = np.sort(u)
    n = len(ordered)
    expected = norm.ppf((np.arange(n) + 0.5) / n)
    reach = min(max(float(np.abs(ordered).max(initial=0.0)), 3.5), _FURTHEST)
    inside = np.abs(ordered) <= reach
    axes.plot([-reach, reach], [-reach, reach], color=Ink.BLACK, lw=0.9, label="normal")
    axes.plot(expected[inside], ordered[inside], ".", ms=4.0, mew=0.0, color=Ink.BLUE)
    for side, mark in ((ordered > reach, "^"), (ordered < -reach, "v")):
        if side.any():  # nothing without a clip has no size, which the layout cannot bear
            at = np.sign(ordered[side]) * reach
            axes.plot(expected[side], at, mark, ms=6.0, color=Ink.VERMILION, clip_on=False)
    axes.set(xlabel="normal quantile [-]", ylabel="residual [standard deviations]")
    axes.set(xlim=(-4.2, 4.2), ylim=(-1.05 * reach, 1.05 * reach))
    axes.legend(loc="upper left")


def _autocorrelation(axes: Axes, experiments: Sequence[ExperimentFit]) -> None:
    total, weight = np.zeros(31), np.zeros(31)
    for e in experiments:
        r = _own_correlation(e)
        lags = np.arange(1, len(r))
        axes.plot(lags, r[1:], color=Ink.GREY, lw=0.6, alpha=0.7, label="each log")
        n = int((e.weight > 0.0).sum())
        total[: len(r)] += n * r
        weight[: len(r)] += n
    kept = weight > 0.0
    mean = total[kept] / weight[kept]
    band = 1.96 / math.sqrt(weight[0]) if weight[0] else 0.0
    axes.axhspan(-band, band, color=Ink.SKY, alpha=0.35, lw=0.0, label="95 % if white")
    axes.axhline(0.0, color=Ink.BLACK, lw=0.7)
    lags = np.arange(1, len(mean))
    axes.vlines(lags, 0.0, mean[1:], color=Ink.BLUE, lw=1.6)
    axes.plot(lags, mean[1:], "o", ms=3.2, color=Ink.BLUE, label="all logs")
    low, high = axes.get_ylim()
    reach = (min(low, -0.3), max(high * 1.25, 0.5))
    axes.set(ylim=reach, xlabel="lag [samples]", ylabel="autocorrelation [-]")
    style.legend_above(axes, loc="upper right", bbox_to_anchor=None, ncols=1)


def _own_correlation(e: ExperimentFit) -> Array:
    used = np.isfinite(e.residual)
    u = np.sqrt(e.weight[used]) * e.residual[used]
    n, most = len(u), min(31, max(len(u) // 3, 1))
    power = float(u @ u)
    return np.array([float(u[: n - k] @ u[k:]) / power if power else 0.0 for k in range(most)])


def _outliers(e: ExperimentFit) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(e.residual) & (e.weight < _OUTLIER))


def _reach(e: ExperimentFit) -> float:
    """Return the largest residual [m] that is worth an axis: no outlier, 3 noises at least."""
    kept = np.isfinite(e.residual) & (e.weight >= _OUTLIER)
    return max(float(np.abs(e.residual[kept]).max(initial=0.0)), 3.0 * e.noise)


def _columns(count: int) -> int:
    return min(count, 2 if count in (2, 4) else 3 if count < 7 else 4)


def _grid(count: int, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels, as many as there are logs."""
    columns = _columns(count)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(_WIDTH, height * max(rows, 1.4) + 0.5))
    return figure, style.grid_of(figure, count, columns)


def _keyed(figure: Figure, panels: list[Axes]) -> Figure:
    """Give panels few ticks, label the time axis of the lowest, and put one key above all."""
    for k, axes in enumerate(panels):
        axes.margins(x=0.02)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.yaxis.set_major_locator(MaxNLocator(4))
        axes.tick_params(labelsize=8.5)
        if k + _columns(len(panels)) >= len(panels):
            axes.set_xlabel("time [s]")
    style.legend_beside(figure, panels, "outside upper right", markerscale=2.0)
    return figure


@style.styled
def draw_neutral(found: Identification) -> Figure:
    """Return each log's neutral-volume error against what was assumed of it, and its drift."""
    names = labels(found)
    size = (_WIDTH, max(2.4, 0.28 * len(names) + 1.3))
    figure, (left, right) = style.new_figure(size, 1, 2, sharey=True)
    errors = [e.estimates["neutral_error"] for e in found.experiments]
    if math.isfinite(found.neutral_std):
        for k, alpha in ((2.0, 0.12), (1.0, 0.18)):
            reach = 1e6 * k * found.neutral_std
            label = f"assumed, ±{k:.0f} standard deviation{'s' if k > 1.0 else ''}"
            left.axvspan(-reach, reach, color=Ink.ORANGE, alpha=alpha, lw=0.0, label=label)
    _dots(left, errors, "m3")
    left.set(xlabel="neutral volume, true less assumed [cm³]")
    left.set_yticks(range(len(names)), labels=names)
    left.set_ylim(len(names) - 0.4, -0.6)
    _dots(right, [e.drift for e in found.experiments], "m3/s")
    right.set(xlabel="drift of the neutral volume [cm³/h]")
    for axes in (left, right):
        axes.axvline(0.0, color=Ink.BLACK, lw=0.8)
        axes.grid(axis="y", visible=False)
    style.legend_beside(figure, [left], "outside upper center")
    return figure


def _dots(axes: Axes, estimates: Sequence[Estimate], unit: str) -> None:
    """Draw estimates with their 95 % intervals, one above the other."""
    per = per_shown(unit)
    values = per * np.array([e.value for e in estimates])
    half = per * np.array([Z95 * e.std for e in estimates])
    known = np.flatnonzero(np.isfinite(half))
    how: Any = {"fmt": "o", "ms": 4.5, "color": Ink.BLUE, "elinewidth": 1.3, "capsize": 2.5}
    axes.errorbar(values[known], known, xerr=half[known], **how, label="estimate, 95 %")


@style.styled
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
    figure, (axes,) = style.new_figure((_WIDTH * 0.8, 3.6))
    shown: list[Any] = []
    if of_all.ci95[0] > 0.0 and of_all.ci95[1] < np.inf:
        ends = sorted(of_all.ci95 if absolute else [of_all.value / end for end in of_all.ci95])
        shown.append(axes.axhspan(*ends, color=Ink.SKY, alpha=0.3, lw=0.0, label="all logs, 95 %"))
    axes.axhline(joint, color=Ink.BLUE, lw=1.0)
    widest = max(e.step for e in own)
    for sinks, mark, label in ((False, "^", "rising"), (True, "v", "sinking")):
        chosen = [e for e in own if _sinks(e) == sinks]
        if not chosen:
            continue
        gain, std = np.array([e.own_gain for e in chosen]).T
        at = np.array([e.step for e in chosen]) + (0.006 if sinks else -0.006) * widest
        middle = joint * np.exp(gain)
        error = np.abs(joint * np.exp(gain + Z95 * np.array([[-1.0], [1.0]]) * std) - middle)
        how: Any = {"fmt": mark, "ms": 6.0, "color": Ink.BLUE, "elinewidth": 1.3, "capsize": 2.5}
        how |= {"mfc": Ink.BLUE if sinks else "white", "label": f"each log alone, {label}, 95 %"}
        shown.append(axes.errorbar(1e6 * at, middle, yerr=error, **how))
    for (label, points), mark, color in zip(
        (singles or {}).items(), ("s", "D"), (Ink.VERMILION, Ink.GREEN), strict=False
    ):
        x, y = np.array(points).T
        shown += axes.plot(1e6 * x, y, mark, ms=5.0, mfc="none", mew=1.4, color=color, label=label)
        average = float(y.mean())
        shown.append(axes.axhline(average, color=color, lw=1.0, ls="--", label="their average"))
    axes.set_xlabel("size of the volume change [cm³]")
    axes.set_ylabel(axis_label("K2") if absolute else "gain over that of all logs [-]")
    axes.margins(x=0.08, y=0.15)
    axes.set_ylim(bottom=max(axes.get_ylim()[0], 0.0))
    axes.legend(handles=shown, loc="center left", bbox_to_anchor=(1.02, 0.5))
    return figure


def _sinks(e: ExperimentFit) -> bool:
    used = np.flatnonzero(np.isfinite(e.residual))
    return bool(e.predicted[used[-1]] > e.predicted[used[0]])
