"""A log as arrays: of a netCDF file, a DataFrame or a Dataset, in the units that they state.

What this package writes is read by itself: the variable `depth` in m is the column ``depth_m``.
"""

from collections import Counter
from collections.abc import Collection, Iterable

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.io.cast_columns import cast_unit
from swimbladder.io.cast_netcdf import NetCDF
from swimbladder.io.log_format import COLUMNS
from swimbladder.io.log_rows import TEXT_OPTIONS, Column, column_of
from swimbladder.io.log_text import LogFile
from swimbladder.units import unit_factor


class ArrayRows:
    """Arrays as columns: a `Sheet`, whose lines are samples counted from 1."""

    def __init__(self, arrays: Iterable[tuple[str, str, Column]]) -> None:
        """Take each array with its name and its unit, none where it is empty."""
        self.parts, self.units = 1, dict[str, str]()
        self._columns: dict[str, Column] = {}
        for name, said, values in arrays:
            unit = cast_unit(said.partition(" since ")[0])
            column = _meant(name, unit)
            self._columns[column or name] = values
            if unit and column is None:
                self.units[name] = unit
        self.header = [*self._columns]

    def take(self, names: Collection[str]) -> tuple[NDArray[np.int64], dict[str, Column]]:
        """Return the number of each sample, and the columns of these names."""
        count = max((len(column) for column in self._columns.values()), default=0)
        return np.arange(1, count + 1), {name: self._columns[name] for name in names}


class NetCDFRows(ArrayRows):
    """The variables of a netCDF file with a value for each sample."""

    def __init__(self, data: bytes, file: LogFile) -> None:
        """Read the variables that have as many numbers as most.

        Raises LogError where the bytes are damaged or the format has options that are for texts.
        """
        remedy = "Leave {} out of the [log] table: it is for texts"
        file.refuse_unused(TEXT_OPTIONS, "the log is netCDF", remedy, idle=0)
        found = NetCDF(data, file).variables.items()
        series = {name: one for name, one in found if one.numeric and one.values.ndim == 1}
        sizes = Counter(one.values.size for one in series.values()).most_common(1)
        super().__init__(
            (name, one.attributes.get("units", ""), np.asarray(one.values, np.float64))
            for name, one in series.items()
            if one.values.size == sizes[0][0]
        )


class FrameRows(ArrayRows):
    """The columns of a pandas DataFrame, or what an xarray Dataset has along its one dimension.

    The units are those of `attrs["units"]`: of a DataFrame by column, of a Dataset in each array's.
    """

    def __init__(self, file: LogFile) -> None:
        """Read the columns, a named index among them; instants become seconds since the first.

        Raises LogError where a Dataset has several dimensions, a DataFrame a name twice, or the
        format has options that are for texts.
        """
        kind, frame = str(file.path), file.frame
        file.refuse_unused(TEXT_OPTIONS, f"this is a {kind}", "Leave {} out", idle=0)
        if kind == "Dataset":
            if len(frame.sizes) != 1:
                what = f"the Dataset has the dimensions {', '.join(map(str, frame.sizes))}"
                raise file.refused(what, "Choose one profile or one log, with isel or sel", "sizes")
            series = {name: one for name, one in frame.variables.items() if one.ndim == 1}
            units = {name: one.attrs.get("units", "") for name, one in series.items()}
            frame = frame[[*series]].to_dataframe()
        else:
            units = frame.attrs.get("units", {})
        if any(frame.index.names) or frame.index.dtype.kind == "M":
            frame = frame.rename_axis(index=frame.index.name or "time").reset_index()
        if not frame.columns.is_unique:
            twice = frame.columns[frame.columns.duplicated()][0]
            raise file.refused("a column stands there twice", "Rename one", str(twice))
        arrays = []
        for name, one in frame.items():
            instants = one.dtype.kind == "M"
            seconds = (one - one.iloc[0]).dt.total_seconds() if instants and len(one) else one
            unit = "s" if instants or one.dtype.kind == "m" else str(units.get(name, ""))
            arrays.append((str(name), unit, column_of(seconds)))
        super().__init__(arrays)


def _meant(name: str, unit: str) -> str | None:
    """Return the column of a log that a variable is by its name and unit."""
    for column, wanted in COLUMNS.items():
        try:
            named = column == name or column.startswith(f"{name.lower()}_")
            if named and unit_factor(unit, wanted) == 1.0:
                return column
        except InputError:
            continue
    return None
