"""What changing the volume costs, as it is shown."""

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

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
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show import style
from swimbladder.show.files import Gone
from swimbladder.show.parts import Drawn, Part, Shown, Table, labelled
from swimbladder.show.style import Ink
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


@style.styled
def draw_energy(answer: Energy) -> Figure:
    """Return energy per volume, rates, power and efficiencies over depth, and the map."""
    found = answer.drive
    figure, panels = style.new_figure((11.0, 7.0), 2, 3)
    per, rate, power, chain, last, into = panels
    z, m = found.column.depth, found.map
    per.plot(found.per_volume * 1e-6, z, color=Ink.BLUE, label="from the battery")
    pressure = found.column.pressure * 1e-6
    per.plot(pressure, z, color=Ink.BLACK, ls="--", label="into the water, p dV")
    per.set_xlabel("energy per volume pressed out [J/mL]")
    per.legend()
    rate.plot(m.rate_out * 1e6, z, color=Ink.BLUE)
    rate.set_xlabel("volume rate pressed out [mL/s]")
    power.plot(m.power_out, z, color=Ink.BLUE, label="pressing out")
    if np.any(m.holding_power > 0.0):
        power.plot(m.holding_power, z, color=Ink.VERMILION, ls="--", label="holding the volume")
    power.set_xlabel("power from the battery [W]")
    power.legend()
    chain.plot(found.efficiency, z, color=Ink.BLACK, lw=2.2, label="the whole")
    for name, values in found.stages.items():
        chain.plot(values, z, color=_STAGES[name], label=name)
    chain.set(xlim=(0.0, 1.02), xlabel="efficiency [-]")
    figure.legend(handles=chain.get_lines(), loc="outside lower left", ncols=7, fontsize=8.0)
    if found.efficiencies.size:
        best = float(np.nanmax(found.efficiencies, initial=0.01))
        step = 0.02 if best < 0.4 else 0.05
        how: Any = {"levels": np.arange(0.0, best + step, step), "cmap": "cividis"}
        shown = last.contourf(100.0 * found.shares, z, found.efficiencies.T, **how)
        figure.colorbar(shown, ax=last, label="efficiency [-]")
        last.set_xlabel("share of the full voltage [%]")
        last.grid(visible=False)
    else:
        last.plot(m.leakage * _DAY_ML, z, color=Ink.BLUE)
        last.set_xlabel("leakage at rest [mL/day]")
    into.plot(m.rate_in * 1e6, z, color=Ink.BLUE)
    into.set_xlabel("volume rate let in [mL/s]")
    for axes in panels:
        style.depth_axis(axes)
        axes.set_ylim(z[-1], 0.0)
        if axes not in (chain, last):
            axes.set_xlim(left=0.0)
    style.label_panels(panels)
    figure.suptitle(f"{found.vehicle.name}, {found.vehicle.actuator.kind}", fontsize=10.0)
    return figure


@style.styled
def draw_versus(hover: Hovering, dive: Profiling, found: DriveEnergy) -> Figure:
    """Return the break-even time of hovering, and the energy of dives, over depth."""
    figure, (left, right) = style.new_figure((9.0, 4.2), 1, 2)
    z = found.column.depth
    shown = np.where(np.isfinite(hover.break_even), hover.break_even, np.nan)
    left.plot(shown / 3600.0, z, color=Ink.BLUE)
    left.set(xscale="log", xlabel="time of hovering at break-even [h]")
    title = f"{hover.weight_error * 1e6:.3g} mL too heavy: right of it the engine takes less"
    left.set_title(title, fontsize=9.0, loc="right")
    for energy, color, line, label in (
        (dive.engine, Ink.BLUE, "-", "buoyancy engine"),
        (dive.thruster, Ink.VERMILION, "--", "thruster"),
        (dive.drag, Ink.BLACK, ":", "drag alone"),
    ):
        right.plot(energy[1:] * 1e-3, dive.depth[1:], color=color, ls=line, label=label)
    if 0.0 < dive.break_even < np.inf:
        right.axhline(dive.break_even, color=Ink.GREY, lw=1.0)
        at, text = (0.02, dive.break_even), f"break-even {rounded(dive.break_even, 3)} m"
        how: Any = {"xycoords": ("axes fraction", "data"), "ha": "left", "va": "bottom"}
        right.annotate(text, at, **how, fontsize=9.0)
    right.set(xscale="log", xlabel="energy of a dive and back [kJ]")
    right.set_title(f"at {dive.speed:g} m/s", fontsize=9.0, loc="right")
    right.legend()
    for axes, label in ((left, "depth [m]"), (right, "depth of the turn [m]")):
        style.plain_log_ticks(axes, "x")
        style.depth_axis(axes, label)
        axes.set_ylim(z[-1], 0.0)
    style.label_panels([left, right])
    return figure


@style.styled
def draw_fit(fit: PumpFit) -> Figure:
    """Return power and delivery of the runs over pressure with what was found, and the dives."""
    delivery = "delivery" in fit.parameters
    figure, panels = style.new_figure((9.0, 4.2), 1, 2 + delivery)
    r, kept = fit.runs, fit.kept
    p, t = r.pressure[kept], r.duration[kept]
    line = np.linspace(0.0, p.max(), 100)
    warmer = np.zeros(p.size) if r.temperature is None else r.temperature[kept] - 15.0
    cooled = np.nan_to_num(fit.value("power_per_temperature") * warmer)
    settled = r.power[kept] / fit.voltage_share[kept] + fit.value("lost_energy") / t - cooled
    at = "runs, start added"
    at += "\nat 15 °C" if "power_per_temperature" in fit.parameters else ""
    at += f"\nat {fit.reference_voltage:.3g} V" if fit.reference_voltage is not None else ""
    panels[0].plot(p / 1e4, settled, ".", color=Ink.SKY, ms=3.0, label=at)
    power = fit.value("idle_power") + fit.value("power_per_pressure") * line
    panels[0].plot(line / 1e4, power, color=Ink.BLUE, label="found")
    panels[0].set_ylabel("electrical power [W]")
    if delivery and r.volume is not None:
        rate = (r.volume[kept] + fit.value("start_volume")) / t * 1e6
        panels[1].plot(p / 1e4, rate, ".", color=Ink.SKY, ms=3.0, label="runs, start added")
        steady = fit.value("delivery") - fit.value("slip") * line
        panels[1].plot(line / 1e4, steady * 1e6, color=Ink.BLUE, label="found")
        panels[1].set_ylabel("delivery [mL/s]")
    for axes in panels[:-1]:
        axes.set(xlabel="pressure [dbar]", ylim=(0.0, None))
        axes.legend(loc="best")
    last = panels[-1]
    if fit.dives:
        measured = np.array([d.energy for d in fit.dives]) * 1e-3
        predicted = np.array([d.predicted for d in fit.dives]) * 1e-3
        ends = np.array([0.0, 1.05 * max(measured.max(), predicted.max())])
        shade: Any = {"color": Ink.GREY, "alpha": 0.25, "lw": 0.0, "label": "10 %"}
        last.fill_between(ends, 0.9 * ends, 1.1 * ends, **shade)
        last.plot(measured, predicted, "o", color=Ink.BLUE, ms=4.0, label="dives")
        last.set(xlabel="energy as logged [kJ]", ylabel="predicted from the other dives [kJ]")
        last.set(xlim=(0.0, ends[1]), ylim=(0.0, ends[1]))
        last.legend(loc="upper left")
    else:
        fitted = fit.value("idle_power") + fit.value("power_per_pressure") * p
        last.plot(p / 1e4, settled - fitted, ".", color=Ink.BLUE, ms=3.0)
        last.axhline(0.0, color=Ink.BLACK, lw=0.8)
        last.set(xlabel="pressure [dbar]", ylabel="power less what was found [W]")
    style.label_panels(panels)
    return figure


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

    def __init__(self, found: PumpFit, *, vehicle: Vehicle | None = None) -> None:
        super().__init__(found)
        self.vehicle = vehicle
        self.said = list(fit_sentences(found, vehicle))

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
            rows.append((name, *(f"{x * factor:.4g}" for x in (e.value, *e.ci95)), unit))
        headings = ["parameter", "value", "95 % from", "to", "unit"]
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
