"""Linear models: what can be said of a vehicle at rest without simulating it.

`models` differentiates the right-hand side, `transfer` has the paper's formulas and counts
growing roots, `depths` says what depth does, `sampled` closes the loop at the law's sample time,
`margins` measures how far it is from instability, `pump_valve` has what is linear of floats. Laws
come in as functions: nothing here knows one by name.
"""

from swimbladder.design.linear.margins import Margins as Margins, loop_margins as loop_margins
from swimbladder.design.linear.models import StateSpace as StateSpace, linearise as linearise
from swimbladder.design.linear.sampled import (
    BoundLaw as BoundLaw,
    ClosedLoop as ClosedLoop,
    SampledLoop as SampledLoop,
    linearise_law as linearise_law,
)
