"""The variables of a netCDF file as columns of a cast: in their units, and by their flags."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError, LogError
from swimbladder.io.cast_columns import CAST_COLUMNS, cast_unit, kind_of
from swimbladder.io.cast_raw import RawCast
from swimbladder.io.log_text import counted
from swimbladder.io.netcdf_in import Variable
from swimbladder.units import unit_factor

Array = NDArray[np.float64]
_GOOD = set("1258")  # Argo user's manual, reference table 2
_UNJUDGED = set("09")  # no quality control, and missing: NaN shows the second


def unit_said(name: str, found: str, variable: Variable, stated: str | None = None) -> str | None:
    """Return the unit of a variable that is the column `name`: as stated, by its attribute, or by
    its name as that of a CSV's column; None where nothing says one.
    """
    said = variable.attributes.get("units", "") if stated is None else stated
    if said:
        return cast_unit(said)
    kind = kind_of(found)
    return kind[1] if kind is not None and kind[0] == name else None


def in_unit(
    name: str, found: str, variable: Variable, path: Path, report: list[str],
    stated: str | None = None,
) -> Array:  # fmt: skip
    """Return the numbers of a variable in the unit of the column; `stated` is over its own.

    report: gets a line of what was done. Raises LogError for texts and units of another kind.
    """
    if not variable.numeric:
        raise LogError(
            "no numbers but texts", file=path, field=found,
            remedy=f'Choose another variable with --column "{name}=NAME"',
        )  # fmt: skip
    values = np.asarray(variable.values, dtype=np.float64)
    unit, wanted = unit_said(name, found, variable, stated), CAST_COLUMNS[name]
    if unit == "K" and wanted == "degC":
        report.append(f"{found} is in kelvin; 273.15 subtracted")
        return values - 273.15
    if unit is None:
        report.append(f"{name} read from {found}, which has no unit: taken to be {wanted or 'one'}")
        return values
    try:
        factor = unit_factor(unit, wanted)
    except InputError as error:
        raise LogError(
            error.what, file=path, field=found, value=unit, unit=wanted or "none",
            remedy="Correct the variable's attribute `units`"
            + (f', or say the unit with --column "{name}={found}@{wanted}"' if wanted else ""),
        ) from None  # fmt: skip
    report.append(f"{name} read from {found}" + ("" if factor == 1.0 else f", times {factor:g}"))
    return values * factor


def by_flags(
    found: str, variables: Mapping[str, Variable], values: Array, path: Path, report: list[str]
) -> None:
    """Blank the values that their quality flags do not call good.

    Raises LogError for flags that are not one for each value.
    """
    named = next((n for n in (f"{found}_QC", f"{found}_qc") if n in variables), None)
    if named is None:
        return
    texts = _flag_texts(variables[named], values.shape)
    if texts is None:
        raise LogError(
            f"not one quality flag for each value of {found}", file=path, field=named,
            remedy="Give the flags the shape of the values, or write what is good to a CSV",
        )  # fmt: skip
    bad = np.isfinite(values) & ~np.isin(texts, list(_GOOD | _UNJUDGED))
    if bad.any():
        report.append(f"{counted(int(bad.sum()), 'value')} of {found} flagged as bad left out")
        values[bad] = np.nan


def _flag_texts(flags: Variable, shape: tuple[int, ...]) -> NDArray[np.str_] | None:
    """Return a flag for each value: numbers as digits, strings of flags taken apart."""
    if flags.numeric:
        digits = np.nan_to_num(flags.values, nan=9.0).astype(int).astype(np.str_)
        return digits if digits.shape == shape else None
    if flags.values.shape == shape:  # a text for each, as xarray writes them
        return np.array([str(text)[:1] for text in np.ravel(flags.values)]).reshape(shape)
    letters = np.array([list(str(row).ljust(shape[-1])[: shape[-1]]) for row in
                        np.ravel(flags.values)], dtype=np.str_)  # fmt: skip
    return letters.reshape(shape) if letters.size == np.prod(shape) else None


def raw_cast(
    rows: Mapping[str, Array], path: Path, report: list[str], *, latitude: float | None = None,
    longitude: float | None = None, name: str = "", names: Mapping[str, str] | None = None,
    unit_named: str | None = None,
) -> RawCast:  # fmt: skip
    """Return the columns of a profile, each [n], as a cast as it stands in its file.

    names: of the variables, by column; unit_named: that of pressure, where the file says one.
    """
    count = len(rows["temperature_degC"])
    return RawCast(
        path=path, pressure=rows.get("pressure_dbar"), depth=rows.get("depth_m"),
        temperature=rows["temperature_degC"], salinity=rows.get("salinity"),
        conductivity=rows.get("conductivity_S_m"), density=rows.get("density_kg_m3"),
        row=np.arange(1, count + 1), row_name="sample", latitude=latitude,
        longitude=longitude, name=name, report=report, names=dict(names or {}),
        unit_named=unit_named,
    )  # fmt: skip
