"""From rows in the order of a file to a profile: one leg, no spikes, averaged, stable.

Small density inversions are noise and averaged, large ones are refused.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import Parameter
from swimbladder.io.cast_columns import RawCast
from swimbladder.io.cast_units import COLDEST, DEEPEST, MOST_SALT, WARMEST
from swimbladder.io.log_text import counted
from swimbladder.physics.arrays import Array, Flags

Inversions = Literal["refuse", "average", "keep"]
# kg/m3 between two depths; the threshold of Argo's density inversion test (Argo Quality Control
# Manual for CTD and Trajectory Data, test 14).
INVERSION = 0.03


def stable(
    raw: RawCast, pressure: Array, SA: Array, CT: Array, inversions: Inversions
) -> tuple[Array, Array]:
    """Return SA and CT of a water column that is nowhere lighter below.

    Where it is, neighbours are mixed until it is not, which keeps salt and heat. Raises LogError
    for an inversion of more than `INVERSION` between two rows, or where mixing many would change
    the density by more than that, unless `inversions` says to average or keep them.
    """
    import gsw

    jumps = _jumps(pressure, SA, CT)
    worst = int(np.argmin(jumps))
    size = -float(jumps[worst])
    if size <= 0.0:
        return SA, CT
    count = counted(int((jumps < 0.0).sum()), "density inversion")
    where = f"the largest {size:.2g} kg/m3 at {pressure[worst + 1]:.1f} dbar"
    noise, option = f"more than noise makes ({INVERSION:g})", "with `inversions='average'`"
    if size > INVERSION and inversions == "refuse":
        lighter = f"{size:.2g} kg/m3 lighter than that at {pressure[worst]:.1f} dbar above it"
        what = f"the water at {pressure[worst + 1]:.1f} dbar is {lighter}, {noise}"
        culprits = "a spike, a lagging sensor, the bottom"
        remedy = f"Take out what is no water there ({culprits}), or mix the neighbours {option}"
        raise raw.refused(what, remedy, "density", k=worst + 1, value=round(size, 4), unit="kg/m3")
    if inversions == "keep":
        raw.report.append(f"{count} kept, {where}")
        return SA, CT
    mixed = _mixed(pressure, SA, CT)
    change = np.abs(gsw.rho(*mixed, pressure) - gsw.rho(SA, CT, pressure))
    most = int(np.argmax(change))
    if change[most] > INVERSION and inversions == "refuse":
        where = f"downwards around {pressure[most]:.1f} dbar, by little from row to row"
        by = f"by {change[most]:.2g} kg/m3 in all"
        what = f"the water gets lighter {where} and {by}, {noise}"
        check = "Check salinity and temperature there (a sensor that drifts?)"
        remedy, value = f"{check}, or mix the water {option}", round(float(change[most]), 4)
        raise raw.refused(what, remedy, "density", k=most, value=value, unit="kg/m3")
    density = f"density changes by {change[most]:.2g} kg/m3 at most"
    raw.report.append(f"{count} averaged with the water beside, {where}; {density}")
    return mixed


def _jumps(p: Array, SA: Array, CT: Array) -> Array:
    """Return how much denser each row is than the one above at the pressure between [kg/m3]."""
    import gsw

    between = 0.5 * (p[1:] + p[:-1])
    return np.asarray(gsw.rho(SA[1:], CT[1:], between) - gsw.rho(SA[:-1], CT[:-1], between))


def _mixed(p: Array, SA: Array, CT: Array) -> tuple[Array, Array]:
    """Mix neighbours, by the pressure they stand for, until none is lighter than the one above."""
    weight = np.gradient(p)
    blocks = [[k] for k in range(len(p))]
    while True:
        w = np.array([weight[b].sum() for b in blocks])
        s, c, q = (np.array([(weight[b] * v[b]).sum() for b in blocks]) / w for v in (SA, CT, p))
        down = _jumps(q, s, c) < -1e-9
        if not down.any():
            break
        joined: list[list[int]] = [blocks[0]]
        for k in range(1, len(blocks)):
            if down[k - 1]:
                joined[-1] = joined[-1] + blocks[k]
            else:
                joined.append(blocks[k])
        blocks = joined
    sizes = [len(b) for b in blocks]
    return np.repeat(s, sizes), np.repeat(c, sizes)


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
        what = "all rows are of one pressure"
        remedy = "Give a cast that goes down"
        raise raw.refused(what, remedy, "pressure_dbar", value=float(pressure[0]))
    if steps.mean() > _SHUFFLED * float(np.ptp(pressure)) and len(pressure) > 5:
        raw.report.append("the rows are in no order and were sorted by pressure")
        return rows[np.argsort(pressure, kind="stable")]
    found = legs(pressure)
    if profile is not None and profile > len(found):
        what = f"the file has {counted(len(found), 'profile')}"
        raise raw.refused(
            what, f"Choose from 1 to {len(found)}", Parameter("profile"), value=profile
        )
    if profile is None and len(found) > 2:
        ends = ", ".join(
            f"{n}: {pressure[a]:.0f} to {pressure[b]:.0f} dbar"
            for n, (a, b) in enumerate(found[:6], start=1)
        )
        what = f"there are {len(found)} profiles in it ({ends}{', ...' if len(found) > 6 else ''})"
        remedy = "Choose one with `profile=1`, or rows with `where={'COLUMN': 'VALUE'}`"
        raise raw.refused(what, remedy, "profile")
    number = (profile or 1) - 1
    if profile is None and len(found) == 2:
        down = [pressure[b] > pressure[a] for a, b in found]
        number = down.index(True) if True in down else 0
        way, (a, b) = f"the way {'down' if down[number] else 'up'}", found[number]
        taken = f"{way} is taken, {raw.at(a)} to {raw.at(b)}"
        raw.report.append(f"it goes down and up again: {taken}")
    a, b = found[number]
    chosen = rows[a : b + 1]
    return chosen[np.argsort(pressure[chosen], kind="stable")]


def without_spikes(raw: RawCast, pressure: Array) -> Flags:
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
        what = f"{int((~good).sum())} of {len(good)} rows cannot be sea water"
        remedy = "Check which columns are temperature, salinity and pressure, and their units"
        raise raw.refused(what, remedy, "salinity", k=k, value=float(raw.salinity[k]))
    for name, floor in _FLOOR.items():
        values = np.asarray(getattr(raw, name))
        spiky = np.zeros(len(good), dtype=bool)
        spiky[good] = _spikes(values[good], floor)
        if spiky.any():
            k = int(np.flatnonzero(spiky)[np.argmax(np.abs(values[spiky]))])
            where = f"{values[k]:.4g} at {pressure[k]:.1f} dbar"
            _say(raw, spiky, f"with {name} far off those around ({where})")
        good &= ~spiky
    return good


def _say(raw: RawCast, out: Flags, why: str) -> None:
    if out.any():
        first = raw.at(int(np.flatnonzero(out)[0]))
        raw.report.append(f"{counted(int(out.sum()), 'row')} {why} left out, the first on {first}")


def _spikes(values: Array, floor: float) -> Flags:
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
        bins = f"bins of {width:.2g} dbar, {len(count)} in all"
        raw.report.append(f"{len(pressure)} rows averaged over {bins}")

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(back, weights=values) / count)

    assert raw.salinity is not None
    found: dict[str, Any] = dict.fromkeys(("depth", "conductivity", "density"))
    found |= {"temperature": mean(raw.temperature), "salinity": mean(raw.salinity)}
    found["pressure"] = mean(pressure)
    return replace(raw.only(first), **found), found["pressure"]
