"""The nine parameters of section 2.3, and the vehicle that is written."""

import numpy as np
import pytest

from studies.benches import Motor, log_of, measured, random_moves, steps, travel
from swimbladder.errors import InputError, LogError, NoAnswerError
from swimbladder.estimation.actuator import identify_actuator
from swimbladder.io.config import load_vehicle, read_model
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.actuator import reduced, unified
from swimbladder.vehicle import Identified, Vehicle
from tests.quoted import refused

NINE = ("K1", "T1", "K2", "T2", "A", "k_z/k_u", "k_l", "psi", "rho g")


@pytest.fixture(scope="module")
def log():
    time, voltage = steps([3.0, -3.0, 12.0, -12.0], hold=1.0, rest=1.0, step=0.02)
    position = measured(travel(Motor(), time, voltage), np.random.default_rng(1), noise=1e-5)
    return log_of(time, position, voltage=voltage)


def test_without_a_vehicle_the_logs_fix_two_and_the_rest_is_not_known(log):
    found = identify_actuator([log])
    assert tuple(known.symbol for known in found.nine) == NINE
    sources = {known.symbol: known.source for known in found.nine}
    assert {s for s, source in sources.items() if source == "logs"} == {"K1", "T1"}
    assert {source for s, source in sources.items() if s not in ("K1", "T1")} == {"not known"}
    with pytest.raises(NoAnswerError, match="No vehicle"):
        _ = found.vehicle


def test_with_the_papers_vehicle_each_other_one_says_where_it_is_from(log):
    nine = {k.symbol: k for k in identify_actuator([log], load_vehicle("feup-em")).nine}
    assert nine["K1"].source == "logs"
    assert {s: nine[s].value for s in ("K2", "T2", "A", "k_z/k_u", "k_l", "psi")} == {
        "K2": 7935.54,
        "T2": 36.3,
        "A": 75e-4,
        "k_z/k_u": 7.707e-2,
        "k_l": 0.0,
        "psi": 4.04e-6,
    }
    assert nine["rho g"].value == pytest.approx(9806.65)
    assert "7.707e-2" in nine["k_z/k_u"].origin
    assert nine["psi"].origin.startswith("section 3.2")


def test_with_datasheets_they_follow_from_motor_and_drive(log):
    vehicle = load_vehicle("example-em")
    nine = {k.symbol: k for k in identify_actuator([log], vehicle).nine}
    assert nine["k_z/k_u"].value == reduced(vehicle.actuator, vehicle.water).load_drive
    assert "follows from motor and drive" in nine["k_z/k_u"].origin
    moves = random_moves(np.random.default_rng(4), Motor(T1=0.05))
    nine = {k.symbol: k for k in identify_actuator([moves], load_vehicle("ntnu-bv")).nine}
    assert "follows from masses and drag" in nine["T2"].origin
    assert "a positioner has none" in nine["k_z/k_u"].origin


def test_the_identified_vehicle_has_the_numbers_and_their_covariance(log):
    found = identify_actuator([log], load_vehicle("feup-em"))
    again = read_model(Vehicle, vehicle_file(found.vehicle), "vehicle.toml")
    assert again == found.vehicle
    assert found.parameters["K1"].value == again.actuator.K1
    assert again.actuator.depth_voltage == 7.707e-2
    assert "95 % interval" in again.provenance["actuator.T1"]
    known = again.identified
    assert known.names == ("K1", "T1")
    assert np.sqrt(known.covariance[0][0]) == pytest.approx(found.parameters["K1"].std, rel=1e-6)
    assert known.logs == ("bench.csv",)


def test_what_was_identified_before_stays_beside_it(log):
    before = Identified(
        names=("K2", "K1"),
        values=(8e3, 1e-3),
        covariance=((1e4, 1e-9), (1e-9, 1e-8)),
        depth_noise=2e-3,
        logs=("pool.csv",),
    )
    vehicle = load_vehicle("feup-em").model_copy(update={"identified": before})
    known = identify_actuator([log], vehicle).vehicle.identified
    assert known.names == ("K1", "T1", "K2")
    assert known.values[2] == 8e3
    assert known.covariance[2] == (0.0, 0.0, 1e4)
    assert known.depth_noise == 2e-3
    assert known.logs == ("pool.csv", "bench.csv")


def test_a_datasheet_vehicle_becomes_an_identified_one(log, tmp_path):
    found = identify_actuator([log], load_vehicle("example-em"))
    path = tmp_path / "vehicle.toml"
    path.write_text(vehicle_file(found.vehicle), encoding="utf-8")
    again = load_vehicle(path)
    assert again.actuator.kind == "identified"
    assert again.actuator.piston_area == load_vehicle("example-em").actuator.drive.piston_area
    assert not any(place.startswith("actuator.motor") for place in again.provenance)


def test_a_volume_without_a_piston_becomes_one_of_a_square_metre(log):
    volume = log_of(log.time, None, volume=75e-4 * log.piston, voltage=log.voltage)
    found = identify_actuator([volume], load_vehicle("example-eh"))
    actuator = found.vehicle.actuator
    assert actuator.piston_area == 1.0
    assert pytest.approx(75e-4 * Motor().K1, rel=0.01) == actuator.K1
    nine = {k.symbol: k for k in found.nine}
    assert nine["A"].value is None


@pytest.mark.parametrize("name", ["example-eh", "unified"])
def test_metres_per_volt_are_no_volume_rate_without_a_piston(log, name):
    vehicle = load_vehicle("example-em" if name == "unified" else name)
    if name == "unified":
        made = unified(vehicle.actuator, vehicle.water)
        vehicle = vehicle.model_copy(update={"actuator": made})
    with refused(LogError, field="piston_m or volume_m3"):
        identify_actuator([log], vehicle)
    both = log_of(log.time, log.piston, volume=75e-4 * log.piston, voltage=log.voltage)
    found = identify_actuator([both], vehicle)
    gain = reduced(found.vehicle.actuator, vehicle.water).gain
    assert gain == pytest.approx(75e-4 * Motor().K1, rel=0.01)
    assert identify_actuator([both], load_vehicle("example-em")).quantity == "piston"


def test_moves_give_a_voltage_driven_vehicle_its_time_constant_only():
    moves = random_moves(np.random.default_rng(4), Motor(T1=0.05))
    found = identify_actuator([moves], load_vehicle("feup-em"))
    assert found.parameters["T1"].value == found.vehicle.actuator.T1
    assert found.vehicle.actuator.K1 == 0.444e-3
    assert found.vehicle.identified.names == ("T1",)


def test_the_load_of_the_sea_is_taken_off():
    """Eq. (33): in a pool the depth takes k_z/k_u z of the voltage."""
    time, voltage = steps([6.0, -6.0, 12.0, -12.0], hold=1.0, rest=1.0, step=0.02)
    deep = Motor(load=7.707e-2 * 20.0)
    position = measured(travel(deep, time, voltage), np.random.default_rng(1), noise=1e-5)
    log = log_of(time, position, voltage=voltage, depth=np.full(len(time), 20.0))
    alone = identify_actuator([log])
    assert alone.parameters["load_voltage"].value == pytest.approx(1.54, abs=0.05)
    assert any("without `vehicle=`" in note for note in alone.notes)
    told = identify_actuator([log], load_vehicle("feup-em"))
    assert told.parameters["load_voltage"].value == pytest.approx(0.0, abs=0.05)


def test_voltages_beyond_the_supply_are_cut(log):
    time, voltage = steps([3.0, -3.0, 8.0, -8.0, 20.0, -20.0], hold=1.0, rest=1.0, step=0.02)
    position = travel(Motor(), time, np.clip(voltage, -12.0, 12.0))
    seen = measured(position, np.random.default_rng(1), noise=1e-5)
    told = log_of(time, seen, voltage=voltage)
    found = identify_actuator([told], load_vehicle("feup-em"))
    low, high = found.parameters["K1"].ci95
    assert low < Motor().K1 < high
    assert any("cut" in note for note in found.notes)
    with refused(InputError, field="actuator.kind", value="positioner"):
        identify_actuator([log], load_vehicle("ntnu-bv"))
