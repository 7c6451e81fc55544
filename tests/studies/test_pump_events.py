"""The gliders' pump events: rows against the log itself, bands against what its notes say."""

import numpy as np
import pandas as pd
import pytest

from studies.pump_events import main, summary, table
from studies.pump_power import glider_runs

pytestmark = pytest.mark.data


@pytest.fixture(scope="module")
def vehicles(data_dir):
    return glider_runs(data_dir / "seaglider")


def test_every_event_is_there_with_its_time_volume_and_energy(vehicles, data_dir):
    events = table(vehicles)
    raw = pd.read_parquet(data_dir / "seaglider" / "gc_events.parquet")
    assert len(events) == sum(v.runs.power.size for v in vehicles)
    one = raw[(raw.dive == events.dive[0]) & (raw.gc_vbd_secs == events.duration_s[0])].iloc[0]
    assert events.time[0].timestamp() == pytest.approx(one.gc_st_secs, abs=1e-3)
    counts = np.mean(
        [
            one.gc_vbd_pot1_ad - one.gc_vbd_pot1_ad_start,
            one.gc_vbd_pot2_ad - one.gc_vbd_pot2_ad_start,
        ]
    )
    assert events.volume_mL[0] == pytest.approx(-0.2453 * counts, rel=1e-6)
    energy = one.gc_vbd_volts * one.gc_vbd_i * one.gc_vbd_secs
    assert events.electrical_J[0] == pytest.approx(energy, rel=1e-9)
    work = 1e-2 * events.pressure_dbar * events.volume_mL  # dbar mL = 10 mJ
    assert np.allclose(events.efficiency, work / events.electrical_J, rtol=1e-9)


def test_efficiency_over_depth_is_that_of_the_notes(vehicles):
    """0.03 to 0.05 at 40 m, 0.31 to 0.33 at 500 m, 0.33 to 0.40 at 990 m; SG167 has a booster."""
    bands = summary(vehicles).set_index("vehicle")
    for name, low, high, least, most in (
        ("SG171", 480, 520, 0.30, 0.34),
        ("SG249", 900, 1010, 0.33, 0.41),
        ("SG249", 30, 45, 0.025, 0.05),
        ("SG167", 900, 1010, 0.33, 0.41),
    ):
        own = bands.loc[name]
        near = own[(own.dbar > low) & (own.dbar < high)]
        assert len(near)
        assert near.efficiency.between(least, most).all()
        assert np.allclose(near.by_the_law, near.efficiency, rtol=0.12)


def test_the_tables_are_written(data_dir, tmp_path, capsys):
    assert main([str(data_dir), "--out", str(tmp_path)]) == 0
    events = pd.read_csv(tmp_path / "events.csv", parse_dates=["time"])
    assert {"vehicle", "time", "pressure_dbar", "volume_mL", "electrical_J", "efficiency"} <= set(
        events
    )
    assert len(pd.read_csv(tmp_path / "vehicles.csv")) > 10
    assert f"{len(events)} events of 4 gliders" in capsys.readouterr().out
