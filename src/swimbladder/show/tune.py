"""A tuning as it is shown: the step of its trials, and the sensitivity, over the region."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from swimbladder.control.law import leaves
from swimbladder.design.linear.margins import frequency_response
from swimbladder.design.tuning import Tuning
from swimbladder.design.tuning.margins import WANTED
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.html import TEXTS
from swimbladder.show.parts import Drawn, Part, Shown, Table, labelled
from swimbladder.show.picture import Ink, Picture, grid_of, stacked
from swimbladder.units import shown_unit, unit_factor

_LEAST = 0.05  # sensitivity that is shown
_QUIET = 0.2  # of the supply's voltage: where less is used the supply is not shown
_LONG = 4.0  # times the median settling, that is shown


def draw_tuning(tuning: Tuning) -> Picture:
    """Return depth, volume and voltage of the trials against time."""
    picture, panels = stacked((7.5, 7.5), 1.0, 1.0, 1.0, letters=True)
    depth, volume, voltage = panels
    step = tuning.step
    settle = tuning.nominal.settle_median
    volts = tuning.law.command == "voltage"
    end = min(step.duration, _LONG * settle) if settle > 0.0 else step.duration
    over = f"over the region{', supply low' if volts else ''}"
    for traces, color, width, alpha, label in (
        (tuning.shown[1], Ink.ORANGE, 0.8, 0.7, over),
        (tuning.shown[0], Ink.BLUE, 1.8, 1.0, "nominal"),
    ):
        kept = traces.time <= end
        command = traces.command * (1.0 if volts or traces.seconds else 1e6)
        values = (traces.depth, 1e6 * traces.volume, command)
        for panel, columns in zip(panels, values, strict=True):
            for y in columns[kept].reshape(int(kept.sum()), -1).T:
                panel.line(traces.time[kept], y, color, label, width=width, alpha=alpha)
    half = tuning.band or 0.02 * abs(step.target - step.start)
    size = f"{half:.3g} m" if tuning.band else "2 %"
    # Of floats one half goes the other way.
    for goal in (step.start, step.target)[0 if tuning.band else 1 :]:
        depth.span("y", goal - half, goal + half, Ink.GREY)
        depth.rule("y", goal, Ink.BLACK, f"set-point, {size} band", dash="--")
    limit = (
        tuning.result_vehicle.supply.voltage if volts and tuning.result_vehicle.supply else math.inf
    )
    used = max(float(np.abs(traces.command).max()) for traces in tuning.shown)
    if _QUIET * limit <= used:  # else it would squeeze what is used to a line
        for side in (-limit, limit):
            voltage.rule("y", side, Ink.VERMILION, "supply", dash=":")
    asked = "change asked for [cm³]" if tuning.band else "volume asked for [cm³]"
    if tuning.shown[0].seconds:
        asked = "pump (+) or valve (−)\nin each sample [s]"
    depth.y, volume.y, voltage.y = "depth [m]", "volume [cm³]", "voltage [V]" if volts else asked
    voltage.x, volume.legend = "time since the set-point changed [s]", ""
    picture.title = f"{tuning.result_vehicle.name}, {tuning.law.name} tuned for {tuning.goal}"
    return picture


def draw_sensitivity(tuning: Tuning) -> Picture:
    """Return |S| = |1/(1 + L)| of all vehicles of the region, broken at voltage and depth."""
    picture, panels = grid_of((7.5, 3.8), 2, 2, sharey="all", letters=True, legend="below")
    count = len(tuning.plants)  # of loops at each depth, the nominal one first
    loops = [(n % count > 0, loop) for n, loop in enumerate(tuning.loops())]
    loops.sort(key=lambda one: not one[0])  # the nominal one on top
    varied: Any = {"color": Ink.ORANGE, "label": "over the region", "width": 0.7, "alpha": 0.7}
    nominal: Any = {"color": Ink.BLUE, "label": "nominal", "width": 1.6}
    for panel, place in zip(panels, (tuning.law.command, "measured depth"), strict=True):
        first = math.inf
        for other, loop in loops:
            broken = (
                loop.broken_at_depth() if place == "measured depth" else loop.broken_at_command()
            )
            w, values = frequency_response(broken)
            seen = w[abs(1.0 + values) < 1.0 / _LEAST]
            first = min(first, float(seen[0]) if len(seen) else math.inf)
            panel.line(w, 1.0 / abs(1.0 + values), **(varied if other else nominal))
        most = WANTED.peak_sensitivity
        panel.rule("y", most, Ink.VERMILION, "most that is allowed", width=1.0, dash="--")
        least = max(0.5 * first, 1e-4) if math.isfinite(first) else 1e-3
        panel.xlim, panel.ylim, panel.xlog, panel.ylog = (least, None), (_LEAST, 3.0), True, True
        panel.title, panel.x = f"broken at the {place}", "frequency [rad/s]"
    panels[0].y = "sensitivity |S| [-]"
    return picture


class TuningShown(Shown[Tuning]):
    """The vehicle with its controller, its trials and margins.

    Gains that do not keep what they have to are in unproven.toml, not in vehicle.toml.
    """

    name = "tune"

    @property
    def title(self) -> str:
        """The vehicle, the law and the goal."""
        found = self.found
        return f"{found.result_vehicle.name}: {found.law.name} tuned for {found.goal}"

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        found, law = self.found, self.found.law
        every = f"sampled every {found.sample_time:g} s"
        yield f"{found.result_vehicle.name}, law {law.name}, goal {found.goal}, {every}"
        verdict = [] if found.proven else [found.verdict]
        yield from labelled("no", verdict)
        yield from found.sentences[len(verdict) :]
        rows = [
            (name, f"{float(value) * unit_factor(unit, shown_unit(unit)):.5g}", shown_unit(unit))
            for name, value in leaves(found.parameters).items()
            for unit in (law.units[name],)
        ]
        yield Table(("parameter", "value", "unit"), rows, left=("parameter", "unit"))
        yield Table(("trials", "nominal", "over the region"), _trials(found))
        yield Drawn("tune", partial(draw_tuning, found))
        yield from self._margins()
        yield from labelled("assumed", found.assumptions)

    def _margins(self) -> Iterator[Part]:
        found = self.found
        depths = ", ".join(f"{z:g}" for z in found.judged)
        region = f"{len(found.plants)} vehicles of the region at {depths} m"
        if found.margins is not None:
            yield Table(("margins", "found", "required"), _margins(found))
            where = f"the loop broken at the {found.law.command} and at the measured depth"
            delay = f"{1e3 * found.delay:.3g} ms from a sample to its command"
            yield f"Margins: the worst of {region}, {where}, {delay}."
            if found.tuning.dead or found.tuning.pause:
                rests = "near the set-point the motor rests, and there the trials judge"
                yield f"They are those of the linear part: {rests}."
            yield Drawn("sensitivity", partial(draw_sensitivity, found))
        elif found.band:
            law = "This law changes the volume at moments of its own: there is no loop gain"
            decay = "errors of the speed decay from one decision to the next"
            yield f"{law}. Over {region} {decay}; `swimbladder stability` says more."
        else:
            none = "there is no loop gain, and no margin is claimed"
            tries = "tries it with loop gains from a half to two and with more delay"
            yield f"This law is not linear around rest: {none}."
            yield f"`swimbladder stability --robustness` {tries}."

    def table(self) -> dict[str, Any]:
        """Return the law's parameters, with their units."""
        values = leaves(self.found.parameters)
        units = [self.found.law.units[name] for name in values]
        numbers = [float(x) for x in values.values()]
        return {"parameter": list(values), "value": numbers, "unit": units}

    def files(self) -> dict[str, object]:
        """Return the vehicle."""
        found = self.found
        head = f"Tuned by swimbladder tune, law {found.law.name}, goal {found.goal}."
        text = vehicle_file(found.result_vehicle, head="\n".join([head, *found.sentences]))
        return {"vehicle.toml" if found.proven else "unproven.toml": text}


def _trials(found: Tuning) -> list[tuple[str, str, str]]:
    rows = TEXTS["tune"]["floats" if found.band else "volume"]
    table = []
    for label, form, factor, name in rows:
        values = [float(getattr(t, name)) for t in (found.nominal, found.region)]
        if not (name in ("energy", "power") and math.isnan(values[0])):
            cells = [_cell(form, factor * value) for value in values]
            table.append((label.format(band=found.band), cells[0], cells[1]))
    return table


def _cell(form: str, value: float) -> str:
    if not math.isfinite(value):
        return "not in the time watched"
    return form.format(round(value) if ":d" in form else value)


def _margins(found: Tuning) -> list[tuple[str, str, str]]:
    m, w, degrees = found.margins, WANTED, math.degrees
    assert m is not None
    return [
        ("gain may grow by", _factor(m.gain_up), _factor(w.gain_up)),
        ("gain may fall to", _factor(m.gain_down), _factor(w.gain_down)),
        ("phase margin", f"{degrees(m.phase):.0f} degrees", f"{degrees(w.phase):.0f} degrees"),
        ("more delay", f"{m.delay:.2g} s", "-"),
        ("peak sensitivity", f"{m.peak_sensitivity:.2f}", f"{w.peak_sensitivity:.2f}"),
        ("balanced disk margin", f"{m.disk:.2f}", f"{w.disk:.2f}"),
    ]


def _factor(gain: float) -> str:
    if gain == 0.0 or math.isinf(gain):
        return "any"
    return f"{gain:.2g} ({20.0 * math.log10(gain):+.1f} dB)"
