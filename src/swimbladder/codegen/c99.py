"""A law's tree written as C99 in float32: no heap, no recursion, no double, no libm but sqrtf.

Counts are uint16_t, and helpers keep every sum and difference of them within it.
Each operation is one rounding in the order of the Python source. C may contract ``a * b + c`` into
one rounding where a processor can; the file forbids it and refuses to be compiled where the
arithmetic would not be that of float32.

`FunctionText` writes a function, `ExpressionText` its expressions. What C lacks, arithmetic held to
one rounding and small functions to the bit, stands in ``templates/arithmetic.h``.
"""

import inspect
import math
import re
import textwrap
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from swimbladder.codegen import tree
from swimbladder.control.law import units

_TEXT = files("swimbladder.codegen").joinpath("templates/arithmetic.h").read_text("utf-8")
ARITHMETIC, CALLED, *_BLOCKS = (f"{block.strip()}\n" for block in _TEXT.split("\n\n"))
HELPERS = {block.partition("(")[0].split()[-1]: block for block in _BLOCKS}
"""What a law's file needs to compute as the twin does, and the functions that it may call."""

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
        single = np.float32(value)
        text, x = str(single), float(single)
        neighbours = [float(np.nextafter(single, np.float32(end))) for end in (-np.inf, np.inf)]
    # The fewest digits may stand halfway to a neighbour: not every compiler rounds that to even.
    if any(2.0 * (float(text) - x) == other - x for other in neighbours):
        text = repr(float(f"{x:.9g}"))  # decimals of 9 digits lie closer than floats
    return f"{text}f"


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


_CHOICE, _LOGIC, _COMPARE, _SUM, _PRODUCT, _UNARY, _ATOM = range(7)
_LEVEL = {"+": _SUM, "-": _SUM, "*": _PRODUCT, "/": _PRODUCT}
_ELSEWHERE = {"sqrt": "sqrtf"}  # the others are swb_ and the name
_ON_COUNTS = {"min": "swb_lesser", "max": "swb_greater"}


class LawText(NamedTuple):
    """What all functions of a law share, as C has it."""

    law: str
    functions: dict[tree.Function, str]  # names of those that others call
    fields: dict[str, set[str]]  # those of each record that anything reads
    placed: Collection[tree.Function]  # those that change the state where it stands


@dataclass(eq=False)
class ExpressionText:
    """Expressions of one function: `names` of its variables, which of them are `pointers`.

    keep: writes a record into a variable of its own before the statement, and returns its name.
    """

    own: LawText
    names: dict[str, str]
    pointers: set[str]
    keep: Callable[[str, tree.Record], str]

    def value(self, e: tree.Expression) -> str:
        """Return an expression as a value."""
        return self._text(e)[0]

    def address(self, e: tree.Expression) -> str:
        """Return where a record stands: a pointer's name, or ``&`` and a place."""
        if isinstance(e, tree.Name):
            return self.names[e.name] if e.name in self.pointers else f"&{self.names[e.name]}"
        if isinstance(e, tree.Field) and isinstance(tree.place_of(e)[0], tree.Name):
            return f"&{self.value(e)}"
        assert isinstance(e.type, tree.Record)
        text = self.braces(e) if isinstance(e, tree.Make) else self.value(e)
        return f"&{self.keep(text, e.type)}"

    def braces(self, e: tree.Make) -> str:
        """Return a new record's values as an initialiser."""
        read = self.own.fields[e.type.name]
        pairs = [p for p in zip(e.type.fields, e.values, strict=True) if p[0][0] in read]
        return "{" + ", ".join(f".{c_field(n)} = {self.value(v)}" for (n, _), v in pairs) + "}"

    def _at(self, e: tree.Expression, level: int) -> str:
        """Return an expression, in brackets where it binds less than `level`."""
        text, own = self._text(e)
        return text if own >= level else f"({text})"

    def _sums(self, *of: tree.Expression) -> list[str]:
        return [self._at(e, _SUM) for e in of]

    def _text(self, e: tree.Expression) -> tuple[str, int]:
        """Return (text, how strongly it binds)."""
        if isinstance(e, tree.Number):
            return c_number(e.value, e.type), _ATOM if e.value >= 0.0 else _UNARY
        if isinstance(e, tree.Constant):
            return f"SWB_{e.name}", _ATOM
        if isinstance(e, tree.Name):
            name = self.names[e.name]
            if e.type == tree.INT:
                return f"(float){name}", _UNARY
            return (f"*{name}", _UNARY) if e.name in self.pointers else (name, _ATOM)
        if isinstance(e, tree.Field):
            if isinstance(e.of, tree.Name) and e.of.name in self.pointers:
                return f"{self.names[e.of.name]}->{c_field(e.name)}", _ATOM
            return f"{self._at(e.of, _ATOM)}.{c_field(e.name)}", _ATOM
        if isinstance(e, tree.Minus):
            return f"-{self._at(e.of, _ATOM)}", _UNARY
        if isinstance(e, tree.Binary) and e.type == tree.COUNT:
            bits = f"{self._at(e.left, _ATOM)} {e.operator} {self._at(e.right, _ATOM)}"
            return f"(uint16_t)({bits})", _UNARY
        if isinstance(e, tree.Binary):
            level = _LEVEL[e.operator]
            return f"{self._at(e.left, level)} {e.operator} {self._at(e.right, level + 1)}", level
        if isinstance(e, tree.Compare):
            left, right = self._sums(e.left, e.right)
            return f"{left} {e.operator} {right}", _COMPARE
        if isinstance(e, tree.Logic):
            operator = "&&" if e.operator == "and" else "||"
            return f" {operator} ".join(self._at(o, _COMPARE) for o in e.of), _LOGIC
        if isinstance(e, tree.Not):
            return f"!{self._at(e.of, _ATOM)}", _UNARY
        if isinstance(e, tree.Choice):
            condition, yes, no = self._at(e.condition, _LOGIC), *self._sums(e.yes, e.no)
            return f"{condition} ? {yes} : {no}", _CHOICE
        if isinstance(e, tree.Builtin) and e.name == "float":
            return f"(float){self._at(e.arguments[0], _UNARY)}", _UNARY
        if isinstance(e, tree.Builtin) and e.name == "count":
            (counter,) = e.arguments
            assert isinstance(counter, tree.Name)
            return f"(uint16_t){self.names[counter.name]}", _UNARY
        if isinstance(e, tree.Builtin):
            known = _ON_COUNTS if e.type == tree.COUNT else _ELSEWHERE
            name = known.get(e.name, f"swb_{e.name}")
            return f"{name}({', '.join(map(self.value, e.arguments))})", _ATOM
        if isinstance(e, tree.Call):
            given = [
                self.address(a) if isinstance(a.type, tree.Record) else self.value(a)
                for a in e.arguments
            ]
            return f"{self.own.functions[e.function]}({', '.join(given)})", _ATOM
        return f"({c_record(self.own.law, e.type)}){self.braces(e)}", _ATOM


Path = tuple[str, ...]  # names of fields that lead to a place in the state

_COPIES = 6  # of a function of numbers; calls of it take less than more of them
_ZEROS = 4  # fields; from more than these on memset is shorter


def shortened(words: str) -> str:
    """Return a docstring's sentence as the text of a comment."""
    return words.replace("*/", "* /").replace("``", "").rstrip(".")


class FunctionText:
    """A function being written: names of its variables, declared or not yet, and its lines."""

    def __init__(self, own: LawText, function: tree.Function, home: tree.Home | None) -> None:
        self.law, self.function, self.placed = own.law, function, own.placed
        self.home = {name for name in home or () if name is not None}
        self.body = tree.alive(function.body)
        self.taken: set[str] = set()
        self.names: dict[str, str] = {}
        self.pointers: set[str] = set(self.home)
        self.expressions = ExpressionText(own, self.names, self.pointers, self._keep)
        self.lines: list[str] = []
        self.indent = "    "
        self._counts = tree.assigned(self.body)
        self._ends = "value"

    def helper(self, name: str, calls: int) -> str:
        """Return the text of a function that others of the law call, so many times."""
        given = []
        for python, kind in self.function.parameters:
            c = self._name(python)
            if isinstance(kind, tree.Record):
                self.pointers.add(python)
                constant = "" if python in self.home else "const "
                given.append(f"{constant}{c_type(self.law, kind)} *{c}")
            else:
                given.append(f"{c_type(self.law, kind)} {c}")
        returns = c_type(self.law, self.function.returns)
        if self.home:
            self._ends, returns = "place", "void"
        plain = not any(isinstance(kind, tree.Record) for _, kind in self.function.parameters)
        called = "SWB_CALLED " if plain and calls > _COPIES else ""
        head = f"static {called}{returns} {name}({', '.join(given)})"
        return self._written(head, [self.names[p] for p, _ in self.function.parameters])

    def entry(self, ends: str, head: str) -> str:
        """Return the text of the law's `step`, or of its first state, as `ends` says."""
        self._ends = ends
        given = ("p", "state", "m", "reference") if ends == "step" else ("p", "m", "reference")
        self.taken |= {*given, "next_s" if ends == "step" else "state"}
        for (python, kind), c in zip(self.function.parameters, given, strict=True):
            self.names[python] = c
            if isinstance(kind, tree.Record):
                self.pointers.add(python)
        return self._written(head, given)

    def _name(self, python: str) -> str:
        if python not in self.names:
            self.names[python] = c_local(python, self.taken)
        return self.names[python]

    def _written(self, head: str, parameters: Sequence[str]) -> str:
        given = dict(self.function.parameters)
        for own in self.home - set(given):  # it lives where the state stands
            self.names[own] = next(self.names[n] for n in self.home & set(given))
        known = given.keys() | self.home
        variables = [n for n, _ in self.function.variables if n in self._counts.keys() - known]
        self._block(self.body, variables)
        written = "\n".join(self.lines)
        unused = [f"    (void){c};" for c in parameters if not _mentions(written, c)]
        words = f"/* {shortened(self.function.words)}. */\n" if self.function.words else ""
        lines = [*map(wrapped, head.splitlines()), "{", *unused, *map(wrapped, self.lines), "}", ""]
        return ("" if self._ends in ("step", "initial") else words) + "\n".join(lines)

    def _line(self, text: str) -> None:
        self.lines.append(self.indent + text)

    def _keep(self, value: str, kind: tree.Record) -> str:
        """Write a record into a variable of its own, and return its name."""
        name = c_local("kept", self.taken)
        self._line(f"const {c_type(self.law, kind)} {name} = {value};")
        return name

    def _block(self, statements: tuple[tree.Statement, ...], variables: list[str]) -> None:
        """Write statements; the variables are declared where they first stand, or further in."""
        homes: dict[int, list[str]] = {}  # of variables that live in one branch or loop only
        first: dict[int, list[str]] = {}
        for name in variables:
            where = [n for n, s in enumerate(statements) if name in tree.mentioned(s)]
            inner = len(where) == 1 and tree.inner_home(statements[where[0]], name) is not None
            (homes if inner else first).setdefault(where[0], []).append(name)
        for n, s in enumerate(statements):
            born = first.get(n, [])
            if isinstance(s, tree.Assign):
                self._assign(s, declare=s.name in born)
                continue
            for name in born:
                self._line(f"{self._type_of(name)} {self._name(name)};")
            within = homes.get(n, [])
            if isinstance(s, tree.If):
                self._if(s, within)
            elif isinstance(s, tree.For):
                counter = self._name(s.counter)
                self._line(f"for (int {counter} = 0; {counter} < {s.count}; ++{counter}) {{")
                self._inner(s.body, within)
                self._line("}")
            else:
                self._return(s.value)

    def _type_of(self, name: str) -> str:
        return c_type(self.law, dict(self.function.variables)[name])

    def _inner(self, statements: tuple[tree.Statement, ...], variables: list[str]) -> None:
        self.indent += "    "
        self._block(statements, variables)
        self.indent = self.indent[:-4]

    def _assign(self, s: tree.Assign, *, declare: bool) -> None:
        if s.name in self.home:
            self._change(s.value)
            return
        if isinstance(s.value, tree.Make) and declare:  # an initialiser needs no name of the type
            value = self.expressions.braces(s.value)
        else:
            value = self.expressions.value(s.value)
        name = self._name(s.name)
        if declare:
            constant = "const " if self._counts[s.name] == 1 else ""
            name = f"{constant}{self._type_of(s.name)} {name}"
        self._line(f"{name} = {value};")

    def _change(self, value: tree.Expression) -> None:
        """Change the state where it stands."""
        if isinstance(value, tree.Make):
            self._write_state(value)
        elif not isinstance(value, tree.Name):
            self._line(f"{self.expressions.value(value)};")

    def _if(self, s: tree.If, variables: list[str], word: str = "if") -> None:
        yes = [name for name in variables if tree.inner_home(s, name) is s.yes]
        self._line(f"{word} ({self.expressions.value(s.condition)}) {{")
        self._inner(s.yes, yes)
        no = [name for name in variables if name not in yes]
        if len(s.no) == 1 and self._else_if(s.no[0], no):
            return
        if s.no:
            self._line("} else {")
            self._inner(s.no, no)
        self._line("}")

    def _else_if(self, s: tree.Statement, variables: list[str]) -> bool:
        """Write ``else if`` where the second condition needs nothing that stands before it."""
        if not isinstance(s, tree.If) or None in (tree.inner_home(s, name) for name in variables):
            return False
        before = len(self.lines)
        self.expressions.value(s.condition)
        alone = len(self.lines) == before
        del self.lines[before:]
        if alone:
            self._if(s, variables, "} else if")
        return alone

    def _return(self, value: tree.Expression) -> None:
        if self._ends == "value":
            self._line(f"return {self.expressions.value(value)};")
        elif self._ends in ("place", "initial"):
            write = self._change if self._ends == "place" else self._write_state
            write(value)
            if len(self.indent) > 4:
                self._line("return;")
        elif isinstance(value, tree.Make):
            command = self._scalar("command", value.values[0])
            following = self._scalar("following", value.values[2])
            self._write_state(value.values[1])
            self._line(f"*next_s = {following};")
            self._line(f"return {command};")
        else:  # what another step returned
            whole = self.expressions.address(value)
            at = f"{whole}->" if not whole.startswith("&") else f"{whole[1:]}."
            assert isinstance(value.type, tree.Record)
            names = [name for name, _ in value.type.fields]
            self._line(f"*state = {at}{names[1]};")
            self._line(f"*next_s = {at}{names[2]};")
            self._line(f"return {at}{names[0]};")

    def _scalar(self, name: str, value: tree.Expression) -> str:
        """Return a number that stays what it is while the state is written."""
        text = self.expressions.value(value)
        if isinstance(value, tree.Number | tree.Name):
            return text
        kept = c_local(name, self.taken)
        self._line(f"const {c_type(self.law, value.type)} {kept} = {text};")
        return kept

    def _write_state(self, value: tree.Expression) -> None:
        """Write the new state, every value calculated before the first is written."""
        if not isinstance(value, tree.Make):
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
            if isinstance(e, tree.Call) and e.function in self.placed:
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

    def _new(self, value: tree.Make, path: Path = ()) -> Iterator[tuple[Path, tree.Expression]]:
        """Yield the place in the state of each number that changes, and its value."""
        old = self._old()
        for (name, _), e in zip(value.type.fields, value.values, strict=True):
            root, names = tree.place_of(e)
            if isinstance(e, tree.Make):
                yield from self._new(e, (*path, name))
            elif not (isinstance(root, tree.Name) and root.name in old and names == (*path, name)):
                yield (*path, name), e

    def _reads(self, e: object) -> list[Path]:
        """Return the places in the old state that an expression reads."""
        old = self._old()
        if isinstance(e, tree.Name | tree.Field):
            root, names = tree.place_of(e)
            if isinstance(root, tree.Name):
                return [names] if root.name in old else []
        return [place for part in tree.children(e) for place in self._reads(part)]


def _meet(a: Path, b: Path) -> bool:
    """Return whether two places in a record are the same, or one within the other."""
    return all(x == y for x, y in zip(a, b, strict=False))


def _is_zero(e: tree.Expression) -> bool:
    return isinstance(e, tree.Number) and e.value == 0.0 and math.copysign(1.0, e.value) > 0.0


def _mentions(text: str, name: str) -> bool:
    return re.search(rf"(?<![\w.>]){re.escape(name)}\b", text) is not None


class CSource(NamedTuple):
    """The files of a law: a header and its source, beside ``swb_measurement.h``."""

    header_name: str
    header: str
    source_name: str
    source: str


_LONG = 300  # lines of a law's C, from which on it runs out of an AVR's registers
_TOGETHER = """/* Keeps the bytes of a float together: apart they take 3 kB more of 32. */
#if defined(__AVR__)
#pragma GCC optimize("no-split-wide-types")
#endif
"""


def write_c99(program: tree.Program, *, private: bool = False) -> CSource:
    """Return the C of a law.

    private: its functions are static, in a header for the one file that calls them.
    """
    stem, source = f"swb_{c_law(program.name)}", _source(program, private)
    source_name = f"{stem}_step.h" if private else f"{stem}.c"
    if not private and source.count("\n") > _LONG:
        source = f"{_TOGETHER}\n{source}"
    return CSource(f"{stem}.h", _header(program, private), source_name, source)


def _header(program: tree.Program, private: bool) -> str:
    """Return the text of the header: the law's own records, save what every law sees."""
    guard = f"SWB_{c_law(program.name).upper()}_H"
    own = [record for record in program.own() if record.name != "measurement"]
    kinds = {kind for record in program.own() for _, kind in record.fields}
    seen = ['#include "swb_measurement.h"', ""] if program.measurement not in own else []
    wanted = {tree.BOOL: "#include <stdbool.h>", tree.COUNT: "#include <stdint.h>"}
    standard = [line for kind, line in wanted.items() if kind in kinds]
    initial, step = _prototypes(program)
    writes = "Writes the new state, and to next_s the time to the next call [s]."
    said = _remark(f"{shortened(program.step.words)}. {writes}")
    entries = ["/* The state to begin with. */", f"{initial};\n", said, f"{step};\n"]
    comes = "Written by swimbladder from the law's Python source; all numbers are SI."
    parts = [
        _remark(f"The control law {program.name}: {shortened(program.words)}. {comes}"),
        f"#ifndef {guard}\n#define {guard}\n",
        *seen,
        *([*standard, ""] if standard else []),
        '#ifdef __cplusplus\nextern "C" {\n#endif\n',
        *(_struct(program.name, record) for record in own),
        *([] if private else entries),
        "#ifdef __cplusplus\n}\n#endif\n\n#endif\n",
    ]
    return "\n".join(parts)


def _remark(text: str) -> str:
    """Return a comment of lines that are short enough."""
    return "/* " + "\n * ".join(textwrap.wrap(text, 94)) + " */"


def _prototypes(program: tree.Program) -> tuple[str, str]:
    """Return those of the first state and of the step."""
    law, seen = f"swb_{c_law(program.name)}", c_record(program.name, program.measurement)
    return (
        f"void {law}_initial(const {law}_parameters *p, const {seen} *m,\n"
        f"                  float reference, {law}_state *state)",
        f"float {law}_step(const {law}_parameters *p, {law}_state *state,\n"
        f"               const {seen} *m, float reference, float *next_s)",
    )


def _struct(law: str, record: tree.Record, read: dict[str, set[str]] | None = None) -> str:
    said = remarks(record.kind)
    lines = ["typedef struct {"]
    for name, kind in record.fields:
        if read is not None and name not in read[record.name]:
            continue
        comment = f" /* {said[name]} */" if said.get(name) else ""
        lines.append(f"    {c_type(law, kind)} {c_field(name)};{comment}")
    return "\n".join([*lines, f"}} {c_record(law, record)};", ""])


def _source(program: tree.Program, private: bool) -> str:
    law = c_law(program.name)
    types = {c_record(program.name, r) for r in program.records}
    names = {f: _helper(f"swb_{law}_{f.name}", types) for f in program.helpers}
    fields, placed = tree.fields_read(program), tree.in_place(program)
    shared, calls = LawText(program.name, names, fields, placed), tree.calls_of(program)
    helpers: dict[str, str] = {}
    for f in program.helpers:
        home = tree.home_of(f, f.returns, placed) if f in placed else None
        helpers[names[f]] = FunctionText(shared, f, home).helper(names[f], calls[f])
    home = tree.home_of(program.step, program.state, placed)
    linkage = "static " if private else ""
    initial, step = _prototypes(program)
    entries = [
        FunctionText(shared, program.initial, None).entry("initial", f"{linkage}{initial}"),
        FunctionText(shared, program.step, home).entry("step", f"{linkage}{step}"),
    ]
    used = _used("\n".join(entries), helpers)
    functions = "\n".join([*(helpers[n] for n in helpers if n in used), *entries])
    own = {record.name for record in program.own()}
    structs = [
        _struct(program.name, r, fields)
        for r in program.records
        if r.name not in own and re.search(rf"\b{c_record(program.name, r)}\b", functions)
    ]
    constants = [
        f"static const float SWB_{c.name} = {c_float(c.value)};\n"
        for c in program.constants
        if re.search(rf"\bSWB_{c.name}\b", functions)
    ]
    wanted = _used(functions, HELPERS)
    arithmetic = [HELPERS[n] for n in HELPERS if n in wanted]
    text = "\n".join([*structs, *arithmetic, functions])
    includes = {
        "math.h": re.search(r"\b(sqrtf|INFINITY|NAN)\b", text + "".join(constants)),
        "stdbool.h": re.search(r"\bbool\b", text),
        "stdint.h": re.search(r"\buint(16|32)_t\b", text),
        "string.h": re.search(r"\bmem(cpy|set)\b", text),
    }
    parts = [
        f"/* The control law {program.name}, translated from its Python source by swimbladder.",
        " * float32 throughout: the float32 twin of the law gives the same bits. */",
        f'#include "swb_{law}.h"\n',
    ]
    listed = [f"#include <{name}>" for name, found in includes.items() if found]
    parts += [*listed, ""] if listed else []
    parts += [ARITHMETIC, *([CALLED] if "SWB_CALLED" in text else [])]
    parts += ["".join(constants)] if constants else []
    if private:
        guard = f"SWB_{law.upper()}_STEP_H"
        parts, text = [f"#ifndef {guard}", f"#define {guard}", "", *parts], f"{text}\n#endif\n"
    return "\n".join([*parts, text])


def _helper(name: str, types: set[str]) -> str:
    """Return the name of a helper that is neither a type's nor that of the law's own functions."""
    taken = name in types or name.rsplit("_", 1)[-1] in ("step", "initial")
    return f"{name}_value" if taken else name


def _used(text: str, helpers: dict[str, str]) -> set[str]:
    """Return the helpers that a text calls, and those that they call."""
    found: set[str] = set()
    while True:
        texts = [text, *(helpers[name] for name in found)]
        now = {name for name in helpers if any(f"{name}(" in one for one in texts)}
        if now == found:
            return found
        found = now
