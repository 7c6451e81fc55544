"""K1, T1, dead zone, asymmetry and rate of an actuator, from logs of its steps (eqs 21-24).

`bench` makes a log into positions and what drove them. Where that is a voltage, `blocks` cuts it,
`model` simulates it exactly, `initial_guess` and `voltage` fit it with the spread of gains of
`estimate`, `profile` gives T1 its interval, `from_voltage` finds a soft start. Without a voltage,
`moves` finds motion at full speed, and `startup` fits how it begins and how fast it goes.
`nine_parameters` says where each of the nine parameters of section 2.3 comes from; `run` puts it
together.
"""

from __future__ import annotations

from swimbladder.estimation.actuator.result import ActuatorIdentification
from swimbladder.estimation.actuator.run import PARAMETERS, identify_actuator
from swimbladder.estimation.estimates import Estimate

__all__ = ["PARAMETERS", "ActuatorIdentification", "Estimate", "identify_actuator"]
