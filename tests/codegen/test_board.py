"""Hardware in the loop: boards on serial ports fly the model; what is said of those that cannot.

Emulated: an ATmega328P and an ATmega2560 run the sketch itself by simavr, a Cortex-M the same
frames by QEMU. A program on this machine runs them too, and loses or garbles what it is told to.
"""

import csv
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.codegen import wire
from swimbladder.codegen.board import BoardAnswer, Flights, board
from swimbladder.codegen.library import digest, firmware
from swimbladder.control.registry import LAWS
from swimbladder.control.supervisor import Reason, Watched
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.sim.faults.draw import TRACE
from swimbladder.sim.faults.run import fly_one
from tests.codegen import chip, hardware
from tests.codegen.test_library import library
from tests.docs.test_reference import check
from tests.docs.test_reference import rows as documented
from tests.few_lines import few
from tests.pages import figures_of
from tests.vehicles import FLOATS, limited

TICK = 0.3  # s, of feup-em
SHORT = Flights(duration=30.0)
BEGINS = 5  # frames: begin, three ticks on deck, arm
BESIDE = 1 + BEGINS + BEGINS + 5 + 1 + 5 + 1  # the golden mission: hello, reset flight, status
ON_BOARD = 228, {"board resets", "ticks lost"}  # a seed, and what its first two missions have


@pytest.fixture(scope="module")
def made():
    return firmware(limited(load_vehicle("feup-em", sampled=True)), duration=30.0)


@pytest.fixture(scope="module")
def feup(made):
    return made.vehicle


@pytest.fixture(scope="module")
def host(gcc, made, tmp_path_factory):  # noqa: ARG001
    """Return what begins a board on this machine, by what is wrong with it."""
    program = hardware.host_program(made, tmp_path_factory.mktemp("host"))
    return lambda what="well", n=0: hardware.host_board(program, what, n)


@pytest.fixture(scope="module")
def programs(avr, made, tmp_path_factory):  # noqa: ARG001
    return {mcu: hardware.avr_program(made, tmp_path_factory.mktemp(mcu), mcu) for mcu in chip.MCUS}


def rows(answer: BoardAnswer, flight: int = 0) -> list[dict[str, float]]:
    text = answer.flights[flight].log.read_text().splitlines()
    return [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(text)]


@pytest.mark.avr
class TestOnAnAtmega:
    @pytest.mark.slow
    @pytest.mark.parametrize(
        "mcu", ["atmega328p", pytest.param("atmega2560", marks=pytest.mark.prove)]
    )
    def test_it_flies_the_golden_mission_to_the_bit(self, feup, programs, mcu, tmp_path):
        with hardware.avr_board(programs[mcu], mcu) as port:
            answer = board(limited(feup), port, out=tmp_path)
        flight, reset = answer.flights
        assert answer.equal
        assert (reset.name, reset.reason, reset.ended) == ("reset", "restarted", "armed as before")
        assert flight.ticks == 1335
        # SciPy's LSODA in double precision: 3.016 m after 400 s (tests/cli/test_simulate.py), by
        # the law alone; the supervisor shows the actuator every 90 s, which moves it by 5 mm
        assert flight.depth == pytest.approx(3.016, abs=6e-3)
        assert answer.speed > 5.0  # 60 on a free core
        assert 2e-3 < max(answer.times.steps) < 4e-3  # 2.9 ms with the frames
        assert answer.stack_left is not None
        # of the RAM, without variables and the stack that law and supervisor take
        assert {"atmega328p": 1500, "atmega2560": 7600}[mcu] < answer.stack_left
        assert answer.stack_left < {"atmega328p": 2048 - 330, "atmega2560": 8192 - 330}[mcu]

    @pytest.mark.prove
    def test_in_real_time_a_tick_comes_every_sample_time(self, feup, programs, tmp_path):
        with hardware.avr_board(programs["atmega328p"], "atmega328p", speed=1.0) as port:
            short = Flights(duration=3.0)
            answer = board(limited(feup), port, short, real_time=True, out=tmp_path)
        assert answer.equal
        assert answer.flights[0].ticks == 11
        assert answer.flights[0].wall > 10 * TICK
        assert len(answer.times.intervals) == 10 + 4 + 4  # and of the reset flight

    @pytest.mark.prove
    def test_half_a_minute_in_real_time(self, feup, programs, tmp_path):
        with hardware.avr_board(programs["atmega328p"], "atmega328p", speed=1.0) as port:
            answer = board(limited(feup), port, SHORT, real_time=True, out=tmp_path)
        assert answer.equal
        assert answer.flights[0].ticks == 101
        assert answer.speed == pytest.approx(1.0, rel=0.03)
        assert abs(np.median(answer.times.intervals)) < 5e-3

    @pytest.mark.prove
    def test_it_flies_faults_to_the_bit(self, feup, programs, tmp_path):
        with hardware.avr_board(programs["atmega2560"], "atmega2560") as port:
            answer = board(
                limited(feup), port, replace(SHORT, missions=10, steps=True), out=tmp_path
            )
        assert answer.equal
        assert len(answer.flights) == 13
        assert sum(bool(flight.reason) for flight in answer.flights) > 5


@pytest.mark.slow
@pytest.mark.usefixtures("qemu")
def test_a_cortex_m_flies_to_the_bit(made, feup, tmp_path):
    with hardware.arm_board(made, tmp_path, "cortex-m3") as port:
        answer = board(limited(feup), port, Flights(duration=60.0), out=tmp_path / "out")
    assert answer.equal
    assert answer.flights[0].ticks == 201
    assert answer.stack_left is None


def fly_steps(name: str, folder) -> None:
    floats = LAWS[name].command == "volume change"
    dive = {"step": (0.0, 30.0), "duration": 1200.0}
    made = firmware(limited(load_vehicle(FLOATS[name])), **dive) if floats else library(name)
    asked = Flights(**dive, steps=True) if floats else Flights(duration=60.0, steps=True)
    done: list[float] = []
    with hardware.host_board(hardware.host_program(made, folder)) as port:
        answer = board(limited(made.vehicle), port, asked, out=folder / "out", advance=done.append)
    assert answer.equal
    assert sum(done) == pytest.approx(1.0)
    assert [flight.name for flight in answer.flights] == ["golden mission", "steps", "reset"]
    assert len({row["reference_depth_m"] for row in rows(answer, 1)}) == (3 if floats else 2)
    assert len({row[f"twin_{made.facts['column']}"] for row in rows(answer)}) > (4 if floats else 5)


@pytest.mark.slow
@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("name", ["rate", "position-pid"])
def test_a_float_and_a_positioner_fly_steps_to_the_bit(name, tmp_path):
    fly_steps(name, tmp_path)


@pytest.mark.prove
@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("name", LAWS)
def test_every_law_flies_steps_to_the_bit(name, tmp_path):
    fly_steps(name, tmp_path)


def test_what_goes_over_the_wire_is_what_is_logged(feup, host, tmp_path):
    with host() as port:
        answer = board(limited(feup), port, SHORT, out=tmp_path / "out")
    logged = rows(answer)
    assert [row["time_s"] for row in logged] == pytest.approx([TICK * n for n in range(101)])
    assert all(row["voltage_V"] == row["twin_voltage_V"] for row in logged)
    assert all(math.isnan(row["battery_V"]) for row in logged)
    assert answer.frames["sent"] == 101 + BESIDE + answer.frames["lost"]
    assert logged[0]["depth_m"] == pytest.approx(1.5, abs=0.02)
    assert logged[-1]["depth_m"] == pytest.approx(answer.flights[0].depth, abs=0.02)


def faults_as_at_hand(feup, port, asked, folder) -> set[str]:
    """Fly missions with faults, by the board and by the C at hand; return the kinds of fault."""
    answer = board(limited(feup), port, asked, out=folder)
    assert answer.equal
    assert len(answer.flights) == 2 + asked.missions
    assert answer.not_flown == ("law hangs", "law waits for ever", "bit flips")
    assert not any(name in flight.ended for name in answer.not_flown for flight in answer.flights)
    for n, flight in enumerate(answer.flights[1:-1], 1):
        beside = fly_one(limited(feup), int(flight.name.split()[-1]), seed=asked.seed)
        assert flight.reason == beside.reason
        assert beside.outcome(0).words in flight.ended
        ran = beside.rows[0][beside.rows[0][:, TRACE["board"]] == 0.0]
        logged = rows(answer, n)
        if len(logged) > len(ran):  # a fast clock has two ticks at some of the trace's
            assert "clock" in flight.ended
            continue
        for column, known in (("depth_m", "depth_seen"), ("voltage_V", "command")):
            here = np.array([row[column] for row in logged], np.float32)
            np.testing.assert_array_equal(here, ran[:, TRACE[known]].astype(np.float32))
    return {kind for f in answer.flights[:-1] for kind in f.ended.split(":")[0].split(" and ")}


@pytest.mark.slow
def test_faults_do_to_the_board_what_they_do_to_the_c_at_hand(feup, host, tmp_path):
    """Among them what concerns the board itself: resets, and ticks that are lost."""
    with host() as port:
        seed, kinds = ON_BOARD
        assert kinds < faults_as_at_hand(
            feup, port, replace(SHORT, missions=2, seed=seed), tmp_path
        )


@pytest.mark.prove
def test_the_catalogue_does_to_the_board_what_it_does_to_the_c_at_hand(feup, host, tmp_path):
    with host() as port:
        found = faults_as_at_hand(feup, port, replace(SHORT, missions=60), tmp_path)
    assert len(found) > 30


def test_lost_and_garbled_frames_are_asked_for_again(feup, host, tmp_path, monkeypatch):
    monkeypatch.setattr(wire, "_ANSWER", 0.1)
    for what, n, counted in (
        ("mute", 50, "lost"),
        ("garbles", 10, "corrupt"),
        ("deaf", 1501, "corrupt_at_board"),
    ):
        with host(what, n) as port:
            answer = board(limited(feup), port, SHORT, out=tmp_path / "out")
        assert answer.equal, what
        assert answer.frames[counted] > 0, what
        assert answer.frames["sent"] == 101 + BESIDE + answer.frames["lost"], what
        assert answer.flights[0].ticks == 101


@pytest.mark.usefixtures("gcc")
def test_a_board_that_computes_something_else_is_found_out(feup, made, tmp_path, capsys):
    name = "src/swb_controller.c"
    gain = re.search(r"\.k_pz = ([\d.e+-]+)f", made.files[name])
    assert gain is not None
    changed = made.files[name].replace(gain[0], f".k_pz = {float(gain[1]) * 1.001:.9g}f")
    other = replace(made, files={**made.files, name: changed})
    with hardware.host_board(hardware.host_program(other, tmp_path)) as port:
        answer = board(limited(feup), port, SHORT, out=tmp_path / "out")
        line = ["board", "feup-em", "--port", port, "--duration", "30 s", "--time-limit", "2 h"]
        assert main([*line, "--out", str(tmp_path / "again")]) == 1
    assert not answer.equal
    first = answer.flights[0].difference
    assert first is not None
    assert first.field == "command"
    logged = rows(answer)
    unlike = [n for n, row in enumerate(logged) if row["voltage_V"] != row["twin_voltage_V"]]
    assert unlike[0] == first.tick
    assert len(unlike) <= answer.flights[0].unequal
    assert np.float32(logged[first.tick]["voltage_V"]) == first.board
    said = capsys.readouterr().out
    assert f"first differs at tick {first.tick}: command {first.board:.9g} on the board, " in said
    assert "DIFFERENT" in said.splitlines()


@pytest.mark.promise("disarmed-holds")
@pytest.mark.promise("stays-armed")
def test_it_is_disarmed_until_it_is_armed_over_the_wire_and_armed_after_a_reset(made, host):
    """As boards are: nothing is a reason on deck, and nothing less than power off disarms."""
    deck = Watched(0.0, 0.0, 0.0, math.nan, True, 0, 0)  # with a leak, which would be a reason
    under = Watched(2.0, 0.0, 0.0, math.nan, False, 0, 0)
    with host() as port, wire.Wire(port, digest(made)) as line:
        for _ in range(2):
            line.begin(after_reset=False)
            dry = [line.tick(deck, 3.0)[0] for _ in range(50)]
            assert {(said.armed, said.command, said.reasons) for said in dry} == {(False, 0.0, 0)}
            line.begin(after_reset=True)  # the reset button, on deck
            assert not line.tick(deck, 3.0)[0].armed
            line.arm()
            said = [line.tick(under, 3.0)[0] for _ in range(5)]
            assert all(one.armed and one.reason == 0 for one in said)
            assert any(one.command != 0.0 for one in said)
            line.begin(after_reset=True)
            after = line.tick(under, 3.0)[0]
            assert (after.armed, after.reason) == (True, Reason.RESTARTED)
            assert after.command == 12.0


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize(
    ("right", "wrong", "flight", "tick"),
    [
        ("switch_on(&hil_vehicle, after_reset, false)", "begin(&hil_vehicle, after_reset)", 0, -3),
        ("        swb_vehicle_arm(&hil_vehicle);", "        ;", 0, 0),
        ("(&hil_vehicle, after_reset, false)", "(&hil_vehicle, false, false)", 1, 5),
    ],
)
def test_a_board_that_arms_otherwise_is_found_out(feup, made, tmp_path, right, wrong, flight, tick):
    program = hardware.host_program(made, tmp_path, {right: wrong})
    with hardware.host_board(program) as port:
        answer = board(limited(feup), port, SHORT, out=tmp_path / "out")
    first = answer.flights[flight].difference
    assert first is not None
    assert (first.field, first.tick) == ("armed", tick)
    assert not answer.equal
    assert answer.flights[1].ended == ("armed as before" if tick < 0 else "NOT armed as before")


@pytest.mark.usefixtures("gcc")
def test_the_speed_of_a_fast_board_has_no_exponent(host, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(BoardAnswer, "speed", 1234.5)
    with host() as port:
        line = ["board", "feup-em", "--duration", "30 s", "--time-limit", "2 h", "--port", port]
        assert main([*line, "--out", str(tmp_path / "out")]) == 0
    assert "\nspeed: 1230 times real time\n" in capsys.readouterr().out


def forms(text: str) -> set[str]:
    """Return the lines of a text, any number the same, and any digest."""
    return {re.sub(r"[\d.]+", "0", re.sub(r" C \w{16}", " C", line)) for line in text.splitlines()}


def test_the_command_answers_as_its_page_says(made, host, tmp_path, capsys):
    line = ["board", "feup-em", "--duration", "30 s", "--time-limit", "2 h"]
    line += ["--out", str(tmp_path / "out"), "--port"]
    with host() as port:
        assert main([*line, port, "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert main([*line, port]) == 0
    said = few(capsys.readouterr().out, f"wrote to {tmp_path / 'out'}: ")
    assert "golden mission: equal at all 101 ticks, at 2.6" in said
    assert "\nequal\ngolden mission: " in said
    assert "stack left: not known on this board\nwrote " in said
    docs = hardware.HERE.parents[1] / "docs"
    shown = forms((docs / "how-to/board.md").read_text("utf-8").replace("/dev/ttyUSB0", port))
    here = said.replace("not known on this board", "1 bytes")
    assert forms(here.partition("wrote to ")[0]) <= shown
    in_real_time = {"interval_error"}
    _, keys = documented("files-written.md", "board")
    check(set(keys) - in_real_time, told)
    for name in ("flights", "frames", "step"):
        one = told[name][0] if name == "flights" else told[name]
        inner = {"tick", "field", "board", "twin"}
        assert set(one) == set(re.findall(r"`(\w+)`", keys[name][0])) - inner
    assert told["equal"] is True
    assert told["sha256_of_c"] == digest(made).hex()
    assert f"115200 baud, C {told['sha256_of_c']}\n" in said
    names = "report.html board.json golden-mission.png reset.png golden-mission.csv reset.csv"
    assert told["files"] == [str(tmp_path / "out" / name) for name in names.split()]
    figures = figures_of((tmp_path / "out/report.html").read_text("utf-8"))
    (depth,) = (one for one in figures["golden-mission"]["data"] if one["name"] == "measured")
    assert depth["y"] == pytest.approx(made.golden.depth.tolist(), rel=1e-5)
    assert figures["reset"]["layout"]["yaxis3"]["ticktext"][-1] == "restarted"
    assert told["flights"][0]["ticks"] == 101


def test_an_interruption_keeps_the_log(feup, host, tmp_path):
    def advance(_: float) -> None:
        raise KeyboardInterrupt

    asked = replace(SHORT, duration=120.0)
    with host() as port, pytest.raises(KeyboardInterrupt):
        board(limited(feup), port, asked, out=tmp_path / "out", advance=advance)
    assert len((tmp_path / "out/golden-mission.csv").read_text().splitlines()) > 200


@pytest.mark.parametrize("faults", [0, 1])
def test_a_cable_that_is_pulled_leaves_the_model_safe(host, faults, tmp_path, capsys):
    # answers before the flight: hello, another flight, and what begins each
    before = 1 + 101 * faults + BEGINS * (1 + faults)
    words = ["--missions", "1", "--duration", "30 s"] if faults else []
    with host("dies", before + 60) as port:
        out = str(tmp_path / "out")
        assert (
            main(["board", "feup-em", "--time-limit", "2 h", "--port", port, *words, "--out", out])
            == 1
        )
    name = "fault mission 0" if faults else "golden mission"
    said = capsys.readouterr().err
    found = re.search(
        rf"{port}: the port has gone, at tick 60 \(18 s\) of the {name}; the model had full "
        r"buoyancy from there on, and ended at (-?[\d.]+) m\. Check the cable and the board's",
        said,
    )
    assert found, said
    assert float(found[1]) < 1.1  # surfaced, or a metre below it
    assert f"the log so far is in {out}" in said
    log = (tmp_path / f"out/{name.replace(' ', '-')}.csv").read_text().splitlines()
    assert len(log) == 1 + 60


def test_a_board_that_answers_nothing(feup, host, tmp_path, monkeypatch):
    monkeypatch.setattr(wire, "_GREETING", 0.6)
    nothing = r"no board answers within 0.6 s .* close the serial monitor"
    with host("silent") as port, pytest.raises(InputError, match=nothing):
        board(limited(feup), port, SHORT, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_board_that_falls_silent(feup, host, tmp_path, monkeypatch):
    monkeypatch.setattr(wire, "_ANSWER", 0.1)
    silent = "no whole answer in 5 tries, at tick 50"
    with host("stops", 1 + BEGINS + 50) as port, pytest.raises(NoAnswerError, match=silent):
        board(limited(feup), port, SHORT, out=tmp_path / "out")


@pytest.mark.parametrize("percent", [8, 50, 1200])
def test_another_baud_rate(feup, host, percent, tmp_path, monkeypatch):
    monkeypatch.setattr(wire, "_GREETING", 0.6)
    garbage = "what it sends at 115200 baud is no frame .* Give the `baud=` of the sketch"
    with host("baud", percent) as port, pytest.raises(InputError, match=garbage):
        board(limited(feup), port, SHORT, out=tmp_path / "out")


@pytest.mark.usefixtures("gcc")
def test_another_version_of_the_protocol(feup, made, tmp_path):
    newer = {"#define HIL_PROTOCOL 2u": "#define HIL_PROTOCOL 3u"}
    program = hardware.host_program(made, tmp_path, newer)
    versions = "speaks version 3 of the protocol, and this program 2"
    with hardware.host_board(program) as port, pytest.raises(InputError, match=versions):
        board(limited(feup), port, SHORT, out=tmp_path / "out")


def test_the_library_of_another_vehicle(feup, host, tmp_path):
    hull = feup.hull.model_copy(update={"depth_limit": 20.0})
    other = feup.model_copy(update={"hull": hull})
    both = r"has the C \w{16}, and this vehicle's is \w{16}"
    with host() as port, pytest.raises(InputError, match=both):
        board(limited(other), port, SHORT, out=tmp_path / "out")


def test_what_the_flight_cannot_be_leaves_nothing(feup, host, tmp_path):
    out = tmp_path / "out"
    with host() as port, pytest.raises(InputError, match="duration"):
        board(limited(feup), port, Flights(duration=-1.0), out=out)
    assert not out.exists()
    (out / "golden-mission.csv").mkdir(parents=True)
    with host() as port, pytest.raises(InputError, match="out: cannot write the log: Is a dir"):
        board(limited(feup), port, SHORT, out=out)


def test_a_port_that_does_not_exist(capsys, tmp_path):
    out = str(tmp_path / "out")
    assert (
        main(["board", "feup-em", "--time-limit", "2 h", "--port", "/dev/no-board", "--out", out])
        == 2
    )
    said = capsys.readouterr().err
    assert "--port: cannot open the port: No such file or directory (got '/dev/no-board')" in said
    assert "the log so far" not in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("missions", [-1, 2.5])
def test_a_number_of_missions_that_is_none(feup, missions, tmp_path):
    with pytest.raises(InputError, match="missions: must be a whole number"):
        board(limited(feup), "/dev/no-board", Flights(missions=missions), out=tmp_path / "out")
