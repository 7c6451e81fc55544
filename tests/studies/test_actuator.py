"""Benches whose gains differ, believed to be the same: the study's option, and what it costs."""

import pytest

from studies import actuator
from studies.actuator import main, same_gains, score
from swimbladder.estimation.actuator import model as spreads

CASE = "steps, gains differ by 2 %"


@pytest.mark.prove
def test_four_voltages_count_alone_and_fewer_intervals_hold_where_gains_are_thought_the_same():
    count, seed = 16, 1
    allowed = score(CASE, count, seed, four=True)["K1"]
    with same_gains():
        same = score(CASE, count, seed, four=True)["K1"]
    assert 0 < allowed.significant < count
    assert same.significant == allowed.significant
    assert same.held < allowed.held
    assert same.pull > 3.0 * allowed.pull


def test_the_belief_ends_with_its_block():
    before = spreads.PRIOR
    with same_gains():
        assert before > 1e6 * spreads.PRIOR
    assert before == spreads.PRIOR


def test_the_command_passes_its_options_on(capsys, monkeypatch):
    seen = []

    def noted(case, count, seed, *, four):
        seen.append((case, count, seed, four, spreads.PRIOR))
        return {"K1": actuator.Score(79, 20, 1.0, 0.0)}

    monkeypatch.setattr(actuator, "score", noted)
    main(["--case", CASE, "--benches", "9", "--four", "--same"])
    main(["--case", CASE, "--benches", "9"])
    assert [s[:4] for s in seen] == [(CASE, 9, 1, True), (CASE, 9, 1, False)]
    assert seen[1][4] > 1e6 * seen[0][4]
    assert "25.3%" in capsys.readouterr().out
