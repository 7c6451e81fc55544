"""The residuals of several experiments and their derivatives, as functions of what is fitted.

The vector x holds the vehicle's parameters (logarithms, or multiples of a scale), then each
experiment's neutral-volume error, then depth and speed at the start of each stretch, then how fast
each neutral volume drifts, and last by how much the stamps of all volumes are late. An experiment
depends on the vehicle's, its own and the last only, so its derivatives are runs of its own, most of
them side by side in one compiled call.

`Coordinates` are those in which the search for K2 and T2 is nearly linear. The motion has K2/T2 and
1/T2 as the factors of buoyancy and drag. Where the data say little of the drag, as beside a
quadratic one, a step in the logarithm of T2 leads to no drag at all, and the way back is flat; in
the rate 1/T2 the same step is right at once.

`NAMES` are the quantities that can be identified, and a `Model` makes a plant of their values. A
record becomes an experiment by its informative stretches, and by what drives them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from swimbladder.errors import InputError, check_number
from swimbladder.estimation.comparison.record import Record, bad_depth, follow_in
from swimbladder.estimation.estimates import Prior
from swimbladder.estimation.estimates import check_names as check_known
from swimbladder.estimation.series import shifted
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.sim.closed_loop.replay import Course
from swimbladder.vehicle import IdentifiedActuator, Vehicle
from swimbladder.vehicle.schema import check_choice

LAWS = ("linear", "quadratic", "blended")


class Name(NamedTuple):
    """A quantity of the vehicle that can be identified."""

    unit: str
    logarithmic: bool  # fitted as its logarithm: positive, and known to a share of itself
    meaning: str
    limits: tuple[float, float] = (0.0, math.inf)  # where a fit of its logarithm has to stay


NAMES: Mapping[str, Name] = {
    "K2": Name("1/m2/s", True, "speed per volume, rho g/k_dl, eq. (28)", (1e0, 1e9)),
    "T2": Name("s", True, "time constant of the speed, m/k_dl, eq. (29)", (1e-2, 1e6)),
    "mass": Name("kg", True, "all that is accelerated m", (1e-3, 1e7)),
    "drag_quadratic": Name("N s2/m2", False, "turbulent drag coefficient k_dt", (1e-4, 1e8)),
    "psi": Name("m3/m", False, "volume the hull loses per metre beyond the water's, eq. (31)"),
    "K1": Name("m/s/V", True, "piston speed per volt, eq. (23)", (1e-7, 1e1)),
    "T1": Name("s", True, "time constant of the motor, eq. (24)", (1e-4, 1e2)),
}

UNITS = {name: about.unit for name, about in NAMES.items()}
_OF_LAW = {
    "linear": ("K2", "T2"),
    "quadratic": ("mass", "drag_quadratic"),
    "blended": ("K2", "T2", "drag_quadratic"),
}
_TYPICAL_SPEED = 0.1  # m/s, at which a law that is not known yet is taken to have the other's drag


class Model(NamedTuple):
    """A vehicle under one drag law: its plant, and the values of everything that has a name."""

    base: Plant
    law: str
    specific_weight: float  # N/m3, rho g
    waterplane: float  # m2
    piston_area: float  # m2; nan where there is none
    displaced: float  # m3
    values: dict[str, float]

    @property
    def psi_scale(self) -> float:
        """A psi that is large for this hull [m3/m]: 1e-4 of its volume a metre."""
        return 1e-4 * self.displaced

    def scale(self, name: str) -> float:
        """Return what counts as a whole of a quantity that is not fitted as its logarithm."""
        if name == "psi":
            return self.psi_scale
        return max(self.values["drag_quadratic"], 1e-6)

    def logarithmic(self, name: str) -> bool:
        """Whether a quantity is fitted as its logarithm; a drag that may be none is not."""
        return NAMES[name].logarithmic or (name == "drag_quadratic" and self.law == "quadratic")

    def mass(self, values: Mapping[str, float]) -> float:
        """Return the mass that is accelerated [kg]."""
        if self.law == "quadratic":
            return values["mass"]
        return self.specific_weight * values["T2"] / values["K2"]

    def drag(self, values: Mapping[str, float]) -> tuple[float, float]:
        """Return the coefficients of the drag, laminar [N s/m] and turbulent [N s2/m2]."""
        laminar = 0.0 if self.law == "quadratic" else self.specific_weight / values["K2"]
        return laminar, 0.0 if self.law == "linear" else values["drag_quadratic"]

    def plant(self, values: Mapping[str, float], neutral: float) -> Plant:
        """Return the plant of these values; `neutral` is the neutral volume at depth 0 [m3]."""
        m = self.mass(values)
        k_b, linear = self.specific_weight, self.law == "linear"
        laminar = 0.0 if self.law == "quadratic" else 1.0 / values["T2"]
        changes = {"a_b": k_b / m, "a_s": k_b * self.waterplane / m, "psi": values["psi"]}
        changes |= {"V_0": neutral, "epsilon": math.inf if linear else 0.0, "d_l": laminar}
        changes |= {"d_b": laminar if self.law == "blended" else 0.0, "d_0": 0.0}
        changes["d_t"] = 0.0 if linear else values["drag_quadratic"] / m
        if "K1" in values:
            changes |= {"gain": values["K1"] * self.piston_area, "T1": values["T1"]}
        return self.base._replace(**changes)


def model_of(vehicle: Vehicle, *, law: str | None = None, bottom_depth: float) -> Model:
    """Return the model of a vehicle under a drag law, its own where none is given.

    Raises InputError for a law that cannot be identified.
    """
    drag = vehicle.drag
    wanted = law or drag.law
    field = "drag" if law else "motion.drag.law"
    check_choice(wanted, LAWS, "this drag law cannot be identified", field=field)
    k_b, m = vehicle.water.specific_weight, vehicle.mass
    k_dl = drag.k_dl or drag.k_dt * _TYPICAL_SPEED
    k_dt = drag.k_dt or (k_dl / _TYPICAL_SPEED if wanted == "quadratic" else 0.0)
    if wanted == "blended" and drag.k_dt == 0.0:
        k_dl, k_dt = 0.5 * k_dl, 0.5 * k_dl / _TYPICAL_SPEED
    values = {"K2": k_b / k_dl, "T2": m / k_dl, "mass": m}
    values |= {"drag_quadratic": k_dt, "psi": vehicle.hull.psi}
    area = math.nan
    if isinstance(actuator := vehicle.engine, IdentifiedActuator):
        area = actuator.piston_area
        values |= {"K1": actuator.K1, "T1": actuator.T1}
    return Model(
        base=plant(vehicle, bottom_depth=bottom_depth),
        law=wanted,
        specific_weight=k_b,
        waterplane=vehicle.hull.waterplane_area,
        piston_area=area,
        displaced=vehicle.hull.displaced_volume,
        values=values,
    )


def default_names(law: str, given: Sequence[str]) -> tuple[str, ...]:
    """Return what is identified unless asked otherwise: the drag law's own and psi.

    given: names whose values are set, which are not identified.
    """
    return tuple(name for name in (*_OF_LAW[law], "psi") if name not in given)


def check_names(names: Sequence[str], model: Model, *, voltage: bool, option: str) -> None:
    """Raise InputError for a name that this vehicle and record do not have."""
    check_known(names, NAMES, option, "there is no such parameter")
    for name in names:
        what = remedy = ""
        if name in ("K1", "T1") and "K1" not in model.values:
            what, remedy = "the vehicle's actuator has none", "Choose a vehicle of kind identified"
        elif name in ("K1", "T1") and not voltage:
            what = "a logged volume does not identify the actuator"
            remedy = "Use `swimbladder identify-actuator`, or `drive='voltage'`"
        elif name not in (*_OF_LAW[model.law], "psi", "K1", "T1"):
            what = f"the drag law {model.law} has no such parameter"
            remedy = f"It has {', '.join(_OF_LAW[model.law])}; or choose another `drag=`"
        if what:
            raise InputError(what, field=option, value=name, remedy=remedy)


_FEWEST = 12  # samples of a stretch
_SHORTEST = 3.0  # s of a stretch
_GAP = 5.0  # median sample times without a sample, after which the volume is no longer known
_PARABOLA = 3.0  # s, for the state at the start of a stretch
_FINE = 0.02  # m, that no depth near a line is left aside for
_FIRST = 9  # samples, whose median is the depth of rest at the start


class Segment(NamedTuple):
    """A stretch of a record under way: every sample of it is compared."""

    first: int
    last: int  # included
    depth: float  # m, at the first sample, from a parabola through the first ones
    speed: float  # m/s, likewise


@dataclass(frozen=True)
class Experiment:
    """A log as the fit takes it. The neutral volume at `reference` is `neutral` + its error."""

    source: str
    record: Record
    inputs: Array  # volume [m3] or voltage [V]
    ramps: bool  # the inputs are volumes, linear between samples
    segments: tuple[Segment, ...]
    reference: float  # m, where the error of the neutral volume counts from
    neutral: float  # m3, assumed at the reference, in the zero of `inputs`
    added: float = 0.0  # m3, what the water's layers add at the reference: in `neutral` already

    @property
    def used(self) -> Flags:
        """Which samples the fit uses."""
        mask = np.zeros(len(self.record.time), np.bool_)
        for s in self.segments:
            mask[s.first : s.last + 1] = True
        return mask

    def error(self, neutral: float, psi: float) -> float:
        """Return by how much a neutral volume at depth 0 [m3], counted as the record does, is off.

        psi [m3/m]: with which it grows down to the reference.
        """
        assert self.record.volume is not None  # it drives the model
        zero = float(self.record.volume[0] - self.inputs[0]) + self.neutral
        return neutral - zero + psi * self.reference + self.added

    def step(self) -> float:
        """Return the volume against neutral that the experiment is run with [m3]: its median."""
        if not self.ramps:
            return float(np.ptp(self.inputs))
        return float(np.median(np.abs(self.inputs[self.used] - self.neutral)))


def experiment(record: Record, vehicle: Vehicle) -> Experiment:
    """Return a record as an experiment.

    A volume with a zero of its own counts from the first sample, where the vehicle is taken as
    neutral; an absolute one from mid-stroke, neutral at depth 0 with the vehicle's trim.
    Raises LogError where no stretch of it is under way, clear of surface and bottom, long enough.
    """
    ramps, inputs = record.drive == "volume", record.inputs
    absolute = ramps and record.volume_absolute
    if ramps and not absolute:
        inputs = inputs - inputs[0]
    reference = 0.0 if absolute else _first_depth(record)
    neutral = vehicle.trim_error if absolute else 0.0
    segments = _stretches(record) if ramps else _whole(record)
    if not segments:
        what = f"no stretch of {_SHORTEST:g} s or more is clear of surface and bottom"
        remedy = "Check the unit of the depth, `bottom_depth=` and `surface_margin=`"
        raise bad_depth(record.source, what, float(record.depth.max()), remedy)
    added = 0.0 if absolute else record.layers.at(reference)
    return Experiment(record.source, record, inputs, ramps, segments, reference, neutral, added)


def _first_depth(record: Record) -> float:
    """Return the depth at the first sample [m], whatever outlier that may be."""
    near = record.time - record.time[0] <= _PARABOLA
    return float(np.median(record.depth[near][:_FIRST]))


def _clear(record: Record) -> Flags:
    """Return which samples are clear of surface and bottom; a spike to there is not a visit."""
    return np.asarray(median_filter(record.compared, size=5, mode="nearest"))


def _whole(record: Record) -> tuple[Segment, ...]:
    """Return the record from its first sample on: without its volume it cannot be cut."""
    clear = _clear(record)
    if not clear[0]:
        return ()
    last = int(np.argmin(np.append(clear, False))) - 1
    return (_segment(record, 0, last),) if last + 1 >= _FEWEST else ()


def _stretches(record: Record) -> tuple[Segment, ...]:
    time, clear = record.time, _clear(record)
    step = float(np.median(np.diff(time)))
    broken = ~clear[1:] | ~clear[:-1] | (np.diff(time) > _GAP * step)
    edges = [0, *(np.flatnonzero(broken) + 1).tolist(), len(time)]
    found = []
    for first, after in pairwise(edges):
        last = after - 1
        enough = last - first + 1 >= _FEWEST and time[last] - time[first] >= _SHORTEST
        if enough and clear[first]:
            found.append(_segment(record, first, last))
    return tuple(found)


def _segment(record: Record, first: int, last: int) -> Segment:
    """Return a stretch with depth and speed at its start, outliers left aside.

    An outlier among the first samples would begin the search at a speed that no later sample can
    mend: the model leaves the water, where its derivatives say nothing.
    """
    time, depth = record.time[first : last + 1], record.depth[first : last + 1]
    near = time - time[0] <= _PARABOLA
    near[: min(6, len(near))] = True
    t, z = time[near] - time[0], depth[near]
    i, j = np.triu_indices(len(t), 1)
    speed = float(np.median((z[j] - z[i]) / (t[j] - t[i])))  # Theil and Sen's line
    start = float(np.median(z - speed * t))
    off = np.abs(z - start - speed * t)
    kept = off <= max(5.0 * float(np.median(off)), _FINE)
    if kept.sum() > 8:
        start, speed, _ = np.polynomial.polynomial.polyfit(t[kept], z[kept], 2).tolist()
    return Segment(first, last, start, speed)


VOLUME, DEPTH, SPEED = 1e-6, 1e-2, 1e-2  # m3, m, m/s: units of the experiments' own entries of x
DRIFT, DELAY = 1e-9, 1e-2  # m3/s, s: likewise
_STEP = 1e-5  # of an entry of x, for derivatives; the runs are exact to 1e-13
_STEP_OF_DRIFT = 1e-3  # the same, of a drift
_WARMS = 0.2  # K that a hull warms or cools by at least, to say what it gains by that
_EXPANDS = 3e-4  # 1/K, 1 sigma of a hull's expansion: metals have 1e-4, plastics 2e-4 to 6e-4
LEAST_STD = 1e-6  # of these units, the deviation of what is known not to be
LOST = 10.0  # m, the residual where the model cannot follow


class Assumed(NamedTuple):
    """What is known before the logs: values in SI that are fixed, and priors, both by name.

    neutral_std: 1 sigma [m3] of what is known of a log's neutral volume at its start; speed_std: of
    its speed there about 0 [m/s]; infinite: nothing is known. drift_std: of how fast a log's
    neutral volume grows [m3/s]; delay_std: of how late the stamps of all volumes are [s];
    0: there is none.
    """

    fixed: Mapping[str, float] = MappingProxyType({})
    priors: Mapping[str, Prior] = MappingProxyType({})
    neutral_std: float = math.inf
    speed_std: float = math.inf
    drift_std: float = 0.0
    delay_std: float = 0.0


class Problem:
    """Everything a fit needs: residuals, derivatives, priors and bounds."""

    def __init__(
        self,
        experiments: Sequence[Experiment],
        model: Model,
        names: Sequence[str],
        assumed: Assumed,
    ) -> None:
        self.experiments, self.model, self.names = tuple(experiments), model, tuple(names)
        self.assumed, self.values = assumed, {**model.values, **assumed.fixed}
        self.priors, self.neutral_std, self.speed_std, self.drift_std, self.delay_std = assumed[1:]
        warmths = [w for e in self.experiments if (w := e.record.warmth) is not None]
        span = max((float(np.ptp(w)) for w in warmths), default=0.0)
        self.heat_std = _EXPANDS * model.displaced if span >= _WARMS else 0.0  # m3/K
        self.shared = len(self.names)
        self.first_start = self.shared + len(self.experiments)
        counts = [len(e.segments) for e in self.experiments]
        self.starts_at = (self.first_start + 2 * np.cumsum([0, *counts])).tolist()
        self.first_drift = int(self.starts_at[-1])
        self.delay_at = self.first_drift + len(self.experiments)
        self.size = self.delay_at + 1
        self.logarithmic = [model.logarithmic(name) for name in self.names]
        self.scale = [1.0 if model.logarithmic(n) else model.scale(n) for n in self.names]
        self.rows = np.cumsum([0, *(int(e.used.sum()) for e in self.experiments)]).tolist()
        self.alike: tuple[bytes | None, list[tuple[Plant, float]]] = None, []  # see `_plants`
        self.courses = [[_course(e, s) for s in e.segments] for e in self.experiments]
        self.measured = np.concatenate([e.record.depth[e.used] for e in self.experiments])

    def begin(self, values: Mapping[str, float] | None = None) -> Array:
        """Return x at the values given, where none are at the model's, with measured starts."""
        x = np.zeros(self.size)
        now = {**self.values, **(values or {})}
        for i, name in enumerate(self.names):
            x[i] = math.log(now[name]) if self.logarithmic[i] else now[name] / self.scale[i]
        starts = [(s.depth / DEPTH, s.speed / SPEED) for e in self.experiments for s in e.segments]
        x[self.first_start : self.first_drift] = np.ravel(starts)
        x[self.delay_at] = now.get("volume_delay", 0.0) / DELAY
        return x

    def value(self, x: Array, i: int) -> float:
        """Return the i-th parameter of the vehicle, in SI units."""
        return math.exp(x[i]) if self.logarithmic[i] else float(x[i] * self.scale[i])

    def values_of(self, i: int, entries: Array) -> Array:
        """Return the i-th parameter of the vehicle for several entries of x, in SI units."""
        return np.exp(entries) if self.logarithmic[i] else entries * self.scale[i]

    def per_entry(self, x: Array) -> Array:
        """Return by how much each parameter of the vehicle changes per change of its entry."""
        values = [self.value(x, i) for i in range(self.shared)]
        return np.where(self.logarithmic, values, self.scale)

    def named(self, x: Array) -> dict[str, float]:
        """Return the value of everything that has a name, in SI units."""
        return self.values | {name: self.value(x, i) for i, name in enumerate(self.names)}

    def bounds(self) -> tuple[Array, Array]:
        """Return the least and the largest x: where physics ends, or far from any vehicle."""
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        for i, name in enumerate(self.names):
            if self.logarithmic[i]:
                low[i], high[i] = map(math.log, NAMES[name].limits)
            elif name == "drag_quadratic":
                low[i] = 0.0
        return low, high

    def predict(self, x: Array) -> Array:
        """Return the model's depths at the samples used, experiment after experiment [m]."""
        runs = [self._run(x, j) for j in range(len(self.experiments))]
        return np.concatenate([z for run in runs for z, _ in run])

    def residual(self, x: Array) -> Array:
        """Return measured less predicted depth at the samples used [m]."""
        off = self.measured - self.predict(x)
        return np.clip(np.nan_to_num(off, nan=LOST), -LOST, LOST)

    def slope(self, x: Array) -> Array:
        """Return the derivatives of the predicted depths [rows, len(x)]."""
        J, row = np.zeros((len(self.measured), self.size)), 0
        for j in range(len(self.experiments)):
            shared = [*range(self.shared), self.shared + j]
            for at, (z, block) in enumerate(self._run(x, j, shared)):
                start = self.starts_at[j] + 2 * at
                own = [start, start + 1, self.first_drift + j, self.delay_at]
                J[row : row + len(z), [*shared, *own]] = block
                row += len(z)
        return J

    def prior_rows(self, x: Array) -> tuple[Array, Array]:
        """Return the priors as residuals [k], in standard deviations, with derivatives [k, n]."""
        rows = []  # residual, entry of x, by how much it counts
        per_entry = self.per_entry(x)
        for name, prior in self.priors.items():
            i = self.names.index(name)
            rows.append(((prior.mean - self.value(x, i)) / prior.std, i, per_entry[i] / prior.std))
        speeds = [at + 1 for at in self.starts_at[:-1]]  # a stretch later on is under way
        drifts, delay = range(self.first_drift, self.delay_at), [self.delay_at]
        for places, unit, std in (
            (range(self.shared, self.first_start), VOLUME, self.neutral_std),
            (speeds, SPEED, self.speed_std),
            (drifts, DRIFT, max(self.drift_std, LEAST_STD * DRIFT)),
            (delay, DELAY, max(self.delay_std, LEAST_STD * DELAY)),
        ):
            if math.isfinite(std):
                rows += [(-x[at] * (unit / std), at, unit / std) for at in places]
        P = np.zeros((len(rows), self.size))
        for row, (_, at, per) in enumerate(rows):
            P[row, at] = per
        return np.array([residual for residual, *_ in rows]), P

    def weighted(self, x: Array, root: Array) -> Array:
        """Return residuals times `root` [rows], and the priors' rows: what a search makes small."""
        return np.concatenate([root * self.residual(x), self.prior_rows(x)[0]])

    def weighted_slope(self, x: Array, root: Array) -> Array:
        """Return minus the derivatives of what `weighted` returns."""
        return np.concatenate([root[:, None] * self.slope(x), self.prior_rows(x)[1]])

    def _run(self, x: Array, j: int, moved: Sequence[int] = ()) -> Iterator[tuple[Array, Array]]:
        """Yield experiment j's depths, stretch by stretch, and their derivatives.

        By the entries `moved` of x, then by the stretch's own start, by the drift of the neutral
        volume and by how late volumes are; by nothing without the first.
        """
        e = self.experiments[j]
        plants = self._plants(x, e, self.shared + j, moved)
        drift = float(x[self.first_drift + j]) * DRIFT if e.ramps else 0.0
        for k, course in enumerate(self.courses[j]):
            yield self._stretch(x, e, course, self.starts_at[j] + 2 * k, plants, drift)

    def _stretch(
        self,
        x: Array,
        e: Experiment,
        course: Course,
        at: int,
        plants: Sequence[Plant],
        drift: float,
    ) -> tuple[Array, Array]:
        """Return the depths of the first of the plants, and their derivatives, see `_run`."""
        p = plants[0]
        depth = min(max(float(x[at]) * DEPTH, p.z_air), p.z_bottom)
        lanes = [*plants, p, p, p] if len(plants) > 1 else plants
        starts = np.array([[e.neutral, depth, x[at + 1] * SPEED, drift]] * len(lanes))
        if len(plants) > 1:
            starts[-3, 1] += _STEP * DEPTH
            starts[-2, 2] += _STEP * SPEED
            starts[-1, 3] += _STEP_OF_DRIFT * DRIFT * e.ramps
        layers = e.record.layers
        if len(layers.table):
            z = follow_in(layers, lanes, course.time, course.inputs, starts[:, 1:])
        else:
            z = course.follow(lanes, starts)
        late, moving = float(x[self.delay_at]) * DELAY, np.zeros(z.shape[1])
        if e.ramps and (late != 0.0 or len(lanes) > 1) and np.isfinite(z).all():
            z, moving = shifted(course.time, z, late)  # by the clock of the volumes
        slope = np.append((z[1:] - z[0]) / _STEP, moving[None] * DELAY, axis=0)
        slope[-2:-1] *= _STEP / _STEP_OF_DRIFT
        return z[0], np.where(np.isnan(slope), 0.0, np.clip(slope, -1e6, 1e6)).T

    def _plants(self, x: Array, e: Experiment, own: int, moved: Sequence[int]) -> list[Plant]:
        """Return the plant at x, and with each of the entries `moved` a little larger.

        But for the neutral volume, entry `own`, the experiments have theirs in common.
        """
        key, known = x[: self.shared].tobytes(), self.alike
        if key != known[0]:
            steps = _STEP * np.eye(self.shared + 1)[:, 1:]  # none, then of each entry
            each = [self.named(x[: self.shared] + step) for step in steps]
            known = key, [(self.model.plant(values, 0.0), values["psi"]) for values in each]
            self.alike = known

        def placed(alike: tuple[Plant, float], entry: float) -> Plant:
            p, psi = alike
            return p._replace(V_0=e.neutral + entry * VOLUME - psi * e.reference - e.added)

        if not moved:
            return [placed(known[1][0], x[own])]
        plants = [placed(alike, x[own]) for alike in known[1]]
        return [*plants, placed(known[1][0], x[own] + _STEP)]


def _course(e: Experiment, s: Segment) -> Course:
    part, time = slice(s.first, s.last + 1), e.record.time
    return Course(time[part], e.inputs[part], ramps=e.ramps, since=time[0])


def posed(
    records: Sequence[Record],
    vehicle: Vehicle,
    assumed: Assumed,
    *,
    free: Sequence[str] | None = None,
    drag: str | None = None,
) -> Problem:
    """Return the problem of records of a vehicle.

    free: names of NAMES that are fitted, those of the drag law and psi where not given; drag:
    linear, quadratic or blended, the vehicle's own where not given. Raises InputError where names,
    records and vehicle do not go together.
    """
    model = model_of(vehicle, law=drag, bottom_depth=max(r.bottom_depth for r in records))
    names = tuple(free) if free is not None else default_names(model.law, list(assumed.fixed))
    voltage = any(r.drive == "voltage" for r in records)
    check_parameters(names, assumed, model, voltage=voltage)
    return Problem([experiment(r, vehicle) for r in records], model, names, assumed)


def check_parameters(names: Sequence[str], known: Assumed, model: Model, *, voltage: bool) -> None:
    """Raise InputError where names, values and priors do not go together."""
    options = {"free": names, "fixed": list(known.fixed), "priors": list(known.priors)}
    for option, given in options.items():
        check_names(given, model, voltage=voltage, option=option)
    if not names:
        raise InputError("nothing is left to identify", field="free", remedy="Free a parameter")
    for name in names:
        if name in known.fixed:
            what = "it is both set and to be identified"
            remedy = "Leave it out of `free=` or of `fixed=`"
            raise InputError(what, field="fixed", value=name, remedy=remedy)
    for name, value in known.fixed.items():
        if NAMES[name].logarithmic:
            check_number(value, "fixed", NAMES[name].unit, above=0.0, most=math.inf)
    for name, prior in known.priors.items():
        if name not in names:
            what = "it has a prior, but is not identified"
            remedy = f"Name it in `free=`, which has {', '.join(names)}"
            raise InputError(what, field="priors", value=name, remedy=remedy)
        if not prior.std > 0.0 or (NAMES[name].logarithmic and not prior.mean > 0.0):
            what = "no such prior: the deviation has to be above 0, and the mean of a positive "
            what += "quantity too"
            remedy, unit = "What is known exactly is fixed: `fixed`", NAMES[name].unit
            given = f"{name}={prior.mean:g} +- {prior.std:g}"
            raise InputError(what, field="priors", value=given, unit=unit, remedy=remedy)


_SIZE = 30.0  # s, of the T2 whose rate is 1


class Coordinates:
    """The entries of x, but log(K2/T2) and 1/T2 for log K2 and log T2 where both are fitted."""

    def __init__(self, problem: Problem) -> None:
        names, self._problem = problem.names, problem
        both = "K2" in names and "T2" in names
        self._at = [(names.index("K2"), names.index("T2"))] if both else []

    def of(self, x: Array) -> Array:
        """Return the coordinates of x."""
        y = x.copy()
        for K, T in self._at:
            y[K], y[T] = x[K] - x[T], _SIZE * math.exp(-x[T])
        return y

    def back(self, y: Array) -> Array:
        """Return the x of coordinates."""
        x = y.copy()
        for K, T in self._at:
            x[T] = math.log(_SIZE / y[T])
            x[K] = y[K] + x[T]
        return x

    def slope(self, y: Array, J: Array) -> Array:
        """Return derivatives by the coordinates y, from those by x [rows, len(x)]."""
        moved = J.copy()
        for K, T in self._at:
            moved[:, T] = -(J[:, T] + J[:, K]) / y[T]
        return moved

    def bounds(self) -> tuple[Array, Array]:
        """Return the least and largest coordinates that a permitted x can have."""
        low, high = self._problem.bounds()
        for K, T in self._at:
            low[K], high[K] = low[K] - high[T], high[K] - low[T]
            low[T], high[T] = _SIZE * math.exp(-high[T]), _SIZE * math.exp(-low[T])
        return low, high
