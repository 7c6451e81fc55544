"""A deep Argo float flown by its own rules, beside what it did."""

import numpy as np
import pytest

from studies.argo_cycles import Ascent, Row, flown, identified, of_ascents, replayed, table


def test_a_table_has_what_was_logged_beside_what_was_flown() -> None:
    row = Row(7, 750.0, 753.0, 28, 29, 1237.0, 1243.0, 18, 19, 8, 6)
    said = table([row, row._replace(ascent_flown=746.0)])
    assert "| 7 | 750 / 753 | 28 / 29 | 1237 / 1243 | 18 / 19 | 8 / 6 |" in said
    assert said.endswith("ascents off by 3.5 min rms")


def test_ascents_are_beside_a_constant_speed() -> None:
    """From 1050 dbar: one takes 100 min, another 110, told as 112, and is 500 dbar down at half."""
    half = np.array([55.0])
    one = Ascent(100.0, 100.0, np.array([550.0]), np.array([550.0]), np.array([50.0]), 1050.0)
    other = Ascent(110.0, 112.0, np.array([550.0]), np.array([560.0]), half, 1050.0)
    said = of_ascents([other], [one])
    assert "2.0 min rms, 10.0 at constant speed" in said
    assert "10.0 dbar rms, 50.0 at constant speed" in said


@pytest.mark.prove
def test_cycles_that_were_not_fitted_are_flown_as_they_were(data_dir) -> None:
    """Five cycles identify the float; four others are flown by its configuration, and replayed.

    The mean of 40 ascents of this float is off by 9 min rms; so are these four as flown, 1 % early.
    """
    folder = data_dir / "argo_arvor"
    vehicle = identified(folder, [2, 3, 4, 5, 6])
    rows = [flown(folder, vehicle, cycle) for cycle in (7, 8, 9, 10)]
    ascents = [replayed(folder, vehicle, cycle) for cycle in (7, 8, 9, 10)]
    late = np.array([ascent.told - ascent.minutes for ascent in ascents])
    assert np.sqrt(np.mean(late**2)) < 5.0
    off = np.array([row.ascent_flown - row.ascent for row in rows])
    assert np.sqrt(np.mean(off**2)) < 12.0
    for row in rows:
        assert abs(row.pumps_flown - row.pumps) <= 2
        assert abs(row.valves_flown - row.valves) <= 2
        assert abs(row.on_flown - row.on) <= 2
        assert row.descent_flown == pytest.approx(row.descent, rel=0.08)
