"""A log as the identification needs it: position, what drove it, and what the sea did to it.

A position has a quantum and outliers. A voltage-driven log is cut into blocks, each from one rest
to the next and with a start of its own.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid

from swimbladder.errors import InputError, LogError, column_as
from swimbladder.estimation.comparison.misread import refuse_wrong_stroke
from swimbladder.estimation.estimates import too_many
from swimbladder.estimation.series import Autoregression, Index, scale, stretches, white_noise
from swimbladder.estimation.series import autoregression as of_blocks
from swimbladder.io.logs import Log
from swimbladder.physics.actuator import reduced
from swimbladder.physics.arrays import Array, Flags
from swimbladder.vehicle import Vehicle

_FAR = 5.0  # robust standard deviations beyond which a sample is an outlier


def quantum(position: Array) -> float:
    """Return the step between two positions that the sensor resolves, 0 where it is not seen.

    It is the smallest difference of neighbours, where at least nine tenths of all differences are
    its multiples.
    """
    steps = np.abs(np.diff(position))
    steps = np.sort(steps[steps > 1e-9 * max(float(np.ptp(position)), 1e-300)])
    if len(steps) < 10:
        return 0.0
    found = float(np.median(steps[steps <= 1.5 * steps[0]]))
    multiples = steps / found
    off = np.abs(multiples - np.rint(multiples))
    fits = off < np.maximum(0.02 * multiples, 0.2)
    return found if fits[multiples < 10.0].mean() > 0.9 and (multiples < 10.0).any() else 0.0


def spikes(residual: Array, least: float) -> Flags:
    """Return which samples stick out from their neighbours by more than `least` and by far."""
    width = 7
    if len(residual) < width:
        return np.zeros(len(residual), bool)
    windows = np.lib.stride_tricks.sliding_window_view(residual, width)
    around, side = np.median(windows, axis=1), np.arange(1.0, 1.0 + width // 2)
    first, last = (float(np.median(np.diff(w))) for w in (windows[0], windows[-1]))
    around = np.concatenate([around[0] - first * side[::-1], around, around[-1] + last * side])
    off = residual - around
    return np.asarray(np.abs(off) > max(_FAR * scale(off), least))


def autoregression(blocks: Sequence[Array]) -> Autoregression:
    """Return the autoregression of residuals in independent blocks, each about its mean."""
    return of_blocks([b - b.mean() for b in blocks if len(b) > 1], highest=4, samples=20)


Quantity = Literal["piston", "volume"]
Driven = Literal["voltage", "reference", "nothing"]

_FEWEST = 10
_GAP = 5.0  # median steps of time that are a gap
_SHALLOW = 0.5  # m, a depth at which the load of the sea may be forgotten
_HIGHEST, _TIMES = 400.0, 3.0  # V, of a supply that floats; and what is no reading of it
_CLOCK = 0.01  # of the time between samples: better no logger stamps what it reads


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Positions and what drove them; time counts from the first sample.

    position: of the piston [m], or the volume [m3] where no piston is known. voltage is what is
    left of it for the motor, less the load of the sea. runs: stretches without a gap in time, as
    pairs (first, after). quantum: of the position; noise: 1 sigma, of white noise beside it.
    """

    source: str
    time: Array
    position: Array
    quantity: Quantity
    voltage: Array | None
    reference: Array | None
    runs: tuple[tuple[int, int], ...]
    step: float  # s, median time between samples
    quantum: float
    noise: float
    depth: float  # m, the greatest; 0 where not logged
    notes: tuple[str, ...]
    clock: float  # s, 1 sigma of when a voltage changes or a position is read

    @property
    def volts(self) -> Array:
        """The voltage of a bench that has one [V]."""
        assert self.voltage is not None
        return self.voltage

    @property
    def driven(self) -> Driven:
        """What is known of what drove it."""
        if self.voltage is not None:
            return "voltage"
        return "nothing" if self.reference is None else "reference"

    def only(self, kept: Flags) -> Bench:
        """Return the bench with the samples that are `kept`."""
        before = np.concatenate(([0], np.cumsum(kept)))
        runs = [(int(before[first]), int(before[after])) for first, after in self.runs]
        names = ("time", "position", "voltage", "reference")
        left = {name: x[kept] for name in names if (x := getattr(self, name)) is not None}
        return replace(self, runs=tuple((a, b) for a, b in runs if b > a), **left)

    @property
    def unit(self) -> str:
        """The unit of the position."""
        return "m" if self.quantity == "piston" else "m3"


def bench(log: Log, vehicle: Vehicle | None = None) -> Bench:
    """Return the positions of a log and what drove them.

    vehicle: its piston's area turns a logged volume into a position; its supply limits the
    voltage; its k_z/k_u and k_l, with the logged depth, are taken off, eq. (33). Raises LogError
    where the log has neither piston nor volume, too few samples of it, or voltages and positions
    of a piston whose area the vehicle does not have.
    """
    notes = list(log.report)
    position, reference, quantity = _position(log, vehicle)
    known = np.isfinite(position)
    if log.voltage is not None:
        known &= np.isfinite(log.voltage)
    if not known.all():
        notes.append(f"{int((~known).sum())} samples without position or voltage left out")
        log, position = log.only(known), position[known]
        reference = None if reference is None else reference[known]
    if len(position) < _FEWEST:
        what = f"{len(position)} samples with a position are too few"
        remedy = f"Give a log of {_FEWEST} samples or more"
        raise LogError(what, file=log.source, field="piston_m", remedy=remedy)
    if vehicle is not None:
        per = 1.0 if quantity == "volume" else vehicle.piston_area
        if per is not None:
            refuse_wrong_stroke(log, vehicle, "volume", per * position)
    time = log.time - log.time[0]
    step = float(np.median(np.diff(time)))
    depth = float(np.nanmax(log.depth, initial=0.0)) if np.isfinite(log.depth).any() else 0.0
    voltage = log.voltage
    if voltage is not None:
        voltage = _for_the_motor(log, voltage, vehicle, depth, notes)
        if vehicle is not None:
            position = _without_leakage(log, time, position, vehicle)
    spans = np.rint(np.diff(time) / step)
    lost = int(np.maximum(spans[spans <= _GAP] - 1.0, 0.0).sum())
    if log.voltage is not None and too_many(lost, len(time) + lost):
        what = (
            f"{lost} samples of {len(time) + lost} are missing: when the voltage changed is unknown"
        )
        remedy = "Log position and voltage with each sample"
        raise LogError(what, file=log.source, field="voltage_V", remedy=remedy)
    edges = np.flatnonzero(np.diff(time) > _GAP * step) + 1
    if len(edges):
        notes.append(f"{len(edges)} gaps in time: what happened in them is not used")
    ends: Sequence[int] = [0, *edges.tolist(), len(time)]
    return Bench(
        source=log.source,
        time=time,
        position=position,
        quantity=quantity,
        voltage=voltage,
        reference=reference,
        runs=tuple(itertools.pairwise(ends)),
        step=step,
        quantum=quantum(position),
        noise=white_noise(time, position),
        depth=depth,
        notes=tuple(notes),
        clock=_CLOCK * step,
    )


def _position(log: Log, vehicle: Vehicle | None) -> tuple[Array, Array | None, Quantity]:
    area = None if vehicle is None else vehicle.piston_area
    piston, volume = (
        values if values is not None and np.isfinite(values).any() else None
        for values in (log.piston, log.volume)
    )
    if piston is not None and (vehicle is None or area is not None or log.voltage is None):
        return piston, log.reference_piston, "piston"
    if volume is None:
        what = "the log has no position of a piston and no volume"
        remedy = "Map one with `columns={'piston_m': 'NAME'}` or `columns={'volume_m3': 'NAME'}`"
        if vehicle is not None and piston is not None:
            what = f"{vehicle.name} has no piston area, without which m/s/V are no volume rate"
            remedy = "Give the volume: `columns={'volume_m3': 'NAME'}`; or leave `vehicle=` out"
        raise LogError(what, file=log.source, field="piston_m or volume_m3", remedy=remedy)
    if area is None:
        return volume, log.reference_volume, "volume"
    reference = None if log.reference_volume is None else log.reference_volume / area
    return volume / area, reference, "piston"


def _for_the_motor(
    log: Log, voltage: Array, vehicle: Vehicle | None, depth: float, notes: list[str]
) -> Array:
    """Return the voltage cut to the supply's, less what holds the sea, k_z/k_u z of eq. (33)."""
    if vehicle is not None and vehicle.command == "volume":
        what = f"the vehicle {vehicle.name} is driven by positions, and the log has a voltage"
        remedy = "Give the vehicle of this log, or leave the voltage's column out"
        raise InputError(what, field="actuator.kind", value=vehicle.actuator.kind, remedy=remedy)
    supply = None if vehicle is None else vehicle.supply
    limit = _HIGHEST if supply is None else supply.voltage
    usual = float(np.quantile(np.abs(voltage), 0.95))
    if usual > _TIMES * limit:
        whose = "any float's" if supply is None else "the vehicle's"
        what = f"the voltages go to {usual:.4g} V, {whose} supply to {limit:g} V"
        remedy = f"State their unit: {column_as('voltage_V', 'NAME@mV')}"
        raise LogError(what, file=log.source, field="voltage_V", remedy=remedy)
    if supply is not None:
        beyond = np.abs(voltage) > limit * (1.0 + 1e-9)
        if beyond.any():
            taken = f"beyond the supply's {limit:g} V are taken as cut to it"
            notes.append(f"{int(beyond.sum())} voltages {taken}")
            voltage = np.clip(voltage, -limit, limit)
    if depth < _SHALLOW:
        return voltage
    if vehicle is None:
        counts = "the load of the sea counts as part of the dead zone and the load"
        notes.append(f"the log goes to {depth:.3g} m: without `vehicle=`, with k_z/k_u, {counts}")
        return voltage
    load = reduced(vehicle.engine, vehicle.water).load_drive
    notes.append(f"k_z/k_u = {load:.4g} V/m, as the vehicle has it, times the depth is taken off")
    return voltage - load * np.nan_to_num(log.depth)


def _without_leakage(log: Log, time: Array, position: Array, vehicle: Vehicle) -> Array:
    """Return the position, or without an area the volume, with what leaked, k_l z, put back."""
    k_l = reduced(vehicle.engine, vehicle.water).k_l / (vehicle.piston_area or 1.0)
    depth = np.nan_to_num(log.depth)
    if k_l == 0.0 or not depth.any():
        return position
    return position + k_l * cumulative_trapezoid(depth, time, initial=0)


IDLE = 0.02  # of the largest voltage: none
_BEFORE = 8  # samples of rest that are kept before the voltage comes
_AFTER = 1.0  # s after it went, by which the actuator stands
_ROUND = 3.0  # times noise and quantum that it may seem to move while it stands


class Block(NamedTuple):
    """Samples of one run that share an unknown start."""

    log: int  # which bench
    run: int
    samples: Index  # of the bench, increasing


def cut(bench: Bench, log: int) -> list[Block]:
    """Return the blocks of a voltage-driven bench.

    A stretch without voltage in which the actuator stands ends a block; its samples but for the
    first and the last few say nothing and are left out, as are readings that only repeat the one
    before while it stands: they are one reading.
    """
    size = np.abs(bench.volts)
    least = IDLE * float(size.max(initial=0.0))
    blocks = []
    for number, (first, after) in enumerate(bench.runs):
        idle = size[first:after] <= least
        kept, ends = _rests(bench, first, idle)
        edges = [0, *ends, after - first]
        for low, high in itertools.pairwise(edges):
            samples = first + low + np.flatnonzero(kept[low:high])
            if len(samples) >= 3:
                blocks.append(Block(log, number, samples.astype(np.int64)))
    return blocks


def _rests(bench: Bench, first: int, idle: Flags) -> tuple[Flags, list[int]]:
    """Return which samples of a run are kept, and where it is cut."""
    kept = np.ones(len(idle), bool)
    ends: list[int] = []
    for low, high in stretches(idle):
        opens = low + (_standing(bench, first + low, first + high) if low else 0)
        closes = max(high - (_BEFORE if high < len(idle) else 0), opens)
        kept[opens:closes] = False
        still = bench.position[first + opens : first + high]
        if len(still) > 1:  # repeated readings are one
            same = np.append(False, still[1:] == still[:-1])
            same[2:] |= still[2:] == still[:-2]  # an outlier may stand between
            kept[opens:high] &= ~same
            if closes < high:
                kept[closes] = True
        if 0 < opens < high < len(idle):
            ends.append(closes)
    return kept, ends


def _standing(bench: Bench, first: int, after: int) -> int:
    """Return how many samples after `first` the actuator stands, as far as noise lets one see."""
    x = bench.position[first:after]
    latest = min(max(round(_AFTER / bench.step), _BEFORE), len(x))
    last = min(_BEFORE, len(x) // 3)
    if last < 2:
        return latest
    end = float(np.median(x[-last:]))
    width = min(9, len(x) - 1 + len(x) % 2)
    around = np.median(np.lib.stride_tricks.sliding_window_view(x, width), axis=1)
    near = np.abs(around - end) <= _ROUND * (bench.noise + bench.quantum)
    gone = np.flatnonzero(~near)
    return min(int(gone[-1]) + width // 2 + 3 if len(gone) else width // 2, latest)
