"""The paper's cascade: each term by hand, its start, its compiled twin."""

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.control.cascade import (
    CASCADE,
    CascadeParameters,
    CascadeState,
    initial,
    step,
)
from swimbladder.control.law import Measurement
from tests.oracle import TABLE_3, paper_cascade

GAINS = CascadeParameters(**TABLE_3)
depths = st.floats(-1.0, 100.0)
volumes = st.floats(-4e-4, 4e-4)


def test_a_sample_by_hand() -> None:
    """In litres, as Table 3 prints them: U = k_p e + k_d de/S_p + U_i, u = 1002 (U - V)."""
    e, e_before, U_i, V = 0.25, 0.40, 0.010, 0.030
    U = -0.1043 * e - 2.341 * (e - e_before) / 0.3 + U_i
    u = 1002.0 * (U - V)
    state = CascadeState(integral=U_i * 1e-3, error=e_before, volume_reference=0.0)
    voltage, after, wait = step(GAINS, state, Measurement(9.0, 2.75, V * 1e-3), 3.0)
    assert voltage == pytest.approx(u, rel=1e-12)
    assert after.volume_reference == pytest.approx(U * 1e-3, rel=1e-12)
    assert after.error == e
    assert after.integral == pytest.approx((U_i - 7.486e-4 * 0.3 * e) * 1e-3, rel=1e-12)
    assert wait == 0.3


@given(z=depths, V=volumes, reference=depths)
def test_it_starts_at_rest(z: float, V: float, reference: float) -> None:
    """U_i = V and e(-1) = e(0): at the set-point no voltage, away from it no kick of D."""
    seen = Measurement(0.0, z, V)
    state = initial(GAINS, seen, reference)
    assert (state.integral, state.error) == (V, reference - z)
    assert state.volume_reference == V
    voltage, _, _ = step(GAINS, state, seen, reference)
    assert voltage == pytest.approx(GAINS.k_pV * GAINS.k_pz * (reference - z), rel=1e-9, abs=1e-7)


def test_signs() -> None:
    """Too shallow: draw volume in (negative voltage). Sinking fast: press volume out."""
    rest = CascadeState(0.0, 0.0, 0.0)
    shallow, _, _ = step(GAINS, rest._replace(error=1.0), Measurement(0.0, 2.0, 0.0), 3.0)
    deep, _, _ = step(GAINS, rest._replace(error=-1.0), Measurement(0.0, 4.0, 0.0), 3.0)
    assert shallow < 0.0 < deep
    sinking, _, _ = step(GAINS, rest._replace(error=0.1), Measurement(0.0, 3.0, 0.0), 3.0)
    assert sinking > 0.0
    light, _, _ = step(GAINS, rest, Measurement(0.0, 3.0, 1e-5), 3.0)
    assert light < 0.0


@given(
    seen=st.lists(st.tuples(depths, volumes), min_size=1, max_size=20),
    reference=depths,
)
def test_against_the_oracles_cascade(seen: list[tuple[float, float]], reference: float) -> None:
    law = paper_cascade(**TABLE_3)
    state = None
    for k, (z, V) in enumerate(seen):
        measurement = Measurement(0.3 * k, z, V)
        if state is None:
            state = initial(GAINS, measurement, reference)
        voltage, state, _ = step(GAINS, state, measurement, reference)
        assert voltage == pytest.approx(law(0.3 * k, z, V, reference), rel=1e-9, abs=1e-9)


def test_a_constant_error_is_integrated() -> None:
    state = CascadeState(0.0, 0.5, 0.0)
    for _ in range(100):
        _, state, _ = step(GAINS, state, Measurement(0.0, 2.5, 0.0), 3.0)
    assert state.integral == pytest.approx(100 * -7.486e-7 * 0.3 * 0.5, rel=1e-12)


def test_it_is_pure() -> None:
    state = CascadeState(1e-5, 0.2, 0.0)
    seen = Measurement(1.0, 2.0, 3e-5)
    first = step(GAINS, state, seen, 2.5)
    assert step(GAINS, state, seen, 2.5) == first
    assert state == CascadeState(1e-5, 0.2, 0.0)


def test_it_compiles_to_the_same_numbers() -> None:
    compiled = numba.njit(step)
    begin = numba.njit(initial)
    state = CascadeState(1e-5, 0.2, 0.0)
    seen = Measurement(1.0, 2.0, 3e-5)
    ours, theirs = compiled(GAINS, state, seen, 2.5), step(GAINS, state, seen, 2.5)
    np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-13)
    np.testing.assert_allclose(ours[1], theirs[1], rtol=1e-13)
    assert begin(GAINS, seen, 2.5) == initial(GAINS, seen, 2.5)


def test_what_the_law_says_of_itself() -> None:
    assert CASCADE.command == "voltage"
    assert set(CASCADE.units) == set(CascadeParameters._fields)
    assert CASCADE.parameters is CascadeParameters
    assert "volume_reference" in CASCADE.state._fields
