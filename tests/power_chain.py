"""The chain of powers of a steady drive, factor by factor, from its energy balance."""

from typing import Any, NamedTuple

import numpy as np

from swimbladder.physics.electric import SteadyDrive


class PowerChain(NamedTuple):
    """Shares of the power that get through, from the battery to the water, while driving."""

    battery: Any  # -, from the cells to the terminals
    motor: Any  # -, from the terminals to the drive's shaft, all friction included
    transmission: Any  # -, pump or screw: from the shaft to the volume pressed out
    leakage: Any  # -, from the volume pressed out to the volume that stays out
    total: Any  # -, from the cells to the water


def power_chain(d: SteadyDrive) -> PowerChain:
    """Return the shares of a drive that pumps out; NaN where it does not."""
    pumped = d.sea + d.leakage
    shaft = pumped + d.transmission
    terminals = d.supply - d.battery
    driving = (d.omega > 0.0) & (d.sea > 0.0)
    pairs = (
        (terminals, d.supply),
        (shaft, terminals),
        (pumped, shaft),
        (d.sea, pumped),
        (d.sea, d.supply),
    )
    return PowerChain(*(np.where(driving, out, np.nan) / into for out, into in pairs))


def per_volume(d: SteadyDrive) -> Any:
    """Return the energy from the supply per volume pressed out [J/m3]; NaN where none is."""
    return np.where(d.volume_rate > 0.0, d.supply, np.nan) / d.volume_rate
