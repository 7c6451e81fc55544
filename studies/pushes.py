"""What the supervisor's pushes outward cost the vehicle of the paper, and what they save it from.

``python -m studies.pushes [--law LAW ...] [--runs 100]`` prints, for laws alone and under the
supervisor, how they hold 2 m for 20 minutes, when they settle after a step, and how many pistons
that are blocked somewhere outward take the vehicle down with them: one in every 2 cm3 up to 200 cm3
above the volume that is neutral at 1.5 m, on ways down from there. 2 mm of noise.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from studies.tuned import FAST, gains_of, noisy
from swimbladder.control.cascade import CASCADE
from swimbladder.control.law import Law
from swimbladder.control.registry import bind
from swimbladder.sim.closed_loop import simulate_ensemble
from swimbladder.vehicle import Vehicle

__all__ = ["WAYS", "drowned", "law_of", "main", "way"]

_TICK, _START = 0.3, 1.5  # s, m
_FROM = 120.0  # s, from which on a way down is asked for
_LAWS = (*FAST, "observer", CASCADE.name)
_STEP = 3.0  # m
WAYS = ((3.0, math.inf), (20.0, math.inf), (20.0, 0.3), (20.0, 0.1))  # m, m/s
_DOWN = 1.0  # m below what is asked for, where a vehicle is lost


def law_of(name: str, vehicle: Vehicle) -> tuple[Law, Any]:
    """Return a law and its parameters: the paper's, or of the tuning that `tune` finds."""
    if name == CASCADE.name:
        assert vehicle.controller is not None
        return bind(vehicle.controller)[:2]
    return gains_of(name)


def way(to: float, speed: float) -> list[tuple[float, float]]:
    """Return the set-points of a way down to a depth [m]: a step for an infinite speed [m/s]."""
    times = np.arange(0.0, (to - _START) / speed, _TICK)
    under_way = [(_FROM + float(t), _START + speed * (float(t) + _TICK)) for t in times[:-1]]
    return [(0.0, _START), *under_way, (_FROM + (float(times[-1]) if len(times) else 0.0), to)]


def _flown(name: str, count: int, *, supervised: bool, duration: float, **how: Any) -> Any:
    vehicle = noisy("fast")
    law, parameters = law_of(name, vehicle)
    return simulate_ensemble(
        vehicle,
        law=law,
        parameters=parameters,
        sample_time=_TICK,
        count=count,
        duration=duration,
        seed=1,
        supervised=supervised,
        **how,
    )


def drowned(name: str, to: float, speed: float, *, supervised: bool) -> int:
    """Return how many vehicles of 96 a blocked piston takes down, on a way to a depth [m]."""
    plant_psi = noisy("fast").hull.psi
    blocks = plant_psi * _START + np.arange(8e-6, 200e-6, 2e-6)
    ways = {"setpoints": way(to, speed), "start_depth": _START, "vary": {"V_max": blocks}}
    ran = _flown(name, len(blocks), supervised=supervised, duration=1100.0, **ways)
    return int((ran["final_depth"] > to + _DOWN).sum())


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.pushes", description=__doc__)
    parser.add_argument("--law", nargs="+", default=_LAWS, help="laws")
    parser.add_argument("--runs", type=int, default=100, help="runs of each")
    given = parser.parse_args(arguments)
    ways = [
        f"to {to:g} m {'at once' if speed == math.inf else f'at {speed} m/s'}" for to, speed in WAYS
    ]
    step = f"{_START} to {_STEP} m: settled, median and 95 % [s]"
    print(
        "| law | supervised | holding 2 m [mm] | [L/h] |", step, "| drowned", " | ".join(ways), "|"
    )
    print("|---" * (5 + len(ways)) + "|")
    for name in given.law:
        for supervised in (False, True):
            hold = _flown(
                name,
                given.runs,
                supervised=supervised,
                duration=1200.0,
                setpoints=[(0.0, 2.0)],
                start_depth=2.0,
            )
            moved = _flown(
                name,
                given.runs,
                supervised=supervised,
                duration=420.0,
                setpoints=way(_STEP, math.inf),
                start_depth=_START,
            )
            settled = np.nan_to_num(moved["settle2"].to_numpy(), nan=math.inf)
            middle, most = np.quantile(settled, (0.5, 0.95), method="higher")
            cells = [
                name,
                "yes" if supervised else "no",
                f"{1e3 * float(hold['rms_error'].median()):.1f}",
                f"{3e3 * float(hold['actuator_travel'].median()):.2g}",
                f"{middle:.1f}, {most:.1f}",
                *(str(drowned(name, *one, supervised=supervised)) for one in WAYS),
            ]
            print("|", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
