"""What a vehicle's drive costs over depth, and what a thruster would: the whole answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from swimbladder.design.energy import messages
from swimbladder.design.energy.energy_per_volume import DriveEnergy, drive_energy, sea
from swimbladder.design.energy.thruster_comparison import (
    Hovering,
    Profiling,
    Thruster,
    hovering,
    profiling,
)
from swimbladder.io.answers import Answer, attributes, plain

if TYPE_CHECKING:
    from swimbladder.physics.seawater import Cast
    from swimbladder.vehicle import Vehicle


_ROWS = 201  # depths in tables, at most
_HOVERING = "thrust_N thruster_power_W engine_energy_J engine_power_W break_even_s"


@dataclass(frozen=True)
class Energy(Answer):
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

    def columns(self) -> dict[str, Any]:
        """Return the columns of energy.csv: a row per depth."""
        return depth_columns(self.drive, self.hover)

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers of the answer, SI units, every depth of the tables."""
        found, hover, dive = self.drive, self.hover, self.dive
        rows = spread_indices(found.column.depth.size, _ROWS)
        numbers: dict[str, Any] = plain(
            {
                "vehicle": found.vehicle.name,
                "actuator": found.vehicle.actuator.kind,
                "stall_depth_m": found.stall_depth,
                "stall_pressure_Pa": found.stall,
                "depths": depth_columns(found, hover),
                "efficiency_map": {
                    "voltage_share": found.shares,
                    "depth_m": found.column.depth[rows],
                    "efficiency": found.efficiencies[:, rows],
                },
                "hovering": {
                    "depth_m": found.column.deepest,
                    "weight_error_m3": hover.weight_error,
                    **{key: values[-1] for key, values in attributes(hover, _HOVERING).items()},
                },
                "profiling": {
                    "speed_m_s": dive.speed,
                    **dive_columns(dive),
                    "stroke_depth_m": dive.stroke_depth,
                    "break_even_m": dive.break_even,
                },
                "thruster": self.thruster._asdict(),
                "sentences": self.sentences,
                "assumptions": self.assumptions,
            }
        )
        return numbers


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


def depth_columns(found: DriveEnergy, hover: Hovering) -> dict[str, Any]:
    """Return the columns over some of the depths, evenly spread."""
    columns = {
        **attributes(found.column, "depth_m pressure_Pa"),
        **attributes(found.map, "rate_out_m3_s power_out_W"),
        **attributes(found, "energy_per_volume_J_m3=per_volume efficiency"),
        **{f"efficiency_{name}": values for name, values in found.stages.items()},
        **attributes(found.map, "rate_in_m3_s power_in_W holding_power_W leakage_m3_s"),
        "start_volume_m3": found.map.start_volume,
        "break_even_s": hover.break_even,
    }
    rows = spread_indices(found.column.depth.size, _ROWS)
    return {name: column[rows] for name, column in columns.items()}


def dive_columns(dive: Profiling) -> dict[str, Any]:
    """Return the columns of dives, a row per depth."""
    return attributes(dive, "depth_m engine_J thruster_J drag_J")


def spread_indices(count: int, most: int) -> Any:
    """Return which of `count` stand in a table of at most so many: the first and the last in."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
