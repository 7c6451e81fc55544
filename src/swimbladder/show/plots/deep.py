"""Deep dives as a picture: as measured and as predicted by the model, and the imbalance."""

from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from swimbladder.estimation.motion.deep import DeepIdentification
from swimbladder.show.plots import style
from swimbladder.show.plots.style import Ink

_DIVES = (Ink.BLUE, Ink.ORANGE, Ink.GREEN, Ink.PURPLE, Ink.SKY, Ink.VERMILION)
_DBAR = 1e4  # Pa


@style.styled
def draw_deep(found: DeepIdentification) -> Figure:
    """Return pressure over time of every dive, and the imbalance of its volumes over pressure."""
    figure, (dives, imbalance) = style.new_figure((9.0, 7.0), 2)
    begin = 0.0
    for dive, color in zip(found.dives, cycle(_DIVES), strict=False):
        start, replay, pieces = dive.dive.time[0] - 3600.0 * begin, dive.replay, dive.dive.pieces
        hours, pressure = (dive.dive.time - start) / 3600.0, dive.dive.pressure / _DBAR
        dives.plot(hours, pressure, ".", color=color, ms=3.0, label="measured")
        again = (replay.time - start) / 3600.0, replay.pressure / _DBAR
        dives.plot(*again, color=Ink.BLACK, lw=0.9, label="model from its first sample")
        name = dive.dive.name.rpartition("/")[2]
        off = pieces.pressure / _DBAR, 1e6 * dive.imbalance
        imbalance.plot(*off, ".", color=color, ms=3.0, label=name)
        begin = float(hours[-1]) + 2.0
    style.depth_axis(dives, "pressure [dbar]")
    dives.set_xlabel("time [h], one dive after the other")
    limit = 1.1e6 * max(float(np.percentile(np.abs(t.imbalance), 99.5)) for t in found.dives)
    imbalance.axhline(0.0, color=Ink.BLACK, lw=0.8)
    imbalance.set(ylim=(-limit, limit), xlabel="pressure [dbar]", ylabel="volume imbalance [cm³]")
    for axes, how in ((dives, {}), (imbalance, {"fontsize": 7.0, "ncols": 3})):
        # outside: there is a curve in every corner
        style.legend_above(axes, bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2, **how)
    style.label_panels([dives, imbalance])
    return figure
