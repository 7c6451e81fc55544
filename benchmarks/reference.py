"""The right answer: SciPy's DOP853 at 1e-12 from sample to sample, every event located.

Shares nothing with the package but the law's step: the vehicle is written out again here, as one
smooth right-hand side for each of nine modes (free, at either end stop; in the water, emerging,
on the bottom).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.mission import Array, Fleet, Mission
from swimbladder.control.cascade import initial, step
from swimbladder.control.law import Measurement
from swimbladder.physics.dynamics import Plant

__all__ = ["Reference", "follow", "reference"]

RTOL = 1e-12
ATOL = (1e-16, 1e-16, 1e-14, 1e-14)  # m3/s, m3, m, m/s

Rates = Callable[[float, Any], list[float]]
Guard = Callable[[float, Any], float]


class Mode(NamedTuple):
    """A smooth piece of the motion."""

    stop: int = 0  # 1 at the upper end stop, -1 at the lower
    where: str = "water"  # or "surface", "bottom"


@dataclass(frozen=True)
class Reference:
    """The depth at every sample, and how often each mode was entered."""

    depth: Array  # m
    entered: dict[str, int]

    @property
    def touched(self) -> str:
        """What the vehicle met, in words."""
        return ", ".join(name for name in ("end stop", "surface", "bottom") if self.entered[name])


def reference(mission: Mission, fleet: Fleet, lane: int) -> Reference:
    """Return the trajectory of one vehicle of a fleet, to about 1e-11 m."""
    p = fleet.plant(lane)
    x = np.array([0.0, fleet.start_volume[lane], fleet.start_depth[lane], 0.0])
    mode = Mode()
    depth = np.empty(mission.samples + 1)
    entered = {"end stop": 0, "surface": 0, "bottom": 0}
    state = None
    for k, target in enumerate(mission.reference.tolist()):
        depth[k] = x[2]
        if k == mission.samples:
            break
        seen = Measurement(time=k * mission.sample_time, depth=float(x[2]), volume=float(x[1]))
        if state is None:
            state = initial(mission.gains, seen, target)
        asked, state, _ = step(mission.gains, state, seen, target)
        u = max(-p.supply, min(p.supply, asked))
        x, mode = follow(p, mode, x, u, mission.sample_time, entered)
    return Reference(depth, entered)


def follow(
    p: Plant, mode: Mode, x: Array, u: float, duration: float, entered: dict[str, int]
) -> tuple[Array, Mode]:
    """Advance a state by `duration` [s] at a held voltage, from event to event."""
    t = 0.0
    mode = _settled(p, mode, x, u)
    while t < duration:
        guards = _guards(p, mode, u)
        result = solve_ivp(
            _rates(p, mode, u),
            (t, duration),
            x,
            method="DOP853",
            rtol=RTOL,
            atol=ATOL,
            events=[guard for guard, _ in guards],
        )
        if not result.success:
            raise ArithmeticError(result.message)
        t, x = float(result.t[-1]), result.y[:, -1]
        if result.status == 1:
            assert result.t_events is not None
            hit = next(i for i, times in enumerate(result.t_events) if len(times))
            x = _entered(p, mode, guards[hit][1], x, entered)
            mode = _settled(p, guards[hit][1], x, u)
    return x, mode


def _rates(p: Plant, mode: Mode, u: float) -> Rates:
    def rates(_: float, x: Any) -> list[float]:
        q, V, z, w = x.tolist()
        dq = dV = dz = dw = 0.0
        if mode.stop == 0:
            dq, dV = (p.gain * (u - p.load_drive * z) - q) / p.T1, q
        if mode.where != "bottom":
            dz, dw = w, p.a_b * (p.psi * z + p.V_0 - V) - p.d_l * w
        if mode.where == "surface":
            dw += p.a_s * (p.z_surface - z)
        return [dq, dV, dz, dw]

    return rates


def _guards(p: Plant, mode: Mode, u: float) -> Sequence[tuple[Guard, Mode]]:
    """Return what ends a mode as it rises through zero, and the mode that follows."""
    found: list[tuple[Guard, Mode]] = []
    if mode.stop == 0:
        found.append((lambda _, x: x[1] - p.V_max, mode._replace(stop=1)))
        found.append((lambda _, x: p.V_min - x[1], mode._replace(stop=-1)))
    else:
        found.append((lambda _, x: mode.stop * (p.load_drive * x[2] - u), mode._replace(stop=0)))
    if mode.where == "bottom":
        found.append((lambda _, x: x[1] - p.psi * x[2] - p.V_0, mode._replace(where="water")))
    else:
        found.append((lambda _, x: x[2] - p.z_bottom, mode._replace(where="bottom")))
        sign, other = (1.0, "water") if mode.where == "surface" else (-1.0, "surface")
        found.append((lambda _, x: sign * (x[2] - p.z_surface), mode._replace(where=other)))
    for guard, _ in found:
        guard.terminal = True  # type: ignore[attr-defined]
        guard.direction = 1.0  # type: ignore[attr-defined]
    return found


def _entered(p: Plant, old: Mode, new: Mode, x: Array, entered: dict[str, int]) -> Array:
    """Return the state with which a mode begins: a blow takes the motor's or the hull's speed."""
    q, V, z, w = x
    if new.stop and not old.stop:
        entered["end stop"] += 1
        q, V = 0.0, p.V_max if new.stop > 0 else p.V_min
    if new.where == "bottom" != old.where:
        entered["bottom"] += 1
        z, w = p.z_bottom, 0.0
    if new.where == "surface" != old.where:
        entered["surface"] += 1
    return np.array([q, V, z, w])


def _settled(p: Plant, mode: Mode, x: Array, u: float) -> Mode:
    """Return the mode less the holds that nothing presses into."""
    if mode.stop * (u - p.load_drive * x[2]) < 0.0:
        mode = mode._replace(stop=0)
    if mode.where == "bottom" and p.psi * x[2] + p.V_0 < x[1]:
        mode = mode._replace(where="water")
    return mode
