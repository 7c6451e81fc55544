"""What makes a vehicle heavier, in the loop of every vehicle: leak, drifting trim, swell."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop.block import Block, schedule
from swimbladder.sim.closed_loop.lane import Row
from swimbladder.sim.closed_loop.single import as_law
from swimbladder.vehicle import Sensors

G = 9.80665


def block_of(vehicle, *, command, lanes, ticks, start, tick=0.3, record=True, bottom=math.inf):
    """A block of lanes that all hold one command."""
    law, _, _ = as_law(vehicle, lambda *_: 0.0, tick)
    p = plant(vehicle, bottom_depth=bottom)
    block = Block(
        plants=np.repeat(np.array(p)[:, None], lanes, axis=1),
        law=law,
        parameters={"command": command, "pause": 0.0},
        clock=schedule([0.0], ticks * tick, tick),
        parts=1,
        depths=np.full((1, lanes), start[2]),
        start=np.repeat(np.array(start)[:, None], lanes, axis=1),
        sensors=Sensors(),
        recorded=record,
        loses=True,
    )
    return block, p


@pytest.mark.parametrize("lanes", [1, pytest.param(3, marks=pytest.mark.prove)])
def test_leak_drift_and_swell_pull_as_scipy_says(lanes: int) -> None:
    vehicle, tick, n = load_vehicle("feup-em"), 0.3, 400
    z0 = 6.0
    start = (0.0, vehicle.neutral_volume(z0), z0, 0.0)
    leak, drift, swell, omega, phase = 5e-8, -3e-8, 4e-6, 0.7, 0.3
    blocks = []
    for record in (True, False):  # tick by tick, and all lanes at once
        block, p = block_of(vehicle, command=0.4, lanes=lanes, ticks=n, start=start, record=record)
        for row, value in (
            (Row.LEAK, leak),
            (Row.DRIFT, drift),
            (Row.SWELL, swell),
            (Row.SWELL_OMEGA, omega),
            (Row.SWELL_PHASE, phase),
            (Row.SWELL_DECAY, omega**2 / G),
        ):
            block.work[row] = value
        block.run()
        blocks.append(block)
    block, unrecorded = blocks
    assert unrecorded.work[Row.Z] == pytest.approx(block.record[0, -1], abs=1e-12)
    assert unrecorded.work[Row.SEEN_VOLUME] == pytest.approx(block.record[2, -1], abs=1e-16)
    x, depths, volumes = np.array(start), [], []
    for k in range(n + 1):
        depths.append(x[2])
        volumes.append(x[1])
        wave = math.exp(-(omega**2) / G * x[2]) * math.cos(omega * k * tick + phase)
        lost = (leak + drift) * k * tick + swell * wave

        def rates(_, y, lost=lost):
            q, V, z, w = y
            return [
                (p.gain * (0.4 - p.load_drive * z) - q) / p.T1,
                q - p.k_l * z,
                w,
                p.a_b * (p.psi * z + p.V_0 + lost - V) - p.d_l * w,
            ]

        x = solve_ivp(rates, (0.0, tick), x, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    assert np.ptp(depths) > 0.1
    for lane in range(lanes):
        assert block.record[0, :, lane] == pytest.approx(np.array(depths), abs=1e-8)
        assert block.record[2, :, lane] == pytest.approx(np.array(volumes), abs=1e-13)
    assert block.work[Row.WATER] == pytest.approx(leak * n * tick, rel=1e-12)
    seen = block.work[Row.SEEN_VOLUME]
    assert seen == pytest.approx(volumes[-1], abs=1e-13)
    assert block.work[Row.V_HIGHEST] == pytest.approx(max(volumes), abs=1e-9)


@pytest.mark.parametrize(("name", "command"), [("feup-em", 12.0), ("ntnu-bv", 1.0)])
def test_the_end_stop_is_that_of_the_vehicle_whatever_leaks_in(name: str, command: float) -> None:
    vehicle = load_vehicle(name)
    z0 = 1.0 if name == "ntnu-bv" else 8.0
    V0 = vehicle.neutral_volume(z0)
    block, p = block_of(vehicle, command=command, lanes=1, ticks=300, start=(0.0, V0, z0, 0.0))
    block.work[Row.LEAK] = 2e-7
    block.run()
    volume = block.record[2, :, 0]
    assert volume.max() == pytest.approx(p.V_max, abs=1e-12)
    out = int(np.argmax(volume >= p.V_max - 1e-12))
    assert out < 290
    assert volume[out:] == pytest.approx(p.V_max, abs=1e-12)
    assert block.work[Row.WATER, 0] == pytest.approx(2e-7 * 300 * 0.3)


def test_what_leaks_in_keeps_a_vehicle_on_the_bottom() -> None:
    """It lies there with its neutral volume and rises when it displaces the water as well."""
    vehicle, z = load_vehicle("feup-em"), 5.0
    V = vehicle.neutral_volume(z)
    for water, lifts in ((30e-6, False), (5e-6, True)):
        block, _ = block_of(
            vehicle,
            command=p_hold(vehicle, z),
            lanes=1,
            ticks=200,
            bottom=z,
            start=(0.0, V + 10e-6, z, 0.0),
        )
        block.work[Row.WATER] = water
        block.run()
        assert (block.record[0, -1, 0] < z - 0.1) == lifts


def p_hold(vehicle, z):
    """The voltage [V] that holds the piston at a depth [m]."""
    p = plant(vehicle)
    return p.load_drive * z + p.k_l * z / p.gain
