"""swimbladder: vehicles that move up and down by changing their volume.

From datasheet to model, from pool log to parameters, from parameters to a depth controller::

    import swimbladder as sb

    vehicle = sb.load_vehicle("feup-em")              # a preset, or a TOML file
    solution = sb.simulate(vehicle, setpoints=[(0.0, 3.0)], duration=400.0, start_depth=1.5)
    print(sb.step_metrics(solution.time, solution.depth, start=1.5, target=3.0))
    dataset = solution.dataset()                      # an xarray Dataset

The map: what a vehicle is and is asked to do, ``Vehicle``, ``load_vehicle``, ``preset_names``,
``Mission``, ``load_mission``; how it moves, ``simulate``, ``simulate_ensemble``, ``drive``,
``Solution``, ``StopReason``, ``step_metrics``; a controller of your own, ``Law``, ``Measurement``;
what its linear model says, ``analyse``; what a measured log says, ``read_log``, ``compare``; how
logs become parameters with intervals, ``identify`` with ``Prior``, what was known before; what goes
wrong, ``SwimbladderError`` with ``InputError`` and ``NoAnswerError``.

All numbers are SI; depth is positive down; a positive volume makes the vehicle lighter.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from swimbladder.control.law import Law as Law, Measurement as Measurement
    from swimbladder.design.analysis import analyse as analyse
    from swimbladder.errors import (
        InputError as InputError,
        NoAnswerError as NoAnswerError,
        SwimbladderError as SwimbladderError,
    )
    from swimbladder.estimation.comparison import compare as compare
    from swimbladder.estimation.motion import Prior as Prior, identify as identify
    from swimbladder.io.config import load_mission as load_mission, load_vehicle as load_vehicle
    from swimbladder.io.logs import read_log as read_log
    from swimbladder.io.mission import Mission as Mission
    from swimbladder.io.presets import preset_names as preset_names
    from swimbladder.sim.closed_loop import (
        Solution as Solution,
        StopReason as StopReason,
        drive as drive,
        simulate as simulate,
        simulate_ensemble as simulate_ensemble,
        step_metrics as step_metrics,
    )
    from swimbladder.vehicle import Vehicle as Vehicle

__version__ = "0.1.0.dev0"
# Where each name lives; it is imported when it is first used, so that `import swimbladder` is free.
_HOMES = {
    "design.analysis": ("analyse",),
    "sim.closed_loop": (
        "Solution",
        "StopReason",
        "drive",
        "simulate",
        "simulate_ensemble",
        "step_metrics",
    ),
    "estimation.comparison": ("compare",),
    "estimation.motion": ("Prior", "identify"),
    "control.law": ("Law", "Measurement"),
    "errors": ("InputError", "NoAnswerError", "SwimbladderError"),
    "io.config": ("load_mission", "load_vehicle"),
    "io.logs": ("read_log",),
    "io.mission": ("Mission",),
    "io.presets": ("preset_names",),
    "vehicle": ("Vehicle",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    """Import a public name from where it lives."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, imported or not."""
    return sorted({*globals(), *__all__})
