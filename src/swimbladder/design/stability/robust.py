"""What laws stand that are not linear: wrong gains and late commands over draws from the region.

Such a law is wrapped. A wrapped law calls the law it wraps and multiplies its command by `gain`,
before the supply's limit, and rounds it to `quantum`. Where `late` is 1 it runs at half of the
law's sample time: the law is called at every other tick, and its command is given a half tick
later, the one before being held until then. Each law becomes one wrapped law, whose class of
parameters stands in this module: so its compiled kernel is found again.
"""

import math
from functools import partial
from itertools import product
from typing import Annotated, Any, NamedTuple

import numpy as np

from swimbladder.control.around import State, around, law_initial, law_step
from swimbladder.control.law import Law, Measurement
from swimbladder.design.linear.margins import spectral_radius
from swimbladder.design.linear.sampled import BoundLaw, loop_of
from swimbladder.design.tuning.margins import at_rest
from swimbladder.design.tuning.region import Region
from swimbladder.design.tuning.trial import Drawn, Step, measure, traces
from swimbladder.io.progress import Advance
from swimbladder.jobs import Store
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import Vehicle

_GIVEN = {"gain": "", "late": "", "quantum": "V", "tick": "s", "rest": "V"}
_KEPT = {"next": "V", "left": ""}


def wrapped_law(law: Law) -> Law:
    """Return the wrapped form of a law, always the same."""
    return around(
        law,
        "Wrapped",
        _step,
        _initial,
        parameters={f"w_{name}": Annotated[float, unit] for name, unit in _GIVEN.items()},
        state={f"w_{name}": Annotated[float, unit] for name, unit in _KEPT.items()},
        name=f"{law.name}, wrapped",
    )


def _initial(parameters: Any, measurement: Measurement, reference: float) -> Any:
    p = parameters
    return State(law_initial(p.law, measurement, reference), p.w_rest, 0.0)


def _step(
    parameters: Any, state: Any, measurement: Measurement, reference: float
) -> tuple[float, Any, float]:
    p = parameters
    inner = state.law
    held = command = state.w_next
    left = state.w_left - 0.5 * p.w_tick
    if p.w_late < 0.5 or state.w_left <= 0.25 * p.w_tick:
        raw, inner, wait = law_step(p.law, inner, measurement, reference)
        command = p.w_gain * raw
        if p.w_quantum > 0.0:
            command = p.w_quantum * math.floor(command / p.w_quantum + 0.5)
        if p.w_late < 0.5:
            return command, State(inner, command, 0.0), wait
        ticks = max(math.ceil(wait / p.w_tick - 1e-9), 1)
        left = ticks * p.w_tick - 0.5 * p.w_tick
    return held, State(inner, command, left), 0.5 * p.w_tick


def wrapped(
    bound: BoundLaw,
    *,
    gain: float = 1.0,
    late: bool = False,
    quantum: float = 0.0,
    rest: float = 0.0,
) -> BoundLaw:
    """Return the wrapped form of a law with its parameters.

    quantum [V]; rest [V]: command before the first one comes.
    """
    law, numbers, h = bound
    form = wrapped_law(law)
    made = form.parameters(numbers, gain, float(late), quantum, h, rest)
    return BoundLaw(form, made, 0.5 * h if late else h)


GAINS = (0.5, 0.7, 1.0, 1.4, 2.0)
_SHARE = 0.02  # of a step, to which it settles


class Stood(NamedTuple):
    """What became of the draws with one gain and one delay."""

    law: str
    gain: float  # -, on the command
    delay: float  # s, beyond that of the law as it is
    settled: float  # share of the draws that are in the band over the last third
    overshoot_95: float  # -, of the step
    farthest_95: float  # m, from the set-point over the last third
    moved_95: float  # m3/s, volume moved to and fro over the last third
    radius: float  # -, worst eigenvalue over the region with this gain and delay; nan: not linear
    draws: int


def settling_band(parameters: Any, step: Step, quantum: float) -> float:
    """Return how near the set-point counts as there [m].

    2 % of the step; what a law leaves alone by intent, its `band`, where that is more; a quantum.
    """
    return max(_SHARE * abs(step.target - step.start), getattr(parameters, "band", 0.0), quantum)


def robustness(
    vehicle: Vehicle, bound: BoundLaw, step: Step, drawn: Drawn, parts: Store, advance: Advance
) -> tuple[Stood, ...]:
    """Return what a law stands: each gain, without and with half a sample of extra delay."""
    p, (law, parameters, sample_time) = plant(vehicle), bound
    rest = p.load_drive * step.start if vehicle.voltage_driven else p.psi * step.start + p.V_0
    band = settling_band(parameters, step, vehicle.sensors.depth_quantum)

    def run(gain: float, late: bool) -> list[float]:
        wrong = wrapped(bound, gain=gain, late=late, rest=rest)
        seen = traces(vehicle, wrong, step, drawn)
        found = measure(seen, float(seen.time[-1]) * 2.0 / 3.0)
        farthest = np.nan_to_num(found.farthest, nan=math.inf)
        worst = np.percentile(farthest, 95.0, method="higher")
        over, moved = np.percentile(found.overshoot, 95.0), np.nanpercentile(found.rate, 95.0)
        return [float(x) for x in (np.mean(farthest <= band), over, worst, moved)]

    found = []
    for late, gain in product((False, True), GAINS):
        asked = ("robustness", law.name, parameters, gain, late, step, drawn.runs)
        numbers = parts.get(partial(run, gain, late), *asked)
        delay = 0.5 * sample_time if late else 0.0
        radius = _radius(bound, drawn.region, step.target, gain, delay)
        found.append(Stood._make((law.name, gain, delay, *numbers, radius, drawn.runs)))
        advance(0.5 / len(GAINS))
    return tuple(found)


def _radius(
    bound: BoundLaw, region: Region | None, depth: float, gain: float, delay: float
) -> float:
    """Return the largest eigenvalue's modulus over the region, the command times a gain [-]."""
    assert region is not None  # stability
    linear = at_rest(bound.without_rest, region.plants[0], depth=depth)
    if not linear.smooth or linear.sample_time != bound.sample_time:
        return math.nan
    loops = [loop_of(p, linear, depth=depth, delay=delay) for p in region.plants]
    broken = [loop.broken_at_command() for loop in loops]
    return max(spectral_radius(one.A - gain * one.B @ one.C) for one in broken)
