"""Electrical power by consumer over time: means between rows, so that integrals are the books'."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.battery import load_is_on, surfacing_energy
from swimbladder.sim.engine.rodas.ledger import HOLDING
from swimbladder.sim.mission.books import PUMP, SELF_DISCHARGE, STANDBY, VALVE, load_name
from swimbladder.sim.mission.core.names import Row
from swimbladder.sim.mission.flight import Flight

Array = NDArray[np.float64]


def drive_energy(rows: Array) -> Array:
    """Return what pump, valve and holding took so far, at each row [J] [n]."""
    return np.asarray(rows[:, Row.PUMP_ENERGY : Row.LOAD_ENERGY].sum(axis=1))


def drawn_energy(rows: Array) -> Array:
    """Return what left the battery so far, at each row [J] [n]."""
    return np.asarray(rows[:, Row.PUMP_ENERGY : Row.COUNT].sum(axis=1))


def consumer_energy(flight: Flight) -> dict[str, Array]:
    """Return what each consumer took so far, at each row [J] [n]; those that took nothing are out.

    Names are those of `MissionBooks.battery`. What a load takes at each surfacing is spread over
    the rest of that phase, as its power is not stated. Between two rows the phase is one: that of
    the first.
    """
    rows, vehicle = flight.rows, flight.vehicle
    kinds = [phase.kind for phase in flight.mission.phases]
    phase, dt = rows[:, Row.PHASE].astype(int), np.diff(rows[:, Row.T])

    def lasting(on: list[bool]) -> Array:
        return np.concatenate(([0.0], np.cumsum(dt * np.array(on, float)[phase[:-1]])))

    energy = {
        PUMP: rows[:, Row.PUMP_ENERGY],
        VALVE: rows[:, Row.VALVE_ENERGY],
        HOLDING: rows[:, Row.HOLDING_ENERGY],
    }
    if vehicle.driver is not None:
        energy[STANDBY] = vehicle.driver.standby_power * lasting([True] * len(kinds))
    session = surfacing_energy(vehicle)
    surfacings = _spread(rows) / (session or 1.0)
    for load in vehicle.loads:
        on = lasting([load_is_on(load, kind) for kind in kinds])
        taken = load.power * on + load.energy_per_surfacing * surfacings
        energy[load_name(load)] = energy.get(load_name(load), 0.0) + taken
    energy[SELF_DISCHARGE] = rows[:, Row.SELF_DISCHARGED]
    return {name: value for name, value in energy.items() if value[-1] != 0.0}


def _spread(rows: Array) -> Array:
    """Return the energy of surfacings so far, each from its instant to the end of its phase [J]."""
    t, energy = rows[:, Row.T], rows[:, Row.SURFACING_ENERGY].copy()
    phase = np.diff(rows[:, [Row.PHASE, Row.CYCLE]], axis=0).any(axis=1)
    ends = np.append(np.flatnonzero(phase) + 1, len(rows) - 1)
    for k in np.flatnonzero(np.diff(rows[:, Row.SURFACING_ENERGY])):
        end = int(ends[np.searchsorted(ends, k + 1)])
        taken = rows[k + 1, Row.SURFACING_ENERGY] - rows[k, Row.SURFACING_ENERGY]
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

    Two that would have one name are told apart by a number.
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
