"""The vehicles that come with swimbladder, and where their numbers come from."""

import math
import tomllib

import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.io.presets import preset_names, preset_text
from swimbladder.vehicle.schema import dotted


def leaves(table, path=()):
    for key, value in table.items():
        if isinstance(value, dict):
            yield from leaves(value, (*path, key))
        else:
            yield dotted((*path, key))


@pytest.mark.parametrize("name", preset_names())
def test_every_number_of_a_preset_says_where_it_comes_from(name):
    vehicle = load_vehicle(name)
    data = tomllib.loads(preset_text(name))
    assert vehicle.name == name
    assert vehicle.description
    sources = data.pop("provenance")
    words = {"schema_version", "name", "description"}
    places = [
        p for p in leaves(data) if p not in words and p.rpartition(".")[2] not in ("kind", "law")
    ]
    covered = {
        source
        for source in sources
        for place in places
        if place == source or place.startswith(f"{source}.")
    }
    # A part that is left at its default (a sensor without noise, a trim of 0) may have a source.
    known = set(type(vehicle).model_fields)
    assert {s for s in sources if s not in covered} <= known, (
        "a source for a field that is not there"
    )
    unsourced = [p for p in places if not any(p == s or p.startswith(f"{s}.") for s in sources)]
    assert unsourced == []


def test_the_papers_vehicle_has_the_papers_numbers():
    """Section 3, Table 2 row (26) and Table 3 of Falcao Carneiro et al. 2023."""
    v = load_vehicle("feup-em")
    assert (v.actuator.K1, v.actuator.T1) == (0.444e-3, 0.09)
    assert (v.actuator.depth_voltage, v.actuator.k_l) == (7.707e-2, 0.0)
    assert v.hull.psi == 4.04e-6
    assert (v.motion.K2, v.motion.T2) == (7935.54, 36.3)
    assert (v.hull.displaced_volume, v.hull.height, v.hull.depth_limit) == (0.0275, 1.285, 100.0)
    assert (v.stroke.minimum, v.stroke.maximum) == (-350e-6, 350e-6)
    assert v.controller.sample_time == 0.3
    assert v.controller.parameters == {
        "k_pV": "1002 V/dm3",
        "k_pz": "-0.1043 dm3/m",
        "k_iz": "-7.486e-4 dm3/s/m",
        "k_dz": "-2.341 dm3 s/m",
    }


def test_the_papers_vehicle_has_our_choices_where_the_paper_is_silent():
    v = load_vehicle("feup-em")
    assert v.actuator.piston_area == 0.0075
    assert v.supply.voltage == 12.0
    assert v.hull.waterplane_area == pytest.approx(math.pi * 0.1**2, rel=1e-15)
    assert (v.water.density, v.water.gravity) == (1000.0, 9.80665)
    assert v.hull.emergence_depth == 0.0
    ours = {place for place, source in v.provenance.items() if source.startswith("ours")}
    assert {"actuator.piston_area", "supply.voltage", "water", "hull.waterplane_area"} <= ours
