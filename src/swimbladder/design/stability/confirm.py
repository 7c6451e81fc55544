"""Limit cycles in the simulator: what remains long after a disturbance, without noise.

An unstable cycle is the edge of what decays: it is found by halving the disturbance between one
that decays and one that grows, and looked at while the two runs still are alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Law
from swimbladder.sim.closed_loop import simulate_ensemble
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

_PERIODS = 60.0  # that a cycle is given to settle
_LOOKED = 0.3  # share of the run that is looked at
_ROUNDS = 7  # of halving, each between 40 lanes
_LANES = 40
_KICK = 0.03  # 1/s, speed over disturbance: at rest a law with a dead zone would stay where it is
_STEADY = 0.05  # deviation of amplitude within what is looked at, up to which it is a cycle


class Seen(NamedTuple):
    """What a simulation shows at its end."""

    cycles: bool  # it goes to and fro without end
    amplitude: float  # m, of the depth's first harmonic
    period: float  # s
    farthest: float  # m, from the set-point, over what is looked at


def measure(time: Array, depth: Array, reference: float) -> Seen:
    """Return the oscillation of a depth [m] about its mean: first harmonic and mean period."""
    x = depth - depth.mean()
    farthest = float(np.max(np.abs(depth - reference)))
    rising = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    if len(rising) < 3:
        return Seen(False, math.nan, math.nan, farthest)
    at = time[rising] - x[rising] * (time[1] - time[0]) / (x[rising + 1] - x[rising])
    # One period: from a crossing to the next that is farther than half of the slowest beat.
    w = _frequency(time, x, 2.0 * math.pi / float(np.mean(np.diff(at))))
    half = len(x) // 2
    first, second = (_size(time[s], x[s], w) for s in (slice(0, half), slice(half, None)))
    mean = 0.5 * (first + second)
    steady = mean > 1e-7 and abs(first - second) <= 2.0 * _STEADY * mean
    return Seen(steady, _size(time, x, w), 2.0 * math.pi / w, farthest)


def _frequency(time: Array, x: Array, guess: float) -> float:
    """Return the frequency [rad/s] of the strongest harmonic, by its spectrum, then refined."""
    h = float(time[1] - time[0])
    window = np.hanning(len(x))
    padded = 16 * len(x)
    spectrum = np.abs(np.fft.rfft(x * window, padded))
    lowest = int(2.0 * padded / len(x))
    k = lowest + int(np.argmax(spectrum[lowest:]))
    if k <= lowest or k + 1 >= len(spectrum):
        return guess
    a, b, c = np.log(spectrum[k - 1 : k + 2])
    return float(2.0 * math.pi * (k + 0.5 * (a - c) / (a - 2.0 * b + c)) / (padded * h))


def _size(time: Array, x: Array, w: float) -> float:
    columns = np.stack([np.ones_like(time), np.sin(w * time), np.cos(w * time)], axis=1)
    c = np.linalg.lstsq(columns, x, rcond=None)[0]
    return float(math.hypot(c[1], c[2]))


def hold(
    vehicle: Vehicle, law: Law, parameters: Any, *, sample_time: float, depth: float,
    disturbance: float, period: float, quantised: bool, vary: Mapping[str, float] | None = None,
    at_rest: bool = False,
) -> Seen:  # fmt: skip
    """Return what remains of a vehicle held at `depth` [m] that starts `disturbance` [m] off.

    period [s]: expected, which decides how long is simulated. quantised: whether the sensors round.
    vary: fields of the plant that differ. at_rest: whether it starts without speed.
    """
    time, depths = _fly(
        vehicle, law, parameters, [disturbance], sample_time=sample_time, depth=depth,
        duration=_PERIODS * period, quantised=quantised, vary=vary or {},
        kick=0.0 if at_rest else _KICK,
    )  # fmt: skip
    late = time >= (1.0 - _LOOKED) * time[-1]
    return measure(time[late], depths[late, 0], depth)


def _fly(
    vehicle: Vehicle, law: Law, parameters: Any, disturbances: Any, *, sample_time: float,
    depth: float, duration: float, quantised: bool, vary: Mapping[str, float], kick: float = 0.0,
) -> tuple[Array, Array]:  # fmt: skip
    quiet = vehicle.sensors.model_copy(update={"depth_noise": 0.0, "volume_noise": 0.0})
    off = np.asarray(disturbances, float)
    data = simulate_ensemble(
        vehicle.model_copy(update={"sensors": quiet}), count=len(off),
        setpoints=[(0.0, depth)], duration=duration, start_depth=depth + off,
        start_speed=kick * off,
        vary={name: np.full(len(off), value) for name, value in vary.items()},
        seed=0 if quantised else None, law=law, parameters=parameters, sample_time=sample_time,
        keep="trajectory",
    )  # fmt: skip
    return data["time"].to_numpy(), data["depth"].to_numpy()


def edge(
    vehicle: Vehicle, law: Law, parameters: Any, *, sample_time: float, depth: float,
    within: tuple[float, float], period: float, vary: Mapping[str, float],
) -> tuple[Seen, float] | None:  # fmt: skip
    """Return the cycle between what decays and what grows, and the disturbance [m] that parts them.

    within: disturbances [m] of which the least decays and the most grows; None where they do not.
    """
    low, high = within
    duration = 20.0 * period
    time, depths = np.empty(0), np.empty((0, 0))
    for k in range(_ROUNDS):
        off = np.geomspace(low, high, _LANES) if k == 0 else np.linspace(low, high, _LANES)
        time, depths = _fly(
            vehicle, law, parameters, off, sample_time=sample_time, depth=depth,
            duration=duration, quantised=False, vary=vary,
        )  # fmt: skip
        error = np.abs(depths - depth)
        last = error[time >= time[-1] - 2.0 * period].max(axis=0)
        grows = ~(last < error.max(axis=0) / 3.0)  # nan: it left the water
        if grows[0] or not grows.any():
            return None
        first = int(np.argmax(grows))
        low, high = float(off[first - 1]), float(off[first])
        pair = depths[:, [first - 1, first]]
    apart = np.abs(pair[:, 0] - pair[:, 1]) > _STEADY * np.abs(pair[:, 0] - depth).max()
    until = float(time[int(np.argmax(apart))]) if apart.any() else float(time[-1])
    kept = (time <= until) & (time >= until - 3.5 * period)
    return measure(time[kept], pair[kept, 0], depth), low
