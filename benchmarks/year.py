"""A year of ten-day cycles: the package's mission against SciPy's solve_ivp at equal error.

SciPy is given what the processor did and when, so that it looks at nothing, decides nothing and
keeps no balance: it integrates from one run of pump or valve to the next. Two tolerances are
searched: with one its depths at all those instants are just farther from DOP853 at 1e-11 than the
package's, with the other just nearer; its time at equal error is interpolated between them. The
float stays below the surface, where bobbing would cost SciPy most of its time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.mission import Array
from benchmarks.table import number, ratio, render
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import look_up, uniform_column
from swimbladder.sim.engine.rodas.records import Note, Table
from swimbladder.sim.mission.core.hooks import fly
from swimbladder.sim.mission.flight import Flight, fly_mission
from swimbladder.sim.mission.prepare import Plan, first_state

__all__ = ["Peer", "Tried", "at_error", "bracket", "compare", "report"]

DAY = 86400.0
GOAL = 0.1  # s of processor time for the package's year
METHODS = ("LSODA", "RK45", "DOP853", "Radau")
ALIKE = 1.2  # two errors of a ratio nearer to 1 need no nearer ones
_LOOSEST, _TIGHTEST = -2.0, -11.0  # decades of rtol
_ML = 1e6  # volumes are counted in cm3
_DOING = {Note.VALVE: Table.RATE_IN, Note.BYPASS: Table.BYPASS}


@dataclass(frozen=True)
class Tried:
    """A run at a relative tolerance: its largest depth error [m] and its processor time [s]."""

    tolerance: float
    error: float
    seconds: float


@dataclass(frozen=True)
class Peer:
    """Processor time of a year [s], and the largest depth error at a run's begin or end [m].

    runs: of a peer the two between which the time at that error is interpolated.
    """

    name: str
    seconds: float
    error: float
    runs: tuple[Tried, ...] = ()


def bracket(run: Callable[[float], Tried], wanted: float) -> tuple[Tried, Tried]:
    """Return the runs whose errors [m] are the nearest to `wanted` from above and from below.

    Half decades of the tolerance, from loose to tight, until the error is below `wanted`; then
    halves, quarters, eighths and sixteenths of the last of them, until the two errors are `ALIKE`:
    an error does not fall evenly with the tolerance, so that halving could miss the nearest.
    Raises ArithmeticError where no tolerance has an error above `wanted`, or none one below.
    """
    decade = _LOOSEST
    tried = [run(10.0**decade)]
    while tried[-1].error > wanted:
        decade -= 0.5
        if decade < _TIGHTEST:
            raise ArithmeticError(f"no tolerance has an error below {wanted:g} m")
        tried.append(run(10.0**decade))
    if len(tried) == 1:
        raise ArithmeticError(f"no tolerance has an error above {wanted:g} m")
    shares = [n / parts for parts in (2, 4, 8, 16) for n in range(1, parts, 2)]
    for share in (None, *shares):
        if share is not None:
            tried.append(run(10.0 ** (decade + 0.5 * share)))
        above = min((t for t in tried if t.error > wanted), key=lambda t: t.error)
        below = max((t for t in tried if t.error <= wanted), key=lambda t: t.error)
        if above.error < ALIKE * below.error:
            break
    return above, below


def at_error(above: Tried, below: Tried, wanted: float) -> float:
    """Return the processor time [s] at an error [m] between those of two runs, by logarithms."""
    share = math.log(wanted / below.error) / math.log(above.error / below.error)
    return below.seconds * (above.seconds / below.seconds) ** share


def compare(*, quick: bool) -> list[Peer]:
    """Return the package's year and SciPy's, the package first."""
    vehicle = load_vehicle("example-float")
    column = uniform_column(vehicle.water, 2200.0)
    parked = 0.5 if quick else 9.4
    task = Mission(
        start_depth=10.0,
        phases=[
            {"kind": "descend", "depth": 1000.0},
            {"kind": "park", "depth": 1000.0, "tolerance": 30.0, "duration": parked * DAY},
            {"kind": "descend", "depth": 1990.0},
            {"kind": "profile", "depth": 10.0, "tolerance": 5.0},
        ],
    )
    flight = fly_mission(vehicle, task, column)
    cycles = 365.0 * DAY / flight.duration
    right, _ = _replay(flight, "DOP853", 1e-11)
    ours = float(np.max(np.abs(flight.notes["z"] - right)))
    seconds = min(_alone(flight.plan, task) for _ in range(5))
    found = [Peer("swimbladder", seconds * cycles, ours)]
    for method in METHODS[:1] if quick else METHODS:

        def run(tolerance: float, method: str = method) -> Tried:
            depths, taken = _replay(flight, method, tolerance)
            return Tried(tolerance, float(np.max(np.abs(depths - right))), taken)

        def timed(once: Tried, run: Callable[[float], Tried] = run) -> Tried:
            again = [run(once.tolerance).seconds for _ in range(0 if quick else 2)]
            return replace(once, seconds=cycles * min([once.seconds, *again]))

        runs = tuple(map(timed, bracket(run, ours)))
        found.append(Peer(f"SciPy, {method}", at_error(*runs, ours), ours, runs))
    return found


def report(peers: list[Peer]) -> str:
    """Return the comparison as a table."""
    ours = peers[0].seconds
    lines = [
        (
            p.name,
            number(p.seconds),
            ratio(p.seconds, ours),
            number(p.error, 2),
            " and ".join(f"{run.error:.2g} m at {run.tolerance:.1e}" for run in p.runs) or "-",
        )
        for p in peers
    ]
    headings = [
        "A year of ten-day cycles",
        "s of processor",
        "to ours",
        "depth error [m]",
        "between the errors at rtol",
    ]
    return render(headings, lines) + f"\ngoal for the package: {GOAL} s"


def _alone(plan: Plan, task: Mission) -> float:
    """Return the processor time of one cycle as campaigns fly it [s]: balance, but no rows."""
    x, at, accounts = first_state(plan, task)
    flown = plan.under_way((x, at, accounts))
    begin = process_time()
    while at["stop"] == 0:
        flown.lane.counts[:] = 0
        fly(flown)
    return process_time() - begin


def _replay(flight: Flight, method: str, tolerance: float) -> tuple[Array, float]:
    """Return the depths at the notes of a flight [n], by SciPy, and its processor time [s]."""
    table, step = flight.plan.table, float(flight.plan.given["step"])
    y = [float(flight.begin["z"]), float(flight.begin["w"]), _ML * float(flight.begin["v"])]
    what: Table | None = Table.LEAKAGE  # None: a pump that runs and does not deliver yet
    t, primed, depths = 0.0, math.inf, []
    begin = process_time()
    for note in flight.notes:
        when, kind = float(note["t"]), Note(int(note["what"]))
        if what is None and primed < when:
            y, t = _advance(flight.plan, y, t, primed, what, method, tolerance), primed
            what = Table.RATE_OUT
        y, t = _advance(flight.plan, y, t, when, what, method, tolerance), when
        depths.append(y[0])
        if kind is Note.PUMP:
            short = look_up(table, step, Table.START, y[0])[0]
            primed = t + short / look_up(table, step, Table.RATE_OUT, y[0])[0]
            what = None
        elif kind in _DOING:
            what = _DOING[kind]
        elif kind is Note.RUN_OVER:
            what = Table.LEAKAGE
    return np.array(depths), process_time() - begin


def _advance(
    plan: Plan,
    y: list[float],
    t: float,
    end: float,
    what: Table | None,
    method: Any,
    tolerance: float,
) -> list[float]:
    if end <= t:
        return y
    table, step = plan.table, float(plan.given["step"])
    m, d_t = float(plan.given["mass"]), float(plan.given["d_t"])
    sign = 1.0 if what == Table.RATE_OUT else -1.0

    def rates(_: float, y: Any) -> tuple[float, float, float]:
        z, w, v = y.tolist()
        weight = look_up(table, step, Table.PRESSURE, z)[1]
        pull = weight * (look_up(table, step, Table.NEUTRAL, z)[0] - v / _ML) / m
        rate = 0.0 if what is None else sign * look_up(table, step, what, z)[0]
        return w, pull - d_t * w * abs(w), rate * _ML

    found = solve_ivp(
        rates,
        (t, end),
        y,
        method=method,
        rtol=tolerance,
        atol=[tolerance, 0.1 * tolerance, tolerance],
        t_eval=(end,),
    )
    if not found.success:
        raise ArithmeticError(found.message)
    return [float(value) for value in found.y[:, -1]]


def main() -> None:
    """Print the comparison."""
    print(report(compare(quick=False)))


if __name__ == "__main__":
    main()
