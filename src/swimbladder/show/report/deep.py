"""The identification from deep dives, as files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from swimbladder.estimation.motion.deep import DeepIdentification
from swimbladder.io.files import publish, write_atomically
from swimbladder.io.tables import write_csv
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.plots.deep import draw_deep
from swimbladder.show.plots.style import save
from swimbladder.show.report.identification import MARK, check_folder


def write_deep(found: DeepIdentification, out: Path, *, answer: str) -> list[Path]:
    """Write deep.json, deep.csv, deep.png and, where identified, vehicle.toml; return the paths.

    answer: the text of deep.json. The vehicle of an earlier run is taken away where the dives do
    not identify it. Raises InputError where the folder cannot be written.
    """
    check_folder(out, "")
    names = ["deep.png", "deep.csv", "deep.json", *(["vehicle.toml"] if found.identified else [])]

    def write(folder: Path) -> None:
        parts = [(k + 1, fits, fits.dive.pieces) for k, fits in enumerate(found.dives)]
        write_csv(
            folder / "deep.csv",
            {
                "dive": np.concatenate([np.full(len(p), float(k)) for k, _, p in parts]),
                "time_s": np.concatenate([p.time for _, _, p in parts]),
                "pressure_Pa": np.concatenate([p.pressure for _, _, p in parts]),
                "speed_m_s": np.concatenate([p.speed for _, _, p in parts]),
                "model_speed_m_s": np.concatenate([p.speed - t.speed for _, t, p in parts]),
                "imbalance_m3": np.concatenate([t.imbalance for _, t, _ in parts]),
            },
        )
        write_atomically(folder / "deep.json", answer + "\n")
        save(draw_deep(found), folder / "deep.png")
        if found.identified:
            head = "\n".join([f"{MARK} from deep dives.", *found.sentences])
            write_atomically(folder / "vehicle.toml", vehicle_file(found.result_vehicle, head=head))

    if not found.identified:
        (out / "vehicle.toml").unlink(missing_ok=True)
    publish(out, write)
    return [out / name for name in names]
