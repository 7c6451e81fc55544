"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from swimbladder.errors import InputError

__all__ = ["check_place", "make_folder", "publish", "write_atomically", "write_through"]


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


def check_place(out: Path) -> None:
    """Raise InputError where the folder could not be made."""
    if out.exists() and not out.is_dir():
        raise InputError(
            "there is a file of that name, where the folder should be",
            file=out, field="--out", remedy="Choose another folder with --out",
        )  # fmt: skip
    make_folder(out.parent)


def publish(out: Path, write: Callable[[Path], None]) -> None:
    """Let `write` fill a temporary folder, then put it, or its files, in the place of `out`.

    A new folder appears whole. In one that exists each file is replaced at once and whatever else
    is there stays. Raises InputError where that is not possible.
    """
    try:
        temporary = Path(tempfile.mkdtemp(dir=out.parent, prefix=f".{out.name}-"))
    except OSError as error:
        raise _refused(out, error) from error
    try:
        write(temporary)
        if out.exists():
            # the page last: it names the others
            files = sorted(p for p in temporary.rglob("*") if p.is_file())
            for path in sorted(files, key=lambda p: p.suffix == ".html"):
                target = out / path.relative_to(temporary)
                target.parent.mkdir(parents=True, exist_ok=True)
                path.replace(target)
        else:
            if os.name == "posix":  # mkdtemp makes it private; as mkdir would have made it
                mask = os.umask(0)
                os.umask(mask)
                temporary.chmod(0o777 & ~mask)
            temporary.rename(out)
    except OSError as error:
        raise _refused(out, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _refused(out: Path, error: OSError) -> InputError:
    return InputError(
        f"cannot write the files: {error.strerror or error}", file=out, field="--out",
        remedy="Choose a folder that can be written with --out",
    )  # fmt: skip
