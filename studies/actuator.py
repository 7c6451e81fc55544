"""How often the intervals of identify-actuator hold the truth, over many simulated benches.

``python -m studies.actuator [--benches 2000] [--seed 1] [--case CASE ...]`` prints a table: voltage
steps, voltage steps whose gains differ, or with outliers; moves at full voltage whose voltage is
not logged. With ``--four`` of the benches only those of four voltages count; with ``--same`` the
gains of all voltages are believed to be the same, which they are not.
"""

from __future__ import annotations

import argparse
import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from studies.benches import Motor, random_bench, random_motor, random_moves
from swimbladder.cli.common import progress
from swimbladder.errors import NoAnswerError
from swimbladder.estimation.actuator import ActuatorIdentification, identify_actuator
from swimbladder.estimation.actuator import model as spreads

__all__ = ["CASES", "Score", "main", "same_gains", "score"]

CASES: Mapping[str, tuple[bool, float, float]] = {
    # name: moves instead of voltage steps, spread of the gains between them, share of outliers
    "steps": (False, 0.0, 0.0),
    "steps, gains differ by 1 %": (False, 0.01, 0.0),
    "steps, gains differ by 2 %": (False, 0.02, 0.0),
    "steps, 10 % outliers": (False, 0.0, 0.1),
    "moves": (True, 0.0, 0.0),
    "moves, speeds differ by 1 %": (True, 0.01, 0.0),
    "moves, 10 % outliers": (True, 0.0, 0.1),
}


_FOUR = 4  # voltages: as many steps as the gains need
_NONE = 1e-12  # scale of a spread that is not there


class Score(NamedTuple):
    """One parameter over many benches."""

    significant: int
    held: int  # intervals that hold the truth
    pull: float  # standard deviation of error over std
    bias: float  # mean of error over std


def score(case: str, count: int, seed: int, *, four: bool = False) -> dict[str, Score]:
    """Return the score of each parameter over `count` benches of a case; four: see `_benches`."""
    held: dict[str, list[bool]] = {}
    pulls: dict[str, list[float]] = {}
    for motor, found in _benches(case, count, seed, four):
        told = {**found.parameters, **found.derived}
        for name, truth in _truth(motor, moves=CASES[case][0]).items():
            e = told[name]
            if not e.known:
                continue
            held.setdefault(name, []).append(e.ci95[0] <= truth <= e.ci95[1])
            pulls.setdefault(name, []).append((e.value - truth) / e.std)
    return {
        name: Score(len(hits), sum(hits), float(np.std(pulls[name])), float(np.mean(pulls[name])))
        for name, hits in held.items()
    }


def _benches(
    case: str, count: int, seed: int, four: bool
) -> Iterator[tuple[Motor, ActuatorIdentification]]:
    """Yield `count` motors and what is found of them; four: of four voltages, others skipped."""
    moves, differing, outliers = CASES[case]
    make = random_moves if moves else random_bench
    with progress(case, float(count)) as advance:
        for k in range(count):
            random = np.random.default_rng([seed, k])
            motor = random_motor(random)
            log = make(random, motor, differing=differing, outliers=outliers)
            if not four or len(np.unique(log.voltage[log.voltage != 0.0])) == _FOUR:
                with contextlib.suppress(NoAnswerError):
                    yield motor, identify_actuator([log])
            advance(1.0)


@contextlib.contextmanager
def same_gains() -> Iterator[None]:
    """Let `identify_actuator` believe, for a while, that no gain differs from another."""
    before = spreads.PRIOR
    spreads.PRIOR = _NONE
    try:
        yield
    finally:
        spreads.PRIOR = before


def _truth(motor: Motor, *, moves: bool) -> dict[str, float]:
    if not moves:
        return {
            "K1": motor.K1,
            "T1": motor.T1,
            "dead_zone": motor.dead_zone,
            "load_voltage": motor.load,
            "asymmetry": motor.asymmetry,
        }
    out = motor.K_out * (12.0 - motor.dead_zone - motor.load)
    in_ = motor.K_in * (12.0 - motor.dead_zone + motor.load)
    return {
        "T1": motor.T1,
        "rate_out": out,
        "rate_in": in_,
        "rate": math.sqrt(out * in_),
        "asymmetry": out / in_,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Coverage of identify-actuator's intervals.")
    parser.add_argument("--benches", type=int, default=2000, help="of each case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--case", nargs="+", choices=CASES, default=list(CASES), metavar="CASE")
    parser.add_argument("--four", action="store_true", help="count those of four voltages only")
    parser.add_argument("--same", action="store_true", help="believe that no gains differ")
    chosen = parser.parse_args(arguments)
    print(f"{'':30}{'told':>6}{'held':>9}{'pull':>8}{'bias':>8}")
    for case in chosen.case:
        print(case, flush=True)
        with same_gains() if chosen.same else contextlib.nullcontext():
            found = score(case, chosen.benches, chosen.seed, four=chosen.four)
        for name, s in found.items():
            share = 100.0 * s.held / s.significant
            print(
                f"  {name:28}{s.significant:6d}{share:8.1f}%{s.pull:8.2f}{s.bias:8.2f}", flush=True
            )


if __name__ == "__main__":
    main()
