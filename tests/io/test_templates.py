"""The files to start from: they load as they are, and with every field taken in."""

import re
import tomllib

import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.io.vehicle_file import KINDS, vehicle_start, vehicle_template
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.hull import neutral_volume, weight_mass
from swimbladder.physics.seawater import uniform_column
from swimbladder.units import parse_quantity
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.schema import models_in, tags_of


def loaded(folder, text):
    path = folder / "made.toml"
    path.write_text(text, encoding="utf-8")
    return load_vehicle(path)


def test_there_is_a_template_for_every_kind_of_actuator():
    kinds = {
        tag
        for model in models_in(Vehicle.model_fields["actuator"].annotation)
        for tag in tags_of(model)
    }
    assert set(KINDS) == kinds


@pytest.mark.parametrize("kind", KINDS)
def test_a_template_loads_as_it_is(tmp_path, kind):
    vehicle = loaded(tmp_path, vehicle_template(kind, name="first"))
    assert vehicle.actuator.kind == kind
    assert vehicle.name == "first"
    assert vehicle.controller is not None


@pytest.mark.parametrize("kind", KINDS)
def test_a_template_loads_with_every_field_taken_in_and_defaults_are_the_defaults(tmp_path, kind):
    text = vehicle_template(kind)
    full = re.sub(r"^#(?! )", "", text, flags=re.MULTILINE)
    with_all = loaded(tmp_path, full)
    assert with_all.actuator.kind == kind
    plain = loaded(tmp_path, text)
    # What was commented out as a default changes nothing.
    for part in ("water", "motion", "sensors", "trim_error"):
        assert getattr(with_all, part) == getattr(plain, part)
    assert with_all.stroke.model_copy(update={"switch_margin": None}) == plain.stroke


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "identified"])
def test_a_template_is_a_vehicle_that_weighs_what_it_displaces(tmp_path, kind):
    vehicle = loaded(tmp_path, vehicle_template(kind))
    assert vehicle.motion.dry_mass == pytest.approx(weight_mass(vehicle), rel=2e-3)


def test_the_float_of_the_template_does_its_rating_in_sea_water(tmp_path):
    vehicle = loaded(tmp_path, vehicle_template("pump-valve"))
    hull, law = vehicle.hull, vehicle.controller.parameters
    assert vehicle.water.density == pytest.approx(1025.0)
    assert hull.waterplane_area * hull.height == pytest.approx(hull.displaced_volume, rel=0.01)
    coefficient = vehicle.motion.drag.k_dt / (vehicle.water.density * vehicle.water.gravity)
    told = parse_quantity(law["coefficient"], "m3 s2/m2")
    assert told == pytest.approx(coefficient, rel=0.01)
    column = uniform_column(vehicle.water, hull.depth_limit)
    volumes = neutral_volume(vehicle, column)
    assert vehicle.stroke.minimum < volumes.min()
    assert volumes.max() < vehicle.stroke.maximum
    assert volumes[-1] < volumes[0]  # stiffer than the water: psi below 0
    assert drive_map(vehicle, column.pressure).rate_out.min() > 0.0


def fields(model, given):
    """Every field that a table of the chosen kinds can have, as nested names."""
    found = set()
    for name, info in model.model_fields.items():
        found.add(name)
        members = models_in(info.annotation)
        if len(members) > 1:
            members = [m for m in members if given[name]["kind"] in tags_of(m)]
        if members:
            found |= {f"{name}.{inner}" for inner in fields(members[0], given.get(name, {}))}
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_a_template_has_every_field_of_the_schema_with_its_meaning(kind):
    text = vehicle_template(kind)
    full = tomllib.loads(re.sub(r"^#(?! )", "", text, flags=re.MULTILINE))

    def names(table, path=""):
        for key, value in table.items():
            yield path + key
            if isinstance(value, dict):
                yield from names(value, f"{path}{key}.")

    assert fields(Vehicle, full) <= set(names(full))
    for line, before in zip(text.splitlines()[1:], text.splitlines(), strict=False):
        if re.match(r"#?[a-z]\w* = ", line, flags=re.IGNORECASE) and "k_" not in line:
            assert before.startswith("# "), f"{line} is not explained"


@pytest.mark.parametrize("kind", KINDS)
def test_a_comment_of_a_new_vehicle_says_more_than_its_field(kind):
    """Behind a value stands what it means, in words of its own."""
    lines = [line for line in vehicle_start(kind).splitlines() if " = " in line and "  # " in line]
    assert len(lines) > 8
    for line in lines:
        field, said = line.split(" = ")[0], line.split("  # ")[1]
        assert said not in ("", field), line
