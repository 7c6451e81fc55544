"""What becomes of a battery over all cycles: drawn, lost in years, kept back by the cold."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.sizing.candidates import Batch
from swimbladder.design.sizing.requirements import Requirements
from swimbladder.physics.battery import needed_capacity, share_in_cold

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Budget:
    """The energy of new cells at 20 degC that is carried, and its parts [J] [n].

    carried is the sum of drawn by drive and loads, of it driver_loss and driver_standby;
    self_discharged over all cycles; cold: what the coldest water keeps back; reserve, not flown
    with; unusable at any temperature. life: what self-discharge alone leaves over what has to be
    left [-]; no battery is large enough where it is below 1.
    """

    carried: Array
    drawn: Array
    driver_loss: Array
    driver_standby: Array
    self_discharged: Array
    cold: Array
    reserve: Array
    unusable: Array
    life: Array


def budget(b: Batch, asked: Requirements, *, cycle: Array, driver_loss: Array) -> Budget:
    """Return what a battery has to carry for all cycles, by the battery of missions.

    cycle: energy of the drive in one, driver_loss in it [J] [n]. The charge C obeys
    dC/dt = -P - s C from the full capacity, which the charge that cannot be drawn in the coldest
    water and the reserve of what can are left of (`swimbladder.physics.battery`).
    """
    dive = asked.dive
    duration = dive.cycles * dive.cycle_time
    standby = np.full(len(b.of), b.driver.standby_power * duration)
    hotel = dive.cycles * (dive.hotel * dive.cycle_time + dive.surface_energy)
    drawn = dive.cycles * cycle + hotel + standby
    warm = share_in_cold(b.number("battery", "cold_share"), asked.coldest)
    flown = warm * (1.0 - dive.battery_reserve)
    lost = b.number("battery", "self_discharge")
    capacity = needed_capacity(drawn, duration, flown, lost)
    usable = b.number("battery", "usable")
    with np.errstate(invalid="ignore", divide="ignore"):
        return Budget(
            carried=capacity / usable,
            drawn=drawn,
            driver_loss=dive.cycles * driver_loss,
            driver_standby=standby,
            self_discharged=capacity * flown - drawn,
            cold=capacity * (1.0 - warm),
            reserve=capacity * warm * dive.battery_reserve,
            unusable=capacity / usable - capacity,
            life=np.where(flown > 0.0, np.exp(-lost * duration) / (1.0 - flown), 0.0),
        )
