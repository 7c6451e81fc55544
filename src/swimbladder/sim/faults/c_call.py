"""Call a C function by its address from compiled Python.

A library that is compiled anew for every vehicle has no address at the time the kernel is compiled,
so the address is an argument, and the kernel's code on disk serves every library.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic

_BYTES = ir.IntType(8).as_pointer()


@intrinsic
def call_begin(typingctx, address, memory, after_reset):  # type: ignore[no-untyped-def]  # noqa: ARG001
    """Call ``void begin(void *memory, int after_reset)`` at an address."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        kind = ir.FunctionType(ir.VoidType(), [_BYTES, ir.IntType(32)])
        function = builder.inttoptr(args[0], kind.as_pointer())
        builder.call(function, [builder.inttoptr(args[1], _BYTES), args[2]])
        return context.get_dummy_value()

    return types.none(types.intp, types.intp, types.int32), code


@intrinsic
def call_tick(typingctx, address, memory, seen, said):  # type: ignore[no-untyped-def]  # noqa: ARG001
    """Call ``float tick(void *memory, const float *seen, float *said)`` at an address."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        kind = ir.FunctionType(ir.FloatType(), [_BYTES] * 3)
        function = builder.inttoptr(args[0], kind.as_pointer())
        return builder.call(function, [builder.inttoptr(arg, _BYTES) for arg in args[1:]])

    return types.float32(types.intp, types.intp, types.intp, types.intp), code
