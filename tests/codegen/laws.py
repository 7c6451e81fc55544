"""For every law a vehicle that it holds, its parameters there, and an hour's mission with noise."""

import struct
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from swimbladder.codegen.twin import twin
from swimbladder.control.law import (
    Count,
    Law,
    Measurement,
    field_types,
    from_leaves,
    from_numbers,
    is_record,
    leaf_names,
    leaves,
)
from swimbladder.control.registry import LAWS, bind
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Controller, Sensors, Vehicle
from tests.control.examples import ADRC_FAST, S_P, SEA, SLEEPER
from tests.vehicles import paper

NOISE = Sensors(depth_noise="2 mm", depth_quantum="1 mm", volume_noise="0.2 cm3")


class Example(NamedTuple):
    vehicle: Vehicle
    parameters: Any
    tick: float


def _preset(name: str) -> Example:
    vehicle = load_vehicle(name)
    return Example(vehicle, bind(vehicle.controller)[1], vehicle.controller.sample_time)


def _tuned(name: str) -> Example:
    """The paper's vehicle at 12 V with 2 mm noise, gains as the tuner makes them."""
    from swimbladder.design.tuning.gains import gains, recipe_of, setting_of

    vehicle = paper(sensors=Sensors(depth_noise="2 mm"))
    setting = setting_of(vehicle, sample_time=0.3, supply=12.0, neutral_range=5e-5)
    return Example(vehicle, gains(name, setting, recipe_of(name).example), 0.3)


def _stepper() -> Example:
    """The float with a stepper, gains as the study of the tank makes them."""
    from studies.tank_law import FITTING, position_observer_gains

    vehicle = load_vehicle("ntnu-bv")
    return Example(
        vehicle, position_observer_gains(vehicle, **FITTING), vehicle.controller.sample_time
    )


EXAMPLES: dict[str, Callable[[], Example]] = {
    "cascade": lambda: _preset("feup-em"),
    "sea-cascade": lambda: Example(load_vehicle("feup-em"), SEA, S_P),
    "adrc": lambda: Example(load_vehicle("feup-em"), ADRC_FAST, S_P),
    "deadband": lambda: Example(load_vehicle("feup-em"), SLEEPER, S_P),
    "position-pid": lambda: _preset("ntnu-bv"),
    "position-observer": _stepper,
}
"""Laws with a vehicle of their own; any other flies the paper's with its recipe's example."""


@cache
def example(name: str) -> Example:
    return EXAMPLES[name]() if name in EXAMPLES else _tuned(name)


def controlled(name: str) -> Vehicle:
    """Return a law's vehicle with a controller of that law."""
    vehicle, parameters, tick = example(name)
    numbers = {n: x for n, x in leaves(parameters).items() if n != "S_p"}
    own = Controller(law=name, sample_time=tick, parameters=numbers)
    return vehicle.model_copy(update={"controller": own})


@cache
def twin_of(name: str) -> Law:
    return twin(LAWS[name])


class Call(NamedTuple):
    """A call of a law's step: what went in, and what the twin made of it."""

    state: Any
    measurement: Measurement
    reference: float
    command: float
    after: Any
    next_s: float


@cache
def hour(name: str) -> tuple[Call, ...]:
    """Every call of a law's twin in a closed-loop mission of 12,000 ticks with noise."""
    vehicle, parameters, tick = example(name)
    law = twin_of(name)
    calls: list[Call] = []

    def controller(seen: Measurement, reference: float) -> tuple[float, float]:
        seen = Measurement(*map(np.float32, seen))
        reference = np.float32(reference)
        state = calls[-1].after if calls else law.initial(parameters, seen, reference)
        command, after, next_s = law.step(parameters, state, seen, reference)
        calls.append(Call(state, seen, reference, command, after, next_s))
        return float(command), float(next_s)

    depths = [3.0, 1.0, 1.02, 4.0, 3.9, 2.0, 2.0, 0.5, 3.5, 3.5]
    ran = simulate(
        vehicle.model_copy(update={"sensors": NOISE}),
        law=controller,
        start_depth=1.5,
        setpoints=[(1200 * n * tick, depth) for n, depth in enumerate(depths)],
        duration=12_000 * tick,
        seed=1,
        sample_time=tick,
        bottom_depth=30.0,
    )
    assert len(ran.time) == 12_001, ran.stop
    return tuple(calls)


def flat(*values: Any) -> tuple[Any, ...]:
    """Return numbers and named tuples of numbers as one tuple of numbers."""
    found: list[Any] = []
    for value in values:
        found += flat(*value) if isinstance(value, tuple) else [value]
    return tuple(found)


def bits(*values: Any) -> tuple[Any, ...]:
    """Return the bits of each number as a float32; NaN equals NaN."""
    return tuple("nan" if x != x else struct.pack("<f", x).hex() for x in flat(*values))


def layout(kind: type[Any], *, align: bool = True) -> np.dtype[Any]:
    """Return how C lays out a NamedTuple of numbers, counts, truths and such NamedTuples."""
    scalars = [(float, "<f4"), (Count, "<u2"), (bool, "?")]
    fields = [
        (n, layout(t, align=align) if is_record(t) else next(s for hint, s in scalars if hint == t))
        for n, t in field_types(kind).items()
    ]
    return np.dtype(fields, align=align)


def scalars_of(form: np.dtype[Any]) -> list[np.dtype[Any]]:
    """Return the types of the numbers in a layout."""
    inner = [kind for kind, *_ in form.fields.values()] if form.fields else []
    return [s for kind in inner for s in scalars_of(kind)] if form.fields else [form]


def laid_out(form: np.dtype[Any], *values: Any) -> bytes:
    """Return numbers and named tuples of numbers as the bytes of a layout, which may be nested."""

    def filled(part: np.dtype[Any]) -> Any:
        return next(given) if part.names is None else tuple(filled(part[n]) for n in part.names)

    given = iter(flat(*values))
    return np.array(filled(form), form).tobytes()


def in_float64(value: Any) -> Any:
    """Return a named tuple of float32 as one of floats."""
    return from_numbers(type(value), map(float, flat(value)))


def changed(record: Any, **numbers: Any) -> Any:
    """Return limits or a state with other numbers, wherever they stand."""
    return from_leaves(type(record), leaves(record) | numbers)


def split(law: Law, frame: Sequence[Any], seen: type[Any] = Measurement) -> tuple[Any, ...]:
    """Return parameters, state, what is seen and the reference of a frame of numbers."""
    p = len(leaf_names(law.parameters))
    s = p + len(leaf_names(law.state))
    parameters = from_numbers(law.parameters, frame[:p])
    return parameters, from_numbers(law.state, frame[p:s]), seen(*frame[s:-1]), frame[-1]


def random_calls(name: str, count: int) -> list[tuple[Any, ...]]:
    """Calls at random: a third ordinary, a third with odd numbers, a third of any bits at all."""
    rng = np.random.default_rng(1)
    parameters, calls = example(name).parameters, hour(name)
    odd = np.array([np.nan, np.inf, -np.inf, -0.0, 0.0, 1e-45, 1e-39, 3e38, -3e38, 1.0], "f4")
    frames = []
    for n in range(count):
        call = calls[rng.integers(len(calls))]
        values = np.array(flat(parameters, call.state, call.measurement, call.reference), "f4")
        if n % 3 == 1:
            values *= rng.uniform(0.5, 1.5, len(values)).astype("f4")
            at = rng.random(len(values)) < 0.1
            values[at] = rng.choice(odd, at.sum())
        elif n % 3 == 2:
            values = rng.integers(0, 2**32, len(values), np.uint32).view("f4")
        frames.append(tuple(values))
    return frames
