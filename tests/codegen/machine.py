"""Bounds on the stack and the time of a program for AVR, from its machine code alone.

What avr-objdump prints is followed on every path. The stack is bounded by the deepest chain of
calls, with what each function pushes and takes for its frame; recursion and calls by pointers are
refused. The time between two marks is bounded by the longest path: the cycles of the AVR
Instruction Set Manual (Microchip DS40002198, AVRe+), every condition taken the dearer way, and
every loop run as often as it can be. For loops of C that is what their `for` says, read beside the
code; for those of avr-libc's arithmetic it stands in `LOOPS`. It is a bound for any numbers, not a
time that occurs. ``python -m tests.codegen.machine [LAW...]`` prints a table, with a pool day.
"""

import re
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from swimbladder.codegen.library import Library, firmware
from swimbladder.control.law import leaf_names
from swimbladder.control.registry import LAWS
from swimbladder.io.config import load_vehicle
from tests.codegen import chip
from tests.codegen.build import run
from tests.codegen.laws import controlled
from tests.codegen.pool_day import library as pool_library
from tests.codegen.pool_day import pool_chip
from tests.vehicles import FLOATS, limited

POOL_DAY = "pool day"
NAMES = (*LAWS, POOL_DAY)
"""What the table has."""

_PLACE = re.compile(r"^(/.*\.[ch]):(\d+)")
_LINE = re.compile(r"^ *([0-9a-f]+):\t((?:[0-9a-f]{2} )+) *\t([a-z]+)\t?([^;]*)")
_LABEL = re.compile(r"^([0-9a-f]{8}) <(.*)>:")
_TWO, _ONE, _BRANCHES, _SKIPS = (
    frozenset(names.split())
    for names in (
        "adiw sbiw mul muls mulsu fmul fmuls fmulsu ld ldd st std lds sts push pop sbi cbi",
        "add adc sub subi sbc sbci and andi or ori eor com neg inc dec tst clr ser cp cpc cpi lsl"
        " lsr rol ror asr swap bst bld sec clc sez clz set clt sei cli mov movw ldi in out nop",
        "breq brne brcs brcc brsh brlo brmi brpl brge brlt brhs brhc brts brtc brvs brvc",
        "cpse sbrc sbrs sbic sbis",
    )
)
_SP_LOW, _MARK = "0x3d", "0x1e"  # as `out` has them; GPIOR0


class Step(NamedTuple):
    """An instruction."""

    at: int
    size: int
    name: str
    words: tuple[str, ...]

    @property
    def target(self) -> int | None:
        """Where it goes to, or calls."""
        word = self.words[-1] if self.words else ""
        if self.name in ("jmp", "call"):
            return int(word, 16)
        if self.name in ("rjmp", "rcall", *_BRANCHES):
            return self.at + 2 + int(word[1:], 0)
        return None


class Program:
    """The instructions of an ELF, and where its functions begin.

    long_calls: what a function returns to takes 3 bytes, as on an ATmega2560.
    """

    def __init__(self, elf: Path, *, long_calls: bool) -> None:
        self.steps: dict[int, Step] = {}
        self.names: dict[int, str] = {}
        self.back = 3 if long_calls else 2
        self.source: dict[int, str] = {}
        texts: dict[str, list[str]] = {}
        text = ""
        for line in run("avr-objdump", "-dl", elf, text=True).stdout.splitlines():
            if found := _LABEL.match(line):
                self.names[int(found[1], 16)] = found[2]
                text = ""
            elif found := _PLACE.match(line):
                if found[1] not in texts:
                    path = Path(found[1])
                    texts[found[1]] = path.read_text().splitlines() if path.exists() else []
                n = int(found[2])
                text = texts[found[1]][n - 1] if n <= len(texts[found[1]]) else ""
            elif found := _LINE.match(line):
                words = tuple(w.strip() for w in found[4].split(",") if w.strip())
                size = len(found[2].split())
                at = int(found[1], 16)
                self.steps[at] = Step(at, size, found[3], words)
                self.source[at] = text

    def named(self, name: str) -> int:
        """Return where a function begins."""
        (at,) = (at for at, own in self.names.items() if own == name)
        return at

    def name_of(self, at: int) -> str:
        """Return the label that an address stands below."""
        return self.names[max(place for place in self.names if place <= at)].split(".")[0]

    def next(self, at: int) -> list[tuple[int, int]]:
        """Return where an instruction goes on, with the cycles that it takes, calls left out."""
        step = self.steps[at]
        after, name = at + step.size, step.name
        if name in ("ret", "reti"):
            return []
        if name in ("rjmp", "jmp"):
            assert step.target is not None
            return [(step.target, 2 if name == "rjmp" else 3)]
        if name in _BRANCHES:
            assert step.target is not None
            return [(after, 1), (step.target, 2)]
        if name in _SKIPS:
            over = self.steps[after].size
            return [(after, 1), (after + over, 1 + over // 2)]
        return [(after, self.cycles(step))]

    def cycles(self, step: Step) -> int:
        """Return the cycles of an instruction, of a call without those of what it calls."""
        long = self.back - 2
        if step.name in ("call", "rcall"):
            return (4 if step.name == "call" else 3) + long
        if step.name in ("ret", "reti"):
            return 4 + long
        if step.name in ("lpm", "elpm"):
            return 3
        if step.name in ("icall", "eicall", "ijmp", "eijmp"):
            raise ValueError(f"{step.at:x}: calls by a pointer")
        if step.name in _TWO:
            return 2
        if step.name in _ONE:
            return 1
        raise ValueError(f"{step.at:x}: {step.name} {', '.join(step.words)}: nothing known of it")

    def straight(self, step: Step) -> bool:
        """Say whether an instruction always goes on with the one after it, and calls none."""
        return step.target is None and step.name not in (*_SKIPS, "ret", "reti")

    def calls(self, at: int) -> int | None:
        """Return what an instruction calls; a call of the next one only makes room on the stack."""
        step = self.steps[at]
        if step.name not in ("call", "rcall") or step.target == at + step.size:
            return None
        return step.target

    def reached(self, start: int, end: int | None = None) -> dict[int, list[tuple[int, int]]]:
        """Return the instructions from one on, up to another, each with where it goes on."""
        found: dict[int, list[tuple[int, int]]] = {}
        todo = [start]
        while todo:
            at = todo.pop()
            if at not in found:
                found[at] = [] if at == end else self.next(at)
                todo += [place for place, _ in found[at]]
        return found


class Stack:
    """The most bytes that a function takes on the stack, with all that it calls."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self._known: dict[int, int] = {}
        self._open: list[int] = []

    def most(self, start: int) -> int:
        """Return the bytes, what the function returns to left out."""
        if start in self._known:
            return self._known[start]
        if start in self._open:
            raise ValueError(f"{self.program.name_of(start)} calls itself")
        self._open.append(start)
        graph = self.program.reached(start)
        at_entry: dict[int, tuple[int, int]] = {
            start: (0, 0)
        }  # depth, and that of the frame pointer
        todo, most = [start], 0
        while todo:
            at = todo.pop()
            depth, frame = self._after(at, *at_entry[at])
            most = max(most, depth)
            called = self.program.calls(at)
            if called is not None:
                most = max(most, depth + self.program.back + self.most(called))
            for place, _ in graph[at]:
                if place not in at_entry:
                    at_entry[place] = depth, frame
                    todo.append(place)
                elif at_entry[place][0] != depth:
                    raise ValueError(f"{place:x}: {at_entry[place][0]} or {depth} bytes deep")
        self._open.pop()
        self._known[start] = most
        return most

    def _after(self, at: int, depth: int, frame: int) -> tuple[int, int]:
        """Return (depth, that of r29:r28) after an instruction."""
        step = self.program.steps[at]
        if step.name == "push":
            return depth + 1, frame
        if step.name == "pop":
            return depth - 1, frame
        if step.name in ("call", "rcall") and step.target == at + step.size:
            return depth + self.program.back, frame
        if step.name == "in" and step.words == ("r28", _SP_LOW):
            return depth, depth
        if step.name in ("sbiw", "adiw") and step.words[0] == "r28":
            by = int(step.words[1], 0)
            return depth, frame + (by if step.name == "sbiw" else -by)
        if step.name == "subi" and step.words[0] == "r28":
            high = self.program.steps[at + step.size]  # sbci r29, N; or sbc r29, r1, which is 0
            more = int(high.words[1], 0) if high.name == "sbci" else 0
            by = int(step.words[1], 0) + 256 * more
            return depth, frame + (by if by < 0x8000 else by - 0x10000)
        if step.name == "out" and step.words == (_SP_LOW, "r28"):
            return frame, frame
        if step.name == "out" and step.words[0] == _SP_LOW:
            raise ValueError(f"{at:x}: the stack is moved by {step.words[1]}")
        return depth, frame


LOOPS: Mapping[str, tuple[int, ...]] = {
    "__addsf3x": (
        5,
        7,
        40,
    ),  # bytes and bits of an exponent's difference below 32; 5 bytes of a sum
    # Two numbers of 24 bits; a quotient below the normal ones; bits of a byte. Such a quotient is 0
    # at once from 2^-25 to 2^-128 of them, but below that, to 2^-151, shifted out bit by bit.
    "__divsf3_pse": (25, 25, 152, 8),
    "__mulsf3_pse": (48, 24),  # a product of 48 bits; a subnormal one, of 2^-125 at least
    "sqrt": (24, 2),  # bits of the root; two more
    "__fp_norm2": (24,),  # bits of a subnormal number
    "__floatsisf": (8, 8),  # bits of the highest byte
    "__fixunssfsi": (9, 3, 7),  # 24 bits up to 32; bytes and bits of an exponent's difference
}
"""How often the loops of avr-libc's arithmetic run at most, by label, in the code's order."""

ENTERED: Mapping[str, int] = {"__divsf3_pse": 1}
"""How often one runs that a call enters at its head: a bit of a quotient, in place of a byte."""


class Time:
    """The most cycles between two places, with all that is called there.

    bound: how often a loop's `for` says that it runs, None where a line is none.
    """

    def __init__(self, program: Program, bound: Callable[[str], int | None]) -> None:
        self.program, self.bound = program, bound
        self._known: dict[int, int] = {}
        entries = {*program.names, *(c for at in program.steps if (c := program.calls(at)))}
        self._loops: dict[str, list[int]] = {}
        for entry in sorted(entries):
            for part in components(program.reached(entry)):
                label = program.name_of(min(part))
                own = self._loops.setdefault(label, [])
                if len(part) > 1 and min(part) not in own:
                    own.append(min(part))
                    own.sort()

    def most(self, start: int, end: int | None = None) -> int:
        """Return the cycles from an instruction to another, or to the end of its function."""
        if end is None and start in self._known:
            return self._known[start]
        graph = self.program.reached(start, end)
        most = self._longest(graph, start)
        if end is None:
            self._known[start] = most
        return most

    def _own(self, at: int) -> int:
        """Return the cycles of what an instruction calls, and of one that returns."""
        called = self.program.calls(at)
        step = self.program.steps[at]
        most = self.most(called) if called is not None else 0
        return most + (self.program.cycles(step) if step.name in ("ret", "reti") else 0)

    def _longest(self, graph: Mapping[int, list[tuple[int, int]]], *starts: int) -> int:
        """Return the most cycles of a path from one of the starts on; loops are within."""
        most: dict[int, int] = {}  # from a part's first instruction on
        for part in components(graph):  # what a part goes on to comes before it
            inside = set(part)
            onward = max(
                (cost + most[to] for at in part for to, cost in graph[at] if to not in inside),
                default=0,
            )
            if len(part) == 1 and all(to != part[0] for to, _ in graph[part[0]]):
                most[part[0]] = self._own(part[0]) + onward
                continue
            heads = {to for at in graph if at not in inside for to, _ in graph[at] if to in inside}
            heads |= inside & set(starts)
            again = max(cost for at in part for _, cost in graph[at])
            body = {
                at: [(to, c) for to, c in graph[at] if to in inside and to not in heads]
                for at in part
            }
            label = self.program.name_of(min(part))
            entered = set(starts) == {min(part)} and label in ENTERED
            turns = ENTERED[label] if entered else self._turns(part)
            once = sum(self._longest(body, head) + again for head in heads)
            for at in part:
                most[at] = turns * once + onward
        return max(most[start] for start in starts)

    def _turns(self, part: list[int]) -> int:
        """Return how often a loop's head is reached at most."""
        label = self.program.name_of(min(part))
        if label in LOOPS:
            return LOOPS[label][self._loops[label].index(min(part))]
        if (copied := self._copied(sorted(part))) is not None:
            return copied
        said = [n for at in part if (n := self.bound(self.program.source[at])) is not None]
        if not said:
            raise ValueError(f"{min(part):x} in {label}: a loop without a bound")
        return max(said) + 1

    def _copied(self, part: list[int]) -> int | None:
        """Return how many bytes a loop copies, or fills, that counts down what `ldi` has set."""
        steps = [self.program.steps[at] for at in part]
        if {step.name for step in steps[:-2]} - {"ld", "st"}:
            return None
        if [step.name for step in steps[-2:]] != ["dec", "brne"]:
            return None
        counter = int(steps[-2].words[0][1:])
        for at in sorted((at for at in self.program.steps if at < part[0]), reverse=True)[:20]:
            step = self.program.steps[at]
            if not self.program.straight(step):
                return None
            if step.name == "ldi" and step.words[0] == f"r{counter}":
                return int(step.words[1], 0)
            if step.words[:1] in ((f"r{counter}",), (f"r{counter & ~1}",)):
                return None
        return None


class Bounds(NamedTuple):
    """What a program takes at most: bytes of stack, cycles between its two marks."""

    stack: int
    cycles: int


def bounds(made: Library, folder: Path, mcu: str) -> Bounds:
    """Return what a library takes at most, in the program that `chip` runs.

    That is law and supervisor, or of a library with a pool day the day and its supervisor.
    """
    program_of = chip.vehicle if made.pool is None else pool_chip
    program_of(made, folder, mcu, "-g").close()
    program = Program(folder / f"{mcu}.elf", long_calls=mcu == "atmega2560")
    numbers = len(leaf_names(made.law.state))

    def turns(text: str) -> int | None:
        if found := re.search(r"for \(int \w+ = 0; \w+ < (\d+);", text):
            return int(found[1])
        return numbers if "at < sizeof *state; at += sizeof(float)" in text else None

    return bounds_of(program, turns)


def bounds_of(program: Program, turns: Callable[[str], int | None]) -> Bounds:
    """Return what a program takes at most, from where the chip begins; its marks are in `main`."""
    steps = (program.steps[at] for at in program.reached(program.named("main")))
    marks = {
        step.words[1] == "r1": step.at
        for step in steps
        if step.name == "out" and step.words[0] == _MARK
    }
    assert len(marks) == 2
    stack = Stack(program).most(program.named("__ctors_end"))
    return Bounds(stack, Time(program, turns).most(marks[False], marks[True]))


def components(graph: Mapping[int, list[tuple[int, int]]]) -> list[list[int]]:
    """Return the strongly connected parts of a graph, each after those it leads to (Tarjan)."""
    number: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    on_stack: set[int] = set()
    found: list[list[int]] = []
    for root in graph:
        work = [] if root in number else [root]
        rests = {}
        while work:
            at = work[-1]
            if at not in number:
                number[at] = low[at] = len(number)
                stack.append(at)
                on_stack.add(at)
                rests[at] = iter(graph[at])
            to = next((to for to, _ in rests[at] if to not in number or to in on_stack), None)
            if to is None:
                work.pop()
                if work:
                    low[work[-1]] = min(low[work[-1]], low[at])
                if low[at] == number[at]:
                    place = stack.index(at)
                    found.append(stack[place:])
                    on_stack -= {*stack[place:]}
                    del stack[place:]
            elif to in number:
                low[at] = min(low[at], number[to])
            else:
                work.append(to)
    return found


def library(name: str) -> Library:
    """Return a law's library, or that of a pool day."""
    if name == POOL_DAY:
        return pool_library()
    floats = LAWS[name].command == "volume change"
    return firmware(limited(load_vehicle(FLOATS[name]) if floats else controlled(name)))


def report(laws: Sequence[str]) -> str:
    """Return a table of the bounds for each law, or a pool day, under a supervisor on each chip."""
    rows = [
        "| law + supervisor | chip | stack, at most | cycles per tick, at most | ms at 16 MHz |",
        "|---|---|---|---|---|",
    ]
    for name in laws:
        made = library(name)
        for mcu in chip.MCUS:
            with tempfile.TemporaryDirectory() as folder:
                found = bounds(made, Path(folder), mcu)
            model = re.sub("atmega", "ATmega", mcu).replace("8p", "8P")
            time = f"{found.cycles / 16e3:.1f}"
            rows.append(f"| {name} | {model} | {found.stack} B | {found.cycles} | {time} |")
    return "\n".join(rows)


if __name__ == "__main__":
    print(report(sys.argv[1:] or NAMES))
