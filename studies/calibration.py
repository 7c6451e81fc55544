"""How far the intervals of `identify` can be believed: `python -m studies.calibration`.

Simulates pool campaigns with an integrator of its own, identifies each, and prints how often the
95 % intervals held the truth, how far off the values were, and how wide the intervals are against
the least width that is possible. A run that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import swimbladder
from studies.scenarios import SCENARIOS, Scenario
from studies.summary import render, summary
from swimbladder.io.files import write_atomically

__all__ = ["main", "study"]

_AT_ONCE = 10  # campaigns that a process is handed
_STUDIED = ("estimation", "sim/closed_loop", "sim/engine", "design/linear", "vehicle")


def main(given: Sequence[str] | None = None) -> int:
    """Run the study, print its table, and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m studies.calibration", description=__doc__)
    parser.add_argument("--campaigns", type=int, default=2000, help="of each scenario (2000)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--seed", type=int, default=1, help="of all that is drawn (1)")
    parser.add_argument("--out", type=Path, default=Path("report/calibration"), metavar="DIR")
    parser.add_argument("--profiles", action="store_true", help="intervals by profile likelihood")
    parser.add_argument(
        "--scenario", nargs="+", choices=[s.name for s in SCENARIOS], metavar="NAME",
        help=f"only these: {', '.join(s.name for s in SCENARIOS)}",
    )  # fmt: skip
    options = parser.parse_args(given)
    if min(options.campaigns, options.jobs) < 1:
        parser.error("--campaigns and --jobs: at least 1")
    chosen = [s for s in SCENARIOS if options.scenario is None or s.name in options.scenario]
    rows: list[list[str]] = []
    for scenario in chosen:
        found = study(
            scenario, campaigns=options.campaigns, seed=options.seed, jobs=options.jobs,
            profiles=options.profiles, folder=options.out,
        )  # fmt: skip
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

    A change of the code that is studied, or that draws the campaigns, begins a new file.
    """
    from swimbladder.cli.common import progress

    folder.mkdir(parents=True, exist_ok=True)
    kind = "profiles" if profiles else "plain"
    path = folder / f"{scenario.name}-{seed}-{kind}-{_fingerprint()}.jsonl"
    done = {found["index"]: found for found in _kept(path)}
    missing = [k for k in range(campaigns) if k not in done]
    with (
        path.open("a", encoding="utf-8") as file,
        progress(scenario.name, float(len(missing))) as advance,
    ):
        for found in _outcomes(scenario, missing, seed, jobs, profiles):
            done[found["index"]] = found
            file.write(json.dumps(found) + "\n")
            file.flush()
            advance(1.0)
    return [done[k] for k in range(campaigns)]


def _outcomes(
    scenario: Scenario, indices: list[int], seed: int, jobs: int, profiles: bool
) -> Iterator[dict[str, Any]]:
    several = partial(_several, scenario, seed, profiles)
    parts = [indices[k : k + _AT_ONCE] for k in range(0, len(indices), _AT_ONCE)]
    if jobs == 1 or len(parts) <= 1:
        for part in parts:
            yield from several(part)
        return
    # Each process has one core: a library that spreads a product over all of them only waits.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with ProcessPoolExecutor(jobs, get_context("spawn"), initializer=_warm_up) as pool:
        try:
            for future in as_completed([pool.submit(several, part) for part in parts]):
                yield from future.result()
        finally:  # interrupted: what has not begun is left for the next run
            pool.shutdown(cancel_futures=True)


def _several(
    scenario: Scenario, seed: int, profiles: bool, indices: list[int]
) -> list[dict[str, Any]]:
    from studies.campaign import outcome

    found = []
    for index in indices:
        try:
            found.append(outcome(scenario, seed=seed, index=index, profiles=profiles))
        except Exception as error:
            error.add_note(f"in campaign {index} of {scenario.name}, seed {seed}")
            raise
    return found


def _warm_up() -> None:
    """Load what a process needs before any fit is timed."""
    from studies.campaign import outcome

    outcome(SCENARIOS[0], seed=0, index=0)


def _kept(path: Path) -> Iterator[dict[str, Any]]:
    """Yield what an earlier run left; a line that it did not finish is cut off the file."""
    if not path.exists():
        return
    text = path.read_bytes()
    whole = text[: text.rfind(b"\n") + 1]
    if len(whole) < len(text):
        write_atomically(path, whole)
    for line in whole.decode("utf-8").splitlines():
        yield json.loads(line)


def _fingerprint() -> str:
    """Return a name for the code that the results depend on."""
    here = Path(__file__).parent
    own = [here / f"{name}.py" for name in ("truth", "noise", "bound", "scenarios", "campaign")]
    package = Path(swimbladder.__file__).parent
    used = sorted(f for name in _STUDIED for f in (package / name).rglob("*.py"))
    digest = sha256()
    for file in (*own, *used):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:10]


if __name__ == "__main__":
    sys.exit(main())
