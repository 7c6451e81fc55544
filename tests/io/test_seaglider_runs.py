"""The pump's runs in a Seaglider's netCDF files."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from swimbladder.errors import LogError
from swimbladder.io.pump_runs import PumpRuns, joined_runs, read_pump_runs

SECONDS = np.array([-20.0, 138.4, 0.0, 143.4, 30.0])
EVENTS = {
    "gc_vbd_secs": SECONDS,
    "gc_vbd_volts": np.array([14.7, 14.5, 30.0, 14.2, 14.6]),
    "gc_vbd_i": np.array([0.006, 0.9, 0.0, 1.39, 0.01]),  # the last: a valve
    "gc_depth": np.array([3.5, 66.6, 90.0, 500.0, 1.0]),
    "gc_vbd_pot1_ad_start": np.array([600.0, 3000.0, 2300.0, 2300.0, 600.0]),
    "gc_vbd_pot1_ad": np.array([1000.0, 2286.0, 2300.0, 1595.0, 700.0]),
    "gc_vbd_pot2_ad_start": np.array([610.0, 3010.0, 2310.0, 2310.0, 610.0]),
    "gc_vbd_pot2_ad": np.array([1010.0, 2296.0, 2310.0, 1604.0, 710.0]),
    "gc_st_secs": 1.7168e9 + np.arange(5.0),
}
SCALARS = {"log_VBD_CNV": -0.2453, "log_DIVE": 101.0, "avg_latitude": 12.1}


def written(path, events=EVENTS, scalars=SCALARS, engine="h5netcdf"):
    columns = {name: ("gc_event", values) for name, values in events.items()}
    data = xr.Dataset({**columns, **{name: ((), value) for name, value in scalars.items()}})
    data.to_netcdf(path, engine=engine)
    return path


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_runs_of_the_pump_are_those_with_a_motor(tmp_path, engine):
    runs = read_pump_runs(written(tmp_path / "p1710101.nc", engine=engine))
    np.testing.assert_allclose(runs.duration, [138.4, 143.4])
    np.testing.assert_allclose(runs.power, [14.5 * 0.9, 14.2 * 1.39])
    np.testing.assert_allclose(runs.volume, [714 * 0.2453e-6, 705.5 * 0.2453e-6])
    np.testing.assert_allclose(runs.dive, [101.0, 101.0])
    # 500 m are 504 dbar near the equator
    np.testing.assert_allclose(runs.pressure, [67.0e4, 503.9e4], rtol=2e-3)


def test_without_a_scale_of_the_potentiometers_no_volume_is_known(tmp_path):
    scalars = {"log_DIVE": 3.0}
    runs = read_pump_runs(written(tmp_path / "p1710003.nc", scalars=scalars))
    assert runs.volume is None
    assert any("log_VBD_CNV" in line for line in runs.report)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"gc_vbd_secs": None}, "no motor events of a Seaglider: gc_vbd_secs"),
        ({"gc_vbd_volts": 1e3 * EVENTS["gc_vbd_volts"]}, "no run of a pump has this"),
        ({"gc_vbd_i": 1e6 * EVENTS["gc_vbd_i"]}, "half of the runs take more than"),
    ],
)
def test_what_is_no_dive_of_a_seaglider_is_refused(tmp_path, change, said):
    events = {n: v for n, v in (EVENTS | change).items() if v is not None}
    with pytest.raises(LogError, match=said):
        read_pump_runs(written(tmp_path / "p1.nc", events=events))


def test_damaged_bytes_and_columns_are_refused(tmp_path):
    path = tmp_path / "p1.nc"
    path.write_bytes(b"CDF\x01 and no more")
    with pytest.raises(LogError, match="cannot be read"):
        read_pump_runs(path)
    with pytest.raises(LogError, match="has its own names"):
        read_pump_runs(written(path), columns={"pressure_Pa": "gc_depth"})


def test_tables_are_joined_and_one_without_dives_is_a_dive():
    one = PumpRuns(duration=np.ones(2), pressure=np.ones(2), power=np.ones(2), dive=np.full(2, 7.0))
    other = PumpRuns(
        duration=np.ones(1), pressure=np.ones(1), power=np.ones(1), voltage=np.array([14.0])
    )
    both = joined_runs([one, other])
    assert both.dive is not None
    assert both.dive.tolist()[:2] == [7.0, 7.0]
    assert both.dive[2] not in (7.0,)
    np.testing.assert_array_equal(both.voltage, [np.nan, np.nan, 14.0])
    assert both.volume is None
    assert joined_runs([one]) is one


def test_a_real_gliders_dives_are_read_as_its_table(data_dir, tmp_path):
    """The base station's names and numbers, in the shape of its files; none of them is at hand."""
    events = pd.read_parquet(data_dir / "seaglider" / "gc_events.parquet")
    about = pd.read_csv(data_dir / "seaglider" / "dives.csv").set_index("dive")
    paths = []
    for number in (1710100, 1710101, 1710102):
        own = events[events.dive == number]
        columns = {n: own[n].to_numpy(float) for n in own if n.startswith("gc_")}
        scalars = {n: float(about.loc[number, n]) for n in ("log_VBD_CNV", "avg_latitude")}
        path = tmp_path / f"p{number}.nc"
        paths.append(written(path, columns, scalars | {"log_DIVE": float(number % 10000)}))
    runs = joined_runs([read_pump_runs(path) for path in paths])
    assert len(runs.duration) == 10
    rate = 1e6 * runs.volume / runs.duration
    assert rate.min() > 1.15
    assert rate.max() < 1.35
    assert set(runs.dive) == {100.0, 101.0, 102.0}
