"""The names that can be identified, and the plant that their values make."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from swimbladder.errors import InputError
from swimbladder.estimation.estimates import check_names as check_known
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.vehicle import IdentifiedActuator, Vehicle

LAWS = ("linear", "quadratic", "blended")


class Name(NamedTuple):
    """A quantity of the vehicle that can be identified."""

    unit: str
    logarithmic: bool  # fitted as its logarithm: positive, and known to a share of itself
    meaning: str


NAMES: Mapping[str, Name] = {
    "K2": Name("1/m2/s", True, "speed per volume, rho g/k_dl, eq. (28)"),
    "T2": Name("s", True, "time constant of the speed, m/k_dl, eq. (29)"),
    "mass": Name("kg", True, "all that is accelerated m"),
    "drag_quadratic": Name("N s2/m2", False, "turbulent drag coefficient k_dt"),
    "psi": Name("m3/m", False, "volume the hull loses per metre beyond the water's, eq. (31)"),
    "K1": Name("m/s/V", True, "piston speed per volt, eq. (23)"),
    "T1": Name("s", True, "time constant of the motor, eq. (24)"),
}

_OF_LAW = {
    "linear": ("K2", "T2"),
    "quadratic": ("mass", "drag_quadratic"),
    "blended": ("K2", "T2", "drag_quadratic"),
}
_TYPICAL_SPEED = 0.1  # m/s, at which a law that is not known yet is taken to have the other's drag


class Model(NamedTuple):
    """A vehicle under one drag law: its plant, and the values of everything that has a name."""

    base: Plant
    law: str
    specific_weight: float  # N/m3, rho g
    waterplane: float  # m2
    piston_area: float  # m2; nan where there is none
    displaced: float  # m3
    values: dict[str, float]

    @property
    def psi_scale(self) -> float:
        """A psi that is large for this hull [m3/m]: 1e-4 of its volume a metre."""
        return 1e-4 * self.displaced

    def scale(self, name: str) -> float:
        """Return what counts as a whole of a quantity that is not fitted as its logarithm."""
        if name == "psi":
            return self.psi_scale
        return max(self.values["drag_quadratic"], 1e-6)

    def logarithmic(self, name: str) -> bool:
        """Whether a quantity is fitted as its logarithm; a drag that may be none is not."""
        return NAMES[name].logarithmic or (name == "drag_quadratic" and self.law == "quadratic")

    def mass(self, values: Mapping[str, float]) -> float:
        """Return the mass that is accelerated [kg]."""
        if self.law == "quadratic":
            return values["mass"]
        return self.specific_weight * values["T2"] / values["K2"]

    def plant(self, values: Mapping[str, float], neutral: float) -> Plant:
        """Return the plant of these values; `neutral` is the neutral volume at depth 0 [m3]."""
        m = self.mass(values)
        laminar = 0.0 if self.law == "quadratic" else 1.0 / values["T2"]
        changes = {
            "a_b": self.specific_weight / m,
            "a_s": self.specific_weight * self.waterplane / m,
            "psi": values["psi"],
            "V_0": neutral,
            "d_l": laminar,
            "d_b": laminar if self.law == "blended" else 0.0,
            "d_0": 0.0,
            "d_t": 0.0 if self.law == "linear" else values["drag_quadratic"] / m,
            "epsilon": math.inf if self.law == "linear" else 0.0,
        }
        if "K1" in values:
            changes |= {"gain": values["K1"] * self.piston_area, "T1": values["T1"]}
        return self.base._replace(**changes)


def model_of(vehicle: Vehicle, *, law: str | None = None, bottom_depth: float) -> Model:
    """Return the model of a vehicle under a drag law, its own where none is given.

    Raises InputError for a law that cannot be identified.
    """
    drag = vehicle.drag
    wanted = law or drag.law
    if wanted not in LAWS:
        raise InputError(
            "this drag law cannot be identified", field="--drag" if law else "motion.drag.law",
            value=wanted, remedy=f"Choose --drag {', '.join(LAWS)}",
        )  # fmt: skip
    k_b, m = vehicle.water.specific_weight, vehicle.mass
    k_dl = drag.k_dl or drag.k_dt * _TYPICAL_SPEED
    k_dt = drag.k_dt or (k_dl / _TYPICAL_SPEED if wanted == "quadratic" else 0.0)
    if wanted == "blended" and drag.k_dt == 0.0:
        k_dl, k_dt = 0.5 * k_dl, 0.5 * k_dl / _TYPICAL_SPEED
    values = {
        "K2": k_b / k_dl, "T2": m / k_dl, "mass": m, "drag_quadratic": k_dt, "psi": vehicle.hull.psi
    }  # fmt: skip
    area = math.nan
    if isinstance(vehicle.actuator, IdentifiedActuator):
        area = vehicle.actuator.piston_area
        values |= {"K1": vehicle.actuator.K1, "T1": vehicle.actuator.T1}
    return Model(
        base=plant(vehicle, bottom_depth=bottom_depth), law=wanted, specific_weight=k_b,
        waterplane=vehicle.hull.waterplane_area, piston_area=area,
        displaced=vehicle.hull.displaced_volume, values=values,
    )  # fmt: skip


def default_names(law: str, given: Sequence[str]) -> tuple[str, ...]:
    """Return what is identified unless asked otherwise: the drag law's own and psi.

    given: names whose values are set, which are not identified.
    """
    return tuple(name for name in (*_OF_LAW[law], "psi") if name not in given)


def check_names(names: Sequence[str], model: Model, *, voltage: bool, option: str) -> None:
    """Raise InputError for a name that this vehicle and record do not have."""
    check_known(names, NAMES, option, "there is no such parameter")
    for name in names:
        what = remedy = ""
        if name in ("K1", "T1") and "K1" not in model.values:
            what, remedy = "the vehicle's actuator has none", "Choose a vehicle of kind identified"
        elif name in ("K1", "T1") and not voltage:
            what = "a logged volume does not identify the actuator"
            remedy = "Use `swimbladder identify-actuator`, or --drive voltage"
        elif name not in (*_OF_LAW[model.law], "psi", "K1", "T1"):
            what = f"the drag law {model.law} has no such parameter"
            remedy = f"It has {', '.join(_OF_LAW[model.law])}; or choose another --drag"
        if what:
            raise InputError(what, field=option, value=name, remedy=remedy)
