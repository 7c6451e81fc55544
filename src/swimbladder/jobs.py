"""Long work in chunks: on all cores, kept on disk in case of a kill, by a hash of what was asked.

What a chunk gave is kept under a hash of the question and of the source that computes, so that a
run that was killed goes on, and an edited package computes anew.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, TypeVar
from zipfile import BadZipFile

import numpy as np
from pydantic import BaseModel

from swimbladder.io.files import make_folder, source_hash, write_through

__all__ = ["Store", "each", "identity", "software"]

Item = TypeVar("Item")
Answer = TypeVar("Answer")

_PACKAGE = Path(__file__).resolve().parent
_SHOWN = ("cli", "show")  # parts of the package that compute nothing
_REMARKS = {"provenance", "description"}  # of a vehicle: nothing depends on them


@cache
def software() -> str:
    """Return a hash of all source of this package that computes."""
    return source_hash(
        path for path in _PACKAGE.rglob("*.py") if path.relative_to(_PACKAGE).parts[0] not in _SHOWN
    )


def identity(*values: Any) -> str:
    """Return a hash of values: the same for the same in every process, another for others.

    Of numbers, strings, arrays, records, tables of settings (pydantic) and what they are nested in;
    raises TypeError for what has no value that can be read.
    """
    digest = hashlib.sha256()
    _feed(digest, values)
    return digest.hexdigest()[:20]


def _feed(digest: Any, value: Any) -> None:
    digest.update(f"{type(value).__name__}(".encode())
    if value is None or isinstance(value, bool | int | float | complex | str | bytes | Enum | Path):
        digest.update(repr(value).encode())
    elif isinstance(value, np.ndarray | np.generic):
        digest.update(f"{value.dtype.str} {value.shape} ".encode() + value.tobytes())
    elif isinstance(value, BaseModel):
        digest.update(value.model_dump_json(exclude=_REMARKS).encode())
    elif isinstance(value, Mapping):
        for key in sorted(value):
            _feed(digest, (key, value[key]))
    elif isinstance(value, tuple | list):
        for item in value:
            _feed(digest, item)
    elif is_dataclass(value):
        for field in fields(value):
            _feed(digest, getattr(value, field.name))
    else:
        raise TypeError(f"{type(value).__name__} has no place in a question")
    digest.update(b")")


class Store:
    """A folder of answers, each in a file of its own that appears whole or not at all.

    An answer is found by what was asked, by what the whole store is about, and by `software`. It
    is an array, a mapping of arrays, or what JSON has. Without a folder nothing is kept.
    """

    def __init__(self, folder: Path | None, *about: Any) -> None:
        self.folder = folder
        self._about = about

    def read(self, *asked: Any) -> Any:
        """Return the answer that is kept; None where there is none, or none that can be read."""
        if self.folder is None:
            return None
        stem = self._stem(asked)
        try:
            for suffix in (".npy", ".npz", ".json"):
                path = stem.with_name(stem.name + suffix)
                if path.exists():
                    if suffix == ".json":
                        return json.loads(path.read_text(encoding="utf-8"))
                    with path.open("rb") as file:
                        found = np.load(file)
                        return found if suffix == ".npy" else dict(found)
        except (OSError, ValueError, EOFError, BadZipFile):
            pass  # spoilt: it is computed anew
        return None

    def write(self, answer: Any, *asked: Any) -> None:
        """Keep an answer; raises InputError where it cannot be written."""
        if self.folder is None:
            return
        make_folder(self.folder)
        stem = self._stem(asked)
        if isinstance(answer, np.ndarray):
            write_through(stem.with_name(stem.name + ".npy"), lambda at: np.save(at, answer))
        elif isinstance(answer, Mapping) and all(
            isinstance(part, np.ndarray) for part in answer.values()
        ):
            write_through(stem.with_name(stem.name + ".npz"), lambda at: np.savez(at, **answer))
        else:
            text = json.dumps(answer)
            path = stem.with_name(stem.name + ".json")
            write_through(path, lambda at: at.write_text(text, encoding="utf-8"))

    def get(self, compute: Callable[[], Answer], *asked: Any) -> Answer:
        """Return the answer that is kept, or compute and keep it; tuples may return as lists."""
        found: Answer | None = self.read(*asked)
        if found is None:
            found = compute()
            self.write(found, *asked)
        return found

    def forget(self) -> None:
        """Remove the folder."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)

    def _stem(self, asked: tuple[Any, ...]) -> Path:
        assert self.folder is not None
        return self.folder / f"{asked[0]}-{identity(software(), self._about, asked)}"


def each(
    work: Callable[[Item], Answer], items: Iterable[Item], *, workers: int | None = None
) -> Iterator[tuple[Item, Answer]]:
    """Yield (item, its answer) as they come, on all cores by threads: kernels let others run.

    Few wait at a time, so that there may be any number. After an error no other is begun.
    """
    count = workers or os.cpu_count() or 1
    left, waiting = iter(items), dict[Future[Answer], Item]()
    with ThreadPoolExecutor(count) as pool:
        try:
            while True:
                for item in left:
                    waiting[pool.submit(work, item)] = item
                    if len(waiting) == 2 * count:
                        break
                if not waiting:
                    return
                done, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    yield waiting.pop(future), future.result()
        finally:
            for future in waiting:
                future.cancel()
