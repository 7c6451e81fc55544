"""What the vehicle's sensors give: depth with swell, and volume, with white noise and a quantum."""

from __future__ import annotations

import math

import numpy as np

from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.rodas.names import At, Given, Now
from swimbladder.sim.engine.sensor import Sensor
from swimbladder.sim.engine.sensor import measured as reading

T, Z, V = int(Now.T), int(Now.Z), int(Now.V)
DRAWS, SEED, BY_VOLUME = int(At.DRAWS), int(At.SEED), int(Given.BY_VOLUME)
NOISE, RESOLUTION = int(Given.NOISE), int(Given.RESOLUTION)
VOLUME_NOISE, VOLUME_QUANTUM = int(Given.VOLUME_NOISE), int(Given.VOLUME_QUANTUM)


@part
def _random(seed, draw):  # type: ignore[no-untyped-def]
    """Return a number in (0, 1) that depends on seed and count only (splitmix64, Steele 2014)."""
    s = np.uint64(seed) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(draw) * np.uint64(
        0xD1B54A32D192ED03
    )
    for _ in range(2):
        s += np.uint64(0x9E3779B97F4A7C15)
        s = (s ^ (s >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        s = (s ^ (s >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        s = s ^ (s >> np.uint64(31))
    return (float(s >> np.uint64(11)) + 0.5) * 2.0**-53


@part
def normal(at):  # type: ignore[no-untyped-def]
    """Draw a number of the standard normal distribution (Box and Muller 1958)."""
    a, b = _random(at[SEED], at[DRAWS]), _random(at[SEED], at[DRAWS] + 1)
    at[DRAWS] += 2
    return math.sqrt(-2.0 * math.log(a)) * math.cos(2.0 * math.pi * b)


@part
def measured(p, waves, x, at):  # type: ignore[no-untyped-def]
    """Return the depth as the sensor gives it: with swell, white noise and quantum where seeded."""
    swell = 0.0
    for k in range(waves.shape[0]):
        if waves[k, 5] < 0.0:
            angle = waves[k, 1] * x[T] + waves[k, 2]
            swell += waves[k, 0] * math.exp(-waves[k, 4] * max(x[Z], 0.0)) * math.sin(angle)
    if at[SEED] < 0:
        return x[Z] - swell
    return reading(Sensor(p[NOISE], p[RESOLUTION]), x[Z] - swell, normal(at))


@part
def measured_volume(p, x, at):  # type: ignore[no-untyped-def]
    """Return the volume as the sensor gives it [m3]: with white noise and quantum where seeded."""
    if at[SEED] < 0 or p[BY_VOLUME] == 0.0:
        return x[V]
    drawn = normal(at) if p[VOLUME_NOISE] > 0.0 else 0.0
    return reading(Sensor(p[VOLUME_NOISE], p[VOLUME_QUANTUM]), x[V], drawn)
