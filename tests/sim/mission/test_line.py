"""The oil line's pressure in a mission, eq. (1), against SciPy with a check valve that gives."""

import math

import numpy as np
import pytest

from swimbladder.errors import InputError
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import uniform_column
from swimbladder.physics.steady_drives import OilLine, datasheet_point, pump_start
from swimbladder.sim.engine.rodas.prepare import Accuracy
from swimbladder.sim.engine.rodas.records import Account, Doing, Note
from swimbladder.sim.mission.balance import close_balance
from swimbladder.sim.mission.core.hooks import fly
from swimbladder.sim.mission.flight import Flight, fly_mission, reach_of
from swimbladder.sim.mission.prepare import DriveError, first_state, make_plan
from swimbladder.vehicle import DatasheetPump, Oil, PowerLawPump
from tests.sim.mission.conftest import phases
from tests.sim.mission.line_oracle import Line, runs_of, sea_of

RESERVOIR = 0.85e5
PUMP = PowerLawPump(delivery=1.2e-6, slip=2e-14, idle_power=7.0, power_per_pressure=2e-6)
TIGHT = Accuracy(relative=1e-8, depth=1e-7, speed=1e-9, volume=1e-13)


def with_line(profiler, oil, *, resistance=0.0, reservoir=RESERVOIR, **more):
    actuator = profiler.actuator.model_copy(
        update={
            "pump": PUMP,
            "line": oil,
            "start_volume": 0.0,
            "internal_pressure": reservoir,
            **more,
        }
    )
    supply = profiler.supply.model_copy(update={"internal_resistance": resistance})
    return profiler.model_copy(update={"actuator": actuator, "supply": supply})


def by_hand(oil, **more):
    return Line(
        oil,
        lambda h: PUMP.delivery - PUMP.slip * h,
        lambda h: PUMP.idle_power + PUMP.power_per_pressure * h,
        reservoir=RESERVOIR,
        slip=PUMP.slip,
        **more,
    )


def one_run(vehicle, depth, speed, duration, after, *, bottom=None, drive_error=None):
    """A pump that starts at once, at a depth and a speed, and stops after `duration` [s]."""
    column = uniform_column(vehicle.water, 2300.0)
    task = Mission(
        start_depth=depth,
        phases=[{"kind": "park", "depth": depth, "duration": 1e5}],
        safety={"deepest": 2250.0},
        bottom_depth=bottom,
    )
    plan = make_plan(vehicle, task, column, accuracy=TIGHT, drive_error=drive_error)
    x, at, accounts = first_state(plan, task)
    begin = x.copy()
    at["new_phase"], at["arrived"], at["doing"] = 0, 1, Doing.PRIMING
    at["place"] = 0 if bottom is None else 2
    x["w"], x["t_sample"], x["t_end"] = speed, math.inf, duration + after
    x["t_move"], x["v_move"], x["t_primed"] = duration, math.inf, math.inf
    flown = plan.under_way((x, at, accounts), rows=3000, notes=100, cycles=0)
    stop = fly(flown)
    return Flight(
        vehicle=vehicle,
        mission=task,
        column=column,
        plan=plan,
        rows=flown.rows[: flown.lane.counts[0]],
        notes=flown.lane.notes[: flown.lane.counts[1]],
        cycles=flown.cycles,
        begin=begin,
        end=x,
        whole=at,
        accounts=accounts,
        stop=stop,
        reach=reach_of(vehicle, task, plan),
    )


def length_of(line, depth, volume, vehicle):
    """What a run takes [s] that is to press out a volume [m3] at a depth that stays."""
    sea = vehicle.water.specific_weight * depth + 101325.0
    start = pump_start(OilLine(line.oil, RESERVOIR), line.delivery, np.array([sea]))
    return float(start.duration[0]) + volume / line.delivery(sea - RESERVOIR)


@pytest.mark.parametrize("air", [0.0, 0.05, pytest.param(0.001, marks=pytest.mark.prove)])
@pytest.mark.parametrize(
    ("depth", "speed", "mL", "line"),
    [
        (2.0, 0.1, 0.5, 20.0),
        (2.0, 0.1, 50.0, 100.0),
        (10.0, -0.1, 0.5, 100.0),
        (10.0, -0.1, 50.0, 20.0),
        (100.0, 0.1, 0.5, 20.0),
        (100.0, -0.1, 5.0, 100.0),
        (1000.0, 0.1, 1.0, 100.0),
        (1990.0, -0.1, 0.5, 100.0),
        (1990.0, 0.1, 50.0, 20.0),
    ],
)
def test_a_run_is_that_of_the_lines_pressure(profiler, air, depth, speed, mL, line):
    """From 0 to 2000 m, 0.5 to 50 mL: volume and energy as SciPy, with the vehicle moving."""
    oil = Oil(volume=1e-6 * line, bulk_modulus=1.4e9, trapped_air=air)
    vehicle, hand = with_line(profiler, oil), by_hand(oil)
    end = length_of(hand, depth, 1e-6 * mL, vehicle)
    flight = one_run(vehicle, depth, speed, end, 30.0)
    sea = sea_of(flight)
    ran = hand.run([np.log(RESERVOIR), 0.0, 0.0], 0.0, end, sea, pumps=True)
    over = at_time(flight, end)
    # the valve of SciPy gives way at 12 Pa: their part of the line's give and of the power
    assert 1e6 * (over["v"] - flight.begin["v"]) == pytest.approx(ran[1], rel=5e-4)
    assert over["pump_energy"] == pytest.approx(ran[2], rel=1e-5)
    rested = hand.run(ran, end, end + 30.0, sea, pumps=False)
    assert 1e6 * flight.accounts[Account.PUMPED] == pytest.approx(rested[1], rel=2e-4)
    level = np.log(RESERVOIR) + flight.end["line_level"]
    assert level == pytest.approx(rested[0], abs=1e-4)


def at_time(flight, t):
    """The last row that is not later than t [s]."""
    return flight.rows[flight.rows["t"] <= t][-1]


@pytest.mark.parametrize(("volume", "air"), [(2e-5, 0.0), (1e-4, 0.02)])
def test_every_run_of_a_mission_begins_with_what_the_line_still_holds(profiler, sea, volume, air):
    """The line from the start to the surface, pauses of minutes to hours, by SciPy in one piece."""
    oil = Oil(volume=volume, bulk_modulus=1.4e9, trapped_air=air)
    vehicle, hand = with_line(profiler, oil), by_hand(oil)
    flight = fly_mission(vehicle, phases(), sea, accuracy=TIGHT, checked=False)
    pressure = sea_of(flight)
    y, t, held = np.array([np.log(RESERVOIR), 0.0, 0.0]), 0.0, 0
    runs = [(a, b) for a, b in runs_of(flight) if pressure(a) > 2e5]
    assert len(runs) >= 5
    for begin, end in runs:
        y = hand.run(y, t, begin, pressure, pumps=False, tolerance=1e-7)
        held += y[0] - np.log(RESERVOIR) > 0.02
        after = hand.run(y, begin, end, pressure, pumps=True, tolerance=1e-7)
        one, other = at_time(flight, begin), at_time(flight, end)
        assert 1e6 * (other["v"] - one["v"]) == pytest.approx(after[1] - y[1], rel=1e-3)
        used = other["pump_energy"] - one["pump_energy"]
        assert used == pytest.approx(after[2] - y[2], rel=1e-4)
        y, t = after, end
    assert held >= 2 or air == 0.0  # or nothing was told of what a line still holds


def test_a_pump_that_leaks_nothing_holds_its_line(profiler):
    """No slip: the vehicle rises, and the line gives what it holds; sinking, it gives nothing."""
    tight = PUMP.model_copy(update={"slip": 0.0})
    oil = Oil(volume=1e-4, bulk_modulus=1.4e9, trapped_air=0.05)
    vehicle = with_line(profiler, oil, pump=tight)
    hand = Line(oil, lambda h: 1.2e-6 + 0.0 * h, lambda h: 7.0 + 2e-6 * h, reservoir=RESERVOIR)
    flight = one_run(vehicle, 30.0, -0.2, 40.0, 60.0)
    assert flight.end["z"] < 15.0
    pressure = sea_of(flight)
    given = []
    for t in (40.0, 100.0):
        p = np.linspace(pressure(t), pressure(40.0), 2001)
        given.append(np.trapezoid(hand.give(p), p))
    vented = flight.end["v"] - at_time(flight, 40.0)["v"]
    assert vented == pytest.approx(given[1] - given[0], rel=1e-5)
    assert vented > 0.5e-6
    assert flight.accounts[Account.LEAKED] == pytest.approx(0.0, abs=1e-12)
    sinks = one_run(vehicle, 30.0, 0.2, 8.0, 10.0)
    assert sinks.end["v"] == at_time(sinks, 8.0)["v"]
    assert sinks.whole["shut"] == 1


def test_datasheets_their_amplifier_and_a_battery_that_sags(profiler):
    """A pump with motor, leakage and area ratio behind 0.15 ohm, by its own steady power."""
    pump = profiler.actuator.pump
    drive = pump.drive.model_copy(update={"area_ratio": 2.0, "pump_displacement": 2.4e-8})
    pump = DatasheetPump(motor=pump.motor, drive=drive)
    oil = Oil(volume=5e-5, bulk_modulus=1.4e9, trapped_air=0.03)
    vehicle = with_line(profiler, oil, pump=pump, resistance=0.15)

    def point(h):
        return datasheet_point(vehicle, pump, np.array([h]))

    hand = Line(
        oil,
        lambda h: float(point(h).drive.volume_rate[0]),
        lambda h: float(point(h).cells[0]),
        reservoir=RESERVOIR,
        slip=drive.pump_leakage / 4.0,
        ratio=2.0,
    )
    flight = one_run(vehicle, 300.0, -0.1, 6.0, 20.0)
    sea = sea_of(flight)
    ran = hand.run([np.log(RESERVOIR), 0.0, 0.0], 0.0, 6.0, sea, pumps=True)
    over = at_time(flight, 6.0)
    assert 1e6 * (over["v"] - flight.begin["v"]) == pytest.approx(ran[1], rel=3e-4)
    assert over["pump_energy"] == pytest.approx(ran[2], rel=1e-4)
    rested = hand.run(ran, 6.0, 26.0, sea, pumps=False)
    assert np.log(RESERVOIR) + flight.end["line_level"] == pytest.approx(rested[0], abs=2e-4)


def test_a_weak_pump_in_cold_water_fills_its_line_for_longer_and_dearer(profiler):
    """80 % of the delivery, and 0.2 W/K more below 15 degC."""
    oil = Oil(volume=1e-4, bulk_modulus=1.4e9, trapped_air=0.05)
    viscous = PUMP.model_copy(update={"power_per_temperature": -0.2})
    vehicle = with_line(profiler, oil, pump=viscous)
    vehicle = vehicle.model_copy(
        update={"water": vehicle.water.model_copy(update={"temperature": 4.0})}
    )
    hand = Line(
        oil,
        lambda h: 0.8 * (PUMP.delivery - PUMP.slip * h),
        lambda h: PUMP.idle_power + PUMP.power_per_pressure * h + 0.2 * 11.0,
        reservoir=RESERVOIR,
        slip=PUMP.slip,
    )
    flight = one_run(vehicle, 500.0, 0.1, 9.0, 1.0, drive_error=DriveError(pump=0.8))
    ran = hand.run([np.log(RESERVOIR), 0.0, 0.0], 0.0, 9.0, sea_of(flight), pumps=True)
    over = at_time(flight, 9.0)
    assert 1e6 * (over["v"] - flight.begin["v"]) == pytest.approx(ran[1], rel=5e-4)
    assert over["pump_energy"] == pytest.approx(ran[2], rel=1e-5)


@pytest.mark.parametrize("air", [0.0, 0.05])
def test_energy_and_volume_add_up(profiler, sea, air):
    vehicle = with_line(profiler, Oil(volume=1e-4, trapped_air=air), resistance=0.15)
    balance = close_balance(fly_mission(vehicle, phases(), sea, accuracy=TIGHT, checked=False))
    assert balance.relative_residue < 1e-6
    assert abs(balance.volume_residue) < 1e-12
    assert balance.battery["pump"] > 0.0


@pytest.mark.parametrize("slip", [0.0, 2e-14])
def test_a_line_in_swell_gives_no_energy_and_takes_no_steps(profiler, sea, slip):
    """A metre of swell at 30 m: the sea's pressure goes up and down past the line's."""
    swell = np.array([[1.0, 0.8, 0.3, 0.0, 0.8**2 / 9.81, 400.0]])
    steps = []
    for oil in (None, Oil(volume=1e-4, trapped_air=0.05)):
        vehicle = with_line(profiler, oil, pump=PUMP.model_copy(update={"slip": slip}))
        flight = fly_mission(vehicle, phases(deep=30.0), sea, waves=swell)
        balance = close_balance(flight)
        assert balance.relative_residue < 1e-4
        assert abs(balance.volume_residue) < 1e-12
        steps.append(flight.whole["steps"])
    assert steps[1] < 1.5 * steps[0]


def test_a_stiff_line_is_the_papers_incompressible_oil(profiler, sea):
    """What a line costs goes with its give, to nothing."""
    none = fly_mission(with_line(profiler, None), phases(), sea, accuracy=TIGHT)
    for modulus, off in ((1.5e12, 1e-4), (9e14, 2e-7)):
        stiff = with_line(profiler, Oil(volume=5e-5, bulk_modulus=modulus))
        flight = fly_mission(stiff, phases(), sea, accuracy=TIGHT, checked=False)
        for what in (Account.PUMP_ENERGY, Account.PUMPED, Account.DRAG):
            assert flight.accounts[what] == pytest.approx(none.accounts[what], rel=off)


def test_a_line_fills_on_the_bottom_and_a_pump_that_cannot_fill_it_has_stalled(profiler):
    oil = Oil(volume=1e-4, bulk_modulus=1.4e9, trapped_air=0.05)
    hand = by_hand(oil)
    vehicle = with_line(profiler, oil)
    end = length_of(hand, 200.0, 5e-7, vehicle)
    lying = one_run(vehicle, 200.0, 0.0, end, 1.0, bottom=200.0)
    assert lying.end["v"] - lying.begin["v"] == pytest.approx(5e-7, rel=1e-6)
    weak = PUMP.model_copy(update={"slip": 1.2e-6 / 5e6})  # nothing beyond 5 MPa
    beaten = one_run(with_line(profiler, oil, pump=weak), 700.0, 0.0, 300.0, 1.0, bottom=700.0)
    assert beaten.accounts[Account.STALLED] == pytest.approx(300.0)
    assert beaten.end["v"] == beaten.begin["v"]
    # all but the filling, a minute at most, at the power of the pressure at which it stalls
    power = beaten.accounts[Account.PUMP_ENERGY] / 300.0
    assert 0.8 * (7.0 + 2e-6 * 5e6) < power < 7.0 + 2e-6 * 5e6


def test_a_start_that_falls_short_besides_waits_until_its_line_is_full(profiler):
    oil = Oil(volume=1e-4, bulk_modulus=1.4e9, trapped_air=0.05)
    hand, vehicle = by_hand(oil), with_line(profiler, oil, start_volume=3e-6)
    end = length_of(hand, 100.0, 5e-6, vehicle)
    flight = one_run(vehicle, 100.0, 0.0, end, 1.0, bottom=100.0)
    assert flight.end["v"] - flight.begin["v"] == pytest.approx(2e-6, rel=1e-5)  # it lifts off
    starts = flight.rows["t"][np.flatnonzero(flight.rows["doing"] == Doing.PUMPING)[0]]
    full = length_of(hand, 100.0, 0.0, vehicle)
    head = vehicle.water.specific_weight * 100.0 + 101325.0 - RESERVOIR
    assert starts == pytest.approx(full + 3e-6 / hand.delivery(head), rel=1e-6)
    assert flight.notes["number"][flight.notes["what"] == Note.RUN_OVER][0] == end


@pytest.mark.parametrize(("reservoir", "air"), [(0.0, 0.0), (9e3, 0.1)])
def test_a_line_needs_a_reservoir_at_some_pressure(profiler, reservoir, air):
    values = profiler.actuator.model_dump() | {
        "line": {"volume": 1e-5, "trapped_air": air},
        "internal_pressure": reservoir,
    }
    with pytest.raises(InputError, match=r"internal_pressure"):
        type(profiler.actuator)(**values)
