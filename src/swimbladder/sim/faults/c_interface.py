"""The vehicle's C, compiled for this machine, and called by its address from compiled Python.

Needs gcc or clang: the code that is tested is the one that the board gets, not a translation of it.
A library that is compiled anew for every vehicle has no address at the time the kernel is compiled,
so the address is an argument, and the kernel's code on disk serves every library. Between a mission
and the generated code stand the same two calls for each controller.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from swimbladder.codegen.c_places import c_float
from swimbladder.errors import InputError
from swimbladder.io.files import temporary_folder

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


_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC")


def compiler() -> str:
    """Return the path of a C compiler: that of CC, or cc, gcc, clang.

    Raises InputError where there is none.
    """
    asked = os.environ.get("CC", "").split()
    names = asked[:1] or ["cc", "gcc", "clang"]
    for name in names:
        found = shutil.which(name)
        if found:
            return found
    raise InputError(
        "the controller's C has to be compiled on this machine, and there is no C compiler",
        field="CC" if asked else None, value=asked[0] if asked else None,
        remedy="Install gcc or clang (Debian: apt install gcc; macOS: xcode-select --install; "
        "Windows: MSYS2), or name one with the environment variable CC",
    )  # fmt: skip


class Board:
    """C sources compiled into a library that is loaded; a context that takes it away again.

    files: text by name, those that end with ``.c`` compiled. The glue among them defines
    ``int NAME_size(void)``, ``void NAME_begin(void *memory, int after_reset)`` and
    ``float NAME_tick(void *memory, const float *seen, float *said)`` for each of `names`.
    """

    def __init__(self, files: Mapping[str, str], names: tuple[str, ...]) -> None:
        cc = compiler()
        self._folder = temporary_folder(Path(tempfile.gettempdir()))
        try:
            for name, text in files.items():
                (self._folder / name).write_text(text, encoding="utf-8")
            sources = [str(self._folder / name) for name in files if name.endswith(".c")]
            made = self._folder / ("board.dll" if os.name == "nt" else "board.so")
            done = subprocess.run(
                [cc, *_FLAGS, *sources, "-o", str(made), "-lm"], capture_output=True, text=True,
                check=False,
            )  # fmt: skip
            if done.returncode != 0:
                said = " ".join((done.stderr or done.stdout or "no message").split())
                raise InputError(
                    f"{Path(cc).name} did not compile the controller's C: {said[:300]}",
                    remedy="Name another C compiler with the environment variable CC",
                )
            self._library = ctypes.CDLL(str(made))
        except BaseException:
            self.__exit__(None, None, None)
            raise
        self.addresses = {name: (self._at(f"{name}_begin"), self._at(f"{name}_tick"))
                          for name in names}  # fmt: skip
        # bytes that it remembers
        self.size = max(int(self._library[f"{name}_size"]()) for name in names)

    def _at(self, name: str) -> int:
        address = ctypes.cast(self._library[name], ctypes.c_void_p).value
        assert address is not None
        return address

    def __enter__(self) -> Board:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        where: TracebackType | None,
    ) -> None:  # fmt: skip
        """Delete the files; the loaded library stays in memory where the system lets it."""
        shutil.rmtree(self._folder, ignore_errors=True)


UNSUPERVISED, SUPERVISED, IDEAL = "unsupervised", "supervised", "ideal"


_BOARD = """
int {name}_size(void)
{{
    return (int)sizeof({kind});
}}

void {name}_begin(void *memory, int after_reset)
{{
    {begin};
}}

float {name}_tick(void *memory, const float *seen, float *said)
{{
    {kind} *v = memory;
{tick}
    said[3] = {wide};
    return command;
}}
"""
_ALONE = """\
    said[0] = said[1] = 0.0f;
    said[2] = v->waiting == 0u ? 1.0f : 0.0f;
    const float command = swb_controller_tick(v, seen[0], seen[2], seen[6]);"""
_SEEN = """\
    const swb_seen s = {.depth = seen[0], .depth_age = seen[1], .volume = seen[2],
        .battery = seen[3], .leak = seen[4] > 0.5f, .lost_ticks = (uint32_t)seen[5]};
"""
_WATCHED = """\
    const bool due = v->controller.waiting == 0u;
    const uint32_t ticks = v->controller.ticks;
    const float command = swb_vehicle_tick(v, &s, seen[6]);
    said[0] = (float)v->reason;
    said[1] = v->release ? 1.0f : 0.0f;
    said[2] = due && v->controller.ticks != ticks ? 1.0f : 0.0f;"""
_IGNORED = """\
    said[0] = said[1] = 0.0f;
    said[2] = v->controller.waiting == 0u ? 1.0f : 0.0f;
    const float wanted = swb_controller_tick(&v->controller, seen[0], seen[2], seen[6]);
    const float watched = swb_vehicle_watch(v, &s, wanted, v->controller.missed);
    const float command = v->reason != 0u ? wanted : watched;"""


def c_interface(first: float, *, floats: bool) -> str:
    """Return the C; first: the controller's command until there is one.

    seen: depth, its age, volume, battery, leak, lost ticks, depth asked for. said: the reason of
    the supervisor, whether a weight is to be released, whether the law was called, and of floats
    whether a command below 0 is for the bypass. That of
    ideal detection is supervised until there is a reason, which it ignores: its law goes on.
    """
    alone = f"(void)after_reset;\n    swb_controller_begin(memory, {c_float(first)})"
    begin = "swb_vehicle_begin(memory, after_reset != 0)"
    boards = (
        (UNSUPERVISED, "swb_controller", alone, _ALONE, "v->state"),
        (SUPERVISED, "swb_vehicle", begin, _SEEN + _WATCHED, "v->controller.state"),
        (IDEAL, "swb_vehicle", begin, _SEEN + _IGNORED, "v->controller.state"),
    )
    return '#include "swb_vehicle.h"\n' + "".join(
        _BOARD.format(
            name=name, kind=kind, begin=begins, tick=tick,
            wide=f"{state}.drive.wide" if floats else "0.0f",
        )
        for name, kind, begins, tick, state in boards
    )  # fmt: skip
