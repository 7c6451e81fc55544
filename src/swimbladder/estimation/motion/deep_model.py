"""The vertical motion of a deep vehicle, in what can be identified of it.

::

    m w' = rho g E - k w|w|                  speed w, positive down, k = k_dt or k_dt r rising
    E = M/rho - V_hull(p, T) - V             by how much volume it is too heavy
    V_hull = V_0 (1 - beta p + s p^2/2 + alpha (T - T_ref)) + V_air p_a/(p_a + p)
    V = V_start + sum max(d pumped - short - v_s, 0) - f bled - b bypassed - leaked - l t_idle

with M, V_0, m, the nominal volumes of the runs, what starts fall `short` by and what leaks from the
vehicle's file. What fixes how large all volumes are together is the inertia m, where speeds change
fast enough to show it, M/rho, whose shape the water gives, and what is known before.

Under a constant force and quadratic drag speed and way have closed forms, with slopes:
m w' = F - k w|w|. With v along the force, v_e = (F/k)^(1/2), a = (F k)^(1/2)/m and r = v/v_e::

    v >= 0:  v(t) = v_e (r + tanh at)/(1 + r tanh at),   way = (m/k) ln(cosh at + r sinh at)
    v < 0:   v(t) = v_e (r + tan at)/(1 - r tan at),     way = -(m/k) ln(cos at - r sin at)

the second until it stops at t = atan(-r)/a (e.g. Lamb, *Dynamics*, 2nd ed. 1923, ch. 12, on motion
against the square of the speed). Exact, so that steps may be longer than the vehicle's lag.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.estimation.estimates import Prior
from swimbladder.estimation.motion.deep_dive import DeepDive
from swimbladder.physics.hull import hull_parts, weight_mass
from swimbladder.physics.seawater.column import ATMOSPHERE
from swimbladder.sim.engine.cache import part
from swimbladder.vehicle import PumpAndValve, Vehicle
from swimbladder.vehicle.schema import did_you_mean

_LEAST = 1e-9  # N; some 1e-7 mL of volume


@part
def glide(w, force, mass, down, up, t):  # type: ignore[no-untyped-def]
    """Return speed [m/s] and way [m] after t [s], both by w [-], [s] and by force, as six numbers.

    They are: speed, way, speed by w, speed by force, way by w, way by force. w: speed at the
    beginning [m/s], force [N], mass [kg]; down, up: drag k while sinking and rising [N s2/m2].
    """
    sign = 1.0 if force >= 0.0 else -1.0
    f = max(abs(force), _LEAST)
    v, way = sign * w, 0.0
    if v < 0.0:
        k = down if sign < 0.0 else up
        a, steady = math.sqrt(f * k) / mass, math.sqrt(f / k)
        r = v / steady
        stop = math.atan(-r) / a
        if stop >= t:
            x = a * t
            q = math.tan(x)
            n = 1.0 / (1.0 - r * q)
            speed, grows = steady * (r + q) * n, (1.0 + q * q) * n * n
            by_f = (speed + steady * grows * ((1.0 + r * r) * x - r)) / (2.0 * f)
            length = mass / k
            return (
                sign * speed, -sign * length * math.log(math.cos(x) - r * math.sin(x)),
                grows, by_f, length / steady * q * n,
                length * n * ((q + r) * x - r * q) / (2.0 * f),
            )  # fmt: skip
        one = 1.0 + r * r
        way = -0.5 * mass / k * math.log(one)
        way_v, way_f = -mass / k * r / one / steady, mass / k * r * r / one / (2.0 * f)
        stop_v, stop_f = -1.0 / (steady * one * a), (r / (one * a) - stop) / (2.0 * f)
        speed, on, grows, by_f, way_w, by_way = _along(0.0, f, mass, up if sign < 0.0 else down,
                                                       t - stop)  # fmt: skip
        gain = f / mass * grows
        return (
            sign * speed, sign * (way + on), -gain * stop_v, by_f - gain * stop_f,
            way_v - speed * stop_v, way_f + by_way - speed * stop_f,
        )  # fmt: skip
    speed, on, grows, by_f, way_w, by_way = _along(v, f, mass, up if sign < 0.0 else down, t)
    return sign * speed, sign * on, grows, by_f, way_w, by_way


@part
def _along(v, f, mass, k, t):  # type: ignore[no-untyped-def]
    """Return what `glide` does, of motion along the force."""
    a, steady, length = math.sqrt(f * k) / mass, math.sqrt(f / k), mass / k
    r, x = v / steady, a * t
    q = math.tanh(x)
    n = 1.0 / (1.0 + r * q)
    if x < 20.0:
        way = length * math.log(math.cosh(x) + r * math.sinh(x))
    else:  # cosh and sinh are e^x/2 to the last digit
        way = length * (x + math.log(0.5 * (1.0 + r)))
    speed, grows = steady * (r + q) * n, (1.0 - q * q) * n * n
    return (
        speed, way, grows, (speed + steady * grows * ((1.0 - r * r) * x - r)) / (2.0 * f),
        length / steady * q * n, length * n * ((q + r) * x - r * q) / (2.0 * f),
    )  # fmt: skip


Array = NDArray[np.float64]


class DeepName(NamedTuple):
    """A quantity that can be identified from deep dives."""

    unit: str
    meaning: str
    relative: float  # standard deviation of its default prior, as a share of its mean
    absolute: float  # [unit], added to it


DEEP: dict[str, DeepName] = {
    "drag": DeepName("N s2/m2", "quadratic drag k_dt while sinking", 0.1, 0.0),
    "drag_up": DeepName("", "drag while rising, as a share of that while sinking", 0.0, 0.3),
    "compressibility": DeepName("1/Pa", "of the hull and all in it, at the surface", 0.5, 5e-11),
    "stiffening": DeepName("1/Pa2", "how that falls with pressure", 0.0, 1e-17),
    "thermal_expansion": DeepName("1/K", "of volume, with the logged temperature", 0.5, 5e-5),
    "trapped_air": DeepName("m3", "at the surface; Boyle", 0.5, 2e-5),
    "pump_delivery": DeepName("", "what the pump gives, as a share of its datasheet", 0.3, 0.0),
    "pump_slip": DeepName("1/Pa", "what that share loses per pressure", 0.0, 5e-9),
    "pump_start": DeepName(
        "m3", "what a start falls short by, beyond the vehicle's file", 0.0, 2e-6
    ),
    "valve": DeepName("", "what the valve lets in, as a share of its datasheet", 0.3, 0.0),
    "bypass": DeepName("", "what the bypass lets in, as a share of its datasheet", 0.3, 0.0),
    "creep": DeepName("m3/s", "volume lost with time: leaks, creep, cooling", 0.0, 3e-10),
    "inertia": DeepName("", "mass that is accelerated, as a share of the file's", 0.05, 0.0),
}
# Errors of a cast are no parameters: their deviations say how far it is believed. Sensors are off
# by 0.002 K and 0.01 in salinity, most of it alike at all depths, which moves only the volume at
# the beginning; half a part of that is taken to differ between depths. A cast is of another hour
# and place: layers lie some metres higher or lower.
CAST: dict[str, DeepName] = {
    "cast_density": DeepName("kg/m3", "error of the cast that differs between depths", 0.0, 4e-3),
    "cast_heave": DeepName("m", "by how much layers lie elsewhere than in the cast", 0.0, 5.0),
}
_RHO = 1027.0  # kg/m3, to turn an error of density into one of volume
DEFAULT = tuple(name for name in DEEP if name not in ("trapped_air", "pump_slip", "bypass"))


class Body(NamedTuple):
    """What of a vehicle is not identified."""

    mass: float  # kg, that the water has to carry
    volume: float  # m3, of the hull at the surface, without trapped air
    reference_temperature: float  # degC
    inertia: float  # kg, that is accelerated, as the file has it


def body_of(vehicle: Vehicle) -> Body:
    """Return a vehicle's mass and hull."""
    hull = vehicle.hull
    return Body(
        mass=weight_mass(vehicle), volume=hull.displaced_volume - hull.trapped_air,
        reference_temperature=hull.reference_temperature, inertia=vehicle.mass,
    )  # fmt: skip


def priors_of(vehicle: Vehicle, given: Mapping[str, Prior]) -> dict[str, Prior]:
    """Return what is known of each quantity: as given, else from the vehicle's file.

    Raises InputError where the vehicle has no quadratic drag and none is given.
    """
    actuator = vehicle.actuator
    parts = hull_parts(vehicle)
    volume = sum(part.volume for part in parts)
    mean = {
        "drag": vehicle.drag.k_dt,
        "drag_up": vehicle.drag.rising_ratio,
        "compressibility": sum(x.volume * x.compressibility for x in parts) / volume,
        "stiffening": sum(x.volume * x.stiffening for x in parts) / volume,
        "thermal_expansion": sum(x.volume * x.thermal_expansion for x in parts) / volume,
        "trapped_air": vehicle.hull.trapped_air,
        "pump_delivery": 1.0,
        "pump_slip": 0.0,
        "pump_start": 0.0,
        "valve": 1.0,
        "bypass": 1.0,
        "creep": actuator.creep if isinstance(actuator, PumpAndValve) else 0.0,
        "inertia": 1.0,
        **dict.fromkeys(CAST, 0.0),
    }
    if not mean["drag"] > 0.0 and "drag" not in given:
        raise InputError(
            "deep dives identify quadratic drag, and the vehicle has none to begin with",
            field="motion.drag.k_dt", remedy='Give --prior "drag=160 +- 30 N s2/m2", or k_dt',
        )  # fmt: skip
    return {
        name: given.get(name, Prior(mean[name], about.relative * abs(mean[name]) + about.absolute))
        for name, about in (DEEP | CAST).items()
    }


def cast_volume(body: Body, priors: Mapping[str, Prior], layers: Array) -> Array:
    """Return by what neutral volumes err with the cast [m3] [n], 1 sigma; layers: [m3/m] [n]."""
    sensor = priors["cast_density"].std * body.mass / _RHO**2
    return np.hypot(sensor, priors["cast_heave"].std * np.abs(layers))


def check_deep_names(names: Sequence[str], option: str) -> None:
    """Raise InputError for a name that deep dives cannot identify."""
    for name in names:
        if name not in DEEP:
            raise InputError(
                "there is no such parameter of deep dives", field=option, value=name,
                remedy=f"{did_you_mean(name, DEEP)}Choose from {', '.join(DEEP)}",
            )  # fmt: skip


def check_deep_request(
    vehicle: Vehicle, dives: int, casts: int, *, free: Sequence[str] | None,
    fixed: Sequence[str], priors: Mapping[str, Prior],
) -> None:  # fmt: skip
    """Raise InputError for what cannot be identified, whatever the logs say."""
    if not isinstance(vehicle.actuator, PumpAndValve):
        raise InputError(
            "deep dives are identified for a pump and a valve", field="actuator.kind",
            value=vehicle.actuator.kind, remedy="Describe the actuator as kind pump-valve",
        )  # fmt: skip
    if casts not in (1, dives):
        raise InputError(
            f"{casts} casts for {dives} dives", field="--cast",
            remedy="Give one cast for all dives, or one for each in their order",
        )  # fmt: skip
    check_deep_names(free or (), "--free")
    check_deep_names(fixed, "--set")
    check_deep_names([name for name in priors if name not in CAST], "--prior")
    for name, about in CAST.items():
        if name in priors and priors[name].mean != 0.0:
            raise InputError(
                "it is an error that is not known to either side", field="--prior", value=name,
                remedy="Correct the cast, and give "
                f'--prior "{name}=0 +- {priors[name].std:g} {about.unit}"',
            )  # fmt: skip


def hull_volume(
    body: Body, values: Mapping[str, float], pressure: Array, temperature: Array
) -> Array:
    """Return what the hull displaces, trapped air included [m3]."""
    beta, s, p = values["compressibility"], values["stiffening"], np.asarray(pressure)
    if s > 0.0:
        p = np.minimum(p, max(beta, 0.0) / s)
    solid = 1.0 - beta * p + 0.5 * s * p * p
    solid = solid + values["thermal_expansion"] * (temperature - body.reference_temperature)
    return body.volume * solid + values["trapped_air"] * ATMOSPHERE / (ATMOSPHERE + pressure)


def run_volumes(values: Mapping[str, float], dive: DeepDive) -> Array:
    """Return what each run of pump, valve or bypass added to the drive's volume [m3] [m]."""
    share = values["pump_delivery"] - values["pump_slip"] * dive.action_pressure
    pumped = share * dive.action_volume - dive.action_short - values["pump_start"]
    flow = np.where(dive.action_bypass, values["bypass"], values["valve"])
    return np.where(dive.action_pumps, np.maximum(pumped, 0.0), -flow * dive.action_volume)


def excess(body: Body, values: Mapping[str, float], start: float | Array, dive: DeepDive) -> Array:
    """Return by how much volume the vehicle is too heavy in each piece [m3] [n], E.

    start: the drive's volume when the dive began [m3].
    """
    pieces = dive.pieces
    drive = start + pieces.before @ run_volumes(values, dive)
    drive = drive - pieces.leaked - values["creep"] * pieces.idle
    return np.asarray(
        body.mass / pieces.density
        - hull_volume(body, values, pieces.pressure, pieces.temperature)
        - drive
    )


def drag_volume(values: Mapping[str, float], speed: Array, density: Array, gravity: float) -> Array:
    """Return the volume that drag carries at a speed, k w|w|/(rho g) [m3] [n]."""
    k = values["drag"] * np.where(speed >= 0.0, 1.0, values["drag_up"])
    return np.asarray(k * speed * np.abs(speed) / (density * gravity))
