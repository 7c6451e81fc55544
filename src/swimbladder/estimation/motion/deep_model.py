"""The vertical motion of a deep vehicle, in what can be identified of it.

::

    m w' = rho g E - k w|w|                  speed w, positive down, k = k_dt or k_dt r rising
    E = M/rho - V_hull(p, T) - V             by how much volume it is too heavy
    V_hull = V_0 (1 - beta p + s p^2/2 + alpha (T - T_ref)) + V_air p_a/(p_a + p)
    V = V_start + sum max(d pumped - short - v_s, 0) - f bled - b bypassed - leaked - l t_idle

with M, V_0, m, the nominal volumes of the runs, what starts fall `short` by and what leaks from the
vehicle's file. What fixes how large all volumes are together is the inertia m, where speeds change
fast enough to show it, M/rho, whose shape the water gives, and what is known before.

A dive is filtered by `deep_filter`, in steps that `deep_path` cuts. It is also replayed from its
beginning, by the logged runs of pump and valve alone: m w' = rho g E - k_dt w|w|, implicit in the
drag, so that a step of many seconds ends at the steady speed; the volume is that of the runs so
far, each spread over its seconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swimbladder.errors import InputError
from swimbladder.estimation.estimates import Prior, check_names
from swimbladder.estimation.motion import deep_filter as of
from swimbladder.estimation.motion.deep_dive import DeepDive, nodes
from swimbladder.estimation.motion.deep_filter import displaced_variance, filter_kernel
from swimbladder.estimation.series import Array, Index
from swimbladder.physics.hull import hull_parts, weight_mass
from swimbladder.physics.seawater.column import ATMOSPHERE
from swimbladder.vehicle import PumpAndValve, Vehicle


class DeepName(NamedTuple):
    """A quantity that can be identified from deep dives."""

    unit: str
    meaning: str
    relative: float  # standard deviation of its default prior, as a share of its mean
    absolute: float  # [unit], added to it


DEEP: dict[str, DeepName] = {
    "drag": DeepName("N s2/m2", "quadratic drag k_dt while sinking", 0.1, 0.0),
    "drag_up": DeepName("", "drag while rising, as a share of that while sinking", 0.0, 0.3),
    "compressibility": DeepName("1/Pa", "of the hull and all in it, at the surface", 0.5, 5e-11),
    "stiffening": DeepName("1/Pa2", "how that falls with pressure", 0.0, 1e-17),
    "thermal_expansion": DeepName("1/K", "of volume, with the logged temperature", 0.5, 5e-5),
    "trapped_air": DeepName("m3", "at the surface; Boyle", 0.5, 2e-5),
    "pump_delivery": DeepName("", "what the pump gives, as a share of its datasheet", 0.3, 0.0),
    "pump_slip": DeepName("1/Pa", "what that share loses per pressure", 0.0, 5e-9),
    "pump_start": DeepName(
        "m3", "what a start falls short by, beyond the vehicle's file", 0.0, 2e-6
    ),
    "valve": DeepName("", "what the valve lets in, as a share of its datasheet", 0.3, 0.0),
    "bypass": DeepName("", "what the bypass lets in, as a share of its datasheet", 0.3, 0.0),
    "creep": DeepName("m3/s", "volume lost with time: leaks, creep, cooling", 0.0, 3e-10),
    "inertia": DeepName("", "mass that is accelerated, as a share of the file's", 0.05, 0.0),
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
DEFAULT = tuple(name for name in DEEP if name not in ("trapped_air", "pump_slip", "bypass"))


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
        mass=weight_mass(vehicle), volume=hull.displaced_volume - hull.trapped_air,
        reference_temperature=hull.reference_temperature, inertia=vehicle.mass,
    )  # fmt: skip


def priors_of(vehicle: Vehicle, given: Mapping[str, Prior]) -> dict[str, Prior]:
    """Return what is known of each quantity: as given, else from the vehicle's file.

    Raises InputError where the vehicle has no quadratic drag and none is given.
    """
    actuator = vehicle.actuator
    parts = hull_parts(vehicle)
    volume = sum(part.volume for part in parts)
    mean = {
        "drag": vehicle.drag.k_dt,
        "drag_up": vehicle.drag.rising_ratio,
        "compressibility": sum(x.volume * x.compressibility for x in parts) / volume,
        "stiffening": sum(x.volume * x.stiffening for x in parts) / volume,
        "thermal_expansion": sum(x.volume * x.thermal_expansion for x in parts) / volume,
        "trapped_air": vehicle.hull.trapped_air,
        "pump_delivery": 1.0,
        "pump_slip": 0.0,
        "pump_start": 0.0,
        "valve": 1.0,
        "bypass": 1.0,
        "creep": actuator.creep if isinstance(actuator, PumpAndValve) else 0.0,
        "inertia": 1.0,
        **dict.fromkeys(CAST, 0.0),
    }
    if not mean["drag"] > 0.0 and "drag" not in given:
        what = "deep dives identify quadratic drag, and the vehicle has none to begin with"
        remedy = 'Give --prior "drag=160 +- 30 N s2/m2", or k_dt'
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
    vehicle: Vehicle, dives: int, casts: int, *, free: Sequence[str] | None,
    fixed: Sequence[str], priors: Mapping[str, Prior],
) -> None:  # fmt: skip
    """Raise InputError for what cannot be identified, whatever the logs say."""
    if not isinstance(vehicle.actuator, PumpAndValve):
        what = "deep dives are identified for a pump and a valve"
        remedy = "Describe the actuator as kind pump-valve"
        raise InputError(what, field="actuator.kind", value=vehicle.actuator.kind, remedy=remedy)
    if casts not in (1, dives):
        remedy = "Give one cast for all dives, or one for each in their order"
        raise InputError(f"{casts} casts for {dives} dives", field="--cast", remedy=remedy)
    check_deep_names(free or (), "--free")
    check_deep_names(fixed, "--set")
    check_deep_names([name for name in priors if name not in CAST], "--prior")
    for name, about in CAST.items():
        if name in priors and priors[name].mean != 0.0:
            raise InputError(
                "it is an error that is not known to either side", field="--prior", value=name,
                remedy="Correct the cast, and give "
                f'--prior "{name}=0 +- {priors[name].std:g} {about.unit}"',
            )  # fmt: skip


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
    """Return what each run of pump, valve or bypass added to the drive's volume [m3] [m]."""
    share = values["pump_delivery"] - values["pump_slip"] * dive.action_pressure
    pumped = share * dive.action_volume - dive.action_short - values["pump_start"]
    flow = np.where(dive.action_bypass, values["bypass"], values["valve"])
    return np.where(dive.action_pumps, np.maximum(pumped, 0.0), -flow * dive.action_volume)


def excess(body: Body, values: Mapping[str, float], start: float | Array, dive: DeepDive) -> Array:
    """Return by how much volume the vehicle is too heavy in each piece [m3] [n], E.

    start: the drive's volume when the dive began [m3].
    """
    pieces = dive.pieces
    drive = start + pieces.before @ run_volumes(values, dive)
    drive = drive - pieces.leaked - values["creep"] * pieces.idle
    return np.asarray(
        body.mass / pieces.density
        - hull_volume(body, values, pieces.pressure, pieces.temperature)
        - drive
    )


def drag_volume(values: Mapping[str, float], speed: Array, density: Array, gravity: float) -> Array:
    """Return the volume that drag carries at a speed, k w|w|/(rho g) [m3] [n]."""
    k = values["drag"] * np.where(speed >= 0.0, 1.0, values["drag_up"])
    return np.asarray(k * speed * np.abs(speed) / (density * gravity))


FINE, COARSE = 5.0, 15.0  # s, steps while the speed follows a run, and else: 1 cm at most
_UNSEEN, _GAP = 60.0, 1800.0  # s, steps where two samples are so far from each other
_FOLLOWS = 150.0  # s after a run
_SPACING = 1e4  # Pa, of the water's table
_KNOTS, _WIDER = (0.0, 2e5, 5e5), 1.6  # Pa, of the cast's error; each further one so much deeper
_SPEED_STD = 0.02  # m/s, of the speed at the beginning: that between the first two samples
_START = (2.0, 5e-6)  # share of what drag carries then, and m3: of the volume that it asks for


class Noise(NamedTuple):
    """Standard deviations of what the model does not know, and how long the water's lasts."""

    pressure: float  # Pa, of a measured pressure
    water: float  # m/s, of the water's vertical speed
    drift: float  # m3/s^0.5, of the drive's or the hull's volume
    runs: float  # -, of the volume of a run
    lasts: float  # s, for how long the water's speed stays alike, tau; no deviation


@dataclass(frozen=True)
class Path:
    """Steps [m], samples [n] and the water [k] of a dive."""

    dive: DeepDive
    time: Array  # s [n], of the samples
    measured: Array  # Pa [n]
    steps: Array  # s [m]
    sample: Index  # [m], sample at the end of a step, or -1
    runs: _Runs
    begun: Array  # m3 [m], nominal volume of runs that begin in a step
    leaked: Array  # m3 [m], as the vehicle's file has it
    idle: Array  # s [m], without the runs
    warmth: Array  # degC [m], of the hull
    grid: Array  # Pa [k]
    density: Array  # kg/m3 [k]
    layers: Array  # m3/m [k]
    knots: Array  # Pa [j]
    width: Array  # m3 [j], deviation of the neutral volume by errors of the cast
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
    before = np.searchsorted(dive.time, dive.action_time, side="right") - 1
    at = np.union1d(nodes(dive.time), before[before >= 0])
    time, measured = dive.time[at], dive.pressure[at].astype(np.float64)
    begin, seconds = dive.action_time, np.maximum(dive.action_seconds, 1e-3)
    end = begin + seconds
    edge, sample = _edges(time, begin, end + _FOLLOWS)
    steps, middle = np.diff(edge), 0.5 * (edge[1:] + edge[:-1])
    runs = _runs(edge, begin, end)
    ran = runs.done(begin, seconds) / steps
    place = np.clip(np.searchsorted(edge, begin, side="right") - 1, 0, len(steps) - 1)
    begun = np.zeros(len(steps))
    np.add.at(begun, place, dive.action_volume)
    grid = np.arange(0.0, float(dive.water_pressure[-1]), _SPACING)
    density = np.interp(grid, dive.water_pressure, dive.water_density)
    layers = np.interp(grid, dive.water_pressure, dive.water_layers)
    knots = list(_KNOTS)
    while knots[-1] < dive.pressure.max():
        knots.append(knots[-1] * _WIDER)
    weight = float(np.interp(measured[0], grid, density)) * dive.gravity
    return Path(
        dive=dive, time=time, measured=measured, steps=steps, sample=sample,
        runs=runs, begun=begun,
        leaked=np.interp(middle, dive.time, dive.leaked), idle=middle - time[0] - ran,
        warmth=np.interp(middle, dive.time, dive.temperature), grid=grid, density=density,
        layers=layers, knots=np.array(knots),
        width=cast_volume(body, priors, np.interp(knots, grid, layers)),
        speed=float((measured[1] - measured[0]) / (time[1] - time[0])) / weight,
    )  # fmt: skip


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
    dive, seconds = path.dive, path.runs.end - path.dive.action_time
    added = run_volumes(values, dive)
    short = np.where(dive.action_pumps, dive.action_short + values["pump_start"], 0.0)
    size = np.abs(added)
    gives = np.divide(size, size + np.maximum(short, 0.0), out=np.ones(len(size)), where=size > 0.0)
    begin = path.runs.end - np.maximum(gives * seconds, 1e-3)
    done = path.runs.done(begin, added) / path.steps
    return np.asarray(done - path.leaked - values["creep"] * path.idle)


def neutral_table(body: Body, values: Mapping[str, float], path: Path) -> Array:
    """Return the water as the filter takes it [k, 3]: N [m3], rho g [Pa/m], G [m3/m].

    N is for a hull at its reference temperature; what its warmth adds counts with the drive.
    """
    cold = {**values, "thermal_expansion": 0.0}
    hull = hull_volume(body, cold, path.grid, np.zeros(len(path.grid)))
    neutral = body.mass / path.density - hull
    return np.stack([neutral, path.density * path.dive.gravity, path.layers], axis=1)


def filtered(body: Body, values: Mapping[str, float], noise: Noise, path: Path) -> Filtered:
    """Return what the filter makes of a dive with these parameters."""
    water = neutral_table(body, values, path)
    volume = drive_volume(values, path)
    warm = path.warmth - body.reference_temperature
    volume = volume + body.volume * values["thermal_expansion"] * warm
    down = values["drag"]
    up = down * values["drag_up"]
    x = np.zeros(of.DYNAMIC + len(path.knots))
    p, w = float(path.measured[0]), path.speed
    carried = (down if w > 0.0 else up) * w * abs(w) / float(np.interp(p, path.grid, water[:, 1]))
    x[of.P], x[of.W] = p, w
    x[of.V0] = float(np.interp(p, path.grid, water[:, 0])) - volume[0] - carried
    variance = np.ones(len(x))
    variance[of.P], variance[of.W] = noise.pressure**2, _SPEED_STD**2
    variance[of.U], variance[of.RATE] = noise.water**2, noise.water**2 / noise.lasts**2
    variance[of.Z] = displaced_variance(variance[of.U], noise.lasts)
    variance[of.D] = 0.0
    variance[of.V0] = (_START[0] * abs(carried) + _START[1]) ** 2
    covariance = np.diag(variance)
    n = len(path.measured)
    innovation, spread = np.zeros(n), np.ones(n)
    filter_kernel(
        path.steps, volume, path.begun, path.sample, path.measured, _SPACING, water, path.knots,
        path.width, np.array([body.inertia * values["inertia"], down, up]), np.array(noise), x,
        covariance, innovation, spread,
    )  # fmt: skip
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
    body: Body, values: Mapping[str, float], start: float, dive: DeepDive, *,
    pressure: float | None = None, begin: float | None = None, end: float | None = None,
    step: float = STEP,
) -> Replay:  # fmt: skip
    """Return the dive as the model predicts it, from its first sample or a time `begin` [s].

    start: the drive's volume when the dive began [m3]; pressure: where it begins [Pa], as logged
    unless given; end [s]: its last sample unless given. The hull's temperature is as logged.
    """
    t0 = float(dive.time[0]) if begin is None else begin
    t1 = float(dive.time[-1]) if end is None else end
    turns = np.concatenate([dive.action_time, dive.action_time + dive.action_seconds])
    marks = np.unique(
        np.concatenate([np.arange(t0, t1, step), [t1], turns[(turns > t0) & (turns < t1)]])
    )
    volume = _volume(values, dive, marks)
    warmth = np.interp(marks, dive.time, dive.temperature)
    still = {**values, "thermal_expansion": 0.0}
    grid, density, g = dive.water_pressure, dive.water_density, dive.gravity
    # What is neutral at each pressure of the column, but for the hull's temperature.
    neutral = body.mass / density - hull_volume(
        body, still, grid, np.full(len(grid), body.reference_temperature)
    )
    heat = body.volume * values["thermal_expansion"] * (warmth - body.reference_temperature)
    asked = start + volume + heat
    p = float(np.interp(t0, dive.time, dive.pressure)) if pressure is None else pressure
    first = _excess(p, grid, neutral, asked[0])
    rho_g = float(np.interp(p, grid, density)) * g
    w = float(np.sign(first) * np.sqrt(abs(first) * rho_g / _drag(values, first)))
    found, speeds = [p], [w]
    for i in range(1, len(marks)):
        dt = float(marks[i] - marks[i - 1])
        heavy = _excess(p, grid, neutral, float(asked[i]))
        rho_g = float(np.interp(p, grid, density)) * g
        w = _after(w, rho_g * heavy, body.inertia * values["inertia"], values, dt)
        p = max(p + rho_g * w * dt, 0.0)
        found.append(p)
        speeds.append(w)
    return Replay(time=marks, pressure=np.array(found), speed=np.array(speeds))


def _excess(p: float, grid: Array, neutral: Array, asked: float) -> float:
    return float(np.interp(p, grid, neutral)) - asked


def _drag(values: Mapping[str, float], way: float) -> float:
    return values["drag"] * (1.0 if way >= 0.0 else values["drag_up"])


def _after(w: float, force: float, mass: float, values: Mapping[str, float], dt: float) -> float:
    """Return the speed after dt [s] under a force [N] and quadratic drag, by implicit Euler."""
    push = mass / dt * w + force
    k = _drag(values, push)
    # k w|w| + (m/dt) w = push has one root, of the sign of push.
    a = mass / dt
    size = (np.sqrt(a * a + 4.0 * k * abs(push)) - a) / (2.0 * k)
    return float(np.copysign(size, push))


def _volume(values: Mapping[str, float], dive: DeepDive, time: Array) -> Array:
    """Return what the drive has gained since the beginning at each time [m3] [n]."""
    seconds = np.maximum(dive.action_seconds, 1e-3)
    done = np.clip((time[:, None] - dive.action_time) / seconds, 0.0, 1.0)
    idle = time - float(dive.time[0]) - done @ seconds
    leaked = np.interp(time, dive.time, dive.leaked)
    return np.asarray(done @ run_volumes(values, dive) - leaked - values["creep"] * idle)
