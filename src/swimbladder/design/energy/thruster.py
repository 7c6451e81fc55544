"""A thruster by momentum theory: what it takes to hold a force, at rest or under way.

An ideal disc of area A that pushes with T gives the water the speed 2 v behind it, where

    T = 2 rho A v (w + v),    P = T (w + v)/eta

with w the speed of advance (Rankine and Froude; J. Carlton, Marine Propellers and Propulsion, 4th
ed. 2019, chapter 8). At rest P = T^1.5/(2 rho A)^0.5/eta. eta is what blades, duct, motor and
driver leave of that, and taken as constant.

The defaults are a small ducted thruster of a remotely operated vehicle: Blue Robotics' T200, whose
propeller has 76 mm. Its maker's bollard pull against electrical power (t200_thrust_power.js in
github.com/bluerobotics/bluerobotics.github.io, 12 V ahead) has eta from 0.35 to 0.44 between 2 and
36 N. Below 1 N eta falls, to 0.14 at 0.4 N, the least it pushes with: some 0.2 W go into
turning at all, which `idle_power` of 0 leaves out.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from swimbladder.errors import InputError


class Thruster(NamedTuple):
    """One or several equal thrusters."""

    diameter: float = 0.076  # m, of the propeller; the T200's
    efficiency: float = 0.35  # -, of the ideal disc's power; the T200's, rounded down
    number: int = 1
    idle_power: float = 0.0  # W of each while it turns: friction, controller; 0 favours thrusters

    def checked(self) -> Thruster:
        """Return it; raises InputError where a number makes no sense."""
        for name, value, unit, fine, remedy in (
            ("diameter", self.diameter, "m", 0.0 < self.diameter < math.inf,
             "Give a length above 0"),
            ("efficiency", self.efficiency, "", 0.0 < self.efficiency <= 1.0,
             'Give a share above 0 and up to 1; "35 %" is 0.35'),
            ("number", self.number, "", self.number >= 1, "Give 1 or more"),
            ("idle_power", self.idle_power, "W", 0.0 <= self.idle_power < math.inf,
             "Give a power of 0 or more"),
        ):  # fmt: skip
            if not fine:
                raise InputError(
                    "no thruster has this", field=name, value=value, unit=unit,
                    remedy=remedy,
                )  # fmt: skip
        return self

    def power(self, thrust: Any, density: Any, speed: Any = 0.0) -> Any:
        """Return the electrical power [W] for a `thrust` [N]; arrays too.

        density: of the water [kg/m3]; speed: of advance in the direction of the thrust [m/s]. A
        thrust against the motion is computed as at rest: braking is not paid back.
        """
        area = self.number * math.pi / 4.0 * self.diameter**2
        size = np.abs(np.asarray(thrust, float))
        ahead = np.where(np.asarray(thrust) > 0.0, speed, 0.0)
        induced = np.sqrt(ahead**2 / 4.0 + size / (2.0 * density * area)) - ahead / 2.0
        pushed = size * (ahead + induced) / self.efficiency
        return (pushed + self.number * self.idle_power * (size > 0.0))[()]
