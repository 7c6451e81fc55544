"""Every law: its C, its float32 twin and its Python, the first two equal to the bit."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.codegen.subset import read_law
from swimbladder.codegen.tree import FLOAT
from swimbladder.control.law import from_numbers
from swimbladder.control.registry import LAWS
from tests.codegen.build import STRICT, Compiled, Program, run, write
from tests.codegen.laws import (
    bits,
    example,
    flat,
    hour,
    in_float64,
    random_calls,
    split,
    twin_of,
)
from tests.examples import examples
from tests.vehicles import EACH


@pytest.fixture(params=EACH, scope="module")
def name(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def compiled(name, request, tmp_path_factory) -> Compiled:
    request.getfixturevalue("gcc")
    return Compiled(LAWS[name], tmp_path_factory.mktemp(name))


def test_an_hour_with_noise_is_equal_to_the_bit(name, compiled):
    parameters, calls = example(name).parameters, hour(name)
    state = compiled.initial(parameters, calls[0].measurement, calls[0].reference)
    assert bits(state) == bits(calls[0].state)
    for call in calls:
        command, state, next_s = compiled.step(parameters, state, call.measurement, call.reference)
        assert bits(command, state, next_s) == bits(call.command, call.after, call.next_s)


def test_the_hour_asks_the_law_for_something(name):
    calls = hour(name)
    commands = np.array([call.command for call in calls], float)
    assert np.all(np.isfinite(commands))
    # A controller takes a state for spoilt by a bad measurement where it is not finite.
    assert np.all(np.isfinite(np.array([flat(call.after) for call in calls], float)))
    assert len(np.unique(commands)) > min(100, len(calls) // 4)
    depths = np.array([call.measurement.depth for call in calls])
    assert depths.max() > 2.5
    assert depths.min() < 2.0


def test_the_twin_is_near_the_law_in_double_precision(name):
    parameters, calls, law = example(name).parameters, hour(name), LAWS[name]
    rounded = from_numbers(type(parameters), map(_rounded, flat(parameters)))
    far, commands = [], []
    for call in calls[:3000]:
        command, _, _ = law.step(
            rounded, in_float64(call.state), in_float64(call.measurement), float(call.reference)
        )
        far.append(abs(command - float(call.command)))
        commands.append(command)
    span = max(commands) - min(commands)
    # A gain on a difference of depths takes the last bit of a depth to some 1e-4 of the command;
    # where a law decides, a last bit may decide otherwise, once in a long while.
    assert np.quantile(far, 0.998) < 5e-4 * span


def _rounded(x):
    return float(np.float32(x))


_EDGES = (math.nan, math.inf, -math.inf, -0.0, 0.0, 1e-45, -1e-45, 1.1754942e-38, 3.4028235e38, 1.0)
_BYTES = 5  # of a number: which kind it is, and four to make it of


def _near(numbers: list[float], drawn: bytes) -> list[float]:
    """Each number itself, one of its size, an edge, or any float32, as its bytes say.

    One draw of bytes for all of them: drawing forty numbers one by one takes ten times as long.
    """
    found = []
    for k, number in enumerate(numbers):
        kind, word = struct.unpack_from("<BI", drawn, _BYTES * k)
        share = word / 2.0**32
        (bare,) = struct.unpack("<f", struct.pack("<I", word))
        found.append(
            (
                float(np.float32(number)),
                float(np.float32(number * (8.0 * share - 4.0))),
                float(np.float32(number * (0.9 + 0.2 * share))),
                _EDGES[word % len(_EDGES)],
                math.nan if math.isnan(bare) else bare,
            )[kind % 5]
        )
    return found


@pytest.mark.slow
@examples(600)
@given(data=st.data())
def test_random_calls_are_equal_to_the_bit(name, compiled, data):
    law, parameters = twin_of(name), example(name).parameters
    call = data.draw(st.sampled_from(hour(name)[:: 1 + len(hour(name)) // 50]))
    numbers = [float(x) for x in flat(parameters, call.state, call.measurement, call.reference)]
    size = _BYTES * len(numbers)
    near = _near(numbers, data.draw(st.binary(min_size=size, max_size=size)))
    p, state, seen, reference = split(law, near)
    command, after, next_s = law.step(p, state, seen, reference)
    assert bits(compiled.step(p, state, seen, reference)) == bits(command, after, next_s)
    assert bits(compiled.initial(p, seen, reference)) == bits(law.initial(p, seen, reference))


def _same_as_the_twin(name: str, program: Program) -> None:
    law = twin_of(name)
    frames = random_calls(name, 3000)
    for frame, answer in zip(frames, program.answers(frames), strict=True):
        given, state, seen, reference = split(law, frame)
        expected = law.initial(given, seen, reference), law.step(given, state, seen, reference)
        assert bits(tuple(answer)) == bits(*expected)


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.filterwarnings("ignore:overflow")
class TestCompilers:
    """The same answers, and no complaint, from any compiler."""

    @pytest.mark.usefixtures("gcc")
    def test_sanitizers(self, name, tmp_path):
        _same_as_the_twin(
            name,
            Program(
                LAWS[name],
                tmp_path,
                "gcc",
                *STRICT,
                "-O1",
                "-g",
                "-fsanitize=address,undefined",
                "-fno-sanitize-recover=all",
            ),
        )

    @pytest.mark.usefixtures("gcc")
    def test_a_processor_that_could_fuse_multiply_and_add(self, name, tmp_path):
        if "fma" not in Path("/proc/cpuinfo").read_text().split():
            pytest.skip("this processor has no fused multiply-add")
        _same_as_the_twin(name, Program(LAWS[name], tmp_path, "gcc", "-std=gnu11", "-O3", "-mfma"))

    @pytest.mark.usefixtures("clang")
    def test_clang(self, name, tmp_path):
        _same_as_the_twin(name, Program(LAWS[name], tmp_path, "clang", *STRICT, "-O3"))

    @pytest.mark.usefixtures("gcc")
    def test_as_cpp_the_header_can_be_read(self, name, tmp_path):
        write(LAWS[name], tmp_path)
        (tmp_path / "user.cpp").write_text(
            f'#include "{next(tmp_path.glob("swb_[!m]*.h")).name}"\nint main() {{ return 0; }}\n'
        )
        run("g++", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", tmp_path / "user.cpp")

    @pytest.mark.usefixtures("arm")
    def test_arm(self, name, tmp_path):
        source = write(LAWS[name], tmp_path)
        target = ("-mcpu=cortex-m0plus", "-mthumb", "-O2")
        file = tmp_path / source.source_name
        run("arm-none-eabi-gcc", *STRICT, *target, "-c", file, "-o", tmp_path / "law.o")

    @pytest.mark.usefixtures("avr")
    def test_avr(self, name, tmp_path):
        source = write(LAWS[name], tmp_path)
        file = tmp_path / source.source_name
        flags = [flag for flag in STRICT if flag != "-Wdouble-promotion"]  # double is float there
        run("avr-gcc", *flags, "-mmcu=atmega328p", "-Os", "-c", file, "-o", tmp_path / "law.o")

    @pytest.mark.usefixtures("cppcheck")
    def test_cppcheck(self, name, tmp_path):
        write(LAWS[name], tmp_path)
        run(
            "cppcheck",
            "--quiet",
            "--enable=warning,style,performance,portability",
            "--error-exitcode=1",
            "--std=c99",
            "--suppress=missingIncludeSystem",
            tmp_path,
        )


@pytest.mark.usefixtures("gcc")
def test_fast_math_is_refused(tmp_path):
    source = write(LAWS["cascade"], tmp_path)
    with pytest.raises(AssertionError, match="without -ffast-math"):
        run("gcc", "-Ofast", "-c", tmp_path / source.source_name, "-o", tmp_path / "law.o")


def test_the_states_of_laws_are_floats(name):
    """``swb_controller`` looks for NaN in them, four bytes at a time."""
    records = read_law(LAWS[name]).state.own()
    kinds = {kind for record in records for _, kind in record.fields}
    assert kinds - set(records) == {FLOAT}
