"""The supervisor: watches a vehicle under any law and, once it has a reason, brings it up for good.

`step` has the form of a law's, so that it is translated as laws are. In place of a depth asked for
it takes the law's command, and gives it on until it has a reason; from then on it gives the command
that makes the vehicle lightest, by its own count of ticks: no sensor is asked, since any may lie.
What each detector does and why: docs/explanation/supervisor.md.

Ticks are counted in whole numbers of 16 bits, which stay at their ends; the time of a dive in two
of them. Each watch changes the state where it stands. What a vehicle's numbers switch off is asked
for by a comparison of numbers alone, so that a compiler that knows them leaves it out.
"""

from swimbladder.control.law import NEVER, Count, Law, less, more
from swimbladder.control.supervisor_records import (
    PushWatch,
    SupervisorParameters,
    SupervisorState,
    Watched,
    initial,
)
from swimbladder.control.supervisor_watches import (
    believable,
    count_blind,
    count_time,
    count_unmeasured,
    expected_rate,
    first_of,
    reasons_of,
    rests,
    watch_board,
    watch_deep,
    watch_motion,
    watch_rate,
    watch_reach,
    watch_sameness,
    watch_still,
)


def watch_push(
    p: SupervisorParameters, s: PushWatch, volume: float, measured: bool, sinks: bool, high: bool,
    blind: bool,
) -> PushWatch:  # fmt: skip
    """Turn the push round where the volume goes away from where it is sent, and once back.

    At the inner end little is lost by trying; a try ends at a tick that is lost, or does not see
    the volume. What a turned push gained stays turned until the volume falls, or stands while the
    vehicle sinks. A rest in which the sea drives it in is over.
    """
    turns = s.turns
    gained = volume - s.pushed
    if measured and gained > p.push.grown:
        return s._replace(pushed=volume, astray=0, turns=4 if turns > 1 else turns)
    late = s.astray >= p.push.astray
    inward = gained < -p.push.grown
    fell = gained < -p.push.away or (inward and late and turns == 3)
    patience = p.push.push if high else p.push.again
    stands = turns > 1 and sinks and not inward and s.astray >= patience
    if turns == 2 or not (blind or turns > 3 or volume >= p.volume.volume_low):
        stands = late
    s = s._replace(astray=more(s.astray, 1))
    if fell:
        s = s._replace(pushed=volume)
    if fell and s.phase >= p.push.push:
        s = s._replace(astray=0, phase=less(p.push.push, p.push.again))
    elif turns != 1 and (fell or stands or (blind and 1 < turns < 4)):
        s = s._replace(astray=0, turns=1 if turns > 1 else (3 if fell else 2), phase=0)
    return s


def bring_up(
    p: SupervisorParameters, s: SupervisorState, good: bool, lost: Count
) -> SupervisorState:
    """Command full buoyancy in pushes and rests; ask for the drop weight where it does not rise."""
    depth = s.depth.depth
    if s.rescue.reason == 0:
        reason = first_of(s.rescue.reasons)
        s = s._replace(rescue=s.rescue._replace(reason=reason, from_depth=depth))
    up = depth <= p.rest.surface
    volume = s.volume.volume
    high = volume >= p.volume.volume_high
    moved = depth - s.motion.z1
    moves = good and not up and abs(moved) > p.rest.still_distance
    sinks = moves and moved > 0.0
    measured = s.volume.measured
    blind = lost > 0 or not measured
    s = s._replace(push=watch_push(p, s.push, volume, measured, sinks, high, blind))
    command = p.push.surface_command if s.push.phase < p.push.push else p.push.hold_command
    phase = more(s.push.phase, 1)
    if s.push.turns > 1:
        command = p.push.away_command
        phase = 0
        if high and s.push.astray >= p.push.astray:
            command = p.push.away_hold
            phase = p.push.push
    elif phase >= p.push.push:
        gains = (moves or s.push.astray < p.push.again) and not high
        if sinks or gains or phase >= more(p.push.push, p.push.rest):
            phase = less(p.push.push, p.push.again)
    window = more(s.rescue.window, 1)
    s = s._replace(
        command=command, push=s.push._replace(phase=phase), rescue=s.rescue._replace(window=window)
    )
    if s.rescue.window >= p.push.release:
        if not (good and (up or depth <= s.rescue.from_depth - p.push.rise)):
            s = s._replace(rescue=s.rescue._replace(release=True))
        s = s._replace(rescue=s.rescue._replace(window=0, from_depth=depth))
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
        anew = resting or since > p.depth.gap
        s = s._replace(motion=watch_motion(p, s.motion, depth, n, room, stands, anew))
        before, n1 = s.depth.depth, s.motion.n1
        old = seen.depth_age >= p.S_p
        s = s._replace(same=watch_sameness(p.same, s.same, depth, before, n1, old, resting))
        speed = (depth - s.motion.z1) * p.motion.per_tau
        s = s._replace(deep=watch_deep(p.deep, s.deep, depth, speed, volume))
        since = 0
    s = s._replace(board=watch_board(p.board, s.board, seen))
    asks = p.proof.same_tried < NEVER and good
    if asks and measured and not resting and s.motion.known >= p.motion.known:
        s = s._replace(unproven=watch_reach(p, s, n - s.motion.own))
        if s.unproven == NEVER:
            wanted = p.push.surface_command
    s = s._replace(
        depth=s.depth._replace(since=since, depth=depth),
        volume=s.volume._replace(volume=volume, measured=measured), command=wanted,
    )  # fmt: skip
    s = s._replace(rescue=s.rescue._replace(reasons=reasons_of(p, s)))
    if s.rescue.reasons > 0:
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
