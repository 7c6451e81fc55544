"""A record as an experiment: its informative stretches, and what drives them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from swimbladder.errors import LogError
from swimbladder.estimation.comparison.record import Record
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

_FEWEST = 12  # samples of a stretch
_SHORTEST = 3.0  # s of a stretch
_GAP = 5.0  # median sample times without a sample, after which the volume is no longer known
_PARABOLA = 3.0  # s, for the state at the start of a stretch
_FINE = 0.02  # m, that no depth near a line is left aside for
_FIRST = 9  # samples, whose median is the depth of rest at the start


class Segment(NamedTuple):
    """A stretch of a record under way: every sample of it is compared."""

    first: int
    last: int  # included
    depth: float  # m, at the first sample, from a parabola through the first ones
    speed: float  # m/s, likewise


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A log as the fit takes it. The neutral volume at `reference` is `neutral` + its error."""

    source: str
    record: Record
    inputs: Array  # volume [m3] or voltage [V]
    ramps: bool  # the inputs are volumes, linear between samples
    reference: float  # m, where the error of the neutral volume counts from
    neutral: float  # m3, assumed at the reference, in the zero of `inputs`
    added: float = 0.0  # m3, what the water's layers add at the reference: in `neutral` already
    segments: tuple[Segment, ...]

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which samples the fit uses."""
        mask = np.zeros(len(self.record.time), np.bool_)
        for s in self.segments:
            mask[s.first : s.last + 1] = True
        return mask

    def tiles(self, length: float) -> Experiment:
        """Return the experiment in stretches of about `length` [s], each with a start of its own.

        Over a short one no error of the parameters grows far: a fit there has one minimum.
        """
        if not self.ramps:
            return self
        found: list[Segment] = []
        for s in self.segments:
            span = float(self.record.time[s.last] - self.record.time[s.first])
            count = max(1, min(round(span / length), (s.last - s.first + 1) // _FEWEST))
            edges = np.linspace(s.first, s.last + 1, count + 1).astype(int).tolist()
            found += [_segment(self.record, a, b - 1) for a, b in pairwise(edges)]
        return replace(self, segments=tuple(found))

    def step(self) -> float:
        """Return the volume against neutral that the experiment is run with [m3]: its median."""
        if not self.ramps:
            return float(np.ptp(self.inputs))
        return float(np.median(np.abs(self.inputs[self.used] - self.neutral)))


def experiment(source: str, record: Record, vehicle: Vehicle) -> Experiment:
    """Return a record as an experiment.

    A volume with a zero of its own counts from the first sample, where the vehicle is taken as
    neutral; an absolute one from mid-stroke, neutral at depth 0 with the vehicle's trim.
    Raises LogError where no stretch of it is under way, clear of surface and bottom, long enough.
    """
    volume = record.volume
    if record.drive == "volume" and volume is not None:
        absolute = record.volume_absolute
        inputs = volume if absolute else volume - volume[0]
        reference = 0.0 if absolute else _first_depth(record)
        neutral = vehicle.trim_error if absolute else 0.0
    else:
        assert record.voltage is not None  # record() checks it
        inputs, reference, neutral = record.voltage, _first_depth(record), 0.0
        absolute = False
    ramps = record.drive == "volume"
    segments = _stretches(record) if ramps else _whole(record)
    if not segments:
        raise LogError(
            f"no stretch of {_SHORTEST:g} s or more is clear of surface and bottom",
            file=source, field="depth_m", value=float(record.depth.max()), unit="m",
            remedy="Check the unit of the depth, --bottom and --surface-margin",
        )  # fmt: skip
    return Experiment(
        source=source, record=record, inputs=inputs, ramps=ramps, reference=reference,
        neutral=neutral, added=0.0 if absolute else record.layers.at(reference), segments=segments,
    )  # fmt: skip


def _first_depth(record: Record) -> float:
    """Return the depth at the first sample [m], whatever outlier that may be."""
    near = record.time - record.time[0] <= _PARABOLA
    return float(np.median(record.depth[near][:_FIRST]))


def _clear(record: Record) -> NDArray[np.bool_]:
    """Return which samples are clear of surface and bottom; a spike to there is not a visit."""
    clear: NDArray[np.bool_] = median_filter(record.compared, size=5, mode="nearest")
    return clear


def _whole(record: Record) -> tuple[Segment, ...]:
    """Return the record from its first sample on: without its volume it cannot be cut."""
    clear = _clear(record)
    if not clear[0]:
        return ()
    last = int(np.argmin(np.append(clear, False))) - 1
    return (_segment(record, 0, last),) if last + 1 >= _FEWEST else ()


def _stretches(record: Record) -> tuple[Segment, ...]:
    time, clear = record.time, _clear(record)
    step = float(np.median(np.diff(time)))
    broken = ~clear[1:] | ~clear[:-1] | (np.diff(time) > _GAP * step)
    edges = np.concatenate([[-1], np.flatnonzero(broken), [len(time) - 1]])
    found = []
    for before, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        first = before + 1
        enough = last - first + 1 >= _FEWEST and time[last] - time[first] >= _SHORTEST
        if enough and clear[first]:
            found.append(_segment(record, first, last))
    return tuple(found)


def _segment(record: Record, first: int, last: int) -> Segment:
    """Return a stretch with depth and speed at its start, outliers left aside.

    An outlier among the first samples would begin the search at a speed that no later sample can
    mend: the model leaves the water, where its derivatives say nothing.
    """
    time, depth = record.time[first : last + 1], record.depth[first : last + 1]
    near = time - time[0] <= _PARABOLA
    near[: min(6, len(near))] = True
    t, z = time[near] - time[0], depth[near]
    i, j = np.triu_indices(len(t), 1)
    speed = float(np.median((z[j] - z[i]) / (t[j] - t[i])))  # Theil and Sen's line
    start = float(np.median(z - speed * t))
    off = np.abs(z - start - speed * t)
    kept = off <= max(5.0 * float(np.median(off)), _FINE)
    if kept.sum() > 8:
        start, speed, _ = np.polynomial.polynomial.polyfit(t[kept], z[kept], 2).tolist()
    return Segment(first, last, start, speed)
