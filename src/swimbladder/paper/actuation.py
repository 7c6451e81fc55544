"""The prototype's actuator alone, simulated: voltage steps, timed voltages, and none at all."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.control.protocol import timed_voltage
from swimbladder.sim.closed_loop import Solution, drive
from swimbladder.sim.pool import centred_differences, timed_travel
from swimbladder.vehicle import IdentifiedActuator, Vehicle

POOL_DEPTH = 4.5  # m, section 3.2
CLEARANCE = 0.75  # m, ours
TRAVELS = (2.5e-3, 4e-3, 6e-3, 10e-3)  # m, section 3.1, dx


class Pulse(NamedTuple):
    """A timed voltage at a depth: what it moves the piston by, as a formula and simulated [m]."""

    depth: float  # m
    dx: float  # m, asked for
    voltage: float  # V
    time: float  # s
    formula: tuple[float, float]  # when the voltage ends, once the motor stands
    simulated: tuple[float, float]


class Identified(NamedTuple):
    """What voltage steps say of the actuator (section 3.1)."""

    K1: float  # m/s/V
    T1: float  # s
    depth_voltage: float  # V/m, k_z/k_u


def on_bottom(
    vehicle: Vehicle, time: ArrayLike, voltage: ArrayLike, depth: float, volume: float
) -> Solution:
    """Return what voltages at times [s], or one at all, do from a volume [m3] on the bottom."""
    voltages = np.broadcast_to(voltage, np.shape(time))
    start: Any = {"start_depth": depth, "start_volume": volume}
    return drive(vehicle, time=time, voltage=voltages, bottom_depth=depth, **start)


def voltage_steps(vehicle: Vehicle) -> Identified:
    """Find K1, T1 and k_z/k_u from voltage steps on the bottom, where the depth stays the same.

    Speeds are centred differences of the piston's position every 10 ms, as in section 3.1.
    """
    a = vehicle.engine
    assert isinstance(a, IdentifiedActuator)
    h = 0.01
    time = np.arange(301) * h

    def speed(u: float, depth: float) -> Any:
        s = on_bottom(vehicle, time, u, depth, -150e-6)
        return centred_differences(s.volume / a.piston_area, h)

    voltages = [-12.0, -9.0, -6.0, -3.0, 3.0, 6.0, 9.0, 12.0]
    curves = [speed(u, 0.5) for u in voltages]
    steady = [float(np.mean(curve[200:])) for curve in curves]
    K1 = np.polyfit(voltages, steady, 1)[0]  # the load at 0.5 m is in the intercept
    lags = [
        float(np.interp(1.0 - math.exp(-1.0), curve[:100] / final, time[:100]))
        for curve, final in zip(curves, steady, strict=True)
    ]
    depths = [1.0, 25.0, 50.0, 75.0, 100.0]
    slope = np.polyfit(depths, [float(np.mean(speed(6.0, z)[200:])) for z in depths], 1)[0]
    return Identified(float(K1), float(np.mean(lags)), float(-slope / K1))


def timed_voltages(vehicle: Vehicle) -> tuple[Pulse, ...]:
    """Return the timed voltages of section 3.1 at both depths, with the vehicle held in place."""
    a = vehicle.engine
    assert isinstance(a, IdentifiedActuator)
    assert vehicle.supply is not None
    assert vehicle.controller is not None
    pulses = []
    for depth, sign in ((POOL_DEPTH - CLEARANCE, 1.0), (CLEARANCE, -1.0)):
        for dx in TRAVELS:
            limit, h = vehicle.supply.voltage, vehicle.controller.sample_time
            u, samples = timed_voltage(sign * dx, K1=a.K1, limit=limit, sample_time=h)
            dt, load = samples * h, a.depth_voltage * depth
            volume = vehicle.neutral_volume(depth) - 150e-6
            s = on_bottom(vehicle, [0.0, dt, dt + 3.0], [u, load, load], depth, volume)
            _, *moved = ((s.volume - s.volume[0]) / a.piston_area).tolist()
            formula = timed_travel(u, dt, K1=a.K1, T1=a.T1, opposing=load)
            pulses.append(Pulse(depth, sign * dx, u, dt, formula, (moved[0], moved[1])))
    return tuple(pulses)


def unheld_rise(vehicle: Vehicle) -> float:
    """Return how far [m] the vehicle rises after the smallest change, with 0 V at the motor."""
    a = vehicle.engine
    assert isinstance(a, IdentifiedActuator)
    depth = POOL_DEPTH - CLEARANCE
    time, volume = np.arange(0.0, 120.0, 0.3), vehicle.neutral_volume(depth)
    volume += TRAVELS[0] * a.piston_area
    start: Any = {"start_depth": depth, "start_volume": volume}
    s = drive(vehicle, time=time, voltage=np.zeros(len(time)), bottom_depth=POOL_DEPTH, **start)
    return float(depth - s.depth.min())
