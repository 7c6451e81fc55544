"""From a change of volume to seconds of pump and valve, on numbers worked by hand."""

import math
from typing import NamedTuple

import pytest

from swimbladder.control.law import Law, Measurement
from swimbladder.control.pump_valve import (
    DriveParameters,
    SurfacingParameters,
    delivery,
    in_steps,
    run_length,
    timed,
    valve_rate,
)

# 1 cm3/s at the surface, 0.6 at 1000 m, 2 cm3 lost at a start; a head of 0.1 bar and 0.1 bar/m.
DRIVE = DriveParameters(
    tick=1.0,
    per_depth=1e-3,
    pump_0=1e-6,
    pump_1=-0.4e-6,
    pump_2=0.0,
    pump_3=0.0,
    pump_4=0.0,
    battery_full=14.0,
    per_volt=0.1e-6,
    sag_0=0.2,
    sag_1=0.4,
    short_0=2e-6,
    short_1=0.0,
    short_2=0.0,
    head_0=1e4,
    head_1=1e4,
    longest_wait=1e5,
    valve_flow=1e-8,
    valve_laminar=0.0,
    bypass_flow=1e-7,
    bypass_laminar=0.0,
    quantum=0.01,
    longest=100.0,
    longest_for_law=60.0,
    pause=60.0,
    volume_least=-3e-4,
    volume_most=3e-4,
    beyond=3e-5,
)
TOP = SurfacingParameters(
    shallow=5.0, neutral=0.0, full=3e-4, negligible=6e-7, slack=1e-5, measured=0.0
)


class Wants(NamedTuple):
    change: float  # m3
    every: float  # s


class Calls(NamedTuple):
    times: float


def begins(*_):
    return Calls(0.0)


def wants_step(p, state, _measurement, _reference):
    return p.change, Calls(state.times + 1.0), p.every


ASKS = Law(
    name="asks",
    summary="asks for the same change each time",
    command="volume change",
    parameters=Wants,
    state=Calls,
    step=wants_step,
    initial=begins,
)


class Board:
    """A board's law, called tick by tick at the depths that it is given."""

    def __init__(self, change, every=20.0, *, depth=500.0, **drive):
        self.law = timed(ASKS)
        self.p = self.law.parameters(Wants(change, every), TOP, DRIVE._replace(**drive))
        self.depth, self.state = depth, None

    def ticks(self, count, reference, *, volume=math.nan, battery=(math.nan, math.nan)):
        """Return what it says; battery [V]: while the pump stands, and while it runs."""
        said = []
        for _ in range(count):
            seen = Measurement(0.0, self.depth, volume, battery[bool(said) and said[-1] > 0.0])
            if self.state is None:
                self.state = self.law.initial(self.p, seen, reference)
            command, self.state, pause = self.law.step(self.p, self.state, seen, reference)
            assert pause == self.p.drive.tick
            said.append(command)
        return said


def test_rates_by_hand():
    assert delivery(DRIVE, 500.0, 0.0) == pytest.approx(0.8e-6)
    assert delivery(DRIVE, 5000.0, 0.0) == pytest.approx(0.6e-6)  # beyond the fit: that of its end
    assert valve_rate(DRIVE, 0.0, 3.0) == pytest.approx(1e-8 * 200.0)
    assert valve_rate(DRIVE, 0.0, -9.0) == 0.0  # no head: the sea does not come in
    thick = DRIVE._replace(bypass_laminar=300.0)
    assert valve_rate(thick, 1.0, 15.0) == pytest.approx(1e-7 * 200.0)  # 9e4 + 16e4 = 500^2
    assert valve_rate(thick, 1.0, -9.0) == 0.0


def test_a_run_makes_up_for_its_start_and_ends_at_the_longest():
    assert run_length(8e-6, 2e-6, 0.5e-6, 100.0) == pytest.approx(20.0)
    assert run_length(-8e-6, 0.0, 0.5e-6, 100.0) == pytest.approx(16.0)
    assert run_length(80e-6, 2e-6, 0.5e-6, 100.0) == 100.0
    assert run_length(8e-6, 0.0, 0.0, 100.0) == 100.0  # nothing flows


@pytest.mark.parametrize(
    ("length", "quantum", "stepped"),
    [(1.234, 0.01, 1.23), (1.236, 0.01, 1.24), (299.9996, 0.001, 300.0), (0.7, 0.0, 0.7)],
)
def test_a_run_has_whole_steps(length, quantum, stepped):
    assert in_steps(length, quantum) == pytest.approx(stepped, abs=1e-9)


def test_a_change_is_a_run_over_ticks_and_then_rest():
    """10 cm3 at 0.8 cm3/s, and 2 cm3 for the start: 15 s."""
    said = Board(10e-6).ticks(20, 600.0)
    assert said[:15] == [1.0] * 15
    assert said[15:] == [0.0] * 5


def test_a_low_battery_makes_a_run_longer_and_what_it_moves_is_known():
    """2 V less take 0.2 of 0.8 cm3/s: 20 s; the same read under a load that takes 0.4 V more."""
    board = Board(10e-6, every=60.0)
    said = board.ticks(30, 600.0, battery=(12.0, 11.6))
    assert sum(said) == pytest.approx(20.0)
    assert board.state.drive.volume == pytest.approx(10e-6)
    assert board.state.drive.weak == pytest.approx(2.0)


def test_a_battery_that_only_sags_counts_in_the_volume():
    """Full before, 2 V too low while the pump runs: 15 s, of which all but the first are slower."""
    board = Board(10e-6, every=60.0)
    said = board.ticks(30, 600.0, battery=(14.0, 11.6))
    assert sum(said) == pytest.approx(15.0)
    assert board.state.drive.volume == pytest.approx(0.0 + 13 * 0.6e-6 - 0.6e-6, abs=1e-9)


def test_a_battery_that_is_full_or_more_or_not_measured_changes_nothing():
    plain = Board(10e-6).ticks(70, 600.0)
    for volts in (14.0, 16.0, math.nan):
        board = Board(10e-6)
        assert board.ticks(70, 600.0, battery=(volts, volts - 0.4)) == plain


def test_ticks_of_half_a_second_have_half_of_it_each():
    board = Board(10e-6, every=20.0, tick=0.5)
    said = board.ticks(40, 600.0)
    assert said[:30] == [0.5] * 30
    assert not any(said[30:])
    assert board.state.law.times == 1.0
    board.ticks(1, 600.0)
    assert board.state.law.times == 2.0
    board = Board(100e-6, every=20.0, tick=0.5)
    assert board.ticks(120, 600.0) == [0.5] * 120
    assert board.state.law.times == 1.0


def test_a_float_that_begins_afloat_pumps_a_little_to_be_sure():
    board = Board(0.0, depth=0.1)
    said = board.ticks(60, 0.0)
    assert sum(said) == pytest.approx(32e-6 / delivery(DRIVE, 0.1, 0.0), abs=0.006)
    assert not any(board.ticks(200, 0.0))


def test_the_last_tick_of_a_run_has_what_is_left():
    said = Board(-10.3e-6).ticks(20, 600.0)
    flow = 1e-8 * math.sqrt(1e4 + 1e4 * 500.0)
    assert sum(said) == pytest.approx(-round(10.3e-6 / flow / 0.01) * 0.01)
    assert said[0] == pytest.approx(-0.46)
    assert not any(said[1:])


def test_a_run_that_is_longer_than_the_pause_is_over_before_the_law_is_called_again():
    board = Board(100e-6, every=20.0)
    said = board.ticks(61, 600.0)
    assert said[:60] == [1.0] * 60  # longest_for_law
    assert board.state.law.times == 2.0


def test_a_law_that_asks_for_nothing_sleeps_for_its_pause():
    board = Board(0.0, every=7.5)
    assert not any(board.ticks(25, 600.0))
    assert board.state.law.times == 4.0  # at 0, 8, 16 and 24 s: whole ticks


def test_another_depth_asked_for_wakes_the_law_anew():
    board = Board(0.0, every=600.0)
    board.ticks(10, 600.0)
    assert board.state.law.times == 1.0
    board.ticks(1, 400.0)
    assert board.state.law.times == 1.0  # begun anew, and called once
    assert board.state.drive.clock == 1.0


def test_a_depth_that_is_missing_leaves_the_run_on():
    board = Board(10e-6)
    board.ticks(5, 600.0)
    board.depth = math.nan
    assert board.ticks(12, 600.0) == [1.0] * 10 + [0.0] * 2


def test_at_the_surface_all_volume_goes_out_in_runs_and_then_no_more():
    board = Board(0.0, depth=0.1)
    board.ticks(1, 0.0, volume=-0.5e-4)  # 350 cm3 lack
    board.state = board.state._replace(drive=board.state.drive._replace(volume=-0.5e-4))
    said = board.ticks(2000, 0.0)
    rate = delivery(DRIVE, 0.1, 0.0)
    # the volume is full after (350 + 4 starts of 2 cm3); 30 cm3 more are pumped to be sure
    assert sum(said) * rate == pytest.approx(380e-6 + 8e-6, abs=3e-6)
    assert not any(said[500:])
    assert board.state.drive.volume == 3e-4
    assert board.state.drive.floats == 1.0


def test_a_dive_takes_in_what_it_floats_with_and_more_until_it_sinks():
    board = Board(0.0, depth=0.1)
    board.ticks(100, 0.0)
    flow = valve_rate(DRIVE, 1.0, 0.0)  # the bypass is quicker
    said = board.ticks(60, 50.0)
    assert sum(said) == pytest.approx(-310e-6 / flow, abs=0.01)
    assert board.state.drive.wide == 1.0
    said = board.ticks(60, 50.0)  # still afloat: a little more
    assert sum(said) == pytest.approx(-10e-6 / flow, abs=0.01)
    board.depth = 0.4  # it sinks
    assert not any(board.ticks(60, 50.0))


def test_the_volume_is_that_of_the_runs_or_the_one_measured():
    board = Board(10e-6, every=1000.0)
    board.ticks(1, 600.0)
    before = board.state.drive.volume
    board.ticks(20, 600.0)
    assert board.state.drive.volume - before == pytest.approx(10e-6 - 0.0, abs=0.3e-6)
    for change in (10.3e-6, -10.3e-6):  # with a last tick that is not whole
        board = Board(change, every=1000.0)
        board.ticks(30, 600.0)
        assert board.state.drive.volume == pytest.approx(change, abs=0.12e-6)
    board.ticks(1, 600.0, volume=1.5e-4)
    assert board.state.drive.volume == 1.5e-4


def test_the_clock_of_the_law_begins_anew_before_float32_runs_out_of_it():
    board = Board(0.0, every=600.0)
    board.ticks(1, 600.0)
    board.state = board.state._replace(drive=board.state.drive._replace(clock=2.0**20 - 1.0))
    board.ticks(1, 600.0)
    assert board.state.drive.clock == 2.0**20
    board.ticks(1, 600.0)
    assert board.state.drive.clock == 1.0
    assert board.state.law.times == 1.0
