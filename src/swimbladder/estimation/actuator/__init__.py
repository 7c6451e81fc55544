"""K1, T1, dead zone, asymmetry and rate of an actuator, from logs of its steps (eqs 21-24).

`bench` makes a log into positions and what drove them. Where that is a voltage, `blocks` cuts it,
`response` simulates it exactly, `model`, `initial_guess`, `gain_spread` and `voltage` fit it,
`profile` gives T1 its interval, `soft_start` looks for a soft start. Without a voltage, `moves`
finds motion at full speed, `startup` fits how it begins and `plateau` how fast it goes.
`nine_parameters` says where each of the nine parameters of section 2.3 comes from; `run` puts it
together.
"""

from __future__ import annotations

from swimbladder.estimation.actuator.result import ActuatorIdentification
from swimbladder.estimation.actuator.run import PARAMETERS, identify_actuator
from swimbladder.estimation.estimates import Estimate

__all__ = ["PARAMETERS", "ActuatorIdentification", "Estimate", "identify_actuator"]
