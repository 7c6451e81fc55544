"""A log against the model: depths, their difference, the input, and predictions of a filter."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from swimbladder.errors import SwimbladderError
from swimbladder.estimation.comparison import Comparison
from swimbladder.estimation.comparison.ahead import Ahead, Horizon
from swimbladder.estimation.comparison.run import FITTABLE
from swimbladder.estimation.estimates import Z95
from swimbladder.io.columns import TAKEN
from swimbladder.show.estimates import with_std
from swimbladder.show.parts import Drawn, Labelled, Part, Shown, Table, labelled
from swimbladder.show.picture import Ink, Panel, Picture, stacked
from swimbladder.units import format_quantity, shown_unit


def draw_ahead(ahead: Ahead) -> Picture:
    """Return the depths predicted so long before, with their 95 % bands."""
    count = len(ahead.horizons)
    picture, panels = stacked((7.5, 1.0 + 2.6 * count), *[1.0] * count, sharey="all")
    for panel, horizon in zip(panels, ahead.horizons, strict=True):
        _panel(ahead, horizon, panel)
    time, depth = ahead.record.time, ahead.record.depth
    low, high = float(depth.min()), float(depth.max())
    room = 0.25 * max(high - low, 0.1)
    panels[0].ylim, panels[0].xlim = (low - room, high + room), (float(time[0]), float(time[-1]))
    panels[-1].x = "time since the first sample [s]"
    return picture


def _panel(ahead: Ahead, h: Horizon, panel: Panel) -> None:
    time = ahead.record.time[h.target]
    order = np.argsort(h.target)
    apart = np.flatnonzero(np.diff(h.target[order]) > 1) + 1  # no line over what is not predicted
    label = f"predicted {h.seconds:g} s before"
    for part in np.split(order, apart):
        middle, half = h.predicted[part], Z95 * h.std[part]
        panel.band(time[part], middle - half, middle + half, Ink.SKY, "95 % band", alpha=0.35)
        panel.line(time[part], middle, Ink.VERMILION, label, width=1.2)
    panel.line(ahead.record.time, ahead.record.depth, Ink.BLACK, "measured", width=0.9)
    skill = h.skill["persistence"]
    said = "" if skill is None else f", skill {skill:.2f} against a depth that stays"
    panel.title = f"{h.seconds:g} s ahead: rms {1e3 * h.rms:.0f} mm{said}"
    panel.y, panel.legend = "depth [m]", "upper right"


def draw_comparison(comparison: Comparison) -> Picture:
    """Return measured and predicted depth, the residual and the input."""
    picture, (depth, residual, driven) = stacked((7.5, 6.4), 3.0, 1.4, 1.6)
    record = comparison.record
    for panel in (depth, residual):
        panel.shade(record.time, ~record.compared, "not compared")
    if record.reference is not None:
        depth.setpoint(record.time, record.reference)
    depth.line(record.time, record.depth, Ink.BLACK, "measured", width=1.0)
    depth.line(record.time, comparison.predicted, Ink.VERMILION, "predicted", width=1.3)
    residual.rule("y", 0.0, Ink.BLACK)
    residual.line(record.time, 1e3 * comparison.residual, Ink.VERMILION, width=0.9)
    largest = 1.15e3 * max(comparison.largest, 1e-3)
    residual.ylim, residual.legend = (-largest, largest), ""
    _input(comparison, driven)
    driven.x, driven.xlim = (
        "time since the first sample [s]",
        (float(record.time[0]), float(record.time[-1])),
    )
    depth.y, residual.y = "depth [m]", "predicted less\nmeasured [mm]"
    picture.title = _title(comparison)
    return picture


def _title(c: Comparison) -> str:
    driven = c.record.drive.replace("setpoint", "set-point")
    off = f"rms {1e3 * c.rms:.1f} mm, bias {1e3 * c.bias:+z.1f} mm"
    return f"{c.vehicle.name} driven by the logged {driven}: {off}, {_explained(c)} of the variance"


def _explained(c: Comparison) -> str:
    """Write the share of the variance; a dash where the depth has none.

    Below -100 % a depth that stays would be nearer to the log, and how much so is of no interest.
    """
    share = 100.0 * c.variance_explained
    return "< -100 %" if share < -100.0 else f"{share:.2f} %" if math.isfinite(share) else "-"


def _input(c: Comparison, panel: Panel) -> None:
    rec = c.record
    if rec.drive == "voltage" and rec.voltage is not None:
        panel.steps(rec.time, rec.voltage, width=0.9)
        panel.y = "voltage [V]"
        return
    if rec.volume is not None:
        panel.line(rec.time, 1e6 * rec.volume, Ink.BLACK, "measured", width=0.8)
    if rec.drive == "setpoint":
        panel.line(rec.time, 1e6 * c.volume, Ink.VERMILION, "predicted", width=1.0)
    neutral = 1e6 * np.array([c.vehicle.neutral_volume(z) for z in rec.depth.tolist()])
    panel.line(rec.time, neutral, Ink.SKY, "neutral", width=1.0)
    low, high = panel.limits("y")
    for stop in (c.vehicle.stroke.minimum * 1e6, c.vehicle.stroke.maximum * 1e6):
        if low < stop < high:
            panel.rule("y", stop, Ink.ORANGE, "end stop", dash=":", width=1.0)
    panel.y = "volume [cm³]"


_ROUNDING = 1e-6  # of a difference between a log and the model: less is no number to print
_DRAWN = 12  # figures of a page of many logs
NOISES = {
    "depth_noise": ("m", "mm"),
    "random_walk": ("m3/s^0.5", "cm3/s^0.5"),
    "acceleration_noise": ("m/s/s^0.5", "mm/s/s^0.5"),
}
"""Units of what is assumed of the noise, SI and shown."""


@dataclass
class Compared:
    """A log that was compared: its label, the name of its files, and what came of it."""

    label: str
    name: str = "compare"
    result: Comparison | None = None
    ahead: Ahead | None = None
    error: SwimbladderError | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return its numbers, SI, or why there are none."""
        if self.result is None:
            return {"log": self.label, "error": str(self.error)}
        return {**self.result.to_dict(), "ahead": self.ahead and self.ahead.to_dict()}


class ComparedShown(Shown[Sequence[Compared]]):
    """Logs that were compared with a model, each by itself."""

    name = "compare"

    @property
    def done(self) -> list[tuple[Compared, Comparison]]:
        """Those that could be compared."""
        return [(one, one.result) for one in self.found if one.result is not None]

    @property
    def good(self) -> bool:
        """Whether the vehicle can have made all that could be compared."""
        return all(result.possible for _, result in self.done)

    @property
    def exit_code(self) -> int:
        """That of the worst: 2 where one could not be compared."""
        own = [0 if self.good else 1]
        return max(own + [one.error.exit_code for one in self.found if one.error is not None])

    @property
    def title(self) -> str:
        """The vehicle and the logs."""
        first, *others = self.done
        more = f" and {len(others)} more" if others else ""
        return f"{first[1].vehicle.name} compared with {first[0].label}{more}"

    def numbers(self) -> Mapping[str, Any]:
        """Return those of the log, or of each."""
        every = [one.to_dict() for one in self.found]
        return every[0] if len(every) == 1 else {"comparisons": every}

    def parts(self) -> Iterator[Part]:
        """Give a row for each log and what was found wrong, then what was fitted and noted."""
        several = len(self.found) > 1
        headings = ("log", "driven by", "rms", "bias", "variance", "largest", "samples")
        yield Table(headings, [(one.label, *_row(one.result)) for one in self.found])
        for one, result in self.done:
            of = f" ({one.label})" if several else ""
            for f in result.findings:
                yield Labelled(f.severity, f"{f.sentence}{of}")
        yield "predicted less measured depth; variance: the share of it that is explained"
        said: set[str] = set()
        worst = sorted(self.done, key=lambda one: -one[1].rms)[:_DRAWN]
        for one, result in self.done:
            if several:
                yield f"\n{one.label}"
            yield from _fitted(result)
            if one.ahead is not None:
                yield from _ahead(one.ahead)
                yield Drawn(f"{one.name}-ahead", partial(draw_ahead, one.ahead), "ahead")
            yield from labelled(
                "note", (n for n in result.notes if n not in said and not n.startswith(TAKEN))
            )
            said.update(result.notes)
        for one, result in worst:
            yield Drawn(one.name, partial(draw_comparison, result), "compare")
        if len(self.done) > len(worst):
            yield f"The figures are those of the {_DRAWN} logs with the largest rms."

    def files(self) -> dict[str, object]:
        """Return the samples of each, and what was predicted."""
        found: dict[str, object] = {}
        for one, result in self.done:
            found[f"{one.name}.csv"] = result.columns()
            if one.ahead is not None:
                found[f"{one.name}-ahead.csv"] = one.ahead.columns()
        return found


class ComparisonShown(ComparedShown):
    """One log that was compared."""

    def __init__(self, found: Comparison) -> None:
        super().__init__([Compared(found.source, result=found)])

    def table(self) -> Any:
        """Return the columns of compare.csv."""
        return self.done[0][1].columns()


def _row(r: Comparison | None) -> tuple[str, ...]:
    if r is None:
        return ("-",) * 6
    off = f"{1e3 * r.rms:.1f} mm", f"{1e3 * r.bias:+z.1f} mm", _explained(r)
    return (r.record.drive, *off, f"{1e3 * r.largest:.1f} mm", str(r.n))


def _fitted(r: Comparison) -> Iterator[str]:
    """Give what was fitted to a log; 0 where it is smaller than anything that can be measured."""
    for name, fitted in r.fitted.items():
        unit, least = shown_unit(fitted.unit), _ROUNDING * FITTABLE[name].scale
        value = fitted.value if abs(fitted.value) >= least else 0.0
        known = format_quantity(value, fitted.unit, unit)
        if fitted.std is None:
            known += ", which this log does not determine"
        elif abs(fitted.std) < least:
            known += f" +- {format_quantity(0.0, fitted.unit, unit)}"
        else:
            known = with_std(value, fitted.std, fitted.unit)
        yield f"fitted to this log: {name} = {known}"
    piston = r.to_dict()["piston_rms_m"]
    if piston is not None:
        yield f"piston: rms {1e3 * piston:.2f} mm"


def _ahead(ahead: Ahead) -> Iterator[Part]:
    """Give a row for each span, and the noise that the filter assumed."""
    headings = ("ahead", "rms", "bias", "skill", "without drag", "in 95 % band", "predictions")
    rows = []
    for h in ahead.horizons:
        off = f"{1e3 * h.rms:.1f} mm", f"{1e3 * h.bias:+z.1f} mm"
        skill = ("-" if known is None else f"{known:.2f}" for known in h.skill.values())
        rows.append((f"{h.seconds:g} s", *off, *skill, f"{100.0 * h.coverage:.1f} %", str(h.n)))
    yield Table(headings, rows)
    terms = "skill: 1 - rms/rms of a depth that stays"
    terms += "; without drag: of the same filter without drag and psi"
    yield f"predicted from what was measured before, and the volume; {terms}"
    for name, value in ahead.noise.items():
        noise = format_quantity(value, *NOISES[name], digits=3)
        yield f"{name.replace('_', ' ')}: {noise}, {ahead.origins[name]}"
