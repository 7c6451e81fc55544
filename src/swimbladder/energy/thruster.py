"""A thruster by momentum theory: what it takes to hold a force, at rest or under way.

An ideal disc of area A that pushes with T gives the water the speed 2 v behind it, where

    T = 2 rho A v (w + v),    P = T (w + v)/eta

with w the speed of advance (Rankine and Froude; J. Carlton, Marine Propellers and Propulsion, 4th
ed. 2019, chapter 8). At rest P = T^1.5/(2 rho A)^0.5/eta. eta is what blades, duct, motor and
driver leave of that, and taken as constant.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from swimbladder.errors import InputError

__all__ = ["Thruster"]


class Thruster(NamedTuple):
    """One or several equal thrusters."""

    diameter: float = 0.076  # m, of the propeller; assumed: that of a small ducted ROV thruster
    efficiency: float = 0.35  # -, of the ideal disc's power; assumed: the same, driver included
    number: int = 1
    idle_power: float = 0.0  # W of each while it turns: friction, controller; 0 favours thrusters

    def checked(self) -> Thruster:
        """Return it; raises InputError where a number makes no sense."""
        for name, value, unit, fine in (
            ("diameter", self.diameter, "m", 0.0 < self.diameter < math.inf),
            ("efficiency", self.efficiency, "", 0.0 < self.efficiency <= 1.0),
            ("number", self.number, "", self.number >= 1),
            ("idle", self.idle_power, "W", 0.0 <= self.idle_power < math.inf),
        ):
            if not fine:
                raise InputError(
                    "no thruster has this", field=f"--thruster-{name}", value=value, unit=unit,
                    remedy="Give a diameter above 0, an efficiency above 0 up to 1, one thruster "
                    "at least, and an idle power of 0 or more",
                )  # fmt: skip
        return self

    def power(self, thrust: Any, density: Any, speed: Any = 0.0) -> Any:
        """Return the electrical power [W] for a `thrust` [N]; arrays too.

        density: of the water [kg/m3]; speed: of advance in the direction of the thrust [m/s]. A
        thrust against the motion is reckoned as at rest: braking is not paid back.
        """
        area = self.number * math.pi / 4.0 * self.diameter**2
        size = np.abs(np.asarray(thrust, float))
        ahead = np.where(np.asarray(thrust) > 0.0, speed, 0.0)
        induced = np.sqrt(ahead**2 / 4.0 + size / (2.0 * density * area)) - ahead / 2.0
        pushed = size * (ahead + induced) / self.efficiency
        return (pushed + self.number * self.idle_power * (size > 0.0))[()]
