"""Gains of the law `position-observer` for a positioner, from a few knobs, and its margins."""

from __future__ import annotations

import math

import numpy as np

from swimbladder.control.position_observer import PositionObserverParameters
from swimbladder.dynamics import plant
from swimbladder.parameters import Vehicle
from swimbladder.tune.motion import filter_gains, motion_over_sample, stiffness

__all__ = ["FITTING", "position_observer_gains"]

# With margins (`tests/studies/test_tank_control.py`); chosen after a look at simulated missions
# 39, 43, 47, 51 and 65, so these are not unseen.
FITTING = {"frequency": 0.15, "damping": 1.0, "sharpness": 5.0, "learning": 1.0, "dead": 0.3e-6}
_NEUTRAL = 15e-6  # m3: the missions of the tank differ by 20 cm3 from one another
_FINEST = 0.5e-3  # m, noise that the filter reckons with at least, as the tuner has it
_STROKE = 0.5  # of the way to the nearer stop, that a depth error may ask for


def position_observer_gains(
    vehicle: Vehicle, *, frequency: float, damping: float, sharpness: float, learning: float,
    dead: float,
) -> PositionObserverParameters:  # fmt: skip
    """Return the law's parameters for a vehicle, as the tuner makes those of `observer`.

    frequency [rad/s] and damping [-] of the depth under feedback; sharpness [-]: bandwidth of the
    filter over `frequency`; learning [-]: how fast the neutral volume is learnt; dead [m3].
    """
    p = plant(vehicle)
    assert vehicle.controller is not None
    h = vehicle.controller.sample_time
    d, a = stiffness(p)
    sensors = vehicle.sensors
    noise = math.hypot(sensors.depth_noise, sensors.depth_quantum / math.sqrt(12.0))
    if vehicle.identified is not None:
        noise = max(noise, vehicle.identified.depth_noise)
    noise = max(noise, _FINEST)
    jolt = (sharpness * frequency) ** 2 * noise * math.sqrt(h)
    walk = learning * jolt * frequency / a
    F, G0, G1 = motion_over_sample(p, h)
    L = filter_gains(p, h, depth=noise, acceleration=jolt, neutral_walk=walk)
    k_z = frequency**2 / a
    room = min(p.V_max - p.V_0, p.V_0 - p.V_min)
    numbers = [F[0, 0], F[0, 1], F[1, 0], F[1, 1], G0[0], G1[0], G0[1], G1[1], h * p.d_t, *L]
    model = [float(x) for x in np.array(numbers)]
    return PositionObserverParameters(
        *model, neutral=p.V_0, neutral_range=_NEUTRAL, psi=p.psi, k_z=k_z,
        k_w=(2.0 * damping * frequency - d) / a, dead=dead, farthest=_STROKE * room / k_z,
        rate=p.rate, volume_min=p.V_min, volume_max=p.V_max, S_p=h,
    )  # fmt: skip
