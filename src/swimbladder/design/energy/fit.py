"""A pump's power law and delivery from runs that a vehicle logged, and how sure they are.

Each run of the pump against a pressure p over a time t, at a temperature T, has::

    mean power     P = idle + per_pressure p + per_kelvin (T - 15 degC) - lost_energy/t
    volume         V = (delivery - slip p) t - start_volume

Which of the two was commanded, time or volume, is read off the runs: volumes that spread far less
than the times were, as those of gliders that always pump the same. The times are what errs then,
and the volumes are the instruments (instrumental variables): what the law leaves over goes neither
with the volumes nor with the volumes times the pressures.

No pump gives more under pressure or at its start than without: a slip or a start's loss below 0 is
none, and the rest is solved without it.

Where the battery's voltage U under load was logged too, the power is that times U/U_ref, U_ref the
runs' median: at one pressure a motor draws the same current, and turns as fast as its voltage lets
it (steady torque and back EMF of a motor at full voltage). A driver that holds the speed undoes
that, so the voltage counts only where dives are predicted better from the others with it than
without.

Both are linear in what is not known, and solved by least squares. What is lost at the start is in
them where runs of several lengths determine it; a power that was read at the end of a run has none.
Powers weigh by their time, so that the energy fits; volumes weigh alike, as a meter's error does.

How sure they are: least squares whose uncertainty holds where errors are shared within groups and
vary in size. Runs of one dive share what no column says (the battery, the oil, the weather), and
long runs err otherwise than short ones. So whole dives are left out one by one, and the numbers
that then come out give the covariance (the jackknife over clusters, CR3: R. M. Bell and D. F.
McCaffrey, Survey Methodology 28, 2002, 169). It holds for any correlation within dives and any
spread of the errors. Where few dives determine a number (only two went deep) the spread itself is
hardly known: its degrees of freedom, for the quantiles of Student's t, are Satterthwaite's, as
these authors have it, for errors of equal size that dives share in the proportion found.

`fitted_vehicle` is a vehicle with the pump identified, `run_columns` what the law says of each run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from scipy.special import stdtrit

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.estimates import Estimate
from swimbladder.io.answers import Answer, as_json, attributes
from swimbladder.io.pump_runs import PumpRuns
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.steady_drives import REFERENCE_TEMPERATURE
from swimbladder.vehicle import PowerLawPump, PumpAndValve, Supply, Vehicle
from swimbladder.vehicle.schema import check_choice

FEWEST = 3  # dives, or runs without dives: fewer leave no spread to be known
_LET_IN = 0.1  # of the usual volume: less below 0 is a meter's noise
_IDLE = 2e-3  # of the energy: less work is no pump's, whose worst measured runs do 4 %
_DEEP = 2e5  # Pa: nearer to the surface the hydraulic work is next to none


def check_runs(runs: PumpRuns, kept: Flags, *, depth_limit: float | None) -> None:
    """Raise InputError where runs do more work on the sea than they take, or next to none, or go
    too deep.

    depth_limit: of the vehicle [m]. All mean a wrong unit: of pressure, volume, power or time.
    """
    if runs.volume is not None:
        deep = kept & np.isfinite(runs.volume) & (runs.pressure > _DEEP)
        work = float(np.sum((runs.pressure * runs.volume)[deep]))
        energy = float(np.sum((runs.power * runs.duration)[deep]))
        if deep.sum() >= FEWEST and (work > energy or 0.0 < work < _IDLE * energy):
            done = f"{work:.3g} J of work against the sea for {energy:.3g} J from the battery"
            what = f"the runs would do {done}, {work / energy:.3g} times as much"
            wrong = "Pressure, volume, power or time is in the wrong unit"
            how = '`columns={"pressure_Pa": "NAME@dbar", "volume_m3": "NAME@mL"}`'
            remedy = f"{wrong}: state it, as in {how}"
            raise _wrong_pressure(what, float(np.max(runs.pressure[deep])), remedy)
    deepest = float(np.max(runs.pressure[kept], initial=0.0))
    if depth_limit is not None and deepest > 1.5 * 1e4 * depth_limit:
        rated = f"the vehicle is rated for {depth_limit:g} m (hull.depth_limit)"
        what = f"the greatest pressure is that of {deepest / 1e4:.5g} m, and {rated}"
        remedy = 'State the unit of the pressure: `columns={"pressure_Pa": "NAME@dbar"}`'
        raise _wrong_pressure(what, deepest, remedy)


def _wrong_pressure(what: str, pressure: float, remedy: str) -> InputError:
    return InputError(what, field="pressure_Pa", unit="Pa", value=pressure, remedy=remedy)


def _let_in(runs: PumpRuns, kept: Flags) -> Flags:
    """Return which runs let volume in, which no pump does: those of a valve.

    Raises InputError where these are most: a sign is wrong.
    """
    if runs.volume is None or not (known := kept & np.isfinite(runs.volume)).any():
        return np.zeros(kept.size, dtype=bool)
    usual = float(np.median(np.abs(runs.volume[known])))
    found = known & (runs.volume < -_LET_IN * usual)
    if 2 * found.sum() > known.sum():
        what = f"{int(found.sum())} of {int(known.sum())} runs let volume in, which no pump does"
        remedy = "Choose the pump's rows with `where=`, or turn the column's sign"
        value = float(np.min(runs.volume[found]))
        raise InputError(what, field="volume_m3", unit="m3", value=value, remedy=remedy)
    return found


def _first(runs: PumpRuns) -> Flags:
    """Return which runs are not there already, equal in everything but the dive's number."""
    names = ("duration", "pressure", "power", "volume", "temperature", "voltage", "time")
    columns = [column for name in names if (column := getattr(runs, name)) is not None]
    _, first = np.unique(np.nan_to_num(columns, nan=-1.0), axis=1, return_index=True)
    return np.isin(np.arange(runs.duration.size), first)


def check_groups(runs: PumpRuns, kept: Flags, groups: Array) -> None:
    """Raise NoAnswerError or InputError where runs are too few, too alike or of no sea."""
    what = "runs" if runs.dive is None else "dives"
    if len(groups) < FEWEST:
        few = f"{len(groups)} {what} with duration, pressure and power are too few"
        raise NoAnswerError(f"{few} to show how sure a power law is: log {FEWEST} or more")
    pressure = runs.pressure[kept]
    span = float(np.ptp(pressure))
    if span < 1e4:
        why = "nothing shows how power and delivery depend on pressure"
        within = f"all runs are within {span / 1e4:.2g} dbar"
        raise NoAnswerError(f"{within}: {why}. Log runs at several depths")
    if np.any(pressure < -2e5) or np.any(pressure > 1.2e8):
        worst = float(pressure[np.argmax(np.abs(pressure))])
        remedy = 'State its unit: `columns={"pressure_Pa": "NAME@dbar"}`'
        raise _wrong_pressure("no pressure of a sea", worst, remedy)


class Least(NamedTuple):
    """A weighted least-squares solution, and those without each cluster."""

    solution: Array
    std: Array
    freedom: Array  # degrees of freedom of each std
    residual: Array
    without: dict[float, Array]

    @classmethod
    def of(
        cls, A: Array, y: Array, weight: Array, cluster: Array, instruments: Array | None = None
    ) -> Least:
        """Return the solution of A x = y [n, k], rows weighted and in clusters [n].

        instruments: to what y - A x is orthogonal, where A errs [n, k]; None: to A. Raises
        NoAnswerError where the rows, or those without one cluster, do not determine x.
        """
        root = np.sqrt(weight / weight.mean())
        scale = np.abs(A).max(axis=0)
        B, b = A / scale * root[:, None], y * root
        if np.linalg.matrix_rank(B) < B.shape[1]:
            alike = "the runs do not distinguish power and delivery by pressure and duration"
            raise NoAnswerError(f"{alike}: log runs at several depths and of several lengths")
        Z = None if instruments is None else instruments * root[:, None]
        inverse = _inverse(B, Z)
        numbers = np.unique(cluster)
        member = (cluster[:, None] == numbers).astype(float)  # runs x clusters
        apart = np.empty((len(numbers), B.shape[1], len(b)))  # from the errors to the differences
        for g, number in enumerate(numbers):
            others = cluster != number
            if np.linalg.matrix_rank(B[others]) < B.shape[1]:
                only = f"only dive {number:g} shows how the numbers depend on pressure"
                why = "without another one at its depth nothing says how sure they are"
                raise NoAnswerError(f"{only}: {why}. Log a second one")
            apart[g] = -inverse
            apart[g][:, others] += _inverse(B[others], None if Z is None else Z[others])
        solution = inverse @ b
        residual = b - B @ solution
        moved = apart @ b
        G = len(numbers)
        std = np.sqrt((G - 1.0) / G * np.sum(moved**2, axis=0))
        shared = _shared(residual, member)
        freedom = np.array([_freedom(apart[:, k], member, shared) for k in range(B.shape[1])])
        without = {float(n): (solution + d) / scale for n, d in zip(numbers, moved, strict=True)}
        found = solution / scale
        return cls(found, std / scale, freedom, y - A @ found, without)


def _inverse(B: Array, Z: Array | None) -> Array:
    """Return what solves B x = b [n, k] with an error orthogonal to Z, or to B [k, n]."""
    return np.asarray(np.linalg.pinv(B) if Z is None else np.linalg.solve(Z.T @ B, Z.T))


def _shared(residual: Array, member: Array) -> float:
    """Return the variance that runs of a dive share over that of each run [-], 0 or above."""
    size = member.sum(axis=0)
    mean = member.T @ residual / size
    within = float(np.sum((residual - member @ mean) ** 2))
    spare = len(residual) - len(size)
    if spare < 1 or within == 0.0:
        return 0.0
    own = within / spare
    between = float(np.sum(size * mean**2)) / max(len(size) - 1, 1)
    return max((between / own - 1.0) / float(size.mean()), 0.0)


def _freedom(apart: Array, member: Array, shared: float) -> float:
    """Return Satterthwaite's degrees of freedom of a number's jackknife variance, at least 1.

    apart: how the number without each cluster depends on the errors [clusters, runs].
    """
    together = apart @ member
    M = apart @ apart.T + shared * together @ together.T
    return max(float(np.trace(M) ** 2 / np.sum(M * M)), 1.0)


PowerAt = Literal["mean", "end"]
_BLOCKS = 300  # groups of runs without dives, at most
_POWER = {
    "idle_power": "W",
    "power_per_pressure": "W/Pa",
    "power_per_temperature": "W/K",
    "lost_energy": "J",
}
_VOLUME = {"delivery": "m3/s", "slip": "m3/s/Pa", "start_volume": "m3"}
_UNITS = _POWER | _VOLUME
_VOLTS = 0.005  # relative deviation of the voltages that shows whether power depends on them
_ENOUGH = 15  # runs, five for each of three numbers, that may determine what a start loses
_OFF, _VOLUMES_OFF = 0.1, 0.25  # of a dive's energy, and of its volume
_ONE_IN = 10  # dives that may be off
_CAUSES = "Look for two pumps, another battery, or a column of other runs or in another unit"
_POSITIVE = {
    "delivery": (1e6, "mL/s", "volumes do not go with the times of the runs"),
    "idle_power": (1.0, "W", "no pump runs on that"),
}
"""What is above 0 for sure of any pump: factor and unit it is shown in, and what it means else."""
_INSEPARABLE = "runs at {:.3g} to {:.3g} MPa do not separate it from what grows with the pressure"
_SEAS_SHARE = 0.5  # of what the sea takes: a power that rises by less is not this pump's
_LESS = "that is less than half of the work on the sea, so powers do not go with the pressures"
_WEAKEST = 0.2  # of what more pressure takes; the measured pumps of gliders reach 0.38 and more
_WASTED = (
    "of what more pressure takes, {:.2g} % at most would reach the water (pumps: 30 to 90 %). "
    "Pressures or volumes are up to {:.2g} times too small, or powers or times too large: state "
    "their units"
)
_VAGUE = 2.0  # of the power at the greatest pressure: how wide the interval may be there
_OPEN = "the runs do not determine how it goes with the pressure"
_KNOWN = 0.8  # share of the runs with a temperature or voltage, for it to count
_WARM = 0.5  # K, standard deviation of the temperatures that shows a dependence on them
_ALIKE = 0.5  # times the relative spread of the times, that of volumes that were commanded
_LENGTHS = 0.1  # relative standard deviation of the durations that determines what a start loses


def _off(what: str, dives: Mapping[float, tuple[float, float]], share: float) -> str:
    """Return that dives, each (predicted by the others, measured), are too far off; else empty."""
    off = {dive: abs(by / own - 1.0) for dive, (by, own) in dives.items() if own > 0.0}
    wrong = [dive for dive in off if off[dive] > share]
    if len(wrong) <= len(off) // _ONE_IN:
        return ""
    worst = max(wrong, key=lambda dive: off[dive])
    said = f"the {what} of {len(wrong)} of {len(off)} dives is not what the others say"
    by = f"that of dive {worst:.12g} is off by {100.0 * off[worst]:.0f} %"
    return f"no one power law holds: {said}, {by}. {_CAUSES}"


class Predicted(NamedTuple):
    """A dive as it was, and as the other dives say it should have been."""

    dive: float
    runs: int
    deepest: float  # Pa, greatest pressure
    energy: float  # J
    predicted: float  # J
    volume: float  # m3, NaN where it was not measured
    predicted_volume: float  # m3


_DIVE = "dive runs deepest_Pa energy_J predicted_J volume_m3 predicted_volume_m3"
_ESTIMATE = "value std ci95 unit"
_BAND = "runs pressure_Pa volume_m3 energy_J efficiency fitted_efficiency=fitted"


@dataclass(frozen=True, kw_only=True)
class PumpFit(Answer):
    """The fit to runs of a pump."""

    runs: PumpRuns
    kept: Flags  # the runs that count
    parameters: dict[str, Estimate]
    power_rms: float  # W, of the powers
    volume_rms: float  # m3, of the volumes; NaN without
    clusters: int  # dives, or runs without dives
    dives: tuple[Predicted, ...] = field(default=())  # each from all the others
    without: dict[float, dict[str, float]] = field(default_factory=dict)  # numbers without a dive
    reference_voltage: float | None = None  # V, at which the powers hold; None: whatever it was
    by_volume: bool = False  # whether the volumes of runs were commanded, not their times

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers of the fit: parameters with their 95 %, and the dives."""
        return {
            "runs": int(self.kept.sum()),
            "excluded": int((~self.kept).sum()),
            **attributes(
                self, "clusters power_rms_W volume_rms_m3 reference_voltage_V by_volume refusal"
            ),
            "parameters": {n: as_json(e, _ESTIMATE) for n, e in self.parameters.items()},
            "dives": [as_json(dive, _DIVE) for dive in self.dives],
            "efficiency": [as_json(band, _BAND) for band in efficiency_bands(self)],
        }

    def value(self, name: str) -> float:
        """Return a number, 0 where it was not among the unknown ones."""
        found = self.parameters.get(name)
        return 0.0 if found is None else found.value

    @property
    def refusal(self) -> str:
        """Why the numbers are those of no pump, or dives are not as the others say. Else empty."""
        for name, (factor, unit, why) in _POSITIVE.items():
            if (e := self.parameters.get(name)) is not None and not e.ci95[0] > 0.0:
                low, value, high = (f"{factor * x:.3g}" for x in (e.ci95[0], e.value, e.ci95[1]))
                what = f"the {name.replace('_', ' ')} comes out as {value} {unit}"
                what += f", and {low} to {high} within 95 %"
                if name == "idle_power" and e.ci95[1] > 0.0:
                    ends = (1e-6 * f(self.runs.pressure[self.kept]) for f in (np.min, np.max))
                    return f"{what}: {_INSEPARABLE.format(*ends)}. Log runs at other depths too"
                return f"{what}: {why}. {_CAUSES}"
        energies = {d.dive: (d.predicted, d.energy) for d in self.dives}
        volumes = {d.dive: (d.predicted_volume, d.volume) for d in self.dives}
        if off := _off("energy", energies, _OFF) or _off("volume", volumes, _VOLUMES_OFF):
            return off
        e, deepest = self.parameters["power_per_pressure"], np.max(self.runs.pressure[self.kept])
        (least, most), there = e.ci95, self.value("idle_power") + e.value * deepest
        given = self.parameters.get("delivery")
        if given is not None and (pressed := given.ci95[1]) < _WEAKEST * least:
            return _WASTED.format(100.0 * pressed / least, least / pressed)
        work = _SEAS_SHARE * self.value("delivery") * deepest
        none = not most * deepest > max(work, _IDLE * there)
        if none or (most - least) * deepest > _VAGUE * abs(there):
            what = f"the power rises by {1e6 * least:.3g} to {1e6 * most:.3g} W per MPa within 95 %"
            return f"{what}: {_LESS if none else _OPEN}. {_CAUSES}"
        known = np.array([]) if self.runs.volume is None else self.runs.volume[self.kept]
        usual = math.sqrt(np.nanmean(known**2)) if np.isfinite(known).any() else math.nan
        if self.volume_rms > _VOLUMES_OFF * usual:
            what = f"volumes are off the law by {1e6 * self.volume_rms:.3g} mL rms"
            return f"{what} of {1e6 * usual:.3g} mL: they do not go with the times. {_CAUSES}"
        return ""

    @property
    def voltage_share(self) -> Array:
        """Return each run's voltage over the reference [n], 1 where it is not known or counts."""
        return _share(self.runs, self.reference_voltage)


def fit_pump(
    runs: PumpRuns,
    *,
    power_at: PowerAt = "mean",
    min_run_time: float = 0.0,
    depth_limit: float | None = None,
    start: bool = True,
    temperature: bool = True,
    voltage: bool = True,
) -> PumpFit:
    """Fit power law and delivery of a pump to its runs.

    Parameters
    ----------
    runs
        As `read_pump_runs` returns them.
    power_at
        Whether a run's power is its mean ("mean") or was read at its end ("end").
    min_run_time
        Runs shorter than this are left out [s].
    depth_limit
        Of the vehicle [m]; none: pressures are not compared with it.
    start, temperature
        Whether the terms of a start and of temperature may be fitted, where the runs can determine
        them.
    voltage
        Whether the battery's may count, where it predicts dives better; runs without one are taken
        as at the reference.

    Returns
    -------
    PumpFit
        The numbers with their intervals, and each dive predicted from all others.

    Raises
    ------
    InputError
        The runs are in a wrong unit, as `check_runs` finds it, or there is no such `power_at`.
    NoAnswerError
        The runs cannot determine what is asked; the message names what lacks.
    """
    check_choice(power_at, get_args(PowerAt), "a power is not read then", field="power_at")
    kept = np.isfinite([runs.duration, runs.pressure, runs.power]).all(axis=0)
    kept &= (runs.duration > 0.0) & (runs.duration >= min_run_time)
    kept &= runs.power != 0.0  # which no run takes: it was not measured
    kept &= ~_let_in(runs, kept) & _first(runs)
    check_runs(runs, kept, depth_limit=depth_limit)
    dive = _blocks(kept.size) if runs.dive is None else runs.dive
    kept &= np.isfinite(dive)
    warm = _warm(runs, kept) if temperature else None
    if warm is not None:
        kept &= np.isfinite(warm)
    lasted = runs.duration[kept]  # enough, and of different lengths, where a start's loss shows
    start &= bool(lasted.size >= _ENOUGH and np.std(lasted) > _LENGTHS * np.mean(lasted))
    end = power_at == "end"
    fitted = {"power_per_temperature": warm is not None, "lost_energy": start and not end}
    names = [name for name in _POWER if fitted.get(name, True)]
    weight = np.ones(kept.size) if end else runs.duration
    groups = np.unique(dive[kept])
    check_groups(runs, kept, groups)
    dive = np.where(kept, dive, np.nan)
    powers = _Law.of(_columns(runs, names, None), runs.power, weight, dive)
    reference = _reference(runs, kept) if voltage else None
    if reference is not None:
        scaled = _Law.of(_columns(runs, names, reference), runs.power, weight, dive)
        better = scaled.missed < powers.missed
        powers, reference = (scaled, reference) if better else (powers, None)
    laws, volume = [powers], np.full(kept.size, np.nan) if runs.volume is None else runs.volume
    measured, by_volume = kept & np.isfinite(volume), False
    if volume[measured].any():
        measured &= volume != 0.0  # likewise
    if len(np.unique(dive[measured])) >= FEWEST:
        by_volume = _by_volume(runs, volume, measured)
        dive = np.where(measured, dive, np.nan)
        laws.append(_delivery(runs, volume, dive, start, by_volume))
    rms = [float(np.sqrt(np.mean(law.found.residual**2))) for law in laws]
    parameters: dict[str, Estimate] = {}
    without: dict[float, dict[str, float]] = {float(number): {} for number in groups}
    for law in laws:
        parameters |= _estimates(law.names, law.found)
        for number, x in law.found.without.items():
            without[number] |= dict(zip(law.names, x.tolist(), strict=True))
    dives = () if runs.dive is None else tuple(_predicted(runs, laws, number) for number in groups)
    return PumpFit(
        runs=runs,
        kept=kept,
        parameters=parameters,
        clusters=len(groups),
        dives=dives,
        power_rms=rms[0],
        volume_rms=(*rms, math.nan)[1],
        without=without,
        reference_voltage=reference,
        by_volume=by_volume,
    )


def _columns(runs: PumpRuns, names: Iterable[str], reference: float | None) -> dict[str, Array]:
    """Return what each number of a law counts by in each run [n]; nan where that lacks.

    reference: voltage [V] that powers go with.
    """
    t, p, share = runs.duration, runs.pressure, _share(runs, reference)
    T = np.full(t.size, np.nan) if runs.temperature is None else runs.temperature
    started = np.divide(1.0, t, out=np.zeros(t.size), where=t > 0.0)
    known = {
        "idle_power": share,
        "power_per_pressure": p * share,
        "power_per_temperature": (T - REFERENCE_TEMPERATURE) * share,
        "lost_energy": -started * share,
        "delivery": t,
        "slip": -p * t,
        "start_volume": -np.ones(t.size),
    }
    return {name: known[name] for name in names}


class _Law(NamedTuple):
    """A linear law fitted to some of the runs: `measured` of these, `rows` of all."""

    names: list[str]
    rows: Flags
    dive: Array
    measured: Array
    found: Least
    predicted: Array  # by the other dives
    missed: float  # weighted squares of what the runs are off that

    @classmethod
    def of(
        cls,
        columns: Mapping[str, Array],
        measured: Array,
        weight: Array,
        dive: Array,
        instruments: Mapping[str, Array] | None = None,
    ) -> _Law:
        """Return the law of what was measured, columns by the numbers that they are for [n].

        dive [n]: nan for the runs that do not count. instruments: as `Least.of` has them.
        """
        rows = np.isfinite(dive)
        A = np.column_stack([*columns.values()])[rows]
        Z = None if instruments is None else np.column_stack([*instruments.values()])[rows]
        y, weight, dive = measured[rows], weight[rows], dive[rows]
        found = Least.of(A, y, weight, dive, Z)
        numbers = np.array([found.without[float(number)] for number in dive])
        predicted = np.sum(A * numbers, axis=1)
        missed = float(weight @ (y - predicted) ** 2)
        return cls([*columns], rows, dive, y, found, predicted, missed)


def _by_volume(runs: PumpRuns, volume: Array, rows: Flags) -> bool:
    """Whether runs were commanded by their volume rather than by their time."""
    V, t = volume[rows], runs.duration[rows]
    return bool(np.std(V) * np.mean(t) < _ALIKE * np.std(t) * np.mean(V))


def _delivery(runs: PumpRuns, volume: Array, dive: Array, start: bool, by_volume: bool) -> _Law:
    """Return the law of the volumes [n] that were pressed out. dive: as `_Law.of` has it."""
    rows, even = np.isfinite(dive), np.ones(dive.size)
    given = volume[rows] if by_volume else runs.duration[rows]
    start &= bool(np.std(given) > _LENGTHS * np.mean(given))
    names = [name for name in _VOLUME if start or name != "start_volume"]
    while True:
        columns, by = _columns(runs, names, None), None
        if by_volume:
            known = {"delivery": volume, "slip": -runs.pressure * volume, "start_volume": -even}
            by = {name: known[name] for name in names}
        law = _Law.of(columns, volume, even, dive, by)
        sure = law.found.solution / np.maximum(law.found.std, 1e-300)
        least = int(np.argmin(np.where(np.array(names) == "delivery", np.inf, sure)))
        if names[least] == "delivery" or sure[least] >= 0.0:
            return law
        names.pop(least)


def _reference(runs: PumpRuns, kept: Flags) -> float | None:
    """Return the median voltage [V] of the runs, None where too few have one or it is the same."""
    if runs.voltage is None:
        return None
    volts = runs.voltage[kept & (runs.voltage > 0.0)]
    if volts.size < _KNOWN * kept.sum() or np.std(volts) < _VOLTS * np.mean(volts):
        return None
    return float(np.median(volts))


def _share(runs: PumpRuns, reference: float | None) -> Array:
    if runs.voltage is None or reference is None:
        return np.ones(runs.duration.size)
    return np.where(runs.voltage > 0.0, runs.voltage / reference, 1.0)


def _estimates(names: list[str], found: Least) -> dict[str, Estimate]:
    reach = np.asarray(stdtrit(found.freedom, 0.975), dtype=np.float64) * found.std
    rows = zip(names, *(x.tolist() for x in (found.solution, found.std, reach)), strict=True)
    return {name: Estimate.of(x, std, _UNITS[name], reach=r) for name, x, std, r in rows}


def _predicted(runs: PumpRuns, laws: list[_Law], number: float) -> Predicted:
    """Return a dive as it was and as the others have it, by the laws of powers and of volumes."""
    powers, *others = laws
    own = powers.dive == number
    t, p = (values[powers.rows][own] for values in (runs.duration, runs.pressure))
    energy = float((powers.measured[own] * t).sum())
    predicted = float((np.maximum(powers.predicted[own], 0.0) * t).sum())
    volumes = [math.nan, math.nan]
    for law in others:
        within = law.dive == number
        if within.any():
            expected = np.maximum(law.predicted[within], 0.0)
            volumes = [float(law.measured[within].sum()), float(expected.sum())]
    return Predicted(float(number), int(own.sum()), float(p.max()), energy, predicted, *volumes)


def _blocks(count: int) -> Array:
    """Return runs that no column groups as groups of one; of neighbours where they are many."""
    return np.asarray(np.floor(np.arange(count) * min(1.0, _BLOCKS / max(count, 1))))


def _warm(runs: PumpRuns, kept: Flags) -> Array | None:
    """Return the temperatures [degC] where they show a dependence, None otherwise."""
    T = runs.temperature
    if T is None:
        return None
    known = kept & np.isfinite(T)
    if known.sum() < _KNOWN * kept.sum() or np.std(T[known]) < _WARM:
        return None
    return T


_BANDS, _FEWEST = 8, 3  # bands of pressure at most, and runs in each at least


class Band(NamedTuple):
    """Runs of neighbouring pressures together; fitted: by the law, nan without volumes."""

    runs: int
    pressure: float  # Pa, mean
    volume: float  # m3 a run
    energy: float  # J a run
    efficiency: float  # -, work on the sea p dV over the electrical energy, sums of both
    fitted: float  # -


def _fitted(fit: PumpFit, law: Mapping[str, str]) -> Array:
    """Return what a law says of each run [n]; nan where it lacks something."""
    names = [name for name in law if name in fit.parameters]
    columns = _columns(fit.runs, names, fit.reference_voltage)
    parts = [fit.value(name) * column for name, column in columns.items()]
    return np.sum(parts, axis=0) if parts else np.full(fit.kept.size, np.nan)


def run_columns(fit: PumpFit) -> dict[str, Array]:
    """Return a row a run, in the order of the log: its numbers, and what the law says of them.

    energy_J is power times duration; efficiency the work on the sea, pressure times volume, over
    it. Of a power that was read at the end of a run both hold as far as it was steady.
    """
    r = fit.runs
    nothing = np.full(r.duration.size, np.nan)
    volume = nothing if r.volume is None else r.volume
    energy, pressed = r.power * r.duration, _fitted(fit, _VOLUME)
    fitted = _fitted(fit, _POWER) * r.duration
    return {
        "time_s": nothing if r.time is None else r.time,
        "dive": nothing if r.dive is None else r.dive,
        "pressure_Pa": r.pressure,
        "duration_s": r.duration,
        "volume_m3": volume,
        "energy_J": energy,
        "efficiency": _ratio(r.pressure * volume, energy),
        "fitted_volume_m3": pressed,
        "fitted_energy_J": fitted,
        "fitted_efficiency": _ratio(r.pressure * pressed, fitted),
        "counts": fit.kept.astype(float),
    }


_SUMMED = ("pressure_Pa", "volume_m3", "energy_J", "fitted_volume_m3", "fitted_energy_J")


def efficiency_bands(fit: PumpFit) -> list[Band]:
    """Return volume, energy and efficiency over pressure: bands of as many runs each.

    Only runs that count and have a volume; none where they are too few.
    """
    columns = run_columns(fit)
    good = np.flatnonzero(fit.kept & np.isfinite(columns["volume_m3"]))
    order = good[np.argsort(columns["pressure_Pa"][good], kind="stable")]
    count = min(_BANDS, len(order) // _FEWEST)
    found = []
    for rows in np.array_split(order, count) if count else ():
        p, v, e, v_fit, e_fit = (columns[name][rows] for name in _SUMMED)
        shares = _ratio(np.array([p @ v, p @ v_fit]), np.array([e.sum(), e_fit.sum()])).tolist()
        means = float(p.mean()), float(v.mean()), float(e.mean())
        found.append(Band(len(rows), *means, *shares))
    return found


def _ratio(a: Array, b: Array) -> Array:
    return np.asarray(np.divide(a, b, out=np.full(b.shape, np.nan), where=b > 0.0))


def voltage_factor(supply: Supply | None, fit: PumpFit) -> float:
    """Return a supply's voltage under the runs' median current over the fit's reference [-].

    1 without a supply, and where the voltage does not count. Raises InputError where that current
    takes all of the supply's voltage.
    """
    if supply is None or fit.reference_voltage is None:
        return 1.0
    volts = fit.reference_voltage * fit.voltage_share[fit.kept]
    current = float(np.median(fit.runs.power[fit.kept] / volts))
    left = supply.voltage - supply.internal_resistance * current
    if left <= 0.0:
        what = f"the runs' median current, {current:.3g} A, takes all of the supply's"
        what, place = f"{what} {supply.voltage:g} V", "supply.internal_resistance"
        ohm, remedy = supply.internal_resistance, "State that of the battery that runs the pump"
        raise InputError(what, field=place, unit="ohm", value=ohm, remedy=remedy)
    return left / fit.reference_voltage


def pump_and_valve(vehicle: Vehicle) -> PumpAndValve:
    """Return the actuator of a vehicle that has a pump; raises InputError for another."""
    if not isinstance(actuator := vehicle.engine, PumpAndValve):
        what, kind = "a pump that runs or not is no part of this actuator", vehicle.actuator.kind
        remedy = "Give a vehicle of kind pump-valve, or none"
        raise InputError(what, field="actuator.kind", value=kind, remedy=remedy)
    return actuator


def fitted_vehicle(vehicle: Vehicle, fit: PumpFit) -> Vehicle:
    """Return a pump-and-valve vehicle with the pump identified from runs.

    A slip, start loss or warmth below 0 is not distinguishable from none, and taken as 0. Without
    measured volumes delivery, slip and start loss stay, where the vehicle has a power law. Logged
    pressures are the sea's above the atmosphere, and the pump beats besides what the reservoir's
    gas lacks of an atmosphere. Where the power goes with the voltage, so does the speed: power and
    measured delivery are those at the vehicle's supply, see `voltage_factor`; slip goes with the
    pressure alone.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    fit
        As `fit_pump` returns it.

    Returns
    -------
    Vehicle
        The vehicle with the pump of the fit.

    Raises
    ------
    InputError
        The vehicle has another actuator, or nothing has a delivery.
    NoAnswerError
        The fit has a `refusal`.
    """
    a = pump_and_valve(vehicle)
    if fit.refusal:
        raise NoAnswerError(fit.refusal)
    old = a.pump if isinstance(a.pump, PowerLawPump) else None
    known = "delivery" in fit.parameters
    if not known and old is None:
        kept = "without measured volumes the pump of the vehicle keeps its delivery"
        what = f"{kept}, and one from datasheets has none to keep"
        other = "give the vehicle's pump as kind power-law, or leave the vehicle out"
        remedy = f"Log the volume of each run, {other}"
        raise InputError(what, field="volume_m3", remedy=remedy)
    lack = ATMOSPHERIC_PRESSURE - a.internal_pressure
    factor = voltage_factor(vehicle.supply, fit)
    slip, per_pressure = max(fit.value("slip"), 0.0), max(fit.value("power_per_pressure"), 0.0)
    per_pressure, delivery = factor * per_pressure, factor * fit.value("delivery")
    pump = PowerLawPump(
        delivery=delivery + slip * lack if known or old is None else old.delivery,
        slip=slip if known or old is None else old.slip,
        idle_power=factor * fit.value("idle_power") - per_pressure * lack,
        power_per_pressure=per_pressure,
        power_per_temperature=factor * min(fit.value("power_per_temperature"), 0.0),
        stall_pressure=None if old is None else old.stall_pressure,
    )
    start = max(fit.value("start_volume"), 0.0) if known else a.start_volume
    actuator = a.model_copy(update={"pump": pump, "start_volume": start})
    return vehicle.model_copy(update={"actuator": actuator})
