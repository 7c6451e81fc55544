"""What logs tell of hull, sensor and rest, on dives made up from known numbers."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from studies.deep_readings import (
    RUN,
    STEP,
    Rest,
    creep_at_rest,
    hull_time,
    rests,
    speed_scatter,
)
from swimbladder.estimation.motion.deep_model import Actions, Body, DeepDive, Water
from swimbladder.physics.seawater import Column

NONE = np.zeros(0)
MBAR, LOOK = 100.0, 86.0
LEVELS = np.linspace(0.0, 3e7, 400)


def dive(time, pressure, temperature, acts=(), pumps=()):
    """A dive with runs of a second at `acts` [s]."""
    acts, n = np.asarray(acts, dtype=float), len(time)
    none, pumps = np.zeros(len(acts)), np.asarray(pumps, dtype=bool)
    return DeepDive(
        name="made up",
        time=time,
        pressure=pressure,
        rounding=np.zeros(n),
        temperature=temperature,
        unwarmed=0,
        leaked=np.zeros(n),
        actions=Actions(acts, none + 1.0, pumps, none > 0.0, none, none, none, none, none, none),
        water=Water(LEVELS, 1028.0 + 4.5e-7 * LEVELS, np.zeros(len(LEVELS))),
        gravity=9.8,
    )


def test_the_hulls_time_is_that_of_scipys_own_hull():
    depth = np.arange(0.0, 1600.0, 10.0)
    warmth = 13.0 + 9.0 * np.exp(-depth / 40.0)
    column = Column(
        depth=depth,
        pressure=1e4 * depth,
        density=np.full(len(depth), 1028.0),
        temperature=warmth,
        gravity=9.8,
    )
    time = np.arange(0.0, 6e4, 700.0)
    pressure = np.minimum(1e5 + 350.0 * time, 1.5e7)

    def warms(t, hull):
        water = np.interp(np.interp(t, time, pressure), column.pressure, warmth)
        return (water - hull) / 1100.0

    hull = solve_ivp(warms, (0.0, time[-1]), [24.0], t_eval=time, rtol=1e-8, max_step=60.0).y[0]
    tau, off = hull_time([dive(time, pressure, hull)], {"made up": column})
    assert tau == pytest.approx(1100.0, rel=0.01)
    assert off < 0.02


def test_the_scatter_is_that_of_the_readings_that_decided():
    """It reads twice in steps of 10 mbar, and acts where whole mbar/s are 6 or less, 9 or more."""
    rng, noise = np.random.default_rng(5), 7.0 * MBAR
    found = []
    for _ in range(40):
        time, pressure, acts, pumps, p, t = [], [], [], [], 1.5e7, 0.0
        while p > 5e5:
            speed = rng.normal(7.3, 0.5) * MBAR  # of this look and the one before
            p -= speed * LOOK
            t += LOOK
            time.append(t)
            pressure.append(p)
            first, second = STEP * np.round(
                (p - np.array([0.0, speed * RUN]) + noise * rng.standard_normal(2)) / STEP
            )
            seen = np.floor((first - second) / RUN / MBAR + 0.5)
            if seen <= 6.0 or seen >= 9.0:
                acts.append(t + RUN + 7.0)
                pumps.append(seen <= 6.0)
                t += 2.0 * LOOK
                p -= 2.0 * speed * LOOK
        found.append(dive(np.array(time), np.array(pressure), np.zeros(len(time)), acts, pumps))
    scatter = speed_scatter(found, [-600.0] * len(found))
    right = np.sqrt(2.0 * (noise**2 + STEP**2 / 12.0)) / RUN
    assert scatter.looks > 2000
    assert scatter.acted > 200
    assert abs(scatter.speed - right) < 3.0 * scatter.std + 0.05 * right
    assert scatter.reading == pytest.approx(scatter.speed * RUN / np.sqrt(2.0))


def test_a_rest_tells_what_the_drive_lost():
    """Pressures at which body and water ask for ever less volume; a run ends the rest."""
    body = Body(mass=34.0, volume=0.033, reference_temperature=15.0, inertia=40.0)
    values = {
        "compressibility": 3.6e-10,
        "stiffening": 0.0,
        "thermal_expansion": 0.0,
        "trapped_air": 0.0,
        "drag": 134.0,
        "drag_up": 0.6,
    }
    creep, time = 0.1e-6 / 3600.0, np.arange(0.0, 40_000.0, 500.0)
    density = np.interp(LEVELS, LEVELS, 1028.0 + 4.5e-7 * LEVELS)
    asked = body.mass / density - body.volume * (1.0 - values["compressibility"] * LEVELS)
    lost = np.interp(1.5e7, LEVELS, asked) - creep * time
    pressure = np.interp(-lost, -asked, LEVELS)
    made = dive(time, pressure, np.full(len(time), 15.0), acts=[30_000.0], pumps=[True])
    found = rests(body, values, made, 0.0, 30_000.0)
    assert len(found) == 1
    assert found[0].creep == pytest.approx(creep, rel=0.02)
    assert found[0].left < 0.02e-6
    mean, doubt = creep_at_rest([Rest("a", 1.0, 1.0, 0.0), Rest("b", 1.0, 3.0, 0.0)])
    assert (mean, doubt) == pytest.approx((2.0, 1.0))  # of two: half their difference
