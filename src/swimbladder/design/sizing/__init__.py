"""Sizing: which pump or screw, motor, stroke and battery do a dive, of all that parts can make.

::

    Dive    what is asked for: depth, speed, turn time, trim to cover, cycles, hotel load
    size    search every combination of parts -> Sizing: the best, the Pareto front, each trade-off
    Parts   the list of parts; load_parts reads one from TOML
"""

from swimbladder.design.sizing.candidates import load_parts as load_parts
from swimbladder.design.sizing.evaluation import Dive as Dive, requirements as requirements
from swimbladder.design.sizing.run import (
    Sizing as Sizing,
    columns as columns,
    size as size,
    sized_vehicle as sized_vehicle,
)
