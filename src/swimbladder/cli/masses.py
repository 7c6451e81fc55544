"""What the commands that fly a vehicle say of a dry mass that its trim does not carry."""

from __future__ import annotations

from typing import TYPE_CHECKING

from swimbladder.cli.common import console

if TYPE_CHECKING:
    from swimbladder.vehicle import Vehicle


def warn_of_mass(vehicle: Vehicle) -> None:
    """Say on stderr where a vehicle weighs another mass than its dry one."""
    from swimbladder.physics.hull import mass_mismatch

    doubt = mass_mismatch(vehicle)
    if doubt:
        console.print(
            f"warning: {doubt}; it sinks and rises by trim_error, and the dry mass is its inertia",
            soft_wrap=True, markup=False,
        )  # fmt: skip
