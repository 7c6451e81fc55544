"""Deep dives as a picture: as measured and as told by the model, and what the book is off by."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from swimbladder.estimation.motion.deep import DeepIdentification
from swimbladder.show.plots.style import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    label_panels,
    styled,
)

__all__ = ["draw_deep"]

_DIVES = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION)
_DBAR = 1e4  # Pa


@styled
def draw_deep(found: DeepIdentification) -> Figure:
    """Return pressure over time of every dive, and its book of volumes over pressure."""
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    dives, book = figure.subplots(2, 1)
    begin = 0.0
    for k, told in enumerate(found.dives):
        colour, hours = _DIVES[k % len(_DIVES)], (told.dive.time - told.dive.time[0]) / 3600.0
        first = k == 0
        dives.plot(
            begin + hours, told.dive.pressure / _DBAR, ".", color=colour, ms=3.0,
            label="measured" if first else None,
        )  # fmt: skip
        dives.plot(
            begin + (told.replay.time - told.dive.time[0]) / 3600.0, told.replay.pressure / _DBAR,
            color=BLACK, lw=0.9, label="model from its first sample" if first else None,
        )  # fmt: skip
        book.plot(
            told.dive.pieces.pressure / _DBAR, 1e6 * told.book, ".", color=colour, ms=3.0,
            label=told.dive.name.rpartition("/")[2],
        )  # fmt: skip
        begin += float(hours[-1]) + 2.0
    dives.invert_yaxis()
    dives.set_xlabel("time [h], one dive after the other")
    dives.set_ylabel("pressure [dbar]")
    # outside: there is a curve in every corner
    dives.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    limit = 1.1e6 * max(float(np.percentile(np.abs(t.book), 99.5)) for t in found.dives)
    book.axhline(0.0, color=BLACK, lw=0.8)
    book.set_ylim(-limit, limit)
    book.set_xlabel("pressure [dbar]")
    book.set_ylabel("book of volumes off by [cm³]")
    book.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=7.0, ncols=3,
                borderaxespad=0.2)  # fmt: skip
    label_panels([dives, book])
    return figure
