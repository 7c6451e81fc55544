"""The files of ``swimbladder size``."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from swimbladder.cli.common import json_text
from swimbladder.design.sizing import Sizing, columns, sized_vehicle, to_json
from swimbladder.io.files import publish, write_atomically
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.plots.size import draw_candidates, draw_parts, draw_requirements
from swimbladder.show.plots.style import save
from swimbladder.vehicle import Vehicle

_DIGITS = 12  # that are written: more than a part is known to, fewer than what sums of floats add


def write_sizing(found: Sizing, out: Path) -> list[Path]:
    """Write the vehicle, every drive that does the dive, the whole answer and three pictures."""
    names = [
        "vehicle.toml",
        "drives.csv",
        "size.json",
        "drives.png",
        "parts.png",
        "requirements.png",
    ]
    head = f"Written by swimbladder size: {found.body.name} to {found.asked.dive.depth:g} m."

    def write(folder: Path) -> None:
        made = Vehicle.model_validate(_rounded(sized_vehicle(found).model_dump()))
        write_atomically(folder / names[0], vehicle_file(made, head=head))
        write_atomically(folder / names[1], _drives_csv(found))
        write_atomically(folder / names[2], json_text(to_json(found)) + "\n")
        save(draw_candidates(found), folder / names[3])
        save(draw_parts(found), folder / names[4])
        save(draw_requirements(found), folder / names[5])

    publish(out, write)
    return [out / name for name in names]


def _rounded(value: Any) -> Any:
    """Return numbers as a person reads them, 0.6 for 0.6000000000000001."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(item) for item in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def _drives_csv(found: Sizing) -> str:
    table = columns(found)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*table.values(), strict=True))
    return text.getvalue()
