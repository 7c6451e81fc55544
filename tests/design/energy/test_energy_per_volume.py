"""Joules per volume, stall and efficiencies against the paper's own functions and closed forms."""

import math

import numpy as np
import pytest

from swimbladder.design.energy import drive_energy
from swimbladder.design.energy.run import stall_pressure
from swimbladder.io.config import load_vehicle
from swimbladder.physics.actuator import reduced, unified
from swimbladder.physics.electric import (
    stall_depth,
    steady_drive,
)
from swimbladder.physics.seawater import uniform_column
from swimbladder.vehicle import PowerLawPump, PumpAndValve, Valve
from tests.power_chain import per_volume, power_chain


def column_of(vehicle, deepest=1000.0):
    return uniform_column(vehicle.water, deepest, step=deepest / 50.0)


@pytest.mark.parametrize("name", ["example-eh", "example-em"])
def test_without_driver_and_sag_it_is_the_papers_chain(name):
    vehicle = load_vehicle(name)
    supply = vehicle.supply.model_copy(update={"internal_resistance": 0.0})
    vehicle = vehicle.model_copy(update={"supply": supply})
    found = drive_energy(vehicle, column_of(vehicle, vehicle.hull.depth_limit))
    a = unified(vehicle.actuator, vehicle.water)
    z = found.column.depth[1:]
    d = steady_drive(a, vehicle.water, voltage=supply.voltage, depth=z, supply=supply)
    chain = power_chain(d)
    assert found.per_volume[1:] == pytest.approx(per_volume(d), rel=1e-12)
    assert found.efficiency[1:] == pytest.approx(chain.total, rel=1e-12)
    for stage in ("motor", "transmission", "leakage"):
        assert found.stages[stage][1:] == pytest.approx(getattr(chain, stage), rel=1e-12)


@pytest.mark.parametrize("name", ["example-eh", "example-em", "example-float"])
def test_the_stages_make_the_whole(name):
    vehicle = load_vehicle(name)
    found = drive_energy(vehicle, column_of(vehicle, 100.0))
    product = np.prod([stage[1:] for stage in found.stages.values()], axis=0)
    assert product == pytest.approx(found.efficiency[1:], rel=1e-12)
    assert np.all(product < 1.0)
    assert found.efficiencies[-1] == pytest.approx(found.efficiency, nan_ok=True, rel=1e-9)


def test_energy_is_never_below_the_work_on_the_water():
    vehicle = load_vehicle("example-float")
    found = drive_energy(vehicle, column_of(vehicle, 2000.0))
    assert np.all(found.per_volume > found.column.pressure)
    known = np.isfinite(found.efficiencies)
    assert known.any()
    assert np.all(found.efficiencies[known] < 1.0)


def test_it_stalls_where_the_papers_motor_does():
    vehicle = load_vehicle("example-em")
    a = reduced(vehicle.actuator, vehicle.water)
    assert vehicle.supply.internal_resistance == 0.0
    depth = stall_depth(E=vehicle.supply.voltage, sag=0.0, load=a.load_drive, friction=a.friction)
    found = drive_energy(vehicle, column_of(vehicle, 20.0))
    assert found.stall_depth == pytest.approx(depth, rel=1e-6)  # below the column


def pumped(**pump):
    a = PumpAndValve(
        pump=PowerLawPump(idle_power=5.0, power_per_pressure=1e-6, **pump),
        valve=Valve(flow=1e-8),
        internal_pressure=101325.0,
    )
    return load_vehicle("example-float").model_copy(update={"actuator": a})


def test_a_power_law_stalls_where_slip_takes_all_or_as_stated():
    assert stall_pressure(pumped(delivery=1e-6, slip=2e-14)) == pytest.approx(5e7, abs=2.0)
    assert stall_pressure(pumped(delivery=1e-6, stall_pressure=3e7)) == pytest.approx(3e7, abs=2.0)
    assert stall_pressure(pumped(delivery=1e-6)) == math.inf


def test_a_power_law_in_joules_per_millilitre():
    vehicle = pumped(delivery=1e-6)
    supply = vehicle.supply.model_copy(update={"internal_resistance": 0.0})
    vehicle = vehicle.model_copy(update={"supply": supply})
    found = drive_energy(vehicle, column_of(vehicle))
    p = found.column.pressure
    assert found.per_volume == pytest.approx((5.0 + 1e-6 * p) / 1e-6, rel=1e-12)
    assert found.efficiency == pytest.approx(p * 1e-6 / (5.0 + 1e-6 * p), rel=1e-12)
    assert found.stages == {}
    assert found.efficiencies.size == 0
