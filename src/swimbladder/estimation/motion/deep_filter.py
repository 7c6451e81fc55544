"""A filter along a deep dive: what the vehicle would do, corrected at each measured pressure.

The state is pressure, speed, what is off, and what is not known::

    p' = rho g (w + u)
    m w' = rho g E - k w|w|                by `glide`
    u'' = -2 d u'/tau - u/tau^2 + noise    the water's speed, and
    zeta' = u - zeta/AWAY                  how far the layers have been moved, by `swing`
    E = N(p) - V(t) - V_0 - drift - G(p) zeta + sum c_j phi_j(p)

N is the neutral volume that follows from cast and hull, V what the runs have added, V_0 the drive's
volume at the beginning, drift its random walk, G the layers' neutral volume per metre, and c_j
deviations of the cast at its knots (hat functions phi_j), known to 1 before. An extended Kalman
filter (e.g. Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation*,
2001, section 10.3): what it expects and what is measured differ by innovations that are independent
whatever lasts between them, so that their likelihood gives intervals that allow for waves of an
hour and with a cast that errs. A pressure that is off by more than `gate` deviations counts as one
that is off by so much (Huber).

Internal waves move the water up and down. Their vertical speed is white up to the buoyancy
frequency, above which nothing swings (Munk, in *Evolution of Physical Oceanography*, 1981, ch. 9:
displacement falls as the square of frequency). White noise through the flattest filter of second
order has that spectrum::

    u'' = -2 d u'/tau - u/tau^2 + noise           d = 2^(-1/2)

with `tau` near the inverse of the buoyancy frequency. Layers are displaced by the integral of u and
come back within hours, so that their displacement is bounded: zeta' = u - zeta/`AWAY`.

At rest the slope of a speed by the force is without bound under quadratic drag. There, where drag
is not quadratic either, slopes are those at the speed `_SLOW`: else the likelihood is rough.

Under a constant force and quadratic drag speed and way have closed forms, with slopes:
m w' = F - k w|w|. With v along the force, v_e = (F/k)^(1/2), a = (F k)^(1/2)/m and r = v/v_e::

    v >= 0:  v(t) = v_e (r + tanh at)/(1 + r tanh at),   way = (m/k) ln(cosh at + r sinh at)
    v < 0:   v(t) = v_e (r + tan at)/(1 - r tan at),     way = -(m/k) ln(cos at - r sin at)

the second until it stops at t = atan(-r)/a (e.g. Lamb, *Dynamics*, 2nd ed. 1923, ch. 12, on motion
against the square of the speed). Exact, so that steps may be longer than the vehicle's lag.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from swimbladder.estimation.series import Index
from swimbladder.io.files import source_hash
from swimbladder.physics.arrays import Array
from swimbladder.sim.engine.cache import compiled, part

_SLOW = 3e-3  # m/s, as the water usually moves: a slower vehicle's slopes are those at this speed
_LEAST = 1e-9  # N; some 1e-7 mL of volume


class Noise(NamedTuple):
    """Standard deviations of what the model does not know, and how long the water's lasts."""

    pressure: float  # Pa, of a measured pressure
    water: float  # m/s, of the water's vertical speed
    drift: float  # m3/s^0.5, of the drive's or the hull's volume
    runs: float  # -, of the volume of a run
    lasts: float  # s, for how long the water's speed stays alike, tau; no deviation


class Resistance(NamedTuple):
    """What a force has to move."""

    mass: float  # kg, accelerated
    down: float  # N s2/m2, drag k while sinking
    up: float  # N s2/m2, while rising


class Track(NamedTuple):
    """Steps [m] and samples [n] of a dive, and how the cast may err at knots [j]."""

    steps: Array  # s [m]
    sample: Index  # [m], sample at the end of a step, or -1
    measured: Array  # Pa [n]
    rounding: Array  # Pa2 [n], variance by the resolution of pressures and times
    begun: Array  # m3 [m], nominal volume of runs that begin in a step
    knots: Array  # Pa [j]
    width: Array  # m3 [j], deviation of the neutral volume by errors of the cast


Moved = tuple[float, float, float, float, float, float]  # speed, way, see `glide`


@part
def glide(w: float, force: float, body: Resistance, t: float) -> Moved:
    """Return speed [m/s] and way [m] after t [s], both by w [-], [s] and by force, as six numbers.

    They are: speed, way, speed by w, speed by force, way by w, way by force. w: speed at the
    beginning [m/s], force [N].
    """
    sign, m = 1.0 if force >= 0.0 else -1.0, body.mass
    k, back = (body.down, body.up) if sign > 0.0 else (body.up, body.down)
    f, v = max(abs(force), _LEAST), sign * w
    r, a = v / math.sqrt(f / back), math.sqrt(f * back) / m
    stop = math.atan(-r) / a if r < 0.0 else 0.0
    if stop == 0.0:
        speed, way, by_w, by_f, way_w, way_f = _moved(v, f, m, k, t, 1.0)
    elif stop >= t:
        speed, way, by_w, by_f, way_w, way_f = _moved(v, f, m, back, t, -1.0)
    else:
        one, length = 1.0 + r * r, m / back
        stop_v, stop_f = -1.0 / (one * f / m), (r / (one * a) - stop) / (2.0 * f)
        speed, way, grows, by_f, _, by_way = _moved(0.0, f, m, k, t - stop, 1.0)
        gain = f / m * grows
        way += -0.5 * length * math.log(one)
        by_w, by_f = -gain * stop_v, by_f - gain * stop_f
        way_w = -length * r / one / math.sqrt(f / back) - speed * stop_v
        way_f = length * r * r / one / (2.0 * f) + by_way - speed * stop_f
    return sign * speed, sign * way, by_w, by_f, way_w, way_f


@part
def _moved(v: float, f: float, mass: float, k: float, t: float, along: float) -> Moved:
    """Return what `glide` does, of motion along the force (1) or against it (-1) all the time."""
    a, steady, length = math.sqrt(f * k) / mass, math.sqrt(f / k), mass / k
    r, x = v / steady, a * t
    if along > 0.0:  # cosh x + r sinh x = e^x (1 - (1 - r) far/2), tanh x = far/(2 - far)
        far = -math.expm1(-2.0 * x)
        q, way = far / (2.0 - far), length * (x + math.log1p(-0.5 * (1.0 - r) * far))
    else:
        q, way = math.tan(x), -length * math.log(math.cos(x) - r * math.sin(x))
    n = 1.0 / (1.0 + along * r * q)
    speed, grows = steady * (r + q) * n, (1.0 - along * q * q) * n * n
    by_f = (speed + steady * grows * ((1.0 - along * r * r) * x - r)) / (2.0 * f)
    way_f = length * n * ((q + r) * x - r * q) / (2.0 * f)
    return speed, way, grows, by_f, length / steady * q * n, way_f


AWAY = 7200.0  # s; with tau of 300 s 1.9 km of displacement per m/s of speed: 6 m for 3 mm/s
_D = math.sqrt(0.5)


@part
def swing(t: float, tau: float) -> Moved:
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


SPACING = 1e4  # Pa, of the water's table
DYNAMIC = 7
P, W, U, Z, RATE, D, V0 = 0, 1, 2, 3, 4, 5, 6  # RATE: u'
_MOVED = 5  # states that a step changes: not D, V0 and the errors of the cast


class _Step(NamedTuple):
    """Slopes of a step: what is after it by what was before, see `_stepped`."""

    slope: float  # m3/Pa, E by pressure
    below: float  # Pa s/m, pressure in the middle by the speeds of vehicle and water
    layers: float  # m3/m, -E by zeta
    weight: float  # Pa/m
    glide: tuple[float, float, float, float]  # speed by speed and by E, way by speed and by E
    swing: Moved  # as `swing` gives it
    back: float  # -, zeta by zeta


@part
def _stepped(
    step: _Step, p: float, w: float, u: float, z: float, rate: float, rest: float
) -> tuple[float, float, float, float, float]:
    """Return p, w, u, zeta, u' after a step: of a state, or of its covariances with another.

    rest: of E by all that stays as it is.
    """
    (w_w, w_e, way_w, way_e), (u_u, u_r, r_u, r_r, way_u, way_r) = step.glide, step.swing
    heavy = step.slope * (p + step.below * (w + u)) - step.layers * z + rest
    carried = way_u * u + way_r * rate
    p += step.weight * (way_w * w + way_e * heavy + carried)
    w = w_w * w + w_e * heavy
    return p, w, u_u * u + u_r * rate, step.back * z + carried, r_u * u + r_r * rate


def _filter(
    track: Track,
    volume: Array,
    water: Array,
    body: Resistance,
    noise: Noise,
    gate: float,
    x: Array,
    C: Array,
) -> tuple[Array, Array]:
    """Return the innovations of the samples [n] and their variances; x and C as they end.

    volume [m]: m3 in the middle of each step, V; water [k, 3], every `SPACING`: N [m3], rho g
    [Pa/m], G [m3/m]. gate: deviations from which a pressure counts less. x [DYNAMIC + j], C.
    """
    steps, knots, tau = track.steps, track.knots, noise.lasts
    v, S = np.zeros(len(track.measured)), np.ones(len(track.measured))
    n, last, ends = len(x), len(water) - 2, len(knots) - 2
    gain, half = x.copy(), np.zeros((_MOVED, _MOVED))
    j = 0
    for i in range(len(steps)):
        t = steps[i]
        if i == 0 or t != steps[i - 1]:
            water_swing, back = swing(t, tau), math.exp(-t / AWAY)
        k = min(max(int(x[P] / SPACING), 0), last)
        middle = x[P] + 0.5 * t * water[k, 1] * (x[W] + x[U])
        k = min(max(int(middle / SPACING), 0), last)
        s = middle / SPACING - k
        rise = water[k + 1, 0] - water[k, 0]
        weight = water[k, 1] + s * (water[k + 1, 1] - water[k, 1])
        layers = water[k, 2] + s * (water[k + 1, 2] - water[k, 2])
        while j > 0 and knots[j] > middle:
            j -= 1
        while j < ends and knots[j + 1] < middle:
            j += 1
        share = min(max((middle - knots[j]) / (knots[j + 1] - knots[j]), 0.0), 1.0)
        a, b = (1.0 - share) * track.width[j], share * track.width[j + 1]
        one, two = DYNAMIC + j, DYNAMIC + j + 1
        heavy = water[k, 0] + s * rise - volume[i] - x[V0] - x[D] - layers * x[Z]
        heavy += a * x[one] + b * x[two]
        force, least = weight * heavy, body.down * _SLOW * _SLOW
        w, way, w_w, w_f, s_w, s_f = glide(x[W], force, body, t)
        if abs(force) < least:
            _, _, w_w, w_f, s_w, s_f = glide(x[W], math.copysign(least, force), body, t)
        slopes = (w_w, weight * w_f, s_w, weight * s_f)
        step = _Step(rise / SPACING, 0.5 * t * weight, layers, weight, slopes, water_swing, back)
        carried = x[U] * water_swing[4] + x[RATE] * water_swing[5]
        _, _, x[U], x[Z], x[RATE] = _stepped(step, 0.0, 0.0, x[U], x[Z], x[RATE], 0.0)
        x[P] += weight * (way + carried)
        x[W] = w
        # F C F', of which only the first rows and columns are not those of C. Of these the rows
        # are kept; the columns are brought up to date at the end.
        for r in range(_MOVED):
            rest = a * C[r, one] + b * C[r, two] - C[r, D] - C[r, V0]
            c = _stepped(step, C[P, r], C[W, r], C[U, r], C[Z, r], C[RATE, r], rest)
            half[P, r], half[W, r], half[U, r], half[Z, r], half[RATE, r] = c
        for r in range(_MOVED, n):
            rest = a * C[one, r] + b * C[two, r] - C[D, r] - C[V0, r]
            c = _stepped(step, C[P, r], C[W, r], C[U, r], C[Z, r], C[RATE, r], rest)
            C[P, r], C[W, r], C[U, r], C[Z, r], C[RATE, r] = c
        for r in range(_MOVED):
            rest, h = a * C[r, one] + b * C[r, two] - C[r, D] - C[r, V0], half[r]
            c = _stepped(step, h[P], h[W], h[U], h[Z], h[RATE], rest)
            C[P, r], C[W, r], C[U, r], C[Z, r], C[RATE, r] = c
        # What keeps u and u' as they are in the mean: noise.water, and noise.water/tau.
        a, b = noise.water * noise.water, (noise.water / tau) ** 2
        u_u, u_r, r_u, r_r, _, _ = water_swing
        C[U, U] += a * (1.0 - u_u * u_u) - b * u_r * u_r
        C[RATE, RATE] += b * (1.0 - r_r * r_r) - a * r_u * r_u
        mixed = a * u_u * r_u + b * u_r * r_r
        C[U, RATE] -= mixed
        C[RATE, U] -= mixed
        C[D, D] += noise.drift * noise.drift * t + (noise.runs * track.begun[i]) ** 2
        at = track.sample[i]
        if at >= 0:
            v[at] = track.measured[at] - x[P]
            S[at] = C[P, P] + noise.pressure * noise.pressure + track.rounding[at]
            counts = min(1.0, gate * math.sqrt(S[at]) / max(abs(v[at]), 1e-300))
            for r in range(n):
                gain[r] = C[P, r] / S[at]
            for r in range(n):
                x[r] += gain[r] * v[at] * counts
                for q in range(n):
                    C[r, q] -= gain[r] * gain[q] * (S[at] * counts)
    C[_MOVED:, :_MOVED] = C[:_MOVED, _MOVED:].T
    return v, S


filter_kernel = compiled(_filter, under=f"deep-{source_hash([Path(__file__)])}")
