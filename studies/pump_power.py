"""How well a power law tells what pumps drew: a float and gliders, each dive from the others.

``python -m studies.pump_power DATA`` prints the tables. DATA is the folder that has
``mermaid_p0051`` (an electrohydraulic float) and ``seaglider``; either may be missing. Numbers are
identified with `energy.fit_pump` on all dives but one, and tell that one's energy from the log's
run times, pressures, temperatures and, for the float, battery voltages alone. The gliders'
voltages spread too little, 0.4 to 2.3 %: with them SG180 and SG249 are told better, SG171 and the
booster of SG167 worse, so that they are left out for all of them.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from swimbladder.design.energy import PumpFit, PumpRuns, fit_pump
from swimbladder.errors import NoAnswerError
from swimbladder.io.pump_runs import joined_runs, moved, pressures, runs_of_events

__all__ = [
    "Bleeding",
    "Vehicle",
    "float_runs",
    "float_table",
    "glider_laws",
    "glider_runs",
    "glider_tables",
    "glider_valves",
    "main",
]

Array = NDArray[np.float64]
_NEAR = 120.0  # s between a run and the nearest pressure, where the run itself has none
_LONG = 20.0  # s, of a run whose power has settled: the float's own logs settle in 10 s
_SAGS = 0.97  # of the median voltage: a battery that rested for hours gives less at first
_STEADY = 8.0  # s, of a glider's run long enough to tell its rate of delivery
_SPLIT = 0.5  # share of the spread of rates that two pumps leave at most, where there are two
_BLED = 3e-6  # m3, less is no bleeding
_METRES = 1e4  # Pa of difference that tell an orifice


class Vehicle(NamedTuple):
    """A vehicle's runs, and the pressure above which a second pump takes over."""

    name: str
    runs: PumpRuns
    split: float | None  # Pa


def _seconds(times: pd.Series[pd.Timestamp]) -> Array:
    return np.asarray(times.to_numpy().astype("datetime64[ms]").astype("int64") / 1e3)


def float_runs(folder: Path) -> PumpRuns:
    """Return the controlled runs of the float: a mission stage, a power read at the end.

    Surfacing and filling the bladder (stage 99 or none) pump against a full bladder, not the sea.
    """
    actions = pd.read_csv(folder / "actions.csv.gz", parse_dates=["time"])
    track = pd.read_csv(folder / "pressure.csv.gz", parse_dates=["time"]).sort_values("time")
    runs = actions[
        (actions.device == "pump")
        & actions.stage.notna()
        & (actions.stage != 99)
        & actions.end_mV.notna()
    ]
    now, times = _seconds(runs.time), _seconds(track.time)
    after = np.clip(np.searchsorted(times, now), 1, len(times) - 1)
    gap = np.minimum(np.abs(times[after] - now), np.abs(now - times[after - 1]))
    along = np.interp(now, times, track.P_mbar * 100.0)
    pressure = np.where(runs.end_P_mbar.notna(), runs.end_P_mbar * 100.0, along)
    pressure = np.where(runs.end_P_mbar.notna() | (gap < _NEAR), pressure, np.nan)
    felt = track.T_mdegC.notna().to_numpy()
    temperature = np.interp(now, times[felt], track.T_mdegC[felt] * 1e-3)
    dive, _ = pd.factorize(runs.dive, sort=True)
    return PumpRuns(
        duration=runs.cmd_ms.to_numpy() * 1e-3,
        pressure=pressure,
        power=runs.end_mV.to_numpy() * 1e-3 * runs.end_uA.to_numpy() * 1e-6,
        temperature=temperature,
        dive=dive.astype(float),
        voltage=runs.end_mV.to_numpy() * 1e-3,
    )


def float_table(runs: PumpRuns) -> tuple[PumpFit, pd.DataFrame]:
    """Return the fit to the long runs and, dive by dive, measured and predicted energy [J].

    All controlled runs of a dive count in its energy, short ones too.
    """
    fitted = fit_pump(runs, power_at="end", min_run_time=_LONG)
    assert runs.dive is not None
    assert runs.temperature is not None
    rows = []
    usable = np.isfinite(runs.pressure) & np.isfinite(runs.power) & np.isfinite(runs.temperature)
    for number in np.unique(runs.dive[usable]):
        own = usable & (runs.dive == number)
        all_of_them = {name: e.value for name, e in fitted.parameters.items()}
        found = fitted.without.get(float(number), all_of_them)  # a dive without long runs told none
        power = (
            found["idle_power"]
            + found["power_per_pressure"] * runs.pressure[own]
            + found.get("power_per_temperature", 0.0) * (runs.temperature[own] - 15.0)
        ) * fitted.voltage_share[own]
        t = runs.duration[own]
        rows.append(
            (
                int(number),
                int(own.sum()),
                runs.pressure[own].max() / 1e4,
                float((runs.power[own] * t).sum()),
                float((power * t).sum()),
            )
        )
    table = pd.DataFrame(rows, columns=["dive", "runs", "deepest_dbar", "measured_J", "told_J"])
    return fitted, table.assign(error=table.told_J / table.measured_J - 1.0)


def _off(fit: PumpFit) -> Array:
    """Return what the float's powers are above its law [W], the runs that count."""
    r, kept = fit.runs, fit.kept
    assert r.temperature is not None
    told = fit.value("idle_power") + fit.value("power_per_pressure") * r.pressure[kept]
    told += fit.value("power_per_temperature") * (r.temperature[kept] - 15.0)
    return np.asarray(r.power[kept] - told * fit.voltage_share[kept])


def _only(runs: PumpRuns, rows: NDArray[np.bool_]) -> PumpRuns:
    def part(values: Array | None) -> Array | None:
        return None if values is None else values[rows]

    return PumpRuns(
        duration=runs.duration[rows],
        pressure=runs.pressure[rows],
        power=runs.power[rows],
        volume=part(runs.volume),
        temperature=part(runs.temperature),
        dive=part(runs.dive),
        voltage=part(runs.voltage),
        time=part(runs.time),
    )


def _events(folder: Path) -> pd.DataFrame:
    """Return every motor event of the gliders, with the volume by both potentiometers [m3]."""
    events = pd.read_parquet(folder / "gc_events.parquet")
    dives = pd.read_csv(folder / "dives.csv")
    columns = ["dive", "platform", "log_VBD_CNV", "avg_latitude"]
    e = events.merge(dives[columns], on="dive")
    volume, pressure = moved(e, e.log_VBD_CNV), pressures(e, e.avg_latitude)
    return e.assign(volume=volume, pressure=pressure)


def glider_runs(folder: Path) -> list[Vehicle]:
    """Return the pump's runs of every glider: mean power, volume by the two potentiometers."""
    events = pd.read_parquet(folder / "gc_events.parquet")
    dives = pd.read_csv(folder / "dives.csv").set_index("dive")
    found: dict[str, list[PumpRuns]] = {}
    for number, own in events.groupby("dive"):
        about = dives.loc[number]
        columns = {name: own[name].to_numpy(float) for name in own}
        place = float(about.log_VBD_CNV), float(about.avg_latitude)
        runs = replace(runs_of_events(columns, *place, float(number)), voltage=None)
        found.setdefault(str(about.platform), []).append(runs)
    joined = {name: joined_runs(tables) for name, tables in sorted(found.items())}
    return [Vehicle(name, runs, _split(runs)) for name, runs in joined.items()]


class Bleeding(NamedTuple):
    """What a glider's valve let in, rows in the order of pressure."""

    name: str
    pressure: Array  # Pa
    rate: Array  # m3/s
    flow: float  # m3/s/Pa^0.5, of the orifice
    head: float  # Pa, at the surface: the reservoir's vacuum, the bladder's skin and depth
    told: Array  # m3/s, the orifice's


def glider_valves(folder: Path) -> list[Bleeding]:
    """Return what each glider's valve let in at and near the surface, and the orifice in it.

    Rate squared is a straight line over pressure: flow^2 (p + head).
    """
    found = []
    for name, own in _events(folder).groupby("platform"):
        e = own[(own.volume < -_BLED) & (own.gc_vbd_secs != 0.0)].sort_values("pressure")
        rate = -(e.volume / e.gc_vbd_secs.abs()).to_numpy()
        p = e.pressure.to_numpy()
        if len(p) < 4 or np.ptp(p) < _METRES:
            continue
        slope, at_0 = np.polyfit(p, rate**2, 1)
        told = np.sqrt(np.maximum(at_0 + slope * p, 0.0))
        found.append(Bleeding(str(name), p, rate, float(np.sqrt(slope)), float(at_0 / slope), told))
    return found


def _split(runs: PumpRuns) -> float | None:
    """Return the pressure [Pa] at which a booster leaves off and a second pump takes over.

    Where two rates, one on either side, leave less than half of the spread of a straight line.
    """
    assert runs.volume is not None
    long = runs.duration > _STEADY
    order = np.argsort(runs.pressure[long])
    p, rate = runs.pressure[long][order], (runs.volume / runs.duration)[long][order]
    line = rate - np.polyval(np.polyfit(p, rate, 1), p)
    spread = [
        (
            float(np.sum((rate[:k] - rate[:k].mean()) ** 2))
            + float(np.sum((rate[k:] - rate[k:].mean()) ** 2)),
            k,
        )
        for k in range(4, len(p) - 4)
    ]
    if not spread or min(spread)[0] > _SPLIT * float(line @ line):
        return None
    k = min(spread)[1]
    return float(0.5 * (p[k - 1] + p[k]))


def glider_laws(vehicle: Vehicle) -> list[PumpFit]:
    """Return the fits to a glider's runs, one for each of its pumps, the shallower first."""
    runs = vehicle.runs
    sides = [np.ones(runs.power.size, bool)]
    if vehicle.split is not None:
        sides = [runs.pressure < vehicle.split, runs.pressure >= vehicle.split]
    return [_fitted(_only(runs, side)) for side in sides]


def glider_tables(vehicle: Vehicle) -> tuple[list[PumpFit], pd.DataFrame, pd.DataFrame]:
    """Return the fits (one for each pump), the dives, and efficiency over depth.

    dives: measured and told energy [J] and volume [mL]. efficiency: p dV over electrical energy of
    the runs of more than 8 s, and that of the power law at their mean pressure.
    """
    runs = vehicle.runs
    assert runs.dive is not None
    assert runs.volume is not None
    fits = glider_laws(vehicle)
    dives: dict[float, list[float]] = {}
    for fit in fits:
        for d in fit.dives:
            row = dives.setdefault(d.dive, [0.0] * 6)
            row[0] += d.runs
            row[1] = max(row[1], d.deepest / 1e4)
            for i, x in enumerate(
                (d.energy, d.predicted, d.volume * 1e6, d.predicted_volume * 1e6)
            ):
                row[2 + i] += x
    table = pd.DataFrame(
        [(int(number), *row) for number, row in sorted(dives.items())],
        columns=["dive", "runs", "deepest_dbar", "measured_J", "told_J", "measured_mL", "told_mL"],
    )
    table = table.assign(
        error=table.told_J / table.measured_J - 1.0,
        volume_error=table.told_mL / table.measured_mL - 1.0,
    )
    long = runs.duration > _STEADY
    work = runs.pressure * runs.volume / (runs.power * runs.duration)
    rows = []
    edges = np.array([0.0, 60.0, 120.0, 220.0, 400.0, 650.0, 900.0, 1100.0]) * 1e4
    for low, high in pairwise(edges):
        own = long & (runs.pressure >= low) & (runs.pressure < high)
        if own.sum() < 2:
            continue
        p = float(runs.pressure[own].mean())
        t = float(runs.duration[own].mean())
        fit = fits[-1] if vehicle.split is None or p >= vehicle.split else fits[0]
        power = fit.value("idle_power") + fit.value("power_per_pressure") * p
        power -= fit.value("lost_energy") / t
        rate = fit.value("delivery") - fit.value("slip") * p - fit.value("start_volume") / t
        rows.append(
            (
                p / 1e4,
                int(own.sum()),
                float(work[own].mean()),
                float(work[own].std()),
                p * rate / power,
            )
        )
    names = ["dbar", "runs", "efficiency", "spread", "told"]
    return fits, table, pd.DataFrame(rows, columns=names)


def _fitted(runs: PumpRuns) -> PumpFit:
    """Return the fit, without what a start loses where few runs cannot tell it."""
    try:
        return fit_pump(runs)
    except NoAnswerError:
        return fit_pump(runs, start=False)


def _numbers(fit: PumpFit) -> str:
    shown = {
        "idle_power": ("W", 1.0),
        "power_per_pressure": ("mW/dbar", 1e7),
        "power_per_temperature": ("W/K", 1.0),
        "lost_energy": ("J", 1.0),
        "delivery": ("mL/s", 1e6),
        "slip": ("mL/s/kdbar", 1e13),
        "start_volume": ("mL", 1e6),
    }
    return ", ".join(
        f"{name} {e.value * k:.4g} ({e.ci95[0] * k:.4g} to {e.ci95[1] * k:.4g}) {unit}"
        for name, e in fit.parameters.items()
        for unit, k in (shown[name],)
    )


def main(arguments: list[str]) -> int:
    """Print the tables of a folder of measured data; return the exit code."""
    if len(arguments) != 1:
        print(__doc__)
        return 2
    data = Path(arguments[0])
    pd.set_option("display.width", 160)
    if (data / "mermaid_p0051").is_dir():
        runs = float_runs(data / "mermaid_p0051")
        fit, table = float_table(runs)
        plain = fit_pump(runs, power_at="end", min_run_time=_LONG, voltage=False)
        print(
            f"mermaid_p0051: {int(fit.kept.sum())} runs over {_LONG:g} s, rms "
            f"{fit.power_rms:.3f} W at {fit.reference_voltage:.2f} V (without voltages "
            f"{plain.power_rms:.3f} W); {_numbers(fit)}"
        )
        weak = fit.kept & (fit.voltage_share < _SAGS)
        with_it, without_it = (np.sqrt(np.mean(_off(f)[weak[f.kept]] ** 2)) for f in (fit, plain))
        print(
            f"{int(weak.sum())} of them below {_SAGS * (fit.reference_voltage or 0.0):.2f} V: "
            f"rms {with_it:.3f} W (without voltages {without_it:.3f} W)"
        )
        worst = table.reindex(table.error.abs().sort_values(ascending=False).index)
        print(
            f"{len(table)} dives, each told by the others: median error "
            f"{table.error.abs().median():.1%}, worst {table.error.abs().max():.1%}, "
            f"{int((table.error.abs() <= 0.1).sum())} within 10 %"
        )
        print(worst.head(6).to_string(index=False, float_format=lambda x: f"{x:.4g}"))
        print(
            table[table.deepest_dbar > 100.0].to_string(
                index=False, float_format=lambda x: f"{x:.4g}"
            )
        )
    if (data / "seaglider").is_dir():
        for vehicle in glider_runs(data / "seaglider"):
            print(f"\n{vehicle.name}")
            try:
                fits, dives, efficiency = glider_tables(vehicle)
            except NoAnswerError as error:
                print(error)
                continue
            for fit in fits:
                print(
                    f"{int(fit.kept.sum())} runs, rms {fit.power_rms:.2f} W and "
                    f"{fit.volume_rms * 1e6:.1f} mL; {_numbers(fit)}"
                )
            for part in (dives, efficiency):
                print(part.to_string(index=False, float_format=lambda x: f"{x:.4g}"))
        print("\nvalves: an orifice, with a difference of pressure at the surface too")
        for b in glider_valves(data / "seaglider"):
            miss = np.abs(b.told / b.rate - 1.0)
            print(
                f"{b.name}: {b.flow * 1e6 * 1e5**0.5:.3g} mL/s/bar^0.5, {b.head / 1e3:.3g} kPa "
                f"at the surface, {len(b.rate)} events of {b.rate.min() * 1e6:.3g} to "
                f"{b.rate.max() * 1e6:.3g} mL/s told within {np.median(miss):.1%} (median), "
                f"{miss.max():.1%} at worst"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
