"""A number has the digits that its standard deviation lets it have."""

import pytest

from swimbladder.show.estimates import with_std


@pytest.mark.parametrize(
    ("value", "std", "unit", "said"),
    [
        (36.9333, 8.3, "kg", "36.9 kg +- 8.3 kg"),
        (45.2031, 0.0123, "kg", "45.203 kg +- 0.012 kg"),
        (4.0552e-6, 5.8e-8, "m3/m", "4.055 cm3/m +- 0.058 cm3/m"),
        (-1.52e-3, 1.3e-3, "m/s", "-0.0015 m/s +- 0.0013 m/s"),
        (1234.0, 210.0, "1/m2/s", "1230 1/m2/s +- 210 1/m2/s"),
    ],
)
def test_a_number_has_the_digits_that_its_deviation_has(value, std, unit, said):
    assert with_std(value, std, unit) == said
