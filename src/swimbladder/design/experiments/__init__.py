"""Which experiments are most informative on a vehicle's motion in the time at the pool.

`conditions` is the pool, follows a release there and says what its record adds, `search` finds the
best set, `evaluation` its errors and what would bias it, `result` what a person has to know;
`design.plan` is the file of it.
"""

from swimbladder.design.experiments.result import Design as Design
from swimbladder.design.experiments.run import design_experiment as design_experiment
