"""An actuator's parameters in plain words and in rows of a table, with units for people."""

import math
from pathlib import PurePath

from swimbladder.estimation.actuator import ActuatorIdentification, Estimate
from swimbladder.estimation.actuator.model import shown, shown_unit
from swimbladder.show.report.html import TEXTS
from swimbladder.show.report.text import STRONG, row, trade_off
from swimbladder.units import rounded, unit_factor

MEANING: dict[str, str] = TEXTS["actuator"]


def words(name: str, e: Estimate) -> dict[str, str]:
    """Return a row: an estimate as texts, its meaning, and why it is not identifiable."""
    unit = "" if e.unit == "-" else shown_unit(e.unit)
    result = {"name": _called(name), "unit": unit, "meaning": MEANING.get(name, ""), "why": e.why}
    if not e.known:
        return result | {"value": "not identifiable", "std": "", "ci95": _bounds(e), "origin": ""}
    per = unit_factor(e.unit, unit) if unit else 1.0
    value, std, low, high = (per * x for x in (e.value, e.std, *e.ci95))
    r = row(name, Estimate(value, std, (low, high), unit, e.origin))
    origin = "set" if e.origin == "set" else "the logs"
    return result | {"value": r.value, "std": r.std, "ci95": r.ci95, "origin": origin}


def _bounds(e: Estimate) -> str:
    low, high = e.ci95
    if math.isfinite(high):
        return f"below {shown(high, e.unit)}"
    return f"above {shown(low, e.unit)}" if math.isfinite(low) and low > 0.0 else ""


def _called(name: str) -> str:
    """Return a parameter's name for people: K1_out -> K1 outward."""
    if name == "K1A":
        return "K1 A"
    for end, word in (("_out", " outward"), ("_in", " inward")):
        if name.endswith(end):
            return name.removesuffix(end) + word
    return name.replace("_", " ")


def rows(found: ActuatorIdentification) -> list[dict[str, str]]:
    """Return the parameters, then those by direction."""
    return [words(name, e) for name, e in {**found.parameters, **found.derived}.items()]


def headlines(found: ActuatorIdentification) -> list[str]:
    """Return what was found, a sentence for each parameter; first what is not identifiable."""
    said = [f.sentence for f in found.findings if f.severity == "no"]
    known = {name: e for name, e in found.parameters.items() if e.origin == "data"}
    return said + [_headline(name, e) for name, e in known.items()]


def _headline(name: str, e: Estimate) -> str:
    w = words(name, e)
    low, high = e.ci95
    value = f"{w['value']} {w['unit']}".rstrip()
    meaning, name = MEANING[name], _called(name)
    called = name[0].upper() + name[1:]
    if low <= 0.0 <= high or name == "load voltage":
        ends = w["ci95"].replace(" to ", " and ")
        return f"{called} is {value}, between {ends} {w['unit']} (95 %): {meaning}."
    half = 100.0 * 0.5 * (high - low) / abs(e.value)
    return f"{called} is {value}, known to {rounded(half, 2)} %: {meaning}."


def pairs(found: ActuatorIdentification) -> list[dict[str, str]]:
    """Return the pairs of parameters that trade off, the strongest first."""
    names = list(found.correlation)
    strong = [
        (a, b, found.correlation[a][b])
        for k, a in enumerate(names)
        for b in names[k + 1 :]
        if abs(found.correlation[a].get(b, 0.0)) >= STRONG
    ]
    strongest = sorted(strong, key=lambda pair: -abs(pair[2]))
    return [trade_off(_called(a), _called(b), r) for a, b, r in strongest]


def labels(found: ActuatorIdentification) -> list[str]:
    """Return a short name for each log: that of its file, and which rows."""
    names = [PurePath(fit.source.replace("\\", "/")).name for fit in found.logs]
    if len(set(names)) == len(names):
        return names
    return [f"{number}: {name}" for number, name in enumerate(names, start=1)]
