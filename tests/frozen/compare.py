"""Compares two snapshots, and says readably where they differ first."""

from __future__ import annotations

import math
import re
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

from tests.frozen import renamed
from tests.frozen.cases import DISTRIBUTIONS, LOOSE, Case, Distribution

RELATIVE = 1e-9

# Below these a number is nothing, by unit: a speed that is zero but for rounding has no digits to
# hold. A billionth of what an engineer could measure. Units that are not here have no floor.
FLOORS = {
    "m": 1e-9,
    "m3": 1e-15,
    "cm3": 1e-9,
    "s": 1e-9,
    "m/s": 1e-12,
    "m_s": 1e-12,
    "V": 1e-9,
    "A": 1e-9,
    "W": 1e-9,
    "J": 1e-6,
    "C": 1e-9,
    "dbar": 1e-9,
    "Pa": 1e-5,
    "kg": 1e-9,
    "pct": 1e-9,
    "deg": 1e-9,
}
LIST_FLOOR = 1e-9  # of the largest of a column or a list: a trajectory passes through zero


class Difference(NamedTuple):
    """The first place where a case differs from the store."""

    case: str
    path: str
    old: Any
    new: Any

    @property
    def relative(self) -> float | None:
        if not (_number(self.old) and _number(self.new)):
            return None
        return abs(self.new - self.old) / max(abs(self.old), abs(self.new), 1e-300)

    def __str__(self) -> str:
        lines = [
            f"case {self.case}",
            f"  at  {self.path}",
            f"  old {self.old!r}",
            f"  new {self.new!r}",
        ]
        if self.relative is not None:
            lines.append(f"  relative difference {self.relative:.3g}")
        return "\n".join(lines)


class _Path(NamedTuple):
    case: str
    parts: tuple[str, ...] = ()
    unit: str = ""
    scale: float = 0.0  # of the list that a number stands in

    def to(self, part: str | int, unit: str = "", scale: float = 0.0) -> _Path:
        word = f"[{part}]" if isinstance(part, int) else part
        return self._replace(parts=(*self.parts, word), unit=unit, scale=scale)

    def __str__(self) -> str:
        return ".".join(self.parts).replace(".[", "[")


def first_difference(case: Case, old: dict[str, Any], new: dict[str, Any]) -> Difference | None:
    """Return where a case's snapshot differs first from the stored one, which is renamed before."""
    return _differ(_Path(case.name), rename(old, case.command), new)


def _differ(at: _Path, old: Any, new: Any) -> Difference | None:
    distribution = _distribution(at)
    if distribution is not None:
        return _differ_in_distribution(at, distribution, old, new)
    if isinstance(old, dict) and isinstance(new, dict):
        return _differ_dict(at, old, new)
    if isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            return _found(at, f"{len(old)} entries", f"{len(new)} entries")
        numbers = [abs(v) for v in old if _number(v) and math.isfinite(v)]
        scale = max(numbers, default=0.0)
        pairs = enumerate(zip(old, new, strict=True))
        found = (_differ(at.to(n, at.unit, scale), a, b) for n, (a, b) in pairs)
        return next((d for d in found if d is not None), None)
    if _number(old) and _number(new):
        return None if _close(at, old, new) else _found(at, old, new)
    if type(old) is type(new) and old == new:
        return None
    return _found(at, old, new)


def _differ_dict(at: _Path, old: dict[str, Any], new: dict[str, Any]) -> Difference | None:
    if "code" in old and "sha256" in old:  # a line of C is easier to read than a hash
        old, new = {"code": old["code"]}, {"code": new.get("code")}
    unit = old.get("unit") if isinstance(old.get("unit"), str) else ""
    thinned = "largest" in old and "kept" in old
    for key in [*old, *(k for k in new if k not in old)]:
        if key not in old or key not in new:
            gone = "absent"
            return _found(at.to(key), old.get(key, gone), new.get(key, gone))
        inner = at.to(key, unit or (at.unit if thinned else _unit(key)))
        if thinned and key == "sum":
            inner = inner._replace(scale=old["largest"] * old["count"])
        difference = _differ(inner, old[key], new[key])
        if difference is not None:
            return difference
    return None


def _unit(key: str) -> str:
    """Return the unit that a key or a column ends with, "" for none."""
    words = key.split("_")
    for n in range(min(3, len(words) - 1), 0, -1):
        if (unit := "_".join(words[-n:])) in FLOORS:
            return unit
        if n > 1 and words[-n] in FLOORS:  # a unit that is not listed, such as m_s2
            return ""
    return ""


def _close(at: _Path, old: float, new: float) -> bool:
    if math.isnan(old) or math.isnan(new):
        return math.isnan(old) and math.isnan(new)
    if old == new or math.isinf(old) or math.isinf(new):
        return old == new
    loose = next((t for p, t in LOOSE.items() if fnmatchcase(f"{at.case}: {at}", p)), None)
    relative = loose.relative if loose else RELATIVE
    floor = max(FLOORS.get(at.unit, 0.0), LIST_FLOOR * at.scale, loose.absolute if loose else 0.0)
    return abs(new - old) <= relative * max(abs(old), abs(new)) + floor


def _distribution(at: _Path) -> Distribution | None:
    return next((d for p, d in DISTRIBUTIONS.items() if fnmatchcase(f"{at.case}: {at}", p)), None)


def _differ_in_distribution(
    at: _Path, allowed: Distribution, old: Any, new: Any
) -> Difference | None:
    """Compare draws: of a list its distribution, of a number its value within what is allowed."""
    if isinstance(old, dict) and isinstance(new, dict) and "kept" in old:
        old, new = old["kept"], new.get("kept")
    if isinstance(old, list) and isinstance(new, list) and all(map(_number, [*old, *new])):
        from scipy.stats import ks_2samp

        p = float(ks_2samp(old, new).pvalue) if old and new else float(len(old) == len(new))
        text = f"a distribution that has p = {p:.2g} with the old one, less than {allowed.p:g}"
        return None if p >= allowed.p else _found(at, old, text)
    if _number(old) and _number(new):
        near = abs(new - old) <= allowed.relative * max(abs(old), abs(new)) + allowed.absolute
        return None if near else _found(at, old, new)
    if isinstance(old, dict) and isinstance(new, dict):
        if set(old) != set(new):
            return _found(at, sorted(old), sorted(new))
        found = (_differ_in_distribution(at.to(k), allowed, old[k], new[k]) for k in old)
        return next((d for d in found if d is not None), None)
    if isinstance(old, str) and isinstance(new, str):
        return None  # of which kind a draw is, is drawn too
    return None if type(old) is type(new) else _found(at, old, new)


def _found(at: _Path, old: Any, new: Any) -> Difference:
    return Difference(at.case, str(at), old, new)


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def rename(snapshot: dict[str, Any], command: str) -> dict[str, Any]:
    """Return a stored snapshot with today's names."""
    pairs = []
    for old, new in renamed.KEYS.items():
        only, _, path = old.rpartition(": ")
        if only in ("", command):
            pairs.append((path.split("."), new.split(".")))
    files = {}
    for name, held in snapshot["files"].items():
        for old, new in renamed.FILES.items():
            name = name.replace(old, new)
        if isinstance(held, dict) and "code" in held:
            held = {**held, "code": [_c_names(line) for line in held["code"]]}
        else:
            held = _renamed(held, pairs, ())
        files[name] = held
    answer = _renamed(snapshot["answer"], pairs, ())
    return {"exit": snapshot["exit"], "answer": answer, "files": files}


def _renamed(value: Any, pairs: list[tuple[list[str], list[str]]], above: tuple[str, ...]) -> Any:
    if isinstance(value, list):
        return [_renamed(v, pairs, above) for v in value]
    if isinstance(value, str):
        for old, new in renamed.FILES.items():
            if "." in value:
                value = value.replace(old, new)
        return renamed.KINDS.get(value, value)
    if not isinstance(value, dict):
        return value
    result: dict[str, Any] = {}
    for key, held in value.items():
        path = (*above, key)
        held = _renamed(held, pairs, path)
        for old, new in pairs:
            if list(path[-len(old) :]) == old:
                _put(result, new[len(_shared(old, new)) :], held)
                break
        else:
            _put(result, [key], held)
    return result


def _shared(old: list[str], new: list[str]) -> list[str]:
    """Return the parents that an old and a new path share."""
    shared = []
    for a, b in zip(old[:-1], new[:-1], strict=False):
        if a != b:
            break
        shared.append(a)
    return shared


def _put(into: dict[str, Any], path: list[str], held: Any) -> None:
    *parents, last = path
    for parent in parents:
        into = into.setdefault(parent, {})
    if isinstance(held, dict) and isinstance(into.get(last), dict):
        into[last] |= held
    else:
        into[last] = held


def _c_names(line: str) -> str:
    for old, new in renamed.C_NAMES.items():
        line = re.sub(rf"\b{re.escape(old)}\b", new, line)
    return line
