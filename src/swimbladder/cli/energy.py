"""``swimbladder energy``: joules per millilitre over depth, against a thruster, from runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.cast_unit import refuse_doubted_unit
from swimbladder.cli.casts import (
    Columns,
    Inversions,
    Latitude,
    LogFormat,
    Longitude,
    Profile,
    Salinity,
    Where,
    above_rating,
    asked_casts,
    refuse_without_cast,
)
from swimbladder.cli.common import emit_json, json_text, output, progress, quantity, said_as_typed

if TYPE_CHECKING:
    from swimbladder.design.energy import DriveEnergy
    from swimbladder.physics.seawater import Cast, Column
    from swimbladder.vehicle import Vehicle

__all__ = ["energy"]

_DEEP = 100.0  # m, where neither an option nor the vehicle's rating says how deep
_SHORT = {
    "battery": "batt", "driver": "driver", "motor": "motor", "transmission": "drive",
    "leakage": "leak", "reservoir": "tank",
}  # fmt: skip
_LINES = 11  # depths in the printed table


def energy(
    vehicle: Annotated[
        str | None, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")
    ] = None,
    cast: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CTD cast (the vehicle's own water).")
    ] = None,
    depth: Annotated[
        str | None, typer.Option(metavar="DEPTH", help="How deep (the vehicle's rating).")
    ] = None,
    weight_error: Annotated[
        str, typer.Option(metavar="VOLUME", help="Too heavy by this while hovering.")
    ] = "10 cm3",
    speed: Annotated[str, typer.Option(metavar="SPEED", help="Of dives.")] = "0.1 m/s",
    thruster_diameter: Annotated[
        str, typer.Option(metavar="LENGTH", help="Of the propeller.")
    ] = "76 mm",
    thruster_efficiency: Annotated[
        str, typer.Option(metavar="SHARE", help="Of an ideal disc's, driver included.")
    ] = "35 %",
    thruster_number: Annotated[
        int, typer.Option(metavar="N", help="How many thrusters share the work.")
    ] = 1,
    thruster_idle: Annotated[
        str, typer.Option(metavar="POWER", help="Of each while it turns, pushing or not.")
    ] = "0 W",
    fit: Annotated[
        Path | None, typer.Option(metavar="RUNS", help="CSV of logged runs: find the pump in it.")
    ] = None,
    column: Columns = None,
    where: Where = None,
    log_format: LogFormat = None,
    profile: Profile = None,
    latitude: Latitude = None,
    longitude: Longitude = None,
    salinity: Salinity = None,
    inversions: Inversions = None,
    power_at: Annotated[
        str, typer.Option(metavar="WHEN", help="--fit: mean (over the run) or end (of it).")
    ] = "mean",
    shortest: Annotated[
        str, typer.Option(metavar="TIME", help="--fit: leave shorter runs out.")
    ] = "0 s",
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "swimbladder-energy"
    ),
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    r"""Say what changing the volume costs at each depth, and what a thruster would.

    With --fit RUNS: find a pump's power law and delivery in logged runs, and
    how sure they are; with a VEHICLE of kind pump-valve vehicle.toml has that
    pump. Exit code 1 says that the electrical power is not known, and which
    fields tell it.
    """
    from swimbladder.errors import InputError
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    v = None if vehicle is None else load_vehicle(vehicle)
    check_place(out)
    if fit is not None:
        if cast is not None:
            raise InputError(
                "runs have their own pressures, and a cast does not count", field="--cast",
                remedy="Leave out --cast or --fit",
            )  # fmt: skip
        refuse_without_cast(
            None, log_format=log_format, profile=profile, latitude=latitude, longitude=longitude,
            salinity=salinity, inversions=inversions,
        )  # fmt: skip
        from swimbladder.cli.energy_fit import fit_runs

        fit_runs(fit, v, column or [], where or [], power_at, shortest, out, json)
        return
    if v is None:
        raise InputError(
            "there is neither a vehicle nor a table of runs", field="VEHICLE",
            remedy="Give a vehicle, or --fit RUNS.csv",
        )  # fmt: skip
    _check_used(power_at, shortest)
    casts = asked_casts(
        [] if cast is None else [cast], column=column, where=where, log_format=log_format,
        profile=profile, latitude=latitude, longitude=longitude, salinity=salinity,
        inversions=inversions,
    )  # fmt: skip
    typed = {
        "--weight-error": weight_error, "--speed": speed, "--thruster-diameter": thruster_diameter,
        "--thruster-efficiency": thruster_efficiency, "--thruster-idle": thruster_idle,
        "--depth": depth,
    }  # fmt: skip
    numbers = {
        name: quantity(text, unit, option) or 0.0
        for name, text, unit, option in (
            ("weight_error", weight_error, "m3", "--weight-error"),
            ("speed", speed, "m/s", "--speed"),
            ("diameter", thruster_diameter, "m", "--thruster-diameter"),
            ("efficiency", thruster_efficiency, "", "--thruster-efficiency"),
            ("idle_power", thruster_idle, "W", "--thruster-idle"),
        )
    }
    wanted = quantity(depth, "m", "--depth")
    with progress("computing"), said_as_typed(typed, deepest="--depth", cast="--cast"):
        from swimbladder.design.energy import Thruster, drive_energy, hovering, profiling
        from swimbladder.design.energy.messages import (
            assumptions,
            drive_sentences,
            versus_sentences,
        )
        from swimbladder.show.report.energy import energy_json, write_energy

        water, warned = _water(v, casts, wanted)
        found = drive_energy(v, water)
        thruster = Thruster(
            diameter=numbers["diameter"], efficiency=numbers["efficiency"],
            number=thruster_number, idle_power=numbers["idle_power"],
        )  # fmt: skip
        hover = hovering(found, thruster, weight_error=numbers["weight_error"])
        dive = profiling(found, thruster, speed=numbers["speed"])
        said = [*warned, *drive_sentences(found), *versus_sentences(hover, dive, found)]
        rests = assumptions(found, thruster)
        answer = {
            **energy_json(found, hover, dive),
            "thruster": thruster._asdict(),
            "sentences": said,
            "assumptions": rests,
        }
        files = write_energy(found, hover, dive, out, answer=json_text(answer))
    if json:
        emit_json({**answer, "files": [str(path) for path in files]})
        return
    _print(found, said, rests)
    for path in files:
        output.print(f"wrote {path}", soft_wrap=True)


def _check_used(power_at: str, shortest: str) -> None:
    """Raise InputError for an option of --fit that nothing reads without it."""
    from swimbladder.errors import InputError

    for option, given in (("--power-at", power_at != "mean"), ("--shortest", shortest != "0 s")):
        if given:
            raise InputError(
                "there is no file that this is about", field=option,
                remedy="Give --fit RUNS.csv too",
            )  # fmt: skip


def _water(v: Vehicle, casts: list[Cast], wanted: float | None) -> tuple[Column, list[str]]:
    """Return the water down to the wanted depth, the rating or the cast's end, and any doubt.

    Raises InputError where a cast ends so far above the rating that its unit may be wrong.
    """
    from swimbladder.physics.seawater import cast_column, uniform_column

    rating = v.hull.depth_limit
    deepest = wanted if wanted is not None else rating
    if not casts:
        deepest = _DEEP if deepest is None else deepest
        return uniform_column(v.water, deepest, step=min(1.0, abs(deepest) / 100.0)), []
    refuse_doubted_unit(casts[:1], wanted, rating)
    whole = cast_column(casts[0], None)
    if wanted is None and (deepest is None or whole.deepest <= deepest):
        return whole, above_rating(casts[0].name, whole.deepest, deepest, "--depth")
    assert deepest is not None
    return cast_column(casts[0], deepest), []


def _print(found: DriveEnergy, said: list[str], rests: tuple[str, ...]) -> None:
    import numpy as np
    from rich.table import Table

    v, m = found.vehicle, found.map
    output.print(f"{v.name}, {v.actuator.kind}", soft_wrap=True)
    output.print("")
    for sentence in said:
        output.print(sentence, soft_wrap=True)
    output.print("")
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    stages = [_SHORT[name] for name in found.stages]
    names = ["depth", "out", "power", "energy", "whole", *stages, "in", "hold"]
    units = ["m", "mL/s", "W", "J/mL", "%", *["%" for _ in found.stages], "mL/s", "W"]
    for name, unit in zip(names, units, strict=True):
        table.add_column(f"{name}\n{unit}", justify="right")
    last = found.column.depth.size - 1
    for i in np.unique(np.linspace(0, last, min(_LINES, last + 1)).round().astype(int)):
        values: list[Any] = [
            found.column.depth[i], m.rate_out[i] * 1e6, m.power_out[i], found.per_volume[i] * 1e-6,
            found.efficiency[i] * 100.0, *(stage[i] * 100.0 for stage in found.stages.values()),
            m.rate_in[i] * 1e6, m.holding_power[i],
        ]  # fmt: skip
        table.add_row(*(f"{x:.3g}" if np.isfinite(x) and abs(x) < 999.5 else
                        f"{x:.0f}" if np.isfinite(x) else "-" for x in values))  # fmt: skip
    output.print(table)
    output.print("")
    for sentence in rests:
        output.print(f"assumed: {sentence}", soft_wrap=True)
