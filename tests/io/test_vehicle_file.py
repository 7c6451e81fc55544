"""A vehicle written as TOML is read back as the same vehicle, to the bit."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.io.config import load_vehicle, read_model
from swimbladder.io.presets import preset_names
from swimbladder.io.vehicle_file import KINDS, vehicle_file, vehicle_template
from swimbladder.vehicle import Identified, Vehicle


def again(vehicle):
    return read_model(Vehicle, vehicle_file(vehicle), "written.toml")


@pytest.mark.parametrize("name", preset_names())
def test_presets_survive(name):
    vehicle = load_vehicle(name)
    assert again(vehicle) == vehicle


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_survives(kind, tmp_path):
    path = tmp_path / "vehicle.toml"
    path.write_text(vehicle_template(kind), encoding="utf-8")
    vehicle = load_vehicle(path)
    path.write_text(vehicle_file(vehicle), encoding="utf-8")
    assert load_vehicle(path) == vehicle


def test_what_was_identified_survives():
    known = Identified(
        names=("K1", "T1"),
        values=(4.44e-4, 0.09),
        covariance=((1e-12, 0.0), (0.0, 1e-6)),
        logs=("a b.csv (log=1)",),
        random_walk=1e-8,
    )
    vehicle = load_vehicle("feup-em").model_copy(update={"identified": known})
    assert again(vehicle) == vehicle


@given(text=st.text(min_size=1), number=st.floats(1e-12, 1e6), head=st.text())
def test_any_text_and_number_survive(text, number, head):
    vehicle = load_vehicle("feup-em")
    changed = vehicle.model_copy(
        update={
            "description": text,
            "provenance": {text: text},
            "actuator": vehicle.actuator.model_copy(update={"K1": number}),
        }
    )
    written = vehicle_file(changed, head=head)
    assert read_model(Vehicle, written, "written.toml") == changed


def test_the_unit_stands_beside_the_number():
    written = vehicle_file(load_vehicle("feup-em"), head="Two\nlines")
    assert written.startswith("# Two\n# lines\n")
    assert "K1 = 0.000444 # m/s/V\n" in written
    assert tomllib.loads(written)["provenance"]["actuator.k_l"] == "section 3.2: 0"
