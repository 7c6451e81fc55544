"""A law that controls nothing and uses every construct that a law may be made of."""

# ruff: noqa: ARG001, N801, RUF021, RUF059
import math
from typing import NamedTuple

from swimbladder.control.law import Law, Measurement

double = 0.5  # a word of C
FAR = math.inf
TURNS = 3
BELOW = -0.25


class OddParameters(NamedTuple):
    k: float  # 1/s */ not the end of a comment
    register: float  # a word of C
    B1: float  # a macro of Arduino
    S_p: float  # s


class OddState(NamedTuple):
    sum: float  # m
    m: float  # m, the name of an argument in C
    best: float  # m


class pair(NamedTuple):
    near: float
    far: float = 8.0
    unread: float = 1.0


class Both(NamedTuple):
    first: pair
    second: pair


def ordered(a: float, b: float) -> pair:
    """Return two numbers */ in order."""
    if a > b:
        a, b = b, a
    return pair(near=a, far=b)


def three(x: float):
    return x, -x, x > 1.0


def spread(both: Both, p: OddParameters) -> float:
    inner = both.second
    near, far, _ = inner
    return far - near + both.first.far * p.k


def chosen(a: pair, b: pair, first: bool) -> pair:
    return a if first else b


def grown(state: OddState, by: float) -> OddState:
    state = OddState(state.sum + by, state.m, state.best)
    if by > 2.0:
        state = OddState(state.sum, state.m + by, best=state.best)
    return state


def counted(x: float) -> float:
    total = 0.0
    for i in range(TURNS):
        for j in range(2):
            step = x * i + j
            total += step if step > 0.0 else -step / 2
        if total > 4.0 and not total > 8.0:
            total -= 1
    return total


def initial(parameters: OddParameters, measurement: Measurement, reference: float) -> OddState:
    if not math.isfinite(measurement.depth):
        return OddState(0.0, 0.0, FAR)
    return OddState(reference - measurement.depth, 0, min(FAR, 64.0))


def step(parameters, state, measurement, reference):
    """Return */ something."""
    p = parameters
    seen = measurement
    here, there, above = three(seen.depth)
    if not (math.isfinite(reference) or above):
        state = initial(p, seen, 1.0)
    two = ordered(here, reference)
    both = Both(ordered(seen.volume, there), second=two)
    gap: float = spread(both, p)
    same = chosen(two, pair(gap), two.near <= gap < two.far)
    if 0.0 <= gap <= 1.0 or above and gap != 3.0:
        command = math.copysign(abs(gap), BELOW) + double
    elif gap == 2.0:
        command = math.sqrt(gap * 2 + 0)
    else:
        command = max(counted(gap), same.near) - same.far
    x, y = command, gap
    x, y = y, x + y
    reference += x
    _, unread, _ = three(reference)
    state = grown(state, p.register)
    best = min(state.best, math.fabs(command))
    float_ = +p.B1
    after = OddState(sum=state.sum + y * float_, m=state.sum, best=best)
    if command > 64.0:
        return command, state, p.S_p
    if command < -64.0:
        return again(p, after, command)
    return command, after, p.S_p


def again(p, state, command):
    return -command, state, 2 * p.S_p


ODD = Law(
    name="odd-one", summary="odd", command="voltage", parameters=OddParameters, state=OddState,
    units={}, step=step, initial=initial,
)  # fmt: skip
