"""A session with a board, whose wire is its twin: what is flown, and what is measured of time."""

import csv
import itertools
import math
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from swimbladder.codegen import board
from swimbladder.codegen.board import FlightAnswer, Times
from swimbladder.codegen.golden import Mission
from swimbladder.codegen.library import firmware
from swimbladder.control.supervisor import Watched
from swimbladder.io.config import load_vehicle
from tests.vehicles import limited

TICK = 0.3  # s


@pytest.fixture(scope="module")
def made():
    return firmware(limited(load_vehicle("feup-em")))


class TwinOnTheWire:
    """Says what the twin of a board does, by a clock of its own that wraps every 71 minutes."""

    def __init__(self, made, began):
        self.twin, self.began = made.board(made.twin()), iter(began)

    def tick(self, seen, reference):
        said = board._said(self.twin, self.twin.tick(seen, np.float32(reference)))
        return said, next(self.began), 1500


def flight(made, folder, *, began, real_time=False):
    session = SimpleNamespace(
        made=made,
        wire=TwinOnTheWire(made, began),
        real_time=real_time,
        times=Times(),
        full=made.limits[1],
        twin=partial(made.board, made.twin()),
    )
    answer = FlightAnswer(name="flight", log=folder / "flight.csv")
    return board._Flight(session, answer, lambda _: None)


def seen(lost=0):
    return Watched(2.0, 0.0, 0.0, 12.0, False, lost, 0)


def test_an_interval_is_between_ticks_that_follow_each_other(made, tmp_path):
    """By the board's clock, over its wrap too; a tick after one or more lost ones gives none."""
    wrap = 2**32
    began = [wrap - 100_000, 200_050, 800_000, 1_100_000, 2_000_000, 2_299_000]
    flown = flight(made, tmp_path, began=began)
    for lost in (0, 0, 1, 0, 2, 0):
        flown.tick(seen(lost), 2.0)
    flown.log.close()
    assert flown.stopped is None
    assert flown.session.times.intervals == pytest.approx([50e-6, 0.0, -1e-3])
    assert flown.session.times.steps == [1.5e-3] * 6
    with flown.answer.log.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    times = [float(row["time_s"]) for row in rows]
    assert times == pytest.approx(np.array([0, 1, 3, 4, 7, 8]) * TICK)
    trips = [1e-6 * float(row["round_trip_us"]) for row in rows]
    assert trips == pytest.approx(flown.session.times.trips, abs=1e-6)


def test_a_tick_stands_in_the_log_as_soon_as_it_is_over(made, tmp_path):
    """What is killed leaves what it has flown."""
    flown = flight(made, tmp_path, began=[0, 300_000])
    for n in (1, 2):
        flown.tick(seen(), 2.0)
        assert len(flown.answer.log.read_text(encoding="utf-8").splitlines()) == 1 + n
    flown.log.close()


@pytest.mark.parametrize(("share", "late"), [(0.09, 0), (0.11, 3)])
def test_a_tick_is_late_that_begins_a_tenth_of_the_sample_time_after_it_is_due(
    share, late, made, tmp_path, monkeypatch
):
    """A clock that sleeping takes past the time that is due, by so much of a sample time."""
    clock = SimpleNamespace(time=100.0)

    def sleep(seconds):
        clock.time += seconds + share * TICK

    times = SimpleNamespace(sleep=sleep, perf_counter=lambda: clock.time)
    monkeypatch.setattr(board, "time", times)
    flown = flight(made, tmp_path, began=itertools.count(0, 300_000), real_time=True)
    for _ in range(4):  # the first is due at once
        flown.tick(seen(), 2.0)
        clock.time = flown._due + 0.01
    flown.log.close()
    assert flown.stopped is None
    assert flown.session.times.late == late


@pytest.mark.parametrize("steps", [False, True])
def test_steps_go_to_the_target_and_back_by_thirds(steps, made):
    flown = dict(board._set_points(made, Mission(1.0, 4.0, 60.0), steps))
    assert flown.pop("golden mission") == [(0.0, 4.0)]
    thirds = [(0.0, 4.0), (pytest.approx(1 / 3), 1.0), (pytest.approx(2 / 3), 4.0)]
    assert flown == ({"steps": thirds} if steps else {})


def test_steps_of_a_float_go_down_by_half_down_again_and_up():
    floats = SimpleNamespace(drive=object())
    flown = dict(board._set_points(floats, Mission(0.0, 400.0, 3600.0), True))
    assert flown["golden mission"] == [(0.0, 400.0), (pytest.approx(2 / 3), 0.0)]
    assert flown["steps"] == [(0.0, 400.0), (0.4, 200.0), (0.55, 400.0), (0.7, 0.0)]


def test_the_shortest_golden_mission_of_a_float_is_a_tick():
    """It begins at its first tick, and ends at the next; one that has not dived is refused."""
    vehicle = limited(load_vehicle("example-float"))
    ran = firmware(vehicle, step=(30.0, 30.0), duration=0.4)
    assert len(ran.golden.depth) == 2
    assert math.isclose(ran.golden.depth[0], 30.0, abs_tol=1e-3)
