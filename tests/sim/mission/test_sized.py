"""A sized drive flown: the mission does the cycles it was sized for, cold and years included."""

import dataclasses

import numpy as np
import pytest

import swimbladder as sb
from swimbladder.design.sizing import Dive, load_parts, size, sized_vehicle
from swimbladder.design.sizing.evaluation import Budget
from swimbladder.io.mission import Mission
from swimbladder.physics.battery import needed_capacity, usable_share
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.records import Stop
from swimbladder.sim.mission.balance import close_balance
from swimbladder.sim.mission.flight import fly_mission

BODY = sb.load_vehicle("example-eh")
DIVE = Dive(max_depth=1000.0, park_time=9 * 86400.0, cycles=60, surface_energy=300.0)
DOWN = 990.0  # m, of a body rated for 1000 m
TASK = Mission(
    phases=[
        {"kind": "descend", "depth": DOWN, "tolerance": 10.0},
        {"kind": "park", "depth": DOWN, "tolerance": 50.0, "duration": DIVE.park_time},
        {"kind": "surface", "duration": DIVE.surface_time},
    ]
)


def parts(**changes):
    """Pumps of the typical list, and few of the rest."""
    listed = load_parts()
    few = {
        "supplies": (24.0,),
        "windings": (1.5,),
        "motors": listed.motors[1:2],
        "gears": (),
        "screws": (),
        "pistons": (),
        "amplifiers": listed.amplifiers[:1],
    }
    return listed.model_copy(update=few | changes)


@pytest.fixture(scope="module")
def cold():
    """Water of 4 degC at every depth."""
    column = uniform_column(BODY.water, 1100.0)
    return dataclasses.replace(column, temperature=np.full_like(column.depth, 4.0))


def flown(vehicle, column):
    flight = fly_mission(vehicle, TASK, column, cycles=10_000)
    assert flight.stop is Stop.RESERVE
    return flight, int(flight.whole["cycle"])


@pytest.mark.parametrize("battery", [0, 1, 2])
def test_the_mission_does_the_cycles_that_were_asked_for(cold, battery):
    """One more at most than 5 %, which is what `corrections` adds to a way that needs few."""
    listed = parts(batteries=load_parts().batteries[battery : battery + 1])
    found = size(BODY, DIVE, cast=cold, sweeps=False, parts=listed)
    flight, cycles = flown(sized_vehicle(found), cold)
    assert DIVE.cycles <= cycles <= 1.05 * DIVE.cycles + 1
    balance, spent = close_balance(flight).battery, found.evaluation.spent
    per_cycle = {key: value / cycles for key, value in balance.items()}
    standby = spent.driver_standby[found.best] / DIVE.cycles
    assert per_cycle["driver's standby"] == pytest.approx(standby, rel=0.01)
    lost = spent.self_discharged[found.best] / DIVE.cycles
    assert per_cycle["self-discharge"] == pytest.approx(lost, rel=0.02)


def test_the_capacity_for_what_a_cycle_took_is_that_many_cycles(cold):
    """Energy and time of a flown cycle in the place of the reckoned ones: to the cycle."""
    vehicle = sized_vehicle(size(BODY, DIVE, cast=cold, sweeps=False, parts=parts()))
    flight, cycles = flown(vehicle, cold)
    balance = close_balance(flight)
    each = (balance.drawn - balance.battery["self-discharge"]) / cycles
    for wanted in (40, 80):
        capacity = needed_capacity(
            wanted * each,
            wanted * flight.duration / cycles,
            0.9 * usable_share(vehicle.supply, 4.0),
            vehicle.supply.self_discharge,
        )
        supply = vehicle.supply.model_copy(update={"capacity": float(capacity)})
        _, again = flown(vehicle.model_copy(update={"supply": supply}), cold)
        assert again in (wanted, wanted + 1)


def test_without_a_reserve_it_lasts_as_long_as_the_battery_says(cold):
    dive = dataclasses.replace(DIVE, battery_reserve=0.0)
    found = size(BODY, dive, cast=cold, sweeps=False, parts=parts())
    mean = found.evaluation.spent.drawn[found.best] / (dive.cycles * dive.cycle_time)
    supply = sized_vehicle(found).supply
    full, s = supply.capacity, supply.self_discharge
    left = full * (1.0 - usable_share(supply, 4.0))  # held back by the cold
    lasts = np.log((full + mean / s) / (left + mean / s)) / s  # of dC/dt = -mean - s C
    assert lasts == pytest.approx(dive.cycles * dive.cycle_time, rel=1e-9)


def test_the_parts_of_the_battery_are_all_of_it(cold):
    found = size(BODY, DIVE, cast=cold, sweeps=False, parts=parts())
    w, spent = found.evaluation, found.evaluation.spent
    whole = spent.drawn + spent.self_discharged + spent.cold + spent.reserve + spent.unusable
    kept = w.feasible
    assert np.allclose(whole[kept], spent.carried[kept], rtol=1e-12)
    each = np.stack([getattr(spent, field.name) for field in dataclasses.fields(Budget)])
    assert np.all(each[:, kept] >= 0.0)


def test_without_cold_driver_and_years_it_is_the_plain_sum(cold):
    """Each one alone adds what its formula says, the rest being as without it."""
    listed = parts()
    ideal = [
        kind.model_copy(update={"cold_share": 1.0, "self_discharge": 0.0})
        for kind in listed.batteries[2:]
    ]
    no_driver = type(listed.driver)()
    plain = listed.model_copy(update={"batteries": tuple(ideal), "driver": no_driver})
    found = size(BODY, DIVE, cast=cold, sweeps=False, parts=plain)
    b, w = found.best, found.evaluation
    rest = DIVE.hotel * DIVE.cycle_time + DIVE.surface_energy
    carried = DIVE.cycles * (w.cycle_energy[b] + rest) / 0.9 / ideal[0].usable
    assert w.battery_energy[b] == pytest.approx(carried, rel=1e-12)
    stands_by = plain.model_copy(
        update={"driver": no_driver.model_copy(update={"standby_power": 0.01})}
    )
    more = size(BODY, DIVE, cast=cold, sweeps=False, parts=stands_by).evaluation
    added = DIVE.cycles * 0.01 * DIVE.cycle_time / 0.9 / ideal[0].usable
    assert more.battery_energy[b] - carried == pytest.approx(added, rel=1e-9)
    half = plain.model_copy(
        update={"batteries": (ideal[0].model_copy(update={"cold_share": 0.5}),)}
    )
    more = size(BODY, DIVE, cast=cold, sweeps=False, parts=half).evaluation
    assert more.battery_energy[b] == pytest.approx(carried / (1.0 - 0.5 * 16.0 / 20.0), rel=1e-12)


def test_a_battery_that_time_empties_is_none(cold):
    leaky = load_parts().batteries[1].model_copy(update={"self_discharge": 1e-7})
    with pytest.raises(sb.NoAnswerError, match="the charge"):
        size(BODY, DIVE, cast=cold, sweeps=False, parts=parts(batteries=(leaky,)))


def test_cold_water_is_assumed_where_nothing_says():
    found = size(BODY, DIVE, sweeps=False, parts=parts())
    assert found.asked.coldest == 4.0
    warm = size(
        BODY, dataclasses.replace(DIVE, battery_temperature=20.0), sweeps=False, parts=parts()
    )
    assert warm.evaluation.battery_energy[warm.best] < found.evaluation.battery_energy[found.best]
    assert np.all(warm.evaluation.spent.cold[warm.evaluation.feasible] == 0.0)
