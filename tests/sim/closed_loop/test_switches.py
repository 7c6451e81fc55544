"""Limit switches at the driver, against SciPy with events; and landing on the bottom."""

import math

import numpy as np
import pytest

from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.mission.orders import phase_laws
from swimbladder.vehicle import Stroke
from tests.oracle import Oracle

TICK = 0.3


def with_switches(name, margin, **actuator):
    v = load_vehicle(name)
    stroke = v.stroke.model_copy(update={"switch_margin": margin})
    changed = v.actuator.model_copy(update=actuator)
    return v.model_copy(update={"stroke": stroke, "actuator": changed})


def flown(v, commands, *, depth, bottom=math.inf):
    """Fly commands of the law, one a sample; return (ours, oracle's rows V, z, w)."""
    low, high = -math.inf, math.inf
    if v.stroke.switch_margin is not None or not v.voltage_driven:
        low, high = v.stroke.lowest, v.stroke.highest
    ours = simulate(
        v,
        law=lambda seen, _: float(commands[round(seen.time / TICK)]),
        sample_time=TICK,
        setpoints=[(0.0, depth)],
        duration=TICK * (len(commands) - 1),
        start_depth=depth,
        bottom_depth=bottom,
    )
    oracle = Oracle(v, depth=depth, bottom=bottom)
    rows = []
    for k, command in enumerate(commands):
        _, V, z, w = oracle.state
        u = command
        if v.voltage_driven:  # what is pressed takes the voltage that drives on
            u = 0.0 if (u > 0.0 and high <= V) or (u < 0.0 and low >= V) else u
        else:
            u = min(max(u, low), high)
        rows.append((V, z, w, u))
        oracle.t = k * TICK
        oracle.hold(u, TICK)
    return ours, np.array(rows), oracle


OUT_AND_IN = np.concatenate([np.full(130, 12.0), np.full(260, -12.0), np.full(60, 12.0)])


def test_a_switch_cuts_and_the_piston_coasts():
    """Out, in and out: each switch cuts its own direction only, and the piston goes on a little."""
    v = with_switches("feup-em", 30e-6, T1=0.5)
    ours, theirs, _ = flown(v, OUT_AND_IN, depth=30.0)
    n = len(theirs)
    assert np.abs(ours.volume[:n] - theirs[:, 0]).max() < 1e-11
    assert np.abs(ours.depth[:n] - theirs[:, 1]).max() < 1e-6
    assert np.array_equal(ours.voltage[: n - 1], theirs[: n - 1, 3])
    assert v.stroke.highest < ours.volume.max() < v.stroke.maximum
    assert ours.volume.min() < v.stroke.lowest  # and then the sea pushes it on
    cut = ours.voltage[: n - 1] != OUT_AND_IN[: n - 1]
    assert np.array_equal(
        np.flatnonzero(cut[:130]), np.flatnonzero(theirs[:130, 0] >= v.stroke.highest)
    )
    assert not cut[130]  # the way back is free


def test_a_piston_that_coasts_far_meets_the_hard_stop():
    v = with_switches("feup-em", 1e-6, T1=0.5)
    ours, theirs, oracle = flown(v, OUT_AND_IN, depth=30.0)
    assert np.abs(ours.volume[: len(theirs)] - theirs[:, 0]).max() < 1e-11
    assert ours.volume.max() == pytest.approx(v.stroke.maximum, abs=1e-15)
    assert ours.volume.min() == pytest.approx(v.stroke.minimum, abs=1e-15)
    stops = [t for t, kind in oracle.run.events if "stop" in kind and "left" not in kind]
    ours_at = [e.time for e in ours.events if "stop" in e.kind and "left" not in e.kind]
    assert ours_at[0] == pytest.approx(stops[0], abs=1e-6)


def test_a_positioner_goes_no_further_than_its_switches():
    v = with_switches("ntnu-bv", 5e-6)
    goals = np.concatenate([np.full(60, 1.0), np.full(60, -1.0)])  # m3: far beyond
    ours, theirs, _ = flown(v, goals, depth=1.0, bottom=1.5)
    assert np.abs(ours.volume[: len(theirs)] - theirs[:, 0]).max() < 1e-12
    assert ours.volume.max() <= v.stroke.highest + 1e-15
    assert ours.volume.min() >= v.stroke.lowest - 1e-15


def test_without_switches_nothing_is_cut():
    v = load_vehicle("feup-em")
    assert (v.stroke.lowest, v.stroke.highest) == (v.stroke.minimum, v.stroke.maximum)
    ours, theirs, _ = flown(v, OUT_AND_IN[:200], depth=30.0)
    assert np.array_equal(ours.voltage[: len(theirs) - 1], OUT_AND_IN[: len(theirs) - 1])


def test_switches_that_cannot_be_and_depths_beyond_them():
    with pytest.raises(InputError, match="leave no stroke"):
        Stroke(minimum=-1e-4, maximum=1e-4, switch_margin=1e-4)
    v = with_switches("feup-em", 300e-6)
    with pytest.raises(InputError, match="outside -50 to 50 cm3"):
        simulate(v, setpoints=[(0.0, 30.0)], duration=10.0, start_depth=1.0)
    tank = load_vehicle("example-float").model_dump()
    tank["stroke"]["switch_margin"] = 1e-6
    with pytest.raises(InputError, match="have no limit switches"):
        type(v)(**tank)


def test_a_mission_flies_switches_by_a_law_and_refuses_them_by_its_own_rule():
    v = with_switches("feup-em", 30e-6)
    phases = [{"kind": "descend", "depth": 5.0}, {"kind": "surface", "duration": 60.0}]
    assert len(phase_laws(v, Mission(phases=phases))) == 2
    by_rule = Mission(phases=[{**phase, "law": "rate"} for phase in phases])
    with pytest.raises(InputError, match=r"stroke.switch_margin: the mission's own rule"):
        phase_laws(v, by_rule)


@pytest.mark.parametrize("name", ["feup-em", "example-em", "example-eh", "ntnu-bv"])
def test_every_kind_of_actuator_lands_and_leaves_again(name):
    """All volume in until it lies on the bottom, then all out until it has left it."""
    v = load_vehicle(name)
    depth = 1.0 if name == "ntnu-bv" else 5.0
    if v.voltage_driven:
        assert v.supply is not None
        most = v.supply.voltage
    else:
        most = 1.0
    commands = np.concatenate([np.full(200, -most), np.full(300, most)])
    bottom = depth + 0.5
    ours, theirs, oracle = flown(v, commands, depth=depth, bottom=bottom)
    assert {kind for _, kind in oracle.run.events} >= {"reached the bottom", "left the bottom"}
    lies = np.abs(theirs[:, 1] - bottom) < 1e-9
    left = np.flatnonzero(lies)[-1]
    up = left + int(np.flatnonzero(theirs[left:, 1] < 0.7 * bottom)[0])  # before it bobs
    assert np.array_equal(ours.depth[:up] == bottom, lies[:up])
    assert np.abs(ours.depth[:up] - theirs[:up, 1]).max() < 2e-5
    assert np.abs(ours.volume[:up] - theirs[:up, 0]).max() < 1e-9


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_switch_that_is_just_touched_cuts(sign):
    v = with_switches("feup-em", 30e-6)
    ours = simulate(
        v,
        law=lambda *_: 12.0 * sign,
        sample_time=TICK,
        setpoints=[(0.0, 30.0)],
        duration=TICK,
        start_depth=30.0,
        start_volume=v.stroke.highest if sign > 0.0 else v.stroke.lowest,
    )
    assert ours.voltage[0] == 0.0
