"""A vehicle under a constant force and quadratic drag: speed and way in closed form, with slopes.

m w' = F - k w|w|. With v along the force, v_e = (F/k)^(1/2), a = (F k)^(1/2)/m and r = v/v_e::

    v >= 0:  v(t) = v_e (r + tanh at)/(1 + r tanh at),   way = (m/k) ln(cosh at + r sinh at)
    v < 0:   v(t) = v_e (r + tan at)/(1 - r tan at),     way = -(m/k) ln(cos at - r sin at)

the second until it stops at t = atan(-r)/a (e.g. Lamb, *Dynamics*, 2nd ed. 1923, ch. 12, on motion
against the square of the speed). Exact, so that steps may be longer than the vehicle's lag.
"""

from __future__ import annotations

import math

from swimbladder.sim.engine.cache import part

_LEAST = 1e-9  # N; some 1e-7 mL of volume


@part
def glide(w, force, mass, down, up, t):  # type: ignore[no-untyped-def]
    """Return speed [m/s] and way [m] after t [s], both by w [-], [s] and by force, as six numbers.

    They are: speed, way, speed by w, speed by force, way by w, way by force. w: speed at the
    beginning [m/s], force [N], mass [kg]; down, up: drag k while sinking and rising [N s2/m2].
    """
    sign = 1.0 if force >= 0.0 else -1.0
    f = max(abs(force), _LEAST)
    v, way = sign * w, 0.0
    if v < 0.0:
        k = down if sign < 0.0 else up
        a, steady = math.sqrt(f * k) / mass, math.sqrt(f / k)
        r = v / steady
        stop = math.atan(-r) / a
        if stop >= t:
            x = a * t
            q = math.tan(x)
            n = 1.0 / (1.0 - r * q)
            speed, grows = steady * (r + q) * n, (1.0 + q * q) * n * n
            by_f = (speed + steady * grows * ((1.0 + r * r) * x - r)) / (2.0 * f)
            length = mass / k
            return (
                sign * speed, -sign * length * math.log(math.cos(x) - r * math.sin(x)),
                grows, by_f, length / steady * q * n,
                length * n * ((q + r) * x - r * q) / (2.0 * f),
            )  # fmt: skip
        one = 1.0 + r * r
        way = -0.5 * mass / k * math.log(one)
        way_v, way_f = -mass / k * r / one / steady, mass / k * r * r / one / (2.0 * f)
        stop_v, stop_f = -1.0 / (steady * one * a), (r / (one * a) - stop) / (2.0 * f)
        speed, on, grows, by_f, way_w, by_way = _along(0.0, f, mass, up if sign < 0.0 else down,
                                                       t - stop)  # fmt: skip
        gain = f / mass * grows
        return (
            sign * speed, sign * (way + on), -gain * stop_v, by_f - gain * stop_f,
            way_v - speed * stop_v, way_f + by_way - speed * stop_f,
        )  # fmt: skip
    speed, on, grows, by_f, way_w, by_way = _along(v, f, mass, up if sign < 0.0 else down, t)
    return sign * speed, sign * on, grows, by_f, way_w, by_way


@part
def _along(v, f, mass, k, t):  # type: ignore[no-untyped-def]
    """Return what `glide` does, of motion along the force."""
    a, steady, length = math.sqrt(f * k) / mass, math.sqrt(f / k), mass / k
    r, x = v / steady, a * t
    q = math.tanh(x)
    n = 1.0 / (1.0 + r * q)
    if x < 20.0:
        way = length * math.log(math.cosh(x) + r * math.sinh(x))
    else:  # cosh and sinh are e^x/2 to the last digit
        way = length * (x + math.log(0.5 * (1.0 + r)))
    speed, grows = steady * (r + q) * n, (1.0 - q * q) * n * n
    return (
        speed, way, grows, (speed + steady * grows * ((1.0 - r * r) * x - r)) / (2.0 * f),
        length / steady * q * n, length * n * ((q + r) * x - r * q) / (2.0 * f),
    )  # fmt: skip
