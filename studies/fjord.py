"""A piston float in a fjord, predicted: `python -m studies.fjord DATA_DIR`.

DATA_DIR holds `missions.csv.gz` of the vehicle of the preset `ntnu-bv` and the casts beside it.
Missions 53, 55 and 57 were in sea water, which the logger took for fresh: its depths are scaled.
Each is predicted by what the two others taught: 10 s and 60 s ahead by the causal filter of
`compare --ahead`, then its whole length in one go with one neutral volume and at most a steady
drift, in water of constant density and in that of the cast, whose upper 1.5 m are brackish. What
came out: `docs/explanation/deep-dives.md`.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import least_squares

from studies.tank import HORIZONS
from swimbladder.comparison import record
from swimbladder.comparison.ahead import look_ahead
from swimbladder.dynamics import plant
from swimbladder.identify.model import model_of
from swimbladder.identify.outcome import identified_vehicle
from swimbladder.identify.walk import fit_walk
from swimbladder.io.config import load_vehicle
from swimbladder.io.log_format import log_format
from swimbladder.io.logs import Log, read_log
from swimbladder.parameters import Vehicle

__all__ = ["LOGS", "load", "open_loop", "sea_vehicle"]

Array = NDArray[np.float64]
LOGS = (53, 55, 57)
FRESH, SEA = 1000.0, 1025.8  # kg/m3: what the logger reckons with, and the cast from 2 m down
CAST = "ctd_borsa14.04.2023.csv"  # of the day of missions 53 to 57, as the collection infers
STEP = 0.05  # s
BETWEEN = 15e-6  # m3, 1 sigma of the neutral volume from mission to mission: two do not tell it
WINDOW = 80.0  # s, in which the neutral volume hardly changes
UNDER = 0.3  # m, from where on the whole log is told: above it the lid is out of the water


def load(folder: Path) -> dict[int, Log]:
    """Return the missions in sea water, depths as of sea water."""
    form = log_format("ntnu-bv")
    form = form.model_copy(update={"logger_density": FRESH, "water_density": SEA})
    path = folder / "missions.csv.gz"
    return {n: read_log(path, where={"log": n}, log_format=form) for n in LOGS}


def sea_vehicle() -> Vehicle:
    """Return the preset in sea water: in it, piston and mass do more."""
    vehicle = load_vehicle("ntnu-bv")
    return vehicle.model_copy(update={"water": vehicle.water.model_copy(update={"density": SEA})})


def density(folder: Path) -> tuple[Array, Array]:
    """Return depth [m] and density [kg/m3] of the cast."""
    with (folder / CAST).open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["depth_m"] and row["density_kg_m3"]]
    z = np.array([float(row["depth_m"]) for row in rows])
    return z, np.array([float(row["density_kg_m3"]) for row in rows])


def open_loop(
    log: Log, vehicle: Vehicle, *, drift: bool, psi: bool, water: tuple[Array, Array] | None
) -> tuple[float, dict[str, float]]:
    """Return the rms of depth [m] of a whole log in one go, and what was fitted to it.

    Fitted: neutral volume, start, speed at the start and, where asked for, psi and a steady drift.
    water: depths and densities that the neutral volume follows besides; None: constant density.
    """
    p = plant(vehicle, bottom_depth=np.inf)
    assert log.volume is not None or log.piston is not None
    first = int(np.argmax(log.depth > UNDER))
    last = len(log) - int(np.argmax(log.depth[::-1] > UNDER))
    time = log.time[first:last] - log.time[first]
    measured = log.depth[first:last]
    volume = _volume(log, vehicle)[first:last]
    fine = np.arange(0.0, time[-1], STEP)
    V = np.interp(fine, time, volume)
    rested = vehicle.hull.displaced_volume
    # More dense water carries the same weight with less volume.
    z_of, extra = np.array([0.0, 1.0]), np.zeros(2)
    if water is not None:
        z_of, extra = water[0], rested * (SEA / water[1] - 1.0)

    def simulate(x: Array) -> Array:
        return np.asarray(
            _fall(x[0] * 1e-6, x[1] * 1e-6, x[2] * 1e-6 / 60.0, x[3], x[4], V, z_of, extra,
                  p.a_b, p.d_l, p.d_t)
        )  # fmt: skip

    free = [0, 3, 4, *([1] if psi else []), *([2] if drift else [])]
    scale = np.array([1.0, 0.3, 0.3, 0.05, 0.02])
    x0 = np.array([float(np.median(volume)) * 1e6, 1e6 * vehicle.hull.psi, 0.0, measured[0], 0.1])

    def misfit(y: Array) -> Array:
        x = x0.copy()
        x[free] += scale[free] * y
        error = np.interp(time, fine, simulate(x)) - measured
        return np.asarray(np.clip(error, -20.0, 20.0))

    best = min(
        (
            least_squares(
                misfit, np.array([shift, *np.zeros(len(free) - 1)]), loss="soft_l1", f_scale=0.3,
                diff_step=1e-4, max_nfev=60,
            )
            for shift in (-4.0, -1.0, 2.0)
        ),
        key=lambda found: float(found.cost),
    )  # fmt: skip
    x = x0.copy()
    x[free] += scale[free] * best.x
    return float(np.sqrt(np.mean(misfit(best.x) ** 2))), {
        "neutral_cm3": float(x[0]), "psi_cm3_m": float(x[1]), "drift_cm3_min": float(x[2]),
    }  # fmt: skip


@njit  # type: ignore[untyped-decorator]
def _fall(  # type: ignore[no-untyped-def]
    neutral, psi, rate, z, w, V, z_of, extra, a_b, d_l, d_t
):  # fmt: skip
    """Return the depth at each step [m], m z'' = rho g (V_neutral - V) - k_dl z' - k_dt z'|z'|."""
    found = np.empty(len(V))
    for i in range(len(V)):
        found[i] = z
        rest = neutral + psi * z + rate * STEP * i + np.interp(z, z_of, extra)
        w += STEP * (a_b * (rest - V[i]) - d_l * w - d_t * w * abs(w))
        z = max(z + STEP * w, 0.0)
    return found


def _volume(log: Log, vehicle: Vehicle) -> Array:
    """Return the volume that the piston displaces [m3]."""
    if log.volume is not None:
        return log.volume
    assert log.piston is not None
    area = getattr(vehicle.actuator, "piston_area", 0.0)
    return np.asarray(log.piston * area)


def taught(logs: Mapping[int, Log]) -> Vehicle:
    """Return the vehicle as these logs tell it, its neutral volume walking."""
    base = sea_vehicle()
    records = [record(log, base, drive="volume") for log in logs.values()]
    found = fit_walk(records, base, drag="blended")
    model = model_of(base, law="blended", bottom_depth=float("inf"))
    return identified_vehicle(
        base, model, found.values, found.names, found.covariance, trim_error=None,
        depth_noise=found.noise.depth, neutral_std=BETWEEN, neutral_walk=found.noise.walk,
        acceleration_noise=found.noise.jolt, logs=tuple(f"mission {n}" for n in logs),
    )  # fmt: skip


def judge(number: int, logs: Mapping[int, Log], folder: Path) -> str:
    """Return a row of the table: a mission by what the others taught."""
    others = {n: log for n, log in logs.items() if n != number}
    vehicle = taught(others)
    ahead = look_ahead(logs[number], vehicle, horizons=HORIZONS, bottom_depth=float("inf"))
    cells = []
    for horizon in ahead.horizons:
        skill = horizon.skill["persistence"]
        cells += [f"{horizon.rms:.3f}", "-" if skill is None else f"{skill:.2f}"]
    for drift, psi, water in (
        (False, False, None), (True, False, None), (True, True, None),
        (True, True, density(folder)),
    ):  # fmt: skip
        rms, found = open_loop(logs[number], vehicle, drift=drift, psi=psi, water=water)
        cells.append(f"{rms:.2f}")
        if psi:
            cells.append(f"{found['psi_cm3_m']:.2f}")
    return f"| {number} | {' | '.join(cells)} |"


def windows(log: Log, vehicle: Vehicle) -> str:
    """Return the neutral volume that each `WINDOW` of a mission asks for by itself [cm3]."""
    found = []
    begin = float(log.time[int(np.argmax(log.depth > UNDER))])
    while begin + WINDOW <= log.time[-1]:
        inside = (log.time >= begin) & (log.time < begin + WINDOW)
        part = log.only(inside)
        if (part.depth > UNDER).mean() > 0.9:
            rms, fit = open_loop(part, vehicle, drift=False, psi=False, water=None)
            found.append(f"{fit['neutral_cm3']:.1f} ({rms:.2f} m)")
        begin += WINDOW
    return ", ".join(found)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of measured data")
    folder = parser.parse_args().data / "ntnu_bv"
    logs = load(folder)
    print(
        "| mission | 10 s ahead, m rms | skill | 60 s ahead, m rms | skill | whole, m rms "
        "| with a drift | and its own psi | psi, cm3/m | and the cast | psi, cm3/m |\n"
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|"
    )
    for number in logs:
        print(judge(number, logs, folder), flush=True)
    print(f"\nNeutral volume, cm3, of windows of {WINDOW:.0f} s by themselves (and their rms):")
    for number, log in logs.items():
        print(f"- {number}: {windows(log, taught({number: log}))}", flush=True)


if __name__ == "__main__":
    main()
