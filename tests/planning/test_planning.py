"""Planned motions against bang-bang solutions known by hand, the simulator and their proofs."""

import math

import numpy as np
import pytest

from swimbladder.closed_loop import drive
from swimbladder.dynamics import plant
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.parameters import Drag, IdentifiedMotion
from swimbladder.planning import least_time, plan

FEUP = load_vehicle("feup-em")
TANK = load_vehicle("ntnu-bv")
EM = load_vehicle("example-em")


def without_losses(vehicle, **actuator):
    """A vehicle whose hull gives way as the water does, and that nothing brakes."""
    motion = IdentifiedMotion(K2=1e9, T2=1e9 / 9806.65 * vehicle.mass)
    changes = {
        "hull": vehicle.hull.model_copy(update={"psi": 0.0}), "motion": motion, "trim_error": 0.0,
        "actuator": vehicle.actuator.model_copy(update=actuator),
    }  # fmt: skip
    return vehicle.model_copy(update=changes)


@pytest.mark.parametrize(("start", "target", "known"), [(1.5, 3.0, 14.4), (1.0, 3.5, 17.1)])
def test_the_papers_steps_take_what_linear_programs_said_before(start, target, known):
    found = least_time(FEUP, start, target, supply=12.0, sample_time=0.3)
    assert found.time == pytest.approx(known)
    assert found.short > 1e-3  # a sample sooner it lacks millimetres, and the dual proves it
    assert found.gap < 1e-9


def test_a_triple_integrator_takes_the_cube_root_of_32_d_over_j():
    vehicle = without_losses(FEUP, T1=1e-3, depth_voltage=0.0)
    p = plant(vehicle)
    ideal = (32.0 * 1.5 / (p.a_b * p.gain * 12.0)) ** (1 / 3)
    found = least_time(vehicle, 1.5, 3.0, rest=True, sample_time=0.1)
    # One sample for the end, one for switching at samples only, and three times the motor's lag.
    assert ideal <= found.time <= ideal + 2 * 0.1 + 3e-3


def fast_piston(speed):
    return without_losses(TANK, speed=speed)


def test_a_double_integrator_takes_twice_the_root_of_d_over_a():
    vehicle = fast_piston(100.0)
    a = plant(vehicle).a_b * vehicle.stroke.maximum
    ideal = 2.0 * math.sqrt(1.0 / a)
    found = least_time(vehicle, 0.3, 1.3, rest=True, sample_time=0.1)
    # From stop to stop it takes a sample, and there are three such.
    assert ideal <= found.time <= ideal + 3 * 0.1


def test_the_least_volume_moved_is_chebyshevs():
    """Steps of volume of mass 0 and mean 0 move d in T for 16 d/(a T^2) or more.

    Their second moment is 2 d/a, and no line comes nearer to s^2 on [0, T] than T^2/8.
    """
    vehicle, T, d = fast_piston(100.0), 20.0, 1.0
    a = plant(vehicle).a_b
    found = plan(vehicle, 0.3, 1.3, goal="effort", duration=T, sample_time=0.1)
    bound = 16.0 * d / (a * T * T)
    assert bound <= found.moved <= 1.02 * bound
    assert found.gap < 1e-9


@pytest.mark.parametrize(
    ("vehicle", "options", "within"),
    [
        (FEUP, {}, 1e-9),
        (FEUP, {"arrive": "rest", "margin": 0.1}, 1e-9),
        (FEUP, {"goal": "effort", "duration": 40.0, "speed_limit": 0.06}, 1e-9),
        (TANK, {}, 5e-4),  # drag that is not linear within a sample
    ],
)
def test_the_simulator_follows_the_plan_and_the_plan_its_limits(vehicle, options, within):
    depths = (1.5, 3.0) if vehicle is FEUP else (0.3, 1.3)
    found = plan(vehicle, *depths, **options)
    t = found.task
    assert found.residual < within
    given = "volume" if vehicle is TANK else "voltage"
    inputs = {given: found.volume if vehicle is TANK else found.command}
    run = drive(vehicle, time=found.time, start_depth=depths[0], **inputs)
    assert np.abs(run.depth - found.depth).max() < within
    inside = np.abs(found.depth - depths[1]) <= t.band * (1 + 1e-6)
    assert inside[found.time >= found.arrival - 1e-9].all()
    assert (found.depth[-1], found.speed[-1]) == pytest.approx((depths[1], 0.0), abs=1e-8)
    assert np.abs(found.speed).max() <= options.get("speed_limit", math.inf) * (1 + 1e-6)
    if vehicle is FEUP:
        most = 12.0 * (1.0 - options.get("margin", 0.0))
        assert np.abs(found.command).max() <= most * (1 + 1e-6)


def test_a_longer_tail_to_rest_allows_no_sooner_arrival(monkeypatch):
    found = least_time(FEUP, 1.5, 3.0)
    monkeypatch.setattr("swimbladder.planning.least._TAIL", 5.0)
    assert least_time(FEUP, 1.5, 3.0).samples == found.samples


def smooth_motor():
    """A motor without friction and with a lossless screw: its energy can be told exactly."""
    motor = EM.actuator.motor.model_copy(update={"friction_torque": 0.0})
    screw = EM.actuator.drive.model_copy(update={"efficiency": 1.0})
    actuator = EM.actuator.model_copy(update={"motor": motor, "drive": screw})
    return EM.model_copy(update={"actuator": actuator})


def test_the_least_energy_is_what_the_simulator_counts_and_nothing_near_is_less():
    vehicle = smooth_motor()
    found = plan(vehicle, 1.5, 3.0, goal="energy", duration=25.0)
    run = drive(vehicle, time=found.time, voltage=found.command, start_depth=1.5)
    assert found.residual < 1e-6
    # The current decays within a sample: the mean power from the volume that was driven.
    actuator_R, kappa = EM.actuator.motor.resistance, plant(vehicle).kappa
    u = found.command[:-1]
    joules = np.sum(u * (u * found.task.sample_time - kappa * np.diff(run.volume))) / actuator_R
    assert found.energy == pytest.approx(joules, rel=1e-6)
    lazy = plan(vehicle, 1.5, 3.0, goal="effort", duration=25.0)
    assert found.energy < lazy.energy
    # Any mixture of the two plans is a plan; on the way to the other the energy never falls.
    step = 1e-3
    mixed = (1 - step) * found.command + step * lazy.command
    volume = (1 - step) * found.volume + step * lazy.volume
    u = mixed[:-1]
    more = np.sum(u * (u * found.task.sample_time - kappa * np.diff(volume))) / actuator_R
    assert more >= found.energy * (1 - 1e-9)


def test_drag_that_is_quadratic_is_planned_as_it_is():
    drag = Drag(law="quadratic", k_dt=8.0)
    motion = TANK.motion.model_copy(update={"drag": drag})
    vehicle = TANK.model_copy(update={"motion": motion})
    found = plan(vehicle, 0.3, 1.3, arrive="rest", sample_time=0.2)
    assert found.residual < 2e-4
    assert found.arrival > least_time(fast_piston(TANK.actuator.speed), 0.3, 1.3, rest=True).time


@pytest.mark.parametrize(
    ("vehicle", "step", "options", "error", "words"),
    [
        (FEUP, (1.5, 95.0), {}, NoAnswerError, "the stroke, -350 to 350 cm3"),
        (FEUP, (1.5, 80.0), {"margin": 0.2}, NoAnswerError, "less the margin of 20 %"),
        (FEUP, (1.5, 60.0), {"supply": 4.0}, NoAnswerError, "the depth load: with 4 V"),
        (FEUP, (1.5, 3.0), {"goal": "effort", "duration": 15.0}, NoAnswerError,
         r"the duration: .* at least; or, one of them alone: the voltage .* V instead of 12"),
        (FEUP, (1.5, 3.0), {"goal": "energy"}, NoAnswerError, "R and torque constant k_T"),
        (TANK, (0.5, 1.0), {"goal": "energy"}, NoAnswerError, "positioner is not known"),
        (FEUP, (1.5, 60.0), {"sample_time": 0.003}, NoAnswerError, "longer sample time"),
        (FEUP, (1.5, 120.0), {}, InputError, "its rating"),
        (FEUP, (1.5, 3.0), {"bottom_depth": 2.0}, InputError, "the bottom"),
        (FEUP, (2.0, 2.0), {}, InputError, "same depth"),
        (FEUP, (1.5, 3.0), {"goal": "fun"}, InputError, "no such goal"),
        (FEUP, (1.5, 3.0), {"duration": 20.0}, InputError, "looks for the duration"),
        (FEUP, (1.5, 3.0), {"goal": "effort", "arrive": "band"}, InputError, "end at rest"),
        (FEUP, (1.5, 3.0), {"band": 0.0}, InputError, "share below 1"),
        (TANK, (0.5, 1.0), {"supply": 5.0}, InputError, "takes a volume"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_said(vehicle, step, options, error, words):
    with pytest.raises(error, match=words):
        plan(vehicle, *step, **options)


def test_what_the_refusal_offers_is_enough():
    with pytest.raises(NoAnswerError) as refused:
        plan(FEUP, 1.5, 3.0, goal="effort", duration=15.0)
    volts = float(str(refused.value).split("the voltage ")[1].split()[0])
    assert plan(FEUP, 1.5, 3.0, goal="effort", duration=15.0, supply=volts * 1.01).arrival == 15.0


def test_a_stuck_simplex_method_gives_way_to_an_interior_point_method(monkeypatch):
    """Without a pivot allowed every program is solved by the other: the same least time."""
    from swimbladder.planning import programme

    known, methods = least_time(FEUP, 1.5, 3.0), set()
    solver = programme.linprog

    def watched(*given, method, **more):
        found = solver(*given, method=method, **more)
        if found.status in (0, 2):
            methods.add(method)
        return found

    monkeypatch.setattr(programme, "linprog", watched)
    monkeypatch.setattr(programme, "_PIVOTS", 0)
    found = least_time(FEUP, 1.5, 3.0)
    assert "highs-ipm" in methods
    assert found.samples == known.samples
    assert found.short == pytest.approx(known.short, rel=1e-5)


def test_every_program_of_a_plan_is_told():
    """A plan of least energy solves many for the least time, and its own after them."""
    told = {}
    for goal in ("effort", "energy"):
        ticks: list[float] = []
        plan(EM, 1.0, 2.0, goal=goal, advance=ticks.append)
        told[goal] = len(ticks)
    assert told["energy"] >= told["effort"] > 3
