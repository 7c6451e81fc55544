"""Figures 12 to 14, 16 and 17 of the paper, drawn from simulations; no curve was measured."""

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swimbladder.show import style
from swimbladder.show.style import Ink
from swimbladder.sim.closed_loop import Solution
from swimbladder.sim.pool import Experiment, Fit, PoolRun, centred_differences, response

_SIZES = (Ink.BLUE, Ink.GREEN, Ink.ORANGE, Ink.PURPLE)  # one for each change of volume
_MARKS = ("o", "s", "^", "D")


@style.styled
def draw_procedure(run: PoolRun) -> Figure:
    """Return Fig. 12: depth and volume against time through steps (a) to (d) of one run."""
    s = run.solution
    starts: dict[str, float] = {}
    for time, step, _ in run.phases:
        starts.setdefault(step or "end", time)
    end = starts["end"]
    shown = s.time <= end + 5.0
    figure, (top, bottom) = style.stacked((7.5, 4.6), 3.0, 2.0)
    seen, label = run.seen_depth[shown], "depth sensor, simulated"
    top.plot(s.time[shown], seen, ".", ms=1.5, color=Ink.ORANGE, label=label)
    top.plot(s.time[shown], s.depth[shown], color=Ink.BLUE, lw=1.2, label="depth, simulated")
    top.axhline(0.0, color=Ink.GREY, lw=0.9)
    style.depth_axis(top)
    bottom.plot(s.time[shown], s.volume[shown] * 1e6, color=Ink.BLUE, lw=0.8)
    bottom.set(ylabel="volume [cm³]", xlabel="time [s]")
    times = [*(starts[step] for step in "abcd"), end]
    for axes in (top, bottom):
        for time in times[1:-1]:
            axes.axvline(time, color=Ink.BLACK, ls=":", lw=0.9)
    how: Any = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
    how |= {"ha": "center", "fontweight": "bold", "annotation_clip": False}
    for step, first, last in zip("abcd", times, times[1:], strict=False):
        top.annotate(f"({step})", (0.5 * (first + last), 1.0), (0, 3), **how)
    top.legend(loc="upper left", bbox_to_anchor=(0.02, 0.62), markerscale=5.0)
    figure.align_ylabels([top, bottom])
    return figure


@style.styled
def draw_speeds(experiments: Sequence[Experiment], fit: Fit) -> Figure:
    """Return Fig. 13: speed from the noisy depths, and as eq. (26) has it with one K2 and T2."""
    figure, panels = _rising_and_sinking("speed, positive down [m/s]")
    for e in experiments:
        r = e.record
        speed = centred_differences(r.depth, float(r.time[1] - r.time[0]))
        model = response(r.time, r.volume, K2=fit.K2, T2=fit.T2)[1]
        _draw_one(e, experiments, panels, speed, model)
    return _with_key(figure, panels)


@style.styled
def draw_depths(experiments: Sequence[Experiment], fit: Fit) -> Figure:
    """Return Fig. 14: depth as the sensor said, and as eq. (27) has it with one K2 and T2."""
    figure, panels = _rising_and_sinking("depth [m]")
    for e in experiments:
        r = e.record
        model = r.start + response(r.time, r.volume, K2=fit.K2, T2=fit.T2)[0]
        _draw_one(e, experiments, panels, r.depth, model)
    for axes in panels:
        style.depth_axis(axes)
    panels[1].set_ylabel("")
    return _with_key(figure, panels)


def _draw_one(
    e: Experiment, every: Sequence[Experiment], panels: Sequence[Axes], seen: Any, model: Any
) -> None:
    """Draw an experiment, rising left or sinking right, in the color and mark of its size."""
    number = sorted({abs(one.dV) for one in every}).index(abs(e.dV))
    axes, color = panels[0 if e.step == "b" else 1], _SIZES[number % len(_SIZES)]
    mark = _MARKS[number % len(_MARKS)]
    axes.plot(e.record.time, seen, mark, ms=2.2, mew=0.0, alpha=0.55, color=color)
    label = f"{e.dV * 1e6:+.3g} cm³".replace("-", "\u2212")
    axes.plot(e.record.time, model, color=color, label=label)


def _rising_and_sinking(label: str) -> tuple[Figure, list[Axes]]:
    figure, panels = style.new_figure((7.5, 3.9), 1, 2)
    for axes in panels:
        axes.set_xlabel("time since the change of volume [s]")
    panels[0].set_ylabel(label)
    return figure, panels


def _with_key(figure: Figure, panels: list[Axes]) -> Figure:
    how: Any = {"ncols": 2, "title_fontproperties": {"weight": "bold", "size": 10}}
    for axes, step in zip(panels, ("step (b), rising", "step (d), sinking"), strict=True):
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), title=step, **how)
    return figure


_Sized = Sequence[tuple[float, Fit]]  # by the change of volume [m3]


@style.styled
def draw_neglect(
    experiments: Sequence[Experiment], fits: Sequence[Fit], still: _Sized, truth: Fit
) -> Figure:
    """Return K2 and T2 against the size of the volume change, as found where psi is left out.

    fits: of the experiments, with noise; still: without.
    """
    figure, panels = style.new_figure((7.5, 3.4), 1, 2)
    noisy: dict[str, _Sized] = {
        step: [(e.dV, f) for e, f in zip(experiments, fits, strict=True) if e.step == step]
        for step in "bd"
    }
    for axes, name, label in zip(panels, ("K2", "T2"), ("K₂ [1/(m² s)]", "T₂ [s]"), strict=True):
        for points, mark, color, of in (
            (still, "-", Ink.BLACK, "no noise, exactly neutral start"),
            (noisy["b"], "^", Ink.BLUE, "step (b), with noise"),
            (noisy["d"], "v", Ink.VERMILION, "step (d), with noise"),
        ):
            values = [getattr(fit, name) for _, fit in points]
            axes.plot([1e6 * abs(dV) for dV, _ in points], values, mark, color=color, label=of)
        true = getattr(truth, name)
        axes.axhline(true, color=Ink.GREY, ls="--", label="of the simulated vehicle")
        axes.set(xlabel="size of the change of volume [cm³]", ylabel=label)
        axes.set_ylim(bottom=0.0)
    style.legend_beside(figure, panels[:1], "outside upper center", ncols=2)
    return figure


@style.styled
def draw_steps(s: Solution) -> Figure:
    """Return Fig. 16: depth steps of different size and direction, with volume and voltage."""
    figure, panels = style.stacked((7.5, 5.6), 5.0, 3.0, 2.0)
    top, middle, bottom = panels
    minutes = s.time / 60.0
    style.setpoint(top, minutes, s.reference)
    top.plot(minutes, s.depth, color=Ink.BLUE, label="depth, simulated")
    style.depth_axis(top)
    style.legend_above(top)
    middle.plot(minutes, s.volume * 1e6, color=Ink.BLUE, lw=1.1)
    middle.set_ylabel("volume [cm³]")
    bottom.step(minutes, s.voltage, where="post", color=Ink.GREEN, lw=0.8)
    bottom.set(ylabel="voltage [V]", xlabel="time [min]", xlim=(0.0, float(minutes[-1])))
    figure.align_ylabels(panels)
    return figure


@style.styled
def draw_long_step(s: Solution) -> Figure:
    """Return Fig. 17: (a) a longer step, (b) the same around the target."""
    target, start = float(s.reference[-1]), float(s.depth[0])
    half = 0.02 * abs(target - start)
    figure, panels = style.new_figure((7.5, 3.6), 1, 2)
    for axes in panels:
        style.setpoint(axes, s.time, s.reference)
        axes.plot(s.time, s.depth, color=Ink.BLUE, label="depth, simulated")
        axes.set(xlabel="time [s]", xlim=(0.0, float(s.time[-1])))
    near = 3.0 * half
    style.band(panels[1], target, half, color=Ink.GREEN, alpha=0.15, label="± 2 %")
    panels[1].set_ylim(target - near, target + near)
    for axes in panels:
        style.depth_axis(axes)
    panels[1].set_ylabel("")
    panels[1].legend(loc="lower right")
    style.label_panels(panels)
    return figure
