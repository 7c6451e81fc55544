"""A mission as OG 1.0 netCDF, the format of the glider community.

The variables and attributes that OG 1.0.0 calls mandatory are all there (OG_Format-v1.0.0.adoc of
github.com/OceanGlidersCommunity/OG-format-user-manual), and the highly desirable ones that a
simulation can fill. What it has none of stands there empty: GPS fixes as fill values, quality flags
as "No QC has been applied", people, institutions and sensors as "not stated" or "none".
"""

from __future__ import annotations

import datetime
import tomllib
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from swimbladder.errors import InputError
from swimbladder.io.netcdf import UNDATED, cf_dataset, described, unless_dated
from swimbladder.sim.engine.rodas.records import Doing
from swimbladder.sim.mission.books import power_names
from swimbladder.sim.mission.export import created
from swimbladder.sim.mission.phase_laws import law_words
from swimbladder.sim.mission.result import MissionResult
from swimbladder.sim.mission.tables import trajectory_columns

if TYPE_CHECKING:
    import xarray as xr

# The phases of OG1 (vocabularyCollection/phase.md of OceanGlidersCommunity/OG-format-user-manual).
ASCENT, DESCENT, SURFACING, PARKING = 1, 2, 3, 4
_EDGE = 1e-9  # m: a row at which the hull comes through the surface is of the surface
_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_PLACED = ("TIME", "LATITUDE", "LONGITUDE", "DEPTH")
_AT = "N_MEASUREMENTS"
_Table = dict[str, Any]


@cache
def _said() -> dict[str, dict[str, Any]]:
    """Return what OG 1.0 says of a file and of each variable: its attributes."""
    text = resources.files(__package__).joinpath("og1.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def og1_dataset(
    result: MissionResult,
    *,
    begin: datetime.datetime | None = None,
    latitude: float | None = None,
    longitude: float | None = None,
) -> xr.Dataset:
    """Return a mission as a dataset in the terms of OG 1.0.

    begin: when it starts, with its time zone. latitude, longitude [degrees]: where the water was
    measured; a vertical model goes nowhere. Raises InputError where OG 1.0 has no such time.
    """
    moment = (begin or UNDATED).astimezone(datetime.UTC)
    start = og1_time(moment)
    north, east = (np.nan if angle is None else angle for angle in (latitude, longitude))
    stamp = f"{moment:%Y%m%dT%H%M%S}"
    values = _measured(result, start, north, east) | _own(result)
    about = {name: dict(_said()[name]) for name in values if name in _said()}
    for consumer, name in _consumers(result).items():
        power = _said()["POWER"]
        about[name] = power | {"long_name": f"{power['long_name']}: {consumer}"}
    about["TIME"] |= unless_dated(begin)
    for name in [name for name in values if "ancillary_variables" in about[name]]:
        values[f"{name}_QC"] = np.zeros(len(result.flight.rows), np.int8)
        about[f"{name}_QC"] = _said()["QC"]
    single = _platform(result, stamp)
    single |= {"DEPLOYMENT_TIME": start, "DEPLOYMENT_LATITUDE": north, "DEPLOYMENT_LONGITUDE": east}
    found = cf_dataset(
        {name: (_AT, column, about[name]) for name, column in values.items()}
        | {name: ((), value, _said()[name]) for name, value in single.items()},
        _attributes(result, moment, stamp),
        coordinates=_PLACED,
    )
    found.encoding["unlimited_dims"] = {_AT}
    return found


def og1_time(moment: datetime.datetime) -> float:
    """Return a moment in seconds since 1970; raises InputError for one that OG 1.0 has not."""
    start, time = (moment - _EPOCH).total_seconds(), _said()["TIME"]
    if not time["valid_min"] <= start <= time["valid_max"]:
        first, last = (
            f"{_EPOCH + datetime.timedelta(seconds=time[end]):%Y-%m-%d}"
            for end in ("valid_min", "valid_max")
        )
        what = f"OG 1.0 has times from {first} to {last} only"
        remedy = "Give another date, or leave it out"
        raise InputError(what, field="begin", value=moment.isoformat(), remedy=remedy)
    return start


def _measured(result: MissionResult, start: float, latitude: float, longitude: float) -> _Table:
    """Return where and when it was, what a sensor would have measured, and the phase.

    There are no GPS fixes.
    """
    rows, column = result.flight.rows, result.flight.column
    z, n = rows["z"], len(rows)
    pressure = np.interp(z, column.depth, column.pressure) / 1e4
    return {
        "TIME": start + rows["t"],
        "LATITUDE": np.full(n, latitude),
        "LONGITUDE": np.full(n, longitude),
        "DEPTH": np.maximum(z, 0.0),
        **{f"{name}_GPS": np.full(n, np.nan) for name in _PLACED[:3]},
        "PRES": pressure.astype(np.float32),
        "TEMP": np.interp(z, column.depth, column.temperature).astype(np.float32),
        "PHASE": og1_phase(result),
    }


def _own(result: MissionResult) -> _Table:
    """Return what OG1 has no term for."""
    columns = trajectory_columns(result)
    found = {
        "VOLUME_CHANGE": columns["volume_m3"],
        "VERTICAL_SPEED": columns["speed_m_s"],
        "CYCLE_NUMBER": columns["cycle"].astype(np.int32),
        "PUMP": (columns["doing"] == Doing.PUMPING).astype(np.int8),
    }
    if result.energy_known:
        names = ["POWER", *_consumers(result).values()]
        found |= {name: columns[f"{name.lower()}_W"] for name in names}
    return found | ({"BATTERY": columns["battery"]} if "battery" in columns else {})


def _consumers(result: MissionResult) -> dict[str, str]:
    """Return the name of the power of each consumer; nothing where no energy is known."""
    names = power_names(list(result.books.battery)) if result.energy_known else {}
    return {consumer: name.removesuffix("_W").upper() for consumer, name in names.items()}


def _platform(result: MissionResult, stamp: str) -> _Table:
    """Return the platform, and the sensor that it has not."""
    vehicle = result.flight.vehicle
    name, limit = vehicle.name, vehicle.hull.depth_limit
    found = dict.fromkeys(("PLATFORM_MODEL", "PLATFORM_SERIAL_NUMBER", "PLATFORM_NAME"), name)
    found |= {"TRAJECTORY": f"{name}_{stamp}", "WMO_IDENTIFIER": "none", "SENSOR_SIMULATION_0": ""}
    return found | ({} if limit is None else {"PLATFORM_DEPTH_RATING": np.int32(limit)})


def _attributes(result: MissionResult, begin: datetime.datetime, stamp: str) -> dict[str, Any]:
    flight = result.flight
    name = flight.vehicle.name
    end = begin + datetime.timedelta(seconds=flight.duration)
    own = {
        "id": f"{name}_{stamp}_simulated",
        "start_date": stamp,
        "time_coverage_start": stamp,
        "time_coverage_end": f"{end:%Y%m%dT%H%M%S}",
        "date_created": f"{created(begin):%Y%m%dT%H%M%S}",
        "control_law": "; ".join(law_words(result.laws)),
    }
    title = f"{name}: {flight.mission.name or 'mission'}, simulated"
    return described(title, **_said()["file"], **own)


def og1_phase(result: MissionResult) -> Any:
    """Return OG1's number of the phase of each row [n]."""
    flight = result.flight
    rows = flight.rows
    found = np.zeros(len(rows), dtype=np.int8)
    for n, phase in enumerate(flight.mission.phases):
        here = rows["phase"] == n
        if phase.kind in ("park", "hold"):
            found[here] = PARKING
        else:
            found[here] = np.where(rows["w"][here] > 0.0, DESCENT, ASCENT)
    afloat = rows["z"] <= flight.vehicle.hull.emergence_depth + _EDGE
    found[afloat] = SURFACING
    return found
