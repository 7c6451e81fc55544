"""Every pump event of the gliders: when, how deep, what was pumped, what it took, how efficient.

``python -m studies.pump_events DATA --out DIR`` writes ``events.csv``, a row an event, and
``vehicles.csv``, each vehicle's events in bands of pressure with the efficiency from battery to
water, and prints the second. DATA is the folder that has ``seaglider``. The volume is that of the
mean of both potentiometers, the energy volts times amps times seconds of the log's own event. What
the law (`energy.fit_pump`) says of each band stands beside it; a glider with a booster has two.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from studies.pump_power import Vehicle, glider_laws, glider_runs
from swimbladder.design.energy import efficiency_bands, run_columns
from swimbladder.io.files import make_folder, write_atomically

__all__ = ["main", "summary", "table"]


def table(vehicles: Iterable[Vehicle]) -> pd.DataFrame:
    """Return a row per event of the gliders, in the order of their times."""
    parts = []
    for vehicle in vehicles:
        for law in glider_laws(vehicle):
            c = run_columns(law)
            parts.append(
                pd.DataFrame(
                    {
                        "vehicle": vehicle.name,
                        "dive": c["dive"].astype(int),
                        "time": pd.to_datetime(c["time_s"], unit="s", utc=True).round("ms"),
                        "pressure_dbar": c["pressure_Pa"] / 1e4,
                        "duration_s": c["duration_s"],
                        "volume_mL": 1e6 * c["volume_m3"],
                        "electrical_J": c["energy_J"],
                        "efficiency": c["efficiency"],
                        "told_volume_mL": 1e6 * c["fitted_volume_m3"],
                        "told_electrical_J": c["fitted_energy_J"],
                    }
                )
            )
    return pd.concat(parts).sort_values(["vehicle", "time"], ignore_index=True)


def summary(vehicles: Iterable[Vehicle]) -> pd.DataFrame:
    """Return the events of each vehicle in bands of pressure."""
    rows = [
        (
            vehicle.name,
            band.pressure / 1e4,
            band.runs,
            1e6 * band.volume,
            band.energy,
            band.efficiency,
            band.fitted,
        )
        for vehicle in vehicles
        for law in glider_laws(vehicle)
        for band in efficiency_bands(law)
    ]
    names = ["vehicle", "dbar", "events", "mL_each", "J_each", "efficiency", "by_the_law"]
    return pd.DataFrame(rows, columns=names)


def main(arguments: list[str] | None = None) -> int:
    """Write the tables of a folder of measured data, print the short one; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m studies.pump_events", description=__doc__)
    parser.add_argument("data", type=Path, help="that holds seaglider")
    parser.add_argument("--out", type=Path, default=Path("report/pump_events"), metavar="DIR")
    given = parser.parse_args(arguments)
    vehicles = glider_runs(given.data / "seaglider")
    events, bands = table(vehicles), summary(vehicles)
    make_folder(given.out)
    for name, frame in (("events.csv", events), ("vehicles.csv", bands)):
        write_atomically(given.out / name, frame.to_csv(index=False, float_format="%.6g"))
    print(bands.to_string(index=False, float_format=lambda x: f"{x:.3g}"))
    print(
        f"{len(events)} events of {events.vehicle.nunique()} gliders; "
        f"wrote {given.out}/events.csv and vehicles.csv"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
