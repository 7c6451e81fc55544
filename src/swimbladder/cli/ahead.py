"""The part of ``swimbladder compare`` that looks ahead: options, table, files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.common import output, quantity
from swimbladder.cli.options import Options, Read
from swimbladder.errors import InputError
from swimbladder.units import format_quantity

if TYPE_CHECKING:
    from swimbladder.estimation.comparison.ahead import Ahead as Result

_NOISES = {
    "depth_noise": ("m", "mm"),
    "random_walk": ("m3/s^0.5", "cm3/s^0.5"),
    "acceleration_noise": ("m/s/s^0.5", "mm/s/s^0.5"),
}


def _noise(name: str) -> Read:
    return Read(lambda text, option: quantity(text, _NOISES[name][0], option))


def _times(text: str, option: str) -> list[float]:
    parts = (quantity(part.strip(), "s", option) for part in text.split(",") if part.strip())
    return [part for part in parts if part is not None]


@dataclass(frozen=True)
class Ahead(Options):
    """Predictions over some times, and the noise that they assume."""

    horizons: Annotated[
        str | None,
        typer.Option(
            "--ahead", metavar="TIME,...", help='Also predict these times ahead, as "10 s,60 s".'
        ),
        Read(_times),
    ] = None
    random_walk: Annotated[
        str | None,
        typer.Option(metavar="INTENSITY", help="Random walk of the neutral volume, for --ahead."),
        _noise("random_walk"),
    ] = None
    depth_noise: Annotated[
        str | None, typer.Option(metavar="DEPTH", help="Depth noise, 1 sigma, for --ahead.")
    ] = None
    acceleration_noise: Annotated[
        str | None,
        typer.Option(metavar="INTENSITY", help="Acceleration noise density, for --ahead."),
        _noise("acceleration_noise"),
    ] = None

    def asked(self) -> dict[str, Any] | None:
        """Return what predict_ahead is called with; None where it is not asked for.

        Raises InputError naming the option.
        """
        given = self.read()
        horizons = given.pop("horizons")
        if horizons is None:
            for option, value in self.changed().items():
                raise InputError(
                    "this belongs to --ahead", field=option, value=value,
                    remedy='Add --ahead "10 s,60 s", or leave it out',
                )  # fmt: skip
            return None
        from swimbladder.estimation.comparison.filter_prior import Tuning

        return {"horizons": horizons, "tuning": Tuning(**given)}


def write_ahead(ahead: Result, folder: Path, name: str, *, plot: bool) -> list[Path]:
    """Write the predictions, and a picture where asked for; return the paths."""
    from swimbladder.io.tables import write_csv

    files = [write_csv(folder / f"{name}-ahead.csv", ahead.columns())]
    if plot:
        from swimbladder.show.plots.ahead import plot_ahead

        files.append(plot_ahead(ahead, folder / f"{name}-ahead.png"))
    return files


def print_ahead(ahead: Result) -> None:
    """Print a row for each span, and the noise that the filter assumed."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("ahead", no_wrap=True)
    for heading in ("rms", "bias", "skill", "without drag", "in 95 % band", "predictions"):
        table.add_column(heading, justify="right", no_wrap=True)
    for h in ahead.horizons:
        skill = [("-" if s is None else f"{s:.2f}") for s in h.skill.values()]
        table.add_row(
            f"{h.seconds:g} s",
            f"{1e3 * h.rms:.1f} mm",
            f"{1e3 * h.bias:+.1f} mm",
            *skill,
            f"{100.0 * h.coverage:.1f} %",
            str(h.n),
        )
    output.print(table)
    output.print(
        "predicted from what was measured before, and the volume; skill: 1 - rms/rms of a depth "
        "that stays; without drag: of the same filter without drag and psi",
        soft_wrap=True,
    )
    for name, value in ahead.noise.items():
        unit, shown = _NOISES[name]
        output.print(
            f"{name.replace('_', ' ')}: {format_quantity(value, unit, shown, digits=3)}, "
            f"{ahead.origins[name]}"
        )
