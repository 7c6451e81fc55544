"""Motors on a bench, simulated by SciPy from the differential equations alone, with bad sensors."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from swimbladder.io.logs import Log


class Motor(NamedTuple):
    """T1 dv/dt = K (u - load - dead_zone sign(v)) - v, K by the direction of v."""

    K_out: float = 0.46e-3
    K_in: float = 0.42e-3
    T1: float = 0.09
    dead_zone: float = 0.5
    load: float = 0.1
    rate: float = math.inf

    @property
    def K1(self):
        return math.sqrt(self.K_out * self.K_in)

    @property
    def asymmetry(self):
        return self.K_out / self.K_in


def travel(motor, time, voltage, gain=None):
    """Positions at `time` from rest, under voltages held between samples."""
    gain = np.ones(len(time)) if gain is None else gain
    turns = np.flatnonzero(np.diff(voltage) != 0.0) + 1
    edges = [0, *turns.tolist(), len(time) - 1]
    position = np.zeros(len(time))
    x = v = 0.0
    for low, high in pairwise(edges):
        t, end = time[low], time[high]
        over = voltage[low] - motor.load
        while t < end:
            if v == 0.0 and abs(over) <= motor.dead_zone:
                position[low : high + 1][time[low : high + 1] >= t] = x
                break
            sign = math.copysign(1.0, v if v != 0.0 else over)
            K = gain[low] * (motor.K_out if sign > 0.0 else motor.K_in)
            goal = K * (over - sign * motor.dead_zone)
            goal = min(max(goal, -motor.rate), motor.rate)

            def rate(_, y, goal=goal):
                return [y[1], (goal - y[1]) / motor.T1]

            def stands(_, y):
                return y[1]

            stands.terminal, stands.direction = True, -sign
            wanted = time[low : high + 1]
            wanted = wanted[wanted >= t]
            run = solve_ivp(
                rate,
                (t, end),
                [x, v],
                method="LSODA",
                rtol=1e-9,
                atol=1e-12,
                dense_output=True,
                events=stands if v * goal < 0.0 else None,
            )
            reached = wanted[wanted <= run.t[-1]]
            position[np.searchsorted(time, reached)] = run.sol(reached)[0]
            t, (x, v) = run.t[-1], run.y[:, -1]
            if run.status == 1:
                v = 0.0
    return position


def steps(levels, *, hold, rest, step):
    """Time and voltage of voltages held for `hold`, with rests between them."""
    still = [0.0] * round(rest / step)
    voltage = list(still)
    for level in levels:
        voltage += [level] * round(hold / step) + still
    return np.arange(len(voltage)) * step, np.array(voltage)


def measured(position, random, *, noise=0.0, quantum=0.0, outliers=0.0):
    """The positions as a sensor gives them."""
    seen = position + noise * random.normal(size=len(position))
    hit = random.random(len(position)) < outliers
    seen[hit] += 0.3 * np.ptp(position) * random.normal(size=int(hit.sum()))
    return quantum * np.rint(seen / quantum) if quantum else seen


def log_of(time, position, **columns):
    return Log(
        source=columns.pop("source", "bench.csv"),
        time=time,
        depth=columns.pop("depth", np.full(len(time), np.nan)),
        piston=position,
        line=np.arange(2, len(time) + 2),
        **columns,
    )


def random_motor(random):
    """Any motor that a bench may hold."""
    K1, ratio = 10.0 ** random.uniform(-4, -2.5), random.uniform(0.8, 1.25)
    return Motor(
        K_out=K1 * math.sqrt(ratio),
        K_in=K1 / math.sqrt(ratio),
        T1=10.0 ** random.uniform(-1.7, -0.5),
        dead_zone=random.uniform(0.1, 1.5),
        load=random.uniform(-0.3, 0.3),
    )


def random_bench(random, motor, *, differing=0.0, outliers=0.0):
    """A log of voltage steps of a motor, as a careful person would take it."""
    step = float(random.choice([0.01, 0.02, 0.05]))
    sizes = np.sort(random.uniform(2.5, 12.0, int(random.integers(2, 5))))
    levels = [sign * size for size in sizes for sign in (1.0, -1.0)]
    time, voltage = steps(levels, hold=random.uniform(0.8, 1.5), rest=0.6 + 3 * motor.T1, step=step)
    starts = np.append(False, (voltage[1:] != 0.0) & (voltage[:-1] == 0.0))
    number = np.cumsum(starts)
    gain = 1.0 + differing * random.normal(size=int(number[-1]) + 1)[number]
    position = travel(motor, time, voltage, gain)
    reach = motor.K1 * 6.0  # what it goes in a second
    seen = measured(
        position,
        random,
        noise=reach * 10.0 ** random.uniform(-3.5, -2.0),
        quantum=reach * 10.0 ** random.uniform(-4.0, -2.0),
        outliers=outliers,
    )
    return log_of(time, seen, voltage=voltage)


def random_moves(random, motor, *, differing=0.0, outliers=0.0):
    """A log of moves at full voltage that begin at any instant; the voltage is not in it."""
    step = float(random.choice([0.01, 0.02]))
    count = 2 * int(random.integers(3, 8))
    hold, rest = random.uniform(1.5, 3.0), 1.0 + 8.0 * motor.T1
    begins = np.arange(count) * (hold + rest) + rest + random.uniform(0.0, step, count)
    time = np.arange(0.0, begins[-1] + hold + rest, step)
    instants = np.unique(np.concatenate([time, begins, begins + hold]))
    voltage, gain = np.zeros(len(instants)), np.ones(len(instants))
    for k, begin in enumerate(begins):
        moved = (instants >= begin) & (instants < begin + hold)
        voltage[moved] = 12.0 if k % 2 == 0 else -12.0
        gain[moved] = 1.0 + differing * random.normal()
    position = travel(motor, instants, voltage, gain)[np.searchsorted(instants, time)]
    reach = motor.K1 * 12.0 * motor.T1  # its lag at full speed
    seen = measured(
        position,
        random,
        noise=reach * 10.0 ** random.uniform(-3.0, -1.5),
        quantum=reach * 10.0 ** random.uniform(-3.0, -1.5),
        outliers=outliers,
    )
    return log_of(time, seen)


def soft_moves(
    random,
    *,
    ramp,
    T1=0.0,
    speed=5e-3,
    count=6,
    hold=2.0,
    rest=1.5,
    step=0.01,
    noise=2e-6,
    quantum=0.0,
):
    """A log of moves to and fro whose commanded speed rises along a ramp [s]; T1 follows it."""
    fine = 1e-3
    begins = np.arange(count) * (hold + rest) + rest + random.uniform(0.0, step, count)
    time = np.arange(0.0, begins[-1] + hold + rest, fine)
    asked = np.zeros(len(time))
    for k, begin in enumerate(begins):
        since = time - begin
        asked += (-1.0) ** k * speed * np.clip(since / ramp, 0.0, 1.0) * (since < hold)
    share = -math.expm1(-fine / T1) if T1 > 0.0 else 1.0
    going = lfilter([share], [1.0, share - 1.0], asked)
    kept = np.arange(0.0, time[-1], step)
    position = np.interp(kept, time, fine * np.cumsum(going))
    return log_of(kept, measured(position, random, noise=noise, quantum=quantum))
