"""What a law does with vehicles of the region: a step of depth, then holding it, with noise.

The electrical energy of a motor is from samples: a winding takes u (u - kappa q)/R, and with u held
over a sample, the integral of q is the volume that was pumped; a positioner takes one power while
it moves and one at rest.

Floats under a law of volume changes go there and back, then hold: half of the flights go down a
step, the other half up it, so that what is said of a range of depths is of both ways. A flight has
arrived for good when it is last outside the tolerance, or 2 % of the step where that is more.
Energy is that of pump and valve from the battery's cells.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.control.law import leaves, smooth
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.tuning.region import Region
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.buoyancy_engine import at_voltage, drive_map, winding
from swimbladder.physics.dynamics import plant
from swimbladder.physics.electric import electrical_power, largest_voltage, winding_current
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop import simulate_ensemble
from swimbladder.sim.closed_loop.block import schedule
from swimbladder.sim.closed_loop.floats import surface_zone
from swimbladder.sim.closed_loop.water import SEAS, Medium, depth_error, medium_of
from swimbladder.vehicle import Positioner, Vehicle


def electrical_energy(vehicle: Vehicle, runs: Runs, *, supply: Any, sample_time: float) -> Array:
    """Return the energy into the motor in each sample [J], [samples, runs]; nan: not known.

    runs: with the command from each sample on. A voltage is cut to what the supply [V] gives at the
    sample's mean rate.
    """
    q, p, a = np.diff(runs.volume, axis=0) / sample_time, plant(vehicle), vehicle.engine
    if isinstance(a, Positioner):
        moving = np.nan if a.moving_power is None else a.moving_power - a.holding_power
        return sample_time * (moving * np.abs(q) / p.rate + a.holding_power)
    if (motor := winding(vehicle)) is None:
        return np.full_like(q, np.nan)
    q, u = q + p.k_l * runs.depth[:-1], runs.command[:-1]
    emf = motor.kappa * q * np.where(u >= 0.0, 1.0, -1.0)
    most = largest_voltage(E=supply, sag=p.sag, emf=emf)
    u = np.clip(u, -most, most)
    i = winding_current(u=u, omega=q, R=motor.R, k_emf=motor.kappa)
    return electrical_power(u=u, i=i) * sample_time


_RANDOM_WALK_STEP = 10.0  # s, between two steps of the neutral volume's random walk
_STILL = 1e-8  # m3, that a motor at rest may creep in a sample
_FIELDS = ("a_b", "a_s", "d_l", "d_b", "d_0", "d_t", "psi", "gain", "T1")
_FINEST = 1e-3  # s, of the times between a law's samples
_LONGEST = 30.0  # s, of a tick: runs of the drive that last longer than a sleep end at one
_SHARE = 0.02  # of the step
_USUAL = 1.5  # m, of a step
_BEFORE = 120.0, 400  # s and samples, in which a supervisor gets to know the vehicle before a step
_OFF_RUNS = 20  # with the ballast off, half of them to either side
HALF_HOUR, _IN_WAVES = 1800.0, 10  # s, runs in each sea
BOARD = (
    "law, seconds of pump and valve, and supervisor fly together, as `firmware` writes them, for "
    "the pump of a full battery; only which gains come so far is of the law alone"
)
ALONE = "the law flies alone, without the supervisor that `firmware` writes beside it"
SUPERVISED = (
    "the law flies under the vehicle's supervisor, as `firmware` writes both; a step comes after "
    "two minutes at rest, or 400 samples where these are longer"
)


class Step(NamedTuple):
    """A step of depth and the time it is watched for."""

    start: float  # m
    target: float  # m
    duration: float  # s


def usual_step(low: float, high: float) -> tuple[float, float]:
    """Return a step of 1.5 m, near the least of the depths [m], where the range has room."""
    start = low + min(_USUAL, 0.3 * (high - low))
    return start, min(start + _USUAL, high)


class Drawn(NamedTuple):
    """Which vehicles are flown, and in what."""

    runs: int = 200
    region: Region | None = None  # that they are drawn from; None: the nominal one
    supply: float = math.inf  # V; the vehicle's where infinite
    column: Column | None = None  # the water, the vehicle's own where None
    seed: int = 1
    supervised: bool = False  # as `firmware` writes law and supervisor
    known: frozenset[str] = frozenset()  # fields of `Plant` that are not drawn; friction: none
    ballast: float = 0.0  # m3, by which every other neutral volume is off to either side
    tick: float = math.nan  # s, of the board of a supervised float

    @property
    def nominal(self) -> Drawn:
        """The same of the nominal vehicle, with its own supply."""
        return self._replace(region=None, supply=math.inf)


class Runs(NamedTuple):
    """Runs as they went [samples, runs], and what the simulation says of each [runs]."""

    time: Array  # s [samples]
    depth: Array  # m
    speed: Array  # m/s, positive down
    volume: Array  # m3
    command: Array  # V, m3; of a law of volume changes the change that it asks for there, or s
    target: Array  # m
    settle: Array  # s, to 2 % for good; nan: never
    overshoot: Array  # -, of the step
    energy: Array  # J; work on the water of a float of unknown power; nan where not asked for
    drive_runs: Array  # of pump and valve; nan of a motor
    stopped: Flags  # ended early: out of the water, or far too deep
    alarm: NDArray[np.int64]  # number of the supervisor's reason to take over; 0: none
    seconds: bool = False  # whether the command is of a float's board: of this tick, + the pump

    @property
    def actions(self) -> list[Array]:
        """Times [s] of changes of volume and how large they are [m3], each [actions, 2].

        That is what a law asks for, of a board what a run over several ticks has changed.
        """
        if self.seconds:
            return [*map(self._runs_of, range(self.command.shape[1]))]
        acts = [(own != 0.0, own) for own in self.command.T]
        return [np.stack([self.time[some], own[some]], axis=1) for some, own in acts]

    def _runs_of(self, lane: int) -> Array:
        way = np.sign(np.nan_to_num(self.command[:-1, lane]))
        turns = np.flatnonzero(np.diff(way, prepend=0.0, append=0.0))
        begin, end = turns[:-1], turns[1:]
        moving = way[begin] != 0.0
        begin, end = begin[moving], end[moving]
        moved = np.abs(self.volume[end, lane] - self.volume[begin, lane])
        return np.stack([self.time[begin], way[begin] * moved], axis=1)


def fly(
    vehicle: Vehicle,
    bound: BoundLaw,
    *,
    target: ArrayLike,
    duration: float,
    before: float | None = None,
    supervised: bool = False,
    tick: float = math.nan,
    **given: Any,
) -> Runs:
    """Return runs to a depth `target` [m] under a law with these parameters.

    target: of a float 0 is the surface. duration [s]. before [s]: for so long they hold the depth
    where they start, under the vehicle's supervisor, and then go on under it. supervised: whether
    they fly under it all the same where before is not given; else the law flies alone. What is
    returned begins as the target is given. Without a sample time the vehicle's own water acts by
    psi alone; tick [s]: that of its board, which is in the place of one. given: arguments of
    `simulate_ensemble`; there are as many runs as `count` says, or as one of the numbers has.
    """
    supervised = supervised or before is not None
    many = (target, *given.get("vary", {}).values())
    many += tuple(given[name] for name in given if name.startswith("start_"))
    law, parameters, sample_time = bound
    if math.isnan(sample_time):
        sample_time = tick if supervised else _tick(parameters)
        if given.get("cast") is None:
            vehicle = vehicle.but("hull", parts=(), trapped_air=0.0)
    held = [] if before is None else [(0.0, given["start_depth"])]
    data = simulate_ensemble(
        vehicle,
        setpoints=[*held, (before or 0.0, target)],
        duration=duration + (before or 0.0),
        law=law,
        parameters=parameters,
        keep="trajectory",
        sample_time=sample_time,
        supervised=supervised,
        **given | {"count": max(given.get("count", 1), *map(np.size, many))},
    )
    known = {str(name): values.to_numpy() for name, values in data.variables.items()}
    first = int(np.searchsorted(known["time"], (before or 0.0) - 0.5 * sample_time))
    unknown = np.full(data.sizes["lane"], math.nan)
    drive_runs = known["pump_runs"] + known["valve_runs"] if "pump_runs" in known else unknown
    return Runs(
        time=known["time"][first:] - known["time"][first],
        **{name: known[name][first:] for name in ("depth", "speed", "volume", "command")},
        target=np.broadcast_to(np.asarray(target, float), unknown.shape),
        settle=known["settle2"],
        overshoot=known["overshoot"] / 100.0,
        energy=known.get("energy", unknown),
        drive_runs=drive_runs,
        stopped=known["stop"] != 0,
        alarm=known.get("alarm", np.zeros(len(unknown), np.int64)),
        seconds=supervised and vehicle.command == "volume change",
    )


def _tick(parameters: Any) -> float:
    """Return the longest tick [s] that the times of a law are whole multiples of."""
    times = [round(getattr(parameters, name) / _FINEST) for name in ("dead", "run")]
    whole = math.gcd(*times)
    return _FINEST * whole / math.ceil(whole * _FINEST / _LONGEST)


def held_before(sample_time: float) -> float:
    """Return how long [s] a supervised run holds its depth before what is asked of it."""
    return max(math.ceil(_BEFORE[0] / sample_time), _BEFORE[1]) * sample_time


def sample_times(duration: float, sample_time: float) -> Array:
    """Return the times of the samples of a run [s]."""
    count = schedule([0.0], duration, sample_time).ticks + 1
    return sample_time * np.arange(count, dtype=np.float64)


def traces(vehicle: Vehicle, bound: BoundLaw, step: Step, drawn: Drawn) -> Runs:
    """Return the runs of a trial as they went."""
    runs, region, supply, column, seed, supervised = drawn[:6]
    medium = medium_of(vehicle, column, reach=max(step.start, step.target))
    vary = {} if region is None else draw(region, runs=runs, seed=seed, medium=medium)
    vary = {name: values for name, values in vary.items() if name not in drawn.known}
    if "friction" in drawn.known:
        own = plant(vehicle).load_drive
        vary |= {"friction": np.zeros(runs), "load_back": np.full(runs, own)}
        bound = bound._replace(parameters=smooth(bound.law, bound.parameters))
    if drawn.ballast:
        off = np.where(np.arange(runs) % 2 == 0, drawn.ballast, -drawn.ballast)
        vary["V_0"] = vary.get("V_0", medium.plant.V_0) + off
    given: dict[str, Any] = {"target": step.target, "start_depth": step.start}
    duration, before = step.duration, None
    if supervised and bound.law.ways is None:
        before = held_before(bound.sample_time)
        duration += before
    if bound.law.ways is None:
        given["start_volume"] = medium.neutral_volume(step.start)
        if math.isfinite(supply):
            vary["supply"] = supplies(vehicle, drawn)
        if region is not None and "V_0" not in drawn.known:
            h = bound.sample_time
            given["neutral_change"] = random_walk(
                region.random_walk, duration, drawn, sample_time=h
            )
    else:
        given["flashed"], vehicle = vehicle, at_voltage(vehicle, supply)
        down = np.arange(runs) % 2 == 0
        begins = np.array([_begin(vehicle, medium, z) for z in (step.start, step.target)])
        given["target"] = np.where(down, step.target, step.start)
        given["start_depth"], given["start_volume"] = np.where(down[:, None], *begins).T
        given |= {"supervised": supervised, "tick": drawn.tick}
    given |= {"vary": vary, "seed": seed, "cast": column, "count": runs}
    return fly(vehicle, bound, duration=step.duration, before=before, **given)


def _begin(vehicle: Vehicle, medium: Medium, depth: float) -> tuple[float, float]:
    """Return depth [m] and volume [m3] with which a float begins: afloat where it comes up.

    Nowhere else is its volume known to its board, which takes it for all out up there.
    """
    if depth <= surface_zone(vehicle.hull):
        return 0.0, vehicle.stroke.maximum
    return depth, medium.neutral_volume(depth)


def supplies(vehicle: Vehicle, drawn: Drawn) -> Array:
    """Return the supply [V] of each run: the least of every other pair, else the vehicle's own."""
    own = plant(vehicle).supply
    return np.where(np.arange(drawn.runs) // 2 % 2 == 0, min(drawn.supply, own), own)


def random_walk(intensity: float, duration: float, drawn: Drawn, *, sample_time: float) -> Array:
    """Return random walks from 0 [samples, runs], in steps every ten seconds.

    intensity [m3/s^0.5], duration and sample time [s].
    """
    every = max(round(_RANDOM_WALK_STEP / sample_time), 1)
    samples = len(sample_times(duration, sample_time))
    rng = np.random.default_rng([drawn.seed, 1])  # a stream of its own
    size = (samples // every, drawn.runs)
    steps = rng.normal(0.0, intensity * np.sqrt(every * sample_time), size)
    path = np.concatenate([np.zeros((1, drawn.runs)), np.cumsum(steps, axis=0)])
    return np.asarray(path[np.arange(samples) // every])


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
        edge = np.array([getattr(p, name) for p in region.plants])
        vary[name] = edge[0] + inside * (edge[chosen] - edge[0])
        if medium is not None and edge[0] != 0.0:  # what goes with the density
            vary[name] *= getattr(own, name) / edge[0]
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


def arrivals(time: Array, outside: Flags) -> Array:
    """Return since when runs stay inside [s], inf where never; outside [samples, runs]."""
    last = len(time) - np.argmax(outside[::-1], axis=0)
    last[~outside.any(axis=0)] = 0
    return np.asarray(np.append(time, np.inf)[last])


class Measured(NamedTuple):
    """What was measured in each run [runs]."""

    settle: Array  # s, to stay; not finite: never
    overshoot: Array  # -, of the step
    square: Array  # m2, mean squared depth error while it counts
    farthest: Array  # m, largest depth error while it counts
    rate: Array  # m3/s, of volume moved to and fro while it counts
    starts: Array  # 1/s, of the motor from rest while it counts
    turns: Array  # 1/s, of the motor, from one direction into the other
    energy: Array  # J, electrical, of the whole run; nan where it is not known
    power: Array  # W, electrical, mean of the whole run, likewise
    lost: Array  # the run ended before its time
    alarms: Array  # the supervisor took over


def measure(runs: Runs, since: float) -> Measured:
    """Return the figures of runs; since [s]: from when on errors, volumes and starts count."""
    late = runs.time >= since
    error, volume = runs.depth[late] - runs.target, runs.volume[late]
    seconds = float(np.ptp(runs.time[late]))
    return Measured(
        settle=runs.settle,
        overshoot=runs.overshoot,
        square=np.mean(error**2, axis=0),
        farthest=np.abs(error).max(axis=0),
        rate=np.abs(np.diff(volume, axis=0)).sum(axis=0) / seconds,
        starts=motor_starts(volume) / seconds,
        turns=motor_turns(volume) / seconds,
        energy=runs.energy,
        power=runs.energy / float(runs.time[-1]),
        lost=runs.stopped.astype(float),
        alarms=(runs.alarm > 0).astype(float),
    )


class Trial(NamedTuple):
    """Percentiles and means over runs; times in s, nan where more than so many never settle."""

    runs: int
    settled: float  # share of the runs that settled within 2 %
    settle_median: float  # s
    settle_95: float  # s
    overshoot_median: float  # -
    overshoot_95: float  # -
    rms: float  # m, of the depth error while it counts
    rate: float  # m3/s, of volume moved, likewise
    starts: float  # 1/s, of the motor from rest, likewise; of a float those of the pump
    turns: float  # 1/s, of the motor, from one direction into the other; of a float of the valve
    energy: float  # J, of the motor in the whole run; nan where its power is not known
    power: float  # W, of the motor, likewise
    farthest: float = math.nan  # m, largest depth error of any run
    lost: float = math.nan  # share of the runs
    alarms: float = math.nan  # share of the runs in which the supervisor took over
    ballast: float = math.nan  # s, in which all runs settle whose ballast is off
    slowest: float = math.nan  # s, in which all runs settle

    @property
    def starts_and_turns(self) -> float:
        """How often the motor begins to turn, from rest or from the other direction [1/s]."""
        return self.starts + self.turns


def summarise(m: Measured) -> Trial:
    """Return medians, percentiles, means and worst cases over the runs."""
    settle = np.where(np.isfinite(m.settle), m.settle, np.inf)
    over = np.nan_to_num(m.overshoot, nan=0.0)
    mean = {name: float(getattr(m, name).mean()) for name in Measured._fields[4:]}
    return Trial(
        runs=len(settle),
        settled=float(np.isfinite(settle).mean()),
        settle_median=percentile(settle, 50.0),
        settle_95=percentile(settle, 95.0),
        slowest=percentile(settle, 100.0),
        overshoot_median=float(np.percentile(over, 50.0)),
        overshoot_95=float(np.percentile(over, 95.0)),
        rms=math.sqrt(float(m.square.mean())),
        farthest=float(m.farthest.max()),
        **mean,
    )


def settling_off_ballast(vehicle: Vehicle, bound: BoundLaw, step: Step, drawn: Drawn) -> float:
    """Return the time [s] in which all runs of the nominal vehicle settle with its ballast off.

    drawn: by how much. nan: one never does.
    """
    off = drawn._replace(region=None, runs=_OFF_RUNS)
    return percentile(measure(traces(vehicle, bound, step, off), 0.0).settle, 100.0)


def alarms_in_waves(vehicle: Vehicle, bound: BoundLaw, depth: float, drawn: Drawn) -> float:
    """Return the share of half hours at a depth [m] in which waves alarm the supervisor.

    The seas of `swell.SEAS`, half of the runs in each; the nominal vehicle, held at the depth.
    """
    h, found = bound.sample_time, []
    medium = medium_of(vehicle, drawn.column, reach=depth)
    before = held_before(h)
    time = sample_times(HALF_HOUR + before, h)
    for sea in SEAS:
        waves = depth_error(sea, vehicle, time, depth=depth, runs=_IN_WAVES, seed=drawn.seed)
        runs = fly(
            vehicle,
            bound,
            target=depth,
            duration=HALF_HOUR,
            before=before,
            count=_IN_WAVES,
            start_depth=depth,
            start_volume=medium.neutral_volume(depth),
            seed=drawn.seed,
            cast=drawn.column,
            depth_error=waves,
        )
        found.append(float((runs.alarm > 0).mean()))
    return float(np.mean(found))


def arrival_band(bound: BoundLaw, step: Step) -> float:
    """Return how near to its depth a float counts as there [m]."""
    band = float(leaves(bound.parameters)[bound.law.band])
    return max(_SHARE * abs(step.target - step.start), band)


def trial(vehicle: Vehicle, bound: BoundLaw, step: Step, drawn: Drawn) -> Trial:
    """Return what comes of steps of depth, each with noise of its own; its last third counts."""
    runs = traces(vehicle, bound, step, drawn)
    time, since = runs.time, float(runs.time[-1]) * 2.0 / 3.0
    found = measure(runs, since)
    if bound.law.ways is not None:
        band = arrival_band(bound, step)
        return summarise(_of_floats(vehicle, found, runs, step, since, band))
    h, supply = bound.sample_time, supplies(vehicle, drawn)
    joules = electrical_energy(vehicle, runs, supply=supply, sample_time=h)
    late = joules[(time >= since)[:-1]]
    return summarise(found._replace(energy=joules.sum(axis=0), power=late.mean(axis=0) / h))


def _of_floats(
    vehicle: Vehicle, found: Measured, runs: Runs, step: Step, since: float, band: float
) -> Measured:
    """Return what was measured with settling into the band [m], and with what the drive did."""
    error = runs.depth - runs.target
    beyond = np.where(runs.target == step.target, 1.0, -1.0) * np.sign(step.target - step.start)
    seconds = float(np.ptp(runs.time[runs.time >= since]))
    counts = np.zeros((4, len(runs.target)))  # volume, pumped, let in, share of the energy
    for k, acts in enumerate(runs.actions):
        late, spent = acts[:, 0] >= since, energy_of(vehicle, runs, k)
        changes = acts[late, 1]
        share = spent[late].sum() / max(spent.sum(), 1e-12)
        counts[:, k] = np.abs(changes).sum(), np.sum(changes > 0.0), np.sum(changes < 0.0), share
    rate, starts, turns, share = counts / seconds
    settle = arrivals(runs.time, ~(np.abs(error) <= band) | runs.stopped)
    over = np.nanmax(beyond * error, axis=0) / abs(step.target - step.start)
    found = found._replace(settle=settle, overshoot=np.maximum(over, 0.0))
    return found._replace(rate=rate, starts=starts, turns=turns, power=runs.energy * share)


def energy_of(vehicle: Vehicle, runs: Runs, lane: int) -> Array:
    """Return the energy of each action of a flight [J], by the drive at the depth of its begin."""
    times, changes = runs.actions[lane].T
    depth = np.interp(times, runs.time, runs.depth[:, lane])
    d = drive_map(vehicle, vehicle.water.specific_weight * np.maximum(depth, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        pumped = (changes + d.start_volume) / d.rate_out * d.power_out
        let_in = -changes / d.rate_in * d.power_in
    return np.asarray(np.nan_to_num(np.where(changes > 0.0, pumped, let_in)))
