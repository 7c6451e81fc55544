"""A model against a log: drive it with what was recorded, and see how far the depths part.

`record` turns a log into what drives a vehicle, `run` runs the model along it, adjusts what is
asked to be adjusted, and compares; `ahead` predicts from each instant on.
"""

from swimbladder.estimation.comparison.record import DRIVES, Record, record
from swimbladder.estimation.comparison.run import FITTABLE, Comparison, Fitted, compare

__all__ = ["DRIVES", "FITTABLE", "Comparison", "Fitted", "Record", "compare", "record"]
