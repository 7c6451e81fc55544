"""A vehicle file to start from: every field of the schema, its unit, meaning and default."""

import inspect
import json
import tomllib
from collections.abc import Iterator
from importlib import resources
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from swimbladder.control.registry import LAWS, law_by_name
from swimbladder.io.vehicle_file import toml_value
from swimbladder.vehicle import Vehicle, field_unit
from swimbladder.vehicle.schema import dotted, listed_model, meanings, models_in, tags_of

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
