"""What the data say of each log and against the model, which questions they leave open, and for
which model they speak.

A question is open along a direction of the parameters on which the data have too little
information. Models differ by their drag law, and by whether psi belongs in them.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.special import chdtrc, chdtri

from swimbladder.estimation.estimates import (
    Estimate,
    Finding,
    Prior,
    Severity,
    impossible_mass,
    impossible_psi,
    sentence,
    too_many,
    undetermined,
)
from swimbladder.estimation.motion.fit import Ended, Fit, autocovariance, backwards, eliminated
from swimbladder.estimation.motion.fit import compared as solve
from swimbladder.estimation.motion.problem import (
    DEPTH,
    DRIFT,
    LAWS,
    NAMES,
    SPEED,
    VOLUME,
    Model,
    Problem,
    default_names,
    model_of,
)
from swimbladder.estimation.motion.result import Choice, ExperimentFit, Psi
from swimbladder.estimation.series import Index, rms
from swimbladder.physics.arrays import Array
from swimbladder.units import format_quantity, shown_unit
from swimbladder.vehicle import Vehicle

_TRACE = 0.02  # of the drag, that a blended one begins with beside a law that was fitted
_HARDLY = 1e-4  # of the drag: with less laminar drag K2 and T2 would be at their limits
_REFUSED = 3.0  # times what another drag law leaves over
_DECISIVE = 10.0  # difference of the criterion, "very strong" in Kass and Raftery 1995


def choices(problem: Problem, fit: Fit, vehicle: Vehicle) -> tuple[Choice, ...]:
    """Return every drag law with psi as it is and otherwise, best first.

    All see the same samples; autocorrelated residuals count as the
    number of independent samples that it is worth under the model reported.
    """
    counts = np.diff(problem.rows)
    each = np.array([_worth(c, n) for c, n in zip(fit.ar, counts, strict=True)])
    # one for all logs: then the fit is also what is best by the criterion, and a model that holds
    # another is never less likely than it
    worth = float((each * counts).sum() / counts.sum())

    def solved(other: Problem, begins: Begins[Ended]) -> Ended:
        """Fit a model from where others ended; in full if it has the same drag law or is near."""
        starts = [_moved(other, one, result, held=held) for one, result, held in begins]
        same = other.model.law == problem.model.law  # what is without psi may be said
        found = solve(other, starts, briefly=not same)
        near = not same and found.objective < fit.objective + _DECISIVE
        return solve(other, [found.x], briefly=False) if near else found

    own = Ended(fit.x, fit.residual, fit.weight, fit.noise, fit.objective)
    found = compared(problem, own, vehicle, solved)
    return with_probabilities(
        [_choice(other, one, psi, worth, reported=other is problem) for other, psi, one in found]
    )


Solved = TypeVar("Solved")
Begins = list[tuple[Problem, Solved, bool]]  # solved, and whether it is held in what begins there


def compared(
    problem: Problem,
    own: Solved,
    vehicle: Vehicle,
    solve: Callable[[Problem, Begins[Solved]], Solved],
) -> Iterator[tuple[Problem, Psi, Solved]]:
    """Yield every model of the data and its solution; `own` is the problem's.

    Those that others hold come first: a model with more freedom begins where they ended, and ends
    no worse. solve: returns the solution of a model from those of others.
    """
    found = [(problem, own)]
    for other, psi in sorted(models_of(problem, vehicle), key=lambda each: len(each[0].names)):
        result = own
        if other is not problem:
            held = [(*one, True) for one in found if _holds(other, one[0])]
            result = solve(other, [(problem, own, False), *held])
            found.append((other, result))
        yield other, psi, result


def _holds(other: Problem, one: Problem) -> bool:
    """Whether one model is another with its further parameters at zero."""
    same = other.model.law in (one.model.law, "blended")
    return same and len(other.names) > len(one.names)


def _moved(other: Problem, problem: Problem, fit: Ended, *, held: bool) -> Array:
    """Return x of another model at what one was fitted to, in which it may be held."""
    x = other.begin(begin_of(other, problem, problem.named(fit.x), held=held))
    x[other.shared :] = fit.x[problem.shared :]
    return x


def models_of(problem: Problem, vehicle: Vehicle) -> Iterator[tuple[Problem, Psi]]:
    """Yield every drag law with psi as it is and otherwise; the problem itself where it is one."""
    for law in LAWS:
        model = model_of(vehicle, law=law, bottom_depth=problem.model.base.z_bottom)
        for psi in _psis(problem):
            same = law == problem.model.law and psi == _psi(problem)
            yield problem if same else _problem(problem, model, psi), psi


def with_probabilities(found: Sequence[Choice]) -> tuple[Choice, ...]:
    """Return models with their probabilities, best first."""
    best = min(c.bic for c in found)
    weights = np.exp([-0.5 * (c.bic - best) for c in found])
    shares = (weights / weights.sum()).tolist()
    each = [replace(c, weight=share) for c, share in zip(found, shares, strict=True)]
    return tuple(sorted(each, key=lambda c: c.bic))


def judge(listed: tuple[Choice, ...]) -> Iterator[Finding]:
    """Yield what a person has to know of the evidence."""
    if not listed:
        return
    best, reported = listed[0], next(c for c in listed if c.reported)
    gap = reported.bic - best.bic
    if gap > _DECISIVE:
        refused = reported.rms > _REFUSED * best.rms and reported.drag != best.drag
        texts = {"reported": _words(reported), "best": _words(best), "least": best.rms}
        texts |= {"gap": gap, "rms": reported.rms, "remedy": _consider(best, reported)}
        yield Finding.of("motion", "refused" if refused else "model", **texts)
    same = [c for c in listed if c.drag == reported.drag]
    zero = next((c for c in same if c.psi == "zero"), None)
    if zero is not None and reported.psi != "zero" and zero.bic - reported.bic > _DECISIVE:
        both = [n for n in reported.values if n in ("K2", "T2", "mass") and n in zero.values]
        shift = describe({n: zero.values[n] / reported.values[n] - 1.0 for n in both})
        yield Finding.of("motion", "psi", shifts=shift, without=zero.rms, rms=reported.rms)


def describe(biases: Mapping[str, float]) -> str:
    """Return biases as text: "K2 by +81 %, T2 more than tenfold"."""
    return ", ".join(
        f"{name} by {_signed(share)} %" if share < 9.0 else f"{name} more than tenfold"
        for name, share in biases.items()
    )


def _signed(share: float) -> str:
    return f"{100.0 * share:+.2g}" if abs(share) < 0.995 else f"{100.0 * share:+.0f}"


_PSI = dict(free="psi estimated", prior="psi with its prior", set="psi as set", zero="no psi")


def _words(c: Choice) -> str:
    return f"{c.drag} drag, {_PSI[c.psi]}"


def _consider(best: Choice, reported: Choice) -> str:
    parts = []
    if best.drag != reported.drag:
        parts.append(f"`drag='{best.drag}'`")
    if best.psi != reported.psi:
        parts.append('`fixed={"psi": "0 m3/m"}`' if best.psi == "zero" else "leave psi free")
    return f"Consider: {', '.join(parts)}."


def _psi(problem: Problem) -> Psi:
    if "psi" in problem.names:
        return "prior" if "psi" in problem.priors else "free"
    return "set" if problem.values["psi"] != 0.0 else "zero"


def _psis(problem: Problem) -> tuple[Psi, ...]:
    own = _psi(problem)
    return {"zero": (own, "free"), "set": (own, "free", "zero")}.get(own, (own, "zero"))


def _problem(problem: Problem, model: Model, psi: Psi) -> Problem:
    """Return the problem of another model of the same data."""
    actuator = [name for name in problem.names if name in ("K1", "T1")]
    fixed = {name: x for name, x in problem.values.items() if name in ("K1", "T1")}
    if psi in ("zero", "set"):
        fixed["psi"] = 0.0 if psi == "zero" else problem.values["psi"]
    names = [*default_names(model.law, list(fixed)), *actuator]
    priors = {n: p for n, p in problem.priors.items() if n in names}
    assumed = problem.assumed._replace(fixed=fixed, priors=priors)
    return Problem(problem.experiments, model, names, assumed)


def begin_of(
    other: Problem, problem: Problem, values: Mapping[str, float], *, held: bool = False
) -> dict[str, float]:
    """Return values for another model where a fit ended, or as near as its drag law can be.

    held: with hardly any of the drag that the fit had none of.
    """
    m = problem.model.mass(values)
    speed = _usual_speed(problem)
    own_l, own_t = problem.model.drag(values)
    drag = own_l * speed + own_t * speed**2  # N at that speed
    laminar, turbulent = drag / speed, drag / speed**2
    if other.model.law == "blended":  # which holds the law that was fitted
        trace = _HARDLY if held else _TRACE
        ends = m / NAMES["T2"].limits[1], other.model.specific_weight / NAMES["K2"].limits[1]
        laminar = own_l or max(trace * laminar, *(2.0 * end for end in ends))
        turbulent = own_t or (not held) * _TRACE * turbulent
    begin = {"mass": m, "K2": other.model.specific_weight / laminar, "T2": m / laminar}
    return begin | {"drag_quadratic": turbulent, "psi": values["psi"]}


def _usual_speed(problem: Problem) -> float:
    ends = [(t, z, end) for t, z in _stretches(problem) for end in (len(z) - 1, len(z) // 2)]
    speeds = [abs(float(z[end] - z[0])) / float(t[end] - t[0]) for t, z, end in ends]
    return max(float(np.mean(speeds)), 1e-3)


def _stretches(problem: Problem) -> Iterator[tuple[Array, Array]]:
    """Yield time and depth of every stretch under way."""
    for e in problem.experiments:
        for s in e.segments:
            yield e.record.time[s.first : s.last + 1], e.record.depth[s.first : s.last + 1]


def _worth(coefficients: tuple[float, ...], n: int) -> float:
    """Return which share of the samples is independent."""
    gamma = autocovariance(coefficients, 1.0, int(n))
    return float(1.0 / max(2.0 * gamma.sum() - 1.0, 1.0))


def _choice(problem: Problem, fit: Ended, psi: Psi, worth: float, *, reported: bool) -> Choice:
    return Choice.of(
        problem,
        psi,
        problem.named(fit.x),
        max(worth * float(problem.rows[-1]), 2.0),
        rms=float(np.sqrt((fit.weight * fit.residual**2).sum() / fit.weight.sum())),
        log_likelihood=-0.5 * worth * fit.objective,
        reported=reported,
    )


LIMIT = 0.3  # of a parameter, or of what is large for one that may be 0: more is not known
_PART = 0.35  # of a direction of length 1, at which a parameter takes part in it


class Direction(NamedTuple):
    """A combination of the parameters, and how well the data alone determine it."""

    parts: Array  # [p] of length 1
    std: float  # in shares of the parameters, or of their scales


class Curvature(NamedTuple):
    """What is known of x, of a fit or of one that is predicted: the vehicle's parameters first.

    information: without the priors of these.
    """

    x: Array
    covariance: Array
    information: Array

    @classmethod
    def of(cls, problem: Problem, fit: Fit) -> "Curvature":
        """Return that of a fit."""
        own = problem.prior_rows(fit.x)[1][len(problem.priors) :]
        return cls(fit.x, fit.covariance, fit.data + own.T @ own)


def directions(problem: Problem, known: Curvature) -> list[Direction]:
    """Return the directions of the vehicle's parameters, best known first.

    From the singular values of the sensitivity, everything that belongs to single experiments
    eliminated, with the priors of the neutral volumes and without those of the parameters.
    """
    values, vectors = np.linalg.eigh(eliminated(known.information, problem.shared)[0])
    stds = 1.0 / np.sqrt(np.maximum(values, 1e-14 * max(float(values[-1]), 1e-300)))
    return [Direction(vectors[:, i], float(stds[i])) for i in range(len(stds) - 1, -1, -1)]


def not_identifiable(problem: Problem, known: Curvature) -> Iterator[Finding]:
    """Yield a finding of severity no for every question that data and priors leave open."""
    p = problem.shared
    std = np.sqrt(np.diag(known.covariance)[:p])
    values = problem.named(known.x)
    limits = np.array([limit(problem, values, i) for i in range(p)])
    left = {i for i in range(p) if std[i] > limits[i]}

    def of(parts: list[int]) -> Finding:
        """Return the finding that a parameter, or a combination of several, is not identifiable."""
        names = [problem.names[i] for i in parts]
        what = _what(names, float(std[parts[0]]), problem)
        found = Finding.of("motion", "not identifiable", what=what, remedy=_remedy(names, problem))
        return found._replace(kind="trade-off") if len(names) > 1 else found

    for direction in reversed(directions(problem, known)) if left else ():
        scaled = np.abs(direction.parts) / limits
        parts = np.flatnonzero(scaled > _PART * scaled.max()).tolist()
        if left.isdisjoint(parts) or direction.std * float(scaled.max()) < 0.5:
            continue
        left -= set(parts)
        yield of(parts)
    for i in sorted(left):
        yield of([i])


def not_determined(
    problem: Problem, estimates: Mapping[str, Estimate], misfit: float = 1.0
) -> Iterator[Finding]:
    """Yield a finding of severity no for each parameter whose interval is none.

    misfit: the residual over the sensor's noise.
    """
    for name in problem.names:
        logarithmic = problem.model.logarithmic(name)
        limits = NAMES[name].limits if logarithmic else (-math.inf, math.inf)
        if why := undetermined(estimates[name], limits, misfit):
            yield Finding.of("motion", "undetermined", name=name, why=why)


def limit(problem: Problem, values: Mapping[str, float], i: int) -> float:
    """Return how uncertain the i-th entry of x may be [in its own unit]."""
    if problem.logarithmic[i]:
        return LIMIT
    if problem.names[i] == "psi":
        return 10.0
    # a turbulent drag that may be none: identified, where it is small against the drag there is
    k_dl = problem.model.specific_weight / values["K2"]
    fastest = max(_fastest(problem), 1e-3)
    return max(1.0, k_dl / fastest / problem.scale[i])


def _fastest(problem: Problem) -> float:
    """Return the largest speed of the experiments, by and large [m/s]."""
    spans = [(t, z, max(2, len(t) // 10)) for t, z in _stretches(problem)]
    return max(float(np.abs((z[n:] - z[:-n]) / (t[n:] - t[:-n])).max()) for t, z, n in spans)


def _what(names: list[str], std: float, problem: Problem) -> str:
    """Say that a parameter, with its standard deviation, or several are not identifiable."""
    *some, name = names
    place = ("motion", "not identifiable")
    if some:
        return sentence(*place, "several", names=f"{', '.join(some)} and {name}")
    if not problem.logarithmic[problem.names.index(name)]:
        return sentence(*place, "one", name=name)
    return sentence(*place, "one_by", name=name, by=in_percent(std))


def in_percent(share: float) -> str:
    """Return a standard error, as a share of a value, in words."""
    return f"{100.0 * share:.0f} %" if share < 10.0 else "over 1000 %"


def _remedy(names: list[str], problem: Problem) -> str:
    known = "give psi a prior or a value (`priors=`, `fixed=`)"
    if "psi" in names:
        other = "run a longer dive, or several with volume changes of different size"
        return f"G{known[1:]}, or {other}."
    if "drag_quadratic" in names and problem.model.law == "blended":
        return "Choose `drag='linear'` or quadratic, or run at speeds that differ more."
    if "drag_quadratic" in names or "K2" in names:
        also = f", or {known}" if "psi" in problem.names else ""
        return f"Run longer, so that the speed settles, and with larger changes of volume{also}."
    if "mass" in names or "T2" in names:
        return "Record how the speed builds up: more samples soon after a change of volume."
    return "Give a value (`fixed=`) or a prior (`priors=`), or record steps that excite it."


_SURE = 3.0  # standard deviations
_TOO_LATE = 3.2  # standard deviations of what was stated: so late is what a filter gave
_BEYOND = 10.0  # standard deviations from what was stated: data or statement are wrong
_FOLLOWED = 0.05  # of the depths' deviation: the residual where the model follows
_MANY = 0.02  # share of the samples
_UNSEEN = 0.999  # of the prior's variance, above which a log says nothing of its drift


def _rows_of(problem: Problem, fit: Fit, j: int) -> tuple[slice, Array, Array, Index]:
    """Return experiment j's rows, their slopes and weights [1/m2], and the entries of x in them."""
    part = slice(problem.rows[j], problem.rows[j + 1])
    J = fit.slope[part]
    used = np.flatnonzero(np.abs(J).max(axis=0) > 0.0)
    return part, J, fit.weight[part] / fit.noise[j] ** 2, used


def drift(problem: Problem, fit: Fit, j: int) -> Estimate:
    """Return how fast experiment j's neutral volume drifts [m3/s], its prior taken off again."""
    at, known = problem.first_drift + j, (problem.drift_std / DRIFT) ** 2
    left = max(float(fit.covariance[at, at]), 1e-300)
    if not left < _UNSEEN * known:
        return Estimate.of(0.0, math.inf, "m3/s")
    std = math.sqrt(1.0 / (1.0 / left - 1.0 / known))
    return Estimate.of(float(fit.x[at]) * std**2 / left * DRIFT, std * DRIFT, "m3/s")


def single_gains(problem: Problem, fit: Fit) -> list[tuple[float, float, float]]:
    """Return (volume step [m3], logarithm of its own gain over the joint one, std) by experiment.

    One step of a fit of each experiment by itself, all but psi its own, from its residuals. The
    gain is K2; for a quadratic drag the inverse of the drag.
    """
    name = "K2" if "K2" in problem.names else "drag_quadratic"
    if name not in problem.names:
        return []
    i = problem.names.index(name)
    per = 1.0 if problem.logarithmic[i] else problem.scale[i] / max(problem.value(fit.x, i), 1e-300)
    sign = 1.0 if name == "K2" else -1.0
    P = problem.prior_rows(fit.x)[1][len(problem.priors) :]
    found = []
    for j, e in enumerate(problem.experiments):
        part, J, weight, used = _rows_of(problem, fit, j)
        if i not in used:  # this log says nothing of it
            found.append((e.step(), 0.0, math.inf))
            continue
        mine = [k for k in used.tolist() if k >= problem.shared or problem.names[k] != "psi"]
        A = (J[:, mine] * weight[:, None]).T @ J[:, mine] + P[:, mine].T @ P[:, mine]
        size = np.sqrt(np.diag(A))
        inverse = np.linalg.pinv(A / np.outer(size, size), rcond=1e-12) / np.outer(size, size)
        step = inverse @ (J[:, mine].T @ (weight * fit.residual[part]))
        at = mine.index(i)
        std = math.sqrt(inverse[at, at] * _inflation(fit.ar[j])) * per
        found.append((e.step(), sign * float(step[at]) * per, std))
    return found


def each_experiment(problem: Problem, found: Fit) -> tuple[ExperimentFit, ...]:
    """Return the fit of each log: residuals, weights, and what belongs to it alone."""
    gains = single_gains(problem, found)
    return tuple(
        _experiment(problem, found, j, gains[j][1:] if gains else None)
        for j in range(len(problem.experiments))
    )


def _experiment(
    problem: Problem, found: Fit, j: int, gain: tuple[float, float] | None
) -> ExperimentFit:
    e, part = problem.experiments[j], slice(problem.rows[j], problem.rows[j + 1])
    n = len(e.record.time)
    residual, weight = np.full(n, np.nan), np.zeros(n)
    residual[e.used], weight[e.used] = found.residual[part], found.weight[part]
    at = [problem.shared + j, problem.starts_at[j], problem.starts_at[j] + 1]
    own = np.stack([found.x[at], np.sqrt(np.diag(found.covariance)[at])], axis=1)
    left = residual[weight > 0.0]
    return ExperimentFit.of(
        e,
        own * np.array([[VOLUME], [DEPTH], [SPEED]]),
        found.root[part] * found.residual[part],
        residual=residual,
        weight=weight,
        drift=drift(problem, found, j),
        noise=float(found.noise[j]),
        rms=rms(left) if len(left) else math.nan,
        own_gain=gain if gain and 0.0 < gain[1] < 1.0 else None,
    )


def diagnose(problem: Problem, fit: Fit, experiments: tuple[ExperimentFit, ...]) -> list[Finding]:
    """Return what a person has to know of residuals and nuisances."""
    off = fit.x[problem.shared : problem.first_start] * VOLUME / problem.neutral_std
    return [
        *_autocorrelated(experiments),
        *outliers(experiments),
        *drifts(experiments),
        *_trend(problem, fit),
        *neutral_beyond_prior(problem, off.tolist()),
        *_backwards(problem, fit),
    ]


def _inflation(coefficients: tuple[float, ...]) -> float:
    """Return the variance of a mean of such residuals, over that of white ones."""
    total = sum(coefficients)
    first = min(abs(total), 0.99)  # autocorrelation that gives the variance, near enough
    return max(1.0, (1.0 - first**2) / max(1.0 - total, 1e-2) ** 2)


def _autocorrelated(experiments: tuple[ExperimentFit, ...]) -> Iterator[Finding]:
    bad = [e for e in experiments if e.whiteness_p < 1e-3 / len(experiments)]
    if bad:
        yield Finding.of("motion", "autocorrelated", bad=len(bad), logs=len(experiments))


def outliers(experiments: Sequence[ExperimentFit]) -> Iterator[Finding]:
    """Yield which logs have many outliers; one of which more than a tenth are says nothing."""
    for e in experiments:
        used = int(np.isfinite(e.residual).sum())
        if e.outliers > max(2, _MANY * used):
            away = e.residual[np.isfinite(e.residual) & (e.weight < 0.5)]
            largest = float(np.abs(away).max()) if away.size else 0.0
            severity: Severity = "no" if too_many(e.outliers, used) else "note"
            counts = {"out": e.outliers, "used": used, "largest": largest}
            yield Finding.of("motion", "outliers", severity, log=e.source, **counts)


def drifts(experiments: Sequence[ExperimentFit], said: str = "drift") -> Iterator[Finding]:
    """Yield in which logs the neutral volume drifts; said: key of the sentence."""
    bound = math.sqrt(float(chdtri(1, 0.003 / max(len(experiments), 1))))
    for e in experiments:
        if abs(e.drift.value) > bound * e.drift.std:
            over = e.drift.value * float(np.ptp(e.record.time))
            yield Finding.of("motion", said, log=e.source, over=over, drift=e.drift.value)


def late(delay: Estimate, known: float, early: float = 0.0) -> Iterator[Finding]:
    """Yield where stamps of volumes are clearly late, or early; far beyond what is known, a no.

    known: 1 sigma [s]; early: by how much volumes move early within their samples [1 sigma]. What
    is so late has mostly gone through a filter, which is another shape.
    """
    if abs(delay.value) > _SURE * delay.std:
        by, how = abs(delay.value), "later" if delay.value > 0.0 else "earlier"
        beyond = math.hypot(by, early * known) > _TOO_LATE * known
        kind = "volumes too late" if beyond else "late volumes"
        yield Finding.of("motion", kind, by=by, how=how, std=delay.std, known=known)


def _trend(problem: Problem, fit: Fit) -> Iterator[Finding]:
    gains = np.array([g for g in single_gains(problem, fit) if 0.0 < g[2] < 1.0]).reshape(-1, 3)
    sizes, logs = gains[:, 0], gains[:, 1]
    if len(gains) < 4 or np.ptp(sizes) < 0.2 * sizes.mean():
        return
    x = np.log(sizes)
    (slope, _), known = np.polyfit(x, logs, 1, w=1.0 / gains[:, 2], cov="unscaled")
    scatter = np.polyfit(x, logs, 1, cov=True)[1] if len(gains) > 4 else known
    if abs(slope) < _SURE * math.sqrt(max(known[0, 0], scatter[0, 0])):
        return
    low, high = sizes.min(), sizes.max()
    name = "K2" if "K2" in problem.names else "1/k_dt"
    change = math.exp(slope * math.log(high / low)) - 1.0
    why = sentence("motion", "step-size trend", "falls" if slope < 0.0 else "rises")
    yield Finding.of(
        "motion", "step-size trend", name=name, change=change, low=low, high=high, why=why
    )


def neutral_beyond_prior(problem: Problem, off: Sequence[float]) -> Iterator[Finding]:
    """Yield where neutral volumes are not as known; off: of each log, in standard deviations."""
    if not math.isfinite(problem.neutral_std):
        return
    e = np.array(off)
    if float(chdtrc(len(e), float((e**2).sum()))) <= 1e-3:
        std, largest = problem.neutral_std, float(np.abs(e).max())
        severity: Severity = "no" if largest > _BEYOND else "warning"
        values = {"largest": largest * std, "rms": rms(e) * std}
        yield Finding.of("motion", "neutral prior", severity, **values, assumed=std)


def possible(
    problem: Problem,
    derived: Mapping[str, Estimate],
    parameters: Mapping[str, Estimate],
    dry_mass: float | None,
) -> Iterator[Finding]:
    """Yield where no hull has such a mass, for sure or by the value, or no water such a psi."""
    m, model = derived.get("mass") or parameters["mass"], problem.model
    yield from impossible_mass(m, model.specific_weight * model.displaced, dry_mass)
    asked = "psi" in problem.names and "psi" not in problem.priors
    if asked and not any(len(e.record.layers.table) for e in problem.experiments):
        yield from impossible_psi(parameters["psi"], model.specific_weight, model.displaced)


def sinks_as_it_grows(problem: Problem) -> Iterator[Finding]:
    """Yield where volume or depth is the wrong way round."""
    if backwards(problem.experiments):
        yield Finding.of("motion", "backwards")


def _backwards(problem: Problem, fit: Fit) -> Iterator[Finding]:
    total = float(np.std(problem.measured))
    left = float(np.sqrt(np.mean(fit.residual**2)))
    if left >= _FOLLOWED * total:
        yield from sinks_as_it_grows(problem)


_PRIOR_ONLY = 0.9  # of the prior's deviation is left
_CONTRADICTED = 3.0  # standard deviations from the prior


def against_prior(
    problem: Problem, estimates: Mapping[str, Estimate]
) -> tuple[dict[str, Estimate], list[Finding]]:
    """Return the estimates, marked where the prior says most, and which priors are wrong."""
    found, findings = dict(estimates), list[Finding]()
    for name, prior in problem.priors.items():
        e = estimates[name]
        findings += _contradicted(name, e, prior)
        if e.std > _PRIOR_ONLY * prior.std:
            found[name] = replace(e, origin="prior")
            findings.append(Finding.of("motion", "adds little", name=name))
    return found, findings


def _contradicted(name: str, e: Estimate, prior: Prior) -> Iterator[Finding]:
    """Yield a warning where data and prior can hardly both be right, far apart a no."""
    shift = math.sqrt(max(prior.std**2 - e.std**2, 0.0))  # of the estimate, if the prior is right
    off = abs(e.value - prior.mean) / max(shift, 0.1 * prior.std)
    if off > _CONTRADICTED:
        found, mean, std = (
            format_quantity(value, e.unit, shown_unit(e.unit), digits=3)
            for value in (e.value, prior.mean, prior.std)
        )
        severity: Severity = "no" if off > _BEYOND else "warning"
        yield Finding.of(
            "motion", "contradicts", severity, name=name, found=found, mean=mean, std=std
        )
