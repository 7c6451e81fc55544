"""What changing the volume costs, as files: tables, pictures and numbers."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from swimbladder.design.energy import Energy, PumpFit
from swimbladder.design.energy.fit import run_columns
from swimbladder.design.energy.messages import fit_sentences
from swimbladder.design.energy.run import dive_columns
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.answers import with_page
from swimbladder.show.files import Gone
from swimbladder.show.plots.energy import draw_energy, draw_fit, draw_versus
from swimbladder.vehicle import Vehicle

HEAD = "Pump found by swimbladder energy --fit."


def energy_files(found: Energy, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of energy.csv, dives.csv, energy.json (the answer) and two pictures."""
    return {
        "energy.csv": _known(found.columns()),
        "dives.csv": _known(dive_columns(found.dive)),
        "energy.json": answer,
        "energy.png": draw_energy(found),
        "versus.png": draw_versus(found.hover, found.dive, found.drive),
    }


def fit_files(
    fit: PumpFit, answer: Mapping[str, Any], vehicle: Vehicle | None = None, command: str = ""
) -> dict[str, object]:
    """Return the contents of the report, pump.json (the answer), runs.csv and pump.png.

    With a vehicle also those of vehicle.toml. Where the fit is refused, that of an earlier run is
    taken away.
    """
    files = {"pump.json": answer, "runs.csv": run_columns(fit), "pump.png": draw_fit(fit)}
    files = with_page(fit, answer, files, command)
    if fit.refusal:
        return {**files, "vehicle.toml": Gone(HEAD)}
    if vehicle is None:
        return files
    said = [HEAD, *fit_sentences(fit, vehicle)]
    return {**files, "vehicle.toml": vehicle_file(vehicle, head="\n".join(said))}


def _known(table: dict[str, Any]) -> dict[str, Any]:
    """Return columns with nan for what is not finite."""
    return {name: np.where(np.isfinite(x), x, np.nan) for name, x in table.items()}
