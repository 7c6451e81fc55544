"""How far the intervals of `identify --cast` can be believed: `python -m studies.deep_calibration`.

Vehicles are drawn from what is said to be known of them, and dived by the mission engine, its own
law at the controls, in water with internal waves; a log is made of what a float would log, with a
pressure sensor's noise and resolution, and each is identified with a cast that errs: taken a day
before, when the waves lay elsewhere, by a CTD that is off. Printed are how often intervals held the
truth, and how far off the values were in standard deviations. With `--together N` each vehicle
dives N times, in waves and with a cast of its own each time, and the dives are identified together;
with `--differ S` each of these dives has parameters of its own, S deviations of what is known
before (1 sigma) about the vehicle's, which are the truth. A run that was interrupted goes on where
it stopped.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import norm

from studies import deep_drawn
from studies.deep_drawn import again, drawn, known, the_vehicle
from swimbladder.estimation.motion.deep_fit import fit_deep
from swimbladder.estimation.motion.deep_model import DEFAULT, body_of, deep_dive
from swimbladder.io.files import source_hash
from swimbladder.jobs import Store, each

__all__ = ["Score", "main", "outcome", "summary"]


def outcome(index: int, *, seed: int = 1, together: int = 1, differ: float = 0.0) -> dict[str, Any]:
    """Return what came of a vehicle, by name: error in deviations, deviation over its prior's.

    Of several dives also those of what each tells by itself, `random_effects`.
    """
    dived, vehicle, priors = drawn(index, seed=seed), the_vehicle(), known()
    if differ:
        each = [again(dived, index, k + 1, seed=seed, differ=differ) for k in range(together)]
    else:
        each = [dived, *(again(dived, index, k, seed=seed) for k in range(1, together))]
    dives = [deep_dive(one.log, one.column, vehicle) for one in each]
    fit = fit_deep(body_of(vehicle), dives, priors, free=DEFAULT)
    found: dict[str, Any] = {
        "index": index,
        "error": {n: (fit.values[n] - dived.values[n]) / fit.std(n) for n in fit.names},
        "narrowed": {n: fit.std(n) / priors[n].std for n in fit.names},
    }
    if fit.random_effects is not None:
        std = np.sqrt(np.diag(fit.random_effects.covariance))
        true = np.array([(dived.values[n] - priors[n].mean) / priors[n].std for n in fit.names])
        off = (fit.random_effects.value - true) / std
        found["random_effects"] = {
            "error": dict(zip(fit.names, off.tolist(), strict=True)),
            "narrowed": dict(zip(fit.names, std.tolist(), strict=True)),
        }
    return found


class Score(NamedTuple):
    """How the intervals of a parameter do."""

    name: str
    held: float  # share of the 95 % intervals that hold the truth
    mean: float  # of the errors, in deviations
    rms: float
    narrowed: float  # deviation over its prior's, median
    half: float  # share of the 50 % intervals that hold
    most: float  # of the 80 % intervals


def summary(found: Sequence[dict[str, Any]]) -> list[Score]:
    """Return how the intervals of each parameter do, and of all together."""
    names = list(found[0]["error"])
    rows = []
    for name, of in [*((name, [name]) for name in names), ("all", names)]:
        e = np.array([[one["error"][n] for n in of] for one in found])
        half, most, held = (
            float(np.mean(np.abs(e) <= norm.ppf(0.5 + 0.5 * p))) for p in (0.5, 0.8, 0.95)
        )
        rows.append(
            Score(
                name,
                held,
                float(e.mean()),
                float(np.sqrt(np.mean(e * e))),
                float(np.median([[one["narrowed"][n] for n in of] for one in found])),
                half,
                most,
            )
        )
    return rows


def main(given: Sequence[str] | None = None) -> int:
    """Run the study, print its table, and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m studies.deep_calibration", description=__doc__)
    parser.add_argument("--dives", type=int, default=300, help="how many vehicles (300)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--seed", type=int, default=1, help="of all that is drawn (1)")
    parser.add_argument("--together", type=int, default=1, metavar="N", help="dives a vehicle (1)")
    parser.add_argument(
        "--differ", type=float, default=0.0, metavar="S", help="with --together: dives differ (0)"
    )
    parser.add_argument("--out", type=Path, default=Path("report/calibration"), metavar="DIR")
    options = parser.parse_args(given)
    if min(options.dives, options.jobs, options.together) < 1:
        parser.error("--dives, --jobs and --together: at least 1")
    if options.differ < 0.0 or (options.differ > 0.0 and options.together == 1):
        parser.error("--differ: 0 or more, and dives of one vehicle differ: --together 2 or more")
    # Each process has one core: a library that spreads a product over all of them only waits.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    store = Store(options.out, source_hash([Path(__file__), Path(deep_drawn.__file__)]))
    work = partial(
        _kept, store, seed=options.seed, together=options.together, differ=options.differ
    )
    found = dict(each(work, range(options.dives), workers=options.jobs, processes=True))
    all_found = [found[k] for k in range(options.dives)]
    if options.together == 1:
        _print(f"{options.dives} vehicles, each by itself", all_found)
        return 0
    by = (
        f"{options.dives} vehicles, {options.together} dives each that differ by {options.differ:g}"
    )
    _print(f"{by}: the set that fits all looks", all_found)
    _print(
        f"{by}: what the dives tell each by itself", [one["random_effects"] for one in all_found]
    )
    return 0


def _print(title: str, found: Sequence[dict[str, Any]]) -> None:
    print(f"{title}\n")
    print(
        "| parameter | 95 % hold, % | 80 % hold | 50 % hold | mean error, sigma | rms error, sigma "
        "| sigma over prior's |\n|---|---:|---:|---:|---:|---:|---:|"
    )
    for x in summary(found):
        print(
            f"| {x.name} | {100.0 * x.held:.1f} | {100.0 * x.most:.1f} | {100.0 * x.half:.1f} "
            f"| {x.mean:+.2f} | {x.rms:.2f} | {x.narrowed:.2f} |"
        )
    print()


def _kept(store: Store, index: int, **options: Any) -> dict[str, Any]:
    return store.get(partial(outcome, index, **options), "dive", index, options)


if __name__ == "__main__":
    sys.exit(main())
