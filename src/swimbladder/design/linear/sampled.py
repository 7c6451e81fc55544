"""The sampled loop: plant discretised exactly, law differentiated numerically, delays exact.

Between samples the command is held, so the plant advances by a matrix exponential. A computation
delay of any length, whole samples and a fraction, splits the step of the command inside a sample
(modified discretisation); a delay of the depth sensor samples the depth inside the step before.
Nothing is approximated but the nonlinearity.

Closed, it has poles, margins and delays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.law import (
    Law,
    Measurement,
    from_leaves,
    from_numbers,
    leaf_names,
    leaves,
    numbers,
)
from swimbladder.design.linear.depths import DepthLoad, depth_load
from swimbladder.design.linear.margins import (
    Margins,
    equivalent_poles,
    largest_delay,
    loop_margins,
    spectral_radius,
)
from swimbladder.design.linear.models import StateSpace, exponential_of, linearise
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant

_INPUTS = ("depth", "volume", "reference")


class BoundLaw(NamedTuple):
    """A law with its parameters, and how often it is called."""

    law: Law
    parameters: Any
    sample_time: float = math.nan  # s; nan: of a law of volume changes, by its own times

    @property
    def without_rest(self) -> BoundLaw:
        """It without its dead zone and pauses: its linear part."""
        resting = dict.fromkeys(filter(None, (self.law.dead_zone, self.law.near)), 0.0)
        kept = from_leaves(type(self.parameters), leaves(self.parameters) | resting)
        return self._replace(parameters=kept)


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearLaw:
    """A law at rest: inputs depth [m], volume [m3] and reference [m], output the command."""

    system: StateSpace
    smooth: bool  # whether near and far slopes to both sides agree, and the depth acts at all
    sample_time: float  # s, between the calls it asks for


def linearise_law(bound: BoundLaw, measurement: Measurement) -> LinearLaw:
    """Return the linear form of any law, its `step` differentiated about rest by differences.

    measurement: at rest, the reference is the depth measured. The law is called at whole numbers of
    its sample time. States that act on nothing, or that
    no measurement moves, are left out: a path that only the reference moves is no part of the loop,
    and need not be linear. The slopes are those over 0.1 mm and 0.1 cm3, and what they move.
    """
    (law, parameters, tick), reference = bound, measurement.depth
    step, state = law.step, law.initial(parameters, measurement, reference)
    for _ in range(3):  # clocks and differences inside the law settle
        measurement = measurement._replace(time=measurement.time + tick)
        _, state, wait = step(parameters, state, measurement, reference)
    sample_time = max(1, math.ceil(wait / tick - 1e-9)) * tick
    measurement = measurement._replace(time=measurement.time + sample_time)

    def outputs(x: Array, inputs: Array) -> Array:
        """Return the next state and the command for a state and (depth, volume, reference)."""
        depth, volume, wanted = inputs.tolist()
        seen = measurement._replace(depth=depth, volume=volume)
        command, after, _ = step(parameters, from_numbers(type(state), x.tolist()), seen, wanted)
        return np.array([*numbers(after), command], dtype=np.float64)

    x0 = np.array(list(numbers(state)), dtype=np.float64)
    u0 = np.array([measurement.depth, measurement.volume, reference], dtype=np.float64)
    u_steps = np.array([1e-4, 1e-7, 1e-4])
    here = outputs(x0, u0)
    moved = [np.abs(outputs(x0, u0 + d) - here)[:-1] for d in np.diag(u_steps)]
    x_steps = np.maximum(np.max(moved, axis=0), 1e-6 * np.abs(x0))
    x_steps[x_steps == 0.0] = 1e-6
    n = len(x0)
    at, steps = np.concatenate([x0, u0]), np.concatenate([x_steps, u_steps])

    def odd_and_even(d: Array) -> tuple[Array, Array]:
        above, below = (outputs(x[:n], x[n:]) for x in (at + d, at - d))
        return above - below, above + below - 2.0 * here

    swings, bends = np.array([odd_and_even(d) for d in np.diag(steps)]).transpose(1, 2, 0)
    slopes = swings / (2.0 * steps)
    keep = _acting(slopes, n)
    rows, columns = [*keep, n], [*keep, n, n + 1]  # the reference is outside
    swing, bend = (of[np.ix_(rows, columns)] for of in (swings, bends))
    thirds = [odd_and_even(d)[0][rows] for d in np.diag(steps / 3.0)[columns]]
    unlike = np.maximum(np.abs(bend), np.abs(swing - 3.0 * np.transpose(thirds)))
    noise = 1e-12 * (np.abs(here[rows, None]) + np.abs(swing))
    smooth = bool((unlike <= 1e-6 * np.abs(swing) + noise).all() and slopes[rows, n].any())
    A, B = slopes[np.ix_(keep, keep)], slopes[keep, n:]
    C, D = slopes[n:, keep], slopes[n:, n:]
    names = tuple(leaf_names(type(state))[i] for i in keep)
    signals = {"states": names, "inputs": _INPUTS, "outputs": ("command",)}
    system = StateSpace(A=A, B=B, C=C, D=D, sample_time=sample_time, **signals)
    return LinearLaw(system=system, smooth=smooth, sample_time=sample_time)


def _acting(slopes: Array, n: int) -> list[int]:
    """The states that a measurement reaches and that reach the command."""
    linked = slopes[:n, :n] != 0.0
    reached = (slopes[:n, n : n + 2] != 0.0).any(axis=1)
    acting = slopes[n, :n] != 0.0
    for _ in range(n):
        reached |= linked[:, reached].any(axis=1)
        acting |= linked[acting].any(axis=0)
    return np.flatnonzero(reached & acting).tolist()


def command_slope(law: LinearLaw, input: str) -> float:
    """Return the settled change of the command per change of one measurement; inf if it drifts.

    The other measurements and the reference stay: an integral of the depth error does not move.
    """
    system = law.system.part(output="command", input=input)
    moved = system.B[:, 0] != 0.0
    for _ in system.states:
        moved |= (system.A[:, moved] != 0.0).any(axis=1)
    A, B, C = system.A[np.ix_(moved, moved)], system.B[moved, 0], system.C[0, moved]
    if np.any(np.abs(np.linalg.eigvals(A) - 1.0) < 1e-9):
        return math.inf
    return float(C @ np.linalg.solve(np.eye(len(B)) - A, B) + system.D[0, 0])


def _held(A: Array, B: Array, h: float) -> tuple[Array, Array]:
    """State and input matrix of a step of h [s] with the input held."""
    n, m = B.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = A * h, B * h
    exponential = exponential_of(block)
    return exponential[:n, :n], exponential[:n, n:]


def discretise(
    plant: StateSpace, h: float, *, command_delay: float = 0.0, depth_delay: float = 0.0
) -> StateSpace:
    """Return a plant sampled every h [s]: input the command of this sample, outputs depth, volume.

    command_delay: from the sample to the change of the command [s], depth_delay: age of the depth
    that the law sees [s]; one of the two must be 0. A plant driven by its volume (a positioner's)
    is taken to reach the volume commanded at once; its measured volume is the last one commanded.
    """
    if command_delay > 0.0 and depth_delay > 0.0:
        raise ValueError("a delay of the command and one of the depth at once are not modelled")
    n = len(plant.states)
    own_volume = "V" in plant.states
    whole, depth_whole = (math.floor(d / h + 1e-12) for d in (command_delay, depth_delay))
    late, depth_late = max(command_delay - whole * h, 0.0), max(depth_delay - depth_whole * h, 0.0)
    held = whole + (late > 0.0)
    past = held if own_volume else max(held, whole + 1)  # commands that are remembered
    depths = depth_whole + (depth_late > 0.0)  # depths that are remembered
    size = n + past + depths
    A, B = np.zeros((size, size)), np.zeros((size, 1))
    A[:n, :n], _ = _held(plant.A, plant.B, h)
    rest, early = _held(plant.A, plant.B, h - late)
    terms = [(whole, early)]
    if late > 0.0:
        terms.append((whole + 1, rest @ _held(plant.A, plant.B, late)[1]))
    for age, column in terms:
        if age == 0:
            B[:n] += column
        else:
            A[:n, [n + age - 1]] += column
    if past:
        B[n] = 1.0
        A[n + 1 : n + past, n : n + past - 1] = np.eye(past - 1)
    z = plant.C[[plant.outputs.index("z")]]
    C = np.zeros((2, size))
    C[0, :n] = z
    if depths:
        first = n + past
        until, pushed = _held(plant.A, plant.B, h - depth_late)
        A[first, :n], B[first] = z @ until, z @ pushed
        if depth_late == 0.0:  # the depth of this very sample
            A[first, :n], B[first] = z, 0.0
        A[first + 1 :, first:-1] = np.eye(depths - 1)
        C[0] = np.eye(size)[-1]
    if own_volume:
        C[1, :n] = plant.C[plant.outputs.index("V")]
    else:
        C[1, n + whole] = 1.0
    remembered = [f"command[-{i}]" for i in range(1, past + 1)]
    remembered += [f"depth[-{i}]" for i in range(1, depths + 1)]
    names = (*plant.states, *remembered)
    signals = {"states": names, "inputs": ("command",), "outputs": ("depth", "volume")}
    return StateSpace(A=A, B=B, C=C, D=np.zeros((2, 1)), sample_time=h, **signals)


@dataclass(frozen=True, kw_only=True, eq=False)
class SampledLoop:
    """A plant in continuous time and a law that samples it; one of the two delays is 0."""

    plant: StateSpace
    law: LinearLaw
    command_delay: float = 0.0  # s, from a sample to its command
    depth_delay: float = 0.0  # s, age of the depth that the law sees

    @cached_property
    def _sampled(self) -> tuple[StateSpace, StateSpace]:
        """The plant from sample to sample, and the law."""
        delays = {"command_delay": self.command_delay, "depth_delay": self.depth_delay}
        return discretise(self.plant, self.law.sample_time, **delays), self.law.system

    def broken_at_command(self) -> StateSpace:
        """Return the loop from the command at the plant to minus the command of the law."""
        p, k = self._sampled
        seen = [k.inputs.index(name) for name in p.outputs]
        none = np.zeros((len(p.states), len(k.states)))
        A = np.block([[p.A, none], [k.B[:, seen] @ p.C, k.A]])
        B, C = np.vstack([p.B, none.T[:, :1]]), -np.hstack([k.D[:, seen] @ p.C, k.C])
        return _broken(p, k, "command", A, B, C)

    def broken_at_depth(self) -> StateSpace:
        """Return the loop from the depth that the law sees to minus the depth; V stays fed back."""
        p, k = self._sampled
        depth, volume = k.inputs.index("depth"), k.inputs.index("volume")
        V = p.C[[p.outputs.index("volume")]]
        z = p.C[[p.outputs.index("depth")]]
        A = np.block([[p.A + p.B @ k.D[:, [volume]] @ V, p.B @ k.C], [k.B[:, [volume]] @ V, k.A]])
        B = np.vstack([p.B @ k.D[:, [depth]], k.B[:, [depth]]])
        C = -np.hstack([z, np.zeros((1, len(k.states)))])
        return _broken(p, k, "depth", A, B, C)

    def closed(self) -> Array:
        """Return the matrix that takes the closed loop from one sample to the next."""
        loop = self.broken_at_depth() if self.depth_delay > 0.0 else self.broken_at_command()
        return loop.A - loop.B @ loop.C


def loop_of(
    p: Plant, law: LinearLaw, *, depth: float, delay: float = 0.0, back_driving: bool = False
) -> SampledLoop:
    """Return the loop of a plant at a depth [m]; delay [s]: from a sample to its command."""
    model = linearise(p, depth=depth, back_driving=back_driving)
    return SampledLoop(plant=model, law=law, command_delay=delay)


def _broken(p: StateSpace, k: StateSpace, at: str, A: Array, B: Array, C: Array) -> StateSpace:
    """A sampled plant and its law as a loop that is broken at one signal."""
    states, D = (*p.states, *k.states), np.zeros((1, 1))
    return replace(p, A=A, B=B, C=C, D=D, states=states, inputs=(at,), outputs=(at,))


_LONGEST = 100  # samples: the longest delay that eigenvalues are computed for


class Mode(NamedTuple):
    """A pole of the closed sampled loop, and the pole in continuous time that samples to it."""

    z: complex  # -
    s: complex  # 1/s, -inf where z is 0
    damping: float  # -, of a pair; 1 for a decay without oscillation
    time_constant: float  # s, of the decay; inf where it does not decay

    @property
    def frequency(self) -> float:
        """Frequency of a pair [rad/s], 0 where it does not oscillate."""
        return abs(self.s.imag)


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedLoop:
    """What the linear analysis says of a vehicle under its law, at the law's sample time."""

    law: str
    loop: SampledLoop
    sample_time: float  # s
    modes: tuple[Mode, ...]  # slowest first
    spectral_radius: float  # -
    spectral_radius_back_driven: float  # -, with the load of a motor that the sea drives back
    at_command: Margins | None  # loop broken at the voltage, or at a positioner's volume
    at_depth: Margins | None  # loop broken at the measured depth
    computation_delay: float  # s, longest that the loop survives
    radius_at_whole_sample: float  # -, spectral radius with one whole sample of computation
    depth_delay: float  # s, longest age of the measured depth that the loop survives
    depth_load: DepthLoad | None  # where the law feeds the volume back to a voltage
    inner_gain_per_sample: float  # -, K1 A k_pV times the sample time; nan without an inner loop
    volume_per_sample: float  # m3, farthest that a positioner goes in a sample; nan for a motor
    error_at_rate_limit: float  # m, sudden error whose first command is farther; nan for a motor

    @property
    def one_loop(self) -> bool:
        """Whether the law looks at the depth only, so that it is one loop wherever it is broken."""
        law = self.loop.law.system
        volume = law.inputs.index("volume")
        return not (law.B[:, volume].any() or law.D[:, volume].any())

    @property
    def stable(self) -> bool:
        """Whether small disturbances decay, the motor driving or driven back."""
        return max(self.spectral_radius, self.spectral_radius_back_driven) < 1.0


def close(p: Plant, law: LinearLaw, *, name: str, depth: float) -> ClosedLoop:
    """Return the analysis of a plant at `depth` [m] under a law that was linearised at rest.

    The command is a voltage, or for a positioner a volume that counts as reached at once.
    """
    h = law.sample_time
    loop = loop_of(p, law, depth=depth)
    matrix = loop.closed()
    radius = spectral_radius(matrix)
    at_command = loop_margins(loop.broken_at_command())
    at_depth = loop_margins(loop.broken_at_depth())
    back = loop_of(p, law, depth=depth, back_driving=True)
    k_pV = -command_slope(law, "volume")
    inner = k_pV > 0.0 and not p.positioner
    first = abs(float(law.system.D[0, law.system.inputs.index("depth")]))
    per_sample = p.rate * h if p.positioner else math.nan
    return ClosedLoop(
        law=name,
        loop=loop,
        sample_time=h,
        modes=modes(matrix, h),
        spectral_radius=radius,
        spectral_radius_back_driven=radius if p.positioner else spectral_radius(back.closed()),
        at_command=at_command,
        at_depth=at_depth,
        computation_delay=_delay(lambda d: replace(loop, command_delay=d).closed(), h, at_command),
        radius_at_whole_sample=spectral_radius(replace(loop, command_delay=h).closed()),
        depth_delay=_delay(lambda d: replace(loop, depth_delay=d).closed(), h, at_depth),
        depth_load=depth_load(p, k_pV=k_pV) if inner else None,
        inner_gain_per_sample=p.gain * k_pV * h if inner else math.nan,
        volume_per_sample=per_sample,
        error_at_rate_limit=per_sample / first if first else math.inf,
    )


def _delay(closed: Callable[[float], Array], h: float, found: Margins | None) -> float:
    """Longest delay by eigenvalues; by the frequency response where that is beyond their reach.

    A delay of so many samples belongs to a crossing so slow that sampling no longer matters.
    """
    if found is None:
        return 0.0
    if found.delay > 0.5 * _LONGEST * h:
        return found.delay
    horizon = min(3.0 * found.delay + 3.0 * h, _LONGEST * h)
    return largest_delay(closed, step=max(h / 16.0, horizon / 200.0), horizon=horizon)


def modes(matrix: Array, h: float) -> tuple[Mode, ...]:
    """Return the modes of a closed loop's matrix sampled every h [s], slowest first."""
    z = np.linalg.eigvals(matrix)
    z = z[np.lexsort((-z.imag, -np.abs(z)))]
    found = []
    for pole, s in zip(z.astype(complex).tolist(), equivalent_poles(z, h).tolist(), strict=True):
        decay = -s.real
        damping = 1.0 if math.isinf(decay) else decay / abs(s) if s else 0.0
        found.append(Mode(pole, s, damping, 1.0 / decay if decay > 0.0 else math.inf))
    return tuple(found)
