"""A model against a log: drive it with what was recorded, and see how far the depths part.

`record` turns a log into what drives a vehicle, `fit` runs the model along it and adjusts what is
asked to be adjusted, `run` puts them together; `ahead` predicts from each instant on.
"""

from swimbladder.estimation.comparison.fit import FITTABLE, Fitted
from swimbladder.estimation.comparison.record import DRIVES, Record, record
from swimbladder.estimation.comparison.run import Comparison, compare

__all__ = ["DRIVES", "FITTABLE", "Comparison", "Fitted", "Record", "compare", "record"]
