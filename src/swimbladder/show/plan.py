"""A planned motion as it is shown: depth, volume and command, with their limits."""

import math
from collections.abc import Iterator
from functools import partial

from swimbladder.design.planning import Plan
from swimbladder.show.parts import Drawn, Part, Shown
from swimbladder.show.picture import Ink, Picture, stacked


def draw_plan(plan: Plan) -> Picture:
    """Return depth, volume and command of a plan against time."""
    task = plan.task
    picture, (depth, volume, command) = stacked((7.5, 7.5), 1.0, 1.0, 1.0, letters=True)
    depth.line(plan.time, plan.depth, label="planned")
    label = f"target \u00b1 {1e3 * task.band:.3g} mm"
    depth.span("y", task.target - task.band, task.target + task.band, Ink.GREY, label)
    depth.rule("x", plan.arrival, Ink.BLACK, f"arrived, {plan.arrival:.4g} s", dash="--")
    volume.line(plan.time, 1e6 * plan.volume)
    asked, name, limit = plan.command, "voltage [V]", task.command[1]
    if task.plant.positioner:
        asked = 1e6 * (plan.command - plan.volume) / task.sample_time
        name, limit = "volume rate [cm\u00b3/s]", 1e6 * limit
    command.steps(plan.time, asked)
    depth.y, volume.y, command.y, command.x = "depth [m]", "volume [cm\u00b3]", name, "time [s]"
    for panel, ends, factor in ((volume, task.volume, 1e6), (command, (-limit, limit), 1.0)):
        low, high = panel.limits("y")
        room = 0.5 * (high - low)
        for side in ends:
            if math.isfinite(side) and low - room <= factor * side <= high + room:
                panel.rule("y", factor * side, Ink.VERMILION, "limit", dash=":")
    picture.title = f"{task.vehicle.name}, least {plan.goal}"
    return picture


class PlanShown(Shown[Plan]):
    """A log of the plan, its depths as a mission, its numbers and a picture."""

    name = "plan"

    def parts(self) -> Iterator[Part]:
        """Give the sentences."""
        yield f"{self.found.task.vehicle.name}, goal {self.found.goal}"
        yield from self.found.sentences
        yield Drawn("plan", partial(draw_plan, self.found))

    @property
    def good(self) -> bool:
        """A plan that there is does what it has to."""
        return True

    def files(self) -> dict[str, object]:
        """Return plan.csv, and mission.toml: each depth holds until the next sample."""
        found, task = self.found, self.found.task
        h, name = task.sample_time, task.vehicle.name
        lines = [
            f"# Planned by swimbladder plan for {name}, goal {found.goal}: set-points.",
            "schema_version = 1",
            f'name = "planned, {task.start:g} to {task.target:g} m"',
            f"start_depth = {task.start!r}",
            f"duration = {float(found.time[-1]) + h!r}",
        ]
        if task.plant.z_bottom < float("inf"):
            lines.append(f"bottom_depth = {task.plant.z_bottom!r}")
        for time, depth in zip(found.time[:-1].tolist(), found.depth[1:].tolist(), strict=True):
            lines += ["", "[[setpoints]]", f"time = {time!r}", f"depth = {depth!r}"]
        return {"plan.csv": found.columns(), "mission.toml": "\n".join(lines) + "\n"}
