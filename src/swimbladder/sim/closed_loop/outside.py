"""Laws that are not of this package: their kernels are kept under a name made of their code.

Numba finds kept code by the types of the arguments. That a user has edited the law which the
parameters' type stands for, or another script has a law of the same names, it does not notice.
"""

import hashlib
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from swimbladder.control.law import Law
from swimbladder.io.files import source_hash
from swimbladder.sim.closed_loop.dispatch import register
from swimbladder.sim.closed_loop.lanes import run_block
from swimbladder.sim.engine.cache import compiled
from swimbladder.sim.engine.rodas import NAME

_OWN = ("swimbladder.control.", "swimbladder.sim.closed_loop.")  # of `engine.cache`'s sources
_PACKED = "swimbladder.sim."  # in its packages there are laws and hooks that change together
_PLAIN = (bool, int, float, complex, str, bytes, type(None))


def kernel_of(law: Law, *, pumped: bool = False, hooks: Any = ()) -> Callable[..., Any]:
    """Return the compiled `run_block` for a law; one of its own for a law from outside.

    pumped: the one whose lanes `engine.rodas` moves, kept under the name of that source; hooks:
    likewise under that of theirs.
    """
    register(law)
    modules = {law.step.__module__, law.initial.__module__}
    packed = {m for m in modules if m.startswith(_PACKED) and not m.startswith(_OWN)}
    name = "" if _is_own(law) or packed == modules else fingerprint(*_parts(law))
    if hooks:
        packed.add(type(hooks).__module__)
    names = sorted({_package(module.rpartition(".")[0]) for module in packed})
    name += "".join(names) + (NAME if pumped or hooks else "")
    return _kernel(name) if name else run_block


def source_of(law: Law) -> str:
    """Return a name for the source of a law from outside and of how it is tuned; empty for others.

    What was computed with a law is kept under it: `jobs.software` is of this package alone.
    """
    if _is_own(law):
        return ""
    made = () if law.recipe is None else (law.recipe.gains,)
    return fingerprint(*_parts(law), *made)


def _parts(law: Law) -> tuple[Callable[..., Any], ...]:
    return law.step, law.initial, law.parameters, law.state


def _is_own(law: Law) -> bool:
    """Whether the types of a law are there when a process begins, so that its kernel is kept.

    A type that another process cannot import makes all of its index of kept code unreadable.
    """
    return law.within is None and all(part.__module__.startswith(_OWN) for part in _parts(law))


@cache
def _package(name: str) -> str:
    """Return a name for the source of all modules of a package, and for its tables."""
    return source_hash(Path(str(sys.modules[name].__file__)).parent.glob("*.*"))


@cache
def _kernel(name: str) -> Callable[..., Any]:
    return compiled(run_block.py_func, under=f"law-{name}")  # type: ignore[no-any-return]


def fingerprint(*parts: Callable[..., Any]) -> str:
    """Return a name for the code of functions and all that it refers to, and for named tuples.

    What its value cannot identify makes a name that never comes again.
    """
    digest = hashlib.sha256()
    seen: set[int] = set()
    for part in parts:
        _feed(digest, part, seen)
    return digest.hexdigest()[:16]


def _feed(digest: Any, value: Any, seen: set[int]) -> None:
    value = getattr(value, "py_func", value)  # what numba made of a function
    digest.update(type(value).__name__.encode())
    if isinstance(value, _PLAIN):
        digest.update(repr(value).encode())
    elif isinstance(value, tuple | list):
        for item in value:
            _feed(digest, item, seen)
    elif isinstance(value, np.ndarray | np.generic):
        digest.update(repr(value.dtype).encode() + value.tobytes())
    elif isinstance(value, type) and hasattr(value, "_fields"):
        digest.update(f"{value.__qualname__}{value._fields}".encode())
    elif isinstance(value, ModuleType):
        source = getattr(value, "__file__", None)
        digest.update(Path(source).read_bytes() if source else value.__name__.encode())
    elif isinstance(value, FunctionType):
        if id(value) not in seen:
            seen.add(id(value))
            _feed_function(digest, value, seen)
    elif not (
        callable(value) and getattr(value, "__module__", "") in ("builtins", "math", "numpy")
    ):
        digest.update(os.urandom(16))
    else:
        digest.update(value.__name__.encode())


def _feed_function(digest: Any, function: FunctionType, seen: set[int]) -> None:
    names = _feed_code(digest, function.__code__)
    for name in sorted(names & function.__globals__.keys()):
        digest.update(name.encode())
        _feed(digest, function.__globals__[name], seen)
    _feed(digest, function.__defaults__, seen)
    for cell in function.__closure__ or ():
        _feed(digest, cell.cell_contents, seen)


def _feed_code(digest: Any, code: CodeType) -> set[str]:
    """Feed code and the code nested in it; return the names it refers to."""
    digest.update(code.co_code)
    names = set(code.co_names)
    digest.update(repr((code.co_names, code.co_varnames, code.co_freevars)).encode())
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            names |= _feed_code(digest, constant)
        else:
            digest.update(repr(constant).encode())
    return names
