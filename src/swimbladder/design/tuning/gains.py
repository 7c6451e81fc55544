"""Gains of each law that is tuned, as its recipe makes them.

What is tried depends on law and goal. Frequencies are shares of the inner rate, sleeps of the time
in which a held volume lets the vehicle diverge, holds of the one in which the random
walk of the neutral volume moves it away.

`setting_of` is what they need to know of a vehicle.

`Search` finds tuning parameters whose margins hold over the region, then the best of them in
trials. Margins are cheap and trials are dear: so the parameters are laid out on a grid, kept where
the nominal vehicle has the margins, ordered by what the goal wants of them, kept where the whole
region has the margins, and the first few of these are tried, with few runs while they are compared.

What tuned gains have to keep, as flashed, and what is in the way where they do not.

A fast law keeps its overshoot and arrives within a multiple of the least time that any controller
could take; a quiet one holds the error allowed; whatever the goal, nearly all vehicles settle.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.law import Drive, Law, Recipe, Setting, TuningParameters, friction_of
from swimbladder.control.motion import drift_time, e_folding_time
from swimbladder.control.registry import LAWS
from swimbladder.control.supervisor import Reason
from swimbladder.design.linear.margins import Margins
from swimbladder.design.linear.pump_valve import drive_rates, moved_by_volume
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.planning import least_time
from swimbladder.design.planning.task import Limits
from swimbladder.design.tuning import margins
from swimbladder.design.tuning.region import Member, Region, neutral_random_walk
from swimbladder.design.tuning.trial import Drawn, Step, Trial, settling_off_ballast, traces, trial
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.progress import Advance
from swimbladder.physics.buoyancy_engine import at_voltage
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.units import say
from swimbladder.vehicle import PumpAndValve, Vehicle
from swimbladder.vehicle.schema import no_such

_say = partial(say, "design", "tuning")

OVERSHOOT = 0.03  # in 95 % of the runs, that a fast law may have
BEYOND = 0.1  # of its way, in 95 % of the runs, that a float may go farther where its band is less
OF_LEAST = 1.5  # times the least time, within which it has to settle in 95 % of the runs
SETTLED = 0.95  # of the runs, that have to settle
OF_HELD = 1.05  # times the rms that was asked for, which a trial has to within as much
BALLAST = 20e-6  # m3, that a team's ballast is off: 20 g
_ROOM = 0.25  # of the stroke, that it is off at most


class Promise(NamedTuple):
    """What is asked of gains."""

    goal: str
    least: float  # s, the least time of the step; nan where it is not known or does not count
    held: float  # m rms, that a depth is to be held to; 0: does not count
    ballast: float  # m3, that the ballast may be off; 0: does not count
    floats: bool = False  # whether it has pump and valve, and a band to arrive in


def promise_of(
    vehicle: Vehicle, goal: str, *, least: float, held: float, supervised: bool
) -> Promise:
    """Return what gains for a goal have to keep; held [m rms]: error of the depth allowed.

    least [s]: the least time of the step. A vehicle finds out how far its ballast is off while it
    is held before the step, as supervised ones are.
    """
    floats = vehicle.command == "volume change"
    if goal != "fast" or floats:
        return Promise(goal, least, held if goal != "fast" else 0.0, 0.0, floats)
    stroke = vehicle.stroke
    ballast = min(BALLAST, _ROOM * (stroke.maximum - stroke.minimum)) if supervised else 0.0
    return Promise(goal, least, 0.0, ballast)


def least_of(
    vehicle: Vehicle, goal: str, ends: tuple[float, float], *, supply: float, sample_time: float
) -> float:
    """Return the least time [s] of a step between two depths [m]; nan: not known, or no matter.

    It is that of the nominal vehicle with its least supply [V], infinite where it has none.
    """
    if goal != "fast" or vehicle.command == "volume change":
        return math.nan
    given = Limits(sample_time=sample_time)
    if math.isfinite(supply):
        given["supply"] = supply
    try:
        return least_time(vehicle, *ends, **given).time
    except NoAnswerError:  # too many samples
        return math.nan


def broken(promise: Promise, found: Trial) -> Iterator[tuple[str, float]]:
    """Yield what a trial does not keep, in words, with how many times too much it is."""
    if found.settled < SETTLED and (promise.goal == "fast" or promise.floats):
        kept = f"only {100.0 * found.settled:.3g} % of {found.runs} runs settle, not"
        yield f"{kept} {100.0 * SETTLED:g} %", 1.0 + (1.0 - found.settled) / (1.0 - SETTLED)
    if promise.held > 0.0 and found.rms > OF_HELD * promise.held:
        rms = f"a depth is held to {1e3 * found.rms:.3g} mm rms"
        yield f"{rms}, not to {1e3 * promise.held:.3g} mm", found.rms / promise.held
    if promise.goal != "fast" or promise.floats:
        return
    if found.overshoot_95 > OVERSHOOT:
        over = f"the overshoot in 95 % of {found.runs} runs is {100.0 * found.overshoot_95:.3g} %"
        yield f"{over}, above {100.0 * OVERSHOOT:g} %", found.overshoot_95 / OVERSHOOT
    most = OF_LEAST * promise.least
    if found.settled >= SETTLED and found.settle_95 > most:
        takes = f"95 % of {found.runs} runs need {found.settle_95:.4g} s to settle"
        bound = f"{OF_LEAST:g} times the least time of {promise.least:.4g} s"
        yield f"{takes}, more than {bound}", found.settle_95 / most
    if promise.ballast and math.isnan(found.ballast):
        yield f"it never settles with its ballast off by {1e6 * promise.ballast:.3g} g", 2.0


def trial_of(
    vehicle: Vehicle, bound: BoundLaw, step: Step, drawn: Drawn, *, ballast: float
) -> Trial:
    """Return a trial, with the time that it takes with its ballast [m3] off where that counts."""
    found = trial(vehicle, bound, step, drawn)
    if ballast > 0.0:
        off = settling_off_ballast(vehicle, bound, step, drawn._replace(ballast=ballast))
        found = found._replace(ballast=off)
    return found


class Cause(NamedTuple):
    """Something that is not known, or not good enough, and what narrows it."""

    words: str
    known: frozenset[str]  # fields of `Plant` that are known where it is no cause
    remedy: str


_CAUSES = (
    Cause(
        "what is not known of the motion (K2, T2 or mass and drag)",
        frozenset({"a_b", "a_s", "d_l", "d_b", "d_0", "d_t"}),
        "a pool day as `design-experiment` plans it, and `identify` on its logs, narrow that",
    ),
    Cause(
        "what is not known of psi",
        frozenset({"psi"}),
        "steps at depths far apart, and `identify` on their logs, narrow that",
    ),
    Cause(
        "what is not known of the motor (K1, T1)",
        frozenset({"gain", "T1"}),
        "a bench or pool log with its voltage, and `identify-actuator`, narrow that",
    ),
    Cause(
        "how far the neutral volume is from what is known",
        frozenset({"V_0"}),
        "several logs in the water of the mission, and `identify` on all of them, narrow that",
    ),
)
_DIVES = "logs of dives that differ in speed and depth, and `identify --cast` on them, narrow that"
_OF_FLOATS = (
    Cause("what is not known of the motion (mass and drag)", _CAUSES[0].known, _DIVES),
    Cause(_CAUSES[1].words, _CAUSES[1].known, _DIVES),
    Cause(
        "what is not known of pump and valve",
        frozenset({"pump", "valve"}),
        "runs of both with volume and pressure, and `energy --fit` on them, narrow that",
    ),
    _CAUSES[3],
)
_FRICTION = Cause(
    "the dry friction of the motor, and of a screw that the sea does not push back",
    frozenset({"friction"}),
    "a drive with less of it, or a motor with more torque per volt, narrows that",
)


def limiting_margins(region: Region, held: Callable[[Region], bool]) -> str:
    """Return what keeps a law from its margins over a region, and what would help, as a sentence.

    held: whether the law has gains with the margins over a region. Every cause is taken away in
    turn; where the nominal vehicle alone has none, nothing that is not known limits it: empty.
    """
    for cause in _CAUSES:
        without = region.knowing(cause.known)
        if without.plants != region.plants and held(without):
            return f"What limits it is {cause.words}: {cause.remedy}."
    if held(region._replace(plants=region.plants[:1])):
        return _say("limited together", remedy=_CAUSES[0].remedy)
    return ""


_HELPS = 0.9  # of what it is off, that is left where a cause is taken away


def violation(promise: Promise, found: Trial) -> float:
    """Return how many times too much a trial is off what it has to keep; 0: it keeps all."""
    return max((times for _, times in broken(promise, found)), default=0.0)


def _silent(vehicle: Vehicle) -> Vehicle:
    return vehicle.but("sensors", depth_noise=0.0, depth_quantum=0.0)


def limiting(
    vehicle: Vehicle,
    laws: Sequence[BoundLaw],
    step: Step,
    drawn: Drawn,
    promise: Promise,
    found: Trial,
    others: Mapping[tuple[str, str], Callable[[], float]],
) -> str:
    """Return what limits gains that do not keep a promise, and what would help, as a sentence.

    laws: with these gains, and with others that a better sensor might allow; found: the trial of
    the first. Every cause is taken away in turn: what leaves least is what limits. others: causes
    and what would be without each, in words, with how far gains made for that are off.
    """

    def left(vehicle: Vehicle, drawn: Drawn, law: BoundLaw = laws[0]) -> float:
        return violation(promise, trial_of(vehicle, law, step, drawn, ballast=promise.ballast))

    whole, sensors = violation(promise, found), vehicle.sensors
    outcomes = []
    own = _OF_FLOATS if promise.floats else _CAUSES
    causes = [*(own if drawn.region is not None else ())]
    if vehicle.voltage_driven and any(friction_of(plant(vehicle))):
        causes.append(_FRICTION)
    for cause in causes:
        without = left(vehicle, drawn._replace(known=cause.known))
        outcomes.append((without, f"{cause.words}: {cause.remedy}"))
    if math.isfinite(drawn.supply):
        supply = _say("limited by supply", supply=drawn.supply)
        outcomes.append((left(vehicle, drawn._replace(supply=math.inf)), supply))
    if sensors.depth_noise > 0.0 or sensors.depth_quantum > 0.0:
        noise = 1e3 * math.hypot(sensors.depth_noise, sensors.depth_quantum / math.sqrt(12.0))
        least = min(left(_silent(vehicle), drawn, law) for law in dict.fromkeys(laws))
        outcomes.append((least, _say("limited by noise", noise=noise)))
    if drawn.column is not None:
        outcomes.append((left(vehicle, drawn._replace(column=None)), _say("limited by layers")))
    if min(outcomes, default=(whole, ""))[0] > 0.0:
        for (cause, instead), after in others.items():
            outcomes.append((after(), f"{cause}: {instead} would help"))
    least, words = min(outcomes, default=(whole, ""), key=lambda one: one[0])
    if least <= _HELPS * whole:
        return f"What limits it is {words}."
    nominal = left(vehicle, drawn.nominal)
    if nominal <= _HELPS * whole:
        return _say("limited together", remedy=own[0].remedy)
    alone = drawn.nominal._replace(supervised=False)
    if drawn.supervised and left(vehicle, alone) < _HELPS * nominal:
        return _say("limited by supervisor")
    tried = " or ".join(instead for _, instead in others)
    return _say("limited by vehicle", tried=f": {tried} would not help" if tried else "")


GOALS = ("fast", "quiet", "energy")
# m rms, that a depth is held to where nothing is said: 1 cm less what 40 runs may be off, and 5 cm.
HELD = {"quiet": 9.5e-3, "energy": 5e-2}


_DEAD = (1.0, 2.0, 4.0, 6.0, 9.0)  # of what the noise makes of the volume asked for
_SPARE = 1.25  # of the voltage that the load of the sea takes where it is deepest
_OFF = 3.0  # times as long, that it may take to settle with its ballast off
_MOVED = 0.45e-3 / 3600.0  # m3/s, that it may move meanwhile; then starts and turns count


def goals_of(recipe: Recipe) -> tuple[str, ...]:
    """Return the goals that a law can be tuned for."""
    return GOALS[1:] if recipe.fast is None and recipe.candidates is None else GOALS


def grid(
    recipe: Recipe, goal: str, setting: Setting, held: float, scale: float = 1.0
) -> Iterator[TuningParameters]:
    """Yield the tuning parameters on the grid, their frequencies times `scale`.

    held [m]: rms that a depth is to be held to.
    """
    h = setting.sample_time
    if recipe.sleeps:
        away = e_folding_time(setting.plant, asleep=True)
        for sleep, band in product(recipe.sleeps, recipe.bands):
            pause = sleep * away
            first = TuningParameters(frequency=1.0 / pause, damping=1.0, inner=0.5 / h)
            yield first._replace(pause=pause, band=band * held)
        return
    g = recipe.fast if goal == "fast" else recipe.quiet
    for inner, share, damping, sharpness, learning in product(*(g or ())):
        rate = inner / h
        first = TuningParameters(frequency=scale * share * rate, damping=damping, inner=rate)
        yield first._replace(sharpness=sharpness, learning=learning)


def preference(goal: str, tuning: TuningParameters) -> float:
    """Return what is to be small before trials: of gains, or for fast of their slowness."""
    if goal == "fast":
        return -tuning.frequency / (1.0 + 0.02 * tuning.sharpness)
    return tuning.frequency * tuning.sharpness * tuning.inner / (1.0 + tuning.learning)


def options(
    recipe: Recipe,
    goal: str,
    tuning: TuningParameters,
    s: Setting,
    *,
    held: float,
    deepest: float,
    scale: float = 1.0,
) -> Iterator[TuningParameters]:
    """Yield what is left to choose: how much of the motor a path takes, and when it rests.

    held [m]: rms that a depth is to be held to; deepest [m]: where the motor still has to move;
    scale: as `grid` has it, where a path may leave the noise more of the motor.
    """
    if goal == "fast":
        more = (_EASY,) if recipe.shares and scale < 1.0 else ()
        for share in (*(recipe.shares or (tuning.share,)), *more):
            yield tuning._replace(share=share)
        return
    rests = [tuning]
    if recipe.holds:
        dead, spell = 0.5 * s.least_move, drift_time(s.plant, held, s.random_walk)
        holds, bands = recipe.holds, recipe.bands
        every = product(holds, bands) if goal == "quiet" else product(holds[1:2], bands[::4])
        rests = [tuning._replace(dead=dead, pause=x * spell, band=y * held) for x, y in every]
    elif recipe.jitter is not None:
        noise = recipe.jitter(recipe.gains(s, tuning), s)
        rests = [tuning._replace(dead=max(x * noise, s.least_move)) for x in _DEAD]
    volts = (1.0,) if goal != "energy" or s.plant.positioner else recipe.volts
    needed = _SPARE * s.plant.load_drive * deepest / s.limit
    if len(volts) > 1 and len(rests) > 3:
        rests = rests[::2]
    for rest, share in product(rests, volts):
        if share >= min(needed, 1.0):
            yield rest._replace(volts=share)


def score(goal: str, t: Trial, held: float) -> tuple[float, ...]:
    """Return what is to be small; first of all that it settles, or holds, at all."""
    if goal == "fast":
        settle = t.settle_95 if math.isfinite(t.settle_95) else 1e9
        # Of those that settle as soon, to a twentieth, the one that moves less.
        unkept = t.overshoot_95 > OVERSHOOT, t.settled < SETTLED, math.isnan(t.ballast)
        return (*unkept, t.ballast > _OFF * settle, round(20.0 * math.log(settle)), t.rate)
    off = max(t.rms / held, 1.0)
    if goal == "energy":
        return (off, t.energy)
    # A tenth of overshoot on the way there counts like a tenth more of starts.
    return (off, max(t.rate / _MOVED, 1.0), (t.starts + t.turns) * (1.0 + t.overshoot_95))


def float_score(goal: str, t: Trial, held: float, way: float = math.inf) -> tuple[float, ...]:
    """Return what is to be small of a float: the time to its depth, what holding takes, or all.

    Before that it is not to go beyond its depth by more than its band, `held` [m], or a tenth of
    its way [m]. Where no energy is known, what is moved counts in its place.
    """
    arrives = t.settle_95 if math.isfinite(t.settle_95) else 1e9
    beyond = round(max(t.overshoot_95 / max(BEYOND, held / way), 1.0), 1)
    stays = (round(1.0 - t.settled, 2), max(t.rms / held, 1.0), beyond)
    if goal == "fast":
        return (*stays, round(20.0 * math.log(arrives)), t.starts)
    power, energy = (t.power, t.energy) if math.isfinite(t.power) else (t.rate, t.rate)
    return (*stays, energy) if goal == "energy" else (*stays, power, t.starts)


_FINEST = 0.5e-3  # m, noise that a filter assumes at least
_LEAST = 1e-4  # of the stroke: volumes below are none


def setting_of(
    vehicle: Vehicle,
    *,
    sample_time: float,
    supply: float,
    neutral_range: float,
    depths: Sequence[float] = (),
) -> Setting:
    """Return what the gains need of a vehicle; supply [V]: the least that it will have.

    depths [m]: between which a pump and valve has to work.
    """
    sensors = vehicle.sensors
    noise = math.hypot(sensors.depth_noise, sensors.depth_quantum / math.sqrt(12.0))
    if vehicle.identified is not None:
        noise = max(noise, vehicle.identified.depth_noise)
    p = plant(moved_by_volume(vehicle))
    volume_noise = math.hypot(sensors.volume_noise, sensors.volume_quantum / math.sqrt(12.0))
    least = max(3.0 * volume_noise, _LEAST * (p.V_max - p.V_min))
    numbers = (sample_time, max(noise, _FINEST), supply, neutral_range, least)
    drive = _drive(vehicle, supply, depths, neutral_range)
    return Setting(p, *numbers, neutral_random_walk(vehicle), drive)


def _drive(
    vehicle: Vehicle, supply: float, depths: Sequence[float], neutral_range: float
) -> Drive | None:
    a, stroke = vehicle.engine, vehicle.stroke
    if not isinstance(a, PumpAndValve) or not depths:
        return None
    rates = drive_rates(at_voltage(vehicle, supply), depths)
    neutral = [vehicle.neutral_volume(z) for z in depths]
    room = min(stroke.maximum - max(neutral), min(neutral) - stroke.minimum)
    return Drive(
        rate_out=min(rates.pump),
        rate_in=min(rates.valve),
        start=max(rates.start_volume),
        tick=a.quantum,
        longest=a.longest_run or math.inf,
        room=room - neutral_range,
    )


def refused_depths(
    what: str, depths: tuple[float, float], remedy: str, *, field: str = "depth_range"
) -> InputError:
    """Return the error for two depths [m] that cannot be."""
    value = f"{depths[0]:g}:{depths[1]:g}"
    return InputError(what, field=field, value=value, unit="m", remedy=remedy)


def check_depths(depths: tuple[float, float], surface: float = 0.0) -> None:
    """Raise InputError for what is no range of depths [m] that ends below `surface`."""
    if not (0.0 <= depths[0] < depths[1] < math.inf and depths[1] > surface):
        remedy = "Give the least and the greatest, like 0:100"
        raise refused_depths("no range of depths", depths, remedy)


def tunable_names(command: str | None = None) -> list[str]:
    """Return the names of the laws that are tuned, of those that give a command where named."""
    tuned = {name: law.command for name, law in LAWS.items() if law.recipe is not None}
    return [name for name, own in tuned.items() if command in (None, own)]


def tunable(name: str) -> Law:
    """Return the law of that name; raises InputError where it is not one that is tuned."""
    law = LAWS.get(name)
    if law is None or law.recipe is None:
        raise no_such("this law is not tuned", name, tunable_names(), field="law")
    return law


def recipe_of(name: str) -> Recipe:
    """Return how the parameters of that law are made; raises InputError where it is not tuned."""
    recipe = tunable(name).recipe
    assert recipe is not None
    return recipe


def gains(name: str, setting: Setting, tuning: Any) -> Any:
    """Return the parameters of the law of that name."""
    return recipe_of(name).gains(setting, tuning)


_TRIED = {"fast": 6, "quiet": 8, "energy": 5}
_TRIED_RESTING = 3  # of a law that rests near the set-point, by gains of its own
_FEW = {"fast": 100, "quiet": 40, "energy": 40}  # runs while they are compared
_EASY = 0.6  # of the motor's speed that a path takes where the fastest gains do not settle
_COMPARED = 0.85  # of the work: margins and trials of candidates
_SCALES = (1.0, 0.5, 0.25, 0.125, 2.0)  # times the frequencies of a grid for fast, in turn
_SCALES_HELD = (1.0, 2.0, 4.0, 0.5)  # the same where a depth is to be held
_FINAL = 3  # options of a law that rests, whose band is fitted to the error that is allowed
_FITTED = 3  # times, each with as many runs as are reported
_SLACK = 0.97  # of the margins: the linear form is that of differences
_AWAY = 0.3  # of a step, off which its end counts as not brought there
_FLIGHTS = {"fast": 20, "quiet": 40, "energy": 20}  # of floats while they are compared
_AGAIN = 4  # best of them, compared with all flights: what happens while they hold is rare
_ARRIVE = 0.8  # share of flights that have to arrive and stay
_LOST = 2.0  # times the error allowed, that is no holding any more


@dataclass(frozen=True)
class Found:
    """Tuning parameters with what they give; margins: None for a law that has none.

    radius: largest eigenvalue's modulus over the region from decision to decision; nan: has none.
    """

    tuning: Any
    parameters: Any
    margins: Margins | None
    nominal: Trial
    region: Trial
    radius: float = math.nan


class Goal(NamedTuple):
    """What is asked of a law, and of which vehicles."""

    name: str  # fast, quiet or energy
    held: float  # m rms, that a depth is to be held to
    depths: tuple[float, ...]  # m, where margins are checked
    step: Step
    drawn: Drawn
    promise: Promise  # what gains have to keep


@dataclass
class Search:
    """A search of the best tuning parameters for a goal, and how near anything came."""

    law: Law
    vehicle: Vehicle
    setting: Setting
    asked: Goal
    delay: float  # s, from sample to command
    report: Advance
    near: tuple[tuple[bool, bool, float], tuple[str, ...]] | None = None
    kept: list[tuple[float, Any]] = field(default_factory=list)  # what the nominal one has
    fastest: Any = None  # best tuning parameters of the fastest that were tried, of loops

    def found(self) -> Found:
        """Return the best tuning parameters found.

        Raises NoAnswerError where none have the margins, with the margin that is farthest from
        what is wanted, or where none hold the vehicle.
        """
        return self._of_loops() if self.recipe.candidates is None else self._of_floats()

    @property
    def recipe(self) -> Recipe:
        """How the law's parameters are made."""
        assert self.law.recipe is not None  # tunable
        return self.law.recipe

    @property
    def region(self) -> Region:
        """The vehicles that the law has to hold."""
        assert self.asked.drawn.region is not None  # tune
        return self.asked.drawn.region

    def bound(self, tuning: Any) -> BoundLaw:
        """Return the law with the parameters that its tuning gives."""
        h = self.setting.sample_time if self.law.ways is None else math.nan
        return BoundLaw(self.law, self.recipe.gains(self.setting, tuning), h)

    def tried(self, tuning: Any, drawn: Drawn) -> tuple[tuple[float, ...], Any, Trial]:
        """Return what is to be small of a tuning, the tuning, and its trial."""
        flown = self.vehicle, self.bound(tuning), self.asked.step
        found = trial_of(*flown, drawn, ballast=self.asked.promise.ballast)
        goal, held, _, step, _, _ = self.asked
        if self.law.ways is None:
            return score(goal, found, held), tuning, found
        return float_score(goal, found, held, abs(step.target - step.start)), tuning, found

    def over(
        self, tuning: TuningParameters, wanted: Margins, judge: margins.Judge, *, nominal: bool
    ) -> Margins | None:
        """Return the margins where they are what is wanted, else None.

        Dead zone and pauses are none of the loop's around rest: margins are of its linear part.
        """
        linear, count = self.bound(tuning).without_rest, 1 if nominal else None
        plants, depths = self.region.plants[:count], self.asked.depths[:count]
        loops = partial(margins.loops, linear, plants, depths=depths, delay=self.delay)
        m = margins.worst(loops(), judge=judge, wanted=None if nominal else wanted)
        short = margins.violated_margins(m, margins.WANTED)
        missed = margins.violated_margins(m, wanted)
        if missed and not short:  # within the slack
            m = margins.worst(loops(), judge=margins.exactly, wanted=margins.WANTED)
            short = missed = margins.violated_margins(m, margins.WANTED)
        if not missed:
            return m
        rank = (nominal, not m.stable, margins.worst_margin_ratio(m, wanted))
        if self.near is None or rank < self.near[0]:
            self.near = (rank, short)
        return None

    def candidates(self, most: int, scale: float, part: float) -> list[TuningParameters]:
        """Return the first tuning parameters that have the margins, by what the goal prefers.

        scale: as `grid` has it; part: of all the work.
        """
        goal, wanted = self.asked.name, _tightened(margins.WANTED)
        every = list(grid(self.recipe, goal, self.setting, self.asked.held, scale))
        if not self.recipe.linear:
            return every
        kept: list[tuple[float, Any]] = []
        for tuning in every:
            self.report(0.3 * part / len(every))
            if self.over(tuning, wanted, margins.roughly, nominal=True) is not None:
                kept.append((preference(goal, tuning), tuning))
        kept.sort(key=lambda pair: pair[0])
        self.kept += kept
        found: list[TuningParameters] = []
        learnt: Counter[float] = Counter()  # how fast it learns only a trial off its ballast shows
        each = math.ceil(most / len({one.learning for _, one in kept} or {0.0}))
        order = kept if goal == "fast" else _spread(kept, most if self.recipe.holds else 0)
        for _, tuning in order:
            if len(found) == most:
                break
            if goal == "fast" and learnt[tuning.learning] == each:
                continue
            if self.over(tuning, wanted, margins.roughly, nominal=False) is not None:
                found.append(tuning)
                learnt[tuning.learning] += 1
                self.report(0.1 * part / most)
        return found

    def _fitted(self, tuning: Any, over: Trial, drawn: Drawn) -> list[Any]:
        """Return what comes of the bands in which the error is nearest to what is allowed.

        Where a band holds a depth that a wider one loses, the next is between the two.
        """
        held, tried = self.asked.held, [(tuning.band, over.rms)]
        found = []
        for _ in range(_FITTED):
            band, rms = tried[-1]
            band *= max(held / rms, 0.5)
            kept = max((b for b, off in tried if off <= held), default=0.0)
            lost = min((b for b, off in tried if off > held and b > kept), default=math.inf)
            if kept > 0.0 and lost < math.inf and not kept < band < lost:
                band = math.sqrt(kept * lost)
            found.append(self.tried(tuning._replace(band=band), drawn))
            tried.append((band, found[-1][2].rms))
        return found

    def _of_loops(self) -> Found:
        """Return the best of a law that is called at each sample: by margins, then trials."""
        goal, held, _, step, drawn, _ = self.asked
        recipe, name = self.recipe, self.law.name
        scored: list[tuple[tuple[float, ...], Any, Trial]] = []
        left = 1.0  # of the work
        for scale in _SCALES if goal == "fast" else _SCALES_HELD:
            if goal == "fast" and scale > 1.0 and scored:
                break  # faster only where none has margins, as the sample is long
            more = self._compared(scale, 0.5 * left)
            left *= 1.0 - 0.5 * _COMPARED
            if more and self.fastest is None:
                self.fastest = more[0][1]
            worse = goal == "fast" and scored and more and more[0][0] >= scored[0][0]
            scored = sorted([*scored, *more], key=lambda one: one[0])
            if worse or not recipe.linear or (scored and not self._elsewhere(*scored[0][1:])):
                break
        loose = bool(scored) and scored[0][2].rms > held
        if recipe.holds and (goal == "quiet" or (goal == "energy" and loose)):
            # neighbours differ by less than few runs show
            final = []
            for _, tuning, over in scored[:_FINAL]:
                final += self._fitted(tuning, over, drawn)
            scored = sorted(final, key=lambda one: one[0]) + scored[_FINAL:]
        if scored:
            self._refuse_alarms(*scored[0][1:])
        off = scored[0][2].rms if scored else 0.0
        if goal != "fast" and not off <= _LOST * held:
            better = [n for n in tunable_names(self.law.command) if recipe_of(n).holds_best]
            other = "" if recipe.holds_best or not better else f"the law {better[0]} or "
            raise NoAnswerError(_say("not held", name=name, held=held, off=off, other=other))
        if goal == "fast" and not off <= _AWAY * abs(step.target - step.start):
            raise NoAnswerError(_say("not there", name=name, off=off, found=self))
        for _, tuning, over in scored:
            m = None
            if recipe.linear:
                m = self.over(tuning, margins.WANTED, margins.exactly, nominal=False)
            if m is not None or not recipe.linear:
                self.report(left)
                if over.runs != drawn.runs:
                    over = self.tried(tuning, drawn)[2]
                return self._chosen(tuning, m, over, math.nan)
        assert self.near is not None  # something was computed
        (_, unstable, _), short = self.near
        nearest = f"the nearest has {'; '.join(short)}"
        if unstable:
            nearest = "none makes a loop that is stable over it"
        why, h = limiting_margins(self.region, self.held), self.setting.sample_time
        said = _say("no margins", name=name, h=h, nearest=nearest, why=why)
        raise NoAnswerError(said.rstrip())

    def _elsewhere(self, tuning: Any, over: Trial) -> bool:
        """Say whether gains do not keep what they have to, and those of other frequencies may.

        A slow motor is saturated by noise, or by a path at nearly its speed; a depth is not held by
        gains that are slow beside the vehicle. over: their trial.
        """
        goal, held, _, step, drawn, promise = self.asked
        if goal != "fast" and self.recipe.holds:  # whose band is yet to be fitted
            return not over.rms <= _LOST * held
        if not any(broken(promise, over)):
            return False
        if goal != "fast":
            return True
        quiet = _silent(self.vehicle)
        if self.recipe.shares or quiet == self.vehicle:
            return bool(self.recipe.shares)
        flown = quiet, self.bound(tuning), step, drawn._replace(runs=over.runs)
        without = violation(promise, trial_of(*flown, ballast=promise.ballast))
        return without <= _HELPS * violation(promise, over)

    def _compared(self, scale: float, part: float) -> list[tuple[tuple[float, ...], Any, Trial]]:
        """Return trials of candidates with their options, the best first; arguments as there."""
        goal, held, depths, _, drawn, _ = self.asked
        most = _TRIED_RESTING if self.recipe.holds and goal != "fast" else _TRIED[goal]
        every: list[TuningParameters] = []
        for one in self.candidates(most, scale, part):
            asked = self.recipe, goal, one, self.setting
            every += options(*asked, held=held, deepest=max(depths), scale=scale)
        scored = []
        for tuning in every:
            scored.append(self.tried(tuning, drawn._replace(runs=min(drawn.runs, _FEW[goal]))))
            self.report(0.45 * part / len(every))
        return sorted(scored, key=lambda one: one[0])

    def held(self, region: Region) -> bool:
        """Say whether some tuning with margins for the nominal vehicle has them over a region."""
        drawn = self.asked.drawn._replace(region=region)
        other = replace(self, asked=self.asked._replace(drawn=drawn), near=None)
        over = partial(other.over, wanted=_tightened(margins.WANTED), judge=margins.roughly)
        return any(over(tuning, nominal=False) is not None for _, tuning in self.kept)

    def _refuse_alarms(self, tuning: Any, over: Trial) -> None:
        """Raise NoAnswerError where the supervisor takes over healthy vehicles."""
        if not over.alarms > 0.0:
            return
        runs = traces(self.vehicle, self.bound(tuning), self.asked.step, self.asked.drawn)
        numbers, counts = np.unique(runs.alarm[runs.alarm > 0], return_counts=True)
        reasons = [Reason(int(n)).words for n in numbers[np.argsort(-counts)]]
        why = f": {', '.join(reasons)}" if reasons else ""
        raise NoAnswerError(_say("alarms", over=over, why=why, found=self))

    def _chosen(self, tuning: Any, m: Margins | None, over: Trial, radius: float) -> Found:
        self._refuse_alarms(tuning, over)
        nominal = self.tried(tuning, self.asked.drawn.nominal)[2]
        return Found(tuning, self.bound(tuning).parameters, m, nominal, over, radius)

    def _of_floats(self) -> Found:
        """Return the best of a law of volume changes: stable over the region, then flown."""
        goal, held, depths, step, drawn, _ = self.asked
        vehicle, region, name = self.vehicle, self.region, self.law.name
        assert self.recipe.candidates is not None
        rates = drive_rates(at_voltage(vehicle, self.setting.limit), depths)
        members = [Member(p, {}, d) for p, d in zip(region.plants, region.drives, strict=True)]
        medium = medium_of(vehicle, drawn.column, reach=max(depths))
        kept: list[tuple[float, Any]] = []
        least, unheld = math.inf, ""
        every = self.recipe.candidates(self.setting, goal, held)
        for tuning in every:
            bound = self.bound(tuning)
            radius = margins.largest_radius(vehicle, bound, members, rates, medium)
            rest = margins.rest_of(vehicle, bound, rates, medium)
            if not rest.held:
                unheld = f"at rest the best goes {rest.band:.3g} m between two decisions"
            elif radius < 1.0:
                kept.append((radius, tuning))
            least = min(least, radius)
            self.report(0.2 / len(every))
        if not kept:
            why = unheld if least < 1.0 else f"the smallest eigenvalue has the modulus {least:.3g}"
            raise NoAnswerError(_say("unstable decisions", name=name, why=why))
        scored = []
        for radius, tuning in kept:
            few = drawn._replace(runs=min(drawn.runs, _FLIGHTS[goal]), supervised=False)
            scored.append((self.tried(tuning, few)[0], radius, tuning))
            self.report(0.5 / len(kept))
        scored.sort(key=lambda one: one[0])
        again = scored[: 1 if goal == "fast" and not drawn.supervised else _AGAIN]
        final = [(self.tried(tuning, drawn), radius) for _, radius, tuning in again]
        (_, tuning, over), radius = min(final, key=lambda one: one[0][0])
        span = abs(step.target - step.start)
        lone = drawn._replace(supervised=False)  # is it the law that does not bring it there?
        alone = self.tried(tuning, lone)[2] if over.alarms > 0.0 else over
        if alone.settled < _ARRIVE or not alone.rms <= _LOST * held:
            raise NoAnswerError(
                _say(
                    "floats not there",
                    name=name,
                    span=span,
                    held=held,
                    alone=alone,
                    over=over,
                    duration=step.duration / 3600.0,
                )
            )
        self.report(0.3)
        return self._chosen(tuning, None, over, radius)


def _spread(
    kept: list[tuple[float, TuningParameters]], apart: int
) -> list[tuple[float, TuningParameters]]:
    """Return the first of every frequency and damping: how slow is too slow only a trial shows.

    apart: as many as far apart as they can be come before the others.
    """
    first: dict[tuple[float, float], tuple[float, TuningParameters]] = {}
    for worth, k in kept:
        first.setdefault((round(k.frequency / k.inner, 6), k.damping), (worth, k))
    found = list(first.values())
    ahead = sorted(
        {round(place) for place in np.linspace(0, len(found) - 1, min(apart, len(found)))}
    )
    return [found[k] for k in ahead] + [one for k, one in enumerate(found) if k not in ahead]


def _tightened(m: Margins) -> Margins:
    raised = {name: getattr(m, name) / _SLACK for name in ("gain_up", "phase", "disk")}
    peak = 1.0 + (m.peak_sensitivity - 1.0) * _SLACK
    return m._replace(gain_down=m.gain_down * _SLACK, peak_sensitivity=peak, **raised)
