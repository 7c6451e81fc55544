"""A simulated run as files: its trajectory, its numbers and a picture."""

from collections.abc import Mapping
from typing import Any

from swimbladder.show.plots.solution import draw_solution
from swimbladder.sim.closed_loop import Solution


def solution_files(found: Solution, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of trajectory.csv, simulate.json (the answer) and trajectory.png."""
    picture = draw_solution(found)
    columns = found.columns()
    return {"trajectory.csv": columns, "simulate.json": answer, "trajectory.png": picture}
