"""What a control law is, and how its parameters follow from a vehicle's numbers.

A law is one pure function, so that the simulator, the tuner and the firmware can hang on it::

    step(parameters, state, measurement, reference) -> (command, state, next_sample_s)

`parameters`, `state` and `measurement` are named tuples of floats, `reference` is the depth
asked for [m]. The command is a voltage [V] or, for a positioner, a volume [m3], or, for pump and
valve, a change of it [m3]. `next_sample_s` says how long until the law wants to be called again
[s]; the clock of the vehicle has whole ticks (the controller's sample time), and the time is
rounded up to them. The function uses arithmetic, comparisons, ``min``, ``max``, ``abs`` and the
`math` module only, so that it compiles.

What is counted may be a `Count`, a whole number that takes 16 bits where the law is compiled: it
grows and shrinks by `more` and `less`, which stay within them.

A law's file has its `Recipe`: from it `tune` and `compare-laws` learn what to try, as natural
frequencies and dampings, which mean the same for every vehicle, and how parameters are made of
that. What several laws share stands here; what takes matrices, in `motion`, which is loaded when
gains are made.

Parameters and states may be named tuples within named tuples. A number that is not a record itself
is a leaf. Files, commands and reports name the leaves of a
law's parameters, wherever they stand; the names of the records between are for its source.

A law may be made around another one: its records hold those of that one, and its step calls it.
`around` makes it of a step and a first state that are written once, for any law within. In these
`law_step` and `law_initial` are the functions of the law within, and `State` is the class of the
new law's state. They stand in the functions' own names, not in a closure, so that the compiler and
the translation to C find them as they find any other function.
"""

from __future__ import annotations

import math
import sys
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from types import FunctionType, MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, TypeVar

from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.physics.dynamics import Plant


Kind = TypeVar("Kind")
Found = TypeVar("Found")


def _once(find: Callable[[type[Any]], Found]) -> Callable[[type[Any]], Found]:
    """Find something of a class of records once."""
    remembered: Any = cache
    found: Callable[[type[Any]], Found] = remembered(find)
    return found


@_once
def is_record(kind: type[Any]) -> bool:
    """Return whether a field's type is a named tuple."""
    return isinstance(kind, type) and hasattr(kind, "_fields")


@_once
def field_types(kind: type[Any]) -> Mapping[str, Any]:
    """Return the type of each field of a named tuple as it is annotated, float where it is not.

    Without its unit: that of `Annotated[float, "m3"]` is float.
    """
    return MappingProxyType({name: written for name, (written, _) in _fields(kind).items()})


@_once
def units(kind: type[Any]) -> Mapping[str, str]:
    """Return the units of the fields and leaves of a record that are annotated with one."""
    found: dict[str, str] = {}
    for name, (written, unit) in _fields(kind).items():
        found |= units(written) if is_record(written) else {}
        found |= {name: unit} if unit is not None else {}
    return MappingProxyType(found)


@_once
def _fields(kind: type[Any]) -> Mapping[str, tuple[Any, str | None]]:
    """Return type and unit of each field."""
    module, found = vars(sys.modules[kind.__module__]), {}
    for field in kind._fields:
        written = getattr(kind, "__annotations__", {}).get(field, float)
        if isinstance(written, typing.ForwardRef):
            written = written.__forward_arg__
        if isinstance(written, str):
            with suppress(NameError):  # a class within a function: its names are not at hand
                written = eval(written, dict(module))
        unit = None
        if typing.get_origin(written) is typing.Annotated:
            base, *said = typing.get_args(written)
            counted = [base, *said[:1]] == list(typing.get_args(Count))
            unit = next(iter(said[counted:]), None)
            written = Count if counted else base
        found[field] = (written, unit)
    return found


@_once
def leaf_names(kind: type[Any]) -> tuple[str, ...]:
    """Return the names of a law's parameters, in their order.

    Raises InputError where two of them share a name.
    """
    found: list[str] = []
    for field, written in field_types(kind).items():
        found.extend(leaf_names(written) if is_record(written) else (field,))
    twice = next((name for n, name in enumerate(found) if name in found[:n]), None)
    if twice is not None:
        what = f"the field {twice!r} stands in {kind.__name__} twice"
        remedy = "Give each number a name of its own, also across nested NamedTuples"
        raise InputError(what, field=kind.__qualname__, remedy=remedy)
    return tuple(found)


def numbers(record: Any) -> Iterator[Any]:
    """Yield the leaves of a record, in their order."""
    for value in record:
        if isinstance(value, tuple):
            yield from numbers(value)
        else:
            yield value


def leaves(record: Any) -> dict[str, Any]:
    """Return the leaves of a record by name."""
    return dict(zip(leaf_names(type(record)), numbers(record), strict=True))


def from_numbers(kind: type[Kind], given: Iterable[Any]) -> Kind:
    """Return a record of its leaves in their order."""
    left = iter(given)

    def made(kind: type[Any]) -> Any:
        return kind(*[made(record) if record else next(left) for record in _nested(kind)])

    found: Kind = made(kind)
    return found


@_once
def _nested(kind: type[Any]) -> tuple[type[Any] | None, ...]:
    """Return the records among a record's fields, None for those that are numbers."""
    return tuple(t if is_record(t) else None for t in field_types(kind).values())


def from_leaves(kind: type[Kind], values: Mapping[str, Any]) -> Kind:
    """Return a record of the values of its leaves; those beyond its own are ignored."""
    return from_numbers(kind, (values[name] for name in leaf_names(kind)))


NEVER = 65535  # the largest count
Count = Annotated[int, "0 to 65535"]


def more(n: Count, by: Count) -> Count:
    """Return n + by, 65535 at most."""
    return min(n + by, NEVER)


def less(n: Count, by: Count) -> Count:
    """Return n - by, 0 at least."""
    return n - by if n > by else 0


class Measurement(NamedTuple):
    """What the controller sees at a sample."""

    time: float  # s
    depth: float  # m, of the pressure sensor
    volume: float  # m3, from the piston's or the bladder's sensor
    battery: float = math.nan  # V, under whatever load there is; NaN: not measured, or of no use


class Way(NamedTuple):
    """A speed that a law of volume changes asks for, and where it does."""

    name: str
    speed: float  # m/s, without a sign
    distance: float  # m from the depth asked for; inf: on the way to the surface


@dataclass(frozen=True, kw_only=True)
class Law:
    """A law: its step, its first state and what its numbers mean.

    parameters, state: NamedTuple classes whose fields are floats, counts or truths, the state of
    at least one field; a parameter is annotated with its unit, `Annotated[float, "m3/s"]`.
    initial: (parameters, measurement, reference) -> state, also pure. A state field called
    `volume_reference` [m3] is recorded.

    What the commands need to know beyond that, where the law has it. recipe: how its parameters are
    made for a vehicle; None: it is not tuned. Names of parameters, empty where there is none:
    volume_gain, from a volume error to the voltage [V/m3]; dead_zone, volume error at which the
    motor rests [m3]; near, depth error within which the volume is moved by events [m]; band, depth
    error that is left alone [m]. With dead_zone and near at 0 the law is linear around rest, where
    it is so at all. longest_wait: from its parameters to the longest that it waits for its next
    call [s]; a board takes one that waits for longer for broken, and of a law that has none one
    that waits for longer than a command may fail to come. roundings: bands, steps and friction that
    is fed forward, at 0 of which what it decides follows what it sees without a gap. ways: of a law
    that changes the volume when it asks to be called, the speeds it asks for. within: the law that
    it is made around, see `around`.
    """

    name: str
    summary: str
    command: Literal["voltage", "volume", "volume change"]
    parameters: type[Any]
    state: type[Any]
    step: Callable[..., Any]
    initial: Callable[..., Any]
    recipe: Recipe | None = None
    volume_gain: str = ""
    dead_zone: str = ""
    near: str = ""
    band: str = ""
    longest_wait: Callable[[Any], float] | None = None
    ways: Callable[[Any], Sequence[Way]] | None = None
    roundings: tuple[str, ...] = ()
    within: Law | None = None

    @property
    def units(self) -> Mapping[str, str]:
        """The unit of each parameter that is annotated with one."""
        return units(self.parameters)

    def rests(self, parameters: Any) -> bool:
        """Return whether the actuator rests where a law of such parameters holds a depth."""
        values = leaves(parameters)
        return any(values[n] > 0.0 for n in (self.dead_zone, self.near, self.band) if n)


Laws = Sequence[tuple[Law, Any]]
"""Laws, each with its parameters."""


class Friction(NamedTuple):
    """Dry friction of the motor, fed forward; none where a controller's parameters leave it out."""

    friction: Annotated[float, "V"]
    locked: Annotated[float, "V/m"]  # of the load that it takes to go out: does not push it in


SMOOTH = Friction(0.0, 0.0)


def friction_voltage(drive: float, p: Friction, depth: float) -> float:
    """Return the voltage [V] that dry friction takes of a motor which `drive` [V] is to move."""
    if drive > 0.0:
        return p.friction
    if drive < 0.0:
        return -p.friction - p.locked * depth
    return 0.0


_COMPENSATED = 0.9  # of dry friction: more than there is would move the motor by itself


def smooth(law: Law, parameters: Any) -> Any:
    """Return a law's parameters without its roundings."""
    return from_leaves(type(parameters), leaves(parameters) | dict.fromkeys(law.roundings, 0.0))


STROKE = 0.5  # of the stroke to the nearer end: what a path may take to accelerate
_CRUISE = 0.25  # the same to keep a speed
_SHORTEST = 10.0  # samples, of a target's way


class TuningParameters(NamedTuple):
    """What a law is tuned with.

    frequency [rad/s] and damping [-] of the depth under feedback; inner [1/s]: rate at which the
    volume follows; sharpness [-]: bandwidth of the filter over `frequency`; learning [-]: how fast
    the neutral volume is learnt, as a share of what the filter could (adrc: bandwidth of the
    disturbance's estimate over `frequency`); share [-]: of the motor's speed that a path takes;
    dead [m3]: volume error that the motor rests at; pause [s]: how long a volume is made to be held
    and an error is predicted ahead near the set-point (deadband: sleep); band [m]: predicted depth
    errors that are left alone (deadband: depth errors); pulse [-]: time that a pulse of the law
    pulse takes, as a share of `pause`; volts [-]: share of the supply in use.
    """

    frequency: float
    damping: float
    inner: float
    sharpness: float = 6.0
    learning: float = 0.01
    share: float = 0.8
    dead: float = 0.0
    pause: float = 0.0
    band: float = 0.0
    pulse: float = 0.1
    volts: float = 1.0


class Drive(NamedTuple):
    """A pump and valve over a range of depths, at their slowest."""

    rate_out: float  # m3/s of the pump, with the least of the supply
    rate_in: float  # m3/s of the valve
    start: float  # m3 by which a start of the pump falls short
    tick: float  # s, step of the time of a run
    longest: float  # s, of a run of the pump
    room: float  # m3 from the neutral volume to the nearer end of the stroke


class Setting(NamedTuple):
    """The vehicle as the gains see it: nominal, with the least of the supply."""

    plant: Plant
    sample_time: float  # s
    noise: float  # m, of a measured depth, quantum included
    limit: float  # V, least supply
    neutral_range: float  # m3, how far the neutral volume may be from what is known
    least_move: float  # m3, below which a volume is lost in noise
    random_walk: float  # m3/s^0.5, intensity of the neutral volume's random walk
    drive: Drive | None = None  # of a pump and valve


class Grid(NamedTuple):
    """Tuning parameters that are combined."""

    inner: tuple[float, ...]  # of the volume's error that a sample closes
    frequency: tuple[float, ...]  # shares of the inner rate
    damping: tuple[float, ...] = (1.0,)
    sharpness: tuple[float, ...] = (1.0,)
    learning: tuple[float, ...] = (1.0,)


_QUICK = (0.08, 0.12, 0.14, 0.16, 0.18, 0.2, 0.23)
_SLOW = (0.042, 0.046, 0.05, 0.06, 0.07, 0.08, 0.12)
_LEARNT = (1.0, 0.7, 0.4, 0.2, 0.1, 0.03)
FAST = Grid((0.3, 0.45), _QUICK, (0.8, 1.0), (5.0, 8.0, 12.0), (0.003, 0.01, 0.03))
QUIET = Grid((0.3,), _SLOW, (0.7, 0.85, 1.0), (3.0, 4.0, 5.0, 6.0), _LEARNT)


_EXAMPLE = TuningParameters(frequency=0.35, damping=0.9, inner=1.2)


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """How the parameters of a law are made, and what `tune` tries.

    gains: (vehicle's numbers, tuning) -> parameters, pure. fast, quiet: what is combined for these
    goals (quiet: for energy too); None: it is not tuned for that. linear: around rest it has
    margins. shares: of the motor's speed that a path takes, tried for fast. jitter: (parameters,
    vehicle's numbers) -> what the noise makes of the volume asked for [m3], 1 sigma, for laws whose
    dead zone is chosen by it. holds: for how long a volume is held near the set-point, in times of
    `motion.drift_time`, of laws that rest there. sleeps: of laws that sleep, in times of
    `motion.e_folding_time`. bands: that go with either, in times of the depth error allowed. volts:
    shares of the supply, tried for energy. holds_best: no other law of its kind holds a depth more
    quietly. example: tuning with which the paper's vehicle shows all of the law, for tests.

    A law of volume changes is tuned with numbers of its own. candidates: (vehicle's numbers, goal,
    error of the depth allowed [m]) -> what is tried; NoAnswerError says what leaves nothing. lasts:
    (vehicle's numbers, way [m], goal) -> how long a trial lasts [s]. held: error of the depth that
    is allowed where nothing is said [m].
    """

    gains: Callable[[Setting, Any], Any]
    candidates: Callable[[Setting, str, float], Sequence[Any]] | None = None
    lasts: Callable[[Setting, float, str], float] | None = None
    held: float = 0.0
    fast: Grid | None = None
    quiet: Grid | None = None
    linear: bool = True
    shares: tuple[float, ...] = ()
    jitter: Callable[[Any, Setting], float] | None = None
    holds: tuple[float, ...] = ()
    sleeps: tuple[float, ...] = ()
    bands: tuple[float, ...] = ()
    volts: tuple[float, ...] = (0.25, 0.5, 1.0)
    holds_best: bool = False
    example: Any = _EXAMPLE


def stiffness(p: Plant) -> tuple[float, float]:
    """Return (drag [1/s], buoyancy [1/m2/s2]): w' = a (psi z - V) - d w about rest."""
    return (p.d_l if p.epsilon > 0.0 else p.d_b), p.a_b


def room_of(p: Plant) -> float:
    """Return the volume from neutral at the surface to the nearer end of the stroke [m3]."""
    return min(p.V_max - p.V_0, p.V_0 - p.V_min)


def friction_of(p: Plant) -> Friction:
    """Return what of a motor's dry friction is fed forward."""
    return Friction(_COMPENSATED * p.friction, _COMPENSATED * (p.load_drive - p.load_back))


def jerk_of(s: Setting, k: TuningParameters) -> float:
    """Return the jerk [m/s3] that a share of the motor's speed gives."""
    return k.share * s.plant.gain * s.limit * k.volts * stiffness(s.plant)[1]


def fastest_speed(p: Plant, jerk: float) -> float:
    """Return a speed [m/s] for which neither accelerating nor keeping it takes the stroke."""
    d, a = stiffness(p)
    room = room_of(p)
    force = _CRUISE * room * a
    speed = (STROKE * room * a) ** 2 / jerk
    if d + p.d_t <= 0.0:
        return speed
    return min(speed, 2.0 * force / (d + math.sqrt(d * d + 4.0 * p.d_t * force)))


def target_numbers(s: Setting, k: TuningParameters) -> dict[str, float]:
    """Return what sea-cascade and adrc have in common: how the target moves, and the limits."""
    p, jerk = s.plant, jerk_of(s, k)
    return {
        "leash": 0.0,
        "fastest": fastest_speed(p, jerk),
        "jerk": jerk,
        "shortest": _SHORTEST * s.sample_time,
        "psi": p.psi,
        "depth_voltage": p.load_drive,
        "rate_per_volt": p.gain,
        "voltage_limit": k.volts * s.limit,
        "volume_min": p.V_min,
        "volume_max": p.V_max,
        "S_p": s.sample_time,
    }


_MADE: dict[tuple[str, type[Any]], Law] = {}


def law_step(
    parameters: Any, state: Any, measurement: Measurement, reference: float
) -> tuple[float, Any, float]:
    """Stand for the step of the law within."""
    raise NotImplementedError


def law_initial(parameters: Any, measurement: Measurement, reference: float) -> Any:
    """Stand for the first state of the law within."""
    raise NotImplementedError


def State(law: Any, *more: Any) -> Any:  # a class in the functions that are made
    """Stand for the state of the new law: that of the law within, then what `around` is given."""
    raise NotImplementedError


def around(
    law: Law,
    kind: str,
    step: Callable[..., Any],
    initial: Callable[..., Any],
    *,
    parameters: Mapping[str, Any],
    state: Mapping[str, Any],
    **changed: Any,
) -> Law:
    """Return a law made around another, always the same one.

    kind: what the classes of its records begin with; they stand in the module of `step`, so that
    its compiled kernel is found again. parameters, state: fields and their types beyond `law`, that
    of the law within. changed: of the other fields of the law.
    """
    key = kind, law.parameters
    if key not in _MADE:
        module = step.__module__
        name = kind + "".join(part.title() for part in law.name.split("-"))
        Parameters = _record(module, f"{name}Parameters", law.parameters, parameters)
        Made = _record(module, f"{name}State", law.state, state)
        own = {"law_step": law.step, "law_initial": law.initial, "State": Made}
        _MADE[key] = replace(
            law,
            parameters=Parameters,
            state=Made,
            step=_with(step, own),
            initial=_with(initial, own),
            recipe=None,
            within=law,
            **changed,
        )
    return _MADE[key]


def _record(module: str, name: str, within: type[Any], more: Mapping[str, Any]) -> Any:
    """Return a class of named tuples in a module: the law's own, and more."""
    make: Any = NamedTuple
    made = make(name, [("law", within), *more.items()])
    made.__module__ = module
    setattr(sys.modules[module], name, made)
    return made


def _with(function: Callable[..., Any], names: Mapping[str, Any]) -> Callable[..., Any]:
    """Return a function to which some names mean something else."""
    assert isinstance(function, FunctionType)
    space = {**function.__globals__, **names}
    made = FunctionType(function.__code__, space, function.__name__, function.__defaults__)
    made.__doc__, made.__module__ = function.__doc__, function.__module__
    made.__annotations__ = function.__annotations__
    return made
