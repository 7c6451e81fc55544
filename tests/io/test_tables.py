"""CSV that reads back to the bit."""

import csv
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.io.files import write_csv


def read(path):
    with path.open(newline="", encoding="ascii") as file:
        header, *rows = csv.reader(file)
    return header, [[float(cell) for cell in row] for row in rows]


@given(st.lists(st.tuples(st.floats(allow_nan=False), st.floats(allow_nan=False)), min_size=1))
def test_numbers_read_back_to_the_bit(tmp_path_factory, pairs):
    first, second = zip(*pairs, strict=True)
    path = write_csv(tmp_path_factory.mktemp("csv") / "t.csv", {"a_m": first, "b_V": second})
    header, rows = read(path)
    assert header == ["a_m", "b_V"]
    assert [tuple(row) for row in rows] == pairs


def test_what_is_not_known_is_nan(tmp_path):
    path = write_csv(tmp_path / "t.csv", {"a": [1.0, math.nan]})
    assert path.read_text() == "a\n1.0\nnan\n"
    assert np.isnan(np.genfromtxt(path, names=True)["a"][1])


def test_every_row_is_written_and_told_of(tmp_path):
    n = 45_000
    told = []
    path = write_csv(tmp_path / "t.csv", {"a": np.arange(n)}, advance=told.append)
    assert len(read(path)[1]) == n
    assert sum(told) == n
    assert len(told) > 1


def test_columns_have_to_be_of_one_length(tmp_path):
    with pytest.raises(ValueError, match="different lengths"):
        write_csv(tmp_path / "t.csv", {"a": [1.0], "b": [1.0, 2.0]})
    assert list(tmp_path.iterdir()) == []
