"""Linear models: what can be said of a vehicle at rest without simulating it.

`models` differentiates the right-hand side, `transfer` has the paper's formulas, `routh` counts
growing roots, `depths` says what depth does, `sampled` closes the loop at the law's sample time,
`margins` measures how far it is from instability, `pump_valve` has what is linear of floats,
`analyse` gathers it all and says it in sentences. Laws come in as functions: nothing here knows one
by name.
"""

from swimbladder.design.linear.analyse import Analysis, analyse_linear
from swimbladder.design.linear.margins import Margins, loop_margins
from swimbladder.design.linear.models import StateSpace, linearise
from swimbladder.design.linear.routh import routh_table
from swimbladder.design.linear.sampled import BoundLaw, ClosedLoop, SampledLoop, linearise_law

__all__ = [
    "Analysis",
    "BoundLaw",
    "ClosedLoop",
    "Margins",
    "SampledLoop",
    "StateSpace",
    "analyse_linear",
    "linearise",
    "linearise_law",
    "loop_margins",
    "routh_table",
]
