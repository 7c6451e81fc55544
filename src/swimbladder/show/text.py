"""What an answer says as lines of text: of a terminal, a file, or a repr."""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from itertools import accumulate
from typing import Any

from rich.console import Console, ConsoleOptions
from rich.measure import Measurement
from rich.table import Table as RichTable
from rich.text import Text

from swimbladder.errors import as_asked
from swimbladder.show.parts import Drawn, Labelled, Part, Table

LINES = 15
_WIDE = 10_000  # columns: any table
_STYLES = {"no": "bold", "warning": "bold yellow"}


class Output(Console):
    """A console that cuts nothing out of a table, whatever the width.

    A table is as wide as its longest words take, and in a pipe as its rows do; rich would end
    numbers in dots, and a pipe has no width but the 80 columns it takes then.
    """

    _least = 0

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as `Console` does."""
        tables = [found for found in objects if isinstance(found, RichTable)]
        for found in tables:
            self._keep_whole(found)
        self._least = max(map(self._width_of, tables), default=0)
        try:
            super().print(*objects, **{"crop": False, **options})
        finally:
            self._least = 0

    @property
    def options(self) -> ConsoleOptions:
        """What is rendered with: at least as wide as the tables that are printed."""
        found = super().options
        return found.update(width=max(found.max_width, self._least))

    def _width_of(self, table: RichTable) -> int:
        least, most = Measurement.get(self, super().options.update(width=_WIDE), table)
        piped = not self.is_terminal and self._width is None  # COLUMNS of the environment gives one
        return most if piped else least

    def _keep_whole(self, table: RichTable) -> None:
        """Let a table break lines in its words only, and cut nothing."""
        wide = super().options.update(width=_WIDE)
        for column in table.columns:
            column.no_wrap = column.no_wrap or column.justify == "right"
            column.overflow = "fold"
            if column.no_wrap:
                cells = (column.header, *column.cells)
                column.min_width = max(Measurement.get(self, wide, c).maximum for c in cells)


def rich_table(table: Table) -> RichTable:
    """Return a table as rich prints it, without lines."""
    made = RichTable(box=None, pad_edge=False, collapse_padding=True)
    for number, heading in enumerate(table.headings):
        words, names = table.is_left(number), table.left is None
        made.add_column(heading, justify="left" if words else "right", no_wrap=words and names)
    for row in table.rows:
        made.add_row(*row)
    return made


def text_lines(part: Part, paper: Output) -> list[str]:
    """Return the lines of a part: a sentence is one however long it is, a figure has none."""
    if isinstance(part, Drawn):
        return []
    shown: RichTable | Text
    if isinstance(part, Table):
        shown = rich_table(part)
    else:
        label = part.label if isinstance(part, Labelled) else ""
        shown = Text(as_asked(str(part)), style=_STYLES.get(label, ""))
    with paper.capture() as printed:
        paper.print(shown, soft_wrap=not isinstance(shown, RichTable))
    lines = [line.rstrip() for line in printed.get().splitlines()]
    return [part.title, *lines] if isinstance(part, Table) and part.title else lines


def shortened(
    parts: Iterable[Part],
    lines_of: Callable[[Part], list[str]],
    *,
    room: int = LINES,
    rows: Callable[[str], int] = lambda _: 1,
    left: str = "... {} more: --full",
) -> list[str]:
    """Return the lines of parts, as many as have room, the most important first.

    rows: how many rows a line takes; left: how it is said that there are more. A table of which no
    row has room is left out.
    """
    parts = list(parts)
    blocks = [lines_of(part) for part in parts]
    every = [line for block in blocks for line in block]
    if sum(map(rows, every)) <= room:
        return every
    kept, room = list[str](), room - 1
    for part, block in zip(parts, blocks, strict=True):
        if isinstance(part, Table) and part.later:
            break
        until = list(accumulate(map(rows, block), initial=0))  # rows, of the lines before
        taken = block[: bisect_right(until, room, lo=1) - 1]
        room = room - until[-1] if len(taken) == len(block) else 0
        head = 1 + bool(part.title) if isinstance(part, Table) else 0
        kept += taken if room or len(taken) > head else []
    count = len(every) - len(kept)
    return [*kept, left.format(f"{count} line{'' if count == 1 else 's'}")]


def rows_of(line: str, paper: Output) -> int:
    """Return how many rows of the terminal a line takes; one where there is none."""
    if not paper.is_terminal:
        return 1
    return math.ceil(Text.from_ansi(line).cell_len / paper.width) or 1


def as_text(parts: Sequence[Part]) -> str:
    """Return all parts as a text file has them."""
    paper = Output(width=100, color_system=None, highlight=False, markup=False, emoji=False)
    return "".join(f"{line}\n" for part in parts for line in text_lines(part, paper))
