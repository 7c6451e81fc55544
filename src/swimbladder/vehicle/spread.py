"""What is not the same in all floats of a kind, as a spread that is usual or was identified."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from swimbladder.errors import InputError
from swimbladder.vehicle.schema import Parameters, Unit, refusal
from swimbladder.vehicle.vehicle import Vehicle

Array = NDArray[np.float64]

Input = Literal["trim", "psi", "drag", "pump", "mass"]
INPUTS: tuple[Input, ...] = ("trim", "psi", "drag", "pump", "mass")
# How the inputs change with the logarithms of what is identified: drag is times the force.
_BY_NAME: dict[str, Mapping[Input, float]] = {
    "K1": {"pump": 1.0},
    "K2": {"drag": -1.0, "mass": -1.0},
    "T2": {"mass": 1.0},
    "mass": {"mass": 1.0},
    "drag_quadratic": {"drag": 1.0},
    "T1": {},  # missions have no lag of the motor
}


class Correlation(Parameters):
    """How two inputs go together."""

    of: tuple[Input, Input]
    """the two inputs"""
    value: Annotated[float, Field(ge=-1.0, le=1.0)]
    """their correlation"""


class Spread(Parameters):
    """1 sigma of what is not the same in all floats, normal and cut at 3 sigma."""

    schema_version: Literal[1] = 1
    trim: Annotated[float, Unit("m3"), Field(ge=0.0, le=1.0)] = 5e-6
    """of the neutral volume"""
    psi: Annotated[float, Unit("m3/m"), Field(ge=0.0, le=1.0)] = 2e-9
    """of the hull's compression"""
    drag: Annotated[float, Unit(""), Field(ge=0.0, le=0.3)] = 0.1
    """of the drag, as a share"""
    pump: Annotated[float, Unit(""), Field(ge=0.0, le=0.3)] = 0.05
    """of the pump's delivery, as a share, which the processor does not know of"""
    mass: Annotated[float, Unit(""), Field(ge=0.0, le=0.3)] = 0.0
    """of the mass that is accelerated, as a share; the trim is not changed"""
    correlation: tuple[Correlation, ...] = ()
    """inputs that go together"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        pairs = [frozenset(one.of) for one in self.correlation]
        for pair in pairs:
            if len(pair) < 2 or pairs.count(pair) > 1:
                what = "not two inputs, or a pair that stands here twice"
                raise refusal(what, "Name each pair of two inputs once", "correlation")
        if np.linalg.eigvalsh(self.matrix)[0] < -1e-9:
            what = "these correlations contradict each other: their matrix is not positive"
            raise refusal(what, "Make them smaller", "correlation")

    @property
    def matrix(self) -> Array:
        """Correlations of `INPUTS`."""
        found = np.eye(len(INPUTS))
        for one in self.correlation:
            a, b = (INPUTS.index(name) for name in one.of)
            found[a, b] = found[b, a] = one.value
        return found

    @property
    def groups(self) -> list[tuple[Input, ...]]:
        """Inputs that spread, those that are correlated together."""
        groups: list[set[Input]] = [{name} for name in INPUTS if getattr(self, name) > 0.0]
        for one in self.correlation:
            touched = [group for group in groups if one.value != 0.0 and group & set(one.of)]
            if len(touched) == 2:
                groups.remove(touched[1])
                touched[0] |= touched[1]
        return [tuple(name for name in INPUTS if name in group) for group in groups]

    def identified(self, vehicle: Vehicle) -> Spread:
        """Return the spread of what was identified of a vehicle; for the rest, this one.

        By the covariance in `[identified]`, to first order; the trim by the neutral volume's
        spread between experiments. Raises InputError where nothing was identified, or where it is
        not known well enough.
        """
        known = vehicle.identified
        if known is None:
            what = f"nothing was identified of {vehicle.name!r}"
            table = "an [identified] table, which `swimbladder identify` writes"
            remedy = f"Give it {table}, or state the spread"
            raise InputError(what, field="identified", remedy=remedy)
        names = list(known.names)
        scale = [v if n != "psi" else 1.0 for n, v in zip(names, known.values, strict=True)]
        jacobian = np.zeros((len(INPUTS), len(names)))
        for column, (name, value) in enumerate(zip(names, scale, strict=True)):
            for target, share in _changes(name, names).items():
                jacobian[INPUTS.index(target), column] = share / value
        covariance = jacobian @ np.array(known.covariance) @ jacobian.T
        sigma = np.sqrt(np.diag(covariance))
        found: dict[str, Any] = self.model_dump()
        found |= {name: float(s) for name, s in zip(INPUTS, sigma, strict=True) if s > 0.0}
        if known.neutral_std > 0.0:
            found["trim"] = known.neutral_std
        found["correlation"] = tuple(
            Correlation(of=(a, b), value=float(np.clip(value, -1.0, 1.0)))
            for (i, a), (j, b) in itertools.combinations(enumerate(INPUTS), 2)
            if sigma[i] > 0.0
            and sigma[j] > 0.0
            and (value := covariance[i, j] / (sigma[i] * sigma[j])) != 0.0
        )
        return Spread(**found)


def _changes(name: str, names: Sequence[str]) -> Mapping[Input, float]:
    """Return what changes, and by which power, with a number that is identified among others."""
    if name == "psi":
        return {"psi": 1.0}
    if name == "K2" and "drag_quadratic" in names:
        return {"mass": -1.0}  # its linear drag is not what a mission's speeds feel
    return _BY_NAME[name]
