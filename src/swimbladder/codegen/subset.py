"""A law's Python functions read into the small typed tree of `tree`.

What a law may be made of is written here, and only here; anything else is an InputError with its
file, its line and what to write instead. Types are inferred from the calls, beginning with those
of `step` and `initial`, so annotations are not needed.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import re
from collections.abc import Callable, Mapping
from types import FunctionType
from typing import Any, NoReturn

from swimbladder.codegen.statements import Body
from swimbladder.codegen.tree import (
    BOOL,
    COUNT,
    FLOAT,
    Constant,
    Function,
    Program,
    Record,
    Type,
)
from swimbladder.control.law import Count, Law, Measurement
from swimbladder.control.records import field_types, is_record, leaf_names
from swimbladder.errors import InputError


def read_law(law: Law, seen: type[Any] = Measurement) -> Program:
    """Return a law as a tree; seen: the NamedTuple that it sees at a sample.

    Raises InputError with file, line, construct and remedy where it is not in the subset.
    """
    reader = _Reader()
    if law.parameters is law.state:
        raise InputError(
            "the parameters and the state are the same class", field=f"law {law.name!r}",
            remedy="Give each a NamedTuple of its own",
        )  # fmt: skip
    parameters = reader.record(law.parameters, name="parameters")
    state = reader.record(law.state, name="state")
    measurement = reader.record(seen, name="measurement" if seen is Measurement else "seen")
    leaf_names(law.parameters)  # refuses two of the same name
    step = reader.function(law.step, (parameters, state, measurement, FLOAT))
    initial = reader.function(law.initial, (parameters, measurement, FLOAT))
    _check_entry(law, "step", step, law.step, (FLOAT, state, FLOAT))
    _check_entry(law, "initial", initial, law.initial, state)
    return Program(
        name=law.name, parameters=parameters, state=state, measurement=measurement,
        records=tuple(reader.records.values()), constants=tuple(reader.constants.values()),
        helpers=tuple(f for f in reader.functions.values() if f.name in reader.called),
        step=step, initial=initial, words=law.summary,
    )  # fmt: skip


def _check_entry(
    law: Law, what: str, function: Function, source: Callable[..., Any],
    returns: Type | tuple[Type, ...],
) -> None:  # fmt: skip
    got: Any = function.returns
    if isinstance(returns, tuple) and isinstance(got, Record) and got.kind is None:
        got = tuple(kind for _, kind in got.fields)
    if got != returns:
        wanted = "(command, state, next_sample_s)" if what == "step" else "the state"
        Source(source).refuse(
            None, f"{what} of the law {law.name!r} does not return {wanted}",
            f"Return {wanted}, the state as a {law.state.__name__}",
        )  # fmt: skip


class Source:
    """The text of a function, to point at its lines, and the names it can see."""

    def __init__(self, function: Callable[..., Any]) -> None:
        function = getattr(function, "py_func", function)  # what numba made of it
        self.function = function
        try:
            lines, first = inspect.getsourcelines(function)
            self.file = inspect.getsourcefile(function) or "?"
            self.tree = _definition("".join(lines))
        except (OSError, TypeError, SyntaxError) as error:
            raise InputError(
                "the source of a law's function cannot be read",
                field="law",
                value=getattr(function, "__name__", function),
                remedy="Write it as a plain function in a file",
            ) from error
        self.before = first - 1
        names = dict(function.__globals__)
        cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
        self.names: Mapping[str, Any] = names | {name: cell.cell_contents for name, cell in cells}

    def refuse(self, node: ast.AST | None, what: str, remedy: str) -> NoReturn:
        """Raise InputError about a node, or about the function as a whole."""
        at = self.tree if node is None else node
        raise InputError(
            what, file=self.file, line=self.before + getattr(at, "lineno", 1),
            field=f"{self.function.__name__}()",
            value=None if node is None or isinstance(node, ast.stmt) else ast.unparse(node),
            remedy=remedy,
        )  # fmt: skip

    def look_up(self, name: str) -> Any:
        """Return what a name means outside the function; KeyError where it means nothing."""
        if name in self.names:
            return self.names[name]
        return vars(builtins)[name]


def _definition(text: str) -> ast.FunctionDef:
    found = ast.parse(inspect.cleandoc("\n" + text) if text[:1].isspace() else text).body[0]
    if not isinstance(found, ast.FunctionDef):
        raise TypeError("not a plain function")
    return found


class _Reader:
    """Functions, records and constants found so far."""

    def __init__(self) -> None:
        self.functions: dict[tuple[Any, tuple[Type, ...]], Function] = {}
        self.records: dict[str, Record] = {}
        self.constants: dict[str, Constant] = {}
        self.called: set[str] = set()
        self._names: set[str] = set()
        self._reading: list[Any] = []

    def record(
        self, kind: type[Any], source: Source | None = None, at: Any = None, name: str = ""
    ) -> Record:
        """Return the record of a NamedTuple class: of floats, counts, truths or such records."""

        def refuse(what: str) -> NoReturn:
            remedy = "Make it a float, a Count, a bool, or a NamedTuple of such"
            if source is not None:
                source.refuse(at, what, remedy)
            raise InputError(what, field=kind.__qualname__, remedy=remedy)

        for known in self.records.values():
            if known.kind is kind:
                return known
        fields: list[tuple[str, Type]] = []
        for field, written in field_types(kind).items():
            if written is float:
                fields.append((field, FLOAT))
            elif written is bool:
                fields.append((field, BOOL))
            elif written == Count:
                fields.append((field, COUNT))
            elif is_record(written):
                fields.append((field, self.record(written, source, at)))
            else:
                refuse(f"the field {field!r} of {kind.__name__} is no float")
        name = name or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind.__name__.strip("_")).lower()
        while name in self.records:
            name += "_"
        return self.records.setdefault(name, Record(name, tuple(fields), kind))

    def result(self, types: tuple[Type, ...]) -> Record:
        """Return the record of what a function returns several of; the same for the same types."""
        fields = tuple((f"item{n}", kind) for n, kind in enumerate(types))
        unnamed = [record for record in self.records.values() if record.kind is None]
        for record in unnamed:
            if record.fields == fields:
                return record
        made = Record(f"result{len(unnamed) + 1}", fields)
        return self.records.setdefault(made.name, made)

    def constant(self, name: str, value: float) -> Constant:
        """Return a module's constant; one of the same name and another value gets another name."""
        name = name.strip("_")
        while name in self.constants and not _same(self.constants[name].value, value):
            name += "_"
        return self.constants.setdefault(name, Constant(name, value))

    def call(
        self, source: Source, node: ast.Call, function: Any, types: tuple[Type, ...]
    ) -> Function:
        """Return a function that another one calls."""
        if function in self._reading:
            source.refuse(node, "a law's functions do not call themselves", "Write it as a loop")
        found = self.function(function, types)
        self.called.add(found.name)
        return found

    def function(self, function: Callable[..., Any], types: tuple[Type, ...]) -> Function:
        """Return a function read with arguments of these types."""
        plain = getattr(function, "py_func", function)
        if (plain, types) in self.functions:
            return self.functions[plain, types]
        if not isinstance(plain, FunctionType):
            raise InputError(
                "not a plain function", field="law", value=function,
                remedy="Write the law's functions with def, at the top of a module",
            )  # fmt: skip
        source = Source(plain)
        name = plain.__name__.strip("_")
        while name in self._names:
            name += "_"
        self._names.add(name)
        self._reading.append(plain)
        read = Body(self, source, name, types).read()
        self._reading.pop()
        self.functions[plain, types] = read
        return read


def _same(a: float, b: float) -> bool:
    return a == b or (math.isnan(a) and math.isnan(b))
