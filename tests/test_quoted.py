"""The numbers that tests find in messages."""

import pytest

from tests.quoted import numbers


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("K1 is off by 12 mL rms, 2.9 times", {12.0, 2.9}),
        ("between -0.30 and 0.50 cm3/m (95 %).", {-0.3, 0.5, 95.0}),
        ("7.69e-08 m3/m at 3 m.", {7.69e-8, 3.0}),
        ("steps of 20, -20 cm3", {20.0, -20.0}),
        ("step_2 of feup-em, T2 and m3", set()),
    ],
)
def test_numbers_in_a_message(text, found):
    assert numbers(text) == found
