"""Write the tables of docs/reference/ from the schema: ``python scripts/make_reference.py``.

What stands between ``<!-- made from the schema: NAME -->`` and ``<!-- end -->`` is made here; the
rest of a page is written by hand.
"""

import inspect
import json
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from swimbladder.control.records import leaf_names
from swimbladder.control.registry import LAWS
from swimbladder.io.files import write_atomically
from swimbladder.io.log_format import LogColumns, LogFormat
from swimbladder.io.mission import Grounding, Ice, Mission, Phase, Safety, Setpoint
from swimbladder.io.plan import Expected, Move, Plan, PlannedExperiment, Trace
from swimbladder.physics.seawater import InternalWave, Swell
from swimbladder.sim.faults.kinds import KINDS, Kind, Range
from swimbladder.units import _UNITS
from swimbladder.vehicle import Vehicle, field_unit
from swimbladder.vehicle.schema import dotted, listed_model, meanings, models_in, tags_of

FOLDER = Path(__file__).parents[1] / "docs" / "reference"
_REGION = re.compile(r"(<!-- made from the schema: (\w+) -->\n).*?(<!-- end -->)", flags=re.DOTALL)
_Path = tuple[str, ...]
_KINDS = {
    "%": "a share",
    "m": "length",
    "L": "volume, beside the cubes of lengths",
    "kg": "mass",
    "s": "time",
    "Hz": "frequency",
    "A": "current",
    "V": "voltage",
    "ohm": "resistance",
    "H": "inductance",
    "N": "force",
    "Pa": "pressure",
    "W": "power",
    "J": "energy",
    "rad": "angle",
    "rpm": "speed of rotation",
    "S": "conductance",
    "K": "temperature difference",
    "degC": "temperature",
}


def fields(model: type[BaseModel], skip: tuple[str, ...] = ()) -> Iterator[str]:
    """Yield a table of the plain fields of a model, nothing where it has none."""
    rows = []
    for name, info in model.model_fields.items():
        tables = models_in(info.annotation) or listed_model(info.annotation)
        if name in skip or tables or get_origin(info.annotation) is dict:
            continue
        unit = field_unit(model, name)
        cells = (what(name, info, unit), default(info, unit), meaning(model, name))
        rows.append(f"| `{name}` | {' | '.join(cells)} |")
    if rows:
        yield from ("", "| field | unit | default | meaning |", "|---|---|---|---|", *rows)


def what(name: str, info: FieldInfo, unit: str | None) -> str:
    """Return a field's unit, "-" for a bare number, or what else it is."""
    unit = {"volume_zero": "m3", "piston_zero": "m"}.get(name, unit)  # these also take "first"
    if unit is not None:
        return unit or "-"
    kinds = [info.annotation, *get_args(info.annotation)]
    if any(get_origin(kind) is tuple for kind in kinds):
        return "list"
    if isinstance(info.default, bool):
        return "true or false"
    kinds += [inner for kind in kinds for inner in get_args(kind)]
    if float in kinds and str not in kinds:
        return "number"
    return "integer" if any(kind is int or type(kind) is int for kind in kinds) else "text"


def choices_of(info: FieldInfo) -> tuple[str | int, ...]:
    """Return the values that a field may have, where they are listed."""
    for annotation in (info.annotation, *get_args(info.annotation)):
        if get_origin(annotation) is Literal:
            return get_args(annotation)
    return ()


def default(info: FieldInfo, unit: str | None) -> str:
    """Return what a field is where a file does not have it."""
    if info.is_required():
        return "**required**"
    if info.default is None:
        return "–"
    if isinstance(info.default, bool):
        return str(info.default).lower()
    return f"{info.default:.12g}" if unit is not None else f"`{json.dumps(info.default)}`"


def meaning(model: type[BaseModel], name: str) -> str:
    """Return what a field means, its choices and its bounds other than > 0 and ≥ 0."""
    text, info = meanings(model).get(name, "which fields this table has"), model.model_fields[name]
    annotation, choices = info.annotation, choices_of(info)
    if len(choices) > 1:
        text += "; one of " + ", ".join(f"`{json.dumps(choice)}`" for choice in choices)
    limits = []
    metadata = list(info.metadata)
    for argument in get_args(annotation):
        metadata += getattr(argument, "__metadata__", ())
    for item in metadata:
        for part in getattr(item, "metadata", [item]):
            for name, sign in (("gt", ">"), ("ge", "≥"), ("lt", "<"), ("le", "≤")):
                bound = getattr(part, name, None)
                if bound is not None and (bound or name in ("lt", "le")):
                    limits.append(f"{sign} {bound:g}")
    return (text + (f" ({', '.join(limits)})" if limits else "")).replace("|", "\\|")


def tables(
    model: type[BaseModel], path: _Path, seen: set[type[BaseModel]], kin: Sequence[type[BaseModel]]
) -> Iterator[str]:
    """Yield a section for each table below `path`, each class once.

    kin: the classes that may stand in place of `model`, itself among them.
    """
    for name, info in model.model_fields.items():
        place = (*path, name)
        if get_origin(info.annotation) is dict:
            yield from ("", f"### [{dotted(place)}]", "", sentence(meanings(model)[name]))
        listed = listed_model(info.annotation)
        if listed is not None and listed not in seen:
            seen.add(listed)
            yield from ("", f"### [[{dotted(place)}]]", "", inspect.cleandoc(listed.__doc__ or ""))
            yield from ("", "Any number of these tables.")
            yield from fields(listed)
        members = models_in(info.annotation)
        for member in members:
            if member in seen:
                continue
            seen.add(member)
            kind = "".join(f', kind = "{tag}"' for tag in tags_of(member))
            yield from ("", f"### [{dotted(place)}]{kind}{of(member, name, kin)}", "")
            yield inspect.cleandoc(member.__doc__ or "")
            if not info.is_required():
                yield from ("", "Optional.")
            yield from fields(member, skip=("kind",))
            yield from tables(member, place, seen, members)


def of(member: type[BaseModel], name: str, kin: Sequence[type[BaseModel]]) -> str:
    """Return which of several kinds have `member` in their field `name`."""
    having = [
        tag
        for other in kin
        if name in other.model_fields and member in models_in(other.model_fields[name].annotation)
        for tag in tags_of(other)
    ]
    return f" of {' and '.join(having)}" if len(kin) > 1 else ""


def sentence(text: str) -> str:
    """Return a description as a sentence."""
    return text[:1].upper() + text[1:] + "."


def vehicle() -> Iterator[str]:
    """Yield the whole vehicle file."""
    yield from ("", "### At the top of the file")
    yield from fields(Vehicle)
    yield from tables(Vehicle, (), set(), [Vehicle])


def laws() -> Iterator[str]:
    """Yield each law and its parameters."""
    units = {"voltage": "V", "volume": "m3", "volume change": "a change of volume, m3"}
    for law in (LAWS[name] for name in LAWS.own):
        names = [name for name in leaf_names(law.parameters) if name != "S_p"]
        yield from ("", f"### {law.name}", "")
        yield f"{sentence(law.summary)} Command: {units[law.command]}. Parameters:"
        yield ", ".join(f"`{name}` [{law.units[name] or '-'}]" for name in names) + "."


def mission() -> Iterator[str]:
    """Yield the whole mission file."""
    yield from ("", "### At the top of the file")
    yield from fields(Mission, skip=("setpoints", "phases", "water_motion"))
    for heading, model in (
        ("[[setpoints]]", Setpoint),
        ("[[phases]]", Phase),
        ("[safety]", Safety),
        ("[grounding]", Grounding),
        ("[ice]", Ice),
        ("[[water_motion.internal_waves]]", InternalWave),
        ("[[water_motion.swell]]", Swell),
    ):
        yield from ("", f"### {heading}", "", inspect.cleandoc(model.__doc__ or ""))
        yield from fields(model)
        yield from tables(model, (heading.strip("[]"),), set(), ())


def plan() -> Iterator[str]:
    """Yield the whole plan of experiments."""
    yield from ("", "### At the top of the file")
    yield from fields(Plan, skip=("experiments", "expected"))
    for heading, model in (
        ("[[expected]]", Expected),
        ("[[experiments]]", PlannedExperiment),
        ("[[experiments.moves]]", Move),
        ("[experiments.trace]", Trace),
    ):
        yield from ("", f"### {heading}", "", inspect.cleandoc(model.__doc__ or ""))
        yield from fields(model, skip=("moves",))


def log() -> Iterator[str]:
    """Yield the [log] table."""
    yield from ("", "### [log]")
    yield from fields(LogFormat)
    yield from ("", "### [log.columns]", "", inspect.cleandoc(LogColumns.__doc__ or ""))
    yield from ("", "### [log.where]", "", sentence(meanings(LogFormat)["where"]))


def units() -> Iterator[str]:
    """Yield every unit, a row for each kind."""
    yield from ("", "| kind | units |", "|---|---|")
    kinds = dict[Any, list[str]]()
    for name, unit in _UNITS.items():
        kinds.setdefault(unit.dimension, []).append(name)
    for names in kinds.values():
        yield f"| {_KINDS[names[0]]} | {', '.join(f'`{name}`' for name in names)} |"


def faults() -> Iterator[str]:
    """Yield the kinds of faults, a table for each family."""
    families = dict[str, list[Kind]]()
    for kind in KINDS.values():
        families.setdefault(kind.family, []).append(kind)
    for family, kinds in families.items():
        yield from ("", f"### {family.capitalize()}", "")
        yield from ("| kind | fault | severity | range from ... to |", "|---|---|---|---|")
        for kind in kinds:
            how = [f"needs {kind.needs}"] if kind.needs else []
            how += ["from the start"] if kind.from_start else []
            how += [] if kind.may_end else ["for good"]
            words = kind.words + (f" ({'; '.join(how)})" if how else "")
            sizes = ", then ".join(size(one) for one in (kind.first, kind.second) if one)
            yield f"| {kind.name} | {words} | {sizes} | {kind.why} |"


def size(one: Range) -> str:
    """Return what a severity is drawn from."""
    if not one.log:
        return "either of two"
    sign = "±" if one.either else ""
    return f"{sign}{one.least:.3g} to {sign}{one.most:.3g} {one.unit}".rstrip()


MADE: dict[str, Callable[[], Iterator[str]]] = {
    "vehicle": vehicle,
    "laws": laws,
    "mission": mission,
    "plan": plan,
    "log": log,
    "units": units,
    "faults": faults,
}


def made(page: str) -> str:
    """Return a page with its regions made anew."""

    def region(match: re.Match[str]) -> str:
        return match[1] + "\n".join(MADE[match[2]]()) + "\n\n" + match[3]

    return _REGION.sub(region, page)


def main() -> None:
    """Make every page of the reference anew."""
    for path in sorted(FOLDER.glob("*.md")):
        before = path.read_text(encoding="utf-8")
        after = made(before)
        if after != before:
            write_atomically(path, after)
            print(f"wrote {path.relative_to(FOLDER.parents[1])}")


if __name__ == "__main__":
    main()
