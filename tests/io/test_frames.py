"""Logs and casts as DataFrames and Datasets: the same numbers as from a file, units asked for."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import swimbladder as sb
from swimbladder.errors import InputError
from swimbladder.io.log_format import LogFormat

LABELLED = pd.DataFrame({"time_s": [0.0], "depth_m": [1.0]})
LABELLED.attrs["units"] = "m"


@pytest.fixture(scope="module")
def step():
    return sb.simulate("feup-em", setpoints=[(0.0, 3.0)], duration=30.0, start_depth=1.5)


@pytest.fixture
def cast():
    depth = np.arange(0.0, 60.0, 2.0)
    columns = {"depth": depth, "temperature": 15.0 - 0.1 * depth, "salinity": 35.0 + 0.01 * depth}
    return pd.DataFrame(columns)


def test_what_an_answer_gives_is_read_as_its_file_is(step, tmp_path):
    (path,) = [path for path in step.save(tmp_path) if path.suffix == ".csv"]
    filed = sb.read_log(path)
    for given in (step.to_dataframe(), step.to_dataset()):
        log = sb.read_log(given)
        assert log.source == type(given).__name__
        for name in ("time", "depth", "volume", "voltage", "reference_depth"):
            assert np.array_equal(getattr(log, name), getattr(filed, name)), name
        assert sb.compare(given, "feup-em").rms == sb.compare(path, "feup-em").rms


def test_units_come_from_attributes_from_names_or_are_stated(step):
    s = step
    bare = pd.DataFrame({"t": s.time / 60.0, "z": 100.0 * s.depth, "v": 1e6 * s.volume})
    columns = {"time_s": "t@min", "depth_m": "z@cm", "volume_m3": "v@cm3"}
    named = bare.set_axis(["Time [min]", "Depth [cm]", "Volume [cm3]"], axis=1)
    stated = dict(zip(columns, named, strict=True))
    labelled = bare.copy()
    labelled.attrs["units"] = {"t": "min", "z": "cm", "v": "cm3"}
    whose = {name: column[0] for name, column in columns.items()}
    for log in (
        sb.read_log(bare, columns=columns),
        sb.read_log(named, columns=stated),
        sb.read_log(labelled, columns=whose),
    ):
        assert log.time == pytest.approx(s.time, abs=1e-9)
        assert log.depth == pytest.approx(s.depth, rel=1e-12)
        assert log.volume == pytest.approx(s.volume, rel=1e-9, abs=1e-15)


def test_an_index_of_several_levels_gives_those_with_a_name():
    levels = [[0.0, 1.0], ["a", "a"]]
    index = pd.MultiIndex.from_arrays(levels, names=["time_s", None])
    assert sb.read_log(pd.DataFrame({"depth_m": [1.0, 2.0]}, index=index)).time.tolist() == [0, 1]
    clock = pd.date_range("2026-03-01", periods=2, freq="s")
    frame = pd.DataFrame({"time": [0.0, 5.0], "depth_m": [1.0, 2.0]}, index=clock)
    frame.attrs["units"] = {"time": "s"}
    assert sb.read_log(frame).time.tolist() == [0.0, 5.0]


def test_a_frame_without_units_is_asked_for_them_by_name(step):
    bare = pd.DataFrame({"time": step.time, "depth": step.depth})
    for columns, name in (({}, "depth_m"), ({"depth_m": "depth@m"}, "time")):
        with pytest.raises(InputError) as caught:
            sb.read_log(bare, columns=columns)
        said = str(caught.value)
        assert said.startswith("DataFrame")
        assert name in said
        assert "unit" in said or '{"depth_m": "depth@m"}' in said


def test_instants_are_seconds_as_columns_and_as_an_index(step):
    clock = pd.Timestamp("2026-03-01T12:00:00Z") + pd.to_timedelta(step.time, unit="s")
    frame = pd.DataFrame({"time": clock, "depth_m": step.depth})
    indexed = frame.set_index("time")
    for given in (frame, indexed, indexed.rename_axis(None)):
        log = sb.read_log(given)
        assert log.time == pytest.approx(step.time, abs=1e-6)
        assert np.array_equal(log.depth, step.depth)


def test_rows_are_chosen_as_in_a_file(step):
    frame = step.to_dataframe().assign(dive=np.where(step.time < 15.0, "a", "b"))
    log = sb.read_log(frame, where={"dive": "b"})
    assert log.time[-1] - log.time[0] == pytest.approx(step.time[-1] - 15.0, abs=0.3)


def test_a_cast_is_a_frame_or_a_profile_of_a_dataset(cast, tmp_path):
    units = {"depth": "m", "temperature": "degC", "salinity": "1"}
    named = cast.rename(columns={"depth": "depth_m", "temperature": "temperature_degC"})
    named.to_csv(tmp_path / "cast.csv", index=False)
    place = {"latitude": 43.0, "longitude": 8.0}
    filed = sb.read_cast(tmp_path / "cast.csv", **place)
    data = xr.Dataset(
        {name: ("depth", cast[name], {"units": units[name]}) for name in units},
    )
    cast.attrs["units"] = units
    for given in (named, cast, data):
        found = sb.read_cast(given, **place)
        assert np.array_equal(found.pressure, filed.pressure)
        assert np.array_equal(found.CT, filed.CT)
    masses = [
        sb.ballast("example-float", [one], max_depth=50.0).to_dict()["added_kg"]
        for one in (cast, named, tmp_path / "cast.csv")
    ]
    assert masses == [masses[0]] * 3


@pytest.mark.parametrize(
    ("given", "more", "said"),
    [
        (xr.Dataset({"a": (("x", "y"), np.zeros((2, 2)))}), {}, "dimensions x, y"),
        (pd.DataFrame(np.zeros((3, 2)), columns=["a", "a"]), {}, "stands there twice"),
        (pd.DataFrame({"time_s": [], "depth_m": []}), {}, "no rows"),
        (LABELLED, {}, "no units by the names"),
        (pd.DataFrame({"1": [0.0], 1: [0.0]}), {}, "stands there twice"),
        (pd.DataFrame({"a": [1.0]}, index=pd.Index([0.0], name="a")), {}, "stands there twice"),
        (pd.DataFrame({"a": [1.0]}), {"log_format": LogFormat(delimiter=";")}, "has no use"),
        (pd.DataFrame({"time_s": [0.0, 1.0], "depth_m": ["x", "y"]}), {}, "number"),
    ],
)
def test_what_is_no_log_is_refused(given, more, said):
    with pytest.raises(InputError, match=said):
        sb.read_log(given, **more)


def test_a_vehicle_is_no_frame():
    with pytest.raises(InputError, match="no Vehicle"):
        sb.analyse(pd.DataFrame({"a": [1.0]}))
