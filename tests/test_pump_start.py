"""A pump's start under load against SciPy's Radau, a book of volumes, and the paper's limit."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.parameters import Oil
from swimbladder.pump_start import line_compliance, pump_start

ATMOSPHERE = 101325.0


def by_scipy(oil, rate, load, reservoir, n):
    """The time at which the line reaches the load, integrating eq. (1) in time."""

    def slope(_, p):
        gas = oil.volume * oil.trapped_air * (ATMOSPHERE / p[0]) ** (1.0 / n)
        beta_e = oil.volume / ((oil.volume - gas) / oil.bulk_modulus + gas / (n * p[0]))
        return [beta_e / oil.volume * rate(p[0] - reservoir)]

    def there(_, p):
        return p[0] - load

    there.terminal = True
    found = solve_ivp(
        slope, (0.0, 1e4), [reservoir], method="Radau", events=there, rtol=1e-10, atol=1e-3
    )
    return float(found.t_events[0][0])


@pytest.mark.parametrize("air", [0.0, 0.001, 0.1])
@pytest.mark.parametrize("load", [2e5, 5e6, 2e7])
@pytest.mark.parametrize("n", [1.0, 1.4])
def test_the_time_is_that_of_the_differential_equation(air, load, n):
    oil = Oil(volume=5e-5, bulk_modulus=1.4e9, trapped_air=air)

    def rate(dp):
        return 1e-6 - 2e-14 * dp

    found = pump_start(oil, rate, np.array([load]), reservoir=0.85e5, polytropic=n)
    expected = by_scipy(oil, rate, load, 0.85e5, n)
    assert found.duration[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("n", [1.0, 1.4])
def test_the_line_takes_in_what_its_air_and_oil_give_way(n):
    """The book of volumes in closed form: air by the polytropic law, liquid by its mass."""
    oil = Oil(volume=3e-5, bulk_modulus=1.5e9, trapped_air=0.2)
    low, high = ATMOSPHERE, 1.2e7
    found = pump_start(oil, lambda dp: np.full(np.shape(dp), 1e-6), np.array([high]), polytropic=n)
    gas = [0.2 * oil.volume * (ATMOSPHERE / p) ** (1.0 / n) for p in (low, high)]
    # Where the liquid gives way little, what flows in is what the air leaves, and V_l dp/beta.
    exact = (gas[0] - gas[1]) + (oil.volume / oil.bulk_modulus) * (high - low)
    correction = gas[0] * (high - low) / oil.bulk_modulus  # an upper bound of the cross term
    assert exact - correction < found.volume[0] < exact
    assert found.duration[0] == pytest.approx(found.volume[0] / 1e-6, rel=1e-12)
    assert found.shortfall[0] == pytest.approx(found.volume[0], rel=1e-12)


def test_a_stiff_line_is_the_papers_incompressible_oil():
    for stiffness in (1e12, 1e14):
        oil = Oil(volume=1e-4, bulk_modulus=stiffness)
        found = pump_start(oil, lambda dp: 1e-6 + 0.0 * dp, np.array([1e7]))
        assert found.duration[0] == pytest.approx(1e-4 * (1e7 - ATMOSPHERE) / stiffness / 1e-6)


def test_a_pump_that_stalls_never_opens_the_check_valve():
    oil = Oil(volume=1e-5)
    found = pump_start(oil, lambda dp: 1e-6 - 1e-13 * dp, np.array([5e6, 2e7]))
    assert np.isfinite(found.duration[0])
    assert found.duration[1] == np.inf
    assert found.shortfall[1] == 0.0


def test_compliance_of_pure_oil_and_of_pure_air():
    pure = Oil(volume=2e-5, bulk_modulus=1.5e9)
    assert line_compliance(pure, np.array([1e6]))[0] == pytest.approx(2e-5 / 1.5e9, rel=1e-12)
    foam = Oil(volume=2e-5, bulk_modulus=1e15, trapped_air=0.4)
    at_rest = line_compliance(foam, np.array([ATMOSPHERE]), polytropic=1.0)[0]
    assert at_rest == pytest.approx(0.4 * 2e-5 / ATMOSPHERE, rel=1e-6)
