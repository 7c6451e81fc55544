"""What a comparison with the paper can come to, computed from numbers, never typed."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np


class Verdict(Enum):
    """How ours compares with the paper's."""

    AGREES = "AGREES"  # within the tolerance that its digits allow
    EXPLAINED = "EXPLAINED"  # differs, and as computed here it differs for the reason given
    FAILS = "FAILS"  # differs, and the reason given does not account for it

    @property
    def word(self) -> str:
        """The verdict in a word."""
        return self.name if self is Verdict.FAILS else self.name.lower()


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A number or a claim of the paper: theirs, ours, the difference, the verdict."""

    where: str  # "eq. (2)", "Table 2", "section 3.2"
    what: str
    paper: str
    ours: str
    difference: str
    verdict: Verdict
    why: str = ""
    paper_value: float | None = None  # in `unit`, as ours_value
    ours_value: float | None = None
    unit: str = ""


@dataclass(frozen=True, kw_only=True)
class Known:
    """Why ours differs, and what it should then be: a value within a relative tolerance.

    observed: what is held against that value where it is not ours itself (a median, where ours is
    an average that one outlier can spoil).
    """

    why: str
    value: float
    within: float
    observed: float | None = None

    def accounts_for(self, ours: float) -> bool:
        """Say whether ours is what the reason leads one to expect."""
        seen = ours if self.observed is None else self.observed
        return abs(seen - self.value) <= self.within * abs(self.value)


_NOTABLE = 1e-3  # a relative difference from which on the tolerance is printed


def number(
    ours: float,
    known: Known | None = None,
    *,
    paper: float,
    unit: str,
    within: float,
    digits: int = 4,
    why: str = "",
    **place: Any,
) -> Finding:
    """Return the comparison of two numbers; `within` is relative to the paper's.

    known: what accounts for a difference beyond that. why: a remark where they agree. place: where
    and what of a `Finding`.
    """
    relative = (ours - paper) / abs(paper) if paper else math.inf
    agrees = abs(relative) <= within
    if agrees:
        verdict = Verdict.AGREES
    elif known is not None and known.accounts_for(ours):
        verdict = Verdict.EXPLAINED
    else:
        verdict = Verdict.FAILS
    if agrees and abs(relative) > _NOTABLE:
        why = f"{why} Within {100.0 * within:.2g} % counts as agreement.".strip()
    return Finding(
        **place,
        paper=f"{paper:.{max(digits, 6)}g} {unit}".strip(),
        ours=f"{ours:.{digits}g} {unit}".strip(),
        difference=_percent(relative),
        verdict=verdict,
        why=why if agrees or known is None else known.why,
        paper_value=paper,
        ours_value=ours,
        unit=unit,
    )


def claim(
    holds: bool, value: float | None = None, *, accounted_for: bool = False, **said: Any
) -> Finding:
    """Return the comparison of a claim with what was computed.

    value: the number that decided it. accounted_for: whether the computation bears out the reason
    why it does not hold. said: what else a `Finding` has.
    """
    verdict = Verdict.EXPLAINED if said.get("why") and accounted_for else Verdict.FAILS
    verdict = Verdict.AGREES if holds else verdict
    difference = "none" if holds else "see why"
    return Finding(verdict=verdict, difference=difference, ours_value=value, **said)


def _percent(relative: float) -> str:
    if abs(relative) < 5e-7:
        return "none"
    percent = 100.0 * relative
    return f"{percent:+.2g} %" if abs(percent) < 10.0 else f"{percent:+.0f} %"


def deviation(ours: Any, other: Any) -> float:
    """Return the largest |ours - other| / |other|."""
    a, b = np.asarray(ours), np.asarray(other)
    return float(np.max(np.abs(a - b) / np.abs(b)))


def texts(name: str) -> dict[str, Any]:
    """Return what a file beside this one says, by name."""
    return tomllib.loads(Path(__file__).with_name(f"{name}.toml").read_text(encoding="utf-8"))


_CHECKS, _FINDINGS = texts("equations"), texts("published")


def _about(name: str, numbers: Mapping[str, object]) -> dict[str, Any]:
    said = _FINDINGS[name].items()
    return {key: x.format(**numbers) if isinstance(x, str) else x for key, x in said}


def compared(
    name: str,
    ours: float,
    /,
    *,
    expected: float | None = None,
    observed: float | None = None,
    paper: float | None = None,
    unit: str | None = None,
    **numbers: object,
) -> Finding:
    """Return the comparison of a number with that of published.toml, as that says.

    expected: what the reason there leads one to expect of ours, or of what is `observed` in its
    place; paper, unit: where the file leaves them open; numbers: those in its texts, beside these.
    """
    about = _about(name, {"ours": ours, "expected": expected, "observed": observed, **numbers})
    reason, near = about.pop("reason", ""), about.pop("reason_within", 0.0)
    about |= {} if paper is None else {"paper": paper}
    about |= {} if unit is None else {"unit": unit}
    if "half" in about:
        about["within"] = about.pop("half") / abs(about["paper"])
    known = None
    if expected is not None:
        known = Known(why=reason, value=expected, within=near, observed=observed)
    return number(ours, known, **about)


def judged(
    name: str,
    holds: bool,
    value: float | None = None,
    /,
    *,
    accounted_for: bool = False,
    **numbers: object,
) -> Finding:
    """Return the comparison of a claim of published.toml with what was computed, see `claim`.

    numbers: those in its texts, beside the value.
    """
    about = _about(name, {"value": value, **numbers})
    return claim(holds, value, accounted_for=accounted_for, **about)


def check(number: int, *off: float | tuple[Any, Any], **numbers: object) -> EquationCheck:
    """Return how far an equation is off, as equations.toml describes its check.

    off: how far, or (ours, the other) of a deviation, the largest counts; numbers: those in the
    note.
    """
    value = max(deviation(*one) if isinstance(one, tuple) else one for one in off)
    about = _CHECKS[str(number)]
    note = about.get("note", "").format(**numbers)
    return EquationCheck(number=number, value=value, **{**about, "note": note})


def scaled(ours: Any, other: Any) -> float:
    """Return the largest difference over the largest value: of what passes through zero."""
    return float(np.max(np.abs(np.subtract(ours, other))) / np.max(np.abs(other)))


@dataclass(frozen=True, kw_only=True)
class EquationCheck:
    """An equation, what it was checked against, and how far the two are apart."""

    number: int
    says: str
    checked: str
    value: float  # largest relative deviation, or what `measure` says
    limit: float
    measure: str = "largest relative deviation"
    note: str = ""

    @property
    def passed(self) -> bool:
        """Whether the deviation is within the limit; not a number is not."""
        return abs(self.value) <= self.limit

    @property
    def result(self) -> str:
        """The deviation in words."""
        value = f"{self.value:.1e}" if self.value else "0"
        return f"{self.measure}: {value} (limit {self.limit:.0e})"
