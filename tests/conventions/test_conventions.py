"""docs/explanation/conventions.md, sentence by sentence: what is said there is so."""

import math
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.io.presets import preset_names
from swimbladder.physics.actuator import reduced
from swimbladder.physics.dynamics import acceleration, drag_per_mass, plant
from swimbladder.sim.closed_loop import StopReason, drive, simulate, simulate_ensemble, step_metrics
from swimbladder.sim.closed_loop.solution import VARIABLES
from swimbladder.vehicle import Drag, IdentifiedActuator, PhysicalMotion, Sensors

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "conventions.md"
PRESETS = [n for n in preset_names() if load_vehicle(n).command != "volume change"]  # simulated
MOTORS = [name for name in PRESETS if load_vehicle(name).voltage_driven]
CM3 = 1e-6


@pytest.fixture(scope="module")
def feup():
    return load_vehicle("feup-em")


@pytest.fixture(scope="module")
def step(feup):
    return simulate(feup, setpoints=[(0.0, 3.0)], duration=60.0, start_depth=1.5)


def held(vehicle, volume, *, depth, duration=60.0, **more):
    """Return the motion with a constant volume."""
    time = np.arange(0.0, duration, 0.3)
    return drive(vehicle, time=time, volume=np.full_like(time, volume), start_depth=depth, **more)


def table(heading):
    """Return the rows of the first table below a heading of the page, as lists of cells."""
    text = PAGE.read_text(encoding="utf-8").split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows[1:]]


def listed(heading):
    """Return what the list below a heading of the page explains: the texts before the colons."""
    text = PAGE.read_text(encoding="utf-8").split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return [line[2:].split(":")[0] for line in text.splitlines() if line.startswith("- ")]


# Signs and references


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("surplus", [10 * CM3, -10 * CM3])
def test_more_volume_makes_the_vehicle_rise_and_depth_grows_downwards(name, surplus):
    vehicle = load_vehicle(name)
    s = held(vehicle, vehicle.neutral_volume(20.0) + surplus, depth=20.0)
    assert np.all(np.sign(s.speed[1:]) == -np.sign(surplus))
    assert np.all(np.diff(s.depth) * surplus < 0.0)


@pytest.mark.parametrize("name", PRESETS)
def test_a_vehicle_is_neutral_at_depth_z_with_psi_z_and_the_trim_error(name):
    vehicle = load_vehicle(name)
    for depth in (2.0, 10.0):
        V = vehicle.hull.psi * depth + vehicle.trim_error
        assert vehicle.neutral_volume(depth) == V
        assert acceleration(V, depth, 0.0, plant(vehicle)) == pytest.approx(0.0, abs=1e-15)
        s = held(vehicle, V, depth=depth)
        assert s.depth == pytest.approx(np.full_like(s.depth, depth), abs=1e-12)


@pytest.mark.parametrize("name", PRESETS)
def test_volume_counts_from_mid_stroke(name):
    stroke = load_vehicle(name).stroke
    assert stroke.maximum == -stroke.minimum > 0.0


def test_a_hull_softer_than_water_runs_away_from_every_depth_and_a_stiffer_one_comes_back(feup):
    deeper = feup.neutral_volume(10.0) - 1 * CM3
    assert feup.hull.psi > 0.0
    soft = held(feup, deeper, depth=10.0, duration=600.0)
    assert soft.depth[-1] > 20.0
    assert soft.speed[-1] > soft.speed[len(soft.speed) // 2] > 0.0
    stiff = feup.model_copy(update={"hull": feup.hull.model_copy(update={"psi": -feup.hull.psi})})
    back = held(stiff, stiff.neutral_volume(10.0) - 1 * CM3, depth=10.0, duration=3000.0)
    assert back.depth[-1] == pytest.approx(10.0 + 1 * CM3 / feup.hull.psi, abs=1e-6)


@pytest.mark.parametrize("name", MOTORS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_positive_voltage_makes_the_volume_grow(name, sign):
    vehicle = load_vehicle(name)
    time = np.arange(0.0, 3.0, 0.1)
    s = drive(vehicle, time=time, voltage=np.full_like(time, 8.0 * sign), start_depth=2.0)
    assert np.all(np.diff(s.volume) * sign > 0.0)
    assert np.all(s.motor_rate[1:] * sign > 0.0)
    if not np.all(np.isnan(s.current)):
        assert s.current[0] * sign > 0.0


def test_speed_is_the_derivative_of_depth_and_motor_rate_that_of_volume(step):
    dt = step.time[1] - step.time[0]
    slope = (step.depth[2:] - step.depth[:-2]) / (2.0 * dt)
    assert slope[30:] == pytest.approx(step.speed[31:-1], abs=2e-5)
    steady = slice(80, -1)  # the motor follows slowly, nothing leaks
    slope = (step.volume[2:] - step.volume[:-2]) / (2.0 * dt)
    assert slope[steady] == pytest.approx(step.motor_rate[1:-1][steady], abs=2e-9)


def test_results_carry_si_units(step):
    data = step.dataset()
    units = {name: data[name].attrs["units"] for name in data.data_vars}
    assert units == {
        "depth": "m",
        "reference": "m",
        "speed": "m s-1",
        "volume": "m3",
        "motor_rate": "m3 s-1",
        "voltage": "V",
        "volume_reference": "m3",
    }
    assert data.depth.attrs["positive"] == "down"


# The motion


@pytest.mark.parametrize("law", get_args(Drag.model_fields["law"].annotation))
def test_drag_is_what_its_row_says_symmetric_in_speed(feup, law):
    k_dl, k_dt, epsilon = 3.0, 50.0, 0.02
    turbulent = k_dt * epsilon**2
    formula = {
        "linear": lambda w: k_dl * w,
        "quadratic": lambda w: k_dt * w * w,
        "blended": lambda w: k_dl * w + k_dt * w * w,
        "switched": lambda w: (
            k_dl * w if w <= epsilon else k_dl * epsilon + k_dt * (w * w - epsilon**2)
        ),
        "switched-literal": lambda w: k_dl * w if w <= epsilon else k_dt * w * w,
    }[law]
    every = {"k_dl": k_dl, "k_dt": k_dt, "epsilon": epsilon}
    uses = {"linear": ["k_dl"], "quadratic": ["k_dt"], "blended": ["k_dl", "k_dt"]}
    drag = Drag(law=law, **{name: every[name] for name in uses.get(law, every)})
    vehicle = feup.model_copy(update={"motion": PhysicalMotion(dry_mass=33.0, drag=drag)})
    p = plant(vehicle)
    for w in (1e-4, 0.01, epsilon, 0.021, 0.3):
        force = drag_per_mass(w, p) * vehicle.mass
        assert force == pytest.approx(formula(w), rel=1e-12)
        assert drag_per_mass(-w, p) == -drag_per_mass(w, p)
    jump = (drag_per_mass(epsilon * (1 + 1e-9), p) - drag_per_mass(epsilon, p)) * vehicle.mass
    said = {row[0].strip("`"): row[-1] for row in table("The motion")}[law]
    jumps = 0.0 if said == "yes" else turbulent - k_dl * epsilon
    assert jump == pytest.approx(jumps, abs=1e-8)


def test_driving_divides_the_load_by_the_efficiency_and_back_driving_multiplies():
    vehicle = load_vehicle("example-em")
    eta = vehicle.actuator.drive.efficiency
    a = reduced(vehicle.actuator, vehicle.water)
    assert a.load_drive / a.load_back == pytest.approx(1.0 / eta**2)
    literal = vehicle.actuator.model_copy(update={"literal_efficiency": True})
    a = reduced(literal, vehicle.water)
    assert a.load_drive == a.load_back


def test_the_motor_sticks_in_the_band_of_voltages_between_its_loads():
    vehicle = load_vehicle("example-em")
    a = reduced(vehicle.actuator, vehicle.water)
    depth = 30.0
    low, high = a.load_back * depth - a.friction, a.load_drive * depth + a.friction
    assert high - low > 1.0
    time = np.array([0.0, 0.1, 0.2])
    for u, moves in ((low - 0.02, -1), (low + 0.02, 0), (high - 0.02, 0), (high + 0.02, 1)):
        s = drive(vehicle, time=time, voltage=np.full(3, u), start_depth=depth)
        change = s.volume[-1] - s.volume[0]
        assert np.sign(change) == moves if moves else abs(change) < 1e-9 * CM3
        assert (s.motor_rate[-1] == 0.0) == (moves == 0)


def test_an_identified_actuator_has_one_load_and_no_friction(feup):
    a = reduced(feup.actuator, feup.water)
    assert isinstance(feup.actuator, IdentifiedActuator)
    assert (a.load_drive, a.friction) == (a.load_back, 0.0)


def test_the_supply_cuts_the_command_and_sags():
    vehicle = load_vehicle("example-eh")
    E, R_b = vehicle.supply.voltage, vehicle.supply.internal_resistance
    R = vehicle.actuator.motor.resistance
    time = np.arange(0.0, 5.0, 0.1)
    s = drive(vehicle, time=time, voltage=np.full_like(time, 1000.0), start_depth=5.0)
    assert s.command[0] == 1000.0
    assert s.voltage[0] == pytest.approx(E / (1.0 + R_b / R))  # standing still
    e = reduced(vehicle.actuator, vehicle.water).kappa * s.motor_rate
    assert s.voltage == pytest.approx((E + R_b / R * e) / (1.0 + R_b / R))
    assert np.all(s.voltage < E)


def test_leakage_takes_volume_while_the_motor_is_stuck():
    vehicle = load_vehicle("example-eh")
    depth, time = 900.0, np.array([0.0, 0.5, 1.0])
    a = reduced(vehicle.actuator, vehicle.water)
    holding = 0.5 * (a.load_back + a.load_drive) * depth
    s = drive(vehicle, time=time, voltage=np.full(3, holding), start_depth=depth)
    assert a.k_l > 0.0
    assert np.all(s.motor_rate == 0.0)
    assert s.volume[-1] - s.volume[0] == pytest.approx(-a.k_l * depth, rel=1e-5)


# Edges


def kinds(solution):
    return [event.kind for event in solution.events]


def test_an_end_stop_takes_all_speed_and_holds_until_the_voltage_pulls_away(feup):
    time = np.arange(0.0, 40.0, 0.3)
    u = np.where(time < 20.0, 12.0, -12.0)
    s = drive(feup, time=time, voltage=u, start_depth=40.0)
    reached, left = s.events[:2]
    assert kinds(s)[:2] == ["reached the upper end stop", "left the upper end stop"]
    assert left.time == pytest.approx(time[u < 0.0][0], abs=1e-6)
    at_stop = (s.time > reached.time) & (s.time <= left.time)
    assert at_stop.sum() > 5
    assert s.volume[at_stop] == pytest.approx(feup.stroke.maximum, abs=1e-4 * CM3)
    assert s.volume.max() <= feup.stroke.maximum  # the limit itself is never passed
    assert np.all(s.motor_rate[at_stop] == 0.0)
    assert s.balance.energy["end stops"] > 0.0


def test_the_bottom_takes_all_speed_and_lets_go_above_the_neutral_volume(feup):
    bottom, after = 5.0, 100.0
    neutral = feup.neutral_volume(bottom)
    time = np.arange(0.0, 200.0, 0.3)
    volume = np.where(time < after, neutral - 30 * CM3, neutral + 30 * CM3)
    s = drive(feup, time=time, volume=volume, start_depth=3.0, bottom_depth=bottom)
    reached, left = s.events[:2]
    assert (reached.kind, left.kind) == ("reached the bottom", "left the bottom")
    lying = (s.time > reached.time) & (s.time < left.time)
    assert np.all(s.speed[lying] == 0.0)
    assert s.depth.max() == pytest.approx(bottom, abs=1e-6)
    assert np.interp(left.time, time, volume) == pytest.approx(neutral, abs=1e-3 * CM3)
    assert s.balance.energy["bottom"] > 0.0


def test_the_surface_is_a_spring_of_the_water_plane(feup):
    V = 50 * CM3
    s = held(feup, V, depth=0.5, duration=3000.0)
    A_w = feup.hull.waterplane_area
    assert s.depth[-1] == pytest.approx(-V / (A_w - feup.hull.psi), rel=1e-6)
    assert kinds(s)[0] == "began to emerge"
    small = 1e-4  # the period of small oscillations about that depth, from the stiffness
    p = plant(feup)
    stiffness = (
        acceleration(V, s.depth[-1] - small, 0.0, p) - acceleration(V, s.depth[-1] + small, 0.0, p)
    ) / (2.0 * small)
    expected = feup.water.specific_weight * (A_w - feup.hull.psi) / feup.mass
    assert stiffness == pytest.approx(expected, rel=1e-9)


def test_a_hull_that_leaves_the_water_stops_the_simulation(feup):
    stub = feup.model_copy(update={"hull": feup.hull.model_copy(update={"height": 0.005})})
    s = held(stub, 300 * CM3, depth=3.0, duration=600.0)
    assert s.stop is StopReason.LEFT_WATER
    assert len(s.time) < 2000
    assert all(len(values) == len(s.time) for values in (s.depth, s.voltage, s.power))


def test_a_bottomless_sea_ends_at_12_km(feup):
    s = held(feup, -300 * CM3, depth=3.0, duration=3000.0)
    assert s.stop is StopReason.TOO_DEEP
    assert s.depth[-1] < 12000.0


# Time


def test_the_duration_is_rounded_up_to_whole_ticks(feup):
    s = simulate(feup, setpoints=[(0.0, 2.0)], duration=10.0, start_depth=2.0)
    assert s.time == pytest.approx(0.3 * np.arange(35), abs=1e-12)


def test_a_set_point_between_two_ticks_holds_from_the_later_one(feup):
    s = simulate(feup, setpoints=[(0.0, 2.0), (1.0, 3.0)], duration=3.0, start_depth=2.0)
    assert s.reference.tolist() == [2.0] * 4 + [3.0] * 7


def test_the_command_is_held_between_ticks_without_delay(feup, step):
    replayed = drive(feup, time=step.time, voltage=step.voltage, start_depth=1.5)
    assert replayed.depth == pytest.approx(step.depth, abs=1e-12)
    assert replayed.volume == pytest.approx(step.volume, abs=1e-15)


def test_a_law_is_called_when_it_asks_to_be_rounded_up_to_whole_ticks(feup):
    for asked, ticks in ((0.3, 1), (0.7, 3), (0.9, 3), (1e-6, 1)):
        called = []

        def law(measurement, _, called=called, asked=asked):
            called.append(measurement.time)
            return 0.1 * len(called), asked

        s = simulate(feup, setpoints=[(0.0, 2.0)], duration=9.0, start_depth=2.0, law=law)
        assert called == pytest.approx(0.3 * np.arange(0, 31, ticks))
        assert s.voltage == pytest.approx(0.1 * (np.arange(31) // ticks + 1))


def test_measurements_have_noise_first_and_the_quantum_last(feup):
    sensors = Sensors(depth_noise=0.004, depth_quantum=0.01, volume_noise=3 * CM3)
    noisy = feup.model_copy(update={"sensors": sensors})
    runs = {}
    for label, seed in (("ideal", None), ("one", 1), ("again", 1), ("two", 2)):
        seen = []

        def hold(measurement, _, seen=seen):
            seen.append((measurement.depth, measurement.volume))
            return 0.0

        simulate(
            noisy,
            setpoints=[(0.0, 2.0)],
            duration=600.0,
            start_depth=0.0,
            start_volume=0.0,
            law=hold,
            seed=seed,
        )
        runs[label] = np.array(seen)
    assert np.all(runs["ideal"] == 0.0)
    assert np.array_equal(runs["one"], runs["again"])
    assert not np.array_equal(runs["one"], runs["two"])
    depth, volume = runs["one"].T
    assert depth == pytest.approx(np.round(depth / 0.01) * 0.01, abs=1e-15)
    # a quantum after noise: steps of 0.01 m are seen as often as |noise| passes half of one
    beyond = math.erfc(0.005 / 0.004 / math.sqrt(2.0))
    assert np.mean(depth != 0.0) == pytest.approx(beyond, abs=4.0 * math.sqrt(beyond / len(depth)))
    assert np.std(volume) == pytest.approx(3 * CM3, rel=0.07)


def test_runs_start_as_those_that_check_the_paper(step):
    """At rest at psi z0; the integral starts there; e(-1) = e(0), so there is no kick."""
    V0 = 4.04e-6 * 1.5
    assert (step.depth[0], step.speed[0], step.motor_rate[0]) == (1.5, 0.0, 0.0)
    assert step.volume[0] == pytest.approx(V0)
    assert step.volume_reference[0] == pytest.approx(-0.1043e-3 * 1.5 + V0)


def test_a_driven_volume_goes_linearly_from_instant_to_instant(feup):
    time, volume = np.array([0.0, 7.0, 9.0]), np.array([0.0, 70.0, 30.0]) * CM3
    fine = np.array([0.0, 3.5, 7.0, 8.0, 9.0])
    coarse = drive(feup, time=time, volume=volume, start_depth=5.0)
    between = drive(feup, time=fine, volume=np.interp(fine, time, volume), start_depth=5.0)
    assert coarse.depth[-1] == pytest.approx(between.depth[-1], abs=1e-12)
    beyond = drive(feup, time=time, volume=volume * 10.0, start_depth=5.0)
    assert beyond.volume[1] > feup.stroke.maximum  # as if the actuator followed it exactly


def test_a_positioner_goes_to_the_commanded_volume_at_its_rate_and_stops_there():
    vehicle = load_vehicle("ntnu-bv")
    target = 10 * CM3
    s = simulate(
        vehicle,
        setpoints=[(0.0, 1.0)],
        duration=20.0,
        start_depth=1.0,
        start_volume=0.0,
        law=lambda *_: target,
    )
    rate = vehicle.actuator.speed * vehicle.actuator.piston_area
    assert s.volume == pytest.approx(np.minimum(rate * s.time, target), abs=1e-15)
    assert s.volume[-1] == target
    assert np.all(np.isnan(s.voltage))
    beyond = simulate(
        vehicle,
        setpoints=[(0.0, 1.0)],
        duration=30.0,
        start_depth=1.0,
        start_volume=0.0,
        law=lambda *_: 1.0,
    )
    assert beyond.volume[-1] == vehicle.stroke.maximum


# Rows of a result, balance, reasons


def test_the_page_names_the_arrays_of_a_solution(step):
    named = set(re.findall(r"`(\w+)`", "".join(row[0] for row in table("Rows of a result"))))
    assert named == {*VARIABLES, "command"}
    assert all(len(getattr(step, name)) == len(step.time) for name in named)


def test_power_is_drawn_from_the_supply_with_the_loss_inside_it():
    vehicle = load_vehicle("example-eh")
    E, R_b = vehicle.supply.voltage, vehicle.supply.internal_resistance
    s = simulate(vehicle, setpoints=[(0.0, 12.0)], duration=120.0, start_depth=10.0)
    drawn = s.power / E
    assert s.power == pytest.approx(s.voltage * s.current + R_b * drawn**2)
    R, kappa = (
        getattr(reduced(vehicle.actuator, vehicle.water), n) for n in ("resistance", "kappa")
    )
    assert s.current == pytest.approx((s.voltage - kappa * s.motor_rate) / R)
    assert s.power.min() < 0.0 < s.power.max()  # it is charged while the motor brakes


def test_current_and_power_are_not_known_of_an_identified_motor(step):
    assert np.all(np.isnan(step.current))
    assert np.all(np.isnan(step.power))


def test_step_metrics_are_those_of_the_samples():
    time = np.arange(8.0)
    depth = np.array([1.0, 1.5, 1.9, 1.91, 2.1, 2.03, 2.01, 2.0])
    m = step_metrics(time, depth, start=1.0, target=2.0)
    assert (m.rise90_s, m.settle2_s) == (3.0, 5.0)
    assert m.overshoot_pct == pytest.approx(10.0)
    assert step_metrics(time[:6], depth[:6], start=1.0, target=2.0).settle2_s is None


@pytest.mark.parametrize("name", PRESETS)
def test_the_books_have_the_accounts_that_the_page_explains(name):
    vehicle = load_vehicle(name)
    s = simulate(vehicle, setpoints=[(0.0, 1.4)], duration=120.0, start_depth=0.8)
    balance = s.balance
    assert set(balance.energy) <= {name.strip("`") for name in listed("Balances")}
    assert balance.energy["source"] == pytest.approx(
        sum(value for key, value in balance.energy.items() if key != "source"),
        abs=1e-3 * balance.throughput,
    )
    assert balance.volume["change"] == pytest.approx(s.volume[-1] - s.volume[0], abs=1e-15)
    assert balance.volume["pumped"] - balance.volume["leaked"] == pytest.approx(
        balance.volume["change"], abs=1e-12
    )


def test_no_account_is_explained_that_no_vehicle_has():
    found = set()
    for name in PRESETS:
        vehicle = load_vehicle(name)
        found |= set(
            simulate(vehicle, setpoints=[(0.0, 1.4)], duration=6.0, start_depth=1.4).balance.energy
        )
    assert {name.strip("`") for name in listed("Balances")} == found


def test_the_page_lists_why_a_simulation_stops():
    reasons = [f"{reason.code} `{reason.name}`" for reason in StopReason]
    assert listed("Why a simulation stopped") == reasons


def test_a_law_without_a_number_stops_the_simulation_with_all_rows_so_far(feup):
    def law(measurement, _):
        return math.nan if measurement.time > 2.0 else 0.0

    s = simulate(feup, setpoints=[(0.0, 2.0)], duration=9.0, start_depth=2.0, law=law)
    assert s.stop is StopReason.LAW_NOT_FINITE
    assert s.time[-1] == pytest.approx(2.1)
    assert not s.finished


def test_an_ensemble_holds_the_codes_of_its_reasons(feup):
    data = simulate_ensemble(
        feup,
        count=2,
        setpoints=[(0.0, 0.05)],
        duration=120.0,
        start_depth=2.0,
        vary={"k_pz": [-0.1e-3, -1e-3], "z_air": [-1.285, -1e-4]},
    )
    assert data.stop.values.tolist() == [StopReason.FINISHED.code, StopReason.LEFT_WATER.code]
    assert data.stop_time[1] < data.stop_time[0] == pytest.approx(120.0)
