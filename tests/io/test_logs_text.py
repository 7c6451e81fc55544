"""The text of a log: encodings, line ends, preambles, headers, units, quotes, damage."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from swimbladder.io import log_rows, log_text
from swimbladder.io.log_format import LogFormat
from swimbladder.io.logs import header_names, read_log
from tests.log_files import refused, table, write

ROWS = "0,1.0\n0.5,1.25\n1.0,1.5\n"
PLAIN = "time_s,depth_m\n" + ROWS
DEPTHS = [1.0, 1.25, 1.5]


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-32", "utf-8-sig", "utf-16"])
def test_encodings_with_a_mark_or_with_every_other_byte_0(tmp_path: Path, encoding: str) -> None:
    log = read_log(write(tmp_path, PLAIN.encode(encoding)))
    assert log.depth.tolist() == DEPTHS
    assert any("without a byte order mark" in note for note in log.report) == (
        encoding in ("utf-16-le", "utf-16-be")
    )


def test_latin_1_is_a_fallback_that_is_reported(tmp_path: Path) -> None:
    text = "time_s;T [°C];Tiefe [cm]\n0;8;100\n1;8;110\n"
    path = write(tmp_path, text.encode("latin-1"))
    log = read_log(path, columns={"depth_m": "Tiefe [cm]"})
    assert log.depth.tolist() == [1.0, 1.1]
    assert "read as Latin-1, being not UTF-8 on line 1; [log] encoding overrules" in log.report
    assert "columns not used: T [°C]" in log.report


def test_a_few_damaged_bytes_make_no_other_encoding(tmp_path: Path) -> None:
    rows = "".join(f"{k};{k};8 °C\n" for k in range(30))
    data = f"time_s;Tiefe [m];T\n{rows}".encode()
    at = data.index(b"17;17")
    path = write(tmp_path, data[:at] + b"\xff" + data[at + 1 :])
    log = read_log(path, columns={"depth_m": "Tiefe [m]"})
    assert len(log) == 29
    assert "1 byte damaged, not UTF-8, first on line 19" in log.report
    assert "1 row with characters that are no text dropped, the first on line 19" in log.report


def test_a_stated_encoding_is_held_to(tmp_path: Path) -> None:
    text = "time_s,Tiefe – Sensor\n0,1\n1,2\n"
    path = write(tmp_path, text.encode("cp1252"))
    columns = {"depth_m": "Tiefe – Sensor@m"}
    log = read_log(path, columns=columns, log_format=table(tmp_path, 'encoding = "cp1252"'))
    assert log.depth.tolist() == [1.0, 2.0]
    assert log.report == ("depth_m read from 'Tiefe – Sensor', in m",)
    error = refused(path, columns=columns, log_format=table(tmp_path, 'encoding = "utf-8"'))
    assert (error.field, "utf-8, at byte 13" in str(error)) == ("file", True)


@pytest.mark.parametrize(
    ("start", "word"),
    [
        (b"PK\x03\x04", "spreadsheet"),
        (b"\xd0\xcf\x11\xe0", "spreadsheet"),
        (b"\x89HDF\r\n", "netCDF"),
        (b"CDF\x01", "netCDF"),
        (b"MATLAB 5.0", "MATLAB"),
        (b"%PDF-1", "PDF"),
        (b"BZh9", "bzip2"),
        (b"\xfd7zXZ", "xz"),
        (b"\x28\xb5\x2f\xfd", "zstd"),
    ],
)
def test_what_is_no_text_is_named(tmp_path: Path, start: bytes, word: str) -> None:
    assert word in str(refused(write(tmp_path, start + PLAIN.encode())))


def test_a_file_beyond_the_limit_is_refused_compressed_too(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(log_text, "MOST_BYTES", 1000)
    whole = PLAIN + "".join(f"{k},1\n" for k in range(2, 300))
    assert "larger" in str(refused(write(tmp_path, whole)))
    packed = gzip.compress(whole.encode(), mtime=0)
    assert len(packed) < 1000
    assert "larger" in str(refused(write(tmp_path, packed)))


def test_mixed_line_ends_and_a_terminating_nul_beside_each(tmp_path: Path) -> None:
    log = read_log(write(tmp_path, b"time_s,depth_m\r\n0,1.0\r0.5,1.25\n1.0,1.5"))
    assert log.depth.tolist() == DEPTHS
    assert log.line.tolist() == [2, 3, 4]
    for data in (PLAIN.replace("\n", "\n\0"), PLAIN.replace("\n", "\0\n")):
        log = read_log(write(tmp_path, data))
        assert log.depth.tolist() == DEPTHS
        assert "4 NULs beside line ends left out" in log.report


def test_rows_with_bytes_that_are_no_text_are_dropped_and_said(tmp_path: Path) -> None:
    rows = [f"{k},{k}" for k in range(40)]
    rows[20], rows[30] = "20,2\0\0\x003", "\x13\x01\u00b730,30"
    text = "\n".join(["time_s,depth_m", *rows, "\0" * 500, ""])
    log = read_log(write(tmp_path, text.encode("latin-1")))
    assert len(log) == 38
    assert log.line.tolist() == [*range(2, 22), *range(23, 32), *range(33, 42)]
    assert "2 rows with characters that are no text dropped, the first on line 22" in log.report
    assert "1 line of control characters left out" in log.report


def test_a_log_of_junk_is_refused(tmp_path: Path) -> None:
    rows = "".join(f"{k},\x01{k}\n" for k in range(20))
    error = refused(write(tmp_path, "time_s,depth_m\n" + rows))
    assert (error.field, error.line) == ("row", 2)
    assert "20 of 20 rows" in str(error)


@pytest.mark.parametrize(
    ("tail", "kept", "said"),
    [
        ("40,1.0", 41, None),  # whole, only without a line end
        ("40,1.", 40, "cut short"),  # shorter than every field before it
        ("40", 40, "cut short"),
        ("40,1.0\0\0\0\0", 40, "no text"),
    ],
)
def test_the_last_row_of_a_logger_that_lost_power(
    tmp_path: Path, tail: str, kept: int, said: str | None
) -> None:
    rows = "".join(f"{k},1.0\n" for k in range(40))
    log = read_log(write(tmp_path, f"time_s,depth_m\n{rows}{tail}"))
    assert len(log) == kept
    assert [said in note and "line 42" in note for note in log.report] == [True] * (
        said is not None
    )


def test_a_short_log_may_lose_its_last_row_too(tmp_path: Path) -> None:
    assert len(read_log(write(tmp_path, "time_s,depth_m\n0,1\n1,2\n2"))) == 2


PREAMBLE = "Logger 12; serial no. 4711\nPool, 4.5 m\n\n# calibrated, 2023\n"


def test_lines_above_the_names_are_left_out_and_reported(tmp_path: Path) -> None:
    log = read_log(write(tmp_path, PREAMBLE + PLAIN))
    assert log.depth.tolist() == DEPTHS
    assert log.line.tolist() == [6, 7, 8]
    first = "'Logger 12; serial no. 4711'"
    assert log.report == (
        f"2 lines above the names left out, the first: {first}",
        "1 remark above the names left out",
    )


def test_the_names_that_are_mapped_find_their_line(tmp_path: Path) -> None:
    text = "Time,Notes\nsee below,Depth [cm]\nTime,Depth [cm]\n0,100\n1,110\n"
    log = read_log(write(tmp_path, text), columns={"time_s": "Time@s", "depth_m": "Depth [cm]"})
    assert log.depth.tolist() == [1.0, 1.1]
    assert log.line.tolist() == [4, 5]


def test_the_likely_header_is_named_where_none_fits(tmp_path: Path) -> None:
    path = write(tmp_path, PREAMBLE + "t,z,U\n0,1,2\n1,2,2\n")
    assert "columns of the file: t, z, U" in str(refused(path))
    assert header_names(path) == ["t", "z", "U"]
    error = refused(path, columns={"time_s": "t", "depth_m": "zz"})
    assert "Did you mean z?" in str(refused(path, columns={"time_s": "t", "depth_m": "Z"}))
    assert error.value == "zz"


def test_a_remark_may_hold_the_names(tmp_path: Path) -> None:
    log = read_log(write(tmp_path, "# made by a script\n# time_s depth_m\n0 1\n1 2\n"))
    assert log.depth.tolist() == [1.0, 2.0]
    assert log.report == (
        "fields are separated by blanks, as in the header",
        "1 remark above the names left out",
        "the names are those of the remark on line 2",
    )


def test_remarks_begin_as_the_format_says(tmp_path: Path) -> None:
    text = "% a remark\ntime_s,depth_m\n0,1\n% dive begins\n1,2\n"
    log = read_log(write(tmp_path, text), log_format=table(tmp_path, 'comment = "%"'))
    assert log.depth.tolist() == [1.0, 2.0]
    assert "1 remark, after '%', left out" in log.report


def test_the_header_is_told_from_its_start_within_a_line(tmp_path: Path) -> None:
    text = "settings: 1,2,3\r\x13\x01\xb7Time[ms],z\r0,1\r500,2\r"
    path = write(tmp_path, text.encode("latin-1"))
    form = table(tmp_path, 'header_starts = "Time[ms]"\ncolumns = { time_s = "Time[ms]" }')
    log = read_log(path, columns={"depth_m": "z"}, log_format=form)
    assert log.time.tolist() == [0.0, 0.5]
    assert "3 characters before the names on line 2 left out" in log.report
    assert "1 line above the names left out, the first: 'settings: 1,2,3'" in log.report
    form = table(tmp_path, 'header_starts = "Zeit"')
    assert refused(path, log_format=form).field == "header_starts"


def test_a_file_without_names(tmp_path: Path) -> None:
    path = write(tmp_path, "boot ok\n0;100;1,5\n500;110;1,5\n")
    lines = 'names = ["t", "z", "u"]\nskip_lines = 1\ndecimal = ","\n[log.columns]\n'
    lines += 'time_s = { name = "t", unit = "ms" }\ndepth_m = { name = "z", unit = "cm" }'
    log = read_log(path, log_format=table(tmp_path, lines))
    assert log.time.tolist() == [0.0, 0.5]
    assert log.depth.tolist() == [1.0, 1.1]
    assert log.line.tolist() == [2, 3]
    assert "the first 1 line left out" in log.report
    assert log.report[1] == "fields are separated by ';', as in the header"


def test_blanks_and_tabs_between_fields(tmp_path: Path) -> None:
    for text in ("time_s  depth_m\n 0\t 1.0\n0.5   1.25 \n1.0 1.5\n", PLAIN.replace(",", "\t")):
        assert read_log(write(tmp_path, text)).depth.tolist() == DEPTHS
    form = table(tmp_path, 'delimiter = " "')
    text = '"time_s" "Depth of it"\n0 1.0\n0.5 1.25\n1.0 1.5\n'
    log = read_log(write(tmp_path, text), columns={"depth_m": "Depth of it"}, log_format=form)
    assert log.depth.tolist() == DEPTHS


def test_quoted_decimal_commas_between_commas(tmp_path: Path) -> None:
    path = write(tmp_path, 'time_s,depth_m\n"0,5","1,25"\n"1,0","1,5"\n')
    assert refused(path, log_format=LogFormat(decimal=",")).field == "decimal"
    log = read_log(path, log_format=LogFormat(decimal=",", delimiter=","))
    assert log.time.tolist() == [0.5, 1.0]
    assert log.depth.tolist() == [1.25, 1.5]


def test_a_quoted_field_may_go_on_below_and_a_stray_quote_swallows_nothing(tmp_path: Path) -> None:
    text = 'time_s,depth_m,note\n0,1,"two\nlines, "\n1,2,x\n2,3,5"\n3,4,y\n'
    log = read_log(write(tmp_path, text))
    assert log.depth.tolist() == [1.0, 2.0, 3.0, 4.0]
    assert log.line.tolist() == [3, 4, 5, 6]


def test_a_delimiter_at_the_end_of_rows_or_of_the_header(tmp_path: Path) -> None:
    for text in (PLAIN.replace("\n", ",\n").replace("m,", "m", 1), PLAIN.replace("m\n", "m,\n", 1)):
        assert read_log(write(tmp_path, text)).depth.tolist() == DEPTHS


def test_fields_without_names_are_stated(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,depth_m,rest\n0,1,7,8,9\n1,2,7,8,9\n")
    error = refused(path)
    assert "set fields = 5" in str(error)
    log = read_log(path, log_format=LogFormat(fields=5))
    assert log.depth.tolist() == [1.0, 2.0]
    assert "2 fields of each row, beyond the names, not used" in log.report
    assert refused(path, log_format=LogFormat(fields=2)).field == "fields"


def test_a_row_of_units(tmp_path: Path) -> None:
    path = write(tmp_path, "t,z,U,x\nms,[cm],-,mm\nSmp,Smp,Avg,Avg\n0,100,1,5\n500,110,2,6\n")
    columns = {"time_s": "t", "depth_m": "z", "voltage_V": "U", "piston_m": "x@cm"}
    form = table(tmp_path, "units_row = true\nskip_rows = 1")
    log = read_log(path, columns=columns, log_format=form)
    assert log.time.tolist() == [0.0, 0.5]
    assert log.depth.tolist() == [1.0, 1.1]
    assert log.piston is not None
    assert log.piston.tolist() == [0.05, 0.06]  # what is stated counts, not the row
    assert log.line.tolist() == [4, 5]
    assert "1 row below the names left out" in log.report
    error = refused(path, columns=columns)
    assert (error.line, "units_row = true" in str(error)) == (2, True)


def test_units_that_disagree_are_refused(tmp_path: Path) -> None:
    form = LogFormat(units_row=True)
    path = write(tmp_path, "time_s,depth_m\ns,cm\n0,1\n1,2\n")
    assert "the row of units says 'cm'" in str(refused(path, log_format=form))
    path = write(tmp_path, "time_s,z [m]\ns,cm\n0,1\n1,2\n")
    assert "z [m]" in str(refused(path, columns={"depth_m": "z [m]"}, log_format=form))
    path = write(tmp_path, "time_s,depth_m\ns,m\n0,1\n1,2\n")
    assert read_log(path, log_format=form).depth.tolist() == [1.0, 2.0]
    empty = write(tmp_path, "time_s,depth_m\n\n")
    assert refused(empty, log_format=form).field == "units_row"


def test_a_repeated_header_and_the_parts_between(tmp_path: Path) -> None:
    head = "time_s,depth_m\ns,m\n"
    path = write(tmp_path, f"{head}0,1\n1,2\n{head}0,5\n1,6\n2,7\n")
    first = read_log(path, log_format=LogFormat(units_row=True, part=1))
    assert first.depth.tolist() == [1.0, 2.0]
    second = read_log(path, log_format=LogFormat(units_row=True, part=2))
    assert second.depth.tolist() == [5.0, 6.0, 7.0]
    assert "part 2 of 2 chosen" in second.report
    assert "the header stands again once, first on line 5" in second.report
    assert refused(path, log_format=LogFormat(units_row=True, part=3)).field == "part"
    assert "part" in str(refused(path, log_format=LogFormat(units_row=True)))
    on = write(tmp_path, f"{head}0,1\n1,2\n{head}2,5\n3,6\n")
    assert len(read_log(on, log_format=LogFormat(units_row=True))) == 4


def test_rows_with_no_numbers_are_dropped_on_request(tmp_path: Path) -> None:
    rows = [f"{k},{k}" for k in range(20)]
    rows[3], rows[7] = "3,ERR", "x7,7"
    path = write(tmp_path, "\n".join(["time_s,depth_m", *rows, ""]))
    error = refused(path)
    assert (error.line, error.field, error.value) == (5, "depth_m", "ERR")
    assert 'bad_rows = "drop"' in str(error)
    log = read_log(path, log_format=LogFormat(bad_rows="drop"))
    assert len(log) == 18
    note = "2 rows with anything but a number dropped, the first on line 5 (depth_m: 'ERR')"
    assert note in log.report
    mostly = write(tmp_path, "time_s,depth_m\n0,a\n1,b\n2,1\n")
    assert refused(mostly, log_format=LogFormat(bad_rows="drop")).line == 2


def test_texts_that_stand_for_no_number(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,depth_m,voltage_V\n0,1,9999\n1,OFF,5\n2,3,-99.9\n3,4,5\n")
    log = read_log(path, log_format=LogFormat(missing=("9999", "-99.9", "off")))
    assert log.time.tolist() == [0.0, 2.0, 3.0]
    assert log.voltage is not None
    assert (log.voltage == 5.0).tolist() == [False, False, True]
    assert "1 of 4 rows without time or depth dropped" in log.report


def test_a_number_beyond_all_measure_is_refused_with_its_line(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,depth_m\n0,1\n1,1e300\n2,1\n")
    error = refused(path)
    assert (error.line, error.field, error.value, error.unit) == (3, "depth_m", 1e300, "m")
    assert "missing" in str(error)
    assert len(read_log(path, log_format=LogFormat(bad_rows="drop"))) == 2


@pytest.mark.parametrize(
    ("column", "value", "likely"),
    [("depth_m", "2e4", "cm"), ("voltage_V", "12000", "mV"), ("volume_m3", "-350", "mL")],
)
def test_a_number_that_no_vehicle_has_is_refused_with_its_likely_unit(
    tmp_path: Path, column: str, value: str, likely: str
) -> None:
    other = "depth_m" if column != "depth_m" else "speed_m_s"
    path = write(tmp_path, f"time_s,{other},{column}\n0,1,1\n1,1,{value}\n2,1,1\n3,1,1\n")
    error = refused(path)
    assert (error.line, error.field, error.value) == (3, column, float(value))
    assert f'"{column}": "{column}@{likely}"' in error.remedy
    assert len(read_log(path, log_format=LogFormat(bad_rows="drop"))) == 3


def test_a_log_is_read_by_pieces_as_it_is_at_once(tmp_path: Path, monkeypatch) -> None:
    rows = [f'{k},{k % 7}.5,"note {k}"' for k in range(400)]
    rows[100] = '100,2.5,"two\nlines, and ""more"""'
    rows[200:202] = ["# a remark", "", "time_s,depth_m,note", "201,5.5"]
    path = write(tmp_path, "\n".join(["time_s,depth_m,note", *rows, "400,1"]))
    whole = read_log(path)
    monkeypatch.setattr(log_rows, "_BLOCK", 300)
    log = read_log(path)
    for name in ("time", "depth", "line"):
        assert np.array_equal(getattr(log, name), getattr(whole, name)), name
    assert log.report == whole.report
    assert len(log) == 398


def test_a_unit_in_brackets_that_is_none_asks_for_one(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,P (abs)\n0,1\n1,2\n")
    error = refused(path, columns={"depth_m": "P (abs)"})
    assert (error.field, error.unit) == ("depth_m", "m")
    assert '`columns={"depth_m": "P (abs)@UNIT"}`' in str(error)


def test_the_four_header_lines_of_a_toa5_file(tmp_path: Path) -> None:
    """The form is that of the maker's manual (LoggerNet, appendix B.1.4)."""
    text = (
        '"TOA5","CR1000","CR1000","1031","CR1000.Std.00.60","CPU:Test.CR1","4062","Test"\r\n'
        '"TIMESTAMP","RECORD","Level","PTemp"\r\n"TS","RN","cm","C"\r\n"","","Smp","Smp"\r\n'
        '"2004-11-11 15:03:45",0,137,24.92\r\n"2004-11-11 15:03:45.5",1,138,24.95\r\n'
        '"2004-11-11 15:03:46",2,"NAN",24.98\r\n"2004-11-11 15:03:46.5",3,139,24.98\r\n'
    )
    log = read_log(
        write(tmp_path, text),
        columns={"time_s": "TIMESTAMP@iso", "depth_m": "Level"},
        log_format=LogFormat(units_row=True, skip_rows=1),
    )
    assert log.time.tolist() == [0.0, 0.5, 1.5]
    assert log.depth.tolist() == [1.37, 1.38, 1.39]
    assert log.line.tolist() == [5, 6, 8]


def test_names_stated_for_columns_lined_up_below_a_preamble(tmp_path: Path) -> None:
    text = "* Sea trial\n# name 0 = prDM\n*END*\n" + "   1.000      0.50\n  -2.5e-1      1.00\n"
    form = LogFormat(names=("depth_m", "time_s"), skip_lines=3, delimiter=" ")
    log = read_log(write(tmp_path, text), log_format=form)
    assert log.depth.tolist() == [1.0, -0.25]
    assert log.time.tolist() == [0.5, 1.0]
