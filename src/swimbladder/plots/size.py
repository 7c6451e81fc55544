"""What a sized drive was chosen from: mass against energy, each part's best, each wish's price."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swimbladder.plots.style import BLACK, BLUE, GREY, ORANGE, VERMILION, label_panels, styled
from swimbladder.sizing import Sizing
from swimbladder.sizing.candidates import PARTS
from swimbladder.sizing.run import Sweep

__all__ = ["draw_candidates", "draw_parts", "draw_wishes"]

_WISHES = {
    "depth": ("depth [m]", 1.0),
    "turn_time": ("turn time at depth [min]", 60.0),
    "speed": ("speed down and up [m/s]", 1.0),
    "trim": ("trim not known, 1 sigma [cm3]", 1e-6),
    "cycles": ("cycles", 1.0),
}


@styled
def draw_candidates(found: Sizing) -> Figure:
    """Return mass of drive and battery against energy per cycle of every drive that does it."""
    w = found.weighed
    figure = Figure(figsize=(7.0, 4.6))
    axes = figure.add_subplot()
    screw = np.array([c.pump is None for c in found.batch.of])
    for mask, color, marker, label in (
        (w.feasible & ~screw, BLUE, "o", "pump"),
        (w.feasible & screw, ORANGE, "^", "screw"),
    ):
        if np.any(mask):
            axes.scatter(
                w.mass[mask], w.cycle_energy[mask] * 1e-3, s=9, color=color, marker=marker,
                alpha=0.5, linewidths=0, label=f"{label}, {np.count_nonzero(mask):,} drives",
            )  # fmt: skip
    front = found.pareto
    axes.plot(
        w.mass[front],
        w.cycle_energy[front] * 1e-3,
        color=BLACK,
        marker=".",
        label="best compromises",
    )
    axes.plot(
        w.mass[found.best], w.cycle_energy[found.best] * 1e-3, "*", color=VERMILION, ms=15,
        label="chosen",
    )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(f"drive and battery for {found.asked.dive.cycles} cycles [kg]")
    axes.set_ylabel("energy of the drive per cycle [kJ]")
    axes.set_title(f"{found.body.name} to {found.asked.dive.depth:g} m", loc="left")
    _plain_ticks(axes)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _plain_ticks(axes: Axes) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        plain = ScalarFormatter()
        plain.set_scientific(False)
        axis.set_major_formatter(plain)
        axis.set_minor_formatter(NullFormatter())


@styled
def draw_parts(found: Sizing) -> Figure:
    """Return the best mass with each part in the drive, all others free, and why there is none."""
    w = found.weighed
    kinds = [k for k in PARTS if any(c.what == k for c in found.choices)]
    rows = [c for kind in kinds for c in found.choices if c.what == kind]
    figure = Figure(figsize=(8.0, 0.24 * len(rows) + 1.2))
    axes = figure.add_subplot()
    chosen = found.chosen.choices
    labels, lightest = [], float(w.mass[found.best])
    for place, choice in enumerate(rows):
        labels.append(_label(choice.what, choice.name))
        if choice.index < 0:
            lacking = f"none does: {100.0 * choice.margin:.0f} % of the {choice.missing} needed"
            axes.text(
                0.02 * lightest, place, lacking,
                va="center", fontsize=8.0, color=GREY,
            )  # fmt: skip
            continue
        took = chosen.get(choice.what) == choice.name
        mass, battery = float(w.mass[choice.index]), float(w.battery_mass[choice.index])
        color = VERMILION if took else BLUE
        axes.barh(place, mass - battery, color=color, height=0.7)
        axes.barh(place, battery, left=mass - battery, color=color, alpha=0.45, height=0.7)
    axes.set_yticks(range(len(rows)), labels, fontsize=8.0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)
    axes.set_xlim(0.0, 5.0 * lightest)
    axes.set_xlabel("least mass with that part: drive (full colour) and battery (pale) [kg]")
    axes.set_title(
        f"{found.body.name} to {found.asked.dive.depth:g} m: each part, the others free "
        "(red: chosen)",
        loc="left",
    )
    return figure


def _label(what: str, name: str) -> str:
    return name if what in name or what in ("kind", "pump", "battery") else f"{what} {name}"


@styled
def draw_wishes(found: Sizing) -> Figure:
    """Return what each wish costs: the least mass and its stroke as depth, time, ... change."""
    sweeps = [sweep for sweep in found.sweeps if len(sweep.values) > 1]
    figure = Figure(figsize=(10.5, 2.9 * math.ceil(max(len(sweeps), 1) / 3)))
    panels = figure.subplots(max(math.ceil(len(sweeps) / 3), 1), 3, squeeze=False)
    for axes, sweep in zip(panels.flat, sweeps, strict=False):
        _wish(axes, sweep, getattr(found.asked.dive, sweep.what))
    for axes in list(panels.flat)[len(sweeps) :]:
        axes.set_visible(False)
    label_panels(list(panels.flat)[: len(sweeps)])
    return figure


def _wish(axes: Axes, sweep: Sweep, asked: float) -> None:
    name, unit = _WISHES[sweep.what]
    x = np.array(sweep.values) / unit
    axes.plot(x, sweep.mass, color=BLUE, marker="o", label="mass [kg]")
    axes.set_xlabel(name)
    axes.set_ylabel("drive and battery [kg]", color=BLUE)
    axes.set_ylim(bottom=0.0)
    other = axes.twinx()
    other.spines["right"].set_visible(True)
    other.plot(x, np.array(sweep.stroke) * 1e6, color=ORANGE, marker="^", ls="--")
    other.set_ylabel("stroke [cm3]", color=ORANGE)
    other.set_ylim(bottom=0.0)
    other.grid(visible=False)
    axes.axvline(asked / unit, color=GREY, lw=0.8, ls=":")
    for place in x[~np.isfinite(np.array(sweep.mass))]:
        axes.text(place, 0.0, "none", color=VERMILION, ha="center", va="bottom", fontsize=8.0)
