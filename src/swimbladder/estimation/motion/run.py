"""From logs to parameters: the experiments, the fit, and everything that is said of it.

What is asked is refused where it cannot be, and said in sentences.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from threadpoolctl import threadpool_limits

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.comparison.record import Drive, Record, record
from swimbladder.estimation.comparison.water import water_of_each
from swimbladder.estimation.estimates import Finding, Prior
from swimbladder.estimation.motion.diagnose import choices as list_choices
from swimbladder.estimation.motion.diagnose import diagnose, judge, models_of, not_identifiable
from swimbladder.estimation.motion.fit import fit as solve
from swimbladder.estimation.motion.fit_estimates import (
    derived,
    each_experiment,
    parameters,
    profile,
)
from swimbladder.estimation.motion.model import NAMES
from swimbladder.estimation.motion.posterior import sample
from swimbladder.estimation.motion.problem import Assumed, Problem, posed
from swimbladder.estimation.motion.random_walk import fit_random_walk, with_random_walk
from swimbladder.estimation.motion.result import (
    Identification,
    Profile,
    dry_mass,
    identified_vehicle,
    neutral_spread,
    trim_of,
)
from swimbladder.io.logs import Log
from swimbladder.physics.seawater import Column
from swimbladder.units import format_quantity
from swimbladder.vehicle import Vehicle

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
    if not value > 0.0:
        remedy = "Give a standard deviation, or none for no assumption"
        raise InputError("it must be above 0", field=field, value=value, unit=unit, remedy=remedy)


def check_motion(records: Sequence[Record]) -> None:
    """Raise NoAnswerError where no vehicle of the records moved by what a sensor resolves."""
    ranges = [float(np.ptp(r.depth[r.compared])) for r in records]
    if max(ranges) < _STILL:
        raise NoAnswerError(
            "the vehicle's motion is not identifiable: the depth stays at "
            f"{float(records[0].depth[records[0].compared][0]):.4g} m. Check which column is the "
            "depth, or record steps of the volume"
        )


def driven_by(log: Log, vehicle: Vehicle) -> Drive:
    """Return what drives the model: the volume where it is known, else the voltage."""
    if log.volume is not None or log.piston is not None or log.voltage is None:
        return "volume"
    return "voltage" if vehicle.voltage_driven else "volume"


def assumptions(problem: Problem, records: Sequence[Record], vehicle: Vehicle) -> tuple[str, ...]:
    """Return what the answer rests on: law, priors, what is held, the water."""
    said = [f"drag law: {problem.model.law}"]
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
    for name in ("psi", "K2", "T2", "mass", "drag_quadratic"):
        inert = {"linear": ("mass", "drag_quadratic"), "quadratic": ("K2", "T2"),
                 "blended": ("mass",)}[problem.model.law]  # fmt: skip
        if name not in problem.names and name not in inert:
            said.append(f"held: {name} = {problem.values[name]:g} {NAMES[name].unit}")
    water = vehicle.water
    if any(len(r.layers.table) for r in records):
        said.append(
            "the neutral volume follows the density of the cast; psi is what the hull loses "
            "beyond that"
        )
    said.append(f"water of {water.density:g} kg/m3, gravity {water.gravity:g} m/s2")
    return tuple(said)


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
    report = advance or (lambda _: None)
    check_logs(logs, neutral_std, speed_std, drive)
    waters = water_of_each(len(logs), columns)
    records = [
        record(log, vehicle, drive=drive or driven_by(log, vehicle), bottom_depth=bottom_depth,
               surface_margin=surface_margin, column=water)
        for log, water in zip(logs, waters, strict=True)
    ]  # fmt: skip
    check_motion(records)
    assumed = Assumed(dict(fixed or {}), dict(priors or {}), neutral_std, speed_std)
    problem = posed(
        records, vehicle, assumed, sources=[log.source for log in logs], free=free, drag=drag,
        bottom_depth=bottom_depth,
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
        walked = fit_random_walk(problem, vehicle)
        report(0.6)
        return with_random_walk(found, walked, vehicle, problem)


def _answer(
    problem: Problem, vehicle: Vehicle, records: Sequence[Record], *,
    advance: Callable[[float], None], profiles: bool, choices: bool, posterior: int | None,
) -> Identification:  # fmt: skip
    report, names, model = advance, problem.names, problem.model
    found = solve(problem)
    report(0.35 if choices or profiles else 0.95)
    findings: list[Finding] = [*not_identifiable(problem, found)]
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
        assumptions=assumptions(problem, records, vehicle), priors=dict(problem.priors),
        neutral_std=problem.neutral_std,
        notes=tuple(dict.fromkeys(note for r in records for note in r.notes)),
        depth_noise=noise, posterior=drawn_points,
        result_vehicle=(
            vehicle
            if any(f.severity == "no" for f in findings)
            else identified_vehicle(
                vehicle, model, values, names, covariance,
                trim_error=trim_of(each, vehicle), depth_noise=noise,
                neutral_std=neutral_spread(each, problem.neutral_std, single=NEUTRAL_STD),
                logs=tuple(e.source for e in problem.experiments),
            )
        ),
    )  # fmt: skip
