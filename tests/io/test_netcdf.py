"""netCDF files that follow CF."""

import datetime

import numpy as np
import pytest
import xarray as xr

from swimbladder.errors import InputError
from swimbladder.io.tables import write


@pytest.fixture
def dataset():
    time = np.arange(5) * 0.3
    data = xr.Dataset(coords={"time": ("time", time, {"units": "s", "long_name": "time"})})
    data["depth"] = ("time", 1.5 + time**2, {"units": "m", "positive": "down"})
    data.attrs = {"control_law": "cascade", "title": "old"}
    return data


def opened(path, **options):
    with xr.open_dataset(path, engine="h5netcdf", **options) as data:
        return data.load()


def test_numbers_and_attributes_come_back(tmp_path, dataset):
    path = write(tmp_path / "a.nc", dataset, title="A step")
    back = opened(path, decode_times=False)
    assert np.array_equal(back.depth, dataset.depth)
    assert back.depth.attrs == {"units": "m", "positive": "down"}
    assert back.time.attrs["units"] == "s"
    assert "_FillValue" not in back.time.encoding
    assert back.attrs["Conventions"] == "CF-1.11"
    assert back.attrs["title"] == "A step"
    assert back.attrs["source"].startswith("swimbladder ")
    assert back.attrs["control_law"] == "cascade"
    assert str(tmp_path) not in back.attrs["history"]
    assert dataset.attrs == {"control_law": "cascade", "title": "old"}
    assert list(tmp_path.iterdir()) == [path]


def test_a_known_start_makes_time_a_date(tmp_path, dataset):
    zone = datetime.timezone(datetime.timedelta(hours=2))
    start = datetime.datetime(2024, 5, 2, 12, 0, 0, tzinfo=zone)
    path = write(tmp_path / "a.nc", dataset, title="A dive", start=start)
    back = opened(path)
    first, last = back.time.values[[0, -1]]
    assert first == np.datetime64("2024-05-02T10:00:00")
    assert (last - first) / np.timedelta64(1, "ms") == pytest.approx(1200.0)
    assert opened(path, decode_times=False).time.attrs["standard_name"] == "time"


def test_a_place_that_cannot_be_written(tmp_path, dataset):
    with pytest.raises(InputError, match="cannot write the file"):
        write(tmp_path / "none" / "a.nc", dataset, title="A step")
