"""A vehicle under its controller (Fig. 15), under recorded inputs, or many vehicles at once.

`simulate` runs one vehicle and keeps everything; `simulate_ensemble` runs thousands and keeps
summaries or trajectories; `drive` replays a recorded volume or voltage. `step_metrics` says what a
depth step looks like.
"""

from swimbladder.sim.closed_loop.ensemble import simulate_ensemble as simulate_ensemble
from swimbladder.sim.closed_loop.replay import drive as drive
from swimbladder.sim.closed_loop.single import simulate as simulate
from swimbladder.sim.closed_loop.solution import (
    Event as Event,
    Solution as Solution,
    StepMetrics as StepMetrics,
    StopReason as StopReason,
    step_metrics as step_metrics,
)
