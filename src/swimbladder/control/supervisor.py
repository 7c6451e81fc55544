"""The supervisor: watches a vehicle under any law and, once it has a reason, brings it up for good.

`step` has the form of a law's, so that it is translated as laws are. In place of a depth asked for
it takes the law's command, and gives it on until it has a reason; from then on it gives the command
that makes the vehicle lightest, by its own count of ticks: no sensor is asked, since any may lie.
What each detector does and why: docs/explanation/supervisor.md.

Ticks are counted in whole numbers of 16 bits, which stay at their ends; the time of a dive in two
of them. Each watch changes the state where it stands. What a vehicle's numbers switch off is asked
for by a comparison of numbers alone, so that a compiler that knows them leaves it out.

The records come first: what it sees, its limits, what it remembers, why it takes over. The watches
follow, each detector's step, with the reasons that follow from all of them; `step` is the last.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Annotated, NamedTuple

from swimbladder.control.law import NEVER, Count, Law, less, more


class Watched(NamedTuple):
    """What the supervisor sees at a tick; NaN for what the board has not, or could not measure."""

    depth: float  # m, of the pressure sensor
    depth_age: float  # s, since it was measured
    volume: float  # m3
    battery: float  # V
    leak: bool  # water inside
    lost: Count  # ticks that should have come since the last one
    missed: Count  # calls in a row in which the law gave no command
    reference: float = math.nan  # m, the depth asked for
    computed: float = 0.0  # m3, of a pump and valve: the volume as their runs make it


class PushLimits(NamedTuple):
    """How the vehicle is brought up."""

    surface_command: Annotated[float, "V or m3"]  # that makes the vehicle lightest
    hold_command: Annotated[float, "V or m3"]  # that keeps it so
    quarter: Annotated[float, "V or m3"]  # of it
    away_command: Annotated[float, "V or m3"]  # that makes it heaviest; with swapped wires lightest
    away_hold: Annotated[float, "V or m3"]  # that then keeps it lightest enough
    push: Annotated[Count, "ticks"]  # ticks of the surface command at first
    again: Annotated[Count, "ticks"]  # ticks of it after a rest
    rest: Annotated[Count, "ticks"]  # ticks of the hold command in between
    stall: Annotated[Count, "ticks"]  # ticks of pushing that gain nothing before it rests, if deep
    grown: Annotated[float, "m3"]  # by which the volume is known to have grown
    away: Annotated[float, "m3"]  # by which a push that drives it away is known
    away_fast: Annotated[float, "m3"]  # in a tick, as fast as one that does drives it
    astray: Annotated[Count, "ticks"]  # ticks in which a push moves it nowhere
    release: Annotated[Count, "ticks"]  # ticks in which it has to rise
    rise: Annotated[float, "m"]  # by so much


class DepthLimits(NamedTuple):
    """Which depths can be."""

    depth_least: Annotated[float, "m"]  # the least that the sensor can mean
    depth_most: Annotated[float, "m"]  # the largest
    fastest: Annotated[float, "m"]  # that the depth may change in a tick
    jump: Annotated[float, "m"]  # that it may change at once: noise, quantum
    step: Annotated[float, "m"]  # both: that it may change from a tick to the next
    late_age: Annotated[float, "s"]  # at which a depth is late
    blind_quarters: Annotated[Count, "ticks/4"]  # without a good depth, less one for each good
    gap: Annotated[Count, "ticks"]  # ticks without a depth after which the model begins anew


class VolumeLimits(NamedTuple):
    """Which volumes can be, and where the stroke ends."""

    blind: Annotated[Count, "ticks"]  # ticks without a good volume
    volume_least: Annotated[float, "m3"]  # the least that the sensor can mean
    volume_most: Annotated[float, "m3"]  # the largest
    volume_low: Annotated[float, "m3"]  # below it the actuator may be at its end
    volume_high: Annotated[float, "m3"]  # above it as well


class RateLimits(NamedTuple):
    """How the volume follows a command."""

    positioner: Annotated[float, ""]  # 1: commands are volumes
    rate: Annotated[float, "m3/s/V or m3/s"]  # K1 A; the latter of a positioner
    load_drive: Annotated[float, "V/m"]  # k_z/k_u while the motor drives
    load_back: Annotated[float, "V/m"]  # while the sea drives it back
    friction: Annotated[float, "V"]
    leakage: Annotated[float, "m2/s"]  # k_l
    rate_smoothing: Annotated[float, ""]
    rate_share: Annotated[float, ""]  # of the rate asked for that may be missing
    rate_least: Annotated[float, "m3/s"]  # that may be missing anyway
    stop_rate: Annotated[float, "m3/s"]  # asked for, where a push that ends as others did is a stop
    stop_least: Annotated[float, "m3/s"]  # below which it has ended
    stops: Annotated[Count, "ticks"]  # ticks of it
    following: Annotated[Count, "ticks"]  # ticks in which the volume does not follow


class SameLimits(NamedTuple):
    """How long a depth can be the very same."""

    same: Annotated[Count, "ticks"]  # ticks of the very same depth that noise does not allow
    same_begun: Annotated[Count, "ticks"]  # ticks of it after which the volume has to stay as well
    same_moved: Annotated[Count, "ticks"]  # ticks of it that are too many where it does not
    moved: Annotated[float, "m3"]  # by so much
    same_noisy: Annotated[Count, "ticks"]  # ticks of it where the sensor has shown noise
    noisy: Annotated[float, ""]  # share of ticks in which the depth turns, where it has
    noisy_weight: Annotated[float, ""]  # of the newest in it


class ProofLimits(NamedTuple):
    """When the actuator has to show that it can push outward."""

    same_tried: Annotated[Count, "ticks"]  # ticks of it after which it is pushed outward to see
    unproven: Annotated[Count, "ticks"]  # ticks after which it has to show anew that it can
    holding: Annotated[Count, "ticks"]  # the same while the law holds a depth
    early: Annotated[Count, "ticks"]  # ticks after which it shows it there before it has to
    sinks: Annotated[float, "m3"]  # before it is heavier by so much
    reach: Annotated[float, "m3"]  # by so much beyond the neutral volume
    per_speed: Annotated[float, "m2 s"]  # more per speed: it stops before psi z outgrows it
    lead: Annotated[float, "1/(m2 s)"]  # what a volume adds to a speed while its low pass lags
    per_jump: Annotated[float, "1/m"]  # 1/a jump of the depth asked for that takes all of reach
    ready: Annotated[float, "m"]  # a jump that a push makes ready for at least
    least_way: Annotated[float, "m3"]  # of a push in a tick: one that a block ends is a stop
    ahead: Annotated[float, "m3"]  # what the way down adds where nobody knows how far it goes


class NeutralLimits(NamedTuple):
    """Which neutral volume the vehicle can have."""

    psi: Annotated[float, "m3/m"]
    psi_range: Annotated[float, "m3/m"]  # how well psi is known
    neutral: Annotated[float, "m3"]  # neutral volume at the surface
    neutral_range: Annotated[float, "m3"]  # how well it is known, drift included


class MotionLimits(NamedTuple):
    """How depth and volume belong together."""

    neutral_change: Annotated[float, "m3"]  # how far it may drift from what the dive has shown
    known: Annotated[Count, "ticks"]  # ticks in which the dive has to show it
    forgetting: Annotated[float, ""]  # least weight of the newest in it
    calm: Annotated[float, "m3"]  # by which the model may miss where it is learnt
    model_error: Annotated[float, ""]  # share of the force on the vehicle that the model may miss
    inertia: Annotated[float, "m2"]  # volume per second difference of the low passes
    drag_linear: Annotated[float, "m2 s"]  # volume that drag takes per speed
    epsilon: Annotated[float, "m/s"]  # above which drag is not linear
    drag_blunt: Annotated[float, "m2 s"]  # volume that drag takes there: per speed
    drag_0: Annotated[float, "m3"]
    drag_square: Annotated[float, "m s2"]  # per speed squared
    per_tau: Annotated[float, "1/s"]  # 1 / the time of each low pass
    smoothing: Annotated[float, ""]  # weight of the newest in it
    settle: Annotated[Count, "ticks"]  # ticks that they take
    wrong: Annotated[Count, "ticks"]  # ticks in which depth and volume do not fit


class RestLimits(NamedTuple):
    """Where the vehicle may rest."""

    surface: Annotated[float, "m"]  # from there up the vehicle may float
    aground: Annotated[float, "m"]  # from there down it may lie on the bottom
    still_distance: Annotated[float, "m"]  # within which a depth stands still
    still: Annotated[Count, "ticks"]  # ticks that it has to


class ProgressLimits(NamedTuple):
    """How a vehicle with pump and valve comes nearer to the depth asked for, and with what."""

    arrived: Annotated[float, "m"]  # from that depth, within which it need not
    nearer: Annotated[float, "m"]  # that it comes nearer by
    waits: Annotated[Count, "ticks"]  # in which it has to
    light_volume: Annotated[float, "m3"]  # neutral volume at the surface
    light_slope: Annotated[float, "m3/m"]  # psi: what it needs more by per depth
    light_range: Annotated[float, "m3"]  # beyond them it has more than it can need, as computed
    light_smoothing: Annotated[float, ""]  # weight of the newest in what is off for hours
    light: Annotated[Count, "ticks"]  # ticks beyond it


class DeepLimits(NamedTuple):
    """How deep it may be."""

    depth_limit: Annotated[float, "m"]
    deepest: Annotated[float, "m"]  # that it must not pass before it turns round
    heavier: Annotated[float, "m3"]  # by which it may be so until the dive has shown its trim
    turn_rate: Annotated[float, "m3/s"]  # the least at the depth limit
    per_turn_rate: Annotated[float, "s/m3"]  # 1/turn_rate
    force: Annotated[float, "1/(m2 s2)"]  # a_b
    largest: Annotated[float, "m3"]  # volume
    lag: Annotated[float, "s"]  # by which the speed seen is behind, and a push comes
    deep: Annotated[Count, "ticks"]  # ticks too deep


class BoardLimits(NamedTuple):
    """What battery, leak sensor, law and mission may do."""

    battery_low: Annotated[float, "V"]
    battery: Annotated[Count, "ticks"]  # ticks below it
    leak: Annotated[Count, "ticks"]  # ticks of leak
    missed: Annotated[Count, "ticks"]  # calls without a command, ticks of an impossible set-point


class TimeLimits(NamedTuple):
    """How long the dive may take."""

    lost_quarters: Annotated[Count, "ticks/4"]  # lost, less one for each that comes
    time_blocks: Annotated[Count, "4096 ticks"]
    time_ticks: Annotated[Count, "ticks"]  # beyond them


class SupervisorParameters(NamedTuple):
    """Limits, times in whole ticks, and the model that depth and volume are held against.

    A limit that is infinite, or in ticks NEVER, is off.
    """

    S_p: Annotated[float, "s"]
    per_tick: Annotated[float, "1/s"]  # 1/S_p
    push: PushLimits
    depth: DepthLimits
    volume: VolumeLimits
    rate: RateLimits
    same: SameLimits
    proof: ProofLimits
    neutral: NeutralLimits
    motion: MotionLimits
    rest: RestLimits
    progress: ProgressLimits
    deep: DeepLimits
    board: BoardLimits
    time: TimeLimits


class TimeWatch(NamedTuple):
    """Ticks."""

    tick: Count  # ticks since the start, up to 4096; without a time limit they are not counted
    block: Count
    lost: Count  # quarters of ticks


class DepthWatch(NamedTuple):
    """The last good depth."""

    since: Count  # ticks since the last good depth; NEVER: any depth may be
    depth: float  # m, last good one
    blind: Count  # quarters of ticks; at its limit 0 to 2 more for what was wrong then


class VolumeWatch(NamedTuple):
    """The last good volume."""

    volume: float  # m3, last good one
    measured: bool  # at the last tick
    volume_blind: Count  # ticks; at its limit 0 or 1 more


class RateWatch(NamedTuple):
    """The volume's rate against that asked for."""

    lag: float  # m3/s, of the volume's rate behind that asked for
    asked: float  # m3/s
    following: Count  # ticks in which it did not
    top: float  # m3, where pushes outward ended
    stops: Count  # ticks in which they did


class SameWatch(NamedTuple):
    """Depths that are the very same."""

    same: Count  # ticks in which the depth was the very same
    rose: bool  # at the last new sample
    sank: bool  # the same
    noisy: float  # -, share of ticks in which the depth turned; it stays where it is enough
    same_volume: float  # m3, n1 when the volume had to stay
    moved: float  # m3, by which n1 is beyond it since then, through a low pass
    frozen: bool  # it was for too long


class ProofWatch(NamedTuple):
    """How far outward the actuator has shown that it can push."""

    unproven: Count  # ticks since it has; NEVER: it has to, until it has
    shown: float  # m3, volume that it reached
    shown_for: float  # m, the depth that was asked for then
    allowed: float  # m, the largest depth that the law is asked for now


class MotionWatch(NamedTuple):
    """Depth and volume against the model."""

    z1: float  # m, depth through a low pass
    z2: float  # m, through a second
    n1: float  # m3, volume beyond psi z and the neutral one through a low pass
    n2: float  # m3, through a second
    blunt: float  # m3, what drag takes beyond its proportion to speed, through a low pass
    settled: Count  # ticks since they began
    wrong: Count  # ticks in which depth and volume did not fit
    own: float  # m3, by which the neutral volume is larger as the dive has shown it
    recent: float  # m3, the same as the last seconds show it
    own_depth: float  # m, where it did, on average
    weight: float  # -, of the newest in them, about 1 / ticks
    known: Count  # ticks in which it did


class RestWatch(NamedTuple):
    """A depth that stands still."""

    anchor: float  # m, around it the depth stands still
    still: Count  # ticks for which it has


class ProgressWatch(NamedTuple):
    """How near to the depth asked for it came."""

    target: float  # m, the depth asked for
    farthest: float  # m, from there, since it came nearer last
    waited: Count  # ticks since
    light: Count  # ticks with more volume than it can need
    drifted: float  # m3, beyond the neutral volume for hours: runs are not known to the cubic cm


class BoardWatch(NamedTuple):
    """Battery, leak sensor, law and mission."""

    battery: Count  # ticks
    leak: Count  # ticks
    missed: Count  # calls without a command


class PushWatch(NamedTuple):
    """The safe action, in its turn of pushes and rests."""

    phase: Count  # ticks of the safe action, in its turn of pushes and rests
    pushed: float  # m3, volume as far out as the push has brought it
    astray: Count  # ticks since a push moved it out
    turns: Count  # of the push: 1 for good the way it was; 2 tried, 3 as it fell, 7 as it grew so
    seen: float = 0.0  # m3, volume at the last tick


class Recovery(NamedTuple):
    """Why the vehicle is brought up, and whether it comes."""

    reason: Count  # the first one, 0: none
    reasons: Count  # bits of all so far
    window: Count  # ticks in which it has to rise
    from_depth: float  # m, when they began
    release: bool  # drop the weight


class SupervisorState(NamedTuple):
    """What the supervisor remembers between ticks."""

    restarted: bool  # by a watchdog or a brown-out
    command: float  # V or m3, given last
    deep: Count  # ticks
    time: TimeWatch
    depth: DepthWatch
    volume: VolumeWatch
    rate: RateWatch
    same: SameWatch
    proof: ProofWatch
    motion: MotionWatch
    rest: RestWatch
    progress: ProgressWatch
    board: BoardWatch
    push: PushWatch
    recovery: Recovery


class Reason(IntEnum):
    """Why the supervisor took over; of several at one tick the first of this list is the cause."""

    RESTARTED = 1
    LEAK = 2
    DEPTH_LIMIT = 3
    DEPTH_MISSING = 4
    DEPTH_IMPOSSIBLE = 5
    DEPTH_LATE = 6
    DEPTH_FROZEN = 7
    VOLUME_MISSING = 8
    VOLUME_IMPOSSIBLE = 9
    NOT_FOLLOWING = 10
    NOT_MOVING_AS_MODELLED = 11
    BATTERY_LOW = 12
    NO_COMMAND = 13
    TICKS_LOST = 14
    TIME_LIMIT = 15

    @property
    def words(self) -> str:
        """What the sketch logs."""
        if self is Reason.DEPTH_LIMIT:
            return "depth limit or too fast to turn"
        return self.name.lower().replace("_", " ")


def reasons_in(bits: Count) -> tuple[Reason, ...]:
    """Return the reasons whose bits are set: bit n - 1 of reason n."""
    return tuple(reason for reason in Reason if int(bits) >> (reason - 1) & 1)


def initial(parameters: SupervisorParameters, seen: Watched, restarted: float) -> SupervisorState:
    """Return the state at the start; restarted: 1.0 after a watchdog's reset or a brown-out."""
    return SupervisorState(
        restarted=restarted > 0.0,
        command=0.0,
        deep=0,
        time=TimeWatch(0, 0, 0),
        depth=DepthWatch(since=NEVER, depth=0.0, blind=0),
        volume=VolumeWatch(0.0, False, 0),
        rate=RateWatch(lag=0.0, asked=0.0, following=0, top=0.0, stops=0),
        same=SameWatch(
            0, rose=False, sank=False, noisy=0.0, same_volume=0.0, moved=0.0, frozen=False
        ),
        proof=ProofWatch(
            unproven=0, shown=parameters.volume.volume_least, shown_for=0.0, allowed=_ANY
        ),
        motion=MotionWatch(
            0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, own=0.0, recent=0.0, own_depth=0.0, weight=0.5, known=0
        ),
        rest=RestWatch(anchor=0.0, still=0),
        progress=ProgressWatch(target=0.0, farthest=0.0, waited=0, light=0, drifted=0.0),
        board=BoardWatch(0, 0, 0),
        push=PushWatch(phase=0, pushed=parameters.volume.volume_least, astray=0, turns=0),
        recovery=Recovery(reason=0, reasons=0, window=0, from_depth=0.0, release=False),
    )


BLOCK = 4096  # ticks that the fine count of time holds
_MOST_LOST = BLOCK - 1  # ticks that are counted at once
_REASONS = 15
TRIED = 3  # turns of a push that is tried the other way round as the volume fell
GREW = 7  # of one that gained so: no single bit makes it of 0, 1 or 2
_ANY = 1e6  # m, any depth
_QUARTERS = 4
_HELD = 0.1  # of a jump that a push makes ready for: so near to the depth asked for it is held
_STEPS = 14  # of six that a stop takes without drag and compression


def debounce(bad: bool, n: Count, most: Count) -> Count:
    """Return the count of bad ticks; a good one takes two away, `most` stays for good."""
    if n >= most:
        return n
    return more(n, 1) if bad else less(n, 2)


def share(bad: Count, n: Count, most: Count) -> Count:
    """Return the count of quarters of bad ticks; none takes one away, `most` stays for good."""
    if n >= most:
        return n
    return min(more(n, bad), most) if bad > 0 else less(n, 1)


def smoothed(old: float, new: float, weight: float) -> float:
    """Return a low pass after its next sample; one that a bit has made no number begins anew."""
    return old + weight * (new - old) if math.isfinite(old) else new


def times(n: Count, each: float) -> float:
    """Return n each: for small n less work than to make a float of it, where there is no unit."""
    total = 0.0
    bit: Count = 1
    for _ in range(16):
        if bit <= n:
            if n & bit > 0:
                total = total + each
            each = each + each
        bit = more(bit, bit)
    return total


def count_time(p: TimeLimits, s: TimeWatch, lost: Count) -> TimeWatch:
    """Count the ticks that were lost, and this one."""
    half = more(lost, lost)
    s = s._replace(lost=share(more(half, half), s.lost, p.lost_quarters))
    if p.time_blocks == NEVER:
        return s
    tick = more(s.tick, min(lost, _MOST_LOST))
    if tick >= BLOCK:
        tick = less(tick, BLOCK)
        s = s._replace(block=more(s.block, 1))
    return s._replace(tick=more(tick, 1))


def expected_rate(p: SupervisorParameters, s: SupervisorState) -> float:
    """Return the volume rate [m3/s] that the last command should give at the last depth."""
    if p.rate.positioner > 0.0:
        gap = (s.command - s.volume.volume) * p.per_tick
        return min(max(gap, -p.rate.rate), p.rate.rate)
    push = s.command - p.rate.load_drive * s.depth.depth
    back = s.command - p.rate.load_back * s.depth.depth
    if p.rate.friction > 0.0:
        push = push - p.rate.friction
        back = back + p.rate.friction
    if push <= 0.0:
        push = min(back, 0.0)
    rate = p.rate.rate * push
    if p.rate.leakage > 0.0:
        rate = rate - p.rate.leakage * s.depth.depth
    return rate


def watch_stops(
    p: SupervisorParameters, s: RateWatch, asked: float, rate: float, volume: float
) -> RateWatch:
    """Count the ticks in which a push outward ended where those before it did."""
    beyond = volume - s.top
    if beyond > p.push.grown:
        s = s._replace(top=volume, stops=0)
    if asked > p.rate.stop_rate and abs(rate) < p.rate.stop_least:
        s = s._replace(stops=debounce(beyond >= -p.push.grown, s.stops, p.rate.stops))
        if s.stops == 0:
            s = s._replace(top=volume)
    return s


def watch_rate(
    p: SupervisorParameters, s: RateWatch, asked: float, rate: float, volume: float
) -> RateWatch:
    """Compare the volume's rate with what the command should give, both smoothed alike."""
    low, high = p.volume.volume_low, p.volume.volume_high
    if (asked > 0.0 and volume > high) or (asked < 0.0 and volume < low):
        asked = rate  # at its end, or nearly: it may stop
    if p.rate.stop_rate < math.inf:
        s = watch_stops(p, s, asked, rate, volume)
    lag = smoothed(s.lag, asked - rate, p.rate.rate_smoothing)
    asked = smoothed(s.asked, asked, p.rate.rate_smoothing)
    wrong = abs(lag) > p.rate.rate_share * abs(asked) + p.rate.rate_least
    most = p.rate.following
    following = debounce(wrong, s.following, most)
    if p.rate.stop_rate < math.inf and s.stops >= p.rate.stops:
        following = most
    return s._replace(lag=lag, asked=asked, following=following)


def believable(p: DepthLimits, depth: float, last: float, since: Count) -> bool:
    """Return whether a depth can be: in the sensor's range, near the last good one."""
    possible = p.depth_least <= depth <= p.depth_most
    change = abs(depth - last)
    near = change <= p.step or since == NEVER or change <= times(since, p.fastest) + p.jump
    return possible and near


def count_blind(p: DepthLimits, s: DepthWatch, depth: float, late: bool, good: bool) -> DepthWatch:
    """Count the quarters of ticks without a good depth; at the limit say why."""
    blind = share(0 if good else 4, s.blind, p.blind_quarters)
    if blind >= p.blind_quarters and s.blind < p.blind_quarters:
        if late:
            blind = more(blind, 2)
        elif math.isfinite(depth):
            blind = more(blind, 1)
    return s._replace(blind=blind)


def count_unmeasured(p: VolumeLimits, s: VolumeWatch, volume: float, measured: bool) -> VolumeWatch:
    """Count the ticks without a good volume; at the limit say why."""
    blind = debounce(not measured, s.volume_blind, p.blind)
    if blind >= p.blind and s.volume_blind < p.blind and math.isfinite(volume):
        blind = more(blind, 1)
    return s._replace(volume_blind=blind)


def rests(p: RestLimits, depth: float, n: float, room: float) -> bool:
    """Return whether the vehicle may be afloat, or lie on the bottom."""
    afloat = depth <= p.surface and n >= -room
    return afloat or (p.aground < math.inf and depth >= p.aground and n <= room)


def watch_still(p: RestLimits, s: RestWatch, depth: float) -> RestWatch:
    """Count the ticks in which the depth stayed where it was."""
    if abs(depth - s.anchor) <= p.still_distance:  # never of an anchor that a bit has made none
        return s._replace(still=more(s.still, 1))
    return s._replace(anchor=depth, still=0)


def drag_volume(p: MotionLimits, speed: float) -> float:
    """Return the volume beyond the neutral one [m3] that drag takes at a speed, eq. (13)."""
    if p.epsilon < math.inf and abs(speed) > p.epsilon:
        blunt = math.copysign(p.drag_0 + p.drag_square * speed * speed, speed)
        return p.drag_blunt * speed + blunt
    return p.drag_linear * speed


def needed(p: MotionLimits, s: MotionWatch, depth: float) -> float:
    """Return the volume beyond the neutral one [m3] that the motion takes, eq. (13)."""
    later = s.z1 - s.z2
    return (depth - s.z1 - later) * p.inertia + p.drag_linear * later * p.per_tau + s.blunt


def learn(p: MotionLimits, s: MotionWatch, depth: float, n: float, room: float) -> MotionWatch:
    """Learn which neutral volume this dive has, within what is known before, and has now."""
    weight = s.weight
    if weight > p.forgetting:
        s = s._replace(weight=weight - weight * weight)
    s = s._replace(known=more(s.known, 1), own_depth=smoothed(s.own_depth, depth, weight))
    s = s._replace(recent=smoothed(s.recent, n, max(weight, p.smoothing)))
    return s._replace(own=min(max(smoothed(s.own, n, weight), -room), room))


def watch_motion(
    p: SupervisorParameters,
    s: MotionWatch,
    depth: float,
    n: float,
    room: float,
    stands: bool,
    anew: bool,
) -> MotionWatch:
    """Ask which neutral volume the motion means, and whether the vehicle can have it.

    Depth, volume and drag pass two low passes each. Drag beyond its proportion to speed is taken of
    the speed after one and put through the other: of a speed after both, a fast turn would have
    less drag than the vehicle has.
    """
    if not math.isfinite(s.own + s.recent):
        s = s._replace(own=0.0, recent=0.0, known=0)
    weight = 1.0 if anew else p.motion.smoothing
    s = s._replace(z1=smoothed(s.z1, depth, weight), n1=smoothed(s.n1, n, weight))
    speed = (depth - s.z1) * p.motion.per_tau
    blunt = drag_volume(p.motion, speed) - p.motion.drag_linear * speed
    s = s._replace(z2=smoothed(s.z2, s.z1, weight), n2=smoothed(s.n2, s.n1, weight))
    s = s._replace(blunt=smoothed(s.blunt, blunt, weight))
    s = s._replace(settled=0 if anew else more(s.settled, 1))
    own = room
    center = 0.0
    if s.known >= p.motion.known:
        own = min(own, p.motion.neutral_change + p.neutral.psi_range * abs(depth - s.own_depth))
        center = s.own
    off = abs(s.n1 - center) if stands else 0.0
    if s.settled >= p.motion.settle:
        push = needed(p.motion, s, depth)
        missed = p.motion.model_error * abs(push)
        off = max(off, abs(s.n2 + push - center) - missed)
        if missed < p.motion.calm:
            s = learn(p.motion, s, depth, s.n2 + push, room)
    bad = off > own and not anew
    wrong = s.wrong
    if bad and off > own + own:  # beyond twice the threshold: it counts three times
        wrong = min(more(wrong, 2), p.motion.wrong)
    return s._replace(wrong=debounce(bad, wrong, p.motion.wrong))


def watch_sameness(
    p: SupervisorParameters,
    s: SameWatch,
    depth: float,
    before: float,
    n1: float,
    old: bool,
    resting: bool,
) -> SameWatch:
    """Count the ticks of the very same depth; a sample that is not new, `old`, says nothing.

    Noise that turns the depth more often than on the edge between two quanta is seen for good; what
    turns it where the vehicle rests may be how a hull bobs. What two low passes leave of a volume
    is bounded by the way that the vehicle goes with it; what one leaves comes before the way.
    """
    same = s.same
    if not old:
        rose = depth < before
        sank = depth > before
        same = 0 if rose or sank else more(same, 1)
        if s.noisy < p.same.noisy and not resting:
            fro = 1.0 if (rose and s.sank) or (sank and s.rose) else 0.0
            s = s._replace(noisy=smoothed(s.noisy, fro, p.same.noisy_weight))
        s = s._replace(rose=rose, sank=sank)
    if same <= p.same.same_begun:
        s = s._replace(same_volume=n1, moved=0.0)
    moved = smoothed(s.moved, n1 - s.same_volume, p.motion.smoothing)
    frozen = s.frozen or (p.same.same < NEVER and same >= p.same.same)
    frozen = frozen or (same >= p.same.same_noisy and s.noisy >= p.same.noisy)
    away = same >= p.same.same_moved and not resting and abs(moved) > p.same.moved
    return s._replace(same=same, moved=moved, frozen=frozen or away)


def way_to_stop(p: SupervisorParameters, speed: float, lacks: float, room: float) -> float:
    """Return how far down the vehicle still goes under full buoyancy [m].

    lacks [m3]: below its neutral volume; room [m3]: to its largest. In steps of a sixth of the time
    that it takes without drag and compression, which are in it; 1e6 m where it goes on for ever.
    """
    twice = 2.0 * speed / p.deep.force
    root = math.sqrt(lacks * lacks + p.deep.turn_rate * twice)
    time = (lacks + root) * p.deep.per_turn_rate
    if lacks < 0.0:  # the same, without the difference of what is nearly equal
        time = twice / (root - lacks)
    dt = time / 6.0
    way = 0.0
    w = speed
    given = 0.0
    for _ in range(_STEPS):
        if w > 0.0:
            before = given
            given = min(given + p.deep.turn_rate * dt, room)
            heavy = lacks + p.neutral.psi * (way + 0.5 * dt * w) - 0.5 * (before + given)
            drag = p.deep.force * drag_volume(p.motion, w) / w
            after = (w + dt * p.deep.force * heavy) / (1.0 + dt * drag)
            way = way + 0.5 * dt * (w + max(after, 0.0))
            w = after
    return way if w <= 0.0 else _ANY


def watch_deep(
    p: SupervisorParameters, s: SupervisorState, depth: float, n: float, volume: float
) -> Count:
    """Return the ticks in which the vehicle was too deep, or was to be before it can turn round.

    n [m3]: volume beyond the neutral one, which the dive may have shown to be another.
    """
    wrong = depth > p.deep.depth_limit
    first = depth - s.motion.z1
    speed = (first + first - (s.motion.z1 - s.motion.z2)) * p.motion.per_tau  # without their lag
    if speed > 0.0 and not wrong:
        lacks = p.deep.heavier - n
        if s.motion.known >= p.motion.known:
            lacks = s.motion.own + p.motion.neutral_change - n
        heavy = lacks - drag_volume(p.motion, speed)
        speed = speed + p.deep.lag * p.deep.force * max(heavy, 0.0)
        room = max(p.deep.largest - volume, 0.0)
        wrong = depth + way_to_stop(p, speed, lacks, room) > p.deep.deepest
    return debounce(wrong, s.deep, p.deep.deep)


def watch_progress(p: SupervisorParameters, s: SupervisorState, seen: Watched) -> ProgressWatch:
    """Count the ticks in which the vehicle comes no nearer to where it is sent, or is to be light.

    Nobody measures its volume. What its runs make it, `computed`, is what it would be with a pump
    that delivers and a valve that is tight; beyond what a hull without water inside can need, the
    vehicle has to rise.
    """
    way, limits = s.progress, p.progress
    afloat = seen.depth <= p.rest.surface
    rises = seen.depth - s.motion.z1 < -p.rest.still_distance
    beyond = seen.computed - limits.light_slope * seen.depth - limits.light_volume
    stays = beyond - max(way.drifted, 0.0) > limits.light_range and not (afloat or rises)
    drifted = smoothed(way.drifted, beyond, limits.light_smoothing)
    drifted = 0.0 if afloat or not math.isfinite(drifted) else drifted
    way = way._replace(light=debounce(stays, way.light, limits.light), drifted=drifted)
    if not math.isfinite(seen.reference) or way.waited >= limits.waits:
        return way
    target = max(seen.reference, 0.0)
    distance = abs(target - seen.depth)
    arrived = afloat or distance <= limits.arrived
    if arrived or target != way.target or distance < way.farthest - limits.nearer:
        return way._replace(target=target, farthest=distance, waited=0)
    return way._replace(farthest=max(way.farthest, distance), waited=more(way.waited, 1))


def watch_board(p: BoardLimits, s: BoardWatch, seen: Watched, impossible: bool) -> BoardWatch:
    """Count the ticks of a low battery, of a leak, and without a command or a possible set-point.

    impossible: the set-point is none that any vehicle can have.
    """
    low = p.battery_low > 0.0 and seen.battery < p.battery_low
    battery = debounce(low, s.battery, p.battery)
    leak = debounce(seen.leak, s.leak, p.leak)
    missed = s.missed
    if missed < p.missed:
        missed = more(missed, 1) if impossible else min(seen.missed, p.missed)
    return s._replace(battery=battery, leak=leak, missed=missed)


def has_shown(seen: Watched) -> ProofWatch:
    """Return what is known of an actuator that has just reached a volume outward."""
    deepest = seen.reference if math.isfinite(seen.reference) else _ANY
    return ProofWatch(0, seen.volume, deepest, deepest)


def enough(p: SupervisorParameters, jump: float) -> float:
    """Return how far beyond the neutral volume the actuator has to reach for a jump [m] down."""
    share = min(jump * p.proof.per_jump, 1.0)
    return p.proof.sinks + p.neutral.psi * jump + share * (p.proof.reach - p.proof.sinks)


def watch_proof(
    p: SupervisorParameters, s: SupervisorState, seen: Watched, neutral: float, tried: bool
) -> tuple[float, ProofWatch]:
    """Ask for a push outward before a vehicle that has shown none of late goes deeper.

    Return what the volume lacks of what is to be shown [m3], and what is known by now.
    What it showed counts for some time, and as deep and as fast as what it reached is above the
    volume that stops it there. Until it has shown it again the law is asked for nothing deeper.
    Where a law holds a depth and moves the volume anyway, it is shown before anything deeper is
    asked for. Where nobody knows what is asked for, a vehicle that is heavy goes deeper; so does
    one at rest that its command is about to make heavy, where the law rests. tried: it is to show
    it anyway, and to stay out so far that a depth which is the same all the same is frozen.
    """
    proof, asked, beyond = s.proof, seen.reference, seen.volume - neutral
    known = math.isfinite(asked)
    speed = (seen.depth - s.motion.z1) * p.motion.per_tau
    brake = p.proof.per_speed * max(speed - p.proof.lead * beyond, 0.0)
    reach = p.proof.reach + p.proof.ahead
    if known:
        reach = enough(p, max(asked - seen.depth, p.proof.ready))
    if tried:
        reach = max(reach, p.same.moved + p.same.moved)
    lacks = reach + brake + p.push.grown - beyond
    if (lacks < 0.0 and not tried) or seen.volume > p.volume.volume_high:
        return 0.0, has_shown(seen)
    slow = abs(seen.depth - s.motion.z1) <= p.rest.still_distance
    old = proof.unproven >= (p.proof.holding if slow and known else p.proof.unproven)
    spare = proof.shown - neutral - brake
    due, shown_for, allowed = tried, proof.shown_for, proof.allowed
    near = seen.depth + p.proof.ready
    begun = seen.depth if allowed <= shown_for else allowed
    if not known:
        due = due or ((old or spare < p.proof.sinks) and beyond < -p.proof.sinks)
    elif asked > allowed and (tried or old or spare < enough(p, asked - begun)):
        due = True
    else:
        allowed = asked
        if slow and spare >= enough(p, asked - seen.depth):
            shown_for = max(shown_for, asked)
        if slow and not old and spare >= enough(p, p.proof.ready):
            near = near + p.rest.still_distance
            allowed = max(asked, near)
            shown_for = max(shown_for, near)
        due = due or (spare < p.proof.sinks and asked > shown_for)
        late = proof.unproven >= p.proof.early or proof.shown - neutral < enough(p, p.proof.ready)
        if p.proof.early < NEVER and slow and late and abs(beyond) <= p.proof.sinks:
            due = due or abs(seen.depth - asked) <= _HELD * p.proof.ready
        if p.proof.early == NEVER and slow and (old or spare < p.proof.sinks):
            heavier = beyond + expected_rate(p, s) * p.S_p
            due = due or heavier < -p.proof.sinks
    unproven = NEVER if due else more(proof.unproven, 1)
    return lacks, ProofWatch(unproven, proof.shown, shown_for, allowed)


def outward(p: SupervisorParameters, depth: float, volume: float, lacks: float) -> float:
    """Return the command that moves the volume out by what it lacks, and a part of a tick more.

    A motor gets as many quarters as its load takes, and the way.
    """
    if p.rate.positioner > 0.0:
        to = max(volume + lacks + p.proof.least_way, p.push.away_command)
        return min(p.push.surface_command, to)
    load = p.rate.load_drive * depth + p.rate.friction
    needs = lacks + p.rate.rate * load * p.S_p + p.proof.least_way
    command = 0.0
    way = 0.0
    for _ in range(_QUARTERS):
        if needs > way:
            command = command + p.push.quarter
        way = way + p.rate.rate * p.push.quarter * p.S_p
    return min(p.push.surface_command, command)


def reasons_of(p: SupervisorParameters, s: SupervisorState) -> Count:
    """Return the bits of the reasons that there are."""
    bits: Count = 1 if s.restarted else 0
    if s.board.leak >= p.board.leak:
        bits = bits | 2
    if s.deep >= p.deep.deep:
        bits = bits | 4
    if s.depth.blind >= p.depth.blind_quarters:
        kind = less(s.depth.blind, p.depth.blind_quarters)
        bits = bits | (8 if kind == 0 else (16 if kind == 1 else 32))
    if s.same.frozen:
        bits = bits | 64
    if s.volume.volume_blind >= p.volume.blind:
        bits = bits | (128 if s.volume.volume_blind == p.volume.blind else 256)
    if s.rate.following >= p.rate.following:
        bits = bits | 512
    if s.motion.wrong >= p.motion.wrong:
        bits = bits | 1024
    stays = s.progress.waited >= p.progress.waits or s.progress.light >= p.progress.light
    if p.progress.light < NEVER and stays:
        bits = bits | 1024
    if s.board.battery >= p.board.battery:
        bits = bits | 2048
    if s.board.missed >= p.board.missed:
        bits = bits | 4096
    if s.time.lost >= p.time.lost_quarters:
        bits = bits | 8192
    if p.time.time_blocks < NEVER and s.time.block >= p.time.time_blocks:
        over = s.time.block > p.time.time_blocks or s.time.tick > p.time.time_ticks
        bits = bits | (16384 if over else 0)
    return bits


def first_of(bits: Count) -> Count:
    """Return the number of the lowest bit, 1 for that of 1; 0 where there is none."""
    number: Count = 0
    bit: Count = 1
    for i in range(_REASONS):
        if number == 0 and bits & bit > 0:
            number = more(i, 1)
        bit = more(bit, bit)
    return number


def watch_push(
    p: SupervisorParameters,
    s: PushWatch,
    volume: float,
    measured: bool,
    sinks: bool,
    lifts: bool,
    high: bool,
    blind: bool,
) -> PushWatch:
    """Turn the push round where the volume goes away from where it is sent, and once back.

    A motor whose wires are swapped drives it away at its full rate. What falls more slowly the sea
    may drive back: it is tried the other way unless the vehicle is light (`lifts`), and back where
    that gains nothing. One that stands is tried at the inner end, where little is lost, or once it
    has stood for a whole push while the vehicle sinks and its reading moves. A tick that is lost,
    or does not see the volume, begins no such try and ends any. What a turned push gained stays
    turned until the volume falls, or stands while the vehicle sinks or at the inner end. A rest in
    which the sea drives it in is over. Numbers of turns that there are not, of bits that flipped,
    are none.
    """
    turns = s.turns if s.turns <= TRIED or s.turns == GREW else 0
    moves = volume != s.seen  # by noise at least: it is none that is stuck
    s = s._replace(seen=volume)
    gained = volume - s.pushed
    if measured and gained > p.push.grown:
        return s._replace(pushed=volume, astray=0, turns=GREW if turns > 1 else turns)
    late = s.astray >= p.push.astray
    inward = gained < -p.push.grown
    fell = gained < -p.push.away or (inward and late and turns == TRIED)
    fast = gained < -(p.push.away_fast + times(s.astray, p.push.away_fast))
    patience = p.push.push if high else p.push.again
    inside = volume < p.volume.volume_low
    stands = turns > 1 and (sinks or inside) and not inward and s.astray >= patience
    if turns == 2 or (inside and not (blind or turns == GREW)):
        stands = late
    elif turns == 0 and sinks and not (blind or inward) and moves:
        stands = s.astray >= p.push.push
    tries = p.push.astray if lifts else p.push.again
    stands = stands or (turns == TRIED and s.astray >= tries)
    s = s._replace(astray=more(s.astray, 1), turns=turns)
    if fell:
        s = s._replace(pushed=volume)
    away = fell and (turns == TRIED or fast or not (lifts or blind))
    if fell and s.phase >= p.push.push:
        s = s._replace(astray=0, phase=less(p.push.push, p.push.again))
    elif turns != 1 and (away or stands or (blind and 1 < turns < GREW)):
        s = s._replace(astray=0, turns=1 if turns > 1 else (TRIED if fell else 2), phase=0)
    return s


def bring_up(
    p: SupervisorParameters, s: SupervisorState, good: bool, lost: Count
) -> SupervisorState:
    """Command full buoyancy in pushes and rests; ask for the drop weight where it does not rise."""
    depth = s.depth.depth
    if s.recovery.reason == 0:
        reason = first_of(s.recovery.reasons)
        turns = s.push.turns if s.restarted else 0  # of a push before the reset; of none otherwise
        s = s._replace(
            push=s.push._replace(turns=turns),
            recovery=s.recovery._replace(reason=reason, from_depth=depth),
        )
    up = depth <= p.rest.surface
    volume = s.volume.volume
    high = volume >= p.volume.volume_high
    moved = depth - s.motion.z1
    moves = good and not up and abs(moved) > p.rest.still_distance
    sinks = moves and moved > 0.0
    measured = s.volume.measured
    blind = lost > 0 or not measured
    s = s._replace(push=s.push._replace(astray=more(s.push.astray, lost)))
    driven = s.rate.asked - s.rate.lag < -0.5 * p.push.away_fast * p.per_tick
    lifts = good and not driven and (up or needed(p.motion, s.motion, depth) < -p.proof.sinks)
    s = s._replace(push=watch_push(p, s.push, volume, measured, sinks, lifts, high, blind))
    command = p.push.surface_command if s.push.phase < p.push.push else p.push.hold_command
    phase = more(s.push.phase, 1)
    if s.push.turns > 1:
        command = p.push.away_command
        phase = 0
        if s.push.turns < GREW and s.push.astray < p.push.astray and p.rate.positioner == 0.0:
            command = -outward(p, depth, volume, 0.0)
        if high and s.push.astray >= p.push.astray:
            command = p.push.away_hold
            phase = p.push.push
    elif phase >= p.push.push:
        out = high and measured
        patience = p.push.again if out or (good and up) else p.push.stall
        gains = (moves and not out) or s.push.astray < patience
        if phase >= more(p.push.push, p.push.rest):
            s = s._replace(push=s.push._replace(astray=0))
            phase = less(p.push.push, p.push.again)
        elif sinks or gains:
            phase = less(p.push.push, p.push.again)
    window = more(s.recovery.window, 1)
    s = s._replace(
        command=command,
        push=s.push._replace(phase=phase),
        recovery=s.recovery._replace(window=window),
    )
    if s.recovery.window >= p.push.release:
        if not (good and (up or depth <= s.recovery.from_depth - p.push.rise)):
            s = s._replace(recovery=s.recovery._replace(release=True))
        s = s._replace(recovery=s.recovery._replace(window=0, from_depth=depth))
    return s


def step(
    parameters: SupervisorParameters, state: SupervisorState, seen: Watched, wanted: float
) -> tuple[float, SupervisorState, float]:
    """Return the command [V or m3]: `wanted`, the law's, or full buoyancy for a reason."""
    p = parameters
    lost = seen.lost
    since = more(more(state.depth.since, 1), lost)
    late = seen.depth_age > p.depth.late_age
    good = not late and believable(p.depth, seen.depth, state.depth.depth, since)
    depth = seen.depth if good else state.depth.depth
    measured = p.volume.volume_least <= seen.volume <= p.volume.volume_most
    volume = seen.volume if measured else state.volume.volume
    s = state._replace(time=count_time(p.time, state.time, lost))
    if measured and lost == 0 and s.volume.measured:
        asked = expected_rate(p, s)
        rate = (volume - s.volume.volume) * p.per_tick
        s = s._replace(rate=watch_rate(p, s.rate, asked, rate, volume))
    s = s._replace(depth=count_blind(p.depth, s.depth, seen.depth, late, good))
    s = s._replace(volume=count_unmeasured(p.volume, s.volume, seen.volume, measured))
    n = volume - p.neutral.psi * depth - p.neutral.neutral
    room = p.neutral.neutral_range + p.neutral.psi_range * abs(depth)
    resting = rests(p.rest, depth, n, room)
    if good:
        s = s._replace(rest=watch_still(p.rest, s.rest, depth))
        stands = s.rest.still >= p.rest.still
        emerges = depth <= p.rest.surface and abs(depth - s.motion.z1) > p.rest.still_distance
        anew = resting or emerges or since > p.depth.gap
        s = s._replace(motion=watch_motion(p, s.motion, depth, n, room, stands, anew))
        before, n1 = s.depth.depth, s.motion.n1
        old = seen.depth_age >= p.S_p
        s = s._replace(same=watch_sameness(p, s.same, depth, before, n1, old, resting))
        s = s._replace(deep=watch_deep(p, s, depth, n, volume))
        if p.progress.light < NEVER:
            s = s._replace(progress=watch_progress(p, s, seen))
        since = 0
    impossible = seen.reference < p.depth.depth_least or seen.reference > p.depth.depth_most
    s = s._replace(board=watch_board(p.board, s.board, seen, impossible))
    asks = p.proof.same_tried < NEVER and good
    if asks and measured and not resting and s.motion.known >= p.motion.known:
        neutral = volume - n + max(s.motion.own, s.motion.recent - p.push.grown)
        tried = s.same.same >= p.proof.same_tried
        s = s._replace(command=wanted)
        lacks, proof = watch_proof(p, s, seen, neutral, tried)
        s = s._replace(proof=proof)
        if s.proof.unproven == NEVER:
            wanted = outward(p, seen.depth, volume, lacks)
    elif asks and measured:
        if volume > s.proof.shown:
            s = s._replace(proof=has_shown(seen))
        s = s._replace(proof=s.proof._replace(allowed=_ANY))
    s = s._replace(
        depth=s.depth._replace(since=since, depth=depth),
        volume=s.volume._replace(volume=volume, measured=measured),
        command=wanted,
    )
    s = s._replace(recovery=s.recovery._replace(reasons=reasons_of(p, s)))
    r = s.recovery
    if more(r.reasons, r.reason) > 0:  # a bit that flips does not end it
        s = bring_up(p, s, good, lost)
    return s.command, s, p.S_p


SUPERVISOR = Law(
    name="supervisor",
    summary="gives a law's command on until there is a reason to bring the vehicle up",
    command="voltage",
    parameters=SupervisorParameters,
    state=SupervisorState,
    step=step,
    initial=initial,
)
