"""The catalogue of faults, `kinds.toml`: what may fail, how badly, and how it is drawn.

What faults do to sensors, plant, battery and driver: the compiled parts of a flight.

`act` makes factors and summands of the faults of a mission, `fault_rows` [faults, len(FaultRow)],
at a tick k; `kinds.EFFECTS` says which. The others apply them. Random numbers come from the
generator that compiled code has in each thread; a flight seeds it.
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from swimbladder.physics.arrays import Array
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.sensor import quantised
from swimbladder.vehicle import DatasheetPump, PumpAndValve, Vehicle


class On(IntEnum):
    """What a fault acts on; the kernels hold a factor and a summand for each, see `Op`."""

    DEPTH = 0  # m, that the sensor measures
    NOISE = 1  # m, 1 sigma, in the depth beyond its own
    READS = 2  # m, in the place of the depth
    LATE = 3  # s, by which it comes late; factor 0: the driver says so
    OLD = 4  # s, after which a new one comes; factor 0: none does
    DROPOUTS = 5  # share of depths that is measured
    DEPTH_MISSING = 6
    VOLUME = 7  # strokes, that the sensor measures
    VOLUME_OLD = 8
    VOLUME_MISSING = 9
    SPEED = 10  # of the actuator; of a pump, what it delivers
    LOAD = 11  # of a metre of depth, on the motor
    BLOCK_OUT = 12  # strokes from where the actuator is
    BLOCK_IN = 13
    COMMAND = 14  # as the driver takes it; summand: all in the direction that it last had
    SWITCH_IN = 15  # where limit switches cut: 1 everywhere, -1 nowhere
    SWITCH_OUT = 16
    VALVE = 17  # what valves let in that are open
    OPEN = 18  # share of it that comes in through one that is shut
    CHARGE = 19  # the battery's open-circuit voltage
    CELL = 20  # the same, while the motor is driven
    SAG = 21  # the battery's resistance over the motor's
    TICKS = 22  # share that comes
    PAUSE = 23
    RESET = 24
    HANG = 25  # s
    WATER = 26  # m3/s that come in
    OPEN_RUNNING = 27  # as OPEN, while the pump runs
    PORT_OUT = 28  # flow of the port outward; what is closed of it adds to the load
    PORT_IN = 29
    CREEP = 30  # strokes/(m s), by which the pressure drives the actuator in
    SLIP = 31  # share of the motion outward that the volume sensor misses; below 0: inward
    WEIGHT = 32  # strokes, that the neutral volume is larger by
    CLOCK = 33  # share by which the board's ticks come too often
    FLIP = 34  # 0: a bit of what the board remembers flips
    ASKED = 35  # m, in the place of the depth asked for; 0: not a number
    WAITS = 36  # 0: the law wants to wait for ever, which is no command


class Op(IntEnum):
    """How: what was a x + b becomes f (a x + b) + s by a factor f and a summand s."""

    PLUS = 0  # s is the severity
    PLUS_RATE = 1  # times the time since it began
    TIMES = 2  # f is the severity
    MORE = 3  # 1 and the severity
    LESS = 4  # 1 less the severity
    FALLS = 5  # 1 less the severity times the time since it began
    DIES = 6  # 1 less that time over the severity
    OFF = 7  # 0
    TURNS = 8  # -1
    RUNS = 9  # 0, with an s of 1, for as long as the severity
    SAYS = 10  # 0 where the second severity is above 0.5, with s as PLUS
    ONCE = 11  # 0 where it begins, with s as PLUS
    DUTY = 12  # 0 for the severity [s], 1 for the second one, and so on
    EVERY = 13  # 0 each time so long [s] has passed
    CUTS = 14  # s is 1, on the next thing in `On` from a severity of 0.5 on
    NEVER_CUTS = 15  # the same, -1
    SETTLES = 16  # s goes to the severity within a time constant, the second one


@dataclass(frozen=True, kw_only=True)
class Range:
    """What a severity is drawn from: evenly, or evenly in its logarithm; of either sign or not."""

    least: float
    most: float
    unit: str
    log: bool = True
    either: bool = False

    def draw(self, random: np.random.Generator) -> float:
        """Return one severity, in SI."""
        share = random.random()
        sign = -1.0 if random.random() < 0.5 and self.either else 1.0
        if self.log:
            return float(sign * self.least * (self.most / self.least) ** share)
        return float(sign * (self.least + (self.most - self.least) * share))


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of fault: its name in tables, its family, what it does and its severities."""

    name: str
    family: str
    words: str
    on: On
    op: Op
    also: On | None = None  # a second thing that it acts on in the same way
    why: str = ""  # the severities have this range
    first: Range | None = None
    second: Range | None = None
    may_end: bool = True  # one in seven lasts for 5 to 300 s only
    from_start: bool = False  # it is there when the mission begins
    needs: str = ""  # what a vehicle has to have, of `parts_of`

    def size(self, severity: float) -> str:
        """Return a severity as a reader has it; empty where the kind has none."""
        return "" if self.first is None else f"{severity:.3g} {self.first.unit}".rstrip()


MOTOR, SWITCHES, VALVE = "a motor on a battery", "limit switches", "a pump and a valve"
VOLUME, TURNS = "a measured volume", "a drive that can turn the other way"
DRIVEN_BACK = "a motor that the pressure drives back"


def _kind(row: dict[str, Any]) -> Kind:
    """Return a kind as a table of the catalogue has it."""
    made: dict[str, Any] = {end: Range(**row[end]) for end in ("first", "second") if end in row}
    made |= {name: On[row[name]] for name in ("on", "also") if name in row}
    made |= {"op": Op[row["op"]]}
    return Kind(**row | made)


_CATALOGUE = files("swimbladder.sim.faults").joinpath("kinds.toml").read_text("utf-8")
_TABLES = tomllib.loads(_CATALOGUE)
FAULTS: Mapping[str, int] = {name: number for number, name in enumerate(_TABLES, 1)}
"""Number of a kind of fault in the kernel, by its name in the catalogue."""
KINDS: Mapping[int, Kind] = dict(enumerate(map(_kind, _TABLES.values()), 1))
EFFECTS = np.array(
    [(-1, -1, -1), *((k.on, k.op, -1 if k.also is None else k.also) for k in KINDS.values())]
)
"""What a kind of fault acts on, how, and on what else, by its number, for the kernels."""

_ENDS, _LASTS = 0.15, Range(least=5.0, most=300.0, unit="s")


def parts_of(vehicle: Vehicle) -> frozenset[str]:
    """Return what a vehicle has, of what kinds of faults may need."""
    a = vehicle.engine
    if isinstance(a, PumpAndValve):
        return frozenset({VALVE, MOTOR} if isinstance(a.pump, DatasheetPump) else {VALVE})
    parts = {VOLUME, TURNS}
    if vehicle.voltage_driven:
        parts |= {MOTOR, DRIVEN_BACK}
        if vehicle.stroke.switch_margin is not None:
            parts.add(SWITCHES)
    return frozenset(parts)


def kinds_of(vehicle: Vehicle) -> tuple[int, ...]:
    """Return the numbers of the kinds of faults that a vehicle can have."""
    parts = {"", *parts_of(vehicle)}
    return tuple(fault for fault, kind in KINDS.items() if kind.needs in parts)


def not_drawn(vehicle: Vehicle) -> dict[str, list[str]]:
    """Return the names of the kinds that a vehicle cannot have, by what it does not have."""
    parts, found = {"", *parts_of(vehicle)}, dict[str, list[str]]()
    for kind in KINDS.values():
        if kind.needs not in parts:
            found.setdefault(kind.needs, []).append(kind.name)
    return found


def draw_fault(fault: int, random: np.random.Generator) -> tuple[float, float, float]:
    """Return (severity, second severity, how long it lasts [s]) of a kind of fault."""
    kind = KINDS[fault]
    first = kind.first.draw(random) if kind.first is not None else 0.0
    second = kind.second.draw(random) if kind.second is not None else 0.0
    ends, lasts = random.random() < _ENDS, _LASTS.draw(random)
    return first, second, lasts if ends and kind.may_end else math.inf


_KIND, _FIRST, _SECOND, _BEGIN, _END = range(5)
MOST = 4  # faults of a mission
_DEPTH, _DEPTH_AT, _VOLUME, _VOLUME_AT, _LOOSE, _FLOWS, _FROM, _SLIPPED, _BLOCKED = range(9)
_ACTED = _BLOCKED + MOST  # from these two on a number for each fault
NOTHING_KEPT = np.zeros(_ACTED + MOST)
"""What is kept from tick to tick, at the start."""
NOTHING_KEPT[[_DEPTH_AT, _VOLUME_AT]] = -math.inf
NOTHING_KEPT[_FROM] = math.nan
_HELD_BACK = 1.0  # s on end, that a block stops the actuator before it counts as acting
_ROUNDS = 8  # in which the current through a battery's resistance settles
_TOUCHES = 1e-12  # of the stroke, so near a block the actuator is at it
_FLOWING = 0.01  # of the supply, or of the stroke: a smaller command sets no flow in motion
_SLOWEST, _FASTEST = -0.9, 1.0  # by which a clock is off

BLOCKED_OUT, BLOCKED_IN = FAULTS["BLOCKED_OUT"], FAULTS["BLOCKED_IN"]


@part
def act(fault_rows: Array, k: int, tick: float, q: Array) -> None:
    """Fill q [len(On), 2] with the factors and summands of the faults at tick k."""
    q[:, 0], q[:, 1] = 1.0, 0.0
    for n in range(fault_rows.shape[0]):
        begin, first = fault_rows[n, _BEGIN], fault_rows[n, _FIRST]
        if not begin <= k < fault_rows[n, _END]:
            continue
        kind = int(fault_rows[n, _KIND])
        on, op = EFFECTS[kind, 0], EFFECTS[kind, 1]
        since = (k - begin) * tick
        f, s = 1.0, 0.0
        if op in (Op.PLUS, Op.SAYS, Op.ONCE):
            s = first
        elif op == Op.PLUS_RATE:
            s = first * since
        elif op == Op.TIMES:
            f = first
        elif op == Op.MORE:
            f = 1.0 + first
        elif op == Op.LESS:
            f = 1.0 - first
        elif op == Op.FALLS:
            f = max(0.0, 1.0 - first * since)
        elif op == Op.DIES:
            f = max(0.0, 1.0 - since / first)
        elif op == Op.TURNS:
            f = -1.0
        elif op == Op.RUNS and since < first:
            f, s = 0.0, 1.0
        elif op == Op.SETTLES:
            s = first * (1.0 - math.exp(-since / fault_rows[n, _SECOND]))
        elif op in (Op.CUTS, Op.NEVER_CUTS):
            on += 1 if first >= 0.5 else 0
            s = 1.0 if op == Op.CUTS else -1.0
        if (
            op == Op.OFF
            or (op == Op.SAYS and fault_rows[n, _SECOND] > 0.5)
            or (op == Op.ONCE and k == begin)
            or (op == Op.DUTY and since % (first + fault_rows[n, _SECOND]) < first)
            or (op == Op.EVERY and (k - begin) % max(1.0, math.floor(first / tick)) == 0.0)
        ):
            f = 0.0
        for what in (on, EFFECTS[kind, 2]):
            if what >= 0:
                q[what, 0], q[what, 1] = f * q[what, 0], f * q[what, 1] + s


@part
def _held(kept: Array, at: int, old: Array, x: float, k: int, tick: float) -> tuple[float, float]:
    """Return a value that stays for so long or for good, and its age [s]; see `On.OLD`.

    kept[at], kept[at + 1]: the value that stays, and the tick that it is of.
    """
    if old[0] == 1.0 and old[1] == 0.0:
        kept[at + 1] = -math.inf
        return x, 0.0
    age = (k - kept[at + 1]) * tick
    if age == math.inf or (old[0] != 0.0 and age >= old[1]):
        kept[at], kept[at + 1], age = x, k, 0.0
    return kept[at], (age if old[1] > 0.0 else 0.0)


@part
def see_depth(
    q: Array, k: int, tick: float, depth: float, quantum: float, kept: Array, late: Array
) -> tuple[float, float]:
    """Return (depth [m], its age [s]) as the driver gives them, of what the sensor measured.

    late [n]: what was seen before; late[k % n] is written.
    """
    depth = q[On.DEPTH, 0] * depth + q[On.DEPTH, 1]
    if q[On.NOISE, 1] > 0.0:
        depth += q[On.NOISE, 1] * np.random.normal()  # noqa: NPY002
    depth = quantised(depth, quantum)
    late[k % late.shape[0]] = depth
    age = 0.0
    if q[On.LATE, 1] > 0.0:
        behind = min(int(q[On.LATE, 1] / tick), late.shape[0] - 1, k)
        depth = late[(k - behind) % late.shape[0]]
        age = behind * tick if q[On.LATE, 0] == 0.0 else 0.0
    if q[On.READS, 1] != 0.0:
        depth = q[On.READS, 1]
    depth, older = _held(kept, _DEPTH, q[On.OLD], depth, k, tick)
    missing = q[On.DEPTH_MISSING, 0] == 0.0
    if q[On.DROPOUTS, 0] < 1.0 and np.random.random() >= q[On.DROPOUTS, 0]:  # noqa: NPY002
        missing = True
    return (math.nan if missing else depth), age + older


@part
def slipped(q: Array, volume: float, kept: Array) -> float:
    """Return what a sensor of the volume is off by [m3] that has missed some of its motion."""
    moved, share = volume - kept[_FROM], q[On.SLIP, 1]
    kept[_FROM] = volume
    if moved * share > 0.0:
        kept[_SLIPPED] -= abs(share) * moved
    return float(kept[_SLIPPED])


@part
def see_volume(
    q: Array, k: int, tick: float, volume: float, quantum: float, stroke: float, kept: Array
) -> float:
    """Return the volume [m3] as the driver gives it; stroke: from end to end [m3]."""
    volume = quantised(volume + q[On.VOLUME, 1] * stroke, quantum)
    volume, _ = _held(kept, _VOLUME, q[On.VOLUME_OLD], volume, k, tick)
    return volume if q[On.VOLUME_MISSING, 0] != 0.0 else math.nan


@part
def changes(fault_rows: Array, k: int) -> bool:
    """Return whether a fault begins or ends at this tick."""
    for n in range(fault_rows.shape[0]):
        if fault_rows[n, _BEGIN] == k or fault_rows[n, _END] == k:
            return True
    return False


@part
def acted(
    base: Array, p: Array, fault_rows: Array, k: int, tick: float, engine_volume: float, kept: Array
) -> int:
    """Return how many faults have acted by tick k: a block once it has stopped the actuator.

    Noise alone makes a piston touch a block, for a tick, that it is not held back by.

    engine_volume [m3]: the volume as the limits in p count it, see `flight`.
    """
    stroke = base[modes.V_MAX] - base[modes.V_MIN]
    narrow = p[modes.V_MAX] - p[modes.V_MIN] < (1.0 - 1e-9) * stroke
    count = 0
    for n in range(fault_rows.shape[0]):
        if fault_rows[n, _BEGIN] <= k < fault_rows[n, _END] and kept[_ACTED + n] == 0.0:
            kind = int(fault_rows[n, _KIND])
            acts = True
            if kind == BLOCKED_OUT:
                acts = narrow and engine_volume >= p[modes.V_MAX] - _TOUCHES * stroke
            elif kind == BLOCKED_IN:
                acts = narrow and engine_volume <= p[modes.V_MIN] + _TOUCHES * stroke
            kept[_BLOCKED + n] = kept[_BLOCKED + n] + 1.0 if acts else 0.0
            long = kept[_BLOCKED + n] * tick >= _HELD_BACK
            if long or (acts and kind not in (BLOCKED_OUT, BLOCKED_IN)):
                kept[_ACTED + n] = 1.0
        if kept[_ACTED + n] == 1.0:
            count += 1
    return count


@part
def _let_through(base: Array, p: Array, q: Array, kept: Array) -> None:
    """Set the speed and the load of the plant p for the way that its port lets the flow go."""
    share, load = q[On.PORT_IN, 0], 1.0
    if kept[_FLOWS] >= 0.0:
        share = q[On.PORT_OUT, 0]
        load = 2.0 - share
    for n in (modes.GAIN, modes.RATE):
        p[n] = base[n] * q[On.SPEED, 0] * share
    for n in (modes.LOAD_DRIVE, modes.LOAD_BACK):
        p[n] = base[n] * q[On.LOAD, 0] * load


@part
def turn_flow(base: Array, p: Array, q: Array, effort: float, kept: Array) -> bool:
    """Turn the flow through a throttled port the way that it is driven; return whether it turned.

    effort: what is commanded beyond what holds the actuator, over the supply or the stroke.
    """
    if abs(effort) <= _FLOWING or effort * kept[_FLOWS] > 0.0:
        return False
    kept[_FLOWS] = math.copysign(1.0, effort)
    if q[On.PORT_OUT, 0] == 1.0 and q[On.PORT_IN, 0] == 1.0:
        return False
    _let_through(base, p, q, kept)
    return True


@part
def change_plant(base: Array, p: Array, q: Array, volume: float, shift: float, kept: Array) -> None:
    """Set what faults change in the plant p of the healthy one `base`, where one begins or ends.

    volume [m3]: where the actuator is. shift [m3]: what volumes are counted less by, see `flight`.
    """
    _let_through(base, p, q, kept)
    sags, cuts_in, cuts_out = q[On.SAG, 1], q[On.SWITCH_IN, 1], q[On.SWITCH_OUT, 1]
    p[modes.SAG], p[modes.KAPPA] = max(base[modes.SAG], sags), base[modes.KAPPA]
    if sags > 0.0 and p[modes.KAPPA] <= 0.0:  # not known: all that is lost with speed is it
        p[modes.KAPPA] = 1.0 / base[modes.GAIN]
    p[modes.SWITCH_IN] = base[modes.SWITCH_IN] if cuts_in == 0.0 else cuts_in * math.inf
    p[modes.SWITCH_OUT] = base[modes.SWITCH_OUT] if cuts_out == 0.0 else -cuts_out * math.inf
    stroke = base[modes.V_MAX] - base[modes.V_MIN]
    p[modes.K_L] = base[modes.K_L] + q[On.CREEP, 1] * stroke
    p[modes.V_0] = base[modes.V_0] + q[On.WEIGHT, 1] * stroke
    if q[On.BLOCK_OUT, 0] == 0.0:
        p[modes.V_MAX] = min(p[modes.V_MAX], volume + q[On.BLOCK_OUT, 1] * stroke - shift)
    if q[On.BLOCK_IN, 0] == 0.0:
        p[modes.V_MIN] = max(p[modes.V_MIN], volume - q[On.BLOCK_IN, 1] * stroke - shift)


@part
def emf(base: Array, q: Array, driving: bool) -> float:
    """Return the battery's open-circuit voltage [V]; driving: whether the motor has a voltage."""
    return float(base[modes.SUPPLY] * q[On.CHARGE, 0] * (q[On.CELL, 0] if driving else 1.0))


@part
def driven(q: Array, low: float, high: float, u: float, way: float, kept: Array) -> float:
    """Return what the actuator gets where the board commands u, within what the driver can give.

    way: in which it last was on, by its sign; 0: nowhere.
    """
    if way != 0.0:
        kept[_LOOSE] = math.copysign(1.0, way)
    if q[On.COMMAND, 1] != 0.0:
        return high if q[On.COMMAND, 1] * kept[_LOOSE] >= 0.0 else low
    return float(q[On.COMMAND, 0] * u)


class PumpTable(NamedTuple):
    """What a pump delivers and draws [voltages, heads], over even steps from 0 on."""

    rate: Array  # m3/s
    current: Array  # A from the battery's cells
    per_volt: float  # 1/V, one over the step
    per_metre: float  # 1/m, the same of the head, as a depth in the vehicle's own water
    nominal: float  # V
    resistance: float  # ohm, of the battery
    motor: float  # ohm, of the motor; 0: not known


NO_PUMP = PumpTable(np.zeros((2, 2)), np.zeros((2, 2)), 1.0, 1.0, 1.0, 0.0, 0.0)


@part
def _between(table: Array, row: float, column: float) -> float:
    """Return a table's value between its rows and columns; its edges go on."""
    row = min(max(row, 0.0), table.shape[0] - 1.000001)
    column = min(max(column, 0.0), table.shape[1] - 1.000001)
    i, j = int(row), int(column)
    a, b = row - i, column - j
    above = (1.0 - b) * table[i, j] + b * table[i, j + 1]
    below = (1.0 - b) * table[i + 1, j] + b * table[i + 1, j + 1]
    return float((1.0 - a) * above + a * below)


@part
def pump_share(pump: PumpTable, base: Array, q: Array, z: float) -> tuple[float, float, float]:
    """Return what a pump delivers at depth z [m] over what it would in health, and its battery.

    That is its voltage [V] at the board, while the pump runs, and what it has without load.
    """
    load, volts = q[On.LOAD, 0] * (2.0 - q[On.PORT_OUT, 0]), emf(base, q, True)
    head = load * z * pump.per_metre
    more = max(q[On.SAG, 1] * pump.motor - pump.resistance, 0.0)  # ohm
    current = _between(pump.current, volts * pump.per_volt, head)
    for _ in range(_ROUNDS if more > 0.0 else 0):
        current = _between(pump.current, (volts - more * current) * pump.per_volt, head)
    rate = _between(pump.rate, (volts - more * current) * pump.per_volt, head)
    well = _between(pump.rate, pump.nominal * pump.per_volt, z * pump.per_metre)
    share = q[On.SPEED, 0] * q[On.PORT_OUT, 0] * rate / well if well > 0.0 else 0.0
    return share, volts - (pump.resistance + more) * current, emf(base, q, False)


@part
def board_misses(q: Array, tick: float) -> tuple[bool, bool, int]:
    """Return (whether this tick is lost, whether the board is reset, ticks a law hangs for)."""
    lost = q[On.PAUSE, 0] == 0.0
    if q[On.TICKS, 0] < 1.0 and np.random.random() >= q[On.TICKS, 0]:  # noqa: NPY002
        lost = True
    return lost, q[On.RESET, 0] == 0.0, math.ceil(q[On.HANG, 1] / tick)


@part
def ticks_now(q: Array, ahead: float) -> tuple[int, float]:
    """Return how many ticks the board's clock has at this one, and how many it is then ahead by.

    ahead: of a whole tick, before it.
    """
    ahead += min(max(q[On.CLOCK, 1], _SLOWEST), _FASTEST)
    ticks = 1
    if ahead >= 1.0:
        ticks = 2
    elif ahead <= -1.0:
        ticks = 0
    return ticks, ahead - (ticks - 1)


@part
def asked(q: Array, depth: float) -> float:
    """Return the depth that the board is asked for [m]."""
    if q[On.ASKED, 0] == 0.0:
        return math.nan
    return float(q[On.ASKED, 1]) if q[On.ASKED, 1] != 0.0 else depth


@part
def flip(q: Array, memory: Any) -> None:
    """Flip a bit of what the board remembers, where one flips at this tick."""
    if q[On.FLIP, 0] == 0.0:
        at = int(np.random.random() * memory.shape[0])  # noqa: NPY002
        memory[at] ^= np.uint8(1 << int(8.0 * np.random.random()))  # noqa: NPY002
