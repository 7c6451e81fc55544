"""The vertical motion's parameters from measured logs, with what is known of their errors.

`problem` says which stretches of a log are informative, and predicts them with their derivatives;
`fit` finds the most probable parameters; `diagnose` says what the data leave open, and compares
other models; `run` finds intervals and puts all together, `result` holds it.
"""

from swimbladder.estimation.estimates import Estimate, Finding, Prior
from swimbladder.estimation.motion.problem import NAMES
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
