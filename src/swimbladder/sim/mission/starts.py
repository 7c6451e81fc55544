"""Whether the pump's runs are long enough for its starts: until one is over nothing is pressed out.

A start fills the line up to the sea's pressure (`core.line`) and runs the pump up; a run has an end
(actuator.longest_run, and the next look of the law `rate`). Between two runs the line empties
through the pump.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from swimbladder.control.rate import RateParameters
from swimbladder.errors import NoAnswerError
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import look_up
from swimbladder.sim.engine.rodas.line import empty_line, fill_lacks
from swimbladder.sim.engine.rodas.names import Drive, Given, Note, Now, Table
from swimbladder.sim.mission.core.names import Stage
from swimbladder.sim.mission.prepare import Plan
from swimbladder.vehicle import PumpAndValve, Vehicle

if TYPE_CHECKING:
    from swimbladder.sim.mission.flight import Flight

_REMEDY = "Allow longer runs, or take a pump that delivers more, or a smaller line"
_CUT = 0.99  # of the longest run: it would have gone on
_FEW = 0.5  # of what a pump delivers in its time: less, and starts take most of it


class Runs(NamedTuple):
    """How long a run of the pump may be in a phase [s], what limits it, and the least pause [s]."""

    longest: float
    limit: str
    pause: float


def runs_of(plan: Plan, phase: int) -> Runs:
    """Return the runs of the pump that the law `rate` makes in a phase."""
    law = RateParameters(*map(float, plan.stages[phase, Stage.LAW : Stage.CAPTURE]))
    own = float(plan.given[Given.LONGEST])
    if own <= law.dead:
        return Runs(own, "actuator.longest_run", law.dead - own + law.run)
    return Runs(law.dead, "the next look (dead of the controller, or check_interval)", law.run)


class Start(NamedTuple):
    """What a pump runs for before anything is pressed out [s]: for its line, and to run up."""

    filling: float
    running_up: float

    @property
    def time(self) -> float:
        """Both together [s]; infinite where the pump stalls."""
        return self.filling + self.running_up

    def words(self) -> str:
        """Return how long, and why."""
        parts = {"actuator.line": self.filling, "actuator.start_volume": self.running_up}
        why = " and ".join(f"{time:.3g} s for {name}" for name, time in parts.items() if time > 0.0)
        return f"a start of the pump takes {self.time:.3g} s ({why})"


def start_of(plan: Plan, depth: float, *, pause: float = math.inf) -> Start:
    """Return what a start takes at a depth [m].

    pause [s]: since the line was at the sea's pressure; infinite: it is empty.
    """
    g, table = plan.given, plan.table
    place, share = max(depth, 0.0), float(g[Given.DELIVERY])
    step = float(g[Given.STEP])
    rate = share * look_up(table, step, Table.RATE_OUT, place)[0]
    if rate <= 0.0:
        return Start(0.0, math.inf)
    if g[Given.LINE] == 0.0:
        return Start(0.0, float(look_up(table, step, Table.START, place)[0] / rate))
    sea = _sea(plan, place)
    if sea > g[Given.LINE_TOP]:
        return Start(math.inf, 0.0)
    if math.isfinite(pause):
        lacks = _lacks(plan, place, sea, pause)
    else:
        lacks = float(look_up(table, float(g[Given.LINE_STEP]), Table.FILLING, sea)[0])
    return Start(lacks / share, float(g[Given.RUN_UP] / rate))


def _sea(plan: Plan, depth: float) -> float:
    """Return ln(p/reservoir) of a line at the sea's pressure."""
    g = plan.given
    pressure = look_up(plan.table, float(g[Given.STEP]), Table.PRESSURE, depth)[0]
    head = max(pressure + g[Given.HEAD_AFLOAT], 0.0)
    return float(np.log1p(head / (g[Given.LINE_RATIO] * g[Given.RESERVOIR])))


def _lacks(plan: Plan, depth: float, sea: float, pause: float) -> float:
    """Return how long the pump fills a line that was at the sea's pressure a pause before [s]."""
    x = np.zeros(int(Now.COUNT))
    x[Now.Z], x[Now.T], x[Now.LINE_LEVEL] = depth, pause, sea
    empty_line(plan.given, plan.table, x)
    return float(fill_lacks(plan.given, plan.table, x))


def check_starts(vehicle: Vehicle, mission: Mission, plan: Plan) -> None:
    """Raise NoAnswerError where a way up begins so deep that no run of the pump presses out.

    Not even where the line is at the sea's pressure at the end of each run.
    """
    if not isinstance(vehicle.actuator, PumpAndValve):
        return
    depths = [0.0 if phase.depth is None else phase.depth for phase in mission.phases]
    slack = [float(stage[Stage.TOLERANCE]) for stage in plan.stages]
    ways = list(zip([mission.start_depth, *depths[:-1]], [0.0, *slack[:-1]], depths, strict=True))
    for n, (before, tolerance, depth) in enumerate(ways):
        begin = before - tolerance
        if depth >= begin:
            continue
        runs = runs_of(plan, n)
        if start_of(plan, begin).time < runs.longest:
            continue
        start = start_of(plan, begin, pause=runs.pause)
        if runs.longest <= start.time < math.inf:  # where it stalls that has been said
            raise NoAnswerError(
                f"at {before:g} m, where the phase {mission.titles[n]!r} begins to rise, no run of "
                f"the pump is long enough to press anything out: {start.words()}, a run "
                f"{runs.longest:.3g} s at most ({runs.limit}). {_REMEDY}, or ask for less depth"
            )


def starts_words(flight: Flight, phase: int) -> str:
    """Say that starts took most of the runs in a phase that were cut short, and why; "" if not."""
    if not isinstance(flight.vehicle.actuator, PumpAndValve):
        return ""
    plan, runs = flight.plan, runs_of(flight.plan, phase)
    step, share = float(plan.given[Given.STEP]), float(plan.given[Given.DELIVERY])
    here, begun = False, None
    out, could, depths = 0.0, 0.0, list[float]()
    for note in flight.notes:
        if note[Drive.WHAT] == Note.PHASE:
            here = note[Drive.NUMBER] == phase
        elif note[Drive.WHAT] == Note.PUMP:
            begun = note if here else None
        elif note[Drive.WHAT] == Note.RUN_OVER and begun is not None:
            if note[Drive.NUMBER] < _CUT * runs.longest:
                continue
            depth = max(float(begun[Drive.Z]), 0.0)
            rate = look_up(plan.table, step, Table.RATE_OUT, depth)[0]
            out += float(note[Drive.V] - begun[Drive.V])
            could += share * rate * float(note[Drive.NUMBER])
            depths.append(depth)
    if could == 0.0 or out > _FEW * could:
        return ""
    deepest = max(depths)
    return (
        f"The pump's {len(depths)} longest runs in it pressed out {1e6 * max(out, 0.0):.3g} cm3, "
        f"{100.0 * max(out, 0.0) / could:.2g} % of what it delivers in their time: at "
        f"{deepest:.0f} m {start_of(plan, deepest, pause=runs.pause).words()}, a run "
        f"{runs.longest:.3g} s at most ({runs.limit}). {_REMEDY}"
    )
