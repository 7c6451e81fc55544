"""The layout of a block of vehicles: one array, row by row, lane by lane."""

from enum import IntEnum

from swimbladder.physics.dynamics import Plant


class Row(IntEnum):
    """Rows of a block's array, each of one number per lane."""

    Q = 0  # state: q, V, z, w
    V = 1
    Z = 2
    W = 3
    COMMAND = 4  # as the law gave it
    APPLIED = 5  # as the actuator got it
    WAIT = 6  # ticks until the law wants to be called
    MODE = 7
    SLOW = 8  # 1: this lane's mode has to be taken by engine.advance
    STOPPED = 9  # why the lane stopped, 0: it did not
    STOP_TICK = 10
    LOW_Q = 11  # bounds within which the mode lasts
    HIGH_Q = 12
    LOW_V = 13
    HIGH_V = 14
    LOW_Z = 15
    HIGH_Z = 16
    DEPTH_NOISE = 17
    DEPTH_QUANTUM = 18
    VOLUME_NOISE = 19
    VOLUME_QUANTUM = 20
    FROM = 21  # depth at which the present set-point was given
    LOW_U = 22  # what the actuator takes
    HIGH_U = 23
    SEEN_DEPTH = 24  # the measurement
    SEEN_VOLUME = 25
    # summaries
    Z_LOWEST = 26
    Z_HIGHEST = 27
    V_LOWEST = 28
    V_HIGHEST = 29
    TRAVEL = 30
    FURTHEST = 31  # largest share of the present step that was travelled
    RISE90 = 32  # s after the set-point, inf: not yet
    OUTSIDE2 = 33  # s after the set-point at which the depth was last outside 2 %, -1: never
    SQUARES = 34  # sum of the squared depth error
    EVENTS = 35  # ticks in which something happened
    TROUBLE = 36  # 1: this tick has to be taken by engine.advance
    REFERENCE = 37  # m, the present set-point
    PER_SPAN = 38  # 1/m, one over the present step, nan: no step
    # what makes the vehicle heavier, see `hooks.lose`
    LOST = 39  # m3 that V, its end stops and bounds are counted less by
    WATER = 40  # m3 that leaked in
    LEAK = 41  # m3/s
    DRIFT = 42  # m3/s, of the neutral volume
    SWELL = 43  # m3, amplitude at the surface
    SWELL_OMEGA = 44  # rad/s
    SWELL_PHASE = 45  # rad
    SWELL_DECAY = 46  # 1/m
    WIDE = 47  # 1: seconds below 0 are of the bypass, not of the valve, see `pumped`
    COMPUTED = 48  # m3, volume as a law of seconds computes it
    STEP = 49  # first coefficient of the tick's exponential: 24 + 12 + 6 + 2
    PLANT = 93
    LAW = 120  # parameters, then state


N_STEP = 44
RECORDED = ("depth", "speed", "volume", "motor_rate", "command", "applied", "volume_reference")
N_PLANT = len(Plant._fields)
assert Row.LAW == Row.PLANT + N_PLANT
assert Row.PLANT == Row.STEP + N_STEP


def rows(n_parameters: int, n_state: int) -> int:
    """Return the number of rows of a block's array for a law of so many numbers."""
    return int(Row.LAW) + n_parameters + n_state
