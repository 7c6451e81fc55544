"""K1, T1, dead zone, asymmetry and rate of an actuator, from logs of its steps (eqs 21-24).

`bench` makes a log into positions and what drove them, cut into blocks. Where that is a voltage,
`model` simulates it exactly and has the spread of its gains, and `voltage` fits it. Without
a voltage, `moves` finds motion at full speed, and fits how it begins and how fast it goes. `result`
holds what was found, `run` puts it together.
"""

from swimbladder.estimation.actuator.result import (
    PARAMETERS as PARAMETERS,
    ActuatorIdentification as ActuatorIdentification,
)
from swimbladder.estimation.actuator.run import identify_actuator as identify_actuator
from swimbladder.estimation.estimates import Estimate as Estimate
