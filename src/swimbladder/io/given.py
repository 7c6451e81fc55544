"""What a public function is given: files by their names, numbers as texts with units.

The unit of a number is the one that the function's docstring says, ``[m]``; what has none is a
share or a count.
"""

import inspect
import re
from collections.abc import Callable
from functools import cache, wraps
from importlib import import_module
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from swimbladder.errors import InputError
from swimbladder.io.log_text import is_frame
from swimbladder.units import quantity, unit_factor, with_one_unit

_P = ParamSpec("_P")
_T = TypeVar("_T")
_Taker = Callable[[Any, str], Any]
_SECTION = re.compile(r"^Parameters\n-+\n(.*?)(?=^[A-Z]\w+\n-+$|\Z)", re.S | re.M)
_BRACKETS = re.compile(r"\[([^\[\]]+)\]")
_LOADED_BY = {
    "Vehicle": ("swimbladder.io.config", "load_vehicle"),
    "Mission": ("swimbladder.io.config", "load_mission"),
    "Cast": ("swimbladder.io.casts", "read_cast"),
    "Column": ("swimbladder.io.casts", "read_cast"),
    "FloatLog": ("swimbladder.io.float_logs", "read_float_log"),
    "Log": ("swimbladder.io.logs", "read_log"),
    "PumpRuns": ("swimbladder.io.pump_runs", "read_pump_runs"),
}


def accepting(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Return a public function that also takes names of files, and texts with units.

    Whatever else is none of what it takes is an InputError that names the parameter.
    """
    taken = inspect.signature(function)

    @wraps(function)
    def called(*args: _P.args, **given: _P.kwargs) -> _T:
        """Convert what was given, defaults left alone, and call the function."""
        try:
            bound = taken.bind(*args, **given)
        except TypeError as error:
            raise TypeError(f"{function.__name__}(): {error}") from None
        for name, take in _takers(function).items():
            default = taken.parameters[name].default
            if name in bound.arguments and bound.arguments[name] is not default:
                bound.arguments[name] = take(bound.arguments[name], name)
        return function(*bound.args, **bound.kwargs)

    return called


@cache
def units_of(function: Callable[..., Any]) -> dict[str, list[str]]:
    """Return all units that the docstring says of each parameter, in their order."""
    section = _SECTION.search(inspect.getdoc(function) or "")
    found: dict[str, list[str]] = {}
    names: list[str] = []
    for line in section[1].splitlines() if section else ():
        if line and not line.startswith(" "):
            names = [name.strip(" *") for name in line.split(",")]
            continue
        for unit in filter(_is_unit, _BRACKETS.findall(line)):
            for name in names:
                found.setdefault(name, []).append(unit)
    return found


def _is_unit(text: str) -> bool:
    try:
        return unit_factor(text, text) == 1.0
    except InputError:
        return False


@cache
def _takers(function: Callable[..., Any]) -> dict[str, _Taker]:
    """Return what reads each parameter that can be given otherwise, by its annotation."""
    found: dict[str, _Taker] = {}
    for name, parameter in inspect.signature(function).parameters.items():
        words = set(re.findall(r"\w+", str(parameter.annotation)))
        if {"Mapping", "Callable"} & words:
            continue
        if (type_name := next((word for word in _LOADED_BY if word in words), None)) is not None:
            water = _water(_STEP.get(function.__name__, 0.1))
            reader = water if type_name == "Column" else _reader(type_name, function.__name__)
            found[name] = _several(reader) if "Sequence" in words else reader
        elif "float" in words and not {"ArrayLike", "NDArray"} & words:
            numbers = [_number(unit) for unit in units_of(function).get(name, [""])]
            one = _pair(numbers[0], numbers[-1]) if "tuple" in words else numbers[0]
            found[name] = _each(one) if "Sequence" in words else one
    return found


def _number(unit: str) -> _Taker:
    """Return what reads a number, or a text with its unit."""

    def take(value: Any, name: str) -> Any:
        if isinstance(value, str):
            return quantity(value, unit, name)
        if value is not None and not hasattr(value, "__float__"):
            remedy = f'Give a number in {unit}, or a text like "1.5 {unit}"' if unit else "Give 0.1"
            raise InputError("not a number", field=name, value=value, unit=unit, remedy=remedy)
        return value

    return take


def _pair(first: _Taker, second: _Taker) -> _Taker:
    """Return what reads two numbers."""

    def take(value: Any, name: str) -> Any:
        if value is None:
            return value
        two = with_one_unit(value.split(":")) if isinstance(value, str) else value
        if not hasattr(two, "__len__") or len(two) != 2:
            what, remedy = "not two numbers", 'Give both, like (0.0, 10.0) or "0:10 m"'
            raise InputError(what, field=name, value=value, remedy=remedy)
        return first(two[0], name), second(two[1], name)

    return take


def _several(read: _Taker) -> _Taker:
    """Return what reads each of a list, or one alone."""

    def take(value: Any, name: str) -> Any:
        if value is None or isinstance(value, list | tuple):
            return value and [read(one, f"{name}[{k}]") for k, one in enumerate(value)]
        return [read(value, name)]

    return take


def _each(read: _Taker) -> _Taker:
    """Return what reads each of a list."""

    def take(value: Any, name: str) -> Any:
        if value is None:
            return value
        if isinstance(value, str | Path) or not hasattr(value, "__len__"):
            what, remedy = "not a list", f"Give several, or one as {name}=[...]"
            raise InputError(what, field=name, value=value, remedy=remedy)
        return [read(one, f"{name}[{k}]") for k, one in enumerate(value)]

    return take


_STEP = {"size": 1.0, "identify_deep": 1.0}  # m, rows of the water; 0.1 m in a tank or pool


def _water(step: float) -> _Taker:
    """Return what makes water with rows so far apart [m] of a cast, and takes water as it is."""

    def take(value: Any, name: str) -> Any:
        if value is None or hasattr(value, "density_std"):
            return value
        seawater = import_module("swimbladder.physics.seawater")
        return seawater.cast_column(_reader("Cast")(value, name), step=step)

    return take


def _reader(type_name: str, function: str = "") -> _Taker:
    """Return what reads a file where its name is given, and refuses what is of another type."""
    home, load = _LOADED_BY[type_name]
    how = {"required": ("time_s",)} if (type_name, function) == ("Log", "identify_actuator") else {}

    def take(value: Any, name: str) -> Any:
        if value is None or any(base.__name__ == type_name for base in type(value).__mro__):
            return value
        if isinstance(value, str | Path) or (load.startswith("read_") and is_frame(value)):
            return getattr(import_module(home), load)(value, **how)
        remedy = f"Give what {load} returns, or the name of its file"
        raise InputError(f"no {type_name}", field=name, value=value, remedy=remedy)

    return take
