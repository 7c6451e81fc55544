"""A pool day of the paper's vehicle: the library with the procedure, in C and on a chip."""

import ctypes
import math
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swimbladder.codegen.library import Library, firmware, write_library
from swimbladder.codegen.pool import PoolOptions, PoolTwin, float32_twin, rehearse
from swimbladder.codegen.twin import twin
from swimbladder.control.law import Measurement
from swimbladder.control.protocol import POOL
from swimbladder.control.supervisor import Watched
from swimbladder.vehicle import Sensors
from tests.codegen.build import STRICT, run
from tests.codegen.chip import HERE, MCUS, Chip
from tests.codegen.laws import bits
from tests.vehicles import limited, paper

SENSORS = Sensors(depth_noise="2 mm", depth_quantum="5 mm", volume_quantum="0.75 cm3")
VOLUMES = (30e-6, 60e-6)
ARDUINO = Path(__file__).parent / "arduino"

_CALLS = """\
#include "swb_pool_day.h"
int size(void) { return (int)sizeof(swb_pool_day); }
void begin(void *d, int anew) { swb_pool_day_begin(d, anew != 0); }
float tick(void *memory, const float *in, uint32_t lost, int may_begin, uint32_t *said)
{
    swb_pool_day *d = memory;
    const swb_seen seen = {.depth = in[0], .depth_age = in[1], .volume = in[2], .battery = in[3],
        .leak = in[4] > 0.0f, .lost_ticks = lost};
    const float command = swb_pool_day_tick(d, &seen, may_begin != 0);
    said[0] = d->vehicle.reasons;
    said[1] = (uint32_t)(swb_pool_phase(d) + 1);
    said[2] = (uint32_t)(swb_pool_gave_up_in(d) + 1);
    return command;
}
const char *words(int phase) { return swb_pool_words((int8_t)phase); }
"""


@cache
def library() -> Library:
    """Two rounds, 30 and 60 cm3, in a pool of 4.5 m."""
    options = PoolOptions(4.5, volume_changes=(VOLUMES[0], VOLUMES[1]), rounds=2)
    return firmware(limited(paper(sensors=SENSORS)), duration=30.0, pool=options)


def day_twin(made: Library) -> PoolTwin:
    """Return the twin of a library's pool day."""
    assert made.pool is not None
    return float32_twin(made.pool.parameters, made.supervisor)


class Call(NamedTuple):
    """A call of the procedure's step, and what the twin made of it."""

    state: Any
    measurement: Measurement
    go: float
    command: Any
    after: Any
    next_s: Any


@cache
def calls() -> tuple[Call, ...]:
    """Every call of the procedure's twin in the rehearsed day."""
    made = library()
    assert made.pool is not None
    law, p, done = twin(POOL), made.pool.parameters, made.pool.rehearsal
    state = law.initial(p, Measurement(0.0, math.nan, math.nan), 0.0)
    found = []
    for z, V, go in zip(done.depth, done.volume, done.may_begin, strict=True):
        seen = Measurement(np.float32(0.0), z, V)
        command, after, next_s = law.step(p, state, seen, float(go))
        found.append(Call(state, seen, float(go), command, after, next_s))
        state = after
    return tuple(found)


class DayInC:
    """A library's pool day, compiled for this machine."""

    def __init__(self, made: Library, folder: Path, *flags: str) -> None:
        write_library(made, folder / "library")
        (folder / "calls.c").write_text(_CALLS)
        src = folder / "library" / "src"
        sources = [*sorted(src.glob("*.c")), folder / "calls.c"]
        run(
            "gcc",
            *STRICT,
            "-O2",
            *flags,
            "-shared",
            "-fPIC",
            "-I",
            src,
            *sources,
            "-o",
            folder / "day.so",
            "-lm",
        )
        self.c = ctypes.CDLL(str(folder / "day.so"))
        pointer = ctypes.c_void_p
        self.c.tick.argtypes = [pointer, pointer, ctypes.c_uint32, ctypes.c_int, pointer]
        self.c.tick.restype = ctypes.c_float
        self.c.begin.argtypes = [pointer, ctypes.c_int]
        self.c.words.restype = ctypes.c_char_p
        self.begin()

    def begin(self, *, anew: bool = False) -> None:
        self.room = ctypes.create_string_buffer(self.c.size())
        self.c.begin(ctypes.addressof(self.room), int(anew))

    def tick(self, seen: Watched, *, may_begin: bool) -> tuple[Any, ...]:
        """Return (command, bits of the reasons, phase, phase in which it gave up)."""
        numbers, said = np.array(seen[:5], np.float32), np.zeros(3, np.uint32)
        command = self.c.tick(
            ctypes.addressof(self.room),
            numbers.ctypes.data,
            int(seen.lost),
            int(may_begin),
            said.ctypes.data,
        )
        return command, int(said[0]), int(said[1]) - 1, int(said[2]) - 1


def said_by(beside: PoolTwin, seen: Watched, *, may_begin: bool) -> tuple[Any, ...]:
    """Return what the twin says, in the form of the C's."""
    command = beside.tick(seen, may_begin=may_begin)
    state = beside.state
    return command, int(beside.watch.recovery.reasons), int(state.phase), int(state.gave_up_in)


def pool_chip(made: Library, folder: Path, mcu: str, *flags: str) -> Chip:
    """Return a chip that runs a pool day: what is seen, may it begin -> command, bits, phase."""
    write_library(made, folder / "library")
    sources = sorted((folder / "library" / "src").glob("*.c"))
    return Chip(folder, mcu, [*sources, HERE / "pool.c"], inputs=7, outputs=3, flags=flags)


def fly_on_chip(made: Library, chip: Chip) -> tuple[int, int]:
    """Fly a pool day, the plant under the chip's commands; return (ticks, those unequal)."""
    beside, ticks, unequal = day_twin(made), 0, 0
    assert made.pool is not None

    def fly(seen: Watched, may_begin: bool) -> float:
        nonlocal ticks, unequal
        command, reasons, phase = chip.answer(*seen[:6], float(may_begin))
        ticks += 1
        unequal += bits(command, reasons, phase) != bits(
            said[-1], beside.watch.recovery.reasons, beside.state.phase
        )
        return float(command)

    said: list[Any] = []
    plain = beside.tick

    def noted(seen: Watched, *, may_begin: bool) -> Any:
        said.append(plain(seen, may_begin=may_begin))
        return said[-1]

    beside.tick = noted  # type: ignore[method-assign]
    rehearse(made.vehicle, beside, bottom_depth=made.pool.options.bottom_depth, seed=1, fly=fly)
    return ticks, unequal


class SketchInWater:
    """An example sketch of a pool day, compiled against the stub of Arduino, over a plant."""

    READS = "float in[2]; if (fread(in, 4, 2, stdin) != 2) { exit(0); } *depth_m = in[0];"
    DRIVES = "fwrite(&voltage, 4, 1, stderr); fflush(stderr); stub_us += SWB_TICK_US - 400u;"

    def __init__(self, made: Library, folder: Path, name: str) -> None:
        write_library(made, folder / "library")
        text = made.files[f"examples/{name}/{name}.ino"]
        for old, new in (
            ("*depth_m = NAN;", self.READS),
            ("*volume_m3 = NAN;", "*volume_m3 = in[1];"),
            ("(void)voltage;", self.DRIVES),
            ("millis() > 300000u", "day.ticks > 200u"),
        ):
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        (folder / "sketch.cpp").write_text(f"#include <stdlib.h>\n#include <Arduino.h>\n{text}")
        src = folder / "library" / "src"
        objects = []
        for source in src.glob("*.c"):
            objects.append(folder / f"{source.stem}.o")
            run("gcc", *STRICT, "-O2", "-c", source, "-o", objects[-1])
        files = [folder / "sketch.cpp", ARDUINO / "main.cpp", *objects]
        run(
            "g++",
            "-std=c++11",
            "-O2",
            "-Wall",
            "-Wextra",
            "-Wconversion",
            "-Werror",
            "-DTURNS=2000000000L",
            '-DWORDS="arm\\n"',
            "-I",
            ARDUINO,
            "-I",
            src,
            *files,
            "-o",
            folder / "sketch",
            "-lm",
        )
        self.made, self.log, self._program = made, folder / "log.csv", folder / "sketch"

    def swim(self, *, seed: int = 1) -> Path:
        """Let it swim the whole day; return its log."""
        assert self.made.pool is not None
        with (
            self.log.open("wb") as log,
            subprocess.Popen(
                [self._program], stdin=subprocess.PIPE, stdout=log, stderr=subprocess.PIPE
            ) as sketch,
        ):
            assert sketch.stdin is not None
            assert sketch.stderr is not None

            def fly(seen: Watched, _: bool) -> float:
                sketch.stdin.write(np.array([seen.depth, seen.volume], "<f4").tobytes())
                sketch.stdin.flush()
                return float(np.frombuffer(sketch.stderr.read(4), "<f4")[0])

            rehearse(
                self.made.vehicle,
                day_twin(self.made),
                bottom_depth=self.made.pool.options.bottom_depth,
                seed=seed,
                fly=fly,
            )
        return self.log


def report() -> str:
    """Return rows of a table of what a pool day takes on each chip, as chip.report has them."""
    rows = []
    for mcu in MCUS:
        with tempfile.TemporaryDirectory() as folder:
            chip = pool_chip(library(), Path(folder), mcu)
            ticks, unequal = fly_on_chip(library(), chip)
            stack = chip.close()
        most = max(chip.cycles)
        model = mcu.replace("atmega", "ATmega").replace("8p", "8P")
        rows.append(
            f"| pool day + supervisor | {model} | {chip.size.flash} B "
            f"| {chip.size.variables} + {stack} B | {most} | {most / 16e3:.2f} "
            f"| {ticks - unequal} of {ticks} |"
        )
    return "\n".join(rows)


if __name__ == "__main__":
    print(report())
