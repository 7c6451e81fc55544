"""The report's checks of eqs (1)-(37): all are met, and each one notices when it should not be."""

import dataclasses

import numpy as np
import pytest

from swimbladder.control import cascade
from swimbladder.design.linear import StateSpace, transfer
from swimbladder.paper import equations
from swimbladder.paper import evidence as evidences
from swimbladder.paper.equations import actuator_checks, motion_checks
from swimbladder.paper.verdict import EquationCheck, deviation
from swimbladder.physics import actuator, oil
from swimbladder.sim.closed_loop import Solution


def checks(evidence):
    return {c.number: c for c in (*actuator_checks(evidence), *motion_checks(evidence))}


@pytest.fixture(scope="module")
def found(evidence):
    return checks(evidence)


def test_every_equation_is_checked_once(evidence, found):
    assert sorted(found) == list(range(1, 38))
    assert len(actuator_checks(evidence)) + len(motion_checks(evidence)) == 37


@pytest.mark.parametrize("number", range(1, 38))
def test_every_equation_is_met(found, number):
    check = found[number]
    assert check.passed, check.result
    assert 0.0 <= check.value <= check.limit


@pytest.mark.parametrize("number", range(1, 38))
def test_every_check_says_what_was_compared(found, number):
    check = found[number]
    assert check.says
    assert len(check.checked) > 8
    assert f"{check.limit:.0e}" in check.result


def off(value):
    """A value a few per cent off, unevenly so that no ratio hides it."""
    if isinstance(value, float):
        return 1.03 * value
    if isinstance(value, Solution):
        slope = 1.0 + 0.03 * np.arange(len(value.time)) / len(value.time)
        return dataclasses.replace(
            value,
            depth=value.depth * slope,
            speed=value.speed * slope,
            motor_rate=value.motor_rate * slope,
        )
    if isinstance(value, StateSpace):
        return dataclasses.replace(value, A=1.03 * value.A)
    if hasattr(value, "model_copy"):
        return value.model_copy(update={"K1": 1.03 * value.K1, "T1": 1.03 * value.T1})
    if isinstance(value, tuple) and hasattr(value, "_replace"):
        return type(value)(*map(off, value))
    assert isinstance(value, tuple)  # numerator and denominator, or what a law returns
    return (
        (off(value[0]), *value[1:])
        if isinstance(value[0], float)
        else tuple(map(off, value[1::-1]))[::-1]
    )


MUTATIONS = [
    (1, oil, "oil_pressure_rate"),
    (2, oil, "relative_volume_change"),
    (3, actuator, "leakage_volume_rate"),
    (4, actuator, "pump_leakage_flow"),
    (5, actuator, "volume_lost_to_leakage"),
    (6, actuator, "leakage_coefficient"),
    (7, actuator, "hydraulic_load_coefficient"),
    (8, actuator, "hydraulic_volume_per_angle"),
    (9, transfer, "volume_per_voltage"),
    (9, transfer, "volume_per_depth"),
    (10, equations, "acceleration"),
    (11, equations, "motor_rhs"),
    (12, equations, "motor_rhs"),
    (13, equations, "acceleration"),
    (14, equations, "motor_rhs"),
    (15, equations, "drive"),
    (16, equations, "drag_per_mass"),
    (17, equations, "linearise"),
    (18, equations, "linearise"),
    (19, transfer, "volume_per_voltage"),
    (20, transfer, "depth_per_volume_physical"),
    (21, evidences, "drive"),
    (23, actuator, "to_identified"),
    (24, actuator, "to_identified"),
    (23, evidences, "drive"),
    (24, evidences, "drive"),
    (25, equations, "linearise"),
    (26, equations, "fit_speed"),
    (27, equations, "fit_depth"),
    (28, equations, "drive"),
    (29, equations, "drive"),
    (30, transfer, "depth_per_volume_identified"),
    (31, equations, "acceleration"),
    (32, transfer, "depth_per_volume"),
    (33, transfer, "volume_per_voltage_identified"),
    (33, transfer, "volume_per_depth_identified"),
    (34, transfer, "depth_per_voltage"),
    (35, transfer, "depth_per_voltage_without_loads"),
    (36, cascade, "step"),
    (37, cascade, "step"),
]


@pytest.mark.parametrize(("number", "module", "name"), MUTATIONS)
def test_a_check_notices_what_is_off(evidence, monkeypatch, number, module, name):
    true = getattr(module, name)

    def wrong(*args, **kwargs):
        said = true(*args, **kwargs)
        if module is cascade:
            u, state, wait = said
            return u, type(state)(*(1.03 * x for x in state)), wait
        return off(said)

    monkeypatch.setattr(module, name, wrong)
    assert not checks(evidence)[number].passed


def test_eq_22_notices_an_identification_that_is_off(evidence):
    worse = evidence.identified._replace(K1=1.03 * evidence.identified.K1)
    assert not checks(dataclasses.replace(evidence, identified=worse))[22].passed


def test_what_is_not_a_number_does_not_pass():
    check = EquationCheck(number=1, says="", checked="", value=float("nan"), limit=1.0)
    assert not check.passed


def test_deviation_is_the_largest():
    assert deviation([1.0, 2.2], [1.0, 2.0]) == pytest.approx(0.1)
    assert deviation(1.0 + 1.0j, 1.0 + 1.1j) == pytest.approx(0.1 / abs(1.0 + 1.1j))
