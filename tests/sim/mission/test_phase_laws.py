"""Missions flown by laws that sample: `simulate` is the oracle of the motion, SciPy of the rest."""

import dataclasses
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from swimbladder.cli import main
from swimbladder.control.law import leaves
from swimbladder.control.registry import bind
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.closed_loop.lane import rows
from swimbladder.sim.engine.accounts import Account as Sums
from swimbladder.sim.engine.rodas.drive import FULL
from swimbladder.sim.engine.rodas.records import Account, Doing, Note, Stop
from swimbladder.sim.mission import law_flight
from swimbladder.sim.mission.core import sampled
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.law_flight import ByLaws
from swimbladder.sim.mission.orders import law_facts, phase_laws
from swimbladder.sim.mission.prepare import cost_words
from swimbladder.sim.mission.result import MissionResult
from swimbladder.vehicle import HullPart, Load
from tests.quoted import numbers, refused
from tests.vehicles import TWO

FILES = Path(__file__).parents[2] / "frozen" / "inputs"


def flown(vehicle, mission, **more):
    column = more.pop("column", None) or uniform_column(vehicle.water, 200.0)
    return fly_mission(vehicle, mission, column, **more)


def steps(*phases, start=2.0, **more):
    return Mission(start_depth=start, phases=phases, **more)


HOLD = {"kind": "hold", "depth": 3.0, "tolerance": 1.2, "duration": 60.0}
PARK = {"kind": "park", "depth": 1.5, "tolerance": 1.2, "duration": 90.0}
DIVE = (
    {"kind": "descend", "depth": 8.0, "speed": 0.05, "tolerance": 1.0},
    {"kind": "park", "depth": 8.0, "tolerance": 2.0, "duration": 300.0},
    {"kind": "profile", "depth": 3.0, "tolerance": 1.0, "speed": 0.05},
    {"kind": "surface", "duration": 120.0},
)


def simulated(vehicle, flight, **more):
    """Return `simulate` with the set-points of a flight from 2 m, and the samples of its rows."""
    notes = flight.notes[flight.notes["what"] == Note.PHASE]
    depths = [phase.depth for phase in flight.mission.phases]
    pairs = [(float(t), z) for t, z in zip(notes["t"], depths, strict=True)]
    found = simulate(vehicle, setpoints=pairs, duration=flight.duration, start_depth=2.0, **more)
    samples = np.round(flight.rows["t"] / found.time[1]).astype(int)
    return found, samples


@pytest.mark.parametrize("name", TWO)
@pytest.mark.parametrize("seed", [None, 3])
def test_every_law_flies_as_it_is_simulated(name, seed):
    vehicle = load_vehicle(str(FILES / f"law-{name}.toml"))
    flight = flown(vehicle, steps(HOLD, PARK), seed=seed, checked=False)
    found, samples = simulated(vehicle, flight, seed=seed)
    assert flight.stop is Stop.FINISHED
    assert len(samples) > 100
    rows = flight.rows
    np.testing.assert_allclose(rows["z"], found.depth[samples], atol=1e-9)
    np.testing.assert_allclose(rows["w"], found.speed[samples], atol=1e-9)
    np.testing.assert_allclose(rows["v"], found.volume[samples], atol=1e-13)
    facts = law_facts(vehicle, flight.mission)
    assert [one["law"] for one in facts] == [name, name]
    assert facts[0]["sample_time_s"] == vehicle.controller.sample_time


@pytest.mark.parametrize("name", TWO)
def test_gains_change_the_dive(name):
    vehicle = load_vehicle(str(FILES / f"law-{name}.toml"))
    law = phase_laws(vehicle, steps(HOLD, PARK))[0]
    gain = next(key for key in vehicle.controller.parameters if key.lower().startswith("k_"))
    number = leaves(law.parameters)[gain]
    before = flown(vehicle, steps(HOLD, PARK), checked=False)
    phases = [{**phase, "parameters": {gain: 0.7 * number}} for phase in (HOLD, PARK)]
    after = flown(vehicle, steps(*phases), checked=False)
    n = min(len(before.rows), len(after.rows), 400)
    change = np.abs(before.rows["z"][:n] - after.rows["z"][:n]).max()
    assert change > 1e-6, gain


def test_the_sign_of_a_gain_loses_the_vehicle():
    """What happened to nobody while a mission left the controller out."""
    vehicle = load_vehicle("feup-em")
    good = flown(vehicle, steps(HOLD, PARK), checked=False)
    own = vehicle.controller
    turned = {**own.parameters, "k_pz": "1.043 dm3/m"}
    broken = vehicle.model_copy(
        update={"controller": own.model_copy(update={"parameters": turned})}
    )
    bad = flown(broken, steps(HOLD, PARK), checked=False)
    assert good.stop is Stop.FINISHED
    assert MissionResult(good, good.reach).completed
    assert not MissionResult(bad, bad.reach).completed


def test_layers_are_those_of_simulate():
    vehicle = load_vehicle("feup-em")
    even = uniform_column(vehicle.water, 50.0, step=0.1)
    density = even.density + 0.5 * np.tanh((even.depth - 2.2) / 0.4)
    column = dataclasses.replace(even, density=density, source="a step of salt")
    flight = flown(vehicle, steps(HOLD, PARK), column=column, checked=False)
    found, samples = simulated(vehicle, flight, cast=column)
    even = flown(vehicle, steps(HOLD, PARK), checked=False)
    np.testing.assert_allclose(flight.rows["z"], found.depth[samples], atol=1e-6)
    n = min(len(even.rows), len(flight.rows))
    assert np.abs(even.rows["z"][:n] - flight.rows["z"][:n]).max() > 1e-4


def test_a_speed_moves_the_depth_asked_for():
    """Small and slow: the loop follows a ramp with the lag of its velocity error, and no more."""
    vehicle = load_vehicle("feup-em")
    ramp = {**HOLD, "depth": 12.0, "speed": 0.02, "tolerance": 0.3}
    flight = flown(vehicle, steps(ramp), checked=False)
    t, z, w = (flight.rows[k] for k in ("t", "z", "w"))
    on_way = (t > 200.0) & (t < 480.0)
    assert np.abs(w[on_way] - 0.02).max() < 2e-3
    assert np.ptp(z[on_way] - 0.02 * t[on_way]) < 0.3


def test_energy_and_battery():
    """Drive, loads and self-discharge: `simulate`'s power over the way, and dC/dt = -P - s C."""
    vehicle = load_vehicle("example-eh")
    supply = vehicle.supply.model_copy(
        update={"capacity": 4e3, "self_discharge": 2e-4, "internal_resistance": 0.0}
    )
    vehicle = vehicle.model_copy(
        update={
            "supply": supply,
            "driver": None,
            "loads": (Load(name="board", power=0.5), Load(name="lamp", power=2.0, phases=["park"])),
        }
    )
    flight = flown(vehicle, steps(HOLD, PARK), checked=False)
    found, _ = simulated(vehicle, flight)
    a = flight.accounts
    drive = a[Account.PUMP_ENERGY] + a[Account.VALVE_ENERGY] + a[Account.HOLDING_ENERGY]
    back = found.balance.energy["source"]
    assert drive >= back - 1e-9  # without a driver that takes it back, what the sea gives is lost
    turn = float(flight.notes[flight.notes["what"] == Note.PHASE]["t"][1])
    loads = 0.5 * flight.duration + 2.0 * (flight.duration - turn)
    assert a[Account.LOAD_ENERGY] == pytest.approx(loads, rel=1e-9)
    t = flight.rows["t"]
    sums = sum(flight.rows[k] for k in ("pump_energy", "valve_energy", "holding_energy"))
    keep = np.concatenate(([True], np.diff(t) > 0.0))
    t, sums = t[keep], sums[keep]
    charge = 4e3
    for k in range(len(t) - 1):
        h = t[k + 1] - t[k]
        power = (sums[k + 1] - sums[k]) / h + 0.5 + (2.0 if t[k] >= turn else 0.0)
        done = solve_ivp(
            lambda _, c, p=power: -p - 2e-4 * c, (0.0, h), [charge], rtol=1e-11, atol=1e-11
        )
        charge = float(done.y[0, -1])
    assert flight.end["charge"] == pytest.approx(charge, rel=1e-9)
    balance = MissionResult(flight, flight.reach).balance
    assert balance.relative_residue < 1e-3
    assert abs(balance.volume_residue) < 1e-12


@pytest.mark.parametrize("power", [-3.0, 0.0, 2.0, 40.0])
@pytest.mark.parametrize("resistance", [0.0, 0.3])
def test_what_leaves_the_cells_is_the_terminals_and_what_the_battery_heats(power, resistance):
    """E i, where (E - R i) i is the power that driver and motor take: by the root of that."""
    own = sampled.Numbers(
        tick=0.5,
        weight=1e4,
        neutral_top=0.0,
        row_samples=1.0,
        longest=0.0,
        unseen=0.0,
        conductance=1.0,
        given=1.25,
        back=0.8,
        emf=12.0,
        resistance=resistance,
    )
    sums = np.zeros(len(Sums))
    sums[Sums.U_U] = power * own.tick
    drawn = power * (1.25 if power > 0.0 else 0.8)
    i = brentq(lambda i: (12.0 - resistance * i) * i - drawn, -1.0, 12.0, xtol=1e-14)
    found = sampled._energy(own, np.zeros(rows(0, 0)), sums)
    assert found == pytest.approx(12.0 * i * own.tick, rel=1e-9, abs=1e-12)


def test_a_positioner_takes_its_moving_power_for_as_long_as_its_travel_lasts():
    vehicle = load_vehicle("ntnu-bv")
    powers = {"moving_power": 3.0, "holding_power": 0.5}
    actuator = vehicle.actuator.model_copy(update=powers)
    vehicle = vehicle.model_copy(update={"actuator": actuator, "driver": None, "supply": None})
    flight = flown(vehicle, steps(HOLD, PARK), checked=False)
    a = flight.accounts
    on = (a[Account.PUMPED] + a[Account.LET_IN]) / (actuator.speed * actuator.piston_area)
    assert 10.0 < on < 0.9 * flight.duration
    drive = a[Account.PUMP_ENERGY] + a[Account.VALVE_ENERGY] + a[Account.HOLDING_ENERGY]
    assert drive == pytest.approx(3.0 * on + 0.5 * (flight.duration - on), rel=1e-3)


def test_what_falls_on_the_bottom_is_booked():
    """A stepper that overshoots lands; what it hits with is that of `simulate`, in the balance."""
    vehicle = load_vehicle("ntnu-bv")
    task = steps({**HOLD, "depth": 6.0, "tolerance": 0.5, "duration": 300.0}, bottom_depth=6.0)
    flight = flown(vehicle, task, checked=False)
    assert np.any(flight.notes["what"] == Note.BOTTOM)
    found, _ = simulated(vehicle, flight, bottom_depth=6.0)
    blows = found.balance.energy["bottom"]
    assert abs(blows) > 0.1
    assert flight.accounts[Account.IMPACTS] == pytest.approx(abs(blows), rel=1e-6)
    assert MissionResult(flight, flight.reach).balance.relative_residue < 1e-3


def test_the_battery_ends_the_mission():
    vehicle = load_vehicle("example-eh")
    supply = vehicle.supply.model_copy(update={"capacity": 200.0})
    vehicle = vehicle.model_copy(update={"supply": supply, "loads": (Load(name="b", power=5.0),)})
    flight = flown(vehicle, steps(HOLD, PARK), checked=False)
    assert flight.stop is Stop.BATTERY_EMPTY
    assert flight.duration <= 200.0 / 5.0


@pytest.mark.parametrize("name", ["feup-em", "ntnu-bv"])
def test_it_dives_and_comes_up(name):
    vehicle = load_vehicle(name)
    flight = flown(vehicle, Mission(cycles=2, phases=DIVE))
    assert flight.stop is Stop.FINISHED
    assert len(flight.cycles) == 2
    assert MissionResult(flight, flight.reach).completed
    assert flight.end["z"] < vehicle.hull.emergence_depth + 0.5
    what = flight.notes["what"]
    assert np.sum(what == Note.AFLOAT) == 2
    assert np.sum(what == Note.ARRIVED) == 8
    assert np.all(np.diff(flight.rows["t"]) >= 0.0)
    assert MissionResult(flight, flight.reach).balance.relative_residue < 1e-3


def test_too_deep_it_presses_all_out_and_comes_up():
    vehicle = load_vehicle("ntnu-bv")
    mission = steps(
        {"kind": "hold", "depth": 6.0, "tolerance": 0.5, "duration": 600.0},
        safety={"deepest": 4.0},
    )
    flight = flown(vehicle, mission, checked=False)
    assert flight.stop is Stop.PASSED_DEPTH
    assert np.any(flight.notes["what"] == Note.TOO_DEEP)
    assert flight.end["v"] == pytest.approx(vehicle.stroke.maximum, rel=1e-3)


def test_a_limit_switch_ends_what_is_pressed_out():
    """It is afloat with the volume at which the switch cuts its motor, which coasts a little."""
    own = load_vehicle("feup-em")
    stroke = own.stroke.model_copy(update={"switch_margin": 40e-6})
    phases = [
        {"kind": "descend", "depth": 4.0, "tolerance": 0.5},
        {"kind": "surface", "duration": 30.0},
    ]
    flight = flown(own.model_copy(update={"stroke": stroke}), Mission(phases=phases))
    assert flight.stop is Stop.FINISHED
    assert flight.rows["v"][0] == stroke.highest
    nearly = FULL * (stroke.highest - stroke.lowest)
    assert stroke.highest - nearly <= flight.end["v"] < stroke.maximum


def test_what_happens_is_known_at_a_sample():
    """Phases begin and end, and a vehicle is afloat, at whole samples."""
    vehicle = load_vehicle("feup-em")
    flight = flown(vehicle, Mission(cycles=2, phases=DIVE))
    of_phases = np.isin(flight.notes["what"], [Note.PHASE, Note.ARRIVED, Note.AFLOAT, Note.CYCLE])
    samples = flight.notes["t"][of_phases] / vehicle.controller.sample_time
    np.testing.assert_allclose(samples, np.round(samples), atol=1e-6)
    assert flight.whole["steps"] == round(flight.duration / vehicle.controller.sample_time)


class TestRest:
    MISSION = steps(
        {"kind": "park", "depth": 3.0, "tolerance": 0.8, "rest_band": 0.5, "duration": 7200.0}
    )

    @pytest.mark.parametrize("seed", [None, 5])
    def test_the_law_rests_within_its_band(self, seed):
        vehicle = load_vehicle("ntnu-bv")
        flight = flown(vehicle, self.MISSION, checked=False, seed=seed)
        awake = flown(
            vehicle,
            steps({"kind": "park", "depth": 3.0, "tolerance": 0.8, "duration": 7200.0}),
            checked=False,
        )
        held = MissionResult(flight, flight.reach).held["park"]
        assert held["share"] > 0.99
        most = 0.2 if seed is None else 0.3  # of the samples; noise looks like drift
        assert flight.whole["calls"] < most * awake.whole["calls"]
        assert len(flight.rows) < len(awake.rows)
        still = flight.rows["z"][flight.rows["doing"] == Doing.NOTHING]
        assert len(still) > 100
        assert np.abs(still - 3.0).max() < 0.5 + 0.1  # the band, and a look's drift

    def test_at_the_surface_rows_are_as_seldom_as_anywhere(self):
        """It rests there by no law, so that no check of one makes a row."""
        task = Mission(
            phases=[*self.MISSION.phases, {"kind": "surface", "duration": 400_000.0}],
            start_depth=3.0,
        )
        flight = flown(load_vehicle("ntnu-bv"), task, checked=False)
        afloat = flight.rows["t"][(flight.rows["phase"] == 1) & (flight.rows["z"] < 0.5)]
        assert 30_000 < len(afloat) < 60_000  # of 400,000 samples of about a second

    def test_a_band_that_does_not_fit_is_refused(self):
        with refused(InputError, field="phases[0].rest_band"):
            steps({"kind": "descend", "depth": 3.0, "rest_band": 0.5})
        with refused(InputError, field="phases[0].rest_band"):
            steps({"kind": "park", "depth": 3.0, "tolerance": 0.3, "rest_band": 0.5, "duration": 9})
        with refused(InputError, field="phases[0].rest_band", value=0.5):
            flown(load_vehicle("example-float"), self.MISSION)


class TestPhases:
    @pytest.mark.prove
    def test_another_law_in_a_phase(self):
        """From its begin on it is that law from rest, with the vehicle as it comes."""
        vehicle = load_vehicle("feup-em")
        other = load_vehicle(str(FILES / "law-sea-cascade.toml")).controller
        park = {**PARK, "law": other.law, "parameters": other.parameters}
        flight = flown(vehicle, steps(HOLD, park), checked=False)
        facts = law_facts(vehicle, flight.mission)
        assert [one["law"] for one in facts] == ["cascade", "sea-cascade"]
        assert facts[0]["source"].startswith("the vehicle's [controller]")
        assert facts[1]["source"] == "the phase"
        plain = flown(vehicle, steps(HOLD, PARK), checked=False)
        turn = plain.notes[plain.notes["what"] == Note.PHASE]["t"][1]
        a, b = (f.rows["z"][f.rows["t"] <= turn] for f in (flight, plain))
        np.testing.assert_array_equal(a, b)
        assert abs(flight.end["z"] - plain.end["z"]) > 1e-4

    @pytest.mark.parametrize(
        ("more", "field"),
        [
            ({"law": "casc"}, "phases[0].law"),
            ({"law": "position-pid"}, "phases[0].law"),
            ({"parameters": {"k_q": 1.0}}, "phases[0].parameters.k_q"),
            ({"parameters": {"k_pz": "3 kg"}}, "phases[0].parameters.k_pz"),
            ({"check_interval": 30.0}, "phases[0].check_interval"),
        ],
    )
    def test_what_does_not_fit_is_refused(self, more, field):
        with pytest.raises(InputError) as caught:
            flown(load_vehicle("feup-em"), steps({**HOLD, **more}))
        assert caught.value.field == field
        assert caught.value.remedy

    def test_a_law_for_another_actuator_is_refused(self):
        own = load_vehicle("ntnu-bv").controller
        phase = {**HOLD, "law": own.law, "parameters": own.parameters}
        with refused(InputError, field="phases[0].law", value="position-pid"):
            flown(load_vehicle("feup-em"), steps(phase))

    def test_rate_is_in_every_phase_or_in_none(self):
        vehicle = load_vehicle("feup-em")
        with refused(InputError, field="phases[1].law", value="rate"):
            flown(vehicle, steps(HOLD, {**PARK, "law": "rate"}))
        both = steps({**HOLD, "law": "rate"}, {**PARK, "law": "rate"})
        assert phase_laws(vehicle, both) == ()
        assert "rests" in law_facts(vehicle, both)[0]["source"]

    def test_what_only_the_missions_own_rule_flies_is_refused(self):
        waves = {"swell": [{"amplitude": 0.5, "period": 9.0}]}
        with refused(InputError, field="water_motion"):
            flown(load_vehicle("feup-em"), steps(HOLD, water_motion=waves))

    def test_a_hull_that_is_as_warm_as_the_water_is_flown_and_one_that_lags_is_not(self):
        vehicle = load_vehicle("feup-em")
        volume = vehicle.hull.displaced_volume
        tube = HullPart(name="tube", volume=volume, compressibility=0.0, thermal_expansion=7e-5)
        warm = vehicle.hull.model_copy(update={"parts": (tube,)})
        assert warm.thermal_time_constant == 0.0
        assert len(phase_laws(vehicle.model_copy(update={"hull": warm}), steps(HOLD))) == 1
        late = warm.model_copy(update={"thermal_time_constant": 600.0})
        with refused(InputError, field="hull.thermal_time_constant", value=600.0):
            phase_laws(vehicle.model_copy(update={"hull": late}), steps(HOLD))

    def test_a_law_that_would_be_called_too_often(self):
        phase = {**PARK, "duration": 4000 * 86400.0}
        with refused(NoAnswerError, holds={1152.0, 1000.0, 0.3, 230.0}) as caught:
            flown(load_vehicle("feup-em"), steps(phase), checked=False)
        assert "rest_band" in str(caught.value)

    def test_a_sample_that_is_too_long_is_that_of_the_phase(self):
        with refused(InputError, field="phases[1].sample_time", value=7 * 86400.0):
            flown(load_vehicle("feup-em"), steps(HOLD, {**PARK, "sample_time": 7 * 86400.0}))


class TestCost:
    """Of all samples in all cycles, at 0.3 s and 0.2 us each."""

    DAY = 86400.0

    def words(self, days, **more):
        vehicle = load_vehicle("feup-em")
        duration = {"duration": days * self.DAY}
        mission = Mission(phases=[{**PARK, **duration}, {**HOLD, **duration}], **more)
        return cost_words(mission, phase_laws(vehicle, mission))

    def test_few_samples_say_nothing(self):
        assert self.words(50, cycles=1) == []

    @pytest.mark.parametrize(
        ("more", "cycles"),
        [
            ({"cycles": 10}, 10),
            ({"duration": 1000 * DAY}, 10),
            ({"duration": 1000 * DAY, "cycles": 8}, 8),
            ({"duration": 1000 * DAY, "cycles": 12}, 10),
        ],
    )
    def test_all_cycles_count(self, more, cycles):
        (found,) = self.words(50, **more)
        samples = cycles * 100 * self.DAY / 0.3
        assert {float(f"{samples / 1e6:.4g}"), cycles, round(2e-7 * samples)} <= numbers(found)
        assert "rest_band" in found

    def test_too_many_in_all_cycles_are_refused(self):
        assert self.words(50, cycles=34)
        with refused(NoAnswerError, holds={1008.0, 35.0, 202.0}):
            self.words(50, cycles=35)

    def test_what_may_rest_and_the_missions_own_rule_cost_nothing(self):
        vehicle = load_vehicle("feup-em")
        for more in ({"rest_band": 0.5}, {"law": "rate"}):
            mission = steps({**PARK, "duration": 1e5 * self.DAY, **more})
            assert cost_words(mission, phase_laws(vehicle, mission)) == []

    def test_it_is_said_before_the_flight(self, tmp_path, monkeypatch, capsys):
        """On stderr, of the cycles asked for, and nothing of it where the flight is refused."""
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr("swimbladder.sim.mission.prepare._MANY", 300.0)
        Path("m.toml").write_text(
            'schema_version = 1\nstart_depth = "2 m"\n[[phases]]\nkind = "park"\ndepth = "3 m"\n'
            'tolerance = "1 m"\nduration = "1 min"\n'
        )
        assert main(["mission", "feup-em", "m.toml", "--cycles", "1"]) in (0, 1)
        assert "rest_band" not in capsys.readouterr().err
        assert main(["mission", "feup-em", "m.toml", "--cycles", "2"]) in (0, 1)
        said = capsys.readouterr()
        assert "in 2 cycles" in said.err
        assert "in 2 cycles" in said.out
        monkeypatch.setattr("swimbladder.sim.mission.prepare._MOST", 300)
        assert main(["mission", "feup-em", "m.toml", "--cycles", "2"]) == 1
        assert capsys.readouterr().err.count("in 2 cycles") == 1


def test_the_answer_names_law_and_source(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("m.toml").write_text(
        'schema_version = 1\nstart_depth = "2 m"\n[[phases]]\nkind = "hold"\ndepth = "3 m"\n'
        'tolerance = "0.3 m"\nduration = "1 min"\nparameters = { k_pz = "-0.12 dm3/m" }\n'
    )
    assert main(["mission", "feup-em", "m.toml", "--out", "o"]) in (0, 1)
    out = capsys.readouterr().out
    assert "law 'cascade' alone flies all phases every 0.3 s" in out
    assert "but for k_pz of the phase" in out
    answer = json.loads(Path("o/mission.json").read_text())
    assert answer["laws"][0]["law"] == "cascade"
    assert math.isclose(answer["laws"][0]["parameters"]["k_pz"], -0.12e-3)


class TestPumpAndValve:
    def test_a_phase_replaces_numbers_of_the_vehicles_law(self, profiler, sea):
        def arrival(**more):
            phase = {"kind": "descend", "depth": 150.0, "tolerance": 5.0, **more}
            flight = flown(profiler, Mission(phases=[phase]), column=sea)
            return flight.duration, law_facts(profiler, flight.mission)[0]

        (plain, _), (slow, facts) = arrival(), arrival(parameters={"near_speed": "1 cm/s"})
        assert slow > 1.3 * plain
        assert facts["law"] == "rate"
        assert facts["parameters"]["near_speed"] == 0.01
        assert "but for near_speed of the phase" in facts["source"]

    @pytest.mark.parametrize(
        ("kind", "more"),
        [
            ("descend", {}),
            ("descend", {"tolerance": 40.0}),
            ("descend", {"speed": 0.02}),
            ("descend", {"check_interval": 100.0, "parameters": {"dead": "9 s", "far": "70 m"}}),
            ("profile", {"parameters": {"far_speed": "7 cm/s"}}),
            ("park", {"duration": 3600.0}),
        ],
    )
    def test_the_source_names_what_is_not_of_the_controller(self, profiler, kind, more):
        mission = Mission(phases=[{"kind": kind, "depth": 150.0, **more}])
        facts = law_facts(profiler, mission)[0]
        own = leaves(bind(profiler.controller)[1])
        other = {name for name, x in facts["parameters"].items() if x != own[name]}
        said = facts["source"].partition(", but ")[2].partition(", made by")[0]
        assert set(re.findall(r"\w+", said)) - {"for", "and", "of", "the", "phase"} == other
        assert kind != "park" or "dead" in other
        assert ("of the phase" in said) == ("parameters" in more)
        assert "dead of the phase" not in said

    @pytest.mark.parametrize("more", [{}, {"law": "rate"}, {"parameters": {"dead": "9 s"}}])
    def test_a_sample_time_does_nothing_and_is_refused(self, profiler, more):
        phase = {"kind": "descend", "depth": 150.0, "sample_time": 2.0, **more}
        with refused(InputError, field="phases[0].sample_time", value=2.0) as caught:
            phase_laws(profiler, Mission(phases=[phase]))
        assert "check_interval" in caught.value.remedy

    def test_rate_needs_no_sample_time_of_a_vehicle_without_a_controller(self, profiler):
        bare = profiler.model_copy(update={"controller": None})
        given = {"law": "rate", "parameters": profiler.controller.parameters}
        mission = Mission(phases=[{"kind": "descend", "depth": 150.0, **given}])
        assert phase_laws(bare, mission) == ()
        assert law_facts(bare, mission)[0]["source"] == "the phase"

    def test_a_rest_band_is_refused_with_why(self, profiler):
        phase = {**PARK, "depth": 50.0, "rest_band": 0.5}
        with refused(InputError, field="phases[0].rest_band", value=0.5) as caught:
            phase_laws(profiler, Mission(phases=[phase]))
        assert "so does its board" in str(caught.value)
        assert "[controller]" not in str(caught.value)
        with refused(InputError, field="phases[0].rest_band", value=0.5) as caught:
            phase_laws(load_vehicle("feup-em"), Mission(phases=[{**phase, "law": "rate"}]))
        assert "called at each sample, not 'rate'" in caught.value.remedy

    @pytest.mark.parametrize("parameters", [{}, {"k_p": 1.0}])
    @pytest.mark.parametrize("name", ["example-float", "ntnu-bv"])
    def test_a_law_that_the_actuator_does_not_take_is_refused_first(self, name, parameters):
        vehicle = load_vehicle(name)
        for one in (vehicle, vehicle.model_copy(update={"controller": None})):
            phase = {**HOLD, "law": "cascade", "parameters": parameters}
            with refused(InputError, field="phases[0].law", value="cascade") as caught:
                phase_laws(one, steps(phase))
            assert f"a voltage, but the actuator takes a {vehicle.command}" in str(caught.value)


def test_a_vehicle_without_a_controller_takes_the_law_of_its_phases():
    vehicle = load_vehicle("feup-em")
    own, bare = vehicle.controller, vehicle.model_copy(update={"controller": None})
    given = {"law": own.law, "parameters": own.parameters, "sample_time": own.sample_time}
    found = flown(bare, steps({**HOLD, **given}, {**PARK, **given}), checked=False)
    same = flown(vehicle, steps(HOLD, PARK), checked=False)
    np.testing.assert_array_equal(found.rows, same.rows)
    assert "no [controller]" in law_facts(bare, steps(HOLD, PARK))[0]["source"]
    with refused(InputError, field="phases[0].sample_time"):
        flown(bare, steps({**HOLD, "law": own.law, "parameters": own.parameters}))
    with refused(InputError, field="phases[1].parameters"):
        flown(bare, steps(HOLD, {**PARK, "parameters": {"k_pz": 1.0}}))


@pytest.mark.parametrize(("parts", "drawn"), [(2, law_flight._CHUNK), (10, 700)])
def test_a_killed_flight_goes_on_to_the_same_end_bit_for_bit(tmp_path, monkeypatch, parts, drawn):
    """Noise, a law of its own in each phase and one that rests: all of it is there again."""
    own = load_vehicle("feup-em")
    noisy = own.sensors.model_copy(update={"depth_noise": 0.002, "depth_quantum": 0.001})
    vehicle = own.model_copy(update={"sensors": noisy})
    column = uniform_column(vehicle.water, 50.0)
    task = steps(
        {**HOLD, "duration": 1300.0, "parameters": {"k_dz": "-2 dm3 s/m"}},
        {**PARK, "duration": 900.0, "rest_band": 0.5},
    )
    monkeypatch.setattr(ByLaws, "rows", 500)
    monkeypatch.setattr(law_flight, "_CHUNK", drawn)  # of noise, and between calls

    def kill(_):
        if len(list(tmp_path.iterdir())) == parts:
            raise KeyboardInterrupt

    def fly(**options):
        return fly_mission(vehicle, task, column, seed=4, checked=False, **options)

    with pytest.raises(KeyboardInterrupt):
        fly(keep=tmp_path, advance=kill)
    left, spans = [], []
    again, whole = fly(keep=tmp_path, advance=left.append), fly(advance=spans.append)
    assert 0 < len(left) <= len(spans) - parts, "it goes on after the parts that were kept"
    for name in ("rows", "notes", "cycles", "end", "whole", "accounts"):
        assert getattr(again, name).tobytes() == getattr(whole, name).tobytes(), name
