"""``swimbladder tune``: gains for a vehicle, with margins over its 95 % parameter region.

``swimbladder compare-laws``: every law on the same scenarios, as a table and a picture.

``swimbladder stability``: how stable a vehicle is under its law, and from where it recovers.

``swimbladder firmware``: an Arduino library of a vehicle's controller, with a golden trace.

``swimbladder board``: hardware in the loop, a board's own C against the vehicle's model.

``swimbladder faults``: missions in which something fails, with the vehicle's own C on board.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.common import aside, working
from swimbladder.cli.options import (
    AnyVehicle,
    Files,
    Given,
    Golden,
    Options,
    Several,
    Supervised,
    TimeLimit,
    VehicleName,
    flag,
    grouped,
    loaded,
    supervised,
    valued,
)
from swimbladder.cli.reading import CastReading, DepthSensor, water_of_cast
from swimbladder.errors import InputError
from swimbladder.show.parts import Table
from swimbladder.units import quantity, with_one_unit

if TYPE_CHECKING:
    from swimbladder.codegen.pool import PoolOptions
    from swimbladder.vehicle import Vehicle


class Design(Options):
    """What gains are sought."""

    law: Given = valued("LAW", "Law (chosen; pump and valve: rate); a wrong name lists all.")
    goal: str = valued(
        "GOAL", "Goal: fast (settling time), quiet (actuator motion) or energy.", "fast"
    )
    depth_range: Given = valued("LEAST:MOST", "Depth range of the design (0:10 m; float: its own).")
    step: Given = valued("FROM:TO", "Step of the simulations (1.5 m; float: all depths).")
    sample_time: Given = valued("TIME", "Sample time (the controller's).")
    delay: str = valued("SHARE", "Computation delay, as a share of the sample time.", "10 %")
    supply: Given = valued("VOLTAGE", "Supply voltage, the lowest (0.9 of the vehicle's).")
    hold: Given = valued(
        "DEPTH", "Allowed holding error, rms (quiet 9.5 mm, energy 5 cm; float: its band)."
    )
    runs: int = valued("N", "Runs of each case.", 200)


@grouped("law goal depth_range step depth_noise", out=Path("swimbladder-tune"))
def tune(
    vehicle: VehicleName,
    *,
    design: Design,
    sensor: DepthSensor,
    reading: CastReading,
    supervised: Supervised = True,
    to: Files,
) -> None:
    r"""Find gains of a law that meet the stability margins over the 95 % parameter region.

    The region follows from the covariance that `identify` writes, or is 5 % in K2 and T2 without
    one. Trials with sensor noise verify the gains; vehicle.toml holds the controller. Exit code 1:
    no gains meet the margins, or keep overshoot and settling time over the region; the message
    names what limits them, and the best gains stand in unproven.toml. With
    --cast the trials are in that water.
    """
    v = sensor.on(loaded(vehicle))
    options = design.read()
    depths = options["depth_range"]
    reach = depths and max(*depths, *(options["step"] or ()))
    options["cast"] = water_of_cast(reading.casts(), reach, v.hull.depth_limit)
    with working("searching gains") as advance:
        from swimbladder.design.tuning import tune as find

        found = find(v, **options, supervised=supervised, advance=advance)
    to.answer(found)


_NOISE = "2 mm"  # where neither the vehicle file nor the user says what the sensor has


class Flights(Options):
    """Which laws are flown, how often and where."""

    laws: Given = valued(
        "LAW,...",
        "Laws to compare (all that fit).",
        read=lambda text, _: [name.strip() for name in text.split(",")],
    )
    runs: int = valued("N", "Runs of each case.", 40)
    depth_range: Given = valued("LEAST:MOST", "Depth range (what stroke, supply, rating allow).")
    sample_time: Given = valued("TIME", "Sample time (the controller's).")
    seed: int = valued("N", "Seed of noise, waves, drift and draws.", 1)


class Sensor(DepthSensor):
    """The depth sensor, which has some noise."""

    depth_noise: Given = valued("DEPTH", "Depth noise, 1 sigma (the vehicle's, else 2 mm).")

    def assumed(self, vehicle: Vehicle) -> tuple[Vehicle, str]:
        """Return the vehicle with it, and in words what was assumed of it, or nothing."""
        v, known = self.on(vehicle), vehicle.identified
        if self.depth_noise or v.sensors.depth_noise > 0.0 or v.sensors.depth_quantum > 0.0:
            return v, ""
        if known is not None and known.depth_noise > 0.0:
            return Sensor(depth_noise=f"{known.depth_noise} m").on(
                vehicle
            ), "depth noise as in the logs"
        words = f"a depth sensor with {_NOISE} of noise, as none is stated (--depth-noise)"
        return Sensor(depth_noise=_NOISE).on(vehicle), words


_LIST_SCENARIOS = typer.Option("--list-scenarios", help="Print the scenarios only.")


@grouped("laws runs depth_range depth_noise", out=Path("swimbladder-compare-laws"))
def compare_laws(
    vehicle: AnyVehicle = None,
    *,
    flights: Flights,
    sensor: Sensor,
    supervised: Supervised = True,
    list_scenarios: Annotated[bool, _LIST_SCENARIOS] = False,
    reading: CastReading,
    to: Files,
) -> None:
    r"""Compare all laws on the same scenarios: settling, holding and energy.

    Each law is tuned twice, fast and quiet; the vehicle file's own controller is flown as it is.
    With --cast all of it is flown in that water.

    What is done is kept in the folder's parts/, so that a stopped comparison goes on there.
    """
    if list_scenarios:
        _list(vehicle, flights.read()["depth_range"], to, supervised=supervised)
        return
    if vehicle is None:
        raise InputError("no vehicle", field="VEHICLE", remedy="Name a preset or a TOML file")
    v, assumed = sensor.assumed(loaded(vehicle, sampled=True, pumped=True))
    options = flights.read() | {"supervised": supervised}
    reach = None if options["depth_range"] is None else options["depth_range"][1]
    options["cast"] = water_of_cast(reading.casts(), reach, v.hull.depth_limit)
    parts = to.out / "parts"
    with working("tuning and flying", keep=parts) as advance:
        from swimbladder.design.law_comparison import compare_laws

        found = compare_laws(v, **options, parts=parts, advance=advance)
    if assumed:
        found = replace(found, assumptions=(*found.assumptions, assumed))
    to.answer(found)


def _list(
    vehicle: str | None, depths: tuple[float, float] | None, to: Files, *, supervised: bool
) -> None:
    """Print the scenarios, with the depths that a vehicle gives them where one is named."""
    from swimbladder.design.law_comparison.contenders import SCENARIOS, place, scenarios_of
    from swimbladder.design.tuning.run import places

    v = None if vehicle is None else loaded(vehicle, sampled=True, pumped=True)
    flown = SCENARIOS if v is None else scenarios_of(v)
    shown: dict[str, dict[str, Any]] = {one.name: {"words": one.words} for one in flown}
    if v is not None:
        where = places(v, depths, supervised=supervised)
        for one in flown:
            p = place(one, v, where)
            shown[one.name] |= {"start_m": p.start, "target_m": p.target}
            shown[one.name]["duration_s"] = p.duration
    rows = []
    for name, fields in shown.items():
        numbers = [f"{x:.5g}" for key, x in fields.items() if key != "words"]
        rows.append((name, *numbers, fields["words"]))
    numbers = ["from [m]", "to [m]", "for [s]"] if vehicle else []
    listed = Table(("scenario", *numbers, "what"), rows, left=("scenario", "what"))
    to.show({"scenarios": shown}, [listed])


class Disturbed(Options):
    """What is looked at, as `design.stability.stability` has it."""

    depth_range: Given = valued("LEAST:MOST", "Depth range (as tuned, or 0:10 m).")
    delay: str = valued("SHARE", "Computation delay, as a share of the sample time.", "10 %")
    within: Given = valued("TIME", "Recovery time (600 s; floats: 1.5 times the way and an hour).")
    cells: int = valued("N", "Cells of a map per side.", 21)
    voltage_quantum: str = valued("VOLTAGE", "Voltage step of the motor's driver (none).", "0 V")
    maps: bool = flag("--maps/--no-maps", "Recovery maps.", True)
    robustness: bool = flag("--robustness", "Vary the gain (0.5 to 2) and the delay.")
    laws: Several = valued("LAW", "Law tuned first, for --robustness; repeatable.")
    runs: int = valued("N", "Runs of each case, for --robustness.", 200)
    supervised: bool | None = supervised()


@grouped("depth_range law robustness maps", out=Path("swimbladder-stability"))
def stability(vehicle: VehicleName, *, asked: Disturbed, to: Files) -> None:
    r"""Analyse stability under the law: small motions, limit cycles, large motions.

    Eigenvalues and margins over the 95 % parameter region; limit cycles of dead zones, quanta and
    limits, predicted and simulated; maps of what it recovers from. Maps and --robustness include
    the supervisor where the file has a table [supervisor]. Exit code 1: it is unstable; the
    parameters are named. A run that is killed resumes.
    """
    from swimbladder.io.files import unfinished

    v = loaded(vehicle)
    options = asked.given()
    keep = unfinished(to.out)
    with working("looking for what is unstable", keep=keep) as advance:
        from swimbladder.design.stability import stability as find

        found = find(v, **options, keep=keep, advance=advance)
    to.answer(found, keep=keep)


def _volumes(text: str, option: str) -> tuple[float | None, float | None]:
    """Return two changes of volume [m3], the same twice where there is one."""
    found = [quantity(part, "m3", option) for part in with_one_unit(text.split(":", 1))]
    return found[0], found[-1]


class Pool(Options):
    """The pool procedure, as `codegen.pool.PoolOptions` has it."""

    bottom_depth: Given = valued("DEPTH", "Depth of the bottom: adds the pool procedure.")
    clearance: Given = valued("LENGTH", "Distance from bottom and surface (0.75 m).")
    volume_changes: Given = valued(
        "FIRST:LAST", "Volume changes in the pool (20:75 cm3).", read=_volumes
    )
    rounds: int | None = valued("N", "Rounds in the pool (4).")

    def options(self) -> PoolOptions | None:
        """Return what is said of the pool, None where nothing is."""
        from swimbladder.codegen.pool import PoolOptions

        if self.bottom_depth is None:
            why = "it sets the pool procedure, and there is none"
            self.refuse(why, 'Give --bottom-depth, like --bottom-depth "4.5 m"')
            return None
        return PoolOptions(**self.given())


_LAW = typer.Option(metavar="LAW", help="Law that the controller has to be of.")


@grouped("law time_limit bottom_depth", out=Path("swimbladder-firmware"))
def firmware(
    vehicle: VehicleName,
    law: Annotated[str | None, _LAW] = None,
    *,
    limit: TimeLimit,
    golden: Golden,
    pool: Pool,
    to: Files,
) -> None:
    """Write the vehicle's controller as an Arduino library in C99 and float32.

    The library holds the law, a supervisor that brings the vehicle up when a fault is detected (see
    [supervisor] in the vehicle's file), sketches with two functions to fill in, and a
    golden trace: a depth step flown by the law's twin in float32, equal to the C to the last bit.
    The board of a float with pump and valve commands seconds of them (kind pump-valve).
    With --bottom-depth it also holds the pool procedure (a)-(d), which identify and pool --follow
    read.
    Exit code 1 where the controller does not bring the vehicle through that step, or the procedure
    does not come to its end on the vehicle's model.
    """
    v = limit.flashed(vehicle)
    _check_law(v, law)
    options, asked = pool.options(), golden.given()
    with working("flying the golden trace") as advance:
        from swimbladder.codegen.library import firmware as make

        made = make(v, **asked, pool=options, advance=advance)
    to.answer(made)


def _check_law(vehicle: Vehicle, law: str | None) -> None:
    """Raise InputError where the vehicle's controller is not of the law that was asked for."""
    own = None if vehicle.controller is None else vehicle.controller.law
    if law is None or law == own:
        return
    from swimbladder.control.registry import law_by_name

    law_by_name(law)
    found = "not there" if own is None else f"of the law {own!r}, and so are its parameters"
    why = f"the controller of the vehicle {vehicle.name!r} is {found}"
    remedy = f'Give a vehicle file whose [controller] has law = "{law}" and its parameters'
    raise InputError(why, field="--law", value=law, remedy=remedy)


class Line(Options):
    """Where the board is."""

    port: str = valued("PORT", "Serial port: /dev/ttyUSB0, COM3.", ...)
    baud: int | None = valued("N", "Baud rate (115200).", min=1)
    real_time: bool = flag("--real-time", "One tick per sample time, not as fast as possible.")


class More(Options):
    """What is flown beside the golden mission, as `codegen.board.Flights` has it."""

    steps: bool = flag("--steps", "Also fly steps.")
    missions: int = valued("N", "Missions with faults.", 0, min=0)
    depth_range: Given = valued("LEAST:MOST", "Depth range of these missions.")


@grouped("port time_limit missions steps", out=Path("swimbladder-board"))
def board(
    vehicle: VehicleName, *, line: Line, limit: TimeLimit, golden: Golden, more: More, to: Files
) -> None:
    """Simulate the vehicle with the C on a board at a serial port: hardware in the loop.

    The board runs the sketch HardwareInTheLoop of the library that firmware writes. It flies the
    golden mission (see firmware), steps, missions with faults (see faults), each from a board that
    is disarmed and then armed, and a reset; every command and all that the supervisor says is
    compared with the float32 twin to the bit. Needs pyserial.
    Exit code 1 where board and twin differ, or the board answers no more; the log of each flight is
    written as it grows, and stays.
    """
    v = limit.flashed(vehicle)
    given = golden.given() | more.given()
    from swimbladder.codegen.board import Flights
    from swimbladder.codegen.board import board as fly

    how, before = line.given(), _logs(to.out)
    try:
        with working("flying on the board") as advance:
            answer = fly(v, how.pop("port"), Flights(**given), **how, out=to.out, advance=advance)
    except BaseException:
        if _logs(to.out) != before:
            aside(f"the log so far is in {to.out}")
        raise
    to.answer(answer, [flight.log for flight in answer.flights])


def _logs(out: Path) -> dict[Path, int]:
    """Return the logs in a folder, and when they were written."""
    return {path: path.stat().st_mtime_ns for path in out.glob("*.csv")}


class Missions(Options):
    """Which missions are flown, as `sim.faults.faults` has it."""

    missions: int = valued("N", "Missions with faults.", 100_000)
    healthy: int | None = valued("N", "Missions without a fault (a tenth as many).")
    depth_range: Given = valued("LEAST:MOST", "Depth range of these missions.")
    seed: int = valued("N", "Seed of all random draws.", 1, min=0)


_REPEAT = typer.Option(metavar="N", help="Repeat this mission with its trajectory; hN: healthy.")


@grouped("missions healthy depth_range time_limit repeat", out=Path("swimbladder-faults"))
def faults(
    vehicle: VehicleName,
    *,
    missions: Missions,
    limit: TimeLimit,
    reading: CastReading,
    repeat: Annotated[str | None, _REPEAT] = None,
    to: Files,
) -> None:
    """Simulate the vehicle's C in missions with faults of sensors, actuator or battery.

    With --cast they are flown in that water; the C is that of the vehicle's file.

    The controller and its supervisor are compiled on this machine and flown against the plant.
    Exit code 1: a recoverable mission was lost (full buoyancy 60 s after fault onset would have
    surfaced the vehicle), or a healthy mission raised an alarm. A run that is killed resumes.
    """
    from swimbladder.io.files import unfinished

    v, asked = limit.on(loaded(vehicle)), missions.read()
    reach = None if asked["depth_range"] is None else asked["depth_range"][1]
    asked["cast"] = water_of_cast(reading.casts(), reach, v.hull.depth_limit)
    if repeat is not None:
        _one(v, repeat, asked, to)
        return
    keep = unfinished(to.out)
    with working("flying missions", keep=keep) as advance:
        from swimbladder.show.faults import FaultResultShown
        from swimbladder.sim.faults import faults as fly

        flown = fly(v, **asked, keep=keep, advance=advance)
    to.answer(FaultResultShown(flown, asked=vehicle), keep=keep)


def _one(vehicle: Vehicle, mission: str, asked: dict[str, Any], to: Files) -> None:
    """Fly one mission again and write its trajectories."""
    number = mission.removeprefix("h")
    if not (number.isascii() and number.isdigit() and len(number) < 9):
        why = "a mission is a number of eight digits at most, or one with an h before it"
        remedy = "Write it like 17, or h17 for a healthy one"
        raise InputError(why, field="--repeat", value=mission, remedy=remedy)
    how = {name: asked[name] for name in ("seed", "depth_range", "cast")}
    with working("flying the mission"):
        from swimbladder.show.faults import FlownShown
        from swimbladder.sim.faults.run import fly_one

        flown = fly_one(vehicle, int(number), healthy=mission.startswith("h"), **how)
    to.answer(FlownShown(flown))
