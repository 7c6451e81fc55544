"""A pump's start under load against SciPy's Radau, a volume balance, and the paper's limit."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from swimbladder.physics.steady_drives import OilLine, line_curves, pump_start
from swimbladder.vehicle import Oil

ATMOSPHERE = 101325.0


def power(dp):
    return 7.0 + 2e-6 * dp


def by_scipy(oil, rate, load, reservoir, n, ratio=1.0):
    """Time at which the line reaches the load, and the energy, integrating eq. (1) in time."""

    def slope(_, y):
        p, head = y[0], ratio * (y[0] - reservoir)
        gas = oil.volume * oil.trapped_air * (ATMOSPHERE / p) ** (1.0 / n)
        beta_e = oil.volume / ((oil.volume - gas) / oil.bulk_modulus + gas / (n * p))
        return [beta_e / oil.volume * ratio * rate(head), power(head)]

    def there(_, y):
        return y[0] - reservoir - (load - reservoir) / ratio

    there.terminal = True
    found = solve_ivp(
        slope,
        (0.0, 1e4),
        [reservoir, 0.0],
        method="Radau",
        events=there,
        rtol=1e-10,
        atol=[1e-3, 1e-9],
    )
    return float(found.t_events[0][0]), float(found.y_events[0][0][1])


@pytest.mark.parametrize("air", [0.0, 0.001, 0.1])
@pytest.mark.parametrize("load", [2e5, 5e6, 2e7])
@pytest.mark.parametrize("n", [1.0, 1.4])
def test_the_time_is_that_of_the_differential_equation(air, load, n):
    oil = Oil(volume=5e-5, bulk_modulus=1.4e9, trapped_air=air)

    def rate(dp):
        return 1e-6 - 2e-14 * dp

    found = pump_start(OilLine(oil, 0.85e5, polytropic=n), rate, np.array([load]), power=power)
    time, energy = by_scipy(oil, rate, load, 0.85e5, n)
    assert found.duration[0] == pytest.approx(time, rel=1e-6)
    assert found.energy[0] == pytest.approx(energy, rel=1e-6)


def test_an_amplifier_has_the_line_at_a_lower_pressure_and_gives_less_water():
    oil = Oil(volume=5e-5, bulk_modulus=1.4e9, trapped_air=0.02)

    def rate(dp):
        return 1e-6 - 2e-14 * dp

    found = pump_start(OilLine(oil, 0.85e5, 3.0), rate, np.array([1e7]), power=power)
    time, energy = by_scipy(oil, rate, 1e7, 0.85e5, 1.4, ratio=3.0)
    assert found.duration[0] == pytest.approx(time, rel=1e-6)
    assert found.energy[0] == pytest.approx(energy, rel=1e-6)


@pytest.mark.parametrize("highest", [2e7, 8e7])
def test_the_curves_of_a_line_are_its_starts_up_to_the_stall(highest):
    oil = Oil(volume=5e-5, bulk_modulus=1.4e9, trapped_air=0.02)

    def rate(dp):
        return 1e-6 - 2e-14 * dp  # nothing from 50 MPa on

    found = line_curves(OilLine(oil, 0.85e5, 2.0), rate, power, highest, 41, slip=2e-14)
    head = 2.0 * 0.85e5 * np.expm1(found.step * np.arange(41.0))
    if highest < 5e7:
        assert found.top == np.inf
        assert head[-1] == pytest.approx(highest, rel=1e-9)
    else:
        assert rate(head[-1]) == pytest.approx(1e-3 * rate(0.0), rel=1e-6)
    start = pump_start(OilLine(oil, 0.85e5, 2.0), rate, head[:-1] + 0.85e5, power=power)
    assert found.time[:-1, 0] == pytest.approx(start.duration, rel=1e-7)
    assert found.energy[:-1, 0] == pytest.approx(start.energy, rel=1e-7)


@pytest.mark.parametrize(("air", "end"), [(0.0, 1e3), (0.05, 1e3), (0.05, 3e6)])
def test_a_line_empties_through_a_pump_that_stands(air, end):
    """Radau from 10 MPa down to a head; the curves say it by the integral less its logarithm."""
    oil, slip = Oil(volume=1e-4, bulk_modulus=1.4e9, trapped_air=air), 2e-14
    line = OilLine(oil, 0.85e5)

    def slope(_, y):  # of the logarithm of the head
        p = 0.85e5 + np.exp(y[0])
        return [-slip / line.compliance(np.array(p))]

    def there(_, y):
        return y[0] - np.log(end)

    there.terminal = True
    fall = solve_ivp(
        slope, (0.0, 1e5), [np.log(1e7)], method="Radau", events=there, rtol=1e-10, atol=1e-10
    )
    found = line_curves(line, lambda dp: 1e-6 + 0.0 * dp, power, 1e7, 201, slip=slip)
    first = float(line.compliance(np.array(0.85e5))) / slip

    def at(head):
        y = np.log1p(head / 0.85e5)
        rows = found.step * np.arange(201.0)
        curve = CubicHermiteSpline(rows, found.falling[:, 0], found.falling[:, 1])
        return -first * np.log(head) - float(curve(y))

    assert at(end) - at(1e7) == pytest.approx(float(fall.t_events[0][0]), rel=1e-6)


@pytest.mark.parametrize("n", [1.0, 1.4])
def test_the_line_takes_in_what_its_air_and_oil_give_way(n):
    """The volume balance in closed form: air by the polytropic law, liquid by its mass."""
    oil = Oil(volume=3e-5, bulk_modulus=1.5e9, trapped_air=0.2)
    low, high = ATMOSPHERE, 1.2e7
    found = pump_start(
        OilLine(oil, polytropic=n), lambda dp: np.full(np.shape(dp), 1e-6), np.array([high])
    )
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
        found = pump_start(OilLine(oil), lambda dp: 1e-6 + 0.0 * dp, np.array([1e7]))
        assert found.duration[0] == pytest.approx(1e-4 * (1e7 - ATMOSPHERE) / stiffness / 1e-6)


def test_a_pump_that_stalls_never_opens_the_check_valve():
    oil = Oil(volume=1e-5)
    found = pump_start(OilLine(oil), lambda dp: 1e-6 - 1e-13 * dp, np.array([5e6, 2e7]))
    assert np.isfinite(found.duration[0])
    assert found.duration[1] == np.inf
    assert found.shortfall[1] == 0.0


def test_a_pump_that_just_stands_against_the_load_stalls_too():
    """Its flow is 0 there, not less: the line takes for ever, and nothing is divided by it."""
    found = pump_start(OilLine(Oil(volume=5e-5)), lambda dp: np.where(dp < 1e7, 1e-6, 0.0), 2e7)
    assert float(found.duration) == np.inf


def test_compliance_of_pure_oil_and_of_pure_air():
    pure = Oil(volume=2e-5, bulk_modulus=1.5e9)
    assert OilLine(pure).compliance(np.array([1e6]))[0] == pytest.approx(2e-5 / 1.5e9, rel=1e-12)
    foam = Oil(volume=2e-5, bulk_modulus=1e15, trapped_air=0.4)
    at_rest = OilLine(foam, polytropic=1.0).compliance(np.array([ATMOSPHERE]))[0]
    assert at_rest == pytest.approx(0.4 * 2e-5 / ATMOSPHERE, rel=1e-6)
