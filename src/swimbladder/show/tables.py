"""The main table of an answer as pandas and xarray have tables: a unit for every array."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from swimbladder.io.netcdf import cf_dataset, described, meaning
from swimbladder.sim.closed_loop.solution import time_of_run

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_UNITS = frozenset(["m", "m2", "m3", "s", "V", "A", "W", "J", "Pa", "kg", "N", "rad", "degC", "h"])


def dataframe(table: Mapping[str, Any] | str) -> pd.DataFrame:
    """Return columns, or a table as CSV, as a DataFrame.

    The units of the columns, as UDUNITS writes them, stand in its `attrs["units"]`.
    """
    import pandas

    if isinstance(table, str):
        found = pandas.read_csv(io.StringIO(table))
    else:
        found = pandas.DataFrame({name: np.asarray(column) for name, column in table.items()})
    found.attrs["units"] = {name: unit for name, (_, unit) in split(found.columns) if unit}
    return found


def dataset(frame: pd.DataFrame, title: str) -> xr.Dataset:
    """Return a table as a Dataset: arrays without the unit in their names, which is an attribute.

    They lie along the first column where its numbers only rise, else along the rows.
    """
    names = dict(split(frame.columns))
    first = frame[frame.columns[0]]
    rises = first.dtype.kind in "if" and bool(np.all(np.diff(first) > 0.0))
    along = names[frame.columns[0]][0] if rises else "row"
    arrays = {
        name: (along, frame[column].to_numpy(), _meaning(name, unit, axis=name == along))
        for column, (name, unit) in names.items()
    }
    return cf_dataset(arrays, described(title), coordinates=[along] if rises else [])


def _meaning(name: str, unit: str, *, axis: bool) -> dict[str, Any]:
    if axis and (name, unit) == ("time", "s"):
        return time_of_run()
    down = {"standard_name": "depth", "positive": "down"} if name == "depth" else {}
    return meaning(unit, name.replace("_", " "), **down)


def split(columns: Any) -> Iterator[tuple[str, tuple[str, str]]]:
    """Give each column's name with its name and its unit apart: rate_m3_s is a rate in m3 s-1."""
    for column in map(str, columns):
        words = column.split("_")
        end = len(words)
        while end > 1 and words[end - 1] in _UNITS:
            end -= 1
        unit = " ".join([*words[end : end + 1], *(f"{word}-1" for word in words[end + 1 :])])
        yield column, ("_".join(words[:end]), unit.replace("m3-1", "m-3").replace("m2-1", "m-2"))
