"""Compile a law's C, and call it."""

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from swimbladder.codegen.c99 import CSource, c_law, write_c99
from swimbladder.codegen.library import render
from swimbladder.codegen.subset import read_law
from swimbladder.control.law import Law, Measurement
from tests.codegen.laws import flat, laid_out, layout

STRICT = (
    "-std=c99",
    "-ffp-contract=off",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Werror",
)

_FRAMES = """\
#include <stdio.h>
#include "swb_{law}.h"

int main(void)
{{
    struct {{
        swb_{law}_parameters p;
        swb_{law}_state state;
        {seen} m;
        float reference;
    }} in;
    while (fread(&in, sizeof in, 1, stdin) == 1) {{
        swb_{law}_state first;
        float next_s;
        swb_{law}_initial(&in.p, &in.m, in.reference, &first);
        const float command = swb_{law}_step(&in.p, &in.state, &in.m, in.reference, &next_s);
        fwrite(&first, sizeof first, 1, stdout);
        fwrite(&command, sizeof command, 1, stdout);
        fwrite(&in.state, sizeof in.state, 1, stdout);
        fwrite(&next_s, sizeof next_s, 1, stdout);
    }}
    return 0;
}}
"""


def run(*words: Any, **how: Any) -> subprocess.CompletedProcess[Any]:
    """Run a program; what it says is in the failure."""
    done = subprocess.run([str(word) for word in words], capture_output=True, check=False, **how)
    assert done.returncode == 0, (done.stderr or done.stdout or b"?")[-4000:]
    return done


def write(law: Law, folder: Path, seen: type[Any] = Measurement) -> CSource:
    """Write a law's C files into a folder; seen: what the law sees."""
    source = write_c99(read_law(law, seen))
    (folder / "swb_measurement.h").write_text(render("swb_measurement.h", {}))
    (folder / source.header_name).write_text(source.header)
    (folder / source.source_name).write_text(source.source)
    return source


class Compiled:
    """A law's C, compiled for this machine and loaded."""

    def __init__(self, law: Law, folder: Path) -> None:
        source = write(law, folder)
        made = folder / "law.so"
        run(
            "gcc",
            *STRICT,
            "-O2",
            "-shared",
            "-fPIC",
            folder / source.source_name,
            "-o",
            made,
            "-lm",
        )
        library = ctypes.CDLL(str(made))
        name = f"swb_{c_law(law.name)}"
        self._step, self._initial = library[f"{name}_step"], library[f"{name}_initial"]
        pointer, number = ctypes.c_void_p, ctypes.c_float
        self._step.argtypes = [pointer, pointer, pointer, number, pointer]
        self._step.restype = number
        self._initial.argtypes = [pointer, pointer, number, pointer]
        self._initial.restype = None
        self._forms = layout(law.parameters), layout(law.state), layout(Measurement)

    def step(self, parameters: Any, state: Any, measurement: Any, reference: float) -> Any:
        """Return (command, the state's numbers, next_s)."""
        given = zip(self._forms, (parameters, state, measurement), strict=True)
        p, s, m = (_placed(form, v) for form, v in given)
        next_s = ctypes.c_float()
        command = self._step(
            p.ctypes.data, s.ctypes.data, m.ctypes.data, reference, ctypes.addressof(next_s)
        )
        return command, s.view(self._forms[1])[0].tolist(), next_s.value

    def initial(self, parameters: Any, measurement: Any, reference: float) -> Any:
        """Return the state's numbers."""
        p, m = _placed(self._forms[0], parameters), _placed(self._forms[2], measurement)
        s = np.full(self._forms[1].itemsize, 7, np.uint8)
        self._initial(p.ctypes.data, m.ctypes.data, reference, s.ctypes.data)
        return s.view(self._forms[1])[0].tolist()


def _placed(form: np.dtype[Any], values: Any) -> Any:
    return np.frombuffer(bytearray(laid_out(form, *values)), np.uint8)


class Program:
    """A law's C as a program that answers frames of calls; compiled with any compiler."""

    def __init__(
        self, law: Law, folder: Path, compiler: str, *flags: str, seen: type[Any] = Measurement
    ) -> None:
        source = write(law, folder, seen)
        name = "swb_measurement" if seen is Measurement else f"swb_{c_law(law.name)}_seen"
        (folder / "frames.c").write_text(_FRAMES.format(law=c_law(law.name), seen=name))
        parameters, state, given = layout(law.parameters), layout(law.state), layout(seen)
        self._takes = np.dtype(
            [("p", parameters), ("state", state), ("m", given), ("reference", "<f4")], align=True
        )
        self._gives = np.dtype(
            [("first", state), ("command", "<f4"), ("state", state), ("next_s", "<f4")]
        )
        self._made = folder / "frames"
        files = [folder / source.source_name, folder / "frames.c"]
        run(compiler, *flags, "-Wno-double-promotion", *files, "-o", self._made, "-lm")

    def answers(self, frames: list[tuple[Any, ...]]) -> Any:
        """Return a tuple of numbers for each (parameters, state, measurement, reference)."""
        done = run(self._made, input=b"".join(laid_out(self._takes, *frame) for frame in frames))
        return [flat(*row) for row in np.frombuffer(done.stdout, self._gives).tolist()]
