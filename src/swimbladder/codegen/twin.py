"""The twin of a law: the tree of `tree` run in Python with numpy's float32, one rounding per step.

It stands for the compiled C, to the last bit, where C is compiled with IEEE 754 arithmetic and
without contraction; a NaN stands for any NaN.

The golden trace is a mission flown by a law's twin as the microcontroller will fly it.
"""

import dataclasses
import math
from collections import namedtuple
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.codegen import tree
from swimbladder.codegen.clock import ControllerTwin
from swimbladder.codegen.float_flight import fly_float
from swimbladder.codegen.subset import read_law
from swimbladder.control.law import NEVER, Law, Measurement, less, more
from swimbladder.errors import NoAnswerError
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Vehicle

_UP = 2.0 / 3.0  # of a float's golden mission, after which it is to come up


class Golden(NamedTuple):
    """What the controller saw and said at each tick, and how far float32 took the vehicle."""

    depth: NDArray[np.float32]  # m, measured
    volume: NDArray[np.float32]  # m3, measured
    reference: NDArray[np.float32]  # m, asked for
    command: NDArray[np.float32]  # V or m3, limited; s of pump and valve
    difference: float  # m, largest from the depths under the law in double precision


def command_limits(vehicle: Vehicle, tick_s: float = math.inf) -> tuple[float, float]:
    """Return the least and the largest command: of the supply [V], of the stroke [m3].

    Of a pump and valve a tick_s [s] each.
    """
    if vehicle.command == "volume change":
        return -tick_s, tick_s
    if vehicle.voltage_driven:
        assert vehicle.supply is not None
        return -vehicle.supply.voltage, vehicle.supply.voltage
    return vehicle.stroke.minimum, vehicle.stroke.maximum


def asked_of_float(target: float, duration: float, tick_s: float) -> NDArray[np.float64]:
    """Return the depth that a float's golden mission asks for at each tick [m]; 0 is the surface.

    target [m], duration [s]: after two thirds of it the float is to come up.
    """
    n = max(math.ceil(duration / tick_s - 1e-9), 1) + 1
    return np.where(np.arange(n) < _UP * n, target, 0.0)


def fly_on_seconds(
    vehicle: Vehicle,
    laws: tuple[Law, Law],
    parameters: Any,
    *,
    tick_s: float,
    start_depth: float,
    asked: NDArray[np.float64],
    seed: int | None,
    progress: Callable[[int], None] | None = None,
) -> Golden:
    """Return the golden trace of a float under a law's twin, for the depths asked for [m] [n].

    As `fly`, for a law that commands seconds of pump and valve: the volume is not measured.
    laws: the twin and the law itself. Raises NoAnswerError where the float does not dive.
    """
    low, high = command_limits(vehicle, tick_s)
    flown = []
    for kind, each in zip(laws, (progress, None), strict=True):
        board = ControllerTwin(kind, parameters, tick_s=tick_s, low=low, high=high, seconds=True)

        def tick(
            seen: Measurement, reference: float, board: ControllerTwin = board
        ) -> tuple[float, bool]:
            command = float(board.tick(seen.depth, seen.volume, reference))
            return command, board.state.drive.wide > 0.0

        flown.append(
            fly_float(
                vehicle,
                tick,
                tick=tick_s,
                start_depth=start_depth,
                asked=asked,
                seed=seed,
                progress=each,
            )
        )
    rows, double = flown
    if not rows[:, 0].max() > parameters.surface.shallow:
        raise NoAnswerError(
            f"the golden mission: asked for {asked.max():g} m the float has not dived after "
            f"{_UP * len(asked) * tick_s:.4g} s. Give a longer --duration, or see what valve and "
            "bypass let in at the surface (actuator.valve.flow, actuator.internal_pressure)"
        )
    depth, command = np.asarray(rows[:, 1], np.float32), np.asarray(rows[:, 3], np.float32)
    nothing = np.full_like(depth, np.nan)
    difference = float(np.abs(rows[:, 0] - double[:, 0]).max())
    return Golden(depth, nothing, np.asarray(asked, np.float32), command, difference)


def fly(
    vehicle: Vehicle, law: Law, twin: Law, parameters: Any, *, tick_s: float, start_depth: float,
    target: float, duration: float, seed: int | None, first: float,
    progress: Callable[[int], None] | None = None,
) -> Golden:  # fmt: skip
    """Return the golden trace of a depth step [m] under a law's twin, from rest.

    seed: of the vehicle's sensors' noise; None: ideal sensors. first: the command before there is
    one. Raises NoAnswerError where the vehicle does not come through it.
    """
    low, high = command_limits(vehicle)
    controller = ControllerTwin(twin, parameters, tick_s=tick_s, low=low, high=high, first=first)
    rows: list[tuple[Any, ...]] = []

    def every_tick(seen: Measurement, reference: float) -> float:
        command = controller.tick(seen.depth, seen.volume, reference)
        rows.append((seen.depth, seen.volume, reference, command))
        return float(command)

    mission: dict[str, Any] = dict(
        setpoints=[(0.0, target)], duration=duration, start_depth=start_depth, seed=seed,
        sample_time=tick_s,
    )  # fmt: skip
    flown = simulate(vehicle, law=every_tick, progress=progress, **mission)
    if not flown.finished:
        raise NoAnswerError(
            f"The golden mission from {start_depth:g} m to {target:g} m ended at "
            f"{flown.time[-1]:g} s: {flown.stop.value}"
        )
    double = simulate(vehicle, law=law, parameters=parameters, **mission)
    depth, volume, reference, command = np.array(rows, np.float32).T
    difference = float(np.abs(flown.depth - double.depth).max())
    return Golden(depth, volume, reference, command, difference)


def twin(law: Law, program: tree.Program | None = None) -> Law:
    """Return the law in float32: `step` and `initial` take any numbers, and round them first.

    Raises InputError, as `read_law`, where the law cannot be translated.
    """
    made = read_law(law) if program is None else program
    text = _Text(made)
    space = text.space
    exec(compile(text.source, f"<float32 twin of {law.name}>", "exec"), space)
    step, initial = space[text.names[made.step]], space[text.names[made.initial]]

    def float32_step(parameters: Any, state: Any, measurement: Any, reference: float) -> Any:
        with np.errstate(all="ignore"):
            command, after, next_s = step(
                rounded(made.parameters, parameters), rounded(made.state, state),
                rounded(made.measurement, measurement), np.float32(reference),
            )  # fmt: skip
        return command, after, next_s

    def float32_initial(parameters: Any, measurement: Any, reference: float) -> Any:
        with np.errstate(all="ignore"):
            return initial(
                rounded(made.parameters, parameters), rounded(made.measurement, measurement),
                np.float32(reference),
            )  # fmt: skip

    return dataclasses.replace(law, step=float32_step, initial=float32_initial)


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


_FUNCTIONS = {"min": "least_", "max": "most_", "abs": "abs", "sqrt": "sqrt_",
              "isfinite": "isfinite_", "copysign": "copysign_", "more": "more_", "less": "less_",
              "float": "float32_"}  # fmt: skip


class _Text:
    """A program as Python source, and the names that it needs."""

    def __init__(self, program: tree.Program) -> None:
        self.space: dict[str, Any] = {
            "least_": _least, "most_": _most, "sqrt_": np.sqrt, "isfinite_": np.isfinite,
            "copysign_": np.copysign, "float32_": np.float32, "more_": more, "less_": less,
        }  # fmt: skip
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

    def _value(self, e: tree.Expression) -> str:
        """Return an expression, in brackets wherever one might ask."""
        of = self._value
        if isinstance(e, tree.Number) and e.type != tree.FLOAT:
            return str(int(e.value) if e.type == tree.COUNT else bool(e.value))
        if isinstance(e, tree.Number | tree.Constant):
            return self._number(e.value)
        if isinstance(e, tree.Name):
            return f"float32_({e.name})" if e.type == tree.INT else e.name
        if isinstance(e, tree.Field):
            return f"{of(e.of)}.{e.name}"
        if isinstance(e, tree.Minus):
            return f"(-{of(e.of)})"
        if isinstance(e, tree.Binary | tree.Compare):
            return f"({of(e.left)} {e.operator} {of(e.right)})"
        if isinstance(e, tree.Logic):
            return f"({f' {e.operator} '.join(map(of, e.of))})"
        if isinstance(e, tree.Not):
            return f"(not {of(e.of)})"
        if isinstance(e, tree.Choice):
            return f"({of(e.yes)} if {of(e.condition)} else {of(e.no)})"
        if isinstance(e, tree.Builtin) and e.name == "count":
            (counter,) = e.arguments
            assert isinstance(counter, tree.Name)
            return counter.name
        if isinstance(e, tree.Builtin):
            return f"{_FUNCTIONS[e.name]}({', '.join(map(of, e.arguments))})"
        if isinstance(e, tree.Call):
            return f"{self.names[e.function]}({', '.join(map(of, e.arguments))})"
        assert isinstance(e, tree.Make)
        return f"{e.type.name}__({', '.join(map(of, e.values))})"
