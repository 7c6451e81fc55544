"""What an experiment in the pool leaves behind, and experiments without any of a pool's errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import NoAnswerError
from swimbladder.sim.closed_loop import drive
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]


class Record(NamedTuple):
    """An experiment as the fits take it; evenly sampled, from rest at the first sample."""

    time: Array  # s, from 0
    depth: Array  # m, as the sensor said
    volume: Array  # m3, above the neutral volume
    start: float  # m, depth of rest


def still_starts(
    vehicle: Vehicle, *, dVs: Sequence[float], travel: float = 3.0, sample_time: float = 0.3,
    start: float = 10.0, longest: float = 300.0,
) -> tuple[Record, ...]:  # fmt: skip
    """Return experiments without noise, the volume changed at once from an exactly neutral rest.

    dVs [m3], either sign; travel: where a record ends [m]; start: depth of rest [m], which changes
    nothing as long as neither surface nor bottom is met. Raises NoAnswerError where the vehicle has
    not travelled so far after `longest` [s].
    """
    records = []
    time = np.arange(math.floor(longest / sample_time) + 1) * sample_time
    for dV in dVs:
        volume = np.full(len(time), vehicle.neutral_volume(start) + dV)
        s = drive(vehicle, time=time, volume=volume, start_depth=start)
        inside = np.abs(s.depth - start) <= travel
        if inside.all():
            raise NoAnswerError(
                f"With {dV * 1e6:g} cm3 the vehicle does not travel {travel:g} m in {longest:g} s: "
                "give a larger volume or more time"
            )
        n = int(np.argmin(inside))
        records.append(Record(s.time[:n], s.depth[:n], np.full(n, dV), start))
    return tuple(records)
