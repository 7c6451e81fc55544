"""Volume and energy accounts: they balance, they agree with quadrature, nothing creates energy."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from swimbladder.sim.closed_loop import Solution, drive, simulate
from swimbladder.vehicle import Drag, PhysicalMotion, Positioner
from tests.examples import examples
from tests.oracle import closed_loop
from tests.vehicles import (
    BLENDED,
    LINEAR,
    QUADRATIC,
    SWITCHED,
    paper,
    pump,
    screw,
    stepper,
    vehicles,
)

LOSSES = ("copper", "speed losses", "dry friction", "transmission", "leakage", "end stops", "drag")


def under(vehicle: Any, commands: list[float], *, tick: float = 0.5, **start: Any) -> Solution:
    """The vehicle under a list of commands, one per sample."""
    start = {"depth": 20.0} | start
    return simulate(
        vehicle,
        law=lambda seen, _: commands[round(seen.time / tick)],
        sample_time=tick,
        setpoints=[(0.0, start["depth"])],
        duration=tick * (len(commands) - 1),
        bottom_depth=start.pop("bottom", math.inf),
        parts=start.pop("parts", None),
        checked=False,
        **{f"start_{k}": v for k, v in start.items()},
    )


def wave(n: int, amplitude: float, offset: float = 0.0) -> list[float]:
    return [offset + amplitude * math.sin(0.37 * k) for k in range(n)]


def balanced(s: Solution) -> None:
    """Volume to the rounding of 1e5 steps, energy to 1e-3 of its throughput."""
    balance = s.balance
    moved = max(balance.volume["travel"], abs(balance.volume["pumped"]), s.vehicle.stroke.maximum)
    assert abs(balance.volume_residue) <= 1e-11 * moved
    assert balance.volume["change"] == pytest.approx(
        s.volume[-1] - s.volume[0], rel=1e-12, abs=1e-22
    )
    assert balance.relative_energy_residue <= 1e-3


@pytest.mark.parametrize("vehicle", [pump(), screw(friction=2e-3)], ids=["pump", "screw"])
def test_the_motor_is_on_as_long_as_it_has_a_voltage(vehicle):
    """10 s of 20, whether it turns under 6 V or is held by its friction under 0.01 V."""
    for volts in (6.0, 0.01):
        s = under(vehicle, [volts] * 20 + [0.0] * 21)
        assert s.balance.motor_on == pytest.approx(10.0, rel=1e-9)
    assert under(vehicle, [0.0] * 21).balance.motor_on == 0.0


CASES: dict[str, tuple[Any, dict[str, Any]]] = {
    "identified": (paper(), dict(commands=wave(80, 8.0))),
    "end stops": (paper(), dict(commands=wave(80, 12.0), volume=300e-6)),
    "screw": (screw(friction=2e-3, drag=BLENDED), dict(commands=wave(80, 9.0, 2.0))),
    "sagging supply": (screw(R_b=0.5, drag=SWITCHED), dict(commands=wave(80, 12.0))),
    "leaking pump": (pump(leak=2e-12, R_b=0.3), dict(commands=wave(80, 20.0), volume=150e-6)),
    "leak at the lower stop": (pump(leak=2e-11), dict(commands=wave(80, 3.0), volume=-195e-6)),
    "bottom": (paper(), dict(commands=wave(80, 12.0, -4.0), depth=9.0, bottom=9.5)),
    "surface": (screw(), dict(commands=wave(80, 9.0, 3.0), depth=1.0)),
    "coarse samples": (screw(drag=QUADRATIC), dict(commands=wave(20, 9.0), tick=5.0)),
}


@pytest.mark.parametrize("case", CASES)
def test_the_books_balance(case: str) -> None:
    vehicle, run = CASES[case]
    s = under(vehicle, **run)
    assert s.finished
    balanced(s)
    assert abs(s.balance.energy_residue) < 1e-5 * s.balance.throughput


def test_a_positioner_counts_its_work_on_the_water() -> None:
    s = under(stepper(BLENDED), [1e-4 * math.sin(0.2 * k) for k in range(80)])
    balanced(s)
    # rho g z dV summed along the way, from the samples
    z, V = s.depth, s.volume
    work = 9806.65 * np.sum(0.5 * (z[1:] + z[:-1]) * np.diff(V))
    assert s.balance.energy["source"] == pytest.approx(work, rel=2e-3)
    assert "do" not in s.balance.energy


def test_a_positioner_of_known_power_takes_one_while_it_moves_and_one_at_rest() -> None:
    vehicle = stepper(BLENDED).but("actuator", moving_power=4.0, holding_power=0.5)
    commands = [3e-5 * math.sin(0.2 * k) for k in range(80)]
    s = under(vehicle, commands)
    balanced(s)
    motor = vehicle.engine
    assert isinstance(motor, Positioner)
    on = float(np.abs(np.diff(s.volume)).sum()) / (motor.speed * motor.piston_area)
    whole = float(s.time[-1])
    assert 0.1 * whole < on < 0.9 * whole
    energy = s.balance.energy
    assert energy["source"] == pytest.approx(4.0 * on + 0.5 * (whole - on), rel=1e-6)
    work = under(stepper(BLENDED), commands).balance.energy
    assert energy["source"] - energy["motor"] == pytest.approx(work["source"])


@pytest.mark.parametrize("case", CASES)
def test_source_drag_and_hydraulic_work_against_quadrature(case: str) -> None:
    """The oracle integrates u i, w F_d and rho g z q beside the motion."""
    vehicle, run = CASES[case]
    commands, tick = run["commands"], run.get("tick", 0.5)
    ours = under(vehicle, **run)
    theirs = closed_loop(
        vehicle,
        lambda t, *_: commands[round(t / tick)],
        setpoints=[(0.0, 0.0)],
        duration=tick * (len(commands) - 1),
        tick=tick,
        depth=run.get("depth", 20.0),
        volume=run.get("volume"),
        bottom=run.get("bottom", math.inf),
    )
    energy = ours.balance.energy
    assert energy["drag"] == pytest.approx(theirs.drag, rel=1e-3, abs=1e-9)
    if "copper" in energy:
        assert energy["source"] == pytest.approx(theirs.source, rel=1e-5)
    # what the pump does on the water is what raises the vehicle and what leaks
    work = energy["sea"] + energy["vehicle motion"] + energy["drag"] + energy["bottom"]
    assert work + energy["leakage"] == pytest.approx(
        theirs.hydraulic, rel=1e-3, abs=2e-3 * abs(theirs.hydraulic) + 1e-6
    )


def test_the_drag_of_a_hull_that_bobs_is_counted_in_steps_that_see_it() -> None:
    """Its motion is exact at any step; a swing a sample long is too long for the drag's work."""
    motion = PhysicalMotion(dry_mass=7.4, drag=Drag(law="linear", k_dl=0.1))
    hull = paper().hull.model_copy(update={"waterplane_area": 3e-3, "height": 2.0})
    s = under(paper(motion=motion, hull=hull), [3.0] * 200, depth=0.4)
    assert s.depth[-1] < 0.0
    assert s.balance.relative_energy_residue < 1e-5


def test_the_residue_falls_with_the_step_at_the_order_of_the_method() -> None:
    vehicle = pump(drag=BLENDED, leak=0.0, friction=0.0, efficiency=1.0)
    commands = [-2.0 - math.cos(0.4 * k) for k in range(15)]
    residues = [
        abs(under(vehicle, commands, tick=2.0, parts=n).balance.motion_residue)
        for n in (1, 2, 4, 8)
    ]
    ratios = np.array(residues[:-1]) / residues[1:]
    assert residues[0] > 1e-9, "nothing to measure"
    assert np.all(ratios > 8.0), residues


class TestNothingCreatesEnergy:
    """Where the efficiency is known every loss is a loss."""

    @pytest.mark.parametrize(
        "vehicle",
        [screw(efficiency=0.4), screw(efficiency=0.9, friction=3e-3), pump(leak=5e-12, R_b=0.3)],
        ids=["screw", "friction", "pump"],
    )
    def test_passive_form(self, vehicle: Any) -> None:
        for offset in (-3.0, 0.0, 2.0):
            s = under(vehicle, wave(60, 6.0, offset), depth=40.0)
            assert s.depth.min() > 1.0
            for name in LOSSES:
                assert s.balance.energy[name] >= -1e-9 * s.balance.throughput, name
            assert s.balance.energy["bottom"] == 0.0

    def test_the_literal_form_creates_energy_when_driven_back(self) -> None:
        """At 0 V the sea turns the motor; eq. (7) as printed gives 1/eta of the sea's work."""
        runs = {
            literal: under(
                screw(efficiency=0.5, literal=literal), [0.0] * 41, depth=60.0, volume=150e-6
            )
            for literal in (False, True)
        }
        sea = {k: -9806.65 * 59.0 * s.balance.volume["pumped"] for k, s in runs.items()}
        assert sea[True] > 2.0  # J that the sea puts in
        assert runs[True].balance.energy["transmission"] == pytest.approx(-sea[True], rel=0.05)
        assert runs[False].balance.energy["transmission"] == pytest.approx(
            0.5 * sea[False], rel=0.05
        )
        balanced(runs[True])
        balanced(runs[False])

    def test_back_driving_charges_the_supply_less_than_the_sea_gives(self) -> None:
        s = under(screw(efficiency=0.8), [-1.5] * 41, depth=80.0, volume=150e-6)
        assert np.all(s.motor_rate[1:] < 0.0)
        assert s.balance.energy["source"] < 0.0
        assert abs(s.balance.energy["source"]) < abs(s.balance.energy["sea"])


def test_a_rotor_that_coasts_down() -> None:
    """Spun up, then 0 V at no load: q decays with T1, its energy goes into heat in closed form."""
    vehicle = paper(actuator=paper().actuator.model_copy(update={"depth_voltage": 0.0, "T1": 0.8}))
    spin = drive(vehicle, time=[0.0, 4.0], voltage=[12.0, 0.0], start_depth=10.0)
    coast = drive(
        vehicle,
        time=[0.0, 4.0, 4.5, 5.0, 7.0],
        voltage=[12.0, 0.0, 0.0, 0.0, 0.0],
        start_depth=10.0,
    )
    q0 = spin.motor_rate[-1]
    assert q0 == pytest.approx(0.444e-3 * 75e-4 * 12.0 * (1.0 - math.exp(-5.0)), rel=1e-12)
    t = coast.time[1:] - 4.0
    np.testing.assert_allclose(coast.motor_rate[1:], q0 * np.exp(-t / 0.8), rtol=1e-11)
    heat = (
        drive(vehicle, time=[0.0, 4.0, 14.0], voltage=[12.0, 0.0, 0.0], start_depth=10.0).balance,
        spin.balance,
    )
    # with k_z/k_u = 0 the shaft's energy is not known, the volume is: q T1 more
    assert heat[0].volume["pumped"] - heat[1].volume["pumped"] == pytest.approx(0.8 * q0, rel=1e-5)


def test_energy_of_a_coasting_rotor_in_joules() -> None:
    """The same with a known motor: what the rotor had is in speed losses and the winding."""
    vehicle = screw(efficiency=1.0)
    spin = drive(vehicle, time=[0.0, 2.0], voltage=[12.0, 0.0], start_depth=1.0)
    both = drive(vehicle, time=[0.0, 2.0, 6.0], voltage=[12.0, 0.0, 0.0], start_depth=1.0)
    inertia, k_q = 5e-5, 60e-4 * 1e-4 / (2 * math.pi)
    stored = 0.5 * inertia * (spin.motor_rate[-1] / k_q) ** 2
    assert spin.balance.energy["rotor"] == pytest.approx(stored, rel=1e-9)
    gained = {
        name: both.balance.energy[name] - spin.balance.energy[name] for name in both.balance.energy
    }
    assert gained["rotor"] == pytest.approx(-stored, rel=1e-2)
    assert gained["source"] == 0.0  # at 0 V no power flows, the winding's heat is the rotor's
    assert gained["copper"] + gained["speed losses"] == pytest.approx(stored, rel=0.05)


@examples(60)
@given(
    vehicle=vehicles(),
    commands=st.lists(st.floats(-1.3, 1.3), min_size=2, max_size=12),
    tick=st.sampled_from([0.1, 0.3, 1.0]),
    depth=st.floats(1.0, 60.0),
    share=st.floats(0.0, 1.0),
    ground=st.sampled_from([math.inf, 0.0, 2.0]),
)
def test_balance_of_random_vehicles(vehicle, commands, tick, depth, share, ground) -> None:  # type: ignore[no-untyped-def]
    low, high = vehicle.stroke.minimum, vehicle.stroke.maximum
    unit = 12.0 if vehicle.voltage_driven else high
    s = under(
        vehicle,
        [unit * c for c in commands for _ in range(4)],
        tick=tick,
        depth=depth,
        volume=low + share * (high - low),
        bottom=depth + ground,
    )
    assume(s.finished)
    balanced(s)
    if getattr(vehicle.actuator, "efficiency", None) and s.depth.min() > 0.4:
        for name in LOSSES:
            assert s.balance.energy[name] >= -1e-6 * s.balance.throughput, name


def test_two_runs_in_a_row_add_up() -> None:
    """Accounts are integrals: those of a run are those of its halves together."""
    vehicle = screw(R_b=0.2, drag=LINEAR)
    volts = wave(41, 8.0)
    time = 0.5 * np.arange(41)
    whole = drive(vehicle, time=time, voltage=volts, start_depth=30.0)
    first = drive(vehicle, time=time[:21], voltage=volts[:21], start_depth=30.0)
    assert whole.balance.energy["source"] > first.balance.energy["source"]
    np.testing.assert_array_equal(whole.depth[:21], first.depth)
    assert whole.balance.volume["travel"] >= np.abs(np.diff(whole.volume)).sum() * (1 - 1e-12)


@pytest.mark.parametrize("leak", [0.0, 2e-11])
def test_the_throughput_counts_what_goes_out_and_comes_back(leak: float) -> None:
    """The sum of rho g z |dV|: what the pump pushes out, leaks in and draws in, step by step."""
    s = under(pump(leak=leak), wave(400, 12.0), tick=0.1)
    z, V = s.depth, s.volume
    passed = 9806.65 * np.sum(np.abs(0.5 * (z[1:] + z[:-1]) * np.diff(V)))
    assert passed > 1.3 * abs(s.balance.energy["sea"])
    assert s.balance.motion_throughput == pytest.approx(passed, rel=0.01)
