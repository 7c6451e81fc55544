"""``swimbladder tune``: gains for a vehicle, with margins over its 95 % parameter region."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from swimbladder.cli.casts import CastFile, CastReading, DepthSensor, water_of_cast
from swimbladder.cli.common import compile_notice, labelled, progress, table
from swimbladder.cli.options import Files, Options, VehicleName, WithoutSupervisor, grouped, valued
from swimbladder.cli.texts import Given
from swimbladder.control.records import leaves

if TYPE_CHECKING:
    from swimbladder.design.tuning import Tuning


@dataclass(frozen=True)
class Design(Options):
    """What gains are sought."""

    law: Given = valued("LAW", "Law (chosen; pump and valve: rate); a wrong name lists all.")
    goal: str = valued("GOAL", "fast (settling time), quiet (actuator motion) or energy.", "fast")
    depths: str = valued("LEAST:MOST", "Depth range of the design.", "0:10 m", name="--depth")
    step: Given = valued("FROM:TO", "Step of the simulations (1.5 m; float: all depths).")
    sample_time: Given = valued("TIME", "Sample time (the controller's).")
    delay: str = valued("SHARE", "Computation delay, as a share of the sample time.", "10 %")
    supply: Given = valued("VOLTAGE", "Lowest supply (0.9 of the vehicle's).")
    hold: Given = valued(
        "DEPTH", "Allowed holding error, rms (quiet 9.5 mm, energy 5 cm; float: its band)."
    )
    runs: int = valued("N", "Simulations per case.", 200)


@grouped("law goal depth step depth_noise", out=Path("swimbladder-tune"))
def tune(
    vehicle: VehicleName,
    *,
    design: Design,
    sensor: DepthSensor,
    cast: CastFile = None,
    reading: CastReading,
    without_supervisor: WithoutSupervisor = False,
    to: Files,
) -> None:
    r"""Find gains of a law that meet the stability margins over the 95 % parameter region.

    The region follows from the covariance that `identify` writes, or is 5 % in K2 and T2 without
    one. Trials with sensor noise verify the gains; vehicle.toml holds the controller. Exit code 1:
    no gains meet the margins, or keep overshoot and settling time over the region; the message
    names what limits them, and the best gains stand in unproven.toml. With
    --cast the trials are in that water.
    """
    from swimbladder.io.config import load_vehicle

    v = sensor.on(load_vehicle(vehicle))
    options = design.read()
    reach = max(*options["depths"], *(options["step"] or ()))
    options["column"] = water_of_cast(reading.casts(cast), reach, v.hull.depth_limit)
    to.check()
    with progress("loading the simulator"):
        from swimbladder.design.tuning import tune as find
    with compile_notice(), progress("searching gains", 1.0) as advance:
        found = find(v, **options, supervised=not without_supervisor, advance=advance)
    why = [found.verdict]
    to.answer(found, _shown(found), good=found.proven, why=why)


def _shown(found: Tuning) -> Iterator[object]:
    """Give what is printed, the answer first."""
    from swimbladder.units import shown_unit, unit_factor

    every = f"sampled every {found.sample_time:g} s"
    yield f"{found.result_vehicle.name}, law {found.law.name}, goal {found.goal}, {every}"
    yield from found.sentences
    units = {name: (unit, shown_unit(unit)) for name, unit in found.law.units.items()}
    rows = [
        (name, f"{float(value) * unit_factor(*units[name]):.5g}", units[name][1])
        for name, value in leaves(found.parameters).items()
    ]
    yield table(("parameter", "value", "unit"), rows, left=("parameter", "unit"))
    yield from labelled("assumed", found.assumptions)
