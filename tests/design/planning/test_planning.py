"""Planned motions against bang-bang solutions known by hand, the simulator and their proofs."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import null_space

from swimbladder.design.planning import least_time, plan
from swimbladder.design.planning import task as tasks
from swimbladder.design.planning.run import backward, resting
from swimbladder.design.planning.task import (
    Goal,
    Near,
    interior,
    posed,
    steps_along,
    task_of,
    vertex,
)
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import drive
from swimbladder.vehicle import Drag, IdentifiedMotion

FEUP = load_vehicle("feup-em")
TANK = load_vehicle("ntnu-bv")
EM = load_vehicle("example-em")


def without_losses(vehicle, **actuator):
    """A vehicle whose hull gives way as the water does, and that nothing brakes."""
    motion = IdentifiedMotion(K2=1e9, T2=1e9 / 9806.65 * vehicle.mass)
    changes = {
        "hull": vehicle.hull.model_copy(update={"psi": 0.0}),
        "motion": motion,
        "trim_error": 0.0,
        "actuator": vehicle.actuator.model_copy(update=actuator),
    }
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
    found = plan(vehicle, (0.3, 1.3), goal="effort", duration=T, sample_time=0.1)
    bound = 16.0 * d / (a * T * T)
    assert bound <= found.moved <= 1.02 * bound
    assert found.gap < 1e-9


@pytest.mark.parametrize(
    ("vehicle", "options", "within"),
    [
        (FEUP, {}, 1e-9),
        (FEUP, {"arrive": "rest", "feedback_reserve": 0.1}, 1e-9),
        (FEUP, {"goal": "effort", "duration": 40.0, "max_speed": 0.06}, 1e-9),
        (TANK, {}, 5e-4),  # drag that is not linear within a sample
    ],
)
def test_the_simulator_follows_the_plan_and_the_plan_its_limits(vehicle, options, within):
    depths = (1.5, 3.0) if vehicle is FEUP else (0.3, 1.3)
    found = plan(vehicle, depths, **options)
    t = found.task
    assert found.residual < within
    given = "volume" if vehicle is TANK else "voltage"
    inputs = {given: found.volume if vehicle is TANK else found.command}
    run = drive(vehicle, time=found.time, start_depth=depths[0], **inputs)
    assert np.abs(run.depth - found.depth).max() < within
    inside = np.abs(found.depth - depths[1]) <= t.band * (1 + 1e-6)
    assert inside[found.time >= found.arrival - 1e-9].all()
    assert (found.depth[-1], found.speed[-1]) == pytest.approx((depths[1], 0.0), abs=1e-8)
    assert np.abs(found.speed).max() <= options.get("max_speed", math.inf) * (1 + 1e-6)
    if vehicle is FEUP:
        most = 12.0 * (1.0 - options.get("feedback_reserve", 0.0))
        assert np.abs(found.command).max() <= most * (1 + 1e-6)


def test_a_longer_tail_to_rest_allows_no_sooner_arrival(monkeypatch):
    found = least_time(FEUP, 1.5, 3.0)
    monkeypatch.setattr("swimbladder.design.planning.run._TAIL", 5.0)
    assert least_time(FEUP, 1.5, 3.0).samples == found.samples


def smooth_motor():
    """A motor without friction and with a lossless screw: its energy can be told exactly."""
    motor = EM.actuator.motor.model_copy(update={"friction_torque": 0.0})
    screw = EM.actuator.drive.model_copy(update={"efficiency": 1.0})
    actuator = EM.actuator.model_copy(update={"motor": motor, "drive": screw})
    return EM.model_copy(update={"actuator": actuator})


def test_the_least_energy_is_what_the_simulator_counts_and_nothing_near_is_less():
    vehicle = smooth_motor()
    found = plan(vehicle, (1.5, 3.0), goal="energy", duration=25.0)
    run = drive(vehicle, time=found.time, voltage=found.command, start_depth=1.5)
    assert found.residual < 1e-6
    # The current decays within a sample: the mean power from the volume that was driven.
    actuator_R, kappa = EM.actuator.motor.resistance, plant(vehicle).kappa
    u = found.command[:-1]
    joules = np.sum(u * (u * found.task.sample_time - kappa * np.diff(run.volume))) / actuator_R
    assert found.energy == pytest.approx(joules, rel=1e-6)
    lazy = plan(vehicle, (1.5, 3.0), goal="effort", duration=25.0)
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
    found = plan(vehicle, (0.3, 1.3), arrive="rest", sample_time=0.2)
    assert found.residual < 2e-4
    assert found.arrival > least_time(fast_piston(TANK.actuator.speed), 0.3, 1.3, rest=True).time


@pytest.mark.parametrize(
    ("vehicle", "step", "options", "error", "words"),
    [
        (FEUP, (1.5, 95.0), {}, NoAnswerError, "the stroke, -350 to 350 cm3"),
        (FEUP, (1.5, 80.0), {"feedback_reserve": 0.2}, NoAnswerError, "less the margin of 20 %"),
        (FEUP, (1.5, 60.0), {"supply": 4.0}, NoAnswerError, "the depth load: with 4 V"),
        (
            FEUP,
            (1.5, 3.0),
            {"goal": "effort", "duration": 15.0},
            NoAnswerError,
            r"the duration: .* the voltage .* V instead of 12",
        ),
        (FEUP, (1.5, 3.0), {"goal": "energy"}, NoAnswerError, "k_T are not given.*; or plan for"),
        (TANK, (0.5, 1.0), {"goal": "energy"}, NoAnswerError, "a positioner has no winding"),
        (FEUP, (1.5, 60.0), {"sample_time": 0.003}, NoAnswerError, "longer `sample_time=`"),
        (FEUP, (1.5, 120.0), {}, InputError, "its rating"),
        (FEUP, (1.5, 3.0), {"bottom_depth": 2.0}, InputError, "the bottom"),
        (FEUP, (2.0, 2.0), {}, InputError, "same depth"),
        (FEUP, (1.5, 3.0), {"goal": "fun"}, InputError, "no such goal"),
        (FEUP, (1.5, 3.0), {"duration": 20.0}, InputError, "duration"),
        (FEUP, (1.5, 3.0), {"goal": "effort", "arrive": "band"}, InputError, "end at rest"),
        (FEUP, (1.5, 3.0), {"band": 0.0}, InputError, "it must be above 0 and below 1"),
        (
            FEUP,
            (1.5, 3.0),
            {"feedback_reserve": 1.2},
            InputError,
            r"0 or more and below 1 \(got 1\.2",
        ),
        (TANK, (0.5, 1.0), {"supply": 5.0}, InputError, "takes a volume"),
    ],
)
def test_what_cannot_be_is_said(vehicle, step, options, error, words):
    with pytest.raises(error, match=words):
        plan(vehicle, step, **options)


@pytest.mark.parametrize(
    ("words", "option", "given"),
    [
        ("the voltage", "supply", {"duration": 15.0}),
        ("the voltage", "supply", {"duration": 15.0, "feedback_reserve": 0.1}),
        ("the speed limit", "max_speed", {"duration": 60.0, "max_speed": 0.02}),
    ],
)
def test_what_the_refusal_offers_is_enough(words, option, given):
    """As it is printed, and hardly more than enough."""
    with pytest.raises(NoAnswerError) as refused:
        plan(FEUP, (3.0, 1.5), goal="effort", **given)
    offered = float(str(refused.value).split(words)[1].split()[0])
    changed = {**given, option: offered}
    assert plan(FEUP, (3.0, 1.5), goal="effort", **changed).arrival == given["duration"]
    with pytest.raises(NoAnswerError):
        plan(FEUP, (3.0, 1.5), goal="effort", **{**given, option: 0.98 * offered})


@pytest.mark.parametrize("step", [pytest.param((1.5, 86.0), marks=pytest.mark.prove), (60.0, 1.5)])
def test_a_plan_that_the_simulator_leaves_by_far_is_none_and_what_is_offered_is_one(step):
    """What is offered keeps within the tenth of the step by which the other is refused."""
    with pytest.raises(NoAnswerError, match="no plan that the vehicle would follow") as refused:
        plan(FEUP, step)
    assert "with `goal='effort'`, of a smoother motion, or with `arrive='rest'`" in str(
        refused.value
    )
    assert float(str(refused.value).split("up to ")[1].split()[0]) > 0.1 * abs(step[1] - step[0])
    for offered in ({"goal": "effort"}, {"arrive": "rest"}):
        assert plan(FEUP, step, **offered).residual < 0.1 * abs(step[1] - step[0])


def test_a_plan_that_misses_the_band_by_little_says_so_in_metres():
    found = dataclasses.replace(plan(FEUP, (1.5, 70.0)), residual=6.84)
    assert not found.lost
    said = " ".join(found.sentences)
    assert "(inside 1.37 m of the target for good)" in said
    assert "keeps within 6.8 m of it. That is more than the band" in said
    assert "or plan it with `goal='effort'`" in said
    assert dataclasses.replace(found, residual=6.86).lost  # a tenth of 68.5 m
    assert "within 980 mm" in " ".join(dataclasses.replace(found, residual=0.98).sentences)


def test_corner_and_interior_are_optima_of_the_same_program():
    """Two solvers that share no code agree on what a step lacks, and on what cannot be."""
    task = task_of(FEUP, (1.5, 3.0))
    nominal = resting(120)
    steps = steps_along(task.plant, task.sample_time, nominal.speed, backward(nominal))
    for goal in (Goal(near=None, rest=59, relaxed="rest"), Goal(near=47, rest=120, relaxed="near")):
        problem = posed(task, steps, goal, None)
        inside, corner = interior(problem), vertex(problem)
        assert inside.objective == pytest.approx(corner.objective, rel=1e-8)
        for found in (inside, corner):
            off = np.abs(problem.A @ found.x - problem.b).max()
            over = (problem.G @ found.x - problem.g).max(initial=0.0)
            assert max(found.gap, off, over) < 1e-8
    impossible = posed(task, steps, Goal(near=None, rest=40), None)
    assert interior(impossible) is None
    assert vertex(impossible) is None


def test_what_the_interior_point_method_does_not_solve_the_simplex_method_does(monkeypatch):
    known, told = least_time(FEUP, 1.5, 3.0), []
    corner = tasks.vertex
    monkeypatch.setattr(tasks, "_INTERIOR", 2)
    monkeypatch.setattr(tasks, "vertex", lambda p: told.append(p) or corner(p))
    found = least_time(FEUP, 1.5, 3.0)
    assert told
    assert found.samples == known.samples
    assert found.short == pytest.approx(known.short, rel=1e-5)


def dense(task, steps):
    """Energy as u H u/2 + g u + e, and rest as E u = f, in voltages, by stepping each one alone."""
    n, R, kappa = len(steps.A), EM.actuator.motor.resistance, task.plant.kappa

    def states(u):
        x = [np.array(task.state_of_rest(task.start))]
        for k in range(n):
            x.append(steps.A[k] @ x[-1] + steps.B[k] * u[k] + steps.c[k])
        return np.array(x)

    free = states(np.zeros(n))
    moved = np.array([states(row) - free for row in np.eye(n)])  # [voltage, sample, state]
    half = (task.sample_time * np.eye(n) - kappa * np.diff(moved[:, :, 1], axis=1)) / R
    g = -kappa * np.diff(free[:, 1]) / R
    rest = np.array(task.state_of_rest(task.target)) - free[-1]
    return half + half.T, g, moved[:, -1].T, rest


def test_the_least_energy_is_that_of_the_normal_equations():
    """No limit is reached, so the optimum is a linear system's: here a dense one, by null space."""
    vehicle = smooth_motor()
    found = plan(vehicle, (1.5, 3.0), goal="energy", duration=36.0)
    assert not any(found.at_limit[name] for name in ("voltage", "stroke"))
    n = len(found.time) - 1
    task = found.task
    steps = steps_along(task.plant, task.sample_time, np.zeros(n + 1), np.zeros(n, bool))
    H, g, E, f = dense(task, steps)
    size = np.abs(E).max(axis=1)
    E, f = E / size[:, None], f / size
    some, N = np.linalg.lstsq(E, f, rcond=None)[0], null_space(E)
    assert np.linalg.eigvalsh(N.T @ H @ N)[0] > 0.0  # on motions to rest it is convex
    u = some - N @ np.linalg.solve(N.T @ H @ N, N.T @ (H @ some + g))
    assert found.energy == pytest.approx(0.5 * u @ H @ u + g @ u, rel=1e-7)
    assert np.abs(found.command[:-1] - u).max() < 1e-3
    assert found.proven


def test_an_energy_that_is_not_convex_is_said_to_be_least_near_by(monkeypatch):
    """A motor that gives more than it takes: no voltages near the plan's take less."""
    vehicle = smooth_motor()
    task = task_of(vehicle, (1.5, 3.0))
    R, kappa = tasks.winding(task)
    monkeypatch.setattr(tasks, "winding", lambda _: (R, 1.2 / task.plant.gain))
    n = 100
    steps = steps_along(task.plant, task.sample_time, np.zeros(n + 1), np.zeros(n, bool))
    found = tasks.least_energy(task, steps, n)
    assert not found.proven
    assert found.objective < 0.0
    other = tasks.least_energy(task, steps, n, Near((found.states[:, 3], 1e-3)))
    assert other.objective >= found.objective * (1 + 1e-3)
    assert kappa * task.plant.gain < 1.0  # the true motor's is


def test_the_sides_of_a_plan_of_least_energy_are_those_on_which_its_motor_turns():
    """Friction and the screw's losses act against the motor, and the simulator finds them so."""
    found = plan(EM, (1.0, 2.0), goal="energy")
    assert not found.proven  # load and friction depend on the side
    assert found.residual < 5e-4
    run = drive(EM, time=found.time, voltage=found.command, start_depth=1.0)
    u, kappa = found.command[:-1], found.task.plant.kappa
    joules = np.sum(u * (u * found.task.sample_time - kappa * np.diff(run.volume)))
    assert found.energy == pytest.approx(joules / EM.actuator.motor.resistance, rel=2e-3)
    still = np.abs(np.diff(found.volume)) < 1e-9
    p = found.task.plant
    within = p.load_drive * found.depth[:-1] + p.friction
    assert (np.abs(u[still][2:-2]) < within[still][2:-2] + 0.1).sum() > 5  # it rests on its way
    assert "others were not ruled out" in " ".join(found.sentences)


def test_every_program_of_a_plan_is_told():
    """A plan of least energy solves many for the least time, and its own after them."""
    told = {}
    for goal in ("effort", "energy"):
        ticks: list[float] = []
        plan(EM, (1.0, 2.0), goal=goal, advance=ticks.append)
        told[goal] = len(ticks)
    assert told["energy"] >= told["effort"] > 3
