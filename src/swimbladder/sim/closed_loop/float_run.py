"""One float with pump and valve under its law: the run of `simulate`, its events and balances."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Law
from swimbladder.control.records import leaves
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop.accounts import Books
from swimbladder.sim.closed_loop.block import Block, Schedule
from swimbladder.sim.closed_loop.floats import FloatModel, float_model
from swimbladder.sim.closed_loop.pumped import Pumped
from swimbladder.sim.closed_loop.rows import Row
from swimbladder.sim.closed_loop.single import check_start
from swimbladder.sim.closed_loop.solution import Event, Solution, StopReason, assemble
from swimbladder.sim.closed_loop.water import Medium
from swimbladder.sim.engine.rodas.ledger import Balance, balance, stored_energy
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Drive, Note, Table
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]
_ROOM = 20_000  # notes, beside what runs of the drive add
_WORDS = {
    Note.EMERGED: "began to emerge", Note.SUBMERGED: "submerged", Note.BOTTOM: "reached the bottom",
    Note.LEFT_BOTTOM: "left the bottom", Note.UPPER_STOP: "reached the upper end stop",
    Note.LOWER_STOP: "reached the lower end stop",
}  # fmt: skip
_POWER = {
    Doing.NOTHING: Table.HOLDING, Doing.PUMPING: Table.POWER_OUT, Doing.PRIMING: Table.POWER_OUT,
    Doing.LETTING_IN: Table.POWER_IN, Doing.BYPASSING: Table.POWER_BYPASS,
}  # fmt: skip


def run_float(
    vehicle: Vehicle, medium: Medium, column: Column | None, *, law: Law, parameters: Any,
    clock: Schedule, depths: list[float], start: tuple[float, float | None, float],
    seed: int | None, function: Callable[..., Any] | None, progress: Callable[[int], None] | None,
) -> Solution:  # fmt: skip
    """Return the motion of a float from a depth [m], a volume [m3] or None, and a speed [m/s].

    A start at depth 0 without a volume is afloat with all volume out.
    """
    z, V, w = start
    afloat = z == 0.0 and V is None
    check_start(medium, z, medium.plant.V_max if afloat else V, w)
    model = float_model(vehicle, medium, column, reach=max(z, *depths))
    values = {name: np.array([value]) for name, value in leaves(parameters).items()}
    plants = np.array(medium.plant)[:, None]
    stepper, first = model.lanes(
        values, plants, np.array([z]), np.array([math.nan if V is None else V]), np.array([w]),
        noted=_ROOM + 4 * clock.ticks,
    )  # fmt: skip
    begin, emerges = stepper.x[0].copy(), bool(stepper.at[0, At.PLACE] == 1)
    block = Block.lay_out(
        plants=plants, law=law, parameters=values, clock=clock, parts=1,
        depths=np.array(depths)[:, None], start=first, sensors=vehicle.sensors,
        seeds=None if seed is None else [[seed, 0]], record=True, books=False, events=False,
        stepper=stepper,
    )  # fmt: skip
    if function is None:
        block.run(progress)
    else:
        from swimbladder.sim.closed_loop.function import run_function

        run_function(block, function, progress)
    stop = list(StopReason)[int(block.work[Row.STOPPED, 0])]
    n = clock.ticks + 1 if stop is StopReason.FINISHED else int(block.work[Row.STOP_TICK, 0]) + 1
    time: Array = np.arange(n, dtype=np.float64) * clock.tick
    record = block.record[:, :n, 0]
    return assemble(
        vehicle, medium.plant, law=law.name, time=time,
        reference=np.asarray(depths, float)[clock.turn[:n]], record=record,
        events=(_events(stepper, time, record), 0), stop=stop,
        books=float_balance(model, stepper, 0, begin, emerges),
        power=_power(model, record[0], record[5]),
    )  # fmt: skip


def _events(stepper: Pumped, time: Array, record: Array) -> tuple[Event, ...]:
    """Return passages and stalls; the runs of the drive are in the record, sample by sample."""
    notes = stepper.notes[0, : int(stepper.counts[0, 1])]
    found = [
        Event(float(row[Drive.T]), _WORDS[Note(int(row[Drive.WHAT]))])
        for row in notes
        if Note(int(row[Drive.WHAT])) in _WORDS
    ]
    stalled = (record[5] == Doing.PUMPING) & (record[3] <= 0.0)
    begins = np.flatnonzero(stalled & ~np.concatenate(([False], stalled[:-1])))
    found += [Event(float(time[k]), "the pump stalled") for k in begins]
    return tuple(sorted(found, key=lambda event: event.time))


def _power(model: FloatModel, depth: Array, doing: Array) -> Array:
    """Return the electrical power of the drive at each sample [W]; nan where it is not known."""
    found = np.full_like(depth, np.nan)
    if not model.energy_unknown:
        for what, column in _POWER.items():
            own = doing == what
            found[own] = np.interp(depth[own], model.column.depth, model.table[:, column])
    return found


def float_balance(
    model: FloatModel, stepper: Pumped, lane: int, begin: Array, emerged: bool
) -> Books:
    """Return the balances of a lane since its first state `begin` of `Now`."""
    g, a = stepper.given[lane], stepper.accounts[lane]
    end = stepper.x[lane]
    stored = stored_energy(g, model.table, end, emerging=stepper.at[lane, At.PLACE] == 1)
    stored -= stored_energy(g, model.table, begin, emerging=emerged)
    found: Balance = balance(g, a, begin, end, stored=stored)
    sinks, source = dict(found.sinks), found.drive
    basis = "electrical energy of pump and valve"
    if model.energy_unknown:
        source = float(a[Account.PUMP_WORK])
        sinks["pump and its driver"] = 0.0
        basis = "work of the pump on the water (its electrical power is not known)"
    residual = source - sum(sinks.values())
    least = float(model.vehicle.water.specific_weight) * 1e-12
    throughput = max(found.throughput, least)
    return Books(
        volume={**found.volume, "travel": found.volume["pumped"] + found.volume["let in"]},
        energy={"source": source, **sinks}, basis=basis, volume_residue=found.volume_residue,
        energy_residue=residual, throughput=max(throughput, source),
        motion_residue=residual, motion_throughput=throughput,
        motor_on=float(a[Account.PUMP_TIME]),
    )  # fmt: skip
