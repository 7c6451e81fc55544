"""Real vehicles, predicted against measured: `python -m studies.scorecard DATA`.

DATA is the folder of measured data. Each row is about data that were not fitted: missions of a
float other than the one that its preset was identified from, and the energy of dives predicted by
all other dives. It prints the table of the site's front page.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

import swimbladder as sb
from studies.pump_power import float_runs, float_table, glider_runs, glider_tables

__all__ = ["MISSIONS", "main", "rows"]

MISSIONS = (43, 45, 51, 65)  # of ntnu-bv in a tank, with its preset's gains; 47 was fitted


def rows(data: Path) -> Iterator[tuple[str, str, str, str]]:
    """Yield (vehicle, what is predicted, from what, how far off) of each vehicle."""
    vehicle, path = sb.load_vehicle("ntnu-bv"), data / "ntnu_bv" / "missions.csv.gz"
    found = []
    for number in MISSIONS:
        log = sb.read_log(path, log_format="ntnu-bv", where={"log": number})
        found.append(sb.compare(log, vehicle, drive="setpoint"))
    off = [1e3 * one.rms for one in found]
    yield (
        "piston float in a tank of 1.5 m",
        f"depth in {len(off)} missions, closed loop",
        "another mission; each one's neutral volume is fitted",
        f"{np.median(off):.0f} mm rms in the median, {max(off):.0f} at most",
    )
    _, dives = float_table(float_runs(data / "mermaid_p0051"))
    yield _energy("MERMAID float", dives.error)
    for glider in glider_runs(data / "seaglider"):
        yield _energy(f"Seaglider {glider.name}", glider_tables(glider)[1].error)


def _energy(name: str, errors: Sequence[float]) -> tuple[str, str, str, str]:
    off = 100.0 * np.asarray(errors)
    rms, most = np.sqrt(np.mean(off**2)), np.abs(off).max()
    said = f"{rms:.1f} % rms, {most:.1f} at most"
    return name, f"energy of the pump in {len(off)} dives", "the other dives", said


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("data", type=Path)
    print("| vehicle | predicted | from | off by |\n|---|---|---|---|")
    for row in rows(parser.parse_args(arguments).data):
        print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main()
