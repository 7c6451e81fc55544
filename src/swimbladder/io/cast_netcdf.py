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
_GOOD = set("1258")  # Argo user's manual, reference table 2
_UNJUDGED = set("09")  # no quality control, and missing: NaN shows the second
_ARGO = {"pressure_dbar": "PRES", "temperature_degC": "TEMP", "salinity": "PSAL"}
# What netCDF-4 keeps for itself: references to dimensions, and dimensions that hold no numbers.
_HDF_ONLY = ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "_Netcdf4Dimid", "_Netcdf4Coordinates")
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
_SHOWN = 4  # profiles, where there are too many


@dataclass(frozen=True, kw_only=True)
class Variable:
    """A variable: numbers with NaN where it has none, or texts, and its attributes as texts."""

    values: Array | NDArray[np.str_]
    attributes: Mapping[str, str]

    @property
    def numeric(self) -> bool:
        """Whether it holds numbers."""
        return self.values.dtype.kind == "f"


def netcdf_cast(
    data: bytes, path: Path, columns: Mapping[str, str], profile: int | None
) -> tuple[RawCast, int | None]:
    """Return the cast of a netCDF file as it stands there, and which of its ways is still asked
    for: None where `profile` has been used up by choosing a profile of the file.

    columns: as for texts, variable for column. Raises LogError.
    """
    found = NetCDF(data, LogFile(path))
    if found.is_profiles():
        return replace(found.argo_cast(profile), unit_stated=True), None
    return found.cast(columns), profile


def _classic(data: bytes) -> Iterator[tuple[str, NDArray[Any], dict[str, Any]]]:
    from scipy.io import netcdf_file

    file: Any  # its variables have attributes that the stubs do not know
    with netcdf_file(io.BytesIO(data), "r", mmap=False) as file:
        for name, item in file.variables.items():
            yield str(name), np.array(item.data), dict(item._attributes)


def _hdf(data: bytes) -> Iterator[tuple[str, NDArray[Any], dict[str, Any]]]:
    import h5py

    with h5py.File(io.BytesIO(data), "r") as file:
        for name, item in file.items():
            if isinstance(item, h5py.Dataset):
                said = {k: v for k, v in item.attrs.items() if k not in _HDF_ONLY}
                if not _text(item.attrs.get("NAME", "")).startswith(_NO_VARIABLE):
                    yield str(name), np.asarray(item[...]), said


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


class NetCDF:
    """The variables of a netCDF file by name; what is done with them is reported."""

    def __init__(self, data: bytes, file: LogFile) -> None:
        """Read the variables; raises LogError where the bytes are damaged."""
        self.file = file
        try:
            found = _classic(data) if data.startswith(b"CDF") else _hdf(data)
            with warnings.catch_warnings(action="ignore"):  # of contradictory attributes
                self.variables = {item[0]: _variable(*item) for item in found}
        except Exception as error:  # whatever a decoder makes of damaged bytes, it is the bytes
            what = f"this netCDF file cannot be read: {' '.join(str(error).split())[:200]}"
            remedy = "Fetch it anew, or write its variables to a CSV"
            raise file.refused(what, remedy, "file") from None

    def texts(self, name: str) -> list[str]:
        """Return the texts of a variable; none where it has numbers or there is none."""
        found = self.variables.get(name)
        return [] if found is None or found.numeric else [str(x) for x in np.ravel(found.values)]

    def refuse_unless(self, kind: str, remedy: str) -> None:
        """Raise LogError where an Argo file's DATA_TYPE is not `kind` (reference table 1)."""
        said = " ".join(self.texts("DATA_TYPE")).strip("\0 ")
        if said != kind:
            what = f"this netCDF file is none of the type {kind}"
            raise self.file.refused(what, remedy, "DATA_TYPE", value=said or "nothing")

    def unit(self, name: str, found: str, stated: str | None = None) -> str | None:
        """Return the unit of a variable that is the column `name`: as stated, by its attribute, or
        by its name as that of a CSV's column; None where nothing says one.
        """
        attributes = self.variables[found].attributes
        said = attributes.get("units", "") if stated is None else stated
        if said:
            return cast_unit(said)
        kind = kind_of(found)
        return kind[1] if kind is not None and kind[0] == name else None

    def values(self, name: str, found: str, stated: str | None = None) -> Array:
        """Return the numbers of a variable in the unit of the column, those that are flagged as
        bad left out; a unit that is `stated` is over its own.

        Raises LogError for texts, units of another kind and flags that are not one for each value.
        """
        report, variable = self.file.report, self.variables[found]
        if not variable.numeric:
            remedy = f'Choose another variable with --column "{name}=NAME"'
            raise self.file.refused("no numbers but texts", remedy, found)
        values = np.array(variable.values, dtype=np.float64)
        unit, wanted = self.unit(name, found, stated), CAST_COLUMNS[name]
        if unit == "K" and wanted == "degC":
            report.append(f"{found} is in kelvin; 273.15 subtracted")
            values -= 273.15
        elif unit is None:
            taken = f"taken to be {wanted or 'one'}"
            report.append(f"{name} read from {found}, which has no unit: {taken}")
        else:
            factor = self._factor(name, found, unit)
            times = "" if factor == 1.0 else f", times {factor:g}"
            report.append(f"{name} read from {found}{times}")
            values *= factor
        bad = np.isfinite(values) & self._flagged(found, values.shape)
        if bad.any():
            report.append(f"{counted(int(bad.sum()), 'value')} of {found} flagged as bad left out")
            values[bad] = np.nan
        return values

    def _factor(self, name: str, found: str, unit: str) -> float:
        wanted = CAST_COLUMNS[name]
        try:
            return unit_factor(unit, wanted)
        except InputError as error:
            remedy = "Correct the variable's attribute `units`"
            if wanted:
                remedy += f', or say the unit with --column "{name}={found}@{wanted}"'
            wanted = wanted or "none"
            raise self.file.refused(error.what, remedy, found, value=unit, unit=wanted) from None

    def _flagged(self, found: str, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """Return which values their quality flags call bad."""
        named = next((n for n in (f"{found}_QC", f"{found}_qc") if n in self.variables), None)
        if named is None:
            return np.zeros(shape, dtype=bool)
        return ~np.isin(self.flags(named, found, shape), list(_GOOD | _UNJUDGED))

    def flags(self, named: str, found: str, shape: tuple[int, ...]) -> NDArray[np.str_]:
        """Return a flag for each value of `found`, from numbers, letters or strings of them.

        Raises LogError where there are not as many.
        """
        flags = self.variables[named]
        if flags.numeric:
            texts = np.nan_to_num(flags.values, nan=9.0).astype(int).astype(np.str_)
        elif flags.values.shape == shape:  # a text for each, as xarray writes them
            texts = flags.values.astype("U1")
        else:
            size = shape[-1]
            rows = [list(text.ljust(size)[:size]) for text in self.texts(named)]
            texts = np.array(rows, dtype=np.str_)
            texts = texts.reshape(shape) if texts.size == np.prod(shape) else texts
        if texts.shape != shape:
            what = f"not one flag for each value of {found}"
            remedy = "Give the flags the shape of the values, or write what is good to a CSV"
            raise self.file.refused(what, remedy, named)
        return texts

    def is_profiles(self) -> bool:
        """Say whether these are the variables of an Argo profile file."""
        profiles = {"PRES", "TEMP"} <= set(self.variables)
        return profiles and self.variables["PRES"].values.ndim == 2

    def argo_cast(self, profile: int | None) -> RawCast:
        """Return one profile of an Argo file: the primary one, or that asked for from 1.

        Raises LogError where there are several to choose from, or none that is good.
        """
        n = self._profile(profile)
        mode = "".join(self.texts("DATA_MODE"))[n : n + 1]
        rows: dict[str, Array] = {}
        for name, plain in _ARGO.items():
            if plain not in self.variables:
                continue
            found, adjusted = plain, f"{plain}_ADJUSTED"
            if adjusted in self.variables:
                if np.isfinite(self._numbers(adjusted)[n]).any():
                    found = adjusted
                elif mode in ("A", "D"):
                    self._refuse_raw(plain, mode)
            if self.variables[found].values.shape != self.variables["PRES"].values.shape:
                remedy = "Fetch the file anew: every profile has a value per level"
                raise self.file.refused("not as many values as pressures", remedy, found)
            rows[name] = self.values(name, found)[n]
        for name in ("latitude", "longitude"):
            if name.upper() in self.variables:
                rows[name] = np.ravel(self._numbers(name.upper()))[n : n + 1]
        return raw_cast(rows, self.file, name=self._platform(n))

    def _refuse_raw(self, name: str, mode: str) -> None:
        what = f"in mode {mode} no value of {name} was found fit to be adjusted: none is good"
        remedy = "Take another profile; if you trust its raw values, write them to a CSV"
        raise self.file.refused(what, remedy, f"{name}_ADJUSTED")

    def _numbers(self, name: str) -> Array:
        return np.asarray(self.variables[name].values, dtype=np.float64)

    def _profile(self, profile: int | None) -> int:
        """Return the profile that is asked for, from 0: else the only one, or only primary one.

        Raises LogError where there are several, or fewer than asked for.
        """
        pressures = self._numbers("PRES")
        count = len(pressures)
        if profile is not None and profile > count:
            what = f"the file has {counted(count, 'profile')}"
            raise self.file.refused(what, f"Choose from 1 to {count}", "--profile", value=profile)
        if profile is not None or count < 2:
            return (profile or 1) - 1
        held = [k for k in range(count) if np.isfinite(pressures[k]).any()]
        schemes = dict(enumerate(self.texts("VERTICAL_SAMPLING_SCHEME")))
        primary = [k for k in held if schemes.get(k, "").lower().startswith("primary")]
        found = primary or held or [0]
        if len(found) > 1:
            some = ", ".join(
                f"{k + 1}: {f'{self._platform(k)} to'.strip()} {np.nanmax(pressures[k]):.0f} dbar"
                for k in found[:_SHOWN]
            )
            more = ", ..." if len(found) > _SHOWN else ""
            what = f"there are {len(found)} profiles in it ({some}{more})"
            raise self.file.refused(what, "Choose one with --profile N", "profile")
        why = "the primary sampling" if primary else "the only one with pressures"
        self.file.report.append(f"profile {found[0] + 1} of {count} taken, {why}")
        return found[0]

    def _platform(self, n: int) -> str:
        parts = [f"float {x.strip(chr(0) + ' ')}" for x in self.texts("PLATFORM_NUMBER")[n : n + 1]]
        cycle = self.variables.get("CYCLE_NUMBER")
        if cycle is not None and cycle.numeric and np.isfinite(np.ravel(cycle.values)[n]):
            parts.append(f"cycle {int(np.ravel(cycle.values)[n])}")
        return " ".join(parts)

    def cast(self, columns: Mapping[str, str]) -> RawCast:
        """Return the cast of a file whose variables have standard names, or names that say it.

        columns: variable for column. Raises LogError where a cast lacks one.
        """
        check_names(columns, self.file)
        warm = self._chosen("temperature_degC", columns)
        size = None if warm is None else self.variables[warm[0]].values.size
        found = {name: self._chosen(name, columns, size) for name in CAST_COLUMNS}
        chosen = {name: variable for name, variable in found.items() if variable is not None}
        values = {name: self.values(name, *variable) for name, variable in chosen.items()}
        rows = {name: np.ravel(v) for name, v in values.items() if v.size == size}
        missing = []
        if not {"pressure_dbar", "depth_m"} & set(rows):
            missing.append("sea_water_pressure or depth")
            if size is not None:
                self._refuse_grid(values)
        if "temperature_degC" not in rows:
            missing.append("sea_water_temperature")
        if missing or size is None or size < 2:
            wanted = " or ".join(missing) or "of a profile"
            what = f"no variable has the standard name {wanted}, one value per sample"
            remedy = 'Say which it is with --column "pressure_dbar=NAME"; variables of the file: '
            raise self.file.refused(what, remedy + self._listed(), "variables")
        rows |= {n: np.ravel(values[n]) for n in ("latitude", "longitude") if n in values}
        names = {name: variable for name, (variable, _) in chosen.items()}
        down = chosen.get("pressure_dbar")
        said = None if down is None else self.unit("pressure_dbar", *down)
        return raw_cast(rows, self.file, names=names, unit_named=said)

    def _listed(self) -> str:
        return ", ".join(list(self.variables)[:30])

    def _refuse_grid(self, values: Mapping[str, Array]) -> None:
        """Raise LogError where temperatures are a grid over depth and something else."""
        shape = values["temperature_degC"].shape
        down = next((n for n in ("pressure_dbar", "depth_m") if n in values), None)
        if down is not None and len(shape) > 1 and values[down].size in shape:
            grid = f"a grid of {' x '.join(map(str, shape))} values"
            over = f"{values[down].size} of {down.split('_')[0]}"
            what = f"the temperatures are {grid} over {over}: several profiles side by side"
            raise self.file.refused(what, "Write the profile that you mean to a CSV", down)

    def _chosen(
        self, name: str, columns: Mapping[str, str], size: int | None = None
    ) -> tuple[str, str | None] | None:
        """Return the variable of a column, and its unit where that is stated.

        As mapped, else by standard name, else by its own name; of several, those with as many
        values as there are temperatures, `size`, come first: gliders log on several clocks.
        """
        if name in columns:
            asked, at, unit = columns[name], "", ""
            if asked not in self.variables:
                asked, at, unit = asked.rpartition("@")
                asked = asked or columns[name]
            if asked in self.variables:
                return asked, unit if at else None
            remedy = f"Variables of the file: {self._listed()}"
            raise self.file.refused("no such variable", remedy, name, value=asked)
        numeric = {n: v for n, v in self.variables.items() if v.numeric}
        named = [n for n, v in numeric.items() if v.attributes.get("standard_name") in NAMES[name]]
        named = named or [n for n in numeric if (kind_of(n) or ("",))[0] == name]
        if len(named) <= 1 or name in ("latitude", "longitude"):
            return (named[0], None) if named else None
        named = [n for n in named if numeric[n].values.size == size] or named
        plain = [n for n in named if n.lower() in NAMES[name]] if len(named) > 1 else named
        if len(plain) == 1:
            return plain[0], None
        what = f"several variables may be the {name.split('_')[0]}"
        remedy = f'Choose one with --column "{name}=NAME"'
        raise self.file.refused(what, remedy, name, value=", ".join(named))
