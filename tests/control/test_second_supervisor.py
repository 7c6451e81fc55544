"""The supervisor against a second one, written from its documentation, tick by tick.

Both get the same inputs; all that they remember is compared after each tick. Three kinds of input:
steps of vehicles whose numbers are small multiples of powers of two, of which sums are exact in any
order, so that a value is often right at its limit; steps of real vehicles near their limits; and
flights of a simple plant with faults.
"""

import math
import random
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from swimbladder.control import supervisor
from swimbladder.control.law import NEVER, leaves
from swimbladder.control.registry import LAWS
from swimbladder.control.supervisor import SupervisorParameters
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.io.config import load_vehicle
from swimbladder.vehicle import Sensors, Supervisor
from tests.codegen.laws import changed
from tests.control.examples import SLEEPER
from tests.control.second_supervisor import (
    REASONS,
    Motion,
    SecondSupervisor,
    comparable,
    stopping_distance,
)
from tests.vehicles import LITERAL, body, paper

NOISY = Sensors(depth_noise="2 mm", depth_quantum="5 mm", volume_noise="0.2 cm3")
LIMITED = Supervisor(time_limit="100 s", bottom_depth="12 m")


class Pair:
    """The supervisor and the second one, with the same inputs."""

    def __init__(self, p: SupervisorParameters, restarted: bool = False) -> None:
        self.p = p
        nothing = supervisor.Watched(math.nan, 0.0, 0.0, 0.0, False, 0, 0)
        self.state = supervisor.initial(p, nothing, float(restarted))
        self.second = SecondSupervisor(p, restarted)
        self.compare()

    def put(self, **values: Any) -> None:
        """Let both remember something else."""
        self.state = changed(self.state, **values)
        self.second.take_over(self.state)

    def step(self, wanted: float, **seen: Any) -> float:
        """Return the command of both; numbers that are not given are as `Watched` leaves them."""
        now = supervisor.Watched(**(QUIET | seen))
        full = now._replace(**({"reference": math.nan, "computed": 0.0} | seen))
        command, self.state, after = supervisor.step(self.p, self.state, now, wanted)
        other = self.second.step(full, wanted)
        assert after == self.p.S_p
        assert equal(command, other), (command, other, seen)
        self.compare()
        return command

    def compare(self) -> None:
        ours, other = comparable(self.state, self.p), self.second.memory()
        named = supervisor.reasons_in(self.state.recovery.reasons)
        assert ours["reasons"] == {
            each.words.removesuffix(" or too fast to turn") for each in named
        }
        if ours == other:
            return
        differs = {n: (v, other[n]) for n, v in ours.items() if not equal(v, other[n])}
        assert not differs
        assert ours.keys() == other.keys()


QUIET: dict[str, Any] = {
    "depth": 2.0,
    "depth_age": 0.1,
    "volume": 1e-5,
    "battery": 12.0,
    "leak": False,
    "lost": 0,
    "missed": 0,
}


def equal(a: Any, b: Any) -> bool:
    """Return whether values are the same but for rounding."""
    if a == b or not isinstance(a, float):
        return bool(a == b)
    if math.isnan(a) or math.isnan(b):
        return math.isnan(a) and math.isnan(b)
    return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12)


def vehicles() -> dict[str, SupervisorParameters]:
    """Motor, piston, pump; drag that jumps; leakage and friction; laws that rest; stiff hulls."""
    feup = load_vehicle("feup-em").model_copy(update={"sensors": NOISY})
    bounded = feup.model_copy(update={"supervisor": LIMITED})
    rests = [(LAWS["deadband"], SLEEPER)]
    stepper = load_vehicle("ntnu-bv").model_copy(update={"supervisor": LIMITED})
    pump = load_vehicle("example-float")
    friction = supervisor_parameters(feup, 0.3)
    friction = changed(friction, friction=0.4, leakage=2e-8, load_back=0.05)
    return {
        "feup-em": supervisor_parameters(bounded, 0.3),
        "a law that rests": supervisor_parameters(feup, 0.3, laws=rests),
        "ideal sensors": supervisor_parameters(paper(), 0.2),
        "friction and leakage": friction,
        "drag that jumps": supervisor_parameters(paper(**body(LITERAL)), 0.3),
        "ntnu-bv": supervisor_parameters(stepper, 0.5),
        "example-float": supervisor_parameters(pump, 1.0),
        "example-float, limited": supervisor_parameters(
            pump.model_copy(update={"supervisor": LIMITED}), 1.0
        ),
    }


VEHICLES = vehicles()


HALF, QUARTER, EIGHTH = 0.5, 0.25, 0.125
DEPTHS = [x / 4.0 for x in range(-2, 20)] + [6.0, 8.0, 8.25, 10.0, 12.0]
VOLUMES = [x / 4.0 for x in range(-4, 5)] + [-4.0, -3.25, -3.0, -2.0, 2.0, 3.0, 3.25, 4.0]
SMALL = [x / 8.0 for x in range(-5, 6)]
FEW = [0, 0, 1, 1, 2, 3, 4, 5]
SOON = [1, 2, 3, 3]
PLAIN_PARAMETERS: dict[str, list[Any]] = {
    "S_p": [HALF],
    "per_tick": [2.0],
    "surface_command": [2.0],
    "hold_command": [0.0, HALF],
    "quarter": [HALF],
    "away_command": [-2.0],
    "away_hold": [0.0, -HALF],
    "push": [3, 4, 5],
    "again": [1, 2, 3],
    "rest": [1, 2],
    "stall": [2, 4],
    "grown": [QUARTER, HALF],
    "away": [HALF, 1.0],
    "away_fast": [QUARTER, HALF],
    "astray": [1, 2, 3],
    "release": [2, 3],
    "rise": [HALF],
    "depth_least": [-HALF],
    "depth_most": [12.0, 1e5],
    "fastest": [QUARTER, HALF],
    "jump": [HALF],
    "late_age": [1.0],
    "blind_quarters": [4, 8],
    "gap": [1, 2],
    "blind": SOON,
    "volume_least": [-4.0, -1e5],
    "volume_most": [4.0],
    "volume_low": [-3.0, -1.0],
    "volume_high": [1.0, 3.0],
    "positioner": [0.0, 1.0],
    "rate": [HALF, 1.0],
    "load_drive": [EIGHTH, QUARTER],
    "load_back": [EIGHTH, QUARTER],
    "friction": [0.0, QUARTER],
    "leakage": [0.0, EIGHTH],
    "rate_smoothing": [HALF, QUARTER],
    "rate_share": [HALF],
    "rate_least": [QUARTER, HALF],
    "stop_rate": [QUARTER, HALF, math.inf],
    "stop_least": [HALF, 1.0],
    "stops": SOON,
    "following": SOON,
    "same": [2, 3, NEVER],
    "same_begun": [1, 2],
    "same_moved": [2, 3],
    "moved": [EIGHTH, QUARTER],
    "same_noisy": [2, 3],
    "noisy": [QUARTER, HALF],
    "noisy_weight": [QUARTER, HALF],
    "same_tried": [1, 2, 3, NEVER],
    "unproven": [2, 3],
    "holding": [2, 4],
    "early": [1, 3, NEVER, NEVER],
    "sinks": [EIGHTH, QUARTER],
    "reach": [HALF],
    "per_speed": [QUARTER, 1.0],
    "lead": [1.0, HALF],
    "per_jump": [QUARTER, HALF],
    "ready": [HALF, 1.0],
    "least_way": [QUARTER],
    "ahead": [QUARTER, HALF],
    "psi": [EIGHTH, QUARTER, 0.0, -EIGHTH],
    "psi_range": [EIGHTH, 0.0],
    "neutral": [0.0, HALF],
    "neutral_range": [HALF, 1.0],
    "neutral_change": [EIGHTH, QUARTER],
    "known": [0, 1, 3],
    "forgetting": [EIGHTH, QUARTER],
    "calm": [EIGHTH, QUARTER],
    "model_error": [QUARTER, HALF],
    "inertia": [QUARTER, HALF],
    "drag_linear": [HALF, 1.0],
    "epsilon": [math.inf, QUARTER, HALF],
    "drag_blunt": [0.0, QUARTER],
    "drag_0": [0.0, EIGHTH],
    "drag_square": [QUARTER, HALF],
    "per_tau": [HALF, 1.0],
    "smoothing": [HALF, QUARTER],
    "settle": [0, 1, 2],
    "wrong": [2, 4, 5],
    "surface": [HALF, 1.0],
    "aground": [math.inf, 4.0],
    "still_distance": [QUARTER, HALF],
    "still": [1, 2],
    "arrived": [HALF, math.inf],
    "nearer": [QUARTER],
    "waits": [1, 3, NEVER],
    "light_volume": [0.0, QUARTER],
    "light_slope": [EIGHTH, QUARTER],
    "light_range": [QUARTER, HALF],
    "light_smoothing": [HALF, QUARTER],
    "light": [1, 3, NEVER],
    "depth_limit": [3.0, 6.0],
    "deepest": [6.0, 8.0, 12.0],
    "heavier": [EIGHTH, QUARTER],
    "turn_rate": [HALF, QUARTER],
    "force": [HALF, 1.0],
    "largest": [3.0, 1.0],
    "lag": [HALF],
    "deep": SOON,
    "battery_low": [2.0, 0.0],
    "battery": SOON,
    "leak": SOON,
    "missed": SOON,
    "lost_quarters": [4, 8],
    "time_blocks": [NEVER, NEVER, 0, 1],
    "time_ticks": [0, 3],
}
"""Numbers of a vehicle of which all sums are exact; some follow from others, see `plain`."""


def plain(rng: random.Random) -> SupervisorParameters:
    """Return parameters of small multiples of powers of two."""
    drawn = {name: rng.choice(values) for name, values in PLAIN_PARAMETERS.items()}
    drawn["step"] = drawn["fastest"] + drawn["jump"]
    drawn["per_turn_rate"] = 1.0 / drawn["turn_rate"]
    made: SupervisorParameters = changed(VEHICLES["feup-em"], **drawn)
    return made


BOTH = [False, True]
PLAIN_STATE: dict[str, list[Any]] = {
    "restarted": [False] * 9 + [True],
    "command": [-2.0, -1.0, -HALF, 0.0, HALF, 1.0, 2.0],
    "tick": [0, 1, 2, 3, 4, 4094, 4095, 4096],
    "block": [0, 1, 2],
    "lost": [0, 1, 3, 4, 7, 8],
    "since": [0, 0, 0, 1, 2, 3, 255, 33000, NEVER - 1, NEVER],
    "depth": DEPTHS,
    "blind": [0, 0, 1, 3, 4, 5, 6, 8, 10],
    "volume": VOLUMES,
    "measured": [True, True, True, False],
    "volume_blind": [0, 0, 1, 2, 3, 4],
    "lag": SMALL,
    "asked": SMALL,
    "following": [0, 0, 1, 2, 3],
    "top": VOLUMES,
    "stops": [0, 1, 2, 3, 4],
    "same": [*FEW, NEVER],
    "rose": BOTH,
    "sank": [False],
    "noisy": [0.0, EIGHTH, QUARTER, HALF],
    "same_volume": VOLUMES,
    "moved": [0.0, *SMALL],
    "frozen": [False] * 5 + [True],
    "unproven": [*FEW, NEVER - 1, NEVER],
    "shown": VOLUMES,
    "shown_for": [*DEPTHS, 1e6],
    "allowed": [*DEPTHS, 1e6, 1e6],
    "z1": DEPTHS,
    "z2": DEPTHS,
    "n1": VOLUMES,
    "n2": VOLUMES,
    "blunt": [0.0, 0.0, *SMALL],
    "settled": FEW,
    "wrong": FEW,
    "own": SMALL,
    "recent": SMALL,
    "own_depth": DEPTHS,
    "weight": [HALF, QUARTER, EIGHTH],
    "known": FEW,
    "anchor": DEPTHS,
    "still": FEW,
    "target": DEPTHS,
    "farthest": DEPTHS,
    "waited": FEW,
    "light": FEW,
    "drifted": SMALL,
    "battery": FEW,
    "leak": FEW,
    "missed": FEW,
    "phase": [0, 1, 2, 3, 4, 5, 6, 7],
    "pushed": VOLUMES,
    "astray": [0, 1, 2, 3, 5, 255, 33000, NEVER],
    "turns": [0, 0, 0, 1, 2, 3, 3, 7, 7, 4],
    "reason": [0, 0, 2, 11],
    "window": [0, 1, 2, 3],
    "from_depth": DEPTHS,
    "release": BOTH,
}


def plain_state(rng: random.Random, p: SupervisorParameters) -> dict[str, Any]:
    """Return a state of such numbers, of one depth and one volume mostly, with few reasons."""
    found = {name: rng.choice(values) for name, values in PLAIN_STATE.items()}
    depth, volume = found["depth"], rng.choice(VOLUMES[:9])
    for name in ("z1", "z2", "own_depth", "anchor", "from_depth", "shown_for", "allowed"):
        if rng.random() < 0.7:
            found[name] = depth + rng.choice([-1.0, -HALF, -QUARTER, 0.0, 0.0, QUARTER, HALF, 1.0])
    for name in ("volume", "n1", "n2", "pushed", "top", "same_volume", "shown"):
        if rng.random() < 0.7:
            found[name] = volume + rng.choice([-HALF, -QUARTER, 0.0, 0.0, QUARTER, HALF])
    if rng.random() < 0.5:  # an even depth before, from which it is on its way up or down
        rest = 1.0 - p.motion.smoothing  # the force on it for a metre of that, after a tick
        force = rest * rest * p.motion.inertia
        force += rest * p.motion.smoothing * p.motion.per_tau * p.motion.drag_linear
        light = p.proof.sinks / force  # it rises as one that is light by just what counts
        slow = p.rest.still_distance / rest
        # a limit is met by both of numbers without rounding only
        exact = [
            jump for jump in (slow, -slow, light, light, light) if (jump * 1024.0).is_integer()
        ]
        by = rng.choice([-2.0, -1.0, 0.0, 1.0, 2.0, *exact])
        found["z1"] = found["z2"] = depth + by
    found["sank"] = not found["rose"] and rng.random() < 0.7
    return found


COUNTS = "lost blind volume_blind following stops wrong light battery leak missed deep waited"
QUIET_STATE: dict[str, Any] = {
    **{name: 0 for name in f"{COUNTS} block tick reason reasons".split()},
    "restarted": False,
    "frozen": False,
}
QUIET_BOARD: dict[str, Any] = {"battery": 3.0, "leak": False, "lost": 0, "missed": 0}
"""Of what is no reason: half of the steps, so that the law's command and test pushes are seen."""


def plain_seen(rng: random.Random, pair: Pair) -> dict[str, Any]:
    """Return what is seen: often just what a limit makes of what was seen before."""
    p, s = pair.p, pair.state
    since = s.depth.since + 1 if s.depth.since < NEVER else 0
    away = [QUARTER, HALF, p.depth.step, since * p.depth.fastest + p.depth.jump, 2.0**-20, 0.0, 0.0]
    fast = (1 + s.push.astray) * p.push.away_fast
    fall = [p.push.grown, p.push.away, p.push.away + EIGHTH, fast, fast + EIGHTH]
    depth = s.depth.depth + rng.choice([-1, 1]) * rng.choice(away)
    volume = rng.choice(
        [
            s.volume.volume + rng.choice(SMALL),
            s.push.pushed + p.push.grown,
            s.push.pushed - rng.choice(fall),
            s.rate.top + rng.choice([-1, 1]) * p.push.grown,
            p.neutral.neutral + p.neutral.psi * depth + rng.choice(SMALL),
        ]
    )
    if rng.random() < 0.15:
        depth = rng.choice([math.nan, math.inf, -HALF, 12.0, 12.25, 0.5, 4.0, 9e4, 6.0, 1.0])
    if rng.random() < 0.15:
        volume = rng.choice([math.nan, math.inf, -4.0, 4.0, 4.25, -4.25, -3.0, 3.0, 1.0, -1.0])
    asked = [depth + rng.choice(SMALL), s.proof.allowed, s.proof.shown_for, depth + p.proof.ready]
    asked += [math.nan, depth + 0.1 * p.proof.ready, depth + 1.0, depth + 2.0, s.progress.target]
    if rng.random() < 0.1:
        asked = [-HALF, -0.75, 12.0, 12.25, math.inf, 3e5]
    need = p.progress.light_volume + p.progress.light_slope * depth
    light = need + max(s.progress.drifted, 0.0) + p.progress.light_range
    found = {
        "depth": depth,
        "depth_age": rng.choice([0.0, 0.0, 0.0, 0.375, HALF, 1.0, 1.125]),
        "volume": volume,
        "battery": rng.choice([2.0, 3.0, 1.875, math.nan]),
        "leak": rng.random() < 0.2,
        "lost": rng.choice([0, 0, 0, 0, 0, 1, 2]) if rng.random() < 0.99 else 5000,
        "missed": rng.choice([0, 0, 0, 1, 2, 3, 4]),
        "reference": rng.choice(asked),
        "computed": rng.choice([math.nan, *SMALL, light, light + EIGHTH, light + 1.0]),
    }
    if rng.random() < 0.1:
        del found["reference"], found["computed"]
    return found


@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(n, marks=pytest.mark.prove) for n in range(4, 10))]
)
def test_steps_of_a_vehicle_of_exact_numbers_are_alike(seed: int) -> None:
    """From any state, three ticks, often right at a limit."""
    rng = random.Random(seed)
    for _ in range(150):
        p = plain(rng)
        pair = Pair(p)
        for _ in range(8):
            quiet = rng.random() < 0.5
            pair.put(**(plain_state(rng, p) | (QUIET_STATE if quiet else {})))
            for _ in range(3):
                seen = plain_seen(rng, pair) | (QUIET_BOARD if quiet else {})
                pair.step(rng.choice([-2.0, -1.0, -HALF, -QUARTER, 0.0, HALF, 2.0]), **seen)


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_the_way_to_a_stop_is_alike(vehicle: str) -> None:
    """With compression, drag and an end of the stroke; any depth where it is none."""
    p, rng = VEHICLES[vehicle], random.Random(vehicle)
    motion = Motion(p)
    for _ in range(200):
        speed, room = 10.0 ** rng.uniform(-12.0, 1.0), rng.choice([0.0, 1e-5, 2e-4, math.inf])
        lacks = rng.choice([-1.0, 0.0, 1.0]) * 10.0 ** rng.uniform(-7.0, -3.0)
        way = stopping_distance(p, motion, speed, lacks, room)
        ours = supervisor.way_to_stop(p, speed, lacks, room)
        assert ours == (pytest.approx(way, rel=1e-9) if way < math.inf else 1e6)


def test_reasons_are_numbered_by_their_order() -> None:
    words = {each.value: each.words for each in supervisor.Reason}
    words[3] = words[3].removesuffix(" or too fast to turn")
    assert words == dict(enumerate(REASONS, 1))


def test_a_float_that_came_no_nearer_for_a_while_keeps_that_reason() -> None:
    """docs/explanation/supervisor.md: it keeps the reason and a bit for each later one."""
    p = VEHICLES["example-float"]
    seen = supervisor.Watched(**QUIET)._replace(depth=100.0, volume=0.0, reference=200.0)
    state = supervisor.initial(p, seen, 0.0)
    state = changed(state, waited=p.progress.waits - 1, target=200.0, farthest=100.0)
    noted = []
    for depth in (100.0, 100.0, 101.0):
        state = supervisor.step(p, state, seen._replace(depth=depth), 0.0)[1]
        noted.append(supervisor.Reason(11) in supervisor.reasons_in(state.recovery.reasons))
    assert noted == [True, True, True]


def near_state(p: SupervisorParameters, rng: random.Random) -> dict[str, Any]:
    """Return a state of a real vehicle in which much is close to its limit."""
    limits, hair = leaves(p), rng.choice([-1e-6, 1e-6])
    depth, volume = near_place(p, rng)
    found: dict[str, Any] = {}
    for name, names in LIMITS_OF_COUNTS.items():
        limit = limits[rng.choice(names.split())]
        found[name] = max(limit + rng.choice([-3, -2, -1, 0, 1]), 0) if limit < NEVER else 0
        found[name] = found[name] if rng.random() < 0.5 else 0
    still = p.rest.still_distance
    for name in ("depth", "z1", "anchor", "own_depth", "shown_for", "allowed", "from_depth"):
        by = [0.0, still * (1.0 + hair), -still * (1.0 + hair), -0.3, p.proof.ready, 1.0 + hair]
        found[name] = depth + rng.choice([each for each in by if math.isfinite(each)])
    found["z2"] = found["z1"] + rng.choice([0.0, 0.0, -0.2, 0.2])
    n = volume - p.neutral.psi * depth - p.neutral.neutral
    parts = [p.push.grown, p.push.away, p.proof.sinks, p.proof.reach, p.motion.neutral_change]
    parts = [0.0, *(sign * (1.0 + hair) * each for each in parts for sign in (-1, 1))]
    parts = [each for each in parts if math.isfinite(each)]
    for name in ("volume", "pushed", "top", "shown"):
        found[name] = volume + rng.choice(parts)
    for name in ("n1", "n2", "same_volume"):
        found[name] = n + rng.choice(parts)
    for name in ("own", "recent"):
        found[name] = rng.choice(parts)
    found |= {"target": depth + 20.0, "farthest": 20.0 + rng.choice([0.0, p.progress.nearer, -1.0])}
    found |= {"measured": True, "settled": rng.choice([0, p.motion.settle - 1, p.motion.settle])}
    found |= {"reason": rng.choice([0, 0, 8]), "turns": rng.choice([0, 0, 1, 2, 3, 7])}
    return found | {"noisy": p.same.noisy - 1e-3, "block": max(p.time.time_blocks % NEVER - 1, 0)}


LIMITS_OF_COUNTS = {
    "deep": "deep",
    "blind": "blind_quarters",
    "volume_blind": "blind",
    "following": "following",
    "stops": "stops",
    "same": "same same_begun same_moved same_noisy same_tried",
    "unproven": "unproven holding early",
    "known": "known",
    "wrong": "wrong",
    "still": "still",
    "waited": "waits",
    "light": "light",
    "battery": "battery",
    "leak": "leak",
    "missed": "missed",
    "lost": "lost_quarters",
    "tick": "time_ticks",
    "phase": "push rest again",
    "astray": "astray again stall push",
    "window": "release",
    "since": "gap",
}
"""Counts of the state, each with the parameters that it is compared with."""


def near_place(p: SupervisorParameters, rng: random.Random) -> tuple[float, float]:
    """Return a depth and a volume where something begins or ends."""
    depths = [p.rest.surface, p.rest.aground, p.deep.depth_limit, p.depth.depth_least, 3.0, 3.0]
    depth = rng.choice([each for each in depths if math.isfinite(each)])
    depth += rng.choice([0.0, -1e-9, 1e-9, 0.2])
    room = p.neutral.neutral_range + p.neutral.psi_range * abs(depth)
    room = room if math.isfinite(room) else 1.0
    volume = p.neutral.neutral + p.neutral.psi * depth + rng.choice([-1.0, 0.0, 0.0, 1.0]) * room
    volume *= 1.0 + rng.choice([-1e-6, 1e-6])
    ends = p.volume
    return depth, rng.choice([volume, volume, ends.volume_low, ends.volume_high, ends.volume_most])


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_steps_of_real_vehicles_near_their_limits_are_alike(vehicle: str) -> None:
    p, rng = VEHICLES[vehicle], random.Random(vehicle)
    pair = Pair(p)
    pumps = p.rate.rate == 0.0
    for _ in range(300):
        pair.put(**near_state(p, rng))
        for _ in range(3):
            s = pair.state
            depth = s.depth.depth + rng.choice(
                [0.0, 0.005, -0.005, p.depth.step * 0.999999, math.nan]
            )
            volume = s.volume.volume + rng.choice([0.0, 0.0, 1e-7, -1.00001 * p.push.grown])
            volume = (
                volume
                if rng.random() < 0.9
                else rng.choice([math.nan, 1e-2, p.volume.volume_least])
            )
            pair.step(
                rng.choice([0.0, 12.0, -12.0, 1e-4]),
                depth=depth,
                depth_age=rng.choice([0.1, 0.1, p.S_p, p.depth.late_age, p.depth.late_age + 0.01]),
                volume=0.0 if pumps or not volume > -1.0 else volume,
                battery=rng.choice([p.board.battery_low, p.board.battery_low - 0.001, 12.0]),
                leak=rng.random() < 0.3,
                lost=rng.choice([0, 0, 0, 1, 5]),
                missed=rng.choice([0, p.board.missed, p.board.missed - 1]),
                reference=rng.choice([depth + 1.5, depth, 3.0, math.nan, p.depth.depth_most]),
                computed=p.progress.light_volume + rng.choice([0.0, 3e-4]),
            )


class Sea:
    """A vehicle at some depth, its actuator, and a law that holds a set-point."""

    def __init__(self, p: SupervisorParameters, rng: random.Random, depth: float) -> None:
        self.p, self.rng = p, rng
        self.pumps = p.rate.rate == 0.0
        self.slope = p.progress.light_slope if self.pumps else p.neutral.psi
        self.trim = p.progress.light_volume if self.pumps else p.neutral.neutral
        self.z, self.w, self.trapped = depth, 0.0, 0.0
        self.v = self.trim + self.slope * depth
        self.least, self.most = p.volume.volume_low, p.deep.largest
        if self.pumps:
            self.least, self.most = -3e-4, 3e-4

    def seen(self, asked: float) -> dict[str, Any]:
        """Return what sensors with noise and a quantum of 5 mm measure."""
        noise = self.rng.gauss(0.0, 2e-3)
        found: dict[str, Any] = {
            "depth": 5e-3 * round((self.z + noise) / 5e-3),
            "volume": 0.0 if self.pumps else self.v + self.rng.gauss(0.0, 2e-7),
            "reference": asked,
            "lost": 0,
        }
        return found | ({"computed": self.v} if self.pumps else {})

    def law(self, asked: float) -> float:
        """Return the command that takes a volume by depth error and speed."""
        p, error = self.p, self.z - asked
        share = max(-1.0, min(1.0, 0.5 * error + 4.0 * self.w))
        wanted = self.trim + self.slope * self.z + 0.2 * (p.deep.largest - self.trim) * share
        if self.pumps:
            return p.S_p * max(-1.0, min(1.0, 1e5 * (error * 2e-6)))
        if p.rate.positioner:
            return min(max(wanted, self.least), self.most)
        full = p.push.surface_command
        speed = (wanted - self.v) / (p.rate.rate * 4.0 * p.S_p)
        return max(-full, min(full, speed + p.rate.load_drive * self.z))

    def go(self, command: float, gain: float, block: float) -> None:
        """Move on by a tick; gain: of the actuator, negative with swapped wires."""
        p, h = self.p, self.p.S_p
        if self.pumps:
            rate = gain * 2e-6 * command / h
        elif p.rate.positioner:
            rate = gain * max(-p.rate.rate, min(p.rate.rate, (command - self.v) / h))
        else:
            load = p.rate.load_drive * self.z
            rate = p.rate.rate * (gain * command - load)
        self.v = max(min(self.v + h * rate, self.most, max(block, self.v)), 1.05 * self.least)
        parts = 4
        for _ in range(parts):
            neutral = self.trim + self.trapped + self.slope * self.z
            drag = p.motion.drag_linear * self.w if p.motion.drag_linear else 4e-5 * self.w
            pull = p.deep.force * (neutral - self.v - drag)
            self.w = (self.w + h / parts * pull) if self.z > 0.0 or pull > 0.0 else 0.0
            self.z = max(self.z + h / parts * self.w, 0.0)


class Moment(NamedTuple):
    """When a fault acts, and on what."""

    k: int  # ticks since the onset
    seen: dict[str, Any]
    rng: random.Random


Fault = Callable[[Moment], dict[str, Any]]
"""What is seen otherwise."""


def put(**values: Any) -> Fault:
    return lambda _: values


def drift(name: str, rate: float) -> Fault:
    return lambda at: {name: at.seen[name] + rate * at.k}


def offset(name: str, by: float, factor: float = 1.0) -> Fault:
    return lambda at: {name: at.seen[name] * factor + by}


def at_times(chance: float, fault: Fault) -> Fault:
    return lambda at: fault(at) if at.rng.random() < chance else {}


def stuck(*names: str) -> Fault:
    kept: dict[str, Any] = {}

    def hold(at: Moment) -> dict[str, Any]:
        if at.k == 0:
            kept.update({name: at.seen[name] for name in names})
        return kept

    return hold


class Case(NamedTuple):
    """A fault of what is seen, of actuator or vehicle."""

    seen: Fault = put()
    gain: float = 1.0
    block: float = math.inf  # of the volume, beyond that at the onset
    inflow: float = 0.0  # m3/s
    setpoint: float | None = None
    mended: int | None = None  # ticks after the onset


FAULTS = {
    "none": Case(),
    "no depth": Case(put(depth=math.nan)),
    "depth beyond": Case(put(depth=1e6)),
    "depth infinite": Case(put(depth=math.inf)),
    "late": Case(lambda at: {"depth_age": 0.3 * at.k}),
    "old": Case(put(depth_age=0.7)),
    "depth stuck": Case(stuck("depth")),
    "all stuck": Case(stuck("depth", "volume")),
    "depth drifts": Case(drift("depth", 0.02)),
    "depth offset": Case(offset("depth", 0.6)),
    "scale": Case(offset("depth", 0.0, 0.5)),
    "dropouts": Case(at_times(0.3, put(depth=math.nan, volume=math.nan))),
    "no volume": Case(put(volume=math.nan)),
    "volume beyond": Case(put(volume=1e-2)),
    "volume stuck": Case(stuck("volume")),
    "volume drifts": Case(drift("volume", -2e-7)),
    "volume offset": Case(offset("volume", 1.2e-4)),
    "blocked": Case(block=4e-6, setpoint=8.0),
    "stalled": Case(gain=0.0, setpoint=7.0),
    "weak": Case(gain=0.1, inflow=4e-6),
    "reversed": Case(gain=-1.0),
    "reversed, deep": Case(gain=-1.0, setpoint=11.0),
    "reversed, mended": Case(gain=-1.0, mended=100),
    "slow and reversed": Case(gain=-0.15, inflow=1e-6),
    "reversed and blind": Case(at_times(0.5, put(volume=math.nan)), gain=-1.0),
    "reversed, losing ticks": Case(at_times(0.2, put(lost=2)), gain=-1.0, mended=60),
    "leaks unseen": Case(inflow=6e-7),
    "leaks fast": Case(inflow=2e-5),
    "leak": Case(put(leak=True)),
    "leak at times": Case(at_times(0.7, put(leak=True))),
    "battery": Case(at_times(0.8, put(battery=9.0))),
    "ticks lost": Case(at_times(0.35, put(lost=1))),
    "a long gap": Case(at_times(0.02, put(lost=40))),
    "a longer gap": Case(at_times(0.02, put(lost=5000))),
    "no command": Case(lambda at: {"missed": at.k}),
    "absurd set-point": Case(put(reference=3e38)),
    "set-point no number": Case(put(reference=math.nan), setpoint=9.0),
    "absurd at times": Case(at_times(0.5, put(reference=-50.0))),
    "too deep": Case(setpoint=400.0),
}


@pytest.mark.parametrize(
    "vehicle",
    [
        "feup-em",
        "example-float",
        *(pytest.param(n, marks=pytest.mark.prove) for n in ("a law that rests", "ntnu-bv")),
    ],
)
def test_flights_with_faults_go_alike(vehicle: str) -> None:
    for name, case in FAULTS.items():
        fly(VEHICLES[vehicle], case, random.Random(f"{vehicle} {name}"))


@pytest.mark.parametrize("vehicle", ["feup-em", "ntnu-bv", "example-float"])
def test_bits_that_flip_do_the_same_to_both(vehicle: str) -> None:
    for name in ("none", "depth drifts", "reversed", "blocked", "too deep", "leaks unseen"):
        rng = random.Random(f"{vehicle} {name} flips")
        fly(VEHICLES[vehicle], FAULTS[name], rng, flips=0.05)


def fly(p: SupervisorParameters, case: Case, rng: random.Random, *, flips: float = 0.0) -> None:
    """Fly under both, one flight in eight begun anew by a reset; flips: of bits, in a tick."""
    sea, block = Sea(p, rng, rng.choice([0.2, 1.5, 5.0])), math.inf
    onset, asked, command = rng.choice([40, 130]), rng.choice([2.0, 4.0, 6.0]), 0.0
    restarted = rng.random() < 0.125
    pair = Pair(p, restarted)
    if restarted:
        pair.put(turns=rng.choice([0, 1, 2, 3, 7, 5]), pushed=sea.v, volume=sea.v)
    for k in range(onset + 160):
        acts = k >= onset
        asked = asked + 1.5 if k % 97 == 96 else asked
        if acts and case.setpoint is not None:
            asked = case.setpoint
        seen = sea.seen(asked)
        if acts:
            seen |= case.seen(Moment(k - onset, seen, rng))
        if k == onset:
            block = sea.v + case.block
        if rng.random() < flips:
            flip(pair, rng)
        command = pair.step(sea.law(asked), **seen)
        broken = acts and (case.mended is None or k < onset + case.mended)
        sea.trapped += case.inflow * p.S_p if acts else 0.0
        for _ in range(min(seen["lost"], 40) + 1):
            sea.go(command, case.gain if broken else 1.0, block)


def flip(pair: Pair, rng: random.Random) -> None:
    """Flip a bit of what both remember, or make a float no number."""
    before = leaves(pair.state)
    name = rng.choice(list(before))
    value = before[name]
    if isinstance(value, bool):
        value = not value
    elif isinstance(value, int):
        bits = {"reason": 4, "tick": 12, "reasons": 15}
        value ^= 1 << rng.randrange(bits.get(name, 16))
    elif rng.random() < 0.2:
        value = math.nan
    else:
        (whole,) = struct.unpack("<q", struct.pack("<d", value))
        (value,) = struct.unpack("<d", struct.pack("<q", whole ^ (1 << rng.randrange(44, 63))))
    if not is_left_out(name, value, before):
        pair.put(**{name: value})


def is_left_out(name: str, value: float, before: dict[str, Any]) -> bool:
    """Return whether the two cannot be compared with this in their memory."""
    if name in ("noisy", "weight"):  # below 1, where one bit makes a number of every number
        return not math.isfinite(value)
    if name in ("rose", "sank"):  # the second one holds one way only
        return bool(value) and (before["rose"] or before["sank"])
    return 1e3 < abs(value) < math.inf and isinstance(value, float)  # samples are rounded off
