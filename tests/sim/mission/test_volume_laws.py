"""Missions by laws of volume changes that are not the mission's own rule."""

import math
from types import FunctionType
from typing import Annotated, NamedTuple, get_type_hints

import numpy as np
import pytest

from swimbladder.control.law import Law, Measurement, leaves
from swimbladder.control.rate import RATE, RateParameters
from swimbladder.control.registry import LAWS
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop.dispatch import compilable
from swimbladder.sim.mission import law_flight
from swimbladder.sim.mission.core.hooks import DEAD
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.orders import law_facts, law_parameters
from swimbladder.sim.mission.prepare import make_plan
from swimbladder.units import parse_quantity
from swimbladder.vehicle import Controller
from tests.quoted import refused
from tests.sim.mission.conftest import phases


def fields(name):
    """The numbers of `rate` as a class of their own, by which a law is found."""
    return NamedTuple(name, list(get_type_hints(RateParameters, include_extras=True).items()))


Copied = fields("Copied")


SEEN = Measurement(0.0, 100.0, 0.0)


def law(name, parameters, step=RATE.step):
    return Law(
        name=name,
        summary="of another package",
        command="volume change",
        parameters=parameters,
        state=RATE.state,
        step=step,
        initial=RATE.initial,
    )


@pytest.fixture(autouse=True)
def copied(monkeypatch):
    """The law `rate` under another name, as a law of another package is found."""
    own = law("copied", Copied)
    monkeypatch.setitem(LAWS._loaded, "copied", own)
    monkeypatch.setattr(type(LAWS), "names", lambda _: [*LAWS.own, "copied"])
    monkeypatch.setattr(
        type(LAWS), "__getitem__", lambda self, name: own if name == "copied" else self.own[name]()
    )


def by_copy(vehicle, mission):
    """The same vehicle and mission, with the numbers of `rate` said to the other law."""
    own = vehicle.controller
    control = Controller(law="copied", sample_time=own.sample_time, parameters=own.parameters)
    stages = [
        phase.model_copy(
            update={"law": "copied", "parameters": leaves(law_parameters(vehicle, phase))}
        )
        for phase in mission.phases
    ]
    return vehicle.model_copy(update={"controller": control}), mission.model_copy(
        update={"phases": tuple(stages)}
    )


def flown_by(parameters=None, number=2, **more):
    """A mission by the copy, whose law has other parameters in one phase."""

    def fly(vehicle, task, sea):
        vehicle, task = by_copy(vehicle, task)
        task.phases[number].parameters.update(parameters or {})
        return fly_mission(vehicle, task, sea, **more)

    return fly


@pytest.mark.prove
def test_the_rule_said_as_a_law_of_another_package_flies_the_same_mission(profiler, sea):
    task = phases(cycles=2)
    rule = fly_mission(profiler, task, sea, seed=4)
    flown = flown_by(seed=4)(profiler, task, sea)
    assert len(rule.notes) > 10
    assert len(rule.cycles) == 2
    for name in ("notes", "cycles"):
        one, other = getattr(flown, name), getattr(rule, name)
        for field in one.dtype.names:
            np.testing.assert_allclose(
                one[field], other[field], rtol=1e-9, atol=1e-9, err_msg=f"{name} {field}"
            )
    for name in ("t", "z", "w", "v", "charge"):
        assert flown.end[name] == pytest.approx(rule.end[name], rel=1e-9)


def test_a_phase_has_parameters_of_its_own(profiler, sea):
    usual = flown_by()(profiler, phases(), sea)
    slow = dict.fromkeys(("far_speed", "near_speed", "slow_speed"), 0.04)
    other = flown_by(slow)(profiler, phases(), sea)
    rose = [flight.rows["t"][flight.rows["phase"] == 2][0] for flight in (usual, other)]
    assert rose[0] == pytest.approx(rose[1], rel=1e-9)  # until there it is the same flight
    assert other.duration > usual.duration + 1000.0


def test_the_processor_dives_with_the_volume_that_the_law_has_for_its_speed(profiler, sea):
    """coefficient far_speed^2 below neutral, in each phase with the law's own numbers."""
    vehicle, task = by_copy(profiler, phases())
    task.phases[1].parameters.update(coefficient=2e-3, far_speed=0.2, dead=77.0)
    stages = make_plan(vehicle, task, sea).stages
    slack = [float(stage["law"][0] * stage["speed"] ** 2) for stage in stages]
    own = vehicle.controller.parameters
    coefficient = parse_quantity(own["coefficient"], "m3 s2/m2")
    usual = coefficient * parse_quantity(own["far_speed"], "m/s") ** 2
    assert slack == pytest.approx([usual, 2e-3 * 0.2**2, usual, usual], rel=1e-9)
    assert stages["law"][1, DEAD] == 77.0


def test_the_law_is_named_with_its_numbers(profiler):
    vehicle, task = by_copy(profiler, phases())
    facts = law_facts(vehicle, task)
    assert {one["law"] for one in facts} == {"copied"}
    assert {one["sample_time_s"] for one in facts} == {None}
    assert facts[0]["parameters"] == leaves(law_parameters(profiler, phases().phases[0]))
    assert "of the phase" in facts[0]["source"]


def test_a_mission_that_was_broken_off_goes_on_to_the_same_end(
    profiler, sea, tmp_path, monkeypatch
):
    monkeypatch.setattr(law_flight.ByRule, "rows", 400)
    task = phases(cycles=2)
    whole = flown_by(seed=4)(profiler, task, sea)
    parts = []

    def stop(share):
        parts.append(share)
        if len(parts) == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        flown_by(seed=4, keep=tmp_path, advance=stop)(profiler, task, sea)
    assert len(list(tmp_path.glob("part-*"))) > 2
    again = flown_by(seed=4, keep=tmp_path)(profiler, task, sea)
    assert again.end.tobytes() == whole.end.tobytes()
    np.testing.assert_array_equal(again.accounts, whole.accounts)


@pytest.mark.parametrize(
    ("field", "value"), [("speed", 0.1), ("check_interval", 60.0), ("rest_band", 2.0)]
)
def test_a_number_of_the_mission_s_own_rule_is_refused(field, value, profiler, sea):
    vehicle, task = by_copy(profiler, phases())
    stages = [task.phases[0], task.phases[1].model_copy(update={field: value}), *task.phases[2:]]
    with refused(InputError, field=f"phases[1].{field}", value=value):
        fly_mission(vehicle, task.model_copy(update={"phases": tuple(stages)}), sea)


def test_one_mission_has_one_law_of_volume_changes(profiler, sea):
    vehicle, task = by_copy(profiler, phases())
    stages = [*task.phases[:3], task.phases[3].model_copy(update={"law": "rate", "parameters": {}})]
    with refused(InputError, field="phases[3].law", value="rate"):
        fly_mission(vehicle, task.model_copy(update={"phases": tuple(stages)}), sea)


class Stepping(NamedTuple):
    """Parameters, one of which is called as a function of the module is."""

    glide: Annotated[float, "m3"]
    pause: Annotated[float, "s"]


def glide(parameters, state, seen, reference):
    """Push out or draw in by steps of one size."""
    change = parameters.glide if seen.depth > reference + 5.0 else 0.0
    if seen.depth < reference - 5.0 and seen.depth - state.old_depth < 1.0:
        change = -parameters.glide
    return change, state._replace(old_depth=seen.depth), parameters.pause


def test_a_parameter_may_be_called_as_a_function_is():
    taken = compilable(glide)
    assert isinstance(taken.__globals__["glide"], FunctionType)  # not compiled: it is not called
    state = RATE.initial(
        law_parameters(load_vehicle("example-float"), phases().phases[0]), SEEN, 9.0
    )
    assert taken(Stepping(1e-6, 60.0), state, SEEN, 9.0)[0] == 1e-6


def never(_parameters, state, _measurement, _reference):
    """Ask to be called again at once."""
    return 0.0, state, 0.0


def lost(_parameters, state, _measurement, _reference):
    """Command no number."""
    return math.nan, state, 60.0


@pytest.mark.parametrize(
    ("step", "says"),
    [
        pytest.param(never, "at once", marks=pytest.mark.prove),
        pytest.param(lost, "not a finite number", marks=pytest.mark.prove),
    ],
)
def test_a_law_that_goes_nowhere_ends_the_mission_with_its_name(
    step, says, profiler, sea, monkeypatch
):
    own = law("copied", fields("Copied"), step)
    monkeypatch.setattr(type(LAWS), "__getitem__", lambda *_: own)
    with pytest.raises(NoAnswerError, match=f"law 'copied' in the phase 'descend', after .*{says}"):
        flown_by()(profiler, phases(), sea)
