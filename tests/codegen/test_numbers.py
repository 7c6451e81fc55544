"""The numbers that a library is made around: missions, waits, scales, what is said of a board."""

import math
from dataclasses import astuple, replace
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from swimbladder.codegen import board, golden, library
from swimbladder.codegen.board import BoardAnswer, Difference, FlightAnswer, Spread, Times
from swimbladder.codegen.golden import BoardProgram, Mission, first_rows
from swimbladder.codegen.library import Library, firmware, make_program, meanings, plan_program
from swimbladder.codegen.pool import PoolOptions, board_procedure, in_float32
from swimbladder.codegen.twin import wait_in_ticks
from swimbladder.control.cascade import CascadeParameters
from swimbladder.control.law import NEVER
from swimbladder.control.sea_cascade import sea_cascade_gains
from swimbladder.control.supervisor import Reason, Watched
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import simulate
from tests.vehicles import limited, paper

FEUP, FLOAT = limited(load_vehicle("feup-em")), limited(load_vehicle("example-float"), 72_000.0)


@pytest.fixture(scope="module")
def made():
    return firmware(FEUP, duration=30.0)


def test_the_usual_missions_are_those_of_the_firmware_page():
    """1.5 to 3 m in 1335 ticks; of a float 0 to 100 m and up again in 5401."""
    mission, program = plan_program(FEUP)
    assert mission[:2] == (1.5, 3.0)
    assert mission.ticks(program.tick_s) == 1335
    mission, program = plan_program(FLOAT)
    assert mission[:2] == (0.0, 100.0)
    assert mission.ticks(program.tick_s) == 5401


@pytest.mark.parametrize(
    ("least", "most", "target"),
    [(0.0, 1800.0, 100.0), (0.0, 100.0, 100.0), (0.0, 99.0, 49.5), (60.0, 90.0, 60.0)],
)
def test_a_float_that_may_not_go_so_deep_goes_half_way(least, most, target):
    """But into the depths that its law was tuned for."""
    assert library._usual(True, least, most) == (0.0, pytest.approx(target), 5400.0)


@pytest.mark.parametrize(
    ("least", "most", "usual"),
    [(1.5, 3.0, True), (1.6, 3.0, False), (1.5, 2.9, False), (1.5, 2.99, False)],
)
def test_a_vehicle_steps_from_a_metre_and_a_half_to_three_where_it_may(least, most, usual):
    start, target, duration = library._usual(False, least, most)
    assert ((start, target) == (1.5, 3.0)) == usual
    assert least <= start < target <= most
    assert duration == 400.0


def test_the_command_before_the_first_is_none_or_all_out():
    """0 V and no run of pump and valve; a positioner goes where it makes the vehicle lightest."""
    assert make_program(FEUP, depths=(1.5,)).first == 0.0
    assert make_program(FLOAT, depths=(1.5,)).first == 0.0
    steps = limited(load_vehicle("ntnu-bv"))
    assert make_program(steps, depths=(1.0,)).first == steps.stroke.maximum


@pytest.mark.parametrize(
    ("longest", "missed", "most"), [(10.0, 1, 35), (10.0, 50, 50), (9.0, 1, 31), (0.0, 0, 1)]
)
def test_a_board_waits_for_as_long_as_its_law_and_a_tick_more(longest, missed, most):
    """10 s are 33.3 ticks of 0.3 s; for as long as a command may fail to come at least."""
    law = SimpleNamespace(name="waits", longest_wait=lambda _: longest)
    limits = SimpleNamespace(S_p=0.3, board=SimpleNamespace(missed=missed))
    assert library._most_wait(law, None, limits) == most
    law.longest_wait = None
    assert library._most_wait(law, None, limits) == missed


def test_no_wait_is_longer_than_a_million_ticks():
    limits = SimpleNamespace(S_p=1.0, board=SimpleNamespace(missed=1))
    law = SimpleNamespace(name="waits", longest_wait=lambda _: 999_999.0)
    assert library._most_wait(law, None, limits) == 1_000_000
    law.longest_wait = lambda _: 999_999.5
    with pytest.raises(InputError, match="longer than the board counts") as refused:
        library._most_wait(law, None, limits)
    assert "1e+06 s at most" in refused.value.remedy
    for wait in (1e6, 2e6, math.inf):
        assert wait_in_ticks(np.float32(wait), np.float32(1.0)) == 1_000_000
    assert wait_in_ticks(np.float32(999_999.0), np.float32(1.0)) == 999_999


@pytest.mark.parametrize(
    ("tick", "every", "save"), [(0.3, 17, 118), (1.0, 5, 120), (7.0, 1, 86), (2000.0, 1, 1)]
)
def test_the_black_box_has_a_row_every_5_s_and_is_kept_every_10_min(tick, every, save):
    """In numbers of 16 bits: what a sensor may say, the stroke and a tenth; 8 of the command."""
    limits = supervisor_parameters(FEUP, 0.3)._replace(S_p=tick)
    stroke = SimpleNamespace(minimum=-4e-4, maximum=3e-4)
    box = library._box(SimpleNamespace(stroke=stroke), limits, (-9.0, 12.0))
    assert (box["box_every"], box["box_save"]) == (every, save)
    assert 32767 * box["box_depth"] == pytest.approx(limits.depth.depth_most)
    assert 32767 * box["box_volume"] == pytest.approx(1.1 * 4e-4)
    assert 127 * box["box_command"] == pytest.approx(12.0)
    stroke.minimum = -1e-4
    box = library._box(SimpleNamespace(stroke=stroke), limits, (-14.0, 12.0))
    assert 32767 * box["box_volume"] == pytest.approx(1.1 * 3e-4)
    assert 127 * box["box_command"] == pytest.approx(14.0)


def test_a_board_checks_a_hundred_ticks_and_its_sensors_fail_at_the_end(made):
    """As long as a depth may be missing, and 15 ticks of full buoyancy."""
    gap = made.supervisor.depth.gap
    for most, flown in ((100, 100 - gap - 15), (gap + 16, 1), (3, 1)):
        rows = first_rows(made, made.golden, most)
        assert len(rows) == flown + gap + 15
        assert rows[:flown] == made.golden.checked[:flown]
        assert all(math.isnan(depth) and math.isnan(volume) for depth, volume, *_ in rows[flown:])
        commands, reasons = [row[3] for row in rows], [row[4] for row in rows]
        assert reasons[: flown + gap - 1] == [0] * (flown + gap - 1)
        assert set(reasons[-15:]) == {Reason.DEPTH_MISSING}
        assert set(commands[-15:]) == {12.0}
    text = made.files["examples/GoldenTrace/golden.h"]
    assert sum(line.lstrip().startswith("{0x") for line in text.splitlines()) == 100
    assert len(made.golden.checked) == len(made.golden.depth) + gap + 15


@pytest.mark.parametrize(
    ("deepest", "end", "said"), [(91.0, 0.5, None), (89.0, 0.5, "89 m"), (91.0, 9.0, "9 m")]
)
def test_a_golden_trace_of_a_float_arrives_when_it_was_down_and_comes_up(deepest, end, said):
    """Within a tenth of 100 m, where it was to go, and then at the surface."""
    mission, program = plan_program(FLOAT)
    golden = SimpleNamespace(depth=np.array([0.0, deepest, end]), difference=0.0, apart=0.0)
    given = {name: getattr(program, name) for name in BoardProgram.__dataclass_fields__}
    made = Library(vehicle=FLOAT, mission=mission, golden=golden, pool=None, files={}, **given)
    sentences = made.sentences
    short = [line for line in sentences if "before the vehicle has arrived" in line]
    assert bool(short) == (said is not None)
    assert not short or f"ends at {said}," in short[0]


class Quiet:
    """A board that asks for nothing and has no reason."""

    reason, wide = None, False

    def __call__(self, *_):
        return 0.0


class Surface(NamedTuple):
    shallow: float


class Flown(NamedTuple):
    surface: Surface
    tolerance: float


def dive(monkeypatch, *, duration, tick=1.0, deepest=30.0, double=30.0, shallow=2.0):
    """Return the golden trace of a float whose flight is made up: (trace, asked depths)."""
    asked_for, depths = [], iter([deepest, double])

    def fly(_vehicle, called, *, asked, **_):
        asked_for.append(asked)
        for depth in asked:
            called(None, depth)
        rows = np.zeros((len(asked), 4))
        rows[:, 0] = next(depths)
        return rows

    monkeypatch.setattr(golden, "fly_float", fly)
    monkeypatch.setattr(golden, "unplugged", lambda _, rows: rows)
    surface = Surface(shallow)
    made = SimpleNamespace(
        law=SimpleNamespace(band="tolerance"),
        tick_s=tick,
        drive=object(),
        parameters=Flown(surface, tolerance=10.0),
        board=Quiet,
        in_double=Quiet,
    )
    trace = golden.fly(None, made, Mission(0.0, 100.0, duration), None)
    return trace, asked_for[0]


@pytest.mark.parametrize(
    ("duration", "tick", "ticks"), [(90.0, 1.0, 91), (90.5, 1.0, 92), (0.9, 0.3, 4), (0.1, 1.0, 2)]
)
def test_a_float_is_asked_to_be_down_for_two_thirds_of_its_mission(
    duration, tick, ticks, monkeypatch
):
    trace, asked = dive(monkeypatch, duration=duration, tick=tick, double=29.25)
    assert len(asked) == ticks
    down = asked == 100.0
    assert down.sum() == math.ceil(ticks * 2.0 / 3.0)
    assert down[: down.sum()].all()
    assert not asked[down.sum() :].any()
    assert trace.difference == pytest.approx(0.75)  # from the depths in double precision
    assert trace.reference.dtype == np.float32


def test_a_float_that_rounding_takes_out_of_both_bands_has_no_golden_trace(monkeypatch):
    trace, _ = dive(monkeypatch, duration=90.0, deepest=90.0, double=70.5)
    assert trace.apart == pytest.approx(19.5)
    with pytest.raises(NoAnswerError, match=r"at 90 m on the board \(float32\), and at 69.5 m"):
        dive(monkeypatch, duration=90.0, deepest=90.0, double=69.5)


def test_a_float_that_has_not_dived_has_no_golden_trace(monkeypatch):
    with pytest.raises(NoAnswerError, match="has not dived after 6"):
        dive(monkeypatch, duration=90.0, deepest=2.0)
    dive(monkeypatch, duration=90.0, deepest=2.01, double=2.01)


@pytest.mark.parametrize(
    ("duration", "tick", "ticks"),
    [(90.0, 1.0, 91), (90.5, 1.0, 92), (0.9, 0.3, 4), (36.0, 0.3, 121)],
)
def test_a_float_at_a_board_flies_the_ticks_of_its_golden_mission(
    duration, tick, ticks, monkeypatch
):
    """It is asked for each depth from its share of the ticks on, and ends where its plant did."""
    turns, given = [(0.0, 40.0), (0.4, 20.0), (0.7, 0.0)], {}

    def fly(_vehicle, _board, *, asked, **more):
        given.update(more, asked=asked)
        return np.column_stack([asked, np.zeros((len(asked), 3))])

    monkeypatch.setattr(board, "fly_float", fly)
    flight = SimpleNamespace(
        session=SimpleNamespace(made=SimpleNamespace(drive=object(), tick_s=tick)),
        begin=lambda **_: None,
        advance=None,
        answer=SimpleNamespace(depth=math.nan),
    )
    board._fly_depths(flight, None, Mission(3.0, 40.0, duration), turns, 7)
    at = [max(turn for turn in turns if turn[0] * ticks <= n)[1] for n in range(ticks)]
    assert given["asked"].tolist() == at
    assert (given["tick"], given["start_depth"], given["seed"]) == (tick, 3.0, 7)
    assert flight.answer.depth == at[-1]


def test_a_float_measures_with_the_noise_of_simulate_of_that_seed():
    """Tick by tick, of a float that does nothing; another seed's is another."""
    sensors = FLOAT.sensors.model_copy(update={"depth_noise": 5e-3})
    vehicle, asked = FLOAT.model_copy(update={"sensors": sensors}), np.full(6, 30.0)
    given, noise = {"tick": 1.0, "start_depth": 30.0, "asked": asked}, []
    for seed in (3, 4):
        rows = golden.fly_float(vehicle, lambda *_: (0.0, False), seed=seed, **given)
        noise.append(rows[:, 1] - rows[:, 0])
    seen = []
    flown = simulate(
        vehicle,
        law=lambda measured, _: seen.append(measured.depth) or 0.0,
        sample_time=1.0,
        setpoints=[(0.0, 30.0)],
        start_depth=30.0,
        duration=5.0,
        seed=3,
    )
    same = np.array(seen[:5]) - flown.depth[:5]
    assert noise[0][:5] == pytest.approx(same, abs=1e-9)
    assert np.abs(noise[1][:5] - same).max() > 1e-4


def test_the_median_the_worst_and_the_spread_of_times():
    assert Spread.of([]) is None
    assert Spread.of([1.0, -4.0, 2.0, 1.0]) == pytest.approx((1.0, 4.0, math.sqrt(5.5)))


def test_what_a_flight_and_a_session_say_of_themselves(made):
    flight = FlightAnswer(
        name="golden mission",
        log=Path("x.csv"),
        ticks=100,
        unequal=3,
        reason="leak",
        depth=2.5,
        ended="",
        duration=30.0,
        wall=2.0,
    )
    told = flight.to_dict()
    assert (told["ticks"], told["unequal_ticks"], told["final_depth_m"]) == (100, 3, 2.5)
    assert (told["duration_s"], told["wall_s"], told["first_difference"]) == (30.0, 2.0, None)
    flight.difference = Difference(4, "command", 1.0, 2.0)
    assert flight.to_dict()["first_difference"]["field"] == "command"
    other = FlightAnswer(name="reset", log=Path("y.csv"), duration=10.0, wall=3.0)

    def answer(flights, real_time):
        return BoardAnswer(
            vehicle=FEUP,
            made=made,
            port="p",
            baud=9,
            real_time=real_time,
            flights=flights,
            not_flown=(),
            times=Times(steps=[1e-3, 3e-3], trips=[2e-3], intervals=[1e-4], late=7),
            frames={},
            stack_left=None,
        )

    both = answer((flight, other), False)
    assert (both.equal, both.speed) == (False, pytest.approx(40.0 / 5.0))
    assert answer((other,), True).equal
    told, real = both.to_dict(), answer((other,), True).to_dict()
    assert told["step"] == pytest.approx({"median_s": 2e-3, "worst_s": 3e-3, "jitter_s": 1e-3})
    assert told["round_trip"]["median_s"] == 2e-3
    assert (told["late_ticks"], real["late_ticks"]) == (None, 7)
    assert "interval_error" not in told
    assert real["interval_error"]["worst_s"] == 1e-4


def test_what_a_twin_says_is_what_a_board_says(made):
    """Bit n - 1 of its reasons is reason n; what it counts stays within 16 bits."""
    twin = made.board(made.twin())
    said = board._said(twin, np.float32(1.5))
    assert (said.armed, said.command, said.reasons, said.reason, said.wide) == (True, 1.5, 0, 0, 0)
    state = twin.state
    reasons = (1 << (Reason.LEAK - 1)) | (1 << (Reason.RESTARTED - 1))
    recovery = state.recovery._replace(reason=int(Reason.LEAK), reasons=reasons, release=True)
    twin.state = state._replace(recovery=recovery)
    twin.controller.missed = 70_000
    said = board._said(twin, np.float32(1.5))
    assert (said.reason, said.reasons, said.missed) == (Reason.LEAK, reasons, 65535)
    assert said.release
    assert board._bits(said, "reason") == int(Reason.LEAK)
    nan = [board._bits(said._replace(command=x), "command") for x in (math.nan, -math.nan)]
    assert nan[0] == nan[1] != board._bits(said, "command")
    zero = [board._bits(said._replace(allowed=x), "allowed") for x in (0.0, -0.0)]
    assert zero[0] != zero[1]


def test_a_controller_counts_what_it_misses_until_a_command_comes(made):
    twin = made.controller(made.twin())
    twin.tick(2.0, 0.0, 2.0)
    before = twin.command
    for n, (depth, reference) in enumerate([(math.nan, 2.0), (2.0, math.nan), (math.inf, 2.0)], 1):
        assert twin.tick(depth, 0.0, reference) == before
        assert twin.missed == n
    twin.tick(2.0, 0.0, 2.0)
    assert twin.missed == 0
    fresh = made.controller(made.twin())
    fresh.tick(2.0, math.nan, 2.0)  # nothing to begin with
    assert (fresh.missed, fresh.state, fresh.command) == (1, None, 0.0)


def test_numbers_as_a_board_has_them():
    """Rounded to float32, counts as they are; a limit that is off is none."""
    limits = supervisor_parameters(paper(), 0.3)
    told = in_float32(limits, library.SUPERVISOR)
    assert told["S_p"] == {"value": float(np.float32(0.3)), "unit": "s"}
    assert told["gap"]["value"] == limits.depth.gap
    assert told["depth_most"]["value"] == float(np.float32(limits.depth.depth_most))
    off = limits._replace(depth=limits.depth._replace(gap=NEVER, depth_most=math.inf))
    told = in_float32(off, library.SUPERVISOR)
    assert (told["gap"]["value"], told["depth_most"]["value"]) == (None, None)


def test_pool_numbers_follow_from_pool_stroke_and_trim():
    """More from round to round by even steps; a metre under the bottom is the bottom."""
    vehicle = paper(trim_error=-30e-6)
    limits, p = supervisor_parameters(vehicle, 0.3), plant(vehicle)
    options = PoolOptions(4.5, clearance=0.8, volume_changes=(20e-6, 80e-6), rounds=4)
    found = board_procedure(vehicle, options, limits)
    assert found.shallow == pytest.approx(p.z_surface + 0.8)
    assert found.deep == pytest.approx(4.5 - 0.8)
    assert (found.rounds, found.change, found.more) == pytest.approx((4.0, 20e-6, 20e-6))
    assert (found.depth_least, found.depth_most) == (limits.depth.depth_least, 5.5)
    ends = limits.volume
    assert (found.volume_least, found.volume_most) == (ends.volume_least, ends.volume_most)
    one = board_procedure(
        vehicle, replace(options, rounds=1, volume_changes=(20e-6, 20e-6)), limits
    )
    assert (one.rounds, one.more) == (1.0, 0.0)
    # its supervisor's end lifts it from the bottom, or it goes on to the end stop
    small = PoolOptions(4.5, volume_changes=(1e-6, 1e-6), rounds=1)
    lifts = p.V_0 + limits.neutral.neutral_range + p.psi * 4.5
    for top, end in ((lifts * (1.0 - 1e-9), p.V_max), (lifts * (1.0 + 1e-9), None)):
        high = limits._replace(volume=ends._replace(volume_high=top))
        given = board_procedure(vehicle, small, high)
        assert given.end_volume == (top if end is None else end)


def test_a_pool_day_is_the_papers_where_nothing_else_is_asked_for():
    """Four rounds of 20 to 75 cm3, 75 cm clear of surface and bottom: as the how-to says."""
    assert astuple(PoolOptions(4.5)) == (4.5, 0.75, (20e-6, 75e-6), 4)
    assert PoolOptions(4.5).volumes == "20 to 75 cm3"
    assert PoolOptions(4.5, volume_changes=(20e-6, 20e-6)).volumes == "20 cm3"


def test_a_loop_made_for_want_of_a_cascade_is_slow_against_the_sample_time():
    """A bandwidth of a tenth over it, docs/explanation/laws.md."""
    vehicle = paper(controller=None)
    p = plant(vehicle)
    found = board_procedure(vehicle, PoolOptions(4.5), supervisor_parameters(vehicle, 0.5))
    made = sea_cascade_gains(p.a_b, p.d_l, p.gain, bandwidth=0.1 / 0.5, S_p=0.5)
    assert found.loop == CascadeParameters(*made, 0.5)


@pytest.mark.parametrize(
    ("options", "refused"),
    [
        (PoolOptions(1.81), None),  # 0.31 m between 0.75 m from surface and bottom
        (PoolOptions(1.79), "between the depths of rest"),
        (PoolOptions(0.6, clearance=0.15), None),  # 0.3 m, to the bit
        (PoolOptions(4.5, clearance=0.1001), None),
        (PoolOptions(4.5, clearance=0.1), "rest clear of it"),
        (PoolOptions(4.5, volume_changes=(20e-6, 20e-6), rounds=1), None),
        (PoolOptions(4.5, rounds=-1), "at least 1 "),
    ],
)
def test_room_in_a_pool_to_the_centimetre(options, refused):
    vehicle = paper()
    limits = supervisor_parameters(vehicle, 0.3)
    if refused is None:
        board_procedure(vehicle, options, limits)
        return
    with pytest.raises(InputError, match=refused):
        board_procedure(vehicle, options, limits)


@pytest.mark.parametrize("trim", [-60e-6, 60e-6])
def test_a_change_of_volume_is_as_large_as_stroke_and_trim_leave_room_for(trim):
    """From what is neutral at either depth of rest to the nearer end, less what is not known."""
    vehicle = paper(trim_error=trim)
    limits, psi = supervisor_parameters(vehicle, 0.3), vehicle.hull.psi
    rests = [plant(vehicle).V_0 + psi * z for z in (0.75, 4.5 - 0.75)]
    ends = limits.volume
    room = min(ends.volume_high - max(rests), min(rests) - ends.volume_low)
    room -= limits.neutral.neutral_range
    assert room > 0.0
    for change, refused in ((room * (1.0 - 1e-9), False), (room * (1.0 + 1e-9), True)):
        for pair in ((20e-6, change), (change, 20e-6)):
            options = PoolOptions(4.5, volume_changes=(pair[0], pair[1]))
            if refused:
                with pytest.raises(InputError, match=rf"at most {room * 1e6:.3g} cm3"):
                    board_procedure(vehicle, options, limits)
            else:
                board_procedure(vehicle, options, limits)


def test_a_pool_is_above_where_the_supervisor_brings_the_vehicle_up():
    vehicle = paper()
    limits = supervisor_parameters(vehicle, 0.3)
    for limit, refused in ((4.5, True), (4.51, False)):
        deep = limits._replace(deep=limits.deep._replace(depth_limit=limit))
        if refused:
            with pytest.raises(InputError, match="brings the vehicle up from there"):
                board_procedure(vehicle, PoolOptions(4.5), deep)
        else:
            board_procedure(vehicle, PoolOptions(4.5), deep)


def test_times_are_written_from_counts_of_ticks():
    """A count that is never reached has no time."""
    limits = supervisor_parameters(paper(), 0.3)

    def after(gap):
        changed = limits._replace(depth=limits.depth._replace(gap=gap))
        return {row[0]: row[3] for row in meanings(changed)}[Reason.DEPTH_MISSING]

    assert after(100) == "30 s"
    assert after(NEVER - 1) == f"{(NEVER - 1) * 0.3:.3g} s"
    assert after(NEVER) == "never"


def test_what_a_vehicle_sees_without_battery_and_leak_sensor(made):
    """A twin that `simulate` flies is shown what the sensors of a simulation have."""
    twin = made.board(made.twin())
    seen = []
    twin.spoil = lambda n, watched: seen.append((n, watched)) or watched
    for _ in range(2):
        twin(SimpleNamespace(depth=2.0, volume=1e-6), 2.0)
    assert [n for n, _ in seen] == [0, 1]
    assert seen[0][1][:3] == (2.0, 0.0, 1e-6)
    assert math.isnan(seen[0][1].battery)
    assert seen[0][1][4:7] == Watched(2.0, 0.0, 1e-6, math.nan, False, 0, 0)[4:7]
