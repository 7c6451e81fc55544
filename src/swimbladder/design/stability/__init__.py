"""Stability of a vehicle under its law: what the linear analysis at one point leaves open.

`around` looks at eigenvalues and margins over the region of parameters and searches it for the
worst; `describing`, `cycles` and `predict` foretell limit cycles, `confirm` simulates them; `reach`
says from where no controller comes back, `recover` from where this one does; `wrapped` and `robust`
try wrong gains and late commands; `run` does it all, `result` says it.
"""

from swimbladder.design.stability.result import Stability
from swimbladder.design.stability.run import stability

__all__ = ["Stability", "stability"]
