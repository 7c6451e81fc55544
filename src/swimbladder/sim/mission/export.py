"""A mission for Lagrangian tools: a float as they describe one."""

import datetime
import os
from typing import Any

import numpy as np

from swimbladder.errors import InputError
from swimbladder.sim.mission.result import MissionResult
from swimbladder.sim.mission.tables import speeds

# Of VirtualFleet's configuration: description, unit and Argo's key.
_PARAMETERS = {
    "cycle_duration": ("Maximum length of float complete cycle", "hours", "CONFIG_CycleTime_hours"),
    "life_expectancy": ("Maximum number of completed cycle", "cycle", "CONFIG_MaxCycles_NUMBER"),
    "parking_depth": ("Drifting depth", "m", "CONFIG_ParkPressure_dbar"),
    "profile_depth": ("Maximum profile depth", "m", "CONFIG_ProfilePressure_dbar"),
    "vertical_speed": ("Vertical profiling speed", "m/s", ""),
}


def created(begin: datetime.datetime) -> datetime.datetime:
    """Return when results say that they were made: the same for the same run.

    It is the time of SOURCE_DATE_EPOCH where the environment sets it, else the mission's begin.
    Raises InputError where that variable is no number of seconds since 1970.
    """
    given = os.environ.get("SOURCE_DATE_EPOCH")
    if not given:
        return begin.astimezone(datetime.UTC)
    try:
        return datetime.datetime.fromtimestamp(int(given), datetime.UTC)
    except (ValueError, OverflowError, OSError):
        what, field = "not a number of seconds since 1970", "SOURCE_DATE_EPOCH"
        remedy = "Set the environment variable to a whole number, or unset it"
        raise InputError(what, field=field, value=given, unit="s", remedy=remedy) from None


def float_configuration(result: MissionResult, *, begin: datetime.datetime) -> dict[str, Any]:
    """Return the float as VirtualFleet's configuration file takes it (version 2.0).

    begin: of the mission, see `created`.

    Its one vertical speed is that of the ways up, distance over time: VirtualFleet 0.5.3 rises with
    it and sinks with a third of it (`ArgoFloatKernel`). Hours and depths are whole numbers, since
    its particles (`ArgoParticle`) cut off what is behind the point.
    """
    flight = result.flight
    phases = flight.mission.phases
    depths = [phase.depth for phase in phases if phase.depth is not None]
    depths = depths or [flight.mission.start_depth]  # it comes up, and no more
    parked = [p.depth for p in phases if p.kind == "park" and p.depth is not None]
    cycles = flight.cycles[: max(result.cycles, 1)]
    length = float(np.mean(cycles["t_end"] - cycles["t_begin"]))
    table = speeds(flight)
    rising = table["rising_m_s"]
    crossed = rising if np.isfinite(rising).any() else table["sinking_m_s"]
    crossed = crossed[np.isfinite(crossed)]
    speed = float(len(crossed) / np.sum(1.0 / crossed)) if crossed.size else 0.0
    values: dict[str, float | int] = {
        "cycle_duration": _whole(length / 3600.0),
        "life_expectancy": result.battery_cycles or result.cycles,
        "parking_depth": _whole(parked[0] if parked else max(depths)),
        "profile_depth": _whole(max(depths)),
        "vertical_speed": speed,
    }
    parameters = []
    for name, (words, unit, key) in _PARAMETERS.items():
        value = values[name]
        meta = {"unit": unit, "dtype": type(value).__name__, "techkey": key}
        parameters.append({"name": name, "value": value, "description": words, "meta": meta})
    return {
        "created": created(begin).isoformat(),
        "version": "2.0",
        "name": flight.vehicle.name,
        "parameters": parameters,
    }


def _whole(value: float) -> float:
    """Return the nearest whole number above 0."""
    return float(max(round(value), 1))
