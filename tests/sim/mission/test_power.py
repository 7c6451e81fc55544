"""Power by consumer over time: its integral is the balance, however long a row lasts."""

import datetime

import numpy as np
import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.sim.engine.rodas.records import Doing
from swimbladder.sim.mission.balance import close_balance, consumer_energy, mean_power, power_names
from swimbladder.sim.mission.export import og1_dataset, trajectory_columns
from swimbladder.sim.mission.flight import fly_mission, reach_of, thinned
from swimbladder.sim.mission.prepare import make_plan
from swimbladder.sim.mission.result import MissionResult
from swimbladder.vehicle import Load
from tests.sim.mission.conftest import phases

PARKED = 40_000.0


@pytest.fixture(scope="module")
def flight(sea):
    """Every consumer there is, the leak and one load by the name of a drive's, which parks."""
    vehicle = load_vehicle("example-float")
    radio = Load(name="GPS & radio", energy_per_surfacing=35.0)
    pump = Load(name="pump", power=0.03, phases=("park", "surface"), energy_per_surfacing=11.0)
    vehicle = vehicle.model_copy(update={"loads": (*vehicle.loads, radio, pump)})
    return fly_mission(vehicle, phases(cycles=2, duration=PARKED), sea)


@pytest.fixture(scope="module")
def result(flight):
    plan = make_plan(flight.vehicle, flight.mission, flight.column)
    return MissionResult(flight, reach_of(flight.vehicle, flight.mission, plan))


def integral(time, power):
    return float(np.sum(power[:-1] * np.diff(time)))


@pytest.mark.parametrize("spacing", [0.0, 7200.0])
def test_the_integral_of_each_column_is_the_book(flight, spacing):
    balance = close_balance(flight).battery
    rows = thinned(flight.rows, spacing)
    few = type(flight)(**{**vars(flight), "rows": rows})
    energy = consumer_energy(few)
    assert list(energy) == list(balance)
    assert {"driver's standby", "self-discharge", "GPS & radio", "pump (load)"} < set(balance)
    for name, taken in energy.items():
        power = mean_power(rows["t"], taken)
        assert integral(rows["t"], power) == pytest.approx(balance[name], rel=1e-11), name
        assert power.min() > -1e-9, name


def test_files_have_the_columns(result):
    columns, balance = trajectory_columns(result), result.balance.battery
    names = power_names(list(balance))
    assert names["GPS & radio"] == "power_gps_radio_W"
    assert names["driver's standby"] == "power_drivers_standby_W"
    t = columns["time_s"]
    for consumer, name in names.items():
        assert integral(t, columns[name]) == pytest.approx(balance[consumer], rel=1e-11)
    assert integral(t, columns["power_W"]) == pytest.approx(result.balance.drawn, rel=1e-11)
    begin = datetime.datetime(2026, 3, 1, tzinfo=datetime.UTC)
    data = og1_dataset(result, begin=begin)
    for name in ("power_W", *names.values()):
        variable = data[name.removesuffix("_W").upper()]
        assert np.array_equal(variable.values, columns[name])
        assert variable.attrs["units"] == "W"


def test_a_load_is_on_in_its_phases_and_a_session_lasts_to_the_end_of_its_phase(result):
    flight, columns = result.flight, trajectory_columns(result)
    last = np.append(np.diff(columns["time_s"]) <= 0.0, True)
    kinds = np.array([phase.kind for phase in flight.mission.phases])
    kind = kinds[columns["phase"].astype(int)]
    ctd = columns["power_ctd_W"]
    assert np.allclose(ctd[~last], np.where(kind == "profile", 0.3, 0.0)[~last], rtol=1e-6)
    radio = columns["power_gps_radio_W"]
    assert np.all(radio[kind != "surface"] == 0.0)
    # 35 J over the 900 s afloat that the phase has
    on = radio > 0.0
    assert np.allclose(radio[on], 35.0 / 900.0, rtol=1e-6)


def test_a_row_says_what_is_done_until_the_next(flight):
    rows, energy = flight.rows, consumer_energy(flight)
    lasts = np.append(np.diff(rows["t"]) > 0.0, False)
    pumping = np.isin(rows["doing"], [Doing.PUMPING, Doing.PRIMING])
    letting = np.isin(rows["doing"], [Doing.LETTING_IN, Doing.BYPASSING])
    for doing, consumer in ((pumping, "pump"), (letting, "valve")):
        power = mean_power(rows["t"], energy[consumer])
        assert doing.any()
        assert np.array_equal(power > 0.0, doing & lasts)


def test_the_answer_says_how_much_of_the_stroke_no_phase_took(result):
    """As planned, and as its volume was below the 5 m at which it dives and fills."""
    stroke, rows = result.flight.vehicle.stroke, result.flight.rows
    deep = rows["v"][rows["z"] > 5.0]
    left = min(stroke.maximum - deep.max(), deep.min() - stroke.minimum)
    left /= stroke.maximum - stroke.minimum
    assert 0.05 < left < 0.95
    planned = f"{100.0 * result.reach.margin:.0f} % of 600 cm3 as planned"
    assert result.sentence.endswith(f"; stroke margin {planned}, {100.0 * left:.0f} % flown")


def test_by_hand():
    time = np.array([0.0, 1.0, 1.0, 4.0, 4.0])
    # 2 J in a second, 5 J at an instant, 1 J in three seconds, 3 J at the end
    energy = np.array([0.0, 2.0, 7.0, 8.0, 11.0])
    assert mean_power(time, energy).tolist() == [2.0, 0.0, 3.0, 0.0, 0.0]
    assert mean_power(time[:1], energy[:1]).tolist() == [0.0]


def test_two_names_that_would_be_one_are_told_apart():
    names = power_names(["CTD 1", "CTD-1", "泵"])
    assert list(names.values()) == ["power_ctd_1_W", "power_ctd_1_2_W", "power_load_W"]
