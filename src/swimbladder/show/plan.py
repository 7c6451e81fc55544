"""A planned motion as it is shown: depth, volume and command, with their limits."""

import math
from collections.abc import Iterator
from functools import partial

from matplotlib.figure import Figure

from swimbladder.design.planning import Plan
from swimbladder.show import style
from swimbladder.show.parts import (
    Drawn,
    Part,
    Shown,
)
from swimbladder.show.style import Ink


@style.styled
def draw_plan(plan: Plan) -> Figure:
    """Return depth, volume and command of a plan against time."""
    task = plan.task
    figure, (depth, volume, command) = style.stacked((7.5, 7.5), 1.0, 1.0, 1.0)
    depth.plot(plan.time, plan.depth, color=Ink.BLUE, label="planned")
    style.band(depth, task.target, task.band, label=f"target \u00b1 {1e3 * task.band:.3g} mm")
    label = f"arrived, {plan.arrival:.4g} s"
    depth.axvline(plan.arrival, color=Ink.BLACK, lw=0.8, ls="--", label=label)
    style.depth_axis(depth)
    depth.legend(loc="best")
    volume.plot(plan.time, 1e6 * plan.volume, color=Ink.BLUE)
    volume.set_ylabel("volume [cm\u00b3]")
    asked, name, limit = plan.command, "voltage [V]", task.command[1]
    if task.plant.positioner:
        asked = 1e6 * (plan.command - plan.volume) / task.sample_time
        name, limit = "volume rate [cm\u00b3/s]", 1e6 * limit
    command.step(plan.time, asked, where="post", color=Ink.BLUE)
    command.set(ylabel=name, xlabel="time [s]")
    for axes, ends, factor in ((volume, task.volume, 1e6), (command, (-limit, limit), 1.0)):
        low, high = axes.get_ylim()
        room = 0.5 * (high - low)
        for side in ends:
            if math.isfinite(side) and low - room <= factor * side <= high + room:
                axes.axhline(factor * side, color=Ink.VERMILION, lw=0.8, ls=":", label="limit")
        if axes.get_legend_handles_labels()[0]:
            style.legend_above(axes)
    depth.set_title(f"{task.vehicle.name}, least {plan.goal}", fontsize=10.0)
    style.label_panels([depth, volume, command])
    return figure


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
