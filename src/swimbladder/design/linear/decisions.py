"""A law that changes the volume at moments of its own: the map from one decision to the next.

About a steady speed w0 the body has the excess of weight e = psi z + V_0 - V [m3] and

    dw' = a e - d(w0) dw,   e' = psi dw,   z' = w

between decisions. A decision k sees the depths at a few samples and asks for a change of volume
u_k, a function of these; pump or valve have delivered the share eta of it after a time T_d. So

    x_{k+1} = M x_k,   x = (dw, e, u),   e jumps by -eta u_k at T_d,   u_{k+1} = sum_i s_i z(t_i)

with M from matrix exponentials, exactly, and the slopes s_i from the law's own step by differences,
its bands and steps left out: they are nonlinear, and make limit cycles. Small errors of the speed
decay if and only if the eigenvalues of M lie within the unit circle. Where the speed follows at
once and psi is 0, M has the one eigenvalue 1 - eta c/c_true, with c the law's volume per speed
squared and c_true = F_d(w)/(rho g w^2) that of the drag: 0 < eta c/c_true < 2.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from swimbladder.control.law import Law, Measurement, Way
from swimbladder.control.records import from_leaves, leaves
from swimbladder.design.linear.pump_valve import drag_slope
from swimbladder.physics.dynamics import Plant

Array = NDArray[np.float64]

_OFF = 1e-4  # of a speed, by which the law is made to act
_SMALL = 1e-6  # of the way between two decisions: a step of the differences
_CALLS = 64  # of a law within which it has to decide twice
_DEEP = 1000.0  # m, where the law is asked: what it decides depends on distances


class Decision(NamedTuple):
    """What a law that goes at a speed does from one decision to the next."""

    way: Way
    speed: float  # m/s, positive down
    faster: bool  # what it acts on: the vehicle is too fast, not too slow
    samples: tuple[float, ...]  # s since the last decision; the last one is the decision
    slopes: tuple[float, ...]  # m3/m, of the change by the depth at each of them
    largest: float  # m3, of the change from rest

    @property
    def period(self) -> float:
        """Time between two decisions [s]."""
        return self.samples[-1]

    @property
    def pumps(self) -> bool:
        """Whether what it acts on takes the pump: too fast a sinking, too slow a rise."""
        return (self.speed > 0.0) == self.faster


class Delivery(NamedTuple):
    """How pump or valve give a change of volume."""

    share: float  # -, of what was asked for
    delay: float  # s, until a change that is a little larger is there


def smooth(law: Law, parameters: Any) -> Any:
    """Return a law's parameters without its bands and steps."""
    return from_leaves(type(parameters), leaves(parameters) | dict.fromkeys(law.roundings, 0.0))


def decision_of(
    law: Law, parameters: Any, way: Way, *, down: bool, faster: bool = False
) -> Decision | None:
    """Return what a law does on a way, from its own step; None where it does not act on that.

    parameters: as they are; bands and steps are left out. faster: it goes a little too fast.
    """
    numbers = smooth(law, parameters)
    up = math.isinf(way.distance)
    sign = 1.0 if down and not up else -1.0
    speed = sign * way.speed * (1.0 + (_OFF if faster else -_OFF))

    def ask(moved: dict[int, float], until: int, pace: float = speed) -> list[tuple[float, float]]:
        """Return times and changes of `until` calls, the depth at some of them moved [m]."""
        found: list[tuple[float, float]] = []
        state, time = None, 0.0
        for call in range(until):
            depth = _DEEP + pace * time + moved.get(call, 0.0)
            reference = 0.0 if up else _DEEP + pace * last + sign * way.distance
            seen = Measurement(time, depth, math.nan)
            if state is None:
                state = law.initial(numbers, seen, reference)
            change, state, wait = law.step(numbers, state, seen, reference)
            found.append((time, change))
            time += wait
        return found

    last = 0.0
    decided: list[int] = []
    for calls in range(2, _CALLS):  # until it has decided twice, the distance that of the second
        last = ask({}, calls)[-1][0]
        called = ask({}, calls)
        decided = [n for n, (_, change) in enumerate(called) if change != 0.0]
        if len(decided) == 2:
            break
    if len(decided) != 2:
        return None
    first, second = decided
    begin, end = called[first][0], called[second][0]
    step = _SMALL * abs(speed) * (end - begin)
    slopes = []
    for call in range(first, second + 1):
        more, less = (ask({call: x}, second + 1)[-1][1] for x in (step, -step))
        slopes.append((more - less) / (2.0 * step))
    samples = tuple(called[n][0] - begin for n in range(first, second + 1))
    largest = max(abs(change) for _, change in ask({}, second + 1, 0.0))
    return Decision(way, sign * way.speed, faster, samples, tuple(slopes), largest)


def decision_map(p: Plant, d: Decision, delivery: Delivery) -> Array:
    """Return M [3, 3] of (dw, e, u) from just after one decision to just after the next."""
    A = np.array(
        [
            [-drag_slope(p, d.speed), p.a_b, 0.0],
            [p.psi, 0.0, 0.0],
            [1.0, 0.0, 0.0],  # the way since the decision
        ]
    )
    given = np.zeros((3, 3))
    given[1, 2] = -delivery.share
    late = min(delivery.delay, d.period)
    start = np.zeros((3, 3))
    start[0, 0] = start[1, 1] = 1.0
    until = expm(A * late) @ start

    def at(t: float) -> Array:
        found = expm(A * t) @ start if t < late else expm(A * (t - late)) @ (until + given)
        return np.asarray(found)

    M = at(d.period).copy()
    M[2] = sum(s * at(t)[2] for s, t in zip(d.slopes, d.samples, strict=True))
    return M
