"""The table of docs/how-to/tune.md: laws tuned for the vehicle of the paper, and its own cascade.

``python -m studies.tuned [--law LAW ...] [--runs 200]`` tunes each law as `swimbladder tune` does,
for 12 V and 2 mm of noise, the quiet ones with a quantum of 5 mm as well, and prints the rows and
the tuning found. Takes minutes. `KNOBS` are those, rounded, for studies that need a tuned law.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from typing import Any

from studies.reversals import KNOBS as QUIET_KNOBS
from swimbladder.cli.common import progress
from swimbladder.control.law import Law, TuningParameters
from swimbladder.control.registry import bind
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.tuning import Tuning, tune
from swimbladder.design.tuning.gains import gains, setting_of, tunable
from swimbladder.design.tuning.trial import Drawn, Step, Trial, trial
from swimbladder.io.config import load_vehicle
from swimbladder.vehicle import Vehicle

__all__ = ["FAST", "KNOBS", "QUIET", "gains_of", "main", "noisy", "row", "tuned"]

FAST, QUIET = ("planned", "sea-cascade", "adrc"), ("pulse", "observer")
_TICK, _SUPPLY = 0.3, 12.0  # s, V
_DEPTHS = (0.0, 5.0)  # m
_STEPS: Mapping[str, tuple[float, float]] = {"fast": (1.5, 3.0), "quiet": (1.5, 2.0)}  # m
_QUANTA = {"fast": 0.0, "quiet": 5e-3}  # m
_OWN = Step(1.5, 3.0, 1800.0)  # the paper's
KNOBS: Mapping[str, TuningParameters] = {  # as `tune --without-supervisor` finds them, rounded
    **QUIET_KNOBS,
    "planned": TuningParameters(
        frequency=0.27, damping=0.8, inner=1.5, sharpness=12.0, learning=0.003, share=0.75
    ),
    "sea-cascade": TuningParameters(
        frequency=0.317, damping=1.0, inner=1.67, sharpness=4.0, learning=1.0, share=0.75
    ),
    "adrc": TuningParameters(
        frequency=0.2, damping=1.0, inner=1.67, sharpness=6.0, learning=0.1, share=0.75
    ),
}


def goal_of(name: str) -> str:
    """Return what a law is tuned for here."""
    return "fast" if name in FAST else "quiet"


def noisy(goal: str) -> Vehicle:
    """Return the vehicle with the depth sensor of a goal."""
    vehicle = load_vehicle("feup-em")
    sensors = vehicle.sensors.model_copy(
        update={"depth_noise": 2e-3, "depth_quantum": _QUANTA[goal]}
    )
    return vehicle.model_copy(update={"sensors": sensors})


def gains_of(name: str, tuning: TuningParameters | None = None) -> tuple[Law, Any]:
    """Return a law and its parameters, by the tuning kept here where none are given."""
    setting = setting_of(
        noisy(goal_of(name)), sample_time=_TICK, supply=_SUPPLY, neutral_range=20e-6
    )
    return tunable(name), gains(name, setting, tuning or KNOBS[name])


def tuned(name: str, *, runs: int) -> Tuning:
    """Return a law tuned for its goal."""
    goal = goal_of(name)
    with progress(f"tuning {name}", 1.0) as advance:
        return tune(
            noisy(goal),
            law=name,
            goal=goal,
            depth_range=_DEPTHS,
            step=_STEPS[goal],
            supply=_SUPPLY,
            runs=runs,
            advance=advance,
        )


def row(words: str, t: Trial, *, goal: str, median: bool = False) -> str:
    """Return the row of a trial; of a fast law with its step, of a quiet one without."""
    settle, over = (
        (t.settle_median, t.overshoot_median) if median else (t.settle_95, t.overshoot_95)
    )
    cells = [words, "", "", "", "", ""]
    if goal == "fast":
        cells[1:3] = (
            (f"{settle:.1f} s" if math.isfinite(settle) else "never"),
            f"{100 * over:.1f} %",
        )
    if not median:
        cells[3:5] = f"{1e3 * t.rms:.1f} mm", f"{3.6e6 * t.rate:.2g} L/h"
    if goal == "quiet":
        cells[5] = f"{3600 * t.starts:.0f}/h, {3600 * t.turns:.0f}/h"
    return "| " + " | ".join(cells) + " |"


def own(*, runs: int) -> list[str]:
    """Return the rows of the paper's cascade, without noise and with it."""
    vehicle = load_vehicle("feup-em")
    assert vehicle.controller is not None
    law, numbers = bind(vehicle.controller)
    found = []
    for words, one, count in (
        ("the paper's cascade, without noise", vehicle, 1),
        ("the paper's cascade, nominal", noisy("fast"), runs),
        ("the same, quantum of 5 mm", noisy("quiet"), runs),
    ):
        t = trial(one, BoundLaw(law, numbers, _TICK), _OWN, Drawn(count))
        found.append(row(words, t, goal="fast"))
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, then the tuning."""
    parser = argparse.ArgumentParser(prog="python -m studies.tuned", description=__doc__)
    parser.add_argument("--law", nargs="*", default=[*FAST, *QUIET], choices=[*FAST, *QUIET])
    parser.add_argument("--runs", type=int, default=200, help="of a trial")
    given = parser.parse_args(arguments)
    print(
        "| `feup-em`, 12 V, 2 mm of noise | settles to 2 % | overshoot | held: rms "
        "| volume moved | starts from rest, reversals |\n|---|---|---|---|---|---|"
    )
    print("\n".join(own(runs=given.runs)), flush=True)
    tuning = {}
    for name in given.law:
        found, goal = tuned(name, runs=given.runs), goal_of(name)
        tuning[name] = found.tuning
        if goal == "fast":
            print(row(f"`{name}`, fast, nominal (median)", found.nominal, goal=goal, median=True))
        print(row(f"`{name}`, {goal}, 95 % of the region", found.region, goal=goal), flush=True)
    for name, one in tuning.items():
        print(f"{name}: {one}")


if __name__ == "__main__":
    main()
