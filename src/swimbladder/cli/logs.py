"""What the commands that read logs share: which rows of which file make a log, and its columns."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import NamedTuple

from swimbladder.errors import InputError

__all__ = ["Chosen", "chosen", "pair", "selections"]


class Chosen(NamedTuple):
    """A log: a file, and the rows of it that hold these values."""

    path: Path
    where: dict[str, str]

    @property
    def label(self) -> str:
        """The file's name and the selection."""
        rows = ", ".join(f"{name}={value}" for name, value in self.where.items())
        return f"{self.path.name} {rows}".rstrip()


def chosen(paths: list[Path], where: list[str]) -> list[Chosen]:
    """Return every selection of every file, in order.

    Raises InputError for a selection that is not NAME=VALUE.
    """
    return [Chosen(path, one) for path in paths for one in selections(where)]


def pair(text: str, option: str) -> tuple[str, str]:
    """Return NAME and VALUE of a text NAME=VALUE given to `option`.

    Raises InputError naming the option where it is none.
    """
    name, sign, value = text.partition("=")
    if not sign or not name.strip() or not value.strip():
        raise InputError(
            "not a pair", field=option, value=text, remedy=f"Write it as {option} NAME=VALUE"
        )
    return name.strip(), value.strip()


def selections(texts: list[str]) -> list[dict[str, str]]:
    """Return one selection of rows for each log: all combinations of the values given."""
    pairs = [pair(text, "--where") for text in texts]
    names = [name for name, _ in pairs]
    values = [[v.strip() for v in value.split(",") if v.strip()] for _, value in pairs]
    return [dict(zip(names, one, strict=True)) for one in product(*values)]
