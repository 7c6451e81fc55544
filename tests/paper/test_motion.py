"""Eqs (10)-(16), (21), (22), (31) against SymPy, SciPy and sums of forces done by hand."""

import math

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swimbladder.io.config import load_vehicle
from swimbladder.physics.actuator import unified
from swimbladder.physics.dynamics import State, acceleration, drag_per_mass, motor_rhs, plant
from swimbladder.sim.closed_loop import drive
from swimbladder.vehicle import Drag, PhysicalMotion


@pytest.fixture(scope="module")
def paper():
    return load_vehicle("feup-em")


@pytest.fixture(scope="module")
def hydraulic():
    return load_vehicle("example-eh")


@given(st.floats(-3.4e-4, 3.4e-4), st.floats(1.0, 100.0), st.floats(-0.5, 0.5))
def test_eqs_10_and_13_are_the_sum_of_forces(V, z, w):
    """Weight of water displaced above neutral, less what the hull lost, and drag rho g/K2 w."""
    rho_g, psi = 1000.0 * 9.80665, 4.04e-6
    force = -rho_g * V + rho_g * psi * z - rho_g / 7935.54 * w
    m = rho_g * 36.3 / 7935.54
    assert acceleration(V, z, w, plant(load_vehicle("feup-em"))) == pytest.approx(
        force / m, rel=1e-12, abs=1e-15
    )


def test_signs_of_the_motion(paper):
    p = plant(paper)
    assert acceleration(1e-5, 10.0, 0.0, p) < acceleration(0.0, 10.0, 0.0, p)  # lighter: up
    assert acceleration(0.0, 20.0, 0.0, p) > acceleration(0.0, 10.0, 0.0, p)  # deeper: heavier
    assert acceleration(4.04e-5, 10.0, 0.0, p) == pytest.approx(0.0, abs=1e-12)  # psi z: neutral
    assert acceleration(4.04e-5, 10.0, 0.1, p) < 0.0  # drag against the motion, both ways
    assert acceleration(4.04e-5, 10.0, -0.1, p) > 0.0


def test_eq_31_is_what_the_hull_loses(paper):
    """k_def = rho g psi: the force gained per metre by a vehicle that keeps its volume."""
    p, m = plant(paper), paper.mass
    gained = m * (acceleration(0.0, 80.0, 0.0, p) - acceleration(0.0, 30.0, 0.0, p))
    assert gained / 50.0 == pytest.approx(1000.0 * 9.80665 * 4.04e-6, rel=1e-12)
    assert paper.neutral_volume(100.0) == pytest.approx(404e-6)


def test_eq_14_follows_from_11_and_12():
    """The speed of the motor eliminated by SymPy."""
    t = sympy.symbols("t")
    lam, k_u, k_v, k_q, k_z, k_l = sympy.symbols("lambda k_u k_v k_q k_z k_l", positive=True)
    V, z, u = (sympy.Function(name)(t) for name in "Vzu")
    omega = (V.diff(t) + k_l * z) / k_q  # eq. (12)
    eq_11 = omega.diff(t) - (k_u * u - k_v * omega - k_z * z) / lam
    ours = sympy.solve(eq_11, V.diff(t, 2))[0]
    printed = (
        -k_v / lam * V.diff(t)
        - k_l * z.diff(t)
        - (k_l * k_v / lam + k_q * k_z / lam) * z
        + k_u * k_q / lam * u
    )
    assert sympy.simplify(ours - printed) == 0


@given(
    st.floats(0.1e-5, 3e-5),
    st.floats(-2e-4, 2e-4),
    st.floats(0.5, 1000.0),
    st.floats(-0.5, 0.5),
    st.floats(-24.0, 24.0),
)
def test_eqs_11_and_12_in_torques(q, V, z, w, u):
    """Motor torque less speed losses, load and dry friction, over the inertia; leakage lost."""
    vehicle = load_vehicle("example-eh")
    # by hand from the datasheet in the preset
    k_T, R, B = 0.0603, 1.16, 2e-6 + 1e-5
    D_p, eta, k_pl, rho_g = 0.08e-6, 0.8, 1e-8 * 1e-6 / 60.0, 1025.0 * 9.80665
    lam, k_q = 1.34e-5 + 2e-6, D_p / (2.0 * math.pi)
    omega = q / k_q
    torque = k_T / R * u - (B + k_T**2 / R) * omega - rho_g * z * k_q / eta - 4.2e-3
    rate = motor_rhs(State(q, V, z, w), u, plant(vehicle))
    scale = rho_g * z * k_q / eta + abs(k_T / R * u) + k_T**2 / R * omega
    assert rate.q / k_q * lam == pytest.approx(torque, abs=1e-9 * scale)
    assert rate.V == pytest.approx(q - k_pl * rho_g * z, rel=1e-12)  # noqa: SIM300


def test_eq_15_is_integrated(hydraulic):
    """An electrohydraulic vehicle in the simulator against SciPy on (14)-(15) in torques."""
    a = unified(hydraulic.actuator, hydraulic.water)
    m, rho_g, psi = 45.08 + 2.0 + 2.7, 1025.0 * 9.80665, -0.078e-6
    supply = hydraulic.supply.model_copy(update={"internal_resistance": 0.0})
    vehicle = hydraulic.model_copy(update={"supply": supply})
    time = np.arange(0.0, 40.0, 0.5)
    voltage = 20.0 + 2.0 * np.sin(0.4 * time)  # the motor keeps driving against 100 m
    s = drive(vehicle, time=time, voltage=voltage, start_depth=100.0)

    def rates(_, x, u):
        V_rate, V, z, w = x
        lam, k_l = a.inertia, a.k_l
        V_acc = (
            -a.k_v / lam * V_rate
            - k_l * w
            - (k_l * a.k_v / lam + a.k_q * a.k_z / lam) * z
            + a.k_u * a.k_q / lam * u
            - a.k_q * a.friction_torque / lam
        )
        drag = 0.8 * w if abs(w) <= 0.05 else 16.0 * w * abs(w)
        return [V_acc, V_rate, w, (-rho_g * V + rho_g * psi * z - drag) / m]

    x, depths = [-a.k_l * 100.0, psi * 100.0, 100.0, 0.0], [100.0]
    started = a.k_u * voltage[0] > a.k_z * 100.0 + a.friction_torque
    assert started  # the motor turns at once: no dead band in between
    for k, u in enumerate(voltage[:-1]):
        x = solve_ivp(
            rates, (time[k], time[k + 1]), x, args=(u,), method="LSODA", rtol=1e-10, atol=1e-13
        ).y[:, -1]
        depths.append(x[2])
    assert s.depth == pytest.approx(np.array(depths), abs=2e-5)
    assert s.depth[-1] < 99.0  # it went somewhere


def drag(law, **numbers):
    vehicle = load_vehicle("feup-em")
    motion = PhysicalMotion(dry_mass=40.0, drag=Drag(law=law, **numbers))
    p = plant(vehicle.model_copy(update={"motion": motion}))
    return lambda w: 40.0 * drag_per_mass(w, p)


SWITCHED = dict(k_dl=2.0, k_dt=30.0, epsilon=0.05)


@pytest.mark.parametrize(
    ("law", "numbers", "forces"),
    [
        ("linear", {"k_dl": 2.0}, {0.01: 0.02, 0.2: 0.4}),
        ("quadratic", {"k_dt": 30.0}, {0.01: 0.003, 0.2: 1.2}),
        ("switched-literal", SWITCHED, {0.01: 0.02, 0.2: 1.2}),
        # continuous: the turbulent branch starts from k_dl epsilon = 0.1 N, not from 0.075 N
        ("switched", SWITCHED, {0.01: 0.02, 0.2: 1.225}),
        ("blended", {"k_dl": 2.0, "k_dt": 30.0}, {0.01: 0.023, 0.2: 1.6}),
    ],
)
def test_eq_16_in_all_its_forms(law, numbers, forces):
    F_d = drag(law, **numbers)
    for w, force in forces.items():
        assert F_d(w) == pytest.approx(force, rel=1e-12)
        assert F_d(-w) == pytest.approx(-force, rel=1e-12)  # the paper tests dz/dt, not |dz/dt|
    assert F_d(0.0) == 0.0


def test_eq_16_as_printed_jumps_and_by_default_does_not():
    below, above = 0.05 * (1.0 - 1e-12), 0.05 * (1.0 + 1e-12)
    literal, default = drag("switched-literal", **SWITCHED), drag("switched", **SWITCHED)
    assert literal(above) - literal(below) == pytest.approx(30.0 * 0.05**2 - 2.0 * 0.05, rel=1e-6)
    assert default(above) - default(below) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("u", [12.0, 3.0, -7.5])
def test_eqs_21_and_22_are_a_voltage_step(paper, u):
    """Without depth load the piston's speed is K1 u (1 - exp(-t/T1))."""
    free = paper.actuator.model_copy(update={"depth_voltage": 0.0})
    time = np.linspace(0.0, 0.6, 25)
    s = drive(
        paper.model_copy(update={"actuator": free}),
        time=time,
        voltage=np.full(25, u),
        start_depth=2.0,
        start_volume=-1e-4,
        bottom_depth=2.0,
    )
    assert s.motor_rate / 75e-4 == pytest.approx(
        0.444e-3 * u * (1.0 - np.exp(-time / 0.09)), abs=1e-15
    )


def test_0_V_let_the_sea_push_the_piston_in(paper):
    """What section 2.3 leaves out: K1 A k_z/k_u z, 1 cm3/s at 3.75 m."""
    s = drive(
        paper,
        time=[0.0, 1.0, 11.0],
        voltage=np.zeros(3),
        start_depth=3.75,
        start_volume=-1e-4,
        bottom_depth=3.75,
    )
    rate = (s.volume[2] - s.volume[1]) / 10.0
    assert rate == pytest.approx(-0.444e-3 * 75e-4 * 0.07707 * 3.75, rel=1e-4)
    assert rate == pytest.approx(-0.96e-6, rel=0.01)
