"""Mission n of a seed: the vehicle, the water, what is asked of it, and what fails when.

What a mission is made of, as the kernel takes it, and what it gives back: all plain floats.
"""

import math
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.supervisor_limits import (
    check_time_limit,
    cruising_speed,
    supervisor_parameters,
)
from swimbladder.design.tuning.region import member, region, unknowns
from swimbladder.errors import InputError
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import terminal_speed
from swimbladder.physics.seawater import Column
from swimbladder.physics.seawater.cast import check_cast_unit
from swimbladder.sim.closed_loop.checks import check_depths, check_dive, turned_round
from swimbladder.sim.closed_loop.water import (
    SEAS,
    Medium,
    amplitude,
    medium_of,
    share_read,
    wavenumber,
)
from swimbladder.sim.engine.modes import NO_LAYERS, Layers
from swimbladder.sim.faults.kinds import KINDS, MOTOR, On, Op, draw_fault, kinds_of, parts_of
from swimbladder.units import rounded
from swimbladder.vehicle import Vehicle


class Condition(NamedTuple):
    """What a mission is flown in."""

    end: float  # ticks of the whole mission
    tick: float  # s
    start_depth: float  # m
    start_volume: float  # m3; nan: a float's that is afloat with all volume out
    depth_noise: float  # m, 1 sigma
    depth_quantum: float  # m
    volume_noise: float  # m3, 1 sigma
    volume_quantum: float  # m3
    battery_noise: float  # 1 sigma, as a share of the voltage
    full: float  # V, m3, or s of the pump, of full buoyancy
    ramp: float  # m that the depth asked for goes in a tick towards the set-point
    drift: float  # m3/s, of the neutral volume
    swell: float  # m3, amplitude of the volume that would pull as the swell does at the surface
    swell_omega: float  # rad/s
    swell_phase: float  # rad
    gravity: float  # m/s2
    leak_input: float  # m3 of water in the hull at which the leak input speaks; inf: it has none
    brown_out: float  # V under which the board stops; 0: it does not depend on this supply
    boot: float  # ticks from a reset until the first tick
    band: float  # m under the surface that count as being there
    rated: float  # m, inf: not stated
    stay: float  # ticks at the surface after which it has stayed there; less below it is bobbing
    quiet_at: float  # tick after which nothing more is asked or fails
    full_after: float  # ticks from the first fault on to full buoyancy, where that is asked for
    seed: float  # of the noise, a whole number below 2^32


class Wave(NamedTuple):
    """A wave of the sea, of which the depth's sensor reads amplitude exp(-k z) cos(w t + phase)."""

    amplitude: float  # m, at the surface
    k: float  # 1/m
    omega: float  # rad/s
    phase: float  # rad


class FaultRow(NamedTuple):
    """A fault as the kernel takes it; kind 0: none."""

    kind: float
    first: float  # severity
    second: float
    begin: float  # tick
    end: float  # tick


class Result(NamedTuple):
    """How a mission ended."""

    stop: float = 0.0  # why the plant stopped, see engine.advance; 0: it did not
    last: float = math.nan  # tick that it ended at
    arrived: float = math.nan  # tick since which it bobs at the surface; nan: it is not there
    beyond: float = math.nan  # tick at which it passed the depth it is rated for; nan: never
    bottom: float = 0.0  # 1: it lies on the bottom at the end
    depth: float = math.nan  # m, at the end
    deepest: float = math.nan  # m
    latched: float = math.nan  # tick at which the supervisor first gave a reason; nan: never
    reason: float = 0.0  # code of that reason
    released: float = math.nan  # tick at which it asked for the release of a weight; nan: never
    resets: float = 0.0  # of the board
    acting: float = math.nan  # tick at which the first fault began to act; nan: none did
    up: float = math.nan  # tick at which it first was at the surface, as asked for; nan: never
    filled: float = -1.0  # 1: heavy with all its volume out since it was there last; 0, -1: not


class Trace(NamedTuple):
    """A row of a mission's record, at a tick."""

    depth: float  # m
    speed: float  # m/s
    volume: float  # m3
    command: float  # V or m3, of the board
    applied: float  # V or m3, what the actuator got
    battery: float  # V, at the board
    reference: float  # m
    depth_seen: float  # m
    depth_age: float  # s
    volume_seen: float  # m3
    leak_seen: float  # 1: the leak input speaks
    lost_ticks: float  # since the last tick of the board
    board: float  # 0: it ran this tick; 1: it missed it; 2: it was off
    reason: float  # code, 0: none
    water: float  # m3 that leaked in


def record_type(kind: type[Any]) -> np.dtype[np.void]:
    """Return the record of a named tuple of floats, for kernels."""
    return np.dtype([(name, np.float64) for name in kind._fields])


RESULT = Result(*range(len(Result._fields)))
TRACE = {name: index for index, name in enumerate(Trace._fields)}


SHALLOWEST, SHALLOWEST_DIVE = 1.0, 10.0  # m under the surface; of a float that dives from there
RESERVE = 0.9  # of the depth at which the supervisor turns the vehicle round
DURATION, DIVE = 1200.0, 7200.0  # s until it is commanded to come up; of a float from its arrival
STAY = 60.0  # s at the surface
STEP, STEP_SHARE = 10.0, 0.05  # m, largest change of a set-point; of the deepest, where more
RAMP = 0.1  # m/s, at which the depth asked for goes to a set-point; a fifth of the speed at most
UP = -1.0  # m from where the hull emerges: the set-point that ends a mission
DEEP = 0.75  # of the missions begin anywhere in the range, the others rather at its top
TOGETHER = 0.5  # of the missions have two faults
SECOND_WITHIN = 30.0  # s after the first
RECOVERY = 60.0  # s from when the faults act to the full buoyancy that defines what is recoverable
SLACK, DIVE_SLACK = 180.0, 3600.0  # s, for coming up
WAY_SHARE = 1.5  # that the ways of a float take longer than at its law's speed: it slows down
SETTLE = 30.0  # s before anything may fail
LATEST, LATEST_DIVE = 0.25, 0.6  # of the duration, of the first onset: it has longer to act
REACHES = 3.0  # m, of a depth that drifts before the mission ends, where the time limit lets it
BOOT = 2.0  # s that the board needs from a reset to its first tick
DRIFT = 1000.0  # s, in which trim drifts by what is not known of it; half a mission at least
SWELL = 0.005  # of the stroke, the least; ten times as much the most
BAND = 1.0  # m under the surface: a hull bobs in the swell
BROWN_OUT = 0.45  # of the nominal supply; a 5 V regulator under a 12 V battery
MISSTATED, COARSE = 4.0, 5e-3  # times the noise; m
WAVES = len(SEAS[0].periods)  # that a sea is made of
HEIGHTS = (1.0, 2.0, 10.0), (0.5, 1.0, 2.5)  # m: of the highest seas, by a mission's least depth
LOW_SUPPLY = 0.9  # of the nominal one, as tune assumes


class Range(NamedTuple):
    """The depths [m] of the missions of a vehicle, and what sets the greatest."""

    least: float
    most: float
    limit: str


@dataclass(frozen=True, kw_only=True)
class Mission:
    """A mission as the kernel takes it, times in s."""

    number: int
    faults: tuple[int, ...]  # of `kinds.KINDS`
    plant: Array  # [len(Plant)]
    condition: Condition
    fault_rows: Array  # [faults, len(FaultRow)]
    turns: Array  # ticks
    depths: Array  # m
    layers: Layers = NO_LAYERS  # of the water
    drive: tuple[float, float] = (1.0, 1.0)  # of a float: pump and valve over what is known
    waves: Array = field(default_factory=lambda: np.zeros((WAVES, len(Wave._fields))))


class Course(NamedTuple):
    """What all missions of a vehicle have in common."""

    vehicle: Vehicle  # with the supervisor's time limit
    depths: Range
    neutral: float  # m3, how far the neutral volume may be from what is known
    speed: float  # m/s, of full buoyancy half way up from the deepest
    ramp: float  # m/s, at which the depth asked for goes to a set-point
    medium: Medium  # the vehicle in the water
    column: Column | None  # the water; None: the vehicle's own

    @property
    def tick(self) -> float:
        """The controller's sample time [s]."""
        return _tick(self.vehicle)

    @property
    def floats(self) -> bool:
        """Whether it has pump and valve, and begins at the surface."""
        return self.vehicle.command == "volume change"

    def way(self, depth: float) -> float:
        """Return the time [s] that it has to get to a depth [m]: none to where it starts."""
        return WAY_SHARE * depth / self.ramp if self.floats else 0.0

    @property
    def water(self) -> str | None:
        """The water of a cast; None: the vehicle's own."""
        return None if self.column is None else self.column.source

    @property
    def rise(self) -> float:
        """The way [m] from the deepest to where a mission ends."""
        return self.depths.most - self.medium.plant.z_surface - UP

    @property
    def takes(self) -> float:
        """Time [s] that the longest mission takes, without what comes up slowly at its end."""
        if self.floats:
            return DIVE + 2.0 * WAY_SHARE * self.rise / self.ramp
        return DURATION + self.rise / self.ramp

    @property
    def slack(self) -> float:
        """Time [s] beyond that for coming up."""
        return DIVE_SLACK if self.floats else SLACK

    @property
    def time_limit(self) -> float:
        """Time [s] after which the supervisor brings the vehicle up."""
        limit = self.vehicle.supervisor.time_limit
        assert limit is not None
        return limit

    @property
    def end(self) -> float:
        """Time [s] at which a mission is over, come up or not."""
        return self.time_limit + self.slack + 3.0 * self.rise / self.speed


def course_of(
    vehicle: Vehicle, depths: tuple[float, float] | None, column: Column | None = None
) -> Course:
    """Return what the missions of a vehicle have in common; depths [m] as asked for, or its own.

    column: the water, the vehicle's own where not given; its supervisor is that of its file.
    A float dives from the surface; its law's speed is that of its ways.
    Raises InputError where the supervisor has no time limit or a shorter one than the missions
    take, where the depths are not given and nothing limits them, where the supervisor
    would not let the vehicle go there, and where the water ends above or the stroke does not reach
    the neutral volume in it.
    """
    floats = vehicle.command == "volume change"
    shallowest = SHALLOWEST_DIVE if floats else SHALLOWEST
    where = _range_of(vehicle, vehicle.hull.emergence_depth + shallowest, depths)
    if column is not None and column.cast is not None:
        check_cast_unit(column.cast, where.most, vehicle.hull.depth_limit)
    medium = medium_of(vehicle, column, reach=where.most)
    try:
        check_depths(vehicle, medium, setpoints=where[:2], start_depth=None)
    except InputError as error:
        raise error.but(field="depth_range") from None
    if floats:
        check_dive(vehicle)
    speed = _rise_speed(medium, where.most)
    ramp = min(cruising_speed(vehicle) if floats else RAMP, speed / 5.0)
    found = Course(vehicle, where, region(vehicle).neutral, speed, ramp, medium, column)
    takes = found.takes
    check_time_limit(vehicle, f". These missions take {rounded(takes + found.slack, 3)} s with it")
    if found.time_limit < takes:
        what = f"the missions take {takes:.0f} s and would be cut short"
        remedy = "Give more, or ask for less `depth_range=`"
        field = "supervisor.time_limit"
        raise InputError(what, field=field, value=found.time_limit, unit="s", remedy=remedy)
    return found


def _tick(vehicle: Vehicle) -> float:
    assert vehicle.controller is not None  # own_law
    return vehicle.controller.sample_time


def _range_of(vehicle: Vehicle, least: float, depths: tuple[float, float] | None) -> Range:
    limit = supervisor_parameters(vehicle, _tick(vehicle)).deep.depth_limit
    refused = partial(InputError, field="depth_range")
    if depths is not None:
        if not (least <= depths[0] < depths[1]):
            what = f"the missions need depths that grow, from {least:g} m on"
            asked, remedy = f"{depths[0]:g}:{depths[1]:g}", 'Write it like "1:40 m"'
            raise refused(what, value=asked, unit="m", remedy=remedy)
        if depths[1] > limit:
            raise turned_round(depths[1], limit, "depth_range")
        return Range(*depths, "as asked")
    if not math.isfinite(limit):
        remedy = 'Say how deep it goes, like "1:40 m", or give hull.depth_limit'
        raise refused("nothing of this vehicle limits the depth of its missions", remedy=remedy)
    if RESERVE * limit <= least:
        what = f"the supervisor turns the vehicle round at {limit:.3g} m: too shallow for a mission"
        remedy = "Check hull.psi, the stroke, the supply and the rated depth"
        raise InputError(what, field="supervisor.depth_limit", remedy=remedy)
    words = f"{RESERVE:.0%} of the supervisor's {limit:.4g} m"
    if vehicle.hull.depth_limit is None and vehicle.supervisor.depth_limit is None:
        words += (
            ", from stroke and motor: no rating is stated, give hull.depth_limit or `depth_range=`"
        )
    return Range(least, RESERVE * limit, words)


def draw(course: Course, *, seed: int, number: int, healthy: bool) -> Mission:
    """Return mission `number` of a seed; it depends on these and the course only."""
    seeds = np.random.SeedSequence([seed, int(healthy), number])
    random = np.random.Generator(np.random.Philox(seeds))
    tick = course.tick
    p, drive = _plant(course, random)
    turns, targets = _set_points(course, p["z_surface"], random)
    if random.random() < 0.5:
        p["z_bottom"] = max(targets[:-1]) + random.uniform(1.0, 50.0)
    faults: tuple[int, ...] = ()
    fault_rows: list[FaultRow] = []
    times: list[float] = []
    if not healthy:
        kinds = kinds_of(course.vehicle)
        faults = (kinds[number % len(kinds)],)
        latest = LATEST_DIVE if course.floats else LATEST
        times.append(random.uniform(SETTLE, latest * turns[-1]))
        if random.random() < TOGETHER:
            others = [k for k in kinds if k != faults[0]]
            faults = (*faults, others[random.integers(len(others))])
            times.append(times[0] + random.uniform(0.0, SECOND_WITHIN))
        for fault, time in zip(faults, times, strict=True):
            first, second, lasts = draw_fault(fault, random)
            begin = 0.0 if KINDS[fault].from_start else math.ceil(time / tick)
            end = begin + max(1.0, round(lasts / tick)) if math.isfinite(lasts) else math.inf
            fault_rows.append(FaultRow(float(fault), first, second, begin, end))
    latest = turns[-1] + course.time_limit - course.takes
    turns[-1] = min(max([turns[-1], *(reached(row, tick) for row in fault_rows)]), latest)
    quiet = max([turns[-1], *times])
    condition = _condition(course, p, random, start=targets[0], quiet=quiet)
    return Mission(
        number=number,
        faults=faults,
        plant=np.array(list(p.values())),
        condition=_misstated(course, condition, random),
        fault_rows=np.array(fault_rows, float).reshape(-1, len(FaultRow._fields)),
        turns=np.ceil(np.array(turns) / tick),
        depths=np.array(targets),
        waves=_waves(course, random, nearest=min(targets[:-1])),
        layers=course.medium.layers,
        drive=drive,
    )


def reached(row: FaultRow, tick: float) -> float:
    """Return when a fault's drift of the depth is as far as a mission waits for [s]; else 0."""
    kind = KINDS.get(int(row.kind))
    if kind is None or (kind.on, kind.op) != (On.DEPTH, Op.PLUS_RATE):
        return 0.0
    time = row.begin * tick + REACHES / abs(row.first)
    return time if time < row.end * tick else 0.0


def _plant(
    course: Course, random: np.random.Generator
) -> tuple[dict[str, float], tuple[float, float]]:
    """Return a vehicle of the region, its trim within what is not known, its battery not full.

    And what its pump and its valve give of what is known.
    """
    vehicle = course.vehicle
    names, ball = unknowns(vehicle)
    n = len(names)
    if ball:
        s = random.normal(size=n)
        s *= random.random() ** (1.0 / n) / np.linalg.norm(s)
    else:
        s = random.uniform(-1.0, 1.0, n)
    one = member(vehicle, s)
    p = course.medium.of(one.plant)._asdict()
    if course.floats:  # that is a piston as slow as its pump
        p["positioner"] = 0.0
        p["supply"] = 1.0 if vehicle.supply is None else vehicle.supply.voltage
    p["V_0"] += random.uniform(-1.0, 1.0) * course.neutral
    p["supply"] *= random.uniform(LOW_SUPPLY, 1.0)
    return p, one.drive


def _misstated(course: Course, c: Condition, random: np.random.Generator) -> Condition:
    """Return a condition whose depth sensor is not what the file says, in three of four missions.

    Quieter or noisier than stated by up to a factor, or with a quantum that is not stated.
    """
    kind, factor = int(random.integers(4)), MISSTATED ** random.random()
    stated = course.vehicle.sensors
    if stated.depth_noise > 0.0 and kind < 2:
        return c._replace(depth_noise=c.depth_noise * (factor if kind else 1.0 / factor))
    if (stated.depth_noise > 0.0 or stated.depth_quantum > 0.0) and kind == 2:
        return c._replace(depth_quantum=max(c.depth_quantum, COARSE))
    return c


def _waves(course: Course, random: np.random.Generator, *, nearest: float) -> Array:
    """Return the waves of the sea that a mission is flown in [WAVES, len(Wave)]: half have none.

    nearest [m]: to the surface, of its set-points. A float begins there, where no team launches in
    more than half of that.
    """
    rough, height = random.random() < 0.5, random.random()
    swell, phases = random.random() < 0.5, random.uniform(0.0, 2.0 * math.pi, WAVES)
    most = float(np.interp(nearest, *HEIGHTS)) if not course.floats else 0.5 * HEIGHTS[1][-1]
    if not rough:
        return np.zeros((WAVES, len(Wave._fields)))
    sea = SEAS[0 if swell else 1]._replace(height=height * most)
    g, hull = course.vehicle.water.gravity, course.vehicle.hull
    found = []
    for period, phase in zip(sea.periods, phases.tolist(), strict=True):
        k = wavenumber(period, g)
        read = amplitude(sea) * share_read(k, hull)
        found.append(Wave(read, k, 2.0 * math.pi / period, phase))
    return np.array(found)


def _set_points(
    course: Course, surface: float, random: np.random.Generator
) -> tuple[list[float], list[float]]:
    """Return (times [s], depths [m]): one to four depths, then up."""
    least, most, _ = course.depths
    if random.random() < DEEP:
        z = random.uniform(least, most)
    else:
        z = least * (most / least) ** random.random() if least > 0.0 else random.uniform(0, most)
    stays, step, up = DURATION, STEP, surface + UP
    if course.floats:
        stays, step, up = DIVE, max(STEP, STEP_SHARE * most), min(UP, surface + UP)
    end = course.way(z) + stays
    times, targets, at = [0.0], [z], course.way(z)
    for _ in range(int(random.integers(0, 4))):
        at += random.uniform(60.0, stays / 3.0)
        z = min(max(z + random.uniform(-step, step), least), most)
        times.append(at)
        targets.append(z)
    return [*times, end], [*targets, up]


def _rise_speed(medium: Medium, depth: float) -> float:
    """Return the terminal speed [m/s] of full buoyancy half way up from a depth [m]."""
    p = medium.plant
    lift = p.V_max - p.V_0 - 0.5 * p.psi * depth - medium.layers.at(0.5 * depth)
    return terminal_speed(p, p.a_b * max(lift, 0.05 * (p.V_max - p.V_min)))


def _condition(
    course: Course, p: dict[str, float], random: np.random.Generator, *, start: float, quiet: float
) -> Condition:
    """Return what a mission of the plant p is flown in, from its rest at a depth [m].

    quiet [s]: after which nothing more is asked or fails.
    """
    vehicle, tick, floats = course.vehicle, course.tick, course.floats
    least, most = vehicle.stroke.minimum, vehicle.stroke.maximum
    rest = p["psi"] * start + p["V_0"] + course.medium.layers.at(start)
    full = p["supply"] if vehicle.voltage_driven else p["V_max"]
    stroke, sensors = most - least, vehicle.sensors
    noise = 0.5e-3 * 10.0 ** random.random()
    quantum = (0.0, 1e-3, 5e-3)[random.integers(3)]
    volume_noise = 1e-4 * stroke * random.random()
    if sensors.depth_noise > 0.0 or sensors.depth_quantum > 0.0:  # it is known
        noise, quantum = sensors.depth_noise, sensors.depth_quantum
    volume_noise = sensors.volume_noise or volume_noise
    rough = random.random() < 0.5
    swell, period = SWELL * stroke * 10.0 ** random.random(), random.uniform(5.0, 12.0)
    phase = random.uniform(0.0, 2.0 * math.pi)
    has_input = random.random() < 0.5
    threshold = random.uniform(2e-6, 20e-6)
    supply = 0.0 if vehicle.supply is None else vehicle.supply.voltage
    limit = vehicle.hull.depth_limit
    noisy = 0.005 if vehicle.supply is not None else math.nan  # what is not measured is nan
    return Condition(
        end=math.ceil(course.end / tick),
        tick=tick,
        start_depth=0.0 if floats else start,
        start_volume=math.nan if floats else min(max(rest, least), most),
        depth_noise=noise,
        depth_quantum=quantum,
        volume_noise=volume_noise,
        volume_quantum=sensors.volume_quantum,
        battery_noise=noisy,
        full=tick if floats else full,
        ramp=math.inf if floats else course.ramp * tick,
        drift=random.uniform(-1.0, 1.0) * course.neutral / max(DRIFT, 0.5 * course.time_limit),
        swell=swell if rough else 0.0,
        swell_omega=2.0 * math.pi / period,
        swell_phase=phase,
        gravity=(vehicle.water if course.column is None else course.column).gravity,
        leak_input=threshold if has_input else math.inf,
        brown_out=BROWN_OUT * supply if MOTOR in parts_of(vehicle) else 0.0,
        boot=math.ceil(BOOT / tick),
        band=BAND,
        rated=math.inf if limit is None else limit,
        stay=STAY / tick,
        quiet_at=math.ceil(quiet / tick),
        full_after=math.ceil(RECOVERY / tick),
        seed=float(random.integers(2**32)),
    )
