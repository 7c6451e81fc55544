"""The library of a float with pump and valve: its C, its twin, its board, its dives."""

import ctypes
import functools
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import swimbladder as sb
from swimbladder.cli import main
from swimbladder.codegen.golden import fly_float
from swimbladder.codegen.library import Library, firmware, plan_program, write_library
from swimbladder.codegen.pool import PoolOptions
from swimbladder.codegen.twin import twin
from swimbladder.control.law import Measurement
from swimbladder.control.pump_valve import DriveState, delivery, valve_rate, weakness
from swimbladder.control.registry import own_law
from swimbladder.control.supervisor import Reason, Watched
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.design.linear.pump_valve import pump_stall
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission, Phase
from swimbladder.physics.buoyancy_engine import at_voltage, drive_map
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.closed_loop.floats import board_law
from swimbladder.sim.engine.rodas.records import Note
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.units import parse_quantity
from swimbladder.vehicle import Oil, PowerLawPump, Sensors, Supervisor
from tests.codegen import chip, cortex, fuzz
from tests.codegen.build import STRICT, Compiled, run
from tests.codegen.laws import bits, flat, split
from tests.codegen.test_library import (
    ARM,
    OTHERS,
    LibraryInC,
    _sketch,
    compile_sketches,
    tried_on,
)
from tests.codegen.test_supervised import VehicleInC, said_by
from tests.vehicles import limited

NOISE = Sensors(depth_noise="3 cm", depth_quantum="1 cm")


def the_float(**changes):
    return load_vehicle("example-float").model_copy(update=changes)


def limited_pump(speed: str):
    """A float whose motor holds a speed as long as the voltage allows: its rate bends there."""
    vehicle = the_float()
    pump = vehicle.actuator.pump.model_copy(update={"speed": parse_quantity(speed, "rad/s")})
    return the_float(actuator=vehicle.actuator.model_copy(update={"pump": pump}))


@functools.cache
def library(noisy: bool = False) -> Library:
    """A dive to 30 m and up again, 25 minutes; with noise, 90 minutes of 100 m."""
    if noisy:
        return firmware(limited(the_float(sensors=NOISE, supervisor=Supervisor(time_limit="2 h"))))
    return firmware(limited(the_float()), step=(0.0, 30.0), duration=1500.0)


def _spoilt(made: Library) -> tuple[list[Watched], list[float]]:
    """What a golden trace's board sees, with odd numbers now and then and no depth at its end."""
    seen, odd = [], [math.nan, math.inf, -math.inf, 1e-45, 3e38]
    for n, depth in enumerate(made.golden.depth):
        seen.append(Watched(float(depth), 0.1, math.nan, 14.0, False, 0, 0))
        if n % 97 == 50:
            seen[-1] = seen[-1]._replace(depth=odd[n % 5], depth_age=odd[n % 3], lost=n % 2)
        if n >= len(made.golden.depth) - 100:
            seen[-1] = seen[-1]._replace(depth=math.nan)
    return seen, [float(x) for x in made.golden.reference]


@pytest.fixture(scope="module")
def in_c(gcc, tmp_path_factory) -> VehicleInC:  # noqa: ARG001
    return VehicleInC(library(), tmp_path_factory.mktemp("float"))


REASONS: list[tuple[Reason, dict[str, Any], int]] = [
    (Reason.LEAK, {"leak": True}, 3),
    (Reason.DEPTH_LIMIT, {"depth": 1801.0}, 1800),
    (Reason.DEPTH_MISSING, {"depth": math.nan}, 6),
    (Reason.DEPTH_IMPOSSIBLE, {"depth": 5000.0}, 6),
    (Reason.DEPTH_LATE, {"depth_age": 60.0}, 6),
    (Reason.BATTERY_LOW, {"battery": 11.0}, 11),
    (Reason.TICKS_LOST, {"lost": 3}, 30),
]
"""A reason, what the board sees then, and within how many ticks it is found."""


class TestSeconds:
    def test_the_rates_are_those_of_the_pump_and_the_valves(self):
        vehicle = the_float()
        law, numbers = own_law(vehicle, sampled=False)
        p = board_law(vehicle, law, numbers, 1.0, deepest=2000.0).parameters.drive
        depth = np.linspace(0.0, 2000.0, 37)
        drive = drive_map(vehicle, depth * vehicle.water.specific_weight, power=False)
        for n, z in enumerate(depth):
            assert delivery(p, z, 0.0) == pytest.approx(drive.rate_out[n], rel=1e-9)
            assert valve_rate(p, 0.0, z) == pytest.approx(drive.rate_in[n], rel=1e-9)
            assert valve_rate(p, 1.0, z) == pytest.approx(drive.bypass_in[n], rel=1e-9)

    @pytest.mark.parametrize("share", [0.8, 0.9, 0.95])
    def test_a_low_battery_is_that_of_the_pump_and_shows_alike_at_rest_and_under_load(self, share):
        """The delivery by the physics of a motor at a lower voltage, to a percent."""
        vehicle = the_float()
        law, numbers = own_law(vehicle, sampled=False)
        p = board_law(vehicle, law, numbers, 1.0, deepest=2000.0).parameters.drive
        volts = share * vehicle.supply.voltage
        low = at_voltage(vehicle, volts)
        state = DriveState(**dict.fromkeys(DriveState._fields, 0.0))
        for z in (0.0, 400.0, 1500.0, 2000.0):
            drive = drive_map(low, [z * vehicle.water.specific_weight])
            sags = vehicle.supply.internal_resistance * float(drive.power_out[0]) / volts
            resting = weakness(p, state._replace(last=z), volts)
            running = state._replace(last=z, run=9.0, ran=3.0, since=3.0)
            for weak in (resting, weakness(p, running, volts - sags)):
                assert delivery(p, z, weak) == pytest.approx(drive.rate_out[0], rel=0.01)
            assert abs(delivery(p, z, 0.0) / drive.rate_out[0] - 1.0) > 0.04  # a full one's

    def test_a_run_is_as_long_as_the_pump_may_run_or_takes_twice_the_stroke(self):
        vehicle = the_float()
        law, numbers = own_law(vehicle, sampled=False)
        for given in (300.0, None):
            actuator = vehicle.actuator.model_copy(update={"longest_run": given})
            other = vehicle.model_copy(update={"actuator": actuator})
            p = board_law(other, law, numbers, 1.0, deepest=1000.0).parameters.drive
            depth = np.linspace(0.0, 1000.0, 201)
            least = drive_map(other, depth * other.water.specific_weight, power=False).rate_out
            stroke = other.stroke.maximum - other.stroke.minimum
            assert p.longest == pytest.approx(given or 2.0 * stroke / least.min(), rel=1e-3)

    def test_the_pump_counts_on_down_to_where_it_surely_delivers(self):
        """At the least voltage, 0.9 of 0.95 of the depth where it stalls, found by the solver."""
        own = the_float()
        hull = own.hull.model_copy(update={"depth_limit": None})
        vehicle = own.model_copy(update={"hull": hull})
        low = at_voltage(vehicle, 0.8 * vehicle.supply.voltage)
        sure = 0.9 * 0.95 * pump_stall(low, depth=0.0).holding_depth
        p = supervisor_parameters(vehicle, 1.0).deep
        assert p.depth_limit == pytest.approx(sure, abs=5.0)  # its table's step
        head = np.array([sure * vehicle.water.specific_weight])
        assert p.turn_rate == pytest.approx(drive_map(low, head, power=False).rate_out[0], rel=0.01)

    def test_a_rate_that_bends_is_within_the_error_that_is_stated(self):
        vehicle = limited_pump("520 rad/s")
        law, numbers = own_law(vehicle, sampled=False)
        board = board_law(vehicle, law, numbers, 1.0, deepest=2000.0)
        depth = np.linspace(0.0, 2000.0, 4001)
        true = drive_map(vehicle, depth * vehicle.water.specific_weight, power=False).rate_out
        found = np.array([delivery(board.parameters.drive, z, 0.0) for z in depth])
        off = np.max(np.abs(found / true - 1.0))
        assert 1e-4 < board.rate_error < 0.02
        assert off <= 1.02 * board.rate_error

    def test_what_a_start_loses_to_the_line_is_made_up_for(self):
        line = Oil(volume="100 cm3", bulk_modulus="1.5 GPa", trapped_air="0.1 %")
        vehicle = the_float()
        vehicle = the_float(actuator=vehicle.actuator.model_copy(update={"line": line}))
        law, numbers = own_law(vehicle, sampled=False)
        board = board_law(vehicle, law, numbers, 1.0, deepest=1500.0)
        p = board.parameters.drive
        for z in (0.0, 300.0, 1500.0):
            x = z * p.per_depth
            short = p.short_0 + x * (p.short_1 + x * p.short_2)
            pressure = [z * vehicle.water.specific_weight]
            true = drive_map(vehicle, pressure, power=False).start_volume[0]
            assert short == pytest.approx(true, abs=1.02 * board.start_error + 1e-12)
        assert 0.0 < board.start_error < 0.5e-6

    def test_the_board_runs_pump_and_valve_as_the_simulator_of_missions_does(self):
        """A dive to 300 m and up: each run begins at the same second and is as long."""
        vehicle = the_float()
        phases = (
            Phase(kind="descend", depth=300.0, timeout=7200.0),
            Phase(kind="surface", duration=9.0),
        )
        flown = fly_mission(
            vehicle, Mission(phases=phases, cycles=1), uniform_column(vehicle.water, 600.0)
        )
        what, time, number = (flown.notes[k] for k in ("what", "t", "number"))
        begun = time[np.isin(what, (Note.PUMP, Note.VALVE, Note.BYPASS))]
        length = number[what == Note.RUN_OVER]
        up = time[what == Note.ARRIVED][0]
        board = chip.twin_of(library())

        def tick(seen, reference):
            command = board.tick(seen.depth, seen.volume, reference)
            return float(command), board.state.drive.wide > 0.0

        n = int(begun[-1]) + 10
        asked = np.where(np.arange(n) < up, 300.0, 0.0)
        ran = fly_float(vehicle, tick, tick=1.0, start_depth=0.0, asked=asked)[:, 3]
        starts = np.flatnonzero((ran != 0.0) & (np.r_[0.0, ran[:-1]] == 0.0))
        sums = np.abs([part.sum() for part in np.split(ran, starts)[1:]])
        assert len(starts) == len(begun) > 8
        np.testing.assert_allclose(starts, begun, atol=1.0)
        np.testing.assert_allclose(sums[:-1], length[: len(sums) - 1], atol=1.01e-3)
        assert np.all(np.abs(ran) <= 1.0)


class TestTheC:
    def test_it_gives_the_golden_trace_to_the_bit_with_any_compiler(self, gcc, tmp_path):  # noqa: ARG002
        write_library(library(), tmp_path)
        sources = [tmp_path / "extras" / "check.c", *(tmp_path / "src").glob("*.c")]
        run(
            "gcc", *STRICT, "-O2", "-I", tmp_path / "src", *sources, "-o", tmp_path / "check", "-lm"
        )
        said = run(tmp_path / "check", cwd=tmp_path).stdout.decode()
        assert said == "golden trace: equal, 1521 of 1521 ticks the same\n"

    def test_the_golden_mission_dives_and_comes_up(self):
        golden = library().golden
        assert golden.depth.max() == pytest.approx(30.0, abs=12.0)
        assert golden.depth[-1] < 1.0
        assert golden.difference < 0.01
        assert {-1.0, 1.0} <= set(np.sign(golden.command))

    @pytest.mark.prove
    def test_law_and_supervisor_agree_over_a_long_dive_with_noise(self, gcc, tmp_path):  # noqa: ARG002
        made, other = library(noisy=True), VehicleInC(library(noisy=True), tmp_path)
        twin = chip.vehicle_twin(made)
        rng = np.random.default_rng(5)
        for n, (depth, _, asked, _) in enumerate(zip(*made.golden[:4], strict=True)):
            blind = 700 <= n < 703 or rng.random() < 0.01
            seen = Watched(math.nan if blind else float(depth), 0.1, math.nan, 14.0, False, 0, 0)
            expected = said_by(twin, seen, asked)
            assert bits(other.tick(seen, asked)[0]) == bits(expected[0]), n
        assert twin.reason is None

    @pytest.mark.parametrize(
        ("reason", "spoilt", "within"), REASONS, ids=[reason.name for reason, *_ in REASONS]
    )
    @pytest.mark.promise("pump-and-valve")
    def test_each_reason_brings_it_up_by_its_pump(self, in_c, reason, spoilt, within):
        """A valve that is open closes at once, since the pump is commanded."""
        made, twin = library(), chip.vehicle_twin(library())
        in_c.begin(anew=False)
        healthy = Watched(50.0, 0.1, math.nan, 14.0, False, 0, 0)
        after, depth, asked = None, 50.0, 80.0
        if reason is Reason.DEPTH_LIMIT:
            asked = 1900.0  # so that it comes nearer on its way
        for n in range(2000):
            bad = spoilt if n >= 100 else {}
            if reason is Reason.DEPTH_LIMIT and bad:
                depth = min(depth + 1.0, bad["depth"])
                bad = {"depth": depth}
            seen = healthy._replace(**bad)
            expected, said = said_by(twin, seen, asked), in_c.tick(seen, asked)
            assert bits(said[0]) == bits(expected[0])
            assert said[1:] == expected[1:]
            if after is None and said[1]:
                after = n - 100
                assert said[0] == made.tick_s
            if after is not None and n > 100 + after + 20:
                break
        assert twin.reason is reason
        assert after is not None
        assert after <= within

    @pytest.mark.promise("restarted", faults=["board resets"])
    @pytest.mark.promise("time-limit")
    def test_a_time_limit_and_a_reset_bring_it_up(self, gcc, tmp_path):  # noqa: ARG002
        made = firmware(
            limited(the_float(supervisor=Supervisor(time_limit="300 s"))),
            step=(0.0, 30.0),
            duration=300.0,
        )
        other, twin = VehicleInC(made, tmp_path), chip.vehicle_twin(made)
        seen = Watched(50.0, 0.1, math.nan, 14.0, False, 0, 0)
        for n in range(330):
            assert other.tick(seen, 50.0) == said_by(twin, seen, 50.0)
            assert (twin.reason is Reason.TIME_LIMIT) == (n >= 300)
        other.begin(anew=True)
        anew = chip.vehicle_twin(made, after_reset=True)
        assert other.tick(seen, 50.0) == said_by(anew, seen, 50.0)
        assert anew.reason is Reason.RESTARTED
        assert other.tick(seen, 50.0)[0] == 1.0


class TestTheDive:
    @pytest.mark.parametrize(
        ("fault", "reason"),
        [({"depth": math.nan}, Reason.DEPTH_MISSING), ({"leak": True}, Reason.LEAK)],
    )
    @pytest.mark.promise("pump-and-valve", faults=["depth NaN"])
    def test_a_float_that_has_a_reason_surfaces_with_all_its_volume(self, fault, reason):
        """In the plant of missions, from 100 m, sinking, by the pump alone."""
        made, vehicle = library(), the_float()
        board = chip.vehicle_twin(made)

        def tick(measured, asked):
            seen = Watched(measured.depth, 0.0, math.nan, 14.0, False, 0, 0)
            spoilt = seen._replace(**fault) if measured.time >= 900.0 else seen
            return float(board.tick(spoilt, asked)), board.wide

        rows = fly_float(vehicle, tick, tick=1.0, start_depth=0.0, asked=np.full(4000, 200.0))
        assert rows[890, 0] > 60.0
        assert board.reason is reason
        assert rows[-1, 0] < 0.5
        assert rows[-1, 2] == pytest.approx(vehicle.stroke.maximum, abs=1e-6)

    @pytest.mark.parametrize("stuck", ["depth", pytest.param("pump", marks=pytest.mark.prove)])
    @pytest.mark.promise("comes-nearer", faults=["depth stuck", "actuator stalled"])
    def test_what_stands_still_is_noticed_by_the_way_that_is_not_made(self, stuck):
        """A depth that stays on the way down; a pump that delivers nothing once it is to come up.

        The law is asked every 60 s at the seldomest: 8 times are 480 s.
        """
        board, vehicle, kept = chip.vehicle_twin(library()), the_float(), []
        turns = np.where(np.arange(6000) < 2500, 120.0, 20.0)
        found = []

        def tick(measured, asked):
            seen = Watched(measured.depth, 0.0, math.nan, 14.0, False, 0, 0)
            if stuck == "depth" and measured.depth > 60.0:
                kept.append(seen.depth)
                seen = seen._replace(depth=kept[0])
            command = float(board.tick(seen, asked))
            if board.reason and not found:
                found.append(measured.time)
            if stuck == "pump" and measured.time > 2500.0:
                command = min(command, 0.0)
            return command, board.wide

        rows = fly_float(vehicle, tick, tick=1.0, start_depth=0.0, asked=turns)
        assert board.reason is Reason.NOT_MOVING_AS_MODELLED
        begin = np.argmax(rows[:, 0] > 60.0) if stuck == "depth" else 2500.0
        assert 470.0 < found[0] - begin < 600.0
        if stuck == "depth":
            assert rows[:, 0].max() < 400.0
            assert rows[-1, 0] < 0.5

    @pytest.mark.promise("depth-limit")
    def test_a_float_that_passes_its_depth_limit_turns_round_above_the_deepest(self):
        """Asked for more than the limit, at twice the speed of its law."""
        vehicle = the_float(supervisor=Supervisor(depth_limit="150 m"))
        made = firmware(limited(vehicle), step=(0.0, 100.0), duration=300.0)
        board = chip.vehicle_twin(made)

        def tick(measured, asked):
            seen = Watched(measured.depth, 0.0, math.nan, 14.0, False, 0, 0)
            return float(board.tick(seen, asked)), board.wide

        depth = fly_float(vehicle, tick, tick=1.0, start_depth=0.0, asked=np.full(6000, 400.0))[
            :, 0
        ]
        assert board.reason is Reason.DEPTH_LIMIT
        assert 150.0 < depth.max() < 175.0
        assert depth[-1] < 0.5

    def test_simulate_flies_the_board_tick_by_tick(self):
        """Law and supervisor in the loop do what those of the board do that is flown beside it."""
        vehicle = the_float(supervisor=Supervisor(time_limit="2 h"))
        board = firmware(vehicle, step=(0.0, 100.0), duration=300.0).in_double()
        asked = np.where(np.arange(9001) < 4000, 100.0, 20.0)

        def tick(seen, reference):
            return float(board(seen, reference)), board.wide

        rows = fly_float(vehicle, tick, tick=1.0, start_depth=0.0, asked=asked)
        turns = [(0.0, 100.0), (4000.0, 20.0)]
        flown = sb.simulate(vehicle, setpoints=turns, duration=9000.0, start_depth=0.0)
        assert board.reason is Reason.TIME_LIMIT is flown.alarm.reason
        assert flown.alarm.time == pytest.approx(7200.0, abs=1.0)
        assert set(flown.drive) >= {0.0, 1.0, 2.0}
        np.testing.assert_allclose(flown.depth, rows[:, 0], rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(flown.volume, rows[:, 2], rtol=0.0, atol=1e-12)
        alone = sb.simulate(
            vehicle, setpoints=turns, duration=9000.0, start_depth=0.0, supervised=False
        )
        assert alone.alarm is None
        assert alone.depth[-1] > 10.0 > flown.depth[-1]

    def test_an_ensemble_flies_the_board_in_every_lane(self):
        vehicle = the_float(supervisor=Supervisor(time_limit="1 h"))
        given = {"setpoints": [(0.0, 100.0)], "duration": 5400.0, "start_depth": 0.0}
        pump = np.array([1.0, 0.8, 1.0])
        many = sb.simulate_ensemble(
            vehicle, count=3, vary={"pump": pump}, keep="trajectory", **given
        )
        one = sb.simulate(vehicle, **given)
        assert np.all(many["alarm"] == Reason.TIME_LIMIT)
        assert np.array_equal(many["depth"].sel(lane=0), one.depth)
        assert np.array_equal(many["depth"].sel(lane=2), one.depth)
        assert not np.array_equal(many["depth"].sel(lane=1), one.depth)

    def test_a_function_is_not_flown_as_the_law_of_a_board(self):
        vehicle = the_float(supervisor=Supervisor(time_limit="1 h"))
        given = {"setpoints": [(0.0, 100.0)], "duration": 60.0, "start_depth": 0.0}
        with pytest.raises(InputError, match="takes seconds of pump and valve"):
            sb.simulate(vehicle, law=lambda *_: 0.0, supervised=True, **given)

    @pytest.mark.promise("no-false-alarm")
    def test_no_reason_in_health_with_noise(self):
        made = library(noisy=True)
        board = chip.vehicle_twin(made)
        for depth, _, asked, command in zip(*made.golden[:4], strict=True):
            seen = Watched(float(depth), 0.1, math.nan, math.nan, False, 0, 0)
            assert bits(board.tick(seen, asked)) == bits(command)
        assert board.reason is None


class DriveInC:
    """swb_drive, compiled for this machine, and its clock."""

    def __init__(self, folder: Path) -> None:
        write_library(library(), folder)
        (folder / "size.c").write_text(
            '#include "swb_drive.h"\nint size(void) { return (int)sizeof(swb_drive); }\n'
        )
        sources = [folder / "src" / "swb_drive.c", folder / "size.c"]
        run(
            "gcc",
            *STRICT,
            "-O2",
            "-shared",
            "-fPIC",
            "-I",
            folder / "src",
            *sources,
            "-o",
            folder / "d.so",
        )
        self.c = ctypes.CDLL(str(folder / "d.so"))
        pointer, clock = ctypes.c_void_p, ctypes.c_uint32
        self.c.swb_drive_begin.argtypes = [pointer, clock]
        self.c.swb_drive_command.argtypes = [pointer, ctypes.c_float, ctypes.c_bool, clock]
        self.c.swb_drive_outputs.argtypes = [pointer, clock]
        self.c.swb_drive_outputs.restype = ctypes.c_uint8
        self.room = ctypes.create_string_buffer(self.c.size())
        self.now = 0xFFF00000  # goes over its end soon
        self.c.swb_drive_begin(ctypes.addressof(self.room), self.now)

    def command(self, seconds: float, *, wide: bool = False) -> None:
        self.c.swb_drive_command(ctypes.addressof(self.room), seconds, wide, self.now % 2**32)

    def outputs(self, us: int) -> int:
        self.now += us
        return self.c.swb_drive_outputs(ctypes.addressof(self.room), self.now % 2**32)

    def wait(self, seconds: float) -> list[int]:
        """Return the outputs of each of the milliseconds that pass."""
        return [self.outputs(1000) for _ in range(round(1000 * seconds))]


@pytest.fixture
def pins(gcc, tmp_path) -> DriveInC:  # noqa: ARG001
    return DriveInC(tmp_path)


PUMP, VALVE, BYPASS = 1, 2, 4


class TestThePins:
    def test_a_run_is_as_long_as_its_seconds_without_a_gap(self, pins):
        pins.wait(0.3)
        said = []
        for seconds in (1.0, 1.0, 1.0, 0.25, 0.0):
            pins.command(seconds)
            said += pins.wait(1.0)
        assert said.index(0) == pytest.approx(3250, abs=1)
        assert sum(x == PUMP for x in said) == pytest.approx(3250, abs=1)

    def test_never_two_at_a_time_and_a_hold_off_between(self, pins):
        pins.wait(0.3)
        pins.command(-1.0, wide=True)
        said = pins.wait(0.5)
        pins.command(1.0)  # the supervisor takes over in the midst of it
        said += pins.wait(1.6)
        assert set(said) == {0, PUMP, BYPASS}
        off = said.index(0)
        assert off == 500  # at once
        assert said[off:].index(PUMP) == pytest.approx(200, abs=1)
        assert sum(x == PUMP for x in said) == pytest.approx(1000 + 250, abs=2)  # and the grace

    def test_a_run_that_a_hold_off_delays_is_as_long(self, pins):
        pins.command(0.5)
        pins.wait(0.9)
        pins.command(-0.9)
        said = pins.wait(1.0)
        pins.command(0.0)
        said += pins.wait(1.0)
        assert sum(x == VALVE for x in said) == pytest.approx(900, abs=2)

    def test_without_further_commands_all_goes_off(self, pins):
        pins.wait(0.3)
        pins.command(1.0)
        said = pins.wait(5.0)
        assert sum(x == PUMP for x in said) == pytest.approx(1250, abs=2)

    def test_a_reset_ends_a_run_and_a_number_that_is_none_begins_none(self, pins):
        pins.wait(0.3)
        pins.command(-1.0)
        assert pins.outputs(1000) == VALVE
        pins.c.swb_drive_begin(ctypes.addressof(pins.room), pins.now % 2**32)
        assert not any(pins.wait(2.0))
        pins.command(math.nan)
        assert not any(pins.wait(2.0))
        pins.command(1e9)
        assert sum(x == PUMP for x in pins.wait(5.0)) == pytest.approx(1250, abs=2)


@pytest.mark.parametrize(
    ("depths", "target"),
    [(None, 100.0), ((0.0, 150.0), 100.0), ((300.0, 900.0), 300.0), ((0, 60), 30)],
)
def test_the_first_depth_is_one_that_the_law_was_tuned_for(depths, target):
    vehicle = limited(load_vehicle("example-float"))
    own = vehicle.controller.model_copy(update={"depths": depths})
    mission, _ = plan_program(vehicle.model_copy(update={"controller": own}))
    assert mission.target == target


@pytest.mark.usefixtures("gcc")
class TestTheSketch:
    @pytest.mark.parametrize("board", ["FloatAVR", "FloatESP32RP2040"])
    def test_it_dives_by_itself_and_logs_what_identify_reads(self, board, tmp_path):
        made = library()
        text = made.files[f"examples/{board}/{board}.ino"]
        assert text.count("FILL IN") == 2
        filled = text.replace("return NAN; // (pressure", "return 2.5f; // (pressure")
        filled = filled.replace(f"tick >= {600}ul", "tick >= 2ul")
        printed = _sketch(made, tmp_path, board, filled, ARM)
        (tmp_path / "log.csv").write_text(printed)
        log = sb.read_log(tmp_path / "log.csv")
        lines = [line for line in printed.splitlines() if line[0] not in "#t"]
        assert printed.splitlines()[6] == (
            "time_s,depth_m,volume_m3,run_s,reference_depth_m,supervisor_reason"
        )
        np.testing.assert_allclose(np.diff(log.time), 1.0, atol=1.01e-3)
        assert np.all(log.depth == 2.5)
        runs = [float(line.split(",")[3]) for line in lines]
        # launched with all volume out: the pump makes sure of it, then the bypass opens
        assert runs[0] == 1.0
        assert log.volume[0] == pytest.approx(3e-4)

    @pytest.mark.parametrize("chip", OTHERS)
    def test_on_another_processor(self, chip, tmp_path):
        board = "FloatESP32RP2040"
        text = library().files[f"examples/{board}/{board}.ino"]
        said = tried_on(library(), chip, board, text, tmp_path)
        assert "# full buoyancy: depth missing" in said

    def test_as_it_is_shipped_it_sees_nothing_and_pumps(self, tmp_path):
        made = library()
        text = made.files["examples/FloatAVR/FloatAVR.ino"]
        said = _sketch(made, tmp_path, "FloatAVR", text, ARM).splitlines()
        (row,) = [n for n, line in enumerate(said) if line.startswith("# full")]
        assert said[row] == "# full buoyancy: depth missing"
        after = [line.split(",") for line in said[row + 1 :]]
        assert {line[3] for line in after} == {"1.000"}
        assert {line[-1] for line in after} == {"4"}


@pytest.mark.usefixtures("qemu")
@pytest.mark.parametrize(
    "core",
    [c if c == "cortex-m3" else pytest.param(c, marks=pytest.mark.prove) for c in cortex.CORES],
)
class TestTheCortexM:
    def test_the_golden_trace_is_equal(self, core, tmp_path):
        made = library(noisy=True)
        write_library(made, tmp_path)
        check, golden = tmp_path / "extras" / "check.c", tmp_path / "extras" / "golden.csv"
        said = cortex.execute(made, tmp_path, core, check, golden)
        assert said == "golden trace: equal, 5421 of 5421 ticks the same\n"

    def test_law_and_supervisor_are_those_of_the_twin_to_the_bit(self, core, tmp_path):
        made, twin = library(), chip.vehicle_twin(library())
        seen, asked = _spoilt(made)
        for n, said in enumerate(cortex.answers(made, tmp_path, core, seen, asked)):
            command = twin.tick(seen[n], asked[n])
            assert bits(*said) == bits(command, twin.state.recovery.reasons), n
        assert twin.reason is Reason.DEPTH_MISSING


EMPTY_BOX = (
    "# black box: none 0x0000, starts while armed: {}, cause of the last one: {}, "
    "an earlier dive: none 0x0000"
)


@pytest.mark.usefixtures("qemu")
@pytest.mark.promise("black-box")
def test_a_board_without_arduino_runs_pump_and_valves(tmp_path):
    """On an emulated Cortex-M3: what the log commands is what its pins were on for."""
    made = library()
    write_library(made, tmp_path)
    board = tmp_path / "extras" / "board.c"
    said = cortex.execute(made, tmp_path, "cortex-m3", cortex.HERE / "board.c", more=[board])
    flown, last, after = re.split(r"^(# on: .*\n)", said, flags=re.MULTILINE)
    (tmp_path / "log.csv").write_text(flown)
    log = sb.read_log(tmp_path / "log.csv")
    assert np.all(np.diff(log.time) == 1.0)
    box, _, *lines = flown.splitlines()
    assert box == EMPTY_BOX.format(0, 0)
    rows = [line.split(",") for line in lines]
    run = np.array([float(row[3]) for row in rows])
    pump, valve, bypass, both = map(int, re.findall(r"\d+", last))
    assert both == 0
    assert valve == 0
    assert pump == pytest.approx(1000.0 * run[run > 0.0].sum(), abs=1300)  # less the last tick's
    assert bypass == pytest.approx(-1000.0 * run[run < 0.0].sum(), abs=20)
    assert bypass > 10_000
    assert rows[-1][1] == "nan"
    assert rows[-1][-1] == "4"
    assert run[-1] == 1.0
    twin = chip.vehicle_twin(made)
    for n, row in enumerate(rows):
        seen = Watched(float(row[1]), math.nan, math.nan, math.nan, False, 0, 0)
        assert float(twin.tick(seen, float(row[4]))) == pytest.approx(run[n], abs=5.1e-4), n
    boxes = re.split(r"^(?=# black box: )", after, flags=re.MULTILINE)[1:]
    missing = "# black box: depth missing 0x0008, starts while armed: {}, cause of the last one: {}"
    for box, start, cause in zip(boxes, (1, 2), (0, 8), strict=False):
        first, *kept = box.splitlines()
        assert first == missing.format(start, cause) + ", an earlier dive: none 0x0000"
        kept = [line.split(",") for line in kept if line.startswith("# box: ")]
        assert len(kept) == 48
        assert kept[-1][0] == "# box: 0 s"
        assert [float(line[1]) for line in kept[:20]] == pytest.approx([0.5] * 20, abs=0.05)
        (found,) = [n for n in range(1, 48) if kept[n][4] == "4" and kept[n - 1][4] == "0"]
        assert 20 < found < 30  # half of it is what was before
        assert kept[found][1] == "nan"
        assert float(kept[found][3]) == 1.0  # the pump, of the whole tick
    assert boxes[2].strip() == EMPTY_BOX.format(0, 8)


def test_random_numbers_give_the_same_bits(gcc, tmp_path):  # noqa: ARG001
    """Any parameters, state and depth, NaN, infinities and subnormals among them."""
    made, rng = library(), np.random.default_rng(11)
    law, compiled = twin(made.law), Compiled(made.law, tmp_path)
    p = np.array(flat(made.parameters), "f4")
    state = made.law.initial(made.parameters, Measurement(0.0, 9.0, math.nan), 60.0)
    odd = np.array([np.nan, np.inf, -np.inf, -0.0, 1e-45, 3e38, 0.0, 1.0], "f4")
    for n in range(900):
        frame = np.r_[p, np.array(flat(state), "f4"), rng.uniform(-5.0, 90.0, 4).astype("f4")]
        if n % 3 == 1:
            frame = (frame * rng.uniform(0.5, 1.5, len(frame))).astype("f4")
            at = rng.random(len(frame)) < 0.1
            frame[at] = rng.choice(odd, at.sum())
        elif n % 3 == 2:
            frame = rng.integers(0, 2**32, len(frame), np.uint32).view("f4")
        given, before, seen, reference = split(made.law, list(frame))
        expected = law.step(given, before, seen, reference)
        said = compiled.step(given, before, seen, reference)
        assert bits(said[0], *flat(said[1]), said[2]) == bits(*flat(*expected)), n
        first = compiled.initial(given, seen, reference)
        assert bits(*flat(first)) == bits(*flat(law.initial(given, seen, reference)))
        state = expected[1] if n % 3 == 0 else state


@pytest.mark.usefixtures("gcc")
def test_random_bytes_break_nothing(tmp_path):
    """Under the address and undefined-behaviour sanitizers; see `fuzzing/harness.c`."""
    program = fuzz.build(library(), tmp_path, "random")
    assert run(program, "2000", "1").stdout == b"2000 runs\n"


@pytest.mark.usefixtures("cppcheck")
def test_it_pleases_cppcheck(tmp_path):
    write_library(library(), tmp_path)
    run(
        "cppcheck",
        "--quiet",
        "--enable=warning,style,performance,portability",
        "--error-exitcode=1",
        "--std=c99",
        "--suppress=missingIncludeSystem",
        tmp_path / "src",
    )


def test_the_mission_of_the_sketch_is_that_of_its_readme():
    """Ten minutes to put it into the water and an hour below, in ticks of a second."""
    files = library().files
    waits, below = (
        int(re.search(pattern, files["README.md"])[1])
        for pattern in (r"it waits for (\d+) minutes", r"asks for 30 m for (\d+) minutes")
    )
    assert (waits, below) == (10, 60)
    (sketch,) = (text for name, text in files.items() if name.endswith("FloatAVR.ino"))
    assert "tick >= 600ul && tick < 4200ul ? 30.0f : 0.0f" in sketch


@pytest.mark.avr
@pytest.mark.usefixtures("avr")
class TestTheChip:
    @pytest.mark.parametrize("mcu", chip.MCUS)
    def test_the_sketches_compile(self, mcu, tmp_path):
        compile_sketches(library(), tmp_path, mcu)

    def test_dive_and_way_up_are_those_of_the_twin_to_the_bit(self, tmp_path):
        """Every tick of law and supervisor on the ATmega2560; at the end the depth is missing."""
        made = library()
        on_chip, twin = chip.vehicle(made, tmp_path, "atmega2560"), chip.vehicle_twin(made)
        for one, reference in zip(*_spoilt(made), strict=True):
            said = on_chip.answer(*one[:6], reference)
            expected = twin.tick(one, reference)
            assert bits(*said) == bits(expected, twin.state.recovery.reasons)
        assert twin.reason is Reason.DEPTH_MISSING
        stack = on_chip.close()
        assert on_chip.size.variables + stack < 8192
        assert max(on_chip.cycles) < 1_600_000  # a tenth of its second
        page = (Path(__file__).parents[2] / "docs/reference/boards.md").read_text(encoding="utf-8")
        (said,) = re.findall(r"^\| rate \| \d+ \| (\d+) \|", page, re.MULTILINE)
        assert on_chip.size.flash == pytest.approx(int(said), rel=0.2)


def test_a_pump_that_stalls_limits_the_depth():
    vehicle = the_float()
    pump = PowerLawPump(
        delivery="0.8 mL/s", slip="1e-13 m3/s/Pa", idle_power="7 W", power_per_pressure="8 mW/dbar"
    )
    vehicle = the_float(actuator=vehicle.actuator.model_copy(update={"pump": pump}))
    stall = (8e6 - 16325.0) / vehicle.water.specific_weight  # delivery over slip, less the head
    p = supervisor_parameters(vehicle, 1.0)
    assert p.deep.depth_limit == pytest.approx(0.9 * 0.95 * stall, abs=5.0)


@pytest.mark.avr
@pytest.mark.usefixtures("avr")
@pytest.mark.promise("pump-and-valve")
def test_each_reason_brings_it_up_on_the_chip(tmp_path):
    """By the twin's bits, with one program that begins anew for each of them."""
    own = Supervisor(depth_limit="120 m", time_limit="100 s")
    made = firmware(limited(the_float(supervisor=own)), duration=300.0)
    on_chip = chip.vehicle(made, tmp_path, "atmega2560", "-DBEGINS")
    healthy = Watched(50.0, 0.1, math.nan, 14.0, False, 0, 0)
    found = []
    for reason, spoilt, _ in [*REASONS, (Reason.TIME_LIMIT, {}, 0), (Reason.RESTARTED, {}, 0)]:
        reset = reason is Reason.RESTARTED
        beside = chip.vehicle_twin(made, after_reset=reset)
        for n in range(130):
            seen = healthy._replace(**(spoilt if n >= 20 else {}))
            if reason is Reason.DEPTH_LIMIT and n >= 20:
                seen = seen._replace(depth=50.0 + (n - 20))
            first = seen._replace(leak=reset, lost=2**32 - 1)
            said = on_chip.answer(*(first if n == 0 else seen)[:6], 80.0)
            expected = beside.tick(seen, 80.0)
            assert bits(*said) == bits(expected, beside.state.recovery.reasons), (reason, n)
            if beside.reason is not None:
                assert said[0] == 1.0  # the pump runs all of the tick
                break
        found.append(beside.reason)
    on_chip.close()
    assert found == [*(reason for reason, *_ in REASONS), Reason.TIME_LIMIT, Reason.RESTARTED]


class TestRefusals:
    @pytest.mark.parametrize(
        "field", ["prove_after", "hold_voltage", "neutral_change", "model_error"]
    )
    def test_limits_that_a_pump_has_no_use_for(self, field):
        given = {
            "prove_after": 60.0,
            "hold_voltage": 3.0,
            "neutral_change": 1e-4,
            "model_error": 0.5,
        }
        own = Supervisor(**{field: given[field]})
        with pytest.raises(InputError) as caught:
            firmware(limited(the_float(supervisor=own)))
        assert caught.value.field == f"supervisor.{field}"

    def test_a_pool_day(self):
        with pytest.raises(InputError) as caught:
            firmware(limited(the_float()), pool=PoolOptions(4.5))
        assert caught.value.field == "bottom_depth"

    @pytest.mark.parametrize(
        ("option", "value"),
        [
            ("--step", "-1:100 m"),
            ("--step", "0:3 m"),
            ("--step", "0:1900 m"),
            ("--duration", "0 s"),
        ],
    )
    def test_a_golden_mission_that_is_none(self, option, value, capsys, tmp_path):
        out = ["--out", str(tmp_path / "library")]
        assert main(["firmware", "example-float", "--time-limit", "20 h", option, value, *out]) == 2
        assert f"{option}: " in " ".join(capsys.readouterr().err.split())

    def test_a_rate_that_the_polynomial_does_not_follow(self):
        vehicle = limited_pump("200 rad/s")
        law, numbers = own_law(vehicle, sampled=False)
        with pytest.raises(InputError) as caught:
            board_law(vehicle, law, numbers, 1500.0, deepest=2000.0)
        assert caught.value.field == "controller.sample_time"

    def test_a_voltage_at_which_the_pump_stands(self):
        with pytest.raises(InputError) as caught:
            firmware(limited(the_float(supervisor=Supervisor(battery_low="0.1 V"))))
        assert caught.value.field == "supervisor.battery_low"

    def test_a_float_that_cannot_dive_gets_no_library(self):
        """As much pressure inside as outside, and no bypass: the valve lets next to nothing in."""
        vehicle = the_float()
        shut = {"bypass": None, "internal_pressure": 101325.0}
        vehicle = the_float(actuator=vehicle.actuator.model_copy(update=shut))
        with pytest.raises(NoAnswerError, match="has not dived"):
            firmware(limited(vehicle), duration=900.0)

    def test_a_float_without_a_controller(self):
        with pytest.raises(InputError) as caught:
            firmware(limited(the_float(controller=None)))
        assert caught.value.field == "controller"


def test_the_limits_of_the_supervisor_follow_from_pump_and_hull():
    p = supervisor_parameters(the_float(), 1.0)
    assert p.deep.depth_limit == pytest.approx(0.9 * 2000.0)
    assert p.push.surface_command == 1.0
    assert p.push.hold_command == p.push.away_command == 0.0
    # all volume out within the first push, at the deepest and 0.8 of the voltage
    low = the_float()
    low = low.model_copy(update={"supply": low.supply.model_copy(update={"voltage": 11.52})})
    rate = drive_map(low, 1800.0 * low.water.specific_weight, power=False).rate_out[0]
    assert p.push.push * rate > 600e-6
    assert p.push.again * rate > 4.5e-6  # what a start falls short of, and more
    assert p.time.time_blocks == 65535


def test_the_readme_says_what_is_watched_and_how_it_is_wired():
    files = library().files
    said = files["README.md"]
    assert "PUMP_PIN" in said
    assert "closed without current" in said
    assert "| 9 volume impossible" not in said
    assert "| 4 depth missing | the depth was no number | 5 s |" in said
    assert {"src/swb_drive.c", "src/swb_drive.h", "src/swb_rate.c"} <= set(files)


def test_the_controller_alone_meets_missing_depths_as_its_twin(gcc, tmp_path):  # noqa: ARG001
    made = library()
    other, twin = LibraryInC(made, tmp_path), chip.twin_of(made)
    other.begin(0.0)
    rng = np.random.default_rng(7)
    for n in range(4000):
        depth = [math.nan, math.inf, -1e30, 7.0, 60.0][rng.integers(5)] if n % 3 else n / 40.0
        asked = [0.0, 50.0, 80.0][n // 900 % 3]
        assert bits(other.tick(depth, math.nan, asked)) == bits(
            twin.tick(depth, math.nan, asked)
        ), n
