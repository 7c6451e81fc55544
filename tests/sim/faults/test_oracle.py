"""Flights with faults against an independent simulator, tick by tick, for every kind of fault."""

import copy
import math

import numpy as np
import pytest
from scipy import signal, stats

from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.seawater import Column
from swimbladder.sim.faults.draw import TRACE
from swimbladder.sim.faults.kinds import KINDS, On, Range, board_misses, draw_fault, kinds_of
from swimbladder.sim.faults.run import fly_one
from tests.layered import SEA as SALT
from tests.layered import added, density
from tests.oracle import Machine
from tests.sim.faults.oracle import COMPARED, Drawn, Fault, Faulty, Layered, follow
from tests.vehicles import usual

ALWAYS = math.inf
# A motor whose load does not depend on the direction; and one that stops where it turns, as all
# drag of two laws does: the kernel finds that instant to about 1e-11 m3, and psi makes it grow.
NEAR = {
    "depth": 2e-8,
    "speed": 2e-8,
    "volume": 2e-12,
    "applied": 1e-12,
    "battery": 2e-7,
    "water": 1e-18,
}
NEAR_TURNING = NEAR | {"depth": 2e-5, "speed": 1e-6, "volume": 1e-10, "battery": 5e-6}
SEA = dict(drift=2e-8, swell=20e-6, swell_omega=2.0 * math.pi / 7.0, swell_phase=0.6)
POOL = dict(drift=2e-9, swell=5e-7, swell_omega=2.0 * math.pi / 6.0, swell_phase=2.0)


def variant(name, base="feup-em", **tables):
    """Return a preset with other numbers in some of its tables."""
    vehicle = load_vehicle(base).model_copy(update={"name": name})
    data = vehicle.model_dump()
    for table, numbers in tables.items():
        data[table] |= numbers
    return type(vehicle).model_validate(data)


def vehicles():
    em = load_vehicle("example-em")
    rough = em.actuator.model_copy(
        update={"motor": em.actuator.motor.model_copy(update={"friction_torque": 3e-3})}
    )
    return {
        "feup-em": "feup-em",
        "leaky": variant("leaky", actuator={"k_l": 1e-7}),
        "one-way": "example-em",
        "rough, weak battery": em.model_copy(
            update={
                "name": "rough",
                "actuator": rough,
                "supply": em.supply.model_copy(update={"internal_resistance": 0.4}),
            }
        ),
        "ntnu-bv": "ntnu-bv",
    }


VEHICLES = vehicles()


def compare(flown, found, first=0, skip=0, near=NEAR):
    """Assert that a flight's columns are those of the oracle, from `skip` ticks after its first."""
    for name in COMPARED:
        ours = flown[name][first : first + len(found[name])]
        assert np.array_equal(np.isnan(ours), np.isnan(found[name])), name
        off = np.abs(ours - found[name])[skip:]
        worst = 0.0 if np.isnan(off).all() else np.nanmax(off)
        assert worst <= near[name], (
            f"{name}: {worst:.3g} at tick {first + skip + np.nanargmax(off)}"
        )


def against_oracle(
    rig, *fault_rows, depth=20.0, ticks=300, bottom=math.inf, sea=SEA, near=NEAR, **run
):
    """Fly, compare with the oracle; return (result, columns)."""
    result, flown = rig.fly(*fault_rows, depth=depth, ticks=ticks, bottom=bottom, **sea, **run)
    machine = Machine(rig.vehicle, bottom)
    if "supply" in run:
        machine.E = run["supply"]
    found = follow(
        Faulty(
            machine,
            rig.vehicle,
            fault_rows,
            tick=rig.tick,
            depth=depth,
            volume=run.get("volume", rig.vehicle.neutral_volume(depth)),
            **sea,
        ),
        flown,
    )
    compare(flown, found, near=near)
    return result, flown


@pytest.mark.parametrize("name", VEHICLES)
def test_a_flight_in_swell_with_drift_and_a_leak_is_that_of_the_oracle(rig_of, name):
    """Down, up and down: motor, leakage, loads of either direction, battery, positioner, drag."""
    small = name == "ntnu-bv"
    rig = rig_of(VEHICLES[name], (1.0, 1.5) if small else None)
    turns = ((0.0, 1.4), (100.0, 1.0)) if small else ((0.0, 23.0), (100.0, 19.0), (200.0, 21.0))
    leak = (Fault.LEAK_SMALL, 1e-9 if small else 2e-7, 0, 40, ALWAYS)
    _, flown = against_oracle(
        rig,
        leak,
        depth=1.2 if small else 20.0,
        turns=turns,
        sea=POOL if small else SEA,
        near=NEAR if name in ("feup-em", "leaky") else NEAR_TURNING,
    )
    assert np.ptp(flown["depth"]) > (0.05 if small else 1.0)


def test_a_flight_in_the_layers_of_a_cast_is_that_of_the_oracle(rig_of):
    """Through a halocline, where gravity is another than at home, while actuator and hull fail."""
    vehicle = variant("layered", water={"density": SALT}, hull={"height": 0.4})
    step, g = 0.001, 9.7
    z = np.arange(0.0, 9.0, step)
    column = Column(
        depth=z,
        pressure=SALT * g * z,
        density=density(z),
        temperature=np.full_like(z, 8.0),
        gravity=g,
        compressibility=vehicle.water.compressibility,
        source="halocline",
    )
    rig = rig_of(vehicle, (1.0, 6.0), column)
    share, psi = g / vehicle.water.gravity, vehicle.hull.psi

    def layers(depth):
        return added(depth, vehicle) + (share - 1.0) * psi * depth

    medium = rig.course.medium
    assert medium.share == pytest.approx(share, rel=1e-12)
    start = psi * 2.0 + vehicle.trim_error + layers(2.0)
    assert medium.neutral_volume(2.0) == pytest.approx(start, abs=2e-12)
    fault_rows = (Fault.SLOW, 0.3, 0, 20, 150), (Fault.LEAK_SMALL, 2e-7, 0, 40, ALWAYS)
    turns = ((0.0, 0.6), (130.0, 4.0))
    _, flown = rig.fly(*fault_rows, depth=2.0, turns=turns, ticks=300, **SEA)
    assert flown["depth"].min() < 1.2 < 2.0 < flown["depth"].max()
    faulty = Faulty(
        Layered(vehicle, layers, share),
        vehicle,
        fault_rows,
        tick=rig.tick,
        depth=2.0,
        volume=start,
        **SEA,
    )
    # steps of fourth order from row to row of the table, where the rest of the plant is exact
    near = NEAR | {"depth": 2e-5, "speed": 2e-5, "volume": 1e-10, "battery": 5e-6}
    compare(flown, follow(faulty, flown), near=near)
    # and where it would be without the layers is somewhere else
    even = Layered(vehicle, lambda _: 0.0, share)
    plain = Faulty(even, vehicle, fault_rows, tick=rig.tick, depth=2.0, volume=start, **SEA)
    assert np.abs(follow(plain, flown)["depth"] - flown["depth"]).max() > 0.1


@pytest.mark.parametrize("sea", ["swell", "drift"])
@pytest.mark.parametrize("depth", [2.0, 12.0])
def test_swell_fades_with_depth_and_drift_makes_heavier(rig, sea, depth):
    """Each alone, with the motor at rest: what moves the vehicle is the sea."""
    alone = {key: value if key.startswith(sea) else 0.0 for key, value in SEA.items()}
    alone |= {"swell_omega": SEA["swell_omega"], "swell_phase": SEA["swell_phase"]}
    stalled = (Fault.STALLED, 0, 0, 0, ALWAYS)
    _, flown = against_oracle(rig, stalled, depth=depth, ticks=200, sea=alone)
    assert np.ptp(flown["volume"]) < 1e-12
    if sea == "drift":  # a larger neutral volume sinks the vehicle
        assert np.all(np.diff(flown["depth"])[5:] > 0.0)
    else:
        assert np.ptp(flown["depth"]) > 1e-3


def test_the_surface_the_bottom_and_both_end_stops(rig):
    """Full buoyancy to the surface, and all the way down onto the bottom, in swell."""
    for target, bottom in ((-20.0, math.inf), (60.0, 9.0)):
        _, flown = rig.fly(depth=5.0, target=target, ticks=300, bottom=bottom, **SEA)
        machine = Machine(rig.vehicle, bottom)
        volume = rig.vehicle.neutral_volume(5.0)
        faulty = Faulty(machine, rig.vehicle, (), tick=rig.tick, depth=5.0, volume=volume, **SEA)
        compare(flown, follow(faulty, flown), near=NEAR_TURNING)
        stop = machine.V_max if target < 0.0 else machine.V_min
        assert np.abs(flown["volume"] - stop).min() < 1e-15
        assert flown["depth"].min() < 0.0 if target < 0.0 else flown["depth"].max() == bottom


BEGIN, END = 60, 130
# Severity, in the unit that the oracle takes it in: what the catalogue says has to be the same.
SEVERE = {
    Fault.DEPTH_RANGE: (-400.0, 0, "m"),
    Fault.DEPTH_DROPOUTS: (0.3, 0, ""),
    Fault.DEPTH_LATE: (6.0, 1, "s"),
    Fault.DEPTH_OLD: (4.5, 0, "s"),
    Fault.DEPTH_JUMP: (-7.0, 0, "m"),
    Fault.DEPTH_DRIFT: (0.1, 0, "m/s"),
    Fault.DEPTH_OFFSET: (-3.0, 0, "m"),
    Fault.DEPTH_TEMPERATURE: (2.0, 15.0, "m"),
    Fault.DEPTH_SCALE: (-0.25, 0, ""),
    Fault.DEPTH_NOISE: (2.0, 0, "m"),
    Fault.VOLUME_DRIFT: (0.01, 0, "1/s"),
    Fault.ENCODER_SLIP: (0.6, 0, ""),
    Fault.PORT_CLOGGED: (0.1, 0, ""),
    Fault.PORT_OUT: (0.2, 0, ""),
    Fault.PORT_IN: (0.3, 0, ""),
    Fault.CREEP: (5e-4, 0, "1/(m s)"),
    Fault.SLOW: (0.05, 0, ""),
    Fault.WEAK: (5.0, 0, ""),
    Fault.BLOCKED_OUT: (0.01, 0, ""),
    Fault.BLOCKED_IN: (0.01, 0, ""),
    Fault.RUNS_ON: (9.0, 0, "s"),
    Fault.BATTERY_DECLINE: (5e-3, 0, "1/s"),
    Fault.BATTERY_SAG: (0.6, 0, ""),
    Fault.BATTERY_DROP: (0.4, 0, ""),
    Fault.BATTERY_CELL: (0.3, 0, ""),
    Fault.BATTERY_DEAD: (30.0, 0, "s"),
    Fault.TICKS_LOST: (0.4, 0, ""),
    Fault.PAUSE: (3.0, 6.0, "s"),
    Fault.RESETS: (6.0, 0, "s"),
    Fault.HANG: (3.0, 0, "s"),
    Fault.CLOCK_WRONG: (-0.29, 0, ""),
    Fault.CLOCK_DRIFTS: (-0.05, 0, "1/s"),
    Fault.BIT_FLIPS: (1.5, 0, "s"),
    Fault.SETPOINT_INFINITE: (1e39, 0, "m"),
    Fault.SETPOINT_ABSURD: (-1e9, 0, "m"),
    Fault.WEIGHT: (0.03, 0, ""),
    Fault.LEAK_SMALL: (3e-7, 0, "m3/s"),
    Fault.LEAK_LARGE: (5e-6, 0, "m3/s"),
}
TURNS = ((0.0, 22.0), (55.0, 17.0), (95.0, 24.0), (140.0, 20.0))


def ends_of(fault):
    return END if KINDS[fault].may_end or fault == Fault.RUNS_ON else ALWAYS


def seen_depth(fault, true, begin, end, tick):
    """Return what the depth sensor has to say and its age, of what it measures; nan: a number."""
    k = np.arange(len(true))
    on, since = (k >= begin) & (k < end), (k - begin) * tick
    first, second, _ = SEVERE.get(fault, (0.0, 0.0, ""))
    age = np.zeros_like(true)
    late = round(first / tick)
    seen = {
        Fault.DEPTH_NAN: lambda: np.full_like(true, math.nan),
        Fault.DEPTH_STUCK: lambda: np.full_like(true, true[begin]),
        Fault.SENSORS_STUCK: lambda: np.full_like(true, true[begin]),
        Fault.DEPTH_OFFSET: lambda: true + first,
        Fault.DEPTH_TEMPERATURE: lambda: true + warmed(begin, tick, first, second),
        Fault.DEPTH_RANGE: lambda: np.full_like(true, first),
        Fault.DEPTH_LATE: lambda: true[np.maximum(k - late, 0)],
        Fault.DEPTH_OLD: lambda: true[np.maximum(begin, k - (k - begin) % late)],
        Fault.DEPTH_JUMP: lambda: true + first,
        Fault.DEPTH_DRIFT: lambda: true + first * since,
        Fault.DEPTH_SCALE: lambda: true * (1.0 + first),
    }.get(fault, lambda: true)()
    if fault == Fault.DEPTH_LATE and second > 0.5:
        age = np.full_like(true, first)
    elif fault == Fault.DEPTH_OLD:
        age = (k - begin) % late * tick
    return np.where(on, seen, true), np.where(on, age, 0.0)


def warmed(begin, tick, first, second):
    """Return the error of a sensor that takes the water's temperature: a lag of first order."""
    lag = signal.lti([first], [second, 1.0])
    _, error = signal.step(lag, T=tick * np.arange(221 - begin))
    return np.concatenate((np.zeros(begin), error))


def seen_volume(fault, true, begin, end, tick, stroke):
    k = np.arange(len(true))
    on = (k >= begin) & (k < end)
    if fault == Fault.VOLUME_NAN:
        return np.where(on, math.nan, true)
    if fault == Fault.ENCODER_SLIP:  # what it missed while the fault lasted it misses for good
        steps = np.diff(true, prepend=true[0])
        return true - np.cumsum(np.where(on & (steps > 0.0), SEVERE[fault][0] * steps, 0.0))
    if fault in (Fault.VOLUME_STUCK, Fault.SENSORS_STUCK):
        return np.where(on, true[begin], true)
    if fault == Fault.VOLUME_DRIFT:  # strokes, from end to end, a second
        return np.where(on, true + SEVERE[fault][0] * stroke * (k - begin) * tick, true)
    return true


def ran(fault, ticks, begin, end, tick, boot):
    """Return what the board does each tick (0: runs, 1: misses it, 2: is off), where it is certain.

    A watchdog resets what hangs; a reset takes `boot` ticks.
    """
    first, second, _ = SEVERE.get(fault, (0.0, 0.0, ""))
    board = np.zeros(ticks)
    for k in range(ticks):
        since = k - begin
        if fault in (Fault.CLOCK_WRONG, Fault.CLOCK_DRIFTS):  # whole ticks that it is behind by
            rate = first if fault == Fault.CLOCK_WRONG else first * np.arange(k - begin + 1) * tick
            steps = np.where(np.arange(begin, k + 1) < end, np.maximum(rate, -0.9), 0.0)
            behind = np.floor(1e-9 - np.cumsum(steps)) if k >= begin else np.zeros(1)
            board[k] = float(behind[-1] > (behind[-2] if len(behind) > 1 else 0.0))
        on = begin <= k < end
        if fault == Fault.PAUSE and on:
            board[k] = float(since * tick % (first + second) < first - 1e-9)
        elif fault == Fault.RESETS and on and since % round(first / tick) == 0:
            board[k : k + boot] = 2.0
        elif fault == Fault.HANG and on and board[k] == 0.0:
            hangs = round(first / tick)
            board[k : k + hangs] = 1.0
            board[k + hangs : k + hangs + boot] = 2.0
    return board


RUN = dict(ticks=220, turns=TURNS, brown_out=0.0)


@pytest.fixture(scope="module")
def healthy(rig):
    """A flight in which nothing fails, and the oracle of it at the tick in which a fault begins."""
    _, well = rig.fly(depth=20.0, **SEA, **RUN)
    volume = rig.vehicle.neutral_volume(20.0)
    start = dict(tick=rig.tick, depth=20.0, volume=volume)
    oracle = Faulty(Machine(rig.vehicle), rig.vehicle, (), **start, **SEA)
    compare(well, follow(oracle, well, ticks=BEGIN))
    oracle.first, oracle.oracle.t = BEGIN, (BEGIN - 1) * rig.tick
    oracle.oracle.hold(oracle.applied, rig.tick)
    return well, oracle


@pytest.mark.parametrize(
    "fault",
    [f for f, kind in KINDS.items() if f in kinds_of(load_vehicle("feup-em"))],
    ids=lambda f: KINDS[f].name,
)
def test_each_kind_of_fault_does_what_it_is_said_to_do_and_only_while_it_lasts(rig, healthy, fault):
    """Value, sign, unit, begin and end: all columns of a flight against the oracle."""
    well, oracle = healthy
    first, second, unit = SEVERE.get(fault, (0.0, 0.0, None))
    kind, end, tick = KINDS[fault], ends_of(fault), rig.tick
    assert (kind.first.unit if kind.first is not None else None) == unit
    fault_row = (fault, first, second, BEGIN, end)
    _, flown = rig.fly(fault_row, depth=20.0, **SEA, **RUN)
    failing = copy.deepcopy(oracle)
    failing.fault_rows = (fault_row,)
    compare(flown, follow(failing, flown), BEGIN)
    changed = [
        n for n in TRACE if not np.array_equal(well[n][:BEGIN], flown[n][:BEGIN], equal_nan=True)
    ]
    assert not changed  # it does nothing before: the flight that the oracle was compared with
    k = np.arange(221)
    on = (k >= BEGIN) & (k < end)
    depth, age = seen_depth(fault, flown["depth"], BEGIN, end, tick)
    if fault == Fault.DEPTH_DROPOUTS:
        gone = np.isnan(flown["depth_seen"])
        assert not gone[~on].any()
        assert stats.binomtest(gone[on].sum(), on.sum(), 1.0 - first).pvalue > 1e-3
        assert np.array_equal(flown["depth_seen"][~gone], flown["depth"][~gone])
    elif fault == Fault.DEPTH_NOISE:
        noise = (flown["depth_seen"] - flown["depth"]) / first
        assert not noise[~on].any()
        assert stats.kstest(noise[on], stats.norm.cdf).pvalue > 1e-3
    else:
        assert flown["depth_seen"] == pytest.approx(depth, abs=1e-12, nan_ok=True)
        assert flown["depth_age"] == pytest.approx(age, abs=1e-12)
    volume = seen_volume(fault, flown["volume"], BEGIN, end, tick, 700e-6)
    assert flown["volume_seen"] == pytest.approx(volume, abs=1e-17, nan_ok=True)
    board = flown["board"]
    if fault == Fault.TICKS_LOST:
        assert not board[~on].any()
        assert stats.binomtest(int(board[on].sum()), on.sum(), 1.0 - first).pvalue > 1e-3
    elif fault == Fault.HANG:  # what hangs when the fault ends is still reset
        assert np.array_equal(board, ran(fault, 221, BEGIN, end, tick, 7)[:221])
    else:
        assert np.array_equal(board, ran(fault, 221, BEGIN, end, tick, 7))
    assert np.array_equal(
        flown["command"][1:][board[1:] == 1.0], flown["command"][:-1][board[1:] == 1.0]
    )
    assert not flown["command"][board == 2.0].any()
    # and it does something: what is not what it would have been
    acts = {
        "sensor": ("depth_seen", "volume_seen"),
        "actuator": ("volume", "applied"),
        "battery": ("battery",),
        "timing": ("board",),
        "leak": ("water",),
        "weight": ("depth",),
        "program": ("command",),
    }[kind.family]
    acts = ("volume",) if fault == Fault.WEAK else acts
    assert any(not np.array_equal(well[n], flown[n], equal_nan=True) for n in acts)


def test_the_battery_that_the_supervisor_sees_sags_with_the_current_and_not_with_speed(rig):
    """A motor up to speed draws what its load asks for, and more while it starts."""
    fault_row = (Fault.BATTERY_SAG, 0.6, 0, 0, ALWAYS)
    _, flown = against_oracle(
        rig, fault_row, depth=30.0, turns=((0.0, 30.0), (20.0, 5.0)), ticks=60
    )
    running = flown["battery"][40]
    # at full duty R_b i with R i = c z at an even speed, against the battery without a load
    z = flown["depth"][40]
    load = Machine(rig.vehicle).k_z * z
    assert flown["applied"][39] == 12.0
    assert running == pytest.approx(12.0 - 0.6 * load, rel=1e-3)


SWITCHES = [
    (kind, side) for kind in (Fault.SWITCH_OPEN, Fault.SWITCH_CLOSED) for side in (0.2, 0.8)
]


@pytest.mark.parametrize("fault", [None, *SWITCHES])
def test_limit_switches_cut_and_fail_as_in_the_oracle(rig_of, fault):
    """All out and all in: cut at each switch; one that is open cuts before, one closed never."""
    vehicle = variant("switched", stroke={"switch_margin": 40e-6})
    rig, out = rig_of(vehicle), fault is not None and fault[1] > 0.5
    fault_rows = () if fault is None else ((fault[0], fault[1], 0, 20, ALWAYS),)
    turns = ((0.0, 5.0), (30.0, 60.0 if fault and not out else -20.0))
    _, flown = against_oracle(
        rig, *fault_rows, depth=20.0, ticks=200, turns=turns, near=NEAR_TURNING
    )
    least, most = flown["volume"].min(), flown["volume"].max()
    if fault is None:
        assert vehicle.stroke.highest < most < vehicle.stroke.maximum
    elif fault[0] == Fault.SWITCH_CLOSED:
        end, stop = (most, "maximum") if out else (least, "minimum")
        assert end == pytest.approx(getattr(vehicle.stroke, stop), abs=1e-15)
    else:
        way = flown["applied"] > 0.0 if out else flown["applied"] < 0.0
        assert not way[20:].any()
    assert set(kinds_of(vehicle)) - set(kinds_of(load_vehicle("feup-em"))) == {
        Fault.SWITCH_OPEN,
        Fault.SWITCH_CLOSED,
    }


@pytest.mark.parametrize(
    "fault",
    [
        Fault.STALLED,
        Fault.SLOW,
        Fault.REVERSED,
        Fault.BLOCKED_OUT,
        Fault.BLOCKED_IN,
        Fault.RUNS_ON,
        Fault.PORT_CLOGGED,
        Fault.PORT_OUT,
        Fault.PORT_IN,
    ],
)
def test_each_fault_of_an_actuator_also_fails_a_positioner(rig_of, fault):
    rig = rig_of("ntnu-bv", (1.0, 1.5))
    first, second, _ = SEVERE.get(fault, (0.0, 0.0, ""))
    turns = ((0.0, 1.4), (25.0, 1.1), (60.0, 1.3))
    _, flown = against_oracle(
        rig,
        (fault, first, second, 30, 70 if KINDS[fault].may_end else ALWAYS),
        depth=1.2,
        ticks=120,
        turns=turns,
        sea=POOL,
        near=NEAR_TURNING,
    )
    _, well = rig.fly(depth=1.2, ticks=120, turns=turns, **POOL)
    assert np.abs(flown["volume"] - well["volume"]).max() > 1e-7


def test_two_faults_act_one_upon_the_other(rig):
    against_oracle(
        rig, (Fault.SLOW, 0.3, 0, 20, 150), (Fault.WEAK, 3.0, 0, 60, ALWAYS), turns=TURNS
    )
    against_oracle(
        rig,
        (Fault.BATTERY_SAG, 0.5, 0, 20, ALWAYS),
        (Fault.BATTERY_DROP, 0.3, 0, 60, 200),
        turns=TURNS,
    )
    against_oracle(
        rig, (Fault.REVERSED, 0, 0, 50, 120), (Fault.LEAK_LARGE, 4e-6, 0, 60, ALWAYS), turns=TURNS
    )


@pytest.mark.parametrize("bottom", [math.inf, 8.3])
def test_a_weight_lost_and_one_taken_on_are_those_of_the_oracle(rig, bottom):
    """Under water and on the bottom, in swell, while the law follows."""
    lost, taken = (Fault.WEIGHT, -0.2, 0, 80, ALWAYS), (Fault.WEIGHT, 0.3, 0, 40, ALWAYS)
    turns = ((0.0, 8.0), (150.0, 5.0))
    _, flown = against_oracle(
        rig, taken, lost, depth=7.0, turns=turns, bottom=bottom, near=NEAR_TURNING
    )
    assert (flown["depth"].max() == bottom) == math.isfinite(bottom)


def test_a_seal_that_creeps_empties_the_stroke_and_fills_it_again_at_the_end_stops(rig):
    """All out, where the motor makes up for what creeps, and all in."""
    for target, near in ((-20.0, NEAR_TURNING), (60.0, NEAR)):
        against_oracle(
            rig, (Fault.CREEP, 5e-4, 0, 150, ALWAYS), depth=30.0, target=target, near=near
        )


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("number", [2, *(pytest.param(n, marks=pytest.mark.prove) for n in (5, 8))])
def test_a_drawn_mission_is_that_of_the_oracle_around_its_onset(number):
    """Vehicle, water, bottom, swell and faults as drawn; with noise, which no plant sees."""
    vehicle = load_vehicle("feup-em")
    told = fly_one(usual(vehicle), number, seed=3)
    c, tick = told.mission.condition, told.tick
    fault_rows = [(Fault(int(h[0])), *h[1:]) for h in told.mission.fault_rows]
    for rows in told.rows[:2]:
        flown = {name: rows[:, index] for name, index in TRACE.items()}
        first = min(int(told.mission.fault_rows[0, 3]) - 60, len(rows) - 200)
        machine = Drawn(Plant(*told.mission.plant), vehicle)
        assert not any(
            h[0] in (Fault.BLOCKED_OUT, Fault.BLOCKED_IN) and h[3] < first for h in fault_rows
        )
        start = {name: flown[name][first] for name in ("depth", "volume", "speed")}
        faulty = Faulty(
            machine,
            vehicle,
            fault_rows,
            tick=tick,
            first=first,
            drift=c.drift,
            swell=c.swell,
            swell_omega=c.swell_omega,
            swell_phase=c.swell_phase,
            gravity=c.gravity,
            **start,
        )
        faulty.applied = flown["applied"][first - 1]
        compare(flown, follow(faulty, flown, ticks=200, settle=20), first, skip=21)


def test_severities_are_drawn_evenly_or_evenly_in_their_logarithm():
    random = np.random.default_rng(7)
    for either in (False, True):
        for log, even in ((True, stats.loguniform(0.02, 0.5)), (False, stats.uniform(0.02, 0.48))):
            kind = Range(least=0.02, most=0.5, unit="m", log=log, either=either)
            drawn = np.array([kind.draw(random) for _ in range(2000)])
            assert stats.kstest(np.abs(drawn), even.cdf).pvalue > 1e-3
            negative = int((drawn < 0.0).sum())
            assert stats.binomtest(negative, 2000, 0.5).pvalue > 1e-3 if either else negative == 0


def test_one_fault_in_seven_ends_within_five_minutes_where_it_can():
    random, ends = np.random.default_rng(8), []
    for fault in kinds_of(load_vehicle("feup-em")):
        lasts = np.array([draw_fault(fault, random)[2] for _ in range(400)])
        if KINDS[fault].may_end:
            ends += list(np.isfinite(lasts))
            some = lasts[np.isfinite(lasts)]
            assert 5.0 <= some.min() <= some.max() <= 300.0
        else:
            assert np.isinf(lasts).all()
    assert np.mean(ends) == pytest.approx(1.0 / 7.0, abs=0.02)


@pytest.mark.parametrize("share", [0.0, 0.03, 1.0])
def test_a_board_loses_the_share_of_ticks_that_is_drawn(share):
    """A binomial number of them, which lies within its middle 0.9999."""
    acts = np.ones((len(On), 2))
    acts[On.TICKS, 0], acts[On.HANG, 1] = 1.0 - share, 0.0
    lost = sum(board_misses(acts, 0.1)[0] for _ in range(5000))
    least, most = stats.binom.interval(0.9999, 5000, share)
    assert max(least, 0.0) <= lost <= most
