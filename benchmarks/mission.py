"""What every peer runs: the vehicle `feup-em`, an hour of set-points, and a fleet of its kind."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.cascade import CascadeParameters
from swimbladder.control.registry import bind
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.vehicle import Vehicle

__all__ = ["BOTTOM", "START", "Array", "Fleet", "Mission", "fleet", "mission"]

Array = NDArray[np.float64]

BOTTOM = 4.5  # m
START = 1.5  # m
# Ours, within the paper's 0.5 to 4 m. The overshoot of the way up from 4 m and of the way down from
# 0.51 m is such that about three vehicles in four reach the surface and one in five the bottom.
SETPOINTS = ((0.0, 3.0), (600.0, 1.5), (1200.0, 4.0), (1800.0, 0.51), (2400.0, 3.99), (3000.0, 2.0))
DURATION = 3600.0  # s
SPREAD = 0.05  # of K2, T2, psi, T1 and the start depth, uniform to either side
SHORT_STROKE = 150e-6  # m3; the stroke of every sixteenth vehicle, so that it meets its end stops


@dataclass(frozen=True, kw_only=True)
class Mission:
    """An hour in samples: the depth asked for at each, and the law that asks for the voltage."""

    vehicle: Vehicle
    setpoints: tuple[tuple[float, float], ...]  # s, m
    sample_time: float  # s
    reference: Array  # m, at the samples 0..n
    gains: CascadeParameters

    @property
    def samples(self) -> int:
        """Steps from sample to sample."""
        return len(self.reference) - 1

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.samples * self.sample_time


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """Vehicles side by side: every field of `Plant` as an array, and where each starts, at rest."""

    plants: dict[str, Array]
    start_depth: Array  # m

    def __len__(self) -> int:
        return len(self.start_depth)

    @property
    def start_volume(self) -> Array:
        """Neutral volume at the start depth [m3]."""
        return self.plants["psi"] * self.start_depth + self.plants["V_0"]

    def take(self, lanes: list[int]) -> Fleet:
        """Return some of the vehicles."""
        return Fleet(
            plants={name: values[lanes] for name, values in self.plants.items()},
            start_depth=self.start_depth[lanes],
        )

    def plant(self, lane: int) -> Plant:
        """Return one vehicle's plant."""
        return Plant(**{name: float(values[lane]) for name, values in self.plants.items()})


def mission(duration: float = DURATION) -> Mission:
    """Return the mission, its set-points closer together where `duration` [s] is not an hour."""
    vehicle = load_vehicle("feup-em")
    assert vehicle.controller is not None
    sample_time = vehicle.controller.sample_time
    _, gains = bind(vehicle.controller)
    assert isinstance(gains, CascadeParameters)
    setpoints = tuple((at * duration / DURATION, depth) for at, depth in SETPOINTS)
    time = np.arange(round(duration / sample_time) + 1) * sample_time
    starts, depths = (np.array(column) for column in zip(*setpoints, strict=True))
    return Mission(
        vehicle=vehicle,
        setpoints=setpoints,
        sample_time=sample_time,
        reference=depths[np.searchsorted(starts, time + 1e-9, side="right") - 1],
        gains=gains,
    )


def fleet(vehicle: Vehicle, count: int, seed: int = 380) -> Fleet:
    """Return `count` vehicles that differ by a few per cent; the first is the vehicle itself."""
    nominal = plant(vehicle, bottom_depth=BOTTOM)
    simple = nominal.load_drive == nominal.load_back and math.isinf(nominal.epsilon)
    if nominal.positioner or nominal.friction or nominal.k_l or nominal.sag or not simple:
        raise ValueError("the peers are written for linear drag, no leakage and no dry friction")
    plants = {name: np.full(count, value) for name, value in nominal._asdict().items()}
    random = np.random.default_rng(seed)
    factors = 1.0 + SPREAD * random.uniform(-1.0, 1.0, (5, count))
    factors[:, 0] = 1.0
    K2, T2, psi, T1, depth = factors
    plants["a_b"] *= K2 / T2
    plants["a_s"] *= K2 / T2
    plants["d_l"] /= T2
    plants["psi"] *= psi
    plants["T1"] *= T1
    plants["V_max"][15::16] = SHORT_STROKE
    plants["V_min"][15::16] = -SHORT_STROKE
    return Fleet(plants=plants, start_depth=START * depth)
