"""The supervisor's C, compiled, against its float32 twin, to the bit."""

import ctypes
import functools
import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from swimbladder.codegen.library import Library, firmware, meanings, write_library
from swimbladder.codegen.subset import read_law
from swimbladder.codegen.twin import VehicleTwin, twin
from swimbladder.control.law import NEVER, Law, numbers
from swimbladder.control.supervisor import (
    SUPERVISOR,
    Reason,
    SupervisorParameters,
    Watched,
    initial,
    step,
)
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Sensors, Supervisor
from tests.codegen import chip
from tests.codegen.build import STRICT, Program, run
from tests.codegen.laws import bits, changed, controlled, flat, split
from tests.examples import examples
from tests.vehicles import limited, paper

_CALLS = """\
#include "swb_vehicle.h"
int size(void) { return (int)sizeof(swb_vehicle); }
void begin(void *v, int anew) { swb_vehicle_begin(v, anew != 0); }
void on(void *v, int anew, int was) { swb_vehicle_switch_on(v, anew != 0, was != 0); }
void arm(void *v) { swb_vehicle_arm(v); }
int armed(const void *v) { return swb_vehicle_armed(v) + 2 * swb_vehicle_surfaced(v); }
float tick(void *memory, const float *in, uint32_t lost, float reference, uint32_t *said)
{
    swb_vehicle *v = memory;
    const swb_seen seen = {.depth = in[0], .depth_age = in[1], .volume = in[2], .battery = in[3],
        .leak = in[4] > 0.0f, .lost_ticks = lost};
    const float command = swb_vehicle_tick(v, &seen, reference);
    said[0] = v->reason;
    said[1] = v->reasons;
    said[2] = v->release;
    return command;
}
const char *words(int reason) { return swb_reason((uint8_t)reason); }
"""


@cache
def library(name: str = "feup-em", **supervisor: Any) -> Library:
    vehicle = load_vehicle(name)
    changes = {"supervisor": Supervisor(**dict(supervisor))}
    if name == "feup-em":
        changes["sensors"] = Sensors(depth_noise="2 mm", depth_quantum="5 mm")
    return firmware(limited(vehicle.model_copy(update=changes)), duration=30.0)


class VehicleInC:
    """A library's vehicle, compiled for this machine."""

    def __init__(self, made: Library, folder: Any, *flags: str) -> None:
        write_library(made, folder / "library")
        (folder / "calls.c").write_text(_CALLS)
        src = folder / "library" / "src"
        sources = [*sorted(src.glob("*.c")), folder / "calls.c"]
        run(
            "gcc",
            *STRICT,
            "-O2",
            *flags,
            "-shared",
            "-fPIC",
            "-I",
            src,
            *sources,
            "-o",
            folder / "vehicle.so",
            "-lm",
        )
        self.c = ctypes.CDLL(str(folder / "vehicle.so"))
        pointer, number = ctypes.c_void_p, ctypes.c_float
        self.c.tick.argtypes = [pointer, pointer, ctypes.c_uint32, number, pointer]
        self.c.tick.restype = number
        self.c.begin.argtypes = [pointer, ctypes.c_int]
        self.c.on.argtypes = [pointer, ctypes.c_int, ctypes.c_int]
        self.c.arm.argtypes = self.c.armed.argtypes = [pointer]
        self.c.words.restype = ctypes.c_char_p
        self.begin(anew=False)

    def begin(self, *, anew: bool) -> None:
        self.room = ctypes.create_string_buffer(self.c.size())
        self.c.begin(ctypes.addressof(self.room), int(anew))

    def tick(self, seen: Watched, reference: float) -> tuple[float, int, int, int]:
        """Return (command, reason, bits, release)."""
        numbers = np.array(seen[:5], np.float32)
        said = np.zeros(3, np.uint32)
        command = self.c.tick(
            ctypes.addressof(self.room),
            numbers.ctypes.data,
            int(seen.lost),
            reference,
            said.ctypes.data,
        )
        return command, *map(int, said)


def said_by(vehicle: VehicleTwin, seen: Watched, reference: float) -> tuple[Any, int, int, int]:
    """Return what the twin says, in the form of the C's."""
    command = vehicle.tick(seen, reference)
    s = vehicle.state
    return command, int(s.recovery.reason), int(s.recovery.reasons), int(s.recovery.release)


@pytest.fixture(
    scope="module", params=["feup-em", pytest.param("ntnu-bv", marks=pytest.mark.prove)]
)
def both(request, tmp_path_factory):
    request.getfixturevalue("gcc")
    made = library(request.param)
    return made, VehicleInC(made, tmp_path_factory.mktemp(request.param))


_ODD = [math.nan, math.inf, -math.inf, -0.0, 1e-45, 1e-39, 3e38]
_TICKS = st.builds(
    Watched,
    depth=st.one_of(st.floats(0.0, 60.0, width=32), st.just(2.0), st.sampled_from(_ODD)),
    depth_age=st.one_of(st.just(0.1), st.floats(0.0, 9.0, width=32), st.sampled_from(_ODD)),
    volume=st.one_of(
        st.floats(-3.8e-4, 3.8e-4).map(lambda x: float(np.float32(x))),
        st.just(1e-5),
        st.sampled_from(_ODD),
    ),
    battery=st.one_of(st.floats(5.0, 13.0, width=32), st.sampled_from(_ODD)),
    leak=st.sampled_from([False] * 9 + [True]),
    lost=st.sampled_from([0] * 9 + [1, 5, 4000, 65535, 4_000_000_000]),
    missed=st.just(0),
)
SEEN = Watched(2.0, 0.1, 1e-5, 12.0, False, 0, 0)
_STRETCHES = st.lists(st.tuples(_TICKS, st.integers(1, 40)), min_size=1, max_size=12)


@pytest.mark.promise("swapped-wires", faults=["board resets"])
def test_a_reset_leaves_what_the_last_push_did(both):
    """It is taken over after a reset only, and not from memory that holds something else."""
    made, in_c = both
    twin_of = functools.partial(chip.vehicle_twin, made)
    wet = SEEN._replace(leak=True)
    falling = [wet._replace(volume=np.float32(1e-4 - 1e-5 * k)) for k in range(20)]

    def after(anew, memory=None):
        in_c.begin(anew=False)
        beside = twin_of()
        for seen in falling:
            assert in_c.tick(seen, 3.0) == said_by(beside, seen, 3.0)
        room = bytearray(in_c.room.raw if memory is None else memory)
        in_c.room = ctypes.create_string_buffer(bytes(room), len(room))
        in_c.c.begin(ctypes.addressof(in_c.room), int(anew))
        again = twin_of(after_reset=anew, before=beside.state if memory is None else None)
        said = []
        for seen in falling[10:11]:
            said.append(in_c.tick(seen, 3.0))
            assert said[-1] == said_by(again, seen, 3.0)
        return again.state.push.turns, beside.state.push.turns

    kept, before = after(True)
    assert kept == before == 1  # it fell both ways: as it was, for good
    assert after(False)[0] != 1
    for filled in (0, 0xFF, 0x55):
        assert after(True, bytes([filled]) * len(in_c.room.raw))[0] != 1


@pytest.mark.parametrize(
    ("turns", "way", "volumes"),
    [
        (7, "away_command", [9e-5, 9e-5, 9e-5]),
        (7, "away_command", [math.nan, 9e-5, 9e-5]),
        (0, "surface_command", [math.nan, 1e-4, 1e-4]),
        (0, "surface_command", [9.9e-5, 1e-4, 1e-4]),
    ],
)
@pytest.mark.promise("swapped-wires", faults=["board resets"])
def test_what_a_push_did_outlives_a_reset(turns, way, volumes):
    """The sea drives the piston in by 10 cm3 meanwhile, or the first volume is not measured."""
    made = library()
    before = chip.vehicle_twin(made, after_reset=True).state
    before = changed(before, turns=turns, phase=0, reason=1, volume=np.float32(1e-4))
    vehicle = chip.vehicle_twin(made, after_reset=True, before=before)
    for volume in volumes:
        command = vehicle.tick(SEEN._replace(volume=volume), 3.0)
        assert command == np.float32(getattr(made.supervisor.push, way))
    assert vehicle.state.push.turns == turns


@pytest.mark.parametrize(
    ("pushing", "lost", "turned"),
    [
        (True, 1e-6, False),  # the sea takes a little more than a push gives
        (True, 2e-5, True),  # the push takes as well: wires the wrong way round
        (False, 2e-5, False),  # the law had brought it in
    ],
)
@pytest.mark.promise("swapped-wires", faults=["dying cell"])
def test_only_what_a_reset_finds_lost_since_the_last_push_turns_it(pushing, lost, turned):
    """A dying cell resets the board at the first tick of every push."""
    made = library()
    vehicle, volume = chip.vehicle_twin(made, after_reset=True), np.float32(1e-4)
    before = changed(vehicle.state, phase=0, reason=1 if pushing else 0, volume=volume)
    given = []
    for _ in range(20 if pushing else 1):
        vehicle = chip.vehicle_twin(made, after_reset=True, before=before)
        volume = np.float32(volume - lost)
        given.append(vehicle.tick(SEEN._replace(volume=volume), 3.0))
        before = vehicle.state
        if given[-1] < 0.0:
            break
    assert (given[-1] < 0.0) == turned
    assert len(given) == (1 if turned or not pushing else 20)


@examples(40)
@given(stretches=_STRETCHES, anew=st.booleans(), reference=st.sampled_from([3.0, *_ODD]))
@pytest.mark.promise("full-buoyancy")
@pytest.mark.promise("command-within-limits")
@pytest.mark.promise("as-in-python")
def test_any_faults_are_met_as_by_the_twin_and_the_state_stays_finite(
    both, stretches, anew, reference
):
    made, in_c = both
    beside = chip.vehicle_twin(made)
    if anew:
        beside.state = beside.supervisor.initial(made.supervisor, stretches[0][0], 1.0)
    in_c.begin(anew=anew)
    low, high = map(np.float32, made.limits)
    latched = False
    for seen, ticks in stretches:
        for _ in range(ticks):
            expected = said_by(beside, seen, reference)
            got = in_c.tick(seen, reference)
            assert bits(got[0]) == bits(expected[0])
            assert got[1:] == expected[1:]
            assert low <= got[0] <= high
            assert all(map(math.isfinite, numbers(beside.state)))
            if latched:
                assert got[1] > 0
            latched = got[1] > 0
            p = made.supervisor
            if latched:
                calm = (np.float32(p.push.hold_command), np.float32(p.push.away_hold))
                turned = np.float32(p.push.away_command) <= got[0] < 0.0
                assert turned or got[0] in (np.float32(p.push.surface_command), *calm)
    assert latched or not anew


@pytest.mark.promise("no-command", faults=["set-point NaN", "set-point infinite"])
@pytest.mark.parametrize("reference", [math.nan, math.inf, -math.inf])
def test_a_set_point_that_is_no_depth_brings_it_up(both, reference):
    made, in_c = both
    beside = chip.vehicle_twin(made)
    in_c.begin(anew=False)
    at_once = math.ceil(2.0 * 5.0 / made.tick_s)  # twice the patience
    for k in range(2 * at_once):
        seen = SEEN._replace(volume=float(np.float32(1e-5 + 1e-9 * k)))
        wanted = 2.0 if k < at_once else reference
        expected, got = said_by(beside, seen, wanted), in_c.tick(seen, wanted)
        assert (bits(got[0]), got[1:]) == (bits(expected[0]), expected[1:])
        assert k >= at_once or got[1] == 0
    assert got[1] == Reason.NO_COMMAND
    assert got[0] == np.float32(made.supervisor.push.surface_command)


@pytest.mark.promise("full-buoyancy", faults=["bit flips"])
def test_bits_that_flip_do_not_undo_full_buoyancy(both):
    """Of the reasons after the first, and of what a push did before there was one."""
    made, _ = both
    p = made.supervisor
    begun = initial(p, SEEN, 0.0)
    latched = begun._replace(recovery=begun.recovery._replace(reason=int(Reason.LEAK), reasons=0))
    turned = begun._replace(push=begun.push._replace(turns=16384))
    for begins, seen in ((latched, SEEN), (turned, SEEN._replace(leak=True))):
        state = begins
        for _ in range(p.board.leak + 1):
            command, state, _ = step(p, state, seen, 0.0)
        assert command == p.push.surface_command
        assert state.recovery.reason == Reason.LEAK


def random_calls(count: int) -> list[tuple[Any, ...]]:
    """Calls of the step: a third ordinary, a third with odd numbers, a third of any bits."""
    rng = np.random.default_rng(5)
    p = supervisor_parameters(paper(), 0.3)
    plain = SUPERVISOR.initial(p, SEEN, 0.0)
    return [
        tuple(_varied(rng, value, n % 3) for value in flat(p, plain, SEEN, 1.0))
        for n in range(count)
    ]


def _varied(rng: np.random.Generator, value: Any, kind: int) -> Any:
    """Return another number, count or truth: 0, 1 of `kind`: near it, or odd; 2: any."""
    odd = rng.random() < (0.05, 0.15, 1.0)[kind]
    if isinstance(value, bool):
        return value is not odd
    if isinstance(value, int):
        near = int(value * rng.uniform(0.5, 1.5)) + int(rng.integers(0, 2))
        whole = rng.choice([0, 1, 17, 4095, 4096, NEVER - 1, NEVER, rng.integers(0, NEVER + 1)])
        return int(whole) if odd else min(near, NEVER)
    if kind == 2:
        return rng.integers(0, 2**32, None, np.uint32).view("f4")
    near = np.float32(value) * np.float32(rng.uniform(0.5, 1.5))
    return np.float32(rng.choice([*_ODD, 0.0, 1.0, 17.0])) if odd else near


def expected_of(law: Law, frame: tuple[Any, ...]) -> tuple[Any, ...]:
    given, state, seen, reference = split(law, frame, Watched)
    return law.initial(given, seen, reference), law.step(given, state, seen, reference)


@pytest.mark.prove
@pytest.mark.usefixtures("gcc", "clang")
@pytest.mark.parametrize(
    "how",
    [
        ("gcc", *STRICT, "-O2"),
        pytest.param(
            (
                "clang",
                "-std=c99",
                "-O1",
                "-g",
                "-Wall",
                "-Wextra",
                "-Wconversion",
                "-Werror",
                "-fsanitize=address,undefined",
                "-fno-sanitize-recover=all",
            ),
            marks=pytest.mark.prove,
        ),
    ],
)
@pytest.mark.promise("as-in-python")
def test_any_numbers_give_the_same_bits(how, tmp_path):
    law = twin(SUPERVISOR, read_law(SUPERVISOR, Watched))
    calls = random_calls(1500)
    answers = Program(SUPERVISOR, tmp_path, *how, seen=Watched).answers(calls)
    for frame, answer in zip(calls, answers, strict=True):
        assert bits(answer) == bits(*expected_of(law, frame))


class Spoilt:
    """An hour in which every sensor fails for a while, too short to be a reason, then for good."""

    def __init__(self, p: SupervisorParameters, last: int) -> None:
        self.short, self.last = int(min(p.volume.blind, p.board.leak)) - 1, last
        self.rng = np.random.default_rng(3)

    def __call__(self, k: int, seen: Watched) -> Watched:
        if k >= self.last:
            return seen._replace(depth=math.nan)
        kind, since = divmod(k, 100)
        if since >= self.short:
            return seen._replace(battery=11.5)
        name = ("depth", "volume", "depth_age", "battery", "leak")[kind % 5]
        value = {"depth": math.nan, "volume": math.inf, "leak": True}.get(name, 9.0)
        return seen._replace(**{name: value})


@pytest.mark.prove
@pytest.mark.usefixtures("gcc")
@pytest.mark.promise("as-in-python", faults=["depth NaN"])
def test_an_hour_with_faults_is_the_same_to_the_bit(tmp_path):
    made = library()
    in_c, beside = VehicleInC(made, tmp_path), chip.vehicle_twin(made)
    beside.spoil = Spoilt(made.supervisor, 11_000)
    seen_by: list[tuple[Watched, float]] = []
    spoil, reasons = beside.spoil, []
    beside.spoil = lambda k, seen: seen_by.append((spoil(k, seen), 0.0)) or seen_by[-1][0]
    unequal = 0

    def law(measured, reference):
        nonlocal unequal
        command = beside(measured, reference)
        got = in_c.tick(seen_by[-1][0], reference)
        s = beside.state
        unequal += bits(got[0]) != bits(command) or got[1:] != (
            s.recovery.reason,
            s.recovery.reasons,
            s.recovery.release,
        )
        reasons.append(beside.reason)
        return command

    depths = [3.0, 1.0, 1.02, 4.0, 3.9, 2.0]
    flown = simulate(
        made.vehicle,
        law=law,
        start_depth=1.5,
        duration=3600.0,
        seed=1,
        sample_time=0.3,
        setpoints=[(600.0 * n, depth) for n, depth in enumerate(depths)],
    )
    assert len(reasons) == 12_001
    assert unequal == 0
    first = next(k for k, reason in enumerate(reasons) if reason is not None)
    assert first == 11_000 + made.supervisor.volume.blind - 1
    assert reasons[-1] is Reason.DEPTH_MISSING
    assert flown.depth[-1] < 0.1


@pytest.mark.usefixtures("gcc")
def test_reasons_have_words_in_c(tmp_path):
    in_c = VehicleInC(library(), tmp_path)
    assert in_c.c.words(0) == b"none"
    assert in_c.c.words(16) == in_c.c.words(255) == b"unknown"
    for reason in Reason:
        assert in_c.c.words(reason.value).decode() == reason.words
    readme = library().files["README.md"]
    for number, name, words, after in meanings(library().supervisor):
        assert f"| {number} {name} | {words} | {after} |" in readme
    assert [number for number, *_ in meanings(library().supervisor)] == list(range(1, 16))
    p = library().supervisor
    said = " ".join(readme.split())
    takes = f"as a step like that takes (up to {p.proof.reach * 1e6:.3g} cm3) in the last 30 s"
    assert takes in said
    assert "the command is up to 12 V, whatever the law says" in said


@pytest.mark.avr
@pytest.mark.usefixtures("avr")
@pytest.mark.parametrize("mcu", chip.MCUS)
@pytest.mark.promise("as-in-python", faults=["depth NaN"])
def test_a_fault_latches_on_the_chip_as_in_the_twin(mcu, tmp_path):
    made = library()
    on_chip = chip.vehicle(made, tmp_path, mcu)

    def spoil(k, seen):
        return seen._replace(depth=math.nan) if k >= 300 else seen

    flight, beside = chip.fly_supervised(made, on_chip, duration=180.0, spoil=spoil)
    on_chip.close()
    assert flight.ticks == 601
    assert flight.unequal == 0
    assert beside.reason is Reason.DEPTH_MISSING
    assert flight.final_depth < 1.0  # it bobs at the surface
    assert min(flight.cycles) > 2000  # the clock that says so does tick


@pytest.mark.avr
@pytest.mark.usefixtures("avr")
def test_a_supervised_cascade_fits_the_chip_as_it_should(tmp_path):
    """15 kB of flash, 1 kB of RAM and 5 ms a tick at most, under the law and with a reason."""
    on_chip = chip.vehicle(library(), tmp_path, "atmega328p")
    flight, beside = chip.fly_supervised(
        library(), on_chip, duration=120.0, spoil=lambda k, seen: seen._replace(leak=k >= 350)
    )
    stack = on_chip.close()
    assert beside.reason is Reason.LEAK
    assert flight.unequal == 0
    assert on_chip.size.flash < 15_000
    assert on_chip.size.variables + stack < 1000
    assert max(flight.cycles) < 80_000  # 5 ms at 16 MHz


class TestWords:
    @pytest.mark.parametrize("name", ["feup-em", "ntnu-bv"])
    def test_what_is_off_is_not_given_as_a_limit(self, name):
        """No depth that is infinite, no voltage of 0."""
        p = library(name).supervisor
        deep = p.deep._replace(depth_limit=math.inf, deepest=math.inf)
        p = p._replace(deep=deep, board=p.board._replace(battery_low=0.0))
        p = p._replace(same=p.same._replace(same=NEVER))
        said = {number: (words, after) for number, _, words, after in meanings(p)}
        text = str(said)
        assert " inf " not in text
        assert "below 0" not in text
        assert "never of" not in text
        assert said[3][1] == said[12][1] == "never"


class TestNumbers:
    def test_the_papers_vehicle(self):
        """Worked by hand from the paper's numbers."""
        p = supervisor_parameters(paper(sensors=Sensors(depth_noise="2 mm")), 0.3)
        assert p.push.surface_command == 12.0
        assert p.board.battery_low == pytest.approx(9.6)
        # full buoyancy of 350 cm3 lifts to 350/4.04 m; with 87.5 cm3 and 30 % of psi less
        assert p.deep.deepest == pytest.approx(350.0 / 4.04)
        assert p.deep.depth_limit == pytest.approx((350.0 - 87.5) / (4.04 * 1.3))
        # there the motor at 9.6 V moves 3.33 cm3/s/V (9.6 V - 0.07707 V/m z)
        rate = 3.33e-6 * (9.6 - 0.07707 * p.deep.depth_limit)
        assert p.deep.per_turn_rate == pytest.approx(1.0 / rate)
        assert p.push.push == math.ceil(2.0 * 700e-6 / rate / 0.3)
        assert p.push.hold_command == pytest.approx(0.07707 * p.deep.deepest)
        assert p.same.same == NEVER  # 0.5 mm in a quantum of 5 mm that nobody stated may repeat
        assert (p.time.time_blocks, p.time.time_ticks) == (NEVER, 0)  # it states no time limit
        assert p.push.rise == 1.0
        # a depth may jump by 6 times the noise and 5 cm, and go on at the vehicle's speed
        assert p.depth.jump == pytest.approx(0.062)
        assert p.depth.step == pytest.approx(p.depth.fastest + 0.062)

    def test_a_push_that_a_block_ends_asks_for_more_than_a_stop(self):
        """A stop is 15 % of the full rate, or what has grown within a third of a tick."""
        vehicle = load_vehicle("feup-em")
        own = plant(vehicle)
        rate = own.gain * (own.supply - own.friction)
        for tick, share in ((0.2, None), (1.0, 0.15)):
            p = supervisor_parameters(vehicle, tick)
            asked = 3.0 * p.push.grown / tick if share is None else share * rate
            assert p.rate.stop_rate == pytest.approx(asked)

    @pytest.mark.parametrize(("noise", "quantum"), [(0.01, 0.0), (0.02, 0.005), (0.03, 0.01)])
    def test_the_same_depth_again_is_as_rare_as_is_said(self, noise, quantum):
        """Of a quarter of the noise that is stated, and a quantum of 5 mm at least."""
        sensors = Sensors(depth_noise=noise, depth_quantum=quantum)
        p = supervisor_parameters(paper(sensors=sensors), 0.3)
        rng = np.random.default_rng(1)
        samples = np.round(rng.normal(0.0, noise / 4.0, 200_000) / max(quantum, 5e-3))
        chance = np.mean(samples == 0.0)  # in the middle of its quantum: the worst place
        assert chance**p.same.same < 1.2e-12
        half = 0.5 * max(quantum, 5e-3) / (noise / 4.0)
        rare = math.log(1e-12) / math.log(norm.cdf(half) - norm.cdf(-half))
        assert p.same.same == max(math.ceil(10 / 0.3), math.ceil(rare))

    def test_a_quantum_that_hides_the_noise_says_nothing(self):
        sensors = Sensors(depth_noise="1 mm", depth_quantum="10 mm")
        assert supervisor_parameters(paper(sensors=sensors), 0.3).same.same == NEVER

    def test_time_is_counted_in_blocks(self):
        p = supervisor_parameters(paper(supervisor=Supervisor(time_limit="90 d")), 0.3)
        assert p.time.time_blocks * 4096 + p.time.time_ticks == 90 * 86400 / 0.3
        assert p.time.time_blocks * 4096 > 2**24

    @pytest.mark.parametrize(
        ("given", "said"),
        [
            ({"depth_limit": "90 m"}, "full buoyancy lifts the vehicle"),
            ({"depth_limit": "80 m", "battery_low": "5 V"}, "the motor moves at 5 V"),
            ({"neutral_range": "400 cm3"}, "beyond the stroke"),
            ({"release_time": "6e6 s"}, "supervisor counts to"),
        ],
    )
    def test_a_vehicle_that_would_not_come_up_is_refused(self, given, said):
        with pytest.raises(InputError, match=said):
            supervisor_parameters(paper(supervisor=Supervisor(**given)), 0.3)

    def test_a_positioner_goes_to_its_end(self):
        p = supervisor_parameters(controlled("position-pid"), 0.5)
        assert (
            p.push.surface_command == p.push.hold_command == load_vehicle("ntnu-bv").stroke.maximum
        )
        assert p.board.battery_low == 0.0
