"""The vertical motion of a deep vehicle, in what can be identified of it.

::

    m w' = rho g E - k w|w|                  speed w, positive down, k = k_dt or k_dt r rising
    E = M/rho - V_hull(p, T) - V             by how much volume it is too heavy
    V_hull = V_0 (1 - beta p + s p^2/2 + alpha (T - T_ref)) + V_air p_a/(p_a + p)
    V = V_start + sum pumped - f bled - b bypassed - leaked - l t_idle
    pumped = max(min(d q(p) - s_p p q(0), d q(0)) t - max(short + v_s, 0), 0)

with M, V_0, m, the pump's nominal rate q, the nominal volumes of valve and bypass, what starts fall
`short` by and what leaks from the vehicle's file. What fixes how large all volumes are together is
the inertia m, where speeds change fast enough to show it, M/rho, whose shape the water gives, and
what is known before.

A dive is filtered by `deep_filter`, in steps that `deep_path` cuts. It is also replayed from its
beginning, by the logged runs of pump and valve alone: m w' = rho g E - k_dt w|w|, implicit in the
drag, so that a step of many seconds ends at the steady speed; the volume is that of the runs so
far, each spread over its seconds.

A log becomes a `DeepDive`: where the vehicle was, and what pump and valve had done. The drive's
volume is not measured on most floats. What is known is how long pump and valve ran, and at which
pressure; the vehicle's datasheet turns that into nominal volumes, and the identification into real
ones. The volume at the beginning of a dive is unknown, and each dive has its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from swimbladder.errors import InputError, Parameter
from swimbladder.estimation.estimates import Prior, check_names, read_priors, read_values
from swimbladder.estimation.motion import deep_filter as of
from swimbladder.estimation.motion.deep_filter import (
    SPACING,
    Noise,
    Resistance,
    Track,
    displaced_variance,
    filter_kernel,
)
from swimbladder.estimation.series import Index
from swimbladder.io.float_log import FloatLog
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.hull import hull_parts, layered_volume, weight_mass
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.seawater import Column
from swimbladder.physics.seawater.column import ATMOSPHERE, slopes
from swimbladder.physics.steady_drives import valve_root
from swimbladder.vehicle import PumpAndValve, Vehicle

SHORTEST = 50.0  # s between two samples for a speed: 10 mbar of resolution are 2 mm/s then
LONGEST = 4000.0  # s, likewise; longer ones hide how it went
SETTLING = 5.0  # s before and 25 s after, in which an action still shows
_AFTER = 25.0  # s
_WITHIN = np.linspace(0.1, 0.9, 5)  # of a run, where its rate is looked up
_NEAR = 5.0  # steps of time, between samples that give a speed
_LEAST = 1e5  # Pa; above it hull and bladder may be out of the water, and the bypass open


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """The parts of a dive between two samples in which nothing ran [n]."""

    time: Array  # s, their middle
    elapsed: Array  # s, since the dive began
    idle: Array  # s of those in which nothing ran
    duration: Array  # s
    pressure: Array  # Pa, at their middle
    rounding: Array  # Pa2, variance of what the pressure changes by, by resolution
    speed: Array  # m/s, positive down
    acceleration: Array  # m/s2, 0 where the neighbours are of other legs
    density: Array  # kg/m3, of the water
    temperature: Array  # degC, of the hull
    before: Flags  # [n, m], which actions were before
    leaked: Array  # m3, as the vehicle's file has it, since the dive began

    def __len__(self) -> int:
        return len(self.time)


class Actions(NamedTuple):
    """Runs of pump, valve and bypass [m]."""

    time: Array  # s, the beginning
    seconds: Array  # s
    pumps: Flags
    bypass: Flags  # what is neither is the valve's
    volume: Array  # m3, nominal, positive: rate times seconds, mean on the way
    unloaded: Array  # m3, what a pump would give against no pressure, nominal; 0 without one
    short: Array  # m3, what the start falls short of it, nominal; 0 without a pump
    pressure: Array  # Pa, mean on the way
    head: Array  # Pa, of the sea over the reservoir
    opened: Array  # m3/Pa^0.5, flow of the valve times seconds, nominal; 0 of others


class Water(NamedTuple):
    """Water over pressure [k]."""

    pressure: Array  # Pa
    density: Array  # kg/m3; below the cast it grows as at its end
    layers: Array  # m3/m, neutral volume over depth but for what pressure does to it

    def at(self, pressure: Array) -> Water:
        """Return it at pressures [Pa]."""
        return Water(pressure, *(np.interp(pressure, self.pressure, x) for x in self[1:]))


@dataclass(frozen=True, kw_only=True)
class DeepDive:
    """A dive: samples [n], actions and the water."""

    name: str
    time: Array  # s [n]
    pressure: Array  # Pa [n]
    rounding: Array  # Pa2 [n], variance by the resolution of pressures and times
    temperature: Array  # degC of the hull [n]
    unwarmed: int  # samples without a logged temperature of the hull
    leaked: Array  # m3 [n], as the vehicle's file has it, since the dive began
    actions: Actions
    water: Water  # of the cast, and half as deep again
    gravity: float  # m/s2

    @cached_property
    def pieces(self) -> Pieces:
        """The parts between two samples, `SHORTEST` to `LONGEST` long, in which nothing runs."""
        ends = nodes(self.time)
        first, last = ends[:-1], ends[1:]
        a, b = self.time[first], self.time[last]
        over = self.actions.time + self.actions.seconds + _AFTER
        busy = (self.actions.time < b[:, None]) & (over > a[:, None] + SETTLING)
        kept = (b - a <= LONGEST) & ~busy.any(axis=1)
        first, last, a, b = first[kept], last[kept], a[kept], b[kept]
        middle = 0.5 * (a + b)
        p = 0.5 * (self.pressure[first] + self.pressure[last])
        density = self.water.at(p).density
        before = self.actions.time < middle[:, None]
        speed = (self.pressure[last] - self.pressure[first]) / (b - a) / (density * self.gravity)
        elapsed = middle - self.time[0]
        return Pieces(
            time=middle,
            elapsed=elapsed,
            idle=elapsed - before @ self.actions.seconds,
            duration=b - a,
            pressure=p,
            rounding=self.rounding[first] + self.rounding[last],
            density=density,
            speed=speed,
            acceleration=_acceleration(middle, speed, before.sum(axis=1)),
            temperature=0.5 * (self.temperature[first] + self.temperature[last]),
            before=before,
            leaked=np.interp(middle, self.time, self.leaked),
        )


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
        ends = f"{column.pressure[-1] / 1e4:.0f} dbar, {missing / 1e4:.0f} dbar above the dive's"
        what, remedy = f"the cast ends at {ends} deepest sample", "Give a cast that goes as deep"
        raise InputError(what, file=log.source, field=Parameter("cast"), remedy=remedy)
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
    actuator = vehicle.engine
    assert isinstance(actuator, PumpAndValve)
    if bypass.any() and actuator.bypass is None:
        what = "the log has runs of a bypass, and the vehicle has none"
        remedy = "Describe the bypass in the vehicle's file"
        raise InputError(what, file=log.source, field="actuator.bypass", remedy=remedy)
    # A run of minutes goes through some 30 dbar.
    within = begun[:, None] + _WITHIN * seconds[:, None]
    at = np.maximum(np.interp(within, time, pressure), 0.0)
    map_ = drive_map(vehicle, at.ravel(), power=False)
    rates = (map_.rate_out, map_.rate_in, map_.bypass_in)
    out, let_in, by = (rate.reshape(at.shape).mean(axis=1) for rate in rates)
    volume = np.where(pumps, out, np.where(bypass, by, let_in)) * seconds
    unloaded = np.where(pumps, drive_map(vehicle, np.zeros(1), power=False).rate_out, 0.0) * seconds
    short = np.where(pumps, map_.start_volume.reshape(at.shape)[:, 0], 0.0)
    mean, lack = at.mean(axis=1), ATMOSPHERIC_PRESSURE - actuator.internal_pressure
    opened = np.where(pumps | bypass, 0.0, actuator.valve.flow) * seconds
    head = np.maximum(pressure + lack, 0.0)
    leaks = actuator.leakage * head
    leaked = np.append(0.0, np.cumsum(0.5 * (leaks[1:] + leaks[:-1]) * np.diff(time)))
    return DeepDive(
        name=name or log.source,
        time=time,
        pressure=pressure,
        rounding=_rounding(log, used)[rising],
        temperature=temperature,
        unwarmed=int(np.sum(~np.isfinite(logged))),
        leaked=leaked,
        actions=Actions(
            begun, seconds, pumps, bypass, volume, unloaded, short, mean, mean + lack, opened
        ),
        water=_deepened(column, slopes(layered_volume(vehicle, column), column.step)),
        gravity=column.gravity,
    )


def _rounding(log: FloatLog, used: Flags) -> Array:
    """Return the variance of the pressures `used` by their and their times' resolution [Pa2]."""
    time, pressure, none = log.time[used], log.pressure[used], np.zeros(int(used.sum()))
    step = log.time_step[used] if len(log.time_step) else none
    width = log.pressure_step[used] if len(log.pressure_step) else none
    near = np.maximum(_NEAR * step, 1.0)  # s; neighbours whose own times matter little
    last = len(time) - 1
    a = np.maximum(np.searchsorted(time, time - near, side="right") - 1, 0)
    b = np.minimum(np.searchsorted(time, time + near), last)
    apart = np.maximum(time[b] - time[a], np.finfo(float).tiny)
    moved = (pressure[b] - pressure[a]) / apart * step
    return np.asarray((moved**2 + width**2) / 12.0)


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


def _deepened(column: Column, layers: Array) -> Water:
    """Return the water of a column, and half as deep again with the slope at its end.

    A model that errs may sink below the cast, where water of constant density would not stop it.
    """
    p, rho = column.pressure, column.density
    i = int(np.searchsorted(p, p[-1] - min(1e6, 0.5 * float(p[-1]))))
    slope = float((rho[-1] - rho[i]) / (p[-1] - p[i]))
    more = float(p[-1]) * np.array([1.25, 1.5])
    density = np.append(rho, rho[-1] + slope * (more - p[-1]))
    return Water(np.append(p, more), density, np.append(layers, [layers[-1]] * 2))


def nodes(time: Array) -> Index:
    """Return samples `SHORTEST` apart at least."""
    found, last = [0], time[0]
    for i, t in enumerate(time):
        if t - last >= SHORTEST:
            found.append(i)
            last = t
    return np.array(found, dtype=np.int64)


class DeepName(NamedTuple):
    """A quantity that can be identified from deep dives."""

    unit: str
    meaning: str
    relative: float  # standard deviation of its default prior, as a share of its mean
    absolute: float  # [unit], added to it
    mean: float = 0.0  # [unit], unless the vehicle's file says it


DEEP: dict[str, DeepName] = {
    "drag": DeepName("N s2/m2", "quadratic drag k_dt while sinking", 0.1, 0.0),
    "drag_up": DeepName("", "drag while rising, as a share of that while sinking", 0.0, 0.3),
    "compressibility": DeepName("1/Pa", "of the hull and all in it, at the surface", 0.5, 5e-11),
    "stiffening": DeepName("1/Pa2", "how that falls with pressure", 0.0, 1e-17),
    "thermal_expansion": DeepName("1/K", "of volume, with the logged temperature", 0.5, 5e-5),
    "trapped_air": DeepName("m3", "at the surface; Boyle", 0.5, 2e-5),
    "pump_delivery": DeepName("", "what the pump gives, a share of its datasheet", 0.3, 0.0, 1.0),
    "pump_slip": DeepName(
        "1/Pa", "what that share of the delivery without pressure loses per pressure", 0.0, 5e-9
    ),
    "pump_start": DeepName(
        "m3", "what a start falls short by, beyond the vehicle's file", 0.0, 2e-6
    ),
    "valve": DeepName("", "what the valve lets in, as a share of its datasheet", 0.3, 0.0, 1.0),
    "valve_laminar": DeepName(
        "Pa^0.5", "root of the pressure far below which the valve's flow is laminar", 0.0, 1e3
    ),
    "bypass": DeepName("", "what the bypass lets in, as a share of its datasheet", 0.3, 0.0, 1.0),
    "creep": DeepName("m3/s", "volume lost with time: leaks, creep, cooling", 0.0, 3e-10),
    "inertia": DeepName("", "mass that is accelerated, as a share of the file's", 0.05, 0.0, 1.0),
}
# Errors of a cast are no parameters: their deviations say how far it is believed. Sensors are off
# by 0.002 K and 0.01 in salinity, most of it alike at all depths, which moves only the volume at
# the beginning; half a part of that is taken to differ between depths. A cast is of another hour
# and place: layers lie some metres higher or lower.
CAST: dict[str, DeepName] = {
    "cast_density": DeepName("kg/m3", "error of the cast that differs between depths", 0.0, 4e-3),
    "cast_heave": DeepName("m", "by how much layers lie elsewhere than in the cast", 0.0, 5.0),
}
_RHO = 1027.0  # kg/m3, to turn an error of density into one of volume
DEFAULT = tuple(name for name in DEEP if name not in ("trapped_air", "bypass"))


class Body(NamedTuple):
    """What of a vehicle is not identified."""

    mass: float  # kg, that the water has to carry
    volume: float  # m3, of the hull at the surface, without trapped air
    reference_temperature: float  # degC
    inertia: float  # kg, that is accelerated, as the file has it


def body_of(vehicle: Vehicle) -> Body:
    """Return a vehicle's mass and hull."""
    hull = vehicle.hull
    return Body(
        mass=weight_mass(vehicle),
        volume=hull.displaced_volume - hull.trapped_air,
        reference_temperature=hull.reference_temperature,
        inertia=vehicle.mass,
    )


def priors_of(vehicle: Vehicle, given: Mapping[str, Prior]) -> dict[str, Prior]:
    """Return what is known of each quantity: as given, else from the vehicle's file.

    Raises InputError where the vehicle has no quadratic drag and none is given.
    """
    actuator = vehicle.engine
    parts = hull_parts(vehicle)
    volume = sum(part.volume for part in parts)
    mean = {name: about.mean for name, about in (DEEP | CAST).items()}
    for name in ("compressibility", "stiffening", "thermal_expansion"):
        mean[name] = sum(part.volume * getattr(part, name) for part in parts) / volume
    mean |= {"drag": vehicle.drag.k_dt, "drag_up": vehicle.drag.rising_ratio}
    mean["trapped_air"] = vehicle.hull.trapped_air
    if isinstance(actuator, PumpAndValve):
        mean["valve_laminar"] = math.sqrt(actuator.valve.laminar_pressure)
    mean["creep"] = actuator.creep if isinstance(actuator, PumpAndValve) else 0.0
    if not mean["drag"] > 0.0 and "drag" not in given:
        what = "deep dives identify quadratic drag, and the vehicle has none to begin with"
        remedy = 'Give `priors={"drag": "160 +- 30 N s2/m2"}`, or k_dt'
        raise InputError(what, field="motion.drag.k_dt", remedy=remedy)
    return {
        name: given.get(name, Prior(mean[name], about.relative * abs(mean[name]) + about.absolute))
        for name, about in (DEEP | CAST).items()
    }


def cast_volume(body: Body, priors: Mapping[str, Prior], layers: Array) -> Array:
    """Return by what neutral volumes err with the cast [m3] [n], 1 sigma; layers: [m3/m] [n]."""
    sensor = priors["cast_density"].std * body.mass / _RHO**2
    return np.hypot(sensor, priors["cast_heave"].std * np.abs(layers))


def check_deep_names(names: Sequence[str], option: str) -> None:
    """Raise InputError for a name that deep dives cannot identify."""
    check_names(names, DEEP, option, "there is no such parameter of deep dives")


def check_deep_request(
    vehicle: Vehicle,
    dives: int,
    casts: int,
    *,
    free: Sequence[str] | None,
    fixed: Mapping[str, float] | None,
    priors: Mapping[str, Prior] | None,
) -> tuple[dict[str, float], dict[str, Prior]]:
    """Return what is fixed and the priors, in SI; each may be a text.

    Raises InputError for what cannot be identified, whatever the logs say.
    """
    if vehicle.command != "volume change":
        what = "deep dives are identified for a pump and a valve"
        remedy = "Describe the actuator as kind pump-valve"
        raise InputError(what, field="actuator.kind", value=vehicle.actuator.kind, remedy=remedy)
    if casts not in (1, dives):
        remedy = "Give one cast for all dives, or one for each in their order"
        raise InputError(f"{casts} casts for {dives} dives", field="cast", remedy=remedy)
    check_deep_names(free or (), "free")
    units = {name: about.unit for name, about in DEEP.items()}
    held = read_values(fixed, units)
    known = read_priors(priors, units | {name: about.unit for name, about in CAST.items()})
    for name, about in CAST.items():
        if name in known and known[name].mean != 0.0:
            what = "it is an error that is not known to either side"
            mended = f'`priors={{"{name}": "0 +- {known[name].std:g} {about.unit}"}}`'
            remedy = f"Correct the cast, and give {mended}"
            raise InputError(what, field="priors", value=name, remedy=remedy)
    return held, known


def hull_volume(
    body: Body, values: Mapping[str, float], pressure: Array, temperature: Array
) -> Array:
    """Return what the hull displaces, trapped air included [m3]."""
    beta, s, p = values["compressibility"], values["stiffening"], np.asarray(pressure)
    if s > 0.0:
        p = np.minimum(p, max(beta, 0.0) / s)
    solid = 1.0 - beta * p + 0.5 * s * p * p
    solid = solid + values["thermal_expansion"] * (temperature - body.reference_temperature)
    return body.volume * solid + values["trapped_air"] * ATMOSPHERE / (ATMOSPHERE + pressure)


def run_volumes(values: Mapping[str, float], dive: DeepDive) -> Array:
    """Return what each run of pump, valve or bypass added to the drive's volume [m3] [m].

    As in a vehicle's file no pump gives more under pressure, or at its start, than without.
    """
    slip = values["pump_slip"] * dive.actions.pressure * dive.actions.unloaded
    pumped = values["pump_delivery"] * dive.actions.volume - slip
    pumped = np.minimum(pumped, values["pump_delivery"] * dive.actions.unloaded)
    pumped = pumped - _short(values, dive)
    root = valve_root(max(values["valve_laminar"], 0.0), dive.actions.head)
    let_in = values["valve"] * dive.actions.opened * root
    let_in = np.where(dive.actions.bypass, values["bypass"] * dive.actions.volume, let_in)
    return np.where(dive.actions.pumps, np.maximum(pumped, 0.0), -let_in)


def _short(values: Mapping[str, float], dive: DeepDive) -> Array:
    """Return what the start of each run falls short by, were it the pump's [m3] [m]."""
    return np.maximum(dive.actions.short + values["pump_start"], 0.0)


def excess(body: Body, values: Mapping[str, float], start: float | Array, dive: DeepDive) -> Array:
    """Return by how much volume the vehicle is too heavy in each piece [m3] [n], E.

    start: the drive's volume when the dive began [m3].
    """
    pieces = dive.pieces
    drive = start + pieces.before @ run_volumes(values, dive)
    drive = drive - pieces.leaked - values["creep"] * pieces.idle
    hull = hull_volume(body, values, pieces.pressure, pieces.temperature)
    return np.asarray(body.mass / pieces.density - hull - drive)


def drag_volume(values: Mapping[str, float], speed: Array, density: Array, gravity: float) -> Array:
    """Return the volume that drag carries at a speed, k w|w|/(rho g) [m3] [n]."""
    k = values["drag"] * np.where(speed >= 0.0, 1.0, values["drag_up"])
    return np.asarray(k * speed * np.abs(speed) / (density * gravity))


FINE, COARSE = 5.0, 15.0  # s, steps while the speed follows a run, and else: 1 cm at most
_UNSEEN, _GAP = 60.0, 1800.0  # s, steps where two samples are so far from each other
_FOLLOWS = 150.0  # s after a run
_KNOTS, _WIDER = (0.0, 2e5, 5e5), 1.6  # Pa, of the cast's error; each further one so much deeper
GATE = 4.0
_SPEED_STD = 0.02  # m/s, of the speed at the beginning: that between the first two samples
_START = (2.0, 5e-6)  # share of what drag carries then, and m3: of the volume that it asks for


@dataclass(frozen=True)
class Path:
    """Samples [n] and steps [m] of a dive."""

    dive: DeepDive
    time: Array  # s [n], of the samples
    track: Track
    runs: _Runs
    leaked: Array  # m3 [m], as the vehicle's file has it
    idle: Array  # s [m], without the runs
    warmth: Array  # degC [m], of the hull
    water: Water
    speed: float  # m/s at the beginning


class Filtered(NamedTuple):
    """Innovations of the samples but the first [n - 1], and the state at the end."""

    innovation: Array  # Pa
    variance: Array  # Pa2
    state: Array
    covariance: Array

    @property
    def start(self) -> float:
        """The drive's volume when the dive began [m3]."""
        return float(self.state[of.V0])


def deep_path(dive: DeepDive, body: Body, priors: Mapping[str, Prior]) -> Path:
    """Return the samples and steps of a dive."""
    # samples that determine a speed, and the last before each run, perhaps its cause
    before = np.searchsorted(dive.time, dive.actions.time, side="right") - 1
    at = np.union1d(nodes(dive.time), before[before >= 0])
    time, measured = dive.time[at], dive.pressure[at].astype(np.float64)
    begin, seconds = dive.actions.time, np.maximum(dive.actions.seconds, 1e-3)
    end = begin + seconds
    edge, sample = _edges(time, begin, end + _FOLLOWS)
    steps, middle = np.diff(edge), 0.5 * (edge[1:] + edge[:-1])
    runs = _runs(edge, begin, end)
    ran = runs.done(begin, seconds) / steps
    place = np.clip(np.searchsorted(edge, begin, side="right") - 1, 0, len(steps) - 1)
    begun = np.zeros(len(steps))
    np.add.at(begun, place, dive.actions.volume)
    water = dive.water.at(np.arange(0.0, float(dive.water.pressure[-1]), SPACING))
    deeper = list(_KNOTS)
    while deeper[-1] < dive.pressure.max():
        deeper.append(deeper[-1] * _WIDER)
    knots = np.array(deeper)
    width = cast_volume(body, priors, water.at(knots).layers)
    weight = float(water.at(measured[:1]).density[0]) * dive.gravity
    return Path(
        dive=dive,
        time=time,
        track=Track(steps, sample, measured, dive.rounding[at], begun, knots, width),
        runs=runs,
        leaked=np.interp(middle, dive.time, dive.leaked),
        idle=middle - time[0] - ran,
        warmth=np.interp(middle, dive.time, dive.temperature),
        water=water,
        speed=float((measured[1] - measured[0]) / (time[1] - time[0])) / weight,
    )


def _edges(time: Array, begin: Array, end: Array) -> tuple[Array, Index]:
    """Return the edges of the steps [s] [m + 1], and the sample at the end of each or -1 [m].

    Steps are `COARSE`, and `FINE` between begin and end [s] [k] of what changes the speed.
    """
    coarse = np.arange(time[0], time[-1], COARSE)
    after = np.minimum(np.searchsorted(time, coarse), len(time) - 1)
    unseen = (time[after] - time[np.maximum(after - 1, 0)] > _GAP) & (coarse % _UNSEEN >= COARSE)
    marks = [time, coarse[~unseen]]
    marks += [np.arange(a, b, FINE) for a, b in zip(begin, end, strict=True)]
    every = np.unique(np.concatenate(marks))
    every = every[(every >= time[0]) & (every <= time[-1])]
    sample = np.searchsorted(time, every)
    at_sample = time[np.minimum(sample, len(time) - 1)] == every
    # Marks of several kinds next to each other are one: a sample, or the first.
    apart = np.append(True, np.diff(every) > 0.3 * FINE)
    kept = apart | at_sample
    return every[kept], np.where(at_sample, sample, -1)[kept][1:]


class _Runs(NamedTuple):
    """Which steps of [m] runs overlap [q], and by which they are over [actions]."""

    edge: Array  # s [m + 1]
    step: Index  # [q]
    run: Index  # [q]
    end: Array  # s [actions]
    after: Index  # [actions], first step that begins when a run is over

    def done(self, begin: Array, size: Array) -> Array:
        """Return the integral over each step of what runs have given so far [m].

        begin: when each begins to give [s] [actions], evenly until its end; size: what it gives in
        all [actions].
        """
        a, b = self.edge[self.step], self.edge[self.step + 1]
        first, last = begin[self.run], self.end[self.run]

        def given(t: Array) -> Array:
            into = np.clip(t - first, 0.0, last - first)
            return np.asarray(into * into / (2.0 * (last - first)) + np.maximum(t - last, 0.0))

        count = len(self.edge) - 1
        within = np.bincount(self.step, (given(b) - given(a)) * size[self.run], count)
        over = np.cumsum(np.bincount(self.after, size, count + 1))[:count]
        return np.asarray(within + over * np.diff(self.edge))


def _runs(edge: Array, begin: Array, end: Array) -> _Runs:
    first = np.maximum(np.searchsorted(edge, begin, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(edge, end), len(edge) - 1)
    step = [np.arange(a, b) for a, b in zip(first, after, strict=True)]
    run = np.repeat(np.arange(len(begin)), [len(one) for one in step])
    return _Runs(edge, np.concatenate(step), run, end, after)


def drive_volume(values: Mapping[str, float], path: Path) -> Array:
    """Return what runs and leaks have added to the drive's volume in the mean of a step [m3] [m].

    A pump gives nothing until it has made up for what its start falls short by.
    """
    dive, seconds = path.dive, path.runs.end - path.dive.actions.time
    added = run_volumes(values, dive)
    short = np.where(dive.actions.pumps, _short(values, dive), 0.0)
    size = np.abs(added)
    gives = np.divide(size, size + short, out=np.ones(len(size)), where=size > 0.0)
    begin = path.runs.end - np.maximum(gives * seconds, 1e-3)
    done = path.runs.done(begin, added) / path.track.steps
    return np.asarray(done - path.leaked - values["creep"] * path.idle)


def neutral_table(body: Body, values: Mapping[str, float], path: Path) -> Array:
    """Return the water as the filter takes it [k, 3]: N [m3], rho g [Pa/m], G [m3/m].

    N is for a hull at its reference temperature; what its warmth adds counts with the drive.
    """
    neutral = cold_neutral(body, values, path.water)
    weight = path.water.density * path.dive.gravity
    return np.stack([neutral, weight, path.water.layers], axis=1)


def cold_neutral(body: Body, values: Mapping[str, float], water: Water) -> Array:
    """Return what is neutral in water but for the hull's warmth [m3] [k]."""
    cold, no_warmth = {**values, "thermal_expansion": 0.0}, np.zeros(len(water.pressure))
    return body.mass / water.density - hull_volume(body, cold, water.pressure, no_warmth)


def warmed(body: Body, values: Mapping[str, float], temperature: Array) -> Array:
    """Return what the warmth of the hull [degC] adds to its volume [m3] [n]."""
    return body.volume * values["thermal_expansion"] * (temperature - body.reference_temperature)


def filtered(
    body: Body, values: Mapping[str, float], noise: Noise, path: Path, gate: float = GATE
) -> Filtered:
    """Return what the filter makes of a dive with these parameters.

    gate: deviations of an innovation from which on a pressure counts less.
    """
    water = neutral_table(body, values, path)
    volume = drive_volume(values, path) + warmed(body, values, path.warmth)
    x = np.zeros(of.DYNAMIC + len(path.track.knots))
    p, w = float(path.track.measured[0]), path.speed
    neutral, weight, _ = (float(np.interp(p, path.water.pressure, y)) for y in water.T)
    carried = _drag(values, w) * w * abs(w) / weight
    x[of.P], x[of.W], x[of.V0] = p, w, neutral - volume[0] - carried
    variance = np.ones(len(x))
    variance[of.P] = noise.pressure**2 + path.track.rounding[0]
    variance[of.W] = _SPEED_STD**2
    variance[of.U], variance[of.RATE] = noise.water**2, noise.water**2 / noise.lasts**2
    variance[of.Z] = displaced_variance(variance[of.U], noise.lasts)
    variance[of.D], variance[of.V0] = 0.0, (_START[0] * abs(carried) + _START[1]) ** 2
    covariance = np.diag(variance)
    down, mass = values["drag"], body.inertia * values["inertia"]
    moves = Resistance(mass, down, down * values["drag_up"])
    innovation, spread = filter_kernel(path.track, volume, water, moves, noise, gate, x, covariance)
    return Filtered(innovation[1:], spread[1:], x, covariance)


STEP = 20.0  # s; half of it moves arrivals by less than a second


@dataclass(frozen=True, kw_only=True)
class Replay:
    """A replayed dive [n]; pressure stops at the surface."""

    time: Array  # s
    pressure: Array  # Pa
    speed: Array  # m/s

    def at(self, time: Array) -> Array:
        """Return the pressure at times [s] of the dive [Pa]."""
        return np.asarray(np.interp(time, self.time, self.pressure))

    def arrival(self, pressure: float, *, after: float = -np.inf) -> float:
        """Return when it first crosses a pressure [Pa] after a time [s]; NaN where it does not."""
        t, p = self.time, self.pressure
        later = t >= after
        t, p = t[later], p[later]
        side = p >= pressure
        turn = np.flatnonzero(side[1:] != side[:-1])
        if not len(turn):
            return np.nan
        i = int(turn[0])
        return float(t[i] + (pressure - p[i]) / (p[i + 1] - p[i]) * (t[i + 1] - t[i]))


def replay(
    body: Body,
    values: Mapping[str, float],
    start: float,
    dive: DeepDive,
    *,
    pressure: float | None = None,
    begin: float | None = None,
    end: float | None = None,
    step: float = STEP,
) -> Replay:
    """Return the dive as the model predicts it, from its first sample or a time `begin` [s].

    start: the drive's volume when the dive began [m3]; pressure: where it begins [Pa], as logged
    unless given; end [s]: its last sample unless given. The hull's temperature is as logged.
    """
    t0 = float(dive.time[0]) if begin is None else begin
    t1 = float(dive.time[-1]) if end is None else end
    turns = np.concatenate([dive.actions.time, dive.actions.time + dive.actions.seconds])
    turns = turns[(turns > t0) & (turns < t1)]
    marks = np.unique(np.concatenate([np.arange(t0, t1, step), [t1], turns]))
    heat = warmed(body, values, np.interp(marks, dive.time, dive.temperature))
    asked = (start + gained_volume(values, dive, marks) + heat).tolist()
    neutral, grid = cold_neutral(body, values, dive.water), dive.water.pressure

    def water(p: float, volume: float) -> tuple[float, float]:
        """Return the excess of volume at a pressure, and the water's weight [N/m3]."""
        heavy = float(np.interp(p, grid, neutral)) - volume
        return heavy, float(np.interp(p, grid, dive.water.density)) * dive.gravity

    p = float(np.interp(t0, dive.time, dive.pressure)) if pressure is None else pressure
    heavy, rho_g = water(p, asked[0])
    w = float(np.sign(heavy) * np.sqrt(abs(heavy) * rho_g / _drag(values, heavy)))
    found = [(p, w)]
    for volume, dt in zip(asked[1:], np.diff(marks).tolist(), strict=True):
        heavy, rho_g = water(p, volume)
        w = _after(w, rho_g * heavy, body.inertia * values["inertia"], values, dt)
        p = max(p + rho_g * w * dt, 0.0)
        found.append((p, w))
    pressures, speeds = np.array(found).T
    return Replay(time=marks, pressure=pressures, speed=speeds)


def _drag(values: Mapping[str, float], way: float) -> float:
    return values["drag"] * (1.0 if way >= 0.0 else values["drag_up"])


def _after(w: float, force: float, mass: float, values: Mapping[str, float], dt: float) -> float:
    """Return the speed after dt [s] under a force [N] and quadratic drag, by implicit Euler."""
    a = mass / dt
    push = a * w + force
    k = _drag(values, push)
    # k w|w| + (m/dt) w = push has one root, of the sign of push.
    size = (np.sqrt(a * a + 4.0 * k * abs(push)) - a) / (2.0 * k)
    return float(np.copysign(size, push))


def gained_volume(values: Mapping[str, float], dive: DeepDive, time: Array) -> Array:
    """Return what the drive has gained since the beginning at each time [m3] [n]."""
    seconds = np.maximum(dive.actions.seconds, 1e-3)
    done = np.clip((time[:, None] - dive.actions.time) / seconds, 0.0, 1.0)
    idle = time - float(dive.time[0]) - done @ seconds
    leaked = np.interp(time, dive.time, dive.leaked)
    return np.asarray(done @ run_volumes(values, dive) - leaked - values["creep"] * idle)
