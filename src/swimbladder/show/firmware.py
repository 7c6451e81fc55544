"""A firmware as it is shown: its golden trace, what it watches, what it takes of a board."""

import hashlib
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from swimbladder.codegen.board import BoardAnswer
from swimbladder.codegen.golden import BoardProgram
from swimbladder.codegen.library import Library, meanings, write_library
from swimbladder.control.supervisor import Reason
from swimbladder.physics.arrays import Array
from swimbladder.show.html import TEXTS
from swimbladder.show.parts import Drawn, Part, Shown, Table
from swimbladder.show.picture import Ink, Picture, stacked
from swimbladder.units import rounded

_COMMANDS = {
    "voltage": ("voltage [V]", 1.0),
    "volume": ("volume asked for [cm³]", 1e6),
    "volume change": ("runs, out positive [s]", 1.0),
}


_UNO = {"flash": 32256, "RAM": 2048, "clock": 16e6}  # B, B, Hz


def draw_golden(made: Library) -> Picture:
    """Return depth, command and supervisor of the golden trace, at each tick.

    To the last tick that a board checks: at the end its sensors fail.
    """
    depth, _, asked, command, reason = np.array(made.golden.checked, np.float64).T
    time = np.asarray(made.tick_s * np.arange(len(asked)), np.float64)
    picture = _draw(made, time, depth, asked, command, reason)
    out = np.arange(len(time)) >= len(made.golden.depth)
    picture.panels[0].shade(time, out, "sensors fail")
    return picture


def draw_flight(made: BoardProgram, log: Path) -> Picture:
    """Return depth, command and supervisor of a flight on a board, by its log."""
    rows = np.atleast_1d(np.genfromtxt(log, delimiter=",", names=True))
    names = ("time_s", "depth_m", "reference_depth_m", made.facts["column"], "supervisor_reason")
    picture = _draw(made, *(rows[name] for name in names))
    twin = _COMMANDS[made.law.command][1] * rows[f"twin_{made.facts['column']}"]
    picture.panels[1].steps(rows["time_s"], twin, Ink.BLACK, "twin", dash=":", width=1.0)
    return picture


def _draw(
    made: BoardProgram, time: Array, depth: Array, asked: Array, command: Array, reason: Array
) -> Picture:
    picture, (upper, middle, lower) = stacked((7.5, 5.8), 2.2, 1.0, 0.8, letters=True)
    upper.setpoint(time, asked)
    upper.line(time, depth, label="measured", width=1.1)
    words, factor = _COMMANDS[made.law.command]
    middle.steps(time, factor * command, Ink.ORANGE, "command")
    lower.steps(time, reason, Ink.VERMILION)
    upper.y, middle.y, lower.x = "depth [m]", words, "time [s]"
    found = [int(one) for one in np.unique(reason)]
    lower.yticks = {one: Reason(one).words if one else "watches" for one in found}
    lower.ylim = (-0.5, max(found) + 0.5)
    return picture


class LibraryShown(Shown[Library]):
    """The law, its golden trace, what is watched, what it takes of a board, and its files."""

    name, folder = "firmware", "extras/"

    @property
    def title(self) -> str:
        """The vehicle and its law."""
        return f"{self.found.vehicle.name}: firmware, law {self.found.law.name}"

    def parts(self) -> Iterator[Part]:
        """Give the sentences, the golden trace, and what stands in README.md and the sources."""
        made = self.found
        yield from made.sentences
        yield Drawn("golden", partial(draw_golden, made))
        watched = [(str(n), *words) for n, *words in meanings(made.supervisor)]
        heads = ("", "reason", "brings the vehicle up when", "after")
        yield Table(heads, watched, left=heads, title="What the supervisor watches", later=True)
        yield from self._board()
        own = made.to_dict()["parameters"].items()
        rows = [(name, rounded(one["value"], 7), one["unit"]) for name, one in own]
        law = f"The law {made.law.name}, in float32"
        yield Table(
            ("parameter", "value", "unit"), rows, left=("parameter", "unit"), title=law, later=True
        )
        sizes = [
            (name, str(len(text)), hashlib.sha256(text.encode()).hexdigest()[:16])
            for name, text in made.files.items()
            if name.startswith("src/")
        ]
        yield Table(("C", "bytes", "SHA-256, its first half"), sizes, title="Sources", later=True)

    def _board(self) -> Iterator[Part]:
        """Give what law and supervisor take of an Uno, where it was measured."""
        made = self.found
        measured = TEXTS["boards"].get(made.law.name)
        if measured is None:
            return
        flash, variables, stack, cycles, deepest, most = measured
        took, bound = (f"{1e3 * n / _UNO['clock']:.3g} ms" for n in (cycles, most))
        ram, ram_bound = (f"{variables} B + {depth} B of stack" for depth in (stack, deepest))
        rows = [
            ("flash", f"{flash} B", "", f"{_UNO['flash']} B"),
            ("RAM", ram, ram_bound, f"{_UNO['RAM']} B"),
            ("time of a tick", took, bound, f"{1e3 * made.tick_s:.4g} ms"),
        ]
        title = "What law and supervisor take of an Uno (ATmega328P)"
        heads = ("", "measured on a simulated chip", "bound for any numbers", "there is")
        yield Table(heads, rows, title=title, later=True)
        yield "Arduino's start-up, Serial and the sensor's library come on top."

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
    """How each flight went, the board's times, the line's frames, and what each flight saw."""

    name, kind = "board", "hardware in the loop"

    def parts(self) -> Iterator[Part]:
        """Give the sentences, and the flights."""
        yield from self.found.sentences
        for flight in self.found.flights:
            if flight.ticks and flight.log.is_file():
                name = flight.name.replace(" ", "-")
                draw = partial(draw_flight, self.found.made, flight.log)
                yield Drawn(name, draw, "flight", f": {flight.name}")

    @property
    def why(self) -> list[str]:
        """How each flight went."""
        return [flight.sentence for flight in self.found.flights]
