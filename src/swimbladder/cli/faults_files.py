"""The files of ``swimbladder faults``."""

from __future__ import annotations

import shutil
from pathlib import Path

from swimbladder.show.files import write_all
from swimbladder.show.plots.faults import draw_campaign, draw_mission
from swimbladder.sim.faults import Campaign
from swimbladder.sim.faults.single_mission import NAMES, Flown, missions_csv, trace_csv


def write_campaign(flown: Campaign, out: Path, keep: Path) -> list[Path]:
    """Write faults.json, missions.csv and faults.png; forget what was kept in case of a kill."""
    files = {
        "faults.json": flown.to_json(),
        "missions.csv": missions_csv(flown),
        "faults.png": draw_campaign(flown),
    }
    written = write_all(out, files)
    shutil.rmtree(keep, ignore_errors=True)
    return written


def write_one(flown: Flown, out: Path) -> list[Path]:
    """Write the trajectories of one mission, a file for each flight, and their picture."""
    stem = f"mission-{'h' if flown.healthy else ''}{flown.mission.number}"
    traces = {
        f"{stem}-{name}.csv": trace_csv(rows, flown.tick)
        for name, rows in zip(NAMES, flown.rows, strict=False)
    }
    return write_all(out, {**traces, f"{stem}.png": draw_mission(flown)})
