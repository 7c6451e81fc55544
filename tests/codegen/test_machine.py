"""Bounds on stack and time from machine code, against hand-worked ones and the emulated chip."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.codegen import chip, machine
from tests.codegen.build import run
from tests.codegen.pool_day import pool_chip
from tests.codegen.test_eva import library

PAGE = (Path(__file__).parents[2] / "docs/reference/boards.md").read_text(encoding="utf-8")
_BOUND = r"^\| {} \|(?: \d+)? \| \d+ \| \d+ \+ \d+ \| \d+ \| (\d+) \| (\d+) \|$"
_MEASURED = r"^\| {} \|(?: \d+)? \| \d+ \| \d+ \+ (\d+) \| (\d+) \|"
_START = "__ctors_end:\n call main\n1: rjmp 1b\n"
_MAIN = """main:
 push r28
 push r29
 in r28, 0x3d
 in r29, 0x3e
 sbiw r28, 10
 out 0x3e, r29
 out 0x3d, r28
 out 0x1e, r19
{}
 out 0x1e, r1
 ret
"""


def page_row(form: str, name: str) -> tuple[int, int]:
    ((stack, cycles),) = re.findall(form.format(name), PAGE, re.MULTILINE)
    return int(stack), int(cycles)


def assembled(code: str, folder: Path, *, turns: int | None = None) -> machine.Bounds:
    (folder / "own.s").write_text(_START + _MAIN.format(code) + "f: push r16\n pop r16\n ret\n")
    elf = folder / "own.elf"
    run("avr-gcc", "-mmcu=atmega328p", "-nostartfiles", folder / "own.s", "-o", elf)
    program = machine.Program(elf, long_calls=False)
    return machine.bounds_of(program, lambda _: turns)


pytestmark = [pytest.mark.avr, pytest.mark.usefixtures("avr")]


class TestByHand:
    """What a program takes, worked by hand from the instruction set manual."""

    def test_a_call(self, tmp_path):
        # out 1, call 4, push 2, pop 2, ret 4; 2 to main, 12 of its frame, 2 to f, 1 of it
        assert assembled(" call f", tmp_path) == (17, 13)

    def test_the_dearer_way(self, tmp_path):
        # out 1, sbrc 1, then the call of 12; or 3 over it
        assert assembled(" sbrc r19, 0\n call f", tmp_path).cycles == 14
        # out 1, breq 1, adiw 2, rjmp 2; or breq 2
        code = " breq 2f\n adiw r30, 1\n rjmp 3f\n2: nop\n3: nop"
        assert assembled(code, tmp_path).cycles == 1 + 1 + 2 + 2 + 1

    def test_a_loop_that_fills(self, tmp_path):
        # out 1, ldi 1, five times st 2 + dec 1 + brne 2, and once brne 1
        assert assembled(" ldi r24, 5\n2: st X+, r1\n dec r24\n brne 2b", tmp_path).cycles == 28

    def test_loops_in_loops_run_as_often_as_is_said(self, tmp_path):
        code = "2: inc r24\n3: inc r25\n cp r25, r26\n brne 3b\n cp r24, r26\n brne 2b"
        inner = 4 * (1 + 1 + 2)
        assert assembled(code, tmp_path, turns=3).cycles == 1 + 4 * (1 + inner + 1 + 1 + 2) + 1

    @pytest.mark.parametrize(
        ("code", "said"),
        [
            ("2: inc r24\n brne 2b", "a loop without a bound"),
            (" icall", "calls by a pointer"),
            (" call main", "main calls itself"),
            (" breq 2f\n push r16\n2: nop", "bytes deep"),
            (" spm", "nothing known of it"),
            (" out 0x3d, r30", "the stack is moved by r30"),
        ],
    )
    def test_what_has_no_bound_is_refused(self, code, said, tmp_path):
        with pytest.raises(ValueError, match=said):
            assembled(code, tmp_path)


@pytest.mark.prove
def test_the_chip_stays_within_the_bounds_whatever_it_sees(tmp_path):
    """Any bits, then a step; the deepest chain of calls is one of NaN, and is reached."""
    made, mcu = library("cascade"), "atmega328p"
    found = machine.bounds(made, tmp_path / "bound", mcu)
    on_chip = chip.vehicle(made, tmp_path / "flown", mcu)
    rng = np.random.default_rng(7)
    for _ in range(1500):
        numbers = rng.integers(0, 2**32, 5, np.uint32).view("f4")
        leak, lost = rng.random() < 0.01, int(rng.integers(0, 3))
        on_chip.answer(*numbers[:4], leak, lost, numbers[4])
    flight, _ = chip.fly_supervised(made, on_chip, duration=60.0)
    stack = on_chip.close()
    assert max(flight.cycles) <= found.cycles
    assert found.stack - 2 <= stack <= found.stack
    assert max(flight.cycles) > 20_000


@pytest.mark.prove
def test_so_it_does_in_a_pool_day(tmp_path):
    made, mcu = machine.library(machine.POOL_DAY), "atmega328p"
    found = machine.bounds(made, tmp_path / "bound", mcu)
    on_chip = pool_chip(made, tmp_path / "flown", mcu)
    rng = np.random.default_rng(7)
    for n in range(1500):
        numbers = rng.integers(0, 2**32, 5, np.uint32).view("f4")
        numbers = numbers if n % 3 else (1.5, 0.1, 1e-5, 12.0, 0.0)  # it goes on at times
        on_chip.answer(*numbers, float(rng.integers(0, 3)), 1.0)
    stack = on_chip.close()
    assert max(on_chip.cycles) <= found.cycles
    assert found.stack - 10 < stack <= found.stack


def _is_on_the_page(name: str, mcu: str, folder: Path) -> None:
    """A row is of the small chip: "at most 8 B of stack and 5 % of cycles more" on the other."""
    found = machine.bounds(machine.library(name), folder, mcu)
    stack, cycles = page_row(_BOUND, name)
    if mcu != "atmega328p":
        stack, cycles = stack + 8, round(1.05 * cycles)
    assert found.stack == pytest.approx(stack, rel=0.1), "python -m tests.codegen.machine"
    assert found.cycles == pytest.approx(cycles, rel=0.1), "python -m tests.codegen.machine"


@pytest.mark.parametrize(
    "name", ["cascade", pytest.param(machine.POOL_DAY, marks=pytest.mark.prove)]
)
def test_the_bounds_of_the_paper_s_law_and_its_pool_day_are_on_the_page(name, tmp_path):
    _is_on_the_page(name, "atmega328p", tmp_path)


@pytest.mark.prove
@pytest.mark.parametrize("mcu", chip.MCUS)
@pytest.mark.parametrize("name", machine.NAMES)
def test_the_bounds_of_every_law_are_on_the_page(name, mcu, tmp_path):
    _is_on_the_page(name, mcu, tmp_path)


@pytest.mark.parametrize("name", machine.NAMES)
def test_what_was_measured_is_within_the_bounds(name):
    stack, cycles = page_row(_BOUND, name)
    measured_stack, measured_cycles = page_row(_MEASURED, name)
    assert stack - 10 < measured_stack <= stack
    assert measured_cycles < cycles
    assert cycles < 0.5 * 300_000 * 16  # of the shortest tick, 300 ms at 16 MHz


def _operands() -> np.ndarray:
    """Numbers that are hard on a loop: each exponent's ends, subnormals, bits alone and in rows."""
    parts = [0, 1, 2, 3, 0x400000, 0x7FFFFF, 0x7FFFFE, 0x555555, 0x000100, 0x010000]
    exponents = [0, 1, 2, 8, 24, 100, 126, 127, 128, 134, 150, 151, 200, 253, 254, 255]
    bits = [e << 23 | part for e in exponents for part in parts]
    return np.array(bits, np.uint32).view("f4")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("routine", "operation", "share"),
    [
        ("__addsf3", "in.numbers[0] + in.numbers[1]", 0.5),
        ("__subsf3", "in.numbers[0] - in.numbers[1]", 0.5),
        ("__mulsf3", "in.numbers[0] * in.numbers[1]", 0.5),
        ("__divsf3", "in.numbers[0] / in.numbers[1]", 0.5),
        ("sqrt", "sqrtf(in.numbers[0])", 0.5),
        ("__floatsisf", "(float)in.bits[0]", 0.5),
        ("__fixunssfsi", "(float)(uint32_t)in.numbers[0]", 0.5),
    ],
)
def test_no_number_takes_the_arithmetic_longer_than_its_loops_allow(
    routine, operation, share, tmp_path
):
    """Against the emulator; and the bounds are not far above what some numbers take."""
    flag = [f"-DOPERATION={operation}"]
    source = chip.HERE / "operations.c"
    on_chip = chip.Chip(tmp_path, "atmega328p", [source], inputs=2, outputs=1, flags=flag)
    program = machine.Program(tmp_path / "atmega328p.elf", long_calls=False)
    assert program.named(routine)
    bound = machine.bounds_of(program, lambda _: None).cycles
    values = _operands()
    rng = np.random.default_rng(3)
    pairs = [(a, b) for a in values for b in rng.choice(values, 12)]
    pairs += [tuple(pair) for pair in rng.integers(0, 2**32, (500, 2), np.uint32).view("f4")]
    for a, b in pairs:
        on_chip.answer(a, b)
        on_chip.answer(-b, a)
    on_chip.close()
    most = max(on_chip.cycles)
    assert share * bound < most <= bound
