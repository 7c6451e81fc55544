"""The numbers that distinguish the phases of the procedure."""

from __future__ import annotations

import math
from typing import NamedTuple

FEWEST = 12  # samples of an experiment


class Rules(NamedTuple):
    """Numbers that distinguish the phases; the first three are those of control.protocol."""

    minute: float = 60.0  # s, over which rest is judged
    rest_speed: float = 5e-4  # m/s
    rest_distance: float = 0.02  # m
    still_speed: float = 2e-3  # m/s, up to which a release is taken, and said to be hasty
    change: float = 3e-6  # m3, least change of volume that is one
    surface: float = 0.1  # m, where a glide upward is over
    bottom: float = math.inf  # m, where one downward is over
    margin: float = 0.05  # m, within which a vehicle that something stops does not move
    travel: float = 3.0  # m, after which a glide is over
    turns: bool = False  # whether the volume may be changed again under way, as plans have it
    least_travel: float = 0.3  # m, of an informative glide
    longest: float = 1200.0  # s, of a glide
    gap: float = 5.0  # s without a sample, which ends everything
    before: float = 3.0  # s of rest that an experiment's record begins with
