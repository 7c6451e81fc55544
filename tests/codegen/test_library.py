"""The Arduino library: what is in it, and that it does what its twin did."""

import ctypes
import dataclasses
import math
import re
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import swimbladder as sb
from swimbladder.codegen.golden import BoardProgram
from swimbladder.codegen.library import Library, firmware, plan_program, write_library
from swimbladder.codegen.twin import ControllerTwin, VehicleTwin, wait_in_ticks
from swimbladder.control.supervisor import Reason, Watched
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.vehicle import Controller, Supervisor, Vehicle
from tests.codegen.build import STRICT, run
from tests.codegen.laws import bits, controlled, example, twin_of
from tests.codegen.test_supervised import VehicleInC
from tests.vehicles import TWO, limited, paper

ARDUINO = Path(__file__).parent / "arduino"


@cache
def library(name: str) -> Library:
    """A law's library; its golden mission is short, so that the tests are."""
    return firmware(limited(controlled(name)), duration=300 * example(name).tick)


# In every run of two kinds of law: a voltage and a position. The C of ADRC is in test_laws.py.


@pytest.fixture(params=TWO, scope="module")
def name(request) -> str:
    return request.param


class LibraryInC:
    """The library's C, compiled for this machine and loaded."""

    def __init__(self, made: Library, folder: Path) -> None:
        write_library(made, folder / "library")
        sources = sorted((folder / "library" / "src").glob("*.c"))
        run("gcc", *STRICT, "-O2", "-shared", "-fPIC", *sources, "-o", folder / "c.so", "-lm")
        self.c = ctypes.CDLL(str(folder / "c.so"))
        number = ctypes.c_float
        self.c.swb_controller_begin.argtypes = [ctypes.c_void_p, number]
        self.c.swb_controller_tick.argtypes = [ctypes.c_void_p, number, number, number]
        self.c.swb_controller_tick.restype = number
        self.c.swb_controller_sleep.argtypes = [ctypes.c_void_p, ctypes.c_uint32]
        self.c.swb_controller_sleep.restype = ctypes.c_uint32
        self.c.swb_wait_in_ticks.argtypes = [number]
        self.c.swb_wait_in_ticks.restype = ctypes.c_uint32

    def begin(self, command: float) -> None:
        self.room = ctypes.create_string_buffer(4096)
        self.c.swb_controller_begin(ctypes.addressof(self.room), command)

    def tick(self, depth: float, volume: float, reference: float) -> float:
        return self.c.swb_controller_tick(ctypes.addressof(self.room), depth, volume, reference)

    def sleep(self, ticks: int) -> int:
        return self.c.swb_controller_sleep(ctypes.addressof(self.room), ticks)


@pytest.fixture(scope="module")
def controller(name, request, tmp_path_factory) -> LibraryInC:
    request.getfixturevalue("gcc")
    return LibraryInC(library(name), tmp_path_factory.mktemp(name))


def first_command(name: str) -> float:
    made = library(name)
    return 0.0 if made.law.command == "voltage" else made.vehicle.stroke.maximum


def test_the_c_gives_the_golden_trace_to_the_bit(name, tmp_path):
    """Law and supervisor: each command and each reason; at last the sensors fail."""
    made = library(name)
    text = made.files["extras/golden.csv"].splitlines()
    assert text[0].startswith("tick,time_s,depth_m,volume_m3,reference_depth_m,")
    assert text[0].endswith(",supervisor_reason")
    rows = np.array([line.split(",") for line in text[1:]], np.float32)
    gap = made.supervisor.depth.gap
    assert len(rows) == 301 + gap + 15
    in_c = VehicleInC(made, tmp_path)
    for tick, _, depth, volume, reference, command, reason in rows:
        seen = Watched(depth, math.nan, volume, math.nan, False, 0, 0)
        said = in_c.tick(seen, reference)
        assert bits(said[0]) == bits(command), tick
        assert said[1] == reason
    assert [int(n) for n in rows[:, 6]] == [0] * (300 + gap) + [Reason.DEPTH_MISSING] * 16
    assert np.all(rows[-15:, 5] == np.float32(made.supervisor.push.surface_command))


def _twin(name: str) -> ControllerTwin:
    made = library(name)
    return ControllerTwin(
        twin_of(name),
        made.parameters,
        tick_s=made.tick_s,
        limits=made.limits,
        first=first_command(name),
    )


_DEPTHS = st.one_of(
    st.floats(0.0, 5.0), st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0, 1e30])
)
_VOLUMES = st.one_of(st.floats(-3e-4, 3e-4), st.sampled_from([math.nan, math.inf, 1e30]))


@given(st.lists(st.tuples(_DEPTHS, _VOLUMES, _DEPTHS), min_size=1, max_size=60))
def test_faulty_measurements_are_met_as_by_the_twin(name, controller, seen):
    twin, (low, high) = _twin(name), library(name).limits
    controller.begin(first_command(name))
    for depth, volume, reference in seen:
        command = controller.tick(depth, volume, reference)
        assert bits(command) == bits(twin.tick(depth, volume, reference))
        assert np.float32(low) <= command <= np.float32(high)


def test_a_board_that_sleeps_gives_the_same_commands(name, controller):
    """Ticks that are slept over are those at which nothing would have been asked for."""
    made = library(name)
    seen = list(zip(*made.golden[:3], strict=True))
    awake, asleep = _twin(name), _twin(name)
    commands = [awake.tick(*row) for row in seen]
    controller.begin(first_command(name))
    n, called = 0, 0
    while n < len(seen):
        called += 1
        said = asleep.tick(*seen[n])
        assert bits(controller.tick(*seen[n])) == bits(said) == bits(commands[n])
        slept = asleep.sleep(10_000)
        assert controller.sleep(10_000) == slept
        assert {float(c) for c in commands[n : n + 1 + slept]} == {float(said)}
        n += 1 + slept
    assert n == asleep.ticks
    assert (called < len(seen)) == (name == "deadband")


def test_it_holds_while_nothing_is_measured_and_recovers(name):
    twin, made = _twin(name), library(name)
    seen = list(zip(*made.golden[:3], strict=True))
    for n in range(5):
        assert bits(twin.tick(math.nan, math.nan, 3.0)) == bits(first_command(name))
        assert twin.missed == n + 1
    for row in seen[:50]:
        twin.tick(*row)
    assert twin.missed == 0
    for _ in range(20):
        assert math.isfinite(twin.tick(math.nan, math.nan, 3.0))
    commands = [twin.tick(*row) for row in seen[50:150]]
    assert twin.missed == 0
    assert len(set(commands)) > 1


@pytest.mark.parametrize("name", ["deadband"], indirect=True)
@pytest.mark.promise("no-command", faults=["law hangs"])
def test_a_law_that_waits_for_longer_than_it_may_gives_no_command(name, tmp_path):
    """It holds what it commanded, is asked again at each tick, and the vehicle is brought up."""
    made, header = library(name), "src/swb_controller.h"
    most = f"#define SWB_MOST_WAIT {made.most_wait}u"
    assert most in made.files[header]
    less = made.files[header].replace(most, "#define SWB_MOST_WAIT 2u")
    short = dataclasses.replace(made, most_wait=2, files=made.files | {header: less})
    board, in_c = short.board(), VehicleInC(short, tmp_path)
    seen = Watched(1.5, 0.0, 6e-6, math.nan, False, 0, 0)
    commands = []
    for n in range(60):
        row = seen._replace(depth=1.5 + 1e-3 * (n % 5))
        command = board.tick(row, 1.5)
        said = in_c.tick(row, 1.5)
        assert bits(said[0]) == bits(command)
        assert said[1] == int(board.reason or 0)
        commands.append(float(command))
    assert board.reason is Reason.NO_COMMAND
    late = int(made.supervisor.board.missed)
    first = commands.index(float(made.supervisor.push.surface_command))
    assert first + 1 == late
    assert len(set(commands[:first])) == 1


def test_a_board_whose_memory_changed_calls_its_law_again(name):
    """A count of ticks to wait that no call can have given is none."""
    twin, (low, high) = _twin(name), library(name).limits
    twin.most = library(name).most_wait
    twin.tick(2.0, 0.0, 2.0)
    twin.waiting = twin.most + 1
    assert twin.sleep(100) == 0
    twin.tick(2.0, 1e-6, 2.0)
    assert twin.missed == 0
    assert 0 <= twin.waiting < twin.most
    assert low <= twin.command <= high


def test_a_law_that_may_wait_for_longer_than_the_board_counts_is_refused():
    vehicle = limited(controlled("deadband"))
    numbers = {**vehicle.controller.parameters, "longest": 1e6}
    controller = vehicle.controller.model_copy(update={"parameters": numbers})
    with pytest.raises(InputError, match="may wait for 1e\\+06 s, longer than the board counts"):
        firmware(vehicle.model_copy(update={"controller": controller}))


@pytest.mark.parametrize("name", ["cascade"], indirect=True)
@given(next_s=st.one_of(st.floats(0.0, 1e6, width=32), st.floats(width=32)))
def test_the_wait_in_ticks_is_that_of_the_twin(controller, next_s):
    assert controller.c.swb_wait_in_ticks(next_s) == wait_in_ticks(next_s, 0.3)


@pytest.mark.parametrize(
    ("next_s", "ticks"),
    [
        (0.3, 1),
        (0.0, 1),
        (-5.0, 1),
        (math.nan, 1),
        (0.31, 2),
        (0.6, 2),
        (0.9, 3),
        (3600.0, 12000),
        (60.0, 200),
        (math.inf, 1_000_000),
    ],
)
def test_the_wait_is_rounded_up_to_whole_ticks(next_s, ticks):
    assert wait_in_ticks(next_s, 0.3) == ticks


@pytest.mark.parametrize(("off", "words"), [(0.0065, "6.5 mm"), (43.2, "43 m")])
def test_what_rounding_moves_has_a_unit_of_its_size(off, words):
    made = library("cascade")
    golden = made.golden._replace(difference=off, apart=2e-4)
    said = dataclasses.replace(made, golden=golden).sentences[1]
    assert said.endswith(
        f"float32 moves the vehicle by at most {words} on its way, 0.2 mm at its depth"
    )


@pytest.mark.parametrize(
    "name", ["feup-em", pytest.param("example-float", marks=pytest.mark.prove)]
)
def test_a_board_that_goes_elsewhere_than_simulated_is_refused(name, monkeypatch):
    """It is what rounding might do at worst: the law in double precision is sent elsewhere."""
    double = BoardProgram.in_double

    class Elsewhere(VehicleTwin):
        def __call__(self, seen, reference):
            return super().__call__(seen, 0.5 * reference)

    def in_double(self):
        board = double(self)
        board.__class__ = Elsewhere
        return board

    monkeypatch.setattr(BoardProgram, "in_double", in_double)
    shorter = {} if name == "feup-em" else {"step": (0.0, 60.0), "duration": 3600.0}
    with pytest.raises(NoAnswerError, match=r"ends at .* on the board \(float32\), and at"):
        firmware(limited(sb.load_vehicle(name)), **shorter)


def test_the_golden_trace_is_what_simulate_says(name):
    """The vehicle under the twin goes where it goes under the law in double precision."""
    made = library(name)
    # These decide by events: rounding moves one of them, and with it the vehicle.
    assert made.golden.difference < (0.05 if name in ("observer", "pulse") else 0.02)
    low, high = made.limits
    assert made.golden.command.min() >= np.float32(low)
    assert made.golden.command.max() <= np.float32(high)


ARM = '-DWORDS="arm\\n"'  # somebody types the word
# What a compiler for each row of the README's table of boards defines, but for AVR.
OTHERS = {
    "ESP32": ["-DARDUINO_ARCH_ESP32"],
    "RP2040, Arduino-Pico core": ["-DARDUINO_ARCH_RP2040"],
    "RP2040, Mbed core": ["-DARDUINO_ARCH_RP2040", "-DARDUINO_ARCH_MBED"],
    "STM32": ["-DARDUINO_ARCH_STM32"],
    "SAMD, Teensy, others": ["-DARDUINO_ARCH_SAMD"],
}


def tried_on(made: Library, chip: str, sketch: str, text: str, folder) -> str:
    """Return what a sketch prints that is compiled against stand-ins of a chip's core.

    That this is all that is known of it stands in the README, in the chip's row.
    """
    rows = [row.strip("| ").split(" | ") for row in made.files["README.md"].splitlines()]
    said = {row[0]: row[5] for row in rows if len(row) == 6 and row[0] in {*OTHERS, AVRS}}
    assert set(said) == {*OTHERS, AVRS}
    assert said[AVRS] == "with Arduino's own core, on an emulator"  # test_core.py
    assert said[chip].startswith("**against stand-ins of ")
    assert said[chip].endswith(": that is all**")
    return _sketch(made, folder, sketch, text, ARM, *OTHERS[chip])


AVRS = "Uno, Nano, Mega (AVR)"


def _sketch(made: Library, folder: Path, name: str, text: str, *more: str) -> str:
    """Compile an example with the library against a stub of Arduino; return what it prints."""
    write_library(made, folder / "library")
    (folder / f"{name}.cpp").write_text(f"#include <Arduino.h>\n{text}")
    inside = ["-I", folder / "library" / "src", "-I", folder / "library" / "examples" / name]
    warn = ["-Wall", "-Wextra", "-Wconversion", "-Werror"]
    objects = []
    for source in (folder / "library" / "src").glob("*.c"):
        objects.append(folder / f"{source.stem}.o")
        run("gcc", *STRICT, "-O1", "-c", source, "-o", objects[-1])
    files = [folder / f"{name}.cpp", ARDUINO / "main.cpp", *objects]
    program = folder / name
    run("g++", "-std=c++11", *warn, *more, "-I", ARDUINO, *inside, *files, "-o", program, "-lm")
    return run(program).stdout.decode()


@pytest.mark.usefixtures("gcc")
class TestExamples:
    def test_the_golden_trace_sketch_says_equal(self, name, tmp_path):
        made = library(name)
        text = made.files["examples/GoldenTrace/GoldenTrace.ino"]
        printed = _sketch(made, tmp_path, "GoldenTrace", text)
        assert "golden trace: equal, 100 of 100 ticks the same" in printed
        assert made.files["examples/GoldenTrace/golden.h"].count(", 4") >= 14  # reasons

    @pytest.mark.parametrize(
        ("right", "wrong"),
        [
            ("bits_of(command) != row[3]", "bits_of(command) != row[3] + (n == 7)"),
            ("vehicle.reason != reason", "vehicle.reason != reason + (n == 7)"),
        ],
    )
    def test_and_different_where_it_is(self, right, wrong, tmp_path):
        made = library("cascade")
        text = made.files["examples/GoldenTrace/GoldenTrace.ino"]
        assert text.count(right) == 1
        printed = _sketch(made, tmp_path, "GoldenTrace", text.replace(right, wrong))
        assert "differs at tick 7: " in printed
        assert "golden trace: DIFFERENT, 99 of 100 ticks the same" in printed

    @pytest.mark.parametrize("board", ["FloatAVR", "FloatESP32RP2040"])
    def test_a_sketch_logs_what_identify_reads(self, name, board, tmp_path):
        made = library(name)
        text = made.files[f"examples/{board}/{board}.ino"]
        assert text.count("FILL IN") == 3
        filled = text.replace(
            "*depth_m = NAN;",
            "*depth_m = vehicle.controller.ticks == 2u ? NAN : 2.5f;",
        )
        filled = filled.replace("*volume_m3 = NAN;", "*volume_m3 = -1.2345e-5f;")
        printed = _sketch(made, tmp_path, board, filled, ARM)
        (tmp_path / "log.csv").write_text(printed)
        log = sb.read_log(tmp_path / "log.csv")
        lines = [line for line in printed.splitlines() if line[0] not in "#t"]
        times = [float(line.split(",")[0]) for line in lines]  # goes on under a supervisor's alarm
        np.testing.assert_allclose(np.diff(times), made.tick_s, atol=1.01e-3)
        np.testing.assert_allclose(np.diff(log.time[2:]), made.tick_s, atol=1.01e-3)
        assert log.time[0] == 0.0
        assert log.time[-1] > 4.0
        assert np.all(log.depth == 2.5)
        np.testing.assert_allclose(log.volume, -1.2345e-5, atol=1e-9)
        assert printed.startswith(
            "# age of depth: NOT watched\n# battery: NOT watched\n# leak: NOT"
        )
        low, high = made.limits
        last = float(printed.splitlines()[-1].split(",")[3])
        assert low - 1e-9 <= last <= high + 1e-9

    @pytest.mark.promise("disarmed-holds")
    def test_nobody_has_armed_it_and_nothing_happens(self, name, tmp_path):
        """On the bench, without a sensor, or dry: no reason, and no command that moves anything."""
        text = library(name).files["examples/FloatAVR/FloatAVR.ino"]
        for seen in ("NAN", "-0.2f"):
            filled = text.replace("*depth_m = NAN;", f"*depth_m = {seen};")
            said = _sketch(library(name), tmp_path, "FloatAVR", filled).splitlines()
            lines = [line.split(",") for line in said if line[0] not in "#t"]
            assert len(lines) > 12
            still = "nan" if library(name).law.command == "volume" else "0.000"
            assert {line[3].lstrip("-") for line in lines} == {still}
            assert {line[-1] for line in lines} == {"0"}
            assert "# armed" not in said
            assert said[4].startswith("# disarmed: a switch, the word arm, or ")

    @pytest.mark.parametrize("name", ["cascade"], indirect=True)
    @pytest.mark.parametrize(
        ("how", "tick"), [("switch", 7), ("word", 0), ("another word", None), ("water", 9)]
    )
    @pytest.mark.promise("water-arms")
    def test_what_arms_it(self, name, how, tick, tmp_path):
        text = library(name).files["examples/FloatAVR/FloatAVR.ino"]
        text = text.replace("*volume_m3 = NAN;", "*volume_m3 = 0.0f;")
        text = text.replace("*depth_m = NAN;", f"*depth_m = {1.1 if how == 'water' else 0.4}f;")
        text = text.replace("SWITCH false", f"SWITCH {'true' if how == 'switch' else 'false'}")
        words = {"word": ARM, "another word": '-DWORDS="alarm\\n"'}.get(how, "-DNOBODY")
        said = _sketch(library(name), tmp_path, "FloatAVR", text, "-DCLOSES_MS=1000u", words)
        lines = said.splitlines()[6:]
        assert ("# armed" in lines) == (tick is not None)
        if tick is not None:
            before = lines[: lines.index("# armed")]
            assert len(before) == tick
            assert {line.split(",")[3] for line in before} <= {"0.000"}

    @pytest.mark.parametrize("name", ["cascade"], indirect=True)
    @pytest.mark.parametrize("chip", OTHERS)
    def test_a_sketch_of_another_processor(self, name, chip, tmp_path):
        board = "FloatESP32RP2040"
        text = library(name).files[f"examples/{board}/{board}.ino"]
        said = tried_on(library(name), chip, board, text, tmp_path)
        assert "# full buoyancy: depth missing" in said

    @pytest.mark.parametrize("name", ["cascade", "position-pid"], indirect=True)
    def test_the_parts_compile(self, name, tmp_path):
        made = library(name)
        parts = re.findall(r"```cpp\n(.*?)```", made.files["extras/parts.md"], re.DOTALL)
        assert len(parts) == 3
        text = made.files["examples/FloatAVR/FloatAVR.ino"]
        for part in parts[:2]:
            used = text.replace("*depth_m = NAN;", "*depth_m = measured_depth();")
            used = used.replace("(void)voltage;", "drive_bridge(voltage);")
            used = used.replace("(void)volume;", "drive_stepper(volume);")
            begins = "begin_bridge();" if "bridge" in parts[2] else "begin_stepper();"
            used = used.replace("void setup()\n{", f"void setup()\n{{ begin_depth(); {begins}")
            shift = used.index("static void read_sensors")
            program = used[:shift] + part + parts[2] + used[shift:]
            unused = "-Wno-unused-function"
            said = _sketch(made, tmp_path, "FloatAVR", program, unused)
            assert {line.split(",")[1] for line in said.splitlines()[6:]} == {"0.0000"}

    def test_as_it_is_shipped_it_sees_nothing_and_brings_the_vehicle_up(self, name, tmp_path):
        made = library(name)
        text = made.files["examples/FloatAVR/FloatAVR.ino"]
        said = _sketch(made, tmp_path, "FloatAVR", text, ARM).splitlines()
        lines = [line.split(",") for line in said if line[0] not in "#t"]
        assert {line[1].lower() for line in lines} == {"nan"}
        first, p = first_command(name), made.supervisor
        (row,) = [n for n, line in enumerate(said) if line.startswith("# full")]
        assert said[row] == "# full buoyancy: depth missing"
        ticks = row - 7  # five remarks and the header stand above, and that it is armed
        assert ticks == p.volume.blind - 1
        commands = [float(line[3]) for line in lines]
        assert commands[:ticks] == pytest.approx([first] * ticks, abs=1e-9)
        safe = [p.push.surface_command] * (len(commands) - ticks)
        assert commands[ticks:] == pytest.approx(safe, abs=1e-9)
        assert lines[0][-1] == "0"
        assert lines[-1][-1] == "4"


@pytest.mark.usefixtures("gcc")
def test_the_whole_golden_trace_can_be_checked_with_any_compiler(name, tmp_path):
    made = library(name)
    write_library(made, tmp_path)
    sources = [tmp_path / "extras" / "check.c", *(tmp_path / "src").glob("*.c")]
    strict = [flag for flag in STRICT if flag != "-ffp-contract=off"]
    run("gcc", *strict, "-O2", "-I", tmp_path / "src", *sources, "-o", tmp_path / "check", "-lm")
    printed = run(tmp_path / "check", cwd=tmp_path).stdout.decode()
    ticks = 301 + made.supervisor.depth.gap + 15
    assert printed == f"golden trace: equal, {ticks} of {ticks} ticks the same\n"
    golden = tmp_path / "extras" / "golden.csv"
    rows = golden.read_text().splitlines()
    tick, *numbers, _, reason = rows[100].split(",")
    rows[100] = ",".join([tick, *numbers, "0.125", reason])
    *row, reason = rows[-1].split(",")
    rows[-1] = ",".join([*row, "5"])
    golden.write_text("\n".join(rows) + "\n")
    done = subprocess.run([tmp_path / "check", golden], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    first, last, _ = done.stdout.splitlines()
    assert first.startswith("differs at tick 99: ")
    assert last.endswith(", reason 4 instead of 5")


@pytest.mark.usefixtures("cppcheck")
def test_the_library_pleases_cppcheck(name, tmp_path):
    write_library(library(name), tmp_path)
    run(
        "cppcheck",
        "--quiet",
        "--enable=warning,style,performance,portability",
        "--error-exitcode=1",
        "--std=c99",
        "--suppress=missingIncludeSystem",
        tmp_path / "src",
    )


@pytest.mark.usefixtures("arm")
def test_the_library_compiles_for_arm(name, tmp_path):
    write_library(library(name), tmp_path)
    for source in (tmp_path / "src").glob("*.c"):
        flags = [*STRICT, "-mcpu=cortex-m0plus", "-mthumb", "-Os"]
        run("arm-none-eabi-gcc", *flags, "-c", source, "-o", tmp_path / "object.o")


def compile_sketches(made: Library, folder: Path, mcu: str) -> None:
    """Compile two examples of a library by avr-g++, warnings as errors."""
    write_library(made, folder / "library")
    for example_ in ("FloatAVR", "GoldenTrace"):
        sketch = folder / "library" / "examples" / example_
        (folder / f"{example_}.cpp").write_text(
            f'#include <Arduino.h>\n#include "{sketch / example_}.ino"\n'
        )
        run(
            "avr-g++",
            "-std=gnu++11",
            f"-mmcu={mcu}",
            "-Os",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-I",
            ARDUINO,
            "-I",
            folder / "library" / "src",
            "-I",
            sketch,
            "-c",
            folder / f"{example_}.cpp",
            "-o",
            folder / "sketch.o",
        )


@pytest.mark.usefixtures("avr")
def test_the_sketches_compile_for_avr(name, tmp_path):
    compile_sketches(library(name), tmp_path, "atmega328p")


def test_the_files_of_a_library():
    files = library("cascade").files
    assert set(files) == {
        "library.properties",
        "README.md",
        "src/swb_measurement.h",
        "src/swb_arming.h",
        "src/swb_box.h",
        "src/swb_box.c",
        "src/swb_arming.c",
        "src/swb_cascade.h",
        "src/swb_cascade.c",
        "src/swb_controller.h",
        "src/swb_controller.c",
        "src/swb_supervisor.h",
        "src/swb_supervisor_step.h",
        "src/swb_vehicle.h",
        "src/swb_vehicle.c",
        "examples/FloatAVR/FloatAVR.ino",
        "examples/FloatAVR/platformio.ini",
        "examples/FloatESP32RP2040/FloatESP32RP2040.ino",
        "examples/FloatESP32RP2040/platformio.ini",
        "examples/GoldenTrace/GoldenTrace.ino",
        "examples/GoldenTrace/golden.h",
        "examples/HardwareInTheLoop/HardwareInTheLoop.ino",
        "examples/HardwareInTheLoop/hil.h",
        "extras/check.c",
        "extras/golden.csv",
        "extras/parts.md",
    }
    said = dict(line.split("=", 1) for line in files["library.properties"].splitlines())
    assert said["name"] == "Swimbladder feup-em"
    assert said["architectures"] == "*"
    assert said["includes"] == "swb_controller.h"
    assert "#define SWB_TICK_US 300000ul" in files["src/swb_controller.h"]
    assert ".k_pV = 1.002e+06f" in files["src/swb_controller.c"]


def test_the_sources_of_an_earlier_law_go_and_what_is_not_ours_stays(tmp_path):
    write_library(library("cascade"), tmp_path)
    (tmp_path / "src" / "mine.c").write_text("")
    write_library(library("position-pid"), tmp_path)
    sources = {path.name for path in (tmp_path / "src").iterdir()}
    made = {Path(name).name for name in library("position-pid").files if name.startswith("src/")}
    assert sources == made | {"mine.c"}


def test_a_name_of_any_letters_stays_a_name_of_a_library():
    vehicle = paper(name='Flöat "7"\n*/')
    files = firmware(limited(vehicle), duration=3.0).files
    assert "name=Swimbladder Fl_at _7_" in files["library.properties"]
    assert '#define SWB_VEHICLE "Fl_at _7____"' in files["src/swb_controller.h"]


def test_a_vehicle_without_a_controller_is_refused():
    with pytest.raises(InputError, match="has no controller"):
        firmware(limited(paper(controller=None)))


def test_a_controller_that_loses_the_vehicle_gets_no_library():
    from tests.vehicles import TABLE_3

    mad = Controller(law="cascade", sample_time=0.3, parameters=TABLE_3 | {"k_pV": "-2e5 V/m3"})
    with pytest.raises(NoAnswerError, match="golden mission"):
        firmware(limited(paper(controller=mad)), step=(3.0, 1.5), duration=6000.0)


def test_a_supervisor_that_a_healthy_vehicle_does_not_satisfy_gets_no_library():
    vehicle = paper(supervisor=Supervisor(depth_limit="2.5 m"))
    said = r"golden mission .* \(depth limit or too fast to turn\), and nothing is"
    with pytest.raises(NoAnswerError, match=said):
        firmware(limited(vehicle), step=(1.5, 2.4))


def for_depths(*depths: float, supervisor: Supervisor | None = None) -> Vehicle:
    """Return the paper's vehicle whose controller was tuned for depths [m]."""
    vehicle = paper(supervisor=supervisor or Supervisor())
    own = vehicle.controller.model_copy(update={"depths": depths or None})
    return limited(vehicle.model_copy(update={"controller": own}))


class TestTheFirstDepth:
    """The depth that the sketch begins with: where the law was tuned, above the supervisor's."""

    @pytest.mark.parametrize(
        ("depths", "limit", "step"),
        [
            ((), None, (1.5, 3.0)),
            ((0.0, 10.0), None, (1.5, 3.0)),
            ((5.0, 20.0), None, (6.5, 8.0)),
            ((0.0, 2.0), None, (0.6, 2.0)),
            ((), "2 m", (0.6, 2.0)),
            ((5.0, 20.0), "6 m", (5.3, 6.0)),
        ],
    )
    def test_it_is_within(self, depths, limit, step):
        mission, _ = plan_program(for_depths(*depths, supervisor=Supervisor(depth_limit=limit)))
        assert mission[:2] == pytest.approx(step)

    def test_the_sketch_has_it(self):
        made = firmware(for_depths(5.0, 20.0), duration=30.0)
        text = made.files["examples/FloatAVR/FloatAVR.ino"]
        assert "static float reference_depth = 8.0f;" in text
        assert made.golden.reference[0] == 8.0

    @pytest.mark.parametrize("target", [4.9, 20.1])
    def test_another_one_is_refused(self, target):
        said = rf"step: the controller was tuned for 5 to 20 m, .* \(got {target}, .* m\)"
        with pytest.raises(InputError, match=said):
            plan_program(for_depths(5.0, 20.0), (None, target, None))
        plan_program(for_depths(5.0, 20.0), (None, 20.0, None))

    def test_the_supervisor_has_the_last_word(self):
        vehicle = for_depths(5.0, 20.0, supervisor=Supervisor(depth_limit="10 m"))
        with pytest.raises(InputError, match="supervisor turns the vehicle round at 10 m"):
            plan_program(vehicle, (None, 15.0, None))


def test_a_time_that_is_over_is_part_of_the_trace():
    made = firmware(limited(paper(supervisor=Supervisor(time_limit="9 s"))), duration=12.0)
    reasons = [row[4] for row in made.golden.checked]
    assert reasons == [0] * 30 + [Reason.TIME_LIMIT] * (len(reasons) - 30)
