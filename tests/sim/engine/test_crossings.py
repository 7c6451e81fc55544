"""What a step may hide, and the books of what is put at a limit: by hand, at single steps."""

import numpy as np
import pytest

from swimbladder.physics.dynamics import plant
from swimbladder.sim.engine.books import Account
from swimbladder.sim.engine.crossings import may_hide, put_at_limit
from swimbladder.sim.engine.layers import NO_LAYERS
from swimbladder.sim.engine.modes import Act, Where
from tests.vehicles import pump, screw

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
    x, books = np.array([0.0, end - missing, 50.0, 0.0, 0.0]), np.zeros(len(Account))
    put_at_limit(np.array(p), int(act), x, books)
    moved = end - (end - missing)
    assert x[1] == end
    assert books[Account.PUMPED] == moved
    assert books[Account.Z_DV] == books[Account.Z_Q] == 50.0 * moved
    assert books[Account.LOAD_Q] == books[Account.U_Q] == load * 50.0 * moved
