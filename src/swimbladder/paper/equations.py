"""Checks of eqs (1)-(9), (11), (12), (14), (17), (19), (21)-(24) and (33): oil and actuators.

Each compares a function of the package, or the compiled simulation, with arithmetic of its own:
another law of physics, another form, or SciPy.

Checks of eqs (10), (13), (15), (16), (18), (20), (25)-(32), (34)-(37): motion and control.
"""

import math
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from swimbladder.control import cascade
from swimbladder.control.law import Measurement
from swimbladder.control.registry import bind
from swimbladder.design.linear import linearise, transfer
from swimbladder.design.linear.depths import double_integrator_phase_margin
from swimbladder.paper.evidence import Evidence, on_bottom
from swimbladder.paper.verdict import EquationCheck, check, scaled
from swimbladder.physics import actuator as act
from swimbladder.physics import oil
from swimbladder.physics.dynamics import State, acceleration, drag_per_mass, motor_rhs, plant
from swimbladder.sim.closed_loop import drive
from swimbladder.sim.pool import fit_depth, fit_speed, still_starts
from swimbladder.vehicle import (
    IdentifiedActuator,
    IdentifiedMotion,
    PhysicalMotion,
    UnifiedActuator,
    Vehicle,
)
from swimbladder.vehicle.actuators import ElectrohydraulicActuator, ElectromechanicalActuator


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
    a, water = vehicle.engine, vehicle.water
    assert isinstance(a, ElectrohydraulicActuator)
    rho, g, w = water.density, water.gravity, water.specific_weight
    d = a.drive
    A1, A2 = 0.02, 0.01  # m2, an amplifier, so that n_h is not 1
    n_h, z = A1 / A2, np.linspace(1.0, 1000.0, 37)
    p_sea, p_oil = w * z, w * z * A2 / A1
    k_pl = d.pump_leakage
    leak = np.array([act.pump_leakage_flow(k_pl=k_pl, rho=rho, g=g, z=x, n_h=n_h) for x in z])
    lost = np.array([act.leakage_volume_rate(Q_l=Q, n_h=n_h) for Q in leak])
    k_l = act.leakage_coefficient(k_pl=k_pl, rho=rho, g=g, n_h=n_h)
    by_5 = np.array([act.volume_lost_to_leakage(k_l=k_l, z=x) for x in z])
    D_p, eta_p = d.pump_displacement, d.pump_efficiency
    k_z = act.hydraulic_load_coefficient(rho=rho, g=g, D_p=D_p, eta_p=eta_p, n_h=n_h)
    k_q = act.hydraulic_volume_per_angle(D_p=D_p, n_h=n_h)
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
    pumped = e.hydraulic
    by_datasheet = [*_hydraulic(pumped), _eq9(pumped), *_motor(pumped), *_linear(pumped)]
    return [*_oil(), *by_datasheet, *_shallow(e), *_identified(e)]


def _unified(vehicle: Vehicle) -> UnifiedActuator:
    return act.unified(vehicle.engine, vehicle.water)


def _driven(vehicle: Vehicle) -> tuple[Any, Any]:
    """V/U and V/Z of the actuator alone, from the linearised right-hand side, at FREQUENCIES."""
    model = linearise(plant(vehicle))
    inside, inputs = model.A[:2, :2], np.stack([model.B[:2, 0], model.A[:2, 2]], axis=1)
    found = [np.linalg.solve(s * np.eye(2) - inside, inputs)[1] for s in FREQUENCIES]
    return tuple(np.array(found).T)


def _by_9(u: UnifiedActuator) -> tuple[Any, Any]:
    """Return V/U and V/Z as eq. (9) has them, at FREQUENCIES."""
    own = {"inertia": u.inertia, "k_v": u.k_v, "k_q": u.k_q}
    by_z = transfer.volume_per_depth(**own, k_z=u.k_z, k_l=u.k_l)
    return at(transfer.volume_per_voltage(**own, k_u=u.k_u)), at(by_z)


def _eq9(vehicle: Vehicle) -> EquationCheck:
    return check(9, *zip(_driven(vehicle), _by_9(_unified(vehicle)), strict=True))


def _motor(vehicle: Vehicle) -> list[EquationCheck]:
    """Eqs (11), (12), (14) at random states, in torques, against the reduced right-hand side."""
    u, p = _unified(vehicle), plant(vehicle)
    random = np.random.default_rng(11)
    rows = []
    for _ in range(200):
        q, V = random.uniform(0.1, 3.0) * 1e-5, random.uniform(-2e-4, 2e-4)
        z, w, volt = (random.uniform(*ends) for ends in ((0, 1e3), (-0.5, 0.5), (-24.0, 24.0)))
        rate = motor_rhs(State(q, V, z, w), volt, p)
        omega = q / u.k_q
        T_z = u.k_z * z + u.friction_torque
        by_11 = (u.k_u * volt - u.k_v * omega - T_z) / u.inertia
        by_12 = u.k_q * omega - u.k_l * z
        ours_14 = rate.q - u.k_l * w  # derivative of (12)
        V_rate, lam = by_12, u.inertia
        load = u.k_l * u.k_v / lam + u.k_q * u.k_z / lam
        held = -u.k_v / lam * V_rate - u.k_l * w - load * z
        by_14 = held + u.k_u * u.k_q / lam * volt - u.k_q * u.friction_torque / lam
        rows.append((rate.q / u.k_q, by_11, rate.V, by_12, ours_14, by_14))
    table = np.array(rows).T
    pairs = zip((11, 12, 14), table[::2], table[1::2], strict=True)
    return [check(number, scaled(ours, other)) for number, ours, other in pairs]


def _linear(vehicle: Vehicle) -> list[EquationCheck]:
    """Eqs (17) and (19): V of the whole vehicle against both terms, with its own Z."""
    u = _unified(vehicle)
    model = linearise(plant(vehicle))
    whole = model.at(FREQUENCIES)[:, :, 0]
    Z, V = whole[:, model.outputs.index("z")], whole[:, model.outputs.index("V")]
    s, lam = FREQUENCIES, u.inertia
    left = s**2 * V
    load = u.k_l * u.k_v / lam + u.k_q * u.k_z / lam
    right = -u.k_v / lam * s * V - u.k_l * s * Z - load * Z + u.k_u * u.k_q / lam
    terms = np.abs(u.k_u * u.k_q / lam)
    by_u, by_z = _by_9(u)
    off = float(np.max(np.abs(left - right)) / terms)
    return [check(17, off), check(19, (by_u + by_z * Z, V))]


def _shallow(e: Evidence) -> list[EquationCheck]:
    """Eqs (21) and (22): a voltage step without a depth load, then with that of a pool."""
    a = e.actuator
    free = a.model_copy(update={"depth_voltage": 0.0})
    time = np.linspace(0.0, 1.0, 101)

    def rate(actuator: IdentifiedActuator, depth: float) -> Any:
        vehicle = e.vehicle.model_copy(update={"actuator": actuator})
        return on_bottom(vehicle, time, 12.0, depth, -1e-4).motor_rate[1:]

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
    s = on_bottom(e.screw, time, 6.0, 0.0, -3e-4)
    rate, steady = float(s.motor_rate[1]), float(s.motor_rate[2])
    found = act.to_identified(a, e.screw.water)
    by_u, by_z = _driven(e.vehicle)
    i = e.actuator
    own = {"K1": i.K1, "A": i.piston_area, "T1": i.T1}
    formula_u = at(transfer.volume_per_voltage_identified(**own))
    loads = {"depth_voltage": i.depth_voltage, "k_l": i.k_l}
    formula_z = at(transfer.volume_per_depth_identified(**own, **loads))
    return [
        check(23, (found.K1 * d.piston_area, by_hand), (steady / 6.0, by_hand)),
        check(24, (found.T1, T1), (rate / steady, 1.0 - math.exp(-1.0))),
        check(33, (by_u, formula_u), (by_z, formula_z)),
    ]


def motion_checks(e: Evidence) -> list[EquationCheck]:
    """Return the checks of the motion's and of the controller's equations."""
    return [
        *_forces(e.vehicle),
        _eq15(e),
        _eq16(e.hydraulic),
        *_small(e.vehicle),
        *_shallow_motion(e),
        *_any_depth(e),
        *_open_loop(e),
        *_controller(e),
    ]


def _forces(vehicle: Vehicle) -> list[EquationCheck]:
    p, m, k_b = plant(vehicle), vehicle.mass, vehicle.water.specific_weight
    V_p, psi = vehicle.hull.displaced_volume, vehicle.hull.psi
    random = np.random.default_rng(10)
    ours, archimedes, by_13 = [], [], []
    for _ in range(200):
        V, z, w = random.uniform(-3e-4, 3e-4), random.uniform(1, 100), random.uniform(-0.5, 0.5)
        F_d = vehicle.drag.k_dl * w
        ours.append(m * acceleration(V, z, w, p))
        archimedes.append(k_b * V_p - k_b * (V_p + V - psi * z) - F_d)
        by_13.append((-k_b * V + k_b * psi * z - F_d) / m)
    scale = float(np.max(np.abs(archimedes)))
    return [
        check(10, scaled(ours, archimedes)),
        check(13, float(np.max(np.abs(np.subtract(np.divide(ours, m), by_13)))) / scale * m),
    ]


def _eq15(e: Evidence) -> EquationCheck:
    """The compiled engine against SciPy on (14)-(15), the voltage changing every sample."""
    vehicle, a = e.vehicle, e.actuator
    m, k_b, k_dl = vehicle.mass, vehicle.water.specific_weight, vehicle.drag.k_dl
    k_def = k_b * vehicle.hull.psi
    time = np.arange(0.0, 60.01, 0.3)
    voltage = 1.5 * np.sin(0.9 * time) + 0.2
    s = drive(vehicle, time=time, voltage=voltage, start_depth=20.0)
    gain = a.K1 * a.piston_area  # k_q k_u/k_v

    def rates(_: float, x: Any, u: float) -> list[float]:
        V_rate, _V, z, w = x
        jerk = (-V_rate - gain * a.depth_voltage * z + gain * u) / a.T1
        return [jerk, V_rate, w, (-k_b * x[1] + k_def * z - k_dl * w) / m]

    x, depths = np.array([0.0, vehicle.neutral_volume(20.0), 20.0, 0.0]), [20.0]
    for (t0, t1), u in zip(pairwise(time), voltage, strict=False):
        how: Any = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-14}
        x = solve_ivp(rates, (t0, t1), x, args=(u,), **how).y[:, -1]
        depths.append(float(x[2]))
    return check(15, float(np.max(np.abs(s.depth - depths))))


def _eq16(vehicle: Vehicle) -> EquationCheck:
    motion = vehicle.motion
    assert isinstance(motion, PhysicalMotion)
    p, m, drag = plant(vehicle), vehicle.mass, motion.drag
    speeds = np.linspace(-0.5, 0.5, 201)
    ours = np.array([m * drag_per_mass(float(w), p) for w in speeds])
    fast, quadratic = np.abs(speeds) > drag.epsilon, drag.k_dt * speeds * np.abs(speeds)
    other = np.where(fast, quadratic, drag.k_dl * speeds)
    rising = 0.2
    literal, right = drag.k_dl * rising, drag.k_dt * rising**2
    return check(16, scaled(ours, other), rising=rising, literal=literal, right=right)


def _small(vehicle: Vehicle) -> list[EquationCheck]:
    m, k_b, k_dl = vehicle.mass, vehicle.water.specific_weight, vehicle.drag.k_dl
    k_def = k_b * vehicle.hull.psi
    model = linearise(plant(vehicle))
    whole = model.at(FREQUENCIES)[:, :, 0]
    Z, V = whole[:, model.outputs.index("z")], whole[:, model.outputs.index("V")]
    left, s = FREQUENCIES**2 * Z, FREQUENCIES
    right = (-k_b * V + k_def * Z - k_dl * s * Z) / m
    formula = at(transfer.depth_per_volume_physical(k_b=k_b, k_def=k_def, k_dl=k_dl, m=m))
    return [
        check(18, float(np.max(np.abs(left - right) / np.abs(k_b * V / m)))),
        check(20, (Z / V, formula)),
    ]


def _shallow_motion(e: Evidence) -> list[EquationCheck]:
    """Eqs (25)-(29) on a vehicle without compressibility, as they assume."""
    K2, T2 = e.motion.K2, e.motion.T2
    free = e.vehicle.but("hull", psi=0.0)
    p, k_b, k_dl = plant(free), free.water.specific_weight, free.drag.k_dl
    motion = linearise(p._replace(positioner=1.0))
    speed = FREQUENCIES * motion.at(FREQUENCIES)[:, 0, 0]
    dV = 30e-6
    time = np.array([0.0, T2, 60.0 * T2])
    s = drive(free, time=time, volume=np.full(3, dV), start_depth=5e3)
    final = float(s.speed[2])
    record = still_starts(free, dVs=[dV], sample_time=0.05)[0]
    by_depth, by_speed = fit_depth(record), fit_speed(record)
    return [
        check(25, (speed, (-k_b / k_dl) / (free.mass / k_dl * FREQUENCIES + 1.0))),
        check(26, (by_speed.K2, K2), (by_speed.T2, T2)),
        check(27, (by_depth.K2, K2), (by_depth.T2, T2)),
        check(28, (-final / dV, k_b / k_dl), (k_b / k_dl, K2)),
        check(29, (float(s.speed[1]) / final, 1.0 - math.exp(-1.0)), (free.mass / k_dl, T2)),
    ]


def _any_depth(e: Evidence) -> list[EquationCheck]:
    vehicle = e.vehicle
    K2, T2, psi = e.motion.K2, e.motion.T2, vehicle.hull.psi
    m, k_b, k_dl = vehicle.mass, vehicle.water.specific_weight, vehicle.drag.k_dl
    k_def = k_b * psi
    p = plant(vehicle)
    physical = at(transfer.depth_per_volume_physical(k_b=k_b, k_def=k_def, k_dl=k_dl, m=m))
    by_30 = at(transfer.depth_per_volume_identified(K2=K2, T2=T2, k_def=k_def, k_dl=k_dl))
    numeric = linearise(p._replace(positioner=1.0)).at(FREQUENCIES)[:, 0, 0]
    lift = [m * acceleration(0.0, z, 0.0, p) for z in (10.0, 90.0)]
    return [
        check(30, (by_30, physical)),
        check(31, ((lift[1] - lift[0]) / 80.0, k_b * psi)),
        check(32, (at(transfer.depth_per_volume(K2=K2, T2=T2, psi=psi)), numeric)),
    ]


def _open_loop(e: Evidence) -> list[EquationCheck]:
    a, mo = e.actuator, e.motion
    assert isinstance(mo, IdentifiedMotion)
    main = dict(K1=a.K1, K2=mo.K2, A=a.piston_area, T1=a.T1, T2=mo.T2)
    loads = {"psi": e.vehicle.hull.psi, "depth_voltage": a.depth_voltage, "k_l": a.k_l}
    by_34 = transfer.depth_per_voltage(**main, **loads)
    open_loop = e.analysis.open_loop
    p = plant(e.vehicle)._replace(psi=0.0, load_drive=0.0, load_back=0.0, k_l=0.0)
    free = linearise(p).at(FREQUENCIES)[:, 0, 0]
    by_35 = at(transfer.depth_per_voltage_without_loads(**main))
    margin = math.degrees(double_integrator_phase_margin(**main))
    routh, poles = open_loop.routh.sentence, ", ".join(map(_complex, open_loop.poles))
    return [
        check(34, (open_loop.denominator, by_34[1]), routh=routh, poles=poles),
        check(35, (by_35, free), margin=margin),
    ]


def _complex(pole: complex) -> str:
    return f"{pole.real:+.5f}" + (f" {pole.imag:+.5f}i" if pole.imag else "")


def _controller(e: Evidence) -> list[EquationCheck]:
    """Eqs (36), (37): the recursion of the law against sums over all samples."""
    assert e.vehicle.controller is not None
    _, c = bind(e.vehicle.controller)
    random = np.random.default_rng(36)
    n = 400
    error = np.cumsum(random.normal(0.0, 0.02, n))
    volume = random.normal(0.0, 2e-5, n)
    reference = 2.0
    state = cascade.initial(c, Measurement(0.0, reference - error[0], volume[0]), reference)
    U, integrals = [], []
    for k in range(n):
        seen = Measurement(k * c.S_p, reference - float(error[k]), float(volume[k]))
        integrals.append(state.integral)
        _, state, _ = cascade.step(c, state, seen, reference)
        U.append(state.volume_reference)
    seen_error = reference - (reference - error)
    before = np.concatenate([[0.0], np.cumsum(seen_error)[:-1]])
    U_i = volume[0] + c.k_iz * c.S_p * before
    change = np.diff(seen_error, prepend=seen_error[0])
    by_hand = c.k_pz * seen_error + c.k_dz * change / c.S_p + U_i
    return [check(36, scaled(U, by_hand)), check(37, scaled(integrals, U_i))]
