"""From where no controller brings a vehicle back: the null-controllable set of its falling.

With psi > 0 a vehicle below its neutral depth falls ever faster. The body

    z' = w,   w' = a (psi z + V0 - V) - D(w),   V within the stroke, |V'| <= R

is monotone: more volume at every instant means less depth and less speed for all time (Kamke's
condition: dw'/dz = a psi >= 0, dz'/dw = 1 > 0, and V enters with one sign). So of all controllers
the one that extends at once and at full rate R falls least, and where it falls without end any
does. R is at most K1 A times the supply: load, lag and leakage of the motor only take away from
it.

With laminar drag the falling has one unstable mode, eta = w + (d + s) z with s^2 + d s = a psi:
eta' = s eta + a (V0 - V). It stays finite if and only if (Hu and Lin, Control Systems with
Actuator Saturation, Birkhaeuser 2001, chapter 2, for a bounded V; here with the ramp that a
bounded V' takes)

    eta(0) < a int_0^inf exp(-s t) (V_best(t) - V0) dt
           = (a/s) [V(0) - V0 + (R/s) (1 - exp(-s T))],     T = (V_max - V(0))/R

Without a limit on V' this is (a/s)(V_max - V0): at rest, the depth at which the stroke's end is
neutral. With other drag the fastest extension is integrated. Rising has no such edge: at the
surface the vehicle floats.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from swimbladder.physics.dynamics import Plant, acceleration

Array = NDArray[np.float64]

_FASTEST = 50.0  # m/s, beyond any vehicle's speed
_PIECE = 20.0  # s, between two looks at where it is


def unstable_rate(p: Plant) -> float:
    """Return the rate s [1/s] of the unstable mode of a hull with laminar drag; 0 without one."""
    if p.psi <= 0.0:
        return 0.0
    d, b = (p.d_l if p.epsilon > 0.0 else p.d_b), p.a_b * p.psi
    # not -d/2 + sqrt(...): that cancels where the mode is slow
    return 2.0 * b / (d + math.sqrt(d * d + 4.0 * b))


def fastest_rate(p: Plant) -> float:
    """Return an upper bound of how fast the volume grows [m3/s]."""
    return p.rate if p.positioner else p.gain * p.supply


def holdable_depth(p: Plant) -> float:
    """Return the depth below which the whole stroke does not balance the vehicle [m]."""
    return (p.V_max - p.V_0) / p.psi if p.psi > 0.0 else math.inf


def mode_bound(p: Plant, volume: float) -> float:
    """Return what eta = w + (d + s) z has to stay below [m/s], laminar drag and psi > 0.

    volume: to begin with [m3].
    """
    s, R = unstable_rate(p), fastest_rate(p)
    ramp = (p.V_max - volume) / R
    reached = volume - p.V_0 + R / s * -math.expm1(-s * ramp)
    return p.a_b / s * reached


def falls(p: Plant, *, depth: float, speed: float, volume: float) -> bool:
    """Return whether no controller keeps a vehicle from falling without end.

    depth [m], speed [m/s], volume [m3].
    """
    if p.psi <= 0.0:
        return False
    if math.isinf(p.epsilon):
        s = unstable_rate(p)
        return speed + (p.d_l + s) * depth >= mode_bound(p, volume)
    return _integrated(p._replace(a_s=0.0), depth, speed, volume)  # no surface that turns it


def _integrated(p: Plant, depth: float, speed: float, volume: float) -> bool:
    """Return whether the vehicle still falls once it is below what the stroke balances."""
    R, deepest = fastest_rate(p), holdable_depth(p)

    def rates(t: float, x: Array) -> list[float]:
        V = min(p.V_max, volume + R * t)
        return [x[1], acceleration(V, x[0], x[1], p)]

    ramp = max((p.V_max - volume) / R, 0.0)
    x = np.array([depth, speed])
    if ramp > 0.0:
        x = solve_ivp(rates, (0.0, ramp), x, rtol=1e-9, atol=1e-9).y[:, -1]
    while True:  # with the stroke out: either it turns, or it passes the depth of no return
        if x[1] <= 0.0 and x[0] < deepest:
            return False
        if x[1] >= 0.0 and x[0] >= deepest:
            return True
        x = solve_ivp(rates, (ramp, ramp + _PIECE), x, rtol=1e-9, atol=1e-9).y[:, -1]
        ramp += _PIECE


def edge_speed(p: Plant, *, depth: float, volume: float) -> float:
    """Return the speed [m/s, down] from which on no controller stops the fall at `depth` [m].

    inf where there is none: psi is not above 0.
    """
    if p.psi <= 0.0:
        return math.inf
    if math.isinf(p.epsilon):
        return mode_bound(p, volume) - (p.d_l + unstable_rate(p)) * depth
    if falls(p, depth=depth, speed=-_FASTEST, volume=volume):
        return -math.inf
    if not falls(p, depth=depth, speed=_FASTEST, volume=volume):
        return math.inf

    def side(speed: float) -> float:
        return 1.0 if falls(p, depth=depth, speed=speed, volume=volume) else -1.0

    return float(brentq(side, -_FASTEST, _FASTEST, xtol=1e-4))
