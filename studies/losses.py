"""Recoverable vehicles that are lost all the same, pooled over seeds that nobody chose.

``python -m studies.losses VEHICLE ... --from COMMIT [--seeds 5] [--missions 100000]`` flies the
campaigns of `swimbladder faults` and prints a row of a table for each vehicle (a preset or a file,
as `tune` writes it). The seeds follow from the hash of a commit, that of the code as it is to be
judged: no choice can have been based on them. What is flown is kept in build/losses, so that a run
that was killed goes on. 100,000 missions take minutes.
"""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from swimbladder.cli.common import progress
from swimbladder.io.config import load_vehicle
from swimbladder.sim.faults import FaultResult, faults
from swimbladder.sim.faults.campaign_result import rule_of_three
from swimbladder.units import parse_quantity
from swimbladder.vehicle import Vehicle

__all__ = ["Losses", "losses", "main", "pooled", "seeds_of"]

_KEPT = Path("build/losses")
HEAD = (
    "| vehicle, law | missions | recoverable | lost to one fault | to two "
    "| to two, at most (95 %) | lost without supervisor | healthy | false alarms | C |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)


class Losses(NamedTuple):
    """Counts of missions: with faults, then healthy."""

    missions: int
    recoverable: int
    pairs: int  # of the recoverable, with two faults
    lost_single: int
    lost_pairs: int  # those among them that full buoyancy 60 s after the first had brought up
    lost_without: int  # of the recoverable, by the law alone
    healthy: int
    alarms: int


def seeds_of(commit: str, count: int) -> list[int]:
    """Return the seeds that follow from the hash of a commit."""
    texts = (f"{commit} {n}".encode() for n in range(count))
    return [int.from_bytes(hashlib.sha256(text).digest()[:4], "big") for text in texts]


def losses(found: FaultResult) -> Losses:
    """Return what a campaign counts; a loss counts from the first of two faults too."""
    two = found.fault_row(1, "kind") > 0.0
    lost = np.concatenate([found.lost, found.lost_early])
    return Losses(
        missions=len(found.faulty),
        recoverable=int(found.recoverable.sum()),
        pairs=int((found.recoverable & two).sum()),
        lost_single=int((~two[lost]).sum()),
        lost_pairs=int(two[lost].sum()),
        lost_without=int((found.recoverable & ~found.came_up(1)).sum()),
        healthy=len(found.healthy),
        alarms=len(found.false_alarms),
    )


def pooled(parts: Sequence[Losses]) -> Losses:
    """Return the counts of all parts together."""
    return Losses(*np.sum(parts, axis=0).tolist())


def row(words: str, n: Losses, program: str) -> str:
    """Return a row of the table."""
    most = rule_of_three(n.lost_pairs, n.pairs)
    cells = [
        words,
        f"{n.missions:,}",
        f"{100.0 * n.recoverable / n.missions:.1f} %",
        f"{n.lost_single}",
        f"{n.lost_pairs} of {n.pairs:,}",
        f"{100.0 * most:.3f} %",
        f"{100.0 * n.lost_without / n.recoverable:.0f} %",
        f"{n.healthy:,}",
        f"{n.alarms}",
        f"`{program[:12]}`",
    ]
    return "| " + " | ".join(cells) + " |"


def flown(
    vehicle: Vehicle, seeds: Sequence[int], *, missions: int, healthy: int
) -> list[FaultResult]:
    """Return the campaigns of a vehicle, one for each seed."""
    found = []
    for number, seed in enumerate(seeds, 1):
        doing = f"{vehicle.name}, seed {number} of {len(seeds)}"
        with progress(doing, 1.0) as advance:
            found.append(
                faults(
                    vehicle,
                    missions=missions,
                    healthy=healthy,
                    seed=seed,
                    keep=_KEPT,
                    advance=advance,
                )
            )
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, then the missions that were lost."""
    parser = argparse.ArgumentParser(prog="python -m studies.losses", description=__doc__)
    parser.add_argument("vehicles", nargs="+", metavar="VEHICLE", help="preset or TOML file")
    parser.add_argument("--from", dest="commit", required=True, help="hash of the commit")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--missions", type=int, default=100_000, help="of a seed")
    parser.add_argument("--healthy", type=int, default=2_000, help="of a seed")
    parser.add_argument("--time-limit", help='of vehicles that state none, like "31 min"')
    given = parser.parse_args(arguments)
    print(HEAD, flush=True)
    lost: list[str] = []
    for name in given.vehicles:
        vehicle = load_vehicle(name)
        if vehicle.supervisor.time_limit is None and given.time_limit is not None:
            limit = parse_quantity(given.time_limit, "s")
            known = vehicle.supervisor.model_copy(update={"time_limit": limit})
            vehicle = vehicle.model_copy(update={"supervisor": known})
        seeds = seeds_of(given.commit, given.seeds)
        campaigns = flown(vehicle, seeds, missions=given.missions, healthy=given.healthy)
        assert vehicle.controller is not None  # own_law
        words = f"`{vehicle.name}`, `{vehicle.controller.law}`"
        print(row(words, pooled([*map(losses, campaigns)]), campaigns[0].program), flush=True)
        for one in campaigns:
            numbers = sorted({*one.lost.tolist(), *one.lost_early.tolist()})
            lost += [f"{words}, seed {one.seed}, {one.description(n)}" for n in numbers]
    for line in lost:
        print(line)


if __name__ == "__main__":
    main()
