"""A mission as OG 1.0 netCDF, the format of the glider community.

The variables and attributes that OG 1.0.0 calls mandatory are all there (OG_Format-v1.0.0.adoc of
github.com/OceanGlidersCommunity/OG-format-user-manual), and the highly desirable ones that a
simulation can fill. What it has none of stands there empty: GPS fixes as fill values, quality flags
as "No QC has been applied", people, institutions and sensors as "not stated" or "none".
"""

from __future__ import annotations

import datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swimbladder.io.files import write_through
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
_VOCABULARY = "https://vocab.nerc.ac.uk/collection/OG1/current/"
_MODELS = "https://vocab.nerc.ac.uk/collection/B76/current/"
_ROLES = "https://vocab.nerc.ac.uk/collection/W08/current/"
_PHASES = (
    "https://github.com/OceanGlidersCommunity/OG-format-user-manual/blob/main/"
    "vocabularyCollection/phase.md"
)
_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_SECONDS = "seconds since 1970-01-01T00:00:00Z"
_TIME: dict[str, Any] = dict(calendar="gregorian", units=_SECONDS, valid_min=1e9, valid_max=4e9)
_PLACED = ("TIME", "LATITUDE", "LONGITUDE", "DEPTH")
_FLAGGED = (*_PLACED, "TIME_GPS", "LATITUDE_GPS", "LONGITUDE_GPS", "PRES", "TEMP", "PHASE")
_SENSOR = "SENSOR_SIMULATION_0"
_NOT_STATED = "not stated"
_AT = "N_MEASUREMENTS"
_MEAN = (
    "The sum of power times the time to the next measurement is all the energy taken; what is "
    "taken once at a surfacing is spread over the rest of that phase"
)
_Variable = tuple[tuple[str, ...], Any, dict[str, Any]]  # dimensions, values, attributes
_Table = dict[str, _Variable]


def _angle(name: str, towards: str, most: float) -> dict[str, Any]:
    """Return the attributes that all latitudes, or all longitudes, have."""
    units = f"degrees_{towards}"
    return {"standard_name": name, "units": units, "valid_min": -most, "valid_max": most}


_LATITUDE, _LONGITUDE = _angle("latitude", "north", 90.0), _angle("longitude", "east", 180.0)


def _series(values: Any, **attributes: Any) -> _Variable:
    """Return a variable with a value at each measurement."""
    return (_AT,), values, attributes


def _scalar(value: Any, **attributes: Any) -> _Variable:
    return (), value, attributes


def og1_dataset(
    result: MissionResult,
    *,
    begin: datetime.datetime,
    latitude: float | None = None,
    longitude: float | None = None,
) -> xr.Dataset:
    """Return a mission as a dataset in the terms of OG 1.0.

    begin: when it starts, with its time zone. latitude, longitude [degrees]: where the water was
    measured; a vertical model goes nowhere.
    """
    import xarray

    start = (begin - _EPOCH).total_seconds()
    where = [np.nan if angle is None else angle for angle in (latitude, longitude)]
    stamp = f"{begin.astimezone(datetime.UTC):%Y%m%dT%H%M%S}"
    data = _located(result, start, *where) | _measured(result) | _own(result)
    for name in _FLAGGED:
        data[name][2]["ancillary_variables"] = f"{name}_QC"
        data[f"{name}_QC"] = _series(
            np.zeros(len(result.flight.rows), np.int8),
            long_name="quality flag",
            valid_range=np.array([0, 4], np.int8),
            flag_values=np.arange(5, dtype=np.int8),
            flag_meanings="no_QC_has_been_applied good_data probably_good_data "
            "probably_bad_data bad_data",
        )
    data |= _platform(result, start, stamp, *where)
    found = xarray.Dataset({key: xarray.Variable(*value) for key, value in data.items()})
    found = found.set_coords(_PLACED)
    found.attrs = _attributes(result, begin, stamp)
    return found


def _located(result: MissionResult, start: float, latitude: float, longitude: float) -> _Table:
    """Return where and when it was, and its GPS fixes, of which there are none."""
    rows = result.flight.rows
    n, deep = len(rows), np.maximum(rows["z"], 0.0)
    elapsed = "Time elapsed since 1970-01-01T00:00:00Z"
    placed = "longitude of each measurement and GPS location"
    under = "Depth below surface of the water body"
    depth: dict[str, Any] = dict(long_name=under, standard_name="depth", units="metres")
    depth |= dict(positive="down", valid_min=0.0, valid_max=10000.0)
    found = {
        "TIME": _series(start + rows["t"], **_TIME, long_name=elapsed, standard_name="time"),
        "LATITUDE": _series(np.full(n, latitude), **_LATITUDE, long_name="Latitude north (WGS84)"),
        "LONGITUDE": _series(np.full(n, longitude), **_LONGITUDE, long_name=placed),
        "DEPTH": _series(deep, **depth),
    }
    place = "the place of the cast, at all times"
    for name, term, how in (
        ("TIME", "TIME", "none: simulated"),
        ("LATITUDE", "LAT", place),
        ("LONGITUDE", "LON", place),
        ("DEPTH", "DEPTH", "none: simulated; 0 where the sensor is out of the water"),
    ):
        found[name][2]["interpolation_methodology"] = how
        found[name][2][f"{name.lower()}_vocabulary"] = f"{_VOCABULARY}{term}/"
    for name, common in (("TIME", _TIME), ("LATITUDE", _LATITUDE), ("LONGITUDE", _LONGITUDE)):
        words = f"{name.lower()} of each GPS location"
        found[f"{name}_GPS"] = _series(np.full(n, np.nan), **common, long_name=words)
    return found


def _measured(result: MissionResult) -> _Table:
    """Return what a sensor would have measured, and the phase."""
    flight = result.flight
    z, column = flight.rows["z"], flight.column
    common = {"coordinates": "TIME, LONGITUDE, LATITUDE, DEPTH", "sensor": _SENSOR}
    pressure = np.interp(z, column.depth, column.pressure) / 1e4
    temperature = np.interp(z, column.depth, column.temperature)
    return {
        "PRES": _series(
            pressure.astype(np.float32),
            **common,
            long_name="Pressure",
            standard_name="sea_water_pressure",
            units="dbar",
            vocabulary=f"{_VOCABULARY}PRES/",
        ),
        "TEMP": _series(
            temperature.astype(np.float32),
            **common,
            long_name="Sea Water Temperature, of the cast",
            units="Celsius",
            standard_name="sea_water_temperature",
            vocabulary=f"{_VOCABULARY}TEMP/",
        ),
        "PHASE": _series(
            og1_phase(result),
            long_name="behavior of the glider at sea",
            phase_vocabulary=_PHASES,
            phase_calculation_method="the phase of the mission, and the sign of the speed",
            phase_calculation_method_vocabulary="n/a",
            flag_values=np.array([0, 1, 2, 3, 4], np.int8),
            flag_meanings="unknown ascent descent surfacing parking",
        ),
    }


def _own(result: MissionResult) -> _Table:
    """Return what OG1 has no term for."""
    columns = trajectory_columns(result)
    pumps = (columns["doing"] == Doing.PUMPING).astype(np.int8)
    lighter = "change of displaced volume, positive is lighter"
    downward = "vertical speed through the water, positive down"
    pressed = "whether the drive presses volume out until the next measurement"
    found = {
        "VOLUME_CHANGE": _series(columns["volume_m3"], long_name=lighter, units="m3"),
        "VERTICAL_SPEED": _series(columns["speed_m_s"], long_name=downward, units="m s-1"),
        "CYCLE_NUMBER": _series(columns["cycle"].astype(np.int32), long_name="cycle"),
        "PUMP": _series(pumps, long_name=pressed),
    }
    if not result.energy_known:
        return found
    names = power_names(list(result.books.battery))
    for consumer, name in {"the battery": "power_W", **names}.items():
        power = f"mean electrical power until the next measurement: {consumer}"
        mean = _series(columns[name], long_name=power, units="W", comment=_MEAN)
        found[name.removesuffix("_W").upper()] = mean
    if "battery" in columns:
        left = "share of the full battery that is left"
        found["BATTERY"] = _series(columns["battery"], long_name=left, units="1")
    return found


def _platform(
    result: MissionResult, start: float, stamp: str, latitude: float, longitude: float
) -> _Table:
    """Return platform, deployment and the sensor that it has not."""
    vehicle = result.flight.vehicle
    name, limit = vehicle.name, vehicle.hull.depth_limit
    clock = {key: _TIME[key] for key in ("calendar", "units")}
    model = {"long_name": "model of the glider", "platform_model_vocabulary": _MODELS}
    found = {
        "TRAJECTORY": _scalar(
            f"{name}_{stamp}", cf_role="trajectory_id", long_name="trajectory name"
        ),
        "WMO_IDENTIFIER": _scalar("none", long_name="wmo id"),
        "PLATFORM_MODEL": _scalar(name, **model),
        "PLATFORM_SERIAL_NUMBER": _scalar(name, long_name="glider serial number"),
        "PLATFORM_NAME": _scalar(name, long_name="Local or nickname of the glider"),
        "DEPLOYMENT_TIME": _scalar(
            start, long_name="date of deployment", standard_name="time", **clock
        ),
        "DEPLOYMENT_LATITUDE": _scalar(latitude, **_LATITUDE, long_name="latitude of deployment"),
        "DEPLOYMENT_LONGITUDE": _scalar(
            longitude, **_LONGITUDE, long_name="longitude of deployment"
        ),
        _SENSOR: _scalar(
            "",
            long_name="no sensor: the values are those of the cast and of the simulation",
            sensor_type_vocabulary="n/a",
            sensor_model="none",
            sensor_model_vocabulary="n/a",
        ),
    }
    if limit is not None:
        found["PLATFORM_DEPTH_RATING"] = _scalar(
            np.int32(limit),
            long_name="depth limit in meters of the glider for this mission",
            convention="positive value expected - e.g. 100m depth = 100",
        )
    return found


def _attributes(result: MissionResult, begin: datetime.datetime, stamp: str) -> dict[str, Any]:
    flight = result.flight
    name = flight.vehicle.name
    source = f"swimbladder {version('swimbladder')}"
    end = begin + datetime.timedelta(seconds=flight.duration)
    return {
        "title": f"{name}: {flight.mission.name or 'mission'}, simulated",
        "platform": "sub-surface gliders",
        "platform_vocabulary": "https://vocab.nerc.ac.uk/collection/L06/current/27/",
        "id": f"{name}_{stamp}_simulated",
        "contributor_name": _NOT_STATED,
        "contributor_email": _NOT_STATED,
        "contributor_role": "Principal Investigator",
        "contributor_role_vocabulary": _ROLES,
        "contributing_institutions": _NOT_STATED,
        "contributing_institutions_role": "Operator",
        "contributing_institutions_role_vocabulary": _ROLES,
        "featureType": "trajectory",
        "Conventions": "CF-1.10, ACDD-1.3, OG-1.0",
        "rtqc_method": "No QC applied",
        "rtqc_method_doi": "n/a",
        "start_date": stamp,
        "time_coverage_start": stamp,
        "time_coverage_end": f"{end.astimezone(datetime.UTC):%Y%m%dT%H%M%S}",
        "date_created": f"{created(begin):%Y%m%dT%H%M%S}",
        "source": source,
        "comment": "A simulation, no measurement: there are no sensors, no GPS fixes and no QC",
        "control_law": "; ".join(law_words(result.laws)),
        "history": f"written by {source}",
    }


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


def write_og1(dataset: xr.Dataset, path: Path) -> Path:
    """Write a dataset of og1_dataset; return the path.

    Raises InputError where the file cannot be written.
    """
    encoding: dict[str, dict[str, Any]] = {
        str(name): {"zlib": True, "complevel": 1} if variable.ndim else {}
        for name, variable in dataset.variables.items()
    }
    for name in _FLAGGED:
        kind = dataset[name].dtype
        encoding[name]["_FillValue"] = kind.type(0 if name == "PHASE" else -9999.9)
        encoding[f"{name}_QC"]["_FillValue"] = np.int8(-127)
    for name in ("TIME", "TIME_GPS"):
        encoding[name]["_FillValue"] = -1.0
    for name in ("DEPLOYMENT_LATITUDE", "DEPLOYMENT_LONGITUDE"):
        encoding[name]["_FillValue"] = -9999.9
    return write_through(
        path,
        lambda place: dataset.to_netcdf(
            place, engine="h5netcdf", encoding=encoding, unlimited_dims=[_AT]
        ),
    )
