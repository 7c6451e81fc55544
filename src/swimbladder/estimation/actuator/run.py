"""The identification of an actuator from logs of its voltage steps, or of its moves."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from threadpoolctl import threadpool_limits

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.actuator import voltage
from swimbladder.estimation.actuator.bench import Bench, Driven, bench
from swimbladder.estimation.actuator.model import LOGARITHMIC, PRIOR, shown
from swimbladder.estimation.actuator.moves import WIDE, MovesFit, fit_moves, together
from swimbladder.estimation.actuator.result import (
    PARAMETERS,
    ActuatorIdentification,
    LogFit,
    Step,
    nine,
)
from swimbladder.estimation.estimates import (
    Z95,
    Estimate,
    Finding,
    check_distinct,
    check_names,
    read_values,
    sentence,
    too_many,
    undetermined,
)
from swimbladder.io.logs import Log
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import Vehicle

_WIDE = 1.5  # times, by which an interval is wider
_SEVERAL = 0.02  # differences, trends and shares that are worth a sentence
_BETWEEN = 2.0  # times, by which it is wider where the ends of moves are not known to a sample
_INCONSISTENT = 0.25  # those after which there is no one number


def of_voltage(
    fit: voltage.VoltageFit, parameters: Mapping[str, Estimate], soft: voltage.SoftStart | None
) -> Iterator[Finding]:
    """Yield what is to be said of a fit to voltage steps, and of its driver's soft start."""
    problem, spread = fit.problem, fit.spread
    out = int((~problem.used & ~problem.early).sum())
    yield from _outliers(out, len(problem.used))
    if problem.early.any():
        yield Finding.of("actuator", "start", early=int(problem.early.sum()))
    if spread.significant:
        severe = spread.likely > _SEVERAL
        yield _unless(spread.likely, "gains differ", severe=severe, share=spread.likely)
    elif fit.widened >= _WIDE:
        few = "No step was" if fit.repeats < 1 else "Few steps were"
        yield Finding.of("actuator", "repeat", few=few, allowed=spread.typical, widened=fit.widened)
    if soft is not None:
        yield Finding.of("actuator", "soft start", top=problem.top, soft=soft)
    T1, step = parameters["T1"], min(b.step for b in problem.benches)
    if T1.origin == "data" and T1.value < step:
        yield Finding.of("actuator", "time constant", step=step)


def _outliers(out: int, samples: int) -> Iterator[Finding]:
    """Yield that samples are outliers; where they are too many, it is a no."""
    if too_many(out, samples):
        yield Finding.of("actuator", "many outliers", out=out, samples=samples)
    elif out:
        yield Finding.of("actuator", "outliers", out=f"{out} of {samples}")


def of_moves(fits: Sequence[MovesFit], samples: int) -> Iterator[Finding]:
    """Yield what is to be said of fits to moves at full speed."""
    yield from _outliers(sum(fit.outliers for fit in fits), samples)
    ramps = [(way, length) for fit in fits for way, length in fit.ramps.items()]
    if ramps:
        ways = " and ".join(sorted({way for way, _ in ramps}, reverse=True))
        low, high = (shown(end([length for _, length in ramps]), "s", 3) for end in (min, max))
        length = low if low == high else f"{low} to {high}"
        yield Finding.of("actuator", "ramp", ways=ways, length=length)
    between = max(fit.between for fit in fits)
    if between > 0.25 * _SEVERAL:
        yield _unless(between, "moves differ", between=between)
    change = max((fit.trend * fit.lasting for fit in fits), key=abs)
    if abs(change) > _SEVERAL:
        word = "gains" if change > 0.0 else "loses"
        yield _unless(abs(change), "load", word=word, change=abs(change))


def _unless(share: float, key: str, /, *, severe: bool = False, **values: Any) -> Finding:
    """Return a finding on a share by which speeds differ; a large one is no actuator's."""
    found = Finding.of("actuator", key, "warning" if severe else "note", **values)
    if share <= _INCONSISTENT:
        return found
    text = f"{found.sentence} {sentence('actuator', 'inconsistent')}"
    return found._replace(severity="no", sentence=text)


def between_logs(
    joint: Mapping[str, Estimate], chance: Mapping[str, float], logs: Sequence[LogFit]
) -> Iterator[Finding]:
    """Yield which numbers differ between logs, and which intervals of all are wider than of one.

    joint: of all logs together; chance: the probability of such differences.
    """
    ranges, wider, most, odd = [], [], 0.0, ("", 0.0)
    for name in [name for name in chance if joint[name].origin == "data"]:
        known = [(e, f) for f in logs if (e := f.parameters.get(name)) and e.known]
        if chance[name] >= _DIFFERENT:
            wider += [name] * (joint[name].std > min(e.std for e, _ in known))
            continue
        (low, first), *_, (high, last) = sorted(known, key=lambda one: one[0].value)
        most = max(most, high.value / low.value - 1.0) if low.value > 0.0 else 1.0
        ends = [f"{shown(e.value, e.unit)} in {f.source}" for e, f in ((low, first), (high, last))]
        ranges.append(f"{name} from {ends[0]} to {ends[1]}")
        for e, log in known if len(known) > 2 else ():
            others = together([f.parameters for f in logs if f is not log])[0][name]
            like_them = math.hypot(e.std, others.std * math.sqrt(len(known)))
            off = abs(e.value - others.value) / like_them
            odd = max(odd, (log.source, off), key=lambda one: one[1])
    if ranges:
        far, all_ = "odd" if odd[1] > _APART else "which", ", ".join(ranges)
        said = sentence("actuator", "logs differ", far, log=odd[0])
        yield _unless(0.25 * most, "logs differ", severe=most > _SEVERAL, ranges=all_, odd=said)
    if wider:
        yield Finding.of("actuator", "few logs", count=len(logs), names=", ".join(wider))


_DIFFERENT = 0.01  # probability below which logs are said to differ
_APART = 4.0  # standard deviations from all others, at which a log is named


def identify_actuator(
    logs: Sequence[Log],
    vehicle: Vehicle | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    required: Sequence[str] | None = None,
    advance: Advance = silent,
) -> ActuatorIdentification:
    """Identify an actuator from its logs, eqs (21)-(24).

    Parameters
    ----------
    logs
        As `read_log` returns them; one or more of one actuator.
    vehicle
        Its file gives the piston's area, the load of the sea, the supply, and what else is known;
        none: these are not known.
    fixed
        {name: value} of `PARAMETERS` in SI, not fitted.
    required
        What has to be identified; none: K1 and T1 where the logs have a voltage, T1 and rate where
        they have positions alone, rate where they have what was asked of a positioner.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    ActuatorIdentification
        The parameters with their intervals. What was asked and is not identifiable is among the
        findings.

    Raises
    ------
    LogError
        An InputError: a log cannot be used.
    InputError
        The logs are of different kinds or none, or a name is none of the parameters.
    NoAnswerError
        Nothing moves.
    """
    fixed = read_values(fixed, PARAMETERS)
    check_names(tuple(required or ()), PARAMETERS, "required", "there is no such parameter")
    if not logs:
        raise InputError("there are no logs", field="LOG", remedy="Give one log or more")
    check_distinct(logs)
    benches = [bench(log, vehicle) for log in logs]
    driven = _one_kind(benches)
    if driven != "voltage" and fixed:
        what = "nothing can be set where no voltage is logged"
        remedy = "Leave `fixed=` out, or map voltage_V with `columns=`"
        raise InputError(what, field="fixed", value=", ".join(fixed), remedy=remedy)
    if required is None:
        usual = {"voltage": ("K1", "T1"), "reference": ("rate",), "nothing": ("T1", "rate")}
        needed = ("rate",) if vehicle and vehicle.command == "volume" else usual[driven]
        required = tuple(name for name in needed if name not in fixed)
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        by_steps = driven == "voltage"
        found = _voltage(benches, fixed, advance) if by_steps else _moves(benches, advance)

    def called(name: str) -> str:
        return "K1A" if name == "K1" and benches[0].quantity == "volume" else name

    def settled(of: Mapping[str, Estimate]) -> dict[str, Estimate]:
        return {called(n): _settled(n, e, found) for n, e in of.items()}

    parameters = settled(found.parameters)
    known = [n for n in found.covariance if parameters[called(n)].known]
    missing = [(n, parameters[called(n)].why) for n in required if not parameters[called(n)].known]
    refused = [Finding.of("actuator", "not identifiable", name=n, why=why) for n, why in missing]
    refused += _impossible(parameters, benches[0].unit)
    refused += [] if vehicle is None else _unlike(parameters, benches[0], vehicle)
    which = "the log" if len(benches) == 1 else f"the {len(benches)} logs"
    priors = {"speeds": PRIOR, "rest": WIDE * PRIOR, "least": _CLOSEST}
    claim = sentence("actuator", "one log" if len(benches) == 1 else "several logs", **priors)
    return ActuatorIdentification(
        driven=driven,
        quantity=benches[0].quantity,
        parameters=parameters,
        derived=settled(found.derived),
        asked=tuple(map(called, required)),
        noise=found.noise,
        covariance={
            called(a): {
                called(b): max(x, parameters[called(a)].std ** 2) if a == b else x
                for b, x in found.covariance[a].items()
                if b in known
            }
            for a in known
        },
        logs=tuple(replace(f, parameters=settled(f.parameters)) for f in found.logs),
        steps=found.steps,
        nine=nine(parameters, vehicle, which),
        findings=(*found.findings, *refused),
        assumptions=(*sentence("actuator", driven).split("\n"), *claim.split("\n")),
        notes=tuple(dict.fromkeys(note for b in benches for note in b.notes)),
        given=vehicle,
    )


_POSSIBLE = {"T1": (1e-4, 10.0), "rate": (1e-7, 1.0), "K1": (1e-8, 0.1)}
"""From a stepper to a gearmotor [s, m/s, m/s/V]."""


def _impossible(parameters: Mapping[str, Estimate], unit: str) -> Iterator[Finding]:
    """Yield which parameters no actuator has."""
    for name, (least, most) in _POSSIBLE.items():
        e = parameters.get(name) if unit == "m" or name == "T1" else None
        if e and e.origin == "data" and not least <= e.value <= most:
            yield Finding.of("actuator", "impossible", name=name, value=shown(e.value, e.unit))


def _unlike(parameters: Mapping[str, Estimate], one: Bench, vehicle: Vehicle) -> Iterator[Finding]:
    """Yield which speeds are so far from those of the vehicle's file that a unit is wrong."""
    p, area = plant(vehicle), vehicle.piston_area if one.quantity == "piston" else 1.0
    full = p.rate if p.positioner else p.gain * p.supply
    for name, of_file in {"rate": full, "K1": p.gain, "K1A": p.gain}.items() if area else ():
        e, own = parameters.get(name), of_file / (area or 1.0)
        times = e.value / own if e and e.origin == "data" and own > 0.0 else 1.0
        if e and not 1.0 < _UNLIKE * times < _UNLIKE**2:
            said = {"value": shown(e.value, e.unit), "own": shown(own, e.unit)}
            yield Finding.of("actuator", "unlike", name=name, times=times, **said)


_UNLIKE = 20.0  # times: inches for mm, minutes for s and ms for s are more
_CLOSEST = 1e-4  # of a value that is positive: no log knows it better


def _settled(name: str, e: Estimate, found: "_Found") -> Estimate:
    """Return an estimate with what no log knows better, or only its interval if it has no end."""
    if e.origin != "data":
        return e
    positive = name.startswith(LOGARITHMIC)
    least = math.hypot(_CLOSEST * e.value * positive, found.clock * name.startswith("T1"))
    low, high = (math.hypot(found.wider * (e.value - end), Z95 * least) for end in e.ci95)
    e = replace(e, std=math.hypot(found.wider * e.std, least), ci95=(e.value - low, e.value + high))
    why = undetermined(e, (0.0 if positive else -math.inf, math.inf))
    return Estimate.bounded(*e.ci95, e.unit, why) if why else e


class _Found(NamedTuple):
    """What logs of one kind say."""

    parameters: dict[str, Estimate]
    findings: tuple[Finding, ...]
    covariance: dict[str, dict[str, float]]
    derived: dict[str, Estimate]
    noise: float
    logs: tuple[LogFit, ...]
    steps: tuple[Step, ...]
    clock: float  # s, 1 sigma of the instants in the logs
    wider: float = 1.0  # times, that intervals are than those of the fit


def _one_kind(benches: Sequence[Bench]) -> Driven:
    """Return what drives all logs; raise InputError where they are of different kinds."""
    first = benches[0]
    for other in benches[1:]:
        if (other.driven, other.quantity) != (first.driven, first.quantity):
            logged = [f"the {b.quantity} and {_WHAT[b.driven]}" for b in (first, other)]
            what = f"the logs are of different kinds: {first.source} has {logged[0]}, "
            what += f"{other.source} {logged[1]}"
            remedy = "Identify them one by one, or map the same columns in all"
            raise InputError(what, field="LOG", remedy=remedy)
    return first.driven


_WHAT = {"voltage": "a voltage", "reference": "what was asked for", "nothing": "nothing else"}


def _voltage(benches: Sequence[Bench], fixed: Mapping[str, float], advance: Advance) -> _Found:
    unit = benches[0].unit
    share = 1.0 / (len(benches) + 1)
    fit = voltage.fit_voltage(benches, fixed)
    led = voltage.between_samples(fit)
    taken = led or benches
    if led:
        fit = voltage.fit_voltage(led, fixed)
    parameters = voltage.from_voltage(fit, fixed, unit)
    advance(share)
    alone: list[LogFit] = []
    for one in taken:
        alone.append(_alone(one, fixed) if len(taken) > 1 else LogFit(one.source, parameters))
        advance(share)
    T1 = parameters["T1"]
    soft = voltage.soft_start(fit) if T1.origin == "data" else None
    findings = [*of_voltage(fit, parameters, soft)]
    if led:
        findings.append(Finding.of("actuator", "between samples"))
    if soft is not None:
        why = sentence("actuator", "soft start", "why")
        parameters["T1"] = Estimate.bounded(0.0, T1.ci95[1], "s", why)
    mean, chance = together([f.parameters for f in alone])
    apart = [n for n, p in chance.items() if p < _DIFFERENT and parameters[n].origin == "data"]
    parameters |= {name: mean[name] for name in apart}
    findings += between_logs(parameters, chance, alone)
    covariance = voltage.covariance_of(fit, parameters)
    derived = voltage.by_direction(fit, parameters, unit)
    said, logs, steps = tuple(findings), tuple(alone), voltage.steps_of(fit, benches)
    more = taken[0].clock, _BETWEEN if led else 1.0
    return _Found(parameters, said, covariance, derived, fit.noise, logs, steps, *more)


def _alone(one: Bench, fixed: Mapping[str, float]) -> LogFit:
    """Return the estimates from one of several logs, or why there are none."""
    try:
        fit = voltage.fit_voltage([one], fixed)
    except NoAnswerError as error:
        return LogFit(one.source, {}, refusal=str(error))
    return LogFit(one.source, voltage.from_voltage(fit, fixed, one.unit))


def _moves(benches: Sequence[Bench], advance: Advance) -> _Found:
    fits: list[MovesFit] = []
    for one in benches:
        fits.append(fit_moves(one))
        advance(1.0 / len(benches))
    if not any(fit.steps for fit in fits):
        raise NoAnswerError(
            "No move at full speed is in the logs: the actuator is not identifiable. Log moves "
            "long enough for six samples or more at full speed."
        )
    why = "no move at full speed is in the log"
    logs = tuple(
        LogFit(one.source, {**fit.parameters, **fit.derived}, None if fit.steps else why)
        for one, fit in zip(benches, fits, strict=True)
    )
    derived, chance = together([log.parameters for log in logs])
    findings = (
        *of_moves(fits, sum(len(b.time) for b in benches)),
        *between_logs(derived, chance, logs),
    )
    parameters = {name: derived.pop(name) for name in fits[0].parameters}
    covariance = {n: {n: e.std**2} for n in ("T1", "rate") if (e := parameters[n]).known}
    noise = max(fit.noise for fit in fits if not math.isnan(fit.noise))
    steps = tuple(step for fit in fits for step in fit.steps)
    found = parameters, findings, covariance, derived, noise, logs, steps
    return _Found(*found, benches[0].clock)
