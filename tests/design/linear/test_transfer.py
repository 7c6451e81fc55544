"""Eqs (9), (19), (20), (30), (32)-(35): derived again by SymPy from (11)-(13)."""

import math

import numpy as np
import pytest
import sympy as sp

from swimbladder.design.linear import transfer
from swimbladder.design.linear.models import linearise
from swimbladder.physics.dynamics import plant

s = sp.Symbol("s")
LAM, K_U, K_V, K_Q, K_Z, K_L = sp.symbols("lambda k_u k_v k_q k_z k_l", positive=True)
K_B, K_DEF, K_DL, M = sp.symbols("k_b k_def k_dl m", positive=True)
K1, T1, K2, T2, A, PSI, RHO_G = sp.symbols("K1 T1 K2 T2 A psi rho_g", positive=True)
U, Z, V, OMEGA = sp.symbols("U Z V Omega")

# Eqs (11)-(13) under the Laplace transform, at rest initially, laminar drag.
ROTOR = sp.Eq(LAM * s * OMEGA, K_U * U - K_V * OMEGA - K_Z * Z)
VOLUME = sp.Eq(s * V, K_Q * OMEGA - K_L * Z)
MOTION = sp.Eq(M * s**2 * Z, -K_B * V + K_DEF * Z - K_DL * s * Z)

# Eqs (23), (24), (28), (29), (31): what the identified parameters stand for.
IDENTIFIED = {
    K_U: K1 * A * K_V / K_Q,
    LAM: T1 * K_V,
    K_DL: K_B / K2,
    M: T2 * K_B / K2,
    K_DEF: PSI * K_B,
}


def rational(ratio):
    """A function's numerator and denominator as one expression in s."""
    up, down = ratio
    return sum(c * s**i for i, c in enumerate(reversed(up))) / sum(
        c * s**i for i, c in enumerate(reversed(down))
    )


def same(ours, derived):
    return sp.simplify(sp.together(ours - derived)) == 0


@pytest.fixture(scope="module")
def actuator():
    """V as a function of U and Z."""
    return sp.expand(sp.solve([ROTOR, VOLUME], [V, OMEGA], dict=True)[0][V])


@pytest.fixture(scope="module")
def motion():
    """Z as a function of V."""
    return sp.solve(MOTION, Z)[0]


def test_equations_9_and_19(actuator):
    ours = transfer.volume_per_voltage(inertia=LAM, k_u=K_U, k_q=K_Q, k_v=K_V)
    assert same(rational(ours), actuator.coeff(U))
    load = transfer.volume_per_depth(inertia=LAM, k_v=K_V, k_q=K_Q, k_z=K_Z, k_l=K_L)
    assert same(rational(load), actuator.coeff(Z))


def test_equation_20(motion):
    ours = transfer.depth_per_volume_physical(k_b=K_B, k_def=K_DEF, k_dl=K_DL, m=M)
    assert same(rational(ours), motion / V)


def test_equation_30(motion):
    half = {K_B: K2 * K_DL, M: T2 * K_DL}
    ours = transfer.depth_per_volume_identified(K2=K2, T2=T2, k_def=K_DEF, k_dl=K_DL)
    assert same(rational(ours), (motion / V).subs(half))


def test_equation_32(motion):
    ours = transfer.depth_per_volume(K2=K2, T2=T2, psi=PSI)
    assert same(rational(ours), (motion / V).subs(IDENTIFIED))


def test_equation_33(actuator):
    c = sp.Symbol("c", positive=True)
    known = {**IDENTIFIED, K_Z: c * K1 * A * K_V / K_Q}  # k_z = c k_u
    ours = transfer.volume_per_voltage_identified(K1=K1, A=A, T1=T1)
    assert same(rational(ours), actuator.coeff(U).subs(known))
    load = transfer.volume_per_depth_identified(K1=K1, A=A, T1=T1, depth_voltage=c, k_l=K_L)
    assert same(rational(load), actuator.coeff(Z).subs(known))


def test_equations_34_and_35():
    c = sp.Symbol("c", positive=True)
    solved = sp.solve([ROTOR, VOLUME, MOTION], [Z, V, OMEGA], dict=True)[0][Z]
    known = (solved / U).subs(K_Z, c * K_U).subs(IDENTIFIED)
    ours = transfer.depth_per_voltage(
        K1=K1, K2=K2, A=A, T1=T1, T2=T2, psi=PSI, depth_voltage=c, k_l=K_L
    )
    assert same(rational(ours), known)
    # The paper's normalisation: the coefficient of s^2 is 1 - psi K2 T1.
    assert sp.simplify(ours[1][2] - (1 - PSI * K2 * T1)) == 0
    bare = transfer.depth_per_voltage_without_loads(K1=K1, K2=K2, A=A, T1=T1, T2=T2)
    assert same(rational(bare), known.subs({c: 0, K_L: 0, PSI: 0}))
    assert len(ours[1]) == len(bare[1]) == 5


def by_key(vehicle):
    p = plant(vehicle)
    found = transfer.transfer_functions(p, m=vehicle.mass, k_b=vehicle.water.specific_weight)
    return {(t.equations[0], t.output + "/" + t.input): t for t in found}


@pytest.mark.parametrize("name", ["feup", "lossy"])
def test_numbers_are_those_of_the_numerical_model(name, request):
    """Each formula, at a few complex frequencies, against the differentiated right-hand side."""
    vehicle = request.getfixturevalue(name)
    model = linearise(plant(vehicle))
    found = by_key(vehicle)
    p = plant(vehicle)
    motion = linearise(p._replace(positioner=1.0))
    # The actuator alone: its depth is an input.
    states, load = model.A[:2, :2], model.A[:2, 2]
    for point in (0.003j, 0.2 + 0.1j, 7j):
        z_u = model.part(output="z", input="u").at(point)[0, 0, 0]
        z_v = motion.at(point)[0, 0, 0]
        actuator = np.linalg.inv(point * np.eye(2) - states)
        v_u, v_z = (actuator @ model.B[:2, 0])[1], (actuator @ load)[1]
        expected = {
            ("9", "V/U"): v_u,
            ("9", "V/Z"): v_z,
            ("20", "Z/V"): z_v,
            ("30", "Z/V"): z_v,
            ("32", "Z/V"): z_v,
            ("33", "V/U"): v_u,
            ("33", "V/Z"): v_z,
            ("34", "Z/U"): z_u,
        }
        assert set(found) == {*expected, ("35", "Z/U")}
        for key, value in expected.items():
            t = found[key]
            ours = np.polyval(t.numerator, point) / np.polyval(t.denominator, point)
            assert ours == pytest.approx(value, rel=1e-9), key


def test_k_of_the_positive_feedback_is_negative(feup):
    """Deeper means less volume: the depth load enters V with a negative sign (section 2.1.4)."""
    load = by_key(feup)["9", "V/Z"]
    assert load.numerator == pytest.approx((-0.444e-3 * 75e-4 * 7.707e-2,))
    assert math.copysign(1.0, load.numerator[0]) == -1.0


def test_positioner_and_quadratic_drag_have_fewer(stepper, feup):
    assert set(by_key(stepper)) == {("20", "Z/V"), ("30", "Z/V"), ("32", "Z/V")}
    p = plant(feup)._replace(d_l=0.0, psi=0.0)
    found = transfer.transfer_functions(p, m=45.0, k_b=9806.65)
    assert {t.equations[0] for t in found} == {"9", "33"}


def test_python_control_gets_the_same_function(feup):
    pytest.importorskip("control")
    t = by_key(feup)["34", "Z/U"]
    ours = np.polyval(t.numerator, 0.1j) / np.polyval(t.denominator, 0.1j)
    assert t.to_control()(0.1j) == pytest.approx(ours)
    np.testing.assert_allclose(sorted(t.poles, key=abs), sorted(t.to_control().poles(), key=abs))
    assert (t.to_control().input_labels, t.to_control().output_labels) == (["U"], ["Z"])


def test_python_control_takes_both_by_the_names_of_their_signals(feup):
    control = pytest.importorskip("control")
    model, t = linearise(plant(feup)), by_key(feup)["34", "Z/U"].to_control()
    (u,), z = model.inputs, model.outputs[0]
    theirs = model.part(input=u, output=z).to_control()
    time = np.linspace(0.0, 5.0, 50)
    ours = control.step_response(t, T=time).outputs
    np.testing.assert_allclose(control.step_response(theirs, T=time).outputs, ours, rtol=1e-6)
    filtered = control.tf([1.0], [2.0, 1.0], inputs=["Z"], outputs=["seen"], name="filter")
    chain = control.interconnect([t.copy(name="vehicle"), filtered], inputs="U", outputs="seen")
    assert chain(0.1j) == pytest.approx(t(0.1j) / (1.0 + 0.2j))
