"""The phases of a mission that a float's board flies, as hooks of the closed loop.

Its law is called at every tick and commands seconds of pump and valve, as flashed; a supervisor
watches it. Phases end at ticks.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.closed_loop.hooks import hook_in
from swimbladder.sim.closed_loop.rows import Row
from swimbladder.sim.engine.cache import inlined
from swimbladder.sim.engine.rodas.records import Doing
from swimbladder.sim.engine.rodas.sensing import measured
from swimbladder.sim.mission.core.avoidance import goal_of, grounds
from swimbladder.sim.mission.core.hooks import begin_tick, enter_time, raise_alarm, too_deep
from swimbladder.sim.mission.core.phases import awaited_level, begin_row, row, settle
from swimbladder.sim.mission.core.records import Kind, Phases

Array = NDArray[np.float64]


class Boarded(NamedTuple):
    """A mission by its board on its way, as the hooks take it."""

    phases: Phases
    tick: float  # s
    span: float  # s, of a row of the trajectory at the longest
    last: Array  # [1] s, when the last row was written
    reason: Array  # [1], why the supervisor took over, 0: it has not
    knows: Array  # [1], of its law's state, 1: all volume is out once its run is over


@inlined
def _begin(f: Boarded, S: Array, k: int, built: Any) -> bool:  # noqa: ARG001
    g = f.phases
    if begin_tick(g, S):
        return True
    if g.lane.at.alarm == 0 and f.reason[0] != 0.0:
        raise_alarm(g, f.reason[0])
    return False


@inlined
def _sense(f: Boarded, S: Array, k: int) -> None:  # noqa: ARG001
    lane, stage = f.phases.lane, f.phases.stages[f.phases.lane.at.phase]
    lane.at.calls += 1
    seen = measured(lane.p, lane.waves, lane.x, lane.at)
    grounds(f.phases, seen)
    S[Row.SEEN_DEPTH] = seen
    S[Row.SEEN_VOLUME] = lane.x.v  # its law begins with it, and measures none after
    S[Row.REFERENCE] = 0.0 if stage.kind == Kind.SURFACE else goal_of(f.phases)


@inlined
def _drive(f: Boarded, S: Array, k: int, command: float) -> float:  # noqa: ARG001
    """Move the volume to its upper limit where it is deeper than the mission allows."""
    return float(f.tick if f.phases.lane.at.alarm == 1 else command)


@inlined
def _bound(f: Boarded, until: float) -> float:
    x = f.phases.lane.x
    return float(x.t if x.charge <= f.phases.lane.p.empty else until)


@inlined
def _set_off(f: Boarded) -> tuple[float, float]:
    g = f.phases
    begin_row(g)
    return g.stages[g.lane.at.phase].loads, awaited_level(g)


@inlined
def _moved(f: Boarded, event: int, time: float, depth: float) -> None:
    """Enter a step in what is known of the phase, and see whether it arrived or is too deep."""
    g = f.phases
    x, at = g.lane.x, g.lane.at
    arrived = at.arrived == 1
    ends = too_deep(g, event)
    if ends and at.alarm == 0:
        raise_alarm(g, 0.0)
    if ends or arrived != (at.arrived == 1) or x.t - f.last[0] >= f.span:
        f.last[0] = x.t
        row(g)
    enter_time(g, depth, x.t - time, arrived)
    if x.t > time:
        at.idle = 0


@inlined
def _settled(f: Boarded) -> None:
    g = f.phases
    at = g.lane.at
    # its volume is computed: it is at the surface when its board takes it to be
    settle(g, at.alarm == 0 and at.doing == Doing.NOTHING and f.knows[0] > 0.0)


hook_in(
    Boarded,
    begin=_begin,
    sense=_sense,
    drive=_drive,
    bound=_bound,
    set_off=_set_off,
    moved=_moved,
    settled=_settled,
)
