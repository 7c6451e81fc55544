"""Thrusters by momentum theory, hovering and profiling against hand-made sums and SciPy."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from swimbladder.design.energy import Thruster, drive_energy, hovering, profiling
from swimbladder.design.energy.run import versus_sentences
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.physics.seawater import uniform_column
from swimbladder.vehicle import (
    ElectromechanicalActuator,
    Oil,
    PowerLawPump,
    PumpAndValve,
    Valve,
)
from tests.quoted import refused

THRUSTER = Thruster(diameter=0.1, efficiency=0.4)
RHO, G = 1025.0, 9.80665


# --- thrusters --------------------------------------------------------------------------------
def test_hovering_takes_the_power_of_the_ideal_disc():
    area = math.pi / 4.0 * 0.1**2
    expected = 20.0**1.5 / math.sqrt(2.0 * RHO * area) / 0.4
    assert THRUSTER.power(20.0, RHO) == pytest.approx(expected, rel=1e-12)
    assert THRUSTER.power(-20.0, RHO, 3.0) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("speed", [0.05, 0.5, 2.0])
def test_under_way_mass_and_momentum_balance(speed):
    """T = rho A (w + v) 2 v solved for v by Brent, P = T (w + v)."""
    area = math.pi / 4.0 * 0.1**2
    v = brentq(lambda v: RHO * area * (speed + v) * 2.0 * v - 5.0, 0.0, 10.0, xtol=1e-15)
    assert THRUSTER.power(5.0, RHO, speed) == pytest.approx(5.0 * (speed + v) / 0.4, rel=1e-12)
    # The ideal efficiency of propulsion, T w/P, is below 1 and grows as the load gets lighter.
    light = 1e-6 * speed / (0.4 * THRUSTER.power(1e-6, RHO, speed))
    assert 5.0 * speed / (0.4 * THRUSTER.power(5.0, RHO, speed)) < light < 1.0
    assert light == pytest.approx(1.0, abs=1e-4)


def test_two_thrusters_are_one_of_twice_the_area_and_each_idles():
    two = Thruster(diameter=0.1, efficiency=0.4, number=2, idle_power=0.5)
    one = Thruster(diameter=0.1 * math.sqrt(2.0), efficiency=0.4)
    assert two.power(7.0, RHO, 0.3) == pytest.approx(one.power(7.0, RHO, 0.3) + 1.0, rel=1e-12)
    assert two.power(0.0, RHO) == 0.0


@pytest.mark.parametrize(
    ("kgf", "watt"),
    [(0.22, 2.4), (0.49, 8.4), (1.14, 33.6), (1.91, 72.0), (2.84, 133.2), (3.71, 202.9)],
)
def test_the_thruster_that_nobody_stated_is_that_of_its_maker(kgf, watt):
    """Blue Robotics, T200 at 12 V ahead, bollard pull in fresh water: t200_thrust_power.js."""
    assert 0.98 < Thruster().power(kgf * 9.80665, 998.0) / watt < 1.27


def test_at_the_least_thrust_a_maker_states_turning_takes_more_than_pushing():
    """0.04 kgf for 0.6 W, as above: what idle_power stands for."""
    assert 0.2 < 0.6 - Thruster().power(0.04 * 9.80665, 998.0) < 0.5


@pytest.mark.parametrize(
    "wrong", [{"diameter": 0.0}, {"efficiency": 1.2}, {"number": 0}, {"idle_power": -1.0}]
)
def test_no_such_thruster(wrong):
    with pytest.raises(InputError, match="it must be "):
        Thruster(**wrong)


# --- a vehicle whose pump draws the same per volume everywhere ---------------------------------
def constant(*, psi=0.0, per_volume=2e7, leakage=0.0, deepest=500.0):
    """A vehicle that takes `per_volume` [J/m3] out, nothing in, in water of constant density."""
    vehicle = load_vehicle("example-float")
    pump = PowerLawPump(delivery=1e-6, idle_power=per_volume * 1e-6, power_per_pressure=0.0)
    a = PumpAndValve(pump=pump, valve=Valve(flow=1e-8), leakage=leakage, internal_pressure=101325.0)
    supply = vehicle.supply.model_copy(update={"internal_resistance": 0.0})
    hull = vehicle.hull.model_copy(update={"psi": psi, "parts": (), "trapped_air": 0.0})
    vehicle = vehicle.model_copy(update={"actuator": a, "supply": supply, "hull": hull})
    return drive_energy(vehicle, uniform_column(vehicle.water, deepest))


def test_hovering_breaks_even_where_energies_are_equal():
    found = constant()
    hover = hovering(found, THRUSTER, weight_error=2e-5)
    power = THRUSTER.power(2e-5 * RHO * G, RHO)
    assert hover.thruster_power == pytest.approx(power, rel=1e-12)
    assert hover.break_even == pytest.approx(2e-5 * 2e7 / power, rel=1e-12)


def test_an_oil_line_is_filled_at_the_power_of_its_own_pressure():
    """1 mL/s with 7 W and 2 uW/Pa: the integral of P C/Q over the pressure by quadpack."""
    pump = PowerLawPump(delivery=1e-6, idle_power=7.0, power_per_pressure=2e-6)
    line = Oil(volume=1e-4, bulk_modulus=1.4e9, trapped_air=0.05)
    actuator = PumpAndValve(pump=pump, valve=Valve(flow=1e-9), line=line)
    vehicle = load_vehicle("example-float").model_copy(update={"actuator": actuator})
    supply = vehicle.supply.model_copy(update={"internal_resistance": 0.0})
    vehicle = vehicle.model_copy(update={"supply": supply})
    found = drive_energy(vehicle, uniform_column(vehicle.water, 500.0))
    rest, head = 101325.0, found.column.pressure[-1]

    def drawn(p):
        gas = line.volume * line.trapped_air * (rest / p) ** (1.0 / 1.4)
        give = (line.volume - gas) / line.bulk_modulus + gas / (1.4 * p)
        return (7.0 + 2e-6 * (p - rest)) * give / 1e-6

    fill = quad(drawn, rest, rest + head, epsrel=1e-10, limit=200)[0]
    hover = hovering(found, THRUSTER, weight_error=1e-6)
    assert hover.engine_energy[-1] == pytest.approx(7.0 + 2e-6 * head + fill, rel=1e-8)


def test_holding_and_leaking_are_paid_all_the_time():
    leakage = 1e-17
    found = constant(leakage=leakage)
    hover = hovering(found, THRUSTER, weight_error=2e-5)
    power = THRUSTER.power(2e-5 * RHO * G, RHO) - leakage * found.column.pressure * 2e7
    assert hover.break_even == pytest.approx(2e-5 * 2e7 / power, rel=1e-12)
    leaky = hovering(constant(leakage=1e-13), THRUSTER, weight_error=2e-5)
    assert leaky.break_even[-1] == math.inf


def test_a_back_driven_screw_holds_at_the_cost_of_its_copper():
    vehicle = load_vehicle("example-em")
    assert isinstance(vehicle.actuator, ElectromechanicalActuator)
    found = drive_energy(vehicle, uniform_column(vehicle.water, 50.0))
    hover = hovering(found, THRUSTER, weight_error=1e-5)
    assert hover.engine_power == pytest.approx(found.map.holding_power)
    assert hover.break_even[-1] == math.inf  # 1.7 W of copper against 0.1 N


def test_a_dive_in_neutral_water_is_drag_alone_for_both():
    """psi 0: the engine presses out 2 F/(rho g) at the bottom, the thruster pushes F both ways."""
    found = constant(deepest=1000.0)
    speed = 0.2
    dive = profiling(found, THRUSTER, speed=speed)
    force = found.vehicle.drag.k_dt * speed**2
    assert dive.drag == pytest.approx(2.0 * force * dive.depth)
    engine = 2.0 * force / (RHO * G) * 2e7
    assert dive.engine == pytest.approx(engine, rel=1e-9)  # the same from any depth
    assert dive.thruster == pytest.approx(
        2.0 * THRUSTER.power(force, RHO, speed) * dive.depth / speed, rel=1e-9
    )
    per_metre = 2.0 * THRUSTER.power(force, RHO, speed) / speed
    assert dive.break_even == pytest.approx(engine / per_metre, rel=1e-6)
    assert dive.stroke_depth == math.inf


@pytest.mark.parametrize("psi", [-6e-8, 6e-8])
def test_a_dive_of_a_hull_that_gives_way_is_followed(psi):
    """Out: 2 F/(rho g) and psi z once, whichever way it goes; the thruster by quadrature."""
    found = constant(psi=psi)
    speed, Z = 0.1, 500.0
    dive = profiling(found, THRUSTER, speed=speed)
    force = found.vehicle.drag.k_dt * speed**2
    assert dive.engine[-1] == pytest.approx(
        (2.0 * force / (RHO * G) + abs(psi) * Z) * 2e7, rel=1e-9
    )

    def power(z, way):
        lift = RHO * G * psi * (0.5 * Z - z)
        return THRUSTER.power(force + way * lift, RHO, speed)

    total = sum(quad(power, 0.0, Z, args=(way,), limit=200)[0] for way in (1.0, -1.0)) / speed
    assert dive.thruster[-1] == pytest.approx(total, rel=1e-3)


def test_a_dive_beyond_the_stroke_is_not_made():
    found = constant(psi=-2e-6, deepest=400.0)  # 300 mL are used up before 150 m
    dive = profiling(found, THRUSTER, speed=0.1)
    force = found.vehicle.drag.k_dt * 0.1**2
    reach = (300e-6 - force / (RHO * G)) / 2e-6
    assert dive.stroke_depth == pytest.approx(reach, abs=2.0 * 400.0 / 200.0)
    assert np.isnan(dive.engine[-1])
    assert np.isfinite(dive.engine[1])
    assert np.all(np.isfinite(dive.thruster))


def test_nothing_to_do_is_refused():
    found = constant(deepest=20.0)
    with refused(InputError, field="speed", value=0.0):
        profiling(found, THRUSTER, speed=0.0)
    with refused(InputError, field="weight_error", value=-1e-06):
        hovering(found, THRUSTER, weight_error=-1e-6)


def test_each_way_is_paid_with_its_own_drag():
    """psi 0: the engine presses out (F_down + F_up)/(rho g); the drag takes (F_down + F_up) z."""
    even = constant(deepest=1000.0)
    drag = even.vehicle.drag.model_copy(update={"rising_ratio": 0.6})
    motion = even.vehicle.motion.model_copy(update={"drag": drag})
    found = replace(even, vehicle=even.vehicle.model_copy(update={"motion": motion}))
    dive = profiling(found, THRUSTER, speed=0.2)
    force = drag.k_dt * 0.2**2
    np.testing.assert_allclose(dive.drag, 1.6 * force * dive.depth, rtol=1e-12)
    np.testing.assert_allclose(dive.engine[1:], 1.6 * force / (RHO * G) * 2e7, rtol=1e-6)
    per_metre = [THRUSTER.power(share * force, RHO, 0.2) / 0.2 for share in (1.0, 0.6)]
    np.testing.assert_allclose(dive.thruster, sum(per_metre) * dive.depth, rtol=1e-6)


def test_a_battery_too_weak_for_pump_and_valve_makes_no_dive():
    """14.4 V behind 50 ohm gives 1 W at most, and the valve takes 4 W: nothing goes out or in."""
    vehicle = load_vehicle("example-float")
    weak = vehicle.supply.model_copy(update={"internal_resistance": 50.0})
    vehicle = vehicle.model_copy(update={"supply": weak})
    found = drive_energy(vehicle, uniform_column(vehicle.water, 1000.0))
    dive = profiling(found, Thruster(), speed=0.1)
    assert np.isnan(dive.engine).all()
    assert np.isfinite(dive.thruster).all()
    hover = hovering(found, Thruster(), weight_error=1e-5)
    said = " ".join(versus_sentences(hover, dive, found))
    assert "not by this engine, the drive stalls on the way" in said
