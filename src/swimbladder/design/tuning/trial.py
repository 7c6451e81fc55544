"""What a law does with vehicles of the region: a step of depth, then holding it, with noise.

The electrical energy of a motor is from samples: a winding takes u (u - kappa q)/R, and with u held
over a sample, the integral of q is the volume that was pumped.

Floats under a law of volume changes go there and back, then hold: half of the flights go down a
step, the other half up it, so that what is said of a range of depths is of both ways. A flight has
arrived for good when it is last outside the tolerance, or 2 % of the step where that is more.
Energy is that of pump and valve from the battery's cells.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.control.law import Law
from swimbladder.control.records import leaves
from swimbladder.design.linear.pump_valve import with_supply
from swimbladder.design.tuning.region import Region
from swimbladder.physics.actuator import reduced
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.dynamics import Plant, body_plant, plant
from swimbladder.physics.electric import electrical_power, largest_voltage, winding_current
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop import simulate_ensemble
from swimbladder.sim.closed_loop.block import schedule
from swimbladder.sim.closed_loop.water import Medium, medium_of
from swimbladder.vehicle import Positioner, Vehicle

if TYPE_CHECKING:
    import xarray

    from swimbladder.physics.seawater import Column

Array = NDArray[np.float64]


class Winding(NamedTuple):
    """A motor as its supply sees it."""

    R: float  # ohm
    kappa: float  # V s/m3, back electromotive force per volume rate


def winding(vehicle: Vehicle) -> Winding | None:
    """Return the winding of a vehicle's motor, None where R or k_T are not known."""
    if isinstance(vehicle.actuator, Positioner):
        return None
    a = reduced(vehicle.actuator, vehicle.water)
    if a.resistance is None or a.kappa is None:
        return None
    return Winding(a.resistance, a.kappa)


def electrical_energy(
    motor: Winding, p: Plant, *, sample_time: float, command: Array, volume: Array, depth: Array
) -> Array:
    """Return the energy into the motor in each sample [J], [samples, runs].

    command [V], volume [m3] and depth [m]: [samples + 1, runs], the command from each sample on.
    The voltage is cut to what the supply gives at the sample's mean rate.
    """
    q = np.diff(volume, axis=0) / sample_time + p.k_l * depth[:-1]
    u = command[:-1]
    most = largest_voltage(
        E=p.supply, sag=p.sag, emf=motor.kappa * q * np.where(u >= 0.0, 1.0, -1.0)
    )
    u = np.clip(u, -most, most)
    i = winding_current(u=u, omega=q, R=motor.R, k_emf=motor.kappa)
    return electrical_power(u=u, i=i) * sample_time


_WALK_EVERY = 10.0  # s, between two steps of a neutral volume that walks
_STILL = 1e-8  # m3, that a motor at rest may creep in a sample
_FIELDS = ("a_b", "a_s", "d_l", "d_b", "d_t", "psi", "gain", "T1")


class Step(NamedTuple):
    """A step of depth and the time it is watched for."""

    start: float  # m
    target: float  # m
    duration: float  # s


class Drawn(NamedTuple):
    """Which vehicles are flown, and in what."""

    runs: int = 200
    region: Region | None = None  # that they are drawn from; None: the nominal one
    supply: float = math.inf  # V; the vehicle's where infinite
    column: Column | None = None  # the water, the vehicle's own where None
    seed: int = 1
    sample_time: float = math.nan  # s, of a law that is called at each sample

    @property
    def nominal(self) -> Drawn:
        """The same of the nominal vehicle, with its own supply."""
        return self._replace(region=None, supply=math.inf)


class Trial(NamedTuple):
    """Percentiles over vehicles and noise; times in s, nan where more than so many never settle."""

    runs: int
    settled: float  # share of the runs that settled within 2 %
    settle_median: float  # s
    settle_95: float  # s
    overshoot_median: float  # -
    overshoot_95: float  # -
    rms: float  # m, of the depth error over the last third
    rate: float  # m3/s, of volume moved over the last third
    starts: float  # 1/s, of the motor from rest, over the last third
    turns: float  # 1/s, of the motor, from one direction into the other, likewise
    energy: float  # J, of the motor in the whole run; nan where its R or k_T is not known
    power: float  # W, of the motor over the last third, likewise


class Traces(NamedTuple):
    """Some runs, to look at: [samples, runs]."""

    time: Array  # s [samples]
    depth: Array  # m
    volume: Array  # m3
    command: Array  # V


def trial(vehicle: Vehicle, law: Law, parameters: Any, step: Step, drawn: Drawn) -> Trial:
    """Return what comes of steps of depth, each with noise of its own."""
    fly = _sampled_trial if law.ways is None else _float_trial
    return fly(vehicle, law, parameters, step, drawn)


def traces(vehicle: Vehicle, law: Law, parameters: Any, step: Step, drawn: Drawn) -> Traces:
    """Return the first runs of a trial as they went."""
    if law.ways is None:
        data = _runs(vehicle, law, parameters, step, drawn)
        return Traces(*(data[name].to_numpy() for name in Traces._fields))
    flown, _ = _flights(vehicle, law, parameters, step, drawn)
    command = np.zeros_like(flown.depth)
    for lane, acts in enumerate(flown.actions):
        at = np.minimum(np.searchsorted(flown.time, acts[:, 0]), len(flown.time) - 1)
        np.add.at(command[:, lane], at, acts[:, 1])
    return Traces(flown.time, flown.depth, flown.volume, command)


def _trial(settle: Array, over: Array, error: Array, **rates: float) -> Trial:
    """Return a trial; settle [runs] in s, inf where never; error [samples, runs] in m, late."""
    return Trial(
        runs=len(settle),
        settled=float(np.isfinite(settle).mean()),
        settle_median=percentile(settle, 50.0),
        settle_95=percentile(settle, 95.0),
        overshoot_median=float(np.percentile(over, 50.0)),
        overshoot_95=float(np.percentile(over, 95.0)),
        rms=float(np.sqrt(np.mean(error**2))),
        **rates,
    )


def _sampled_trial(vehicle: Vehicle, law: Law, parameters: Any, step: Step, drawn: Drawn) -> Trial:
    data, h = _runs(vehicle, law, parameters, step, drawn), drawn.sample_time
    time, depth, volume, command = (data[name].to_numpy() for name in Traces._fields)
    settle = data["settle2"].to_numpy()
    late = time >= time[-1] * 2.0 / 3.0
    motor, energy, power = winding(vehicle), math.nan, math.nan
    if motor is not None:
        p = plant(vehicle)
        joules = electrical_energy(
            motor, p._replace(supply=min(p.supply, drawn.supply)), sample_time=h, command=command,
            volume=volume, depth=depth,
        )  # fmt: skip
        energy = float(joules.sum(axis=0).mean())
        power = float(joules[late[:-1]].mean()) / h
    seconds = float(time[late][-1] - time[late][0])
    return _trial(
        np.where(np.isfinite(settle), settle, np.inf),
        np.nan_to_num(data["overshoot"].to_numpy(), nan=0.0) / 100.0,
        depth[late] - step.target,
        rate=float(np.abs(np.diff(volume[late], axis=0)).sum(axis=0).mean()) / seconds,
        starts=float(motor_starts(volume[late]).mean()) / seconds,
        turns=float(motor_turns(volume[late]).mean()) / seconds,
        energy=energy,
        power=power,
    )


def _runs(vehicle: Vehicle, law: Law, parameters: Any, step: Step, drawn: Drawn) -> xarray.Dataset:
    runs, region, supply, column, seed, h = drawn
    vary: dict[str, Array] = {}
    start_volume = walked = None
    if region is not None:
        walked = random_walk(region.walk, step.duration, sample_time=h, runs=runs, seed=seed)
        medium = medium_of(vehicle, column, reach=max(step.start, step.target))
        vary |= draw(region, runs=runs, seed=seed, medium=medium)
        start_volume = np.full(runs, medium.neutral_volume(step.start))
    if math.isfinite(supply):
        vary["supply"] = np.full(runs, supply)
    return simulate_ensemble(
        vehicle, count=runs, setpoints=[(0.0, step.target)], duration=step.duration,
        start_depth=step.start, start_volume=start_volume, vary=vary, seed=seed, law=law,
        parameters=parameters, sample_time=h, neutral_change=walked, keep="trajectory",
        column=column,
    )  # fmt: skip


def random_walk(
    intensity: float, duration: float, *, sample_time: float, runs: int, seed: int
) -> Array:
    """Return random walks from 0 [samples, runs], in steps every ten seconds.

    intensity [m3/s^0.5], duration [s].
    """
    every = max(round(_WALK_EVERY / sample_time), 1)
    samples = schedule([0.0], duration, sample_time).ticks + 1
    rng = np.random.default_rng([seed, 1])  # a stream of its own
    steps = rng.normal(0.0, intensity * np.sqrt(every * sample_time), (samples // every, runs))
    walk = np.concatenate([np.zeros((1, runs)), np.cumsum(steps, axis=0)])
    return np.asarray(walk[np.arange(samples) // every])


def draw(region: Region, *, runs: int, seed: int, medium: Medium | None = None) -> dict[str, Array]:
    """Return vehicles drawn evenly from among a region's plants and neutral volumes.

    medium: the water that they are in, the vehicle's own where not given. Fields of `Plant`, each
    [runs], as `simulate_ensemble` varies them.
    """
    rng = np.random.default_rng(seed)
    chosen = rng.integers(0, len(region.plants), runs)
    inside = np.sqrt(rng.uniform(size=runs))  # from the middle towards the boundary
    vary = {}
    own = region.plants[0] if medium is None else medium.plant
    for name in _FIELDS:
        if np.isnan(getattr(own, name)):  # of a motor that a pump and valve has not
            continue
        at = Plant._fields.index(name)
        nominal = region.plants[0][at]
        edge = np.array([region.plants[i][at] for i in chosen])
        vary[name] = nominal + inside * (edge - nominal)
        if medium is not None and nominal != 0.0:  # what goes with the density
            vary[name] *= medium.plant[at] / nominal
    for n, name in enumerate(("pump", "valve") if region.drives else ()):
        vary[name] = 1.0 + inside * (np.array([region.drives[i][n] for i in chosen]) - 1.0)
    vary["V_0"] = region.plants[0].V_0 + rng.uniform(-region.neutral, region.neutral, runs)
    return vary


def motor_starts(volume: Array) -> NDArray[np.int64]:
    """Return how often the motor began to move the volume [samples, runs] from rest [runs].

    From rest: after a sample at least in which the volume stayed.
    """
    moving = np.abs(np.diff(volume, axis=0)) > _STILL
    return np.asarray((moving[1:] & ~moving[:-1]).sum(axis=0))


def motor_turns(volume: Array) -> NDArray[np.int64]:
    """Return how often the motor turned from one direction into the other without a rest [runs]."""
    moves = np.diff(volume, axis=0)
    moves = np.where(np.abs(moves) > _STILL, moves, 0.0)
    return np.asarray((moves[1:] * moves[:-1] < 0.0).sum(axis=0))


def percentile(values: Array, share: float) -> float:
    """Return a percentile of values of which some are infinite, by the value above it.

    nan where that value is infinite.
    """
    found = float(np.sort(values)[min(int(np.ceil(share / 100.0 * len(values))), len(values)) - 1])
    return found if np.isfinite(found) else float("nan")


VARIED = ("drag", "psi", "pump", "valve", "V_0")
"""What may differ from flight to flight: factors, but psi [m3/m] and V_0 [m3]."""

_DRAG = ("d_l", "d_b", "d_0", "d_t")
_FINEST = 1e-3  # s, of the times between a law's samples
_LONGEST = 30.0  # s, of a tick: runs of the drive that last longer than a sleep end at one


@dataclass(frozen=True, kw_only=True)
class Asked:
    """Where flights begin, where they are to go, and for how long; numbers or [flights]."""

    targets: ArrayLike  # m; 0: to the surface
    depths: ArrayLike  # m, at the start
    duration: float  # s
    speeds: ArrayLike = 0.0  # m/s, positive down
    volumes: ArrayLike | None = None  # m3, neutral where not given
    tick: float | None = None  # s, of the trajectories; None: what the law's times are made of


@dataclass(frozen=True, kw_only=True)
class Flights:
    """Trajectories on common times [n, flights], and the actions of each flight."""

    time: Array  # s [n]
    depth: Array  # m
    speed: Array  # m/s, positive down
    volume: Array  # m3
    energy: Array  # J of pump and valve [flights]; where it is not known, work on the water
    stopped: NDArray[np.bool_]  # flights that ended early: out of the water, or far too deep
    actions: tuple[Array, ...]  # [actions, 2]: time [s], change asked for [m3]; positive: pumped


def fly_floats(
    vehicle: Vehicle,
    law: Law,
    parameters: Any,
    asked: Asked,
    *,
    vary: Mapping[str, ArrayLike] | None = None,
    column: Column | None = None,
    seed: int | None = None,
) -> Flights:
    """Return the flights that are asked for, under the law with these parameters.

    vary: of `VARIED`. column: the water, the vehicle's own, psi z + trim_error, where not given.
    seed: of the sensors' noise; None: none.
    """
    inputs = (asked.targets, asked.depths, asked.speeds, *(vary or {}).values())
    every = np.broadcast_arrays(*(np.atleast_1d(np.asarray(x, float)) for x in inputs))
    if asked.volumes is not None:
        every = np.broadcast_arrays(*every, np.asarray(asked.volumes, float))
    targets, depths, speeds = every[:3]
    drawn = dict(zip(vary or {}, every[3:], strict=False))
    drag = drawn.pop("drag", None)
    if drag is not None:
        body = body_plant(vehicle)
        drawn |= {name: getattr(body, name) * drag for name in _DRAG}
    if column is None:  # parts of the hull are for the water of a cast
        plain = vehicle.hull.model_copy(update={"parts": (), "trapped_air": 0.0})
        vehicle = vehicle.model_copy(update={"hull": plain})
    data = simulate_ensemble(
        vehicle,
        count=len(targets),
        setpoints=[(0.0, targets)],
        duration=asked.duration,
        start_depth=depths,
        start_speed=speeds,
        start_volume=None if asked.volumes is None else every[-1],
        vary=drawn,
        seed=seed,
        law=law,
        parameters=parameters,
        sample_time=asked.tick or _tick(parameters),
        keep="trajectory",
        column=column,
    )
    time, command = data["time"].to_numpy(), data["command"].to_numpy()
    stopped = data["stop"].to_numpy() != 0
    actions = tuple(np.stack([time[own != 0.0], own[own != 0.0]], axis=1) for own in command.T)
    depth, speed, volume = (data[name].to_numpy() for name in ("depth", "speed", "volume"))
    return Flights(
        time=time,
        depth=depth,
        speed=speed,
        volume=volume,
        energy=data["energy"].to_numpy(),
        stopped=stopped,
        actions=actions,
    )


def _tick(parameters: Any) -> float:
    """Return the longest tick [s] that the times of a law are whole multiples of."""
    times = [round(getattr(parameters, name) / _FINEST) for name in ("dead", "run")]
    whole = math.gcd(*times)
    return _FINEST * whole / math.ceil(whole * _FINEST / _LONGEST)


_SHARE = 0.02  # of the step


def arrival_band(law: Law, parameters: Any, step: Step) -> float:
    """Return how near to its depth a float counts as there [m]."""
    return max(_SHARE * abs(step.target - step.start), float(leaves(parameters)[law.band]))


def draw_floats(vehicle: Vehicle, drawn: Drawn) -> dict[str, Array]:
    """Return floats drawn evenly from among a region's members, as `fly_floats` varies them."""
    region, runs = drawn.region, drawn.runs
    if region is None:
        return {}
    rng = np.random.default_rng(drawn.seed)
    chosen = rng.integers(0, len(region.plants), runs)
    inside = np.sqrt(rng.uniform(size=runs))  # from the middle towards the boundary
    nominal = region.plants[0]
    drags = np.array([_drag(p) / _drag(nominal) for p in region.plants])
    psi = np.array([p.psi for p in region.plants])
    pump, valve = np.array(region.drives).T
    edges = {"drag": drags, "psi": psi, "pump": pump, "valve": valve}
    found = {n: x[0] + inside * (x[chosen] - x[0]) for n, x in edges.items()}
    off = rng.uniform(-region.neutral, region.neutral, runs)
    return found | {"V_0": vehicle.trim_error + off}


def _drag(p: Any) -> float:
    return float(p.d_t if p.d_t > 0.0 else p.d_l)


def _float_trial(vehicle: Vehicle, law: Law, parameters: Any, step: Step, drawn: Drawn) -> Trial:
    """Return what comes of the flights, with settling into the tolerance."""
    flown, targets = _flights(vehicle, law, parameters, step, drawn)
    time, span = flown.time, abs(step.target - step.start)
    error = flown.depth - targets
    band = arrival_band(law, parameters, step)
    outside = ~(np.abs(error) <= band) | flown.stopped
    last = len(time) - np.argmax(outside[::-1], axis=0)
    last[~outside.any(axis=0)] = 0
    settle = np.where(last < len(time), time[np.minimum(last, len(time) - 1)], np.inf)
    beyond = np.where(targets == step.target, 1.0, -1.0) * np.sign(step.target - step.start)
    over = np.maximum(np.nanmax(beyond * error, axis=0) / span, 0.0)
    late = time >= time[-1] * 2.0 / 3.0
    seconds = float(time[late][-1] - time[late][0])
    begin = float(time[late][0])
    since = [a[a[:, 0] >= begin, 1] for a in flown.actions]
    spent = [energy_of(vehicle, flown, lane) for lane in range(drawn.runs)]
    pairs = zip(flown.actions, spent, strict=True)
    shares = np.array([e[a[:, 0] >= begin].sum() / max(e.sum(), 1e-12) for a, e in pairs])
    return _trial(
        settle,
        over,
        error[late],
        rate=float(np.mean([np.abs(a).sum() for a in since])) / seconds,
        starts=float(np.mean([np.sum(a > 0.0) for a in since])) / seconds,
        turns=float(np.mean([np.sum(a < 0.0) for a in since])) / seconds,
        energy=float(np.mean(flown.energy)),
        power=float(np.mean(flown.energy * shares)) / seconds,
    )


def energy_of(vehicle: Vehicle, flown: Flights, lane: int) -> Array:
    """Return the energy of each action of a flight [J], by the drive at the depth of its begin."""
    times, changes = flown.actions[lane].T
    depth = np.interp(times, flown.time, flown.depth[:, lane])
    d = drive_map(vehicle, vehicle.water.specific_weight * np.maximum(depth, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        pumped = (changes + d.start_volume) / d.rate_out * d.power_out
        let_in = -changes / d.rate_in * d.power_in
    return np.asarray(np.nan_to_num(np.where(changes > 0.0, pumped, let_in)))


def _flights(
    vehicle: Vehicle, law: Law, parameters: Any, step: Step, drawn: Drawn
) -> tuple[Flights, Array]:
    column = drawn.column
    down = np.arange(drawn.runs) % 2 == 0
    targets, depths = np.where([down, ~down], step.target, step.start)
    medium = medium_of(vehicle, column, reach=max(step.start, step.target))
    ballasted = np.where(
        down, medium.neutral_volume(step.start), medium.neutral_volume(step.target)
    )
    asked = Asked(targets=targets, depths=depths, duration=step.duration, volumes=ballasted)
    vary = draw_floats(vehicle, drawn)
    low = with_supply(vehicle, drawn.supply)
    return fly_floats(
        low, law, parameters, asked, vary=vary, column=column, seed=drawn.seed
    ), targets
