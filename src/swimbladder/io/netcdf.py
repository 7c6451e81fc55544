"""netCDF files in and out; what they, and zarr stores, say of their numbers by CF's conventions.

Of numbers with quality flags those are read that are good (Argo user's manual, reference table 2:
1 good, 2 probably good, 5 changed, 8 interpolated). Written units are as UDUNITS reads them;
standard names are those of CF's table. The numbers of a dataset are as the file has them:
`xarray.decode_cf` makes dates of its times.
"""

from __future__ import annotations

import datetime
import io
import warnings
from collections.abc import Iterable, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.columns import plain_unit
from swimbladder.io.files import write_through
from swimbladder.io.log_text import LogFile, counted
from swimbladder.physics.arrays import Array

if TYPE_CHECKING:
    import xarray as xr

UNDATED = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
"""What times count from where the user has not said when a run begins."""

_PACKED: dict[str, Any] = {"zlib": True, "complevel": 1}

Variable = tuple[Any, Any, dict[str, Any]]
"""The dimensions of a variable, its values, and its attributes."""


def meaning(units: str, long_name: str, standard_name: str = "", **more: Any) -> dict[str, Any]:
    """Return the attributes of a variable; without units where its numbers stand for words."""
    said = {"units": units, "long_name": long_name, "standard_name": standard_name}
    return {name: text for name, text in said.items() if text} | more


def of_type(about: Mapping[str, Any], kind: Any) -> dict[str, Any]:
    """Return attributes of a variable for numbers of this type.

    Where the numbers stand for words, `flag_meanings`, the first for 0, they are listed.
    """
    words = about.get("flag_meanings", "").split()
    listed = {"flag_values": np.arange(len(words))} if words else {}
    typed = {"flag_values", "valid_min", "valid_max", "valid_range", "_FillValue"}
    said = {**about, **listed}
    return {k: np.asarray(v, kind)[()] if k in typed else v for k, v in said.items()}


def time_since(moment: datetime.datetime, long_name: str, **more: Any) -> dict[str, Any]:
    """Return the attributes of times that count from a moment, in seconds."""
    since = moment.astimezone(datetime.UTC).isoformat().replace("+00:00", "Z")
    said = {"calendar": "standard", "units_metadata": "leap_seconds: none", **more}
    return meaning(f"seconds since {since}", long_name, "time", **said)


def unless_dated(begin: datetime.datetime | None) -> dict[str, str]:
    """Return what the times of a run say where the user has not said when it begins."""
    said = f"The date is arbitrary, none was given: the run begins on {UNDATED:%Y-%m-%d}"
    return {} if begin else {"comment": said}


def described(title: str, **more: Any) -> dict[str, Any]:
    """Return the attributes of a file; none is of the time at which it was written."""
    source = f"swimbladder {version('swimbladder')}"
    said = {"Conventions": "CF-1.11", "title": title, "source": source}
    return said | {"history": f"written by {source}"} | more


def cf_dataset(
    variables: Mapping[str, Variable], attributes: Mapping[str, Any], *, coordinates: Iterable[str]
) -> xr.Dataset:
    """Return a dataset that follows CF, also where its user writes it.

    coordinates: which variables are. What stands where one has no value is its attribute
    `_FillValue`, else nan.
    """
    import xarray

    data = {name: xarray.Variable(*said) for name, said in variables.items()}
    for name, variable in data.items():
        variable.attrs = of_type(variable.attrs, variable.dtype)
        if variable.ndim:
            variable.encoding |= _PACKED
        if name in coordinates or "_FillValue" in variable.attrs:
            variable.encoding["_FillValue"] = variable.attrs.pop("_FillValue", None)
    found = xarray.Dataset(data, attrs=attributes)
    return found.set_coords(coordinates)


def write_netcdf(path: str | Path, dataset: xr.Dataset) -> Path:
    """Write a dataset as a netCDF-4 file and return the path.

    Raises InputError where the file cannot be written.
    """
    return write_through(path, partial(dataset.to_netcdf, engine="h5netcdf"))


_GOOD = "1258"
_UNJUDGED = "09"  # no quality control, and missing: NaN shows the second


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


class NetCDF:
    """A netCDF file that is read; what is done with its variables is reported.

    numbers: variables by name, NaN where they have none; words: those of texts; attributes: of all.
    """

    def __init__(self, data: bytes, file: LogFile) -> None:
        """Read the variables; raises LogError where the bytes are damaged."""
        import h5py
        import xarray as xr

        self.file, self.attributes = file, dict[str, dict[str, str]]()
        self.numbers, self.words = dict[str, Array](), dict[str, NDArray[np.str_]]()
        options = dict.fromkeys(("decode_times", "decode_timedelta", "decode_coords"), False)
        how: dict[str, Any] = {"engine": "scipy", **options}
        if not data.startswith(b"CDF"):
            how |= {"engine": "h5netcdf", "phony_dims": "access"}
        try:
            if not data.startswith(b"CDF"):
                with h5py.File(io.BytesIO(data), "r") as probe:
                    probe.attrs.get("_nc3_strict")  # where it fails it prints that
            with (
                warnings.catch_warnings(action="ignore"),  # of contradictory attributes
                xr.open_dataset(io.BytesIO(data), **how) as found,
            ):
                for name, one in found.variables.items():
                    self._keep(str(name), one.values, one.attrs)
        except Exception as error:  # whatever a decoder makes of damaged bytes, it is the bytes
            what = f"this netCDF file cannot be read: {' '.join(str(error).split())[:200]}"
            remedy = "Fetch it anew, or write its variables to a CSV"
            raise file.refused(what, remedy, "file") from None

    def _keep(self, name: str, values: NDArray[Any], attributes: Mapping[Any, Any]) -> None:
        said = {str(key): _text(value).strip("\0 ") for key, value in attributes.items()}
        self.attributes[name] = said
        if values.dtype.kind in "SUO":
            words = np.array([_text(item) for item in np.ravel(values)], dtype=np.str_)
            self.words[name] = words.reshape(values.shape)
        else:
            numbers = values.astype(np.float64)
            self.numbers[name] = np.where(np.isfinite(numbers), numbers, np.nan)

    def texts(self, name: str) -> list[str]:
        """Return the texts of a variable; none where it has numbers or there is none."""
        return [str(text) for text in np.ravel(self.words.get(name, np.zeros(0, np.str_)))]

    def refuse_unless(self, kind: str, remedy: str) -> None:
        """Raise LogError where an Argo file's DATA_TYPE is not `kind` (reference table 1)."""
        said = " ".join(self.texts("DATA_TYPE")).strip("\0 ")
        if said != kind:
            what = f"this netCDF file is none of the type {kind}"
            raise self.file.refused(what, remedy, "DATA_TYPE", value=said or "nothing")

    def unit(self, name: str) -> str:
        """Return the unit of a variable by its attribute, "" where it has none."""
        return plain_unit(self.attributes[name].get("units", ""))

    def good(self, name: str) -> Array:
        """Return the numbers of a variable, NaN for those that are flagged as bad, which is said.

        Raises LogError for flags that are not one for each value.
        """
        values = self.numbers[name].copy()
        named = next((n for n in (f"{name}_QC", f"{name}_qc") if n in self.attributes), None)
        if named is not None:
            good = np.isin(self.flags(named, name, values.shape), [*_GOOD, *_UNJUDGED])
            if bad := int((np.isfinite(values) & ~good).sum()):
                said = f"{counted(bad, 'value')} of {name} flagged as bad left out"
                self.file.report.append(said)
            values[~good] = np.nan
        return values

    def flags(self, named: str, found: str, shape: tuple[int, ...]) -> NDArray[np.str_]:
        """Return a flag for each value of `found`, from numbers, letters or strings of them.

        Raises LogError where there are not as many.
        """
        if named in self.numbers:
            texts = np.nan_to_num(self.numbers[named], nan=9.0).astype(int).astype(np.str_)
        elif self.words[named].shape == shape:  # a text for each, as xarray writes them
            texts = self.words[named].astype("U1")
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
