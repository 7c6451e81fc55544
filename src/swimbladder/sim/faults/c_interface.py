"""The vehicle's C, compiled for this machine, and called by its address from compiled Python.

Needs gcc or clang: the code that is tested is the one that the board gets, not a translation of it.
A library that is compiled anew for every vehicle has no address at the time the kernel is compiled,
so the address is an argument, and the kernel's code on disk serves every library. Between a mission
and the generated code stand the same two calls for each controller.
"""

import contextlib
import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from swimbladder.codegen.library import render
from swimbladder.errors import InputError
from swimbladder.io.files import temporary_folder

_BYTES = ir.IntType(8).as_pointer()


@intrinsic
def call_begin(typingctx: Any, address: Any, memory: Any, after_reset: Any) -> Any:  # noqa: ARG001
    """Call ``void begin(void *memory, int after_reset)`` at an address."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        """Emit the call through a pointer made of the address."""
        kind = ir.FunctionType(ir.VoidType(), [_BYTES, ir.IntType(32)])
        function = builder.inttoptr(args[0], kind.as_pointer())
        builder.call(function, [builder.inttoptr(args[1], _BYTES), args[2]])
        return context.get_dummy_value()

    return types.none(types.intp, types.intp, types.int32), code


@intrinsic
def call_tick(typingctx: Any, address: Any, memory: Any, seen: Any, said: Any) -> Any:  # noqa: ARG001
    """Call ``float tick(void *memory, const float *seen, float *said)`` at an address."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        kind = ir.FunctionType(ir.FloatType(), [_BYTES] * 3)
        function = builder.inttoptr(args[0], kind.as_pointer())
        return builder.call(function, [builder.inttoptr(arg, _BYTES) for arg in args[1:]])

    return types.float32(types.intp, types.intp, types.intp, types.intp), code


_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC")


def compiler() -> str:
    """Return the path of a C compiler: that of CC, or cc, gcc, clang.

    Raises InputError where there is none.
    """
    asked = os.environ.get("CC", "").split()
    names = asked[:1] or ["cc", "gcc", "clang"]
    if found := next(filter(None, map(shutil.which, names)), None):
        return found
    what = "the controller's C has to be compiled on this machine, and there is no C compiler"
    remedy = (
        "Install gcc or clang (Debian: apt install gcc; macOS: xcode-select --install; Windows: "
        "MSYS2), or name one with the environment variable CC"
    )
    field, value = ("CC", asked[0]) if asked else (None, None)
    raise InputError(what, field=field, value=value, remedy=remedy)


class Board(contextlib.ExitStack):
    """C sources compiled into a library that is loaded; a context that deletes its files again.

    The loaded library stays in memory where the system lets it.

    files: text by name, those that end with ``.c`` compiled. The glue among them defines
    ``int NAME_size(void)``, ``void NAME_begin(void *memory, int after_reset)`` and
    ``float NAME_tick(void *memory, const float *seen, float *said)`` for each of `names`.
    """

    def __init__(self, files: Mapping[str, str], names: tuple[str, ...]) -> None:
        super().__init__()
        cc = compiler()
        with contextlib.ExitStack() as until_loaded:
            folder = temporary_folder(Path(tempfile.gettempdir()))
            until_loaded.callback(shutil.rmtree, folder, ignore_errors=True)
            for name, text in files.items():
                (folder / name).write_text(text, encoding="utf-8")
            sources = [str(folder / name) for name in files if name.endswith(".c")]
            made = folder / ("board.dll" if os.name == "nt" else "board.so")
            command = [cc, *_FLAGS, *sources, "-o", str(made), "-lm"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                said = " ".join((done.stderr or done.stdout or "no message").split())
                what = f"{Path(cc).name} did not compile the controller's C: {said[:300]}"
                remedy = "Name another C compiler with the environment variable CC"
                raise InputError(what, remedy=remedy)
            self._library = ctypes.CDLL(str(made))
            self.push(until_loaded.pop_all())
        self.addresses = {
            name: (self._at(f"{name}_begin"), self._at(f"{name}_tick")) for name in names
        }
        # bytes that it remembers
        self.size = max(int(self._library[f"{name}_size"]()) for name in names)

    def _at(self, name: str) -> int:
        address = ctypes.cast(self._library[name], ctypes.c_void_p).value
        assert address is not None
        return address


UNSUPERVISED, SUPERVISED, IDEAL = "unsupervised", "supervised", "ideal"


def c_interface(first: float, *, floats: bool) -> str:
    """Return the C; first: the controller's command until there is one.

    seen: depth, its age, volume, battery, leak, lost ticks, depth asked for, and 1 for a law that
    wants to wait for ever, which is no command. said: the reason of the supervisor, whether a
    weight is to be released, whether the law was called, and of floats whether a command below 0 is
    for the bypass. That of ideal detection is supervised until there is a reason, which it ignores:
    its law goes on.
    """
    return render("c_interface.c.j2", {"first": first, "floats": floats})
