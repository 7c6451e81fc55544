"""What an identification found, as it is shown: in plain words first, then the evidence.

Deep dives as they are shown: as measured and as predicted by the model, and the imbalance.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from swimbladder.errors import InputError, Parameter
from swimbladder.estimation.motion import NAMES, Estimate, Identification
from swimbladder.estimation.motion.deep import DeepIdentification
from swimbladder.estimation.motion.paper_method import PaperFits
from swimbladder.estimation.motion.posterior import Posterior
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show import estimates
from swimbladder.show import identification_plots as plots
from swimbladder.show.estimates import row
from swimbladder.show.identification_plots import labels
from swimbladder.show.parts import (
    Drawn,
    Gone,
    Labelled,
    Part,
    Shown,
    Table,
    labelled,
    severity,
    written_by,
)
from swimbladder.show.picture import Ink, Picture, grid_of
from swimbladder.sim.pool import Fit
from swimbladder.units import rounded, shown_unit, unit_factor

_SYMBOL = {"drag_quadratic": "k_dt", "mass": "m"}
PSI = {"free": "estimated", "prior": "with its prior", "set": "as set", "zero": "left out"}


def _plus_minus(e: Estimate) -> str:
    r = row("", e)
    return f"{r.value} +- {r.std}" if r.std else "-"


VEHICLE = "vehicle.toml"
POSTERIOR = "posterior.csv"
MARK = "Identified by swimbladder identify"


def check_folder(out: Path, vehicle: str | Path) -> None:
    """Raise InputError where writing into `out` would take a vehicle file that is not ours.

    A vehicle.toml of an earlier run is replaced, or taken away where it is not identified; the one
    that is read, or one that something else wrote, is left alone.
    """
    target = out / VEHICLE
    if not target.exists():
        return
    what = "there is a vehicle that `swimbladder identify` did not write"
    if Path(vehicle).exists() and target.samefile(vehicle):
        what = "the identified vehicle would be written over the one that is read"
    elif written_by(target, f"{MARK} "):
        return
    remedy = "Choose another folder with `out=`"
    raise InputError(what, file=target, field=Parameter("out"), remedy=remedy)


def _head(found: Identification) -> str:
    logs = [e.source for e in found.experiments]
    lines = [f"{MARK} from {len(logs)} log{'s' if len(logs) > 1 else ''}, 95 % intervals:"]
    for name in found.names:
        r = row(name, found.parameters[name])
        lines.append(f"  {name} = {r.value} +- {r.std} {r.unit} ({r.ci95})")
    return "\n".join(lines)


def residuals(found: Identification) -> dict[str, np.ndarray]:
    """Return the columns of residuals.csv, log after log, SI."""
    listed = []
    for number, e in enumerate(found.experiments, start=1):
        r, length = e.record, len(e.record.time)
        one = {"log": np.full(length, float(number)), "time_s": r.time, "depth_m": r.depth}
        one |= {"depth_fitted_m": e.predicted, "residual_m": e.residual, "weight": e.weight}
        for name, values in (("volume_m3", r.volume), ("voltage_V", r.voltage)):
            one[name] = np.full(length, np.nan) if values is None else values
        listed.append(one)
    columns = {name: np.concatenate([one[name] for one in listed]) for name in listed[0]}
    for name in ("volume_m3", "voltage_V"):
        if not np.isfinite(columns[name]).any():
            del columns[name]
    return columns


def _singles(paper: PaperFits | None) -> dict[str, list[tuple[float, float]]]:
    """Return the paper's gains of single logs as draw_gains takes them."""
    each = () if paper is None else paper.each
    named = {
        "paper, eq. (26)": [(f.step, f.by_speed) for f in each],
        "paper, eq. (27)": [(f.step, f.by_depth) for f in each],
    }
    points = {
        name: [(step, fit.K2) for step, fit in fits if fit is not None]
        for name, fits in named.items()
    }
    return {name: found for name, found in points.items() if found}


def _pages(
    found: Identification, name: str, draw: Callable[[Identification, int], Picture]
) -> list[Drawn]:
    """Return one picture for each so many logs."""
    count = len(found.experiments)
    firsts = range(0, count, plots.PER_PAGE)
    if len(firsts) == 1:
        return [Drawn(name, partial(draw, found, 0), name)]
    parts = [f", logs {n + 1} to {min(n + plots.PER_PAGE, count)}" for n in firsts]
    return [
        Drawn(f"{name}-{number}", partial(draw, found, first), name, part)
        for number, (first, part) in enumerate(zip(firsts, parts, strict=True), start=1)
    ]


class IdentificationShown(Shown[Identification]):
    """The answer first, then its basis.

    paper: the paper's fits, to stand beside ours; seconds: how long the fit took, 0: not known. No
    vehicle is written where the data do not identify all that was asked, and what an earlier run
    left goes.
    """

    name, folder = "identify", "figures/"
    paper: PaperFits | None = None
    seconds: float = 0.0

    @property
    def title(self) -> str:
        """The vehicle, and what came of it."""
        found, count = self.found, len(self.found.experiments)
        came = "identified" if found.identified else "not identified"
        return f"{found.result_vehicle.name}: {came} from {count} log{'s' if count > 1 else ''}"

    def before(self, out: Path) -> list[Path]:
        """Check that no other vehicle is written over."""
        check_folder(out, "")
        return []

    def numbers(self) -> Mapping[str, Any]:
        """Return what was found, and the paper's fits."""
        return {**self.found.to_dict(), "paper": self.paper and self.paper.to_dict()}

    def printed(self) -> Mapping[str, Any]:
        """Return what was found, and how long it took."""
        return {**self.numbers(), "seconds": self.seconds}

    def parts(self) -> Iterator[Part]:
        """Give what is printed: the answer first, then its basis."""
        found = self.found
        samples = sum(int((e.weight > 0.0).sum()) for e in found.experiments)
        count = len(found.experiments)
        logs = f"{count} log{'s' if count > 1 else ''}, {samples} samples"
        noise = f"{1e3 * found.depth_noise:.2g} mm of noise"
        if found.sensor_noise < _WHITE * found.depth_noise:
            noise += f" ({1e3 * found.sensor_noise:.2g} mm of them the sensor's)"
        took = f", {self.seconds:.2g} s" if self.seconds else ""
        yield f"{found.result_vehicle.name}, {logs}, {found.law} drag, {noise}{took}"
        if not found.identified:
            yield "Not identifiable from these logs:"
        yield from severity(found.findings, "no")
        yield from estimates.headlines(found)
        yield from severity(found.findings, "warning")
        yield _parameters(found)
        yield from severity(found.findings, "note")
        if found.posterior is not None:
            yield _posterior(found.posterior)
        for a, b, r in estimates.correlations(found):
            other = "so is the other" if r > 0.0 else "the other is too small"
            yield f"correlation of {a} and {b}: {r:+.2f}; where one is too large, {other}"
        if found.choices:
            yield _choices(found)
        yield from _pages(found, "fits", plots.draw_fits)
        yield _logs(found)
        if self.paper is not None:
            yield from (self.paper.sentence, _paper(self.paper, labels(found)))
        yield from self._pictures()
        yield from _process_noise(found)
        yield from labelled("assumed", found.assumptions)
        yield from labelled("note", estimates.reading(found, labels(found)))

    def _pictures(self) -> Iterator[Drawn]:
        found = self.found
        yield from _pages(found, "residuals", plots.draw_residuals)
        yield Drawn("distribution", partial(plots.draw_distribution, found))
        if found.identified and len(found.names) > 1:
            yield Drawn("ellipses", partial(plots.draw_ellipses, found))
        if found.identified and found.profiles:
            yield Drawn("profiles", partial(plots.draw_profiles, found))
        yield Drawn("neutral", partial(plots.draw_neutral, found))
        if found.identified and any(e.own_gain is not None for e in found.experiments):
            yield Drawn("gains", partial(plots.draw_gains, found, singles=_singles(self.paper)))

    def table(self) -> dict[str, np.ndarray]:
        """Return the columns of residuals.csv, log after log, SI."""
        return residuals(self.found)

    def files(self) -> dict[str, object]:
        """Return residuals, vehicle and draws of the posterior; what an earlier run had goes."""
        found = self.found
        files: dict[str, object] = {"residuals.csv": self.table(), VEHICLE: Gone(f"{MARK} ")}
        files |= {f"figures/{name}*.png": Gone() for name in _FIGURES}
        files[POSTERIOR] = Gone()
        if found.identified:
            files[VEHICLE] = vehicle_file(found.vehicle, head=_head(found))
        if found.posterior is not None:
            names = (f"{name} [{NAMES[name].unit}]" for name in found.posterior.names)
            files[POSTERIOR] = dict(zip(names, found.posterior.draws.T, strict=True))
        return files


_WHITE = 0.7  # of the noise: the sensor's part is said where it is less
_FIGURES = ("fits", "residuals", "distribution", "ellipses", "profiles", "neutral", "gains")


def _posterior(drawn: Posterior) -> Table:
    """Return median and interval of the draws."""
    rows = []
    for name in drawn.names:
        unit = NAMES[name].unit
        shown = shown_unit(unit)
        low, median, high = (x * unit_factor(unit, shown) for x in drawn.interval(name))
        rows.append((name, f"{median:.4g}", f"{low:.4g} to {high:.4g}", shown))
    return Table(("posterior", "median", "95 % of the draws", "unit"), rows)


def _parameters(found: Identification) -> Table:
    words = {"data": "the logs", "prior": "its prior", "set": "set"}
    rows = [(*r[:-1], words[r.origin]) for r in estimates.rows(found)]
    return Table(("", "value", "1 sigma", "95 % interval", "unit", "from"), rows)


def _choices(found: Identification) -> Table:
    """Return the same samples under every drag law, with psi and without."""
    best, rows = min(c.bic for c in found.choices), []
    for c in found.choices:
        drag = f"{c.drag}{' (reported)' if c.reported else ''}"
        worse = f"{c.bic - best:.1f}" if math.isfinite(c.bic) else "-"
        share = f"{100.0 * c.weight:.1f} %" if c.weight > 1e-4 else "below 0.01 %"
        values = (_value(name, value) for name, value in c.values.items() if found.identified)
        own = PSI[c.psi], str(c.parameters), f"{1e3 * c.rms:.2f} mm", worse, share
        rows.append((drag, *own, ", ".join(values)))
    headings = ["drag", "psi", "parameters", "rms", "BIC behind the best", "probability", "values"]
    return Table(headings, rows, ("drag", "values"), "Model comparison")


def _value(name: str, value: float) -> str:
    unit = NAMES[name].unit
    shown = value * unit_factor(unit, shown_unit(unit))
    if abs(shown) < 1e-9:  # a fit that ended at a bound, to rounding
        shown = 0.0
    return f"{_SYMBOL.get(name, name)} {rounded(shown)} {shown_unit(unit)}"


def _logs(found: Identification) -> Table:
    rows = []
    for label, e in zip(labels(found), found.experiments, strict=True):
        time, used = e.record.time, int((e.weight > 0.0).sum())
        off = f"{1e3 * e.rms:.1f}", f"{1e3 * e.noise:.2g}"
        p = f"{e.whiteness_p:.1g}" if e.whiteness_p > 1e-4 else "below 1e-4"
        white = "white" if e.whiteness_p > 0.01 else f"correlated (p {p})"
        neutral = _plus_minus(e.estimates["neutral_error"]), _plus_minus(e.drift)
        samples = f"{used} of {len(time)}", str(e.outliers)
        rows.append((label, f"{time[-1] - time[0]:.0f}", *samples, *off, white, *neutral))
    headings = ["log", "lasts\n[s]", "samples", "outliers", "rms\n[mm]", "noise\n[mm]", "residual"]
    headings += ["neutral-volume\nerror [cm3]", "its drift\n[cm3/h]"]
    return Table(headings, rows)


def _paper(paper: PaperFits, names: Sequence[str]) -> Table:
    """Return the paper's fits: each log, then the averages."""

    def fitted(label: str, step: float, fit: Any) -> tuple[str, ...]:
        numbers = _fitted(fit.by_speed, "mm/s"), _fitted(fit.by_depth, "mm")
        size = f"{1e6 * step:.3g}" if math.isfinite(step) else "-"
        return (label, size, *numbers[0], *numbers[1], getattr(fit, "why", ""))

    rows = [fitted(name, fit.step, fit) for name, fit in zip(names, paper.each, strict=True)]
    headings = ["log", "step\n[cm3]", "K2 by (26)\n[1/m2/s]", "T2 by (26)\n[s]", "residual"]
    headings += ["K2 by (27)\n[1/m2/s]", "T2 by (27)\n[s]", "residual", "not fitted, as"]
    rows.append(fitted("average", math.nan, paper))
    title = "The paper's way: each log fitted alone to eqs (26) and (27), then averaged"
    return Table(headings, rows, title=title)


def _fitted(fit: Fit | None, unit: str) -> list[str]:
    if fit is None:
        return ["-", "-", "-"]
    return [rounded(fit.K2), rounded(fit.T2, 3), f"{rounded(1e3 * fit.rms, 2)} {unit}"]


def _process_noise(found: Identification) -> Iterator[Part]:
    """Give how far each neutral volume went, and what the depth's noise is made of."""
    fit = found.process_noise
    if fit is None or fit.white:
        return
    noises = fit.noises
    headings = ("log", "neutral volume travelled [cm3]")
    went = [rounded(1e6 * x, 2) for x in fit.travelled]
    yield Table(headings, [*zip(labels(found), went, strict=True)], title="Process noise")
    yield (
        f"Of the depth's noise {rounded(1e3 * noises['depth_noise'].value, 2)} mm are white, and "
        f"{rounded(1e3 * noises['correlated'].value, 2)} mm last for "
        f"{rounded(noises['correlation_time'].value, 2)} s. The pictures of single logs show "
        "predictions from one sample to the next."
    )


_DIVES = (Ink.BLUE, Ink.ORANGE, Ink.GREEN, Ink.PURPLE, Ink.SKY, Ink.VERMILION)
_DBAR = 1e4  # Pa


def draw_deep(found: DeepIdentification) -> Picture:
    """Return pressure over time of every dive, and the imbalance of its volumes over pressure."""
    picture, (dives, imbalance) = grid_of((9.0, 7.0), 2, 1, letters=True)
    begin = 0.0
    for dive, color in zip(found.dives, cycle(_DIVES), strict=False):
        start, replay, pieces = dive.dive.time[0] - 3600.0 * begin, dive.replay, dive.dive.pieces
        hours = (dive.dive.time - start) / 3600.0
        dives.dots(hours, dive.dive.pressure / _DBAR, ".", color, "measured", size=3.0)
        again = (replay.time - start) / 3600.0, replay.pressure / _DBAR
        dives.line(*again, Ink.BLACK, "model from its first sample", width=0.9)
        name = dive.dive.name.rpartition("/")[2]
        off = pieces.pressure / _DBAR, 1e6 * dive.imbalance
        imbalance.dots(*off, ".", color, name, size=3.0)
        begin = float(hours[-1]) + 2.0
    dives.x, dives.y = "time [h], one dive after the other", "pressure [dbar]"
    limit = 1.1e6 * max(float(np.percentile(np.abs(t.imbalance), 99.5)) for t in found.dives)
    imbalance.rule("y", 0.0, Ink.BLACK)
    imbalance.ylim, imbalance.legend = (-limit, limit), "beside"
    imbalance.x, imbalance.y = "pressure [dbar]", "volume imbalance [cm³]"
    return picture


class DeepIdentificationShown(Shown[DeepIdentification]):
    """Parameters from deep dives; the vehicle of an earlier run goes where they are none.

    notes: of reading the logs.
    """

    name, kind = "deep", "deep dives"
    notes: Sequence[str] = ()

    def before(self, out: Path) -> list[Path]:
        """Check that no other vehicle is written over."""
        check_folder(out, "")
        return []

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        first, *others = self.found.sentences
        yield Labelled("no", first)
        yield from others
        yield from (self._parameters(), self._dives())
        yield Drawn("deep", partial(draw_deep, self.found))
        yield from (*labelled("assumed", self.found.assumptions), *labelled("note", self.notes))

    def _parameters(self) -> Table:
        words = {"data": "the dives", "prior": "its prior", "set": "set"}
        if self.found.inconsistent:
            words |= dict.fromkeys(("data", "prior"), "not identifiable")
        rows = []
        for name, e in self.found.parameters.items():
            r = row(name, e)
            sure = ("-", "-") if self.found.inconsistent else (r.std, r.ci95)
            rows.append((name, r.value, *sure, r.unit or "-", words[e.origin]))
        return Table(("", "value", "1 sigma", "95 % interval", "unit", "from"), rows)

    def _dives(self) -> Table:
        headings = ("dive", "samples", "deepest", "imbalance", "speed off by", "replay off by")
        rows = []
        for flown, numbers in zip(self.found.dives, self.found.to_dict()["dives"], strict=True):
            pressures = (numbers[name] / _DBAR for name in ("deepest_Pa", "replay_rms_Pa"))
            deepest, replay = (f"{pressure:.0f} dbar" for pressure in pressures)
            imbalance = f"{1e6 * numbers['imbalance_rms_m3']:.1f} mL"
            speed = f"{1e3 * numbers['speed_rms_m_s']:.1f} mm/s"
            samples = str(numbers["samples"])
            rows.append((flown.dive.name, samples, deepest, imbalance, speed, replay))
        return Table(headings, rows)

    def table(self) -> dict[str, Any]:
        """Return the columns of deep.csv: speeds and models of them, dive after dive."""
        parts = [(k, fits, fits.dive.pieces) for k, fits in enumerate(self.found.dives, start=1)]
        parted = {
            "dive": [np.full(len(p), float(k)) for k, _, p in parts],
            "time_s": [p.time for _, _, p in parts],
            "pressure_Pa": [p.pressure for _, _, p in parts],
            "speed_m_s": [p.speed for _, _, p in parts],
            "model_speed_m_s": [p.speed - fits.speed for _, fits, p in parts],
            "imbalance_m3": [fits.imbalance for _, fits, _ in parts],
        }
        return {name: np.concatenate(values) for name, values in parted.items()}

    def files(self) -> dict[str, object]:
        """Return deep.csv and, where identified, vehicle.toml."""
        files: dict[str, object] = {"deep.csv": self.table(), "vehicle.toml": Gone()}
        if self.found.identified:
            head = "\n".join([f"{MARK} from deep dives.", *self.found.sentences])
            files["vehicle.toml"] = vehicle_file(self.found.result_vehicle, head=head)
        return files
