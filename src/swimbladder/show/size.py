"""What a sized drive was chosen from: mass against energy, each part's best."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from swimbladder.design.sizing import Sizing, columns, sized_vehicle
from swimbladder.design.sizing.candidates import PARTS
from swimbladder.design.sizing.run import Choice, Sweep
from swimbladder.io.files import rows_csv
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.arrays import Array
from swimbladder.show.parts import Drawn, Part, Shown, labelled
from swimbladder.show.picture import Ink, Panel, Picture, grid_of, one_panel
from swimbladder.units import rounded
from swimbladder.vehicle import Vehicle

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


def draw_candidates(found: Sizing) -> Picture:
    """Return mass of drive and battery against energy per cycle of every drive that does it."""
    w, energy = found.evaluation, found.evaluation.cycle_energy * 1e-3
    title = f"{found.body.name} to {found.asked.dive.max_depth:g} m"
    how: Any = {"xlog": True, "ylog": True, "title": title, "legend": "beside"}
    picture, panel = one_panel((7.0, 4.6), **how)
    screw = np.array([c.kind == "electromechanical" for c in found.batch.of])
    for mask, color, marker, label in (
        (w.feasible & ~screw, Ink.BLUE, "o", "pump"),
        (w.feasible & screw, Ink.ORANGE, "^", "screw"),
    ):
        if np.any(mask):
            label = f"{label}, {np.count_nonzero(mask):,} drives"
            panel.dots(w.mass[mask], energy[mask], marker, color, label, size=2.5, alpha=0.5)
    front = found.pareto
    panel.line(w.mass[front], energy[front], Ink.BLACK, "best compromises", marker=".")
    best = found.best
    panel.dots(w.mass[best], energy[best], "*", Ink.VERMILION, "chosen", size=15.0)
    panel.x = f"drive and battery for {found.asked.dive.cycles} cycles [kg]"
    panel.y = "energy of the drive per cycle [kJ]"
    beyond = _frame(panel, w.mass[w.feasible], energy[w.feasible])
    if beyond:
        panel.dots(np.nan, np.nan, ".", Ink.WHITE, f"{beyond:,} are beyond the edges")
    return picture


def _frame(panel: Panel, mass: Array, energy: Array) -> int:
    """Show what comes near the best in both, and return how many drives do not."""
    near = (mass <= _SHOWN * mass.min()) & (energy <= _SHOWN * energy.min())
    for axis, values in (("x", mass[near]), ("y", energy[near])):
        setattr(panel, f"{axis}lim", (float(values.min()) / 1.15, 1.15 * float(values.max())))
    return int(np.count_nonzero(~near))


def draw_parts(found: Sizing) -> Picture:
    """Return the best mass with each part in the drive, all others free, and why there is none."""
    w = found.evaluation
    listed, kinds = [c for c in found.choices if c.what in PARTS], list(PARTS)
    rows = sorted(listed, key=lambda c: (kinds.index(c.what), _volts(c)))
    task = f"{found.body.name} to {found.asked.dive.max_depth:g} m"
    title = f"{task}: each part, the others free (red: chosen)"
    how: Any = {"deep": True, "grid": "x", "title": title}
    picture, panel = one_panel((8.0, 0.24 * len(rows) + 1.2), **how)
    chosen, lightest = found.chosen.choices, float(w.mass[found.best])
    for place, choice in enumerate(rows):
        if choice.index < 0:
            why = f"none does: {100.0 * choice.margin:.0f} % of the {choice.missing} needed"
            panel.text(0.02 * lightest, place, why, up="center", size=8.0, color=Ink.GREY)
            continue
        took = chosen.get(choice.what) == choice.name
        mass, battery = float(w.mass[choice.index]), float(w.battery_mass[choice.index])
        bar: Any = {"color": Ink.VERMILION if took else Ink.BLUE, "thick": 0.7, "flat": True}
        panel.bars(place, mass - battery, **bar)
        panel.bars(place, battery, base=mass - battery, alpha=0.45, **bar)
        if mass > _WIDEST * lightest:
            text = f"{rounded(mass, 2)} kg \N{RIGHTWARDS ARROW}"
            how = {"across": "right", "up": "center", "size": 8.0, "boxed": True}
            panel.text(0.995 * _WIDEST * lightest, place, text, **how)
    panel.yticks = {place: _label(c.what, c.name) for place, c in enumerate(rows)}
    panel.ylim, panel.xlim = (-0.6, len(rows) - 0.4), (0.0, _WIDEST * lightest)
    panel.x = "least mass with that part: drive (full color) and battery (pale) [kg]"
    return picture


def _volts(choice: Choice) -> float:
    """Return what windings and supplies are put in order by; other parts keep theirs."""
    return float(choice.name.split()[0]) if choice.what in ("winding", "supply") else 0.0


def _label(what: str, name: str) -> str:
    return name if what in name or what in ("kind", "pump", "battery") else f"{what} {name}"


def draw_requirements(found: Sizing) -> Picture:
    """Return what each wish costs: the least mass and its stroke as depth, time, ... change.

    Behind them where the chosen drive's battery goes.
    """
    sweeps = [sweep for sweep in found.sweeps if len(sweep.values) > 1]
    count = len(sweeps) + 1
    size = (10.5, 2.9 * math.ceil(count / 3))
    picture, panels = grid_of(size, count, 3, letters=True, legend="below")
    for panel, sweep in zip(panels, sweeps, strict=False):
        _requirement(picture, panel, sweep, getattr(found.asked.dive, sweep.what))
    _spent(panels[len(sweeps)], found)
    return picture


def _spent(panel: Panel, found: Sizing) -> None:
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
    panel.bars(range(len(bars)), energy, colors, thick=0.7, flat=True)
    panel.yticks, panel.deep, panel.grid = dict(enumerate(bars)), True, "x"
    panel.x = "energy of the battery [Wh]\n(orange: not drawn)"


def _requirement(picture: Picture, panel: Panel, sweep: Sweep, asked: float) -> None:
    name, unit = _REQUIREMENTS[sweep.what]
    x = np.array(sweep.values) / unit
    panel.line(x, sweep.mass, label="mass", marker="o")
    panel.x, panel.y = name, "drive and battery [kg]"
    panel.ylim = (0.0, _ABOVE * float(np.nanmax(sweep.mass, initial=0.0)) or None)
    other = picture.add(panel.row, panel.column, x_of=panel, over=True, grid="")
    other.line(x, np.array(sweep.stroke) * 1e6, Ink.ORANGE, "stroke", marker="^", dash="--")
    other.y, other.ylim = "stroke [cm³]", (0.0, _APART * 1e6 * max(sweep.stroke))
    panel.rule("x", asked / unit, dash=":")
    for place in x[~np.isfinite(np.array(sweep.mass))]:
        panel.text(place, 0.0, "none", color=Ink.VERMILION, across="center", size=8.0)


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
