"""The pool procedure's C against its float32 twin, to the bit; its sketch in water; its numbers."""

import json
import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from swimbladder.cli import main
from swimbladder.codegen.library import firmware
from swimbladder.codegen.pool import PoolOptions, PoolTwin, board_procedure, plan_pool_day, rehearse
from swimbladder.codegen.twin import twin
from swimbladder.control.law import NEVER
from swimbladder.control.protocol import POOL, Does
from swimbladder.control.supervisor import SUPERVISOR, Reason, Watched
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.vehicle import Sensors
from tests.codegen.build import STRICT, Compiled, Program, run, write
from tests.codegen.laws import bits, controlled, flat, split
from tests.codegen.pool_day import (
    ARDUINO,
    SENSORS,
    VOLUMES,
    DayInC,
    SketchInWater,
    calls,
    day_twin,
    fly_on_chip,
    library,
    pool_chip,
    said_by,
)
from tests.examples import examples
from tests.vehicles import limited, paper

ODD = [math.nan, math.inf, -math.inf, -0.0, 0.0, 1e-45, 1e-39, 3e38, -3e38, 1.0]


@pytest.fixture(scope="module")
def compiled(request, tmp_path_factory):
    request.getfixturevalue("gcc")
    return Compiled(POOL, tmp_path_factory.mktemp("pool"))


@pytest.fixture(scope="module")
def day(request, tmp_path_factory):
    request.getfixturevalue("gcc")
    return DayInC(library(), tmp_path_factory.mktemp("day"))


def test_every_call_of_a_day_is_equal_to_the_bit(compiled):
    p = library().pool.parameters
    assert len(calls()) > 5000
    for call in calls():
        got = compiled.step(p, call.state, call.measurement, call.go)
        assert bits(got) == bits(call.command, call.after, call.next_s)
    assert {int(call.after.phase) for call in calls()} == {-1, 0, 1, 2, 3, 4, 5, 6, 7, 8}


def _frames(count):
    """Calls near those of the day, some numbers odd, and calls of any bits at all."""
    rng = np.random.default_rng(1)
    p, found = library().pool.parameters, []
    for n in range(count):
        call = calls()[rng.integers(len(calls()))]
        values = np.array(flat(p, call.state, call.measurement, call.go), "f4")
        if n % 3 == 1:
            values *= rng.uniform(0.5, 1.5, len(values)).astype("f4")
            at = rng.random(len(values)) < 0.1
            values[at] = rng.choice(np.array(ODD, "f4"), at.sum())
        elif n % 3 == 2:
            values = rng.integers(0, 2**32, len(values), np.uint32).view("f4")
        found.append(tuple(values))
    return found


def _same_as_the_twin(program):
    law = twin(POOL)
    frames = _frames(3000)
    for frame, answer in zip(frames, program.answers(frames), strict=True):
        given, state, seen, reference = split(POOL, frame)
        expected = law.initial(given, seen, reference), law.step(given, state, seen, reference)
        assert bits(tuple(answer)) == bits(*expected)


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.filterwarnings("ignore:overflow")
class TestCompilers:
    @pytest.mark.usefixtures("gcc")
    def test_sanitizers(self, tmp_path):
        flags = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
        _same_as_the_twin(Program(POOL, tmp_path, "gcc", *STRICT, *flags))

    @pytest.mark.usefixtures("clang")
    def test_clang(self, tmp_path):
        _same_as_the_twin(Program(POOL, tmp_path, "clang", *STRICT, "-O3"))

    @pytest.mark.parametrize(
        ("compiler", "tool", "target"),
        [
            ("avr-gcc", "avr", ["-mmcu=atmega328p", "-Os"]),
            ("arm-none-eabi-gcc", "arm", ["-mcpu=cortex-m0plus", "-mthumb", "-O2"]),
        ],
    )
    def test_boards(self, compiler, tool, target, request, tmp_path):
        request.getfixturevalue(tool)
        flags = [flag for flag in STRICT if flag != "-Wdouble-promotion" or tool != "avr"]
        source = write(POOL, tmp_path)
        file = tmp_path / source.source_name
        run(compiler, *flags, *target, "-c", file, "-o", tmp_path / "pool.o")

    @pytest.mark.usefixtures("cppcheck")
    def test_cppcheck(self, tmp_path):
        for name, text in library().files.items():
            if name.startswith("src/"):
                (tmp_path / name[4:]).write_text(text)
        run(
            "cppcheck",
            "--quiet",
            "--enable=warning,style,performance,portability",
            "--error-exitcode=1",
            "--std=c99",
            "--suppress=missingIncludeSystem",
            tmp_path,
        )

    @pytest.mark.usefixtures("arm")
    def test_the_library_on_arm(self, tmp_path):
        for name, text in library().files.items():
            if name.startswith("src/"):
                (tmp_path / name[4:]).write_text(text)
        for source in tmp_path.glob("*.c"):
            flags = [*STRICT, "-mcpu=cortex-m0plus", "-mthumb", "-Os"]
            run("arm-none-eabi-gcc", *flags, "-c", source, "-o", tmp_path / "object.o")


class Spoilt(PoolTwin):
    """A twin whose sensors fail now and then, at last for good, and the C beside it."""

    def begin(self, in_c):
        self.in_c, self.k, self.unequal, self.went = in_c, 0, 0, set()
        self.rng = np.random.default_rng(4)
        in_c.begin()
        return self

    def tick(self, seen, *, may_begin):
        self.k += 1
        seen = seen._replace(lost=float(self.rng.random() < 1e-3), battery=12.0)
        if self.k % 997 > 990 or self.k > 6500:
            seen = seen._replace(depth=float(self.rng.choice(ODD[:3])), battery=math.nan)
        before = bits(self.in_c.tick(seen, may_begin=may_begin))
        command = super().tick(seen, may_begin=may_begin)
        s = self.state
        self.unequal += before != bits(
            command, self.watch.recovery.reasons, int(s.phase), int(s.gave_up_in)
        )
        self.went.add(self.phase.does)
        return command


@pytest.mark.prove
def test_a_day_with_faults_is_equal_to_the_bit(day):
    """Measurements fail now and then, at last for good: the supervisor takes over."""
    made, plain = library(), day_twin(library())
    beside = Spoilt(
        made.pool.parameters,
        made.supervisor,
        procedure=plain.procedure,
        supervisor=plain.supervisor,
    ).begin(day)
    with pytest.raises(NoAnswerError, match="the supervisor said 'depth missing'"):
        rehearse(made.vehicle, beside, bottom_depth=4.5, seed=2)
    assert beside.k > 6500
    assert beside.unequal == 0
    assert beside.went == set(Does) - {Does.DONE}


def _float32(x):
    return float(np.float32(x))


_SEEN = st.builds(
    Watched,
    *[
        st.one_of(st.floats(low, high).map(_float32), st.sampled_from(ODD))
        for low, high in ((-1.0, 6.0), (0.0, 2.0), (-4e-4, 4e-4), (8.0, 13.0))
    ],
    st.sampled_from([0.0, 0.0, 1.0]),
    st.sampled_from([0.0, 0.0, 1.0, 5000.0]),
    st.just(0.0),
)


@examples(60)
@example(seen=[(Watched(0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, z), 34, False) for z in (0.0, 140.0)])
@given(st.lists(st.tuples(_SEEN, st.integers(1, 80), st.booleans()), min_size=1, max_size=12))
@pytest.mark.prove
def test_anything_seen_is_met_as_by_the_twin(day, seen):
    beside = day_twin(library())
    day.begin()
    for row, times, may_begin in seen:
        for _ in range(times):
            got = day.tick(row, may_begin=may_begin)
            assert bits(got) == bits(said_by(beside, row, may_begin=may_begin))
            assert -12.0 <= got[0] <= 12.0


def test_after_a_reset_it_comes_up(day):
    made = library()
    beside = PoolTwin(
        made.pool.parameters,
        made.supervisor,
        after_reset=True,
        procedure=day_twin(made).procedure,
        supervisor=day_twin(made).supervisor,
    )
    day.begin(anew=True)
    seen = Watched(3.0, 0.0, 0.0, 12.0, 0.0, 0.0, 0.0)
    for _ in range(3):
        got = day.tick(seen, may_begin=True)
        assert bits(got) == bits(said_by(beside, seen, may_begin=True))
        assert got[0] == 12.0
    assert beside.reason is Reason.RESTARTED
    assert beside.phase.does is Does.GAVE_UP


def test_phases_have_words_in_c(day):
    p = library().pool.parameters
    assert [day.c.words(n).decode() for n in range(10)] == [phase.words for phase in p.phases]
    assert day.c.words(-1) == b"wait"
    assert day.c.words(10) == day.c.words(-2) == b"unknown"


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize(
    "board", ["PoolDayAVR", pytest.param("PoolDayESP32RP2040", marks=pytest.mark.prove)]
)
def test_the_log_of_a_sketch_in_water_tells_the_vehicle(board, tmp_path, capsys):
    """K2, T2 and psi of the vehicle in the water come out of what the sketch printed."""
    log = SketchInWater(library(), tmp_path, board).swim()
    text = log.read_text()
    steps = [phase.words for phase in library().pool.parameters.phases[:8]]
    said = [line for line in text.splitlines() if line.startswith("# round")]
    assert said == [
        *(f"# round {n} of 2: {words}" for n in (1, 2) for words in steps),
        "# round 2 of 2: done",
    ]
    if board == "PoolDayESP32RP2040":
        return
    words = [
        "pool",
        "feup-em",
        "--follow",
        str(log),
        "--no-wait",
        "--bottom-depth",
        "4.5 m",
        "--target-std",
        "4 %",
        "--delay-std",  # the board reads both sensors in one tick
        "20 ms",
        "--out",
        str(tmp_path / "out"),
        "--json",
    ]
    assert main(words) == 0
    found = json.loads(capsys.readouterr().out)["parameters"]
    truth = load_vehicle("feup-em")
    known = {"K2": truth.motion.K2, "T2": truth.motion.T2, "psi": truth.hull.psi}
    for name, value in known.items():
        assert abs(found[name]["value"] - value) < 3.0 * found[name]["std"]
        assert found[name]["std"] < 0.1 * value


@pytest.mark.usefixtures("avr")
def test_the_sketch_compiles_for_avr(tmp_path):
    for name, text in library().files.items():
        if name.startswith("src/"):
            (tmp_path / name[4:]).write_text(text)
    (tmp_path / "sketch.cpp").write_text(
        f"#include <Arduino.h>\n{library().files['examples/PoolDayAVR/PoolDayAVR.ino']}"
    )
    run(
        "avr-g++",
        "-std=gnu++11",
        "-mmcu=atmega328p",
        "-Os",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-I",
        ARDUINO,
        "-I",
        tmp_path,
        "-c",
        tmp_path / "sketch.cpp",
        "-o",
        tmp_path / "sketch.o",
    )


@pytest.mark.prove
@pytest.mark.avr
@pytest.mark.usefixtures("avr")
def test_a_day_on_the_chip_is_equal_to_the_bit(tmp_path):
    made = library()
    chip = pool_chip(made, tmp_path, "atmega328p")
    ticks, unequal = fly_on_chip(made, chip)
    stack = chip.close()
    assert ticks > 5000
    assert unequal == 0
    assert chip.size.flash < 20_000
    assert chip.size.variables + stack < 1100
    assert max(chip.cycles) < 60_000  # 4 ms of the 300 ms of a tick


class TestNumbers:
    def test_the_papers_vehicle(self):
        p = library().pool.parameters
        assert (p.deep, p.shallow, p.rounds) == (3.75, 0.75, 2.0)
        assert (p.change, p.change + p.more) == pytest.approx(VOLUMES)
        assert p.surface == pytest.approx(0.05)  # six deviations and two quanta are less
        assert p.bottom == pytest.approx(4.45)
        assert p.rate_per_volt == pytest.approx(3.33e-6)
        assert p.load_voltage == pytest.approx(0.07707)
        assert p.loop == paper_loop()

    def test_a_rehearsal_waits_a_minute_and_goes_on_for_two_once_it_is_over(self):
        """What it takes is between the word to begin and the first phase in which it is over."""
        flown, tick = library().pool.rehearsal, library().tick_s
        begun = int(np.argmax(flown.may_begin))
        assert (begun - 1) * tick < 60.0 <= begun * tick + 1e-9
        assert flown.may_begin[begun:].all()
        over = int(np.argmax(flown.phase >= 8))
        assert flown.phase[over:].min() >= 8
        after = (len(flown.phase) - over) * tick
        assert 120.0 < after <= 120.0 + 3.0 * tick
        under_way = int(np.argmax(flown.phase >= 0))
        assert under_way >= begun
        assert flown.minutes == pytest.approx((over - under_way) * tick / 60.0)
        assert float(flown.depth[0]) == pytest.approx(0.0, abs=0.1)  # afloat, all volume out
        assert flown.volume[0] == pytest.approx(library().supervisor.volume.volume_high, abs=3e-6)
        assert flown.depth.max() <= 4.5 + 0.02

    def test_a_coarse_sensor_arrives_farther_off(self):
        vehicle = paper(sensors=Sensors(depth_noise="1 cm", depth_quantum="5 cm"))
        p = board_procedure(vehicle, PoolOptions(4.5), supervisor_parameters(vehicle, 0.3))
        assert p.surface == pytest.approx(0.16)
        assert p.bottom == pytest.approx(4.34)

    @pytest.mark.parametrize("law", ["sea-cascade", "observer"])
    def test_other_laws_hold_with_a_cascade(self, law):
        vehicle = controlled(law).model_copy(update={"sensors": SENSORS})
        limits = supervisor_parameters(vehicle, vehicle.controller.sample_time, in_pool=True)
        done = plan_pool_day(
            vehicle, PoolOptions(4.5, rounds=1, volume_changes=(20e-6, 20e-6)), limits, seed=1
        )
        assert done.own_loop == (law == "sea-cascade")
        assert 8.0 < done.rehearsal.minutes < 20.0

    @pytest.mark.parametrize(
        ("K2", "T2", "trim"), [(0.7, 1.0, -30e-6), (0.7, 0.7, 0.0), (1.3, 1.3, 30e-6)]
    )
    def test_the_vehicle_may_be_another_than_is_believed(self, K2, T2, trim):
        """It is yet to be identified: neither procedure nor supervisor may take that ill."""
        vehicle = paper(sensors=SENSORS)
        limits = supervisor_parameters(vehicle, 0.3, in_pool=True)
        p = board_procedure(vehicle, PoolOptions(4.5, volume_changes=(20e-6, 75e-6)), limits)
        motion = vehicle.motion.model_copy(
            update={"K2": vehicle.motion.K2 * K2, "T2": vehicle.motion.T2 * T2}
        )
        truth = vehicle.model_copy(update={"motion": motion, "trim_error": trim})
        beside = PoolTwin(p._replace(rounds=1.0), limits, procedure=POOL, supervisor=SUPERVISOR)
        rehearse(truth, beside, bottom_depth=4.5, seed=3)
        assert beside.state.completed == 1.0

    @pytest.mark.parametrize(
        ("options", "said"),
        [
            (PoolOptions(1.6), "between the depths of rest"),
            (PoolOptions(4.5, clearance=0.09), "rest clear of it"),
            (PoolOptions(60.0), "supervisor brings the vehicle up"),
            (PoolOptions(4.5, volume_changes=(20e-6, 250e-6)), "at most 212 cm3"),
            (PoolOptions(4.5, volume_changes=(0.0, 75e-6)), "above 0"),
            (PoolOptions(4.5, volume_changes=(math.nan, 75e-6)), "above 0"),
            (PoolOptions(4.5, rounds=0), "of at least 1"),
            (PoolOptions(4.5, rounds=1), "a single volume"),
        ],
    )
    def test_what_does_not_fit_is_refused(self, options, said):
        vehicle = paper()
        with pytest.raises(InputError, match=said):
            board_procedure(vehicle, options, supervisor_parameters(vehicle, 0.3))

    def test_the_volume_that_is_still_taken_fits(self):
        """350 cm3 less a tenth at either end, 87.5 cm3 of trim, and psi 3.75 m: 212.4 cm3."""
        vehicle = paper()
        options = PoolOptions(4.5, volume_changes=(20e-6, 212e-6))
        p = board_procedure(vehicle, options, supervisor_parameters(vehicle, 0.3))
        assert vehicle.neutral_volume(3.75) + 87.5e-6 + 212e-6 < 315e-6
        assert p.end_volume == pytest.approx(315e-6)

    def test_a_heavy_vehicle_has_less_room_inward_at_the_shallow_rest(self):
        """Neutral at -100.2 cm3 and psi 0.75 m, 87.5 cm3 of trim, an end at -315: 130.3 cm3."""
        vehicle, options = (
            paper(trim_error=-100.2e-6),
            PoolOptions(4.5, volume_changes=(20e-6, 140e-6)),
        )
        with pytest.raises(InputError, match="at most 130 cm3"):
            board_procedure(vehicle, options, supervisor_parameters(vehicle, 0.3))

    def test_the_voltage_that_holds_a_piston_makes_up_for_what_leaks_in(self):
        """K1 A (u - c z) = k_l z at each depth."""
        gain, leaks = 0.444e-3 * 75e-4, 5e-8  # m3/s/V, m2/s
        vehicle = paper(actuator=paper().actuator.model_copy(update={"k_l": leaks}))
        p = board_procedure(vehicle, PoolOptions(4.5), supervisor_parameters(vehicle, 0.3))
        assert gain * (p.load_voltage - 0.07707) == pytest.approx(leaks)

    def test_a_day_that_is_over_before_it_begins_ended_while_it_waited(self):
        """A time limit of no time is over at once, while the vehicle still floats."""
        made = library()
        limits = made.supervisor._replace(
            time=made.supervisor.time._replace(time_blocks=0, time_ticks=0)
        )
        beside = PoolTwin(made.pool.parameters, limits, procedure=POOL, supervisor=SUPERVISOR)
        said = "ended in waiting, round 1: the supervisor said 'time limit'"
        with pytest.raises(NoAnswerError, match=said):
            rehearse(made.vehicle, beside, bottom_depth=4.5, seed=1)

    def test_a_positioner_is_refused(self):
        vehicle = load_vehicle("ntnu-bv")
        with pytest.raises(InputError, match="takes positions"):
            board_procedure(vehicle, PoolOptions(2.0), supervisor_parameters(vehicle, 0.5))

    def test_a_loop_that_does_not_come_to_rest_gets_no_library(self):
        vehicle = load_vehicle("example-eh")
        with pytest.raises(NoAnswerError, match=r"in \(a\) hold, round 1 it took longer than 1200"):
            firmware(
                limited(vehicle),
                duration=30.0,
                pool=PoolOptions(4.5, rounds=1, volume_changes=(20e-6, 20e-6)),
            )


def paper_loop():
    from swimbladder.control.registry import bind

    return bind(load_vehicle("feup-em").controller)[1]


def test_the_files_of_a_library_with_a_pool():
    made = library()
    more = {name for name in made.files if "ool" in name}
    assert more == {
        "src/swb_pool.h",
        "src/swb_pool.c",
        "src/swb_pool_day.h",
        "src/swb_pool_day.c",
        "examples/PoolDayAVR/PoolDayAVR.ino",
        "examples/PoolDayAVR/platformio.ini",
        "examples/PoolDayESP32RP2040/PoolDayESP32RP2040.ino",
        "examples/PoolDayESP32RP2040/platformio.ini",
    }
    readme = made.files["README.md"]
    assert "2 rounds of rest at 3.75 m" in readme
    assert f"it took {made.pool.rehearsal.minutes:.0f} minutes" in readme
    for n, phase in enumerate(made.pool.parameters.phases):
        assert f"{n} {phase.words}" in readme
    assert "In health it does one thing" not in readme  # no pushes where they would end a glide
    told = made.to_dict()["pool"]
    assert told["rounds"] == 2
    assert told["parameters"]["deep"] == {"value": 3.75, "unit": "m"}
    json.dumps(told, allow_nan=False)


@pytest.mark.prove
def test_its_supervisor_pushes_only_where_the_file_asks_for_it():
    vehicle, pool = load_vehicle("feup-em"), PoolOptions(4.5)
    asked = vehicle.supervisor.model_copy(update={"prove_after": 30.0})
    assert firmware(limited(vehicle), duration=30.0).supervisor.proof.unproven < NEVER
    assert supervisor_parameters(vehicle, 0.3, in_pool=True).proof.unproven == NEVER
    asking = vehicle.model_copy(update={"supervisor": asked})
    with pytest.raises(NoAnswerError, match="glide"):  # a push ends what sinks for half a minute
        firmware(limited(asking), duration=30.0, pool=pool)
