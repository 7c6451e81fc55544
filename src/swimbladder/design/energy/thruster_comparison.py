"""The same task by a buoyancy engine and by a thruster: hovering with a weight error, profiling.

The question is that of J. Falcao Carneiro et al., IEEE J. Oceanic Eng. (2020); its text was not at
hand, so that what follows is ours, from momentum theory and the vehicle's own numbers.

Hovering: the vehicle weighs so much too much. The engine presses that volume out once, and then
holds it; the thruster pushes all the time. After the break-even time the engine has taken less.

Profiling: down to a depth and back at a constant speed. The engine makes the vehicle heavier than
the water by the drag, then lighter, and follows the neutral volume on the way; the thruster's
vehicle keeps one volume, neutral half-way between its extremes, and pushes against drag and what is
left of weight. Processor and sensors take the same in both and are left out.

What a thruster takes to hold a force, at rest or under way, is by momentum theory. An ideal disc of
area A that pushes with T gives the water the speed 2 v behind it, where

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
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from swimbladder.design.energy.energy_per_volume import Array, DriveEnergy
from swimbladder.errors import check_number
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.hull import neutral_volume


class Thruster(NamedTuple):
    """One or several equal thrusters."""

    diameter: float = 0.076  # m, of the propeller; the T200's
    efficiency: float = 0.35  # -, of the ideal disc's power; the T200's, rounded down
    number: int = 1
    idle_power: float = 0.0  # W of each while it turns: friction, controller; 0 favours thrusters

    def checked(self) -> Thruster:
        """Return it; raises InputError where a number makes no sense."""
        check_number(self.diameter, "diameter", "m", above=0.0)
        remedy = 'Give a share above 0 and up to 1; "35 %" is 0.35'
        check_number(self.efficiency, "efficiency", above=0.0, most=1.0, remedy=remedy)
        check_number(self.number, "number", least=1)
        check_number(self.idle_power, "idle_power", "W", least=0.0)
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


_POINTS = 200  # depths at which a dive is computed


@dataclass(frozen=True, kw_only=True)
class Hovering:
    """Holding a depth with a weight error; arrays over the column's depths [n]."""

    weight_error: float  # m3 of water that it weighs too much
    thrust: Array  # N
    thruster_power: Array  # W
    engine_energy: Array  # J, once; NaN beyond stall
    engine_power: Array  # W, of holding the volume and pressing out what leaks in
    break_even: Array  # s, after which the engine has taken less; inf where never


@dataclass(frozen=True, kw_only=True)
class Profiling:
    """A dive to each depth and back; arrays over the depths [k]. NaN where it cannot be done."""

    speed: float  # m/s
    depth: Array  # m, of the turn
    engine: Array  # J
    thruster: Array  # J
    drag: Array  # J, done on the water by the drag down and up: 2 F z where that is the same
    stroke_depth: float  # m, down to which the stroke suffices
    break_even: float  # m, from where on the engine takes less; inf where never, 0 where always


def hovering(found: DriveEnergy, thruster: Thruster, *, weight_error: float) -> Hovering:
    """Return what holding each depth costs with a `weight_error` [m3], by engine and thruster.

    Raises InputError where the weight error is not above 0.
    """
    check_number(weight_error, "weight_error", "m3", above=0.0)
    column, m = found.column, found.map
    weight = column.density * column.gravity * weight_error
    power = thruster.checked().power(weight, column.density)
    once = found.per_volume * (weight_error + m.start_volume) - m.start_saving
    hold = m.holding_power + np.where(m.leakage > 0.0, m.leakage * found.per_volume, 0.0)
    spared = power - hold
    later = np.divide(once, spared, out=np.full(spared.shape, np.inf), where=spared > 0.0)
    return Hovering(
        weight_error=weight_error,
        thrust=weight,
        thruster_power=power,
        engine_energy=once,
        engine_power=hold,
        break_even=np.where(np.isfinite(once), later, np.inf),
    )


def profiling(found: DriveEnergy, thruster: Thruster, *, speed: float) -> Profiling:
    """Return what a dive to each depth and back costs at a constant `speed` [m/s].

    Raises InputError where the speed is not above 0.
    """
    check_number(speed, "speed", "m/s", above=0.0)
    thruster = thruster.checked()
    vehicle, column = found.vehicle, found.column
    z = np.linspace(0.0, column.deepest, _POINTS + 1)
    over_depth = (neutral_volume(vehicle, column), column.density)
    neutral, density = (np.interp(z, column.depth, values) for values in over_depth)
    force, back = drag_force(vehicle.drag, speed), -drag_force(vehicle.drag, -speed)
    weight = density * column.gravity
    out = np.interp(z, column.depth, found.per_volume)
    flows = np.isfinite(found.per_volume_in)  # at the very surface nothing presses the oil in
    into = np.full(z.shape, np.nan)  # nothing comes in: a battery too weak for the valve
    if flows.any():
        into = np.interp(z, column.depth[flows], found.per_volume_in[flows])
    m = found.map
    idle = m.holding_power + np.where(m.leakage > 0.0, m.leakage * found.per_volume, 0.0)
    rest = np.interp(z, column.depth, idle)
    sinking, rising = neutral - force / weight, neutral + back / weight
    down = _along(sinking, out, into)
    up = _along(rising[::-1], out[::-1], into[::-1])
    up = up[-1] - up[::-1]  # from each depth to the surface
    turn = (rising - sinking) * out
    surface = (rising[0] - sinking[0]) * into[0]
    held = 2.0 * _summed(rest, z) / speed
    engine = np.where(np.isfinite(turn), down + turn + up + surface + held, np.nan)
    highest = np.maximum.accumulate(np.maximum(rising, sinking))
    lowest = np.minimum.accumulate(np.minimum(rising, sinking))
    fits = (highest <= vehicle.stroke.maximum) & (lowest >= vehicle.stroke.minimum)
    engine = np.where(fits, engine, np.nan)

    def pushing(k: int) -> float:
        """Return the energy [J] of the thruster for a dive to the k-th depth and back."""
        part = neutral[: k + 1]
        lift = weight[: k + 1] * (0.5 * (part.min() + part.max()) - part)
        down, up = (
            thruster.power(drag + way * lift, density[: k + 1], speed)
            for drag, way in ((force, 1.0), (back, -1.0))
        )
        return float(_summed(down + up, z[: k + 1])[-1] / speed)

    pushed = np.array([pushing(k) for k in range(z.size)])
    reached = z[: np.argmin(fits)].max(initial=-math.inf)  # before the first that does not fit
    return Profiling(
        speed=speed,
        depth=z,
        engine=engine,
        thruster=pushed,
        drag=(force + back) * z,
        stroke_depth=math.inf if fits.all() else float(reached),
        break_even=_crossing(z, engine, pushed),
    )


def _summed(values: Array, z: Array) -> Array:
    """Return the integral over depth down to each depth, by trapezia."""
    return np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(z))))


def _along(volume: Array, out: Array, into: Array) -> Array:
    """Return the energy [J] of following a volume up to each of its places."""
    change = np.diff(volume)
    price = np.where(change > 0.0, out[1:] + out[:-1], -(into[1:] + into[:-1]))
    cost = np.where(change == 0.0, 0.0, 0.5 * price * change)
    return np.concatenate(([0.0], np.cumsum(cost)))


def _crossing(z: Array, engine: Array, thruster: Array) -> float:
    """Return the depth from which on the engine takes less than the thruster, as far as known."""
    known = np.isfinite(engine) & (z > 0.0)
    dearer = known & (engine >= thruster)
    if not known.any():
        return math.inf
    if not dearer.any():
        return 0.0
    last = int(np.flatnonzero(dearer)[-1])
    if last == int(np.flatnonzero(known)[-1]):
        return math.inf
    gap = engine[last : last + 2] - thruster[last : last + 2]
    return float(z[last] + (z[last + 1] - z[last]) * gap[0] / (gap[0] - gap[1]))
