"""A cast as Sea-Bird's software writes it: a .cnv file, its header naming columns and units."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.io.cast_columns import CAST_COLUMNS, RawCast, cast_unit, check_names, raw_cast
from swimbladder.io.log_text import LogFile, counted
from swimbladder.units import unit_factor

Array = NDArray[np.float64]

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
    place: dict[str, float] = {}
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
    table, row = _numbers(lines, end, len(names), file)
    bad = float(said.get("bad_flag", "-9.99e-29"))
    flag = next((k for k, (short, _) in names.items() if short == "flag"), None)
    if flag is not None and (flagged := table[:, flag] == bad).any():  # by Loop Edit or Wild Edit
        file.report.append(f"{counted(int(flagged.sum()), 'row')} flagged as bad left out")
        table, row = table[~flagged], row[~flagged]
    table = np.where(table == bad, np.nan, table)
    values = {name: _column(name, columns.get(name, ""), names, table, file) for name in _SHORT}
    warm = values["temperature_degC"] is not None
    if not warm or (values["pressure_dbar"] is None and values["depth_m"] is None):
        what = "pressure or depth" if warm else "temperature"
        remedy = f"Columns of the file: {', '.join(short for short, _ in names.values())}"
        raise file.refused(f"the cast has no {what}", remedy, "name")
    said_there = {name: np.array([degrees]) for name, degrees in place.items()}
    return raw_cast(values | said_there, file, row=row, unit_stated=True), profile


def _numbers(
    lines: list[str], end: int, count: int, file: LogFile
) -> tuple[Array, NDArray[np.int64]]:
    """Return the rows of numbers [n, count] and their lines; raises LogError for any other row."""
    rows, at = [], []
    for k, line in enumerate(lines[end + 1 :], start=end + 2):
        fields = line.split()
        if not fields:
            continue
        try:
            numbers = [float(field) for field in fields]
        except ValueError:
            numbers = []
        if len(numbers) != count:
            what = f"not the {count} numbers that the header names"
            remedy = "Give the file as Sea-Bird's software writes it"
            raise file.refused(what, remedy, "row", line=k, value=line.strip()[:60])
        rows.append(numbers)
        at.append(k)
    if not rows:
        raise file.refused("the header and no rows", "Give a .cnv file with its data", "rows")
    return np.array(rows), np.array(at, dtype=np.int64)


def _column(
    column: str, given: str, names: Mapping[int, tuple[str, str]], table: Array, file: LogFile
) -> Array | None:
    """Return a column of the cast in its unit, None where the file has none."""
    asked, _, stated = given.partition("@")
    starts = _SHORT[column]
    shorts = [(k, short.lower()) for k, (short, _) in names.items()]
    found = [k for start in starts for k, short in shorts if short.startswith(start)]
    if asked:
        found = [k for k, (short, _) in names.items() if short == asked]
        if not found:
            remedy = f"Columns of the file: {', '.join(short for short, _ in names.values())}"
            raise file.refused("no such column", remedy, column, value=asked)
    if not found:
        return None
    short, words = names[found[0]]
    said = re.findall(r"\[([^\]]*)\]", words)
    unit = stated or cast_unit(said[-1].split(",")[-1] if said else "")
    values = table[:, found[0]]
    if unit == "":
        unit = CAST_COLUMNS[column]
    try:
        factor = unit_factor(unit, CAST_COLUMNS[column])
    except InputError as error:
        remedy = f'State the unit: --column "{column}={short}@UNIT"'
        what, wanted = error.what, CAST_COLUMNS[column]
        raise file.refused(what, remedy, short, value=unit, unit=wanted) from None
    if "68" in short and column == "temperature_degC":
        file.report.append(f"{short} is on the scale of 1968 and was turned into that of 1990")
        factor /= _IPTS68
    times = "" if factor == 1.0 else f", times {factor:g}"
    file.report.append(f"{column} read from {short!r}{times}")
    return values * factor
