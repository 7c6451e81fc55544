"""What a campaign flies, how long, and what it keeps; a pump's table against its datasheet."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.steady_drives import pump_run
from swimbladder.sim.faults import run
from swimbladder.sim.faults.c_interface import IDEAL, SUPERVISED, UNSUPERVISED
from swimbladder.sim.faults.draw import FaultRow, Result, course_of, draw
from swimbladder.sim.faults.flight import EARLY, FULL, OWN
from swimbladder.sim.faults.run import FaultCampaign, faults, pump_table
from tests.codegen.conftest import gcc
from tests.vehicles import usual

__all__ = ["gcc"]

FEUP, FLOAT = load_vehicle("feup-em"), load_vehicle("example-float")
COURSE = course_of(usual(FEUP), None)


def campaign(monkeypatch=None, *, rest=0.0, again=1.0):
    """Return a campaign with no board: what is not flown."""
    if monkeypatch is not None:
        push = SimpleNamespace(push=SimpleNamespace(rest=rest, again=again))
        monkeypatch.setattr(run, "supervisor_parameters", lambda *_: push)
    return FaultCampaign(COURSE, SimpleNamespace(size=3, addresses={}))


@pytest.mark.parametrize(("rest", "longer"), [(0.0, 1.0), (1.5, 1.75), (4.0, 3.0), (90.0, 3.0)])
def test_who_rests_between_pushes_has_up_to_three_times_as_long(rest, longer, monkeypatch):
    made, mission = (
        campaign(monkeypatch, rest=rest, again=2.0),
        draw(COURSE, seed=1, number=3, healthy=False),
    )
    end = mission.condition.end
    assert made._lengthened(mission, UNSUPERVISED).condition.end == end
    assert made._lengthened(mission, IDEAL).condition.end == end
    assert made._lengthened(mission, SUPERVISED).condition.end == math.ceil(longer * end)


def test_what_came_is_kept_for_as_long_as_a_depth_may_be_late():
    """100 s of ticks, and the one of now."""
    assert len(campaign()._room.late) > 100.0 / COURSE.tick + 1.0
    assert len(campaign()._room.memory) == 3


UP = Result(last=900.0, arrived=0.0)
DOWN = Result(last=900.0)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("supervised", [UP, DOWN])
@pytest.mark.parametrize("ideal", [UP, DOWN])
def test_ways_to_fly_a_mission(count, supervised, ideal, monkeypatch):
    """Three; a fourth where two faults bring the vehicle down both ways."""
    made, flown = campaign(), []

    def fly(_mission, who, how):
        flown.append((who, how))
        return np.array({1: supervised, 2: UP, 3: ideal, 4: UP}[len(flown)])

    monkeypatch.setattr(made, "flown", fly)
    tick = SimpleNamespace(tick=0.3)
    found = made.flights(SimpleNamespace(condition=tick, faults=(4, 5)[:count]))
    ways = [(SUPERVISED, OWN), (UNSUPERVISED, OWN), (IDEAL, FULL)]
    if count == 2 and supervised is DOWN and ideal is DOWN:
        ways.append((IDEAL, EARLY))
    assert flown == ways
    assert len(found) == len(ways)


@pytest.fixture(scope="module")
def flown(request):
    request.getfixturevalue("gcc")
    shares = []
    found = faults(usual(FEUP), missions=25, seed=6, advance=shares.append)
    assert sum(shares) == pytest.approx(1.0)
    return found


def test_a_tenth_as_many_are_flown_in_health_and_one_at_least(flown):
    assert len(flown.healthy) == 2
    assert len(faults(usual(FEUP), missions=5, seed=6).healthy) == 1


@pytest.mark.parametrize("well", [False, True])
def test_a_row_has_what_was_drawn(flown, well):
    for number, row in enumerate(flown.healthy if well else flown.faulty):
        one = draw(flown.course, seed=6, number=number, healthy=well)
        plant = Plant(*one.plant)
        assert row["start"] == one.depths[0]
        assert row["deepest"] == max(one.depths)
        assert (row["bottom"], row["supply"]) == (plant.z_bottom, plant.supply)
        struck = [FaultRow(*fault) for fault in row["faults"]]
        assert [f.kind for f in struck] == [*one.faults, 0, 0][:2]
        for fault, drawn in zip(struck, one.fault_rows, strict=False):
            assert tuple(fault) == tuple(drawn)
        missing = np.isnan(row["flights"]).all(axis=1)
        assert not missing[: 1 if well else 3].any()
        assert missing[1:].all() or not well
        assert np.isnan(row["faults"][len(one.faults) :, 1:]).all()


@pytest.mark.parametrize(
    ("counts", "said"),
    [
        ({"missions": 0}, "missions"),
        ({"missions": 10_000_001}, "missions"),
        ({"missions": 1, "healthy": 0}, "healthy"),
        ({"missions": 1, "healthy": 10_000_001}, "healthy"),
    ],
)
def test_from_one_mission_to_ten_million(counts, said):
    with pytest.raises(InputError, match=rf"{said}: .* from 1 to 10,000,000"):
        faults(usual(FEUP), **counts)


def test_ten_million_and_one_are_the_ends(monkeypatch):
    class BegunError(Exception):
        pass

    def begun(*_):
        raise BegunError

    monkeypatch.setattr(run, "course_of", begun)
    for missions, healthy in ((10_000_000, 1), (1, 10_000_000)):
        with pytest.raises(BegunError):
            faults(FEUP, missions=missions, healthy=healthy)


def test_a_pumps_table_is_its_datasheet_at_each_voltage_and_head():
    """From no voltage to the nominal one, from the surface to deeper than any sea."""
    table, a = pump_table(FLOAT), FLOAT.actuator
    rows, columns = table.rate.shape
    assert table.current.shape == (rows, columns)
    assert (rows - 1) / table.per_volt == pytest.approx(FLOAT.supply.voltage)
    assert (columns - 1) / table.per_metre == pytest.approx(12_000.0)
    assert table.nominal == FLOAT.supply.voltage
    assert table.resistance == FLOAT.supply.internal_resistance
    assert table.motor == a.pump.motor.resistance
    assert not table.rate[0].any()
    assert not table.current[0].any()
    for row in (1, rows // 3, rows // 2, rows - 1):
        volts = row / table.per_volt
        fed = FLOAT.model_copy(
            update={"supply": FLOAT.supply.model_copy(update={"voltage": volts})}
        )
        for column in (0, 1, columns // 8, columns // 3, columns - 1):
            head = FLOAT.water.specific_weight * column / table.per_metre
            head += ATMOSPHERIC_PRESSURE - a.internal_pressure
            gives = pump_run(fed, a.pump, np.array([head]))
            assert table.rate[row, column] == pytest.approx(float(gives.rate[0]), rel=1e-9)
            # (E - R i) i is the power at the terminals; where none gives it there is no current
            R, power = FLOAT.supply.internal_resistance, float(gives.power[0])
            left = volts**2 - 4.0 * R * power
            current = (volts - math.sqrt(left)) / (2.0 * R) if left >= 0.0 else 0.0
            assert table.current[row, column] == pytest.approx(current, rel=1e-7)


def test_a_vehicle_without_a_pump_has_no_table():
    assert pump_table(FEUP) is run.NO_PUMP
