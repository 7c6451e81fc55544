"""What is planned: a vehicle from rest at one depth to rest at another, within its limits.

From sample to sample the vehicle is linear about a course, x+ = A x + B u + c, exact for it. The
linear model is that of `linear.models`; what is not linear is taken along a course: drag by its
tangent at the mean speed of each sample, load and friction by the side on which the motor turns
there. Between samples the command is held, so the matrix exponential is exact (Van Loan, IEEE
Trans. Automatic Control 23, 1978, 395).

A linear program over the samples of a task, and its answer with the proof of its optimum.

Programs of many samples are solved through the interior, or by pivots to a corner. An
interior-point method (Clarabel; Goulart and Chen, arXiv 2405.12762) takes some twenty sparse
factorisations whatever the program, and ends in the middle of its optima, so that what it finds
moves little when the program does. The simplex method (HiGHS) ends at one of their corners, and
from one program to the next at another; and now and then it is stuck for minutes. It is there for
what the other does not solve.

The motion that takes the least electrical energy, by sparse quadratic programs.

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
from dataclasses import dataclass
from typing import Any, NamedTuple, TypedDict

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array, csc_matrix, csr_array, eye_array, vstack

from swimbladder.control.registry import own_law
from swimbladder.design.linear.depths import stall
from swimbladder.design.linear.models import exponential_of, linearise, operating_point
from swimbladder.errors import InputError, NoAnswerError, check_number
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.buoyancy_engine import Winding, at_voltage, check_power_known
from swimbladder.physics.buoyancy_engine import winding as winding_of
from swimbladder.physics.dynamics import Plant, drag_law, plant
from swimbladder.vehicle import Vehicle

STATES = ("q", "V", "z", "w")


class Steps(NamedTuple):
    """What a sample does: A [n, 4, 4], B [n, 4], c [n, 4] over (q, V, z, w) in SI.

    The command is a voltage [V]; of a positioner the volume rate [m3/s], and its q the last one.
    """

    A: Array
    B: Array
    c: Array


def steps_along(p: Plant, h: float, speed: Array, back: Flags) -> Steps:
    """Return the steps of h [s] about a course.

    speed [n + 1] in m/s. back: in which samples [n] the motor is driven back.
    """
    w = 0.5 * (speed[1:] + speed[:-1])
    n = len(w)
    M = np.zeros((n, 6, 6))  # (q, V, z, w), the held command, 1
    if p.positioner:
        M[:, :4, :4] = _of_positioner(p)
        M[:, 1, 4] = 1.0
    else:
        for side in (False, True):
            chosen = back == side
            if chosen.any():
                model = linearise(p, back_driving=side)
                friction = -p.friction if side else p.friction
                M[chosen, :4, :4] = model.A
                M[chosen, :4, 4] = model.B[:, 0]
                M[chosen, 0, 5] = -p.gain * friction / p.T1
    drag, slope = drag_along(p, w)
    M[:, 3, 3] = -slope
    M[:, 3, 5] = p.a_b * p.V_0 + slope * w - drag
    E = exponential_of(M * h)
    A, B, c = E[:, :4, :4].copy(), E[:, :4, 4].copy(), E[:, :4, 5].copy()
    if p.positioner:
        A[:, 0, :], B[:, 0] = 0.0, 1.0
    return Steps(A, B, c)


def _of_positioner(p: Plant) -> Array:
    """Return the rates' slopes by (q, V, z, w) of a vehicle whose volume is moved at will."""
    model = linearise(p)  # states (z, w), input V
    A = np.zeros((4, 4))
    A[2:, 2:] = model.A
    A[2:, 1] = model.B[:, 0]
    return A


def drag_along(p: Plant, w: Array) -> tuple[Array, Array]:
    """Return drag over mass [m/s2] and its slope [1/s] at the speeds w [m/s]."""
    terms = (p.d_l, p.d_b, p.d_0, p.d_t, p.epsilon)
    found = np.array([drag_law(x, *terms)[:2] for x in w.tolist()])
    return found[:, 0], found[:, 1]


class Limits(TypedDict, total=False):
    """What `task_of` takes beside the vehicle and the step."""

    sample_time: float | None
    supply: float | None
    band: float
    feedback_reserve: float
    max_speed: float | None
    bottom_depth: float


@dataclass(frozen=True, kw_only=True)
class Task:
    """A step of depth, sampled, with what limits it; low and high of a limit in SI."""

    vehicle: Vehicle
    plant: Plant
    start: float  # m
    target: float  # m
    sample_time: float  # s
    band: float  # m, to either side of the target
    command: tuple[float, float]  # V, or m3/s for a positioner
    volume: tuple[float, float]  # m3
    speed: tuple[float, float]  # m/s
    depth: tuple[float, float]  # m
    margin: float  # -, of supply and stroke, kept back

    @property
    def distance(self) -> float:
        """Depth between start and target [m]."""
        return abs(self.target - self.start)

    @property
    def brisk(self) -> float:
        """Least time of the step without drag, psi and load [s]: (32 d/j)^(1/3) for a jerk j."""
        p = self.plant
        rate = p.rate if p.positioner else p.gain * self.command[1]
        return math.cbrt(32.0 * self.distance / (p.a_b * rate))

    def state_of_rest(self, depth: float) -> tuple[float, float, float, float]:
        """Return (q, V, z, w) of the vehicle at rest, neutral, at a depth [m]."""
        at = operating_point(self.plant, depth=depth)
        return (at.motor_rate, at.volume, depth, 0.0)


def task_of(
    vehicle: Vehicle,
    step: tuple[float, float],
    *,
    sample_time: float | None = None,
    supply: float | None = None,
    band: float = 0.02,
    feedback_reserve: float = 0.0,
    max_speed: float | None = None,
    bottom_depth: float = math.inf,
) -> Task:
    """Return the task, checked.

    step: depths of start and target [m]. sample_time [s] and supply [V]: the vehicle's where not
    given. band [-]: of the step, to either side of the target. feedback_reserve [-]: share of
    supply (a positioner: of its speed) and stroke left for feedback. max_speed [m/s].
    bottom_depth [m].

    Raises InputError for what cannot be meant; NoAnswerError where stroke or supply do not hold
    the vehicle at one of the two depths.
    """
    sample_time, (start, target) = vehicle.sampled_every(sample_time), step
    if vehicle.controller is not None:
        own_law(vehicle)
    check_number(max_speed, "max_speed", "m/s", above=0.0)
    share = 'Write it like "5 %"'
    check_number(band, "band", above=0.0, below=1.0, remedy=share)
    check_number(feedback_reserve, "feedback_reserve", least=0.0, below=1.0, remedy=share)
    if supply is not None:
        if vehicle.supply is None:
            what = "the vehicle's actuator takes a volume, not a voltage"
            raise InputError(what, field="supply", value=supply, remedy="Leave the supply out")
        check_number(supply, "supply", "V", above=0.0)
        vehicle = at_voltage(vehicle, supply)
    p = plant(vehicle, bottom_depth=bottom_depth)
    shallowest = max(p.z_surface, 0.0)
    rating = vehicle.hull.depth_limit
    deepest = min(bottom_depth, math.inf if rating is None else rating)
    for name, depth in (("the start", start), ("the target", target)):
        if not shallowest <= depth <= deepest:
            what = f"{name} is beyond {shallowest:g} m, where it begins to emerge"
            if depth > deepest:
                end = "the bottom" if bottom_depth == deepest else "its rating (hull.depth_limit)"
                what = f"{name} is beyond {deepest:g} m, {end}"
            remedy = f"Stay between {shallowest:g} and {deepest:g} m"
            raise InputError(what, field="step", value=depth, unit="m", remedy=remedy)
    if start == target:
        what, remedy = "start and target are the same depth", 'Give two depths, like "1.5:3 m"'
        raise InputError(what, field="step", value=start, unit="m", remedy=remedy)
    most = (p.rate if p.positioner else p.supply) * (1.0 - feedback_reserve)
    low, high = vehicle.stroke.lowest, vehicle.stroke.highest
    middle, half = 0.5 * (high + low), 0.5 * (high - low) * (1.0 - feedback_reserve)
    fastest = math.inf if max_speed is None else max_speed
    task = Task(
        vehicle=vehicle,
        plant=p,
        start=start,
        target=target,
        sample_time=sample_time,
        band=band * abs(target - start),
        command=(-most, most),
        volume=(middle - half, middle + half),
        speed=(-fastest, fastest),
        depth=(shallowest, deepest),
        margin=feedback_reserve,
    )
    for depth in (start, target):
        _check_held(task, depth)
    return task


def _check_held(task: Task, depth: float) -> None:
    """Raise NoAnswerError where stroke or supply, less the margin, do not hold a depth."""
    p = task.plant
    less = f" less the margin of {100.0 * task.margin:g} %" if task.margin else ""
    neutral = task.state_of_rest(depth)[1]
    low, high = task.volume
    if not low <= neutral <= high:
        what = f"the stroke{less}, {1e6 * low:.4g} to {1e6 * high:.4g} cm3, does not reach"
        volume = f"the volume at which the vehicle is neutral at {depth:g} m"
        remedy = "trim it otherwise, give it more stroke, or stay shallower"
        raise NoAnswerError(f"{what} {volume}, {1e6 * neutral:.4g} cm3: {remedy}")
    if p.positioner:
        return
    limit = stall(p._replace(supply=task.command[1]), depth=depth, depth_limit=None).holding_depth
    if depth >= limit:
        supply = f"with {task.command[1]:.4g} V{less}"
        what = f"the depth load: {supply} the motor cannot hold its volume below {limit:.4g} m"
        remedy = "It takes a higher supply, or less depth"
        raise NoAnswerError(f"{what}, and {depth:g} m is asked for. {remedy}")


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
    G: csr_array[np.float64, tuple[int, int]]
    g: Array
    low: Array
    high: Array
    Q: Any = None


class Optimum(NamedTuple):
    """The best x, its objective and the dual's, and the prices of the rows."""

    x: Array
    objective: float
    dual: float
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
        bounds = np.column_stack([low, high])
        found = linprog(  # type: ignore[call-overload]  # the stubs know the options one by one
            cost, A_ub=G, b_ub=g, A_eq=A, b_eq=b, bounds=bounds, method=method, options=options
        )
        if found.status in (0, 2):
            break
    if found.status == 2:
        return None
    if found.status != 0:
        raise _unsolved(problem, found.message)
    dual = float(b @ found.eqlin.marginals) + float(g @ found.ineqlin.marginals)
    for bound, marginals in ((low, found.lower.marginals), (high, found.upper.marginals)):
        held = np.isfinite(bound)
        dual += float(bound[held] @ marginals[held])
    return Optimum(found.x, float(found.fun), dual, -found.ineqlin.marginals)


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
    rows = csc_matrix(vstack([A, unit[fixed], unit[above], -unit[below], G]))
    count = len(b) + int(fixed.sum())
    cones = [clarabel.ZeroConeT(count), clarabel.NonnegativeConeT(rows.shape[0] - count)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = _INTERIOR
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TIGHT
    right = np.concatenate([b, low[fixed], high[above], -low[below], g])
    squares = csc_matrix((n, n)) if Q is None else csc_matrix(Q)
    found = clarabel.DefaultSolver(squares, cost, rows, right, cones, settings).solve()
    status = str(found.status)
    if "Infeasible" in status:
        return None
    if "Solved" not in status:
        raise _unsolved(problem, status)
    prices = np.asarray(found.z)[rows.shape[0] - len(g) :]
    return Optimum(np.asarray(found.x), float(found.obj_val), float(found.obj_val_dual), prices)


def _unsolved(problem: Problem, why: str) -> NoAnswerError:
    kind = "linear" if problem.Q is None else "quadratic"
    what = f"the {kind} program of {len(problem.cost)} variables was not solved ({why})"
    return NoAnswerError(f"{what}: plan with a longer sample time (`sample_time=`)")


_NEGLIGIBLE = 1e-12  # coefficients of scaled rows that only spoil the solver's pivots


class Scale(NamedTuple):
    """One of a state (q, V, z, w) and of the command, in SI: numbers of the program are near 1."""

    state: Array  # [4]
    command: float


class Goal(NamedTuple):
    """What a program minimises and what it asks for beyond the motion and its limits.

    near: the depth is within the band from this sample on. rest: at rest at the target from this
    sample on. relaxed: what may be exceeded, `near`, `rest` or a limit, by a slack that is
    minimised; none: the volume moved is minimised.
    """

    near: int | None
    rest: int
    relaxed: str | None = None


class Near(NamedTuple):
    """Where a program stays, as its steps are for that course only; None: anywhere.

    leash: speeds [n + 1] in m/s, and how far from them the speeds may go. back: in which samples
    [n] the motor is driven back, drives no volume out, and in the others none in.
    """

    leash: tuple[Array, float] | None = None
    back: Flags | None = None


class Solved(NamedTuple):
    """The optimum: states [n + 1, 4] and commands [n] in SI, the objective, and how sure it is."""

    states: Array
    commands: Array
    objective: float  # slack in units of the scale, volume moved [m3], or energy [J]
    gap: float  # of primal and dual objective, over 1 + their size
    proven: bool = True  # no motion is better; else: none near by
    prices: Array | None = None  # [n] of staying on its side, in each sample; None: it need not


class Rows:
    """Rows of a sparse matrix that grow, and their right-hand sides."""

    def __init__(self) -> None:
        """Begin without rows."""
        self.count = 0
        self._at: list[tuple[Any, Any, Any]] = [(np.zeros(0, int), np.zeros(0, int), np.zeros(0))]
        self._right: list[Array] = [np.zeros(0)]

    def add(self, right: Array, *entries: tuple[Any, Any]) -> None:
        """Add rows: their right-hand sides [n], and (columns [n], coefficients [n] or one)."""
        n = len(right)
        rows = self.count + np.arange(n)
        for columns, values in entries:
            kept = np.abs(np.broadcast_to(values, n)) > _NEGLIGIBLE
            self._at.append((rows[kept], columns[kept], np.broadcast_to(values, n)[kept]))
        self._right.append(np.asarray(right, float))
        self.count += n

    def matrix(self, columns: int) -> csr_array[np.float64, tuple[int, int]]:
        """Return the matrix [rows, columns]."""
        rows, cols, values = (np.concatenate([part[i] for part in self._at]) for i in range(3))
        return coo_array((values, (rows, cols)), shape=(self.count, columns)).tocsr()

    @property
    def right(self) -> Array:
        """The right-hand sides [rows]."""
        return np.concatenate(self._right)


def scale_of(task: Task) -> Scale:
    """Return the sizes that a task's numbers have."""
    p = task.plant
    u = task.command[1]
    half = 0.5 * (task.volume[1] - task.volume[0])
    q = p.rate if p.positioner else p.gain * u
    state = np.array([q, min(half, q * task.brisk), task.distance, task.distance / task.brisk])
    return Scale(state, u)


def columns_of(n: int) -> tuple[Any, Any]:
    """Return the columns of the states [n + 1, 4] and of the commands [n]."""
    return np.arange(4 * (n + 1)).reshape(n + 1, 4), 4 * (n + 1) + np.arange(n)


def dynamics_rows(task: Task, steps: Steps, scale: Scale) -> Rows:
    """Return the equations of the start and of every sample, in scaled variables."""
    n = len(steps.A)
    x, u = columns_of(n)
    S = scale.state
    rows = Rows()
    rows.add(np.array(task.state_of_rest(task.start)) / S, (x[0], 1.0))
    for i in range(4):
        entries = [(x[1:, i], 1.0), (u, -steps.B[:, i] * scale.command / S[i])]
        entries += [(x[:-1, j], -steps.A[:, i, j] * S[j] / S[i]) for j in range(4)]
        rows.add(steps.c[:, i] / S[i], *entries)
    return rows


def supply_rows(task: Task, n: int, scale: Scale) -> Rows:
    """Return rows (<=) of a supply that sags with the current, at both ends of each sample."""
    p, rows = task.plant, Rows()
    if p.positioner or p.sag == 0.0:
        return rows
    x, u = columns_of(n)
    most = np.full(n, task.command[1] / scale.command)
    back = p.sag * p.kappa * scale.state[0] / scale.command
    for sign in (1.0, -1.0):
        for ends in (x[:-1, 0], x[1:, 0]):
            rows.add(most, (u, sign * (1.0 + p.sag)), (ends, -sign * back))
    return rows


def solve(task: Task, steps: Steps, goal: Goal, near: Near | None = None) -> Solved | None:
    """Return the optimum, None where nothing meets the demands.

    Raises NoAnswerError where the solvers give up.
    """
    n = len(steps.A)
    problem = posed(task, steps, goal, near)
    try:
        found = interior(problem)
    except NoAnswerError:
        found = vertex(problem)
    if found is None:
        return None
    size = float(scale_of(task).state[STATES.index("V")]) if goal.relaxed is None else 1.0
    return answer_of(task, n, found, near)._replace(objective=found.objective * size)


def driven_by(task: Task, answer: Solved) -> Array:
    """Return the volume [n + 1] in m3 that the motor has driven: what is there and what leaked."""
    _, V, z, _ = answer.states.T
    leaked = 0.5 * task.plant.k_l * task.sample_time * np.cumsum(z[1:] + z[:-1])
    return np.asarray(V + np.concatenate([[0.0], leaked]))


def answer_of(task: Task, n: int, found: Optimum, near: Near | None) -> Solved:
    """Return a program's optimum over n samples in SI."""
    held = near is not None and near.back is not None
    scale = scale_of(task)
    x, u = columns_of(n)
    states, commands = found.x[x] * scale.state, found.x[u] * scale.command
    prices = found.prices[-n:] if held else None
    return Solved(states, commands, found.objective, found.gap, prices=prices)


def posed(
    task: Task, steps: Steps, goal: Goal, near: Near | None, *, costly: bool = True
) -> Problem:
    """Return the linear program, scaled: states and commands by `columns_of`, then what it adds.

    costly: whether what the goal minimises is in it.
    """
    n = len(steps.A)
    scale = scale_of(task)
    x, u = columns_of(n)
    count = 4 * (n + 1) + n
    equal = dynamics_rows(task, steps, scale)
    below = supply_rows(task, n, scale)
    S = scale.state
    more = 0 if not costly else n if goal.relaxed is None else 1  # volumes moved, or the slack
    added = count + np.arange(more)
    if costly and goal.relaxed is None:
        for sign in (1.0, -1.0):
            below.add(np.zeros(n), (x[1:, 1], sign), (x[:-1, 1], -sign), (added, -1.0))
    cost = np.repeat([0.0, 1.0], [count, more])
    low, high = np.repeat([-np.inf, 0.0], [count, more]), np.full(count + more, np.inf)

    def limit(name: str, columns: Any, least: Any, most: Any) -> None:
        """Keep variables within limits, scaled; or within them by the slack where relaxed."""
        if name != goal.relaxed:
            low[columns] = np.maximum(low[columns], least)
            high[columns] = np.minimum(high[columns], most)
            return
        m = len(columns)
        for sign, value in ((1.0, most), (-1.0, least)):
            right = np.broadcast_to(sign * np.asarray(value, float), m)
            if np.isfinite(right).all():
                below.add(right, (columns, sign), (np.full(m, count), -1.0))

    limit("command", u, *(v / scale.command for v in task.command))
    limit("volume", x[1:, 1], *(v / S[1] for v in task.volume))
    limit("depth", x[1:, 2], *(v / S[2] for v in task.depth))
    limit("speed", x[1:, 3], *(v / S[3] for v in task.speed))
    if near is not None and near.leash is not None:
        speeds, reach = near.leash
        limit("course", x[1:, 3], (speeds[1:] - reach) / S[3], (speeds[1:] + reach) / S[3])
    if goal.near is not None:
        t = task.target
        ends = (v / S[2] for v in (t - task.band, t + task.band))
        limit("near", x[goal.near :, 2], *ends)
    rest = np.array(task.state_of_rest(task.target)) / S
    for i in range(1 if task.plant.positioner else 0, 4):
        limit("rest", x[goal.rest :, i], rest[i], rest[i])
    if near is not None and near.back is not None:  # last, for `answer_of`
        side = np.where(near.back, 1.0, -1.0)
        leak = side * 0.5 * task.plant.k_l * task.sample_time * S[2] / S[1]
        entries = (x[1:, 1], side), (x[:-1, 1], -side), (x[1:, 2], leak), (x[:-1, 2], leak)
        below.add(np.zeros(n), *entries)
    A, G = equal.matrix(count + more), below.matrix(count + more)
    return Problem(cost, A, equal.right, G, below.right, low, high)


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
    instead = "plan for `goal='effort'`, the least volume moved"
    if task.plant.positioner:
        raise NoAnswerError(f"a positioner has no winding whose energy could be least: {instead}")
    check_power_known(task.vehicle, instead)
    found = winding_of(task.vehicle)
    assert found is not None
    return found


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
