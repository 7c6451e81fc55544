"""A vehicle as the text of a TOML file: every number exact, with its unit beside it."""

from __future__ import annotations

import json
import re
from typing import Any

from pydantic import BaseModel

from swimbladder.vehicle import Vehicle, field_unit
from swimbladder.vehicle.schema import dotted, listed_model

_ALWAYS = ("schema_version", "kind", "law")


def vehicle_file(vehicle: Vehicle, *, head: str = "") -> str:
    """Return the text of a file from which the very same vehicle is read.

    Fields at their default are left out. head: lines that stand above it as comments.
    """
    lines = [f"# {_printable(line)}".rstrip() for line in head.splitlines()]
    lines.append("# A bare number is in the unit beside it.")
    _table(lines, vehicle, ())
    return "\n".join(lines) + "\n"


def _table(lines: list[str], model: BaseModel, path: tuple[str, ...]) -> None:
    """Append the fields of a table, then its sub-tables."""
    later: list[tuple[str, Any]] = []
    for name, info in type(model).model_fields.items():
        value = getattr(model, name)
        if value is None or (value == info.get_default() and name not in _ALWAYS):
            continue
        if isinstance(value, (BaseModel, dict)) or listed_model(info.annotation) is not None:
            later.append((name, value))
            continue
        unit = field_unit(type(model), name)
        lines.append(f"{name} = {_toml(value)}" + (f" # {unit}" if unit else ""))
    for name, value in later:
        if isinstance(value, tuple):
            for item in value:
                lines += ["", f"[[{dotted((*path, name))}]]"]
                _table(lines, item, (*path, name))
            continue
        lines += ["", f"[{dotted((*path, name))}]"]
        if isinstance(value, BaseModel):
            _table(lines, value, (*path, name))
        else:
            lines += [f"{_key(key)} = {_toml(item)}" for key, item in value.items()]


def _printable(line: str) -> str:
    """Return a line without the control characters and surrogates that no TOML file may hold."""
    return "".join(c if c.isprintable() else " " for c in line)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _toml(name)


def _toml(value: object) -> str:
    """Return a text, number, truth or list as TOML, which writes these as JSON does."""
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
