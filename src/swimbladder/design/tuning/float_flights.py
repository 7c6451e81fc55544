"""Flights of floats under a law of volume changes, many at once, in the closed loop.

Each goes to a depth and keeps it, from any depth, speed and volume, with a drive and a hull that
differ from what the law's processor knows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.control.law import Law
from swimbladder.physics.dynamics import body_plant
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop import simulate_ensemble
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

VARIED = ("drag", "psi", "pump", "valve", "V_0")
"""What may differ from flight to flight: factors, but psi [m3/m] and V_0 [m3]."""

_DRAG = ("d_l", "d_b", "d_0", "d_t")
_FINEST = 1e-3  # s, of the times between a law's samples
_LONGEST = 30.0  # s, of a tick: runs of the drive that last longer than a sleep end at one


@dataclass(frozen=True, kw_only=True)
class Asked:
    """Where flights begin, where they are to go, and for how long; numbers or [flights]."""

    targets: ArrayLike  # m; 0: to the surface
    depths: ArrayLike  # m, at the start
    duration: float  # s
    speeds: ArrayLike = 0.0  # m/s, positive down
    volumes: ArrayLike | None = None  # m3, neutral where not given
    tick: float | None = None  # s, of the trajectories; None: what the law's times are made of


@dataclass(frozen=True, kw_only=True)
class Flights:
    """Trajectories on common times [n, flights], and the actions of each flight."""

    time: Array  # s [n]
    depth: Array  # m
    speed: Array  # m/s, positive down
    volume: Array  # m3
    energy: Array  # J of pump and valve [flights]; where it is not known, work on the water
    stopped: NDArray[np.bool_]  # flights that ended early: out of the water, or far too deep
    actions: tuple[Array, ...]  # [actions, 2]: time [s], change asked for [m3]; positive: pumped


def fly_floats(
    vehicle: Vehicle,
    law: Law,
    parameters: Any,
    asked: Asked,
    *,
    vary: Mapping[str, ArrayLike] | None = None,
    column: Column | None = None,
    seed: int | None = None,
) -> Flights:
    """Return the flights that are asked for, under the law with these parameters.

    vary: of `VARIED`. column: the water, the vehicle's own, psi z + trim_error, where not given.
    seed: of the sensors' noise; None: none.
    """
    inputs = (asked.targets, asked.depths, asked.speeds, *(vary or {}).values())
    every = np.broadcast_arrays(*(np.atleast_1d(np.asarray(x, float)) for x in inputs))
    if asked.volumes is not None:
        every = np.broadcast_arrays(*every, np.asarray(asked.volumes, float))
    targets, depths, speeds = every[:3]
    drawn = dict(zip(vary or {}, every[3:], strict=False))
    drag = drawn.pop("drag", None)
    if drag is not None:
        body = body_plant(vehicle)
        drawn |= {name: getattr(body, name) * drag for name in _DRAG}
    if column is None:  # parts of the hull are for the water of a cast
        plain = vehicle.hull.model_copy(update={"parts": (), "trapped_air": 0.0})
        vehicle = vehicle.model_copy(update={"hull": plain})
    data = simulate_ensemble(
        vehicle,
        count=len(targets),
        setpoints=[(0.0, targets)],
        duration=asked.duration,
        start_depth=depths,
        start_speed=speeds,
        start_volume=None if asked.volumes is None else every[-1],
        vary=drawn,
        seed=seed,
        law=law,
        parameters=parameters,
        sample_time=asked.tick or _tick(parameters),
        keep="trajectory",
        column=column,
    )
    time, command = data["time"].to_numpy(), data["command"].to_numpy()
    stopped = data["stop"].to_numpy() != 0
    actions = tuple(np.stack([time[own != 0.0], own[own != 0.0]], axis=1) for own in command.T)
    depth, speed, volume = (data[name].to_numpy() for name in ("depth", "speed", "volume"))
    return Flights(
        time=time,
        depth=depth,
        speed=speed,
        volume=volume,
        energy=data["energy"].to_numpy(),
        stopped=stopped,
        actions=actions,
    )


def _tick(parameters: Any) -> float:
    """Return the longest tick [s] that the times of a law are whole multiples of."""
    times = [round(getattr(parameters, name) / _FINEST) for name in ("dead", "run")]
    whole = math.gcd(*times)
    return _FINEST * whole / math.ceil(whole * _FINEST / _LONGEST)
