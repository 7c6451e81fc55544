"""Emulated boards on serial ports, running the sketch HardwareInTheLoop that `firmware` writes."""

import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from swimbladder.codegen.library import Library, write_library
from tests.codegen.build import run

HERE = Path(__file__).parent
_STRICT = ("-Os", "-Wall", "-Wextra", "-Werror")
_GONE = ("-flto", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")


def avr_program(made: Library, folder: Path, mcu: str, *flags: str) -> Path:
    """Compile the sketch of a library for an AVR as Arduino does; return the program."""
    write_library(made, folder / "library")
    sketch = folder / "library/examples/HardwareInTheLoop"
    src, arduino = folder / "library/src", HERE / "simavr/sketch"
    main = folder / "sketch.cpp"
    main.write_text('#include <Arduino.h>\n#include "HardwareInTheLoop.ino"\n')
    chip = ("-DF_CPU=16000000UL", f"-mmcu={mcu}", "-I", src, "-I", sketch, "-I", arduino, *flags)
    objects = []
    for source in [*sorted(src.glob("*.c")), main, arduino / "main.cpp"]:
        objects.append(folder / f"{source.name}.o")
        compiler = ("avr-gcc", "-std=gnu11") if source.suffix == ".c" else ("avr-g++", "-std=gnu++11")
        run(*compiler, *_STRICT, *_GONE, *chip, "-c", source, "-o", objects[-1])
    elf = folder / f"{mcu}.elf"
    run("avr-gcc", *_STRICT, *_GONE, "-fuse-linker-plugin", f"-mmcu={mcu}", *objects, "-lm", "-o", elf)
    return elf


@contextmanager
def port_of(*command: object) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Run an emulator that ends with its stdin; give the serial port that it names first."""
    words = [str(word) for word in command]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline().decode()
            yield next(word for word in line.split() if word.startswith("/dev/")), process
        finally:
            process.kill()


@contextmanager
def avr_board(elf: Path, mcu: str, *, speed: float = 0.0) -> Iterator[str]:
    """Run a program on an emulated AVR, so many times as fast as real time; give its port."""
    host = elf.parent / "board"
    libraries: Sequence[str] = ("-lsimavrparts", "-lsimavr")
    warn = ("-Wall", "-Wextra", "-Werror", "-I", "/usr/include/simavr")
    run("gcc", "-O2", *warn, HERE / "simavr/board.c", "-o", host, *libraries)
    with port_of(host, elf, mcu, speed) as (port, _):
        yield port
