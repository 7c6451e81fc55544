"""What changing the volume costs: over depth, against a thruster, and from logged runs of a pump.

run: with rate, power and efficiencies over depth, and the same task by a thruster, after the
question of Carneiro et al. (IEEE J. Oceanic Eng., 2020). fit: a pump's power law
and delivery, with uncertainty, from runs that a vehicle logged, a vehicle with that pump, each of
the runs, and efficiency over pressure.
"""

from swimbladder.design.energy.run import (
    DriveEnergy as DriveEnergy,
    drive_energy as drive_energy,
    sea as sea,
)
from swimbladder.design.energy.fit import (
    PumpFit as PumpFit,
    efficiency_bands as efficiency_bands,
    fit_pump as fit_pump,
    fitted_vehicle as fitted_vehicle,
    run_columns as run_columns,
)
from swimbladder.design.energy.run import Energy as Energy, energy as energy
from swimbladder.design.energy.run import (
    Hovering as Hovering,
    Profiling as Profiling,
    Thruster as Thruster,
    hovering as hovering,
    profiling as profiling,
)
from swimbladder.io.pump_runs import PumpRuns as PumpRuns
