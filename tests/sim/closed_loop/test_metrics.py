"""What a depth step looks like in numbers."""

import numpy as np
import pytest

from swimbladder.sim.closed_loop import step_metrics

T = np.arange(0.0, 100.0, 0.5)


def test_a_second_order_response_has_its_textbook_numbers() -> None:
    """Damping 0.5, 0.2 rad/s: overshoot exp(-pi zeta/sqrt(1 - zeta^2))."""
    zeta, omega = 0.5, 0.2
    t = np.arange(0.0, 200.0, 1e-3)
    w = omega * np.sqrt(1 - zeta**2)
    response = 1 - np.exp(-zeta * omega * t) * (np.cos(w * t) + zeta * omega / w * np.sin(w * t))
    for start, target in ((1.0, 3.0), (5.0, 2.5)):
        m = step_metrics(t, start + (target - start) * response, start=start, target=target)
        overshoot = 100.0 * np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))
        assert m.overshoot_pct == pytest.approx(overshoot, rel=1e-6)
        assert m.rise90_s == pytest.approx(t[np.argmax(response > 0.9)])
        assert m.settle2_s == pytest.approx(t[np.flatnonzero(np.abs(response - 1) > 0.02)[-1]])
        assert m.final_depth_m == pytest.approx(target, abs=1e-6)


def test_times_count_from_the_first() -> None:
    z = np.minimum(1.0 + 0.1 * T, 2.0)
    a = step_metrics(T, z, start=1.0, target=2.0)
    b = step_metrics(T + 50.0, z, start=1.0, target=2.0)
    assert a == b
    assert a.rise90_s == 9.5  # first sample past 90 %: 0.95
    assert a.settle2_s == 9.5  # the last sample outside 2 %
    assert a.overshoot_pct == 0.0


def test_what_never_arrives_has_no_rise_and_no_settling() -> None:
    m = step_metrics(T, np.full(T.shape, 1.2), start=1.0, target=2.0)
    assert m.rise90_s is None
    assert m.settle2_s is None
    assert m.final_depth_m == 1.2


def test_a_last_sample_outside_is_not_settled() -> None:
    z = np.full(T.shape, 2.0)
    z[-1] = 2.03
    assert step_metrics(T, z, start=1.0, target=2.0).settle2_s is None
    z[-1] = 2.01
    assert step_metrics(T, z, start=1.0, target=2.0).settle2_s == 0.0


def test_no_step_at_all() -> None:
    m = step_metrics(T, np.full(T.shape, 2.5), start=2.0, target=2.0)
    assert m == (0.0, None, None, 2.5)


def test_motion_the_wrong_way_is_no_overshoot() -> None:
    z = np.where(T < 10.0, 0.8, 2.0)
    assert step_metrics(T, z, start=1.0, target=2.0).overshoot_pct == 0.0
