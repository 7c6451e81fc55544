"""Who runs the mission: each peer by name, with what it can do; those that are absent, by name."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from benchmarks import c_loop, control_loop, numpy_loop, ours, scipy_loop
from benchmarks.mission import Array, Fleet, Mission

__all__ = ["Peer", "peers"]


@dataclass(frozen=True, kw_only=True)
class Peer:
    """A rival, or the package: what is called, how often, and on how many threads at most."""

    name: str
    depth: Callable[[int], Array] | None = None  # one vehicle's depths, by the single-vehicle way
    depths: Callable[[list[int]], Array] | None = None  # several, by the way of the fleet
    fleet: Callable[[int], dict[str, Array]] | None = None  # all vehicles' summaries, on n threads
    repetitions: int = 1
    threads: int = 1
    remark: str = ""


def peers(
    mission: Mission, fleet: Fleet, stack: ExitStack, *, quick: bool, only: str = ""
) -> tuple[list[Peer], list[str]]:
    """Return the peers that are here, and a line for each that is not.

    only: "C" for the package and the C loops alone.
    """
    found, absent = [_ours(mission, fleet)], []
    if c_loop.compiler() is None:
        absent.append("C: no compiler ($CC, gcc, cc or clang)")
    else:
        shapes = c_loop.SHAPES[:1] if quick else c_loop.SHAPES
        tuned = stack.enter_context(c_loop.fastest(mission, fleet, shapes))
        found += [_c(loop, best, mission, fleet) for loop, best in tuned.items()]
    if only == "C":
        return found, absent
    try:
        from benchmarks import jax_scan
    except ImportError as error:
        absent.append(f"JAX: {error}")
    else:
        found.append(
            Peer(
                name=f"JAX {jax_scan.VERSION}, vmap + scan, RK4 x 3",
                depth=lambda lane: jax_scan.depths(mission, fleet.take([lane]))[0],
                depths=lambda lanes: jax_scan.depths(mission, fleet.take(lanes)),
                fleet=lambda _: jax_scan.summaries(mission, fleet),
                repetitions=3,
            )
        )
    found.append(
        Peer(
            name=f"NumPy {np.__version__}, RK4 x 3 over arrays",
            fleet=lambda _: numpy_loop.summaries(mission, fleet),
        )
    )
    found += [
        Peer(
            name=f"SciPy {scipy.__version__}, {method}",
            depth=partial(scipy_loop.depths, mission, fleet, method=method),
        )
        for method in scipy_loop.METHODS
    ]
    found.append(
        Peer(
            name=f"python-control {control_loop.VERSION}, discretised",
            depth=partial(control_loop.depths, mission, fleet),
        )
    )
    return found, absent


def _ours(mission: Mission, fleet: Fleet) -> Peer:
    return Peer(
        name="swimbladder",
        depth=partial(ours.depth, mission, fleet),
        depths=lambda lanes: ours.depths(mission, fleet.take(lanes)),
        fleet=lambda threads: ours.summaries(mission, fleet, threads),
        repetitions=5,
        threads=2,
    )


def _c(loop: str, tuned: c_loop.Tuned, mission: Mission, fleet: Fleet) -> Peer:
    build, times = tuned
    how = "RK4 x 3" if loop == "ensemble" else "exact in open water"
    return Peer(
        name=f"C, {how}, {build.name}",
        depth=partial(build.single, mission, fleet) if loop == "ensemble" else None,
        depths=lambda lanes: build.depths(mission, fleet.take(lanes), loop=loop),
        fleet=lambda threads: build.summaries(mission, fleet, threads, loop=loop),
        repetitions=5,
        threads=2,
        remark="; ".join(f"{name} {time:.4f}" for name, time in times.items()),
    )
