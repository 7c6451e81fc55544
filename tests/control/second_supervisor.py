"""The supervisor a second time, from its documentation: what the first is compared with.

Written from docs/explanation/supervisor.md and the comments of the parameter records, in another
shape: a detector is an object that changes, a count has no end, a reason is a name. It shares the
records of the parameters and nothing of the code. `SecondSupervisor.step` has the inputs of
`supervisor.step`; `memory` is what it remembers, by the names of `SupervisorState`, and `take_over`
makes it remember what another state holds, as after a bit flip.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Any, NamedTuple

from swimbladder.control.law import leaves
from swimbladder.control.supervisor import SupervisorParameters, SupervisorState, Watched

OFF = 65535  # a limit in ticks that is none; the largest count of 16 bits
ANY_DEPTH = 1e6  # m

REASONS = (
    "restarted",
    "leak",
    "depth limit",
    "depth missing",
    "depth impossible",
    "depth late",
    "depth frozen",
    "volume missing",
    "volume impossible",
    "not following",
    "not moving as modelled",
    "battery low",
    "no command",
    "ticks lost",
    "time limit",
)
"""The first of several at one tick is the cause."""


ENDLESS = ("same", "settled", "known", "still", "waited", "phase", "astray", "window", "unproven")
"""Counts that have no end here, and stay at the largest of 16 bits there."""


def low_pass(old: float, sample: float, weight: float) -> float:
    """y[k] = (1 - a) y[k-1] + a x[k]; from a y that is no number it begins with the sample."""
    return (1.0 - weight) * old + weight * sample if math.isfinite(old) else sample


class Debounce:
    """Bad ticks, less two for each good one; at the limit for good."""

    def __init__(self, limit: int) -> None:
        self.limit, self.bad = limit, 0

    @property
    def reached(self) -> bool:
        return self.limit != OFF and self.bad >= self.limit

    def judge(self, bad: bool, counts: int = 1) -> None:
        if self.reached:
            return
        self.bad = self.bad + counts if bad else max(self.bad - 2, 0)

    @property
    def count(self) -> int:
        return min(self.bad, self.limit)


class Outage:
    """Ticks without something, less a quarter for each with it; at the limit for good."""

    def __init__(self, limit: float) -> None:
        self.limit, self.ticks = limit, 0.0

    @property
    def reached(self) -> bool:
        return self.ticks >= self.limit

    def judge(self, missing: int) -> None:
        if not self.reached:
            self.ticks = self.ticks + missing if missing else max(self.ticks - 0.25, 0.0)

    @property
    def quarters(self) -> float:
        return 4.0 * min(self.ticks, self.limit)


class Clock:
    """Ticks since the start and ticks lost."""

    AT_ONCE = 4095  # of a gap, no more count

    def __init__(self, p: SupervisorParameters) -> None:
        self.limited = p.time.time_blocks != OFF
        self.limit = 4096 * p.time.time_blocks + p.time.time_ticks
        self.elapsed = 0
        self.lost = Outage(p.time.lost_quarters / 4.0)

    def count(self, lost: int) -> None:
        self.lost.judge(lost)
        if self.limited:
            self.elapsed += 1 + min(lost, self.AT_ONCE)

    def reasons(self) -> set[str]:
        found = {"ticks lost"} if self.lost.reached else set()
        return found | ({"time limit"} if self.limited and self.elapsed > self.limit else set())


class DepthSensor:
    """Which depths are good, and for how long there was none."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p = p.depth
        self.last = 0.0
        self.age: int | None = None  # ticks of the last good one; None: there is none
        self.without = Outage(p.depth.blind_quarters / 4.0)
        self.cause = ""

    def sample(self, seen: Watched) -> bool:
        """Return whether the depth of this tick is good."""
        p = self.p
        if self.age is not None:
            self.age += 1 + seen.lost
            self.age = self.age if self.age < OFF else None
        in_range = p.depth_least <= seen.depth <= p.depth_most
        late = seen.depth_age > p.late_age
        far = self.age is not None and not (
            abs(seen.depth - self.last) <= p.jump + self.age * p.fastest
        )
        good = in_range and not late and not far
        was = self.without.reached
        self.without.judge(0 if good else 1)
        if self.without.reached and not was:
            missing = "depth impossible" if math.isfinite(seen.depth) else "depth missing"
            self.cause = "depth late" if late else missing
        return good

    def gap(self) -> bool:
        """Return whether the last good depth is too long ago for the model to go on from it."""
        return self.age is None or self.age > self.p.gap


class VolumeSensor:
    """Which volumes are good, and for how long there was none."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p = p.volume
        self.last, self.measured = 0.0, False
        self.without = Debounce(p.volume.blind)
        self.cause = ""

    def sample(self, volume: float) -> None:
        self.measured = self.p.volume_least <= volume <= self.p.volume_most
        was = self.without.reached
        self.without.judge(not self.measured)
        if self.without.reached and not was:
            finite = math.isfinite(volume)
            self.cause = "volume impossible" if finite else "volume missing"
        self.last = volume if self.measured else self.last


class Drive:
    """Whether the volume follows the commands."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p = p
        self.lag = self.asked = self.top = 0.0
        self.following = Debounce(p.rate.following)
        self.stops = Debounce(p.rate.stops)

    def rate(self, command: float, depth: float, volume: float) -> float:
        """dV/dt of a command at a depth: K1 A (u - c z -+ friction) - k_l z, or a positioner's."""
        p = self.p.rate
        if p.positioner:
            most = p.rate * self.p.S_p
            return min(max(command - volume, -most), most) / self.p.S_p
        outward = command - p.load_drive * depth - p.friction
        inward = command - p.load_back * depth + p.friction
        if outward <= 0.0:  # it stands, or the sea drives it back
            outward = min(inward, 0.0)
        return p.rate * outward - p.leakage * depth

    def compare(self, expected: float, rate: float, volume: float) -> None:
        p, ends = self.p.rate, self.p.volume
        outer = expected > 0.0 and volume > ends.volume_high
        inner = expected < 0.0 and volume < ends.volume_low
        if outer or inner:
            expected = rate
        if p.stop_rate != math.inf:
            self._stop(expected, rate, volume)
        self.lag = low_pass(self.lag, expected - rate, p.rate_smoothing)
        self.asked = low_pass(self.asked, expected, p.rate_smoothing)
        missed = abs(self.lag) - p.rate_least > p.rate_share * abs(self.asked)
        self.following.judge(missed)
        if self.stops.reached and p.stop_rate < math.inf:
            self.following.bad = p.following

    def _stop(self, expected: float, rate: float, volume: float) -> None:
        p, grown = self.p.rate, self.p.push.grown
        there = volume >= self.top - grown
        if volume > self.top + grown:
            self.top, self.stops.bad = volume, 0
        if expected > p.stop_rate and -p.stop_least < rate < p.stop_least:
            self.stops.judge(there)
            if self.stops.bad == 0:
                self.top = volume


class Still:
    """For how long the depth has stood within a distance of where it was."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p = p.rest
        self.anchor, self.ticks = 0.0, 0

    def sample(self, depth: float) -> None:
        if not abs(depth - self.anchor) <= self.p.still_distance:
            self.anchor, self.ticks = depth, 0
        else:
            self.ticks += 1

    def stands(self) -> bool:
        return self.ticks >= self.p.still


class Motion:
    """Speed and acceleration from low passes, and the neutral volume that they mean."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p = p
        self.z1 = self.z2 = self.n1 = self.n2 = self.blunt = 0.0
        self.settled, self.known = 0, 0
        self.own = self.recent = self.own_depth = 0.0
        self.weight = 0.5
        self.wrong = Debounce(p.motion.wrong)

    def drag(self, speed: float) -> float:
        """F_d(w) / (m a_b), which is odd in the speed."""
        p = self.p.motion
        if speed < 0.0:
            return -self.drag(-speed)
        if speed > p.epsilon:
            return p.drag_0 + p.drag_blunt * speed + p.drag_square * speed * speed
        return p.drag_linear * speed

    def force(self, depth: float) -> float:
        """(dw/dt + F_d(w)/m) / a_b, with w = (z1 - z2)/tau and dw/dt = (z - 2 z1 + z2)/tau^2.

        Of the drag only what is in proportion to speed is taken of this w.
        """
        p = self.p.motion
        second_difference = depth - 2.0 * self.z1 + self.z2
        proportional = p.drag_linear * (self.z1 - self.z2) * p.per_tau
        return p.inertia * second_difference + proportional + self.blunt

    def is_known(self) -> bool:
        return self.known >= self.p.motion.known

    def begin(self, depth: float, n: float) -> None:
        self.z1 = self.z2 = depth
        self.n1 = self.n2 = n
        self.blunt, self.settled = 0.0, 0

    def sample(self, depth: float, n: float, *, room: float, stands: bool, anew: bool) -> None:
        """n: volume less that which is neutral by the file; room: by which that may be off."""
        p = self.p.motion
        if not (math.isfinite(self.own) and math.isfinite(self.recent)):
            self.own, self.recent, self.known = 0.0, 0.0, 0
        if anew:
            self.begin(depth, n)
        else:
            self.z1 = low_pass(self.z1, depth, p.smoothing)
            self.z2 = low_pass(self.z2, self.z1, p.smoothing)
            self.n1 = low_pass(self.n1, n, p.smoothing)
            self.n2 = low_pass(self.n2, self.n1, p.smoothing)
            quick = (depth - self.z1) * p.per_tau  # after one low pass; the drag gets the second
            beyond = self.drag(quick) - p.drag_linear * quick
            self.blunt = low_pass(self.blunt, beyond, p.smoothing)
            self.settled += 1
        middle, allowed = 0.0, room
        if self.is_known():
            change = p.neutral_change + self.p.neutral.psi_range * abs(depth - self.own_depth)
            middle, allowed = self.own, change if change < room else room
        off = [abs(self.n1 - middle)] if stands else [0.0]
        if self.settled >= p.settle:
            force = self.force(depth)
            uncertain = p.model_error * abs(force)
            neutral = self.n2 + force
            off.append(abs(neutral - middle) - uncertain)
            if uncertain < p.calm:
                self._learn(depth, neutral, room)
        bad = not anew and any(each > allowed for each in off)
        beyond = any(each > 2.0 * allowed for each in off)
        self.wrong.judge(bad, 3 if beyond else 1)

    def _learn(self, depth: float, neutral: float, room: float) -> None:
        weight, p = self.weight, self.p.motion
        self.weight = weight * (1.0 - weight) if weight > p.forgetting else weight
        self.known += 1
        self.own_depth = low_pass(self.own_depth, depth, weight)
        quick = weight if not weight < p.smoothing else p.smoothing
        self.recent = low_pass(self.recent, neutral, quick)
        own = low_pass(self.own, neutral, weight)
        self.own = -room if own < -room else room if own > room else own


class Sameness:
    """Whether a depth is the very same for longer than a sensor that lives would make it."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p, self.smoothing = p.same, p.motion.smoothing
        self.same, self.same_volume, self.moved = 0, 0.0, 0.0
        self.way = 0  # of the last sample: 1 down, -1 up, 0 the same
        self.noisy = 0.0
        self.frozen = False

    def sample(self, depth: float, before: float, n1: float, *, old: bool, resting: bool) -> None:
        p = self.p
        if not old:
            way = (depth > before) - (depth < before)
            self.same = 0 if way else self.same + 1
            if not resting and self.noisy < p.noisy:
                turned = way * self.way < 0
                self.noisy = low_pass(self.noisy, float(turned), p.noisy_weight)
            self.way = way
        if self.same <= p.same_begun:
            self.same_volume, self.moved = n1, 0.0
        self.moved = low_pass(self.moved, n1 - self.same_volume, self.smoothing)
        moved = abs(self.moved) > p.moved and not resting
        noise = self.noisy >= p.noisy
        limits = [(True, p.same), (noise, p.same_noisy), (moved, p.same_moved)]
        if any(holds and limit != OFF and self.same >= limit for holds, limit in limits):
            self.frozen = True


def stopping_distance(
    p: SupervisorParameters, motion: Motion, speed: float, lacks: float, room: float
) -> float:
    """Return how far down the vehicle goes before w = 0 under full buoyancy; inf: for ever.

    dw/dt = a_b (lacks + psi x - pumped) - F_d(w)/m. A step is a sixth of the time in which
    speed + a_b (lacks t - r t^2 / 2) = 0; drag is taken at the end of it (linearly implicit).
    """
    a, r = p.deep.force, p.deep.turn_rate
    half, product = lacks / r, 2.0 * speed / (a * r)  # t^2 - 2 half t = product
    root = math.sqrt(half * half + product)
    h = (half + root if half >= 0.0 else product / (root - half)) / 6.0
    x, w, pumped = 0.0, speed, 0.0
    for _ in range(14):
        then = min(pumped + h * r, room)
        excess = lacks + p.neutral.psi * (x + h * w / 2.0) - (pumped + then) / 2.0
        slower = (w + h * a * excess) / (1.0 + h * a * motion.drag(w) / w)
        x += h * (w + slower) / 2.0 if slower > 0.0 else h * w / 2.0
        w, pumped = slower, then
        if w <= 0.0:
            return x
    return math.inf


class Deepness:
    """Whether the vehicle is too deep, or too fast to turn round before the deepest."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p = p
        self.deep = Debounce(p.deep.deep)

    def sample(self, depth: float, n: float, volume: float, motion: Motion) -> None:
        too_deep = depth > self.p.deep.depth_limit
        self.deep.judge(too_deep or self._turns_too_late(depth, n, volume, motion))

    def _turns_too_late(self, depth: float, n: float, volume: float, motion: Motion) -> bool:
        p = self.p.deep
        # (z1 - z2)/tau lags by both low passes, (z - z1)/tau by one: twice that less the first
        speed = (2.0 * (depth - motion.z1) - motion.z1 + motion.z2) * self.p.motion.per_tau
        if not speed > 0.0:
            return False
        known = motion.own + self.p.motion.neutral_change
        lacks = (known if motion.is_known() else p.heavier) - n
        pull = lacks - motion.drag(speed)
        if pull > 0.0:
            speed += p.lag * p.force * pull
        room = max(p.largest - volume, 0.0)
        return depth + stopping_distance(self.p, motion, speed, lacks, room) > p.deepest


class Progress:
    """Whether a float with pump and valve comes nearer, and has no more volume than it can need."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p = p
        self.target = self.farthest = self.drifted = 0.0
        self.waited = 0
        self.light = Debounce(p.progress.light)

    def sample(self, seen: Watched, motion: Motion) -> None:
        p, rest = self.p.progress, self.p.rest
        afloat = seen.depth <= rest.surface
        rises = motion.z1 - seen.depth > rest.still_distance
        excess = seen.computed - (p.light_volume + p.light_slope * seen.depth)
        off = self.drifted if not self.drifted < 0.0 else 0.0
        self.light.judge(excess - off > p.light_range and not afloat and not rises)
        self.drifted = low_pass(self.drifted, excess, p.light_smoothing)
        if afloat or not math.isfinite(self.drifted):
            self.drifted = 0.0
        if math.isfinite(seen.reference):
            self._come_nearer(seen.depth, max(seen.reference, 0.0), afloat)

    def _come_nearer(self, depth: float, target: float, afloat: bool) -> None:
        p, distance = self.p.progress, abs(depth - target)
        if p.waits != OFF and self.waited >= p.waits:
            return  # for good
        there = afloat or distance <= p.arrived
        if there or target != self.target or distance < self.farthest - p.nearer:
            self.target, self.farthest, self.waited = target, distance, 0
            return
        self.waited += 1
        if distance > self.farthest:
            self.farthest = distance

    def reasons(self) -> set[str]:
        p = self.p.progress
        stays = self.light.reached or (p.waits != OFF and self.waited >= p.waits)
        return {"not moving as modelled"} if stays and p.light != OFF else set()


class Board:
    """Battery, leak sensor and law."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p = p
        self.battery = Debounce(p.board.battery)
        self.leak = Debounce(p.board.leak)
        self.missed = 0

    def sample(self, seen: Watched) -> None:
        p = self.p
        self.battery.judge(p.board.battery_low > 0.0 and seen.battery < p.board.battery_low)
        self.leak.judge(seen.leak)
        absurd = seen.reference > p.depth.depth_most or seen.reference < p.depth.depth_least
        if not self.mute:
            self.missed = self.missed + 1 if absurd else seen.missed

    @property
    def mute(self) -> bool:
        return self.missed >= self.p.board.missed

    def reasons(self) -> set[str]:
        found = {"battery low"} if self.battery.reached else set()
        found |= {"leak"} if self.leak.reached else set()
        return found | ({"no command"} if self.mute else set())


class Place(NamedTuple):
    """Where a vehicle is of which the actuator has to show that it pushes outward."""

    depth: float
    asked: float
    volume: float
    neutral: float
    behind: float  # m, of the depth before its low pass
    frozen: bool  # it may be: the push is to show that
    soon: float  # m3, by which the law's command changes the volume in a tick


class Proof:
    """How far outward the actuator has shown that it can push, and how long ago."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p = p
        self.ticks, self.pushes = 0, False
        self.shown, self.shown_for, self.allowed = p.volume.volume_least, 0.0, ANY_DEPTH

    def enough(self, jump: float) -> float:
        """Volume beyond the neutral one for a jump down: at its end psi takes its part."""
        p, part = self.p.proof, jump * self.p.proof.per_jump
        beyond = p.reach if part >= 1.0 else (1.0 - part) * p.sinks + part * p.reach
        return self.p.neutral.psi * jump + beyond

    def show(self, volume: float, asked: float) -> None:
        self.ticks, self.pushes, self.shown = 0, False, volume
        self.shown_for = self.allowed = asked if math.isfinite(asked) else ANY_DEPTH

    def free(self, volume: float, asked: float) -> None:
        """Ask for no push, where the vehicle rests or nothing is known of its neutral volume."""
        if volume > self.shown:
            self.show(volume, asked)
        self.allowed = ANY_DEPTH

    def sample(self, at: Place) -> float:
        """Return the volume that is still to be gained [m3] where a push is due."""
        p = self.p.proof
        beyond = at.volume - at.neutral
        # what the volume does to the speed is behind it as the low pass is
        falls = at.behind * self.p.motion.per_tau - p.lead * beyond
        brake = p.per_speed * falls if falls > 0.0 else 0.0
        known = math.isfinite(at.asked)
        reach = self.enough(max(p.ready, at.asked - at.depth)) if known else p.reach + p.ahead
        if at.frozen:  # far enough for `Sameness` to see it
            reach = max(reach, 2.0 * self.p.same.moved)
        missing = reach + brake + self.p.push.grown - beyond
        if at.volume > self.p.volume.volume_high or not (at.frozen or missing >= 0.0):
            self.show(at.volume, at.asked)
            return 0.0
        spare = self.shown - at.neutral - brake
        if known:
            due = self._where_it_is_sent(at, spare)
        else:
            heavy = beyond < -p.sinks
            due = at.frozen or (heavy and (self.ticks_since >= p.unproven or spare < p.sinks))
        self.ticks += 1
        self.pushes = self.pushes or due or self.ticks >= OFF  # until it is shown
        return missing

    @property
    def ticks_since(self) -> float:
        return math.inf if self.pushes else self.ticks

    def _where_it_is_sent(self, at: Place, spare: float) -> bool:
        """Return whether a push is due, and note the depth that the law may be asked for."""
        p, still = self.p.proof, self.p.rest.still_distance
        slow = abs(at.behind) <= still
        old = self.ticks_since >= (p.holding if slow else p.unproven)
        begun = at.depth if self.allowed <= self.shown_for else self.allowed
        deeper = at.asked > self.allowed
        if deeper and (at.frozen or old or spare < self.enough(at.asked - begun)):
            return True
        self.allowed = at.asked
        if slow and spare >= self.enough(at.asked - at.depth):
            self.shown_for = max(self.shown_for, at.asked)
        if slow and not old and spare >= self.enough(p.ready):
            near = at.depth + p.ready + still
            self.allowed, self.shown_for = max(near, at.asked), max(self.shown_for, near)
        due = at.frozen or (at.asked > self.shown_for and spare < p.sinks)
        return due or (slow and self._while_it_holds(at, old or spare < p.sinks))

    def _while_it_holds(self, at: Place, stale: bool) -> bool:
        """Return whether a push is due at a depth that stands."""
        p, beyond = self.p.proof, at.volume - at.neutral
        if p.early == OFF:  # the law rests: left alone until it makes the vehicle heavy
            return stale and (self.pushes or beyond + at.soon < -p.sinks)
        again = self.ticks_since >= p.early or self.shown - at.neutral < self.enough(p.ready)
        holds = abs(at.asked - at.depth) <= p.ready / 10.0
        return again and holds and -p.sinks <= beyond <= p.sinks


class Direction(Enum):
    """Which way full buoyancy pushes; the numbers are those of `PushWatch.turns`."""

    OUTWARD = 0
    OUTWARD_FOR_GOOD = 1
    TRIED_AS_IT_STOOD = 2
    TRIED_AS_IT_FELL = 3
    REVERSED = 7

    @property
    def is_turned(self) -> bool:
        return self not in (Direction.OUTWARD, Direction.OUTWARD_FOR_GOOD)

    @property
    def is_try(self) -> bool:
        return self in (Direction.TRIED_AS_IT_STOOD, Direction.TRIED_AS_IT_FELL)


class Sight(NamedTuple):
    """What the safe action sees at a tick."""

    depth: float
    volume: float
    good: bool  # the depth
    measured: bool  # the volume
    lost: int
    up: bool
    high: bool  # the volume is as good as all out
    rises: bool
    sinks: bool
    light: bool

    @property
    def blind(self) -> bool:
        return self.lost > 0 or not self.measured


class SafeAction:
    """Full buoyancy in pushes and rests, turned round where the wires are, and the weight."""

    def __init__(self, p: SupervisorParameters) -> None:
        self.p = p
        self.phase, self.idle, self.window = 0, 0, 0
        self.out, self.seen = p.volume.volume_least, 0.0
        self.direction = Direction.OUTWARD
        self.from_depth, self.release = 0.0, False

    def begin(self, depth: float, restarted: bool) -> None:
        self.from_depth = depth
        if not restarted:
            self.direction = Direction.OUTWARD

    def command(self, at: Sight) -> float:
        self.idle = min(self.idle + at.lost, OFF)  # the speed of a fall is judged by it
        self._follow(at)
        command = self._turned(at) if self.direction.is_turned else self._pushed(at)
        self._judge_rise(at)
        return command

    def _follow(self, at: Sight) -> None:
        """Note what the volume does, and turn the push where it goes the wrong way."""
        p, lost = self.p.push, self.out - at.volume
        alive, self.seen = at.volume != self.seen, at.volume
        if at.measured and -lost > p.grown:
            self.out, self.idle = at.volume, 0
            if self.direction.is_turned:
                self.direction = Direction.REVERSED
            return
        long = self.idle >= p.astray
        creeps = self.direction is Direction.TRIED_AS_IT_FELL and long and lost > p.grown
        fell = lost > p.away or creeps
        turn = self._fell(at, lost) if fell else False
        turn = turn or self._stands(at, lost, alive)
        if self.direction.is_try and at.blind:
            turn = True
        self.idle += 1
        if fell:
            self.out = at.volume
        if fell and self.phase >= p.push:  # the sea drove it in while it rested
            self.idle, self.phase = 0, max(p.push - p.again, 0)
        elif turn and self.direction is not Direction.OUTWARD_FOR_GOOD:
            tried = Direction.TRIED_AS_IT_FELL if fell else Direction.TRIED_AS_IT_STOOD
            back = self.direction.is_turned
            self.direction = Direction.OUTWARD_FOR_GOOD if back else tried
            self.idle = self.phase = 0

    def _fell(self, at: Sight, lost: float) -> bool:
        """Return whether a volume that came in turns the push."""
        if self.direction is Direction.TRIED_AS_IT_FELL:
            return True
        rapid = lost > (self.idle + 1) * self.p.push.away_fast
        return rapid or not (at.light or at.blind)

    def _stands(self, at: Sight, lost: float, alive: bool) -> bool:
        """Return whether a volume that does not grow turns the push."""
        p = self.p.push
        long = self.idle >= p.astray
        inside = at.volume < self.p.volume.volume_low
        at_inner_end = inside and not at.blind
        patience = p.push if at.high else p.again
        in_vain = (at.sinks or inside) and not lost > p.grown and self.idle >= patience
        match self.direction:
            case Direction.OUTWARD | Direction.OUTWARD_FOR_GOOD if at_inner_end:
                return long
            case Direction.OUTWARD if at.sinks and alive and not at.blind:
                return not lost > p.grown and self.idle >= p.push
            case Direction.OUTWARD | Direction.OUTWARD_FOR_GOOD:
                return False
            case Direction.TRIED_AS_IT_STOOD:
                return long
            case Direction.TRIED_AS_IT_FELL:
                ends = self.idle >= (p.astray if at.light else p.again)
                return ends or (long if at_inner_end else in_vain)
            case Direction.REVERSED:
                return in_vain

    def _turned(self, at: Sight) -> float:
        """Return the command of a push the other way round: no rests, held at its outer end."""
        p, begins = self.p.push, self.idle < self.p.push.astray
        self.phase = 0
        if at.high and not begins:
            self.phase = p.push
            return p.away_hold
        motor = self.p.rate.positioner == 0.0
        if motor and begins and self.direction.is_try:
            return -outward_command(self.p, at.depth, at.volume, 0.0)
        return p.away_command

    def _pushed(self, at: Sight) -> float:
        """Return the surface command in a push, the hold command in a rest."""
        p, pushes = self.p.push, self.phase < self.p.push.push
        self.phase += 1
        rested = self.phase - p.push
        if rested >= 0:
            out = at.high and at.measured
            patience = p.again if out or (at.good and at.up) else p.stall
            goes_on = at.sinks or (at.rises and not out) or self.idle < patience
            if rested >= p.rest:
                self.idle = 0
            if rested >= p.rest or goes_on:
                self.phase = max(p.push - p.again, 0)
        return p.surface_command if pushes else p.hold_command

    def _judge_rise(self, at: Sight) -> None:
        """Release the weight where the vehicle did not rise in its time, nor is afloat."""
        self.window += 1
        if self.window < self.p.push.release:
            return
        rose = at.good and (at.up or self.from_depth - at.depth >= self.p.push.rise)
        self.release = self.release or not rose
        self.window, self.from_depth = 0, at.depth


def outward_command(p: SupervisorParameters, depth: float, volume: float, missing: float) -> float:
    """Return the command of a test push: quarters of the voltage for load, friction and way."""
    if p.rate.positioner:
        goal = volume + missing + p.proof.least_way
        return min(max(p.push.away_command, goal), p.push.surface_command)
    per_quarter = p.rate.rate * p.S_p * p.push.quarter
    load = (p.rate.load_drive * depth + p.rate.friction) * p.rate.rate * p.S_p
    way = missing + load + p.proof.least_way
    quarters = next((k for k in range(4) if way <= k * per_quarter), 4) if way == way else 0
    return min(quarters * p.push.quarter, p.push.surface_command)


class SecondSupervisor:
    """All of it, in the order of a tick."""

    def __init__(self, p: SupervisorParameters, restarted: bool = False) -> None:
        self.p, self.restarted = p, restarted
        self.command = 0.0
        self.clock = Clock(p)
        self.depth = DepthSensor(p)
        self.volume = VolumeSensor(p)
        self.drive = Drive(p)
        self.still = Still(p)
        self.motion = Motion(p)
        self.sameness = Sameness(p)
        self.deepness = Deepness(p)
        self.progress = Progress(p)
        self.board = Board(p)
        self.proof = Proof(p)
        self.action = SafeAction(p)
        self.reasons: set[str] = set()
        self.reason = ""

    def step(self, seen: Watched, wanted: float) -> float:
        """Return the command, `wanted` where there is no reason for another."""
        p, depth_before, volume_before = self.p, self.depth.last, self.volume.last
        follows = self.volume.measured

        def rate_of(command: float) -> float:
            return self.drive.rate(command, depth_before, volume_before)

        self.clock.count(seen.lost)
        good = self.depth.sample(seen)
        self.volume.sample(seen.volume)
        volume, measured = self.volume.last, self.volume.measured
        if follows and measured and seen.lost == 0:
            rate = (volume - volume_before) / p.S_p
            self.drive.compare(rate_of(self.command), rate, volume)
        depth = seen.depth if good else depth_before
        neutral = p.neutral.neutral + p.neutral.psi * depth
        rests = self._rests(depth, volume - neutral)
        if good:
            self._sample(seen, neutral, rests)
        self.board.sample(seen)
        if p.proof.same_tried != OFF and good and measured:
            if self.motion.is_known() and not rests:
                soon = rate_of(wanted) * p.S_p
                missing = self.proof.sample(self._place(seen, neutral, soon))
                if self.proof.pushes:
                    wanted = outward_command(p, depth, volume, missing)
            else:
                self.proof.free(volume, seen.reference)
        self.command = wanted
        self.reasons |= self._reasons()
        if self.reasons or self.reason:
            self._bring_up(good, seen.lost)
        return self.command

    def _room(self, depth: float) -> float:
        return self.p.neutral.neutral_range + self.p.neutral.psi_range * abs(depth)

    def _rests(self, depth: float, n: float) -> bool:
        rest, room = self.p.rest, self._room(depth)
        floats = depth <= rest.surface and n >= -room
        lies = rest.aground != math.inf and depth >= rest.aground and n <= room
        return floats or lies

    def _sample(self, seen: Watched, neutral: float, rests: bool) -> None:
        """Show a good depth to the detectors that go by it."""
        p, depth, volume = self.p, seen.depth, self.volume.last
        n, before = volume - neutral, self.depth.last
        self.still.sample(depth)
        moves = abs(depth - self.motion.z1) > p.rest.still_distance
        emerges = moves and depth <= p.rest.surface
        anew = rests or emerges or self.depth.gap()
        stands = self.still.stands()
        self.motion.sample(depth, n, room=self._room(depth), stands=stands, anew=anew)
        old = seen.depth_age >= p.S_p
        self.sameness.sample(depth, before, self.motion.n1, old=old, resting=rests)
        self.deepness.sample(depth, n, volume, self.motion)
        if p.progress.light != OFF:
            self.progress.sample(seen, self.motion)
        self.depth.last, self.depth.age = depth, 0

    def _place(self, seen: Watched, neutral: float, soon: float) -> Place:
        p, motion = self.p, self.motion
        return Place(
            depth=seen.depth,
            asked=seen.reference,
            volume=self.volume.last,
            neutral=neutral + max(motion.own, motion.recent - p.push.grown),
            behind=seen.depth - motion.z1,
            frozen=self.sameness.same >= p.proof.same_tried,
            soon=soon,
        )

    def _reasons(self) -> set[str]:
        latched = {
            "restarted": self.restarted,
            "depth limit": self.deepness.deep.reached,
            self.depth.cause: self.depth.without.reached,
            "depth frozen": self.sameness.frozen,
            self.volume.cause: self.volume.without.reached,
            "not following": self.drive.following.reached,
            "not moving as modelled": self.motion.wrong.reached,
        }
        found = {name for name, holds in latched.items() if holds}
        return found | self.progress.reasons() | self.board.reasons() | self.clock.reasons()

    def _bring_up(self, good: bool, lost: int) -> None:
        p, depth, volume = self.p, self.depth.last, self.volume.last
        if not self.reason:
            self.reason = next(name for name in REASONS if name in self.reasons)
            self.action.begin(depth, self.restarted)
        up = depth <= p.rest.surface
        behind = depth - self.motion.z1
        moves = good and not up
        coming_in = self.drive.asked - self.drive.lag < -p.push.away_fast / (2.0 * p.S_p)
        beyond = -self.motion.force(depth)  # volume beyond the neutral one, as the motion shows it
        self.command = self.action.command(
            Sight(
                depth=depth,
                volume=volume,
                good=good,
                measured=self.volume.measured,
                lost=lost,
                up=up,
                high=volume >= p.volume.volume_high,
                rises=moves and behind < -p.rest.still_distance,
                sinks=moves and behind > p.rest.still_distance,
                light=good and not coming_in and (up or beyond > p.proof.sinks),
            )
        )

    def memory(self) -> dict[str, Any]:
        """Return what it remembers, by the names of the leaves of `SupervisorState`."""
        found: dict[str, Any] = {
            "restarted": self.restarted,
            "command": self.command,
            "elapsed": self.clock.elapsed,
            "since": OFF if self.depth.age is None else self.depth.age,
            "depth": self.depth.last,
            "depth_cause": self.depth.cause,
            "volume": self.volume.last,
            "measured": self.volume.measured,
            "volume_cause": self.volume.cause,
            "rose": self.sameness.way < 0,
            "sank": self.sameness.way > 0,
            "unproven": OFF if self.proof.pushes else self.proof.ticks,
            "still": self.still.ticks,
            "missed": min(self.board.missed, self.p.board.missed),
            "pushed": self.action.out,
            "seen": self.action.seen,
            "astray": self.action.idle,
            "turns": self.action.direction.value,
            "reason": self.reason,
            "reasons": frozenset(self.reasons),
            "lost": self.clock.lost.quarters,
            "blind": self.depth.without.quarters,
        }
        found |= {name: counter.count for name, counter in self._debounced().items()}
        found |= {name: getattr(part, name) for name, part in self._alike()}
        return found | {name: min(found[name], OFF) for name in ENDLESS}

    def _debounced(self) -> dict[str, Debounce]:
        return {
            "deep": self.deepness.deep,
            "volume_blind": self.volume.without,
            "following": self.drive.following,
            "stops": self.drive.stops,
            "wrong": self.motion.wrong,
            "light": self.progress.light,
            "battery": self.board.battery,
            "leak": self.board.leak,
        }

    def _alike(self) -> list[tuple[str, Any]]:
        """Return what both remember alike, under the same name, and where."""
        parts = {
            "lag asked top": self.drive,
            "same noisy same_volume moved frozen": self.sameness,
            "shown shown_for allowed": self.proof,
            "z1 z2 n1 n2 blunt settled own recent own_depth weight known": self.motion,
            "anchor": self.still,
            "target farthest waited drifted": self.progress,
            "phase window from_depth release": self.action,
        }
        return [(name, part) for names, part in parts.items() for name in names.split()]

    def take_over(self, state: SupervisorState) -> None:
        """Remember what a state of the other one holds; what is no direction of a push is none."""
        s = leaves(state)
        for name, counter in self._debounced().items():
            counter.bad = s[name]
        for name, part in self._alike():
            setattr(part, name, s[name])
        self.restarted, self.command = s["restarted"], s["command"]
        self.clock.elapsed = 4096 * s["block"] + s["tick"]
        self.clock.lost.ticks = s["lost"] / 4.0
        self.depth.last = s["depth"]
        self.depth.age = None if s["since"] == OFF else s["since"]
        self.depth.without.ticks = s["blind"] / 4.0
        self.volume.last, self.volume.measured = s["volume"], s["measured"]
        self.sameness.way = s["sank"] - s["rose"]
        self.proof.ticks, self.proof.pushes = s["unproven"], s["unproven"] == OFF
        self.still.ticks, self.board.missed = s["still"], s["missed"]
        self.action.out, self.action.idle = s["pushed"], s["astray"]
        self.action.seen = s["seen"]
        self.action.direction = direction_of(s["turns"])
        self.reason, self.reasons = reason_of(s["reason"]), set()
        self.depth.cause = cause_of("depth", s["blind"] - self.p.depth.blind_quarters)
        self.volume.cause = cause_of("volume", s["volume_blind"] - self.p.volume.blind)


def comparable(state: SupervisorState, p: SupervisorParameters) -> dict[str, Any]:
    """Return a state of the other one as `memory` has it."""
    s = leaves(state)
    s["elapsed"] = 4096 * s.pop("block") + s.pop("tick")
    s["depth_cause"] = cause_of("depth", s["blind"] - p.depth.blind_quarters)
    s["volume_cause"] = cause_of("volume", s["volume_blind"] - p.volume.blind)
    limits = {
        "deep": p.deep.deep,
        "blind": p.depth.blind_quarters,
        "volume_blind": p.volume.blind,
        "following": p.rate.following,
        "stops": p.rate.stops,
        "wrong": p.motion.wrong,
        "light": p.progress.light,
        "battery": p.board.battery,
        "leak": p.board.leak,
        "missed": p.board.missed,
        "lost": p.time.lost_quarters,
    }
    for name, limit in limits.items():
        s[name] = min(s[name], limit)
    s["turns"] = direction_of(s["turns"]).value
    s["reason"] = reason_of(s["reason"])
    s["reasons"] = frozenset(name for n, name in enumerate(REASONS) if s["reasons"] >> n & 1)
    return s


def direction_of(turns: int) -> Direction:
    """Return the direction of a push by its number; a number that is none counts as outward."""
    return next((each for each in Direction if each.value == turns), Direction.OUTWARD)


def reason_of(number: int) -> str:
    """Return the name of a reason by its number, empty for 0."""
    return REASONS[number - 1] if number else ""


def cause_of(sensor: str, beyond: int) -> str:
    """Return why a sensor was given up, from what its count holds beyond its limit."""
    if beyond < 0:
        return ""
    if beyond == 0:
        return f"{sensor} missing"
    return f"{sensor} late" if beyond > 1 and sensor == "depth" else f"{sensor} impossible"
