"""Compiled code is kept on disk, under a name that changes with the kernels' source.

Numba's own index does not notice an edit in a function that a cached kernel calls (numba issue
1833), so the folder's name holds a hash of every source file that can be compiled into a kernel.
Where no folder can be written (a zipped or frozen install) the code is compiled anew.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba import types
from numba.core import event
from numba.extending import intrinsic

__all__ = [
    "OPTIONS",
    "allocating",
    "cache_folder",
    "compiled",
    "inlined",
    "is_cached",
    "on_compile",
    "part",
    "shared",
    "wide",
]

# Division as the hardware does it and fused multiply-add: without either no loop is vectorised.
# Nothing but Python calls a kernel, so that none needs a way in for C.
OPTIONS: dict[str, Any] = {
    "error_model": "numpy", "fastmath": {"contract"}, "nogil": True, "no_cfunc_wrapper": True,
    "_nrt": True,
}  # fmt: skip
# Without counting who holds an array, which takes longer than a step of a vehicle: for what makes
# no arrays, its caller holding those that it is given.
_BARE: dict[str, Any] = OPTIONS | {"_nrt": False}
_INLINED: dict[str, Any] = _BARE | {"forceinline": True, "no_cpython_wrapper": True}

_config: Any = numba.config
_PACKAGE = Path(__file__).resolve().parent.parent
_SOURCES = (
    "dynamics.py",
    "seawater/*.py",
    "engine/*.py",
    "control/*.py",
    "closed_loop/*.py",
    "kalman/*.py",
)


@cache
def cache_folder() -> Path:
    """Return the folder of the compiled kernels; SWIMBLADDER_CACHE_DIR overrides its parent."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    try:
        for pattern in _SOURCES:
            for source in sorted(_PACKAGE.glob(pattern)):
                digest.update(source.name.encode() + source.read_bytes())
    except OSError:  # inside an archive: the version has to do
        digest.update(b"no source")
    return _parent() / f"kernels-{digest.hexdigest()[:16]}"


def _parent() -> Path:
    given = os.environ.get("SWIMBLADDER_CACHE_DIR")
    if given:
        return Path(given)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or str(Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "swimbladder"


def compiled(function: Callable[..., Any], *, under: str = "", allocates: bool = True) -> Any:
    """Compile a kernel that Python calls, and keep its code in `cache_folder`, `under` a name.

    Also for what many kernels have in common: a process that compiles one finds it made.
    allocates: whether it makes arrays.
    """
    options = OPTIONS if allocates else _BARE
    before = _config.CACHE_DIR
    try:
        folder = cache_folder() / under
        folder.mkdir(parents=True, exist_ok=True)
        _config.CACHE_DIR = str(folder)
        return numba.njit(cache=True, **options)(function)
    except (OSError, RuntimeError):  # read-only home, zipped package
        return numba.njit(**options)(function)
    finally:
        _config.CACHE_DIR = before


def shared(function: Callable[..., Any]) -> Any:
    """Compile what many kernels have in common, see `compiled`, and what makes no arrays."""
    return compiled(function, allocates=False)


def part(function: Callable[..., Any]) -> Any:
    """Compile a function that kernels call; its code is kept with theirs. It makes no arrays."""
    return numba.njit(**_BARE)(function)


def allocating(function: Callable[..., Any]) -> Any:
    """Compile a function that kernels call, and that makes arrays; its code is kept with theirs."""
    return numba.njit(**OPTIONS)(function)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a function into its callers, always: what a loop over lanes is made of.

    Python cannot call it: there is no way in.
    """
    return numba.njit(**_INLINED)(function)


@intrinsic
def wide(typingctx):  # type: ignore[no-untyped-def]  # noqa: ARG001
    """Let the function that calls this use the widest vectors the processor has.

    Without it LLVM stops at half of them on processors whose clock once sank under wide vectors.
    """

    def code(context, builder, signature, args):  # type: ignore[no-untyped-def]  # noqa: ARG001
        # a plain string attribute: llvmlite's own method knows enumerated ones only
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.none(), code


def is_cached(kernel: str) -> bool:
    """Return whether code of the kernel of that function name has been kept already."""
    return any(cache_folder().rglob(f"*{kernel}-*.nbi"))


@contextmanager
def on_compile(notice: Callable[[], None]) -> Iterator[None]:
    """Call `notice` once, when a kernel has to be compiled because no kept code fits."""

    class Listener(event.Listener):
        told = False

        def on_start(self, event: Any) -> None:  # noqa: ARG002
            if not self.told:
                self.told = True
                notice()

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield
