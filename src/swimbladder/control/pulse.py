"""A law that holds a depth with few starts: each run of the motor goes out and comes back.

Away from the set-point it is the linear law of `control.observer`: a Kalman filter that knows the
volume, and state feedback. Near it the motor rests and the filter goes on. A move in one direction
changes the volume that is held, and the speed at which the vehicle drifts stays. A pulse of volume,
out and back in one run, changes both: its area sets the speed, its end the volume.

So when the depth predicted for a time ahead leaves a band, the motor runs out until coming back
will leave the speed that is wanted, and back to the volume that is wanted. Both are in proportion
to the depth error: of all speeds and volumes those that make the least of the squared error over a
time (`motion.pulse_gains`). The best policy, found by dynamic programming
(`python -m studies.starts`; impulse control: Bensoussan and Lions, Impulse Control and
Quasi-Variational Inequalities, 1984), looks like that.

The motor turns round in the midst of a run, without a rest, and is run slowly. At rest it has the
voltage that holds the load. How far the volume creeps then shows what that is, and how far it goes
in a sample of a run how fast it comes back: a supply, a driver or a load other than assumed.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from swimbladder.control import law, observer
from swimbladder.control.law import SMOOTH, Friction, friction_voltage, from_leaves, leaf_names
from swimbladder.control.observer import Estimate, begin_estimate, estimate, limited, moves, trusted

_LEAST = 0.4  # share of its rate that a motor is believed to have
_MOST = 2.5  # likewise
_LEARNT = 2.0  # times what is near: from there the neutral volume is learnt as fast as can be
_BROUGHT = 0.25  # of the dead zone, within which a run is at its end

_PULSES = 8.0  # bands: how near the set-point there are pulses, at least
_WRONG = 0.1  # of how far a neutral volume may be from what is known: it mostly is nearer
_BELIEVED = 0.2  # of what a sample shows of the motor
_SMALL = 1e-4  # of the stroke: noise of the volume makes that slower where it is more
_AHEAD = 0.2  # of the time that a pulse is for: how far ahead an error is predicted


class PulseParameters(NamedTuple):
    """The model, the filter, the feedback, the pulses and the actuator's limits."""

    model: observer.Observed
    k_z: Annotated[float, "m3/m"]  # volume per depth error
    k_w: Annotated[float, "m3 s/m"]  # volume per speed error
    k_V: Annotated[float, "V/m3"]  # voltage per volume error
    dead: Annotated[float, "m3"]  # volume error below which the motor rests
    near: Annotated[float, "m"]  # depth error within which the motor moves by pulses; 0: none
    band: Annotated[float, "m"]  # predicted error that starts one
    a_z: Annotated[float, ""]  # prediction per depth error
    a_w: Annotated[float, "s"]  # per speed
    a_V: Annotated[float, "m/m3"]  # per volume off neutral
    homing: Annotated[float, "1/s"]  # speed to the set-point that a pulse leaves, per error
    p_z: Annotated[float, "m3/m"]  # volume that it leaves, per depth error
    acceleration: Annotated[float, "1/m2/s2"]  # by a volume off neutral
    rate: Annotated[float, "m3/s"]  # at which the volume goes out and back
    swing: Annotated[float, "V"]  # which gives that rate
    learn: Annotated[float, ""]  # of what a sample shows of the motor
    resting: observer.Resting
    farthest: Annotated[float, "m"]  # a depth error beyond which no more volume is asked for
    depth_voltage: Annotated[float, "V/m"]  # k_z/k_u
    limit: Annotated[float, "V"]
    volume_min: Annotated[float, "m3"]
    volume_max: Annotated[float, "m3"]
    S_p: Annotated[float, "s"]
    balanced: Friction = SMOOTH


class PulseState(NamedTuple):
    """What the law remembers between samples."""

    estimate: Estimate
    volume_reference: float  # m3, asked for at the sample before
    holding: float  # -, 1: by pulses
    going: float  # -, 0: the motor rests; 1, -1: out, the volume growing or not; 2, -2: home
    hold: float  # V, that holds the volume beyond what the load is assumed to take
    share: float  # -, of `rate` that the motor was seen to make


class Run(NamedTuple):
    """Where a run of the motor is, and the voltage that moves the volume."""

    going: float
    voltage: float  # V, beyond what holds the load


def initial(
    parameters: PulseParameters, measurement: law.Measurement, reference: float
) -> PulseState:
    """Start at rest with the volume as it is."""
    p = parameters
    e = begin_estimate(p.model, measurement, reference)
    return PulseState(e, e.volume, 0.0, 0.0, 0.0, 1.0)


def holds(p: PulseParameters, before: float, error: float, speed: float) -> float:
    """Return 1 where the vehicle is held by pulses, else 0: it was (before) and is near, or near
    and slow enough to come to the set-point as pulses make it.
    """
    least = p.near
    if p.near > 0.0 and before == 0.0:
        least = p.near - abs(speed) / p.homing
    return 1.0 if abs(error) < least else 0.0


def run(
    p: PulseParameters,
    going: float,
    error: float,
    speed: float,
    volume: float,
    neutral: float,
    end: float,
    rate: float,
) -> Run:
    """Return how the motor goes on near the set-point.

    error [m]: of the depth, positive where the vehicle is to sink; speed [m/s]; volume, neutral and
    the one that a run is to end with [m3]; rate [m3/s] at which it comes back.
    """
    now = going
    gap = end - volume
    wanted = p.homing * error
    if now == 0.0:
        ahead = p.a_w * speed + p.a_V * (volume - neutral) - p.a_z * error
        if abs(ahead) > p.band:
            now = 1.0 if speed > wanted else -1.0
    if abs(now) == 1.0:
        past = max(-now * gap, 0.0)  # how far out
        # What coming back will change of the speed, decided half a sample ahead.
        change = p.acceleration * past * (0.5 * past / rate + p.S_p)
        room = p.volume_max - volume if now > 0.0 else volume - p.volume_min
        if now * (speed - wanted) <= change or room <= 0.0:
            now = 2.0 if gap > 0.0 else -2.0
    voltage = 0.0
    if abs(now) == 1.0:
        voltage = now * p.swing
    elif abs(now) == 2.0:
        if 0.5 * now * gap > _BROUGHT * p.dead:
            voltage = limited(p.k_V * gap, -p.swing, p.swing)
        else:
            now = 0.0
    return Run(now, voltage)


def step(
    parameters: PulseParameters, state: PulseState, measurement: law.Measurement, reference: float
) -> tuple[float, PulseState, float]:
    """Return the voltage [V] of a run of the motor near the set-point, of the feedback elsewhere.

    Without a measured volume a run rests.
    """
    p = parameters
    measured = math.isfinite(measurement.volume)
    volume = measurement.volume if measured else state.estimate.volume
    held = state.holding > 0.0
    close = abs(reference - state.estimate.depth) < _LEARNT * p.near
    trust = trusted(p.model.trust, p.resting, close)
    e = estimate(p.model, trust, state.estimate, volume, measurement.depth)
    error = limited(reference - e.depth, -p.farthest, p.farthest)
    neutral = p.model.psi * (e.depth + error) + e.neutral
    hold = state.hold
    share = state.share
    moved = volume - state.estimate.volume
    if p.near > 0.0:
        per_volt = p.S_p * p.rate / p.swing
        expected = 0.0
        if not held and state.going > 0.0:
            expected = per_volt * p.k_V * (state.volume_reference - state.estimate.volume)
        if state.going == 0.0 or (not held and abs(moved) < p.dead):
            hold = hold - p.learn * (moved - expected) / per_volt
            most = p.depth_voltage * abs(e.depth) + p.swing  # the load of half the voltage
            hold = limited(hold, -most, most)
        if held and abs(state.going) == 1.0:
            seen = state.going * moved / (p.rate * p.S_p)
            share = limited(share + p.learn * (seen - share), _LEAST, _MOST)
    holding = holds(p, state.holding, error, e.speed)
    if holding > 0.0:
        wanted = limited(neutral - p.p_z * error, p.volume_min, p.volume_max)
        # A run that the feedback began farther away goes on as one.
        before = state.going
        slow = p.k_V * abs(wanted - volume) < p.swing and abs(moved) < _BROUGHT * p.dead
        if held and abs(before) == 2.0 and slow:
            before = 0.0  # it should be there; at rest it will be seen what holds it off
        now = run(p, before, error, e.speed, volume, neutral, wanted, share * p.rate)
        going = now.going if measured else 0.0
        drive = now.voltage if measured else 0.0
    else:
        # Volume: neutral there, less what sinks the vehicle towards the reference.
        wanted = limited(neutral - p.k_z * error + p.k_w * e.speed, p.volume_min, p.volume_max)
        gap = wanted - volume
        going = moves(gap, abs(state.going), p.dead)
        drive = going * p.k_V * gap
    drive = drive + friction_voltage(drive, p.balanced, e.depth)
    voltage = p.depth_voltage * e.depth + hold + drive
    return (
        limited(voltage, -p.limit, p.limit),
        PulseState(e, wanted, holding, going, hold, share),
        p.S_p,
    )


def _gains(s: law.Setting, k: law.TuningParameters) -> PulseParameters:
    """A pulse is as large as the band: out and back at one rate, its area the speed it gives."""
    found, a = observer.feedback(s, k), law.stiffness(s.plant)[1]
    rest = dict.fromkeys(set(leaf_names(PulseParameters)) - set(found), 0.0)
    rest |= {"acceleration": a, "n_z": found["l_z"], "n_w": found["l_w"], "n_b": found["l_b"]}
    if k.pause > 0.0:
        from swimbladder.control.motion import pulse_gains

        w, p_z = pulse_gains(s.plant, k.pause)
        small = _SMALL * (s.plant.V_max - s.plant.V_min) / s.least_move
        rate = 4.0 * -w * k.band / (a * (k.pulse * k.pause) ** 2)
        rest |= observer.resting_gains(s, k.band, _AHEAD * k.pause)
        # The feedback leaves the error of a neutral volume that is wrong to them.
        rest["near"] = max(_PULSES * k.band, _WRONG * s.neutral_range / found["k_z"])
        rest |= {"homing": -w, "p_z": p_z, "rate": rate, "swing": rate / s.plant.gain}
        rest["learn"] = _BELIEVED * small
    return from_leaves(PulseParameters, found | rest)


PULSE = law.Law(
    name="pulse",
    summary="as observer; near the set-point each run of the motor moves the volume out and back",
    command="voltage",
    roundings=Friction._fields,
    parameters=PulseParameters,
    state=PulseState,
    step=step,
    initial=initial,
    volume_gain="k_V",
    dead_zone="dead",
    near="near",
    band="band",
    recipe=law.Recipe(
        gains=_gains,
        quiet=law.QUIET,
        holds=(2.5, 2.8, 3.1),
        bands=(2.3, 2.5, 2.7, 2.9),
        example=law.TuningParameters(0.35, 0.9, 1.2, dead=1e-7, pause=6.0, band=0.02),
    ),
)
