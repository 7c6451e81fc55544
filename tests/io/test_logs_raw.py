"""The files that a real logger wrote: binary junk, CR line ends, more fields than names."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from swimbladder.io.logs import read_log
from tests.log_files import refused, write

SETTINGS = "Vehicle settings: pid_kp = 0.02600 \t pid_ki = 0.00100 \t EMA_alpha = 0.40"
NAMES = (
    "Time[ms],#Mission,TargetDepth[m],PistonPosition[m],PIDoutput,Pterm,Iterm,Dterm,Pressure[V],"
    "psi,unfilterDepth[m],filteredDepth[m],Battery[V],Temperature,MotionData"
)


def record(time: float, piston: float, depth: float) -> str:
    return f"{time:.2f},1,1.25,{piston:.6f},0.03,0,0,0,0.5,0.9,{depth:.6f},0,22,18,1,2,3,4,5,6,7,8"


def raw(records: list[str]) -> bytes:
    start = f"{SETTINGS}\r\x13\x01\xb78 5\x90\x04V|\x04!\x08\xa4\xff{NAMES}\r"
    return (start + "".join(f"{line}\r" for line in records)).encode("latin-1")


def test_a_raw_file_in_the_form_of_that_logger(tmp_path: Path) -> None:
    records = [record(540, 0.0, 0.01), record(540, 0.0, 0.01), record(1041, 0.00125, 0.02)]
    records += [record(1541 + 500 * k, 0.0025, 0.02 * k) for k in range(20)]
    records.insert(8, records[5][:40] + "\xff\x00" + records[6])
    records.append(records[-1][:50])
    path = write(tmp_path, raw(records), "12.txt")
    log = read_log(path, log_format="ntnu-bv-raw")
    assert len(log) == 22
    assert log.time[:3].tolist() == [0.54, 1.041, 1.541]
    assert log.piston is not None
    assert log.piston[:2] == pytest.approx([0.02575, 0.0245], abs=1e-15)
    assert log.reference_piston is not None
    assert log.reference_piston[0] == pytest.approx(0.02575 - 0.03, abs=1e-15)
    assert log.line[:3].tolist() == [3, 5, 6]
    assert (
        "1 line above the names left out, the first: 'Vehicle settings: pid_kp = 0.02600 pid_ki = "
        "0.00100 EMA_alpha = 0.40'"
    ) in log.report
    assert "15 characters before the names on line 2 left out" in log.report
    assert "7 fields of each row, beyond the names, not used" in log.report
    assert "1 row with characters that are no text dropped, the first on line 11" in log.report
    assert "1 row without the header's 22 fields dropped, the first on line 27" in log.report
    assert "1 row with the time of the row before dropped" in log.report


def test_another_file_is_refused_with_what_it_lacks(tmp_path: Path) -> None:
    error = refused(write(tmp_path, "time_s,depth_m\n0,1\n"), log_format="ntnu-bv-raw")
    assert (error.field, error.value) == ("header_starts", "Time[ms],")


@pytest.mark.data
@pytest.mark.parametrize("number", [45, 47, 55, 57])
def test_raw_files_give_the_numbers_that_others_took_from_them(data_dir: Path, number: int) -> None:
    folder = data_dir / "ntnu_bv"
    log = read_log(folder / "raw" / f"{number}.txt", log_format="ntnu-bv-raw")
    frame = pd.read_csv(folder / "missions.csv.gz")
    frame = frame[frame["log"] == number]
    assert log.time.tolist() == frame["t_s"].tolist()
    assert log.depth.tolist() == frame["depth_raw_m"].tolist()
    assert log.reference_depth is not None
    assert log.reference_depth.tolist() == frame["target_depth_m"].tolist()
    for values, name in (
        (log.piston, "piston_position_m"),
        (log.reference_piston, "pid_output_m"),
    ):
        assert values is not None
        assert values == pytest.approx(0.02575 - frame[name].to_numpy(), abs=1e-15)
    raw_lines = (folder / "raw" / f"{number}.txt").read_bytes().split(b"\r")
    repeats = len([line for line in raw_lines if line.count(b",") == 21]) - len(log)
    said = [note for note in log.report if "with the time of the row before dropped" in note]
    assert [int(note.split()[0]) for note in said] == ([repeats] if repeats else [])
    texts = [raw_lines[int(line) - 1].split(b",") for line in log.line]
    assert np.array_equal(log.depth, [float(fields[10]) for fields in texts])
