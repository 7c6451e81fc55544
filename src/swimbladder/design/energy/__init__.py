"""What changing the volume costs: over depth, against a thruster, and from logged runs of a pump.

energy_per_volume: with rate, power and efficiencies over depth. thruster_comparison: the same task
by a thruster, after the question of Carneiro et al. (IEEE J. Oceanic Eng., 2020). fit: a pump's
power law and delivery, with uncertainty, from runs that a vehicle logged, a vehicle with that pump,
each of the runs, and efficiency over pressure.
"""

from swimbladder.design.energy.energy_per_volume import DriveEnergy, drive_energy, sea
from swimbladder.design.energy.fit import (
    PumpFit,
    efficiency_bands,
    fit_pump,
    fitted_vehicle,
    run_columns,
)
from swimbladder.design.energy.thruster_comparison import (
    Hovering,
    Profiling,
    Thruster,
    hovering,
    profiling,
)
from swimbladder.io.pump_runs import PumpRuns

__all__ = [
    "DriveEnergy",
    "Hovering",
    "Profiling",
    "PumpFit",
    "PumpRuns",
    "Thruster",
    "drive_energy",
    "efficiency_bands",
    "fit_pump",
    "fitted_vehicle",
    "hovering",
    "profiling",
    "run_columns",
    "sea",
]
