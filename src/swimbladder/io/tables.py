"""CSV with a header, every number in full double precision."""

import csv
import io
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.io.files import write_through
from swimbladder.io.progress import Advance, silent


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
                advance(float(len(rows)))

    return write_through(path, write)
