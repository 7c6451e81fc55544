"""Chunks of work: what is kept, by what it is found, and in which order it comes."""

import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from swimbladder import jobs
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.jobs import Store, Workers, each, identity, place_files, run

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
        None,
        True,
        1,
        1.0,
        "1",
        b"1",
        (1,),
        [1],
        ((1,),),
        (1, 2),
        (12,),
        {"a": 1},
        {"a": 2},
        FEUP,
        other,
        np.ones(2),
        np.ones((2, 1)),
        np.ones(2, np.float32),
        np.float64(1.0),
        Point(1, 2),
        Shape("a", [Point(1, 2)]),
        Shape("a", [Point(1, 3)]),
        Shape("b", [Point(1, 2)]),
    ]
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


class Marks(NamedTuple):
    """A job whose chunks are files; some do something else first."""

    folder: Path
    name: str = "marks"
    count: int = 6
    deadly: tuple[int, ...] = ()
    broken: tuple[int, ...] = ()

    def check(self):
        return self.folder.exists()

    def create(self):
        self.folder.mkdir(exist_ok=True)

    def done(self):
        return {int(path.name) for path in self.folder.glob("[0-9]*")}

    def do(self, chunk):
        if chunk in self.deadly:
            os.kill(os.getpid(), 9)
        if chunk in self.broken:
            raise InputError("what is asked for cannot be", field="here", value=chunk)
        place_files(self.folder, {str(chunk): b"done"}, aside=self.folder.parent)


@pytest.mark.parametrize("executor", jobs.EXECUTORS)
def test_an_error_of_a_worker_is_the_jobs_and_nothing_is_lost(executor, tmp_path):
    if executor == "dask":
        pytest.importorskip("distributed")
    job = Marks(tmp_path / "x", broken=(3,))
    with pytest.raises(InputError, match="here: what is asked for cannot be"):
        run(job, Workers(executor=executor, workers=1))
    done = job.done()
    assert 3 not in done
    shares = []
    assert run(job._replace(broken=()), Workers(executor=executor, workers=2), shares.append)
    assert sum(shares) == pytest.approx(1.0)
    assert job.done() == set(range(6))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x"]


def test_processes_that_always_die_are_given_up(tmp_path):
    job = Marks(tmp_path / "x", deadly=(4,))
    with pytest.raises(NoAnswerError, match="died 3 times without doing anything"):
        run(job, Workers(executor="processes", workers=1))
    assert 4 not in job.done()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"executor": "ray"}, "executor: no such executor"),
        ({"workers": 0}, "workers: must be"),
        ({"scheduler": "tcp://a:1"}, "scheduler: only dask"),
        ({"scheduler": "tcp://a:1", "executor": "dask", "workers": 2}, "workers of its own"),
        ({"part": (0, 3)}, "part: no part"),
        ({"part": (4, 3)}, "part: no part"),
    ],
)
def test_workers_that_cannot_be_are_refused(given, words):
    with pytest.raises(InputError, match=words):
        Workers(**given)


def test_parts_share_the_chunks(tmp_path):
    job = Marks(tmp_path / "x", count=5)
    assert not run(job, Workers(part=(2, 2)))
    assert job.done() == {1, 3}
    assert not run(job, Workers(part=(9, 9)))
    assert run(job, Workers(part=(1, 2)))


def test_a_scheduler_that_is_not_there_is_named_before_anything_is_done(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(jobs, "_PATIENCE", 0.5)
    written = tmp_path / "scheduler.json"
    written.write_text('{"address": "tcp://127.0.0.1:1"}')
    (tmp_path / "other.json").write_text("[]")
    for where, words in (
        ("tcp://127.0.0.1:1", "no scheduler answers there"),
        ("nowhere.json", "there is no such file"),
        ("x" * 300 + ".json", "there is no such file"),
        (str(tmp_path), "there is no such file"),
        (str(written), "no scheduler answers there"),
        (str(tmp_path / "other.json"), "no file that a scheduler wrote"),
    ):
        with pytest.raises(InputError, match=words):
            run(Marks(tmp_path / "x"), Workers(executor="dask", scheduler=where))
    assert not (tmp_path / "x").exists()


@pytest.mark.slow
@pytest.mark.parametrize("source", ['__version__ = "0.0.1"', "", None])
def test_a_worker_with_another_version_is_named_before_anything_is_done(source, tmp_path):
    """Of a version without jobs, of none, and without the package."""
    pytest.importorskip("distributed")
    other = tmp_path / "other"
    other.mkdir()
    if source is None:
        (other / "swimbladder.py").write_text("raise ImportError('there is none')")
    else:
        (other / "swimbladder").mkdir()
        (other / "swimbladder" / "__init__.py").write_text(source)
    file = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m"]
    started = [
        subprocess.Popen(
            [*dask, *arguments, "--no-dashboard", "--scheduler-file", str(file)],
            env=os.environ | {"PYTHONPATH": str(other)},
            cwd=tmp_path,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for arguments in (
            ["distributed.cli.dask_scheduler", "--port", "0", "--host", "127.0.0.1"],
            ["distributed.cli.dask_worker", "--no-nanny", "--nthreads", "1"],
        )
    ]
    try:
        begin = time.monotonic()
        while not file.exists():
            assert time.monotonic() - begin < 60.0
            time.sleep(0.1)
        from distributed import Client

        with Client(scheduler_file=str(file), set_as_default=False) as client:
            client.wait_for_workers(1, timeout=60)
        with pytest.raises(InputError, match="has another version of swimbladder"):
            run(Marks(tmp_path / "x"), Workers(executor="dask", scheduler=str(file)))
        assert not (tmp_path / "x").exists()
    finally:
        for process in started:
            process.kill()
            process.wait()


def test_a_worker_that_comes_late_with_another_version_does_nothing(tmp_path):
    job = Marks(tmp_path)
    with pytest.raises(InputError, match="another version of swimbladder"):
        jobs._do("late", "another", job, 0)
    assert job.done() == set()
    jobs._do("late", jobs.software(), job, 0)
    assert job.done() == {0}


def test_files_are_placed_whole_or_not_at_all(tmp_path):
    folder = tmp_path / "to"
    place_files(folder, {"a/b": b"1", "c": b"2"}, aside=tmp_path)
    assert (folder / "a" / "b").read_bytes() == b"1"
    with pytest.raises(TypeError):
        place_files(folder, {"c": None}, aside=tmp_path)
    assert (folder / "c").read_bytes() == b"2"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["to"]
