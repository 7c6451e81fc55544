"""Plain tables, and what machine this is."""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from benchmarks.c_loop import compiler

__all__ = ["machine", "number", "ratio", "render"]


def machine() -> dict[str, str]:
    """Return processor, cores, system and the versions that matter."""
    found = {
        "processor": f"{_processor()}, {os.cpu_count()} cores",
        "system": f"{platform.system()} {platform.release()}",
        "Python": platform.python_version(),
    }
    for name in ("swimbladder", "numpy", "numba", "scipy"):
        found[name] = version(name)
    cc = compiler()
    if cc is not None:
        shown = subprocess.run([cc, "--version"], capture_output=True, text=True, check=True)
        found["C compiler"] = shown.stdout.splitlines()[0]
    return found


def _processor() -> str:
    source = Path("/proc/cpuinfo")
    if source.exists():
        lines = source.read_text().splitlines()
        names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
        flags = next((line for line in lines if line.startswith("flags")), "").split()
        widest = next((name for name in ("avx512f", "avx2", "avx") if name in flags), "")
        if names:
            return f"{names[0]} ({widest})" if widest else names[0]
    return platform.processor() or platform.machine()


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with so many digits, a dash for None."""
    if value is None:
        return "-"
    if value == 0.0 or 1e-3 <= abs(value) < 1e6:
        return f"{value:.{digits}g}" if abs(value) < 10**digits else f"{value:,.0f}"
    return f"{value:.{digits - 1}e}"


def ratio(value: float | None, base: float | None) -> str:
    """Return how many times `base` a value is, a dash where either is missing."""
    return "-" if value is None or base is None else f"{number(value / base)} x"


def render(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return an aligned table, the first column to the left."""
    cells = [list(headings), *map(list, rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(headings))]
    lines = [
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    ]
    return "\n".join([lines[0], "  ".join("-" * width for width in widths), *lines[1:]])
