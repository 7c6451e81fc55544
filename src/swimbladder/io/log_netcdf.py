"""A log in a netCDF file: its variables with a value for each sample, in the units that they state.

What this package writes is read by itself: the variable `depth` in m is the column ``depth_m``.
"""

from collections import Counter
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.io.cast_columns import cast_unit
from swimbladder.io.cast_netcdf import NetCDF
from swimbladder.io.log_format import COLUMNS
from swimbladder.io.log_rows import TEXT_OPTIONS, Column
from swimbladder.io.log_text import LogFile
from swimbladder.units import unit_factor


class NetCDFRows:
    """The variables of a netCDF file as columns: a `Sheet`, whose lines are samples from 1."""

    def __init__(self, data: bytes, file: LogFile) -> None:
        """Read the variables that have as many numbers as most.

        Raises LogError where the bytes are damaged or the format has options that are for texts.
        """
        remedy = "Leave {} out of the [log] table: it is for texts"
        file.refuse_unused(TEXT_OPTIONS, "the log is netCDF", remedy, idle=0)
        found = NetCDF(data, file).variables.items()
        series = {name: one for name, one in found if one.numeric and one.values.ndim == 1}
        sizes = Counter(one.values.size for one in series.values()).most_common(1)
        self.parts, self.units = 1, dict[str, str]()
        self._columns: dict[str, Column] = {}
        for name, one in series.items():
            if one.values.size != sizes[0][0]:
                continue
            unit = cast_unit(one.attributes.get("units", "").partition(" since ")[0])
            column = _meant(name, unit)
            self._columns[column or name] = np.asarray(one.values, np.float64)
            if unit and column is None:
                self.units[name] = unit
        self.header = [*self._columns]

    def take(self, names: Collection[str]) -> tuple[NDArray[np.int64], dict[str, Column]]:
        """Return the number of each sample, and the columns of these names."""
        count = max((len(column) for column in self._columns.values()), default=0)
        return np.arange(1, count + 1), {name: self._columns[name] for name in names}


def _meant(name: str, unit: str) -> str | None:
    """Return the column of a log that a variable is by its name and unit."""
    for column, wanted in COLUMNS.items():
        try:
            if column.startswith(f"{name.lower()}_") and unit_factor(unit, wanted) == 1.0:
                return column
        except InputError:
            continue
    return None
