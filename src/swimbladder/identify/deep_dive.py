"""A logged deep dive as numbers: where it was between two looks, and what pump and valve had done.

The drive's volume is not measured on most floats. What is known is how long pump and valve ran, and
at which pressure; the vehicle's datasheet turns that into nominal volumes, and the identification
into real ones. The volume at the beginning of a dive is unknown, and each dive has its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.buoyancy_engine import drive_map
from swimbladder.errors import InputError
from swimbladder.io.float_log import FloatLog
from swimbladder.parameters import PumpAndValve, Vehicle
from swimbladder.seawater import Column
from swimbladder.steady_drives import delivered

__all__ = ["DeepDive", "Pieces", "deep_dive"]

Array = NDArray[np.float64]

SHORTEST = 50.0  # s between two samples that tell a speed: 10 mbar of resolution are 2 mm/s then
LONGEST = 4000.0  # s, likewise; longer ones hide how it went
SETTLING = 5.0  # s before and 25 s after, in which an action still shows
_AFTER = 25.0  # s
_LEAST = 1e5  # Pa; above it hull and bladder may be out of the water, and the bypass open


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """The parts of a dive between two samples in which nothing ran [n]."""

    time: Array  # s, their middle
    elapsed: Array  # s, since the dive began
    duration: Array  # s
    pressure: Array  # Pa, at their middle
    speed: Array  # m/s, positive down
    density: Array  # kg/m3, of the water
    temperature: Array  # degC, of the hull
    pumped: Array  # m3, nominal, since the dive began, starts as good as the rest
    slipped: Array  # m3 Pa, the same times the pressure that it was pumped against
    starts: Array  # -, of the pump
    short: Array  # m3, that these starts fell short by, nominal
    bled: Array  # m3, nominal, by the valve
    bypassed: Array  # m3, nominal, by the bypass
    leg: NDArray[np.int64]  # -, between which two actions

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True, kw_only=True)
class DeepDive:
    """A dive: samples [n], actions [m] and the water."""

    name: str
    time: Array  # s [n]
    pressure: Array  # Pa [n]
    temperature: Array  # degC of the hull [n]
    action_time: Array  # s [m], the beginning
    action_seconds: Array  # s [m]
    action_pumps: NDArray[np.bool_]  # [m]
    action_bypass: NDArray[np.bool_]  # [m]; what is neither is the valve's
    action_volume: Array  # m3 [m], nominal, positive: rate times seconds
    action_short: Array  # m3 [m], what the start falls short of it, nominal
    action_pressure: Array  # Pa [m]
    water_pressure: Array  # Pa [k], of the cast, and half as deep again
    water_density: Array  # kg/m3 [k]; below the cast it grows as at its end
    gravity: float  # m/s2
    pieces: Pieces


def deep_dive(log: FloatLog, column: Column, vehicle: Vehicle, *, name: str = "") -> DeepDive:
    """Return the part of a log in which the vehicle was under water by itself.

    Where the log tells of stages, those of the mission; else all from the first to the last sample
    below 10 m. Without temperatures the hull is taken to have the water's. Raises InputError where
    there is no dive, where nothing tells what the drive did, or where the cast ends above it.
    """
    staged = bool(np.any(log.stage >= 0))
    used = log.stage >= 0 if staged else np.ones(len(log), dtype=bool)
    used &= np.isfinite(log.pressure)
    deep = np.flatnonzero(used & (log.pressure > _LEAST))
    if len(deep) < 10:
        raise InputError(
            f"{len(deep)} samples below 10 m are no dive", file=log.source, field="log",
            remedy="Give the log of a dive",
        )  # fmt: skip
    used[: deep[0]] = False
    used[deep[-1] + 1 :] = False
    # The last row may stand twice, or out of order after a restart of the clock.
    time = log.time[used]
    rising = np.append(True, np.diff(np.maximum.accumulate(time)) > 0.0)
    time, pressure = time[rising], log.pressure[used][rising]
    missing = float(pressure.max() - column.pressure[-1])
    if missing > 0.02 * float(pressure.max()):
        raise InputError(
            f"the cast ends at {column.pressure[-1] / 1e4:.0f} dbar, {missing / 1e4:.0f} dbar "
            "above the dive's deepest sample", file=log.source, field="--cast",
            remedy="Give a cast that goes as deep",
        )  # fmt: skip
    temperature = log.temperature[used][rising]
    if not np.isfinite(temperature).all():
        temperature = np.interp(pressure, column.pressure, column.temperature)
    actions = [a for a in log.actions if time[0] - 1.0 <= a.time <= time[-1]]
    if not actions:
        raise InputError(
            "the log tells of no pump or valve", file=log.source, field="log",
            remedy="Give a log with pump_s and valve_s, or identify with a logged volume",
        )  # fmt: skip
    begun = np.array([a.time for a in actions])
    seconds = np.array([a.seconds for a in actions])
    pumps = np.array([a.device == "pump" for a in actions])
    at = np.interp(begun, time, pressure)
    map_ = drive_map(vehicle, np.maximum(at, 0.0), power=False)
    bypass = np.array([a.device == "bypass" for a in actions])
    assert isinstance(vehicle.actuator, PumpAndValve)
    if bypass.any() and vehicle.actuator.bypass is None:
        raise InputError(
            "the log has runs of a bypass, and the vehicle has none", file=log.source,
            field="actuator.bypass", remedy="Describe the bypass in the vehicle's file",
        )  # fmt: skip
    rate = np.where(pumps, map_.rate_out, np.where(bypass, map_.bypass_in, map_.rate_in))
    volume = rate * seconds
    short = np.where(pumps, volume - delivered(rate, seconds, map_.start_volume), 0.0)
    levels, density = _deepened(column)
    return DeepDive(
        name=name or log.source, time=time, pressure=pressure, temperature=temperature,
        action_time=begun, action_seconds=seconds, action_pumps=pumps, action_bypass=bypass,
        action_volume=volume, action_short=short, action_pressure=at,
        water_pressure=levels, water_density=density, gravity=column.gravity,
        pieces=_pieces(
            time, pressure, temperature, begun, seconds, pumps, bypass, volume, short, at,
            levels, density, column.gravity,
        ),
    )  # fmt: skip


def _pieces(
    time: Array, pressure: Array, temperature: Array, begun: Array, seconds: Array,
    pumps: NDArray[np.bool_], bypass: NDArray[np.bool_], volume: Array, short: Array, at: Array,
    levels: Array, water: Array, gravity: float,
) -> Pieces:  # fmt: skip
    """Return the parts between two samples, `SHORTEST` to `LONGEST` long, in which nothing runs."""
    ends = _nodes(time)
    first, last = ends[:-1], ends[1:]
    a, b = time[first], time[last]
    busy = (begun[None, :] < b[:, None]) & (
        (begun + seconds)[None, :] + _AFTER > a[:, None] + SETTLING
    )
    kept = (b - a <= LONGEST) & ~busy.any(axis=1)
    first, last, a, b = first[kept], last[kept], a[kept], b[kept]
    middle = 0.5 * (a + b)
    p = 0.5 * (pressure[first] + pressure[last])
    density = np.interp(p, levels, water)
    before = begun[None, :] < middle[:, None]
    return Pieces(
        time=middle, elapsed=middle - time[0], duration=b - a, pressure=p, density=density,
        speed=(pressure[last] - pressure[first]) / (b - a) / (density * gravity),
        temperature=0.5 * (temperature[first] + temperature[last]),
        pumped=(before * np.where(pumps, volume, 0.0)).sum(axis=1),
        slipped=(before * np.where(pumps, volume * at, 0.0)).sum(axis=1),
        starts=(before & pumps).sum(axis=1).astype(np.float64),
        short=(before * short).sum(axis=1),
        bled=(before * np.where(pumps | bypass, 0.0, volume)).sum(axis=1),
        bypassed=(before * np.where(bypass, volume, 0.0)).sum(axis=1),
        leg=before.sum(axis=1),
    )  # fmt: skip


def _deepened(column: Column) -> tuple[Array, Array]:
    """Return pressure and density of a column, and half as deep again with the slope at its end.

    A model that errs may sink below the cast, where water of constant density would not stop it.
    """
    p, rho = column.pressure, column.density
    i = int(np.searchsorted(p, p[-1] - min(1e6, 0.5 * float(p[-1]))))
    slope = float((rho[-1] - rho[i]) / (p[-1] - p[i]))
    more = float(p[-1]) * np.array([1.25, 1.5])
    return np.append(p, more), np.append(rho, rho[-1] + slope * (more - p[-1]))


def _nodes(time: Array) -> NDArray[np.int64]:
    """Return samples `SHORTEST` apart at least."""
    found, last = [0], time[0]
    for i, t in enumerate(time):
        if t - last >= SHORTEST:
            found.append(i)
            last = t
    return np.array(found, dtype=np.int64)
