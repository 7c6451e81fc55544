"""How far the intervals of `identify` can be believed: `python -m studies.calibration`.

Simulates pool campaigns with an integrator of its own, identifies each, and prints how often the
95 % intervals held the truth, how far off the values were, and how wide the intervals are against
the least width that is possible. A run that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

from studies.scenarios import SCENARIOS, Scenario
from studies.summary import render, summary
from swimbladder.io.files import source_hash
from swimbladder.jobs import Store, each

__all__ = ["main", "study"]

_OWN = ("truth", "noise", "bound", "scenarios", "campaign")  # what draws the campaigns


def main(given: Sequence[str] | None = None) -> int:
    """Run the study, print its table, and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m studies.calibration", description=__doc__)
    parser.add_argument("--campaigns", type=int, default=2000, help="of each scenario (2000)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--seed", type=int, default=1, help="of all that is drawn (1)")
    parser.add_argument("--out", type=Path, default=Path("report/calibration"), metavar="DIR")
    parser.add_argument("--profiles", action="store_true", help="intervals by profile likelihood")
    parser.add_argument(
        "--scenario",
        nargs="+",
        choices=[s.name for s in SCENARIOS],
        metavar="NAME",
        help=f"only these: {', '.join(s.name for s in SCENARIOS)}",
    )
    options = parser.parse_args(given)
    if min(options.campaigns, options.jobs) < 1:
        parser.error("--campaigns and --jobs: at least 1")
    chosen = [s for s in SCENARIOS if options.scenario is None or s.name in options.scenario]
    rows: list[list[str]] = []
    for scenario in chosen:
        found = study(
            scenario,
            campaigns=options.campaigns,
            seed=options.seed,
            jobs=options.jobs,
            profiles=options.profiles,
            folder=options.out,
        )
        rows += summary(scenario, found)
    table = render(rows, chosen)
    print(table)
    target = options.out / "table.txt"
    target.write_text(table + "\n", encoding="utf-8")
    print(f"wrote {target}")
    return 0


def study(
    scenario: Scenario,
    *,
    campaigns: int,
    seed: int,
    jobs: int,
    folder: Path,
    profiles: bool = False,
) -> list[dict[str, Any]]:
    """Return what came of campaigns 0, 1, ...; those that `folder` has are not done again.

    A change of the package, or of what draws the campaigns, computes them anew.
    """
    from swimbladder.cli.common import progress

    own = [Path(__file__).with_name(f"{name}.py") for name in _OWN]
    store = Store(folder, scenario.name, seed, profiles, source_hash(own))
    # Each process has one core: a library that spreads a product over all of them only waits.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    work = partial(_campaign, store, scenario, seed, profiles, jobs > 1)
    found: dict[int, dict[str, Any]] = {}
    with progress(scenario.name, float(campaigns)) as advance:
        for index, one in each(work, range(campaigns), workers=jobs, processes=jobs > 1):
            found[index] = one
            advance(1.0)
    return [found[k] for k in range(campaigns)]


def _campaign(
    store: Store, scenario: Scenario, seed: int, profiles: bool, warm: bool, index: int
) -> dict[str, Any]:
    """Return what came of a campaign, as it is kept or done now; warm: nothing else is timed."""
    from studies.campaign import outcome

    def done() -> dict[str, Any]:
        if warm:
            _warm_up()
        try:
            return outcome(scenario, seed=seed, index=index, profiles=profiles)
        except Exception as error:
            error.add_note(f"in campaign {index} of {scenario.name}, seed {seed}")
            raise

    return store.get(done, scenario.name, index)


@cache
def _warm_up() -> None:
    """Load what a process needs before any fit is timed."""
    from studies.campaign import outcome

    outcome(SCENARIOS[0], seed=0, index=0)


if __name__ == "__main__":
    sys.exit(main())
