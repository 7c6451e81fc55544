"""The very sketches with Arduino's own core: compiled and linked, and run as a Uno and a Mega."""

import re

import pytest

from swimbladder.codegen.library import firmware
from swimbladder.control.registry import LAWS
from swimbladder.io.config import load_vehicle
from swimbladder.vehicle import Supervisor
from tests.codegen import core
from tests.codegen.test_library import library
from tests.vehicles import DIVES, FLOATS, limited, paper

pytestmark = [pytest.mark.avr, pytest.mark.usefixtures("avr", "arduino_core")]


@pytest.fixture(scope="module", params=core.BOARDS)
def board(request, tmp_path_factory):
    return request.param, core.core(request.param, tmp_path_factory.mktemp("core"))


def filled(text: str) -> str:
    """Return a sketch whose functions do something that no compiler leaves out."""
    for old, new in (
        ("*depth_m = NAN;", "*depth_m = 0.01f * (float)analogRead(0);"),
        ("*volume_m3 = NAN;", "*volume_m3 = 1e-6f * (float)analogRead(1);"),
        ("(void)voltage;", "analogWrite(3, (int)(255.0f * fabsf(voltage) / 12.0f));"),
        ("(void)volume;", "analogWrite(3, (int)(1e6f * fabsf(volume)));"),
        ("return NAN; // (pressure", "return 0.01f * (float)analogRead(0); // (pressure"),
    ):
        text = text.replace(old, new)
    return text


def test_the_golden_trace_is_equal_on_the_board(board, tmp_path):
    mcu, made_core = board
    made = library("cascade")
    text = made.files["examples/GoldenTrace/GoldenTrace.ino"]
    elf = core.build(made, tmp_path, mcu, "GoldenTrace", text, made_core)
    said = core.execute(elf, mcu, 700)
    assert "golden trace: equal, 100 of 100 ticks the same; the slowest took" in said
    (slowest,) = map(int, re.findall(r"took (\d+) us", said))
    assert 1000 < slowest < 5000


@pytest.mark.parametrize("board", ["atmega328p"], indirect=True)
@pytest.mark.promise("disarmed-holds")
@pytest.mark.promise("stays-armed")
@pytest.mark.promise("black-box")
def test_a_sketch_logs_is_armed_and_reports_after_a_watchdog_why_it_came_up(board, tmp_path):
    """Its depth sensor fails, then hangs the loop; the watchdog bites, and the box is printed."""
    mcu, made_core = board
    made = firmware(limited(paper(supervisor=Supervisor(patience="0.9 s"))), duration=30.0)
    text = made.files["examples/FloatAVR/FloatAVR.ino"]
    sensor = (
        "if (ticks == 10u && cause != 8u) { for (;;) {} }"
        "*depth_m = ticks > 5u ? NAN : 0.5f; *volume_m3 = volume;"
    )
    text = text.replace("*depth_m = NAN;", sensor).replace("*volume_m3 = NAN;", "")
    before = "extern uint8_t cause;\nstatic float volume;\nstatic void read_sensors"
    text = text.replace("static void read_sensors", before)
    text = text.replace("static uint8_t cause;", "uint8_t cause;")
    text = text.replace("(void)voltage;", "volume += 1e-6f * voltage; // 3.33e-6 m3/s/V")
    elf = core.build(made, tmp_path, mcu, "FloatAVR", text, made_core)
    first, second = core.execute(elf, mcu, 7600, 700, "arm").split("# black box: ")[1:]
    assert first.startswith("none 0x0, starts while armed: 0")
    assert "# disarmed: a switch, the word arm, or 1 m of water for 3 s arms it" in first
    rows = [line.split(",") for line in first.splitlines() if re.match(r"\d+\.\d{3},", line)]
    armed = first[: first.index("# armed\n")].count("\n0.")
    assert armed == 3
    assert {row[3] for row in rows[:armed]} <= {"0.000"}
    assert "# full buoyancy: depth missing" in first
    assert rows[-1][3:] == ["12.000", "3.000", "4"]
    assert second.startswith("depth missing 0x8, starts while armed: 1, cause of the last one: 8")
    assert "# box: " in second
    assert "# armed before the reset" in second
    assert "# full buoyancy: restarted" in second


def fits(name, board, folder):
    """With sensors and motor: law, supervisor, black box, Serial."""
    mcu, made_core = board
    if name in FLOATS:
        target, duration = DIVES[name]
        made = firmware(limited(load_vehicle(FLOATS[name])), step=(0.0, target), duration=duration)
    else:
        made = library(name)
    text = filled(made.files["examples/FloatAVR/FloatAVR.ino"])
    core.build(made, folder, mcu, "FloatAVR", text, made_core)


@pytest.mark.parametrize(  # the least, the largest that fits an Uno, and the largest
    ("name", "board"),
    [("cascade", "atmega328p"), ("adrc", "atmega328p"), ("sea-cascade", "atmega2560")],
    indirect=["board"],
)
def test_a_sketch_fits_its_board(name, board, tmp_path):
    fits(name, board, tmp_path)


@pytest.mark.prove
@pytest.mark.parametrize("name", [*LAWS])
def test_every_law_fits_the_boards_that_the_readme_names(name, board, tmp_path):
    """`sea-cascade` takes more than an Uno has, which is said as it is linked."""
    if (name, board[0]) == ("sea-cascade", "atmega328p"):
        with pytest.raises(AssertionError):
            fits(name, board, tmp_path)
    else:
        fits(name, board, tmp_path)
