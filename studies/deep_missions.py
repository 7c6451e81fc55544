"""The float's own law in the mission engine, beside what the float did.

::

    python -m studies.deep_missions DATA

Each logged deep dive is flown again by `swimbladder.sim.mission`: the vehicle as identified from
all deep dives (`studies.deep_dives`), in the water of that dive, with the law `rate` and the
settings of that dive (near, far, dead time, and `stab`, the looks that a speed at rest takes).
It begins where the log of the dive begins, with the volume that closed its balance there, and with
the temperature that the hull had, and is told only where to go, when to leave and to come up. What
pump and valve give is not what the float's processor reckons with: its runs are as long as its own
numbers say, and give what was identified. `studies.deep_readings` tells from the logs how soon the
hull takes the water's temperature, how its speeds scatter and what the drive loses at rest.
What came out: `docs/explanation/deep-dives.md`.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.deep_data import columns_of, dives_of, logs_of
from studies.deep_dives import float_vehicle
from studies.deep_readings import RUN, creep_at_rest, hull_time, rests, speed_scatter, warmer
from swimbladder.estimation.motion.deep import identified_vehicle
from swimbladder.estimation.motion.deep_fit import DeepFit, fit_deep
from swimbladder.estimation.motion.deep_model import DEFAULT, DeepDive, body_of, priors_of
from swimbladder.io.float_log import FloatLog, Stage
from swimbladder.io.mission import Mission
from swimbladder.physics.dynamics import even_drag
from swimbladder.physics.seawater import Column, WaterMotion
from swimbladder.sim.engine.rodas.records import Note
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import DriveError
from swimbladder.vehicle import Controller, PumpAndValve, Sensors, Vehicle

__all__ = ["Told", "flown", "logged", "with_drive_error", "with_law"]

Array = NDArray[np.float64]
MBAR = 100.0  # Pa
ML_H = 3.6e9  # mL/h, of a m3/s
LEAVES = 40.0  # s, of the pump, longer than any run that holds a depth
LOOKS = 60.0  # s, between two depths that tell how it holds
QUANTUM = 10.0  # mbar, between two pressures in the log
BOTTOM = 2500.0  # m, of the Ligurian Sea
SLOWEST, FASTEST = 62_700.0, 7_200.0  # s: inertial at 43.4 degrees north, buoyancy at 500 m
WAVES, MODES = 12, 4
SEAS = 15  # with other scatter, and waves of other phases; medians over them are told
SHALLOW = 2e5  # Pa, where the sea is warm and the hull has hardly cooled
WATER = 1e-3  # m/s, with --causes: what is left at rest were mostly more than of such waves


@dataclass(frozen=True, kw_only=True)
class Told:
    """What a dive looks like: times [s], numbers of actions, depth while it holds."""

    to_target: float  # s, from 10 m
    sinking: float  # actions before it arrives
    leave: float  # s, when it leaves the target
    holding: float
    rising: float
    up: float  # s, from leaving the target to 10 m
    inside: float  # share of the hold within the tolerance
    spread: float  # Pa, rms from the target while it holds

    @property
    def holds(self) -> float:
        """How long it is at the target [s]."""
        return max(self.leave - self.to_target, 0.0)


def with_drive_error(base: Vehicle, found: Vehicle, fit: DeepFit) -> tuple[Vehicle, DriveError]:
    """Return the identified vehicle with pump and valve as its processor knows them, and the truth.

    base: as its log speaks of it; found: as identified.
    """
    known, real = base.actuator, found.actuator
    assert isinstance(known, PumpAndValve)
    assert isinstance(real, PumpAndValve)
    actuator = real.model_copy(update={"pump": known.pump, "valve": known.valve})
    drive_error = DriveError(
        pump=fit.values["pump_delivery"], valve=fit.values["valve"], starts=False
    )
    return found.model_copy(update={"actuator": actuator}), drive_error


def as_at_rest(vehicle: Vehicle, creep: float, tau: float) -> Vehicle:
    """Return the vehicle with what its log tells at rest: creep [m3/s], its hull's time [s]."""
    actuator = vehicle.actuator
    assert isinstance(actuator, PumpAndValve)
    hull = vehicle.hull.model_copy(update={"thermal_time_constant": tau})
    changes = {"actuator": actuator.model_copy(update={"creep": creep}), "hull": hull}
    return vehicle.model_copy(update=changes)


def with_law(vehicle: Vehicle, log: FloatLog, weight: float, reading: float) -> Vehicle:
    """Return the vehicle with the float's law and the settings of a dive.

    weight: rho g [N/m3], that turns mbar into metres; reading: what a pressure scatters by [Pa],
    its steps included.
    """
    metre = MBAR / weight  # m, of a mbar

    def numbers(name: str) -> list[float]:
        return [float(x) for x in re.findall(r"[\d.]+", log.settings[name])]

    (near, near_speed), (far, far_speed) = numbers("near"), numbers("far")
    dead = numbers("dead")[0]
    parameters = {
        "coefficient": numbers("coeff")[0] / numbers("coeff")[1] * 1e-6 / metre**2,
        "tolerance": log.stages[0].tolerance / weight,
        "near": near * metre,
        "far": far * metre,
        "slow_speed": numbers("rate")[0] * metre,
        "near_speed": near_speed * metre,
        "far_speed": far_speed * metre,
        "ascent_speed": numbers("ascent")[0] * metre,
        "speed_band": numbers("rate")[0] * metre,
        "speed_step": metre,
        "volume_step": 2e-6,
        "dead": dead,
        "run": RUN,
        "window": numbers("stab")[0] * dead,
    }
    return vehicle.model_copy(
        update={
            "controller": Controller(law="rate", sample_time=1.0, parameters=parameters),
            "sensors": Sensors(
                depth_quantum=QUANTUM * metre,
                depth_noise=np.sqrt(max(reading**2 - (QUANTUM * MBAR) ** 2 / 12.0, 0.0)) / weight,
            ),
        }
    )


def waves_of(speed: float, seed: int) -> WaterMotion:
    """Return internal waves that move the water by a `speed` [m/s], 1 sigma, as time and depth go.

    Between the inertial and the buoyancy frequency the speeds of Garrett and Munk's spectrum
    (*J. Geophys. Res.* 80, 1975, 291) are white: waves of one amplitude of speed and of all
    frequencies, with random phases.
    """
    frequencies = np.linspace(1.0 / SLOWEST, 1.0 / FASTEST, WAVES)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, WAVES)
    # half the square of each in the mean over time, and half of that over depth
    each = 2.0 * speed / np.sqrt(WAVES)
    return WaterMotion(
        internal_waves=[
            {
                "amplitude": each / (2.0 * np.pi * f),
                "period": 1.0 / f,
                "water_depth": BOTTOM,
                "mode": 1 + k % MODES,
                "phase": phase,
            }
            for k, (f, phase) in enumerate(zip(frequencies, phases, strict=True))
        ],
    )


def logged(log: FloatLog, dive: DeepDive) -> Told:
    """Return what the float did."""
    stage = log.stages[0]
    time, acts = dive.time - dive.time[0], dive.actions.time - dive.time[0]
    inside = time[np.abs(dive.pressure - stage.pressure) < stage.tolerance]
    # samples are hours apart in one log; the float asks for no speed only where it has arrived
    rests = [
        a.time - dive.time[0]
        for a in log.actions
        if a.target is not None and abs(a.target.speed_to) < MBAR and a.time > dive.time[0]
    ]
    arrived = float(min([*inside[:1], *rests[:1]]))
    leave = float(min(acts[(acts > arrived) & (dive.actions.seconds > LEAVES)], default=time[-1]))
    return _told(time, dive.pressure, acts, arrived, leave, float(time[-1]), stage)


def flown(
    vehicle: Vehicle,
    column: Column,
    log: FloatLog,
    dive: DeepDive,
    real: Told,
    volume: float,
    drive_error: DriveError,
    motion: WaterMotion,
    seed: int,
) -> Told:
    """Return what the mission engine does with the same orders in water that moves.

    volume: of the drive where the dive begins [m3]; seed: of the sensor's draws.
    """
    stage = log.stages[0]
    begin, depth = np.interp([dive.pressure[0], stage.pressure], column.pressure, column.depth)
    settings = vehicle.controller.parameters if vehicle.controller is not None else {}
    lags = vehicle.hull.thermal_time_constant > 0.0
    mission = Mission(
        start_depth=float(begin),
        water_motion=motion,
        start_temperature=float(dive.temperature[0]) if lags else None,
        phases=[
            {
                "kind": "park",
                "depth": depth,
                "tolerance": stage.tolerance * depth / stage.pressure,
                "duration": real.leave,
                "check_interval": float(settings["dead"]) + RUN,
            },
            {"kind": "surface", "duration": 600.0, "timeout": 4.0 * real.up},
        ],
    )
    flight = fly_mission(
        vehicle,
        mission,
        column,
        drive_error=drive_error,
        start_volume=volume,
        seed=seed,
        checked=False,
    )
    time, z = flight.rows["t"], flight.rows["z"]
    # a hold may go below the cast: its water goes on as it ends there
    below = float(column.density[-1]) * column.gravity * np.maximum(z - column.deepest, 0.0)
    pressure = np.interp(z, column.depth, column.pressure) + below
    notes = flight.notes
    runs = np.isin(notes["what"], (Note.PUMP, Note.VALVE))
    arrivals = notes["t"][notes["what"] == Note.ARRIVED]
    arrived = float(arrivals[0]) if arrivals.size and arrivals[0] < real.leave else real.leave
    # as far up as the log of the dive goes, about 10 m
    end = float(time[(time > real.leave) & (pressure <= dive.pressure[-1])][0])
    acts = notes["t"][runs & (notes["t"] < end)]
    fine = np.arange(0.0, end, 60.0)
    return _told(fine, np.interp(fine, time, pressure), acts, arrived, real.leave, end, stage)


def _told(
    time: Array,
    pressure: Array,
    acts: Array,
    arrived: float,
    leave: float,
    end: float,
    stage: Stage,
) -> Told:
    held = (time >= arrived) & (time <= leave)
    off = (
        np.interp(np.arange(arrived, leave, LOOKS), time[held], pressure[held]) - stage.pressure
        if held.any()
        else np.array([np.nan])
    )
    return Told(
        to_target=arrived,
        sinking=int(np.sum(acts < arrived)),
        leave=leave,
        holding=int(np.sum((acts >= arrived) & (acts < leave))),
        rising=int(np.sum(acts >= leave)),
        up=end - leave,
        inside=float(np.mean(np.abs(off) <= stage.tolerance)),
        spread=float(np.sqrt(np.mean(off**2))),
    )


@dataclass(frozen=True, kw_only=True)
class Flights:
    """All that the dives are flown with."""

    vehicle: Vehicle
    drive_error: DriveError
    reading: float  # Pa
    seas: list[WaterMotion]
    dives: list[DeepDive]
    starts: Array  # m3 [dives], of the drive
    logs: dict[str, FloatLog]
    columns: dict[str, Column]

    def fly(self, change: Callable[[Vehicle], Vehicle] = lambda vehicle: vehicle) -> list[Told]:
        """Return each dive, medians over the seas. change: of the vehicle with its law."""
        found = []
        for dive, volume in zip(self.dives, self.starts, strict=True):
            log, column = self.logs[dive.name], self.columns[dive.name]
            real = logged(log, dive)
            weight = float(column.density.mean()) * column.gravity
            own = change(with_law(self.vehicle, log, weight, self.reading))
            each = [
                flown(own, column, log, dive, real, float(volume), self.drive_error, sea, seed)
                for seed, sea in enumerate(self.seas)
            ]
            medians = {field.name: _median(each, field.name) for field in fields(Told)}
            found.append(Told(**medians))
        return found


def _median(of: list[Told], name: str) -> float:
    values = np.array([getattr(told, name) for told in of])
    values = values[np.isfinite(values)]  # none where none came to hold
    return float(np.median(values)) if values.size else np.nan


def main() -> None:
    """Print the table, and with --causes what each cause makes of it."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of measured data")
    parser.add_argument("--causes", action="store_true", help="leave one cause out at a time")
    options = parser.parse_args()
    folder = options.data / "mermaid_p0051"
    base = float_vehicle()
    body, dives = body_of(base), dives_of(folder, base)
    fit = fit_deep(body, dives, priors_of(base, {}), free=DEFAULT)
    found = identified_vehicle(base, fit.values)
    logs, columns = {log.source: log for log in logs_of(folder)}, columns_of(folder)
    real = [logged(logs[dive.name], dive) for dive in dives]
    tau, off = hull_time(dives, columns)
    excess = ", ".join(f"{kelvin:.1f}" for kelvin in warmer(dives, columns, SHALLOW))
    print(f"at {SHALLOW / 1e4:.0f} dbar on the way down the hulls are warmer by {excess} K")
    scatter = speed_scatter(dives, [one.leave for one in real])
    at_rest = [
        rest
        for dive, one in zip(dives, real, strict=True)
        for rest in rests(body, fit.values, dive, one.to_target, one.leave)
    ]
    creep, doubt = creep_at_rest(at_rest)
    print(
        f"the hull follows the water in {tau:.0f} s ({off:.2f} K rms off); a speed over {RUN:.0f} "
        f"s scatters by {scatter.speed / MBAR:.2f} +- {scatter.std / MBAR:.2f} mbar/s "
        f"({scatter.looks} looks, {scatter.acted} acted on), a reading by "
        f"{scatter.reading / MBAR:.1f} mbar; at rest the drive loses {creep * ML_H:.3f} +- "
        f"{doubt * ML_H:.3f} mL/h:"
    )
    for rest in at_rest:
        print(
            f"  {rest.dive}: {rest.creep * ML_H:.3f} mL/h over {rest.hours:.1f} h, "
            f"{rest.left * 1e6:.3f} mL rms left"
        )
    found = as_at_rest(found, creep, tau)
    vehicle, drive_error = with_drive_error(base, found, fit)
    flights = Flights(
        vehicle=vehicle,
        drive_error=drive_error,
        reading=scatter.reading,
        dives=dives,
        starts=fit.starts,
        seas=[WaterMotion()] * SEAS,
        logs=logs,
        columns=columns,
    )
    print(
        "| dive | | to the target, h | actions | holding, h | actions | inside, % | rms, dbar "
        "| up, h | actions |\n|---|---|---:|---:|---:|---:|---:|---:|---:|---:|"
    )
    model = flights.fly()
    for dive, one, other in zip(dives, real, model, strict=True):
        print(_row(dive.name, "logged", one))
        print(_row(dive.name, "flown", other))
    print(_row("all", "logged", _whole(real)))
    print(_row("all", "flown", _whole(model)))
    if options.causes:
        _print_causes(flights, found, {"logged": real, "flown": model}, fit)


def _print_causes(
    flights: Flights, found: Vehicle, whole: dict[str, list[Told]], fit: DeepFit
) -> None:
    """Print the sums over all dives with one cause after the other left out, or put in."""
    pump = flights.drive_error.pump

    def hull(vehicle: Vehicle) -> Vehicle:
        changed = vehicle.hull.model_copy(update={"thermal_time_constant": 0.0})
        return vehicle.model_copy(update={"hull": changed})

    def without_steps(vehicle: Vehicle) -> Vehicle:
        noise = flights.reading / (vehicle.water.specific_weight)
        return vehicle.model_copy(update={"sensors": Sensors(depth_noise=noise)})

    def creeping(vehicle: Vehicle) -> Vehicle:
        return as_at_rest(vehicle, fit.values["creep"], vehicle.hull.thermal_time_constant)

    def moving(speed: float) -> list[WaterMotion]:
        return [waves_of(speed, seed) for seed in range(SEAS)]

    cases: dict[str, list[Told]] = {
        **whole,
        "the processor knows its drive": replace(
            flights, vehicle=found, drive_error=DriveError()
        ).fly(),
        "the valve gives as much less as the pump": replace(
            flights, drive_error=DriveError(pump=pump, valve=pump, starts=False)
        ).fly(),
        "readings that scatter by their steps alone": replace(flights, reading=0.0).fly(),
        "readings without steps": flights.fly(without_steps),
        "a hull as warm as the water": flights.fly(hull),
        "creep as identified on the whole dives": flights.fly(creeping),
        f"water that moves by {1e3 * WATER:.0f} mm/s": replace(flights, seas=moving(WATER)).fly(),
        f"water that moves by {1e3 * fit.noise.water:.1f} mm/s, as identified on the whole dives": (
            replace(flights, seas=moving(fit.noise.water)).fly()
        ),
        "one drag for both ways": replace(flights, vehicle=even_drag(flights.vehicle)).fly(),
    }
    print("\n| | down, h | actions | holding | up, h | actions |\n|---|---:|---:|---:|---:|---:|")
    for name, told in cases.items():
        t = _whole(told)
        print(
            f"| {name} | {t.to_target / 3600:.1f} | {t.sinking:.0f} | {t.holding:.0f} "
            f"| {t.up / 3600:.1f} | {t.rising:.0f} |"
        )


def _whole(of: list[Told]) -> Told:
    """Return the sums over dives; of the holds' shares and spreads means, weighed by time."""
    whole = {
        field.name: float(np.sum([getattr(t, field.name) for t in of])) for field in fields(Told)
    }
    hold = np.array([t.holds for t in of])
    for name in ("inside", "spread"):
        values = np.array([getattr(t, name) for t in of])
        whole[name] = float(np.nansum(values * hold) / np.sum(hold[np.isfinite(values)]))
    return Told(**whole)


def _row(dive: str, what: str, told: Told) -> str:
    return (
        f"| {dive} | {what} | {told.to_target / 3600:.1f} | {told.sinking:.0f} "
        f"| {told.holds / 3600:.1f} | {told.holding:.0f} | {100 * told.inside:.0f} "
        f"| {told.spread / 1e4:.1f} | {told.up / 3600:.1f} | {told.rising:.0f} |"
    )


if __name__ == "__main__":
    main()
