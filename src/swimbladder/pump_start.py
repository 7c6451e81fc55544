"""What a pump's start costs: eq. (1) with trapped air, from standstill until the check valve opens.

Between pump and check valve stands a line of oil with some air in it, at the reservoir's pressure
until the pump starts. The pump then raises its pressure by eq. (1) with the line's walls at rest,

    dp/dt = beta_e(p)/V Q(p),   V/beta_e = V_l/beta + V_g/(n p),
    V_g = air V (p_0/p)^(1/n),  V_l = V - V_g,

and nothing reaches the bladder before p is the sea's. The state is p; as both sides depend on
nothing else, t(p) is an integral, taken by Gauss-Legendre in log p. The paper takes the oil as
incompressible: then the line is full at once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from swimbladder.oil import ATMOSPHERIC_PRESSURE
from swimbladder.parameters import Oil

__all__ = ["PumpStart", "line_compliance", "pump_start"]

Array = NDArray[np.float64]
_NODES, _WEIGHTS = leggauss(48)


class PumpStart(NamedTuple):
    """What happens before the check valve opens."""

    duration: Array  # s; inf where the pump cannot reach the pressure
    volume: Array  # m3, taken in by the line: compressed oil and air
    shortfall: Array  # m3, of rate at the load times the time of running


def line_compliance(oil: Oil, pressure: Array, *, polytropic: float = 1.4) -> Array:
    """Return V/beta_e [m3/Pa] of a line of constant volume at absolute `pressure` [Pa] [n].

    The air share counts at one atmosphere; polytropic: exponent of the air, 1.4 for a fast start.
    """
    gas = oil.volume * oil.trapped_air * (ATMOSPHERIC_PRESSURE / pressure) ** (1.0 / polytropic)
    return np.asarray((oil.volume - gas) / oil.bulk_modulus + gas / (polytropic * pressure))


def pump_start(
    oil: Oil,
    rate: Callable[[Array], Array],
    load: Array,
    *,
    reservoir: float = ATMOSPHERIC_PRESSURE,
    polytropic: float = 1.4,
) -> PumpStart:
    """Return what starts against each absolute `load` pressure [Pa] [n] cost.

    rate: what the pump delivers [m3/s] against a difference of pressure to the reservoir's [Pa];
    reservoir: absolute pressure at which line and reservoir rest [Pa].
    """
    top = np.maximum(np.asarray(load, float), reservoir)
    middle = 0.5 * (np.log(top) - np.log(reservoir))
    p = np.exp(np.log(reservoir) + middle[..., None] * (1.0 + _NODES))
    taken = p * line_compliance(oil, p, polytropic=polytropic) * middle[..., None] * _WEIGHTS
    flow = rate(p - reservoir)
    stalled = np.any(flow <= 0.0, axis=-1) | (rate(top - reservoir) <= 0.0)
    slow = np.divide(taken, flow, out=np.zeros_like(taken), where=flow > 0.0)
    duration = np.where(stalled, np.inf, slow.sum(axis=-1))
    volume = taken.sum(axis=-1)
    missed = rate(top - reservoir) * np.where(stalled, 0.0, duration)
    return PumpStart(duration, volume, missed)
