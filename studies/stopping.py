"""Whether one may stop when the numbers look good: pool days that end when `pool` says so.

``python -m studies.stopping --days 400`` draws days of the paper's experiments, each with a vehicle
of its own (K2, T2 and psi 15 % off what is believed), and ends each when `pool` says to stop, then
goes on to eight experiments. It prints how often the 95 % intervals held the truth at the stop and
after fixed numbers of experiments. The truth is that of `studies.truth`, an integrator that shares
no code with the package; ``--rehearsed`` takes the rehearsal of `pool` instead, loop and all. A run
that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from studies.noise import Noise
from studies.scenarios import K_B, NEUTRAL_STD, POOL
from studies.summary import binomial_interval
from studies.truth import Array, Body, Motor, Step, follow
from swimbladder.design.pool_day import (
    Asked,
    Operator,
    PoolDay,
    Rules,
    Sample,
    Target,
    Task,
    paper_tasks,
)
from swimbladder.design.pool_day.verdict import LEAST, State
from swimbladder.estimation.motion import Identification, identify
from swimbladder.io.config import load_vehicle
from swimbladder.io.files import source_hash
from swimbladder.jobs import Store
from swimbladder.vehicle import IdentifiedActuator, IdentifiedMotion, Sensors, Vehicle

__all__ = ["FIXED", "days", "main", "performer", "run_day", "table"]

NAMES = ("K2", "T2", "psi")
FIXED = (4, 8)  # experiments, after which it is looked at whatever the intervals are
_SPREAD = 0.15  # of the logarithm of each parameter
_MOST = 16  # experiments
_SUPPLY = 12.0  # V
_TICK = 0.3  # s
_HELD, _FREE = 75.0, 4.0  # s at rest: by the loop, then with the piston left alone
_REST_SPEED = 0.2e-3  # m/s, left at the end of a rest
_JITTER = 1e-6  # m3, of the volume while the loop holds the depth
_QUANTUM = 0.75e-6  # m3, of the piston's sensor
_LONGEST = 400.0  # s, of a glide

Perform = Callable[[Task], Array]  # a task to its log: time [s], depth [m], volume [m3]


def run_day(
    number: int, folder: Path, *, target: float = 0.02, rehearsed: bool = False
) -> dict[str, Any]:
    """Return the day of this number at its stop and after fixed numbers; `folder` takes its files.

    stop: how many experiments there were, what the verdict was, and of each parameter the truth,
    the value, its standard deviation and the ends of the interval; "4", "8": the same; "each": as
    found in between, without the interval by likelihood profiles.
    """
    believed = load_vehicle("feup-em")
    rng = np.random.default_rng([28, number])
    truth = np.exp(_SPREAD * rng.normal(size=3)) * _values(believed)
    perform = (
        _rehearsal(believed, truth, rng, number) if rehearsed else performer(believed, truth, rng)
    )
    day = PoolDay(
        believed,
        folder,
        rules=Rules(bottom=POOL - 0.05, change=2.8e-6),
        tasks=paper_tasks(believed, bottom_depth=POOL),
        asked=Asked(targets=(Target("K2", target), Target("T2", target))),
        mode="simulated",
    )
    list(day.begin_log("simulated"))
    found: dict[str, Any] = {"number": number, "each": {}}
    for performed in range(1, _MOST + 1):
        for _ in day.feed(Sample(*row) for row in perform(day.next).tolist()):
            pass
        if day.found is not None and len(day.kept) >= LEAST:
            found["each"][str(len(day.kept))] = _told(day.found, truth)
        over = day.verdict.good or day.verdict.state == State.LIMITED or performed == _MOST
        if over and "stop" not in found:
            day.settle()
            assert day.found is not None
            found["stop"] = {"state": day.verdict.state, **_told(day.found, truth)}
            day.asked = replace(day.asked, targets=(Target("K2", 1e-6),))  # goes on
        for count in FIXED:
            if len(day.kept) >= count and str(count) not in found:
                if found.get("stop", {}).get("experiments") == len(day.kept):
                    found[str(count)] = found["stop"]
                    continue
                plain = identify([k.log for k in day.kept], believed, choices=False)
                found[str(count)] = _told(plain, truth)
        if "stop" in found and (performed == _MOST or len(day.kept) >= max(FIXED)):
            break
    return found


def performer(believed: Vehicle, truth: Array, rng: np.random.Generator) -> Perform:
    """Return what does a task with the vehicle of these K2, T2 and psi, by `studies.truth`.

    The vehicle is held for a minute, with 0.2 mm/s left and the volume taken for the neutral one
    0.5 cm3 off (1 sigma each); then the piston is left alone, and moved by a voltage.
    """
    actuator = believed.actuator
    assert isinstance(actuator, IdentifiedActuator)
    body = Body.identified(k_b=K_B, K2=truth[0], T2=truth[1], psi=truth[2])
    motor = Motor(
        K1=actuator.K1, T1=actuator.T1, area=actuator.piston_area, load=actuator.depth_voltage
    )
    noise = Noise(sigma=2e-3, quantum=float(rng.choice([0.0, 5e-3])))
    clock, zero = 0.0, 1e-6 * rng.uniform()

    def perform(task: Task) -> Array:
        nonlocal clock
        assert task.start is not None
        dx = task.change / motor.area
        pulse = max(1, math.ceil(abs(dx) / (motor.K1 * _SUPPLY * _TICK) - 1e-9))
        depth = task.start + 0.01 * rng.normal()
        step = Step(
            sample_time=_TICK,
            rest=round(_FREE / _TICK),
            pulse=pulse,
            voltage=dx / (motor.K1 * pulse * _TICK),
            start_depth=depth,
            reference_depth=depth,
            start_speed=_REST_SPEED * rng.normal(),
            neutral_error=NEUTRAL_STD * rng.normal(),
        )
        paths = follow(body, motor, step, round(_LONGEST / _TICK))
        path, volume = paths[0][0], paths[1][0]
        inside = (path > task.shallowest - 0.05) & (path < task.deepest + 0.05)
        end = int(np.argmin(np.append(inside, False)))
        held = round(_HELD / _TICK)
        before = depth - step.start_speed * _TICK * np.arange(held, 0, -1)
        z = np.concatenate([before, path[:end]])
        V = np.concatenate([_JITTER * rng.normal(size=held), volume[:end]]) + zero
        time = clock + _TICK * np.arange(len(z))
        clock = float(time[-1]) + 60.0  # a gap, in which it is brought to where the next begins
        V = _QUANTUM * np.round(V / _QUANTUM)
        return np.column_stack([time, noise.draw(rng, z), V])

    return perform


def _rehearsal(believed: Vehicle, truth: Array, rng: np.random.Generator, number: int) -> Perform:
    K2, T2, psi = truth.tolist()
    quantum = float(rng.choice([0.0, 5e-3]))
    water = believed.model_copy(
        update={
            "motion": IdentifiedMotion(K2=K2, T2=T2),
            "hull": believed.hull.model_copy(update={"psi": psi}),
            "sensors": Sensors(depth_noise=2e-3, depth_quantum=quantum, volume_quantum=_QUANTUM),
        }
    )
    operator = Operator(believed, water, bottom_depth=POOL, seed=1000 * number)
    return lambda task: np.column_stack(operator.perform(task)[:3])


def _values(vehicle: Vehicle) -> Array:
    assert isinstance(vehicle.motion, IdentifiedMotion)
    return np.array([vehicle.motion.K2, vehicle.motion.T2, vehicle.hull.psi])


def _told(found: Identification, truth: Array) -> dict[str, Any]:
    told: dict[str, Any] = {"experiments": len(found.experiments)}
    for name, true in zip(NAMES, truth.tolist(), strict=True):
        e = found.parameters[name]
        told[name] = {
            "truth": true,
            "value": e.value,
            "std": e.std,
            "low": e.ci95[0],
            "high": e.ci95[1],
        }
    return told


def days(
    numbers: Iterable[int], folder: Path, *, target: float, rehearsed: bool
) -> Iterator[dict[str, Any]]:
    """Yield days by their numbers; those that `folder` has are not done again.

    A change of the package, or of the study, computes them anew.
    """
    own = [Path(__file__).with_name(f"{name}.py") for name in ("noise", "stopping", "truth")]
    store = Store(folder, target, rehearsed, source_hash(own))

    def day(number: int) -> dict[str, Any]:
        with tempfile.TemporaryDirectory() as files:
            return run_day(number, Path(files), target=target, rehearsed=rehearsed)

    for number in numbers:
        yield store.get(partial(day, number), "day", number)


def table(found: Sequence[dict[str, Any]], *, target: float) -> str:
    """Return how often the intervals held the truth, how large the errors were, when it stopped.

    Without a margin: where a day would have ended on standard deviations that just meet the target.
    """
    lines = ["when                   parameter  days  covered %     (95 %)  mean z  mean z2"]
    states = Counter(f["stop"]["state"] for f in found)
    good = [f["stop"] for f in found if f["stop"]["state"] == State.GOOD]
    fixed = [(f"after {n}", [f[str(n)] for f in found if str(n) in f]) for n in FIXED]
    bare = [_without_margin(f["each"], target) for f in found if f["each"]]
    for when, met in [("at the stop", good), ("without a margin", bare), *fixed]:
        for name in NAMES if met else ():
            p = [m[name] for m in met]
            z = np.array([(x["value"] - x["truth"]) / x["std"] for x in p])
            hits = sum(x["low"] <= x["truth"] <= x["high"] for x in p)
            low, high = (100.0 * share for share in binomial_interval(hits, len(p)))
            lines.append(
                f"{when:22} {name:9}  {len(p):4d}  {100.0 * hits / len(p):9.1f}  "
                f"{low:4.1f}-{high:4.1f}  {z.mean():+6.2f}  {np.mean(z**2):7.2f}"
            )
    counts = sorted(Counter(m["experiments"] for m in good).items())
    lines.append("experiments at the stop: " + ", ".join(f"{k}: {c}" for k, c in counts))
    lines.append("ended: " + ", ".join(f"{state} {c}" for state, c in states.most_common()))
    return "\n".join(lines)


def _without_margin(each: dict[str, Any], target: float) -> dict[str, Any]:
    told = list(each.values())
    met = (t for t in told if all(t[n]["std"] <= target * t[n]["value"] for n in ("K2", "T2")))
    return dict(next(met, told[-1]))


def main(given: Sequence[str] | None = None) -> int:
    """Run the study, print its table, and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m studies.stopping", description=__doc__)
    parser.add_argument("--days", type=int, default=400, help="how many (400)")
    parser.add_argument("--first", type=int, default=0, help="number of the first (0)")
    parser.add_argument("--target", type=float, default=0.02, help="of K2 and T2 (0.02)")
    parser.add_argument("--rehearsed", action="store_true", help="by the rehearsal of `pool`")
    parser.add_argument("--out", type=Path, default=Path("report/stopping"), metavar="DIR")
    options = parser.parse_args(given)
    if options.days < 1 or options.first < 0 or not 0.0 < options.target < 1.0:
        parser.error(
            "--days: at least 1; --first: at least 0; --target: a share above 0 and below 1"
        )
    numbers = range(options.first, options.first + options.days)
    found = list(days(numbers, options.out, target=options.target, rehearsed=options.rehearsed))
    print(table(found, target=options.target))
    return 0


if __name__ == "__main__":
    sys.exit(main())
