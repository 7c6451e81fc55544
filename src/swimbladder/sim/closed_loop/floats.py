"""Floats with pump and valve as lanes of the loop: what the stepper takes, and what it gives.

`run_float` is the run of `simulate` of one of them, with its events and balances; `board_law` makes
the law of a board that knows its pump and valves as polynomials over depth, volumes and times.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from swimbladder.control.law import Law, leaves
from swimbladder.control.pump_valve import DriveParameters, SurfacingParameters, timed
from swimbladder.errors import InputError
from swimbladder.io.answers import as_json
from swimbladder.physics.arrays import Array
from swimbladder.physics.buoyancy_engine import at_voltage, drive_map, running_pump
from swimbladder.physics.dynamics import DragTerms, Plant, drag_force
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.seawater import Column, uniform_column
from swimbladder.physics.steady_drives import REFERENCE_TEMPERATURE
from swimbladder.sim.closed_loop.block import Block
from swimbladder.sim.closed_loop.pumped import BOARD, DIVES, FLOATS, PAUSE, SEGMENT, Pumped
from swimbladder.sim.closed_loop.solution import Event, RunBalance, SingleRun, Solution, assemble
from swimbladder.sim.closed_loop.supervision import Supervision, supervision_of
from swimbladder.sim.closed_loop.water import Medium
from swimbladder.sim.engine.rodas.drive import FULL
from swimbladder.sim.engine.rodas.prepare import Accuracy, first_lane, given_of, make_table
from swimbladder.sim.engine.rodas.records import (
    AT,
    NOTE,
    NOW,
    WORK,
    Account,
    Balance,
    Doing,
    Note,
    Table,
    balance,
    stored_energy,
)
from swimbladder.vehicle import Hull, PumpAndValve, Vehicle

_BEYOND = 0.05  # of the stroke, pumped beyond what lacks at the surface: what seeped in, and errors
_MOST = 0.02  # of the rate, by which its polynomial may be off
_LONGEST_TICK = 1000.0  # s, so that microseconds of 32 bits count two of them
_LOW = 0.9  # of the full battery, to which its effect on the pump is linear
_FINE = 801  # depths at which the polynomials are compared


class BoardLaw(NamedTuple):
    """The law of a board that commands seconds, its parameters, and how well they fit."""

    law: Law
    parameters: Any
    rate_error: float  # -, most by which the polynomial of the pump's rate is off
    start_error: float  # m3, most by which that of what a start falls short is off

    @property
    def rate_percent(self) -> str:
        """The error of the rate as text."""
        return f"{max(100.0 * self.rate_error, 1e-3):.2g} %"

    def summary(self) -> str:
        """Return what the command line says of the fit, one line."""
        drive = self.parameters.drive
        fitted = f"by a polynomial down to {1.0 / drive.per_depth:.4g} m"
        short = f"a start falls short by {drive.short_0 * 1e6:.3g} cm3 at the surface"
        return f"drive: the pump's rate {fitted}, off by {self.rate_percent} at most; {short}"

    def to_dict(self) -> dict[str, float]:
        """Return what a program wants to know of the fit, in SI."""
        depth = 1.0 / self.parameters.drive.per_depth
        return {"fitted_to_m": depth, **as_json(self, "rate_error start_error_m3")}


def board_law(
    vehicle: Vehicle, law: Law, parameters: Any, tick: float, *, deepest: float
) -> BoardLaw:
    """Return a law of volume changes as the board of a vehicle takes it, fitted down to a depth.

    deepest [m]. Raises InputError for a sample time that the clock cannot count, a rate that the
    polynomial does not follow, and hulls where the sea does not come in at all.
    """
    a = vehicle.engine
    assert isinstance(a, PumpAndValve)
    if tick > _LONGEST_TICK:
        what = "the board's clock does not count so long a tick"
        remedy = f"Give at most {_LONGEST_TICK:g} s: the law sleeps anyway"
        raise InputError(what, field="controller.sample_time", value=tick, unit="s", remedy=remedy)
    depth = 0.5 * deepest * (1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, _FINE)))
    weight = vehicle.water.specific_weight
    drive = drive_map(vehicle, depth * weight, power=False)
    x = depth / deepest
    rate, rate_error = _fitted(x, drive.rate_out, 4, drive.rate_out)
    if not rate_error <= _MOST:
        off = f"off by {rate_error:.1%} somewhere above {deepest:.4g} m"
        what = f"the board's polynomial of the pump's delivery is {off}"
        remedy, limit = "Give a smaller depth limit, above which the delivery bends less", deepest
        raise InputError(what, field="supervisor.depth_limit", value=limit, unit="m", remedy=remedy)
    battery = _battery(vehicle, a, depth * weight + ATMOSPHERIC_PRESSURE - a.internal_pressure)
    short, start_error = _fitted(x, drive.start_volume, 2, np.ones_like(x))
    surface, pause = surfacing_of(vehicle, leaves(parameters))
    stroke, made = vehicle.stroke, timed(law)
    whole = stroke.maximum - stroke.minimum
    longest = a.longest_run or 2.0 * whole / float(np.min(drive.rate_out))
    board = DriveParameters(
        tick=tick,
        per_depth=1.0 / deepest,
        **{f"pump_{n}": of for n, of in enumerate(rate)},
        **battery,
        **{f"short_{n}": of for n, of in enumerate(short)},
        head_0=ATMOSPHERIC_PRESSURE - a.internal_pressure,
        head_1=weight,
        valve_flow=a.valve.flow,
        valve_laminar=math.sqrt(a.valve.laminar_pressure),
        bypass_flow=0.0 if a.bypass is None else a.bypass.flow,
        bypass_laminar=0.0 if a.bypass is None else math.sqrt(a.bypass.laminar_pressure),
        quantum=a.quantum,
        longest=longest,
        longest_for_law=min(longest, pause),
        pause=pause,
        longest_wait=law.longest_wait(parameters) if law.longest_wait else math.inf,
        volume_least=stroke.minimum,
        volume_most=stroke.maximum,
        beyond=_BEYOND * whole,
    )
    return BoardLaw(made, made.parameters(parameters, surface, board), rate_error, start_error)


def _battery(vehicle: Vehicle, a: PumpAndValve, head: Array) -> dict[str, float]:
    """Return what the board knows of a pump's battery, of heads from the surface on [Pa] [n].

    A motor at a steady load is as much slower as its voltage is lower, at every depth. A pump as
    measured knows of no voltage.
    """
    if vehicle.supply is None:
        return dict.fromkeys(("battery_full", "per_volt", "sag_0", "sag_1"), 0.0)
    full = vehicle.supply.voltage
    low = at_voltage(vehicle, _LOW * full)
    rate, power = running_pump(vehicle, a, head, REFERENCE_TEMPERATURE)
    slower = rate - running_pump(low, a, head, REFERENCE_TEMPERATURE)[0]
    sag = np.nan_to_num(power[[0, -1]]) / full * vehicle.supply.internal_resistance
    return {
        "battery_full": full,
        "per_volt": float(np.mean(slower)) / ((1.0 - _LOW) * full),
        "sag_0": float(sag[0]),
        "sag_1": float(sag[1] - sag[0]),
    }


def flown_law(
    vehicle: Vehicle, law: Law, parameters: Any, tick: float, supervised: bool | None
) -> tuple[Law, Any, Supervision | tuple[()]]:
    """Return (law, parameters, supervisor) of a vehicle as they are flown.

    tick [s]. supervised: as of `supervision_of`. Under a supervisor a law of volume changes is that
    of its board. Raises InputError as `board_law` and `supervision_of` do.
    """
    watch = supervision_of(vehicle, tick, supervised, laws=[(law, parameters)])
    if watch and vehicle.command == "volume change":
        board = board_law(vehicle, law, parameters, tick, deepest=watch.reach)
        law, parameters = board.law, board.parameters
    return law, parameters, watch


def _fitted(x: Array, y: Array, degree: int, unit: Array) -> tuple[list[float], float]:
    """Return the coefficients of a polynomial, and the most by which it is off, in a unit [n]."""
    if np.ptp(y) == 0.0:
        return [float(y[0])] + degree * [0.0], 0.0
    found = Polynomial.fit(x, y, degree, w=1.0 / unit).convert()
    off = float(np.max(np.abs(found(x) - y) / unit))
    return [*map(float, found.coef), *(degree + 1 - len(found.coef)) * [0.0]], off


RATES = ("pump", "valve")
"""What a lane's drive may give over what its processor knows."""

_EXACT = Accuracy(
    relative=1e-6, depth=1e-5, speed=1e-7, volume=1e-12, rest_deep=1e-4, rest_afloat=1e-3
)
_AT_SURFACE = 1e-9  # m
_SHALLOW = 5.0  # m, the least of `surface_zone`
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
        of 0 all out; all out there: afloat. noted: room for what happens with its time. rates: of
        pump and valve over what the processor knows [len(RATES), lanes].
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
            afloat = z <= 0.0 and not asked < self.vehicle.stroke.maximum  # nan: likewise
            if afloat or math.isnan(asked):
                asked = None
            else:
                z = max(z, _AT_SURFACE)  # not afloat with all volume out
            x[n], at[n] = first_lane(given[n], self.table, z, volume=asked)
            x["w"][n] = w
            own_law = {k: float(v[n]) for k, v in parameters.items()}
            up, pause = surfacing_of(self.vehicle, own_law)
            if self.seconds and z <= up.shallow and not afloat:
                what = "the board of a float takes all volume for out up there, and it is not"
                remedy = f"Begin afloat, at 0 m, or below {up.shallow:g} m"
                raise InputError(what, field="start_depth", value=z, unit="m", remedy=remedy)
            board[n, : len(up)], board[n, PAUSE] = up, pause
            x["z_sample"][n] = x["z"][n]
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
        shallow=surface_zone(hull),
        neutral=vehicle.trim_error,
        full=stroke.maximum,
        negligible=FULL * (stroke.maximum - stroke.minimum),
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
    given["shallow"] = surface_zone(vehicle.hull)
    return FloatModel(vehicle, column, medium.plant, given, table, why, seconds)


def surface_zone(hull: Hull) -> float:
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
) -> RunBalance:
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
    return RunBalance(
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
