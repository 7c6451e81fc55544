"""When a vehicle counts as come up, beyond its depth or filled: the parts of a flight, as Python.

By the words of how-to/faults.md, for depths tick by tick that are made up.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from swimbladder.sim.closed_loop.lane import N_PLANT, Row
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.modes import NO_LAYERS
from swimbladder.sim.faults.flight import _filled, _go_on, _read_of_waves, _surfaced, _throttle
from swimbladder.sim.faults.kinds import _FLOWS, On

V_MIN, V_MAX, V_0, PSI = -3e-4, 4e-4, 1e-5, 2e-6
STROKE, SURFACE, BAND = V_MAX - V_MIN, 0.2, 1.0


def plant(**more):
    p = np.zeros(N_PLANT)
    given = {"V_MIN": V_MIN, "V_MAX": V_MAX, "V_0": V_0, "PSI": PSI, "Z_SURFACE": SURFACE}
    for name, value in (given | more).items():
        p[getattr(modes, name)] = value
    return p


def row(z, *, volume=V_MAX, lost=0.0, **now):
    """Return a lane's rows: its depth, its volume as the limits count it, and its plant."""
    S = np.zeros(max(Row) + N_PLANT + 1)
    S[Row.Z], S[Row.V], S[Row.LOST] = z, volume - lost, lost
    S[Row.PLANT : Row.PLANT + N_PLANT] = plant(**now)
    return S


def flight(*, filled=-1.0, stay=5.0, quiet_at=0.0, rated=math.inf, latched=math.nan):
    result = SimpleNamespace(
        filled=filled,
        beyond=math.nan,
        last=math.nan,
        up=math.nan,
        arrived=math.nan,
        latched=latched,
    )
    now = SimpleNamespace(deepest=0.0, below=0.0, commanded=0.0)
    condition = SimpleNamespace(rated=rated, quiet_at=quiet_at, band=BAND, stay=stay)
    inner = SimpleNamespace(base=plant(), result=result, now=now, condition=condition)
    return SimpleNamespace(flight=inner, layers=NO_LAYERS)


HEAVY = PSI * 300.0 + V_0  # neutral at 300 m: more than all that comes out


@pytest.mark.parametrize(
    ("before", "afloat", "z", "volume", "found"),
    [
        (-1.0, True, 0.5, V_MAX, 0.0),  # all out, at the surface
        (-1.0, True, 0.5, V_MAX - 0.0099 * STROKE, 0.0),
        (-1.0, True, 0.5, V_MAX - 0.0101 * STROKE, -1.0),
        (0.0, False, 300.0, V_MAX, 1.0),  # and heavy then
        (0.0, False, 300.0, V_MAX - 0.02 * STROKE, -1.0),
        (0.0, False, 100.0, V_MAX, 0.0),  # not heavy
        (0.0, False, (V_MAX - V_0) / PSI * (1.0 + 1e-9), V_MAX, 1.0),
        (0.0, False, (V_MAX - V_0) / PSI * (1.0 - 1e-9), V_MAX, 0.0),
        (-1.0, False, 300.0, V_MAX, -1.0),  # never at the surface with all volume out
        (1.0, False, 2.0, V_MIN, 1.0),  # what is filled stays so below
        (1.0, True, 0.5, V_MAX, 0.0),  # until it is up again
        (1.0, True, 0.5, V_MIN, -1.0),
    ],
)
def test_a_vehicle_is_filled_that_is_heavy_with_all_volume_out(before, afloat, z, volume, found):
    """Water that came in counts against it; its volume is what is out, however it is counted."""
    assert HEAVY > V_MAX
    assert _filled(flight(filled=before), row(z, volume=volume), afloat) == found


def test_water_in_the_hull_and_a_weight_make_it_heavy():
    """Neutral at the depth of now by its own volume; its actuator may be blocked."""
    lost = 1e-4
    for z, found in ((143.0, 0.0), (146.0, 1.0)):  # 144.9 m
        S = row(z, lost=lost)
        S[Row.PLANT + modes.V_MAX] = V_MAX  # as far as the actuator comes
        assert _filled(flight(filled=0.0), S, False) == found
    for z, found in ((93.0, 0.0), (96.0, 1.0)):
        assert _filled(flight(filled=0.0), row(z, V_0=V_0 + 2e-4), False) == found
    blocked = 1e-4
    for volume, found in ((blocked, 1.0), (blocked - 0.02 * STROKE, -1.0)):
        S = row(100.0, volume=volume, V_MAX=blocked)
        assert _filled(flight(filled=0.0), S, False) == found


def followed(depths, **given):
    """Return (the flight's records, the tick at which it was over or None)."""
    one = flight(**given)
    for k, z in enumerate(depths):
        if _surfaced(one, row(z, volume=0.0), k):
            return one.flight, k
    return one.flight, None


AT, UNDER = SURFACE + BAND, SURFACE + BAND + 1e-9


def test_a_vehicle_has_come_up_that_is_within_a_metre_of_the_surface_and_stays():
    """Five ticks on end; one back by then bobs, one that was away for longer begins anew."""
    m, over = followed([9.0, 9.0, AT, AT, AT, AT, AT, AT, AT])
    assert (m.result.up, m.result.arrived, over, m.result.last) == (2, 2, 7, 7)
    m, over = followed([9.0, AT, *[UNDER] * 5, AT])
    assert (m.result.arrived, over) == (1, 7)  # over at the first tick when it is back
    m, over = followed([9.0, AT, *[UNDER] * 6, AT, AT])
    assert (m.result.up, m.result.arrived, over) == (1, 8, None)
    assert m.now.below == 0.0
    m, over = followed([9.0, AT, UNDER, UNDER])
    assert (m.now.below, over) == (2.0, None)


def test_nothing_counts_while_something_may_still_be_asked():
    """From the quiet tick on, from the tick after the supervisor took over, or as commanded."""
    near = [0.5] * 20
    for given, begins in (
        ({"quiet_at": 4.0}, 4),
        ({"quiet_at": 99.0, "latched": 4.0}, 5),
        ({"quiet_at": 99.0}, None),
    ):
        m, over = followed(near, **given)
        if begins is None:
            assert math.isnan(m.result.up)
            assert math.isnan(m.result.arrived)
            assert over is None
        else:
            assert (m.result.up, m.result.arrived, over) == (begins, begins, begins + 5)
    one = flight(quiet_at=99.0)
    one.flight.now.commanded = 1.0
    assert not _surfaced(one, row(0.5), 3)
    assert (one.flight.result.up, one.flight.result.arrived) == (3, 3)


def test_beyond_the_rated_depth_it_is_over():
    m, over = followed([5.0, 20.0, 19.0, 20.0, 21.0, 30.0], rated=20.0)
    assert (m.result.beyond, m.result.last, over, m.now.deepest) == (4, 4, 4, 21.0)
    m, _ = followed([5.0, 7.0, 3.0])
    assert m.now.deepest == 7.0
    assert math.isnan(m.result.beyond)


def test_a_positioner_on_its_way_has_its_speed_of_now():
    for way, speed in ((modes.MOVING_OUT, 2e-6), (modes.MOVING_IN, -2e-6), (modes.UPPER, 5.0)):
        S, p = np.zeros(max(Row) + 1), plant(RATE=2e-6)
        S[Row.MODE], S[Row.Q] = 30 + way, 5.0
        _go_on(S, p)
        assert S[Row.Q] == speed


def test_what_is_read_of_a_sea_fades_with_depth():
    """Each wave by its own wave number; out of the water as at the surface; a calm sea is none."""
    random = np.random.default_rng(2)
    waves = random.uniform(0.1, 2.0, (3, 4))
    for z, t in random.uniform((-2.0, 0.0), (9.0, 60.0), (40, 2)):
        a, k, omega, phase = waves.T
        read = np.sum(a * np.exp(-k * max(z, 0.0)) * np.cos(omega * t + phase))
        assert _read_of_waves(waves, z, t) == pytest.approx(read)
    assert _read_of_waves(np.zeros((3, 4)), 1.0, 2.0) == 0.0


@pytest.mark.parametrize(
    ("positioner", "u", "volume", "flows"),
    [
        (0.0, 5.13, 0.0, 1.0),  # beyond the 5 V that hold it, by more than a hundredth of 12 V
        (0.0, 5.11, 0.0, 0.0),
        (0.0, 4.87, 0.0, -1.0),
        (0.0, 4.89, 0.0, 0.0),
        (1.0, 2e-5, 1e-5, 1.0),
        (1.0, 1e-5, 2e-5, -1.0),
        (1.0, 1e-5, 1e-5 + 0.9e-12 * STROKE, 0.0),
        (1.0, 1e-5, 1e-5 - 1.1e-12 * STROKE, 1.0),
    ],
)
def test_a_port_takes_the_flow_of_what_is_driven_beyond_what_holds(positioner, u, volume, flows):
    m = SimpleNamespace(
        base=plant(POSITIONER=positioner, LOAD_DRIVE=0.25, SUPPLY=12.0, GAIN=1.0, RATE=1.0),
        acts=np.ones((len(On), 2)),
        kept=np.zeros(30),
    )
    m.acts[On.PORT_OUT, 0] = m.acts[On.PORT_IN, 0] = 0.5
    built, S = np.ones(4), row(20.0, volume=volume, lost=3e-6)
    _throttle(SimpleNamespace(flight=m, built=built), None, S, u)
    assert m.kept[_FLOWS] == flows
    assert built.any() == (flows == 0.0)  # what was built is of another plant then
    share = S[Row.PLANT + modes.GAIN]
    assert share == (0.5 if flows else 0.0)
