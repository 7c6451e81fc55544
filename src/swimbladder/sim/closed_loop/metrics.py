"""What a depth step looks like in numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class StepMetrics(NamedTuple):
    """A step response at its samples; times from the set-point on, None: never."""

    overshoot_pct: float  # % of the step beyond the target
    rise90_s: float | None  # first sample past 90 % of the step
    settle2_s: float | None  # last sample outside 2 % of the step
    final_depth_m: float


def step_metrics(time: ArrayLike, depth: ArrayLike, *, start: float, target: float) -> StepMetrics:
    """Return overshoot, 90 % rise and 2 % settling of a step from `start` to `target` [m].

    time [n] in s, counted from the first; depth [n] in m. The response has not settled where its
    last sample is outside 2 %. A step of zero length has neither overshoot nor rise.
    """
    t = np.asarray(time, float)
    z = np.asarray(depth, float)
    t = t - t[0]
    if target == start:
        return StepMetrics(0.0, None, None, float(z[-1]))
    share = (z - start) / (target - start)
    risen = np.flatnonzero(share > 0.9)
    outside = np.flatnonzero(np.abs(share - 1.0) > 0.02)
    if outside.size == 0:
        settled: float | None = 0.0
    else:
        settled = None if outside[-1] == len(t) - 1 else float(t[outside[-1]])
    return StepMetrics(
        overshoot_pct=float(max(share.max() - 1.0, 0.0) * 100.0),
        rise90_s=float(t[risen[0]]) if risen.size else None,
        settle2_s=settled,
        final_depth_m=float(z[-1]),
    )
