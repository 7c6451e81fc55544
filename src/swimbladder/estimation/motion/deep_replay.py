"""A dive predicted from its beginning: the logged runs of pump and valve, by the model.

m w' = rho g E - k_dt w|w|, implicit in the drag, so that a step of many seconds ends at the steady
speed; the volume is that of the runs so far, each spread over its seconds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.motion.deep_dive import DeepDive
from swimbladder.estimation.motion.deep_model import Body, hull_volume, run_volumes

Array = NDArray[np.float64]
STEP = 20.0  # s; half of it moves arrivals by less than a second


@dataclass(frozen=True, kw_only=True)
class Replay:
    """A replayed dive [n]; pressure stops at the surface."""

    time: Array  # s
    pressure: Array  # Pa
    speed: Array  # m/s

    def at(self, time: Array) -> Array:
        """Return the pressure at times [s] of the dive [Pa]."""
        return np.asarray(np.interp(time, self.time, self.pressure))

    def arrival(self, pressure: float, *, after: float = -np.inf) -> float:
        """Return when it first crosses a pressure [Pa] after a time [s]; NaN where it does not."""
        t, p = self.time, self.pressure
        later = t >= after
        t, p = t[later], p[later]
        side = p >= pressure
        turn = np.flatnonzero(side[1:] != side[:-1])
        if not len(turn):
            return np.nan
        i = int(turn[0])
        return float(t[i] + (pressure - p[i]) / (p[i + 1] - p[i]) * (t[i + 1] - t[i]))


def replay(
    body: Body, values: Mapping[str, float], start: float, dive: DeepDive, *,
    pressure: float | None = None, begin: float | None = None, end: float | None = None,
    step: float = STEP,
) -> Replay:  # fmt: skip
    """Return the dive as the model predicts it, from its first sample or a time `begin` [s].

    start: the drive's volume when the dive began [m3]; pressure: where it begins [Pa], as logged
    unless given; end [s]: its last sample unless given. The hull's temperature is as logged.
    """
    t0 = float(dive.time[0]) if begin is None else begin
    t1 = float(dive.time[-1]) if end is None else end
    turns = np.concatenate([dive.action_time, dive.action_time + dive.action_seconds])
    marks = np.unique(
        np.concatenate([np.arange(t0, t1, step), [t1], turns[(turns > t0) & (turns < t1)]])
    )
    volume = _volume(values, dive, marks)
    warmth = np.interp(marks, dive.time, dive.temperature)
    still = {**values, "thermal_expansion": 0.0}
    grid, density, g = dive.water_pressure, dive.water_density, dive.gravity
    # What is neutral at each pressure of the column, but for the hull's temperature.
    neutral = body.mass / density - hull_volume(
        body, still, grid, np.full(len(grid), body.reference_temperature)
    )
    heat = body.volume * values["thermal_expansion"] * (warmth - body.reference_temperature)
    asked = start + volume + heat
    p = float(np.interp(t0, dive.time, dive.pressure)) if pressure is None else pressure
    first = _excess(p, grid, neutral, asked[0])
    rho_g = float(np.interp(p, grid, density)) * g
    w = float(np.sign(first) * np.sqrt(abs(first) * rho_g / _drag(values, first)))
    found, speeds = [p], [w]
    for i in range(1, len(marks)):
        dt = float(marks[i] - marks[i - 1])
        heavy = _excess(p, grid, neutral, float(asked[i]))
        rho_g = float(np.interp(p, grid, density)) * g
        w = _after(w, rho_g * heavy, body.inertia * values["inertia"], values, dt)
        p = max(p + rho_g * w * dt, 0.0)
        found.append(p)
        speeds.append(w)
    return Replay(time=marks, pressure=np.array(found), speed=np.array(speeds))


def _excess(p: float, grid: Array, neutral: Array, asked: float) -> float:
    return float(np.interp(p, grid, neutral)) - asked


def _drag(values: Mapping[str, float], way: float) -> float:
    return values["drag"] * (1.0 if way >= 0.0 else values["drag_up"])


def _after(w: float, force: float, mass: float, values: Mapping[str, float], dt: float) -> float:
    """Return the speed after dt [s] under a force [N] and quadratic drag, by implicit Euler."""
    push = mass / dt * w + force
    k = _drag(values, push)
    # k w|w| + (m/dt) w = push has one root, of the sign of push.
    a = mass / dt
    size = (np.sqrt(a * a + 4.0 * k * abs(push)) - a) / (2.0 * k)
    return float(np.copysign(size, push))


def _volume(values: Mapping[str, float], dive: DeepDive, time: Array) -> Array:
    """Return what the drive has gained since the beginning at each time [m3] [n]."""
    seconds = np.maximum(dive.action_seconds, 1e-3)
    done = np.clip((time[:, None] - dive.action_time) / seconds, 0.0, 1.0)
    idle = time - float(dive.time[0]) - done @ seconds
    leaked = np.interp(time, dive.time, dive.leaked)
    return np.asarray(done @ run_volumes(values, dive) - leaked - values["creep"] * idle)
