"""Laws with a wrong gain, a late command or a rounded one.

A wrapped law calls the law it wraps and multiplies its command by `gain`, before the supply's
limit, and rounds it to `quantum`. Where `late` is 1 it runs at half of the law's sample time: the
law is called at every other tick, and its command is given a half tick later, the one before being
held until then. Each law becomes one wrapped law, whose class of parameters stands in this module:
so its compiled kernel is found again.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any, NamedTuple

from swimbladder.control.law import Law

_STEP = """
def step(parameters, state, measurement, reference):
    p = parameters
    held = state.w_held
    passed = state.w_left - 0.5 * p.w_tick
    command = state.w_next
    left = passed
    inner = state.inner
    if p.w_late < 0.5 or state.w_left <= 0.25 * p.w_tick:
        raw, inner, wait = law_step(p.inner, inner, measurement, reference)
        scaled = p.w_gain * raw
        if p.w_quantum > 0.0:
            scaled = p.w_quantum * math.floor(scaled / p.w_quantum + 0.5)
        if p.w_late < 0.5:
            return scaled, State(inner, scaled, scaled, 0.0), wait
        ticks = max(math.ceil(wait / p.w_tick - 1e-9), 1)
        left = ticks * p.w_tick - 0.5 * p.w_tick
        held = command
        command = scaled
    else:
        held = command
    return held, State(inner, held, command, left), 0.5 * p.w_tick


def initial(parameters, measurement, reference):
    p = parameters
    inner = law_initial(p.inner, measurement, reference)
    rest = p.w_rest
    return State(inner, rest, rest, 0.0)
"""


class Wrapped(NamedTuple):
    """A wrapped law, and how its parameters are made."""

    law: Law
    inner: Law

    def parameters(
        self, numbers: Any, *, sample_time: float, gain: float = 1.0, late: bool = False,
        quantum: float = 0.0, rest: float = 0.0,
    ) -> Any:  # fmt: skip
        """Return the wrapped law's parameters from those of the law.

        sample_time [s]: the law's own; quantum [V]; rest [V]: command before the first one comes.
        """
        return self.law.parameters(numbers, gain, float(late), quantum, sample_time, rest)

    def tick(self, sample_time: float, *, late: bool) -> float:
        """Return the sample time to run it with [s]."""
        return 0.5 * sample_time if late else sample_time


def _record(name: str, inner: type[Any], more: tuple[str, ...]) -> Any:
    """Return a class of named tuples in this module: a law's own, and more numbers."""
    made: Any = namedtuple(name, ("inner", *more))  # type: ignore[misc]
    made.__module__, made.__annotations__ = __name__, {"inner": inner}
    globals()[name] = made
    return made


def _wrap(law: Law) -> Wrapped:
    import math

    name = "".join(part.title() for part in law.name.split("-"))
    given = ("w_gain", "w_late", "w_quantum", "w_tick", "w_rest")
    kept = ("w_held", "w_next", "w_left")
    Parameters = _record(f"Wrapped{name}Parameters", law.parameters, given)
    State = _record(f"Wrapped{name}State", law.state, kept)
    space: dict[str, Any] = {
        "__name__": __name__, "math": math, "State": State, "law_step": law.step,
        "law_initial": law.initial,
    }  # fmt: skip
    exec(_STEP, space)  # one for each law: the compiler finds it by its parameters
    units = {**law.units, "w_gain": "", "w_late": "", "w_quantum": "", "w_tick": "s", "w_rest": ""}
    return Wrapped(
        Law(
            name=f"{law.name}, wrapped", summary=f"{law.summary}; gain and delay off",
            command=law.command, parameters=Parameters, state=State, units=units,
            step=space["step"], initial=space["initial"],
        ),
        law,
    )  # fmt: skip


_WRAPPED: dict[type[Any], Wrapped] = {}


def wrapped(law: Law) -> Wrapped:
    """Return the wrapped form of a law, the same one each time."""
    if law.parameters not in _WRAPPED:
        _WRAPPED[law.parameters] = _wrap(law)
    return _WRAPPED[law.parameters]
