"""The supervisor's records: what it sees, its limits, what it remembers, why it takes over."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

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

    surface_command: float  # V or m3, that makes the vehicle lightest
    hold_command: float  # V or m3, that keeps it so
    away_command: float  # V or m3, that makes it heaviest; lightest with the wires swapped
    away_hold: float  # V or m3, that then keeps it lightest enough
    push: Count  # ticks of the surface command at first
    again: Count  # ticks of it after a rest
    rest: Count  # ticks of the hold command in between
    grown: float  # m3, by which the volume is known to have grown
    away: float  # m3, by which a push that drives it away is known
    astray: Count  # ticks in which a push moves it nowhere
    release: Count  # ticks in which it has to rise
    rise: float  # m, by so much


class DepthLimits(NamedTuple):
    """Which depths can be."""

    depth_least: float  # m, the least that the sensor can mean
    depth_most: float  # m, the largest
    fastest: float  # m, that the depth may change in a tick
    jump: float  # m, that it may change at once: noise, quantum
    step: float  # m, both: that it may change from a tick to the next
    late_age: float  # s, at which a depth is late
    blind_quarters: Count  # quarters of ticks without a good depth, each good one takes one away
    gap: Count  # ticks without a depth after which the model begins anew


class VolumeLimits(NamedTuple):
    """Which volumes can be, and where the stroke ends."""

    blind: Count  # ticks without a good volume
    volume_least: float  # m3, the least that the sensor can mean
    volume_most: float  # m3, the largest
    volume_low: float  # m3, below it the actuator may be at its end
    volume_high: float  # m3, above it as well


class RateLimits(NamedTuple):
    """How the volume follows a command."""

    positioner: float  # -, 1: commands are volumes
    rate: float  # m3/s/V, K1 A; of a positioner m3/s
    load_drive: float  # V/m, k_z/k_u while the motor drives
    load_back: float  # V/m, while the sea drives it back
    friction: float  # V
    leakage: float  # m2/s, k_l
    rate_smoothing: float  # -
    rate_share: float  # -, of the rate asked for that may be missing
    rate_least: float  # m3/s, that may be missing anyway
    stop_rate: float  # m3/s, asked for, with which a push that ends where others did is a stop
    stop_least: float  # m3/s, below which it has ended
    stops: Count  # ticks of it
    following: Count  # ticks in which the volume does not follow


class SameLimits(NamedTuple):
    """How long a depth can be the very same."""

    same: Count  # ticks of the very same depth that noise does not allow
    same_begun: Count  # ticks of it after which the volume has to stay as well
    same_moved: Count  # ticks of it that are too many where it does not
    moved: float  # m3, by so much
    same_noisy: Count  # ticks of the very same depth where the sensor has shown its noise
    noisy: float  # -, share of ticks in which the depth turns, where it has
    noisy_weight: float  # -, of the newest in it


class ProofLimits(NamedTuple):
    """When the actuator has to show that it can push outward."""

    same_tried: Count  # ticks of it after which the vehicle is pushed outward to see
    unproven: Count  # ticks after which it has to show anew that the actuator can push outward
    sinks: float  # m3, before it is heavier by so much
    reach: float  # m3, by so much beyond the neutral volume


class NeutralLimits(NamedTuple):
    """Which neutral volume the vehicle can have."""

    psi: float  # m3/m
    psi_range: float  # m3/m, how well psi is known
    neutral: float  # m3, neutral volume at the surface
    neutral_range: float  # m3, how well it is known, drift included


class MotionLimits(NamedTuple):
    """How depth and volume belong together."""

    neutral_change: float  # m3, how far it may walk from what the dive has shown
    known: Count  # ticks in which the dive has to show it
    forgetting: float  # -, least weight of the newest in it
    calm: float  # m3, by which the model may miss where it is learnt
    model_error: float  # -, share of the force on the vehicle that the model may miss
    inertia: float  # m2, volume that the motion takes per second difference of the low passes
    drag_linear: float  # m2, and per first difference
    epsilon: float  # m/s, above which drag is not linear
    drag_blunt: float  # m2 s, volume that drag takes there: per speed
    drag_0: float  # m3
    drag_square: float  # m s2, per speed squared
    per_tau: float  # 1/s, 1 / the time of each low pass
    smoothing: float  # -, weight of the newest in it
    settle: Count  # ticks that they take
    wrong: Count  # ticks in which depth and volume do not fit


class RestLimits(NamedTuple):
    """Where the vehicle may rest."""

    surface: float  # m, from there up the vehicle may float
    aground: float  # m, from there down it may lie on the bottom
    still_distance: float  # m, within which a depth stands still
    still: Count  # ticks that it has to


class DeepLimits(NamedTuple):
    """How deep it may be."""

    depth_limit: float  # m
    deepest: float  # m, that it must not pass before it turns round
    neutral_deepest: float  # m3, largest neutral volume there
    per_turn_rate: float  # s/m3, 1 / the least rate at the depth limit
    coast: float  # s, in which drag takes speed away
    deep: Count  # ticks too deep


class BoardLimits(NamedTuple):
    """What battery, leak sensor and law may do."""

    battery_low: float  # V
    battery: Count  # ticks below it
    leak: Count  # ticks of leak
    missed: Count  # calls without a command


class TimeLimits(NamedTuple):
    """How long the dive may take."""

    lost_quarters: Count  # quarters of ticks lost, each that comes takes one away
    time_blocks: Count  # of 4096 ticks
    time_ticks: Count  # beyond them


class SupervisorParameters(NamedTuple):
    """Limits, times in whole ticks, and the model that depth and volume are held against.

    A limit that is infinite, or in ticks NEVER, is off.
    """

    S_p: float  # s
    per_tick: float  # 1/s, 1/S_p
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
    block: Count  # of 4096 ticks
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


SUPERVISOR_UNITS = {
    **dict.fromkeys(("surface_command", "hold_command", "away_command", "away_hold"), "V or m3"),
    **dict.fromkeys(("S_p", "late_age", "coast"), "s"),
    **dict.fromkeys(
        ("push", "again", "rest", "release", "blind", "gap", "same", "same_begun", "same_moved",
         "following", "stops", "settle", "wrong", "same_tried", "unproven", "still", "deep",
         "battery", "leak", "missed", "known", "same_noisy", "astray", "time_ticks"),
        "ticks",
    ),
    "time_blocks": "4096 ticks",
    **dict.fromkeys(("blind_quarters", "lost_quarters"), "ticks/4"),
    **dict.fromkeys(
        ("rise", "depth_least", "depth_most", "fastest", "jump", "step", "surface", "aground",
         "still_distance", "depth_limit", "deepest"),
        "m",
    ),
    **dict.fromkeys(
        ("moved", "sinks", "reach", "volume_least", "volume_most", "volume_low", "volume_high",
         "neutral", "neutral_range", "neutral_deepest", "neutral_change", "calm", "grown"),
        "m3",
    ),
    **dict.fromkeys(
        ("positioner", "rate_smoothing", "rate_share", "model_error", "smoothing", "forgetting",
         "noisy", "noisy_weight"),
        "",
    ),
    "rate": "m3/s/V or m3/s", "load_drive": "V/m", "load_back": "V/m", "friction": "V",
    **dict.fromkeys(("rate_least", "stop_rate", "stop_least"), "m3/s"),
    "leakage": "m2/s", "away": "m3",
    "per_turn_rate": "s/m3", "psi": "m3/m",
    "psi_range": "m3/m", "per_tick": "1/s", "per_tau": "1/s", "inertia": "m2",
    "drag_linear": "m2", "drag_blunt": "m2 s", "drag_0": "m3",
    "drag_square": "m s2", "epsilon": "m/s", "battery_low": "V",
}  # fmt: skip


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
