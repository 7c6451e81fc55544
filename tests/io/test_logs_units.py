"""Columns that count something: a scale in the place of their unit."""

import pytest

from swimbladder.errors import UnitError
from swimbladder.io.log_format import LogColumn, column_factor
from swimbladder.io.logs import read_log
from tests.log_files import write
from tests.quoted import refused


@pytest.mark.parametrize(
    ("scale", "unit", "factor"),
    [
        ("0.0833 mm/deg", "m", 0.0833e-3),
        ("-0.0833 mm/deg", "m", -0.0833e-3),  # it counts inward
        ("2.5mm/step", "m", 2.5e-3),
        ("3 in/rev", "m", 3 * 0.0254),
        ("0.5 mL", "m3", 0.5e-6),
        ("1.2 mm/s/count", "m/s", 1.2e-3),
        ("1.2 mm/s", "m/s", 1.2e-3),
        ("3e-2 V/LSB", "V", 0.03),
        ("cm", "m", 0.01),
    ],
)
def test_a_scale_is_a_unit(scale, unit, factor):
    assert column_factor(LogColumn(name="x", unit=scale), unit) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("scale", ["0.1 mm/s", "5 kg/deg", "0 mm/deg", "1e999 mm", "2 per step"])
def test_what_is_no_scale_is_refused(scale):
    with refused(UnitError):
        column_factor(LogColumn(name="x", unit=scale), "m")


def test_a_piston_by_the_degrees_of_its_encoder(tmp_path):
    rows = "".join(f"{k},1.{k},{90 * k}\n" for k in range(9))
    path = write(tmp_path, f"time_s,depth_m,turned\n{rows}")
    for columns in ({"piston_m": "turned@0.0833 mm/deg"},):
        log = read_log(path, columns=columns)
        assert log.piston == pytest.approx([90 * k * 0.0833e-3 for k in range(9)])
        assert any("times 8.33e-05" in line for line in log.report)


def test_a_usual_log_takes_a_further_column_whose_name_says_quantity_and_unit(tmp_path):
    """And one depth only; of what cannot be read for certain it says which option reads it."""
    path = tmp_path / "log.csv"
    path.write_text(
        "time_s,depth_m,volume_cm3,pressure_mbar,speed,Motor (V)\n"
        "0,1.0,10,1113,0.1,12\n1,1.5,20,1163,0.2,6\n2,2.0,30,1212,0.3,0\n"
    )
    log = read_log(path)
    assert log.volume == pytest.approx([10e-6, 20e-6, 30e-6])
    assert log.depth == pytest.approx([1.0, 1.5, 2.0])
    assert log.voltage == pytest.approx([12.0, 6.0, 0.0])
    assert log.report[:3] == (
        "columns taken by their names: volume_m3 from 'volume_cm3', voltage_V from 'Motor (V)'",
        'not read: speed_m_s (no unit): `columns={"speed_m_s": "speed@m/s"}` reads it',
        "columns not used: pressure_mbar, speed",
    )
