"""mission.nc against what OG 1.0.0 calls mandatory, read with h5py: a checker of its own.

The tables are those of OG_Format-v1.0.0.adoc (OceanGlidersCommunity/OG-format-user-manual).
"""

import datetime
import re

import h5py
import netCDF4
import numpy as np
import pytest
import xarray

from swimbladder.errors import InputError
from swimbladder.io.casts import read_cast
from swimbladder.io.logs import read_log
from swimbladder.io.netcdf import UNDATED, write_netcdf
from swimbladder.sim.mission.export import og1_dataset
from swimbladder.sim.mission.flight import fly_mission, reach_of
from swimbladder.sim.mission.prepare import make_plan
from swimbladder.sim.mission.result import MissionResult
from tests.cf import cf_problems
from tests.sim.mission.conftest import phases

BEGIN = datetime.datetime(2026, 3, 1, 12, 0, tzinfo=datetime.UTC)
GLOBAL = (
    "title",
    "platform",
    "platform_vocabulary",
    "id",
    "contributor_name",
    "contributor_email",
    "contributor_role",
    "contributor_role_vocabulary",
    "contributing_institutions",
    "contributing_institutions_role",
    "contributing_institutions_role_vocabulary",
    "rtqc_method",
    "start_date",
    "date_created",
    "featureType",
    "Conventions",
)
TIME = {
    "calendar": "gregorian",
    "units": "seconds since 1970-01-01T00:00:00Z",
    "_FillValue": -1.0,
    "valid_min": 1e9,
    "valid_max": 4e9,
}
LATITUDE = {
    "standard_name": "latitude",
    "units": "degrees_north",
    "_FillValue": -9999.9,
    "valid_min": -90.0,
    "valid_max": 90.0,
}
LONGITUDE = {
    "standard_name": "longitude",
    "units": "degrees_east",
    "_FillValue": -9999.9,
    "valid_min": -180.0,
    "valid_max": 180.0,
}
DEPTH = {
    "standard_name": "depth",
    "units": "metres",
    "_FillValue": -9999.9,
    "valid_min": 0.0,
    "valid_max": 10000.0,
}
DOUBLES = {
    "TIME": TIME,
    "LATITUDE": LATITUDE,
    "LONGITUDE": LONGITUDE,
    "DEPTH": DEPTH,
    "TIME_GPS": TIME,
    "LATITUDE_GPS": LATITUDE,
    "LONGITUDE_GPS": LONGITUDE,
}
VOCABULARY = {
    "TIME": "time_vocabulary",
    "LATITUDE": "latitude_vocabulary",
    "LONGITUDE": "longitude_vocabulary",
    "DEPTH": "depth_vocabulary",
}
STRINGS = ("TRAJECTORY", "WMO_IDENTIFIER", "PLATFORM_MODEL", "PLATFORM_SERIAL_NUMBER")
PARAMETER = (
    "long_name",
    "standard_name",
    "vocabulary",
    "_FillValue",
    "units",
    "ancillary_variables",
    "coordinates",
    "sensor",
)
SENSOR = ("sensor_type_vocabulary", "long_name", "sensor_model", "sensor_model_vocabulary")


def text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


@pytest.fixture(scope="module")
def flown(profiler, sea):
    task = phases()
    flight = fly_mission(profiler, task, sea)
    return MissionResult(flight, reach_of(profiler, task, make_plan(profiler, task, sea)))


@pytest.fixture(scope="module", params=[(43.4, 7.85), (None, None)], ids=["placed", "nowhere"])
def file(request, flown, tmp_path_factory):
    latitude, longitude = request.param
    data = og1_dataset(flown, begin=BEGIN, latitude=latitude, longitude=longitude)
    path = write_netcdf(tmp_path_factory.mktemp("og1") / "mission.nc", data)
    with h5py.File(path) as opened:
        yield opened


def test_global_attributes(file):
    for name in GLOBAL:
        assert text(file.attrs[name]), name
    assert text(file.attrs["featureType"]) == "trajectory"
    assert "OG-1.0" in text(file.attrs["Conventions"]).split(", ")
    for name in ("start_date", "date_created", "time_coverage_start", "time_coverage_end"):
        assert re.fullmatch(r"\d{8}T\d{6}", text(file.attrs[name])), name
    serial = text(file["PLATFORM_SERIAL_NUMBER"][()])
    assert text(file.attrs["id"]) == f"{serial}_20260301T120000_simulated"
    assert text(file["TRAJECTORY"][()]) == f"{serial}_20260301T120000"


def test_the_conventions_of_cf(flown, tmp_path):
    data = og1_dataset(flown, begin=BEGIN, latitude=43.4, longitude=7.85)
    assert cf_problems(write_netcdf(tmp_path / "mission.nc", data)) == []


def test_what_others_read(file):
    """netCDF4 hides what valid_min, valid_max and _FillValue exclude; xarray finds coordinates."""
    placed = not np.isnan(file["LATITUDE"][0]) and file["LATITUDE"][0] != -9999.9
    with netCDF4.Dataset(file.filename) as data:
        for name in ("TIME", "DEPTH", "PRES", "TEMP", "VOLUME_CHANGE", "CYCLE_NUMBER"):
            assert not np.ma.is_masked(data[name][:]), name
        for name in ("LATITUDE", "LONGITUDE", "DEPLOYMENT_LATITUDE"):
            assert np.ma.getmaskarray(data[name][:]).all() != placed
    with xarray.open_dataset(file.filename) as data:
        assert set(data.TEMP.coords) == {"TIME", "LATITUDE", "LONGITUDE", "DEPTH"}
        assert data.TIME.values[0] == np.datetime64("2026-03-01T12:00")
        # of argopy and of OG1
        assert {"PRES", "TEMP", "TIME", "LATITUDE", "LONGITUDE", "CYCLE_NUMBER"} <= {
            *data.variables
        }


@pytest.mark.prove
def test_it_is_read_as_a_cast_and_as_a_log(flown, tmp_path):
    data = og1_dataset(flown, begin=BEGIN, latitude=43.4, longitude=7.85)
    path = write_netcdf(tmp_path / "mission.nc", data)
    cast = read_cast(path, profile=1, salinity=38.0)
    assert (cast.latitude, cast.longitude) == pytest.approx((43.4, 7.85))
    deepest = float(flown.flight.rows["z"].max())
    assert cast.pressure.max() == pytest.approx(deepest, rel=0.02)
    log = read_log(path)
    assert log.depth.max() == deepest
    assert np.ptp(log.time) == pytest.approx(flown.flight.duration, abs=1e-6)


def test_a_mission_without_a_date(flown):
    data = og1_dataset(flown)
    assert data.TIME.attrs["valid_min"] <= float(data.TIME[0]) == UNDATED.timestamp()
    assert "date is arbitrary" in data.TIME.attrs["comment"]
    assert "comment" not in og1_dataset(flown, begin=BEGIN).TIME.attrs


@pytest.mark.parametrize("year", [1999, 2097])
def test_dates_that_og1_has_not(flown, year):
    with pytest.raises(InputError, match="from 2001-09-09 to 2096-10-02"):
        og1_dataset(flown, begin=BEGIN.replace(year=year))


def test_positions_and_fixes(file):
    count = file["TIME"].shape[0]
    assert file["TIME"].maxshape == (None,)  # N_MEASUREMENTS is unlimited
    for name, wanted in DOUBLES.items():
        variable = file[name]
        assert variable.dtype == np.float64
        assert variable.shape == (count,)
        for key, value in wanted.items():
            found = variable.attrs[key]
            found = text(found) if isinstance(value, str) else float(np.ravel(found)[0])
            assert found == value, (name, key)
        assert text(variable.attrs["long_name"])
        assert text(variable.attrs["ancillary_variables"]) == f"{name}_QC"
        values = variable[()]
        valid = values[values != wanted["_FillValue"]]
        assert np.all((valid >= wanted["valid_min"]) & (valid <= wanted["valid_max"]))
        if name.endswith("_GPS"):
            assert valid.size == 0  # a simulation has no fixes
        if name in VOCABULARY:
            assert "vocab.nerc.ac.uk/collection/OG1" in text(variable.attrs[VOCABULARY[name]])
            assert text(variable.attrs["interpolation_methodology"])
    assert np.all(np.diff(file["TIME"][()]) >= 0.0)


def test_platform_and_deployment(file):
    for name in STRINGS:
        assert file[name].shape == ()
        assert text(file[name][()])
        assert text(file[name].attrs["long_name"])
    assert text(file["TRAJECTORY"].attrs["cf_role"]) == "trajectory_id"
    assert text(file["PLATFORM_MODEL"].attrs["platform_model_vocabulary"])
    assert float(file["DEPLOYMENT_TIME"][()]) == BEGIN.timestamp()
    for name in ("DEPLOYMENT_LATITUDE", "DEPLOYMENT_LONGITUDE"):
        place = file[name.removeprefix("DEPLOYMENT_")][0]
        assert float(file[name][()]) == place
        assert text(file[name].attrs["long_name"])
    assert int(file["PLATFORM_DEPTH_RATING"][()]) == 2000


def test_parameters_have_a_sensor_and_flags(file):
    for name in ("PRES", "TEMP"):
        assert file[name].dtype == np.float32
        for key in PARAMETER:
            assert key in file[name].attrs, (name, key)
        sensor = file[text(file[name].attrs["sensor"])]
        assert re.fullmatch(r"/SENSOR_[A-Z]+_\w+", sensor.name)
        for key in SENSOR:
            assert text(sensor.attrs[key]), key
        assert file[name].attrs["_FillValue"].dtype == np.float32
    for name in (*DOUBLES, "PRES", "TEMP", "PHASE"):
        flags = file[f"{name}_QC"]
        assert flags.dtype == np.int8
        assert np.all(flags[()] == 0)
        assert int(np.ravel(flags.attrs["_FillValue"])[0]) == -127
        assert list(flags.attrs["flag_values"]) == [0, 1, 2, 3, 4]
        assert len(text(flags.attrs["flag_meanings"]).split()) == 5


def test_the_phase(file):
    phase = file["PHASE"]
    assert phase.dtype == np.int8
    assert int(np.ravel(phase.attrs["_FillValue"])[0]) == 0
    assert text(phase.attrs["phase_calculation_method"])
    assert {1, 2, 3, 4} <= set(phase[()].tolist())
    assert list(phase.attrs["flag_values"]) == [0, 1, 2, 3, 4]
