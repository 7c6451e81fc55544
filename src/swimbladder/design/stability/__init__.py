"""Stability of a vehicle under its law: what the linear analysis at one point leaves open.

`around` computes eigenvalues and margins over the region of parameters and searches it for the
worst, or tries wrong gains and late commands; `cycles` predicts limit cycles and simulates them;
`recover` says from where no controller comes back, and from where this one does; `run`
does it all and says it.
"""

from swimbladder.design.stability.run import Stability as Stability, stability as stability
