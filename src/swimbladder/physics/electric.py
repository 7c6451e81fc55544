"""Current, power, driver and battery: what the motor draws, and the voltage it can get.

The driver is an ideal four-quadrant pulse-width modulator: it holds the motor at the average
voltage u, passes on the power u i without loss, and its duty |u|/(terminal voltage) is at most 1.
The battery is an open-circuit voltage E behind a resistance R_b. A negative current charges it.

Signals (voltages, currents, speeds, depths) may be arrays; a constant may be one too.
"""

from typing import Any, NamedTuple, TypeVar

import numpy as np

from swimbladder.errors import InputError
from swimbladder.physics.arrays import Array
from swimbladder.vehicle import Supply, UnifiedActuator, Water

_F = TypeVar("_F", float, Array)


def winding_current(*, u: _F, omega: _F, R: float, k_emf: float) -> _F:
    """Current of the winding i = (u - k_emf omega)/R [A], Fig. 3: without the inductance.

    u [V], omega: motor speed [rad/s], R [ohm], k_emf [V s/rad]. With volume rates, k_emf omega is
    kappa q.
    """
    return (u - k_emf * omega) / R


def electrical_power(*, u: _F, i: _F) -> _F:
    """Electrical power into the motor u i [W]; negative while it brakes into the supply."""
    return u * i


def copper_loss(*, i: _F, R: float) -> _F:
    """Heat in the winding R i^2 [W]."""
    return R * i * i


def supply_current(*, P: _F, E: float, R_b: float) -> _F:
    """Current i_b [A] of a battery that delivers the power P [W] at its terminals.

    The smaller root of P = (E - R_b i_b) i_b: the terminal voltage stays above E/2. NaN beyond
    E^2/(4 R_b), the most that any load can take.
    """
    discriminant: Any = E * E - 4.0 * R_b * P
    root: Any = np.sqrt(np.where(discriminant >= 0.0, discriminant, np.nan))
    current: Any = 2.0 * P / (E + root)
    return current  # type: ignore[no-any-return]


def largest_voltage(*, E: float, sag: float, emf: _F, direction: float = 1.0) -> _F:
    """Largest |u| [V] that the battery can hold at a motor with back electromotive force `emf` [V].

    sag: R_b/R [-]; direction: sign of u. At full duty the winding carries the battery's current,
    so |u| = E - R_b (|u| - direction emf)/R, hence |u| = (E + sag direction emf)/(1 + sag); but
    never above E, which a motor turned by the sea while it charges the battery could reach.
    This is the largest while R_b <= R and the motor is not turned against its voltage faster than
    -direction emf = E (1/sag - 1)/2: beyond, the battery is loaded past its best and a duty
    below 1 gives more.
    """
    largest: Any = np.minimum((E + sag * direction * emf) / (1.0 + sag), E)
    return largest  # type: ignore[no-any-return]


def depth_at_rate(
    *, E: Any, sag: Any, load: Any, friction: Any, q: Any, gain: Any, kappa: Any
) -> Any:
    """Stall depth [m] of the motor at the rate q [m3/s], steadily.

    There the voltage it needs, load z + friction + q/gain, is the largest one at its speed.
    E [V], sag: R_b/R [-]; load [V/m], friction [V], gain [m3/s/V], kappa [V s/m3]: of a
    ReducedActuator while driving. 0 where not even the surface allows the rate, inf without a load.
    Arrays too.
    """
    spare = largest_voltage(E=E, sag=sag, emf=kappa * q) - friction - q / gain
    spare, load = np.broadcast_arrays(np.maximum(spare, 0.0), load)
    unloaded = np.where(spare > 0.0, np.inf, 0.0)
    depth = np.divide(spare, load, out=unloaded, where=load > 0.0)
    return float(depth) if depth.ndim == 0 else depth


def stall_depth(*, E: Any, sag: Any, load: Any, friction: Any) -> Any:
    """Stall depth [m] of the motor: k_z z + T_b = k_u u_max.

    At standstill there is no back electromotive force and u_max = E/(1 + sag). Arguments as in
    depth_at_rate, with sag 0 for a battery without internal resistance.
    """
    return depth_at_rate(E=E, sag=sag, load=load, friction=friction, q=0.0, gain=1.0, kappa=0.0)


class SteadyDrive(NamedTuple):
    """A motor at steady speed and where its power goes; the supply's is the sum of all below it.

    Negative supply: it is charged. Negative sea: the water drives the motor back.
    """

    omega: Any  # rad/s, motor speed
    current: Any  # A, of the winding
    supply_current: Any  # A, NaN where the supply cannot hold the voltage
    volume_rate: Any  # m3/s, dV/dt
    supply: Any  # W, E i_b
    battery: Any  # W, lost in the internal resistance
    copper: Any  # W, lost in the winding
    conversion: Any  # W, (k_emf - k_T) i omega: what the two constants of a motor differ by
    viscous: Any  # W, lost in proportion to speed squared
    friction: Any  # W, lost in dry friction
    transmission: Any  # W, lost in pump or screw
    leakage: Any  # W, lost in oil that flows back through the pump
    sea: Any  # W, rho g z dV/dt: done on the water


def steady_drive(
    actuator: UnifiedActuator,
    water: Water,
    *,
    voltage: Any,
    depth: Any,
    supply: Supply | None = None,
) -> SteadyDrive:
    """Return speed, currents and powers at a constant `voltage` [V] and `depth` [m], arrays too.

    supply: None for one without internal resistance. Raises InputError where the resistance or the
    emf constant is not known, or where the actuator's k_v is below what its own back electromotive
    force makes, k_emf k_u.
    """
    R, k_emf = _winding(actuator)
    a, u, z = actuator, np.asarray(voltage, float), np.asarray(depth, float)
    k_T, B = a.k_u * R, a.k_v - k_emf * a.k_u
    T_drive, T_back = a.k_z * z, a.k_z_back * z
    forward = np.maximum(a.k_u * u - T_drive - a.friction_torque, 0.0)
    backward = np.minimum(a.k_u * u - T_back + a.friction_torque, 0.0)
    omega = (forward + backward) / a.k_v
    T_z = np.where(omega > 0.0, T_drive, T_back)
    i = winding_current(u=u, omega=omega, R=R, k_emf=k_emf)
    P = electrical_power(u=u, i=i)
    i_b, P_b, loss = np.full(np.shape(P), np.nan), P, np.zeros(np.shape(P))
    if supply is not None:
        E, R_b = supply.voltage, supply.internal_resistance
        largest = largest_voltage(E=E, sag=R_b / R, emf=k_emf * omega, direction=np.sign(u))
        held = np.where(np.abs(u) <= largest * (1.0 + 1e-12), 1.0, np.nan)
        i_b = held * supply_current(P=P, E=E, R_b=R_b)
        P_b, loss = E * i_b, R_b * i_b**2
    pumped, leaked = a.k_q * omega, a.k_l * z
    weight = water.specific_weight
    fields = SteadyDrive(
        omega=omega,
        current=i,
        supply_current=i_b,
        volume_rate=pumped - leaked,
        supply=P_b,
        battery=loss,
        copper=copper_loss(i=i, R=R),
        conversion=(k_emf - k_T) * i * omega,
        viscous=B * omega**2,
        friction=a.friction_torque * np.abs(omega),
        transmission=(T_z - weight * z * a.k_q) * omega,
        leakage=weight * z * leaked,
        sea=weight * z * (pumped - leaked),
    )
    return SteadyDrive(*(np.asarray(field)[()] for field in fields))  # numbers, not 0-d arrays


def _winding(actuator: UnifiedActuator) -> tuple[float, float]:
    """Return R [ohm] and k_emf [V s/rad], checked."""
    R, k_emf = actuator.resistance, actuator.emf_constant
    for name, value, unit in (("resistance", R, "ohm"), ("emf_constant", k_emf, "V s/rad")):
        if value is None:
            what = "current and power need the motor's resistance and emf constant"
            remedy = "Take it from the motor's datasheet"
            raise InputError(what, field=f"actuator.{name}", unit=unit, remedy=remedy)
    assert R is not None
    assert k_emf is not None
    if actuator.k_v < k_emf * actuator.k_u * (1.0 - 1e-9):
        raise InputError(
            f"k_v is below emf_constant times k_u, {k_emf * actuator.k_u:g}, which the back "
            "electromotive force alone makes: such a motor would create energy",
            field="actuator.k_v",
            value=actuator.k_v,
            unit="N m s/rad",
            remedy="k_v is B_m + emf_constant k_u + the viscous friction of the drive",
        )
    return R, k_emf
