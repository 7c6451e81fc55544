"""Compiled laws: dispatched on the type of their parameters, so nothing is closed over.

A kernel calls `law_step(parameters, state, measurement, reference)`; numba picks the law by the
class of `parameters`, and the kernel's code on disk is found again by the same type.

``record._replace(field=value)`` of named tuples, in compiled code.

Numba knows no such method. Before types are inferred, the method stands for its record and a call
of it becomes one of `replaced`, which makes the record anew.
"""

import itertools
from collections.abc import Callable
from dis import get_instructions
from functools import cache
from types import FunctionType
from typing import Any

from numba.core import ir as numba_ir
from numba.core import rewrites, types
from numba.extending import overload

from swimbladder.control.law import Count, Law, field_types, from_numbers, leaf_names, numbers
from swimbladder.errors import InputError
from swimbladder.sim.engine.cache import OVERLOADED, chosen_by_first, inlined

ir: Any = numba_ir
_rewrites: Any = rewrites
_METHOD = "_replace"


def replaced(fields: str, record: Any, *values: Any) -> Any:
    """Return a record with other values of some fields, whose names are joined by commas."""
    return record._replace(**dict(zip(fields.split(","), values, strict=True)))


@overload(replaced, prefer_literal=True, jit_options=OVERLOADED, strict=False)
def _replaced(fields: Any, record: Any, *values: Any) -> Any:  # noqa: ARG001
    if not isinstance(fields, types.StringLiteral):
        return None
    names: list[str] = fields.literal_value.split(",")
    parts = (f"values[{names.index(f)}]" if f in names else f"record.{f}" for f in record.fields)
    space = {"Kind": record.instance_class}
    exec(f"def f(fields, record, *values):\n    return Kind({', '.join(parts)})", space)
    return space["f"]


@_rewrites.register_rewrite("before-inference")
class _Replacing(_rewrites.Rewrite):  # type: ignore[misc]
    """Calls of the method, which may have come through other variables, as calls of `replaced`."""

    methods: set[int] | None = None  # assignments of the method, and of what it returns
    calls: set[int]

    def match(self, func_ir: Any, block: Any, typemap: Any, calltypes: Any) -> bool:  # noqa: ARG002
        if self.methods is None:
            every = [i for b in func_ir.blocks.values() for i in b.find_insts(ir.Assign)]
            known = [i for i in every if isinstance(i.value, ir.Expr)]
            got = [i for i in known if i.value.op == "getattr" and i.value.attr == _METHOD]
            names = {i.target.name for i in got}
            size = 0
            while len(names) > size:
                size = len(names)
                handed = (i for i in every if isinstance(i.value, ir.Var))
                names |= {i.target.name for i in handed if i.value.name in names}
            self.methods = {id(i) for i in got}
            self.calls = {
                id(i) for i in known if i.value.op == "call" and i.value.func.name in names
            }
        self.block = block
        return any(id(i) in self.methods | self.calls for i in block.body)

    def apply(self) -> Any:
        assert self.methods is not None
        block = self.block.copy()
        block.clear()
        for i in self.block.body:
            if id(i) in self.methods:
                block.append(ir.Assign(i.value.value, i.target, i.loc))
            elif id(i) in self.calls:
                call, scope, loc = i.value, i.target.scope, i.loc
                function, fields = scope.redefine("$replaced", loc), scope.redefine("$fields", loc)
                text = ",".join(name for name, _ in call.kws)
                values = [value for _, value in call.kws]
                block.append(ir.Assign(ir.Global("replaced", replaced, loc), function, loc))
                block.append(ir.Assign(ir.Const(text, loc), fields, loc))
                made = ir.Expr.call(function, [fields, call.func, *values], (), loc)
                block.append(ir.Assign(made, i.target, loc))
            else:
                block.append(i)
        return block


_READ: dict[Any, str] = {Count: "int({})", bool: "({} != 0.0)"}  # of a number of a lane
_LAWS: dict[type[Any], Law] = {}


def register(law: Law) -> None:
    """Make a law known to the compiler by the class of its parameters.

    Raises InputError where that class belongs to another law already.
    """
    known = _LAWS.setdefault(law.parameters, law)
    if known.step is not law.step or known.initial is not law.initial:
        raise InputError(
            f"the class {law.parameters.__name__} is that of the parameters of the law "
            f"{known.name!r}, and a compiled law is found by this class",
            field="law",
            value=law.name,
            remedy="Give the law a NamedTuple of its own for its parameters",
        )


def compilable(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a law's function that calls compiled ones where it calls plain functions."""
    if not isinstance(function, FunctionType):
        return function
    names = dict(function.__globals__)
    for name in {i.argval for i in get_instructions(function) if i.opname == "LOAD_GLOBAL"}:
        if isinstance(names.get(name), FunctionType):
            names[name] = _helper(names[name])
    answer = FunctionType(
        function.__code__, names, function.__name__, function.__defaults__, function.__closure__
    )
    answer.__module__ = function.__module__
    return answer


@cache
def _helper(function: FunctionType) -> Any:
    return inlined(compilable(function))


def _of_law(name: str) -> Callable[..., Any]:
    """Return a function of the law that its first argument, the parameters, belongs to."""

    def of_type(form: Any) -> Callable[..., Any]:
        own: Callable[..., Any] = inlined(compilable(getattr(_LAWS[form.instance_class], name)))
        return own

    return chosen_by_first(lambda parameters: getattr(_LAWS[type(parameters)], name), of_type)


law_step, law_initial = _of_law("step"), _of_law("initial")


def extent(like: Any) -> int:
    """Return how many numbers a named tuple holds, those of the named tuples in it included."""
    return len(leaf_names(type(like)))


def gather(like: Any, work: Any, start: int, stride: int) -> Any:
    """Return a named tuple of the class of `like` from work[start], work[start + stride], ..."""
    return from_numbers(type(like), (work[start + n * stride] for n in range(extent(like))))


def scatter_where(due: bool, values: Any, work: Any, start: int, stride: int) -> None:
    """Write a named tuple's numbers to work[start], work[start + stride], ... where `due`."""
    for n, value in enumerate(numbers(values)):
        if due:
            work[start + n * stride] = value


def _function(source: str, **names: Any) -> Any:
    space = dict(names)
    exec(source, space)  # the fields are known to the compiler only as source
    return space["f"]


def _class_of(form: Any) -> Any:
    """Return the class of a named tuple's numba type, None of another."""
    return form.instance_class if isinstance(form, types.NamedTuple | types.NamedUniTuple) else None


def _paths(form: Any, path: str) -> list[str]:
    """Return the source of each number of a named tuple that `path` names."""
    if _class_of(form) is None:
        return [path]
    return [p for n, inner in enumerate(form.types) for p in _paths(inner, f"{path}[{n}]")]


@overload(extent, jit_options=OVERLOADED, strict=False)
def _extent(like: Any) -> Any:
    count = len(_paths(like, ""))
    return lambda like: count  # noqa: ARG005


@overload(gather, jit_options=OVERLOADED, strict=False)
def _gather(like: Any, work: Any, start: Any, stride: Any) -> Any:  # noqa: ARG001
    if _class_of(like) is None:
        return None
    if any(isinstance(field, types.Array) for field in like):  # not of a lane: handed through
        return lambda like, work, start, stride: like  # noqa: ARG005
    kinds: dict[str, Any] = {}
    rows = (f"work[start + {n} * stride]" for n in itertools.count())

    def made(form: Any) -> str:
        kind = _class_of(form)
        if kind is None:
            return next(rows)
        name = f"Kind{len(kinds)}"
        kinds[name] = kind
        written = (_READ.get(t, "{}") for t in field_types(kind).values())
        parts = (how.format(made(of)) for how, of in zip(written, form.types, strict=True))
        return f"{name}({', '.join(parts)})"

    return _function(f"def f(like, work, start, stride):\n    return {made(like)}", **kinds)


@overload(scatter_where, jit_options=OVERLOADED, strict=False)
def _scatter_where(due: Any, values: Any, work: Any, start: Any, stride: Any) -> Any:  # noqa: ARG001
    if _class_of(values) is None:
        return None
    lines = "".join(
        f"    i = start + {n} * stride\n    work[i] = {path} if due else work[i]\n"
        for n, path in enumerate(_paths(values, "values"))
    )
    return _function(f"def f(due, values, work, start, stride):\n{lines}")
