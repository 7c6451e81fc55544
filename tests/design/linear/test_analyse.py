"""The analysis as a whole: check values, JSON, sentences, and laws of any kind."""

import json
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import swimbladder.design.analysis
from swimbladder.control.cascade import CASCADE
from swimbladder.control.law import Law
from swimbladder.design.analysis import Analysis, analyse
from swimbladder.design.linear.margins import spectral_radius
from swimbladder.errors import InputError
from swimbladder.vehicle import (
    Controller,
    Drag,
    Hull,
    IdentifiedActuator,
    PhysicalMotion,
    Stroke,
    Supply,
    Vehicle,
)
from tests.examples import examples

TABLE_3 = {
    "k_pV": "1002 V/dm3",
    "k_pz": "-0.1043 dm3/m",
    "k_iz": "-7.486e-4 dm3/s/m",
    "k_dz": "-2.341 dm3 s/m",
}


@pytest.fixture(scope="module")
def controlled(feup):
    return feup.model_copy(
        update={"controller": Controller(law="cascade", sample_time=0.3, parameters=TABLE_3)}
    )


@pytest.fixture(scope="module")
def paper(controlled) -> Analysis:
    return analyse(controlled, depth=50.0)


def test_open_loop_as_json(paper):
    """The check values: polynomial to 1e-6, poles."""
    answer = json.loads(json.dumps(paper.to_dict(), allow_nan=False))
    found = answer["open_loop"]
    np.testing.assert_allclose(
        found["denominator"], [3.26700, 36.3900, 0.997115, -0.0320596, -0.00203660], rtol=1e-6
    )
    poles = [complex(*pole) for pole in found["poles"]]
    np.testing.assert_allclose(
        poles, [0.03704, -0.03230 + 0.02172j, -0.03230 - 0.02172j, -11.111], rtol=3e-4
    )
    for pole in poles:
        terms = [c * pole**i for i, c in enumerate(reversed(found["denominator"]))]
        assert abs(sum(terms)) < 1e-9 * max(map(abs, terms))
    assert found["numerator"] == pytest.approx([-0.444e-3 * 7935.54 * 75e-4])
    assert answer["routh"]["right_half_plane"] == 1


def test_numerical_and_printed_34_are_the_same(paper):
    printed = next(t for t in paper.transfer_functions if "34" in t.equations)
    np.testing.assert_allclose(paper.open_loop.denominator, printed.denominator, rtol=1e-9)
    np.testing.assert_allclose(paper.open_loop.numerator, printed.numerator, rtol=1e-9)


def test_closed_loop_of_the_paper(paper):
    found = paper.closed_loop
    assert paper.stable is True
    assert math.degrees(found.at_command.phase) == pytest.approx(41.0, abs=0.5)
    assert found.computation_delay == pytest.approx(0.24, abs=0.005)
    assert found.radius_at_whole_sample > 1.0
    assert found.inner_gain_per_sample == pytest.approx(1.00, abs=0.005)
    assert found.depth_load.extra_psi == pytest.approx(7.7e-8, rel=2e-3)
    assert spectral_radius(found.loop.closed()) == found.spectral_radius < 1.0
    for mode in found.modes:
        if mode.s.real > -math.inf:
            assert np.exp(mode.s * 0.3) == pytest.approx(mode.z)
            assert mode.time_constant == pytest.approx(-1.0 / mode.s.real)
    assert [abs(m.z) for m in found.modes] == sorted((abs(m.z) for m in found.modes), reverse=True)


def test_depth_changes_the_rest_and_not_the_model(controlled, paper):
    surface = analyse(controlled)
    np.testing.assert_allclose(surface.model.A, paper.model.A, rtol=1e-9, atol=1e-15)
    assert surface.operating_point.volume == 0.0
    assert paper.operating_point.voltage == pytest.approx(50.0 * 7.707e-2)
    assert surface.closed_loop.computation_delay == pytest.approx(
        paper.closed_loop.computation_delay, rel=1e-6
    )


def test_what_the_text_says(paper):
    text = "\n".join(paper.sentences)
    for phrase in (
        "one root with a positive real part",
        "doubles in 18.7 s",
        "155.7 m",
        "is above it",
        "leaves the stroke at 86.6 m",
        "before the depth limit",
        "7.69e-08 m3/m",
        "1.9 % of psi",
        "stable; the slowest pole",
        "41.1 degrees",
        "0.236 s of computation delay",
        "it is NOT stable",
        "phase margin is -73.2 degrees",
        "3.85 V",
    ):
        assert phrase in text, phrase


def test_depth_outside_the_stroke_is_said(controlled):
    assert "outside the stroke" in "\n".join(analyse(controlled, depth=95.0).sentences)
    assert "outside the stroke" not in "\n".join(analyse(controlled, depth=80.0).sentences)


def test_without_a_controller_nothing_is_said_of_a_loop(feup):
    found = analyse(feup)
    assert (found.closed_loop, found.stable) == (None, None)
    answer = found.to_dict()
    assert answer["closed_loop"] is None
    assert answer["stable"] is None
    assert "no controller" in "\n".join(found.sentences)


def test_positioner_with_its_pid(stepper, position_gains):
    values = {k: v for k, v in position_gains._asdict().items() if k != "S_p"}
    vehicle = stepper.model_copy(
        update={"controller": Controller(law="position-pid", sample_time=0.5, parameters=values)}
    )
    found = analyse(vehicle, depth=2.0)
    answer = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert answer["command"] == "volume"
    # (32) in the paper's normalisation: T2 s^2 + s - psi K2.
    T2, K2 = 12.0 / 4.0, 9806.65 / 4.0
    assert answer["open_loop"]["denominator"] == pytest.approx([T2, 1.0, -3e-7 * K2])
    assert answer["open_loop"]["numerator"] == pytest.approx([-K2])
    assert (answer["stall"], answer["closed_loop"]["depth_load"]) == (None, None)
    assert answer["closed_loop"]["stable"] is True
    # 1 mm/s and 20 cm2 for half a second; (K_p + K_i S_p + K_d a/S_p) A per metre.
    assert answer["closed_loop"]["volume_per_sample_m3"] == pytest.approx(1e-6)
    first = (0.02 + 2e-4 * 0.5 + 0.3 * 0.4 / 0.5) * 2e-3
    assert answer["closed_loop"]["error_at_rate_limit_m"] == pytest.approx(1e-6 / first)
    assert "rate limit" in "\n".join(found.sentences)


def test_unstable_loop_is_called_so(controlled, table_3):
    wild = table_3._replace(k_pV=4.0 * table_3.k_pV)
    found = analyse(controlled, law=CASCADE, parameters=wild)
    assert found.stable is False
    assert found.closed_loop.at_command is None
    assert found.closed_loop.computation_delay == 0.0
    assert "UNSTABLE" in "\n".join(found.sentences)
    # 3.888 times the gain is the limit that the margin gives.
    limit = analyse(controlled).closed_loop.at_command.gain_up
    for share, stable in ((0.99, True), (1.01, False)):
        gains = table_3._replace(k_pV=share * limit * table_3.k_pV)
        assert analyse(controlled, law=CASCADE, parameters=gains).stable is stable


def test_back_driven_motor_is_judged_too(lossy, monkeypatch):
    """A load that only back-driving sees, and that a weak law does not hold."""
    plant = swimbladder.design.analysis.plant

    def heavier(vehicle):
        return plant(vehicle)._replace(load_back=40.0)

    gains = {"k_pV": "2e4 V/m3", "k_pz": -1e-4, "k_iz": 0.0, "k_dz": -2e-3}
    vehicle = lossy.model_copy(
        update={"controller": Controller(law="cascade", sample_time=0.5, parameters=gains)}
    )
    assert analyse(vehicle).closed_loop.spectral_radius_back_driven < 1.0
    monkeypatch.setattr(swimbladder.design.analysis, "plant", heavier)
    found = analyse(vehicle)
    assert found.closed_loop.spectral_radius < 1.0 < found.closed_loop.spectral_radius_back_driven
    assert found.stable is False


class Nothing(NamedTuple):
    unused: float


def a_law(step, command="voltage"):
    return Law(
        name="own",
        summary="a test's",
        command=command,
        parameters=Nothing,
        state=Nothing,
        step=step,
        initial=lambda _parameters, _measurement, _reference: Nothing(0.0),
    )


def test_own_law_and_sample_time(feup):
    """A proportional law on both measurements; and a relay, for which no margin is made up."""
    smooth = a_law(lambda _p, s, m, r: (-50.0 * (r - m.depth) - 1e5 * m.volume, s, 0.5))
    found = analyse(feup, law=smooth, parameters=Nothing(0.0), sample_time=0.5)
    assert found.closed_loop.sample_time == 0.5
    assert found.stable is False  # without a derivative
    relay = a_law(lambda _p, s, m, r: (math.copysign(12.0, m.depth - r), s, 0.5))
    found = analyse(feup, law=relay, parameters=Nothing(0.0), sample_time=0.5)
    assert found.closed_loop is None
    assert "not linear around rest" in "\n".join(found.sentences)
    assert found.to_dict()["notes"]


def test_bad_input_is_refused(feup, controlled):
    law = a_law(lambda _p, s, _m, _r: (0.0, s, 0.5), command="volume")
    with pytest.raises(InputError, match="takes a voltage"):
        analyse(feup, law=law, parameters=Nothing(0.0), sample_time=0.5)
    with pytest.raises(InputError, match="sample time"):
        analyse(feup, law=CASCADE)
    for depth in (-1.0, math.nan, math.inf):
        with pytest.raises(InputError, match="depth"):
            analyse(controlled, depth=depth)


def test_quadratic_drag_has_no_K2(feup):
    vehicle = feup.model_copy(
        update={
            "motion": PhysicalMotion(dry_mass=45.0, drag=Drag(law="quadratic", k_dt=20.0)),
        }
    )
    found = analyse(vehicle)
    assert {"30", "32", "34", "35"}.isdisjoint(
        e for t in found.transfer_functions for e in t.equations
    )
    assert found.open_loop.denominator[0] == pytest.approx(0.09)  # T1, as T2 does not exist
    assert found.double_integrator_phase_margin is None
    assert "quadratic" in "\n".join(found.sentences)


def test_vehicle_with_everything(lossy):
    """Friction, sag, leak, a stiff hull: every sentence that the paper's vehicle does not need."""
    text = "\n".join(analyse(lossy, depth=150.0).sentences)
    for phrase in (
        "only gives way below",
        "if the supply did not sag",
        "the pump leaks more than it moves",
        "is stiffer than water does not help",
        "laminar one of small speeds",
    ):
        assert phrase in text, phrase


def decades(low, high):
    return st.floats(low, high).map(lambda x: 10.0**x)


@given(
    K1=decades(-5, -2),
    T1=decades(-2, 0),
    area=decades(-4, -2),
    load=st.just(0.0) | decades(-4, -0.5),
    k_l=st.just(0.0) | decades(-12, -8),
    psi=st.sampled_from([-1.0, 0.0, 1.0]),
    softness=decades(-9, -5),
    mass=decades(0, 3),
    k_dl=st.just(0.0) | decades(-1, 2),
    h=decades(-1.3, 0.7),
    k_pV=decades(2, 9),
    k_pz=decades(-8, -2),
    integral=decades(-5, 0),
    derivative=decades(0, 3),
    depth=st.just(0.0) | decades(-1, 3.5),
)
@example(  # LAPACK's QZ iteration did not converge for the pencil of |L| = 1, nor for the next
    K1=1e-5,
    T1=0.1,
    area=1e-4,
    load=0.0,
    k_l=0.0,
    psi=-1.0,
    softness=1e-8,
    mass=1.0,
    k_dl=10.0,
    h=0.1,
    k_pV=1e9,
    k_pz=1e-8,
    integral=10.0**-1.5,
    derivative=1.0,
    depth=0.0,
)
@example(
    K1=10.0**-3.2421875,
    T1=0.14669926516401602,
    area=10.0**-3.5,
    load=0.0,
    k_l=0.0,
    psi=-1.0,
    softness=1e-6,
    mass=10.0**0.875,
    k_dl=10.0,
    h=10.0**-1.28125,
    k_pV=1e8,
    k_pz=1e-7,
    integral=1.0,
    derivative=1.0,
    depth=0.0,
)
@example(  # four poles at 1: z I - A was singular to rounding at the lowest frequencies
    K1=1e-4,
    T1=1.0,
    area=1e-4,
    load=0.0,
    k_l=0.0,
    psi=0.0,
    softness=1e-5,
    mass=1.0,
    k_dl=0.0,
    h=1.0,
    k_pV=1e8,
    k_pz=1e-6,
    integral=1e-5,
    derivative=10.0,
    depth=0.0,
)
@examples(60)
def test_any_vehicle_gets_an_answer(
    K1, T1, area, load, k_l, psi, softness, mass, k_dl, h, k_pV, k_pz, integral, derivative, depth
):
    """Fast motors, undamped hulls, wild gains: JSON without NaN, and margins that hold."""
    gains = {"k_pV": k_pV, "k_pz": -k_pz, "k_iz": -k_pz * integral, "k_dz": -k_pz * derivative}
    drag = Drag(law="linear", k_dl=k_dl) if k_dl else Drag(law="quadratic", k_dt=10.0)
    vehicle = Vehicle(
        name="any",
        actuator=IdentifiedActuator(K1=K1, T1=T1, piston_area=area, depth_voltage=load, k_l=k_l),
        supply=Supply(voltage=12.0),
        stroke=Stroke(minimum=-1e-3, maximum=1e-3),
        hull=Hull(displaced_volume=0.03, psi=psi * softness, waterplane_area=0.03, height=1.0),
        motion=PhysicalMotion(dry_mass=mass, drag=drag),
        controller=Controller(law="cascade", sample_time=h, parameters=gains),
    )
    found = analyse(vehicle, depth=depth)
    answer = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert answer["stable"] is (answer["closed_loop"]["spectral_radius"] < 1.0)
    assert "\n".join(found.sentences)
    c = found.closed_loop
    if not c.stable:
        assert c.at_command is None
        return
    loop = c.loop.broken_at_command()
    for k in np.geomspace(max(c.at_command.gain_down, 1e-4), min(c.at_command.gain_up, 1e4), 21)[
        1:-1
    ]:
        assert spectral_radius(loop.A - k * loop.B @ loop.C) < 1.0 + 1e-9
    for share in (0.3, 0.7, 0.99):
        delay = share * min(c.computation_delay, 50.0 * h)
        assert spectral_radius(replace(c.loop, command_delay=delay).closed()) < 1.0 + 1e-9
