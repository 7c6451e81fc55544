"""State feedback on an observer that knows the volume and finds depth, speed and neutral volume.

The filter is that of `observers`. Inside, the volume follows the one that the state feedback asks
for, with the voltage that the load of the sea takes fed forward, eq. (30).

Near the set-point the motor may rest: the volume stays and the filter goes on, with gains of its
own, until the depth predicted for a time ahead leaves a band; then one move brings the volume to
where gains made for holds of that length want it. Deciding by events takes fewer of them than by
the clock (Astrom and Bernhardsson, IEEE CDC 2002, 2011).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from swimbladder.control import law
from swimbladder.control.observers import (
    Estimate,
    Observed,
    Resting,
    begin_estimate,
    estimate,
    feedback,
    limited,
    moves,
    trusted,
)
from swimbladder.control.records import from_leaves

_NEAR = 2.5  # times the band of predicted errors: depth errors in which the motor rests
_REST = 0.2  # of the time that a volume is held for: least time between two starts


class ObserverParameters(NamedTuple):
    """The model, the filter, the feedback and the actuator's limits."""

    model: Observed
    k_z: Annotated[float, "m3/m"]  # volume per depth error
    k_w: Annotated[float, "m3 s/m"]  # volume per speed error
    k_V: Annotated[float, "V/m3"]  # voltage per volume error
    dead: Annotated[float, "m3"]  # volume error below which the motor rests
    near: Annotated[float, "m"]  # depth error within which the motor rests; 0: none
    pause: Annotated[float, "s"]  # least time between two of its starts there
    band: Annotated[float, "m"]  # predicted error that starts it
    a_z: Annotated[float, ""]  # prediction per depth error
    a_w: Annotated[float, "s"]  # per speed
    a_V: Annotated[float, "m/m3"]  # per volume off neutral
    r_z: Annotated[float, "m3/m"]  # as k_z, for a volume that is held
    r_w: Annotated[float, "m3 s/m"]  # as k_w, likewise
    resting: Resting
    farthest: Annotated[float, "m"]  # a depth error beyond which no more volume is asked for
    depth_voltage: Annotated[float, "V/m"]  # load of the sea
    limit: Annotated[float, "V"]
    volume_min: Annotated[float, "m3"]
    volume_max: Annotated[float, "m3"]
    S_p: Annotated[float, "s"]


class ObserverState(NamedTuple):
    """What the law remembers between samples."""

    estimate: Estimate
    volume_reference: float  # m3, asked for at the sample before
    moving: float  # 1: the motor is on its way, 0: it rests
    rested: float  # s, since the motor was started near the set-point, no more than a pause


def initial(
    parameters: ObserverParameters, measurement: law.Measurement, reference: float
) -> ObserverState:
    """Start at rest with the volume as it is."""
    p = parameters
    e = begin_estimate(p.model, measurement, reference)
    return ObserverState(e, e.volume, 0.0, p.pause)


def step(
    parameters: ObserverParameters,
    state: ObserverState,
    measurement: law.Measurement,
    reference: float,
) -> tuple[float, ObserverState, float]:
    """Return the voltage [V] that brings the volume to what the estimated state asks for."""
    p = parameters
    volume = measurement.volume if math.isfinite(measurement.volume) else state.estimate.volume
    close = abs(reference - state.estimate.depth) < p.near
    trust = trusted(p.model.trust, p.resting, close)
    e = estimate(p.model, trust, state.estimate, volume, measurement.depth)
    # Volume: neutral there, less what sinks the vehicle towards the reference.
    error = limited(reference - e.depth, -p.farthest, p.farthest)
    resting = abs(error) < p.near
    k_z = p.r_z if resting else p.k_z
    k_w = p.r_w if resting else p.k_w
    wanted = p.model.psi * (e.depth + error) + e.neutral - k_z * error + k_w * e.speed
    wanted = limited(wanted, p.volume_min, p.volume_max)
    rested = p.pause
    if resting:
        rested = min(state.rested + p.S_p, p.pause)
        off = volume - p.model.psi * (e.depth + error) - e.neutral
        ahead = p.a_w * e.speed + p.a_V * off - p.a_z * error
        begins = state.moving == 0.0 and rested >= p.pause and abs(ahead) > p.band
        if not begins:
            wanted = state.volume_reference
        moving = moves(wanted - volume, state.moving, p.dead)
        if begins:
            rested = 0.0
        elif state.moving == 0.0:
            moving = 0.0
    else:
        moving = moves(wanted - volume, state.moving, p.dead)
    voltage = p.depth_voltage * e.depth + moving * p.k_V * (wanted - volume)
    return (
        limited(voltage, -p.limit, p.limit),
        ObserverState(e, wanted, moving, rested),
        p.S_p,
    )


def _gains(s: law.Setting, k: law.Knobs) -> ObserverParameters:
    found = feedback(s, k)
    names = "near", "pause", "band", "a_z", "a_w", "a_V", "r_z", "r_w", "n_z", "n_w", "n_b"
    rest = dict.fromkeys(names, 0.0)
    if k.pause > 0.0:
        from swimbladder.control.motion import filter_gains, held_motion, hold_gains

        F, G = held_motion(s.plant, k.pause)
        r_z, r_w = hold_gains(s.plant, k.pause)
        # While nothing moves, the walk of the neutral volume is all that has to be followed.
        N = filter_gains(
            s.plant, s.sample_time, depth=s.noise, acceleration=0.0, neutral_walk=s.walk
        )
        rest = {
            "near": _NEAR * k.band, "pause": _REST * k.pause, "band": k.band,
            "a_z": float(F[0, 0]), "a_w": float(F[0, 1]), "a_V": float(G[0]), "r_z": r_z,
            "r_w": r_w, "n_z": float(N[0]), "n_w": float(N[1]), "n_b": float(N[2]),
        }  # fmt: skip
    # A depth error that asks for half the room, by k_z.
    rest["farthest"] = law.STROKE * law.room_of(s.plant) / found["k_z"]
    return from_leaves(ObserverParameters, found | rest)


OBSERVER = law.Law(
    name="observer",
    summary="state feedback on estimates of depth, speed and neutral volume (Le Mezo et al. 2020)",
    command="voltage",
    parameters=ObserverParameters,
    state=ObserverState,
    step=step,
    initial=initial,
    volume_gain="k_V",
    dead_zone="dead",
    near="near",
    band="band",
    recipe=law.Recipe(
        gains=_gains, fast=law.FAST, quiet=law.QUIET, holds=(0.8, 1.0, 1.2), holds_best=True,
        bands=(2.2, 2.35, 2.5, 2.65, 2.8, 2.95, 3.1, 3.4, 3.8),
        example=law.Knobs(0.35, 0.9, 1.2, dead=1e-7, pause=6.0, band=0.02),
    ),
)  # fmt: skip
