"""A rehearsal: the procedure of section 3.1 on a simulated vehicle, one experiment after the other.

The operator works as the paper did (`control.protocol`), with what is believed of the vehicle; the
vehicle in the water may be another.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.closed_loop import simulate
from swimbladder.control import protocol
from swimbladder.control.law import Measurement
from swimbladder.control.protocol import Does, Phase, PoolParameters, PoolState
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.guide.tasks import Task
from swimbladder.parameters import Vehicle
from swimbladder.pool import pool_parameters

__all__ = ["Operator", "Performed"]

Array = NDArray[np.float64]

_SINK = 30e-6  # m3 below neutral, at which the vehicle lies on the bottom at first


class Performed(NamedTuple):
    """An experiment as logged; phases: when each began [s], its step of the paper, what it does."""

    time: Array  # s
    depth: Array  # m
    volume: Array  # m3, from mid-stroke
    voltage: Array  # V
    phases: tuple[tuple[float, str, Does], ...]


class Operator:
    """Does one experiment after the other, each from where the one before ended."""

    def __init__(self, believed: Vehicle, truth: Vehicle, *, pool_depth: float, seed: int) -> None:
        """Put the vehicle on the bottom.

        Raises InputError where the procedure cannot be done with this vehicle in this pool.
        """
        self.believed, self.truth, self.pool_depth, self.seed = believed, truth, pool_depth, seed
        self.parameters = pool_parameters(believed, dV=1e-6, pool_depth=pool_depth)
        if not truth.voltage_driven:
            raise InputError(
                "a positioner does not take the voltages of the believed vehicle",
                field="--truth", value=truth.name, remedy="Give one with the same kind of actuator",
            )  # fmt: skip
        self._time, self._runs = 0.0, 0
        self._depth, self._speed = pool_depth, 0.0
        self._volume = truth.neutral_volume(pool_depth) - _SINK

    def perform(self, task: Task) -> Performed:
        """Return what is logged while a task is done, from coming to rest to the glide's end.

        Raises NoAnswerError where the vehicle does not come to rest, or does not arrive.
        """
        p = self.parameters._replace(phases=self._phases(task))
        notes: list[tuple[Measurement, PoolState, float]] = []

        def law(seen: Measurement, _: float) -> tuple[float, float]:
            before = notes[-1][1] if notes else protocol.begin(p, seen)
            u, state, next_s = protocol.step(p, before, seen)
            notes.append((seen, state, u))
            return u, math.inf if _over(p, state) else next_s

        s = simulate(
            self.truth, setpoints=[(0.0, self.pool_depth)], duration=2.0 * p.patience + 60.0,
            start_depth=self._depth, start_speed=self._speed, start_volume=self._volume,
            bottom_depth=self.pool_depth, seed=self.seed + self._runs, law=law,
            sample_time=p.loop.S_p,
        )  # fmt: skip
        last = notes[-1][1]
        if p.phases[last.phase].does is not Does.DONE:
            why = p.phases[min(last.phase, len(p.phases) - 3)] if s.finished else None
            raise NoAnswerError(
                f"The rehearsal stopped at {self._time + notes[-1][0].time:.0f} s: "
                + (s.stop.value if why is None else "the vehicle did not come to rest, or did not "
                   "arrive, in time. Tune its controller, or allow more in the believed vehicle")
            )  # fmt: skip
        n = len(notes) - 1
        began, self._time = self._time, self._time + n * p.loop.S_p
        self._depth, self._speed = float(s.depth[n]), float(s.speed[n])
        self._volume, self._runs = float(s.volume[n]), self._runs + 1
        phases, before = [], -1
        for seen, state, _ in notes[:-1]:
            if state.phase != before:
                phase, before = p.phases[state.phase], state.phase
                phases.append((began + seen.time, phase.step, phase.does))
        seen_ = [(began + m.time, m.depth, m.volume, u) for m, _, u in notes[:-1]]
        time, depth, volume, voltage = np.array(seen_).T
        return Performed(time, depth, volume, voltage, tuple(phases))

    def _phases(self, task: Task) -> tuple[Phase, ...]:
        up = task.change > 0.0
        margin = 0.05
        assert task.start is not None
        return (
            Phase("a" if up else "c", Does.HOLD, task.start),
            Phase("b" if up else "d", Does.HALT),
            Phase("b" if up else "d", Does.PULSE, task.change),
            Phase("b" if up else "d", Does.GLIDE, margin if up else self.pool_depth - margin),
            Phase("", Does.DONE),
            Phase("", Does.GAVE_UP),
        )


def _over(p: PoolParameters, state: PoolState) -> bool:
    return p.phases[state.phase].does in (Does.DONE, Does.GAVE_UP)
