"""``swimbladder compare``: what a log recorded drives the model, and the depths are compared.

With ``--horizons`` the depth is also predicted some seconds ahead: options, table and files of it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import LogCasts
from swimbladder.cli.common import aside, working
from swimbladder.cli.logs import Chosen, LogReading, LogVehicle, vehicle_of
from swimbladder.cli.options import Files, LogFiles, Options, flag, grouped, loaded, valued
from swimbladder.cli.texts import Given
from swimbladder.errors import SwimbladderError
from swimbladder.units import quantity

if TYPE_CHECKING:
    from swimbladder.estimation.comparison import Comparison
    from swimbladder.estimation.comparison.ahead import Ahead as Predicted
    from swimbladder.physics.seawater import Column
    from swimbladder.vehicle import Vehicle


def _noise(unit: str) -> Callable[[str, str], float | None]:
    return lambda text, option: quantity(text, unit, option)


def _times(text: str, option: str) -> list[float]:
    return [quantity(part.strip(), "s", option) for part in text.split(",") if part.strip()]


class Ahead(Options):
    """Predictions over some times, and the noise that they assume."""

    horizons: Given = valued("TIME,...", 'Horizons of predictions: "10 s,60 s".', read=_times)
    random_walk: Given = valued(
        "INTENSITY", "Random walk of the neutral volume, for --horizons.", read=_noise("m3/s^0.5")
    )
    depth_noise: Given = valued("DEPTH", "Depth noise, 1 sigma, for --horizons.")
    acceleration_noise: Given = valued(
        "INTENSITY", "Acceleration noise density, for --horizons.", read=_noise("m/s/s^0.5")
    )

    def asked(self) -> dict[str, Any] | None:
        """Return what predict_ahead is called with; None where it is not asked for.

        Raises InputError naming the option.
        """
        given = self.read()
        horizons = given.pop("horizons")
        if horizons is None:
            remedy = 'Add --horizons "10 s,60 s", or leave it out'
            self.refuse("this belongs to --horizons", remedy)
            return None
        from swimbladder.estimation.comparison.ahead import Tuning

        return {"horizons": horizons, "tuning": Tuning(**given)}


class Fit(Options):
    """How a log is compared, as `estimation.comparison.compare` has it."""

    drive: Given = valued("INPUT", "Input: volume, voltage or setpoint (first logged).")
    free: Given = valued(
        "NAME,...",
        "Parameters to identify: neutral_volume (default), neutral_drift, mass, drag, "
        "drag_quadratic, psi, start_depth, start_speed; or none.",
    )
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (none).")
    surface_margin: str = valued("DEPTH", "Smallest depth used.", "0.1 m")
    submerged: bool = flag("--submerged", "Begin at the first depth beyond that.")


@grouped("where column free horizons", out=Path("swimbladder-compare"))
def compare(
    logs: LogFiles,
    vehicle: LogVehicle = None,
    *,
    reading: LogReading,
    fit: Fit,
    ahead: Ahead,
    casts: LogCasts,
    plot: Annotated[bool, typer.Option("--plot", help="Also draw compare.png.")] = False,
    to: Files,
) -> None:
    """Drive the model with a measured log and compare depths.

    The model's input is the logged volume or piston, else the voltage, else the set-point, which
    the vehicle's own controller follows. With --cast, and a logged volume, the neutral volume
    follows the density of the water. Each log is compared separately; exit code 1 or 2: at least
    one could not be.
    """
    v = loaded(vehicle_of(reading.chosen(logs), vehicle), sampled=True)
    ahead.asked()
    chosen = reading.chosen(logs)
    from swimbladder.estimation.comparison.record import water_of_each
    from swimbladder.show.comparison import Compared, ComparedShown

    done = []
    waters = water_of_each(len(chosen), casts.water(v.hull.depth_limit))
    for log, name, water in zip(chosen, _file_names(chosen), waters, strict=True):
        try:
            found = _compare(log, v, reading, fit, ahead, water)
        except SwimbladderError as error:
            if len(chosen) == 1:
                raise
            aside(f"error: {error}")
            done.append(Compared(log.label, name, error=error))
        else:
            done.append(Compared(log.label, name, *found))
    to.answer(ComparedShown(done, pictures=plot))


def _file_names(logs: Sequence[Chosen]) -> list[str]:
    """Return a name for the files of each log, ``compare`` where there is only one."""
    if len(logs) == 1:
        return ["compare"]
    found: list[str] = []
    for log in logs:
        parts = [f"{name}-{value}" for name, value in log.where.items()]
        if len({other.path for other in logs}) > 1:
            parts.insert(0, log.path.name.split(".")[0])
        name = "compare-" + re.sub(r"[^\w.-]+", "_", "-".join(parts))
        taken = sum(other == name or other.startswith(f"{name}~") for other in found)
        found.append(f"{name}~{taken + 1}" if taken else name)
    return found


def _compare(
    log: Chosen, vehicle: Vehicle, reading: LogReading, fit: Fit, ahead: Ahead, water: Column | None
) -> tuple[Comparison, Predicted | None]:
    """Compare a log with the model, and predict over the spans that are asked for."""
    read, options, spans = reading.log(log, vehicle), fit.given(), ahead.asked()
    with working(f"comparing {log.label}") as advance:
        from swimbladder.estimation.comparison import compare as compare_log

        result = compare_log(read, vehicle, **options, cast=water, advance=advance)
    if spans is None:
        return result, None
    edges = {n: options[n] for n in ("bottom_depth", "surface_margin") if n in options}
    with working(f"predicting {log.label}") as advance:
        from swimbladder.estimation.comparison.ahead import predict_ahead

        more: Any = {**spans, **edges, "column": water}
        return result, predict_ahead(read, vehicle, **more, advance=advance)
