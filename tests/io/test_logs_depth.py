"""Depth from pressure, and depth that a logger made with another water, zero or sign."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from swimbladder.errors import InputError
from swimbladder.io.log_format import LogFormat
from swimbladder.io.logs import read_log
from tests.log_files import refused, table, write
from tests.quoted import numbers

POOL = 'water_density = "998 kg/m3"\n'
PASCALS = {  # by definition: of the pound, the inch, the atmosphere
    "Pa": Fraction(1),
    "kPa": Fraction(1000),
    "mbar": Fraction(100),
    "hPa": Fraction(100),
    "dbar": Fraction(10_000),
    "bar": Fraction(100_000),
    "atm": Fraction(101_325),
    "psi": Fraction("0.45359237") * Fraction("9.80665") / Fraction("0.0254") ** 2,
}


def rows(pressures: list[float], name: str) -> str:
    return f"time_s,{name}\n" + "".join(f"{k},{p!r}\n" for k, p in enumerate(pressures))


@pytest.mark.parametrize("unit", PASCALS)
def test_pressure_in_any_unit_becomes_the_depth_of_hydrostatics(tmp_path: Path, unit: str) -> None:
    depth = np.array([0.0, 1.5, 4.5, 100.0])
    gauge = 998.0 * 9.80665 * depth / float(PASCALS[unit])
    path = write(tmp_path, rows(gauge.tolist(), f"P [{unit}]"))
    form = table(tmp_path, POOL + 'atmospheric_pressure = "gauge"')
    log = read_log(path, columns={"pressure_Pa": f"P [{unit}]"}, log_format=form)
    assert log.depth == pytest.approx(depth, rel=1e-12, abs=1e-12)
    note = "depth_m from pressure_Pa, less 0 Pa at the surface (gauge), over 998 kg/m3 times"
    assert any(line.startswith(note) for line in log.report)


def test_absolute_pressure_less_what_is_given_or_the_first_readings(tmp_path: Path) -> None:
    depth = np.array([0.0, 0.0, 0.01, 2.0, 3.0])
    absolute = 101_000.0 + 1025.0 * 9.81 * depth
    path = write(tmp_path, rows(absolute.tolist(), "pressure_Pa"))
    sea = 'water_density = "1025 kg/m3"\ngravity = 9.81\natmospheric_pressure = '
    for said, shift in (('"1010 mbar"', 0.0), ("101000.0", 0.0), ('"first"', 0.0)):
        log = read_log(path, log_format=table(tmp_path, sea + said))
        assert log.depth == pytest.approx(depth - shift, abs=1e-9)
    log = read_log(path, log_format=table(tmp_path, sea + '"first 2 s"'))
    assert log.depth == pytest.approx(depth, abs=1e-9)  # the median of three
    assert any("median of the first 2 s" in note for note in log.report)


def test_first_is_first_in_time(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,pressure_Pa\n2,120000\n0,100000\n1,110000\n")
    form = LogFormat(rows="sort", water_density=1000.0, gravity=9.8, atmospheric_pressure="first")
    log = read_log(path, log_format=form)
    assert log.depth == pytest.approx(np.array([0.0, 1.0, 2.0]) * 1e4 / 9.8e3)


def test_pressure_alone_is_not_enough(tmp_path: Path) -> None:
    path = write(tmp_path, rows([101_325.0, 111_325.0], "pressure_Pa"))
    assert refused(path).field == "water_density"
    error = refused(path, log_format=LogFormat(water_density=998.0))
    assert error.field == "atmospheric_pressure"
    assert 101325.0 in numbers(error)  # Pa
    assert "absolute" in str(error)
    gauge = write(tmp_path, rows([12.0, 9_000.0], "pressure_Pa"))
    assert "gauge" in str(refused(gauge, log_format=LogFormat(water_density=998.0)))


@pytest.mark.parametrize(
    ("lines", "field"),
    [
        ('atmospheric_pressure = "gauge"', "atmospheric_pressure"),
        (POOL, "water_density"),
        ("gravity = 9.81", "gravity"),
    ],
)
def test_what_has_no_use_without_pressure_is_refused(
    tmp_path: Path, lines: str, field: str
) -> None:
    path = write(tmp_path, "time_s,depth_m\n0,1\n1,2\n")
    assert refused(path, log_format=table(tmp_path, lines)).field == field


@pytest.mark.parametrize("line", ['logger_density = "1000 kg/m3"', 'depth_positive = "up"'])
def test_what_has_no_use_with_pressure_is_refused(tmp_path: Path, line: str) -> None:
    path = write(tmp_path, rows([1.0, 2.0], "pressure_Pa"))
    form = table(tmp_path, POOL + 'atmospheric_pressure = "gauge"\n' + line)
    assert refused(path, log_format=form).field == line.split()[0]


def test_depth_and_pressure_in_one_log(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,depth_m,pressure_Pa,P\n0,1,2,3\n1,2,3,4\n")
    log = read_log(path)
    assert log.depth.tolist() == [1.0, 2.0]
    assert "columns not used: pressure_Pa, P" in log.report
    form = LogFormat(water_density=1000.0, gravity=9.8, atmospheric_pressure="gauge")
    log = read_log(path, columns={"pressure_Pa": "P@kPa"}, log_format=form)
    assert log.depth == pytest.approx([3.0 / 9.8, 4.0 / 9.8])
    both = {"pressure_Pa": "P@kPa", "depth_m": "depth_m"}
    assert refused(path, columns=both, log_format=form).field == "pressure_Pa"


def test_a_depth_made_with_another_water(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,depth_m\n0,1.025\n1,10.25\n")
    form = table(tmp_path, 'water_density = "1025 kg/m3"\nlogger_density = "1 kg/L"')
    log = read_log(path, log_format=form)
    assert log.depth == pytest.approx([1.0, 10.0], rel=1e-14)
    assert any("took the water for one of 1000 kg/m3" in note for note in log.report)
    with pytest.raises(InputError, match="water_density"):
        table(tmp_path, 'logger_density = "1000 kg/m3"')


def test_an_offset_and_a_sign(tmp_path: Path) -> None:
    text = "time_s,depth_m,speed_m_s,reference_depth_m\n0,-1,-0.5,-2\n1,-2,-0.5,-2\n"
    path = write(tmp_path, text)
    assert any('check depth_positive = "up"' in note for note in read_log(path).report)
    log = read_log(
        path, log_format=table(tmp_path, 'depth_positive = "up"\ndepth_offset = "30 cm"')
    )
    assert log.depth == pytest.approx([1.3, 2.3])
    assert log.speed is not None
    assert log.reference_depth is not None
    assert log.speed.tolist() == [0.5, 0.5]
    assert log.reference_depth.tolist() == [2.0, 2.0]
    assert "0.3 m added to depth_m" in log.report
    assert "depth_m counts upward in the file; turned to count downward" in log.report


def test_rows_without_pressure_are_rows_without_depth(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,pressure_Pa,piston_m\n0,0,1\n1,,1\n2,9800,1\n3,9800,\n")
    form = LogFormat(water_density=1000.0, gravity=9.8, atmospheric_pressure="first 5 s")
    log = read_log(path, log_format=form)
    assert log.time.tolist() == [0.0, 2.0, 3.0]
    free = read_log(path, log_format=form, required=("piston_m",))
    assert free.time.tolist() == [0.0, 1.0, 2.0]
    assert np.isnan(free.depth).tolist() == [False, True, False]
