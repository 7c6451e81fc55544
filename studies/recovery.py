"""From where the vehicle of the paper comes back under a law: counts over four maps.

``python -m studies.recovery [--law cascade planned] [--depth 10]`` prints, for set-point changes
from rest and for depth errors and speeds about three depths, how many runs are back in 600 s, how
many later, how many are lost, and how many of these no controller could have saved. The law
`planned` has the gains that `tune` found (`studies.tuned`). Takes minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from studies.tuned import gains_of
from swimbladder.cli.common import progress
from swimbladder.control.registry import bind
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.stability.recover import Map, Recovery, Verdict, recovery_maps
from swimbladder.io.config import load_vehicle
from swimbladder.jobs import Store

__all__ = ["lines", "main", "maps_of"]

_TICK, _WITHIN, _BAND, _CELLS = 0.3, 600.0, 0.05, 21  # s, s, m, cells to a side: as `stability` has


def maps_of(name: str, deepest: float, *, cells: int = _CELLS) -> tuple[Map, ...]:
    """Return the maps of a law from the surface to a depth [m]."""
    vehicle = load_vehicle("feup-em")
    assert vehicle.controller is not None
    law, numbers = bind(vehicle.controller) if name == "cascade" else gains_of(name)
    band = max(_BAND, getattr(numbers, "band", 0.0))
    recovery = Recovery(vehicle, BoundLaw(law, numbers, _TICK), _WITHIN, band, Store(None))
    with progress(f"maps of {name}", 1.0) as advance:
        return recovery_maps(recovery, depths=(0.0, deepest), cells=cells, advance=advance)


def lines(name: str, maps: Sequence[Map]) -> list[str]:
    """Return a row of the table for each map."""
    found = []
    for one in maps:
        lost = one.verdicts == Verdict.LOST
        counts = [one.count(v) for v in (Verdict.RECOVERED, Verdict.SLOW, Verdict.UNSETTLED)]
        hopeless = int(np.sum(lost & one.hopeless))
        cells = [name, one.title, one.asked, *counts, int(lost.sum()), hopeless]
        found.append("| " + " | ".join(map(str, cells)) + " |")
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.recovery", description=__doc__)
    parser.add_argument("--law", nargs="+", default=["cascade", "planned"], metavar="LAW")
    parser.add_argument("--depth", type=float, default=10.0, help="deepest [m]")
    given = parser.parse_args(arguments)
    head = ("law", "map", "runs", "back", "later", "not yet", "lost", "no controller could")
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for name in given.law:
        for line in lines(name, maps_of(name, given.depth)):
            print(line, flush=True)


if __name__ == "__main__":
    main()
