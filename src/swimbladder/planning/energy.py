"""The motion that takes the least electrical energy, by quadratic programs.

The power into the motor is u i with i = (u - k_emf omega)/R, so over a sample with u held it takes
u (u h - kappa dV')/R, dV' being the volume that the motor drives: a quadratic form of the voltages
once the motion is written as linear in them. Solved by Clarabel, an interior-point method
(Goulart and Chen, arXiv 2405.12762).

The form need not be convex: a sea that drives the motor back gives energy. Then its concave part is
replaced by its tangent, again and again (Yuille and Rangarajan, Neural Computation 15, 2003, 915):
every round takes less energy than the one before, and what they end at is a least one near by.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csc_array, csc_matrix
from scipy.sparse.linalg import splu

from swimbladder.actuator import reduced
from swimbladder.errors import NoAnswerError
from swimbladder.linear.models import Array
from swimbladder.parameters import Positioner
from swimbladder.planning.motion import Steps
from swimbladder.planning.programme import (
    Answer,
    columns_of,
    dynamics_rows,
    scale_of,
    supply_rows,
)
from swimbladder.planning.task import Task

__all__ = ["MOST", "least_energy", "winding"]

_CONVEX = 1e-9  # a curvature below minus this share of the largest is no rounding
_ROUNDS, _SETTLED = 60, 1e-7  # of the concave part's tangents, and the share that ends them
_AGAIN = 3  # tangents where a plan is given that has most of them behind it
MOST = 600  # samples: the program is dense


def winding(task: Task) -> tuple[float, float]:
    """Return R [ohm] and kappa [V s/m3] of the motor.

    Raises NoAnswerError where they are not known apart from the gains they are part of.
    """
    actuator = task.vehicle.actuator
    if isinstance(actuator, Positioner):
        raise NoAnswerError(
            "the energy of a positioner is not known: nothing says what its motor draws. "
            "Plan for --goal effort, the least volume moved"
        )
    found = reduced(actuator, task.vehicle.water)
    if found.resistance is None or found.kappa is None:
        raise NoAnswerError(
            "the energy is not known: the motor's resistance R and torque constant k_T (k_emf) are "
            "not given, and an identified K1 does not tell them apart. Describe the actuator as "
            "kind electromechanical, electrohydraulic or unified with resistance and emf_constant, "
            "or plan for --goal effort, the least volume moved"
        )
    return found.resistance, found.kappa


def least_energy(
    task: Task, steps: Steps, end: int, around: tuple[Array, float] | None,
    near: Answer | None = None,
) -> Answer | None:  # fmt: skip
    """Return the motion to rest at sample `end` of least energy [J], None where there is none.

    near: a plan for another course, to begin at where the energy is not convex.
    Raises NoAnswerError for more samples than a dense program takes.
    """
    n = len(steps.A)
    if n > MOST:
        raise NoAnswerError(
            f"the least energy is computed for up to {MOST} samples, and these are {n}: plan with "
            "a longer sample time (--sample-time)"
        )
    import clarabel

    R, kappa = winding(task)
    scale, h = scale_of(task), task.sample_time
    S, U = scale.state, scale.command
    x, _ = columns_of(n)
    states = 4 * (n + 1)
    rows = dynamics_rows(task, steps, scale)
    whole = csc_array(rows.matrix(states + n))
    solver = splu(csc_matrix(whole[:, :states]))
    G = -solver.solve(whole[:, states:].toarray())  # states = G voltages + fixed
    fixed = solver.solve(rows.right)

    def of(sample: Any, i: int) -> tuple[Array, Array]:
        at = x[sample, i]
        return G[at] * S[i], fixed[at] * S[i]

    before, after = np.arange(n), np.arange(1, n + 1)
    (V1, v1), (V0, v0), (Z1, z1), (Z0, z0) = (
        of(after, 1),
        of(before, 1),
        of(after, 2),
        of(before, 2),
    )
    leak = 0.5 * task.plant.k_l * h
    driven, constant = V1 - V0 + leak * (Z1 + Z0), v1 - v0 + leak * (z1 + z0)
    half = U * U * h / R * np.eye(n) - kappa * U / R * driven
    P = half + half.T
    c = -kappa * U / R * constant
    values, vectors = np.linalg.eigh(P)
    convex = bool(values[0] >= -_CONVEX * values[-1])
    bent = vectors * np.maximum(values, 0.0) @ vectors.T
    sunk = vectors * np.maximum(-values, 0.0) @ vectors.T
    right: list[Array] = []
    left: list[Array] = []

    def keep(matrix: Any, value: Any, limit: float | Array) -> None:
        left.append(matrix)
        right.append(np.broadcast_to(limit, len(matrix)) - value)

    one, zero = np.eye(n), np.zeros(n)
    for sign, side in ((1.0, 1), (-1.0, 0)):
        keep(sign * one, zero, sign * task.command[side] / U)
        for i, limit in ((1, task.volume), (2, task.depth), (3, task.speed)):
            if np.isfinite(limit[side]):
                keep(sign * G[x[1:, i]], sign * fixed[x[1:, i]], sign * limit[side] / S[i])
        if around is not None:
            speeds, reach = around
            bound = (sign * speeds[1:] + reach) / S[3]
            keep(sign * G[x[1:, 3]], sign * fixed[x[1:, 3]], bound)
    sag = supply_rows(task, n, scale)
    if sag is not None:
        matrix = sag.matrix(states + n)
        keep(
            (matrix[:, states:] + matrix[:, :states] @ G), matrix[:, :states] @ fixed, sag.right
        )  # fmt: skip
    rest = np.array(task.state_of_rest(task.target)) / S
    equal = G[x[end:].ravel()]
    equal_right = np.tile(rest, n + 1 - end) - fixed[x[end:].ravel()]
    unit = float(np.abs(P).max())
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = 400
    A = csc_matrix(np.vstack([equal, *left]))
    cones = [clarabel.ZeroConeT(len(equal)), clarabel.NonnegativeConeT(A.shape[0] - len(equal))]
    b = np.concatenate([equal_right, *right])
    commands, before_it = np.zeros(n) if near is None else near.commands / U, np.inf
    rounds = _ROUNDS if near is None else _AGAIN
    for _ in range(1 if convex else rounds):
        found = clarabel.DefaultSolver(
            csc_matrix(np.triu(bent / unit)), (c - sunk @ commands) / unit, A, b, cones, settings
        ).solve()
        status = str(found.status)
        if "Infeasible" in status:
            return None
        if "Solved" not in status:
            raise NoAnswerError(
                f"the quadratic program of {n} samples was not solved ({status}): plan with a "
                "longer sample time (--sample-time)"
            )
        commands = np.asarray(found.x)
        taken = float(commands @ (0.5 * P @ commands + c))
        if before_it - taken <= _SETTLED * abs(taken):
            break
        before_it = taken
    z = (G @ commands + fixed)[x] * S
    gap = abs(found.obj_val - found.obj_val_dual) / (1.0 + abs(found.obj_val))
    return Answer(z, commands * U, taken, float(gap), float(found.r_prim), convex)
