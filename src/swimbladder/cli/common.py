"""What the commands share: exit codes, JSON on stdout, notes and progress on stderr."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.text import Text

from swimbladder.errors import OPTIONS, InputError, SwimbladderError, as_asked
from swimbladder.io.answers import json_text
from swimbladder.io.progress import Advance, silent
from swimbladder.show.parts import Part
from swimbladder.show.text import LINES, Output, rows_of, shortened, text_lines

if TYPE_CHECKING:
    from swimbladder.io.mission import Mission

# Notes, progress and errors.
console = Console(stderr=True, highlight=False)
# What was asked for, where it is not JSON.
output = Output(highlight=False, markup=False, emoji=False)


def show_answer(parts: Iterable[Part], ends: Sequence[str] = (), *, full: bool = False) -> None:
    """Print what was asked for, its most important first: 15 lines at most, or all of it.

    ends: sentences that close it in any case.
    """
    paper = output
    room = LINES - sum(rows_of(line, paper) for line in ends)
    lines = shortened(
        parts,
        lambda part: text_lines(part, paper),
        room=sys.maxsize if full else room,
        rows=lambda line: rows_of(line, paper),
    )
    for line in (*lines, *ends):
        output.print(Text.from_ansi(line), soft_wrap=True)


def aside(*sentences: str) -> None:
    """Print sentences on stderr, beside what was asked for."""
    for sentence in sentences:
        console.print(as_asked(sentence), markup=False, soft_wrap=True)


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


@contextlib.contextmanager
def said_as_typed(options: Mapping[str, str], typed: Mapping[str, object]) -> Iterator[None]:
    """Name in messages of the block the options of parameters, and what was typed for a number.

    typed: by option.
    """
    before = dict(OPTIONS)
    OPTIONS.update(options)
    try:
        yield
    except SwimbladderError as error:
        said = error.asked()
        if isinstance(said, InputError) and not isinstance(said.value, str):
            text = typed.get(said.field or "")
            said = said.but(value=text) if isinstance(text, str) else said
        raise said from None
    finally:
        OPTIONS.clear()
        OPTIONS.update(before)


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
        """Print the notice to stderr, once in the life of the process."""
        if not _told:
            _told.append(True)
            takes = "about 10 s for each law that is new to it, then it is kept"
            aside(f"compiling the simulator for this machine; {takes}")

    with on_compile(notice):
        yield


@contextlib.contextmanager
def working(doing: str, keep: Path | None = None) -> Iterator[Advance]:
    """Show how far the block is; say what is compiled, and what is kept of unfinished work.

    Yields ``advance(share)``. keep: the folder where that stays.
    """
    keeping = contextlib.nullcontext() if keep is None else kept(keep)
    with keeping, compile_notice(), progress(doing, 1.0) as advance:
        yield advance


def typed_command() -> str:
    """Return the command line as it was typed, for a page that says how it was made."""
    import shlex

    return shlex.join(["swimbladder", *sys.argv[1:]])
