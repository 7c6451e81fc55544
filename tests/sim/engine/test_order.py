"""The integrator's order, measured; exactness where the drag is laminar."""

import math

import numpy as np
import pytest

from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Drag, Stroke
from tests.oracle import TABLE_3, closed_loop, paper_cascade
from tests.vehicles import BLENDED, LINEAR, QUADRATIC, SWITCHED, paper, pump, screw

TICK = 2.0
N = 15
FREE = dict(  # nothing but drag and motor: no stop is reached, no direction matters
    leak=0.0, friction=0.0, efficiency=1.0, stroke=Stroke(minimum=-4e-3, maximum=4e-3)
)


def inward(time: float, *_: float) -> float:
    """Voltage that makes the vehicle sink ever faster, unevenly."""
    return -1.5 - 1.5 * math.cos(0.3 * time)


def to_and_fro(time: float, *_: float) -> float:
    """Voltage that makes the vehicle rise a little, turn and sink."""
    return 6.0 * math.cos(0.21 * time) - 3.0


def run(vehicle, parts: int, volts=to_and_fro):
    return simulate(
        vehicle,
        law=lambda seen, _: volts(seen.time),
        sample_time=TICK,
        setpoints=[(0.0, 20.0)],
        duration=N * TICK,
        start_depth=20.0,
        parts=parts,
    )


def reference(vehicle, volts=to_and_fro):
    return closed_loop(
        vehicle,
        volts,
        setpoints=[(0.0, 20.0)],
        duration=N * TICK,
        tick=TICK,
        depth=20.0,
        rtol=1e-13,
    )


@pytest.mark.parametrize(
    "drag",
    [
        QUADRATIC,
        BLENDED,
        Drag(law="quadratic", k_dt=600.0),
        Drag(law="blended", k_dl=40.0, k_dt=90),
    ],
    ids=lambda d: f"{d.law}-{d.k_dt:g}",
)
def test_the_order_is_four(drag: Drag) -> None:
    vehicle = pump(drag=drag, **FREE)
    exact = reference(vehicle, inward)
    assert np.all(np.diff(exact.depth) > 0.0)
    errors = np.array(
        [np.abs(run(vehicle, n, inward).depth - exact.depth).max() for n in (1, 2, 4, 8)]
    )
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.all(orders > 3.3), (errors, orders)
    assert np.all(orders < 5.5), (errors, orders)
    assert errors[-1] < 1e-6


def test_a_turn_of_quadratic_drag_costs_one_order() -> None:
    """w|w| has a bend in its second derivative where the vehicle turns: order three there."""
    vehicle = pump(drag=QUADRATIC, **FREE)
    exact = reference(vehicle)
    assert exact.speed.min() < 0.0 < exact.speed.max()
    errors = [np.abs(run(vehicle, n).depth - exact.depth).max() for n in (1, 2, 4, 8, 16)]
    assert errors[0] / errors[-1] > 16**3, errors


@pytest.mark.parametrize("law", ["switched", "switched-literal"])
def test_the_bend_of_the_drag_does_not_cost_the_order(law: str) -> None:
    """Where the drag turns turbulent, and where it jumps, the step ends: the order stays four."""
    vehicle = pump(drag=Drag(law=law, k_dl=2.0, k_dt=40.0, epsilon=0.008), **FREE)
    exact = reference(vehicle)
    assert len(exact.times("drag law")) == 3
    errors = np.array([np.abs(run(vehicle, n).depth - exact.depth).max() for n in (1, 2, 4)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.all(orders > 3.0), (errors, orders)
    assert errors[-1] < 1e-6


@pytest.mark.parametrize(
    "vehicle",
    [
        paper(stroke=FREE["stroke"]),
        screw(efficiency=1.0, stroke=FREE["stroke"]),
        pump(**FREE | {"leak": 4e-14}),
    ],
    ids=["identified", "screw", "leaking pump"],
)
def test_laminar_drag_is_exact_at_any_step(vehicle) -> None:
    exact = reference(vehicle)
    assert not exact.events
    for parts in (1, 3, 8):
        ours = run(vehicle, parts)
        assert np.abs(ours.depth - exact.depth).max() < 2e-9
        np.testing.assert_allclose(ours.volume, exact.volume, rtol=0.0, atol=1e-12)
        assert not ours.events


def test_parts_do_not_change_a_laminar_vehicle() -> None:
    runs = [
        simulate(paper(), setpoints=[(0.0, 3.0)], duration=300.0, start_depth=1.5, parts=parts)
        for parts in (1, 2, 7)
    ]
    for other in runs[1:]:
        np.testing.assert_allclose(other.depth, runs[0].depth, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(other.volume, runs[0].volume, rtol=0.0, atol=1e-16)


@pytest.mark.prove
def test_the_default_step_keeps_nonlinear_drag_to_a_micrometre() -> None:
    for drag in (LINEAR, QUADRATIC, BLENDED, SWITCHED):
        vehicle = pump(drag=drag, **FREE)
        law = paper_cascade(**TABLE_3)
        exact = closed_loop(
            vehicle, law, setpoints=[(0.0, 8.0)], duration=60.0, tick=0.3, depth=5.0
        )
        gains = paper().controller
        assert gains is not None
        ours = simulate(
            vehicle.model_copy(update={"controller": gains}),
            setpoints=[(0.0, 8.0)],
            duration=60.0,
            start_depth=5.0,
        )
        assert np.abs(ours.depth - exact.depth).max() < 1e-6, drag.law
