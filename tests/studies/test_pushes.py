"""What pushes cost: nothing where a law holds quietly, and time and volume where it goes down."""

import pytest

from studies.pushes import cost, main


def test_a_quiet_law_holds_as_it_does_without():
    with_, without = (cost("observer", (2.0, 2.0), pushes=on, seed=1) for on in (True, False))
    assert with_ == without
    assert without.pushed == 0.0
    assert not without.alarm


def test_a_way_down_is_longer_with_pushes():
    with_, without = (cost("deadband", (1.0, 20.0), pushes=on, seed=1) for on in (True, False))
    assert without.pushed == 0.0 < with_.pushed
    assert with_.arrival > without.arrival
    assert with_.moved > without.moved
    assert [with_.alarm, without.alarm] == [False, False]


def test_the_command_prints_a_row_for_each_law_with_and_without(capsys, monkeypatch):
    monkeypatch.setattr("studies.pushes._LIMIT", 60.0)
    monkeypatch.setattr("studies.pushes._LAWS", ("cascade",))
    main(["--runs", "1"])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("|")[2].strip() for line in lines[2:]] == ["without", "with"]
    assert lines[0].count("|") == lines[2].count("|")


@pytest.mark.parametrize("pushes", [True, False])
def test_the_papers_cascade_is_there_in_a_minute(pushes):
    found = cost("cascade", (1.0, 20.0), pushes=pushes, seed=2, duration=60.0)
    assert found.arrival < 60.0
    assert found.moved > 0.5
