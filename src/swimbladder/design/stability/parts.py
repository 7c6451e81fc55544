"""Parts of a long job, kept on disk until it is done: after a kill they need not be done again."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from swimbladder.io.files import make_folder, write_atomically

__all__ = ["Parts"]


class Parts:
    """Answers, by what was asked; without a folder nothing is kept."""

    def __init__(self, folder: Path | None, *about: Any) -> None:
        self._folder = folder
        self._about = repr(about)

    def get(self, asked: Any, compute: Callable[[], Any]) -> Any:
        """Return the answer that is kept for `asked`, or compute and keep it; both as JSON has it.

        Raises InputError where it cannot be written.
        """
        if self._folder is None:
            return json.loads(json.dumps(compute()))
        name = hashlib.sha256(f"{self._about} {asked!r}".encode()).hexdigest()[:24]
        path = self._folder / f"{name}.json"
        if path.exists():
            try:
                return json.loads(path.read_text(encoding="utf-8"))
            except ValueError:
                pass  # not ours, or spoilt: compute it anew
        answer = json.dumps(compute())
        make_folder(self._folder)
        write_atomically(path, answer)
        return json.loads(answer)

    def forget(self) -> None:
        """Remove what was kept."""
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
