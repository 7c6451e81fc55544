"""A log that is being written: bursts, partial lines, cuts, new logs, restarts."""

import threading
import time

import numpy as np
import pytest

from swimbladder.design.pool_day import (
    Asked,
    GrowingLog,
    Operator,
    PoolDay,
    Rules,
    Target,
    finished,
    follow,
    paper_tasks,
)
from swimbladder.design.pool_day.day import earlier, read_state
from swimbladder.errors import LogError
from swimbladder.io.config import load_vehicle
from swimbladder.io.log_format import LogFormat
from swimbladder.io.logs import read_log
from swimbladder.vehicle import Sensors
from tests.quoted import refused

HEADER = "time_s,depth_m,volume_m3\n"
VEHICLE = load_vehicle("feup-em")


@pytest.fixture(scope="module")
def lines():
    sensors = Sensors(depth_noise=2e-3)
    truth = VEHICLE.model_copy(update={"sensors": sensors})
    operator = Operator(VEHICLE, truth, bottom_depth=4.5, seed=3)
    found = []
    for task in paper_tasks(VEHICLE, bottom_depth=4.5)[4:6]:
        p = operator.perform(task)
        rows = np.column_stack(p[:3]).tolist()
        found.append([",".join(map(repr, row)) + "\n" for row in rows])
    return found


def tail_of(path):
    return GrowingLog(path, VEHICLE, columns={}, log_format=LogFormat())


def day_in(folder, **other):
    folder.mkdir(exist_ok=True)
    settings = {
        "rules": Rules(bottom=4.45),
        "tasks": paper_tasks(VEHICLE, bottom_depth=4.5),
        "asked": Asked(targets=(Target("K2", 0.02), Target("T2", 0.02))),
        "mode": "followed",
    }
    return PoolDay(VEHICLE, folder, **settings | other)


def kinds(happening):
    return [news.kind for news in happening if news is not None]


def samples(tail):
    return tail.read_new().samples


def test_a_partial_last_line_waits_for_its_end(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "0.0,1.0,0.0\n1.0,1.1,0.0\n2.0,1.2", encoding="ascii")
    tail = tail_of(path)
    assert [s.time for s in samples(tail)] == [0.0, 1.0]
    with path.open("a", encoding="ascii") as file:
        file.write("5,0.0\n")
    assert [(s.time, s.depth) for s in samples(tail)] == [(2.0, 1.25)]
    assert samples(tail) == []


def test_a_file_that_is_not_there_or_has_no_rows_yet(tmp_path):
    path = tmp_path / "log.csv"
    tail = tail_of(path)
    assert tail.read_new().state == "missing"
    path.write_text("time_s,dep", encoding="ascii")
    assert samples(tail) == []
    path.write_text(HEADER, encoding="ascii")
    assert samples(tail) == []
    path.write_text(HEADER + "0,1,0\n1,1,0\n", encoding="ascii")
    assert len(samples(tail)) == 2


def test_a_cut_file_is_waited_for_and_another_log_is_told(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{k},{1 + 0.1 * k},0\n" for k in range(6)]
    path.write_text(HEADER + "".join(rows[:4]), encoding="ascii")
    tail = tail_of(path)
    assert len(samples(tail)) == 4
    path.write_text(HEADER, encoding="ascii")  # as while it is copied anew
    assert tail.read_new().state == "still"
    path.write_text(HEADER + "".join(rows), encoding="ascii")
    growth = tail.read_new()
    assert not growth.new
    assert [s.time for s in growth.samples] == [4.0, 5.0]
    path.write_text(HEADER + "0,3,0\n1,3,0\n", encoding="ascii")
    growth = tail.read_new()
    assert growth.new
    assert [s.depth for s in growth.samples] == [3.0, 3.0]


def test_a_log_without_volume_is_refused_with_the_remedy(tmp_path):
    path = tmp_path / "log.csv"
    body = "".join(f"{k},1\n" for k in range(40))
    path.write_text("time_s,depth_m\n" + body, encoding="ascii")
    with refused(LogError, field="volume_m3 or piston_m") as caught:
        tail_of(path).read_new()
    assert str(path) in str(caught.value)
    assert "`columns=" in str(caught.value)


@pytest.mark.prove
def test_a_logger_that_writes_in_bursts_gives_what_the_finished_log_gives(lines, tmp_path):
    path, text = tmp_path / "log.csv", HEADER + "".join(lines[0] + lines[1])
    rng = np.random.default_rng(1)
    cuts = np.sort(rng.integers(0, len(text), 25))  # in the middle of lines

    def write():
        for first, last in zip([0, *cuts], [*cuts, len(text)], strict=True):
            with path.open("a", encoding="ascii") as file:
                file.write(text[first:last])
            time.sleep(0.01)

    live = day_in(tmp_path / "live")
    thread = threading.Thread(target=write)
    thread.start()
    happened = kinds(follow(live, tail_of(path), timeout=1.0, sleep=lambda _: time.sleep(0.02)))
    thread.join()
    whole = day_in(tmp_path / "whole")
    at_once = kinds(finished(whole, tail_of(path)))
    assert happened.count("ended") == 2
    assert [k for k in happened if k != "log"] == at_once
    for a, b in zip(live.kept, whole.kept, strict=True):
        assert a.path.read_bytes() == b.path.read_bytes()
    assert live.found.parameters == whole.found.parameters


def test_a_new_log_in_its_place_keeps_the_experiments(lines, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "".join(lines[0]), encoding="ascii")
    day, turned = day_in(tmp_path / "out"), []

    def sleep(_):
        if not turned:
            path.write_text(HEADER + "".join(lines[1]), encoding="ascii")
            turned.append(True)

    clock = iter(range(0, 10_000, 4))
    happened = kinds(
        follow(day, tail_of(path), timeout=20.0, sleep=sleep, clock=lambda: next(clock))
    )
    assert happened.count("ended") == 2
    assert "log" in happened
    assert [k.number for k in day.kept] == [1, 2]


def test_a_restart_goes_on_from_the_folder_and_counts_nothing_twice(lines, tmp_path):
    path, out = tmp_path / "log.csv", tmp_path / "out"
    path.write_text(HEADER + "".join(lines[0]), encoding="ascii")
    first = day_in(out)
    list(finished(first, tail_of(path)))
    first.keep_state()
    path.write_text(HEADER + "".join(lines[0] + lines[1]), encoding="ascii")
    second = day_in(out, kept=earlier(out, read_state(out)))
    happened = kinds(finished(second, tail_of(path)))
    assert happened.count("ended") == 1
    assert [k.number for k in second.kept] == [1, 2]
    assert {p.name for p in out.glob("experiment-*.csv")} == {
        "experiment-001.csv",
        "experiment-002.csv",
    }
    logs = [read_log(p) for p in sorted(out.glob("experiment-*.csv"))]
    assert [len(log) for log in logs] == [len(k.log) for k in second.kept]


def test_it_ends_when_nothing_comes(tmp_path):
    clock = iter(range(0, 1000, 10))
    happening = follow(
        day_in(tmp_path / "out"),
        tail_of(tmp_path / "none.csv"),
        timeout=30.0,
        sleep=lambda _: None,
        clock=lambda: next(clock),
    )
    with refused(LogError, field="follow"):
        list(happening)
