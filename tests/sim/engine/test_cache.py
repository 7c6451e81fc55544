"""Compiled code on disk: found again, never stale, and nothing lost where it cannot be written."""

import os
import random
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest

import swimbladder
from swimbladder.control.registry import LAWS
from swimbladder.sim.closed_loop.lanes import run_block
from swimbladder.sim.closed_loop.outside import fingerprint, kernel_of
from swimbladder.sim.engine import cache as engine_cache

PACKAGE = Path(swimbladder.__file__).parent
FOLDER = "from swimbladder.sim.engine.cache import cache_folder; print(cache_folder().name)"
# Few kernels, small ones: what a mode begins with, and one step of a motor.
STEP = """
import numpy as np
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.engine.advance import begin, new_lane
from swimbladder.sim.engine.cache import cache_folder, on_compile
from swimbladder.sim.engine.modes import NO_LAYERS
told = []
lane = new_lane(np.zeros(len(Plant._fields)), NO_LAYERS, np.array([0.0, 0.0, 1.0, 0.0]))
with on_compile(lambda: told.append(1)):
    print(begin(lane), len(told), any(cache_folder().rglob("*begin-*.nbi")))
"""


def python(code: str, *, cache: Path | None = None, package: Path | None = None) -> str:
    """Run code in a new process, warnings as errors; return what it printed, nothing on stderr."""
    environment = dict(os.environ)
    if cache is not None:
        environment["SWIMBLADDER_CACHE_DIR"] = str(cache)
    environment["PYTHONPATH"] = str((package or PACKAGE).parent)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout.strip()


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the package to edit."""
    package = tmp_path / "lib" / "swimbladder"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    return package


def test_the_folder_changes_with_the_source_of_any_kernel(copy: Path) -> None:
    names = [python(FOLDER, package=copy)]
    assert names[0].startswith("kernels-")
    for file in (
        "sim/engine/modes.py",
        "control/cascade.py",
        "sim/closed_loop/lanes.py",
        "physics/dynamics.py",
    ):
        with (copy / file).open("a") as source:
            source.write("\n# an edit\n")
        names.append(python(FOLDER, package=copy))
    assert len(set(names)) == len(names)
    (copy / "io" / "tables.py").write_text('"""No kernel is in here."""\n')
    assert python(FOLDER, package=copy) == names[-1]


def test_an_edited_callee_is_compiled_anew(copy: Path, tmp_path: Path) -> None:
    """What numba's own index does not notice: `begin` calls `first_mode` of another file."""
    cache = tmp_path / "cache"
    assert python(STEP, cache=cache, package=copy).split()[1:] == ["1", "True"]
    assert python(STEP, cache=cache, package=copy).split()[1:] == ["0", "True"]
    before = python(STEP, cache=cache, package=copy).split()[0]
    modes = copy / "sim" / "engine" / "modes.py"
    text = modes.read_text()
    assert text.count("    where = SUBMERGED\n") == 1
    modes.write_text(text.replace("    where = SUBMERGED\n", "    where = EMERGING\n"))
    after, compiled, _ = python(STEP, cache=cache, package=copy).split()
    assert (int(before) // 20, int(after) // 20) == (0, 1)
    assert compiled == "1"


# One kernel for two classes of the same name, as two packages may have for their laws' parameters.
SAME_NAME = """
from typing import NamedTuple
from swimbladder.sim.engine.cache import apart, chosen_by_first, compiled
OWN = {}
def add(kind, function):
    OWN[kind] = function
    return compiled(kernel, under=kind.__module__)
pick = chosen_by_first(lambda p: OWN[type(p)], lambda form: OWN[form.instance_class])
@apart
def within(p, x):
    return pick(p, x) + 1.0
def kernel(p, x):
    return within(p, x)
"""
OF_A_PACKAGE = """
from typing import NamedTuple
import common
class Gains(NamedTuple):
    k: float
    l: float
def own(p, x):
    return p.k * x
kernel = common.add(Gains, own)
"""


def test_kernels_for_classes_of_the_same_name_do_not_call_each_other(tmp_path: Path) -> None:
    """The one is found made, and the other, made here, has functions of the very same names."""
    modules = {"common": SAME_NAME, "one": OF_A_PACKAGE}
    modules["other"] = OF_A_PACKAGE.replace("p.k * x", "-p.k * x")
    for name, text in modules.items():
        (tmp_path / f"{name}.py").write_text(text)
    for names, found in (("one", "7.0"), ("one other", "7.0 -5.0")):
        calls = ", ".join(f"{name}.kernel({name}.Gains(2.0, 0.0), 3.0)" for name in names.split())
        code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        code += f"import {names.replace(' ', ', ')}\nprint({calls})"
        assert python(code, cache=tmp_path / "cache") == found


OTHER = """
import numba
import numpy as np
from numba.core import event
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.engine.modes import NO_LAYERS
from swimbladder.sim.engine.modes import first_mode
compiled = []
class Listener(event.Listener):
    def on_start(self, event): compiled.append(event.data["dispatcher"].py_func.__name__)
    def on_end(self, event): pass
@numba.njit
def another(p, layers, x): return first_mode(p, layers, x)
with event.install_listener("numba:compile", Listener()):
    another(np.zeros(len(Plant._fields)), NO_LAYERS, np.array([0.0, 0.0, 1.0, 0.0]))
print(*compiled)
"""


@pytest.mark.prove
def test_what_kernels_have_in_common_is_found_made_by_another(tmp_path: Path) -> None:
    assert "first_mode" in python(OTHER, cache=tmp_path).split()
    assert python(OTHER, cache=tmp_path) == "another"


@pytest.mark.prove
def test_a_cache_that_cannot_be_written_is_done_without(tmp_path: Path) -> None:
    """A file where the folder should be: compiled anew, the same result, not a word on stderr."""
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    mode, told, kept = python(STEP, cache=blocked).split()
    assert (told, kept) == ("1", "False")
    assert mode == python(STEP, cache=tmp_path / "cache").split()[0]
    assert blocked.read_text() == "in the way"


def twice(x: float) -> float:
    return 2.0 * x


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own for this process, of which nothing was said so far."""
    folder = tmp_path / "kernels"
    monkeypatch.setattr(engine_cache, "cache_folder", lambda: folder)
    monkeypatch.setattr(engine_cache._Kept, "said", False)
    return folder


def kept(notice: Callable[[], None] = lambda: None) -> bool:
    """Run a kernel as a new process would; return whether its code was found on disk."""
    kernel = engine_cache.compiled(twice)
    with engine_cache.on_compile(notice):
        assert kernel(3.0) == 6.0
    return bool(kernel.stats.cache_hits)


def damaged(content: bytes, how: str) -> bytes:
    half = len(content) // 2
    return {
        "emptied": b"",
        "random bytes": random.Random(1).randbytes(len(content)),
        "cut off": content[:half],
        "one bit": content[:half] + bytes([content[half] ^ 1]) + content[half + 1 :],
    }[how]


@pytest.mark.parametrize("what", ["nbi", "nbc"])
@pytest.mark.parametrize("how", ["emptied", "random bytes", "cut off", "one bit"])
def test_damaged_code_is_compiled_again_and_kept(
    how: str, what: str, folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert not kept()
    assert kept()
    (file,) = folder.rglob(f"*.{what}")
    file.write_bytes(damaged(file.read_bytes(), how))
    notices: list[int] = []
    assert not kept(lambda: notices.append(1))
    assert notices == []  # the warning says it
    (message,) = caplog.messages
    assert message.startswith(f"cannot read compiled code in {folder} ({file.name} was altered): ")
    assert kept()


def test_an_index_that_cannot_be_read_is_done_without(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A folder where the file should be: neither read nor replaced, by root either."""
    assert not kept()
    (index,) = folder.rglob("*.nbi")
    index.unlink()
    index.mkdir()
    assert not kept()
    assert not kept()
    (message,) = caplog.messages
    assert "cannot read compiled code" in message
    assert "(Is a directory)" in message


@pytest.mark.parametrize("size", [0, 2000], ids=["nothing fits", "the index fits"])
def test_a_disk_that_is_full_ends_no_run(
    size: int, folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """No file may grow beyond a limit: the system refuses to write more."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        assert not kept()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    (message,) = caplog.messages
    assert "cannot keep compiled code" in message
    assert "(File too large)" in message
    assert [path.suffix for path in folder.rglob("*.*")] == [".nbi"] * (size > 0)
    assert not kept()
    assert kept()


def test_folders_of_sources_that_are_used_no_more_go_after_a_month(tmp_path: Path) -> None:
    month = 30 * 86400.0
    ages = {"kernels-" + 16 * "a": month + 60.0, "kernels-" + 16 * "b": month - 60.0}
    ages |= {"kernels-mine": 2 * month, "notes": 2 * month}
    for name, age in ages.items():
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (time.time() - age,) * 2)
    python("import swimbladder.sim.engine.advance", cache=tmp_path)
    left = {folder.name for folder in tmp_path.iterdir()}
    assert set(ages) - left == {"kernels-" + 16 * "a"}
    (ours,) = left - set(ages)
    os.utime(tmp_path / ours, (time.time() - 20 * 86400.0,) * 2)  # used again: young again
    python(FOLDER, cache=tmp_path)
    assert time.time() - (tmp_path / ours).stat().st_mtime < 3600.0


def test_a_damaged_index_costs_a_command_one_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "swimbladder", "simulate", "feup-em", "--json"]
    run = dict(cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    first = subprocess.run(command, **run)  # type: ignore[call-overload]
    assert first.returncode == 0, first.stderr
    folder = tmp_path / engine_cache.cache_folder().name
    shutil.copytree(engine_cache.cache_folder(), folder)
    for index in folder.rglob("*start_block-*.nbi"):  # of each place that the package ran from
        index.write_bytes(b"")
    again = subprocess.run(
        command, env=os.environ | {"SWIMBLADDER_CACHE_DIR": str(tmp_path)}, **run
    )  # type: ignore[call-overload]
    assert (again.returncode, again.stdout) == (0, first.stdout)
    assert again.stderr.count("\n") == 1
    assert f"{index.name} was altered" in again.stderr


FACTOR = 2.0


def helper(x: float) -> float:
    return FACTOR * x


def law(x: float, bias: float = 0.5) -> float:
    return helper(x) + bias


class TestFingerprint:
    """The name under which the kernels of a user's law are kept."""

    def test_it_is_the_same_for_the_same_code(self) -> None:
        assert fingerprint(law) == fingerprint(law)
        assert len(fingerprint(law)) == 16

    def test_it_sees_what_a_function_calls_and_refers_to(self, monkeypatch) -> None:
        names = {fingerprint(law)}
        monkeypatch.setitem(globals(), "FACTOR", 3.0)
        names.add(fingerprint(law))
        monkeypatch.setitem(globals(), "helper", lambda x: x)
        names.add(fingerprint(law))
        monkeypatch.setattr(law, "__defaults__", (0.75,))
        names.add(fingerprint(law))
        assert len(names) == 4

    def test_it_sees_constants_and_closures(self) -> None:
        def made(gain: float):
            return lambda x: gain * x

        assert fingerprint(made(1.0)) == fingerprint(made(1.0))
        assert fingerprint(made(1.0)) != fingerprint(made(2.0))
        assert fingerprint(lambda x: x + 1) != fingerprint(lambda x: x + 2)

    def test_what_it_cannot_tell_is_never_found_again(self) -> None:
        thing = object()
        function = lambda x: (thing, x)  # noqa: E731
        assert fingerprint(function) != fingerprint(function)


class Numbers(NamedTuple):
    """What no other process can import."""

    gain: float


@pytest.mark.parametrize("part", ["parameters", "state"])
def test_a_step_of_ours_with_numbers_of_another_package_keeps_its_kernel_apart(part: str) -> None:
    """One type that cannot be imported would make the index of all our laws unreadable."""
    ours = LAWS["rate"]
    assert kernel_of(ours) is run_block
    other = kernel_of(replace(ours, **{part: Numbers}))
    assert other is not run_block
    assert "law-" in other._cache.cache_path
    assert other is not kernel_of(replace(ours, parameters=Numbers, state=Numbers))


USER = """
from typing import NamedTuple
from swimbladder.control.law import Law

class Gains(NamedTuple):
    gain: float

class Memory(NamedTuple):
    last: float

def step(parameters, state, measurement, reference):
    return FACTOR * parameters.gain, Memory(measurement.depth), 0.3

def initial(parameters, measurement, reference):
    return Memory(measurement.depth)

FACTOR = 1.0
LAW = Law(name="mine", summary="", command="voltage", parameters=Gains, state=Memory,
          step=step, initial=initial)
"""
FIND = """
from mine import LAW
from swimbladder.sim.closed_loop.outside import kernel_of
from swimbladder.sim.closed_loop.lanes import run_block
from swimbladder.control.cascade import CASCADE
assert kernel_of(CASCADE) is run_block
kernel = kernel_of(LAW)
assert kernel is not run_block and kernel is kernel_of(LAW)
print(kernel._cache.cache_path)
"""


def test_an_edited_law_of_a_user_has_kernels_of_its_own(copy: Path, tmp_path: Path) -> None:
    """The types of its parameters stay the same; the code that is kept must not be."""
    mine = copy.parent / "mine.py"
    paths = []
    for text in (USER, USER, USER.replace("FACTOR = 1.0", "FACTOR = -3.0")):
        mine.write_text(text)
        paths.append(python(FIND, cache=tmp_path, package=copy))
    assert paths[0] == paths[1] != paths[2]
    assert all("law-" in path for path in paths)
