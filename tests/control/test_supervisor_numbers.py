"""Every number of the supervisor, by hand: as docs/explanation/supervisor.md says, of the paper."""

import math

import pytest

from swimbladder.control.law import NEVER, leaves
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.vehicle import Sensors, Supervisor
from tests.vehicles import paper

TICK = 0.3  # s
K1A = 0.444e-3 * 75e-4  # m3/s/V
SUPPLY, LOAD, T1 = 12.0, 0.07707, 0.09  # V, V/m, s
HALF, PSI = 350e-6, 4.04e-6  # m3, m3/m
K2, T2 = 7935.54, 36.3
FORCE = K2 / T2  # a_b
NOISE, QUANTUM, VOLUME_NOISE = 2e-3, 5e-3, 0.2e-6  # m, m, m3
MOVING = 6.0 * NOISE + 2.0 * QUANTUM
FULL = K1A * SUPPLY
RANGE = HALF / 4.0  # of the neutral volume
CHANGE = RANGE / 5.0
DEEPEST = HALF / PSI  # full buoyancy lifts from there
LIMIT = (HALF - RANGE) / (1.3 * PSI)
LOW = 0.8 * SUPPLY
TURN = K1A * (LOW - LOAD * LIMIT)
STROKE = 2.0 * HALF / TURN  # s
GROWN = 6.0 * VOLUME_NOISE
FOLLOW, TAU = 2.0, 7.0  # s
STOP = 3.0 * GROWN / TICK  # more than 0.15 of the full rate
MOVED = 0.025 * HALF
REACH, SINKS = 2.0 * MOVED, 0.6 * MOVED
BATTERY_S, NO_COMMAND_S, PATIENCE = 10.0, 10.0, 5.0
# s: what a volume that is off by CHANGE takes to move the vehicle out of where it stands
STILL = math.sqrt(6.0 * (MOVING + 0.02) / (FORCE * CHANGE))
FASTEST = (K2 * (HALF + RANGE) + 1.0) * TICK


def ticks(seconds):
    return math.ceil(seconds / TICK - 1e-9)


def per_jump():
    """The way at whose end a block at six tenths of what its fastest speed takes is met."""
    # (32 d / (a_b r))^(1/3) for a way d, fastest at 2 d over that
    steepest = 0.585 * math.sqrt(PSI / FORCE)

    def volume(way):
        return steepest * 2.0 * way / (32.0 * way / (FORCE * FULL)) ** (1.0 / 3.0)

    low, high = 1e-3, 20.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if volume(middle) < REACH else (low, middle)
    return 1.0 / low


EXPECTED = {
    "S_p": TICK,
    "per_tick": 1.0 / TICK,
    "surface_command": SUPPLY,
    "hold_command": LOAD * DEEPEST,
    "quarter": SUPPLY / 4.0,
    "away_command": -SUPPLY,
    "away_hold": 0.0,
    "push": ticks(2.0 * STROKE),
    "again": ticks(STROKE / 2.0),
    "rest": ticks(20.0),
    "stall": ticks(300.0),
    "grown": GROWN,
    "away": 5.0 * GROWN + T1 * FULL,
    "away_fast": 0.5 * FULL * TICK,
    "astray": ticks(FOLLOW),
    "release": ticks(2.0 * STROKE + 60.0),
    "rise": 1.0,
    "depth_most": 1.5 * DEEPEST + 10.0,
    "fastest": FASTEST,
    "jump": MOVING + 0.05,
    "step": FASTEST + MOVING + 0.05,
    "late_age": 1.0,
    "blind_quarters": 4 * ticks(PATIENCE),
    "gap": ticks(PATIENCE),
    "blind": ticks(PATIENCE),
    "volume_least": -1.1 * HALF,
    "volume_most": 1.1 * HALF,
    "volume_low": -0.9 * HALF,
    "volume_high": 0.9 * HALF,
    "positioner": 0.0,
    "rate": K1A,
    "load_drive": LOAD,
    "load_back": LOAD,
    "friction": 0.0,
    "leakage": 0.0,
    "rate_smoothing": TICK / (FOLLOW + TICK),
    "rate_share": 0.6,
    "rate_least": 0.05 * FULL,
    "stop_rate": STOP,
    "stop_least": GROWN / TICK,
    "stops": 6,
    "following": ticks(PATIENCE),
    "same_begun": ticks(2.0 * TAU),
    "same_moved": ticks(3.0 * TAU),
    "moved": MOVED,
    "same_noisy": 44,
    "noisy": 0.42,
    "noisy_weight": 1.0 / 200.0,
    "same_tried": ticks(30.0),
    "unproven": ticks(30.0),
    "holding": ticks(96.0),
    "early": ticks(90.0),
    "sinks": SINKS,
    "reach": REACH,
    "per_speed": math.sqrt(PSI / FORCE),
    "lead": FORCE * TAU,
    "per_jump": per_jump(),
    "ready": 1.5,
    "least_way": 1.1 * STOP * TICK,
    "ahead": 2.0 * MOVED,
    "psi": PSI,
    "psi_range": 0.3 * PSI,
    "neutral": 0.0,
    "neutral_range": RANGE,
    "neutral_change": CHANGE,
    "known": ticks(10.0),
    "forgetting": TICK / (1800.0 + TICK),
    "calm": CHANGE / 4.0,
    "model_error": 0.3,
    "inertia": 1.0 / (FORCE * TAU**2),
    "drag_linear": 1.0 / K2,
    "epsilon": math.inf,
    "drag_blunt": 0.0,
    "drag_0": 0.0,
    "drag_square": 0.0,
    "per_tau": 1.0 / TAU,
    "smoothing": TICK / (TAU + TICK),
    "settle": ticks(4.0 * TAU),
    "wrong": ticks(PATIENCE) + ticks(STILL),
    "surface": 0.5,
    "aground": math.inf,
    "still_distance": MOVING + 0.02,
    "still": ticks(STILL),
    "arrived": math.inf,
    "nearer": 0.1,
    "waits": NEVER,
    "light_volume": 0.0,
    "light_slope": PSI,
    "light_range": math.inf,
    "light_smoothing": 0.0,
    "light": NEVER,
    "depth_limit": LIMIT,
    "deepest": DEEPEST,
    "heavier": CHANGE,
    "turn_rate": TURN,
    "per_turn_rate": 1.0 / TURN,
    "force": FORCE,
    "largest": HALF,
    "lag": 0.3 * TAU + 1.0,
    "deep": ticks(1.0),
    "battery_low": LOW,
    "battery": ticks(BATTERY_S),
    "leak": ticks(1.0),
    "missed": ticks(NO_COMMAND_S),
    "lost_quarters": 4 * ticks(PATIENCE),
    "time_blocks": ticks(7200.0) // 4096,
    "time_ticks": ticks(7200.0) % 4096,
}
"""Of `paper()` with noisy sensors and a time limit of 2 h; others have tests of their own."""
ELSEWHERE = {"depth_least", "same"}


@pytest.fixture(scope="module")
def found():
    noisy = Sensors(
        depth_noise=NOISE, depth_quantum=QUANTUM, volume_noise=VOLUME_NOISE, volume_quantum=0.0
    )
    vehicle = paper(sensors=noisy, supervisor=Supervisor(time_limit=7200.0))
    return leaves(supervisor_parameters(vehicle, TICK))


def test_every_number_is_looked_at(found):
    assert set(found) - set(EXPECTED) == ELSEWHERE
    assert set(EXPECTED) <= set(found)


@pytest.mark.parametrize("name", EXPECTED)
def test_a_number_is_as_the_page_says(name, found):
    assert found[name] == pytest.approx(EXPECTED[name], rel=1e-9, abs=0.0)
