"""Internal waves move layers that keep their salt and heat: what a vehicle in them does."""

import math

import gsw
import numpy as np
import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.hull import (
    displaced_volume,
    layered_volume,
    linear_psi,
    neutral_volume,
    weight_mass,
)
from swimbladder.physics.seawater import (
    Cast,
    InternalWave,
    WaterMotion,
    cast_column,
    motion_table,
    moved,
    uniform_column,
)
from swimbladder.physics.seawater.column import Column, water_compressibility
from swimbladder.sim.mission.balance import close_balance
from swimbladder.sim.mission.core.hooks import fly
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import first_state, make_plan
from swimbladder.vehicle import HullPart
from tests.sim.mission.oracle import Oracle
from tests.sim.mission.test_flight import TIGHT

P = np.arange(0.0, 821.0, 1.0)
SA, CT = 35.5 - np.exp(-P / 300.0), 4.0 + 16.0 * np.exp(-P / 300.0)
LATITUDE, DEEP, DAY = 30.0, 400.0, 86400.0


@pytest.fixture(scope="module")
def layers():
    return cast_column(Cast(pressure=P, SA=SA, CT=CT, latitude=LATITUDE), 800.0)


def made_of(profiler, *, compressibility, expansion=0.0):
    part = HullPart(
        name="hull",
        volume=profiler.hull.displaced_volume,
        compressibility=compressibility,
        thermal_expansion=expansion,
    )
    return profiler.model_copy(update={"hull": profiler.hull.model_copy(update={"parts": (part,)})})


def swing(amplitude, *, period=DAY):
    wave = InternalWave(amplitude=amplitude, period=period, water_depth=800.0)
    return motion_table(WaterMotion(internal_waves=(wave,)), 9.79)


def drift(vehicle, column, waves, seconds=DAY):
    """Let a vehicle that rests at DEEP go in the waves, with nobody looking; return t, z."""
    task = Mission(start_depth=DEEP, phases=[{"kind": "park", "depth": DEEP, "duration": seconds}])
    plan = make_plan(vehicle, task, column, waves=waves)
    x, at, accounts = first_state(plan, task)
    x["t_sample"], x["t_end"] = math.inf, seconds
    at["new_phase"], at["arrived"] = 0, 1
    flown = plan.under_way((x, at, accounts), rows=20_000)
    fly(flown)
    assert x["t"] == seconds
    rows = flown.rows[: flown.lane.counts[0]]
    return rows["t"], rows["z"]


def at_depth(column, values, depth):
    return float(np.interp(depth, column.depth, values))


def test_a_float_as_compressible_as_the_water_goes_along_with_it(profiler, layers):
    """The layer that it lies in, z - displacement, stays the same; its heat moves along too."""
    water = at_depth(layers, water_compressibility(layers), DEEP)
    vehicle = made_of(profiler, compressibility=water, expansion=7e-5)
    waves = swing(20.0)
    t, z = drift(vehicle, layers, waves)
    rest = [depth - moved(waves, depth, when)[0] for when, depth in zip(t, z, strict=True)]
    assert np.ptp(z) == pytest.approx(40.0, rel=0.02)
    assert np.max(np.abs(np.array(rest) - DEEP)) < 0.02 * 20.0


def test_a_rigid_float_goes_along_by_the_share_of_the_stratification(profiler, layers):
    """N^2/(N^2 + g^2/c^2), N and c by gsw from the cast: Goodman and Levine 1990."""
    vehicle = made_of(profiler, compressibility=0.0)
    t, z = drift(vehicle, layers, swing(4.0))
    N2, middle = gsw.Nsquared(SA[::5], CT[::5], P[::5], LATITUDE)
    p = gsw.p_from_z(-DEEP, LATITUDE)
    N2 = np.interp(p, middle, N2)
    c = gsw.sound_speed(np.interp(p, P, SA), np.interp(p, P, CT), p)
    share = N2 / (N2 + gsw.grav(LATITUDE, p) ** 2 / c**2)
    assert 0.3 < share < 0.8  # neither all of it nor nothing
    crest, trough = np.interp([DAY / 4.0, 3.0 * DAY / 4.0], t, z)
    assert 0.5 * (crest - trough) == pytest.approx(4.0 * share, rel=0.03)


def test_without_layers_a_wave_moves_nothing_but_the_water(profiler):
    column = uniform_column(profiler.water, 800.0)
    made = layered_volume(profiler, column)
    assert np.ptp(made) < 1e-9 * np.ptp(neutral_volume(profiler, column))
    t, z = drift(profiler, column, swing(4.0))
    # held by its stiffness alone, it stays but for the swing that the water's start gives it
    stiffness = profiler.water.specific_weight * -linear_psi(profiler, column, DEEP)
    kick = 4.0 * 2.0 * math.pi / DAY / math.sqrt(stiffness / profiler.mass)
    assert np.max(np.abs(z - DEEP)) < 1.2 * kick < 0.03 * 4.0
    assert t[-1] == DAY


def test_layered_volume_is_that_of_displaced_water_by_teos_10(profiler, layers):
    """Water from 30 m below, at the pressure here, by gsw itself and not by a compressibility."""
    vehicle = made_of(profiler, compressibility=2.4e-10, expansion=7e-5)
    here, below = np.arange(20, 700), np.arange(20, 700) + 30
    p, far = layers.pressure / 1e4, np.interp(layers.pressure[below] / 1e4, P, SA)
    density = gsw.rho(far, np.interp(p[below], P, CT), p[here])
    hull = displaced_volume(vehicle, layers.pressure[here], layers.temperature[below])
    right = weight_mass(vehicle) / density - hull - neutral_volume(vehicle, layers)[here]
    made = layered_volume(vehicle, layers)
    assert np.max(np.abs(right)) > 5e-6
    assert np.max(np.abs(made[below] - made[here] - right)) < 0.1e-6


def test_what_layers_do_is_the_buoyancy_frequency(layers):
    """A hull without heat: dV/dz of the layers is -(M/rho) N^2/g, N by gsw from the same cast."""
    vehicle = load_vehicle("example-eh")  # its hull is known by psi alone: no heat
    N2, middle = gsw.Nsquared(SA[::5], CT[::5], P[::5], LATITUDE)
    depth = -gsw.z_from_p(middle, LATITUDE)
    slope = np.gradient(layered_volume(vehicle, layers), layers.step)
    found = np.interp(depth, layers.depth, slope)
    g = gsw.grav(LATITUDE, middle)
    right = -weight_mass(vehicle) / np.interp(depth, layers.depth, layers.density) * N2 / g
    inner = (depth > 30.0) & (depth < 700.0)
    assert np.allclose(found[inner], right[inner], rtol=0.02)


def test_water_lighter_than_fresh_water_can_be_has_a_compressibility():
    """Density below that of S = 0 at this temperature: TEOS-10 has no salinity for it."""
    depth = np.arange(0.0, 11.0)
    light = Column(
        depth=depth,
        pressure=9.78e3 * depth,
        density=990.0 + 0.1 * depth,
        temperature=np.full_like(depth, 20.0),
        gravity=9.81,
    )
    assert np.allclose(water_compressibility(light), gsw.kappa(0.0, 20.0, 5.0), rtol=0.01)


def test_a_dive_in_an_internal_wave_is_that_of_scipy(profiler, sea):
    """Through a thermocline that goes up and down; and its balance closes."""
    wave = InternalWave(amplitude=12.0, period=2400.0, water_depth=380.0, phase=0.7)
    table = motion_table(WaterMotion(internal_waves=(wave,)), sea.gravity)
    task = Mission(
        start_depth=20.0,
        phases=[
            {"kind": "descend", "depth": 90.0, "tolerance": 4.0},
            {"kind": "hold", "depth": 90.0, "tolerance": 4.0, "duration": 3600.0},
        ],
    )
    flown = fly_mission(profiler, task, sea, waves=table, accuracy=TIGHT, checked=False)
    states = Oracle(profiler, sea, waves=lambda z, t: moved(table, z, t)).replay(flown)
    assert np.max(np.abs(states[:, 0] - flown.notes["z"])) < 1e-6
    balance = close_balance(flown)
    assert abs(balance.sinks["moving water"]) > 1e3 * abs(balance.residue)
    assert balance.relative_residue < 1e-6
