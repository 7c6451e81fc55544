"""Steps of volume too coarse for a band: it is chance whether it is held, and that is said."""

import numpy as np
import pytest

from swimbladder.errors import NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.records import Account
from swimbladder.sim.mission.core.phases import Holding
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import make_plan
from swimbladder.sim.mission.result import MissionResult
from swimbladder.sim.mission.words import coarse_words
from swimbladder.vehicle import Vehicle

HOLD = Mission(
    phases=[
        {"kind": "hold", "depth": 800.0, "duration": 10_800.0},
        {"kind": "surface", "duration": 600.0},
    ]
)


def stepping(vehicle: Vehicle, step: str) -> Vehicle:
    law = vehicle.controller
    assert law is not None
    parameters = {**law.parameters, "volume_step": step}
    return vehicle.model_copy(
        update={"controller": law.model_copy(update={"parameters": parameters})}
    )


def alike(vehicle: Vehicle, rng: np.random.Generator) -> Vehicle:
    """Return the vehicle with drag and valve as far off as dives tell them, 2.6 %."""
    drag, valve = vehicle.drag, vehicle.actuator.valve
    return vehicle.model_copy(
        update={
            "drag": drag.model_copy(update={"k_dt": drag.k_dt * (1.0 + 0.026 * rng.normal())}),
            "actuator": vehicle.actuator.model_copy(
                update={
                    "valve": valve.model_copy(
                        update={"flow": valve.flow * (1.0 + 0.026 * rng.normal())}
                    )
                }
            ),
        }
    )


def shares(vehicle: Vehicle, count: int) -> np.ndarray:
    column = uniform_column(vehicle.water, 1200.0)
    rng, found = np.random.default_rng(4), []
    for _ in range(count):
        flown = fly_mission(alike(vehicle, rng), HOLD, column, checked=False)
        kept = flown.accounts[len(Account) :]
        found.append(kept[Holding.INSIDE] / kept[Holding.TIME])
    return np.array(found)


def test_steps_of_a_fifth_of_the_band_hold_and_of_the_whole_band_by_chance() -> None:
    """Floats a few percent apart: all hold with the file's step, not all with the whole band's."""
    vehicle = load_vehicle("example-float")
    assert shares(vehicle, 12).min() > 0.95
    coarse = shares(stepping(vehicle, "1 cm3"), 12)
    assert coarse.min() < 0.9 < coarse.max()


@pytest.mark.parametrize(("step", "said"), [("0.24 cm3", False), ("0.26 cm3", True)])
def test_what_a_band_holds_by_hand(step: str, said: bool) -> None:
    """20 m of a neutral volume that falls by some 0.05 cm3 per metre are 1 cm3."""
    vehicle = stepping(load_vehicle("example-float"), step)
    plan = make_plan(vehicle, HOLD, uniform_column(vehicle.water, 1200.0))
    words = coarse_words(HOLD, plan, 0)
    assert bool(words) is said
    if said:
        assert "move the depth of rest by 5" in words
        assert "the band is 20 m" in words
    assert coarse_words(HOLD, plan, 1) == ""


def test_a_hold_that_fails_names_the_step() -> None:
    vehicle = stepping(load_vehicle("example-float"), "3 cm3")
    column, due = uniform_column(vehicle.water, 1200.0), "its 3 cm3 move the depth of rest"
    with pytest.raises(NoAnswerError, match=f"Lessen volume_step: {due}"):
        fly_mission(vehicle, HOLD, column)
    reasons = MissionResult(fly_mission(vehicle, HOLD, column, checked=False), None).reasons
    assert any(due in one for one in reasons)
