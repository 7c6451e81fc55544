"""Groups of options: dataclasses in a command's signature, whose fields typer takes as its options.

A field is annotated as a parameter of a command is. The word for its value in the help says how
its text is read: ``depth: Annotated[str, typer.Option(metavar="DEPTH", help="...")] = "0 m"`` as
metres, LEAST:MOST as two depths. Another way to read it stands beside that, as a `Read`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_type_hints

import typer
from typer.models import OptionInfo

from swimbladder.cli.common import emit_json, output, quantity, said_as_typed
from swimbladder.errors import InputError

_UNITS = {
    "DEPTH": "m", "DENSITY": "kg/m3", "DISTANCE": "m", "ENERGY": "J", "LENGTH": "m", "MASS": "kg",
    "POWER": "W", "PSI": "m3/m", "SHARE": "", "SPEED": "m/s", "TEMP": "degC", "TIME": "s",
    "VOLTAGE": "V", "VOLUME": "m3", "1/K": "1/K",
}  # fmt: skip


class Read(NamedTuple):
    """How the text of an option is read: a function of the text and the option's name."""

    how: Callable[[str, str], Any]


def names(text: str) -> tuple[str, ...]:
    """Return the names of NAME,NAME; none of ``none``."""
    found = tuple(name.strip() for name in text.split(",") if name.strip())
    return () if found in ((), ("none",)) else found


def depth_pair(text: str, option: str) -> tuple[float, float]:
    """Return two depths [m] of LEAST:MOST, with one unit for both or one each.

    Raises InputError naming the option.
    """
    parts = [part.strip() for part in text.split(":")]
    if len(parts) != 2 or not all(parts):
        raise InputError(
            "two depths are given with a colon between", field=option, value=text, unit="m",
            remedy='Write it like "0:10 m"',
        )  # fmt: skip
    unit = parts[1].lstrip("+-.0123456789eE").strip()
    if unit and not parts[0].lstrip("+-.0123456789eE").strip():
        parts[0] = f"{parts[0]} {unit}"
    first, last = (quantity(part, "m", option) for part in parts)
    assert first is not None
    assert last is not None
    return first, last


def _read(text: str, option: str, marks: Sequence[Any]) -> Any:
    """Return what a text stands for: by a `Read`, by the option's metavar, or as it is."""
    for mark in marks:
        if isinstance(mark, Read):
            return mark.how(text, option)
    word = next((mark.metavar for mark in marks if isinstance(mark, OptionInfo)), None)
    if word in ("LEAST:MOST", "FROM:TO"):
        return depth_pair(text, option)
    if word == "NAME,...":
        return names(text)
    return quantity(text, _UNITS[word], option) if word in _UNITS else text


@dataclass(frozen=True)
class Options:
    """A group of options, by the names that the functions below the command line have for them."""

    @classmethod
    def named(cls) -> dict[str, str]:
        """Return the option of each field, of a flag the one that changes it."""
        return {
            name: next(
                (
                    info.default.split("/")[-1].strip()
                    for info in marks
                    if isinstance(getattr(info, "default", None), str)
                ),
                "--" + name.replace("_", "-"),
            )
            for name, marks in _marks(cls).items()
        }  # fmt: skip

    def read(self) -> dict[str, Any]:
        """Return the values by field, read as they are annotated: numbers in SI.

        Raises InputError naming the option.
        """
        found, options = dict(vars(self)), self.named()
        for name, marks in _marks(type(self)).items():
            if found[name] is not None:
                found[name] = _read(found[name], options[name], marks)
        return found

    def given(self) -> dict[str, Any]:
        """Return `read` without what is not given."""
        return {name: value for name, value in self.read().items() if value is not None}

    def changed(self) -> dict[str, object]:
        """Return what was typed and is not what stands where nothing is typed, by option."""
        options = self.named()
        return {
            options[one.name]: value
            for one in fields(self)
            if (value := getattr(self, one.name)) != one.default and value not in (None, [])
        }

    @contextmanager
    def said_as_typed(self, **others: str) -> Iterator[None]:
        """Name in InputErrors of the block the option of a field, and what was typed for it.

        others: fields of the functions in the block that this group calls otherwise, ``z="depth"``.
        """
        options = self.named()
        typed = {options[name]: text for name, text in vars(self).items() if isinstance(text, str)}
        renamed = {field: options[name] for field, name in others.items()}
        with said_as_typed(typed, **{"cast": "--cast", **options, **renamed}):
            yield


@dataclass(frozen=True)
class Files(Options):
    """Where the files of a command go, and whether its answer is JSON."""

    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")]
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False

    def answer(
        self, answer: Mapping[str, Any], files: Sequence[Path], show: Callable[[], object]
    ) -> None:
        """Print the answer and its files: as JSON, or as `show` does."""
        if self.json:
            emit_json({**answer, "files": [str(path) for path in files]})
            return
        show()
        for path in files:
            output.print(f"wrote {path}", soft_wrap=True)


def grouped(**defaults: object) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator: a command's groups of options are options of its own for typer.

    defaults: of fields of its groups, where they are another command's too, ``out=Path("here")``.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        hints = get_type_hints(command, include_extras=True)
        groups: dict[str, tuple[type[Options], dict[str, str]]] = {}
        taken: list[inspect.Parameter] = []
        for name, parameter in inspect.signature(command).parameters.items():
            kind = hints[name]
            if not (isinstance(kind, type) and issubclass(kind, Options)):
                taken.append(_parameter(name, kind, parameter.default))
                continue
            called = {one: _word(option) for one, option in kind.named().items()}
            groups[name] = kind, called
            taken += [
                _parameter(called[one], hint, defaults.get(one, default))
                for one, hint, default in _fields(kind)
            ]

        def flat(**given: Any) -> None:
            for name, (kind, called) in groups.items():
                given[name] = kind(**{one: given.pop(word) for one, word in called.items()})
            command(**given)

        flat.__name__, flat.__doc__, flat.__module__ = (
            command.__name__, command.__doc__, command.__module__,
        )  # fmt: skip
        flat.__annotations__ = {one.name: one.annotation for one in taken}
        flat.__signature__ = inspect.Signature(taken)  # type: ignore[attr-defined]
        return flat

    return decorate


def _word(option: str) -> str:
    return option.lstrip("-").replace("-", "_")


def _parameter(name: str, kind: object, default: object) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)


def _fields(group: type[Options]) -> list[tuple[str, object, object]]:
    """Return name, annotation and default of each field."""
    hints, none = get_type_hints(group, include_extras=True), inspect.Parameter.empty
    return [
        (one.name, hints[one.name], none if one.default is MISSING else one.default)
        for one in fields(group)
    ]


def _marks(group: type[Options]) -> dict[str, tuple[Any, ...]]:
    """Return what stands beside the type of each field."""
    return {name: getattr(kind, "__metadata__", ()) for name, kind, _ in _fields(group)}
