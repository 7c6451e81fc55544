"""The part of ``swimbladder compare`` that looks ahead: options, table, files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from swimbladder.cli.common import output, quantity
from swimbladder.errors import InputError
from swimbladder.units import format_quantity

if TYPE_CHECKING:
    from swimbladder.estimation.comparison.ahead import Ahead

__all__ = ["ahead_options", "print_ahead", "write_ahead"]

_NOISES = {
    "depth_noise": ("--depth-noise", "m", "mm"),
    "random_walk": ("--random-walk", "m3/s^0.5", "cm3/s^0.5"),
    "acceleration_noise": ("--acceleration-noise", "m/s/s^0.5", "mm/s/s^0.5"),
}


def ahead_options(text: str | None, **noises: str | None) -> dict[str, Any] | None:
    """Return what look_ahead is called with; None where it is not asked for.

    Raises InputError naming the option.
    """
    given = {
        name: quantity(value, _NOISES[name][1], _NOISES[name][0]) for name, value in noises.items()
    }
    if text is None:
        for name, value in given.items():
            if value is not None:
                raise InputError(
                    "this belongs to --ahead", field=_NOISES[name][0], value=noises[name],
                    remedy='Add --ahead "10 s,60 s", or leave it out',
                )  # fmt: skip
        return None
    parts = [part.strip() for part in text.split(",") if part.strip()]
    horizons = [quantity(part, "s", "--ahead") or 0.0 for part in parts]
    if not horizons or min(horizons) <= 0.0 or len(set(horizons)) < len(horizons):
        raise InputError(
            "these are no times ahead", field="--ahead", value=text, unit="s",
            remedy='Give one or several, above 0 and different, as "10 s,60 s"',
        )  # fmt: skip
    from swimbladder.estimation.comparison.filter_prior import Tuning

    return {"horizons": horizons, "tuning": Tuning(**given)}


def write_ahead(ahead: Ahead, folder: Path, name: str, *, plot: bool) -> list[Path]:
    """Write the predictions, and a picture where asked for; return the paths."""
    from swimbladder.io.tables import write_csv

    files = [write_csv(folder / f"{name}-ahead.csv", ahead.columns())]
    if plot:
        from swimbladder.show.plots.ahead import plot_ahead

        files.append(plot_ahead(ahead, folder / f"{name}-ahead.png"))
    return files


def print_ahead(ahead: Ahead) -> None:
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
        _, unit, shown = _NOISES[name]
        output.print(
            f"{name.replace('_', ' ')}: {format_quantity(value, unit, shown, digits=3)}, "
            f"{ahead.origins[name]}"
        )
