"""Current, power, battery and limits against the circuit itself and the balance of energy."""

import math

import numpy as np
import pint
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.physics import electric as el
from swimbladder.physics.actuator import reduced, unified
from swimbladder.vehicle import (
    ElectrohydraulicActuator,
    ElectromechanicalActuator,
    HydraulicDrive,
    Motor,
    ScrewDrive,
    Supply,
    UnifiedActuator,
    Water,
)
from tests.power_chain import per_volume, power_chain

SEA = Water(density=1025.0)
LOSSES = ("battery", "copper", "conversion", "viscous", "friction", "transmission", "leakage")


def positive(low, high):
    return st.floats(math.log(low), math.log(high)).map(math.exp)


@st.composite
def datasheets(draw):
    """Any unified actuator that datasheets can give, both technologies."""
    k_T = draw(positive(5e-3, 0.2))
    motor = Motor(
        resistance=draw(positive(0.1, 10.0)),
        torque_constant=k_T,
        emf_constant=k_T * draw(st.sampled_from([1.0, 1.0, 1.05])),
        rotor_inertia=1e-5,
        viscous_friction=draw(st.sampled_from([0.0, 1e-6, 1e-4])),
        friction_torque=draw(st.sampled_from([0.0, 1e-3])),
    )
    eta, per_angle = draw(st.floats(0.2, 1.0)), draw(positive(1e-9, 3e-8))
    if draw(st.booleans()):
        drive = HydraulicDrive(
            pump_displacement=per_angle * 2.0 * math.pi * 1.5,
            pump_efficiency=eta,
            area_ratio=1.5,
            pump_leakage=draw(st.sampled_from([0.0, 1e-16, 1e-14])),
        )
        return unified(ElectrohydraulicActuator(motor=motor, drive=drive), SEA)
    screw = ScrewDrive(lead=per_angle * 2.0 * math.pi / 1e-3, efficiency=eta, piston_area=1e-3)
    return unified(ElectromechanicalActuator(motor=motor, drive=screw), SEA)


# --- formulas -----------------------------------------------------------------------------------


def test_units_and_values_of_current_and_power():
    """24 V on 1.5 ohm at 3000 rpm with 50 mV s/rad: by hand 5.528 A."""
    q = pint.UnitRegistry().Quantity
    i = el.winding_current(
        u=q(24.0, "V"),
        omega=q(3000.0, "rpm").to("rad/s"),
        R=q(1.5, "ohm"),
        k_emf=q(0.05, "V*s/rad"),
    )
    assert i.to("A").magnitude == pytest.approx((24.0 - 5.0 * math.pi) / 1.5, rel=1e-12)
    assert el.electrical_power(u=q(24.0, "V"), i=q(2.0, "A")).to("W").magnitude == 48.0
    assert el.copper_loss(i=q(2.0, "A"), R=q(1.5, "ohm")).to("W").magnitude == 6.0


@given(u=st.floats(-50, 50), omega=st.floats(-500, 500), R=positive(0.1, 10), k=positive(1e-3, 0.3))
def test_electrical_power_is_heat_and_what_the_shaft_gets(u, omega, R, k):
    i = el.winding_current(u=u, omega=omega, R=R, k_emf=k)
    shaft = k * i * omega
    both = el.copper_loss(i=i, R=R) + shaft
    scale = abs(u * i) + abs(shaft) + 1e-9
    assert el.electrical_power(u=u, i=i) == pytest.approx(both, abs=1e-12 * scale)


# --- battery ------------------------------------------------------------------------------------


@given(E=st.floats(3.0, 100.0), R_b=st.floats(0.0, 5.0), share=st.floats(-3.0, 1.0))
def test_the_battery_gives_the_power_that_is_asked(E, R_b, share):
    P = share * (E**2 / 4.0 / R_b if R_b > 0.05 else 200.0)
    assume(4.0 * R_b * P <= E**2)
    i_b = el.supply_current(P=P, E=E, R_b=R_b)
    v = E - R_b * i_b
    assert v * i_b == pytest.approx(P, rel=1e-9, abs=1e-12)
    assert v >= E / 2.0 * (1.0 - 1e-9)
    assert math.copysign(1.0, i_b) == math.copysign(1.0, P)


def test_the_battery_has_a_most_that_it_can_give():
    """E^2/(4 R_b) = 144 W of a 24 V battery behind 1 ohm, at half its voltage and 12 A."""
    assert el.supply_current(P=144.0, E=24.0, R_b=1.0) == pytest.approx(12.0, rel=1e-12)
    assert math.isnan(el.supply_current(P=144.1, E=24.0, R_b=1.0))
    currents = el.supply_current(P=np.array([0.0, 23.0, 144.1]), E=24.0, R_b=1.0)
    assert currents[:2] == pytest.approx([0.0, 1.0])
    assert np.isnan(currents[2])


def voltage_at_duty(duty, *, E, R_b, R, emf):
    """The circuit solved: u = d v, v = E - R_b i_b, i_b = d i, i = (u - emf)/R."""
    #              v    u     i      i_b
    equations = np.array(
        [
            [1.0, 0.0, 0.0, R_b],
            [-duty, 1.0, 0.0, 0.0],
            [0.0, 1.0, -R, 0.0],
            [0.0, 0.0, -duty, 1.0],
        ]
    )
    return np.linalg.solve(equations, [E, 0.0, emf, 0.0])[1]


@given(
    E=st.floats(5.0, 50.0),
    R=st.floats(0.2, 10.0),
    ratio=st.floats(0.0, 1.0),
    turning=st.floats(-1.0, 1.5),
    direction=st.sampled_from([-1.0, 1.0]),
)
def test_no_duty_gives_more_than_the_largest_voltage(E, R, ratio, turning, direction):
    """For R_b <= R and a motor not turned too fast against its voltage, as the docstring says."""
    R_b = ratio * R
    slowest = -0.5 * (1.0 / ratio - 1.0) if ratio > 0.0 else -math.inf
    emf = direction * E * max(turning, slowest)
    largest = el.largest_voltage(E=E, sag=ratio, emf=emf, direction=direction)
    tried = [
        direction * voltage_at_duty(direction * d, E=E, R_b=R_b, R=R, emf=emf)
        for d in np.linspace(0.0, 1.0, 101)
    ]
    assert tried[-1] == pytest.approx(max(tried), rel=1e-9, abs=1e-9)
    assert largest == pytest.approx(min(max(tried), E), rel=1e-9, abs=1e-9)


def test_beyond_that_a_smaller_duty_gives_more():
    """At standstill with R_b = 4 R, half the duty gives E/4, full duty E/5."""
    assert el.largest_voltage(E=20.0, sag=4.0, emf=0.0) == pytest.approx(4.0)
    assert voltage_at_duty(0.5, E=20.0, R_b=4.0, R=1.0, emf=0.0) == pytest.approx(5.0)


# --- depth limits -------------------------------------------------------------------------------


@given(datasheets(), st.floats(6.0, 50.0), st.floats(0.0, 0.9))
def test_the_motor_turns_above_the_stall_depth_and_not_below(actuator, E, sag):
    r = reduced(actuator, SEA)
    depth = el.stall_depth(E=E, sag=sag, load=r.load_drive, friction=r.friction)
    assume(depth > 0.0)
    u = E / (1.0 + sag)
    assert actuator.k_u * u == pytest.approx(
        actuator.k_z * depth + actuator.friction_torque, rel=1e-12
    )
    above = el.steady_drive(actuator, SEA, voltage=u, depth=depth * (1.0 - 1e-9))
    below = el.steady_drive(actuator, SEA, voltage=u, depth=depth * (1.0 + 1e-9))
    assert above.omega > 0.0
    assert below.omega <= 0.0


@given(datasheets(), st.floats(6.0, 50.0), st.floats(1e-6, 0.9), st.floats(0.01, 0.99))
def test_at_the_depth_for_a_rate_the_largest_voltage_gives_that_rate(actuator, E, sag, share):
    r = reduced(actuator, SEA)
    surface_rate = r.gain * (E - r.friction)
    assume(surface_rate > 0.0)
    q = share * surface_rate
    depth = el.depth_at_rate(
        E=E, sag=sag, load=r.load_drive, friction=r.friction, q=q, gain=r.gain, kappa=r.kappa
    )
    assume(depth > 0.0)
    u = el.largest_voltage(E=E, sag=sag, emf=r.kappa * q)
    supply = Supply(voltage=E, internal_resistance=sag * actuator.resistance)
    drive = el.steady_drive(actuator, SEA, voltage=u, depth=depth, supply=supply)
    assert drive.omega * actuator.k_q == pytest.approx(q, rel=1e-7)
    assert drive.supply_current > 0.0  # and the supply can just hold it


def test_limits_of_depth():
    paper = {"E": 12.0, "load": 7.707e-2, "friction": 0.0}
    assert el.stall_depth(sag=0.0, **paper) == pytest.approx(155.7, abs=0.01)
    assert el.stall_depth(sag=0.5, **paper) == pytest.approx(155.7 / 1.5, abs=0.01)
    assert el.stall_depth(E=12.0, sag=0.0, load=0.0, friction=1.0) == math.inf
    assert el.stall_depth(E=12.0, sag=0.0, load=1.0, friction=13.0) == 0.0
    assert el.stall_depth(E=12.0, sag=0.0, load=0.0, friction=13.0) == 0.0
    many = el.stall_depth(E=12.0, sag=0.0, load=np.array([0.1, 0.0]), friction=2.0)
    assert many == pytest.approx([100.0, math.inf])


@pytest.mark.parametrize("name", ["example-eh", "example-em"])
def test_the_examples_can_leave_their_deepest_depth(name):
    vehicle = load_vehicle(name)
    r = reduced(vehicle.actuator, vehicle.water)
    sag = vehicle.supply.internal_resistance / r.resistance
    deepest = el.stall_depth(
        E=vehicle.supply.voltage, sag=sag, load=r.load_drive, friction=r.friction
    )
    assert deepest > 1.5 * vehicle.hull.depth_limit


# --- balance --------------------------------------------------------------------------------------


def balance(drive, actuator):
    """Supply less losses and work on the water, and what that is counted against [W].

    What turns round between emf and current counts too: it is what the losses are differences of.
    """
    turning = actuator.k_v * drive.omega**2
    parts = [getattr(drive, name) for name in LOSSES] + [drive.sea]
    return drive.supply - sum(parts), abs(drive.supply) + sum(
        abs(p) for p in parts
    ) + turning + 1e-12


@given(
    datasheets(),
    st.floats(-24.0, 24.0),
    st.floats(0.0, 3000.0),
    st.just(0.0) | st.floats(1e-6, 0.5),
    st.sampled_from([None, 24.0]),
)
def test_the_balance_closes_and_nothing_creates_energy(actuator, u, depth, R_b, E):
    supply = None if E is None else Supply(voltage=E, internal_resistance=R_b)
    d = el.steady_drive(actuator, SEA, voltage=u, depth=depth, supply=supply)
    assume(not np.isnan(d.supply))
    residue, throughput = balance(d, actuator)
    assert abs(residue) <= 1e-10 * throughput
    for name in LOSSES:
        # emf and torque constants that differ are the one loss that changes sign with the current
        if name != "conversion" or actuator.k_u * actuator.resistance == actuator.emf_constant:
            assert getattr(d, name) >= -1e-12 * throughput, name


@given(datasheets(), st.floats(200.0, 3000.0))
def test_the_literal_form_creates_energy_in_back_driving_only(actuator, depth):
    assume(actuator.efficiency < 0.95)
    literal = actuator.model_copy(update={"literal_efficiency": True})
    up = {"voltage": 2.0 * actuator.k_z * depth / actuator.k_u + 1.0, "depth": depth}
    np.testing.assert_array_equal(
        el.steady_drive(literal, SEA, **up), el.steady_drive(actuator, SEA, **up)
    )

    down = {"voltage": -1.0, "depth": depth}
    passive, printed = (el.steady_drive(a, SEA, **down) for a in (actuator, literal))
    assume(passive.omega < 0.0)
    for d in (passive, printed):
        residue, throughput = balance(d, actuator)
        assert abs(residue) <= 1e-10 * throughput
    assert passive.transmission > 0.0
    # Printed, the shaft gets 1/eta of the work that the sea does on the oil or the piston.
    sea_work = SEA.specific_weight * depth * actuator.k_q * -printed.omega
    gained = sea_work * (1.0 / actuator.efficiency - 1.0)
    assert -printed.transmission == pytest.approx(gained, rel=1e-9)
    assert printed.transmission < 0.0


@given(datasheets(), st.sampled_from([-12.0, 12.0]), st.floats(0.0, 2000.0))
def test_steady_speed_is_where_the_equation_of_motion_comes_to_rest(actuator, u, depth):
    """Eq. (11) integrated by SciPy at a held depth, the load by the direction of motion."""
    a = actuator
    lossless = SEA.specific_weight * a.k_q * depth
    forward = a.k_u * u > lossless / a.efficiency + a.friction_torque
    backward = a.k_u * u < lossless * a.efficiency - a.friction_torque

    def rate(_, omega):
        if forward:
            load = lossless / a.efficiency + a.friction_torque
        else:
            load = lossless * a.efficiency - a.friction_torque
        return (a.k_u * u - a.k_v * omega - load) / a.inertia

    d = el.steady_drive(a, SEA, voltage=u, depth=depth)
    if not (forward or backward):
        assert d.omega == 0.0
        assert d.volume_rate == pytest.approx(-a.k_l * depth)
        return
    end = 40.0 * a.inertia / a.k_v
    omega = solve_ivp(rate, (0.0, end), [0.0], rtol=1e-9, atol=1e-9, method="LSODA").y[0, -1]
    assert d.omega == pytest.approx(omega, rel=1e-6, abs=1e-6)
    assert d.volume_rate == pytest.approx(a.k_q * omega - a.k_l * depth, rel=1e-5, abs=1e-18)
    i = (u - a.emf_constant * omega) / a.resistance
    assert d.current == pytest.approx(i, rel=1e-5, abs=1e-6)


def test_efficiencies_tend_to_one_as_their_losses_go():
    """One by one: the battery's, the motor's, the transmission's, the leakage's."""

    def chain(R=0.5, B=1e-5, T_b=1e-3, eta=0.8, k_l=1e-12, R_b=0.1):
        # At a fixed torque and speed: the voltage follows from the resistance.
        k, k_q, omega, depth = 0.05, 1e-8, 200.0, 1000.0
        weight = SEA.specific_weight * k_q
        actuator = UnifiedActuator(
            inertia=1e-5,
            k_u=k / R,
            k_v=B + k * k / R,
            k_q=k_q,
            k_z=weight / eta,
            k_l=k_l,
            efficiency=eta,
            friction_torque=T_b,
            resistance=R,
            emf_constant=k,
        )
        torque = weight / eta * depth + T_b + B * omega
        supply = Supply(voltage=48.0, internal_resistance=R_b)
        u = k * omega + R * torque / k
        drive = el.steady_drive(actuator, SEA, voltage=u, depth=depth, supply=supply)
        assert drive.omega == pytest.approx(omega, rel=1e-9)
        return power_chain(drive)

    c = chain()
    assert c.transmission == pytest.approx(0.8, rel=1e-9)
    assert c.leakage == pytest.approx(1.0 - 1e-12 * 1000.0 / (1e-8 * 200.0), rel=1e-9)
    assert c.total == pytest.approx(c.battery * c.motor * c.transmission * c.leakage, rel=1e-12)
    assert 0.0 < c.total < min(c.battery, c.motor, c.transmission, c.leakage) < 1.0
    assert chain(R_b=0.0).battery == pytest.approx(1.0, rel=1e-12)
    assert chain(k_l=0.0).leakage == 1.0
    assert chain(eta=1.0).transmission == pytest.approx(1.0, rel=1e-12)
    lossless_motor = chain(R=1e-6, B=0.0, T_b=0.0)
    assert lossless_motor.motor == pytest.approx(1.0, abs=1e-5)
    nearly = chain(R=1e-6, B=0.0, T_b=0.0, eta=1.0, k_l=0.0, R_b=0.0)
    assert nearly.total == pytest.approx(1.0, abs=1e-5)


def test_energy_per_volume_is_at_least_the_pressure():
    vehicle = load_vehicle("example-eh")
    actuator = unified(vehicle.actuator, vehicle.water)
    depths = np.array([0.0, 100.0, 500.0, 1000.0])
    drive = el.steady_drive(
        actuator, vehicle.water, voltage=20.0, depth=depths, supply=vehicle.supply
    )
    energy = per_volume(drive)
    pressure = vehicle.water.specific_weight * depths
    assert np.all(energy > pressure / 0.8)  # what the pump alone costs
    total = power_chain(drive).total
    assert total[1:] == pytest.approx((pressure / energy)[1:], rel=1e-12)
    assert np.isnan(total[0])  # at the surface no work is done
    assert energy * 1e-6 == pytest.approx([0.6, 1.9, 7.6, 16.1], abs=0.1)  # J/mL


def test_at_the_surface_both_directions_are_alike():
    """22 V of a sagging 24 V can be held by a running motor only, and either way round."""
    actuator = unified(load_vehicle("example-eh").actuator, SEA)
    supply = Supply(voltage=24.0, internal_resistance=0.25)
    out, back = (
        el.steady_drive(actuator, SEA, voltage=u, depth=0.0, supply=supply) for u in (22.0, -22.0)
    )
    assert 22.0 > 24.0 / (1.0 + 0.25 / 1.16)
    assert (back.omega, back.current) == (-out.omega, -out.current)
    assert out.supply_current > 0.0
    np.testing.assert_array_equal(out[4:], back[4:])
    assert back.supply_current == out.supply_current


def test_arrays_give_what_their_elements_give():
    actuator = unified(load_vehicle("example-eh").actuator, SEA)
    supply = Supply(voltage=24.0, internal_resistance=0.25)
    volts, depths = np.array([-10.0, -0.5, 0.0, 1.0, 20.0, 30.0]), np.array([5.0, 300.0, 900.0])
    u, z = np.meshgrid(volts, depths)
    many = el.steady_drive(actuator, SEA, voltage=u, depth=z, supply=supply)
    for index in np.ndindex(u.shape):
        one = el.steady_drive(actuator, SEA, voltage=u[index], depth=z[index], supply=supply)
        np.testing.assert_array_equal([np.broadcast_to(f, u.shape)[index] for f in many], one)
    assert np.isnan(many.supply[:, -1]).all()  # 30 V are more than the supply has
    assert not np.isnan(many.supply[:, :-1]).any()
    assert np.all(np.isnan(per_volume(many)) == ~(many.volume_rate > 0.0) | np.isnan(many.supply))


# --- what is missing ----------------------------------------------------------------------------

BARE = {"inertia": 1e-5, "k_u": 0.05, "k_v": 2.6e-3, "k_q": 1e-8, "k_z": 1e-4}


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ({}, r"actuator\.resistance: current and power need .*ohm.*datasheet"),
        ({"resistance": 1.0}, r"actuator\.emf_constant: .*V s/rad.*datasheet"),
        (
            {"resistance": 1.0, "emf_constant": 0.06},
            r"actuator\.k_v: .*0\.003.*create energy.*0\.0026",
        ),
    ],
)
def test_power_needs_the_motors_data(known, message):
    with pytest.raises(InputError, match=message):
        el.steady_drive(UnifiedActuator(**BARE, **known), SEA, voltage=1.0, depth=0.0)
