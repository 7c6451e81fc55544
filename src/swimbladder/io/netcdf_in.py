"""Variables of a netCDF file from its bytes: netCDF-3 by SciPy, netCDF-4 by h5py."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError

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


def read_variables(data: bytes, path: str | Path) -> dict[str, Variable]:
    """Return the variables of a netCDF file by name.

    Raises LogError where the bytes are damaged.
    """
    try:
        return _classic(data) if data.startswith(b"CDF") else _hdf(data)
    except Exception as error:  # whatever a decoder makes of damaged bytes, it is the bytes
        raise LogError(
            f"this netCDF file cannot be read: {' '.join(str(error).split())[:200]}",
            file=path, field="file", remedy="Fetch it anew, or write its variables to a CSV",
        ) from None  # fmt: skip


def _classic(data: bytes) -> dict[str, Variable]:
    from scipy.io import netcdf_file

    file: Any  # its variables have attributes that the stubs do not know
    with netcdf_file(io.BytesIO(data), "r", mmap=False) as file:
        return {
            str(name): _variable(np.array(v.data), dict(v._attributes))
            for name, v in file.variables.items()
        }


def _hdf(data: bytes) -> dict[str, Variable]:
    import h5py

    found = {}
    with h5py.File(io.BytesIO(data), "r") as file:
        for name, item in file.items():
            if not isinstance(item, h5py.Dataset):
                continue
            attributes = {k: v for k, v in item.attrs.items() if k not in _HDF_ONLY}
            if not _text(item.attrs.get("NAME", "")).startswith(_NO_VARIABLE):
                found[str(name)] = _variable(np.asarray(item[...]), attributes)
    return found


def _variable(raw: NDArray[Any], attributes: Mapping[str, Any]) -> Variable:
    said = {str(name): _text(value) for name, value in attributes.items()}
    if raw.dtype.kind in "SUO":
        return Variable(values=_texts(raw), attributes=said)
    values = raw.astype(np.float64)
    for name in ("_FillValue", "missing_value"):
        if name in attributes:
            # as the file has it: 99999 in float32 is 99999 in float64
            values[np.isin(raw, np.asarray(attributes[name]).astype(raw.dtype))] = np.nan
    if attributes.get("scale_factor") is not None:
        values = values * float(np.ravel(attributes["scale_factor"])[0])
    if attributes.get("add_offset") is not None:
        values = values + float(np.ravel(attributes["add_offset"])[0])
    values[~np.isfinite(values)] = np.nan
    return Variable(values=values, attributes=said)


def _text(value: object) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace").strip("\0 ")
    return str(value).strip()


def _texts(raw: NDArray[Any]) -> NDArray[np.str_]:
    """Return texts; single characters, as netCDF-3 has them, joined along the last dimension."""
    flat = [_text(item) if not isinstance(item, bytes) else item.decode("latin-1") for item in
            np.ravel(raw)]  # fmt: skip
    texts: NDArray[np.str_] = np.array(flat, dtype=np.str_).reshape(raw.shape)
    if raw.ndim and raw.dtype.itemsize == 1 and raw.dtype.kind == "S":
        rows = texts.reshape(-1, texts.shape[-1]) if texts.size else texts.reshape(0, 1)
        joined = np.array(["".join(c or "\0" for c in row) for row in rows], dtype=np.str_)
        return joined.reshape(raw.shape[:-1])
    return texts
