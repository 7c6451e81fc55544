"""What the columns and variables of a cast are called, and the units they come in.

`RawCast` is a cast as it stands in a file: arrays in the units of `CAST_COLUMNS`, rows in its
order.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError, column_as
from swimbladder.io.columns import (
    check_columns,
    mapped_column,
    no_column,
    plain_unit,
    words_and_unit,
)
from swimbladder.io.log_format import LogColumn, bracketed
from swimbladder.io.log_rows import Sheet
from swimbladder.io.log_table import read_table
from swimbladder.io.log_text import LogFile, Value, counted
from swimbladder.physics.arrays import Array, Flags
from swimbladder.units import has_kind

_FARTHEST = {"latitude": 90.0, "longitude": 360.0}  # degrees


def place_of(name: str, values: Array, report: list[str]) -> float | None:
    """Return the mean latitude or longitude of a file [degrees]; None where it has none.

    Positions that are none, as where a receiver had no fix, are left out and said.
    """
    known = values[np.isfinite(values)]
    real = known[np.abs(known) <= _FARTHEST[name]]
    if len(real) < len(known):
        odd = counted(len(known) - len(real), name)
        report.append(f"{odd} beyond {_FARTHEST[name]:g} degrees left out")
    return float(np.mean(np.unwrap(real, period=360.0))) if len(real) else None


@dataclass(frozen=True, kw_only=True)
class RawCast:
    """Rows of a file [n]; of pressure and depth, and of salinity and conductivity, one at least."""

    path: Path
    temperature: Array  # degC, in situ
    pressure: Array | None = None  # dbar
    depth: Array | None = None  # m
    salinity: Array | None = None  # practical
    conductivity: Array | None = None  # S/m
    density: Array | None = None  # kg/m3 in situ, only held against the others
    row: NDArray[np.int64]  # line of a text, else the number of the sample
    row_name: str = "line"
    latitude: float | None = None
    longitude: float | None = None
    name: str = ""
    names: dict[str, str] = field(default_factory=dict)  # of the file's columns, where known
    unit_stated: bool = False  # that of pressure, by the user or by a format that knows no other
    unit_named: str | None = None  # the same by the name of its column, or its attribute
    report: list[str] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.row)

    @property
    def down(self) -> Array:
        """Pressures [dbar], or depths [m] where it has none."""
        found = self.depth if self.pressure is None else self.pressure
        assert found is not None
        return found

    def at(self, k: int) -> str:
        """Return where row k stands: "line 12"."""
        return f"{self.row_name} {self.row[k]}"

    def only(self, kept: Flags | NDArray[np.int64]) -> RawCast:
        """Return the cast with the rows `kept`, a mask or an order."""
        arrays = {name: v for name, v in vars(self).items() if isinstance(v, np.ndarray)}
        chosen: dict[str, Any] = {name: values[kept] for name, values in arrays.items()}
        return replace(self, **chosen)

    def refused(
        self, what: str, remedy: str, field: str, *, k: int | None = None, **more: Unpack[Value]
    ) -> LogError:
        """Return the error about row k, or about the whole; a value is in the unit of its column
        where no other is given.
        """
        line = int(self.row[k]) if k is not None and self.row_name == "line" else None
        if k is not None and line is None:
            what = f"{self.at(k)}: {what}"
        if more.get("value") is not None and more.get("unit") is None:
            more["unit"] = CAST_COLUMNS.get(field) or None
        return LogFile(self.path).refused(what, remedy, field, line=line, **more)


def raw_cast(
    columns: Mapping[str, Array | None],
    file: LogFile,
    row: NDArray[np.int64],
    **more: Any,
) -> RawCast:
    """Return the columns of a profile, by their names in `CAST_COLUMNS`, as a cast.

    row: the lines of a text, or the numbers of samples. more: other fields.
    """
    fields: dict[str, Any] = {name.split("_")[0]: values for name, values in columns.items()}
    for name in _FARTHEST:
        values = columns.get(name)
        fields[name] = None if values is None else place_of(name, values, file.report)
    fields |= {"path": Path(file.path), "report": file.report, "row": row}
    return RawCast(**{**fields, **more})


_DEPTHS = {"pressure_dbar": "dbar", "depth_m": "m"}
_WATERS = {"temperature_degC": "degC", "salinity": "", "conductivity_S_m": "S/m"}
_PLACES = {"latitude": "deg", "longitude": "deg"}
CAST_COLUMNS = {**_DEPTHS, **_WATERS, "density_kg_m3": "kg/m3", **_PLACES}
"""The columns of a cast and their units; salinity is practical salinity, PSS-78.

density_kg_m3 is that in situ; it is only held against the others.
"""

_CALLED = {
    "pressure_dbar": "pressure pres press prdm ctdprs sea_water_pressure "
    "sea_water_pressure_due_to_sea_water",
    "depth_m": "depth depsm",
    "temperature_degC": "temperature temp t090c ctdtmp sea_water_temperature",
    "salinity": "salinity sal psal sal00 sp ctdsal practical_salinity sea_water_salinity "
    "sea_water_practical_salinity",
    "conductivity_S_m": "conductivity cond cndc sea_water_electrical_conductivity",
    "density_kg_m3": "density rho sea_water_density",
    "latitude": "latitude lat",
    "longitude": "longitude lon",
}
NAMES = {name: frozenset(words.split()) for name, words in _CALLED.items()}
"""Plain names that leave no doubt, in small letters; CF standard names among them."""
_ABSOLUTE = re.compile(r"absolute.?salinity|^sa\b")


def kind_of(name: str) -> tuple[str, str | None] | None:
    """Return which column of a cast a name means, and its unit where the name says one.

    ``Pressure [bar]`` -> ("pressure_dbar", "bar"); None where it means none, or may mean several.
    """
    if name in CAST_COLUMNS:
        return name, CAST_COLUMNS[name]
    words, unit = words_and_unit(name)
    word = re.sub(r"[ .-]+", "_", words.strip(" _").lower()).removeprefix("ctd_")
    word = word.removeprefix("sci_water_")
    column = next((column for column, names in NAMES.items() if word in names), None)
    if column is None or unit is None or bracketed(name) is not None:
        return None if column is None else (column, unit)
    return (column, unit) if has_kind(unit, CAST_COLUMNS[column]) else None


def check_names(names: Collection[str], file: LogFile) -> None:
    """Raise LogError for a name that is no column of a cast."""
    check_columns(file, names, CAST_COLUMNS, "a cast")


def sheet_cast(
    file: LogFile,
    mapped: Mapping[str, str],
    *,
    where: Mapping[str, str | float] | None = None,
    salted: bool = True,
    sheet: Sheet | None = None,
    **more: Any,
) -> RawCast:
    """Return the cast of a table, read as logs are.

    salted: whether the salinity is stated elsewhere, or is asked for later. sheet: what is read in
    the file's place. more: fields of the cast. Raises LogError.
    """
    choose, rows = partial(cast_sources, file, mapped, salted=salted), {**file.form.where}
    table = read_table(file, rows | {**(where or {})}, choose, [], CAST_COLUMNS, sheet=sheet)
    down = table.sources.get("pressure_dbar")
    names = {name: column.name for name, column in table.sources.items()}
    known = {"names": names, "unit_named": None if down is None else down.unit}
    return raw_cast(table.values, file, row=table.line, **{**known, **more})


def cast_sources(
    file: LogFile, mapped: Mapping[str, str | LogColumn], sheet: Sheet, *, salted: bool = False
) -> dict[str, LogColumn]:
    """Return which column of a file each column of a cast is read from.

    mapped: as for logs; what is not mapped is taken where one column, and one only, has its name.
    salted: whether the salinity is stated elsewhere.
    Raises LogError where a name is unknown, or what a cast needs is missing.
    """
    check_names(mapped, file)
    header = sheet.header
    sources = {name: _given(file, name, given, header) for name, given in mapped.items()}
    kinds = {column: kind_of(column) or ("", None) for column in header}
    for name in (name for name in CAST_COLUMNS if name not in sources):
        found = [column for column in header if sheet.meant.get(column) == name]
        found = found or [column for column in header if kinds[column][0] == name]
        plain = [c for c in found if c == name] or [c for c in found if c.lower() in NAMES[name]]
        found = plain if len(found) > 1 and plain else found
        if len(found) > 1:
            what = f"several columns may be the {name.split('_')[0]}"
            remedy = f"Choose one with {column_as(name, 'NAME')}"
            raise file.refused(what, remedy, name, value=", ".join(found))
        for column in found:
            unit = sheet.units.get(column, kinds[column][1])
            sources[name] = LogColumn(name=column, unit=unit)
    _need(file, sources, header, salted=salted)
    return sources


def _given(file: LogFile, name: str, given: str | LogColumn, header: Sequence[str]) -> LogColumn:
    column = mapped_column(file, name, given, header)
    unit = column.unit if column.unit is not None else bracketed(column.name)
    if unit is None:
        kind = kind_of(column.name)
        unit = kind[1] if kind is not None and kind[0] == name else None
    return column if unit is None else LogColumn(name=column.name, unit=plain_unit(unit))


def _need(
    file: LogFile, sources: Mapping[str, LogColumn], header: Sequence[str], *, salted: bool
) -> None:
    """Raise LogError where pressure and depth, temperature, or all that gives salt is missing."""
    for names, what in (
        (("pressure_dbar", "depth_m"), "neither pressure nor depth"),
        (("temperature_degC",), "no temperature"),
        (("salinity", "conductivity_S_m"), "neither salinity nor conductivity"),
    ):
        if not any(name in sources for name in names) and not (salted and "salinity" in names):
            more = ""
            if "salinity" in names:
                more = "; for a lake give `salinity=0`, that of fresh water"
                absolute = [column for column in header if _ABSOLUTE.search(column.lower())]
                if absolute:
                    more += f" ({absolute[0]} is not practical: gsw.SP_from_SA makes it so)"
            raise no_column(file, f"the cast has {what}", names[0], header, more)
