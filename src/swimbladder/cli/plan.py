"""``swimbladder plan``: the best step of depth that the vehicle allows, computed beforehand."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from swimbladder.cli.common import aside, working
from swimbladder.cli.options import Files, Options, VehicleName, grouped, loaded, valued
from swimbladder.cli.texts import Given, depth_pair


class Asked(Options):
    """What is planned, as `design.planning.plan` has it."""

    goal: str = valued("GOAL", "Goal: least time, effort (volume moved) or energy.", "time")
    arrive: Given = valued("HOW", "Arrival: band (for good; goal time) or rest (exactly).")
    duration: Given = valued("TIME", "Duration, for effort and energy (twice the least).")
    supply: Given = valued("VOLTAGE", "Supply voltage (the vehicle's).")
    sample_time: Given = valued("TIME", "Sample time (the controller's).")
    band: str = valued("SHARE", "Band about the target, relative to the step.", "2 %")
    feedback_reserve: str = valued("SHARE", "Reserve of supply and stroke for feedback.", "0 %")
    max_speed: Given = valued("SPEED", "Largest vertical speed.")
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (none).")


@grouped("step goal arrive duration supply bottom_depth", out=Path("swimbladder-plan"))
def plan(
    vehicle: VehicleName,
    step: Annotated[str, typer.Option(metavar="FROM:TO", help="Step from rest to rest.")],
    *,
    asked: Asked,
    to: Files,
) -> None:
    r"""Plan an optimal depth step within voltage, stroke, speed and depth.

    plan.csv is a log of it, mission.toml its depths as set-points for `simulate`. Exit code 1 says
    that there is no plan, what is in the way, and how much more of it would do.
    """
    v = loaded(vehicle, sampled=True)
    way, options = depth_pair(step, "--step"), asked.given()
    with _told_how_to_go_on(), working("solving programs") as advance:
        from swimbladder.design.planning import plan as find

        found = find(v, way, advance=advance, **options)
    to.answer(found)


@contextlib.contextmanager
def _told_how_to_go_on() -> Iterator[None]:
    """Say on an interruption what there is, and what would take less long."""
    try:
        yield
    except KeyboardInterrupt:
        sooner = "It takes less long with a longer sample time (--sample-time)"
        aside(f"stopped: nothing is written, and the same command begins anew. {sooner}")
        raise
