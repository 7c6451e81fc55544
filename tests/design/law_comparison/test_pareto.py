"""The front against brute force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.design.law_comparison.run import front

COST = st.sampled_from([0.0, 1.0, 2.0, 3.0, float("nan"), float("inf")])


def by_hand(costs):
    """What the words say, row by row: nan is as bad as inf, rows without a number are out."""
    rows = [[float("inf") if c != c else c for c in row] for row in costs]

    def beats(a, b):
        return all(x <= y for x, y in zip(a, b, strict=True)) and any(
            x < y for x, y in zip(a, b, strict=True)
        )

    return [
        any(c < float("inf") for c in row) and not any(beats(other, row) for other in rows)
        for row in rows
    ]


@given(
    st.integers(1, 4).flatmap(
        lambda k: st.lists(st.lists(COST, min_size=k, max_size=k), min_size=1, max_size=9)
    )
)
def test_the_front_is_that_of_brute_force(costs):
    assert front(costs).tolist() == by_hand(costs)


def test_a_front_that_can_be_seen():
    costs = [[1.0, 5.0], [2.0, 2.0], [5.0, 1.0], [3.0, 3.0], [2.0, 2.0], [np.nan, 0.5]]
    assert front(costs).tolist() == [True, True, True, False, True, True]


def test_many_rows():
    costs = np.random.default_rng(3).normal(size=(200, 3))
    assert front(costs).tolist() == by_hand(costs.tolist())
    assert 0 < front(costs).sum() < 200
    assert front(-np.abs(costs[:1])).tolist() == [True]
    with pytest.raises(ValueError, match="inhomogeneous"):
        front([[1.0], [1.0, 2.0]])
