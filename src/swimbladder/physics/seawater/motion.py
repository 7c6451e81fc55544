"""Vertical motion of the water: internal waves and swell, linear theory.

Each wave moves the water at depth z by ``shape(z) a sin(2 pi t/period + phase)``, positive down;
its speed is the time derivative. The shape of an internal wave of mode n in water of depth H and of
constant stratification is sin(n pi z/H); that of swell over deep water is e^(-k z) with
k = (2 pi/period)^2/g (e.g. Kundu, Cohen, Dowling, *Fluid Mechanics*, 5th ed., ch. 7).
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from swimbladder.errors import InputError
from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater.column import Column
from swimbladder.vehicle import Parameters, Unit


class InternalWave(Parameters):
    """An internal wave: layers move up and down, at rest at surface and bottom.

    It carries the vehicle, salt and heat along. Pressure stays that of the water at rest.
    """

    amplitude: Annotated[float, Unit("m"), Field(ge=0.0, le=1000.0)]
    """largest displacement of a layer"""
    period: Annotated[float, Unit("s"), Field(ge=30.0)]
    """of the wave"""
    water_depth: Annotated[float, Unit("m"), Field(gt=0.0)]
    """of the bottom"""
    mode: Annotated[int, Field(ge=1, le=100)] = 1
    """layers between surface and bottom that move as one"""
    phase: Annotated[float, Unit("rad")] = 0.0
    """at the start"""


class Swell(Parameters):
    """Surface waves over deep water: their motion decays by e^(-k z)."""

    amplitude: Annotated[float, Unit("m"), Field(ge=0.0, le=20.0)]
    """half the height of the waves"""
    period: Annotated[float, Unit("s"), Field(ge=1.0, le=30.0)]
    """of the wave"""
    phase: Annotated[float, Unit("rad")] = 0.0
    """at the start"""


class WaterMotion(Parameters):
    """All the waves that move the water at once; none: it is at rest."""

    internal_waves: tuple[InternalWave, ...] = ()
    """internal waves"""
    swell: tuple[Swell, ...] = ()
    """swell"""


def check_motion(motion: WaterMotion, column: Column) -> None:
    """Raise InputError for an internal wave that is faster than the water of a cast can swing.

    Nothing swings faster than at the buoyancy frequency (Gill, *Atmosphere-Ocean Dynamics*, 6.4).
    """
    fastest = column.buoyancy_frequency
    for k, wave in enumerate(motion.internal_waves):
        if fastest > 0.0 and wave.period < 2.0 * math.pi / fastest:
            raise InputError(
                f"no internal wave is that fast here: the shortest in {column.source} lasts "
                f"{2.0 * math.pi / fastest:.0f} s",
                field=f"water_motion.internal_waves[{k}].period",
                value=wave.period,
                unit="s",
                remedy="Give a longer period; what is faster near the surface is swell",
            )


def motion_table(motion: WaterMotion, gravity: float) -> Array:
    """Return the waves as an array [n, 6] for `moved`.

    Columns: amplitude [m], angular frequency [rad/s], phase [rad], wavenumber of the mode and decay
    [1/m] of which one is 0, and the depth below which nothing moves [m]. gravity: m/s2.
    """
    rows = []
    for wave in motion.internal_waves:
        number = wave.mode * math.pi / wave.water_depth
        frequency = 2.0 * math.pi / wave.period
        rows.append((wave.amplitude, frequency, wave.phase, number, 0.0, wave.water_depth))
    for swell in motion.swell:
        frequency = 2.0 * math.pi / swell.period
        decay = frequency**2 / gravity
        rows.append((swell.amplitude, frequency, swell.phase, 0.0, decay, math.inf))
    return np.array(rows, dtype=np.float64).reshape(-1, 6)


def moved(waves: Array, z: float, t: float) -> tuple[float, float]:
    """Return displacement [m] and speed [m/s] of the water at depth z [m] and time t [s].

    Both are positive down; every layer is displaced from its rest. waves: of `motion_table`; plain
    Python on scalars, for kernels to inline.
    """
    displacement, speed = 0.0, 0.0
    depth = max(z, 0.0)
    for k in range(waves.shape[0]):
        if depth >= waves[k, 5]:
            continue
        mode, decay = waves[k, 3], waves[k, 4]
        shape = waves[k, 0] * (math.exp(-decay * depth) if decay > 0.0 else math.sin(mode * depth))
        angle = waves[k, 1] * t + waves[k, 2]
        displacement += shape * math.sin(angle)
        speed += shape * waves[k, 1] * math.cos(angle)
    return displacement, speed
