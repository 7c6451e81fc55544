"""A campaign as pictures: its floats' numbers, and which inputs its outcome comes from."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from swimbladder.show.plots.style import Ink, grid_of, label_panels, legend_beside, styled
from swimbladder.sim.campaign.result import Campaign, Sensitivity

_HIGH = 0.36  # of a bar


@styled
def draw_campaign(found: Campaign) -> Figure:
    """Return how the numbers of the floats are distributed, a panel for each that differs."""
    shown = [one for one in found.numbers() if np.ptp(one[2]) > 0.0] or found.numbers()
    lines = -(-len(shown) // 3)
    figure = Figure(figsize=(9.6, 0.8 + 2.4 * lines))
    panels = grid_of(figure, len(shown), 3)
    for axes, (words, unit, values) in zip(panels, shown, strict=False):
        axes.hist(values, bins="auto" if np.ptp(values) > 0.0 else 1, color=Ink.BLUE)
        axes.axvline(float(np.median(values)), color=Ink.BLACK, lw=1.0, ls="--")
        axes.set_xlabel(f"{words} [{unit or '-'}]")
        axes.set_ylabel("floats [-]")
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    label_panels(panels[: len(shown)])
    figure.suptitle(f"{found.sentence}\ndashed: median", fontsize=10.0)
    return figure


@styled
def draw_sensitivity(found: Sensitivity) -> Figure:
    """Return the indices of each output that has them, with their intervals, a panel each."""
    names = found.design.names
    shown = [one for one in found.outputs if one.indices]
    columns = min(max(len(shown), 1), 3)
    lines = -(-max(len(shown), 1) // columns)
    figure = Figure(figsize=(1.2 + 2.9 * columns, 1.3 + lines * (0.7 + 0.42 * len(names))))
    panels = grid_of(figure, max(len(shown), 1), columns, sharex=True, sharey=True)
    rows = np.arange(len(names))[::-1]
    for axes, one in zip(panels, shown, strict=False):
        first, total = (Ink.BLUE, "first order"), (Ink.SKY, "total")
        for kind, low, (color, label) in (("first", 0.0, first), ("total", -_HIGH, total)):
            value = np.array([getattr(index, kind) for index in one.indices])
            ends = np.array([getattr(index, f"{kind}_ci95") for index in one.indices])
            at = rows + low + 0.5 * _HIGH
            axes.barh(at, value, height=_HIGH, color=color, label=label)
            axes.hlines(at, ends[:, 0], ends[:, 1], color=Ink.BLACK, lw=1.0)
        axes.axvline(0.0, color=Ink.BLACK, lw=0.6)
        axes.set_title(f"{one.name}\n", fontsize=10.0)
        axes.grid(visible=False, axis="y")
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("share of the variance [-]")
    panels[0].set_yticks(rows, names)
    panels[0].set_xlim(min(-0.05, panels[0].get_xlim()[0]), max(1.05, panels[0].get_xlim()[1]))
    if shown:
        label_panels(panels)
        legend_beside(figure, panels[:1], "outside lower center")
    title = f"Sobol indices of {found.design.floats} floats; lines: 95 % intervals"
    figure.suptitle(title, fontsize=10.5)
    return figure
