"""The identification in a pool of section 3.1, on a simulated vehicle.

`procedure` runs the steps (a)-(d) of control.protocol, `fits` finds K2 and T2 in the records as the
paper did and shows what leaving out psi does to them.
"""

from swimbladder.sim.pool.fits import (
    Fit,
    average,
    centred_differences,
    fit_depth,
    fit_jointly,
    fit_speed,
    response,
)
from swimbladder.sim.pool.procedure import (
    Experiment,
    PoolRun,
    Record,
    pool_parameters,
    pool_test,
    run_procedure,
    still_starts,
    timed_travel,
)

__all__ = [
    "Experiment",
    "Fit",
    "PoolRun",
    "Record",
    "average",
    "centred_differences",
    "fit_depth",
    "fit_jointly",
    "fit_speed",
    "pool_parameters",
    "pool_test",
    "response",
    "run_procedure",
    "still_starts",
    "timed_travel",
]
