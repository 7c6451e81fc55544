"""What simulate and drive refuse: each message names the field and the remedy."""

import math
from typing import Any

import numpy as np
import pytest

from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.control.position_pid import POSITION_PID
from swimbladder.errors import InputError
from swimbladder.io.mission import Mission
from swimbladder.sim.closed_loop import drive, simulate
from swimbladder.vehicle import Supply
from tests.oracle import TABLE_3
from tests.vehicles import paper, stepper

GAINS = CascadeParameters(**TABLE_3)
RUN: dict[str, Any] = dict(setpoints=[(0.0, 3.0)], duration=6.0, start_depth=1.5)


def refused(function: Any, vehicle: Any, field: str, says: str, **given: Any) -> InputError:
    with pytest.raises(InputError, match=says) as caught:
        function(vehicle, **given)
    assert caught.value.field == field
    assert str(caught.value).startswith(f"{field}: ")
    assert caught.value.exit_code == 2
    return caught.value


@pytest.mark.parametrize(
    ("field", "says", "given"),
    [
        ("start_depth", "not a finite", dict(start_depth=math.nan)),
        ("start_volume", "not a finite", dict(start_volume=math.inf)),
        ("start_speed", "not a finite", dict(start_speed=-math.inf)),
        ("start_depth", "below the bottom at 1 m", dict(bottom_depth=1.0)),
        ("bottom_depth", "not a number", dict(bottom_depth=math.nan)),
        ("start_depth", "outside the water", dict(start_depth=-1.3, checked=False)),
        (
            "start_depth",
            "-350 to 350 cm3.*neutral volume at 200 m",
            dict(start_depth=200.0, checked=False),
        ),
        ("start_volume", "does not hold this volume", dict(start_volume=3.51e-4)),
        ("duration", "above 0", dict(duration=0.0)),
        ("duration", "above 0", dict(duration=-1.0)),
        ("duration", "above 0", dict(duration=math.nan)),
        ("duration", "samples", dict(duration=1e9)),
        ("setpoints", "no set-point", dict(setpoints=[])),
        ("setpoints", "not a finite", dict(setpoints=[(0.0, math.nan)])),
        ("setpoints", "not a finite", dict(setpoints=[(0.0, 1.0), (math.inf, 2.0)])),
        ("setpoints", "at time 0", dict(setpoints=[(1.0, 3.0)])),
        ("setpoints", "must grow", dict(setpoints=[(0.0, 3.0), (5.0, 2.0), (5.0, 1.0)])),
        ("setpoints", "must grow", dict(setpoints=[(0.0, 3.0), (5.0, 2.0), (4.0, 1.0)])),
        ("setpoints", "not a list of", dict(setpoints=[3.0])),
        ("setpoints", "not a list of", dict(setpoints=[(0.0, "three")])),
        ("sample_time", "above 0", dict(sample_time=0.0)),
        ("sample_time", "above 0", dict(sample_time=math.inf)),
        ("sample_time", "above 0", dict(sample_time=-0.3, law=lambda *_: 0.0)),
        ("seed", "whole number", dict(seed=-1)),
        ("seed", "whole number", dict(seed=1.5)),
        ("seed", "whole number", dict(seed=True)),
        ("parts", "at least 1", dict(parts=0)),
        ("parts", "at least 1", dict(parts=2.0)),
        ("law", "not a control law", dict(law="cascade")),
        ("parameters", "needs its parameters", dict(law=CASCADE, sample_time=0.3)),
        ("sample_time", "needs its parameters and its", dict(law=CASCADE, parameters=GAINS)),
        ("parameters", "not the parameters of the law 'cascade'", dict(parameters=tuple(GAINS))),
        ("parameters", "not the parameters of the law", dict(parameters={"k_pV": 1.0})),
    ],
)
def test_simulate(field: str, says: str, given: dict[str, Any]) -> None:
    error = refused(simulate, paper(), field, says, **RUN | given)
    if field in ("start_depth", "start_volume", "setpoints") and "finite" not in says:
        assert error.remedy or error.unit


def test_what_is_asked_is_said_in_one_way() -> None:
    vehicle = paper()
    mission = Mission(setpoints=[{"time": 0.0, "depth": 3.0}], start_depth=1.5, duration=6.0)
    by_setpoints = simulate(vehicle, **RUN)
    for given in (dict(mission=mission), dict(step=(1.5, 3.0), duration=6.0)):
        run = simulate(vehicle, **given)
        np.testing.assert_array_equal(run.depth, by_setpoints.depth)
    refused(simulate, vehicle, r"setpoints[0].depth", "bottom at 2 m", mission=mission.over(2.0))
    for name, value in RUN.items():
        refused(simulate, vehicle, name, "mission says this", **{"mission": mission, name: value})
    refused(simulate, vehicle, "step", "set-points say this", **RUN, step=(1.5, 3.0))
    refused(simulate, vehicle, "start_depth", "begins there", step=(1.5, 3.0), start_depth=1.0)
    refused(simulate, vehicle, "step", "below the bottom", step=(5.0, 3.0), bottom_depth=4.0)
    refused(simulate, vehicle, "step", "finite", step=(1.5, math.nan))
    for name in ("duration", "start_depth"):
        lacks = {key: value for key, value in RUN.items() if key != name}
        refused(simulate, vehicle, name, "with set-points it is needed", **lacks)


def test_the_message_tells_value_unit_and_remedy() -> None:
    error = refused(
        simulate, paper(), "start_depth", "below the bottom", **RUN, bottom_depth=1.0, checked=False
    )
    assert str(error) == (
        "start_depth: the start is below the bottom at 1 m (got 1.5, expected unit m). "
        "Start above the bottom."
    )


def test_a_law_for_another_kind_of_actuator() -> None:
    refused(
        simulate,
        stepper(),
        "controller.law",
        "commands a voltage, but .* takes a volume",
        **RUN,
        law=CASCADE,
        parameters=GAINS,
        sample_time=0.3,
    )
    gains = POSITION_PID.parameters(*[1.0] * 10)
    refused(
        simulate,
        paper(),
        "controller.law",
        "commands a volume, but .* takes a voltage",
        **RUN,
        law=POSITION_PID,
        parameters=gains,
        sample_time=0.3,
    )


def test_a_vehicle_without_a_controller() -> None:
    error = refused(simulate, paper(controller=None), "controller", "no controller", **RUN)
    assert "[controller]" in str(error)
    refused(
        simulate,
        paper(controller=None),
        "sample_time",
        "needs a sample time",
        **RUN,
        law=lambda *_: 0.0,
    )


def test_a_battery_that_sags_at_an_unknown_motor() -> None:
    vehicle = paper(supply=Supply(voltage=12.0, internal_resistance=0.2))
    error = refused(simulate, vehicle, "supply.internal_resistance", "are not known", **RUN)
    assert error.unit == "ohm"


TIME = [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("field", "says", "given"),
    [
        ("volume, voltage", "either", dict()),
        ("volume, voltage", "either", dict(volume=[0.0] * 3, voltage=[0.0] * 3)),
        ("volume", r"shape \(2,\)", dict(volume=[0.0, 1e-5])),
        ("voltage", r"shape \(3, 1\)", dict(voltage=np.zeros((3, 1)))),
        ("volume", "entry 1 is not a finite", dict(volume=[0.0, math.nan, 0.0])),
        ("time", "entry 2 is not a finite", dict(time=[0.0, 1.0, math.inf], volume=[0.0] * 3)),
        ("time", "at least two", dict(time=[0.0], volume=[0.0])),
        ("time", "entry 2 does not", dict(time=[0.0, 1.0, 1.0], volume=[0.0] * 3)),
        ("start_volume", "brings its own start", dict(volume=[0.0] * 3, start_volume=0.0)),
        ("start_depth", "not a finite", dict(volume=[0.0] * 3, start_depth=math.nan)),
        ("start_speed", "not a finite", dict(voltage=[0.0] * 3, start_speed=math.nan)),
        ("start_depth", "below the bottom", dict(voltage=[0.0] * 3, bottom_depth=4.0)),
        ("bottom_depth", "not a number", dict(volume=[0.0] * 3, bottom_depth=math.nan)),
        ("start_volume", "does not hold", dict(voltage=[0.0] * 3, start_volume=1e-3)),
    ],
)
def test_drive(field: str, says: str, given: dict[str, Any]) -> None:
    refused(drive, paper(), field, says, **dict(time=TIME, start_depth=5.0) | given)


def test_a_positioner_has_no_voltage() -> None:
    error = refused(
        drive,
        stepper(),
        "voltage",
        "not driven by a voltage",
        time=TIME,
        voltage=[0.0] * 3,
        start_depth=5.0,
    )
    assert error.remedy == "Give the volume"
