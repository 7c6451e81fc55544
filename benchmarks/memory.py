"""Memory of an ensemble that keeps summaries: ``python -m benchmarks.memory LANES DURATION``."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path

from benchmarks.mission import fleet, mission

__all__ = ["GOAL", "LANES", "peak"]

LANES = 10_000
GOAL = 500.0  # MB


def peak(lanes: int, duration: float) -> dict[str, float]:
    """Return the peak memory [MB] of a new process before and after it ran so many vehicles."""
    # The first process compiles, where that is still to do, and keeps the code for the second.
    for size in ((1, 3.0), (lanes, duration)):
        command = [sys.executable, "-m", "benchmarks.memory", *map(str, size)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found


def _peak_now() -> float:
    """Return the peak memory of this process [MB]."""
    status = Path("/proc/self/status")
    if status.exists():  # ru_maxrss would count the process that started this one as well
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024 / 1e6
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def _main(lanes: int, duration: float) -> None:
    from benchmarks import ours

    task = mission(duration)
    many = fleet(task.vehicle, lanes)
    ours.summaries(task, many.take([0]))  # everything is loaded
    before = _peak_now()
    ours.summaries(task, many)
    print(json.dumps({"before_MB": before, "peak_MB": _peak_now()}))


if __name__ == "__main__":
    _main(int(sys.argv[1]), float(sys.argv[2]))
