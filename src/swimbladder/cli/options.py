"""Groups of options: classes in a command's signature, whose fields typer takes as its options.

The word for a value in the help says how its text is read: ``depth: str = valued("DEPTH", "...",
"0 m")`` as metres, LEAST:MOST as two depths. Another way to read it stands beside that.

How the texts that options take are read: names, pairs NAME=VALUE, depths and their units.
"""

import datetime
import inspect
import math
import shutil
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from copy import copy
from dataclasses import MISSING, Field, dataclass, field, fields
from functools import wraps
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    TypeVar,
    dataclass_transform,
    get_args,
    get_type_hints,
)

import typer
from typer.models import OptionInfo

from swimbladder.cli.common import (
    aside,
    emit_json,
    progress,
    said_as_typed,
    show_answer,
    typed_command,
)
from swimbladder.errors import InputError, NoAnswerError, check_number
from swimbladder.io.answers import Answer
from swimbladder.show.parts import Part, Shown
from swimbladder.units import quantity, with_one_unit

if TYPE_CHECKING:
    from swimbladder.vehicle import Vehicle

Given = str | None  # a text that need not be given
Several = list[str] | None  # likewise, more than one
_Value = TypeVar("_Value")


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
        why, remedy = "two depths are given with a colon between", 'Write it like "0:10 m"'
        raise InputError(why, field=option, value=text, unit="m", remedy=remedy)
    first, last = (quantity(part, "m", option) for part in with_one_unit(parts))
    return first, last


def pair(text: str, option: str) -> tuple[str, str]:
    """Return NAME and VALUE of a text NAME=VALUE given to `option`.

    Raises InputError naming the option where it is none.
    """
    name, sign, value = text.partition("=")
    if not sign or not name.strip() or not value.strip():
        remedy = f"Write it as {option} NAME=VALUE"
        raise InputError("not a pair", field=option, value=text, remedy=remedy)
    return name.strip(), value.strip()


def once(pairs: Sequence[tuple[str, _Value]], option: str) -> dict[str, _Value]:
    """Return the pairs as a dictionary; raises InputError where a name stands twice."""
    found: dict[str, _Value] = {}
    for name, value in pairs:
        if name in found:
            raise InputError("given twice", field=option, value=name, remedy="Give it once")
        found[name] = value
    return found


def pairs(texts: Sequence[str], option: str) -> dict[str, str]:
    """Return the pairs NAME=VALUE of an option; raises InputError where a name stands twice."""
    return once([pair(text, option) for text in texts], option)


def deviation(unit: str) -> Callable[[str, str], float]:
    """Return what reads a standard deviation in `unit`, infinite for ``none``."""

    def read(text: str, option: str) -> float:
        return math.inf if text.strip().lower() == "none" else quantity(text, unit, option)

    return read


_UNITS = {
    "DEPTH": "m",
    "DENSITY": "kg/m3",
    "ENERGY": "J",
    "LENGTH": "m",
    "MASS": "kg",
    "POWER": "W",
    "PSI": "m3/m",
    "RATE": "m3/s",
    "SHARE": "",
    "SPEED": "m/s",
    "TEMP": "degC",
    "TIME": "s",
    "VOLTAGE": "V",
    "VOLUME": "m3",
    "1/K": "1/K",
}


_VEHICLE = typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")
VehicleName = Annotated[str, _VEHICLE]
_SUPERVISED = typer.Option("--supervised/--unsupervised", help="Supervised, or the law alone.")
Supervised = Annotated[bool, _SUPERVISED]
AnyVehicle = Annotated[str | None, _VEHICLE]
LogFiles = Annotated[list[Path], typer.Argument(metavar="LOG...", help="CSV files, or gzipped.")]


def valued(
    word: str | None,
    help: str,
    default: Any = None,
    *,
    name: str | None = None,
    read: Callable[[Any, str], Any] | None = None,
    **more: Any,
) -> Any:
    """Return a field of a group: an option with a word for its value in the help.

    default: ... where it must be given. name: of the option, where that is not the field's (of
    one of a list without its s). read: how its text is read, where the word does not say it. more:
    as `typer.Option` has it.
    """
    info = typer.Option(*([] if name is None else [name]), metavar=word, help=help, **more)
    about = {"info": info, "read": read}
    return field(metadata=about) if default is ... else field(default=default, metadata=about)


def loaded(name: str, **able: bool) -> "Vehicle":
    """Return a vehicle; able: to what it has to be, as `load_vehicle` has it."""
    from swimbladder.io.config import load_vehicle

    return load_vehicle(name, **able)


def flag(name: str, help: str, default: bool | None = False) -> Any:
    """Return a field of a group: an option without a value."""
    return valued(None, help, default, name=name)


def supervised() -> Any:
    """Return a field: whether law and supervisor are flown, None for what the file says."""
    return valued(None, str(_SUPERVISED.help), None, name="--supervised/--unsupervised")


def _moment(text: str, option: str) -> datetime.datetime:
    try:
        found = datetime.datetime.fromisoformat(text)
    except ValueError:
        remedy = "Write 2026-03-01T12:00:00Z"
        raise InputError("this is no time", field=option, value=text, remedy=remedy) from None
    return found if found.tzinfo else found.replace(tzinfo=datetime.UTC)


def _read(text: Any, option: str, about: Mapping[str, Any]) -> Any:
    """Return what a text stands for: by a function of it, by the option's word, or as it is."""
    word = about["info"].metavar
    if about["read"] is not None:
        return about["read"](text, option)
    if word in ("LEAST:MOST", "FROM:TO"):
        return depth_pair(text, option)
    if word in ("NAME=COLUMN", "COLUMN=VALUE", "NAME=VALUE"):
        return pairs(text, option)
    if word == "NAME,...":
        return names(text)
    if word == "DATE":
        return _moment(text, option)
    return quantity(text, _UNITS[word], option) if word in _UNITS else text


@dataclass_transform(frozen_default=True, kw_only_default=True)
@dataclass(frozen=True)
class Options:
    """A group of options, by the names that the functions below the command line have for them.

    Every kind of it is a frozen dataclass of keywords.
    """

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True)(cls)

    @classmethod
    def named(cls) -> dict[str, str]:
        """Return the option of each field, of a flag the one that changes it."""
        return {one.name: _option(one) for one in fields(cls)}

    def read(self) -> dict[str, Any]:
        """Return the values by field, read as they are annotated: numbers in SI.

        Raises InputError naming the option.
        """
        found, options = dict(vars(self)), self.named()
        for one in fields(self):
            if found[one.name] is not None:
                found[one.name] = _read(found[one.name], options[one.name], one.metadata)
        return found

    def given(self) -> dict[str, Any]:
        """Return `read` without what is not given."""
        return {name: value for name, value in self.read().items() if value is not None}

    def changed(self, *but: str) -> dict[str, object]:
        """Return what was typed and is not what stands where nothing is typed, by option.

        but: fields that are left out.
        """
        options = self.named()
        return {
            options[one.name]: value
            for one in fields(self)
            if (value := getattr(self, one.name)) != one.default and value not in (None, [])
            if one.name not in but
        }

    def refuse(self, why: str, remedy: str, *but: str) -> None:
        """Raise InputError where one is typed that has no use here.

        but: fields that have one.
        """
        for option, value in self.changed(*but).items():
            raise InputError(why, field=option, value=value, remedy=remedy)

    def said_as_typed(self, **others: str) -> AbstractContextManager[None]:
        """Name in messages of the block the option of a field, and what was typed for it.

        A command does so for all of its groups: this is for fields of which two have one, and for
        others: those that this group calls otherwise, ``z="depth"``.
        """
        options = self.named()
        renamed = {field: options[name] for field, name in others.items()}
        return said_as_typed({**options, **renamed}, self.changed())


class Printed(Options):
    """How much of an answer is printed: 15 lines, all of it, or JSON."""

    full: bool = flag("--full", "Print the whole answer, not 15 lines of it.")
    json: bool = flag("--json", "Print one JSON object and nothing else.")

    def show(
        self, answer: Mapping[str, Any], parts: Iterable[Part], ends: Sequence[str] = ()
    ) -> None:
        """Print an answer as JSON or by its parts, the most important first, and `ends`."""
        if self.json:
            emit_json(answer)
        else:
            show_answer(parts, ends, full=self.full)


class Files(Printed):
    """Where the files of a command go, and how its answer is printed."""

    out: Path = valued("DIR", "Folder for the files.", ..., name="--out")

    def check(self) -> None:
        """Raise InputError where the folder could not be made, before anything is done."""
        from swimbladder.io.files import check_place

        if self.out is not None:
            check_place(self.out)

    def answer(
        self, found: Answer | Shown[Any], also: Sequence[Path] = (), *, keep: Path | None = None
    ) -> None:
        """Print an answer and its files, which are written; exit where it is not good.

        also: files that are there already; keep: the folder where unfinished work was kept, which
        has no use any more. Without a folder nothing is written. Why an answer is not good stands
        on stderr beside JSON.
        """
        from swimbladder.show.answers import shown, write

        made = shown(found) if isinstance(found, Answer) else found
        files = list(also)
        if self.out is not None:
            with progress("drawing and writing", 1.0) as advance:
                files = write(made, self.out, typed_command(), advance, also)
        if keep is not None:
            shutil.rmtree(keep, ignore_errors=True)
        numbers = {**made.printed(), "files": [str(path) for path in files]}
        self.show(numbers, made.parts(), self.wrote(files))
        if made.exit_code and made.error:
            raise NoAnswerError(made.error)
        if made.exit_code:
            aside(*(made.why if self.json else ()))
            raise typer.Exit(made.exit_code)

    def wrote(self, files: Sequence[Path]) -> list[str]:
        """Return the line that says where the files are; none where there are none."""
        named = [str(path.relative_to(self.out)) for path in files if path.is_relative_to(self.out)]
        more = len(named) - _NAMED
        if more > 1 and not self.full:
            named = [*named[:_NAMED], f"{more} more"]
        return [f"wrote to {self.out}: {', '.join(named)}"] if named else []


_NAMED = 8  # files that one line names


class Sought(Options):
    """What is identified, and what is known of it."""

    free: Given = valued(
        "NAME,...",
        "Parameters to identify: K2, T2, psi; mass, drag_quadratic; K1, T1 (those of the "
        "drag law, and psi).",
    )
    fixed: Several = valued("NAME=VALUE", 'Parameter fixed at a value: "psi=2e-6 m3/m".')
    priors: Several = valued("NAME=VALUE", 'Prior of a parameter: "psi=2e-6 +- 1e-6 m3/m".')
    drag: Given = valued("LAW", "Drag law: linear, quadratic or blended (the vehicle's).")


class TimeLimit(Options):
    """How long a mission takes at most, for the supervisor that is flashed."""

    time_limit: Given = valued("TIME", "Time limit of the supervisor ([supervisor] time_limit).")

    def flashed(self, name: str) -> "Vehicle":
        """Return the vehicle that a board runs, with it: of motors, or of pump and valve."""
        v = loaded(name)
        return self.on(v if v.command == "volume change" else loaded(name, sampled=True))

    def on(self, vehicle: "Vehicle") -> "Vehicle":
        """Return the vehicle whose supervisor has it; as it was where none is given."""
        limit = self.read()["time_limit"]
        if limit is None:
            return vehicle
        check_number(limit, "--time-limit", "s", above=0.0)
        return vehicle.but("supervisor", time_limit=limit)


class Golden(Options):
    """The step of the golden trace, as `codegen.library.firmware` has it."""

    step: Given = valued("FROM:TO", "Step of the golden trace (1.5:3 m; float: 0:100 m).")
    duration: Given = valued("TIME", "Duration of the golden trace (400 s; float: 5400 s).")
    seed: int = valued("N", "Seed of the sensors' noise.", 1, min=0)


_COMMON = ("vehicle", "cast", "seed", "plot", "out", "full", "json")


def grouped(
    first: str | None = None, /, **defaults: object
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator: a command's groups of options are options of its own for typer.

    first: the options that most need, between blanks: with those that all commands share they
    come first in the help, the others under "Advanced". None: all do. defaults: of fields of its
    groups, where they are another command's too, ``out=Path("here")``.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        """Return the command with the fields of its groups as options in their place."""
        hints = get_type_hints(command, include_extras=True)
        groups: dict[str, tuple[type[Options], dict[str, str]]] = {}
        taken: list[inspect.Parameter] = []
        asked: dict[str, str] = {}  # the option of each parameter
        for name, parameter in inspect.signature(command).parameters.items():
            kind = hints[name]
            if not (isinstance(kind, type) and issubclass(kind, Options)):
                taken.append(_parameter(name, kind, parameter.default))
                asked.setdefault(name, _typed_as(name, kind))
                continue
            options = kind.named()
            asked = {**options, **asked}
            called = {one: option.lstrip("-").replace("-", "_") for one, option in options.items()}
            groups[name] = kind, called
            own = get_type_hints(kind)
            for one in fields(kind):
                default = defaults.get(one.name, one.default)
                word, info = called[one.name], one.metadata["info"]
                taken.append(_parameter(word, Annotated[own[one.name], info], default))

        @wraps(command)
        def flat(**given: Any) -> None:
            """Make the groups from the options, check their input files, and run the command."""
            typed = {"--" + name.replace("_", "-"): value for name, value in given.items()}
            for name, (kind, called) in groups.items():
                given[name] = kind(**{one: given.pop(word) for one, word in called.items()})
            with said_as_typed(asked, typed):
                for made in given.values():
                    if isinstance(made, Files):
                        made.check()
                command(**given)

        if first is not None:
            taken = [_placed(one, {*first.split(), *_COMMON}) for one in taken]
        flat.__annotations__ = {one.name: one.annotation for one in taken}
        flat.__signature__ = inspect.Signature(taken)  # type: ignore[attr-defined]
        return flat

    return decorate


def _placed(one: inspect.Parameter, first: Collection[str]) -> inspect.Parameter:
    """Return a parameter of a command, under "Advanced" in its help unless it comes first."""
    kind, info = get_args(one.annotation)[:2]
    if one.name in first or not isinstance(info, OptionInfo):
        return one
    later = copy(info)
    later.rich_help_panel = "Advanced"
    return one.replace(annotation=Annotated[kind, later])


def _typed_as(name: str, kind: object) -> str:
    """Return how a parameter of a command is typed: its option, or the word of an argument."""
    info = get_args(kind)[1] if get_args(kind) else None
    if not isinstance(info, OptionInfo):
        return str(getattr(info, "metavar", None) or name)
    return info.default if isinstance(info.default, str) else "--" + name.replace("_", "-")


def _option(one: Field[Any]) -> str:
    """Return the option of a field, of a flag the one that changes it."""
    named = one.metadata["info"].default
    if isinstance(named, str):
        return named.split("/")[-1].strip()
    several = any(word in str(one.type) for word in ("Several", "list"))
    name = one.name.removesuffix("s") if several else one.name
    return "--" + name.replace("_", "-")


def _parameter(name: str, kind: object, default: object) -> inspect.Parameter:
    default = inspect.Parameter.empty if default is MISSING else default
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
