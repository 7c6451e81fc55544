"""Columns that are read in a wrong unit, or with the wrong sign, judged by the motion they show.

Integrated twice, m z'' + k z' = -k_b (V - psi z - V_0) needs no derivative of a depth:
(int z dt + z/d) and the double integral of -a_b/d (V - psi z) then differ by a cubic only, which
takes up start, speed, neutral volume and its drift. With times read 1000 times too long one is
10 000 times the other.

So does any other column that was read wrong: as it was meant the two agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from swimbladder.errors import LogError, column_as
from swimbladder.estimation.estimates import Finding, sentence
from swimbladder.estimation.kalman import Member, Noise, Start, log_likelihood
from swimbladder.estimation.series import stretches, white_noise
from swimbladder.io.logs import Log
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.sim.engine.cache import compiled
from swimbladder.units import unit_factor
from swimbladder.vehicle import Vehicle

if TYPE_CHECKING:
    from swimbladder.estimation.comparison.record import Record

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


def is_still(drive: Drive, driving: Array, vehicle: Vehicle) -> bool:
    """Return whether a volume [m3] or voltage [V] never changes by what counts."""
    return bool(np.ptp(driving) < _STILL * _whole(drive, vehicle))


def _whole(drive: Drive, vehicle: Vehicle) -> float:
    """Return the stroke [m3], or from full voltage one way to full voltage the other [V]."""
    stroke = vehicle.stroke
    volts = 2.0 * plant(vehicle).supply
    return volts if drive == "voltage" else stroke.maximum - stroke.minimum


def refuse_wrong_clock(
    log: Log, vehicle: Vehicle, under: Flags, drive: Drive, driving: Array
) -> None:
    """Raise LogError where the times of a log cannot be in their unit, with the one that fits.

    under: which samples are clear of surface and bottom. driving: volume [m3] or voltage [V].
    """
    if (part := _informative(log.depth, under)) is None:
        return
    z, t, given = log.depth[part], log.time[part], driving[part]
    mostly = np.quantile(given, [0.05, 0.95]) if drive == "volume" else given
    if not np.ptp(mostly) > _MOVED * _whole(drive, vehicle):
        return  # what moved the vehicle is not in the log

    def read_with(factor: float) -> _Fit:
        return _fits(factor * t, z, drive, given, vehicle)

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


def refuse_wrong_stroke(log: Log, vehicle: Vehicle, drive: Drive, driving: Array) -> None:
    """Raise LogError where what drives goes much farther than the vehicle's stroke, or supply.

    driving: volume [m3] or voltage [V].
    """
    over, whole = float(np.ptp(driving)), _whole(drive, vehicle)
    if over > _STROKES * whole:
        volts = drive == "voltage"
        each, unit, field = (1.0, "V", "voltage_V") if volts else (1e6, "cm3", "volume_m3")
        field = "piston_m" if not volts and log.volume is None else field
        moved, most = (f"{each * x:.3g} {unit}" for x in (over, whole))
        what = f"the {drive} goes over {moved}, the vehicle's range is {most}"
        remedy = "State the column's unit, as piston_m=NAME@mm, volume_m3=NAME@cm3 or "
        remedy += "voltage_V=NAME@mV, or give the vehicle that the log is of"
        raise LogError(what, file=log.source, field=field, remedy=remedy)


def misread(rec: Record, vehicle: Vehicle) -> tuple[Finding | None, bool]:
    """Return which column was read wrong, and whether none was for sure: by the motion they show.

    Of severity no where the log as read otherwise is this vehicle's, or moves the wrong way.
    Neither, where they may be right, or do not go with each other at all.
    """
    part, drive = _informative(rec.depth, rec.compared), rec.drive
    if part is None or drive == "setpoint":
        return None, False
    t, z, u = rec.time[part], rec.depth[part], rec.inputs[part]
    still = is_still(drive, u, vehicle)
    if drive == "volume" and still:
        return None, False
    tried = (one for one in _READINGS if drive in one.of and (one.ahead > 0 or not still))

    def read(as_it_is: _Reading) -> _Fit:
        ahead = as_it_is.ahead
        y, v = as_it_is.of_depth * z[::ahead], as_it_is.of_drive * u[::ahead]
        return _fits(ahead * t[::ahead], y, drive, v, vehicle)

    (_, found), *others = ((one, read(one)) for one in tried)
    best, known = min(others, key=lambda pair: pair[1].off)
    by, shifted = _late(rec, part, vehicle) if found.off > _UNLIKE else (0.0, found)
    why = ""
    if shifted.off < known.off and shifted.is_right(_BETTER * found.off):
        key = "late" if by > 0.0 else "early"
        why = sentence("compare", "misread", key, drive=drive, by=abs(by))
    elif known.is_right((_BETTER if best.ahead > 0 else _BACKWARDS) * found.off):
        names = ["depth"] * (best.of_depth < 0.0) + [drive] * (best.of_drive < 0.0)
        texts = [sentence("compare", "misread", name) for name in names]
        why = ", and ".join([*texts, best.text.format(drive=drive)] if best.text else texts)
    if why:
        return Finding.of("compare", "read otherwise", drive=drive, why=why), False
    if found.force < 0.0 and found.explained > _EXPLAINED:
        return Finding.of("compare", "wrong way", drive=drive), False
    sure = found.explained > _SURE
    if sure and not found.near(*_RIGHT):
        return Finding.of("compare", "misread", times=found.force, drive=drive), False
    return None, sure


_FINEST = 1e-3  # m, of a depth's noise, where a search begins
_AT_START, _SHARE = (0.05, 0.1), 0.5  # m and m/s, and of the stroke: deviations of the state
_FORCES = (0.01, 100.0)  # of the vehicle's, between which a search stays
_DECISIVE = 5.0  # of log likelihood: "very strong" in Kass and Raftery 1995


def doubtful(rec: Record, vehicle: Vehicle, drive: Drive) -> Iterator[Finding]:
    """Yield why the volume of a record, by what drove it, cannot be that which moved the vehicle.

    By the likelihood of a Kalman filter's innovations, at the likeliest noise. A neutral volume
    that is a random walk, and white acceleration, may be all that moves the vehicle: a drive that
    is not its own has to be undone by them, which is less likely than one that stays. And where the
    depths go too far, a vehicle of that kind is decisively less likely than a stronger one.
    """
    assert rec.volume is not None  # it drives
    stays = replace(rec, volume=np.full_like(rec.volume, rec.volume.mean()))
    gain = _height(stays, vehicle)[0] - _height(rec, vehicle)[0]
    if not gain < 0.0:
        yield Finding.of("compare", "uninformative", drive=drive, gain=gain)
        return
    of_kind, _ = _height(rec, vehicle, (_FORCES[0], _RIGHT[1]))
    free, times = _height(rec, vehicle, _FORCES)
    if free > of_kind + _DECISIVE:
        yield Finding.of("compare", "misread", "no", times=times, drive=drive)


def _height(
    rec: Record, vehicle: Vehicle, forces: tuple[float, float] = (1.0, 1.0)
) -> tuple[float, float]:
    """Return the log likelihood of the depths at the likeliest noise and force, and that force.

    forces: between which it is, of the vehicle's.
    """
    assert rec.volume is not None  # it drives
    p, samples, first = plant(vehicle, bottom_depth=rec.bottom_depth), rec.samples, rec.depth[0]
    stroke, (least, most) = _whole("volume", vehicle), map(math.log, forces)
    neutral = float(rec.volume[0] - vehicle.hull.psi * first) - rec.layers.at(float(first))
    start = Start(float(first), 0.0, neutral, *_AT_START, _SHARE * stroke)

    def force(x: Array) -> float:
        return math.exp(min(max(float(x[-1]), least), most))

    def unlikely(x: Array) -> float:
        own = p._replace(a_b=p.a_b * force(x))
        return -float(log_likelihood(samples, Member(own, Noise(*np.exp(x[:3])), start, 0.0))[-1])

    found, free = [], 4 if most > least else 3
    for drift, shake in product((1e-3, 1e-2), (1e-3, 1e-2)):  # stroke/s^0.5, m/s^1.5
        depth = max(white_noise(rec.time, rec.depth), _FINEST)
        x: Array = np.log((depth, drift * stroke, shake, 1.0)[:free])
        how = {"initial_simplex": x + np.eye(free + 1, free), "fatol": 0.1, "maxfev": 300}
        end = minimize(unlikely, x, method="Nelder-Mead", tol=0.05, options=how)  # type: ignore[call-overload]
        found.append((-float(end.fun), force(end.x)))
    return max(found)


def _late(rec: Record, part: slice, vehicle: Vehicle) -> tuple[float, _Fit]:
    """Return by how much the times of what drives are best taken for late [s], and the fit then.

    Of up to an eighth of the time either way.
    """
    t, z = rec.time[part], rec.depth[part]

    def read(by: float) -> _Fit:
        known = (t + by >= rec.time[0]) & (t + by <= rec.time[-1])
        driving = np.interp(t[known] + by, rec.time, rec.inputs)
        return _fits(t[known], z[known], rec.drive, driving, vehicle)

    tried = np.linspace(-0.125, 0.125, _SHIFTS) * (t[-1] - t[0])
    best, step = min(tried.tolist(), key=lambda by: read(by).off), float(tried[1] - tried[0])
    near = (best - step, best + step)
    by = float(minimize_scalar(lambda by: read(by).off, bounds=near, method="bounded").x)
    return by, read(by)


class _Reading(NamedTuple):
    """What was read wrong, and by what depths and what drives have to be multiplied."""

    text: str
    of_depth: float
    of_drive: float
    ahead: Literal[1, -1] = 1  # -1: from the last row to the first
    of: tuple[Drive, ...] = ("volume", "voltage")


_FEET, _PSI, _INCH = unit_factor("ft", "m"), unit_factor("psi", "kPa"), unit_factor("in", "mm")
_UNIT_READ_AS = (
    _Reading("", 1.0, 1.0),
    _Reading("a depth in feet was read as metres", _FEET, 1.0),
    _Reading("a depth in metres was read as feet", 1.0 / _FEET, 1.0),
    _Reading("a pressure in kPa was read as psi", 1.0 / _PSI, 1.0),
    _Reading("a pressure in psi was read as kPa", _PSI, 1.0),
    _Reading("a piston in inches was read as mm", 1.0, _INCH, of=("volume",)),
    _Reading("a piston in mm was read as inches", 1.0, 1.0 / _INCH, of=("volume",)),
    *(
        _Reading(f"depth or {{drive}} is off by {10**k}, as mm for cm, or bar for dbar", *factors)
        for k in (1, 2, 3)
        for f in (10.0**k, 10.0**-k)
        for factors in ((f, 1.0), (1.0, f))
    ),
)
_READINGS = (
    *_UNIT_READ_AS,
    *(one._replace(of_drive=-one.of_drive) for one in _UNIT_READ_AS),
    _Reading("", -1.0, 1.0),
    _Reading("the rows are in reverse order", 1.0, 1.0, -1),
)
_RIGHT, _SURE = (0.33, 3.0), 0.8  # of the vehicle's force, and of the variance explained
_CLOSE = (0.75, 1.33)  # of the force, within which another reading is right
# of what is not explained as read: less makes another reading, or the reverse order, the right one
_BETTER, _BACKWARDS = 0.25, 0.5
_UNLIKE = 0.25  # of the motion, more of which left unexplained may be by times that are late
_SHIFTS = 121  # tried


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

    def is_right(self, off: float) -> bool:
        """Return whether this is the vehicle's motion, more of it than all but `off`."""
        return self.near(*_CLOSE) and self.explained > _SURE and self.off < off


def _fits(time: Array, depth: Array, drive: Drive, driving: Array, vehicle: Vehicle) -> _Fit:
    """Return how the depths [m] go with the volumes [m3] or voltages [V] at these times [s]."""
    volume = driving
    if drive == "voltage":
        neutral = vehicle.neutral_volume(float(depth[0]))
        volume = _pumped(plant(vehicle), time, depth, driving, neutral)
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


@compiled
def _pumped(p: Plant, time: Array, depth: Array, voltage: Array, V: float) -> Array:
    """Return the volume [m3] that voltages [V] make, without lag, from V at the start."""
    found = np.empty(len(time))
    found[0] = V
    for k in range(len(time) - 1):
        z, u = depth[k], min(max(voltage[k], -p.supply), p.supply)
        out, back = u - p.load_drive * z - p.friction, u - p.load_back * z + p.friction
        V += p.gain * (max(out, 0.0) + min(back, 0.0)) * (time[k + 1] - time[k])
        V = found[k + 1] = min(max(V, p.V_min), p.V_max)
    return found


def _integral(y: Array, t: Array) -> Array:
    return np.append(0.0, np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t)))
