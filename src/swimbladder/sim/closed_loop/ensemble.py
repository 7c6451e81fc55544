"""Thousands of vehicles in one call: any parameter, any start and any noise, lane by lane.

What it is given holds for all lanes or lane by lane, and is checked.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.control.law import Law, leaves
from swimbladder.control.supervisor import Reason
from swimbladder.errors import InputError, check_counts
from swimbladder.io.netcdf import Variable, cf_dataset, described, meaning
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop.block import Block, schedule, work_space
from swimbladder.sim.closed_loop.checks import check_dive, check_sample_time
from swimbladder.sim.closed_loop.floats import RATES, FloatModel, float_model, flown_law
from swimbladder.sim.closed_loop.lane import RECORDED, Row
from swimbladder.sim.closed_loop.lanes import Schedule
from swimbladder.sim.closed_loop.single import check_setpoints, choose_law
from swimbladder.sim.closed_loop.solution import (
    VARIABLES,
    StopReason,
    close_balance,
    time_of_run,
)
from swimbladder.sim.closed_loop.supervision import Supervision
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.sim.engine.chain import base_steps
from swimbladder.sim.engine.rodas.records import Account as FloatAccount
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.schema import check_choice, no_such

if TYPE_CHECKING:
    import xarray


def vary_plants(
    p: Plant, numbers: Any, vary: Mapping[str, ArrayLike], count: int
) -> tuple[Array, dict[str, Array]]:
    """Return plants [len(Plant), count] and the law's parameters by name, each [count].

    Raises InputError for a name that neither has, or a mass or time constant that cannot be.
    """
    plants = np.repeat(np.array(p)[:, None], count, axis=1)
    values = {name: np.full(count, float(value)) for name, value in leaves(numbers).items()}
    for name, given in vary.items():
        array = spread(given, count, f"vary[{name!r}]", "")
        if name in Plant._fields and not np.isnan(getattr(p, name)):
            plants[Plant._fields.index(name)] = array
        elif name in values:
            values[name] = array
        else:
            own = [field for field in Plant._fields if not np.isnan(getattr(p, field))]
            what = "neither the plant nor the law has such a parameter"
            raise no_such(what, name, (*own, *values), field=f"vary[{name!r}]")
    for name in ("T1", "a_b", "a_s"):
        least = plants[Plant._fields.index(name)].min()
        if least <= 0.0:
            raise InputError(
                "must be above 0 in every lane", field=f"vary[{name!r}]", value=float(least)
            )
    return plants, values


def spread(given: ArrayLike, count: int, field: str, unit: str) -> Array:
    """Return a number or an array as [count]; raises InputError where it is neither."""
    array = np.asarray(given, float)
    if array.shape not in ((), (count,)):
        what = f"has the shape {array.shape}, not ({count},)"
        remedy = "Give one number, or one for each lane"
        raise InputError(what, field=field, unit=unit or None, remedy=remedy)
    if np.isnan(array).any():
        raise InputError("holds a value that is not a number", field=field, unit=unit or None)
    return np.broadcast_to(array, (count,)).copy()


def series(given: ArrayLike, clock: Schedule, count: int, field: str, unit: str) -> Array:
    """Return what was given for every sample as [ticks + 1, count].

    Raises InputError for another shape, or for a value that is no finite number.
    """
    array = np.asarray(given, float)
    samples = clock.ticks + 1
    if array.shape not in ((samples, count), (samples, 1)):
        what = f"has the shape {array.shape}, not ({samples}, {count}) or ({samples}, 1)"
        remedy = "Give a row for each sample, both ends included"
        raise InputError(what, field=field, unit=unit, remedy=remedy)
    if not np.isfinite(array).all():
        raise InputError("holds a value that is no finite number", field=field, unit=unit)
    return np.broadcast_to(array, (samples, count))


def check_starts(lanes: Plant, z: Array, V: Array) -> None:
    """Raise InputError for the first lane that cannot start where it should."""
    for name, values, bad, why in (
        ("start_depth", z, z > lanes.z_bottom, "is below the bottom"),
        ("start_depth", z, z <= lanes.z_air, "is outside the water"),
        ("start_volume", V, lanes.V_max < V, "is beyond the stroke's maximum"),
        ("start_volume", V, lanes.V_min > V, "is beyond the stroke's minimum"),
    ):
        if np.any(bad):
            lane = int(np.argmax(bad))
            raise InputError(
                f"lane {lane} of {len(z)} {why}",
                field=name,
                value=float(values[lane]),
                unit="m" if values is z else "m3",
                remedy="Start within the water and the stroke",
            )


_STATE = slice(int(Row.Q), int(Row.Q) + 4)
BLOCK = 40  # lanes that run together: few enough for the first-level cache, no power of 2

_SUMMARIES = {  # of a lane: row, unit, what it is
    "final_depth": (Row.Z, "m", "depth at the end"),
    "final_speed": (Row.W, "m s-1", "speed at the end, positive down"),
    "final_volume": (Row.V, "m3", "volume at the end"),
    "least_depth": (Row.Z_LOWEST, "m", "least depth at a sample"),
    "greatest_depth": (Row.Z_HIGHEST, "m", "greatest depth at a sample"),
    "least_volume": (Row.V_LOWEST, "m3", "least volume at a sample"),
    "greatest_volume": (Row.V_HIGHEST, "m3", "greatest volume at a sample"),
    "actuator_travel": (Row.TRAVEL, "m3", "volume moved to and fro"),
}
_OF_DRIVE = {  # of a float: account, unit, what it is
    "pump_runs": (FloatAccount.PUMP_RUNS, "1", "runs of the pump"),
    "valve_runs": (FloatAccount.VALVE_RUNS, "1", "runs of valve and bypass"),
    "pumped": (FloatAccount.PUMPED, "m3", "volume pressed out"),
}
_TRAJECTORIES = {name: VARIABLES[name] for name in ("depth", "speed", "volume")}
_TRAJECTORIES["command"] = meaning("", "command of the law")
_STOPS = " ".join(reason.name.lower() for reason in StopReason)
_ALARMS = " ".join(["none", *(reason.name.lower() for reason in Reason)])


def simulate_ensemble(
    vehicle: Vehicle,
    *,
    count: int,
    setpoints: Sequence[tuple[float, ArrayLike]],
    duration: float,
    start_depth: ArrayLike,
    start_volume: ArrayLike | None = None,
    start_speed: ArrayLike = 0.0,
    bottom_depth: float = math.inf,
    vary: Mapping[str, ArrayLike] | None = None,
    seed: int | None = None,
    law: Law | None = None,
    parameters: Any = None,
    sample_time: float | None = None,
    depth_error: ArrayLike | None = None,
    neutral_change: ArrayLike | None = None,
    keep: Literal["summary", "trajectory"] = "summary",
    balance: bool = False,
    cast: Column | None = None,
    supervised: bool | None = None,
    flashed: Vehicle | None = None,
    workers: int | None = None,
    advance: Advance = silent,
) -> xarray.Dataset:
    """Simulate a vehicle and its variations; return the runs as an xarray Dataset over ``lane``.

    A float with pump and valve is flown by a law of volume changes, and surfaces where a set-point
    is 0; start_depth 0 is afloat with all volume out. ``vary`` takes the fields of Plant that are
    not of a motor, and ``pump`` and ``valve``: what these give over what the processor takes them
    to. Of such a float the dataset has ``pump_runs``, ``valve_runs``, ``pumped`` and ``energy`` as
    well. A lane's steps are as long as its motion lets: an hour costs about 1 ms.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    count
        How many runs, 1 or more.
    setpoints
        (time [s], depth [m] or depths [count]), the first at 0, in the order of their times.
    duration
        How long each run goes on [s], rounded up to whole samples.
    start_depth
        Depth at the start [m], a number or an array [count].
    start_volume
        Volume at the start [m3], a number or an array [count]; none: neutral.
    start_speed
        Speed at the start [m/s], positive down, a number or an array [count].
    bottom_depth
        Depth of the bottom [m]; infinite: there is none.
    vary
        Name -> array [count]: a field of `dynamics.Plant` (``"a_b"``, ``"T1"``, ``"psi"``, ...) or
        of the law's parameters (``"k_pz"``); none: all runs have the same.
    seed
        Of the noise of the vehicle's sensors, a stream of its own for each lane; none: ideal
        sensors.
    law
        A Law; none: the vehicle's own controller.
    parameters
        Of a Law that is given.
    sample_time
        Of the law [s]; none: that of the vehicle's controller.
    depth_error
        Array [samples, count] or [samples, 1] of what is added to the measured depth, before its
        quantum [m]; none: nothing.
    neutral_change
        What the neutral volume differs by, from a sample on to the next [m3], shaped likewise;
        none: nothing.
    keep
        "summary": summaries only, or "trajectory": trajectories as well.
    balance
        Whether there is also ``energy``, what `RunBalance` calls the source.
    cast
        The water, as `read_cast` or `cast_column` returns it; none: the vehicle's own.
    supervised
        As of `simulate`; the supervisor is the vehicle's in every lane. None: where its file has
        one.
    flashed
        The vehicle that the supervisor and its board are made for, where that is another (of a full
        battery); none: the same.
    workers
        Threads; none: one per core.
    advance
        Called with the share of the lanes that was done since.

    Returns
    -------
    xarray.Dataset
        ``stop`` holds the code of each lane's StopReason; under a supervisor ``alarm`` and
        ``alarm_time`` say why and when it took over (0 and NaN: it did not). Overshoot, rise and
        settling are those of the last set-point.

    Raises
    ------
    InputError
        A name is unknown, a length is wrong, or the stroke, the bottom or the surface does not
        allow a start.
    NoAnswerError
        A vehicle that floats cannot dive.
    """
    check_counts(count=(count, 1), seed=(seed, 0), workers=(workers, 1))
    check_choice(keep, ("summary", "trajectory"), "not a choice", field="keep")
    chosen, numbers, tick = choose_law(vehicle, law, parameters, sample_time, pumped=True)
    times, _ = check_setpoints([(t, 0.0) for t, _ in setpoints], duration, tick)
    clock = schedule(times, duration, tick)
    depths = np.stack([spread(z, count, "setpoints", "m") for _, z in setpoints])
    z0 = spread(start_depth, count, "start_depth", "m")
    reach = float(max(depths.max(), z0.max()))
    medium = medium_of(vehicle, cast, reach=reach, bottom_depth=bottom_depth)
    layers = medium.layers
    given = dict(vary or {})
    pumped = vehicle.command == "volume change"
    if pumped and min([z0.min(), *(row.min() for row in depths[:-1])]) <= 0.0 < reach:
        check_dive(vehicle)
    if law is None and not pumped:
        check_sample_time(
            vehicle, chosen, numbers, tick, depths=[float(min(depths.min(), z0.min())), reach]
        )
    rates = [
        spread(given.pop(name, 1.0), count, f"vary[{name!r}]", "")
        for name in (RATES if pumped else ())
    ]
    chosen, numbers, watch = flown_law(flashed or vehicle, chosen, numbers, tick, supervised)
    plants, values = vary_plants(medium.plant, numbers, given, count)
    lanes = Plant(*plants)
    model = None
    if pumped:
        model = float_model(vehicle, medium, cast, reach=reach, seconds=bool(watch))
    V0 = lanes.psi * z0 + lanes.V_0 + layers.along(z0)
    if model is not None:
        V0 = np.full(count, np.nan)  # as its stepper has it
    if start_volume is not None:
        V0 = spread(start_volume, count, "start_volume", "m3")
    w0 = spread(start_speed, count, "start_speed", "m/s")
    check_starts(lanes, z0, V0)
    start = np.stack([np.zeros(count), V0, z0, w0])
    parts, fastest = 1, float(np.abs(w0).max())
    if not pumped:
        parts = base_steps(_stiffest(plants), tick, fastest, layers, booked=balance)
    own = {"plants": plants, "depths": depths, "start": start}
    if pumped:
        own["rates"] = np.stack(rates)
    if depth_error is not None:
        own["depth_error"] = series(depth_error, clock, count, "depth_error", "m")
    if neutral_change is not None:
        own["neutral"] = series(neutral_change, clock, count, "neutral_change", "m3")
    lay_out = partial(
        Block,
        law=chosen,
        clock=clock,
        parts=parts,
        sensors=vehicle.sensors,
        layers=layers,
        recorded=keep == "trajectory",
        booked=balance and not pumped,
    )
    run = _Run(lay_out, own, values, seed, model, watch)
    work = np.empty((int(Row.STEP), count))
    samples = clock.ticks + 1 if keep == "trajectory" else 0
    record, sums = np.empty((len(_TRAJECTORIES), samples, count)), []
    alarms = np.zeros((2, count))
    firsts = range(0, count, run.together)
    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        for first, (rows, kept, sum_, alarm) in zip(
            firsts, pool.map(run.block, firsts), strict=True
        ):
            there = slice(first, first + rows.shape[1])
            work[:, there], record[:, :, there], alarms[:, there] = rows, kept, alarm
            sums.append(sum_)
            advance(rows.shape[1] / count)
    data = _summaries(clock, work)
    accounts = np.concatenate(sums)
    if watch:
        why = meaning("", "why the supervisor took over", flag_meanings=_ALARMS)
        data["alarm"] = "lane", alarms[0].astype(int), why
        data["alarm_time"] = _of_lanes(alarms[1] * tick, "s", "time at which it took over")
    if model is not None:
        data |= _of_drive(accounts, model)
    elif balance:
        closed = [
            close_balance(vehicle, replace(medium, plant=Plant(*plant)), sum_, begin, end)
            for plant, sum_, begin, end in zip(
                plants.T, accounts, start.T, work[_STATE].T, strict=True
            )
        ]
        data["energy"] = _of_lanes(
            np.array([one.energy["source"] for one in closed]), "J", closed[0].basis
        )
    numbers = "lane", np.arange(count), meaning("1", "number of the lane")
    axes: dict[str, Variable] = {"lane": numbers}
    if keep == "trajectory":
        axes["time"] = ("time", np.arange(clock.ticks + 1) * clock.tick, time_of_run())
        unit = "V" if vehicle.command == "voltage" else "s" if pumped and watch else "m3"
        for (name, about), rows in zip(_TRAJECTORIES.items(), record, strict=True):
            data[name] = ("time", "lane"), rows, {"units": unit, **about}
    title = f"Ensemble of {vehicle.name}, simulated"
    about = described(title, control_law=chosen.name, steps_per_sample=parts)
    return cf_dataset(axes | data, about, coordinates=axes)


def _stiffest(plants: Array) -> Plant:
    """Return a plant whose drag bends no less, at any speed it may reach, than that of any lane."""
    lanes = Plant(*plants)
    most = Plant(*plants.max(axis=1))
    return most._replace(
        psi=float(np.abs(lanes.psi).max()),
        V_0=0.0,
        V_min=-float(np.abs(lanes.V_min - lanes.V_0).max()),
        V_max=float(np.abs(lanes.V_max - lanes.V_0).max()),
        epsilon=float(np.min(lanes.epsilon)),
    )


@dataclass(frozen=True)
class _Run:
    """What all blocks of an ensemble share."""

    lay_out: Callable[..., Block]  # a block, of what holds for all lanes
    own: dict[str, Array]  # what a block takes, each [..., lanes]
    values: dict[str, Array]  # parameters of the law, each [lanes]
    seed: int | None
    model: FloatModel | None  # of pump and valve
    watch: Supervision | tuple[()]
    room: threading.local = field(default_factory=threading.local)  # of each worker

    @property
    def together(self) -> int:
        """Lanes that run together; floats wait each for itself, and gain nothing by company."""
        return BLOCK if self.model is None else 1

    def block(self, first: int) -> tuple[Array, Array, Array, Array]:
        """Run the block that begins at lane `first`; return its rows, record, accounts and alarms.

        The last block is filled up with copies of its last lane, so that one kernel serves all.
        """
        count = self.own["plants"].shape[1]
        lanes = np.minimum(np.arange(first, first + self.together), count - 1)
        own: dict[str, Any] = {name: array[..., lanes] for name, array in self.own.items()}
        values = {name: array[lanes] for name, array in self.values.items()}
        if self.model is not None:
            own["stepper"], own["start"] = self.model.lanes(
                values, own["plants"], own["start"], rates=own.pop("rates")
            )
        kept = min(self.together, count - first)
        seeds = None if self.seed is None else [[self.seed, int(i)] for i in lanes[:kept]]
        watch = self.watch.over(self.together) if self.watch else ()
        block = self.lay_out(parameters=values, seeds=seeds, watch=watch, live=kept, **own)
        if not hasattr(self.room, "chains"):
            self.room.chains = work_space(self.together)
        block.run(chains=self.room.chains)
        accounts = block.accounts if block.stepper is None else block.stepper.accounts
        chosen = [RECORDED.index(name) for name in _TRAJECTORIES]
        rows = block.work[: Row.STEP, :kept].copy()
        alarms = watch.alarms[:kept].T if watch else np.zeros((2, kept))
        return rows, block.record[chosen][:, :, :kept], accounts[:kept], alarms


def _of_lanes(values: Array, unit: str, what: str) -> Variable:
    """Return what a lane has a number of, as a dataset takes it."""
    return "lane", values, meaning(unit, what)


def _of_drive(accounts: Array, model: FloatModel) -> dict[str, Variable]:
    """Return what the drive of each float did, and its energy."""
    found = {name: _of_lanes(accounts[:, n], *about) for name, (n, *about) in _OF_DRIVE.items()}
    a, basis = FloatAccount, "electrical energy of pump and valve"
    energy = accounts[:, [a.PUMP_ENERGY, a.VALVE_ENERGY, a.HOLDING_ENERGY]].sum(axis=1)
    if model.energy_unknown:
        energy, basis = accounts[:, a.PUMP_WORK], "work of the pump on the water"
    return found | {"energy": _of_lanes(energy, "J", basis)}


def _summaries(clock: Schedule, work: Array) -> dict[str, Variable]:
    """Return what is said of each lane."""
    stopped = work[Row.STOPPED] != 0.0
    ended = np.where(stopped, work[Row.STOP_TICK], clock.ticks)
    overshoot = np.maximum(work[Row.FURTHEST] - 1.0, 0.0) * 100.0
    rise = np.where(np.isfinite(work[Row.RISE90]), work[Row.RISE90], np.nan)
    outside, since = work[Row.OUTSIDE2], (clock.ticks - clock.given[-1]) * clock.tick
    settled = (outside < since - 0.5 * clock.tick) & ~stopped
    settle = np.where(settled, np.maximum(outside, 0.0), np.nan)
    rms = np.sqrt(work[Row.SQUARES] / np.maximum(ended - clock.given[-1] + 1, 1))
    error = "depth error since the last set-point, root mean square"
    found = {name: (work[row], unit, what) for name, (row, unit, what) in _SUMMARIES.items()}
    found |= {
        "overshoot": (overshoot, "%", "of the last step, beyond its target"),
        "rise90": (rise, "s", "first sample past 90 % of the last step"),
        "settle2": (settle, "s", "last sample outside 2 % of the last step"),
        "rms_error": (rms, "m", error),
        "stop_time": (ended * clock.tick, "s", "time at which the run ended"),
    }
    stop = (
        "lane",
        work[Row.STOPPED].astype(int),
        meaning("", "why the run ended", flag_meanings=_STOPS),
    )
    return {name: _of_lanes(*about) for name, about in found.items()} | {"stop": stop}
