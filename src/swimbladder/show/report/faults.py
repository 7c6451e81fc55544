"""Missions with faults as files: a row for each, numbers and a picture."""

from collections.abc import Mapping
from typing import Any

from swimbladder.show.plots.faults import draw_campaign
from swimbladder.sim.faults import FaultResult
from swimbladder.sim.faults.single_mission import missions_csv


def fault_files(found: FaultResult, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of faults.json (the answer), missions.csv and faults.png."""
    picture = draw_campaign(found)
    return {"faults.json": answer, "missions.csv": missions_csv(found), "faults.png": picture}
