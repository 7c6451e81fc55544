"""Holds: the law that reckons with inertia and psi, what can be held, and coming up in time."""

import itertools
import math
import re

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm

from swimbladder.control.deadband import DeadbandParameters, deadband_gains, hold_begin, hold_step
from swimbladder.control.law import Measurement
from swimbladder.control.rate import RateParameters, approach_speed, decide
from swimbladder.design.tuning.margins import least_band
from swimbladder.errors import NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.records import Account, Stop, Table
from swimbladder.sim.mission.core.phases import Holding
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.orders import approach_time, growth_rate
from swimbladder.sim.mission.prepare import make_plan
from swimbladder.vehicle import HullPart, Sensors
from tests.quoted import numbers
from tests.vehicles import by_rule

FEUP = by_rule("feup-em")


def task(depth, tolerance, kind="hold", **more):
    first = {"kind": kind, "depth": depth, "tolerance": tolerance, "duration": 3600.0} | more
    return Mission(phases=[first, {"kind": "surface", "duration": 600.0}])


def water(vehicle, depth):
    return uniform_column(vehicle.water, max(2.0 * depth, 200.0))


def held(vehicle, mission, **more):
    depth = mission.phases[0].depth
    flight = fly_mission(vehicle, mission, water(vehicle, depth), **more)
    kept = flight.accounts[len(Account) :]
    share = kept[Holding.INSIDE] / kept[Holding.TIME] if kept[Holding.TIME] > 0.0 else 0.0
    return flight, share


def accepted(vehicle, mission):
    return refused(vehicle, mission) is None


@pytest.mark.parametrize("psi", [4e-6, 1e-7, 0.0, -4e-6])
def test_it_runs_away_as_the_root_of_its_motion_says(psi):
    drag = FEUP.drag.k_dl
    roots = np.roots([FEUP.mass, drag, -FEUP.water.specific_weight * psi])
    assert growth_rate(FEUP, psi, 0.1) == pytest.approx(
        max(max(roots.real), 0.0), rel=1e-9, abs=1e-15
    )


def test_on_its_own_model_an_error_falls_by_the_pole_from_wake_to_wake():
    """The exact linear motion, z'' T2 + z' = K2 (psi z + b - V), between wakes."""
    K2, T2, psi, interval = 8000.0, 36.0, 4e-6, 20.0
    gains = deadband_gains(K2, T2, psi, interval)
    law = DeadbandParameters(
        K2=K2,
        T2=T2,
        psi=psi,
        depth_noise=1e-5,
        neutral_step=1e-7,
        band=1e-6,
        speed_band=1e-9,
        fastest=10.0,
        **gains._asdict(),
        interval=interval,
        k_pV=0.0,
        tolerance=0.0,
        depth_voltage=0.0,
        rate_per_volt=0.0,
        voltage_limit=0.0,
        volume_min=-1.0,
        volume_max=1.0,
        S_p=1.0,
    )
    b, x, V = 2e-5, np.array([1.0, 0.0]), 2e-5 + 4e-6
    state = hold_begin(law, Measurement(0.0, x[0], V), 0.0)
    rates = np.zeros((3, 3))
    rates[0, 1], rates[1] = 1.0, (K2 * psi / T2, -1.0 / T2, K2 / T2)
    seen = [x[0]]
    for k in range(1, 9):
        change, state, sleep = hold_step(law, state, Measurement(20.0 * (k - 1), x[0], V))
        V += change
        assert sleep == interval
        x = (expm(rates * interval) @ np.array([*x, b - V]))[:2]
        seen.append(float(x[0]))
    # two poles at 0.2: from the second wake on the error is under (k + 1) 0.2^k of it
    assert abs(seen[4]) < 0.05
    assert abs(seen[8]) < 1e-3
    assert state.neutral == pytest.approx(b, abs=1e-7)


@pytest.mark.parametrize(("depth", "tolerance"), [(30.0, 1.0), (10.0, 0.5), (70.0, 5.0)])
def test_a_hull_that_gives_way_is_held(depth, tolerance):
    mission = task(depth, tolerance)
    assert accepted(FEUP, mission)
    flight, share = held(FEUP, mission)
    assert flight.stop is Stop.FINISHED
    assert share > 0.95


def test_it_is_held_with_a_sensor_that_is_not_perfect():
    sensors = FEUP.sensors.model_copy(update={"depth_noise": 2e-3, "depth_quantum": 5e-3})
    vehicle = FEUP.model_copy(update={"sensors": sensors})
    _, share = held(vehicle, task(30.0, 1.0), seed=3)
    assert share > 0.95
    with pytest.raises(NoAnswerError, match="noise of the depth"):
        held(vehicle, task(30.0, 0.01))


@pytest.mark.parametrize("name", ["example-eh", "ntnu-bv"])
def test_others_hold_the_same_band(name):
    flight, share = held(by_rule(name), task(30.0, 1.0))
    assert flight.stop is Stop.FINISHED
    assert share > 0.95


def unstable_float(psi):
    vehicle = load_vehicle("example-float")
    hull = vehicle.hull.model_copy(update={"parts": (), "trapped_air": 0.0, "psi": psi})
    return vehicle.model_copy(update={"hull": hull})


def test_what_is_accepted_is_not_lost(monkeypatch):
    """Vehicles, bands, intervals and speeds: whatever is not refused comes back, and was held."""
    monkeypatch.setattr("swimbladder.sim.mission.flight._nearest", lambda *_: None)
    flown = 0
    intervals = (None, 30.0, 60.0, 120.0)
    for vehicle, depth, tolerance, interval in itertools.chain(
        itertools.product([FEUP], (20.0, 60.0), (0.5, 5.0), intervals),
        itertools.product(
            [unstable_float(x) for x in (5e-7, 2e-6)], (60.0,), (2.0, 10.0), intervals
        ),
    ):
        for more in ({}, {"speed": 0.3}, {"kind": "park"}):
            mission = task(depth, tolerance, **more, check_interval=interval)
            try:
                flight, share = held(vehicle, mission)
            except NoAnswerError:
                continue
            assert flight.stop is Stop.FINISHED, mission.phases[0]
            assert share >= 0.9, mission.phases[0]
            flown += 1
    assert flown > 15


def test_samples_that_are_too_rare_are_refused_with_an_interval_that_does():
    mission = task(30.0, 1.0, check_interval=60.0)
    said = refused(FEUP, mission)
    psi, k, weight = FEUP.hull.psi, FEUP.drag.k_dl, FEUP.water.specific_weight
    root = float(np.max(np.roots([FEUP.mass, k, -weight * psi]).real))
    assert {60.0, float(f"{1.0 / root:.3g}")} <= numbers(said)  # s: interval, e-folding time
    _, share = held(FEUP, mission, checked=False)
    assert float(f"{100.0 * share:.3g}") in numbers(said)
    named = float(re.search(r"sample every ([\d.]+) s", said)[1])
    assert accepted(FEUP, task(30.0, 1.0, check_interval=named))
    vehicle = unstable_float(3e-6)
    assert 70.0 in numbers(refused(vehicle, task(60.0, 5.0)))  # s, between samples


def test_a_park_from_which_it_runs_away_is_refused_and_one_that_drifts_is_not():
    assert "e-folding time" in refused(unstable_float(5e-7), task(60.0, 5.0, "park"))
    flight, share = held(load_vehicle("example-float"), task(150.0, 0.9, "park"))
    assert share < 0.9
    assert flight.stop is Stop.FINISHED


def test_a_band_below_what_the_law_resolves_is_refused_and_the_one_it_names_is_not():
    vehicle = load_vehicle("example-float")
    said = refused(vehicle, task(150.0, 0.9))
    _, share = held(vehicle, task(150.0, 0.9), checked=False)
    assert share < 0.9  # flown all the same, it is no holding
    assert {0.2, 150.0, float(f"{100.0 * share:.3g}")} <= numbers(said)  # cm3, m, %
    named = float(re.search(r"Allow ([\d.]+) m", said)[1])
    assert accepted(vehicle, task(150.0, named))


@pytest.mark.parametrize("name", ["feup-em", "example-em", "ntnu-bv", "example-float"])
@pytest.mark.parametrize("tolerance", [1e-3, 4e-3, 0.02])
def test_the_band_that_is_named_is_accepted(name, tolerance):
    """Whatever it says to allow is enough: rounded up, and with the looks of that band."""
    vehicle, depth = by_rule(name), 10.0
    message = refused(vehicle, task(depth, tolerance))
    if message is None:
        return
    named = float(re.search(r"Allow ([\d.e-]+) m", message)[1])
    assert named > tolerance
    assert accepted(vehicle, task(depth, named))


@pytest.mark.parametrize("cycles", [1, 2])
def test_what_was_tried_on_a_first_cycle_is_named_for_that(cycles):
    vehicle, mission = load_vehicle("example-float"), task(150.0, 0.9)
    with pytest.raises(NoAnswerError) as error:
        held(vehicle, mission, cycles=cycles)
    named = re.findall(r"Allow [\d.]+ m( for the first cycle at least)?", str(error.value))
    assert named == ["" if cycles == 1 else " for the first cycle at least"]


def test_noise_that_is_assumed_is_said_to_be():
    bare = FEUP.model_copy(update={"sensors": Sensors()})
    message = refused(bare, task(10.0, 1e-3))
    assert "0.001 m 1 sigma, which is assumed where sensors state no more" in message
    assert "better sensor" not in message
    noisy = FEUP.model_copy(update={"sensors": Sensors(depth_noise=0.02)})
    message = refused(noisy, task(10.0, 0.05))
    assert "0.02 m (sensors)" in message
    assert "better sensor" in message


def refused(vehicle, mission):
    """Return why a mission is refused; None: it is not."""
    try:
        held(vehicle, mission, cycles=1)
    except NoAnswerError as error:
        return str(error)
    return None


def test_the_least_band_by_hand():
    vehicle = load_vehicle("example-float")
    law = RateParameters(
        1e-3, 5.0, 5.0, 50.0, 0.02, 0.03, 0.1, 0.1, 0.02, 0.0, 0.0, 50.0, 10.0, 60.0
    )
    # 1 cm3 makes sqrt(1e-6/1e-3) = 3.16 cm/s, 1.90 m in 60 s
    assert least_band(vehicle, 0.0, law, 1e-6) == pytest.approx(60.0 * math.sqrt(1e-3))
    # a stable one rests within 1 cm3/(1 cm3/m)
    assert least_band(vehicle, -1e-6, law, 1e-6) == pytest.approx(1.0)
    assert least_band(vehicle, -1e-6, law, 0.0) == 0.0


def test_a_change_below_a_step_is_a_step_outside_the_band():
    law = RateParameters(
        1e-3, 5.0, 5.0, 50.0, 0.02, 0.03, 0.1, 0.1, 0.02, 0.01, 2e-6, 50.0, 10.0, 60.0
    )
    # at rest 7 m above its target it is to sink at 2 cm/s, for which 0.4 cm3 would do
    assert decide(law, 143.0, 0.0, 150.0).change == -2e-6
    assert decide(law, 157.0, 0.0, 150.0).change == 2e-6
    assert decide(law, 149.0, 0.0, 150.0).change == 0.0


@pytest.mark.parametrize("way", [3.0, 12.0, 700.0])
def test_the_time_of_an_approach_is_the_integral_of_its_speeds(way):
    law = RateParameters(
        1e-3, 5.0, 10.0, 50.0, 0.02, 0.03, 0.1, 0.1, 0.02, 0.0, 0.0, 50.0, 10.0, 60.0
    )
    due = quad(
        lambda d: 1.0 / approach_speed(law, d),
        min(law.tolerance, way),
        way,
        points=[p for p in (10.0, 50.0) if p < way],
        limit=200,
    )[0]
    assert approach_time(law, way) == pytest.approx(due, rel=1e-6)
    mission = task(400.0, 5.0)
    vehicle = load_vehicle("example-float")
    plan = make_plan(vehicle, mission, water(vehicle, 400.0))
    own = RateParameters(*plan.stages["law"][0])
    assert plan.stages["timeout"][0] == 2.0 * approach_time(own, 400.0) + 3600.0
    flight, _ = held(vehicle, mission)
    assert flight.cycles["arrival"][0] < plan.stages["timeout"][0]


def test_a_slow_drive_may_not_go_as_deep_as_it_could_rest():
    """SciPy lets the vehicle sink at twice its speed, and presses out: where does it come up?"""
    actuator = FEUP.actuator.model_copy(update={"K1": FEUP.actuator.K1 / 40.0})
    slow = FEUP.model_copy(update={"actuator": actuator})
    column = uniform_column(slow.water, 150.0, step=0.5)
    mission = task(20.0, 1.0)
    plan = make_plan(slow, mission, column)
    found = plan.back
    rests = make_plan(FEUP, mission, column).back
    assert found < 0.9 * rests
    k, m, weight = slow.drag.k_dl, slow.mass, slow.water.specific_weight
    rates = plan.table[:, Table.RATE_OUT]

    def comes_up(depth):
        def f(_, y):
            z, w, v = y
            push = weight * (slow.hull.psi * z + slow.trim_error - min(v, slow.stroke.maximum))
            return [w, (push - k * w) / m, np.interp(z, column.depth, rates)]

        start = slow.neutral_volume(depth) - k * 0.2 / weight
        end = solve_ivp(
            f,
            (0.0, 3600.0),
            [depth, 0.2, start],
            rtol=1e-8,
            events=[
                _at(lambda z: z - depth + 1.0),
                _at(lambda z: z - 3.0 * rests),
            ],
        )
        return len(end.t_events[0]) > 0

    assert comes_up(found)
    assert not comes_up(found + rests / 100.0)
    own = load_vehicle("feup-em").model_copy(update={"actuator": actuator})  # by its sampled law
    assert make_plan(own, mission, column).back == pytest.approx(found, abs=rests / 100.0)


def _at(what):
    def event(_, y):
        return what(y[0])

    event.terminal = True
    return event


def test_a_stable_hull_always_comes_up():
    vehicle = load_vehicle("example-float")
    part = HullPart(name="hull", volume=vehicle.hull.displaced_volume, compressibility=1e-10)
    hull = vehicle.hull.model_copy(update={"parts": (part,)})
    stiff = vehicle.model_copy(update={"hull": hull})
    column = water(stiff, 1000.0)
    plan = make_plan(stiff, task(500.0, 5.0), column)
    assert plan.back == math.inf


@pytest.mark.parametrize("interval", [1.0, 2.0, 5.0, 20.0, None])
@pytest.mark.parametrize("name", ["example-eh", "example-em"])
def test_looks_far_quicker_than_the_vehicle_still_hold(name, interval):
    """In a second no volume moves a vehicle whose T2 is a minute by much: it counts though."""
    vehicle = by_rule(name)
    more = {} if interval is None else {"check_interval": interval}
    mission = Mission(
        phases=[
            {"kind": "descend", "depth": 50.0},
            {"kind": "hold", "depth": 50.0, "tolerance": 1.0, "duration": 3600.0} | more,
        ]
    )
    flight = fly_mission(vehicle, mission, water(vehicle, 50.0))
    kept = flight.accounts[len(Account) + len(Holding) :]
    assert kept[Holding.INSIDE] > 0.9 * kept[Holding.TIME] > 0.0
    assert kept[Holding.MOST] < 6.0
    law = DeadbandParameters(*flight.plan.stages["hold"][1])
    assert law.tolerance <= 0.5 * law.fastest / law.K2
    assert law.speed_band < law.fastest
