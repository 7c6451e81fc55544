"""Logs in netCDF: what this package writes is read by itself, other files by their units."""

import numpy as np
import pytest
import xarray as xr

import swimbladder as sb
from swimbladder.io.files import write_csv
from swimbladder.io.log_format import LogFormat
from swimbladder.io.logs import header_names
from swimbladder.io.netcdf import write_netcdf
from tests.log_files import refused


@pytest.fixture(scope="module")
def step():
    vehicle = sb.load_vehicle("feup-em")
    return sb.simulate(vehicle, setpoints=[(0.0, 3.0)], duration=30.0, start_depth=1.5)


def other(path, **attributes):
    """A file of another kind: a clock in days, depths in cm, a cast on an axis of its own."""
    data = xr.Dataset(
        {
            "t": ("record", np.arange(4) / 8.0, {"units": "days since 2024-05-01"}),
            "z": ("record", [100.0, 110.0, np.nan, 150.0], {"units": "cm", **attributes}),
            "note": ("record", ["a", "b", "c", "d"]),
            "level": ("levels", [1.0, 2.0], {"units": "m"}),
            "grid": (("record", "levels"), np.zeros((4, 2))),
        }
    )
    data.to_netcdf(path, engine="h5netcdf")
    return path


def test_a_trajectory_is_the_log_that_its_csv_is(step, tmp_path):
    one = sb.read_log(write_netcdf(tmp_path / "trajectory.nc", step.dataset()))
    same = sb.read_log(write_csv(tmp_path / "trajectory.csv", step.columns()))
    for name in ("time", "depth", "volume", "voltage", "speed", "reference_depth"):
        assert np.array_equal(getattr(one, name), getattr(same, name)), name
    assert one.report == ("columns not used: motor_rate, volume_reference",)


def test_other_files_are_read_by_what_is_said_of_them(tmp_path):
    path = other(tmp_path / "a.nc")
    assert header_names(path) == ["t", "z"]
    log = sb.read_log(path, columns={"time_s": "t", "depth_m": "z"})
    assert log.time.tolist() == [0.0, 10800.0, 32400.0]
    assert log.depth == pytest.approx([1.0, 1.1, 1.5])
    mapped = sb.read_log(path, columns={"time_s": "t@h", "depth_m": "z@dm"})
    assert mapped.depth == pytest.approx([10.0, 11.0, 15.0])


def test_what_is_no_log_is_refused(tmp_path):
    path = other(tmp_path / "a.nc")
    assert "Columns of the file: t, z" in str(refused(path)).replace("columns", "Columns")
    error = refused(path, columns={"time_s": "t", "depth_m": "depth"})
    assert error.value == "depth"
    wrong = other(tmp_path / "b.nc", units="kg")
    assert "another kind" in str(refused(wrong, columns={"time_s": "t", "depth_m": "z"}))
    error = refused(path, log_format=LogFormat(delimiter=";"))
    assert "netCDF" in str(error)
    (tmp_path / "cut.nc").write_bytes(path.read_bytes()[:500])
    assert "cannot be read" in str(refused(tmp_path / "cut.nc"))
