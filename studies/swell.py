"""What swell in the reading does to a vehicle that is held: `python -m studies.swell`.

Prints, for the vehicle of the paper under the three fast laws, how far it goes to and fro where the
depth sensor reads a swell that the water about the vehicle does not have, and the volume moved.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from studies.tuned import FAST, gains_of, noisy
from swimbladder.sim.closed_loop import simulate_ensemble

__all__ = ["main", "swayed"]

_DEPTH, _TICK, _SPAN, _SEED = 3.0, 0.3, 1800.0, 3  # m, s, s


def swayed(
    name: str, *, height: float = 0.03, period: float = 8.0, span: float = _SPAN
) -> dict[str, float]:
    """Return what a law makes of a sine of the reading, over the last two thirds.

    height [m]: its amplitude. amplitude [m]: half of what the depth covers; rms [m]: about the
    set-point; moved [L/h].
    """
    law, numbers = gains_of(name)
    time = np.arange(0.0, span + 0.5 * _TICK, _TICK)
    wave = height * np.sin(2.0 * np.pi / period * time)
    data = simulate_ensemble(
        noisy("fast"),
        count=1,
        setpoints=[(0.0, _DEPTH)],
        duration=span,
        start_depth=_DEPTH,
        law=law,
        parameters=numbers,
        sample_time=_TICK,
        seed=_SEED,
        keep="trajectory",
        depth_error=wave[: round(span / _TICK) + 1, None],
    )
    late = data["time"].to_numpy() >= span / 3.0
    depth, volume = (data[v].to_numpy()[late, 0] for v in ("depth", "volume"))
    moved = float(np.abs(np.diff(volume)).sum())
    return {
        "amplitude": 0.5 * float(np.ptp(depth)),
        "rms": float(np.sqrt(np.mean((depth - _DEPTH) ** 2))),
        "moved": 3.6e6 * moved / (2.0 / 3.0 * span),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.swell", description=__doc__)
    parser.add_argument(
        "--height",
        type=float,
        nargs="+",
        default=[2.0, 3.0, 4.0, 5.0, 7.0, 10.0],
        help="amplitudes of the reading [cm]",
    )
    parser.add_argument("--period", type=float, default=8.0, help="of the swell [s]")
    given = parser.parse_args(arguments)
    print("| the sensor reads | " + " | ".join(f"`{name}`" for name in FAST) + " |")
    print("|---|" + "---|" * len(FAST))
    for height in given.height:
        cells = [swayed(name, height=1e-2 * height, period=given.period) for name in FAST]
        words = [f"{1e2 * c['amplitude']:.1f} cm, {c['moved']:.0f} L/h" for c in cells]
        print(f"| {height:g} cm | " + " | ".join(words) + " |", flush=True)


if __name__ == "__main__":
    main()
