"""What is asked of an identification: refused where it cannot be, and said in sentences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.comparison.record import Drive, Record
from swimbladder.estimation.motion.estimates import Prior
from swimbladder.estimation.motion.model import NAMES, Model, check_names
from swimbladder.estimation.motion.problem import Problem
from swimbladder.io.logs import Log
from swimbladder.units import format_quantity
from swimbladder.vehicle import Vehicle

_STILL = 1e-4  # m, below which no sensor measures


def check_logs(
    logs: Sequence[Log], neutral_std: float, speed_std: float, drive: Drive | None
) -> None:
    """Raise InputError for no log, or for a deviation or drive that cannot be."""
    if not logs:
        raise InputError("no log is given", field="LOG", remedy="Give at least one log")
    check_std("neutral_std", neutral_std, "m3")
    check_std("speed_std", speed_std, "m/s")
    if drive not in (None, "volume", "voltage"):
        raise InputError(
            "this does not drive the vehicle's model by itself", field="drive",
            value=drive, remedy="Choose volume or voltage",
        )  # fmt: skip


def check_std(field: str, value: float, unit: str) -> None:
    """Raise InputError for a standard deviation that is not above 0."""
    if not value > 0.0:
        raise InputError(
            "it must be above 0", field=field, value=value, unit=unit,
            remedy="Give a standard deviation, or none for no assumption",
        )  # fmt: skip


def check_motion(records: Sequence[Record]) -> None:
    """Raise NoAnswerError where no vehicle of the records moved by what a sensor resolves."""
    ranges = [float(np.ptp(r.depth[r.compared])) for r in records]
    if max(ranges) < _STILL:
        raise NoAnswerError(
            "the vehicle's motion is not identifiable: the depth stays at "
            f"{float(records[0].depth[records[0].compared][0]):.4g} m. Check which column is the "
            "depth, or record steps of the volume"
        )


def driven_by(log: Log, vehicle: Vehicle) -> Drive:
    """Return what drives the model: the volume where it is known, else the voltage."""
    if log.volume is not None or log.piston is not None or log.voltage is None:
        return "volume"
    return "voltage" if vehicle.voltage_driven else "volume"


def check_parameters(
    names: Sequence[str], fixed: Mapping[str, float], priors: Mapping[str, Prior],
    model: Model, *, voltage: bool,
) -> None:  # fmt: skip
    """Raise InputError where names, values and priors do not go together."""
    check_names(names, model, voltage=voltage, option="--free")
    check_names(list(fixed), model, voltage=voltage, option="--set")
    check_names(list(priors), model, voltage=voltage, option="--prior")
    if not names:
        raise InputError("nothing is left to identify", field="--free", remedy="Free a parameter")
    for name in names:
        if name in fixed:
            raise InputError(
                "it is both set and to be identified", field="--set", value=name,
                remedy="Leave it out of --free or of --set",
            )  # fmt: skip
    for name, value in fixed.items():
        if NAMES[name].logarithmic and not value > 0.0:
            raise InputError(
                "it must be above 0", field="--set", value=value, unit=NAMES[name].unit
            )
    for name, prior in priors.items():
        if name not in names:
            raise InputError(
                "it has a prior, but is not identified", field="--prior", value=name,
                remedy=f"Name it in --free, which has {', '.join(names)}",
            )  # fmt: skip
        if not prior.std > 0.0 or (NAMES[name].logarithmic and not prior.mean > 0.0):
            raise InputError(
                "no such prior: the deviation has to be above 0, and the mean of a positive "
                "quantity too",
                field="--prior", value=f"{name}={prior.mean:g} +- {prior.std:g}",
                unit=NAMES[name].unit, remedy="What is known exactly is fixed: `fixed`",
            )  # fmt: skip


def assumptions(problem: Problem, records: Sequence[Record], vehicle: Vehicle) -> tuple[str, ...]:
    """Return what the answer rests on: law, priors, what is held, the water."""
    said = [f"drag law: {problem.model.law}"]
    if math.isfinite(problem.neutral_std):
        std = format_quantity(problem.neutral_std, "m3", "cm3", digits=3)
        said.append(f"each log's neutral volume is known to {std} (1 sigma)")
    else:
        said.append("nothing is known of the logs' neutral volumes")
    if any(r.volume is not None and not r.volume_absolute for r in records):
        said.append("a volume without an absolute zero: neutral at the first sample's depth")
    if math.isfinite(problem.speed_std):
        std = format_quantity(problem.speed_std, "m/s", "mm/s", digits=3)
        said.append(f"each log starts at rest, to {std} (1 sigma)")
    for name, prior in problem.priors.items():
        said.append(f"prior: {name} = {prior.mean:g} +- {prior.std:g} {NAMES[name].unit}")
    for name in ("psi", "K2", "T2", "mass", "drag_quadratic"):
        inert = {"linear": ("mass", "drag_quadratic"), "quadratic": ("K2", "T2"),
                 "blended": ("mass",)}[problem.model.law]  # fmt: skip
        if name not in problem.names and name not in inert:
            said.append(f"held: {name} = {problem.values[name]:g} {NAMES[name].unit}")
    water = vehicle.water
    if any(len(r.layers.table) for r in records):
        said.append(
            "the neutral volume follows the density of the cast; psi is what the hull loses "
            "beyond that"
        )
    said.append(f"water of {water.density:g} kg/m3, gravity {water.gravity:g} m/s2")
    return tuple(said)
