"""What the supervisor's pushes outward cost a healthy vehicle, the vehicle of the paper.

``python -m studies.pushes [--runs 5]`` prints, for laws with and without pushes, motor starts and
volume moved in 20 minutes of holding 2 m, and how long the way from 1 to 20 m takes and moves,
means over seeds of noise (2 mm, quantum 5 mm).
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from studies.reversals import KNOBS as SLOW
from swimbladder.codegen.clock import ControllerTwin, VehicleTwin
from swimbladder.control.cascade import CASCADE
from swimbladder.control.law import NEVER, Law
from swimbladder.control.registry import bind
from swimbladder.control.supervisor_limits import command_limits, supervisor_parameters
from swimbladder.design.tuning.gains import gains, setting_of, tunable
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Vehicle

__all__ = ["Cost", "cost", "main"]

_TICK, _SUPPLY, _RANGE = 0.3, 12.0, 20e-6  # s, V, m3
_LAWS = ("cascade", "observer", "deadband")
_KNOBS = {"observer": SLOW["observer"], "deadband": SLOW["observer"]._replace(pause=15.0, band=0.2)}
_STILL = 1e-8  # m3 in a tick
_HOLD, _DIVE, _LIMIT = (2.0, 2.0), (1.0, 20.0), 1200.0  # m, m, s
_THERE = 0.2  # m


class Cost(NamedTuple):
    """What a flight asks of the motor, and when it is there."""

    starts: float
    moved: float  # L
    arrival: float  # s; nan: never
    pushed: float  # s, in which the supervisor pushed
    alarm: bool


def _vehicle() -> Vehicle:
    vehicle = load_vehicle("feup-em")
    sensors = vehicle.sensors.model_copy(update={"depth_noise": 2e-3, "depth_quantum": 5e-3})
    return vehicle.model_copy(update={"sensors": sensors})


def _law(name: str, vehicle: Vehicle) -> tuple[Law, Any]:
    """Return a law and its parameters: the paper's, or of rounded knobs."""
    if name == CASCADE.name:
        assert vehicle.controller is not None
        return bind(vehicle.controller)[:2]
    setting = setting_of(vehicle, sample_time=_TICK, supply=_SUPPLY, neutral_range=_RANGE)
    return tunable(name), gains(name, setting, _KNOBS[name])


def cost(
    name: str, way: tuple[float, float], *, pushes: bool, seed: int, duration: float = _LIMIT
) -> Cost:
    """Return what a law asks of the motor on a way [m], with the supervisor's pushes or without."""
    vehicle = _vehicle()
    law, parameters = _law(name, vehicle)
    low, high = command_limits(vehicle)
    limits = supervisor_parameters(vehicle, _TICK)
    if not pushes:
        off = limits.proof._replace(same_tried=NEVER, unproven=NEVER)
        limits = limits._replace(proof=off)
    own = ControllerTwin(law, parameters, tick_s=_TICK, low=low, high=high)
    board = VehicleTwin(own, limits)
    pushed = 0

    def watched(seen: Any, reference: float) -> float:
        nonlocal pushed
        command = board(seen, reference)
        pushed += board.reason is None and command != own.command
        return command

    start, target = way
    ran = simulate(
        vehicle,
        law=watched,
        sample_time=_TICK,
        setpoints=[(0.0, target)],
        start_depth=start,
        duration=duration,
        seed=seed,
    )
    moves = np.diff(ran.volume)
    moving = np.abs(moves) > _STILL
    near = np.flatnonzero(np.abs(ran.depth - target) <= _THERE)
    return Cost(
        starts=float(np.sum(moving[1:] & ~moving[:-1])),
        moved=1e3 * float(np.abs(moves).sum()),
        arrival=float(ran.time[near[0]]) if len(near) else math.nan,
        pushed=pushed * _TICK,
        alarm=board.reason is not None,
    )


def _mean(name: str, way: tuple[float, float], *, pushes: bool, runs: int) -> Cost:
    found = [cost(name, way, pushes=pushes, seed=seed) for seed in range(runs)]
    return Cost(*np.mean([[float(x) for x in one] for one in found], axis=0))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.pushes", description=__doc__)
    parser.add_argument("--runs", type=int, default=5, help="seeds of each")
    given = parser.parse_args(arguments)
    print(
        "| law | pushes | holding: starts in 20 min | moved [L] | pushed [s] "
        "| 1 to 20 m: there after [s] | moved in 20 min [L] | pushed [s] | alarms |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name in _LAWS:
        for pushes in (False, True):
            hold = _mean(name, _HOLD, pushes=pushes, runs=given.runs)
            dive = _mean(name, _DIVE, pushes=pushes, runs=given.runs)
            print(
                f"| {name} | {'with' if pushes else 'without'} | {hold.starts:.1f} "
                f"| {hold.moved:.3f} | {hold.pushed:.1f} | {dive.arrival:.0f} | {dive.moved:.2f} "
                f"| {dive.pushed:.1f} | {hold.alarm + dive.alarm:g} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
