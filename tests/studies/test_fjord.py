"""The study of the fjord on made-up records: what it cuts, counts and reads, without its data."""

import gzip
from dataclasses import replace

import numpy as np
import pytest

from studies import fjord, fjord_line
from tests.layered import COLUMN_HEADER, cast_rows, sailed, vehicle


def test_a_log_begins_where_the_float_has_righted_itself():
    log = sailed(vehicle(), noise=0.0, pushes=(0.0, 2.0, -1.0, 18.0))
    depth = log.depth.copy()
    depth[:9], depth[4] = -0.37, 0.02  # up for an instant, and down again
    depth[150] = -0.2  # at the end it comes up: that stays
    cut = fjord.upright(replace(log, depth=depth))
    assert cut.time[0] == log.time[9]
    assert len(cut) == len(log) - 9
    np.testing.assert_array_equal(fjord.upright(log).depth, log.depth)


def test_turning_to_and_fro_is_told_from_drift_and_jitter():
    time = np.arange(0.0, 300.0, 0.5)
    middle = (time > 60.0) & (time < 240.0)

    def rms(rate):
        return float(np.sqrt(np.mean(fjord_line.turning(time, rate)[middle] ** 2)))

    swing = 700.0 * np.sin(2.0 * np.pi * time / 20.0)
    # a mean over 4 s leaves sinc(0.2), one over 40 s nothing
    assert rms(swing) == pytest.approx(700.0 * np.sinc(0.2) / np.sqrt(2.0), rel=0.03)
    assert rms(-25_000.0 + 5.0 * time) < 6.0
    assert rms(700.0 * np.sin(2.0 * np.pi * time / 1.7)) < 0.25 * rms(swing)


def test_columns_are_those_of_one_mission(tmp_path):
    rows = ["log,t_s,gyro_z", "53,0.0,", "53,0.5,-7", "55,0.5,9", "53,1.0,-8"]
    with gzip.open(tmp_path / "missions.csv.gz", "wt") as file:
        file.write("\n".join(rows) + "\n")
    found = fjord_line.columns(tmp_path, 53, ("gyro_z",))
    np.testing.assert_array_equal(found["t_s"], [0.5, 1.0])
    np.testing.assert_array_equal(found["gyro_z"], [-7.0, -8.0])


def test_layers_are_lifted_as_asked(tmp_path):
    (tmp_path / "cast.csv").write_text("\n".join([COLUMN_HEADER, *cast_rows()]) + "\n")
    rest, higher = (fjord.water(tmp_path, "cast.csv", lifted=by) for by in (0.0, 0.2))
    inside = slice(4, 60)
    np.testing.assert_allclose(
        higher.density[inside],
        np.interp(rest.depth + 0.2, rest.depth, rest.density)[inside],
        atol=0.02,
    )
    assert np.ptp(rest.density) > 5.0
