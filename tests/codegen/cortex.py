"""A library on an emulated Cortex-M: compiled by arm-none-eabi-gcc, run by QEMU.

QEMU gives what the processor computes, not how long that takes. ``python -m tests.codegen.cortex``
prints what law and supervisor take there.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from swimbladder.codegen.library import Library, firmware, write_library
from swimbladder.control.supervisor import Watched
from swimbladder.io.config import load_vehicle
from tests.codegen.build import run
from tests.vehicles import limited

HERE = Path(__file__).parent / "arm"
# An M0+ has no machine of its own in QEMU: its instructions are among those of the M3.
CORES = {
    "cortex-m0plus": ("mps2-an385", ["-mcpu=cortex-m0plus"]),
    "cortex-m3": ("mps2-an385", ["-mcpu=cortex-m3"]),
    "cortex-m4": ("mps2-an386", ["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"]),
}
WARN = ("-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror")
_FRAME = np.dtype(
    [
        ("depth", "<f4"),
        ("age", "<f4"),
        ("volume", "<f4"),
        ("battery", "<f4"),
        ("leak", "?"),
        ("lost", "<u4"),
        ("asked", "<f4"),
    ],
    align=True,
)


def execute(
    made: Library, folder: Path, core: str, program: Path, *words: object, more: Sequence[Path] = ()
) -> str:
    """Compile a program with a library's sources and more, run it with words; return its prints."""
    machine, flags = CORES[core]
    write_library(made, folder / "library")
    src = folder / "library" / "src"
    sources = [HERE / "vectors.c", program, *more, *sorted(src.glob("*.c"))]
    elf = folder / "program.elf"
    run(
        "arm-none-eabi-gcc",
        "-std=c99",
        "-O2",
        *WARN,
        *flags,
        "-mthumb",
        "--specs=rdimon.specs",
        "-Wl,--section-start=.vectors=0",
        "-DBOARD_HAS_MAIN",
        "-I",
        src,
        *sources,
        "-o",
        elf,
        "-lm",
    )
    given = ",".join(f"arg={word}" for word in ("program", *words))
    return run(
        "qemu-system-arm",
        "-M",
        machine,
        "-nographic",
        "-monitor",
        "none",
        "-serial",
        "null",
        "-semihosting-config",
        f"enable=on,target=native,{given}",
        "-kernel",
        elf,
        text=True,
    ).stdout


def answers(
    made: Library, folder: Path, core: str, seen: Sequence[Watched], asked: Sequence[float]
) -> list[tuple[float, int]]:
    """Return command and reasons of law and supervisor at each tick."""
    rows = [(*one[:6], reference) for one, reference in zip(seen, asked, strict=True)]
    np.array(rows, _FRAME).tofile(folder / "frames")
    execute(made, folder, core, HERE / "vehicle.c", folder / "frames", folder / "answers")
    said = np.fromfile(folder / "answers", [("command", "<f4"), ("reasons", "<u4")])
    return [(command, int(reasons)) for command, reasons in said]


def size(made: Library, folder: Path, core: str, *, law: bool) -> tuple[int, int]:
    """Return the bytes of flash and of variables that the smallest such program takes."""
    write_library(made, folder / "library")
    src = folder / "library" / "src"
    elf = folder / "size.elf"
    run(
        "arm-none-eabi-gcc",
        "-std=c99",
        "-Os",
        "-flto",
        "-ffunction-sections",
        "-fdata-sections",
        "-Wl,--gc-sections",
        "-nostartfiles",
        "-Wl,-emain",
        "--specs=nano.specs",
        "-mthumb",
        *CORES[core][1],
        *(["-DLAW"] if law else []),
        "-I",
        src,
        HERE / "size.c",
        *sorted(src.glob("*.c")),
        "-o",
        elf,
        "-lm",
    )
    text, data, bss = map(
        int, run("arm-none-eabi-size", elf, text=True).stdout.splitlines()[1].split()[:3]
    )
    return text + data, data + bss


if __name__ == "__main__":
    made = firmware(limited(load_vehicle("example-float")))
    for core in CORES:
        with tempfile.TemporaryDirectory() as folder:
            flash, ram = size(made, Path(folder), core, law=False)
        print(f"rate + supervisor, {core}: flash {flash} B, RAM {ram} B")
