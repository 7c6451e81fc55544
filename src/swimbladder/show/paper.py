"""Figures 12 to 14, 16 and 17 of the paper, drawn from simulations; no curve was measured."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from swimbladder.show.picture import Ink, Panel, Picture, grid_of, stacked
from swimbladder.sim.closed_loop import Solution
from swimbladder.sim.pool import Experiment, Fit, PoolRun, response

_SIZES = (Ink.BLUE, Ink.GREEN, Ink.ORANGE, Ink.PURPLE)  # one for each change of volume
_MARKS = ("o", "s", "^", "D")


def draw_procedure(run: PoolRun) -> Picture:
    """Return Fig. 12: depth and volume against time through steps (a) to (d) of one run."""
    s = run.solution
    starts: dict[str, float] = {}
    for time, step, _ in run.phases:
        starts.setdefault(step or "end", time)
    end = starts["end"]
    shown = s.time <= end + 5.0
    picture, panels = stacked((7.5, 4.6), 3.0, 2.0)
    top, bottom = panels
    seen, label = run.seen_depth[shown], "depth sensor, simulated"
    top.dots(s.time[shown], seen, ".", Ink.ORANGE, label, size=1.5)
    top.line(s.time[shown], s.depth[shown], label="depth, simulated", width=1.2)
    top.rule("y", 0.0, width=0.9)
    bottom.line(s.time[shown], s.volume[shown] * 1e6, width=0.8)
    top.y, bottom.y, bottom.x = "depth [m]", "volume [cm³]", "time [s]"
    times = [*(starts[step] for step in "abcd"), end]
    for panel in panels:
        for time in times[1:-1]:
            panel.rule("x", time, Ink.BLACK, dash=":", width=0.9)
    for step, first, last in zip("abcd", times, times[1:], strict=False):
        how: Any = {"across": "center", "share": "y", "shift": (0.0, 3.0), "size": 10.0}
        top.text(0.5 * (first + last), 1.0, f"({step})", **how)
    top.legend = "center left"
    return picture


def draw_speeds(experiments: Sequence[Experiment], fit: Fit) -> Picture:
    """Return Fig. 13: speed from the noisy depths, and as eq. (26) has it with one K2 and T2."""
    picture, panels = _rising_and_sinking("speed, positive down [m/s]")
    for e in experiments:
        r = e.record
        speed = np.gradient(r.depth, float(r.time[1] - r.time[0]))
        model = response(r.time, r.volume, K2=fit.K2, T2=fit.T2)[1]
        _draw_one(e, experiments, panels, speed, model)
    return picture


def draw_depths(experiments: Sequence[Experiment], fit: Fit) -> Picture:
    """Return Fig. 14: depth as the sensor said, and as eq. (27) has it with one K2 and T2."""
    picture, panels = _rising_and_sinking("depth [m]")
    panels[1].deep = True
    for e in experiments:
        r = e.record
        model = r.start + response(r.time, r.volume, K2=fit.K2, T2=fit.T2)[0]
        _draw_one(e, experiments, panels, r.depth, model)
    return picture


def _draw_one(
    e: Experiment, every: Sequence[Experiment], panels: Sequence[Panel], seen: Any, model: Any
) -> None:
    """Draw an experiment, rising left or sinking right, in the color and mark of its size."""
    number = sorted({abs(one.dV) for one in every}).index(abs(e.dV))
    panel, color = panels[0 if e.step == "b" else 1], _SIZES[number % len(_SIZES)]
    mark = _MARKS[number % len(_MARKS)]
    panel.dots(e.record.time, seen, mark, color, size=1.8, alpha=0.55)
    panel.line(e.record.time, model, color, f"{e.dV * 1e6:+.3g} cm³".replace("-", "\u2212"))


def _rising_and_sinking(label: str) -> tuple[Picture, list[Panel]]:
    picture, panels = grid_of((7.5, 3.9), 2, 2)
    for panel, step in zip(panels, ("step (b), rising", "step (d), sinking"), strict=True):
        panel.x, panel.title = "time since the change of volume [s]", step
        panel.legend = "best"
    panels[0].y = label
    return picture, panels


_Sized = Sequence[tuple[float, Fit]]  # by the change of volume [m3]


def draw_neglect(
    experiments: Sequence[Experiment], fits: Sequence[Fit], still: _Sized, truth: Fit
) -> Picture:
    """Return K2 and T2 against the size of the volume change, as found where psi is left out.

    fits: of the experiments, with noise; still: without.
    """
    picture, panels = grid_of((7.5, 3.4), 2, 2, legend="above", across=2)
    noisy: dict[str, _Sized] = {
        step: [(e.dV, f) for e, f in zip(experiments, fits, strict=True) if e.step == step]
        for step in "bd"
    }
    for panel, name, label in zip(panels, ("K2", "T2"), ("K₂ [1/(m² s)]", "T₂ [s]"), strict=True):
        for points, dash, mark, color, of in (
            (still, "-", "", Ink.BLACK, "no noise, exactly neutral start"),
            (noisy["b"], "", "^", Ink.BLUE, "step (b), with noise"),
            (noisy["d"], "", "v", Ink.VERMILION, "step (d), with noise"),
        ):
            values = [getattr(fit, name) for _, fit in points]
            sizes = [1e6 * abs(dV) for dV, _ in points]
            panel.line(sizes, values, color, of, dash=dash, marker=mark)
        label_true = "of the simulated vehicle"
        panel.rule("y", getattr(truth, name), Ink.GREY, label_true, dash="--", width=1.5)
        panel.x, panel.y, panel.ylim = "size of the change of volume [cm³]", label, (0.0, None)
    return picture


def draw_steps(s: Solution) -> Picture:
    """Return Fig. 16: depth steps of different size and direction, with volume and voltage."""
    picture, (top, middle, bottom) = stacked((7.5, 5.6), 5.0, 3.0, 2.0)
    minutes = s.time / 60.0
    top.setpoint(minutes, s.reference)
    top.line(minutes, s.depth, label="depth, simulated")
    middle.line(minutes, s.volume * 1e6, width=1.1)
    bottom.steps(minutes, s.voltage, Ink.GREEN, width=0.8)
    top.y, middle.y, bottom.y = "depth [m]", "volume [cm³]", "voltage [V]"
    bottom.x, bottom.xlim = "time [min]", (0.0, float(minutes[-1]))
    return picture


def draw_long_step(s: Solution) -> Picture:
    """Return Fig. 17: (a) a longer step, (b) the same around the target."""
    target, start = float(s.reference[-1]), float(s.depth[0])
    half = 0.02 * abs(target - start)
    picture, panels = grid_of((7.5, 3.6), 2, 2, letters=True)
    for panel in panels:
        panel.setpoint(s.time, s.reference)
        panel.line(s.time, s.depth, label="depth, simulated")
        panel.x, panel.xlim, panel.deep = "time [s]", (0.0, float(s.time[-1])), True
    panels[0].y, panels[0].legend = "depth [m]", ""
    panels[1].span("y", target - half, target + half, Ink.GREEN, "± 2 %", alpha=0.15)
    panels[1].ylim, panels[1].legend = (target - 3.0 * half, target + 3.0 * half), "lower right"
    return picture
