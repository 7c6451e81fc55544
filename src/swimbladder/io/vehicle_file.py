"""A vehicle as the text of a TOML file: every number exact, with its unit beside it."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from swimbladder.io.config import check_vehicle
from swimbladder.io.files import write_atomically
from swimbladder.vehicle import Vehicle, field_unit
from swimbladder.vehicle.schema import dotted, listed_model

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
