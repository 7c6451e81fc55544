"""One design that many tests look at."""

import math

import pytest
from threadpoolctl import threadpool_limits

import swimbladder as sb
from swimbladder.design.experiments import design_experiment
from swimbladder.design.experiments.conditions import Conditions, Question, Setting, ramps
from swimbladder.estimation.motion.problem import model_of


@pytest.fixture(autouse=True, scope="session")
def _one_core():
    """Keep matrices that are too small to share on one core, as the package does."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield


@pytest.fixture(scope="session")
def vehicle():
    return sb.load_vehicle("feup-em")


@pytest.fixture(scope="session")
def setting():
    return Setting(
        bottom_depth=4.5,
        clearance=0.75,
        sample_time=0.3,
        noise=2e-3,
        quantum=5e-3,
        neutral_std=0.5e-6,
        drift_std=0.1e-6 / 60.0,
        delay_std=0.2,
        settling=300.0,
        rest=5.0,
        longest=240.0,
        largest=math.inf,
        moves=4,
    )


@pytest.fixture(scope="session")
def question(vehicle):
    model = model_of(vehicle, bottom_depth=math.inf)
    return Question(model, ("K2", "T2", "psi"), {}, {})


@pytest.fixture(scope="session")
def limits(vehicle, setting):
    return ramps(vehicle, setting)


@pytest.fixture(scope="session")
def conditions(question, setting, limits, vehicle):
    return Conditions(question, setting, limits, vehicle)


@pytest.fixture(scope="session")
def design(vehicle):
    return design_experiment(
        vehicle, bottom_depth=4.5, depth_noise=2e-3, depth_quantum=5e-3, settling=300.0
    )
