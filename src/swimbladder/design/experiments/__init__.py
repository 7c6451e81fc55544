"""Which experiments tell most of a vehicle's motion in the time that there is in the pool.

`setting` is the pool, `flight` follows a release, `knowledge` says what its record tells;
`library`, `choose` and `search` find the best set, `predict` and `weigh` say what it will tell,
`left_out` what would bias it, `findings` what a person has to know; `io.plan` is the file of it.
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
