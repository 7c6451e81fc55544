"""What flows where in a law's functions, and its names, numbers and types as C99 has them.

Which variables and fields are read and where they live follows from what statements assign, hold
and end with; so does which functions change the state where it stands and return no copy of it.
"""

import ast
import dataclasses
import inspect
import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from swimbladder.codegen import tree
from swimbladder.control.records import units


def stores(of: ast.AST) -> Counter[str]:
    """Return how often each name is assigned to."""
    names = (node for node in ast.walk(of) if isinstance(node, ast.Name))
    return Counter(name.id for name in names if isinstance(name.ctx, ast.Store))


def always_returns(statements: Sequence[tree.Statement]) -> bool:
    """Say whether every way through the statements ends in a return."""
    last = statements[-1] if statements else None
    if isinstance(last, tree.If):
        return always_returns(last.yes) and always_returns(last.no)
    return isinstance(last, tree.Return)


def children(node: object) -> Iterator[object]:
    """Yield the statements and expressions next within one, or within several."""
    inner = node if isinstance(node, tuple) else [v for k, v in vars(node).items() if k != "type"]
    for part in inner:
        if isinstance(part, tuple):
            yield from children(part)
        elif dataclasses.is_dataclass(part) and not isinstance(part, tree.Function):
            yield part


def parts(node: object) -> Iterator[object]:
    """Yield a statement or expression, or several, and all within, but no function called."""
    if not isinstance(node, tuple):
        yield node
    for part in children(node):
        yield from parts(part)


def names_read(node: object) -> set[str]:
    """Return the variables that statements or expressions read."""
    return {part.name for part in parts(node) if isinstance(part, tree.Name)}


def calls_of(program: tree.Program) -> Counter[tree.Function]:
    """Return at how many places each function of a law is called."""
    functions = {*program.helpers, program.step, program.initial}
    return Counter(called for f in functions for called in _called(alive(f.body)))


def assigned(node: object) -> Counter[str]:
    """Return how often each variable is assigned."""
    return Counter(part.name for part in parts(node) if isinstance(part, tree.Assign))


def mentioned(node: object) -> set[str]:
    """Return the variables that are read or assigned."""
    return names_read(node) | set(assigned(node))


def inner_home(statement: tree.Statement, name: str) -> tuple[tree.Statement, ...] | None:
    """Return the one branch or loop of a statement that mentions a variable; None: not just one."""
    if isinstance(statement, tree.For):
        return statement.body
    if not isinstance(statement, tree.If) or name in names_read(statement.condition):
        return None
    branches = [b for b in (statement.yes, statement.no) if name in mentioned(b)]
    return branches[0] if len(branches) == 1 else None


def alive(body: tuple[tree.Statement, ...]) -> tuple[tree.Statement, ...]:
    """Return the statements without variables that nothing reads: they have no other effect."""
    while True:
        kept = _without(body, names_read(body))
        if kept == body:
            return body
        body = kept


def _without(body: tuple[tree.Statement, ...], read: set[str]) -> tuple[tree.Statement, ...]:
    kept: list[tree.Statement] = []
    for s in body:
        one: tree.Statement = s
        if isinstance(s, tree.Assign) and s.name not in read:
            continue
        if isinstance(s, tree.If):
            one = tree.If(s.condition, _without(s.yes, read), _without(s.no, read))
            if not one.yes and not one.no:
                continue
        elif isinstance(s, tree.For):
            one = tree.For(s.counter, s.count, _without(s.body, read))
            if not one.body:
                continue
        kept.append(one)
    return tuple(kept)


def fields_read(program: tree.Program) -> dict[str, set[str]]:
    """Return the fields of each record that are needed: all of the law's own, else those read."""
    read: dict[str, set[str]] = {record.name: set() for record in program.records}
    for function in (*program.helpers, program.step, program.initial):
        for part in parts(alive(function.body)):
            if isinstance(part, tree.Field):
                read[part.of.type.name].add(part.name)
    own = {record.name for record in program.own()}
    for record in program.records:
        if record.name in own or record.kind is None or not read[record.name]:
            read[record.name] = {name for name, _ in record.fields}
    return read


# Words of C and C++, and macros of <math.h>, <stdbool.h> and Arduino that a field might meet.
_WORDS = """
    alignas alignof and asm auto bitand bitor bool break case catch char class compl const
    constexpr const_cast continue decltype default delete do double dynamic_cast else enum explicit
    export extern false final float for friend goto if inline int long mutable namespace new
    noexcept not nullptr operator or override private protected public register reinterpret_cast
    restrict return short signed sizeof static static_assert static_cast struct switch template this
    throw true try typedef typeid typename union unsigned using virtual void volatile wchar_t while
    xor NULL NAN INFINITY HUGE_VAL isfinite isnan isinf signbit fpclassify M_PI PI HALF_PI TWO_PI
    EULER HIGH LOW INPUT OUTPUT DEFAULT EXTERNAL INTERNAL CHANGE FALLING RISING DEC HEX OCT BIN F
    SERIAL DISPLAY SP SREG B0 B1 B00 B01 B10 B11 abs min max round radians degrees sq bit byte
    boolean word interrupts constrain yield
"""
_TAKEN = frozenset(_WORDS.split())
_FIELD = re.compile(r"^\s+(\w+)\s*:[^#\n]*#\s*(.+?)\s*$", re.MULTILINE)


def c_law(name: str) -> str:
    """Return a law's name as a part of a C name: ``position-pid`` -> ``position_pid``."""
    return re.sub(r"\W", "_", name)


def c_field(name: str) -> str:
    """Return a field's name; one that C, C++ or Arduino takes gets an underscore."""
    return f"{name}_" if name in _TAKEN else name


def c_local(name: str, taken: set[str]) -> str:
    """Return a variable's name that is not `taken` yet, and take it."""
    plain = name.strip("_") or "unused"
    while plain in taken or plain in _TAKEN or plain.lower().startswith("swb"):
        plain += "_"
    taken.add(plain)
    return plain


def c_record(law: str, record: tree.Record) -> str:
    """Return the type of a record: ``swb_measurement``, ``swb_cascade_state``."""
    if record.name == "measurement":
        return "swb_measurement"
    return f"swb_{c_law(law)}_{record.name}"


def c_type(law: str, kind: tree.Type) -> str:
    """Return a type."""
    if isinstance(kind, tree.Record):
        return c_record(law, kind)
    return "uint16_t" if kind == tree.COUNT else kind.name


def c_number(value: float, kind: tree.Type) -> str:
    """Return the literal of a number, a count or a truth."""
    if kind == tree.COUNT:
        return f"{int(value)}u"
    if kind == tree.BOOL:
        return "true" if value else "false"
    return c_float(value)


def c_float(value: float) -> str:
    """Return a literal that the compiler reads as exactly the float32 nearest to `value`."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    with np.errstate(all="ignore"):
        return f"{np.float32(value)!s}f"


def remarks(kind: type | None) -> dict[str, str]:
    """Return the unit of each field of a NamedTuple, and what stands beside it in the source."""
    try:
        text = inspect.getsource(kind) if kind is not None else ""
    except (OSError, TypeError):
        text = ""
    known = {name: unit or "-" for name, unit in units(kind).items()} if kind is not None else {}
    for name, said in _FIELD.findall(text):
        unit = known.get(name, "")
        known[name] = said if said.startswith(unit) else f"{unit}, {said}"
    return {name: said.replace("*/", "* /") for name, said in known.items()}


def wrapped(line: str, width: int = 100) -> str:
    """Return a line of C, broken after commas and before operators where it is too long."""
    indent = line[: len(line) - len(line.lstrip())] + "    "
    done = []
    while len(line) > width:
        at = _break(line, len(indent), width)
        if at <= len(indent):
            break
        done.append(line[:at].rstrip())
        line = indent + line[at:].lstrip()
    return "\n".join([*done, line])


def _break(line: str, start: int, end: int) -> int:
    """Return where to break a line, preferring the later of the weaker bonds; 0: nowhere."""
    for marks in ((", ", " && ", " || "), (" ? ", " : ", " + ", " - "), (" * ", " / ")):
        found = [(line.rfind(mark, start, end - 1), mark) for mark in marks]
        at, mark = max(found)
        if at > start:
            return at + 1 if mark == ", " else at
    return line.find(", ", end) + 1


Home = tuple[str, str | None]  # the parameter that is the state, and the variable that lives there


def in_place(program: tree.Program) -> frozenset[tree.Function]:
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


def home_of(
    function: tree.Function, state: tree.Type, placed: Collection[tree.Function]
) -> Home | None:
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
    if not (isinstance(begin, tree.Assign) and begin.name == own and own not in names_read(begin)):
        return None
    if given in mentioned(body[first + 1 :]):
        return None
    return (given, own) if _ends_well(body, {given, own}, placed) else None


def _given(function: tree.Function, state: tree.Type) -> str | None:
    """Return the one parameter that is a state."""
    found = [name for name, kind in function.parameters if kind == state]
    return found[0] if len(found) == 1 else None


def _ends_well(
    body: tuple[tree.Statement, ...], names: set[str], placed: Collection[tree.Function]
) -> bool:
    """Return whether every new state takes the place of the old one."""
    expected = 0
    for s in parts(body):
        new: tree.Expression | None = None
        if isinstance(s, tree.Assign) and s.name in names:
            new = s.value
        elif isinstance(s, tree.Return):
            new = s.value
            if isinstance(new, tree.Make) and new.type.kind is None:  # of a step
                new = new.values[1]
        if new is None:
            continue
        if isinstance(new, tree.Call) and new.function in placed and isinstance(s, tree.Assign):
            expected += _in_its_place(new, names, ())
        elif isinstance(new, tree.Make):
            expected += _only_change(new, names, placed)
        elif not (isinstance(new, tree.Name) and new.name in names):
            return False
    return expected == sum(f in placed for f in _called(body))


def _only_change(
    new: tree.Make, names: set[str], placed: Collection[tree.Function], path: tuple[str, ...] = ()
) -> bool:
    """Return whether all that is new is what one function makes of a record in its place."""
    changed = []
    for (name, _), e in zip(new.type.fields, new.values, strict=True):
        root, at = tree.place_of(e)
        if not (isinstance(root, tree.Name) and root.name in names and at == (*path, name)):
            changed.append((name, e))
    if len(changed) != 1:
        return False
    ((name, e),) = changed
    if isinstance(e, tree.Make):
        return _only_change(e, names, placed, (*path, name))
    if not (isinstance(e, tree.Call) and e.function in placed):
        return False
    return _in_its_place(e, names, (*path, name))


def _in_its_place(call: tree.Call, names: set[str], path: tuple[str, ...]) -> bool:
    """Return whether a call is given the record at a place of the state, and nothing around it."""
    here = 0
    for argument in call.arguments:
        root, place = tree.place_of(argument)
        if (
            isinstance(argument.type, tree.Record)
            and isinstance(root, tree.Name)
            and root.name in names
        ):
            if place != path and all(a == b for a, b in zip(place, path, strict=False)):
                return False
            here += place == path
    return here == 1


def _called(body: tuple[tree.Statement, ...]) -> list[tree.Function]:
    return [part.function for part in parts(body) if isinstance(part, tree.Call)]
