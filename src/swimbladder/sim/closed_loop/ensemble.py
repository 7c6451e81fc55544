"""Thousands of vehicles in one call: any parameter, any start and any noise, lane by lane.

What it is given holds for all lanes or lane by lane, and is checked.
"""

from __future__ import annotations

import difflib
import math
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.control.law import Law
from swimbladder.control.records import leaves
from swimbladder.errors import InputError
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop.accounts import close_books
from swimbladder.sim.closed_loop.block import Block, Schedule, schedule, work_space
from swimbladder.sim.closed_loop.floats import RATES, FloatModel, float_model
from swimbladder.sim.closed_loop.rows import Row
from swimbladder.sim.closed_loop.single import check_counts, check_setpoints, choose_law
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.sim.engine.books import Account
from swimbladder.sim.engine.chain import base_steps, book_steps
from swimbladder.sim.engine.layers import Layers
from swimbladder.sim.engine.rodas.records import Account as FloatAccount
from swimbladder.vehicle import Sensors, Vehicle

if TYPE_CHECKING:
    import xarray


def vary_plants(
    p: Plant, numbers: Any, vary: Mapping[str, ArrayLike], count: int
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
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
            known = (*own, *values)
            near = difflib.get_close_matches(name, known, n=1)
            raise InputError(
                "neither the plant nor the law has such a parameter",
                field=f"vary[{name!r}]",
                value=name,
                remedy=(f"Did you mean {near[0]!r}? " if near else "")
                + f"Known: {', '.join(known)}",
            )
    for name in ("T1", "a_b", "a_s"):
        least = plants[Plant._fields.index(name)].min()
        if least <= 0.0:
            raise InputError(
                "must be above 0 in every lane", field=f"vary[{name!r}]", value=float(least)
            )
    return plants, values


def spread(given: ArrayLike, count: int, field: str, unit: str) -> NDArray[np.float64]:
    """Return a number or an array as [count]; raises InputError where it is neither."""
    array = np.asarray(given, float)
    if array.shape not in ((), (count,)):
        raise InputError(
            f"has the shape {array.shape}, not ({count},)", field=field, unit=unit or None,
            remedy="Give one number, or one for each lane",
        )  # fmt: skip
    if np.isnan(array).any():
        raise InputError("holds a value that is not a number", field=field, unit=unit or None)
    return np.broadcast_to(array, (count,)).copy()


def series(
    given: ArrayLike | None, clock: Schedule, count: int, field: str, unit: str
) -> NDArray[np.float64] | None:
    """Return what was given for every sample as [ticks + 1, count]; nothing where nothing was.

    Raises InputError for another shape, or for a value that is no finite number.
    """
    if given is None:
        return None
    array = np.asarray(given, float)
    samples = clock.ticks + 1
    if array.shape not in ((samples, count), (samples, 1)):
        raise InputError(
            f"has the shape {array.shape}, not ({samples}, {count}) or ({samples}, 1)",
            field=field, unit=unit, remedy="Give a row for each sample, both ends included",
        )  # fmt: skip
    if not np.isfinite(array).all():
        raise InputError("holds a value that is no finite number", field=field, unit=unit)
    return np.broadcast_to(array, (samples, count))


def check_starts(
    plants: NDArray[np.float64], z: NDArray[np.float64], V: NDArray[np.float64]
) -> None:
    """Raise InputError for the first lane that cannot start where it should."""
    row = Plant._fields.index
    for name, values, bad, why in (
        ("start_depth", z, z > plants[row("z_bottom")], "is below the bottom"),
        ("start_depth", z, z <= plants[row("z_air")], "is outside the water"),
        ("start_volume", V, plants[row("V_max")] < V, "is beyond the stroke's maximum"),
        ("start_volume", V, plants[row("V_min")] > V, "is beyond the stroke's minimum"),
    ):
        if bad.any():
            lane = int(np.argmax(bad))
            raise InputError(
                f"lane {lane} of {len(z)} {why}", field=name, value=float(values[lane]),
                unit="m" if values is z else "m3", remedy="Start within the water and the stroke",
            )  # fmt: skip


_STATE = slice(int(Row.Q), int(Row.Q) + 4)
BLOCK = 40  # lanes that run together: few enough for the first-level cache, no power of 2

_SUMMARIES: dict[str, tuple[Row, dict[str, str]]] = {
    "final_depth": (Row.Z, {"units": "m", "long_name": "depth at the end"}),
    "final_speed": (Row.W, {"units": "m s-1", "long_name": "speed at the end, positive down"}),
    "final_volume": (Row.V, {"units": "m3", "long_name": "volume at the end"}),
    "least_depth": (Row.Z_LOWEST, {"units": "m", "long_name": "least depth at a sample"}),
    "greatest_depth": (Row.Z_HIGHEST, {"units": "m", "long_name": "greatest depth at a sample"}),
    "least_volume": (Row.V_LOWEST, {"units": "m3", "long_name": "least volume at a sample"}),
    "greatest_volume": (Row.V_HIGHEST, {"units": "m3", "long_name": "greatest volume at a sample"}),
    "actuator_travel": (Row.TRAVEL, {"units": "m3", "long_name": "volume moved to and fro"}),
}
_TRAJECTORIES = {
    "depth": (0, {"units": "m", "long_name": "depth of the pressure sensor", "positive": "down"}),
    "speed": (1, {"units": "m s-1", "long_name": "vertical speed, positive down"}),
    "volume": (2, {"units": "m3", "long_name": "change of displaced volume"}),
    "command": (4, {"long_name": "command of the law, V or m3"}),
}


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
    books: bool = False,
    column: Column | None = None,
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> xarray.Dataset:
    """Return `count` runs of a vehicle and its variations as an xarray Dataset over ``lane``.

    vary: name -> array [count]; a field of `dynamics.Plant` (``"a_b"``, ``"T1"``, ``"psi"``, ...)
    or of the law's parameters (``"k_pz"``). setpoints: (time [s], depth [m] or depths [count]).
    start_depth [m], start_volume [m3] (neutral where not given), start_speed [m/s]: numbers or
    arrays [count]. seed: noise of the vehicle's sensors, a stream of its own for each lane.
    depth_error [m], [samples, count] or [samples, 1]: what is added to the measured depth, before
    its quantum. neutral_change [m3], likewise: what the neutral volume differs by, from a sample
    on to the next. keep: summaries only, or trajectories as well. books: also ``energy``, what
    `Books` calls the source. column: the water, the vehicle's own where not given. workers: threads
    (one per core). progress: called with the number of lanes done.

    A float with pump and valve is flown by a law of volume changes, and surfaces where a set-point
    is 0; start_depth 0 is afloat with all volume out. ``vary`` takes the fields of Plant that are
    not of a motor, and ``pump`` and ``valve``: what these give over what the processor takes them
    to. There are also ``pump_runs``, ``valve_runs``, ``pumped`` and ``energy``. A lane's steps are
    as long as its motion lets: an hour costs about 1 ms.

    ``stop`` holds the code of each lane's StopReason. Overshoot, rise and settling are those of
    the last set-point. Raises InputError for an unknown name, a wrong length or a start that the
    stroke, the bottom or the surface does not allow.
    """
    check_counts(count=(count, 1), seed=(seed, 0), workers=(workers, 1))
    if keep not in ("summary", "trajectory"):
        raise InputError(
            "not a choice", field="keep", value=keep, remedy="Choose summary or trajectory"
        )
    chosen, numbers, tick = choose_law(vehicle, law, parameters, sample_time, pumped=True)
    times, _ = check_setpoints([(t, 0.0) for t, _ in setpoints], duration, tick)
    clock = schedule(times, duration, tick)
    depths = np.stack([spread(z, count, "setpoints", "m") for _, z in setpoints])
    z0 = spread(start_depth, count, "start_depth", "m")
    reach = float(max(depths.max(), z0.max()))
    medium = medium_of(vehicle, column, reach=reach, bottom_depth=bottom_depth)
    layers = medium.layers
    given = dict(vary or {})
    pumped = vehicle.command == "volume change"
    rates = np.ones((len(RATES), count if pumped else 0))
    for n, name in enumerate(RATES if pumped else ()):
        rates[n] = spread(given.pop(name, 1.0), count, f"vary[{name!r}]", "")
    plants, values = vary_plants(medium.plant, numbers, given, count)
    row = Plant._fields.index
    model = float_model(vehicle, medium, column, reach=reach) if pumped else None
    neutral = plants[row("psi")] * z0 + plants[row("V_0")] + layers.along(z0)
    if model is not None:
        neutral[:] = np.nan  # as its stepper has it
    V0 = neutral if start_volume is None else spread(start_volume, count, "start_volume", "m3")
    w0 = spread(start_speed, count, "start_speed", "m/s")
    check_starts(plants, z0, V0)
    start = np.stack([np.zeros(count), V0, z0, w0])
    steps = book_steps if books else base_steps
    parts = 1 if pumped else steps(_stiffest(plants), tick, float(np.abs(w0).max()), layers)
    run = _Run(
        law=chosen, plants=plants, values=values, clock=clock, parts=parts, depths=depths,
        start=start, sensors=vehicle.sensors, seed=seed, record=keep == "trajectory",
        depth_error=series(depth_error, clock, count, "depth_error", "m"),
        neutral=series(neutral_change, clock, count, "neutral_change", "m3"), books=books,
        layers=layers, model=model, rates=rates,
    )  # fmt: skip
    work = np.empty((int(Row.STEP), count))
    record = np.empty((len(_TRAJECTORIES), clock.ticks + 1 if run.record else 0, count))
    sums = np.empty((count, run.sums))
    firsts = range(0, count, run.lanes)
    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        for first, (rows, kept, sum_) in zip(firsts, pool.map(run.block, firsts), strict=True):
            own = slice(first, first + rows.shape[1])
            work[:, own], record[:, :, own], sums[own] = rows, kept, sum_
            if progress is not None:
                progress(own.stop)
    data = _dataset(vehicle, chosen, clock, work, record)
    data.attrs["steps_per_sample"] = parts
    if model is not None:
        _add_drive(data, sums, model)
    elif books:
        closed = [
            close_books(
                vehicle,
                replace(medium, plant=Plant(*plants[:, n])),
                sums[n],
                start[:, n],
                work[_STATE, n],
            )
            for n in range(count)
        ]
        data["energy"] = (
            "lane", [b.energy["source"] for b in closed],
            {"units": "J", "long_name": closed[0].basis},
        )  # fmt: skip
    return data


def _stiffest(plants: NDArray[np.float64]) -> Plant:
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


@dataclass(frozen=True, kw_only=True)
class _Run:
    """What all blocks of an ensemble share."""

    law: Law
    plants: NDArray[np.float64]
    values: dict[str, NDArray[np.float64]]
    clock: Schedule
    parts: int
    depths: NDArray[np.float64]
    start: NDArray[np.float64]
    sensors: Sensors
    seed: int | None
    record: bool
    depth_error: NDArray[np.float64] | None
    neutral: NDArray[np.float64] | None
    books: bool
    layers: Layers
    model: FloatModel | None = None  # of pump and valve
    rates: NDArray[np.float64] = field(default_factory=lambda: np.ones((len(RATES), 0)))
    room: threading.local = field(default_factory=threading.local)  # of each worker

    @property
    def lanes(self) -> int:
        """Lanes that run together; floats wait each for itself, and gain nothing by company."""
        return BLOCK if self.model is None else 1

    @property
    def sums(self) -> int:
        """Number of accounts of a lane."""
        if self.model is not None:
            return len(FloatAccount)
        return len(Account) if self.books else 0

    def block(
        self, first: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Run the block that begins at lane `first`; return its rows, its record and its sums.

        The last block is filled up with copies of its last lane, so that one kernel serves all.
        """
        count = self.plants.shape[1]
        lanes = np.minimum(np.arange(first, first + self.lanes), count - 1)
        plants = self.plants[:, lanes]
        values = {n: v[lanes] for n, v in self.values.items()}
        stepper, start = None, self.start[:, lanes]
        if self.model is not None:
            stepper, start = self.model.lanes(
                values, plants, start[2], start[1], start[3], rates=self.rates[:, lanes]
            )
        block = Block.lay_out(
            plants=plants, law=self.law, parameters=values,
            clock=self.clock, parts=self.parts, depths=self.depths[:, lanes],
            start=start, sensors=self.sensors,
            seeds=None if self.seed is None else [[self.seed, int(i)] for i in lanes],
            record=self.record, books=self.books and stepper is None, events=False,
            depth_error=None if self.depth_error is None else self.depth_error[:, lanes],
            neutral=None if self.neutral is None else self.neutral[:, lanes],
            layers=self.layers, stepper=stepper,
        )  # fmt: skip
        if not hasattr(self.room, "chains"):
            self.room.chains = work_space(self.lanes)
        block.run(chains=self.room.chains)
        own = min(self.lanes, count - first)
        chosen = [row for row, _ in _TRAJECTORIES.values()]
        return (
            block.work[: Row.STEP, :own].copy(),
            block.record[chosen][:, :, :own],
            block.books[:own] if stepper is None else stepper.accounts[:own],
        )


def _add_drive(data: xarray.Dataset, accounts: NDArray[np.float64], model: FloatModel) -> None:
    """Add what the drive of each float did, and its energy."""
    a = FloatAccount
    for name, account, unit, what in (
        ("pump_runs", a.PUMP_RUNS, "1", "runs of the pump"),
        ("valve_runs", a.VALVE_RUNS, "1", "runs of valve and bypass"),
        ("pumped", a.PUMPED, "m3", "volume pressed out"),
    ):
        data[name] = ("lane", accounts[:, account], {"units": unit, "long_name": what})
    energy = accounts[:, [a.PUMP_ENERGY, a.VALVE_ENERGY, a.HOLDING_ENERGY]].sum(axis=1)
    basis = "electrical energy of pump and valve"
    if model.energy_unknown:
        energy, basis = accounts[:, a.PUMP_WORK], "work of the pump on the water"
    data["energy"] = ("lane", energy, {"units": "J", "long_name": basis})


def _dataset(
    vehicle: Vehicle, law: Law, clock: Schedule, work: NDArray[np.float64],
    record: NDArray[np.float64],
) -> xarray.Dataset:  # fmt: skip
    import xarray

    coords: dict[str, Any] = {"lane": np.arange(work.shape[1])}
    data: dict[str, Any] = {
        name: ("lane", work[row], attributes) for name, (row, attributes) in _SUMMARIES.items()
    }
    stopped = work[Row.STOPPED] != 0.0
    since = (clock.ticks - clock.given[-1]) * clock.tick
    rise, outside = work[Row.RISE90], work[Row.OUTSIDE2]
    data["overshoot"] = (
        "lane", np.maximum(work[Row.FURTHEST] - 1.0, 0.0) * 100.0,
        {"units": "%", "long_name": "of the last step, beyond its target"},
    )  # fmt: skip
    data["rise90"] = (
        "lane", np.where(np.isfinite(rise), rise, np.nan),
        {"units": "s", "long_name": "first sample past 90 % of the last step"},
    )  # fmt: skip
    settled = (outside < since - 0.5 * clock.tick) & ~stopped
    data["settle2"] = (
        "lane", np.where(settled, np.maximum(outside, 0.0), np.nan),
        {"units": "s", "long_name": "last sample outside 2 % of the last step"},
    )  # fmt: skip
    samples = np.where(stopped, work[Row.STOP_TICK], clock.ticks) - clock.given[-1] + 1
    data["rms_error"] = (
        "lane", np.sqrt(work[Row.SQUARES] / np.maximum(samples, 1)),
        {"units": "m", "long_name": "depth error since the last set-point, root mean square"},
    )  # fmt: skip
    data["stop"] = ("lane", work[Row.STOPPED].astype(int), {"long_name": "code of StopReason"})
    data["stop_time"] = (
        "lane", np.where(stopped, work[Row.STOP_TICK], clock.ticks) * clock.tick,
        {"units": "s", "long_name": "time at which the run ended"},
    )  # fmt: skip
    if record.shape[1]:
        axis = {"units": "s", "long_name": "time since the start", "axis": "T"}
        coords["time"] = ("time", np.arange(clock.ticks + 1) * clock.tick, axis)
        for (name, (_, attributes)), values in zip(_TRAJECTORIES.items(), record, strict=True):
            data[name] = (("time", "lane"), values, attributes)
    about = {
        "title": f"Ensemble of {vehicle.name}, simulated",
        "source": "swimbladder",
        "Conventions": "CF-1.11",
        "control_law": law.name,
    }
    return xarray.Dataset(data, coords=coords, attrs=about)
