"""``swimbladder plan``: the best step of depth that the vehicle allows, computed beforehand."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import compile_notice, console, json_text, output, progress
from swimbladder.cli.options import Files, Options, depth_pair, grouped

if TYPE_CHECKING:
    from swimbladder.design.planning import Plan


@dataclass(frozen=True)
class Asked(Options):
    """What is planned, as `design.planning.plan` has it."""

    goal: Annotated[
        str,
        typer.Option(metavar="GOAL", help="time, effort (volume moved) or energy: the least."),
    ] = "time"
    arrive: Annotated[
        str | None,
        typer.Option(metavar="HOW", help="band (for good, goal time's own) or rest (exactly)."),
    ] = None
    duration: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Until rest, for effort and energy (twice the least)."),
    ] = None
    supply: Annotated[
        str | None, typer.Option(metavar="VOLTAGE", help="The battery's (the vehicle's).")
    ] = None
    sample_time: Annotated[
        str | None, typer.Option(metavar="TIME", help="Between commands (the controller's).")
    ] = None
    band: Annotated[
        str, typer.Option(metavar="SHARE", help="Of the step, to either side of the target.")
    ] = "2 %"
    margin: Annotated[
        str, typer.Option(metavar="SHARE", help="Of supply and stroke, left for feedback.")
    ] = "0 %"
    speed_limit: Annotated[
        str | None, typer.Option(metavar="SPEED", help="Fastest that it may go.")
    ] = None
    bottom_depth: Annotated[
        str | None, typer.Option("--bottom", metavar="DEPTH", help="Depth of the bottom.")
    ] = None


@grouped(out=Path("swimbladder-plan"))
def plan(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    step: Annotated[str, typer.Option(metavar="FROM:TO", help="Depths, from rest to rest.")],
    *,
    asked: Asked,
    to: Files,
) -> None:
    r"""Plan a step of depth within voltage, stroke, speed and depths: the best there is.

    plan.csv is a log of it, mission.toml its depths as set-points for `simulate`. Exit code 1 says
    that there is no plan, what is in the way, and how much more of it would do.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place, publish, write_atomically
    from swimbladder.io.tables import write_csv

    v = load_vehicle(vehicle, sampled=True)
    start, target = depth_pair(step, "--step")
    options = asked.given()
    check_place(to.out)
    with progress("loading the solvers"):
        from swimbladder.design.planning import plan as find
        from swimbladder.show.plots.plan import draw_plan
        from swimbladder.show.plots.style import save
    with _told_how_to_go_on(), compile_notice(), progress("solving programs") as advance:
        found = find(v, start, target, advance=advance, **options)
    answer = found.to_json()
    names = ["plan.csv", "mission.toml", "plan.json", "plan.png"]

    def write(folder: Path) -> None:
        write_csv(folder / names[0], found.columns())
        write_atomically(folder / names[1], _mission(found))
        write_atomically(folder / names[2], json_text(answer) + "\n")
        save(draw_plan(found), folder / names[3])

    def show() -> None:
        output.print(f"{v.name}, goal {found.goal}", soft_wrap=True)
        output.print("")
        for sentence in found.sentences:
            output.print(sentence, soft_wrap=True)
        output.print("")

    publish(to.out, write)
    to.answer(answer, [to.out / name for name in names], show)


@contextlib.contextmanager
def _told_how_to_go_on() -> Iterator[None]:
    """Say on an interruption what there is, and what would take less long."""
    try:
        yield
    except KeyboardInterrupt:
        console.print(
            "stopped: nothing is written, and the same command begins anew. It takes less long "
            "with a longer sample time (--sample-time)",
            soft_wrap=True,
        )
        raise


def _mission(found: Plan) -> str:
    """Return the plan's depths as a mission: each holds until the next sample."""
    task, h = found.task, found.task.sample_time
    lines = [
        f"# Planned by swimbladder plan for {task.vehicle.name}, goal {found.goal}: set-points.",
        "schema_version = 1",
        f'name = "planned, {task.start:g} to {task.target:g} m"',
        f"start_depth = {task.start!r}",
        f"duration = {float(found.time[-1]) + h!r}",
    ]
    if task.plant.z_bottom < float("inf"):
        lines.append(f"bottom_depth = {task.plant.z_bottom!r}")
    for time, depth in zip(found.time[:-1].tolist(), found.depth[1:].tolist(), strict=True):
        lines += ["", "[[setpoints]]", f"time = {time!r}", f"depth = {depth!r}"]
    return "\n".join(lines) + "\n"
