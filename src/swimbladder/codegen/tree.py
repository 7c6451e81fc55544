"""The small typed tree that a control law is translated into, and that C and the twin are made of.

Four types: a number, a count, a truth and a record (a named tuple, or what a function returns
several of). Numbers are float32 where the tree is executed; every operation on them is one
rounding. Counts are whole numbers of 16 bits; no operation on them leaves 0 to 65535.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal


@dataclass(frozen=True)
class Scalar:
    """A number, a count, a truth, or the counter of a loop, which is either of the first two."""

    name: Literal["float", "count", "bool", "int"]


FLOAT, COUNT, BOOL, INT = Scalar("float"), Scalar("count"), Scalar("bool"), Scalar("int")


@dataclass(frozen=True)
class Record:
    """A named tuple by its class, or without one what functions return several of."""

    name: str
    fields: tuple[tuple[str, Type], ...]
    kind: type[Any] | None = field(default=None, compare=False)

    def type_of(self, name: str) -> Type | None:
        """Return the type of a field, None where there is none of that name."""
        return dict(self.fields).get(name)

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
Known = Literal[
    "min", "max", "abs", "sqrt", "isfinite", "copysign", "more", "less", "float", "count"
]


@dataclass(frozen=True)
class Number:
    """A literal; as a truth 0 or 1."""

    value: float
    type: Type = FLOAT


@dataclass(frozen=True)
class Constant:
    """A number with a name at the top of a module."""

    name: str
    value: float
    type: Type = FLOAT


@dataclass(frozen=True)
class Name:
    """A parameter, a variable or the counter of a loop."""

    name: str
    type: Type


@dataclass(frozen=True)
class Field:
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


@dataclass(frozen=True)
class Minus:
    """The number with its sign turned."""

    of: Expression
    type: Type = FLOAT


@dataclass(frozen=True)
class Binary:
    """A sum, difference, product or quotient: one rounding; bits of two counts."""

    operator: Operator
    left: Expression
    right: Expression
    type: Type = FLOAT


@dataclass(frozen=True)
class Compare:
    """A comparison of two numbers."""

    operator: Comparison
    left: Expression
    right: Expression
    type: Type = BOOL


@dataclass(frozen=True)
class Logic:
    """Truths joined by and, or by or."""

    operator: Junction
    of: tuple[Expression, ...]
    type: Type = BOOL


@dataclass(frozen=True)
class Not:
    """The opposite of a truth."""

    of: Expression
    type: Type = BOOL


@dataclass(frozen=True)
class Choice:
    """One of two values of the same type."""

    condition: Expression
    yes: Expression
    no: Expression
    type: Type


@dataclass(frozen=True)
class Builtin:
    """A function that C and the twin both have to the bit; `count` takes a loop's counter."""

    name: Known
    arguments: tuple[Expression, ...]
    type: Type


@dataclass(frozen=True)
class Call:
    """A call of another function of the law."""

    function: Function
    arguments: tuple[Expression, ...]
    type: Type


@dataclass(frozen=True)
class Make:
    """A record of new values, in the order of its fields."""

    type: Record
    values: tuple[Expression, ...]


Expression = (
    Number | Constant | Name | Field | Minus | Binary | Compare | Logic | Not | Choice | Builtin
    | Call | Make
)  # fmt: skip


@dataclass(frozen=True)
class Assign:
    """A variable gets a value."""

    name: str
    value: Expression


@dataclass(frozen=True)
class If:
    """One of two branches."""

    condition: Expression
    yes: tuple[Statement, ...]
    no: tuple[Statement, ...]


@dataclass(frozen=True)
class For:
    """A loop with a constant count, at least once."""

    counter: str
    count: int
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class Return:
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
