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
from numpy.typing import NDArray

from swimbladder.physics.seawater.motion import moved
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.modes import drag_at
from swimbladder.sim.engine.rodas.line import line_flow
from swimbladder.sim.engine.rodas.lookup import value
from swimbladder.sim.engine.rodas.records import Doing, Table

Array = NDArray[np.float64]


_moved = inlined(moved)


GAMMA = 0.25
A21, A31, A32 = 1.544, 0.9466785280815826, 0.2557011698983284
A41, A42, A43 = 3.314825187068521, 2.896124015972201, 0.9986419139977817
A51, A52, A53, A54 = 1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950
C21, C31, C32 = -5.6688, -2.430093356833875, -0.2063599157091915
C41, C42, C43 = -0.1073529058151375, -9.594562251023355, -20.47028614809616
C51, C52, C53, C54 = 7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160
C61, C62, C63 = 8.083246795921522, -7.981132988064893, -31.52159432874371
C64, C65 = 16.31930543123136, -6.058818238834054
T2, T3, T4 = 0.386, 0.21, 0.63
D1, D2, D3, D4 = 0.25, -0.1043, 0.1035, -0.0362
H21, H22, H23 = 10.12623508344586, -7.487995877610167, -34.80091861555747
H24, H25 = -7.992771707568823, 1.025137723295662
H31, H32, H33 = -0.6762803392801253, 6.087714651680015, 16.43084320892478
H34, H35 = 24.76722511418386, -6.594389125716872


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
    if p.line == 0.0 or shut or doing != Doing.PUMPING:
        return rate, slope, 0.0
    flow, by_depth, by_speed = line_flow(p, table, z, dz)
    return rate + flow, slope + by_depth, by_speed


@part
def _drive_rate(p: Any, table: Array, doing: int, z: float, V: float) -> Any:
    rate, slope = _asked_rate(p, table, doing, z, V)
    if p.open > 0.0 and doing != Doing.LETTING_IN:
        lets, by_depth = _positive(table, p.step, Table.RATE_IN, z, -p.open)
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
def terms(p, table, waves, doing, shut, emerging, t, z, w, V, hull):  # type: ignore[no-untyped-def]
    """Return dz/dt, dw/dt, dV/dt and d hull/dt; hull: its temperature [degC]."""
    _weight, slope, _ = value(table, p.step, Table.PRESSURE, z)
    neutral, _, _ = value(table, p.step, Table.NEUTRAL, z)
    neutral += p.trim + p.give * z
    pull = slope * (neutral - V) / p.mass - drag(p, w)[0]
    if emerging:
        pull += p.a_s * (p.z_surface - z)
    way, u, warms = 0.0, 0.0, 0.0
    if waves.shape[0] > 0:
        way, u = _moved(waves, z, t)
        pull += slope * displaced(p, table, z, way)[0] / p.mass
    if p.follows > 0.0:
        more, _, colder, _ = lagging(p, table, z - way, hull)
        pull += slope * more / p.mass
        warms = p.follows * colder
    return w + u, pull, rate_of(p, table, doing, shut, z, V, w + u)[0], warms


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
def slope_of_force(p, table, emerging, z, V, hull, way, stretch):  # type: ignore[no-untyped-def]
    """Return the derivative of dw/dt by depth [1/s2] and by volume [1/m3 m/s2], in still water.

    way [m] and stretch, its derivative by depth: of the water whose heat a lagging hull is to take.
    """
    _, slope, bend = value(table, p.step, Table.PRESSURE, z)
    neutral, dn, _ = value(table, p.step, Table.NEUTRAL, z)
    neutral += p.trim + p.give * z
    dn += p.give
    if p.follows > 0.0:
        more, by_depth, _, _ = lagging(p, table, z - way, hull)
        neutral += more
        dn += by_depth * (1.0 - stretch)
    j = (bend * (neutral - V) + slope * dn) / p.mass
    return (j - p.a_s if emerging else j), -slope / p.mass


@part
def rosenbrock(p, table, waves, doing, shut, emerging, t, z, w, V, hull, h, y, e, k1, k2):  # type: ignore[no-untyped-def]
    """Fill y with the state [4] after a step h [s], e with its error, k1, k2 with the cubic's part.

    Between, at the share s of the step: x (1 - s) + s (y + (1 - s) (k1 + s k2)).
    """
    g = 1.0 / (GAMMA * h)
    jw = -drag(p, w)[1]
    way, u, uz, ut, wt, stretch = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if waves.shape[0] > 0:
        uz, ut, stretch = _change(waves, z, t)
        way, u = _moved(waves, z, t)
    jz, jV = slope_of_force(p, table, emerging, z, V, hull, way, stretch)
    if waves.shape[0] > 0:
        more, by_depth, by_way = displaced(p, table, z, way)
        _, slope, bend = value(table, p.step, Table.PRESSURE, z)
        jz += (bend * more + slope * (by_depth + by_way * stretch)) / p.mass
        wt = slope * by_way * u / p.mass
    _, r, rw = rate_of(p, table, doing, shut, z, V, w + u)
    r += rw * uz
    Vt = rw * ut
    jw += jV * rw / g
    jT, warms, Tt = 0.0, 0.0, 0.0
    if p.follows > 0.0:
        jT = jV * p.expansion
        warms = p.follows * lagging(p, table, z - way, hull)[3]
        Tt = -warms * u
        wt -= jT * Tt / p.follows
        warms *= 1.0 - stretch
    gT = g + p.follows
    # (g - J) U = b, from the bottom up: V by z and w, T by z, w by z
    below = (g - jw) * (g - uz) - jz - jV * r / g - jT * warms / gT

    f0, f1, f2, f3 = terms(p, table, waves, doing, shut, emerging, t, z, w, V, hull)
    b0, b1, b2, b3 = f0 + h * D1 * ut, f1 + h * D1 * wt, f2 + h * D1 * Vt, f3 + h * D1 * Tt
    a0 = (b1 + (g - jw) * b0 + jV * b2 / g + jT * b3 / gT) / below
    a1 = (g - uz) * a0 - b0
    a2, a3 = (b2 + r * a0 + rw * a1) / g, (b3 + warms * a0) / gT

    f0, f1, f2, f3 = terms(p, table, waves, doing, shut, emerging, t + T2 * h, z + A21 * a0,
                           w + A21 * a1, V + A21 * a2, hull + A21 * a3)  # fmt: skip
    b0, b1 = f0 + C21 * a0 / h + h * D2 * ut, f1 + C21 * a1 / h + h * D2 * wt
    b2, b3 = f2 + C21 * a2 / h + h * D2 * Vt, f3 + C21 * a3 / h + h * D2 * Tt
    c0 = (b1 + (g - jw) * b0 + jV * b2 / g + jT * b3 / gT) / below
    c1 = (g - uz) * c0 - b0
    c2, c3 = (b2 + r * c0 + rw * c1) / g, (b3 + warms * c0) / gT

    f0, f1, f2, f3 = terms(p, table, waves, doing, shut, emerging, t + T3 * h,
                           z + A31 * a0 + A32 * c0, w + A31 * a1 + A32 * c1,
                           V + A31 * a2 + A32 * c2, hull + A31 * a3 + A32 * c3)  # fmt: skip
    b0 = f0 + (C31 * a0 + C32 * c0) / h + h * D3 * ut
    b1 = f1 + (C31 * a1 + C32 * c1) / h + h * D3 * wt
    b2 = f2 + (C31 * a2 + C32 * c2) / h + h * D3 * Vt
    b3 = f3 + (C31 * a3 + C32 * c3) / h + h * D3 * Tt
    d0 = (b1 + (g - jw) * b0 + jV * b2 / g + jT * b3 / gT) / below
    d1 = (g - uz) * d0 - b0
    d2, d3 = (b2 + r * d0 + rw * d1) / g, (b3 + warms * d0) / gT

    f0, f1, f2, f3 = terms(p, table, waves, doing, shut, emerging, t + T4 * h,
                           z + A41 * a0 + A42 * c0 + A43 * d0, w + A41 * a1 + A42 * c1 + A43 * d1,
                           V + A41 * a2 + A42 * c2 + A43 * d2,
                           hull + A41 * a3 + A42 * c3 + A43 * d3)  # fmt: skip
    b0 = f0 + (C41 * a0 + C42 * c0 + C43 * d0) / h + h * D4 * ut
    b1 = f1 + (C41 * a1 + C42 * c1 + C43 * d1) / h + h * D4 * wt
    b2 = f2 + (C41 * a2 + C42 * c2 + C43 * d2) / h + h * D4 * Vt
    b3 = f3 + (C41 * a3 + C42 * c3 + C43 * d3) / h + h * D4 * Tt
    e0 = (b1 + (g - jw) * b0 + jV * b2 / g + jT * b3 / gT) / below
    e1 = (g - uz) * e0 - b0
    e2, e3 = (b2 + r * e0 + rw * e1) / g, (b3 + warms * e0) / gT

    z5 = z + A51 * a0 + A52 * c0 + A53 * d0 + A54 * e0
    w5 = w + A51 * a1 + A52 * c1 + A53 * d1 + A54 * e1
    V5 = V + A51 * a2 + A52 * c2 + A53 * d2 + A54 * e2
    T5 = hull + A51 * a3 + A52 * c3 + A53 * d3 + A54 * e3
    f0, f1, f2, f3 = terms(p, table, waves, doing, shut, emerging, t + h, z5, w5, V5, T5)
    b0 = f0 + (C51 * a0 + C52 * c0 + C53 * d0 + C54 * e0) / h
    b1 = f1 + (C51 * a1 + C52 * c1 + C53 * d1 + C54 * e1) / h
    b2 = f2 + (C51 * a2 + C52 * c2 + C53 * d2 + C54 * e2) / h
    b3 = f3 + (C51 * a3 + C52 * c3 + C53 * d3 + C54 * e3) / h
    g0 = (b1 + (g - jw) * b0 + jV * b2 / g + jT * b3 / gT) / below
    g1 = (g - uz) * g0 - b0
    g2, g3 = (b2 + r * g0 + rw * g1) / g, (b3 + warms * g0) / gT

    z5, w5, V5, T5 = z5 + g0, w5 + g1, V5 + g2, T5 + g3
    f0, f1, f2, f3 = terms(p, table, waves, doing, shut, emerging, t + h, z5, w5, V5, T5)
    b0 = f0 + (C61 * a0 + C62 * c0 + C63 * d0 + C64 * e0 + C65 * g0) / h
    b1 = f1 + (C61 * a1 + C62 * c1 + C63 * d1 + C64 * e1 + C65 * g1) / h
    b2 = f2 + (C61 * a2 + C62 * c2 + C63 * d2 + C64 * e2 + C65 * g2) / h
    b3 = f3 + (C61 * a3 + C62 * c3 + C63 * d3 + C64 * e3 + C65 * g3) / h
    e[0] = (b1 + (g - jw) * b0 + jV * b2 / g + jT * b3 / gT) / below
    e[1] = (g - uz) * e[0] - b0
    e[2], e[3] = (b2 + r * e[0] + rw * e[1]) / g, (b3 + warms * e[0]) / gT
    y[0], y[1], y[2], y[3] = z5 + e[0], w5 + e[1], V5 + e[2], T5 + e[3]
    k1[0] = H21 * a0 + H22 * c0 + H23 * d0 + H24 * e0 + H25 * g0
    k1[1] = H21 * a1 + H22 * c1 + H23 * d1 + H24 * e1 + H25 * g1
    k1[2] = H21 * a2 + H22 * c2 + H23 * d2 + H24 * e2 + H25 * g2
    k1[3] = H21 * a3 + H22 * c3 + H23 * d3 + H24 * e3 + H25 * g3
    k2[0] = H31 * a0 + H32 * c0 + H33 * d0 + H34 * e0 + H35 * g0
    k2[1] = H31 * a1 + H32 * c1 + H33 * d1 + H34 * e1 + H35 * g1
    k2[2] = H31 * a2 + H32 * c2 + H33 * d2 + H34 * e2 + H35 * g2
    k2[3] = H31 * a3 + H32 * c3 + H33 * d3 + H34 * e3 + H35 * g3


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
