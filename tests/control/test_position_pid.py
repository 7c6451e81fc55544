"""The position PID: its parts by hand, against a float's own firmware, and compiled."""

import csv
import gzip
import math

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.control.law import Measurement
from swimbladder.control.position_pid import (
    POSITION_PID,
    PositionPidParameters,
    PositionPidState,
    initial,
    step,
)
from swimbladder.units import parse_quantity

SAMPLE = 16000 / 32768
AREA = math.pi * 0.020**2
GAINS = PositionPidParameters(
    K_p=0.026,
    K_i=0.001,
    K_d=0.1,
    threshold=1.0,
    smoothing=0.4,
    position_min=0.0,
    position_max=0.055,
    piston_area=AREA,
    volume_at_zero=3.2e-5,
    S_p=SAMPLE,
)
finite = st.floats(-20.0, 20.0)


def position(volume: float) -> float:
    return (GAINS.volume_at_zero - volume) / AREA


def test_a_step_by_hand() -> None:
    state = PositionPidState(integral=0.015, depth=0.50, volume_reference=0.0)
    volume, after, wait = step(GAINS, state, Measurement(0.0, 0.60, 0.0), 1.0)
    smoothed = 0.4 * 0.60 + 0.6 * 0.50
    integral = 0.015 + 0.001 * SAMPLE * 0.4
    expected = 0.026 * 0.4 + integral - 0.1 * (smoothed - 0.50) / SAMPLE
    assert position(volume) == pytest.approx(expected, abs=1e-15)
    assert after.integral == pytest.approx(integral, abs=1e-15)
    assert after.depth == pytest.approx(smoothed, abs=1e-15)
    assert after.volume_reference == volume
    assert wait == SAMPLE


def test_too_shallow_asks_for_less_volume_than_too_deep() -> None:
    state = PositionPidState(0.02, 1.0, 0.0)
    shallow, _, _ = step(GAINS, state, Measurement(0.0, 1.0, 0.0), 1.2)
    deep, _, _ = step(GAINS, state, Measurement(0.0, 1.0, 0.0), 0.8)
    assert shallow < GAINS.volume_at_zero - AREA * 0.02 < deep


@pytest.mark.parametrize(
    ("error", "moves"), [(0.999, True), (-0.999, True), (1.0, False), (-3.0, False)]
)
def test_the_integral_holds_while_the_error_is_large(error: float, moves: bool) -> None:
    state = PositionPidState(0.02, 5.0, 0.0)
    _, after, _ = step(GAINS, state, Measurement(0.0, 5.0, 0.0), 5.0 + error)
    assert (after.integral != 0.02) == moves
    if moves:
        assert after.integral == pytest.approx(0.02 + 0.001 * SAMPLE * error, abs=1e-15)


def test_starts_where_the_piston_is_and_without_a_derivative_kick() -> None:
    held = GAINS.volume_at_zero - AREA * 0.0158
    start = Measurement(0.0, 1.0, held)
    state = initial(GAINS, start, 1.0)
    volume, _, _ = step(GAINS, state, start, 1.0)
    assert volume == pytest.approx(held, abs=1e-18)
    assert initial(GAINS, Measurement(0.0, 1.0, 1.0), 1.0).integral == 0.0
    assert initial(GAINS, Measurement(0.0, 1.0, -1.0), 1.0).integral == 0.055


@given(integral=st.floats(0.0, 0.055), smoothed=finite, depth=finite, reference=finite)
def test_never_leaves_its_limits(
    integral: float, smoothed: float, depth: float, reference: float
) -> None:
    state = PositionPidState(integral, smoothed, 0.0)
    volume, after, _ = step(GAINS, state, Measurement(0.0, depth, 0.0), reference)
    assert -1e-12 <= position(volume) <= 0.055 + 1e-12
    assert 0.0 <= after.integral <= 0.055


def test_compiled_and_plain_are_equal() -> None:
    compiled_step, compiled_initial = numba.njit(step), numba.njit(initial)
    random = np.random.default_rng(7)
    measured = Measurement(0.0, 0.3, GAINS.volume_at_zero)
    plain = initial(GAINS, measured, 1.0)
    fast = compiled_initial(GAINS, measured, 1.0)
    assert tuple(fast) == tuple(plain)
    for k in range(400):
        measured = Measurement(k * SAMPLE, 1.0 + float(random.normal()), 0.0)
        reference = 2.5 if k > 200 else 1.0
        volume, plain, wait = step(GAINS, plain, measured, reference)
        fast_volume, fast, fast_wait = compiled_step(GAINS, fast, measured, reference)
        assert (fast_volume, tuple(fast), fast_wait) == (volume, tuple(plain), wait)


def test_every_parameter_has_a_unit() -> None:
    assert set(POSITION_PID.units) == set(PositionPidParameters._fields)
    for name, unit in POSITION_PID.units.items():
        assert parse_quantity(f"2 {unit}".strip(), unit) == 2.0, name


@pytest.mark.data
@pytest.mark.parametrize(
    ("log", "gains"),
    [
        (43, {}),
        (47, {}),
        (49, {"K_d": 0.01}),
        (53, {"threshold": 10.0}),
        (59, {"smoothing": 1.0}),
        (31, {"K_i": 0.0, "K_d": 0.0}),
    ],
)
def test_replays_the_firmware_that_it_describes(data_dir, log, gains) -> None:
    """Sample by sample from the logged depth: the logged terms, to the last digit printed.

    One sample is left out of log 47: it shows the new set-point, and terms of the old one.
    """
    gains = GAINS._replace(**gains)
    path = data_dir / "ntnu_bv" / "missions.csv.gz"
    with gzip.open(path, "rt", encoding="ascii") as file:
        rows = [r for r in csv.DictReader(file) if r["log"] == str(log)]
    assert len(rows) > 200
    worst, compared = 0.0, 0
    previous = rows[0]
    for row in rows[1:]:
        state = PositionPidState(float(previous["i_term_m"]), float(previous["depth_filt_m"]), 0.0)
        measured = Measurement(float(row["t_s"]), float(row["depth_raw_m"]), 0.0)
        volume, after, _ = step(gains, state, measured, float(row["target_depth_m"]))
        if row["target_depth_m"] == previous["target_depth_m"]:
            off = [
                position(volume) - float(row["pid_output_m"]),
                after.integral - float(row["i_term_m"]),
                after.depth - float(row["depth_filt_m"]),
            ]
            worst, compared = max(worst, *map(abs, off)), compared + 1
        previous = row
    assert compared >= len(rows) - 3
    assert worst < 2e-6


@pytest.mark.parametrize("lost", [math.nan, math.inf, -math.inf])
def test_a_depth_that_is_none_is_forgotten(lost: float) -> None:
    state = initial(GAINS, Measurement(0.0, 1.0, 0.0), 1.2)
    volume, after, _ = step(GAINS, state, Measurement(0.0, lost, 0.0), 1.2)
    assert math.isfinite(volume)
    assert after.depth == state.depth
    held, _, _ = step(GAINS, after, Measurement(0.0, 1.0, 0.0), 1.2)
    assert held == pytest.approx(volume, abs=2e-7)  # but for the integral of a sample
    assert initial(GAINS, Measurement(0.0, lost, 0.0), 1.2).depth == 1.2
