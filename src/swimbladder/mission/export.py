"""A mission for other tools: OG1 netCDF of the glider community, a float for Lagrangian tools."""

from __future__ import annotations

import datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swimbladder.io.files import write_through
from swimbladder.mission.core.names import Cycle, Doing, Row
from swimbladder.mission.result import MissionResult
from swimbladder.mission.tables import speeds, trajectory_columns

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["float_configuration", "og1_dataset", "write_og1"]

# The phases of OG1 (vocabularyCollection/phase.md of OceanGlidersCommunity/OG-format-user-manual).
ASCENT, DESCENT, SURFACING, PARKING = 1, 2, 3, 4
_VOCABULARY = "https://vocab.nerc.ac.uk/collection/OG1/current/"
_PHASES = (
    "https://github.com/OceanGlidersCommunity/OG-format-user-manual/blob/main/"
    "vocabularyCollection/phase.md"
)
_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_SECONDS = "seconds since 1970-01-01T00:00:00Z"


def og1_dataset(
    result: MissionResult, *, begin: datetime.datetime, latitude: float | None = None,
    longitude: float | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return a mission as a dataset in the terms of OG 1.0 where it has one.

    begin: when it starts, with its time zone. latitude, longitude [degrees]: where the water was
    measured; a vertical model goes nowhere.
    """
    import xarray

    flight = result.flight
    rows, columns = flight.rows, trajectory_columns(result)
    n, at = len(rows), "N_MEASUREMENTS"
    start = (begin - _EPOCH).total_seconds()
    where = [np.full(n, np.nan if angle is None else angle) for angle in (latitude, longitude)]
    pressure = np.interp(rows[:, Row.Z], flight.column.depth, flight.column.pressure) / 1e4
    temperature = np.interp(rows[:, Row.Z], flight.column.depth, flight.column.temperature)
    data: dict[str, tuple[str, Any, dict[str, Any]]] = {
        "TIME": (at, start + rows[:, Row.T], {
            "long_name": "Time elapsed since 1970-01-01T00:00:00Z", "standard_name": "time",
            "calendar": "gregorian", "units": _SECONDS, "time_vocabulary": _VOCABULARY + "TIME/",
        }),
        "LATITUDE": (at, where[0], {
            "long_name": "Latitude north (WGS84)", "standard_name": "latitude",
            "units": "degrees_north", "latitude_vocabulary": _VOCABULARY + "LAT/",
        }),
        "LONGITUDE": (at, where[1], {
            "long_name": "longitude of each measurement and GPS location",
            "standard_name": "longitude", "units": "degrees_east",
            "longitude_vocabulary": _VOCABULARY + "LON/",
        }),
        "DEPTH": (at, rows[:, Row.Z], {
            "long_name": "Depth below surface of the water", "standard_name": "depth",
            "units": "metres", "positive": "down", "depth_vocabulary": _VOCABULARY + "DEPTH/",
        }),
        "PRES": (at, pressure, {
            "long_name": "Pressure", "standard_name": "sea_water_pressure", "units": "dbar",
            "vocabulary": _VOCABULARY + "PRES/",
        }),
        "TEMP": (at, temperature, {
            "long_name": "Sea Water Temperature, of the cast", "units": "Celsius",
            "standard_name": "sea_water_temperature", "vocabulary": _VOCABULARY + "TEMP/",
        }),
        "PHASE": (at, og1_phase(result), {
            "long_name": "behavior of the glider at sea", "phase_vocabulary": _PHASES,
            "flag_values": np.array([0, 1, 2, 3, 4], np.int8),
            "flag_meanings": "unknown ascent descent surfacing parking",
        }),
        "VOLUME_CHANGE": (at, columns["volume_m3"], {
            "long_name": "change of displaced volume, positive is lighter", "units": "m3",
        }),
        "VERTICAL_SPEED": (at, columns["speed_m_s"], {
            "long_name": "vertical speed through the water, positive down", "units": "m s-1",
        }),
        "CYCLE_NUMBER": (at, columns["cycle"].astype(np.int32), {"long_name": "cycle"}),
        "PUMP": (at, (columns["doing"] == Doing.PUMPING).astype(np.int8), {
            "long_name": "whether the drive presses volume out until the next measurement",
        }),
    }  # fmt: skip
    if result.energy_known:
        data["POWER"] = (at, columns["power_W"], {
            "long_name": "mean electrical power from the battery until the next measurement",
            "units": "W",
        })  # fmt: skip
        if "battery" in columns:
            data["BATTERY"] = (at, columns["battery"], {
                "long_name": "share of the full battery that is left", "units": "1",
            })  # fmt: skip
    name = flight.vehicle.name
    stamp = f"{begin.astimezone(datetime.UTC):%Y%m%dT%H%M%S}"
    scalars = {
        "TRAJECTORY": (f"{name}_{stamp}", {"cf_role": "trajectory_id",
                                           "long_name": "trajectory name"}),
        "PLATFORM_MODEL": (name, {"long_name": "model of the glider"}),
        "PLATFORM_SERIAL_NUMBER": (name, {"long_name": "glider serial number"}),
        "WMO_IDENTIFIER": ("", {"long_name": "wmo id"}),
        "DEPLOYMENT_TIME": (start, {"long_name": "date of deployment", "standard_name": "time",
                                    "calendar": "gregorian", "units": _SECONDS}),
    }  # fmt: skip
    found = xarray.Dataset({key: xarray.Variable(*value) for key, value in data.items()})
    for key, (value, attributes) in scalars.items():
        found[key] = xarray.Variable((), value, attributes)
    found = found.set_coords(["TIME", "LATITUDE", "LONGITUDE", "DEPTH"])
    source = f"swimbladder {version('swimbladder')}"
    now = datetime.datetime.now(datetime.UTC)
    found.attrs = {
        "title": f"{name}: {flight.mission.name or 'mission'}, simulated",
        "platform": "sub-surface gliders",
        "platform_vocabulary": "https://vocab.nerc.ac.uk/collection/L06/current/27/",
        "id": f"{name}_{stamp}_simulated",
        "featureType": "trajectory",
        "Conventions": "CF-1.10, ACDD-1.3, OG-1.0",
        "rtqc_method": "No QC applied",
        "start_date": stamp,
        "date_created": f"{now:%Y%m%dT%H%M%S}",
        "source": source,
        "comment": "A simulation, no measurement: there are no sensors, no GPS fixes and no QC",
        "history": f"{now:%Y-%m-%dT%H:%M:%SZ} written by {source}",
    }
    return found


def og1_phase(result: MissionResult) -> Any:
    """Return OG1's number of the phase of each row [n]."""
    flight = result.flight
    rows = flight.rows
    found = np.zeros(len(rows), dtype=np.int8)
    for n, phase in enumerate(flight.mission.phases):
        here = rows[:, Row.PHASE] == n
        if phase.kind in ("park", "hold"):
            found[here] = PARKING
        else:
            found[here] = np.where(rows[here, Row.W] > 0.0, DESCENT, ASCENT)
    afloat = rows[:, Row.Z] <= flight.vehicle.hull.emergence_depth
    found[afloat] = SURFACING
    return found


def write_og1(dataset: xr.Dataset, path: Path) -> Path:
    """Write a dataset of og1_dataset; return the path.

    Raises InputError where the file cannot be written.
    """
    filled = ("TIME", "LATITUDE", "LONGITUDE", "DEPTH")
    encoding: dict[str, dict[str, Any]] = {
        str(name): {"zlib": True, "complevel": 1}
        for name, variable in dataset.variables.items()
        if variable.ndim
    }
    for name in filled:
        encoding[name]["_FillValue"] = -1.0 if name == "TIME" else -9999.9
    encoding["PHASE"]["_FillValue"] = np.int8(0)
    return write_through(
        path, lambda place: dataset.to_netcdf(
            place, engine="h5netcdf", encoding=encoding, unlimited_dims=["N_MEASUREMENTS"]
        ),
    )  # fmt: skip


def float_configuration(result: MissionResult) -> dict[str, Any]:
    """Return the float as VirtualFleet's configuration file takes it (version 2.0).

    Its one vertical speed is the distance over the time of all ways of the mission; the table of
    speeds over depth says how far that is from the truth.
    """
    flight = result.flight
    phases = flight.mission.phases
    depths = [phase.depth for phase in phases if phase.depth is not None]
    parked = [p.depth for p in phases if p.kind == "park" and p.depth is not None]
    cycles = flight.cycles[: max(result.cycles, 1)]
    length = float(np.mean(cycles[:, Cycle.T_END] - cycles[:, Cycle.T_BEGIN]))
    table = speeds(flight)
    crossed = np.concatenate([table["sinking_m_s"], table["rising_m_s"]])
    crossed = crossed[np.isfinite(crossed)]
    speed = float(len(crossed) / np.sum(1.0 / crossed)) if crossed.size else 0.0
    life = result.battery_cycles or result.cycles
    values: list[tuple[str, float | int, str, str, str]] = [
        ("cycle_duration", length / 3600.0, "Maximum length of float complete cycle", "hours",
         "CONFIG_CycleTime_hours"),
        ("life_expectancy", life, "Maximum number of completed cycle", "cycle",
         "CONFIG_MaxCycles_NUMBER"),
        ("parking_depth", parked[0] if parked else max(depths), "Drifting depth", "m",
         "CONFIG_ParkPressure_dbar"),
        ("profile_depth", max(depths), "Maximum profile depth", "m",
         "CONFIG_ProfilePressure_dbar"),
        ("vertical_speed", speed, "Vertical profiling speed", "m/s", ""),
    ]  # fmt: skip
    now = datetime.datetime.now(datetime.UTC)
    return {
        "created": now.isoformat(),
        "version": "2.0",
        "name": flight.vehicle.name,
        "parameters": [
            {
                "name": name, "value": value, "description": words,
                "meta": {"unit": unit, "dtype": type(value).__name__, "techkey": key},
            }
            for name, value, words, unit, key in values
        ],
    }  # fmt: skip
