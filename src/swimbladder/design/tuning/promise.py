"""What tuned gains have to keep, as flashed, and what is in the way where they do not.

A fast law keeps its overshoot and arrives within a multiple of the least time that any controller
could take; a quiet one holds the error allowed; whatever the goal, nearly all vehicles settle.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from swimbladder.control.law import friction_of
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.planning import least_time
from swimbladder.design.planning.task import Limits
from swimbladder.design.tuning.region import Region
from swimbladder.design.tuning.trial import Drawn, Step, Trial, settling_off_ballast, trial
from swimbladder.errors import NoAnswerError
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import Vehicle

OVERSHOOT = 0.03  # in 95 % of the runs, that a fast law may have
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
_FRICTION = Cause(
    "the dry friction of the motor, and of a screw that the sea does not push back",
    frozenset({"friction"}),
    "a drive with less of it, or a motor with more torque per volt, narrows that",
)
_SUPPLY = "the supply at {:.3g} V, the least assumed: a battery that is changed earlier (`supply=`)"
_NOISE = (
    "the noise of the depth sensor, {:.2g} mm: a better sensor (`depth_noise=`, `depth_quantum=`)"
)
_LAYERS = "the water of the cast, whose layers move the neutral volume: a law that learns it sooner"
_SUPERVISOR = (
    "What limits it is the supervisor, which has the motor show that it can turn the vehicle round "
    "before it goes deeper: a faster motor, less psi or a shorter step take less of that."
)
_VEHICLE = (
    "What limits it is the vehicle itself, as well as it is known{}. A shorter step, a greater "
    "error allowed or another law may help."
)
_TOGETHER = (
    "What limits it is the uncertainty of all parameters together, of none alone: a pool day as "
    "`design-experiment` plans it, and `identify` on its logs, narrow it."
)
_NOT_NARROWED = "A shorter sample time, a faster motor or another law would help."


def limiting_margins(region: Region, held: Callable[[Region], bool]) -> str:
    """Return what keeps a law from its margins over a region, and what would help, as a sentence.

    held: whether the law has gains with the margins over a region. Every cause is taken away in
    turn; what is known of the nominal vehicle only is none.
    """
    for cause in _CAUSES:
        without = region.knowing(cause.known)
        if without.plants != region.plants and held(without):
            return f"What limits it is {cause.words}: {cause.remedy}."
    if held(region._replace(plants=region.plants[:1])):
        return _TOGETHER
    return _NOT_NARROWED


_HELPS = 0.9  # of what it is off, that is left where a cause is taken away


def off(promise: Promise, found: Trial) -> float:
    """Return how many times too much a trial is off what it has to keep; 0: it keeps all."""
    return max((times for _, times in broken(promise, found)), default=0.0)


def noise_limits(
    vehicle: Vehicle, law: BoundLaw, step: Step, drawn: Drawn, promise: Promise, found: Trial
) -> bool:
    """Return whether gains that do not keep a promise in a trial come nearer without any noise."""
    quiet = _silent(vehicle)
    if quiet == vehicle:
        return False
    without = trial_of(quiet, law, step, drawn, ballast=promise.ballast)
    return off(promise, without) <= _HELPS * off(promise, found)


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
        return off(promise, trial_of(vehicle, law, step, drawn, ballast=promise.ballast))

    whole, sensors = off(promise, found), vehicle.sensors
    outcomes = []
    causes = [*(_CAUSES if drawn.region is not None else ())]
    if vehicle.voltage_driven and any(friction_of(plant(vehicle))):
        causes.append(_FRICTION)
    for cause in causes:
        without = left(vehicle, drawn._replace(known=cause.known))
        outcomes.append((without, f"{cause.words}: {cause.remedy}"))
    if math.isfinite(drawn.supply):
        supply = _SUPPLY.format(drawn.supply)
        outcomes.append((left(vehicle, drawn._replace(supply=math.inf)), supply))
    if sensors.depth_noise > 0.0 or sensors.depth_quantum > 0.0:
        noise = 1e3 * math.hypot(sensors.depth_noise, sensors.depth_quantum / math.sqrt(12.0))
        least = min(left(_silent(vehicle), drawn, law) for law in dict.fromkeys(laws))
        outcomes.append((least, _NOISE.format(noise)))
    if drawn.column is not None:
        outcomes.append((left(vehicle, drawn._replace(column=None)), _LAYERS))
    if min(outcomes, default=(whole, ""))[0] > 0.0:
        for (cause, instead), after in others.items():
            outcomes.append((after(), f"{cause}: {instead} would help"))
    least, words = min(outcomes, default=(whole, ""), key=lambda one: one[0])
    if least <= _HELPS * whole:
        return f"What limits it is {words}."
    nominal = left(vehicle, drawn.nominal)
    if nominal <= _HELPS * whole:
        return _TOGETHER
    alone = drawn.nominal._replace(supervised=False)
    if drawn.supervised and left(vehicle, alone) < _HELPS * nominal:
        return _SUPERVISOR
    tried = " or ".join(instead for _, instead in others)
    return _VEHICLE.format(f": {tried} would not help" if tried else "")
