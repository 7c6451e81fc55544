"""From datasheets to the actuator's constants (Figs 3-8, eqs 3-8, Table 1): both technologies.

Three descriptions of a voltage-driven actuator, each with less in it than the one before::

    electrohydraulic, electromechanical   --unified-->        lambda, k_u, k_v, k_q, k_z, k_l
    any voltage-driven kind               --reduced-->        T1, K1 A, k_z/k_u: what a plant needs
    any voltage-driven kind               --to_identified-->  K1, T1, k_z/k_u, k_l, eqs (23)-(24)

Pump displacement and pitch are per revolution, as datasheets state them; eqs (7)-(8) divide by
2 pi. Positive volume rate displaces volume against the sea: the motor drives. With a negative one
the sea helps and the motor is driven back.
"""

import math
from typing import NamedTuple

from swimbladder.errors import InputError
from swimbladder.vehicle import (
    Actuator,
    ElectrohydraulicActuator,
    ElectromechanicalActuator,
    IdentifiedActuator,
    Positioner,
    PumpAndValve,
    UnifiedActuator,
    Water,
)
from swimbladder.vehicle.actuators import area_of


class ReducedActuator(NamedTuple):
    """What eqs (11)-(12) need of an actuator once they are divided by k_v: nothing is lost."""

    T1: float  # s, lambda/k_v, eq. (24)
    gain: float  # m3/s/V, K1 A = k_q k_u/k_v, eq. (23)
    load_drive: float  # V/m, k_z/k_u while the motor drives against the pressure
    load_back: float  # V/m, the same while the sea drives the motor back
    friction: float  # V, dry friction T_b/k_u
    k_l: float  # m2/s, leakage
    resistance: float | None  # ohm, of the winding; None where not known, as the next
    kappa: float | None  # V s/m3, back electromotive force per volume rate k_emf/k_q


def stall_torque_per_volt(*, k_T: float, R: float) -> float:
    """Stall torque per volt k_u = k_T/R [N m/V], Fig. 3. k_T [N m/A], R [ohm]."""
    return k_T / R


def speed_loss_coefficient(*, B_m: float, k_emf: float, k_T: float, R: float) -> float:
    """Torque lost per motor speed k_vm = B_m + k_emf k_T/R [N m s/rad], Fig. 3."""
    return B_m + k_emf * k_T / R


def leakage_volume_rate(*, Q_l: float, n_h: float) -> float:
    """Volume rate lost to leakage dV_l/dt [m3/s], eq. (3).

    Q_l: leakage flow of the pump [m3/s]; n_h: area ratio A1/A2 [-].
    """
    return Q_l / n_h


def pump_leakage_flow(*, k_pl: float, rho: float, g: float, z: float, n_h: float) -> float:
    """Leakage flow of the pump Q_l [m3/s] at depth z [m], eq. (4) (which prints g_2 for g z).

    k_pl: leakage per unit pump pressure [m3/s/Pa]; n_h: area ratio A1/A2 [-].
    """
    return k_pl * rho * g * z / n_h


def volume_lost_to_leakage(*, k_l: float, z: float) -> float:
    """Volume rate lost to leakage dV_l/dt [m3/s] at depth z [m], eq. (5). k_l [m2/s]."""
    return k_l * z


def leakage_coefficient(*, k_pl: float, rho: float, g: float, n_h: float) -> float:
    """Leakage coefficient k_l [m2/s], eq. (6).

    k_pl: leakage per unit pump pressure [m3/s/Pa]; n_h: area ratio A1/A2 [-]. Zero for the
    electromechanical drive (Table 1).
    """
    return k_pl * rho * g / n_h**2


def hydraulic_load_coefficient(
    *, rho: float, g: float, D_p: float, eta_p: float, n_h: float
) -> float:
    """Load torque per depth k_zh [N m/m] while the motor drives, eq. (7).

    D_p: pump displacement [m3/rev]; eta_p: its mechanical efficiency [-]; n_h: area ratio [-].
    """
    return rho * g * D_p / (2.0 * math.pi * eta_p * n_h)


def hydraulic_volume_per_angle(*, D_p: float, n_h: float) -> float:
    """Volume displaced in the water per motor angle k_qh [m3/rad], eq. (8). D_p [m3/rev]."""
    return D_p / (2.0 * math.pi * n_h)


def screw_load_coefficient(*, rho: float, g: float, A: float, alpha: float, eta_e: float) -> float:
    """Load torque per depth k_ze [N m/m] while the motor drives, section 2.1.3 and Table 1.

    A: piston area [m2]; alpha: travel per turn of the motor [m/rev]; eta_e: efficiency [-].
    """
    return rho * g * A * alpha / (2.0 * math.pi * eta_e)


def screw_volume_per_angle(*, A: float, alpha: float) -> float:
    """Volume per motor angle k_qe [m3/rad], section 2.1.3 and Table 1. A [m2], alpha [m/rev]."""
    return alpha / (2.0 * math.pi) * A


def unified(actuator: Actuator, water: Water) -> UnifiedActuator:
    """Return the unified actuator of Fig. 8 and Table 1.

    Raises InputError for an identified actuator or a positioner, whose constants are not known.
    """
    rho, g = water.density, water.gravity
    if isinstance(actuator, UnifiedActuator):
        return actuator
    if isinstance(actuator, ElectrohydraulicActuator):
        hydraulic = actuator.drive
        D_p, n_h, eta = hydraulic.pump_displacement, hydraulic.area_ratio, hydraulic.pump_efficiency
        k_q = hydraulic_volume_per_angle(D_p=D_p, n_h=n_h)
        k_z = hydraulic_load_coefficient(rho=rho, g=g, D_p=D_p, eta_p=eta, n_h=n_h)
        k_l = leakage_coefficient(k_pl=hydraulic.pump_leakage, rho=rho, g=g, n_h=n_h)
        back = None
    elif isinstance(actuator, ElectromechanicalActuator):
        screw = actuator.drive
        A, alpha, eta = screw.piston_area, screw.lead / screw.gear_ratio, screw.efficiency
        k_q = screw_volume_per_angle(A=A, alpha=alpha)
        k_z = screw_load_coefficient(rho=rho, g=g, A=A, alpha=alpha, eta_e=eta)
        k_l, back = 0.0, screw.back_efficiency
    else:
        raise _not_known(actuator)
    motor, drive = actuator.motor, actuator.drive
    k_vm = speed_loss_coefficient(
        B_m=motor.viscous_friction, k_emf=motor.k_emf, k_T=motor.torque_constant, R=motor.resistance
    )
    return UnifiedActuator(
        inertia=motor.rotor_inertia + drive.reflected_inertia,
        k_u=stall_torque_per_volt(k_T=motor.torque_constant, R=motor.resistance),
        k_v=k_vm + drive.viscous_friction,
        k_q=k_q,
        k_z=k_z,
        k_l=k_l,
        efficiency=eta,
        back_efficiency=back,
        friction_torque=motor.friction_torque,
        resistance=motor.resistance,
        emf_constant=motor.k_emf,
        literal_efficiency=actuator.literal_efficiency,
    )


def refuse_pump_and_valve(actuator: Actuator) -> None:
    """Raise InputError for a pump and valve, which no voltage and no position drives."""
    if isinstance(actuator, PumpAndValve):
        raise InputError(
            "a pump that runs or not and a valve have no loop of voltages or positions, which this "
            "command is about",
            field="actuator.kind",
            value=actuator.kind,
            remedy="Use `simulate`, `tune`, `stability`, `firmware`, `faults` or `mission`, or "
            "describe the actuator as kind electrohydraulic",
        )


def _not_known(actuator: IdentifiedActuator | Positioner | PumpAndValve) -> InputError:
    refuse_pump_and_valve(actuator)
    if isinstance(actuator, Positioner):
        what = "a positioner has no motor constants: lambda, k_u, k_v, k_q and k_z are not known"
        remedy = "Its speed and piston area are all there is: use them, or describe its motor"
    else:
        what = (
            "lambda, k_u, k_v, k_q and k_z of an identified actuator are not known: experiments "
            "give only the ratios lambda/k_v = T1, k_q k_u/k_v = K1 A and k_z/k_u"
        )
        remedy = (
            "Use reduced(), which needs only these ratios, or give the data of motor and drive as "
            "kind electrohydraulic, electromechanical or unified"
        )
    return InputError(what, field="actuator.kind", value=actuator.kind, remedy=remedy)


def reduced(actuator: Actuator, water: Water) -> ReducedActuator:
    """Return T1, K1 A, k_z/k_u and what goes with them, for any voltage-driven actuator.

    Where the efficiency is not known, or the literal form is asked for, the load is the same in
    both directions. Raises InputError for a positioner, which no voltage drives.
    """
    if isinstance(actuator, IdentifiedActuator):
        load, k_l = actuator.depth_voltage, actuator.k_l
        gain = actuator.K1 * actuator.piston_area
        friction = actuator.dead_zone
        return ReducedActuator(actuator.T1, gain, load, load, friction, k_l, None, None)
    a = unified(actuator, water)
    drive, back = a.k_z, a.k_z_back
    return ReducedActuator(
        T1=a.inertia / a.k_v,
        gain=a.k_q * a.k_u / a.k_v,
        load_drive=drive / a.k_u,
        load_back=back / a.k_u,
        friction=a.friction_torque / a.k_u,
        k_l=a.k_l,
        resistance=a.resistance,
        kappa=None if a.emf_constant is None else a.emf_constant / a.k_q,
    )


def to_identified(
    actuator: Actuator, water: Water, *, piston_area: float | None = None
) -> IdentifiedActuator:
    """Return K1, T1, k_z/k_u and k_l as shallow-water experiments would find them, eqs (23)-(24).

    piston_area: A [m2]; a screw drive and an identified actuator bring their own. Dry friction and
    the smaller load of back-driving do not survive: k_z/k_u is that of driving. Raises InputError
    for a positioner, and where the area is not known.
    """
    a = reduced(actuator, water)
    area = piston_area or area_of(actuator)
    if area is None:
        what = f"the piston area is not known for an actuator of kind {actuator.kind!r}"
        remedy = "Give the area that makes a volume a travel; with 1 m2, K1 is a volume rate"
        raise InputError(what, field="piston_area", unit="m2", remedy=remedy)
    return IdentifiedActuator(
        K1=a.gain / area,
        T1=a.T1,
        piston_area=area,
        depth_voltage=a.load_drive,
        k_l=a.k_l,
        dead_zone=a.friction,
    )
