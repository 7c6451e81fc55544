"""What a log shows as it grows: samples in, rest, changes of volume and experiments out."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.pool_day.rest import Rest
from swimbladder.design.pool_day.volume import steadied


class Sample(NamedTuple):
    """A row of a log."""

    time: float  # s
    depth: float  # m
    volume: float  # m3, of any zero


class End(Enum):
    """What ended an experiment."""

    TRAVEL = "it had gone far enough"
    SURFACE = "it reached the surface"
    BOTTOM = "it reached the bottom"
    STOPPED = "it was stopped, by the bottom it seems"
    PISTON = "the piston moved"
    GAP = "the log has a gap"
    LONG = "it took too long"
    LOG = "the log ended"


class Why(Enum):
    """Why a stretch of the log is no experiment."""

    NOT_AT_REST = "the volume was changed before the vehicle was at rest"
    NOT_SETTLED = "the volume did not stand still"
    SHORT = "the vehicle hardly moved"
    FEW_SAMPLES = "there are too few samples"
    STUCK = "the volume was changed and the vehicle did not move"


class Cut(NamedTuple):
    """An experiment, cut out of a log."""

    rest: Rest  # before it
    samples: tuple[Sample, ...]  # from a little before the release on
    released: float  # s
    change: float  # m3, of the volume, from the mean of the rest
    travel: float  # m, to the furthest point, positive down
    end: End
    turns: int = 0  # changes of volume under way

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Return the columns of a log that `identify` reads.

        The volume counts from where the vehicle was neutral: the mean over the minute of rest. So
        does its first row, since a log's first row is taken as neutral; what the piston did there,
        while it held the depth, is not: it jitters about that mean. While it stands: `steadied`.
        """
        time, depth, volume = np.array(self.samples).T
        glide = time >= self.released
        volume[glide] = steadied(time[glide], volume[glide])
        volume = volume - self.rest.neutral
        volume[0] = 0.0
        return {"time_s": time, "depth_m": depth, "volume_m3": volume}


class Ready(NamedTuple):
    """The vehicle has been at rest for a minute."""

    time: float  # s
    rest: Rest


class Changed(NamedTuple):
    """The volume was changed, and stands: an experiment is under way."""

    time: float  # s, of the release
    change: float  # m3
    rest: Rest


class Turned(NamedTuple):
    """The volume was changed again under way, and stands."""

    time: float  # s
    volume: float  # m3, above the one at rest


class Ended(NamedTuple):
    """An experiment is over."""

    time: float  # s
    cut: Cut


class Refused(NamedTuple):
    """A stretch of the log looks like an experiment and is none."""

    time: float  # s
    why: Why
    number: float  # m/s, m3, m or samples: by how much
    end: End | None = None


Event = Ready | Changed | Turned | Ended | Refused
