"""Columns that are read in a wrong unit, or with the wrong sign, judged by the motion they show.

Integrated twice, m z'' + k z' = -k_b (V - psi z - V_0) needs no derivative of a depth:
(int z dt + z/d) and the double integral of -a_b/d (V - psi z) then differ by a cubic only, which
takes up start, speed, neutral volume and its drift. With times read 1000 times too long one is
10 000 times the other.

So does any other column that was read wrong: as it was meant the two agree.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from swimbladder.errors import LogError, column_as
from swimbladder.estimation.estimates import Finding, sentence
from swimbladder.estimation.series import stretches
from swimbladder.io.logs import Log
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.dynamics import plant
from swimbladder.units import unit_factor
from swimbladder.vehicle import Vehicle

Drive = Literal["volume", "voltage", "setpoint"]

_UNITS = dict(s="seconds", ms="milliseconds", us="microseconds", min="minutes", h="hours")
_FACTORS = (1e-3, 1e-6, 60.0, 1e3, 1.0 / 60.0, 3600.0, 1.0 / 3600.0)
# true time over time as read, if that is no unit's
_ALIKE = (0.3, 3.0)  # of the vehicle's force: another vehicle of the kind, whose file is a guess
_FAR = (0.1, 10.0)
_EXPLAINED = 0.6  # of the variance: the motion is that of the volume
_LEAST = 30  # samples
_SMALL = 0.02  # m, less motion than which has no information
_MOVED = 1e-3  # of the stroke, likewise of the volume
_STILL = 1e-4  # of the stroke, within which a volume never changes
_STROKES = 5.0  # more of them than this is another unit, or another vehicle


def _informative(depth: Array, under: Flags) -> slice | None:
    """Return the longest stretch that is `under` water; None where it hardly moves, or is short."""
    first, after = max(stretches(under), key=lambda run: run[1] - run[0], default=(0, 0))
    moves = after - first >= _LEAST and np.ptp(depth[first:after]) >= _SMALL
    return slice(first, after) if moves else None


def is_still(volume: Array, vehicle: Vehicle) -> bool:
    """Return whether a volume [m3] never changes by what counts."""
    stroke = vehicle.stroke
    return bool(np.ptp(volume) < _STILL * (stroke.maximum - stroke.minimum))


def refuse_wrong_clock(
    log: Log, vehicle: Vehicle, under: Flags, drive: Drive, driving: Array
) -> None:
    """Raise LogError where the times of a log cannot be in their unit, with the one that fits.

    under: which samples are clear of surface and bottom. driving: volume [m3] or voltage [V].
    """
    if (part := _informative(log.depth, under)) is None:
        return
    z, t, given = log.depth[part], log.time[part], driving[part]
    stroke = vehicle.stroke.maximum - vehicle.stroke.minimum
    if drive == "volume" and not np.ptp(np.quantile(given, [0.05, 0.95])) > _MOVED * stroke:
        return  # what moved the vehicle is not in the log

    def read_with(factor: float) -> _Fit:
        time = factor * t
        volume = given if drive == "volume" else _pumped(time, z, given, vehicle)
        return _fits(time, z, volume, vehicle)

    if read_with(1.0).near(*_FAR):
        return
    for factor, unit in _others(log.times.seconds):
        found = read_with(factor)
        if not (found.near(*_ALIKE) and found.explained > _EXPLAINED):
            continue
        only = f"{factor:.3g} times as long"
        remedy = "Check what the times count, and their pattern"
        if unit is not None:
            only = _UNITS[unit]
            remedy = f"Map them as what they are: {column_as('time_s', f'{log.times.name}@{unit}')}"
        what = f"as read the samples are {np.median(np.diff(t)):.4g} s apart, and what drives the "
        what += f"vehicle goes with its depths where the times are {only} only"
        span, unit = float(log.time[-1] - log.time[0]), "s from first to last"
        raise LogError(what, file=log.source, field="time_s", value=span, unit=unit, remedy=remedy)


def refuse_wrong_stroke(log: Log, vehicle: Vehicle, volume: Array) -> None:
    """Raise LogError where volumes [m3] go much farther than the vehicle's stroke."""
    stroke = vehicle.stroke
    over, whole = 1e6 * float(np.ptp(volume)), 1e6 * (stroke.maximum - stroke.minimum)
    if over > _STROKES * whole:
        what = f"the volume goes over {over:.3g} cm3, the vehicle's stroke is {whole:.3g} cm3"
        remedy = "State the column's unit, piston_m=NAME@mm or volume_m3=NAME@cm3, or give the "
        remedy += "vehicle that the log is of"
        field = "piston_m" if log.volume is None else "volume_m3"
        raise LogError(what, file=log.source, field=field, remedy=remedy)


def misread(
    time: Array, depth: Array, volume: Array, under: Flags, vehicle: Vehicle
) -> Finding | None:
    """Return which column was read wrong, where depths go with volumes as this vehicle's cannot.

    Of severity no where the log as read otherwise is this vehicle's. under: which samples are clear
    of surface and bottom. None where they may be right, or do not go with the volumes at all.
    """
    if (part := _informative(depth, under)) is None or is_still(volume[part], vehicle):
        return None
    t, z, V = time[part], depth[part], volume[part]
    found = _fits(t, z, V, vehicle)

    def read(as_it_is: _Reading) -> _Fit:
        _, of_depth, of_volume, ahead = as_it_is
        x, y, v = ahead * t[::ahead], of_depth * z[::ahead], of_volume * V[::ahead]
        return _fits(x, y, v, vehicle)

    fits = ((one, read(one)) for one in _READINGS)
    best, known = min(fits, key=lambda pair: pair[1].off)
    if known.near(*_CLOSE) and known.explained > _SURE and known.off < _BETTER * found.off:
        turned = [sentence("compare", "misread", "sign")] if best.of_volume < 0.0 else []
        why = ", and ".join([*turned, best.text] if best.text else turned)
        return Finding.of("compare", "read otherwise", why=why)
    if found.near(*_RIGHT) or not found.explained > _SURE:
        return None
    return Finding.of("compare", "misread", times=found.force)


class _Reading(NamedTuple):
    """What was read wrong, and by what depths and volumes have to be multiplied."""

    text: str
    of_depth: float
    of_volume: float
    ahead: Literal[1, -1] = 1  # -1: from the last row to the first


_FEET, _PSI, _INCH = unit_factor("ft", "m"), unit_factor("psi", "kPa"), unit_factor("in", "mm")
_UNIT_READ_AS = (
    _Reading("", 1.0, 1.0),
    _Reading("a depth in feet was read as metres", _FEET, 1.0),
    _Reading("a depth in metres was read as feet", 1.0 / _FEET, 1.0),
    _Reading("a pressure in kPa was read as psi", 1.0 / _PSI, 1.0),
    _Reading("a pressure in psi was read as kPa", _PSI, 1.0),
    _Reading("a piston in inches was read as mm", 1.0, _INCH),
    _Reading("a piston in mm was read as inches", 1.0, 1.0 / _INCH),
    *(
        _Reading(f"depth or volume is off by {10**k}, as mm for cm, or bar for dbar", *factors)
        for k in (1, 2, 3)
        for f in (10.0**k, 10.0**-k)
        for factors in ((f, 1.0), (1.0, f))
    ),
)
_READINGS = (
    *_UNIT_READ_AS,
    *(one._replace(of_volume=-one.of_volume) for one in _UNIT_READ_AS),
    _Reading("the rows are in reverse order", 1.0, 1.0, -1),
)
_RIGHT, _SURE = (0.33, 3.0), 0.8  # of the vehicle's force, and of the variance explained
_CLOSE = (0.75, 1.33)  # of the force, within which another reading is right
_BETTER = 0.25  # of what is not explained as read: less makes another reading the right one


def _others(seconds: float | None) -> list[tuple[float, str | None]]:
    """Return by what times may be off, with the unit that their numbers are in then.

    seconds: what a number was taken for, None: the times are texts.
    """
    if seconds is None:
        return [(factor, None) for factor in _FACTORS]
    units = {unit: unit_factor(unit, "s") / seconds for unit in _UNITS}
    left = [f for f in _FACTORS if not any(math.isclose(f, known) for known in units.values())]
    tried = [(factor, unit) for unit, factor in units.items() if not math.isclose(factor, 1.0)]
    return [*tried, *((factor, None) for factor in left)]


class _Fit(NamedTuple):
    """Force of the log over that of the vehicle, and the share of the motion it explains."""

    force: float
    explained: float

    @property
    def off(self) -> float:
        """The share of the motion that the vehicle's own force does not explain; 1 for none."""
        f = self.force
        return 1.0 - self.explained * (2.0 - 1.0 / f) / f if f else 1.0

    def near(self, least: float, most: float) -> bool:
        return least <= self.force <= most


def _fits(time: Array, depth: Array, volume: Array, vehicle: Vehicle) -> _Fit:
    """Return how the depths [m] go with the volumes [m3] at these times [s]."""
    m, drag, t = vehicle.mass, vehicle.drag, time - time[0]
    speed = float(np.sqrt(np.mean(np.diff(depth) ** 2)) / np.mean(np.diff(t)))
    d = (drag.k_dl + drag.k_dt * speed) / m
    pull = -vehicle.water.specific_weight / m * (volume - vehicle.hull.psi * depth)
    moved = _integral(depth, t) + depth / d
    forced = _integral(_integral(pull, t), t) / d
    x = t / t[-1]  # a neutral volume that drifts makes a cubic
    loose = np.stack([x**power for power in range(4)], axis=1)
    moved, forced = (y - loose @ np.linalg.lstsq(loose, y)[0] for y in (moved, forced))
    power, total = float(forced @ forced), float(moved @ moved)
    if power == 0.0 or total == 0.0:
        return _Fit(1.0, 0.0)  # nothing drove it, or it did not move: no information
    shared = float(moved @ forced)
    return _Fit(shared / power, shared**2 / power / total)


def _pumped(time: Array, depth: Array, voltage: Array, vehicle: Vehicle) -> Array:
    """Return the volume [m3] that voltages [V] make, without lag, from neutral at the start."""
    p, V = plant(vehicle), vehicle.neutral_volume(float(depth[0]))
    found = [V]
    for dt, z, u in zip(np.diff(time), depth[:-1], voltage[:-1], strict=True):
        u = min(max(u, -p.supply), p.supply)
        out, back = u - p.load_drive * z - p.friction, u - p.load_back * z + p.friction
        rate = p.gain * (max(out, 0.0) + min(back, 0.0))
        V = min(max(V + rate * dt, p.V_min), p.V_max)
        found.append(V)
    return np.array(found)


def _integral(y: Array, t: Array) -> Array:
    return np.append(0.0, np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t)))
