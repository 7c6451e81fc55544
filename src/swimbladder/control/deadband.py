"""A law for floats that must sleep: it acts when depth or speed leaves a band, and then sleeps.

From wake to wake the vehicle is predicted by its model, T2 dw/dt + w = K2 (psi z + b - V), eqs (18)
and (31), as far as the volume really was, and so is what an error of the neutral volume b would do
to the depth. How far the depth seen at the next wake is off then determines b and the speed,
weighted by the noise of the depth (a Kalman filter's step with one unknown): the longer the sleep,
the surer.

In the band the motor rests. Outside, the volume is moved once to the one that brings the vehicle to
the reference in a few sleeps (see `deadband_gains`), and so on at each wake until it would coast to
rest in the inner half of the band. The volume is neutral then, and the sleep as long as half of the
way to the band's edge takes, from `interval` to `longest`, at most twice the last one. The two
bands, one to act and one to rest, keep noise from moving the motor.

A change of the reference is seen at the next wake. Asleep the motor has the voltage that holds the
load, and how far the volume creeps meanwhile shows what a voltage does: a driver that gives half or
twice of what is commanded, a load other than assumed. A move that does not get there, or past
what a late command may add, ends after half an interval. A drive that holds by itself has
`depth_voltage` 0.

Missions whose drive goes to a volume by itself hold a depth by the same estimate and decision
(`hold_begin`, `hold_step`): what is commanded is one change of volume at a wake, and the drive has
got there long before the next. Where the law `rate` is content with the speed at which drag
balances the excess volume, this one takes into account the vehicle's inertia and how far it gives
way, T2 and psi, so that it also holds a vehicle that diverges faster than it comes to a steady
speed. There depths count from the one that is held, where `neutral` is the volume at rest.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from swimbladder.control.law import Law, Measurement, Recipe, Setting, TuningParameters, stiffness
from swimbladder.control.observer import limited
from swimbladder.errors import InputError

_DEEPEST = 12000.0  # m, beyond it a depth is none
_LARGEST = 1000.0  # m3, beyond it a volume is none
_QUICKEST = 20.0  # m/s, beyond it no speed is believed
_HOUR = 3600.0  # s, longest sleep of a vehicle that does not diverge
_ASLEEP = 0.6  # e-folds of diverging that may pass unseen
_SAMPLES = 10.0  # that a move has, at least, until it is given up
_LEAST = 0.4  # share of what a voltage should do that is believed
_MOST = 2.5  # likewise
_INNER = 0.5  # share of the band in which the vehicle is left to itself

_FADING = 0.25  # of an error, that is left in an interval
_STEP = 10.0  # times the noise: what a change of the neutral volume moves in an interval


class DeadbandGains(NamedTuple):
    """What follows from the model for a time between wakes."""

    k_z: float  # 1/s
    k_w: float  # -
    growth: float  # -
    longest: float  # s


class DeadbandParameters(NamedTuple):
    """The model, the bands, the times and the motor."""

    K2: Annotated[float, "1/m2/s"]  # speed per volume
    T2: Annotated[float, "s"]
    psi: Annotated[float, "m3/m"]  # neutral volume per depth
    depth_noise: Annotated[float, "m"]  # 1 sigma
    neutral_step: Annotated[float, "m3"]  # change of the neutral volume between wakes, 1 sigma
    band: Annotated[float, "m"]  # depth errors that are left alone
    speed_band: Annotated[float, "m/s"]  # speeds that are left alone
    fastest: Annotated[float, "m/s"]  # speed that is asked for at most
    k_z: Annotated[float, "1/s"]
    k_w: Annotated[float, ""]
    growth: Annotated[float, ""]  # of a deviation over an interval; 1 where psi is not above 0
    interval: Annotated[float, "s"]  # shortest sleep
    longest: Annotated[float, "s"]  # longest sleep
    k_pV: Annotated[float, "V/m3"]
    tolerance: Annotated[float, "m3"]  # nearer than this the volume counts as reached
    depth_voltage: Annotated[float, "V/m"]  # k_z/k_u
    rate_per_volt: Annotated[float, "m3/s/V"]  # of the volume, K1 A
    voltage_limit: Annotated[float, "V"]
    volume_min: Annotated[float, "m3"]
    volume_max: Annotated[float, "m3"]
    S_p: Annotated[float, "s"]


class DeadbandState(NamedTuple):
    """What the law remembers between wakes."""

    begun: float  # -, 1 once a depth and a volume have been seen
    depth: float  # m, as predicted or seen
    speed: float  # m/s, estimated
    depth_slope: float  # m/m3, of the depth against the neutral volume since a depth was used
    speed_slope: float  # m/s/m3, of the speed against it
    neutral: float  # m3, estimated at depth 0
    volume: float  # m3, at the wake before
    voltage: float  # V, since then
    share: float  # -, what a voltage was seen to do of what it should
    acting: float  # -, 1 while the vehicle is brought back
    moving: float  # s, since the motor was started; 0 while it rests
    sleep: float  # s, from when the motor started to the next sample at the depth
    waited: float  # s, until the wake to come
    goal: float  # m, the reference
    volume_reference: float  # m3


class Predicted(NamedTuple):
    """Where the model says that the vehicle is, and how that depends on the neutral volume."""

    depth: float  # m
    speed: float  # m/s
    depth_slope: float  # m/m3
    speed_slope: float  # m/s/m3


class Decision(NamedTuple):
    """What is done with what a wake has shown."""

    speed: float  # m/s, estimated
    neutral: float  # m3, estimated at depth 0
    acting: float  # -, 1 while the vehicle is brought back
    moves: float  # -, 1 where the volume is to be moved
    sleep: float  # s, to the next sample at the depth
    volume_reference: float  # m3


def deadband_gains(
    K2: float, T2: float, psi: float, interval: float, pole: float = 0.2, *, creep: float = 0.0
) -> DeadbandGains:
    """Return the gains that leave `pole` of an error per interval [s], growth and longest sleep.

    The speed u = k_z (r - z) - k_w w that the volume is to give acts through
    T2 dw/dt + w = K2 psi (z - r) + u for an interval: Ackermann's formula for two poles at `pole`;
    with 0 the vehicle is at rest after two intervals. A piston that only a voltage holds gives way
    as it gets deeper, dV/dt = -creep (z - z asleep) with creep = K1 A k_z/k_u [m2/s]: then
    du/dt = K2 creep (z - z asleep) as well. One that diverges, s (T2 s + 1) = K2 psi +
    K2 creep/s, sleeps 0.6 of the time of an e-fold at most.
    """
    import numpy as np
    from scipy.linalg import expm

    # depth off, speed, what the volume gives, depth off when it fell asleep
    rates = np.zeros((4, 4))
    rates[0, 1] = 1.0
    rates[1, :3] = K2 * psi / T2, -1.0 / T2, 1.0 / T2
    rates[2, [0, 3]] = K2 * creep, -K2 * creep
    held = expm(rates * interval)
    over, push = held[:2, :2] + np.outer(held[:2, 3], [1.0, 0.0]), held[:2, 2]
    reach = np.column_stack([push, over @ push])
    left = over - pole * np.eye(2)
    k_z, k_w = np.linalg.solve(reach.T, [0.0, 1.0]) @ left @ left
    fastest = max(root.real for root in np.roots([T2, 1.0, -K2 * psi, -K2 * creep]))
    growth = math.exp(interval * max(fastest, 0.0))
    longest = min(_HOUR, _ASLEEP / max(fastest, 1e-9))
    return DeadbandGains(float(k_z), float(k_w), growth, max(longest, interval))


def initial(
    parameters: DeadbandParameters, measurement: Measurement, reference: float
) -> DeadbandState:
    """Start at rest, neutral with the volume as it is."""
    p = parameters
    seen = abs(measurement.depth) < _DEEPEST
    measured = abs(measurement.volume) < _LARGEST
    depth = measurement.depth if seen else 0.0
    volume = measurement.volume if measured else 0.0
    return DeadbandState(
        begun=1.0 if seen and measured else 0.0,
        depth=depth,
        speed=0.0,
        depth_slope=0.0,
        speed_slope=0.0,
        neutral=volume - p.psi * depth,
        volume=volume,
        voltage=0.0,
        share=1.0,
        acting=0.0,
        moving=0.0,
        sleep=0.5 * p.interval,
        waited=0.0,
        goal=reference if abs(reference) < _DEEPEST else depth,
        volume_reference=volume,
    )


def predict(p: DeadbandParameters, before: DeadbandState, volume: float) -> Predicted:
    """Return the prediction for now, with the mean of the volumes before and now.

    1/(1 + x + x^2/2 + x^3/6) stands for exp(-x); psi acts at the depth halfway.
    """
    h = before.waited
    x = h / p.T2
    E = 1.0 / (1.0 + x * (1.0 + x * (0.5 + x / 6.0)))
    lag = p.T2 * (1.0 - E)
    excess = before.neutral - 0.5 * (before.volume + volume)
    depth = before.depth
    u = 0.0
    for _ in range(2):
        u = p.K2 * (p.psi * 0.5 * (before.depth + depth) + excess)
        depth = before.depth + u * (h - lag) + before.speed * lag
    return Predicted(
        depth=limited(depth, -_DEEPEST, _DEEPEST),
        speed=u + (before.speed - u) * E,
        depth_slope=before.depth_slope + p.K2 * (h - lag) + lag * before.speed_slope,
        speed_slope=p.K2 * (1.0 - E) + E * before.speed_slope,
    )


def learn_share(p: DeadbandParameters, before: DeadbandState, seen: Measurement) -> float:
    """Return what a voltage does of what it should [-], from how far the volume crept in a sleep.

    dV = K1 A (share u - c z) h; one step of normalised least mean squares. A volume that stayed
    says nothing, as dry friction may have held it; nor does one that no such share explains.
    """
    crept = seen.volume - before.volume
    if before.moving > 0.0 or abs(crept) <= p.tolerance:
        return before.share
    per_volt = p.rate_per_volt * before.waited
    pushed = per_volt * before.voltage
    needed = crept + per_volt * p.depth_voltage * 0.5 * (before.depth + seen.depth)
    if abs(pushed) <= p.tolerance or needed * pushed < _LEAST * pushed * pushed:
        return before.share
    if needed * pushed > _MOST * pushed * pushed:
        return before.share
    trust = pushed / (pushed * pushed + p.tolerance * p.tolerance)
    return before.share + trust * (needed - before.share * pushed)


def decide(
    p: DeadbandParameters, before: DeadbandState, now: Predicted, seen: Measurement, wanted: float
) -> Decision:
    """Return what a depth [m] seen at a wake says, the volume to go to and how long to sleep."""
    e = seen.depth - now.depth
    ratio = p.depth_noise / p.neutral_step
    learnt = now.depth_slope * e / (now.depth_slope * now.depth_slope + ratio * ratio)
    neutral = limited(before.neutral + learnt, p.volume_min, p.volume_max)
    speed = limited(now.speed + now.speed_slope * learnt, -_QUICKEST, _QUICKEST)
    error = wanted - seen.depth
    rest = seen.depth + p.T2 * speed
    off = max(abs(error), abs(wanted - rest))
    edge = p.band / p.growth - min(3.0 * p.depth_noise, 0.5 * p.band / p.growth)
    rests = off < _INNER * edge and abs(speed) < p.speed_band
    if before.acting > 0.0 or off > edge or abs(speed) > p.speed_band:
        u = (p.k_z - p.K2 * p.psi) * error - p.k_w * speed
        target = p.psi * seen.depth + neutral - limited(u, -p.fastest, p.fastest) / p.K2
        if rests:
            target = p.psi * rest + neutral
        target = limited(target, p.volume_min, p.volume_max)
        return Decision(speed, neutral, 0.0 if rests else 1.0, 1.0, p.interval, target)
    drift = max(abs(speed), abs(p.K2 * (p.psi * seen.depth + neutral - seen.volume)))
    room = _INNER * (edge - off)
    sleep = min(p.longest, 2.0 * before.sleep)
    if drift * sleep > room:
        sleep = room / drift
    sleep = max(sleep, p.interval)
    return Decision(speed, neutral, 0.0, 0.0, sleep, before.volume_reference)


def step(
    parameters: DeadbandParameters, state: DeadbandState, measurement: Measurement, reference: float
) -> tuple[float, DeadbandState, float]:
    """Return the voltage [V] that moves the volume or holds it, and the time to sleep."""
    p = parameters
    before = state
    if state.begun == 0.0:
        before = initial(p, measurement, reference)
    wanted = reference if abs(reference) < _DEEPEST else before.goal
    measured = abs(measurement.volume) < _LARGEST
    volume = measurement.volume if measured else before.volume
    now = predict(p, before, volume)
    depth = now.depth
    depth_slope = now.depth_slope
    speed_slope = now.speed_slope
    decision = Decision(
        now.speed, before.neutral, before.acting, 0.0, p.interval, before.volume_reference
    )
    running = before.moving > 0.0 and before.moving < p.interval
    if running:
        decision = Decision(
            now.speed, before.neutral, before.acting, 1.0, before.sleep, before.volume_reference
        )
    elif before.begun > 0.0 and abs(measurement.depth) < _DEEPEST:
        depth = measurement.depth
        depth_slope = 0.0
        speed_slope = 0.0
        seen = measurement._replace(volume=volume)
        decision = decide(p, before, now, seen, wanted)

    gap = decision.volume_reference - volume
    deep = measurement.depth if abs(measurement.depth) < _DEEPEST else depth
    share = before.share
    if measured and abs(measurement.depth) < _DEEPEST:
        share = learn_share(p, before, measurement)
    voltage = p.depth_voltage * deep / share
    moving = 0.0
    wait = max(decision.sleep - before.moving, p.S_p) if running else decision.sleep
    off = abs(gap)
    if running:
        off = max(off, abs(decision.volume_reference - before.volume))  # what may still come
        late = before.moving >= max(0.5 * p.interval, _SAMPLES * p.S_p)
        if late and p.k_pV * abs(gap) < p.voltage_limit:
            off = 0.0  # it should be there; asleep it will be seen what held it off
    if decision.moves > 0.0 and measured and off > p.tolerance:
        voltage = voltage + p.k_pV * gap
        moving = before.moving + p.S_p if running else p.S_p
        wait = p.S_p
    voltage = limited(voltage, -p.voltage_limit, p.voltage_limit)
    after = DeadbandState(
        begun=before.begun,
        depth=depth,
        speed=decision.speed,
        depth_slope=depth_slope,
        speed_slope=speed_slope,
        neutral=decision.neutral,
        volume=volume,
        voltage=voltage,
        share=share,
        acting=decision.acting,
        moving=moving,
        sleep=decision.sleep,
        waited=wait,
        goal=wanted,
        volume_reference=decision.volume_reference,
    )
    return voltage, after, wait


def _gains(s: Setting, k: TuningParameters) -> DeadbandParameters:
    """Wake every `pause`; leave errors of `band` alone, and what they are made of in a pause."""
    p, h = s.plant, s.sample_time
    d, a = stiffness(p)
    if d <= 0.0:
        raise InputError(
            "the law deadband assumes laminar drag, and the vehicle has none",
            field="motion.drag",
            remedy="Choose the law observer",
        )
    interval = max(round(k.pause / h), 2) * h
    speed = k.band / interval
    own = deadband_gains(a / d, 1.0 / d, p.psi, interval, _FADING, creep=p.gain * p.load_drive)
    return DeadbandParameters(
        **own._asdict(),
        K2=a / d,
        T2=1.0 / d,
        psi=p.psi,
        depth_noise=s.noise,
        neutral_step=_STEP * s.noise / (a * interval * interval),
        band=k.band,
        speed_band=speed,
        fastest=max(5.0 * speed, 0.01),
        interval=interval,
        k_pV=k.inner / p.gain,
        tolerance=max(k.dead, s.least_move),
        depth_voltage=p.load_drive,
        rate_per_volt=p.gain,
        voltage_limit=k.volts * s.limit,
        volume_min=p.V_min,
        volume_max=p.V_max,
        S_p=h,
    )


DEADBAND = Law(
    name="deadband",
    summary="sleeps while depth and speed are in a band; else moves the volume once and sleeps",
    command="voltage",
    parameters=DeadbandParameters,
    state=DeadbandState,
    step=step,
    initial=initial,
    volume_gain="k_pV",
    band="band",
    longest_wait=lambda p: max(p.interval, p.longest),
    recipe=Recipe(
        gains=_gains, linear=False, sleeps=(0.2, 0.3, 0.4, 0.5, 0.6), bands=(1.0, 2.0, 3.5)
    ),
)


def _remembered(decision: Decision, depth: float, volume: float, waited: float) -> DeadbandState:
    """Return the state after a decision, with the volume there will be [m3] in a time [s]."""
    return DeadbandState(
        begun=1.0,
        depth=depth,
        speed=decision.speed,
        depth_slope=0.0,
        speed_slope=0.0,
        neutral=decision.neutral,
        volume=volume,
        voltage=0.0,
        share=1.0,
        acting=decision.acting,
        moving=0.0,  # only a voltage that is held learns from it
        sleep=decision.sleep,
        waited=waited,
        goal=0.0,
        volume_reference=decision.volume_reference,
    )


def hold_begin(
    parameters: DeadbandParameters, measurement: Measurement, speed: float
) -> DeadbandState:
    """Start at a speed [m/s] that drag balances with the volume as it is."""
    p, depth, volume = parameters, measurement.depth, measurement.volume
    neutral = volume + speed / p.K2 - p.psi * depth
    return _remembered(Decision(speed, neutral, 0.0, 0.0, p.interval, volume), depth, volume, 0.0)


def hold_step(
    parameters: DeadbandParameters, state: DeadbandState, measurement: Measurement
) -> tuple[float, DeadbandState, float]:
    """Return the change of volume [m3], the state and the time to sleep [s].

    measurement: its depth counts from the one that is held [m].
    """
    p, volume = parameters, measurement.volume
    now = predict(p, state, volume)
    decision = decide(p, state, now, measurement, 0.0)
    change = decision.volume_reference - volume if decision.moves > 0.0 else 0.0
    if abs(change) <= p.tolerance:
        change = 0.0
    after = _remembered(decision, measurement.depth, volume + change, decision.sleep)
    return change, after, decision.sleep
