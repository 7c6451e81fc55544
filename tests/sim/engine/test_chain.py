"""The tables of exponentials against SciPy's and mpmath's matrix exponential."""

import math

import mpmath
import numpy as np
import pytest
from scipy.linalg import expm

from swimbladder.physics.dynamics import Plant, plant
from swimbladder.sim.engine.chain import (
    ALPHA,
    BETA,
    COEFFICIENTS,
    LEVELS,
    base_steps,
    build_chain,
    exponential_step,
    steps_of,
)
from swimbladder.sim.engine.modes import NO_LAYERS, Act, Layers, Where, layers_from
from swimbladder.sim.engine.modes import drag as drag_of
from tests.vehicles import BLENDED, LITERAL, QUADRATIC, SWITCHED, paper, pump, screw, stepper

VEHICLES = {
    "paper": paper(),
    "lossy": pump(R_b=0.5, drag=BLENDED),
    "screw": screw(friction=2e-3, drag=SWITCHED),
    "stepper": stepper(),
}
SCALE = np.array([1e6, 1e6, 1.0, 1.0, 1.0])  # q and V in cm3, so that one norm fits all rows


def reachable(p: Plant):
    """(act, limited, where) of every mode that a vehicle can be in."""
    if p.positioner:
        acts = [Act.MOVING_OUT, Act.MOVING_IN, Act.HOLDING, Act.PRESCRIBED]
    else:
        acts = [Act.FORWARD, Act.UPPER, Act.LOWER, Act.PRESCRIBED]
        if p.load_drive != p.load_back or p.friction > 0.0:
            acts += [Act.BACKWARD, Act.STUCK]
        if p.k_l > 0.0:
            acts += [Act.LOWER_SPINNING]
    turning = (Act.FORWARD, Act.BACKWARD, Act.LOWER_SPINNING)
    return [
        (act, limited, where)
        for act in acts
        for limited in ((0, 1) if p.sag > 0.0 and act in turning else (0,))
        for where in Where
    ]


def system(p: Plant, act: Act, limited: int, where: Where):
    """A [5, 5], b_u, b_1, e_w of dx/dt = A x + b_u u + b_1 + e_w N, written from eqs (11)-(13)."""
    q, V, z, w, _ = np.eye(5)
    A = np.zeros((5, 5))
    b_u, b_1, e_w = np.zeros(5), np.zeros(5), np.zeros(5)
    aground = where is Where.BOTTOM
    if act in (Act.FORWARD, Act.BACKWARD, Act.LOWER_SPINNING):
        # T1 dq/dt = gain (u_motor - load z -+ friction) - q, u_motor = (u + sag kappa q)/(1 + sag)
        back = act is Act.BACKWARD
        share = 1.0 / (1.0 + p.sag) if limited else 1.0
        emf = share * p.sag * p.kappa if limited else 0.0
        load = p.load_back if back else p.load_drive
        A[0] = ((p.gain * emf - 1.0) * q - p.gain * load * z) / p.T1
        b_u[0] = p.gain * share / p.T1
        b_1[0] = p.gain * (p.friction if back else -p.friction) / p.T1
    if act is Act.UPPER and not aground:
        A[0] = p.k_l * w
    if act in (Act.FORWARD, Act.BACKWARD, Act.STUCK):
        A[1] = q - p.k_l * z
    if act in (Act.MOVING_OUT, Act.MOVING_IN, Act.PRESCRIBED):
        A[1] = q
    A[4] = z
    if not aground:
        A[2] = w
        A[3] = p.a_b * (p.psi * z - V) - p.d_l * w
        b_1[3] = p.a_b * p.V_0
        if where is Where.EMERGING:
            A[3] -= p.a_s * z
            b_1[3] += p.a_s * p.z_surface
        e_w[3] = 1.0
    return A, b_u, b_1, e_w


def exact(A, b_u, b_1, e_w, h, exponential=expm):
    """exp(A h) - I, and h phi_1 of b_u and b_1, h phi_1, h^2 phi_2, h^3 phi_3 of e_w.

    All are corners of the exponential of one matrix: [[A, A], [0, 0]] gives exp(A h) - I without
    a subtraction, and a chain of integrators behind e_w its phi functions.
    """
    M = np.zeros((15, 15))
    M[:5, :5] = M[:5, 5:10] = A
    M[:5, 10], M[:5, 11], M[:5, 12] = b_u, b_1, e_w
    M[12, 13] = M[13, 14] = 1.0
    E = np.array(exponential(M * h), dtype=float)[:5]
    return E[:, 5:10], E[:, 10], E[:, 11], E[:, 12], E[:, 13], E[:, 14]


def table(p: Plant, act: Act, limited: int, where: Where, h: float):
    chain = np.full((LEVELS + 1, COEFFICIENTS), np.nan)
    build_chain(np.array(p), (where * 2 + limited) * 10 + act, h, chain)
    return chain


def entries(row):
    """D [5, 4], and the vectors of b_u, b_1, f1, f2, f3, of one level of a table."""
    return (row[:20].reshape(5, 4), *(row[20 + 5 * k : 25 + 5 * k] for k in range(5)))


def close(ours, theirs, tolerance):
    """Compare in units in which all states are of order one."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    rows = SCALE.reshape(-1, *[1] * (ours.ndim - 1))
    ours, theirs = ours * rows, theirs * rows
    if ours.ndim == 2:
        ours, theirs = ours / SCALE[:4], theirs / SCALE[:4]
    np.testing.assert_allclose(ours, theirs, rtol=tolerance, atol=tolerance * np.abs(theirs).max())


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("h", [0.01, 0.3, 10.0])
def test_every_mode_against_scipy(name: str, h: float) -> None:
    p = plant(VEHICLES[name], bottom_depth=50.0)
    for act, limited, where in reachable(p):
        A, b_u, b_1, e_w = system(p, act, limited, where)
        chain = table(p, act, limited, where, h)
        assert np.all(np.isfinite(chain[:LEVELS]))
        for level in (0, 1, 7, LEVELS - 1, LEVELS):
            step = h / 2**level
            D, b_u_h, b_1_h, V1, V2, V3 = exact(A, b_u, b_1, e_w, step)
            ours = entries(chain[level])
            phi = V1, V2 / step, V3 / step**2
            expected = (
                D[:, :4],
                b_u_h,
                b_1_h,
                phi[0] - 3 * phi[1] + 4 * phi[2],
                2 * phi[1] - 4 * phi[2],
                4 * phi[2] - phi[1],
            )
            for a, b in zip(ours, expected, strict=True):
                close(a, b, 1e-11)


@pytest.mark.parametrize("T1", [0.01, 0.09, 1.0])
@pytest.mark.parametrize("h", [0.01, 0.3, 10.0])
def test_each_entry_to_twelve_digits(T1: float, h: float) -> None:
    p = plant(screw())._replace(T1=T1)
    chain = table(p, Act.FORWARD, 0, Where.EMERGING, h)
    with mpmath.workdps(60):
        for level in (0, 3, 20):
            D, b_u, b_1, *_ = exact(
                *system(p, Act.FORWARD, 0, Where.EMERGING),
                h / 2**level,
                lambda m: mpmath.expm(mpmath.matrix(m.tolist())).tolist(),
            )
            ours = entries(chain[level])
            # D and the vectors, each entry relative to itself: nothing small is lost against 1
            for a, b in zip(ours[:3], (D[:, :4], b_u, b_1), strict=True):
                np.testing.assert_allclose(a, b, rtol=2e-12, atol=0.0)


def test_one_step_is_two_halves() -> None:
    """The semigroup: exp(A h) is exp(A h/2) squared, at each level of the table."""
    p = plant(paper())
    chain = table(p, Act.FORWARD, 0, Where.SUBMERGED, 2.0)
    for level in range(LEVELS):
        whole = np.eye(5)[:, :4] + entries(chain[level])[0]
        half = np.eye(5)
        half[:, :4] += entries(chain[level + 1])[0]
        close(whole, (half @ half)[:, :4], 1e-13)


def test_stages_of_the_nonlinear_drag() -> None:
    """The two numbers of a level: phi_1 of the half step on w, and what it passes on."""
    p = plant(pump(drag=BLENDED))
    h = 0.4
    chain = table(p, Act.FORWARD, 0, Where.SUBMERGED, h)
    A, b_u, b_1, e_w = system(p, Act.FORWARD, 0, Where.SUBMERGED)
    D, _, _, V1, *_ = exact(A, b_u, b_1, e_w, h / 2)
    assert chain[0, ALPHA] == pytest.approx(V1[3], rel=1e-12)
    # Cox and Matthews' last stage: exp(A h/2) carries the half step's N0 over the other half
    assert chain[0, BETA] == pytest.approx(((np.eye(5) + D) @ V1)[3], rel=1e-11)


@pytest.mark.parametrize("drag", [BLENDED, QUADRATIC, SWITCHED, LITERAL], ids=lambda d: d.law)
def test_rest_of_the_drag(drag) -> None:
    vehicle = pump(drag=drag)
    p = plant(vehicle)
    m = vehicle.mass
    for w in (-0.5, -0.05, -0.02, 0.0, 0.01, 0.039, 0.2):
        s = abs(w)
        force = {
            "blended": drag.k_dl * s + drag.k_dt * s * s,
            "quadratic": drag.k_dt * s * s,
            "switched": drag.k_dl * s
            if s <= drag.epsilon
            else drag.k_dt * s * s + drag.k_dl * drag.epsilon - drag.k_dt * drag.epsilon**2,
            "switched-literal": drag.k_dl * s if s <= drag.epsilon else drag.k_dt * s * s,
        }[drag.law]
        laminar = 0.0 if drag.law == "quadratic" else drag.k_dl * w
        expected = (laminar - math.copysign(force, w)) / m
        assert drag_of(np.array(p), w)[2] == pytest.approx(expected, rel=1e-12, abs=1e-18)


def waved(amplitude: float, length: float) -> Layers:
    """Layers whose volume swings with the depth, to 30 m."""
    step = 0.25
    return layers_from(amplitude * np.sin(np.arange(0.0, 30.0, step) / length), step)


@pytest.mark.parametrize("act", [Act.FORWARD, Act.UPPER, Act.PRESCRIBED], ids=lambda a: a.name)
@pytest.mark.parametrize("layers", [NO_LAYERS, waved(3e-5, 1.3)], ids=["even", "layered"])
def test_a_step_is_that_of_cox_and_matthews(act: Act, layers: Layers) -> None:
    """ETDRK4 (J. Comput. Phys. 176, 2002, eqs 26-29) written with SciPy's matrix functions."""
    p = plant(pump(drag=BLENDED, leak=2e-9))
    h, u, k_dt = 3.0, 4.0, BLENDED.k_dt
    x = np.array([-2e-5, 1.2e-4, 7.0, 0.31, 0.0])
    A, b_u, b_1, e_w = system(p, act, 0, Where.SUBMERGED)

    def N(x: np.ndarray) -> float:
        w = x[3]
        return -k_dt * w * abs(w) / pump(drag=BLENDED).mass + p.a_b * layers.at(x[2])

    def flow(h: float, x: np.ndarray) -> np.ndarray:
        D, b_u_h, b_1_h, *_ = exact(A, b_u, b_1, e_w, h)
        return x + D @ x + u * b_u_h + b_1_h

    V1_half = exact(A, b_u, b_1, e_w, h / 2)[3]
    _, _, _, V1, V2, V3 = exact(A, b_u, b_1, e_w, h)
    phi1, phi2, phi3 = V1, V2 / h, V3 / h**2
    a = flow(h / 2, x) + V1_half * N(x)
    b = flow(h / 2, x) + V1_half * N(a)
    c = flow(h / 2, a) + V1_half * (2.0 * N(b) - N(x))
    expected = (
        flow(h, x)
        + (phi1 - 3.0 * phi2 + 4.0 * phi3) * N(x)
        + (2.0 * phi2 - 4.0 * phi3) * (N(a) + N(b))
        + (4.0 * phi3 - phi2) * N(c)
    )
    y = np.empty(5)
    exponential_step(table(p, act, 0, Where.SUBMERGED, h), 0, np.array(p), layers, x, u, y)
    np.testing.assert_allclose(y * SCALE, expected * SCALE, rtol=1e-10, atol=1e-12)
    assert abs(y[3] - flow(h, x)[3]) > 1e-3, "the nonlinear part does nothing here"


def test_a_step_without_bends_is_ten_seconds_at_most() -> None:
    """So that no dip through the surface goes unseen; else a tick is one step."""
    p = plant(paper())
    assert [base_steps(p, tick, 0.0) for tick in (0.3, 10.0, 10.1, 25.0, 40.0)] == [1, 1, 2, 3, 4]


@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_steps_resolve_the_drag_at_the_speed_of_the_whole_stroke(speed: float) -> None:
    """2 d w at the terminal speed, or at one that is given, times a step is 1/8 at most."""
    vehicle = pump(drag=QUADRATIC)
    p, tick = plant(vehicle), 3.0
    # k_dt w^2 = rho g V of the whole stroke and of what psi takes in a kilometre
    force = 9806.65 * (vehicle.stroke.maximum + abs(p.psi) * 1e3)
    fastest = max(math.sqrt(force / QUADRATIC.k_dt), speed)
    rate = 2.0 * QUADRATIC.k_dt * fastest / vehicle.mass
    assert base_steps(p, tick, speed) == math.ceil(8.0 * rate * tick)


def test_steps_resolve_the_work_of_laminar_drag_where_accounts_are_kept() -> None:
    """The rate of the drag times a step is 1/4 at most, of each of several ticks."""
    p, ticks = plant(paper()), np.array([0.3, 2.0, 20.0, 90.0])
    due = [math.ceil(max(4.0 * tick / 36.3, tick / 10.0)) for tick in ticks]  # T2: m over drag
    assert due == [1, 1, 3, 10]
    assert [base_steps(p, tick, 0.0, booked=True) for tick in ticks] == due
    assert steps_of(p, ticks, 0.0, booked=True).tolist() == due
    assert steps_of(p, ticks, 0.0).tolist() == [1, 1, 2, 9]


def test_steps_resolve_the_swing_in_the_steepest_layer() -> None:
    layers = waved(4e-4, 0.4)
    p, tick = plant(paper()), 3.0
    steepest = np.abs(np.diff(layers.table[:, 0])).max() / layers.step
    natural = math.sqrt(9806.65 / paper().mass * 3.0 * steepest)  # a cubic: 3 secants at most
    assert base_steps(p, tick, 0.0, layers) == math.ceil(8.0 * natural * tick) > 3
