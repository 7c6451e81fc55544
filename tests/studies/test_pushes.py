"""What pushes cost and save: nothing where a vehicle stays, and the vehicle further down."""

import math

import numpy as np
import pytest

from studies.pushes import drowned, main, way


def test_a_way_is_a_step_or_goes_on_at_its_speed_and_ends_where_it_should():
    assert way(3.0, math.inf) == [(0.0, 1.5), (120.0, 3.0)]
    times, depths = np.array(way(5.0, 0.1)[1:]).T
    assert np.allclose(np.diff(times), 0.3)
    assert np.allclose(np.diff(depths)[:-1], 0.03)
    assert depths[-1] == 5.0
    assert np.isclose(times[-1], 120.0 + 34.8)


@pytest.mark.promise("test-pushes", faults=["blocked outward"])
def test_pushes_save_the_vehicle_from_blocks_that_take_it_down_without():
    assert drowned("planned", 3.0, math.inf, supervised=False) > 0
    assert drowned("planned", 3.0, math.inf, supervised=True) == 0


def test_the_command_prints_a_row_for_each_law_alone_and_supervised(capsys, monkeypatch):
    monkeypatch.setattr("studies.pushes.WAYS", ((3.0, math.inf),))
    main(["--runs", "2", "--law", "observer"])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("|")[2].strip() for line in lines[2:]] == ["no", "yes"]
    assert {line.count("|") for line in lines} == {lines[0].count("|")}
    alone, under = ([cell.strip() for cell in line.split("|")[3:5]] for line in lines[2:])
    assert alone == under  # it holds as it does without
