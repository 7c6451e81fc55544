"""Thousands of vehicles in one call: any parameter, any start and any noise, lane by lane."""

from __future__ import annotations

import difflib
import math
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.closed_loop.block import Block, Schedule, schedule, work_space
from swimbladder.closed_loop.rows import Row
from swimbladder.closed_loop.single import check_counts, check_setpoints, choose_law
from swimbladder.control.law import Law
from swimbladder.dynamics import Plant, plant
from swimbladder.engine.chain import base_steps
from swimbladder.errors import InputError
from swimbladder.parameters import Sensors, Vehicle

if TYPE_CHECKING:
    import xarray

__all__ = ["BLOCK", "simulate_ensemble"]

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
    keep: Literal["summary", "trajectory"] = "summary",
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> xarray.Dataset:
    """Return `count` runs of a vehicle and its variations as an xarray Dataset over ``lane``.

    vary: name -> array [count]; a field of `dynamics.Plant` (``"a_b"``, ``"T1"``, ``"psi"``, ...)
    or of the law's parameters (``"k_pz"``). setpoints: (time [s], depth [m] or depths [count]).
    start_depth [m], start_volume [m3] (neutral where not given), start_speed [m/s]: numbers or
    arrays [count]. seed: noise of the vehicle's sensors, a stream of its own for each lane.
    keep: summaries only, or trajectories as well. workers: threads, one per core where not given.
    progress: called with the number of lanes done.

    ``stop`` holds the code of each lane's StopReason. Overshoot, rise and settling are those of
    the last set-point. Raises InputError for an unknown name, a wrong length or a start that the
    stroke, the bottom or the surface does not allow.
    """
    check_counts(count=(count, 1), seed=(seed, 0), workers=(workers, 1))
    if keep not in ("summary", "trajectory"):
        raise InputError(
            "not a choice", field="keep", value=keep, remedy="Choose summary or trajectory"
        )
    chosen, numbers, tick = choose_law(vehicle, law, parameters, sample_time)
    plants, values = _vary(plant(vehicle, bottom_depth=bottom_depth), numbers, vary or {}, count)
    times, _ = check_setpoints([(t, 0.0) for t, _ in setpoints], duration, tick)
    clock = schedule(times, duration, tick)
    depths = np.stack([_spread(z, count, "setpoints", "m") for _, z in setpoints])
    z0 = _spread(start_depth, count, "start_depth", "m")
    row = Plant._fields.index
    neutral = plants[row("psi")] * z0 + plants[row("V_0")]
    V0 = neutral if start_volume is None else _spread(start_volume, count, "start_volume", "m3")
    w0 = _spread(start_speed, count, "start_speed", "m/s")
    _check_starts(plants, z0, V0)
    start = np.stack([np.zeros(count), V0, z0, w0])
    parts = base_steps(_stiffest(plants), tick, float(np.abs(w0).max()))
    run = _Run(
        law=chosen, plants=plants, values=values, clock=clock, parts=parts, depths=depths,
        start=start, sensors=vehicle.sensors, seed=seed, record=keep == "trajectory",
    )  # fmt: skip
    work = np.empty((int(Row.STEP), count))
    record = np.empty((len(_TRAJECTORIES), clock.ticks + 1 if run.record else 0, count))
    firsts = range(0, count, BLOCK)
    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        for first, (rows, kept) in zip(firsts, pool.map(run.block, firsts), strict=True):
            own = slice(first, first + rows.shape[1])
            work[:, own], record[:, :, own] = rows, kept
            if progress is not None:
                progress(own.stop)
    data = _dataset(vehicle, chosen, clock, work, record)
    data.attrs["steps_per_sample"] = parts
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
    values: list[NDArray[np.float64]]
    clock: Schedule
    parts: int
    depths: NDArray[np.float64]
    start: NDArray[np.float64]
    sensors: Sensors
    seed: int | None
    record: bool
    room: threading.local = field(default_factory=threading.local)  # of each worker

    def block(self, first: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Run the block that begins at lane `first`; return its rows and its record.

        The last block is filled up with copies of its last lane, so that one kernel serves all.
        """
        count = self.plants.shape[1]
        lanes = np.minimum(np.arange(first, first + BLOCK), count - 1)
        block = Block.lay_out(
            plants=self.plants[:, lanes], law=self.law, parameters=[v[lanes] for v in self.values],
            clock=self.clock, parts=self.parts, depths=self.depths[:, lanes],
            start=self.start[:, lanes], sensors=self.sensors,
            seeds=None if self.seed is None else [[self.seed, int(i)] for i in lanes],
            record=self.record, books=False, events=False,
        )  # fmt: skip
        if not hasattr(self.room, "chains"):
            self.room.chains = work_space(BLOCK)
        block.run(chains=self.room.chains)
        own = min(BLOCK, count - first)
        chosen = [row for row, _ in _TRAJECTORIES.values()]
        return block.work[: Row.STEP, :own].copy(), block.record[chosen][:, :, :own]


def _vary(
    p: Plant, numbers: Any, vary: Mapping[str, ArrayLike], count: int
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Return plants [len(Plant), count] and the law's parameters, each [count]."""
    plants = np.repeat(np.array(p)[:, None], count, axis=1)
    values = [np.full(count, float(value)) for value in numbers]
    for name, given in vary.items():
        array = _spread(given, count, f"vary[{name!r}]", "")
        if name in Plant._fields:
            plants[Plant._fields.index(name)] = array
        elif name in numbers._fields:
            values[numbers._fields.index(name)] = array
        else:
            known = (*Plant._fields, *numbers._fields)
            near = difflib.get_close_matches(name, known, n=1)
            raise InputError(
                "neither the plant nor the law has such a parameter",
                field=f"vary[{name!r}]",
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


def _spread(given: ArrayLike, count: int, field: str, unit: str) -> NDArray[np.float64]:
    array = np.asarray(given, float)
    if array.shape not in ((), (count,)):
        raise InputError(
            f"has the shape {array.shape}, not ({count},)", field=field, unit=unit or None,
            remedy="Give one number, or one for each lane",
        )  # fmt: skip
    if np.isnan(array).any():
        raise InputError("holds a value that is not a number", field=field, unit=unit or None)
    return np.broadcast_to(array, (count,)).copy()


def _check_starts(
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


def _dataset(
    vehicle: Vehicle, law: Law, clock: Schedule, work: NDArray[np.float64],
    record: NDArray[np.float64],
) -> xarray.Dataset:  # fmt: skip
    import xarray

    data = xarray.Dataset(coords={"lane": np.arange(work.shape[1])})
    for name, (row, attributes) in _SUMMARIES.items():
        data[name] = ("lane", work[row], attributes)
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
        data = data.assign_coords(time=("time", np.arange(clock.ticks + 1) * clock.tick))
        data["time"].attrs = {"units": "s", "long_name": "time since the start", "axis": "T"}
        for (name, (_, attributes)), values in zip(_TRAJECTORIES.items(), record, strict=True):
            data[name] = (("time", "lane"), values, attributes)
    data.attrs = {
        "title": f"Ensemble of {vehicle.name}, simulated",
        "source": "swimbladder",
        "Conventions": "CF-1.11",
        "control_law": law.name,
    }
    return data
