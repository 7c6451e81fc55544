"""Logs in Parquet: the same numbers as from CSV, damage and what is missing refused."""

import contextlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.errors import InputError
from swimbladder.io.log_format import LogFormat
from swimbladder.io.logs import header_names, read_log
from tests.log_files import refused, write

FRAME = pd.DataFrame(
    {
        "run": ["a", "a", "b", "b", "b"],
        "t": np.array([0, 500, 0, 500, 1000], dtype="int32"),
        "when": pd.to_datetime(
            ["2024-05-01 10:00:00.25", "2024-05-01 10:00:01", None, None, "2024-05-02"],
            format="ISO8601",
        ),
        "z [cm]": np.array([100.0, 110.0, 120.0, np.nan, 150.0], dtype="float32"),
        "text": ["1", "2,5", "n/a", None, "x"],
        "on": [True, False, True, False, True],
        "took": pd.to_timedelta([0, 1500, 3000, 4500, 6000], unit="ms"),
    }
)
COLUMNS = {"time_s": "t@ms", "depth_m": "z [cm]"}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    FRAME.to_parquet(tmp_path / "log.parquet", engine="pyarrow")
    return tmp_path / "log.parquet"


def test_the_numbers_are_those_of_the_csv(path: Path, tmp_path: Path) -> None:
    FRAME.to_csv(tmp_path / "log.csv", index=False)
    where = {"run": "b"}
    log = read_log(path, columns=COLUMNS, where=where)
    same = read_log(tmp_path / "log.csv", columns=COLUMNS, where=where)
    assert log.time.tolist() == same.time.tolist() == [0.0, 1.0]
    assert log.depth == pytest.approx(same.depth, rel=1e-7)
    assert log.line.tolist() == [3, 5]
    assert log.report == same.report
    on = read_log(path, columns={"time_s": "took", "depth_m": "z [cm]"}, where={"on": 1})
    assert on.depth == pytest.approx([1.0, 1.2, 1.5])
    assert header_names(path) == list(FRAME.columns)


def test_instants_durations_and_texts(path: Path) -> None:
    log = read_log(path, columns={"time_s": "when@iso", "depth_m": "z [cm]"}, where={"run": "a"})
    assert log.time.tolist() == [0.0, 0.75]
    log = read_log(path, columns={"time_s": "took", "depth_m": "z [cm]"})
    assert log.time.tolist() == [0.0, 1.5, 3.0, 6.0]
    log = read_log(path, columns={"time_s": "when", "depth_m": "z [cm]"}, where={"run": "a"})
    assert log.time.tolist() == [0.0, 0.75]
    log = read_log(path, columns={**COLUMNS, "voltage_V": "text"}, where={"run": "a"})
    assert log.voltage.tolist() == [1.0, 2.5]
    log = read_log(
        path,
        columns={**COLUMNS, "voltage_V": "text"},
        where={"run": "a"},
        log_format=LogFormat(decimal=","),
    )
    assert log.voltage is not None
    assert log.voltage.tolist() == [1.0, 2.5]


def test_missing_numbers_and_counters(tmp_path: Path) -> None:
    frame = pd.DataFrame({"t": [65000, 464, 900], "depth_m": [1.0, -999.0, 3.0]})
    frame.to_parquet(tmp_path / "log", engine="pyarrow")  # its bytes tell, not its name
    form = LogFormat(counter_bits=16, missing=("-999",))
    log = read_log(tmp_path / "log", columns={"time_s": "t@ms"}, log_format=form)
    assert log.time == pytest.approx([65.0, 66.436])
    assert log.depth.tolist() == [1.0, 3.0]


def test_what_is_for_texts_is_refused(path: Path) -> None:
    error = refused(path, columns=COLUMNS, log_format=LogFormat(delimiter=";"))
    assert (error.field, error.value) == ("delimiter", ";")
    assert refused(path, columns=COLUMNS, log_format=LogFormat(names=("a",))).field == "names"


def test_damage_is_refused(path: Path, tmp_path: Path) -> None:
    data = path.read_bytes()
    for broken in (b"", b"time_s,depth_m\n0,1\n", data[:-1], b"PAR1PAR1", data[:90] + data[200:]):
        file = write(tmp_path, broken, "broken.parquet")
        assert refused(file, columns=COLUMNS).field == "file"


@given(
    at=st.integers(0, 3000), cut=st.integers(0, 40), by=st.binary(max_size=20), end=st.booleans()
)
def test_mutated_files_are_read_or_refused(tmp_path_factory, at, cut, by, end) -> None:
    base = tmp_path_factory.getbasetemp()
    if not (base / "whole.parquet").exists():
        FRAME.to_parquet(base / "whole.parquet", engine="pyarrow")
    data = (base / "whole.parquet").read_bytes()
    mutated = data[:at] + by + data[at + cut :] + (b"PAR1" if end else b"")
    (base / "mutated.parquet").write_bytes(mutated)
    with contextlib.suppress(InputError):
        read_log(base / "mutated.parquet", columns=COLUMNS, where={"run": "a"})


@pytest.mark.data
def test_a_motor_bench_without_depth(data_dir: Path) -> None:
    log = read_log(
        data_dir / "ufloat_motor" / "cycles.parquet",
        columns={"time_s": "t_s", "piston_m": "position_in@in"},
        where={"log": "2017-02-22_224003"},
        required=("piston_m",),
    )
    assert len(log) == 7567
    assert log.piston is not None
    # as summary.csv beside it has them, in inches
    assert log.time[-1] - log.time[0] == pytest.approx(151.343931, abs=1e-4)
    assert log.piston.min() / 0.0254 == pytest.approx(-0.001225, abs=1e-6)
    assert log.piston.max() / 0.0254 == pytest.approx(0.620711, abs=1e-6)
    assert np.isnan(log.depth).all()
