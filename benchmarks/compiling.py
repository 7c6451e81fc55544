"""Which kernels a command compiles, and the processor time that each takes.

``python -m benchmarks.compiling simulate feup-em`` runs the command in this process with an empty
folder of kept code. `own` is what a function takes without those it calls.
"""

from __future__ import annotations

import os
import sys
import tempfile
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from time import process_time
from typing import Any

from benchmarks.table import render


@dataclass
class Compiled:
    """What was compiled of a function: how often, and seconds with and without what it calls."""

    count: int = 0
    whole: float = 0.0
    own: float = 0.0


def listing(arguments: list[str]) -> dict[str, Compiled]:
    """Run a command of the package; return what was compiled, by function."""
    from numba.core import event

    from swimbladder.cli import main as command

    found: dict[str, Compiled] = {}
    begun: list[float] = []
    inner: list[float] = [0.0]

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:  # noqa: ARG002
            begun.append(process_time())
            inner.append(0.0)

        def on_end(self, event: Any) -> None:
            function = event.data["dispatcher"].py_func
            module = (function.__module__ or "made").removeprefix("swimbladder.")
            name = f"{module}.{function.__qualname__}"
            took, within = process_time() - begun.pop(), inner.pop()
            inner[-1] += took
            one = found.setdefault(name, Compiled())
            one.count += 1
            one.whole += took
            one.own += took - within

    with event.install_listener("numba:compile", Listener()), redirect_stdout(StringIO()):
        code = command(arguments)
    if code != 0:
        raise SystemExit(code)
    return found


def main(arguments: list[str]) -> None:
    """Print the listing."""
    with tempfile.TemporaryDirectory(prefix="swimbladder-bench-") as folder:
        os.environ["SWIMBLADDER_CACHE_DIR"] = folder
        before = process_time()
        found = listing(arguments)
        took = process_time() - before
    rows = [
        (name, str(one.count), f"{one.own:.2f}", f"{one.whole:.2f}")
        for name, one in sorted(found.items(), key=lambda item: -item[1].own)
    ]
    total = sum(one.own for one in found.values())
    print(render(["function", "times", "own [s]", "whole [s]"], rows))
    print(f"\n{len(found)} functions, {total:.1f} s of {took:.1f} s of processor time")


if __name__ == "__main__":
    main(sys.argv[1:])
