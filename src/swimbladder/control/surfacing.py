"""What the processor of a float with pump and valve does at the surface, around its law.

A law of volume changes needs water above and below the vehicle. Above a depth `shallow` the
processor acts itself: to surface it moves the volume to its upper limit, and to dive it lets in as
much as makes the vehicle sink, run by run until it does. Everywhere else the law decides.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

LAW, OUT, IN, WAIT = 0.0, 1.0, 2.0, 3.0
"""Who acts: the law; the pump, until all volume is out; the valve, by a change; nobody."""

_SINKS = 0.05  # m; deeper by less since the last sample, it still floats


class SurfacingParameters(NamedTuple):
    """Depth and volumes of a vehicle at the surface."""

    shallow: Annotated[float, "m"]  # above which it has come up, or is about to dive
    neutral: Annotated[float, "m3"]  # neutral volume at the surface
    full: Annotated[float, "m3"]  # all volume out
    lacking: Annotated[float, "m3"]  # of it, where it floats: not worth a run
    slack: Annotated[float, "m3"]  # below the neutral volume: it sinks at the speed of the law
    measured: Annotated[float, ""]  # 1: the volume is measured; 0: only changes of it are known


class SurfacingState(NamedTuple):
    """What it remembers from sample to sample."""

    depth: float  # m, of the last sample while about to dive
    dives: float  # 1: it has let in volume since it floated with all volume out


def at_surface(
    parameters: SurfacingParameters, state: SurfacingState, depth: float, volume: float,
    reference: float, floats: float,
) -> tuple[float, float, SurfacingState]:  # fmt: skip
    """Return who acts, what is wanted [m3], and the state.

    That is the change of volume, or, for `IN` where it is measured, the volume to go down to.
    depth [m] and volume [m3] as measured; a reference [m] of 0 or less is the surface. floats: 1
    where the vehicle is known to float there with all volume out.
    """
    p = parameters
    if depth <= p.shallow and reference <= 0.0:
        short = p.full - volume
        if floats > 0.0 and short <= p.lacking:
            return WAIT, 0.0, SurfacingState(depth, 0.0)
        return OUT, short, state
    if depth <= p.shallow and reference > p.shallow:
        sinks = depth - state.depth >= _SINKS
        wanted = 0.0
        if p.measured > 0.0:
            wanted = p.neutral - p.slack
            if volume <= wanted and not sinks:
                wanted = volume - p.slack
        elif not sinks:
            wanted = -p.slack
            if state.dives == 0.0:
                wanted = wanted - (p.full - p.neutral)
        return IN, wanted, SurfacingState(depth, 1.0)
    return LAW, 0.0, state
