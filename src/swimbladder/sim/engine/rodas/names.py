"""What stands where in the arrays that RODAS moves; one enumeration for each array."""

from __future__ import annotations

from enum import IntEnum


class Table(IntEnum):
    """Columns of the table [n, WIDTH]: value, and its slope in the next; over depth but the last.

    Those from FILLING on are over ln(p/reservoir), p being the pressure in the oil line.
    """

    PRESSURE = 0  # Pa above the atmosphere
    NEUTRAL = 2  # m3, volume at which the vehicle rests
    RATE_OUT = 4  # m3/s
    POWER_OUT = 6  # W
    RATE_IN = 8  # m3/s
    POWER_IN = 10  # W
    BYPASS = 12  # m3/s
    POWER_BYPASS = 14  # W
    LEAKAGE = 16  # m3/s
    HOLDING = 18  # W
    START = 20  # m3 that each start of the pump falls short
    LAYERS = 22  # m3, neutral volume less what pressure does to water and hull
    TEMPERATURE = 24  # degC of the water
    FILLING = 26  # s, from the reservoir's pressure to p by the pump
    FILL_ENERGY = 28  # J that takes, in water of 0 degC
    FILL_WARMTH = 30  # J/K more in warmer water
    EMPTYING = 32  # s, see `line`
    WIDTH = 34


class Given(IntEnum):
    """What does not change in a mission: the vehicle, its processor, the tolerances."""

    STEP = 0  # m, of the table
    MASS = 1  # kg, accelerated
    D_L = 2  # 1/s, laminar drag over mass; as physics.dynamics.Plant, like the next four
    D_B = 3
    D_0 = 4
    D_T = 5
    EPSILON = 6
    A_S = 7  # 1/s2, stiffness of the emerging hull, rho g A_w/m
    Z_SURFACE = 8  # m, where the hull begins to emerge
    Z_AIR = 9  # m, where it would have left the water
    Z_BOTTOM = 10  # m
    V_MIN = 11  # m3
    V_MAX = 12  # m3
    TRIM = 13  # m3, added to the table's neutral volume
    GIVE = 14  # m3/m, added to its slope
    BY_VOLUME = 15  # 1: a move ends at a volume, which is measured; 0: after a time
    QUANTUM = 16  # s, step of the time of a run
    LONGEST = 17  # s, of a run
    DELIVERY = 18  # -, what is pumped over what the table says and the processor assumes
    NOISE = 19  # m, of a measured depth, 1 sigma
    RESOLUTION = 20  # m, its quantum
    DEEPEST = 21  # m, below which everything is pumped out
    NEUTRAL_TOP = 22  # m3, neutral volume at the surface as the processor knows it
    SHALLOW = 23  # m, above which it is about to dive, or has come up
    EMPTY = 24  # J of charge at which nothing more can be drawn; -inf: not known
    RESERVE = 25  # J of charge with which no new cycle begins
    LAST_TIME = 26  # s, after which no new cycle begins
    LAST_CYCLE = 27  # how many cycles at most
    SURFACING = 28  # J at each surfacing
    SELF_DISCHARGE = 29  # 1/s
    RTOL = 30  # -
    ATOL_Z = 31  # m
    ATOL_W = 32  # m/s
    ATOL_V = 33  # m3
    REST_DEEP = 34  # m, an oscillation smaller than this counts as rest
    REST_AFLOAT = 35  # m, the same of the bobbing at the surface
    LONGEST_STEP = 36  # s
    Z_LOST = 37  # m, below which nothing is known of the water
    CHARGE = 38  # J in the battery at the start
    HELD = 39  # -, share of its time that a park or hold has to be in its tolerance
    RISING = 40  # -, drag while rising over that while sinking
    FLOW = 41  # -, what valve and bypass let in over what the processor assumes
    MAKES_UP = 42  # 1: a run is longer by what its start falls short of
    FOLLOWS = 43  # 1/s, how fast the hull takes the water's temperature; 0: at once
    EXPANSION = 44  # m3/K, of a hull that does not take it at once
    VOLUME_NOISE = 45  # m3, of a measured volume, 1 sigma
    VOLUME_QUANTUM = 46  # m3, its quantum
    LINE = 47  # m3, of the oil line; 0: the oil is incompressible
    LINE_GAS = 48  # m3 of air in it at the reservoir's pressure
    LINE_MODULUS = 49  # Pa, of its oil
    LINE_POWER = 50  # -, one over the polytropic exponent of its air
    LINE_RATIO = 51  # -, the water's pressure over the line's
    RESERVOIR = 52  # Pa, absolute
    HEAD_AFLOAT = 53  # Pa, of the atmosphere over the reservoir
    SLIP = 54  # m3/s/Pa by which the line empties through a pump that stands
    RUN_UP = 55  # m3 that a start falls short beside what the line takes
    LINE_STEP = 56  # of ln(p/reservoir) from row to row
    LINE_TOP = 57  # ln(p/reservoir) at which the pump stalls; inf: above all that is assumed
    OPEN = 58  # -, of the valve's flow that comes in whatever is commanded: it leaks, or is stuck
    COUNT = 59


class Now(IntEnum):
    """The state that is a number."""

    T = 0  # s
    Z = 1  # m
    W = 2  # m/s, relative to the water
    V = 3  # m3
    H = 4  # s, length that the next step may have
    T_PHASE = 5  # s, begin of the phase
    T_END = 6  # s, at which the phase is over, or out of time
    T_LOOK = 7  # s, of the next look
    T_MOVE = 8  # s, latest end of the run
    V_MOVE = 9  # m3, at which the run ends; inf or -inf: at a time
    CHARGE = 10  # J in the battery
    Z_MOST = 11  # m, greatest depth of the cycle
    V_LEAST = 12  # m3, of the cycle
    V_MOST = 13  # m3, of the cycle, off the surface
    T_ARRIVAL = 14  # s, of the cycle's first phase at a depth; nan: not yet
    T_CYCLE = 15  # s, begin of the cycle
    T_AFLOAT = 16  # s, of the cycle; nan: not yet
    V_BEGIN = 17  # m3, at the begin of the run
    T_BEGIN = 18  # s, of the run
    Z_LOOK = 19  # m, depth seen last while about to dive
    T_PRIMED = 20  # s, when a pump that has started begins to deliver
    T_INSIDE = 21  # s within the tolerance since the phase arrived
    T_ARRIVED = 22  # s, when it did
    W_SEEN = 23  # m/s, speed as the processor knew it last
    LAW = 24  # the numbers that the law remembers, in its order: 7 of `rate`, 15 of `deadband`
    HULL = 39  # degC of the hull
    LINE_LEVEL = 40  # -, ln(p/reservoir) of the oil line
    T_LEVEL = 41  # s, when it was that
    COUNT = 42


class At(IntEnum):
    """The state that is a whole number."""

    PHASE = 0
    CYCLE = 1  # cycles done
    DOING = 2  # Doing
    PLACE = 3  # 0 submerged, 1 emerging, 2 on the bottom
    RESTS = 4  # 1: at rest; no steps are needed
    ARRIVED = 5
    NEW_LAW = 6  # 1: the law is to begin anew
    DRAWS = 7  # random numbers drawn
    SEED = 8  # -1: sensors without noise
    ALARM = 9  # 1: too deep, all is pumped out
    STEPS = 10
    REJECTED = 11
    STOP = 12
    MISSED = 13  # phases of the cycle that ran out of time
    NEW_PHASE = 14  # 1: a phase is to begin
    LOOKS = 15
    NOT_HELD = 16  # parks and holds of the cycle that were out of their tolerance too long
    CAPTURED = 17  # 1: `control.hold` flies
    SHUT = 18  # 1: the check valve behind the oil line is
    IDLE = 19  # ticks without time passing
    COUNT = 20


class Doing(IntEnum):
    """What the drive does."""

    NOTHING = 0
    PUMPING = 1
    LETTING_IN = 2
    BYPASSING = 3
    PRIMING = 4  # the pump runs and does not deliver yet


class Account(IntEnum):
    """Integrals since the start; those of `Holding` follow for each phase."""

    PUMPED = 0  # m3
    LET_IN = 1  # m3
    LEAKED = 2  # m3, at rest
    PUMP_ENERGY = 3  # J from the battery
    VALVE_ENERGY = 4  # J, while volume is let or drawn in
    HOLDING_ENERGY = 5  # J
    LOAD_ENERGY = 6  # J, standby and loads
    SURFACING_ENERGY = 7  # J
    SELF_DISCHARGED = 8  # J
    PUMP_WORK = 9  # J done on the sea, of p dV
    LET_IN_WORK = 10  # J got from the sea
    LEAK_WORK = 11  # J got from the sea
    DRAG = 12  # J
    BLOWS = 13  # J, against the bottom
    SETTLED = 14  # J of oscillations that were taken for rest
    FORCED = 15  # J that the moving water took
    PUMP_TIME = 16  # s
    VALVE_TIME = 17  # s
    PUMP_RUNS = 18
    VALVE_RUNS = 19
    STALLED = 20  # s of pumping without delivery
    HEAT = 21  # J that a hull warmer or colder than the water took
    T_KIND = 22  # s in each kind of phase: five of them
    COUNT = 27


class Note(IntEnum):
    """What is noted with its time, depth, volume and a number."""

    PHASE = 0  # begins; its number
    ARRIVED = 1  # of the phase
    OUT_OF_TIME = 2
    PUMP = 3  # a run begins; volume wanted [m3]
    VALVE = 4
    BYPASS = 5
    RUN_OVER = 6  # its length [s]
    EMERGED = 7
    SUBMERGED = 8
    BOTTOM = 9
    LEFT_BOTTOM = 10
    UPPER_STOP = 11
    LOWER_STOP = 12
    TOO_DEEP = 13
    CYCLE = 14  # is over; its number
    AFLOAT = 15  # with all volume out


class Drive(IntEnum):
    """Columns of the notes."""

    T = 0
    WHAT = 1
    Z = 2
    V = 3
    NUMBER = 4
    COUNT = 5


class Stop(IntEnum):
    """Why the kernel returns."""

    GOES_ON = 0  # the buffers are full, or a cycle is over
    FINISHED = 1
    RESERVE = 2
    DID_NOT_SURFACE = 3
    PASSED_DEPTH = 4
    LOST = 5
    BATTERY_EMPTY = 6
    LEFT_WATER = 7
    STUCK = 8
