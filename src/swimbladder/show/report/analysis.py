"""What the linear models say, as files: numbers, words and pictures."""

from collections.abc import Mapping
from typing import Any

from swimbladder.design.linear import Analysis
from swimbladder.show.plots import linear


def analysis_files(found: Analysis, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of analysis.json (the answer), analysis.txt (words) and pictures."""
    pictures = {"open_loop": linear.draw_open_loop, "poles": linear.draw_poles}
    if found.drive is not None:
        pictures["drive"] = linear.draw_drive
    if found.closed_loop is not None:
        pictures |= {"loop_gains": linear.draw_loop_gains, "nyquist": linear.draw_nyquist}
    drawn = {f"{name}.png": draw(found) for name, draw in pictures.items()}
    return {"analysis.json": answer, "analysis.txt": found.text(), **drawn}
