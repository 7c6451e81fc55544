"""Files that appear whole or not at all, tables as CSV, and files that are read to a limit.

What is not whole yet stands in a temporary file or folder whose name has the machine and the
process that write it. Where that process was killed, the next run in the same place removes it.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import os
import platform
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextvars import ContextVar
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TYPE_CHECKING

from swimbladder.errors import InputError, Parameter
from swimbladder.io.progress import Advance, silent

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_MARK = ".swimbladder-"
_OLD = 86_400.0  # s after which what another machine left is no longer being written
_LONGEST = 255 - len(".-unfinished")  # bytes of a folder's name
_PATIENCE = 5.0  # s, with a pipe that nobody writes into
_POLL = 0.01  # s
_Pipes = dict[tuple[int, int], bytes]  # content by device and inode
_pipes: ContextVar[_Pipes | None] = ContextVar("pipes", default=None)


@contextlib.contextmanager
def pipes_kept() -> Iterator[None]:
    """Keep what pipes give, which give it once, so that it can be read again within the block.

    Outside such blocks, as in a notebook, each reading of a pipe waits for what is written next.
    """
    kept = _pipes.get()
    token = _pipes.set({} if kept is None else kept)
    try:
        yield
    finally:
        _pipes.reset(token)


def read_at_most(path: Path, most: int) -> bytes:
    """Return the content of a file; of one that is larger `most` + 1 bytes, so that it shows.

    That holds for devices and pipes without an end too. Raises OSError and ValueError as `open`
    does, and TimeoutError for a pipe that nobody opens to write.
    """
    about, kept = path.stat(), _pipes.get()
    if os.name != "posix" or not stat.S_ISFIFO(about.st_mode):
        with path.open("rb") as file:
            return file.read(most + 1)
    pipe = about.st_dev, about.st_ino
    if kept is None or pipe not in kept:
        content = _read_pipe(path, most + 1)
        if kept is None:
            return content
        kept[pipe] = content
    return kept[pipe]


def _read_pipe(path: Path, most: int) -> bytes:
    """Return what is written into a pipe; raises TimeoutError where nobody comes to write."""
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as pipe:
        until = time.monotonic() + _PATIENCE
        # nothing: nobody has it open to write; None: somebody has, and has not written yet
        while (first := pipe.raw.read(1)) == b"":
            if time.monotonic() > until:
                raise TimeoutError(f"nothing was written into this pipe within {_PATIENCE:g} s")
            time.sleep(_POLL)
        os.set_blocking(pipe.fileno(), True)
        first = first or b""
        return first + pipe.read(most - len(first))


def there(path: Path) -> os.stat_result | None:
    """Return what is known of a file or folder; None where none is, or can be, of that name."""
    try:
        return path.stat()
    except (OSError, ValueError):
        return None


def file_there(path: Path) -> bool:
    """Say whether there is a file; that there is none where no file can have the name."""
    about = there(path)
    return about is not None and stat.S_ISREG(about.st_mode)


def why_unreadable(error: Exception, wanted: str) -> tuple[str, str]:
    """Return why a file cannot be read, and what to do; `wanted`: what it should be."""
    if isinstance(error, FileNotFoundError):
        return "there is no such file", "Check the path"
    if isinstance(error, IsADirectoryError):
        return "this is a folder", f"Give the {wanted} in it"
    if isinstance(error, TimeoutError):
        return str(error), "Start what writes into it, or check the path"
    return f"cannot read the file: {error}", "Check the path and its permissions"


def _prefix(process: int) -> str:
    """Return how the names begin of what a process of this machine has not finished."""
    machine = hashlib.sha256(platform.node().encode()).hexdigest()[:8]
    return f"{_MARK}{machine}-{process}-"


def temporary_folder(parent: Path) -> Path:
    """Make a folder that the next run in the same place removes where this process is killed."""
    remove_leftovers(parent)
    return Path(tempfile.mkdtemp(dir=parent, prefix=_prefix(os.getpid())))


def remove_leftovers(folder: Path) -> None:
    """Remove what runs that were killed left in a folder: of this machine, or a day old."""
    with contextlib.suppress(OSError):
        for path in folder.glob(f"{_MARK}*-*-*"):
            process = path.name.removeprefix(_MARK).split("-")[1]
            here = path.name.startswith(_prefix(int(process))) if process.isdecimal() else False
            with contextlib.suppress(OSError):
                old = time.time() - path.stat().st_mtime > _OLD
                if not (old or (here and not _alive(int(process)))):
                    continue
                if path.is_dir():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    path.unlink()


def _alive(process: int) -> bool:
    """Say whether a process of this machine runs; where that cannot be asked, that it does."""
    if os.name != "posix":  # there os.kill would end it
        return True
    try:
        os.kill(process, 0)
    except OSError as error:
        return not isinstance(error, ProcessLookupError)
    return True


def write_atomically(path: str | Path, content: bytes | str) -> Path:
    """Write `content` (text as UTF-8) to `path` and return it; an old file stays until then.

    Raises InputError where the file cannot be written.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    return write_through(path, lambda temporary: Path(temporary).write_bytes(data))


def write_through(path: str | Path, write: Callable[[Path], object]) -> Path:
    """Let `write` fill a temporary file beside `path`, then put it in its place.

    For writers that want a name (matplotlib, netCDF); the temporary name keeps the suffix.
    Raises InputError where the file cannot be written.
    """
    target, prefix = Path(path), _prefix(os.getpid())
    _check_kind(target, "output")
    try:
        with contextlib.ExitStack() as stack:
            handle, name = tempfile.mkstemp(target.suffix, prefix, target.parent)
            os.close(handle)
            temporary = Path(name)
            stack.callback(temporary.unlink, missing_ok=True)
            write(temporary)
            _publish_mode(temporary, 0o666)  # as open() would have made it
            temporary.replace(target)
    except OSError as error:
        what = f"cannot write the file: {error.strerror or error}"
        remedy = "Choose a place that exists and can be written"
        raise InputError(what, file=target, field="output", remedy=remedy) from error
    return target


def _check_kind(path: Path, field: str) -> None:
    """Raise InputError where a device, pipe or socket has the name: a file would take its place."""
    about = there(path)
    if about is not None and not (stat.S_ISREG(about.st_mode) or stat.S_ISDIR(about.st_mode)):
        what, remedy = "there is a device, a pipe or a socket of that name", "Choose another name"
        raise InputError(what, file=path, field=field, remedy=remedy)


def _publish_mode(path: Path, mode: int) -> None:
    """Let others at a temporary file or folder, which was made private, as the user's mask says."""
    if os.name == "posix":
        mask = os.umask(0)
        os.umask(mask)
        path.chmod(mode & ~mask)


def make_folder(path: str | Path) -> Path:
    """Make a folder, and those above it, where they do not exist; return it.

    What killed runs left in it is removed. Raises InputError where it cannot be made.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        what = f"cannot make the folder: {getattr(error, 'strerror', None) or error}"
        remedy = "Choose another folder with `out=`"
        raise InputError(what, file=folder, field=Parameter("out"), remedy=remedy) from error
    remove_leftovers(folder)
    return folder


def check_place(out: Path) -> None:
    """Raise InputError where the folder could not be made, or a file is what was meant."""
    what, remedy = "", "Choose another folder with `out=`"
    if len(os.fsencode(out.name)) > _LONGEST:
        what = f"the name is longer than {_LONGEST} bytes"
        remedy = "Choose a shorter name with `out=`"
    elif out.suffix in _OF_FILES and not out.exists():
        what = f"several files are written, into a folder, and {out.suffix} ends a file's name"
        remedy = (
            f"Name a folder, like {out.with_suffix('')}; the files in it have names of their own"
        )
    else:
        make_folder(out.parent)
        if out.is_dir():
            remove_leftovers(out)
        elif out.exists():
            what = "there is a file of that name, where the folder should be"
    if what:
        raise InputError(what, file=out, field=Parameter("out"), remedy=remedy)


_OF_FILES = (".toml", ".csv", ".json", ".nc", ".html", ".png", ".txt", ".c", ".h", ".ino", ".zip")


def unfinished(out: Path) -> Path:
    """Return the folder beside `out` where work is kept until it is whole."""
    return out.parent / f".{out.name}-unfinished"


def publish(out: Path, write: Callable[[Path], None]) -> None:
    """Let `write` fill a temporary folder, then put it, or its files, in the place of `out`.

    A new folder appears whole. In one that exists each file is replaced at once and whatever else
    is there stays. Raises InputError where that is not possible.
    """
    try:
        with contextlib.ExitStack() as stack:
            temporary = temporary_folder(out.parent)
            stack.callback(shutil.rmtree, temporary, ignore_errors=True)
            write(temporary)
            if out.exists():
                # the page last: it names the others
                files = sorted(p for p in temporary.rglob("*") if p.is_file())
                files.sort(key=lambda p: p.suffix == ".html")
                targets = [out / path.relative_to(temporary) for path in files]
                for target in targets:
                    _check_kind(target, Parameter("out"))
                for path, target in zip(files, targets, strict=True):
                    target.parent.mkdir(parents=True, exist_ok=True)
                    path.replace(target)
            else:
                _publish_mode(temporary, 0o777)  # as mkdir would have made it
                temporary.rename(out)
    except OSError as error:
        what = f"cannot write the files: {error.strerror or error}"
        remedy = "Choose a folder that can be written with `out=`"
        raise InputError(what, file=out, field=Parameter("out"), remedy=remedy) from error


def shipped(package: str) -> dict[str, Traversable]:
    """Return the TOML files of a package by name, sorted."""
    files = (file for file in resources.files(package).iterdir() if file.name.endswith(".toml"))
    return dict(sorted((file.name.removesuffix(".toml"), file) for file in files))


def source_hash(paths: Iterable[Path]) -> str:
    """Return a hash of source files: of their names and what is in them."""
    digest = hashlib.sha256()
    try:
        for path in sorted(paths):
            digest.update(path.name.encode() + path.read_bytes())
    except OSError:  # inside an archive: the version has to do
        digest.update(b"no source")
    return digest.hexdigest()[:16]


def rows_csv(names: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return rows of words and numbers as CSV under their names; None is nan."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(("nan" if x is None else x for x in row) for row in rows)
    return text.getvalue()


_CHUNK = 20_000


def write_csv(
    path: str | Path, columns: Mapping[str, ArrayLike], *, advance: Advance = silent
) -> Path:
    """Write columns of equal length under their names; return the path.

    Numbers read back to the bit; NaN is written as ``nan``. `advance` is given how many rows were
    written since it was last called. Raises InputError where the file cannot be written.
    """
    import numpy as np

    series = [np.asarray(values, dtype=np.float64) for values in columns.values()]
    lengths = {len(values) for values in series}
    if len(lengths) != 1:
        raise ValueError(f"columns of different lengths: {sorted(lengths)}")

    (length,) = lengths

    def write(temporary: Path) -> None:
        """Write heading and rows, a chunk at a time; numbers so that they read back exactly."""
        with temporary.open("w", encoding="ascii", newline="") as file:
            file.write(",".join(columns) + "\n")
            for start in range(0, length, _CHUNK):
                chunk = [map(repr, values[start : start + _CHUNK].tolist()) for values in series]
                rows = [",".join(row) for row in zip(*chunk, strict=True)]
                file.write("\n".join(rows) + "\n")
                advance(float(len(rows)))

    return write_through(path, write)
