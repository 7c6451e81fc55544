"""The command line as a user meets it: each time a new process, with kept code and without."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

__all__ = ["GOALS", "startup"]

COMMAND = (sys.executable, "-m", "swimbladder")
SIMULATE = ("simulate", "feup-em", "--json", "--out")
COLD = "simulate for the first time, compiling"
GOALS = {
    "--help": 0.3,
    "simulate, CSV and JSON": 1.0,
    "simulate, also plot and netCDF": 3.5,
    COLD: 10.0,
}  # s


def startup(repetitions: int) -> dict[str, tuple[float, float]]:
    """Return the wall and processor time [s] of each command, the least of several."""
    with tempfile.TemporaryDirectory(prefix="swimbladder-bench-") as name:
        folder = Path(name)
        simulate = (*COMMAND, *SIMULATE, str(folder / "out"))
        commands = {
            "python -c pass, to compare": (sys.executable, "-c", "pass"),
            "--help": (*COMMAND, "--help"),
            "simulate, CSV and JSON": simulate,
            "simulate, also plot and netCDF": (*simulate, "--plot", "--netcdf"),
        }
        cache = str(folder / "kept")
        times = {COLD: _timed(simulate, cache)}
        for command in commands.values():  # reads every file once, and compiles what was not yet
            _timed(command, cache)
        for _ in range(repetitions):
            for what, command in commands.items():
                wall, cpu = _timed(command, cache)
                before = times.get(what, (wall, cpu))
                times[what] = min(wall, before[0]), min(cpu, before[1])
    return {what: times[what] for what in (*commands, COLD)}


def _timed(command: tuple[str, ...], cache: str) -> tuple[float, float]:
    environment = {**os.environ, "SWIMBLADDER_CACHE_DIR": cache, "MPLBACKEND": "Agg"}
    start, before = perf_counter(), _children()
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    wall, cpu = perf_counter() - start, _children() - before
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return wall, cpu


def _children() -> float:
    """Processor time [s] of all processes that were started and have ended."""
    used = os.times()
    return used.children_user + used.children_system
