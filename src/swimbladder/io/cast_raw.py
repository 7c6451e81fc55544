"""A cast as it stands in a file: arrays in the units of `CAST_COLUMNS`, rows in its order."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.log_text import counted

Array = NDArray[np.float64]
_FARTHEST = {"latitude": 90.0, "longitude": 360.0}  # degrees


def place_of(name: str, values: Array, report: list[str]) -> float | None:
    """Return the mean latitude or longitude of a file [degrees]; None where it has none.

    Positions that are none, as where a receiver had no fix, are left out and said.
    """
    known = values[np.isfinite(values)]
    real = known[np.abs(known) <= _FARTHEST[name]]
    if len(real) < len(known):
        report.append(
            f"{counted(len(known) - len(real), name)} beyond {_FARTHEST[name]:g} degrees left out"
        )
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

    def at(self, k: int) -> str:
        """Return where row k stands: "line 12"."""
        return f"{self.row_name} {self.row[k]}"

    def only(self, kept: NDArray[np.bool_] | NDArray[np.int64]) -> RawCast:
        """Return the cast with the rows `kept`, a mask or an order."""
        names = ("temperature", "pressure", "depth", "salinity", "conductivity", "density")
        chosen: dict[str, Any] = {}
        for name in names:
            values = getattr(self, name)
            chosen[name] = None if values is None else values[kept]
        return replace(self, row=self.row[kept], **chosen)

    def refused(
        self, what: str, *, field: str, k: int | None = None, value: object = None,
        unit: str | None = None, remedy: str,
    ) -> LogError:  # fmt: skip
        """Return the error about row k, or about the whole."""
        line = int(self.row[k]) if k is not None and self.row_name == "line" else None
        if k is not None and line is None:
            what = f"{self.at(k)}: {what}"
        return LogError(
            what, file=self.path, line=line, field=field, value=value, unit=unit, remedy=remedy
        )
