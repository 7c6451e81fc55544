"""How sure the parameters are: ellipses and likelihood profiles."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.stats import chi2

from swimbladder.estimation.estimates import Z95, estimate
from swimbladder.estimation.motion import NAMES, Identification
from swimbladder.show.plots.style import Ink, grid_of, legend_beside, styled
from swimbladder.units import shown_unit, unit_factor

Array = NDArray[np.float64]

_PRETTY = {
    "1/m2/s": "1/(m² s)", "N s2/m2": "N s²/m²", "cm3/m": "cm³/m", "cm3": "cm³", "cm3/h": "cm³/h",
}  # fmt: skip
_SYMBOL = {
    "K1": "K₁", "T1": "T₁", "K2": "K₂", "T2": "T₂", "mass": "mass",
    "drag_quadratic": r"k$_\mathrm{dt}$", "psi": "ψ",
}  # fmt: skip
WIDTH = 9.6  # inches
_DRAWS = 1500  # of the posterior, that are drawn


def axis_label(name: str) -> str:
    """Return a parameter's symbol and the unit that it is drawn in."""
    unit = shown_unit(NAMES[name].unit)
    return f"{_SYMBOL[name]} [{_PRETTY.get(unit, unit)}]"


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
    figure = Figure(figsize=(min(side * size * 1.15, WIDTH), side * size))
    grid = figure.subplots(size, size, squeeze=False)
    for row in range(size):
        for column in range(size):
            axes = grid[row][column]
            if column > row:
                axes.remove()
                continue
            _pair(axes, found, column, row + 1)
            axes.set_xlabel(axis_label(names[column]) if row == size - 1 else "")
            axes.set_ylabel(axis_label(names[row + 1]) if column == 0 else "")
            axes.tick_params(labelbottom=row == size - 1, labelleft=column == 0)
    handles, texts = grid[0][0].get_legend_handles_labels()
    if size == 1:
        figure.legend(handles, texts, loc="outside upper center", ncols=2)
    else:
        figure.legend(handles, texts, loc="upper right")
    return figure


def _pair(axes: Axes, found: Identification, i: int, j: int) -> None:
    names = found.names
    circle = np.linspace(0.0, 2.0 * math.pi, 181)
    unit = np.array([np.cos(circle), np.sin(circle)])
    r = float(np.clip(found.correlation[i, j], -1.0, 1.0))
    root = np.array([[1.0, 0.0], [r, math.sqrt(max(1.0 - r * r, 0.0))]])
    for share, alpha in ((0.95, 0.25), (0.68, 0.45)):
        across = math.sqrt(float(chi2.ppf(share, 2))) * (root @ unit)
        x, y = (
            _moved(found, name, steps)
            for name, steps in zip((names[i], names[j]), across, strict=True)
        )
        axes.fill(x, y, color=Ink.SKY, alpha=alpha, lw=0.0, label=f"{100 * share:.0f} % region")
        axes.plot(x, y, color=Ink.BLUE, lw=0.8)
    if found.posterior is not None:
        draws = found.posterior.draws[:: max(1, len(found.posterior.draws) // _DRAWS)]
        first, second = (
            draws[:, found.posterior.names.index(name)] * per_shown(NAMES[name].unit)
            for name in (names[i], names[j])
        )
        axes.plot(
            first, second, ".", ms=1.6, mew=0.0, alpha=0.5, color=Ink.VERMILION, zorder=1.5,
            label="draws from the posterior",
        )  # fmt: skip
    at = [_moved(found, name, np.zeros(1))[0] for name in (names[i], names[j])]
    axes.plot(*at, "+", ms=9.0, mew=1.5, color=Ink.BLACK, label="estimate")
    for name, vertical in ((names[i], True), (names[j], False)):
        label = f"95 % of the prior of {_SYMBOL[name]}"
        _prior_band(axes, found, name, vertical=vertical, label=label)
    axes.set_title(f"correlation {r:+.2f}".replace("-", "−"), fontsize=9.0, loc="left")
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_locator(MaxNLocator(5))


def _moved(found: Identification, name: str, steps: Array) -> Array:
    """Return a parameter, in the unit shown, so many standard deviations from its estimate."""
    e = found.parameters[name]
    if _logarithmic(found, name):
        result: Array = e.value * np.exp(steps * e.std / e.value) * per_shown(e.unit)
        return result
    shifted: Array = (e.value + steps * e.std) * per_shown(e.unit)
    return shifted


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
    figure = Figure(figsize=(WIDTH * (0.5 if columns == 1 else 1.0), 2.9 * rows + 0.6))
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
    axes.plot(
        per * values, quadratic, "--", color=Ink.VERMILION, lw=1.3, label="quadratic approximation"
    )
    axes.axhline(Z95**2, color=Ink.GREY, lw=0.9, ls=":", label="95 %: 3.84")
    plain = estimate(e.value, e.std, e.unit, logarithmic=log)
    for ends, color, height in ((p.ci95, Ink.BLUE, -0.5), (plain.ci95, Ink.VERMILION, -1.15)):
        _interval(axes, per, ends, color, height)
    _prior_band(axes, found, name, vertical=True, label=None)
    axes.set(ylim=(-1.7, top), xlabel=axis_label(name))
    axes.set_yticks([0.0, 2.0, 4.0, 6.0, 8.0])
    axes.xaxis.set_major_locator(MaxNLocator(5))


def _interval(axes: Axes, per: float, ends: tuple[float, float], color: str, height: float) -> None:
    """Draw a 95 % interval as a bar, open where it does not end."""
    low, high = axes.get_xlim()
    at = [
        per * end if math.isfinite(end) else edge
        for end, edge in zip(ends, (low, high), strict=True)
    ]
    axes.plot(at, [height, height], color=color, lw=2.2, solid_capstyle="butt")
    for end, place in zip(ends, at, strict=True):
        if math.isfinite(end):
            axes.plot([place, place], [height - 0.22, height + 0.22], color=color, lw=1.6)
