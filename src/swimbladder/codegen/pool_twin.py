"""The float32 twin of a pool day on the board, and a rehearsal of it on the vehicle's model.

The C is the translated `control.protocol` and ``templates/swb_pool_day.c.j2``, which puts the
supervisor above it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.codegen.subset import read_law
from swimbladder.codegen.twin import twin
from swimbladder.control.law import Law, Measurement
from swimbladder.control.protocol import POOL
from swimbladder.control.protocol_records import Does, Phase, PoolParameters
from swimbladder.control.supervisor import SUPERVISOR
from swimbladder.control.supervisor_records import Reason, SupervisorParameters, Watched
from swimbladder.errors import NoAnswerError
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Vehicle

_LONGEST = 3600.0  # s, that a round may take in a rehearsal
_AFLOAT = 60.0  # s, at the surface before it begins
_AFTER = 120.0  # s, for coming up once it is over
_DONE = 8  # the first phase in which it is over


class Rehearsal(NamedTuple):
    """A pool day flown by the twin under its supervisor, tick by tick."""

    depth: NDArray[np.float32]  # m, measured
    volume: NDArray[np.float32]  # m3, measured
    may_begin: NDArray[np.bool_]
    command: NDArray[np.float32]  # V
    phase: NDArray[np.int8]
    minutes: float  # from the word to begin until it is done


class PoolTwin:
    """What the board does on a pool day, tick by tick: the procedure under its supervisor."""

    def __init__(
        self, parameters: PoolParameters, limits: SupervisorParameters, *, procedure: Law,
        supervisor: Law, after_reset: bool = False,
    ) -> None:  # fmt: skip
        self.parameters, self.limits = parameters, limits
        self.procedure, self.supervisor = procedure, supervisor
        unseen = Watched(math.nan, 0.0, 0.0, 0.0, False, 0, 0)
        self.watch = supervisor.initial(limits, unseen, 1.0 if after_reset else 0.0)
        self.state = procedure.initial(parameters, Measurement(0.0, math.nan, math.nan), 0.0)

    @property
    def phase(self) -> Phase:
        """The phase that it is in."""
        if self.state.phase < 0.0:
            return Phase("", Does.WAIT)
        return self.parameters.phases[int(self.state.phase)]

    @property
    def reason(self) -> Reason | None:
        """The supervisor's first reason; None while the procedure commands."""
        number = int(self.watch.rescue.reason)
        return Reason(number) if number else None

    def tick(self, seen: Watched, *, may_begin: bool) -> Any:
        """Return the command [V] from this tick on; once the supervisor has a reason it is over."""
        go = -1.0 if self.watch.rescue.reason > 0 else 1.0 if may_begin else 0.0
        measured = Measurement(0.0, seen.depth, seen.volume)
        wanted, self.state, _ = self.procedure.step(self.parameters, self.state, measured, go)
        seen = seen._replace(missed=0)
        command, self.watch, _ = self.supervisor.step(self.limits, self.watch, seen, wanted)
        return command


def float32_twin(parameters: PoolParameters, limits: SupervisorParameters) -> PoolTwin:
    """Return the twin that equals the C to the bit."""
    return PoolTwin(
        parameters, limits, procedure=twin(POOL),
        supervisor=twin(SUPERVISOR, read_law(SUPERVISOR, Watched)),
    )  # fmt: skip


def rehearse(
    vehicle: Vehicle, beside: PoolTwin, *, pool_depth: float, seed: int | None,
    fly: Callable[[Watched, bool], float] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Rehearsal:  # fmt: skip
    """Return a pool day of a vehicle under a twin: from afloat, through all rounds, and up again.

    fly: what gives the commands in the twin's place. Raises NoAnswerError where the procedure does
    not come to its end.
    """
    tick, p = beside.limits.S_p, plant(vehicle)
    rows: list[tuple[Any, ...]] = []
    over: list[int] = []

    def every_tick(seen: Measurement, _: float) -> tuple[float, float]:
        may_begin = len(rows) * tick >= _AFLOAT
        watched = Watched(seen.depth, 0.0, seen.volume, math.nan, False, 0, 0)
        command = beside.tick(watched, may_begin=may_begin)
        given = command if fly is None else fly(watched, may_begin)
        phase = int(beside.state.phase)
        rows.append((seen.depth, seen.volume, may_begin, command, phase))
        if phase >= _DONE:
            over.append(len(rows))
        if over and (len(rows) - over[0]) * tick > _AFTER:
            return float(given), math.inf
        return float(given), 0.0

    flown = simulate(
        vehicle, setpoints=[(0.0, pool_depth)], law=every_tick, sample_time=tick, seed=seed,
        duration=_AFLOAT + _AFTER + beside.parameters.rounds * _LONGEST,
        start_depth=p.z_surface, start_volume=beside.limits.volume.volume_high,
        bottom_depth=pool_depth, progress=progress, checked=False,
    )  # fmt: skip
    depth, volume, may_begin, command, phase = (
        np.array(column, kind)
        for column, kind in zip(
            zip(*rows, strict=True), ("f4", "f4", "?", "f4", "i1"), strict=True
        )
    )  # fmt: skip
    if not flown.finished:
        raise NoAnswerError(f"The rehearsed pool day ended early: {flown.stop.value}")
    _check_done(beside, phase)
    minutes = float(np.sum((phase >= 0) & (phase < _DONE))) * tick / 60.0
    return Rehearsal(depth, volume, may_begin, command, phase, minutes)


def _check_done(beside: PoolTwin, phase: NDArray[np.int8]) -> None:
    """Raise NoAnswerError unless every round was done and no reason found to end it."""
    if beside.phase.does is Does.DONE and beside.reason is None:
        return
    last = int(phase[phase < _DONE][-1])
    name = beside.parameters.phases[last].words if last >= 0 else "waiting"
    at = f"in {name}, round {int(beside.state.completed) + 1}"
    if beside.reason is not None:
        raise NoAnswerError(
            f"The rehearsed pool day ended {at}: the supervisor said {beside.reason.words!r}. "
            "Say more of the vehicle in its [supervisor] table, as bottom_depth"
        )
    raise NoAnswerError(
        f"The rehearsed pool day did not come to its end: {at} it took longer than "
        f"{beside.parameters.patience:g} s. Tune the vehicle's cascade, or change volumes or pool"
    )
