"""The accounts of pump, valve and motion as balances: volume, energy, and what does not add up."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.seawater import look_up
from swimbladder.sim.engine.rodas.records import Account, Table

Array = NDArray[np.float64]
HOLDING = "holding"


@dataclass(frozen=True, kw_only=True)
class Balance:
    """Volume [m3] and energy [J] of a run.

    drive: electrical energy into pump and valve. sinks: what became of it, stored energy included;
    their sum is `drive` but for the residual, which the steps' errors leave. throughput: work that
    drive and sea did on each other to and fro, to judge it by.
    """

    volume: dict[str, float]
    drive: float
    sinks: dict[str, float]
    throughput: float
    volume_residue: float


def balance(
    given: np.record, accounts: Array, first: np.record, last: np.record, *, stored: float
) -> Balance:
    """Return the balance between two states; stored [J]: what the sea gained."""
    a = {key: float(accounts[key]) for key in list(Account)[: int(Account.T_DESCEND)]}
    m = float(given["mass"])
    work = a[Account.PUMP_WORK] - a[Account.LET_IN_WORK] - a[Account.LEAK_WORK]
    sinks = {
        "pump and its driver": a[Account.PUMP_ENERGY] - a[Account.PUMP_WORK],
        "valve and its flow": a[Account.VALVE_ENERGY] + a[Account.LET_IN_WORK],
        HOLDING: a[Account.HOLDING_ENERGY],
        "leakage": a[Account.LEAK_WORK],
        "drag": a[Account.DRAG],
        "bottom": a[Account.BLOWS],
        "moving water": a[Account.FORCED],
        "heat of the hull": a[Account.HEAT],
        "oscillations at rest": a[Account.SETTLED],
        "vehicle motion": 0.5 * m * float(last["w"] ** 2 - first["w"] ** 2),
        "sea": stored,
    }
    change = float(last["v"] - first["v"])
    volume = {
        "pumped": a[Account.PUMPED],
        "let in": a[Account.LET_IN],
        "leaked": a[Account.LEAKED],
        "change": change,
    }
    passed = a[Account.PUMP_WORK] + a[Account.LET_IN_WORK]
    return Balance(
        volume=volume,
        drive=a[Account.PUMP_ENERGY] + a[Account.VALVE_ENERGY] + a[Account.HOLDING_ENERGY],
        sinks=sinks,
        throughput=max(passed + a[Account.LEAK_WORK], abs(work), a[Account.DRAG]),
        volume_residue=change - volume["pumped"] + volume["let in"] + volume["leaked"],
    )


def potential(given: np.record, table: Array, z: float) -> float:
    """Return the integral of p' V_neutral from the surface to depth z [J]: exact for the table."""
    step = float(given["step"])
    trim, give = float(given["trim"]), float(given["give"])
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


def stored_energy(given: np.record, table: Array, x: Any, *, emerging: bool) -> float:
    """Return p V less the potential of the weight, and that of the emerged hull [J]."""
    z = float(x["z"])
    pressure = look_up(table, float(given["step"]), Table.PRESSURE, z)[0]
    emerged = max(float(given["z_surface"]) - z, 0.0) if emerging else 0.0
    spring = 0.5 * float(given["mass"] * given["a_s"]) * emerged**2
    return pressure * float(x["v"]) - potential(given, table, z) + spring
