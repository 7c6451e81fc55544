"""The battery over a mission: what is left in it, what the cold holds back, what the loads draw.

The charge C [J] obeys dC/dt = -P - s C with the power P drawn and the self-discharge s, which over
a stretch of constant power is C exp(-s t) - P (1 - exp(-s t))/s. Cold takes nothing away: of a
full battery the share 1 - k(T) cannot be drawn until it is warm again, with k linear through 1 at
20 degC and `cold_share` at 0 degC.
"""

import math
from typing import Any

import numpy as np

from swimbladder.errors import NoAnswerError
from swimbladder.vehicle import Load, Phase, Supply, Vehicle

WARM = 20.0  # degC at which a battery's capacity is stated


def capacity(vehicle: Vehicle) -> float:
    """Return the energy in the vehicle's full battery [J].

    Raises NoAnswerError where it is not stated.
    """
    return _stated(vehicle.supply)


def _stated(supply: Supply | None) -> float:
    if supply is None or supply.capacity is None:
        raise NoAnswerError(
            "what the battery holds is not stated: add supply.capacity (in Wh or J) to the vehicle"
        )
    return supply.capacity


def share_in_cold(cold_share: Any, temperature: Any) -> Any:
    """Return the share that can be drawn at a `temperature` [degC] of what 20 degC gives.

    cold_share: at 0 degC. Arrays too.
    """
    lost = 1.0 - np.asarray(cold_share, float)
    return np.clip(1.0 - lost * (WARM - np.asarray(temperature, float)) / WARM, 0.0, 1.0)[()]


def usable_share(supply: Supply, temperature: Any) -> Any:
    """Return the share of the capacity that can be drawn at a `temperature` [degC]; arrays too."""
    return share_in_cold(supply.cold_share, temperature)


def usable_charge(supply: Supply, charge: Any, temperature: Any) -> Any:
    """Return what can be drawn [J] of a `charge` [J] at a `temperature` [degC]; arrays too.

    Raises NoAnswerError where the capacity is not stated.
    """
    held_back = (1.0 - usable_share(supply, temperature)) * _stated(supply)
    return np.maximum(np.asarray(charge, float) - held_back, 0.0)[()]


def needed_capacity(energy: Any, duration: Any, share: Any, self_discharge: Any) -> Any:
    """Return the full charge [J] of which `energy` [J], drawn evenly over `duration` [s], is there.

    share: of the full charge that may be gone by then [-]; the cold, or a reserve, keeps the rest.
    self_discharge [1/s]. It solves C e^{-x} - E (1 - e^{-x})/x = C (1 - share) with x = s t, and is
    inf where self-discharge alone takes more than that share. Arrays too.
    """
    x = np.asarray(self_discharge, float) * np.asarray(duration, float)
    mean = np.divide(-np.expm1(-x), x, out=np.ones(np.shape(x)), where=x > 0.0)
    left = np.asarray(share, float) + np.expm1(-x)
    taken = np.asarray(energy, float) * mean
    never = np.full(np.broadcast_shapes(taken.shape, left.shape), np.inf)
    return np.divide(taken, left, out=never, where=left > 0.0)[()]


def lasting_cycles(
    charge: float,
    *,
    reserve: float,
    empty: float,
    energy: float,
    duration: float,
    self_discharge: float,
) -> int | None:
    """Return how many more whole cycles a `charge` [J] lasts; None: for ever.

    A cycle begins with more than the `reserve` [J] and is whole where it ends with no less than
    `empty` [J]. energy [J] is drawn evenly over its `duration` [s], self_discharge [1/s] comes on
    top: after k cycles the charge is (C + E/x) e^{-k x} - E/x with x = s t.
    """
    x = self_discharge * duration

    def until(end: float) -> float:
        """Return the number of cycles [-], not whole, after which the charge is `end` [J]."""
        taken = x * end + energy  # of a cycle that begins with this charge, nearly
        if charge <= end:
            return 0.0
        if taken <= 0.0:
            return math.inf
        k = (charge - end) / taken
        return math.log1p(x * k) / x if x > 0.0 else k

    last, whole = until(reserve), until(empty)
    return None if math.isinf(last) else math.floor(min(math.ceil(last), whole))


def hotel_power(vehicle: Vehicle, phase: Phase | None = None) -> float:
    """Return the power [W] of loads and of the driver's standby in a `phase` of a mission.

    None: of what is on in all phases.
    """
    on = [load.power for load in vehicle.loads if load_is_on(load, phase)]
    standby = 0.0 if vehicle.driver is None else vehicle.driver.standby_power
    return sum(on) + standby


def load_is_on(load: Load, phase: str | None) -> bool:
    """Return whether a load is on in a kind of phase; None: in all of them."""
    return not load.phases or phase in load.phases


def surfacing_energy(vehicle: Vehicle) -> float:
    """Return the energy [J] that the loads take at each surfacing."""
    return sum(load.energy_per_surfacing for load in vehicle.loads)
