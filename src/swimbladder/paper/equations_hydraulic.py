"""Checks of eqs (1)-(8): the oil and the hydraulic transmission."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from swimbladder.paper.verdict import EquationCheck, deviation
from swimbladder.physics import actuator as act
from swimbladder.physics import oil
from swimbladder.vehicle import ElectrohydraulicActuator, Vehicle

_EXACT = 1e-12  # rounding only


def hydraulic_checks(vehicle: Vehicle) -> list[EquationCheck]:
    """Return the checks of (1) to (8), with an electrohydraulic vehicle's datasheet."""
    return [*_oil(), *_hydraulic(vehicle)]


def _oil() -> list[EquationCheck]:
    V0, beta, rate = 8e-4, 1.5e9, 1e-6
    span = 5.0  # s: the chamber shrinks by 0.6 %

    def pressure_rate(t: float, _: Any) -> list[float]:
        return [oil.oil_pressure_rate(Q=0.0, dV_oil_dt=-rate, V_oil=V0 - rate * t, beta_e=beta)]

    p = solve_ivp(pressure_rate, (0.0, span), [0.0], rtol=1e-10, atol=1e-3).y[0, -1]
    change = oil.relative_volume_change(dp=10e6, beta_e=1.5e9)
    return [
        EquationCheck(
            number=1, says="pressure in the oil chamber",
            checked="integrated by SciPy over the compression of a sealed chamber, against "
            "p = beta ln(V_0/V)",
            value=deviation(p, beta * math.log(V0 / (V0 - rate * span))), limit=1e-8,
        ),
        EquationCheck(
            number=2, says="relative volume change of the oil, 10 MPa on 1.5 GPa",
            checked="against the exact change exp(-dp/beta) - 1",
            value=deviation(change, math.expm1(-10e6 / 1.5e9)), limit=1e-2,
            note=f"The printed numbers give {100 * change:.2f} %; printed is 0.6 %, without sign.",
        ),
    ]  # fmt: skip


def _hydraulic(vehicle: Vehicle) -> list[EquationCheck]:
    a, water = vehicle.actuator, vehicle.water
    assert isinstance(a, ElectrohydraulicActuator)
    rho, g, w = water.density, water.gravity, water.specific_weight
    d = a.drive
    A1, A2 = 0.02, 0.01  # m2, an amplifier, so that n_h is not 1
    n_h, z = A1 / A2, np.linspace(1.0, 1000.0, 37)
    p_sea, p_oil = w * z, w * z * A2 / A1
    leak = np.array(
        [act.pump_leakage_flow(k_pl=d.pump_leakage, rho=rho, g=g, z=x, n_h=n_h) for x in z]
    )
    lost = np.array([act.leakage_volume_rate(Q_l=Q, n_h=n_h) for Q in leak])
    k_l = act.leakage_coefficient(k_pl=d.pump_leakage, rho=rho, g=g, n_h=n_h)
    by_5 = np.array([act.volume_lost_to_leakage(k_l=k_l, z=x) for x in z])
    k_z = act.hydraulic_load_coefficient(
        rho=rho, g=g, D_p=d.pump_displacement, eta_p=d.pump_efficiency, n_h=n_h
    )
    k_q = act.hydraulic_volume_per_angle(D_p=d.pump_displacement, n_h=n_h)
    turns = 1000
    return [
        EquationCheck(
            number=3, says="volume rate lost to leakage",
            checked="power that leaks on either side of the amplifier: rate times sea pressure "
            "against flow times oil pressure, 1 to 1000 m, n_h = 2",
            value=deviation(lost * p_sea, leak * p_oil), limit=_EXACT,
        ),
        EquationCheck(
            number=4, says="leakage flow of the pump",
            checked="against k_pl times the oil pressure that balances the sea on areas A1 and A2",
            value=deviation(leak, d.pump_leakage * p_oil), limit=_EXACT,
            note="Printed with g_2 for g z.",
        ),
        EquationCheck(
            number=5, says="leakage in proportion to depth",
            checked="against (3) of (4), 1 to 1000 m", value=deviation(by_5, lost), limit=_EXACT,
        ),
        EquationCheck(
            number=6, says="leakage coefficient",
            checked="against the slope of (3) of (4) over depth",
            value=deviation(k_l, np.polyfit(z, lost, 1)[0]), limit=1e-10,
        ),
        EquationCheck(
            number=7, says="load torque per depth, hydraulic",
            checked="virtual work: torque times angle times efficiency against pressure times "
            "volume, one turn at 1 m",
            value=deviation(k_z * 2 * math.pi * d.pump_efficiency, w * d.pump_displacement / n_h),
            limit=_EXACT,
            note="Right while the motor drives; driven back, the torque is multiplied by the "
            "efficiency, or the transmission would create energy.",
        ),
        EquationCheck(
            number=8, says="volume per motor angle, hydraulic",
            checked=f"volume after {turns} turns, as the pump's displacement and n_h give it",
            value=deviation(k_q * turns * 2 * math.pi, turns * d.pump_displacement / n_h),
            limit=_EXACT,
        ),
    ]  # fmt: skip
