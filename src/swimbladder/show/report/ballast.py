"""A ballasting as files: the vehicle as ballasted, volumes over depth, numbers and a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from swimbladder.design.ballast import Ballasting
from swimbladder.io.files import publish, write_atomically
from swimbladder.io.tables import write_csv
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.hull import neutral_volume
from swimbladder.show.plots.ballast import draw_ballasting
from swimbladder.show.plots.style import save


def write_ballasting(found: Ballasting, out: Path, *, answer: str) -> list[Path]:
    """Write ballast.csv, ballast.png, ballast.json and vehicle.toml into `out`; return the paths.

    answer: the text of ballast.json. Where the surface of the cast is beyond the stroke there is no
    vehicle.toml: no such vehicle can sink and rise. Raises InputError where the folder cannot be
    written.
    """
    stroke = found.vehicle.stroke
    fits = stroke.minimum < found.vehicle.trim_error < stroke.maximum
    names = ["ballast.png", "ballast.csv", "ballast.json", *(["vehicle.toml"] if fits else [])]

    def write(folder: Path) -> None:
        column, curve = found.columns[0], found.curves[0]
        write_csv(
            folder / "ballast.csv",
            {
                "depth_m": column.depth,
                "pressure_Pa": column.pressure,
                "density_kg_m3": column.density,
                "temperature_degC": column.temperature,
                "neutral_volume_m3": neutral_volume(found.vehicle, column),
                "neutral_volume_low_m3": np.interp(column.depth, curve.depth, curve.low),
                "neutral_volume_high_m3": np.interp(column.depth, curve.depth, curve.high),
            },
        )
        write_atomically(folder / "ballast.json", answer + "\n")
        save(draw_ballasting(found), folder / "ballast.png")
        if fits:
            head = "\n".join(
                ["Ballasted by swimbladder ballast; [water] is that of the cast's surface.",
                 *found.sentences]
            )  # fmt: skip
            write_atomically(folder / "vehicle.toml", vehicle_file(found.vehicle, head=head))

    publish(out, write)
    return [out / name for name in names]
