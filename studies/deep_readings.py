"""What the logs of the deep dives tell of hull, sensor and rest, before anything is flown.

- How soon the hull takes the water's temperature: from logged temperatures, and the cast.
- By how much a speed over `RUN` scatters: from the speeds at which the float acted, or did not, on
  the way up. Its processor reads two pressures `RUN` apart and logs only the first.
- What the drive loses per hour while nothing runs: from pressures between two runs at rest, where
  drag is next to nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar
from scipy.special import log_ndtr

from swimbladder.estimation.motion.deep_model import Body, DeepDive, drag_volume, hull_volume
from swimbladder.physics.seawater import Column

__all__ = [
    "RUN",
    "Rest",
    "Scatter",
    "creep_at_rest",
    "hull_time",
    "rests",
    "speed_scatter",
    "warmer",
]

Array = NDArray[np.float64]
RUN = 26.0  # s, between the two readings that tell a speed on the way
MBAR = 100.0  # Pa
STEP = 10.0 * MBAR  # between two pressures as it reads them
SLOWER, FASTER = (
    7.0 * MBAR,
    9.0 * MBAR,
)  # Pa/s, seen on the way up: below, and from there on, it acts
TOP = 3e5  # Pa; above it layers and swell move it
LEAST_REST = 7200.0  # s
_STEADY = 600.0  # s from leaving the target, and to rest after a run
_AFTER = 60.0  # s after a run, in which the speed still changes
_MINUTE = 60.0  # s, of the water on the way


def hull_time(dives: Sequence[DeepDive], columns: Mapping[str, Column]) -> tuple[float, float]:
    """Return the hull's time constant [s] over all dives, and the rms of what is left [K].

    dT/dt = (T_water - T)/tau from the logged temperature at the beginning of each on, the water's
    between minutes along a straight line.
    """
    paths = []
    for dive in dives:
        t = np.unique(np.append(np.arange(dive.time[0], dive.time[-1], _MINUTE), dive.time))
        column = columns[dive.name]
        p = np.interp(t, dive.time, dive.pressure)
        paths.append((dive, t, np.interp(p, column.pressure, column.temperature)))

    def off(log_tau: Array) -> Array:
        tau = float(np.exp(log_tau[0]))
        return np.concatenate(
            [
                np.interp(d.time, t, _follows(tau, float(d.temperature[0]), t, water))
                - d.temperature
                for d, t, water in paths
            ]
        )

    found = least_squares(off, [np.log(1800.0)])
    return float(np.exp(found.x[0])), float(np.sqrt(np.mean(found.fun**2)))


def warmer(dives: Sequence[DeepDive], columns: Mapping[str, Column], pressure: float) -> Array:
    """Return how much warmer the hull is than the cast at a pressure [Pa] on the way down [K]."""
    found = []
    for dive in dives:
        way = slice(0, int(np.argmax(dive.pressure)) + 1)
        column = columns[dive.name]
        hull = np.interp(pressure, dive.pressure[way], dive.temperature[way])
        found.append(hull - np.interp(pressure, column.pressure, column.temperature))
    return np.array(found)


def _follows(tau: float, start: float, t: Array, water: Array) -> Array:
    hull = np.full(len(t), start)
    h = np.diff(t)
    kept, slope = np.exp(-h / tau), np.diff(water) / h
    for i in range(len(h)):
        behind = hull[i] - water[i] + slope[i] * tau
        hull[i + 1] = water[i + 1] - slope[i] * tau + behind * kept[i]
    return hull


@dataclass(frozen=True)
class Scatter:
    """How a speed over `RUN` scatters on the way up."""

    speed: float  # Pa/s, 1 sigma
    std: float  # Pa/s, of that
    looks: int
    acted: int

    @property
    def reading(self) -> float:
        """What each of the two readings scatters by [Pa], steps included."""
        return self.speed * RUN / float(np.sqrt(2.0))


def speed_scatter(dives: Sequence[DeepDive], leaves: Sequence[float]) -> Scatter:
    """Return it, most likely for which looks were acted on.

    leaves: when each left its target [s since it began]. The speed at a look is that between the
    last two logged pressures, where nothing ran.
    """
    speeds, acts = [], []
    for dive, leave in zip(dives, leaves, strict=True):
        t, p = dive.time - dive.time[0], dive.pressure
        begun, over = dive.actions.time - dive.time[0], dive.actions.seconds + _AFTER
        cycle = float(np.median(np.diff(t[t > leave])))
        for i in range(1, len(t)):
            if t[i] < leave + _STEADY or p[i] < TOP or t[i] - t[i - 1] > 1.1 * cycle:
                continue
            if np.any((begun + over > t[i - 1]) & (begun < t[i] + 1.0)):
                continue
            soon = np.flatnonzero((begun > t[i] + 1.0) & (begun < t[i] + RUN + 20.0))
            speeds.append((p[i - 1] - p[i]) / (t[i] - t[i - 1]))
            acts.append(0 if not len(soon) else (1 if dive.actions.pumps[soon[0]] else -1))
    v, a = np.array(speeds), np.array(acts)
    least, most = _edge(SLOWER), _edge(FASTER)

    def against(log_speed: float) -> float:
        s = np.exp(log_speed)
        slow, fast = log_ndtr((least - v) / s), log_ndtr((v - most) / s)
        neither = np.log1p(-np.minimum(np.exp(slow) + np.exp(fast), 1.0 - 1e-12))
        return -float(np.sum(np.where(a > 0, slow, np.where(a < 0, fast, neither))))

    best = minimize_scalar(against, bounds=(np.log(5.0), np.log(200.0)), method="bounded")
    step = 0.05
    bend = against(best.x + step) - 2.0 * best.fun + against(best.x - step)
    speed = float(np.exp(best.x))
    return Scatter(speed, speed * step / float(np.sqrt(bend)), len(v), int(np.sum(a != 0)))


def _edge(speed: float) -> float:
    """Return the speed [Pa/s] above which whole steps of pressure round to `speed` or more.

    speed: whole mbar/s, in Pa/s.
    """
    steps = np.ceil((speed - 0.5 * MBAR) * RUN / STEP)
    return float((steps - 0.5) * STEP / RUN)


@dataclass(frozen=True)
class Rest:
    """What the drive lost between two runs at the target."""

    dive: str
    hours: float
    creep: float  # m3/s
    left: float  # m3 rms, about the straight line


def rests(
    body: Body, values: Mapping[str, float], dive: DeepDive, arrived: float, leave: float
) -> list[Rest]:
    """Return the rests of a dive between two times [s since it began].

    The drive's volume is what body, water and drag ask for, as identified.
    """
    t, found = dive.time - dive.time[0], []
    acts = dive.actions.time - dive.time[0]
    edges = np.unique([arrived, *acts[(acts >= arrived) & (acts <= leave + 1.0)]])
    for a, b in pairwise(edges):
        at = (t > a + _STEADY) & (t < b)
        if b - a < LEAST_REST or at.sum() < 3:
            continue
        x, p = t[at], dive.pressure[at]
        rho = np.interp(p, dive.water.pressure, dive.water.density)
        w = np.gradient(p, x) / (rho * dive.gravity)
        drive = body.mass / rho - hull_volume(body, values, p, dive.temperature[at])
        drive = drive - drag_volume(values, w, rho, dive.gravity)
        line = np.polyfit(x, drive, 1)
        left = drive - np.polyval(line, x)
        found.append(Rest(dive.name, (x[-1] - x[0]) / 3600.0, -float(line[0]), float(np.std(left))))
    return found


def creep_at_rest(found: Sequence[Rest]) -> tuple[float, float]:
    """Return the mean over rests, weighed by their hours, and its standard error [m3/s]."""
    creep = np.array([rest.creep for rest in found])
    share = np.array([rest.hours for rest in found])
    share = share / share.sum()
    mean = float(share @ creep)
    spread = float(share @ (creep - mean) ** 2)
    return mean, float(np.sqrt(spread * np.sum(share**2) / (1.0 - np.sum(share**2))))
