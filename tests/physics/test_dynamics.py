"""The vertical motion against the paper's equations, in forces and torques, and in limit cases."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle, vehicle_text
from swimbladder.physics.dynamics import (
    Plant,
    State,
    acceleration,
    drag_force,
    drag_law,
    drag_per_mass,
    drag_terms,
    even_drag,
    motor_rhs,
    plant,
    terminal_speed,
)
from swimbladder.vehicle import Drag, Supply
from tests.oracle import C, Machine, Mode, Oracle
from tests.vehicles import (
    BLENDED,
    LINEAR,
    LITERAL,
    QUADRATIC,
    SWITCHED,
    paper,
    pump,
    screw,
    stepper,
    vehicles,
)

states = st.tuples(
    st.floats(-1e-4, 1e-4), st.floats(-3e-4, 3e-4), st.floats(-0.2, 90.0), st.floats(-0.8, 0.8)
)


def torques(vehicle, x: State, u: float) -> tuple[float, float, float, float]:
    """Eqs (11)-(13) as printed: lambda domega/dt = k_u u - k_v omega - T_z - T_b, and so on."""
    m = Machine(vehicle)
    omega = x.q / m.k_q
    T_z = (m.k_z if omega > 0.0 else m.k_z_back) * x.z
    T_b = math.copysign(m.T_b, omega)
    domega = (m.k_u * u - m.k_v * omega - T_z - T_b) / m.lam
    return (
        m.k_q * domega,
        m.k_q * omega - m.k_l * x.z,
        x.w,
        (m.weight(x.V, x.z) - m.drag(x.w)) / m.m,
    )


@pytest.mark.parametrize(
    "vehicle",
    [
        paper(),
        screw(friction=2e-3, drag=BLENDED),
        screw(literal=True, efficiency=0.3, drag=LITERAL),
        pump(drag=SWITCHED),
        pump(drag=QUADRATIC, friction=0.0, leak=3e-11),
    ],
    ids=["identified", "screw", "literal", "pump", "leaking pump"],
)
@given(x=states, u=st.floats(-24.0, 24.0))
def test_the_right_hand_side_is_the_papers(vehicle, x, u: float) -> None:  # type: ignore[no-untyped-def]
    state = State(*x)
    if state.q == 0.0:
        return
    ours = motor_rhs(state, u, plant(vehicle))
    expected = torques(vehicle, state, u)
    scale = (1e-6, 1e-8, 1e-3, 1e-4)
    for a, b, s in zip(ours, expected, scale, strict=True):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-9 * s)


@given(vehicle=vehicles(kinds="identified unified lossy"), x=states, u=st.floats(-12.0, 12.0))
def test_the_right_hand_side_of_random_vehicles(vehicle, x, u: float) -> None:  # type: ignore[no-untyped-def]
    state = State(*x)
    if state.q == 0.0:
        return
    ours = np.array(motor_rhs(state, u, plant(vehicle)))
    np.testing.assert_allclose(ours, torques(vehicle, state, u), rtol=1e-8, atol=1e-13)


@given(x=states, u=st.floats(-12.0, 12.0))
def test_the_right_hand_side_is_the_oracles(x, u: float) -> None:  # type: ignore[no-untyped-def]
    """The oracle integrates in cm3 and sees the supply's limit; between the limits they agree."""
    vehicle = screw(efficiency=0.6, friction=1e-3, drag=BLENDED)
    state = State(*x)
    if state.q == 0.0:
        return
    oracle = Oracle(vehicle, depth=5.0)
    oracle.mode = Mode(turn=1 if state.q > 0.0 else -1)
    theirs = oracle._rhs(u)(0.0, np.array([state.q * C, state.V * C, state.z, state.w, 0, 0, 0]))
    ours = motor_rhs(state, u, plant(vehicle))
    np.testing.assert_allclose(
        [ours.q * C, ours.V * C, ours.z, ours.w], theirs[:4], rtol=1e-9, atol=1e-12
    )


def test_a_motor_at_rest_stays_until_the_voltage_beats_load_and_friction() -> None:
    p = plant(screw(efficiency=0.5, friction=2e-3))
    low, high = p.load_back * 30.0 - p.friction, p.load_drive * 30.0 + p.friction
    for u, sign in [(low - 0.01, -1), (low + 0.01, 0), (high - 0.01, 0), (high + 0.01, 1)]:
        assert np.sign(motor_rhs(State(0.0, 0.0, 30.0, 0.0), u, p).q) == sign
    assert p.load_back == pytest.approx(0.25 * p.load_drive)


class TestSignsAndLimits:
    """z down, V lighter, w down."""

    p = plant(paper())

    def test_more_volume_rises(self) -> None:
        assert acceleration(1e-5, 10.0, 0.0, self.p) < acceleration(0.0, 10.0, 0.0, self.p)
        assert acceleration(4.04e-5, 10.0, 0.0, self.p) == pytest.approx(0.0, abs=1e-15)

    def test_archimedes(self) -> None:
        # 100 cm3 of water weigh 0.98 N
        a = acceleration(-1e-4, 0.0, 0.0, self.p)
        assert a * paper().mass == pytest.approx(1e-4 * 1000.0 * 9.80665)

    def test_a_compressible_hull_is_heavier_below(self) -> None:
        assert acceleration(0.0, 20.0, 0.0, self.p) > acceleration(0.0, 10.0, 0.0, self.p) > 0.0

    def test_drag_opposes_motion_and_balances_at_the_terminal_speed(self) -> None:
        for w in (-0.3, 0.3):
            assert np.sign(drag_per_mass(w, self.p)) == np.sign(w)
        # K2 V is the terminal speed of a volume V, eq. (26)
        w = 7935.54 * 1e-5
        assert acceleration(-1e-5, 0.0, w, self.p) == pytest.approx(0.0, abs=1e-15)

    def test_a_hull_half_out_of_the_water_is_pulled_down(self) -> None:
        p = self.p
        assert acceleration(0.0, -0.01, 0.0, p) - acceleration(0.0, 0.0, 0.0, p) == pytest.approx(
            (9806.65 * math.pi / 100 * 0.01 - 9806.65 * 4.04e-6 * 0.01) / paper().mass
        )

    def test_a_steady_motor_turns_with_K1_A_u(self) -> None:
        rest = motor_rhs(State(0.444e-3 * 75e-4 * 12.0, 0.0, 0.0, 0.0), 12.0, self.p)
        assert rest.q == pytest.approx(0.0, abs=1e-18)


@pytest.mark.parametrize(
    "drag", [LINEAR, QUADRATIC, BLENDED, SWITCHED, LITERAL], ids=lambda d: d.law
)
def test_drag_is_odd_in_speed_and_as_stated(drag: Drag) -> None:
    p = plant(pump(drag=drag))
    m = pump().mass
    for w in (0.0, 0.01, 0.029, 0.031, 0.05, 0.3):
        assert drag_per_mass(-w, p) == -drag_per_mass(w, p)
        machine = Machine(pump(drag=drag))
        assert drag_per_mass(w, p) * m == pytest.approx(machine.drag(w), rel=1e-12)


def test_switched_drag_is_continuous_and_the_literal_one_jumps() -> None:
    """Eq. (16) as printed jumps at epsilon unless k_dl = k_dt epsilon."""
    below, above = 1.0 - 1e-12, 1.0 + 1e-12
    for drag, jump in ((SWITCHED, 0.0), (LITERAL, LITERAL.k_dt * 0.04**2 - LITERAL.k_dl * 0.04)):
        p, m = plant(pump(drag=drag)), pump().mass
        step = drag_per_mass(drag.epsilon * above, p) - drag_per_mass(drag.epsilon * below, p)
        assert step * m == pytest.approx(jump, abs=1e-9)
    matched = Drag(law="switched-literal", k_dl=2.0, k_dt=40.0, epsilon=0.05)
    p = plant(pump(drag=matched))
    step = drag_per_mass(0.05 * above, p) - drag_per_mass(0.05 * below, p)
    assert step == pytest.approx(0.0, abs=1e-12)


class TestPlant:
    """A vehicle as bare floats."""

    def test_the_papers_numbers(self) -> None:
        p = plant(paper(), bottom_depth=4.5)
        assert p.T1 == 0.09
        assert p.gain == pytest.approx(0.444e-3 * 75e-4, rel=1e-12)
        assert p.load_drive == p.load_back == 7.707e-2
        assert p.a_b == pytest.approx(7935.54 / 36.3, rel=1e-12)
        assert p.d_l == pytest.approx(1 / 36.3, rel=1e-12)
        assert p.z_bottom == 4.5
        assert p.z_air == pytest.approx(-1.285)
        assert p.epsilon == math.inf

    def test_every_field_is_a_float(self) -> None:
        for vehicle in (paper(), stepper(BLENDED), pump(R_b=0.2), screw(drag=LITERAL)):
            assert all(type(value) is float for value in plant(vehicle))
        assert len(Plant._fields) == len(set(Plant._fields))

    def test_sag_and_back_electromotive_force(self) -> None:
        p = plant(screw(R_b=0.3))
        assert p.sag == pytest.approx(0.2)
        omega = 100.0  # rad/s make 3 V
        assert p.kappa * omega * 60e-4 * 1e-4 / (2 * math.pi) == pytest.approx(3.0)

    def test_a_sag_that_cannot_be_told_is_refused(self) -> None:
        with pytest.raises(InputError) as caught:
            plant(paper(supply=Supply(voltage=12.0, internal_resistance=0.1)))
        assert caught.value.field == "supply.internal_resistance"


@pytest.mark.parametrize("law", ["linear", "quadratic", "switched", "blended"])
def test_drag_while_rising_is_a_share_of_that_while_sinking(law: str) -> None:
    given = {
        "linear": {"k_dl": 3.0},
        "quadratic": {"k_dt": 40.0},
        "switched": {"k_dl": 3.0, "k_dt": 40.0, "epsilon": 0.05},
        "blended": {"k_dl": 3.0, "k_dt": 40.0},
    }[law]
    even, uneven = Drag(law=law, **given), Drag(law=law, **given, rising_ratio=0.6)
    for w in (1e-3, 0.04, 0.3):
        assert drag_force(uneven, w) == drag_force(even, w)
        assert drag_force(uneven, -w) == pytest.approx(-0.6 * drag_force(even, w), rel=1e-14)


def test_a_drag_that_differs_up_and_down_is_refused_where_loops_are_closed(tmp_path) -> None:  # type: ignore[no-untyped-def]
    text = vehicle_text("example-eh").replace("[motion.drag]", "[motion.drag]\nrising_ratio = 0.6")
    file = tmp_path / "uneven.toml"
    file.write_text(text)
    with pytest.raises(InputError, match="only `mission`, `ballast`, `energy`") as caught:
        load_vehicle(file, sampled=True)
    assert "motion.drag.rising_ratio" in str(caught.value)
    assert f"line {text[: text.index('rising_ratio')].count(chr(10)) + 1}" in str(caught.value)
    vehicle = load_vehicle(file)  # a mission takes it
    assert vehicle.drag.rising_ratio == 0.6
    with pytest.raises(InputError, match="a drag between the two"):
        plant(vehicle)
    assert plant(even_drag(vehicle)) == plant(load_vehicle("example-eh"))


@pytest.mark.parametrize("pull", [0.0, 1e-4, 0.013, 0.3, 5.0])
@pytest.mark.parametrize("drag", [LINEAR, QUADRATIC, BLENDED, SWITCHED, LITERAL])
def test_at_the_terminal_speed_drag_balances_the_pull(drag: Drag, pull: float) -> None:
    """Just below it drag is less than the pull, just above it more; also where the drag jumps."""
    p = plant(pump(drag=drag))
    found = terminal_speed(p, pull)
    if pull == 0.0:
        assert found == 0.0
        return
    assert drag_per_mass(found * (1.0 - 1e-9), p) < pull < drag_per_mass(found * (1.0 + 1e-9), p)


@pytest.mark.parametrize("w", [-0.3, -0.02, 0.01, 0.049, 0.2])
@pytest.mark.parametrize("drag", [LINEAR, QUADRATIC, BLENDED, SWITCHED, LITERAL])
def test_the_slope_of_the_drag_is_that_of_its_difference(drag: Drag, w: float) -> None:
    terms, h = drag_terms(drag, 40.0), 1e-6
    force, slope, rest = drag_law(w, *terms)
    secant = (drag_law(w + h, *terms)[0] - drag_law(w - h, *terms)[0]) / (2.0 * h)
    assert slope == pytest.approx(secant, rel=1e-7)
    assert force == pytest.approx(terms[0] * w - rest, rel=1e-14)
