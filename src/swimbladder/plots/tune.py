"""A tuning as a picture: the step of its trials, nominal and over the region."""

from __future__ import annotations

from matplotlib.figure import Figure

from swimbladder.plots.style import BLACK, BLUE, GREY, SKY, VERMILION, label_panels, styled
from swimbladder.tune import Tuning

__all__ = ["draw_tuning"]

_LONG = 4.0  # times the median settling, that is shown


@styled
def draw_tuning(tuning: Tuning) -> Figure:
    """Return depth, volume and voltage of the trials against time."""
    figure = Figure(figsize=(7.5, 7.5))
    depth, volume, voltage = figure.subplots(3, 1, sharex=True)
    step = tuning.step
    settle = tuning.nominal.settle_median
    end = min(step.duration, _LONG * settle) if settle > 0.0 else step.duration
    for traces, colour, width, alpha, label in (
        (tuning.shown[1], SKY, 0.7, 0.6, "over the region, supply low"),
        (tuning.shown[0], BLUE, 1.8, 1.0, "as it is"),
    ):
        kept = traces.time <= end
        for axes, values in (
            (depth, traces.depth), (volume, 1e6 * traces.volume), (voltage, traces.command),
        ):  # fmt: skip
            lines = axes.plot(traces.time[kept], values[kept], color=colour, lw=width, alpha=alpha)
            lines[0].set_label(label)
    band = 0.02 * abs(step.target - step.start)
    depth.axhspan(step.target - band, step.target + band, color=GREY, alpha=0.25, lw=0.0)
    depth.axhline(step.target, color=BLACK, lw=0.8, ls="--", label="set-point, 2 % band")
    limit = tuning.vehicle.supply
    if limit is not None:
        for side in (-1.0, 1.0):
            voltage.axhline(
                side * limit.voltage, color=VERMILION, lw=0.8, ls=":",
                label="supply" if side > 0.0 else None,
            )  # fmt: skip
    depth.invert_yaxis()
    depth.set_ylabel("depth [m]")
    volume.set_ylabel("volume [cm³]")
    voltage.set_ylabel("voltage [V]")
    voltage.set_xlabel("time since the set-point changed [s]")
    depth.legend(loc="best")
    voltage.legend(handles=voltage.get_legend_handles_labels()[0][-1:], loc="lower right")
    depth.set_title(
        f"{tuning.vehicle.name}, {tuning.law.name} tuned for {tuning.goal}", fontsize=10.0
    )
    label_panels([depth, volume, voltage])
    return figure
