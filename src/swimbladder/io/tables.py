"""CSV with a header, every number in full double precision."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.io.files import write_through

_CHUNK = 20_000


def write_csv(
    path: str | Path,
    columns: Mapping[str, ArrayLike],
    *,
    advance: Callable[[float], None] | None = None,
) -> Path:
    """Write columns of equal length under their names; return the path.

    Numbers read back to the bit; NaN is written as ``nan``. `advance` is given how many rows were
    written since it was last called. Raises InputError where the file cannot be written.
    """
    series = [np.asarray(values, dtype=np.float64) for values in columns.values()]
    lengths = {len(values) for values in series}
    if len(lengths) != 1:
        raise ValueError(f"columns of different lengths: {sorted(lengths)}")

    (length,) = lengths

    def write(temporary: Path) -> None:
        with temporary.open("w", encoding="ascii", newline="") as file:
            file.write(",".join(columns) + "\n")
            for start in range(0, length, _CHUNK):
                chunk = [map(repr, values[start : start + _CHUNK].tolist()) for values in series]
                rows = [",".join(row) for row in zip(*chunk, strict=True)]
                file.write("\n".join(rows) + "\n")
                if advance is not None:
                    advance(float(len(rows)))

    return write_through(path, write)
