"""The supervisor in double precision: each detector for its fault and in its time, none without."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

import swimbladder as sb
from swimbladder.codegen.twin import ControllerTwin, VehicleTwin
from swimbladder.control.law import NEVER
from swimbladder.control.registry import LAWS
from swimbladder.control.supervisor import (
    SUPERVISOR,
    PushWatch,
    Reason,
    Watched,
    count_time,
    enough,
    expected_rate,
    learn,
    outward,
    reasons_in,
    times,
    watch_motion,
    watch_proof,
    watch_push,
    watch_sameness,
    watch_still,
    watch_stops,
    way_to_stop,
)
from swimbladder.control.supervisor_limits import command_limits, supervisor_parameters
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import drag_per_mass, plant, terminal_speed
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Sensors, Supervisor
from tests.codegen.laws import changed, example
from tests.oracle import Machine
from tests.vehicles import EACH, TWO, paper

NOISY = Sensors(depth_noise="2 mm", depth_quantum="5 mm", volume_noise="0.2 cm3")
CLEAN = Sensors()
CALM = Watched(2.0, 0.1, 1e-5, 12.0, False, 0, 0)
WET = CALM._replace(leak=True)


class Flown(NamedTuple):
    ran: Any
    vehicle: VehicleTwin
    reason: Reason | None
    after: float  # s, from the fault to the reason


def fly(
    name="cascade", *, vehicle=None, fault=None, onset=300.0, sensors=NOISY, supervisor=None, **run
) -> Flown:
    """Fly a law under the supervisor; fault: (seconds since the onset, seen) -> seen."""
    usual, parameters, tick = example(name)
    vehicle = vehicle or usual
    own = Supervisor(**(supervisor or {}))
    vehicle = vehicle.model_copy(update={"sensors": sensors, "supervisor": own})
    low, high = command_limits(vehicle)
    first = 0.0 if vehicle.voltage_driven else high
    law = ControllerTwin(LAWS[name], parameters, tick_s=tick, limits=(low, high), first=first)
    latched: list[int] = []
    start = math.ceil(onset / tick - 1e-9)

    def spoil(k: int, seen: Watched) -> Watched:
        if fault is None or k < start:
            return seen
        return fault((k - start) * tick, seen)

    flown = VehicleTwin(law, supervisor_parameters(vehicle, tick), spoil=spoil)

    def watched(seen, reference):
        command = flown(seen, reference)
        if flown.reason and not latched:
            latched.append(flown.controller.ticks - 1)
        return command

    mission: dict[str, Any] = dict(
        setpoints=[(0.0, 3.0), (150.0, 5.0)], duration=900.0, start_depth=1.5, seed=1
    )
    ran = simulate(vehicle, law=watched, sample_time=tick, checked=False, **(mission | run))
    after = (latched[0] - start) * tick if latched else math.nan
    return Flown(ran, flown, flown.reason, after)


def held(at: dict[str, float], name: str, value: float) -> float:
    return at.setdefault(name, value)


def frozen(field: str) -> Any:
    kept: dict[str, float] = {}
    return lambda _, seen: seen._replace(**{field: held(kept, field, getattr(seen, field))})


FAULTS = {
    "no number": (lambda: lambda _, s: s._replace(depth=math.nan), Reason.DEPTH_MISSING, 5.2),
    "beyond": (lambda: lambda _, s: s._replace(depth=1e6), Reason.DEPTH_IMPOSSIBLE, 5.2),
    "late": (lambda: lambda t, s: s._replace(depth_age=t), Reason.DEPTH_LATE, 6.3),
    "frozen": (lambda: frozen("depth"), Reason.DEPTH_FROZEN, 38.0),
    "at 0": (
        lambda: lambda _, s: s._replace(depth=0.0),
        Reason.NOT_MOVING_AS_MODELLED,
        30.0,
    ),
    "no volume": (lambda: lambda _, s: s._replace(volume=math.inf), Reason.VOLUME_MISSING, 5.2),
    "odd volume": (lambda: lambda _, s: s._replace(volume=1e-3), Reason.VOLUME_IMPOSSIBLE, 5.2),
    "stuck": (lambda: frozen("volume"), Reason.NOT_FOLLOWING, 40.0),
    "shifted": (
        lambda: lambda _, s: s._replace(volume=s.volume + 1.5e-4),
        Reason.NOT_MOVING_AS_MODELLED,
        45.0,
    ),
    "battery": (lambda: lambda _, s: s._replace(battery=9.5), Reason.BATTERY_LOW, 10.2),
    "leak": (lambda: lambda _, s: s._replace(leak=True), Reason.LEAK, 1.2),
    "slow loop": (lambda: lambda _, s: s._replace(lost=1), Reason.TICKS_LOST, 5.2),
}
_IN_CATALOGUE = {
    "no number": "depth NaN",
    "beyond": "depth out of range",
    "late": "depth late",
    "frozen": "depth stuck",
    "at 0": "depth wrong scale",
    "no volume": "volume NaN",
    "stuck": "volume stuck",
    "battery": "battery drops",
    "slow loop": "ticks lost",
}


def shows(kind: str) -> Any:
    """Return a fault as a parameter, with the promise that it shows."""
    reason = FAULTS[kind][1].name.lower().replace("_", "-")
    faults = [_IN_CATALOGUE[kind]] if kind in _IN_CATALOGUE else []
    return pytest.param(kind, marks=pytest.mark.promise(reason, faults=faults))


class TestFaults:
    @pytest.mark.parametrize("kind", [*map(shows, FAULTS)])
    def test_each_has_its_reason_in_its_time_and_the_vehicle_comes_up(self, kind):
        make, reason, within = FAULTS[kind]
        flown = fly(fault=make())
        assert flown.reason is reason
        assert reason in flown.vehicle.reasons
        assert flown.after <= within
        assert flown.ran.depth[-1] < 0.5
        assert flown.ran.finished

    @pytest.mark.parametrize("name", EACH[1:])
    @pytest.mark.parametrize("kind", [shows("no number"), shows("frozen"), shows("at 0")])
    def test_under_every_law(self, name, kind):
        flown = fly(name, fault=FAULTS[kind][0]())
        assert flown.reason is not None
        assert flown.after < 60.0
        assert flown.ran.depth[-1] < 0.5

    @pytest.mark.promise("not-following", faults=["actuator reversed"])
    def test_a_reversed_volume(self):
        """As with a motor's leads swapped: the volume goes where it is not sent."""
        kept: dict[str, float] = {}

        def reversed_(_, s):
            return s._replace(volume=2.0 * held(kept, "V", s.volume) - s.volume)

        flown = fly(fault=reversed_)
        assert flown.reason is Reason.NOT_FOLLOWING
        assert flown.after < 15.0

    @pytest.mark.promise("depth-frozen", faults=["depth stuck"])
    def test_a_frozen_quantised_depth_under_an_integrating_law(self):
        """No noise shows; the volume that leaves gives the sensor away before the sea does."""
        flown = fly(
            "sea-cascade",
            fault=frozen("depth"),
            sensors=Sensors(depth_quantum="5 mm"),
            setpoints=[(0.0, 3.0), (320.0, 3.5)],
        )
        assert flown.reason in (Reason.DEPTH_FROZEN, Reason.NOT_MOVING_AS_MODELLED)
        assert flown.after < 60.0
        assert flown.ran.depth[-1] < 0.5

    @pytest.mark.parametrize("name", ["sea-cascade", "adrc", "observer", "planned"])
    @pytest.mark.promise("not-moving-as-modelled")
    def test_a_clogged_port_of_a_living_sensor(self, name):
        """The depth stands still with its noise, the law goes for half a metre more."""
        kept: dict[str, float] = {}
        rng = np.random.default_rng(3)

        def clogged(_, s):
            return s._replace(depth=held(kept, "depth", s.depth) + rng.normal(0.0, 0.002))

        flown = fly(name, fault=clogged, setpoints=[(0.0, 3.0), (320.0, 3.5)])
        assert flown.reason is Reason.NOT_MOVING_AS_MODELLED
        assert flown.ran.depth[-1] < 0.5

    @pytest.mark.promise("not-moving-as-modelled")
    def test_a_bottom_that_was_not_stated(self):
        """It looks like a sensor that has stopped; the vehicle comes up."""
        flown = fly(setpoints=[(0.0, 6.0)], bottom_depth=4.5, onset=0.0)
        assert flown.reason is Reason.NOT_MOVING_AS_MODELLED
        assert flown.ran.depth[-1] < 0.5

    @pytest.mark.promise("not-moving-as-modelled", faults=["depth drift"])
    def test_a_depth_that_drifts_deeper(self):
        """The law lifts the vehicle; ψ says that its volume belongs elsewhere."""
        flown = fly(fault=lambda t, s: s._replace(depth=s.depth + 0.05 * t))
        assert flown.reason is Reason.NOT_MOVING_AS_MODELLED
        assert flown.ran.depth[-1] < 0.5

    @pytest.mark.promise("depth-limit")
    def test_the_depth_limit(self):
        flown = fly(
            supervisor={"depth_limit": "4 m"}, setpoints=[(0.0, 6.0)], onset=0.0, fault=None
        )
        assert flown.reason is Reason.DEPTH_LIMIT
        assert 4.0 < flown.ran.depth.max() < 6.0
        assert flown.ran.depth[-1] < 0.5

    @pytest.mark.promise("depth-limit")
    def test_a_fast_descent_is_turned_round_ahead_of_the_deepest(self):
        """A law that dives at full speed: at the depth limit of 50 m it would be too late."""
        limit = supervisor_parameters(example("cascade")[0], 0.3)
        fast = fly(setpoints=[(0.0, 60.0)], start_depth=5.0)
        assert fast.reason is Reason.DEPTH_LIMIT
        first = np.flatnonzero(fast.ran.command == limit.push.surface_command)[0]
        assert fast.ran.depth[first] < 0.7 * limit.deep.depth_limit
        assert fast.ran.depth.max() < limit.deep.deepest
        assert fast.ran.depth[-1] < 0.5

    @pytest.mark.promise("time-limit", faults=["ticks lost"])
    def test_the_time_limit_counts_lost_ticks(self):
        flown = fly(supervisor={"time_limit": "200 s"}, onset=0.0, fault=lambda _, s: s)
        assert flown.reason is Reason.TIME_LIMIT
        assert flown.after == pytest.approx(200.1)  # 667 ticks, the first beyond 200 s
        sometimes = fly(
            supervisor={"time_limit": "200 s"},
            onset=0.0,
            fault=lambda t, s: s._replace(lost=1 if round(t / 0.3) % 10 == 9 else 0),
        )
        assert sometimes.after == pytest.approx(200.1 / 1.1, abs=0.7)

    @pytest.mark.promise("no-command")
    def test_a_law_that_gives_no_command(self):
        flown = fly(setpoints=[(0.0, 3.0), (150.0, 5.0)])
        assert flown.reason is None
        mute = fly(fault=None)
        p, state = mute.vehicle.limits, mute.vehicle.state
        seen = CALM._replace(depth=float(mute.ran.depth[-1]), missed=p.board.missed)
        _, after, _ = SUPERVISOR.step(p, state, seen, 0.0)
        assert reasons_in(after.recovery.reasons) == (Reason.NO_COMMAND,)

    @pytest.mark.promise("no-command", faults=["set-point absurd"])
    @pytest.mark.parametrize("absurd", [-3e38, -20.0, 141.0, 3e38])
    def test_a_set_point_that_no_vehicle_can_have(self, absurd):
        """It is passed over for as long as the law may give no command; a spell of it is not."""
        p = supervisor_parameters(example("cascade")[0], 0.3)
        assert -20.0 < p.depth.depth_least < -1.0
        assert p.deep.deepest < p.depth.depth_most < 141.0

        def reasons(ticks: int, of: int) -> tuple[Reason, ...]:
            s = SUPERVISOR.initial(p, CALM, 0.0)
            for k in range(10 * ticks):
                asked = absurd if k % of < ticks else 3.0
                seen = CALM._replace(depth=3.0 + 1e-3 * (k % 2), reference=asked)
                _, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            return reasons_in(s.recovery.reasons)

        assert Reason.NO_COMMAND not in reasons(p.board.missed - 1, p.board.missed)
        assert reasons(p.board.missed, 10 * p.board.missed)[-1] is Reason.NO_COMMAND

    @pytest.mark.promise("not-following", faults=["blocked outward"])
    def test_pushes_that_end_at_one_place(self):
        """Noise drives the volume to and fro; a block holds it back at its peaks only."""
        p = supervisor_parameters(example("cascade")[0], 0.3)
        p = changed(p, same_tried=NEVER)  # the depth of this stand is the very same all along

        def seconds(block: float) -> float:
            rng = np.random.default_rng(5)
            s, volume = SUPERVISOR.initial(p, CALM, 0.0), 8e-6
            for k in range(2000):
                wanted = min(max(1e6 * (8e-6 + rng.normal(0.0, 4e-6) - volume), -12.0), 12.0)
                _, s, _ = SUPERVISOR.step(p, s, CALM._replace(volume=volume), wanted)
                if s.recovery.reasons:
                    assert s.recovery.reason == Reason.NOT_FOLLOWING
                    return 0.3 * k
                push = wanted - p.rate.load_drive * CALM.depth
                volume = min(volume + 0.3 * p.rate.rate * push, block)
            return math.inf

        assert seconds(9e-6) < 60.0
        assert seconds(math.inf) == math.inf


@pytest.mark.parametrize(
    ("count", "reason", "bad"),
    [
        ("leak", Reason.LEAK, {"leak": True}),
        ("battery", Reason.BATTERY_LOW, {"battery": 8.0}),
        ("blind", Reason.VOLUME_MISSING, {"volume": math.nan}),
        ("deep", Reason.DEPTH_LIMIT, {"depth": 95.0}),
    ],
)
@pytest.mark.parametrize(
    ("bads", "at"),
    [
        (1, None),  # 1, 0, 1, 0
        (2, None),  # 1 2, 0, 1 2, 0
        (3, 38),  # 1 2 3, 1, 2 3 4, 2: one more a round of four; 10 11 12 in the tenth
        (5, 20),  # 1 to 5, 3, 4 to 8, 6, 7 to 11, 9, 10 11 12 in the fourth round of six
    ],
)
@pytest.mark.promise("debounce")
def test_what_fails_more_than_two_thirds_of_the_time_is_a_reason(count, reason, bad, bads, at):
    """A good tick takes two bad ones away, of a limit of 12."""
    p = supervisor_parameters(paper(), 0.3)
    p = changed(p, **{count: 12}, fastest=math.inf, step=math.inf, jump=math.inf)
    s = SUPERVISOR.initial(p, CALM, 0.0)
    first = None
    for k in range(60):
        seen = CALM._replace(**bad) if k % (bads + 1) < bads else CALM
        _, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
        if first is None and reason in reasons_in(s.recovery.reasons):
            first = k
    assert first == at


@pytest.mark.parametrize(
    ("bad", "limit", "reason"),
    [
        ({"depth": math.nan}, "blind_quarters", Reason.DEPTH_MISSING),
        ({"lost": 1}, "lost_quarters", Reason.TICKS_LOST),
    ],
)
@pytest.mark.parametrize(("period", "at"), [(5, None), (4, 144)])
@pytest.mark.promise("debounce")
def test_what_fails_more_than_a_fifth_of_the_time_is_a_reason(bad, limit, reason, period, at):
    """Four quarters a bad tick, one less a good one: of 1 in 4 one is left a round, of 1 in 5 none.

    Of a limit of 40 quarters the 36 that the rounds left and 4 more are reached in round 36.
    """
    p = changed(supervisor_parameters(paper(), 0.3), **{limit: 40})
    s = SUPERVISOR.initial(p, CALM, 0.0)
    first = None
    for k in range(200):
        seen = CALM._replace(**bad) if k % period == 0 else CALM
        _, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
        if first is None and reason in reasons_in(s.recovery.reasons):
            first = k
    assert first == at


def test_a_volume_that_moved_by_just_what_it_may_says_nothing_of_a_depth_that_stays():
    p = supervisor_parameters(example("cascade")[0], 0.3)
    limits = p.same._replace(same_begun=1, same_moved=2, same=NEVER, same_noisy=NEVER, moved=3e-6)
    p = p._replace(same=limits, motion=p.motion._replace(smoothing=1.0))
    for moved, frozen in ((3e-6, False), (math.nextafter(3e-6, 1.0), True), (-4e-6, True)):
        watch = SUPERVISOR.initial(p, CALM, 0.0).same
        for n1 in (0.0, moved, moved):
            watch = watch_sameness(p, watch, 2.0, 2.0, n1, old=False, resting=False)
            if n1 == 0.0:
                assert not watch.frozen
        assert watch.frozen is frozen


@pytest.mark.parametrize("name", ["cascade", "position-pid"])
def test_no_motion_within_a_quantum_makes_its_depth_frozen(name):
    """However fast: from rest to and fro by a quantum, the volume of eq. (13), drag a third larger.

    Through one low pass the volume of the faster ones is beyond what counts.
    """
    (vehicle, _, tick), quantum = example(name), 0.05  # m
    vehicle = vehicle.model_copy(update={"sensors": Sensors(depth_quantum=quantum)})
    p = supervisor_parameters(vehicle, tick)
    m, once = p.motion, [0.0]
    for omega in np.geomspace(0.02, 0.5 / tick, 12):
        watch, n1 = SUPERVISOR.initial(p, CALM, 0.0).same, 0.0
        for k in range(4 * p.same.same_moved):
            at = omega * max(k - p.same.same_begun, 0) * tick  # way: quantum (1 - cos)/2
            volume = 0.5 * quantum * omega**2 * math.cos(at) * m.inertia / m.per_tau**2
            volume += 1.3 * m.drag_linear * 0.5 * quantum * omega * math.sin(at)
            volume = volume if at > 0.0 else 0.0
            n1 += m.smoothing * (volume - n1)
            watch = watch_sameness(p, watch, 2.0, 2.0, n1, old=False, resting=False)
            once.append(abs(n1) / p.same.moved)
        assert not watch.frozen
    assert max(once) > 1.0
    for _ in range(p.same.same_moved):  # and one that stays away does
        watch = watch_sameness(p, watch, 2.0, 2.0, 9.0 * p.same.moved, old=False, resting=False)
    assert watch.frozen


@pytest.mark.promise("depth-frozen", faults=["depth stuck"])
@pytest.mark.parametrize("later", [44.0, 48.0, 84.0, 88.0])
def test_a_volume_that_begins_to_move_says_nothing_of_its_depth_yet(later):
    """A fast piston from rest: what it has moved is large before the depth leaves its quantum."""
    setpoints = [(0.0, 3.0), (600.0 + later, 2.0)]
    flown = fly("position-pid", sensors=Sensors(depth_quantum="5 mm"), setpoints=setpoints)
    assert flown.reason is None


@pytest.mark.prove
@pytest.mark.parametrize("back", [20.0, 30.0, 40.0])
def test_a_blunt_hull_that_turns_round_fast_moves_as_modelled(back):
    """Drag as the square of a speed that two low passes have levelled is not that of the speed."""
    vehicle = load_vehicle("ntnu-bv").replace(
        {"actuator.speed": "10 mm/s", "hull.depth_limit": "100 m", "controller.sample_time": 0.2}
    )
    mission = {"setpoints": [(0.0, 5.0), (120.0, 60.0), (120.0 + back, 1.0)], "duration": 240.0}
    ran = sb.simulate(vehicle, start_depth=5.0, supervised=True, **mission)
    assert ran.depth.max() > 9.0
    assert ran.alarm is None


def test_a_rate_and_a_way_of_just_what_counts_do_not_count():
    p = supervisor_parameters(example("cascade")[0], 0.3)
    p = p._replace(rate=p.rate._replace(stop_rate=1e-6, stop_least=1e-7, stops=9))
    s = SUPERVISOR.initial(p, CALM, 0.0)
    for rate, stops in ((1e-7, 0), (math.nextafter(1e-7, 0.0), 1), (-1e-7, 0)):
        assert watch_stops(p, s.rate, 2e-6, rate, s.rate.top).stops == stops
    begun = changed(s, unproven=3, shown=1.0)
    at = enough(p, p.proof.ready) + p.push.grown
    begun = changed(begun, z1=2.0)

    def then(beyond: float) -> Any:
        seen = CALM._replace(depth=2.0, volume=beyond, reference=2.0)
        return watch_proof(p, begun, seen, neutral=0.0, tried=False)[1].unproven

    assert [then(beyond) for beyond in (at, math.nextafter(at, math.inf))] == [4, 0]


@pytest.mark.parametrize("lost", [0, 1, 4094, 4095, 4096, 10_000])
@pytest.mark.parametrize("tick", [0, 1, 4095, 4096])
def test_a_gap_counts_for_just_what_it_is_up_to_4095_ticks(tick, lost):
    """The fine count stays in its block of 4096 ticks, and nothing of it is lost."""
    p = supervisor_parameters(example("cascade")[0], 0.3)
    s = SUPERVISOR.initial(p, CALM, 0.0).time._replace(tick=tick, block=3)
    after = count_time(p.time._replace(time_blocks=100), s, lost)
    assert after.tick <= 4096
    gone = 4096 * (after.block - 3) + after.tick - tick
    assert gone == min(lost, 4095) + 1


@pytest.mark.parametrize(("off", "counts"), [(0.9, 0), (1.1, 1), (1.9, 1), (2.1, 3)])
def test_a_volume_off_by_more_than_twice_the_allowed_counts_three_times(off, counts):
    """At a depth that stands, where the volume itself is compared."""
    p, room = supervisor_parameters(example("cascade")[0], 0.3), 4e-5  # m3
    n = off * room
    s = SUPERVISOR.initial(p, CALM, 0.0).motion._replace(z1=2.0, z2=2.0, n1=n, n2=n, settled=0)
    assert s.known < p.motion.known
    assert watch_motion(p, s, 2.0, n, room, stands=True, anew=False).wrong == counts


@pytest.mark.promise("not-moving-as-modelled", faults=["bit flips", "large leak"])
def test_a_neutral_volume_that_changes_counts_where_a_bit_of_its_depth_flipped():
    """Its depth, from which psi is allowed for, is of no use then; the range of trim is."""
    p, room = supervisor_parameters(example("cascade")[0], 0.3), 8.75e-5
    known = {"own_depth": 1e30, "known": p.motion.known, "settled": 0}
    s = SUPERVISOR.initial(p, CALM, 0.0).motion._replace(z1=2.0, z2=2.0, **known)
    for n, wrong in ((1.1 * room, 1), (0.9 * room, 0)):
        s = s._replace(n1=n, n2=n, wrong=0)
        assert watch_motion(p, s, 2.0, n, room, stands=True, anew=False).wrong == wrong


@pytest.mark.promise("not-moving-as-modelled", faults=["bit flips"])
@pytest.mark.parametrize(
    "field", ["z1", "z2", "n1", "n2", "blunt", "own", "recent", "own_depth", "weight"]
)
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_bits_have_made_no_number_begins_anew(field, value):
    """A low pass that holds no number holds none for ever: the vehicle was watched no more."""
    p = supervisor_parameters(example("cascade")[0], 0.3)
    s = SUPERVISOR.initial(p, CALM, 0.0)
    s = s._replace(motion=s.motion._replace(known=p.motion.known, **{field: value}))
    seen, steps = CALM._replace(volume=1.2e-4, depth=5.0), 0
    while s.recovery.reason == 0 and steps < 400:
        command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
        assert math.isfinite(command)
        steps += 1
    assert s.recovery.reason == Reason.NOT_MOVING_AS_MODELLED  # 100 cm3 too light, and it stays


@pytest.mark.promise("not-following", faults=["bit flips"])
@pytest.mark.parametrize("field", ["lag", "asked"])
def test_a_rate_that_bits_have_made_no_number_begins_anew(field):
    p = supervisor_parameters(example("cascade")[0], 0.3)
    s = SUPERVISOR.initial(p, CALM, 0.0)
    s = s._replace(rate=s.rate._replace(**{field: math.nan}))
    for _ in range(3 * int(p.rate.following)):
        _, s, _ = SUPERVISOR.step(p, s, CALM, 6.0)  # and the volume stays
    assert s.recovery.reason == Reason.NOT_FOLLOWING


def test_the_recent_neutral_volume_follows_a_leak_by_the_time_of_a_low_pass():
    """The mean of the dive lags by half of the dive: SciPy's answer of a low pass to a ramp."""
    p = supervisor_parameters(example("cascade")[0], 0.3).motion
    s = SUPERVISOR.initial(supervisor_parameters(example("cascade")[0], 0.3), CALM, 0.0).motion
    rate, weight, ticks = 1e-7 * 0.3, p.smoothing, 600
    ramp = rate * np.arange(ticks)
    for n in ramp:
        s = learn(p, s, 2.0, float(n), 1.0)
    low_pass = lfilter([weight], [1.0, weight - 1.0], ramp)
    assert s.recent == pytest.approx(low_pass[-1], rel=1e-3)
    assert s.own == pytest.approx(np.mean(ramp), rel=0.05)


def test_a_turned_push_that_lost_just_what_counts_has_not_fallen():
    p = supervisor_parameters(example("cascade")[0], 0.3)
    p = p._replace(push=p.push._replace(grown=2e-6, away=1e-5))
    s = PushWatch(phase=0, pushed=0.0, astray=p.push.astray, turns=3)
    p = p._replace(volume=p.volume._replace(volume_low=-1e-4))
    for lost, turns in ((2e-6, 3), (math.nextafter(2e-6, 1.0), 1)):
        after = watch_push(p, s, -lost, True, sinks=False, lifts=False, high=False, blind=False)
        assert after.turns == turns


@pytest.mark.parametrize(("noisy", "frozen"), [(0.49, False), (0.5, True), (0.51, True)])
@pytest.mark.promise("depth-frozen", faults=["depth stuck"])
def test_a_depth_as_noisy_as_it_takes_is_frozen_when_it_stays(noisy, frozen):
    p = supervisor_parameters(example("cascade")[0], 0.3)
    limits = p.same._replace(same_noisy=2, same=NEVER, same_moved=NEVER, noisy=0.5)
    p = p._replace(same=limits)
    watch = SUPERVISOR.initial(p, CALM, 0.0).same._replace(noisy=noisy)
    for _ in range(2):
        watch = watch_sameness(p, watch, 2.0, 2.0, 0.0, old=False, resting=False)
    assert watch.frozen is (frozen and watch.noisy >= limits.noisy)


@pytest.mark.promise("depth-frozen", faults=["depth stuck"])
def test_a_hull_that_bobs_shows_no_noise():
    """What turns the depth afloat may be the hull; what turns it under water is the sensor."""
    p = supervisor_parameters(example("cascade")[0], 0.3)
    limits = p.same._replace(same=NEVER, same_moved=NEVER)
    p = p._replace(same=limits)
    for resting in (True, False):
        watch = SUPERVISOR.initial(p, CALM, 0.0).same
        before = 0.1
        for tick in range(350):
            depth = 0.1 + (0.001 if tick % 2 else -0.001)
            watch = watch_sameness(p, watch, depth, before, 0.0, old=False, resting=resting)
            before = depth
        assert (watch.noisy >= limits.noisy) is not resting
        for _ in range(limits.same_noisy):
            watch = watch_sameness(p, watch, before, before, 0.0, old=False, resting=resting)
        assert watch.frozen is not resting


def test_a_depth_stands_still_after_all_its_ticks():
    p = supervisor_parameters(example("cascade")[0], 0.3)
    rest = SUPERVISOR.initial(p, CALM, 0.0).rest
    for tick in range(1, 6):
        rest = watch_still(p.rest, rest, 0.5 * p.rest.still_distance)
        assert rest.still == tick
    assert watch_still(p.rest, rest, 2.0 * p.rest.still_distance).still == 0


def drives():
    """Return vehicles: a load alone; with leakage; with friction, and losses of either way."""
    smooth, em = paper(), load_vehicle("example-em")
    leaky = smooth.actuator.model_copy(update={"k_l": 1e-7})
    motor = em.actuator.motor.model_copy(update={"friction_torque": 3e-3})
    rough = em.actuator.model_copy(update={"motor": motor})
    return [
        smooth,
        smooth.model_copy(update={"actuator": leaky}),
        em.model_copy(update={"actuator": rough}),
    ]


@pytest.mark.parametrize("vehicle", drives(), ids=["smooth", "leaky", "rough"])
def test_the_rate_that_is_expected_is_that_of_the_papers_torques_at_even_speed(vehicle):
    """Eqs (11), (12): k_v omega = k_u u - k_z z -+ T_b, or nothing where friction holds it."""
    p, m = supervisor_parameters(vehicle, 0.3), Machine(vehicle)
    for depth in (0.0, 5.0, 40.0):
        for u in np.linspace(-12.0, 12.0, 97):
            s = changed(SUPERVISOR.initial(p, CALM, 0.0), command=float(u), depth=depth)
            drives = m.k_u * u - m.k_z * depth - m.T_b
            driven = m.k_u * u - m.k_z_back * depth + m.T_b
            torque = max(drives, 0.0) + min(driven, 0.0)
            due = m.k_q * torque / m.k_v - m.k_l * depth
            assert expected_rate(p, s) == pytest.approx(due, rel=1e-9, abs=1e-15)


def test_the_rate_of_a_positioner_is_what_is_left_within_its_speed():
    vehicle = load_vehicle("ntnu-bv")
    p = supervisor_parameters(vehicle, 0.5)
    speed = 2.44e-3 * vehicle.actuator.piston_area
    for volume, command in ((0.0, 1e-7), (0.0, -1e-7), (1e-6, 2e-5), (1e-6, -2e-5), (3e-6, 3e-6)):
        s = changed(SUPERVISOR.initial(p, CALM, 0.0), command=command, volume=volume)
        due = max(-speed, min(speed, (command - volume) / 0.5))
        assert expected_rate(p, s) == pytest.approx(due, rel=1e-9, abs=1e-18)


@pytest.mark.parametrize("name", TWO)
@pytest.mark.promise("no-false-alarm")
class TestHealthy:
    """What must never be a reason."""

    def test_steps_and_holding_in_noise(self, name):
        depths = [3.0, 1.0, 1.02, 4.0, 3.9, 2.0]
        flown = fly(name, setpoints=[(600.0 * n, z) for n, z in enumerate(depths)], duration=3600.0)
        assert flown.reason is None

    def test_large_steps(self, name):
        flown = fly(
            name,
            setpoints=[(0.0, 20.0), (900.0, 0.3), (1800.0, 30.0), (2700.0, 5.0)],
            duration=3600.0,
        )
        assert flown.reason is None

    def test_the_surface(self, name):
        flown = fly(name, setpoints=[(0.0, -1.0), (600.0, 3.0), (1200.0, -0.5)], duration=1800.0)
        assert flown.ran.depth.min() < 0.05
        assert flown.reason is None

    @pytest.mark.parametrize("sensors", [NOISY, CLEAN], ids=["noisy", "clean"])
    def test_the_bottom(self, name, sensors):
        """Where it may lie has to be said."""
        known = {"bottom_depth": "4.5 m"}
        flown = fly(
            name,
            setpoints=[(0.0, 6.0), (900.0, 2.0), (1800.0, 8.0)],
            duration=2700.0,
            bottom_depth=4.5,
            sensors=sensors,
            supervisor=known,
        )
        assert flown.ran.depth.max() == pytest.approx(4.5)
        assert flown.reason is None

    def test_ideal_sensors_and_quanta_alone(self, name):
        for sensors in (CLEAN, Sensors(depth_quantum="5 mm")):
            flown = fly(
                name, sensors=sensors, setpoints=[(0.0, 3.0), (600.0, 2.0)], duration=1500.0
            )
            assert flown.reason is None

    def test_a_neutral_volume_that_drifts_and_swell(self, name):
        """A tenth of the range in an hour, seen as the volume's zero; 10 cm of swell every 8 s.

        None for `planned`, which chases every wave: what it does then is not healthy. The drift of
        an hour is near what `position-observer` stands: of 12 seeds the first raises NOT_FOLLOWING
        in the last two seconds, the others nothing; all others of these laws raise nothing.
        """
        height = 0.0 if name == "planned" else 0.1
        seeds = range(2, 5) if name == "position-observer" else range(1, 2)
        range_ = supervisor_parameters(example(name)[0], example(name)[2]).neutral.neutral_range

        def sea(t, s):
            waves = height * math.sin(2.0 * math.pi * t / 8.0)
            return s._replace(volume=s.volume + 0.1 * range_ * t / 3600.0, depth=s.depth + waves)

        run = {"setpoints": [(0.0, 3.0)], "duration": 3600.0}
        flown = [fly(name, fault=sea, onset=0.0, seed=seed, **run) for seed in seeds]
        assert [one.reason for one in flown] == [None] * len(flown)

    @pytest.mark.promise("debounce")
    def test_short_failures(self, name):
        """Four seconds blind, a leak's splash, a motor's sag: nothing that a second look mends."""
        tick = example(name)[2]

        def bad(t, s):
            if t % 60.0 < 4.0:
                return s._replace(depth=math.nan, battery=8.0)
            if t % 60.0 < 4.0 + tick:
                return s._replace(leak=True, lost=3)
            return s

        flown = fly(name, fault=bad, onset=60.0, setpoints=[(0.0, 2.0)])
        assert flown.reason is None


class TestShown:
    """What the dive itself shows: its neutral volume, the sensor's noise, wires swapped."""

    @pytest.mark.promise("not-moving-as-modelled", faults=["small leak"])
    def test_a_leak_that_nothing_reports(self):
        """60 mL/min, seen as a volume that reads too large: 17.5 cm3 of change take 18 s."""
        change = supervisor_parameters(example("cascade")[0], 0.3).motion.neutral_change
        flown = fly(fault=lambda t, s: s._replace(volume=s.volume + 1e-6 * t))
        assert flown.reason is Reason.NOT_MOVING_AS_MODELLED
        assert change / 1e-6 < flown.after < change / 1e-6 + 50.0  # and psi, low passes, counting
        slower = fly(
            fault=lambda t, s: s._replace(volume=s.volume + 1e-6 * t),
            supervisor={"neutral_change": "70 cm3"},
        )
        assert slower.after > flown.after + 30.0

    @pytest.mark.parametrize(("sigma", "quantum", "seen"), [(1.0, 1.0, True), (0.4, 1.0, False)])
    def test_noise_that_shows_arms_the_watch_on_the_very_same_depth(self, sigma, quantum, seen):
        """Not where it only turns the depth on the edge between two quanta, at worst."""
        p = supervisor_parameters(example("cascade")[0].model_copy(update={"sensors": CLEAN}), 0.3)
        assert p.same.same == NEVER
        rng, s = np.random.default_rng(2), SUPERVISOR.initial(p, CALM, 0.0)
        for n in range(6000):
            step = 0.5 + rng.normal(0.0, sigma) if n < 5900 else 0.0
            depth = 2.0 + 0.002 * quantum * math.floor(step + 0.5)
            _, s, _ = SUPERVISOR.step(p, s, CALM._replace(depth=depth, volume=8.08e-6), 0.0)
        assert (Reason.DEPTH_FROZEN in reasons_in(s.recovery.reasons)) is seen

    @pytest.mark.promise("debounce", faults=["depth dropouts"])
    def test_a_depth_that_fails_a_third_of_the_time_is_none(self):
        rng = np.random.default_rng(4)
        flown = fly(
            fault=lambda _, s: s._replace(depth=math.nan if rng.random() < 0.35 else s.depth)
        )
        assert flown.reason is Reason.DEPTH_MISSING


FOR_EVER = 60.0  # m, a way to a stop that may as well be without an end


def stops_at(plant: Any, limits: Any, speed: float, lacks: float, room: float) -> float:
    """Return how far down a vehicle goes under full buoyancy, by SciPy; inf: beyond FOR_EVER."""

    def motion(t: float, x: Any) -> tuple[float, float]:
        pushed = min(limits.deep.turn_rate * t, room)
        lost = lacks + plant.psi * x[0] - pushed
        return x[1], plant.a_b * lost - drag_per_mass(x[1], plant)

    def stands(_: float, x: Any) -> float:
        return float(x[1])

    def gone(_: float, x: Any) -> float:
        return float(x[0]) - FOR_EVER

    stands.terminal, stands.direction = True, -1  # type: ignore[attr-defined]
    gone.terminal = True  # type: ignore[attr-defined]
    path = solve_ivp(motion, (0.0, 2e4), (0.0, speed), events=(stands, gone), rtol=1e-8, atol=1e-9)
    return float(path.y[0, -1]) if path.t_events[0].size else math.inf


class TestTurning:
    """How far down a vehicle still goes decides whether it is too deep."""

    @pytest.mark.parametrize(
        "name",
        [
            "feup-em",
            "ntnu-bv",
            pytest.param("example-em", marks=pytest.mark.prove),
            pytest.param("example-eh", marks=pytest.mark.prove),
        ],
    )
    @pytest.mark.promise("depth-limit")
    def test_the_way_to_a_stop_is_that_of_the_motion(self, name):
        vehicle = load_vehicle(name)
        p, rng = (
            supervisor_parameters(vehicle, vehicle.controller.sample_time),
            np.random.default_rng(1),
        )
        q = plant(vehicle)
        for _ in range(60):
            depth, V = rng.uniform(0.0, p.deep.depth_limit), rng.uniform(q.V_min, 0.5 * q.V_max)
            lacks, room = q.V_0 + q.psi * depth - V, q.V_max - V
            speed = rng.uniform(0.01, max(terminal_speed(q, q.a_b * max(lacks, 0.0)), 0.05))
            right, found = stops_at(q, p, speed, lacks, room), way_to_stop(p, speed, lacks, room)
            if 1.0 < right < FOR_EVER and found < 1e5:
                assert 0.85 < found / right < 1.25
            elif right >= FOR_EVER:
                assert found > 45.0

    def test_a_light_vehicle_that_hardly_sinks_stops_at_once(self):
        """Also where its volume and the root in the time to a stop are as good as equal."""
        p = supervisor_parameters(paper(), 0.3)
        for speed in (1e-4, 1e-12, 1e-18):
            way = way_to_stop(p, speed, -1e-3, 1.0)
            assert way == pytest.approx(speed**2 / (2.0 * p.deep.force * 1e-3), rel=0.05)

    @pytest.mark.parametrize("share", [0.3, 0.6, 0.8, 0.9])
    def test_a_hull_that_softens_goes_further(self, share):
        """Without drag, and no volume left: z'' = -a_b (n - psi s).

        From a share of the speed at which it never stops, n sqrt(a_b/psi), it stops
        n/psi (1 - sqrt(1 - share^2)) deeper.
        """
        p, light = supervisor_parameters(paper(), 0.3), 5e-5  # m3
        p = p._replace(
            motion=p.motion._replace(drag_linear=0.0, epsilon=math.inf),
            deep=p.deep._replace(turn_rate=1e-12, per_turn_rate=1e12),
        )
        speed = share * light * math.sqrt(p.deep.force / p.neutral.psi)
        right = light / p.neutral.psi * (1.0 - math.sqrt(1.0 - share * share))
        assert way_to_stop(p, speed, -light, 0.0) == pytest.approx(right, rel=0.015)

    def test_no_room_and_too_heavy_is_for_ever(self):
        p = supervisor_parameters(paper(), 0.3)
        assert way_to_stop(p, 0.1, 1e-4, 0.0) > 1e5


def test_a_hull_that_comes_out_of_the_water_heavy_is_not_what_the_model_knows():
    """It rises, is made heavy too late, and falls back: eqs (13) and (16), and w turned round."""
    vehicle = paper(sensors=CLEAN)
    p, m = supervisor_parameters(vehicle, 0.3), plant(vehicle)
    p = changed(p, same_tried=NEVER, following=NEVER)
    s, seen, z, w = SUPERVISOR.initial(p, CALM, 0.0), CALM, 4.0, 0.0
    speeds = []
    for k in range(350):
        extra = 0.0 if k < 240 else 1e-4 if z > 0.6 and not speeds else -1.4e-4
        if extra < 0.0:
            speeds.append(w)
        for _ in range(30):
            w -= 0.01 * (m.a_b * extra + w / 36.3)
            z += 0.01 * w
            w = -0.8 * w if z < 0.0 and w < 0.0 else w
        seen = CALM._replace(depth=z, volume=m.psi * z + extra)
        _, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
        assert not s.recovery.reasons, (k, reasons_in(s.recovery.reasons))
    assert min(speeds) < -0.2
    assert z > 1.5


@pytest.mark.promise("test-pushes")
class TestReach:
    """A push outward now and then, where nothing else shows whether the actuator can."""

    limits = supervisor_parameters(example("cascade")[0], 0.3)

    def after(self, p: Any, rows: list[tuple[float, ...]], **state: Any) -> list[float]:
        """Return the commands over rows of (depth, volume, depth asked for), the law's being 0 V.

        What it has shown reaches anywhere, but where `state` says otherwise.
        """
        state = {"known": int(p.motion.known), "shown": 1.0, "shown_for": 99.0} | state
        s = changed(SUPERVISOR.initial(p, CALM, 0.0), **state)
        commands = []
        for depth, volume, *asked in rows:
            seen = CALM._replace(depth=depth, volume=volume, reference=(asked or [math.nan])[0])
            command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            assert not s.recovery.reasons
            commands.append(command)
        self.state, self.allowed = s, s.proof.allowed
        return commands

    def test_without_a_depth_asked_for_it_is_shown_before_the_vehicle_sinks(self):
        p = self.limits
        neutral = p.neutral.psi * 2.0
        late = {"unproven": int(p.proof.unproven)}
        level = [(2.0, neutral - 0.9 * p.proof.sinks)]
        heavy = [(2.0, neutral - 1.1 * p.proof.sinks)]
        reach = p.proof.reach + p.proof.ahead
        pushed = [(2.0, neutral), (2.0, neutral + 0.5 * reach), (2.0, neutral + 1.1 * reach)]
        full = p.push.surface_command
        assert self.after(p, level * 3, **late) == [0.0] * 3
        assert self.after(p, heavy * 3) == [0.0] * 3  # it has shown it of late
        # until it has, and then the law's again, however heavy
        shown = self.after(p, heavy + pushed + heavy * 3, **late)
        assert shown == [full] * 3 + [0.0] * 4
        # and not for as long as it counts
        again = self.after(p, heavy * (int(p.proof.unproven) + 3), unproven=0)
        assert again.index(full) == p.proof.unproven

    def test_it_is_shown_before_the_law_is_asked_for_anything_deeper(self):
        """Under a law that rests, which shows nothing while it holds."""
        p, full = self.limits, self.limits.push.surface_command
        p = p._replace(proof=p.proof._replace(early=NEVER))
        neutral, late = p.neutral.psi * 2.0, {"unproven": int(self.limits.proof.holding)}
        held = [(2.0, neutral, 2.0)]
        deeper = [(2.0, neutral, 3.5)]
        way = p.neutral.psi * 1.5
        needed = enough(p, 1.5)
        assert needed == pytest.approx(
            way + p.proof.sinks + 1.5 * p.proof.per_jump * (p.proof.reach - p.proof.sinks)
        )
        needed = needed + p.push.grown  # and so much more, so that it is sure
        almost = [(2.0, neutral + 0.99 * needed, 3.5)]
        there = [(2.0, neutral + 1.01 * needed, 3.5)]
        last = outward(p, 2.0, 0.0, 0.01 * needed)
        pushed = self.after(p, held + deeper * 2 + almost, **late)
        assert pushed == pytest.approx([0.0, full, full, last])
        assert self.allowed == 2.0
        pushed = self.after(p, held + deeper + almost + there, **late)
        assert pushed == pytest.approx([0.0, full, last, 0.0])
        assert self.allowed == 3.5
        assert self.after(p, held + deeper * 5) == [0.0] * 6  # it has shown it of late
        assert self.allowed == pytest.approx(3.5 + p.rest.still_distance)
        higher = [(2.0, neutral, 1.0)]  # what was asked for since is what counts
        assert self.after(p, higher + held, **late) == [0.0, full]
        assert self.allowed == 1.0

    def test_a_law_that_rests_makes_the_vehicle_heavy_after_it_has_shown_the_way_back(self):
        """Where it holds the depth asked for, at a standstill, and the actuator is as asked."""
        p, full = self.limits, self.limits.push.surface_command
        rests = p._replace(proof=p.proof._replace(early=NEVER, holding=p.proof.unproven))
        neutral, late = p.neutral.psi * 2.0, {"unproven": int(p.proof.unproven)}
        light, heavy = ((2.0, neutral - n * p.proof.sinks, 2.0) for n in (0.9, 1.1))
        there = (2.0, neutral + 1.01 * (enough(p, p.proof.ready) + p.push.grown), 2.0)
        assert self.after(rests, [light] * 3, **late) == [0.0] * 3
        assert self.after(rests, [heavy] * 3, **late) == [full] * 3
        begun = [heavy, (2.0, neutral, 2.0), there, heavy]  # it goes on until it has shown it
        assert self.after(rests, begun, **late) == [full, full, 0.0, 0.0]
        # of late, but hardly beyond the neutral volume, is as good as not: beyond it by `sinks` and
        # by what stops a vehicle that is as heavy for 7 s, 1.1 sinks sqrt(psi a_b) 7 s
        for n, command in ((1.22, full), (1.24, 0.0)):
            shown = {"shown": neutral + n * p.proof.sinks, "unproven": 0}
            assert self.after(rests, [heavy], **shown) == [command]
        under_way = late | {"z1": 1.9, "z2": 1.8, "settled": 5, "since": 0, "depth": 2.0}
        assert self.after(rests, [heavy], **under_way) == [0.0]
        assert self.after(p, [heavy], unproven=int(p.proof.early) - 1) == [0.0]  # one that holds
        # before the volume is there: a tick at -12 V takes 0.444 mm/s 75 cm2 12 V 0.3 s, 12 cm3
        begun = {"known": int(p.motion.known), "shown": 1.0, "shown_for": 99.0} | late
        s = changed(SUPERVISOR.initial(rests, CALM, 0.0), **begun)
        for wanted, command in ((-12.0, full), (-1.0, -1.0)):
            seen = CALM._replace(depth=2.0, volume=neutral, reference=2.0)
            assert SUPERVISOR.step(rests, s, seen, wanted)[0] == command

    def held(self, p: Any, *, z1: float = 2.0, **state: Any) -> float:
        """Return the command under a law that holds 2 m, which has shown all it has to."""
        at = {"z1": z1, "z2": 2.0, "settled": 5, "since": 0, "depth": 2.0} | state
        volume = at.pop("volume", p.neutral.psi * 2.0)
        (command,) = self.after(p, [(at["depth"], volume, 2.0)], shown=1.0, **at)
        return command

    def test_a_law_that_holds_a_depth_shows_it_there_before_anything_deeper_is_asked(self):
        p, full = self.limits, self.limits.push.surface_command
        assert p.proof.unproven < p.proof.early < p.proof.holding < NEVER
        early = {"unproven": int(p.proof.early)}
        assert self.held(p, unproven=p.proof.early - 1) == 0.0
        assert self.held(p, **early) == full
        twice = [(2.0, p.neutral.psi * 2.0, 2.0)] * 2
        assert self.after(p, twice, **early) == [full] * 2
        assert self.allowed == 2.0
        # neither under way, nor away from the depth asked for or the neutral volume
        still, off = p.rest.still_distance, p.proof.sinks
        assert self.held(p, **early, z1=2.0 + 1.1 * still) == 0.0
        assert self.held(p, **early, depth=2.0 + 1.1 * still) == 0.0
        neutral = p.neutral.psi * 2.0
        assert self.held(p, **early, volume=neutral - 1.1 * off) == 0.0
        assert self.held(p, **early, volume=neutral - 0.9 * off) == full
        # a law that rests is left to rest
        resting = p._replace(proof=p.proof._replace(early=NEVER, holding=p.proof.unproven))
        assert self.held(resting, **early) == 0.0

    def test_what_it_showed_while_it_held_lets_a_step_begin_at_once(self):
        p = self.limits
        p = p._replace(proof=p.proof._replace(early=NEVER))
        holding = {"unproven": int(p.proof.holding) - 1, "allowed": 2.0, "shown_for": 2.0}
        neutral = p.neutral.psi * 2.0
        enough_for = neutral + enough(p, p.proof.ready)
        rows = [(2.0, neutral, 2.0), (2.0, neutral, 2.0 + p.proof.ready)]
        assert self.after(p, rows[:1], **holding | {"shown": enough_for + 1e-8}) == [0.0]
        assert self.allowed > 2.0 + p.proof.ready
        assert self.after(p, rows, **holding | {"shown": enough_for + 1e-8}) == [0.0] * 2
        assert self.after(p, rows[:1], **holding | {"shown": enough_for - 1e-8}) == [0.0]
        assert self.allowed == 2.0
        # nor while it moves, nor once it is too long ago
        begun = holding | {"shown": 1.0}
        assert self.after(p, rows[:1], **begun | {"unproven": p.proof.holding}) == [0.0]
        assert self.allowed == 2.0
        self.held(p, **{k: v for k, v in holding.items() if k != "shown"}, z1=1.9)
        assert self.allowed == 2.0

    @pytest.mark.parametrize("friction", [0.0, 0.5])
    def test_a_push_ends_where_it_has_to(self, friction):
        """A tick of its command moves the volume by what it lacks, and a quarter or so more."""
        vehicle, rate = paper(), 0.444e-3 * 75e-4
        p = supervisor_parameters(vehicle, 0.3)
        p = p._replace(rate=p.rate._replace(friction=friction))
        seen = CALM._replace(depth=30.0)
        quarter = rate * 3.0 * 0.3
        for lacks in (0.01 * quarter, 0.3 * quarter, 0.9 * quarter, 1.5 * quarter):
            command = outward(p, seen.depth, 0.0, lacks)
            moved = rate * (command - vehicle.actuator.depth_voltage * 30.0 - friction) * 0.3
            assert lacks < moved - p.proof.least_way < lacks + quarter
        assert outward(p, seen.depth, 0.0, 4.0 * quarter) == p.push.surface_command
        positioner = supervisor_parameters(load_vehicle("ntnu-bv"), 0.5)
        ends = positioner.push.away_command, positioner.push.surface_command
        for volume, lacks in ((1e-6, 1e-8), (2e-6, -1e-6), (-1e-4, 1e-8), (1e-4, 1e-8)):
            goal = volume + lacks + positioner.proof.least_way
            assert outward(positioner, 3.0, volume, lacks) == np.clip(goal, *ends)

    @pytest.mark.parametrize("name", [name for name, law in LAWS.items() if law.recipe])
    def test_a_block_next_to_where_a_push_ends_counts_as_a_stop(self, name):
        vehicle, _, tick = example(name)
        for sensors in (NOISY, NOISY.model_copy(update={"volume_noise": 2e-6})):
            p = supervisor_parameters(vehicle.model_copy(update={"sensors": sensors}), tick)
            if p.proof.same_tried < NEVER and p.rate.stop_rate < math.inf:
                assert p.proof.least_way * p.per_tick > p.rate.stop_rate

    def test_a_jump_takes_what_a_way_of_bounded_rate_needs(self):
        """The volume that a block at the middle of the way leaves has to stop it there."""
        p, of = self.limits, plant(paper())
        rate, a_b, jump = of.gain * of.supply, of.a_b, 1.0 / p.proof.per_jump
        time = (32.0 * jump / (a_b * rate)) ** (1.0 / 3.0)

        n, pieces = 40_000, np.array([-1.0, 1.0, 1.0, -1.0])
        h = time / n
        volume = np.cumsum(np.repeat(pieces, n // 4)) * rate * h
        speed = np.cumsum(-a_b * volume) * h
        assert (speed[-1], volume[-1]) == pytest.approx((0.0, 0.0), abs=1e-4)
        assert np.sum(speed) * h == pytest.approx(jump, rel=1e-3)
        fastest = speed.max()
        assert fastest == pytest.approx(2.0 * jump / time, rel=1e-3)
        share = p.proof.reach / (p.proof.per_speed * fastest)
        assert share == pytest.approx(0.585, rel=2e-3)

    @pytest.mark.parametrize(("to", "share"), [(2.1, 0.1), (2.5, 0.5), (3.0, 1.0), (5.0, 3.0)])
    def test_a_jump_takes_what_stops_the_vehicle_at_its_end(self, to, share):
        """All of the reach from some metres on, since a long way is fast; of a short one a share.

        From the depth on that it has, where the law may be asked for more than it is.
        """
        p, full = self.limits, self.limits.push.surface_command
        p = p._replace(proof=p.proof._replace(early=NEVER))
        share = min(share * p.proof.per_jump, 1.0)
        spare = p.proof.sinks + share * (p.proof.reach - p.proof.sinks)
        rows = [(2.0, p.neutral.psi * 2.0, asked) for asked in (2.0, to, to)]
        for more, commands in ((1e-8, [0.0] * 3), (-1e-8, [0.0, full, full])):
            for ahead in (2.0, to - 1e-3):
                shown = {"shown": p.neutral.psi * to + spare + more, "shown_for": ahead}
                assert self.after(p, rows, **shown, allowed=ahead) == commands

    def test_what_it_showed_counts_as_deep_as_it_reached_above_the_neutral_volume(self):
        p, full = self.limits, self.limits.push.surface_command
        shown = {"shown": p.neutral.psi * 5.0 + p.proof.sinks, "shown_for": 4.0}
        above, below = (4.99, 4.99 * p.neutral.psi), (5.01, 5.01 * p.neutral.psi)
        assert self.after(p, [(*above, 6.0)] * 3, **shown) == [0.0] * 3
        assert self.after(p, [(*below, 6.0)] * 3, **shown) == [full] * 3
        assert self.after(p, [(*below, 4.0)] * 3, **shown) == [0.0] * 3  # that was asked for then

    def test_a_vehicle_that_sinks_is_stopped_by_what_was_shown(self):
        """The volume per speed is that of z'' = -a_b (n - psi z), integrated on both sides."""
        p, full = self.limits, self.limits.push.surface_command
        a_b = 1.0 / (p.motion.inertia / p.motion.per_tau**2)
        assert p.proof.lead == pytest.approx(a_b / p.motion.per_tau)
        for share, stops in ((0.99, False), (1.01, True)):
            n = share * p.proof.per_speed * 0.2

            def motion(_: float, x: Any, n: float = n) -> tuple[float, float]:
                return x[1], -a_b * (n - p.neutral.psi * x[0])

            path = solve_ivp(motion, (0.0, 200.0), (0.0, 0.2), rtol=1e-10, atol=1e-12)
            assert bool(path.y[0, -1] < 0.0) is stops
        shown = {"shown": p.neutral.psi * 2.0 + p.proof.sinks + 0.1 * p.proof.per_speed}
        rows = [(2.0, p.neutral.psi * 2.0, 6.0)]
        for speed, command in ((0.099, 0.0), (0.101, full)):
            z1 = 2.0 - speed / p.motion.per_tau / (1.0 - p.motion.smoothing)
            moving = {"z1": z1, "z2": z1, "settled": 5, "since": 0, "depth": 2.0, "shown_for": 2.0}
            assert self.after(p, rows, **shown, **moving) == [command]

    def test_afloat_and_before_anything_is_known_the_way_is_free_and_counts(self):
        p = self.limits
        late = {"unproven": int(p.proof.unproven), "allowed": 0.2, "shown": 0.0}
        assert self.after(p, [(0.2, 2e-5, 3.0)] * 3, **late) == [0.0] * 3
        assert self.allowed > 1e5
        assert (self.state.proof.shown, self.state.proof.shown_for) == (2e-5, 3.0)
        assert self.after(p, [(0.2, 2e-5, 3.0), (0.2, -1e-5, 4.0)], **late) == [0.0] * 2
        assert self.allowed > 1e5
        assert (self.state.proof.shown, self.state.proof.shown_for) == (2e-5, 3.0)
        unknown = self.after(p, [(2.0, 2e-5, 3.0)] * 3, **late, known=0)
        assert unknown == [0.0] * 3
        assert self.allowed > 1e5

    def test_what_the_dive_has_shown_of_its_neutral_volume_counts(self):
        p, late = self.limits, {"unproven": int(self.limits.proof.unproven)}
        rows = [(2.0, p.neutral.psi * 2.0)]
        assert self.after(p, rows, own=0.9 * p.proof.sinks, **late) == [0.0]
        assert self.after(p, rows, own=1.1 * p.proof.sinks, **late) == [p.push.surface_command]

    def test_an_actuator_at_its_end_has_shown_what_it_can(self):
        p = self.limits
        rows = [(2.0, 0.99 * p.volume.volume_high), (2.0, 1.01 * p.volume.volume_high)]
        assert self.after(p, rows, own=2.0 * p.volume.volume_high, unproven=NEVER) == [
            p.push.surface_command,
            0.0,
        ]

    def test_a_depth_that_is_the_very_same_is_moved(self):
        p, n = self.limits, int(self.limits.proof.same_tried)
        still = [(2.0, p.neutral.psi * 2.0)]
        commands = self.after(p, still * (n + 5))
        # the first tick has nothing before it that it could be the same as
        assert commands.index(p.push.surface_command) == n
        assert commands[n:] == [p.push.surface_command] * 5
        there = [(1.99, p.neutral.psi * 2.0 + 1.1 * (p.proof.reach + p.proof.ahead))]
        moved = self.after(p, still * (n + 2) + there + still)
        assert moved[-4:] == [p.push.surface_command] * 2 + [0.0] * 2

    def test_a_coarse_quantum_is_given_its_time(self):
        """A volume that is just known to have changed takes twice as long to be seen."""
        vehicle = example("cascade")[0].model_copy(
            update={"sensors": Sensors(depth_quantum="0.2 m")}
        )
        p = supervisor_parameters(vehicle, 0.3)
        force = 1.0 / (p.motion.inertia / p.motion.per_tau**2)  # m/s2 per m3, a_b
        seen = math.sqrt(2.0 * 0.4 / (force * p.push.grown))
        assert p.proof.same_tried == math.ceil(2.0 * seen / 0.3)
        assert p.proof.unproven == 100

    @pytest.mark.parametrize(
        ("psi", "given", "ticks"),
        [
            (-0.4, {}, (NEVER, NEVER)),
            (-0.4, {"depth_limit": "42 m"}, (100, 100)),
            (-0.4, {"depth_limit": "45 m"}, (NEVER, NEVER)),
            (-0.4, {"depth_limit": "45 m", "neutral_change": "20 cm3"}, (100, 100)),
            (0.0, {}, (100, 100)),
            (-1.0, {"prove_after": "1 min"}, (200, 200)),
            (4.04, {"prove_after": "1 min"}, (200, 200)),
            (4.04, {}, (100, 100)),
        ],
    )
    def test_a_hull_that_comes_to_rest_by_itself_is_left_alone(self, psi, given, ticks):
        """Heavier by the 17.5 cm3 that are not seen it rests 17.5/0.4 = 43.75 m deeper."""
        hull = paper().hull.model_copy(update={"psi": psi * 1e-6})
        p = supervisor_parameters(paper(hull=hull, supervisor=Supervisor(**given)), 0.3)
        assert (p.proof.unproven, p.proof.same_tried) == ticks

    @pytest.mark.promise("depth-frozen", faults=["depth stuck"])
    @pytest.mark.parametrize("asked", [5.0005, 5.002])
    @pytest.mark.parametrize("psi", [0.0, -1e-8])
    def test_a_stiff_hull_with_a_stuck_depth_does_not_sink(self, psi, asked):
        """Half a quantum too shallow it sank by 2.1 to 9.4 m before the model saw the volume."""
        vehicle = load_vehicle("ntnu-bv").replace({"hull.psi": psi, "hull.depth_limit": "50 m"})
        flown = fly(
            "position-pid",
            vehicle=vehicle,
            fault=frozen("depth"),
            sensors=Sensors(depth_noise="1 mm", depth_quantum="5 mm"),
            setpoints=[(0.0, 3.0), (150.0, asked)],
            duration=1800.0,
        )
        fault = flown.ran.time > 300.0
        assert flown.ran.depth[fault].max() < asked + 0.1
        assert flown.ran.depth[-1] < 0.1
        assert flown.reason is Reason.DEPTH_FROZEN
        assert flown.after < 60.0

    @pytest.mark.promise("depth-frozen", faults=["depth stuck"])
    @pytest.mark.parametrize("psi", [0.0, 6.76e-8])
    def test_a_coarse_depth_that_stands_is_pushed_until_it_changes_or_is_frozen(self, psi):
        """A healthy vehicle is left alone where a quantum of 2 cm hides its motion for minutes."""
        vehicle = load_vehicle("ntnu-bv").replace({"hull.psi": psi, "hull.depth_limit": "50 m"})
        coarse = Sensors(depth_noise="1 mm", depth_quantum="2 cm")
        run = dict(vehicle=vehicle, sensors=coarse, duration=1800.0)
        healthy = fly("position-pid", **run)
        assert healthy.reason is None
        assert np.abs(healthy.ran.depth[healthy.ran.time > 400.0] - 5.0).max() < 0.25
        flown = fly("position-pid", fault=frozen("depth"), **run)
        assert flown.reason is Reason.DEPTH_FROZEN
        assert flown.after < 150.0

    def test_a_depth_that_stands_counts_from_the_tick_on_that_makes_it_long_enough(self):
        """It is not neutral there: the neutral volume is not what is assumed."""
        p, depth = self.limits, 2.0
        off = 4.0 * p.neutral.neutral_range + 4.0 * p.neutral.psi_range * depth
        s = changed(
            SUPERVISOR.initial(p, CALM, 0.0),
            anchor=depth,
            still=p.rest.still - 2,
            known=0,
            z1=depth,
            z2=depth,
            n1=off,
            n2=off,
            settled=0,
        )
        seen = CALM._replace(depth=depth, volume=off + p.neutral.psi * depth + p.neutral.neutral)
        wrong = []
        for _ in range(3):
            _, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            wrong.append(s.motion.wrong > 0)
        assert wrong == [False, True, True]

    @pytest.mark.parametrize("n", [0, 1, 2, 3, 16, 17, 1000, 4095, 65534, NEVER])
    def test_times(self, n):
        assert times(n, 0.375) == n * 0.375


class TestSafeAction:
    limits = supervisor_parameters(example("cascade")[0], 0.3)

    def after(self, ticks: int, seen: Watched = WET, **state: Any) -> Any:
        s = changed(SUPERVISOR.initial(self.limits, seen, 1.0), **state)
        commands = []
        for _ in range(ticks):
            command, s, _ = SUPERVISOR.step(self.limits, s, seen, -12.0)
            commands.append(command)
        return commands, s

    @pytest.mark.promise("full-buoyancy", faults=["port throttled outward"])
    @pytest.mark.parametrize("up", [False, True])
    def test_it_pushes_rests_and_pushes_again_whatever_the_sensors_say(self, up):
        """Nothing tells a port that hardly lets through from one that is shut: it goes on for long.

        At the surface there is time, and a motor that stands is to be spared.
        """
        p = self.limits
        rest, again = int(p.push.rest), int(p.push.again)
        assert p.push.stall * 0.3 >= 300.0
        once = again if up else again * math.ceil(p.push.stall / again)
        first = int(p.push.push) if up else once
        turn = [p.push.hold_command] * rest + [p.push.surface_command] * once
        expected = [p.push.surface_command] * first + turn * 40
        lying = CALM._replace(depth=math.nan, volume=math.nan)
        for seen in [WET._replace(depth=0.0)] if up else [lying, WET]:
            assert self.after(3000, seen)[0] == expected[:3000]

    def driven(
        self,
        drive: Any,
        volume: float,
        seconds: float = 60.0,
        *,
        sinks: float = 0.0,
        depth: float = 2.0,
        least: float = -3.5e-4,
        lost: Any = lambda _: False,
        stuck_from: float = math.inf,
    ) -> list[tuple[float, float]]:
        """Return (command, volume) of a leaking vehicle; drive: (time, command) -> m3/s.

        sinks [m/s], from a depth [m]; least [m3]: where it ends inwards; lost: whether the volume
        is not seen at t; stuck_from [s]: it reads the same from then on.
        """
        p, n = self.limits, round(seconds / 0.3)
        s = SUPERVISOR.initial(p, WET, 1.0)
        rows = []
        read = volume
        for k in range(n):
            read = volume if 0.3 * k < stuck_from else read
            seen = WET._replace(
                volume=math.nan if lost(0.3 * k) else read, depth=depth + sinks * 0.3 * k
            )
            command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            rows.append((command, volume))
            volume = min(max(volume + 0.3 * drive(0.3 * k, command), least), 3.5e-4)
        return rows

    @pytest.mark.promise("swapped-wires", faults=["actuator reversed"])
    def test_wires_that_are_swapped_are_found_and_the_vehicle_lightened(self):
        p = self.limits
        rows = self.driven(lambda _, u: -p.rate.rate * u, 0.0)
        assert rows[0][0] == p.push.surface_command
        assert min(volume for _, volume in rows) > -5e-5
        assert rows[-1][0] == p.push.away_hold == 0.0
        assert rows[-1][1] == pytest.approx(3.5e-4)
        at_the_end = self.driven(lambda _, u: -p.rate.rate * u, -3.5e-4)
        assert at_the_end[-1][1] >= p.volume.volume_high

    @pytest.mark.promise("swapped-wires", faults=["actuator reversed"])
    def test_a_turned_push_at_its_end_is_not_driven_back_by_wires_that_are_mended_unseen(self):
        """The volume is stuck there: a push the wrong way would end at the inner end, unseen."""
        p = self.limits

        def mended(t, u):
            return (-1.0 if t < 40.0 else 1.0) * p.rate.rate * u

        rows = self.driven(mended, 0.0, 300.0, lost=lambda t: t > 30.0)
        assert rows[-1] == (p.push.away_hold, rows[120][1])
        assert rows[-1][1] >= p.volume.volume_high
        stuck = self.driven(mended, 0.0, 300.0, stuck_from=30.0)
        assert stuck[-1] == (p.push.away_hold, stuck[120][1])

    @pytest.mark.promise("swapped-wires", faults=["volume NaN"])
    def test_a_turned_push_of_which_nothing_is_seen_is_given_up_where_the_vehicle_sinks(self):
        """The wires are mended before the end, and then the volume is lost."""
        p = self.limits
        again = 0.3 * int(p.push.again)
        rows = self.driven(
            lambda t, u: (-1.0 if t < 6.0 else 1.0) * p.rate.rate * u,
            0.0,
            200.0,
            sinks=0.02,
            lost=lambda t: t > 5.0,
        )
        turned = [k for k, (command, _) in enumerate(rows) if command == p.push.away_command]
        assert 0.3 * len(turned) == pytest.approx(again + 5.0, abs=2.0)
        assert rows[-1] == (p.push.surface_command, pytest.approx(3.5e-4))

    def test_a_tick_that_is_lost_ends_a_try_but_not_a_turned_push_that_gained(self):
        p = self.limits
        s = SUPERVISOR.initial(p, WET, 1.0)
        volume, commands = 0.0, []
        for k in range(40):
            lost = 1 if k in {4, 5, 12} else 0
            command, s, _ = SUPERVISOR.step(p, s, WET._replace(volume=volume, lost=lost), 0.0)
            commands.append(command)
            volume -= 0.3 * p.rate.rate * command
        assert commands[3] == p.push.away_command  # a try
        assert p.push.away_command in commands[12:14]

    @pytest.mark.promise("swapped-wires", faults=["dying cell"])
    def test_a_volume_that_stays_behind_over_a_reset_turns_the_push(self):
        """A dying cell resets the board at the first tick of each push; the wires are swapped."""
        p, volume, s = self.limits, 1e-4, None
        for _ in range(60):
            before, s = s, SUPERVISOR.initial(p, WET, 1.0)
            if before is not None:
                seen = before.volume.volume
                s = changed(s, turns=before.push.turns, pushed=seen, volume=seen)
            command, s, _ = SUPERVISOR.step(p, s, WET._replace(volume=volume), 0.0)
            volume = min(volume - 0.3 * p.rate.rate * command, 3.5e-4)
        assert volume >= p.volume.volume_high
        assert s.push.turns == 7

    @pytest.mark.promise("swapped-wires", faults=["actuator reversed"])
    def test_wires_that_are_mended_are_found_too(self):
        p = self.limits
        rows = self.driven(lambda t, u: (-1.0 if t < 6.0 else 1.0) * p.rate.rate * u, 0.0)
        assert rows[-1] == (p.push.surface_command, pytest.approx(3.5e-4))

    @pytest.mark.promise("swapped-wires", faults=["actuator slow"])
    def test_swapped_wires_of_a_slow_actuator_are_found(self):
        """0.5 % of its speed: it is too slow to be told from one that stands, but it goes away."""
        p = self.limits
        rows = self.driven(lambda _, u: -0.005 * p.rate.rate * u, 0.0, 120.0)
        assert min(volume for _, volume in rows) > -1.0e-5
        assert rows[-1][1] > 0.0

    def test_a_turned_push_stays_where_the_volume_goes_missing_once_it_grew(self):
        p = self.limits
        rows = self.driven(lambda _, u: -p.rate.rate * u, 0.0, lost=lambda t: t > 3.0)
        assert rows[-1] == (p.push.away_command, pytest.approx(3.5e-4))  # it does not see its end
        never = self.driven(lambda _, u: -p.rate.rate * u, 0.0, lost=lambda t: t > 0.5)
        assert never[-1][0] == p.push.surface_command

    def test_a_volume_that_stands_short_of_its_inner_end_is_pushed_on_the_way_it_was(self):
        """The reading may be stuck: a try would cost a vehicle that is coming round its depth."""
        for sinks in (0.0, 0.02):
            rows = self.driven(lambda *_: 0.0, 0.0, 300.0, sinks=sinks)
            assert min(command for command, _ in rows) >= 0.0

    def test_a_rest_ends_where_the_sea_drives_the_piston_in(self):
        """The motor's load is three times what it was: the voltage that should hold does not."""
        p, end = self.limits, 0.3 * int(self.limits.push.push)
        rows = self.driven(
            lambda t, u: 1e-5 if u > p.push.hold_command else (-1e-5 if t > end else 0.0),
            2e-4,
            end + 60.0,
        )
        resting = [volume for command, volume in rows if command == p.push.hold_command]
        assert resting
        assert min(resting) > 3.5e-4 - p.push.away - 2.0 * 0.3e-5
        assert rows[-1][1] > 3.5e-4 - 2.0 * p.push.away

    @pytest.mark.promise("full-buoyancy")
    def test_there_is_no_rest_while_the_vehicle_sinks(self):
        p = self.limits
        rows = self.driven(lambda *_: 0.0, 0.0, 600.0, sinks=0.01)
        last = [command for command, _ in rows[-1000:]]
        assert set(last) == {p.push.surface_command}

    @pytest.mark.promise("swapped-wires", faults=["blocked inward", "actuator reversed"])
    @pytest.mark.parametrize("swapped", [True, False])
    def test_a_push_that_stands_while_the_vehicle_sinks_is_tried_the_other_way_once(self, swapped):
        """Blocked inward beside swapped wires, or outward: one noisy reading tells it from stuck.

        c z at 6 m is 0.5 V: a quarter of 12 V moves the piston, for the 2 s of a try.
        """
        p = self.limits
        s, extra, commands = SUPERVISOR.initial(p, WET, 1.0), 0.0, []
        for k in range(400):
            seen = WET._replace(volume=6e-5 + extra + 1e-8 * (-1) ** k, depth=5.0 + 4e-3 * k)
            command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            commands.append(command)
            way = -command if swapped else command
            extra = min(max(extra + 0.3 * p.rate.rate * way, 0.0 if swapped else -1.0), 2.9e-4)
            extra = extra if swapped else min(extra, 0.0)
        tried = [k for k, command in enumerate(commands) if command < 0.0]
        assert tried[0] == pytest.approx(int(p.push.push), abs=2)
        assert commands[tried[0]] == -3.0
        if swapped:
            assert extra == 2.9e-4
            assert commands[-1] in (p.push.away_command, p.push.away_hold)
        else:
            assert len(tried) <= p.push.astray
            assert commands[-1] == p.push.surface_command

    @pytest.mark.promise("full-buoyancy", faults=["port throttled outward", "volume drift"])
    @pytest.mark.parametrize("volume", [math.nan, 5e-4])
    def test_a_volume_that_nobody_measures_any_more_is_not_taken_for_all_out(self, volume):
        """The last that was good is: rests would lose what comes through the port, as at an end."""
        p, rests = self.limits, {}
        for now in (volume, 3.4e-4):
            s = SUPERVISOR.initial(p, WET, 1.0)
            held = 0
            for k in range(1000):
                seen = WET._replace(depth=30.0, volume=3.4e-4 if k < 10 else now)
                command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
                held += command == p.push.hold_command
            rests[now] = held
        assert rests[volume] == 0  # for 300 s of it
        assert rests[3.4e-4] >= 5 * p.push.rest

    @pytest.mark.promise("swapped-wires", faults=["pauses", "actuator reversed"])
    def test_a_turned_push_that_ends_at_the_inner_end_is_turned_back_on_the_bottom_too(self):
        """The wires were mended while the board paused; the vehicle does not sink any more."""
        p = self.limits
        s, commands, volume = SUPERVISOR.initial(p, WET, 1.0), [], 0.0
        for k in range(200):
            mended = k >= 20
            lost = 65 if k == 20 else 0
            volume = -3.5e-4 if k == 20 else volume
            seen = WET._replace(depth=60.0, volume=volume, lost=lost)
            command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            commands.append(command)
            volume += 0.3 * p.rate.rate * (1.0 if mended else -1.0) * command
            volume = min(max(volume, -3.5e-4), 3.5e-4)
        assert commands[19] == p.push.away_command
        assert set(commands[25:200]) == {p.push.surface_command}
        assert volume >= p.volume.volume_high

    @pytest.mark.promise("swapped-wires")
    def test_a_volume_that_lies_costs_one_try(self):
        """It reads inwards whatever is commanded: the push is turned round once, and back."""
        p = self.limits
        s, volume, commands = SUPERVISOR.initial(p, WET, 1.0), 3e-4, []
        for _ in range(150):
            command, s, _ = SUPERVISOR.step(p, s, WET._replace(volume=volume), 0.0)
            commands.append(command)
            volume = max(volume - 0.3 * 0.5 * p.rate.rate * 12.0, -3.5e-4)
        tried = sum(command < 0.0 for command in commands) * 0.3
        assert 0.0 < tried < 5.0
        assert commands[-1] == p.push.surface_command

    @pytest.mark.promise("full-buoyancy", faults=["actuator weak at depth"])
    @pytest.mark.parametrize(
        ("depth", "sinks", "tried"),
        [(30.0, -0.05, False), (30.0, 0.05, True), (0.1, 0.0, False), (2.0, 0.0, True)],
    )
    def test_a_volume_that_goes_while_the_vehicle_rises_or_is_up_is_let_go(
        self, depth, sinks, tried
    ):
        """The motor wins as the load falls; a try the other way would cost 12 cm3 and more."""
        rows = self.driven(
            lambda _, u: -2e-6 if u > 0.0 else -5e-5, 2e-4, 40.0, sinks=sinks, depth=depth
        )
        assert (min(command for command, _ in rows) < 0.0) is tried

    @pytest.mark.promise("full-buoyancy", faults=["ticks lost", "volume drift"])
    def test_what_falls_over_ticks_that_are_lost_falls_slowly(self):
        """The reading of the volume drifts by 1 cm3/s, and a tick in 60 comes."""
        p = self.limits
        s, commands = SUPERVISOR.initial(p, WET, 1.0), []
        for k in range(60):
            time = 18.0 * (k // 2) + 0.3 * (k % 2)
            seen = WET._replace(volume=3e-4 - 1e-6 * time, lost=59 if k % 2 == 0 else 0)
            command, s, _ = SUPERVISOR.step(p, s, seen._replace(depth=50.0 - 0.3 * time), 0.0)
            commands.append(command)
        assert min(commands) >= 0.0

    @pytest.mark.promise("full-buoyancy", faults=["bit flips"])
    @pytest.mark.parametrize("bit", [1, 2, 4])
    def test_a_bit_of_the_turns_that_flips_is_got_over_without_a_sensor(self, bit):
        """Both sensors are stuck: nothing else would tell that the push goes the wrong way."""
        commands, s = self.after(30)
        s = s._replace(push=s.push._replace(turns=s.push.turns ^ bit))
        commands = []
        for _ in range(30):
            command, s, _ = SUPERVISOR.step(self.limits, s, WET, 0.0)
            commands.append(command)
        assert sum(command < 0.0 for command in commands) <= self.limits.push.astray + 1
        assert set(commands[10:]) == {self.limits.push.surface_command}

    @pytest.mark.promise("full-buoyancy", faults=["bit flips", "both sensors stuck"])
    def test_a_volume_that_a_flipped_bit_takes_for_fallen_costs_one_try(self):
        """The bits of what the push has brought, and both sensors stuck: a try gains nothing."""
        commands, s = self.after(30)
        s, commands = s._replace(push=s.push._replace(pushed=1.0)), []
        for _ in range(200):
            command, s, _ = SUPERVISOR.step(self.limits, s, WET, 0.0)
            commands.append(command)
        tried = sum(command < 0.0 for command in commands)
        assert 0 < tried <= self.limits.push.again + 1
        assert commands[-1] == self.limits.push.surface_command

    @pytest.mark.promise("swapped-wires", faults=["actuator reversed"])
    @pytest.mark.parametrize("stands", [0.0, 4.0, 10.0])
    def test_wires_that_are_swapped_while_the_vehicle_rises_are_found(self, stands):
        """However long the piston stood at its outer end before."""
        p = self.limits
        rows = self.driven(
            lambda t, u: (1.0 if t < stands else -1.0) * p.rate.rate * u,
            3.5e-4,
            stands + 60.0,
            sinks=-0.5,
            depth=60.0,
        )
        least = min(volume for _, volume in rows)
        assert least > 3.5e-4 - 3.0 * p.rate.rate * 12.0  # 3 s at full rate
        assert rows[-1][1] >= p.volume.volume_high

    @pytest.mark.promise("swapped-wires", faults=["actuator slow", "actuator reversed"])
    def test_a_volume_that_goes_slowly_is_tried_with_a_part_before_the_vehicle_is_heavy(self):
        """1.66 % of the speed, the wrong way, while it rises by eqs (13) and (16)."""
        p, m = self.limits, plant(paper())
        s, z, w, extra = SUPERVISOR.initial(p, WET, 1.0), 40.0, -0.06, 2.1e-5
        rows = []
        for k in range(1500):
            volume = 1.75e-4 + extra + m.psi * (z - 40.0)
            slow = -1.0 if k >= 20 else 1.0
            seen = WET._replace(depth=z, volume=volume)
            command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            rows.append((command, extra, z))
            for _ in range(30):
                step = 0.01 * slow * 0.0166 * p.rate.rate * command
                extra += step - m.psi * 0.01 * w
                w -= 0.01 * (m.a_b * extra + w / 36.3)
                z += 0.01 * w
        tried = [k for k, row in enumerate(rows) if row[0] < 0.0]
        first = tried[: int(p.push.astray)]
        assert first == [*range(first[0], first[0] + int(p.push.astray))]
        for command, _, depth in rows[first[0] : first[-1]]:  # c = 7.707e-2 V/m takes a quarter
            assert 13.0 < depth < 52.0  # of 12 V at 39 m, and a start 0.165 of 12 V
            assert command == -6.0
        assert rows[first[-1] + 1][0] == p.push.away_command
        assert rows[first[0]][1] > -p.proof.sinks
        assert z < 0.0

    @pytest.mark.promise("swapped-wires", faults=["actuator reversed"])
    def test_a_try_overcomes_the_load_of_the_depth(self):
        """At 60 m, where a quarter of the voltage, 3 V, does not: c z is 4.6 V."""
        rate, load = self.limits.rate.rate, 7.707e-2 * 60.0

        def motor(_, u):
            return rate * (max(-u - load, 0.0) if u < 0.0 else -u)

        rows = self.driven(motor, 0.0, 60.0, depth=60.0)
        assert min(volume for _, volume in rows) > -2.0 * 0.3 * rate * 12.0
        assert rows[-1][1] >= self.limits.volume.volume_high

    @pytest.mark.promise("full-buoyancy", faults=["port throttled outward"])
    def test_the_last_of_the_stroke_is_pushed_out_however_slowly_it_comes(self):
        """0.1 cm3/s: a rest would lose it, and the vehicle may need all that there is."""
        p = self.limits
        rows = self.driven(
            lambda _, u: 1e-7 if u == p.push.surface_command else -1e-7,
            p.volume.volume_high + 1e-6,
            400.0,
        )
        assert max(volume for _, volume in rows) == pytest.approx(3.5e-4)

    def test_a_volume_that_creeps_inwards_by_itself_costs_two_seconds(self):
        """0.15 % of the stroke a second, whatever is commanded, as beside a motor that is slow."""
        p = self.limits
        s, commands = SUPERVISOR.initial(p, WET, 1.0), []
        for k in range(350):
            seen = WET._replace(volume=-0.3 * k * 1.5e-3 * 7e-4)
            command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            commands.append(command)
        tried = sum(command < 0.0 for command in commands)
        assert p.push.astray <= tried <= p.push.astray + 2
        assert commands[-1] == p.push.surface_command

    def test_wires_that_are_mended_unseen_are_found_as_the_vehicle_sinks(self):
        """The volume is stuck since the push was turned round and had grown."""
        p = self.limits
        s, grew = SUPERVISOR.initial(p, WET, 1.0), []
        for k in range(200):
            volume = 1e-4 - 1e-5 * k if k < 2 else min(8e-5 + 1e-5 * k, 1.5e-4)
            depth = WET.depth - 0.01 * k if k < 80 else WET.depth - 0.8 + 0.05 * (k - 80)
            seen = WET._replace(volume=volume, depth=depth)
            command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            grew.append(command)
        assert grew[20] == p.push.away_command
        assert grew[80] == p.push.away_command  # it stands, and rises
        assert grew[-1] == p.push.surface_command

    @pytest.mark.promise("swapped-wires", faults=["volume stuck"])
    def test_a_volume_that_lies_and_then_stands_is_not_believed_for_long(self):
        """It read inwards while the piston went out; then it is stuck, and the vehicle sinks."""
        p = self.limits
        s, commands = SUPERVISOR.initial(p, WET, 1.0), []
        for k in range(200):
            seen = WET._replace(volume=-1e-5 * min(k, 1), depth=WET.depth + 0.03 * k)
            command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            commands.append(command)
        tried = sum(command < 0.0 for command in commands)
        assert 0 < tried <= p.push.again + 2
        assert commands[-1] == p.push.surface_command

    def test_a_lost_tick_turns_a_try_back(self):
        """A pause of the board would make the try last."""
        p = self.limits
        s, commands = SUPERVISOR.initial(p, WET, 1.0), []
        for k in range(12):
            seen = WET._replace(volume=-1e-5 * k, lost=1 if k == 2 else 0)
            command, s, _ = SUPERVISOR.step(p, s, seen, 0.0)
            commands.append(command)
        assert commands[1] < 0.0
        assert set(commands[2:]) == {p.push.surface_command}

    @pytest.mark.promise("full-buoyancy", faults=["actuator slow"])
    def test_a_slow_actuator_is_pushed_without_rests(self):
        """0.4 % of its speed; one that stands still rests."""
        p = self.limits
        slow = self.driven(lambda _, u: 0.004 * p.rate.rate * u, 0.0, 600.0)
        assert {command for command, _ in slow} == {p.push.surface_command}
        stalled = self.driven(lambda *_: 0.0, 0.0, 600.0)
        assert {command for command, _ in stalled} == {p.push.surface_command, p.push.hold_command}

    @pytest.mark.promise("restarted", faults=["board resets"])
    @pytest.mark.promise("first-reason")
    def test_the_first_cause_stays_and_the_others_are_gathered(self):
        p = self.limits
        _, s = self.after(1)
        assert s.recovery.reason == Reason.RESTARTED
        _, s = self.after(int(p.board.leak))
        assert s.recovery.reason == Reason.RESTARTED
        assert reasons_in(s.recovery.reasons) == (Reason.RESTARTED, Reason.LEAK)
        again, healed, _ = SUPERVISOR.step(p, s, CALM, -12.0)
        assert healed.recovery.reasons == s.recovery.reasons
        assert again == p.push.surface_command

    @pytest.mark.promise("release")
    def test_the_weight_goes_where_the_vehicle_does_not_rise(self):
        p = self.limits
        assert self.after(int(p.push.release) - 1)[1].recovery.release is False
        assert self.after(int(p.push.release))[1].recovery.release is True
        blind = CALM._replace(depth=math.nan)
        assert self.after(int(p.push.release), blind)[1].recovery.release is True

    @pytest.mark.promise("release")
    def test_the_weight_stays_where_it_rises_or_floats(self):
        flown = fly(fault=lambda _, s: s._replace(leak=True), duration=1500.0)
        assert flown.ran.depth[-1] < 0.5
        assert not flown.vehicle.release

    @pytest.mark.promise("time-limit")
    def test_time_is_counted_beyond_what_16_bits_hold(self):
        p = changed(self.limits, time_blocks=5000, time_ticks=3)
        s = changed(SUPERVISOR.initial(p, CALM, 0.0), block=4999, tick=4095)
        over = []
        for _ in range(6):
            _, s, _ = SUPERVISOR.step(p, s, CALM, 0.0)
            over.append(Reason.TIME_LIMIT in reasons_in(s.recovery.reasons))
        assert over == [False, False, False, False, True, True]
