"""The comparison itself: fit, predict, and say how far apart model and log are.

What is asked to be adjusted is adjusted so that the predicted depth meets the measured one, by
name, in a vehicle and in the start of a run. The model is run along a record at once, or in windows
that each start from what was measured.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.comparison.misread import Drive, doubtful, is_still, misread
from swimbladder.estimation.comparison.record import Record, follow_in, record, thinned
from swimbladder.estimation.estimates import (
    DRIFT_STD,
    MODEL_ERROR,
    Estimate,
    Finding,
    bounded_fit,
    check_names,
    claims_too_much,
    impossible_mass,
    impossible_psi,
    sentence,
    undetermined,
)
from swimbladder.estimation.series import rms, white_noise
from swimbladder.io.answers import Answer, as_json
from swimbladder.io.logs import Log
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop import Solution, drive, simulate
from swimbladder.sim.closed_loop.replay import Course
from swimbladder.vehicle import IdentifiedMotion, Vehicle

_SPAN = 3.0  # s to each side, for the depth and speed at which a window starts
_WINDOWS = (10.0, 20.0, 40.0, 80.0, 160.0)  # s
_TILES = 300  # windows at most, which are enough to begin with
_HORIZONS = (0.125, 0.25, 0.5)  # of the record


class Start(NamedTuple):
    """The state in which a run starts, and how its neutral volume drifts from there."""

    depth: float | None  # m; None: afloat
    speed: float  # m/s
    drift: float = 0.0  # m3/s


class Window(NamedTuple):
    """A stretch of a record, its last sample included."""

    first: int
    last: int


def stages(rec: Record) -> list[list[Window]]:
    """Return ever harder tasks for a fit: the last is the whole record in one run.

    A vehicle that floats freely doubles any error of its neutral volume over and over, so a fit
    over the whole of a record has many local minima. Short windows have one.
    With a logged volume each window starts from what was measured; with a voltage the volume on
    the way is not known, and the horizon grows instead; in closed loop errors do not grow.
    """
    whole = Window(0, len(rec.time) - 1)
    if rec.drive == "volume":
        return [*(_tiles(rec, w)[:_TILES] for w in _WINDOWS if w < rec.duration), [whole]]
    if rec.drive == "voltage":
        ends = [int(np.searchsorted(rec.time, part * rec.duration)) for part in _HORIZONS]
        return [*([Window(0, end)] for end in ends if end >= 10), [whole]]
    return [[whole]]


def _tiles(rec: Record, length: float) -> list[Window]:
    count = max(round(rec.duration / length), 1)
    edges = np.searchsorted(rec.time, np.linspace(0.0, rec.duration, count + 1)[1:-1])
    bounds = [0, *sorted({int(e) for e in edges} - {0, len(rec.time) - 1}), len(rec.time) - 1]
    return [Window(a, b) for a, b in pairwise(bounds)]


def measured_start(rec: Record, at: int) -> Start:
    """Return depth and speed at sample `at`, as logged; without a logged speed from a parabola
    through the depths around it.
    """
    if rec.speed is not None and np.isfinite(rec.speed[at]):
        return Start(float(rec.depth[at]), float(rec.speed[at]))
    near = np.abs(rec.time - rec.time[at]) <= _SPAN
    if near.sum() < 4:
        return Start(float(rec.depth[at]), 0.0)
    parabola = np.polyfit(rec.time[near] - rec.time[at], rec.depth[near], 2)
    return Start(float(parabola[2]), float(parabola[1]))


def run(vehicle: Vehicle, rec: Record, start: Start) -> tuple[Array, Array, Solution | None]:
    """Return depth [m] and volume [m3] at every sample, and the Solution they are from.

    In the water of a cast there is none, and a depth is nan from where the vehicle left the water.
    """
    depth, begin = _begin(vehicle, rec, 0, start)
    known: dict[str, Any] = {"start_depth": depth, "start_speed": start.speed}
    known["bottom_depth"] = rec.bottom_depth
    if rec.drive == "setpoint":
        known |= {"setpoints": list(rec.setpoints), "duration": float(rec.time[-1])}
        solution = simulate(vehicle, start_volume=begin, checked=False, **known)
        volumes = np.interp(rec.time, solution.time, solution.volume)
        return _hermite(rec.time, solution), volumes, solution
    if rec.drive == "voltage":
        known |= {"voltage": rec.inputs, "start_volume": begin}
    elif len(rec.layers.table):
        follow = _follower(rec, Window(0, len(rec.time) - 1))
        return _depths([(vehicle, start)], rec, 0, follow)[0], rec.inputs, None
    else:  # only volume less neutral volume moves the vehicle
        known["volume"] = rec.inputs - start.drift * rec.time
    solution = drive(vehicle, time=rec.time, **known)
    missing = len(rec.time) - len(solution.depth)
    depths, volumes = (np.pad(y, (0, missing), "edge") for y in (solution.depth, solution.volume))
    return depths, volumes, solution


def _begin(vehicle: Vehicle, rec: Record, first: int, start: Start) -> tuple[float, float]:
    """Return depth [m] and volume [m3] at the sample that a run begins with."""
    volume = None if rec.volume is None else float(rec.volume[first])
    depth = start.depth
    if depth is None:
        added = rec.layers.at(vehicle.hull.emergence_depth)
        depth = _afloat(vehicle, None if volume is None else volume - added)
    highest = vehicle.hull.emergence_depth - 0.9 * vehicle.hull.height  # nearly out of the water
    depth = min(max(depth, highest), rec.bottom_depth)
    at = vehicle.neutral_volume(depth)  # where the log does not say, at rest if the stroke lets it
    if volume is not None and rec.volume_absolute:
        at = volume
    return depth, min(max(at, vehicle.stroke.minimum), vehicle.stroke.maximum)


_Follower = Callable[[Sequence[Plant], Array], Array]


def _follower(rec: Record, window: Window) -> _Follower:
    """Return what drives vehicles along a window of a record, as `Course.follow` does."""
    part, ramps = slice(window.first, window.last + 1), rec.drive == "volume"
    if ramps and len(rec.layers.table):
        known = rec.layers, rec.time[part], rec.inputs[part]
        return lambda plants, starts: follow_in(known[0], plants, *known[1:], starts[:, 1:])
    return Course(rec.time[part], rec.inputs[part], ramps=ramps, since=0.0).follow


def _depths(
    vehicles: Sequence[tuple[Vehicle, Start]], rec: Record, first: int, follow: _Follower
) -> Array:
    """Return the depths [vehicles, n] in m from a sample on, each vehicle from a start of its own.

    Where a vehicle stops it stays.
    """
    plants = [plant(vehicle, bottom_depth=rec.bottom_depth) for vehicle, _ in vehicles]
    starts = [(*_begin(v, rec, first, s)[::-1], s.speed, s.drift) for v, s in vehicles]
    found = follow(plants, np.array(starts))
    reached = np.isfinite(found).sum(axis=1) - 1
    stays = found[np.arange(len(found)), np.maximum(reached, 0)]
    return np.asarray(np.where(np.isnan(found), stays[:, None], found))


def _afloat(vehicle: Vehicle, volume: float | None) -> float:
    """Return the depth [m] at which a vehicle of this volume [m3] floats at the surface."""
    hull = vehicle.hull
    if volume is None:
        return hull.emergence_depth
    spare = max(volume - vehicle.neutral_volume(hull.emergence_depth), 0.0)
    return hull.emergence_depth - spare / hull.waterplane_area


def _hermite(time: Array, s: Solution) -> Array:
    """Return the depth [m] of a solution between its samples, from depths and speeds there."""
    if len(s.time) < 2:
        return np.full_like(time, s.depth[0])
    between = CubicHermiteSpline(s.time, s.depth, s.speed)
    return np.asarray(between(np.clip(time, s.time[0], s.time[-1])))


class Fittable(NamedTuple):
    """A quantity that can be fitted: its unit, and a difference that a log shows."""

    unit: str
    scale: float
    meaning: str


FITTABLE: Mapping[str, Fittable] = {
    "neutral_volume": Fittable("m3", 1e-7, "neutral volume at depth 0, against mid-stroke"),
    "neutral_drift": Fittable("m3/s", 1e-10, "how fast the neutral volume grows"),
    "mass": Fittable("kg", 0.1, "all that is accelerated"),
    "drag": Fittable("N s/m", 0.05, "laminar coefficient k_dl"),
    "drag_quadratic": Fittable("N s2/m2", 0.5, "turbulent coefficient k_dt"),
    "psi": Fittable("m3/m", 1e-8, "volume lost per metre against the water's"),
    "start_depth": Fittable("m", 0.01, "depth at the first sample"),
    "start_speed": Fittable("m/s", 0.01, "speed at the first sample, positive down"),
}


def first_and_limits(name: str, vehicle: Vehicle, start: Start) -> tuple[float, float, float]:
    """Return what a fit of `name` begins with, and its bounds.

    These are where physics ends, or so far off that the log is another's.
    """
    stroke, motion, drag = vehicle.stroke, vehicle.motion, vehicle.drag
    span, m, psi = stroke.maximum - stroke.minimum, vehicle.mass, vehicle.hull.psi
    least_mass = 1e-2 * m
    if not isinstance(motion, IdentifiedMotion):
        least_mass = motion.dry_mass + motion.entrained_mass
    depth, speed = 0.0 if start.depth is None else start.depth, start.speed
    return {
        "neutral_volume": (vehicle.trim_error, stroke.minimum - span, stroke.maximum + span),
        "neutral_drift": (start.drift, -span / 10.0, span / 10.0),
        "mass": (m, least_mass, 100.0 * m),
        "drag": (drag.k_dl, 1e-3 * drag.k_dl, 1e3 * drag.k_dl),
        "drag_quadratic": (drag.k_dt, 0.0, 1e3 * drag.k_dt),
        "psi": (psi, -span, span),
        "start_depth": (depth, depth - 1.0, depth + 1.0),
        "start_speed": (speed, speed - 1.0, speed + 1.0),
    }[name]


def put(name: str, value: float, vehicle: Vehicle, start: Start) -> tuple[Vehicle, Start]:
    """Return vehicle and start with `name` at `value`, everything else as it was."""
    if name == "neutral_volume":
        return vehicle.model_copy(update={"trim_error": value}), start
    if name == "psi":
        hull = vehicle.hull.model_copy(update={"psi": value})
        return vehicle.model_copy(update={"hull": hull}), start
    if name in ("mass", "drag", "drag_quadratic"):
        motion = vehicle.motion.model_copy(update=_motion(name, value, vehicle))
        return vehicle.model_copy(update={"motion": motion}), start
    field = {"neutral_drift": "drift", "start_depth": "depth", "start_speed": "speed"}[name]
    return vehicle, start._replace(**{field: value})


def _motion(name: str, value: float, vehicle: Vehicle) -> dict[str, Any]:
    motion = vehicle.motion
    if isinstance(motion, IdentifiedMotion):  # K2 = k_b/k_dl and T2 = m/k_dl, eqs (28)-(29)
        m = value if name == "mass" else vehicle.mass
        k_dl = value if name == "drag" else vehicle.drag.k_dl
        return {"K2": vehicle.water.specific_weight / k_dl, "T2": m / k_dl}
    if name == "mass":
        return {"added_mass": value - motion.dry_mass - motion.entrained_mass}
    field = "k_dl" if name == "drag" else "k_dt"
    return {"drag": motion.drag.model_copy(update={field: value})}


_FINEST = 2e-4  # m, a noise that sensors have
_LARGEST = 10.0  # m, a residual beyond this says no more
_MOST, _ENOUGH = 50_000, 2000  # samples, more of which only take longer
_STEP = 1e-3  # of a parameter's scale, for the derivative
_SHIFTS = [s * m for m in (3e-8, 1e-7, 3e-7, 1e-6, 3e-6) for s in (1.0, -1.0)]  # m3


@dataclass(frozen=True)
class Fitted:
    """A fitted number, its standard deviation (None where it is not identifiable) and unit.

    The deviation allows for residuals that resemble their neighbours; it holds as far as the
    model is right, which it does not test.
    """

    value: float
    std: float | None
    unit: str


class Outcome(NamedTuple):
    """What a fit found."""

    vehicle: Vehicle
    start: Start
    fitted: dict[str, Fitted]
    why: Mapping[str, str] = {}  # what has no std is not identifiable
    ends: Set[str] = frozenset()  # what is at the end of what a vehicle can have


def default_names(rec: Record) -> tuple[str, ...]:
    """Return what is fitted unless asked otherwise.

    The neutral volume, and the state at the start of an open loop that is under way there.
    """
    if rec.drive == "setpoint" or rec.afloat:
        return ("neutral_volume",)
    return ("neutral_volume", "start_depth", "start_speed")


def adjust(
    vehicle: Vehicle,
    rec: Record,
    names: Sequence[str],
    advance: Advance = silent,
    good: float = 0.0,
) -> Outcome:
    """Fit `names` by least squares on the depths compared, best of several ways there.

    Every stage begins where the one before ended; the whole record is then fitted from each of
    these ends and from others beside them, until three ways lead to the same best place and that
    explains nine tenths of the variance, or until one is as `good`: less than this off, rms [m].
    advance: called with the share of the work done since it was last called.
    Raises InputError for a name that cannot be fitted.
    """
    _check(names, vehicle, rec)
    first = Start(None, 0.0) if rec.afloat else measured_start(rec, 0)
    if not names:
        return Outcome(vehicle, first, {})
    problem = _Problem(vehicle, rec, tuple(names), first)
    *easier, whole = stages(rec)
    met = [problem.begin()]
    for windows in easier:
        if rec.compared[: windows[-1].last + 1].any():
            met.append(problem.solve(met[-1], windows)[1])
        advance(0.5 / len(easier))
    enough = 0.05 * float(np.var(rec.depth[rec.compared])) * rec.compared.sum()
    best, q, agreed = np.inf, met[-1], 0
    for begin in _ways(problem, met, whole):
        end, found = problem.solve(begin, whole)
        agreed = agreed + 1 if abs(end - best) <= 1e-3 * best else 1 if end < best else agreed
        if end < best:
            best, q = end, found
        if (agreed == 3 and best < enough) or best < 0.5 * good**2 * rec.compared.sum():
            break
    residual = problem.residual(q, whole)
    spread = _spread(problem, q, residual, whole) * problem.scale
    values, misfit = q * problem.scale, rms(residual) / _noise(rec)
    ends, fitted, why = problem.at_limit(q), {}, {}
    limits = np.stack([problem.least, problem.most], axis=1) * problem.scale[:, None]
    each = (of.tolist() for of in (values, spread, ends, limits))
    for name, value, std, end, (low, high) in zip(names, *each, strict=True):
        if end:
            why[name] = sentence("compare", "undetermined", "end")
        elif claims_too_much(std, high - low, misfit):
            why[name] = sentence("undetermined", "claims", times=misfit)
        else:
            e = Estimate.of(value, std, FITTABLE[name].unit)
            if name == "drag_quadratic" or (name == "drag" and vehicle.drag.k_dt > 0.0):
                low = -math.inf  # of either there may be none
            if name.startswith("start"):  # searched beside the first sample, which binds nothing
                low, high = 2.5 * low - 1.5 * high, 2.5 * high - 1.5 * low
            why[name] = undetermined(e, (low, high), misfit)
        fitted[name] = Fitted(value, None if why[name] else std, FITTABLE[name].unit)
    at_end = {name for name, end in zip(names, ends.tolist(), strict=True) if end}
    return Outcome(*_apply(names, values, vehicle, first), fitted, why, at_end)


def _no_estimates(outcome: Outcome, *, asked: bool, uniform: bool) -> Iterator[Finding]:
    """Yield which fitted numbers cannot be, or a log does not determine though `asked`.

    uniform: whether no cast says how the water's density goes with depth.
    """
    vehicle = outcome.vehicle
    for name, found in outcome.fitted.items():
        end = name in outcome.ends
        none = end and name == "drag_quadratic"  # without it the log is explained best
        if found.std is None and (asked or end) and not none:
            yield Finding.of("compare", "undetermined", name=name, why=outcome.why[name])
        elif found.std is not None:
            e = Estimate.of(found.value, found.std, found.unit)
            heavy, displaced = vehicle.water.specific_weight, vehicle.hull.displaced_volume
            if name == "mass":
                yield from impossible_mass(e, heavy * displaced, None)
            elif name == "psi" and uniform:
                yield from impossible_psi(e, heavy, displaced)


class _Problem:
    """The residuals of a record as a function of what is fitted, each in its own scale."""

    def __init__(self, vehicle: Vehicle, rec: Record, names: tuple[str, ...], first: Start) -> None:
        self.vehicle, self.rec, self.names, self.first = vehicle, rec, names, first
        self.scale = np.array([FITTABLE[name].scale for name in names])
        found = np.array([first_and_limits(name, vehicle, first) for name in names])
        self.start, self.least, self.most = (found / self.scale[:, None]).T
        self.measured = cache(partial(measured_start, rec))
        self.follower = cache(partial(_follower, rec))
        self.last: tuple[Array, list[Window], Array] | None = None

    def begin(self) -> Array:
        begun: Array = self.start.copy()
        if "neutral_volume" in self.names:
            at = self.names.index("neutral_volume")
            begun[at] = _guess(self.vehicle, self.rec) / self.scale[at]
        return begun

    def residual(self, q: Array, windows: list[Window]) -> Array:
        if self.last and self.last[1] is windows and np.array_equal(self.last[0], q):
            return self.last[2]  # a search asks for the slope where it was last
        off: Array = self._residuals([q], windows)[0]
        self.last = (q.copy(), windows, off)
        return off

    def _residuals(self, places: Sequence[Array], windows: list[Window]) -> Array:
        """Return the residuals [places, samples] in m at several q."""
        values = [q * self.scale for q in places]
        moved = [_apply(self.names, v, self.vehicle, self.first) for v in values]
        rec, upto = self.rec, windows[-1].last + 1
        off = np.full((len(places), upto), np.nan)
        for window in reversed(windows):  # where two meet, the depth is that of the one before
            at, part = window.first, slice(window.first, window.last + 1)
            if rec.drive == "setpoint":
                off[:] = [run(vehicle, rec, start)[0] for vehicle, start in moved]
                continue
            here = [(v, self.measured(at)._replace(drift=s.drift) if at else s) for v, s in moved]
            off[:, part] = _depths(here, rec, at, self.follower(window))
        off = (off - rec.depth[:upto])[:, rec.compared[:upto]]
        return np.clip(np.nan_to_num(off, nan=_LARGEST), -_LARGEST, _LARGEST)

    def slope(self, q: Array, windows: list[Window]) -> Array:
        here, *moved = self._residuals([q, *(q + _STEP * np.eye(len(q)))], windows)
        return np.stack([(there - here) / _STEP for there in moved], axis=1)

    def cost(self, q: Array, windows: list[Window]) -> float:
        return 0.5 * float(np.sum(self.residual(q, windows) ** 2))

    def solve(self, q: Array, windows: list[Window]) -> tuple[float, Array]:
        """Return (cost, place) of the minimum that is found from `q`."""
        residual, slope = (partial(of, windows=windows) for of in (self.residual, self.slope))
        ends, limits = (1e-7, 1e-9, 1e-12), (self.least, self.most)
        return bounded_fit(residual, slope, q, limits, ends=ends, most=60, edge=_STEP)

    def at_limit(self, q: Array) -> Flags:
        return np.asarray((q < self.least + 2.0 * _STEP) | (q > self.most - 2.0 * _STEP))


def _ways(problem: _Problem, met: list[Array], whole: list[Window]) -> Iterator[Array]:
    """Yield places to begin the last fit at: the ends of the stages, then others beside them."""
    yield from reversed(met)
    if "neutral_volume" not in problem.names:
        return
    axis = problem.names.index("neutral_volume")
    unit = np.eye(len(problem.names))[axis] / problem.scale
    beside = [q + shift * unit for q in (met[0], met[-1]) for shift in _SHIFTS]
    yield from sorted(beside, key=lambda q: problem.cost(q, whole))[:2]
    if len(problem.names) > 1:  # what more is fitted must not make it worse
        alone = adjust(problem.vehicle, problem.rec, ("neutral_volume",)).fitted
        begin = problem.begin()
        begin[axis] = alone["neutral_volume"].value / problem.scale[axis]
        yield begin


def _apply(
    names: Sequence[str], values: Array, vehicle: Vehicle, start: Start
) -> tuple[Vehicle, Start]:
    for name, value in zip(names, values.tolist(), strict=True):
        vehicle, start = put(name, value, vehicle, start)
    return vehicle, start


def _check(names: Sequence[str], vehicle: Vehicle, rec: Record) -> None:
    """Raise InputError for a name that cannot be fitted to this vehicle and record."""
    coefficients = {"drag": vehicle.drag.k_dl, "drag_quadratic": vehicle.drag.k_dt}
    check_names(names, FITTABLE, "free", "this cannot be fitted", "; or none")
    for name in names:
        what = remedy = ""
        if coefficients.get(name) == 0.0:
            what = f"the vehicle's drag law, {vehicle.drag.law}, has no such term"
            remedy = 'Choose law = "blended" in [motion.drag], or fit the other term'
        elif name.startswith("start") and rec.afloat:
            what = "the log starts with the vehicle afloat, at rest at the surface"
            remedy = "Leave it out, or cut the log to where the vehicle is under way"
        elif name == "neutral_drift" and rec.drive != "volume":
            what = "a drift can be fitted only where the logged volume drives the vehicle"
            remedy = "Choose `drive='volume'`, or leave it out"
        if what:
            raise InputError(what, field="free", value=name, remedy=remedy)


def _guess(vehicle: Vehicle, rec: Record) -> float:
    """Return a first neutral volume [m3]: the one at which the vehicle mostly was, under water."""
    if rec.volume is None or not rec.volume_absolute:
        return vehicle.trim_error
    depth = rec.depth[rec.compared]
    resting = vehicle.hull.psi * depth + rec.layers.along(depth)
    return float(np.median(rec.volume[rec.compared] - resting))


def _noise(rec: Record) -> float:
    """Return the noise of the depth's sensor [m], 1 sigma, of which none is without."""
    return max(white_noise(rec.time, rec.depth), _FINEST)


def _nuisances(rec: Record, names: Sequence[str]) -> dict[str, float]:
    """Return what is not fitted and not known either, with its standard deviation before."""
    known = {"neutral_drift": DRIFT_STD} if rec.drive == "volume" else {}
    if not rec.afloat and rec.drive != "setpoint":
        known |= {"start_depth": np.inf, "start_speed": np.inf}
    return {name: std for name, std in known.items() if name not in names}


def _spread(problem: _Problem, q: Array, residual: Array, whole: list[Window]) -> Array:
    """Return the standard deviations of what is fitted, for residuals that are correlated.

    The variance is taken up by the number of samples that carry the information of one:
    1 + 2 sum of the residual's autocorrelation up to its first zero. What is not fitted though it
    is not known (see `_nuisances`) counts twice: by what it leaves unknown, and by how far it moves
    what is fitted where it may be what the log speaks for (omitted-variable bias).
    """
    rec, count = problem.rec, len(q)
    beside = _nuisances(rec, problem.names)
    wide = _Problem(problem.vehicle, rec, (*problem.names, *beside), problem.first)
    slope, n = wide.slope(np.append(q, wide.start[count:]), whole), len(residual)
    centred = residual - residual.mean()
    power = float(centred @ centred)
    alike = 1.0
    if power > 0.0:
        correlation = np.fft.irfft(np.abs(np.fft.rfft(centred, 2 * n)) ** 2)[:n] / power
        ends = np.flatnonzero(correlation <= 0.0)
        alike = 2.0 * float(correlation[: ends[0] if len(ends) else n].sum()) - 1.0
    variance = float(residual @ residual) / max(n - count, 1) * max(alike, 1.0)
    before = np.append(np.full(count, np.inf), [*beside.values()]) / wide.scale
    rows = np.vstack([slope, np.diag(math.sqrt(variance) / before)])
    left, singular, rotation = np.linalg.svd(rows, full_matrices=False)
    if singular[-1] <= 1e-10 * singular[0]:
        return np.full(count, np.nan)
    inverse = rotation.T / singular
    moved = inverse @ (left[:n].T @ residual)
    return np.asarray(np.sqrt(variance * (inverse**2).sum(axis=1) + moved**2))[:count]


@dataclass(frozen=True, kw_only=True)
class Comparison(Answer):
    """Measured against predicted depth; statistics over the samples that are compared.

    residual is predicted less measured. rms and bias in m; variance_explained is
    1 - var(residual)/var(depth). volume_rms [m3] is known where the model chose the volume and the
    log has it. vehicle carries the fitted numbers. solution: none in the water of a cast. findings:
    of severity no, where the log cannot have been made by this vehicle.
    """

    source: str
    vehicle: Vehicle
    record: Record
    fitted: dict[str, Fitted]
    predicted: Array  # m
    volume: Array  # m3, as driven or predicted
    rms: float
    bias: float
    variance_explained: float
    largest: float  # m
    volume_rms: float | None
    solution: Solution | None
    notes: tuple[str, ...]
    findings: tuple[Finding, ...] = ()

    @property
    def possible(self) -> bool:
        """Whether this vehicle can have made the log as it was read."""
        return all(f.severity != "no" for f in self.findings)

    @property
    def residual(self) -> Array:
        """Predicted less measured depth at every sample [m]."""
        return self.predicted - self.record.depth

    @property
    def n(self) -> int:
        """How many samples are compared."""
        return int(self.record.compared.sum())

    def columns(self) -> dict[str, Array]:
        """Return the columns of compare.csv by name."""
        rec = self.record
        found: dict[str, Array | None] = {
            "time_s": rec.time,
            "depth_m": rec.depth,
            "depth_predicted_m": self.predicted,
            "residual_m": self.residual,
            "compared": rec.compared.astype(float),
            "reference_depth_m": rec.reference,
            "volume_m3": rec.volume,
            "volume_predicted_m3": None if rec.drive == "volume" else self.volume,
            "voltage_V": rec.voltage,
        }
        return {name: values for name, values in found.items() if values is not None}

    def to_dict(self) -> dict[str, Any]:
        """Return the outcome in SI units, ready for JSON."""
        area, off = self.vehicle.piston_area, self.volume_rms
        return {
            "log": self.source,
            "vehicle": self.vehicle.name,
            "drive": self.record.drive,
            **as_json(self, "rms_m bias_m variance_explained largest_m fitted n"),
            "n_not_compared": len(self.record.time) - self.n,
            "duration_s": self.record.duration,
            "volume_rms_m3": off,
            "piston_rms_m": None if off is None or area is None else off / area,
            "notes": list(self.notes),
            **as_json(self, "possible findings"),
        }


def compare(
    log: Log,
    vehicle: Vehicle,
    *,
    drive: Drive | None = None,
    free: Sequence[str] | None = None,
    bottom_depth: float = np.inf,
    surface_margin: float = 0.1,
    submerged: bool = False,
    cast: Column | None = None,
    advance: Advance = silent,
) -> Comparison:
    """Drive the vehicle with what the log recorded, and compare depths.

    Parameters
    ----------
    log
        As `read_log` returns it.
    vehicle
        As `load_vehicle` returns it.
    drive
        volume (or piston), voltage, or setpoint: the vehicle's own controller, with ideal sensors,
        follows the logged set-point; none: the first of these that the log has.
    free
        Names of what is fitted to this log, see `FITTABLE`; none: the neutral volume, with the
        state at the start where the vehicle is under way. An empty list fits nothing.
    bottom_depth
        Depth of the bottom [m]; infinite: there is none.
    surface_margin
        Depths less than this below the depth of emergence are not compared [m].
    submerged
        Whether to begin where the vehicle is first deeper than `surface_margin` below the depth of
        emergence.
    cast
        The water, for a logged volume, as `read_cast` or `cast_column` returns it; none: the
        vehicle's own.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    Comparison
        Measured against predicted depth, and what was fitted.

    Raises
    ------
    LogError
        An InputError: the log has not what drives the vehicle, or does not go together with it.
    InputError
        What is asked does not go together with log and vehicle.
    NoAnswerError
        The model cannot follow the log to its end.
    """
    rec = record(
        log,
        vehicle,
        drive=drive,
        bottom_depth=bottom_depth,
        surface_margin=surface_margin,
        submerged=submerged,
        column=cast,
    )
    rec = thinned(rec, _MOST)
    names = default_names(rec) if free is None else tuple(free)
    outcome = adjust(vehicle, rec, names, advance)
    predicted, volume, solution = run(outcome.vehicle, rec, outcome.start)
    of = f"after the first sample, of {rec.duration:.4g} s"
    finite = np.isfinite(predicted)
    judged = outcome.vehicle.model_copy(update={"trim_error": vehicle.trim_error})
    wrong, sure = misread(rec, judged)
    stopped = ""
    if solution is None and not finite.all():
        stopped = f"the model left the water {float(rec.time[finite][-1]):.4g} s {of}; fit "
        stopped += "the neutral volume, or begin with `submerged=True`"
    if solution is not None and not solution.finished:
        stopped = f"the model stopped {float(solution.time[-1]):.4g} s {of}. {solution.stop.value}"
    if stopped:
        raise NoAnswerError(f"{log.source}: {stopped if wrong is None else wrong.sentence}")
    measured, used = rec.depth[rec.compared], rec.compared
    off = predicted[used] - measured
    logged = rec.volume if rec.drive != "volume" else None
    explained = float(1.0 - off.var() / measured.var()) if measured.var() else np.nan
    findings = [*_no_estimates(outcome, asked=free is not None, uniform=cast is None)]
    findings = _judged(judged, rec, names, (wrong, sure), volume, off, explained, findings)
    return Comparison(
        source=log.source,
        vehicle=outcome.vehicle,
        record=rec,
        fitted=outcome.fitted,
        predicted=predicted,
        volume=volume,
        rms=rms(off),
        bias=float(off.mean()),
        variance_explained=explained,
        largest=float(np.abs(off).max()),
        volume_rms=None if logged is None else rms((volume - logged)[used]),
        solution=solution,
        notes=(*rec.notes, *_fitted_before(vehicle)),
        findings=tuple(findings),
    )


def _judged(
    vehicle: Vehicle,
    rec: Record,
    names: Sequence[str],
    read: tuple[Finding | None, bool],
    volume: Array,
    off: Array,
    explained: float,
    found: list[Finding],
) -> list[Finding]:
    """Return what is to be said of a fit of `names`, whose depths are `off` [m].

    read: as `misread` returns it; volume: that drove the model [m3]; found: of the estimates, which
    do not count where the log or its drive explain nothing.
    """
    (wrong, sure), noise, error = read, _noise(rec), rms(off)
    beyond = error > MODEL_ERROR * min(noise, _NOISIEST)
    unlikely = rec.drive != "setpoint" and beyond and not explained > _WHOLE
    least = _LOST if noise < _NOISIEST else 0.0  # of depths that jump as none do
    lost = bool(names) and not explained >= least and beyond
    still = unlikely and is_still(rec.drive, rec.inputs, vehicle)
    no = any(f.severity == "no" for f in (found if wrong is None else [wrong]))
    said: list[Finding] = []
    if names and unlikely and not (still or lost or no):
        driven = thinned(replace(rec, drive="volume", volume=volume), _ENOUGH)
        said += doubtful(driven, vehicle, rec.drive)
        without = math.inf if said or sure else _without(vehicle, rec, names, error / _IDLE)
        if _IDLE * without < error:
            apart = {"rms": error, "without": without}
            said.append(Finding.of("compare", "no better", drive=rec.drive, **apart))
    if wrong is not None:
        if said or not explained >= _HALF:  # what follows from it need not be said
            return [wrong._replace(severity="no")]
        return [wrong, *found]
    if still:
        return [Finding.of("compare", "still", drive=rec.drive)]
    if said:
        return [*found, *said]
    if not explained >= _HALF:
        return [*found, Finding.of("compare", "unexplained", "no" if lost else None)]
    return found


_WHOLE = 0.999  # of how the depth varies, more of which a drive that never changes may explain
_HALF = 0.5  # of how the depth varies; less is no model of the log
_NOISIEST = 0.05  # m, of a depth's sensor
_LOST = -1.0  # likewise: a depth that stays would be nearer to the log than what was fitted to it


def _without(vehicle: Vehicle, rec: Record, names: Sequence[str], good: float) -> float:
    """Return how far depths are off [m], rms, where a volume that stays drives.

    As it fits best, or until it is as `good`.
    """
    stays = replace(rec, drive="volume", volume=np.full_like(rec.time, _guess(vehicle, rec)))
    stays = thinned(stays, _MOST // 10)  # nothing in it is quick
    fitted, start, *_ = adjust(vehicle, stays, names, good=good)
    off = run(fitted, stays, start)[0] - stays.depth
    return rms(off[stays.compared])


_IDLE = 0.95  # of that error: a drive that takes less off it says nothing


def _fitted_before(vehicle: Vehicle) -> list[str]:
    """Return what the vehicle's provenance says was fitted, and to what."""
    found: dict[str, list[str]] = {}
    for field, origin in vehicle.provenance.items():
        if origin.startswith("fitted"):
            found.setdefault(re.split(r"[,;:.]", origin)[0], []).append(field)
    return [f"{origin}, says the vehicle: {', '.join(f)}" for origin, f in found.items()]
