"""The law of profiling floats that pump and bleed: a change of volume for a change of speed.

A vehicle that sinks steadily at speed w is heavier than the water by k_dt w|w| / (rho g) in volume,
its drag turned round. To sink at another speed it has to change its volume by

    dV = c (w_to |w_to| - w_from |w_from|) with the opposite sign,  c = k_dt / (rho g)

whatever its neutral volume is, which therefore need not be known. So the float measures its
speed, asks which speed fits the way that is left, and where the two differ by more than a band
it pumps or bleeds once and sleeps. The speeds asked for fall in steps: far from the target, near
it, and nearer still; within the tolerance it is 0.

Read from the logs of a float of the MERMAID kind (OSEAN, firmware 452.012.300 V2.x, 2020): its
settings `far`, `near`, `rate`, `ascent`, `dead` and `coeff`, and what it did at each of 2,997
decisions (`docs/explanation/deep-dives.md` has the tables). Speeds are whole mbar/s there and
volumes whole 2 mL, and both steps decide what it does: a speed below half a step is rest.

- Beyond the tolerance it acts where it is too slow by the band or more; too fast by the band or
  more only within `far`: far from the target haste is welcome.
- Within the tolerance it acts where it moves away from the target at all, or towards it by more
  than the band.
- Rising to the surface it acts where it is too slow by the band or more, or too fast at all.

`decide` and `ascend` are homogeneous: depths may be pressures [Pa] and speeds their rates [Pa/s]
where the coefficient is per (Pa/s)2. The drive may give less than is asked, as one whose longest
run is shorter; the next decision sees that.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Annotated, NamedTuple

from swimbladder.control.law import Law, Measurement, Recipe, Setting, Way
from swimbladder.errors import NoAnswerError
from swimbladder.physics.dynamics import drag_per_mass, terminal_speed

_ROOM = 0.25  # of the stroke that is left, for a speed
_DECISIONS = 1.5  # intervals between two decisions, that a zone is flown through in
_RUN = 10.0  # s, least time to measure a speed in
_FINEST = 1e-4  # m/s, step of a speed
_GROWS = 0.5  # e-folds of an error between two decisions
_HOLDS = 86400.0  # s, of a trial that is about holding
# Tried for each goal: shares of the fastest speed, s of sleep, of what the band holds in volume.
_SHARES = {"fast": (1.0, 0.75, 0.5), "quiet": (0.5, 0.25), "energy": (0.7, 0.4, 0.25)}
_DEAD = {"fast": (30.0, 60.0, 120.0), "quiet": (60.0, 120.0, 300.0, 600.0), "energy": (60.0, 300.0)}
_STEPS = {"fast": (0.1,), "quiet": (0.05, 0.15, 0.4), "energy": (0.05, 0.2)}
_BANDS = (0.5, 1.0)  # of the slow speed, that a speed may be off


class RateParameters(NamedTuple):
    """Zones, speeds, steps and times."""

    coefficient: Annotated[float, "m3 s2/m2"]  # volume per speed squared, k_dt/(rho g)
    tolerance: Annotated[float, "m"]  # of the band around the target in which it is to rest
    near: Annotated[float, "m"]  # m from the target, beyond which `near_speed` is asked for
    far: Annotated[float, "m"]  # m from the target, beyond which `far_speed` is asked for
    slow_speed: Annotated[float, "m/s"]  # nearer than both
    near_speed: Annotated[float, "m/s"]
    far_speed: Annotated[float, "m/s"]
    ascent_speed: Annotated[float, "m/s"]  # to the surface
    speed_band: Annotated[float, "m/s"]  # a difference of speed that calls for an action
    speed_step: Annotated[float, "m/s"]  # speeds are rounded to; 0: not rounded
    volume_step: Annotated[float, "m3"]  # changes are rounded to; 0: not rounded
    dead: Annotated[float, "s"]  # from a decision to the next sample
    run: Annotated[float, "s"]  # over which a speed is measured
    window: Annotated[float, "s"]  # over which it is measured while the vehicle rests in the band


class RateState(NamedTuple):
    """What the law remembers between samples: where the vehicle was at two times before."""

    looking: float  # -, 1 while a speed is being measured
    resting: float  # -, 1 in the band after a sample that called for nothing
    old_time: float  # s
    old_depth: float  # m
    new_time: float  # s, later
    new_depth: float  # m
    speed: float  # m/s, as measured last


class Decision(NamedTuple):
    """What is to be done."""

    speed: float  # m/s that is asked for; the measured one where nothing is to be done
    change: float  # m3, positive makes the vehicle lighter; 0: nothing


def whole(number: float) -> float:
    """Return the nearest whole number, halves away from 0; up to 16,777,215."""
    size = abs(number) + 0.5
    found, power = 0.0, 8388608.0
    for _ in range(24):
        if size - found >= power:
            found = found + power
        power = 0.5 * power
    return math.copysign(found, number)


def rounded(number: float, step: float) -> float:
    """Return the nearest multiple of `step`; the number itself where the step is 0."""
    if step <= 0.0:
        return number
    return whole(number / step) * step


def volume_change(parameters: RateParameters, speed: float, wanted: float) -> float:
    """Return the change of volume that takes the vehicle from a speed to another [m3]."""
    excess = speed * abs(speed) - wanted * abs(wanted)
    return rounded(parameters.coefficient * excess, parameters.volume_step)


def approach_speed(parameters: RateParameters, distance: float) -> float:
    """Return the speed asked for at a distance from the target [m/s], not negative."""
    p = parameters
    if distance > p.far:
        return p.far_speed
    if distance > p.near:
        return p.near_speed
    return p.slow_speed


def decide(parameters: RateParameters, depth: float, speed: float, target: float) -> Decision:
    """Return what is to be done on the way to a target or at it.

    depth [m], speed [m/s, positive down] as measured, target [m].
    """
    p = parameters
    distance = abs(target - depth)
    down = 1.0 if target >= depth else -1.0
    seen = rounded(speed, p.speed_step)
    towards = down * seen
    # A whole number of steps is no sum of its parts in binary: half a step settles comparisons.
    band = p.speed_band - 0.5 * p.speed_step
    if distance <= p.tolerance:
        wanted, acts = 0.0, towards < 0.0 or towards > p.speed_band + 0.5 * p.speed_step
    else:
        wanted = approach_speed(p, distance)
        acts = towards <= wanted - band or (distance <= p.far and towards >= wanted + band)
    if not acts:
        return Decision(speed, 0.0)
    change = volume_change(p, seen, down * wanted)
    if change == 0.0 and distance > p.tolerance and towards != wanted:
        # less than a step of the volume: one step, or it would stay out of the band for good
        change = math.copysign(p.volume_step, down * (towards - wanted))
    return Decision(down * wanted, change)


def ascend(parameters: RateParameters, speed: float) -> Decision:
    """Return what is to be done on the way to the surface at a measured speed [m/s]."""
    p = parameters
    seen = rounded(speed, p.speed_step)
    band = p.speed_band - 0.5 * p.speed_step
    if -seen <= p.ascent_speed - band or -seen > p.ascent_speed + 0.5 * p.speed_step:
        return Decision(-p.ascent_speed, volume_change(p, seen, -p.ascent_speed))
    return Decision(speed, 0.0)


def ways(parameters: RateParameters) -> tuple[Way, ...]:
    """Return the speeds that are asked for, each with a distance from the target at which."""
    p = parameters
    inner, near, far = p.tolerance, max(p.near, p.tolerance), max(p.far, p.near, p.tolerance)
    found = [Way("far", p.far_speed, 2.0 * far)]
    if far > near:
        found.append(Way("near", p.near_speed, 0.5 * (near + far)))
    if near > inner:
        found.append(Way("slow", p.slow_speed, 0.5 * (inner + near)))
    return (*found, Way("ascent", p.ascent_speed, math.inf))


def initial(parameters: RateParameters, measurement: Measurement, reference: float) -> RateState:
    """Start asleep where the vehicle is; the first sample begins a measurement of the speed."""
    depth = measurement.depth if math.isfinite(measurement.depth) else reference
    time = measurement.time
    return RateState(0.0, 0.0, time, depth, time, depth, 0.0)


def step(
    parameters: RateParameters, state: RateState, measurement: Measurement, reference: float
) -> tuple[float, RateState, float]:
    """Return the change of volume [m3], the state and the time to the next sample [s].

    A speed takes two samples, `run` apart, save at rest in the band, where one is enough: the speed
    is then that over the last `window` or half of it. A reference of 0 or less is the surface.
    """
    p, now = parameters, measurement.time
    if not math.isfinite(measurement.depth):
        asleep = RateState(
            0.0, 0.0, state.old_time, state.old_depth, state.new_time, state.new_depth, state.speed
        )
        return 0.0, asleep, p.dead
    depth = measurement.depth
    inside = abs(reference - depth) <= p.tolerance and reference > 0.0
    if state.looking == 0.0 and (state.resting == 0.0 or not inside):
        fresh = RateState(1.0, 0.0, now, depth, now, depth, state.speed)
        return 0.0, fresh, p.run
    speed = state.speed
    if now > state.old_time:
        speed = (depth - state.old_depth) / (now - state.old_time)
    decision = ascend(p, speed) if reference <= 0.0 else decide(p, depth, speed, reference)
    if decision.change != 0.0 or not inside:
        return decision.change, RateState(0.0, 0.0, now, depth, now, depth, speed), p.dead
    after = RateState(
        0.0, 1.0, state.old_time, state.old_depth, state.new_time, state.new_depth, speed
    )
    if now - state.new_time >= 0.5 * p.window:
        after = RateState(0.0, 1.0, state.new_time, state.new_depth, now, depth, speed)
    return 0.0, after, p.dead


class RateSettings(NamedTuple):
    """What the law is tuned with."""

    speed: float  # m/s, far from the target
    dead: float  # s
    run: float  # s
    tolerance: float  # m
    slow: float  # m/s, next to the tolerance
    band: float  # -, of the slow speed, that a speed may be off
    step: float  # m/s
    volume_step: float  # m3


def gains(setting: Setting, chosen: RateSettings) -> RateParameters:
    """Return the parameters: the coefficient from the drag at the speed, zones from its time.

    Each zone is as wide as what is flown at its speed in two decisions, to see it and to act.
    """
    k, p = chosen, setting.plant
    interval = k.dead + k.run
    near_speed = min(max(2.0 * k.slow, 0.4 * k.speed), k.speed)
    near = k.tolerance + _DECISIONS * near_speed * interval
    return RateParameters(
        coefficient=drag_per_mass(k.speed, p) / (p.a_b * k.speed * k.speed),
        tolerance=k.tolerance,
        near=near,
        far=near + _DECISIONS * k.speed * interval,
        slow_speed=k.slow,
        near_speed=near_speed,
        far_speed=k.speed,
        ascent_speed=k.speed,
        speed_band=k.band * k.slow,
        speed_step=k.step,
        volume_step=k.volume_step,
        dead=k.dead,
        run=k.run,
        window=2.0 * interval,
    )


def fastest(setting: Setting) -> float:
    """Return the speed [m/s] that a share of the stroke drives, as much as is left everywhere."""
    assert setting.drive is not None  # a law of volume changes
    p = setting.plant
    return terminal_speed(p, p.a_b * _ROOM * setting.drive.room)


def lasts(setting: Setting, way: float, goal: str) -> float:
    """Return how long a trial over a way [m] lasts [s]: its last third is holding."""
    arrives = way / (_SHARES[goal][-1] * fastest(setting)) + 3600.0
    return max(1.6 * arrives, arrives + 7200.0 if goal == "fast" else _HOLDS)


def candidates(setting: Setting, goal: str, held: float) -> list[RateSettings]:
    """Return what is tried for a goal, `held` [m] being the tolerance.

    Raises NoAnswerError where pump, stroke, sensor or band leave nothing, with what does.
    """
    drive, p = setting.drive, setting.plant
    assert drive is not None  # a law of volume changes
    found, why = [], ""
    grows = math.sqrt(p.a_b * p.psi) if p.psi > 0.0 else 0.0
    quantum = drive.tick * max(drive.rate_out, drive.rate_in)
    holds = 2.0 * held * abs(p.psi)  # m3, that the band holds
    for share, dead, band, part in product(_SHARES[goal], _DEAD[goal], _BANDS, _STEPS[goal]):
        speed = share * fastest(setting)
        c = drag_per_mass(speed, p) / (p.a_b * speed * speed)
        runs = (2.0 * c * speed * speed + drive.start) / drive.rate_out
        if runs > min(dead, drive.longest):
            least = min(dead, drive.longest)
            turn = f"{runs:.3g} s to turn {100.0 * speed:.3g} cm/s round"
            at = f"at {1e6 * drive.rate_out:.3g} cm3/s, and may run for {least:.3g} s"
            longer = "A longer actuator.longest_run or a" if drive.longest < dead else "A"
            why = why or f"the pump needs {turn}, {at}. {longer} faster pump"
            continue
        # The speed of a whole band in a decision; a speed stands out of noise over `run`.
        slow = min(0.3 * speed, held / (dead + _RUN))
        noise = math.sqrt(2.0) * setting.noise
        run = max(_RUN, 5.0 * math.ceil(8.0 * noise / (band * slow) / 5.0))
        slow = min(slow, held / (dead + run))
        step = max(4.0 * noise / run, _FINEST)
        if step > 0.5 * band * slow or run > 10.0 * dead:
            why = (
                f"with {1e3 * setting.noise:.3g} mm of noise a speed of {100.0 * slow:.2g} cm/s, "
                f"which does not cross {2.0 * held:.3g} m between two decisions, is lost in it. "
                "A better depth sensor or a wider band (`hold=`)"
            )
            continue
        volume_step = max(part * (holds or c * slow * slow), quantum)
        volume_step = min(volume_step, max(c * slow * slow, quantum))
        if 0.0 < holds < 2.0 * volume_step:
            why = (
                f"the least change of the volume, {1e6 * volume_step:.3g} cm3, moves the place of "
                f"rest by {volume_step / abs(p.psi):.3g} m, and the band is {2.0 * held:.3g} m. "
                "Shorter least runs (actuator.quantum) or a wider band (`hold=`)"
            )
            continue
        if grows * (dead + run) > _GROWS:
            often = f"it decides every {dead + run:.3g} s"
            efold = f"errors grow e-fold in {1.0 / grows:.3g} s"
            why = f"the hull gives way so that {efold}, and {often}. A stiffer hull"
            continue
        found.append(RateSettings(speed, dead, run, held, slow, band, step, volume_step))
    if not found:
        raise NoAnswerError(f"no setting of the law 'rate' does it: {why} may help")
    return found


RATE = Law(
    name="rate",
    summary="pumps or bleeds once for a change of speed, k_dt w|w|/(rho g), and sleeps",
    command="volume change",
    parameters=RateParameters,
    state=RateState,
    step=step,
    initial=initial,
    band="tolerance",
    longest_wait=lambda p: max(p.dead, p.run),
    ways=ways,
    roundings=("speed_band", "speed_step", "volume_step"),
    recipe=Recipe(
        gains=gains,
        candidates=candidates,
        lasts=lasts,
        held=10.0,
        linear=False,
        example=RateSettings(0.1, 60.0, 10.0, 10.0, 0.02, 1.0, 1e-3, 2e-7),
    ),
)
