"""The right-hand side and one Rosenbrock step, on scalars.

::

    dz/dt = w + u(z, t)                                 u: vertical speed of the water
    m dw/dt = p'(z) (V_neutral(z, t) - V) - F_d(w) + rho g A_w (z_surface - z)+
    dV/dt = rate of what the drive does, over depth, and what the oil line gives (`line`)
    dT/dt = (T_water - T)/tau                           T: temperature of the hull

w is relative to the water. Water that moves carries the vehicle along: its acceleration acts on the
displaced and the added mass, so that the relative motion sees none of it (Batchelor, *An
Introduction to Fluid Dynamics*, 1967, section 6.8, for a body as heavy as the water).

Layers that have been moved keep their salt and heat: V_neutral is that of the layer which is there,
from the rest depth z - displacement, under the pressure at z, which is that of water at rest. A
vehicle as compressible as the water goes along with an internal wave, a rigid one by
N^2/(N^2 + g^2/c^2) of it, c being the speed of sound (Goodman and Levine, *J. Phys. Oceanogr.* 20,
1990, 1737).

The table's V_neutral is that of a hull as warm as the water; one that lags behind (tau > 0)
displaces more or less by its expansion, E (T - T_water).

The step is RODAS of Hairer and Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. 1996,
section VI.4: L-stable, six stages, order 4 with an embedded 3, and a cubic for what lies between.
"""

import math
from typing import Any

import numpy as np

from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater.motion import moved
from swimbladder.sim.engine.cache import apart, inlined, part
from swimbladder.sim.engine.modes import drag_at
from swimbladder.sim.engine.rodas.line import line_flow, value
from swimbladder.sim.engine.rodas.records import Doing, Lane, Table

_moved = inlined(moved)


GAMMA = 0.25
STAGES = 6
# Row by row of each stage: what the stages before it count in the state, and, over h, in the rate.
A, C = np.zeros((STAGES, STAGES - 1)), np.zeros((STAGES, STAGES - 1))
A[1, :1] = 1.544
A[2, :2] = 0.9466785280815826, 0.2557011698983284
A[3, :3] = 3.314825187068521, 2.896124015972201, 0.9986419139977817
A[4, :4] = 1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950
A[5] = *A[4, :4], 1.0
C[1, :1] = -5.6688
C[2, :2] = -2.430093356833875, -0.2063599157091915
C[3, :3] = -0.1073529058151375, -9.594562251023355, -20.47028614809616
C[4, :4] = 7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160
C[5, :3] = 8.083246795921522, -7.981132988064893, -31.52159432874371
C[5, 3:] = 16.31930543123136, -6.058818238834054
T = np.array([0.0, 0.386, 0.21, 0.63, 1.0, 1.0])  # time of each stage in the step
D = np.array([0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0])  # of what changes with time alone
H = np.zeros((2, STAGES - 1))  # of all but the last stage in k1 and k2, which make the cubic
H[0, :3] = 10.12623508344586, -7.487995877610167, -34.80091861555747
H[0, 3:] = -7.992771707568823, 1.025137723295662
H[1, :3] = -0.6762803392801253, 6.087714651680015, 16.43084320892478
H[1, 3:] = 24.76722511418386, -6.594389125716872


@part
def drag(p: Any, w: float) -> Any:
    """Return drag over mass [m/s2] and its derivative [1/s], eq. (16), other while rising."""
    share = p.rising if w < 0.0 else 1.0
    force, slope, _ = drag_at(w, p.d_l, p.d_b, p.d_0, p.d_t, p.epsilon)
    return share * force, share * slope


@part
def rate_of(p: Any, table: Array, doing: int, shut: bool, z: float, V: float, dz: float) -> Any:
    """Return dV/dt [m3/s], and its slopes over depth z [m2/s] and over dz [m2], m/s, being dz/dt.

    shut: whether the check valve behind an oil line is.
    """
    rate, slope = _drive_rate(p, table, doing, z, V)
    if shut or doing != Doing.PUMPING:
        return rate, slope, 0.0
    flow, by_depth, by_speed = line_flow(p, table, z, dz)
    return rate + flow, slope + by_depth, by_speed


@part
def _drive_rate(p: Any, table: Array, doing: int, z: float, V: float) -> Any:
    rate, slope = _asked_rate(p, table, doing, z, V)
    runs = doing == Doing.PUMPING or doing == Doing.PRIMING
    opens = p.open_running if runs else p.open
    if opens > 0.0 and doing != Doing.LETTING_IN:
        lets, by_depth = _positive(table, p.step, Table.RATE_IN, z, -opens)
        rate, slope = rate + lets, slope + by_depth
        if rate <= 0.0 and p.v_min >= V:
            return 0.0, 0.0
    return rate, slope


@part
def _asked_rate(p: Any, table: Array, doing: int, z: float, V: float) -> Any:
    if doing == Doing.PUMPING:
        return _positive(table, p.step, Table.RATE_OUT, z, p.delivery)
    if doing == Doing.LETTING_IN:
        return _positive(table, p.step, Table.RATE_IN, z, -p.flow)
    if doing == Doing.BYPASSING:
        return _positive(table, p.step, Table.BYPASS, z, -p.flow)
    if doing == Doing.PRIMING or p.v_min >= V:
        return 0.0, 0.0
    return _positive(table, p.step, Table.LEAKAGE, z, -1.0)


@part
def _positive(table: Array, step: float, what: int, z: float, sign: float) -> Any:
    r, dr, _ = value(table, step, what, max(z, 0.0))
    if r <= 0.0:
        return 0.0, 0.0
    return sign * r, (sign * dr if z > 0.0 else 0.0)


@part
def terms(v: Lane, t: float, z: float, w: float, V: float, hull: float) -> Any:
    """Return dz/dt, dw/dt, dV/dt and d hull/dt; hull: its temperature [degC]."""
    p, table, at = v.p, v.table, v.at
    _weight, slope, _ = value(table, p.step, Table.PRESSURE, z)
    neutral, _, _ = value(table, p.step, Table.NEUTRAL, z)
    neutral += p.trim + p.give * z
    pull = slope * (neutral - V) / p.mass - drag(p, w)[0]
    if at.place == 1:
        pull += p.a_s * (p.z_surface - z)
    way, u, warms = 0.0, 0.0, 0.0
    if v.waves.shape[0] > 0:
        way, u = _moved(v.waves, z, t)
        pull += slope * displaced(p, table, z, way)[0] / p.mass
    if p.follows > 0.0:
        more, _, colder, _ = lagging(p, table, z - way, hull)
        pull += slope * more / p.mass
        warms = p.follows * colder
    return w + u, pull, rate_of(p, table, at.doing, at.shut == 1, z, V, w + u)[0], warms


@part
def lagging(p: Any, table: Array, rest: float, hull: float) -> Any:
    """Return what a hull that lags behind the water adds to the neutral volume [m3].

    rest: depth at which the water there is at rest [m]; hull: its temperature [degC]. Also the same
    by depth [m3/m], by how much colder than the water it is [K], and that by depth [K/m].
    """
    water, slope, _ = value(table, p.step, Table.TEMPERATURE, max(rest, 0.0))
    if rest < 0.0:
        slope = 0.0
    return p.expansion * (water - hull), p.expansion * slope, water - hull, slope


@part
def displaced(p: Any, table: Array, z: float, way: float) -> Any:
    """Return what displaced layers add to the neutral volume at depth z [m3].

    way: how far the water there has been moved down [m]. Also by depth [m3/m] and by `way` [m3/m],
    each with the other held. What only the pressure does to water and hull moves with nothing.
    """
    here, by_depth, _ = value(table, p.step, Table.LAYERS, z)
    rest = z - way
    if rest < min(z, 0.0):  # no water has come from above the surface
        there = value(table, p.step, Table.LAYERS, min(z, 0.0))[0]
        return there - here, (0.0 if z < 0.0 else -by_depth), 0.0
    there, slope, _ = value(table, p.step, Table.LAYERS, rest)
    return there - here, slope - by_depth, -slope


@part
def slope_of_force(v: Lane, z: float, V: float, hull: float, way: float, stretch: float) -> Any:
    """Return the derivative of dw/dt by depth [1/s2] and by volume [1/m3 m/s2], in still water.

    way [m] and stretch, its derivative by depth: of the water whose heat a lagging hull is to take.
    """
    p, table = v.p, v.table
    _, slope, bend = value(table, p.step, Table.PRESSURE, z)
    neutral, dn, _ = value(table, p.step, Table.NEUTRAL, z)
    neutral += p.trim + p.give * z
    dn += p.give
    if p.follows > 0.0:
        more, by_depth, _, _ = lagging(p, table, z - way, hull)
        neutral += more
        dn += by_depth * (1.0 - stretch)
    j = (bend * (neutral - V) + slope * dn) / p.mass
    return (j - p.a_s if v.at.place == 1 else j), -slope / p.mass


@apart
def rosenbrock(v: Lane, h: float) -> None:
    """Fill work[0] with the state [4] after a step h [s], 1 with its error, 2 and 3 with k1, k2.

    Between, at the share s of the step: x (1 - s) + s (y + (1 - s) (k1 + s k2)).
    """
    p, table, waves, x, at, work = v.p, v.table, v.waves, v.x, v.at, v.work
    t, z, w = x.t, x.z, x.w
    g = 1.0 / (GAMMA * h)
    jw = -drag(p, w)[1]
    way, u, uz, ut, wt, stretch = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if waves.shape[0] > 0:
        uz, ut, stretch = _change(waves, z, t)
        way, u = _moved(waves, z, t)
    jz, jV = slope_of_force(v, z, x.v, x.hull, way, stretch)
    if waves.shape[0] > 0:
        more, by_depth, by_way = displaced(p, table, z, way)
        _, slope, bend = value(table, p.step, Table.PRESSURE, z)
        jz += (bend * more + slope * (by_depth + by_way * stretch)) / p.mass
        wt = slope * by_way * u / p.mass
    _, r, rw = rate_of(p, table, at.doing, at.shut == 1, z, x.v, w + u)
    r += rw * uz
    Vt = rw * ut
    jw += jV * rw / g
    jT, warms, Tt = 0.0, 0.0, 0.0
    if p.follows > 0.0:
        jT = jV * p.expansion
        warms = p.follows * lagging(p, table, z - way, x.hull)[3]
        Tt = -warms * u
        wt -= jT * Tt / p.follows
        warms *= 1.0 - stretch
    gT = g + p.follows
    # (g - J) U = b, from the bottom up: V by z and w, T by z, w by z
    below = (g - jw) * (g - uz) - jz - jV * r / g - jT * warms / gT
    for s in range(STAGES):
        z, w, V, hull = x.z, x.w, x.v, x.hull
        c0, c1, c2, c3 = 0.0, 0.0, 0.0, 0.0
        for n in range(s):
            k, a, c = work[STAGES + n], A[s, n], C[s, n]
            z, w, V, hull = z + a * k[0], w + a * k[1], V + a * k[2], hull + a * k[3]
            c0, c1, c2, c3 = c0 + c * k[0], c1 + c * k[1], c2 + c * k[2], c3 + c * k[3]
        f0, f1, f2, f3 = terms(v, t + T[s] * h, z, w, V, hull)
        d = h * D[s]
        b0, b1 = f0 + c0 / h + d * ut, f1 + c1 / h + d * wt
        b2, b3 = f2 + c2 / h + d * Vt, f3 + c3 / h + d * Tt
        k = work[STAGES + s]
        k[0] = (b1 + (g - jw) * b0 + jV * b2 / g + jT * b3 / gT) / below
        k[1] = (g - uz) * k[0] - b0
        k[2], k[3] = (b2 + r * k[0] + rw * k[1]) / g, (b3 + warms * k[0]) / gT
    y, e = work[0], work[1]
    y[0], y[1], y[2], y[3] = z + k[0], w + k[1], V + k[2], hull + k[3]
    for n in range(4):
        e[n] = k[n]
        for m in range(2):
            work[2 + m, n] = 0.0
            for s in range(STAGES - 1):
                work[2 + m, n] += H[m, s] * work[STAGES + s, n]


@part
def inside(x: float, y: float, k1: float, k2: float, s: float) -> Any:
    """Return a component at the share s of a step from x to y."""
    return x * (1.0 - s) + s * (y + (1.0 - s) * (k1 + s * k2))


@part
def _change(waves: Array, z: float, t: float) -> Any:
    """Return the water's speed by depth [1/s] and by time [m/s2], its displacement by depth [-]."""
    by_depth, by_time, stretch = 0.0, 0.0, 0.0
    for k in range(waves.shape[0]):
        if z >= waves[k, 5]:
            continue
        mode, decay = waves[k, 3], waves[k, 4]
        if decay > 0.0:
            shape = waves[k, 0] * math.exp(-decay * max(z, 0.0))
            bend = -decay * shape if z > 0.0 else 0.0
        else:
            shape = waves[k, 0] * math.sin(mode * max(z, 0.0))
            bend = waves[k, 0] * mode * math.cos(mode * z) if z > 0.0 else 0.0
        angle = waves[k, 1] * t + waves[k, 2]
        by_depth += bend * waves[k, 1] * math.cos(angle)
        by_time -= shape * waves[k, 1] * waves[k, 1] * math.sin(angle)
        stretch += bend * math.sin(angle)
    return by_depth, by_time, stretch
