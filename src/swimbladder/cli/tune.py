"""``swimbladder tune``: gains for a vehicle, with margins over its 95 % parameter region."""

from pathlib import Path

from swimbladder.cli.casts import CastReading, DepthSensor, water_of_cast
from swimbladder.cli.common import working
from swimbladder.cli.options import (
    Files,
    Options,
    Supervised,
    VehicleName,
    grouped,
    loaded,
    valued,
)
from swimbladder.cli.texts import Given


class Design(Options):
    """What gains are sought."""

    law: Given = valued("LAW", "Law (chosen; pump and valve: rate); a wrong name lists all.")
    goal: str = valued(
        "GOAL", "Goal: fast (settling time), quiet (actuator motion) or energy.", "fast"
    )
    depth_range: str = valued("LEAST:MOST", "Depth range of the design.", "0:10 m")
    step: Given = valued("FROM:TO", "Step of the simulations (1.5 m; float: all depths).")
    sample_time: Given = valued("TIME", "Sample time (the controller's).")
    delay: str = valued("SHARE", "Computation delay, as a share of the sample time.", "10 %")
    supply: Given = valued("VOLTAGE", "Supply voltage, the lowest (0.9 of the vehicle's).")
    hold: Given = valued(
        "DEPTH", "Allowed holding error, rms (quiet 9.5 mm, energy 5 cm; float: its band)."
    )
    runs: int = valued("N", "Runs of each case.", 200)


@grouped("law goal depth_range step depth_noise", out=Path("swimbladder-tune"))
def tune(
    vehicle: VehicleName,
    *,
    design: Design,
    sensor: DepthSensor,
    reading: CastReading,
    supervised: Supervised = True,
    to: Files,
) -> None:
    r"""Find gains of a law that meet the stability margins over the 95 % parameter region.

    The region follows from the covariance that `identify` writes, or is 5 % in K2 and T2 without
    one. Trials with sensor noise verify the gains; vehicle.toml holds the controller. Exit code 1:
    no gains meet the margins, or keep overshoot and settling time over the region; the message
    names what limits them, and the best gains stand in unproven.toml. With
    --cast the trials are in that water.
    """
    v = sensor.on(loaded(vehicle))
    options = design.read()
    reach = max(*options["depth_range"], *(options["step"] or ()))
    options["cast"] = water_of_cast(reading.casts(), reach, v.hull.depth_limit)
    with working("searching gains") as advance:
        from swimbladder.design.tuning import tune as find

        found = find(v, **options, supervised=supervised, advance=advance)
    to.answer(found)
