"""Gains of the law `position-observer` for a positioner, from a few tuning, and its margins."""

from __future__ import annotations

import math

from swimbladder.control.law import TuningParameters
from swimbladder.control.position_observer import PositionObserverParameters
from swimbladder.design.tuning.gains import gains, setting_of
from swimbladder.vehicle import Vehicle

__all__ = ["FITTING", "position_observer_gains"]

# With margins (`tests/studies/test_tank_control.py`); chosen after a look at simulated missions
# 39, 43, 47, 51 and 65, so these are not unseen.
FITTING = {"frequency": 0.15, "damping": 1.0, "sharpness": 5.0, "learning": 1.0, "dead": 0.3e-6}
_NEUTRAL = 15e-6  # m3: the missions of the tank differ by 20 cm3 from one another


def position_observer_gains(
    vehicle: Vehicle,
    *,
    frequency: float,
    damping: float,
    sharpness: float,
    learning: float,
    dead: float,
) -> PositionObserverParameters:
    """Return the law's parameters for a vehicle, as the tuner makes those of `observer`.

    frequency [rad/s] and damping [-] of the depth under feedback; sharpness [-]: bandwidth of the
    filter over `frequency`; learning [-]: how fast the neutral volume is learnt; dead [m3].
    """
    assert vehicle.controller is not None
    h = vehicle.controller.sample_time
    setting = setting_of(vehicle, sample_time=h, supply=math.inf, neutral_range=_NEUTRAL)
    tuning = TuningParameters(frequency, damping, 1.0 / h, sharpness, learning, dead=dead)
    numbers = gains("position-observer", setting, tuning)
    assert isinstance(numbers, PositionObserverParameters)
    return numbers
