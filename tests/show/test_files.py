"""Files of a result: each kind of content, all of them or none."""

import json

import numpy as np
import pytest

from swimbladder.io.files import rows_csv
from swimbladder.show.answers import write_all
from swimbladder.show.picture import Picture


def test_each_kind_of_content_is_written_under_its_name(tmp_path):
    told = []
    files = write_all(
        tmp_path / "new" / "out",
        {
            "words.txt": "some\n",
            "part/raw.bin": b"\x00\x01",
            "picture.png": Picture((4.0, 3.0)),
            "columns.csv": {"a_m": [1.0, 2.5], "b": np.array([np.nan, 1e-9])},
            "answer.json": {"a": np.float64(1.5), "b": [float("inf"), (1, 2)]},
            "own.txt": lambda path: path.write_text(path.suffix),
        },
        advance=told.append,
    )
    assert sum(told) == pytest.approx(1.0)
    words, raw, picture, columns, answer, own = files
    assert words.read_text() == "some\n"
    assert raw == tmp_path / "new" / "out" / "part" / "raw.bin"
    assert raw.read_bytes() == b"\x00\x01"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert columns.read_text() == "a_m,b\n1.0,nan\n2.5,1e-09\n"
    assert json.loads(answer.read_text()) == {"a": 1.5, "b": [None, [1, 2]]}
    assert own.read_text() == ".txt"


def test_none_is_written_where_one_cannot_be(tmp_path):
    def fails(_):
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        write_all(tmp_path / "out", {"a.txt": "a", "b.txt": fails})
    assert list(tmp_path.iterdir()) == []


def test_rows_of_words_and_numbers():
    assert rows_csv(["name", "x"], [("a, b", 1.5), ("c", None)]) == 'name,x\n"a, b",1.5\nc,nan\n'
