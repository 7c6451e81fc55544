"""From where a law brings a vehicle back, with supply, stroke and hull as they are: by simulation.

Each cell of a map is a run, of law and supervisor where the file has one. Beside it stands
what no controller can do (see `reach`): the map must lie within it, or one of the two is wrong.

From outside the null-controllable set of its falling no controller does. With psi > 0 a vehicle
below its neutral depth falls ever faster. The body

    z' = w,   w' = a (psi z + V0 - V) - D(w),   V within the stroke, |V'| <= R

is monotone: more volume at every instant means less depth and less speed for all time (Kamke's
condition: dw'/dz = a psi >= 0, dz'/dw = 1 > 0, and V enters with one sign). So of all controllers
the one that extends at once and at full rate R falls least, and where it falls without end any
does. R is at most K1 A times the supply: load, lag and leakage of the motor only take away from
it.

With laminar drag the falling has one unstable mode, eta = w + (d + s) z with s^2 + d s = a psi:
eta' = s eta + a (V0 - V). It stays finite if and only if (Hu and Lin, Control Systems with
Actuator Saturation, Birkhaeuser 2001, chapter 2, for a bounded V; here with the ramp that a
bounded V' takes)

    eta(0) < a int_0^inf exp(-s t) (V_best(t) - V0) dt
           = (a/s) [V(0) - V0 + (R/s) (1 - exp(-s T))],     T = (V_max - V(0))/R

Without a limit on V' this is (a/s)(V_max - V0): at rest, the depth at which the stroke's end is
neutral. With other drag the fastest extension is integrated. Rising has no such edge: at the
surface the vehicle floats.
"""

import math
import re
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from swimbladder.design.linear.depths import neutral_end
from swimbladder.design.linear.pump_valve import moved_by_volume
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.tuning.trial import arrivals, fly, held_before
from swimbladder.io.files import rows_csv
from swimbladder.io.progress import Advance, silent
from swimbladder.jobs import Store
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.dynamics import Plant, acceleration, plant
from swimbladder.units import rounded
from swimbladder.vehicle import Vehicle

_FASTEST = 50.0  # m/s, beyond any vehicle's speed
_PIECE = 20.0  # s, between two checks at where it is


def unstable_rate(p: Plant) -> float:
    """Return the rate s [1/s] of the unstable mode of a hull with laminar drag; 0 without one."""
    if p.psi <= 0.0:
        return 0.0
    d, b = (p.d_l if p.epsilon > 0.0 else p.d_b), p.a_b * p.psi
    # not -d/2 + sqrt(...): that cancels where the mode is slow
    return 2.0 * b / (d + math.sqrt(d * d + 4.0 * b))


def fastest_rate(p: Plant) -> float:
    """Return an upper bound of how fast the volume grows [m3/s]."""
    return p.rate if p.positioner else p.gain * p.supply


def holdable_depth(p: Plant) -> float:
    """Return the depth below which the whole stroke does not balance the vehicle [m]."""
    return neutral_end(p) if p.psi > 0.0 else math.inf


def mode_bound(p: Plant, volume: float) -> float:
    """Return what eta = w + (d + s) z has to stay below [m/s], laminar drag and psi > 0.

    volume: to begin with [m3].
    """
    s, R = unstable_rate(p), fastest_rate(p)
    ramp = (p.V_max - volume) / R
    return p.a_b / s * (volume - p.V_0 + R / s * -math.expm1(-s * ramp))


def falls(p: Plant, *, depth: float, speed: float, volume: float) -> bool:
    """Return whether no controller keeps a vehicle from falling without end.

    depth [m], speed [m/s], volume [m3].
    """
    if p.psi <= 0.0:
        return False
    if math.isinf(p.epsilon):
        s = unstable_rate(p)
        return speed + (p.d_l + s) * depth >= mode_bound(p, volume)
    return _integrated(p._replace(a_s=0.0), depth, speed, volume)  # no surface that turns it


def _integrated(p: Plant, depth: float, speed: float, volume: float) -> bool:
    """Return whether the vehicle still falls once it is below what the stroke balances."""
    R, deepest = fastest_rate(p), holdable_depth(p)

    def rates(t: float, x: Array) -> list[float]:
        V = min(p.V_max, volume + R * t)
        return [x[1], acceleration(V, x[0], x[1], p)]

    ramp = max((p.V_max - volume) / R, 0.0)
    x = np.array([depth, speed])
    if ramp > 0.0:
        x = solve_ivp(rates, (0.0, ramp), x, rtol=1e-9, atol=1e-9).y[:, -1]
    while True:  # with the stroke out: either it turns, or it passes the depth of no return
        if x[1] <= 0.0 and x[0] < deepest:
            return False
        if x[1] >= 0.0 and x[0] >= deepest:
            return True
        x = solve_ivp(rates, (ramp, ramp + _PIECE), x, rtol=1e-9, atol=1e-9).y[:, -1]
        ramp += _PIECE


def edge_speed(p: Plant, *, depth: float, volume: float) -> float:
    """Return the speed [m/s, down] from which on no controller stops the fall at `depth` [m].

    inf where there is none: psi is not above 0.
    """
    if p.psi <= 0.0:
        return math.inf
    if math.isinf(p.epsilon):
        return mode_bound(p, volume) - (p.d_l + unstable_rate(p)) * depth

    def side(speed: float) -> float:
        return 1.0 if falls(p, depth=depth, speed=speed, volume=volume) else -1.0

    if side(-_FASTEST) > 0.0 or side(_FASTEST) < 0.0:
        return -side(-_FASTEST) * math.inf
    return float(brentq(side, -_FASTEST, _FASTEST, xtol=1e-4))


_CHUNK = 160  # runs between two readings at the clock; whole blocks of lanes
_HOLDABLE = 0.95  # of the depth that the stroke balances: deepest set-point of a map of errors
_WATCHED = 3.0  # times the time in which it should be back


class Verdict(IntEnum):
    """What became of a run."""

    NOT_ASKED = 0  # out of the water, or no such set-point
    RECOVERED = 1  # in the band in time, and stays
    SLOW = 2  # in the band later, and stays
    UNSETTLED = 3  # not in the band at the end, but not lost
    LOST = 4  # falls, and no controller can stop it any more
    BROUGHT_UP = 5  # by the supervisor, which took over


@dataclass(frozen=True, kw_only=True)
class Map:
    """Verdicts over two coordinates of the start, and the edge of what any controller can do."""

    name: str
    title: str
    x_label: str
    y_label: str
    x: Array  # [columns]
    y: Array  # [rows]
    verdicts: NDArray[np.int64]  # [rows, columns]
    seconds: Array  # s, until it stays in the band; nan where it does not
    edge: Array  # of y, over x: beyond it no controller; inf where there is none
    hopeless: Flags  # [rows, columns], beyond what any controller can do

    def count(self, verdict: Verdict) -> int:
        """Return how many cells have a verdict."""
        return int(np.sum(self.verdicts == verdict))

    def csv(self) -> str:
        """Return it as a table: both coordinates, what became of the run, and whether any could."""
        labels = (self.x_label, self.y_label)
        names = (re.sub(r"[^\w-]+", "_", label).strip("_") for label in labels)
        i, j = np.nonzero(self.verdicts != Verdict.NOT_ASKED)
        words = [Verdict(v).name.lower() for v in self.verdicts[i, j]]
        hopeless = self.hopeless[i, j].astype(int)
        rows = zip(self.x[j], self.y[i], words, self.seconds[i, j], hopeless, strict=True)
        return rows_csv((*names, "verdict", "recovered_s", "hopeless"), rows)

    @property
    def asked(self) -> int:
        """How many runs there were."""
        return self.verdicts.size - self.count(Verdict.NOT_ASKED)


@dataclass(frozen=True)
class Recovery:
    """A vehicle under a law, and what counts as recovered."""

    vehicle: Vehicle
    bound: BoundLaw
    within: float  # s, in which it is to be back
    band: float  # m
    parts: Store  # of runs that are done
    supervised: bool = False  # whether the law flies under the vehicle's supervisor

    @property
    def deepest(self) -> float:
        """Depth [m] below which a vehicle counts as lost: the rating of one that dives to it."""
        rating = self.vehicle.hull.depth_limit
        return rating if self.bound.law.ways is not None and rating is not None else math.inf

    def run(
        self, starts: Array, asked: Flags, rests: bool, advance: Advance
    ) -> tuple[NDArray[np.int64], Array]:
        """Return verdicts and times [s] of runs.

        starts [4, rows, columns]: depth [m], set-point [m], speed [m/s], volume [m3]. rests:
        whether a supervised one is at rest for a while before the set-point is given.
        """
        verdicts = np.full(asked.shape, int(Verdict.NOT_ASKED))
        seconds = np.full(asked.shape, math.nan)
        cells = np.argwhere(asked)
        for first in range(0, len(cells), _CHUNK):
            rows, columns = cells[first : first + _CHUNK].T
            some = starts[:, rows, columns]
            found = self.parts.get(partial(self._chunk, rests, *some), "map", rests, some)
            verdicts[rows, columns] = found["verdicts"]
            seconds[rows, columns] = found["seconds"]
            advance(len(rows) / len(cells))
        return verdicts, seconds

    def _chunk(
        self, rests: bool, depth: Array, target: Array, speed: Array, volume: Array
    ) -> dict[str, Any]:
        before = held_before(self.bound.sample_time) if rests and self.supervised else None
        p = plant(moved_by_volume(self.vehicle))
        runs = fly(
            self.vehicle,
            self.bound,
            target=target,
            duration=_WATCHED * self.within,
            before=before,
            supervised=self.supervised,
            start_depth=depth,
            start_speed=speed,
            start_volume=volume,
        )
        deep = np.nan_to_num(runs.depth, nan=math.inf).max(axis=0) > self.deepest
        since = arrivals(runs.time, ~(np.abs(runs.depth - target) <= self.band))
        lost = deep | runs.stopped
        alarm = runs.alarm > 0
        there = np.isfinite(since) & ~lost & ~alarm
        ends = np.stack([runs.depth[-1], runs.speed[-1], runs.volume[-1]], axis=1).tolist()
        for k in np.flatnonzero(~there & ~lost):
            lost[k] = falls(p, **dict(zip(("depth", "speed", "volume"), ends[k], strict=True)))
        cases = [there & (since <= self.within), there, lost, alarm]
        ranks = (Verdict.RECOVERED, Verdict.SLOW, Verdict.LOST, Verdict.BROUGHT_UP)
        return {
            "verdicts": np.select(cases, [int(v) for v in ranks], int(Verdict.UNSETTLED)),
            "seconds": np.where(there, since, math.nan),
        }


def recovery_maps(
    recovery: Recovery, depths: tuple[float, float], cells: int, advance: Advance = silent
) -> tuple[Map, ...]:
    """Return the map of steps, and at three depths that of depth errors and speeds.

    cells: to a side. advance: called with the share of the work that is done.
    """
    p = plant(moved_by_volume(recovery.vehicle))
    low, high = max(depths[0], p.z_surface), depths[1]
    depth = np.linspace(low, high, cells)
    change = np.linspace(low - high, high - low, 2 * (cells // 2) + 1)
    Z, C = np.meshgrid(depth, change)
    goal = Z + C
    neutral = np.clip(p.psi * Z + p.V_0, p.V_min, p.V_max)
    asked = (goal > low - 1e-9) & (goal < high + 1e-9) & (C != 0.0)
    held = holdable_depth(p)
    maps: list[Map] = []

    def add(starts: tuple[ArrayLike, ...], asked: Flags, **about: Any) -> None:
        """Integrate from every start of a map (depth, set-point, speed, volume) and append it."""
        stacked = np.stack(np.broadcast_arrays(*starts))
        rests = about["name"] == "steps"
        verdicts, seconds = recovery.run(stacked, asked, rests, lambda x: advance(0.25 * x))
        maps.append(Map(verdicts=verdicts, seconds=seconds, **about))

    add(
        (Z, goal, 0.0, neutral),
        asked,
        name="steps",
        title="set-point changes from rest",
        x_label="depth now [m]",
        y_label="change of the set-point [m]",
        x=depth,
        y=change,
        edge=held - depth,
        hopeless=np.maximum(goal, Z) >= held,
    )
    deepest = min(high, _HOLDABLE * held)
    for n, share_of in enumerate((0.2, 0.5, 1.0)):
        reference = low + share_of * (deepest - low)
        volume = float(np.clip(p.psi * reference + p.V_0, p.V_min, p.V_max))
        error = np.linspace(low - reference, high - low, cells)
        fastest = _speeds(p, reference, volume)
        speed = fastest * np.linspace(-1.0, 1.0, 2 * (cells // 2) + 1) ** 3  # finer near rest
        E, S = np.meshgrid(error, speed)
        edge = np.array([edge_speed(p, depth=reference + e, volume=volume) for e in error])
        add(
            (reference + E, reference, S, volume),
            reference + E <= recovery.deepest,
            name=f"errors-{n + 1}",
            title=f"errors and speeds about {rounded(reference, 3)} m",
            x_label="depth less set-point [m]",
            y_label="speed, down [m/s]",
            x=error,
            y=speed,
            edge=edge,
            hopeless=(S - edge >= 0.0) | (reference >= held),
        )
    return tuple(maps)


def _speeds(p: Any, depth: float, volume: float) -> float:
    """Return a speed [m/s] beyond what can be stopped, or what the whole stroke drives."""
    edge = edge_speed(p, depth=depth, volume=volume)
    force = p.a_b * (p.V_max - p.V_min)
    driven = math.sqrt(force / p.d_t) if p.d_t > 0.0 else force / max(p.d_l, 1e-9)
    return 1.3 * min(max(edge, 0.05 * driven), driven)
