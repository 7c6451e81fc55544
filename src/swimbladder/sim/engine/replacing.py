"""``record._replace(field=value)`` of named tuples, in compiled code.

Numba knows no such method. Before types are inferred, the method stands for its record and a call
of it becomes one of `replaced`, which makes the record anew.
"""

from typing import Any

from numba.core import ir as numba_ir
from numba.core import rewrites, types
from numba.extending import overload

from swimbladder.sim.engine.cache import OVERLOADED

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
