"""Faults flown: the C of a vehicle's controller and supervisor against the plant, by the thousand.

`kinds` is the catalogue, `draw` makes mission n of a seed, `c_interface` compiles the C and
`flight` flies it in the loop of `closed_loop`, with the effects of faults between its parts; `run`
flies a campaign and `campaign_result` evaluates it.
"""

from swimbladder.sim.faults.campaign_result import FaultResult as FaultResult
from swimbladder.sim.faults.run import faults as faults
