"""Which experiments tell most of a vehicle's motion in the time that there is in the pool."""

from swimbladder.design.plan import (
    Expected,
    Move,
    Plan,
    PlannedExperiment,
    Trace,
    load_plan,
    plan_file,
)

__all__ = [
    "Expected",
    "Move",
    "Plan",
    "PlannedExperiment",
    "Trace",
    "load_plan",
    "plan_file",
]
