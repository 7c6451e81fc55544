"""The sampled loop against simulations, z-transforms and python-control."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.control.cascade import CASCADE
from swimbladder.control.law import Measurement
from swimbladder.control.position_pid import POSITION_PID
from swimbladder.design.linear import BoundLaw, SampledLoop, linearise, linearise_law
from swimbladder.design.linear.sampled import command_slope, discretise
from swimbladder.physics.dynamics import State, motor_rhs, plant

AT_REST = Measurement(0.0, 0.0, 0.0)


def linear(step, parameters, state, *, measurement=AT_REST, tick=0.3):
    law = SimpleNamespace(step=step, initial=lambda *_: state)
    return linearise_law(BoundLaw(law, parameters, tick), measurement)


@pytest.mark.parametrize("depth", [0.0, 80.0])
def test_cascade_is_eqs_36_and_37(depth, table_3):
    """Its z-transform by hand: k_pV (U - V), U = (k_p + k_d (1 - 1/z)/S_p + k_i S_p/(z - 1)) e."""
    seen = Measurement(0.0, depth, 4.04e-6 * depth)
    law = linear(
        CASCADE.step,
        table_3,
        CASCADE.initial(table_3, seen, depth),
        measurement=seen,
    )
    assert law.smooth
    assert law.sample_time == 0.3
    assert law.system.states == ("integral", "error")  # the reference U is only remembered
    p = table_3
    for z in (0.5 + 0.7j, 1.5, -0.9j):
        pid = p.k_pz + p.k_dz * (1 - 1 / z) / p.S_p + p.k_iz * p.S_p / (z - 1)
        np.testing.assert_allclose(
            law.system.at(z)[0, 0], [-p.k_pV * pid, -p.k_pV, p.k_pV * pid], rtol=1e-6
        )
    assert command_slope(law, "volume") == pytest.approx(-1002e3, rel=1e-9)
    assert math.isinf(command_slope(law, "depth"))


def test_position_pid_inside_its_threshold(position_gains):
    """V = -A (K_p e + K_i S_p z/(z - 1) e - K_d (1 - 1/z)/S_p F d), F = a/(1 - (1 - a)/z)."""
    p = position_gains
    seen = Measurement(0.0, 2.0, 6e-7)
    law = linear(
        POSITION_PID.step,
        p,
        POSITION_PID.initial(p, seen, 2.0),
        measurement=seen,
        tick=0.5,
    )
    assert law.smooth
    assert law.system.states == ("integral", "depth")
    for z in (0.5 + 0.7j, 1.5, -0.9j):
        on_error = p.K_p + p.K_i * p.S_p * z / (z - 1)
        on_depth = p.K_d * (1 - 1 / z) / p.S_p * p.smoothing / (1 - (1 - p.smoothing) / z)
        expected = [p.piston_area * (on_error + on_depth), 0.0, -p.piston_area * on_error]
        np.testing.assert_allclose(law.system.at(z)[0, 0], expected, rtol=1e-6, atol=1e-12)


class Memory(NamedTuple):
    wait: float
    clock: float
    filtered: float


def test_law_sets_its_own_pace_and_keeps_a_clock():
    """It is called after whole ticks; a clock that only time moves is no state of the loop."""

    def step(_parameters, state, measurement, _reference):
        dt = measurement.time - state.clock
        filtered = state.filtered + 0.5 * (measurement.depth - state.filtered)
        command = filtered / dt
        return command, Memory(state.wait, measurement.time, filtered), state.wait

    law = linear(step, None, Memory(0.7, 0.0, 0.0), tick=0.3)
    assert law.sample_time == pytest.approx(0.9)
    assert law.system.states == ("filtered",)
    z = 1.3
    assert law.system.at(z)[0, 0, 0] == pytest.approx(0.5 * z / (z - 0.5) / 0.9)


def relay(error):
    return math.copysign(1.0, error) if error else 0.0


@pytest.mark.parametrize(
    ("answer", "smooth"),
    [
        (lambda e: 3.0 * e, True),
        (lambda e: 3.0 * e + 1e-3 * e**3, True),
        (relay, False),
        (lambda e: max(e, 0.0), False),
        (lambda e: e - min(max(e, -5e-5), 5e-5), False),
        (lambda e: round(e / 1e-5) * 1e-5, False),
        (lambda e: e - min(max(e, -1e-2), 1e-2), False),
    ],
    ids=["line", "slight curve", "relay", "one side", "dead band", "rounded", "wide dead band"],
)
def test_kinks_at_rest_are_seen(answer, smooth):
    law = linear(lambda _, s, m, r: (answer(r - m.depth), s, 0.3), None, Memory(0.0, 0.0, 0.0))
    assert law.smooth is smooth


# Discretisation, against integration with the command changed at its instant.


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3, 0.45, 0.9, 1.0])
def test_computation_delay_is_exact(feup, delay):
    """A random sequence of voltages, each applied `delay` after its sample."""
    h, n = 0.3, 12
    p = plant(feup)
    model = linearise(p)
    sampled = discretise(model, h, command_delay=delay)
    u = np.random.default_rng(1).normal(size=n)
    x, ours = np.zeros(len(sampled.states)), []
    for k in range(n):
        ours.append(sampled.C @ x)
        x = sampled.A @ x + sampled.B[:, 0] * u[k]
    instants = sorted({0.0, n * h, *(k * h for k in range(n)), *(k * h + delay for k in range(n))})
    y, theirs, t = np.zeros(4), {0.0: np.zeros(4)}, 0.0
    for end in (i for i in instants if 0.0 < i <= n * h):
        k = math.floor((0.5 * (t + end) - delay) / h)
        value = u[k] if k >= 0 else 0.0
        y = solve_ivp(
            lambda _, y, value=value: model.A @ y + model.B[:, 0] * value,
            (t, end),
            y,
            method="DOP853",
            rtol=1e-12,
            atol=1e-22,
        ).y[:, -1]
        t = end
        theirs[round(t, 9)] = y
    expected = np.array([model.C @ theirs[round(k * h, 9)] for k in range(n)])
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(np.array(ours) / scale, expected / scale, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3, 0.75])
@pytest.mark.parametrize("name", ["feup", "stepper"])
def test_depth_delay_is_exact(name, delay, request):
    """The depth that the law sees is the depth `delay` ago; the volume it sees is of now."""
    h, n = 0.3, 10
    model = linearise(plant(request.getfixturevalue(name)))
    fresh = discretise(model, h)
    late = discretise(model, h, depth_delay=delay)
    fine = discretise(model, h / 60.0)  # 0.005 s: every delay here is a multiple of it
    u = np.random.default_rng(2).normal(size=n)
    back = round(delay / (h / 60.0))
    x, y, v, depths = (np.zeros(len(s.states)) for s in (fresh, late, fine, fine))
    depths = [0.0]
    for k in range(n):
        seen_fresh, seen_late = fresh.C @ x, late.C @ y
        assert seen_late[1] == pytest.approx(seen_fresh[1], rel=1e-12)
        past = len(depths) - 1 - back
        assert seen_late[0] == pytest.approx(
            depths[past] if past >= 0 else 0.0, rel=1e-8, abs=1e-15
        )
        x = fresh.A @ x + fresh.B[:, 0] * u[k]
        y = late.A @ y + late.B[:, 0] * u[k]
        for _ in range(60):
            v = fine.A @ v + fine.B[:, 0] * u[k]
            depths.append(float((fine.C @ v)[0]))


def test_undelayed_sampling_agrees_with_python_control(feup):
    pytest.importorskip("control")
    model = linearise(plant(feup))
    ours, theirs = discretise(model, 0.3), model.to_control().sample(0.3, method="zoh")
    np.testing.assert_allclose(ours.A, theirs.A, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(ours.B, theirs.B, rtol=1e-9, atol=1e-15)
    assert ours.to_control().dt == 0.3


def test_one_delay_at_a_time(feup):
    with pytest.raises(ValueError, match="at once"):
        discretise(linearise(plant(feup)), 0.3, command_delay=0.1, depth_delay=0.1)


# The closed loop, against the law's own step and the nonlinear right-hand side.


@pytest.mark.parametrize("delay", [0.0, 0.12])
def test_closed_loop_is_the_sampled_simulation(feup, paper_loop, table_3, delay):
    """From 1 mm too deep: step by step with the law itself, the motion by Radau between events."""
    p = plant(feup)
    z0, n, h = 1e-3, 15, 0.3
    x = State(0.0, 0.0, z0, 0.0)
    state = CASCADE.initial(table_3, AT_REST, 0.0)
    depths, u = [], 0.0
    for k in range(n):
        depths.append(x.z)
        command, state, _ = CASCADE.step(table_3, state, Measurement(k * h, x.z, x.V), 0.0)
        for span, value in ((delay, u), (h - delay, command)):
            if span > 0.0:
                y = solve_ivp(
                    lambda _, y, value=value: motor_rhs(State(*y), value, p),
                    (0.0, span),
                    x,
                    method="Radau",
                    rtol=1e-10,
                    atol=1e-20,
                ).y[:, -1]
                x = State(*y)
        u = command
    matrix = replace(paper_loop, command_delay=delay).closed()
    y = np.zeros(len(matrix))
    y[2] = z0  # the integral starts at 0, the error before at 0
    ours = []
    for _ in range(n):
        ours.append(y[2])
        y = matrix @ y
    np.testing.assert_allclose(ours, depths, rtol=1e-6)


@pytest.mark.parametrize("name", ["paper_loop", "stepper_loop"])
def test_either_break_closes_to_the_same_poles(name, request):
    loop = request.getfixturevalue(name)
    poles = []
    for broken in (loop.broken_at_command(), loop.broken_at_depth()):
        found = np.linalg.eigvals(broken.A - broken.B @ broken.C)
        poles.append(sorted(found[np.abs(found) > 1e-6], key=lambda z: (z.real, z.imag)))
    np.testing.assert_allclose(*poles, rtol=1e-7, atol=1e-9)


def test_delay_is_continuous_over_whole_samples(paper_loop):
    for whole in (0.3, 0.6):
        below, at = (
            np.max(np.abs(np.linalg.eigvals(replace(paper_loop, command_delay=d).closed())))
            for d in (whole - 1e-9, whole)
        )
        assert below == pytest.approx(at, rel=1e-6)


@pytest.mark.parametrize(("delay", "age"), [(0.0, 1), (0.2, 1), (0.5, 2), (0.7, 2)])
def test_stepper_volume_is_held_between_samples(stepper, delay, age):
    """The measured volume is the last one commanded and carried out, whatever the delay."""
    sampled = discretise(linearise(plant(stepper)), 0.5, command_delay=delay)
    x, seen = np.zeros(len(sampled.states)), []
    for k in range(5):
        seen.append(float((sampled.C @ x)[1]))
        x = sampled.A @ x + sampled.B[:, 0] * (k + 1.0)
    assert seen == [0.0] * age + [k + 1.0 for k in range(5 - age)]


def test_loop_of_two_parts_is_what_it_says(paper_loop):
    """-K(z) P(z), the parts evaluated one by one."""
    assert isinstance(paper_loop, SampledLoop)
    z = 0.9 + 0.3j
    P = discretise(paper_loop.plant, 0.3).at(z)[0, :, 0]
    K = paper_loop.law.system.at(z)[0, 0, :2]
    assert paper_loop.broken_at_command().at(z)[0, 0, 0] == pytest.approx(-(K @ P), rel=1e-9)
    inner = P[0] * K[0] / (1 - K[1] * P[1])
    assert paper_loop.broken_at_depth().at(z)[0, 0, 0] == pytest.approx(-inner, rel=1e-9)
