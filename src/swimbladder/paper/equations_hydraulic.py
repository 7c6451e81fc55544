"""Checks of eqs (1)-(8): the oil and the hydraulic transmission."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from swimbladder.paper.verdict import EquationCheck, check, deviation
from swimbladder.physics import actuator as act
from swimbladder.physics import oil
from swimbladder.vehicle import ElectrohydraulicActuator, Vehicle


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
        check(1, deviation(p, beta * math.log(V0 / (V0 - rate * span)))),
        check(2, deviation(change, math.expm1(-10e6 / 1.5e9)), change=100 * change),
    ]


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
        check(3, deviation(lost * p_sea, leak * p_oil)),
        check(4, deviation(leak, d.pump_leakage * p_oil)),
        check(5, deviation(by_5, lost)),
        check(6, deviation(k_l, np.polyfit(z, lost, 1)[0])),
        check(7, deviation(k_z * 2 * math.pi * d.pump_efficiency, w * d.pump_displacement / n_h)),
        check(8, deviation(k_q * turns * 2 * math.pi, turns * d.pump_displacement / n_h)),
    ]
