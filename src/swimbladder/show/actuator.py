"""What an identification of an actuator found, as it is shown."""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import PurePath

from swimbladder.errors import NoAnswerError
from swimbladder.estimation.actuator import ActuatorIdentification, Estimate
from swimbladder.estimation.actuator.model import shown, shown_unit
from swimbladder.estimation.actuator.result import Known
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.actuator_plots import draw_log, draw_speeds, draw_steps, shows_speeds
from swimbladder.show.estimates import STRONG, row
from swimbladder.show.files import Gone
from swimbladder.show.html import TEXTS
from swimbladder.show.parts import Drawn, Labelled, Part, Shown, Table, labelled, severity
from swimbladder.units import rounded, unit_factor

MEANING: dict[str, str] = TEXTS["actuator"]


def words(name: str, e: Estimate) -> dict[str, str]:
    """Return a row: an estimate as texts, its meaning, and why it is not identifiable."""
    unit = "" if e.unit == "-" else shown_unit(e.unit)
    result = {"name": _called(name), "unit": unit, "meaning": MEANING.get(name, ""), "why": e.why}
    if not e.known:
        return result | {"value": "not identifiable", "std": "", "ci95": _bounds(e), "origin": ""}
    per = unit_factor(e.unit, unit) if unit else 1.0
    value, std, low, high = (per * x for x in (e.value, e.std, *e.ci95))
    r = row(name, Estimate(value, std, (low, high), unit, e.origin))
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

    seconds: how long the fit took, 0 where not known. With pictures there is steps.png. A
    vehicle is written where one was given and something of it was identified; else the one of an
    earlier run is taken away.
    """

    name = "identify-actuator"

    def __init__(
        self, found: ActuatorIdentification, *, seconds: float = 0.0, pictures: bool = True
    ) -> None:
        super().__init__(found, pictures=False)
        self.seconds, self.steps = seconds, pictures

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
