"""What netCDF files and zarr stores say of their numbers, by the CF conventions.

Units are written as UDUNITS reads them; standard names are those of CF's table. The numbers of a
dataset are as the file has them: `xarray.decode_cf` makes dates of its times.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swimbladder.io.files import write_through

if TYPE_CHECKING:
    import xarray as xr

UNDATED = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
"""What times count from where the user has not said when a run begins."""

_PACKED: dict[str, Any] = {"zlib": True, "complevel": 1}

Variable = tuple[Any, Any, dict[str, Any]]
"""The dimensions of a variable, its values, and its attributes."""


def meaning(units: str, long_name: str, standard_name: str = "", **more: Any) -> dict[str, Any]:
    """Return the attributes of a variable; without units where its numbers stand for words."""
    said = {"units": units, "long_name": long_name, "standard_name": standard_name}
    return {name: text for name, text in said.items() if text} | more


def of_type(about: Mapping[str, Any], kind: Any) -> dict[str, Any]:
    """Return attributes of a variable for numbers of this type.

    Where the numbers stand for words, `flag_meanings`, the first for 0, they are listed.
    """
    words = about.get("flag_meanings", "").split()
    listed = {"flag_values": np.arange(len(words))} if words else {}
    typed = {"flag_values", "valid_min", "valid_max", "valid_range", "_FillValue"}
    said = {**about, **listed}
    return {k: np.asarray(v, kind)[()] if k in typed else v for k, v in said.items()}


def time_since(moment: datetime.datetime, long_name: str, **more: Any) -> dict[str, Any]:
    """Return the attributes of times that count from a moment, in seconds."""
    since = moment.astimezone(datetime.UTC).isoformat().replace("+00:00", "Z")
    said = {"calendar": "standard", "units_metadata": "leap_seconds: none", **more}
    return meaning(f"seconds since {since}", long_name, "time", **said)


def unless_dated(begin: datetime.datetime | None) -> dict[str, str]:
    """Return what the times of a run say where the user has not said when it begins."""
    said = f"The date is arbitrary, none was given: the run begins on {UNDATED:%Y-%m-%d}"
    return {} if begin else {"comment": said}


def described(title: str, **more: Any) -> dict[str, Any]:
    """Return the attributes of a file; none is of the time at which it was written."""
    source = f"swimbladder {version('swimbladder')}"
    said = {"Conventions": "CF-1.11", "title": title, "source": source}
    return said | {"history": f"written by {source}"} | more


def cf_dataset(
    variables: Mapping[str, Variable], attributes: Mapping[str, Any], *, coordinates: Iterable[str]
) -> xr.Dataset:
    """Return a dataset that follows CF, also where its user writes it.

    coordinates: which variables are. What stands where one has no value is its attribute
    `_FillValue`, else nan.
    """
    import xarray

    data = {name: xarray.Variable(*said) for name, said in variables.items()}
    for name, variable in data.items():
        variable.attrs = of_type(variable.attrs, variable.dtype)
        if variable.ndim:
            variable.encoding |= _PACKED
        if name in coordinates or "_FillValue" in variable.attrs:
            variable.encoding["_FillValue"] = variable.attrs.pop("_FillValue", None)
    found = xarray.Dataset(data, attrs=attributes)
    return found.set_coords(coordinates)


def write_netcdf(path: str | Path, dataset: xr.Dataset) -> Path:
    """Write a dataset as a netCDF-4 file and return the path.

    Raises InputError where the file cannot be written.
    """
    return write_through(path, partial(dataset.to_netcdf, engine="h5netcdf"))
