"""Parameter classes: what they accept, what they derive, what they refuse and how they say it."""

import copy
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from swimbladder import vehicle as parameters
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.presets import preset_names
from swimbladder.units import unit_factor
from swimbladder.vehicle import (
    Actuator,
    Drag,
    IdentifiedActuator,
    Motor,
    Stroke,
    Vehicle,
    field_unit,
    input_error,
)
from swimbladder.vehicle.schema import Parameters, did_you_mean, dotted, meanings

FEUP = {
    "name": "feup",
    "actuator": {"kind": "identified", "K1": "0.444 mm/s/V", "T1": 0.09, "piston_area": "75 cm2"},
    "supply": {"voltage": 12},
    "stroke": {"minimum": "-350 cm3", "maximum": "350 cm3"},
    "hull": {
        "displaced_volume": "27.5 L",
        "psi": 4.04e-6,
        "waterplane_area": 0.0314,
        "height": "1285 mm",
    },
    "motion": {"kind": "identified", "K2": 7935.54, "T2": 36.3},
}


def changed(path, value):
    """The vehicle above with one field set, or taken away where the value is None."""
    data = copy.deepcopy(FEUP)
    *parents, last = path.split(".")
    table = data
    for name in parents:
        table = table.setdefault(name, {})
    if value is None:
        del table[last]
    else:
        table[last] = value
    return data


def refused(data):
    with pytest.raises(ValidationError) as caught:
        Vehicle.model_validate(data)
    return input_error(caught.value, Vehicle)


@pytest.mark.parametrize("name", preset_names())
def test_equal_vehicles_have_one_hash_so_that_a_function_can_be_cached_by_them(name):
    one, same = load_vehicle(name), load_vehicle(name)
    assert one == same
    assert len({one, same, one.replace({"trim_error": 2e-6})}) == 2


def test_texts_with_units_become_si():
    v = Vehicle(**FEUP)
    assert v.actuator.K1 == 4.44e-4
    assert v.stroke.minimum == -3.5e-4
    assert v.hull.height == 1.285


def test_mass_and_drag_follow_from_the_identified_motion():
    v = Vehicle(**FEUP)
    # eqs (28)-(29): K2 = rho g/k_dl and T2 = m/k_dl
    weight = 1000.0 * 9.80665
    assert v.mass == pytest.approx(weight * 36.3 / 7935.54, rel=1e-15)
    assert v.drag.k_dl == pytest.approx(v.mass / 36.3, rel=1e-15)
    assert v.drag.law == "linear"


def test_mass_is_dry_and_entrained_and_added():
    drag = {"law": "quadratic", "k_dt": 20.0}
    masses = {"dry_mass": 33.0, "entrained_mass": 5.5, "added_mass": 6.4}
    v = Vehicle(**changed("motion", {"kind": "physical", **masses, "drag": drag}))
    assert v.mass == pytest.approx(44.9)
    assert v.drag is v.motion.drag


def test_neutral_volume_is_psi_z_and_the_trim_error():
    v = Vehicle(**changed("trim_error", "-10 cm3"))
    assert v.neutral_volume(0.0) == pytest.approx(-1e-5)
    assert v.neutral_volume(50.0) == pytest.approx(50 * 4.04e-6 - 1e-5)


def test_a_positioner_needs_no_supply_and_takes_a_volume():
    data = changed("actuator", {"kind": "positioner", "speed": "1 mm/s", "piston_area": 0.01})
    del data["supply"]
    assert not Vehicle(**data).voltage_driven
    assert Vehicle(**FEUP).voltage_driven


def test_emf_constant_is_the_torque_constant_where_not_given():
    common = {"resistance": 1.0, "torque_constant": 0.03, "rotor_inertia": 1e-5}
    assert Motor(**common).k_emf == 0.03
    assert Motor(**common, emf_constant=0.029).k_emf == 0.029


def test_nothing_can_be_changed_afterwards():
    with pytest.raises(ValidationError, match="frozen"):
        Vehicle(**FEUP).hull.psi = 0.0


@pytest.mark.parametrize(
    ("path", "value", "field", "words"),
    [
        ("hull.psy", 1.0, "hull.psy", "unknown field. Did you mean psi?"),
        ("hul", {}, "hul", "unknown field. Did you mean hull?"),
        ("hull.psi", None, "hull.psi", 'Add a line psi = "... m3/m"'),
        ("hull", None, "hull", "Add a table [hull]"),
        ("actuator", None, "actuator", "Add a table [actuator]"),
        ("name", None, "name", "Add a line name"),
        ("hull.psi", "4 cm3", "hull.psi", "of another kind (got '4 cm3', expected unit m3/m)"),
        ("hull.psi", {"a": 1}, "hull.psi", "not a quantity"),
        ("hull.height", "-1 m", "hull.height", "must be greater than 0 (got '-1 m'"),
        ("hull.height", 1e16, "hull.height", "1e+16 m is beyond any vehicle"),
        ("actuator.T1", "1e-30 s", "actuator.T1", "Check the unit; sizes from 1e-20 to 1e+15"),
        ("hull.height", float("nan"), "hull.height", "not a finite number"),
        ("hull.depth_limit", 0, "hull.depth_limit", "expected unit m). Check the number"),
        ("actuator.T1", float("inf"), "actuator.T1", "not a finite number"),
        ("actuator.kind", "identifed", "actuator.kind", "Did you mean identified? Choose from "),
        ("actuator.kind", None, "actuator.kind", "is missing. Allowed: electrohydraulic, "),
        ("actuator", 3, "actuator", "not a table (got 3). Write [actuator] on a line"),
        ("actuator.K2", 3, "actuator.K2", "unknown field. Known here: K1, T1, "),
        ("name", 3, "name", "not a text (got 3). Write it in quotes"),
        ("name", "", "name", "an empty text"),
        ("provenance.x", 3, "provenance.x", "not a text"),
        ("stroke.minimum", 1.0, "stroke.minimum", "not below the maximum, 350 cm3"),
        ("supply", None, "supply", "Add a table [supply]"),
        ("trim_error", "350 cm3", "trim_error", "can not both sink and rise"),
        (
            "motion",
            {"kind": "physical", "dry_mass": 1.0, "drag": {"law": "cubic"}},
            "motion.drag.law",
            "Allowed: linear, quadratic, switched, switched-literal, blended",
        ),
        (
            "motion",
            {"kind": "physical", "dry_mass": 1.0, "drag": {"k_dl": 1.0, "k_dt": 2.0}},
            "motion.drag.k_dt",
            "does not use it (got 2.0, expected unit N s2/m2). Leave it out",
        ),
        (
            "motion",
            {"kind": "physical", "dry_mass": 1.0, "drag": {"law": "switched", "k_dl": 1.0}},
            "motion.drag.k_dt",
            "Add k_dt",
        ),
        (
            "actuator",
            {"kind": "unified", "literal_efficiency": 1},
            "actuator.literal_efficiency",
            "Write true or false",
        ),
        (
            "controller",
            {"law": "cascade", "sample_time": 0.3, "parameters": {"k": [1]}},
            "controller.parameters.k",
            'Write a number, or a text like "1002 V/dm3"',
        ),
    ],
)
def test_what_is_wrong_is_said_with_field_and_remedy(path, value, field, words):
    data = changed(path, value)
    if path == "actuator" and isinstance(value, dict):
        data["actuator"] |= {"inertia": 1, "k_u": 1, "k_v": 1, "k_q": 1, "k_z": 1}
    error = refused(data)
    assert error.field == field
    assert words in str(error)
    assert error.remedy


def test_an_error_of_a_class_called_in_python_is_the_same_error():
    with pytest.raises(InputError, match=r"^minimum: the minimum, 2e\+06 cm3, is not below"):
        Stroke(minimum=2.0, maximum=1.0)
    with pytest.raises(InputError, match=r"cls: unknown field"):
        Stroke(minimum=-1.0, maximum=1.0, cls=3)


scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(["1 m", "-1 kg", "1e400 V", "identified", "linear"]),
    st.just([]),
    st.just({}),
    st.just([{}]),
)
FIELDS = sorted(
    {
        f"{table}.{name}"
        for table, fields in FEUP.items()
        if isinstance(fields, dict)
        for name in (*fields, "kind", "typo")
    }
    | set(FEUP)
    | {"water", "sensors", "controller", "provenance", "description", "schema_version", "typo"}
)


@given(st.sampled_from(FIELDS), scalars)
def test_any_value_in_any_field_is_taken_or_refused_with_a_remedy(path, value):
    data = copy.deepcopy(FEUP)
    table, _, name = path.rpartition(".")
    (data[table] if table else data)[name] = value
    try:
        Vehicle.model_validate(data)
    except ValidationError as caught:
        error = input_error(caught, Vehicle)
        assert error.field
        assert error.remedy
        # The message names what was changed, or what is missing beside it.
        part = error.field.partition(".")[0]
        assert (
            error.field.startswith(path)
            or part == table
            or (table, part) == ("stroke", "trim_error")
        )


def models():
    found = [x for name, x in vars(parameters).items() if not name.startswith("_")]
    return [m for m in found if isinstance(m, type) and issubclass(m, Parameters)]


@pytest.mark.parametrize("model", models(), ids=lambda m: m.__name__)
def test_every_field_says_what_it_is_and_its_unit_can_be_parsed(model):
    for name, info in model.model_fields.items():
        if name != "kind":
            assert meanings(model)[name]
        unit = field_unit(model, name)
        if unit is not None:
            assert unit_factor(unit, unit) == 1.0
        elif info.annotation is float:
            pytest.fail(f"{name} is a number without a unit")


def test_every_actuator_has_its_own_kind():
    union = get_args(get_args(Actuator)[0])
    kinds = [member.model_fields["kind"].default for member in union]
    assert len(set(kinds)) == len(kinds) == 6
    assert all(issubclass(member, BaseModel) for member in union)


@pytest.mark.parametrize(
    ("drag", "fine"),
    [
        ({"law": "linear", "k_dl": 1.0}, True),
        ({"law": "quadratic", "k_dt": 1.0}, True),
        ({"law": "blended", "k_dl": 1.0, "k_dt": 1.0}, True),
        ({"law": "switched", "k_dl": 1.0, "k_dt": 1.0, "epsilon": 0.1}, True),
        ({"law": "switched-literal", "k_dl": 1.0, "k_dt": 1.0, "epsilon": 0.1}, True),
        ({"law": "linear"}, False),
        ({"law": "quadratic", "k_dt": 1.0, "k_dl": 1.0}, False),
        ({"law": "blended", "k_dl": 1.0, "k_dt": 1.0, "epsilon": 0.1}, False),
    ],
)
def test_a_drag_law_takes_what_it_uses_and_nothing_else(drag, fine):
    if fine:
        assert Drag(**drag).law == drag["law"]
    else:
        with pytest.raises(InputError):
            Drag(**drag)


def test_places_are_written_so_that_they_can_be_found():
    assert dotted(["setpoints", 0, "depth"]) == "setpoints[0].depth"
    assert dotted(["provenance", "hull.psi"]) == 'provenance."hull.psi"'
    assert dotted([]) == ""


def test_a_near_name_is_offered_and_a_far_one_is_not():
    assert did_you_mean("Displaced_Volum", ["displaced_volume", "psi"]).endswith(
        "displaced_volume? "
    )
    assert did_you_mean("xyz", ["displaced_volume", "psi"]) == ""


def test_bounds_hold_after_the_conversion_of_units():
    common = {"kind": "identified", "K1": 1e-3, "piston_area": 0.01}
    assert IdentifiedActuator(**common, T1="10 ms").T1 == 0.01
    with pytest.raises(InputError, match="must be greater than 0"):
        IdentifiedActuator(**common, T1="0 ms")
