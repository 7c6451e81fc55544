"""Plans of vehicles that leak, are out of trim or have a tired battery, against other programs.

What is compared with is written down anew here from eqs (11)-(15), and solved by other methods.
"""

import numpy as np
import pytest
from scipy.linalg import expm, null_space
from scipy.optimize import linprog
from scipy.sparse import lil_array

from swimbladder.design.planning import least_time, plan, run
from swimbladder.design.planning.run import (
    backward,
    best_load_direction,
    resting,
    search_least,
    settle,
)
from swimbladder.design.planning.task import (
    Goal,
    Near,
    Solved,
    driven_by,
    least_energy,
    scale_of,
    solve,
    steps_along,
    task_of,
)
from swimbladder.errors import NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop import drive
from swimbladder.vehicle import IdentifiedMotion, Supply, UnifiedActuator

EM = load_vehicle("example-em")
R, K_EMF, LEAK, TRIM = 2.0, 0.02, 2e-7, 2e-5
K_U, K_V, K_Q, INERTIA, K_Z = 0.01, 2.5e-4, 8e-8, 2e-5, 8e-4


def leaky(*, resistance=0.0, friction=0.0, efficiency=None):
    """A vehicle with numbers of its own, each of which matters: it leaks and is out of trim."""
    actuator = UnifiedActuator(
        inertia=INERTIA,
        k_u=K_U,
        k_v=K_V,
        k_q=K_Q,
        k_z=K_Z,
        k_l=LEAK,
        resistance=R,
        emf_constant=K_EMF,
        friction_torque=friction,
        efficiency=efficiency,
    )
    return EM.model_copy(
        update={
            "actuator": actuator,
            "motion": IdentifiedMotion(K2=9000.0, T2=25.0),
            "trim_error": TRIM,
            "supply": Supply(voltage=12.0, internal_resistance=resistance),
            "controller": None,
        }
    )


def motion(vehicle, h):
    """Return x+ = A x + B u + c over (q, V, z, w) for a held voltage: eqs (11)-(15), by hand."""
    K2, T2, psi = 9000.0, 25.0, vehicle.hull.psi
    gain, T1 = K_U * K_Q / K_V, INERTIA / K_V
    M = np.zeros((6, 6))
    M[0] = [-1.0 / T1, 0.0, -gain * K_Z / K_U / T1, 0.0, gain / T1, 0.0]
    M[1, 0], M[1, 2], M[2, 3] = 1.0, -LEAK, 1.0
    M[3] = [0.0, -K2 / T2, K2 * psi / T2, -1.0 / T2, 0.0, K2 * TRIM / T2]
    E = expm(M * h)
    return E[:4, :4], E[:4, 4], E[:4, 5]


def at_rest(vehicle, z):
    return np.array([LEAK * z, vehicle.hull.psi * z + TRIM, z, 0.0])


def lacking(vehicle, start, target, *, h, samples, inside_from, share):
    """Return by how much [m] the 2 % band is missed at least: a linear program for HiGHS."""
    A, B, c = motion(vehicle, h)
    S = np.array([4e-5, 1e-4, 1.0, 0.1])
    A, B, c = A * S / S[:, None], B * 12.0 / S, c / S
    n, kappa = samples, K_EMF / K_Q
    u, slack = 4 * (n + 1), 4 * (n + 1) + n
    equal = lil_array((4 * (n + 2), slack + 1))
    equal[:4, :4] = np.eye(4)
    equal[4 * (n + 1) :, 4 * n : 4 * n + 4] = np.eye(4)
    right = np.concatenate(
        [at_rest(vehicle, start) / S, np.tile(c, n), at_rest(vehicle, target) / S]
    )
    limits, most = [], []
    for k in range(n):
        rows = slice(4 * (k + 1), 4 * (k + 2))
        equal[rows, 4 * (k + 1) : 4 * (k + 2)] = np.eye(4)
        equal[rows, 4 * k : 4 * k + 4] = -A
        equal[rows, u + k] = -B[:, None]
        for sign in (1.0, -1.0):  # R_b i <= E - u, i = (u - kappa q)/R, before and after
            for q in (4 * k, 4 * (k + 1)):
                limits.append({u + k: sign * (1.0 + share), q: -sign * share * kappa * S[0] / 12.0})
                most.append(1.0)
    band = 0.02 * abs(target - start)
    for k in range(inside_from, n + 1):
        for sign in (1.0, -1.0):
            limits.append({4 * k + 2: sign, slack: -1.0})
            most.append(sign * target + band)
    G = lil_array((len(limits), slack + 1))
    for row, entries in enumerate(limits):
        for column, value in entries.items():
            G[row, column] = value
    low, high = np.full(slack + 1, -np.inf), np.full(slack + 1, np.inf)
    stroke = vehicle.stroke
    low[1 : 4 * (n + 1) : 4], high[1 : 4 * (n + 1) : 4] = (
        stroke.minimum / S[1],
        stroke.maximum / S[1],
    )
    low[2 : 4 * (n + 1) : 4] = 0.0
    low[u:slack], high[u:slack], low[slack] = -1.0, 1.0, 0.0
    cost = np.zeros(slack + 1)
    cost[slack] = 1.0
    found = linprog(
        cost,
        A_ub=G.tocsr(),
        b_ub=most,
        A_eq=equal.tocsr(),
        b_eq=right,
        bounds=np.column_stack([low, high]),
        method="highs-ipm",
    )
    assert found.status == 0
    return found.fun


@pytest.mark.parametrize("resistance", [0.0, 1.5])
def test_the_least_time_of_a_leaky_vehicle_with_a_tired_battery(resistance):
    vehicle = leaky(resistance=resistance)
    found = least_time(vehicle, 2.0, 3.2, sample_time=0.4)
    given = {"h": 0.4, "samples": 2 * found.samples + 20, "share": resistance / R}
    assert lacking(vehicle, 2.0, 3.2, inside_from=found.samples, **given) < 1e-7
    short = lacking(vehicle, 2.0, 3.2, inside_from=found.samples - 1, **given)
    assert found.short == pytest.approx(short, rel=1e-4)
    assert short > 1e-4


def test_the_least_energy_of_a_leaky_vehicle_out_of_trim():
    """By a dense program in the voltages alone, on motions to rest by their null space."""
    vehicle = leaky()
    found = plan(vehicle, (2.0, 3.2), goal="energy", duration=36.0, sample_time=0.4)
    assert not any(found.at_limit[name] for name in ("voltage", "stroke"))
    assert found.proven
    n, h, kappa = len(found.time) - 1, 0.4, K_EMF / K_Q
    A, B, c = motion(vehicle, h)

    def driven(u):
        x = [at_rest(vehicle, 2.0)]
        for voltage in u:
            x.append(A @ x[-1] + B * voltage + c)
        _, V, z, _ = np.array(x).T
        return np.diff(V) + 0.5 * LEAK * h * (z[1:] + z[:-1]), x[-1]

    free, end = driven(np.zeros(n))
    each = [driven(row) for row in np.eye(n)]
    half = (h * np.eye(n) - kappa * np.array([moved - free for moved, _ in each])) / R
    H, g = half + half.T, -kappa * free / R
    E = np.array([x - end for _, x in each]).T
    size = np.abs(E).max(axis=1)
    E, f = E / size[:, None], (at_rest(vehicle, 3.2) - end) / size
    some, N = np.linalg.lstsq(E, f, rcond=None)[0], null_space(E)
    u = some - N @ np.linalg.solve(N.T @ H @ N, N.T @ (H @ some + g))
    assert found.energy == pytest.approx(0.5 * u @ H @ u + g @ u, rel=1e-6)
    assert np.abs(found.command[:-1] - u).max() < 1e-3


def test_on_a_side_that_is_given_the_motor_drives_no_volume_to_the_other():
    """What leaks is not driven: a volume that falls by the leakage alone is on either side."""
    task = task_of(leaky(friction=2e-3, efficiency=0.7), (2.0, 3.2), sample_time=0.4)
    found = search_least(task, rest=True)
    n = 2 * found.rest
    speed = np.interp(
        np.linspace(0, 1, n + 1), np.linspace(0, 1, found.rest + 1), found.nominal.speed
    )
    back = np.arange(n) % 7 < 3  # sides that are in its way: it is at their edge again and again
    steps = steps_along(task.plant, task.sample_time, speed, back)
    answer = solve(task, steps, Goal(near=None, rest=n), Near(back=back))
    moved = np.diff(driven_by(task, answer))
    drift = LEAK * 2.0 * 0.4  # m3, that leaks in a sample
    assert moved[back].max() < 1e-3 * drift
    assert moved[~back].min() > -1e-3 * drift
    assert np.count_nonzero(np.abs(moved) < 1e-3 * drift) > 10


def test_no_turn_of_a_single_sample_betters_a_plan_of_least_energy():
    """Nor is it by less than a hundredth that turning them over made it better."""
    task = task_of(EM, (1.0, 2.5), sample_time=0.5)
    n = 76

    def program(steps, near):
        return least_energy(task, steps, n, near)

    _, along = settle(task, lambda steps, near: solve(task, steps, Goal(None, n), near), resting(n))
    first, _ = settle(task, program, along, back=backward(along))
    best = best_load_direction(task, program, along)
    assert best.objective < 0.99 * first.objective
    sides = np.diff(driven_by(task, best)) < 1e-6 * scale_of(task).state[1]
    for k in range(-1, n):  # the first as they are
        turned = sides.copy()
        if k >= 0:
            turned[k] = not turned[k]
        other = settle(task, program, along, back=turned)[0]
        assert other is None or other.objective > best.objective * (1.0 - 1e-5)


def test_a_plan_in_turbulent_drag_settles_and_arrives():
    """The simulator arrives when the plan says."""
    vehicle = load_vehicle("example-eh")
    found = plan(vehicle, (10.0, 20.0))
    run = drive(vehicle, time=found.time, voltage=found.command, start_depth=10.0)
    inside = np.abs(run.depth - 20.0) <= 0.2 + 5e-3
    assert inside[run.time >= found.arrival].all()
    assert not inside[run.time < found.arrival - 1.5].any()


def test_rounds_that_go_to_and_fro_settle_on_a_leash_only(monkeypatch):
    """A program whose answer lies as far beyond the optimum as its course lies before it."""
    task = task_of(load_vehicle("example-eh"), (10.0, 20.0), sample_time=0.5)
    n = 20
    optimum = 0.1 * np.sin(np.linspace(0.0, np.pi, n + 1))
    about = []

    def program(_steps, near):
        speed = 2.0 * optimum - about[-1]
        if near.leash is not None:
            middle, reach = near.leash
            speed = np.clip(speed, middle - reach, middle + reach)
        about.append(speed)
        states = np.zeros((n + 1, 4))
        states[:, 3] = speed
        return Solved(states, np.zeros(n), 0.0, 0.0, 0.0)

    about.append(np.zeros(n + 1))
    _, settled = settle(task, program, resting(n))
    assert settled.speed == pytest.approx(optimum, abs=1e-2 * scale_of(task).state[3])
    monkeypatch.setattr(run, "_FREE", 999)
    about[:] = [np.zeros(n + 1)]
    with pytest.raises(NoAnswerError, match="does not settle"):
        settle(task, program, resting(n))
