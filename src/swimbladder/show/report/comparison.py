"""A comparison with a log as files: its samples, its numbers and a picture."""

from collections.abc import Mapping
from typing import Any

from swimbladder.estimation.comparison import Comparison
from swimbladder.show.plots.comparison import draw_comparison


def comparison_files(found: Comparison, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of compare.csv, compare.json (the answer) and compare.png."""
    picture = draw_comparison(found)
    return {"compare.csv": found.columns(), "compare.json": answer, "compare.png": picture}
