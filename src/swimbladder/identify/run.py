"""From logs to parameters: the experiments, the fit, and everything that is said of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from swimbladder.comparison.record import Drive, Record, record
from swimbladder.errors import InputError
from swimbladder.identify.choices import choices as list_choices
from swimbladder.identify.choices import judge, models_of
from swimbladder.identify.diagnose import diagnose, drift, single_gains
from swimbladder.identify.estimates import Estimate, Prior, estimate
from swimbladder.identify.experiment import Experiment, experiment
from swimbladder.identify.fit import Fit
from swimbladder.identify.fit import fit as solve
from swimbladder.identify.model import NAMES, Model, check_names, default_names, model_of
from swimbladder.identify.noise import whiteness
from swimbladder.identify.outcome import dry_mass, identified_vehicle
from swimbladder.identify.problem import DEPTH, SPEED, VOLUME, Problem
from swimbladder.identify.profiles import profile
from swimbladder.identify.result import ExperimentFit, Finding, Identification, Profile
from swimbladder.identify.tell import untold
from swimbladder.io.logs import Log
from swimbladder.parameters import Vehicle
from swimbladder.units import format_quantity, shown_unit

__all__ = ["NEUTRAL_STD", "identify"]

Array = NDArray[np.float64]

NEUTRAL_STD = 0.5e-6  # m3
_OFF = 0.1  # of the half interval, from which the profile's interval is given
_PRIOR_ONLY = 0.9  # of the prior's deviation is left
_CONTRADICTED = 3.0  # standard deviations from the prior


def identify(
    logs: Sequence[Log], vehicle: Vehicle, *, free: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None, priors: Mapping[str, Prior] | None = None,
    drag: str | None = None, neutral_std: float = NEUTRAL_STD, speed_std: float = math.inf,
    drive: Drive | None = None, bottom_depth: float = math.inf, surface_margin: float = 0.1,
    profiles: bool = True, choices: bool = True,
    advance: Callable[[float], None] | None = None,
) -> Identification:  # fmt: skip
    """Return the parameters that make the vehicle's model meet all logs together, with intervals.

    Output-error maximum likelihood on depth: each log is an experiment with its own neutral
    volume, noise and starts. free: what is identified (see NAMES), the drag law's parameters and
    psi where not given; fixed: values in SI that are not; priors: by name; drag: linear, quadratic
    or blended, the vehicle's own where not given. neutral_std: 1 sigma [m3] of what is known of a
    log's neutral volume, inf for nothing; speed_std: of its speed at the start about 0 [m/s].
    drive: volume or voltage; bottom_depth [m]; surface_margin: samples less than this below the
    depth of emergence are left out [m]. advance: told the share of the work done since last called.

    Raises InputError where logs, names and vehicle do not go together. What the data do not tell is
    among the findings, and Identification.vehicle raises NoAnswerError then.
    """
    fixed, priors = dict(fixed or {}), dict(priors or {})
    tell = advance or (lambda _: None)
    _check(logs, neutral_std, speed_std, drive)
    records = [
        record(log, vehicle, drive=drive or _drive(log, vehicle), bottom_depth=bottom_depth,
               surface_margin=surface_margin)
        for log in logs
    ]  # fmt: skip
    model = model_of(vehicle, law=drag, bottom_depth=bottom_depth)
    names = tuple(free) if free is not None else default_names(model.law, list(fixed))
    voltage = any(r.drive == "voltage" for r in records)
    _check_all(names, fixed, priors, model, voltage=voltage)
    experiments = [experiment(log.source, r, vehicle) for log, r in zip(logs, records, strict=True)]
    problem = Problem(
        experiments, model, names, fixed=fixed, priors=priors, neutral_std=neutral_std,
        speed_std=speed_std,
    )  # fmt: skip
    tell(0.05)
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        return _answer(problem, vehicle, records, advance=tell, profiles=profiles, choices=choices)


def _answer(
    problem: Problem, vehicle: Vehicle, records: Sequence[Record], *,
    advance: Callable[[float], None], profiles: bool, choices: bool,
) -> Identification:  # fmt: skip
    tell, names, model = advance, problem.names, problem.model
    found = solve(problem)
    tell(0.35 if choices or profiles else 0.95)
    findings: list[Finding] = untold(problem, found)
    drawn: dict[str, Profile] = {}
    for i, name in enumerate(names):
        if profiles and not findings:
            drawn[name] = profile(problem, found, i)
        tell(0.3 / len(names) * profiles)
    listed = (
        list_choices(problem, found, models_of(vehicle, model.base.z_bottom)) if choices else ()
    )
    tell(0.3 * choices)
    each = _experiments(problem, found)
    findings += judge(listed)
    findings += diagnose(problem, found, each, dry_mass=dry_mass(vehicle))
    parameters, fewer = _parameters(problem, found, drawn)
    findings += fewer
    values = problem.named(found.x)
    per = problem.per_entry(found.x)
    p = problem.shared
    covariance = found.covariance[:p, :p] * np.outer(per, per)
    noise = float(np.sqrt(np.average(found.noise**2, weights=np.diff(problem.rows))))
    return Identification(
        names=names, law=model.law, parameters=parameters,
        derived=_derived(problem, found), covariance=covariance,
        correlation=_correlation(found.covariance[:p, :p]), experiments=each,
        findings=tuple(findings), choices=listed, profiles=drawn,
        assumptions=_assumptions(problem, records, vehicle), priors=problem.priors,
        neutral_std=problem.neutral_std,
        notes=tuple(dict.fromkeys(note for r in records for note in r.notes)),
        depth_noise=noise,
        result_vehicle=(
            vehicle
            if any(f.severity == "no" for f in findings)
            else identified_vehicle(
                vehicle, model, values, names, covariance,
                trim_error=_trim(problem, found, vehicle), depth_noise=noise,
                neutral_std=_neutral_spread(problem, found), neutral_walk=0.0,
                logs=tuple(e.source for e in problem.experiments),
            )
        ),
    )  # fmt: skip


def _check(logs: Sequence[Log], neutral_std: float, speed_std: float, drive: Drive | None) -> None:
    if not logs:
        raise InputError("no log is given", field="LOG", remedy="Give at least one log")
    for field, value, unit in (
        ("--neutral-std", neutral_std, "m3"), ("--speed-std", speed_std, "m/s"),
    ):  # fmt: skip
        if not value > 0.0:
            raise InputError(
                "it must be above 0", field=field, value=value, unit=unit,
                remedy="Give a standard deviation, or none for no assumption",
            )  # fmt: skip
    if drive == "setpoint":
        raise InputError(
            "a set-point does not drive the vehicle without its controller", field="--drive",
            value=drive, remedy="Choose volume or voltage",
        )  # fmt: skip


def _drive(log: Log, vehicle: Vehicle) -> Drive:
    """Return what drives the model: the volume where it is known, else the voltage."""
    if log.volume is not None or log.piston is not None or log.voltage is None:
        return "volume"
    return "voltage" if vehicle.voltage_driven else "volume"


def _check_all(
    names: Sequence[str], fixed: Mapping[str, float], priors: Mapping[str, Prior],
    model: Model, *, voltage: bool,
) -> None:  # fmt: skip
    check_names(names, model, voltage=voltage, option="--free")
    check_names(list(fixed), model, voltage=voltage, option="--set")
    check_names(list(priors), model, voltage=voltage, option="--prior")
    if not names:
        raise InputError("nothing is left to identify", field="--free", remedy="Free a parameter")
    for name in names:
        if name in fixed:
            raise InputError(
                "it is both set and to be identified", field="--set", value=name,
                remedy="Leave it out of --free or of --set",
            )  # fmt: skip
    for name, value in fixed.items():
        if NAMES[name].logarithmic and not value > 0.0:
            raise InputError(
                "it must be above 0", field="--set", value=value, unit=NAMES[name].unit
            )
    for name, prior in priors.items():
        if name not in names:
            raise InputError(
                "it has a prior, but is not identified", field="--prior", value=name,
                remedy=f"Name it in --free, which has {', '.join(names)}",
            )  # fmt: skip
        if not prior.std > 0.0 or (NAMES[name].logarithmic and not prior.mean > 0.0):
            raise InputError(
                "no such prior: the deviation has to be above 0, and the mean of a positive "
                "quantity too",
                field="--prior", value=f"{name}={prior.mean:g} +- {prior.std:g}",
                unit=NAMES[name].unit,
            )  # fmt: skip


def _parameters(
    problem: Problem, found: Fit, drawn: Mapping[str, Profile]
) -> tuple[dict[str, Estimate], list[Finding]]:
    """Return the estimates; where a profile's interval differs from the quadratic one, with it."""
    std = np.sqrt(np.diag(found.covariance)[: problem.shared]) * problem.per_entry(found.x)
    estimates, findings = {}, []
    for i, name in enumerate(problem.names):
        unit, log = NAMES[name].unit, problem.logarithmic[i]
        e = estimate(problem.value(found.x, i), float(std[i]), unit, logarithmic=log)
        prior = problem.priors.get(name)
        if prior is not None:
            findings += _against(name, e, prior)
        if prior is not None and e.std > _PRIOR_ONLY * prior.std:
            e = Estimate(e.value, e.std, e.ci95, e.unit, "prior")
            findings.append(
                Finding("prior", "note", f"The data add little to the prior of {name}.")
            )
        if name in drawn:
            ends = drawn[name].ci95
            half = 0.5 * (e.ci95[1] - e.ci95[0])
            apart = max(abs(a - b) for a, b in zip(ends, e.ci95, strict=True))
            if not apart <= _OFF * half:
                e = Estimate(e.value, e.std, ends, e.unit, e.origin)
                findings.append(
                    Finding(
                        "profile",
                        "note",
                        f"The interval of {name} is that of its likelihood profile: a normal "
                        "distribution does not describe it.",
                    )
                )
        if name == "drag_quadratic" and not log:  # it is never below 0
            e = Estimate(e.value, e.std, (max(e.ci95[0], 0.0), e.ci95[1]), e.unit, e.origin)
        estimates[name] = e
    for name, value in problem.values.items():
        if name in ("psi", "K2", "T2") and name not in estimates and (
            name == "psi" or problem.model.law != "quadratic"
        ):  # fmt: skip
            estimates[name] = Estimate(value, 0.0, (value, value), NAMES[name].unit, "set")
    return estimates, findings


def _against(name: str, e: Estimate, prior: Prior) -> list[Finding]:
    """Return a warning where data and prior can hardly both be right."""
    shift = math.sqrt(max(prior.std**2 - e.std**2, 0.0))  # of the estimate, if the prior is right
    if abs(e.value - prior.mean) <= _CONTRADICTED * max(shift, 0.1 * prior.std):
        return []
    return [
        Finding(
            "prior", "warning",
            f"The data contradict the prior of {name}: {_read(e.value, e.unit)} comes out, where "
            f"{_read(prior.mean, e.unit)} +- {_read(prior.std, e.unit)} was said. Check its unit.",
        )
    ]  # fmt: skip


def _read(value: float, unit: str) -> str:
    return format_quantity(value, unit, shown_unit(unit), digits=3)


def _derived(problem: Problem, found: Fit) -> dict[str, Estimate]:
    """Return what follows of mass and laminar drag, by the delta rule."""
    p = problem.shared
    C = found.covariance[:p, :p]

    def of(quantity: Callable[[Mapping[str, float]], float], unit: str) -> Estimate:
        at = quantity(problem.named(found.x))
        slope = np.zeros(p)
        for i in range(p):
            moved = found.x.copy()
            moved[i] += 1e-5
            slope[i] = (quantity(problem.named(moved)) - at) / 1e-5
        return estimate(at, math.sqrt(max(float(slope @ C @ slope), 0.0)), unit, logarithmic=True)

    k_b = problem.model.specific_weight
    result = {}
    if problem.model.law != "quadratic":
        result["mass"] = of(problem.model.mass, "kg")
        result["drag"] = of(lambda v: k_b / v["K2"], "N s/m")
    return result


def _correlation(C: Array) -> Array:
    size = np.sqrt(np.diag(C))
    result: Array = C / np.outer(size, size)
    return result


def _experiments(problem: Problem, found: Fit) -> tuple[ExperimentFit, ...]:
    gains: list[tuple[float, float] | None] = [
        (gain, std) if 0.0 < std < 1.0 else None for _, gain, std in single_gains(problem, found)
    ]
    return tuple(
        _experiment(problem, found, j, e, gain)
        for (j, e), gain in zip(
            enumerate(problem.experiments), gains or [None] * len(problem.experiments), strict=True
        )
    )


def _experiment(
    problem: Problem, found: Fit, j: int, e: Experiment, gain: tuple[float, float] | None
) -> ExperimentFit:
    part = slice(problem.rows[j], problem.rows[j + 1])
    n = len(e.record.time)
    residual, weight, predicted = np.full(n, np.nan), np.zeros(n), np.full(n, np.nan)
    residual[e.used], weight[e.used] = found.residual[part], found.weight[part]
    predicted[e.used] = e.record.depth[e.used] - found.residual[part]
    std = np.sqrt(np.diag(found.covariance))
    at = problem.starts_at[j]
    own = {
        "neutral_error": (problem.shared + j, VOLUME, "m3"),
        "start_depth": (at, DEPTH, "m"),
        "start_speed": (at + 1, SPEED, "m/s"),
    }
    kept = weight[e.used] > 0.0
    left = found.residual[part][kept]
    return ExperimentFit(
        source=e.source, record=e.record, reference_depth=e.reference, predicted=predicted,
        residual=residual, weight=weight,
        estimates={
            name: estimate(float(found.x[i] * per), float(std[i] * per), unit)
            for name, (i, per, unit) in own.items()
        },
        drift=drift(problem, found, j), noise=float(found.noise[j]),
        rms=float(np.sqrt(np.mean(left**2))) if len(left) else math.nan,
        ar=found.colour[j], whiteness_p=whiteness(np.sqrt(weight[e.used]) * found.residual[part]),
        outliers=int((weight[e.used] < 0.5).sum()), step=e.step(), own_gain=gain,
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


def _assumptions(problem: Problem, records: Sequence[Record], vehicle: Vehicle) -> tuple[str, ...]:
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
    said.append(f"water of {water.density:g} kg/m3, gravity {water.gravity:g} m/s2")
    return tuple(said)
