"""The pump's runs in a Seaglider's dives: netCDF, a file a dive, as its base station writes them.

Each motor event has its seconds (negative: the valve's), volts, amps and depth, and what two
potentiometers of the piston read before and after. Their mean times VBD_CNV [cm3] is the volume.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import gsw
import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.cast_netcdf import NetCDF
from swimbladder.io.log_text import LogFile, read_bytes

Array = NDArray[np.float64]
_NEEDED = ("gc_vbd_secs", "gc_vbd_volts", "gc_vbd_i", "gc_depth")
_MEASURED = ("gc_vbd_pot1_ad", "gc_vbd_pot2_ad")
_MOTOR = 0.05  # A, less is no motor: a valve was opened
_LATITUDE = 30.0  # degrees, where the file has none: 0.3 % of a pressure at most


class Events(NamedTuple):
    """Runs of the pump among motor events [n], by what each is in SI."""

    duration: Array  # s
    pressure: Array  # Pa
    volts: Array  # V
    amps: Array  # A
    volume: Array  # m3, NaN where it is not known
    time: Array  # s, since 1970

    @classmethod
    def of(cls, events: Mapping[str, Array], volume_per_count: float, latitude: float) -> "Events":
        """Return the pump's runs among events by the base station's names, in their order.

        volume_per_count: VBD_CNV [cm3]; latitude [degrees].
        """
        seconds, amps = events["gc_vbd_secs"], events["gc_vbd_i"]
        nothing = np.full(len(seconds), np.nan)
        known = [name for name in _MEASURED if {name, f"{name}_start"} <= events.keys()]
        moves = [events[name] - events[f"{name}_start"] for name in known]
        volume = 1e-6 * volume_per_count * np.mean(moves, axis=0) if moves else nothing
        pressure = 1e4 * np.asarray(gsw.p_from_z(-events["gc_depth"], latitude))
        runs = (seconds > 0.0) & (amps > _MOTOR) & ~(volume <= 0.0)
        time = events.get("gc_st_secs", nothing)
        columns = (seconds, pressure, events["gc_vbd_volts"], amps, volume, time)
        return cls(*(column[runs] for column in columns))


def read_events(path: str | Path, file: LogFile) -> tuple[Events, float]:
    """Return the pump's runs of a dive, and its number (NaN: the file has none).

    Raises LogError where the file is damaged or is no Seaglider's dive.
    """
    variables = NetCDF(read_bytes(path), file).variables
    missing = [name for name in _NEEDED if name not in variables]
    if missing:
        raise _no_glider(file, missing)
    numeric = {name: v.values for name, v in variables.items() if v.numeric}
    values = {name: np.ravel(np.asarray(v, np.float64)) for name, v in numeric.items()}

    def number(name: str, otherwise: float = np.nan) -> float:
        found = values.get(name, np.empty(0))
        known = found.size == 1 and np.isfinite(found[0])
        return float(found[0]) if known else otherwise

    per_count = number("log_VBD_CNV")
    if np.isnan(per_count):
        file.report.append("volumes are not known: the file has no log_VBD_CNV")
    latitude = number("avg_latitude", _LATITUDE)
    return Events.of(values, per_count, latitude), number("log_DIVE")


def _no_glider(file: LogFile, missing: list[str]) -> LogError:
    what = f"this netCDF file has no motor events of a Seaglider: {', '.join(missing)}"
    remedy = "Give the file of a dive from its base station, or a CSV with a row a run"
    return file.refused(what, remedy, missing[0])
