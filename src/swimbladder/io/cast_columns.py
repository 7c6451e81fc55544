"""What the columns and variables of a cast are called, and the units they come in.

`RawCast` is a cast as it stands in a file: arrays in the units of `CAST_COLUMNS`, rows in its
order.

Casts in files that are no table of text: netCDF (CF, OG1, Argo's profiles), Sea-Bird's .cnv.

Of an Argo profile the adjusted values are taken where there are any, and in the modes A and D no
others. Variables are known by standard name, else by their own; those of a .cnv file by its short
names.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError, Parameter, column_as
from swimbladder.io.columns import (
    check_columns,
    column_readings,
    mapped_column,
    no_column,
    plain_unit,
    words_and_unit,
)
from swimbladder.io.log_format import LogColumn, LogFormat, bracketed
from swimbladder.io.log_rows import Arrays, Chunk, Rows, Sheet, chosen
from swimbladder.io.log_table import read_table
from swimbladder.io.log_text import LogFile, Value, counted
from swimbladder.io.netcdf import NetCDF
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
    columns: Mapping[str, Array | None], file: LogFile, row: NDArray[np.int64], **more: Any
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


_ARGO = {"PRES": "pressure_dbar", "TEMP": "temperature_degC", "PSAL": "salinity"}
_SHOWN = 4  # profiles, where there are too many


class _Variables(Arrays):
    """Variables of a netCDF file as columns; of those that are read the bad values are left out."""

    def __init__(
        self, found: NetCDF, meant: Mapping[str, str], names: Collection[str], n: int | None = None
    ) -> None:
        """Take these variables; meant: which column of a cast they are; n: one profile of them."""
        units = {name: found.unit(name) for name in names}
        super().__init__({name: np.zeros(0) for name in names}, units, meant)
        self._found, self._n = found, n

    def chunks(self, names: Collection[str]) -> Iterator[Chunk]:
        """Yield the number of each sample, and the columns of these names."""
        for name in names:
            values = self._found.good(name)
            self._columns[name] = np.ravel(values if self._n is None else values[self._n])
        return super().chunks(names)


def netcdf_cast(
    data: bytes, path: Path, columns: Mapping[str, str], profile: int | None
) -> tuple[RawCast, int | None]:
    """Return the cast of a netCDF file as it stands there, and which of its ways is still asked
    for: None where `profile` has been used up by choosing a profile of the file.

    columns: as for texts, variable for column. Raises LogError.
    """
    file = LogFile(path)
    check_names(columns, file)
    found = NetCDF(data, file)
    if {"PRES", "TEMP"} <= found.numbers.keys() and found.numbers["PRES"].ndim == 2:
        n = _asked(found, profile)
        meant = _argo(found, n)
        sheet = _Variables(found, meant, meant, n)
        more = _place(found, slice(n, n + 1)) | {"name": _platform(found, n), "unit_stated": True}
        return sheet_cast(file, columns, sheet=sheet, row_name="sample", **more), None
    standard = {n: found.attributes[n].get("standard_name", "") for n in found.numbers}
    meant = {n: one for n, said in standard.items() for one in NAMES if said in NAMES[one]}
    sheet = _Variables(found, meant, _series(found, meant, columns))
    place = _place(found, slice(None))
    return sheet_cast(file, columns, sheet=sheet, row_name="sample", **place), profile


def _place(found: NetCDF, at: slice) -> dict[str, Any]:
    """Return the mean latitude and longitude of a file, at a part of their values."""
    place: dict[str, Any] = {}
    for one in ("latitude", "longitude"):
        names = [n for n in found.numbers if n.lower() in NAMES[one]]
        if names:
            place[one] = place_of(one, np.ravel(found.good(names[0]))[at], found.file.report)
    return place


def _series(found: NetCDF, meant: Mapping[str, str], columns: Mapping[str, str]) -> list[str]:
    """Return the variables with a number for each temperature: gliders log on several clocks.

    Raises LogError where these are a grid over depth and something else.
    """
    sizes = {n: v.size for n, v in found.numbers.items()}
    names = {n: meant.get(n) or (kind_of(n) or ("",))[0] for n in sizes}
    asked = column_readings(columns.get("temperature_degC", " "))
    warm = [n for n in sizes if n in asked] or [n for n in meant if names[n] == "temperature_degC"]
    warm = warm or [n for n in sizes if names[n] == "temperature_degC"]
    shape = found.numbers[warm[0]].shape if warm else ()
    down = [n for n in sizes if names[n] in ("pressure_dbar", "depth_m")]
    over = [n for n in down if len(shape) > 1 and sizes[n] in shape]
    if over and not any(sizes[n] == sizes[warm[0]] for n in down):
        grid = f"a grid of {' x '.join(map(str, shape))} values over {sizes[over[0]]} of {over[0]}"
        what = f"the temperatures are {grid}: several profiles side by side"
        remedy = "Write the profile that you mean to a CSV"
        raise found.file.refused(what, remedy, names[over[0]])
    size = sizes[warm[0]] if warm else max(sizes.values(), default=0)
    others = ("latitude", "longitude")
    fitting = [n for n in sizes if sizes[n] == size and not n.lower().endswith("_qc")]
    return [n for n in fitting if names[n] not in others]


def _argo(found: NetCDF, n: int) -> dict[str, str]:
    """Return which variables of an Argo file are read, and as what, of a profile counted from 0."""
    mode = "".join(found.texts("DATA_MODE"))[n : n + 1]
    meant: dict[str, str] = {}
    for plain in (name for name in _ARGO if name in found.numbers):
        name, adjusted = plain, f"{plain}_ADJUSTED"
        if adjusted in found.numbers:
            if np.isfinite(found.numbers[adjusted][n]).any():
                name = adjusted
            elif mode in ("A", "D"):
                fit = f"no value of {plain} was found fit to be adjusted"
                what = f"in mode {mode} {fit}: none is good"
                remedy = "Take another profile; if you trust its raw values, write them to a CSV"
                raise found.file.refused(what, remedy, adjusted)
        if found.numbers[name].shape != found.numbers["PRES"].shape:
            remedy = "Fetch the file anew: every profile has a value per level"
            raise found.file.refused("not as many values as pressures", remedy, name)
        meant[name] = _ARGO[plain]
    return meant


def _asked(found: NetCDF, profile: int | None) -> int:
    """Return the profile that is asked for, from 0: else the only one, or only primary one.

    Raises LogError where there are several, or fewer than asked for.
    """
    pressures = found.numbers["PRES"]
    count = len(pressures)
    if profile is not None and profile > count:
        what = f"the file has {counted(count, 'profile')}"
        raise found.file.refused(
            what, f"Choose from 1 to {count}", Parameter("profile"), value=profile
        )
    if profile is not None or count < 2:
        return (profile or 1) - 1
    held = [k for k in range(count) if np.isfinite(pressures[k]).any()]
    schemes = dict(enumerate(found.texts("VERTICAL_SAMPLING_SCHEME")))
    primary = [k for k in held if schemes.get(k, "").lower().startswith("primary")]
    chosen = primary or held or [0]
    if len(chosen) > 1:
        some = ", ".join(
            f"{k + 1}: {f'{_platform(found, k)} to'.strip()} {np.nanmax(pressures[k]):.0f} dbar"
            for k in chosen[:_SHOWN]
        )
        more = ", ..." if len(chosen) > _SHOWN else ""
        what = f"there are {len(chosen)} profiles in it ({some}{more})"
        raise found.file.refused(what, "Choose one with `profile=1`", Parameter("profile"))
    why = "the primary sampling" if primary else "the only one with pressures"
    found.file.report.append(f"profile {chosen[0] + 1} of {count} taken, {why}")
    return chosen[0]


def _platform(found: NetCDF, n: int) -> str:
    parts = [f"float {x.strip(chr(0) + ' ')}" for x in found.texts("PLATFORM_NUMBER")[n : n + 1]]
    cycles = np.ravel(found.numbers.get("CYCLE_NUMBER", np.zeros(0)))
    parts += [f"cycle {int(cycle)}" for cycle in cycles[n : n + 1] if np.isfinite(cycle)]
    return " ".join(parts)


_NAME = re.compile(r"# name (\d+) = ([^:]+):\s*(.*)")
_PLACE = re.compile(
    r"\*\s*NMEA (Latitude|Longitude) = (\d+)\s+(\d+(?:\.\d+)?)\s*([NSEW])", re.IGNORECASE
)
_SAID = re.compile(r"# (bad_flag|file_type) = (-?\d+\.?\d*(?:[eE][-+]?\d+)?|ascii|binary)\s*$")
# How the short names of the variables begin (SBE Data Processing, appendix on variable names); the
# first column that begins so is the primary sensor's.
_SHORT = {
    "pressure_dbar": ("pr",),
    "depth_m": ("dep",),
    "temperature_degC": ("t090", "tv290", "t068", "tv268", "t190"),
    "salinity": ("sal",),
    "conductivity_S_m": ("c0", "c1"),
    "density_kg_m3": ("density",),
    "latitude": ("latitude",),
    "longitude": ("longitude",),
}
_IPTS68 = 1.00024  # T68 over T90 (Saunders 1990, WOCE Newsletter 10)


def is_cnv(data: bytes) -> bool:
    """Say whether bytes are those of a .cnv file."""
    named = data.startswith(b"*") and b"\n# name 0 = " in data[:100_000]
    return named or data.startswith(b"* Sea-Bird")


class _Cnv(Rows):
    """The rows of a .cnv file, without those that are flagged as bad."""

    def chunks(self, names: Collection[str]) -> Iterator[Chunk]:
        """Yield the line of each good row, and the columns of these names as texts."""
        flagged = 0
        for line, columns in super().chunks({*names, *({"flag"} & {*self.header})}):
            flags = columns.get("flag", ())
            bad = np.array([text in self.form.missing for text in flags], dtype=bool)
            good = ~bad if len(bad) else np.ones(len(line), dtype=bool)
            flagged += int((~good).sum())
            yield line[good], {name: chosen(columns[name], good) for name in names}
        if flagged:  # by Loop Edit or Wild Edit
            self.report.append(f"{counted(flagged, 'row')} flagged as bad left out")


def cnv_cast(
    data: bytes, path: Path, columns: Mapping[str, str], profile: int | None
) -> tuple[RawCast, int | None]:
    """Return the cast of a .cnv file as it stands there, and the profile that is asked for of it.

    columns: as for other casts, by the short names of the header ("prDM"). Raises LogError.
    """
    file = LogFile(path)
    check_names(columns, file)
    lines = data.decode("latin-1").splitlines()
    end = next((k for k, line in enumerate(lines) if line.startswith("*END*")), None)
    if end is None:
        remedy = "Give the whole .cnv file, as Sea-Bird's software writes it"
        raise file.refused("the header has no end", remedy, "*END*")
    names: dict[int, tuple[str, str]] = {}
    said: dict[str, str] = {}
    place: dict[str, Any] = {}
    for line in lines[:end]:
        if (found := _NAME.match(line)) is not None:
            names[int(found[1])] = (found[2].strip(), found[3])
        elif (found := _SAID.match(line)) is not None:
            said[found[1]] = found[2]
        elif (found := _PLACE.match(line)) is not None:
            sign = -1.0 if found[4].upper() in "SW" else 1.0
            place[found[1].lower()] = sign * (float(found[2]) + float(found[3]) / 60.0)
    if said.get("file_type") == "binary":
        remedy = "Write it as ASCII with Sea-Bird's Translate"
        raise file.refused("the data are binary", remedy, "file_type", value="binary")
    if sorted(names) != list(range(len(names))):
        what = "the columns are not numbered from 0 on"
        raise file.refused(what, "Give the file as Sea-Bird's software writes it", "name")
    shorts = [short for short, _ in names.values()]
    bad = said.get("bad_flag", "-9.990e-29")
    form = LogFormat(
        names=tuple(shorts), skip_lines=end + 1, delimiter=" ", missing=(bad,), encoding="latin-1"
    )
    sheet = _Cnv(data, LogFile(path, form, file.report), strict=True)
    for short, words in names.values():
        if units := re.findall(r"\[([^\]]*)\]", words):
            sheet.units[short] = plain_unit(units[-1].split(",")[-1])
    for one, starts in _SHORT.items():
        first = [short for start in starts for short in shorts if short.lower().startswith(start)]
        sheet.meant |= {short: one for short in first[:1]}
    raw = sheet_cast(sheet.file, columns, sheet=sheet, unit_stated=True)
    if "68" in (warm := raw.names.get("temperature_degC", "")):
        said_so = f"{warm} is on the scale of 1968 and was turned into that of 1990"
        raw.report.append(said_so)
        raw = replace(raw, temperature=raw.temperature / _IPTS68)
    place_there = {one: place[one] for one in place if getattr(raw, one) is None}
    return replace(raw, **place_there), profile
