"""The estimate of a parameter, and how those of several steps or logs are pooled.

Gains differ from block to block, which widens the estimates. Each block's gain is the common one
and a part of its own, normal with a standard deviation that is the same for all: the spread. Few
blocks hardly determine it, and blocks that are no more than the gains need not at all; the
residuals then look like noise alone, however much they differ. So the spread is not estimated and
then believed: it has a prior, the data's restricted likelihood is laid over it, and the intervals
are those of the mixture.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.errors import NoAnswerError
from swimbladder.estimation.actuator.model import Problem, tolerance
from swimbladder.estimation.estimates import Estimate
from swimbladder.estimation.series import Array
from swimbladder.units import format_quantity

_DIFFER = 2.71  # deviance that differing gains have to gain: 5 % by chance
_PRIOR, _PRIOR_DF = 0.015, 3.0  # scale and degrees of freedom of Student's half t
# Six series of ten moves of a measured motor have spreads of 0.2 to 1.7 %
# (docs/how-to/identify-actuator.md); the prior's median is 1.1 %, and one in twenty is above 4.8 %.
FINEST = 1e-2  # of the tolerance of a position: less is no noise that a sensor has
_LEAST, _MOST, _TRIALS = 1e-5, 1.0, 41  # shares that are tried


@dataclass(frozen=True)
class Spread:
    """What is known of the spread, a share, after seeing the data.

    shares: those tried; weights: their probabilities; sigmas: of the innovations [m]; information:
    on what is turned, in units of the innovations, [trials, p, p]. significant: whether the data
    show one; likely: their estimate of it.
    """

    shares: Array
    weights: Array
    sigmas: Array
    information: Array
    significant: bool
    likely: float

    @property
    def typical(self) -> float:
        """Root mean square of the spread: at it the variances are those of the mixture."""
        return math.sqrt(float(self.weights @ self.shares**2))

    def variances(self, basis: Array, direction: Array) -> Array:
        """Return for each share the variance along a direction.

        Only what lies in the columns of `basis` [p, known] is known.
        """
        w = basis.T @ direction
        inner = basis.T @ self.information @ basis
        along = [float(w @ np.linalg.solve(H, w)) for H in inner]
        return np.asarray(self.sigmas**2 * np.array(along))

    def reach(self, variances: Array) -> float:
        """Return half the width of the 95 % interval of a mixture of normals about one mean."""
        from scipy.optimize import brentq
        from scipy.special import erfc

        std = np.sqrt(np.maximum(variances, 1e-300))

        def beyond(x: float) -> float:
            return float(self.weights @ erfc(x / (math.sqrt(2.0) * std))) - 0.05

        most = 1.96 * float(std.max())
        return float(brentq(beyond, 0.0, 1.01 * most, xtol=1e-6 * most))


def slope(problem: Problem, q: Array) -> Array:
    """Return the derivative of the whitened residuals [n, p], by central differences."""
    columns = []
    for k in range(len(q)):
        h = np.zeros(len(q))
        h[k] = 1e-5
        columns.append((problem.white(q + h) - problem.white(q - h)) / 2e-5)
    return np.stack(columns, axis=1)


def gains(problem: Problem, q: Array) -> Spread:
    """Return the estimate of the spread, of the problem made linear at q.

    The problem's whitener is that of equal gains. The variance along each block's own gain is
    1 + (spread size/sigma)^2 times that of the noise; a block of several moves counts as so many.
    """
    J, r, whiten = slope(problem, q), problem.white(q), problem.whiten
    assert whiten is not None
    a = whiten.along(whiten.gain, r)
    A = np.stack([whiten.along(whiten.gain, column) for column in J.T], axis=1)
    p = len(q)
    if not J.size or not np.abs(J).max() > 0.0:
        raise NoAnswerError(
            "the position does not follow the voltage at all: check which columns are which "
            "(--column), and whether the motor ran"
        )
    moved = int((whiten.size > 0.0).sum())
    JJ, Jr, rr = J.T @ J, J.T @ r, float(r @ r)
    lost = max(len(r) - p - len(whiten.size), 1)

    # A log without noise, as of a simulation, says nothing of the spread by its last digits.
    finest = lost * (FINEST * tolerance(problem.benches)) ** 2

    def parts(less: Array) -> tuple[float, Array]:
        ridge = np.maximum(1e-10 * np.trace(JJ) / p, 1e-12 * np.diag(JJ))
        H = JJ - (A.T * less) @ A + ridge * np.eye(p)
        b = Jr - A.T @ (less * a)
        left = rr - float(less @ a**2) - float(b @ np.linalg.solve(H, b))
        return max(left, 0.0) + finest, H

    free, _ = parts(np.ones(len(a)))  # any gain for each block
    sigma = math.sqrt(free / max(lost - moved + _gains_of(problem), 1))
    shares = np.geomspace(_LEAST, _MOST, _TRIALS)
    scores, sigmas, information = [], [], []
    for share in shares.tolist():
        more = (share / sigma * whiten.size) ** 2
        left, H = parts(more / (1.0 + more))
        spread_out = float(np.log1p(more).sum())
        scores.append(lost * math.log(left) + spread_out + float(np.linalg.slogdet(H)[1]))
        sigmas.append(math.sqrt(left / lost))
        information.append(H)
    score = np.array(scores)
    best = int(np.argmin(score))
    # of the logarithm of the share: the density times the share
    prior = np.log(shares) - 0.5 * (_PRIOR_DF + 1.0) * np.log1p((shares / _PRIOR) ** 2 / _PRIOR_DF)
    log_weight = prior - 0.5 * (score - score[best])
    weights = np.exp(log_weight - log_weight.max())
    return Spread(
        shares,
        weights / weights.sum(),
        np.array(sigmas),
        np.stack(information),
        bool(moved > _gains_of(problem) and score[best] < score[0] - _DIFFER),
        float(shares[best]),
    )


def _gains_of(problem: Problem) -> int:
    """Return how many of the parameters the gains of blocks have to determine."""
    return sum(n in ("K1", "asymmetry", "dead_zone", "load_voltage") for n in problem.free)


_SHOWN = {"m/s/V": "mm/s/V", "m/s": "mm/s", "m3/s/V": "cm3/s/V", "m3/s": "cm3/s"}


def shown_unit(unit: str) -> str:
    """Return the unit in which people read a number that is in `unit`: m/s -> mm/s, else itself."""
    return _SHOWN.get(unit, unit)


def shown(value: float, unit: str, digits: int = 4) -> str:
    """Return a value in SI as people read it: (0.005245, "m/s") -> "5.245 mm/s"."""
    if unit == "-":
        return f"{value:.{digits}g}"
    return format_quantity(value, unit, shown_unit(unit), digits)


def student(df: float) -> float:
    """Return half the 95 % interval of Student's distribution, in standard deviations."""
    from scipy.stats import t

    return float(t.ppf(0.975, max(df, 1.0)))


class Pooled(NamedTuple):
    """A mean of several estimates that differ by chance, and perhaps by more than chance."""

    mean: float
    std: float  # of the mean
    between: float  # standard deviation between the true values of the several
    df: float  # degrees of freedom for the interval of the mean
    p: float  # probability of such differences by chance alone

    def estimate(self, unit: str, *, positive: bool = False) -> Estimate:
        """Return it as an estimate; what is `positive` has an interval that is."""
        found = Estimate.of(self.mean, self.std, unit, reach=student(self.df) * self.std)
        low, high = found.ci95
        return replace(found, ci95=(max(low, 0.0), high)) if positive else found


def pool(values: ArrayLike, stds: ArrayLike) -> Pooled:
    """Return the random-effects mean of independent estimates with standard deviations.

    The spread between them is that of Paule and Mandel (J. Res. NBS 87, 1982, 377): it makes the
    weighted sum of squares what chance would make it, and is zero where that is small already.
    The degrees of freedom are Satterthwaite's, between those of the spread and infinity.
    """
    from scipy.optimize import brentq
    from scipy.stats import chi2

    x, var = np.asarray(values, float), np.asarray(stds, float) ** 2
    var = np.maximum(var, 1e-30 * float(np.max(x**2, initial=1e-300)))
    n = len(x)

    def excess(spread: float) -> float:
        w = 1.0 / (var + spread)
        return float(w @ (x - w @ x / w.sum()) ** 2) - (n - 1)

    chance = float(chi2.sf(excess(0.0) + n - 1, n - 1)) if n > 1 else 1.0
    spread = 0.0
    if n > 1 and excess(0.0) > 0.0:
        top = float(np.ptp(x)) ** 2 * n
        spread = float(brentq(excess, 0.0, top, xtol=1e-9 * top))
    w = 1.0 / (var + spread)
    total, within = 1.0 / w.sum(), float((w**2) @ var) / float(w.sum()) ** 2
    share = 1.0 - within / total
    df = (n - 1) / share**2 if share > 1e-6 else math.inf
    return Pooled(float(w @ x / w.sum()), math.sqrt(total), math.sqrt(spread), df, chance)
