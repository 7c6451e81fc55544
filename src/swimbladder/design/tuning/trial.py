"""What a law does with vehicles of the region: a step of depth, then holding it, with noise.

Electrical energy of trials, from samples: exact for a voltage that is held between them.

A winding takes u (u - kappa q)/R. With u held over a sample, the integral of q is the volume that
was pumped, so that no more than the samples is needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Law
from swimbladder.design.tuning.region import Region
from swimbladder.physics.actuator import reduced
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.physics.electric import electrical_power, largest_voltage, winding_current
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


def trial(
    vehicle: Vehicle, law: Law, parameters: Any, step: Step, *, sample_time: float,
    region: Region | None = None, runs: int = 200, seed: int = 1, supply: float | None = None,
    column: Column | None = None,
) -> Trial:  # fmt: skip
    """Return what comes of `runs` steps, each with noise of its own.

    region: of vehicles drawn evenly from among its plants and neutral volumes; the nominal one
    where not given. supply [V]: the vehicle's where not given. column: the water, the vehicle's own
    where not given.
    """
    data = _runs(
        vehicle, law, parameters, step, sample_time=sample_time, region=region, runs=runs,
        seed=seed, supply=supply, column=column,
    )  # fmt: skip
    settle = data["settle2"].to_numpy()
    settled = np.isfinite(settle)
    time = data["time"].to_numpy()
    depth, volume = data["depth"].to_numpy(), data["volume"].to_numpy()
    late = time >= time[-1] * 2.0 / 3.0
    motor, energy, power = winding(vehicle), float("nan"), float("nan")
    if motor is not None:
        p = plant(vehicle)
        joules = electrical_energy(
            motor, p if supply is None else p._replace(supply=supply), sample_time=sample_time,
            command=data["command"].to_numpy(), volume=volume, depth=depth,
        )  # fmt: skip
        energy = float(joules.sum(axis=0).mean())
        power = float(joules[late[:-1]].mean()) / sample_time
    moves = np.abs(np.diff(volume[late], axis=0))
    seconds = float(time[late][-1] - time[late][0])
    never = np.where(settled, settle, np.inf)
    over = np.nan_to_num(data["overshoot"].to_numpy(), nan=0.0) / 100.0
    return Trial(
        runs=runs,
        settled=float(settled.mean()),
        settle_median=percentile(never, 50.0),
        settle_95=percentile(never, 95.0),
        overshoot_median=float(np.percentile(over, 50.0)),
        overshoot_95=float(np.percentile(over, 95.0)),
        rms=float(np.sqrt(np.mean((depth[late] - step.target) ** 2))),
        rate=float(moves.sum(axis=0).mean()) / seconds,
        starts=float(motor_starts(volume[late]).mean()) / seconds,
        turns=float(motor_turns(volume[late]).mean()) / seconds,
        energy=energy,
        power=power,
    )


def traces(
    vehicle: Vehicle, law: Law, parameters: Any, step: Step, *, sample_time: float,
    region: Region | None, runs: int, supply: float | None, seed: int = 1,
    column: Column | None = None,
) -> Traces:  # fmt: skip
    """Return the first runs of a trial as they went."""
    data = _runs(
        vehicle, law, parameters, step, sample_time=sample_time, region=region, runs=runs,
        seed=seed, supply=supply, column=column,
    )  # fmt: skip
    return Traces(*(data[name].to_numpy() for name in ("time", "depth", "volume", "command")))


def _runs(
    vehicle: Vehicle, law: Law, parameters: Any, step: Step, *, sample_time: float,
    region: Region | None, runs: int, seed: int, supply: float | None, column: Column | None,
) -> xarray.Dataset:  # fmt: skip
    vary: dict[str, Array] = {}
    start_volume = walked = None
    if region is not None:
        walked = random_walk(
            region.walk, step.duration, sample_time=sample_time, runs=runs, seed=seed
        )
        medium = medium_of(vehicle, column, reach=max(step.start, step.target))
        vary |= draw(region, runs=runs, seed=seed, medium=medium)
        start_volume = np.full(runs, medium.neutral_volume(step.start))
    if supply is not None and np.isfinite(supply):
        vary["supply"] = np.full(runs, supply)
    return simulate_ensemble(
        vehicle, count=runs, setpoints=[(0.0, step.target)], duration=step.duration,
        start_depth=step.start, start_volume=start_volume, vary=vary, seed=seed, law=law,
        parameters=parameters, sample_time=sample_time, neutral_change=walked, keep="trajectory",
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
    found: Array = walk[np.arange(samples) // every]
    return found


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
    found: NDArray[np.int64] = (moving[1:] & ~moving[:-1]).sum(axis=0)
    return found


def motor_turns(volume: Array) -> NDArray[np.int64]:
    """Return how often the motor turned from one direction into the other without a rest [runs]."""
    moves = np.diff(volume, axis=0)
    moves = np.where(np.abs(moves) > _STILL, moves, 0.0)
    found: NDArray[np.int64] = (moves[1:] * moves[:-1] < 0.0).sum(axis=0)
    return found


def percentile(values: Array, share: float) -> float:
    """Return a percentile of values of which some are infinite, by the value above it.

    nan where that value is infinite.
    """
    found = float(np.sort(values)[min(int(np.ceil(share / 100.0 * len(values))), len(values)) - 1])
    return found if np.isfinite(found) else float("nan")
