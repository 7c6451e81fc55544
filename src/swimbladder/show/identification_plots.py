"""The fit to each log, and its residuals: in time, as a distribution, against itself.

And each log by itself: its neutral volume, and its own gain beside that of all. How sure the
parameters are: ellipses and likelihood profiles.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.special import chdtri, ndtri

from swimbladder.estimation.estimates import Z95
from swimbladder.estimation.motion import NAMES, Estimate, ExperimentFit, Identification
from swimbladder.physics.arrays import Array, Flags
from swimbladder.show.picture import Axis, Ink, Panel, Picture, grid_of, one_panel
from swimbladder.units import rounded, shown_unit, unit_factor

_PRETTY = {"1/m2/s": "1/(m² s)", "N s2/m2": "N s²/m²"}
_SYMBOL = {
    "K1": "K₁",
    "T1": "T₁",
    "K2": "K₂",
    "T2": "T₂",
    "mass": "mass",
    "psi": "ψ",
    "drag_quadratic": "k_dt",
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


def draw_ellipses(found: Identification) -> Picture:
    """Return the regions that hold a pair of parameters with 68 and 95 %, for every pair.

    Of quantities fitted as logarithms the region is an ellipse in these. Raises ValueError where
    there is no pair.
    """
    names = found.names
    if len(names) < 2:
        raise ValueError("one parameter makes no pair")
    count = len(names) - 1
    side = 3.6 if count == 1 else 3.0 if count == 2 else 2.4
    size = (min(side * count * 1.15, _WIDTH), side * count)
    shared: Any = {"sharex": "column", "sharey": "row", "legend": "above", "across": 2}
    picture = Picture(size, count, count, **shared)
    for row in range(count):
        for column in range(row + 1):
            panel = picture.add(row, column, xticks=4, yticks=5)
            _pair(panel, found, names[column], names[row + 1])
            panel.x = axis_label(names[column]) if row == count - 1 else ""
            panel.y = axis_label(names[row + 1]) if column == 0 else ""
    return picture


def _pair(panel: Panel, found: Identification, *pair: str) -> None:
    circle = np.linspace(0.0, 2.0 * math.pi, 181)
    unit = np.array([np.cos(circle), np.sin(circle)])
    r = float(np.clip(found.correlation[*map(found.names.index, pair)], -1.0, 1.0))
    root = np.array([[1.0, 0.0], [r, math.sqrt(max(1.0 - r * r, 0.0))]])

    def at(steps: Array) -> list[Array]:
        return [_moved(found, name, step) for name, step in zip(pair, steps, strict=True)]

    for share, alpha in ((0.95, 0.25), (0.68, 0.45)):
        x, y = at(math.sqrt(float(chdtri(2, 1.0 - share))) * (root @ unit))
        panel.area(x, y, Ink.SKY, f"{100 * share:.0f} % region", alpha=alpha)
        panel.line(x, y, width=0.8)
    if found.posterior is not None:
        names, draws = found.posterior.names, found.posterior.draws
        some = draws[:: max(1, len(draws) // _DRAWS)]
        x, y = (some[:, names.index(name)] * per_shown(NAMES[name].unit) for name in pair)
        how: Any = {"size": 1.6, "alpha": 0.5, "layer": 1.5}
        panel.dots(x, y, ".", Ink.VERMILION, "draws from the posterior", **how)
    x, y = at(np.zeros((2, 1)))
    panel.dots(x, y, "+", Ink.BLACK, "estimate", size=9.0)
    _prior_band(panel, found, pair[0], "x", f"95 % of the prior of {_SYMBOL[pair[0]]}")
    _prior_band(panel, found, pair[1], "y", f"95 % of the prior of {_SYMBOL[pair[1]]}")
    panel.title = f"correlation {r:+.2f}".replace("-", "−")


def _moved(found: Identification, name: str, steps: Array) -> Array:
    """Return a parameter, in the unit shown, so many standard deviations from its estimate."""
    e = found.parameters[name]
    if _logarithmic(found, name):
        return np.asarray(e.value * np.exp(steps * e.std / e.value) * per_shown(e.unit))
    return np.asarray((e.value + steps * e.std) * per_shown(e.unit))


def _prior_band(
    panel: Panel, found: Identification, name: str, axis: Axis, label: str = ""
) -> None:
    prior = found.priors.get(name)
    if prior is None:
        return
    setattr(panel, f"{axis}lim", panel.limits(axis))
    per = per_shown(NAMES[name].unit)
    low, high = (per * (prior.mean + k * prior.std) for k in (-Z95, Z95))
    panel.span(axis, low, high, Ink.ORANGE, label, alpha=0.13)


def draw_profiles(found: Identification) -> Picture:
    """Return each parameter's likelihood profile beside its quadratic approximation.

    Raises ValueError where no profile was computed.
    """
    names = [name for name in found.names if name in found.profiles]
    if not names:
        raise ValueError("no profile was computed")
    columns = min(len(names), 2 if len(names) in (2, 4) else 3)
    rows = math.ceil(len(names) / columns)
    size = (_WIDTH * (0.5 if columns == 1 else 1.0), 2.9 * rows + 0.6)
    picture, panels = grid_of(size, len(names), columns, legend="above")
    for k, (panel, name) in enumerate(zip(panels, names, strict=True)):
        _profile(panel, found, name)
        panel.y = "deviance [-]" if k % columns == 0 else ""
    return picture


def _profile(panel: Panel, found: Identification, name: str) -> None:
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
    panel.line(per * values[shown], smooth[shown], label="profile", width=1.8)
    panel.dots(per * p.values, p.deviance, "o", size=3.5)
    label = "quadratic approximation"
    panel.line(per * values, quadratic, Ink.VERMILION, label, dash="--", width=1.3)
    panel.rule("y", Z95**2, Ink.GREY, "95 %: 3.84", dash=":", width=0.9)
    plain = Estimate.of(e.value, e.std, e.unit, logarithmic=log)
    for ends, color, height in ((p.ci95, Ink.BLUE, -0.5), (plain.ci95, Ink.VERMILION, -1.15)):
        _interval(panel, per, ends, color, height)
    _prior_band(panel, found, name, "x")
    panel.ylim, panel.x, panel.xticks = (-1.7, top), axis_label(name), 5
    panel.yticks = {float(tick): f"{tick}" for tick in (0, 2, 4, 6, 8)}


def _interval(
    panel: Panel, per: float, ends: tuple[float, float], color: str, height: float
) -> None:
    """Draw a 95 % interval as a bar, open where it does not end."""
    low, high = (per * end for end in ends)
    at = np.clip((low, high), *panel.limits("x")) if np.isinf(ends).any() else (low, high)
    panel.line(at, [height, height], color, width=2.2)
    known = [place for place in (low, high) if math.isfinite(place)]
    panel.between(known, height - 0.22, height + 0.22, color, width=1.6)


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


def draw_fits(found: Identification, first: int = 0) -> Picture:
    """Return measured and fitted depth of up to PER_PAGE logs from `first` on."""
    names, chosen = labels(found), found.experiments[first : first + PER_PAGE]
    picture, panels = _grid(len(chosen), 1.95)
    for k, (panel, e) in enumerate(zip(panels, chosen, strict=True)):
        time = e.record.time
        away = _outliers(e)
        panel.shade(time, ~np.isfinite(e.residual), "not used")
        panel.dots(time, e.record.depth, ".", Ink.GREY, "measured", size=5.0)
        panel.line(time, e.predicted, label="fitted", width=1.1)
        if away.any():
            seen = time[away], e.record.depth[away]
            panel.dots(*seen, "x", Ink.VERMILION, "outlier", size=5.0)
        panel.title = f"{names[first + k]}: {rounded(1e3 * e.rms, 2)} mm rms"
        panel.deep, panel.y = True, "depth [m]" if panel.column == 0 else ""
    return picture


def draw_residuals(found: Identification, first: int = 0) -> Picture:
    """Return measured less fitted depth of up to PER_PAGE logs from `first` on, outliers marked.

    All on one scale, unless the logs differ by so much that little would be seen of most.
    """
    names, chosen = labels(found), found.experiments[first : first + PER_PAGE]
    picture, panels = _grid(len(chosen), 1.6)
    reaches = [1e3 * _reach(e) for e in chosen]
    if max(reaches) < _ALIKE * min(reaches):
        reaches = [max(reaches)] * len(reaches)
    for k, (panel, e, reach) in enumerate(zip(panels, chosen, reaches, strict=True)):
        used = np.isfinite(e.residual)
        time, off = e.record.time[used], 1e3 * e.residual[used]
        away = _outliers(e)[used]
        band = 1e3 * 1.96 * e.noise
        panel.span("y", -band, band, Ink.SKY, "95 % of the noise")
        panel.rule("y", 0.0, Ink.BLACK, width=0.7)
        panel.dots(time[~away], off[~away], ".", label="residual", size=2.8)
        if away.any():
            odd, label = np.clip(off[away], -reach, reach), "outlier (at the edge: beyond it)"
            panel.dots(time[away], odd, "x", Ink.VERMILION, label, size=5.0)
        panel.ylim, panel.title = (-1.08 * reach, 1.08 * reach), names[first + k]
        panel.y = "residual [mm]" if panel.column == 0 else ""
    return picture


def draw_distribution(found: Identification) -> Picture:
    """Return the residuals of all logs against a normal distribution, and against themselves."""
    picture, (left, middle, right) = grid_of((_WIDTH, 3.3), 3, 3)
    u = np.concatenate([e.residual[np.isfinite(e.residual)] / e.noise for e in found.experiments])
    _histogram(left, u)
    _quantiles(middle, u)
    _autocorrelation(right, found.experiments)
    return picture


def _histogram(panel: Panel, u: Array) -> None:
    x, inside = np.linspace(-5.0, 5.0, 201), u[np.abs(u) <= 5.0]
    # a density: bins are 0.25 wide
    panel.histogram(
        inside, np.linspace(-5.0, 5.0, 41), Ink.SKY, "residuals", scale=4.0 / max(len(u), 1)
    )
    panel.line(x, np.exp(-0.5 * x**2) / math.sqrt(2.0 * math.pi), Ink.BLACK, "normal", width=1.2)
    panel.x, panel.y = "residual [standard deviations]", "density [-]"
    panel.ylim = (0.0, 1.28 * max(0.42, panel.limits("y")[1]))
    beyond = len(u) - len(inside)
    if beyond:
        how: Any = {"across": "right", "color": Ink.VERMILION, "share": "xy"}
        panel.text(0.98, 0.7, f"{beyond} beyond ±5", **how)
    panel.legend = "upper right"


def _quantiles(panel: Panel, u: Array) -> None:
    ordered = np.sort(u)
    n = len(ordered)
    expected = ndtri((np.arange(n) + 0.5) / n)
    reach = min(max(float(np.abs(ordered).max(initial=0.0)), 3.5), _FURTHEST)
    inside = np.abs(ordered) <= reach
    panel.line([-reach, reach], [-reach, reach], Ink.BLACK, "normal", width=0.9)
    panel.dots(expected[inside], ordered[inside], ".", size=4.0)
    for side, mark in ((ordered > reach, "^"), (ordered < -reach, "v")):
        if side.any():
            at = np.sign(ordered[side]) * reach
            panel.dots(expected[side], at, mark, Ink.VERMILION)
    panel.x, panel.y = "normal quantile [-]", "residual [standard deviations]"
    panel.xlim, panel.ylim, panel.legend = (-4.2, 4.2), (-1.05 * reach, 1.05 * reach), "upper left"


def _autocorrelation(panel: Panel, experiments: Sequence[ExperimentFit]) -> None:
    total, weight = np.zeros(31), np.zeros(31)
    for e in experiments:
        r = _own_correlation(e)
        lags = np.arange(1, len(r))
        panel.line(lags, r[1:], Ink.GREY, "each log", width=0.6, alpha=0.7)
        n = int((e.weight > 0.0).sum())
        total[: len(r)] += n * r
        weight[: len(r)] += n
    kept = weight > 0.0
    mean = total[kept] / weight[kept]
    band = 1.96 / math.sqrt(weight[0]) if weight[0] else 0.0
    panel.span("y", -band, band, Ink.SKY, "95 % if white", alpha=0.35)
    panel.rule("y", 0.0, Ink.BLACK, width=0.7)
    lags = np.arange(1, len(mean))
    panel.between(lags, 0.0, mean[1:], width=1.6)
    panel.dots(lags, mean[1:], "o", label="all logs", size=3.2)
    low, high = panel.limits("y")
    panel.ylim, panel.legend = (min(low, -0.3), max(high * 1.25, 0.5)), "upper right"
    panel.x, panel.y = "lag [samples]", "autocorrelation [-]"


def _own_correlation(e: ExperimentFit) -> Array:
    used = np.isfinite(e.residual)
    u = np.sqrt(e.weight[used]) * e.residual[used]
    n, most = len(u), min(31, max(len(u) // 3, 1))
    power = float(u @ u)
    return np.array([float(u[: n - k] @ u[k:]) / power if power else 0.0 for k in range(most)])


def _outliers(e: ExperimentFit) -> Flags:
    return np.asarray(np.isfinite(e.residual) & (e.weight < _OUTLIER))


def _reach(e: ExperimentFit) -> float:
    """Return the largest residual [m] that is worth an axis: no outlier, 3 noises at least."""
    kept = np.isfinite(e.residual) & (e.weight >= _OUTLIER)
    return max(float(np.abs(e.residual[kept]).max(initial=0.0)), 3.0 * e.noise)


def _columns(count: int) -> int:
    return min(count, 2 if count in (2, 4) else 3 if count < 7 else 4)


def _grid(count: int, height: float) -> tuple[Picture, list[Panel]]:
    """Return a picture of panels, as many as there are logs, with few ticks and one legend."""
    columns = _columns(count)
    rows = math.ceil(count / columns)
    size = (_WIDTH, height * max(rows, 1.4) + 0.5)
    picture, panels = grid_of(size, count, columns, legend="above")
    for k, panel in enumerate(panels):
        panel.xticks = panel.yticks = 4
        panel.x = "time [s]" if k + columns >= count else ""
    return picture, panels


def draw_neutral(found: Identification) -> Picture:
    """Return each log's neutral-volume error against what was assumed of it, and its drift."""
    names = labels(found)
    size = (_WIDTH, max(2.4, 0.28 * len(names) + 1.3))
    picture, panels = grid_of(size, 2, 2, sharey="all", legend="above")
    left, right = panels
    errors = [e.estimates["neutral_error"] for e in found.experiments]
    if math.isfinite(found.neutral_std):
        for k, alpha in ((2.0, 0.12), (1.0, 0.18)):
            reach = 1e6 * k * found.neutral_std
            label = f"assumed, ±{k:.0f} standard deviation{'s' if k > 1.0 else ''}"
            left.span("x", -reach, reach, Ink.ORANGE, label, alpha=alpha)
    _estimates(left, errors, "m3")
    _estimates(right, [e.drift for e in found.experiments], "m3/s")
    left.x = "neutral volume, true less assumed [cm³]"
    right.x = "drift of the neutral volume [cm³/h]"
    for panel in panels:
        panel.rule("x", 0.0, Ink.BLACK)
        panel.yticks, panel.ylim = dict(enumerate(names)), (-0.6, len(names) - 0.4)
        panel.grid, panel.deep = "x", True
    return picture


def _estimates(panel: Panel, estimates: Sequence[Estimate], unit: str) -> None:
    """Draw estimates with their 95 % intervals, one above the other."""
    per = per_shown(unit)
    values = per * np.array([e.value for e in estimates])
    half = per * np.array([Z95 * e.std for e in estimates])
    known = np.flatnonzero(np.isfinite(half))
    ends = values[known] - half[known], values[known] + half[known]
    panel.between(known, *ends, width=1.3, flat=True)
    panel.dots(values[known], known, "o", label="estimate, 95 %", size=4.5)


def draw_gains(
    found: Identification, singles: Mapping[str, Sequence[tuple[float, float]]] | None = None
) -> Picture:
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
    picture, panel = one_panel((_WIDTH * 0.8, 3.6), legend="beside")
    if of_all.ci95[0] > 0.0 and of_all.ci95[1] < np.inf:
        ends = of_all.ci95 if absolute else [of_all.value / end for end in of_all.ci95]
        panel.span("y", min(ends), max(ends), Ink.SKY, "all logs, 95 %", alpha=0.3)
    panel.rule("y", joint, Ink.BLUE, width=1.0)
    widest = max(e.step for e in own)
    for sinks, mark, way in ((False, "^", "rising"), (True, "v", "sinking")):
        chosen = [e for e in own if _sinks(e) == sinks]
        if not chosen:
            continue
        gain, std = np.array([e.own_gain for e in chosen]).T
        at = np.array([e.step for e in chosen]) + (0.006 if sinks else -0.006) * widest
        low, high = joint * np.exp(gain + Z95 * np.array([[-1.0], [1.0]]) * std)
        panel.between(1e6 * at, low, high, width=1.3)
        label = f"each log alone, {way}, 95 %"
        panel.dots(1e6 * at, joint * np.exp(gain), mark, label=label, hollow=not sinks)
    for (label, points), mark, color in zip(
        (singles or {}).items(), ("s", "D"), (Ink.VERMILION, Ink.GREEN), strict=False
    ):
        x, y = np.array(points).T
        panel.dots(1e6 * x, y, mark, color, label, size=5.0, hollow=True)
        panel.rule("y", y.mean(), color, f"{label}, average", width=1.0, dash="--")
    panel.x = "size of the volume change [cm³]"
    panel.y = axis_label("K2") if absolute else "gain over that of all logs [-]"
    low, high = panel.limits("y")
    panel.ylim = (max(low - 0.1 * (high - low), 0.0), high + 0.1 * (high - low))
    return picture


def _sinks(e: ExperimentFit) -> bool:
    used = np.flatnonzero(np.isfinite(e.residual))
    return bool(e.predicted[used[-1]] > e.predicted[used[0]])
