"""A ballasting as files: the vehicle as ballasted, volumes over depth, numbers and a picture."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from swimbladder.design.ballast import Ballasting
from swimbladder.io.answers import attributes
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.hull import neutral_volume
from swimbladder.show.plots.ballast import draw_ballasting


def columns(found: Ballasting) -> dict[str, Any]:
    """Return the columns of ballast.csv: the first water, and the neutral volume in it."""
    column, curve = found.columns[0], found.curves[0]
    return {
        **attributes(column, "depth_m pressure_Pa density_kg_m3 temperature_degC"),
        "neutral_volume_m3": neutral_volume(found.vehicle, column),
        "neutral_volume_low_m3": np.interp(column.depth, curve.depth, curve.low),
        "neutral_volume_high_m3": np.interp(column.depth, curve.depth, curve.high),
    }


def ballast_files(found: Ballasting, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of ballast.csv, ballast.png, ballast.json and vehicle.toml.

    answer: ballast.json. Where the surface of the cast is beyond the stroke there is no
    vehicle.toml: no such vehicle can sink and rise.
    """
    stroke = found.vehicle.stroke
    files: dict[str, object] = {
        "ballast.png": draw_ballasting(found),
        "ballast.csv": columns(found),
        "ballast.json": answer,
    }
    if stroke.minimum < found.vehicle.trim_error < stroke.maximum:
        head = "Ballasted by swimbladder ballast; [water] is that of the cast's surface."
        said = "\n".join([head, *found.sentences])
        files["vehicle.toml"] = vehicle_file(found.vehicle, head=said)
    return files
