"""The [identified] table of a vehicle: what it takes, and what it refuses."""

import json
import re

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.presets import preset_text
from swimbladder.vehicle import Identified
from tests.quoted import refused

TABLE = """
[identified]
names = ["K2", "T2", "psi"]
values = [9000.0, 12.5, 2e-7]
covariance = [[1e4, 3.0, 0.0], [3.0, 0.04, 1e-9], [0.0, 1e-9, 1e-16]]
depth_noise = "2 mm"
neutral_std = "0.5 cm3"
random_walk = "0.2 cm3/s^0.5"
logs = ["pool.csv"]
"""


def written(folder, change=("", "")):
    path = folder / "mine.toml"
    path.write_text(preset_text("feup-em") + TABLE.replace(*change), encoding="utf-8")
    return path


def test_the_table_is_read_in_si(tmp_path):
    found = load_vehicle(written(tmp_path)).identified
    assert found.names == ("K2", "T2", "psi")
    assert found.values == (9000.0, 12.5, 2e-7)
    assert np.shape(found.covariance) == (3, 3)
    assert (found.depth_noise, found.neutral_std) == (0.002, 0.5e-6)
    assert found.random_walk == 0.2e-6
    assert found.logs == ("pool.csv",)
    assert load_vehicle("feup-em").identified is None


def test_vehicle_show_tells_it(tmp_path, capsys):
    assert main(["vehicle", "show", str(written(tmp_path)), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["parameters"]
    assert told["identified.random_walk"] == {"value": 0.2e-6, "unit": "m3/s^0.5"}
    assert told["identified.values"]["value"] == [9000.0, 12.5, 2e-7]


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        (('"psi"]', '"phi"]'), "identified.names[2]", "Allowed: K1, T1, K2, T2, mass"),
        (('"psi"]', '"K2"]'), "identified.names", "twice"),
        (('["K2", "T2", "psi"]', "[]"), "identified.names", "an empty list"),
        (('["K2", "T2", "psi"]', '"K2"'), "identified.names", "not a list"),
        ((", 2e-7]", "]"), "identified.values", "2 values for 3 names"),
        (("12.5", '"12.5 s"'), "identified.values[1]", "a bare number"),
        (("values = [9000.0, 12.5, 2e-7]\n", ""), "identified.values", "Add a line values = [...]"),
        (("[3.0, 0.04, 1e-9]", "[3.0, 0.04]"), "identified.covariance", "3 rows of 3"),
        (("[3.0, 0.04, 1e-9]", "[2.0, 0.04, 1e-9]"), "identified.covariance", "K2 and T2"),
        (("0.04", "-0.04"), "identified.covariance", "variances of 0 or more"),
        (("[1e4, 3.0", "[100.0, 3.0"), "identified.covariance", "between -1 and 1"),
        (("cm3/s^0.5", "cm3/s"), "identified.random_walk", "expected unit m3/s^0.5"),
    ],
)
def test_what_is_wrong_is_said_with_field_and_remedy(tmp_path, change, field, words):
    with pytest.raises(InputError) as caught:
        load_vehicle(written(tmp_path, change))
    assert caught.value.field == field
    assert caught.value.line is not None
    assert re.search(re.escape(words), str(caught.value))


def test_it_is_made_in_python_as_well():
    made = Identified(names=("T2",), values=(10,), covariance=((0.25,),), depth_noise="3 mm")
    assert made.depth_noise == 0.003
    with refused(InputError, field="covariance", holds={1.0}):
        Identified(names=("T2",), values=(10.0,), covariance=())
