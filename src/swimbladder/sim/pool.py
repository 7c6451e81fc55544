"""The identification in a pool of section 3.1, on a simulated vehicle.

The procedure (a)-(d) of control.protocol is one continuous simulation with two experiments.
`Record` is what an experiment leaves behind, also one without any of a pool's errors. K2 and T2 are
found in the records as the paper does, by eqs (26) and (27), fitted to one experiment, then
averaged. Both equations leave out psi: `psi` may be given to see what that does.
"""

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from swimbladder.control import protocol
from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.control.law import Measurement
from swimbladder.control.protocol import Does, PoolParameters, PoolState, procedure_for
from swimbladder.control.registry import bind
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.sim.closed_loop import Solution, drive, simulate
from swimbladder.vehicle import IdentifiedActuator, Vehicle

_TRAVEL = 3.0  # m from rest at which a record ends, before the hull is near surface or bottom
_REST = 10.0  # m, of rest without noise: it changes nothing where neither of them is met
_SINK = 30e-6  # m3 below neutral, of the rest on the bottom before a run


class Record(NamedTuple):
    """An experiment as the fits take it; evenly sampled, from rest at the first sample."""

    time: Array  # s, from 0
    depth: Array  # m, as the sensor said
    volume: Array  # m3, above the neutral volume
    start: float  # m, depth of rest


def still_starts(
    vehicle: Vehicle, *, dVs: Sequence[float], sample_time: float = 0.3, longest: float = 300.0
) -> tuple[Record, ...]:
    """Return experiments without noise, the volume changed at once from an exactly neutral rest.

    dVs [m3], either sign. Raises NoAnswerError where the vehicle has not travelled as far as a
    record goes after `longest` [s].
    """
    records, start = [], _REST
    time = np.arange(math.floor(longest / sample_time) + 1) * sample_time
    for dV in dVs:
        volume = np.full(len(time), vehicle.neutral_volume(start) + dV)
        s = drive(vehicle, time=time, volume=volume, start_depth=start)
        inside = np.abs(s.depth - start) <= _TRAVEL
        if inside.all():
            raise NoAnswerError(
                f"With {dV * 1e6:g} cm3 the vehicle does not travel {_TRAVEL:g} m in "
                f"{longest:g} s: give a larger volume or more time"
            )
        n = int(np.argmin(inside))
        records.append(Record(s.time[:n], s.depth[:n], np.full(n, dV), start))
    return tuple(records)


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """Step (b) or (d) of a run: the change of volume, and what followed until surface or bottom."""

    step: str  # "b" or "d"
    dV: float  # m3, asked for
    achieved: float  # m3, true volume above the neutral one once the motor stands
    pulse: float  # V
    pulse_time: float  # s
    neutral: float  # m3, mean of the last minute
    neutral_error: float  # m3, of that mean against the truth at the depth of release
    released: float  # s, in the run
    ended: float  # s, in the run
    record: Record


@dataclass(frozen=True, kw_only=True)
class PoolRun:
    """One run of the procedure: the simulation, what the sensors said, and its two experiments."""

    dV: float  # m3
    parameters: PoolParameters
    solution: Solution
    seen_depth: Array  # m
    seen_volume: Array  # m3
    phases: tuple[tuple[float, str, Does], ...]  # when each phase began [s], its step, what it does
    experiments: tuple[Experiment, ...]


def pool_parameters(
    vehicle: Vehicle,
    *,
    dV: float,
    bottom_depth: float = 4.5,
    clearance: float = 0.75,
    hold: bool = True,
) -> PoolParameters:
    """Return the procedure for a vehicle with an identified actuator and a cascade.

    dV [m3]; bottom_depth and clearance (Delta_z) [m]; hold: whether the piston is held against the
    sea after a change, or left at 0 V. Raises InputError for any other actuator or law.
    """
    a, controller, supply = vehicle.engine, vehicle.controller, vehicle.supply
    if not isinstance(a, IdentifiedActuator) or supply is None:
        what = "the timed voltage needs K1, T1 and the piston area"
        remedy = "Describe the actuator as kind identified"
        raise InputError(what, field="actuator.kind", value=a.kind, remedy=remedy)
    law, loop = bind(controller) if controller is not None else (None, None)
    if law is not CASCADE or not isinstance(loop, CascadeParameters):
        what = "the pool procedure holds the depth with the cascade"
        name, remedy = None if law is None else law.name, "Give the vehicle that controller"
        raise InputError(what, field="controller.law", value=name, remedy=remedy)
    return procedure_for(
        loop,
        rate_per_volt=a.K1 * a.piston_area,
        limit=supply.voltage,
        load_voltage=a.depth_voltage if hold else 0.0,
        bottom_depth=bottom_depth,
        clearance=clearance,
        change=dV,
    )


def pool_test(
    vehicle: Vehicle,
    *,
    dVs: Sequence[float],
    seed: int,
    bottom_depth: float = 4.5,
    clearance: float = 0.75,
    advance: Advance = silent,
) -> tuple[PoolRun, ...]:
    """Return one run, two experiments, for each change of volume [m3]; `advance` counts runs done.

    Each run has its own noise. Raises NoAnswerError as run_procedure does.
    """
    runs = []
    for i, dV in enumerate(dVs):
        parameters = pool_parameters(vehicle, dV=dV, bottom_depth=bottom_depth, clearance=clearance)
        own = int(np.random.SeedSequence([seed, i]).generate_state(1)[0])
        runs.append(run_procedure(vehicle, parameters, bottom_depth=bottom_depth, seed=own))
        advance(1.0)
    return tuple(runs)


def run_procedure(
    vehicle: Vehicle,
    parameters: PoolParameters,
    *,
    bottom_depth: float,
    seed: int | None,
    duration: float = 1800.0,
) -> PoolRun:
    """Return one run: from rest on the bottom, a little below neutral, through (a) to (d).

    Raises NoAnswerError where a phase takes longer than the procedure has patience for, or all of
    it longer than `duration` [s].
    """
    notes: list[tuple[Measurement, PoolState, float]] = []
    named = parameters.phases

    def law(seen: Measurement, _: float) -> tuple[float, float]:
        """Return the procedure's command [V] and when to ask again [s], and note both."""
        before = notes[-1][1] if notes else protocol.initial(parameters, seen, 1.0)
        u, state, next_s = protocol.step(parameters, before, seen, 1.0)
        notes.append((seen, state, u))
        return u, next_s

    s = simulate(
        vehicle,
        setpoints=[(0.0, bottom_depth)],
        duration=duration,
        start_depth=bottom_depth,
        start_volume=vehicle.neutral_volume(bottom_depth) - _SINK,
        bottom_depth=bottom_depth,
        seed=seed,
        law=law,
        sample_time=parameters.loop.S_p,
        checked=False,
    )
    index = np.array([int(state.phase) for _, state, _ in notes])
    began = {int(i): int(np.argmax(index == i)) for i in np.unique(index)}
    phases = tuple((float(s.time[k]), named[i].step, named[i].does) for i, k in began.items())
    _check_over(s, phases)
    seen_depth = np.array([seen.depth for seen, _, _ in notes])
    seen_volume = np.array([seen.volume for seen, _, _ in notes])
    experiments = []
    for i in (i for i, phase in enumerate(named) if phase.does is Does.PULSE):
        halted, first, glide, last = (began[i + j] for j in (-1, 0, 1, 2))
        neutral = notes[first][1].neutral
        start = float(np.mean(seen_depth[halted : first + 1]))
        beyond = np.abs(seen_depth[first:last] - start) > _TRAVEL
        part = slice(first, first + int(np.argmax(np.append(beyond, True))))
        time = s.time[part] - s.time[first]
        stands = min(glide + math.ceil(1.0 / parameters.loop.S_p), last)
        experiments.append(
            Experiment(
                step=named[i].step,
                dV=named[i].target,
                achieved=float(s.volume[stands]) - neutral,
                pulse=notes[first][2],
                pulse_time=float(s.time[glide] - s.time[first]),
                neutral=neutral,
                neutral_error=neutral - vehicle.neutral_volume(float(s.depth[first])),
                released=float(s.time[first]),
                ended=float(s.time[last]),
                record=Record(time, seen_depth[part], seen_volume[part] - neutral, start),
            )
        )
    return PoolRun(
        dV=parameters.change,
        parameters=parameters,
        solution=s,
        seen_depth=seen_depth,
        seen_volume=seen_volume,
        phases=phases,
        experiments=tuple(experiments),
    )


def _check_over(s: Solution, phases: tuple[tuple[float, str, Does], ...]) -> None:
    """Raise NoAnswerError unless the simulation and the procedure came to their end."""
    if not s.finished:
        raise NoAnswerError(f"The pool procedure stopped at {s.time[-1]:.0f} s: {s.stop.value}")
    if phases[-1][2] is Does.DONE:
        return
    time, step, does = phases[-2] if phases[-1][2] is Does.GAVE_UP else phases[-1]
    raise NoAnswerError(
        f"The pool procedure did not end: in step ({step}), from {time:.0f} s on, it waited for "
        f"the end of this: {does.value} Allow more time, or more speed at rest"
    )


def timed_travel(
    u: float, time: float, *, K1: float, T1: float, opposing: float = 0.0, speed: float = 0.0
) -> tuple[float, float]:
    """Return how far a piston has gone [m] when a timed voltage ends, and once it stands.

    u [V] for `time` [s]; K1 [m/s/V] and T1 [s] of eqs (21)-(22); opposing: voltage that the depth
    takes away, k_z/k_u z [V], and that afterwards holds the piston; speed: of the piston at first
    [m/s].
    At the end of the voltage the travel is short of what was asked for, K1 u time, by
    K1 u T1 (1 - exp(-time/T1)); the motor then coasts by as much. What stays is
    speed T1 - K1 opposing time.
    """
    steady = K1 * (u - opposing)
    at_end = steady * time + (steady - speed) * T1 * math.expm1(-time / T1)
    speed_then = steady + (speed - steady) * math.exp(-time / T1)
    return at_end, at_end + speed_then * T1


class Fit(NamedTuple):
    """K2 and T2 of one experiment, of several together, or their average."""

    K2: float  # 1/m2/s
    T2: float  # s
    rms: float  # of what the model leaves over: m for depth, m/s for speed


def response(
    time: ArrayLike, volume: ArrayLike, *, K2: float, T2: float, psi: float = 0.0
) -> tuple[Array, Array]:
    """Return (travel [m], speed [m/s]) from rest under a volume above neutral, eqs (25)-(27).

    time [s], even; volume [m3], taken as linear between samples, for which the result is exact;
    psi [m3/m]: of eq. (32), 0 in (26) and (27). A psi that makes both poles equal is not handled.
    """
    t, v = np.asarray(time, float), np.asarray(volume, float)
    h = float(t[1] - t[0])
    root = cmath.sqrt(1.0 + 4.0 * psi * K2 * T2)
    fast = -(1.0 + root) / (2.0 * T2)
    slow = -psi * K2 / T2 / fast  # from the product of the poles: no cancellation
    a, b = _mode(slow, v, h), _mode(fast, v, h)
    factor = -K2 / T2 / (slow - fast)
    return (factor * (a - b)).real, (factor * (slow * a - fast * b)).real


def _mode(pole: complex, v: Array, h: float) -> NDArray[np.complex128]:
    """Return y of y' = pole y + v from y = 0, v linear between samples h apart."""
    x = pole * h
    if abs(x) < 1e-3:
        end = h * (1.0 / 2.0 + x / 6.0 + x * x / 24.0 + x**3 / 120.0)
        both = h * (1.0 + x / 2.0 + x * x / 6.0 + x**3 / 24.0)
    else:
        both = (cmath.exp(x) - 1.0) / pole
        end = (both - h) / x
    from scipy.signal import lfilter  # half a second that few need

    driven = np.append(0.0, (both - end) * v[:-1] + end * v[1:])
    return np.asarray(lfilter([1.0], [1.0, -cmath.exp(x)], driven), np.complex128)


def fit_depth(record: Record, *, psi: float = 0.0) -> Fit:
    """Return K2 and T2 of eq. (27), V to z, by least squares; of eq. (32) with psi [m3/m] given."""
    return fit_jointly([record], psi=psi)


def fit_jointly(records: Sequence[Record], *, psi: float = 0.0) -> Fit:
    """Return one K2 and T2 for several experiments together, eq. (27) or, with psi, (32)."""

    def residual(K2: float, T2: float) -> Array:
        travels = [response(r.time, r.volume, K2=K2, T2=T2, psi=psi)[0] for r in records]
        pairs = zip(records, travels, strict=True)
        return np.concatenate([r.start + travel - r.depth for r, travel in pairs])

    return _fit(residual)


def fit_speed(record: Record) -> Fit:
    """Return K2 and T2 of eq. (26), V to dz/dt, to the centred differences of the depth."""
    speed = np.gradient(record.depth, float(record.time[1] - record.time[0]))

    def residual(K2: float, T2: float) -> Array:
        return response(record.time, record.volume, K2=K2, T2=T2)[1] - speed

    return _fit(residual)


def _fit(residual: Callable[[float, float], Array]) -> Fit:
    def of_logarithms(x: Array) -> Array:  # in which both stay positive
        return residual(math.exp(x[0]), math.exp(x[1]))

    begin = [math.log(1e4), math.log(40.0)]
    with np.errstate(over="ignore", invalid="ignore"):  # such a trial step is taken back
        found = least_squares(of_logarithms, begin, xtol=1e-10, ftol=1e-12, gtol=1e-12)
    K2, T2 = np.exp(found.x).tolist()
    return Fit(K2, T2, float(np.sqrt(np.mean(found.fun**2))))


def average(fits: Sequence[Fit]) -> Fit:
    """Return the means of K2, T2 and rms, as Table 2 gives them."""
    return Fit(*(float(np.mean(values)) for values in zip(*fits, strict=True)))
