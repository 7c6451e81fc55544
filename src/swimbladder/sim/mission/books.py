"""The books of a mission: volume, electricity and energy, and what does not add up."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.battery import load_is_on, surfacing_energy
from swimbladder.physics.seawater import look_up
from swimbladder.sim.engine.rodas.names import Account, At, Given, Now, Table
from swimbladder.sim.mission.core.names import Kind
from swimbladder.sim.mission.flight import Flight
from swimbladder.sim.mission.law_flight import medium_for
from swimbladder.sim.mission.prepare import Plan
from swimbladder.vehicle import Load

__all__ = [
    "HOLDING",
    "PUMP",
    "SELF_DISCHARGE",
    "STANDBY",
    "VALVE",
    "MissionBooks",
    "close_books",
    "consumers",
    "load_name",
    "potential",
]

Array = NDArray[np.float64]
PUMP, VALVE, HOLDING = "pump", "valve", "holding"
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


def potential(plan: Plan, z: float) -> float:
    """Return the integral of p' V_neutral from the surface to depth z [J]: exact for the table."""
    step, table = float(plan.given[Given.STEP]), plan.table
    trim, give = float(plan.given[Given.TRIM]), float(plan.given[Given.GIVE])
    # Gauss' rule of three points, exact to degree 5, which p' V_neutral has in a cell
    nodes, weights = np.polynomial.legendre.leggauss(3)

    def cell(a: float, b: float) -> float:
        total = 0.0
        for node, weight in zip(nodes, weights, strict=True):
            at = 0.5 * (a + b) + 0.5 * (b - a) * float(node)
            slope = look_up(table, step, Table.PRESSURE, at)[1]
            neutral = look_up(table, step, Table.NEUTRAL, at)[0] + trim + give * at
            total += 0.5 * (b - a) * float(weight) * slope * neutral
        return total

    if z <= 0.0:
        return cell(0.0, z)
    edges = [*np.arange(0.0, min(z, step * (len(table) - 1)), step).tolist(), z]
    return sum(cell(a, b) for a, b in pairwise(edges))


def close_books(flight: Flight) -> MissionBooks:
    """Return the books of a flight."""
    g, a = flight.plan.given, flight.accounts
    m = float(g[Given.MASS])
    battery = consumers(flight)
    account = {key: float(a[key]) for key in list(Account)[: int(Account.T_KIND)]}
    work = account[Account.PUMP_WORK] - account[Account.LET_IN_WORK] - account[Account.LEAK_WORK]
    if flight.plan.laws:
        medium = medium_for(flight.vehicle, flight.mission, flight.column)
        ends = [(float(x[Now.V]), float(x[Now.Z])) for x in (flight.begin, flight.end)]
        stored = m * (medium.potential(*ends[1]) - medium.potential(*ends[0]))
    else:
        stored = _stored(flight.plan, flight.end, int(flight.whole[At.PLACE]))
        stored -= _stored(
            flight.plan, flight.begin, 1 if flight.begin[Now.Z] < g[Given.Z_SURFACE] else 0
        )
    motion = 0.5 * m * float(flight.end[Now.W] ** 2 - flight.begin[Now.W] ** 2)
    drive = account[Account.PUMP_ENERGY] + account[Account.VALVE_ENERGY]
    drive += account[Account.HOLDING_ENERGY]
    sinks = {
        "loads": sum(battery.values()) - drive - account[Account.SELF_DISCHARGED],
        SELF_DISCHARGE: account[Account.SELF_DISCHARGED],
        "pump and its driver": account[Account.PUMP_ENERGY] - account[Account.PUMP_WORK],
        "valve and its flow": account[Account.VALVE_ENERGY] + account[Account.LET_IN_WORK],
        HOLDING: account[Account.HOLDING_ENERGY],
        "leakage": account[Account.LEAK_WORK],
        "drag": account[Account.DRAG],
        "bottom": account[Account.BLOWS],
        "moving water": account[Account.FORCED],
        "heat of the hull": account[Account.HEAT],
        "oscillations at rest": account[Account.SETTLED],
        "vehicle motion": motion,
        "sea": stored,
    }
    change = float(flight.end[Now.V] - flight.begin[Now.V])
    volume = {
        "pumped": account[Account.PUMPED], "let in": account[Account.LET_IN],
        "leaked": account[Account.LEAKED], "change": change,
    }  # fmt: skip
    passed = account[Account.PUMP_WORK] + account[Account.LET_IN_WORK]
    return MissionBooks(
        volume=volume, battery=battery, drawn=sum(battery.values()), sinks=sinks,
        residue=sum(battery.values()) - sum(sinks.values()),
        throughput=max(passed + account[Account.LEAK_WORK], abs(work), account[Account.DRAG]),
        volume_residue=change - volume["pumped"] + volume["let in"] + volume["leaked"],
    )  # fmt: skip


def _stored(plan: Plan, x: Array, place: int) -> float:
    """Return p V less the potential of the weight, and that of the emerged hull [J]."""
    z, g = float(x[Now.Z]), plan.given
    pressure = look_up(plan.table, float(g[Given.STEP]), Table.PRESSURE, z)[0]
    emerged = max(float(g[Given.Z_SURFACE]) - z, 0.0) if place == 1 else 0.0
    spring = 0.5 * float(g[Given.MASS] * g[Given.A_S]) * emerged**2
    return pressure * float(x[Now.V]) - potential(plan, z) + spring
