"""A sized drive as files: the vehicle with it, all drives that do the dive, and pictures."""

from collections.abc import Mapping
from typing import Any

from swimbladder.design.sizing import Sizing, columns, sized_vehicle
from swimbladder.io.tables import rows_csv
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.plots.size import draw_candidates, draw_parts, draw_requirements
from swimbladder.vehicle import Vehicle

_DIGITS = 12  # that are written: more than a part is known to, fewer than what sums of floats add


def sizing_files(found: Sizing, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of the vehicle, every drive that does the dive, answer and pictures."""
    made = Vehicle.model_validate(_rounded(sized_vehicle(found).model_dump()))
    head = f"Written by swimbladder size: {found.body.name} to {found.asked.dive.depth:g} m."
    drives = columns(found)
    return {
        "vehicle.toml": vehicle_file(made, head=head),
        "drives.csv": rows_csv(drives, zip(*drives.values(), strict=True)),
        "size.json": answer,
        "drives.png": draw_candidates(found),
        "parts.png": draw_parts(found),
        "requirements.png": draw_requirements(found),
    }


def _rounded(value: Any) -> Any:
    """Return numbers as a person reads them, 0.6 for 0.6000000000000001."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(item) for item in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value
