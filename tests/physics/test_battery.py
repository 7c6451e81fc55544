"""The battery against SciPy's integration, closed limits and hand-made loads."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from swimbladder.errors import NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.physics import battery
from swimbladder.vehicle import Driver, Load, Supply

SUPPLY = Supply(voltage=14.4, capacity=3.6e6, cold_share=0.8, self_discharge=2e-9)


def test_cold_holds_back_a_share_of_the_full_battery():
    assert battery.usable_share(SUPPLY, 20.0) == 1.0
    assert battery.usable_share(SUPPLY, 0.0) == pytest.approx(0.8)
    assert battery.usable_share(SUPPLY, 10.0) == pytest.approx(0.9)
    assert battery.usable_share(SUPPLY, 40.0) == 1.0
    charge = np.array([3.6e6, 1.8e6, 0.5e6])
    usable = battery.usable_charge(SUPPLY, charge, 0.0)
    assert usable == pytest.approx([3.6e6 * 0.8, 1.8e6 - 0.72e6, 0.0])


@pytest.mark.parametrize("temperature", [20.0, 2.0])
@pytest.mark.parametrize("s", [0.0, 2e-9])
def test_the_needed_capacity_is_gone_when_its_energy_is(temperature, s):
    duration, share = 3e6, battery.usable_share(SUPPLY, temperature)
    full = battery.needed_capacity(0.3 * duration, duration, share, s)

    def left(t):
        charge = solve_ivp(lambda _, C: -0.3 - s * C, (0.0, t), [full], rtol=1e-12, atol=1e-6)
        return charge.y[0, -1] - full * (1.0 - share)

    assert brentq(left, 0.0, 1e8) == pytest.approx(duration, rel=1e-9)


def test_loads_count_in_their_phases_and_at_surfacings():
    vehicle = load_vehicle("example-float").model_copy(
        update={
            "driver": Driver(standby_power=0.25),
            "loads": (
                Load(name="clock", power=1.0),
                Load(name="ctd", power=2.0, phases=("profile", "descend")),
                Load(name="radio", power=8.0, phases=("surface",), energy_per_surfacing=90.0),
                Load(name="gnss", energy_per_surfacing=10.0),
            ),
        }
    )
    assert battery.hotel_power(vehicle) == 1.25
    assert battery.hotel_power(vehicle, "profile") == 3.25
    assert battery.hotel_power(vehicle, "surface") == 9.25
    assert battery.surfacing_energy(vehicle) == 100.0
    assert battery.hotel_power(load_vehicle("feup-em")) == 0.0


def test_a_battery_that_is_not_stated_is_named():
    with pytest.raises(NoAnswerError, match=r"supply\.capacity"):
        battery.capacity(load_vehicle("feup-em"))
    with pytest.raises(NoAnswerError, match=r"supply\.capacity"):
        battery.usable_charge(Supply(voltage=12.0), 1.0, 20.0)
    assert battery.capacity(load_vehicle("example-float")) == 1500.0 * 3600.0


@pytest.mark.parametrize("self_discharge", [0.0, 1e-12, 1e-9, 3e-8])
@pytest.mark.parametrize("energy", [910.0, 20.3e3, 119e3])
def test_cycles_on_a_battery_are_those_of_a_count(self_discharge, energy):
    """Cycle by cycle, its power drawn evenly: with a reserve, and where it ends within a cycle."""
    full, duration = 1e6, 10.0 * 86400.0
    x = self_discharge * duration

    def after(charge):
        lost = -np.expm1(-x)
        return charge - energy if x == 0.0 else charge * (1.0 - lost) - energy * lost / x

    for reserve, empty in ((2e5, 1e5), (1e5, 1e5), (1.1e5, 1e5)):
        charge, count = full, 0
        while charge > reserve and after(charge) > empty:
            charge, count = after(charge), count + 1
        found = battery.lasting_cycles(
            full,
            reserve=reserve,
            empty=empty,
            energy=energy,
            duration=duration,
            self_discharge=self_discharge,
        )
        assert found == count


def test_a_battery_that_nothing_draws_from_lasts_for_ever_unless_it_loses_charge():
    given = {"reserve": 2e5, "empty": 1e5, "energy": 0.0, "duration": 86400.0}
    assert battery.lasting_cycles(1e6, self_discharge=0.0, **given) is None
    days = battery.lasting_cycles(1e6, self_discharge=1e-8, **given)
    assert days == int(np.ceil(np.log(5.0) / 1e-8 / 86400.0))
    assert battery.lasting_cycles(1e5, self_discharge=0.0, **{**given, "energy": 1.0}) == 0
