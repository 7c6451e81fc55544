"""Results as netCDF files that follow the CF conventions."""

from __future__ import annotations

import datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swimbladder.io.files import write_through

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
    encoding: dict[str, dict[str, Any]] = {
        str(name): {"zlib": True, "complevel": 1} for name in stamped.data_vars
    }
    encoding |= {str(name): {"_FillValue": None} for name in stamped.coords}

    return write_through(
        path, lambda temporary: stamped.to_netcdf(temporary, engine="h5netcdf", encoding=encoding)
    )
