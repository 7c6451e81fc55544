"""The pump's runs in a Seaglider's dives: netCDF, a file a dive, as its base station writes them.

Each motor event has its seconds (negative: the valve's), volts, amps and depth, and what two
potentiometers of the piston read before and after. Their mean times VBD_CNV [cm3] is the volume.
"""

from collections.abc import Mapping
from pathlib import Path

import gsw
import numpy as np
from numpy.typing import NDArray

from swimbladder.io.log_text import LogFile, read_bytes
from swimbladder.io.netcdf import NetCDF
from swimbladder.io.pump_runs import PumpRuns

Array = NDArray[np.float64]
_NEEDED = ("gc_vbd_secs", "gc_vbd_volts", "gc_vbd_i", "gc_depth")
_MEASURED = ("gc_vbd_pot1_ad", "gc_vbd_pot2_ad")
_MOTOR = 0.05  # A, less is no motor: a valve was opened
_LATITUDE = 30.0  # degrees, where the file has none: 0.3 % of a pressure at most


def moved(events: Mapping[str, Array], volume_per_count: float | Array) -> Array:
    """Return what each event has pressed out [m3] [n], below 0 let in; NaN where nothing says it.

    events: by the base station's names; volume_per_count: VBD_CNV [cm3].
    """
    known = [name for name in _MEASURED if {name, f"{name}_start"} <= {*events}]
    if not known:
        return np.full(len(events["gc_vbd_secs"]), np.nan)
    moves = [events[name] - events[f"{name}_start"] for name in known]
    return np.asarray(1e-6 * volume_per_count * np.mean(moves, axis=0))


def pressures(events: Mapping[str, Array], latitude: float | Array) -> Array:
    """Return the pressure at each event [Pa] [n]; latitude [degrees]."""
    return 1e4 * np.asarray(gsw.p_from_z(-np.asarray(events["gc_depth"]), latitude))


def runs_of_events(
    events: Mapping[str, Array], volume_per_count: float, latitude: float, dive: float
) -> PumpRuns:
    """Return the pump's runs among the motor events of a dive [n], in their order.

    events: by the base station's names. volume_per_count: VBD_CNV [cm3], NaN where it is not known;
    latitude [degrees]; dive: its number, NaN where it has none.
    """
    seconds, amps = events["gc_vbd_secs"], events["gc_vbd_i"]
    volume = moved(events, volume_per_count)
    runs = (seconds > 0.0) & (amps > _MOTOR) & ~(volume <= 0.0)
    volts, volume = events["gc_vbd_volts"][runs], volume[runs]
    return PumpRuns(
        duration=seconds[runs],
        pressure=pressures(events, latitude)[runs],
        power=volts * amps[runs],
        volume=volume if np.isfinite(volume).any() else None,
        dive=None if np.isnan(dive) else np.full(len(volts), dive),
        voltage=volts,
        time=events.get("gc_st_secs", np.full(len(seconds), np.nan))[runs],
    )


def read_dive(path: str | Path, file: LogFile) -> PumpRuns:
    """Return the pump's runs of a dive.

    Raises LogError where the file is damaged or is no Seaglider's dive.
    """
    variables = NetCDF(read_bytes(path), file).variables
    missing = [name for name in _NEEDED if name not in variables]
    if missing:
        what = f"this netCDF file has no motor events of a Seaglider: {', '.join(missing)}"
        remedy = "Give the file of a dive from its base station, or a CSV with a row a run"
        raise file.refused(what, remedy, missing[0])
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
    return runs_of_events(values, per_count, latitude, number("log_DIVE"))
