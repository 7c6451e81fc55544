"""From logs to parameters: the experiments, the fit, and everything that is said of it.

What is asked is refused where it cannot be. The fit's numbers become estimates: parameters with
their intervals, and what follows from them. Profile likelihoods hold one parameter and fit all
others again. Each log has numbers of its own.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from threadpoolctl import threadpool_limits

from swimbladder.errors import InputError, NoAnswerError, check_number
from swimbladder.estimation.comparison.record import Drive, Record, record, water_of_each
from swimbladder.estimation.estimates import Z95, Estimate, Finding, Prior, bounded_fit
from swimbladder.estimation.motion.diagnose import choices as list_choices
from swimbladder.estimation.motion.diagnose import (
    diagnose,
    each_experiment,
    judge,
    not_identifiable,
)
from swimbladder.estimation.motion.fit import Fit, inverse_of
from swimbladder.estimation.motion.fit import fit as solve
from swimbladder.estimation.motion.noise import white_part
from swimbladder.estimation.motion.posterior import sample
from swimbladder.estimation.motion.problem import NAMES, Assumed, Problem, default_names, posed
from swimbladder.estimation.motion.random_walk import fit_random_walk, with_random_walk
from swimbladder.estimation.motion.result import (
    Identification,
    Profile,
    Values,
    dry_mass,
    identified_vehicle,
    neutral_spread,
    trim_of,
)
from swimbladder.estimation.series import Array
from swimbladder.io.logs import Log
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.seawater import Column
from swimbladder.units import format_quantity, shown_unit
from swimbladder.vehicle import Vehicle

_AT = (0.7, 1.4, 2.1, 2.8)  # standard deviations to either side
_EVALUATIONS = 30  # more than ever needed but on long records of an unstable motion
_FURTHER = (4.0, 6.0, 9.0)  # where the interval has not ended by then


def profile(problem: Problem, fit: Fit, i: int) -> Profile:
    """Return the profile of the i-th parameter of the vehicle.

    The weights and the noise stay those of the fit. The deviance is scaled by how much wider
    autocorrelated residuals make the interval (the vertical adjustment of Chandler and Bate 2007).
    """
    spread = math.sqrt(fit.covariance[i, i])
    plain = inverse_of(fit.information)[:, i]
    naive = max(float(plain[i]), 1e-300)
    ratio = naive / spread**2
    others = np.delete(np.arange(len(fit.x)), i)
    low, high = problem.bounds()

    def held(u: float, start: Array) -> tuple[float, Array]:
        def full(y: Array) -> Array:
            x = np.empty(len(fit.x))
            x[i], x[others] = u, y
            return x

        def rows(y: Array) -> Array:
            return problem.weighted(full(y), fit.root)

        def slopes(y: Array) -> Array:
            return -problem.weighted_slope(full(y), fit.root)[:, others]

        ends, limits = (1e-6, 1e-6, 1e-8), (low[others], high[others])
        cost, y = bounded_fit(rows, slopes, start, limits, ends=ends, most=_EVALUATIONS, edge=1e-9)
        return 2.0 * cost, y

    at_best, _ = held(fit.x[i], fit.x[others])
    entries, deviance = [fit.x[i]], [0.0]
    ridge = plain[others] / naive
    for side in (-1.0, 1.0):
        x, before = fit.x[others], fit.x[i]
        for k in (*_AT, *_FURTHER):
            u = fit.x[i] + side * k * spread
            if not low[i] < u < high[i] or (k in _FURTHER and deviance[-1] > 1.2 * Z95**2):
                break
            cost, x = held(u, x + ridge * (u - before))
            before = u
            entries.append(u)
            deviance.append(max(cost - at_best, 0.0) * ratio)
    order = np.argsort(entries)
    u, D = np.array(entries)[order], np.array(deviance)[order]
    ends = _interval(u, D, fit.x[i])
    name, (low_end, high_end) = problem.names[i], problem.values_of(i, ends).tolist()
    return Profile(name, NAMES[name].unit, problem.values_of(i, u), D, (low_end, high_end))


def _interval(u: Array, deviance: Array, best: float) -> Array:
    """Return where the signed root of the deviance passes -1.96 and 1.96; infinite if nowhere."""
    root = np.maximum.accumulate(np.sign(u - best) * np.sqrt(deviance)) + 1e-9 * np.arange(len(u))
    inverse = PchipInterpolator(root, u, extrapolate=False)
    ends = inverse([-Z95, Z95])
    return np.where(np.isfinite(ends), ends, [-np.inf, np.inf])


_OFF = 0.1  # of the half interval, from which the profile's interval is given
_PRIOR_ONLY = 0.9  # of the prior's deviation is left
_CONTRADICTED = 3.0  # standard deviations from the prior


def parameters(
    problem: Problem, found: Fit, drawn: Mapping[str, Profile]
) -> tuple[dict[str, Estimate], list[Finding]]:
    """Return the estimates; where a profile's interval differs from the quadratic one, with it."""
    std = np.sqrt(np.diag(found.covariance)[: problem.shared]) * problem.per_entry(found.x)
    estimates: dict[str, Estimate] = {}
    findings: list[Finding] = []
    for i, name in enumerate(problem.names):
        unit, log = NAMES[name].unit, problem.logarithmic[i]
        e = Estimate.of(problem.value(found.x, i), float(std[i]), unit, logarithmic=log)
        prior = problem.priors.get(name)
        if prior is not None:
            findings += _against(name, e, prior)
        if prior is not None and e.std > _PRIOR_ONLY * prior.std:
            e = replace(e, origin="prior")
            findings.append(Finding.of("motion", "adds little", name=name))
        if name in drawn:
            ends = drawn[name].ci95
            half = 0.5 * (e.ci95[1] - e.ci95[0])
            apart = max(abs(a - b) for a, b in zip(ends, e.ci95, strict=True))
            if not apart <= _OFF * half:
                e = replace(e, ci95=ends)
                findings.append(Finding.of("motion", "profile", name=name))
        if name == "drag_quadratic" and not log:  # it is never below 0
            e = replace(e, ci95=(max(e.ci95[0], 0.0), e.ci95[1]))
        estimates[name] = e
    for name in ("psi",) if problem.model.law == "quadratic" else ("K2", "T2", "psi"):
        estimates.setdefault(name, Estimate.given(problem.values[name], NAMES[name].unit))
    return estimates, findings


def _against(name: str, e: Estimate, prior: Prior) -> Iterator[Finding]:
    """Yield a warning where data and prior can hardly both be right."""
    shift = math.sqrt(max(prior.std**2 - e.std**2, 0.0))  # of the estimate, if the prior is right
    if abs(e.value - prior.mean) > _CONTRADICTED * max(shift, 0.1 * prior.std):
        found, mean, std = (
            format_quantity(value, e.unit, shown_unit(e.unit), digits=3)
            for value in (e.value, prior.mean, prior.std)
        )
        yield Finding.of("motion", "contradicts", name=name, found=found, mean=mean, std=std)


def derived(problem: Problem, found: Fit) -> dict[str, Estimate]:
    """Return what follows of mass and laminar drag, by the delta rule."""
    if problem.model.law == "quadratic":
        return {}
    p = problem.shared
    C = found.covariance[:p, :p]

    def of(quantity: Callable[[Mapping[str, float]], float], unit: str) -> Estimate:
        at = quantity(problem.named(found.x))
        slope = np.zeros(p)
        for i in range(p):
            moved = found.x.copy()
            moved[i] += 1e-5
            slope[i] = (quantity(problem.named(moved)) - at) / 1e-5
        std = math.sqrt(max(float(slope @ C @ slope), 0.0))
        return Estimate.of(at, std, unit, logarithmic=True)

    k_b = problem.model.specific_weight
    return {"mass": of(problem.model.mass, "kg"), "drag": of(lambda v: k_b / v["K2"], "N s/m")}


_STILL = 1e-4  # m, below which no sensor measures


def check_logs(
    logs: Sequence[Log], neutral_std: float, speed_std: float, drive: Drive | None
) -> None:
    """Raise InputError for no log, or for a deviation or drive that cannot be."""
    if not logs:
        raise InputError("no log is given", field="LOG", remedy="Give at least one log")
    check_std("neutral_std", neutral_std, "m3")
    check_std("speed_std", speed_std, "m/s")
    if drive not in (None, "volume", "voltage"):
        what = "this does not drive the vehicle's model by itself"
        raise InputError(what, field="drive", value=drive, remedy="Choose volume or voltage")


def check_std(field: str, value: float, unit: str) -> None:
    """Raise InputError for a standard deviation that is not above 0."""
    remedy = "Give a standard deviation, or none for no assumption"
    check_number(value, field, unit, above=0.0, finite=False, remedy=remedy)


def check_motion(records: Sequence[Record]) -> None:
    """Raise NoAnswerError where no vehicle of the records moved by what a sensor resolves."""
    ranges = [float(np.ptp(r.depth[r.compared])) for r in records]
    if max(ranges) < _STILL:
        rests = f"the depth stays at {float(records[0].depth[records[0].compared][0]):.4g} m"
        raise NoAnswerError(
            f"the vehicle's motion is not identifiable: {rests}. Check which column is the depth, "
            "or record steps of the volume"
        )


def driven_by(log: Log, vehicle: Vehicle) -> Drive:
    """Return what drives the model: the volume where it is known, else the voltage."""
    if log.volume is not None or log.piston is not None or log.voltage is None:
        return "volume"
    return "voltage" if vehicle.voltage_driven else "volume"


def assumptions(problem: Problem, vehicle: Vehicle) -> tuple[str, ...]:
    """Return what the answer rests on: law, priors, what is held, the water."""
    said, records = [f"drag law: {problem.model.law}"], [e.record for e in problem.experiments]
    if math.isfinite(problem.neutral_std):
        std = format_quantity(problem.neutral_std, "m3", "cm3", digits=3)
        said.append(f"each log's neutral volume is known to {std} (1 sigma)")
    else:
        said.append("nothing is known of the logs' neutral volumes")
    if any(r.volume is not None and not r.volume_absolute for r in records):
        said.append("a volume without an absolute zero: neutral at the first sample's depth")
    if math.isfinite(problem.speed_std):
        std = format_quantity(problem.speed_std, "m/s", "mm/s", digits=3)
        said.append(f"each log starts at rest, to {std} (1 sigma)")
    for name, prior in problem.priors.items():
        said.append(f"prior: {name} = {prior.mean:g} +- {prior.std:g} {NAMES[name].unit}")
    held = sorted(default_names(problem.model.law, problem.names), key="psi".__ne__)
    said += [f"held: {name} = {problem.values[name]:g} {NAMES[name].unit}" for name in held]
    water = vehicle.water
    if any(len(r.layers.table) for r in records):
        beyond = "psi is what the hull loses beyond that"
        said.append(f"the neutral volume follows the density of the cast; {beyond}")
    said.append(f"water of {water.density:g} kg/m3, gravity {water.gravity:g} m/s2")
    return tuple(said)


NEUTRAL_STD = 0.5e-6  # m3


def identify(
    logs: Sequence[Log],
    vehicle: Vehicle,
    *,
    free: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None,
    priors: Mapping[str, Prior] | None = None,
    drag: str | None = None,
    neutral_std: float = NEUTRAL_STD,
    speed_std: float = math.inf,
    drive: Drive | None = None,
    bottom_depth: float = math.inf,
    surface_margin: float = 0.1,
    profiles: bool = True,
    choices: bool = True,
    random_walk: bool = False,
    posterior: int | None = None,
    columns: Sequence[Column] = (),
    advance: Advance = silent,
) -> Identification:
    """Return the parameters that make the vehicle's model meet all logs together, with intervals.

    Output-error maximum likelihood on depth: each log is an experiment with its own neutral
    volume, noise and starts. free: what is identified (see NAMES), the drag law's parameters and
    psi where not given; fixed: values in SI that are not; priors: by name; drag: linear, quadratic
    or blended, the vehicle's own where not given. neutral_std: 1 sigma [m3] of what is known of a
    log's neutral volume, inf for nothing; speed_std: of its speed at the start about 0 [m/s].
    drive: volume or voltage; bottom_depth [m]; surface_margin: samples less than this below the
    depth of emergence are left out [m]. random_walk: the neutral volumes are random walks, and the
    numbers those of the innovations' likelihood. posterior: seed of draws from it (needs emcee).
    columns: the water of casts, one for all logs or one for each; none: of constant density.
    advance: called with the share of the work done since last called.

    Raises InputError where logs, names and vehicle do not go together. What is not identifiable
    is among the findings, and Identification.vehicle raises NoAnswerError then.
    """
    check_logs(logs, neutral_std, speed_std, drive)
    waters = water_of_each(len(logs), columns)
    read = partial(
        record, vehicle=vehicle, bottom_depth=bottom_depth, surface_margin=surface_margin
    )
    records = [
        read(log, drive=drive or driven_by(log, vehicle), column=water)
        for log, water in zip(logs, waters, strict=True)
    ]
    check_motion(records)
    assumed = Assumed(dict(fixed or {}), dict(priors or {}), neutral_std, speed_std)
    problem = posed(records, vehicle, assumed, free=free, drag=drag)
    advance(0.05)
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        share = 0.3 if random_walk or posterior is not None else 1.0
        asked = Asked(profiles and not random_walk, choices and not random_walk, posterior)
        found = _answer(problem, vehicle, asked, lambda part: advance(share * part))
        if not random_walk:
            return found
        walked = fit_random_walk(problem, vehicle)
        advance(0.6)
        return with_random_walk(found, walked, vehicle, problem)


def _white(problem: Problem, found: Fit) -> Array:
    """Return the sensor's part of each experiment's noise [m]."""
    parts = zip(pairwise(problem.rows), found.noise, strict=True)
    return np.array([white_part(found.residual[a:b], found.weight[a:b], s) for (a, b), s in parts])


class Asked(NamedTuple):
    """What is to be found beside the parameters."""

    profiles: bool
    choices: bool
    posterior: int | None  # seed of draws


def _answer(problem: Problem, vehicle: Vehicle, asked: Asked, report: Advance) -> Identification:
    names, model = problem.names, problem.model
    found = solve(problem)
    report(0.35 if asked.choices or asked.profiles else 0.95)
    findings: list[Finding] = [*not_identifiable(problem, found)]
    drawn: dict[str, Profile] = {}
    for i, name in enumerate(names):
        if asked.profiles and not findings:
            drawn[name] = profile(problem, found, i)
        report(0.3 / len(names) * asked.profiles)
    listed = list_choices(problem, found, vehicle) if asked.choices else ()
    report(0.3 * asked.choices)
    each = each_experiment(problem, found)
    findings += judge(listed)
    findings += diagnose(problem, found, each, dry_mass=dry_mass(vehicle))
    turned = [f for f in findings if f.kind == "backwards"]
    findings = turned or findings  # what follows from it need not be said
    estimates, fewer = parameters(problem, found, drawn)
    findings += [] if turned else fewer
    identified, drawn_points = all(f.severity != "no" for f in findings), None
    if asked.posterior is not None and identified:
        drawn_points = sample(problem, found, asked.posterior, lambda part: report(2.0 * part))
    per, p = problem.per_entry(found.x), problem.shared
    covariance = found.covariance[:p, :p] * np.outer(per, per)
    samples = np.diff(problem.rows)
    noise, sensor = (
        float(np.sqrt(np.average(part**2, weights=samples)))
        for part in (found.noise, _white(problem, found))
    )
    neutral_std = neutral_spread(each, problem.neutral_std, single=NEUTRAL_STD)
    new, logs = vehicle, tuple(e.source for e in each)
    if identified:
        known = Values(names, problem.named(found.x), covariance, logs, trim_of(each, vehicle))
        new = identified_vehicle(vehicle, model, known, depth_noise=sensor, neutral_std=neutral_std)
    return Identification(
        names=names,
        law=model.law,
        parameters=estimates,
        derived=derived(problem, found),
        covariance=covariance,
        experiments=each,
        findings=tuple(findings),
        choices=listed,
        profiles=drawn,
        assumptions=assumptions(problem, vehicle),
        priors=dict(problem.priors),
        neutral_std=problem.neutral_std,
        notes=tuple(dict.fromkeys(note for e in each for note in e.record.notes)),
        depth_noise=noise,
        sensor_noise=sensor,
        posterior=drawn_points,
        result_vehicle=new,
    )
