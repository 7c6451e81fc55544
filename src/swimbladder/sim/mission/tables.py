"""The tables of a mission: trajectory, what happened, cycles, and speed over depth."""

from typing import Any

import numpy as np

from swimbladder.physics.arrays import Array
from swimbladder.sim.engine.rodas.records import OF_LOADS, Account, Doing, Note
from swimbladder.sim.mission import balance
from swimbladder.sim.mission.flight import Flight
from swimbladder.sim.mission.result import MissionResult

_DEPTHS = 50  # rows of the table of speeds


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


def cycle_columns(result: MissionResult) -> dict[str, Array]:
    """Return the columns of cycles.csv: a row per cycle; energies [J] of the cycle alone."""
    c = result.flight.cycles
    columns: dict[str, Array] = {
        "cycle": np.arange(1.0, len(c) + 1.0),
        "begin_s": c["t_begin"],
        "end_s": c["t_end"],
        "arrival_s": c["arrival"],
        "surfaced_s": c["surfaced"],
        "deepest_m": c["deepest"],
        "least_volume_m3": c["v_least"],
        "most_volume_m3": c["v_most"],
        "phases_missed": np.array([bin(int(bits)).count("1") for bits in c["missed"]], float),
        "pump_runs": result.per_cycle(Account.PUMP_RUNS),
        "valve_runs": result.per_cycle(Account.VALVE_RUNS),
        "pump_time_s": result.per_cycle(Account.PUMP_TIME),
        "pumped_m3": result.per_cycle(Account.PUMPED),
    }
    if result.flight.mission.grounding is not None:
        columns["grounded"] = result.per_cycle(Account.GROUNDED)
    if result.flight.mission.ice is not None:
        columns["ice_turns"] = result.per_cycle(Account.ICE_TURNS)
    if result.energy_known:
        columns |= {
            "pump_J": result.per_cycle(Account.PUMP_ENERGY),
            "valve_J": result.per_cycle(Account.VALVE_ENERGY),
            "holding_J": result.per_cycle(Account.HOLDING_ENERGY),
            "loads_J": result.per_cycle(*OF_LOADS),
        }
    return columns


def cycle_words(result: MissionResult, shown: int = 12) -> list[tuple[str, ...]]:
    """Return a table of the first cycles and the last as texts, its heading first."""
    columns = cycle_columns(result)
    heading = ["cycle", "days", "arrives [h]", "deepest [m]", "runs out", "runs in"]
    keys = ["pump_J", "valve_J", "loads_J"] if result.energy_known else []
    heading += ["out [kJ]", "in [kJ]", "loads [kJ]"] if keys else []
    count = len(columns["cycle"])
    wanted = list(range(count)) if count <= shown else [*range(shown - 1), count - 1]
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
