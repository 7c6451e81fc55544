"""Limit cycles: by harmonic balance, in the simulator, and of laws that change volume in steps.

Harmonic balance takes one nonlinearity in a sampled loop, F = 1 + N(A) L(w) = 0. L is the exact
frequency response of the sampled loop, opened at the nonlinearity. F turns once around a zero, so
the zeros are found by how F turns around the cells of a grid; they are then polished. Loeb's
criterion says which cycle is stable (Gelb and Vander Velde 1968, section 3.4): more amplitude must
make it decay, Im(conj(F_A) F_w) > 0, which is the sense in which F turns.

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

In the simulator a limit cycle is what remains long after a disturbance, without noise. An unstable
cycle is the edge of what decays: it is found by halving the disturbance between one
that decays and one that grows, and looked at while the two runs still are alike.

Those of a law that changes the volume in steps, at moments of its own, are predicted here too. Each
has a cause, and is computed for that cause by itself (`docs/explanation/stability.md`):

- On its way through water in which its neutral volume changes by psi a metre the excess falls by
  |psi| w a second and with it the speed, by |psi|/(2 c_true) a second whatever it is. The law acts
  once a band is lost, so every 2 c_true (w_to - w_low)/|psi|, at the next decision.
- At rest, stiffer than the water (psi < 0), the vehicle stays where its volume is neutral. Volumes
  that are a step dV apart rest dV/|psi| apart: where that is more than the band holds, none is left
  in it, and it goes to and fro between two.
- What leaks lets the place of rest sink by leakage/|psi|, unseen below half a step of the speed,
  until the band is left: at most its width later.
- With a hull that gives way more (psi > 0) errors grow from any rest, and are caught once the band
  is left, after one more decision.
- A depth in steps shows speeds of a step over the time that a speed is measured in; where such a
  speed asks for half a step of the volume, the law acts on nothing.

The first is a prediction; of the others amplitudes are bounds.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from swimbladder.control.law import leaves
from swimbladder.control.rate import RateParameters
from swimbladder.design.linear.margins import response
from swimbladder.design.linear.models import StateSpace, linearise
from swimbladder.design.linear.pump_valve import drive_rates, moved_by_volume
from swimbladder.design.linear.sampled import BoundLaw, LinearLaw, discretise, loop_of
from swimbladder.design.tuning.margins import least_band
from swimbladder.design.tuning.trial import Runs, fly
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant, drag_per_mass, plant
from swimbladder.vehicle import Vehicle

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
        """Return the position of what is dragged along, which begins at 0."""
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


_PERIODS = 60.0  # that a cycle is given to settle
_LOOKED = 0.3  # share of the run that is looked at
_ROUNDS = 7  # of halving, each between 40 lanes
_LANES = 40
_KICK = 0.03  # 1/s, speed over disturbance: at rest a law with a dead zone would stay where it is
_STEADY = 0.05  # deviation of amplitude within what is looked at, up to which it is a cycle


class Seen(NamedTuple):
    """What a simulation shows at its end."""

    cycles: bool  # it goes to and fro without end
    amplitude: float  # m, of the depth's first harmonic
    period: float  # s
    farthest: float  # m, from the set-point, over what is looked at


class Confirmed(NamedTuple):
    """A predicted cycle beside what the simulator does; None where no edge was found."""

    predicted: Predicted
    seen: Seen | None

    @property
    def errors(self) -> tuple[float, float]:
        """Prediction over simulation, less 1: of the depth's amplitude and of the period."""
        c, s = self.predicted.cycle, self.seen
        if c is None or s is None or not s.cycles:
            return math.nan, math.nan
        return self.predicted.depth_amplitude / s.amplitude - 1.0, c.period / s.period - 1.0


def measure(time: Array, depth: Array, reference: float) -> Seen:
    """Return the oscillation of a depth [m] about its mean: first harmonic and mean period."""
    x = depth - depth.mean()
    farthest = float(np.max(np.abs(depth - reference)))
    rising = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    if len(rising) < 3:
        return Seen(False, math.nan, math.nan, farthest)
    at = time[rising] - x[rising] * (time[1] - time[0]) / (x[rising + 1] - x[rising])
    # One period: from a crossing to the next that is farther than half of the slowest beat.
    w = _frequency(time, x, 2.0 * math.pi / float(np.mean(np.diff(at))))
    half = len(x) // 2
    first, second = (_size(time[s], x[s], w) for s in (slice(0, half), slice(half, None)))
    mean = 0.5 * (first + second)
    steady = mean > 1e-7 and abs(first - second) <= 2.0 * _STEADY * mean
    return Seen(steady, _size(time, x, w), 2.0 * math.pi / w, farthest)


def _frequency(time: Array, x: Array, guess: float) -> float:
    """Return the frequency [rad/s] of the strongest harmonic, by its spectrum, then refined."""
    h = float(time[1] - time[0])
    window = np.hanning(len(x))
    padded = 16 * len(x)
    spectrum = np.abs(np.fft.rfft(x * window, padded))
    lowest = int(2.0 * padded / len(x))
    k = lowest + int(np.argmax(spectrum[lowest:]))
    if k <= lowest or k + 1 >= len(spectrum):
        return guess
    a, b, c = np.log(spectrum[k - 1 : k + 2])
    return float(2.0 * math.pi * (k + 0.5 * (a - c) / (a - 2.0 * b + c)) / (padded * h))


def _size(time: Array, x: Array, w: float) -> float:
    columns = np.stack([np.ones_like(time), np.sin(w * time), np.cos(w * time)], axis=1)
    c = np.linalg.lstsq(columns, x, rcond=None)[0]
    return float(math.hypot(c[1], c[2]))


class Held(NamedTuple):
    """A vehicle that a law holds at a depth."""

    vehicle: Vehicle
    bound: BoundLaw
    depth: float  # m
    vary: Mapping[str, float] = {}  # fields of the plant that differ

    def fly(
        self, disturbances: Any, duration: float, *, speed: float = 0.0, quantised: bool = False
    ) -> Runs:
        """Return runs of `duration` [s] that start off by disturbances [m], without noise.

        speed [m/s]: at the start. quantised: whether the sensors round.
        """
        return fly(
            self.vehicle.but("sensors", depth_noise=0.0, volume_noise=0.0),
            self.bound,
            target=self.depth,
            duration=duration,
            vary=self.vary,
            start_depth=self.depth + np.asarray(disturbances, float),
            start_speed=speed,
            seed=0 if quantised else None,
        )


def hold(
    held: Held, disturbance: float, period: float, *, quantised: bool = False, kick: float = _KICK
) -> Seen:
    """Return what remains of a vehicle that starts `disturbance` [m] off.

    period [s]: expected, which decides how long is simulated. quantised: whether the sensors round.
    kick [1/s]: of the disturbance, as speed.
    """
    speed = kick * disturbance
    runs = held.fly([disturbance], _PERIODS * period, speed=speed, quantised=quantised)
    late = runs.time >= (1.0 - _LOOKED) * runs.time[-1]
    return measure(runs.time[late], runs.depth[late, 0], held.depth)


def edge(held: Held, within: tuple[float, float], period: float) -> tuple[Seen, float] | None:
    """Return the cycle between what decays and what grows, and the disturbance [m] that parts them.

    within: disturbances [m] of which the least decays and the most grows; None where they do not.
    period [s]: expected.
    """
    low, high = within
    time, depths = np.empty(0), np.empty((0, 0))
    for k in range(_ROUNDS):
        off = np.geomspace(low, high, _LANES) if k == 0 else np.linspace(low, high, _LANES)
        time, depths, *_ = held.fly(off, 20.0 * period)
        error = np.abs(depths - held.depth)
        last = error[time >= time[-1] - 2.0 * period].max(axis=0)
        grows = ~(last < error.max(axis=0) / 3.0)  # nan: it left the water
        if grows[0] or not grows.any():
            return None
        first = int(np.argmax(grows))
        low, high = float(off[first - 1]), float(off[first])
        pair = depths[:, [first - 1, first]]
    apart = np.abs(pair[:, 0] - pair[:, 1]) > _STEADY * np.abs(pair[:, 0] - held.depth).max()
    until = float(time[int(np.argmax(apart))]) if apart.any() else float(time[-1])
    kept = (time <= until) & (time >= until - 3.5 * period)
    return measure(time[kept], pair[kept, 0], held.depth), low


_DECISION = "decision"  # where the loop is looked at
_LONGEST = 20.0 * 86400.0  # s, that a cycle is flown for
_SHORTEST = 200.0  # decisions, likewise at least
_DISTURBED = 5e-3  # m/s, at the start: an unstable rest is no rest
_FIRST = 3.0  # periods before what is looked at


def hunting(
    vehicle: Vehicle, bound: BoundLaw, *, depth: float, depths: tuple[float, float]
) -> tuple[Confirmed, ...]:
    """Return the limit cycles at a depth [m] and on the way between depths [m]."""
    if not isinstance(bound.parameters, RateParameters):
        return ()
    p = plant(moved_by_volume(vehicle))
    ways = [on_the_way(p, bound.parameters, down=down) for down in (True, False)]
    found = [Confirmed(one, _flown_way(vehicle, bound, one, depths)) for one in ways if one]
    rests = _at_rest(vehicle, p, bound.parameters, depth)
    found += [Confirmed(one, _flown_rest(vehicle, bound, one, depth)) for one in rests]
    return tuple(found)


def _predicted(
    cause: tuple[str, float, str], amplitude: float, period: float = math.nan, off: float = math.inf
) -> Predicted:
    """Return what a cause of a size in a unit makes by itself.

    amplitude [m], period [s], off [-]: error of both; inf: they are bounds.
    """
    cycle = Cycle(amplitude, 2.0 * math.pi / period, True, 0.0, off, off)
    return Predicted(*cause, _DECISION, cycle, amplitude, math.isinf(off))


def on_the_way(p: Plant, q: RateParameters, *, down: bool) -> Predicted | None:
    """Return how often the law makes up for the neutral volume that changes on its way.

    None where the hull speeds it up: beyond `far` haste is welcome.
    """
    if p.psi >= 0.0:
        return None
    wanted = q.far_speed if down else q.ascent_speed
    low = wanted - q.speed_band + 0.5 * q.speed_step
    if low <= 0.0:
        return None
    c = drag_per_mass(wanted, p) / (p.a_b * wanted * wanted)
    interval = q.dead + q.run
    falls = -p.psi / (2.0 * c)  # m/s2
    period = math.ceil((wanted - low) / falls / interval) * interval
    # A speed that falls steadily and jumps back: the depth is off its mean way by parabolas.
    amplitude = falls * period * period / 16.0
    source = f"compressibility, {'sinking' if down else 'rising'}"
    size = q.coefficient * (wanted**2 - low**2)
    return _predicted((source, size, "m3"), amplitude, period, 0.5 * interval / period)


def _at_rest(vehicle: Vehicle, p: Plant, q: RateParameters, depth: float) -> list[Predicted]:
    found: list[Predicted] = []
    quantum, step = vehicle.sensors.depth_quantum, q.volume_step

    def add(one: Predicted, cycles: bool = True) -> None:
        found.append(one if cycles else one._replace(cycle=None, bound=False))

    if p.psi > 0.0:
        most = q.tolerance + least_band(vehicle, p.psi, q, step)
        add(_predicted(("hull that gives way", p.psi, "m3/m"), most))
    elif p.psi < 0.0:
        half = 0.5 * step / -p.psi
        if step > 0.0:
            one = _predicted(("step of the volume", step, "m3"), half)
            add(one, cycles=half > q.tolerance)
        leak = drive_rates(vehicle, [depth]).leakage[0]
        if leak > 0.0 and leak / -p.psi < 0.5 * q.speed_step:
            period = 2.0 * q.tolerance * -p.psi / leak
            add(_predicted(("leakage", leak, "m3/s"), q.tolerance, period))
    if quantum > 0.0:
        shown = quantum / q.window
        acts = q.coefficient * shown**2 >= 0.5 * step and shown >= 0.5 * q.speed_step
        cycles = acts and p.psi != 0.0
        most = q.tolerance + 0.5 * quantum if cycles else math.nan
        add(_predicted(("quantum of the depth", quantum, "m"), most), cycles=cycles)
    return found


def _flown_way(
    vehicle: Vehicle, bound: BoundLaw, one: Predicted, depths: tuple[float, float]
) -> Seen | None:
    """Return how a flight through the depths goes on between two actions; None: too few."""
    assert one.cycle is not None
    (low, high), down, q = depths, one.source.endswith("sinking"), bound.parameters
    speed = q.far_speed if down else q.ascent_speed
    # Up it is asked to come to the surface: so it keeps its speed to the end.
    begin, target = (low, high) if down else (high, 0.0)
    until = (high - low - 2.0 * q.far) / speed
    if until < 3.0 * one.cycle.period:
        return None
    flown = fly(vehicle, bound, target=target, duration=until, start_depth=begin)
    times = flown.actions[0][:, 0]
    times = times[times > 0.5 * one.cycle.period]
    if len(times) < 3:
        return None
    periods = np.diff(times)
    within = (flown.time >= times[0]) & (flown.time <= times[-1])
    t, z = flown.time[within], flown.depth[within, 0]
    bent = z - np.polyval(np.polyfit(t, z, 2), t)
    period = float(np.mean(periods))
    return Seen(True, 0.5 * float(np.ptp(bent)), period, float(np.max(np.abs(bent))))


def _flown_rest(vehicle: Vehicle, bound: BoundLaw, one: Predicted, depth: float) -> Seen:
    """Return what remains of a flight that begins off the depth, one cause left in."""
    leaks, q = one.source == "leakage", bound.parameters
    period = 0.0 if one.cycle is None or math.isnan(one.cycle.period) else one.cycle.period
    duration = min(max(10.0 * period, _SHORTEST * (q.dead + q.run)), _LONGEST)
    a = vehicle.engine
    tight = a if leaks else a.model_copy(update={"leakage": 0.0, "creep": 0.0})
    quantised = one.source == "quantum of the depth"
    held = Held(vehicle.model_copy(update={"actuator": tight}), bound, depth)
    # Where no whole number of steps takes it to the middle of the band, on its way out of it.
    apart = q.volume_step / abs(vehicle.hull.psi) if vehicle.hull.psi else 0.0
    off = max(0.5 * apart, 1.5 * q.tolerance)
    flown = held.fly(off, duration, speed=_DISTURBED, quantised=quantised)
    return _remains(flown, depth, min(_FIRST * period, 0.3 * duration))


def _remains(flown: Runs, depth: float, since: float) -> Seen:
    kept = (flown.time >= max(since, 0.3 * float(flown.time[-1]))) & np.isfinite(flown.depth[:, 0])
    z = flown.depth[kept, 0]
    if len(z) < 8:
        return Seen(False, math.nan, math.nan, math.inf)
    seen = measure(flown.time[kept], z, depth)
    if seen.cycles or not math.isfinite(seen.period):
        return seen
    # Not of one size, but to and fro all the same: its mean period, and half of what it spans.
    goes_on = float(np.ptp(z[len(z) // 2 :])) > 0.8 * float(np.ptp(z[: len(z) // 2]))
    half = 0.5 * float(np.ptp(z))
    return Seen(goes_on and half > 1e-3, half, seen.period, seen.farthest)
