"""What changing the volume costs, as it is shown."""

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from swimbladder.design.energy import (
    DriveEnergy,
    Energy,
    Hovering,
    Profiling,
    PumpFit,
    efficiency_bands,
)
from swimbladder.design.energy.fit import run_columns
from swimbladder.design.energy.run import dive_columns, fit_sentences, spread_indices
from swimbladder.estimation.estimates import Estimate
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.estimates import row
from swimbladder.show.parts import Drawn, Gone, Part, Shown, Table, labelled
from swimbladder.show.picture import Ink, Panel, Picture, grid_of
from swimbladder.units import rounded
from swimbladder.vehicle import Vehicle

_STAGES = {
    "battery": Ink.SKY,
    "driver": Ink.PURPLE,
    "motor": Ink.BLUE,
    "transmission": Ink.ORANGE,
    "leakage": Ink.GREEN,
    "reservoir": Ink.GREY,
}

_DAY_ML = 86400.0 * 1e6  # mL/day per m3/s


def draw_energy(answer: Energy) -> Picture:
    """Return energy per volume, rates, power and efficiencies over depth, and the map."""
    found = answer.drive
    title = f"{found.vehicle.name}, {found.vehicle.actuator.kind}"
    how: Any = {"title": title, "letters": True, "legend": "below", "across": 6}
    picture, panels = grid_of((11.0, 7.0), 6, 3, **how)
    per, rate, power, chain, last, into = panels
    z, m = found.column.depth, found.map
    per.line(found.per_volume * 1e-6, z, label="from the battery")
    pressure = found.column.pressure * 1e-6
    per.line(pressure, z, Ink.BLACK, "into the water, p dV", dash="--")
    rate.line(m.rate_out * 1e6, z)
    power.line(m.power_out, z, label="displacing")
    if np.any(m.holding_power > 0.0):
        power.line(m.holding_power, z, Ink.VERMILION, "holding the volume", dash="--")
    chain.line(found.efficiency, z, Ink.BLACK, "the whole", width=2.2)
    for name, values in found.stages.items():
        chain.line(values, z, _STAGES[name], name)
    into.line(m.rate_in * 1e6, z)
    per.x, rate.x = "energy per volume displaced [J/mL]", "volume rate out [mL/s]"
    power.x, chain.x = "power from the battery [W]", "efficiency [-]"
    into.x, last.x = "volume rate in [mL/s]", "leakage at rest [mL/day]"
    if found.efficiencies.size:
        _map(last, found)
    else:
        last.line(m.leakage * _DAY_ML, z)
    for panel in panels:
        panel.y, panel.ylim, panel.xlim = "depth [m]", (0.0, float(z[-1])), (0.0, None)
    chain.xlim = (0.0, 1.02)
    last.xlim = (0.0, 100.0) if found.efficiencies.size else (None, None)
    return picture


def _map(panel: Panel, found: DriveEnergy) -> None:
    """Fill the plane of voltage and depth with the efficiency there."""
    best = float(np.nanmax(found.efficiencies, initial=0.01))
    step = 0.02 if best < 0.4 else 0.05
    shares = np.linspace(found.shares[0], found.shares[-1], _ACROSS)
    some = np.unique(np.linspace(0, found.column.depth.size - 1, _ACROSS).astype(int))
    rows = [np.interp(shares, found.shares, row) for row in found.efficiencies.T[some]]
    kinds = np.nan_to_num(np.array(rows) // step, nan=-1.0).astype(int)
    count = int(kinds.max(initial=0)) + 1
    shown = np.linspace(0.0, len(_CIVIDIS) - 1.0, count)
    colors = np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in _CIVIDIS])
    parts = [np.interp(shown, np.arange(len(colors)), part).astype(int) for part in colors.T]
    hexes = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in zip(*parts, strict=True)]
    panel.cells(100.0 * shares, found.column.depth[some], kinds, hexes)
    panel.x, panel.grid = "share of the full voltage [%]", ""
    panel.title = f"efficiency, 0 to {step * count:.2g}"


_ACROSS = 81  # columns of the map, and rows
_CIVIDIS = ("#00224e", "#35456c", "#666970", "#948e77", "#c8b866", "#fee838")


def draw_versus(hover: Hovering, dive: Profiling, found: DriveEnergy) -> Picture:
    """Return the break-even time of hovering, and the energy of dives, over depth."""
    picture, panels = grid_of((9.0, 4.2), 2, 2, letters=True)
    left, right = panels
    z = found.column.depth
    left.line(np.where(np.isfinite(hover.break_even), hover.break_even, np.nan) / 3600.0, z)
    left.x, left.y = "time of hovering at break-even [h]", "depth [m]"
    weight = f"{hover.weight_error * 1e6:.3g} mL too heavy"
    left.note = f"{weight}: right of it the engine takes less"
    for energy, color, dash, label in (
        (dive.engine, Ink.BLUE, "-", "buoyancy engine"),
        (dive.thruster, Ink.VERMILION, "--", "thruster"),
        (dive.drag, Ink.BLACK, ":", "drag alone"),
    ):
        right.line(energy[1:] * 1e-3, dive.depth[1:], color, label, dash=dash)
    if 0.0 < dive.break_even < np.inf:
        right.rule("y", dive.break_even, width=1.0)
        right.text(0.02, dive.break_even, f"break-even {rounded(dive.break_even, 3)} m", share="x")
    right.x, right.y = "energy of a dive and back [kJ]", "depth of the turn [m]"
    right.title, right.legend = f"at {dive.speed:g} m/s", "best"
    for panel in panels:
        panel.xlog, panel.ylim = True, (0.0, float(z[-1]))
    return picture


def draw_fit(fit: PumpFit) -> Picture:
    """Return power and delivery of the runs over pressure with what was found, and the dives."""
    delivery = "delivery" in fit.parameters
    picture, panels = grid_of((9.0, 4.2), 2 + delivery, 2 + delivery, letters=True)
    r, kept = fit.runs, fit.kept
    p, t = r.pressure[kept], r.duration[kept]
    line = np.linspace(0.0, p.max(), 100)
    warmer = np.zeros(p.size) if r.temperature is None else r.temperature[kept] - 15.0
    cooled = np.nan_to_num(fit.value("power_per_temperature") * warmer)
    settled = r.power[kept] / fit.voltage_share[kept] + fit.value("lost_energy") / t - cooled
    at = "runs, start corrected"
    at += "\nat 15 °C" if "power_per_temperature" in fit.parameters else ""
    at += f"\nat {fit.reference_voltage:.3g} V" if fit.reference_voltage is not None else ""
    how: Any = {"size": 4.0, "hollow": True}
    power = fit.value("idle_power") + fit.value("power_per_pressure") * line
    panels[0].line(line / 1e4, power, label="fitted")
    panels[0].dots(p / 1e4, settled, "o", Ink.BLACK, at, **how)
    panels[0].y = "electrical power [W]"
    if delivery and r.volume is not None:
        rate = (r.volume[kept] + fit.value("start_volume")) / t * 1e6
        steady = fit.value("delivery") - fit.value("slip") * line
        panels[1].line(line / 1e4, steady * 1e6, label="fitted")
        panels[1].dots(p / 1e4, rate, "o", Ink.BLACK, "runs, start corrected", **how)
        panels[1].y = "delivery [mL/s]"
    for panel in panels[:-1]:
        panel.x, panel.ylim, panel.legend = "pressure [dbar]", (0.0, None), "best"
    last = panels[-1]
    if fit.dives:
        measured = np.array([d.energy for d in fit.dives]) * 1e-3
        predicted = np.array([d.predicted for d in fit.dives]) * 1e-3
        ends = np.array([0.0, 1.05 * max(measured.max(), predicted.max())])
        last.band(ends, 0.9 * ends, 1.1 * ends, Ink.GREY, "10 %")
        last.dots(measured, predicted, "o", label="dives", size=4.0)
        last.x, last.y = "energy as logged [kJ]", "predicted from the other dives [kJ]"
        last.xlim = last.ylim = (0.0, float(ends[1]))
        last.legend = "upper left"
    else:
        fitted = fit.value("idle_power") + fit.value("power_per_pressure") * p
        last.dots(p / 1e4, settled - fitted, **how)
        last.rule("y", 0.0, Ink.BLACK)
        last.x, last.y = "pressure [dbar]", "residual of the power [W]"
    return picture


HEAD = "Pump found by swimbladder energy --fit."
_SHORT = {"battery": "batt", "transmission": "drive", "leakage": "leak", "reservoir": "tank"}
_LINES = 11  # depths in the printed table


class EnergyShown(Shown[Energy]):
    """What it costs, at some depths, and what is assumed."""

    name = "energy"

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        answer, found = self.found, self.found.drive
        m = found.map
        yield f"{found.vehicle.name}, {found.vehicle.actuator.kind}"
        yield from answer.sentences
        columns = {
            "depth\nm": found.column.depth,
            "out\nmL/s": m.rate_out * 1e6,
            "power\nW": m.power_out,
            "energy\nJ/mL": found.per_volume * 1e-6,
            "whole\n%": found.efficiency * 100.0,
            **{f"{_SHORT.get(name, name)}\n%": part * 100.0 for name, part in found.stages.items()},
            "in\nmL/s": m.rate_in * 1e6,
            "hold\nW": m.holding_power,
        }
        rows = np.transpose([*columns.values()])[spread_indices(found.column.depth.size, _LINES)]
        yield Table([*columns], [[_digits(x) for x in row] for row in rows], left=())
        yield Drawn("energy", partial(draw_energy, answer))
        yield Drawn("versus", partial(draw_versus, answer.hover, answer.dive, found))
        yield from labelled("assumed", answer.assumptions)

    def files(self) -> dict[str, object]:
        """Return energy.csv and dives.csv."""
        tables = {"energy.csv": self.found.columns(), "dives.csv": dive_columns(self.found.dive)}
        return {name: _known(columns) for name, columns in tables.items()}


def _known(table: dict[str, Any]) -> dict[str, Any]:
    """Return columns with nan for what is not finite."""
    return {name: np.where(np.isfinite(x), x, np.nan) for name, x in table.items()}


def _digits(x: float) -> str:
    if not math.isfinite(x):
        return "-"
    return f"{x:.3g}" if abs(x) < 999.5 else f"{x:.0f}"


class PumpFitShown(Shown[PumpFit]):
    """A pump that was found, with a vehicle also in its file.

    vehicle: with that pump, where there is one.
    """

    name, kind = "pump", "pump fit"
    vehicle: Vehicle | None = None

    def __post_init__(self) -> None:
        self.said = list(fit_sentences(self.found, self.vehicle))

    @property
    def good(self) -> bool:
        """Whether the runs are those of one pump."""
        return not self.found.refusal

    @property
    def why(self) -> list[str]:
        """Why they are not."""
        return [self.found.refusal]

    def parts(self) -> Iterator[Part]:
        """Give the answer, its numbers, and how the runs were read."""
        yield from self.said
        rows = []
        for name, e in self.found.parameters.items():
            unit, factor = _UNITS.get(e.unit, (e.unit, 1.0))
            value, std, *ends = (x * factor for x in (e.value, e.std, *e.ci95))
            rows.append(row(name, Estimate(value, std, (ends[0], ends[1]), unit))[:5])
        headings = ["parameter", "value", "1 sigma", "95 % interval", "unit"]
        yield Table(headings, rows, left=("parameter", "unit"))
        bands = []
        for b in efficiency_bands(self.found):
            took = f"{b.pressure / 1e4:.0f}", f"{b.runs}", f"{1e6 * b.volume:.3g}"
            bands.append((*took, f"{b.energy:.4g}", f"{b.efficiency:.3f}", f"{b.fitted:.3f}"))
        if bands:
            headings = ["dbar", "runs", "mL a run", "J a run", "efficiency", "by the law"]
            yield Table(headings, bands, left=())
        yield from self.found.runs.report
        yield Drawn("pump", partial(draw_fit, self.found))

    def numbers(self) -> Mapping[str, Any]:
        """Return the numbers of the fit, and what is said of it."""
        return {**self.found.to_dict(), "sentences": self.said, "report": self.found.runs.report}

    def table(self) -> Any:
        """Return the columns of runs.csv."""
        return run_columns(self.found)

    def files(self) -> dict[str, object]:
        """Return runs.csv, and the vehicle; that of an earlier run goes where this is refused."""
        files = {"runs.csv": self.table()}
        if self.found.refusal:
            return {**files, "vehicle.toml": Gone(HEAD)}
        if self.vehicle is None:
            return files
        said = "\n".join([HEAD, *self.said])
        return {**files, "vehicle.toml": vehicle_file(self.vehicle, head=said)}


_UNITS = {
    "W/Pa": ("mW/dbar", 1e7),
    "m3/s/Pa": ("mL/s/MPa", 1e12),
    "m3/s": ("mL/s", 1e6),
    "m3": ("mL", 1e6),
}
