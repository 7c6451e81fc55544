"""What a reversal asks of a motor: the heat of a jump against SciPy, and both laws in short."""

import pytest
from scipy.integrate import solve_ivp

from studies import reversals
from studies.reversals import asked, main
from swimbladder.design.tuning.trial import Step


@pytest.mark.parametrize(("before", "after"), [(0.0, 0.22), (0.22, -0.22)])
def test_the_heat_of_a_jump_is_scipys(before, after):
    """R i = u - e, and e follows u with T1: the heat times R is the integral of (u - e)^2."""
    T1 = 0.09
    run = solve_ivp(
        lambda _, y: [(after - y[0]) / T1, (after - y[0]) ** 2],
        (0.0, 3.0),
        [before, 0.0],
        rtol=1e-10,
        atol=1e-14,
    )
    assert run.y[1, -1] == pytest.approx((after - before) ** 2 * T1 / 2.0, rel=1e-6)


@pytest.mark.prove
def test_pulses_start_less_often_and_ask_more():
    short = Step(2.0, 2.0001, 1200.0)
    one, both = (asked(name, runs=10, step=short) for name in ("observer", "pulse"))
    assert both["starts"] < one["starts"]
    assert both["turns"] == pytest.approx(both["starts"], rel=0.2)
    assert one["turns"] < 0.1 * one["starts"]
    assert both["turn_V"] == pytest.approx(2.0 * both["start_V"], rel=0.05)
    assert both["jump_heat"] > 3.0 * one["jump_heat"]
    assert both["moved"] > 3.0 * one["moved"]
    # The voltage that holds the piston at 2 m, all the time.
    assert both["hold_heat"] == pytest.approx((0.07707 * 2.0) ** 2 * 3600.0, rel=0.01)


def test_the_command_prints_the_table(capsys, monkeypatch):
    keys = ["starts", "turns", "start_V", "turn_V", "jump_heat", "hold_heat", "moved", "share"]
    monkeypatch.setattr(reversals, "asked", lambda *_, runs: dict.fromkeys(keys, float(runs)))
    main(["--runs", "7"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "| an hour | observer | pulse |"
    assert lines[2] == "| starts from rest | 7 | 7 |"
    assert len(lines) == 10
