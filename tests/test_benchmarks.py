"""The peers run the same mission and the yardstick is right, before anything is timed."""

import json
from collections.abc import Iterator

import numpy as np
import pytest

from benchmarks import c_loop, control_loop, numpy_loop, scipy_loop
from benchmarks.mission import BOTTOM, Fleet, Mission, fleet, mission
from benchmarks.reference import Reference, reference
from benchmarks.run import main
from benchmarks.table import number, ratio, render
from benchmarks.year import ALIKE, Tried, at_error, bracket
from swimbladder.io.config import load_vehicle

SHORT_STROKE = 15  # this vehicle of the fleet meets its end stops


@pytest.fixture(scope="module")
def task() -> Mission:
    """The mission in a twelfth of its time."""
    return mission(300.0)


@pytest.fixture(scope="module")
def many(task: Mission) -> Fleet:
    return fleet(task.vehicle, 40)


@pytest.fixture(scope="module")
def contact(task: Mission, many: Fleet) -> Reference:
    return reference(task, many, SHORT_STROKE)


@pytest.fixture(scope="module")
def build() -> Iterator[c_loop.Build]:
    if c_loop.compiler() is None:
        pytest.skip("no C compiler: $CC, gcc, cc or clang")
    with c_loop.built(lanes=16, width=256) as build:
        yield build


def test_reference_agrees_with_exact_exponentials_in_open_water() -> None:
    task = mission(60.0)
    nominal = fleet(task.vehicle, 1)
    answer = reference(task, nominal, 0)
    assert answer.touched == ""
    exact = control_loop.depths(task, nominal, 0)
    assert np.abs(exact - answer.depth).max() < 1e-11


def test_c_loop_agrees_with_scipy(
    build: c_loop.Build, task: Mission, many: Fleet, contact: Reference
) -> None:
    assert contact.entered["end stop"] > 0
    single = build.single(task, many, SHORT_STROKE)
    assert np.abs(single - contact.depth).max() < 3e-5
    for loop in c_loop.LOOPS:
        several = build.depths(task, many, loop=loop)
        assert np.abs(several[SHORT_STROKE] - contact.depth).max() < 3e-5
        summaries = build.summaries(task, many, threads=2, loop=loop)
        assert np.array_equal(summaries["z"], several[:, -1])
        assert np.allclose(summaries["deepest"], several.max(axis=1), rtol=0.0, atol=0.0)


def test_c_loop_is_the_same_scheme_as_numpy(
    build: c_loop.Build, task: Mission, many: Fleet
) -> None:
    ours, theirs = build.summaries(task, many), numpy_loop.summaries(task, many)
    for name in ("q", "V", "z", "w", "shallowest", "deepest", "rms"):
        assert np.allclose(ours[name], theirs[name], rtol=1e-10, atol=1e-12), name


@pytest.mark.parametrize("method", scipy_loop.METHODS)
def test_scipy_agrees_with_its_reference(
    method: str, task: Mission, many: Fleet, contact: Reference
) -> None:
    found = scipy_loop.depths(task, many, SHORT_STROKE, method)
    assert np.abs(found - contact.depth).max() < 1e-4


def test_bottom_and_surface_are_met(build: c_loop.Build) -> None:
    task = mission()
    found = build.summaries(task, fleet(task.vehicle, 256))
    assert 0.1 < np.mean(found["deepest"] == BOTTOM) < 0.9
    assert 0.5 < np.mean(found["shallowest"] < 0.0) < 0.9


def test_other_plants_are_refused() -> None:
    with pytest.raises(ValueError, match="written for linear drag"):
        fleet(load_vehicle("example-eh"), 1)


def test_tables() -> None:
    assert number(None) == "-"
    assert number(0.0812345) == "0.0812"
    assert number(1866.4) == "1,866"
    assert number(2.04e-6, 2) == "2.0e-06"
    assert ratio(3.0, 2.0) == "1.5 x"
    assert ratio(None, 2.0) == "-"
    assert render(["a", "b"], [["name", "1"]]).splitlines() == ["a     b", "----  -", "name  1"]


@pytest.mark.parametrize("order", [0.6, 1.0, 1.3])
def test_time_at_equal_error_of_a_method_of_any_order(order) -> None:
    """An error of 40 tolerance**order in a time of 2 tolerance**-0.2: powers are interpolated."""

    def run(tolerance: float) -> Tried:
        return Tried(tolerance, 40.0 * tolerance**order, 2.0 * tolerance**-0.2)

    above, below = bracket(run, 6.8e-3)
    assert below.error <= 6.8e-3 < above.error < ALIKE * below.error
    exact = 2.0 * (6.8e-3 / 40.0) ** (-0.2 / order)
    assert at_error(above, below, 6.8e-3) == pytest.approx(exact, rel=1e-9)


def test_the_nearest_errors_are_taken_where_they_jump() -> None:
    """Errors a decade apart, and one nearer that a halving would pass by."""

    def run(tolerance: float) -> Tried:
        error = 10.0 ** np.floor(np.log10(tolerance) + 1e-9)
        return Tried(tolerance, 3e-4 if 8e-4 < tolerance < 9e-4 else error, 1.0)

    above, below = bracket(run, 2e-4)
    assert (above.error, below.error) == pytest.approx((3e-4, 1e-4))
    for wanted, side in ((1e-15, "below"), (1.0, "above")):
        with pytest.raises(ArithmeticError, match=side):
            bracket(run, wanted)


@pytest.mark.prove
def test_quick_run(tmp_path, capsys) -> None:
    target = tmp_path / "scores.json"
    assert main(["--quick", "--json", str(target)]) == 0
    found = json.loads(target.read_text())
    assert "256 vehicles" in capsys.readouterr().out
    errors = found["scores"]["swimbladder"]["errors"].values()
    assert max(largest for largest, _ in errors) < 2e-6
    assert found["memory"]["peak_MB"] > 0.0
    assert [one["executor"] for one in found["campaign"]] == ["threads", "processes", "dask"]
    assert all(one["floats"] > 0.0 for one in found["campaign"])


def test_the_c_loop_leaves_the_processor_as_it_was() -> None:
    """Code linked with -ffast-math would flush subnormal numbers to zero everywhere."""
    if c_loop.compiler() is None:
        pytest.skip("no C compiler: $CC, gcc, cc or clang")
    with c_loop.built():
        assert float(np.float64(5e-324) * np.float64(1.0)) == 5e-324
