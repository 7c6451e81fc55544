"""Depths and depth sensors as commands about controllers take them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.options import Options

if TYPE_CHECKING:
    from swimbladder.vehicle import Vehicle


@dataclass(frozen=True)
class DepthSensor(Options):
    """The depth sensor that a vehicle is tried with."""

    depth_noise: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help="Depth noise, 1 sigma (the vehicle's sensor)."),
    ] = None
    depth_quantum: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help="Quantum of the depth sensor (the vehicle's)."),
    ] = None

    def on(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle with this sensor; raises InputError for one that there is not."""
        given = self.given()
        with self.said_as_typed():
            return vehicle.with_sensors(**given)
