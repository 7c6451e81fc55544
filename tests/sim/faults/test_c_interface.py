"""The C that is compiled on this machine: by which compiler, loaded, called, and cleared away."""

import ctypes
import shutil

import pytest

from swimbladder.errors import InputError
from swimbladder.sim.faults import c_interface
from swimbladder.sim.faults.c_interface import Board, compiler
from tests.codegen.conftest import gcc

__all__ = ["gcc"]


@pytest.fixture
def found(monkeypatch):
    """Return what says which programs there are, and what CC is."""

    def there(*names, CC=None):
        monkeypatch.setattr(shutil, "which", lambda name: f"/b/{name}" if name in names else None)
        if CC is None:
            monkeypatch.delenv("CC", raising=False)
        else:
            monkeypatch.setenv("CC", CC)

    return there


def test_the_compiler_that_is_asked_for_or_the_first_that_there_is(found):
    for names, chosen in (
        (("cc", "gcc", "clang"), "cc"),
        (("gcc", "clang"), "gcc"),
        (("clang",), "clang"),
    ):
        found(*names)
        assert compiler() == f"/b/{chosen}"
        found(*names, "tcc", CC="tcc -w")
        assert compiler() == "/b/tcc"
        found(*names, CC="")
        assert compiler() == f"/b/{chosen}"


def test_without_one_it_is_said_what_was_asked_for(found):
    found("cc", "gcc", CC="tcc -w")
    with pytest.raises(InputError, match="no C compiler") as refused:
        compiler()
    assert (refused.value.field, refused.value.value) == ("CC", "tcc")
    found()
    with pytest.raises(InputError, match="no C compiler") as refused:
        compiler()
    assert (refused.value.field, refused.value.value) == (None, None)


def glue(name, size):
    return f"""\
#include "half.h"
int {name}_size(void) {{ return {size}; }}
void {name}_begin(void *memory, int after_reset)
{{ *(unsigned char *)memory = {size} + after_reset; }}
float {name}_tick(void *memory, const float *seen, float *said)
{{ said[0] = HALF; return seen[0]; }}
"""


@pytest.mark.usefixtures("gcc")
def test_a_board_is_compiled_and_called_by_its_addresses(tmp_path, monkeypatch):
    """Its memory is that of the largest of its programs; its files are gone when it is left."""
    monkeypatch.setattr(c_interface.tempfile, "gettempdir", lambda: str(tmp_path))
    files = {"half.h": "#define HALF 0.5f\n", "a.c": glue("a", 7), "b.c": glue("b", 3)}
    with Board(files, ("a", "b")) as board:
        assert board.size == 7
        assert list(tmp_path.iterdir())
        begin, tick = board.addresses["b"]
        memory, seen, said = (ctypes.c_ubyte * 7)(), (ctypes.c_float * 2)(9.0), ctypes.c_float()
        ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int)(begin)(memory, 2)
        assert memory[0] == 5
        call = ctypes.CFUNCTYPE(ctypes.c_float, *[ctypes.c_void_p] * 3)(tick)
        assert call(memory, seen, ctypes.addressof(said)) == 9.0
        assert said.value == 0.5
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("gcc")
def test_c_that_is_none_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.setattr(c_interface.tempfile, "gettempdir", lambda: str(tmp_path))
    with pytest.raises(InputError, match=r"did not compile the controller's C: .*error") as refused:
        Board({"a.c": "this is no C;\n" * 40}, ("a",))
    assert len(refused.value.what) < 400
    assert not list(tmp_path.iterdir())
