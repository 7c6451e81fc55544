"""Limit cycles in the simulator: what remains long after a disturbance, without noise.

An unstable cycle is the edge of what decays: it is found by halving the disturbance between one
that decays and one that grows, and looked at while the two runs still are alike.

Those of a law that changes the volume in steps, at moments of its own, are predicted here too. Each
has a cause, and is computed for that cause by itself (`docs/explanation/stability.md`):

- On its way through water in which its neutral volume changes by psi a metre the excess falls by
  |psi| w a second and with it the speed, by |psi|/(2 c_true) a second whatever it is. The law acts
  once a band is lost, so every 2 c_true (w_to - w_low)/|psi|, at the next decision.
- At rest, stiffer than the water (psi < 0), the vehicle stays where its volume is neutral. Volumes
  that are a step dV apart rest dV/|psi| apart: where that is more than the band holds, none is left
  in it, and it goes to and fro between two.
- What leaks lets the place of rest sink by leakage/|psi|, unseen below half a step of the speed,
  until the band is left: at most its width later.
- With a hull that gives way more (psi > 0) errors grow from any rest, and are caught once the band
  is left, after one more decision.
- A depth in steps shows speeds of a step over the time that a speed is measured in; where such a
  speed asks for half a step of the volume, the law acts on nothing.

The first is a prediction; of the others amplitudes are bounds.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.rate import RateParameters
from swimbladder.design.linear.pump_valve import drive_rates, moved_by_volume
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.stability.cycles import Cycle, Predicted
from swimbladder.design.tuning.margins import least_band
from swimbladder.design.tuning.trial import Runs, fly
from swimbladder.physics.dynamics import Plant, drag_per_mass, plant
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

_PERIODS = 60.0  # that a cycle is given to settle
_LOOKED = 0.3  # share of the run that is looked at
_ROUNDS = 7  # of halving, each between 40 lanes
_LANES = 40
_KICK = 0.03  # 1/s, speed over disturbance: at rest a law with a dead zone would stay where it is
_STEADY = 0.05  # deviation of amplitude within what is looked at, up to which it is a cycle


class Seen(NamedTuple):
    """What a simulation shows at its end."""

    cycles: bool  # it goes to and fro without end
    amplitude: float  # m, of the depth's first harmonic
    period: float  # s
    farthest: float  # m, from the set-point, over what is looked at


class Confirmed(NamedTuple):
    """A predicted cycle beside what the simulator does; None where no edge was found."""

    predicted: Predicted
    seen: Seen | None

    @property
    def errors(self) -> tuple[float, float]:
        """Prediction over simulation, less 1: of the depth's amplitude and of the period."""
        c, s = self.predicted.cycle, self.seen
        if c is None or s is None or not s.cycles:
            return math.nan, math.nan
        return self.predicted.depth_amplitude / s.amplitude - 1.0, c.period / s.period - 1.0


def measure(time: Array, depth: Array, reference: float) -> Seen:
    """Return the oscillation of a depth [m] about its mean: first harmonic and mean period."""
    x = depth - depth.mean()
    farthest = float(np.max(np.abs(depth - reference)))
    rising = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    if len(rising) < 3:
        return Seen(False, math.nan, math.nan, farthest)
    at = time[rising] - x[rising] * (time[1] - time[0]) / (x[rising + 1] - x[rising])
    # One period: from a crossing to the next that is farther than half of the slowest beat.
    w = _frequency(time, x, 2.0 * math.pi / float(np.mean(np.diff(at))))
    half = len(x) // 2
    first, second = (_size(time[s], x[s], w) for s in (slice(0, half), slice(half, None)))
    mean = 0.5 * (first + second)
    steady = mean > 1e-7 and abs(first - second) <= 2.0 * _STEADY * mean
    return Seen(steady, _size(time, x, w), 2.0 * math.pi / w, farthest)


def _frequency(time: Array, x: Array, guess: float) -> float:
    """Return the frequency [rad/s] of the strongest harmonic, by its spectrum, then refined."""
    h = float(time[1] - time[0])
    window = np.hanning(len(x))
    padded = 16 * len(x)
    spectrum = np.abs(np.fft.rfft(x * window, padded))
    lowest = int(2.0 * padded / len(x))
    k = lowest + int(np.argmax(spectrum[lowest:]))
    if k <= lowest or k + 1 >= len(spectrum):
        return guess
    a, b, c = np.log(spectrum[k - 1 : k + 2])
    return float(2.0 * math.pi * (k + 0.5 * (a - c) / (a - 2.0 * b + c)) / (padded * h))


def _size(time: Array, x: Array, w: float) -> float:
    columns = np.stack([np.ones_like(time), np.sin(w * time), np.cos(w * time)], axis=1)
    c = np.linalg.lstsq(columns, x, rcond=None)[0]
    return float(math.hypot(c[1], c[2]))


class Held(NamedTuple):
    """A vehicle that a law holds at a depth."""

    vehicle: Vehicle
    bound: BoundLaw
    depth: float  # m
    vary: Mapping[str, float] = {}  # fields of the plant that differ

    def fly(
        self, disturbances: Any, duration: float, *, speed: float = 0.0, quantised: bool = False
    ) -> Runs:
        """Return runs of `duration` [s] that start off by disturbances [m], without noise.

        speed [m/s]: at the start. quantised: whether the sensors round.
        """
        quiet = self.vehicle.sensors.model_copy(update={"depth_noise": 0.0, "volume_noise": 0.0})
        return fly(
            self.vehicle.model_copy(update={"sensors": quiet}),
            self.bound,
            target=self.depth,
            duration=duration,
            vary=self.vary,
            start_depth=self.depth + np.asarray(disturbances, float),
            start_speed=speed,
            seed=0 if quantised else None,
        )


def hold(
    held: Held, disturbance: float, period: float, *, quantised: bool = False, kick: float = _KICK
) -> Seen:
    """Return what remains of a vehicle that starts `disturbance` [m] off.

    period [s]: expected, which decides how long is simulated. quantised: whether the sensors round.
    kick [1/s]: of the disturbance, as speed.
    """
    speed = kick * disturbance
    runs = held.fly([disturbance], _PERIODS * period, speed=speed, quantised=quantised)
    late = runs.time >= (1.0 - _LOOKED) * runs.time[-1]
    return measure(runs.time[late], runs.depth[late, 0], held.depth)


def edge(held: Held, within: tuple[float, float], period: float) -> tuple[Seen, float] | None:
    """Return the cycle between what decays and what grows, and the disturbance [m] that parts them.

    within: disturbances [m] of which the least decays and the most grows; None where they do not.
    period [s]: expected.
    """
    low, high = within
    time, depths = np.empty(0), np.empty((0, 0))
    for k in range(_ROUNDS):
        off = np.geomspace(low, high, _LANES) if k == 0 else np.linspace(low, high, _LANES)
        time, depths, *_ = held.fly(off, 20.0 * period)
        error = np.abs(depths - held.depth)
        last = error[time >= time[-1] - 2.0 * period].max(axis=0)
        grows = ~(last < error.max(axis=0) / 3.0)  # nan: it left the water
        if grows[0] or not grows.any():
            return None
        first = int(np.argmax(grows))
        low, high = float(off[first - 1]), float(off[first])
        pair = depths[:, [first - 1, first]]
    apart = np.abs(pair[:, 0] - pair[:, 1]) > _STEADY * np.abs(pair[:, 0] - held.depth).max()
    until = float(time[int(np.argmax(apart))]) if apart.any() else float(time[-1])
    kept = (time <= until) & (time >= until - 3.5 * period)
    return measure(time[kept], pair[kept, 0], held.depth), low


_DECISION = "decision"  # where the loop is looked at
_LONGEST = 20.0 * 86400.0  # s, that a cycle is flown for
_SHORTEST = 200.0  # decisions, likewise at least
_DISTURBED = 5e-3  # m/s, at the start: an unstable rest is no rest
_FIRST = 3.0  # periods before what is looked at


def hunting(
    vehicle: Vehicle, bound: BoundLaw, *, depth: float, depths: tuple[float, float]
) -> tuple[Confirmed, ...]:
    """Return the limit cycles at a depth [m] and on the way between depths [m]."""
    if not isinstance(bound.parameters, RateParameters):
        return ()
    p = plant(moved_by_volume(vehicle))
    ways = [on_the_way(p, bound.parameters, down=down) for down in (True, False)]
    found = [Confirmed(one, _flown_way(vehicle, bound, one, depths)) for one in ways if one]
    rests = _at_rest(vehicle, p, bound.parameters, depth)
    found += [Confirmed(one, _flown_rest(vehicle, bound, one, depth)) for one in rests]
    return tuple(found)


def _predicted(
    cause: tuple[str, float, str], amplitude: float, period: float = math.nan, off: float = math.inf
) -> Predicted:
    """Return what a cause of a size in a unit makes by itself.

    amplitude [m], period [s], off [-]: error of both; inf: they are bounds.
    """
    cycle = Cycle(amplitude, 2.0 * math.pi / period, True, 0.0, off, off)
    return Predicted(*cause, _DECISION, cycle, amplitude, math.isinf(off))


def on_the_way(p: Plant, q: RateParameters, *, down: bool) -> Predicted | None:
    """Return how often the law makes up for the neutral volume that changes on its way.

    None where the hull speeds it up: beyond `far` haste is welcome.
    """
    if p.psi >= 0.0:
        return None
    wanted = q.far_speed if down else q.ascent_speed
    low = wanted - q.speed_band + 0.5 * q.speed_step
    if low <= 0.0:
        return None
    c = drag_per_mass(wanted, p) / (p.a_b * wanted * wanted)
    interval = q.dead + q.run
    falls = -p.psi / (2.0 * c)  # m/s2
    period = math.ceil((wanted - low) / falls / interval) * interval
    # A speed that falls steadily and jumps back: the depth is off its mean way by parabolas.
    amplitude = falls * period * period / 16.0
    source = f"compressibility, {'sinking' if down else 'rising'}"
    size = q.coefficient * (wanted**2 - low**2)
    return _predicted((source, size, "m3"), amplitude, period, 0.5 * interval / period)


def _at_rest(vehicle: Vehicle, p: Plant, q: RateParameters, depth: float) -> list[Predicted]:
    found: list[Predicted] = []
    quantum, step = vehicle.sensors.depth_quantum, q.volume_step

    def add(one: Predicted, cycles: bool = True) -> None:
        found.append(one if cycles else one._replace(cycle=None, bound=False))

    if p.psi > 0.0:
        most = q.tolerance + least_band(vehicle, p.psi, q, step)
        add(_predicted(("hull that gives way", p.psi, "m3/m"), most))
    elif p.psi < 0.0:
        half = 0.5 * step / -p.psi
        if step > 0.0:
            one = _predicted(("step of the volume", step, "m3"), half)
            add(one, cycles=half > q.tolerance)
        leak = drive_rates(vehicle, [depth]).leakage[0]
        if leak > 0.0 and leak / -p.psi < 0.5 * q.speed_step:
            period = 2.0 * q.tolerance * -p.psi / leak
            add(_predicted(("leakage", leak, "m3/s"), q.tolerance, period))
    if quantum > 0.0:
        shown = quantum / q.window
        acts = q.coefficient * shown**2 >= 0.5 * step and shown >= 0.5 * q.speed_step
        cycles = acts and p.psi != 0.0
        most = q.tolerance + 0.5 * quantum if cycles else math.nan
        add(_predicted(("quantum of the depth", quantum, "m"), most), cycles=cycles)
    return found


def _flown_way(
    vehicle: Vehicle, bound: BoundLaw, one: Predicted, depths: tuple[float, float]
) -> Seen | None:
    """Return how a flight through the depths goes on between two actions; None: too few."""
    assert one.cycle is not None
    (low, high), down, q = depths, one.source.endswith("sinking"), bound.parameters
    speed = q.far_speed if down else q.ascent_speed
    # Up it is asked to come to the surface: so it keeps its speed to the end.
    begin, target = (low, high) if down else (high, 0.0)
    until = (high - low - 2.0 * q.far) / speed
    if until < 3.0 * one.cycle.period:
        return None
    flown = fly(vehicle, bound, target=target, duration=until, start_depth=begin)
    times = flown.actions[0][:, 0]
    times = times[times > 0.5 * one.cycle.period]
    if len(times) < 3:
        return None
    periods = np.diff(times)
    within = (flown.time >= times[0]) & (flown.time <= times[-1])
    t, z = flown.time[within], flown.depth[within, 0]
    bent = z - np.polyval(np.polyfit(t, z, 2), t)
    period = float(np.mean(periods))
    return Seen(True, 0.5 * float(np.ptp(bent)), period, float(np.max(np.abs(bent))))


def _flown_rest(vehicle: Vehicle, bound: BoundLaw, one: Predicted, depth: float) -> Seen:
    """Return what remains of a flight that begins off the depth, one cause left in."""
    leaks, q = one.source == "leakage", bound.parameters
    period = 0.0 if one.cycle is None or math.isnan(one.cycle.period) else one.cycle.period
    duration = min(max(10.0 * period, _SHORTEST * (q.dead + q.run)), _LONGEST)
    a = vehicle.engine
    tight = a if leaks else a.model_copy(update={"leakage": 0.0, "creep": 0.0})
    quantised = one.source == "quantum of the depth"
    held = Held(vehicle.model_copy(update={"actuator": tight}), bound, depth)
    # Where no whole number of steps takes it to the middle of the band, on its way out of it.
    apart = q.volume_step / abs(vehicle.hull.psi) if vehicle.hull.psi else 0.0
    off = max(0.5 * apart, 1.5 * q.tolerance)
    flown = held.fly(off, duration, speed=_DISTURBED, quantised=quantised)
    return _remains(flown, depth, min(_FIRST * period, 0.3 * duration))


def _remains(flown: Runs, depth: float, since: float) -> Seen:
    kept = (flown.time >= max(since, 0.3 * float(flown.time[-1]))) & np.isfinite(flown.depth[:, 0])
    z = flown.depth[kept, 0]
    if len(z) < 8:
        return Seen(False, math.nan, math.nan, math.inf)
    seen = measure(flown.time[kept], z, depth)
    if seen.cycles or not math.isfinite(seen.period):
        return seen
    # Not of one size, but to and fro all the same: its mean period, and half of what it spans.
    goes_on = float(np.ptp(z[len(z) // 2 :])) > 0.8 * float(np.ptp(z[: len(z) // 2]))
    half = 0.5 * float(np.ptp(z))
    return Seen(goes_on and half > 1e-3, half, seen.period, seen.farthest)
