"""What is odd about a log: disorder and repeats, gaps, samples that stand far off."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from swimbladder.io.log_table import Table
from swimbladder.io.log_text import LogFile, counted
from swimbladder.physics.arrays import Array, Flags

_GAP = 5.0  # median steps
_FAR = 8.0  # standard deviations of the noise
_FASTER = 3.0  # times the largest steps that the signal is seen to keep up
_QUANTA = 4.0
_NEAR = 10  # samples on either side that define what is noise
_BESIDE = 4  # and how fast the signal moves
_SCALE = 1.4826  # standard deviation over median absolute deviation, of a normal distribution
_FEWEST = 9  # samples that can define what is normal
_SHOWN = 3  # places that a report names
_PIECE = 1 << 16  # samples that are judged at once
# Steps of a coarse sensor, for a signal that otherwise hardly changes: a flicker is no spike.
_COARSE = {"depth_m": 0.025, "piston_m": 2e-4, "volume_m3": 5e-7}


def in_order(table: Table, file: LogFile, several: str) -> Table:
    """Return the rows with time increasing; those that repeat a time are dropped.

    several: what to do where the file holds several logs. Raises LogError where time goes back.
    """
    time, report = table.values["time_s"], file.report
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back) and file.form.rows == "sort":
        report.append(f"rows sorted by time: it went back {counted(len(back), 'time')}")
        table = table.only(np.argsort(time, kind="stable"))
    elif len(back):
        at = int(back[0]) + 1
        what = f"time goes back, {counted(len(back), 'time')} in the log"
        remedy = f'If the file is in disorder, {several}or set rows = "sort" in its [log] table'
        line, value = table.line[at], float(time[at])
        raise file.refused(what, remedy, "time_s", line=line, value=value, unit="s")
    again = np.append(False, np.diff(table.values["time_s"]) <= 0.0)
    if not again.any():
        return table
    kept = np.flatnonzero(~again)
    first = kept[np.searchsorted(kept, np.flatnonzero(again)) - 1]
    others = np.zeros(len(first), dtype=bool)
    for values in table.values.values():
        a, b = values[again], values[first]
        others |= (a != b) & (np.isfinite(a) | np.isfinite(b))
    unlike = f", {int(others.sum())} of them with other values" if others.any() else ""
    repeats = counted(int(again.sum()), "row")
    report.append(f"{repeats} with the time of the row before dropped{unlike}")
    return table.only(~again)


def find_gaps(table: Table, file: LogFile) -> tuple[tuple[float, float], ...]:
    """Return (time before, time after) [s] of every gap: a longer step than the format says.

    Where it says none, than five times the median step.
    """
    time, line, longest = table.values["time_s"], table.line, file.form.gap
    steps = np.diff(time)
    limit = _GAP * float(np.median(steps)) if longest is None else longest
    at = np.flatnonzero(steps > limit * (1.0 + 1e-9))
    if len(at):
        shown = [f"{steps[k]:.4g} s after {time[k]:.6g} s (line {line[k]})" for k in at[:_SHOWN]]
        more = ", ..." if len(at) > _SHOWN else ""
        gaps = f"{counted(len(at), 'gap')} of more than {limit:.3g} s"
        whole = f"{steps[at].sum():.4g} s in all"
        file.report.append(f"{gaps}, {whole}: {', '.join(shown)}{more}")
    return tuple((float(time[k]), float(time[k + 1])) for k in at)


def suspects(table: Table, gaps: Sequence[tuple[float, float]], file: LogFile) -> Flags:
    """Return which samples have a spike in depth, volume, piston or voltage."""
    data, found = table.values, np.zeros(len(table.line), dtype=bool)
    done = "dropped" if file.form.spikes == "drop" else 'kept; spikes = "drop" would leave them out'
    for name in ("depth_m", "volume_m3", "piston_m", "voltage_V"):
        if name not in data:
            continue
        spiky = spikes(name, data[name], data["time_s"], gaps)
        if not spiky.any():
            continue
        found |= spiky
        lines = [str(number) for number in table.line[spiky][:_SHOWN]]
        more = ", ..." if spiky.sum() > _SHOWN else ""
        odd = f"{counted(int(spiky.sum()), 'single sample')} of {name} far off the others"
        file.report.append(f"{odd}, on line {', '.join(lines)}{more}: {done}")
    return found


def spikes(name: str, values: Array, time: Array, gaps: Sequence[tuple[float, float]]) -> Flags:
    """Return which single samples of a column stand far off both their neighbours.

    A Hampel test over three samples: how far a sample is from their median, against the noise, as
    the median absolute deviation around it gives, and against what may be true: the quantum of the
    sensor, and the fastest motion that the signal is seen to keep up, nearby or anywhere. A voltage
    may jump, so only one far beyond all others counts. The first and the last sample, and those
    beside a gap or a missing value, are not judged.
    """
    mask = np.zeros(len(values), dtype=bool)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < _FEWEST:
        return mask
    x, t = values[known], time[known]
    into, out = np.diff(x)[:-1], -np.diff(x)[1:]
    whole = np.diff(known) == 1
    for before, after in gaps:
        whole[np.searchsorted(t, before, side="right") - 1 : np.searchsorted(t, after)] = False
    judged = (into * out > 0.0) & whole[:-1] & whole[1:]
    height = np.pad(np.where(judged, np.minimum(np.abs(into), np.abs(out)), 0.0), 1)
    if not height.any():
        return mask
    jumps = name == "voltage_V"
    limit = _jumping(x, height) if jumps else _moving(x, t, height, _COARSE.get(name, 0.0))
    mask[known] = height > limit
    return mask


def _moving(x: Array, t: Array, height: Array, coarse: float) -> Array:
    """Return how far a sample of a signal that cannot jump may stand off."""
    steps = np.diff(x)
    ahead, behind = np.diff(t)[1:], np.diff(t)[:-1]
    bend = np.abs(x[1:-1] - (x[:-2] * ahead + x[2:] * behind) / (ahead + behind))
    noise = _SCALE / np.sqrt(1.5) * np.maximum(_around(bend, _NEAR, np.median), np.median(bend))
    twice = np.minimum(np.abs(steps[:-1]), np.abs(steps[1:])) * (steps[:-1] * steps[1:] > 0.0)
    thrice = np.minimum(twice[:-1], twice[1:])  # two spikes side by side do not look like that
    fastest = np.maximum(_around(twice, _BESIDE, np.max), np.quantile(thrice, 0.99))
    limit = np.maximum(_FAR * noise, _FASTER * fastest)
    quanta = _QUANTA * _quantum(steps, height, coarse)
    return np.asarray(np.maximum(np.pad(limit, 1), quanta), dtype=np.float64)


def _around(values: Array, reach: int, of: Callable[..., Any]) -> Array:
    """Return what `of` makes of the values near each, itself and the two beside it left out."""
    padded = np.pad(values, reach, mode="reflect" if len(values) > reach else "edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    near = [k for k in range(2 * reach + 1) if abs(k - reach) > 1]
    pieces = (windows[k : k + _PIECE, near] for k in range(0, len(windows), _PIECE))
    return np.concatenate([of(piece, axis=1) for piece in pieces], dtype=np.float64)


def _quantum(steps: Array, height: Array, coarse: float) -> float:
    """Return the smallest step of a signal, all but those into and out of its farthest samples."""
    far = height >= max(height.max() / 2.0, np.finfo(float).tiny)
    others = np.abs(steps[~(far[:-1] | far[1:])])
    others = others[others > 0.0]
    if not len(others):
        return coarse
    smallest = float(np.quantile(others, 0.05))
    return smallest if len(others) >= _FEWEST else min(smallest, coarse)


def _jumping(x: Array, height: Array) -> Array:
    """Return how far a sample of a signal that may jump may stand off: three times its range."""
    others = x[height < max(height.max() / 2.0, np.finfo(float).tiny)]
    widest = float(np.abs(others - np.median(others)).max())
    return np.full(len(x), _FASTER * widest if widest > 0.0 else np.inf)
