"""A vehicle under its controller (Fig. 15), under recorded inputs, or many vehicles at once.

`simulate` runs one vehicle and keeps everything; `simulate_ensemble` runs thousands and keeps
summaries or trajectories; `drive` replays a recorded volume or voltage. `step_metrics` says what a
depth step looks like.
"""

from swimbladder.sim.closed_loop.ensemble import simulate_ensemble
from swimbladder.sim.closed_loop.replay import drive
from swimbladder.sim.closed_loop.single import simulate
from swimbladder.sim.closed_loop.solution import (
    Books,
    Event,
    Solution,
    StepMetrics,
    StopReason,
    step_metrics,
)

__all__ = [
    "Books",
    "Event",
    "Solution",
    "StepMetrics",
    "StopReason",
    "drive",
    "simulate",
    "simulate_ensemble",
    "step_metrics",
]
