"""The small typed tree that a control law is translated into, and that C and the twin are made of.

Four types: a number, a count, a truth and a record (a named tuple, or what a function returns
several of). Numbers are float32 where the tree is executed; every operation on them is one
rounding. Counts are whole numbers of 16 bits; no operation on them leaves 0 to 65535.

Below it stands what flows where in a law's functions. Which variables and fields are read and where
they live follows from what statements assign, hold and end with; so does which functions change the
state where it stands and return no copy of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, dataclass_transform


@dataclass_transform(frozen_default=True)
class Node:
    """A frozen dataclass: what the tree is made of, and its types."""

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True)(cls)


class Scalar(Node):
    """A number, a count, a truth, or the counter of a loop, which is either of the first two."""

    name: Literal["float", "count", "bool", "int"]


FLOAT, COUNT, BOOL, INT = Scalar("float"), Scalar("count"), Scalar("bool"), Scalar("int")


class Record(Node):
    """A named tuple by its class, or without one what functions return several of."""

    name: str
    fields: tuple[tuple[str, Type], ...]
    kind: type[Any] | None = field(default=None, compare=False)

    def own(self) -> tuple[Record, ...]:
        """Return the records that it is made of, each after those in it, and itself."""
        found: list[Record] = []
        for _, kind in self.fields:
            if isinstance(kind, Record):
                found += (record for record in kind.own() if record not in found)
        return (*found, self)


Type = Scalar | Record

Operator = Literal["+", "-", "*", "/", "&", "|"]
Comparison = Literal["<", "<=", ">", ">=", "==", "!="]
Junction = Literal["and", "or"]
OnNumbers = Literal["min", "max", "abs", "sqrt", "isfinite", "copysign"]
Known = OnNumbers | Literal["more", "less", "float", "count"]


class Number(Node):
    """A literal; as a truth 0 or 1."""

    value: float
    type: Type = FLOAT


class Constant(Node):
    """A number with a name at the top of a module."""

    name: str
    value: float
    type: Type = FLOAT


class Name(Node):
    """A parameter, a variable or the counter of a loop."""

    name: str
    type: Type


class Field(Node):
    """A field of a record."""

    of: Expression
    name: str
    type: Type


def place_of(e: Expression) -> tuple[Expression, tuple[str, ...]]:
    """Return what a field belongs to and the names that lead from there to it."""
    names: list[str] = []
    while isinstance(e, Field):
        names.insert(0, e.name)
        e = e.of
    return e, tuple(names)


class Minus(Node):
    """The number with its sign turned."""

    of: Expression
    type: Type = FLOAT


class Binary(Node):
    """A sum, difference, product or quotient: one rounding; bits of two counts."""

    operator: Operator
    left: Expression
    right: Expression
    type: Type = FLOAT


class Compare(Node):
    """A comparison of two numbers."""

    operator: Comparison
    left: Expression
    right: Expression
    type: Type = BOOL


class Logic(Node):
    """Truths joined by and, or by or."""

    operator: Junction
    of: tuple[Expression, ...]
    type: Type = BOOL


class Not(Node):
    """The opposite of a truth."""

    of: Expression
    type: Type = BOOL


class Choice(Node):
    """One of two values of the same type."""

    condition: Expression
    yes: Expression
    no: Expression
    type: Type


class Builtin(Node):
    """A function that C and the twin both have to the bit; `count` takes a loop's counter."""

    name: Known
    arguments: tuple[Expression, ...]
    type: Type


class Call(Node):
    """A call of another function of the law."""

    function: Function
    arguments: tuple[Expression, ...]
    type: Type


class Make(Node):
    """A record of new values, in the order of its fields."""

    type: Record
    values: tuple[Expression, ...]


Operation = Minus | Binary | Compare | Logic | Not | Choice
Expression = Number | Constant | Name | Field | Operation | Builtin | Call | Make


class Assign(Node):
    """A variable gets a value."""

    name: str
    value: Expression


class If(Node):
    """One of two branches."""

    condition: Expression
    yes: tuple[Statement, ...]
    no: tuple[Statement, ...]


class For(Node):
    """A loop with a constant count, at least once."""

    counter: str
    count: int
    body: tuple[Statement, ...]


class Return(Node):
    """The function's value."""

    value: Expression


Statement = Assign | If | For | Return


@dataclass(frozen=True, eq=False)
class Function:
    """A function: parameters with their types, body, and the type of what it returns.

    variables: every name that the body assigns, with its type, in the order of their appearance.
    """

    name: str
    parameters: tuple[tuple[str, Type], ...]
    variables: tuple[tuple[str, Type], ...]
    body: tuple[Statement, ...]
    returns: Type
    words: str  # the first sentence of its docstring


@dataclass(frozen=True, eq=False)
class Program:
    """A law: its functions, each after those that it calls, its records and its constants.

    helpers: the functions that other functions call; `step` and `initial` may be among them.
    """

    name: str
    parameters: Record
    state: Record
    measurement: Record
    records: tuple[Record, ...]
    constants: tuple[Constant, ...]
    helpers: tuple[Function, ...]
    step: Function
    initial: Function
    words: str

    def own(self) -> tuple[Record, ...]:
        """Return the records of its parameters, its state and what it sees, inner ones first."""
        roots = (self.measurement, self.parameters, self.state)
        return tuple(dict.fromkeys(record for root in roots for record in root.own()))


def always_returns(statements: Sequence[Statement]) -> bool:
    """Say whether every way through the statements ends in a return."""
    last = statements[-1] if statements else None
    if isinstance(last, If):
        return always_returns(last.yes) and always_returns(last.no)
    return isinstance(last, Return)


def children(node: object) -> Iterator[object]:
    """Yield the statements and expressions next within one, or within several."""
    inner = node if isinstance(node, tuple) else [v for k, v in vars(node).items() if k != "type"]
    for part in inner:
        if isinstance(part, tuple):
            yield from children(part)
        elif isinstance(part, Node):
            yield part


def parts(node: object) -> Iterator[object]:
    """Yield a statement or expression, or several, and all within, but no function called."""
    if not isinstance(node, tuple):
        yield node
    for part in children(node):
        yield from parts(part)


def names_read(node: object) -> set[str]:
    """Return the variables that statements or expressions read."""
    return {part.name for part in parts(node) if isinstance(part, Name)}


def calls_of(program: Program) -> Counter[Function]:
    """Return at how many places each function of a law is called."""
    functions = {*program.helpers, program.step, program.initial}
    return Counter(called for f in functions for called in _called(alive(f.body)))


def assigned(node: object) -> Counter[str]:
    """Return how often each variable is assigned."""
    return Counter(part.name for part in parts(node) if isinstance(part, Assign))


def mentioned(node: object) -> set[str]:
    """Return the variables that are read or assigned."""
    return names_read(node) | set(assigned(node))


def inner_home(statement: Statement, name: str) -> tuple[Statement, ...] | None:
    """Return the one branch or loop of a statement that mentions a variable; None: not just one."""
    if isinstance(statement, For):
        return statement.body
    if not isinstance(statement, If) or name in names_read(statement.condition):
        return None
    branches = [b for b in (statement.yes, statement.no) if name in mentioned(b)]
    return branches[0] if len(branches) == 1 else None


def alive(body: tuple[Statement, ...]) -> tuple[Statement, ...]:
    """Return the statements without variables that nothing reads: they have no other effect."""
    while True:
        kept = _without(body, names_read(body))
        if kept == body:
            return body
        body = kept


def _without(body: tuple[Statement, ...], read: set[str]) -> tuple[Statement, ...]:
    kept: list[Statement] = []
    for s in body:
        if isinstance(s, Assign) and s.name not in read:
            continue
        if isinstance(s, If):
            s = If(s.condition, _without(s.yes, read), _without(s.no, read))
            if not s.yes and not s.no:
                continue
        elif isinstance(s, For):
            s = For(s.counter, s.count, _without(s.body, read))
            if not s.body:
                continue
        kept.append(s)
    return tuple(kept)


def fields_read(program: Program) -> dict[str, set[str]]:
    """Return the fields of each record that are needed: all of the law's own, else those read."""
    read: dict[str, set[str]] = {record.name: set() for record in program.records}
    for function in (*program.helpers, program.step, program.initial):
        for part in parts(alive(function.body)):
            if isinstance(part, Field):
                read[part.of.type.name].add(part.name)
    own = {record.name for record in program.own()}
    for record in program.records:
        if record.name in own or record.kind is None or not read[record.name]:
            read[record.name] = {name for name, _ in record.fields}
    return read


Home = tuple[str, str | None]  # the parameter that is the state, and the variable that lives there


def in_place(program: Program) -> frozenset[Function]:
    """Return the functions that can be given the state, or a record in it, to change.

    Each takes one such record and returns one, and wherever it is called its result takes the place
    of the record that it was given.
    """
    hosts = [*program.helpers]
    hosts += [f for f in (program.step, program.initial) if f not in program.helpers]
    records = program.state.own()
    found = {f for f in program.helpers if f.returns in records and _given(f, f.returns)}
    while True:
        left = set(found)
        for host in hosts:
            homed = host in found or (host is program.step and host not in program.helpers)
            state = program.state if host is program.step else host.returns
            home = home_of(host, state, found) if homed else None
            if home is None:
                left -= {host, *_called(host.body)}
        if left == found:
            return frozenset(found)
        found = left


def home_of(function: Function, state: Type, placed: Collection[Function]) -> Home | None:
    """Return the state that a function can change where it stands, None where it cannot."""
    given = _given(function, state)
    body = alive(function.body)
    variables = [n for n, kind in function.variables if kind == state and n in mentioned(body)]
    if given is None or len(variables) > 1:
        return None
    if not variables:
        return (given, None) if _ends_well(body, {given}, placed) else None
    (own,) = variables
    first = next(n for n, s in enumerate(body) if own in mentioned(s))
    begin = body[first]
    if not (isinstance(begin, Assign) and begin.name == own and own not in names_read(begin)):
        return None
    if given in mentioned(body[first + 1 :]):
        return None
    return (given, own) if _ends_well(body, {given, own}, placed) else None


def _given(function: Function, state: Type) -> str | None:
    """Return the one parameter that is a state."""
    found = [name for name, kind in function.parameters if kind == state]
    return found[0] if len(found) == 1 else None


def _ends_well(body: tuple[Statement, ...], names: set[str], placed: Collection[Function]) -> bool:
    """Return whether every new state takes the place of the old one."""
    expected = 0
    for s in parts(body):
        new: Expression | None = None
        if isinstance(s, Assign) and s.name in names:
            new = s.value
        elif isinstance(s, Return):
            new = s.value
            if isinstance(new, Make) and new.type.kind is None:  # of a step
                new = new.values[1]
        if new is None:
            continue
        if isinstance(new, Call) and new.function in placed and isinstance(s, Assign):
            expected += _in_its_place(new, names, ())
        elif isinstance(new, Make):
            expected += _only_change(new, names, placed)
        elif not (isinstance(new, Name) and new.name in names):
            return False
    return expected == sum(f in placed for f in _called(body))


def _only_change(
    new: Make, names: set[str], placed: Collection[Function], path: tuple[str, ...] = ()
) -> bool:
    """Return whether all that is new is what one function makes of a record in its place."""
    changed = []
    for (name, _), e in zip(new.type.fields, new.values, strict=True):
        root, at = place_of(e)
        if not (isinstance(root, Name) and root.name in names and at == (*path, name)):
            changed.append((name, e))
    if len(changed) != 1:
        return False
    ((name, e),) = changed
    if isinstance(e, Make):
        return _only_change(e, names, placed, (*path, name))
    if not (isinstance(e, Call) and e.function in placed):
        return False
    return _in_its_place(e, names, (*path, name))


def _in_its_place(call: Call, names: set[str], path: tuple[str, ...]) -> bool:
    """Return whether a call is given the record at a place of the state, and nothing around it."""
    here = 0
    for argument in call.arguments:
        root, place = place_of(argument)
        if isinstance(argument.type, Record) and isinstance(root, Name) and root.name in names:
            if place != path and all(a == b for a, b in zip(place, path, strict=False)):
                return False
            here += place == path
    return here == 1


def _called(body: tuple[Statement, ...]) -> list[Function]:
    return [part.function for part in parts(body) if isinstance(part, Call)]
