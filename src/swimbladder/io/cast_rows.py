"""From rows in the order of a file to a profile: one leg, no spikes, averaged, stable."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.cast_raw import RawCast
from swimbladder.io.cast_units import COLDEST, DEEPEST, MOST_SALT, WARMEST
from swimbladder.io.log_text import counted

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_TURN = 0.05  # share of the range, 1 dbar at least, that pressure goes back at a turn
_LONG = 0.5  # share of the longest leg that makes another one a profile
_SHUFFLED = 0.2  # mean step over the range: rows in no order have 1/3
_AROUND = 10  # rows on either side that a spike is held against
_FAR = 8.0  # standard deviations of the noise
_SCALE = 1.4826  # standard deviation over median absolute deviation, of a normal distribution
_FLOOR = {"temperature": 0.5, "salinity": 0.3}  # degC, -: less is no spike
_BIN = 1.0  # dbar
_BINS = 100  # at least, over a shallow cast


def legs(pressure: Array) -> list[tuple[int, int]]:
    """Return first and last row of each way down or up that is long: half the longest or more."""
    back = max(_TURN * float(np.ptp(pressure)), 1.0)
    turns = [0]
    high = low = 0
    way = 0
    for k, p in enumerate(pressure):
        high = k if p > pressure[high] else high
        low = k if p < pressure[low] else low
        if way >= 0 and pressure[high] - p > back:
            turns.append(high)
            way, low = -1, k
            high = k
        elif way <= 0 and p - pressure[low] > back:
            turns.append(low)
            way, high = 1, k
            low = k
        elif way > 0:
            low = k
        elif way < 0:
            high = k
    turns.append(high if way >= 0 else low)
    pairs = [(a, b) for a, b in pairwise(turns) if b > a] or [(0, len(pressure) - 1)]
    spans = [abs(float(pressure[b] - pressure[a])) for a, b in pairs]
    longest = max(spans)
    return [pair for pair, span in zip(pairs, spans, strict=True) if span >= _LONG * longest]


def one_leg(raw: RawCast, pressure: Array, profile: int | None) -> NDArray[np.int64]:
    """Return the rows of one way down or up, in the order of pressure.

    profile: which, counted from 1; not given: the only one, or of a cast down and up the way
    down. Raises LogError where there are several.
    """
    rows = np.arange(len(pressure))
    steps = np.abs(np.diff(pressure))
    if not steps.any():
        raise raw.refused(
            "all rows are of one pressure", field="pressure_dbar", value=float(pressure[0]),
            unit="dbar", remedy="Give a cast that goes down",
        )  # fmt: skip
    if steps.mean() > _SHUFFLED * float(np.ptp(pressure)) and len(pressure) > 5:
        raw.report.append("the rows are in no order and were sorted by pressure")
        return rows[np.argsort(pressure, kind="stable")]
    found = legs(pressure)
    if profile is not None and profile > len(found):
        raise raw.refused(
            f"the file has {counted(len(found), 'profile')}", field="--profile",
            value=profile, remedy=f"Choose from 1 to {len(found)}",
        )  # fmt: skip
    if profile is None and len(found) > 2:
        ends = ", ".join(
            f"{n}: {pressure[a]:.0f} to {pressure[b]:.0f} dbar"
            for n, (a, b) in enumerate(found[:6], start=1)
        )
        raise raw.refused(
            f"there are {len(found)} profiles in it ({ends}{', ...' if len(found) > 6 else ''})",
            field="profile",
            remedy="Choose one with --profile N, or rows with --where COLUMN=VALUE",
        )  # fmt: skip
    number = (profile or 1) - 1
    if profile is None and len(found) == 2:
        down = [pressure[b] > pressure[a] for a, b in found]
        number = down.index(True) if True in down else 0
        a, b = found[number]
        raw.report.append(
            f"it goes down and up again: the way {'down' if down[number] else 'up'} is taken, "
            f"{raw.at(a)} to {raw.at(b)}"
        )
    a, b = found[number]
    chosen = rows[a : b + 1]
    return chosen[np.argsort(pressure[chosen], kind="stable")]


def without_spikes(raw: RawCast, pressure: Array) -> Mask:
    """Return which rows, in the order of pressure, are no spikes; those left out are reported."""
    assert raw.salinity is not None
    good = (pressure >= 0.0) & (pressure <= DEEPEST)
    _say(raw, ~good, "above the surface")
    sane = (raw.temperature >= COLDEST) & (raw.temperature <= WARMEST)
    sane &= (raw.salinity >= 0.0) & (raw.salinity <= MOST_SALT)
    middle = float(np.median(raw.salinity))
    sane &= (raw.salinity >= 0.1 * middle) | (pressure > 5.0)  # the sensor still in air
    _say(raw, good & ~sane, "with salinity or temperature of no sea (sensor in air?)")
    good &= sane
    if good.sum() * 2 < len(good):
        k = int(np.flatnonzero(~good)[0])
        raise raw.refused(
            f"{int((~good).sum())} of {len(good)} rows cannot be sea water", k=k,
            field="salinity", value=float(raw.salinity[k]),
            remedy="Check which columns are temperature, salinity and pressure, and their units",
        )  # fmt: skip
    for name, floor in _FLOOR.items():
        values = np.asarray(getattr(raw, name))
        spiky = np.zeros(len(good), dtype=bool)
        spiky[good] = _spikes(values[good], floor)
        if spiky.any():
            k = int(np.flatnonzero(spiky)[np.argmax(np.abs(values[spiky]))])
            _say(raw, spiky, f"with {name} far off those around ({values[k]:.4g} at "
                 f"{pressure[k]:.1f} dbar)")  # fmt: skip
        good &= ~spiky
    return good


def _say(raw: RawCast, out: Mask, why: str) -> None:
    if out.any():
        first = raw.at(int(np.flatnonzero(out)[0]))
        raw.report.append(f"{counted(int(out.sum()), 'row')} {why} left out, the first on {first}")


def _spikes(values: Array, floor: float) -> Mask:
    """Return which values are far off the running median; ends have narrower windows."""
    off = np.abs(values - _running_median(values))
    noise = _SCALE * _running_median(off)
    return np.asarray(off > np.maximum(_FAR * noise, floor))


def _running_median(values: Array) -> Array:
    """Return the median of `_AROUND` values on either side, of as many as there are at the ends."""
    n, half = len(values), _AROUND
    if n <= 2 * half:
        half = max((n - 1) // 2, 0)
    middle = np.empty(n)
    windows = np.lib.stride_tricks.sliding_window_view(values, 2 * half + 1)
    middle[half : n - half] = np.median(windows, axis=1)
    for k in range(half):
        middle[k] = np.median(values[: 2 * k + 1])
        middle[n - 1 - k] = np.median(values[n - 1 - 2 * k :])
    return middle


def averaged(raw: RawCast, pressure: Array) -> tuple[RawCast, Array]:
    """Return the means over bins of 1 dbar, finer in a shallow cast; rows are each bin's first."""
    width = min(_BIN, float(np.ptp(pressure)) / _BINS) or _BIN
    place = np.floor(pressure / width).astype(np.int64)
    _, first, back, count = np.unique(
        place, return_index=True, return_inverse=True, return_counts=True
    )
    if (count > 1).any():
        raw.report.append(
            f"{len(pressure)} rows averaged over bins of {width:.2g} dbar, {len(count)} in all"
        )

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(back, weights=values) / count)

    assert raw.salinity is not None
    binned = replace(
        raw.only(first), temperature=mean(raw.temperature), salinity=mean(raw.salinity),
        pressure=mean(pressure), depth=None, conductivity=None, density=None,
    )  # fmt: skip
    return binned, mean(pressure)
