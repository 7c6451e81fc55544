"""A logged deep dive as numbers: its place between two samples, and what pump and valve had done.

The drive's volume is not measured on most floats. What is known is how long pump and valve ran, and
at which pressure; the vehicle's datasheet turns that into nominal volumes, and the identification
into real ones. The volume at the beginning of a dive is unknown, and each dive has its own.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swimbladder.errors import InputError
from swimbladder.estimation.series import Array, Index, Mask
from swimbladder.io.float_log import FloatLog
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.hull import layered_volume
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.seawater import Column
from swimbladder.physics.seawater.column import slopes
from swimbladder.vehicle import PumpAndValve, Vehicle

SHORTEST = 50.0  # s between two samples for a speed: 10 mbar of resolution are 2 mm/s then
LONGEST = 4000.0  # s, likewise; longer ones hide how it went
SETTLING = 5.0  # s before and 25 s after, in which an action still shows
_AFTER = 25.0  # s
_WITHIN = np.linspace(0.1, 0.9, 5)  # of a run, where its rate is looked up
_LEAST = 1e5  # Pa; above it hull and bladder may be out of the water, and the bypass open


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """The parts of a dive between two samples in which nothing ran [n]."""

    time: Array  # s, their middle
    elapsed: Array  # s, since the dive began
    idle: Array  # s of those in which nothing ran
    duration: Array  # s
    pressure: Array  # Pa, at their middle
    speed: Array  # m/s, positive down
    acceleration: Array  # m/s2, 0 where the neighbours are of other legs
    density: Array  # kg/m3, of the water
    temperature: Array  # degC, of the hull
    before: Mask  # [n, m], which actions were before
    leaked: Array  # m3, as the vehicle's file has it, since the dive began

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True, kw_only=True)
class DeepDive:
    """A dive: samples [n], actions [m] and the water."""

    name: str
    time: Array  # s [n]
    pressure: Array  # Pa [n]
    temperature: Array  # degC of the hull [n]
    unwarmed: int  # samples without a logged temperature of the hull
    leaked: Array  # m3 [n], as the vehicle's file has it, since the dive began
    action_time: Array  # s [m], the beginning
    action_seconds: Array  # s [m]
    action_pumps: Mask  # [m]
    action_bypass: Mask  # [m]; what is neither is the valve's
    action_volume: Array  # m3 [m], nominal, positive: rate times seconds, mean on the way
    action_short: Array  # m3 [m], what the start falls short of it, nominal; 0 without a pump
    action_pressure: Array  # Pa [m], mean on the way
    water_pressure: Array  # Pa [k], of the cast, and half as deep again
    water_density: Array  # kg/m3 [k]; below the cast it grows as at its end
    water_layers: Array  # m3/m [k], neutral volume over depth but for what pressure does to it
    gravity: float  # m/s2
    stroke: float  # m3

    @cached_property
    def pieces(self) -> Pieces:
        """The parts between two samples, `SHORTEST` to `LONGEST` long, in which nothing runs."""
        ends = nodes(self.time)
        first, last = ends[:-1], ends[1:]
        a, b = self.time[first], self.time[last]
        over = self.action_time + self.action_seconds + _AFTER
        busy = (self.action_time < b[:, None]) & (over > a[:, None] + SETTLING)
        kept = (b - a <= LONGEST) & ~busy.any(axis=1)
        first, last, a, b = first[kept], last[kept], a[kept], b[kept]
        middle = 0.5 * (a + b)
        p = 0.5 * (self.pressure[first] + self.pressure[last])
        density = np.interp(p, self.water_pressure, self.water_density)
        before = self.action_time < middle[:, None]
        speed = (self.pressure[last] - self.pressure[first]) / (b - a) / (density * self.gravity)
        elapsed = middle - self.time[0]
        return Pieces(
            time=middle, elapsed=elapsed, idle=elapsed - before @ self.action_seconds,
            duration=b - a, pressure=p, density=density, speed=speed,
            acceleration=_acceleration(middle, speed, before.sum(axis=1)),
            temperature=0.5 * (self.temperature[first] + self.temperature[last]), before=before,
            leaked=np.interp(middle, self.time, self.leaked),
        )  # fmt: skip


def deep_dive(log: FloatLog, column: Column, vehicle: Vehicle, *, name: str = "") -> DeepDive:
    """Return the part of a log in which the vehicle was under water by itself.

    Where the log has stages, those of the mission; else all from the first to the last sample
    below 10 m. Missing temperatures of the hull are filled, all of them with the water's. Raises
    InputError where there is no dive, where no action of the drive is logged, or where the cast
    ends above it.
    """
    staged = bool(np.any(log.stage >= 0))
    used = log.stage >= 0 if staged else np.ones(len(log), dtype=bool)
    used &= np.isfinite(log.pressure)
    deep = np.flatnonzero(used & (log.pressure > _LEAST))
    if len(deep) < 10:
        what = f"{len(deep)} samples below 10 m are no dive"
        raise InputError(what, file=log.source, field="log", remedy="Give the log of a dive")
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
    logged = log.temperature[used][rising]
    temperature = _warmth(time, logged, np.interp(pressure, column.pressure, column.temperature))
    actions = [a for a in log.actions if time[0] - 1.0 <= a.time <= time[-1]]
    if not actions:
        what = "the log has no runs of pump or valve"
        remedy = "Give a log with pump_s and valve_s, or identify with a logged volume"
        raise InputError(what, file=log.source, field="log", remedy=remedy)
    begun = np.array([a.time for a in actions])
    seconds = np.array([a.seconds for a in actions])
    pumps = np.array([a.device == "pump" for a in actions])
    bypass = np.array([a.device == "bypass" for a in actions])
    actuator = vehicle.actuator
    assert isinstance(actuator, PumpAndValve)
    if bypass.any() and actuator.bypass is None:
        what = "the log has runs of a bypass, and the vehicle has none"
        remedy = "Describe the bypass in the vehicle's file"
        raise InputError(what, file=log.source, field="actuator.bypass", remedy=remedy)
    # A run of minutes goes through some 30 dbar.
    within = begun[:, None] + _WITHIN * seconds[:, None]
    at = np.maximum(np.interp(within, time, pressure), 0.0)
    map_ = drive_map(vehicle, at.ravel(), power=False)
    out, let_in, by = (
        rate.reshape(at.shape).mean(axis=1)
        for rate in (map_.rate_out, map_.rate_in, map_.bypass_in)
    )
    head = np.maximum(pressure + ATMOSPHERIC_PRESSURE - actuator.internal_pressure, 0.0)
    leaks = actuator.leakage * head
    leaked = np.append(0.0, np.cumsum(0.5 * (leaks[1:] + leaks[:-1]) * np.diff(time)))
    levels, density = _deepened(column)
    layers = slopes(layered_volume(vehicle, column), column.step)
    return DeepDive(
        name=name or log.source, time=time, pressure=pressure, temperature=temperature,
        unwarmed=int(np.sum(~np.isfinite(logged))), leaked=leaked, action_time=begun,
        action_seconds=seconds, action_pumps=pumps, action_bypass=bypass,
        action_volume=np.where(pumps, out, np.where(bypass, by, let_in)) * seconds,
        action_short=np.where(pumps, map_.start_volume.reshape(at.shape)[:, 0], 0.0),
        action_pressure=at.mean(axis=1), water_pressure=levels, water_density=density,
        water_layers=np.interp(levels, column.pressure, layers), gravity=column.gravity,
        stroke=vehicle.stroke.maximum - vehicle.stroke.minimum,
    )  # fmt: skip


def _warmth(time: Array, logged: Array, water: Array) -> Array:
    """Return the hull's temperature [degC] [n], where it is not logged from its neighbours in time.

    Between them its difference from the water's of the cast is linear; without any it is 0.
    """
    known = np.isfinite(logged)
    if not known.any():
        return water
    apart = np.interp(time, time[known], (logged - water)[known])
    return np.where(known, logged, water + apart)


def _acceleration(time: Array, speed: Array, leg: Index) -> Array:
    """Return it [m/s2] [n], from both neighbours; 0 where one of them is of another leg."""
    found = np.zeros(len(time))
    inner = np.flatnonzero((leg[2:] == leg[1:-1]) & (leg[:-2] == leg[1:-1])) + 1
    found[inner] = (speed[inner + 1] - speed[inner - 1]) / (time[inner + 1] - time[inner - 1])
    return found


def _deepened(column: Column) -> tuple[Array, Array]:
    """Return pressure and density of a column, and half as deep again with the slope at its end.

    A model that errs may sink below the cast, where water of constant density would not stop it.
    """
    p, rho = column.pressure, column.density
    i = int(np.searchsorted(p, p[-1] - min(1e6, 0.5 * float(p[-1]))))
    slope = float((rho[-1] - rho[i]) / (p[-1] - p[i]))
    more = float(p[-1]) * np.array([1.25, 1.5])
    return np.append(p, more), np.append(rho, rho[-1] + slope * (more - p[-1]))


def nodes(time: Array) -> Index:
    """Return samples `SHORTEST` apart at least."""
    found, last = [0], time[0]
    for i, t in enumerate(time):
        if t - last >= SHORTEST:
            found.append(i)
            last = t
    return np.array(found, dtype=np.int64)
