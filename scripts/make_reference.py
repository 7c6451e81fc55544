"""Write the lists of docs/reference/ from the schema: ``python scripts/make_reference.py``.

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

from swimbladder.control.law import leaf_names
from swimbladder.control.registry import LAWS
from swimbladder.design.plan import Expected, Move, Plan, PlannedExperiment, Trace
from swimbladder.io.files import write_atomically
from swimbladder.io.log_format import LogColumns, LogFormat
from swimbladder.io.mission import Grounding, Ice, Mission, Phase, Safety, Setpoint
from swimbladder.physics.seawater import InternalWave, Swell
from swimbladder.sim.faults.kinds import KINDS, Range
from swimbladder.units import _UNITS
from swimbladder.vehicle import Vehicle, field_unit
from swimbladder.vehicle.schema import dotted, listed_model, meanings, models_in, tags_of

FOLDER = Path(__file__).parents[1] / "docs" / "reference"
_REGION = re.compile(r"(<!-- made from the schema: (\w+) -->\n).*?(<!-- end -->)", flags=re.DOTALL)
_Path = tuple[str, ...]
_SIGNS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}


def fields(
    model: type[BaseModel], skip: tuple[str, ...] = (), said: set[str] | None = None
) -> Iterator[str]:
    """Yield a list of the plain fields of a model, nothing where it has none.

    said: items that stand above, of which the names are enough.
    """
    items, again, said = [], [], set() if said is None else said
    for name, info in model.model_fields.items():
        tables = models_in(info.annotation) or listed_model(info.annotation)
        if name in skip or tables or get_origin(info.annotation) is dict:
            continue
        label = what(name, info, field_unit(model, name))
        if info.is_required():
            label = f"**{label}**"
        elif given := default(info):
            label += f", {given}"
        item = f"- {label}: {meaning(model, name)}"
        if item in said:
            again.append(f"`{name}`")
        else:
            items.append(item)
        said.add(item)
    if again:
        items.append(f"- {', '.join(again)}: as above")
    if items:
        yield from ("", *items)


def what(name: str, info: FieldInfo, unit: str | None) -> str:
    """Return a field's name with its unit, or with what it is where its default does not say so."""
    unit = {"volume_zero": "m3", "piston_zero": "m"}.get(name, unit)  # these also take "first"
    if unit:
        return f"`{name}` [{unit}]"
    kinds = [info.annotation, *get_args(info.annotation)]
    kinds += [inner for kind in kinds for inner in get_args(kind)]
    if any(get_origin(kind) is tuple for kind in kinds):
        return f"`{name}` (list)"
    if info.default is None and int in kinds:
        return f"`{name}` (integer)"
    return f"`{name}`"


def choices_of(info: FieldInfo) -> tuple[str | int, ...]:
    """Return the values that a field may have, where they are listed."""
    inner = [argument for one in get_args(info.annotation) for argument in (one, *get_args(one))]
    for annotation in (info.annotation, *inner):
        if get_origin(annotation) is Literal:
            return get_args(annotation)
    return ()


def default(info: FieldInfo) -> str:
    """Return what a field is where a file does not have it."""
    if info.default is None or info.default == "":
        return ""
    if isinstance(info.default, float):
        return f"{info.default:.12g}"
    return f"`{json.dumps(info.default)}`"


def meaning(model: type[BaseModel], name: str) -> str:
    """Return what a field means, its choices and its bounds other than > 0 and ≥ 0."""
    text, info = meanings(model).get(name, "which fields this table has"), model.model_fields[name]
    if len(choices := choices_of(info)) > 1:
        text += "; " + ", ".join(f"`{json.dumps(choice)}`" for choice in choices)
    metadata = list(info.metadata)
    for argument in get_args(info.annotation):
        metadata += getattr(argument, "__metadata__", ())
    parts = [part for item in metadata for part in getattr(item, "metadata", [item])]
    bounds = {sign: getattr(p, sign) for p in parts for sign in _SIGNS if hasattr(p, sign)}
    least, most = bounds.get("ge"), bounds.get("le")
    if least and most is not None:
        text += f" ({least:g}...{most:g})"
    else:
        shown = [f"{_SIGNS[k]}{v:g}" for k, v in bounds.items() if v or k in ("lt", "le")]
        text += f" ({', '.join(shown)})" if shown else ""
    return text


def tables(
    model: type[BaseModel],
    path: _Path,
    seen: dict[type[BaseModel], str],
    kin: Sequence[type[BaseModel]],
    said: set[str],
) -> Iterator[str]:
    """Yield a section for each table below `path`, the fields of a class once.

    kin: the classes that may stand in place of `model`, itself among them.
    """
    for name, info in model.model_fields.items():
        place = dotted((*path, name))
        if get_origin(info.annotation) is dict:
            yield from ("", f"### [{place}]", "", sentence(meanings(model)[name]))
        listed = listed_model(info.annotation)
        if listed is not None and listed not in seen:
            seen[listed] = place
            yield from ("", f"### [[{place}]]", "", inspect.cleandoc(listed.__doc__ or ""))
            yield from fields(listed)
        members = models_in(info.annotation)
        optional = "" if info.is_required() else ", optional"
        for member in members:
            kind = "".join(f', kind = "{tag}"' for tag in tags_of(member))
            heading = f"### [{place}]{kind}{of(member, name, kin)}{optional}"
            if member not in seen:
                seen[member] = place
                yield from ("", heading, "", inspect.cleandoc(member.__doc__ or ""))
                yield from fields(member, skip=("kind",), said=said)
                yield from tables(member, (*path, name), seen, members, said)
            elif seen[member] != place:
                said_so = sentence(meanings(model)[name])[:-1]
                yield from ("", heading, "", f"{said_so}: [{seen[member]}].")


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
    yield from tables(Vehicle, (), {}, [Vehicle], set())


def laws() -> Iterator[str]:
    """Yield the parameters of each law, by those of the law above that has the most of them."""
    commands = {"voltage": "V", "volume": "m3", "volume change": "m3, a change"}
    above = dict[str, list[str]]()
    yield ""
    for law in (LAWS[name] for name in LAWS.own):
        names = [name for name in leaf_names(law.parameters) if name != "S_p"]
        own = [f"`{n}`" + (f" [{law.units[n]}]" if law.units[n] else "") for n in names]
        like = max(above, key=lambda name: len(set(above[name]) & set(own)), default="")
        less = [item.split()[0] for item in above.get(like, []) if item not in own]
        more = [item for item in own if item not in above.get(like, [])]
        listed = ", ".join(own)
        if len(less) + len(more) < len(own):
            parts = [("without", less), ("with", more)]
            listed = ", ".join([f"as {like}", *(f"{w} {', '.join(it)}" for w, it in parts if it)])
        yield f"- {law.name} [{commands[law.command]}]: {listed}"
        above[law.name] = own


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
        yield from tables(model, (heading.strip("[]"),), {}, (), set())


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
    """Yield every unit, those of a kind together."""
    kinds = dict[Any, list[str]]()
    for name, unit in _UNITS.items():
        kinds.setdefault(unit.dimension, []).append(f"`{name}`")
    yield from ("", "; ".join(map(", ".join, kinds.values())) + ".")


def faults() -> Iterator[str]:
    """Yield the kinds of faults: a list for each family, and in it for what they need."""
    families = dict[str, dict[str, list[str]]]()
    for kind in KINDS.values():
        marks = [f"**{kind.name}**", *([] if kind.may_end else ["(lasts)"])]
        sizes = [size(one) for one in (kind.first, kind.second) if one and one.log]
        text = f"- {' '.join(marks)}: {'; '.join([kind.words, *sizes])}"
        families.setdefault(kind.family, {}).setdefault(kind.needs, []).append(text)
    for family, groups in families.items():
        yield from ("", f"### {family.capitalize()}")
        for needs, items in sorted(groups.items()):
            yield from ("", f"With {needs}:") if needs else ()
            yield from ("", *items)


def size(one: Range) -> str:
    """Return what a severity is drawn from."""
    return f"{'±' if one.either else ''}{one.least:.3g}...{one.most:.3g} {one.unit}".rstrip()


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
