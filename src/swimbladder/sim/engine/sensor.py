"""A sensor: white noise on what is true, then the quantum. Every loop measures by it."""

from typing import NamedTuple

import numpy as np

from swimbladder.sim.engine.cache import inlined


class Sensor(NamedTuple):
    """A sensor as the kernels take it, in the unit of what it measures."""

    noise: float  # 1 sigma, white and normal
    quantum: float  # step of its reading; 0: none


@inlined
def quantised(value: float, quantum: float) -> float:
    """Return the nearest multiple of a quantum; the value itself where the quantum is 0."""
    return quantum * np.floor(value / quantum + 0.5) if quantum > 0.0 else value


@inlined
def measured(sensor: Sensor, true: float, normal: float) -> float:
    """Return the reading of a sensor; normal: a number of the standard normal distribution."""
    return float(quantised(true + sensor.noise * normal, sensor.quantum))
