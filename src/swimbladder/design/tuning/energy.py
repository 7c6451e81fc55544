"""Electrical energy of trials, from samples: exact for a voltage that is held between them.

A winding takes u (u - kappa q)/R. With u held over a sample, the integral of q is the volume that
was pumped, so that no more than the samples is needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.actuator import reduced
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.electric import electrical_power, largest_voltage, winding_current
from swimbladder.vehicle import Positioner, Vehicle

Array = NDArray[np.float64]


class Winding(NamedTuple):
    """A motor as its supply sees it."""

    R: float  # ohm
    kappa: float  # V s/m3, back electromotive force per volume rate


def winding(vehicle: Vehicle) -> Winding | None:
    """Return the winding of a vehicle's motor, None where R or k_T are not known."""
    if isinstance(vehicle.actuator, Positioner):
        return None
    a = reduced(vehicle.actuator, vehicle.water)
    if a.resistance is None or a.kappa is None:
        return None
    return Winding(a.resistance, a.kappa)


def electrical_energy(
    motor: Winding, p: Plant, *, sample_time: float, command: Array, volume: Array, depth: Array
) -> Array:
    """Return the energy into the motor in each sample [J], [samples, runs].

    command [V], volume [m3] and depth [m]: [samples + 1, runs], the command from each sample on.
    The voltage is cut to what the supply gives at the sample's mean rate.
    """
    q = np.diff(volume, axis=0) / sample_time + p.k_l * depth[:-1]
    u = command[:-1]
    most = largest_voltage(
        E=p.supply, sag=p.sag, emf=motor.kappa * q * np.where(u >= 0.0, 1.0, -1.0)
    )
    u = np.clip(u, -most, most)
    i = winding_current(u=u, omega=q, R=motor.R, k_emf=motor.kappa)
    return electrical_power(u=u, i=i) * sample_time
