"""Waters and missions that the tests of missions share."""

import numpy as np
import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import Column


@pytest.fixture(scope="session")
def profiler():
    """The example float with a pump and a valve, less the leak that keeps it drifting."""
    vehicle = load_vehicle("example-float")
    return vehicle.model_copy(
        update={"actuator": vehicle.actuator.model_copy(update={"leakage": 0.0})}
    )


def stratified(deepest=400.0, step=10.0):
    """A warm layer over a thermocline: smooth functions, as `Column` holds them."""
    depth = np.arange(0.0, deepest + step, step)
    density = 1024.0 + 2.5 * np.tanh((depth - 60.0) / 40.0) + 4.6e-3 * depth
    gravity = 9.81
    layers = 0.5 * (density[1:] + density[:-1]) * gravity * step
    return Column(
        depth=depth,
        pressure=np.concatenate(([0.0], np.cumsum(layers))),
        density=density,
        temperature=14.0 - 5.0 * np.tanh((depth - 60.0) / 40.0),
        gravity=gravity,
        source="a warm layer over a thermocline",
    )


@pytest.fixture(scope="session")
def sea():
    return stratified()


def phases(*, deep=150.0, duration=1800.0, tolerance=5.0, **more):
    return Mission(
        phases=[
            {"kind": "descend", "depth": deep, "tolerance": tolerance},
            {"kind": "park", "depth": deep, "tolerance": tolerance, "duration": duration},
            {"kind": "profile", "depth": 20.0, "tolerance": tolerance},
            {"kind": "surface", "duration": 900.0},
        ],
        **more,
    )
