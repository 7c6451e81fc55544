"""From logs to parameters: the experiments, the fit, and everything that is said of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from swimbladder.estimation.comparison.record import Drive, Record, record
from swimbladder.estimation.comparison.water import water_of_each
from swimbladder.estimation.motion.diagnose import diagnose
from swimbladder.estimation.motion.estimates import Prior
from swimbladder.estimation.motion.experiment import experiment
from swimbladder.estimation.motion.fit import Fit
from swimbladder.estimation.motion.fit import fit as solve
from swimbladder.estimation.motion.fit_estimates import derived, parameters
from swimbladder.estimation.motion.identifiability import not_identifiable
from swimbladder.estimation.motion.model import default_names, model_of
from swimbladder.estimation.motion.model_selection import choices as list_choices
from swimbladder.estimation.motion.model_selection import judge, models_of
from swimbladder.estimation.motion.per_log import each_experiment
from swimbladder.estimation.motion.posterior import sample
from swimbladder.estimation.motion.problem import VOLUME, Problem
from swimbladder.estimation.motion.profiles import profile
from swimbladder.estimation.motion.random_walk import fit_random_walk
from swimbladder.estimation.motion.random_walk_result import with_random_walk
from swimbladder.estimation.motion.request import (
    assumptions,
    check_logs,
    check_motion,
    check_parameters,
    driven_by,
)
from swimbladder.estimation.motion.result import Finding, Identification, Profile
from swimbladder.estimation.motion.vehicle_update import dry_mass, identified_vehicle
from swimbladder.io.logs import Log
from swimbladder.physics.seawater import Column
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

NEUTRAL_STD = 0.5e-6  # m3


def identify(
    logs: Sequence[Log], vehicle: Vehicle, *, free: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None, priors: Mapping[str, Prior] | None = None,
    drag: str | None = None, neutral_std: float = NEUTRAL_STD, speed_std: float = math.inf,
    drive: Drive | None = None, bottom_depth: float = math.inf, surface_margin: float = 0.1,
    profiles: bool = True, choices: bool = True, random_walk: bool = False,
    posterior: int | None = None, columns: Sequence[Column] = (),
    advance: Callable[[float], None] | None = None,
) -> Identification:  # fmt: skip
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
    fixed, priors = dict(fixed or {}), dict(priors or {})
    report = advance or (lambda _: None)
    check_logs(logs, neutral_std, speed_std, drive)
    waters = water_of_each(len(logs), columns)
    records = [
        record(log, vehicle, drive=drive or driven_by(log, vehicle), bottom_depth=bottom_depth,
               surface_margin=surface_margin, column=water)
        for log, water in zip(logs, waters, strict=True)
    ]  # fmt: skip
    check_motion(records)
    model = model_of(vehicle, law=drag, bottom_depth=bottom_depth)
    names = tuple(free) if free is not None else default_names(model.law, list(fixed))
    voltage = any(r.drive == "voltage" for r in records)
    check_parameters(names, fixed, priors, model, voltage=voltage)
    experiments = [experiment(log.source, r, vehicle) for log, r in zip(logs, records, strict=True)]
    problem = Problem(
        experiments, model, names, fixed=fixed, priors=priors, neutral_std=neutral_std,
        speed_std=speed_std,
    )  # fmt: skip
    report(0.05)
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        share = 0.3 if random_walk or posterior is not None else 1.0
        found = _answer(
            problem, vehicle, records, advance=lambda part: report(share * part),
            profiles=profiles and not random_walk, choices=choices and not random_walk,
            posterior=posterior,
        )  # fmt: skip
        if not random_walk:
            return found
        walked = fit_random_walk(
            records, vehicle, free=names, fixed=fixed, priors=priors, drag=model.law,
            neutral_std=neutral_std, bottom_depth=bottom_depth,
        )  # fmt: skip
        report(0.6)
        return with_random_walk(found, walked, vehicle, model, records)


def _answer(
    problem: Problem, vehicle: Vehicle, records: Sequence[Record], *,
    advance: Callable[[float], None], profiles: bool, choices: bool, posterior: int | None,
) -> Identification:  # fmt: skip
    report, names, model = advance, problem.names, problem.model
    found = solve(problem)
    report(0.35 if choices or profiles else 0.95)
    findings: list[Finding] = not_identifiable(problem, found)
    drawn: dict[str, Profile] = {}
    for i, name in enumerate(names):
        if profiles and not findings:
            drawn[name] = profile(problem, found, i)
        report(0.3 / len(names) * profiles)
    listed = (
        list_choices(problem, found, models_of(vehicle, model.base.z_bottom)) if choices else ()
    )
    report(0.3 * choices)
    each = each_experiment(problem, found)
    findings += judge(listed)
    findings += diagnose(problem, found, each, dry_mass=dry_mass(vehicle))
    turned = [f for f in findings if f.kind == "backwards"]
    findings = turned or findings  # what follows from it need not be said
    estimates, fewer = parameters(problem, found, drawn)
    findings += [] if turned else fewer
    drawn_points = None
    if posterior is not None and not any(f.severity == "no" for f in findings):
        drawn_points = sample(
            problem, found, seed=posterior, advance=lambda part: report(2.0 * part)
        )
    values = problem.named(found.x)
    per = problem.per_entry(found.x)
    p = problem.shared
    covariance = found.covariance[:p, :p] * np.outer(per, per)
    size = np.sqrt(np.diag(covariance))
    noise = float(np.sqrt(np.average(found.noise**2, weights=np.diff(problem.rows))))
    return Identification(
        names=names, law=model.law, parameters=estimates,
        derived=derived(problem, found), covariance=covariance,
        correlation=covariance / np.outer(size, size), experiments=each,
        findings=tuple(findings), choices=listed, profiles=drawn,
        assumptions=assumptions(problem, records, vehicle), priors=problem.priors,
        neutral_std=problem.neutral_std,
        notes=tuple(dict.fromkeys(note for r in records for note in r.notes)),
        depth_noise=noise, posterior=drawn_points,
        result_vehicle=(
            vehicle
            if any(f.severity == "no" for f in findings)
            else identified_vehicle(
                vehicle, model, values, names, covariance,
                trim_error=_trim(problem, found, vehicle), depth_noise=noise,
                neutral_std=_neutral_spread(problem, found), neutral_walk=0.0,
                acceleration_noise=0.0,
                logs=tuple(e.source for e in problem.experiments),
            )
        ),
    )  # fmt: skip


def _trim(problem: Problem, found: Fit, vehicle: Vehicle) -> float | None:
    """Return the mean neutral volume at depth 0 [m3], None where no log's volume counts from
    mid-stroke.
    """
    absolute = [e.record.volume_absolute and e.ramps for e in problem.experiments]
    if not any(absolute):
        return None
    errors = found.x[problem.shared : problem.first_start] * VOLUME
    trim = vehicle.trim_error + float(errors[np.array(absolute)].mean())
    stroke = vehicle.stroke
    return trim if stroke.minimum < trim < stroke.maximum else None


def _neutral_spread(problem: Problem, found: Fit) -> float:
    """Return how far the neutral volume differs between logs [m3, 1 sigma]: as assumed or found."""
    if math.isfinite(problem.neutral_std):
        return problem.neutral_std
    errors = found.x[problem.shared : problem.first_start] * VOLUME
    return float(np.std(errors, ddof=1)) if len(errors) > 1 else NEUTRAL_STD
