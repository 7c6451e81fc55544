"""What holds over the region of parameters: eigenvalues and margins of small motions, and laws with
wrong gains and late commands.

The region is looked at in its middle, at the ends of its axes (or corners) and at drawn points;
from the worst of these, for each measure, Nelder and Mead's simplex goes on over the whole region.
What is claimed is the worst that was found: the measures are continuous over the region, and where
the search from several points ends at one value that is a strong sign, but no proof.

A motor whose load depends on its direction is two linear systems; both are looked at. That each is
stable does not prove that switching between them is.

Of laws of volume changes, which are called when they ask to be, it is the largest eigenvalue of the
map from one decision to the next (`linear.pump_valve`); at rest the hull decides
(`tuning.margins`).

A law that is not linear is tried with wrong gains and late commands, over draws from the region. It
is wrapped for that. A wrapped law calls the law it wraps and multiplies its command by `gain`,
before the supply's limit, and rounds it to `quantum`. Where `late` is 1 it runs at half of the
law's sample time: the law is called at every other tick, and its command is given a half tick
later, the one before being held until then. Each law becomes one wrapped law, whose class of
parameters stands in this module: so its compiled kernel is found again.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

from swimbladder.control.law import Law, Measurement, State, around, law_initial, law_step
from swimbladder.design.linear.margins import Margins, spectral_radius
from swimbladder.design.linear.pump_valve import Decision, DriveRates, drag_slope, drive_rates
from swimbladder.design.linear.sampled import BoundLaw, Mode, SampledLoop, loop_of, modes
from swimbladder.design.tuning import margins
from swimbladder.design.tuning.margins import at_rest
from swimbladder.design.tuning.region import Member, Region, member, unknowns, with_middle
from swimbladder.design.tuning.trial import Drawn, Step, measure, traces
from swimbladder.io.answers import as_json, plain
from swimbladder.io.progress import Advance
from swimbladder.jobs import Store
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant, drag_per_mass, plant
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.units import say
from swimbladder.vehicle import Vehicle

_say = partial(say, "design", "stability")

_STARTS = 3  # of the search
_CALLS = 60  # of a search, for each unknown
_GONE = 1e-6  # modulus of an eigenvalue: what it is of is over within a sample


class Point(NamedTuple):
    """A point of the region, its depth, side or decision, and how bad it is there."""

    worth: float  # the larger the worse
    at: Array  # in the unit ball or cube that the region is
    piece: Any


def _searched(
    vehicle: Vehicle, grid: Sequence[Point], measure: Callable[[Member, Any], float]
) -> tuple[Point, int]:
    """Return the worst point, by a search from the worst of the grid on, and how often it asked."""
    names, ball = unknowns(vehicle)
    ranked, calls = sorted(grid, key=lambda g: -g.worth), 0

    def worse(x: Array, piece: Any) -> float:
        value = measure(member(vehicle, _within(x, ball)), piece)
        return -value if math.isfinite(value) else -1e9

    best = ranked[0]
    for start in ranked[:_STARTS]:
        found = minimize(
            worse,
            0.98 * start.at,
            args=(start.piece,),
            method="Nelder-Mead",
            options={"maxfev": _CALLS * len(names), "xatol": 1e-4, "fatol": 1e-9},
        )
        calls += int(found.nfev)
        if -float(found.fun) > best.worth:
            best = Point(-float(found.fun), _within(found.x, ball), start.piece)
    return best, calls


def _off(shares: Mapping[str, float]) -> str:
    """Return by how much a vehicle's numbers differ from the nominal ones."""
    off = [f"{n} {100.0 * (x - 1.0):+.1f} %" for n, x in shares.items() if x == x]
    return ", ".join(off) or "nominal"


class WayFound(NamedTuple):
    """Small errors on one way, and what drives the decisions there."""

    decision: Decision
    nominal: float  # -, largest modulus of an eigenvalue, nominal vehicle, worst depth
    ratio: float  # -, eta c/c_true: of the change that would set the speed at once
    time_constant: float  # s, in which the speed follows the volume
    delivery: float  # s, that the change from rest takes where the drive is slowest


class WorstWay(NamedTuple):
    """A vehicle of the region on a way, at a depth."""

    shares: Mapping[str, float]  # -, over nominal values
    depth: float  # m
    way: str
    down: bool
    faster: bool

    @property
    def words(self) -> str:
        """What distinguishes it, for a person."""
        direction = "sinking" if self.down else "rising"
        size = "too fast" if self.faster else "too slow"
        return f"{_off(self.shares)}, {direction} {size} ({self.way}) at {self.depth:g} m"


@dataclass(frozen=True, kw_only=True)
class Decided:
    """What the maps from decision to decision say over the region."""

    radius: float  # -, largest modulus of an eigenvalue found
    worst: WorstWay
    on_grid: float  # -, before the search
    ways: tuple[WayFound, ...]
    rest: margins.Rest
    maps: int  # on the grid
    searched: int  # maps beyond

    @property
    def stable(self) -> bool:
        """Whether small errors decay on every way, and what grows at rest is caught."""
        return self.radius < 1.0 and self.rest.held

    def sentences(self, depths: tuple[float, float]) -> tuple[str, ...]:
        """Return what a person wants to know, of `depths` from and to [m]."""
        sample = f"looked at: {self.maps} maps of the region, then {self.searched} in a search"
        if self.radius >= 1.0:
            return (
                _say("decisions unstable", found=self),
                _say("slower decisions"),
                *self._rest_words(),
            )
        last = max(self.ways, key=lambda way: way.time_constant)
        ratios = [way.ratio for way in self.ways]
        return (
            _say("decisions decay", depths=depths, found=self, sample=sample),
            _say("change of volume", ratios=max(ratios), speed=abs(last.decision.speed), last=last),
            *self._slow_drive(),
            *self._rest_words(),
        )

    def _slow_drive(self) -> tuple[str, ...]:
        late = [way for way in self.ways if way.delivery > way.decision.samples[-2]]
        if not late:
            return ()
        worst = max(late, key=lambda way: way.delivery)
        what = "pump" if worst.decision.pumps else "valve"
        return (
            _say(
                "slow drive",
                what=what,
                worst=worst,
                speed=abs(worst.decision.speed),
                samples=worst.decision.samples[-2],
            ),
        )

    def _rest_words(self) -> tuple[str, ...]:
        r = self.rest
        if not math.isinf(r.growth_time):
            caught = (
                f"It is caught within {r.band:.3g} m, and the law keeps {r.tolerance:g} m."
                if r.held
                else _say("rest unstable", r=r)
            )
            return (_say("gives way more", r=r) + caught,)
        if math.isinf(r.period):
            return ("At rest hull and water give way alike: nothing brings an error back.",)
        return (_say("swings", r=r),)

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        of_way = "largest_eigenvalue=nominal coefficient_ratio=ratio time_constant_s delivery_s"
        ways = [
            {
                "way": w.decision.way.name,
                **as_json(w.decision, "speed_m_s too_fast=faster interval_s=period"),
                **as_json(w, of_way),
            }
            for w in self.ways
        ]
        kept = "psi_m3_m growth_time_s period_s tolerance_halves_s=halves band_m tolerance_m held"
        found = "largest_eigenvalue=radius worst_at=worst on_grid maps maps_searched=searched"
        return {**as_json(self, found), "ways": ways, "rest": as_json(self.rest, kept)}


def around_decisions(vehicle: Vehicle, bound: BoundLaw, *, depths: Sequence[float]) -> Decided:
    """Return the worst over region, ways and depths [m] of a law of volume changes."""
    decisions = margins.decisions_of(bound)
    rates = drive_rates(vehicle, depths)
    pieces = [(d, k) for d in decisions for k in range(len(depths))]

    def radius(one: Member, piece: tuple[Decision, int]) -> float:
        return margins.radius_of(vehicle, [one], piece[0], rates, piece[1])

    grid: list[Point] = []
    for s in with_middle(vehicle):
        one = member(vehicle, s)
        grid += [Point(radius(one, piece), s, piece) for piece in pieces]
    found, calls = _searched(vehicle, grid, radius)
    worst, (d, k) = member(vehicle, found.at), found.piece
    medium = medium_of(vehicle, None, reach=depths[-1])
    return Decided(
        radius=found.worth,
        worst=WorstWay(worst.shares, depths[k], d.way.name, d.speed > 0.0, d.faster),
        on_grid=max(g.worth for g in grid),
        ways=tuple(_way(vehicle, one, grid[: len(pieces)], rates) for one in decisions),
        rest=margins.rest_of(vehicle, bound, rates, medium),
        maps=len(grid),
        searched=calls,
    )


def _way(vehicle: Vehicle, d: Decision, nominal: Sequence[Point], rates: DriveRates) -> WayFound:
    own = [g for g in nominal if g.piece[0] is d]
    one = member(vehicle, np.zeros(len(unknowns(vehicle)[0])))
    p, w = margins.going(vehicle, one.plant, d.speed), abs(d.speed)
    slope = drag_slope(p, w)
    c_true = drag_per_mass(w, p) / (p.a_b * w * w)
    c = sum(abs(s) * (d.samples[-1] - t) for s, t in zip(d.slopes, d.samples, strict=True))
    return WayFound(
        decision=d,
        nominal=max(g.worth for g in own),
        ratio=c / (2.0 * w) / c_true,
        time_constant=1.0 / slope if slope > 0.0 else math.inf,
        delivery=max(margins.deliveries(vehicle, one, d, rates, g.piece[1])[-1].delay for g in own),
    )


# What is looked for: the larger the worse.
MEASURES: Mapping[str, Callable[[Margins, float], float]] = {
    "spectral radius": lambda _, radius: radius,
    "peak sensitivity": lambda m, _: m.peak_sensitivity,
    "phase": lambda m, _: -m.phase,
    "gain up": lambda m, _: -m.gain_up,
    "gain down": lambda m, _: m.gain_down,
}


class OperatingPoint(NamedTuple):
    """A vehicle of the region, at a depth."""

    shares: Mapping[str, float]  # -, uncertain numbers over their nominal values
    depth: float  # m
    back_driven: bool  # the sea drives the motor

    @property
    def words(self) -> str:
        """What distinguishes it, for a person."""
        back = ", the motor driven back by the sea" if self.back_driven else ""
        return f"{_off(self.shares)} at {self.depth:g} m{back}"


class Found(NamedTuple):
    """The worst of one measure."""

    measure: str
    point: OperatingPoint
    on_grid: float  # worst among the points, as a grid of frequencies shows it
    searched: float  # after the search, likewise


class Around(NamedTuple):
    """What the linear analysis over the region found."""

    radius: float  # -, largest modulus of an eigenvalue
    margins: Margins  # worst of each, exactly, over all points that a search ended at
    slowest: tuple[Mode, OperatingPoint]
    least_damped: tuple[Mode, OperatingPoint]
    found: tuple[Found, ...]
    looked: int  # loops on the grid
    searched: int  # loops beyond
    same_at_all_depths: bool
    delay: float  # s, from a sample to its command
    whole_sample_radius: float  # -, of the nominal loop with a whole sample of delay

    @property
    def stable(self) -> bool:
        """Whether every loop that was looked at is."""
        return self.radius < 1.0

    @property
    def worst_point(self) -> OperatingPoint:
        """Where the largest eigenvalue is."""
        return next(f.point for f in self.found if f.measure == "spectral radius")

    def sentences(self, depths: tuple[float, float]) -> tuple[str, ...]:
        """Return what a person wants to know, of `depths` from and to [m]."""
        if not self.stable:
            return (_say("unstable", found=self), _say("shorter samples"))
        m, short = self.margins, margins.violated_margins(self.margins)
        mode, at = self.slowest
        damped, where = self.least_damped
        deep = "the same" if self.same_at_all_depths else "not the same"
        return (
            _say("decay", depths=depths, found=self, delay=1000.0 * self.delay),
            _say("evaluated", found=self, deep=deep),
            _say(
                "slowest mode", mode=mode, at=at, period=_period(damped), damped=damped, where=where
            ),
            f"Worst margins: {margins.margin_words(m)}"
            + (f"; below the requirement: {', '.join(short)}." if short else ", as required."),
            _say("whole sample", whole_sample_radius=modulus(self.whole_sample_radius))
            + ("unstable." if self.whole_sample_radius >= 1.0 else "still stable."),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            **as_json(
                self,
                "largest_eigenvalue=radius worst_at=worst_point loops=looked "
                "loops_searched=searched computation_delay_s=delay "
                "largest_eigenvalue_with_a_sample_of_delay=whole_sample_radius",
            ),
            "margins": as_json(self.margins, margins.MARGINS),
            "slowest": _mode(*self.slowest),
            "least_damped": _mode(*self.least_damped),
            "searches": [as_json(f, "measure on_grid searched at=point") for f in self.found],
        }


def _mode(mode: Mode, at: OperatingPoint) -> dict[str, Any]:
    return as_json(mode, "frequency_rad_s damping time_constant_s") | {"at": plain(at)}


def _period(mode: Mode) -> str:
    return f"{2.0 * math.pi / mode.frequency:.3g} s" if mode.frequency > 0.0 else "never"


def modulus(value: float) -> str:
    """Return the modulus of an eigenvalue [-] with the digits that distinguish it from 1."""
    off = abs(value - 1.0)
    digits = 3 if off >= 1e-3 or off == 0.0 else min(1 - math.floor(math.log10(off)), 12)
    return f"{value:.{digits}f}"


def robustness_around(
    vehicle: Vehicle, bound: BoundLaw, depths: Sequence[float], *, delay: float, advance: Advance
) -> Around | None:
    """Return the worst over region and depths [m]; None for a law not linear at rest, or asleep.

    bound: without its dead zone. delay [s]: from a sample to its command.
    """
    nominal, sample_time = plant(vehicle), bound.sample_time
    laws = {z: margins.at_rest(bound, nominal, depth=z) for z in depths}
    if not all(x.smooth and x.sample_time == sample_time for x in laws.values()):
        return None  # within its bands, or while it sleeps, a law that does nothing looks linear
    one_way = nominal.load_back == nominal.load_drive
    pieces = [(z, back) for z in depths for back in ((False,) if one_way else (False, True))]

    def loop(p: Plant, piece: tuple[float, bool]) -> SampledLoop:
        depth, back = piece
        return loop_of(p, laws[depth], depth=depth, delay=delay, back_driving=back)

    grid: list[tuple[Array, tuple[float, bool], dict[str, float]]] = []
    points = with_middle(vehicle)
    for s in points:
        p = member(vehicle, s).plant
        grid += [(s, piece, _measures(loop(p, piece))) for piece in pieces]
        advance(0.4 / len(points))
    radii = np.array([worth["spectral radius"] for *_, worth in grid]).reshape(-1, len(pieces))

    def value(measure: str, one: Member, piece: tuple[float, bool]) -> float:
        return _measures(loop(one.plant, piece), only=measure)[measure]

    calls, found, loops = 0, [], []
    for name in MEASURES:
        listed = [Point(worth[name], s, piece) for s, piece, worth in grid]
        worst, asked = _searched(vehicle, listed, partial(value, name))
        calls += asked
        one = member(vehicle, worst.at)
        point = OperatingPoint(one.shares, *worst.piece)
        found.append(Found(name, point, max(g.worth for g in listed), worst.worth))
        loops.append((loop(one.plant, worst.piece), point))
        advance(0.5 / len(MEASURES))
    here = [
        (mode, point)
        for one, point in loops
        for mode in modes(one.closed(), sample_time)
        if abs(mode.z) > _GONE and mode.s.imag >= 0.0
    ]
    advance(0.1)
    late = replace(loop(nominal, pieces[0]), command_delay=sample_time)
    return Around(
        radius=found[0].searched,
        margins=margins.worst(one for one, _ in loops),
        slowest=max(here, key=lambda m: m[0].time_constant),
        least_damped=min(here, key=lambda m: m[0].damping),
        found=tuple(found),
        looked=len(grid),
        searched=calls,
        same_at_all_depths=bool(np.all(np.ptp(radii, axis=1) < 1e-6)),
        delay=delay,
        whole_sample_radius=spectral_radius(late.closed()),
    )


def _within(x: Array, ball: bool) -> Array:
    """Return the point of the unit ball or cube that is nearest to x."""
    if ball:
        return np.asarray(x / max(1.0, float(np.linalg.norm(x))))
    return np.clip(x, -1.0, 1.0)


def _measures(loop: SampledLoop, *, only: str | None = None) -> dict[str, float]:
    """Return every measure of a loop by its worse place to be broken; one that grows is inf."""
    radius = spectral_radius(loop.closed())
    if only == "spectral radius":
        return {only: radius}
    if radius >= 1.0:
        return dict.fromkeys(MEASURES, math.inf) | {"spectral radius": radius}
    both = [margins.roughly(one) for one in (loop.broken_at_command(), loop.broken_at_depth())]
    return {name: max(f(m, radius) for m in both) for name, f in MEASURES.items()}


_GIVEN = {"gain": "", "late": "", "quantum": "V", "tick": "s", "rest": "V"}
_KEPT = {"next": "V", "left": ""}


def wrapped_law(law: Law) -> Law:
    """Return the wrapped form of a law, always the same."""
    return around(
        law,
        "Wrapped",
        _step,
        _initial,
        parameters={f"w_{name}": Annotated[float, unit] for name, unit in _GIVEN.items()},
        state={f"w_{name}": Annotated[float, unit] for name, unit in _KEPT.items()},
        name=f"{law.name}, wrapped",
    )


def _initial(parameters: Any, measurement: Measurement, reference: float) -> Any:
    p = parameters
    return State(law_initial(p.law, measurement, reference), p.w_rest, 0.0)


def _step(
    parameters: Any, state: Any, measurement: Measurement, reference: float
) -> tuple[float, Any, float]:
    p = parameters
    inner = state.law
    held = command = state.w_next
    left = state.w_left - 0.5 * p.w_tick
    if p.w_late < 0.5 or state.w_left <= 0.25 * p.w_tick:
        raw, inner, wait = law_step(p.law, inner, measurement, reference)
        command = p.w_gain * raw
        if p.w_quantum > 0.0:
            command = p.w_quantum * math.floor(command / p.w_quantum + 0.5)
        if p.w_late < 0.5:
            return command, State(inner, command, 0.0), wait
        ticks = max(math.ceil(wait / p.w_tick - 1e-9), 1)
        left = ticks * p.w_tick - 0.5 * p.w_tick
    return held, State(inner, command, left), 0.5 * p.w_tick


def wrapped(
    bound: BoundLaw,
    *,
    gain: float = 1.0,
    late: bool = False,
    quantum: float = 0.0,
    rest: float = 0.0,
) -> BoundLaw:
    """Return the wrapped form of a law with its parameters.

    quantum [V]; rest [V]: command before the first one comes.
    """
    law, numbers, h = bound
    form = wrapped_law(law)
    made = form.parameters(numbers, gain, float(late), quantum, h, rest)
    return BoundLaw(form, made, 0.5 * h if late else h)


GAINS = (0.5, 0.7, 1.0, 1.4, 2.0)
_SHARE = 0.02  # of a step, to which it settles


class RobustnessTrial(NamedTuple):
    """What became of the draws with one gain and one delay."""

    law: str
    gain: float  # -, on the command
    delay: float  # s, beyond that of the law as it is
    settled: float  # share of the draws that are in the band over the last third
    overshoot_95: float  # -, of the step
    farthest_95: float  # m, from the set-point over the last third
    moved_95: float  # m3/s, volume moved to and fro over the last third
    radius: float  # -, worst eigenvalue over the region with this gain and delay; nan: not linear
    draws: int


def settling_band(parameters: Any, step: Step, quantum: float) -> float:
    """Return how near the set-point counts as there [m].

    2 % of the step; what a law leaves alone by intent, its `band`, where that is more; a quantum.
    """
    return max(_SHARE * abs(step.target - step.start), getattr(parameters, "band", 0.0), quantum)


def robustness(
    vehicle: Vehicle, bound: BoundLaw, step: Step, drawn: Drawn, parts: Store, advance: Advance
) -> tuple[RobustnessTrial, ...]:
    """Return what a law stands: each gain, without and with half a sample of extra delay."""
    p, (law, parameters, sample_time) = plant(vehicle), bound
    rest = p.load_drive * step.start if vehicle.voltage_driven else p.psi * step.start + p.V_0
    band = settling_band(parameters, step, vehicle.sensors.depth_quantum)

    def run(gain: float, late: bool) -> list[float]:
        """Return the share settled, and 95th percentiles of overshoot, distance [m] and rate."""
        wrong = wrapped(bound, gain=gain, late=late, rest=rest)
        seen = traces(vehicle, wrong, step, drawn)
        found = measure(seen, float(seen.time[-1]) * 2.0 / 3.0)
        farthest = np.nan_to_num(found.farthest, nan=math.inf)
        worst = np.percentile(farthest, 95.0, method="higher")
        over, moved = np.percentile(found.overshoot, 95.0), np.nanpercentile(found.rate, 95.0)
        return [float(x) for x in (np.mean(farthest <= band), over, worst, moved)]

    found = []
    for late, gain in product((False, True), GAINS):
        asked = ("robustness", law.name, parameters, gain, late, step, drawn.runs)
        numbers = parts.get(partial(run, gain, late), *asked)
        delay = 0.5 * sample_time if late else 0.0
        radius = _radius(bound, drawn.region, step.target, gain, delay)
        found.append(RobustnessTrial._make((law.name, gain, delay, *numbers, radius, drawn.runs)))
        advance(0.5 / len(GAINS))
    return tuple(found)


def _radius(
    bound: BoundLaw, region: Region | None, depth: float, gain: float, delay: float
) -> float:
    """Return the largest eigenvalue's modulus over the region, the command times a gain [-]."""
    assert region is not None  # stability
    linear = at_rest(bound.without_rest, region.plants[0], depth=depth)
    if not linear.smooth or linear.sample_time != bound.sample_time:
        return math.nan
    loops = [loop_of(p, linear, depth=depth, delay=delay) for p in region.plants]
    broken = [loop.broken_at_command() for loop in loops]
    return max(spectral_radius(one.A - gain * one.B @ one.C) for one in broken)
