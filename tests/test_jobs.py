"""Chunks of work: what is kept, by what it is found, and in which order it comes."""

import threading
import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest

from swimbladder import jobs
from swimbladder.io.config import load_vehicle
from swimbladder.jobs import Store, each, identity

FEUP = load_vehicle("feup-em")


class Point(NamedTuple):
    x: float
    y: float


@dataclass
class Shape:
    name: str
    points: list[Point]


@pytest.mark.parametrize(
    "answer", [{"a": [1.5, None, float("inf")]}, [1, 2.5, "x"], 0.1 + 0.2, np.arange(6.0)]
)
def test_an_answer_comes_back_as_it_was(tmp_path, answer):
    store = Store(tmp_path / "a" / "b", "about")
    assert store.read("what", 1) is None
    store.write(answer, "what", 1)
    back = Store(tmp_path / "a" / "b", "about").read("what", 1)
    assert np.array_equal(back, answer) if isinstance(answer, np.ndarray) else back == answer
    assert store.get(lambda: pytest.fail("it is kept"), "what", 1) is not None
    assert Store(tmp_path / "a" / "b", "else").read("what", 1) is None
    assert store.read("what", 2) is None


def test_arrays_by_name_come_back_to_the_bit(tmp_path):
    store = Store(tmp_path)
    given = {"x": np.array([np.nan, -0.0, 5e-324]), "n": np.arange(3, dtype=np.int64)}
    store.write(given, "state", 0)
    back = store.read("state", 0)
    assert {k: (v.dtype, v.tobytes()) for k, v in back.items()} == {
        k: (v.dtype, v.tobytes()) for k, v in given.items()
    }


@pytest.mark.parametrize("answer", [[1.0], np.zeros(9), {"x": np.zeros(9)}])
def test_what_is_torn_is_computed_anew(tmp_path, answer):
    store = Store(tmp_path)
    store.write(answer, "what")
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    for torn in (b"", whole[: len(whole) // 2], b"\x00" * len(whole)):
        path.write_bytes(torn)
        assert store.read("what") is None
    assert store.get(lambda: answer, "what") is answer
    assert path.read_bytes() == whole


def test_edited_source_computes_anew(tmp_path, monkeypatch):
    store = Store(tmp_path)
    store.write([1], "what")
    monkeypatch.setattr(jobs, "software", lambda: "another")
    assert store.read("what") is None


def test_without_a_folder_nothing_is_kept():
    store = Store(None)
    assert [store.get(lambda n=n: n, "what") for n in (1, 2)] == [1, 2]
    store.forget()


def test_values_that_differ_have_names_that_differ():
    other = FEUP.model_copy(update={"trim_error": 1e-6})
    values = [
        None, True, 1, 1.0, "1", b"1", (1,), [1], ((1,),), (1, 2), (12,), {"a": 1}, {"a": 2}, FEUP,
        other, np.ones(2), np.ones((2, 1)), np.ones(2, np.float32), np.float64(1.0), Point(1, 2),
        Shape("a", [Point(1, 2)]), Shape("a", [Point(1, 3)]), Shape("b", [Point(1, 2)]),
    ]  # fmt: skip
    assert len({identity(value) for value in values}) == len(values)
    assert identity({"b": 1, "a": 2}) == identity({"a": 2, "b": 1})
    # what is remarked of a vehicle changes nothing
    assert identity(FEUP) == identity(FEUP.model_copy(update={"description": "a remark"}))
    with pytest.raises(TypeError, match="function"):
        identity(lambda: 1)


def test_every_item_is_done_once_on_all_workers():
    found = dict(each(lambda n: (n * n, threading.get_ident()), range(300), workers=3))
    assert {n: square for n, (square, _) in found.items()} == {n: n * n for n in range(300)}
    assert len({thread for _, thread in found.values()}) == 3


def test_after_an_error_no_other_is_begun():
    begun = []

    def work(n):
        begun.append(n)
        time.sleep(0.01)
        if n == 3:
            raise KeyError(n)

    with pytest.raises(KeyError):
        list(each(work, range(1000), workers=2))
    assert len(begun) < 12
