"""What changing the volume costs, as files: tables, pictures and numbers."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from swimbladder.design.energy import DriveEnergy, Energy, Hovering, Profiling, PumpFit
from swimbladder.design.energy.fit import efficiency_bands, run_columns
from swimbladder.design.energy.messages import fit_sentences
from swimbladder.io.answers import as_json, attributes
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.files import Gone
from swimbladder.show.plots.energy import draw_energy, draw_fit, draw_versus
from swimbladder.vehicle import Vehicle

HEAD = "Pump found by swimbladder energy --fit."
_ROWS = 201  # depths in tables, at most
_DIVE = "dive runs deepest_Pa energy_J predicted_J volume_m3 predicted_volume_m3"
_ESTIMATE = "value std ci95 unit"
_BAND = "runs pressure_Pa volume_m3 energy_J efficiency fitted_efficiency=fitted"
_HOVERING = "thrust_N thruster_power_W engine_energy_J engine_power_W break_even_s"


def energy_json(answer: Energy) -> dict[str, Any]:
    """Return the numbers of an answer, SI units, every depth of the tables."""
    found, hover, dive = answer.drive, answer.hover, answer.dive
    rows = spread_indices(found.column.depth.size, _ROWS)
    return {
        "vehicle": found.vehicle.name,
        "actuator": found.vehicle.actuator.kind,
        "stall_depth_m": found.stall_depth,
        "stall_pressure_Pa": found.stall,
        "depths": _columns(found, hover),
        "efficiency_map": {
            "voltage_share": found.shares,
            "depth_m": found.column.depth[rows],
            "efficiency": found.efficiencies[:, rows],
        },
        "hovering": {
            "depth_m": found.column.deepest,
            "weight_error_m3": hover.weight_error,
            **{key: values[-1] for key, values in attributes(hover, _HOVERING).items()},
        },
        "profiling": {
            "speed_m_s": dive.speed,
            **_dives(dive),
            "stroke_depth_m": dive.stroke_depth,
            "break_even_m": dive.break_even,
        },
        "thruster": answer.thruster._asdict(),
        "sentences": answer.sentences,
        "assumptions": answer.assumptions,
    }


def energy_files(found: Energy, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of energy.csv, dives.csv, energy.json (the answer) and two pictures."""
    return {
        "energy.csv": _known(_columns(found.drive, found.hover)),
        "dives.csv": _known(_dives(found.dive)),
        "energy.json": answer,
        "energy.png": draw_energy(found.drive),
        "versus.png": draw_versus(found.hover, found.dive, found.drive),
    }


def fit_json(fit: PumpFit) -> dict[str, Any]:
    """Return the numbers of a fit: parameters with their 95 %, and the dives."""
    return {
        "runs": int(fit.kept.sum()),
        "excluded": int((~fit.kept).sum()),
        **attributes(
            fit, "clusters power_rms_W volume_rms_m3 reference_voltage_V by_volume refusal"
        ),
        "parameters": {n: as_json(e, _ESTIMATE) for n, e in fit.parameters.items()},
        "dives": [as_json(dive, _DIVE) for dive in fit.dives],
        "efficiency": [as_json(band, _BAND) for band in efficiency_bands(fit)],
    }


def fit_files(
    fit: PumpFit, vehicle: Vehicle | None, answer: Mapping[str, Any]
) -> dict[str, object]:
    """Return the contents of pump.json (the answer), runs.csv, pump.png and, with a vehicle, its.

    That is vehicle.toml. Where the fit is refused, that of an earlier run is taken away.
    """
    files = {"pump.json": answer, "runs.csv": run_columns(fit), "pump.png": draw_fit(fit)}
    if fit.refusal:
        return {**files, "vehicle.toml": Gone(HEAD)}
    if vehicle is None:
        return files
    said = [HEAD, *fit_sentences(fit, vehicle)]
    return {**files, "vehicle.toml": vehicle_file(vehicle, head="\n".join(said))}


def _columns(found: DriveEnergy, hover: Hovering) -> dict[str, Any]:
    """Return the columns over some of the depths, evenly spread."""
    columns = {
        **attributes(found.column, "depth_m pressure_Pa"),
        **attributes(found.map, "rate_out_m3_s power_out_W"),
        **attributes(found, "energy_per_volume_J_m3=per_volume efficiency"),
        **{f"efficiency_{name}": values for name, values in found.stages.items()},
        **attributes(found.map, "rate_in_m3_s power_in_W holding_power_W leakage_m3_s"),
        "start_volume_m3": found.map.start_volume,
        "break_even_s": hover.break_even,
    }
    rows = spread_indices(found.column.depth.size, _ROWS)
    return {name: column[rows] for name, column in columns.items()}


def _dives(dive: Profiling) -> dict[str, Any]:
    return attributes(dive, "depth_m engine_J thruster_J drag_J")


def spread_indices(count: int, most: int) -> Any:
    """Return which of `count` stand in a table of at most so many: the first and the last in."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def _known(table: dict[str, Any]) -> dict[str, Any]:
    """Return columns with nan for what is not finite."""
    return {name: np.where(np.isfinite(x), x, np.nan) for name, x in table.items()}
