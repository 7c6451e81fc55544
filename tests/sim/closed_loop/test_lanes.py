"""The fast loop over lanes against the plain one: the same motion, whatever happens in it.

A Python law is stepped through `engine.advance` alone, a compiled one through the loop over lanes,
which takes a step by table look-up where it believes that nothing happens.
"""

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swimbladder.control.law import Law, Measurement
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.sim.closed_loop import Solution, simulate, simulate_ensemble
from swimbladder.sim.closed_loop.lane import N_STEP, Row
from swimbladder.vehicle import IdentifiedActuator, PhysicalMotion
from tests.examples import examples
from tests.vehicles import LITERAL, QUADRATIC, SWITCHED, exponents, paper, pump, vehicles

# vehicles and missions that no user could mean
fly_anything = partial(simulate, checked=False)

TICK = 0.25
N = 80


class Wave(NamedTuple):
    """A voltage that swings, whatever the vehicle does."""

    swing: float
    offset: float
    omega: float


class Nothing(NamedTuple):
    """Of a law without memory."""

    nothing: float


def wave(parameters, state, measurement, reference):  # type: ignore[no-untyped-def]  # noqa: ARG001
    p = parameters
    return p.offset + p.swing * math.cos(p.omega * measurement.time), state, 0.0


def still(parameters, measurement, reference):  # type: ignore[no-untyped-def]  # noqa: ARG001
    return Nothing(0.0)


WAVE = Law(
    name="wave",
    summary="a swinging voltage",
    command="voltage",
    parameters=Wave,
    state=Nothing,
    step=wave,
    initial=still,
)
waves = st.builds(Wave, st.floats(0.0, 14.0), st.floats(-6.0, 6.0), exponents(0.05, 4.0))


def by_hand(vehicle: Any, parameters: Wave, **run: Any) -> Solution:
    def function(seen: Measurement, reference: float) -> float:
        command: float = wave(parameters, Nothing(0.0), seen, reference)[0]
        return command

    return fly_anything(vehicle, law=function, sample_time=TICK, **run)


def mission(depth: float, vehicle: Any, share: float) -> dict[str, Any]:
    low, high = vehicle.stroke.minimum, vehicle.stroke.maximum
    return dict(
        setpoints=[(0.0, depth)],
        duration=N * TICK,
        start_depth=depth,
        start_volume=low + share * (high - low),
    )


def same(compiled: Solution, plain: Solution) -> None:
    """The same events, and states as near as a hull that bobs lets two roundings stay."""
    assert compiled.stop is plain.stop
    assert [e.kind for e in compiled.events] == [e.kind for e in plain.events]
    for a, b in zip(compiled.events, plain.events, strict=True):
        assert abs(a.time - b.time) < 1e-3
    stroke = plain.vehicle.stroke.maximum
    assert np.abs(compiled.volume - plain.volume).max() <= 1e-5 * stroke
    assert np.abs(compiled.depth - plain.depth).max() <= 1e-5


# the same examples each time: two roundings may part where a hull just grazes a limit
@examples(100)
@given(
    vehicle=vehicles(kinds="identified unified lossy"),
    parameters=waves,
    depth=st.floats(1.0, 40.0),
    share=st.sampled_from([0.0, 0.2, 0.5, 0.9, 1.0]),
    ground=st.sampled_from([math.inf, 0.0, 0.5]),
)
def test_one_lane(vehicle, parameters, depth, share, ground) -> None:  # type: ignore[no-untyped-def]
    run = mission(depth, vehicle, share) | {"bottom_depth": depth + ground}
    compiled = fly_anything(vehicle, law=WAVE, parameters=parameters, sample_time=TICK, **run)
    same(compiled, by_hand(vehicle, parameters, **run))


@pytest.mark.prove
@examples(12)
@given(
    lanes=st.lists(
        st.tuples(
            vehicles(kinds="identified unified lossy"),
            waves,
            st.floats(1.0, 40.0),
            st.sampled_from([0.0, 0.3, 0.8, 1.0]),
        ),
        min_size=3,
        max_size=9,
    )
)
def test_many_lanes_of_different_vehicles(lanes) -> None:  # type: ignore[no-untyped-def]
    """Vehicles with nothing in common run beside each other; each moves as it would alone."""
    plants = np.array([plant(vehicle) for vehicle, *_ in lanes]).T
    runs = [mission(depth, vehicle, share) for vehicle, _, depth, share in lanes]
    vary = dict(zip(Plant._fields, plants, strict=True))
    vary |= {name: np.array([w[k] for _, w, *_ in lanes]) for k, name in enumerate(Wave._fields)}
    depths = [run["start_depth"] for run in runs]
    data = simulate_ensemble(
        lanes[0][0],
        count=len(lanes),
        law=WAVE,
        parameters=lanes[0][1],
        sample_time=TICK,
        setpoints=[(0.0, depths)],
        duration=N * TICK,
        start_depth=depths,
        start_volume=[run["start_volume"] for run in runs],
        vary=vary,
        keep="trajectory",
    )
    parts = data.attrs["steps_per_sample"]
    for lane, ((vehicle, parameters, *_), run) in enumerate(zip(lanes, runs, strict=True)):
        alone = by_hand(vehicle, parameters, parts=parts, **run)
        assert data.stop.values[lane] == alone.stop.code
        k = len(alone.time)
        assert np.abs(data.volume.values[:k, lane] - alone.volume).max() < 1e-9
        assert np.abs(data.depth.values[:k, lane] - alone.depth).max() < 1e-5


def test_drag_of_rising_vehicles() -> None:
    """Quadratic drag opposes rising as it does sinking: mirrored volumes, mirrored ways."""
    vehicle = paper(
        actuator=IdentifiedActuator(K1="0.444 mm/s/V", T1=0.09, piston_area="75 cm2"),
        hull=paper().hull.model_copy(update={"psi": 0.0}),
        motion=PhysicalMotion(dry_mass=40.0, drag=QUADRATIC),
    )
    run = dict(setpoints=[(0.0, 30.0)], duration=30.0, start_depth=30.0, start_volume=0.0)
    up, down = (
        simulate(
            vehicle,
            law=WAVE,
            parameters=Wave(0.0, volts, 1.0),
            sample_time=TICK,
            **run,  # type: ignore[arg-type]
        )
        for volts in (3.0, -3.0)
    )
    assert up.depth[-1] < 29.0
    np.testing.assert_allclose(30.0 - up.depth, down.depth - 30.0, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    "vehicle",
    [
        paper(actuator=IdentifiedActuator(K1=1e-3, T1=0.5, piston_area=75e-4)),
        pump(leak=1e-11, friction=0.0, drag=SWITCHED),
    ],
    ids=["either way", "leaking pump"],
)
def test_volume_that_turns_between_samples(vehicle: Any) -> None:
    """V peaks inside a sample: where the motor turns, or where the leakage overtakes the pump."""
    run = dict(setpoints=[(0.0, 40.0)], duration=2.0, start_depth=40.0, start_volume=0.0)
    parameters = Wave(9.0, 9.0, 2.1) if vehicle.drag == SWITCHED else Wave(9.0, 0.0, 2.4)
    free = by_hand(vehicle, parameters, **run)
    unseen = 0
    for below in (1e-9, 1e-8, 1e-7):
        limit = float(free.volume.max() + below)
        tight = vehicle.model_copy(
            update={"stroke": vehicle.stroke.model_copy(update={"maximum": limit})}
        )
        plain = by_hand(tight, parameters, **run)
        same(fly_anything(tight, law=WAVE, parameters=parameters, sample_time=TICK, **run), plain)
        unseen += bool(plain.events) and plain.volume.max() < limit
    assert unseen > 0


def test_with_quadratic_drag_it_comes_to_scipys_way_at_fourth_order_while_the_motor_runs() -> None:
    """Every coefficient of a step and of its half has a share: a wrong one is of lower order."""
    vehicle = paper(
        actuator=IdentifiedActuator(
            K1="0.444 mm/s/V", T1=2.0, piston_area="75 cm2", depth_voltage=7.707e-2
        ),
        motion=PhysicalMotion(dry_mass=40.0, drag=QUADRATIC),
    )
    a, swings, tick, cm3 = vehicle.actuator, Wave(9.0, 1.5, 0.7), 1.0, 1e-6
    weight, psi, k_dt = vehicle.water.specific_weight, vehicle.hull.psi, QUADRATIC.k_dt
    x, exact = np.array([0.0, psi * 20.0 / cm3, 20.0, 0.05]), []
    for k in range(21):
        exact.append(x[2])
        u = 1.5 + 9.0 * math.cos(0.7 * k * tick)

        def rates(_: float, x: Any, u: float = u) -> list[float]:
            q, V, z, w = x
            driven = a.K1 * a.piston_area / cm3 * (u - a.depth_voltage * z)
            force = weight * (psi * z - V * cm3) - k_dt * w * abs(w)
            return [(driven - q) / a.T1, q, w, force / vehicle.mass]

        x = solve_ivp(rates, (0.0, tick), x, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    errors = []
    for parts in (4, 8, 16):
        ours = fly_anything(
            vehicle,
            law=WAVE,
            parameters=swings,
            sample_time=tick,
            parts=parts,
            setpoints=[(0.0, 20.0)],
            duration=20.0 * tick,
            start_depth=20.0,
            start_speed=0.05,
        )
        assert not ours.events
        errors.append(np.abs(ours.depth - exact).max())
    assert np.ptp(exact) > 0.1
    assert errors[0] < 1e-6
    assert errors[0] > 8.0 * errors[1] > 64.0 * errors[2]


def test_a_speed_right_at_the_switch_of_the_drag_is_still_on_its_laminar_branch() -> None:
    """The law as printed jumps there: a vehicle that sinks at that speed speeds up at once."""
    vehicle = paper(
        actuator=IdentifiedActuator(K1="0.444 mm/s/V", T1=0.09, piston_area="75 cm2"),
        hull=paper().hull.model_copy(update={"psi": 0.0}),
        motion=PhysicalMotion(dry_mass=40.0, drag=LITERAL),
    )
    run = dict(
        setpoints=[(0.0, 30.0)],
        duration=N * TICK,
        start_depth=20.0,
        start_speed=LITERAL.epsilon,
        start_volume=-2e-5,
    )
    rests = Wave(0.0, 0.0, 1.0)
    compiled = fly_anything(vehicle, law=WAVE, parameters=rests, sample_time=TICK, **run)
    plain = by_hand(vehicle, rests, **run)
    assert plain.speed[1] > LITERAL.epsilon
    same(compiled, plain)
    # m w' = rho g dV - k_dt w^2 from the switch on, in closed form
    pull, drag = 2e-5 * vehicle.water.specific_weight, LITERAL.k_dt
    last = math.sqrt(pull / drag)
    share = math.atanh(LITERAL.epsilon / last)
    t = plain.time
    speed = last * np.tanh(share + t * math.sqrt(pull * drag) / vehicle.mass)
    np.testing.assert_allclose(compiled.speed, speed, rtol=1e-6)


def test_each_row_has_a_place_of_its_own() -> None:
    """Two names of one number would be one row."""
    assert len(Row.__members__) == len(list(Row))
    assert [row for row in Row if row < Row.STEP] == list(range(Row.STEP))
    assert Row.PLANT == Row.STEP + N_STEP
