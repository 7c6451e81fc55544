"""A vehicle as the text of a TOML file: every number exact, with its unit beside it.

Vehicle files to start from: a short one, and one with every field, its meaning and default.
"""

import inspect
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterator
from copy import deepcopy
from importlib import resources
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from swimbladder.control.registry import LAWS, law_by_name
from swimbladder.errors import InputError
from swimbladder.io.config import check_vehicle
from swimbladder.io.files import write_atomically
from swimbladder.units import parse_quantity
from swimbladder.vehicle import Vehicle, field_unit
from swimbladder.vehicle.schema import dotted, listed_model, meanings, models_in, tags_of

_ALWAYS = ("schema_version", "kind", "law")


def save_vehicle(vehicle: Vehicle, path: str | Path, *, head: str = "") -> Path:
    """Write a file from which the very same vehicle is read; return its path.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    path
        Of the file.
    head
        Lines that stand above it as comments; empty: there are none.

    Returns
    -------
    Path
        The path of the file.

    Raises
    ------
    InputError
        The file cannot be written, or the vehicle could not be loaded from it.
    """
    check_vehicle(vehicle)
    return write_atomically(Path(path), vehicle_file(vehicle, head=head))


def vehicle_file(vehicle: Vehicle, *, head: str = "") -> str:
    """Return the text of a file from which the very same vehicle is read.

    Fields at their default are left out, but for a table [supervisor]: a vehicle that has one is
    flown under it. head: lines that stand above it as comments.
    """
    lines = [f"# {_printable(line)}".rstrip() for line in head.splitlines()]
    lines.append("# A bare number is in the unit beside it.")

    def kept(name: str, value: object, info: FieldInfo) -> bool:
        has_table = name == "supervisor" and name in vehicle.model_fields_set
        return value is not None and (value != info.get_default() or name in _ALWAYS or has_table)

    def text(value: object, unit: str | None) -> str:
        return toml_value(value) + (f" # {unit}" if unit else "")

    return "\n".join([*lines, *toml_lines(vehicle, kept, text)]) + "\n"


def toml_lines(
    model: BaseModel,
    kept: Callable[[str, object, FieldInfo], bool],
    text: Callable[[Any, str | None], str],
    path: tuple[str, ...] = (),
) -> list[str]:
    """Return the fields of a table, then its sub-tables.

    kept: whether a field, by name, value and what it is, is written; text: of a value in a unit.
    """
    lines: list[str] = []
    later: list[tuple[str, Any]] = []
    for name, info in type(model).model_fields.items():
        value = getattr(model, name)
        if not kept(name, value, info):
            continue
        if isinstance(value, (BaseModel, dict)) or listed_model(info.annotation) is not None:
            later.append((name, value))
            continue
        lines.append(f"{name} = {text(value, field_unit(type(model), name))}")
    for name, value in later:
        place = (*path, name)
        if isinstance(value, dict):
            lines += ["", f"[{dotted(place)}]"]
            lines += [f"{_key(key)} = {toml_value(item)}" for key, item in value.items()]
        if isinstance(value, BaseModel):
            lines += ["", f"[{dotted(place)}]", *toml_lines(value, kept, text, place)]
        for item in value if isinstance(value, tuple) else ():
            lines += ["", f"[[{dotted(place)}]]", *toml_lines(item, kept, text, place)]
    return lines


def _printable(line: str) -> str:
    """Return a line without the control characters and surrogates that no TOML file may hold."""
    return "".join(c if c.isprintable() else " " for c in line)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_value(name)


def toml_value(value: object) -> str:
    """Return a text, number, truth or list as TOML, which writes these as JSON does."""
    if isinstance(value, tuple):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


Table = dict[str, Any]
_TEXT = resources.files("swimbladder.io").joinpath("examples.toml").read_text(encoding="utf-8")
_EXAMPLES: Table = tomllib.loads(_TEXT)
KINDS = tuple(_EXAMPLES["kinds"])
"""The kinds of actuator that a template can be made for."""

_HEAD = """\
# A vehicle for swimbladder: {kind} actuator. Every number is an example: put in your own.
#
# A number with a unit in quotes may have any unit of its kind ("350 cm3", "0.35 L"); a bare number
# is in the unit named in square brackets. Lines that begin with # and no blank are fields at their
# default, or that may be left out; take the # away to change them.

"""


def vehicle_template(kind: str, name: str = "my-vehicle") -> str:
    """Return the text of a TOML file for a vehicle with an actuator of `kind`, one of KINDS.

    It loads and simulates as it is. Raises KeyError where there is no such kind.
    """
    example = {
        "schema_version": 1,
        "name": name,
        "description": f"An example with {'an' if kind[0] in 'eiu' else 'a'} {kind} actuator",
        **_EXAMPLES["all"],
        **_EXAMPLES["kinds"][kind],
    }
    lines = _table(Vehicle, example, (), off=False)
    return _HEAD.format(kind=kind) + "\n".join([*lines, ""])


def vehicle_start(
    kind: str,
    name: str = "my-vehicle",
    *,
    piston_diameter: float | None = None,
    piston_stroke: float | None = None,
) -> str:
    """Return the text of a short file: what a vehicle has to have, and what cannot be assumed.

    piston_diameter, piston_stroke [m]: those of the example where not given. Raises InputError
    where the actuator has no piston.
    """
    example = deepcopy({**_EXAMPLES["all"], **_EXAMPLES["kinds"][kind]})
    _size_piston(example, piston_diameter, piston_stroke)
    example["supervisor"] = {"time_limit": "1 d" if kind == "pump-valve" else "6 h"}
    words = [f"# Actuator: {kind}. The numbers are examples: put in yours, in any unit."]
    words += ["# Every field there is: `swimbladder vehicle new --full`", "schema_version = 1"]
    words.append(f"name = {toml_value(name)}")
    return "\n".join([*words, *_short(Vehicle, example, ()), ""])


def _size_piston(example: Table, piston: float | None, stroke: float | None) -> None:
    """Give an example a piston of this diameter [m], or this travel [m]."""
    if piston is None and stroke is None:
        return
    drive = example["actuator"].get("drive", example["actuator"])
    if "piston_area" not in drive:
        what, remedy = "this kind of actuator has no piston", "Leave it out, or choose another kind"
        field = "piston_stroke" if piston is None else "piston_diameter"
        raise InputError(what, field=field, value=example["actuator"]["kind"], remedy=remedy)
    own = parse_quantity(drive["piston_area"], "m2")
    area = own if piston is None else math.pi / 4.0 * piston**2
    ends = parse_quantity(example["stroke"]["maximum"], "m3")
    half = ends / own if stroke is None else 0.5 * stroke
    given, gains = f"{1e4 * area:.6g} cm2", example["controller"]["parameters"]
    drive["piston_area"] = given if piston is None else f"diameter {1e3 * piston:.6g} mm"
    for end, sign in (("minimum", -1.0), ("maximum", 1.0)):
        example["stroke"][end] = f"{1e6 * sign * half * area:.6g} cm3"
    if "piston_area" in gains:
        gains |= {"piston_area": given, "position_max": f"{900.0 * half:.6g} mm"}
        gains["position_min"] = f"{-900.0 * half:.6g} mm"
    else:  # as fast a loop as with the piston of the example
        gains["k_pV"] = f"{parse_quantity(gains['k_pV'], 'V/m3') * 1e-3 * own / area:.4g} V/dm3"


def _short(model: type[BaseModel], given: Table, path: tuple[str, ...]) -> Iterator[str]:
    """Give the lines of the fields that an example has, their meaning in a few words behind."""
    own = [name for name in model.model_fields if name in given]
    tables = {name: given[name] for name in own if isinstance(given[name], dict)}
    for name in (name for name in own if name not in tables):
        said = re.split(r"[;(]|, eq| \[", meanings(model).get(name, ""))[0].strip()
        words = f"  # {said}" if said and name not in ("kind", "law") else ""
        yield f"{name} = {toml_value(given[name])}{words}"
    for name, value in tables.items():
        place = dotted((*path, name))
        yield f"[{place}]  # {_EXAMPLES['sources'][place]}"
        models = _tables(model.model_fields[name])
        if not models:
            yield from (f"{key} = {toml_value(item)}" for key, item in value.items())
            continue
        kind = value.get("kind", value.get("law"))
        chosen = [one for one in models if len(models) == 1 or kind in tags_of(one)]
        yield from _short(chosen[0], value, (*path, name))


def _table(
    model: type[BaseModel], given: Table, path: tuple[str, ...], *, off: bool
) -> Iterator[str]:
    """Give the lines of a table's fields, then of its sub-tables; `off` comments the fields out."""
    later = []
    for name, info in model.model_fields.items():
        if _tables(info) or get_origin(info.annotation) is dict:
            later.append(name)
            continue
        place = dotted((*path, name))
        active = name in given and not off
        value = toml_value(given[name]) if name in given else _default(model, name, info, place)
        yield from (f"# {_meaning(model, name, info)}", f"{'' if active else '#'}{name} = {value}")
    for name in later:
        yield from _subtable(model, given.get(name), (*path, name), off=off)


def _subtable(
    owner: type[BaseModel], given: Table | None, path: tuple[str, ...], *, off: bool
) -> Iterator[str]:
    """Give the lines of a sub-table of a table's class, its heading first."""
    info = owner.model_fields[path[-1]]
    models, several = _tables(info), not models_in(info.annotation)
    if len(models) > 1:
        kind = (given or {})["kind"]
        models = [model for model in models if kind in tags_of(model)]
    off = off or (given is None and info.default in (None, ()))
    words = inspect.cleandoc(models[0].__doc__ or "") if models else meanings(owner)[path[-1]]
    yield from ("", *(f"# {line}".rstrip() for line in words.splitlines() if line))
    heading = f"[[{dotted(path)}]]" if models and several else f"[{dotted(path)}]"
    yield f"{'#' if off else ''}{heading}"
    if models:
        yield from _table(models[0], given or {}, path, off=off)
        return
    if path == ("controller", "parameters"):
        own = map(law_by_name, LAWS.own)
        units = next(law.units for law in own if set(given or {}) <= set(law.units))
        for key, value in (given or {}).items():
            yield from (f"# {key} [{units[key] or '-'}]", f"{key} = {toml_value(value)}")
    if path == ("provenance",):
        yield '#"hull.psi" = "pressure test of 2024-05-02"'


def _tables(info: FieldInfo) -> list[type[BaseModel]]:
    """Return the parameter classes of a field: a table's own, or that of a list of tables."""
    listed = listed_model(info.annotation)
    return models_in(info.annotation) or ([] if listed is None else [listed])


def _meaning(model: type[BaseModel], name: str, info: FieldInfo) -> str:
    unit = field_unit(model, name)
    label = name if unit is None else f"{name} [{unit or '-'}]"
    text = f"{label}: {meanings(model).get(name, 'decides which fields this table has')}"
    choices = get_args(info.annotation) if get_origin(info.annotation) is Literal else ()
    return text + (f"; one of {', '.join(map(str, choices))}" if len(choices) > 1 else "")


def _default(model: type[BaseModel], name: str, info: FieldInfo, place: str) -> str:
    default = info.default
    if info.is_required() or default is None:
        return toml_value(_EXAMPLES["instead"][place])
    unit = field_unit(model, name)
    return json.dumps(f"{default:.12g} {unit}") if unit else toml_value(default)
