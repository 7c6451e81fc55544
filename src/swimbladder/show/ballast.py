"""Ballasting as it is shown: the volume it rests with, and the water, against depth."""

from collections.abc import Iterator
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np

from swimbladder.design.ballast import Ballasting
from swimbladder.io.answers import attributes
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.hull import neutral_volume
from swimbladder.show.parts import Drawn, Part, Shown, labelled
from swimbladder.show.picture import Ink, Picture, grid_of

_SEAS = (Ink.BLUE, Ink.ORANGE, Ink.GREEN, Ink.PURPLE, Ink.SKY)


def draw_ballasting(found: Ballasting) -> Picture:
    """Return neutral volume with its band between the ends of the stroke, density, temperature."""
    several, stroke = len(found.columns) > 1, found.vehicle.stroke
    sea = f"{len(found.columns)} seas" if several else found.columns[0].source
    how: Any = {"sharey": "all", "widths": (2.2, 1.0, 1.0), "letters": True, "legend": "below"}
    title = f"{found.vehicle.name} in {sea}"
    picture, (volume, density, temperature) = grid_of((9.0, 5.0), 3, 3, title=title, **how)
    for side in (stroke.minimum, stroke.maximum):
        volume.rule("x", 1e6 * side, Ink.VERMILION, "ends of the stroke", dash="--", width=1.2)
    cases = f"in {100.0 * found.target.probability:g} % of cases"
    for column, curve, color in zip(found.columns, found.curves, cycle(_SEAS), strict=False):
        named = f"neutral, {column.source}" if several else "neutral volume"
        volume.line(1e6 * curve.nominal, curve.depth, color, named)
        volume.band(curve.depth, 1e6 * curve.low, 1e6 * curve.high, color, cases, flat=True)
        density.line(column.density, column.depth, color)
        temperature.line(column.temperature, column.depth, color)
    if found.target.neutral_depth is not None:
        at = 1e6 * found.target.neutral_volume, found.target.neutral_depth
        volume.dots(*at, "o", Ink.GREY, "to be neutral here")
    volume.x, volume.y = "volume of the drive [cm³], 0 at mid-stroke", "depth [m]"
    density.x, temperature.x, density.xticks = "density in situ [kg/m³]", "temperature [°C]", 4
    volume.ylim = (0.0, found.columns[0].deepest)
    return picture


class BallastingShown(Shown[Ballasting]):
    """The vehicle as ballasted, volumes over depth, numbers and a picture."""

    name = "ballast"

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        found = self.found
        yield f"{found.vehicle.name} in {', '.join(column.source for column in found.columns)}"
        yield from labelled("warning", found.warnings)
        yield from found.sentences
        spread = [
            f"{name} {1e6 * value:.2g}" for name, value in found.spread.items() if value > 0.0
        ]
        if spread:
            yield f"1 sigma of the neutral volume at the deepest, cm3: {', '.join(spread)}"
        yield Drawn("ballast", partial(draw_ballasting, found))
        yield from labelled("assumed", found.assumptions[len(found.warnings) :])

    def table(self) -> dict[str, Any]:
        """Return the columns of ballast.csv: the first water, and the neutral volume in it."""
        found = self.found
        column, curve = found.columns[0], found.curves[0]
        return {
            **attributes(column, "depth_m pressure_Pa density_kg_m3 temperature_degC"),
            "neutral_volume_m3": neutral_volume(found.vehicle, column),
            "neutral_volume_low_m3": np.interp(column.depth, curve.depth, curve.low),
            "neutral_volume_high_m3": np.interp(column.depth, curve.depth, curve.high),
        }

    def files(self) -> dict[str, object]:
        """Return ballast.csv and vehicle.toml.

        Where the surface of the cast is beyond the stroke there is no vehicle.toml: no such vehicle
        can sink and rise.
        """
        found = self.found
        files: dict[str, object] = {"ballast.csv": self.table()}
        if found.vehicle.stroke.minimum < found.vehicle.trim_error < found.vehicle.stroke.maximum:
            head = "Ballasted by swimbladder ballast; [water] is that of the cast's surface."
            said = "\n".join([head, *found.sentences])
            files["vehicle.toml"] = vehicle_file(found.vehicle, head=said)
        return files
