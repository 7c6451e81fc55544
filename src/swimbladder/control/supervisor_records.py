"""The supervisor's records: what it sees, its limits, what it remembers, why it takes over."""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, NamedTuple

from swimbladder.control.law import NEVER, Count


class Watched(NamedTuple):
    """What the supervisor sees at a tick; NaN for what the board has not, or could not measure."""

    depth: float  # m, of the pressure sensor
    depth_age: float  # s, since it was measured
    volume: float  # m3
    battery: float  # V
    leak: bool  # water inside
    lost: Count  # ticks that should have come since the last one
    missed: Count  # calls in a row in which the law gave no command


class PushLimits(NamedTuple):
    """How the vehicle is brought up."""

    surface_command: Annotated[float, "V or m3"]  # that makes the vehicle lightest
    hold_command: Annotated[float, "V or m3"]  # that keeps it so
    away_command: Annotated[float, "V or m3"]  # that makes it heaviest; with swapped wires lightest
    away_hold: Annotated[float, "V or m3"]  # that then keeps it lightest enough
    push: Annotated[Count, "ticks"]  # ticks of the surface command at first
    again: Annotated[Count, "ticks"]  # ticks of it after a rest
    rest: Annotated[Count, "ticks"]  # ticks of the hold command in between
    grown: Annotated[float, "m3"]  # by which the volume is known to have grown
    away: Annotated[float, "m3"]  # by which a push that drives it away is known
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
    sinks: Annotated[float, "m3"]  # before it is heavier by so much
    reach: Annotated[float, "m3"]  # by so much beyond the neutral volume


class NeutralLimits(NamedTuple):
    """Which neutral volume the vehicle can have."""

    psi: Annotated[float, "m3/m"]
    psi_range: Annotated[float, "m3/m"]  # how well psi is known
    neutral: Annotated[float, "m3"]  # neutral volume at the surface
    neutral_range: Annotated[float, "m3"]  # how well it is known, drift included


class MotionLimits(NamedTuple):
    """How depth and volume belong together."""

    neutral_change: Annotated[float, "m3"]  # how far it may walk from what the dive has shown
    known: Annotated[Count, "ticks"]  # ticks in which the dive has to show it
    forgetting: Annotated[float, ""]  # least weight of the newest in it
    calm: Annotated[float, "m3"]  # by which the model may miss where it is learnt
    model_error: Annotated[float, ""]  # share of the force on the vehicle that the model may miss
    inertia: Annotated[float, "m2"]  # volume per second difference of the low passes
    drag_linear: Annotated[float, "m2"]  # and per first difference
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


class DeepLimits(NamedTuple):
    """How deep it may be."""

    depth_limit: Annotated[float, "m"]
    deepest: Annotated[float, "m"]  # that it must not pass before it turns round
    neutral_deepest: Annotated[float, "m3"]  # largest neutral volume there
    per_turn_rate: Annotated[float, "s/m3"]  # 1 / the least rate at the depth limit
    coast: Annotated[float, "s"]  # in which drag takes speed away
    deep: Annotated[Count, "ticks"]  # ticks too deep


class BoardLimits(NamedTuple):
    """What battery, leak sensor and law may do."""

    battery_low: Annotated[float, "V"]
    battery: Annotated[Count, "ticks"]  # ticks below it
    leak: Annotated[Count, "ticks"]  # ticks of leak
    missed: Annotated[Count, "ticks"]  # calls without a command


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
    blind: Count  # quarters of ticks; at its limit 0 to 2 more for what was wrong first


class VolumeWatch(NamedTuple):
    """The last good volume."""

    volume: float  # m3, last good one
    measured: bool  # at the last tick, and none was lost before it
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
    rose: bool  # at the last new depth
    sank: bool
    noisy: float  # -, share of ticks in which the depth turned; it stays where it is enough
    same_volume: float  # m3, n1 when the volume had to stay
    frozen: bool


class MotionWatch(NamedTuple):
    """Depth and volume against the model."""

    z1: float  # m, depth through a low pass
    z2: float  # m, through a second
    n1: float  # m3, volume beyond psi z and the neutral one through a low pass
    n2: float  # m3, through a second
    settled: Count  # ticks since they began
    wrong: Count  # ticks in which depth and volume did not fit
    own: float  # m3, by which the neutral volume is larger as the dive has shown it
    own_depth: float  # m, where it did, on average
    weight: float  # -, of the newest in them, about 1 / ticks
    known: Count  # ticks in which it did


class RestWatch(NamedTuple):
    """A depth that stands still."""

    anchor: float  # m, around it the depth stands still
    still: Count  # ticks for which it has


class BoardWatch(NamedTuple):
    """Battery, leak sensor and law."""

    battery: Count  # ticks
    leak: Count  # ticks
    missed: Count  # calls without a command


class PushWatch(NamedTuple):
    """The safe action, in its turn of pushes and rests."""

    phase: Count  # ticks of the safe action, in its turn of pushes and rests
    pushed: float  # m3, volume as far out as the push has brought it
    astray: Count  # ticks since a push moved it out
    turns: Count  # of the push: 1 for good the way it was; 2 tried, 3 as it fell, 4 as it grew so


class Rescue(NamedTuple):
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
    unproven: Count  # ticks since it has shown that it can push outward; NEVER: it has to
    time: TimeWatch
    depth: DepthWatch
    volume: VolumeWatch
    rate: RateWatch
    same: SameWatch
    motion: MotionWatch
    rest: RestWatch
    board: BoardWatch
    push: PushWatch
    rescue: Rescue


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
        return self.name.lower().replace("_", " ")


def reasons_in(bits: Count) -> tuple[Reason, ...]:
    """Return the reasons whose bits are set: bit n - 1 of reason n."""
    return tuple(reason for reason in Reason if int(bits) >> (reason - 1) & 1)


def initial(parameters: SupervisorParameters, seen: Watched, restarted: float) -> SupervisorState:
    """Return the state at the start; restarted: 1.0 after a watchdog's reset or a brown-out."""
    return SupervisorState(
        restarted=restarted > 0.0, command=0.0, deep=0, unproven=0, time=TimeWatch(0, 0, 0),
        depth=DepthWatch(since=NEVER, depth=0.0, blind=0), volume=VolumeWatch(0.0, False, 0),
        rate=RateWatch(lag=0.0, asked=0.0, following=0, top=0.0, stops=0),
        same=SameWatch(0, rose=False, sank=False, noisy=0.0, same_volume=0.0, frozen=False),
        motion=MotionWatch(
            z1=0.0, z2=0.0, n1=0.0, n2=0.0, settled=0, wrong=0, own=0.0, own_depth=0.0, weight=0.5,
            known=0,
        ),
        rest=RestWatch(anchor=0.0, still=0), board=BoardWatch(0, 0, 0),
        push=PushWatch(phase=0, pushed=parameters.volume.volume_least, astray=0, turns=0),
        rescue=Rescue(reason=0, reasons=0, window=0, from_depth=0.0, release=False),
    )  # fmt: skip
