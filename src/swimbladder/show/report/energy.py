"""What changing the volume costs, as files: tables, pictures and numbers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from swimbladder.design.energy import (
    DriveEnergy,
    Hovering,
    Profiling,
    PumpFit,
    efficiency_bands,
    run_columns,
)
from swimbladder.design.energy.messages import fit_sentences
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.files import write_all
from swimbladder.show.plots.energy import draw_energy, draw_fit, draw_versus
from swimbladder.vehicle import Vehicle

_ROWS = 201  # depths in tables, at most


def energy_json(found: DriveEnergy, hover: Hovering, dive: Profiling) -> dict[str, Any]:
    """Return the numbers of an answer, SI units, every depth of the tables."""
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
            "thrust_N": hover.thrust[-1],
            "thruster_power_W": hover.thruster_power[-1],
            "engine_energy_J": hover.engine_energy[-1],
            "engine_power_W": hover.engine_power[-1],
            "break_even_s": hover.break_even[-1],
        },
        "profiling": {
            "speed_m_s": dive.speed,
            **_dives(dive),
            "stroke_depth_m": dive.stroke_depth,
            "break_even_m": dive.break_even,
        },
    }


def write_energy(
    found: DriveEnergy, hover: Hovering, dive: Profiling, out: Path, *, answer: Mapping[str, Any]
) -> list[Path]:
    """Write energy.csv, dives.csv, energy.json and two pictures into `out`; return the paths.

    answer: energy.json. Raises InputError where the folder cannot be written.
    """
    files = {
        "energy.csv": _known(_columns(found, hover)),
        "dives.csv": _known(_dives(dive)),
        "energy.json": answer,
        "energy.png": draw_energy(found),
        "versus.png": draw_versus(hover, dive, found),
    }
    return write_all(out, files)


def fit_json(fit: PumpFit) -> dict[str, Any]:
    """Return the numbers of a fit: parameters with their 95 %, and the dives."""
    return {
        "runs": int(fit.kept.sum()),
        "excluded": int((~fit.kept).sum()),
        "clusters": fit.clusters,
        "power_rms_W": fit.power_rms,
        "volume_rms_m3": fit.volume_rms,
        "reference_voltage_V": fit.reference_voltage,
        "parameters": {name: e._asdict() for name, e in fit.parameters.items()},
        "dives": [
            {
                "dive": d.dive, "runs": d.runs, "deepest_Pa": d.deepest, "energy_J": d.energy,
                "predicted_J": d.predicted, "volume_m3": d.volume,
                "predicted_volume_m3": d.predicted_volume,
            }
            for d in fit.dives
        ],
        "efficiency": [
            {
                "runs": b.runs, "pressure_Pa": b.pressure, "volume_m3": b.volume,
                "energy_J": b.energy, "efficiency": b.efficiency, "fitted_efficiency": b.fitted,
            }
            for b in efficiency_bands(fit)
        ],
    }  # fmt: skip


def write_fit(
    fit: PumpFit, vehicle: Vehicle | None, out: Path, *, answer: Mapping[str, Any]
) -> list[Path]:
    """Write pump.json, runs.csv, pump.png and, with a vehicle, vehicle.toml into `out`.

    Return the paths. answer: pump.json. Raises InputError where the folder cannot be written.
    """
    files = {"pump.json": answer, "runs.csv": run_columns(fit), "pump.png": draw_fit(fit)}
    if vehicle is not None:
        said = ["Pump found by swimbladder energy --fit.", *fit_sentences(fit, vehicle)]
        files["vehicle.toml"] = vehicle_file(vehicle, head="\n".join(said))
    return write_all(out, files)


def _columns(found: DriveEnergy, hover: Hovering) -> dict[str, Any]:
    """Return the columns over some of the depths, evenly spread."""
    m = found.map
    columns = {
        "depth_m": found.column.depth,
        "pressure_Pa": found.column.pressure,
        "rate_out_m3_s": m.rate_out,
        "power_out_W": m.power_out,
        "energy_per_volume_J_m3": found.per_volume,
        "efficiency": found.efficiency,
        **{f"efficiency_{name}": values for name, values in found.stages.items()},
        "rate_in_m3_s": m.rate_in,
        "power_in_W": m.power_in,
        "holding_power_W": m.holding_power,
        "leakage_m3_s": m.leakage,
        "start_volume_m3": m.start_volume,
        "break_even_s": hover.break_even,
    }
    rows = spread_indices(found.column.depth.size, _ROWS)
    return {name: column[rows] for name, column in columns.items()}


def _dives(dive: Profiling) -> dict[str, Any]:
    return {
        "depth_m": dive.depth,
        "engine_J": dive.engine,
        "thruster_J": dive.thruster,
        "drag_J": dive.drag,
    }


def spread_indices(count: int, most: int) -> Any:
    """Return which of `count` stand in a table of at most so many: the first and the last in."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def _known(table: dict[str, Any]) -> dict[str, Any]:
    """Return columns with nan for what is not finite."""
    return {name: np.where(np.isfinite(x), x, np.nan) for name, x in table.items()}
