"""A model against a log: drive it with what was recorded, and see how far the depths part.

`record` turns a log into what drives a vehicle, `run` runs the model along it, adjusts what is
asked to be adjusted, and compares; `ahead` predicts from each instant on.
"""

from swimbladder.estimation.comparison.record import Record as Record, record as record
from swimbladder.estimation.comparison.run import Comparison as Comparison, compare as compare
