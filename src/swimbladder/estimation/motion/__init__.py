"""The vertical motion's parameters from measured logs, with what is known of their errors.

`problem` says which stretches of a log are informative, and predicts them with their derivatives;
`fit` finds the most probable parameters; `diagnose` says what the data leave open, and compares
other models; `run` finds intervals and puts all together, `result` holds it.
"""

from swimbladder.estimation.estimates import (
    DRIFT_STD as DRIFT_STD,
    Estimate as Estimate,
    Finding as Finding,
    Prior as Prior,
)
from swimbladder.estimation.motion.problem import NAMES as NAMES
from swimbladder.estimation.motion.result import (
    Choice as Choice,
    ExperimentFit as ExperimentFit,
    Identification as Identification,
)
from swimbladder.estimation.motion.run import (
    DELAY_STD as DELAY_STD,
    NEUTRAL_STD as NEUTRAL_STD,
    identify as identify,
)
