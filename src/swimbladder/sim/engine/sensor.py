"""A sensor: white noise on what is true, then the quantum. Every loop measures by it.

What the vehicle's sensors give: depth with swell, and volume, with white noise and a quantum.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from swimbladder.physics.arrays import Array
from swimbladder.sim.engine.cache import inlined, part


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


@part
def _random(seed: int, draw: int) -> Any:
    """Return a number in (0, 1) that depends on seed and count only (splitmix64, Steele 2014)."""
    s = np.uint64(seed) * np.uint64(0x9E3779B97F4A7C15)
    s += np.uint64(draw) * np.uint64(0xD1B54A32D192ED03)
    for _ in range(2):
        s += np.uint64(0x9E3779B97F4A7C15)
        s = (s ^ (s >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        s = (s ^ (s >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        s = s ^ (s >> np.uint64(31))
    return (float(s >> np.uint64(11)) + 0.5) * 2.0**-53


@part
def normal(at: Any) -> Any:
    """Draw a number of the standard normal distribution (Box and Muller 1958)."""
    a, b = _random(at.seed, at.draws), _random(at.seed, at.draws + 1)
    at.draws += 2
    return math.sqrt(-2.0 * math.log(a)) * math.cos(2.0 * math.pi * b)


@part
def measured_depth(p: Any, waves: Array, x: Any, at: Any) -> Any:
    """Return the depth as the sensor gives it: with swell, white noise and quantum where seeded."""
    swell = 0.0
    for k in range(waves.shape[0]):
        if waves[k, 5] < 0.0:
            angle = waves[k, 1] * x.t + waves[k, 2]
            swell += waves[k, 0] * math.exp(-waves[k, 4] * max(x.z, 0.0)) * math.sin(angle)
    if at.seed < 0:
        return x.z - swell
    return measured(Sensor(p.noise, p.resolution), x.z - swell, normal(at))


@part
def measured_volume(p: Any, x: Any, at: Any) -> Any:
    """Return the volume as the sensor gives it [m3]: with white noise and quantum where seeded."""
    if at.seed < 0 or p.by_volume == 0.0:
        return x.v
    drawn = normal(at) if p.volume_noise > 0.0 else 0.0
    return measured(Sensor(p.volume_noise, p.volume_quantum), x.v, drawn)
