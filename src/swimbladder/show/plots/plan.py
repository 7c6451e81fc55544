"""A planned motion as a picture: depth, volume and command, with their limits."""

from __future__ import annotations

import math

from matplotlib.figure import Figure

from swimbladder.design.planning import Plan
from swimbladder.show.plots.style import (
    BLACK,
    BLUE,
    GREY,
    VERMILION,
    depth_axis,
    label_panels,
    styled,
)


@styled
def draw_plan(plan: Plan) -> Figure:
    """Return depth, volume and command of a plan against time."""
    task = plan.task
    figure = Figure(figsize=(7.5, 7.5))
    depth, volume, command = figure.subplots(3, 1, sharex=True)
    depth.plot(plan.time, plan.depth, color=BLUE, label="planned")
    depth.axhspan(
        task.target - task.band, task.target + task.band, color=GREY, alpha=0.25, lw=0.0,
        label=f"target \u00b1 {1e3 * task.band:.3g} mm",
    )  # fmt: skip
    depth.axvline(
        plan.arrival, color=BLACK, lw=0.8, ls="--", label=f"arrived, {plan.arrival:.4g} s"
    )
    depth_axis(depth)
    depth.legend(loc="best")
    volume.plot(plan.time, 1e6 * plan.volume, color=BLUE)
    volume.set_ylabel("volume [cm\u00b3]")
    if task.plant.positioner:
        rate = [1e6 * x / task.sample_time for x in plan.command - plan.volume]
        command.step(plan.time, rate, where="post", color=BLUE)
        command.set_ylabel("volume rate [cm\u00b3/s]")
        limit = 1e6 * task.command[1]
    else:
        command.step(plan.time, plan.command, where="post", color=BLUE)
        command.set_ylabel("voltage [V]")
        limit = task.command[1]
    for axes, ends, factor in ((volume, task.volume, 1e6), (command, (-limit, limit), 1.0)):
        low, high = axes.get_ylim()
        room = 0.5 * (high - low)
        for side in ends:
            if math.isfinite(side) and low - room <= factor * side <= high + room:
                axes.axhline(factor * side, color=VERMILION, lw=0.8, ls=":", label="limit")
        handles, labels = axes.get_legend_handles_labels()
        if handles:
            axes.legend(handles[:1], labels[:1], loc="lower right", bbox_to_anchor=(1.0, 0.98))
    command.set_xlabel("time [s]")
    depth.set_title(f"{task.vehicle.name}, least {plan.goal}", fontsize=10.0)
    label_panels([depth, volume, command])
    return figure
