"""Floats with pump and valve as lanes of the loop: what the stepper takes, and what it gives.

`run_float` is the run of `simulate` of one of them, with its events and balances.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.pump_valve import SurfacingParameters
from swimbladder.physics.dynamics import DragTerms, Plant, drag_force
from swimbladder.physics.seawater import Column, uniform_column
from swimbladder.sim.closed_loop.block import Block
from swimbladder.sim.closed_loop.pumped import BOARD, DIVES, FLOATS, PAUSE, SEGMENT, Pumped
from swimbladder.sim.closed_loop.solution import Books, Event, SingleRun, Solution, assemble
from swimbladder.sim.closed_loop.water import Medium
from swimbladder.sim.engine.rodas.drive import FULL
from swimbladder.sim.engine.rodas.ledger import Balance, balance, stored_energy
from swimbladder.sim.engine.rodas.prepare import Accuracy, first_lane, given_of, make_table
from swimbladder.sim.engine.rodas.records import AT, NOTE, NOW, WORK, Account, Doing, Note, Table
from swimbladder.vehicle import Hull, Vehicle

RATES = ("pump", "valve")
"""What a lane's drive may give over what its processor knows."""

Array = NDArray[np.float64]
_EXACT = Accuracy(
    relative=1e-6, depth=1e-5, speed=1e-7, volume=1e-12, rest_deep=1e-4, rest_afloat=1e-3
)
_AT_SURFACE = 1e-9  # m
_SHALLOW = 5.0  # m, the least of `_shallow`
_SPEED, _PAUSE = 0.1, 60.0  # m/s and s of a law that states neither
_MARGIN, _BELOW = 1.2, 100.0  # of the deepest depth, and m: how far the table goes on
_VARIED = (*DragTerms._fields, "V_min", "V_max", "z_surface", "a_s", "z_air", "z_bottom")
"""Fields of Plant that a lane may have of its own; in `given` they are in lower case."""


@dataclass(frozen=True)
class FloatModel:
    """A float in its water, as the stepper takes it; lanes are made from it by `lanes`."""

    vehicle: Vehicle
    column: Column
    plant: Plant  # of the body; what the drive would say is nan
    given: Any  # of `engine.rodas.prepare.given_of`
    table: Array  # [n, 2 len(Table)]
    energy_unknown: str  # why no electrical energy is known; "" where it is
    seconds: bool = False  # whether the law is a board's, which commands seconds

    def lanes(
        self,
        parameters: dict[str, Array],
        plants: Array,
        start: Array,
        *,
        noted: int = 0,
        rates: Array | None = None,
    ) -> tuple[Pumped, Array]:
        """Return a stepper of lanes that start at (q, V, z, w) [4, lanes], and these states.

        parameters: of the law by name, each [lanes]; plants [len(Plant), lanes]: of the body; what
        a lane has of its own is taken from there. A volume V that is nan: neutral, or at a depth
        of 0 all out. noted: room for what happens with its time. rates: of pump and valve over
        what the processor knows [len(RATES), lanes].
        """
        count = plants.shape[1]
        given = np.array([self.given] * count, self.given.dtype)
        rows = dict(zip(Plant._fields, plants, strict=True))
        for name in _VARIED:
            given[name.lower()] = rows[name]
        own = self.plant
        given["mass"] = self.given["mass"] * own.a_b / rows["a_b"]
        if rates is not None:
            given["delivery"], given["flow"] = rates
        given["trim"] = rows["V_0"] - own.V_0
        given["give"] = rows["psi"] - own.psi
        x = np.zeros(count, NOW)
        at = np.zeros(count, AT)
        board = np.zeros((count, BOARD))
        for n in range(count):
            _, asked, z, w = start[:, n].tolist()
            if math.isnan(asked):
                asked = None
            else:
                z = max(z, _AT_SURFACE)  # not afloat with all volume out
            x[n], at[n] = first_lane(given[n], self.table, z, volume=asked)
            x["w"][n] = w
            own_law = {k: float(v[n]) for k, v in parameters.items()}
            up, pause = surfacing_of(self.vehicle, own_law)
            board[n, : len(up)], board[n, PAUSE] = up, pause
            x["z_look"][n] = x["z"][n]
            board[n, DIVES] = 0.0 if x["v"][n] >= up.full - up[3] else 1.0
            board[n, FLOATS] = 1.0
        stepper = Pumped(
            given=given,
            table=self.table,
            waves=np.zeros((0, 6)),
            x=x,
            at=at,
            accounts=np.zeros((count, len(Account))),
            notes=np.zeros((count, noted), NOTE),
            counts=np.zeros((count, 3), np.int64),
            work=np.zeros((count, *WORK)),
            board=board,
            segment=np.zeros((count, SEGMENT)),
            seconds=self.seconds or None,
        )
        return stepper, np.stack([np.zeros(count), x["v"], x["z"], x["w"]])


def surfacing_of(
    vehicle: Vehicle, parameters: Mapping[str, float]
) -> tuple[SurfacingParameters, float]:
    """Return what the processor assumes at the surface, and its pause there [s].

    parameters: of the law, by name: its `far_speed`, `coefficient` and `dead` count, as `rate` has.
    """
    hull, stroke = vehicle.hull, vehicle.stroke
    speed = parameters.get("far_speed", _SPEED)
    own = drag_force(vehicle.drag, speed) / vehicle.water.specific_weight
    slack = parameters["coefficient"] * speed**2 if "coefficient" in parameters else own
    found = SurfacingParameters(
        shallow=_shallow(hull),
        neutral=vehicle.trim_error,
        full=stroke.maximum,
        lacking=FULL * (stroke.maximum - stroke.minimum),
        slack=slack,
        measured=0.0 if vehicle.command == "volume change" else 1.0,
    )
    return found, parameters.get("dead", _PAUSE)


def float_model(
    vehicle: Vehicle,
    medium: Medium,
    column: Column | None,
    *,
    reach: float,
    seconds: bool = False,
) -> FloatModel:
    """Return a float in the water of a column, or in its own where that is None.

    medium: of `water.medium_of`, which refuses a column that ends above. reach: the greatest depth
    that it is asked to go to [m]. seconds: whether the law is a board's, which commands seconds.
    """
    if column is None:
        column = uniform_column(vehicle.water, _MARGIN * max(reach, 0.0) + _BELOW)
    table, why = make_table(vehicle, column)
    given = given_of(vehicle, column, bottom=medium.plant.z_bottom, accuracy=_EXACT)
    given["shallow"] = _shallow(vehicle.hull)
    return FloatModel(vehicle, column, medium.plant, given, table, why, seconds)


def _shallow(hull: Hull) -> float:
    """Return the depth [m] above which a float is about to dive, or has come up."""
    return max(_SHALLOW, hull.emergence_depth + 0.1 * hull.height)


_ROOM = 20_000  # notes, beside what runs of the drive add
_WORDS = {
    Note.EMERGED: "began to emerge",
    Note.SUBMERGED: "submerged",
    Note.BOTTOM: "reached the bottom",
    Note.LEFT_BOTTOM: "left the bottom",
    Note.UPPER_STOP: "reached the upper end stop",
    Note.LOWER_STOP: "reached the lower end stop",
}
_POWER = {
    Doing.NOTHING: Table.HOLDING,
    Doing.PUMPING: Table.POWER_OUT,
    Doing.PRIMING: Table.POWER_OUT,
    Doing.LETTING_IN: Table.POWER_IN,
    Doing.BYPASSING: Table.POWER_BYPASS,
}


def run_float(
    model: FloatModel,
    parameters: dict[str, Array],
    start: Array,
    ticks: int,
    lay_out: Callable[..., Block],
    run: Callable[[Block], SingleRun],
) -> Solution:
    """Return the motion of a float from (q, V, z, w) [4, 1], with its V as `FloatModel.lanes` has.

    parameters: of the law by name, each [1]. lay_out: a block of what else holds.
    """
    plants = np.array(model.plant)[:, None]
    stepper, start = model.lanes(parameters, plants, start, noted=_ROOM + 4 * ticks)
    begin, emerges = stepper.x[0].copy(), bool(stepper.at["place"][0] == 1)
    found = run(lay_out(parts=1, start=start, stepper=stepper))
    return assemble(
        model.vehicle,
        model.plant,
        found,
        (_events(stepper, found.time, found.record), 0),
        float_balance(model, stepper, 0, begin, emerges),
        _power(model, found.record[0], found.record[5]),
    )


def _events(stepper: Pumped, time: Array, record: Array) -> tuple[Event, ...]:
    """Return passages and stalls; the runs of the drive are in the record, sample by sample."""
    notes = stepper.notes[0, : int(stepper.counts[0, 1])]
    found = [
        Event(float(row["t"]), _WORDS[Note(int(row["what"]))])
        for row in notes
        if Note(int(row["what"])) in _WORDS
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
    model: FloatModel, stepper: Pumped, lane: int, begin: np.record, emerged: bool
) -> Books:
    """Return the balances of a lane since its first state `begin`."""
    g, a = stepper.given[lane], stepper.accounts[lane]
    end = stepper.x[lane]
    stored = stored_energy(g, model.table, end, emerging=stepper.at["place"][lane] == 1)
    stored -= stored_energy(g, model.table, begin, emerging=emerged)
    found: Balance = balance(g, a, begin, end, stored=stored)
    sinks, source = dict(found.sinks), found.drive
    basis = "electrical energy of pump and valve"
    if model.energy_unknown:
        source = float(a[Account.PUMP_WORK])
        sinks["pump and its driver"] = 0.0
        basis = "work of the pump on the water (its electrical power is not known)"
    residual = source - sum(sinks.values())
    throughput = max(found.throughput, model.vehicle.water.specific_weight * 1e-12)
    return Books(
        volume={**found.volume, "travel": found.volume["pumped"] + found.volume["let in"]},
        energy={"source": source, **sinks},
        basis=basis,
        volume_residue=found.volume_residue,
        energy_residue=residual,
        throughput=max(throughput, source),
        motion_residue=residual,
        motion_throughput=throughput,
        motor_on=float(a[Account.PUMP_TIME]),
    )
