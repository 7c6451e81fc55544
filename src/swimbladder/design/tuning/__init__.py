"""Gains for a vehicle: margins over what is not known of it, then trials with noise.

`knobs` are what is chosen, `motion` and `gains` make a law's parameters of them, `region` says
which vehicles are possible, `margins` and `trial` (with `energy`) judge, `grids` says what is
tried, `search` finds, `run` puts them together.
"""

from __future__ import annotations

from swimbladder.design.tuning.gains import GOALS
from swimbladder.design.tuning.result import Tuning
from swimbladder.design.tuning.run import tune

__all__ = ["GOALS", "Tuning", "tune"]
