"""Where the paper's text is wrong or silent, and what is done about it here: errata.toml."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import NamedTuple


class Erratum(NamedTuple):
    """A place in the paper, what stands there, and what is right."""

    where: str
    printed: str
    right: str


_LISTS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
ERRATA, SILENT = (tuple(Erratum(**one) for one in _LISTS[name]) for name in ("errata", "silent"))
