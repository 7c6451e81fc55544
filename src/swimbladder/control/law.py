"""What a control law is.

A law is one pure function, so that the simulator, the tuner and the firmware can hang on it::

    step(parameters, state, measurement, reference) -> (command, state, next_sample_s)

`parameters`, `state` and `measurement` are named tuples of floats, `reference` is the depth
asked for [m]. The command is a voltage [V] or, for a positioner, a volume [m3], or, for pump and
valve, a change of it [m3]. `next_sample_s`
says how long until the law wants to be called again [s]; the clock of the vehicle has whole ticks
(the controller's sample time), and the time is rounded up to them. The function uses arithmetic,
comparisons, ``min``, ``max``, ``abs`` and the `math` module only, so that it compiles.

What is counted may be a `Count`, a whole number that takes 16 bits where the law is compiled: it
grows and shrinks by `more` and `less`, which stay within them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

if TYPE_CHECKING:
    from swimbladder.control.recipe import Recipe

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


class Way(NamedTuple):
    """A speed that a law of volume changes asks for, and where it does."""

    name: str
    speed: float  # m/s, without a sign
    distance: float  # m from the depth asked for; inf: on the way to the surface


@dataclass(frozen=True, kw_only=True)
class Law:
    """A law: its step, its first state and what its numbers mean.

    parameters, state: NamedTuple classes whose fields are floats, counts or truths, the state of
    at least one field. units: the unit of each parameter. initial: (parameters, measurement,
    reference) -> state, also pure. A state field called `volume_reference` [m3] is recorded.

    What the commands need to know beyond that, where the law has it. recipe: how its parameters are
    made for a vehicle; None: it is not tuned. Names of parameters, empty where there is none:
    volume_gain, from a volume error to the voltage [V/m3]; dead_zone, volume error at which the
    motor rests [m3]; near, depth error within which the volume is moved by events [m]; band, depth
    error that is left alone [m]. With dead_zone and near at 0 the law is linear around rest, where
    it is so at all. Of a law that changes the volume when it asks to be called: ways, from its
    parameters to the speeds it asks for; roundings, bands and steps, at 0 of which what it decides
    follows what it sees without a gap.
    """

    name: str
    summary: str
    command: Literal["voltage", "volume", "volume change"]
    parameters: type[Any]
    state: type[Any]
    units: Mapping[str, str]
    step: Callable[..., Any]
    initial: Callable[..., Any]
    recipe: Recipe | None = None
    volume_gain: str = ""
    dead_zone: str = ""
    near: str = ""
    band: str = ""
    ways: Callable[[Any], Sequence[Way]] | None = None
    roundings: tuple[str, ...] = ()
