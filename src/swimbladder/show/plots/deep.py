"""Deep dives as a picture: as measured and as predicted by the model, and the imbalance."""

import numpy as np
from matplotlib.figure import Figure

from swimbladder.estimation.motion.deep import DeepIdentification
from swimbladder.show.plots.style import Ink, label_panels, styled

_DIVES = (Ink.BLUE, Ink.ORANGE, Ink.GREEN, Ink.PURPLE, Ink.SKY, Ink.VERMILION)
_DBAR = 1e4  # Pa


@styled
def draw_deep(found: DeepIdentification) -> Figure:
    """Return pressure over time of every dive, and the imbalance of its volumes over pressure."""
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    dives, imbalance = figure.subplots(2, 1)
    begin = 0.0
    for k, fits in enumerate(found.dives):
        color, hours = _DIVES[k % len(_DIVES)], (fits.dive.time - fits.dive.time[0]) / 3600.0
        first = k == 0
        dives.plot(
            begin + hours, fits.dive.pressure / _DBAR, ".", color=color, ms=3.0,
            label="measured" if first else None,
        )  # fmt: skip
        dives.plot(
            begin + (fits.replay.time - fits.dive.time[0]) / 3600.0, fits.replay.pressure / _DBAR,
            color=Ink.BLACK, lw=0.9, label="model from its first sample" if first else None,
        )  # fmt: skip
        imbalance.plot(
            fits.dive.pieces.pressure / _DBAR, 1e6 * fits.imbalance, ".", color=color, ms=3.0,
            label=fits.dive.name.rpartition("/")[2],
        )  # fmt: skip
        begin += float(hours[-1]) + 2.0
    dives.invert_yaxis()
    dives.set(xlabel="time [h], one dive after the other", ylabel="pressure [dbar]")
    # outside: there is a curve in every corner
    dives.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    limit = 1.1e6 * max(float(np.percentile(np.abs(t.imbalance), 99.5)) for t in found.dives)
    imbalance.axhline(0.0, color=Ink.BLACK, lw=0.8)
    imbalance.set(ylim=(-limit, limit), xlabel="pressure [dbar]", ylabel="volume imbalance [cm³]")
    imbalance.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=7.0, ncols=3,
                borderaxespad=0.2)  # fmt: skip
    label_panels([dives, imbalance])
    return figure
