"""From logs to parameters: the experiments, the fit, and everything that is said of it.

What is asked is refused where it cannot be. The fit's numbers become estimates: parameters with
their intervals, and what follows from them. Profile likelihoods hold one parameter and fit all
others again. Each log has numbers of its own.

What a fit with process noise says: parameters, logs, findings, and the vehicle that it makes.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice, pairwise
from typing import get_args

import numpy as np
from scipy.interpolate import PchipInterpolator
from threadpoolctl import threadpool_limits

from swimbladder.errors import InputError, NoAnswerError, check_number
from swimbladder.estimation.comparison.misread import Drive, is_still, misread
from swimbladder.estimation.comparison.record import Record, record, warmed, water_of_each
from swimbladder.estimation.estimates import (
    DRIFT_STD,
    Z95,
    Estimate,
    Finding,
    Prior,
    bounded_fit,
    check_distinct,
    read_priors,
    read_values,
    sentence,
)
from swimbladder.estimation.kalman import GATE
from swimbladder.estimation.motion import diagnose
from swimbladder.estimation.motion.fit import Fit, inverse_of, unstable, white_part
from swimbladder.estimation.motion.fit import fit as solve
from swimbladder.estimation.motion.posterior import sample, sampling_library
from swimbladder.estimation.motion.problem import (
    DELAY,
    NAMES,
    UNITS,
    Assumed,
    Experiment,
    Problem,
    default_names,
    posed,
)
from swimbladder.estimation.motion.process_noise import (
    EARLY,
    EARLY_STD,
    SIGNIFICANT,
    Heat,
    Height,
    ProcessNoiseFit,
    Track,
    described,
    fit_process_noise,
    height_of,
    highest_with_noise,
    with_heat,
)
from swimbladder.estimation.motion.result import (
    FEWEST,
    Asked,
    Choice,
    ExperimentFit,
    Identification,
    ProcessNoise,
    Profile,
    Values,
    between_logs,
    dry_mass,
    held_values,
    identified_vehicle,
    mass_and_drag,
    neutral_spread,
    trim_of,
)
from swimbladder.estimation.series import rms
from swimbladder.io.logs import Log
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.physics.hull import heat_expansion
from swimbladder.physics.seawater import Column
from swimbladder.units import format_quantity
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.schema import check_choice

_COARSE = 1e-3  # of the stroke, a step in which volumes are recorded, to say so
_TO_AND_FRO = 4.0  # standard deviations: 95 % is between


def with_process_noise(
    fit: ProcessNoiseFit,
    vehicle: Vehicle,
    problem: Problem,
    assumptions: tuple[str, ...],
    asked: Asked,
) -> Identification:
    """Return the identification of a fit with process noise.

    With enough records, and where it was asked for, the vehicle has their random effects too, and
    is that of the means over them. What belongs to a single log is from the filter along it.
    """
    each = tuple(
        _experiment(e, track, fit.values["psi"])
        for e, track in zip(problem.experiments, fit.tracks, strict=True)
    )
    parameters, contradicted = diagnose.against_prior(problem, fit.estimates)
    allowed = [*["has process noise"] * (not fit.white), "has inexact volumes"]
    if "drag_quadratic" in fit.names and problem.model.law == "blended":  # it may be 0
        e = parameters["drag_quadratic"]
        low, high = Estimate.of(e.value, e.std, e.unit).ci95
        parameters["drag_quadratic"] = replace(e, ci95=(max(low, 0.0), high))
    derived = mass_and_drag(problem.model, fit.names, fit.values, fit.covariance)
    listed = compare_models(fit, vehicle, problem) if asked.choices else ()
    findings = [
        *_not_identifiable(fit, problem),
        *diagnose.not_determined(problem, parameters),
        *diagnose.judge(listed),
        *diagnose.drifts(each, "drift seen"),
        *diagnose.outliers(each),
        *diagnose.neutral_beyond_prior(problem, [track.neutral_off for track in fit.tracks]),
        *diagnose.possible(problem, derived, parameters, dry_mass(vehicle)),
        *diagnose.sinks_as_it_grows(problem),
        *_wanders(fit, problem),
        *contradicted,
        *diagnose.late(fit.delay, problem.delay_std, fit.values[EARLY.name] / EARLY_STD),
        *_recorded(problem, vehicle),
        Finding.of("motion", "volumes inexact") if fit.white else _summary(fit),
    ]
    if asked.posterior is not None:
        findings.append(Finding.of("motion", "no draws of a filter" if fit.white else "no draws"))
    turned = [f for f in findings if f.kind == "backwards"]
    findings = turned or findings  # what follows from it need not be said
    new, noise = vehicle, fit.noise
    sensor = math.hypot(noise.depth, noise.correlated)
    if all(f.severity != "no" for f in findings):
        records = [e.record for e in problem.experiments]
        logs, trim = tuple(e.source for e in each), trim_of(each, vehicle)
        new = identified_vehicle(
            vehicle,
            problem.model,
            Values(fit.names, fit.values, fit.covariance, logs, trim),
            depth_noise=noise.depth,
            random_walk=noise.random_walk,
            neutral_std=neutral_spread(each, problem.neutral_std, single=0.0),
            acceleration_noise=noise.acceleration,
        )
        if asked.process_noise == "always" and len(records) >= FEWEST:
            new = between_logs(records, new)
            findings.append(_differ(new))
    return Identification(
        names=fit.names,
        law=problem.model.law,
        parameters={**parameters, **held_values(problem)},
        derived=derived,
        covariance=fit.covariance,
        experiments=each,
        findings=tuple(findings),
        choices=listed,
        profiles={},
        assumptions=(*assumptions, *(sentence("motion", how) for how in allowed)),
        priors=dict(problem.priors),
        neutral_std=problem.neutral_std,
        notes=tuple(dict.fromkeys(note for e in each for note in e.record.notes)),
        depth_noise=sensor,
        sensor_noise=noise.depth,
        process_noise=fit,
        volume_delay=fit.delay,
        result_vehicle=new,
    )


def compare_models(fit: ProcessNoiseFit, vehicle: Vehicle, problem: Problem) -> tuple[Choice, ...]:
    """Return every drag law, with psi as it is and otherwise, each with process noise."""

    def solved(other: Problem, begins: diagnose.Begins[Height]) -> Height:
        """Return the best of the fits that begin where other models ended."""
        starts = [
            {**one.values, **diagnose.begin_of(other, its, one.values, held=held)}
            for its, one, held in begins
        ]
        return height_of(other, vehicle, starts, white=fit.white)

    parts = [(t.innovation[t.used], t.deviation[t.used]) for t in fit.tracks]
    own = Height(fit.values, fit.log_likelihood, *np.concatenate(parts, axis=1))
    found = []
    for other, psi, at in diagnose.compared(problem, own, vehicle, solved):
        kept = np.abs(at.innovation) < GATE * at.deviation
        left = rms(at.innovation[kept]) if kept.any() else math.nan
        more = {"rms": left, "log_likelihood": at.height, "reported": other is problem}
        found.append(Choice.of(other, psi, at.values, len(at.innovation), **more))
    return diagnose.with_probabilities(found)


def _experiment(e: Experiment, track: Track, psi: float) -> ExperimentFit:
    """Return what the filter along a log says of it: how far the next sample is off, its start."""
    used, record = track.used, e.record
    first, last = int(used[0]), int(used[-1])
    at = track.smoothed[first]
    std = np.sqrt(np.maximum(np.diag(track.covariance[first]), 0.0))
    own = np.array([[e.error(float(at[2]), psi), std[2]], [at[0], std[0]], [at[1], std[1]]])
    span = float(record.time[last] - record.time[first])
    went = float(track.smoothed[last, 2] - at[2]) / span
    unsure = math.hypot(std[2], math.sqrt(max(float(track.covariance[last][2, 2]), 0.0))) / span
    weight, innovation = track.weight, track.innovation[used]
    white = innovation / track.deviation[used] * np.sqrt(weight[used])
    kept = weight[used] >= 0.5
    return ExperimentFit.of(
        e,
        own,
        white,
        residual=track.innovation,
        weight=weight,
        drift=Estimate.of(went, unsure, "m3/s"),
        noise=float(np.sqrt(np.mean(track.deviation[used] ** 2))),
        rms=rms(innovation[kept]) if kept.any() else math.nan,
    )


def _not_identifiable(fit: ProcessNoiseFit, problem: Problem) -> Iterator[Finding]:
    for i, (name, e) in enumerate(fit.estimates.items()):
        size = abs(e.value) if problem.logarithmic[i] else problem.scale[i]
        if e.std > diagnose.limit(problem, fit.values, i) * size:
            said = diagnose.in_percent(e.std / max(abs(e.value), 1e-300))
            yield Finding.of("motion", "unidentified with it", name=name, share=said)


def _wanders(fit: ProcessNoiseFit, problem: Problem) -> Iterator[Finding]:
    """Yield in which logs the neutral volume would have to go farther than the volume did.

    White acceleration is a neutral volume that moves about too: by so much over the time in which
    the speed settles, to both sides.
    """
    model, (laminar, turbulent) = problem.model, problem.model.drag(fit.values)
    for e, track, went in zip(problem.experiments, fit.tracks, fit.travelled, strict=True):
        moved, speed = float(np.std(e.inputs[track.used])), rms(track.smoothed[track.used, 1])
        damped = model.mass(fit.values) * (laminar + 2.0 * turbulent * speed)
        shaken = fit.noise.acceleration * math.sqrt(damped) / model.specific_weight
        if (far := went + _TO_AND_FRO * shaken) > moved:
            yield Finding.of("motion", "wanders", log=e.source, went=far, moved=moved)


def _recorded(problem: Problem, vehicle: Vehicle) -> Iterator[Finding]:
    """Yield which volumes are recorded in coarse steps."""
    for e in problem.experiments:
        if e.record.quantum > _COARSE * (vehicle.stroke.maximum - vehicle.stroke.minimum):
            yield Finding.of("motion", "coarse volumes", log=e.source, step=e.record.quantum)


def _differ(vehicle: Vehicle) -> Finding:
    known = vehicle.identified
    assert known is not None  # it was just identified
    assert known.between is not None
    b = known.between
    values = zip(known.names, known.values, strict=True)
    means = ", ".join(f"{name} = {value:.4g} {NAMES[name].unit}" for name, value in values)
    drift = f"{3.6e9 * b.neutral_drift:.2g} +- {3.6e9 * b.neutral_drift_std:.2g}"
    return Finding.of("motion", "logs differ", psi=b.psi, drag=b.drag, drift=drift, means=means)


def _summary(fit: ProcessNoiseFit) -> Finding:
    minute = math.sqrt(60.0)
    drift = fit.noises["random_walk"]
    low, high = (f"{1e6 * minute * end:.2g}" for end in drift.ci95)
    unsure = ", which the logs do not require"
    moves = "does not quite move" if fit.p_any < SIGNIFICANT else "moves"
    texts = {"low": low, "high": high, "sure": "" if fit.drifts else unsure, "moves": moves}
    numbers = {"minute": minute * drift.value, "p": fit.p_value, "farthest": max(fit.travelled)}
    numbers["acceleration"] = fit.noises["acceleration"].value
    return Finding.of("motion", "process_noise", **texts, **numbers)


_CLEARLY = 3.0  # of log likelihood
_NO_SENSORS = 2e-4  # m: a noise of simulations, which how the volume goes between samples makes
_AT = (0.7, 1.4, 2.1, 2.8)  # standard deviations to either side
_EVALUATIONS = 30  # more than ever needed but on long records of an unstable motion
_FURTHER = (4.0, 6.0, 9.0)  # where the interval has not ended by then


def profile(problem: Problem, fit: Fit, i: int) -> Profile:
    """Return the profile of the i-th parameter of the vehicle.

    The weights and the noise stay those of the fit. The deviance is scaled by how much wider
    autocorrelated residuals make the interval (the vertical adjustment of Chandler and Bate 2007).
    """
    spread, ridge, ratio = _across(fit, i)
    others = np.delete(np.arange(len(fit.x)), i)
    low, high = problem.bounds()

    def held(u: float, start: Array) -> tuple[float, Array]:
        """Return (deviance, the other parameters) of the fit with the i-th held at u."""

        def full(y: Array) -> Array:
            return np.insert(y, i, u)

        def rows(y: Array) -> Array:
            return problem.weighted(full(y), fit.root)

        def slopes(y: Array) -> Array:
            return -problem.weighted_slope(full(y), fit.root)[:, others]

        ends, limits = (1e-6, 1e-6, 1e-8), (low[others], high[others])
        cost, y = bounded_fit(rows, slopes, start, limits, ends=ends, most=_EVALUATIONS, edge=1e-9)
        return 2.0 * cost, y

    at_best, _ = held(fit.x[i], fit.x[others])
    entries, deviance = [fit.x[i]], [0.0]
    for side in (-1.0, 1.0):
        x, before = fit.x[others], fit.x[i]
        for k in (*_AT, *_FURTHER):
            u = fit.x[i] + side * k * spread
            if not low[i] < u < high[i] or (k in _FURTHER and deviance[-1] > 1.2 * Z95**2):
                break
            cost, x = held(u, x + ridge[others] * (u - before))
            before = u
            entries.append(u)
            deviance.append(max(cost - at_best, 0.0) * ratio)
    order = np.argsort(entries)
    u, D = np.array(entries)[order], np.array(deviance)[order]
    ends = _interval(u, D, fit.x[i])
    name, (low_end, high_end) = problem.names[i], problem.values_of(i, ends).tolist()
    return Profile(name, NAMES[name].unit, problem.values_of(i, u), D, (low_end, high_end))


def _across(fit: Fit, i: int) -> tuple[float, Array, float]:
    """Return the deviation of entry i, by how much all go with it, and the deviance's scale."""
    spread, plain = math.sqrt(fit.covariance[i, i]), inverse_of(fit.information)[:, i]
    naive = max(float(plain[i]), 1e-300)
    return spread, plain / naive, naive / spread**2


_BENT = 0.15  # of the deviance at the ends of an interval


def bent(problem: Problem, fit: Fit, i: int) -> bool:
    """Return whether the deviance at the ends of the i-th interval is not as the curvature has it.

    There the interval has to be that of the profile.
    """
    spread, ridge, ratio = _across(fit, i)
    best = problem.weighted(fit.x, fit.root)
    for side in (-Z95, Z95):
        x = np.clip(fit.x + side * spread * ridge, *problem.bounds())
        rows = problem.weighted(x, fit.root)
        if not abs(ratio * float(rows @ rows - best @ best) / Z95**2 - 1.0) < _BENT:
            return True
    return False


def _interval(u: Array, deviance: Array, best: float) -> Array:
    """Return where the signed root of the deviance passes -1.96 and 1.96; infinite if nowhere."""
    root = np.maximum.accumulate(np.sign(u - best) * np.sqrt(deviance)) + 1e-9 * np.arange(len(u))
    inverse = PchipInterpolator(root, u, extrapolate=False)
    ends = inverse([-Z95, Z95])
    return np.where(np.isfinite(ends), ends, [-np.inf, np.inf])


_OFF = 0.1  # of the half interval, from which the profile's interval is given


def parameters(
    problem: Problem, found: Fit, drawn: Mapping[str, Profile]
) -> tuple[dict[str, Estimate], list[Finding]]:
    """Return the estimates; where a profile's interval differs from the quadratic one, with it."""
    std = np.sqrt(np.diag(found.covariance)[: problem.shared]) * problem.per_entry(found.x)
    estimates: dict[str, Estimate] = {}
    for i, name in enumerate(problem.names):
        value, unit = problem.value(found.x, i), NAMES[name].unit
        log = problem.logarithmic[i]
        estimates[name] = Estimate.of(value, float(std[i]), unit, logarithmic=log)
    estimates, findings = diagnose.against_prior(problem, estimates)
    for name, e in estimates.items():
        if name in drawn:
            ends = drawn[name].ci95
            half = 0.5 * (e.ci95[1] - e.ci95[0])
            apart = max(abs(a - b) for a, b in zip(ends, e.ci95, strict=True))
            if not apart <= _OFF * half:
                e = estimates[name] = replace(e, ci95=ends)
                findings.append(Finding.of("motion", "profile", name=name))
        if name == "drag_quadratic" and e.ci95[0] < 0.0:  # it is never below 0
            estimates[name] = replace(e, ci95=(0.0, e.ci95[1]))
    return {**estimates, **held_values(problem)}, findings


_STILL = 1e-4  # m, below which no sensor measures


def check_logs(
    logs: Sequence[Log], neutral_std: float | None, speed_std: float, drive: Drive | None
) -> None:
    """Raise InputError for no log, or for a deviation or drive that cannot be."""
    if not logs:
        raise InputError("no log is given", field="LOG", remedy="Give at least one log")
    check_distinct(logs)
    check_std("neutral_std", neutral_std, "m3")
    check_std("speed_std", speed_std, "m/s")
    what = "this does not drive the vehicle's model by itself"
    check_choice(drive, ("volume", "voltage"), what, field="drive")


def check_std(field: str, value: float | None, unit: str) -> None:
    """Raise InputError for a standard deviation that is not above 0."""
    remedy = "Give a standard deviation, or none for no assumption"
    check_number(value, field, unit, above=0.0, most=math.inf, remedy=remedy)


def check_nuisances(drift_std: float, delay_std: float) -> None:
    """Raise InputError for deviations of drift [m3/s] and delay [s] that cannot be."""
    remedy = "Give a standard deviation, 0 for none"
    for field, value, unit in (("drift_std", drift_std, "m3/s"), ("delay_std", delay_std, "s")):
        check_number(value, field, unit, least=0.0, remedy=remedy)


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
    if problem.drift_std > 0.0:
        std = format_quantity(60.0 * problem.drift_std, "m3", "cm3", digits=3)
        said.append(f"each log's neutral volume drifts by {std} a minute (1 sigma)")
    if problem.delay_std > 0.0 and all(e.ramps for e in problem.experiments):
        std = format_quantity(problem.delay_std, "s", "s", digits=3)
        said.append(f"the stamps of the volumes are late by {std} (1 sigma)")
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
DELAY_STD = 0.2  # s


def identify(
    logs: Sequence[Log],
    vehicle: Vehicle,
    *,
    free: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None,
    priors: Mapping[str, Prior] | None = None,
    drag: str | None = None,
    neutral_std: float | None = None,
    speed_std: float = math.inf,
    drift_std: float = DRIFT_STD,
    delay_std: float = DELAY_STD,
    drive: Drive | None = None,
    bottom_depth: float = math.inf,
    surface_margin: float = 0.1,
    profiles: bool = True,
    choices: bool = True,
    process_noise: ProcessNoise = "auto",
    posterior: int | None = None,
    casts: Sequence[Column] = (),
    advance: Advance = silent,
) -> Identification:
    """Identify the parameters that make the vehicle's model meet all logs together, with intervals.

    Maximum likelihood on depth: each log is an experiment with its own neutral volume, noise and
    starts. Where the vehicle does not quite move as the model has it, there is process noise, and
    the likelihood is that of a Kalman filter's innovations.

    Parameters
    ----------
    logs
        As `read_log` returns them; one or more.
    vehicle
        As `load_vehicle` returns it.
    free
        Names of what is identified, see `NAMES`; none: the drag law's parameters and psi.
    fixed
        By name, values in SI that are not identified.
    priors
        By name, what is known of what is identified.
    drag
        linear, quadratic or blended; none: the vehicle's own law.
    neutral_std
        1 sigma of what is known of a log's neutral volume [m3], infinite for nothing; none: 0.5 cm3
        where a log's volume has a zero of its own, at rest, and nothing where it counts from
        mid-stroke, or the logs say otherwise.
    speed_std
        Of the vehicle's speed at the start about 0, 1 sigma [m/s]; infinite: it is not known.
    drift_std
        Of how fast each log's neutral volume grows, 1 sigma [m3/s].
    delay_std
        Of how late the stamps of the volumes are, the same for all logs, 1 sigma [s].
    drive
        volume or voltage; none: the volume where a log has it, else the voltage.
    bottom_depth
        Depth of the bottom [m]; infinite: there is none.
    surface_margin
        Samples less than this below the depth of emergence are left out [m].
    profiles
        Whether each parameter gets its likelihood profile.
    choices
        Whether other models of the same data are compared.
    process_noise
        always, never, or auto: where the logs show it.
    posterior
        Seed of draws from the posterior, without process noise (needs emcee); none: there are none.
    casts
        The water of casts, one for all logs or one for each; none: of constant density.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    Identification
        The parameters, their intervals and why. What is not identifiable is among the findings, and
        `Identification.vehicle` raises NoAnswerError then.

    Raises
    ------
    InputError
        Logs, names and vehicle do not go together.
    NoAnswerError
        The depth never changes, or no filter follows the logs, or the draws do not settle.
    """
    check_logs(logs, neutral_std, speed_std, drive)
    check_nuisances(drift_std, delay_std)
    check_choice(process_noise, get_args(ProcessNoise), "no such mode", field="process_noise")
    if posterior is not None:
        sampling_library()
    waters = water_of_each(len(logs), casts)
    reader = partial(record, bottom_depth=bottom_depth, surface_margin=surface_margin)

    def read(log: Log, water: Column | None) -> Record:
        return reader(log, vehicle, drive=drive or driven_by(log, vehicle), column=water)

    records = [read(log, water) for log, water in zip(logs, waters, strict=True)]
    check_motion(records)
    known = neutral_std
    if known is None:  # only that of the vehicle before this log, if the volume has its own zero
        stays = any(r.drive == "volume" and r.volume_absolute for r in records)
        known = math.inf if stays else NEUTRAL_STD
    stated = read_values(fixed, UNITS), read_priors(priors, UNITS)
    assumed = Assumed(*stated, known, speed_std, drift_std, delay_std)
    problem = posed(records, vehicle, assumed, free=free, drag=drag)
    denser = [w and replace(w, density=w.density + w.density_std) for w in waters]
    deepest = max(float(r.depth.max()) for r in records)
    holes = any(
        w and (w.density_std[w.depth[: len(w.density_std)] <= deepest]).any() for w in waters
    )
    beside = [[read(r, water) for r, water in zip(logs, denser, strict=True)]] if holes else []
    advance(0.05)
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        asked = Asked(process_noise, profiles and not holes, choices, posterior)
        expands: tuple[Finding, ...] = ()
        aside: list[list[Record]] = []
        if (heat := _heat(problem, vehicle)) is not None:
            own = heat_expansion(vehicle)
            vehicle, expands = _expanded(vehicle, heat)
            aside = [[warmed(r, own + g, s) for r in records] for g, s in heat.aside.tolist()]
            records, *beside = (
                [warmed(r, own + heat.gain.value, heat.lag.value) for r in these]
                for these in (records, *beside)
            )
            asked = asked._replace(profiles=False)
            problem = posed(records, vehicle, assumed, free=free, drag=drag)

        def others(known: Assumed) -> list[list[Problem]]:
            """Return the problems of other hulls, and of other water."""
            return [
                [posed(one, vehicle, known, free=free, drag=drag) for one in these]
                for these in (aside, beside)
            ]

        try:
            found = _answer(problem, vehicle, asked, advance, *others(assumed))
            if neutral_std is None and math.isfinite(known) and _contradicts_prior(found):
                nothing = assumed._replace(neutral_std=math.inf)
                problem = posed(records, vehicle, nothing, free=free, drag=drag)
                looser = _answer(problem, vehicle, asked, silent, *others(nothing))
                found = looser if _contradicts_prior(found, looser) else found
        except NoAnswerError as error:  # for the reason that is known
            named = next(_misread(records, vehicle), None)
            raise (error if named is None else NoAnswerError(named.sentence)) from None
    seen = (Finding.of("motion", "holes"),) if holes else ()
    found = replace(found, findings=(*found.findings, *expands, *seen))
    if found.identified or any(f.kind == "backwards" for f in found.findings):
        return found
    return replace(found, findings=(*found.findings, *_misread(records, vehicle)))


def _misread(records: Sequence[Record], vehicle: Vehicle) -> Iterator[Finding]:
    """Yield why logs may be as no vehicle's: volumes that never change, or a column read wrong."""
    if all(is_still(r.drive, r.inputs, vehicle) for r in records):
        yield Finding.of("compare", "still", drive=records[0].drive)
    wrong = (misread(rec, vehicle)[0] for rec in records)
    yield from islice((finding for finding in wrong if finding is not None), 1)


def _heat(problem: Problem, vehicle: Vehicle) -> Heat | None:
    """Return what the hull gains per kelvin; None where its temperature is not logged.

    It is estimated beside process noise: what a hull that cools does looks like a drift.
    """
    if problem.heat_std == 0.0 or not all(e.ramps for e in problem.experiments):
        return None
    return fit_process_noise(problem, vehicle).heat


def _expanded(vehicle: Vehicle, heat: Heat) -> tuple[Vehicle, tuple[Finding, ...]]:
    """Return the vehicle with a hull that expands so, where that is clear, and say so."""
    expanding = with_heat(vehicle, heat)
    said = "hull may expand" if expanding is vehicle else "hull expands"
    gain = heat.gain
    values = {"gain": 1e6 * gain.value, "std": 1e6 * gain.std, "lag": heat.lag.value}
    return expanding, (Finding.of("motion", said, **values),)


def _contradicts_prior(found: Identification, looser: Identification | None = None) -> bool:
    """Return whether the logs speak against the prior of their neutral volumes, which nobody gave.

    Beside what is found without: whether it is clearly less likely.
    """
    if any(f.kind == "neutral prior" for f in found.findings):
        return True
    own = found.process_noise
    if own is None or not own.p_any < SIGNIFICANT:
        return False
    other = None if looser is None else looser.process_noise
    return other is None or other.log_likelihood > own.log_likelihood + _CLEARLY


def _sensors(problem: Problem, found: Fit) -> Array:
    """Return the sensor's part of each experiment's noise [m]."""
    parts = zip(pairwise(problem.rows), found.noise, strict=True)
    return np.array([white_part(found.residual[a:b], found.weight[a:b], s) for (a, b), s in parts])


def _answer(
    problem: Problem,
    vehicle: Vehicle,
    asked: Asked,
    report: Advance,
    warmer: Sequence[Problem],
    denser: Sequence[Problem],
) -> Identification:
    """Return the answer with process noise where there is some, else without.

    warmer: the problems of a hull whose gain and lag are off by as much as they are not known;
    denser: in water that is off by as much as it is not known in the holes of a cast.
    """
    near: Array | None = None
    if asked.process_noise == "always" or all(e.ramps for e in problem.experiments):
        best = highest_with_noise(problem, vehicle)
        mode, noisy = asked.process_noise, best.depth_noise >= _NO_SENSORS
        lacks = noisy and best.significant
        if (white := best.white) and (mode == "never" or (mode == "auto" and not lacks)):
            best, near = white, white.begin()
            near = None if noisy and (best.inexact or unstable(problem, near)) else near
        if near is None:
            report(0.9)
            said, fit = assumptions(problem, vehicle), described(best)
            for other in denser:
                there = height_of(other, vehicle, [fit.values], white=fit.white).values
                fit = _widened(fit, problem, there)
            return with_process_noise(fit, vehicle, problem, said, asked)
    return _without_process_noise(problem, vehicle, asked, report, near, [*warmer, *denser])


def _widened(fit: ProcessNoiseFit, problem: Problem, there: Mapping[str, float]) -> ProcessNoiseFit:
    """Return a fit that allows for the values that its parameters have under another assumption."""
    moved = np.array([there[name] - fit.values[name] for name in fit.names])
    covariance, found = fit.covariance + np.outer(moved, moved), dict(fit.estimates)
    stds = np.sqrt(np.diag(covariance)).tolist()
    for name, std, log in zip(fit.names, stds, problem.logarithmic, strict=False):
        e = found[name]
        found[name] = Estimate.of(e.value, std, e.unit, logarithmic=log)
    return replace(fit, covariance=covariance, estimates=found)


def _without_process_noise(
    problem: Problem,
    vehicle: Vehicle,
    asked: Asked,
    report: Advance,
    near: Array | None,
    warmer: Sequence[Problem],
) -> Identification:
    """Return the answer of a fit whose residuals are noise of the depth.

    near: where it begins, as of `fit`. warmer: as of `_answer`.
    """
    names, model = problem.names, problem.model
    found = solve(problem, None if near is None else [near])
    for other in warmer:
        moved = solve(other, [found.x]).x - found.x
        found = replace(found, covariance=found.covariance + np.outer(moved, moved))
    report(0.35 if asked.choices or asked.profiles else 0.95)
    findings: list[Finding] = [
        *diagnose.not_identifiable(problem, diagnose.Curvature.of(problem, found))
    ]
    drawn: dict[str, Profile] = {}
    for i, name in enumerate(names):
        if not findings and (asked.profiles or bent(problem, found, i)):
            drawn[name] = profile(problem, found, i)
        report(0.3 / len(names) * asked.profiles)
    listed = diagnose.choices(problem, found, vehicle) if asked.choices else ()
    report(0.3 * asked.choices)
    each = diagnose.each_experiment(problem, found)
    findings += diagnose.judge(listed)
    per, p = problem.per_entry(found.x), problem.shared
    covariance = found.covariance[:p, :p] * np.outer(per, per)
    derived = mass_and_drag(model, names, problem.named(found.x), covariance)
    estimates, fewer = parameters(problem, found, drawn)
    samples = np.diff(problem.rows)
    noise, sensor = (
        float(np.sqrt(np.average(part**2, weights=samples)))
        for part in (found.noise, _sensors(problem, found))
    )
    findings += diagnose.not_determined(problem, estimates, noise / sensor)
    findings += diagnose.diagnose(problem, found, each)
    findings += diagnose.possible(problem, derived, estimates, dry_mass(vehicle))
    turned = [f for f in findings if f.kind == "backwards"]
    findings = turned or [*findings, *fewer]  # what follows from it need not be said
    identified, drawn_points = all(f.severity != "no" for f in findings), None
    if asked.posterior is not None and identified:
        drawn_points = sample(problem, found, asked.posterior, lambda part: report(2.0 * part))
    neutral_std = neutral_spread(each, problem.neutral_std, single=NEUTRAL_STD)
    std = math.sqrt(max(float(found.covariance[problem.delay_at, problem.delay_at]), 0.0))
    delay = Estimate.of(float(found.x[problem.delay_at]) * DELAY, std * DELAY, "s")
    findings += diagnose.late(delay, problem.delay_std)
    new, logs = vehicle, tuple(e.source for e in each)
    if identified:
        known = Values(names, problem.named(found.x), covariance, logs, trim_of(each, vehicle))
        new = identified_vehicle(vehicle, model, known, depth_noise=sensor, neutral_std=neutral_std)
    return Identification(
        names=names,
        law=model.law,
        parameters=estimates,
        derived=derived,
        covariance=covariance,
        experiments=each,
        findings=tuple(findings),
        choices=listed,
        profiles=drawn if asked.profiles else {},
        assumptions=assumptions(problem, vehicle),
        priors=dict(problem.priors),
        neutral_std=problem.neutral_std,
        notes=tuple(dict.fromkeys(note for e in each for note in e.record.notes)),
        depth_noise=noise,
        sensor_noise=sensor,
        volume_delay=delay,
        posterior=drawn_points,
        result_vehicle=new,
    )
