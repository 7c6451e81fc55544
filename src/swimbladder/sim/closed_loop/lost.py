"""What makes a vehicle heavier than its neutral volume says: a leak, a drifting trim, the swell.

It acts as a volume d that is lost: the engine's V and its end stops are those of the vehicle less
d, which moves the hull just so, and leaves the exponentials as they are. d is held over a tick.
"""

from __future__ import annotations

import math

from swimbladder.sim.closed_loop.rows import (
    DRIFT,
    HIGH_V,
    LEAK,
    LOST,
    LOW_V,
    MODE,
    N_PLANT,
    PLANT,
    SEEN_VOLUME,
    SWELL,
    SWELL_DECAY,
    SWELL_OMEGA,
    SWELL_PHASE,
    WATER,
    V,
    Z,
)
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.modes import BOTTOM, V_MAX, V_MIN, resting_volume, split


@inlined
def _swell(S, W_, i, t):  # type: ignore[no-untyped-def]
    """Return the volume [m3] whose loss pulls as the swell does at lane i's depth and time t [s].

    A neutral hull moves with the water, and the pressure it sees stays as it is (Airy waves); this
    is what is left of a hull that is long or not neutral. It dies out as exp(-omega^2 z/g).
    """
    fades = math.exp(-S[SWELL_DECAY * W_ + i] * max(S[Z * W_ + i], 0.0))
    angle = S[SWELL_OMEGA * W_ + i] * t + S[SWELL_PHASE * W_ + i]
    return S[SWELL * W_ + i] * fades * math.cos(angle)


@part
def lose(S, W_, i, p, t, dt, layers):  # type: ignore[no-untyped-def]
    """Set what is lost in lane i at time t [s], dt [s] after it was set last.

    p: room for the lane's parameters.
    """
    S[WATER * W_ + i] += S[LEAK * W_ + i] * dt
    lost = S[WATER * W_ + i] + S[DRIFT * W_ + i] * t
    if S[SWELL * W_ + i] > 0.0:
        lost += _swell(S, W_, i, t)
    change = lost - S[LOST * W_ + i]
    if change != 0.0:
        S[LOST * W_ + i] = lost
        S[V * W_ + i] -= change
        for row in (PLANT + V_MIN, PLANT + V_MAX, LOW_V, HIGH_V):
            S[row * W_ + i] -= change
        if split(int(S[MODE * W_ + i]))[2] == BOTTOM:
            for n in range(N_PLANT):
                p[n] = S[(PLANT + n) * W_ + i]
            S[HIGH_V * W_ + i] = min(p[V_MAX], resting_volume(p, layers, S[Z * W_ + i]))
    S[SEEN_VOLUME * W_ + i] = S[V * W_ + i] + lost
