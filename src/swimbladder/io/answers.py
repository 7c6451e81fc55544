"""Answers in JSON's own types, SI numbers under names that say their unit."""

import dataclasses
import enum
import json
import math
from collections.abc import Mapping
from functools import wraps
from importlib import import_module
from operator import attrgetter
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from swimbladder.errors import as_asked

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure


class Answer:
    """What an answer is to its user: some lines of words, plain values, and a picture.

    Its words and its picture are those of `show.answers`.
    """

    def __init_subclass__(cls, **more: Any) -> None:
        """Keep a dataclass from making a repr of all its arrays; make `to_dict` plain."""
        super().__init_subclass__(**more)
        cls.__repr__ = Answer.__repr__  # type: ignore[method-assign]
        if "to_dict" in vars(cls):
            own = cls.to_dict
            cls.to_dict = wraps(own)(lambda self: plain(own(self)))  # type: ignore[method-assign]

    def __repr__(self) -> str:
        """Return what it says, in 15 lines at most."""
        return str(_shown().text(self))

    def _repr_html_(self) -> str:
        return str(_shown().html(self))

    def to_dict(self) -> dict[str, Any]:
        """Return its numbers as plain values, SI, as the command's JSON has them."""
        raise NotImplementedError

    def plot(self) -> "Figure":
        """Return its picture, a matplotlib Figure; raises NoAnswerError where it has none."""
        figure: Figure = _shown().figure(self)
        return figure

    def to_dataframe(self) -> "pd.DataFrame":
        """Return its main table; the units stand in `attrs["units"]`, as UDUNITS writes them.

        Raises NoAnswerError where it has no table.
        """
        frame: pd.DataFrame = _shown().dataframe(self)
        return frame

    def to_dataset(self) -> "xr.Dataset":
        """Return its arrays with a unit and a name for each; raises NoAnswerError without any."""
        dataset: xr.Dataset = _shown().dataset(self)
        return dataset

    def report(self, path: str | Path) -> Path:
        """Write it as one HTML page, its figures to hover and zoom; return the path.

        The page holds all that it needs. Raises InputError where the file cannot be written.
        """
        return Path(_shown().report(self, Path(path)))

    def save(self, folder: str | Path) -> list[Path]:
        """Write it into a folder, as its command does: numbers, tables, pictures; return the paths.

        Raises InputError where the folder cannot be written.
        """
        return list(_shown().save(self, Path(folder)))


def _shown() -> Any:
    """Return the module that shows answers, which stands above all that make them."""
    return import_module("swimbladder.show.answers")


def plain(value: Any) -> Any:
    """Return `value` in JSON's own types; None for what is not finite, [re, im] for a complex.

    A record that has `to_dict` says itself what it is.
    """
    if isinstance(value, enum.Enum):
        return plain(value.value)
    if isinstance(value, str):
        return as_asked(value)
    if value is None or isinstance(value, (bool, int)):
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
    attribute ``rms``. Where JSON has another name, both stand there: ``hold_m=held``; so may the
    attribute of an attribute, ``depth_m=place.depth``.
    """
    return {key: plain(value) for key, value in attributes(record, keys).items()}


def attributes(record: Any, keys: str) -> dict[str, Any]:
    """Return attributes of a record, as they are, by `keys` as `as_json` has them."""
    found = {}
    for word in keys.split():
        key, _, name = word.partition("=")
        found[key] = attrgetter(name or _attribute(record, key))(record)
    return found


def _attribute(record: Any, key: str) -> str:
    """Return the longest beginning of a key that is an attribute's name; the rest is a unit."""
    name = key
    while not hasattr(record, name) and "_" in name:
        name = name.rpartition("_")[0]
    return name
