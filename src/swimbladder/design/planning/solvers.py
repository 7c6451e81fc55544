"""Linear and quadratic programs of many samples: through the interior, or by pivots to a corner.

An interior-point method (Clarabel; Goulart and Chen, arXiv 2405.12762) takes some twenty sparse
factorisations whatever the program, and ends in the middle of its optima, so that what it finds
moves little when the program does. The simplex method (HiGHS) ends at one of their corners, and
from one program to the next at another; and now and then it is stuck for minutes. It is there for
what the other does not solve.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csc_matrix, csr_array, eye_array, vstack

from swimbladder.design.linear.models import Array
from swimbladder.errors import NoAnswerError

# On scaled rows: the dual simplex method, then an interior-point method with a crossover.
_ATTEMPTS = ("highs-ds", "highs-ipm")
_EXACT = {"primal_feasibility_tolerance": 1e-9, "dual_feasibility_tolerance": 1e-9}
_PIVOTS = 5  # for each row, after which the simplex method is held to be stuck
_INTERIOR = 400  # rounds: mostly it takes twenty
_TIGHT = 1e-10  # of its gap and residuals


class Problem(NamedTuple):
    """Minimise cost x + x Q x/2 with A x = b, G x <= g, low <= x <= high; Q upper triangular."""

    cost: Array
    A: csr_array[np.float64, tuple[int, int]]
    b: Array
    G: csr_array[np.float64, tuple[int, int]] | None
    g: Array
    low: Array
    high: Array
    Q: Any = None


class Optimum(NamedTuple):
    """The best x, its objective and the dual's, the largest residual of the rows, their prices."""

    x: Array
    objective: float
    dual: float
    infeasibility: float
    prices: Array  # of each row of G: what a unit more of g would save

    @property
    def gap(self) -> float:
        """Of primal and dual objective, over 1 + their size."""
        return abs(self.objective - self.dual) / (1.0 + abs(self.objective))


def vertex(problem: Problem) -> Optimum | None:
    """Return the optimum of a linear program at a corner, None where nothing meets the rows.

    Raises NoAnswerError where the methods give up.
    """
    cost, A, b, G, g, low, high, _ = problem
    for method in _ATTEMPTS:
        options: dict[str, Any] = dict(_EXACT)
        if method == "highs-ds":
            options["maxiter"] = _PIVOTS * (len(b) + len(g))
        found = linprog(  # type: ignore[call-overload]  # the stubs know the options one by one
            cost, A_ub=G, b_ub=g if G is not None else None, A_eq=A, b_eq=b,
            bounds=np.column_stack([low, high]), method=method, options=options,
        )  # fmt: skip
        if found.status in (0, 2):
            break
    if found.status == 2:
        return None
    if found.status != 0:
        raise _unsolved(problem, found.message)
    dual = float(b @ found.eqlin.marginals)
    for bound, marginals in ((low, found.lower.marginals), (high, found.upper.marginals)):
        held = np.isfinite(bound)
        dual += float(bound[held] @ marginals[held])
    if G is not None:
        dual += float(g @ found.ineqlin.marginals)
    prices = np.zeros(0) if G is None else -found.ineqlin.marginals
    return Optimum(found.x, float(found.fun), dual, _worst(problem, found.x), prices)


def interior(problem: Problem) -> Optimum | None:
    """Return the optimum in the middle of all, None where nothing meets the rows.

    Raises NoAnswerError where the method gives up.
    """
    import clarabel

    cost, A, b, G, g, low, high, Q = problem
    n = len(cost)
    unit = csr_array(eye_array(n))
    fixed = low == high
    above, below = np.isfinite(high) & ~fixed, np.isfinite(low) & ~fixed
    parts = [A, unit[fixed], unit[above], -unit[below]] + ([] if G is None else [G])
    rows = csc_matrix(vstack(parts))
    count = len(b) + int(fixed.sum())
    cones = [clarabel.ZeroConeT(count), clarabel.NonnegativeConeT(rows.shape[0] - count)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = _INTERIOR
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TIGHT
    found = clarabel.DefaultSolver(
        csc_matrix((n, n)) if Q is None else csc_matrix(Q), cost, rows,
        np.concatenate([b, low[fixed], high[above], -low[below], g]), cones, settings,
    ).solve()  # fmt: skip
    status = str(found.status)
    if "Infeasible" in status:
        return None
    if "Solved" not in status:
        raise _unsolved(problem, status)
    x = np.asarray(found.x)
    prices = np.asarray(found.z)[rows.shape[0] - len(g) :]
    worst = _worst(problem, x)
    return Optimum(x, float(found.obj_val), float(found.obj_val_dual), worst, prices)


def _unsolved(problem: Problem, why: str) -> NoAnswerError:
    kind = "linear" if problem.Q is None else "quadratic"
    return NoAnswerError(
        f"the {kind} program of {len(problem.cost)} variables was not solved ({why}): plan with a "
        "longer sample time (--sample-time)"
    )


def _worst(problem: Problem, x: Array) -> float:
    """Return the largest residual of the rows."""
    worst = float(np.abs(problem.A @ x - problem.b).max())
    if problem.G is not None:
        worst = max(worst, float((problem.G @ x - problem.g).max()))
    return worst
