"""A planned step as files: a log of it, its depths as a mission, its numbers and a picture."""

from collections.abc import Mapping
from typing import Any

from swimbladder.design.planning import Plan
from swimbladder.show.plots.plan import draw_plan


def plan_files(found: Plan, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of plan.csv, mission.toml, plan.json (the answer) and plan.png."""
    return {
        "plan.csv": found.columns(),
        "mission.toml": _mission(found),
        "plan.json": answer,
        "plan.png": draw_plan(found),
    }


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
