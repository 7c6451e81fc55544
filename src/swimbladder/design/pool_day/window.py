"""The latest samples of a log as columns, for looks at stretches of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.pool_day.growing_log import Sample

Array = NDArray[np.float64]

TIME, DEPTH, VOLUME, SMOOTH = range(4)  # SMOOTH: the median of the last five depths
_WIDTH = 5


class Window:
    """Rows of time [s], depth [m], volume [m3] and smoothed depth [m], the latest last."""

    def __init__(self) -> None:
        self._rows = np.empty((512, 4))
        self._first = self._end = 0

    def add(self, sample: Sample) -> None:
        """Append a sample."""
        if self._end == len(self._rows):
            kept = self.rows
            self._rows = np.empty((max(512, 2 * len(kept)), 4))
            self._rows[: len(kept)] = kept
            self._first, self._end = 0, len(kept)
        row = self._rows[self._end]
        row[:3] = sample
        self._end += 1
        last = self._rows[max(self._first, self._end - _WIDTH) : self._end, DEPTH].tolist()
        row[SMOOTH] = sorted(last)[len(last) // 2]

    def forget_before(self, time: float) -> None:
        """Drop the samples from before a time [s]."""
        while self._first < self._end and self._rows[self._first, TIME] < time:
            self._first += 1

    def clear(self) -> None:
        """Drop all samples."""
        self._first = self._end = 0

    @property
    def rows(self) -> Array:
        """All samples [n, 4]; a view that the next `add` may invalidate."""
        return self._rows[self._first : self._end]

    def since(self, time: float) -> Array:
        """Return the samples after a time [s]."""
        rows = self.rows
        return rows[int(np.searchsorted(rows[:, TIME], time, side="right")) :]
