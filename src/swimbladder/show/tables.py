"""The main table of an answer as pandas and xarray have tables: a unit for every array."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from swimbladder.control.records import leaves
from swimbladder.io.netcdf import cf_dataset, described, meaning
from swimbladder.sim.closed_loop.solution import time_of_run

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from swimbladder.codegen.library import Library
    from swimbladder.design.experiments import Design
    from swimbladder.design.linear import Analysis
    from swimbladder.design.stability import Stability
    from swimbladder.design.tuning import Tuning

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


def response_columns(found: Analysis) -> dict[str, Any]:
    """Return the open loop's frequency response, command to depth."""
    w, values = found.response()
    phase = np.unwrap(np.angle(values))
    return {"frequency_rad_s": w, "gain": np.abs(values), "phase_rad": phase}


def gain_columns(found: Tuning) -> dict[str, Any]:
    """Return the law's parameters, with their units."""
    values = leaves(found.parameters)
    units = [found.law.units[name] for name in values]
    return {"parameter": list(values), "value": [float(x) for x in values.values()], "unit": units}


def golden_columns(made: Library) -> dict[str, Any]:
    """Return the golden trace: what the law sees and says at each tick."""
    golden, command = made.golden, made.law.command
    name = {"voltage": "command_V", "volume": "command_m3", "volume change": "command_s"}[command]
    columns = {"depth_m": golden.depth, "volume_m3": golden.volume, "reference_m": golden.reference}
    time = made.tick_s * np.arange(len(golden.depth))
    floats = {key: np.asarray(x, np.float64) for key, x in columns.items()}
    return {"time_s": time, **floats, name: np.asarray(golden.command, np.float64)}


def map_columns(found: Stability) -> dict[str, Any]:
    """Return what became of each run of the maps, a row each."""
    import pandas

    frames = [dataframe(one.csv()) for one in found.maps]
    for one, frame in zip(found.maps, frames, strict=True):
        frame.columns = ["x", "y", *frame.columns[2:]]
        frame.insert(0, "map", one.name)
        frame.insert(1, "x_is", one.x_label)
        frame.insert(3, "y_is", one.y_label)
    whole = pandas.concat(frames) if frames else pandas.DataFrame({"map": []})
    return {str(name): whole[name].to_numpy() for name in whole}


def release_columns(found: Design) -> dict[str, Any]:
    """Return the experiments, a row for each change of volume; depth is nan for one from rest."""
    rows = [
        (number, release.start, flight.duration, move.volume, move.depth)
        for number, (release, flight) in enumerate(
            zip(found.chosen.releases, found.chosen.flights, strict=True), start=1
        )
        for move in release.moves
    ]
    names = ("experiment", "start_depth_m", "duration_s", "volume_m3", "at_depth_m")
    return dict(zip(names, np.array(rows, dtype=float).T, strict=True))
