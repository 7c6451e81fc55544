"""Times as loggers write them: units, counters that begin again, ISO 8601, clocks, patterns."""

from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.io.log_format import LogColumn, LogFormat
from swimbladder.io.logs import read_log
from tests.log_files import refused, table, write


def rows(times: list[object], name: str = "t") -> str:
    return f"{name},depth_m\n" + "".join(f"{time},{k}\n" for k, time in enumerate(times))


@pytest.mark.parametrize(
    ("unit", "second"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("min", 1 / 60), ("h", 1 / 3600)]
)
def test_units_of_time(tmp_path: Path, unit: str, second: float) -> None:
    path = write(tmp_path, rows([0.54 * second, 1.041 * second, 3.0 * second]))
    log = read_log(path, columns={"time_s": f"t@{unit}"})
    assert log.time == pytest.approx([0.54, 1.041, 3.0], rel=1e-15)


def test_a_part_of_a_unit_is_divided_so_that_the_nearest_float_comes_out(tmp_path: Path) -> None:
    log = read_log(write(tmp_path, rows([540, 1655, 3111])), columns={"time_s": "t@ms"})
    assert log.time.tolist() == [0.54, 1.655, 3.111]


def test_ticks_have_a_stated_length(tmp_path: Path) -> None:
    path = write(tmp_path, rows([0, 16000, 32000]))
    columns = {"time_s": "t@tick"}
    log = read_log(path, columns=columns, log_format=table(tmp_path, 'tick = "32768 Hz"'))
    assert log.time.tolist() == [0.0, 16000 / 32768, 32000 / 32768]
    log = read_log(path, columns=columns, log_format=table(tmp_path, 'tick = "30.5 us"'))
    assert log.time == pytest.approx([0.0, 0.488, 0.976], rel=1e-14)
    assert refused(path, columns=columns).field == "tick"
    form = LogFormat(tick=1e-3)
    assert "no use" in str(refused(path, columns={"time_s": "t@ms"}, log_format=form))
    assert "no use" in str(refused(path, columns={"time_s": "t@iso"}, log_format=form))


@pytest.mark.parametrize("bits", [16, 24, 32])
def test_a_counter_begins_again(tmp_path: Path, bits: int) -> None:
    full = 2**bits
    true = np.arange(0, 3 * full, full // 7) + full // 2
    path = write(tmp_path, rows([int(count) for count in true % full]))
    columns = {"time_s": "t@us"}
    log = read_log(path, columns=columns, log_format=LogFormat(counter_bits=bits))
    assert log.time == pytest.approx(true * 1e-6, rel=1e-15)
    note = f"the counter of {bits} bits began again 3 times, first on line"
    assert any(note in line for line in log.report)


def test_a_counter_that_is_not_stated_is_recognised_and_refused(tmp_path: Path) -> None:
    path = write(tmp_path, rows([65000, 65500, 464, 964]))
    error = refused(path, columns={"time_s": "t@ms"})
    assert (error.line, error.field, error.value) == (4, "t", 464.0)
    assert "counter_bits = 16" in str(error)
    log = read_log(path, columns={"time_s": "t@ms"}, log_format=LogFormat(counter_bits=16))
    assert log.time.tolist() == [65.0, 65.5, 66.0, 66.5]


def test_a_counter_holds_whole_numbers_below_its_width(tmp_path: Path) -> None:
    form = LogFormat(counter_bits=16)
    for bad in ("65536", "-1", "1.5"):
        error = refused(
            write(tmp_path, rows([1, bad, 3])), columns={"time_s": "t@ms"}, log_format=form
        )
        assert (error.line, error.field) == (3, "t")
    path = write(tmp_path, rows(["2023-01-01T00:00:00", "2023-01-01T00:00:01"]))
    error = refused(path, columns={"time_s": "t@iso"}, log_format=form)
    assert error.field == "counter_bits"


def test_a_small_step_back_is_no_turn_of_the_counter(tmp_path: Path) -> None:
    path = write(tmp_path, rows([1000, 1500, 1400, 2000]))
    error = refused(path, columns={"time_s": "t@ms"}, log_format=LogFormat(counter_bits=16))
    assert (error.line, error.field) == (4, "time_s")


@given(
    start=st.datetimes(datetime(1980, 1, 1), datetime(2090, 1, 1)),
    steps=st.lists(st.integers(1, 10**9), min_size=1, max_size=5),
    hours=st.integers(-12, 14),
    mark=st.sampled_from("T "),
)
def test_iso_times_give_the_seconds_between_them(tmp_path_factory, start, steps, hours, mark):
    zone = timezone(timedelta(hours=hours))
    whole = [start + timedelta(milliseconds=int(total)) for total in np.cumsum([0, *steps])]
    path = tmp_path_factory.getbasetemp() / "iso.csv"
    for texts in (
        [instant.isoformat(mark) for instant in whole],
        [instant.replace(tzinfo=zone).isoformat(mark) for instant in whole],
    ):
        path.write_text(rows(texts), encoding="ascii")
        log = read_log(path, columns={"time_s": "t@iso"})
        # of the year 2090 a float holds the seconds to 0.5 us
        assert log.time == pytest.approx(np.cumsum([0, *steps]) * 1e-3, rel=1e-15, abs=1e-6)


def test_a_column_with_the_date(tmp_path: Path) -> None:
    text = "Day,Clock,depth_m\n2024-02-29,23:59:59.5,1\n2024-03-01,00:00:00.5,2\n,00:00:02,3\n"
    path = write(tmp_path, text)
    with_date = LogColumn(name="Clock", unit="iso", date="Day")
    for columns in ({"time_s": with_date}, {"time_s": "Day+Clock@iso"}):
        log = read_log(path, columns=columns)
        assert log.time.tolist() == [0.0, 1.0]
    form = '[log.columns]\ntime_s = { name = "Clock", date = "Day", unit = "iso" }'
    assert len(read_log(path, log_format=table(tmp_path, form))) == 2
    for wrong in (
        LogColumn(name="Clock", unit="iso", date="Date"),
        LogColumn(name="depth_m", unit="s", date="Day"),
    ):
        assert refused(path, columns={"time_s": wrong}).field == "time_s"
    bad = write(tmp_path, "Day,Clock,depth_m\n2024-02-30,23:59:59,1\n2024-03-01,0:0:0,2\n")
    error = refused(bad, columns={"time_s": with_date})
    assert (error.line, error.value) == (2, "2024-02-30 23:59:59")


def test_times_of_the_day_go_on_over_midnight(tmp_path: Path) -> None:
    text = "t;depth_m\n23:59:58;0\n23:59:59,5;1\n;2\n00:00:01.25;3\n"
    path = write(tmp_path, text)
    log = read_log(path, columns={"time_s": "t@clock"})
    assert log.time.tolist() == [0.0, 1.5, 3.25]
    assert read_log(path, columns={"time_s": "t"}).time.tolist() == [0.0, 1.5, 3.25]
    assert "time_s read from 't' as times of the day, in seconds from the first" in log.report
    error = refused(write(tmp_path, rows(["10:00:00", "10:60:00"])), columns={"time_s": "t@clock"})
    assert (error.line, error.value) == (3, "10:60:00")


@pytest.mark.parametrize("text", ["14.04.2023 10:31:05", "04/14/2023 10:31", "1-2-23 10:00:00"])
def test_dates_that_can_be_read_in_two_ways_are_refused(tmp_path: Path, text: str) -> None:
    path = write(tmp_path, rows([text, text]))
    for columns in ({"time_s": "t@iso"}, {"time_s": "t"}):
        error = refused(path, columns=columns)
        assert (error.line, error.field, error.value) == (2, "t", text)
        assert "%d.%m.%Y" in str(error)


def test_a_stated_pattern_says_which_is_day_and_which_is_month(tmp_path: Path) -> None:
    path = write(tmp_path, rows(["31.01.2024 23:59:59", "01.02.2024 00:00:01"]))
    assert read_log(path, columns={"time_s": "t@%d.%m.%Y %H:%M:%S"}).time.tolist() == [0.0, 2.0]
    error = refused(path, columns={"time_s": "t@%m.%d.%Y %H:%M:%S"})
    assert (error.line, error.value) == (2, "31.01.2024 23:59:59")
    two = write(tmp_path, "day;t;depth_m\n31/01/24;23h59;0\n01/02/24;00h01;1\n")
    log = read_log(two, columns={"time_s": "day+t@%d/%m/%y %Hh%M"})
    assert log.time.tolist() == [0.0, 120.0]


def test_a_pattern_without_a_date_goes_on_over_midnight(tmp_path: Path) -> None:
    path = write(tmp_path, rows(["23h59", "00h01"]))
    assert read_log(path, columns={"time_s": "t@%Hh%M"}).time.tolist() == [0.0, 120.0]


@pytest.mark.parametrize("pattern", ["%d.%m %H:%M", "%Q", "%Y%", "%a %Y-%m-%d", "%Y-%-m"])
def test_a_pattern_that_is_none_is_refused(tmp_path: Path, pattern: str) -> None:
    error = refused(write(tmp_path, rows(["1", "2"])), columns={"time_s": f"t@{pattern}"})
    assert (error.field, error.value) == ("time_s", pattern)


def test_zones_in_part_of_a_log_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path, rows(["2023-01-01T00:00:00Z", "2023-01-01T00:00:01"]))
    error = refused(path, columns={"time_s": "t@iso"})
    assert (error.field, error.value) == ("t", "2023-01-01T00:00:01")


def test_only_a_time_is_read_as_a_time(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,z\n0,2023-01-01\n1,2023-01-02\n")
    for unit in ("iso", "clock", "tick"):
        assert refused(path, columns={"depth_m": f"z@{unit}"}).field in ("depth_m", "z")


def test_an_unknown_unit_of_time_names_the_other_ways(tmp_path: Path) -> None:
    error = refused(write(tmp_path, rows([1, 2])), columns={"time_s": "t@ticks"})
    assert error.unit == "s"
    assert "iso, clock" in str(error)


def test_repeats_say_whether_they_are_the_same(tmp_path: Path) -> None:
    same = write(tmp_path, "time_s,depth_m\n0,1\n0,1\n1,2\n1,2\n2,3\n")
    assert "2 rows with the time of the row before dropped" in read_log(same).report
    coarse = write(tmp_path, "time_s,depth_m\n0,1\n0,2\n1,2\n1,2\n2,3\n")
    note = "2 rows with the time of the row before dropped, 1 of them with other values"
    assert note in read_log(coarse).report
