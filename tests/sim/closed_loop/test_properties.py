"""Random vehicles and missions: the simulator ends or says why, and stays within its bounds."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.control.position_pid import POSITION_PID, PositionPidParameters
from swimbladder.sim.closed_loop import Solution, StopReason, simulate
from swimbladder.vehicle import (
    Drag,
    Hull,
    IdentifiedActuator,
    PhysicalMotion,
    Positioner,
    Stroke,
    Supply,
    UnifiedActuator,
    Vehicle,
)
from tests.examples import examples
from tests.vehicles import vehicles

# vehicles and missions that no user could mean
fly_anything = partial(simulate, checked=False)

ARRAYS = ("depth", "speed", "volume", "motor_rate", "command", "reference", "time")


def gains(vehicle: Vehicle, tick: float, strength: float):
    """A law for any vehicle, its gains in proportion to the stroke, tame or wild."""
    stroke = vehicle.stroke.maximum
    if vehicle.voltage_driven:
        return CASCADE, CascadeParameters(
            k_pV=strength * 12.0 / (0.1 * stroke),
            k_pz=-0.1 * strength * stroke,
            k_iz=-1e-3 * strength * stroke,
            k_dz=-2.0 * strength * stroke,
            S_p=tick,
        )
    return POSITION_PID, PositionPidParameters(
        K_p=0.02 * strength,
        K_i=1e-3,
        K_d=0.1 * strength,
        threshold=1.0,
        smoothing=0.4,
        position_min=0.0,
        position_max=0.05,
        piston_area=2.0 * stroke / 0.05,
        volume_at_zero=stroke,
        S_p=tick,
    )


def sound(s: Solution, bottom: float) -> None:
    """What holds of every run, however it ended."""
    assert s.stop in StopReason
    assert s.stop is not StopReason.CHATTERS
    n = len(s.time)
    for name in ARRAYS:
        values = getattr(s, name)
        assert len(values) == n
        assert np.all(np.isfinite(values)), name
    assert np.all(np.diff(s.time) > 0.0)
    stroke = s.vehicle.stroke
    assert s.depth.max() <= bottom + 1e-9
    assert s.volume.min() >= stroke.minimum - 1e-12
    assert s.volume.max() <= stroke.maximum + 1e-12
    times = [e.time for e in s.events]
    assert len(times) <= 20 * n + 50, "chatter below the limit"
    assert times == sorted(times)
    if s.vehicle.voltage_driven:
        supply = s.vehicle.supply
        assert supply is not None
        assert np.nanmax(np.abs(s.voltage)) <= supply.voltage * (1 + 1e-12)
    assert np.isfinite(s.balance.energy_residue)


def light(
    *,
    K1: float,
    T1: float,
    k_l: float,
    stroke: float,
    psi: float,
    area: float,
    mass: float,
    trim_error: float = 0.0,
) -> Vehicle:
    """A vehicle that the property below once failed for, by the numbers that mattered."""
    return Vehicle(
        name="counter-example",
        actuator=IdentifiedActuator(K1=K1, T1=T1, piston_area=5e-3, k_l=k_l),
        supply=Supply(voltage=12.0),
        stroke=Stroke(minimum=-stroke, maximum=stroke),
        hull=Hull(displaced_volume=0.03, psi=psi, waterplane_area=area, height=1.0),
        motion=PhysicalMotion(dry_mass=mass, drag=Drag(law="linear", k_dl=1.0)),
        trim_error=trim_error,
    )


@examples(150)
@example(  # left the upper stop and met it again, while the leakage slackened
    vehicle=light(
        K1=0.0152, T1=0.368, k_l=9.12e-9, stroke=911.9e-6, psi=1.042e-5, area=0.0498, mass=7.389
    ),
    tick=0.05,
    strength=0.01,
    start="surface",
    share=1.0,
    speed=0.0,
    targets=[2.46e-10],
    seed=None,
)
@example(  # stuck at the upper stop while leakage in air pressed the volume beyond it
    vehicle=light(
        K1=1.0,
        T1=1.0,
        k_l=0.0,
        stroke=0.0009118819655545162,
        psi=1.0421508177765899e-05,
        area=0.049787068367863944,
        mass=7.38905609893065,
    ).model_copy(
        update={
            "actuator": UnifiedActuator(
                inertia=0.001255161230831118,
                k_u=0.05,
                k_v=0.003411881965554517,
                k_q=5.185389388316432e-06,
                k_z=0.050851298844933335,
                k_l=9.118819655545162e-09,
                efficiency=1.0,
                friction_torque=0.02,
                resistance=1.0,
                emf_constant=0.05,
            )
        }
    ),
    tick=0.05,
    strength=0.3,
    start="surface",
    share=1.0,
    speed=0.0,
    targets=[0.0],
    seed=None,
)
@example(  # neutral at the surface: rounding moved it in and out
    vehicle=light(
        K1=0.0008054662277904188,
        T1=0.36787944117144233,
        k_l=0.0,
        stroke=4.8327973667425135e-05,
        psi=2.7615984952814365e-06,
        area=0.0820849986238988,
        mass=260.4732060371668,
        trim_error=4.832797366742514e-06,
    ),
    tick=0.05,
    strength=0.01,
    start="surface",
    share=None,
    speed=0.0,
    targets=[0.0],
    seed=None,
)
@example(  # a positioner that rounding moved to and fro at 12 m, and hardly anything else
    vehicle=light(
        K1=1.0,
        T1=1.0,
        k_l=0.0,
        stroke=0.0009118819655545162,
        psi=1.0421508177765899e-05,
        area=0.049787068367863944,
        mass=7.38905609893065,
    ).model_copy(update={"actuator": Positioner(speed=0.09118819655545163, piston_area=0.01)}),
    tick=0.05,
    strength=0.01,
    start="deep",
    share=None,
    speed=0.0,
    targets=[12.0],
    seed=None,
)
@given(
    vehicle=vehicles(),
    tick=st.sampled_from([0.05, 0.3, 0.5, 2.0]),
    strength=st.sampled_from([0.01, 0.3, 1.0, 30.0]),
    start=st.sampled_from(["deep", "surface", "bottom", "near the bottom"]),
    share=st.sampled_from([None, 0.0, 0.4, 1.0]),
    speed=st.sampled_from([0.0, 0.0, 0.2, -0.2]),
    targets=st.lists(st.floats(-0.2, 30.0), min_size=1, max_size=4),
    seed=st.sampled_from([None, 0, 1]),
)
def test_any_vehicle_on_any_mission(  # type: ignore[no-untyped-def]
    vehicle, tick, strength, start, share, speed, targets, seed
) -> None:
    surface = max(vehicle.hull.emergence_depth, 0.0)
    depth = surface if start == "surface" else surface + 12.0
    bottom = {"bottom": depth, "near the bottom": depth + 0.3}.get(start, math.inf)
    low, high = vehicle.stroke.minimum, vehicle.stroke.maximum
    volume = min(max(vehicle.neutral_volume(depth), low), high)
    if share is not None:
        volume = low + share * (high - low)
    law, parameters = gains(vehicle, tick, strength)
    s = fly_anything(
        vehicle,
        law=law,
        parameters=parameters,
        sample_time=tick,
        setpoints=[(40.0 * tick * k, z) for k, z in enumerate(targets)],
        duration=40.0 * tick * len(targets),
        start_depth=depth,
        start_volume=volume,
        start_speed=speed,
        bottom_depth=bottom,
        seed=seed,
    )
    sound(s, bottom)
    leaks_in_air = getattr(vehicle.actuator, "k_l", 0.0) > 0.0 and s.depth.min() < 0.0
    if s.stop is StopReason.FINISHED:
        assert s.time[-1] == pytest.approx(40.0 * tick * len(targets))
        assert s.balance.relative_energy_residue <= 1e-3 or leaks_in_air
    # once more: the same run
    again = fly_anything(
        vehicle,
        law=law,
        parameters=parameters,
        sample_time=tick,
        setpoints=[(40.0 * tick * k, z) for k, z in enumerate(targets)],
        duration=40.0 * tick * len(targets),
        start_depth=depth,
        start_volume=volume,
        start_speed=speed,
        bottom_depth=bottom,
        seed=seed,
    )
    np.testing.assert_array_equal(again.depth, s.depth)


@examples(40)
@given(vehicle=vehicles(), depth=st.floats(5.0, 50.0), share=st.floats(0.05, 0.95))
def test_lighter_rises_and_heavier_sinks(vehicle, depth: float, share: float) -> None:  # type: ignore[no-untyped-def]
    """The signs of z and V: from rest with more than the neutral volume the depth falls."""
    low, high = vehicle.stroke.minimum, vehicle.stroke.maximum
    neutral = vehicle.neutral_volume(depth)
    volume = low + share * (high - low)
    extra = volume - neutral
    if abs(extra) < 0.05 * (high - low) or not low < neutral < high:
        return
    hold = (lambda *_: volume) if not vehicle.voltage_driven else (lambda *_: 0.0)
    s = fly_anything(
        vehicle,
        law=hold,
        sample_time=0.05,
        setpoints=[(0.0, depth)],
        duration=0.2,
        start_depth=depth,
        start_volume=volume,
    )
    assert np.sign(s.speed[1]) == -np.sign(extra)
    if np.all(np.sign(s.volume - neutral) == np.sign(extra)):  # the sea drives no motor past it
        assert np.sign(s.depth[-1] - depth) == -np.sign(extra)
    # and from rest the acceleration is Archimedes': -rho g (V - V_neutral)/m
    early = fly_anything(
        vehicle,
        law=hold,
        sample_time=1e-4,
        setpoints=[(0.0, depth)],
        duration=1e-4,
        start_depth=depth,
        start_volume=volume,
    )
    expected = -9806.65 * extra / vehicle.mass
    assert early.speed[1] / 1e-4 == pytest.approx(expected, rel=0.02)


@examples(20)
@given(vehicle=vehicles(kinds="identified unified lossy"), volts=st.floats(2.0, 12.0))
def test_a_positive_voltage_presses_volume_out(vehicle, volts: float) -> None:  # type: ignore[no-untyped-def]
    """Where the load and the friction allow it at all: at the surface."""
    z = max(vehicle.hull.emergence_depth, 0.0)
    neutral = vehicle.neutral_volume(z)
    friction = getattr(vehicle.actuator, "friction_torque", 0.0) / 0.05
    if volts < 3.0 * friction + 0.5:
        volts += 3.0 * friction
    if volts > 12.0:
        return
    kw = dict(sample_time=1e-3, setpoints=[(0.0, z)], duration=3e-3, start_depth=z)
    up = fly_anything(vehicle, law=lambda *_: volts, start_volume=neutral, **kw)  # type: ignore[arg-type]
    down = fly_anything(vehicle, law=lambda *_: -volts, start_volume=neutral, **kw)  # type: ignore[arg-type]
    assert up.motor_rate[-1] > 0.0 > down.motor_rate[-1]
    assert up.volume[-1] > down.volume[-1]


@examples(25)
@given(vehicle=vehicles(), strength=st.sampled_from([0.3, 1.0]), target=st.floats(2.0, 12.0))
def test_steps_do_not_change_a_vehicle_with_laminar_drag(vehicle, strength, target) -> None:  # type: ignore[no-untyped-def]
    if vehicle.drag.law != "linear":
        vehicle = vehicle.model_copy(
            update={
                "motion": vehicle.motion.model_copy(
                    update={"drag": type(vehicle.drag)(law="linear", k_dl=5.0)}
                )
            }
        )
    law, parameters = gains(vehicle, 0.3, strength)
    start = min(max(vehicle.neutral_volume(6.0), vehicle.stroke.minimum), vehicle.stroke.maximum)
    coarse, fine, beside = (
        fly_anything(
            vehicle,
            law=law,
            parameters=parameters,
            sample_time=0.3,
            setpoints=[(0.0, target)],
            duration=12.0,
            start_depth=6.0 + aside,
            start_volume=start,
            parts=n,
        )
        for n, aside in ((1, 0.0), (3, 0.0), (1, 1e-9))
    )
    # an unstable loop multiplies the rounding of its steps as it does a nanometre at the start
    growth = max(np.abs(beside.depth - coarse.depth).max() / 1e-9, 10.0)
    # an event is found up to a millionth of a step late, which the vehicle integrates twice
    late = 40 * 0.3 / 2**20 * np.abs(coarse.motor_rate).max()
    exact = not coarse.events and vehicle.actuator.kind == "identified"
    tolerance = 1e-11 if exact else 1e-9 + 980.665 / vehicle.mass * late * 12.0**2
    assert np.abs(coarse.depth - fine.depth).max() < tolerance * growth
