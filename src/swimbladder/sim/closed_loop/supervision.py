"""The supervisor in the loop: it stands between law and driver, as on the board.

It sees what the sensors give, and the battery of a motor; of a pump and valve the volume that its
law computes, and no battery. Once it has taken over, the law is left alone. The vehicles of an
ensemble differ; what it holds them against is that of one, as flashed.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control import supervisor
from swimbladder.control.law import Laws, from_numbers, leaf_names, numbers
from swimbladder.control.supervisor import (
    Reason,
    SupervisorParameters,
    SupervisorState,
    Watched,
)
from swimbladder.control.supervisor_limits import board_reach, command_limits, supervisor_parameters
from swimbladder.physics.arrays import Array
from swimbladder.sim.closed_loop.dispatch import compilable, gather, scatter_where
from swimbladder.sim.closed_loop.lane import Row, hook_in
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.cache import inlined, shared
from swimbladder.vehicle import Vehicle

_LIMITS, _STATE = leaf_names(SupervisorParameters), leaf_names(SupervisorState)
_DEPTH_LIMIT = _LIMITS.index("depth_limit")
_N_LIMITS, _N_STATE = len(_LIMITS), len(_STATE)
_REASON, _ALLOWED = _STATE.index("reason"), _STATE.index("allowed")
_LIKE_LIMITS: SupervisorParameters = from_numbers(SupervisorParameters, [0.0] * _N_LIMITS)
_LIKE_STATE: SupervisorState = from_numbers(SupervisorState, [0.0] * _N_STATE)


class Alarm(NamedTuple):
    """Why the supervisor took over, and when."""

    reason: Reason
    time: float  # s

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI."""
        return {"reason": self.reason.words, "time_s": self.time}


class Supervision(NamedTuple):
    """A supervisor over the law of every lane, as the kernel takes it."""

    limits: Array  # of the supervisor, then the least and the largest command
    memory: Array  # [lanes, its state, then the tick at which it took over]

    @property
    def depth_limit(self) -> float:
        """The depth [m] at which it turns a vehicle round."""
        return float(self.limits[_DEPTH_LIMIT])

    @property
    def reach(self) -> float:
        """The depth [m] down to which the board under it knows what its pump delivers."""
        return board_reach(from_numbers(SupervisorParameters, self.limits.tolist()))

    @property
    def reason(self) -> Array:
        """The number of the reason of the first lane [1], as the kernel changes it; 0: none."""
        return self.memory[0, _REASON : _REASON + 1]

    def over(self, lanes: int) -> Supervision:
        """Return the supervisors of so many lanes, each as the first one of these is now."""
        return Supervision(self.limits, np.tile(self.memory[:1], (lanes, 1)))

    @property
    def alarms(self) -> Array:
        """The number of the reason, 0: none, and the tick of each lane's alarm [lanes, 2]."""
        return self.memory[:, [_REASON, _N_STATE]]

    def allowed(self, reference: float) -> float:
        """Return the depth [m] that the law of the first lane is asked for."""
        return float(_allowed(self, 0, reference))

    def alarm(self, tick: float) -> Alarm | None:
        """Return why and when the supervisor took over the first lane, of a sample time [s]."""
        reason, at = self.alarms[0].tolist()
        return Alarm(Reason(int(reason)), at * tick) if reason else None


def supervision_of(
    vehicle: Vehicle, tick: float, supervised: bool | None, *, laws: Laws | None = None
) -> Supervision | tuple[()]:
    """Return the supervisor over one lane of a vehicle at a sample time [s]; () for none.

    supervised: whether there is one; None: where the vehicle has a table of it. laws: under it, as
    `supervisor_parameters` has them.
    Raises InputError as `supervisor_parameters` does.
    """
    given = "supervisor" in vehicle.model_fields_set
    if not (given if supervised is None else supervised):
        return ()
    p = supervisor_parameters(vehicle, tick, laws=laws)
    nothing = Watched(math.nan, 0.0, 0.0, 0.0, False, 0, 0)
    begun = [*numbers(supervisor.initial(p, nothing, 0.0)), math.nan]
    limits = np.array([*numbers(p), *command_limits(vehicle, tick)], np.float64)
    return Supervision(limits, np.array([begun], np.float64))


@inlined
def battery_voltage(supply: float, sag: float, kappa: float, applied: float, q: float) -> float:
    """Return what a motor's battery shows the board [V], of its open voltage `supply`.

    applied [V], q [m3/s]: what the motor gets, and the rate at which it changes the volume.
    """
    drawn = (applied - kappa * q) * (1.0 if applied >= 0.0 else -1.0)
    return supply - max(sag * drawn, 0.0) / (1.0 + sag)


_supervise = inlined(compilable(supervisor.step))


@shared
def _watch(limits: Array, memory: Array, seen: Any, wanted: float, k: int) -> Any:
    """Return what one lane's supervisor commands for its law's command; change what it knows."""
    p = gather(_LIKE_LIMITS, limits, 0, 1)
    s = gather(_LIKE_STATE, memory, 0, 1)
    least, most = limits[_N_LIMITS], limits[_N_LIMITS + 1]
    wanted = min(max(wanted, least), most)
    command, s, _ = _supervise(p, s, seen, wanted)
    before = memory[_REASON]
    scatter_where(True, s, memory, 0, 1)
    if before == 0.0 and memory[_REASON] > 0.0:
        memory[_N_STATE] = k
    return command


def _supervise_lane(watch: Supervision, S: Array, W_: int, i: int, k: int, wanted: float) -> Any:
    plant = Row.PLANT * W_ + i
    battery, kind = np.nan, S[plant + modes.POSITIONER * W_]
    if kind == 0.0:
        supply, sag = S[plant + modes.SUPPLY * W_], S[plant + modes.SAG * W_]
        kappa, q = S[plant + modes.KAPPA * W_], S[Row.Q * W_ + i]
        battery = battery_voltage(supply, sag, kappa, S[Row.APPLIED * W_ + i], q)
    depth, volume = S[Row.SEEN_DEPTH * W_ + i], S[Row.SEEN_VOLUME * W_ + i]
    volume = 0.0 if np.isnan(kind) else volume  # of a pump and valve: it is not watched
    reference, computed = S[Row.REFERENCE * W_ + i], S[Row.COMPUTED * W_ + i]
    seen = Watched(depth, 0.0, volume, battery, False, 0, 0, reference, computed)
    return _watch(watch.limits, watch.memory[i], seen, wanted, k)


def _took_over(watch: Supervision, i: int) -> Any:
    return watch.memory[i, _REASON] != 0.0


def _allowed(watch: Supervision, i: int, reference: float) -> Any:
    return min(reference, watch.memory[i, _ALLOWED])


hook_in(Supervision, allowed=_allowed, supervise=_supervise_lane, took_over=_took_over)
