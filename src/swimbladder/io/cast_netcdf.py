"""A cast in a netCDF file: CF and OG1 by standard name; and Argo's profile files.

Of Argo's the adjusted values are taken where there are any, and in the modes A and D no others; of
each sample only what its quality flags call good (Argo user's manual, reference table 2: 1 good, 2
probably good, 5 changed, 8 interpolated).

Variables become columns in their units, and by their flags. netCDF-3 is read by SciPy, netCDF-4 by
h5py.
"""

import io
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.io.cast_columns import (
    CAST_COLUMNS,
    NAMES,
    RawCast,
    cast_unit,
    check_names,
    kind_of,
    raw_cast,
)
from swimbladder.io.log_text import LogFile, counted
from swimbladder.units import unit_factor

Array = NDArray[np.float64]


# What netCDF-4 keeps for itself: references to dimensions, and dimensions that hold no numbers.
_HDF_ONLY = ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "_Netcdf4Dimid", "_Netcdf4Coordinates")
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"


@dataclass(frozen=True, kw_only=True)
class Variable:
    """A variable: numbers with NaN where it has none, or texts, and its attributes as texts."""

    values: Array | NDArray[np.str_]
    attributes: Mapping[str, str]

    @property
    def numeric(self) -> bool:
        """Whether it holds numbers."""
        return self.values.dtype.kind == "f"


def is_netcdf(data: bytes) -> bool:
    """Say whether bytes are those of a netCDF file."""
    return data.startswith((b"CDF\x01", b"CDF\x02", b"\x89HDF\r\n\x1a\n"))


def read_variables(data: bytes, file: LogFile) -> dict[str, Variable]:
    """Return the variables of a netCDF file by name.

    Raises LogError where the bytes are damaged.
    """
    try:
        found = _classic(data) if data.startswith(b"CDF") else _hdf(data)
        with warnings.catch_warnings(action="ignore"):  # of attributes that contradict each other
            return {name: _variable(name, *item) for name, item in found}
    except Exception as error:  # whatever a decoder makes of damaged bytes, it is the bytes
        what = f"this netCDF file cannot be read: {' '.join(str(error).split())[:200]}"
        raise file.refused(what, "Fetch it anew, or write its variables to a CSV", "file") from None


def _classic(data: bytes) -> Iterator[tuple[str, tuple[NDArray[Any], dict[str, Any]]]]:
    from scipy.io import netcdf_file

    file: Any  # its variables have attributes that the stubs do not know
    with netcdf_file(io.BytesIO(data), "r", mmap=False) as file:
        for name, item in file.variables.items():
            yield str(name), (np.array(item.data), dict(item._attributes))


def _hdf(data: bytes) -> Iterator[tuple[str, tuple[NDArray[Any], dict[str, Any]]]]:
    import h5py

    with h5py.File(io.BytesIO(data), "r") as file:
        for name, item in file.items():
            if isinstance(item, h5py.Dataset):
                said = {k: v for k, v in item.attrs.items() if k not in _HDF_ONLY}
                if not _text(item.attrs.get("NAME", "")).startswith(_NO_VARIABLE):
                    yield str(name), (np.asarray(item[...]), said)


def _variable(name: str, raw: NDArray[Any], attributes: Mapping[str, Any]) -> Variable:
    """Return a variable decoded by the conventions: its fill values, scale and characters."""
    import xarray as xr

    plain = {key: v[0] if np.shape(v) == (1,) else v for key, v in attributes.items()}
    coded = xr.Variable([f"{name} {k}" for k in range(raw.ndim)], raw, plain)
    found = xr.conventions.decode_cf_variable(name, coded, decode_times=False).values
    said = {key: _text(value).strip("\0 ") for key, value in plain.items()}
    if found.dtype.kind in "SUO":
        texts = np.array([_text(item) for item in np.ravel(found)], dtype=np.str_)
        return Variable(values=texts.reshape(found.shape), attributes=said)
    values = found.astype(np.float64)
    values[~np.isfinite(values)] = np.nan
    return Variable(values=values, attributes=said)


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


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
    name: str, found: str, variable: Variable, file: LogFile, stated: str | None = None
) -> Array:
    """Return the numbers of a variable in the unit of the column; `stated` is over its own.

    What was done is reported. Raises LogError for texts and units of another kind.
    """
    report = file.report
    if not variable.numeric:
        what = "no numbers but texts"
        raise file.refused(what, f'Choose another variable with --column "{name}=NAME"', found)
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
        remedy = "Correct the variable's attribute `units`" + (
            f', or say the unit with --column "{name}={found}@{wanted}"' if wanted else ""
        )
        raise file.refused(error.what, remedy, found, value=unit, unit=wanted or "none") from None
    report.append(f"{name} read from {found}" + ("" if factor == 1.0 else f", times {factor:g}"))
    return values * factor


def by_flags(found: str, variables: Mapping[str, Variable], values: Array, file: LogFile) -> None:
    """Blank the values that their quality flags do not call good.

    Raises LogError for flags that are not one for each value.
    """
    named = next((n for n in (f"{found}_QC", f"{found}_qc") if n in variables), None)
    if named is None:
        return
    texts = _flag_texts(variables[named], values.shape)
    if texts is None:
        remedy = "Give the flags the shape of the values, or write what is good to a CSV"
        raise file.refused(f"not one quality flag for each value of {found}", remedy, named)
    bad = np.isfinite(values) & ~np.isin(texts, list(_GOOD | _UNJUDGED))
    if bad.any():
        file.report.append(f"{counted(int(bad.sum()), 'value')} of {found} flagged as bad left out")
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


_ARGO = {"pressure_dbar": "PRES", "temperature_degC": "TEMP", "salinity": "PSAL"}
_SHOWN = 4  # profiles, where there are too many


def is_profiles(variables: Mapping[str, Variable]) -> bool:
    """Say whether these are the variables of an Argo profile file."""
    return all(name in variables for name in ("PRES", "TEMP")) and (
        variables["PRES"].values.ndim == 2
    )


def argo_cast(variables: Mapping[str, Variable], file: LogFile, profile: int | None) -> RawCast:
    """Return one profile of an Argo file: the primary one, or that asked for from 1.

    Raises LogError where there are several to choose from, or none that is good.
    """
    n = _number(variables, file, profile)
    mode = _letters(variables, "DATA_MODE", n)
    rows: dict[str, Array] = {}
    for name, plain in _ARGO.items():
        if plain not in variables:
            continue
        found = plain
        adjusted = variables.get(f"{plain}_ADJUSTED")
        if adjusted is not None and np.isfinite(np.asarray(adjusted.values[n], float)).any():
            found = f"{plain}_ADJUSTED"
        elif adjusted is not None and mode in ("A", "D"):
            what = f"in mode {mode} no value of {plain} was found fit to be adjusted: none is good"
            remedy = "Take another profile; if you trust its raw values, write them to a CSV"
            raise file.refused(what, remedy, f"{plain}_ADJUSTED")
        values = in_unit(name, found, variables[found], file)
        if values.shape != variables["PRES"].values.shape:
            remedy = "Fetch the file anew: every profile has a value per level"
            raise file.refused("not as many values as pressures", remedy, found)
        by_flags(found, variables, values, file)
        rows[name] = values[n]
    for name in ("latitude", "longitude"):
        if name.upper() in variables:
            rows[name] = np.ravel(np.asarray(variables[name.upper()].values, float))[n : n + 1]
    return raw_cast(rows, file, name=_platform(variables, n))


def _number(variables: Mapping[str, Variable], file: LogFile, profile: int | None) -> int:
    """Return the profile that is asked for, from 0: else the only one, or only primary one.

    Raises LogError where there are several, or fewer than asked for.
    """
    pressures = np.asarray(variables["PRES"].values, float)
    count = len(pressures)
    if profile is not None and profile > count:
        what = f"the file has {counted(count, 'profile')}"
        raise file.refused(what, f"Choose from 1 to {count}", "--profile", value=profile)
    if profile is not None or count < 2:
        return (profile or 1) - 1
    held = [k for k in range(count) if np.isfinite(pressures[k]).any()]
    primary = [k for k in held if _scheme(variables, k).startswith("primary")]
    found = primary or held or [0]
    if len(found) > 1:
        some = ", ".join(
            f"{k + 1}: {f'{_platform(variables, k)} to'.strip()} {np.nanmax(pressures[k]):.0f} dbar"
            for k in found[:_SHOWN]
        )
        what = (
            f"there are {len(found)} profiles in it "
            f"({some}{', ...' if len(found) > _SHOWN else ''})"
        )
        raise file.refused(what, "Choose one with --profile N", "profile")
    why = "the primary sampling" if primary else "the only one with pressures"
    file.report.append(f"profile {found[0] + 1} of {count} taken, {why}")
    return found[0]


def _scheme(variables: Mapping[str, Variable], n: int) -> str:
    schemes = variables.get("VERTICAL_SAMPLING_SCHEME")
    texts = np.zeros(0) if schemes is None or schemes.numeric else np.ravel(schemes.values)
    return str(texts[n]).lower() if n < len(texts) else ""


def _letters(variables: Mapping[str, Variable], name: str, n: int) -> str:
    """Return the n-th letter of a variable of one for each profile; "" where there is none."""
    found = variables.get(name)
    letters = "" if found is None or found.numeric else "".join(map(str, np.ravel(found.values)))
    return letters[n : n + 1]


def _platform(variables: Mapping[str, Variable], n: int) -> str:
    number, cycle = variables.get("PLATFORM_NUMBER"), variables.get("CYCLE_NUMBER")
    parts = []
    if number is not None and not number.numeric:
        parts.append(f"float {str(np.ravel(number.values)[n]).strip(chr(0) + ' ')}")
    if cycle is not None and cycle.numeric and np.isfinite(np.ravel(cycle.values)[n]):
        parts.append(f"cycle {int(np.ravel(cycle.values)[n])}")
    return " ".join(parts)


def netcdf_cast(
    data: bytes, path: Path, columns: Mapping[str, str], profile: int | None
) -> tuple[RawCast, int | None]:
    """Return the cast of a netCDF file as it stands there, and which of its ways is still asked
    for: None where `profile` has been used up by choosing a profile of the file.

    columns: as for texts, variable for column. Raises LogError.
    """
    file = LogFile(path)
    variables = read_variables(data, file)
    if is_profiles(variables):
        return replace(argo_cast(variables, file, profile), unit_stated=True), None
    return _plain(variables, file, columns), profile


def _plain(variables: Mapping[str, Variable], file: LogFile, columns: Mapping[str, str]) -> RawCast:
    """Return the cast of a file whose variables have standard names, or names that say it."""
    check_names(columns, file)
    warm = _chosen("temperature_degC", variables, columns, file)
    size = None if warm is None else variables[warm[0]].values.size
    chosen = {name: _chosen(name, variables, columns, file, size) for name in CAST_COLUMNS}
    values: dict[str, Array] = {}
    for name, found in chosen.items():
        if found is None:
            continue
        variable, unit = found
        values[name] = in_unit(name, variable, variables[variable], file, unit)
        by_flags(variable, variables, values[name], file)
    rows = {n: np.ravel(v) for n, v in values.items() if v.size == size}
    if size is not None and not {"pressure_dbar", "depth_m"} & set(rows):
        _refuse_grid(values, file)
    missing = [
        what
        for names, what in (
            (("pressure_dbar", "depth_m"), "sea_water_pressure or depth"),
            (("temperature_degC",), "sea_water_temperature"),
        )
        if not any(name in rows for name in names)
    ]
    if missing or size is None or size < 2:
        what = (
            f"no variable has the standard name {' or '.join(missing) or 'of a profile'}, one "
            "value per sample"
        )
        remedy = (
            'Say which it is with --column "pressure_dbar=NAME"; variables of the file: '
            f"{', '.join(list(variables)[:30])}"
        )
        raise file.refused(what, remedy, "variables")
    rows |= {n: np.ravel(values[n]) for n in ("latitude", "longitude") if n in values}
    names = {name: found[0] for name, found in chosen.items() if found is not None}
    down = chosen["pressure_dbar"]
    said = down and unit_said("pressure_dbar", down[0], variables[down[0]], down[1])
    return raw_cast(rows, file, names=names, unit_named=said)


def _refuse_grid(values: Mapping[str, Array], file: LogFile) -> None:
    """Raise LogError where temperatures are a grid over depth and something else."""
    shape = values["temperature_degC"].shape
    down = next((n for n in ("pressure_dbar", "depth_m") if n in values), None)
    if down is not None and len(shape) > 1 and values[down].size in shape:
        what = (
            f"the temperatures are a grid of {' x '.join(map(str, shape))} values over "
            f"{values[down].size} of {down.split('_')[0]}: several profiles side by side"
        )
        raise file.refused(what, "Write the profile that you mean to a CSV", down)


def _chosen(
    name: str, variables: Mapping[str, Variable], columns: Mapping[str, str], file: LogFile,
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
        remedy = f"Variables of the file: {', '.join(list(variables)[:30])}"
        raise file.refused("no such variable", remedy, name, value=asked)
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
    what = f"several variables may be the {name.split('_')[0]}"
    remedy = f'Choose one with --column "{name}=NAME"'
    raise file.refused(what, remedy, name, value=", ".join(named))
