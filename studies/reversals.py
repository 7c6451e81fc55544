"""What runs one way and runs out and back ask of a motor, on the vehicle of the paper.

``python -m studies.reversals [--runs 100]`` prints starts, reversals, the jumps of the voltage at
both, and the heat that the jumps make, of the laws observer and pulse with tuned tuning.

A winding whose voltage jumps by U takes U/R more current until the speed has followed, with T1:
U^2 T1/(2 R) of heat. R is not known of this motor; what is printed is the heat times R.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

import numpy as np

from swimbladder.control.law import TuningParameters
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.tuning.gains import gains, setting_of, tunable
from swimbladder.design.tuning.region import region
from swimbladder.design.tuning.trial import Drawn, Step, traces
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant

__all__ = ["KNOBS", "asked", "main"]

_DEPTH, _SUPPLY, _TICK = 2.0, 12.0, 0.3  # m, V, s
_STEP = Step(_DEPTH, _DEPTH + 1e-4, 2700.0)
_STILL = 1e-8  # m3 in a sample, as trials have it
_SLOW = TuningParameters(
    frequency=0.046, damping=1.0, inner=1.0, sharpness=5.0, learning=0.7, dead=3.5e-8
)
KNOBS: Mapping[str, TuningParameters] = {  # as `tune --goal quiet` finds them, rounded
    "observer": _SLOW._replace(pause=24.0, band=0.027),
    "pulse": _SLOW._replace(pause=72.0, band=0.026),
}


def asked(name: str, *, runs: int, step: Step = _STEP, seed: int = 3) -> dict[str, float]:
    """Return what a law asks of the motor in an hour, over the last two thirds of some runs.

    starts and turns [1/h], their jumps of the voltage [V], heat of all jumps and of holding the
    piston times R [V2 s/h], moved [L/h] and the share of the time that the volume moves.
    """
    vehicle = load_vehicle("feup-em")
    sensors = vehicle.sensors.model_copy(update={"depth_noise": 2e-3, "depth_quantum": 5e-3})
    vehicle = vehicle.model_copy(update={"sensors": sensors})
    p = plant(vehicle)
    s = setting_of(vehicle, sample_time=_TICK, supply=_SUPPLY, neutral_range=20e-6)
    found = traces(
        vehicle,
        BoundLaw(tunable(name), gains(name, s, KNOBS[name]), _TICK),
        step,
        Drawn(runs, region(vehicle)._replace(neutral=0.0), _SUPPLY, seed=seed),
    )
    late = found.time >= found.time[-1] / 3.0
    moves = np.diff(found.volume[late], axis=0)
    moving = np.abs(moves) > _STILL
    load = p.load_drive * found.depth[late][:-1]
    drive = found.command[late][:-1] - load
    begins = moving[1:] & ~moving[:-1]
    turns = (moves[1:] * moves[:-1] < 0.0) & moving[1:] & moving[:-1]
    jumps = np.diff(drive, axis=0)
    hours = moves.size * _TICK / 3600.0
    return {
        "starts": begins.sum() / hours,
        "turns": turns.sum() / hours,
        "start_V": float(np.median(np.abs(drive[1:][begins]))) if begins.any() else 0.0,
        "turn_V": float(np.median(np.abs(jumps[turns]))) if turns.any() else 0.0,
        "jump_heat": float((jumps**2).sum()) * p.T1 / 2.0 / hours,
        "hold_heat": float(np.mean(load**2)) * 3600.0,
        "moved": float(np.abs(moves).sum()) * 1e3 / hours,
        "share": float(moving.mean()),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.reversals", description=__doc__)
    parser.add_argument("--runs", type=int, default=100, help="of 45 minutes, for each law")
    given = parser.parse_args(arguments)
    found = {name: asked(name, runs=given.runs) for name in KNOBS}
    print("| an hour | " + " | ".join(found) + " |\n|---|" + "---|" * len(found))
    for words, key, form in (
        ("starts from rest", "starts", "{:.0f}"),
        ("reversals", "turns", "{:.0f}"),
        ("jump at a start [V]", "start_V", "{:.2f}"),
        ("jump at a reversal [V]", "turn_V", "{:.2f}"),
        ("heat of jumps times R [V2 s]", "jump_heat", "{:.2g}"),
        ("heat of holding times R [V2 s]", "hold_heat", "{:.2g}"),
        ("moved [L]", "moved", "{:.2f}"),
        ("share of the time", "share", "{:.2f}"),
    ):
        print(f"| {words} | " + " | ".join(form.format(x[key]) for x in found.values()) + " |")


if __name__ == "__main__":
    main()
