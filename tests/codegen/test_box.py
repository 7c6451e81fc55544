"""The black box in C: what it keeps over resets and losses of power, and how often it writes."""

import ctypes
import math

import pytest

from swimbladder.codegen.library import write_library
from swimbladder.control.supervisor import Reason
from tests.codegen.build import STRICT, run
from tests.codegen.test_supervised import library

_CALLS = """\
#include "swb_box.h"
#include <string.h>
static swb_vehicle v;
static swb_box b;
static uint8_t store[4096];
static uint32_t writes;
static float volume;
static uint8_t kept(uint16_t at) { return store[at]; }
int begin(int anew, int lost, int keeps)
{
    if (lost != 0) {
        memset(&v, lost, sizeof v);
        memset(&b, lost, sizeof b);
    }
    const bool was_armed = swb_box_begin(&b, anew != 0, keeps ? kept : NULL, (uint8_t)anew);
    swb_vehicle_switch_on(&v, anew != 0, was_armed);
    volume = 8e-6f;
    return was_armed;
}
void arm(void) { swb_vehicle_arm(&v); }
float tick(float depth, int bytes)
{
    const swb_seen seen = {.depth = depth, .depth_age = NAN, .volume = volume, .battery = NAN};
    const float command = swb_vehicle_tick(&v, &seen, 2.0f);
    uint16_t at;
    uint8_t byte;
    volume += 3.33e-6f * command * SWB_TICK_S; /* the piston follows */
    volume = volume > 3.5e-4f ? 3.5e-4f : volume;
    swb_box_tick(&b, &v, &seen, command);
    for (int n = 0; n < bytes && swb_box_save(&b, &at, &byte); ++n) {
        writes += store[at] != byte ? 1u : 0u;
        store[at] = byte;
    }
    return command;
}
int said(int which)
{
    const int all[] = {b.reason, b.reasons, b.earlier, b.earlier_reasons, b.armed, b.resets,
        b.cause, b.count, v.reason, v.reasons, swb_vehicle_armed(&v), SWB_BOX_BYTES, (int)writes};
    return all[which];
}
int row(int n, int which)
{
    const swb_box_row r = swb_box_at(&b, (uint8_t)n);
    const int all[] = {r.depth, r.volume, r.command, r.reason};
    return all[which];
}
void clear(void) { swb_box_clear(&b); }
void blank(int with) { memset(store, with, sizeof store); writes = 0; }
"""
ALL = 10_000  # bytes in a tick


class Board:
    """Vehicle and box in one program; power and resets come from outside."""

    def __init__(self, folder):
        write_library(library(), folder / "library")
        (folder / "calls.c").write_text("#include <math.h>\n" + _CALLS)
        src = folder / "library" / "src"
        flags = [*STRICT, "-O2", "-shared", "-fPIC", "-I", src]
        run("gcc", *flags, *src.glob("*.c"), folder / "calls.c", "-o", folder / "box.so", "-lm")
        self.c = ctypes.CDLL(str(folder / "box.so"))
        self.c.tick.argtypes = [ctypes.c_float, ctypes.c_int]
        self.c.tick.restype = ctypes.c_float

    def power_on(self, keeps=True, lost=0x5A):
        return self.c.begin(0, lost, int(keeps))

    def reset(self, cause=8, lost=0, keeps=True):
        return self.c.begin(cause, lost, int(keeps))

    def dive(self, ticks, depth=2.0, bytes_=ALL):
        for n in range(ticks):
            self.c.tick(depth + 1e-3 * (n % 7), bytes_)

    def __getattr__(self, name):
        names = "reason reasons earlier earlier_reasons armed resets cause count"
        names += " vehicle_reason vehicle_reasons vehicle_armed bytes writes"
        return self.c.said(names.split().index(name))

    def rows(self):
        return [tuple(self.c.row(n, k) for k in range(4)) for n in range(self.count)]


@pytest.fixture(scope="module")
def compiled(gcc, tmp_path_factory):  # noqa: ARG001
    return Board(tmp_path_factory.mktemp("box"))


@pytest.fixture
def board(compiled):
    compiled.c.blank(0xFF)
    compiled.power_on()
    compiled.c.arm()
    return compiled


@pytest.mark.promise("black-box")
def test_a_restart_does_not_overwrite_the_first_reason(board):
    """The supervisor's own is then `restarted`, 0x1; the box says what was first."""
    board.dive(100)
    for _ in range(40):
        board.c.tick(math.nan, ALL)
    assert board.vehicle_reason == board.reason == Reason.DEPTH_MISSING
    first = board.reasons
    board.reset()
    board.dive(3)
    assert (board.vehicle_reason, board.vehicle_reasons & 1) == (Reason.RESTARTED, 1)
    assert board.reason == Reason.DEPTH_MISSING
    assert board.reasons == first | 1
    assert (board.resets, board.cause) == (1, 8)
    assert board.armed


@pytest.mark.parametrize("lost", [0xFF, 0x55, 0x01])
@pytest.mark.promise("black-box")
@pytest.mark.promise("power-under-water")
def test_it_survives_a_loss_of_power(board, lost):
    board.dive(100)
    for _ in range(40):
        board.c.tick(math.nan, ALL)
    rows, reasons = board.rows(), board.reasons
    assert board.power_on(lost=lost)
    assert (board.reason, board.reasons) == (Reason.DEPTH_MISSING, reasons)
    assert board.rows() == rows
    assert not board.vehicle_armed
    for _ in range(20):
        board.c.tick(math.nan, ALL)  # and the sensor is still dead
    assert board.vehicle_armed
    assert board.vehicle_reason == Reason.RESTARTED
    assert board.reason == Reason.DEPTH_MISSING


@pytest.mark.promise("black-box")
def test_a_brown_out_that_costs_the_memory_leaves_what_was_kept(board):
    for _ in range(40):
        board.c.tick(math.nan, ALL)
    board.reset(cause=4, lost=0x33)
    board.dive(2)
    assert board.reason == Reason.DEPTH_MISSING
    assert board.vehicle_reason == Reason.RESTARTED


def test_without_eeprom_a_reset_is_survived_and_a_loss_of_power_is_not(board):
    board.power_on(keeps=False)
    board.c.arm()
    for _ in range(40):
        board.c.tick(math.nan, 0)
    board.reset(keeps=False)
    assert board.reason == Reason.DEPTH_MISSING
    assert not board.power_on(keeps=False)
    assert (board.reason, board.count) == (0, 0)


def test_the_last_minutes_are_there_and_half_of_what_follows(board):
    every, rows = 17, 48
    board.dive(100 * every, depth=2.0)
    for _ in range(60 * every):
        board.c.tick(3.0 if board.reason else math.nan, ALL)
    said = board.rows()
    assert len(said) == rows
    reasons = [row[3] for row in said]
    at = reasons.index(Reason.DEPTH_MISSING)
    assert at == rows // 2
    assert reasons == [0] * at + [Reason.DEPTH_MISSING] * (rows - at)
    unit = library().supervisor.depth.depth_most / 32767.0
    assert said[0][0] * unit == pytest.approx(2.0, abs=0.02)
    assert said[at][0] == -32768  # not a number
    assert said[-1][0] * unit == pytest.approx(3.0, abs=0.02)
    assert said[at + 1][2] == 127  # 12 V


@pytest.mark.promise("black-box")
def test_a_new_dive_keeps_the_reason_of_the_first_that_was_not_cleared(board):
    for kind in (math.nan, 1e6):
        for _ in range(40):
            board.c.tick(kind, ALL)
        board.power_on()
        board.dive(20, depth=0.1)
        assert not board.armed
        board.c.arm()
        board.dive(20)
        assert board.earlier == Reason.DEPTH_MISSING
        assert board.reason == 0
    board.c.clear()
    board.dive(2)
    board.power_on()
    assert (board.earlier, board.earlier_reasons, board.reason) == (0, 0, 0)


@pytest.mark.promise("power-under-water")
def test_a_save_that_the_power_cut_short_counts_as_armed(board):
    board.dive(100)
    for _ in range(17):
        board.c.tick(math.nan, 0)
    assert board.reason
    board.c.tick(math.nan, 12)  # of its bytes
    assert board.power_on()
    assert board.armed


@pytest.mark.parametrize("with_", [0x00, 0xFF, 0x42])
def test_what_another_sketch_left_in_the_eeprom_is_no_black_box(compiled, with_):
    compiled.c.blank(with_)
    assert not compiled.power_on()
    assert (compiled.reason, compiled.armed, compiled.count) == (0, 0, 0)


def test_a_cell_lasts_for_two_years_of_diving(board):
    """100,000 writes a cell; an hour of diving writes each byte a few times."""
    board.dive(1000)
    before, hours = board.writes, 3
    board.dive(hours * 12_000)
    each = (board.writes - before) / board.bytes / hours
    assert 1.0 < each < 6.5
    assert 100_000 / each / 24 / 365 > 1.7
