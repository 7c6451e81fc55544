"""A firmware as it is shown: its golden trace, and how a board flew it."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from swimbladder.codegen.board import BoardAnswer
from swimbladder.codegen.library import Library, write_library
from swimbladder.show.parts import Drawn, Part, Shown
from swimbladder.show.style import Ink, depth_axis, label_panels, setpoint, stacked, styled

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


class LibraryShown(Shown[Library]):
    """The law, its golden trace, and what is to be done."""

    name, alone = "firmware", True

    def parts(self) -> Iterator[Part]:
        """Give the sentences, and the golden trace."""
        yield from self.found.sentences
        yield Drawn("golden", partial(draw_golden, self.found))

    def table(self) -> dict[str, Any]:
        """Return the golden trace: what the law sees and says at each tick."""
        golden, command = self.found.golden, self.found.law.command
        unit = {"voltage": "V", "volume": "m3", "volume change": "s"}[command]
        columns = {"depth_m": golden.depth, "volume_m3": golden.volume}
        columns |= {"reference_m": golden.reference, f"command_{unit}": golden.command}
        time = self.found.tick_s * np.arange(len(golden.depth))
        return {"time_s": time, **{key: np.asarray(x, np.float64) for key, x in columns.items()}}

    def before(self, out: Path) -> list[Path]:
        """Write the library."""
        return write_library(self.found, out)


class BoardAnswerShown(Shown[BoardAnswer]):
    """How each flight went, the board's times, the line's frames."""

    name, kind = "board", "hardware in the loop"

    def parts(self) -> Iterator[Part]:
        """Give the sentences."""
        yield from self.found.sentences

    @property
    def why(self) -> list[str]:
        """How each flight went."""
        return [flight.sentence for flight in self.found.flights]
