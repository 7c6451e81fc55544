"""Compiled code is kept on disk, under a name that changes with the kernels' source.

Numba's own index does not notice an edit in a function that a cached kernel calls (numba issue
1833), so the folder's name holds a hash of every source file that can be compiled into a kernel.
Where no folder can be written (a zipped or frozen install) the code is compiled anew, and so it is
where a kept file was cut off or altered: the hash at its end no longer fits.
"""

import gc
import hashlib
import io
import logging
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
from llvmlite.binding import parse_assembly
from numba import types
from numba.core import caching, codegen, compiler, event, registry
from numba.extending import intrinsic, overload

from swimbladder.io.files import source_hash

# Division as the hardware does it and fused multiply-add: without either no loop is vectorised.
# Nothing but Python calls a kernel, so that none needs a way in for C.
OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract"},
    "nogil": True,
    "no_cfunc_wrapper": True,
    "_nrt": True,
}
# Without counting who holds an array, which takes longer than a step of a vehicle: for what makes
# no arrays, its caller holding those that it is given.
_BARE: dict[str, Any] = OPTIONS | {"_nrt": False}
_INLINED: dict[str, Any] = _BARE | {"forceinline": True}

_config: Any = numba.config
_PACKAGE = Path(__file__).resolve().parents[2]
_DAY = 86400.0  # s
_KEPT_DAYS = 30  # that code of other sources is kept after its last use
_ROOM = 1 << 17  # places in a frame of 1 MB
_log = logging.getLogger(__name__)
_SOURCES = (
    "physics/dynamics.py",
    "physics/seawater/*.py",
    "sim/engine/*.py",
    "control/*.py",
    "sim/closed_loop/*.py",
    "estimation/kalman.py",
    "design/linear/models.py",
)


@cache
def cache_folder() -> Path:
    """Return the folder of the compiled kernels; SWIMBLADDER_CACHE_DIR overrides its parent."""
    sources = source_hash(path for pattern in _SOURCES for path in _PACKAGE.glob(pattern))
    versions = hashlib.sha256(f"{numba.__version__} {sys.version} {sources}".encode())
    folder = _parent() / f"kernels-{versions.hexdigest()[:16]}"
    _tidy(folder)
    return folder


def _tidy(folder: Path) -> None:
    """Note that a folder is used today, and remove those of other sources that were not of late."""
    now = time.time()
    try:
        if folder.is_dir():
            if now - folder.stat().st_mtime > _DAY:
                os.utime(folder)
            return
        for other in folder.parent.glob("kernels-" + 16 * "[0-9a-f]"):
            if now - other.stat().st_mtime > _KEPT_DAYS * _DAY:
                shutil.rmtree(other, ignore_errors=True)
    except OSError:  # of another user, or another process was faster
        pass


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


_File: Any = caching.IndexDataCacheFile
_Cache: Any = caching.FunctionCache
_Library: Any = codegen.JITCodeLibrary
_Compiler: Any = compiler.Compiler
_Dispatcher: Any = registry.CPUDispatcher


class _KeptFile(_File):  # type: ignore[misc]
    """Index and code of a kernel on disk, each with a hash of what stands before it at its end."""

    def _load_index(self) -> Any:
        if os.path.lexists(self._index_path):
            _verify(self._index_path)
        return super()._load_index()

    def _load_data(self, name: str) -> Any:
        _verify(self._data_path(name))
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, path: str) -> Iterator[io.BytesIO]:
        with super()._open_for_write(path) as file:
            content = io.BytesIO()
            yield content
            file.write(content.getvalue() + hashlib.sha256(content.getvalue()).digest())


def _verify(path: str) -> None:
    content = Path(path).read_bytes()
    if hashlib.sha256(content[:-32]).digest() != content[-32:]:
        raise ValueError(f"{Path(path).name} was altered")


class _Kept(_Cache):  # type: ignore[misc]
    """What numba keeps of a kernel, where what goes wrong with the disk costs time only."""

    said = False

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _KeptFile(
            self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )

    def load_overload(self, signature: Any, context: Any) -> Any:
        try:
            return super().load_overload(signature, context)
        except Exception as error:  # whatever bytes that stand for no code may raise
            self._say("read", "it is compiled again, about 10 s for each law", error)
        with suppress(OSError):
            self.flush()
        return None

    def save_overload(self, signature: Any, code: Any) -> None:
        try:
            super().save_overload(signature, code)
        except (OSError, ValueError) as error:
            self._say("keep", "it is compiled again next time", error)

    def _say(self, what: str, so: str, error: Exception) -> None:
        if not _Kept.said:
            _Kept.said = True
            why = getattr(error, "strerror", None) or error or type(error).__name__
            _log.warning("cannot %s compiled code in %s (%s): %s", what, cache_folder(), why, so)


class _Whole(_Library):  # type: ignore[misc]
    """Code of a kernel and of all that it calls: brought together and optimised once, here."""

    def finalize(self) -> None:
        self._linking_libraries = _within(self)
        self._own = {f.name for f in self._final_module.functions if not f.is_declaration}
        super().finalize()

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:  # no other kernel's of the same name
            if not function.is_declaration and function.name not in self._own:
                function.linkage = "internal"
        manager, builder = self._codegen._module_pass_manager()
        manager.run(self._final_module, builder)


class _Part(_Whole):
    """Code of a function that only kernels call: left as it is, for theirs.

    Numba would bring it together with what it calls too, optimise it and make machine code of it.
    """

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        named = [str(g) for g in self._final_module.global_variables if "NumbaEnv" in g.name]
        self._codegen._add_module(parse_assembly("\n".join(named)))  # what numba asks for at once
        self._codegen._engine.finalize_object()
        self._finalized = True


def _within(library: Any) -> list[Any]:
    """Return the libraries that a library needs, with those that its parts need."""
    found = list(dict.fromkeys(library._linking_libraries))
    for inner in found:  # which grows
        if isinstance(inner, _Part):
            found += [other for other in inner._linking_libraries if other not in found]
    return found


class _IntoWhole(_Compiler):  # type: ignore[misc]
    """Numba's compiler, whose code goes into a library of ours."""

    library: Any = _Whole

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        self.state.library = self.library(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(func)


class _IntoPart(_IntoWhole):
    """The compiler of what only kernels call."""

    library = _Part


class _Apart(_Part):
    """Code of a part that stands in a kernel once, and is called there."""

    def add_ir_module(self, module: Any) -> None:
        for function in module.functions:
            if not function.is_declaration:
                function.attributes.discard("alwaysinline")
                function.attributes.add("noinline")
        super().add_ir_module(module)


class _IntoApart(_IntoWhole):
    """The compiler of such parts."""

    library = _Apart


def _short_name(form: Any) -> tuple[str, tuple[str]]:
    """Return what a named tuple is called in the name of a function that takes it.

    Numba writes out all fields of all its records there: 5 kB wherever the function is called.
    """
    return form.instance_class.__name__, (hashlib.sha256(form.name.encode()).hexdigest()[:16],)


_Tuple: Any = types.NamedTuple
_Tuple.mangling_args = property(_short_name)


# Flags are compared at each call that is typed; numba asks for each of them by its name, which
# takes 5 % of the time of a first run.
_Flags: Any = compiler.Flags
_SET_OUT = {name: option.default for name, option in _Flags.options.items()}
_Flags.values = lambda flags: _SET_OUT | flags._values


# Of what is compiled for the types that a kernel has for it, see numba.extending.overload.
OVERLOADED: Any = {"forceinline": True, "pipeline_class": _IntoPart}


def chosen_by_first(
    of_value: Callable[[Any], Callable[..., Any]], of_type: Callable[[Any], Callable[..., Any]]
) -> Callable[..., Any]:
    """Return a function that its first argument chooses: by value in Python, by type in kernels.

    What is chosen for a type is a function as it is written, or a compiled one: nothing else is
    compiled for the type.
    """

    def called(*given: Any, **named: Any) -> Any:
        return of_value(given[0])(*given, **named)

    @overload(called, jit_options=OVERLOADED, strict=False)  # strict: same arguments
    def compiled(*kinds: Any) -> Any:
        own = of_type(kinds[0])
        return (lambda *given: own(*given)) if isinstance(own, _Dispatcher) else own

    return called


def _at_ease(compile_: Callable[..., Any]) -> Callable[..., Any]:
    """Return a compiler that is not kept from its work: a quarter of the time of a first run.

    Python takes memory for frames in pieces of 16 kB, and gives a piece back with its first frame:
    a busy loop whose calls each begin a piece goes to the system each time. After a frame of 1 MB
    there is room for all. Garbage is next to none, and the search for it goes through all that the
    compiler holds.
    """

    def call(*given: Any) -> Any:
        searching = gc.isenabled()
        gc.disable()
        try:
            return compile_(*given)
        finally:
            if searching:
                gc.enable()

    code = call.__code__.replace(co_stacksize=_ROOM)
    return FunctionType(code, globals(), closure=call.__closure__)


def compiled(function: Callable[..., Any], *, under: str = "", allocates: bool = True) -> Any:
    """Compile a kernel that Python calls, and keep its code in `cache_folder`, `under` a name.

    Also for what many kernels have in common: a process that compiles one finds it made.
    allocates: whether it makes arrays.
    """
    kernel = numba.njit(pipeline_class=_IntoWhole, **(OPTIONS if allocates else _BARE))(function)
    kernel.compile = _at_ease(kernel.compile)
    before = _config.CACHE_DIR
    try:
        folder = cache_folder() / under
        folder.mkdir(parents=True, exist_ok=True)
        _config.CACHE_DIR = str(folder)
        kernel._cache = _Kept(function)
    except (OSError, RuntimeError):  # read-only home, zipped package
        pass
    finally:
        _config.CACHE_DIR = before
    return kernel


def shared(function: Callable[..., Any]) -> Any:
    """Compile what many kernels have in common, see `compiled`, and what makes no arrays."""
    return _by_type(compiled(function, allocates=False))


def _by_type(kernel: Any) -> Any:
    """Let a kernel be compiled once for the types of its arguments, not for each constant given."""
    find = kernel.get_call_template
    unliteral: Callable[[Any], Any] = types.unliteral

    def plain(kind: Any) -> Any:
        # one type for all constants of a type, and for all members of an enumeration
        found = unliteral(kind)
        return found.dtype if isinstance(found, types.IntEnumMember) else found

    def template(args: Any, kws: Any) -> Any:
        return find(tuple(map(plain, args)), {name: plain(kind) for name, kind in kws.items()})

    kernel.get_call_template = template
    return kernel


class _Within(_Dispatcher):  # type: ignore[misc]
    """A function that kernels call, and that Python runs as it is written."""

    def __init__(
        self, function: Callable[..., Any], options: dict[str, Any], into: Any = _IntoPart
    ) -> None:
        options = options | {"nopython": True, "boundscheck": None, "no_cpython_wrapper": True}
        super().__init__(function, targetoptions=options, pipeline_class=into)

    def add_overload(self, cres: Any) -> None:
        self.overloads[tuple(cres.signature.args)] = cres

    def _compile_for_args(self, *_args: Any, **_kws: Any) -> Any:
        return self.py_func  # what numba calls with the arguments


def part(function: Callable[..., Any]) -> Any:
    """Compile a function that kernels call; its code is kept with theirs. It makes no arrays."""
    return _by_type(_Within(function, _BARE))


def apart(function: Callable[..., Any]) -> Any:
    """Compile a part that does much or is seldom called: once, not into each of its callers.

    Numba compiles what `inlined` calls into its callers as well: the step of RODAS stood in each
    kernel twice so, and took 0.4 of the time that LLVM needs.
    """
    return _by_type(_Within(function, _INLINED, _IntoApart))


def allocating(function: Callable[..., Any]) -> Any:
    """Compile a function that kernels call, and that makes arrays; its code is kept with theirs."""
    return _by_type(_Within(function, OPTIONS))


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a function into its callers, always: what a loop over lanes is made of."""
    return _Within(function, _INLINED)


@intrinsic
def wide(typingctx: Any) -> Any:  # noqa: ARG001
    """Let the function that calls this use the widest vectors the processor has.

    Without it LLVM stops at half of them on processors whose clock once sank under wide vectors.
    """

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        # a plain string attribute: llvmlite's own method knows enumerated ones only
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.none(), code


@contextmanager
def on_compile(notice: Callable[[], None]) -> Iterator[None]:
    """Call `notice` once, when a kernel has to be compiled because no kept code fits.

    Where the kept code was found damaged, a warning says already that it is compiled.
    """

    class Listener(event.Listener):
        """Gives the notice at the first compilation that numba reports."""

        announced = False

        def on_start(self, event: Any) -> None:  # noqa: ARG002
            if not self.announced and not _Kept.said:
                self.announced = True
                notice()

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield
