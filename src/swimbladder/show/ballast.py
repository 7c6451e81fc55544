"""Ballasting as it is shown: the volume it rests with, and the water, against depth."""

from collections.abc import Iterator
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from swimbladder.design.ballast import Ballasting
from swimbladder.io.answers import attributes
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.hull import neutral_volume
from swimbladder.show import style
from swimbladder.show.parts import Drawn, Part, Shown, labelled
from swimbladder.show.style import Ink

_SEAS = (Ink.BLUE, Ink.ORANGE, Ink.GREEN, Ink.PURPLE, Ink.SKY)


@style.styled
def draw_ballasting(found: Ballasting) -> Figure:
    """Return neutral volume with its band between the ends of the stroke, density, temperature."""
    how: Any = {"sharey": True, "width_ratios": (2.2, 1.0, 1.0)}
    figure, (volume, density, temperature) = style.new_figure((9.0, 5.0), 1, 3, **how)
    stroke = found.vehicle.stroke
    for side in (stroke.minimum, stroke.maximum):
        volume.axvline(1e6 * side, color=Ink.VERMILION, lw=1.2, ls="--", label="ends of the stroke")
    several, cases = len(found.columns) > 1, f"in {100.0 * found.target.probability:g} % of cases"
    for column, curve, color in zip(found.columns, found.curves, cycle(_SEAS), strict=False):
        named = f"neutral, {column.source}" if several else "neutral volume"
        volume.plot(1e6 * curve.nominal, curve.depth, color=color, label=named)
        low, high = 1e6 * curve.low, 1e6 * curve.high
        volume.fill_betweenx(curve.depth, low, high, color=color, alpha=0.25, lw=0.0, label=cases)
        density.plot(column.density, column.depth, color=color)
        temperature.plot(column.temperature, column.depth, color=color)
    if found.target.neutral_depth is not None:
        at = [1e6 * found.target.neutral_volume], [found.target.neutral_depth]
        volume.plot(*at, "o", color=Ink.GREY, ms=6, label="to be neutral here")
    volume.set_xlabel("volume of the drive [cm³], 0 at mid-stroke")
    density.set_xlabel("density in situ [kg/m³]")
    temperature.set_xlabel("temperature [°C]")
    style.depth_axis(volume)
    volume.set_ylim(found.columns[0].deepest, 0.0)
    ncols = 3 if several else 4
    style.legend_beside(figure, [volume], "outside lower left", ncols=ncols, fontsize=8.0)
    density.tick_params(axis="x", labelrotation=45)
    sea = f"{len(found.columns)} seas" if several else found.columns[0].source
    figure.suptitle(f"{found.vehicle.name} in {sea}", fontsize=10.0)
    style.label_panels([volume, density, temperature])
    return figure


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
