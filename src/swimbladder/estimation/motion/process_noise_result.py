"""What a fit with process noise says: parameters, logs, findings, and the vehicle that it makes."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from swimbladder.estimation.estimates import Estimate, Finding, sentence
from swimbladder.estimation.kalman.depth_filter import GATE
from swimbladder.estimation.motion.diagnose import (
    Begins,
    against_prior,
    begin_of,
    compared,
    drifts,
    in_percent,
    judge,
    late,
    limit,
    neutral_beyond_prior,
    not_determined,
    outliers,
    possible,
    sinks_as_it_grows,
    with_probabilities,
)
from swimbladder.estimation.motion.problem import NAMES, Experiment, Problem
from swimbladder.estimation.motion.process_noise import (
    EARLY,
    EARLY_STD,
    SIGNIFICANT,
    Height,
    ProcessNoiseFit,
    Track,
    height_of,
)
from swimbladder.estimation.motion.random_effects import FEWEST, between_logs
from swimbladder.estimation.motion.result import (
    Asked,
    Choice,
    ExperimentFit,
    Identification,
    Values,
    dry_mass,
    held_values,
    identified_vehicle,
    mass_and_drag,
    neutral_spread,
    trim_of,
)
from swimbladder.estimation.series import rms
from swimbladder.vehicle import Vehicle

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
    parameters, contradicted = against_prior(problem, fit.estimates)
    if "drag_quadratic" in fit.names and problem.model.law == "blended":  # it may be 0
        e = parameters["drag_quadratic"]
        low, high = Estimate.of(e.value, e.std, e.unit).ci95
        parameters["drag_quadratic"] = replace(e, ci95=(max(low, 0.0), high))
    derived = mass_and_drag(problem.model, fit.names, fit.values, fit.covariance)
    listed = compare_models(fit, vehicle, problem) if asked.choices else ()
    findings = [
        *_not_identifiable(fit, problem),
        *not_determined(problem, parameters),
        *judge(listed),
        *drifts(each, "drift seen"),
        *outliers(each),
        *neutral_beyond_prior(problem, [track.neutral_off for track in fit.tracks]),
        *possible(problem, derived, parameters, dry_mass(vehicle)),
        *sinks_as_it_grows(problem),
        *_wanders(fit, problem),
        *contradicted,
        *late(fit.delay, problem.delay_std, fit.values[EARLY.name] / EARLY_STD),
        *_recorded(problem, vehicle),
        _summary(fit),
    ]
    if asked.posterior is not None:
        findings.append(Finding.of("motion", "no draws"))
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
        assumptions=(*assumptions, sentence("motion", "has process noise")),
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

    def solved(other: Problem, begins: Begins[Height]) -> Height:
        starts = [
            {**one.values, **begin_of(other, its, one.values, held=held)}
            for its, one, held in begins
        ]
        return height_of(other, vehicle, starts)

    parts = [(t.innovation[t.used], t.deviation[t.used]) for t in fit.tracks]
    own = Height(fit.values, fit.log_likelihood, *np.concatenate(parts, axis=1))
    found = []
    for other, psi, at in compared(problem, own, vehicle, solved):
        kept = np.abs(at.innovation) < GATE * at.deviation
        left = rms(at.innovation[kept]) if kept.any() else math.nan
        more = {"rms": left, "log_likelihood": at.height, "reported": other is problem}
        found.append(Choice.of(other, psi, at.values, len(at.innovation), **more))
    return with_probabilities(found)


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
        if e.std > limit(problem, fit.values, i) * size:
            said = in_percent(e.std / max(abs(e.value), 1e-300))
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
    numbers = {"minute": minute * drift.value, "p": fit.p_value}
    numbers["farthest"] = max(fit.travelled, default=0.0)
    numbers["acceleration"] = fit.noises["acceleration"].value
    return Finding.of("motion", "process_noise", **texts, **numbers)
