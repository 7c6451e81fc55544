"""One step of the filter's state against SciPy: motion, slopes and noise."""

import math
from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.linalg import expm

from swimbladder.estimation.kalman import BOBBING_DAMPING, Motion, Span, transition
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.engine.cache import compiled
from swimbladder.sim.engine.modes import NO_LAYERS, layers_from

WALK2, JOLT2 = (0.3e-6) ** 2, (2e-4) ** 2
SCALE = np.array([1.0, 1.0, 1e-6])  # the neutral volume in cm3, so that one tolerance fits all


@compiled
def step(motion, x, span, F, Q):
    return transition(motion, x, span, F, Q)


def stepped(p, x, Va, Vb, h, layers=NO_LAYERS):
    F, Q = np.empty((3, 3)), np.empty((3, 3))
    after = np.array(x)
    aground = step(Motion(np.array(p), layers, WALK2, JOLT2), after, Span(h, Va, Vb), F, Q)
    return after, F, np.triu(Q) + np.triu(Q, 1).T, aground


def by_expm(p, x, Va, Vb, h):
    """Motion, slope and noise of the laminar case by matrix exponentials (van Loan's for Q)."""
    a = p.a_b
    # in cm3, or expm loses the small entries
    A = np.array([[0.0, 1.0, 0.0], [a * p.psi, -p.d_l, 1e-6 * a], [0.0, 0.0, 0.0]])
    L = np.diag([0.0, JOLT2, 1e12 * WALK2])
    E = expm(np.block([[-A, L], [np.zeros((3, 3)), A.T]]) * h)
    F, D = expm(A * h), np.diag(SCALE)
    forced = np.zeros((5, 5))  # z, w, V0, V, dV/dt
    forced[:3, :3] = A
    forced[1, 3], forced[3, 4] = -1e-6 * a, 1.0
    y = expm(forced * h) @ (np.array([*x, Va, (Vb - Va) / h]) / [1.0, 1.0, 1e-6, 1e-6, 1e-6])
    return D @ y[:3], D @ F @ np.linalg.inv(D), D @ F @ E[:3, 3:] @ D


def by_scipy(vehicle, p, x, Va, Vb, h, added=lambda _: 0.0):
    """Motion by DOP853, slopes by central differences of it."""
    drag = vehicle.drag

    def force(w):  # eq. (16), written again
        size = abs(w)
        if drag.law == "linear":
            f = drag.k_dl * size
        elif drag.law == "blended":
            f = drag.k_dl * size + drag.k_dt * size**2
        elif drag.law == "quadratic":
            f = drag.k_dt * size**2
        else:
            f = drag.k_dl * min(size, drag.epsilon) + drag.k_dt * max(
                size**2 - drag.epsilon**2, 0.0
            )
        return math.copysign(f, w) / vehicle.mass

    def rate(t, y, V0):
        z, w = y
        V = Va + (Vb - Va) * t / h
        a = p.a_b * (p.psi * z + added(z) + V0 - V) - force(w)
        if z < p.z_surface:
            a += p.a_s * (p.z_surface - z) - 2.0 * BOBBING_DAMPING * math.sqrt(p.a_s) * w
        return [w, a]

    def end(x):
        found = solve_ivp(
            partial(rate, V0=x[2]),
            (0.0, h),
            x[:2],
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
            max_step=h / 20,
        )
        return np.array([*found.y[:, -1], x[2]])

    F = np.empty((3, 3))
    for j, d in enumerate([1e-4, 1e-4, 1e-8]):
        e = np.eye(3)[j] * d
        F[:, j] = (end(x + e) - end(x - e)) / (2.0 * d)
    return end(x), F


def close(found, expected, rel):
    """Compare states, slopes or covariances in scaled units."""
    D = np.diag(1.0 / SCALE)
    if found.ndim == 1:
        np.testing.assert_allclose(D @ found, D @ expected, rtol=rel, atol=rel)
        return
    for i in range(3):
        for j in range(3):
            size = math.sqrt(abs(expected[i, i] * expected[j, j]))
            assert found[i, j] == pytest.approx(expected[i, j], rel=rel, abs=rel * size)


def close_slopes(found, expected, rel):
    D, E = np.diag(1.0 / SCALE), np.diag(SCALE)
    np.testing.assert_allclose(D @ found @ E, D @ expected @ E, rtol=rel, atol=rel)


@pytest.mark.parametrize("h", [1e-3, 0.3, 0.5, 3.0, 40.0])
@pytest.mark.parametrize("psi", [4.04e-6, 0.0, -2e-7])
def test_a_laminar_step_is_that_of_the_matrix_exponential(h, psi):
    p = plant(load_vehicle("feup-em"))._replace(psi=psi)
    x, Va, Vb = np.array([60.0, -0.03, 2e-5]), 260e-6, 230e-6
    found, F, Q, aground = stepped(p, x, Va, Vb, h)
    y, F0, Q0 = by_expm(p, x, Va, Vb, h)
    assert not aground
    close(found, y, 1e-11)
    close_slopes(F, F0, 1e-11)
    close(Q, Q0, 1e-10)


def drags():
    base = load_vehicle("ntnu-bv")

    def with_drag(**fields):
        motion = base.motion.model_copy(update={"drag": type(base.drag)(**fields)})
        return base.model_copy(update={"motion": motion})

    return {
        "blended": base,
        "quadratic": with_drag(law="quadratic", k_dt=6.0),
        "switched": with_drag(law="switched", k_dl=1.0, k_dt=8.0, epsilon=0.05),
    }


@pytest.mark.parametrize("law", ["blended", "quadratic", "switched"])
@pytest.mark.parametrize("h", [0.1, 0.5, 5.0])
def test_a_step_under_nonlinear_drag_agrees_with_scipy(law, h):
    vehicle = drags()[law]
    p = plant(vehicle)
    x, Va, Vb = np.array([20.0, 0.08, 1.25e-5]), 1.0e-5, 1.2e-5
    found, F, _, _ = stepped(p, x, Va, Vb, h)
    y, F0 = by_scipy(vehicle, p, x, Va, Vb, h)
    tolerance = 1e-8 if law != "switched" else 1e-6  # its slope of drag jumps
    close(found, y, tolerance)
    close_slopes(F, F0, 1e-6)  # central differences


@pytest.mark.parametrize("law", ["linear", "blended", "quadratic"])
def test_layers_on_a_line_are_psi(law):
    """The limit that has to hold: 3 cm3 more a metre, as psi or as the water's."""
    drag = {"linear": {"k_dl": 0.7}, "quadratic": {"k_dt": 6.0}}.get(law)
    base = drags()["blended"]
    if drag is not None:
        motion = base.motion.model_copy(update={"drag": type(base.drag)(law=law, **drag)})
        base = base.model_copy(update={"motion": motion})
    p = plant(base)
    layers = layers_from(3e-6 * 0.1 * np.arange(80.0) - 2e-6, 0.1)
    x, Va, Vb = np.array([3.33, 0.05, 4e-6]), 1.0e-5, 1.4e-5
    ours = stepped(p, x, Va, Vb, 4.0, layers)
    theirs = stepped(p._replace(psi=p.psi + 3e-6), x - [0.0, 0.0, 2e-6], Va, Vb, 4.0)
    np.testing.assert_allclose(ours[0][:2], theirs[0][:2], rtol=1e-7)
    close_slopes(ours[1], theirs[1], 1e-6)
    close(ours[2], theirs[2], 2e-4)  # the noise's share begins at 0


def halocline(z):
    """30 cm3 in half a metre, as the layer between brackish and salt water gives a small float."""
    return -15e-6 * np.tanh((np.asarray(z) - 1.0) / 0.25)


@pytest.mark.parametrize(("z", "w", "h"), [(0.5, 0.09, 0.5), (0.9, 0.02, 8.0), (1.6, -0.06, 12.0)])
def test_a_step_through_a_halocline_agrees_with_scipy(z, w, h):
    """Against the same layers in SciPy's own interpolation: mean, slopes, and the noise's trend."""
    vehicle = drags()["blended"]
    p = plant(vehicle)
    depth = 0.02 * np.arange(200.0)
    layers = layers_from(halocline(depth), 0.02)
    exact = PchipInterpolator(depth, halocline(depth))
    x, Va, Vb = np.array([z, w, 1.25e-5]), 1.0e-5, 1.6e-5
    found, F, Q, aground = stepped(p, x, Va, Vb, h, layers)
    y, F0 = by_scipy(vehicle, p, x, Va, Vb, h, added=lambda z: float(exact(z)))
    assert not aground
    close(found, y, 1e-6)  # the slopes' own slopes jump from row to row
    close_slopes(F, F0, 3e-5)
    assert np.linalg.eigvalsh(Q / np.sqrt(np.outer(np.diag(Q), np.diag(Q)))).min() > 0.0


def test_what_layers_add_is_their_table():
    depth = 0.05 * np.arange(60.0)
    layers = layers_from(halocline(depth), 0.05)
    np.testing.assert_allclose(layers.along(depth), halocline(depth), rtol=1e-12)
    between = depth[:-1] + 0.02
    np.testing.assert_allclose(layers.along(between), halocline(between), atol=3e-8)
    fine = np.linspace(0.0, depth[-1], 20_001)
    assert np.abs(np.gradient(layers.along(fine), fine)).max() <= layers.steepest
    assert NO_LAYERS.at(1.0) == 0.0


@pytest.mark.parametrize("law", ["linear", "blended"])
@pytest.mark.parametrize(
    # all the while emerged; and through the surface, where damping begins at once, within a step
    ("z", "w", "tolerance"),
    [(-0.02, -0.02, 1e-5), (0.02, -0.05, 5e-4)],
)
def test_an_emerging_hull_is_a_damped_spring(law, z, w, tolerance):
    vehicle = drags()["blended"]
    if law == "linear":
        drag = type(vehicle.drag)(law="linear", k_dl=0.7)
        motion = vehicle.motion.model_copy(update={"drag": drag})
        vehicle = vehicle.model_copy(update={"motion": motion})
    p = plant(vehicle)
    x, Va, Vb = np.array([z, w, 1.25e-5]), 1.8e-5, 2.0e-5
    found, F, Q, aground = stepped(p, x, Va, Vb, 0.5)
    y, F0 = by_scipy(vehicle, p, x, Va, Vb, 0.5)
    assert not aground
    assert found[0] < 0.0
    np.testing.assert_allclose(found[:2], y[:2], rtol=0.0, atol=tolerance)
    close_slopes(F, F0, 100.0 * tolerance if z < 0.0 else 0.1)  # to the step it crosses in
    assert np.linalg.eigvalsh(Q / np.sqrt(np.outer(np.diag(Q), np.diag(Q)))).min() > 0.0


def test_the_bottom_stops_it_and_lets_it_go():
    p = plant(drags()["blended"], bottom_depth=1.4)
    neutral = 1.25e-5
    found, F, Q, aground = stepped(p, [1.38, 0.1, neutral], neutral - 5e-6, neutral - 5e-6, 2.0)
    assert aground
    np.testing.assert_array_equal(found[:2], [1.4, 0.0])
    np.testing.assert_array_equal(F[:2], 0.0)
    assert Q[2, 2] == pytest.approx(2.0 * WALK2)
    # lighter than neutral by the end: it has left, later than it began to
    found, F, _, aground = stepped(p, [1.4, 0.0, neutral], neutral - 5e-6, neutral + 5e-6, 4.0)
    assert not aground
    assert found[0] < 1.4
    assert found[1] < 0.0
    assert F[0, 2] > 0.0  # a larger neutral volume is heavier: deeper
