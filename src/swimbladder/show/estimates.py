"""Estimates in plain words and in rows of a table, with units for people."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from swimbladder.estimation.motion import Estimate, Identification
from swimbladder.show.html import TEXTS
from swimbladder.units import rounded, shown_unit, unit_factor

STRONG = 0.5  # correlation worth a line


class Row(NamedTuple):
    """An estimate as text: as many digits as its standard deviation has to say."""

    name: str
    value: str
    std: str
    ci95: str
    unit: str
    origin: str


def row(name: str, e: Estimate, unit: str | None = None) -> Row:
    """Return an estimate as texts, in a unit; None: that which people read."""
    unit = unit or shown_unit(e.unit)
    per = 1.0 if unit == e.unit else unit_factor(e.unit, unit)
    if e.origin == "set" or not math.isfinite(e.std) or e.std <= 0.0:
        return Row(name, f"{per * e.value:.6g}", "", "", unit, e.origin)
    value, std, low, high = (per * x for x in (e.value, e.std, *e.ci95))
    places = _places(std)
    ends = _interval(low, high, places)
    return Row(name, _fixed(value, places), _fixed(std, places), ends, unit, e.origin)


def with_std(value: float, std: float, unit: str) -> str:
    """Return a number [unit] and its standard deviation, not 0, as text with the digits that say
    something.
    """
    shown = shown_unit(unit)
    per = unit_factor(unit, shown)
    places = _places(per * std)
    return " +- ".join(f"{_fixed(per * x, places)} {shown}".rstrip() for x in (value, std))


def rows(found: Identification) -> list[Row]:
    """Return the parameters, then what follows from them; no number of what is not identifiable."""
    listed = [row(name, e) for name, e in (found.parameters | found.derived).items()]
    if found.identified:
        return listed
    none = {"value": "not identifiable", "std": "", "ci95": ""}
    return [r if r.origin == "set" else r._replace(**none) for r in listed]


def _places(std: float) -> int:
    """Return how many decimal places show two digits of a standard deviation."""
    return 1 - math.floor(math.log10(std)) if std > 0.0 else 6


def _fixed(value: float, places: int) -> str:
    if abs(value) >= 1e7 or places > 7:
        return f"{value:.{max(places + math.floor(math.log10(abs(value) or 1.0)), 1)}e}"
    text = f"{round(value, places):.{max(places, 0)}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def _interval(low: float, high: float, places: int) -> str:
    if math.isfinite(low) and math.isfinite(high):
        return f"{_fixed(low, places)} to {_fixed(high, places)}"
    if math.isfinite(low):
        return f"{_fixed(low, places)} or more"
    return f"{_fixed(high, places)} or less" if math.isfinite(high) else "anything"


def headlines(found: Identification) -> list[str]:
    """Return what was found, a sentence for each parameter; none where not all is identifiable."""
    if not found.identified:
        return []
    return [_headline(found, name) for name in found.names]


def _headline(found: Identification, name: str) -> str:
    e = found.parameters[name]
    r = row(name, e)
    if e.ci95[0] <= 0.0 <= e.ci95[1]:
        return f"{name} is not distinguishable from 0 (95 %: {r.ci95} {r.unit})."
    half = 0.5 * (e.ci95[1] - e.ci95[0]) / abs(e.value)
    source = " (95 %), mostly by its prior" if e.origin == "prior" else " (95 %)"
    known = f"known to {rounded(100.0 * half, 2)} %" if math.isfinite(half) else f"from {r.ci95}"
    return f"{name} is {r.value} {r.unit}, {known}{source}: {_meaning(name, e.value, found.law)}."


def _meaning(name: str, value: float, law: str) -> str:
    """Return what a number means to someone beside a pool."""
    about = TEXTS["motion"][name]
    x = abs(about.get("per", 1.0) * value) if name == "psi" else about.get("per", 1.0) * value
    alone = "by its laminar drag alone, " if law == "blended" else ""
    said: str = about["says"]
    sense = "less" if value > 0.0 else "more"
    return said.format(x=rounded(x, about.get("digits", 3)), alone=alone, sense=sense)


def correlations(found: Identification) -> list[tuple[str, str, float]]:
    """Return the pairs of parameters that trade off, the strongest first."""
    pairs = [
        (a, b, float(found.correlation[i, j]))
        for i, a in enumerate(found.names)
        for j, b in enumerate(found.names)
        if i < j and abs(found.correlation[i, j]) >= STRONG
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def reading(found: Identification, labels: Sequence[str]) -> list[str]:
    """Return the notes of reading the logs, each with the logs that it is about.

    How many rows were chosen, which was asked for, is left out; it is in the JSON.
    """
    about: dict[str, list[str]] = {}
    for label, e in zip(labels, found.experiments, strict=True):
        for note in e.record.notes:
            if not note.endswith("rows chosen"):
                about.setdefault(note, []).append(label)
    every = len(found.experiments)
    return [note if len(of) == every else f"{', '.join(of)}: {note}" for note, of in about.items()]
