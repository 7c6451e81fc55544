"""Depths and depth sensors as commands about controllers take them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from swimbladder.cli.common import quantity
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.vehicle import Vehicle

__all__ = ["depth_pair", "with_sensor"]


def with_sensor(vehicle: Vehicle, noise: str | None, quantum: str | None) -> Vehicle:
    """Return the vehicle with the depth sensor that was given; raises InputError for none."""
    changes = {
        name: value
        for name, value in (
            ("depth_noise", quantity(noise, "m", "--depth-noise")),
            ("depth_quantum", quantity(quantum, "m", "--depth-quantum")),
        )
        if value is not None
    }
    for name, value in changes.items():
        if not 0.0 <= value < 1e3:
            raise InputError(
                "must be 0 or more, and below 1 km", field=f"--{name.replace('_', '-')}",
                value=value, unit="m", remedy='Give what the datasheet has, like "1 mm"; 0: none',
            )  # fmt: skip
    return vehicle.model_copy(update={"sensors": vehicle.sensors.model_copy(update=changes)})


def depth_pair(text: str, option: str) -> tuple[float, float]:
    """Return two depths [m] of LEAST:MOST, with one unit for both or one each.

    Raises InputError naming the option.
    """
    parts = [part.strip() for part in text.split(":")]
    if len(parts) != 2 or not all(parts):
        raise InputError(
            "two depths are given with a colon between", field=option, value=text, unit="m",
            remedy='Write it like "0:10 m"',
        )  # fmt: skip
    unit = parts[1].lstrip("+-.0123456789eE").strip()
    if unit and not parts[0].lstrip("+-.0123456789eE").strip():
        parts[0] = f"{parts[0]} {unit}"
    first, last = (quantity(part, "m", option) for part in parts)
    assert first is not None
    assert last is not None
    return first, last
