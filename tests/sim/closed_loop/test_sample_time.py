"""Sample times at which a law does not hold its vehicle are refused, by eigenvalues."""

import numpy as np
import pytest
from scipy.linalg import expm

from swimbladder.cli import main
from swimbladder.design.linear.models import exponential_of
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.presets import preset_text
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.closed_loop.block import schedule
from tests.quoted import refused

STEP = {"setpoints": [(0.0, 3.0)], "duration": 600.0, "start_depth": 1.5}


def sampled(vehicle, sample_time):
    own = vehicle.controller.model_copy(update={"sample_time": sample_time})
    return vehicle.model_copy(update={"controller": own})


@pytest.fixture(scope="module")
def feup():
    return load_vehicle("feup-em")


def error_left(vehicle, sample_time):
    """How far from the target of a small step it is in the last third of the time, over the step.

    An unstable loop ends in a limit cycle, or beyond its limits at the surface or the bottom.
    """
    s = simulate(
        sampled(vehicle, sample_time),
        setpoints=[(0.0, 1.51)],
        duration=2400.0,
        start_depth=1.5,
        checked=False,
    )
    return float(np.max(np.abs(s.depth[2 * len(s.depth) // 3 :] - 1.51))) / 0.01


def test_what_is_refused_does_not_settle_and_the_longest_that_is_named_does(feup):
    with refused(InputError, field="controller.sample_time", value=10.0) as caught:
        simulate(sampled(feup, 10.0), **STEP)
    error = caught.value
    assert (error.unit, error.exit_code) == ("s", 2)
    longest = float(error.remedy.split()[2])
    assert 0.3 < longest < 10.0
    assert error_left(feup, 10.0) > 0.5
    assert error_left(feup, 0.9 * longest) < 0.1
    simulate(sampled(feup, 0.9 * longest), **STEP)
    with refused(InputError, field="controller.sample_time", value=1.3 * longest):
        simulate(sampled(feup, 1.3 * longest), **STEP)
    assert error_left(feup, 1.3 * longest) > 0.5


@pytest.mark.parametrize("sample_time", [0.5, 0.8])
def test_what_holds_the_vehicle_is_not_refused(feup, sample_time):
    s = simulate(sampled(feup, sample_time), **{**STEP, "duration": 2400.0})
    assert s.finished
    assert np.abs(s.depth[2 * len(s.depth) // 3 :] - 3.0).max() < 1e-3


def test_a_law_that_holds_at_no_sample_time_is_flown_to_see(feup):
    """Its inner loop drives the volume the wrong way: no sample time is to blame."""
    numbers = feup.controller.parameters | {"k_pV": "-200 V/dm3"}
    own = feup.controller.model_copy(update={"parameters": numbers})
    s = simulate(feup.model_copy(update={"controller": own}), **STEP)
    assert np.abs(s.depth[len(s.depth) // 2 :] - 3.0).max() > 1.0


def test_the_command_says_the_same(tmp_path, capsys):
    text = preset_text("feup-em")
    lines = [
        'sample_time = "10 s"' if line.startswith("sample_time") else line
        for line in text.splitlines()
    ]
    path = tmp_path / "slow.toml"
    path.write_text("\n".join(lines))
    out = tmp_path / "out"
    assert main(["simulate", str(path), "--out", str(out)]) == 2
    with pytest.raises(InputError) as caught:
        simulate(load_vehicle(path), setpoints=[(0.0, 3.0)], duration=400.0, start_depth=1.5)
    assert capsys.readouterr().err.strip().removeprefix("error: ") == str(caught.value)
    assert not out.exists()


def test_an_exponential_is_that_of_scipy():
    random = np.random.default_rng(1)
    for size, scale in ((1, 1.0), (4, 0.1), (5, 3.0), (6, 30.0)):
        matrix = scale * (random.standard_normal((size, size)) - size * np.eye(size))
        np.testing.assert_allclose(exponential_of(matrix), expm(matrix), rtol=1e-9, atol=1e-13)
    np.testing.assert_array_equal(exponential_of(np.zeros((3, 3))), np.eye(3))


def test_a_run_shorter_than_a_sample_is_one_sample():
    short = schedule([0.0], 0.1, 0.3)
    assert short.ticks == 1
    assert short.turn.tolist() == [0, 0]
