"""A log as the model needs it: what drives it, from when, and which samples to compare.

Where a cast is given, a record has its layers as the vehicle meets them: what they add to
psi z + trim_error.

Samples of a logged volume that no actuator can have been at: zeros, spikes, dropped digits.

A run of a few samples counts as off where the volume goes and comes back faster than the actuator
can: all of them lie outside of what is between the samples beside the run. A jump that stays is
none, and of the first and the last sample nothing shows whether it comes back. Of all ways to leave
runs out and to take jumps as they are, dynamic programming finds the cheapest: a sample left out
costs 1, a jump that is kept `_JUMP`.

`volume_errors` says what a recorded volume may be off by: its resolution, and what it did between
two samples.

A single volume far off those beside it may have been one, or not: it is off by all of that.
A coarse recorder is off by the same while one value stands in the log, evenly within half a step.
Between two samples a volume may go early or late: where it bends, the mean of a span is off by a
share of the bend. And no volume is exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np

from swimbladder.errors import InputError, LogError
from swimbladder.estimation.comparison.misread import Drive, refuse_wrong_clock, refuse_wrong_stroke
from swimbladder.estimation.estimates import too_many
from swimbladder.estimation.kalman import Samples, follow
from swimbladder.estimation.series import Index, followed, quantum, stretches, white_noise
from swimbladder.io.logs import Log, spikes
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.physics.hull import along_hull, heat_expansion, neutral_volume
from swimbladder.physics.seawater import Column, check_rows
from swimbladder.sim.engine.cache import compiled
from swimbladder.sim.engine.modes import NO_LAYERS, Layers, layers_from
from swimbladder.vehicle import Vehicle

_JUMP = 3.0  # samples: a run that is left out has fewer than twice as many
LONGEST = 5  # samples of a run
_MARGIN = 1.25  # times the rate of the vehicle's file, and times what the log keeps up
_STEPS = 4  # one after the other, for which a rate is kept up
_FAR = 8.0  # standard deviations of the noise
_COARSE = 0.005  # of the stroke, what may be a coarse sensor


def drive_outliers(
    time: Array,
    volume: Array,
    gaps: Sequence[tuple[float, float]] = (),
    *,
    rate: float,
    stroke: float,
) -> tuple[Flags, Flags]:
    """Return which samples of a volume [m3] at times [s] the actuator cannot have been at, and
    which are single ones far off the others that it can: a spike, or a kick of the control law.

    gaps: (time before, time after) [s] without samples. rate: of the vehicle's actuator at its
    fastest [m3/s]; the log's own counts where it is higher. stroke: largest less smallest volume
    [m3].
    """
    off = np.zeros(len(volume), dtype=bool)
    single = off.copy()
    if len(volume) <= LONGEST:
        return off, single
    steps, span = np.diff(volume), np.diff(time)
    fastest = _MARGIN * max(_kept_up(steps / span), rate)
    least = max(_FAR * white_noise(time, volume), _COARSE * stroke)
    if (np.abs(steps) > least + fastest * span).any():
        off = np.asarray(~_kept(time, volume, fastest, least))
    alone = spikes("volume_m3", volume[~off], time[~off], gaps)
    single[np.flatnonzero(~off)[alone]] = True
    return off, single


def filled(time: Array, volume: Array, off: Flags) -> Array:
    """Return a volume, or piston, with values for the samples that are off.

    Between the samples beside a run it goes on as it did before, until it meets the line on which
    it goes on after: the corner where a move begins or ends. Where these do not meet, straight.
    """
    on = np.flatnonzero(~off)
    at = np.flatnonzero(off)
    if len(on) < 2:
        return volume
    new, place = volume.copy(), np.searchsorted(on, at)
    straight = np.interp(time[at], time[on], volume[on])
    slope = np.diff(volume[on]) / np.diff(time[on])
    before, after = (np.clip(place + k, 0, len(on) - 1) for k in (-1, 0))
    old = volume[on[before]] + slope[np.clip(place - 2, 0, None)] * (time[at] - time[on[before]])
    next_one = slope[np.clip(place, 0, len(slope) - 1)]
    later = volume[on[after]] - next_one * (time[on[after]] - time[at])
    middle = np.median([straight, old, later], axis=0)
    inside = (place > 1) & (place < len(on) - 1)
    new[at] = np.where(inside, middle, straight)
    return new


def _kept_up(speed: Array) -> float:
    """Return the fastest that a volume goes one way for several steps."""
    runs = np.lib.stride_tricks.sliding_window_view(speed, _STEPS)
    slowest = np.minimum(np.abs(runs.min(axis=1)), np.abs(runs.max(axis=1)))
    one_way = (runs > 0.0).all(axis=1) | (runs < 0.0).all(axis=1)
    return float(slowest[one_way].max(initial=0.0))


@compiled
def _kept(time: Array, volume: Array, fastest: float, least: float) -> Flags:
    """Return which samples are kept at the least cost."""
    n = len(time)
    cost, before = np.zeros(n), np.full(n, -1)
    for j in range(1, n):
        cost[j] = np.inf
        for i in range(j - 1, max(j - 2 - LONGEST, -1), -1):
            run = j - 1 - i
            if run > 0 and not _comes_back(time, volume, i, j, fastest, least):
                continue
            reached = abs(volume[j] - volume[i]) <= least + fastest * (time[j] - time[i])
            total = cost[i] + run + (0.0 if reached else _JUMP)
            if total < cost[j]:
                cost[j], before[j] = total, i
    kept = np.zeros(n, dtype=np.bool_)
    j = n - 1
    while j >= 0:
        kept[j] = True
        j = before[j]
    return kept


@compiled
def _comes_back(time: Array, volume: Array, i: int, j: int, fastest: float, least: float) -> bool:
    """Return whether a volume goes and comes back between two samples, faster than it can."""
    low, high = min(volume[i], volume[j]) - least, max(volume[i], volume[j]) + least
    possible = True
    for k in range(i + 1, j + 1):
        if k < j and low <= volume[k] <= high:
            return False
        far = least + fastest * (time[k] - time[k - 1])
        possible = possible and abs(volume[k] - volume[k - 1]) <= far
    return not possible


_QUICKEST = 5.0  # of a span between samples times the rate of the motion: a hundred steps
_LOST = 50.0  # m off, where a search has lost the log


def water_of_each(logs: int, columns: Sequence[Column]) -> tuple[Column | None, ...]:
    """Return the water of each of so many logs: that of the only cast, or of each its own.

    Raises InputError where there are several casts and not as many as logs.
    """
    if len(columns) <= 1:
        return (columns[0] if columns else None,) * logs
    if len(columns) != logs:
        what = f"{len(columns)} casts for {logs} log{'s' if logs > 1 else ''}"
        remedy = "Give one cast for all logs, or one for each in their order"
        raise InputError(what, field="cast", remedy=remedy)
    return tuple(columns)


def layers_of(vehicle: Vehicle, column: Column) -> Layers:
    """Return what the water of a column adds to the neutral volume psi z + trim_error.

    Nothing in the vehicle's own [water]: trim_error keeps its meaning, neutral at the surface of
    that, and psi is what the hull loses beyond the column's water. Parts of the hull and trapped
    air are left to psi, as the motion has them. The density is that of `along_hull`.
    """
    none = {"psi": 0.0, "parts": (), "trapped_air": 0.0, "thermal_expansion": 0.0}
    bare = vehicle.hull.model_copy(update=none)
    plain = vehicle.model_copy(update={"hull": bare})
    volume = neutral_volume(plain, along_hull(column, vehicle.hull)) - vehicle.trim_error
    return layers_from(volume, column.step)


def follow_in(
    layers: Layers, plants: Sequence[Plant], time: Array, volume: Array, starts: Array
) -> Array:
    """Return the depths [lanes, n] in m of vehicles in layered water, as `kalman` has it.

    starts [lanes, 3]: depth [m], speed [m/s] and drift [m3/s]. nan from where a vehicle left the
    water, and throughout where the first of them is quicker than any: a search looks elsewhere.
    """
    p = plants[0]
    spare = float(np.abs(volume - p.V_0).max() + np.abs(layers.table[:, 0]).max())
    net = p.a_b * (spare + abs(p.psi) * _LOST)
    fastest = max(math.sqrt(net / p.d_t) if p.d_t > 0.0 else 0.0, float(np.abs(starts[:, 1]).max()))
    rate = max(p.d_l, p.d_b + 2.0 * p.d_t * fastest)
    rate += math.sqrt(p.a_b * (abs(p.psi) + layers.steepest))
    if not float(np.diff(time).max()) * rate < _QUICKEST:
        return np.full((len(plants), len(time)), np.nan)
    return follow(plants, layers, time, volume, starts)


DRIVES: tuple[Drive, ...] = get_args(Drive)

_FEWEST = 10
_NO_READING = 10.0  # K from the median of a log's temperatures
_STAYS = 3  # samples under water, one after the other
_OFF = 0.1  # of the samples, more of which with an impossible volume are no outliers
_BELOW_BOTTOM = 0.2  # m, that a depth sensor may be off
_ABOVE = 3.0  # m, that the first row of a cast speaks for the water above it
_BOTTOM_MARGIN = 0.03  # m, of the bottom: the vehicle may stand on it
_REMEDIES = {
    "volume": "Map volume_m3 or piston_m with `columns=`, or choose another `drive=`",
    "voltage": "Map voltage_V with `columns=`, or choose another `drive=`",
    "setpoint": "Map reference_depth_m with `columns=`, or choose another `drive=`",
}


@dataclass(frozen=True, kw_only=True)
class Record:
    """What is needed of a log to run a model along it; time counts from the first sample.

    volume counts from mid-stroke, exactly where volume_absolute, else so that the vehicle is
    neutral at the first sample; what the hull gained by its temperature since that is in it, where
    a volume drives. compared: which samples are clear of surface and bottom.
    afloat: the first sample is at the surface, with volume to spare where it is known.
    layers: what the water of a cast adds to the vehicle's psi z + trim_error.
    """

    drive: Drive
    time: Array  # s
    depth: Array  # m
    speed: Array | None = None  # m/s
    volume: Array | None = None  # m3
    volume_absolute: bool = False
    quantum: float = 0.0  # m3, of the volume as logged; 0: none that is seen
    uncertain: Array | None = None  # m3, by how much volumes were changed that may have been right
    voltage: Array | None = None  # V
    warmth: Array | None = None  # K, as logged, above the first sample's; None: not logged
    gain: float = 0.0  # m3/K of the hull's, which is in the volume
    lag: float = 0.0  # s, time constant with which the hull follows it
    setpoints: tuple[tuple[float, float], ...] = ()  # (s, m)
    reference: Array | None = None  # m
    compared: Flags
    afloat: bool = False
    bottom_depth: float = math.inf  # m
    notes: tuple[str, ...] = ()
    layers: Layers = NO_LAYERS
    source: str = "the log"

    @property
    def samples(self) -> Samples:
        """What a filter takes of it; a volume has to drive it."""
        assert self.volume is not None
        use = self.compared.astype(np.int8)
        return Samples(self.time, self.volume, self.depth, use, self.layers)

    @property
    def inputs(self) -> Array:
        """What drives an open loop: volume [m3] or voltage [V]."""
        inputs = self.volume if self.drive == "volume" else self.voltage
        assert inputs is not None  # record() checks it
        return inputs

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.time[-1] - self.time[0])


def record(
    log: Log,
    vehicle: Vehicle,
    *,
    drive: Drive | None = None,
    bottom_depth: float = np.inf,
    surface_margin: float = 0.1,
    submerged: bool = False,
    column: Column | None = None,
) -> Record:
    """Return what drives the vehicle: volume or piston, else voltage, else the set-point.

    bottom_depth [m]; surface_margin: samples less deep than this below the depth of emergence are
    not compared [m]. submerged: the record begins where the vehicle is first deeper than that: how
    it leaves the surface, part of it in air, is not asked of the model. column: the water of a
    cast, for a logged volume. Raises LogError where the log does not have what drives, or too
    little of it, or goes deeper than the cast.
    """
    if drive is not None and drive not in DRIVES:
        remedy = f"Choose one of {', '.join(DRIVES)}"
        raise InputError("no such input", field="drive", value=drive, remedy=remedy)
    for field, metres in (("bottom_depth", bottom_depth), ("surface_margin", surface_margin)):
        if not metres >= 0.0:
            what, remedy = "it must not be negative", "Check the number and its unit"
            raise InputError(what, field=field, value=metres, unit="m", remedy=remedy)
    notes = list(log.report)
    chosen = drive or _first_drive(log, vehicle)
    series = _driving(log, vehicle, chosen)
    step, uncertain = 0.0, np.zeros(len(log))
    as_logged = log.time
    if chosen == "volume":
        step = quantum(series[np.isfinite(series)])
        log, uncertain = _mended(log, vehicle, notes)
        series = _driving(log, vehicle, chosen)
    layers = NO_LAYERS if column is None else _layers(log, vehicle, column, chosen)
    kept = np.isfinite(series)
    if chosen == "voltage" and too_many(unknown := _unknown(series), len(log)):
        what = f"what the voltage was in {unknown} of {len(log)} samples is not in the log"
        remedy = "Log the voltage with each sample: it changes meanwhile"
        raise LogError(what, file=log.source, field="voltage_V", remedy=remedy)
    if not kept.all():
        notes.append(f"{int((~kept).sum())} samples without {chosen} left out")
        log, series = log.only(kept), series[kept]
    if submerged:
        log, series = _from_submergence(log, series, vehicle, surface_margin, notes)
    if len(log) < _FEWEST:
        what = f"{len(log)} samples with {chosen} are too few to compare"
        remedy = f"Give a log of {_FEWEST} samples or more"
        raise LogError(what, file=log.source, field=chosen, remedy=remedy)
    volume, absolute = _volume(log, vehicle)
    if volume is not None and not absolute:
        first = float(log.depth[0])
        volume = volume - volume[0] + vehicle.neutral_volume(first) + layers.at(first)
        neutral = "taken as neutral at the first sample's depth"
        notes.append(f"the zero of the volume is not known: {neutral}")
    driving = {"volume": volume, "voltage": log.voltage, "setpoint": None}[chosen]
    if driving is not None:
        refuse_wrong_stroke(log, vehicle, chosen, driving)
    if volume is not None and chosen == "volume":
        stroke = vehicle.stroke
        beyond = np.maximum(volume - stroke.maximum, stroke.minimum - volume)
        if (beyond > 1e-9).any():
            count, most = int((beyond > 1e-9).sum()), f"by up to {1e6 * beyond.max():.2g} cm3"
            notes.append(f"{count} samples have a volume beyond the vehicle's stroke, {most}")
    deepest = _deepest(log)
    if deepest > bottom_depth + _BELOW_BOTTOM:
        what = f"the log goes deeper than the bottom, which is said to be at {bottom_depth:g} m"
        remedy = "Check `bottom_depth=`, and the unit of the logged depth"
        raise bad_depth(log.source, what, round(deepest, 3), remedy)
    surface = vehicle.hull.emergence_depth
    under = log.depth >= surface + surface_margin
    clear = log.depth <= bottom_depth - _BOTTOM_MARGIN
    if not under.all():
        above = f"less than {surface_margin:g} m below the depth at which the hull emerges"
        notes.append(f"{int((~under).sum())} samples {above} are simulated, not compared")
    if not clear.all():
        notes.append(f"{int((~clear).sum())} samples at the bottom are simulated, not compared")
    compared = under & clear
    in_air = float(np.median(log.depth)) < surface - vehicle.hull.height
    if in_air or compared.sum() < _FEWEST:
        what = f"{int(compared.sum())} samples are clear of surface and bottom, too few"
        what = "most depths are above the water" if in_air else what
        remedy = "Check the unit of the depth, or give another `surface_margin=` or `bottom_depth=`"
        if np.median(log.depth) < 0.0:
            remedy = 'The depths are negative: where they count upward, say depth_positive = "up" '
            remedy += "in the [log] table of `log_format=`"
        raise bad_depth(log.source, what, float(log.depth.max()), remedy)
    if driving is not None:
        refuse_wrong_clock(log, vehicle, compared, chosen, driving)
    time = log.time - log.time[0]
    reference = log.reference_depth
    found = Record(
        drive=chosen,
        time=time,
        depth=log.depth,
        speed=log.speed,
        volume=volume,
        volume_absolute=absolute,
        quantum=step * _per(log, vehicle),
        uncertain=uncertain[np.isin(as_logged, log.time)],
        voltage=log.voltage,
        warmth=_warmth(log),
        setpoints=() if reference is None else _changes(time, reference),
        reference=reference,
        compared=compared,
        afloat=bool(log.depth[0] < surface + surface_margin) and (absolute or volume is None),
        bottom_depth=bottom_depth,
        notes=tuple(notes),
        layers=layers,
        source=log.source,
    )
    return warmed(found, heat_expansion(vehicle), vehicle.hull.thermal_time_constant)


def thinned(record: Record, most: int) -> Record:
    """Return a record that a volume drives with the means of at most so many spans of time."""
    n = len(record.time)
    if record.drive != "volume" or n <= most:
        return record
    span = record.duration / (most - 1)
    bins = np.floor(record.time / span).astype(np.int64)
    bins = np.cumsum(np.diff(bins, prepend=bins[:1]) > 0)  # those of gaps are none
    count = np.bincount(bins)

    def mean(values: Array | None) -> Array | None:
        return None if values is None else np.bincount(bins, values) / count

    names = ("time", "depth", "speed", "volume", "uncertain", "voltage", "warmth", "reference")
    series: dict[str, Any] = {name: mean(getattr(record, name)) for name in names}
    series["time"] -= series["time"][0]
    note = f"{n} samples taken as the means of {len(count)} spans of {span:.3g} s"
    compared = np.bincount(bins, record.compared) == count
    return replace(record, **series, compared=compared, notes=(*record.notes, note))


def _per(log: Log, vehicle: Vehicle) -> float:
    """Return what volume [m3] a unit of the logged volume or piston is."""
    return 1.0 if log.volume is not None else vehicle.piston_area or 1.0


def _mended(log: Log, vehicle: Vehicle, notes: list[str]) -> tuple[Log, Array]:
    """Return the log with a volume, or piston, where some of it cannot be or short holes are, and
    by how much volumes have changed that may have been right [m3].

    Raises LogError where that are too many.
    """
    name = "piston" if log.volume is None else "volume"
    values: Array = getattr(log, name)
    known = np.isfinite(values)
    p, stroke, area = plant(vehicle), vehicle.stroke, _per(log, vehicle)
    rate, whole = p.rate if p.positioner else p.gain * p.supply, stroke.maximum - stroke.minimum
    off, hole = np.zeros(len(log), dtype=bool), np.zeros(len(log), dtype=bool)
    given = log.time[known], area * values[known], log.gaps
    single = off.copy()
    off[known], single[known] = drive_outliers(*given, rate=rate, stroke=whole)
    off |= single
    for first, after in stretches(~known):
        hole[first:after] = first > 0 and after < len(log) and after - first <= LONGEST
    beyond = f"a {name} that the actuator cannot reach from the samples beside"
    count, taken = int(off.sum()), "taken from those beside"
    either = "a spike, or a kick of the control law: neither is relied on"
    if count > _OFF * known.sum():
        what = f"{count} of {int(known.sum())} samples have {beyond}"
        remedy = f"Check which column is the {name}, and how missing values are written in it"
        field, line = {"volume": "volume_m3", "piston": "piston_m"}[name], int(log.line[off][0])
        raise LogError(what, file=log.source, line=line, field=field, remedy=remedy)
    kick = f"single {name} far off those beside"
    for which, what, done in ((off & ~single, beyond + " them", taken), (single, kick, either)):
        if which.any():
            lines = log.line[which].tolist()
            said = ", ".join(map(str, lines[:3])) + ", ..." * (len(lines) > 3)
            notes.append(f"{len(lines)} samples with {what}, on line {said}: {done}")
    if hole.any():
        notes.append(f"{int(hole.sum())} samples without {name}: {taken}")
    new = filled(log.time, values, off | hole)
    changed = np.where(single, np.abs(area * (new - values)), 0.0)
    return replace(log, **{name: new}), changed  # type: ignore[arg-type]


def _unknown(series: Array) -> int:
    """Return how many values are missing between two that differ, so that they are unknown."""
    known = np.flatnonzero(np.isfinite(series))
    holes, change = np.diff(known) - 1, np.diff(series[known])
    return int(holes[change != 0.0].sum())


def bad_depth(source: str, what: str, value: float, remedy: str) -> LogError:
    """Return the error that says what is wrong with a log's depth [m]."""
    return LogError(what, file=source, field="depth_m", value=value, unit="m", remedy=remedy)


def _layers(log: Log, vehicle: Vehicle, column: Column, drive: Drive) -> Layers:
    """Return the layers of a cast; raises an error where they are no use to the log."""
    if drive != "volume":
        what = "a cast is of use only where the logged volume drives the vehicle"
        remedy = "Drive it with `drive='volume'`, or leave the cast out"
        raise InputError(what, field="cast", value=column.source, remedy=remedy)
    deepest = _deepest(log)
    if deepest > column.deepest + column.step:
        ends = f"the cast {column.source} ends at {column.deepest:.4g} m"
        what = f"the log goes down to {deepest:.4g} m, {ends}"
        remedy = "Take a cast that goes as deep, and check the units of both"
        raise bad_depth(log.source, what, round(deepest, 3), remedy)
    check_rows(column)
    top = 0.0 if column.cast is None else float(column.cast.pressure[0])
    if deepest + _ABOVE < top:
        begins = f"the cast {column.source} begins at {top:.4g} dbar"
        what = f"the log goes down to {deepest:.4g} m, {begins}"
        remedy = "Take a cast that begins above it, and check the units of both"
        raise bad_depth(log.source, what, round(deepest, 3), remedy)
    return layers_of(vehicle, column)


def _deepest(log: Log) -> float:
    """Return the greatest depth [m], not that of a single spike."""
    return float(np.median(np.sort(log.depth)[-9:]))


def _from_submergence(
    log: Log, series: Array, vehicle: Vehicle, margin: float, notes: list[str]
) -> tuple[Log, Array]:
    """Return log and driving series from where the vehicle is first under water, not by a spike."""
    under = log.depth >= vehicle.hull.emergence_depth + margin
    stays = np.convolve(under, np.ones(_STAYS), mode="full")[_STAYS - 1 :] == _STAYS
    if not stays.any():
        return log, series  # what is lacking is said with the rest
    first = int(np.argmax(stays))
    if first:
        where = f"where the vehicle is first {margin:g} m below the depth at which the hull emerges"
        since = log.time[first] - log.time[0]
        notes.append(f"begun {since:.4g} s after the first sample, {where}")
    kept = np.arange(len(log)) >= first
    return log.only(kept), series[kept]


def _first_drive(log: Log, vehicle: Vehicle) -> Drive:
    if log.volume is not None or (log.piston is not None and vehicle.piston_area is not None):
        return "volume"
    if log.voltage is not None and vehicle.voltage_driven:
        return "voltage"
    if log.reference_depth is not None:
        return "setpoint"
    what = "the log has nothing that drives the vehicle"
    field = "volume_m3, piston_m, voltage_V or reference_depth_m"
    raise LogError(what, file=log.source, field=field, remedy=_REMEDIES["volume"])


def _driving(log: Log, vehicle: Vehicle, drive: Drive) -> Array:
    """Return the series that drives, as logged; raises LogError where there is none."""
    piston, what, remedy = log.volume is None and log.piston is not None, "", ""
    field: str = "drive"
    value: str | None = drive
    if drive == "volume" and piston and vehicle.piston_area is None:
        what = f"the log has the position of a piston, and the vehicle {vehicle.name} has none"
        field, value = "actuator.kind", vehicle.actuator.kind
        remedy = "Choose a vehicle with a piston, or log its volume"
    elif drive == "voltage" and not vehicle.voltage_driven:
        what = f"the vehicle {vehicle.name} is not driven by a voltage"
        remedy = "Drive it with volume or setpoint"
    elif drive == "setpoint" and vehicle.controller is None:
        what = f"the vehicle {vehicle.name} has no controller to follow the set-point with"
        field, value = "controller", None
        remedy = "Add a [controller] to the vehicle, or choose another `drive=`"
    if what:
        raise InputError(what, field=field, value=value, remedy=remedy)
    volume = log.piston if piston else log.volume
    series = {"volume": volume, "voltage": log.voltage, "setpoint": log.reference_depth}
    found = series[drive]
    if found is None:
        what = f"the log has no {drive}"
        raise LogError(what, file=log.source, field=drive, remedy=_REMEDIES[drive])
    return found


def _volume(log: Log, vehicle: Vehicle) -> tuple[Array | None, bool]:
    area = vehicle.piston_area
    if log.volume is not None and np.isfinite(log.volume).all():
        return log.volume, log.volume_absolute
    if log.piston is not None and area is not None and np.isfinite(log.piston).all():
        return log.piston * area, log.piston_absolute
    return None, False


def _warmth(log: Log) -> Array | None:
    """Return the temperature above that of the first sample [K] [n]; None: not logged."""
    T = log.temperature
    if T is None or not (known := np.isfinite(T)).any():
        return None
    known &= np.abs(T - np.median(T[known])) < _NO_READING
    warmth = np.interp(log.time, log.time[known], T[known])
    return np.asarray(warmth - warmth[0])


def warmed(record: Record, gain: float, lag: float) -> Record:
    """Return a record in whose volume the hull gains so much per kelvin [m3/K], after a lag [s]."""
    volume = record.volume
    if record.warmth is None or volume is None or record.drive != "volume":
        return record
    if not adds_warmth(record, gain, lag):
        return record
    found = replace(record, volume=volume + more_warmth(record, gain, lag), gain=gain, lag=lag)
    notes = tuple(note for note in record.notes if note != _gained(record))
    return replace(found, notes=(*notes, _gained(found)))


def adds_warmth(record: Record, gain: float, lag: float) -> bool:
    """Return whether a hull of this gain and lag displaces anything beyond the record's."""
    return gain != record.gain or (gain != 0.0 and lag != record.lag)


def more_warmth(record: Record, gain: float, lag: float) -> Array:
    """Return what a hull of this gain [m3/K] and lag [s] displaces beyond the record's [m3] [n]."""
    assert record.warmth is not None
    time, warmth = record.time, record.warmth
    known = record.gain * followed(time, warmth, record.lag)
    return np.asarray(gain * followed(time, warmth, lag) - known)


def _gained(record: Record) -> str:
    assert record.warmth is not None
    span = np.ptp(followed(record.time, record.warmth, record.lag))
    gain = 1e6 * record.gain
    return (
        f"the hull's temperature goes over {span:.3g} K; by its thermal expansion, "
        f"{gain:.3g} cm3/K, that is {abs(gain * span):.2g} cm3 of volume"
    )


def _changes(time: Array, reference: Array) -> tuple[tuple[float, float], ...]:
    """Return (time, depth) where a set-point begins to hold, the first at 0."""
    known = np.flatnonzero(np.isfinite(reference))
    if not len(known):
        return ()
    values = reference[known]
    new = np.append(True, np.diff(values) != 0.0)
    pairs = [(float(time[known[k]]), float(values[k])) for k in np.flatnonzero(new)]
    return ((0.0, pairs[0][1]), *pairs[1:])


_EXACT = 2e-5  # of the stroke, 1 sigma of a sample of a volume
_BEND = 0.12  # of the change of a volume's step, 1 sigma of the mean of a span
_FIRST = 0.5  # of what it mostly is, 1 sigma of the first sample, whose neighbor is on one side


def volume_errors(record: Record, stroke: float) -> Array:
    """Return how far a record's volume may be off [2, n], as `Samples` has it; stroke [m3]."""
    volume, time = record.volume, record.time
    assert volume is not None  # it drives the model
    found, span = np.zeros((2, len(volume))), np.diff(time)
    found[0, 1:] = -1.0
    if record.quantum > 0.0:
        square = record.quantum**2 / 12.0
        stays = _stays(volume, 0.5 * record.quantum)
        runs = _stays(volume, 1.5 * record.quantum)
        found[0, runs] = square
        lasts = np.diff(np.append(time[stays], time[-1]))
        alone = np.isin(stays, runs) & np.isin(np.append(stays[1:], len(time)), [*runs, len(time)])
        which = np.searchsorted(stays, np.arange(len(time)), side="right") - 1
        found[1, 1:] = np.where(alone, 0.0, square * lasts)[which][:-1]
    else:
        bends = np.pad(np.abs(np.diff(volume, 2)), 1)
        found[0, :2] = (_FIRST * min(bends[1], np.median(bends))) ** 2, 0.0
        found[1, 1:] = (_BEND * np.maximum(bends[1:], bends[:-1])) ** 2 * span
    if record.uncertain is not None:
        uncertain = 0.5 * record.uncertain**2
        found[1, 1:] += (uncertain[1:] + uncertain[:-1]) * span
    found[1, 1:] += (_EXACT * stroke) ** 2 * span
    return found


def early_moves(record: Record) -> Array:
    """Return by how much each volume [n, m3] is off where the motor moves as early as it can.

    A volume that is sampled may have gone to where it is next evenly, at once, or at the last
    moment (then the negative). As fast as in its fastest span, the mean of a span is off by
    change / 2 (1 - |change| / largest). Shared by the span's two samples. Coarse steps say nothing
    of it.
    """
    assert record.volume is not None  # it drives the model
    change = np.diff(record.volume)
    if record.quantum > 0.0:
        return np.zeros(len(change) + 1)
    rate = np.abs(change) / np.diff(record.time)
    mean = 0.5 * change * (1.0 - rate / max(float(rate.max()), 1e-300))
    return np.asarray(0.5 * (np.append(mean, 0.0) + np.append(0.0, mean)))


def _stays(volume: Array, within: float) -> Index:
    """Return where stretches begin that stay within a range, each as long as it can be."""
    first, low, high = [0], volume[0], volume[0]
    for k, value in enumerate(volume.tolist()):
        low, high = min(low, value), max(high, value)
        if high - low > within:
            first.append(k)
            low = high = value
    return np.array(first)


def as_white(time: Array, off: Array) -> Array:
    """Return errors that last as white noise of the same integral over the record."""
    (begins,) = np.nonzero(off[0] >= 0.0)
    lasts = np.diff(np.append(time[begins], time[-1]))
    total = float((off[0, begins] * lasts**2).sum()) / float(time[-1] - time[0])
    return np.array([np.append(0.0, np.full(len(time) - 1, -1.0)), off[1] + total])
