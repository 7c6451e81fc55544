"""From a vehicle and a pool to the experiments to run."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from threadpoolctl import threadpool_limits

from swimbladder.control.protocol import Does
from swimbladder.design.experiments import conditions
from swimbladder.design.experiments.result import Design, judge
from swimbladder.design.experiments.search import Search, search, sizes
from swimbladder.design.experiments.search import criterion as criterion_of
from swimbladder.errors import InputError, NoAnswerError, check_number
from swimbladder.estimation.estimates import read_priors, read_values, sentence
from swimbladder.estimation.motion import DELAY_STD, DRIFT_STD, NAMES, NEUTRAL_STD, Prior
from swimbladder.estimation.motion.problem import (
    UNITS,
    Assumed,
    check_parameters,
    default_names,
    model_of,
)
from swimbladder.io.progress import Advance, silent
from swimbladder.sim.pool import pool_parameters, run_procedure
from swimbladder.units import format_quantity
from swimbladder.vehicle import IdentifiedMotion, Vehicle

PAPER = tuple(sign * dV for dV in (20e-6, 30e-6, 45e-6, 75e-6) for sign in (1.0, -1.0))  # m3, 3.1
_TIME = 3600.0  # s
_SETTLING = 120.0  # s, where no procedure can be simulated
_SETTLING_STEP = 30e-6  # m3, of the procedure that is simulated for it
_DEEPER = 1.5
_LARGER = 2.0  # of the largest size that a design has: what the curve goes to
_DRIFT_TIME = 100.0  # s, over which a random walk is taken for a steady drift
_UNLIMITED = 10_000
_LEAST_TRAVEL = 0.2  # m


def design_experiment(
    vehicle: Vehicle,
    *,
    bottom_depth: float,
    depth_noise: float | None = None,
    depth_quantum: float | None = None,
    sample_time: float | None = None,
    neutral_std: float | None = None,
    drift_std: float | None = None,
    delay_std: float = DELAY_STD,
    free: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None,
    priors: Mapping[str, Prior] | None = None,
    drag: str | None = None,
    pool_time: float | None = None,
    max_experiments: int | None = None,
    clearance: float = 0.75,
    settling: float | None = None,
    rest: float = 5.0,
    max_record_time: float = 240.0,
    max_moves: int = 4,
    max_volume_change: float = math.inf,
    criterion: str = "largest",
    uncertainty: float | None = None,
    against: Sequence[float] | None = None,
    advance: Advance = silent,
) -> Design:
    """Find the most informative experiments on a vehicle's motion in a pool time.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    bottom_depth
        Depth of the pool's bottom [m].
    depth_noise
        Of the logged depth, 1 sigma [m]; none: that of the vehicle.
    depth_quantum
        Of the logged depth [m]; none: that of the vehicle.
    sample_time
        Of the logged depth [s]; none: that of the vehicle's controller, else 0.3 s.
    neutral_std
        Of an experiment's neutral volume, 1 sigma [m3]; none: that of the vehicle, else 0.5 cm3.
    drift_std
        Of how fast an experiment's neutral volume grows, 1 sigma [m3/s]; none: that of the vehicle,
        else 0.1 cm3 a minute.
    delay_std
        Of how late the volumes' stamps are, 1 sigma [s].
    free, fixed, priors, drag
        As for `identify`.
    pool_time
        In the pool [s]; none: that of the set `against`, else an hour.
    max_experiments
        At most so many; none: as many as the time allows.
    clearance
        Of all records from the bottom and from the surface [m].
    settling
        Time until the vehicle is at rest before a release [s]; none: it is simulated.
    rest
        How much of that is on record [s].
    max_record_time
        Length of a record, at most [s].
    max_moves
        Changes of volume in a record, at most.
    max_volume_change
        Change of volume, at most [m3].
    criterion
        What is to be small: largest, D, A, or names of parameters with commas: the largest of
        these.
    uncertainty
        1 sigma, as a share, of the vehicle's values, over which the design is good on average;
        none: the covariance that the vehicle was identified with, else 0.3.
    against
        Volume changes of single steps to compare with [m3]; none: the paper's eight where the
        vehicle's motion is an identified one. Empty: nothing to compare with.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    Design
        The experiments in order, their predicted errors, and how these compare. What the
        experiments will not identify is among the findings.

    Raises
    ------
    InputError
        Vehicle, pool and time leave nothing to do, or a number makes no sense.
    """
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        model = model_of(vehicle, law=drag, bottom_depth=math.inf)
        held, known = read_values(fixed, UNITS), read_priors(priors, UNITS)
        names = tuple(free) if free is not None else default_names(model.law, list(held))
        check_parameters(names, Assumed(held, known), model, voltage=False)
        question = conditions.Question(model, names, held, known)
        settled, how = _settling(vehicle, settling, bottom_depth, clearance)
        noise, neutral, drift = _errors(vehicle)
        s = conditions.Setting(
            bottom_depth=bottom_depth,
            clearance=clearance,
            sample_time=_sample_time(vehicle) if sample_time is None else sample_time,
            noise=noise if depth_noise is None else depth_noise,
            quantum=vehicle.sensors.depth_quantum if depth_quantum is None else depth_quantum,
            neutral_std=neutral if neutral_std is None else neutral_std,
            drift_std=drift if drift_std is None else drift_std,
            delay_std=delay_std,
            settling=settled,
            rest=rest,
            longest=max_record_time,
            largest=max_volume_change,
            moves=max_moves,
        )
        _check(s, depth_noise)
        advance(0.05)
        limits = conditions.ramps(vehicle, s)
        remedy = "Give the share by which the vehicle may be off, like 30%"
        check_number(uncertainty, "uncertainty", least=0.0, most=1.0, remedy=remedy)
        c = conditions.Conditions(question, s, limits, vehicle)
        before = conditions.covariance_of(question, vehicle, uncertainty)
        others = conditions.vehicles(question, before)
        judged = criterion_of(criterion, question.names)
        finder = Search(conditions=c, vehicles=others, judge=judged)
        rival = _rival(vehicle, against, limits, s)
        budget = pool_time or (sum(finder.of(r).cost for r in rival) if rival else _TIME)
        chosen = search(
            finder, budget, max_experiments or _UNLIMITED, lambda part: advance(0.75 * part)
        )
        ours = conditions.evaluate(chosen, c, others)
        advance(0.07)
        theirs = conditions.evaluate(rival, c, others) if rival else None
        advance(0.07)
        ends = sizes(c)
        end = min(limits.most, -limits.least, _LARGER * ends[-1])
        buys = conditions.curve(c, (ends[0], end), budget)
        stretched = conditions.deeper(chosen, c, _DEEPER)
        advance(0.06)
    return Design(
        vehicle=vehicle,
        conditions=c,
        criterion=criterion,
        budget=budget,
        chosen=ours,
        against=theirs,
        rival=_rival_name(against),
        curve=buys,
        findings=judge(ours, buys, stretched, c),
        assumptions=_assumptions(c, how, len(others)),
    )


def paper_steps(volumes: Sequence[float], setting: conditions.Setting) -> list[conditions.Release]:
    """Return single steps as in section 3.1: up from near the bottom, down from near the surface.

    volumes [m3].
    """
    starts = [setting.deepest if v > 0.0 else setting.shallowest for v in volumes]
    return [conditions.Release.to_and_fro(z, [v], []) for z, v in zip(starts, volumes, strict=True)]


def _settling(
    vehicle: Vehicle, given: float | None, bottom_depth: float, clearance: float
) -> tuple[float, str]:
    """Return the time until a vehicle is at rest [s], and where it comes from."""
    if given is not None:
        check_number(given, "settling", "s", least=0.0)
        return given, "as given"
    try:
        p = pool_parameters(
            vehicle, dV=_SETTLING_STEP, bottom_depth=bottom_depth, clearance=clearance
        )
        run = run_procedure(vehicle, p, bottom_depth=bottom_depth, seed=None)
    except (InputError, NoAnswerError):
        return _SETTLING, "assumed: the procedure cannot be simulated with this vehicle's loop"
    phases, still = pairwise(run.phases), (Does.HOLD, Does.HALT)
    waits = [end - began for (began, _, does), (end, *_) in phases if does in still]
    return sum(waits) / 2.0, "simulated: the procedure of section 3.1 with the vehicle's own loop"


def _errors(vehicle: Vehicle) -> tuple[float, float, float]:
    """Return a vehicle's depth noise [m], neutral volume error [m3] and drift [m3/s], 1 sigma."""
    known, noise = vehicle.identified, vehicle.sensors.depth_noise
    if known is None:
        return noise, NEUTRAL_STD, DRIFT_STD
    drift = known.random_walk / math.sqrt(_DRIFT_TIME)
    return known.depth_noise or noise, known.neutral_std or NEUTRAL_STD, drift or DRIFT_STD


def _sample_time(vehicle: Vehicle) -> float:
    return vehicle.controller.sample_time if vehicle.controller is not None else 0.3


def _check(s: conditions.Setting, depth_noise: float | None) -> None:
    """Raise InputError for what no pool or sensor is; depth_noise: the noise where it was given."""
    if not (s.noise > 0.0 or s.quantum > 0.0):
        what = "it must be above 0 where there is no `depth_quantum=`: no sensor is without either"
        what = "the noise of the depth sensor is not known" if depth_noise is None else what
        remedy = "Give it, 1 sigma, like 2 mm: log the vehicle lying on the bottom to see it"
        raise InputError(what, field="depth_noise", value=depth_noise, unit="m", remedy=remedy)
    check_number(s.noise, "depth_noise", "m", least=0.0)
    check_number(s.quantum, "depth_quantum", "m", least=0.0)
    check_number(s.sample_time, "sample_time", "s", above=0.0)
    check_number(s.neutral_std, "neutral_std", "m3", above=0.0, most=math.inf)
    check_number(s.drift_std, "drift_std", "m3/s", least=0.0)
    check_number(s.delay_std, "delay_std", "s", least=0.0)
    check_number(s.clearance, "clearance", "m", above=0.0)
    check_number(s.rest, "rest", "s", least=0.0)
    check_number(s.longest, "max_record_time", "s", above=conditions.FEWEST * s.sample_time)
    check_number(s.largest, "max_volume_change", "m3", above=0.0, most=math.inf)
    check_number(s.moves, "max_moves", "", least=1)
    if s.deepest - s.shallowest < _LEAST_TRAVEL:
        ends = f"{s.clearance:g} m from surface and bottom"
        what = f"a pool of {s.bottom_depth:g} m leaves no travel, {ends}"
        remedy = "Choose a deeper pool or a smaller `clearance=`"
        raise InputError(what, field="bottom_depth", value=s.bottom_depth, unit="m", remedy=remedy)


def _rival(
    vehicle: Vehicle,
    against: Sequence[float] | None,
    limits: conditions.Ramps,
    setting: conditions.Setting,
) -> list[conditions.Release]:
    """Return the releases to compare with; raises InputError for what the stroke cannot do."""
    if against is None:
        fits = all(limits.least <= dV <= limits.most for dV in PAPER)
        own = isinstance(vehicle.motion, IdentifiedMotion)
        return paper_steps(PAPER, setting) if fits and own else []
    for dV in against:
        if dV == 0.0 or not limits.least <= dV <= limits.most:
            within = f"{1e6 * limits.least:.0f} to {1e6 * limits.most:.0f} cm3"
            what = f"this change of volume is not within {within}, or none"
            value, remedy = f"{1e6 * dV:g} cm3", "Choose others"
            raise InputError(what, field="against", value=value, unit="cm3", remedy=remedy)
    return paper_steps(against, setting)


def _rival_name(against: Sequence[float] | None) -> str:
    if against is None or tuple(against) == PAPER:
        return "the paper's eight"
    return f"steps of {', '.join(f'{1e6 * dV:g}' for dV in against)} cm3"


def _assumptions(c: conditions.Conditions, how: str, count: int) -> tuple[str, ...]:
    q, s = c.question, c.setting
    known = "not known"
    if math.isfinite(s.neutral_std):
        known = f"known to {format_quantity(s.neutral_std, 'm3', 'cm3', 2)}"
    said = [
        f"drag law: {q.model.law}",
        f"depths every {s.sample_time:g} s, with a noise of {1e3 * s.depth_noise:.2g} mm (1 sigma, "
        "rounding included), white",
        f"each record begins {s.rest:g} s before the release; its neutral volume is {known} and "
        f"drifts by {format_quantity(60.0 * s.drift_std, 'm3', 'cm3', 2)} a minute (1 sigma)",
        f"the stamps of the volumes are late by {s.delay_std:.3g} s (1 sigma)",
        sentence("motion", "has inexact volumes"),
        f"{s.settling:.0f} s until at rest before a release ({how})",
        f"good on average over {count} vehicles of the parameter region",
        "volumes and depths are measured without an error of scale: 1 % of either is 1 % of K2",
    ]
    said += [f"prior: {n} = {p.mean:g} +- {p.std:g} {NAMES[n].unit}" for n, p in q.priors.items()]
    said += [f"held: {name} = {value:g} {NAMES[name].unit}" for name, value in q.fixed.items()]
    return tuple(said)
