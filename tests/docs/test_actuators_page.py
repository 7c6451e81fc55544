"""The page on actuators: its table is true."""

import re
from pathlib import Path

import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.physics.motor import inductance_error
from swimbladder.physics.oil import oil_compression

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "actuators.md"


@pytest.mark.parametrize(("column", "name"), [(1, "example-eh"), (2, "example-em")])
def test_the_table_of_the_inductance_is_measured(column, name):
    """Every number of the table, to the digits it shows."""
    vehicle = load_vehicle(name)
    e = inductance_error(
        vehicle.actuator,
        vehicle.water,
        voltage=vehicle.supply.voltage,
        depth=vehicle.hull.depth_limit,
    )
    expected = {
        "L/R": [e.electrical_time * 1e3],
        "T1": [e.mechanical_time * 1e3],
        "poles with L": [p.real for p in e.poles],
        "pole without": [e.simplified_pole.real],
        "largest error": [e.peak_speed_error * 100.0],
        "63 %": [e.time_constant_shift * 1e3],
        "travel behind, at last": [e.position_lag * 1e3],
        "travel behind, at most": [e.peak_position_lag * 1e3],
        "start from zero": [e.start_delay * 1e3],
    }
    rows = [
        r.strip("| ").split(" | ") for r in PAGE.read_text("utf-8").splitlines() if r[:2] == "| "
    ]
    for label, values in expected.items():
        cell = next(row[column] for row in rows if row[0].startswith(label))
        shown = re.findall(r"-?\d+(?:\.\d+)?", cell.removesuffix("1/s"))
        digits = [len(text.partition(".")[2]) for text in shown]
        assert shown == [f"{v:.{d}f}" for v, d in zip(values, digits, strict=True)], label


def test_what_the_page_says_of_the_oil():
    vehicle = load_vehicle("example-eh")
    found = oil_compression(vehicle.actuator.drive.oil, 1000.0, vehicle.water)
    assert f"{-100.0 * found.exact:.2f} %" in PAGE.read_text("utf-8")
