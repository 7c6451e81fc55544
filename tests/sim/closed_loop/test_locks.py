"""Screws that lock and motors with a dead zone, simulated: balance closed, volume held."""

import math

import pytest

from swimbladder.sim.closed_loop import simulate
from tests.vehicles import BLENDED, paper, screw


def locking(back):
    vehicle = screw(friction=2e-3, drag=BLENDED)
    drive = vehicle.actuator.drive.model_copy(update={"back_efficiency": back})
    actuator = vehicle.actuator.model_copy(update={"drive": drive})
    return vehicle.model_copy(update={"actuator": actuator})


def under(vehicle, commands, depth):
    return simulate(
        vehicle,
        law=lambda seen, _: commands[round(seen.time / 0.5)],
        sample_time=0.5,
        setpoints=[(0.0, depth)],
        duration=0.5 * (len(commands) - 1),
        start_depth=depth,
    )


@pytest.mark.parametrize("back", [0.3, 0.0, -0.5])
def test_the_books_of_a_screw_that_locks_balance(back):
    s = under(locking(back), [2.0 + 9.0 * math.sin(0.37 * k) for k in range(80)], 20.0)
    assert s.finished
    assert abs(s.balance.energy_residue) < 1e-5 * s.balance.throughput
    assert s.balance.energy["transmission"] > 0.0


def test_a_screw_that_locks_holds_without_voltage_and_another_does_not():
    """At 60 m its dry friction alone does not: the sea drives back what does not lock."""
    held, locked, slipping = (under(locking(back), [0.0] * 40, 60.0) for back in (-0.5, 0.0, 0.3))
    assert held.volume[-1] == held.volume[0]
    assert locked.volume[-1] == locked.volume[0]
    assert slipping.volume[-1] < slipping.volume[0] - 1e-6


def test_a_dead_zone_moves_nothing_below_it():
    vehicle = paper()
    actuator = vehicle.actuator.model_copy(update={"dead_zone": 0.7, "depth_voltage": 0.0})
    sticky = vehicle.model_copy(update={"actuator": actuator})
    still = under(sticky, [0.69, -0.69] * 20, 5.0)
    assert still.volume[-1] == still.volume[0]
    # Beyond it the motor turns as from 0: K1 A (u - 0.7) t, less what its time constant takes.
    moved = under(sticky, [1.7] * 41, 5.0)
    rate = actuator.K1 * actuator.piston_area * 1.0
    expected = rate * (20.0 - actuator.T1 * -math.expm1(-20.0 / actuator.T1))
    assert moved.volume[-1] - moved.volume[0] == pytest.approx(expected, rel=1e-9)
