"""How far the oil of an electrohydraulic drive gives way (eqs 1-2).

The model takes the oil as incompressible but in the line of a pump and valve (`pump_start`). These
functions say by how much that is wrong.
"""

import math
from typing import NamedTuple

from swimbladder.errors import check_number
from swimbladder.vehicle import Oil, Water

ATMOSPHERIC_PRESSURE = 101325.0  # Pa


def oil_pressure_rate(*, Q: float, dV_oil_dt: float, V_oil: float, beta_e: float) -> float:
    """Pressure rate of the oil chamber dp_oil/dt [Pa/s], eq. (1).

    Q: flow from the pump [m3/s]; dV_oil_dt: growth of the chamber [m3/s]; V_oil: its volume [m3];
    beta_e: effective bulk modulus [Pa].
    """
    return beta_e / V_oil * (Q - dV_oil_dt)


def relative_volume_change(*, dp: float, beta_e: float) -> float:
    """Relative volume change of the oil dV_oil/V_oil [-], eq. (2), negative under pressure.

    The paper's numbers, 10 MPa and 1.5 GPa, give -0.67 %; it prints 0.6 % and drops the sign.
    """
    return -dp / beta_e


def oil_volume_ratio(*, p: float, beta: float, air: float, n: float = 1.0) -> float:
    """Volume of oil with trapped air at absolute pressure p [Pa] over that at one atmosphere [-].

    beta: bulk modulus of the pure oil [Pa]; air: share of air by volume at one atmosphere [-];
    n: polytropic exponent of the air [-], 1 isothermal (slow), 1.4 adiabatic (fast).
    """
    liquid, gas = _mixture(p=p, beta=beta, air=air, n=n)
    return liquid + gas


def effective_bulk_modulus(*, p: float, beta: float, air: float, n: float = 1.0) -> float:
    """Effective bulk modulus beta_e [Pa] of oil with trapped air at absolute pressure p [Pa].

    beta_e = -V dp/dV = (V_l + V_g)/(V_l/beta + V_g/(n p)): the compliances of liquid and gas add in
    the proportion of their volumes at p (M. G. Rabie, Fluid Power Engineering, 2009, chapter 2;
    Simscape's Hydraulic Fluid has the same with V_l kept constant, which differs by p/beta). No air
    dissolves here: real oil under pressure is as stiff or
    stiffer. Arguments as in oil_volume_ratio.
    """
    liquid, gas = _mixture(p=p, beta=beta, air=air, n=n)
    return (liquid + gas) / (liquid / beta + gas / (n * p))


def _mixture(*, p: float, beta: float, air: float, n: float) -> tuple[float, float]:
    """Volumes of liquid and gas over the volume of both at one atmosphere [-]."""
    liquid = (1.0 - air) * math.exp(-(p - ATMOSPHERIC_PRESSURE) / beta)
    return liquid, air * (ATMOSPHERIC_PRESSURE / p) ** (1.0 / n)


class OilCompression(NamedTuple):
    """How much smaller the oil is at a depth than at the surface."""

    pressure: float  # Pa, of the oil above atmosphere
    bulk_modulus: float  # Pa, effective, at half that pressure
    linear: float  # -, dV_oil/V_oil of eq. (2) with that modulus
    exact: float  # -, the same integrated from the surface down
    volume: float  # m3, volume that the water gets less (negative), exact V_oil/n_h


def oil_compression(
    oil: Oil, depth: float, water: Water, *, n_h: float = 1.0, polytropic: float = 1.0
) -> OilCompression:
    """Return what eq. (2) says of an oil at `depth` [m] behind a pressure amplifier n_h [-].

    Eq. (2) takes one modulus for the whole change, and the paper that at half the pressure. Trapped
    air collapses in the first metres, far from that modulus: `exact` counts it. Raises InputError
    where the depth is negative.
    """
    check_number(depth, "depth", "m", least=0.0)
    dp = water.specific_weight * depth / n_h
    properties = {"beta": oil.bulk_modulus, "air": oil.trapped_air, "n": polytropic}
    beta_e = effective_bulk_modulus(p=ATMOSPHERIC_PRESSURE + dp / 2.0, **properties)
    exact = oil_volume_ratio(p=ATMOSPHERIC_PRESSURE + dp, **properties) - 1.0
    linear = relative_volume_change(dp=dp, beta_e=beta_e)
    return OilCompression(dp, beta_e, linear, exact, exact * oil.volume / n_h)
