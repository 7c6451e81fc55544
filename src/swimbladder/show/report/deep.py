"""The identification from deep dives, as files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from swimbladder.estimation.motion.deep import DeepIdentification
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.answers import with_page
from swimbladder.show.files import Gone, write_all
from swimbladder.show.plots.deep import draw_deep
from swimbladder.show.report.identification import MARK, check_folder


def columns(found: DeepIdentification) -> dict[str, Any]:
    """Return the columns of deep.csv: speeds and models of them, dive after dive."""
    parts = [(k, fits, fits.dive.pieces) for k, fits in enumerate(found.dives, start=1)]
    parted = {
        "dive": [np.full(len(p), float(k)) for k, _, p in parts],
        "time_s": [p.time for _, _, p in parts],
        "pressure_Pa": [p.pressure for _, _, p in parts],
        "speed_m_s": [p.speed for _, _, p in parts],
        "model_speed_m_s": [p.speed - fits.speed for _, fits, p in parts],
        "imbalance_m3": [fits.imbalance for _, fits, _ in parts],
    }
    return {name: np.concatenate(values) for name, values in parted.items()}


def write_deep(
    found: DeepIdentification, out: Path, *, answer: Mapping[str, Any], command: str = ""
) -> list[Path]:
    """Write report, deep.json, deep.csv, deep.png and, where identified, vehicle.toml.

    Returns the paths.

    answer: deep.json; command: how the report says that it was made. The vehicle of an earlier
    run is taken away where the dives do not identify it. Raises InputError where the
    folder cannot be written.
    """
    check_folder(out, "")
    files: dict[str, object] = {
        "deep.png": draw_deep(found),
        "deep.csv": columns(found),
        "deep.json": answer,
        "vehicle.toml": Gone(),
    }
    if found.identified:
        head = "\n".join([f"{MARK} from deep dives.", *found.sentences])
        files["vehicle.toml"] = vehicle_file(found.result_vehicle, head=head)
    return write_all(out, with_page(found, answer, files, command))


def save_deep(found: DeepIdentification, out: Path) -> list[Path]:
    """Write the files of deep dives; return the paths."""
    return write_deep(found, out, answer=found.to_dict())
