"""The files of ``swimbladder faults``."""

from __future__ import annotations

import shutil
from pathlib import Path

from swimbladder.cli.common import json_text
from swimbladder.io.files import publish, write_atomically
from swimbladder.show.plots.faults import draw_campaign, draw_mission
from swimbladder.show.plots.style import save
from swimbladder.sim.faults import Campaign
from swimbladder.sim.faults.single_mission import NAMES, Flown, missions_csv, trace_csv


def write_campaign(flown: Campaign, out: Path, keep: Path) -> list[Path]:
    """Write faults.json, missions.csv and faults.png; forget what was kept in case of a kill."""
    names = ["faults.json", "missions.csv", "faults.png"]

    def write(folder: Path) -> None:
        write_atomically(folder / names[0], json_text(flown.to_json()) + "\n")
        write_atomically(folder / names[1], missions_csv(flown))
        save(draw_campaign(flown), folder / names[2])

    publish(out, write)
    shutil.rmtree(keep, ignore_errors=True)
    return [out / name for name in names]


def write_one(flown: Flown, out: Path) -> list[Path]:
    """Write the trajectories of one mission, a file for each flight, and their picture."""
    stem = f"mission-{'h' if flown.healthy else ''}{flown.mission.number}"
    names = [f"{stem}-{name}.csv" for name in NAMES[: len(flown.rows)]]

    def write(folder: Path) -> None:
        for name, rows in zip(names, flown.rows, strict=True):
            write_atomically(folder / name, trace_csv(rows, flown.tick))
        save(draw_mission(flown), folder / f"{stem}.png")

    publish(out, write)
    return [out / name for name in (*names, f"{stem}.png")]
