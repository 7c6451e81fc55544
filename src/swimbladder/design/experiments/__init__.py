"""Which experiments are most informative on a vehicle's motion in the time at the pool.

`conditions` is the pool, `flight` follows a release, `fisher_information` is what its record adds;
`library`, `selection` and `search` find the best set, `predict` and `evaluation` its errors,
`omitted_variables` what would bias it, `findings` what a person has to know; `io.plan` is the file
of it.
"""

from swimbladder.design.experiments.result import Design
from swimbladder.design.experiments.run import DRIFT_STD, PAPER, design_experiment
from swimbladder.io.plan import Expected, Move, Plan, PlannedExperiment, Trace, load_plan, plan_file

__all__ = [
    "DRIFT_STD",
    "PAPER",
    "Design",
    "Expected",
    "Move",
    "Plan",
    "PlannedExperiment",
    "Trace",
    "design_experiment",
    "load_plan",
    "plan_file",
]
