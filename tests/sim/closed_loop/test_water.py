"""Vehicles in the water of a cast: against SciPy with gsw, `mission`, and in their limits."""

import math
from functools import lru_cache

import gsw
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.errors import InputError
from swimbladder.io.mission import Mission
from swimbladder.physics.hull import linear_psi
from swimbladder.physics.seawater import Cast, cast_column, uniform_column
from swimbladder.sim.closed_loop import drive, simulate, simulate_ensemble
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.sim.engine.cache import on_compile
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.vehicle import Hull, HullPart
from tests.oracle import TABLE_3
from tests.quoted import refused
from tests.sim.mission.test_flight import TIGHT
from tests.vehicles import BLENDED, LINEAR, SWITCHED, paper, screw, stepper

C = 1e6  # volumes are integrated in cm3
GRID = np.arange(0.0, 20.0, 0.002)
LATITUDE = 60.0
P_ATM = 101325.0


def profile(p):
    """A brackish layer over sea water, warm above: SA [g/kg] and CT [degC] over pressure [dbar]."""
    step = 0.5 * (1.0 + np.tanh((np.asarray(p) - 4.0) / 1.5))
    return 20.0 + 12.0 * step, 14.0 - 6.0 * step


@lru_cache
def cast(deepest=40.0):
    p = np.arange(0.0, deepest, 0.02)
    SA, CT = profile(p)
    return Cast(pressure=p, SA=SA, CT=CT, latitude=LATITUDE, name="fjord")


@lru_cache
def column(step=0.05):
    return cast_column(cast(), step=step)


def afloat(base, *, depth=6.0, thin=True, **hull):
    """A vehicle of parts and trapped air that is neutral, mid-stroke, at that depth of the cast."""
    volume = base.hull.displaced_volume
    parts = (
        HullPart(name="tube", volume=0.7 * volume, compressibility=3e-10, thermal_expansion=7e-5),
        HullPart(
            name="foam",
            volume=0.299 * volume,
            compressibility=9e-10,
            stiffening=1e-17,
            thermal_expansion=1.5e-4,
        ),
    )
    changed = {"parts": parts, "trapped_air": 1e-3 * volume, "psi": 2e-6} | hull
    if thin:  # so that the density over the hull's height is the density at the sensor
        changed |= {"height": 1e-3, "emergence_depth": 5e-4}
    v = base.model_copy(update={"hull": Hull(**base.hull.model_dump() | changed)})
    own = {"density": 1025.0, "temperature": 10.0}
    v = v.model_copy(update={"water": v.water.model_copy(update=own)})
    there = medium_of(v, column(), reach=depth).neutral_volume(depth)
    return v.model_copy(update={"trim_error": v.trim_error - there * 1025.0 / 1020.0})


class ByScipy:
    """The vehicle written again: density by gsw at the depth, parts and air by their laws."""

    def __init__(self, v, reach):
        self.v = v
        # p(z): dp/dz = rho(S(p), T(p), p) g(p), by DOP853
        found = solve_ivp(
            lambda _, p: [self.rho(p[0]) * float(gsw.grav(LATITUDE, p[0])) / 1e4],
            (0.0, 39.0),
            [0.0],
            method="DOP853",
            rtol=1e-12,
            atol=1e-12,
            dense_output=True,
        )
        self.pressure = lambda z: float(found.sol(z)[0])
        self.weight = self.pressure(reach) * 1e4 / reach  # N/m3
        self.mass = 1025.0 * (self.displaced(0.0, 10.0) + v.trim_error)

    @staticmethod
    def rho(p):
        SA, CT = profile(p)
        return float(gsw.rho(SA, CT, p))

    def displaced(self, p, T):
        hull = self.v.hull
        kept = 0.0
        for a in hull.parts:
            share = 1.0 - a.compressibility * p + 0.5 * a.stiffening * p * p
            kept += a.volume * (share + a.thermal_expansion * (T - hull.reference_temperature))
        warmth = (T + 273.15) / (hull.reference_temperature + 273.15)
        return kept + hull.trapped_air * P_ATM / (P_ATM + p) * warmth

    def neutral(self, z):
        p = self.pressure(z)
        SA, CT = profile(p)
        T = float(gsw.t_from_CT(SA, CT, p))
        return self.mass / self.rho(p) - self.displaced(1e4 * p, T)

    def drag(self, w):
        d = self.v.drag
        if d.law == "switched" and abs(w) > d.epsilon:
            jump = d.k_dl * d.epsilon - d.k_dt * d.epsilon**2
            return math.copysign(d.k_dt * w * w + jump, w)
        if d.law == "switched":
            return d.k_dl * w
        return (d.k_dl or 0.0) * w + (d.k_dt or 0.0) * w * abs(w)

    def sailed(self, V_of, span, start, every=1.0):
        """Return the depths at whole seconds under volumes V_of(t)."""

        def rate(t, x):
            force = self.weight * (self.neutral(x[0]) - V_of(t)) - self.drag(x[1])
            return [x[1], force / self.v.mass]

        found = solve_ivp(
            rate,
            (0.0, span),
            [start, 0.0],
            t_eval=np.arange(0.0, span, every),
            method="DOP853",
            rtol=1e-10,
            atol=1e-11,
            max_step=1.0,
        )
        assert found.success
        return found.y[0]


TIMES = np.array([0.0, 40.0, 70.0, 130.0, 170.0, 240.0, 300.0])
PUSH = 1e-6 * np.array([0.0, -25.0, -25.0, 30.0, 30.0, -20.0, -20.0])


@pytest.mark.parametrize("drag", [LINEAR, BLENDED, SWITCHED], ids=lambda d: d.law)
def test_a_volume_in_a_fjord_against_scipy_and_gsw(drag):
    v = afloat(screw(drag=drag))
    oracle = ByScipy(v, 6.0)
    centre = oracle.neutral(6.0)
    theirs = oracle.sailed(lambda t: centre + np.interp(t, TIMES, PUSH), 300.0, 6.0)
    ours = drive(
        v,
        time=np.arange(300.0),
        volume=centre + np.interp(np.arange(300.0), TIMES, PUSH),
        start_depth=6.0,
        cast=column(),
    )
    assert ours.finished
    assert np.ptp(theirs) > 2.0
    assert np.abs(ours.depth - theirs).max() < 2e-3
    assert ours.balance.relative_energy_residue < 1e-4
    assert abs(ours.balance.volume_residue) < 1e-15


def test_a_closed_loop_in_a_fjord_against_scipy_and_gsw():
    """Voltage, motor, leakage and load too: a law that is a Python function, sampled at 0.5 s."""
    v = afloat(paper(), depth=5.0)
    oracle = ByScipy(v, 6.0)
    neutral = CubicSpline(GRID, [oracle.neutral(z) for z in GRID])
    a, s = v.actuator, oracle.weight / v.water.specific_weight

    def law(t, z):
        return 5.0 * math.cos(0.15 * t) + 0.5 * (z - 6.0)

    ours = simulate(
        v,
        law=lambda seen, _: law(seen.time, seen.depth),
        sample_time=0.5,
        setpoints=[(0.0, 6.0)],
        duration=120.0,
        start_depth=5.0,
        cast=column(),
    )
    x, theirs = np.array([0.0, ours.volume[0] * C, 5.0, 0.0]), []
    assert ours.volume[0] == pytest.approx(oracle.neutral(5.0), abs=1e-7)
    for t in ours.time:
        theirs.append(x)
        u = law(t, x[2])

        def rate(_, x, u=u):
            dq = (a.K1 * a.piston_area * C * (u - s * a.depth_voltage * x[2]) - x[0]) / a.T1
            force = oracle.weight * (float(neutral(x[2])) - x[1] / C) - oracle.drag(x[3])
            return [dq, x[0], x[3], force / v.mass]

        x = solve_ivp(rate, (0.0, 0.5), x, method="DOP853", rtol=1e-10, atol=1e-10).y[:, -1]
    theirs = np.array(theirs)
    assert np.abs(ours.depth - theirs[:, 2]).max() < 5e-3  # of 5 m; rows are 5 cm apart
    assert np.abs(ours.volume - theirs[:, 1] / C).max() < 1e-7
    assert np.ptp(ours.depth) > 1.0
    assert ours.balance.relative_energy_residue < 1e-5


def test_the_order_is_four_in_layers():
    """Within one row of a coarse table, where what it adds is a cubic."""
    v = afloat(screw(efficiency=1.0), depth=8.0)
    coarse = cast_column(cast(), step=12.0)
    medium = medium_of(v, coarse, reach=8.0)
    p, tick, n = medium.plant, 4.0, 15
    volts = 3.0 * np.cos(0.21 * tick * np.arange(n + 1))
    x = np.array([0.0, medium.neutral_volume(8.0) * C, 8.0, 0.0])
    exact = []
    for u in volts:
        exact.append(x)

        def rate(_, x, u=u):
            dq = (p.gain * C * (u - p.load_drive * x[2]) - x[0]) / p.T1
            pull = p.a_b * (medium.neutral_volume(x[2]) - x[1] / C)
            return [dq, x[0], x[3], pull - p.d_l * x[3]]

        x = solve_ivp(rate, (0.0, tick), x, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    exact = np.array(exact)
    errors = []
    for parts in (1, 2, 4, 8):
        ours = simulate(
            v,
            law=lambda seen, _: volts[round(seen.time / tick)],
            sample_time=tick,
            parts=parts,
            setpoints=[(0.0, 8.0)],
            duration=n * tick,
            start_depth=8.0,
            cast=coarse,
        )
        errors.append(np.abs(ours.depth - exact[:, 2]).max())
    assert 1.0 < exact[:, 2].min() < exact[:, 2].max() < 11.5
    assert np.ptp(exact[:, 2]) > 1.0
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.0), (errors, orders)
    assert orders.mean() > 3.5, (errors, orders)
    assert errors[-1] < 1e-5


@pytest.mark.parametrize("depth", [-0.2, 0.05, 0.3, 2.0, 6.0, 15.0])
def test_the_force_at_rest_is_the_slope_of_the_potential(depth):
    """In layers, and where the hull emerges: -dP/dz by central differences."""
    medium = medium_of(afloat(screw()), column(), reach=20.0)
    p, V, h = medium.plant, 3e-5, 1e-4
    assert p.z_surface > -0.2
    slope = (medium.potential(V, depth + h) - medium.potential(V, depth - h)) / (2.0 * h)
    force = p.a_b * (medium.neutral_volume(depth) - V) + p.a_s * max(p.z_surface - depth, 0.0)
    assert slope == pytest.approx(-force, rel=1e-6)


def test_its_own_water_changes_nothing():
    v = screw(drag=BLENDED)
    run = dict(
        law=lambda seen, _: 3.0 * math.sin(0.1 * seen.time),
        sample_time=0.5,
        duration=120.0,
        setpoints=[(0.0, 10.0)],
        start_depth=10.0,
    )
    plain, cast_ = simulate(v, **run), simulate(v, cast=uniform_column(v.water, 50.0), **run)
    assert np.ptp(plain.depth) > 1.0
    np.testing.assert_allclose(cast_.depth, plain.depth, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(cast_.volume, plain.volume, rtol=0.0, atol=1e-13)
    for name, energy in plain.balance.energy.items():
        assert cast_.balance.energy[name] == pytest.approx(energy, rel=1e-6, abs=1e-9), name


def test_near_a_depth_it_is_psi_of_eq_31():
    """A loop about a depth: as a vehicle whose psi and trim are the cast's there, linearised."""
    v = afloat(paper(), depth=20.0)
    water = column()
    medium = medium_of(v, water, reach=20.0)
    psi = linear_psi(v, water, 20.0)
    assert psi == pytest.approx(
        (medium.neutral_volume(20.05) - medium.neutral_volume(19.95)) / 0.1, rel=1e-3
    )
    hull = v.hull.model_copy(update={"psi": psi, "parts": (), "trapped_air": 0.0})
    here = medium.specific_weight / v.water.gravity
    linear = v.model_copy(
        update={
            "hull": hull,
            "trim_error": medium.neutral_volume(20.0) - psi * 20.0,
            "water": v.water.model_copy(update={"density": here}),
        }
    )
    t = np.linspace(0.0, 40.0, 81)
    run = dict(
        time=t,
        start_depth=20.0,
        volume=medium.neutral_volume(20.0) + 4e-6 * np.sin(2.0 * math.pi * t / 40.0),
    )
    ours, theirs = drive(v, cast=water, **run), drive(linear, **run)
    assert 0.05 < np.ptp(theirs.depth) < 0.5
    assert np.abs(ours.depth - theirs.depth).max() < 0.01 * np.ptp(theirs.depth)


def test_a_mission_flown_in_the_same_water_goes_the_same_way():
    """`mission` has the force rho(z) g of each depth, the engine the mean's: within that share."""
    v = afloat(stepper(drag=BLENDED), depth=15.0)
    task = Mission(start_depth=10.0, phases=[{"kind": "surface", "duration": 60.0}])
    flown = fly_mission(v, task, column(), accuracy=TIGHT, checked=False)
    t, keep = np.unique(flown.rows["t"], return_index=True)
    rows = flown.rows[keep][t < 100.0]
    ours = drive(v, time=rows["t"], volume=rows["v"], start_depth=10.0, cast=column())
    share = medium_of(v, column(), reach=10.0).misses
    way = np.ptp(rows["z"])
    assert way > 6.0  # up into the brackish layer, where it floats
    off = np.abs(ours.depth - rows["z"]).max()
    assert off < share * way < 0.1


def test_it_lies_on_the_bottom_until_the_volume_is_that_of_the_cast():
    v = afloat(stepper(), depth=5.0)
    medium = medium_of(v, column(), reach=5.0, bottom_depth=8.0)
    lifts = medium.neutral_volume(8.0)
    t = np.linspace(0.0, 200.0, 401)
    volume = np.interp(t, [0.0, 20.0, 60.0, 200.0], lifts + np.array([-5e-5, -5e-5, -2e-5, 5e-5]))
    s = drive(v, time=t, volume=volume, start_depth=7.5, bottom_depth=8.0, cast=column())
    kinds = [e.kind for e in s.events]
    assert kinds[:2] == ["reached the bottom", "left the bottom"]
    assert s.events[1].time == pytest.approx(np.interp(lifts, volume[120:], t[120:]), abs=1e-3)
    assert s.balance.relative_energy_residue < 1e-4
    with refused(InputError, field="start_depth", value=9.0):
        drive(v, time=t, volume=volume, start_depth=9.0, bottom_depth=8.0, cast=column())


def test_it_comes_up_in_the_water_of_the_cast():
    """It floats where the emerged part of the hull weighs as much as what it is too light."""
    v = afloat(screw(), depth=5.0, thin=False)
    medium = medium_of(v, column(), reach=3.0)
    p = medium.plant
    V = medium.neutral_volume(0.1) + 6e-5
    s = drive(v, time=np.arange(0.0, 600.0), volume=np.full(600, V), start_depth=3.0, cast=column())
    floats = brentq(
        lambda z: p.a_b * (medium.neutral_volume(z) - V) + p.a_s * (p.z_surface - z), -1.0, 0.3
    )
    assert s.finished
    assert s.depth[-1] == pytest.approx(floats, abs=2e-3)
    assert s.balance.relative_energy_residue < 1e-3


def test_an_ensemble_is_each_vehicle_alone():
    v = afloat(screw(), depth=5.0)
    gains = CascadeParameters(**TABLE_3)
    run = dict(
        law=CASCADE,
        sample_time=0.3,
        setpoints=[(0.0, 6.0)],
        duration=60.0,
        start_depth=4.0,
        cast=column(),
    )
    shares = np.array([1.0, 0.8])
    many = simulate_ensemble(
        v,
        count=2,
        vary={"k_pz": shares * gains.k_pz},
        parameters=gains,
        keep="trajectory",
        balance=True,
        **run,
    )
    for lane, share in enumerate(shares):
        alone = simulate(v, parameters=gains._replace(k_pz=share * gains.k_pz), **run)
        np.testing.assert_allclose(many.depth[:, lane], alone.depth, rtol=0.0, atol=1e-9)
        assert many.energy[lane] == pytest.approx(alone.balance.energy["source"], rel=1e-9)
    assert abs(many.depth[-1, 0] - many.depth[-1, 1]) > 1e-3


def test_a_cast_compiles_nothing_anew():
    v = afloat(paper(), depth=5.0)
    run = dict(setpoints=[(0.0, 5.0)], duration=3.0, start_depth=5.0)
    simulate(v, **run)
    told = []
    with on_compile(lambda: told.append(True)):
        simulate(v, cast=column(), **run)
        simulate(v, cast=column(0.1), **run)
    assert not told


def test_what_the_water_does_not_allow_is_said():
    v = afloat(paper(), depth=5.0)
    with pytest.raises(InputError, match=r"fjord ends at 39\.\d+ m, .* above the 45 m asked"):
        simulate_step(v, 45.0)
    heavy = v.model_copy(update={"trim_error": v.trim_error + 9e-4})
    with refused(InputError, field="start_depth", holds={4.0}):
        simulate_step(heavy, 5.0)


def simulate_step(v, depth, **more):
    return simulate(
        v, setpoints=[(0.0, depth)], duration=30.0, start_depth=4.0, cast=column(), **more
    )


def test_trapped_air_counts_in_even_water_given_as_a_column():
    """Boyle: between two depths the neutral volume changes by what the air loses."""
    base = screw(drag=BLENDED)
    hull = base.hull.model_copy(update={"trapped_air": 3e-5})
    v = base.model_copy(update={"hull": hull})
    medium = medium_of(v, uniform_column(v.water, 40.0, step=0.05), reach=10.0)
    p = v.water.specific_weight * np.array([2.0, 10.0])
    air = 3e-5 * P_ATM / (P_ATM + p)
    change = medium.neutral_volume(10.0) - medium.neutral_volume(2.0)
    assert change == pytest.approx(v.hull.psi * 8.0 + air[0] - air[1], rel=1e-3)
