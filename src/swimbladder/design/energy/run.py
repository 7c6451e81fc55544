"""What a vehicle's drive costs over depth, and what a thruster would: the whole answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from swimbladder.design.energy import messages
from swimbladder.design.energy.energy_per_volume import DriveEnergy, drive_energy, sea
from swimbladder.design.energy.thruster_comparison import (
    Hovering,
    Profiling,
    Thruster,
    hovering,
    profiling,
)

if TYPE_CHECKING:
    from swimbladder.physics.seawater import Cast
    from swimbladder.vehicle import Vehicle


@dataclass(frozen=True)
class Energy:
    """The drive's energy over depth, and two tasks beside a thruster's.

    warnings: of the water.
    """

    drive: DriveEnergy
    hover: Hovering
    dive: Profiling
    thruster: Thruster
    warnings: tuple[str, ...]

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle whose drive it is."""
        return self.drive.vehicle

    @property
    def sentences(self) -> list[str]:
        """The answer in words."""
        versus = messages.versus_sentences(self.hover, self.dive, self.drive)
        return [*self.warnings, *messages.drive_sentences(self.drive), *versus]

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What is taken for granted."""
        return messages.assumptions(self.drive, self.thruster)


def energy(
    vehicle: Vehicle,
    cast: Cast | None = None,
    *,
    deepest: float | None = None,
    weight_error: float = 10e-6,
    speed: float = 0.1,
    thruster: Thruster | None = None,
) -> Energy:
    """Find what changing the volume costs at each depth, and what a thruster would.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    cast
        The water, as `read_cast` returns it; none: that of the vehicle's file, of constant density.
    deepest
        How deep [m]; none: the vehicle's rating, or where the cast ends above that.
    weight_error
        By which the vehicle is too heavy while it hovers [m3].
    speed
        Of dives [m/s].
    thruster
        What the drive is compared with; none: as `Thruster` has it.

    Returns
    -------
    Energy
        Energy per volume and efficiency over depth, hovering and dives beside the thruster.

    Raises
    ------
    InputError
        A number makes no sense, or the cast may be in another unit.
    NoAnswerError
        The drive's electrical power is not known.
    """
    water, warnings = sea(vehicle, cast, deepest)
    found, thruster = drive_energy(vehicle, water), thruster or Thruster()
    hover = hovering(found, thruster, weight_error=weight_error)
    return Energy(found, hover, profiling(found, thruster, speed=speed), thruster, tuple(warnings))
