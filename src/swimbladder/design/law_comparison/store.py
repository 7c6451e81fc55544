"""What has been computed already, kept on disk part by part, so that a stopped bench goes on."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any

import swimbladder
from swimbladder.io.files import make_folder, write_atomically
from swimbladder.vehicle import Vehicle

__all__ = ["Store"]

_SHOWN = ("cli", "show")  # parts of the package that compute nothing


class Store:
    """A folder of answers, each under a name made of what was asked and of the software's source.

    Without a folder nothing is kept.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder

    def read(self, *inputs: Any) -> dict[str, Any] | None:
        """Return the answer kept for these inputs; None where there is none that can be read."""
        if self.folder is None:
            return None
        try:
            found = json.loads(self._path(inputs).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return found if isinstance(found, dict) else None

    def write(self, answer: dict[str, Any], *inputs: Any) -> None:
        """Keep an answer; not-a-number and infinities are kept as such."""
        if self.folder is not None:
            make_folder(self.folder)
            write_atomically(self._path(inputs), json.dumps(answer))

    def _path(self, inputs: tuple[Any, ...]) -> Path:
        assert self.folder is not None
        text = json.dumps([_plain(value) for value in inputs])
        name = hashlib.sha256(f"{_source()} {text}".encode()).hexdigest()[:20]
        return self.folder / f"{inputs[0]}-{name}.json"


def _plain(value: Any) -> Any:
    if isinstance(value, Vehicle):
        return value.model_dump_json(exclude={"provenance", "description"})
    return value._asdict() if hasattr(value, "_asdict") else value


@cache
def _source() -> str:
    """Return a name for all source that computes: an edited package computes anew."""
    package = Path(swimbladder.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        if path.relative_to(package).parts[0] not in _SHOWN:
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()
