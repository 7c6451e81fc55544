"""Laws by name, and a vehicle's controller turned into numbers."""

import inspect
import math

import pytest

from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.control.law import leaf_names, leaves
from swimbladder.control.registry import LAWS, bind, law_by_name, law_parameters
from swimbladder.design.tuning.gains import setting_of
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.vehicle import Controller
from tests.vehicles import TABLE_3


@pytest.mark.parametrize("name", LAWS)
def test_every_law_is_complete(name: str) -> None:
    law = law_by_name(name)
    assert law.name == name
    assert law.summary
    assert law.command in ("voltage", "volume", "volume change")
    assert set(law.units) == set(leaf_names(law.parameters))
    assert len(law.state._fields) >= 1
    assert list(inspect.signature(law.step).parameters) == [
        "parameters",
        "state",
        "measurement",
        "reference",
    ]
    assert list(inspect.signature(law.initial).parameters) == [
        "parameters",
        "measurement",
        "reference",
    ]


def test_table_3_in_SI() -> None:
    law, gains = bind(Controller(law="cascade", sample_time=0.3, parameters=TABLE_3))
    assert law is CASCADE
    assert gains == pytest.approx(
        CascadeParameters(k_pV=1002e3, k_pz=-0.1043e-3, k_iz=-7.486e-7, k_dz=-2.341e-3, S_p=0.3),
        rel=1e-14,
    )
    assert isinstance(gains, CascadeParameters)


def test_bare_numbers_are_SI() -> None:
    numbers = dict(k_pV=1e6, k_pz=-1e-4, k_iz=-7e-7, k_dz=-2e-3)
    assert law_parameters(CASCADE, numbers, sample_time=0.5) == CascadeParameters(
        1e6, -1e-4, -7e-7, -2e-3, 0.5
    )


def refused(field: str, says: str, **controller: object) -> InputError:
    given = dict(law="cascade", sample_time=0.3, parameters=TABLE_3) | controller
    with pytest.raises(InputError, match=says) as caught:
        bind(Controller(**given))
    assert caught.value.field == field
    return caught.value


def test_an_unknown_law() -> None:
    error = refused("controller.law", "unknown control law", law="cascad")
    assert "Did you mean cascade?" in str(error)
    assert all(name in str(error) for name in LAWS)


def test_an_unknown_parameter() -> None:
    error = refused(
        "controller.parameters.k_pv", "no such parameter", parameters=TABLE_3 | {"k_pv": 1.0}
    )
    assert "Did you mean k_pV?" in str(error)


def test_the_sample_time_is_not_a_parameter() -> None:
    refused("controller.parameters.S_p", "no such parameter", parameters=TABLE_3 | {"S_p": 0.3})


def test_a_missing_parameter() -> None:
    fewer = {name: value for name, value in TABLE_3.items() if name != "k_dz"}
    error = refused("controller.parameters.k_dz", "needs this parameter", parameters=fewer)
    assert error.unit == "m3 s/m"


def test_a_wrong_unit() -> None:
    error = refused(
        "controller.parameters.k_pz", "another kind", parameters=TABLE_3 | {"k_pz": "0.1 dm3/s"}
    )
    assert error.unit == "m3/m"


@pytest.mark.parametrize("name", LAWS)
def test_what_a_law_says_of_itself_is_about_its_own_parameters(name: str) -> None:
    law = LAWS[name]
    own = set(leaf_names(law.parameters))
    assert {law.volume_gain, law.dead_zone, law.near, law.band} - {""} <= own
    if law.recipe is None:
        return
    assert law.recipe.fast or law.recipe.quiet or law.recipe.sleeps or law.recipe.candidates
    vehicle = load_vehicle("feup-em")
    setting = setting_of(vehicle, sample_time=0.3, supply=12.0, neutral_range=5e-5)
    made = law.recipe.gains(setting, law.recipe.example)
    assert type(made) is law.parameters
    assert all(math.isfinite(value) for value in leaves(made).values())
    # The voltage per volume error is that of the inner rate: V' = K1 A u.
    if law.volume_gain:
        gain = leaves(made)[law.volume_gain]
        assert gain * setting.plant.gain == pytest.approx(law.recipe.example.inner)
