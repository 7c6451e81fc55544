"""The vertical motion's parameters from measured logs, with what is known of their errors.

`experiment` says which stretches of a log are informative, `problem` predicts them with their
derivatives, `fit` finds the most probable parameters, `identifiability` says what the data leave
open, `profiles`, `model_selection` and `diagnose` examine the answer, `run` puts them together.
"""

from swimbladder.estimation.estimates import Estimate, Finding, Prior
from swimbladder.estimation.motion.model import NAMES
from swimbladder.estimation.motion.result import Choice, ExperimentFit, Identification, Profile
from swimbladder.estimation.motion.run import NEUTRAL_STD, identify

__all__ = [
    "NAMES",
    "NEUTRAL_STD",
    "Choice",
    "Estimate",
    "ExperimentFit",
    "Finding",
    "Identification",
    "Prior",
    "Profile",
    "identify",
]
