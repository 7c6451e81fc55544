"""CSV with a header, every number in full double precision."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.io.files import write_through

__all__ = ["write_csv"]

_CHUNK = 20_000


def write_csv(
    path: str | Path,
    columns: Mapping[str, ArrayLike],
    *,
    advance: Callable[[float], None] | None = None,
) -> Path:
    """Write columns of equal length under their names; return the path.

    Numbers read back to the bit; NaN is written as ``nan``. `advance` is told how many rows were
    written since it was last called. Raises InputError where the file cannot be written.
    """
    series = [np.asarray(values, dtype=np.float64) for values in columns.values()]
    lengths = {len(values) for values in series}
    if len(lengths) != 1:
        raise ValueError(f"columns of different lengths: {sorted(lengths)}")

    def write(temporary: Path) -> None:
        rows = zip(*(map(repr, values.tolist()) for values in series), strict=True)
        with temporary.open("w", encoding="ascii", newline="") as file:
            file.write(",".join(columns) + "\n")
            while chunk := [",".join(row) for row in islice(rows, _CHUNK)]:
                file.write("\n".join(chunk) + "\n")
                if advance is not None:
                    advance(float(len(chunk)))

    return write_through(path, write)
