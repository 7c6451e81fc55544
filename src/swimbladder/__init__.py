"""swimbladder: vehicles that move up and down by changing their volume.

From datasheet to model, from pool log to parameters, from parameters to a depth controller::

    import swimbladder as sb

    vehicle = sb.load_vehicle("feup-em")              # a preset, or a TOML file
    solution = sb.simulate(vehicle, step=(1.5, 3.0))
    print(sb.step_metrics(solution.time, solution.depth, start=1.5, target=3.0))
    dataset = solution.dataset()                      # an xarray Dataset

Every command of the command line is a function of its name (``compare-laws``: ``compare_laws``)
that takes, refuses and answers the same; ``pool`` guides a day by ``PoolDay``, and ``vehicle
show`` is ``load_vehicle``. Describe: ``size``, ``ballast``, ``energy``. Predict: ``simulate``,
``mission``, ``campaign``, ``analyse``, ``plan``. Measure: ``design_experiment``, ``identify``,
``identify_deep``, ``identify_actuator``, ``compare``. Control: ``tune``, ``compare_laws``,
``stability``, ``firmware``, ``board``, ``faults``. The paper: ``reproduce``.

What they take: ``load_vehicle``, ``load_mission``, ``read_log``, ``read_float_log``, ``read_cast``
and ``cast_column`` read files (``water_of``: of a mission); ``Dive``, ``Target``, ``Uncertainty``,
``Thruster``, ``Spread``, ``Floats``, ``Workers``, ``Flights`` and ``Prior`` hold what is asked;
``Law`` and ``Measurement`` are for a controller of your own. ``save_vehicle`` writes a vehicle,
``write_library`` a firmware. ``preset_names`` are the vehicles that come along, ``load_parts``
what ``size`` combines. A ``Vehicle``, a ``Mission`` and a ``Solution`` (with its ``StopReason``)
are what their functions say. Beside the commands there are ``simulate_ensemble``, ``drive`` (by
given volumes or voltages), ``step_metrics``, and ``fit_pump`` with ``fitted_vehicle``. What goes
wrong is a ``SwimbladderError``: ``InputError``, or ``NoAnswerError``.

All numbers are SI; depth is positive down; a positive volume makes the vehicle lighter.
"""

from __future__ import annotations

from importlib import import_module
from types import FunctionType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from swimbladder.codegen.board import Flights as Flights, board as board
    from swimbladder.codegen.library import firmware as firmware, write_library as write_library
    from swimbladder.control.law import Law as Law, Measurement as Measurement
    from swimbladder.design.analysis import analyse as analyse
    from swimbladder.design.ballast import (
        Target as Target,
        Uncertainty as Uncertainty,
        ballast as ballast,
    )
    from swimbladder.design.energy import (
        Thruster as Thruster,
        energy as energy,
        fit_pump as fit_pump,
        fitted_vehicle as fitted_vehicle,
    )
    from swimbladder.design.experiments import design_experiment as design_experiment
    from swimbladder.design.law_comparison import compare_laws as compare_laws
    from swimbladder.design.planning import plan as plan
    from swimbladder.design.pool_day import PoolDay as PoolDay
    from swimbladder.design.sizing import Dive as Dive, load_parts as load_parts, size as size
    from swimbladder.design.stability import stability as stability
    from swimbladder.design.tuning import tune as tune
    from swimbladder.errors import (
        InputError as InputError,
        NoAnswerError as NoAnswerError,
        SwimbladderError as SwimbladderError,
    )
    from swimbladder.estimation.actuator import identify_actuator as identify_actuator
    from swimbladder.estimation.comparison import compare as compare
    from swimbladder.estimation.motion import Prior as Prior, identify as identify
    from swimbladder.estimation.motion.deep import identify_deep as identify_deep
    from swimbladder.io.casts import read_cast as read_cast
    from swimbladder.io.config import load_mission as load_mission, load_vehicle as load_vehicle
    from swimbladder.io.float_logs import read_float_log as read_float_log
    from swimbladder.io.logs import read_log as read_log
    from swimbladder.io.mission import Mission as Mission
    from swimbladder.io.presets import preset_names as preset_names
    from swimbladder.io.vehicle_file import save_vehicle as save_vehicle
    from swimbladder.jobs import Workers as Workers
    from swimbladder.paper import reproduce as reproduce
    from swimbladder.physics.seawater import cast_column as cast_column
    from swimbladder.sim.campaign.result import campaign as campaign
    from swimbladder.sim.campaign.run import Floats as Floats
    from swimbladder.sim.closed_loop import (
        Solution as Solution,
        StopReason as StopReason,
        drive as drive,
        simulate as simulate,
        simulate_ensemble as simulate_ensemble,
        step_metrics as step_metrics,
    )
    from swimbladder.sim.faults import faults as faults
    from swimbladder.sim.mission.result import mission as mission
    from swimbladder.sim.mission.prepare import water_of as water_of
    from swimbladder.vehicle import Vehicle as Vehicle
    from swimbladder.vehicle.spread import Spread as Spread

__version__ = "0.1.0.dev0"
# Where each name lives; it is imported when it is first used, so that `import swimbladder` is free.
_HOMES = {
    "codegen.board": "Flights board",
    "codegen.library": "firmware write_library",
    "control.law": "Law Measurement",
    "design.analysis": "analyse",
    "design.ballast": "Target Uncertainty ballast",
    "design.energy": "Thruster energy fit_pump fitted_vehicle",
    "design.experiments": "design_experiment",
    "design.law_comparison": "compare_laws",
    "design.planning": "plan",
    "design.pool_day": "PoolDay",
    "design.sizing": "Dive load_parts size",
    "design.stability": "stability",
    "design.tuning": "tune",
    "errors": "InputError NoAnswerError SwimbladderError",
    "estimation.actuator": "identify_actuator",
    "estimation.comparison": "compare",
    "estimation.motion": "Prior identify",
    "estimation.motion.deep": "identify_deep",
    "io.casts": "read_cast",
    "io.config": "load_mission load_vehicle",
    "io.float_logs": "read_float_log",
    "io.logs": "read_log",
    "io.mission": "Mission",
    "io.presets": "preset_names",
    "io.vehicle_file": "save_vehicle",
    "jobs": "Workers",
    "paper": "reproduce",
    "physics.seawater": "cast_column",
    "sim.campaign.result": "campaign",
    "sim.campaign.run": "Floats",
    "sim.closed_loop": "Solution StopReason drive simulate simulate_ensemble step_metrics",
    "sim.faults": "faults",
    "sim.mission.result": "mission",
    "sim.mission.prepare": "water_of",
    "vehicle": "Vehicle",
    "vehicle.spread": "Spread",
}
_HOME = {name: module for module, names in _HOMES.items() for name in names.split()}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    """Import a public name from where it lives."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    if isinstance(value, FunctionType):
        value = import_module(f"{__name__}.io.given").accepting(value)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, imported or not."""
    return [*__all__, "__all__", "__doc__", "__version__"]
