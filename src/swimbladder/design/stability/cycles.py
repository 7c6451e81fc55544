"""Limit cycles by harmonic balance: one nonlinearity in a sampled loop, F = 1 + N(A) L(w) = 0.

L is the exact frequency response of the sampled loop, opened at the nonlinearity. F turns once
around a zero, so the zeros are found by how F turns around the cells of a grid; they are then
polished. Loeb's criterion says which cycle is stable (Gelb and Vander Velde 1968, section 3.4):
more amplitude must make it decay, Im(conj(F_A) F_w) > 0, which is the sense in which F turns.

What the balance neglects is the third harmonic that comes back to the nonlinearity. Taken as an
error of F of that size and of any phase, it moves the zero by

    (dA/A, dw/w) <= third |rows of J^-1|,   J = d(Re F, Im F)/d(ln A, ln w)

and that is the error to be expected: large where the loop filters badly, where N is steep, and
where L runs along -1/N.

A cycle of a sampled loop need not be a whole number of samples long; if it is not, it is not
periodic but lies on a closed curve, and the balance gives its mean period.

A describing function is what a nonlinearity makes of the first harmonic of a sine: after Gelb and
Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, McGraw-Hill 1968,
chapter 2 and appendix B. All here are odd. Those without memory are real, with a slope of 1 where
they are linear; those with memory turn the phase as well.

Each nonlinearity that a vehicle under its law really has is put in the loop that it stands in. The
voltage saturates, and may be rounded, where the loop is broken at the voltage. The depth is
rounded at the depth. A motor that friction holds, and a law that lets the motor rest, stand
between the volume U that the law wants and V: a gain k_pV on U - V brings V along within a few
samples, so seen from outside friction of u_f volts is a play of u_f/k_pV, and a dead zone D is a
switch. V waits until the gap is D, then closes all but r of it: it goes between -M and M with M =
(D - r)/2, and turns where U is h = (D + r)/2. That loop is broken at the volume, with the mean lag
of the inner loop, 1/(K1 A k_pV), as a delay.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from swimbladder.control.records import leaves
from swimbladder.design.linear.margins import response
from swimbladder.design.linear.models import StateSpace, linearise
from swimbladder.design.linear.sampled import BoundLaw, LinearLaw, discretise, loop_of
from swimbladder.physics.dynamics import Plant

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_TURN = 4096  # points of a period


@dataclass(frozen=True)
class Nonlinearity:
    """One nonlinearity: what it does to a sine, and to its first harmonic.

    size: its limit, half of its dead zone, or its quantum, in the unit of what goes in. onset:
    amplitude up to which N is 1 or 0; reach: times the onset, up to which cycles are looked for.
    """

    name: str
    size: float
    onset: float
    gain: Callable[[Array], Array | Complex]  # amplitudes -> N(A) [-]
    output: Callable[[Array], Array]  # two periods of a signal -> what comes out
    reach: float = 1e5

    def amplitudes(self, count: int) -> Array:
        """Return amplitudes beyond the onset, closest where N changes most."""
        return self.onset * (1.0 + np.geomspace(1e-8, self.reach, count))

    def third(self, amplitude: float) -> float:
        """Return the third harmonic of the output over the first [-]; inf where there is none."""
        first = abs(harmonic(self.output, amplitude, 1))
        return abs(harmonic(self.output, amplitude, 3)) / first if first > 0.0 else math.inf


def harmonic(output: Callable[[Array], Array], amplitude: float, order: int) -> complex:
    """Return a harmonic of output(amplitude sin t) against the sine, in the second period."""
    t = (np.arange(2 * _TURN) + 0.5) * 2.0 * math.pi / _TURN
    y = output(amplitude * np.sin(t))[_TURN:]
    return complex(2j * np.mean(y * np.exp(-1j * order * t[_TURN:])))


def _cap(x: Array) -> Array:
    """Return (2/pi) (asin x + x sqrt(1 - x^2)), the share of a sine below x of its amplitude."""
    x = np.clip(x, -1.0, 1.0)
    return np.asarray(2.0 / math.pi * (np.arcsin(x) + x * np.sqrt(1.0 - x * x)))


def saturation(limit: float) -> Nonlinearity:
    """Return a limit to either side: N = 1 up to it, then (2/pi)(asin r + r sqrt(1-r^2)), r = d/A.

    Gelb and Vander Velde 1968, appendix B.
    """

    def output(x: Array) -> Array:
        return np.clip(x, -limit, limit)

    return Nonlinearity("saturation", limit, limit, lambda A: _cap(limit / A), output)


def dead_zone(half: float) -> Nonlinearity:
    """Return a dead zone of `half` to either side: N is 1 less that of the limit at its edge."""

    def output(x: Array) -> Array:
        return x - np.clip(x, -half, half)

    return Nonlinearity("dead zone", half, half, lambda A: 1.0 - _cap(half / A), output)


def quantiser(quantum: float) -> Nonlinearity:
    """Return rounding to a quantum q: N = (4 q/pi A) sum sqrt(1 - ((2 i - 1) q/2 A)^2).

    The sum is over the steps that the sine reaches; its greatest value is 4/pi, at A = q/sqrt 2.
    """
    edges = (np.arange(1, 41) - 0.5) * quantum

    def gain(A: Array) -> Array:
        reached = np.sqrt(np.maximum(1.0 - (edges / A[..., None]) ** 2, 0.0)).sum(axis=-1)
        return np.asarray(4.0 * quantum / (math.pi * A) * reached)

    def output(x: Array) -> Array:
        return np.asarray(quantum * np.floor(x / quantum + 0.5))

    return Nonlinearity("quantiser", quantum, 0.5 * quantum, gain, output, reach=78.0)


def relay(level: float, hysteresis: float = 0.0) -> Nonlinearity:
    """Return a switch between -level and level that turns `hysteresis` beyond 0.

    N = (4 level/(pi A)) (sqrt(1 - (h/A)^2) - j h/A).
    """
    h = hysteresis

    def gain(A: Array) -> Complex:
        sine = h / A
        return np.asarray(4.0 * level / (math.pi * A) * (np.sqrt(1.0 - sine**2) - 1j * sine))

    def output(x: Array) -> Array:
        turned = np.where(x > h, 1.0, np.where(x < -h, -1.0, 0.0))
        last = np.maximum.accumulate(np.where(turned != 0.0, np.arange(len(x)), 0))
        return np.asarray(level * turned[last])

    onset = h if h > 0.0 else 1e-4 * level
    return Nonlinearity("relay", max(h, level), onset, gain, output, reach=1e5 * level / onset)


def play(half: float) -> Nonlinearity:
    """Return play: what follows is dragged along once the gap is `half` (backlash of 2 half).

    N = (1 + cap(x))/2 - j (4 b/(pi A)) (1 - b/A), x = 1 - 2 b/A, b = half.
    """

    def gain(A: Array) -> Complex:
        ratio = half / A
        turned = 4.0 / math.pi * ratio * (1.0 - ratio)
        return np.asarray(0.5 * (1.0 + _cap(1.0 - 2.0 * ratio)) - 1j * turned)

    def output(x: Array) -> Array:
        followed, y = np.empty_like(x), 0.0
        for i, value in enumerate(x):
            y = min(max(y, value - half), value + half)
            followed[i] = y
        return followed

    return Nonlinearity("play", half, half, gain, output)


BELIEVED = 0.15  # expected error of amplitude or period up to which it is a prediction
_AMPLITUDES, _FREQUENCIES = 1200, 600
_DECADES = 4.5  # of frequency, below the Nyquist frequency
_SMALL = 1e-5  # of ln A and ln w, for derivatives


class Cycle(NamedTuple):
    """A limit cycle that the harmonic balance predicts."""

    amplitude: float  # of what enters the nonlinearity, in its unit
    frequency: float  # rad/s
    stable: bool  # other motions nearby come to it; if not, it is the edge of what decays
    third: float  # -, third harmonic that comes back to the nonlinearity, over the first
    amplitude_error: float  # -, to be expected from it
    period_error: float  # -

    @property
    def period(self) -> float:
        """Period [s]."""
        return 2.0 * math.pi / self.frequency

    @property
    def believed(self) -> bool:
        """Whether the neglected harmonic leaves it a prediction."""
        return max(self.amplitude_error, self.period_error) <= BELIEVED


def balance(loop: StateSpace, nonlinearity: Nonlinearity) -> tuple[Cycle, ...]:
    """Return the limit cycles of a nonlinearity that stands where the loop is broken."""
    assert loop.sample_time is not None  # a sampled loop
    nyquist = math.pi / loop.sample_time
    w = np.geomspace(nyquist * 10.0**-_DECADES, 0.98 * nyquist, _FREQUENCIES)
    A = nonlinearity.amplitudes(_AMPLITUDES)
    F = 1.0 + nonlinearity.gain(A)[:, None] * response(loop)(w)[None, :]
    found: list[Cycle] = []
    for i, j in _turning(F):
        log_A, log_w = math.log(A[i] * A[i + 1]) / 2.0, math.log(w[j] * w[j + 1]) / 2.0
        polished = root(partial(_parts, loop, nonlinearity), [log_A, log_w], tol=1e-12)
        inside = abs(polished.x[1] - log_w) < 2.0 * math.log(w[1] / w[0])
        if not (polished.success and inside and math.exp(polished.x[0]) > nonlinearity.onset):
            continue
        cycle = _cycle(loop, nonlinearity, polished.x)
        if not any(_same(cycle, c) for c in found):
            found.append(cycle)
    return tuple(sorted(found))


def _same(one: Cycle, other: Cycle) -> bool:
    """Whether two zeros were polished to one."""
    alike = abs(math.log(one.frequency / other.frequency)) <= 1e-6
    return alike and abs(math.log(one.amplitude / other.amplitude)) <= 1e-9


def _turning(F: NDArray[np.complex128]) -> list[tuple[int, int]]:
    """Return the cells of a grid around which F turns."""
    corners = np.stack([F[:-1, :-1], F[1:, :-1], F[1:, 1:], F[:-1, 1:], F[:-1, :-1]])
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.angle(corners[1:] / corners[:-1]).sum(axis=0) / (2.0 * math.pi)
    cells = np.nonzero(np.abs(np.nan_to_num(turns)) > 0.5)
    return [(int(i), int(j)) for i, j in zip(*cells, strict=True)]


def _F(loop: StateSpace, nonlinearity: Nonlinearity, log_A: float, log_w: float) -> complex:
    N = nonlinearity.gain(np.array([math.exp(log_A)]))[0]
    return complex(1.0 + N * response(loop)(math.exp(log_w))[0])


def _parts(loop: StateSpace, nonlinearity: Nonlinearity, x: Array) -> list[float]:
    if math.exp(x[0]) <= nonlinearity.onset:
        return [1.0, 1.0]  # nothing is nonlinear there
    F = _F(loop, nonlinearity, *x.tolist())
    return [F.real, F.imag]


def _cycle(loop: StateSpace, nonlinearity: Nonlinearity, x: Array) -> Cycle:
    log_A, log_w = x.tolist()
    A, w = math.exp(log_A), math.exp(log_w)
    step = min(_SMALL, 0.1 * (1.0 - nonlinearity.onset / A))

    def slope(d: tuple[float, float]) -> complex:
        more = _F(loop, nonlinearity, log_A + d[0], log_w + d[1])
        less = _F(loop, nonlinearity, log_A - d[0], log_w - d[1])
        return (more - less) / (2.0 * max(d))

    F_A, F_w = slope((step, 0.0)), slope((0.0, _SMALL))
    third = _returning(loop, nonlinearity, A, w)
    J = np.array([[F_A.real, F_w.real], [F_A.imag, F_w.imag]])
    of_amplitude, of_period = (third * np.linalg.norm(np.linalg.inv(J), axis=1)).tolist()
    stable = (F_A.conjugate() * F_w).imag > 0.0
    return Cycle(A, w, stable, third, of_amplitude, of_period)


def _returning(loop: StateSpace, nonlinearity: Nonlinearity, A: float, w: float) -> float:
    """Third harmonic made by the nonlinearity times what the loop lets through of it."""
    assert loop.sample_time is not None
    # Beyond the Nyquist frequency a sampled harmonic is seen as a slower one.
    angle = abs((3.0 * w * loop.sample_time + math.pi) % (2.0 * math.pi) - math.pi)
    both = np.abs(response(loop)([w, angle / loop.sample_time]))
    return float(nonlinearity.third(A) * both[1] / both[0])


_BROUGHT = 0.25  # share of a law's dead zone at which its motor stops: observer, sea-cascade


class Predicted(NamedTuple):
    """A nonlinearity of the vehicle, and a cycle that it makes; none where it makes none."""

    source: str  # voltage limit, motor friction, dead zone of the law, ...
    size: float
    unit: str  # of the size
    place: str  # where the loop is broken
    cycle: Cycle | None
    depth_amplitude: float  # m, of the depth's first harmonic; nan without a cycle
    bound: bool = False  # amplitude and period are the most that it may have


def broken_at_volume(p: Plant, law: LinearLaw, *, depth: float, k_pV: float) -> StateSpace:
    """Return the loop from the volume V to minus the volume U that the law wants.

    U = V + (u - c z)/k_pV: what an inner loop of that gain would bring V to.
    """
    lag = 1.0 / (p.gain * k_pV)
    whole = loop_of(p._replace(positioner=1.0), law, depth=depth, delay=lag)
    loop = whole.broken_at_command()
    body = discretise(whole.plant, law.sample_time, command_delay=lag)
    z, V = (body.part(output=name, input="command").C for name in ("depth", "volume"))
    own = np.pad(V - p.load_drive * z / k_pV, ((0, 0), (0, len(law.system.states))))
    return replace(loop, C=loop.C / k_pV - own, inputs=("volume",), outputs=("volume",))


def predict(
    p: Plant,
    bound: BoundLaw,
    linear: LinearLaw,
    *,
    depth: float,
    depth_quantum: float = 0.0,
    voltage_quantum: float = 0.0,
) -> tuple[Predicted, ...]:
    """Return what each nonlinearity of a voltage-driven vehicle does at `depth` [m], by itself.

    linear: the law's linear form, without its dead zone; depth_quantum [m]; voltage_quantum [V].
    """
    loop = loop_of(p, linear, depth=depth)
    h, known, law = linear.sample_time, leaves(bound.parameters), bound.law
    k_pV, rest = (float(known.get(name, 0.0)) for name in (law.volume_gain, law.dead_zone))
    from_voltage = discretise(loop.plant, h).part(output="depth", input="command")
    # Where the loop is broken, and what takes the first harmonic from there to the depth.
    places: dict[str, tuple[StateSpace, StateSpace | None]] = {
        "voltage": (loop.broken_at_command(), from_voltage),
        "depth": (loop.broken_at_depth(), None),
    }
    asked = [
        ("voltage limit", p.supply, "V", "voltage", saturation(p.supply)),
        ("quantum of the voltage", voltage_quantum, "V", "voltage", quantiser(voltage_quantum)),
        ("quantum of the depth", depth_quantum, "m", "depth", quantiser(depth_quantum)),
    ]
    if k_pV > 0.0:
        body = discretise(linearise(p._replace(positioner=1.0), depth=depth), h)
        at_volume = broken_at_volume(p, linear, depth=depth, k_pV=k_pV)
        places["volume"] = (at_volume, body.part(output="depth", input="command"))
        held, rests = p.friction + 0.5 * (p.load_drive - p.load_back) * depth, _left(p, k_pV, h)
        asked.append(("friction of the motor", held, "V", "volume", play(held / k_pV)))
        if rest > 0.0:
            switch = relay(0.5 * rest * (1.0 - rests), 0.5 * rest * (1.0 + rests))
            asked.append(("dead zone of the law", rest, "m3", "volume", switch))
    found = []
    for source, size, unit, place, nonlinearity in asked:
        if not size > 0.0:
            continue
        broken, to_depth = places[place]
        cycles = balance(broken, nonlinearity)
        for cycle in cycles:
            N = abs(complex(nonlinearity.gain(np.array([cycle.amplitude]))[0]))
            amplitude = cycle.amplitude
            if to_depth is not None:
                amplitude *= N * abs(to_depth.at(np.exp(1j * cycle.frequency * h))[0, 0, 0])
            found.append(Predicted(source, size, unit, place, cycle, amplitude))
        if not cycles:
            found.append(Predicted(source, size, unit, place, None, math.nan))
    return tuple(found)


def _left(p: Plant, k_pV: float, h: float) -> float:
    """Return the share of a volume error that is left once the motor rests [-].

    Each sample holds u = k_pV (U - V), until less than a quarter is left; the motor then runs out.
    """
    gap, rate, decay = 1.0, 0.0, math.exp(-h / p.T1)
    for _ in range(1000):
        goal = p.gain * k_pV * gap
        gap -= goal * h + (rate - goal) * p.T1 * (1.0 - decay)
        rate = goal + (rate - goal) * decay
        if abs(gap) < _BROUGHT:
            return gap - rate * p.T1
    return 1.0  # it never comes near: the motor does not rest
