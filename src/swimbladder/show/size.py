"""What a sized drive was chosen from: mass against energy, each part's best."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swimbladder.design.sizing import Sizing, columns, sized_vehicle
from swimbladder.design.sizing.candidates import PARTS
from swimbladder.design.sizing.run import Choice, Sweep
from swimbladder.io.tables import rows_csv
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show import style
from swimbladder.show.parts import (
    Drawn,
    Part,
    Shown,
    labelled,
)
from swimbladder.show.style import Ink
from swimbladder.units import rounded
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]
_WIDEST = 5.0  # of the lightest: heavier bars are cut, and their mass written
_ABOVE = 1.08  # of the largest, so that its marker is whole; the stroke's lies below the mass's
_APART = 1.25
_SHOWN = 12.0  # times the lightest, and times the least energy: what is beyond is only counted

_REQUIREMENTS = {
    "max_depth": ("depth [m]", 1.0),
    "turn_time": ("turn time at depth [min]", 60.0),
    "speed": ("speed down and up [m/s]", 1.0),
    "trim_std": ("trim not known, 1 sigma [cm³]", 1e-6),
    "cycles": ("cycles", 1.0),
}


@style.styled
def draw_candidates(found: Sizing) -> Figure:
    """Return mass of drive and battery against energy per cycle of every drive that does it."""
    w, energy = found.evaluation, found.evaluation.cycle_energy * 1e-3
    figure, (axes,) = style.new_figure((7.0, 4.6))
    screw = np.array([c.kind == "electromechanical" for c in found.batch.of])
    for mask, color, marker, label in (
        (w.feasible & ~screw, Ink.BLUE, "o", "pump"),
        (w.feasible & screw, Ink.ORANGE, "^", "screw"),
    ):
        if np.any(mask):
            label = f"{label}, {np.count_nonzero(mask):,} drives"
            how: Any = {"color": color, "marker": marker, "label": label}
            axes.scatter(w.mass[mask], energy[mask], s=9, alpha=0.5, linewidths=0, **how)
    front = found.pareto
    axes.plot(w.mass[front], energy[front], ".-", color=Ink.BLACK, label="best compromises")
    best = found.best
    axes.plot(w.mass[best], energy[best], "*", color=Ink.VERMILION, ms=15, label="chosen")
    axes.set(xscale="log", yscale="log", ylabel="energy of the drive per cycle [kJ]")
    axes.set_xlabel(f"drive and battery for {found.asked.dive.cycles} cycles [kg]")
    axes.set_title(f"{found.body.name} to {found.asked.dive.max_depth:g} m", loc="left")
    beyond = _frame(axes, w.mass[w.feasible], energy[w.feasible])
    style.plain_log_ticks(axes, "x", "y")
    if beyond:
        axes.plot([], [], " ", label=f"{beyond:,} are beyond the edges")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _frame(axes: Axes, mass: Array, energy: Array) -> int:
    """Show what comes near the best in both, and return how many drives do not."""
    near = (mass <= _SHOWN * mass.min()) & (energy <= _SHOWN * energy.min())
    for set_limits, values in ((axes.set_xlim, mass[near]), (axes.set_ylim, energy[near])):
        set_limits(float(values.min()) / 1.15, 1.15 * float(values.max()))
    return int(np.count_nonzero(~near))


@style.styled
def draw_parts(found: Sizing) -> Figure:
    """Return the best mass with each part in the drive, all others free, and why there is none."""
    w = found.evaluation
    listed, kinds = [c for c in found.choices if c.what in PARTS], list(PARTS)
    rows = sorted(listed, key=lambda c: (kinds.index(c.what), _volts(c)))
    figure, (axes,) = style.new_figure((8.0, 0.24 * len(rows) + 1.2))
    chosen = found.chosen.choices
    labels, lightest = [], float(w.mass[found.best])
    for place, choice in enumerate(rows):
        labels.append(_label(choice.what, choice.name))
        if choice.index < 0:
            why = f"none does: {100.0 * choice.margin:.0f} % of the {choice.missing} needed"
            axes.text(0.02 * lightest, place, why, va="center", fontsize=8.0, color=Ink.GREY)
            continue
        took = chosen.get(choice.what) == choice.name
        mass, battery = float(w.mass[choice.index]), float(w.battery_mass[choice.index])
        color = Ink.VERMILION if took else Ink.BLUE
        axes.barh(place, mass - battery, color=color, height=0.7)
        axes.barh(place, battery, left=mass - battery, color=color, alpha=0.45, height=0.7)
        if mass > _WIDEST * lightest:
            text = f"{rounded(mass, 2)} kg \N{RIGHTWARDS ARROW}"
            how: Any = {"bbox": {"facecolor": "white", "edgecolor": "none", "pad": 1.0}}
            how |= {"ha": "right", "va": "center", "fontsize": 8.0}
            axes.text(0.995 * _WIDEST * lightest, place, text, **how)
    axes.set_yticks(range(len(rows)), labels, fontsize=8.0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)
    label = "least mass with that part: drive (full colour) and battery (pale) [kg]"
    axes.set(xlim=(0.0, _WIDEST * lightest), xlabel=label)
    task = f"{found.body.name} to {found.asked.dive.max_depth:g} m"
    axes.set_title(f"{task}: each part, the others free (red: chosen)", loc="left")
    return figure


def _volts(choice: Choice) -> float:
    """Return what windings and supplies are put in order by; other parts keep theirs."""
    return float(choice.name.split()[0]) if choice.what in ("winding", "supply") else 0.0


def _label(what: str, name: str) -> str:
    return name if what in name or what in ("kind", "pump", "battery") else f"{what} {name}"


@style.styled
def draw_requirements(found: Sizing) -> Figure:
    """Return what each wish costs: the least mass and its stroke as depth, time, ... change.

    Behind them where the chosen drive's battery goes.
    """
    sweeps = [sweep for sweep in found.sweeps if len(sweep.values) > 1]
    count = len(sweeps) + 1
    figure = Figure(figsize=(10.5, 2.9 * math.ceil(count / 3)))
    panels = style.grid_of(figure, count, 3)
    for axes, sweep in zip(panels, sweeps, strict=False):
        _requirement(axes, sweep, getattr(found.asked.dive, sweep.what))
    _spent(panels[len(sweeps)], found)
    style.label_panels(panels)
    return figure


def _spent(axes: Axes, found: Sizing) -> None:
    """Draw what becomes of the battery's energy."""
    budget, best, dive = found.evaluation.spent, found.best, found.asked.dive
    drive = dive.cycles * found.evaluation.cycle_energy[best] - budget.driver_loss[best]
    driver = budget.driver_loss[best] + budget.driver_standby[best]
    bars = {
        "drive": drive,
        "driver": driver,
        "hotel": budget.drawn[best] - drive - driver,
        "self-discharge": budget.self_discharged[best],
        f"cold, {found.asked.coldest:.3g} °C": budget.cold[best],
        "reserve": budget.reserve[best],
        "not usable": budget.unusable[best],
    }
    energy = [float(value) / 3600.0 for value in bars.values()]
    colors = [Ink.BLUE] * 3 + [Ink.ORANGE] * 4  # drawn, and not to be had
    axes.barh(range(len(bars)), energy, color=colors, height=0.7)
    axes.set_yticks(range(len(bars)), list(bars), fontsize=8.0)
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("of the chosen battery [Wh] (orange: not drawn)")


def _requirement(axes: Axes, sweep: Sweep, asked: float) -> None:
    name, unit = _REQUIREMENTS[sweep.what]
    x = np.array(sweep.values) / unit
    axes.plot(x, sweep.mass, color=Ink.BLUE, marker="o", label="mass [kg]")
    axes.set_xlabel(name)
    axes.set_ylabel("drive and battery [kg]", color=Ink.BLUE)
    axes.set_ylim(0.0, _ABOVE * float(np.nanmax(sweep.mass, initial=0.0)) or None)
    other = axes.twinx()
    other.spines["right"].set_visible(True)
    other.plot(x, np.array(sweep.stroke) * 1e6, color=Ink.ORANGE, marker="^", ls="--")
    other.set_ylabel("stroke [cm³]", color=Ink.ORANGE)
    other.set_ylim(0.0, _APART * 1e6 * max(sweep.stroke))
    other.grid(visible=False)
    axes.axvline(asked / unit, color=Ink.GREY, lw=0.8, ls=":")
    for place in x[~np.isfinite(np.array(sweep.mass))]:
        axes.text(place, 0.0, "none", color=Ink.VERMILION, ha="center", va="bottom", fontsize=8.0)


_DIGITS = 12  # that are written: more than a part is known to, fewer than what sums of floats add


class SizingShown(Shown[Sizing]):
    """The vehicle with the drive, all drives that do the dive, and pictures."""

    name = "size"

    def parts(self) -> Iterator[Part]:
        """Give the drive first."""
        yield from self.found.sentences
        yield Drawn("drives", partial(draw_candidates, self.found))
        yield Drawn("parts", partial(draw_parts, self.found))
        yield Drawn("requirements", partial(draw_requirements, self.found))
        yield from labelled("cast", self.found.column.report)

    @property
    def title(self) -> str:
        """The body, and the dive."""
        return f"{self.found.body.name}: drive to {self.found.asked.dive.max_depth:g} m"

    def table(self) -> Any:
        """Return the columns of drives.csv."""
        return columns(self.found)

    def files(self) -> dict[str, object]:
        """Return the vehicle, and every drive that does the dive."""
        found, drives = self.found, self.table()
        made = Vehicle.model_validate(_rounded(sized_vehicle(found).model_dump()))
        head = (
            f"Written by swimbladder size: {found.body.name} to {found.asked.dive.max_depth:g} m."
        )
        return {
            "vehicle.toml": vehicle_file(made, head=head),
            "drives.csv": rows_csv(drives, zip(*drives.values(), strict=True)),
        }


def _rounded(value: Any) -> Any:
    """Return numbers as a person reads them, 0.6 for 0.6000000000000001."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(item) for item in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value
