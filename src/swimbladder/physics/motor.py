"""The motor with its inductance (Fig. 2) against the motor without (Fig. 3), both driving a load.

The full motor, with the transmission on its shaft and lambda, B and T_z as in Fig. 8::

    L di/dt         = u - R i - k_emf omega
    lambda domega/dt = k_T i - B omega - T_z - T_b
    dV/dt           = k_q omega

Without the inductance the first line gives i at once, and the two become eq. (11).
"""

import cmath
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.physics.actuator import unified
from swimbladder.physics.arrays import Array
from swimbladder.vehicle import Actuator, ElectrohydraulicActuator, ElectromechanicalActuator, Water


class FullMotor(NamedTuple):
    """The constants of Fig. 2 with the drive on the shaft."""

    R: float  # ohm
    L: float  # H
    k_T: float  # N m/A
    k_emf: float  # V s/rad
    inertia: float  # kg m2, lambda
    B: float  # N m s/rad, B_m and the viscous friction of the drive
    T_b: float  # N m, dry friction
    k_z: float  # N m/m, load while driving
    k_q: float  # m3/rad


def full_motor(actuator: Actuator, water: Water) -> FullMotor:
    """Return the full motor of an actuator described by its datasheets.

    Raises InputError for any other, whose inductance is not known.
    """
    if not isinstance(actuator, ElectrohydraulicActuator | ElectromechanicalActuator):
        what = "the full motor needs the motor's data, inductance included"
        remedy = "Describe the actuator as kind electrohydraulic or electromechanical"
        raise InputError(what, field="actuator.kind", value=actuator.kind, remedy=remedy)
    motor, a = actuator.motor, unified(actuator, water)
    return FullMotor(
        R=motor.resistance,
        L=motor.inductance,
        k_T=motor.torque_constant,
        k_emf=motor.k_emf,
        inertia=a.inertia,
        B=motor.viscous_friction + actuator.drive.viscous_friction,
        T_b=motor.friction_torque,
        k_z=a.k_z,
        k_q=a.k_q,
    )


def speed_transfer(motor: FullMotor) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Transfer function from voltage to speed, (numerator, denominator) in descending powers.

    k_T/(L lambda s^2 + (L B + R lambda) s + R B + k_T k_emf), Fig. 2; without inductance that of
    Fig. 3, of first order.
    """
    m = motor
    denominator = (m.L * m.inertia, m.L * m.B + m.R * m.inertia, m.R * m.B + m.k_T * m.k_emf)
    return (m.k_T,), denominator if m.L > 0.0 else denominator[1:]


def motor_poles(motor: FullMotor) -> tuple[complex, ...]:
    """Poles of the motor's speed [1/s], the slowest first.

    Near -1/T1 (mechanical) and -R/L (electrical) where these are far apart; complex where
    L/R > T1/4 or so: the motor then overshoots.
    """
    *_, b, c = speed_transfer(motor)[1]
    if motor.L == 0.0:
        return (complex(-c / b),)
    a = motor.L * motor.inertia
    root = cmath.sqrt(b * b - 4.0 * a * c)
    fast = -(b + root) / 2.0  # no cancellation here; the slow one from their product c/a
    return c / fast, fast / a


class StepResponse(NamedTuple):
    """What a motor does after a voltage step; arrays of one length."""

    time: Array  # s
    current: Array  # A
    speed: Array  # rad/s
    angle: Array  # rad
    volume: Array  # m3


def holding_voltage(motor: FullMotor, depth: float) -> float:
    """Voltage [V] at which a motor at rest at `depth` [m] just does not drive yet."""
    return motor.R * (motor.k_z * depth + motor.T_b) / motor.k_T


def step_response(
    motor: FullMotor, time: ArrayLike, *, voltage: float, depth: float = 0.0
) -> StepResponse:
    """Return the exact response from rest, at the times [s], to a step up to `voltage` [V].

    Before the step the winding carries the current that holds load and friction. The load of the
    depth [m] does not change with the little volume moved. Raises NoAnswerError where the voltage
    does not drive the motor against them.
    """
    t = np.asarray(time, float)
    hold = holding_voltage(motor, depth)
    if not voltage > hold:
        raise NoAnswerError(
            f"{voltage:g} V do not drive the motor at {depth:g} m, where it takes {hold:g} V to "
            "hold load and friction: raise the voltage or lower the depth"
        )
    m = motor
    (k,), denominator = speed_transfer(m)
    *higher, a_1, a_0 = denominator
    final = k * (voltage - hold) / a_0
    slow, *fast = motor_poles(m)
    rise: Any
    if fast:
        # 1 - speed/final is the divided difference of p' e^(p t) over the poles p, p'; written so
        # that it holds for equal poles too.
        t_phi = t * _phi((fast[0] - slow) * t)
        rise = 1.0 - np.exp(slow * t) * (1.0 - slow * t_phi)
        slope = slow * fast[0] * np.exp(slow * t) * t_phi
    else:
        rise, slope = -np.expm1(slow * t), -slow * np.exp(slow * t)
    speed, acceleration = final * np.real(rise), final * np.real(slope)
    # Integrated once, the motor says a_2 domega/dt + a_1 omega + a_0 theta = k (u - hold) t.
    angle = final * t - (sum(higher) * acceleration + a_1 * speed) / a_0
    current = hold / m.R + (m.inertia * acceleration + m.B * speed) / m.k_T
    return StepResponse(t, current, speed, angle, m.k_q * angle)


def _phi(x: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """(e^x - 1)/x, 1 at 0."""
    return np.divide(np.expm1(x), x, out=np.ones_like(x), where=x != 0.0)


class InductanceError(NamedTuple):
    """What neglecting the inductance costs, measured on one voltage step."""

    electrical_time: float  # s, L/R
    mechanical_time: float  # s, T1 of the simplified motor
    poles: tuple[complex, ...]  # 1/s, of the full motor, the slowest first
    simplified_pole: complex  # 1/s, -1/T1
    peak_speed_error: float  # -, largest difference in speed over the final speed
    time_constant_shift: float  # s, time to 63.2 % of the final speed, minus T1
    position_lag: float  # s, travel behind the simplified motor at last, over the final speed
    peak_position_lag: float  # s, the largest such lag on the way
    start_delay: float  # s, until a winding without current carries what load and friction take


def inductance_error(
    actuator: Actuator, water: Water, *, voltage: float, depth: float = 0.0
) -> InductanceError:
    """Return the measured difference between the full motor and the one without inductance.

    Both make the step of step_response to `voltage` [V] at `depth` [m]. All but start_delay are
    independent of both. Raises InputError where the motor's data is not known, NoAnswerError where
    the voltage does not drive it.
    """
    full = full_motor(actuator, water)
    simplified = full._replace(L=0.0)
    poles, (pole,) = motor_poles(full), motor_poles(simplified)
    T1 = -1.0 / pole.real
    slow, fast = (1.0 / abs(p.real) for p in (poles[0], poles[-1]))
    t = np.concatenate(([0.0], np.geomspace(1e-3 * min(fast, T1), 40.0 * max(slow, T1), 20_000)))
    a = step_response(full, t, voltage=voltage, depth=depth)
    b = step_response(simplified, t, voltage=voltage, depth=depth)
    final = float(b.speed[-1])
    lag = (b.angle - a.angle) / final
    hold = holding_voltage(full, depth)
    return InductanceError(
        electrical_time=full.L / full.R,
        mechanical_time=T1,
        poles=poles,
        simplified_pole=pole,
        peak_speed_error=float(np.max(np.abs(a.speed - b.speed))) / final,
        time_constant_shift=_crossing(t, a.speed, (1.0 - math.exp(-1.0)) * final) - T1,
        position_lag=float(lag[-1]),
        peak_position_lag=float(np.max(lag)),
        start_delay=-full.L / full.R * math.log1p(-hold / voltage),
    )


def _crossing(t: Array, y: Any, level: float) -> float:
    """Time at which y first reaches the level, between samples by a line."""
    k = int(np.argmax(y >= level))
    return float(np.interp(level, y[k - 1 : k + 1], t[k - 1 : k + 1]))
