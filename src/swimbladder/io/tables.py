"""CSV with a header, every number in full double precision.

Results are also written as netCDF files that follow the CF conventions.
"""

from __future__ import annotations

import csv
import datetime
import io
from collections.abc import Iterable, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.io.files import write_through
from swimbladder.io.progress import Advance, silent

if TYPE_CHECKING:
    import xarray as xr

CONVENTIONS = "CF-1.11"


def write(
    path: str | Path, dataset: xr.Dataset, *, title: str, start: datetime.datetime | None = None
) -> Path:
    """Write a dataset with the attributes that CF asks of a file, and return the path.

    start: the moment that `time` counts from, with its time zone; without it `time` stays a plain
    number of seconds since the start. Raises InputError where the file cannot be written.
    """
    source = f"swimbladder {version('swimbladder')}"
    stamped = dataset.copy()
    if start is not None:
        utc = start.astimezone(datetime.UTC)
        stamped["time"].attrs |= {
            "standard_name": "time",
            "units": f"seconds since {utc:%Y-%m-%d %H:%M:%S.%f}",
            "calendar": "standard",
        }
    stamped.attrs = dict(dataset.attrs) | {
        "Conventions": CONVENTIONS,
        "title": title,
        "source": source,
        "history": f"written by {source}",  # no time: the same run writes the same bytes
    }
    packed: dict[str, Any] = {"zlib": True, "complevel": 1}
    encoding = {str(name): packed for name in stamped.data_vars}
    encoding |= {str(name): {"_FillValue": None} for name in stamped.coords}
    return write_through(path, partial(stamped.to_netcdf, engine="h5netcdf", encoding=encoding))


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
