"""Limit cycles of the study: the balance against its own equation, and the table."""

import math

import numpy as np
import pytest

from studies import cycles
from studies.cycles import CASES, foretold, main, row, simulated
from swimbladder.design.stability.cycles import Seen
from swimbladder.physics.dynamics import plant


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.words)
def test_every_case_has_a_cycle_of_its_own_kind(case):
    one = foretold(case)
    assert one.source == case.source
    assert one.cycle.stable is (case.source != "voltage limit")
    assert one.depth_amplitude > 0.0
    sticks = plant(case.vehicle).friction
    assert sticks == (0.5 if case.source == "friction of the motor" else 0.0)


def test_a_quantum_that_is_just_passed_is_half_of_it():
    """The describing function of a quantiser begins at half a quantum, whatever the loop."""
    one = foretold(CASES[-1])
    assert one.depth_amplitude == pytest.approx(0.5 * CASES[-1].depth_quantum, rel=0.01)


@pytest.mark.prove
def test_the_dead_zone_of_the_cascade_is_simulated_as_foretold_from_both_starts():
    case = CASES[1]
    one = foretold(case)
    small, large = simulated(case, one)
    for seen in (small, large):
        assert seen.cycles
        assert seen.amplitude == pytest.approx(one.depth_amplitude, rel=0.2)
        assert seen.period == pytest.approx(one.cycle.period, rel=0.12)
    assert small.amplitude == pytest.approx(large.amplitude, rel=1e-3)


def test_a_row_says_each_end_once_and_where_none_is(capsys, monkeypatch):
    case = CASES[1]
    one = foretold(case)
    steady, other = Seen(True, 0.0157, 57.3, 0.02), Seen(False, math.nan, math.nan, 0.0026)
    assert row(case, one, (steady, steady)).endswith("| 15.7 mm every 57.3 s |")
    assert row(case, one, (steady, other)).endswith("15.7 mm every 57.3 s or within 2.6 mm |")
    assert row(case, one, (None,)).endswith("| no edge |")
    monkeypatch.setattr(cycles, "simulated", lambda *_: (steady,))
    main([])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 + len(CASES)
    assert np.unique([line.count("|") for line in lines]).tolist() == [5]
