"""A law that controls nothing and uses every construct that a law may be made of."""

# ruff: noqa: N801, RUF021, RUF059
import math
from typing import NamedTuple

from swimbladder.control.law import Count, Law, Measurement, less, more

double = 0.5  # a word of C
FAR = math.inf
TURNS = 3
FEW = 2
BELOW = -0.25


class Slope(NamedTuple):
    k: float  # 1/s */ not the end of a comment


class OddParameters(NamedTuple):
    slope: Slope
    register: float  # a word of C
    B1: float  # a macro of Arduino
    S_p: float  # s
    most: Count  # -


class Found(NamedTuple):
    m: float  # m, the name of an argument in C
    best: float  # m


class OddState(NamedTuple):
    sum: float  # m
    found: Found
    int: Count  # -, a word of C
    on: bool


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
    return far - near + both.first.far * steep(p.slope)


def steep(slope: Slope) -> float:
    return slope.k


def better(found: Found, by: float) -> Found:
    found = found._replace(best=min(found.best, by))
    return found._replace(m=found.best, best=found.m) if by > 63.0 else found


def chosen(a: pair, b: pair, first: bool) -> pair:
    return a if first else b


def grown(state: OddState, by: float) -> OddState:
    state = OddState(state.sum + by, state.found, state.int, state.on)
    if by > 2.0:
        state = OddState(state.sum, Found(state.found.m + by, state.found.best), int=7, on=False)
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


def ticked(n: Count, most: Count, bad: bool) -> Count:
    if n >= most:
        return 3 if n & 1 > 0 else n
    if bad:
        n = more(n, 1)
    elif 4 <= n < 4096 or n == FEW:
        return less(n, 2)
    return max(n, min(most, 40000)) | 16


def total(n: Count) -> float:
    reached: Count = 0
    for i in range(TURNS):
        if reached == 0 and (n & more(i, 1)) == 1:
            reached = i
    return float(more(reached, n)) + float(less(n, 9))


def initial(parameters: OddParameters, measurement: Measurement, reference: float) -> OddState:
    if not math.isfinite(measurement.depth):
        return OddState(0.0, Found(0.0, FAR), 0, True)
    n = ticked(3, parameters.most, False)
    found = Found(0, min(FAR, 64.0))
    return OddState(reference - measurement.depth, found, n, reference > 0.5)


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
    old = state.found
    best = better(old, math.fabs(command)).best
    float_ = +p.B1
    n = ticked(state.int, p.most, state.on or above)
    best = best + total(n)
    on = not state.on if n > 6 else p.most == state.int
    after = OddState(sum=state.sum + y * float_, found=Found(m=state.sum, best=best), int=n, on=on)
    if command > 64.0:
        return command, state, p.S_p
    if command < -64.0:
        return again(p, after, command)
    return command, after, p.S_p


def again(p, state, command):
    return -command, state, 2 * p.S_p


ODD = Law(
    name="odd-one",
    summary="odd",
    command="voltage",
    parameters=OddParameters,
    state=OddState,
    step=step,
    initial=initial,
)
