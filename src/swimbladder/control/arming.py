"""Before a vehicle is armed: its actuator is held, and nothing is a reason to bring it up.

`step` has the form of a law's, so that it is translated as laws are. In place of a depth asked for
it takes the command that holds from then on, and gives it on once the vehicle is armed. Whoever
stands at the vehicle arms it; else the first submersion does. Nothing disarms it but a power-off.
What each rule is for: docs/explanation/supervisor.md.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from swimbladder.control.law import Count, Law, less, more

DISARMED = 0xA55A  # `deck` of a vehicle that is; memory that holds anything else is armed
ARMED = 0


class Deck(NamedTuple):
    """What is seen of a vehicle that is not armed; NaN for what could not be measured."""

    depth: float  # m, of the pressure sensor
    volume: float  # m3


class ArmingParameters(NamedTuple):
    """When a vehicle counts as under water."""

    S_p: Annotated[float, "s"]
    positioner: Annotated[float, ""]  # 1: commands are volumes
    volume_least: Annotated[float, "m3"]  # the least that can be commanded
    volume_most: Annotated[float, "m3"]  # the largest
    depth_least: Annotated[float, "m"]  # the least that the sensor can mean
    depth_most: Annotated[float, "m"]  # the largest
    submerged: Annotated[float, "m"]  # a depth under which it is under water
    under: Annotated[Count, "ticks"]  # ticks of it that arm
    blind: Annotated[Count, "ticks"]  # ticks without a depth that arm what was armed before


class ArmingState(NamedTuple):
    """What is remembered of a vehicle that is not armed."""

    deck: Count  # DISARMED; any other number: armed
    surfaced: bool  # it was at the surface, or in air, since the power came
    was_armed: bool  # when the power went, as far as is known
    restarted: bool  # armed by what can only be a loss of power in the dive
    under: Count  # ticks under water
    above: Count  # ticks above it
    blind: Count  # ticks without a depth
    held: float  # m3, that a positioner keeps; NaN: no volume was measured yet


def initial(parameters: ArmingParameters, seen: Deck, was_armed: float) -> ArmingState:
    """Return the state after power-on; was_armed: 1.0 where it is known to have been."""
    return ArmingState(
        deck=DISARMED,
        surfaced=False,
        was_armed=was_armed > 0.0,
        restarted=False,
        under=0,
        above=0,
        blind=0,
        held=seen.volume,
    )


def watch_depth(p: ArmingParameters, s: ArmingState, depth: float) -> ArmingState:
    """Count the ticks under water and above it; what is no depth says neither."""
    good = p.depth_least <= depth <= p.depth_most
    s = s._replace(blind=0 if good else more(s.blind, 1))
    if good and depth > p.submerged:
        s = s._replace(under=more(s.under, 1), above=0)
    elif good:
        s = s._replace(under=less(s.under, 2), above=more(s.above, 1))
    if s.above >= p.under:
        s = s._replace(surfaced=True, was_armed=False)
    return s


def step(
    parameters: ArmingParameters, state: ArmingState, seen: Deck, wanted: float
) -> tuple[float, ArmingState, float]:
    """Return the command [V or m3] that holds the actuator, or `wanted` once it is armed."""
    p, s = parameters, state
    if s.deck != DISARMED:
        return wanted, s, p.S_p
    s = watch_depth(p, s, seen.depth)
    if not math.isfinite(s.held) and p.volume_least <= seen.volume <= p.volume_most:
        s = s._replace(held=seen.volume)
    if s.under >= p.under or (s.was_armed and s.blind >= p.blind):
        s = s._replace(deck=ARMED, restarted=not s.surfaced)
        return wanted, s, p.S_p
    hold = s.held if p.positioner > 0.0 else 0.0
    return hold, s, p.S_p


ARMING = Law(
    name="arming",
    summary="holds the actuator until the vehicle is armed",
    command="voltage",
    parameters=ArmingParameters,
    state=ArmingState,
    step=step,
    initial=initial,
)
