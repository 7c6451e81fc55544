"""Whether the parameters are known well enough to stop, and if not, whether more would help."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from swimbladder.estimation.estimates import Estimate
from swimbladder.estimation.motion import (
    DELAY_STD,
    DRIFT_STD,
    NAMES,
    NEUTRAL_STD,
    Identification,
    Prior,
)

LEAST = 4  # experiments; with fewer no trend with the size of the step can show
MARGIN = 1.25  # by which a standard deviation has to be below its target; see studies.stopping
_MOST = 12  # experiments more, beyond which another remedy is worth looking for
_FAR = 200
_SINGLE = ("drift", "outliers")  # kinds of finding on single experiments: see remarks.of_fit
_SHARE = 0.5  # of a variance, from which something is said to limit it


class Target(NamedTuple):
    """How well a parameter has to be known: its standard deviation, relative or in its unit."""

    name: str
    std: float
    relative: bool = True

    def reached(self, e: Estimate) -> bool:
        """Say whether an estimate is that good, with a margin.

        A day that ends as soon as its numbers look good ends on those that look too good.
        """
        return MARGIN * e.std <= self.limit(e)

    def limit(self, e: Estimate) -> float:
        """Return the standard deviation aimed at, in the parameter's unit."""
        return self.std * abs(e.value) if self.relative else self.std

    def text(self) -> str:
        """Return it as text."""
        if self.relative:
            return f"{self.name} to {100.0 * self.std:.3g} %"
        return f"{self.name} to {self.std:.3g} {NAMES[self.name].unit}"


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is to be identified, how well, and what is known before."""

    targets: tuple[Target, ...] = ()
    free: tuple[str, ...] | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    priors: Mapping[str, Prior] = field(default_factory=dict)
    drag: str | None = None
    neutral_std: float = NEUTRAL_STD
    drift_std: float = DRIFT_STD
    delay_std: float = DELAY_STD


class State:
    """How a verdict comes out."""

    GOOD = "good enough"
    MORE = "more experiments"
    LIMITED = "more of the same will not help"
    WARNED = "something is wrong"


class Verdict(NamedTuple):
    """Whether to stop, in a word and in sentences."""

    state: str
    sentence: str
    more: int | None = None  # experiments that would do, as far as can be foreseen
    limits: Mapping[str, float] = {}  # share of the variance that is owed to what

    @property
    def good(self) -> bool:
        """Whether the parameters are good enough."""
        return self.state == State.GOOD


def judge(
    found: Identification | None,
    asked: Asked,
    *,
    due: int,
    faults: Sequence[str],
    known_neutral: Callable[[], Identification],
) -> Verdict:
    """Return the verdict on an identification, None where there is none yet.

    asked: what it was made with. due: experiments of the plan that are not done yet; their
    information is not known from the others. faults: what is wrong with single experiments.
    known_neutral: makes the same identification with exactly known neutral volumes; called only
    where needed.
    """
    targets, priors = asked.targets, asked.priors
    if found is None:
        return Verdict(State.MORE, f"No experiment yet; at least {LEAST} are needed.", LEAST)
    n = len(found.experiments)
    not_identified = [f.sentence for f in found.findings if f.severity == "no"]
    if n < LEAST:
        fault = f"with fewer than {LEAST} experiments a fault of the model cannot show"
        return Verdict(State.MORE, f"At least {LEAST - n} more: {fault}.", LEAST - n)
    missed = [t for t in targets if not not_identified and not t.reached(found.parameters[t.name])]
    against = [f for f in found.findings if f.severity == "warning" and f.kind not in _SINGLE]
    warnings = " ".join([*faults, *(f.sentence for f in against)])
    if not not_identified and not missed:
        if warnings:
            but = "The targets are met, but what was found speaks against the intervals"
            return Verdict(State.WARNED, f"{but}: {warnings}")
        return Verdict(State.GOOD, f"Good enough to stop: {_known(found, targets)}.")
    if due:
        how = _known(found, missed) if missed else f"{not_identified[0]}"
        left = f"{due} experiment{'s' * (due > 1)} of the plan still to do"
        return Verdict(State.MORE, f"Not yet: {how.rstrip('.')}; {left}.", due)
    if not_identified:
        return Verdict(State.LIMITED, f"More of the same will not help. {' '.join(not_identified)}")
    more = forecast(found, targets, priors)
    how = _known(found, missed)
    if more is not None and more <= _MOST:
        about = f"About {more} more experiment{'s' * (more > 1)} like these should do"
        return Verdict(State.MORE, f"Not yet: {how}. {about}.", more)
    limits = _limits(found, missed, known_neutral)
    need = f"it would take {f'about {more}' if more else f'more than {_FAR}'} more experiments"
    said = f"More of the same will not help soon: {how}, and {need}. "
    return Verdict(State.LIMITED, said + _instead(limits, missed, priors), more, limits)


def forecast(
    found: Identification, targets: Sequence[Target], priors: Mapping[str, Prior]
) -> int | None:
    """Return how many more experiments, like those done on average, reach the targets.

    The information of the data grows with their number, that of the priors does not. None where
    200 do not.
    """
    size = np.array([abs(found.parameters[name].value) or 1.0 for name in found.names])
    total = np.linalg.inv(found.covariance / np.outer(size, size))
    stds = np.array([priors[name].std if name in priors else np.inf for name in found.names])
    known = np.diag((size / stds) ** 2)
    n = len(found.experiments)
    limits = np.full(len(size), np.inf)
    for t in targets:
        if t.name in found.names:
            i = found.names.index(t.name)
            limits[i] = min(limits[i], t.limit(found.parameters[t.name]) / MARGIN)
    for more in range(1, _FAR + 1):
        C = np.linalg.inv(known + (total - known) * (n + more) / n)
        if (np.diag(C) <= (limits / size) ** 2).all():
            return more
    return None


def _known(found: Identification, targets: Sequence[Target]) -> str:
    parts = []
    for t in targets:
        e = found.parameters[t.name]
        size, factor, unit = (abs(e.value), 100.0, "%") if t.relative else (1.0, 1.0, e.unit)
        aim = f"target {factor * t.std:.3g} {unit}"
        if e.std <= t.limit(e) < MARGIN * e.std:
            aim += f", which {factor * t.std / MARGIN:.3g} {unit} is taken to reach"
        parts.append(f"{t.name} is known to {factor * e.std / size:.2g} {unit} ({aim})")
    return ", ".join(parts)


def _limits(
    found: Identification, missed: Sequence[Target], known_neutral: Callable[[], Identification]
) -> dict[str, float]:
    """Return which share of the worst variance would go if something else were known exactly."""
    names = list(found.names)

    def excess(t: Target) -> float:
        return found.parameters[t.name].std / t.limit(found.parameters[t.name])

    worst = max(missed, key=excess)
    i, C = names.index(worst.name), found.covariance
    shares = {}
    if "psi" in names and worst.name != "psi":
        p = names.index("psi")
        shares["psi"] = float(C[i, p] ** 2 / (C[i, i] * C[p, p]))
    other = known_neutral()
    if other.identified:
        shares["neutral volume"] = max(0.0, 1.0 - float(other.covariance[i, i] / C[i, i]))
    return shares


def _instead(
    limits: Mapping[str, float], missed: Sequence[Target], priors: Mapping[str, Prior]
) -> str:
    names = " and ".join(t.name for t in missed)
    said = []
    if limits.get("psi", 0.0) > _SHARE:
        how = "a narrower prior" if "psi" in priors else "a prior"
        said.append(
            f"What limits {names} is psi ({100.0 * limits['psi']:.0f} % of the variance): give it "
            f"{how} (`priors=`), from the volumes at which the vehicle rests at several depths, or "
            "run changes of volume that differ more in size."
        )
    if limits.get("neutral volume", 0.0) > _SHARE:
        said.append(
            f"What limits {names} is the neutral volume before each experiment "
            f"({100.0 * limits['neutral volume']:.0f} % of the variance): rest longer, use larger "
            "changes of volume, or state it with `neutral_std=` if it is known better."
        )
    if not said:
        said.append("What limits them is the noise of the depth: glide longer.")
    said.append(
        "A plan of `swimbladder design-experiment` may identify far more in that time (`plan=`)."
    )
    return " ".join(said)
