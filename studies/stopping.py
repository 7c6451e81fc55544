"""Whether one may stop when the numbers look good: pool days that end when `pool` says so.

``python -m studies.stopping --days 160`` simulates days of the paper's experiments, each with a
vehicle of its own (K2, T2 and psi 15 % off what is believed), and ends each when K2 and T2 are told
to the target. It prints how often the 95 % intervals at that moment hold the truth.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import binom

from swimbladder.guide import Asked, Operator, PoolDay, Rules, Target, paper_tasks, rehearse
from swimbladder.io.config import load_vehicle
from swimbladder.parameters import IdentifiedMotion, Sensors, Vehicle

__all__ = ["Stopped", "acceptable", "run_day", "table"]

NAMES = ("K2", "T2", "psi")
_SPREAD = 0.15  # of the logarithm of each parameter
_POOL = 4.5  # m
_MOST = 16  # experiments


class Stopped(NamedTuple):
    """A day at its end; errors in standard deviations, held: the interval has the truth."""

    experiments: int
    state: str
    errors: dict[str, float]
    held: dict[str, bool]


def run_day(number: int, *, target: float = 0.02, folder: Path) -> Stopped:
    """Return how the day of this number ends; `folder` takes its files."""
    rng = np.random.default_rng([28, number])
    believed = load_vehicle("feup-em")
    truth, values = _truth(believed, rng)
    day = PoolDay(
        believed, folder, rules=Rules(bottom=_POOL - 0.05, change=2.8e-6),
        tasks=paper_tasks(believed, pool_depth=_POOL),
        asked=Asked(targets=(Target("K2", target), Target("T2", target))), mode="simulated",
    )  # fmt: skip
    operator = Operator(believed, truth, pool_depth=_POOL, seed=1000 * number)
    for _ in rehearse(day, operator, most=_MOST, speed=math.inf, whole=folder / "pool.csv"):
        pass
    assert day.found is not None
    found = {name: day.found.parameters[name] for name in NAMES}
    return Stopped(
        len(day.kept), day.verdict.state,
        {name: (e.value - values[name]) / e.std for name, e in found.items()},
        {name: e.ci95[0] <= values[name] <= e.ci95[1] for name, e in found.items()},
    )  # fmt: skip


def acceptable(days: int, *, doubt: float = 0.01) -> tuple[int, int]:
    """Return the least and the largest number of hits that 95 % intervals leave believable."""
    low, high = binom.ppf([doubt / 2.0, 1.0 - doubt / 2.0], days, 0.95)
    return int(low), int(high)


def table(stopped: list[Stopped]) -> str:
    """Return how often the intervals held the truth, and how large the errors were."""
    n = len(stopped)
    low, high = acceptable(n)
    lines = [f"{n} days; {low} to {high} hits are believable", "     hits  mean z  mean z2"]
    for name in NAMES:
        z = np.array([s.errors[name] for s in stopped])
        hits = sum(s.held[name] for s in stopped)
        lines.append(f"{name:4} {hits:4d}  {z.mean():+6.2f}  {np.mean(z**2):7.2f}")
    counts = np.bincount([s.experiments for s in stopped])
    ended = ", ".join(f"{k}: {c}" for k, c in enumerate(counts.tolist()) if c)
    good = sum(s.state == "good enough" for s in stopped)
    return "\n".join([*lines, f"experiments when stopped: {ended}", f"good enough: {good}"])


def _truth(believed: Vehicle, rng: np.random.Generator) -> tuple[Vehicle, dict[str, float]]:
    assert isinstance(believed.motion, IdentifiedMotion)
    factors = np.exp(_SPREAD * rng.normal(size=3)).tolist()
    K2, T2 = believed.motion.K2 * factors[0], believed.motion.T2 * factors[1]
    psi = believed.hull.psi * factors[2]
    quantum = 0.0 if rng.random() < 0.5 else 5e-3
    truth = believed.model_copy(
        update={
            "motion": IdentifiedMotion(K2=K2, T2=T2),
            "hull": believed.hull.model_copy(update={"psi": psi}),
            "sensors": Sensors(depth_noise=2e-3, depth_quantum=quantum, volume_quantum=0.75e-6),
        }
    )
    return truth, {"K2": K2, "T2": T2, "psi": psi}


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--days", type=int, default=160)
    parser.add_argument("--target", type=float, default=0.02)
    given = parser.parse_args()
    stopped = []
    for number in range(given.days):
        with tempfile.TemporaryDirectory() as folder:
            stopped.append(run_day(number, target=given.target, folder=Path(folder)))
    print(table(stopped))


if __name__ == "__main__":
    main()
