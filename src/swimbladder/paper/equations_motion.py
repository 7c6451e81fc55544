"""Checks of eqs (10), (13), (15), (16), (18), (20), (25)-(32), (34)-(37): motion and control."""

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
from swimbladder.paper.equations_actuator import FREQUENCIES, at
from swimbladder.paper.evidence import Evidence
from swimbladder.paper.verdict import EquationCheck, check, scaled
from swimbladder.physics.dynamics import acceleration, drag_per_mass, plant
from swimbladder.sim.closed_loop import drive
from swimbladder.sim.pool import fit_depth, fit_speed, still_starts
from swimbladder.vehicle import IdentifiedMotion, PhysicalMotion, Vehicle


def motion_checks(e: Evidence) -> list[EquationCheck]:
    """Return the checks of the motion's and of the controller's equations."""
    return [
        *_forces(e.vehicle),
        _eq15(e),
        _eq16(e.hydraulic),
        *_small(e.vehicle),
        *_shallow(e),
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


def _shallow(e: Evidence) -> list[EquationCheck]:
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
