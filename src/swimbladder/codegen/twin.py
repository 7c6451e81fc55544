"""The twin of a law: the tree of `tree` run in Python with numpy's float32, one rounding per step.

It stands for the compiled C, to the last bit, where C is compiled with IEEE 754 arithmetic and
without contraction; a NaN stands for any NaN. `ControllerTwin` and `VehicleTwin` stand for
``swb_controller`` and ``swb_vehicle`` (``templates/swb_controller.c.j2``, ``swb_vehicle.c.j2``): a
law called by a counter of ticks, under its supervisor. A controller limits the law's
command and holds the last one while none is to be had; a vehicle's supervisor overrides it.
"""

import dataclasses
import math
from collections import namedtuple
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from swimbladder.codegen import tree
from swimbladder.codegen.subset import read_law
from swimbladder.control import supervisor
from swimbladder.control.arming import ARMING, DISARMED, ArmingParameters, Deck
from swimbladder.control.law import NEVER, Law, Measurement, less, more, numbers
from swimbladder.control.supervisor import SUPERVISOR, Reason, SupervisorParameters, Watched


def twin(law: Law, program: tree.Program | None = None) -> Law:
    """Return the law in float32: `step` and `initial` take any numbers, and round them first.

    Raises InputError, as `read_law`, where the law cannot be translated.
    """
    made = read_law(law) if program is None else program
    text = _Text(made)
    exec(compile(text.source, f"<float32 twin of {law.name}>", "exec"), text.space)

    def in_float32(function: tree.Function) -> Callable[..., Any]:
        """Return the twin's function, its arguments rounded to the C types of its parameters."""

        def call(*given: Any) -> Any:
            values = zip(function.parameters, given, strict=True)
            with np.errstate(all="ignore"):
                return text.space[text.names[function]](*(rounded(k, v) for (_, k), v in values))

        return call

    step, initial = in_float32(made.step), in_float32(made.initial)
    return dataclasses.replace(law, step=step, initial=initial)


def rounded(kind: tree.Type, value: Any) -> Any:
    """Return a number, or a named tuple of numbers, as float32, or as the count or truth it is."""
    if isinstance(kind, tree.Record):
        make: Callable[..., Any] = kind.kind or tuple
        return make(*(rounded(k, v) for (_, k), v in zip(kind.fields, value, strict=True)))
    if kind == tree.COUNT:
        return min(max(int(value), 0), NEVER)
    return bool(value) if kind == tree.BOOL else np.float32(value)


def _least(a: Any, b: Any) -> Any:
    return b if b < a else a


def _most(a: Any, b: Any) -> Any:
    return b if b > a else a


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "min": _least,
    "max": _most,
    "abs": abs,
    "sqrt": np.sqrt,
    "isfinite": np.isfinite,
    "copysign": np.copysign,
    "float": np.float32,
    "more": more,
    "less": less,
}
_FORMS: dict[type[Any], str] = {  # of the parts, in brackets wherever one might ask
    tree.Field: "{of}.{name}",
    tree.Minus: "(-{of})",
    tree.Not: "(not {of})",
    tree.Binary: "({left} {operator} {right})",
    tree.Compare: "({left} {operator} {right})",
    tree.Choice: "({yes} if {condition} else {no})",
}


class _Text:
    """A program as Python source, and the names that it needs."""

    def __init__(self, program: tree.Program) -> None:
        self.space: dict[str, Any] = {f"{name}_": known for name, known in _FUNCTIONS.items()}
        self._numbers: dict[str, str] = {}
        for record in program.records:
            kind = record.kind or namedtuple(record.name, [n for n, _ in record.fields])
            self.space[f"{record.name}__"] = kind
        functions = list(dict.fromkeys([*program.helpers, program.initial, program.step]))
        self.names = {f: f"function{n}_{f.name}" for n, f in enumerate(functions)}
        self.source = "\n\n".join(self._function(f) for f in functions) + "\n"

    def _function(self, function: tree.Function) -> str:
        given = ", ".join(name for name, _ in function.parameters)
        lines = [f"def {self.names[function]}({given}):"]
        self._block(lines, function.body, "    ")
        return "\n".join(lines)

    def _block(self, lines: list[str], statements: tuple[tree.Statement, ...], indent: str) -> None:
        if not statements:
            lines.append(f"{indent}pass")
        for s in statements:
            if isinstance(s, tree.Assign):
                lines.append(f"{indent}{s.name} = {self._value(s.value)}")
            elif isinstance(s, tree.Return):
                lines.append(f"{indent}return {self._value(s.value)}")
            elif isinstance(s, tree.For):
                lines.append(f"{indent}for {s.counter} in range({s.count}):")
                self._block(lines, s.body, indent + "    ")
            elif isinstance(s, tree.If):
                lines.append(f"{indent}if {self._value(s.condition)}:")
                self._block(lines, s.yes, indent + "    ")
                lines.append(f"{indent}else:")
                self._block(lines, s.no, indent + "    ")

    def _number(self, value: float) -> str:
        with np.errstate(all="ignore"):
            number = np.float32(value)
        name = self._numbers.setdefault(number.tobytes().hex(), f"number{len(self._numbers)}_")
        self.space[name] = number
        return name

    def _value(self, e: Any) -> str:
        """Return an expression."""
        if type(e) in _FORMS:
            parts = {
                name: part if isinstance(part, str) else self._value(part)
                for name, part in vars(e).items()
                if name != "type"
            }
            return _FORMS[type(e)].format(**parts)
        if isinstance(e, tree.Number) and e.type != tree.FLOAT:
            return str(int(e.value) if e.type == tree.COUNT else bool(e.value))
        if isinstance(e, tree.Number | tree.Constant):
            return self._number(e.value)
        if isinstance(e, tree.Name):
            return f"float_({e.name})" if e.type == tree.INT else e.name
        if isinstance(e, tree.Logic):
            return f"({f' {e.operator} '.join(map(self._value, e.of))})"
        if isinstance(e, tree.Builtin) and e.name == "count":
            (counter,) = e.arguments
            assert isinstance(counter, tree.Name)
            return counter.name
        if isinstance(e, tree.Builtin):
            called, given = f"{e.name}_", e.arguments
        elif isinstance(e, tree.Call):
            called, given = self.names[e.function], e.arguments
        else:
            called, given = f"{e.type.name}__", e.values
        return f"{called}({', '.join(map(self._value, given))})"


MOST_TICKS = 1_000_000
SOON = 3  # ticks: a push that lasted longer has been judged before a reset


def wait_in_ticks(next_s: Any, tick_s: Any) -> int:
    """Return how many whole ticks there are until a law's next call, one at least.

    next_s, tick_s: float32 [s]. A thousandth of a tick is rounding.
    """
    with np.errstate(all="ignore"):
        if not np.float32(next_s) > np.float32(1.001) * np.float32(tick_s):
            return 1
        ticks = np.float32(next_s) / np.float32(tick_s)
    if ticks >= np.float32(MOST_TICKS):
        return MOST_TICKS
    whole = int(ticks)
    return whole + 1 if ticks - np.float32(whole) > np.float32(0.001) else whole


@cache
def supervisor_twin() -> Law:
    """Return the supervisor in float32, which is every vehicle's."""
    return twin(SUPERVISOR, read_law(SUPERVISOR, Watched))


@cache
def arming_twin() -> Law:
    """Return what arms a vehicle in float32, which is every vehicle's."""
    return twin(ARMING, read_law(ARMING, Deck))


class ControllerTwin:
    """What the microcontroller does at every tick, in float32.

    law: a law's `twin`; limits: of the command; first: the command until there is one;
    seconds: the command is seconds of pump and valve, and the volume need not be measured.
    `most` is the ticks that the law may wait: one that wants to wait for longer gave no command.
    `number` is what its numbers are: float32, as in C.
    """

    number: Callable[[float], Any] = np.float32
    most: int = MOST_TICKS

    def __init__(
        self,
        law: Law,
        parameters: Any,
        *,
        tick_s: float,
        limits: tuple[float, float],
        first: float = 0.0,
        seconds: bool = False,
    ) -> None:
        self.law, self.parameters = law, parameters
        self.tick_s = self.number(tick_s)
        self.low, self.high = map(self.number, limits)
        self.command, self.seconds = np.float32(first), seconds
        self.state: Any = None
        self.ticks = 0
        self.waiting = 0
        self.missed = 0

    def tick(self, depth: float, volume: float, reference: float, battery: float = math.nan) -> Any:
        """Return the command from this tick on, of what is measured and the depth asked for.

        depth [m], volume [m3] and battery [V] at it, NaN: not measured.

        Where no depth is asked for, the law's command or new state is not finite, or it wants to
        wait for too long, only `missed` is changed: it counts these.
        """
        if not 0 < self.waiting <= self.most:
            time: Any = self.number(self.ticks) * self.tick_s
            seen: tuple[Any, ...] = (time, *map(self.number, (depth, volume, battery)))
            self._call(Measurement(*seen), self.number(reference))
        self.waiting -= 1
        self.ticks += 1
        return self.command

    def sleep(self, ticks: int) -> int:
        """Pass over ticks in which the command held, `waiting` at most; return how many."""
        slept = min(ticks, self.waiting if self.waiting <= self.most else 0)
        self.waiting -= slept
        self.ticks += slept
        return slept

    def _call(self, seen: Measurement, reference: Any) -> None:
        self.waiting = 1
        state = self.state
        if not math.isfinite(reference):
            self.missed += 1
            return
        if state is None:
            needed = (seen.depth, 0.0 if self.seconds else seen.volume)
            if not all(map(math.isfinite, needed)):
                self.missed += 1
                return
            state = self.law.initial(self.parameters, seen, reference)
        command, after, next_s = self.law.step(self.parameters, state, seen, reference)
        waiting = wait_in_ticks(next_s, self.tick_s)
        if waiting > self.most or not all(map(math.isfinite, (command, *numbers(after)))):
            self.missed += 1
            return
        self.state = after
        self.missed = 0
        self.command = min(max(command, self.low), self.high)
        self.waiting = waiting


class VehicleTwin:
    """A controller under its supervisor, in the arithmetic of the supervisor that it is given.

    limits: the supervisor's parameters; supervisor: its `twin` for the bits of the C, SUPERVISOR
    itself for double precision. before: the state at the reset, of which it keeps what the last
    push did. spoil: (tick, what is seen) -> what the board makes of it, to fly with faults. A
    vehicle is a law that `simulate` flies. It begins armed, unless it is switched on.
    """

    def __init__(
        self,
        controller: ControllerTwin,
        limits: SupervisorParameters,
        *,
        supervisor: Law = SUPERVISOR,
        after_reset: bool = False,
        before: Any = None,
        spoil: Callable[[int, Watched], Watched] = lambda _, seen: seen,
    ) -> None:
        self.controller, self.limits, self.supervisor = controller, limits, supervisor
        self.spoil = spoil
        self.ticks = 0
        self._disarmed: tuple[Law, ArmingParameters, Any] | None = None
        self._begin(after_reset, before)

    def _begin(self, after_reset: bool, before: Any = None) -> None:
        nothing = Watched(math.nan, 0.0, 0.0, 0.0, False, 0, 0)
        state = self.supervisor.initial(self.limits, nothing, 1.0 if after_reset else 0.0)
        if after_reset and before is not None:
            push = state.push._replace(turns=before.push.turns)
            soon = before.recovery.reason > 0 and before.push.phase < SOON
            if soon and push.turns < supervisor.GREW:
                push = push._replace(pushed=before.volume.volume)
                state = state._replace(volume=state.volume._replace(volume=push.pushed))
            state = state._replace(push=push)
        self.state = state

    def switch_on(self, arming: Law, limits: ArmingParameters, *, was_armed: bool = False) -> None:
        """Begin disarmed, as a board whose power was switched on; was_armed: before, as it kept."""
        unseen = Deck(math.nan, math.nan)
        self._disarmed = arming, limits, arming.initial(limits, unseen, 1.0 if was_armed else 0.0)

    def arm(self) -> None:
        """Arm it, as somebody who stands at it; one that is armed stays as it is."""
        self._disarmed = None

    @property
    def armed(self) -> bool:
        """Whether law and supervisor command."""
        return self._disarmed is None

    def _held(self, seen: Watched) -> Any:
        """Return the command that holds a vehicle which is not armed yet; None: it is by now."""
        assert self._disarmed is not None
        arming, limits, state = self._disarmed
        hold, state, _ = arming.step(limits, state, Deck(seen.depth, seen.volume), 0.0)
        self._disarmed = arming, limits, state
        if state.deck == DISARMED:
            return hold
        self._disarmed = None
        if state.restarted:
            self._begin(after_reset=True)
        return None

    @property
    def reason(self) -> Reason | None:
        """The first reason; None while the law commands."""
        number = int(self.state.recovery.reason)
        return Reason(number) if number else None

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Every reason so far."""
        return supervisor.reasons_in(self.state.recovery.reasons)

    @property
    def wide(self) -> bool:
        """Whether a command of seconds below 0 is for the bypass."""
        state = self.controller.state
        return state is not None and bool(state.drive.wide > 0.0)

    @property
    def release(self) -> bool:
        """Whether the drop weight is to go."""
        return bool(self.state.recovery.release)

    def tick(self, seen: Watched, reference: float) -> Any:
        """Return the command from this tick on; `missed` of what is seen is the controller's."""
        self.ticks += 1
        if self._disarmed is not None:
            hold = self._held(seen)
            if hold is not None:
                return hold
        wanted = self.controller.command
        if not (self.state.recovery.reason or self.state.restarted):  # else left alone: it may hang
            known = math.isfinite(reference)  # else the controller asks its law for nothing
            asked = min(reference, self.state.proof.allowed) if known else reference
            wanted = self.controller.tick(seen.depth, seen.volume, asked, seen.battery)
        seen = seen._replace(missed=min(self.controller.missed, NEVER), reference=reference)
        if self.controller.seconds:
            state = self.controller.state
            seen = seen._replace(volume=0.0, computed=0.0 if state is None else state.drive.volume)
        command, self.state, _ = self.supervisor.step(self.limits, self.state, seen, wanted)
        return command

    def __call__(self, seen: Measurement, reference: float) -> float:
        """Return the command, as `simulate` asks for it; the board has no battery and leak sensor.

        Depths are as old as 0 s; `spoil` may say otherwise.
        """
        watched = Watched(seen.depth, 0.0, seen.volume, math.nan, False, 0, 0)
        return float(self.tick(self.spoil(self.ticks, watched), reference))
