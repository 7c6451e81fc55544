"""A law on an emulated AVR: compiled by avr-gcc, run by simavr, spoken to over its UART.

``python -m tests.codegen.chip [LAW...]`` prints what each law takes there, and whether its
commands over a whole mission are those of the float32 twin to the bit.
"""

import math
import re
import struct
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swimbladder.codegen.c99 import c_law
from swimbladder.codegen.library import Library, firmware, write_library
from swimbladder.codegen.subset import read_law
from swimbladder.codegen.twin import ControllerTwin, VehicleTwin, twin
from swimbladder.control.law import Law, Measurement
from swimbladder.control.registry import LAWS
from swimbladder.control.supervisor import SUPERVISOR, Watched
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop import simulate
from tests.codegen.build import run, write
from tests.codegen.laws import bits, controlled, laid_out, layout, scalars_of
from tests.vehicles import FLOATS, limited

HERE = Path(__file__).parent / "simavr"
MCUS = ("atmega328p", "atmega2560")
_FLAGS = (  # -Os to --gc-sections: as the Arduino core for AVR builds a sketch
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-Os",
    "-flto",
    "-ffunction-sections",
    "-fdata-sections",
    "-fuse-linker-plugin",
    "-Wl,--gc-sections",
)


class Size(NamedTuple):
    """Bytes that a program takes."""

    flash: int
    variables: int


class Chip:
    """A program on an emulated chip; `answer` sends a frame and returns what comes back.

    inputs, outputs: the types of their numbers as numpy has them, or how many floats.
    """

    def __init__(
        self,
        folder: Path,
        mcu: str,
        sources: Sequence[Path],
        *,
        inputs: Sequence[str] | int,
        outputs: Sequence[str] | int,
        flags: Sequence[str] = (),
    ) -> None:
        self._takes, self._gives = _packed(inputs), _packed(outputs)
        folder.mkdir(parents=True, exist_ok=True)
        elf, host = folder / f"{mcu}.elf", folder / "host"
        includes = [word for source in sources for word in ("-I", source.parent)]
        run("avr-gcc", *_FLAGS, f"-mmcu={mcu}", *flags, *includes, *sources, "-o", elf, "-lm")
        if not host.exists():
            run(
                "gcc", "-O2", "-Wall", "-Wextra", "-Werror", HERE / "host.c", "-o", host, "-lsimavr"
            )
        self.size = size_of(elf)
        words = [host, elf, mcu, self._takes.itemsize, self._gives.itemsize, self.size.variables]
        self._process = subprocess.Popen(
            [str(word) for word in words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self.cycles: list[int] = []

    def answer(self, *values: Any) -> Any:
        """Return the numbers that the chip answers a frame of numbers with."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(laid_out(self._takes, *values))
        self._process.stdin.flush()
        got = self._process.stdout.read(self._gives.itemsize + 4)
        assert len(got) == self._gives.itemsize + 4, self._process.communicate()[1]
        self.cycles.append(struct.unpack("<I", got[-4:])[0])
        return np.frombuffer(got[:-4], self._gives)[0].tolist()

    def close(self) -> int:
        """Stop the chip; return the most bytes that its stack took."""
        _, said = self._process.communicate()
        assert self._process.returncode == 0, said
        return int(said.split()[-1])


def _packed(scalars: Sequence[str] | int) -> np.dtype[Any]:
    kinds = ["<f4"] * scalars if isinstance(scalars, int) else scalars
    return np.dtype([(f"x{n}", kind) for n, kind in enumerate(kinds)])


def size_of(elf: Path) -> Size:
    """Return flash (code, constants, first values) and RAM of variables, as avr-size has them."""
    text, data, bss = map(int, run("avr-size", elf, text=True).stdout.splitlines()[1].split()[:3])
    return Size(flash=text + data, variables=data + bss)


def controller(made: Library, folder: Path, mcu: str) -> Chip:
    """Return a chip that runs a library's controller: (depth, volume, reference) -> command."""
    write_library(made, folder / "library")
    sources = sorted((folder / "library" / "src").glob("*.c"))
    first = f"-DFIRST={np.float32(_first(made))!s}f"
    return Chip(folder, mcu, [*sources, HERE / "controller.c"], inputs=3, outputs=1, flags=[first])


def vehicle(made: Library, folder: Path, mcu: str, *flags: str) -> Chip:
    """Return a chip that runs law and supervisor: what is seen and a reference -> command, bits."""
    write_library(made, folder / "library")
    sources = sorted((folder / "library" / "src").glob("*.c"))
    inputs = [*["<f4"] * 4, "?", "<u4", "<f4"]
    return Chip(
        folder,
        mcu,
        [*sources, HERE / "vehicle.c"],
        inputs=inputs,
        outputs=["<f4", "<u2"],
        flags=flags,
    )


def vehicle_twin(made: Library, spoil: Any = None, **more: Any) -> VehicleTwin:
    """Return the twin of a library's vehicle, in float32."""
    if spoil is not None:
        more["spoil"] = spoil
    own = twin(SUPERVISOR, read_law(SUPERVISOR, Watched))
    return VehicleTwin(twin_of(made), made.supervisor, supervisor=own, **more)


def frames(law: Law, folder: Path, mcu: str) -> Chip:
    """Return a chip that runs a law's functions on any numbers."""
    source = write(law, folder)
    name = f"swb_{c_law(law.name)}"
    parameters, state = (
        scalars_of(layout(record, align=False)) for record in (law.parameters, law.state)
    )
    flags = [
        f'-DLAW_HEADER="{source.header_name}"',
        f"-DPARAMETERS={name}_parameters",
        f"-DSTATE={name}_state",
        f"-DINITIAL={name}_initial",
        f"-DSTEP={name}_step",
    ]
    return Chip(
        folder,
        mcu,
        [folder / source.source_name, HERE / "frames.c"],
        inputs=[*parameters, *state, *["<f4"] * len(Measurement._fields), "<f4"],
        outputs=[*state, "<f4", *state, "<f4"],
        flags=flags,
    )


def _first(made: Library) -> float:
    return made.vehicle.stroke.maximum if made.law.command == "volume" else 0.0


def twin_of(made: Library) -> ControllerTwin:
    """Return the twin of a library's controller."""
    return made.controller(made.twin())


class Flight(NamedTuple):
    """A mission in closed loop with a chip."""

    ticks: int
    unequal: int  # ticks at which the twin said something else
    final_depth: float  # m
    cycles: Sequence[int]  # of the controller, at each tick


def fly(made: Library, chip: Chip, *, duration: float = 400.0, blind: range = range(0)) -> Flight:
    """Fly the golden mission, the plant under the chip's commands; the sensors may go blind."""
    beside = twin_of(made)
    unequal = 0

    def law(seen: Measurement, reference: float) -> float:
        nonlocal unequal
        hidden = beside.ticks in blind
        depth, volume = (math.nan, math.nan) if hidden else (seen.depth, seen.volume)
        (command,) = chip.answer(depth, volume, reference)
        unequal += bits(command) != bits(beside.tick(depth, volume, reference))
        return float(command)

    flown = simulate(
        made.vehicle,
        law=law,
        setpoints=[(0.0, made.mission.target)],
        duration=duration,
        start_depth=made.mission.start,
        seed=1,
        sample_time=made.tick_s,
    )
    return Flight(len(flown.time), unequal, float(flown.depth[-1]), chip.cycles)


def fly_supervised(
    made: Library, chip: Chip, *, duration: float = 400.0, spoil: Any = lambda _, seen: seen
) -> tuple[Flight, VehicleTwin]:
    """Fly the golden mission under the chip's supervised commands, its sensors spoilt."""
    beside = vehicle_twin(made)
    unequal = 0

    def law(seen: Measurement, reference: float) -> float:
        nonlocal unequal
        board = Watched(seen.depth, 0.1, seen.volume, 12.0, False, 0, 0)
        board = spoil(beside.controller.ticks, board)
        command, said = chip.answer(*board[:6], reference)
        expected = beside.tick(board, reference)
        unequal += bits(command, said) != bits(expected, beside.state.recovery.reasons)
        return float(command)

    flown = simulate(
        made.vehicle,
        law=law,
        setpoints=[(0.0, made.mission.target)],
        duration=duration,
        start_depth=made.mission.start,
        seed=1,
        sample_time=made.tick_s,
    )
    flight = Flight(len(flown.time), unequal, float(flown.depth[-1]), chip.cycles)
    return flight, beside


def replay(made: Library, chip: Chip, *, supervised: bool) -> Flight:
    """Give a chip what the golden trace's sensors saw of a float, to the bit."""
    beside, unequal = vehicle_twin(made), 0
    for depth, volume, asked, command in zip(*made.golden[:4], strict=True):
        seen = Watched(float(depth), 0.1, float(volume), 14.0, False, 0, 0)
        if supervised:
            said, expected = chip.answer(*seen[:6], asked)[0], beside.tick(seen, asked)
        else:
            said, expected = chip.answer(depth, volume, asked)[0], command
        unequal += bits(said) != bits(expected)
    return Flight(len(made.golden.depth), unequal, float(made.golden.depth[-1]), chip.cycles)


def report(laws: Sequence[str]) -> str:
    """Return a table of what the controller of each law takes on each chip."""
    rows = [
        "| law | chip | flash | RAM: variables + stack | cycles per tick, most "
        "| ms at 16 MHz | ticks equal to the twin |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in laws:
        floats = LAWS[name].command == "volume change"
        made = firmware(limited(load_vehicle(FLOATS[name]) if floats else controlled(name)))
        for mcu in MCUS:
            for supervised in (False, True):
                with tempfile.TemporaryDirectory() as folder:
                    make = vehicle if supervised else controller
                    chip = make(made, Path(folder), mcu)
                    if floats:
                        flight = replay(made, chip, supervised=supervised)
                    else:
                        flight = fly_supervised(made, chip)[0] if supervised else fly(made, chip)
                    stack = chip.close()
                most = max(flight.cycles)
                model = re.sub("atmega", "ATmega", mcu).replace("8p", "8P")
                rows.append(
                    f"| {name}{' + supervisor' if supervised else ''} | {model} "
                    f"| {chip.size.flash} B | {chip.size.variables} + {stack} B | {most} "
                    f"| {most / 16e3:.2f} | {flight.ticks - flight.unequal} of {flight.ticks} |"
                )
    return "\n".join(rows)


if __name__ == "__main__":
    print(report(sys.argv[1:] or [*LAWS]))
