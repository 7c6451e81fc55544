"""The vertical motion of eqs (11)-(13), integrated by SciPy: the truth that a study starts from.

It shares no code with the package. Laminar drag makes the motion linear: it is advanced by the
exponential of its own matrix, exact to rounding. Any other drag goes through DOP853 at 1e-10.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

__all__ = ["Array", "Body", "Motor", "Step", "follow", "with_changes"]

Array = NDArray[np.float64]

# A component's error is held below its size here times 1e-10.
_SIZES = np.array([1e-6, 1e-5, 1.0, 0.1])  # m3/s, m3, m, m/s


@dataclass(frozen=True, kw_only=True)
class Body:
    """What moves: m dw/dt = k_b (psi z + V0 - V) - k_dl w - k_dt w|w|, eq. (13) with (15), (16)."""

    k_b: float  # N/m3, rho g
    mass: float  # kg, dry, entrained and added
    k_dl: float = 0.0  # N s/m
    k_dt: float = 0.0  # N s2/m2
    psi: float = 0.0  # m3/m

    @classmethod
    def identified(cls, *, k_b: float, K2: float, T2: float, psi: float, k_dt: float = 0.0) -> Body:
        """Return the body of eqs (28) and (29): k_dl = rho g/K2 and m = T2 k_dl."""
        return cls(k_b=k_b, mass=T2 * k_b / K2, k_dl=k_b / K2, k_dt=k_dt, psi=psi)


@dataclass(frozen=True, kw_only=True)
class Motor:
    """What changes the volume: T1 dq/dt = K1 A (u - c z) - q, dV/dt = q, eqs (11), (12), (22)."""

    K1: float  # m/s/V
    T1: float  # s
    area: float  # m2
    load: float = 0.0  # V/m, c = k_z/k_u


@dataclass(frozen=True, kw_only=True)
class Step:
    """One experiment: a rest, a voltage held for whole samples, then the piston held.

    The piston is held by the voltage that balances the sea at every instant. Volumes count from
    that of the rest, which the experimenter took for the neutral one.
    """

    sample_time: float  # s
    rest: int  # samples before the voltage
    pulse: int  # samples that it lasts
    voltage: float  # V
    start_depth: float  # m
    start_speed: float = 0.0  # m/s
    neutral_error: float = 0.0  # m3, true neutral volume at reference_depth less that of the rest
    reference_depth: float = 0.0  # m


def follow(
    body: Body | list[Body], motor: Motor | list[Motor], step: Step | list[Step], samples: int
) -> tuple[Array, Array]:
    """Return depth [m] and volume above that of the rest [m3], lanes x samples.

    Lists are lanes that differ in what is listed; their steps have one timing.
    """
    given = (body, motor, step)
    count = max(len(x) if isinstance(x, list) else 1 for x in given)
    bodies, motors, steps = (x if isinstance(x, list) else [x] * count for x in given)
    first = steps[0]
    timing = {(s.sample_time, s.rest, s.pulse) for s in steps}
    if len(timing) != 1:
        raise ValueError(f"lanes of different timing: {timing}")
    phases = [(first.rest, False), (first.pulse, True), (samples - 1, False)]
    advance = _linear if all(b.k_dt == 0.0 for b in bodies) else _by_steps
    zero = np.zeros(count)
    state = np.stack([zero, zero, [s.start_depth for s in steps], [s.start_speed for s in steps]])
    rows, at = [state[None]], 0
    for length, driven in phases:
        length = min(length, samples - 1 - at)
        if length > 0:
            lanes = _Lanes(bodies, motors, steps, driven)
            found = advance(lanes, rows[-1][-1], first.sample_time, length)
            rows.append(found)
            at += length
    path = np.concatenate(rows)
    return path[:, 2].T, path[:, 1].T


class _Lanes:
    """The coefficients of the motion, an array over lanes each."""

    def __init__(
        self, bodies: list[Body], motors: list[Motor], steps: list[Step], driven: bool
    ) -> None:
        def each(values: Any) -> Array:
            return np.array(list(values), float)

        self.gain = each(m.K1 * m.area for m in motors)
        self.T1 = each(m.T1 for m in motors)
        # While the piston is held the voltage takes the sea's load away.
        self.voltage = each(s.voltage if driven else 0.0 for s in steps)
        self.load = each(m.load if driven else 0.0 for m in motors)
        self.k_b = each(b.k_b for b in bodies)
        self.mass = each(b.mass for b in bodies)
        self.k_dl = each(b.k_dl for b in bodies)
        self.k_dt = each(b.k_dt for b in bodies)
        self.psi = each(b.psi for b in bodies)
        self.neutral = each(
            s.neutral_error - b.psi * s.reference_depth for s, b in zip(steps, bodies, strict=True)
        )

    def rates(self, _: float, flat: Array) -> Array:
        q, V, z, w = flat.reshape(4, -1)
        force = self.k_b * (self.psi * z + self.neutral - V)
        drag = self.k_dl * w + self.k_dt * w * np.abs(w)
        dq = (self.gain * (self.voltage - self.load * z) - q) / self.T1
        return np.concatenate([dq, q, w, (force - drag) / self.mass])

    def matrix(self) -> Array:
        """Return A of d(q, V, z, w, 1)/dt = A (q, V, z, w, 1), lanes x 5 x 5."""
        A = np.zeros((len(self.mass), 5, 5))
        A[:, 0, 0] = -1.0 / self.T1
        A[:, 0, 2] = -self.gain * self.load / self.T1
        A[:, 0, 4] = self.gain * self.voltage / self.T1
        A[:, 1, 0] = 1.0
        A[:, 2, 3] = 1.0
        A[:, 3, 1] = -self.k_b / self.mass
        A[:, 3, 2] = self.k_b * self.psi / self.mass
        A[:, 3, 3] = -self.k_dl / self.mass
        A[:, 3, 4] = self.k_b * self.neutral / self.mass
        return A


def _linear(lanes: _Lanes, state: Array, h: float, length: int) -> Array:
    """Return the states after 1 to `length` samples, samples x 4 x lanes."""
    one = expm(lanes.matrix() * h)
    x = np.concatenate([state, np.ones((1, state.shape[1]))]).T[..., None]
    found = np.empty((length, 4, state.shape[1]))
    for k in range(length):
        x = one @ x
        found[k] = x[:, :4, 0].T
    return found


def _by_steps(lanes: _Lanes, state: Array, h: float, length: int) -> Array:
    count = state.shape[1]
    found = solve_ivp(
        lanes.rates,
        (0.0, length * h),
        state.ravel(),
        method="DOP853",
        rtol=1e-10,
        atol=1e-10 * np.repeat(_SIZES, count),
        t_eval=h * np.arange(1, length + 1),
    )
    if not found.success:
        raise ArithmeticError(found.message)
    return found.y.T.reshape(length, 4, count)


def with_changes(
    body: Body, motor: Motor, step: Step, name: str, amount: float
) -> tuple[Body, Motor, Step]:
    """Return the three with one parameter changed.

    K2, T2, mass, drag_quadratic, K1 and T1 by the factor exp(amount); psi, neutral_error,
    start_depth and start_speed by amount, in SI units.
    """
    factor = math.exp(amount)
    if name == "K2":  # at one T2: the drag and the mass go with 1/K2
        return replace(body, k_dl=body.k_dl / factor, mass=body.mass / factor), motor, step
    if name in ("T2", "mass"):
        return replace(body, mass=body.mass * factor), motor, step
    if name == "drag_quadratic":
        return replace(body, k_dt=body.k_dt * factor), motor, step
    if name == "psi":
        return replace(body, psi=body.psi + amount), motor, step
    if name in ("K1", "T1"):
        return body, replace(motor, **{name: getattr(motor, name) * factor}), step
    return body, motor, replace(step, **{name: getattr(step, name) + amount})
