"""Limit cycles of a law that changes the volume in steps, at moments of its own: foretold, flown.

Each has a cause, and is computed for that cause by itself (`docs/explanation/stability.md`):

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

from __future__ import annotations

import math
from typing import Any

import numpy as np

from swimbladder.control.law import Law
from swimbladder.control.rate import RateParameters
from swimbladder.design.linear.pump_valve import drive_rates, moved_by_volume
from swimbladder.design.stability.confirm import Seen, measure
from swimbladder.design.stability.cycles import Cycle, Predicted
from swimbladder.design.stability.result import Confirmed
from swimbladder.design.tuning.float_trial import Asked, Flights, fly_floats
from swimbladder.physics.dynamics import Plant, drag_per_mass, plant
from swimbladder.sim.mission.holding import least_band
from swimbladder.vehicle import Vehicle

_DECISION = "decision"  # where the loop is looked at
_LONGEST = 20.0 * 86400.0  # s, that a cycle is flown for
_SHORTEST = 200.0  # decisions, likewise at least
_KICK = 5e-3  # m/s, at the start: an unstable rest is no rest
_FIRST = 3.0  # periods before what is looked at


def hunting(
    vehicle: Vehicle, law: Law, parameters: Any, *, depth: float, depths: tuple[float, float]
) -> tuple[Confirmed, ...]:
    """Return the limit cycles at a depth [m] and on the way between depths [m]."""
    if not isinstance(parameters, RateParameters):
        return ()
    p = plant(moved_by_volume(vehicle))
    found = []
    for down in (True, False):
        one = on_the_way(p, parameters, down=down)
        if one is not None:
            found.append(Confirmed(one, _flown_way(vehicle, law, parameters, one, depths)))
    rests = _at_rest(vehicle, p, parameters, depth)
    found += [Confirmed(one, _flown_rest(vehicle, law, parameters, one, depth)) for one in rests]
    return tuple(found)


def _predicted(
    source: str, size: tuple[float, str], amplitude: float, period: float, error: float | None
) -> Predicted:
    """Return a prediction; amplitude [m], period [s], error: of both; None: they are bounds."""
    off = math.inf if error is None else error
    cycle = Cycle(amplitude, 2.0 * math.pi / period, True, 0.0, off, off)
    return Predicted(source, *size, _DECISION, cycle, amplitude, error is None)


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
    size = (q.coefficient * (wanted**2 - low**2), "m3")
    return _predicted(source, size, amplitude, period, 0.5 * interval / period)


def _at_rest(vehicle: Vehicle, p: Plant, q: RateParameters, depth: float) -> list[Predicted]:
    found: list[Predicted] = []
    if p.psi > 0.0:
        most = q.tolerance + least_band(vehicle, p.psi, q, q.volume_step)[0]
        found.append(_predicted("hull that gives way", (p.psi, "m3/m"), most, math.nan, None))
    elif p.psi < 0.0:
        apart = q.volume_step / -p.psi
        if apart > 2.0 * q.tolerance:
            size = (q.volume_step, "m3")
            found.append(_predicted("step of the volume", size, 0.5 * apart, math.nan, None))
        elif q.volume_step > 0.0:
            none = Predicted(
                "step of the volume", q.volume_step, "m3", _DECISION, None, 0.5 * apart
            )
            found.append(none)
        leak = drive_rates(vehicle, [depth]).leakage[0]
        if leak > 0.0 and leak / -p.psi < 0.5 * q.speed_step:
            period = 2.0 * q.tolerance * -p.psi / leak
            size = (leak, "m3/s")
            found.append(_predicted("leakage", size, q.tolerance, period, None))
    quantum = vehicle.sensors.depth_quantum
    if quantum > 0.0:
        shown = quantum / q.window
        acts = q.coefficient * shown**2 >= 0.5 * q.volume_step and shown >= 0.5 * q.speed_step
        if acts and p.psi != 0.0:
            amplitude = q.tolerance + 0.5 * quantum
            size = (quantum, "m")
            found.append(_predicted("quantum of the depth", size, amplitude, math.nan, None))
        else:
            none = Predicted("quantum of the depth", quantum, "m", _DECISION, None, math.nan)
            found.append(none)
    return found


def _flown_way(
    vehicle: Vehicle, law: Law, q: RateParameters, one: Predicted, depths: tuple[float, float]
) -> Seen | None:
    """Return how a flight through the depths goes on between two actions; None: too few."""
    assert one.cycle is not None
    (low, high), down = depths, one.source.endswith("sinking")
    speed = q.far_speed if down else q.ascent_speed
    begin, target = (low, high) if down else (high, low)
    until = (high - low - 2.0 * q.far) / speed
    if until < 3.0 * one.cycle.period:
        return None
    # Up it is asked to come to the surface: so it keeps its speed to the end.
    asked = Asked(targets=target if down else 0.0, depths=begin, duration=until)
    flown = fly_floats(vehicle, law, q, asked)
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


def _flown_rest(
    vehicle: Vehicle, law: Law, q: RateParameters, one: Predicted, depth: float
) -> Seen:
    """Return what remains of a flight that begins off the depth, one cause left in."""
    leaks = one.source == "leakage"
    known = one.cycle is not None and math.isfinite(one.cycle.period)
    period = one.cycle.period if one.cycle is not None and known else 0.0
    duration = min(max(10.0 * period, _SHORTEST * (q.dead + q.run)), _LONGEST)
    a = vehicle.actuator
    tight = a if leaks else a.model_copy(update={"leakage": 0.0, "creep": 0.0})
    quantised = one.source == "quantum of the depth"
    still = {"depth_noise": 0.0, "depth_quantum": vehicle.sensors.depth_quantum}
    sensors = vehicle.sensors.model_copy(update=still)
    alone = vehicle.model_copy(update={"actuator": tight, "sensors": sensors})
    # Where no whole number of steps takes it to the middle of the band, on its way out of it.
    apart = q.volume_step / abs(vehicle.hull.psi) if vehicle.hull.psi else 0.0
    begin = depth + max(0.5 * apart, 1.5 * q.tolerance)
    asked = Asked(targets=depth, depths=begin, duration=duration, speeds=_KICK)
    flown = fly_floats(alone, law, q, asked, seed=0 if quantised else None)
    return _remains(flown, depth, min(_FIRST * period, 0.3 * duration))


def _remains(flown: Flights, depth: float, since: float) -> Seen:
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
