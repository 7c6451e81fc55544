"""Answers in JSON's own types, SI numbers under names that say their unit."""

import dataclasses
import enum
import json
import math
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any


def plain(value: Any) -> Any:
    """Return `value` in JSON's own types; None for what is not finite, [re, im] for a complex.

    A record that has `to_dict` says itself what it is.
    """
    if isinstance(value, enum.Enum):
        return plain(value.value)
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if hasattr(value, "to_dict"):
        return plain(value.to_dict())
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, PurePath):
        return str(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if hasattr(value, "tolist"):  # numpy arrays and scalars
        return plain(value.tolist())
    raise TypeError(f"{type(value).__name__} has no place in a JSON answer")


def json_text(answer: Mapping[str, Any]) -> str:
    """Return an answer as the text of a JSON file, without a newline at its end."""
    return json.dumps(plain(answer), indent=2, allow_nan=False)


def as_json(record: Any, keys: str) -> dict[str, Any]:
    """Return attributes of a record for JSON, in the order of `keys`, words between blanks.

    A key is the attribute's name, with the unit behind it where it has one: ``rms_m`` is the
    attribute ``rms``. Where JSON has another name, both stand there: ``hold_m=held``.
    """
    return {key: plain(value) for key, value in attributes(record, keys).items()}


def attributes(record: Any, keys: str) -> dict[str, Any]:
    """Return attributes of a record, as they are, by `keys` as `as_json` has them."""
    found = {}
    for word in keys.split():
        key, _, name = word.partition("=")
        found[key] = getattr(record, name or _attribute(record, key))
    return found


def _attribute(record: Any, key: str) -> str:
    """Return the longest beginning of a key that is an attribute's name; the rest is a unit."""
    name = key
    while not hasattr(record, name) and "_" in name:
        name = name.rpartition("_")[0]
    return name
