"""A deep dive as the filter of `deep_filter` takes it, and what that filter makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.estimates import Prior
from swimbladder.estimation.motion.deep_dive import DeepDive, nodes
from swimbladder.estimation.motion.deep_filter import (
    DYNAMIC,
    RATE,
    V0,
    D,
    P,
    U,
    W,
    Z,
    filter_kernel,
)
from swimbladder.estimation.motion.deep_model import Body, cast_volume, hull_volume, run_volumes
from swimbladder.estimation.motion.deep_water import displaced_variance

Array = NDArray[np.float64]

FINE, COARSE = 5.0, 15.0  # s, steps while the speed follows a run, and else: 1 cm at most
_UNSEEN, _GAP = 60.0, 1800.0  # s, steps where two samples are so far from each other
_FOLLOWS = 150.0  # s after a run
_SPACING = 1e4  # Pa, of the water's table
_KNOTS, _WIDER = (0.0, 2e5, 5e5), 1.6  # Pa, of the cast's error; each further one so much deeper
_SPEED_STD = 0.02  # m/s, of the speed at the beginning: that between the first two samples
_START = (2.0, 5e-6)  # share of what drag carries then, and m3: of the volume that it asks for


class Noise(NamedTuple):
    """Standard deviations of what the model does not know, and how long the water's lasts."""

    pressure: float  # Pa, of a measured pressure
    water: float  # m/s, of the water's vertical speed
    drift: float  # m3/s^0.5, of the drive's or the hull's volume
    runs: float  # -, of the volume of a run
    lasts: float  # s, for how long the water's speed stays alike, tau; no deviation


@dataclass(frozen=True)
class Path:
    """Steps [m], samples [n] and the water [k] of a dive."""

    dive: DeepDive
    time: Array  # s [n], of the samples
    measured: Array  # Pa [n]
    steps: Array  # s [m]
    sample: NDArray[np.int64]  # [m], sample at the end of a step, or -1
    runs: _Runs
    begun: Array  # m3 [m], nominal volume of runs that begin in a step
    leaked: Array  # m3 [m], as the vehicle's file has it
    idle: Array  # s [m], without the runs
    warmth: Array  # degC [m], of the hull
    grid: Array  # Pa [k]
    density: Array  # kg/m3 [k]
    layers: Array  # m3/m [k]
    knots: Array  # Pa [j]
    width: Array  # m3 [j], deviation of the neutral volume by errors of the cast
    speed: float  # m/s at the beginning


class Filtered(NamedTuple):
    """Innovations of the samples but the first [n - 1], and the state at the end."""

    innovation: Array  # Pa
    variance: Array  # Pa2
    state: Array
    covariance: Array

    @property
    def start(self) -> float:
        """The drive's volume when the dive began [m3]."""
        return float(self.state[V0])


def deep_path(
    dive: DeepDive, body: Body, priors: Mapping[str, Prior], *, until: float = np.inf
) -> Path:
    """Return the samples and steps of a dive, as far as `until` [s] after it began."""
    at = _samples(dive)
    at = at[dive.time[at] - dive.time[0] <= until] if np.isfinite(until) else at
    time, measured = dive.time[at], dive.pressure[at].astype(np.float64)
    begin, seconds = dive.action_time, np.maximum(dive.action_seconds, 1e-3)
    end = begin + seconds
    edge, sample = _edges(time, begin, end + _FOLLOWS)
    steps, middle = np.diff(edge), 0.5 * (edge[1:] + edge[:-1])
    runs = _runs(edge, begin, end)
    ran = runs.done(begin, seconds) / steps
    place = np.clip(np.searchsorted(edge, begin, side="right") - 1, 0, len(steps) - 1)
    begun = np.zeros(len(steps))
    np.add.at(begun, place, dive.action_volume)
    grid = np.arange(0.0, float(dive.water_pressure[-1]), _SPACING)
    density = np.interp(grid, dive.water_pressure, dive.water_density)
    layers = np.interp(grid, dive.water_pressure, dive.water_layers)
    knots = list(_KNOTS)
    while knots[-1] < dive.pressure.max():
        knots.append(knots[-1] * _WIDER)
    weight = float(np.interp(measured[0], grid, density)) * dive.gravity
    return Path(
        dive=dive, time=time, measured=measured, steps=steps, sample=sample,
        runs=runs, begun=begun,
        leaked=np.interp(middle, dive.time, dive.leaked), idle=middle - time[0] - ran,
        warmth=np.interp(middle, dive.time, dive.temperature), grid=grid, density=density,
        layers=layers, knots=np.array(knots),
        width=cast_volume(body, priors, np.interp(knots, grid, layers)),
        speed=float((measured[1] - measured[0]) / (time[1] - time[0])) / weight,
    )  # fmt: skip


def _samples(dive: DeepDive) -> NDArray[np.int64]:
    """Return samples that determine a speed, and the last before each run, perhaps its cause."""
    before = np.searchsorted(dive.time, dive.action_time, side="right") - 1
    return np.union1d(nodes(dive.time), before[before >= 0])


def _edges(time: Array, begin: Array, end: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the edges of the steps [s] [m + 1], and the sample at the end of each or -1 [m].

    Steps are `COARSE`, and `FINE` between begin and end [s] [k] of what changes the speed.
    """
    coarse = np.arange(time[0], time[-1], COARSE)
    after = np.minimum(np.searchsorted(time, coarse), len(time) - 1)
    unseen = (time[after] - time[np.maximum(after - 1, 0)] > _GAP) & (coarse % _UNSEEN >= COARSE)
    marks = [time, coarse[~unseen]]
    marks += [np.arange(a, b, FINE) for a, b in zip(begin, end, strict=True)]
    every = np.unique(np.concatenate(marks))
    every = every[(every >= time[0]) & (every <= time[-1])]
    sample = np.searchsorted(time, every)
    at_sample = time[np.minimum(sample, len(time) - 1)] == every
    # Marks of several kinds next to each other are one: a sample, or the first.
    apart = np.append(True, np.diff(every) > 0.3 * FINE)
    kept = apart | at_sample
    return every[kept], np.where(at_sample, sample, -1)[kept][1:]


class _Runs(NamedTuple):
    """Which steps of [m] runs overlap [q], and by which they are over [actions]."""

    edge: Array  # s [m + 1]
    step: NDArray[np.int64]  # [q]
    run: NDArray[np.int64]  # [q]
    end: Array  # s [actions]
    after: NDArray[np.int64]  # [actions], first step that begins when a run is over

    def done(self, begin: Array, size: Array) -> Array:
        """Return the integral over each step of what runs have given so far [m].

        begin: when each begins to give [s] [actions], evenly until its end; size: what it gives in
        all [actions].
        """
        a, b = self.edge[self.step], self.edge[self.step + 1]
        first, last = begin[self.run], self.end[self.run]

        def given(t: Array) -> Array:
            into = np.clip(t - first, 0.0, last - first)
            return np.asarray(into * into / (2.0 * (last - first)) + np.maximum(t - last, 0.0))

        count = len(self.edge) - 1
        within = np.bincount(self.step, (given(b) - given(a)) * size[self.run], count)
        over = np.cumsum(np.bincount(self.after, size, count + 1))[:count]
        return np.asarray(within + over * np.diff(self.edge))


def _runs(edge: Array, begin: Array, end: Array) -> _Runs:
    first = np.maximum(np.searchsorted(edge, begin, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(edge, end), len(edge) - 1)
    step = [np.arange(a, b) for a, b in zip(first, after, strict=True)]
    run = np.repeat(np.arange(len(begin)), [len(one) for one in step])
    return _Runs(edge, np.concatenate(step), run, end, after)


def drive_volume(values: Mapping[str, float], path: Path) -> Array:
    """Return what runs and leaks have added to the drive's volume in the mean of a step [m3] [m].

    A pump gives nothing until it has made up for what its start falls short by.
    """
    dive, seconds = path.dive, path.runs.end - path.dive.action_time
    added = run_volumes(values, dive)
    short = np.where(dive.action_pumps, dive.action_short + values["pump_start"], 0.0)
    size = np.abs(added)
    gives = np.divide(size, size + np.maximum(short, 0.0), out=np.ones(len(size)), where=size > 0.0)
    begin = path.runs.end - np.maximum(gives * seconds, 1e-3)
    done = path.runs.done(begin, added) / path.steps
    return np.asarray(done - path.leaked - values["creep"] * path.idle)


def neutral_table(body: Body, values: Mapping[str, float], path: Path) -> Array:
    """Return the water as the filter takes it [k, 3]: N [m3], rho g [Pa/m], G [m3/m].

    N is for a hull at its reference temperature; what its warmth adds counts with the drive.
    """
    cold = {**values, "thermal_expansion": 0.0}
    hull = hull_volume(body, cold, path.grid, np.zeros(len(path.grid)))
    neutral = body.mass / path.density - hull
    return np.stack([neutral, path.density * path.dive.gravity, path.layers], axis=1)


def filtered(body: Body, values: Mapping[str, float], noise: Noise, path: Path) -> Filtered:
    """Return what the filter makes of a dive with these parameters."""
    water = neutral_table(body, values, path)
    volume = drive_volume(values, path)
    warm = path.warmth - body.reference_temperature
    volume = volume + body.volume * values["thermal_expansion"] * warm
    down = values["drag"]
    up = down * values["drag_up"]
    x = np.zeros(DYNAMIC + len(path.knots))
    p, w = float(path.measured[0]), path.speed
    carried = (down if w > 0.0 else up) * w * abs(w) / float(np.interp(p, path.grid, water[:, 1]))
    x[P], x[W] = p, w
    x[V0] = float(np.interp(p, path.grid, water[:, 0])) - volume[0] - carried
    variance = np.ones(len(x))
    variance[P], variance[W], variance[U] = noise.pressure**2, _SPEED_STD**2, noise.water**2
    variance[RATE] = variance[U] / noise.lasts**2
    variance[Z] = displaced_variance(variance[U], noise.lasts)
    variance[D] = 0.0
    variance[V0] = (_START[0] * abs(carried) + _START[1]) ** 2
    covariance = np.diag(variance)
    n = len(path.measured)
    innovation, spread = np.zeros(n), np.ones(n)
    filter_kernel(
        path.steps, volume, path.begun, path.sample, path.measured, _SPACING, water, path.knots,
        path.width, np.array([body.inertia * values["inertia"], down, up]), np.array(noise), x,
        covariance, innovation, spread,
    )  # fmt: skip
    return Filtered(innovation[1:], spread[1:], x, covariance)
