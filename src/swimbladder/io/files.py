"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from swimbladder.errors import InputError

__all__ = ["make_folder", "write_atomically", "write_through"]


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
    target = Path(path)
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(
            dir=target.parent, prefix=f".{target.stem}-", suffix=target.suffix
        )
        os.close(handle)
        temporary = Path(name)
        write(temporary)
        if os.name == "posix":  # mkstemp makes it private; give it what open() would have given
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask)
        temporary.replace(target)
    except OSError as error:
        raise InputError(
            f"cannot write the file: {error.strerror or error}",
            file=target,
            field="output",
            remedy="Choose a place that exists and can be written",
        ) from error
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                temporary.unlink()
    return target


def make_folder(path: str | Path) -> Path:
    """Make a folder, and those above it, where they do not exist; return it.

    Raises InputError where that is not possible.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot make the folder: {error.strerror or error}",
            file=folder,
            field="--out",
            remedy="Choose another folder with --out",
        ) from error
    return folder
