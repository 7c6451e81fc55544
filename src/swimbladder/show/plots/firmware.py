"""The golden trace of a firmware, as a picture."""

import numpy as np
from matplotlib.figure import Figure

from swimbladder.codegen.library import Library
from swimbladder.show.plots.style import Ink, depth_axis, label_panels, setpoint, stacked, styled

_COMMANDS = {
    "voltage": ("voltage [V]", 1.0),
    "volume": ("volume asked for [cm³]", 1e6),
    "volume change": ("runs, out positive [s]", 1.0),
}


@styled
def draw_golden(made: Library) -> Figure:
    """Return depth and command of the golden trace, at each tick."""
    golden = made.golden
    reference = np.asarray(golden.reference, np.float64)
    time = np.asarray(made.tick_s * np.arange(len(golden.depth)), np.float64)
    figure, (depth, command) = stacked((7.0, 4.8), 2.0, 1.0)
    setpoint(depth, time, reference)
    depth.plot(time, golden.depth, color=Ink.BLUE, lw=1.1, label="measured")
    depth_axis(depth)
    depth.legend(loc="best")
    words, factor = _COMMANDS[made.law.command]
    command.step(time, factor * np.asarray(golden.command, float), where="post", color=Ink.ORANGE)
    command.set_ylabel(words)
    command.set_xlabel("time [s]")
    label_panels([depth, command])
    return figure
