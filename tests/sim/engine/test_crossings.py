"""What a step may hide, and the accounts of what is put at a limit: by hand, at single steps."""

import numpy as np
import pytest

from swimbladder.physics.dynamics import plant
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.accounts import Account
from swimbladder.sim.engine.advance import CHATTERS, DONE, advance, may_hide, new_lane, put_at_limit
from swimbladder.sim.engine.modes import NO_LAYERS, Act, Where
from tests.vehicles import LINEAR, paper, pump, screw

H = 0.3


def hides(p, before, after, act=Act.STUCK, where=Where.SUBMERGED):
    mode = int(act) + 20 * int(where)
    return bool(may_hide(np.array(p), NO_LAYERS, mode, np.array(before), np.array(after), H))


@pytest.mark.parametrize(
    ("depth", "speed", "hidden"),
    [
        (9.99, 0.1, True),
        (9.9, 0.1, False),
        (5.0, 0.1, False),
        (0.02, -0.1, True),
        (0.1, -0.1, False),
    ],
)
def test_a_turn_near_bottom_or_surface_may_hide_a_visit(depth, speed, hidden):
    """It goes on for a step at the greater of its speeds at most: 0.3 s at 0.1 m/s, 3 cm."""
    p = plant(pump(), bottom_depth=10.0)
    depth += p.z_surface if speed < 0.0 else 0.0
    turned = (0.0, 0.0, depth, -0.5 * speed, 0.0)
    assert hides(p, (0.0, 0.0, depth, speed, 0.0), turned) is hidden
    assert hides(p, (0.0, 0.0, depth, speed, 0.0), (0.0, 0.0, depth, speed, 0.0)) is False


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, 3.0])
@pytest.mark.parametrize(("swing", "hidden"), [(0.97, False), (1.03, True)])
def test_a_hull_that_bobs_through_a_step_may_submerge_where_its_swing_reaches_the_surface(
    angle, swing, hidden
):
    """About where it floats, of a (z_surface - z) against what is light, however it moves now."""
    p = plant(pump(drag=LINEAR), bottom_depth=10.0)
    stiffness = p.a_s - p.a_b * p.psi
    assert stiffness > 2.0  # more than a turn in a second
    floats, light = p.z_surface - 0.05, 0.05 * stiffness / p.a_b
    volume = p.V_0 + p.psi * p.z_surface + light
    z, w = floats + 0.05 * swing * np.cos(angle), 0.05 * swing * np.sqrt(stiffness) * np.sin(angle)
    state = np.array([0.0, volume, z, w, 0.0])
    mode = int(Act.STUCK) + 20 * int(Where.EMERGING)
    assert bool(may_hide(np.array(p), NO_LAYERS, mode, state, state, 1.0)) is hidden


def test_a_volume_that_turns_against_the_leakage_may_hide_an_end_stop():
    """dV/dt is q less what leaks at the depth, not at the volume: at 100 m it turns, at 1 m not."""
    p = plant(pump())
    leaks = p.k_l * 100.0  # m3/s
    assert leaks > 0.0
    near = p.V_max - 0.1 * H * leaks

    def turns(depth, *rates):
        before, after = ((rate * leaks, near, depth, 0.0, 0.0) for rate in rates)
        return hides(p, before, after, Act.FORWARD)

    for rates in ((1.5, 0.5), (0.5, 1.5)):
        assert turns(100.0, *rates)
        assert not turns(1.0, *rates)


@pytest.mark.parametrize("act", [Act.UPPER, Act.LOWER])
def test_what_is_put_at_an_end_stop_is_booked_at_the_load_of_its_direction(act):
    """Out against the load of driving, in against that of being driven back."""
    p = plant(screw())
    assert p.load_back != p.load_drive
    end, load = (p.V_max, p.load_drive) if act is Act.UPPER else (p.V_min, p.load_back)
    missing = 1e-9 if act is Act.UPPER else -1e-9
    x, accounts = np.array([0.0, end - missing, 50.0, 0.0, 0.0]), np.zeros(len(Account))
    put_at_limit(np.array(p), int(act), x, accounts)
    moved = end - (end - missing)
    assert x[1] == end
    assert accounts[Account.PUMPED] == moved
    assert accounts[Account.Z_DV] == accounts[Account.Z_Q] == 50.0 * moved
    assert accounts[Account.LOAD_Q] == accounts[Account.U_Q] == load * 50.0 * moved


def onto_the_bottom(speed):
    """A vehicle half a step above the bottom, 5 m deep, on its way down; what holds its volume."""
    p = plant(paper(), bottom_depth=5.0)
    start = np.array([0.0, p.psi * 5.0 + p.V_0, 5.0 - 0.5 * H * speed, speed])
    return new_lane(np.array(p), NO_LAYERS, start), p.load_drive * 5.0


@pytest.mark.parametrize("speed", [1e-12, 1e-10, 1e-8])
def test_a_bottom_that_a_vehicle_comes_to_by_less_than_a_rounding_a_tick_is_found(speed):
    """A depth of 5 m is known to 9e-16 m: 2^-20 of a step at 1e-10 m/s are 3e-17 m."""
    lane, u = onto_the_bottom(speed)
    assert advance(lane, 0, u, H, 0.0) == (20 * modes.BOTTOM, DONE)
    assert lane.x[2] == 5.0


def test_a_step_that_takes_more_looks_than_a_motion_does_is_chatter(monkeypatch):
    """An event is found in 20 halvings and some; with fewer to be had it is not."""
    for most, why in ((200, DONE), (15, CHATTERS)):
        monkeypatch.setattr("swimbladder.sim.engine.advance._STEPS", most)
        lane, u = onto_the_bottom(1e-3)
        assert advance.py_func(lane, 0, u, H, 0.0)[1] == why
