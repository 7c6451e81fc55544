"""Checks of eqs (1)-(9), (11), (12), (14), (17), (19), (21)-(24) and (33): oil and actuators.

Each compares a function of the package, or the compiled simulation, with arithmetic of its own:
another law of physics, another form, or SciPy.
"""

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from swimbladder.design.linear import linearise
from swimbladder.design.linear.transfer import (
    volume_per_depth,
    volume_per_depth_identified,
    volume_per_voltage,
    volume_per_voltage_identified,
)
from swimbladder.paper.evidence import Evidence
from swimbladder.paper.verdict import EquationCheck, check, scaled
from swimbladder.physics import actuator as act
from swimbladder.physics import oil
from swimbladder.physics.dynamics import State, motor_rhs, plant
from swimbladder.sim.closed_loop import drive
from swimbladder.vehicle import (
    ElectrohydraulicActuator,
    ElectromechanicalActuator,
    IdentifiedActuator,
    UnifiedActuator,
    Vehicle,
)


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
        check(1, (p, beta * math.log(V0 / (V0 - rate * span)))),
        check(2, (change, math.expm1(-10e6 / 1.5e9)), change=100 * change),
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
        check(3, (lost * p_sea, leak * p_oil)),
        check(4, (leak, d.pump_leakage * p_oil)),
        check(5, (by_5, lost)),
        check(6, (k_l, np.polyfit(z, lost, 1)[0])),
        check(7, (k_z * 2 * math.pi * d.pump_efficiency, w * d.pump_displacement / n_h)),
        check(8, (k_q * turns * 2 * math.pi, turns * d.pump_displacement / n_h)),
    ]


FREQUENCIES = 1j * np.geomspace(1e-3, 1e3, 61)  # rad/s


def at(ratio: tuple[Any, Any], s: Any = FREQUENCIES) -> Any:
    """Return numerator over denominator at s."""
    return np.polyval(ratio[0], s) / np.polyval(ratio[1], s)


def actuator_checks(e: Evidence) -> list[EquationCheck]:
    """Return the checks of the actuator's equations."""
    return [
        *hydraulic_checks(e.hydraulic),
        _eq9(e.hydraulic),
        *_motor(e.hydraulic),
        *_linear(e.hydraulic),
        *_shallow(e),
        *_identified(e),
    ]


def _unified(vehicle: Vehicle) -> UnifiedActuator:
    return act.unified(vehicle.actuator, vehicle.water)


def _driven(vehicle: Vehicle) -> tuple[Any, Any]:
    """V/U and V/Z of the actuator alone, from the linearised right-hand side, at FREQUENCIES."""
    A = linearise(plant(vehicle)).A
    B = linearise(plant(vehicle)).B
    inside, by_u, by_z = A[:2, :2], B[:2, 0], A[:2, 2]
    found = [
        np.linalg.solve(s * np.eye(2) - inside, np.stack([by_u, by_z], axis=1))[1]
        for s in FREQUENCIES
    ]
    return tuple(np.array(found).T)


def _eq9(vehicle: Vehicle) -> EquationCheck:
    u = _unified(vehicle)
    by_u, by_z = _driven(vehicle)
    formula_u = at(volume_per_voltage(inertia=u.inertia, k_u=u.k_u, k_q=u.k_q, k_v=u.k_v))
    formula_z = at(volume_per_depth(inertia=u.inertia, k_v=u.k_v, k_q=u.k_q, k_z=u.k_z, k_l=u.k_l))
    return check(9, (by_u, formula_u), (by_z, formula_z))


def _motor(vehicle: Vehicle) -> list[EquationCheck]:
    """Eqs (11), (12), (14) at random states, in torques, against the reduced right-hand side."""
    u, p = _unified(vehicle), plant(vehicle)
    random = np.random.default_rng(11)
    rows = []
    for _ in range(200):
        q, V, z = (
            random.uniform(0.1, 3.0) * 1e-5,
            random.uniform(-2e-4, 2e-4),
            random.uniform(0, 1e3),
        )
        w, volt = random.uniform(-0.5, 0.5), random.uniform(-24.0, 24.0)
        rate = motor_rhs(State(q, V, z, w), volt, p)
        omega = q / u.k_q
        T_z = u.k_z * z + u.friction_torque
        by_11 = (u.k_u * volt - u.k_v * omega - T_z) / u.inertia
        by_12 = u.k_q * omega - u.k_l * z
        ours_14 = rate.q - u.k_l * w  # derivative of (12)
        V_rate, lam = by_12, u.inertia
        by_14 = (
            -u.k_v / lam * V_rate - u.k_l * w
            - (u.k_l * u.k_v / lam + u.k_q * u.k_z / lam) * z
            + u.k_u * u.k_q / lam * volt - u.k_q * u.friction_torque / lam
        )  # fmt: skip
        rows.append((rate.q / u.k_q, by_11, rate.V, by_12, ours_14, by_14))
    table = np.array(rows)
    return [
        check(11, scaled(table[:, 0], table[:, 1])),
        check(12, scaled(table[:, 2], table[:, 3])),
        check(14, scaled(table[:, 4], table[:, 5])),
    ]


def _linear(vehicle: Vehicle) -> list[EquationCheck]:
    """Eqs (17) and (19): V of the whole vehicle against both terms, with its own Z."""
    u = _unified(vehicle)
    model = linearise(plant(vehicle))
    whole = model.at(FREQUENCIES)[:, :, 0]
    Z, V = whole[:, model.outputs.index("z")], whole[:, model.outputs.index("V")]
    s, lam = FREQUENCIES, u.inertia
    left = s**2 * V
    right = (
        -u.k_v / lam * s * V - u.k_l * s * Z
        - (u.k_l * u.k_v / lam + u.k_q * u.k_z / lam) * Z + u.k_u * u.k_q / lam
    )  # fmt: skip
    terms = np.abs(u.k_u * u.k_q / lam)
    formula = at(volume_per_voltage(inertia=lam, k_u=u.k_u, k_q=u.k_q, k_v=u.k_v)) + (
        at(volume_per_depth(inertia=lam, k_v=u.k_v, k_q=u.k_q, k_z=u.k_z, k_l=u.k_l)) * Z
    )
    return [
        check(17, float(np.max(np.abs(left - right)) / terms)),
        check(19, (formula, V)),
    ]


def _shallow(e: Evidence) -> list[EquationCheck]:
    """Eqs (21) and (22): a voltage step without a depth load, then with that of a pool."""
    a = e.actuator
    free = a.model_copy(update={"depth_voltage": 0.0})
    time = np.linspace(0.0, 1.0, 101)

    def rate(actuator: IdentifiedActuator, depth: float) -> Any:
        vehicle = e.vehicle.model_copy(update={"actuator": actuator})
        s = drive(
            vehicle, time=time, voltage=np.full(len(time), 12.0), start_depth=depth,
            start_volume=-1e-4, bottom_depth=depth,
        )  # fmt: skip
        return s.motor_rate[1:]

    formula = a.K1 * a.piston_area * 12.0 * -np.expm1(-time[1:] / a.T1)
    loaded = rate(a, 3.75)
    missing = 1.0 - float(loaded[-1] / formula[-1])
    back = a.K1 * a.piston_area * a.depth_voltage * 3.75
    return [
        check(21, (rate(free, 3.75), formula), lost=100 * missing, pushed=back * 1e6),
        check(22, (e.identified.K1, a.K1), (e.identified.T1, a.T1)),
    ]


def _identified(e: Evidence) -> list[EquationCheck]:
    """Eqs (23), (24) from a datasheet by simulation, and (33) from the numerical model."""
    a = e.screw.actuator
    assert isinstance(a, ElectromechanicalActuator)
    m, d = a.motor, a.drive
    k_v = m.viscous_friction + m.k_emf * m.torque_constant / m.resistance + d.viscous_friction
    k_q = d.lead / d.gear_ratio / (2 * math.pi) * d.piston_area
    by_hand = k_q * (m.torque_constant / m.resistance) / k_v
    T1 = (m.rotor_inertia + d.reflected_inertia) / k_v
    time = np.array([0.0, T1, 60.0 * T1])
    s = drive(
        e.screw, time=time, voltage=np.full(3, 6.0), start_depth=0.0, start_volume=-3e-4,
        bottom_depth=0.0,
    )  # fmt: skip
    rate, steady = float(s.motor_rate[1]), float(s.motor_rate[2])
    found = act.to_identified(a, e.screw.water)
    by_u, by_z = _driven(e.vehicle)
    i = e.actuator
    formula_u = at(volume_per_voltage_identified(K1=i.K1, A=i.piston_area, T1=i.T1))
    formula_z = at(
        volume_per_depth_identified(
            K1=i.K1, A=i.piston_area, T1=i.T1, depth_voltage=i.depth_voltage, k_l=i.k_l
        )
    )
    return [
        check(23, (found.K1 * d.piston_area, by_hand), (steady / 6.0, by_hand)),
        check(24, (found.T1, T1), (rate / steady, 1.0 - math.exp(-1.0))),
        check(33, (by_u, formula_u), (by_z, formula_z)),
    ]
