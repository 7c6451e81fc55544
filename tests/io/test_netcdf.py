"""netCDF files that follow CF: what is written, by whom, and what others read."""

import datetime
import re
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

import swimbladder
from swimbladder.errors import InputError
from swimbladder.io.netcdf import (
    UNDATED,
    cf_dataset,
    described,
    meaning,
    of_type,
    time_since,
    unless_dated,
    write_netcdf,
)
from tests.cf import cf_problems

TIME = np.arange(5) * 0.3
MOMENT = datetime.datetime(
    2024, 5, 2, 12, 0, 0, tzinfo=datetime.timezone(datetime.timedelta(hours=2))
)


def made(begin=MOMENT):
    about = time_since(begin or UNDATED, "time", axis="T", **unless_dated(begin))
    variables = {
        "time": ("time", TIME, about),
        "depth": ("time", 1.5 + TIME**2, meaning("m", "depth", "depth", positive="down")),
        "valve": (
            "time",
            np.array([0, 1, 1, 0, 2], np.int8),
            meaning("", "valve", flag_meanings="shut open stuck", _FillValue=-1),
        ),
    }
    return cf_dataset(variables, described("A step", control_law="cascade"), coordinates=["time"])


def opened(path, **options):
    with xr.open_dataset(path, engine="h5netcdf", **options) as data:
        return data.load()


def test_numbers_and_attributes_come_back(tmp_path):
    path = write_netcdf(tmp_path / "a.nc", made())
    back = opened(path, decode_times=False)
    assert np.array_equal(back.time, TIME)
    assert np.array_equal(back.depth, made().depth)
    assert back.depth.attrs == {
        "units": "m",
        "long_name": "depth",
        "standard_name": "depth",
        "positive": "down",
    }
    assert "_FillValue" not in back.time.encoding
    assert back.attrs["Conventions"] == "CF-1.11"
    assert back.attrs["title"] == "A step"
    assert back.attrs["source"].startswith("swimbladder ")
    assert back.attrs["control_law"] == "cascade"
    assert list(tmp_path.iterdir()) == [path]
    assert cf_problems(path) == []


def test_a_user_who_writes_the_dataset_writes_the_same(tmp_path):
    made().to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    assert opened(tmp_path / "a.nc").identical(opened(write_netcdf(tmp_path / "b.nc", made())))
    assert cf_problems(tmp_path / "a.nc") == []


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("time", {"standard_name": "depth"}, "canonical units"),
        ("depth", {"standard_name": "deepness"}, "deepness is not defined"),
        ("depth", {"ancillary_variables": "depth_QC"}, "depth_QC"),
        ("valve", {"flag_values": np.arange(3)}, "flag_values"),
    ],
)
def test_the_checker_finds_what_is_wrong(name, wrong, words):
    data = made()
    data[name].attrs |= wrong
    assert words in " ".join(cf_problems(data))


def test_a_known_start_makes_time_a_date(tmp_path):
    back = opened(write_netcdf(tmp_path / "a.nc", made()))
    first, last = back.time.values[[0, -1]]
    assert first == np.datetime64("2024-05-02T10:00:00")
    assert (last - first) / np.timedelta64(1, "ms") == pytest.approx(1200.0)
    assert "comment" not in back.time.attrs


def test_a_run_without_a_date_says_so(tmp_path):
    path = write_netcdf(tmp_path / "a.nc", made(None))
    back = opened(path, decode_times=False).time
    assert np.array_equal(back, TIME)  # seconds since the start all the same
    assert back.attrs["units"] == "seconds since 2020-01-01T00:00:00Z"
    assert "date is arbitrary" in back.attrs["comment"]
    assert cf_problems(path) == []


def test_flags_and_ends_have_the_type_of_their_variable(tmp_path):
    with netCDF4.Dataset(write_netcdf(tmp_path / "a.nc", made())) as file:
        valve = file["valve"]
        assert valve.flag_values.dtype == valve._FillValue.dtype == valve.dtype == np.int8
        assert valve.flag_values.tolist() == [0, 1, 2]
        assert valve[:].tolist() == [0, 1, 1, 0, 2]
    said = of_type({"valid_range": [0, 4], "units": "m"}, np.float32)
    assert said["valid_range"].dtype == np.float32
    assert said["units"] == "m"


def test_a_place_that_cannot_be_written(tmp_path):
    with pytest.raises(InputError, match="cannot write the file"):
        write_netcdf(tmp_path / "none" / "a.nc", made())


def test_attributes_are_written_in_one_place():
    """Who writes netCDF or zarr else would have to be checked by the checker too."""
    source = Path(swimbladder.__file__).parent
    writers, words = set(), set()
    for path in source.rglob("*.py"):
        text, name = path.read_text(encoding="utf-8"), path.relative_to(source).as_posix()
        if re.search(r"to_netcdf\(|\.to_netcdf|to_zarr|zarr\.create|\.create_variable", text):
            writers.add(name)
        if re.search(r"\"(axis|calendar|flag_values|Conventions)\"", text):
            words.add(name)
    assert writers == {"io/netcdf.py", "sim/campaign/store.py"}
    assert words == {"io/netcdf.py"}
