"""What faults do to numbers, piece by piece, run as Python: against what the catalogue says.

Flights hold the same to an independent simulator (test_oracle.py); here are the edges, and many
faults at once.
"""

import math

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from swimbladder.sim.closed_loop.lane import N_PLANT
from swimbladder.sim.engine import modes
from swimbladder.sim.faults import kinds as effects
from swimbladder.sim.faults.kinds import EFFECTS, KINDS, MOST, NOTHING_KEPT, On, Op, PumpTable
from tests.sim.faults.oracle import Fault

ALWAYS, TICK = math.inf, 0.25


def nothing():
    """Return factors and summands of no fault."""
    q = np.zeros((len(On), 2))
    q[:, 0] = 1.0
    return q


def of(**changed):
    """Return factors and summands: (factor, summand) by the names of what faults act on."""
    q = nothing()
    for name, pair in changed.items():
        q[On[name]] = pair
    return q


def made(kind, first, second, passed, tick=TICK):
    """Return (what it acts on, what became of x by it) of a kind, ticks after it began."""
    since, on = passed * tick, KINDS[kind].on
    if KINDS[kind].op in (Op.CUTS, Op.NEVER_CUTS) and first >= 0.5:
        on = On(on + 1)
    every = max(1, int(first / tick))
    new = {
        Op.PLUS: lambda x: x + first,
        Op.PLUS_RATE: lambda x: x + first * since,
        Op.TIMES: lambda x: first * x,
        Op.MORE: lambda x: (1.0 + first) * x,
        Op.LESS: lambda x: (1.0 - first) * x,
        Op.FALLS: lambda x: max(0.0, 1.0 - first * since) * x,
        Op.DIES: lambda x: max(0.0, 1.0 - since / first) * x,
        Op.OFF: lambda _: 0.0,
        Op.TURNS: lambda x: -x,
        Op.RUNS: lambda x: 1.0 if since < first else x,
        Op.SAYS: lambda x: (0.0 if second > 0.5 else x) + first,
        Op.ONCE: lambda x: (0.0 if passed == 0 else x) + first,
        Op.DUTY: lambda x: 0.0 if math.fmod(since, first + second) < first else x,
        Op.EVERY: lambda x: 0.0 if passed % every == 0 else x,
        Op.CUTS: lambda x: x + 1.0,
        Op.NEVER_CUTS: lambda x: x - 1.0,
        Op.SETTLES: lambda x: x - first * math.expm1(-since / second),
    }[KINDS[kind].op]
    return {on, KINDS[kind].also} - {None}, new


def test_what_can_fail_and_how_has_a_number_of_its_own():
    """The kernels take them for places in a table."""
    for members in (On, Op):
        assert [*members] == list(range(len(members.__members__)))
    assert list(KINDS) == list(range(1, len(KINDS) + 1))
    assert len(EFFECTS) == len(KINDS) + 1
    for number, kind in KINDS.items():
        also = -1 if kind.also is None else kind.also
        assert EFFECTS[number].tolist() == [kind.on, kind.op, also]
    assert {kind.op for kind in KINDS.values()} == set(Op)


@pytest.mark.parametrize("seed", range(4))
def test_faults_act_one_upon_the_other_in_their_order(seed):
    """What was x becomes what the last of up to four makes of what the others made of it."""
    random = np.random.default_rng(seed)
    for _ in range(200):
        tick = random.choice([0.25, 0.5, 1.0])
        k, rows = int(random.integers(20, 60)), []
        for _ in range(random.integers(1, MOST + 1)):
            first, second = random.choice([0.2, 0.5, 0.75, 3.0, 9.0], 2)
            begin = float(random.choice([k - 12, k - 4, k - 1, k, k + 1]))
            end = float(random.choice([k, k + 1, math.inf]))
            rows.append((float(random.integers(1, len(KINDS) + 1)), first, second, begin, end))
        expected = {on: lambda x: x for on in On}
        for kind, first, second, begin, end in rows:
            if begin <= k < end:
                where, new = made(int(kind), first, second, k - begin, tick)
                for on in where:
                    before = expected[on]
                    expected[on] = lambda x, new=new, before=before: new(before(x))
        q = np.full((len(On), 2), math.nan)
        effects.act(np.array(rows), k, tick, q)
        for on, new in expected.items():
            for x in (-2.0, 0.0, 1.0, 5.0):
                assert q[on, 0] * x + q[on, 1] == pytest.approx(new(x), abs=1e-12)


def test_what_comes_every_so_often_comes_each_tick_where_that_is_shorter():
    for first, ticks in ((0.1, 1), (0.25, 1), (0.49, 1), (0.5, 2), (0.74, 2), (3.0, 12)):
        q, comes = nothing(), []
        for k in range(10, 40):
            effects.act(np.array([[Fault.RESETS, first, 0.0, 10.0, ALWAYS]]), k, TICK, q)
            comes += [k - 10] * int(q[On.RESET, 0] == 0.0)
        assert comes == list(range(0, 30, ticks))


def test_a_sensor_of_depth_with_all_that_may_be_wrong_with_it():
    """Its error, its quantum, its latency, a value it reads, one that stays: in this order."""
    random = np.random.default_rng(3)
    for late_s in (0.0, 0.6, 1.0, 30.0):
        for said in (0.0, 1.0):
            for reads in (0.0, 17.0):
                q = of(DEPTH=(1.25, -2.0), LATE=(said, late_s), READS=(1.0, reads))
                kept, late, seen = NOTHING_KEPT.copy(), np.zeros(6), []
                for k in range(20):
                    z = random.uniform(0.0, 30.0)
                    seen.append(round((1.25 * z - 2.0) / 0.5) * 0.5)
                    behind = min(int(late_s / TICK), 5, k)
                    depth, age = effects.see_depth(q, k, TICK, z, 0.5, kept, late)
                    assert depth == (reads or seen[k - behind])
                    assert age == (behind * TICK if said == 0.0 else 0.0)


def test_an_old_depth_is_as_old_as_both_make_it():
    """One that comes a second late, and a new one only every two seconds: its age is the sum."""
    q = of(LATE=(0.0, 1.0), OLD=(1.0, 2.0))
    kept, late = NOTHING_KEPT.copy(), np.zeros(9)
    found = [effects.see_depth(q, k, TICK, float(k), 0.0, kept, late) for k in range(24)]
    assert found[8:] == [(k // 8 * 8 - 4.0, 1.0 + k % 8 * TICK) for k in range(8, 24)]


@pytest.mark.parametrize("missing", ["DEPTH_MISSING", "VOLUME_MISSING"])
def test_what_is_missing_from_the_first_tick_on_and_what_stays_at_its_first_value(missing):
    q, kept, late = of(**{missing: (0.0, 0.0)}), NOTHING_KEPT.copy(), np.zeros(9)
    depth, _ = effects.see_depth(q, 0, TICK, 3.0, 0.0, kept, late)
    volume = effects.see_volume(q, 0, TICK, 2e-5, 0.0, 7e-4, kept)
    assert (math.isnan(depth), math.isnan(volume)) == (
        missing == "DEPTH_MISSING",
        missing == "VOLUME_MISSING",
    )
    q, kept = of(OLD=(0.0, 0.0), VOLUME_OLD=(0.0, 0.0)), NOTHING_KEPT.copy()
    for k in range(4):
        depth, age = effects.see_depth(q, k, TICK, 3.0 + k, 0.0, kept, late)
        volume = effects.see_volume(q, k, TICK, 2e-5 + 1e-6 * k, 0.0, 7e-4, kept)
        assert (depth, age, volume) == (3.0, 0.0, 2e-5)


def test_noise_and_dropouts_are_as_large_and_as_often_as_they_say():
    np.random.seed(4)  # noqa: NPY002
    q, late = of(NOISE=(1.0, 2.5), DROPOUTS=(0.3, 0.0)), np.zeros(9)
    seen = [
        effects.see_depth(q, k, TICK, 9.0, 0.0, NOTHING_KEPT.copy(), late)[0] for k in range(9999)
    ]
    come = np.array(seen)[np.isfinite(seen)]
    assert len(come) / 9999 == pytest.approx(0.3, abs=4.0 * math.sqrt(0.21 / 9999))
    assert np.std(come) == pytest.approx(2.5, rel=0.06)
    assert np.mean(come) == pytest.approx(9.0, abs=4.0 * 2.5 / math.sqrt(3000))


def test_a_sensor_of_volume_is_off_by_strokes_and_has_a_quantum():
    for shift in (-0.2, 0.05):
        q = of(VOLUME=(1.0, shift))
        seen = effects.see_volume(q, 0, TICK, 1.23e-5, 1e-6, 7e-4, NOTHING_KEPT.copy())
        assert seen == pytest.approx(round((1.23e-5 + shift * 7e-4) / 1e-6) * 1e-6, abs=1e-18)


@pytest.mark.parametrize("share", [0.6, -0.6, 0.0])
def test_an_encoder_misses_a_share_of_the_motion_one_way(share):
    """Out where the share is above 0, in where it is below; nothing of where it began."""
    volumes = np.cumsum(np.random.default_rng(5).normal(size=60)) * 1e-5
    kept, moved = NOTHING_KEPT.copy(), np.diff(volumes, prepend=volumes[0])
    missed = np.where(moved * share > 0.0, abs(share) * moved, 0.0)
    found = [effects.slipped(of(SLIP=(1.0, share)), v, kept) for v in volumes]
    assert found == pytest.approx(-np.cumsum(missed), abs=1e-18)


STROKE = 7e-4


def plant(**numbers):
    p = np.zeros(N_PLANT)
    given = {"V_MIN": -STROKE / 2, "V_MAX": STROKE / 2} | numbers
    for name, value in given.items():
        p[getattr(modes, name)] = value
    return p


def touching(fault, at, *, block, ticks=12, tick=TICK):
    """Return how many faults have acted at each tick, of a vehicle whose volume is given."""
    ends = {"V_MAX": block} if fault == Fault.BLOCKED_OUT else {"V_MIN": block}
    row, kept = np.array([[fault, 0.0, 0.0, 2.0, ALWAYS]]), NOTHING_KEPT.copy()
    return [effects.acted(plant(), plant(**ends), row, k, tick, at(k), kept) for k in range(ticks)]


@pytest.mark.parametrize(("fault", "sign"), [(Fault.BLOCKED_OUT, 1.0), (Fault.BLOCKED_IN, -1.0)])
def test_a_block_acts_once_it_has_held_the_actuator_back_for_a_second(fault, sign):
    """Without a break, at the block: what only comes near does not touch it, nor an end stop."""
    block = sign * 1e-4
    held = touching(fault, lambda _: block, block=block)
    assert held == [0] * 5 + [1] * 7  # from tick 2 on, at 4 ticks a second
    assert touching(fault, lambda k: 0.0 if k == 4 else block, block=block) == [0] * 8 + [1] * 4
    assert not any(touching(fault, lambda _: block - sign * 1e-8, block=block))
    assert touching(fault, lambda k: block + sign * 1e-9 * k, block=block)[-1] == 1
    beyond = sign * STROKE / 2  # the block lies behind the end stop
    assert not any(touching(fault, lambda _: beyond, block=beyond))
    long = touching(fault, lambda _: block, block=block, tick=0.2, ticks=9)
    assert long == [0] * 6 + [1] * 3


def test_any_other_fault_acts_at_once_and_counts_on_after_it():
    rows = np.array(
        [
            [Fault.DEPTH_JUMP, 5.0, 0.0, 3.0, 5.0],
            [Fault.BLOCKED_OUT, 0.1, 0.0, 0.0, ALWAYS],
            [Fault.SLOW, 0.5, 0.0, 6.0, ALWAYS],
        ]
    )
    kept = NOTHING_KEPT.copy()
    found = [effects.acted(plant(), plant(), rows, k, TICK, 0.0, kept) for k in range(8)]
    assert found == [0, 0, 0, 1, 1, 1, 2, 2]
    changed = [k for k in range(9) if effects.changes(rows, k)]
    assert changed == [0, 3, 5, 6]


BASE = {
    "GAIN": 2.0,
    "RATE": 3.0,
    "LOAD_DRIVE": 5.0,
    "LOAD_BACK": 7.0,
    "SUPPLY": 12.0,
    "SAG": 0.2,
    "KAPPA": 0.4,
    "K_L": 1e-6,
    "V_0": 2e-6,
    "SWITCH_IN": -3e-4,
    "SWITCH_OUT": 3.1e-4,
}


def changed(q, *, volume=0.0, shift=0.0, flows=0.0, given=None, **base):
    """Return what `change_plant` makes of a plant, as a function of a name."""
    healthy = plant(**BASE | base)
    p, kept = healthy.copy(), NOTHING_KEPT.copy()
    kept[effects._FLOWS] = flows
    if given is not None:
        p[:] = given
    effects.change_plant(healthy, p, q, volume, shift, kept)
    return lambda name: p[getattr(modes, name)]


@pytest.mark.parametrize(
    ("flows", "share", "load"), [(0.0, 0.3, 1.7), (1.0, 0.3, 1.7), (-1.0, 0.6, 1.0)]
)
def test_a_port_slows_the_actuator_and_loads_it_outward(flows, share, load):
    """Out to twice the load; its speed and load are also what other faults make of them."""
    q = of(PORT_OUT=(0.3, 0.0), PORT_IN=(0.6, 0.0), SPEED=(0.5, 0.0), LOAD=(4.0, 0.0))
    now = changed(q, flows=flows)
    assert (now("GAIN"), now("RATE")) == pytest.approx((2.0 * 0.5 * share, 3.0 * 0.5 * share))
    assert now("LOAD_DRIVE") == pytest.approx(5.0 * 4.0 * load)
    assert now("LOAD_BACK") == pytest.approx(7.0 * 4.0 * load)


def test_what_faults_change_in_a_plant():
    well = changed(nothing())
    assert {name: well(name) for name in BASE} == BASE
    now = changed(of(CREEP=(1.0, 3e-3), WEIGHT=(1.0, -0.05), SAG=(1.0, 0.7)))
    assert now("K_L") == pytest.approx(1e-6 + 3e-3 * STROKE)
    assert now("V_0") == pytest.approx(2e-6 - 0.05 * STROKE)
    assert (now("SAG"), now("KAPPA")) == (0.7, 0.4)
    assert changed(of(SAG=(1.0, 0.1)))("SAG") == 0.2  # the battery's own is larger
    # all that is lost with speed counts as back electromotive force where that is not known
    assert changed(of(SAG=(1.0, 0.7)), KAPPA=0.0)("KAPPA") == pytest.approx(0.5)
    assert changed(nothing(), KAPPA=0.0)("KAPPA") == 0.0


@pytest.mark.parametrize("summand", [1.0, -1.0])
def test_a_limit_switch_cuts_everywhere_or_nowhere(summand):
    """The inner one cuts below its volume, the outer one above it."""
    now = changed(of(SWITCH_IN=(1.0, summand)))
    assert (now("SWITCH_IN"), now("SWITCH_OUT")) == (summand * math.inf, 3.1e-4)
    now = changed(of(SWITCH_OUT=(1.0, summand)))
    assert (now("SWITCH_IN"), now("SWITCH_OUT")) == (-3e-4, -summand * math.inf)


def test_a_block_stands_where_the_actuator_was_and_none_that_stands_gives_way():
    """Shares of the stroke from there; what the limits are counted less by comes off."""
    q = of(BLOCK_OUT=(0.0, 0.1), BLOCK_IN=(0.0, 0.2))
    now = changed(q, volume=1e-4, shift=3e-5)
    assert now("V_MAX") == pytest.approx(1e-4 + 0.1 * STROKE - 3e-5)
    assert now("V_MIN") == pytest.approx(1e-4 - 0.2 * STROKE - 3e-5)
    nearer = plant(**BASE | {"V_MAX": 1.1e-4, "V_MIN": 0.9e-4})
    now = changed(q, volume=1e-4, given=nearer)
    assert (now("V_MAX"), now("V_MIN")) == (1.1e-4, 0.9e-4)
    far = changed(q, volume=3.4e-4)
    assert far("V_MAX") == STROKE / 2
    well = changed(of(BLOCK_OUT=(1.0, 0.1), BLOCK_IN=(1.0, 0.1)), volume=1e-4)
    assert (well("V_MIN"), well("V_MAX")) == (-STROKE / 2, STROKE / 2)


def test_a_flow_of_less_than_a_hundredth_turns_nothing():
    healthy, q = plant(**BASE), of(PORT_OUT=(0.3, 0.0), PORT_IN=(0.6, 0.0))
    kept, p = NOTHING_KEPT.copy(), plant(**BASE)
    steps = [
        (0.0099, False, 0.0),
        (0.01, False, 0.0),
        (-0.0101, True, -1.0),
        (-0.5, False, -1.0),
        (0.01, False, -1.0),
        (0.0101, True, 1.0),
        (-0.0099, False, 1.0),
    ]
    for effort, turned, flows in steps:
        assert effects.turn_flow(healthy, p, q, effort, kept) is turned
        assert kept[effects._FLOWS] == flows
        if flows:
            assert p[modes.GAIN] == pytest.approx(2.0 * (0.6 if flows < 0.0 else 0.3))
    # a port that is open lets through what it did
    for open_ in (nothing(), of(PORT_OUT=(1.0, 0.0))):
        assert not effects.turn_flow(healthy, p, open_, -0.5, NOTHING_KEPT.copy())
    for q in (of(PORT_OUT=(0.5, 0.0)), of(PORT_IN=(0.5, 0.0))):
        assert effects.turn_flow(healthy, p, q, -0.5, NOTHING_KEPT.copy())


def test_a_battery_has_what_is_left_of_its_voltage_and_less_while_it_drives():
    q = of(CHARGE=(0.8, 0.0), CELL=(0.7, 0.0))
    assert effects.emf(plant(**BASE), q, True) == pytest.approx(12.0 * 0.8 * 0.7)
    assert effects.emf(plant(**BASE), q, False) == pytest.approx(12.0 * 0.8)


def test_a_driver_that_runs_on_does_so_the_way_it_last_had():
    """Also once it is off; one that never was on runs outward."""
    runs, kept = of(COMMAND=(0.0, 1.0)), NOTHING_KEPT.copy()
    assert effects.driven(runs, -9.0, 12.0, 3.0, 0.0, kept) == 12.0
    for way, given in ((-0.1, -9.0), (0.0, -9.0), (0.2, 12.0), (0.0, 12.0)):
        assert effects.driven(runs, -9.0, 12.0, 3.0, way, kept) == given
    for factor in (1.0, -1.0, 0.0):
        q = of(COMMAND=(factor, 0.0))
        assert effects.driven(q, -9.0, 12.0, 3.0, 0.4, kept) == factor * 3.0


def test_a_pumps_table_is_looked_up_between_its_rows_and_its_edges_go_on():
    random = np.random.default_rng(6)
    table = random.normal(size=(4, 6))
    between = RegularGridInterpolator((np.arange(4.0), np.arange(6.0)), table)
    for row, column in random.uniform((-1.0, -1.0), (4.0, 6.0), (300, 2)):
        inside = np.clip(row, 0.0, 3.0), np.clip(column, 0.0, 5.0)
        assert effects._between(table, row, column) == pytest.approx(
            float(between(inside)), abs=2e-5
        )


def pump(resistance=0.2, motor=0.5):
    """A pump that delivers 2e-6 V - 1e-8 z and draws 0.2 V + 0.01 z, by tables of that."""
    volts, depth = np.meshgrid(0.5 * np.arange(40), 100.0 * np.arange(30), indexing="ij")
    return PumpTable(
        rate=2e-6 * volts - 1e-8 * depth,
        current=0.2 * volts + 0.01 * depth,
        per_volt=2.0,
        per_metre=0.01,
        nominal=12.0,
        resistance=resistance,
        motor=motor,
    )


@pytest.mark.parametrize("sags", [0.0, 0.3, 1.0])
def test_a_pump_delivers_what_its_battery_and_its_load_leave_it(sags):
    """With currents and flows that are linear, Kirchhoff's law is solved by hand."""
    q = of(
        CHARGE=(0.9, 0.0),
        CELL=(0.95, 0.0),
        LOAD=(2.0, 0.0),
        PORT_OUT=(0.4, 0.0),
        SPEED=(0.5, 0.0),
        SAG=(1.0, sags),
    )
    table, z = pump(), 300.0
    E, head = 12.0 * 0.9 * 0.95, 2.0 * (2.0 - 0.4) * z
    more = max(sags * 0.5 - 0.2, 0.0)
    current = (0.2 * E + 0.01 * head) / (1.0 + 0.2 * more)
    rate, well = 2e-6 * (E - more * current) - 1e-8 * head, 2e-6 * 12.0 - 1e-8 * z
    share, loaded, unloaded = effects.pump_share(table, plant(**BASE), q, z)
    assert share == pytest.approx(0.5 * 0.4 * rate / well, rel=1e-6)
    assert loaded == pytest.approx(E - (0.2 + more) * current, rel=1e-6)
    assert unloaded == pytest.approx(12.0 * 0.9)


def test_a_pump_that_would_deliver_nothing_in_health_has_no_share():
    assert effects.pump_share(pump(), plant(**BASE), nothing(), 2400.0)[0] == 0.0
    share, *_ = effects.pump_share(pump(), plant(**BASE), nothing(), 2399.0)
    assert share == pytest.approx(1.0)


def test_a_board_loses_ticks_as_often_as_is_said_is_reset_and_hangs():
    np.random.seed(7)  # noqa: NPY002
    q = of(TICKS=(0.3, 0.0))
    lost = np.mean([effects.board_misses(q, TICK)[0] for _ in range(9999)])
    assert lost == pytest.approx(0.7, abs=4.0 * math.sqrt(0.21 / 9999))
    assert effects.board_misses(nothing(), TICK) == (False, False, 0)
    assert effects.board_misses(of(PAUSE=(0.0, 0.0)), TICK) == (True, False, 0)
    assert effects.board_misses(of(RESET=(0.0, 0.0)), TICK) == (False, True, 0)
    for hangs, ticks in ((1.0, 4), (1.1, 5)):
        assert effects.board_misses(of(HANG=(1.0, hangs)), TICK) == (False, False, ticks)


@pytest.mark.parametrize("rate", [0.3, -0.3, 0.95, -0.85, 4.0, -4.0])
def test_a_clock_has_as_many_ticks_as_its_rate_says(rate):
    """Twice as many at most, a tenth at least; never more than a tick ahead or behind."""
    ahead, ticks = 0.0, 0
    for n in range(1, 401):
        now, ahead = effects.ticks_now(of(CLOCK=(1.0, rate)), ahead)
        assert now in (0, 1, 2)
        ticks += now
        assert abs(ahead) < 1.0
        assert ticks + ahead == pytest.approx(n * (1.0 + min(max(rate, -0.9), 1.0)))


def test_a_clock_that_is_a_whole_tick_ahead_or_behind_makes_up_for_it_at_once():
    """Half a tick each time is exact in binary."""
    for rate, ticks in ((0.5, [1, 2, 1, 2]), (-0.5, [1, 0, 1, 0])):
        ahead, found = 0.0, []
        for _ in range(4):
            now, ahead = effects.ticks_now(of(CLOCK=(1.0, rate)), ahead)
            found.append(now)
        assert found == ticks


def test_the_depth_that_the_board_is_asked_for():
    assert effects.asked(nothing(), 7.0) == 7.0
    assert effects.asked(of(ASKED=(1.0, -1e39)), 7.0) == -1e39
    assert math.isnan(effects.asked(of(ASKED=(0.0, 0.0)), 7.0))
