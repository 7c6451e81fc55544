"""The study of deep intervals: what it draws, and how it counts."""

import numpy as np
import pytest

from studies import deep_drawn
from studies.deep_calibration import main, summary
from studies.deep_drawn import again, drawn, known
from swimbladder.estimation.motion.deep_model import DEFAULT


def test_dives_differ_by_so_many_deviations_of_what_is_known() -> None:
    """Mean and spread of 4,000 draws about a vehicle, three deviations of each allowed."""
    rng, count = np.random.default_rng(5), 4000
    mean = {name: prior.mean + 0.7 * prior.std for name, prior in known().items()}
    draws = [deep_drawn._about(mean, 0.3, rng) for _ in range(count)]
    for name in DEFAULT:
        off = np.array([one[name] - mean[name] for one in draws]) / known()[name].std
        assert abs(np.mean(off)) < 3.0 * 0.3 / np.sqrt(count)
        assert np.std(off) == pytest.approx(0.3, rel=3.0 / np.sqrt(2.0 * count))
    assert {one["trapped_air"] for one in draws} == {mean["trapped_air"]}


def test_another_dive_is_of_the_same_vehicle_unless_dives_differ() -> None:
    first = drawn(1, seed=5)
    same, other = again(first, 1, 1, seed=5), again(first, 1, 1, seed=5, differ=0.3)
    assert same.values == first.values
    assert not np.array_equal(same.log.pressure, first.log.pressure)
    assert all(other.values[name] != first.values[name] for name in DEFAULT)
    once_more = again(first, 1, 1, seed=5, differ=0.3)
    assert once_more.values == other.values
    assert np.array_equal(once_more.log.pressure, other.log.pressure)


def test_shares_are_those_of_a_normal_number_where_errors_are_normal() -> None:
    errors = np.random.default_rng(2).normal(size=(20_000, 2))
    found = [{"error": {"a": a, "b": b}, "narrowed": {"a": 0.5, "b": 0.7}} for a, b in errors]
    for row in summary(found):
        assert [row.half, row.most, row.held] == pytest.approx([0.5, 0.8, 0.95], abs=0.012)
        assert row.rms == pytest.approx(1.0, abs=0.02)
    assert [row.name for row in summary(found)] == ["a", "b", "all"]
    assert summary(found)[-1].narrowed == pytest.approx(0.6)


@pytest.mark.parametrize("asked", [["--differ", "0.3"], ["--together", "0"]])
def test_what_makes_no_sense_is_refused(asked: list[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(asked)
    assert left.value.code == 2
