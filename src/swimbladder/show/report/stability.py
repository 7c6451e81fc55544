"""How stable a vehicle is, as files: numbers, words, maps and pictures."""

from collections.abc import Mapping
from typing import Any

from swimbladder.design.stability import Stability
from swimbladder.show.plots.stability import draw_recovery, draw_robustness


def stability_files(found: Stability, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of stability.json (the answer), its words, maps and pictures."""
    files: dict[str, object] = {
        "stability.json": answer,
        "stability.txt": "\n".join(found.sentences) + "\n",
        **{f"map-{one.name}.csv": one.csv() for one in found.maps},
    }
    if found.maps:
        files["maps.png"] = draw_recovery(found)
    if found.stood:
        files["robustness.png"] = draw_robustness(found)
    return files
