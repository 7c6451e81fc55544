"""K1, T1, dead zone, asymmetry and rate from voltage steps: output error, maximum likelihood.

What is made small is measured less simulated position, the simulation being exact
(`model.respond`). Each block has its own unknown start and a gain of its own about the common one,
by as much as may be after seeing the log (`gains`); the residual is an autoregression. Gross
outliers are left out. The standard deviations are those of the whitened problem, the interval of T1
comes from its profile likelihood, and what the sensitivities cannot distinguish is not
identifiable.

A driver may start softly: the motor then gets less than the logged voltage for a while. The fit to
voltage steps is repeated with a voltage that can change only so fast. That has one number more than
the fit has; where it is by far the likelier, T1 is the ramp's as well.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from swimbladder.estimation.actuator import model
from swimbladder.estimation.actuator.bench import Bench, Block, autoregression, cut, spikes
from swimbladder.estimation.actuator.result import PARAMETERS, Step
from swimbladder.estimation.estimates import Z95, Estimate, bounded_fit, crossing, sentence
from swimbladder.estimation.series import WHITE, Autoregression, scale
from swimbladder.physics.arrays import Array, Flags

_OUTLIER = 10.0  # deviance that leaving a sample out costs


@dataclass(frozen=True)
class VoltageFit:
    """The fit at its best.

    q: free parameters as they are turned; covariance: of q; known, blind: directions of q that are
    identifiable and not, in columns; spread: what is known of how the gains of the blocks differ.
    residual: measured less fitted of every sample in a block [m], its start taken off.
    """

    problem: model.Problem
    q: Array
    covariance: Array
    known: Array
    blind: Array
    sigma: float  # m, of the innovations
    spread: model.Spread
    residual: Array

    @property
    def values(self) -> dict[str, float]:
        """All parameters in SI."""
        return self.problem.values(self.q)

    def spread_along(self, direction: Array) -> tuple[float, float]:
        """Return standard deviation and half the 95 % interval along a direction of q."""
        std = math.sqrt(max(float(direction @ self.covariance @ direction), 0.0))
        if not self.known.size or std == 0.0:
            return std, 1.96 * std
        variances = self.spread.variances(self.known, direction)
        return std, model.half_width(self.spread.weights, variances)

    @property
    def widened(self) -> float:
        """By how much gains that may differ widen the interval of the gain: 1, not at all."""
        if "K1" not in self.problem.free or not self.known.size:
            return 1.0
        K1 = np.array([float(name == "K1") for name in self.problem.free])
        variances = self.spread.variances(self.known, K1)
        alike = 1.96 * math.sqrt(max(float(variances[0]), 1e-300))
        return model.half_width(self.spread.weights, variances) / alike

    @property
    def repeats(self) -> int:
        """How many steps there are beyond those that the gains need."""
        needed = sum(name != "T1" for name in self.problem.free)
        return int((self.problem.whiten.size > 0.0).sum()) - needed if self.problem.whiten else 0

    @property
    def deviance(self) -> float:
        """Minus twice the logarithm of the likelihood, but for a constant."""
        problem, whiten = self.problem, self.problem.whiten
        assert whiten is not None
        n, out = int(problem.used.sum()), int((~problem.used & ~problem.early).sum())
        lost = float(np.sum(problem.white(self.q) ** 2))
        scales = float(np.log(whiten.keep).sum()) + float(np.log(whiten.matrix.diagonal()).sum())
        return n * math.log(max(lost / n, 1e-300)) - 2.0 * scales + out * _OUTLIER

    @property
    def noise(self) -> float:
        """Standard deviation of the residuals, outliers aside [m]."""
        return float(self.residual[self.problem.used].std())


def named(fit: VoltageFit) -> tuple[str, ...]:
    """Return the free parameters that no blind direction touches."""
    touched = (fit.blind**2).max(axis=1, initial=0.0) > 0.02
    return tuple(n for n, hit in zip(fit.problem.free, touched.tolist(), strict=True) if not hit)


_ROUNDS = 4
_FAR = 6.0  # robust standard deviations of all residuals beyond which a sample is an outlier
_LIMIT_SEEN = 6.63  # deviance that a rate limit has to gain: 1 % by chance
_VAGUE, _VAGUE_T1 = 0.15, 0.5  # standard deviations of what is turned without information
_SETTLED = 6.0  # T1 after which nobody knows how a run began
_CLEARLY = 20.0  # squares of sigma by which a start at rest has to be better
_LEVEL = 0.6  # of the steepest gain: the speeds level off


def fit_voltage(benches: Sequence[Bench], fixed: Mapping[str, float]) -> VoltageFit:
    """Return the fit to the voltage steps of all benches.

    fixed: values in SI of what is not fitted. Raises NoAnswerError where there are no steps.
    """
    blocks = [block for log, bench in enumerate(benches) for block in cut(bench, log)]
    names = ("K1", "T1", "dead_zone", "load_voltage", "asymmetry")
    free = tuple(name for name in names if name not in fixed)
    guess = model.first_guess(benches, free)
    one_way = _one_way(benches, blocks, guess)
    held = {"asymmetry": 1.0, "load_voltage": 0.0} if one_way else {}
    fixed = {**held, **fixed}
    free = tuple(name for name in free if name not in fixed)
    problem = model.Problem(benches, blocks, free, fixed, _driven_at_once(benches, guess))
    q = model.robustly(problem, {**guess, **fixed})
    if any(problem.moving.values()):
        _at_rest(problem, q)
        q = model.robustly(problem, {**problem.values(q), **fixed})
    fit = _refine(problem, q)
    return fit if "rate" in fixed else _with_limit(fit) or fit


def _one_way(benches: Sequence[Bench], blocks: Sequence[Block], guess: Mapping[str, float]) -> bool:
    """Return whether the voltages that move the actuator all have one sign."""
    signs = set()
    for block in blocks:
        over = benches[block.log].volts[block.samples] - guess["load_voltage"]
        moved = np.abs(over) > guess["dead_zone"] * 1.02
        signs |= set(np.sign(over[moved]).tolist())
    return len(signs - {0.0}) < 2


def _driven_at_once(
    benches: Sequence[Bench], guess: Mapping[str, float]
) -> dict[tuple[int, int], bool]:
    """Return for each run whether it begins under a voltage that moves the actuator."""
    found = {}
    for log, bench in enumerate(benches):
        least = guess["dead_zone"] + 0.02 * float(np.abs(bench.volts).max())
        for run, (first, _) in enumerate(bench.runs):
            found[log, run] = abs(float(bench.volts[first]) - guess["load_voltage"]) > least
    return found


def _at_rest(problem: model.Problem, q: Array) -> None:
    """Say of the runs that begin under a voltage which begin at rest all the same.

    It has to be far more likely than that the motion was steady: else their start is left out.
    """
    size = max(scale(problem.by_median(problem.residual(q))), model.tolerance(problem.benches))
    for place in [place for place, moving in problem.moving.items() if moving]:
        own = [k for k, b in enumerate(problem.blocks) if (b.log, b.run) == place]
        first = problem.block == (own[0] if own else -1)

        def loss(first: Flags = first) -> float:
            off = problem.by_median(problem.residual(q))[first] / size
            return float(np.sum(np.minimum(off**2, 25.0)))

        steady = loss()
        problem.moving[place] = False
        problem.moving[place] = loss() > steady - _CLEARLY


def _refine(problem: model.Problem, q: Array) -> VoltageFit:
    """Return the fit with outliers left out, and noise and differing gains as they show."""
    noise = WHITE
    for round_ in range(_ROUNDS):
        _leave_out(problem, q)
        if round_ > 0:
            left, used = problem.centred(problem.residual(q)), problem.used
            left = problem.without_own_gains(q, left)
            ends = np.flatnonzero(np.diff(problem.block[used])) + 1
            noise = autoregression(np.split(left[used], ends))
        spread = _whiten(problem, q, noise)
        before, q = q, solve(problem, q)
        if round_ > 1 and np.abs(q - before).max(initial=0.0) < 1e-5:
            break
    jacobian, residual = model.slope(problem, q), problem.white(q)
    lost = len(q) + len(np.unique(problem.block[problem.used]))
    sigma = math.sqrt(float(residual @ residual) / max(len(residual) - lost, 1))
    sigma = max(sigma, model.FINEST * model.tolerance(problem.benches))
    of_q = _covariance(jacobian, sigma, problem.free)
    return VoltageFit(problem, q, *of_q, sigma, spread, problem.centred(problem.residual(q)))


def _whiten(problem: model.Problem, q: Array, noise: Autoregression) -> model.Spread:
    """Choose the whitener of a noise, and of gains that differ as far as can be known."""
    problem.whitened_with(q, noise, 0.0, 0.0)
    spread = model.gains(problem, q)
    sigma = float(spread.sigmas @ spread.weights)
    problem.whitened_with(q, noise, spread.typical, sigma)
    return spread


def solve(problem: model.Problem, q: Array) -> Array:
    """Return the free parameters, as they are turned, that make the whitened residuals small."""
    size = max(model.tolerance(problem.benches), 1e-12)

    def residual(x: Array) -> Array:
        return problem.white(x) / size

    def jacobian(x: Array) -> Array:
        return model.slope(problem, x) / size

    ends = (1e-8, 1e-9, 1e-9)
    return bounded_fit(residual, jacobian, q, problem.bounds(), ends=ends, most=40)[1]


def _leave_out(problem: model.Problem, q: Array) -> None:
    """Mark the samples that are no outliers."""
    residual = problem.by_median(problem.residual(q))
    size = scale(residual)
    for k, block in enumerate(problem.blocks):
        bench, own = problem.benches[block.log], problem.block == k
        least = bench.quantum + 1e-9 * float(np.ptp(bench.position))
        far = np.abs(residual[own]) > max(_FAR * size, least)
        problem.used[own] = ~(spikes(residual[own], least) | far)
        if problem.moving[(block.log, block.run)]:
            time = bench.time[block.samples] - bench.time[bench.runs[block.run][0]]
            problem.early[own] = time <= _SETTLED * problem.values(q)["T1"]
            problem.used[own] &= ~problem.early[own]


def _covariance(jacobian: Array, sigma: float, free: Sequence[str]) -> tuple[Array, Array, Array]:
    """Return the covariance, and the directions that are identifiable and not, in columns.

    A direction is not identifiable where its standard deviation exceeds a seventh of what is
    turned, or for the time constant a half: there the quadratic picture ends.
    """
    limit = np.array([_VAGUE_T1 if name == "T1" else _VAGUE for name in free])
    _, singular, directions = np.linalg.svd(jacobian * limit, full_matrices=False)
    with np.errstate(divide="ignore"):
        std = np.where(singular > 1e-12 * singular[0], sigma / singular, np.inf)
    known = std < 1.0
    kept = directions[known] * std[known, None] * limit
    return kept.T @ kept, (directions[known] * limit).T, directions[~known].T


def _with_limit(fit: VoltageFit) -> VoltageFit | None:
    """Return the fit with a limit of the speed, where the speeds suggest one and it is better."""
    problem = fit.problem
    rows = np.concatenate([model.speeds(b) for b in problem.benches])
    top = _levels_off(rows, problem.top)
    if top is None:
        return None
    slower = rows[np.abs(rows[:, 1]) < 0.95 * top]
    guess = {**model.guess_from(slower, problem.top, problem.free), **problem.fixed, "rate": top}
    limited = problem.changed((*problem.free, "rate"))
    limited.used[:], limited.early[:] = True, False
    found = _refine(limited, model.robustly(limited, guess))
    return found if found.deviance < fit.deviance - _LIMIT_SEEN else None


def _levels_off(rows: Array, top: float) -> float | None:
    """Return the largest speed [m/s] where the speeds level off towards the largest voltages."""
    for sign in (1.0, -1.0):
        u, v = sign * rows[:, 0], sign * rows[:, 1]
        sizes = np.rint(20.0 * u / top)
        own = [s for s in np.unique(sizes).tolist() if s > 0.0 and np.median(v[sizes == s]) > 0.0]
        if len(own) < 3:
            continue
        x = np.array([np.median(u[sizes == s]) for s in own])
        y = np.array([np.median(v[sizes == s]) for s in own])
        slopes = np.diff(y) / np.diff(x)
        if slopes[-1] < _LEVEL * slopes[:-1].max():
            return float(y.max())
    return None


_ONE_SIDED = 1.6448536269514722
_FASTEST = 1e-3  # of the time between samples: as good as none
_SLOWEST = 1e6  # times the fitted one: as good as a double integrator


def profile_of_T1(fit: VoltageFit) -> Estimate:
    """Return T1 [s] with the interval in which its deviance stays below that of 95 %.

    Where a T1 of nothing is as likely, an upper bound is returned and no value. One shorter than
    the time between samples may be longer by as much: voltages may change before they are logged.
    """
    at = fit.problem.free.index("T1")
    best, std = float(fit.q[at]), math.sqrt(float(fit.covariance[at, at])) or 0.3
    others = [k for k in range(len(fit.q)) if k != at]
    problem = fit.problem.changed(tuple(name for name in fit.problem.free if name != "T1"))
    least = float(np.sum(fit.problem.white(fit.q) ** 2))

    def root(log_T1: float) -> float:
        """Return the root of the deviance at a T1, everything else fitted anew."""
        problem.fixed = {**fit.problem.fixed, "T1": math.exp(log_T1)}
        q = solve(problem, fit.q[others]) if others else fit.q[others]
        left = float(np.sum(problem.white(q) ** 2))
        return math.sqrt(max(left - least, 0.0)) / fit.sigma

    def end(begin: float, std: float, level: float, offset: float = 0.0) -> float:
        """Return the T1 [s] to one side where the root of the deviance is `level`.

        offset: the root that is taken as the best one. `std` is a first guess, its sign the side.
        0 or infinity where the root stays below that level.
        """
        above, farthest, fine = math.hypot(level, offset), math.log(_SLOWEST), 1e-3 * abs(std)

        def beyond(x: float) -> float:
            return root(begin + x) - above

        x = crossing(beyond, level * std, farthest=farthest, growth=1.7, xtol=fine)
        return math.exp(begin + (math.copysign(math.inf, std) if x is None else x))

    step = min(b.step for b in fit.problem.benches)
    shortest = math.log(_FASTEST * step)
    nothing = root(shortest)
    if nothing < Z95:
        bound = step + end(max(best, shortest), max(std, 0.3), _ONE_SIDED, nothing)
        why = f"T1 is shorter than samples every {step:.3g} s resolve: below {bound:.3g} s with a "
        why += "confidence of 95 %"
        return Estimate.bounded(0.0, bound, "s", why)
    value, low, high = math.exp(best), end(best, -std, Z95), end(best, std, Z95)
    late = step if value < step else 0.0
    found = Estimate.of(value, math.hypot(value * std, late / math.sqrt(12.0)), "s")
    return replace(found, ci95=(low, high + late))


_RAMPS = (0.3, 0.6, 1.0, 1.5, 2.0, 3.0)  # of the fitted T1: a ramp to the largest voltage
_SEEN = 15.0  # deviance by which it has to be better, of one parameter more and six trials
_LEADS = (0.25, 0.5, 0.75)  # of the time between samples, by which voltages change earlier
_LED = 4.0  # deviance by which that has to be better: a wider interval of T1 is all it costs


class SoftStart(NamedTuple):
    """How long the voltage takes to rise to the largest [s], and T1 [s] if it does."""

    ramp: float
    T1: float


def soft_start(fit: VoltageFit) -> SoftStart | None:
    """Return the soft start that makes the fit by far the likelier, None where there is none."""
    if "T1" not in named(fit):
        return None
    problem, T1 = fit.problem, fit.values["T1"]
    best, found = _deviance(problem, fit.q) - _SEEN, None
    for ramp in (share * T1 for share in _RAMPS):
        slow = [slewed(b, problem.top / ramp) for b in problem.benches]
        left, shorter = _driven_by(slow, fit, max(T1 - 0.4 * ramp, 0.1 * T1))
        if left < best:
            best, found = left, SoftStart(ramp, shorter)
    return found


def between_samples(fit: VoltageFit) -> list[Bench] | None:
    """Return the benches with voltages that change between samples, where that is far likelier."""
    problem, T1 = fit.problem, fit.values["T1"]
    if "T1" not in problem.free:
        return None
    best, found = _deviance(problem, fit.q) - _LED, None
    for share in _LEADS:
        led = [_earlier(b, share) for b in problem.benches]
        left, _ = _driven_by(led, fit, T1 + share * led[0].step)
        if left < best:
            best, found = left, led
    return found


def _earlier(bench: Bench, share: float) -> Bench:
    """Return the bench with the means of voltages that change that much of a sample earlier."""
    u = bench.volts
    mean = np.append((1.0 - share) * u[:-1] + share * u[1:], u[-1])
    return replace(bench, voltage=mean, clock=bench.step / math.sqrt(12.0))


def _deviance(problem: model.Problem, q: Array) -> float:
    left = float(np.sum(problem.white(q) ** 2))
    return int(problem.used.sum()) * math.log(max(left, 1e-300))


def _driven_by(benches: Sequence[Bench], fit: VoltageFit, T1: float) -> tuple[float, float]:
    """Return deviance and T1 [s] of the fit with the voltages of `benches`, from a T1 on."""
    other = fit.problem.changed(fit.problem.free, benches)
    q = solve(other, other.turned({**fit.values, "T1": T1}))
    return _deviance(other, q), other.values(q)["T1"]


def slewed(bench: Bench, most: float) -> Bench:
    """Return the bench with a voltage that changes by at most `most` [V/s].

    What a sample has is the mean until the next, as the voltage is taken to be held.
    """
    asked, step = bench.volts, np.diff(bench.time)
    mean, now = asked.copy(), float(asked[0])
    for k, (goal, h) in enumerate(zip(asked[:-1].tolist(), step.tolist(), strict=True)):
        way = goal - now
        taken = min(abs(way) / most, h)
        then = now + math.copysign(most * taken, way) if abs(way) > most * h else goal
        mean[k] = (0.5 * (now + then) * taken + then * (h - taken)) / h
        now = then
    return replace(bench, voltage=mean)


def from_voltage(fit: VoltageFit, chosen: Mapping[str, float], unit: str) -> dict[str, Estimate]:
    """Return K1, T1, dead_zone, load_voltage, asymmetry and rate; not identifiable ones say why.

    chosen: what the user has set; unit: of the position.
    """
    values, identified = fit.values, named(fit)
    found: dict[str, Estimate] = {}
    for name, in_metres in PARAMETERS.items():
        of = in_metres.replace("m", unit) or "-"
        if name in chosen:
            found[name] = Estimate.given(chosen[name], of)
        elif name not in fit.problem.free:
            no_limit = name == "rate"
            found[name] = _rate(fit, of) if no_limit else Estimate.unknown(of, _ONE_WAY[name])
        elif name == "T1" and (name in identified or "K1" in identified):
            found[name] = profile_of_T1(fit)
        elif name not in identified or ("K1" in fit.problem.free and "K1" not in identified):
            found[name] = Estimate.unknown(of, _blind(fit))
        else:
            alone = {name: 1.0}
            log = name in model.LOGARITHMIC
            found[name] = _along(fit, values[name], of, logarithmic=log, **alone)
            if name == "dead_zone" and found[name].ci95[0] < 0.0:
                found[name] = replace(found[name], ci95=(0.0, found[name].ci95[1]))
    return found


def _along(
    fit: VoltageFit, value: float, unit: str, *, logarithmic: bool, **weights: float
) -> Estimate:
    """Return the estimate of what changes with the weighted sum of what is turned."""
    size = value if logarithmic else fit.problem.top
    std, reach = fit.spread_along(np.array([weights.get(name, 0.0) for name in fit.problem.free]))
    return Estimate.of(value, size * std, unit, reach=size * reach, logarithmic=logarithmic)


_ONE_WAY = {
    "asymmetry": "the voltages moved it in one direction only",
    "load_voltage": "the voltages moved it in one direction only: a load counts as dead zone",
}


def _rate(fit: VoltageFit, unit: str) -> Estimate:
    if "K1" in fit.problem.free and "K1" not in named(fit):
        return Estimate.unknown(unit, _blind(fit))
    drive, top = model.drive_of(fit.values), fit.problem.top
    fastest = max(abs(model.steady_speed(top, drive)), abs(model.steady_speed(-top, drive)))
    reached = f"at {top:.3g} V, the largest voltage, it reaches {model.shown(fastest, unit)}"
    return Estimate.bounded(fastest, math.inf, unit, f"no limit is seen: {reached}")


def _blind(fit: VoltageFit) -> str:
    """Return the sentence on what the logs cannot distinguish."""
    names = set(fit.problem.free) - set(named(fit))
    if {"K1", "T1"} <= names and "dead_zone" not in names:
        return sentence("actuator", "K1 and T1")
    if "dead_zone" in names and names & {"K1", "asymmetry"}:
        return sentence("actuator", "dead zone and gain", names=_and(names))
    return sentence("actuator", "trade-off", names=_and(names))


def _and(names: set[str]) -> str:
    words = sorted(names)
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def by_direction(fit: VoltageFit, found: dict[str, Estimate], unit: str) -> dict[str, Estimate]:
    """Return the gains and the edges of the dead zone outward and inward, if identified."""
    drive, each_way, edges = model.drive_of(fit.values), [], []
    for way, sign, gain in (("out", 1.0, drive.K_out), ("in", -1.0, drive.K_in)):
        each_way.append((f"K1_{way}", gain, f"{unit}/s/V", {"K1": 1.0, "asymmetry": 0.5 * sign}))
        weights = {"dead_zone": 1.0, "load_voltage": sign}
        edge = sum(x * fit.values[name] for name, x in weights.items())
        edges.append((f"threshold_{way}", edge, "V", weights))
    return {
        name: _along(fit, value, of, logarithmic="K1" in weights, **weights)
        for name, value, of, weights in (*each_way, *edges)
        if all(found[n].known for n in weights)
    }


def covariance_of(fit: VoltageFit, found: dict[str, Estimate]) -> dict[str, dict[str, float]]:
    """Return the covariance of the identified parameters, in SI, by name."""
    values = fit.values
    identified = [n for n in fit.problem.free if found[n].known]
    sizes = {n: values[n] if n in model.LOGARITHMIC else fit.problem.top for n in identified}
    at = {n: fit.problem.free.index(n) for n in identified}
    return {
        a: {b: float(fit.covariance[at[a], at[b]]) * sizes[a] * sizes[b] for b in identified}
        for a in identified
    }


def steps_of(fit: VoltageFit, logged: Sequence[Bench]) -> tuple[Step, ...]:
    """Return what was fitted, block by block, with the voltages that were logged."""
    found, problem = [], fit.problem
    alike = 0.02 * problem.top
    for k, block in enumerate(problem.blocks):
        own = problem.block == k
        bench = logged[block.log]
        u, x = bench.volts[block.samples], bench.position[block.samples]
        sizes = u[np.abs(u) > alike]
        low, high = (float(sizes.min()), float(sizes.max())) if len(sizes) else (0.0, 0.0)
        label = f"{low:.3g} V" if high - low < alike else f"{low:.3g} to {high:.3g} V"
        time, fitted, used = bench.time[block.samples], x - fit.residual[own], problem.used[own]
        found.append(Step(bench.source, label, time, x, fitted, used, voltage=u))
    return tuple(found)
