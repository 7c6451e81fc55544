"""A mission as files: its numbers, trajectory, events, cycles and speeds."""

import datetime
from collections.abc import Mapping
from typing import Any

from swimbladder.sim.mission.export import float_configuration
from swimbladder.sim.mission.result import MissionResult
from swimbladder.sim.mission.tables import cycle_columns, events_csv, speeds, trajectory_columns


def mission_files(
    found: MissionResult, answer: Mapping[str, Any], *, begin: datetime.datetime | None = None
) -> dict[str, object]:
    """Return the contents of mission.json (the answer), the tables, and the float's configuration.

    begin: when the mission does, in float.json.
    """
    return {
        "mission.json": answer,
        "trajectory.csv": trajectory_columns(found),
        "events.csv": events_csv(found.flight),
        "cycles.csv": cycle_columns(found),
        "vertical-speed.csv": speeds(found.flight),
        "float.json": float_configuration(found, begin=begin),
    }
