"""A cast in a netCDF file: CF and OG1 by standard name; Argo's profile files by `cast_argo`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.cast_argo import argo_cast, is_profiles
from swimbladder.io.cast_columns import CAST_COLUMNS, NAMES, check_names, kind_of
from swimbladder.io.cast_raw import RawCast, place_of
from swimbladder.io.cast_variables import by_flags, in_unit, raw_cast, unit_said
from swimbladder.io.netcdf_in import Variable, read_variables

Array = NDArray[np.float64]
_FEWEST = 2


def netcdf_cast(
    data: bytes, path: Path, columns: Mapping[str, str], profile: int | None
) -> tuple[RawCast, int | None]:
    """Return the cast of a netCDF file as it stands there, and which of its ways is still asked
    for: None where `profile` has been used up by choosing a profile of the file.

    columns: as for texts, variable for column. Raises LogError.
    """
    variables = read_variables(data, path)
    if is_profiles(variables):
        return replace(argo_cast(variables, path, profile), unit_stated=True), None
    return _plain(variables, path, columns), profile


def _plain(variables: Mapping[str, Variable], path: Path, columns: Mapping[str, str]) -> RawCast:
    """Return the cast of a file whose variables have standard names, or names that say it."""
    report: list[str] = []
    check_names(columns, path)
    warm = _chosen("temperature_degC", variables, columns, path)
    size = None if warm is None else variables[warm[0]].values.size
    chosen = {name: _chosen(name, variables, columns, path, size) for name in CAST_COLUMNS}
    values: dict[str, Array] = {}
    for name, found in chosen.items():
        if found is None:
            continue
        variable, unit = found
        values[name] = in_unit(name, variable, variables[variable], path, report, unit)
        by_flags(variable, variables, values[name], path, report)
    rows = {n: np.ravel(v) for n, v in values.items() if v.size == size}
    if size is not None and not {"pressure_dbar", "depth_m"} & set(rows):
        _refuse_grid(values, path)
    missing = [
        what
        for names, what in (
            (("pressure_dbar", "depth_m"), "sea_water_pressure or depth"),
            (("temperature_degC",), "sea_water_temperature"),
        )
        if not any(name in rows for name in names)
    ]
    if missing or size is None or size < _FEWEST:
        raise LogError(
            f"no variable has the standard name {' or '.join(missing) or 'of a profile'}, one "
            "value per sample",
            file=path, field="variables",
            remedy='Say which it is with --column "pressure_dbar=NAME"; variables of the file: '
            f"{', '.join(list(variables)[:30])}",
        )  # fmt: skip
    place = {
        n: place_of(n, np.ravel(values[n]), report)
        for n in ("latitude", "longitude")
        if n in values
    }
    names = {name: found[0] for name, found in chosen.items() if found is not None}
    down = chosen["pressure_dbar"]
    said = down and unit_said("pressure_dbar", down[0], variables[down[0]], down[1])
    return raw_cast(
        rows, path, report, latitude=place.get("latitude"), longitude=place.get("longitude"),
        names=names, unit_named=said,
    )  # fmt: skip


def _refuse_grid(values: Mapping[str, Array], path: Path) -> None:
    """Raise LogError where temperatures are a grid over depth and something else."""
    shape = values["temperature_degC"].shape
    down = next((n for n in ("pressure_dbar", "depth_m") if n in values), None)
    if down is not None and len(shape) > 1 and values[down].size in shape:
        raise LogError(
            f"the temperatures are a grid of {' x '.join(map(str, shape))} values over "
            f"{values[down].size} of {down.split('_')[0]}: several profiles side by side",
            file=path, field=down, remedy="Write the profile that you mean to a CSV",
        )  # fmt: skip


def _chosen(
    name: str, variables: Mapping[str, Variable], columns: Mapping[str, str], path: Path,
    size: int | None = None,
) -> tuple[str, str | None] | None:  # fmt: skip
    """Return the variable of a column, and its unit where that is stated.

    As mapped, else by standard name, else by its own name; of several, those with as many values
    as there are temperatures, `size`, come first: gliders log on several clocks.
    """
    if name in columns:
        asked, at, unit = columns[name], "", ""
        if asked not in variables:
            asked, at, unit = asked.rpartition("@")
            asked = asked or columns[name]
        if asked in variables:
            return asked, unit if at else None
        raise LogError(
            "no such variable", file=path, field=name, value=asked,
            remedy=f"Variables of the file: {', '.join(list(variables)[:30])}",
        )  # fmt: skip
    numeric = {n: v for n, v in variables.items() if v.numeric}
    named = [n for n, v in numeric.items() if v.attributes.get("standard_name") in NAMES[name]]
    named = named or [n for n in numeric if (kind_of(n) or ("",))[0] == name]
    if len(named) <= 1 or name in ("latitude", "longitude"):
        return (named[0], None) if named else None
    alike = [n for n in named if variables[n].values.size == size]
    if alike and len(alike) < len(named):
        named = alike
    plain = [n for n in named if n.lower() in NAMES[name]] if len(named) > 1 else named
    if len(plain) == 1:
        return plain[0], None
    raise LogError(
        f"several variables may be the {name.split('_')[0]}", file=path, field=name,
        value=", ".join(named), remedy=f'Choose one with --column "{name}=NAME"',
    )  # fmt: skip
