"""A design as it is shown: what to do, what each record should look like, its predicted errors."""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from swimbladder.design.experiments import Design
from swimbladder.design.experiments.conditions import Release
from swimbladder.design.experiments.result import percent
from swimbladder.design.plan import Move, plan_file
from swimbladder.estimation.motion.diagnose import describe
from swimbladder.show.estimates import row
from swimbladder.show.parts import Drawn, Labelled, Part, Shown, Table, labelled, severity
from swimbladder.show.picture import Ink, Panel, Picture, grid_of

_COLORS = (Ink.BLUE, Ink.VERMILION, Ink.GREEN, Ink.PURPLE)
_ACROSS = 3


def groups(design: Design) -> list[tuple[int, ...]]:
    """Return the numbers of the experiments that are alike, counted from 1, in order."""
    found: dict[object, list[int]] = {}
    for k, release in enumerate(design.chosen.releases, start=1):
        found.setdefault(release, []).append(k)
    return [tuple(numbers) for numbers in found.values()]


def draw_plan(design: Design) -> Picture:
    """Return the traces to expect, a panel for each kind of experiment."""
    kinds = groups(design)
    across = min(_ACROSS, len(kinds))
    size = (max(2.9 * across, 5.0), 2.7 * math.ceil(len(kinds) / across) + 0.5)
    picture, panels = grid_of(size, len(kinds), across, sharey="all", legend="below")
    for k, (panel, numbers) in enumerate(zip(panels, kinds, strict=True)):
        _trace(design, numbers, panel)
        panel.y = "depth [m]" if k % across == 0 else ""
        panel.x = "time since the release [s]" if k + across >= len(kinds) else ""
    return picture


def _trace(design: Design, numbers: Sequence[int], panel: Panel) -> None:
    at, s = numbers[0] - 1, design.conditions.setting
    for flights in design.chosen.others:
        f = flights[at]
        since = f.time - f.time[f.moved[0]]
        panel.line(since, f.depth, Ink.SKY, "parameter region", width=0.8, alpha=0.8)
    f = design.chosen.flights[at]
    time, moved = f.time - f.time[f.moved[0]], list(f.moved)
    panel.line(time, f.depth, Ink.BLACK, "vehicle as given")
    panel.dots(time[moved], f.depth[moved], "o", Ink.VERMILION, "change of volume", size=4.5)
    for depth in (s.shallowest, s.deepest):
        panel.rule("y", depth, dash=":", width=1.0)
    panel.rule("y", s.bottom_depth, width=2.0)
    panel.ylim = (0.0, 1.05 * s.bottom_depth)
    volumes = ", ".join(f"{1e6 * move.volume:+.3g}" for move in f.release.moves)
    panel.title = f"{_title(numbers)}\n{volumes} cm³"


def _title(numbers: Sequence[int]) -> str:
    """Return which experiments a panel shows: "Experiments 1, 3 to 6"."""
    parts: list[list[int]] = []
    for number in numbers:
        if not parts or number != parts[-1][-1] + 1:
            parts.append([])
        parts[-1].append(number)
    said = [f"{p[0]} to {p[-1]}" if len(p) > 2 else ", ".join(str(n) for n in p) for p in parts]
    return f"Experiment{'s' if len(numbers) > 1 else ''} {', '.join(said)}"


def draw_design(design: Design) -> Picture:
    """Return what the pool time buys: errors as experiments are done, and sizes of single steps."""
    picture, (after, size) = grid_of((8.2, 3.9), 2, 2, letters=True, legend="below")
    _after(design, after)
    _sizes(design, size)
    return picture


def _after(design: Design, panel: Panel) -> None:
    names = design.chosen.prediction.names
    sets = [(design.chosen, "-", "o", "planned")]
    if design.against is not None:
        sets.append((design.against, "--", "s", design.rival))
    for evaluated, dash, marker, label in sets:
        settling = design.conditions.setting.settling
        time = np.cumsum([settling + f.duration for f in evaluated.flights]) / 60.0
        for name, color in zip(names, _COLORS, strict=False):
            shares = 100.0 * np.array([a[name] for a in evaluated.after], float)
            how: Any = {"dash": dash, "marker": marker, "size": 3.5, "width": 1.2}
            panel.line(time, shares, color, f"{_symbol(name)}, {label}", **how)
    panel.x, panel.y = "pool time, settling included [min]", "1 sigma [% of the parameter]"
    panel.ylog = True


def _sizes(design: Design, panel: Panel) -> None:
    c = design.curve
    for errors, mark, color, label in (
        (c.steps, "s", Ink.ORANGE, "single steps"),
        (c.to_and_fro, "o", Ink.GREEN, "to and fro"),
    ):
        panel.line(1e6 * c.sizes, 100.0 * errors, color, label, marker=mark, size=3.5)
    panel.rule("y", 100.0 * design.chosen.largest, Ink.BLACK, "planned", width=1.0)
    panel.x, panel.y = "change of volume [cm³]", "largest error after the same time [%]"
    panel.xlog = panel.ylog = True


def _symbol(name: str) -> str:
    return {"psi": "ψ", "drag_quadratic": "k_dt", "mass": "m"}.get(name, name)


def volume(value: float, area: float | None) -> str:
    """Return a volume [m3] as text, with the travel of the piston where there is one."""
    text = f"{1e6 * value:+.3g} cm3" if value else "0 cm3"
    return text if area is None or not value else f"{text} ({1e3 * value / area:+.2g} mm)"


def moves(release: Release, area: float | None) -> str:
    """Return the changes of volume of a release, short."""
    return ", ".join(_move(move, area) for move in release.moves)


def _move(move: Move, area: float | None) -> str:
    what = volume(move.volume, area)
    if move.depth is None:
        return what
    return f"at {move.depth:g} m going {move.going} {what}"


def rows(design: Design) -> list[tuple[str, ...]]:
    """Return start, changes of volume, duration and errors after it of each experiment."""
    w, found = design.chosen, []
    for release, flight, errors in zip(w.releases, w.flights, w.after, strict=True):
        what = f"{release.start:g} m", moves(release, design.vehicle.piston_area)
        after = (percent(errors[name]) for name in w.prediction.names)
        found.append((*what, f"{flight.duration:.0f} s", *after))
    return found


def instruction(design: Design, k: int) -> str:
    """Return what to do in experiment k, counted from 0, in sentences."""
    w, s, area = design.chosen, design.conditions.setting, design.vehicle.piston_area
    release, flight = w.releases[k], w.flights[k]
    said = [f"Come to rest at {release.start:g} m."]
    for move in release.moves:
        to = f"volume to {volume(move.volume, area)} relative to that at rest."
        if move.depth is not None:
            where = f"When it passes {move.depth:g} m on its way {move.going}"
        said.append(to.capitalize() if move.depth is None else f"{where}: {to}")
    passed = {"shallowest": s.shallowest, "deepest": s.deepest}.get(flight.ended)
    end = "to the end" if passed is None else f"until it passes {passed:g} m"
    said.append(f"Record {end}, {s.longest:g} s at most; about {flight.duration:.0f} s.")
    return " ".join(said)


def headlines(design: Design) -> list[str]:
    """Return how long it takes, and the predicted standard errors."""
    w = design.chosen
    count = len(w.releases)
    prediction = w.prediction
    errors = ", ".join(f"{name} {percent(share)}" for name, share in prediction.share.items())
    return [
        f"{count} experiment{'s' if count > 1 else ''} in {w.time / 60.0:.0f} min, "
        f"{design.conditions.setting.settling / 60.0:.1f} min of settling before each included.",
        f"Predicted standard errors: {errors}.",
    ]


def comparison(design: Design) -> list[str]:
    """Return how the set compares with the other, none where there is no other."""
    if design.against is None:
        return []
    other = design.against
    errors = ", ".join(
        f"{name} {percent(share)} ({design.gains[name]:.1f} times as much)"
        for name, share in other.prediction.share.items()
    )
    said = [f"Against {design.rival}, in {other.time / 60.0:.0f} min: {errors}."]
    if other.psi is not None and design.chosen.psi is not None:
        shift = f"psi left out would shift {describe(other.psi.refit)}"
        there, here = (f"at {1e3 * w.psi.rms:.1f} mm" for w in (other, design.chosen) if w.psi)
        said.append(f"There, {shift}, {there} rms; here {here}.")
    return said


class DesignShown(Shown[Design]):
    """The plan to follow, its predicted errors, a page to print, and pictures."""

    name, kind, template = "design", "experiments in the pool", "plan.html.j2"

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        found = self.found
        c = found.conditions
        pool = f"a pool of {c.setting.bottom_depth:g} m"
        yield f"{found.vehicle.name}, {c.question.model.law} drag, {pool}"
        if not found.identifiable:
            yield "No set of experiments in this time identifies all parameters:"
            yield from severity(found.findings, "no")
        yield from headlines(found)
        yield from severity(found.findings, "warning")
        yield from (_experiments(found), _parameters(found))
        yield from comparison(found)
        yield Drawn("design", partial(draw_design, found), "experiments-design")
        yield Drawn("plan", partial(draw_plan, found), "experiments-plan")
        yield from severity(found.findings, "note")
        yield from labelled("assumed", found.assumptions)

    def table(self) -> dict[str, Any]:
        """Return a row for each change of volume; depth is nan for one from rest."""
        flown = zip(self.found.chosen.releases, self.found.chosen.flights, strict=True)
        rows = [
            (number, release.start, flight.duration, move.volume, move.depth)
            for number, (release, flight) in enumerate(flown, start=1)
            for move in release.moves
        ]
        names = ("experiment", "start_depth_m", "duration_s", "volume_m3", "at_depth_m")
        return dict(zip(names, np.array(rows, dtype=float).T, strict=True))

    def files(self) -> dict[str, object]:
        """Return the plan to follow."""
        return {"plan.toml": plan_file(self.found.plan(), head=_head(self.found))}

    def context(self) -> Mapping[str, Any]:
        """Return what the page to print has."""
        found = self.found
        return {
            "design": found,
            "headlines": headlines(found),
            "experiments": _experiments(found),
            "parameters": _parameters(found),
            "comparison": comparison(found),
            "listed": [p for p in self.parts() if isinstance(p, Labelled) and p.label in _MARKED],
        }


_MARKED = ("no", "warning", "note")


def _experiments(found: Design) -> Table:
    after = [f"{name} after" for name in found.chosen.prediction.names]
    change = "volume relative to rest"
    numbered = [(str(k), *row) for k, row in enumerate(rows(found), start=1)]
    return Table(("", "rest depth", change, "duration", *after), numbered, left=(change,))


def _parameters(found: Design) -> Table:
    w = found.chosen
    headings = ["", "assumed", "1 sigma", "95 % interval", "unit", "as a share", "other vehicles"]
    listed = []
    for name, e in w.prediction.parameters.items():
        r = row(name, e)
        spread = " to ".join(map(percent, w.spread[name]))
        rival = [f"{found.gains[name]:.1f} times"] if found.gains else []
        share = percent(w.prediction.share[name])
        listed.append((name, r.value, r.std, r.ci95, r.unit, share, spread, *rival))
    return Table(headings + ([found.rival] if found.gains else []), listed)


def _head(design: Design) -> str:
    lines = ["Experiments by swimbladder design-experiment. Volumes count from the one at rest."]
    lines += headlines(design)
    for k in range(len(design.chosen.releases)):
        lines.append(f"{k + 1}. {instruction(design, k)}")
    return "\n".join(lines)
