"""Floats with faults: the C against its twin, and pump, valve and hull against SciPy's Radau."""

import math

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from swimbladder.codegen.golden import fly_float
from swimbladder.codegen.library import make_program
from swimbladder.codegen.subset import read_law
from swimbladder.codegen.twin import VehicleTwin, twin
from swimbladder.control.supervisor import SUPERVISOR, Watched
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.hull import neutral_volume
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.seawater import uniform_column
from swimbladder.physics.steady_drives import pump_run, valve_flow
from swimbladder.sim.faults.draw import course_of, draw
from swimbladder.sim.faults.kinds import KINDS, VALVE, kinds_of, not_drawn
from swimbladder.sim.faults.run import faults
from swimbladder.vehicle import PowerLawPump
from tests.sim.faults.oracle import Fault
from tests.vehicles import usual

FLOAT, ALWAYS, TICK = load_vehicle("example-float"), math.inf, 1.0
DEPTHS = (15.0, 420.0)
SEA = dict(drift=3e-9, swell=20e-6, swell_omega=2.0 * math.pi / 7.0, swell_phase=0.6)


@pytest.fixture(scope="session")
def rig(rig_of):
    return rig_of(FLOAT, DEPTHS)


class Machine:
    """A float under faults (kind, severity, second one, first tick, end), by Radau, tick by tick.

    Driven by the commands that a flight recorded. Shares no code with `faults` but the catalogue's
    numbers; what the pump gives at a voltage and a pressure is that of its datasheet's formulas.
    """

    def __init__(
        self, fault_rows, depth, volume, *, drift=0.0, swell=0.0, swell_omega=1.0, swell_phase=0.0
    ):
        self.fault_rows, self.sea = fault_rows, (drift, swell, swell_omega, swell_phase)
        grid = np.arange(0.0, 700.0, 0.5)
        column = uniform_column(FLOAT.water, 700.0, step=0.5)
        self.rests = CubicSpline(grid, neutral_volume(FLOAT, column)[: len(grid)])
        self.x, self.primes, self.pumps, self.way = np.array([depth, 0.0, volume]), 0.0, False, 0.0
        self.stops = {}

    def on(self, kind, k):
        for fault, first, _, begin, end in self.fault_rows:
            if fault == kind and begin <= k < end:
                yield first, (k - begin) * TICK

    def on_port(self, kind, k):
        yield from self.on(Fault.PORT_CLOGGED, k)
        yield from self.on(kind, k)

    def head(self, z):
        return (
            FLOAT.water.specific_weight * z
            + ATMOSPHERIC_PRESSURE
            - (FLOAT.actuator.internal_pressure)
        )

    def battery(self, k):
        """Return the supply that the pump has at tick k, and its voltage without load [V]."""
        shares = [1.0 - rate * since for rate, since in self.on(Fault.BATTERY_DECLINE, k)]
        shares += [1.0 - since / life for life, since in self.on(Fault.BATTERY_DEAD, k)]
        shares += [1.0 - loss for loss, _ in self.on(Fault.BATTERY_DROP, k)]
        volts = FLOAT.supply.voltage * math.prod(max(share, 0.0) for share in shares)
        loaded = volts * math.prod(1.0 - loss for loss, _ in self.on(Fault.BATTERY_CELL, k))
        R = FLOAT.supply.internal_resistance
        for share, _ in self.on(Fault.BATTERY_SAG, k):
            R = max(R, share * FLOAT.actuator.pump.motor.resistance)
        # a supply has to have a voltage
        change = {"voltage": max(loaded, 1e-3), "internal_resistance": R}
        return FLOAT.supply.model_copy(update=change), volts

    def pump(self, k, z):
        """Return what the pump delivers [m3/s], and the battery's voltage then [V]."""
        supply, _ = self.battery(k)
        load = math.prod(first for first, _ in self.on(Fault.WEAK, k))
        port = math.prod(first for first, _ in self.on_port(Fault.PORT_OUT, k))
        load *= 2.0 - port
        head = FLOAT.water.specific_weight * z * (load - 1.0) + self.head(z)
        fed = FLOAT.model_copy(update={"supply": supply})
        run = pump_run(fed, FLOAT.actuator.pump, np.array([head]))
        speed = port * math.prod(first for first, _ in self.on(Fault.SLOW, k))
        if any(self.on(Fault.STALLED, k)):
            speed = 0.0
        E, R = supply.voltage, supply.internal_resistance
        sags = 0.5 * (E + math.sqrt(max(E * E - 4.0 * R * float(run.power[0]), 0.0)))
        return speed * float(run.rate[0]), sags

    def valve(self, k, z, runs):
        """Return what comes in through an open valve, and whatever is open [m3/s]."""
        shut = any(self.on(Fault.VALVE_SHUT, k))
        flow = float(valve_flow(FLOAT.actuator.valve, np.array([self.head(z)]))[0])
        port = math.prod(first for first, _ in self.on_port(Fault.PORT_IN, k))
        leaks = [*self.on(Fault.VALVE_OPEN, k), *self.on(Fault.VALVE_LEAKS, k)]
        leaks += self.on(Fault.PUMP_BYPASS if runs else Fault.CHECK_VALVE, k)
        return (0.0 if shut else port * flow), flow * sum(first for first, _ in leaks)

    def lost(self, k):
        leaks = [*self.on(Fault.LEAK_SMALL, k), *self.on(Fault.LEAK_LARGE, k)]
        water = sum(rate * since for rate, since in leaks)
        drift, swell, omega, phase = self.sea
        fades = math.exp(-(omega**2) / 9.80665 * self.x[0])
        stroke = FLOAT.stroke.maximum - FLOAT.stroke.minimum
        weight = stroke * sum(first for first, _ in self.on(Fault.WEIGHT, k))
        return water, weight + water + drift * k * TICK + swell * fades * math.cos(
            omega * k * TICK + phase
        )

    def driver(self, k, command):
        """Return the seconds that pump or valve get of a command."""
        before, u = self.way, command
        for fault, first, _, begin, end in self.fault_rows:
            if begin <= k < end and fault == Fault.DRIVER_LOST:
                u = 0.0
            if begin <= k < end and fault == Fault.RUNS_ON and (k - begin) * TICK < first:
                u = TICK if before >= 0.0 else -TICK
        self.way = math.copysign(1.0, u) if u != 0.0 else self.way
        return u

    def ends(self, k):
        stroke, V = FLOAT.stroke.maximum - FLOAT.stroke.minimum, self.x[2]
        low, high = FLOAT.stroke.minimum, FLOAT.stroke.maximum
        for n, (fault, first, _, begin, _) in enumerate(self.fault_rows):
            if k >= begin and fault in (Fault.BLOCKED_OUT, Fault.BLOCKED_IN):
                sign = 1.0 if fault == Fault.BLOCKED_OUT else -1.0
                self.stops.setdefault(n, V + sign * first * stroke)
                low, high = (low, self.stops[n]) if sign > 0.0 else (self.stops[n], high)
        return low, high

    def tick(self, k, command):
        """Return (depth, speed, volume, seconds, battery, water) at tick k, and go on by a tick."""
        (water, lost), u, (low, high) = self.lost(k), self.driver(k, command), self.ends(k)
        z, w, V = self.x
        battery = self.pump(k, z)[1] if self.pumps else self.battery(k)[1]
        row = (z, w, V, u, battery, water)
        weight, drag = FLOAT.water.specific_weight, FLOAT.drag.k_dt
        rate_at_begin = self.pump(k, z)[0] / max(self.pump(-1, z)[0], 1e-30)

        def rhs(_t, x, does):
            z, w, V = x
            gives, leaks = self.valve(k, z, does in (1, 2))
            healthy = self.pump(-1, z)[0]
            rate = {1: rate_at_begin * healthy, 0: 0.0, 2: 0.0, -1: -gives}[does]
            rate -= leaks if does >= 0 else 0.0
            if does in (0, 2) and leaks == 0.0:
                rate -= FLOAT.actuator.leakage * self.head(z) if low < V else 0.0
            if (low >= V and rate < 0.0) or (high <= V and rate > 0.0):
                rate = 0.0
            return [w, (weight * (self.rests(z) + lost - V) - drag * w * abs(w)) / FLOAT.mass, rate]

        if u <= 0.0 or high <= V:
            self.pumps = False
        runs = u > 0.0 and high > V
        if runs and not self.pumps:
            self.primes, self.pumps = FLOAT.actuator.start_volume, True
        left, parts = abs(u), []
        if runs:
            first = self.primes / (rate_at_begin * self.pump(-1, z)[0]) if rate_at_begin else 0.0
            first = min(first, left)
            self.primes -= first * rate_at_begin * self.pump(-1, z)[0]
            parts = [(first, 2), (left - first, 1)]
        elif u < 0.0:
            parts = [(left, -1)]
        else:
            left = 0.0
        if u < TICK:
            self.pumps = False
        for length, does in [*parts, (TICK - left, 0)]:
            if length > 1e-9:
                self.go(rhs, length, does, low, high)
        self.pumps = self.pumps and self.x[2] < high
        return row

    def go(self, rhs, length, does, low, high):
        def stop(_t, x, _does):
            return min(x[2] - low, high - x[2]) * 1e6 + 1e-9

        stop.terminal, stop.direction = True, -1
        done = 0.0
        while length - done > 1e-9:
            found = solve_ivp(
                rhs,
                (done, length),
                self.x,
                method="Radau",
                rtol=1e-9,
                atol=[1e-8, 1e-9, 1e-14],
                args=(does,),
                events=stop,
                max_step=0.5,
            )
            self.x, done = found.y[:, -1], found.t[-1]
            if found.status == 1:
                self.x[2] = min(max(self.x[2], low), high)


def follow(machine, flown):
    rows = [machine.tick(k, command) for k, command in enumerate(flown["command"])]
    names = ("depth", "speed", "volume", "applied", "battery", "water")
    return dict(zip(names, np.array(rows).T, strict=True))


NEAR = {
    "depth": 2e-3,
    "speed": 1e-4,
    "volume": 2e-8,
    "applied": 1e-12,
    "battery": 2e-3,
    "water": 1e-18,
}
# Of a battery's resistance: its current is the driver's here, and the motor's in the formulas.
NEAR_SAGGING = NEAR | {"depth": 1e-2, "speed": 3e-4, "battery": 5e-3}


def against_radau(rig, *fault_rows, sea=None, ticks=80, depth=400.0, target=340.0, near=NEAR):
    _, flown = rig.fly(
        *fault_rows,
        depth=depth,
        volume=math.nan,
        turns=((0.0, target), (45.0, depth + 60.0)),
        ticks=ticks,
        ramp=math.inf,
        full=TICK,
        **(sea or {}),
    )
    expected = follow(Machine(fault_rows, depth, flown["volume"][0], **(sea or {})), flown)
    for name, most in near.items():
        off = np.abs(flown[name] - expected[name])
        assert off.max() < most, (name, off.max(), int(off.argmax()))
    return flown


@pytest.mark.prove
def test_a_mission_without_faults_is_that_of_the_twin_in_the_loop(rig):
    """The C law and supervisor, from the surface to 30 m: commands to the bit, depths to 1e-9 m."""
    made = make_program(rig.course.vehicle, depths=())
    board = VehicleTwin(
        made.controller(made.twin()),
        made.supervisor,
        supervisor=twin(SUPERVISOR, read_law(SUPERVISOR, Watched)),
    )

    def tick(seen, asked):
        watched = Watched(seen.depth, 0.0, math.nan, 14.4, False, 0, 0)
        return float(board.tick(watched, asked)), board.wide

    asked = np.full(901, 30.0)
    rows = fly_float(FLOAT, tick, tick=TICK, start_depth=0.0, asked=asked)
    _, flown = rig.fly(
        who="supervised",
        depth=0.0,
        target=30.0,
        volume=math.nan,
        ticks=900,
        ramp=math.inf,
        full=TICK,
    )
    assert rows[:, 0].max() > 20.0
    for column, name, near in ((3, "command", 0.0), (0, "depth", 1e-9), (2, "volume", 1e-15)):
        assert np.abs(rows[:, column] - flown[name][:901]).max() <= near


def test_pump_valve_and_hull_are_those_of_radau_in_a_sea(rig):
    flown = against_radau(rig, sea=SEA)
    assert flown["command"].max() == TICK
    assert flown["command"].min() < 0.0


SEVERE = {
    Fault.SLOW: 0.3,
    Fault.WEAK: 3.0,
    Fault.BLOCKED_OUT: 1e-3,
    Fault.BLOCKED_IN: 5e-4,
    Fault.RUNS_ON: 9.0,
    Fault.BATTERY_DECLINE: 1e-2,
    Fault.BATTERY_SAG: 0.9,
    Fault.BATTERY_DROP: 0.4,
    Fault.BATTERY_CELL: 0.3,
    Fault.BATTERY_DEAD: 60.0,
    Fault.PORT_CLOGGED: 0.3,
    Fault.PORT_OUT: 0.4,
    Fault.PORT_IN: 0.2,
    Fault.CHECK_VALVE: 0.05,
    Fault.PUMP_BYPASS: 0.05,
    Fault.WEIGHT: -0.01,
    Fault.VALVE_OPEN: 0.3,
    Fault.VALVE_LEAKS: 5e-3,
    Fault.LEAK_SMALL: 3e-7,
    Fault.LEAK_LARGE: 5e-6,
}
PLANT = ("actuator", "battery", "leak", "weight")


@pytest.mark.parametrize(
    "fault", [f for f in kinds_of(FLOAT) if KINDS[f].family in PLANT], ids=lambda f: KINDS[f].name
)
def test_each_fault_of_pump_valve_battery_and_hull_is_that_of_radau(rig, fault):
    near = NEAR_SAGGING if fault == Fault.BATTERY_SAG else NEAR
    flown = against_radau(rig, (fault, SEVERE.get(fault, 0.0), 0, 12, ALWAYS), near=near)
    _, well = rig.fly(
        depth=400.0,
        volume=math.nan,
        turns=((0.0, 340.0), (45.0, 460.0)),
        ticks=80,
        full=TICK,
        ramp=math.inf,
    )
    acts = {"actuator": ("volume",), "battery": ("battery",), "leak": ("water", "depth")}
    acts["weight"] = ("depth",)
    for name in acts[KINDS[fault].family]:
        assert np.array_equal(flown[name][:12], well[name][:12])
        assert not np.array_equal(flown[name], well[name])


def test_an_end_stop_stays_where_it_is_while_water_comes_in(rig):
    """What leaks in makes the vehicle heavier; its oil still ends at the same volume."""
    rows = [(Fault.BLOCKED_IN, 1e-4, 0, 4, ALWAYS), (Fault.LEAK_LARGE, 2e-6, 0, 1, ALWAYS)]
    flown = against_radau(rig, *rows, target=460.0, ticks=40)
    assert flown["water"][-1] > 1e-5
    volume = flown["volume"]
    assert np.sum(volume < volume.min() + 1e-12) > 10  # it lies there
    assert volume.min() < volume[0] - 1e-8


def test_a_board_that_misses_ticks_leaves_pump_and_valve_off(rig):
    """Each command is for its tick; a law that has lost its time goes on with its run."""
    _, flown = rig.fly(
        (Fault.PAUSE, 5.0, 5.0, 4, ALWAYS),
        depth=400.0,
        target=340.0,
        volume=math.nan,
        ticks=60,
        ramp=math.inf,
        full=TICK,
    )
    missed = flown["board"] == 1.0
    assert missed.sum() > 20
    assert not flown["applied"][missed].any()
    assert flown["applied"][~missed].max() == TICK
    assert np.isnan(flown["volume_seen"]).all()


def test_a_pump_that_runs_for_a_whole_tick_of_a_slow_clock_runs_until_the_next(rig):
    """What is on for a part of one is off by then."""
    _, flown = rig.fly(
        (Fault.CLOCK_WRONG, -0.6, 0, 4, ALWAYS),
        depth=400.0,
        turns=((0.0, 340.0), (20.0, 460.0)),
        volume=math.nan,
        ticks=120,
        ramp=math.inf,
        full=TICK,
    )
    waits = np.flatnonzero(flown["board"] == 1.0)
    assert len(waits) == pytest.approx(0.6 * 117, abs=1.0)
    before, now = flown["applied"][waits - 1], flown["applied"][waits]
    assert np.array_equal(now, np.where(np.abs(before) == TICK, before, 0.0))
    assert {-TICK, 0.0, TICK} >= set(now) > {0.0}


def test_the_battery_sags_with_the_depth_right_up_to_the_surface(rig):
    """In the last metre as well, where a head that is rounded up would leave it even."""
    _, flown = rig.fly(
        (Fault.LEAK_SMALL, 1e-12, 0, 0, ALWAYS),
        depth=12.0,
        volume=math.nan,
        ticks=400,
        how=1,
        full_after=0.0,
        full=TICK,
        ramp=math.inf,
    )
    shallow = (flown["depth"] > 0.0) & (flown["depth"] < 1.0)
    runs = shallow & (flown["battery"] < flown["battery"].max() - 1e-6)
    z, volts = flown["depth"][runs], flown["battery"][runs]
    assert np.ptp(z) > 0.2
    ends = Machine((), 1.0, 0.0)
    slope = ends.pump(0, 1.0)[1] - ends.pump(0, 0.0)[1]
    assert np.polyfit(z, volts, 1)[0] == pytest.approx(slope, rel=0.1)


def test_what_a_float_cannot_have_is_named():
    kinds, out = set(kinds_of(FLOAT)), not_drawn(FLOAT)
    named = {name for names in out.values() for name in names}
    assert {KINDS[f].name for f in kinds} | named == {kind.name for kind in KINDS.values()}
    assert {Fault.VOLUME_NAN, Fault.REVERSED, Fault.SWITCH_OPEN} & kinds == set()
    assert {Fault.VALVE_OPEN, Fault.DRIVER_LOST, Fault.BATTERY_SAG} <= kinds
    assert out["a measured volume"] == [
        KINDS[fault].name
        for fault in (
            Fault.VOLUME_NAN,
            Fault.VOLUME_STUCK,
            Fault.VOLUME_DRIFT,
            Fault.ENCODER_SLIP,
            Fault.SENSORS_STUCK,
        )
    ]
    pump = PowerLawPump(delivery=1e-6, slip=0.0, idle_power=5.0, power_per_pressure=1e-6)
    measured = FLOAT.model_copy(
        update={"actuator": FLOAT.actuator.model_copy(update={"pump": pump})}
    )
    assert Fault.BATTERY_DEAD not in kinds_of(measured)
    assert VALVE in not_drawn(load_vehicle("feup-em"))


def test_dives_begin_at_the_surface_and_leave_time_for_their_ways():
    course = course_of(usual(FLOAT), None)
    drawn = [draw(course, seed=1, number=n, healthy=False) for n in range(200)]
    for m in drawn:
        assert m.condition.start_depth == 0.0
        assert math.isnan(m.condition.start_volume)
        assert 10.0 < min(m.depths[:-1]) <= max(m.depths[:-1]) <= 1620.0
        assert m.depths[-1] == -1.0
        assert m.turns[-1] * TICK >= m.depths[0] / 0.1 + 7200.0
        assert m.fault_rows[0, 3] < m.turns[-1]
        assert all(0.5 < share < 1.5 for share in m.drive)
    assert course.time_limit > max(m.turns[-1] for m in drawn) + 1620.0 / 0.1
    assert {m.faults[0] for m in drawn} == set(kinds_of(FLOAT))


def test_the_time_limit_of_dives_leaves_an_hour_for_coming_up():
    """Two hours, the way down and up at two thirds of the law's speed, and an hour."""
    course = course_of(usual(FLOAT, DEPTHS), DEPTHS)
    assert FLOAT.controller.parameters["far_speed"] == "10 cm/s"
    speed = 0.1
    way = DEPTHS[1] - FLOAT.hull.emergence_depth + 1.0  # the last set-point is out of the water
    assert course.ramp == speed
    assert course.time_limit == pytest.approx(3.0 * 3600.0 + 2.0 * 1.5 * way / speed, rel=1e-12)


def test_without_a_supply_what_a_pump_has_is_a_share_of_the_nominal_too():
    pump = PowerLawPump(delivery=1e-6, slip=0.0, idle_power=5.0, power_per_pressure=1e-6)
    measured = FLOAT.model_copy(
        update={
            "actuator": FLOAT.actuator.model_copy(update={"pump": pump}),
            "supply": None,
        }
    )
    course = course_of(usual(measured, (15.0, 60.0)), (15.0, 60.0))
    drawn = [draw(course, seed=1, number=n, healthy=True).plant for n in range(200)]
    shares = [Plant(*plant).supply for plant in drawn]
    assert stats.kstest(shares, stats.uniform(0.9, 0.1).cdf).pvalue > 1e-3


@pytest.mark.usefixtures("gcc")
@pytest.mark.promise("recovered")
def test_a_campaign_of_shallow_dives(tmp_path):
    flown = faults(
        usual(FLOAT, depths=(15.0, 60.0)),
        missions=8,
        healthy=2,
        seed=3,
        depth_range=(15.0, 60.0),
        keep=tmp_path / "kept",
    )
    again = faults(
        usual(FLOAT, depths=(15.0, 60.0)),
        missions=8,
        healthy=2,
        seed=3,
        depth_range=(15.0, 60.0),
        keep=tmp_path / "kept",
    )
    assert np.array_equal(flown.faulty.view(float), again.faulty.view(float), equal_nan=True)
    assert len(flown.false_alarms) == len(flown.healthy_lost) == 0
    assert flown.to_dict()["not_drawn"] == not_drawn(FLOAT)
