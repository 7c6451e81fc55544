"""A float whose actions are seconds: the volumes of its law, when pump and valve become known."""

import numpy as np
from scipy.optimize import minimize_scalar

from swimbladder.control.argo import ARGO, let_in
from swimbladder.control.registry import bind
from swimbladder.physics.arrays import Array
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.steady_drives import valve_flow
from swimbladder.vehicle import Controller, PowerLawPump, PumpAndValve, Vehicle


def as_long(vehicle: Vehicle, filled: Vehicle) -> Controller | None:
    """Return the controller of a filled vehicle: an action of the law `argo` lasts as it did."""
    own, before, after = vehicle.controller, vehicle.engine, filled.engine
    if own is None or own.law != ARGO.name:
        return own
    assert isinstance(before, PumpAndValve)
    assert isinstance(after, PumpAndValve)
    law, rho_g = bind(own)[1], vehicle.water.specific_weight
    numbers = {**own.parameters}
    if isinstance(before.pump, PowerLawPump) and isinstance(after.pump, PowerLawPump):
        seconds = (law.pump_volume + before.start_volume) / before.pump.delivery
        numbers["pump_volume"] = after.pump.delivery * seconds - after.start_volume
        numbers["pump_loss"] = after.pump.slip * seconds * rho_g
    depth = np.linspace(0.05, 1.0, 50) * (vehicle.hull.depth_limit or law.valve_depth or 1000.0)
    head = depth * rho_g + ATMOSPHERIC_PRESSURE - before.internal_pressure
    now = np.array([let_in(law, law.valve_volume, z) for z in depth.tolist()])
    now *= valve_flow(after.valve, head) / valve_flow(before.valve, head)  # in the same seconds

    def shape(half: float) -> Array:
        return depth / np.hypot(depth, half)

    def off(half: float) -> float:
        return float(np.linalg.norm(now - shape(half) * _scaled(shape(half), now)))

    half = float(minimize_scalar(off, bounds=(0.0, depth[-1]), method="bounded").x)
    numbers["valve_depth"], numbers["valve_volume"] = half, _scaled(shape(half), now)
    numbers["gain"] = law.gain * numbers["valve_volume"] / law.valve_volume
    return own.model_copy(update={"parameters": numbers})


def _scaled(shape: Array, values: Array) -> float:
    """Return by what a shape [n] is multiplied to be nearest to values [n]."""
    return float(shape @ values / (shape @ shape))
