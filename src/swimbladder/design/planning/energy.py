"""The motion that takes the least electrical energy, by sparse quadratic programs.

The power into the motor is u i with i = (u - k_emf omega)/R, so over a sample with u held it takes
u (u h - kappa dV')/R, dV' being the volume that the motor drives.

That form is not convex in voltages and states, though mostly it is on the motions that there are:
they begin and end at rest, and what the sea gives on the way is what it took. To show a solver so,
the change of a storage x P x/2 over each sample, which sums up to a constant, is added to what the
sample takes (Willems, Arch. Rational Mech. Anal. 45, 1972, 321). With P by Riccati's recursion
from the end, where any multiple of the distance from rest may be added, a sample then takes
H (u + K x)^2/2; all H above 0 prove that the program is convex, and its optimum the only one.

Where some are not, what they lack is added and its tangent taken away, again and again (Yuille and
Rangarajan, Neural Computation 15, 2003, 915): every round takes less energy than the one before,
and what they end at is a least one near by.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array

from swimbladder.design.linear.models import Array
from swimbladder.design.planning.linear_program import (
    Goal,
    Near,
    Solved,
    answer_of,
    columns_of,
    driven_by,
    interior,
    posed,
    scale_of,
)
from swimbladder.design.planning.task import STATES, Steps, Task
from swimbladder.physics.buoyancy_engine import Winding, known_winding

_CONVEX = 1e-9  # a curvature below this share of the largest is none
_AT_REST = (0.0, 1.0, 1e2, 1e4, 1e6)  # multiples of the distance from rest at the end
_ADDED = 1e-3  # of the curvature, added first where it is not enough
_ROUNDS, _SETTLED = 60, 1e-7  # of tangents, and the share that ends them


class Form(NamedTuple):
    """What the samples take [J], scaled: r u^2/2 + u (s x) + t u, x+ = A x + B u + c."""

    A: Array  # [n, 4, 4]
    B: Array  # [n, 4]
    c: Array  # [n, 4]
    r: Array  # [n]
    s: Array  # [n, 4]
    t: Array  # [n]


def winding(task: Task) -> Winding:
    """Return the winding of the motor; raises NoAnswerError where it is not known."""
    return known_winding(task.vehicle, instead="plan for `goal='effort'`, the least volume moved")


def electrical(task: Task, answer: Solved) -> float:
    """Return the electrical energy into the motor [J]; raises as `winding` does."""
    R, kappa = winding(task)
    h, u = task.sample_time, answer.commands
    return float(np.sum(u * (u * h - kappa * np.diff(driven_by(task, answer)))) / R)


def least_energy(task: Task, steps: Steps, end: int, near: Near | None = None) -> Solved | None:
    """Return the motion to rest at sample `end` of least energy [J], None where there is none.

    Raises NoAnswerError where the solver gives up.
    """
    n = len(steps.A)
    form = _form(task, steps)
    added, storage = 0.0, _storage(form)
    convex = storage is not None
    while storage is None:
        added = 4.0 * added if added else _ADDED * float(form.r.max())
        storage = _storage(form._replace(r=form.r + added))
    cost, Q = _squares(form._replace(r=form.r + added), *storage)
    unit = float(np.abs(Q.data).max())
    problem = posed(task, steps, Goal(near=None, rest=end), near, costly=False)
    _, u = columns_of(n)
    commands, best = np.zeros(n), math.inf
    answer = None
    for _ in range(_ROUNDS):
        bent = cost.copy()
        bent[u] -= added * commands
        found = interior(problem._replace(cost=bent / unit, Q=Q / unit))
        if found is None:
            return None
        answer = answer_of(task, n, found, near)
        before, best = best, electrical(task, answer)
        gap = abs(found.objective - found.dual) / (1.0 + abs(best) / unit)
        answer = answer._replace(objective=best, gap=gap, proven=convex)
        if convex or before - best <= _SETTLED * abs(best):
            break
        commands = found.x[u]
    return answer


def _form(task: Task, steps: Steps) -> Form:
    R, kappa = winding(task)
    scale, h = scale_of(task), task.sample_time
    S, U = scale.state, scale.command
    A = steps.A * S / S[:, None]
    B, c = steps.B * U / S, steps.c / S
    V, z = (S[STATES.index(name)] * np.eye(4)[STATES.index(name)] for name in ("V", "z"))
    leak = 0.5 * task.plant.k_l * h * z
    after, before = V + leak, leak - V  # the volume driven is after x+ + before x
    back = kappa * U / R
    r = 2.0 * (U * U * h / R - back * (B @ after))
    return Form(A=A, B=B, c=c, r=r, s=-back * (after @ A + before), t=-back * (c @ after))


def _storage(form: Form) -> tuple[Array, Array] | None:
    """Return the storage P [n + 1, 4, 4] and the curvatures H [n], None where some are not > 0."""
    n, largest = len(form.r), float(form.r.max())
    for rest in _AT_REST:
        P, H = np.zeros((n + 1, 4, 4)), np.zeros(n)
        P[n] = rest * largest * np.eye(4)
        for k in range(n - 1, -1, -1):
            A, B = form.A[k], form.B[k]
            PB = P[k + 1] @ B
            H[k] = form.r[k] + B @ PB
            if H[k] <= _CONVEX * largest:
                break
            across = form.s[k] + PB @ A
            P[k] = A.T @ P[k + 1] @ A - np.outer(across, across) / H[k]
        else:
            return P, H
    return None


def _squares(form: Form, P: Array, H: Array) -> tuple[Array, coo_array]:
    """Return cost and Q (upper triangular) of the samples' squares, H (u + K x)^2/2."""
    n = len(H)
    x, u = columns_of(n)
    at = np.column_stack([x[:-1], u])  # the five variables of a sample
    PB = np.einsum("kij,kj->ki", P[1:], form.B)
    Pc = np.einsum("kij,kj->ki", P[1:], form.c)
    across = form.s + np.einsum("ki,kij->kj", PB, form.A)
    K = np.column_stack([across / H[:, None], np.ones(n)])
    squares = H[:, None, None] * K[:, :, None] * K[:, None, :]
    cost = np.zeros(5 * n + 4)
    cost[x[:-1]] = np.einsum("ki,kij->kj", Pc, form.A)
    cost[u] = form.t + np.einsum("ki,ki->k", Pc, form.B)
    i, j = np.triu_indices(5)
    where = (at[:, i].ravel(), at[:, j].ravel())
    return cost, coo_array((squares[:, i, j].ravel(), where), shape=(len(cost), len(cost)))
