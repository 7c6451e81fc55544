"""The books of a mission: volume, electricity and energy, and what does not add up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.battery import load_is_on, surfacing_energy
from swimbladder.sim.engine.rodas.ledger import HOLDING, balance, stored_energy
from swimbladder.sim.engine.rodas.names import Account, At, Given, Now
from swimbladder.sim.mission.core.names import Kind
from swimbladder.sim.mission.flight import Flight
from swimbladder.sim.mission.law_flight import medium_for
from swimbladder.vehicle import Load

Array = NDArray[np.float64]
PUMP, VALVE = "pump", "valve"
STANDBY, SELF_DISCHARGE = "driver's standby", "self-discharge"


@dataclass(frozen=True, kw_only=True)
class MissionBooks:
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
    a, vehicle = flight.accounts, flight.vehicle
    times = {kind: float(a[Account.T_KIND + kind]) for kind in Kind}
    energy = {
        PUMP: float(a[Account.PUMP_ENERGY]),
        VALVE: float(a[Account.VALVE_ENERGY]),
        HOLDING: float(a[Account.HOLDING_ENERGY]),
    }
    if vehicle.driver is not None and vehicle.driver.standby_power > 0.0:
        energy[STANDBY] = vehicle.driver.standby_power * sum(times.values())
    sessions = surfacing_energy(vehicle)
    surfacings = float(a[Account.SURFACING_ENERGY]) / sessions if sessions > 0.0 else 0.0
    for load in vehicle.loads:
        on = sum(t for kind, t in times.items() if load_is_on(load, kind.name.lower()))
        taken = load.power * on + load.energy_per_surfacing * surfacings
        energy[load_name(load)] = energy.get(load_name(load), 0.0) + taken  # two may have one name
    energy[SELF_DISCHARGE] = float(a[Account.SELF_DISCHARGED])
    return {name: value for name, value in energy.items() if value != 0.0}


def close_books(flight: Flight) -> MissionBooks:
    """Return the books of a flight."""
    g, table, a = flight.plan.given, flight.plan.table, flight.accounts
    battery = consumers(flight)
    if flight.plan.laws:
        medium = medium_for(flight.vehicle, flight.mission, flight.column)
        ends = [(float(x[Now.V]), float(x[Now.Z])) for x in (flight.begin, flight.end)]
        stored = float(g[Given.MASS]) * (medium.potential(*ends[1]) - medium.potential(*ends[0]))
    else:
        afloat = bool(flight.begin[Now.Z] < g[Given.Z_SURFACE])
        stored = stored_energy(g, table, flight.end, emerging=int(flight.whole[At.PLACE]) == 1)
        stored -= stored_energy(g, table, flight.begin, emerging=afloat)
    found = balance(g, a, flight.begin, flight.end, stored=stored)
    lost = float(a[Account.SELF_DISCHARGED])
    drawn = sum(battery.values())
    sinks = {"loads": drawn - found.drive - lost, SELF_DISCHARGE: lost, **found.sinks}
    return MissionBooks(
        volume=found.volume, battery=battery, drawn=drawn, sinks=sinks,
        residue=drawn - sum(sinks.values()), throughput=found.throughput,
        volume_residue=found.volume_residue,
    )  # fmt: skip
