"""What a power law tells of pumps at sea: the bounds asked for, held by the measured data."""

import numpy as np
import pytest

from studies.pump_power import (
    float_runs,
    float_table,
    glider_runs,
    glider_tables,
    glider_valves,
    main,
)

pytestmark = pytest.mark.data


@pytest.fixture(scope="module")
def told(data_dir):
    return float_table(float_runs(data_dir / "mermaid_p0051"))


def test_three_numbers_tell_the_floats_power_to_0_4_w(told):
    fit, _ = told
    assert len(fit.parameters) == 3
    assert fit.kept.sum() > 900
    assert fit.power_rms < 0.4
    assert 14.4 < fit.reference_voltage < 14.7
    low, high = fit.parameters["power_per_pressure"].ci95
    # What its notes found by hand: 6.77 W + 7.59 mW/dbar over 667 of these runs.
    assert low < 7.59e-7 < high


def test_every_dive_of_the_float_is_told_by_the_others_within_10_per_cent(told):
    _, table = told
    assert len(table) > 80
    assert table.error.abs().max() < 0.1
    deep = table[table.deepest_dbar > 400.0]
    assert len(deep) >= 6
    assert deep.error.abs().max() < 0.06


def test_every_gliders_dives_are_told_by_the_others_within_10_per_cent(data_dir):
    gliders = {v.name: v for v in glider_runs(data_dir / "seaglider")}
    assert {"SG167", "SG171", "SG180", "SG249"} <= set(gliders)
    for vehicle in gliders.values():
        _, dives, efficiency = glider_tables(vehicle)
        assert dives.error.abs().max() < 0.1, vehicle.name
        assert dives.volume_error.abs().max() < 0.1, vehicle.name
        assert np.all(efficiency.efficiency < 0.5)
    # 0.03 to 0.05 at 40 m and 0.33 to 0.40 at 990 m, as the notes have it.
    _, _, deep = glider_tables(gliders["SG249"])
    assert deep.efficiency.iloc[-1] == pytest.approx(0.40, abs=0.01)
    assert deep.told.iloc[-1] == pytest.approx(deep.efficiency.iloc[-1], rel=0.02)
    assert deep.efficiency.iloc[0] < 0.05


def test_a_glider_with_a_booster_is_seen_to_have_two_pumps(data_dir):
    split = {v.name: v.split for v in glider_runs(data_dir / "seaglider")}
    assert split["SG171"] is split["SG180"] is split["SG249"] is None
    assert 1.0e6 < split["SG167"] < 1.25e6


def test_the_gliders_valves_are_orifices(data_dir):
    """Two numbers tell 5 to 15 mL/s within 5 %, where a constant rate would be wrong by half."""
    valves = glider_valves(data_dir / "seaglider")
    assert len(valves) >= 3
    for b in valves:
        assert np.abs(b.told / b.rate - 1.0).max() < 0.05, b.name
        assert b.rate.max() > 1.8 * b.rate.min()
        assert 0.0 < b.head < 5e4


def test_the_study_prints_its_tables(data_dir, capsys):
    assert main([str(data_dir)]) == 0
    said = capsys.readouterr().out
    assert "rms 0.26" in said
    assert "(without voltages 0.30" in said
    assert "SG249" in said
    assert main([]) == 2
