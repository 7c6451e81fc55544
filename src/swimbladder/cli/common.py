"""What the commands share: exit codes, JSON on stdout, notes and progress on stderr."""

from __future__ import annotations

import contextlib
import errno
import math
import os
import shutil
import signal
import sys
import threading
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console, ConsoleOptions, RenderableType
from rich.measure import Measurement
from rich.text import Text

from swimbladder.errors import InputError, SwimbladderError, as_asked
from swimbladder.io.answers import json_text
from swimbladder.io.progress import Advance, silent
from swimbladder.units import parse_quantity

if TYPE_CHECKING:
    from rich.table import Table

    from swimbladder.io.mission import Mission

_WIDE = 10_000  # columns: any table


class Output(Console):
    """A console that cuts nothing out of a table, whatever the width.

    A table is as wide as its longest words take, and in a pipe as its rows do; rich would end
    numbers in dots, and a pipe has no width but the 80 columns it takes then.
    """

    _least = 0

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as `Console` does."""
        tables = [found for found in objects if not isinstance(found, str)]
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

    def _width_of(self, table: RenderableType) -> int:
        least, most = Measurement.get(self, super().options.update(width=_WIDE), table)
        piped = not self.is_terminal and self._width is None  # COLUMNS of the environment gives one
        return most if piped else least

    def _keep_whole(self, found: object) -> None:
        """Let a table, in a margin or not, break lines in its words only, and cut nothing."""
        from rich.padding import Padding
        from rich.table import Table

        inner = found.renderable if isinstance(found, Padding) else found
        if isinstance(inner, Table):
            wide = super().options.update(width=_WIDE)
            for column in inner.columns:
                column.no_wrap = column.no_wrap or column.justify == "right"
                column.overflow = "fold"
                if column.no_wrap:
                    cells = (column.header, *column.cells)
                    column.min_width = max(Measurement.get(self, wide, c).maximum for c in cells)


# Notes, progress and errors.
console = Console(stderr=True, highlight=False)
# What was asked for, where it is not JSON.
output = Output(highlight=False, markup=False, emoji=False)


def show_answer(parts: Iterable[object], ends: Sequence[str] = (), *, full: bool = False) -> None:
    """Print what was asked for, its most important first: 15 lines at most, or all of it.

    ends: sentences that close it in any case. A table of which no row has room is left out.
    """
    blocks = [text_lines(part) for part in parts]
    kept, room = [line for block in blocks for line in block], _LINES - sum(map(_rows, ends))
    if not full and sum(map(_rows, kept)) > room:
        kept, every, room = [], len(kept), room - 1
        for block in blocks:
            until = list(accumulate(map(_rows, block), initial=0))  # rows, of the lines before
            taken = block[: bisect_right(until, room, lo=1) - 1]
            room = room - until[-1] if len(taken) == len(block) else 0
            kept += taken if room or len(taken) != _HEADING else []
        left = every - len(kept)
        ends = [f"... {left} line{'' if left == 1 else 's'} more: --full", *ends]
    for line in (*kept, *ends):
        output.print(Text.from_ansi(line), soft_wrap=True)


_LINES, _HEADING = 15, 1


def text_lines(part: object, paper: Output = output) -> list[str]:
    """Return the lines of a sentence, one however long it is, or of a table."""
    part = as_asked(part) if isinstance(part, str) else part
    with paper.capture() as printed:
        paper.print(part, soft_wrap=isinstance(part, str | Text))
    return [line.rstrip() for line in printed.get().splitlines()]


def _rows(line: str) -> int:
    """Return how many rows of the terminal a line takes; one where there is none."""
    return math.ceil(Text.from_ansi(line).cell_len / output.width) or 1 if output.is_terminal else 1


def aside(*sentences: str) -> None:
    """Print sentences on stderr, beside what was asked for."""
    for sentence in sentences:
        console.print(as_asked(sentence), markup=False, soft_wrap=True)


def labelled(label: str, sentences: Iterable[str]) -> list[str]:
    """Return sentences with what they are before each."""
    return [f"{label}: {sentence}" for sentence in sentences]


def severity(findings: Sequence[Any], kind: str) -> list[Text]:
    """Return the findings that are of one kind, warnings in yellow."""
    listed = labelled(kind, (as_asked(f.sentence) for f in findings if f.severity == kind))
    return [Text(line, style="bold yellow" if kind == "warning" else "") for line in listed]


def table(
    headings: Sequence[str],
    rows: Iterable[Iterable[str]],
    *,
    left: Collection[str] | None = None,
    **given: Any,
) -> Table:
    """Return a table without lines, whose columns of words stand to the left.

    left: their headings (the first, which has names: they are not broken). given: as
    `rich.table.Table` has it.
    """
    from rich.table import Table

    made = Table(**{"box": None, "pad_edge": False, "collapse_padding": True, **given})
    for heading in headings:
        words = heading in (headings[:1] if left is None else left)
        made.add_column(heading, justify="left" if words else "right", no_wrap=words and not left)
    for row in rows:
        made.add_row(*row)
    return made


# 128 and the number of the signal, as shells have it
_INTERRUPTED, _PIPE_CLOSED, _TERMINATED = 130, 141, 143
_stopped: list[int] = []  # signals that interrupted
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # of a stdout
_Usage = typer.BadParameter.__mro__[1]  # UsageError, of click or of typer's own copy of it


def stop_on_terminate() -> None:
    """Let SIGTERM end this process as Ctrl-C does, with the exit code 143."""

    def stop(number: int, _: object) -> None:
        _stopped.append(number)
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, stop)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not ignored, as by nohup
        signal.signal(signal.SIGINT, stop)


def run(function: Callable[[], object], *, json: bool = False) -> int:
    """Call `function` and return the exit code.

    A SwimbladderError becomes one paragraph on stderr and its own code, an interruption 130 (143
    by SIGTERM), a stdout that takes no more 2; any other exception is a defect and keeps its
    traceback. json: where `function` ends so and has not printed a JSON object, print one that says
    why.
    """
    from swimbladder.io.files import pipes_kept

    _printed.clear()
    _told.clear()
    try:
        with pipes_kept():  # an error looks up its line
            code, why = _run(function)
        if json and why and not _printed:
            emit_json({"error": "", "exit_code": code, "file": None, "field": None} | why)
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as error:
        if error.errno == errno.EPIPE:
            code = _PIPE_CLOSED
        elif error.errno not in _FULL or error.filename is not None:
            raise
        else:
            code, full = InputError.exit_code, f"cannot write the answer: {error.strerror}"
            _complain(InputError(full, field="stdout", remedy="Send it where there is room"))
        with contextlib.suppress(OSError, ValueError):  # what is left cannot be written at the end
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _complain(error: SwimbladderError) -> None:
    with contextlib.suppress(OSError):  # the exit code says it where stderr takes no more
        console.print("error: ", style="bold red", end="")
        console.print(str(error), markup=False, soft_wrap=True)


def _run(function: Callable[[], object]) -> tuple[int, dict[str, Any]]:
    """Return the exit code, and what a JSON object says of the error where there is one."""
    try:
        function()
    except SwimbladderError as error:
        _complain(error)
        place = {name: getattr(error, name, None) for name in ("file", "field")}
        return error.exit_code, {"error": str(error), **place}
    except KeyboardInterrupt:
        return _interrupted()
    except SystemExit as stop:
        why: Any = stop.__context__
        if getattr(why, "errno", None) == errno.EPIPE:
            return _PIPE_CLOSED, {}  # typer's code is 1, and that says no
        # the first is what typer makes of an interruption
        if stop.code == _INTERRUPTED or (_stopped and stop.code):
            return _interrupted()
        code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
        usage = isinstance(why, _Usage)
        if not usage:
            return code, {}
        param = getattr(why, "param", None)  # its box on stderr has been drawn
        field = max(param.opts, key=len) if param else getattr(why, "option_name", None)
        return code, {"error": why.format_message(), "field": field}
    except Exception:
        if not _stopped:
            raise
        return _interrupted()  # what a library has made of an interruption
    return 0, {}


def _interrupted() -> tuple[int, dict[str, Any]]:
    word, code = "interrupted", _INTERRUPTED
    if signal.SIGTERM in _stopped:
        word, code = "terminated", _TERMINATED
    console.print(word)
    return code, {"error": word}


@contextlib.contextmanager
def kept(folder: Path) -> Iterator[None]:
    """Say, where the block does not come to its end, what of its work is kept in `folder`.

    A folder in which nothing is goes away.
    """
    try:
        yield
    except BaseException:
        if any(path.is_file() for path in folder.rglob("*")):
            again = "the same command again goes on there; remove that folder to begin anew"
            aside(f"what is done so far is kept in {folder}: {again}")
        else:
            shutil.rmtree(folder, ignore_errors=True)
        raise


def quantity(text: str, unit: str, option: str) -> float:
    """Return the text given to `option`, a number or a number with a unit, as a float in `unit`.

    Raises InputError naming the option.
    """
    try:
        return parse_quantity(text, unit)
    except InputError as error:
        raise error.at(field=option) from None


@contextlib.contextmanager
def said_as_typed(options: Mapping[str, str], typed: Mapping[str, object]) -> Iterator[None]:
    """Name in errors of the block the options of parameters, and what was typed for a number.

    typed: by option.
    """
    try:
        yield
    except SwimbladderError as error:
        said = error.asked(options)
        if isinstance(said, InputError) and not isinstance(said.value, str):
            text = typed.get(said.field or "")
            said = said.but(value=text) if isinstance(text, str) else said
        raise said from None


@contextlib.contextmanager
def asked_of(path: Path, task: Mission, **typed: object) -> Iterator[None]:
    """Say in InputErrors of the block that the mission's file asks for it, unless it was typed."""
    from swimbladder.io.config import locate

    try:
        yield
    except InputError as error:
        field = (error.field or "-").split("[")[0].split(".")[0]
        own = hasattr(task, field) and typed.get(field) is None
        raise (locate(error, path) if own else error) from None


_printed: list[bool] = []  # whether the command has printed its JSON object


def emit_json(answer: Mapping[str, Any]) -> None:
    """Print one JSON object on stdout; NaN and infinities become null."""
    _printed.append(True)
    print(json_text(answer), file=sys.stdout)


@contextlib.contextmanager
def progress(
    description: str, total: float | None = None, *, after_s: float = 1.0
) -> Iterator[Advance]:
    """Show a progress bar on stderr while the block runs, once it has taken `after_s` [s].

    Yields ``advance(amount)``. Without a total the bar only says that work goes on; where
    stderr is no terminal nothing is drawn.
    """
    if not console.is_terminal:
        yield silent
        return
    from rich import progress as bars

    columns: list[Any] = [bars.TextColumn("{task.description}"), bars.BarColumn()]
    columns += [bars.TaskProgressColumn(), bars.TimeRemainingColumn()] if total else []
    bar = bars.Progress(*columns, bars.TimeElapsedColumn(), console=console, transient=True)
    task = bar.add_task(description, total=total)
    timer = threading.Timer(after_s, bar.start)
    timer.daemon = True
    timer.start()
    try:
        yield lambda amount: bar.advance(task, amount)
    finally:
        timer.cancel()
        timer.join()
        bar.stop()


_told: list[bool] = []  # whether it has been said that something is compiled


@contextlib.contextmanager
def compile_notice() -> Iterator[None]:
    """Say on stderr what is waited for when the simulator has to be compiled."""
    from swimbladder.sim.engine.cache import on_compile

    def notice() -> None:
        if not _told:
            _told.append(True)
            takes = "about 10 s for each law that is new to it, then it is kept"
            aside(f"compiling the simulator for this machine; {takes}")

    with on_compile(notice):
        yield


def typed_command() -> str:
    """Return the command line as it was typed, for a page that says how it was made."""
    import shlex

    return shlex.join(["swimbladder", *sys.argv[1:]])
