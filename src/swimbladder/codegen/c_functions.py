"""One function of a law as C99."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Collection, Iterator

from swimbladder.codegen.c_expressions import ExpressionText
from swimbladder.codegen.c_flow import alive, assigned, inner_home, mentioned
from swimbladder.codegen.c_places import Home, c_field, c_local, c_type, wrapped
from swimbladder.codegen.tree import (
    Assign,
    Call,
    Expression,
    Field,
    For,
    Function,
    If,
    Make,
    Name,
    Number,
    Record,
    Statement,
    place_of,
)

Path = tuple[str, ...]  # names of fields that lead to a place in the state

_COPIES = 6  # of a function of numbers; calls of it take less than more of them
_ZEROS = 4  # fields; from more than these on memset is shorter


def shortened(words: str) -> str:
    """Return a docstring's sentence as the text of a comment."""
    return words.replace("*/", "* /").replace("``", "").rstrip(".")


class FunctionText:
    """A function being written: names of its variables, declared or not yet, and its lines."""

    def __init__(
        self, law: str, function: Function, names: dict[Function, str],
        fields: dict[str, set[str]], home: Home | None = None,
        placed: Collection[Function] = (),
    ) -> None:  # fmt: skip
        self.law, self.function, self.placed = law, function, placed
        self.home = {name for name in home or () if name is not None}
        self.body = alive(function.body)
        self.taken: set[str] = set()
        self.names: dict[str, str] = {}
        self.pointers: set[str] = set(self.home)
        self.expressions = ExpressionText(law, names, self.names, self.pointers, fields, self._keep)
        self.lines: list[str] = []
        self.indent = "    "
        self._counts = assigned(self.body)
        self._ends = "value"

    def helper(self, name: str, calls: int) -> str:
        """Return the text of a function that others of the law call, so many times."""
        given = []
        for python, kind in self.function.parameters:
            c = self._name(python)
            if isinstance(kind, Record):
                self.pointers.add(python)
                constant = "" if python in self.home else "const "
                given.append(f"{constant}{c_type(self.law, kind)} *{c}")
            else:
                given.append(f"{c_type(self.law, kind)} {c}")
        returns = c_type(self.law, self.function.returns)
        if self.home:
            self._ends, returns = "place", "void"
        plain = not any(isinstance(kind, Record) for _, kind in self.function.parameters)
        called = "SWB_CALLED " if plain and calls > _COPIES else ""
        head = f"static {called}{returns} {name}({', '.join(given)})"
        return self._written(head, [self.names[p] for p, _ in self.function.parameters])

    def step(self, head: str) -> str:
        """Return the text of the law's step."""
        self._ends = "step"
        self._entry(("p", "state", "m", "reference"), ("next_s",))
        return self._written(head, ["p", "state", "m", "reference"])

    def initial(self, head: str) -> str:
        """Return the text of the law's first state."""
        self._ends = "initial"
        self._entry(("p", "m", "reference"), ("state",))
        return self._written(head, ["p", "m", "reference"])

    def _entry(self, given: tuple[str, ...], more: tuple[str, ...]) -> None:
        self.taken |= {*given, *more}
        for (python, kind), c in zip(self.function.parameters, given, strict=True):
            self.names[python] = c
            if isinstance(kind, Record):
                self.pointers.add(python)

    def _name(self, python: str) -> str:
        if python not in self.names:
            self.names[python] = c_local(python, self.taken)
        return self.names[python]

    def _written(self, head: str, parameters: list[str]) -> str:
        given = dict(self.function.parameters)
        for own in self.home - set(given):  # it lives where the state stands
            self.names[own] = next(self.names[n] for n in self.home & set(given))
        variables = [n for n, _ in self.function.variables if n in self._counts and n not in given]
        variables = [n for n in variables if n not in self.home]
        self._block(self.body, variables)
        written = "\n".join(self.lines)
        unused = [f"    (void){c};" for c in parameters if not _mentions(written, c)]
        words = f"/* {shortened(self.function.words)}. */\n" if self.function.words else ""
        if self._ends in ("step", "initial"):
            words = ""
        text = "\n".join(
            [*map(wrapped, head.splitlines()), "{", *unused, *map(wrapped, self.lines), "}", ""]
        )
        return words + text

    def _line(self, text: str) -> None:
        self.lines.append(self.indent + text)

    def _keep(self, value: str, kind: Record) -> str:
        """Write a record into a variable of its own, and return its name."""
        name = c_local("kept", self.taken)
        self._line(f"const {c_type(self.law, kind)} {name} = {value};")
        return name

    def _block(self, statements: tuple[Statement, ...], variables: list[str]) -> None:
        """Write statements; the variables are declared where they first stand, or further in."""
        homes: dict[int, list[str]] = {}  # of variables that live in one branch or loop only
        first: dict[int, list[str]] = {}
        for name in variables:
            where = [n for n, s in enumerate(statements) if name in mentioned(s)]
            inner = len(where) == 1 and inner_home(statements[where[0]], name) is not None
            (homes if inner else first).setdefault(where[0], []).append(name)
        for n, s in enumerate(statements):
            born = first.get(n, [])
            if isinstance(s, Assign):
                self._assign(s, declare=s.name in born)
                continue
            for name in born:
                self._line(f"{self._type_of(name)} {self._name(name)};")
            within = homes.get(n, [])
            if isinstance(s, If):
                self._if(s, within)
            elif isinstance(s, For):
                counter = self._name(s.counter)
                self._line(f"for (int {counter} = 0; {counter} < {s.count}; ++{counter}) {{")
                self._inner(s.body, within)
                self._line("}")
            else:
                self._return(s.value)

    def _type_of(self, name: str) -> str:
        return c_type(self.law, dict(self.function.variables)[name])

    def _inner(self, statements: tuple[Statement, ...], variables: list[str]) -> None:
        self.indent += "    "
        self._block(statements, variables)
        self.indent = self.indent[:-4]

    def _assign(self, s: Assign, *, declare: bool) -> None:
        if s.name in self.home:
            self._change(s.value)
            return
        if isinstance(s.value, Make) and declare:  # an initialiser needs no name of the type
            value = self.expressions.braces(s.value)
        else:
            value = self.expressions.value(s.value)
        name = self._name(s.name)
        if declare:
            constant = "const " if self._counts[s.name] == 1 else ""
            name = f"{constant}{self._type_of(s.name)} {name}"
        self._line(f"{name} = {value};")

    def _change(self, value: Expression) -> None:
        """Change the state where it stands."""
        if isinstance(value, Make):
            self._write_state(value)
        elif not isinstance(value, Name):
            self._line(f"{self.expressions.value(value)};")

    def _if(self, s: If, variables: list[str], word: str = "if") -> None:
        yes = [name for name in variables if inner_home(s, name) is s.yes]
        self._line(f"{word} ({self.expressions.value(s.condition)}) {{")
        self._inner(s.yes, yes)
        no = [name for name in variables if name not in yes]
        if len(s.no) == 1 and self._else_if(s.no[0], no):
            return
        if s.no:
            self._line("} else {")
            self._inner(s.no, no)
        self._line("}")

    def _else_if(self, s: Statement, variables: list[str]) -> bool:
        """Write ``else if`` where the second condition needs nothing that stands before it."""
        if not isinstance(s, If) or any(inner_home(s, name) is None for name in variables):
            return False
        before = len(self.lines)
        self.expressions.value(s.condition)
        alone = len(self.lines) == before
        del self.lines[before:]
        if alone:
            self._if(s, variables, "} else if")
        return alone

    def _return(self, value: Expression) -> None:
        if self._ends == "value":
            self._line(f"return {self.expressions.value(value)};")
        elif self._ends == "place":
            self._change(value)
            if len(self.indent) > 4:
                self._line("return;")
        elif self._ends == "initial":
            self._write_state(value)
            if len(self.indent) > 4:
                self._line("return;")
        elif isinstance(value, Make):
            command = self._scalar("command", value.values[0])
            following = self._scalar("following", value.values[2])
            self._write_state(value.values[1])
            self._line(f"*next_s = {following};")
            self._line(f"return {command};")
        else:  # what another step returned
            whole = self.expressions.address(value)
            at = f"{whole}->" if not whole.startswith("&") else f"{whole[1:]}."
            names = (
                [name for name, _ in value.type.fields] if isinstance(value.type, Record) else []
            )
            self._line(f"*state = {at}{names[1]};")
            self._line(f"*next_s = {at}{names[2]};")
            self._line(f"return {at}{names[0]};")

    def _scalar(self, name: str, value: Expression) -> str:
        """Return a number that stays what it is while the state is written."""
        text = self.expressions.value(value)
        if isinstance(value, Number | Name):
            return text
        kept = c_local(name, self.taken)
        self._line(f"const {c_type(self.law, value.type)} {kept} = {text};")
        return kept

    def _write_state(self, value: Expression) -> None:
        """Write the new state, every value calculated before the first is written."""
        if not isinstance(value, Make):
            text = self.expressions.value(value)
            if text != "*state":
                self._line(f"*state = {text};")
            return
        kept = list(self._new(value))
        zeros = [e for _, e in kept if _is_zero(e)]
        if self._ends == "initial" and len(zeros) > _ZEROS:
            self._line("memset(state, 0, sizeof *state);")
            kept = [(path, e) for path, e in kept if not _is_zero(e)]
        pairs: list[tuple[Path, str]] = []
        for path, e in kept:
            if isinstance(e, Call) and e.function in self.placed:
                self._line(f"{self.expressions.value(e)};")
                continue
            text = self.expressions.value(e)
            if any(_meet(read, before) for read in self._reads(e) for before, _ in pairs):
                after = c_local(f"new_{path[-1]}", self.taken)
                self._line(f"const {c_type(self.law, e.type)} {after} = {text};")
                text = after
            pairs.append((path, text))
        at = self._state()
        for path, text in pairs:
            self._line(f"{at}->{'.'.join(map(c_field, path))} = {text};")

    def _state(self) -> str:
        return next((self.names[name] for name in self.home), "state")

    def _old(self) -> set[str]:
        """Return the names of the state as it was."""
        own = {self.function.parameters[1][0]} if self._ends == "step" else set()
        return self.home | own

    def _new(self, value: Make, path: Path = ()) -> Iterator[tuple[Path, Expression]]:
        """Yield the place in the state of each number that changes, and its value."""
        old = self._old()
        for (name, _), e in zip(value.type.fields, value.values, strict=True):
            root, names = place_of(e)
            if isinstance(e, Make):
                yield from self._new(e, (*path, name))
            elif not (isinstance(root, Name) and root.name in old and names == (*path, name)):
                yield (*path, name), e

    def _reads(self, e: Expression) -> list[Path]:
        """Return the places in the old state that an expression reads."""
        old = self._old()
        if isinstance(e, Name | Field):
            root, names = place_of(e)
            if isinstance(root, Name):
                return [names] if root.name in old else []
        inner = (getattr(e, f.name) for f in dataclasses.fields(e) if f.name != "type")
        flat = (x for part in inner for x in (part if isinstance(part, tuple) else (part,)))
        return [p for x in flat if isinstance(x, Expression) for p in self._reads(x)]


def _meet(a: Path, b: Path) -> bool:
    """Return whether two places in a record are the same, or one within the other."""
    return all(x == y for x, y in zip(a, b, strict=False))


def _is_zero(e: Expression) -> bool:
    return isinstance(e, Number) and e.value == 0.0 and math.copysign(1.0, e.value) > 0.0


def _mentions(text: str, name: str) -> bool:
    return re.search(rf"(?<![\w.>]){re.escape(name)}\b", text) is not None
