"""Gains for a vehicle: margins over what is not known of it, then trials with noise.

`gains` makes a law's parameters of a few knobs, `region` says which vehicles are possible,
`margins` and `trial` judge, `search` finds, `run` puts them together.
"""

from __future__ import annotations

from swimbladder.tune.result import Tuning
from swimbladder.tune.run import GOALS, tune

__all__ = ["GOALS", "Tuning", "tune"]
