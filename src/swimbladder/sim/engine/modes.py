"""The linear pieces of the motion, and what makes a vehicle pass from one to another.

Between events a vehicle with a held input is linear but for its drag and for layers of the water.
A mode is one such piece: one of ten states of the actuator, whether the supply limits it, and where
the vehicle is.

Layered water as a vehicle or a filter meets it: what it adds to the neutral volume, over depth.

In water of constant density the neutral volume is psi z + V0, eq. (31). What layers of salt and
heat, and a hull that is not linear, make of it beside that stands in a table over depth.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant, drag_law
from swimbladder.physics.seawater import look_up
from swimbladder.physics.seawater.column import look_up_bent, slopes
from swimbladder.sim.engine.cache import inlined, part, shared


class Layers(NamedTuple):
    """What layers of the water add to the neutral volume psi z + V0 over depth; kernels take it."""

    table: Array  # [n, 2], m3 and its slope m3/m, at depths from 0; no rows: no layers
    step: float  # m, from row to row
    steepest: float  # m3/m, no slope is steeper: for the length of a step
    largest: float  # m3, no volume of the table is larger

    def at(self, depth: float) -> float:
        """Return what is added at a depth [m3]."""
        return look_up(self.table, self.step, 0, depth)[0] if len(self.table) else 0.0

    def along(self, depth: Array) -> Array:
        """Return what is added at depths [m3] [n]."""
        return np.array([self.at(float(z)) for z in depth])

    def integral(self, depth: float) -> float:
        """Return the integral of what is added from depth 0 to `depth` [m4], exactly."""
        if not len(self.table):
            return 0.0
        h = self.step
        v, dv = self.table[:, 0], self.table[:, 1]
        # a cubic over a row: the trapezoid and a term of its slopes
        whole = h * (v[:-1] + v[1:]) / 2.0 + h * h * (dv[:-1] - dv[1:]) / 12.0
        k = int(min(max(depth / h, 0.0), len(v) - 1))
        added, slope = look_up(self.table, h, 0, depth)
        rest = depth - k * h
        part_of_row = rest * (v[k] + added) / 2.0 + rest * rest * (dv[k] - slope) / 12.0
        return float(whole[:k].sum() + part_of_row)


NO_LAYERS = Layers(np.empty((0, 2)), 1.0, 0.0, 0.0)

_look_up_bent = part(look_up_bent)


def layers_from(volume: Array, step: float) -> Layers:
    """Return layers of volumes [m3] [n] at depths 0, step, 2 step, ... [m]."""
    slope = slopes(volume, step)
    # between two rows no slope of theirs is beyond 3 secants (Fritsch and Carlson, 1980)
    secant = 3.0 * np.abs(np.diff(volume)).max() / step
    steepest = max(float(secant), float(np.abs(slope).max()))
    table = np.ascontiguousarray(np.stack([volume, slope], axis=1))
    return Layers(table, step, steepest, float(np.abs(volume).max()))


@part
def layered(layers: Any, z: float) -> Any:
    """Return what layers add to the neutral volume [m3] at depth z [m], and its slope [m3/m]."""
    if layers.table.shape[0] == 0:
        return 0.0, 0.0
    added, slope, _ = _look_up_bent(layers.table, layers.step, 0, z)
    return added, slope


class Act(IntEnum):
    """States of the actuator."""

    FORWARD = 0  # the motor turns (either way, where the load does not depend on the direction)
    BACKWARD = 1  # the motor turns back under a load that depends on the direction
    STUCK = 2  # dry friction or the efficiency holds the motor; leakage goes on
    UPPER = 3  # at the upper end stop; the pump makes up for the leakage
    LOWER = 4  # at the lower end stop, at rest
    LOWER_SPINNING = 5  # at the lower end stop, the pump not yet faster than the leakage
    MOVING_OUT = 6  # a positioner on its way to a larger volume
    MOVING_IN = 7  # a positioner on its way to a smaller volume
    HOLDING = 8  # a positioner where it should be
    PRESCRIBED = 9  # the volume follows a given ramp


class Where(IntEnum):
    """Where the vehicle is."""

    SUBMERGED = 0
    EMERGING = 1
    BOTTOM = 2


# Stiffness of the emerging hull times the squared step [-] below which a bobbing hull turns at most
# once in a step, with its greatest speed at an end: (pi/2)^2, rounded down.
SLOW_BOBBING = 2.0
QUICK_BOBBING = 0.06  # the same, above which nonlinear drag and the accounts want smaller steps
# Distance from the surface [m] plus speed [m/s] under which only rounding moves a vehicle: one that
# is neutral there would pass the surface at each step.
_STILL = 1e-12
DEEPEST = 12000.0  # m; no sea is deeper
COUNT = 60  # 3 places x 2 (limited by the supply or not) x 10 states of the actuator

FORWARD, BACKWARD, STUCK, UPPER, LOWER, LOWER_SPINNING, *_rest = map(int, Act)
MOVING_OUT, MOVING_IN, HOLDING, PRESCRIBED = _rest
SUBMERGED, EMERGING, BOTTOM = map(int, Where)


# Where each field of Plant stands in a lane's parameters.
POSITIONER, T1, GAIN, LOAD_DRIVE, LOAD_BACK, FRICTION, K_L, RATE = range(8)  # the actuator
V_MIN, V_MAX, SUPPLY, SAG, KAPPA = range(8, 13)  # its end stops and its supply
A_B, PSI, V_0, D_L, D_B, D_0, D_T, EPSILON = range(13, 21)  # buoyancy and drag
Z_SURFACE, A_S, Z_AIR, Z_BOTTOM, SWITCH_IN, SWITCH_OUT = range(21, 27)  # limits
assert all(globals()[name.upper()] == n for n, name in enumerate(Plant._fields))
assert len(Plant._fields) == SWITCH_OUT + 1


drag_at = inlined(drag_law)


@part
def drag(p: Array, w: float) -> Any:
    """Return drag over mass [m/s2], its slope [1/s] and N(w), see dynamics.drag_law."""
    return drag_at(w, p[D_L], p[D_B], p[D_0], p[D_T], p[EPSILON])


@part
def split(mode: int) -> Any:
    """Return (actuator, limited, where) of a mode."""
    return mode % 10, (mode // 10) % 2, mode // 20


@part
def linear_part(p: Array, mode: int, A: Array, b_u: Array, b_1: Array) -> Any:
    """Fill A [4, 4], b_u [4], b_1 [4] of dx/dt = A x + b_u u + b_1; return what drag does to w."""
    act, limited, where = split(mode)
    A[:, :] = 0.0
    b_u[:] = 0.0
    b_1[:] = 0.0
    if act in (FORWARD, BACKWARD, LOWER_SPINNING):
        load = p[LOAD_BACK] if act == BACKWARD else p[LOAD_DRIVE]
        friction = -p[FRICTION] if act == BACKWARD else p[FRICTION]
        g = p[GAIN] / p[T1]
        A[0, 0] = -1.0 / p[T1]
        A[0, 2] = -g * load
        b_u[0] = g
        b_1[0] = -g * friction
        if limited:  # u = (u_supply + sag kappa q)/(1 + sag)
            A[0, 0] += g * p[SAG] * p[KAPPA] / (1.0 + p[SAG])
            b_u[0] = g / (1.0 + p[SAG])
    elif act == UPPER:
        A[0, 3] = p[K_L]  # q follows k_l z
    if act in (FORWARD, BACKWARD, STUCK):
        A[1, 0] = 1.0
        A[1, 2] = -p[K_L]
    elif act in (MOVING_OUT, MOVING_IN, PRESCRIBED):
        A[1, 0] = 1.0
    if where == BOTTOM:
        if act == UPPER:
            A[0, 3] = 0.0
        return 0.0
    A[2, 3] = 1.0
    A[3, 1] = -p[A_B]
    A[3, 2] = p[A_B] * p[PSI]
    A[3, 3] = -p[D_L]
    b_1[3] = p[A_B] * p[V_0]
    if where == EMERGING:
        A[3, 2] -= p[A_S]
        b_1[3] += p[A_S] * p[Z_SURFACE]
    return 1.0


@part
def supply_limit(p: Array, u: float, q: float) -> Any:
    """Return the largest voltage [V] the supply gives in the direction of u at volume rate q."""
    sag = p[SAG]
    if sag <= 0.0:
        return p[SUPPLY]
    towards = q if u >= 0.0 else -q
    return min((p[SUPPLY] + sag * p[KAPPA] * towards) / (1.0 + sag), p[SUPPLY])


@part
def _applied(p: Array, u: float, q: float) -> Any:
    limit = supply_limit(p, u, q)
    return max(-limit, min(limit, u))


@part
def resting_volume(p: Array, layers: Any, z: float) -> Any:
    """Return the volume [m3] above which a vehicle that lies at depth z in layers rises.

    A share of 1e-12 of the stroke above neutral, so that rounding neither lifts it nor lets it go.
    """
    emerged = p[A_S] / p[A_B] * max(p[Z_SURFACE] - z, 0.0)
    neutral = p[PSI] * z + p[V_0] + layered(layers, z)[0]
    return neutral + emerged + 1e-12 * (p[V_MAX] - p[V_MIN])


@part
def _turning(p: Array, u: float, z: float, q: float) -> Any:
    """Return the state of a free motor: which way it turns, or that it is stuck."""
    if p[LOAD_DRIVE] == p[LOAD_BACK] and p[FRICTION] == 0.0:
        return FORWARD
    if q > 0.0:
        return FORWARD
    if q < 0.0:
        return BACKWARD
    v = _applied(p, u, 0.0)
    if v > p[LOAD_DRIVE] * z + p[FRICTION]:
        return FORWARD
    if v < p[LOAD_BACK] * z - p[FRICTION]:
        return BACKWARD
    return STUCK


@part
def _stop_pushes(p: Array, u: float, q: float, z: float, w: float) -> Any:
    """Return whether the upper end stop pushes against a motor that holds the volume there.

    A free motor would then deliver more than what leaks. The leakage changes by k_l w: what turns
    the motor faster or slower with it comes from the stop too, which cannot pull.
    """
    v = _applied(p, u, q)
    if p[K_L] == 0.0:
        return v >= p[LOAD_BACK] * z - p[FRICTION]
    load = p[LOAD_DRIVE] * z + p[FRICTION]
    if z < 0.0:  # in air the leakage turns the motor back
        load = p[LOAD_BACK] * z - p[FRICTION]
    return p[GAIN] * (v - load) >= p[K_L] * (z + p[T1] * w)


@shared
def event(p: Array, layers: Any, mode: int, x: Array, u: float) -> Any:
    """Return (new mode or -1, q, w, whether the state was reset) at a state x and an input u.

    u: the voltage [V], or the volume asked of a positioner [m3]. A reset is an impact: the motor
    against an end stop, the hull against the bottom. -2 instead of a mode: out of the water; -3:
    deeper than any sea.
    """
    q, V, z, w = x[0], x[1], x[2], x[3]
    act, limited, where = split(mode)
    new_act, new_limited, new_where = act, limited, where
    reset = False
    # the vehicle; at a limit the direction decides, as a step may be too small to change z or V
    if where == BOTTOM:
        if resting_volume(p, layers, z) < V:
            new_where = EMERGING if z < p[Z_SURFACE] else SUBMERGED
    elif z > DEEPEST:
        return -3, q, w, False
    elif z > p[Z_BOTTOM] or (z == p[Z_BOTTOM] and w > 0.0):
        new_where, w, reset = BOTTOM, 0.0, True
    elif abs(z - p[Z_SURFACE]) + abs(w) < _STILL:
        pass
    elif where == SUBMERGED:
        if z < p[Z_SURFACE] or (z == p[Z_SURFACE] and w < 0.0):
            new_where = EMERGING
    elif z > p[Z_SURFACE] or (z == p[Z_SURFACE] and w > 0.0):
        new_where = SUBMERGED
    elif z < p[Z_AIR]:
        return -2, q, w, False
    # the actuator
    if act in (FORWARD, BACKWARD):
        at_upper = p[V_MAX] == V and q > p[K_L] * z
        if p[V_MAX] < V or (at_upper and _stop_pushes(p, u, q, z, w)):
            new_act, q, reset = UPPER, p[K_L] * z, True
        elif p[V_MIN] > V or (p[V_MIN] == V and q < p[K_L] * z):
            # the pump may still turn outwards, slower than the leakage
            new_act, reset = LOWER_SPINNING if q > 0.0 else LOWER, True
            q = max(q, 0.0)
        elif (p[LOAD_DRIVE] != p[LOAD_BACK] or p[FRICTION] != 0.0) and (
            (act == FORWARD and q < 0.0) or (act == BACKWARD and q > 0.0)
        ):
            q = 0.0
            new_act = _turning(p, u, z, 0.0)
    elif act == STUCK:
        if p[V_MIN] > V or (p[V_MIN] == V and p[K_L] * z > 0.0):
            new_act, reset = LOWER, True
        elif p[V_MAX] < V or (p[V_MAX] == V and p[K_L] * z < 0.0):
            new_act, q, reset = UPPER, p[K_L] * z, True
        else:
            new_act = _turning(p, u, z, 0.0)
    elif act == UPPER:
        if not _stop_pushes(p, u, q, z, w):
            q = p[K_L] * z  # but for rounding, it is
            new_act = _turning(p, u, z, q)
    elif act == LOWER:
        v = _applied(p, u, 0.0)
        if v > p[LOAD_DRIVE] * z + p[FRICTION]:
            new_act = LOWER_SPINNING if p[K_L] * z > 0.0 else FORWARD
    elif act == LOWER_SPINNING:
        if q < 0.0:
            new_act, q = LOWER, 0.0
        elif q > p[K_L] * z:
            new_act = FORWARD
    elif act != PRESCRIBED:
        target = max(p[V_MIN], min(p[V_MAX], u))
        if (act == MOVING_OUT and target <= V) or (act == MOVING_IN and target >= V):
            new_act, q = HOLDING, 0.0
        elif act == HOLDING and target != V:
            new_act = MOVING_OUT if target > V else MOVING_IN
            q = p[RATE] if target > V else -p[RATE]
    # the supply
    if p[SAG] > 0.0 and new_act in (FORWARD, BACKWARD, LOWER_SPINNING):
        limit = supply_limit(p, u, q)
        if limited == 0 and abs(u) > limit + 1e-9 * p[SUPPLY]:
            new_limited = 1
        elif limited == 1 and abs(u) <= limit:
            new_limited = 0
    else:
        new_limited = 0
    new_mode = (new_where * 2 + new_limited) * 10 + new_act
    if new_mode == mode:
        return -1, q, w, False
    return new_mode, q, w, reset


@shared
def first_mode(p: Array, layers: Any, x: Array) -> Any:
    """Return (mode, q) that a state starts in; q of a positioner is its rate, 0 at its target."""
    q, V, z, w = x[0], x[1], x[2], x[3]
    where = SUBMERGED
    if z >= p[Z_BOTTOM] and w == 0.0 and resting_volume(p, layers, z) >= V:
        where = BOTTOM
    elif z < p[Z_SURFACE]:
        where = EMERGING
    if p[POSITIONER] != 0.0:
        return where * 20 + HOLDING, 0.0
    return where * 20 + _turning(p, 0.0, z, q), q
