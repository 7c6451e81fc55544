"""Volume and energy accounts, integrated along each step to the order of the method.

The motor's volume rate is a slow part, which follows voltage and depth, and a transient that
decays with T1. The transient's integrals are taken in closed form, so a step much longer than T1
loses nothing; the slow part's by Simpson's rule, with z inside the step from the cubic through
its ends. The volume pumped comes from the motor's equation alone, so that comparing it with the
change of V is a check.
"""

import math
from enum import IntEnum
from typing import Any

from swimbladder.physics.arrays import Array
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.cache import part, shared
from swimbladder.sim.engine.modes import drag, layered, split, supply_limit


class Account(IntEnum):
    """Rows of the accounts of a vehicle: integrals over time since the start."""

    PUMPED = 0  # m3, of the motor's volume rate q
    LEAKED = 1  # m3, of the leakage
    TRAVEL = 2  # m3, of |dV|
    U_Q = 3  # V m3, of u q
    U_U = 4  # V2 s, of u u
    Q_Q = 5  # m6/s, of q q
    LOAD_Q = 6  # V m3, of the depth load c z times q
    FRICTION_Q = 7  # V m3, of the dry friction's voltage times |q|
    Z_Q = 8  # m4, of z q
    LEAK_Z = 9  # m4, of z times the leakage
    Z_DV = 10  # m4, of z dV
    DRAG = 11  # m2/s2, of w F_d/m
    STOP_U = 12  # V m3, of the motor's work that an end stop made useless
    STOP_Q = 13  # m6/s2, of the q q that impacts on the end stops took
    BOTTOM_W = 14  # m2/s2, of the w w/2 that impacts on the bottom took
    MOTOR_ON = 15  # s, with a voltage on the motor, or the positioner moving
    TO_AND_FRO = 16  # m4, of |z dV|, step by step
    AT_REST = 17  # s, with the positioner holding


@part
def _simpson(a: float, b: float, c: float, h: float) -> float:
    return h * (a + 4.0 * b + c) / 6.0


@part
def _drag_power(p: Array, w: float) -> Any:
    return w * drag(p, w)[0]


@shared
def decays(p: Array, mode: int, h: float, decay: Array) -> None:
    """Fill decay [5] for `enter`: the motor's time constant and integrals of its transient over h.

    tau, and with e(t) = exp(-t/tau) the integrals of e, t e, e e and t t e.
    """
    beta = 0.0
    if (mode // 10) % 2 == 1:
        beta = p[modes.SAG] * p[modes.KAPPA] / (1.0 + p[modes.SAG])
    tau = 1.0 / (1.0 / p[modes.T1] - p[modes.GAIN] / p[modes.T1] * beta)
    decay[0] = tau
    decay[1] = -tau * math.expm1(-h / tau)
    e = math.exp(-h / tau)
    decay[2] = tau * tau * (1.0 - e * (1.0 + h / tau))
    decay[3] = -0.5 * tau * math.expm1(-2.0 * h / tau)
    decay[4] = 2.0 * tau * decay[2] - tau * h * h * e


@shared
def enter(
    p: Array, mode: int, x: Array, y: Array, u: float, h: float, decay: Array, accounts: Array
) -> None:
    """Add to the accounts what happened from x to y, h [s] later, in one mode at voltage u.

    decay: see `decays`, for this mode and h.
    """
    act, limited, _ = split(mode)
    z0, w0, z1, w1 = x[2], x[3], y[2], y[3]
    Iz = y[4] - x[4]
    zm = 0.5 * (z0 + z1) + 0.125 * h * (w0 - w1)
    wm = 1.5 * (z1 - z0) / h - 0.25 * (w0 + w1)
    accounts[Account.DRAG] += _simpson(
        _drag_power(p, w0), _drag_power(p, wm), _drag_power(p, w1), h
    )
    accounts[Account.TRAVEL] += abs(y[1] - x[1])
    if act in (modes.MOVING_OUT, modes.MOVING_IN, modes.PRESCRIBED):
        accounts[Account.PUMPED] += x[0] * h
        accounts[Account.Z_Q] += x[0] * Iz
        accounts[Account.Z_DV] += x[0] * Iz
        accounts[Account.TO_AND_FRO] += abs(x[0] * Iz)
        accounts[Account.MOTOR_ON] += h if x[0] != 0.0 else 0.0
        return
    if p[modes.GAIN] == 0.0:  # a positioner that holds
        accounts[Account.AT_REST] += h
        return
    Izz = _simpson(z0 * z0, zm * zm, z1 * z1, h)
    alpha, beta = u, 0.0  # the voltage as applied is alpha + beta q
    if limited or (act == modes.UPPER and abs(u) > supply_limit(p, u, 0.5 * (x[0] + y[0]))):
        alpha = math.copysign(p[modes.SUPPLY], u) / (1.0 + p[modes.SAG])
        beta = p[modes.SAG] * p[modes.KAPPA] / (1.0 + p[modes.SAG])
    elif act in (modes.STUCK, modes.LOWER) and p[modes.SAG] > 0.0:
        limit = p[modes.SUPPLY] / (1.0 + p[modes.SAG])
        alpha = max(-limit, min(limit, u))
    accounts[Account.MOTOR_ON] += h if alpha != 0.0 else 0.0
    if act in (modes.STUCK, modes.LOWER):
        accounts[Account.U_U] += alpha * alpha * h
        if act == modes.STUCK:
            accounts[Account.LEAKED] += p[modes.K_L] * Iz
            accounts[Account.LEAK_Z] += p[modes.K_L] * Izz
            accounts[Account.Z_DV] -= p[modes.K_L] * Izz
            accounts[Account.TO_AND_FRO] += abs(p[modes.K_L] * Izz)
        return
    load = p[modes.LOAD_BACK] if act == modes.BACKWARD else p[modes.LOAD_DRIVE]
    friction = -p[modes.FRICTION] if act == modes.BACKWARD else p[modes.FRICTION]
    if act == modes.UPPER:
        Iq = p[modes.K_L] * Iz
        Iqq = p[modes.K_L] * p[modes.K_L] * Izz
        Izq = p[modes.K_L] * Izz
    else:
        g = p[modes.GAIN] / p[modes.T1]
        tau = decay[0]
        a = g * (alpha - friction)
        b = -g * load
        Iq = tau * (a * h + b * Iz - (y[0] - x[0]))
        bend = tau * tau * tau * b * (w1 - w0) / h
        s0 = tau * (a + b * z0) - tau * tau * b * w0 + bend
        sm = tau * (a + b * zm) - tau * tau * b * wm + bend
        s1 = tau * (a + b * z1) - tau * tau * b * w1 + bend
        d = x[0] - s0
        Iqq = _simpson(s0 * s0, sm * sm, s1 * s1, h)
        Iqq += 2.0 * d * (s0 * decay[1] + (s1 - s0) / h * decay[2]) + d * d * decay[3]
        transient = z0 * decay[1] + w0 * decay[2] + 0.5 * (w1 - w0) / h * decay[4]
        Izq = _simpson(z0 * s0, zm * sm, z1 * s1, h) + d * transient
    U_q = alpha * Iq + beta * Iqq
    accounts[Account.PUMPED] += Iq
    accounts[Account.U_Q] += U_q
    accounts[Account.U_U] += alpha * alpha * h + 2.0 * alpha * beta * Iq + beta * beta * Iqq
    accounts[Account.Q_Q] += Iqq
    accounts[Account.LOAD_Q] += load * Izq
    accounts[Account.FRICTION_Q] += friction * Iq
    accounts[Account.Z_Q] += Izq
    if act == modes.LOWER_SPINNING:  # all that is pumped leaks back
        accounts[Account.LEAKED] += Iq
        accounts[Account.LEAK_Z] += Izq
    else:
        accounts[Account.LEAKED] += p[modes.K_L] * Iz
        accounts[Account.LEAK_Z] += p[modes.K_L] * Izz
    if act in (modes.FORWARD, modes.BACKWARD):
        accounts[Account.Z_DV] += Izq - p[modes.K_L] * Izz
        accounts[Account.TO_AND_FRO] += abs(Izq - p[modes.K_L] * Izz)
    elif act == modes.UPPER:
        rotor = 0.5 * p[modes.T1] / p[modes.GAIN] * (y[0] * y[0] - x[0] * x[0])
        accounts[Account.STOP_U] += U_q - load * Izq - friction * Iq - Iqq / p[modes.GAIN] - rotor


@part
def enter_impact(
    q_before: float, q_after: float, w_before: float, w_after: float, accounts: Array
) -> None:
    """Add to the accounts what an impact on an end stop or the bottom took."""
    accounts[Account.STOP_Q] += (q_before - q_after) * (q_before + q_after)
    accounts[Account.BOTTOM_W] += 0.5 * (w_before - w_after) * (w_before + w_after)


@part
def enter_bend(p: Array, layers: Any, x: Array, y: Array, h: float, accounts: Array) -> None:
    """Correct the drag's work over a step from x to y in which its law bends or jumps.

    A vehicle can slide along the jump, its speed held at epsilon by a drag between the two values:
    what the drag took is then what the pull of buoyancy gave and the motion did not gain.
    """
    z0, w0, z1, w1 = x[2], x[3], y[2], y[3]
    zm = 0.5 * (z0 + z1) + 0.125 * h * (w0 - w1)
    wm = 1.5 * (z1 - z0) / h - 0.25 * (w0 + w1)
    Vm = 0.5 * (x[1] + y[1]) + 0.125 * h * (x[0] - y[0] - p[modes.K_L] * (z0 - z1))
    pull, pull_next = _pull(p, layers, x[1], z0), _pull(p, layers, y[1], z1)
    work = _simpson(w0 * pull, wm * _pull(p, layers, Vm, zm), w1 * pull_next, h)
    accounts[Account.DRAG] += work - 0.5 * (w1 - w0) * (w1 + w0)
    accounts[Account.DRAG] -= _simpson(
        _drag_power(p, w0), _drag_power(p, wm), _drag_power(p, w1), h
    )


@part
def _pull(p: Array, layers: Any, V: float, z: float) -> Any:
    """Return the downward acceleration [m/s2] but for the drag, eqs (13), (15), (31)."""
    neutral = p[modes.PSI] * z + p[modes.V_0] + layered(layers, z)[0]
    return p[modes.A_B] * (neutral - V) + p[modes.A_S] * max(p[modes.Z_SURFACE] - z, 0.0)
