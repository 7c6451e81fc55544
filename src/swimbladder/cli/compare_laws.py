"""``swimbladder compare-laws``: every law on the same scenarios, as a table and a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import CastReading, DepthSensor, water_of_cast
from swimbladder.cli.common import working
from swimbladder.cli.options import (
    AnyVehicle,
    Files,
    Options,
    Supervised,
    grouped,
    loaded,
    valued,
)
from swimbladder.cli.texts import Given
from swimbladder.errors import InputError
from swimbladder.show.parts import Table

if TYPE_CHECKING:
    from swimbladder.vehicle import Vehicle

_NOISE = "2 mm"  # where neither the vehicle file nor the user says what the sensor has


class Flights(Options):
    """Which laws are flown, how often and where."""

    laws: Given = valued(
        "LAW,...",
        "Laws to compare (all that fit).",
        read=lambda text, _: [name.strip() for name in text.split(",")],
    )
    runs: int = valued("N", "Runs of each case.", 40)
    depth_range: Given = valued("LEAST:MOST", "Depth range (what stroke, supply, rating allow).")
    sample_time: Given = valued("TIME", "Sample time (the controller's).")
    seed: int = valued("N", "Seed of noise, waves, drift and draws.", 1)


class Sensor(DepthSensor):
    """The depth sensor, which has some noise."""

    depth_noise: Given = valued("DEPTH", "Depth noise, 1 sigma (the vehicle's, else 2 mm).")

    def assumed(self, vehicle: Vehicle) -> tuple[Vehicle, str]:
        """Return the vehicle with it, and in words what was assumed of it, or nothing."""
        v, known = self.on(vehicle), vehicle.identified
        if self.depth_noise or v.sensors.depth_noise > 0.0 or v.sensors.depth_quantum > 0.0:
            return v, ""
        if known is not None and known.depth_noise > 0.0:
            return Sensor(depth_noise=f"{known.depth_noise} m").on(
                vehicle
            ), "depth noise as in the logs"
        words = f"a depth sensor with {_NOISE} of noise, as none is stated (--depth-noise)"
        return Sensor(depth_noise=_NOISE).on(vehicle), words


_LIST_SCENARIOS = typer.Option("--list-scenarios", help="Print the scenarios only.")


@grouped("laws runs depth_range depth_noise", out=Path("swimbladder-compare-laws"))
def compare_laws(
    vehicle: AnyVehicle = None,
    *,
    flights: Flights,
    sensor: Sensor,
    supervised: Supervised = True,
    list_scenarios: Annotated[bool, _LIST_SCENARIOS] = False,
    reading: CastReading,
    to: Files,
) -> None:
    r"""Compare all laws on the same scenarios: settling, holding and energy.

    Each law is tuned twice, fast and quiet; the vehicle file's own controller is flown as it is.
    With --cast all of it is flown in that water.

    What is done is kept in the folder's parts/, so that a stopped comparison goes on there.
    """
    if list_scenarios:
        _list(vehicle, flights.read()["depth_range"], to, supervised=supervised)
        return
    if vehicle is None:
        raise InputError("no vehicle", field="VEHICLE", remedy="Name a preset or a TOML file")
    v, assumed = sensor.assumed(loaded(vehicle, sampled=True, pumped=True))
    options = flights.read() | {"supervised": supervised}
    reach = None if options["depth_range"] is None else options["depth_range"][1]
    options["cast"] = water_of_cast(reading.casts(), reach, v.hull.depth_limit)
    parts = to.out / "parts"
    with working("tuning and flying", keep=parts) as advance:
        from swimbladder.design.law_comparison import compare_laws

        found = compare_laws(v, **options, parts=parts, advance=advance)
    if assumed:
        found = found.assuming(assumed)
    to.answer(found)


def _list(
    vehicle: str | None, depths: tuple[float, float] | None, to: Files, *, supervised: bool
) -> None:
    """Print the scenarios, with the depths that a vehicle gives them where one is named."""
    from swimbladder.design.law_comparison.contenders import SCENARIOS, place, places, scenarios_of

    v = None if vehicle is None else loaded(vehicle, sampled=True, pumped=True)
    flown = SCENARIOS if v is None else scenarios_of(v)
    shown: dict[str, dict[str, Any]] = {one.name: {"words": one.words} for one in flown}
    if v is not None:
        where = places(v, depths, supervised=supervised)
        for one in flown:
            p = place(one, v, where)
            shown[one.name] |= {"start_m": p.start, "target_m": p.target}
            shown[one.name]["duration_s"] = p.duration
    rows = []
    for name, told in shown.items():
        numbers = [f"{x:.5g}" for key, x in told.items() if key != "words"]
        rows.append((name, *numbers, told["words"]))
    numbers = ["from [m]", "to [m]", "for [s]"] if vehicle else []
    listed = Table(("scenario", *numbers, "what"), rows, left=("scenario", "what"))
    to.show({"scenarios": shown}, [listed])
