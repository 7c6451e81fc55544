"""What an identification of an actuator found, as it is shown."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import PurePath

import numpy as np

from swimbladder.errors import NoAnswerError
from swimbladder.estimation.actuator import ActuatorIdentification, Estimate
from swimbladder.estimation.actuator.model import drive_of, shown, shown_unit, steady_speed
from swimbladder.estimation.actuator.result import Known, Step
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.estimates import STRONG, row
from swimbladder.show.html import TEXTS
from swimbladder.show.parts import Drawn, Gone, Labelled, Part, Shown, Table, labelled, severity
from swimbladder.show.picture import Ink, Panel, Picture, one_panel, stacked
from swimbladder.units import rounded, unit_factor

_STEADY = 0.02  # of the largest voltage: the same
_FEWEST = 5  # samples that show a speed


def draw_log(found: ActuatorIdentification, steps: Sequence[Step]) -> Picture:
    """Return voltage, position and residuals of the steps of one log, against time."""
    driven = any(s.voltage is not None for s in steps)
    heights = [1.0, 2.4, 1.3][0 if driven else 1 :]
    picture, panels = stacked((9.6, 5.2 if driven else 4.2), *heights)
    *above, upper, lower = panels
    scale, unit, name = _units(found)
    for step in steps:
        t, used = step.time, step.used
        upper.dots(t[used], scale * step.position[used], ".", Ink.BLACK, "measured", size=3.0)
        upper.line(t, scale * step.fitted, Ink.VERMILION, "fitted", width=1.2)
        lower.dots(t[used], scale * step.residual[used], ".", Ink.BLACK, size=2.5)
        if above and step.voltage is not None:
            above[0].steps(t, step.voltage, width=1.2)
            above[0].y = "voltage [V]"
    _outliers(steps, scale, upper)
    left = np.concatenate([s.residual[s.used] for s in steps])
    band = 1.96 * scale * float(left.std())
    lower.span("y", -band, band, Ink.SKY, "95 % of the noise", alpha=0.3)
    lower.rule("y", 0.0)
    upper.y, lower.y = f"{name} [{unit}]", f"measured less\nfitted [{unit}]"
    lower.x = "time since the log's first sample [s]"
    return picture


def _outliers(steps: Sequence[Step], scale: float, panel: Panel) -> None:
    """Mark the samples left out, those beyond the axis at its edge."""
    out = [(s.time[~s.used], s.position[~s.used]) for s in steps if not s.used.all()]
    if out:
        panel.ylim = panel.limits("y")
        t, x = (np.concatenate(part) for part in zip(*out, strict=True))
        panel.dots(t, np.clip(scale * x, *panel.ylim), "x", Ink.ORANGE, "left out", size=4.0)


def shows_speeds(found: ActuatorIdentification) -> bool:
    """Return whether there are steady speeds to draw."""
    return any(s.speed is not None or _steady(s) for s in found.steps)


def draw_speeds(found: ActuatorIdentification) -> Picture:
    """Return steady speed against voltage, or of each move where no voltage is logged."""
    scale, unit, _ = _units(found)
    picture, panel = one_panel((6.4, 3.9), y=f"steady speed [{unit}/s]")
    draw = _by_voltage if found.driven == "voltage" else _by_move
    draw(found, scale, panel)
    return picture


def _by_voltage(found: ActuatorIdentification, scale: float, panel: Panel) -> None:
    points = [point for step in found.steps for point in _steady(step)]
    u, v = np.array(points).T
    label = "second half of a step"
    panel.dots(u, scale * v, "o", Ink.BLACK, label, size=4.5, hollow=True)
    values = {name.removesuffix("A"): e.value for name, e in found.parameters.items() if e.known}
    # in one direction alone, a load counts as dead zone
    one_way = float(u.min()) * float(u.max()) >= 0.0
    values = {**({"asymmetry": 1.0, "load_voltage": 0.0} if one_way else {}), **values}
    if {"K1", "dead_zone", "load_voltage", "asymmetry"} <= values.keys():
        drive = drive_of({"T1": 1.0, **values})
        grid = np.linspace(min(float(u.min()), 0.0), max(float(u.max()), 0.0), 400)
        line = [scale * steady_speed(x, drive) for x in grid.tolist()]
        panel.line(grid, line, Ink.VERMILION, "fitted", width=1.2)
    panel.rule("y", 0.0)
    panel.x = "voltage [V]"


def _steady(step: Step) -> list[tuple[float, float]]:
    """Return (voltage [V], speed) of the stretches of steady voltage in a step."""
    if step.voltage is None:
        return []
    u, t, x = step.voltage, step.time, step.position
    same = _STEADY * float(np.abs(u).max(initial=0.0))
    turns = np.flatnonzero(np.abs(np.diff(u)) > same) + 1
    found = []
    for low, high in itertools.pairwise([0, *turns.tolist(), len(u)]):
        half = (low + high) // 2
        gap = (high - half) // 2
        if high - low >= _FEWEST and gap > 0 and abs(float(u[low])) > same:
            ahead = np.arange(half, high - gap)
            speed = (x[ahead + gap] - x[ahead]) / (t[ahead + gap] - t[ahead])
            found.append((float(u[low]), float(np.median(speed))))
    return found


def _by_move(found: ActuatorIdentification, scale: float, panel: Panel) -> None:
    shown = [(k, s) for k, s in enumerate(found.steps, start=1) if s.speed is not None]
    for way, color, marker in (("out", Ink.BLUE, "o"), ("in", Ink.ORANGE, "s")):
        own = [(k, s) for k, s in shown if s.label == f"{way}ward"]
        speeds = [scale * (s.speed or 0.0) for _, s in own]
        label = f"{way}ward" if own else ""
        panel.dots([k for k, _ in own], speeds, marker, color, label, size=4.5, hollow=True)
        for fit in found.logs:
            rate = fit.parameters.get(f"rate_{way}")
            moved = [k for k, s in own if s.source == fit.source]
            if rate is None or not rate.known or not moved:
                continue
            ends = [moved[0] - 0.5, moved[-1] + 0.5]
            panel.line(ends, [scale * rate.value] * 2, color, width=1.2)
            low, high = (scale * x for x in rate.ci95)
            panel.band(ends, low, high, color)
    panel.ylim, panel.x, panel.counts = (0.0, None), "number of the move", "x"


def _units(found: ActuatorIdentification) -> tuple[float, str, str]:
    """Return the scale, the unit and the name of the position as people read it."""
    return (1e3, "mm", "piston") if found.quantity == "piston" else (1e6, "cm³", "volume")


_MOST = 12  # steps in the figure


def draw_steps(found: ActuatorIdentification, source: str | None = None) -> Picture:
    """Return measured and fitted positions of the steps and residuals; of many some, evenly chosen.

    source: only the steps of this log, and no title.
    """
    own = [k for k, step in enumerate(found.steps) if source in (None, step.source)]
    count = len(own)
    some = np.unique(np.linspace(0, count - 1, min(count, _MOST)).round().astype(int))
    shown = [own[k] for k in some.tolist()]
    columns = min(4, len(shown))
    rows = math.ceil(len(shown) / columns)
    size, heights = (2.6 * columns + 0.6, 2.9 * rows + 0.5), [2.2, 1.0] * rows
    picture = Picture(size, 2 * rows, columns, heights=heights, legend="below")
    scale, unit, _ = _units(found)
    largest = [np.abs(found.steps[k].residual[found.steps[k].used]).max(initial=0.0) for k in shown]
    limit = 1.2 * max(scale * float(max(largest, default=0.0)), 1e-9)
    for place, k in enumerate(shown):
        row, column = divmod(place, columns)
        upper = picture.add(2 * row, column)
        whole = not found.steps[k].start
        lower = picture.add(2 * row + 1, column, x_of=upper if whole else None)
        _step(found.steps[k], k + 1, scale, upper, lower)
        lower.ylim = (-limit, limit)
        if column == 0:
            upper.y = f"{'travel' if unit == 'mm' else 'volume'} [{unit}]"
            lower.y = f"residual\n[{unit}]"
        if place + columns >= len(shown):
            lower.x = "time in the step [s]"
    if source is None:
        part = "" if count == len(shown) else f", {len(shown)} of {count} steps"
        picture.title = f"{_title(found)}{part}"
    return picture


def _step(step: Step, number: int, scale: float, upper: Panel, lower: Panel) -> None:
    """Draw a step above, of a long move its start only, and all residuals below."""
    t, start = step.time - step.time[0], step.position[step.used][:1].sum()
    part = slice(0, step.start or None)
    x, fitted, used = step.position[part] - start, step.fitted[part] - start, step.used[part]
    upper.dots(t[part][used], scale * x[used], ".", Ink.BLACK, "measured", size=3.5)
    if not used.all():
        out = np.clip(scale * x[~used], *upper.limits("y"))
        upper.dots(t[part][~used], out, "x", Ink.ORANGE, "left out", size=4.0)
    upper.line(t[part], scale * fitted, Ink.VERMILION, "fitted", width=1.2)
    lower.rule("y", 0.0)
    lower.dots(t[step.used], scale * step.residual[step.used], ".", Ink.BLACK, size=2.5)
    what = f"start, {step.label}" if step.start else step.label
    upper.title = f"step {number}: {what}"


def _title(found: ActuatorIdentification) -> str:
    parts, (per, length, _) = [], _units(found)
    units = {"K1": (1e3, "mm/s/V"), "K1A": (1e6, "cm³/s/V"), "T1": (1.0, "s")}
    units |= {"dead_zone": (1.0, "V"), "rate": (per, f"{length}/s")}
    for name, (scale, unit) in units.items():
        e = found.parameters.get(name)
        if e is not None and e.known:
            word = name.replace("_", " ")
            parts.append(f"{word} = {scale * e.value:.4g} ± {1.96 * scale * e.std:.2g} {unit}")
    return ", ".join(parts) or "nothing is identified"


MEANING: dict[str, str] = TEXTS["actuator"]


def words(name: str, e: Estimate) -> dict[str, str]:
    """Return a row: an estimate as texts, its meaning, and why it is not identifiable."""
    unit = "" if e.unit == "-" else shown_unit(e.unit)
    result = {"name": _called(name), "unit": unit, "meaning": MEANING.get(name, ""), "why": e.why}
    if not e.known:
        return result | {"value": "not identifiable", "std": "", "ci95": _bounds(e), "origin": ""}
    r = row(name, e, unit)
    origin = "set" if e.origin == "set" else "the logs"
    return result | {"value": r.value, "std": r.std, "ci95": r.ci95, "origin": origin}


def _bounds(e: Estimate) -> str:
    low, high = e.ci95
    if math.isfinite(high):
        return f"below {shown(high, e.unit)}"
    return f"above {shown(low, e.unit)}" if math.isfinite(low) and low > 0.0 else ""


def _called(name: str) -> str:
    """Return a parameter's name for people: K1_out -> K1 outward."""
    if name == "K1A":
        return "K1 A"
    for end, word in (("_out", " outward"), ("_in", " inward")):
        if name.endswith(end):
            return name.removesuffix(end) + word
    return name.replace("_", " ")


def headlines(found: ActuatorIdentification) -> list[str]:
    """Return what was found, a sentence for each parameter."""
    known = {name: e for name, e in found.parameters.items() if e.origin == "data"}
    return [_headline(name, e) for name, e in known.items()]


def _headline(name: str, e: Estimate) -> str:
    w = words(name, e)
    low, high = e.ci95
    value = f"{w['value']} {w['unit']}".rstrip()
    meaning, name = MEANING[name], _called(name)
    called = name[0].upper() + name[1:]
    if low <= 0.0 <= high or name == "load voltage":
        ends = w["ci95"].replace(" to ", " and ")
        return f"{called} is {value}, between {ends} {w['unit']} (95 %): {meaning}."
    half = 100.0 * 0.5 * (high - low) / abs(e.value)
    return f"{called} is {value}, known to {rounded(half, 2)} % (95 %): {meaning}."


def pairs(found: ActuatorIdentification) -> list[tuple[str, str, float]]:
    """Return the pairs of parameters that trade off, the strongest first."""
    names = list(found.correlation)
    strong = [
        (_called(a), _called(b), found.correlation[a][b])
        for k, a in enumerate(names)
        for b in names[k + 1 :]
        if abs(found.correlation[a].get(b, 0.0)) >= STRONG
    ]
    return sorted(strong, key=lambda pair: -abs(pair[2]))


def labels(found: ActuatorIdentification) -> list[str]:
    """Return a short name for each log: that of its file, and which rows."""
    names = [PurePath(fit.source.replace("\\", "/")).name for fit in found.logs]
    if len(set(names)) == len(names):
        return names
    return [f"{number}: {name}" for number, name in enumerate(names, start=1)]


_HEAD = "Identified by swimbladder identify-actuator."
_DRIVEN = {
    "voltage": "Driven by a logged voltage",
    "reference": "Judged by what a positioner was asked for",
    "nothing": "Moves at full speed, the voltage not logged",
}
_HEADINGS = ("", "value", "1 sigma", "95 % interval", "unit", "from")


class ActuatorIdentificationShown(Shown[ActuatorIdentification]):
    """What was found of an actuator: the parameters, each log, the nine of the model.

    seconds: how long the fit took, 0 where not known. steps: whether there is steps.png. A
    vehicle is written where one was given and something of it was identified; else the one of an
    earlier run is taken away.
    """

    name = "identify-actuator"
    pictures: bool = False
    seconds: float = 0.0
    steps: bool = True

    @property
    def title(self) -> str:
        """The vehicle, and what came of it."""
        found, count = self.found, len(self.found.logs)
        name = "Actuator" if found.given is None else f"Actuator of {found.given.name}"
        came = "identified" if found.identified else "not identified"
        return f"{name}: {came} from {count} log{'s' if count > 1 else ''}"

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        found, moves = self.found, self.found.driven != "voltage"
        scale, unit = (1e3, "mm") if found.quantity == "piston" else (1e6, "cm3")
        samples = sum(len(step.time) for step in found.steps)
        steps = f"{len(found.steps)} {'moves' if moves else 'steps'}, {samples} samples"
        off = f"residuals of {rounded(scale * found.noise, 2)} {unit} (1 sigma)"
        took = f"; the fit took {rounded(self.seconds, 2)} s" if self.seconds else ""
        asked = severity(found.findings, "no")
        yield from asked
        yield f"{_DRIVEN[found.driven]}; {steps}, {off}{took}."
        yield from headlines(found)
        yield from severity(found.findings, "warning")
        if self.lacks:
            yield Labelled("warning", f"no vehicle is written: {self.lacks}")
        listed = [words(name, e) for name, e in (found.parameters | found.derived).items()]
        yield _table(listed)
        reasons: dict[str, list[str]] = {}
        for r in listed:
            if r["why"] and not any(r["why"] in no.sentence for no in asked):
                reasons.setdefault(r["why"], []).append(r["name"])
        yield from (f"{', '.join(without)}: {why}" for why, without in reasons.items())
        yield from (f"correlation of {a} and {b}: {r:+.2f}" for a, b, r in pairs(found))
        if shows_speeds(found):
            about = "voltage" if not moves else "moves"
            yield Drawn("speeds", partial(draw_speeds, found), f"speeds-{about}")
        nine = [(k.symbol, *_known(k), k.source, k.origin) for k in found.nine]
        title = "The nine parameters of the model (section 2.3)"
        headings = ("", "value", "unit", "from", " ")
        meant = [k.meaning for k in found.nine]
        yield Table(headings, nine, ("", "unit", "from", " "), title, meant)
        yield from self._logs()
        yield _steps(found, scale, unit)
        yield from severity(found.findings, "note")
        yield from (*labelled("assumed", found.assumptions), *labelled("note", found.notes))

    def _logs(self) -> Iterator[Part]:
        """Give what each log determines by itself, and its pictures."""
        found = self.found
        for number, (fit, name) in enumerate(zip(found.logs, labels(found), strict=True), start=1):
            if len(found.logs) > 1:
                title = f"{name} by itself{'' if fit.refusal is None else f': {fit.refusal}'}"
                own = [words(n, e) for n, e in fit.parameters.items() if e.origin == "data"]
                yield _table(own, title) if own else title
            steps = [s for s in found.steps if s.source == fit.source]
            if steps:
                about = "moves" if found.driven != "voltage" else "voltage"
                yield Drawn(f"log-{number}", partial(draw_log, found, steps), "log")
                each = partial(draw_steps, found, fit.source)
                yield Drawn(f"steps-{number}", each, f"steps-{about}")

    def files(self) -> dict[str, object]:
        """Return the steps and, where something of it was identified, the vehicle."""
        files: dict[str, object] = {"steps.csv": self.table(), "vehicle.toml": Gone(_HEAD)}
        if self.found.given is not None and not self.lacks:
            files["vehicle.toml"] = vehicle_file(self.found.vehicle, head=_HEAD)
        if self.steps:
            files["steps.png"] = draw_steps(self.found)
        return files

    @property
    def lacks(self) -> str:
        """Why no vehicle is written, though one was given; else empty."""
        try:
            _ = self.found.given and self.found.vehicle
        except NoAnswerError as error:
            return str(error)
        return ""


def _table(listed: Sequence[Mapping[str, str]], title: str = "") -> Table:
    keys = ("name", "value", "std", "ci95", "unit", "origin")
    about = [r["meaning"] for r in listed]
    return Table(_HEADINGS, [[r[key] for key in keys] for r in listed], None, title, about)


def _steps(found: ActuatorIdentification, scale: float, unit: str) -> Table:
    called = dict(zip((fit.source for fit in found.logs), labels(found), strict=True))
    moves = found.driven != "voltage"
    headings = ["", "log", "what", "begins [s]", "lasts [s]", "samples", "left out"]
    headings += [f"residual, rms [{unit}]", *[f"speed [{unit}/s]"] * moves]
    rows = []
    for number, s in enumerate(found.steps, start=1):
        time = f"{s.time[0]:.2f}", f"{s.time[-1] - s.time[0]:.2f}"
        used = str(len(s.time)), str(int(len(s.used) - s.used.sum())), rounded(scale * s.rms, 2)
        speed = "-" if s.speed is None else rounded(scale * s.speed)
        row = (str(number), called[s.source], s.label, *time, *used)
        rows.append((*row, speed) if moves else row)
    title = f"Each {'move' if moves else 'step'}"
    return Table(headings, rows, ("log", "what"), title)


def _known(k: Known) -> tuple[str, str]:
    """Return value and unit of one of the nine as texts."""
    if k.value is None:
        return "-", k.unit
    unit = shown_unit(k.unit)
    return rounded(unit_factor(k.unit, unit) * k.value), unit
