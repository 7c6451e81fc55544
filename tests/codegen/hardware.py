"""Boards on serial ports that fly a model: emulated, or a program on this machine."""

import subprocess
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from swimbladder.codegen.library import Library, write_library
from tests.codegen.build import run
from tests.codegen.cortex import CORES, WARN

HERE = Path(__file__).parent
_AVR = ("-Os", "-flto", "-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra", "-Werror")


def _written(made: Library, folder: Path) -> tuple[Path, Path]:
    """Write a library; return the folders of its sources and of its sketch for this."""
    write_library(made, folder / "library")
    return folder / "library/src", folder / "library/examples/HardwareInTheLoop"


def avr_program(made: Library, folder: Path, mcu: str) -> Path:
    """Compile the sketch of a library for an AVR as Arduino does; return the program."""
    src, sketch = _written(made, folder)
    arduino, main = HERE / "simavr/sketch", folder / "sketch.cpp"
    main.write_text('#include <Arduino.h>\n#include "HardwareInTheLoop.ino"\n')
    chip = ("-DF_CPU=16000000UL", f"-mmcu={mcu}", "-I", src, "-I", sketch, "-I", arduino)
    objects = []
    for source in [*sorted(src.glob("*.c")), main, arduino / "main.cpp"]:
        objects.append(folder / f"{source.name}.o")
        how = ("avr-gcc", "-std=gnu11") if source.suffix == ".c" else ("avr-g++", "-std=gnu++11")
        run(*how, *_AVR, *chip, "-c", source, "-o", objects[-1])
    elf = folder / f"{mcu}.elf"
    link = ("avr-gcc", *_AVR, "-fuse-linker-plugin", "-Wl,--gc-sections", f"-mmcu={mcu}")
    run(*link, *objects, "-lm", "-o", elf)
    return elf


@contextmanager
def _port_of(*command: object) -> Iterator[str]:
    """Run what stands for a board; give the serial port that it names first."""
    words = [str(word) for word in command]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline().decode()
            yield next(word for word in line.split() if word.startswith("/dev/"))
        finally:
            process.kill()


@contextmanager
def avr_board(elf: Path, mcu: str, *, speed: float = 0.0) -> Iterator[str]:
    """Run a program on an emulated AVR, so many times as fast as real time; give its port."""
    host = elf.parent / "board"
    how = ("-O2", "-Wall", "-Wextra", "-Werror", "-I", "/usr/include/simavr")
    run("gcc", *how, HERE / "simavr/board.c", "-o", host, "-lsimavrparts", "-lsimavr")
    with _port_of(host, elf, mcu, speed) as port:
        yield port


@contextmanager
def arm_board(made: Library, folder: Path, core: str) -> Iterator[str]:
    """Run a library on an emulated Cortex-M; give its port."""
    machine, flags = CORES[core]
    src, sketch = _written(made, folder)
    sources, elf = [HERE / "arm/vectors.c", HERE / "arm/hil.c", *src.glob("*.c")], folder / "elf"
    how = (*WARN, *flags, "-mthumb", "--specs=rdimon.specs", "-Wl,--section-start=.vectors=0")
    given = ("-I", src, "-I", sketch, *sources, "-o", elf, "-lm")
    run("arm-none-eabi-gcc", "-std=c99", "-O2", *how, *given)
    quiet = ("-nographic", "-monitor", "none", "-semihosting-config", "enable=on,target=native")
    with _port_of(
        "qemu-system-arm", "-M", machine, *quiet, "-serial", "pty", "-kernel", elf
    ) as port:
        yield port


def host_program(made: Library, folder: Path, header: Mapping[str, str] = {}) -> Path:
    """Compile a library for this machine, see board/host.c; return the program.

    header: texts to put in the place of others in hil.h.
    """
    src, sketch = _written(made, folder)
    text = (sketch / "hil.h").read_text()
    for old, new in header.items():
        assert old in text
        text = text.replace(old, new)
    (sketch / "hil.h").write_text(text)
    given = ("-ffp-contract=off", "-I", src, "-I", sketch, HERE / "board/host.c", *src.glob("*.c"))
    run("gcc", "-std=c99", "-O2", *WARN, *given, "-lm", "-o", folder / "host")
    return folder / "host"


def host_board(program: Path, what: str = "well", n: int = 0) -> AbstractContextManager[str]:
    """Run such a program, with what is to go wrong; give its port."""
    return _port_of(program, what, n)
