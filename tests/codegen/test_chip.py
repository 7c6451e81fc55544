"""Laws on emulated AVRs (avr-gcc, simavr), in closed loop with the plant, against the twin."""

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest

from swimbladder.codegen.library import firmware
from swimbladder.codegen.twin import twin
from swimbladder.control.law import Measurement, from_numbers
from swimbladder.control.registry import LAWS
from swimbladder.io.config import load_vehicle
from tests.codegen import chip
from tests.codegen.laws import bits, random_calls, split, twin_of
from tests.codegen.odd import ODD, OddParameters, OddState
from tests.codegen.test_library import library
from tests.vehicles import EACH, limited

pytestmark = [pytest.mark.avr, pytest.mark.usefixtures("avr")]


@pytest.fixture(params=EACH, scope="module")
def name(request) -> str:
    return request.param


@pytest.mark.parametrize("mcu", chip.MCUS)
def test_the_papers_mission_is_flown_to_the_bit_on_the_chip(mcu, tmp_path):
    made = firmware(limited(load_vehicle("feup-em")))
    on_chip = chip.controller(made, tmp_path, mcu)
    flight = chip.fly(made, on_chip)
    stack = on_chip.close()
    assert flight.ticks == 1335
    assert flight.unequal == 0
    # SciPy's LSODA in double precision: 3.016 m after 400 s (tests/cli/test_simulate.py).
    assert flight.final_depth == pytest.approx(3.016, abs=5e-4)
    assert on_chip.size.flash < 8192
    assert on_chip.size.variables + stack < 300
    assert max(flight.cycles) < 16_000  # a millisecond at 16 MHz
    assert min(flight.cycles) > 500  # the clock that says so does tick


def test_a_blind_while_is_met_to_the_bit_on_the_chip(name, tmp_path):
    made = library(name)
    on_chip = chip.controller(made, tmp_path, "atmega328p")
    flight = chip.fly(made, on_chip, duration=150 * made.tick_s, blind=range(40, 60))
    assert on_chip.close() > 0
    assert flight.unequal == 0
    assert flight.ticks > 100
    page = (Path(__file__).parents[2] / "docs/reference/boards.md").read_text(encoding="utf-8")
    (said,) = re.findall(rf"^\| {name} \| (\d+) \|", page, re.MULTILINE)
    assert on_chip.size.flash == pytest.approx(int(said), rel=0.2), "python -m tests.codegen.chip"


def test_any_numbers_give_the_same_bits_on_the_chip(name, tmp_path):
    """NaN, infinities, subnormals: the floating point of avr-libc, in software, against numpy."""
    law = twin_of(name)
    on_chip = chip.frames(LAWS[name], tmp_path, "atmega328p")
    for frame in random_calls(name, 300):
        given, state, seen, reference = split(law, frame)
        expected = law.initial(given, seen, reference), law.step(given, state, seen, reference)
        assert bits(on_chip.answer(*frame)) == bits(*expected)
    on_chip.close()


def test_every_construct_gives_the_same_bits_on_the_chip(tmp_path):
    """Among them the square root, of the numbers that a float32 can be."""
    rng = np.random.default_rng(2)
    law = twin(ODD)
    on_chip = chip.frames(ODD, tmp_path, "atmega328p")
    for n in range(600):
        frame = (np.round(rng.uniform(-4.0, 4.0, 12) * 8) / 8).astype("f4")
        if n % 2:
            at = rng.random(12) < 0.3
            frame[at] = rng.integers(0, 2**32, at.sum(), np.uint32).view("f4")
        most, count = (int(rng.choice([k, 9 + k, 65535 - k])) for k in rng.integers(0, 9, 2))
        p = from_numbers(OddParameters, (*frame[:4], most))
        s = from_numbers(OddState, (*frame[4:7], count, bool(n % 3)))
        m = Measurement(*frame[7:11])
        expected = law.initial(p, m, frame[11]), law.step(p, s, m, frame[11])
        assert bits(on_chip.answer(p, s, m, frame[11])) == bits(*expected)
    on_chip.close()


def square_root(p, state, measurement, reference):
    return math.sqrt(reference), state, math.copysign(p.slope.k, measurement.depth)


def test_the_square_root_is_rounded_rightly_on_the_chip(tmp_path):
    law = dataclasses.replace(ODD, name="root", step=square_root)
    rng = np.random.default_rng(3)
    on_chip = chip.frames(law, tmp_path, "atmega328p")
    for x in rng.integers(0, 2**31, 2000, np.uint32).view("f4"):
        said = on_chip.answer(*[0] * 14, x)[5]
        with np.errstate(invalid="ignore"):
            assert bits(said) == bits(np.sqrt(np.float64(x)))
    on_chip.close()


def test_a_chip_that_says_something_else_is_noticed(tmp_path):
    made = library("cascade")
    on_chip = chip.controller(made, tmp_path, "atmega328p")
    beside = chip.twin_of(made)
    beside.parameters = beside.parameters._replace(k_pz=np.nextafter(np.float32(-1.043e-4), 0))
    said = [
        (on_chip.answer(depth, 1e-6, 1.6)[0], beside.tick(depth, 1e-6, 1.6))
        for depth in np.linspace(1.5, 1.7, 50)
    ]
    on_chip.close()
    assert any(bits(a) != bits(b) for a, b in said)
