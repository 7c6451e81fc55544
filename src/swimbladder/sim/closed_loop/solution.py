"""What a simulation gives back.

Beside the motion that is where its volume and energy went, as a person can read it, with what does
not add up. `step_metrics` are the numbers of a depth step.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.io.answers import Answer, attributes
from swimbladder.io.netcdf import (
    UNDATED,
    cf_dataset,
    described,
    meaning,
    time_since,
    unless_dated,
)
from swimbladder.physics.actuator import reduced, unified
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.electric import electrical_power, supply_current, winding_current
from swimbladder.sim.closed_loop.lane import RECORDED
from swimbladder.sim.closed_loop.supervision import Alarm
from swimbladder.sim.closed_loop.water import Medium
from swimbladder.sim.engine.accounts import Account
from swimbladder.sim.engine.modes import Act, Where
from swimbladder.vehicle import IdentifiedActuator, Positioner, Vehicle

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, kw_only=True)
class RunBalance:
    """Where the volume and the energy of a run went.

    volume: pumped, leaked, change, travel [m3]. energy: each account [J]; source positive, sinks
    positive where they took energy, stores positive where they gained it. basis: what the source
    is. volume_residue [m3] and energy_residue [J] are what does not add up; throughput [J] is the
    energy that passed through, to judge the residue by. motion_residue and motion_throughput [J]
    are the same of the vehicle and the sea alone, which the motor's losses would hide.
    """

    volume: dict[str, float]
    energy: dict[str, float]
    basis: str
    volume_residue: float
    energy_residue: float
    throughput: float
    motion_residue: float
    motion_throughput: float
    motor_on: float

    @property
    def relative_energy_residue(self) -> float:
        """The larger of the two energy residues over its throughput [-]."""
        return max(
            abs(self.energy_residue) / self.throughput,
            abs(self.motion_residue) / self.motion_throughput,
        )


def close_balance(
    vehicle: Vehicle,
    medium: Medium,
    sums: NDArray[Any],
    first: NDArray[Any],
    last: NDArray[Any],
    *,
    prescribed: bool = False,
) -> RunBalance:
    """Return the balance of a run from the engine's sums and its first and last (q, V, z, w).

    medium: the plant, in its water. prescribed: the volume was given, so that nothing is known of
    the motor.
    """
    p = medium.plant
    a = {account: float(sums[account]) for account in Account}
    q0, V0, z0, w0 = (float(value) for value in first)
    q1, V1, z1, w1 = (float(value) for value in last)
    m, k_b = vehicle.mass, medium.specific_weight
    energy, basis = _actuator_energy(vehicle, medium, a, q1 * q1 - q0 * q0, prescribed)
    energy["drag"] = m * a[Account.DRAG]
    energy["bottom"] = m * a[Account.BOTTOM_W]
    energy["vehicle motion"] = 0.5 * m * (w1 * w1 - w0 * w0)
    energy["sea"] = m * (medium.potential(V1, z1) - medium.potential(V0, z0))
    motion = [energy[name] for name in ("drag", "bottom", "vehicle motion", "sea")]
    moved = m * p.a_b * a[Account.Z_DV]
    # volume that goes out and comes back passes energy through that the net accounts do not show
    passed = m * p.a_b * a[Account.TO_AND_FRO]
    source, pumped, leaked = energy["source"], a[Account.PUMPED], a[Account.LEAKED]
    sinks = sum(value for name, value in energy.items() if name != "source")
    return RunBalance(
        volume={"pumped": pumped, "leaked": leaked, "change": V1 - V0, "travel": a[Account.TRAVEL]},
        energy=energy,
        basis=basis,
        volume_residue=(V1 - V0) - (pumped - leaked),
        energy_residue=source - sinks,
        throughput=max(abs(source), 0.5 * sum(map(abs, energy.values())), passed, k_b * 1e-12),
        motion_residue=moved - sum(motion),
        motion_throughput=max(passed, 0.5 * sum(map(abs, motion)), k_b * 1e-12),
        motor_on=a[Account.MOTOR_ON],
    )


def _actuator_energy(
    vehicle: Vehicle, medium: Medium, a: dict[Account, float], spin: float, prescribed: bool
) -> tuple[dict[str, float], str]:
    """Return the actuator's accounts [J] and what they count as the source.

    spin: change of the squared volume rate [m6/s2]. Work per voltage and volume k_u/k_q turns the
    reduced equation into torques. An identified actuator has only ratios: k_u/k_q is then
    rho g/(k_z/k_u), as of a transmission without loss.
    """
    p, k_b = medium.plant, medium.specific_weight
    hydraulic = k_b * a[Account.Z_Q]
    if prescribed:
        return {"source": hydraulic}, "work on the water (the volume was given)"
    if isinstance(vehicle.engine, Positioner):
        moving, holding = vehicle.engine.moving_power, vehicle.engine.holding_power
        if moving is None:
            return {"source": hydraulic}, "work on the water (actuator.moving_power is not given)"
        source = moving * a[Account.MOTOR_ON] + holding * a[Account.AT_REST]
        return {"source": source, "motor": source - hydraulic}, _INTO_MOTOR
    if isinstance(vehicle.engine, IdentifiedActuator):
        if p.load_drive <= 0.0:
            basis = "work on the water (k_z/k_u is 0: the motor's work is not known)"
            return {"source": hydraulic, "leakage": k_b * a[Account.LEAK_Z]}, basis
        work = k_b / p.load_drive
        basis = "shaft of the motor, as of a transmission without loss (efficiency not identified)"
    else:
        table = unified(vehicle.engine, vehicle.water)
        work, basis = table.k_u / table.k_q, "shaft of the motor"
    motor = reduced(vehicle.engine, vehicle.water)
    R, kappa = motor.resistance, motor.kappa
    energy: dict[str, float] = {}
    viscous = work / p.gain
    if R is not None and kappa is not None:
        energy["source"] = (a[Account.U_U] - kappa * a[Account.U_Q]) / R
        squares = a[Account.U_U] - 2.0 * kappa * a[Account.U_Q] + kappa**2 * a[Account.Q_Q]
        energy["copper"] = squares / R
        energy["torque conversion"] = (kappa / R - work) * (a[Account.U_Q] - kappa * a[Account.Q_Q])
        viscous -= work * kappa
        basis = _INTO_MOTOR
    else:
        energy["source"] = work * a[Account.U_Q]
    energy["speed losses"] = viscous * a[Account.Q_Q]
    energy["dry friction"] = work * a[Account.FRICTION_Q]
    energy["transmission"] = work * a[Account.LOAD_Q] - hydraulic
    energy["leakage"] = k_b * a[Account.LEAK_Z]
    rotor = 0.5 * work * p.T1 / p.gain
    energy["end stops"] = work * a[Account.STOP_U] + rotor * a[Account.STOP_Q]
    energy["rotor"] = rotor * spin
    return energy, basis


_INTO_MOTOR = "electrical power into the motor"


class StepMetrics(NamedTuple):
    """A step response at its samples; times from the set-point on, None: never."""

    overshoot_pct: float  # % of the step beyond the target
    rise90_s: float | None  # first sample past 90 % of the step
    settle2_s: float | None  # last sample outside 2 % of the step
    final_depth_m: float


def step_metrics(time: ArrayLike, depth: ArrayLike, *, start: float, target: float) -> StepMetrics:
    """Return overshoot, 90 % rise and 2 % settling of a step.

    Parameters
    ----------
    time
        Instants [n] in s, counted from the first.
    depth
        At these instants [n] in m.
    start, target
        Depths between which the step goes [m].

    Returns
    -------
    StepMetrics
        The response has not settled where its last sample is outside 2 %. A step of zero length has
        neither overshoot nor rise.
    """
    t = np.asarray(time, float)
    z = np.asarray(depth, float)
    t = t - t[0]
    if target == start:
        return StepMetrics(0.0, None, None, float(z[-1]))
    share = (z - start) / (target - start)
    risen = np.flatnonzero(share > 0.9)
    outside = np.flatnonzero(np.abs(share - 1.0) > 0.02)
    if outside.size == 0:
        settled: float | None = 0.0
    else:
        settled = None if outside[-1] == len(t) - 1 else float(t[outside[-1]])
    return StepMetrics(
        overshoot_pct=float(max(share.max() - 1.0, 0.0) * 100.0),
        rise90_s=float(t[risen[0]]) if risen.size else None,
        settle2_s=settled,
        final_depth_m=float(z[-1]),
    )


class StopReason(Enum):
    """Why a simulation ended; each member's value says it in a sentence, with the remedy."""

    FINISHED = "The simulation reached its end."
    LEFT_WATER = (
        "The hull left the water: it rose faster than its emerging part can stop. Check the mass, "
        "the waterplane area and the height of the hull, or begin deeper."
    )
    TOO_DEEP = (
        "The vehicle sank below 12000 m, deeper than any sea: the controller could not bring "
        "enough volume to stop it. Check its gains, the stroke and the depth asked for."
    )
    CHATTERS = (
        "The vehicle changed its mode more than 500 times in one step. This is a fault of the "
        "model or of the simulator: please report it with the vehicle's file."
    )
    NOT_FINITE = (
        "The motion grew beyond all numbers. Check the vehicle's numbers and the controller's "
        "gains."
    )
    LAW_NOT_FINITE = (
        "The control law gave a command that is not a finite number. Check its gains and what it "
        "does with the measurement."
    )

    @property
    def code(self) -> int:
        """Number of the reason in the kernels and in ensembles."""
        return list(StopReason).index(self)


@dataclass(frozen=True)
class Event:
    """A passage that matters: an end stop, the surface or the bottom, reached or left."""

    time: float  # s
    kind: str


_COLUMNS = (
    "time_s depth_m speed_m_s volume_m3 voltage_V reference_volume_m3=volume_reference current_A "
    "power_W reference_depth_m=reference"
)


@dataclass(frozen=True, kw_only=True)
class Solution(Answer):
    """A run at its sample instants; arrays [n + 1], the inputs of a row hold until the next.

    depth [m], speed [m/s, down], volume [m3], motor_rate [m3/s, before leakage], reference [m],
    command as the law gave it, voltage [V] as applied (nan: a positioner), volume_reference [m3]
    (nan: the law has none), current [A] and power [W] at the sample (nan where not known). Of a
    pump and valve the command is the change of volume asked for at the sample [m3], under its
    supervisor the seconds of it that the pump is to run, below 0 a valve [s], the motor rate what
    they move, and drive what they do: 0 nothing, 1 pump, 2 valve, 3 bypass, 4 the pump runs
    and does not deliver yet (nan: another actuator).

    supervised: whether the law was flown under the vehicle's supervisor, as flashed. alarm: why and
    when that took over; from then on the applied voltage or volume is the supervisor's.
    """

    vehicle: Vehicle
    law: str
    time: Array
    reference: Array
    depth: Array
    speed: Array
    volume: Array
    motor_rate: Array
    command: Array
    voltage: Array
    volume_reference: Array
    current: Array
    power: Array
    drive: Array
    events: tuple[Event, ...]
    events_omitted: int
    stop: StopReason
    balance: RunBalance
    supervised: bool
    alarm: Alarm | None

    @property
    def sentences(self) -> list[str]:
        """What was flown, where it went, and why it ended."""
        flown = f"law {self.law} {'and supervisor' if self.supervised else 'alone'}"
        span = f"{self.time[-1]:g} s in {len(self.time)} samples"
        way = f"from {self.depth[0]:.3g} to {self.depth[-1]:.3f} m, deepest {self.deepest:.3g} m"
        said = [f"{self.vehicle.name}, {flown}, {span}: {way}"]
        said.append(f"volume moved to and fro: {1e6 * self.actuator_travel:.3g} cm3")
        if not self.within_depth_limit:
            said.append(f"It passed the {self.vehicle.hull.depth_limit:g} m that it is rated for.")
        return [*said, self.stop.value]

    def to_dict(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI; the arrays are in `dataset`."""
        return {
            **attributes(self, "vehicle=vehicle.name law supervised alarm"),
            "duration_s": float(self.time[-1]),
            "samples": len(self.time),
            **attributes(self, "completed=finished deepest_m within_depth_limit"),
            "energy_J": self.balance.energy["source"],
            **attributes(self, "energy_basis=balance.basis stop_reason=stop"),
            "events": [{"time_s": event.time, "kind": event.kind} for event in self.events],
            "events_omitted": self.events_omitted,
        }

    @property
    def finished(self) -> bool:
        """Whether the simulation reached its end."""
        return self.stop is StopReason.FINISHED

    @property
    def deepest(self) -> float:
        """Greatest depth at a sample [m]."""
        return float(np.max(self.depth))

    @property
    def within_depth_limit(self) -> bool:
        """Whether the vehicle stayed within its rating, where it has one."""
        limit = self.vehicle.hull.depth_limit
        return limit is None or self.deepest <= limit

    @property
    def actuator_travel(self) -> float:
        """Volume moved to and fro [m3]."""
        return self.balance.volume["travel"]

    def columns(self) -> dict[str, Array]:
        """Return the columns of trajectory.csv: those that are known of its actuator [n]."""
        asked = "run_s" if self.supervised else "volume_change_m3"
        known = attributes(self, _COLUMNS) | {
            asked: np.where(np.isnan(self.drive), np.nan, self.command),
            "volume_rate_m3_s": np.where(np.isnan(self.drive), np.nan, self.motor_rate),
            "drive": self.drive,
        }
        return {name: values for name, values in known.items() if not np.all(np.isnan(values))}

    def dataset(self, begin: datetime.datetime | None = None) -> xarray.Dataset:
        """Return the arrays as an xarray Dataset that follows the CF conventions.

        begin: when the run does, with its time zone. `time` is in seconds since then.
        """
        found = {"time": ("time", self.time, time_of_run(begin))}
        for name, about in VARIABLES.items():
            values = getattr(self, name)
            if not np.all(np.isnan(values)):
                found[name] = ("time", values, about)
        title = f"Vertical motion of {self.vehicle.name}, simulated"
        about = described(title, control_law=self.law, stop_reason=self.stop.name)
        return cf_dataset(found, about, coordinates=["time"])


def time_of_run(begin: datetime.datetime | None = None) -> dict[str, Any]:
    """Return the attributes of the time since a run's begin."""
    return time_since(begin or UNDATED, "time since the start", axis="T", **unless_dated(begin))


_DRIVES = "nothing pump valve bypass pump_without_delivery"
VARIABLES = {
    "depth": meaning("m", "depth of the pressure sensor", "depth", positive="down"),
    "reference": meaning("m", "depth asked for", positive="down"),
    "speed": meaning("m s-1", "vertical speed, positive down"),
    "volume": meaning("m3", "change of displaced volume, positive is lighter"),
    "motor_rate": meaning("m3 s-1", "volume rate driven by the motor"),
    "drive": meaning("", "what pump and valve do", flag_meanings=_DRIVES),
    "voltage": meaning("V", "voltage applied to the motor"),
    "volume_reference": meaning("m3", "volume asked for by the depth controller"),
    "current": meaning("A", "motor current"),
    "power": meaning("W", "electrical power from the supply"),
}


def name_events(log: Array, noted: int) -> tuple[tuple[Event, ...], int]:
    """Return the engine's passages as Events, and how many found no room."""
    events = []
    for time, before, after in log[: min(noted, len(log))].tolist():
        events += [Event(time, kind) for kind in _passages(int(before), int(after))]
    return tuple(events), max(noted - len(log), 0)


_STOPS = {Act.UPPER: "upper", Act.LOWER: "lower", Act.LOWER_SPINNING: "lower"}
_ARRIVED = {
    Where.SUBMERGED: "submerged",
    Where.EMERGING: "began to emerge",
    Where.BOTTOM: "reached the bottom",
}


@cache
def _passages(before: int, after: int) -> tuple[str, ...]:
    found = []
    left, reached = (_STOPS.get(Act(mode % 10)) for mode in (before, after))
    if left != reached:
        passed = (("left", left), ("reached", reached))
        found += [f"{how} the {stop} end stop" for how, stop in passed if stop]
    old, new = Where(before // 20), Where(after // 20)
    if old is not new:
        found.append("left the bottom" if old is Where.BOTTOM else _ARRIVED[new])
    return tuple(found)


class SingleRun(NamedTuple):
    """What the kernel gave of one vehicle, sample by sample."""

    law: str
    stop: StopReason
    time: Array  # s
    reference: Array  # m
    record: Array  # [len(RECORDED), samples]
    supervised: bool = False
    alarm: Alarm | None = None


def assemble(
    vehicle: Vehicle,
    p: Plant,
    run: SingleRun,
    events: tuple[tuple[Event, ...], int],
    balance: RunBalance,
    power: Array | None = None,
) -> Solution:
    """Return a Solution of a run, with current and power where known.

    events: and how many found no room. power [W]: of pump and valve, whose record has what they do
    in the place of the voltage.
    """
    rows = dict(zip(RECORDED, run.record, strict=True))
    applied, motor_rate = rows.pop("applied"), rows["motor_rate"]
    voltage = current = unknown = np.full_like(run.time, np.nan)
    drive = unknown if power is None else applied
    power = unknown if power is None else power
    if vehicle.voltage_driven:
        voltage = _as_supplied(p, applied, motor_rate)
        resistance = reduced(vehicle.engine, vehicle.water).resistance
        if resistance is not None and p.kappa > 0.0:
            current = winding_current(u=voltage, omega=motor_rate, R=resistance, k_emf=p.kappa)
            drawn = supply_current(
                P=electrical_power(u=voltage, i=current), E=p.supply, R_b=p.sag * resistance
            )
            power = p.supply * drawn
    return Solution(
        vehicle=vehicle,
        law=run.law,
        time=run.time,
        reference=run.reference,
        **rows,
        voltage=voltage,
        current=current,
        power=power,
        drive=drive,
        events=_with_samples(events[0], vehicle, run, rows["depth"]),
        events_omitted=events[1],
        stop=run.stop,
        balance=balance,
        supervised=run.supervised,
        alarm=run.alarm,
    )


def _with_samples(
    events: tuple[Event, ...], vehicle: Vehicle, run: SingleRun, depth: Array
) -> tuple[Event, ...]:
    """Return the events with the samples at which a limit was passed, or the supervisor acted."""
    limit, passed = vehicle.hull.depth_limit, []
    if limit is not None:
        below = np.concatenate(([False], depth > limit))
        passed = [
            Event(float(t), f"passed its depth limit of {limit:g} m")
            for t in run.time[below[1:] & ~below[:-1]]
        ]
    if run.alarm is not None:
        took_over = f"the supervisor took over: {run.alarm.reason.words}"
        passed.append(Event(run.alarm.time, took_over))
    return tuple(sorted((*events, *passed), key=lambda event: event.time))


def _as_supplied(p: Plant, u: Array, q: Array) -> Array:
    """Voltage on the motor [V]: as asked for, or what the sagging supply has left."""
    limit: Any = p.supply
    if p.sag > 0.0:
        towards = q * np.where(u >= 0.0, 1.0, -1.0)
        limit = np.minimum((p.supply + p.sag * p.kappa * towards) / (1.0 + p.sag), p.supply)
    return np.asarray(np.clip(u, -limit, limit))
