"""The balance of a mission: volume, electricity and energy, and the imbalance.

Electrical power by consumer over time is means between rows, so that their integrals are those of
the balance.

How many cycles one battery lasts: flown to its end, or computed from the first cycles.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from swimbladder.io.mission import Mission
from swimbladder.physics.arrays import Array
from swimbladder.physics.battery import lasting_cycles, load_is_on, surfacing_energy
from swimbladder.sim.engine.rodas.records import (
    HOLDING,
    OF_DRIVE,
    OF_LOADS,
    Account,
    Records,
    Stop,
    balance,
    stored_energy,
)
from swimbladder.sim.mission.core.phases import Kind
from swimbladder.sim.mission.flight import Flight
from swimbladder.sim.mission.prepare import Plan
from swimbladder.vehicle import Load, Vehicle

PUMP, VALVE = "pump", "valve"
STANDBY, SELF_DISCHARGE = "driver's standby", "self-discharge"


@dataclass(frozen=True, kw_only=True)
class MissionBalance:
    """Where volume and energy of a mission went.

    volume [m3]: pumped, let in, leaked, change. battery [J]: what left it, by consumer, the sum
    of which is `drawn`. sinks [J]: what became of it, stored energy included; their sum is `drawn`
    but for `residue` [J], which the steps' errors leave, judged by `throughput` [J], the work that
    drive and sea did on each other to and fro.
    """

    volume: dict[str, float]
    battery: dict[str, float]
    drawn: float
    sinks: dict[str, float]
    residue: float
    throughput: float
    volume_residue: float

    @property
    def relative_residue(self) -> float:
        """The residue over the throughput [-]."""
        return abs(self.residue) / max(self.throughput, 1e-12)


def load_name(load: Load) -> str:
    """Return what a load is called beside the drive's consumers, whose names it may not take."""
    taken = load.name in (PUMP, VALVE, HOLDING, STANDBY, SELF_DISCHARGE)
    return f"{load.name} (load)" if taken else load.name


def consumers(flight: Flight) -> dict[str, float]:
    """Return the energy that each consumer took from the battery [J]."""
    a = flight.accounts
    times = {kind.name.lower(): float(a[Account.T_DESCEND + kind]) for kind in Kind}

    def lasting(on: Callable[[str], bool]) -> float:
        return sum(t for kind, t in times.items() if on(kind))

    taken = a[list(OF_DRIVE)], lasting, a[Account.SURFACING_ENERGY], a[Account.SELF_DISCHARGED]
    energy = _by_consumer(flight.vehicle, *taken).items()
    return {name: float(value) for name, value in energy if value != 0.0}


def _by_consumer(
    vehicle: Vehicle,
    drive: Iterable[Any],
    lasting: Callable[[Callable[[str], bool]], Any],
    surfacing: Any,
    lost: Any,
) -> dict[str, Any]:
    """Return the energy of each consumer [J], arrays too.

    drive: of pump, valve and holding; lasting: the time [s] in the kinds of phases for which a
    function holds; surfacing: of all loads at surfacings; lost: by self-discharge.
    """
    energy: dict[str, Any] = dict(zip((PUMP, VALVE, HOLDING), drive, strict=True))
    if vehicle.driver is not None:
        energy[STANDBY] = vehicle.driver.standby_power * lasting(lambda _: True)
    surfacings = surfacing / (surfacing_energy(vehicle) or 1.0)
    for load in vehicle.loads:
        on = lasting(partial(load_is_on, load))
        taken = load.power * on + load.energy_per_surfacing * surfacings
        energy[load_name(load)] = energy.get(load_name(load), 0.0) + taken  # two may have one name
    return energy | {SELF_DISCHARGE: lost}


def close_balance(flight: Flight) -> MissionBalance:
    """Return the balance of a flight."""
    g, table, a = flight.plan.given, flight.plan.table, flight.accounts
    battery = consumers(flight)
    if (medium := flight.plan.water) is not None:
        ends = [(float(x["v"]), float(x["z"])) for x in (flight.begin, flight.end)]
        stored = float(g["mass"]) * (medium.potential(*ends[1]) - medium.potential(*ends[0]))
    else:
        afloat = bool(flight.begin["z"] < g["z_surface"])
        stored = stored_energy(g, table, flight.end, emerging=int(flight.whole["place"]) == 1)
        stored -= stored_energy(g, table, flight.begin, emerging=afloat)
    found = balance(g, a, flight.begin, flight.end, stored=stored)
    lost = float(a[Account.SELF_DISCHARGED])
    drawn = sum(battery.values())
    sinks = {"loads": drawn - found.drive - lost, SELF_DISCHARGE: lost, **found.sinks}
    return MissionBalance(
        volume=found.volume,
        battery=battery,
        drawn=drawn,
        sinks=sinks,
        residue=drawn - sum(sinks.values()),
        throughput=found.throughput,
        volume_residue=found.volume_residue,
    )


_OF_DRIVE = ("pump_energy", "valve_energy", "holding_energy")


def drive_energy(rows: Records) -> Array:
    """Return what pump, valve and holding took so far, at each row [J] [n]."""
    return np.asarray(sum(rows[name] for name in _OF_DRIVE))


def drawn_energy(rows: Records) -> Array:
    """Return what left the battery so far, at each row [J] [n]."""
    drawn = (*_OF_DRIVE, "load_energy", "surfacing_energy", "self_discharged")
    return np.asarray(sum(rows[name] for name in drawn))


def consumer_energy(flight: Flight) -> dict[str, Array]:
    """Return what each consumer took so far, at each row [J] [n]; those that took nothing are out.

    Names are those of `MissionBalance.battery`. What a load takes at each surfacing is spread over
    the rest of that phase, as its power is not stated. Between two rows the phase is one: that of
    the first.
    """
    rows = flight.rows
    phase, dt = rows["phase"].astype(int), np.diff(rows["t"])

    def lasting(on: Callable[[str], bool]) -> Array:
        is_on = np.array([on(one.kind) for one in flight.mission.phases], float)
        return np.concatenate(([0.0], np.cumsum(dt * is_on[phase[:-1]])))

    drive = (rows[name] for name in _OF_DRIVE)
    energy = _by_consumer(flight.vehicle, drive, lasting, _spread(rows), rows["self_discharged"])
    return {name: value for name, value in energy.items() if value[-1] != 0.0}


def _spread(rows: Records) -> Array:
    """Return the energy of surfacings so far, each from its instant to the end of its phase [J]."""
    t, energy = rows["t"], rows["surfacing_energy"].copy()
    phase = rows[["phase", "cycle"]][1:] != rows[["phase", "cycle"]][:-1]
    ends = np.append(np.flatnonzero(phase) + 1, len(rows) - 1)
    for k in np.flatnonzero(np.diff(rows["surfacing_energy"])):
        end = int(ends[np.searchsorted(ends, k + 1)])
        taken = rows["surfacing_energy"][k + 1] - rows["surfacing_energy"][k]
        if t[end] > t[k]:
            after = slice(k + 1, end + 1)
            energy[after] -= taken * (t[end] - t[after]) / (t[end] - t[k])
    return np.asarray(energy)


def mean_power(time: Array, energy: Array) -> Array:
    """Return the mean power from each row to the next [W] [n]; 0 at the last.

    energy [J] so far, at times [s]. The sum of power times time to the next row is all the energy:
    what is taken at an instant, between two rows of one time, counts to the rows after it, or to
    those before where nothing follows.
    """
    dt = np.diff(time)
    lasting = np.flatnonzero(dt > 0.0)
    power = np.zeros(len(time))
    if lasting.size:
        edges = np.concatenate((energy[:1], energy[lasting[:-1] + 1], energy[-1:]))
        power[lasting] = np.diff(edges) / dt[lasting]
    return power


def power_names(consumers: list[str]) -> dict[str, str]:
    """Return the column of each consumer's power: "GPS fix" is `power_gps_fix_W`.

    Two that would have one name are distinguished by a number.
    """
    found: dict[str, str] = {}
    for consumer in consumers:
        word = re.sub(r"[^a-z0-9]+", "_", consumer.lower().replace("'", "")).strip("_") or "load"
        name, again = f"power_{word}_W", 1
        while name in found.values():
            again += 1
            name = f"power_{word}_{again}_W"
        found[consumer] = name
    return found


_DRAWN = [*OF_DRIVE, *OF_LOADS]


def battery_life(
    plan: Plan, mission: Mission, cycles: Iterable[np.void], *, stop: Stop, whole: int
) -> int | None:
    """Return the cycles that a full battery lasts; None: not known.

    cycles: the records of those flown, the first `whole` of which were not broken off. Where the
    flight came to the battery's reserve or end these are the answer. Else further cycles draw the
    mean of those flown, less a first one that begins below the surface or with a warm hull, and
    self-discharge goes with the charge that is left.
    """
    if stop in (Stop.RESERVE, Stop.BATTERY_EMPTY):
        return whole
    g = plan.given
    full, reserve = float(g["charge"]), float(g["reserve"])
    if plan.energy_known or whole == 0 or not np.isfinite(reserve) or full <= reserve:
        return None
    flown = [row for row, _ in zip(cycles, range(whole), strict=False)]
    accounts = np.array([row["accounts"] for row in flown])
    drawn = np.diff(accounts[:, _DRAWN].sum(axis=1), prepend=0.0)
    duration = np.array([row["t_end"] - row["t_begin"] for row in flown])
    elsewhere = mission.start_depth > 0.0 or mission.start_temperature is not None
    alike = slice(int(elsewhere and whole > 1), None)
    further = lasting_cycles(
        full - float(accounts[-1, [*_DRAWN, Account.SELF_DISCHARGED]].sum()),
        reserve=reserve,
        empty=float(g["empty"]),
        energy=float(np.mean(drawn[alike])),
        duration=float(np.mean(duration[alike])),
        self_discharge=float(g["self_discharge"]),
    )
    return None if further is None else whole + further
