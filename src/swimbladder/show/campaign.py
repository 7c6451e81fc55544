"""A campaign as it is shown: its floats' numbers, and which inputs its outcome comes from."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from swimbladder.show.parts import Drawn, Part, Shown, Table
from swimbladder.show.style import Ink, grid_of, label_panels, legend_beside, styled
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


class CampaignShown(Shown[Campaign]):
    """What became of the floats, their numbers, and what these come from."""

    name = "campaign"

    def parts(self) -> Iterator[Part]:
        """Give the answer first; where they are a design, its indices are what was asked for."""
        found = self.found
        if found.sensitivity is not None:
            yield found.sensitivity.sentence
            yield from _indices(found.sensitivity)
            yield Drawn("sensitivity", partial(draw_sensitivity, found.sensitivity), "indices")
        yield found.sentence
        what = "what became of them"
        ways = []
        for words, count, part, (low, high) in found.shares():
            share = f"{100.0 * part:.1f} %", f"{100.0 * low:.1f} to {100.0 * high:.1f} %"
            ways.append((str(count), *share, words))
        yield Table(("floats", "share", "95 %", what), ways, left=[what])
        numbers = [
            (words, *(f"{x:.4g}" for x in (middle, low, high)), unit)
            for words, unit, middle, low, high in found.spreads()
        ]
        headings = ("per float", "median", "5 %", "95 %", "unit")
        yield Table(headings, numbers, left=("per float", "unit"))
        if (life := found.battery_life) is not None:
            row = f"{life.median:g}", "{} to {}".format(*life.prediction95)
            yield Table(
                ("the next float", "median", "95 % prediction"), [("cycles on one battery", *row)]
            )
        yield Drawn("campaign", partial(draw_campaign, found))

    def table(self) -> Any:
        """Return the columns of floats.csv."""
        return self.found.by_float()

    def files(self) -> dict[str, object]:
        """Return floats.csv: a row for each float."""
        return {"floats.csv": self.table()}


def _indices(found: Sensitivity) -> Iterator[Part]:
    headings = ("output", "comes from", "first order", "95 %", "total", "95 % ")
    rows = []
    for one in found.outputs:
        for name, index in zip(found.design.names, one.indices, strict=False):
            first = f"{index.first:.2f}", "{:.2f} to {:.2f}".format(*index.first_ci95)
            total = f"{index.total:.2f}", "{:.2f} to {:.2f}".format(*index.total_ci95)
            rows.append((one.name if name == found.design.names[0] else "", name, *first, *total))
    if rows:
        yield Table(headings, rows, left=headings[:2])
    yield from (f"{one.name}: no indices, as {one.why}" for one in found.outputs if one.why)
