"""Water that internal waves move up and down, as the filter of `deep_filter` takes it.

Their vertical speed is white up to the buoyancy frequency, above which nothing swings (Munk, in
*Evolution of Physical Oceanography*, 1981, ch. 9: displacement falls as the square of frequency).
White noise through the flattest filter of second order has that spectrum::

    u'' = -2 d u'/tau - u/tau^2 + noise           d = 2^(-1/2)

with `tau` near the inverse of the buoyancy frequency. Layers are displaced by the integral of u and
come back within hours, so that their displacement is bounded: zeta' = u - zeta/`AWAY`.
"""

from __future__ import annotations

import math

from swimbladder.sim.engine.cache import part

AWAY = 7200.0  # s; with tau of 300 s 1.9 km of displacement per m/s of speed: 6 m for 3 mm/s
_D = math.sqrt(0.5)


@part
def swing(t, tau):  # type: ignore[no-untyped-def]
    """Return what u and u' become after t [s] without noise, and the way, as six numbers.

    They are: u by u, u by u' [s], u' by u [1/s], u' by u', the integral of u by u [s] and by u'
    [s2].
    """
    rate = _D / tau  # of decay and of the swing: d = (1 - d^2)^(1/2)
    decay = math.exp(-rate * t)
    even, odd = decay * math.cos(rate * t), decay * math.sin(rate * t)
    u_u, u_v = even + odd, odd / rate
    v_u, v_v = -odd / (rate * tau * tau), even - odd
    # u = -tau^2 u'' - 2 d tau u', integrated
    way_u = tau * tau * -v_u + 2.0 * _D * tau * (1.0 - u_u)
    way_v = tau * tau * (1.0 - v_v) - 2.0 * _D * tau * u_v
    return u_u, u_v, v_u, v_v, way_u, way_v


def displaced_variance(speed: float, tau: float) -> float:
    """Return the variance of the layers' displacement [m2], for that of their speed [m2/s2]."""
    # Of d/dt E[zeta u] and d/dt E[zeta u'], which are 0.
    back, w = 1.0 / AWAY, 1.0 / tau
    return speed / (back * (back + w * w / (2.0 * _D * w + back)))
