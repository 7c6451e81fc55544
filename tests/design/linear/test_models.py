"""State-space models against the paper's equations and against the nonlinear motion."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.signal import ss2tf

from swimbladder.design.linear.models import (
    StateSpace,
    linearise,
    operating_point,
    polynomials,
)
from swimbladder.physics.dynamics import State, acceleration, motor_rhs, plant
from swimbladder.vehicle import (
    Drag,
    Hull,
    PhysicalMotion,
    Stroke,
    Supply,
    UnifiedActuator,
    Vehicle,
    Water,
)


def a_vehicle(**changes):
    """A unified actuator and physical motion, every constant of eqs (11)-(13) given."""
    c = dict(
        inertia=3e-5, k_u=0.06, k_v=1.5e-3, k_q=2e-8, k_z=3e-4, k_l=1e-9, m=45.0, psi=2e-6, k_dl=3.0
    )
    c.update(changes)
    actuator = UnifiedActuator(**{k: c[k] for k in ("inertia", "k_u", "k_v", "k_q", "k_z", "k_l")})
    return c, Vehicle(
        name="any",
        water=Water(density=1025.0),
        actuator=actuator,
        supply=Supply(voltage=24.0),
        stroke=Stroke(minimum=-5e-4, maximum=5e-4),
        hull=Hull(displaced_volume=0.04, psi=c["psi"], waterplane_area=0.03, height=1.0),
        motion=PhysicalMotion(
            dry_mass=c["m"], drag=c.get("drag", Drag(law="linear", k_dl=c["k_dl"]))
        ),
    )


factor = st.floats(0.1, 10.0)


def eqs_17_and_18(inertia, k_u, k_v, k_q, k_z, k_l, k_b, k_def, k_dl, m):
    """Return A and B of states (dV/dt, V, z, w) and input u."""
    A = [
        [-k_v / inertia, 0.0, -(k_l * k_v + k_q * k_z) / inertia, -k_l],
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [0.0, -k_b / m, k_def / m, -k_dl / m],
    ]
    return np.array(A), np.array([[k_u * k_q / inertia], [0.0], [0.0], [0.0]])


@given(
    factors=st.tuples(*[factor] * 8),
    k_l=st.just(0.0) | st.floats(1e-10, 1e-7),
    depth=st.floats(0.0, 2000.0),
    softer=st.booleans(),
)
def test_numeric_jacobian_is_eqs_17_and_18(factors, k_l, depth, softer):
    c, _ = a_vehicle()
    names = ("inertia", "k_u", "k_v", "k_q", "k_z", "m", "psi", "k_dl")
    scaled = {name: c[name] * f for name, f in zip(names, factors, strict=True)}
    scaled["psi"] *= 1.0 if softer else -1.0
    c, vehicle = a_vehicle(**scaled, k_l=k_l)
    k_b = vehicle.water.specific_weight
    A, B = eqs_17_and_18(
        **{k: c[k] for k in ("inertia", "k_u", "k_v", "k_q", "k_z", "k_l", "k_dl", "m")},
        k_b=k_b,
        k_def=k_b * c["psi"],
    )
    numeric = linearise(plant(vehicle), depth=depth)
    # (dV/dt, V, z, w) = T (q, V, z, w), because dV/dt = q - k_l z.
    T = np.eye(4)
    T[0, 2] = -c["k_l"]
    inverse = np.linalg.inv(T)
    scale = np.abs(T) @ np.abs(numeric.A) @ np.abs(inverse)
    rounding = 1e-16  # of differences of numbers about 1, beside leakages of 1e-10 m2/s
    assert np.all(np.abs(T @ numeric.A @ inverse - A) <= 1e-9 * scale + rounding)
    np.testing.assert_allclose(T @ numeric.B, B, rtol=1e-9, atol=0.0)


@pytest.mark.parametrize(
    ("drag", "slope"),
    [
        (Drag(law="linear", k_dl=3.0), 3.0),
        (Drag(law="quadratic", k_dt=50.0), 0.0),
        (Drag(law="blended", k_dl=3.0, k_dt=50.0), 3.0),
        (Drag(law="switched", k_dl=3.0, k_dt=50.0, epsilon=1e-3), 3.0),
        (Drag(law="switched-literal", k_dl=3.0, k_dt=50.0, epsilon=1e-3), 3.0),
    ],
    ids=lambda x: getattr(x, "law", ""),
)
def test_drag_has_its_slope_of_rest(drag, slope):
    _, vehicle = a_vehicle(drag=drag)
    model = linearise(plant(vehicle))
    assert -model.A[3, 3] * vehicle.mass == pytest.approx(slope, rel=1e-12, abs=1e-12)


def test_back_driven_motor_carries_the_smaller_load(lossy):
    p = plant(lossy)
    driving, back = linearise(p).A, linearise(p, back_driving=True).A
    # k_z/k_u = 0.004 V/m, of which back-driving leaves the efficiency squared.
    assert driving[0, 2] * p.T1 / p.gain == pytest.approx(-0.004, rel=1e-12)
    assert back[0, 2] == pytest.approx(0.36 * driving[0, 2], rel=1e-12)
    changed = np.argwhere(np.abs(driving - back) > 1e-12 * np.abs(driving))
    assert changed.tolist() == [[0, 2]]


@pytest.mark.parametrize("depth", [0.0, 50.0])
def test_small_motions_follow_the_linear_model(lossy, depth):
    """Half a volt above the rest: the nonlinear right-hand side, integrated, against exp(A t)."""
    p = plant(lossy)
    model = linearise(p, depth=depth)
    rest = operating_point(p, depth=depth + 1.0)
    du, t = 0.5, 2.0
    start = State(rest.motor_rate, rest.volume, rest.depth, 0.0)
    solution = solve_ivp(
        lambda _, x: motor_rhs(State(*x), rest.voltage + du, p),
        (0.0, t),
        start,
        method="Radau",
        rtol=1e-10,
        atol=1e-16,
    )
    block = np.zeros((5, 5))
    block[:4, :4], block[:4, 4:] = model.A, model.B * du
    expected = np.array(start) + expm(block * t)[:4, 4]
    moved = np.abs(expected - start)
    assert np.all(np.abs(solution.y[:, -1] - expected) <= 1e-6 * moved)


def test_rest_is_a_rest(lossy):
    p = plant(lossy)
    rest = operating_point(p, depth=80.0)
    x = State(rest.motor_rate, rest.volume, rest.depth, 0.0)
    assert np.abs(motor_rhs(x, rest.voltage, p)) == pytest.approx(0.0, abs=1e-18)
    # Between the two voltages a motor without leakage does not turn; just outside it does.
    tight = p._replace(k_l=0.0)
    rest = operating_point(tight, depth=80.0)
    for voltage, sign in (
        (rest.voltage + 1e-6, 1),
        (rest.voltage - 1e-6, 0),
        (rest.voltage_back + 1e-6, 0),
        (rest.voltage_back - 1e-6, -1),
    ):
        assert np.sign(motor_rhs(State(0.0, rest.volume, 80.0, 0.0), voltage, tight).q) == sign


def test_positioner_leaves_the_motion(stepper):
    p = plant(stepper)
    model = linearise(p)
    assert (model.states, model.inputs) == (("z", "w"), ("V",))
    m, k_b = 12.0, 9806.65
    np.testing.assert_allclose(model.A, [[0.0, 1.0], [k_b * 3e-7 / m, -4.0 / m]], rtol=1e-12)
    np.testing.assert_allclose(model.B, [[0.0], [-k_b / m]], rtol=1e-12)
    assert acceleration(1e-6, 5.0, 0.0, p) == pytest.approx(
        model.A[1, 0] * 5.0 + model.B[1, 0] * 1e-6
    )


def test_open_loop_polynomial_of_the_paper(feup):
    """The check values of (34): K2 = 7935.54, T2 = 36.3, psi = 4.04e-6, A = 75 cm2."""
    model = linearise(plant(feup))
    numerator, denominator = polynomials(model.part(output="z", input="u"))
    expected = [3.26700, 36.3900, 0.997115, -0.0320596, -0.00203660]
    np.testing.assert_allclose(np.array(denominator) * 0.09 * 36.3, expected, rtol=1e-6)
    assert len(numerator) == 1
    assert numerator[0] * 0.09 * 36.3 == pytest.approx(-0.444e-3 * 7935.54 * 75e-4, rel=1e-12)
    np.testing.assert_allclose(
        model.poles, [0.03704, -0.03230 + 0.02172j, -0.03230 - 0.02172j, -11.111], rtol=3e-4
    )


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_polynomials_agree_with_scipy(n, seed):
    rng = np.random.default_rng(seed)
    A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, 1)), rng.normal(size=(1, n))
    names = tuple(f"x{i}" for i in range(n))
    system = StateSpace(
        A=A, B=B, C=C, D=np.array([[0.5]]), states=names, inputs=("u",), outputs=("y",)
    )
    numerator, denominator = polynomials(system)
    theirs = ss2tf(A, B, C, system.D)
    np.testing.assert_allclose(denominator, theirs[1], atol=1e-8)
    np.testing.assert_allclose(numerator, theirs[0][0], atol=1e-7)


def test_numerator_has_no_coefficients_but_its_own():
    """Four integrators in a row: the numerator is the constant 1, exactly."""
    A = np.eye(4, k=1)
    B, C = np.eye(4)[:, [3]], np.eye(4)[[0]]
    system = StateSpace(
        A=A, B=B, C=C, D=np.zeros((1, 1)), states=tuple("abcd"), inputs=("u",), outputs=("y",)
    )
    assert polynomials(system) == ((1.0,), (1.0, 0.0, 0.0, 0.0, 0.0))


def test_python_control_gets_the_same_system(feup):
    control = pytest.importorskip("control")
    model = linearise(plant(feup))
    theirs = model.to_control()
    assert isinstance(theirs, control.StateSpace)
    s = 0.1j
    np.testing.assert_allclose(theirs(s), model.at(s)[0], rtol=1e-9)
    assert theirs.state_labels == list(model.states)
    assert theirs.dt == 0


def test_shapes_are_checked():
    with pytest.raises(ValueError, match="B is"):
        StateSpace(
            A=np.eye(2),
            B=np.eye(2),
            C=np.eye(2),
            D=np.zeros((2, 1)),
            states=("a", "b"),
            inputs=("u",),
            outputs=("y", "v"),
        )


def test_operating_point_without_loads_asks_for_no_voltage(feup):
    p = plant(feup)._replace(load_drive=0.0, load_back=0.0)
    rest = operating_point(p, depth=30.0)
    assert (rest.voltage, rest.voltage_back, rest.motor_rate) == (0.0, 0.0, 0.0)
    assert rest.volume == pytest.approx(30.0 * 4.04e-6)
    assert math.isclose(operating_point(plant(feup), depth=100.0).voltage, 7.707)
