"""Gains for a vehicle: margins over what is not known of it, then trials with noise.

`gains` makes a law's parameters of what is tried, searches the best and says what has to be kept
and what is in the way, `region` says which vehicles are possible, `margins` and `trial` judge,
`run` puts them together and takes a law where none is named.
"""

from swimbladder.design.tuning.result import Tuning as Tuning
from swimbladder.design.tuning.run import tune as tune
