"""Gains for a vehicle: margins over what is not known of it, then trials with noise.

`gains` makes a law's parameters of what is tried and searches the best, `region` says which
vehicles are possible, `margins` and `trial` judge, `run` puts them together.
"""

from swimbladder.design.tuning.run import Tuning as Tuning, tune as tune
