"""The engine's accounts as volumes and energies a person can read, and what is left over."""

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from swimbladder.physics.actuator import reduced, unified
from swimbladder.sim.closed_loop.water import Medium
from swimbladder.sim.engine.books import Account
from swimbladder.vehicle import IdentifiedActuator, Positioner, Vehicle


@dataclass(frozen=True, kw_only=True)
class Books:
    """Where the volume and the energy of a run went.

    volume: pumped, leaked, change, travel [m3]. energy: each account [J]; source positive, sinks
    positive where they took energy, stores positive where they gained it. basis: what the source
    is. volume_residue [m3] and energy_residue [J] are what does not add up; throughput [J] is the
    energy that passed through, to judge the residue by. motion_residue and motion_throughput [J]
    are the same of the vehicle and the sea alone, which the motor's losses would hide.
    """

    volume: dict[str, float]
    energy: dict[str, float]
    basis: str
    volume_residue: float
    energy_residue: float
    throughput: float
    motion_residue: float
    motion_throughput: float
    motor_on: float

    @property
    def relative_energy_residue(self) -> float:
        """The larger of the two energy residues over its throughput [-]."""
        return max(
            abs(self.energy_residue) / self.throughput,
            abs(self.motion_residue) / self.motion_throughput,
        )


def close_books(
    vehicle: Vehicle,
    medium: Medium,
    sums: NDArray[Any],
    first: NDArray[Any],
    last: NDArray[Any],
    *,
    prescribed: bool = False,
) -> Books:
    """Return the books of a run from the engine's sums and its first and last (q, V, z, w).

    medium: the plant, in its water. prescribed: the volume was given, so that nothing is known of
    the motor.
    """
    p = medium.plant
    a = {account: float(sums[account]) for account in Account}
    q0, V0, z0, w0 = (float(value) for value in first)
    q1, V1, z1, w1 = (float(value) for value in last)
    m, k_b = vehicle.mass, medium.specific_weight
    energy, basis = _actuator_energy(vehicle, medium, a, q0, q1, prescribed)
    energy["drag"] = m * a[Account.DRAG]
    energy["bottom"] = m * a[Account.BOTTOM_W]
    energy["vehicle motion"] = 0.5 * m * (w1 * w1 - w0 * w0)
    energy["sea"] = m * (medium.potential(V1, z1) - medium.potential(V0, z0))
    motion = [energy[name] for name in ("drag", "bottom", "vehicle motion", "sea")]
    moved = m * p.a_b * a[Account.Z_DV]
    # volume that goes out and comes back passes energy through that the net accounts do not show
    passed = m * p.a_b * a[Account.TO_AND_FRO]
    source = energy["source"]
    sinks = sum(value for name, value in energy.items() if name != "source")
    return Books(
        volume={
            "pumped": a[Account.PUMPED],
            "leaked": a[Account.LEAKED],
            "change": V1 - V0,
            "travel": a[Account.TRAVEL],
        },
        energy=energy,
        basis=basis,
        volume_residue=(V1 - V0) - (a[Account.PUMPED] - a[Account.LEAKED]),
        energy_residue=source - sinks,
        throughput=max(abs(source), 0.5 * sum(map(abs, energy.values())), passed, k_b * 1e-12),
        motion_residue=moved - sum(motion),
        motion_throughput=max(passed, 0.5 * sum(map(abs, motion)), k_b * 1e-12),
        motor_on=a[Account.MOTOR_ON],
    )


def _actuator_energy(
    vehicle: Vehicle, medium: Medium, a: dict[Account, float], q0: float, q1: float,
    prescribed: bool,
) -> tuple[dict[str, float], str]:  # fmt: skip
    """Return the actuator's accounts [J] and what they count as the source.

    Work per voltage and volume k_u/k_q turns the reduced equation into torques. An identified
    actuator has only ratios: k_u/k_q is then rho g/(k_z/k_u), as of a transmission without loss.
    """
    p, k_b = medium.plant, medium.specific_weight
    hydraulic = k_b * a[Account.Z_Q]
    if prescribed:
        return {"source": hydraulic}, "work on the water (the volume was given)"
    if isinstance(vehicle.actuator, Positioner):
        return {"source": hydraulic}, "work on the water (the motor's losses are not known)"
    if isinstance(vehicle.actuator, IdentifiedActuator):
        if p.load_drive <= 0.0:
            return {
                "source": hydraulic,
                "leakage": k_b * a[Account.LEAK_Z],
            }, "work on the water (k_z/k_u is 0: the motor's work is not known)"
        work = k_b / p.load_drive
        basis = "shaft of the motor, as of a transmission without loss (efficiency not identified)"
    else:
        table = unified(vehicle.actuator, vehicle.water)
        work = table.k_u / table.k_q
        basis = "shaft of the motor"
    electric = (
        None
        if isinstance(vehicle.actuator, IdentifiedActuator)
        else reduced(vehicle.actuator, vehicle.water)
    )
    energy: dict[str, float] = {}
    viscous = work / p.gain
    if electric is not None and electric.resistance is not None and electric.kappa is not None:
        R, kappa = electric.resistance, electric.kappa
        energy["source"] = (a[Account.U_U] - kappa * a[Account.U_Q]) / R
        energy["copper"] = (
            a[Account.U_U] - 2.0 * kappa * a[Account.U_Q] + kappa**2 * a[Account.Q_Q]
        ) / R
        energy["torque conversion"] = (kappa / R - work) * (a[Account.U_Q] - kappa * a[Account.Q_Q])
        viscous -= work * kappa
        basis = "electrical power into the motor"
    else:
        energy["source"] = work * a[Account.U_Q]
    energy["speed losses"] = viscous * a[Account.Q_Q]
    energy["dry friction"] = work * a[Account.FRICTION_Q]
    energy["transmission"] = work * a[Account.LOAD_Q] - hydraulic
    energy["leakage"] = k_b * a[Account.LEAK_Z]
    rotor = 0.5 * work * p.T1 / p.gain
    energy["end stops"] = work * a[Account.STOP_U] + rotor * a[Account.STOP_Q]
    energy["rotor"] = rotor * (q1 * q1 - q0 * q0)
    return energy, basis
