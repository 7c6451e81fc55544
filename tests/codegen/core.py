"""A library's sketches with Arduino's own core for AVR, as its build does; on an emulated chip."""

from functools import cache
from pathlib import Path
from typing import Any

from swimbladder.codegen.library import Library, write_library
from tests.codegen.build import run
from tests.codegen.chip import HERE, Size, size_of

CORE = Path("/usr/share/arduino/hardware/arduino/avr")
BOARDS = {"atmega328p": ("standard", "AVR_UNO"), "atmega2560": ("mega", "AVR_MEGA2560")}
ROOM = {"atmega328p": Size(32256, 2048), "atmega2560": Size(253952, 8192)}  # less the bootloader
# The flags of platform.txt; DECIMAL_DIG is a macro that Debian's avr-gcc lacks.
_FLAGS = (
    "-Os",
    "-g",
    "-flto",
    "-ffunction-sections",
    "-fdata-sections",
    "-DF_CPU=16000000L",
    "-DARDUINO=10819",
    "-DARDUINO_ARCH_AVR",
    "-DDECIMAL_DIG=__DECIMAL_DIG__",
)
_C, _CPP = ("-std=gnu11",), ("-std=gnu++11", "-fno-exceptions", "-fno-threadsafe-statics")
_WARN = ("-Wall", "-Wextra", "-Werror")


def _flags(mcu: str) -> list[Any]:
    variant, board = BOARDS[mcu]
    places = ("-I", CORE / "cores" / "arduino", "-I", CORE / "variants" / variant)
    return [*_FLAGS, f"-mmcu={mcu}", f"-DARDUINO_{board}", *places]


@cache
def core(mcu: str, folder: Path) -> Path:
    """Return Arduino's core for a board, compiled."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = CORE / "cores" / "arduino"
    flags = [*_flags(mcu), "-w", "-c"]
    run("avr-gcc", *flags, *_C, *sorted(parts.glob("*.c")), cwd=folder)
    run("avr-g++", *flags, *_CPP, "-fpermissive", *sorted(parts.glob("*.cpp")), cwd=folder)
    assembled = [*flags, "-x", "assembler-with-cpp"]
    run("avr-gcc", *assembled, *parts.glob("*.S"), cwd=folder)
    run("avr-gcc-ar", "rcs", folder / "core.a", *sorted(folder.glob("*.o")))
    return folder / "core.a"


def build(made: Library, folder: Path, mcu: str, name: str, text: str, core_: Path) -> Path:
    """Return a sketch of a library, compiled with warnings as errors and linked with the core."""
    write_library(made, folder / "library")
    src = folder / "library" / "src"
    inside = ["-I", src, "-I", folder / "library" / "examples" / name]
    (folder / f"{name}.cpp").write_text(f"#include <Arduino.h>\n{text}")
    flags, objects = [*_flags(mcu), *_WARN, "-c"], folder / "objects"
    objects.mkdir(exist_ok=True)
    run("avr-gcc", *flags, *_C, *sorted(src.glob("*.c")), cwd=objects)
    run("avr-g++", *flags, *_CPP, *inside, folder / f"{name}.cpp", cwd=objects)
    elf = folder / f"{name}.elf"
    link = ["-Os", "-flto", "-fuse-linker-plugin", "-Wl,--gc-sections", f"-mmcu={mcu}"]
    run("avr-gcc", *link, *sorted(objects.glob("*.o")), core_, "-lm", "-o", elf)
    size, room = size_of(elf), ROOM[mcu]
    assert size.flash <= room.flash, size
    assert size.variables < room.variables, size
    return elf


def execute(elf: Path, mcu: str, milliseconds: int, *typed: object) -> str:
    """Return what a sketch prints in so long; typed: a time [ms] and a word, and so on."""
    runner = elf.parent / "runner"
    warn = ["-O2", "-Wall", "-Wextra", "-Werror"]
    run("gcc", *warn, HERE / "sketch.c", "-o", runner, "-lsimavr")
    said = run(runner, elf, mcu, milliseconds, *typed).stdout
    return said.decode(errors="replace").replace("\r", "")
