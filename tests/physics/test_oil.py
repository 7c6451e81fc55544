"""The oil's compression against its definition, the integral of it, and the usual formula."""

import math

import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swimbladder.errors import InputError
from swimbladder.physics import oil
from swimbladder.vehicle import Oil, Water
from tests.quoted import refused

SEA = Water(density=1025.0)
ATM = 101325.0

airy = st.fixed_dictionaries(
    {"beta": st.floats(0.5e9, 3e9), "air": st.floats(0.0, 0.2), "n": st.floats(1.0, 1.4)}
)


def test_eq_2_with_the_papers_own_numbers_gives_two_thirds_of_a_percent():
    """10 MPa on 1.5 GPa; the paper prints 0.6 % and loses the sign."""
    change = oil.relative_volume_change(dp=10e6, beta_e=1.5e9)
    assert change == pytest.approx(-2.0 / 300.0, rel=1e-14)


def test_an_airless_oil_at_1000_m_of_sea_water():
    found = oil.oil_compression(Oil(volume=1e-3), 1000.0, SEA)
    assert found.pressure == pytest.approx(1025.0 * 9.80665 * 1000.0, rel=1e-14)
    assert found.bulk_modulus == pytest.approx(1.5e9, rel=1e-14)
    assert found.linear == pytest.approx(-found.pressure / 1.5e9, rel=1e-14)
    assert found.exact == pytest.approx(math.expm1(-found.pressure / 1.5e9), rel=1e-12)
    assert found.volume == pytest.approx(found.exact * 1e-3, rel=1e-14)


def test_an_amplifier_halves_the_pressure_and_what_the_water_sees_of_it():
    plain = oil.oil_compression(Oil(volume=1e-3), 500.0, SEA)
    amplified = oil.oil_compression(Oil(volume=1e-3), 1000.0, SEA, n_h=2.0)
    assert amplified.exact == plain.exact
    assert amplified.volume == pytest.approx(plain.volume / 2.0, rel=1e-14)


def test_trapped_air_is_lost_in_the_first_metres_which_eq_2_does_not_see():
    found = oil.oil_compression(Oil(volume=1e-3, trapped_air=0.01), 1000.0, SEA)
    assert found.exact < found.linear - 0.009
    assert found.exact > -0.01 - 10.1e6 / 1.5e9
    # Eq. (2) as the paper uses it: the modulus at 5 MPa for a change of 10 MPa.
    halfway = oil.effective_bulk_modulus(p=ATM + found.pressure / 2.0, beta=1.5e9, air=0.01)
    assert found.bulk_modulus == halfway


@given(airy, st.floats(0.5, 200.0))
def test_the_modulus_is_the_slope_of_the_volume(properties, atmospheres):
    """dV/dp = -V/beta_e integrated by SciPy from one atmosphere gives the volume."""
    p = atmospheres * ATM
    solution = solve_ivp(
        lambda q, V: -V / oil.effective_bulk_modulus(p=q, **properties),
        (ATM, p),
        [1.0],
        rtol=1e-11,
        atol=1e-13,
    )
    assert oil.oil_volume_ratio(p=p, **properties) == pytest.approx(solution.y[0, -1], rel=1e-8)


@given(airy, st.floats(1.0, 100.0))
def test_the_modulus_is_the_usual_one_up_to_the_liquids_own_compression(properties, atmospheres):
    """The formula of Simscape's Hydraulic Fluid, a = air over liquid at one atmosphere."""
    p, E, n = atmospheres * ATM, properties["beta"], properties["n"]
    a = properties["air"] / (1.0 - properties["air"])
    usual = (
        E
        * (1.0 + a * (ATM / p) ** (1 / n))
        / (1.0 + a * E * ATM ** (1 / n) / n / p ** ((n + 1) / n))
    )
    found = oil.effective_bulk_modulus(p=p, **properties)
    assert found == pytest.approx(usual, rel=1.01 * (p - ATM) / E + 1e-12)


def test_limits_of_the_modulus():
    assert oil.effective_bulk_modulus(p=5e6, beta=1.5e9, air=0.0) == pytest.approx(1.5e9, rel=1e-14)
    slow = oil.effective_bulk_modulus(p=ATM, beta=1e30, air=0.3)
    assert slow == pytest.approx(ATM / 0.3, rel=1e-12)  # only the air gives way
    fast = oil.effective_bulk_modulus(p=ATM, beta=1e30, air=0.3, n=1.4)
    assert fast == pytest.approx(1.4 * slow, rel=1e-12)
    assert oil.effective_bulk_modulus(p=100e6, beta=1.5e9, air=0.01) == pytest.approx(
        1.5e9, rel=2e-3
    )


def test_eq_1_by_hand_and_by_dimension():
    assert oil.oil_pressure_rate(Q=2e-6, dV_oil_dt=2e-6, V_oil=1e-3, beta_e=1.5e9) == 0.0
    closed = oil.oil_pressure_rate(Q=1e-6, dV_oil_dt=0.0, V_oil=1e-3, beta_e=1.5e9)
    assert closed == pytest.approx(1.5e6, rel=1e-14)
    growing = oil.oil_pressure_rate(Q=0.0, dV_oil_dt=1e-6, V_oil=1e-3, beta_e=1.5e9)
    assert growing == pytest.approx(-1.5e6, rel=1e-14)
    q = pint.UnitRegistry().Quantity
    rate = oil.oil_pressure_rate(
        Q=q(1.0, "mL/s"), dV_oil_dt=q(0.4, "mL/s"), V_oil=q(1.0, "L"), beta_e=q(1.5, "GPa")
    )
    assert rate.to("Pa/s").magnitude == pytest.approx(0.9e6, rel=1e-12)
    change = oil.relative_volume_change(dp=q(100.0, "bar"), beta_e=q(1.5, "GPa"))
    assert change.to("").magnitude == pytest.approx(-2.0 / 300.0, rel=1e-12)


def test_above_the_water_is_refused():
    with refused(InputError, field="depth", value=-1.0, holds={-1.0, 0.0}):
        oil.oil_compression(Oil(volume=1e-3), -1.0, SEA)
