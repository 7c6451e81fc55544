"""A campaign as it is shown: its floats' numbers, and which inputs its outcome comes from."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from swimbladder.show.parts import Drawn, Part, Shown, Table
from swimbladder.show.picture import Ink, Picture, grid_of
from swimbladder.sim.campaign.result import Campaign, Sensitivity

_HIGH = 0.36  # of a bar


def draw_campaign(found: Campaign) -> Picture:
    """Return how the numbers of the floats are distributed, a panel for each that differs."""
    shown = [one for one in found.numbers() if np.ptp(one[2]) > 0.0] or found.numbers()
    size, title = (9.6, 0.8 + 2.4 * -(-len(shown) // 3)), f"{found.sentence}\ndashed: median"
    picture, panels = grid_of(size, len(shown), 3, title=title, letters=True)
    for panel, (words, unit, values) in zip(panels, shown, strict=True):
        panel.histogram(values, "auto" if np.ptp(values) > 0.0 else 1, Ink.BLUE)
        panel.rule("x", np.median(values), Ink.BLACK, width=1.0, dash="--")
        panel.x, panel.y, panel.counts = f"{words} [{unit or '-'}]", "floats [-]", "y"
    return picture


def draw_sensitivity(found: Sensitivity) -> Picture:
    """Return the indices of each output that has them, with their intervals, a panel each."""
    names = found.design.names
    shown = [one for one in found.outputs if one.indices]
    columns = min(max(len(shown), 1), 3)
    lines = -(-max(len(shown), 1) // columns)
    size = (1.2 + 2.9 * columns, 1.3 + lines * (0.7 + 0.42 * len(names)))
    title = f"Sobol indices of {found.design.floats} floats; lines: 95 % intervals"
    how: Any = {"sharey": "all", "title": title, "letters": bool(shown), "legend": "below"}
    picture, panels = grid_of(size, max(len(shown), 1), columns, **how)
    rows = np.arange(len(names))[::-1]
    for panel, one in zip(panels, shown, strict=False):
        first, total = (Ink.BLUE, "first order"), (Ink.SKY, "total")
        for kind, low, (color, label) in (("first", 0.0, first), ("total", -_HIGH, total)):
            value = np.array([getattr(index, kind) for index in one.indices])
            ends = np.array([getattr(index, f"{kind}_ci95") for index in one.indices])
            at = rows + low + 0.5 * _HIGH
            panel.bars(at, value, color, label, thick=_HIGH, flat=True)
            panel.between(at, ends[:, 0], ends[:, 1], Ink.BLACK, width=1.0, flat=True)
        panel.rule("x", 0.0, Ink.BLACK, width=0.6)
        panel.title, panel.grid, panel.x = f"{one.name}\n", "x", "share of the variance [-]"
    limits = [panel.limits("x") for panel in panels]
    for panel in panels:
        panel.yticks = dict(zip(rows.tolist(), names, strict=True))
        panel.xlim = (min(-0.05, *(x for x, _ in limits)), max(1.05, *(x for _, x in limits)))
    return picture


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
