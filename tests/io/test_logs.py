"""Logs as people have them: read as meant, or refused with the place and the remedy."""

import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from swimbladder.errors import InputError, LogError
from swimbladder.io.log_format import COLUMNS, LogColumns, LogFormat, log_format
from swimbladder.io.log_formats import FORMATS
from swimbladder.io.logs import read_log
from tests.log_files import refused, write

PLAIN = "time_s,depth_m,volume_m3\n0,1.0,1e-5\n0.5,1.25,2e-5\n1.0,1.5,-3e-5\n"


def test_the_plain_format(tmp_path: Path) -> None:
    log = read_log(write(tmp_path, PLAIN))
    assert log.time.tolist() == [0.0, 0.5, 1.0]
    assert log.depth.tolist() == [1.0, 1.25, 1.5]
    assert log.volume is not None
    assert log.volume.tolist() == [1e-5, 2e-5, -3e-5]
    assert log.line.tolist() == [2, 3, 4]
    assert log.piston is None
    assert log.voltage is None
    assert not log.volume_absolute
    assert log.report == ()
    assert len(log) == 3


def test_a_bench_without_depth_is_read_where_it_is_not_required(tmp_path: Path) -> None:
    text = "time_s,piston_m,reference_piston_m,reference_volume_m3\n0,1,2,3\n1,2,2,3\n2,,2,3\n"
    path = write(tmp_path, text)
    assert refused(path).field == "depth_m"
    form = LogFormat(piston_positive="in", piston_zero=0.5, volume_zero=1.0)
    log = read_log(path, required=("piston_m",), log_format=form)
    assert log.piston is not None
    assert log.reference_piston is not None
    assert log.reference_volume is not None
    assert log.piston.tolist() == [-0.5, -1.5]
    assert log.reference_piston.tolist() == [-1.5, -1.5]
    assert log.reference_volume.tolist() == [2.0, 2.0]
    assert np.isnan(log.depth).all()
    assert len(log.depth) == 2
    assert "1 of 3 rows without time or piston dropped" in log.report
    assert refused(path, required=("voltage_V",)).field == "voltage_V"
    assert refused(path, required=("volts",)).field == "volts"


def test_depth_that_is_not_required_may_have_holes(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,depth_m,voltage_V\n0,1,1\n1,,2\n2,3,3\n3,4,\n")
    log = read_log(path, required=("time_s", "voltage_V"))
    assert log.time.tolist() == [0.0, 1.0, 2.0]
    assert np.isnan(log.depth).tolist() == [False, True, False]


def test_a_part_of_a_log_has_a_part_of_every_array(tmp_path: Path) -> None:
    text = "time_s,depth_m,reference_piston_m\n0,1,5\n1,2,6\n2,3,7\n"
    part = read_log(write(tmp_path, text)).only(np.array([True, False, True]))
    assert part.time.tolist() == [0.0, 2.0]
    assert part.reference_piston is not None
    assert part.reference_piston.tolist() == [5.0, 7.0]
    assert part.line.tolist() == [2, 4]
    assert part.volume is None


@pytest.mark.parametrize(
    "data",
    [
        gzip.compress(PLAIN.encode(), mtime=0),
        b"\xef\xbb\xbf" + PLAIN.encode(),
        PLAIN.encode("utf-16"),
        PLAIN.replace("\n", "\r\n").encode(),
        PLAIN.replace("\n", "\r").encode(),
        PLAIN.replace("\n", "\n\n").encode(),
        b"# a remark, with a comma\n" + PLAIN.encode(),
        PLAIN.replace(",", " , ").encode(),
        PLAIN.replace("time_s", '"time_s"').encode(),
    ],
    ids=["gzip", "bom", "utf-16", "crlf", "cr", "blank lines", "comment", "spaces", "quotes"],
)
def test_dresses_of_the_same_log(tmp_path: Path, data: bytes) -> None:
    log = read_log(write(tmp_path, data))
    assert log.depth.tolist() == [1.0, 1.25, 1.5]
    assert log.volume is not None
    assert log.volume.tolist() == [1e-5, 2e-5, -3e-5]


def test_other_names_and_units_are_mapped_and_reported(tmp_path: Path) -> None:
    text = "t,Depth [cm],Bladder,U (mV)\n0,100,350,1500\n500,125,-350,0\n"
    log = read_log(
        write(tmp_path, text),
        columns={
            "time_s": "t@ms",
            "depth_m": "Depth [cm]",
            "volume_m3": "Bladder@mL",
            "voltage_V": "U (mV)",
        },
    )
    assert log.time == pytest.approx([0.0, 0.5], rel=1e-15)
    assert log.depth == pytest.approx([1.0, 1.25], rel=1e-15)
    assert log.volume == pytest.approx([3.5e-4, -3.5e-4], rel=1e-15)
    assert log.voltage == pytest.approx([1.5, 0.0], rel=1e-15)
    assert any("'Depth [cm]'" in note and "0.01" in note for note in log.report)


def test_a_column_without_a_unit_is_said_to_be_taken_as_si(tmp_path: Path) -> None:
    log = read_log(write(tmp_path, "t,z\n0,1\n1,2\n"), columns={"time_s": "t", "depth_m": "z"})
    assert "depth_m read from 'z', taken to be in m" in log.report


def test_semicolons_and_decimal_commas(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s;depth_m\n0,000;1,250\n0,500;1,500\n")  # or thousands
    error = refused(path)
    assert (error.line, error.field, error.value) == (2, "time_s", "0,000")
    assert 'decimal = ","' in str(error)
    log = read_log(path, log_format=LogFormat(decimal=","))
    assert log.depth.tolist() == [1.25, 1.5]
    path = write(tmp_path, "time_s;depth_m\n0,0;1,25\n0,5;1,5\n")
    log = read_log(path)
    assert log.depth.tolist() == [1.25, 1.5]
    assert "the numbers have decimal commas" in log.report
    log = read_log(path, log_format=LogFormat(decimal=","))
    assert log.depth.tolist() == [1.25, 1.5]
    assert any("';'" in note for note in log.report)
    with pytest.raises(LogError, match=r"1\.25"):
        read_log(write(tmp_path, "time_s;depth_m\n0;1.25\n"), log_format=LogFormat(decimal=","))


def test_iso_times_are_taken_for_what_they_are(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        "when,depth_m\n2023-04-14T23:59:59.5Z,1\n2023-04-15T00:00:00Z,2\n"
        "2023-04-15T02:00:01+02:00,3\n",
    )
    for column in ("when", "when@iso"):
        assert read_log(path, columns={"time_s": column}).time.tolist() == [0.0, 0.5, 1.5]
    bad = write(tmp_path, "when,depth_m\n2023-04-14T23:59:59,1\nnoon,2\n")
    error = refused(bad, columns={"time_s": "when@iso"})
    assert (error.line, error.value) == (3, "noon")


def test_rows_are_chosen(tmp_path: Path) -> None:
    path = write(tmp_path, "log,run,time_s,depth_m\n1,a,0,1\n1,a,1,2\n2,a,0,3\n2,b,1,4\n2,a,2,5\n")
    log = read_log(path, where={"log": 2, "run": "a"})
    assert log.depth.tolist() == [3.0, 5.0]
    assert log.line.tolist() == [4, 6]
    assert "2 of 5 rows chosen" in log.report
    assert "log=2" in log.source
    assert read_log(path, where={"log": "1.0"}).depth.tolist() == [1.0, 2.0]
    error = refused(path, where={"log": 3})
    assert "1, 2" in str(error)
    assert "time_s" in str(refused(path, where={"dive": 3}))
    assert "`where=" in str(refused(path))


def test_rows_without_numbers_and_repeated_rows_are_dropped_and_said(tmp_path: Path) -> None:
    text = (
        "time_s,depth_m,voltage_V\n0,1,5\n0,1,5\n1,,5\n2,nan,5\n3,4,\n,5,5\n4,5,6\n5,inf,6\n6,7,1\n"
        "7,8,1\n8,9,1\n"
    )
    log = read_log(write(tmp_path, text))
    assert log.time.tolist() == [0.0, 3.0, 4.0, 6.0, 7.0, 8.0]
    assert log.line.tolist() == [2, 6, 8, 10, 11, 12]
    assert log.voltage is not None
    assert math.isnan(log.voltage[1])
    assert "4 of 11 rows without time or depth dropped" in log.report
    assert "1 row with the time of the row before dropped" in log.report


def test_a_log_that_is_mostly_holes_is_refused(tmp_path: Path) -> None:
    error = refused(write(tmp_path, "time_s,depth_m\n0,1\n1,\n2,\n3,4\n4,\n"))
    assert error.line == 3


def test_disorder_is_refused_unless_sorting_is_asked_for(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,depth_m\n0,1\n2,3\n1,2\n")
    error = refused(path)
    assert (error.line, error.field, error.value) == (4, "time_s", 1.0)
    assert 'rows = "sort"' in str(error)
    log = read_log(path, log_format=LogFormat(rows="sort"))
    assert log.depth.tolist() == [1.0, 2.0, 3.0]
    assert log.line.tolist() == [2, 4, 3]
    assert any("sorted" in note for note in log.report)


@pytest.mark.parametrize(
    ("text", "field", "line"),
    [
        ("", "header", None),
        ("\n \n", "header", None),
        ("time_s,depth_m\n", "rows", None),
        ("time_s,depth_m\n0,1\n", "rows", None),
        ("time_s\n0\n", "depth_m", None),
        ("depth_m\n0\n", "time_s", None),
        ("time_s,depth_m,depth_m\n0,1,2\n", "depth_m", None),
        ("time_s,depth_m\n0,1\n1,deep\n", "depth_m", 3),
        ("time_s,depth_m\n0,1\n1,1_0\n", "depth_m", 3),
        ("time_s,depth_m\n0,5,1,5\n1,0,2,5\n", "row", 2),
        (b"time_s,depth_m\n0,\xff\n", "depth_m", 2),
        (b"\x1f\x8b\x08garbage", "file", None),
        (gzip.compress(PLAIN.encode(), mtime=0)[:-9], "file", None),
    ],
)
def test_what_cannot_be_read_is_refused(
    tmp_path: Path, text: str | bytes, field: str, line: int | None
) -> None:
    error = refused(write(tmp_path, text))
    assert (error.field, error.line) == (field, line)
    assert error.remedy


def test_no_file_and_a_folder(tmp_path: Path) -> None:
    refused(tmp_path / "missing.csv")
    refused(tmp_path)


def test_a_torn_last_row_is_dropped_and_said(tmp_path: Path) -> None:
    rows = "".join(f"{k},1\n" for k in range(40))
    log = read_log(write(tmp_path, f"time_s,depth_m\n{rows}40"))
    assert len(log) == 40
    assert any("line 42" in note for note in log.report)


def test_wrong_units_and_unknown_columns_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,Depth [bar]\n0,1\n1,2\n")
    error = refused(path, columns={"depth_m": "Depth [bar]"})
    assert (error.field, error.value, error.unit) == ("depth_m", "Depth [bar]", "m")
    assert refused(path, columns={"depth_m": "Depth"}).value == "Depth"
    assert refused(path, columns={"depth": "Depth [bar]"}).field == "depth"


def test_the_log_table(tmp_path: Path) -> None:
    table = write(
        tmp_path,
        """
        [log]
        delimiter = ";"
        decimal = ","
        volume_zero = "12 cm3"
        piston_zero = "25 mm"
        piston_positive = "in"
        [log.columns]
        time_s = { name = "t", unit = "min" }
        depth_m = "Z [cm]"
        volume_m3 = { name = "v", unit = "cm3" }
        piston_m = "x@mm"
        [log.where]
        dive = 2
        """,
        "log.toml",
    )
    path = write(tmp_path, "dive;t;Z [cm];v;x\n1;0;0;0;0\n2;0,5;100;12,5;30\n2;1;110;11;20\n")
    log = read_log(path, log_format=table)
    assert log.time == pytest.approx([30.0, 60.0])
    assert log.depth == pytest.approx([1.0, 1.1])
    assert log.volume == pytest.approx([0.5e-6, -1e-6])
    assert log.piston == pytest.approx([-0.005, 0.005])
    assert log.volume_absolute
    assert log.piston_absolute


@pytest.mark.parametrize(
    ("line", "place"),
    [
        ('decimals = ","', "log.decimals"),
        ('decimal = ";"', "log.decimal"),
        ('volume_zero = "12 mm"', "log.volume_zero"),
        ('columns = { deep = "z" }', "log.columns.deep"),
        ('columns = { depth_m = { nam = "z" } }', "log.columns.depth_m.nam"),
    ],
)
def test_a_wrong_log_table_is_refused_with_its_line(tmp_path: Path, line: str, place: str) -> None:
    table = write(tmp_path, f"[log]\n{line}\n", "log.toml")
    with pytest.raises(InputError) as caught:
        log_format(table)
    assert (caught.value.file, caught.value.field, caught.value.line) == (table, place, 2)
    assert caught.value.remedy


def test_every_column_has_a_unit_and_can_be_mapped() -> None:
    assert list(LogColumns.model_fields) == list(COLUMNS)


def test_shipped_formats_load_and_an_unknown_name_is_refused() -> None:
    assert "ntnu-bv" in FORMATS.names()
    for name in FORMATS.names():
        assert {"time_s", "depth_m"} <= set(log_format(name).columns.mapped())
    with pytest.raises(InputError, match="Did you mean ntnu-bv"):
        log_format("ntnu-bw")


@pytest.mark.data
def test_a_mission_of_a_real_float(data_dir: Path) -> None:
    path = data_dir / "ntnu_bv" / "missions.csv.gz"
    log = read_log(path, log_format="ntnu-bv", where={"log": 47})
    assert len(log) == 717
    assert log.time[-1] - log.time[0] == pytest.approx(358.183)
    assert log.piston is not None
    assert log.piston[0] == pytest.approx(0.02575)
    assert log.piston.min() == pytest.approx(0.02575 - 0.030454)
    assert log.depth.max() == pytest.approx(1.385799)
    assert log.reference_depth is not None
    assert set(log.reference_depth) == {0.5, 1.35}
    assert "`where=" in str(refused(path, log_format="ntnu-bv"))
    assert "`where=" in str(refused(path))
    known = read_log(path, where={"log": 47})
    assert np.array_equal(known.depth, log.depth)


def test_a_shipped_format_is_known_by_its_columns(tmp_path: Path) -> None:
    header = "t_s,depth_raw_m,piston_position_m,target_depth_m"
    rows = [f"{0.5 * n},{1.0 + 0.01 * n},{0.02 + 0.0001 * n},1.35" for n in range(40)]
    path = tmp_path / "mission.csv"
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    known, named = read_log(path), read_log(path, log_format="ntnu-bv")
    assert np.array_equal(known.depth, named.depth)
    assert known.piston is not None
    assert named.piston is not None
    assert np.array_equal(known.piston, named.piston)
    assert known.report == (
        "its columns are those of the log format ntnu-bv, and read so",
        *named.report,
    )


def test_columns_that_say_what_they_are_are_taken_and_the_others_proposed(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(
        "run,time [s],depth [cm],volume [mL],voltage_V,Speed 1,Speed 2\n"
        "1,0,2,3,4,5,6\n1,1,2,3,4,5,6\n"
    )
    log = read_log(path)
    assert log.depth.tolist() == [0.02, 0.02]
    assert log.volume.tolist() == pytest.approx([3e-6, 3e-6])
    assert log.speed is None  # two may be the speed
    path.write_text("t,z\n1,0\n")
    with pytest.raises(LogError, match=r'Perhaps `columns=\{"depth_m": "z@m"\}`'):
        read_log(path)


def test_times_that_are_all_the_same_are_named(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time_s,depth_m\n5,1\n5,2\n5,3\n")
    with pytest.raises(LogError, match=r"1 usable sample of 3 are too few; .*dropped"):
        read_log(path)
