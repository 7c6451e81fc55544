"""A mission for other software: OG 1.0 netCDF, Lagrangian tools, Argo's names of a configuration.

OG 1.0 is the format of the glider community. The variables and attributes that OG 1.0.0 calls
mandatory are all there (OG_Format-v1.0.0.adoc of
github.com/OceanGlidersCommunity/OG-format-user-manual), and the highly desirable ones that a
simulation can fill. What it has none of stands there empty: GPS fixes as fill values, quality flags
as "No QC has been applied", people, institutions and sensors as "not stated" or "none".

The tables of a mission: trajectory, what happened, cycles, and speed over depth.
"""

from __future__ import annotations

import datetime
import os
import tomllib
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

import gsw
import numpy as np

from swimbladder.control.argo import ARGO, ways
from swimbladder.errors import InputError
from swimbladder.io.answers import attributes
from swimbladder.io.argo_config import AT_SURFACE, GROUNDING, GROUNDING_MODE, ICE, LAW, PLACE
from swimbladder.io.mission import Mission
from swimbladder.io.netcdf import UNDATED, cf_dataset, described, unless_dated
from swimbladder.physics.arrays import Array
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.sim.engine.rodas.records import OF_LOADS, Account, Doing, Note
from swimbladder.sim.mission import balance
from swimbladder.sim.mission.balance import power_names
from swimbladder.sim.mission.flight import Flight
from swimbladder.sim.mission.orders import law_words, phase_laws
from swimbladder.sim.mission.prepare import ground_volume
from swimbladder.sim.mission.result import MissionResult
from swimbladder.vehicle import Vehicle

if TYPE_CHECKING:
    import xarray as xr

_DEPTHS = 50  # rows of the table of speeds
_SHOWN = 12  # cycles that are printed


def trajectory_columns(result: MissionResult) -> dict[str, Array]:
    """Return the columns of trajectory.csv: a row per step of the engine."""
    rows, water = result.flight.rows, result.flight.column
    columns = {
        "time_s": rows["t"],
        "depth_m": rows["z"],
        "speed_m_s": rows["w"],
        "pressure_Pa": np.interp(rows["z"], water.depth, water.pressure),
        "volume_m3": rows["v"],
        "phase": rows["phase"],
        "cycle": rows["cycle"] + 1.0,
        "doing": np.where(rows["doing"] == Doing.PRIMING, Doing.PUMPING, rows["doing"]),
    }
    if result.energy_known:
        energy = balance.consumer_energy(result.flight)
        power = {
            name: balance.mean_power(rows["t"], energy[consumer])
            for consumer, name in balance.power_names(list(energy)).items()
        }
        columns["power_W"] = np.sum([np.zeros(len(rows)), *power.values()], axis=0)
        columns |= power
        columns["drive_energy_J"] = balance.drive_energy(rows)
        columns["energy_J"] = balance.drawn_energy(rows)
        charge = result.charge()
        if not np.isnan(charge).all():
            columns["battery"] = charge
    return columns


def events_csv(flight: Flight) -> str:
    """Return what happened as CSV: time, what, depth, volume, a number that belongs to it."""
    lines = ["time_s,what,depth_m,volume_m3,number,phase"]
    phase, titles = "", flight.mission.titles
    for note in _without_bobbing(flight):
        kind = Note(int(note["what"]))
        if kind is Note.PHASE:
            phase = titles[int(note["number"])]
        what = kind.name.lower().replace("_", "-")
        t, z, v, number = (float(note[k]) for k in ("t", "z", "v", "number"))
        named = phase.replace('"', '""')
        lines.append(f'{t!r},{what},{z!r},{v!r},{number!r},"{named}"')
    return "\n".join(lines) + "\n"


def _without_bobbing(flight: Flight) -> Array:
    """Return the notes without the bobbing afloat: the first way up and the last down stay."""
    notes = flight.notes
    what = notes["what"]
    passes = (what == Note.EMERGED) | (what == Note.SUBMERGED)
    deep = notes["z"] > float(flight.plan.given["shallow"])
    keep = ~passes
    for part in np.split(np.arange(len(notes)), np.flatnonzero(deep)):
        up, down = (part[what[part] == kind] for kind in (Note.EMERGED, Note.SUBMERGED))
        if up.size and part[0] > 0:
            keep[up[0]] = True
        if down.size and part[-1] < len(notes) - 1:
            keep[down[-1]] = True
    return np.asarray(notes[keep])


_CYCLE = (
    "begin_s=t_begin end_s=t_end arrival_s=arrival surfaced_s=surfaced deepest_m=deepest "
    "least_volume_m3=v_least most_volume_m3=v_most"
)
_ACCOUNTS = "pump_runs=PUMP_RUNS valve_runs=VALVE_RUNS pump_time_s=PUMP_TIME pumped_m3=PUMPED"
_ENERGIES = "pump_J=PUMP_ENERGY valve_J=VALVE_ENERGY holding_J=HOLDING_ENERGY"


def cycle_columns(result: MissionResult) -> dict[str, Array]:
    """Return the columns of cycles.csv: a row per cycle; energies [J] of the cycle alone."""
    c, mission = result.flight.cycles, result.flight.mission
    missed = np.array([bin(int(bits)).count("1") for bits in c["missed"]], float)
    columns = {"cycle": np.arange(1.0, len(c) + 1.0)}
    columns |= attributes(c.view(np.recarray), _CYCLE) | {"phases_missed": missed}
    accounts = attributes(Account, _ACCOUNTS)
    accounts |= {} if mission.grounding is None else {"grounded": Account.GROUNDED}
    accounts |= {} if mission.ice is None else {"ice_turns": Account.ICE_TURNS}
    accounts |= attributes(Account, _ENERGIES) if result.energy_known else {}
    columns |= {name: result.per_cycle(account) for name, account in accounts.items()}
    return columns | ({"loads_J": result.per_cycle(*OF_LOADS)} if result.energy_known else {})


def cycle_words(result: MissionResult) -> list[tuple[str, ...]]:
    """Return a table of the first cycles and the last as texts, its heading first."""
    columns = cycle_columns(result)
    heading = ["cycle", "days", "arrives [h]", "deepest [m]", "runs out", "runs in"]
    keys = ["pump_J", "valve_J", "loads_J"] if result.energy_known else []
    heading += ["out [kJ]", "in [kJ]", "loads [kJ]"] if keys else []
    count = len(columns["cycle"])
    wanted = list(range(count)) if count <= _SHOWN else [*range(_SHOWN - 1), count - 1]
    lines: list[tuple[str, ...]] = [tuple(heading)]
    for n in wanted:
        begin, end = columns["begin_s"][n], columns["end_s"][n]
        arrival = columns["arrival_s"][n]
        words = [
            f"{columns['cycle'][n]:.0f}",
            f"{(end - begin) / 86400.0:.2f}",
            "never" if np.isnan(arrival) else f"{arrival / 3600.0:.2f}",
            f"{columns['deepest_m'][n]:.1f}",
            f"{columns['pump_runs'][n]:.0f}",
            f"{columns['valve_runs'][n]:.0f}",
        ]
        lines.append((*words, *(f"{columns[key][n] / 1e3:.4g}" for key in keys)))
    return lines


def speeds(flight: Flight) -> dict[str, Array]:
    """Return mean vertical speeds over depth: what the tracks of Lagrangian tools take.

    depth_m: middles of layers; sinking_m_s and rising_m_s: the layer's thickness over the mean time
    in which it is crossed, nan where it never is.
    """
    rows = flight.rows
    top = flight.vehicle.hull.emergence_depth
    edges = np.linspace(top, max(float(np.max(rows["z"])), top + 1e-3), _DEPTHS + 1)
    times, counts = np.zeros((2, _DEPTHS)), np.zeros((2, _DEPTHS))  # sinking, rising
    for t, z in _ways(flight):
        rises = int(z[-1] < z[0])
        way = -1 if rises else 1
        ordered = way * np.maximum.accumulate(way * z)
        keep = np.concatenate(([True], np.diff(ordered) != 0.0))
        depth, time = ordered[keep], t[keep]
        if len(depth) < 2:
            continue
        at = np.interp(edges, depth[::way], time[::way], left=np.nan, right=np.nan)
        crossed = np.abs(np.diff(at))
        good = np.isfinite(crossed) & (crossed > 0.0)
        times[rises, good] += crossed[good]
        counts[rises, good] += 1.0
    crossed, nowhere = (edges[1] - edges[0]) * counts, np.full_like(times, np.nan)
    sinking, rising = np.divide(crossed, times, out=nowhere, where=counts > 0.0)
    middles = 0.5 * (edges[1:] + edges[:-1])
    return {"depth_m": middles, "sinking_m_s": sinking, "rising_m_s": rising}


def _ways(flight: Flight) -> list[tuple[Array, Array]]:
    """Return (time, depth) of each phase that goes somewhere, the way to the surface included."""
    rows, found = flight.rows, []
    number = rows["cycle"] * len(flight.mission.phases) + rows["phase"]
    cuts = np.flatnonzero(np.diff(number)) + 1
    for part in np.split(rows, cuts):
        phase: Any = flight.mission.phases[int(part["phase"][0])]
        if phase.kind == "park" or phase.kind == "hold" or len(part) < 2:
            continue
        t, z = part["t"], part["z"]
        if phase.kind == "surface":
            afloat = np.flatnonzero(z <= flight.vehicle.hull.emergence_depth)
            end = int(afloat[0]) + 1 if afloat.size else len(z)
            t, z = t[:end], z[:end]
        if len(z) > 1 and z[-1] != z[0]:
            found.append((t, z))
    return found


# Of VirtualFleet's configuration: description, unit and Argo's key.
_PARAMETERS = {
    "cycle_duration": ("Maximum length of float complete cycle", "hours", "CONFIG_CycleTime_hours"),
    "life_expectancy": ("Maximum number of completed cycle", "cycle", "CONFIG_MaxCycles_NUMBER"),
    "parking_depth": ("Drifting depth", "m", "CONFIG_ParkPressure_dbar"),
    "profile_depth": ("Maximum profile depth", "m", "CONFIG_ProfilePressure_dbar"),
    "vertical_speed": ("Vertical profiling speed", "m/s", ""),
}


def created(begin: datetime.datetime | None) -> datetime.datetime:
    """Return when results say that they were made: the same for the same run.

    It is the time of SOURCE_DATE_EPOCH where the environment sets it, else the mission's begin.
    Raises InputError where that variable is no number of seconds since 1970.
    """
    given = os.environ.get("SOURCE_DATE_EPOCH")
    if not given:
        return (begin or UNDATED).astimezone(datetime.UTC)
    try:
        return datetime.datetime.fromtimestamp(int(given), datetime.UTC)
    except (ValueError, OverflowError, OSError):
        what, field = "not a number of seconds since 1970", "SOURCE_DATE_EPOCH"
        remedy = "Set the environment variable to a whole number, or unset it"
        raise InputError(what, field=field, value=given, unit="s", remedy=remedy) from None


def float_configuration(
    result: MissionResult, *, begin: datetime.datetime | None = None
) -> dict[str, Any]:
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


def argo_configuration(vehicle: Vehicle, mission: Mission) -> dict[str, str]:
    """Return a mission by Argo's CONFIG_ names, as those of a 4000 m float of the Arvor kind are.

    Read again it is the same mission, but for bottom_depth and what counts as a change of depth,
    which have no such names. Raises InputError where it is none that such a float flies: one or two
    phases that park, the second deeper, and one to the surface, by the law `argo`.
    """
    laws, phases = phase_laws(vehicle, mission), mission.phases
    depths = [phase.depth for phase in phases[:-1] if phase.kind == "park"]
    down = [depth for depth in depths if depth is not None]
    shape = len(down) == len(phases) - 1 in (1, 2) and down == sorted(down)
    if not shape or phases[-1].kind != "surface" or {one.law for one in laws} != {ARGO}:
        what = "no mission that an Argo float of the Arvor kind flies"
        remedy = "One or two phases that park, the second deeper, and one to the surface, law argo"
        raise InputError(what, field="config", value=mission.name or None, remedy=remedy)
    law, parked, bottom = laws[0].parameters, down[0], down[-1]
    deepest = float(gsw.p_from_z(-bottom, PLACE))
    metres = bottom / deepest
    sinking, rising = (way.speed for way in ways(law))
    stays = [phase.duration or 0.0 for phase in phases[:-1]]
    if len(stays) > 1:
        sinking = (bottom - parked) / stays[1]
    drive = drive_map(vehicle, np.zeros(1), power=False)
    pumps = (law.pump_volume + float(drive.start_volume[0])) / float(drive.rate_out[0])  # s
    limit = mission.safety.deepest or vehicle.hull.depth_limit or bottom + 200.0 * metres
    numbers = {
        "PM01_CyclePeriod": (sum(stays) + bottom / rising + AT_SURFACE) / 86400.0,
        "PM08_DriftDepth": float(gsw.p_from_z(-parked, PLACE)),
        "PM09_ProfileDepth": deepest,
        "PT03_PumpMaxDurationDuringAscent": 100.0 * pumps,
        "PT06_MaxPressureBeforeEmergencyAscent": float(gsw.p_from_z(-limit, PLACE)),
        "PT18_AverageDescentSpeed": 1e3 * sinking,
        "PT23_AverageAscentSpeed": 1e3 * rising,
        "PG09_PumpActionDuration": 100.0 * law.slow_share * pumps,
        "PT01_EVMaxVolumeDuringDescentAndRepositioning": 1e6 * law.valve_volume,
    }
    found = {f"CONFIG_{name}": x for name, x in numbers.items() if x > 0.0}
    ground = mission.grounding
    shifts = phases[0].grounding == "shift"
    if ground is not None:
        ground = ground.model_copy(update={"volume": ground_volume(vehicle, mission)})
        found[f"CONFIG_{GROUNDING_MODE}"] = 0.0 if shifts else 1.0
    _check_behaviour(mission)
    for one, table in ((law, LAW), (ground, GROUNDING), (mission.ice, ICE)):
        for parameter, (name, unit) in table.items():
            value = getattr(one, parameter, None)
            if value is not None and (value > 0.0 or one is not law):
                found[f"CONFIG_{name}"] = value / (unit or metres)
    return {name: f"{x:.10g}" for name, x in sorted(found.items())}


def _check_behaviour(mission: Mission) -> None:
    """Raise InputError for what such a float does not do on the bottom and under ice."""
    only = "Such a float stays on the bottom, or shifts its first park"
    for n, phase in enumerate(mission.phases):
        if phase.grounding == "next" or (n > 0 and phase.grounding == "shift"):
            what = f"its configuration has no grounding {phase.grounding!r} here"
            raise InputError(what, field=f"phases[{n}].grounding", remedy=only)
    if mission.ice is not None and mission.ice.wait <= 0.0:
        what, remedy = "0 days there mean that a float detects no ice", "Give 1 d or more"
        raise InputError(what, field="ice.wait", value=mission.ice.wait, unit="s", remedy=remedy)


def _whole(value: float) -> float:
    """Return the nearest whole number above 0."""
    return float(max(round(value), 1))


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
    names = power_names(list(result.balance.battery)) if result.energy_known else {}
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
