"""The full motor against SciPy's integrators, python-control's block algebra and its limits."""

import math

import control
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.physics.actuator import reduced
from swimbladder.physics.motor import (
    FullMotor,
    full_motor,
    holding_voltage,
    inductance_error,
    motor_poles,
    speed_transfer,
    step_response,
)

EXAMPLES = ["example-eh", "example-em"]
MOTOR = FullMotor(
    R=1.2, L=1.5e-3, k_T=0.05, k_emf=0.052, inertia=3e-5, B=2e-5, T_b=4e-3, k_z=1.5e-4, k_q=1.2e-8
)


def positive(low, high):
    return st.floats(math.log(low), math.log(high)).map(math.exp)


any_motor = st.builds(
    FullMotor,
    R=positive(0.1, 10.0),
    L=positive(1e-6, 1e-2),
    k_T=positive(5e-3, 0.2),
    k_emf=positive(5e-3, 0.2),
    inertia=positive(1e-7, 1e-3),
    B=st.sampled_from([0.0, 1e-6, 1e-4]),
    T_b=st.sampled_from([0.0, 1e-3]),
    k_z=positive(1e-6, 1e-3),
    k_q=positive(1e-9, 1e-7),
)


def integrated(m, t, u, depth):
    """The three differential equations of Fig. 2, from the current that holds the load."""
    load = m.k_z * depth + m.T_b

    def rate(_, x):
        i, omega, _ = x
        return [
            (u - m.R * i - m.k_emf * omega) / m.L,
            (m.k_T * i - m.B * omega - load) / m.inertia,
            omega,
        ]

    start = [load / m.k_T, 0.0, 0.0]
    return solve_ivp(rate, (0.0, t[-1]), start, t_eval=t, method="Radau", rtol=1e-10, atol=1e-12).y


@pytest.mark.parametrize(
    "motor",
    [
        MOTOR,
        MOTOR._replace(L=3e-2),  # complex poles
        MOTOR._replace(B=0.0, L=MOTOR.R**2 * MOTOR.inertia / 4 / MOTOR.k_T / MOTOR.k_emf),  # equal
        MOTOR._replace(L=1e-5, inertia=1e-6),
    ],
)
def test_the_step_is_that_of_the_differential_equations(motor):
    T1 = motor.R * motor.inertia / (motor.k_T * motor.k_emf)
    t = np.linspace(0.0, 10.0 * T1, 60)
    ours = step_response(motor, t, voltage=11.0, depth=300.0)
    i, omega, theta = integrated(motor, t, 11.0, 300.0)
    assert ours.current == pytest.approx(i, rel=1e-7, abs=1e-8)
    assert ours.speed == pytest.approx(omega, rel=1e-7, abs=1e-6)
    assert ours.angle == pytest.approx(theta, rel=1e-7, abs=1e-8)
    assert ours.volume == pytest.approx(motor.k_q * theta, rel=1e-7, abs=1e-16)


def block_diagram(m):
    """Fig. 2 closed by python-control: 1/(L s + R), k_T, 1/(lambda s + B), k_emf fed back."""
    forward = control.tf([1.0], [m.L, m.R]) * m.k_T * control.tf([1.0], [m.inertia, m.B])
    return control.feedback(forward, control.tf([m.k_emf], [1.0]))


@pytest.mark.parametrize("L", [1e-5, 1.5e-3, 3e-2])
def test_transfer_function_and_poles_are_those_of_the_block_diagram(L):
    motor = MOTOR._replace(L=L)
    reference = block_diagram(motor)
    ours = control.tf(*[list(c) for c in speed_transfer(motor)])
    for frequency in (0.1, 30.0, 5e3):
        assert ours(1j * frequency) == pytest.approx(reference(1j * frequency), rel=1e-10)
    expected = sorted(reference.poles(), key=lambda p: (round(p.imag, 6), p.real))
    found = sorted(motor_poles(motor), key=lambda p: (round(p.imag, 6), p.real))
    assert found == pytest.approx(expected, rel=1e-8)
    assert abs(motor_poles(motor)[0]) <= abs(motor_poles(motor)[1]) * (1.0 + 1e-12)
    t = np.linspace(0.0, 0.2, 40)
    _, speed = control.step_response(reference, t)
    hold = holding_voltage(motor, 0.0)
    assert step_response(motor, t, voltage=hold + 1.0).speed == pytest.approx(speed, abs=1e-6)


@given(any_motor)
def test_poles_are_roots_of_the_denominator_and_stable(motor):
    numerator, denominator = speed_transfer(motor)
    assert numerator == (motor.k_T,)
    for pole in motor_poles(motor):
        terms = [c * pole**n for c, n in zip(denominator, (2, 1, 0), strict=True)]
        assert abs(sum(terms)) <= 1e-9 * sum(map(abs, terms))
        assert pole.real < 0.0


def test_far_apart_the_poles_are_the_electrical_and_the_mechanical_one():
    """As L goes to 0, -R/L and -1/T1, to first order in the ratio of the times."""
    motor = MOTOR._replace(L=1e-8)
    (pole,) = motor_poles(motor._replace(L=0.0))
    slow, fast = motor_poles(motor)
    ratio = (motor.L / motor.R) * -pole.real
    assert slow.real == pytest.approx(pole.real, rel=2.0 * ratio)
    assert fast.real == pytest.approx(-motor.R / motor.L, rel=2.0 * ratio)
    assert len(speed_transfer(motor._replace(L=0.0))[1]) == 2


def test_a_slow_winding_makes_the_motor_overshoot():
    """Complex poles where 4 L/R exceeds T1 (exactly so without viscous friction)."""
    lossless = MOTOR._replace(B=0.0)
    T1 = lossless.R * lossless.inertia / (lossless.k_T * lossless.k_emf)
    t = np.linspace(0.0, 20.0 * T1, 4000)
    for factor, overshoots in ((0.99, False), (1.01, True)):
        motor = lossless._replace(L=factor * T1 / 4.0 * lossless.R)
        assert (motor_poles(motor)[0].imag != 0.0) is overshoots
    motor = lossless._replace(L=2.0 * T1 * lossless.R)
    speed = step_response(motor, t, voltage=12.0).speed
    assert speed.max() > 1.2 * speed[-1]


@pytest.mark.parametrize("name", EXAMPLES)
def test_without_inductance_it_is_the_reduced_actuator(name):
    """Eq. (11): T1 dq/dt = K1 A (u - load z - friction) - q, integrated by hand."""
    vehicle = load_vehicle(name)
    r = reduced(vehicle.actuator, vehicle.water)
    motor = full_motor(vehicle.actuator, vehicle.water)._replace(L=0.0)
    u, depth = vehicle.supply.voltage, vehicle.hull.depth_limit
    t = np.linspace(0.0, 8.0 * r.T1, 50)
    ours = step_response(motor, t, voltage=u, depth=depth)
    q = r.gain * (u - r.load_drive * depth - r.friction)
    assert motor.k_q * ours.speed == pytest.approx(q * -np.expm1(-t / r.T1), rel=1e-9, abs=1e-18)
    volume = q * (t + r.T1 * np.expm1(-t / r.T1))
    assert ours.volume == pytest.approx(volume, rel=1e-9, abs=1e-18)
    current = (u - r.kappa * motor.k_q * ours.speed) / r.resistance
    assert ours.current == pytest.approx(current, rel=1e-9)


def test_full_motor_takes_every_constant_from_its_field():
    eh, em = load_vehicle("example-eh"), load_vehicle("example-em")
    numbers = {
        "resistance": 1.1,
        "torque_constant": 0.2,
        "emf_constant": 0.3,
        "inductance": 4e-3,
        "rotor_inertia": 5e-6,
        "viscous_friction": 6e-6,
        "friction_torque": 7e-3,
    }
    for vehicle in (eh, em):
        a = vehicle.actuator
        drive = a.drive.model_copy(update={"reflected_inertia": 8e-6, "viscous_friction": 9e-6})
        motor = type(a.motor)(**numbers)
        found = full_motor(a.model_copy(update={"motor": motor, "drive": drive}), vehicle.water)
        assert found[:7] == pytest.approx((1.1, 4e-3, 0.2, 0.3, 13e-6, 15e-6, 7e-3), rel=1e-12)
    turn = 2.0 * math.pi
    weight = eh.water.density * eh.water.gravity
    found = full_motor(eh.actuator, eh.water)
    assert found.k_q == pytest.approx(0.08e-6 / turn, rel=1e-12)
    assert found.k_z == pytest.approx(weight * 0.08e-6 / turn / 0.8, rel=1e-12)


# --- what neglecting the inductance costs -------------------------------------------------------


@given(any_motor)
def test_the_lag_in_position_is_the_first_moment_of_the_two_models(motor):
    """At last L B/(R B + k_T k_emf): coefficients of s in the two denominators, subtracted."""
    simplified = motor._replace(L=0.0)
    full, plain = speed_transfer(motor)[1], speed_transfer(simplified)[1]
    expected = full[1] / full[2] - plain[0] / plain[1]
    T1 = plain[0] / plain[1]
    assume(motor.L / motor.R < 10.0 * T1)
    end = 60.0 * max(T1, motor.L / motor.R)
    u = holding_voltage(motor, 0.0) + 1.0
    a, b = (step_response(m, [0.0, end], voltage=u) for m in (motor, simplified))
    lag = (b.angle[-1] - a.angle[-1]) / b.speed[-1]
    assert lag == pytest.approx(expected, abs=1e-8 * T1 + 1e-9 * end)


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_measured_error_is_the_difference_of_the_integrated_models(name):
    vehicle = load_vehicle(name)
    u, depth = vehicle.supply.voltage, vehicle.hull.depth_limit
    e = inductance_error(vehicle.actuator, vehicle.water, voltage=u, depth=depth)
    m = full_motor(vehicle.actuator, vehicle.water)
    T1, tau = e.mechanical_time, m.L / m.R
    t = np.concatenate(
        (np.linspace(0.0, 10.0 * tau, 2001), np.linspace(10.5 * tau, 25.0 * T1, 300))
    )
    _, omega, theta = integrated(m, t, u, depth)
    final = omega[-1]
    plain = -final * np.expm1(-t / T1)
    travel = final * (t + T1 * np.expm1(-t / T1))
    assert e.electrical_time == tau
    assert pytest.approx(m.R * m.inertia / (m.R * m.B + m.k_T * m.k_emf)) == T1
    assert e.peak_speed_error == pytest.approx(np.max(np.abs(plain - omega)) / final, rel=1e-4)
    assert e.peak_position_lag == pytest.approx(np.max(travel - theta) / final, rel=1e-3)
    assert e.position_lag == pytest.approx(m.L * m.B / (m.R * m.B + m.k_T * m.k_emf), rel=1e-3)
    level = final * (1.0 - math.exp(-1.0))
    reached = solve_ivp(
        lambda _, x: [
            (u - m.R * x[0] - m.k_emf * x[1]) / m.L,
            (m.k_T * x[0] - m.B * x[1] - m.k_z * depth - m.T_b) / m.inertia,
        ],
        (0.0, 3.0 * T1),
        [(m.k_z * depth + m.T_b) / m.k_T, 0.0],
        method="Radau",
        rtol=1e-11,
        atol=1e-12,
        events=lambda _, x: x[1] - level,
    )
    assert e.time_constant_shift == pytest.approx(reached.t_events[0][0] - T1, abs=1e-5 * T1)
    assert e.poles == motor_poles(m)
    assert e.simplified_pole.real == pytest.approx(-1.0 / T1, rel=1e-12)

    rising = solve_ivp(
        lambda _, i: (u - m.R * i) / m.L,
        (0.0, 5.0 * tau),
        [0.0],
        rtol=1e-11,
        atol=1e-13,
        events=lambda _, i: m.k_T * i[0] - m.k_z * depth - m.T_b,
    )
    assert e.start_delay == pytest.approx(rising.t_events[0][0], rel=1e-6)


def test_the_error_goes_with_the_inductance():
    """The peak error in speed is of first order in L, and gone without it."""
    vehicle = load_vehicle("example-em")
    a = vehicle.actuator
    errors = []
    for L in (2e-4, 1e-4, 0.0):
        motor = a.motor.model_copy(update={"inductance": L})
        actuator = a.model_copy(update={"motor": motor})
        errors.append(inductance_error(actuator, vehicle.water, voltage=12.0))
    assert errors[0].peak_speed_error / errors[1].peak_speed_error == pytest.approx(2.0, rel=0.02)
    nothing = errors[2]
    assert (nothing.peak_speed_error, nothing.peak_position_lag) == (0.0, 0.0)
    assert nothing.poles == (nothing.simplified_pole,)
    assert nothing.start_delay == 0.0
    assert abs(nothing.time_constant_shift) < 1e-6 * nothing.mechanical_time


def test_the_error_depends_on_neither_voltage_nor_depth():
    vehicle = load_vehicle("example-eh")
    a = inductance_error(vehicle.actuator, vehicle.water, voltage=24.0, depth=1000.0)
    b = inductance_error(vehicle.actuator, vehicle.water, voltage=6.0, depth=10.0)
    for field in ("peak_speed_error", "time_constant_shift", "peak_position_lag", "position_lag"):
        assert getattr(a, field) == pytest.approx(getattr(b, field), rel=1e-6)
    assert a.start_delay != b.start_delay


def test_a_motor_that_cannot_turn_says_so():
    vehicle = load_vehicle("example-em")
    with pytest.raises(NoAnswerError, match=r"12 V do not drive the motor at 200 m.*15\.4"):
        inductance_error(vehicle.actuator, vehicle.water, voltage=12.0, depth=200.0)


def test_an_identified_actuator_has_no_full_motor():
    vehicle = load_vehicle("feup-em")
    with pytest.raises(InputError, match=r"actuator\.kind: .*inductance.*'identified'"):
        full_motor(vehicle.actuator, vehicle.water)
